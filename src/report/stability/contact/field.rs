//! The torque as a field over C-space: continuous along paths, and minus the gradient of the stored energy.
//!
//! A path is solved in steps of two sizes. Where tau is continuous the largest change in a step shrinks with the step, where it
//! jumps it does not. Balls see the surface round. A point that lies inside changes facets at the planes that bisect convex
//! edges, where its normal turns at once: its tau jumps there, by no more than facets turn.

use super::super::{Bound, Effort, Failure, Outcome, Setting};
use super::world::{BALL, PAPER, RADIUS, contact, floating_bar, pressed, sphere};
use crate::{
    JointVector,
    contact::{Model, Solver, Status},
};
use rayon::prelude::*;

/// How far a unit normal's end moves from facet to facet of the sphere, 36 degrees apart at most: 2 sin 18 degrees [1].
const TURN: f64 = 0.62;

/// Largest change of tau in a step of a path from `a` to `b`, and the largest tau [N m]; steps at flagged points are left out.
fn largest_step(model: &Model<'_>, a: &[f64], b: &[f64], steps: usize) -> (f64, f64, usize) {
    let torques: Vec<Option<JointVector>> = (0..=steps)
        .into_par_iter()
        .map_init(
            || Solver::new(model),
            |solver, k| {
                let share = k as f64 / steps as f64;
                let q: Vec<f64> = a.iter().zip(b).map(|(a, b)| a + (b - a) * share).collect();
                let result = solver.solve(&q);
                (result.status != Status::Unconverged).then_some(result.torque)
            },
        )
        .collect();
    let mut largest = 0.0f64;
    let mut size = 0.0f64;
    for pair in torques.windows(2) {
        if let [Some(a), Some(b)] = pair {
            let square: f64 = a.iter().zip(b.iter()).map(|(a, b)| (a - b).powi(2)).sum();
            largest = largest.max(square.sqrt());
            size = size.max(b.norm());
        }
    }
    (largest, size, torques.iter().filter(|torque| torque.is_none()).count())
}

/// Paths from contact to contact, refined ten times.
pub fn continuity(setting: &Setting) -> Result<Vec<Outcome>, Failure> {
    let object = sphere(PAPER)?;
    let (paths, steps) = if setting.effort == Effort::Full { (20, 400) } else { (3, 100) };
    let mut outcomes = Vec::new();
    for (name, radius) in [("balls", BALL), ("points", 0.0)] {
        let chain = floating_bar(radius);
        let mut model = Model::new(&object, &chain, contact(1.0));
        let ends = pressed(&model, 11, paths, 0.05 * RADIUS, 0.15 * RADIUS);
        for stiffness in [1e2, 1e4] {
            model.set_stiffness(stiffness);
            let (mut worst, mut jump, mut flagged) = (0.0f64, 0.0f64, 0);
            for end in &ends {
                // A slide along the surface with a turn: 3 mm and 0.1 rad.
                let mut other = end.clone();
                for (x, step) in other.iter_mut().zip([0.002, -0.0015, 0.0015, 0.06, 0.06, -0.06]) {
                    *x += step;
                }
                let (coarse, _, _) = largest_step(&model, end, &other, steps);
                let (fine, size, missing) = largest_step(&model, end, &other, 10 * steps);
                worst = worst.max(fine / coarse.max(f64::MIN_POSITIVE));
                jump = jump.max(fine / size.max(f64::MIN_POSITIVE));
                flagged += missing;
            }
            let (measure, worst, bound, beside) = if radius > 0.0 {
                let beside = format!("largest step left {:.2} % of tau", 100.0 * jump);
                ("largest step after over before [1]", worst, 0.2, beside)
            } else {
                let beside = format!("largest step after over before: {worst:.2}");
                ("largest step left, over tau: a jump [1]", jump, TURN, beside)
            };
            outcomes.push(Outcome {
                case: "continuous torque".into(),
                varied: format!("{paths} paths of {steps} steps refined 10 times, {name}, Kc {stiffness:.0e}"),
                measure: measure.into(),
                worst,
                bound: Bound::AtMost(bound),
                note: format!("{beside}, {flagged} points flagged"),
            });
        }
    }
    Ok(outcomes)
}

/// Central differences of U at random configurations.
pub fn curl(setting: &Setting) -> Result<Vec<Outcome>, Failure> {
    let object = sphere(PAPER)?;
    let count = if setting.effort == Effort::Full { 200 } else { 20 };
    let h = 1e-6;
    let mut outcomes = Vec::new();
    for (name, radius) in [("balls", BALL), ("points", 0.0)] {
        let chain = floating_bar(radius);
        let mut model = Model::new(&object, &chain, contact(1.0));
        let configurations = pressed(&model, 12, count, 0.0, 0.2 * RADIUS);
        for stiffness in [1e2, 1e4] {
            model.set_stiffness(stiffness);
            let errors: Vec<Option<f64>> = configurations
                .par_iter()
                .map_init(
                    || Solver::new(&model),
                    |solver, q| {
                        let here = solver.solve(q);
                        let mut worst = 0.0f64;
                        for joint in 0..q.len() {
                            let [before, after] = [-h, h].map(|step| {
                                let mut q = q.clone();
                                q[joint] += step;
                                solver.solve(&q)
                            });
                            if [&here, &before, &after].iter().any(|result| result.status != Status::Contact) {
                                return None;
                            }
                            let slope = (after.energy - before.energy) / (2.0 * h);
                            // Forces of slides are weighed against torques of turns by a lever of a radius.
                            let lever = if joint < 3 { RADIUS } else { 1.0 };
                            worst = worst.max((slope + here.torque[joint]).abs() * lever);
                        }
                        let force = here.torque[..3].iter().map(|f| f * f).sum::<f64>().sqrt();
                        Some(worst / (force * RADIUS).max(1e-6))
                    },
                )
                .collect();
            let flagged = errors.iter().filter(|error| error.is_none()).count();
            let mut errors: Vec<f64> = errors.into_iter().flatten().collect();
            errors.sort_by(f64::total_cmp);
            // A point's stencil that crosses the plane where facets change meets a kink of U.
            let kinks = errors.iter().filter(|error| **error > 1e-3).count();
            let share = (errors.len() - kinks) as f64 / errors.len().max(1) as f64;
            let median = errors.get(errors.len() / 2).copied().unwrap_or(f64::NAN);
            outcomes.push(Outcome {
                case: "torque from energy".into(),
                varied: format!("{count} configurations, {name}, Kc {stiffness:.0e}"),
                measure: "share with tau = -dU/dq to 1e-3 [1]".into(),
                worst: share,
                bound: Bound::AtLeast(0.98),
                note: format!("median error {median:.1e}, {flagged} flagged"),
            });
        }
    }
    Ok(outcomes)
}
