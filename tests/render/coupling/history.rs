//! Relaxation in the loop against the object itself with its whole history: a membrane on a foundation, whose every node
//! remembers where it was, under one finger and under three.
//!
//! A synchronous material obeys `K u = f + sum g_i K z_i`, `z_i' = (u - z_i) / theta_i`, u and z_i the nodes': the force
//! f pushes a surface that stands at `d = sum g_i z_i`. Nothing here is the engine's but the loop that is tested.

use haptize::{
    JointVector,
    contact::Status,
    dataset::{Axis, Dataset, Grid, SlipColumns},
    fixtures::worlds::block_scene,
    render::{haptic::Inputs, setup::Setup},
};

/// Nodes of the membrane (1), and their spacing (m).
const NODES: usize = 241;
const SPACING: f64 = 1e-3;
/// Foundation (N/m^2).
const FOUNDATION: f64 = 4e4;
/// Bending (N m^2) and tension (N) of a skin, and of a sheet: a dent is round, or a cusp.
const SKIN: [f64; 2] = [4e-4, 1.0];
const SHEET: [f64; 2] = [1e-6, 4.0];
/// Shares and times of the relaxation (1, s).
const TERMS: [[f64; 2]; 2] = [[0.4, 0.05], [0.2, 0.5]];
/// Three points of a finger.
const THREE: [[f64; 2]; 3] = [[-0.006, 0.001], [0.0, 0.0], [0.006, 0.001]];
/// Greatest depth that is stored, and points along it (m, 1).
const DEPTH: f64 = 0.01;
const DEPTHS: usize = 41;

/// The membrane's compliance (m/N), by elimination, and the finger's points: place along it, and height over its tip.
struct Membrane {
    compliance: Vec<Vec<f64>>,
    points: Vec<[f64; 2]>,
}

impl Membrane {
    fn new([bending, tension]: [f64; 2], points: &[[f64; 2]]) -> Self {
        let mut rows = vec![vec![0.0; 2 * NODES]; NODES];
        for j in 0..NODES {
            rows[j][j] += FOUNDATION * SPACING;
            rows[j][NODES + j] = 1.0;
            if j + 1 < NODES {
                let stretch = tension / SPACING;
                for (a, b, value) in
                    [(j, j, stretch), (j + 1, j + 1, stretch), (j, j + 1, -stretch), (j + 1, j, -stretch)]
                {
                    rows[a][b] += value;
                }
            }
            if j > 0 && j + 1 < NODES {
                let second = [(j - 1, 1.0), (j, -2.0), (j + 1, 1.0)];
                for (a, x) in second {
                    second.iter().for_each(|&(b, y)| rows[a][b] += bending / SPACING.powi(3) * x * y);
                }
            }
        }
        for pivot in 0..NODES {
            let scale = rows[pivot][pivot];
            rows[pivot].iter_mut().for_each(|entry| *entry /= scale);
            let own = rows[pivot].clone();
            for (k, row) in rows.iter_mut().enumerate() {
                let factor = row[pivot];
                if k != pivot && factor != 0.0 {
                    row.iter_mut().zip(&own).for_each(|(entry, own)| *entry -= factor * own);
                }
            }
        }
        Self { compliance: rows.into_iter().map(|row| row[NODES..].to_vec()).collect(), points: points.to_vec() }
    }

    /// Way over which the finger leaves the dent that it made: a dent of the same forces so far beside has 1/e of the
    /// energy in common with it (m). For one point that is how far beside it its dent is 1/e as deep.
    fn dent(&self) -> f64 {
        let forces = self.forces([0.0, DEPTH], &[0.0; NODES]);
        let shared = |way: f64| -> f64 {
            let pairs =
                self.points.iter().zip(&forces).flat_map(|a| self.points.iter().zip(&forces).map(move |b| (a, b)));
            pairs.map(|(([a, _], f), ([b, _], g))| f * g * self.between(*a, b + way)).sum()
        };
        let whole = shared(0.0);
        let ways = (0..).map(|step| 0.1 * SPACING * f64::from(step));
        ways.into_iter().find(|way| shared(*way) < whole / std::f64::consts::E).unwrap()
    }

    /// The membrane's compliance between two places (m/N).
    fn between(&self, a: f64, b: f64) -> f64 {
        let (node, weights) = Self::at(a);
        (0..2).map(|k| weights[k] * Self::mean(&self.compliance[node + k], b)).sum()
    }

    /// Node before a place, and weights of it and the next.
    fn at(place: f64) -> (usize, [f64; 2]) {
        let steps = (place / SPACING + 0.5 * (NODES - 1) as f64).clamp(0.0, (NODES - 2) as f64);
        let node = steps.floor();
        (node as usize, [1.0 - (steps - node), steps - node])
    }

    fn mean(vector: &[f64], place: f64) -> f64 {
        let (node, weights) = Self::at(place);
        weights[0] * vector[node] + weights[1] * vector[node + 1]
    }

    /// Force of each point (N) with the finger at (slide, press), where the surface without it stands at `d` (m): the
    /// set of points that push is the one in which all push and no other is inside.
    fn forces(&self, [slide, press]: [f64; 2], d: &[f64]) -> Vec<f64> {
        let places: Vec<f64> = self.points.iter().map(|[along, _]| slide + along).collect();
        let depths: Vec<f64> = self
            .points
            .iter()
            .zip(&places)
            .map(|([_, height], place)| press - height - Self::mean(d, *place))
            .collect();
        let compliance = |a: usize, b: usize| self.between(places[a], places[b]);
        let count = places.len();
        for set in (0..1_usize << count).rev() {
            let pushing: Vec<usize> = (0..count).filter(|i| set >> i & 1 == 1).collect();
            let found = solve(&pushing, compliance, &depths);
            let mut forces = vec![0.0; count];
            pushing.iter().zip(&found).for_each(|(i, force)| forces[*i] = *force);
            let is_left = |i: usize| depths[i] - (0..count).map(|j| compliance(i, j) * forces[j]).sum::<f64>();
            if found.iter().all(|force| *force >= 0.0) && (0..count).all(|i| set >> i & 1 == 1 || is_left(i) <= 1e-15) {
                return forces;
            }
        }
        vec![0.0; count]
    }

    /// U of a membrane without a past (J).
    fn energy(&self, at: [f64; 2]) -> f64 {
        let forces = self.forces(at, &[0.0; NODES]);
        let depths = self.points.iter().zip(&forces).map(|([_, height], force)| 0.5 * force * (at[1] - height));
        depths.sum()
    }

    /// The membrane, haptized over 40 mm and the depth, its scene with the relaxation.
    fn haptized(&self) -> Dataset {
        let axis = |name: &str, start: f64, step: f64, count: usize| Axis {
            name: name.into(),
            unit: "m".into(),
            start,
            step,
            count,
        };
        let grid = Grid {
            axes: vec![
                axis("slide", -0.06, 0.004, 31),
                axis("press", -0.002, (DEPTH + 0.002) / (DEPTHS - 1) as f64, DEPTHS),
            ],
        };
        let [[a, b], [c, d]] = TERMS;
        let scene = block_scene(&format!(
            "[haptics]\ninterpolation = \"potential\"\ncoupling_stiffness = 1e5\ncoupling_damping = 100.0\n\
             device_damping = 1e3\nproxy_damping = [1.0, 1.0]\nspeed_limit = 10.0\n[object.relaxation]\n\
             terms = [[{a}, {b}], [{c}, {d}]]\ndent = {}\n",
            self.dent()
        ));
        let normal_force = (0..grid.points()).map(|point| {
            let q = grid.configuration(point);
            self.forces([q[0], q[1]], &[0.0; NODES]).iter().sum::<f64>() as f32
        });
        let slip = SlipColumns {
            normal_force: normal_force.collect::<Vec<_>>().into(),
            jacobian: [1.0, 0.0, 0.0].repeat(grid.points()).into(),
        };
        let field = |q: &JointVector| {
            let forces = self.forces([q[0], q[1]], &[0.0; NODES]);
            let force: f64 = forces.iter().sum();
            let beside = |step: f64| self.energy([q[0] + step, q[1]]);
            let sideways = -(beside(1e-5) - beside(-1e-5)) / 2e-5;
            let status = if force > 0.0 { Status::Contact } else { Status::Free };
            (JointVector::from_slice(&[sideways, -force]), self.energy([q[0], q[1]]), status)
        };
        let data = Dataset::of_field(grid, field);
        Dataset { slip: Some(slip), scene, ..data }
    }

    /// Rms difference of the normal force that the loop has from that of the membrane with its history, over the rms of
    /// the latter, from `from` (s) on with the finger at `motion(t)`; and the energy that sliding took of the finger,
    /// the loop's over the membrane's.
    fn compared(&self, seconds: f64, from: f64, motion: impl Fn(f64) -> [f64; 2]) -> [f64; 2] {
        let setup = Setup::new(&self.haptized()).unwrap();
        let at = |k: usize| JointVector::from_slice(&motion(1e-3 * k as f64));
        let mut state = setup.haptics.start(&at(0)).unwrap();
        let mut past = TERMS.map(|_| vec![0.0; NODES]);
        let (mut missed, mut whole, mut works) = (0.0, 0.0, [0.0; 2]);
        let mut before: Option<(JointVector, f64)> = None;
        for k in 0..(1e3 * seconds) as usize {
            let inputs = Inputs { position: at(k), age: 0.0, elapsed: 1e-3, interval: 1e-3 };
            let output = setup.haptics.tick(&mut state, &inputs);
            assert!(output.fault.is_none() && output.accounts.residual().abs() <= 1e-12 * output.accounts.exchanged);
            let d: Vec<f64> =
                (0..NODES).map(|j| TERMS.iter().zip(&past).map(|([share, _], z)| share * z[j]).sum()).collect();
            let finger = [output.proxy[0], output.proxy[1]];
            let forces = self.forces(finger, &d);
            let force: f64 = forces.iter().sum();
            if 1e-3 * k as f64 >= from {
                missed += (-output.sample.torque[1] - force).powi(2);
                whole += force.powi(2);
            }
            // Work of the membrane on the finger as it slides: the force times the slope of where it stands.
            let slope =
                |place: f64| (Self::mean(&d, place + SPACING) - Self::mean(&d, place - SPACING)) / (2.0 * SPACING);
            let sideways: f64 =
                self.points.iter().zip(&forces).map(|([along, _], f)| f * slope(finger[0] + along)).sum();
            if let Some((last, given)) = before
                && 1e-3 * k as f64 >= from
            {
                works[0] -= output.accounts.field_work - given;
                works[1] += force * (output.proxy[1] - last[1]) - sideways * (output.proxy[0] - last[0]);
            }
            before = Some((output.proxy, output.accounts.field_work));
            let mut u = d;
            for ([along, _], force) in self.points.iter().zip(&forces).filter(|(_, force)| **force > 0.0) {
                let (node, weights) = Self::at(finger[0] + along);
                for (row, weight) in self.compliance[node..].iter().zip(weights) {
                    u.iter_mut().zip(row).for_each(|(u, c)| *u += c * weight * force);
                }
            }
            for (z, [_, time]) in past.iter_mut().zip(TERMS) {
                let left = (-1e-3 / time).exp();
                z.iter_mut().zip(&u).for_each(|(z, u)| *z = u + (*z - u) * left);
            }
        }
        [(missed / whole).sqrt(), works[0] / works[1]]
    }
}

/// Forces of the points in `pushing` that take their depths away.
fn solve(pushing: &[usize], compliance: impl Fn(usize, usize) -> f64, depths: &[f64]) -> Vec<f64> {
    let count = pushing.len();
    let mut rows: Vec<Vec<f64>> =
        pushing.iter().map(|&i| pushing.iter().map(|&j| compliance(i, j)).chain([depths[i]]).collect()).collect();
    for pivot in 0..count {
        let scale = rows[pivot][pivot];
        rows[pivot].iter_mut().for_each(|entry| *entry /= scale);
        let own = rows[pivot].clone();
        for (k, row) in rows.iter_mut().enumerate() {
            let factor = row[pivot];
            if k != pivot {
                row.iter_mut().zip(&own).for_each(|(entry, own)| *entry -= factor * own);
            }
        }
    }
    rows.into_iter().map(|row| row[count]).collect()
}

/// Down in 50 ms, held, half up in 50 ms, held, away.
fn press(t: f64) -> f64 {
    let points = [(0.0, -0.001), (0.05, 0.008), (1.0, 0.008), (1.05, 0.005), (2.0, 0.005), (2.05, -0.001)];
    let place = points.windows(2).find(|pair| t < pair[1].0);
    place.map_or(-0.001, |pair| pair[0].1 + (pair[1].1 - pair[0].1) * (t - pair[0].0) / (pair[1].0 - pair[0].0))
}

#[test]
fn a_press_a_hold_and_a_release_are_those_of_the_membrane_with_its_history() {
    for (name, kind, points) in [
        ("one finger on a skin", SKIN, &[[0.0, 0.0]][..]),
        ("one finger on a sheet", SHEET, &[[0.0, 0.0]]),
        ("two far apart on a skin, one 3 mm above the other", SKIN, &[[-0.03, 0.0], [0.03, 0.003]]),
        ("three side by side on a skin, the middle one lowest", SKIN, &THREE),
        ("three side by side on a sheet, the middle one lowest", SHEET, &THREE),
    ] {
        let membrane = Membrane::new(kind, points);
        let [error, _] = membrane.compared(2.4, 0.0, |t| [0.0, press(t)]);
        println!("{name}: press, hold, release err by {:.2} % rms", 100.0 * error);
        assert!(error < 0.02, "{name}: {error}");
    }
}

#[test]
fn scrapes_are_those_of_the_membrane_with_its_history() {
    for (name, kind, points) in [
        ("one finger on a skin", SKIN, &[[0.0, 0.0]][..]),
        ("one finger on a sheet", SHEET, &[[0.0, 0.0]]),
        ("three side by side on a skin", SKIN, &THREE),
        ("three side by side on a sheet", SHEET, &THREE),
    ] {
        let membrane = Membrane::new(kind, points);
        for speed in [0.5, 2.0, 8.0, 32.0] {
            // Pressed for a second, then along 90 mm, for three seconds at most.
            let seconds = 1.0 + f64::min(3.0, 0.09 / (speed * membrane.dent()));
            let along = |t: f64| -0.045 + speed * membrane.dent() * (t - 1.0).max(0.0);
            let motion = |t: f64| [along(t), press(t.min(0.5))];
            let [error, drag] = membrane.compared(seconds, 1.0, motion);
            println!(
                "{name}: a scrape at {speed} dents a second errs by {:.2} % rms, the work of sliding is {drag:.2} of \
                 the membrane's",
                100.0 * error
            );
            assert!(error < 0.07, "{name}, {speed}: {error}");
        }
    }
}
