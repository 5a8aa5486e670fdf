//! Hard cases of gridization: samples that break triangulations, units that mislead them, input that must be refused.
//!
//! A torque linear in q is reproduced exactly by linear interpolation on any triangulation, so that its error shows
//! every sliver, inverted simplex and lost point. Its size is judged relative to the greatest torque.

use crate::hard_cases::{Bound, Case, CaseResult, Effort, Failure, Setting};
use haptize::{
    contact::Status,
    dataset::{Dataset, JointLabel},
    gridize::{GridizeOptions, Samples, gridize},
};
use std::f64::consts::{PI, TAU};

/// Error of a gridized torque relative to the greatest one, where exact arithmetic has none: weights of slivers are
/// known to the jitter (`JITTER`, 1e-12) over their thickness, of a thousandth and more, and [`HYPER_WEIGHT`] bounds
/// them in 4 to 6 joints.
const GRIDIZED_LINEAR: f64 = 1e-9;

/// The cases of this file.
pub fn cases() -> Vec<Case> {
    let case = |name, run| Case { room: "gridization", name, run };
    vec![
        case("exact grids", exact_grids),
        case("cospherical points", cospherical),
        case("duplicates", duplicates),
        case("thin slabs", slabs),
        case("units", units),
        case("order of samples", order),
        case("bounded by the samples", bounded),
        case("input to be refused", refused),
    ]
}

type Point = Vec<f64>;

/// The linear torque of all cases, a multiple of it for each joint.
fn linear(q: &[f64]) -> f64 {
    q.iter().enumerate().map(|(joint, x)| (2.0 - 0.7 * joint as f64) * x).sum::<f64>() + 0.25
}

fn curved(q: &[f64]) -> f64 {
    q.iter().enumerate().map(|(joint, x)| ((5.0 - joint as f64) * x).sin()).sum()
}

fn samples(points: &[Point], torque: impl Fn(&[f64]) -> f64) -> Samples {
    let joints = points.first().map_or(0, Vec::len);
    let label = |joint| JointLabel { name: format!("joint {joint}"), unit: "rad".to_owned() };
    let torques = points.iter().flat_map(|q| (1..=joints).map(|k| k as f64 * torque(q)).collect::<Vec<_>>());
    Samples {
        joints: (0..joints).map(label).collect(),
        configurations: points.concat(),
        torques: torques.collect(),
        deviations: None,
    }
}

fn options(step: f64) -> GridizeOptions {
    GridizeOptions { epsilon: Some(0.0), within: f64::INFINITY, ..GridizeOptions::new(vec![step]) }
}

/// Numbers between 0 and 1 without a visible pattern, the same in every run (fractions of a sine's large multiples).
fn scattered(count: usize, joints: usize) -> Vec<Point> {
    let number = |k: usize| (12.9898 * (k + 1) as f64).sin().mul_add(43_758.545_3, 1e5).fract();
    (0..count).map(|point| (0..joints).map(|joint| number(point * joints + joint)).collect()).collect()
}

fn lattice(side: usize, joints: usize) -> Vec<Point> {
    let coordinate = |point: usize, joint: usize| 0.1 * (point / side.pow(joint as u32) % side) as f64;
    (0..side.pow(joints as u32)).map(|point| (0..joints).map(|joint| coordinate(point, joint)).collect()).collect()
}

fn inside(dataset: &Dataset) -> impl Iterator<Item = usize> {
    (0..dataset.grid.points()).filter(|&point| dataset.status(point) != Status::Outside)
}

/// Greatest error of the linear torque over the greatest torque, and grid points in and out.
fn worst_error(points: &[Point], step: f64) -> Result<(f64, usize, usize), Failure> {
    let (dataset, report) = gridize(&samples(points, linear), &options(step))?;
    let greatest = points.iter().map(|q| linear(q).abs()).fold(f64::MIN_POSITIVE, f64::max);
    let error = |point: usize| (dataset.torque(point)[0] - linear(&dataset.grid.configuration(point))).abs();
    Ok((inside(&dataset).map(error).fold(0.0, f64::max) / greatest, report.inside, report.points - report.inside))
}

fn outcome(case: &str, varied: &str, measure: &str, worst: f64, bound: Bound, note: String) -> CaseResult {
    CaseResult { case: case.to_owned(), varied: varied.to_owned(), measure: measure.to_owned(), worst, bound, note }
}

const ERROR: &str = "error of a linear torque [1]";

/// Worst error of all `arrangements`, each gridized at `step`.
fn reproduced(case: &str, varied: &str, arrangements: &[(Vec<Point>, f64)]) -> Result<(CaseResult, usize), Failure> {
    let (mut worst, mut inside, mut outside) = (0.0_f64, 0, 0);
    for (points, step) in arrangements {
        let (error, found, lost) = worst_error(points, *step)?;
        worst = worst.max(error);
        inside += found;
        outside += lost;
    }
    let note = format!("{} arrangements, {inside} grid points", arrangements.len());
    Ok((outcome(case, varied, ERROR, worst, Bound::AtMost(GRIDIZED_LINEAR), note), outside))
}

/// Every cell of an exact grid is cospherical, its hull is coplanar, and grid points lie on both.
fn exact_grids(setting: &Setting) -> Result<Vec<CaseResult>, Failure> {
    let full = setting.effort == Effort::Full;
    let sides: &[(usize, usize)] =
        if full { &[(1, 40), (2, 40), (3, 20), (4, 6), (5, 4)] } else { &[(1, 12), (2, 10), (3, 6), (4, 3)] };
    let grids = sides.iter().flat_map(|&(joints, side)| [0.1, 0.05, 0.03].map(|step| (lattice(side, joints), step)));
    let varied = "1 to 5 joints, grid step";
    let (reproduced, outside) = reproduced("exact grids", varied, &grids.collect::<Vec<_>>())?;
    let lost =
        outcome("exact grids", varied, "points lost at the hull", outside as f64, Bound::AtMost(0.0), String::new());
    Ok(vec![reproduced, lost])
}

fn cospherical(setting: &Setting) -> Result<Vec<CaseResult>, Failure> {
    let rings = if setting.effort == Effort::Full { 40 } else { 10 };
    let mut sphere = vec![vec![0.0; 3]];
    for i in 0..2 * rings {
        for j in 1..rings {
            let (a, b) = (f64::from(i) * PI / f64::from(rings), f64::from(j) * PI / f64::from(rings));
            sphere.push(vec![a.cos() * b.sin(), a.sin() * b.sin(), b.cos()]);
        }
    }
    let count = 8 * rings;
    let circle = (0..count).map(|k| TAU * f64::from(k) / f64::from(count)).map(|a| vec![a.cos(), a.sin()]);
    let lines = (0..rings * 100).map(|k| [k % 100, k / 100 % 5, k / 500].map(|k| 0.01 * f64::from(k)).to_vec());
    let arrangements = [(sphere, 0.11), (circle.collect(), 0.07), (lines.collect(), 0.013)];
    Ok(vec![reproduced("cospherical points", "sphere, circle, scan lines", &arrangements)?.0])
}

fn duplicates(setting: &Setting) -> Result<Vec<CaseResult>, Failure> {
    let count = if setting.effort == Effort::Full { 2000 } else { 120 };
    let mut arrangements = Vec::new();
    for joints in [2, 3, 4] {
        for distance in [0.0, 3e-16, 1e-12, 1e-9, 1e-6] {
            let mut points = scattered(if joints == 4 { count / 4 + 60 } else { count }, joints);
            let twins: Vec<Point> = points.iter().map(|q| q.iter().map(|x| x + distance).collect()).collect();
            points.extend(twins);
            arrangements.push((points, 0.1));
        }
    }
    Ok(vec![reproduced("duplicates", "distance 0 to 1e-6 rad, 2 to 4 joints", &arrangements)?.0])
}

fn slabs(setting: &Setting) -> Result<Vec<CaseResult>, Failure> {
    let count = if setting.effort == Effort::Full { 5000 } else { 300 };
    let mut arrangements = Vec::new();
    for thickness in [1e-1, 1e-2, 1e-3, 1e-4] {
        for joints in [2, 3] {
            let squeezed = |q: &Point| {
                // Oblique, so that no joint is the thin one: the sum of all moves little.
                let mean = q.iter().sum::<f64>() / joints as f64;
                q.iter().map(|x| x - (1.0 - thickness) * (mean - 0.5)).collect()
            };
            arrangements.push((scattered(count, joints).iter().map(squeezed).collect(), 0.02));
        }
    }
    Ok(vec![reproduced("thin slabs", "thickness 0.1 to 1e-4 of the extent", &arrangements)?.0])
}

/// A joint counted in other units must not change what is interpolated.
fn units(setting: &Setting) -> Result<Vec<CaseResult>, Failure> {
    let mut points = scattered(if setting.effort == Effort::Full { 3000 } else { 300 }, 2);
    // Both joints extend from 0 to 1, so that each is scaled as it would be alone.
    points.extend([vec![0.0, 0.0], vec![1.0, 1.0]]);
    let mut given = samples(&points, curved);
    let reference = gridize(&given, &options(0.05))?.0;
    given.joints[1].unit = "m".to_owned();
    let scaled = |factor: f64| -> Result<f64, Failure> {
        let mut given = given.clone();
        given.configurations.iter_mut().skip(1).step_by(2).for_each(|x| *x *= factor);
        let steps = GridizeOptions { steps: vec![0.05, 0.05 * factor], ..options(0.05) };
        let dataset = gridize(&given, &steps)?.0;
        let pairs = dataset.torque.iter().zip(reference.torque.iter());
        let same = dataset.status[..] == reference.status[..];
        Ok(if same { pairs.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max) } else { f64::INFINITY })
    };
    let mut worst = 0.0_f64;
    for exponent in [-20, -10, -3, 3, 10, 20] {
        worst = worst.max(scaled(2_f64.powi(exponent))?);
    }
    let varied = "a joint's unit, 1e-6 to 1e6";
    Ok(vec![outcome("units", varied, "change of torque [N m]", worst, Bound::AtMost(GRIDIZED_LINEAR), String::new())])
}

fn order(setting: &Setting) -> Result<Vec<CaseResult>, Failure> {
    let count = if setting.effort == Effort::Full { 5000 } else { 300 };
    let mut worst = 0.0_f64;
    for joints in [2, 3] {
        let mut points = scattered(count, joints);
        let forward = gridize(&samples(&points, curved), &options(0.05))?.0;
        points.reverse();
        let backward = gridize(&samples(&points, curved), &options(0.05))?.0;
        let differences = forward.torque.iter().zip(backward.torque.iter()).map(|(a, b)| (a - b).abs());
        worst = differences.fold(worst, f64::max);
        if forward.status[..] != backward.status[..] {
            worst = f64::INFINITY;
        }
    }
    let bound = Bound::AtMost(GRIDIZED_LINEAR);
    Ok(vec![outcome("order of samples", "forwards, backwards", "change of torque [N m]", worst, bound, String::new())])
}

/// Linear interpolation never exceeds what was measured.
fn bounded(setting: &Setting) -> Result<Vec<CaseResult>, Failure> {
    let full = setting.effort == Effort::Full;
    let mut worst = 0.0_f64;
    for (joints, count, step) in
        [(1, 50, 0.01), (2, 500, 0.02), (3, if full { 5000 } else { 500 }, 0.05), (4, 150, 0.2)]
    {
        let given = samples(&scattered(count, joints), |q| curved(q).signum());
        let dataset = gridize(&given, &options(step))?.0;
        worst = inside(&dataset).map(|point| dataset.torque(point)[0].abs() - 1.0).fold(worst, f64::max);
    }
    let varied = "a torque that jumps, 1 to 4 joints";
    let bound = Bound::AtMost(GRIDIZED_LINEAR);
    Ok(vec![outcome("bounded by the samples", varied, "overshoot [1]", worst, bound, String::new())])
}

fn refused(_: &Setting) -> Result<Vec<CaseResult>, Failure> {
    let good = || samples(&scattered(60, 3), linear);
    let changed = |change: &dyn Fn(&mut Samples)| {
        let mut samples = good();
        change(&mut samples);
        (samples, options(0.1))
    };
    let hostile = [
        changed(&|samples| samples.torques[7] = f64::NAN),
        changed(&|samples| samples.configurations[4] = f64::INFINITY),
        changed(&|samples| samples.torques.truncate(59)),
        changed(&|samples| *samples = Samples::default()),
        changed(&|samples| samples.configurations.iter_mut().skip(2).step_by(3).for_each(|q| *q = 0.5)),
        changed(&|samples| {
            samples.configurations.chunks_exact_mut(3).for_each(|q| q[2] = 0.5 * (q[0] + q[1]));
        }),
        (good(), options(0.0)),
        (good(), options(-0.1)),
        (good(), options(f64::NAN)),
        (good(), options(1e-9)),
        (good(), options(1e9)),
        (good(), GridizeOptions { epsilon: Some(f64::NAN), ..options(0.1) }),
        (samples(&scattered(3, 3), linear), options(0.1)),
    ];
    let accepted = hostile.iter().filter(|(samples, options)| gridize(samples, options).is_ok()).count();
    let varied = "NaN, flat, too few, steps that are none";
    let note = format!("of {}", hostile.len());
    Ok(vec![outcome("input to be refused", varied, "accepted", accepted as f64, Bound::AtMost(0.0), note)])
}
