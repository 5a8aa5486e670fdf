//! Energy balance, equation of motion, stops.

use super::*;
use crate::{
    proxy::Chain,
    random::Random,
    scene::{JointKind, JointSpec, ProxySpec},
};
use glam::{DMat3, DVec3};

/// Numbers between -1 and 1, the same every time.
struct Noise(Random);

impl Noise {
    fn new(seed: u64) -> Self {
        Self(Random::new(seed))
    }

    fn next(&mut self) -> f64 {
        self.0.between(-1.0, 1.0)
    }

    fn vector(&mut self, joints: usize, scale: f64) -> JointVector {
        let mut vector = JointVector::zeros(joints);
        vector.iter_mut().for_each(|x| *x = scale * self.next());
        vector
    }

    /// B B^T + 0.1 I.
    fn inertia(&mut self, joints: usize) -> JointMatrix {
        let factor: Vec<JointVector> = (0..joints).map(|_| self.vector(joints, 1.0)).collect();
        let mut inertia = [[0.0; MAX_JOINTS]; MAX_JOINTS];
        for i in 0..joints {
            for j in 0..joints {
                inertia[i][j] = 0.01 * (factor[i].dot(&factor[j]) + if i == j { 0.1 } else { 0.0 });
            }
        }
        inertia
    }

    fn load(&mut self, joints: usize) -> Load {
        let positive = |mut v: JointVector| {
            v.iter_mut().for_each(|x| *x = x.abs());
            v
        };
        // Damping that couples the joints: B B^T.
        let mut damping = self.inertia(joints);
        damping.iter_mut().flatten().for_each(|entry| *entry *= 10.0);
        Load {
            stiffness: positive(self.vector(joints, 20.0)),
            target: self.vector(joints, 0.5),
            damping,
            torque: self.vector(joints, 3.0),
            stops: WIDE,
        }
    }
}

const WIDE: [[f64; 2]; MAX_JOINTS] = [[-1e3, 1e3]; MAX_JOINTS];

fn spring_energy(load: &Load, x: &JointVector) -> f64 {
    0.5 * (0..x.len()).map(|a| load.stiffness[a] * (x[a] - load.target[a]).powi(2)).sum::<f64>()
}

/// Change of stored energy less the work of everything, and the scale of its rounding (J).
fn imbalance(npmi: &Npmi, motion: &mut Motion, interval: f64, load: &Load) -> (f64, f64) {
    let stored = |m: &Motion| m.kinetic_energy() + spring_energy(load, &m.position);
    let before = stored(motion);
    let step = npmi.step(motion, interval, load);
    let after = stored(motion);
    let work = interval * step.velocity.dot(&load.torque);
    let loss = interval * step.velocity.dot(&product(&load.damping, &step.velocity));
    assert!(step.stop_work <= 1e-12 * (before + after), "stops give energy: {}", step.stop_work);
    (after - before - work + loss - step.stop_work, before + after + work.abs() + loss + step.stop_work.abs())
}

#[test]
fn energy_balances_to_rounding_for_any_sequence_of_steps() {
    let mut noise = Noise::new(7);
    for joints in 1..=MAX_JOINTS {
        let npmi = Npmi::new(&noise.inertia(joints), &WIDE[..joints]).unwrap();
        let mut motion = npmi.moving(&noise.vector(joints, 1.0), &noise.vector(joints, 5.0));
        for _ in 0..2000 {
            // 0.02 to 20 ms, jittering.
            let interval = 1e-3 * 10_f64.powf(1.5 * noise.next() - 0.2);
            let load = noise.load(joints);
            let (imbalance, scale) = imbalance(&npmi, &mut motion, interval, &load);
            assert!(imbalance.abs() < 1e-12 * scale, "{joints} joints: {imbalance} of {scale}");
        }
    }
}

#[test]
fn the_balance_notices_a_wrong_step() {
    let mut noise = Noise::new(3);
    let npmi = Npmi::new(&noise.inertia(3), &WIDE[..3]).unwrap();
    let mut motion = npmi.moving(&noise.vector(3, 1.0), &noise.vector(3, 1.0));
    let load = noise.load(3);
    let stored = |m: &Motion| m.kinetic_energy() + spring_energy(&load, &m.position);
    let before = stored(&motion);
    let step = npmi.step(&mut motion, 1e-3, &load);
    motion.momentum.iter_mut().for_each(|p| *p *= 1.0 + 1e-6);
    let loss = step.velocity.dot(&product(&load.damping, &step.velocity));
    let wrong = stored(&motion) - before - 1e-3 * (step.velocity.dot(&load.torque) - loss);
    assert!(wrong.abs() > 1e-9 * before);
}

#[test]
fn the_step_satisfies_the_equation_of_motion() {
    let mut noise = Noise::new(11);
    let inertia = noise.inertia(4);
    let npmi = Npmi::new(&inertia, &WIDE[..4]).unwrap();
    let start = npmi.moving(&noise.vector(4, 1.0), &noise.vector(4, 1.0));
    let (load, interval) = (noise.load(4), 3e-3);
    let mut end = start;
    let step = npmi.step(&mut end, interval, &load);
    for (a, row) in inertia.iter().enumerate().take(4) {
        let acceleration: f64 = (0..4).map(|b| row[b] * (end.velocity[b] - start.velocity[b])).sum();
        let midpoint = 0.5 * (start.position[a] + end.position[a]);
        let damping = step.velocity.dot(&load.damping[a]);
        let torque = load.torque[a] - damping - load.stiffness[a] * (midpoint - load.target[a]);
        assert!((acceleration / interval - torque).abs() < 1e-10);
    }
}

#[test]
fn stops_hold_and_only_take_energy() {
    let mut noise = Noise::new(23);
    for joints in 1..=MAX_JOINTS {
        let limits = [[-0.1, 0.15]; MAX_JOINTS];
        let npmi = Npmi::new(&noise.inertia(joints), &limits[..joints]).unwrap();
        let mut motion = Motion::at_rest(&JointVector::zeros(joints));
        let mut stops = 0;
        for _ in 0..4000 {
            let interval = 1e-3 * 10_f64.powf(1.2 * noise.next());
            let mut load = noise.load(joints);
            load.torque.iter_mut().for_each(|tau| *tau *= 5.0);
            load.stops = *npmi.limits();
            if noise.next() > 0.5 {
                // Stops of this step alone, anywhere on both sides.
                for (stop, x) in load.stops.iter_mut().zip(motion.position.iter()) {
                    *stop = [stop[0].max(x - 0.1 * noise.next().abs()), stop[1].min(x + 0.1 * noise.next().abs())];
                }
            }
            let (imbalance, scale) = imbalance(&npmi, &mut motion, interval, &load);
            assert!(imbalance.abs() < 1e-11 * scale, "{joints} joints: {imbalance} of {scale}");
            assert!(motion.position.iter().zip(load.stops).all(|(x, [low, high])| (low..=high).contains(x)));
            stops += motion.position.iter().filter(|x| **x == -0.1 || **x == 0.15).count();
        }
        assert!(stops > 500, "the stops were reached {stops} times only");
    }
}

#[test]
fn a_stop_pushes_and_never_holds_back() {
    let npmi = Npmi::new(&Noise::new(1).inertia(2), &[[-1.0, 0.0], [-1.0, 1.0]]).unwrap();
    let mut motion = Motion::at_rest(&JointVector::zeros(2));
    let mut load = Noise::new(1).load(2);
    load.stops = *npmi.limits();
    load.stiffness = JointVector::zeros(2);
    load.torque = JointVector::from_slice(&[1.0, 0.0]);
    let step = npmi.step(&mut motion, 1e-3, &load);
    assert!(step.stopped[0] && motion.position[0] == 0.0 && motion.velocity[0] == 0.0);
    load.torque = JointVector::from_slice(&[-1.0, 0.0]);
    let step = npmi.step(&mut motion, 1e-3, &load);
    assert!(!step.stopped[0] && motion.position[0] < 0.0);
}

#[test]
fn an_explicit_spring_is_bounded_at_the_bound_and_diverges_below_it() {
    let mut inertia = [[0.0; MAX_JOINTS]; MAX_JOINTS];
    inertia[0][0] = 1e-4;
    let npmi = Npmi::new(&inertia, &WIDE[..1]).unwrap();
    let (stiffness, interval) = (50.0, 1e-3);
    let swing = |share: f64| {
        let one = |x: f64| JointVector::from_slice(&[x]);
        let only = |x: f64| {
            let mut damping = [[0.0; MAX_JOINTS]; MAX_JOINTS];
            damping[0][0] = x;
            damping
        };
        let mut motion = Motion::at_rest(&one(0.01));
        let mut greatest: f64 = 0.0;
        for _ in 0..20_000 {
            let load = Load {
                stiffness: one(0.0),
                target: one(0.0),
                damping: only(share * stiffness * interval),
                torque: one(-stiffness * motion.position[0]),
                stops: WIDE,
            };
            npmi.step(&mut motion, interval, &load);
            greatest = greatest.max(motion.position[0].abs());
        }
        greatest
    };
    assert!(swing(0.5) < 0.02, "{}", swing(0.5));
    assert!(swing(0.4) > 10.0, "{}", swing(0.4));
}

#[test]
fn impossible_proxies_are_refused() {
    let mut inertia = Noise::new(5).inertia(3);
    let refused = |inertia: &_, limits: &[[f64; 2]]| Npmi::new(inertia, limits).err().map(|error| error.to_string());
    assert!(refused(&inertia, &[[0.0, f64::NAN]; 3]).is_some_and(|why| why.starts_with("joint 0's limits")));
    assert!(refused(&inertia, &[[1.0, 0.0]; 3]).is_some_and(|why| why.contains("not ascending")));
    for diagonal in [0.0, f64::NAN] {
        inertia[2][2] = diagonal;
        assert!(refused(&inertia, &WIDE[..3]).is_some_and(|why| why.contains("not positive definite")), "{diagonal}");
    }
}

/// An arm of `count` links whose inertia varies strongly with its posture.
fn arm(count: usize, limits: [f64; 2]) -> Chain {
    let joint = |k: usize| JointSpec {
        follows: None,
        name: format!("q{k}"),
        kind: if k == 4 { JointKind::Prismatic } else { JointKind::Revolute },
        origin: DVec3::new(if k == 0 { 0.0 } else { 0.3 }, 0.02 * k as f64, 0.0),
        axis: if k % 2 == 1 { DVec3::new(0.0, 0.6, 0.8) } else { DVec3::Z },
        limits,
        mass: 0.4,
        centre_of_mass: DVec3::new(0.15, 0.01, 0.02),
        inertia: DMat3::from_diagonal(DVec3::new(1e-4, 2e-3, 2e-3)),
        rotor_inertia: 1e-4,
        nodes: Vec::new(),
    };
    Chain::new(&ProxySpec { joints: (0..count).map(joint).collect(), ..Default::default() })
}

#[test]
fn energy_balances_with_the_inertia_of_a_chain_too() {
    let mut noise = Noise::new(29);
    for joints in 1..=MAX_JOINTS {
        for (limits, speed) in [([-1e3, 1e3], 20.0), ([-0.3, 0.4], 20.0)] {
            let npmi = Npmi::of_chain(&arm(joints, limits)).unwrap();
            let mut motion = npmi.moving(&noise.vector(joints, 0.2), &noise.vector(joints, speed));
            let mut stops = 0;
            for _ in 0..1000 {
                let interval = 1e-3 * 10_f64.powf(1.5 * noise.next() - 0.2);
                let mut load = noise.load(joints);
                load.stops = *npmi.limits();
                load.torque.iter_mut().for_each(|tau| *tau *= 5.0);
                let (imbalance, scale) = imbalance(&npmi, &mut motion, interval, &load);
                assert!(imbalance.abs() < 1e-11 * scale, "{joints} joints: {imbalance} of {scale}");
                assert!(motion.position.iter().all(|x| (limits[0]..=limits[1]).contains(x)));
                stops += motion.position.iter().filter(|x| limits.contains(x)).count();
            }
            assert!((limits[0] < -1.0) == (stops == 0), "{stops} stops");
        }
    }
}

/// Free motion of a chain for `seconds`, with steps of `interval`.
fn flown(npmi: &Npmi, interval: f64, seconds: f64) -> Motion {
    let joints = npmi.joints();
    let mut noise = Noise::new(5);
    let mut motion = npmi.moving(&noise.vector(joints, 0.5), &noise.vector(joints, 4.0));
    let zero = JointVector::zeros(joints);
    let load = Load {
        stiffness: zero,
        target: zero,
        damping: [[0.0; MAX_JOINTS]; MAX_JOINTS],
        torque: zero,
        stops: *npmi.limits(),
    };
    for _ in 0..(seconds / interval).round() as usize {
        npmi.step(&mut motion, interval, &load);
    }
    motion
}

#[test]
fn a_free_arm_keeps_its_energy_at_any_step_and_a_constant_inertia_would_not_follow_it() {
    let chain = arm(3, [-1e3, 1e3]);
    let npmi = Npmi::of_chain(&chain).unwrap();
    let start = flown(&npmi, 1e-3, 0.0).kinetic_energy();
    for interval in [1e-3, 1e-2] {
        let end = flown(&npmi, interval, 2.0);
        assert!((end.kinetic_energy() / start - 1.0).abs() < 1e-12);
        // The momentum's energy is that of the chain in motion, to the accuracy of the step.
        let inertia = chain.dynamics(&end.position, &end.velocity).inertia;
        let moving = 0.5 * end.velocity.dot(&product(&inertia, &end.velocity));
        assert!((moving / start - 1.0).abs() < 30.0 * interval, "{moving} for {start} at {interval} s");
    }
    let frozen = Npmi::new(&chain.dynamics(&[0.0; 3], &[0.0; 3]).inertia, &WIDE[..3]).unwrap();
    let (a, b) = (flown(&npmi, 1e-4, 0.5).position, flown(&frozen, 1e-4, 0.5).position);
    assert!((a[0] - b[0]).abs() > 0.1, "{a:?} and {b:?}");
}

#[test]
fn an_arm_moves_as_lagrange_s_equation_says() {
    // Reference: Runge and Kutta's fourth-order method on M vdot = -C v, C from the same dynamics, which finite
    // differences have confirmed.
    let chain = arm(3, [-1e3, 1e3]);
    let acceleration = |q: &JointVector, v: &JointVector| {
        let dynamics = chain.dynamics(q, v);
        let mut right = JointVector::zeros(3);
        for (i, right) in right.iter_mut().enumerate() {
            let row = |j: usize| 0.5 * dynamics.inertia_rate[i][j] + dynamics.coriolis[i][j];
            *right = -(0..3).map(|j| row(j) * v[j]).sum::<f64>();
        }
        solve_held(&dynamics.inertia, &right, &right, &[false; MAX_JOINTS])
    };
    let plus = |a: &JointVector, h: f64, b: &JointVector| {
        JointVector::from_slice(&[a[0] + h * b[0], a[1] + h * b[1], a[2] + h * b[2]])
    };
    let npmi = Npmi::of_chain(&chain).unwrap();
    let Motion { position: mut q, velocity: mut v, .. } = flown(&npmi, 1.0, 0.0);
    let h = 1e-4;
    for _ in 0..3000 {
        let (v1, a1) = (v, acceleration(&q, &v));
        let v2 = plus(&v, 0.5 * h, &a1);
        let a2 = acceleration(&plus(&q, 0.5 * h, &v1), &v2);
        let v3 = plus(&v, 0.5 * h, &a2);
        let a3 = acceleration(&plus(&q, 0.5 * h, &v2), &v3);
        let v4 = plus(&v, h, &a3);
        let a4 = acceleration(&plus(&q, h, &v3), &v4);
        for a in 0..3 {
            q[a] += h / 6.0 * (v1[a] + 2.0 * v2[a] + 2.0 * v3[a] + v4[a]);
            v[a] += h / 6.0 * (a1[a] + 2.0 * a2[a] + 2.0 * a3[a] + a4[a]);
        }
    }
    let error = |interval: f64| plus(&flown(&npmi, interval, 0.3).position, -1.0, &q).norm();
    let (coarse, fine) = (error(2e-3), error(1e-3));
    // First order in T, because the gyroscopic torque is taken at v_k: measured 2.2e-5 rad over 0.3 s at 1 ms.
    assert!(fine < 5e-5, "{fine} rad off after 0.3 s");
    assert!(coarse / fine > 1.8, "{coarse} at twice the step, {fine}");
}

#[test]
fn a_proxy_at_rest_at_zero_has_no_subnormal_state() {
    // Pulled to zero and damped: everything decays for ever.
    let npmi = Npmi::new(&Noise::new(3).inertia(2), &WIDE[..2]).unwrap();
    let mut load = Noise::new(3).load(2);
    (load.target, load.torque) = (JointVector::zeros(2), JointVector::zeros(2));
    let mut motion = Motion::at_rest(&JointVector::from_slice(&[0.1, -0.2]));
    for k in 0..200_000 {
        let step = npmi.step(&mut motion, 1e-3, &load);
        let states = motion.momentum.iter().chain(motion.velocity.iter()).chain(step.velocity.iter());
        assert!(!states.chain(motion.position.iter()).any(|x| x.is_subnormal()), "step {k}: {motion:?}");
        assert!(!motion.kinetic_energy().is_subnormal());
    }
    assert_eq!(motion.kinetic_energy(), 0.0);
}
