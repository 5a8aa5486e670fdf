//! The loop over stores with levels, all gains at their bounds, under a hand that shakes: nothing is given.

use super::fixture::{is, step, store};
use haptize::{
    JointVector,
    dataset::{Axis, Dataset, Grid, Provenance},
    fixtures::{Random, worlds::half_space},
    render::{haptic::Inputs, setup::Setup},
    store::record::{slope, width},
};
use std::sync::Arc;

/// Ticks for each number of joints: ten times as many were run once.
const TICKS: usize = 100_000 / 6;

/// Period of the loop (s).
const PERIOD: f64 = 1e-3;

/// Part of its bound that each gain takes up at least (1): the proxy's damping keeps a margin of 1e-12.
const AT_ITS_BOUND: f64 = 1.0 - 1e-9;

/// Root of the energy over the joints' sum (sqrt(J)/rad), and how far it is off that at random at each node, on all
/// levels (sqrt(J)).
const ROOT: f64 = 2.0;
const ROUGHNESS: f64 = 0.05;

/// An uneven half space that all joints press alike, at several levels; its scene has the `tables`.
fn uneven(joints: usize, tables: &str) -> Dataset {
    let mut random = Random::new(joints as u64);
    let levels = [0, 5, 4, 3, 3, 2, 2][joints];
    let store = store(joints, levels, 0.6, joints as u64, move |q| {
        let mut numbers = vec![0.0; width(joints)];
        numbers[0] = ROOT * q.iter().sum::<f64>() + ROUGHNESS * random.between(-1.0, 1.0);
        (0..joints).for_each(|a| numbers[slope(a)] = ROOT);
        numbers
    });
    let count = store.space().last(0)[0] as usize + 1;
    let axis = |a: usize| Axis { name: "q".into(), unit: "rad".into(), start: -0.2, step: step(a), count };
    let grid = Grid { axes: (0..joints).map(axis).collect() };
    Dataset::refined(Arc::new(store), grid, None, half_space(joints, tables).scene, Provenance::default())
}

/// With memory and friction; contacts slip as the store's fixture says, in all directions.
#[test]
fn random_ticks_with_gains_at_their_bounds_give_nothing() {
    for joints in 1..=6 {
        let mut random = Random::new(joints as u64);
        let mut of = |least: f64, greatest: f64| least * (greatest / least).powf(random.between(0.0, 1.0));
        let (share, times, mu) = (of(0.1, 0.45), [of(2e-3, 10.0), of(2e-3, 10.0)], of(0.05, 2.0));
        let (damping, damper) = (of(0.02, 2.0), of(0.05, 0.9));
        let data = |proxy_damping: &str| {
            uneven(
                joints,
                &format!(
                    "[haptics]\ninterpolation = \"potential\"\ndevice_damping = {damping}\ncoupling_damping = {}\n\
                     coupling_stiffness = {}\ntorque_limit = 1e6\ntorque_rate_limit = 1e9\n{proxy_damping}\
                     [haptics.friction]\ncoefficient = {mu}\nstiffness = 5.0\n\
                     [object.relaxation]\nterms = [[{share}, {}], [{share}, {}]]\ndent = 0.1\n",
                    damper * damping,
                    2.0 * (damping - damper * damping) / PERIOD,
                    times[0],
                    times[1]
                ),
            )
        };
        // What is left out is not less than the coupling asks for: here it is as little as is passive.
        let setup = Setup::new(&data("")).unwrap();
        let least = setup.bounds.last().unwrap().value * setup.scene.haptics.proxy_damping[0] * (1.0 + f64::EPSILON);
        let setup = Setup::new(&data(&format!("proxy_damping = {least:?}\n"))).unwrap();
        let are_met = setup.bounds.iter().all(|bound| bound.value >= AT_ITS_BOUND * bound.safe);
        assert!(are_met && setup.bounds.len() == joints + 1, "{:?}", setup.bounds);
        assert!(setup.exceeded.is_empty(), "{:?}", setup.exceeded);
        let mut position = JointVector::zeros(joints);
        let mut state = setup.haptics.start(&position).unwrap();
        let (mut before, mut elapsed, mut touched) = ([0.0; 2], PERIOD, 0);
        for k in 0..TICKS {
            let interval = if is(&mut random, 0.15) { PERIOD * random.between(0.1, 1.0) } else { PERIOD };
            let speed = if k % 500 > 400 { 0.0 } else { 4.0 };
            for q in position.iter_mut() {
                *q = (*q + speed * elapsed * random.between(-1.0, 1.0)).clamp(-0.12, 0.1);
            }
            let output = setup.haptics.tick(&mut state, &Inputs { position, age: 0.0, elapsed, interval });
            let now = output.accounts;
            let rounding = 1e-12 * now.exchanged;
            assert!(output.fault.is_none() && now.residual().abs() <= rounding, "{joints} joints, {k}: {output:?}");
            let taken = [now.relaxed, now.friction_dissipation];
            assert!(
                (0..2).all(|a| taken[a] >= before[a] - rounding),
                "{joints} joints, {k}: {taken:?} after {before:?}"
            );
            // The leak of the time step stays below what the proxy's damping takes, and the hand is given nothing.
            assert!(now.leak <= now.proxy_dissipation + rounding, "{joints} joints, tick {k}: {now:?}");
            assert!(now.device_port().unwrap() >= -rounding, "{joints} joints, tick {k}: {now:?}");
            touched += usize::from(output.sample.contact);
            (before, elapsed) = (taken, interval);
        }
        assert!(before.iter().all(|taken| *taken > 1e-5), "{joints} joints: {before:?} J");
        assert!((TICKS / 20..TICKS * 19 / 20).contains(&touched), "{joints} joints: {touched} of {TICKS} in contact");
    }
}
