//! Contact solved live beside the look-ups, tick by tick, by the law at rest.
//!
//! To each configuration of the reference a straight way leads, in a random direction of C-space, as fast as the hand
//! may move. Contact is solved one tick before its end, and there, which is timed. It errs against the same exact
//! torques as the look-ups do: by what the scene's own law differs from that at rest.

use super::{Accuracy, Row, Study};
use crate::{
    JointVector,
    contact::{LiveSolver, Model, Status},
    proxy::Chain,
    random::Random,
    scene::Scene,
    sweep::reference::Reference,
};
use std::time::Instant;

/// Speed of the proxy's fastest contact node (m/s): a brisk hand. Faster: less is known from the tick before.
const SPEED: f64 = 0.2;

/// Name of its series.
pub const LIVE: &str = "live";

/// Seed of the directions.
const SEED: u64 = 24;

/// Way of one tick that ends at `q`, along random joint rates (rad or m).
fn way(chain: &Chain, q: &JointVector, period: f64, random: &mut Random) -> JointVector {
    let mut rates = JointVector::zeros(q.len());
    rates.iter_mut().for_each(|rate| *rate = random.between(-1.0, 1.0));
    let links = chain.links(q);
    let speed = |node: usize| {
        let columns = chain.node_jacobian(&links, node, chain.node_position(&links, node));
        columns.iter().zip(rates.iter()).map(|(column, rate)| *column * *rate).sum::<glam::DVec3>().length()
    };
    let fastest = (0..chain.nodes.len()).map(speed).fold(f64::MIN_POSITIVE, f64::max);
    rates.iter_mut().for_each(|rate| *rate *= SPEED * period / fastest);
    rates
}

/// The torques at the ends of the `ways` to `places`, each solved a tick after the place before it, and the mean time of
/// one in contact (s).
fn solve(model: &Model<'_>, places: &[JointVector], ways: &[JointVector]) -> (Vec<JointVector>, f64) {
    let mut solver = LiveSolver::new(model);
    let (mut spent, mut contacts) = (0.0, 0_u32);
    let mut at_end = |(q, way): (&JointVector, &JointVector)| {
        let mut before = *q;
        before.iter_mut().zip(way.iter()).for_each(|(before, way)| *before -= way);
        solver.solve(&before);
        let start = Instant::now();
        let found = solver.solve(q);
        if found.status == Status::Contact {
            spent += start.elapsed().as_secs_f64();
            contacts += 1;
        }
        found.torque
    };
    let torques = places.iter().zip(ways).map(&mut at_end).collect();
    (torques, spent / f64::from(contacts.max(1)))
}

/// Errors and time of contact solved live, relative to a look-up of `linear`.
pub(super) fn live(scene: &Scene, model: &Model<'_>, reference: &Reference, study: &mut Accuracy) {
    let model = model.with_contact(scene.contact);
    let (mut random, period) = (Random::new(SEED), 1.0 / scene.haptics.rate);
    let ways: Vec<JointVector> = reference.places.iter().map(|q| way(model.chain, q, period, &mut random)).collect();
    let (torques, mut solved) = solve(&model, &reference.places, &ways);
    for _ in 1..study.rounds {
        solved = solved.min(solve(&model, &reference.places, &ways).1);
    }
    study.solution = solved;
    let mut answers = torques.into_iter();
    let zero = JointVector::zeros(model.chain.joints.len());
    let (rms, worst) = reference.errors(|_| answers.next().unwrap_or(zero));
    study.rows.push(Row {
        study: Study::Lookup,
        series: LIVE.to_owned(),
        setting: "every tick".to_owned(),
        value: 1.0,
        points: 0,
        solved: 0,
        bytes: 0,
        cost: solved / study.look_up,
        rms,
        worst,
    });
}
