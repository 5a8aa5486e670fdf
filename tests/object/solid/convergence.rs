//! The figure of `docs/solids.md`: how the error of rigid indenters on a block of gel, and of a pressure, falls with the
//! size of the cubes; beside it that of linear tetrahedra, which lock.

use super::accuracy::{RATIOS, compliance, reference};
use super::indentation::{INDENTERS, converged, gel, pressed};
use super::*;
use haptize::draw::{diagram::Diagram, plot::Curve};
use haptize::report::write_png;

/// Cubes under the indenters, as small as the surface gets by itself; cubes of the block under the pressure; edges of the
/// tetrahedra (m).
const CUBES: [f64; 4] = [0.0106, 0.008, 0.0065, 0.0053];
const BLOCK_CUBES: [f64; 4] = [0.0167, 0.0125, 0.01, 0.0085];
const EDGES: [f64; 4] = [0.0125, 0.01, 0.00625, 0.005];

/// Radius of the pressure, and height of the block (m).
const RADIUS: f64 = 0.01;
const HEIGHT: f64 = 0.05;

/// A block of 100 x 100 x 50 mm of linear tetrahedra, six in each cube, fixed below.
struct Linear {
    /// Nodes along each axis.
    counts: [usize; 3],
    edge: f64,
    /// Stiffness of a cube between its corners, z fastest (N/m).
    cube: Vec<DMat3>,
}

impl Linear {
    fn new(poisson: f64, edge: f64) -> Self {
        let (lambda, mu) =
            (YOUNG * poisson / ((1.0 + poisson) * (1.0 - 2.0 * poisson)), YOUNG / (2.0 * (1.0 + poisson)));
        let mut cube = vec![DMat3::ZERO; 64];
        for path in [[0, 1, 2], [1, 2, 0], [2, 0, 1], [0, 2, 1], [2, 1, 0], [1, 0, 2]] {
            // Along the path from one corner to the opposite one: x, say, grows from the first node to the second.
            let corners = [0, 4 >> path[0], (4 >> path[0]) + (4 >> path[1]), 7];
            let axes = path.map(|axis| DVec3::AXES[axis] / edge);
            let gradients = [-axes[0], axes[0] - axes[1], axes[1] - axes[2], axes[2]];
            for ((&a, &ga), (&b, &gb)) in
                corners.iter().zip(&gradients).flat_map(|a| corners.iter().zip(&gradients).map(move |b| (a, b)))
            {
                let outer = |u: DVec3, v: DVec3| DMat3::from_cols(u * v.x, u * v.y, u * v.z);
                let block =
                    lambda * outer(ga, gb) + mu * (outer(gb, ga) + DMat3::from_diagonal(DVec3::splat(ga.dot(gb))));
                cube[8 * a + b] += edge.powi(3) / 6.0 * block;
            }
        }
        let along = |length: f64| (length / edge).round() as usize + 1;
        Self { counts: [along(0.1), along(0.1), along(HEIGHT)], edge, cube }
    }

    fn node(&self, [x, y, z]: [usize; 3]) -> usize {
        (x * self.counts[1] + y) * self.counts[2] + z
    }

    /// Forces on all nodes but those that are fixed under the displacement `u`.
    fn forces(&self, u: &[DVec3]) -> Vec<DVec3> {
        let mut forces = vec![DVec3::ZERO; u.len()];
        let [x, y, z] = self.counts.map(|count| count - 1);
        for k in 0..x * y * z {
            let at = [k / (y * z), k / z % y, k % z];
            let nodes: [usize; 8] =
                std::array::from_fn(|c| self.node([at[0] + (c >> 2), at[1] + (c >> 1 & 1), at[2] + (c & 1)]));
            for (a, b) in (0..8).flat_map(|a| (0..8).map(move |b| (a, b))) {
                forces[nodes[a]] += self.cube[8 * a + b] * u[nodes[b]];
            }
        }
        forces.iter_mut().step_by(self.counts[2]).for_each(|force| *force = DVec3::ZERO);
        forces
    }

    /// Mean displacement under the pressure of the references, over its force (m/N).
    fn compliance(&self) -> f64 {
        // The pressure on the nodes, by their shape functions in the two triangles of each square.
        let mut load = vec![DVec3::ZERO; self.counts.iter().product()];
        let fine = 20;
        let (nx, step) = (self.counts[0] - 1, self.edge / f64::from(fine));
        for k in 0..nx * nx * (fine * fine) as usize {
            let (square, part) = (k / (fine * fine) as usize, k % (fine * fine) as usize);
            let [i, j] = [square / nx, square % nx];
            let [u, v] = [part / fine as usize, part % fine as usize].map(|i| (i as f64 + 0.5) / f64::from(fine));
            let [x, y] = [i as f64 + u, j as f64 + v].map(|at| at * self.edge - 0.05);
            let pressure = (1.0 - (x * x + y * y) / (RADIUS * RADIUS)).max(0.0).powi(2) * step * step;
            for (at, weight) in [
                ([0, 0], 1.0 - u.max(v)),
                ([1, 1], u.min(v)),
                ([usize::from(u > v), usize::from(u <= v)], (u - v).abs()),
            ] {
                load[self.node([i + at[0], j + at[1], self.counts[2] - 1])].z -= weight * pressure;
            }
        }
        // Conjugate gradients.
        let dot = |a: &[DVec3], b: &[DVec3]| a.iter().zip(b).map(|(a, b)| a.dot(*b)).sum::<f64>();
        let mut u = vec![DVec3::ZERO; load.len()];
        let (mut residual, mut direction) = (load.clone(), load.clone());
        let mut square = dot(&residual, &residual);
        let start = square;
        while square > 1e-11 * start {
            let forces = self.forces(&direction);
            let along = square / dot(&direction, &forces);
            for k in 0..u.len() {
                u[k] += along * direction[k];
                residual[k] -= along * forces[k];
            }
            let next = dot(&residual, &residual);
            direction.iter_mut().zip(&residual).for_each(|(direction, r)| *direction = *r + next / square * *direction);
            square = next;
        }
        let force: f64 = load.iter().map(|load| load.z.abs()).sum();
        dot(&u, &load) / (force * force)
    }
}

#[test]
#[ignore = "draws a figure in minutes: docs/solids.sh"]
fn errors_fall_with_the_size_of_the_cubes() {
    let names = INDENTERS.map(|(name, ..)| name);
    let mut curves: [Vec<Curve>; 4] = Default::default();
    for (number, poisson) in RATIOS.into_iter().enumerate() {
        let series = |name, points: Vec<(f64, f64)>, dashed| Curve { dashed, ..Curve::new(name, number, points) };
        let percent = |found: f64, expected: f64| 100.0 * (found / expected - 1.0).abs();
        let mut points: [Vec<(f64, f64)>; 4] = Default::default();
        for cell in CUBES {
            let gel = gel(poisson, Some(cell));
            for (points, (name, height, depth)) in points.iter_mut().zip(INDENTERS) {
                points.push((cell * 1e3, percent(pressed(&gel, height, depth), converged(name, poisson))));
            }
        }
        for cell in BLOCK_CUBES {
            let block = solid(
                block([40, 40, 20], 0.0025),
                elastic(poisson, Some(cell)),
                clamped(1e-6),
                DMat3::IDENTITY,
                DVec3::ZERO,
            );
            let found = compliance(&block, HEIGHT * DVec3::Z, DVec3::Z);
            points[3].push((cell * 1e3, percent(found, reference("block", poisson))));
        }
        for (name, points) in names.iter().chain(&["pressure"]).zip(&points) {
            println!("{name}, nu {poisson}: {points:.1?}");
            let errors: Vec<f64> = points.iter().map(|point| point.1).collect();
            assert!(errors[3] < 3.0, "{name}, {poisson}: {errors:?}");
        }
        for (curves, points) in curves.iter_mut().zip(points) {
            curves.push(series(format!("nu = {poisson}"), points, false));
        }
        let linear: Vec<(f64, f64)> = EDGES
            .iter()
            .map(|&edge| (edge * 1e3, percent(Linear::new(poisson, edge).compliance(), reference("block", poisson))))
            .collect();
        println!("linear tetrahedra, nu {poisson}: {linear:.1?}");
        // As an independent program says (solids.md): they lock.
        assert!(linear.iter().all(|(_, error)| *error > 10.0));
        curves[3].push(series(String::new(), linear, true));
    }
    let note = "rigid indenters on a clamped block of 100 x 100 x 50 mm; dashed: linear tetrahedra";
    let mut sheet = Diagram::new("Error of force against the converged solution", note, 2);
    for (number, (curves, name)) in curves.iter().zip(["ball", "capsule", "flat punch", "pressure"]).enumerate() {
        sheet.panel(number, "Size of the cubes [mm]", &format!("Error, {name} [%]"), curves, &[]);
    }
    sheet.legend(&curves[0], Vec::new());
    let folder = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("out/solids");
    println!("{}", write_png(&folder, "solids-convergence", &sheet.canvas()).unwrap().display());
}
