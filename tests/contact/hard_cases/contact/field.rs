//! The torque as a field over C-space: continuous along paths, and minus the gradient of the stored energy.
//!
//! A path is solved in steps of two sizes. Where tau is continuous the largest change in a step shrinks with the step,
//! where it jumps it does not. Balls see the surface round. A point that lies inside changes facets at the planes that
//! bisect convex edges, where its normal turns at once: its tau jumps there, by no more than facets turn.

use super::processor::{Processor, processors};
use crate::hard_cases::{Bound, CaseResult, Effort, Failure, Setting};
use haptize::fixtures::bodies::{BALL, PAPER, RADIUS, contact_of, floating_bar, pressed, sphere};
use haptize::{
    JointVector,
    contact::{Equilibrium, Model, Status},
};

/// How far a unit normal's end moves from facet to facet of the sphere, 36 degrees apart at most: 2 sin 18 degrees (1).
const TURN: f64 = 0.62;

/// Configurations of a path from `a` to `b`.
fn path(a: &JointVector, b: &JointVector, steps: usize) -> Vec<JointVector> {
    let between = |k: usize| {
        let mut q = *a;
        q.iter_mut().zip(b.iter()).for_each(|(x, b)| *x += (b - *x) * (k as f64 / steps as f64));
        q
    };
    (0..=steps).map(between).collect()
}

/// Largest change of tau in a step of a path, and the largest tau (N m); steps at flagged points are left out, and
/// counted.
fn largest_step(path: &[Equilibrium]) -> (f64, f64, usize) {
    let torque = |result: &Equilibrium| (result.status != Status::Unconverged).then_some(result.torque);
    let mut largest = 0.0f64;
    let mut size = 0.0f64;
    for pair in path.windows(2) {
        if let (Some(a), Some(b)) = (torque(&pair[0]), torque(&pair[1])) {
            let square: f64 = a.iter().zip(b.iter()).map(|(a, b)| (a - b).powi(2)).sum();
            largest = largest.max(square.sqrt());
            size = size.max(b.norm());
        }
    }
    (largest, size, path.iter().filter(|result| torque(result).is_none()).count())
}

/// A measurement with nodes of one kind: their name, radius (m) and Kc (N/m).
type Measure = fn(Effort, Processor<'_>, &str, f64, f64) -> Result<CaseResult, Failure>;

/// `measure` of balls and points, soft and stiff.
fn of_each<'a>(
    measure: Measure,
    effort: Effort,
    processors: impl Fn() -> Vec<Processor<'a>>,
) -> Result<Vec<CaseResult>, Failure> {
    let mut outcomes = Vec::new();
    for (name, radius) in [("balls", BALL), ("points", 0.0)] {
        for stiffness in [1e2, 1e4] {
            for processor in processors() {
                outcomes.push(measure(effort, processor, name, radius, stiffness)?);
            }
        }
    }
    Ok(outcomes)
}

/// Paths from contact to contact, refined ten times.
pub fn continuity(setting: &Setting) -> Result<Vec<CaseResult>, Failure> {
    of_each(refined, setting.effort, || processors(setting))
}

/// The same of nodes of one kind.
fn refined(
    effort: Effort,
    mut processor: Processor<'_>,
    name: &str,
    radius: f64,
    stiffness: f64,
) -> Result<CaseResult, Failure> {
    let (paths, steps) = match effort {
        Effort::Full => processor.choose((20, 400), (5, 200)),
        Effort::Sample => processor.choose((3, 100), (2, 20)),
    };
    let object = sphere(PAPER)?;
    let chain = floating_bar(radius);
    let model = Model::new(&object, &chain, contact_of(&chain, stiffness));
    let (mut worst, mut jump, mut flagged) = (0.0f64, 0.0f64, 0);
    for end in pressed(&model, 11, paths, 0.05 * RADIUS, 0.15 * RADIUS) {
        // A slide along the surface with a turn: 3 mm and 0.1 rad.
        let mut other = end;
        for (x, step) in other.iter_mut().zip([0.002, -0.0015, 0.0015, 0.06, 0.06, -0.06]) {
            *x += step;
        }
        let (coarse, _, _) = largest_step(&processor.solve(&model, &path(&end, &other, steps))?);
        let (fine, size, missing) = largest_step(&processor.solve(&model, &path(&end, &other, 10 * steps))?);
        // A path without a step between sound points says nothing.
        let ratio = |whole: f64| if whole > 0.0 { fine / whole } else { f64::INFINITY };
        worst = worst.max(ratio(coarse));
        jump = jump.max(ratio(size));
        flagged += missing;
    }
    let (measure, worst, bound, beside) = if radius > 0.0 {
        let beside = format!("largest step left {:.2} % of tau", 100.0 * jump);
        ("largest step after over before [1]", worst, 0.2, beside)
    } else {
        let beside = format!("largest step after over before: {worst:.2}");
        ("largest step left, over tau: a jump [1]", jump, TURN, beside)
    };
    let varied = format!("{paths} paths of {steps} steps refined 10 times, {name}, Kc {stiffness:.0e}");
    Ok(CaseResult {
        case: "continuous torque".into(),
        varied: processor.name(&varied),
        measure: measure.into(),
        worst,
        bound: Bound::AtMost(bound),
        note: processor.note(format!("{beside}, {flagged} points flagged")),
    })
}

/// Central differences of U at random configurations.
pub fn curl(setting: &Setting) -> Result<Vec<CaseResult>, Failure> {
    // Differences of energies in f32 are rounding.
    of_each(against_energy, setting.effort, || vec![Processor::cpu()])
}

/// Half the width of a stencil (m or rad).
const STENCIL: f64 = 1e-6;

/// Returns how far a configuration's torque is from the slope of U, relative: of it, and of those a step before and
/// after in each joint; `None` where one is flagged.
fn stencil_error(results: &[Equilibrium]) -> Option<f64> {
    let (here, around) = results.split_first()?;
    if results.iter().any(|result| result.status != Status::Contact) {
        return None;
    }
    let mut worst = 0.0f64;
    for (joint, pair) in around.chunks_exact(2).enumerate() {
        let slope = (pair[1].energy - pair[0].energy) / (2.0 * STENCIL);
        // Forces of slides are weighed against torques of turns by a lever of a radius.
        let lever = if joint < 3 { RADIUS } else { 1.0 };
        worst = worst.max((slope + here.torque[joint]).abs() * lever);
    }
    let force = here.torque[..3].iter().map(|f| f * f).sum::<f64>().sqrt();
    Some(worst / (force * RADIUS).max(1e-6))
}

/// The same of nodes of one kind.
fn against_energy(
    effort: Effort,
    mut processor: Processor<'_>,
    name: &str,
    radius: f64,
    stiffness: f64,
) -> Result<CaseResult, Failure> {
    let object = sphere(PAPER)?;
    let count = if effort == Effort::Full { 200 } else { 20 };
    let chain = floating_bar(radius);
    let model = Model::new(&object, &chain, contact_of(&chain, stiffness));
    let stencil = |q: JointVector| {
        let mut stencil = vec![q];
        for joint in 0..q.len() {
            stencil.extend([-STENCIL, STENCIL].map(|step| {
                let mut q = q;
                q[joint] += step;
                q
            }));
        }
        stencil
    };
    let stencils: Vec<_> = pressed(&model, 12, count, 0.0, 0.2 * RADIUS).into_iter().map(stencil).collect();
    let results = processor.solve(&model, &stencils.concat())?;
    let mut errors: Vec<f64> = results.chunks_exact(results.len() / count).filter_map(stencil_error).collect();
    let flagged = count - errors.len();
    errors.sort_by(f64::total_cmp);
    // A point's stencil that crosses the plane where facets change meets a kink of U.
    let kinks = errors.iter().filter(|error| **error > 1e-3).count();
    let share = (errors.len() - kinks) as f64 / errors.len().max(1) as f64;
    let median = errors.get(errors.len() / 2).copied().unwrap_or(f64::NAN);
    Ok(CaseResult {
        case: "torque from energy".into(),
        varied: processor.name(&format!("{count} configurations, {name}, Kc {stiffness:.0e}")),
        measure: "share with tau = -dU/dq to 1e-3 [1]".into(),
        worst: share,
        bound: Bound::AtLeast(0.98),
        note: processor.note(format!("median error {median:.1e}, {flagged} flagged")),
    })
}
