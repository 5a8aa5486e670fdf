//! Hard cases of the object in motion: stiff springs, any time between frames, forces that chatter.
//!
//! All keep one figure: the most that kinetic, elastic and gravitational energy rose in a frame beyond the work of the
//! forces, over the most that was ever stored. In exact arithmetic it is never positive (`render/object_motion.rs`).

use crate::hard_cases::{Bound, Case, CaseResult, Effort, Failure, Setting};
use glam::DVec3;
use haptize::{
    object::Object,
    render::object_motion::ObjectMotion,
    scene::{
        GraphicsEffects, GroundNodes, GroundSpec, GroundStiffness, Material, ObjectSpec, Shape, SpringKind, SpringSpec,
        StiffeningSpec,
    },
};

/// Energy that the object may seem to gain in a frame from nowhere, over the most that it stored (1): sums over up to
/// 1e5 coordinates, each rounded by eps, of terms that cancel.
const FRAME_ENERGY_ROUNDING: f64 = 1e-10;

/// The cases of this file.
pub(super) const CASES: [Case; 2] = [
    Case { room: "graphics", name: "stiff springs, slow frames", run: stiff },
    Case { room: "graphics", name: "stiffening springs under gravity", run: effects },
];

/// Times between frames T (s).
const PERIODS: [f64; 4] = [1e-3, 1.0 / 60.0, 0.1, 1.0];

const EARTH: DVec3 = DVec3::new(0.0, 0.0, -9.81);

fn sphere(kind: SpringKind, stiffness: f64, effort: Effort) -> Result<Object, Failure> {
    let rings = if effort == Effort::Sample { 6 } else { 20 };
    Ok(Object::build(&ObjectSpec {
        shape: Shape::Sphere { centre: DVec3::ZERO, radius: 0.05, rings, segments: rings },
        material: Material::Springs(SpringSpec { kind, stiffness }),
        skin: None,
        ground: Some(GroundSpec { stiffness: GroundStiffness::PerNode(0.3 * stiffness), nodes: GroundNodes::All }),
        node_mass: 1e-3,
        node_damping: 0.02,
    })?)
}

/// Frames of a run, and how many of them are pushed.
fn frames(effort: Effort) -> (usize, usize) {
    if effort == Effort::Sample { (60, 20) } else { (600, 200) }
}

/// Forces that strain the springs by about `strain`, and differ from frame to frame as contact that chatters does (N).
fn push(object: &Object, frame: usize, size: f64) -> Vec<DVec3> {
    let force = |k: usize| size * DVec3::new(0.1, 0.02 * (k % 3) as f64, -(((k + 3 * frame) % 7) as f64));
    (0..object.rest.len()).map(force).collect()
}

/// Greatest gain of `motion` over its greatest energy, both beyond its start.
fn gain(object: &Object, period: f64, effects: &GraphicsEffects, size: f64, effort: Effort) -> Result<f64, Failure> {
    let mut motion = ObjectMotion::new(object, period, effects)?;
    let start = motion.energy();
    let (mut before, mut gain, mut most) = (0.0, f64::NEG_INFINITY, f64::MIN_POSITIVE);
    let (count, pushed) = frames(effort);
    let rest = vec![DVec3::ZERO; object.rest.len()];
    for frame in 0..count {
        let forces = if frame < pushed { push(object, frame, size) } else { rest.clone() };
        let v_hat = motion.step(&forces);
        let work = period * v_hat.iter().zip(&forces).map(|(v, f)| v.dot(*f)).sum::<f64>();
        let after = motion.energy() - start;
        if !after.is_finite() {
            return Ok(f64::NAN);
        }
        (gain, most) = (f64::max(gain, after - before - work), f64::max(most, after));
        before = after;
    }
    Ok(gain / most)
}

fn outcome(case: &str, varied: &str, gains: &[f64], bound: f64) -> CaseResult {
    // A run that is no number is the worst.
    let worst =
        gains.iter().fold(f64::NEG_INFINITY, |worst, &gain| if gain > worst || gain.is_nan() { gain } else { worst });
    CaseResult {
        case: case.into(),
        varied: varied.into(),
        measure: "energy gained beyond the work done, over the most stored [1]".into(),
        worst,
        bound: Bound::AtMost(bound),
        note: format!("{} runs", gains.len()),
    }
}

fn stiff(setting: &Setting) -> Result<Vec<CaseResult>, Failure> {
    let mut outcomes = Vec::new();
    for period in PERIODS {
        let mut gains = Vec::new();
        for kind in [SpringKind::Isotropic, SpringKind::Axial] {
            for stiffness in [1.0, 300.0, 1e5, 1e7] {
                let object = sphere(kind, stiffness, setting.effort)?;
                let size = 1e-3 * stiffness;
                gains.push(gain(&object, period, &GraphicsEffects::default(), size, setting.effort)?);
            }
        }
        let varied = format!("Kn from 1 to 1e7 N/m, isotropic and axial, T = {:.1} ms", 1e3 * period);
        outcomes.push(outcome("stiff springs, slow frames", &varied, &gains, FRAME_ENERGY_ROUNDING));
    }
    Ok(outcomes)
}

fn effects(setting: &Setting) -> Result<Vec<CaseResult>, Failure> {
    let mut outcomes = Vec::new();
    for factor in [2.0, 100.0] {
        let stiffening = Some(StiffeningSpec { factor, strain: 0.02 });
        let effects = GraphicsEffects { gravity: Some(EARTH), stiffening, ..GraphicsEffects::default() };
        let mut gains = Vec::new();
        for kind in [SpringKind::Isotropic, SpringKind::Axial] {
            let object = sphere(kind, 300.0, setting.effort)?;
            for period in PERIODS {
                gains.push(gain(&object, period, &effects, 1.0, setting.effort)?);
            }
        }
        let varied = format!("{factor} times as stiff when strained, T from 1 ms to 1 s");
        outcomes.push(outcome("stiffening springs under gravity", &varied, &gains, FRAME_ENERGY_ROUNDING));
    }
    Ok(outcomes)
}

#[test]
fn a_run_that_gains_or_is_no_number_is_seen() {
    let judged = |gains: &[f64]| outcome("", "", gains, FRAME_ENERGY_ROUNDING).passed();
    assert!(judged(&[-1.0, 0.0]) && !judged(&[1e-9, -1.0]));
    assert!(!judged(&[f64::NAN, -1.0]) && !judged(&[-1.0, f64::NAN]));
}
