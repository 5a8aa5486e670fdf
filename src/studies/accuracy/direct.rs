//! `direct` beside the look-ups: equilibria solved along a way, and the tangent that the loop follows between them.
//!
//! To each configuration of the reference a straight way leads, in a random direction of C-space, as fast as the hand
//! may move. Along it an equilibrium is solved every few ticks, warm from the one before, and its tangent is evaluated
//! at the reference's configuration, so many ticks later. What is evaluated errs against the same exact torques as the
//! look-ups do; its time is that of both threads: a share of the solve, and the tangent.

use super::{Accuracy, AccuracyError, Row, Study, grids::LOOK_UPS, in_turns};
use crate::{
    JointVector,
    contact::{Model, Status},
    proxy::Chain,
    random::Random,
    scene::{Interpolation, Scene},
    sweep::{
        ahead::{Follower, Solution, Whereabouts},
        reference::Reference,
    },
};
use std::{hint::black_box, time::Instant};

/// Speed of the proxy's fastest contact node (m/s): a brisk hand. Faster: the tangent is followed farther.
const SPEED: f64 = 0.2;

/// Ticks from one solution to the next (1): every tick where a solution takes less; the last is as late as the loop
/// takes one.
const INTERVALS: [u64; 4] = [1, 2, 4, 8];

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

/// The place of `ticks` ago on the way to `q`.
fn ago(q: &JointVector, way: &JointVector, ticks: u64) -> Whereabouts {
    let mut at = Whereabouts::at_rest(q);
    at.position.iter_mut().zip(way.iter()).for_each(|(at, way)| *at -= ticks as f64 * way);
    at
}

/// The last solution before each of `places`, with one every `interval` ticks, and the mean time of one in contact (s).
fn solutions(model: &Model<'_>, places: &[JointVector], ways: &[JointVector], interval: u64) -> (Vec<Solution>, f64) {
    let (mut spent, mut contacts) = (0.0, 0_u32);
    let mut solve = |(number, (q, way)): (u64, (&JointVector, &JointVector))| {
        // All ages are as frequent.
        let age = number % interval;
        let mut follower = Follower::new(model);
        follower.solve(&ago(q, way, age + interval));
        let start = Instant::now();
        let solution = follower.solve(&ago(q, way, age));
        if solution.status == Status::Contact {
            spent += start.elapsed().as_secs_f64();
            contacts += 1;
        }
        solution
    };
    let found = (0..).zip(places.iter().zip(ways)).map(&mut solve).collect();
    (found, spent / f64::from(contacts.max(1)))
}

/// Errors and time of `direct`, relative to a look-up of `linear`.
pub(super) fn followed(
    scene: &Scene,
    model: &Model<'_>,
    reference: &Reference,
    study: &mut Accuracy,
) -> Result<(), AccuracyError> {
    let mut model = model.with_contact(scene.contact);
    model.with_tangent = true;
    let (mut random, period) = (Random::new(SEED), 1.0 / scene.haptics.rate);
    let ways: Vec<JointVector> = reference.places.iter().map(|q| way(model.chain, q, period, &mut random)).collect();
    for interval in INTERVALS {
        let (mut found, mut solved) = solutions(&model, &reference.places, &ways, interval);
        for _ in 1..study.rounds {
            let (again, mean) = solutions(&model, &reference.places, &ways, interval);
            (found, solved) = (again, solved.min(mean));
        }
        let tangents = in_turns(study.rounds, 1, |_| {
            for (solution, q) in found.iter().zip(&reference.places).cycle().take(LOOK_UPS) {
                black_box(solution.at(black_box(q)));
            }
            Ok::<(), AccuracyError>(())
        })?;
        if interval == 1 {
            study.solution = solved;
        }
        let mut answers = found.iter().zip(&reference.places);
        let zero = JointVector::zeros(model.chain.joints.len());
        let (rms, worst) = reference.errors(|_| answers.next().map_or(zero, |(solution, q)| solution.at(q).0));
        study.rows.push(Row {
            study: Study::Lookup,
            series: Interpolation::Direct.name().to_owned(),
            setting: if interval == 1 { "every tick".to_owned() } else { format!("every {interval} ticks") },
            value: interval as f64,
            points: 0,
            solved: 0,
            bytes: 0,
            cost: (solved / interval as f64 + tangents[0].0 / LOOK_UPS as f64) / study.look_up,
            rms,
            worst,
        });
    }
    Ok(())
}
