//! Which gains are safe: passivity bounds of the loop, computed from the scene before it starts, with the value that
//! would do.
//!
//! - Boundary layer and object, per joint: `Ks <= mu bv / T` (section 3.1); by the discrete energy balance of the step
//!   it is sharp at mu = 2 (`npmi/mod.rs`). The same bound holds for the stiffness of the contact torque itself: of a
//!   dataset's a bound is known, of one that is solved live the greatest of many.
//!   Behind a boundary layer both act at right angles: the slope of what is rendered is at most the root of the sum of
//!   their squares (`field/boundary.rs`), and is compared with the sharp bound 2 bv / T.
//! - Device, per joint, against its own damping: Colgate's wall, `bd > K T/2 + |Bvc|`, with `K = Kvc`, and
//!   `Kvc + c2 Ks` where four channels hand the object's stiffness to the device. It does without the hand; a hand that
//!   holds the device adds its damping to bd.
//! - Encoder, per joint, if its step Delta is given: `K <= 2 fc / Delta`, fc the device's dry friction (Diolaiti,
//!   Niemeyer, Barbagli and Salisbury 2006; Abbott and Okamura 2005).

use super::source::TorqueSource;
use crate::{JointVector, dataset::JointLabel, names::counted, scene::HapticsSpec};
use serde::Serialize;

/// A gain and its passivity bound. Beyond it the loop runs, and may create energy.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Bound {
    /// Name of the gain, with its joint.
    pub what: String,
    /// Its value (N m/rad; 1 for a ratio).
    pub value: f64,
    /// Largest value that is safe, in the same unit.
    pub safe: f64,
    /// How to come below the bound.
    pub remedy: String,
}

impl Bound {
    /// Whether the value is beyond the bound.
    #[must_use]
    pub fn is_exceeded(&self) -> bool {
        self.value > self.safe
    }
}

impl std::fmt::Display for Bound {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        if self.is_exceeded() {
            write!(f, "{} is {:.4}, beyond the passive {:.4}: {}", self.what, self.value, self.safe, self.remedy)
        } else {
            write!(f, "{} is {:.4}, within the passive {:.4}", self.what, self.value, self.safe)
        }
    }
}

/// Greatest passive slope Ks of the boundary layer at `joint`, mu bv / T (N m/rad).
#[must_use]
pub fn greatest_slope(spec: &HapticsSpec, joint: usize) -> f64 {
    spec.passivity_factor * spec.proxy_damping[joint] * spec.rate
}

/// Greatest passive stiffness Kvc of the coupling at `joint`, the device in nobody's hand (N m/rad).
#[must_use]
pub fn greatest_stiffness(spec: &HapticsSpec, joint: usize) -> f64 {
    let encoder = if spec.encoder_step[joint] > 0.0 { encoder_bound(spec, joint) } else { f64::INFINITY };
    (wall_bound(spec, joint).min(encoder) - handed_stiffness(spec, joint)).max(0.0)
}

/// Greatest passive damping Bvc of the coupling at `joint`, the device in nobody's hand, bd - K T/2 (N m s/rad).
#[must_use]
pub fn greatest_damping(spec: &HapticsSpec, joint: usize) -> f64 {
    let stiffness = spec.coupling_stiffness[joint] + handed_stiffness(spec, joint);
    (spec.device_damping[joint] - 0.5 * stiffness / spec.rate).max(0.0)
}

/// Colgate's wall, 2 (bd - Bvc) / T (N m/rad).
fn wall_bound(spec: &HapticsSpec, joint: usize) -> f64 {
    (2.0 * (spec.device_damping[joint] - spec.coupling_damping[joint]) * spec.rate).max(0.0)
}

/// 2 fc / Delta (N m/rad), for an encoder whose step is given.
fn encoder_bound(spec: &HapticsSpec, joint: usize) -> f64 {
    2.0 * spec.device_friction[joint] / spec.encoder_step[joint]
}

/// c2 Ks, the stiffness of the object that four channels hand to the device; none without them (N m/rad).
fn handed_stiffness(spec: &HapticsSpec, joint: usize) -> f64 {
    spec.four_channel.map_or(0.0, |channels| channels.channels[1] * spec.boundary_slope[joint])
}

/// Returns `spec` with its proxy damping bv raised as far as the slope Ks and the stiffness of `source` ask for;
/// unchanged where it is passive.
#[must_use]
pub fn damped(spec: &HapticsSpec, source: &TorqueSource) -> HapticsSpec {
    let mut damped = spec.clone();
    if !source.is_potential() {
        for (damping, slope) in damped.proxy_damping.iter_mut().zip(spec.boundary_slope.iter()) {
            *damping = damping.max(slope / (spec.rate * spec.passivity_factor));
        }
    }
    let [object, both] = relative_stiffness(&damped, source);
    let ratio = object.max(both);
    if ratio > 1.0 && ratio.is_finite() {
        damped.proxy_damping.iter_mut().for_each(|damping| *damping *= ratio * (1.0 + ROUNDING));
    }
    damped
}

/// Greatest passive slope at each joint (N m/rad).
fn greatest_slopes(spec: &HapticsSpec) -> JointVector {
    let mut slopes = spec.proxy_damping;
    slopes.iter_mut().enumerate().for_each(|(joint, slope)| *slope = greatest_slope(spec, joint));
    slopes
}

/// Stiffness of the dataset's torque over mu bv / T, and that of boundary layer and object together over 2 bv / T, zero
/// where there is no layer (1).
fn relative_stiffness(spec: &HapticsSpec, source: &TorqueSource) -> [f64; 2] {
    let slopes = greatest_slopes(spec);
    let object = source.relative_stiffness(&slopes);
    if source.is_potential() {
        return [object, 0.0];
    }
    let layer = spec.boundary_slope.iter().zip(slopes.iter()).map(|(slope, safe)| slope / safe).fold(0.0, f64::max);
    [object, 0.5 * spec.passivity_factor * object.hypot(layer)]
}

/// Keeps a bound that is met exactly from being exceeded by rounding (1).
const ROUNDING: f64 = 1e-12;

/// What is wrong with gains that are not passive.
#[derive(Clone, Debug, PartialEq)]
pub struct Advice {
    /// That in one sentence, and the values that would be passive in another.
    pub text: String,
    /// The gains, changed to passive ones; absent where no stiffness of the coupling is passive.
    pub passive: Option<HapticsSpec>,
    /// What was changed, as a scene has it.
    pub changes: Vec<String>,
}

/// Returns what is wrong with the gains of `spec`; `None` where all bounds hold.
#[must_use]
pub fn advice(spec: &HapticsSpec, source: &TorqueSource, bounds: &[Bound]) -> Option<Advice> {
    let exceeded = || bounds.iter().filter(|bound| bound.is_exceeded());
    let worst = exceeded().max_by(|a, b| (a.value / a.safe).total_cmp(&(b.value / b.safe)))?;
    let others = match exceeded().count() - 1 {
        0 => String::new(),
        count => format!(", and {} more", counted(count, ["gain", "gains"])),
    };
    let joints = source.joints();
    let passive = passive(spec, source);
    let [damping, coupling @ ..] = changes(spec, &passive);
    let changes = [&damping].into_iter().chain(&coupling).flatten().cloned().collect();
    let mut remedies = Vec::from_iter(damping);
    let stiffness = |joint| spec.coupling_stiffness[joint] + handed_stiffness(spec, joint);
    // Damping helps where no encoder's step stands in the way.
    let mut alternatives = Vec::new();
    if (0..joints).any(|joint| stiffness(joint) > wall_bound(spec, joint))
        && (0..joints).all(|joint| spec.encoder_step[joint] <= 0.0 || stiffness(joint) <= encoder_bound(spec, joint))
    {
        let damping = (0..joints).map(|joint| {
            let least = 0.5 * stiffness(joint) / spec.rate + spec.coupling_damping[joint];
            if stiffness(joint) > wall_bound(spec, joint) { at_least(least) } else { spec.device_damping[joint] }
        });
        alternatives.push(format!("device_damping = {} if the device has that much", list(damping)));
    }
    if has_coupling(&passive) {
        let coupling: Vec<String> = coupling.into_iter().flatten().collect();
        alternatives.extend((!coupling.is_empty()).then(|| coupling.join(" and ")));
    } else if alternatives.is_empty() {
        alternatives.push(format!("{}: with less, no coupling_stiffness is passive", lacking(spec).join(" and ")));
    }
    if !alternatives.is_empty() {
        remedies.push(alternatives.join("; or else "));
    }
    let text = format!(
        "the gains are not passive, so the loop may create energy: {} is {:.4}, at most {:.4} is safe{others}. Set in \
         [haptics]: {}",
        worst.what,
        worst.value,
        worst.safe,
        remedies.join("; ")
    );
    Some(Advice { text, passive: has_coupling(&passive).then_some(passive), changes })
}

/// What the device of `spec` lacks at each joint at which a bound leaves no stiffness to the coupling.
fn lacking(spec: &HapticsSpec) -> Vec<String> {
    let mut lacking = Vec::new();
    for joint in 0..spec.device_damping.len() {
        let handed = handed_stiffness(spec, joint);
        let least = [
            ("device_damping", spec.device_damping[joint], 0.5 * handed / spec.rate),
            ("device_friction", spec.device_friction[joint], 0.5 * handed * spec.encoder_step[joint]),
        ];
        let has_encoder = spec.encoder_step[joint] > 0.0;
        for (key, own, least) in least.into_iter().take(if has_encoder { 2 } else { 1 }) {
            if own <= least {
                lacking.push(format!("a {key} of joint {} above {}", joint + 1, at_least(least)));
            }
        }
    }
    lacking
}

/// Whether the coupling of `spec` has a spring at each joint.
fn has_coupling(spec: &HapticsSpec) -> bool {
    spec.coupling_stiffness.iter().all(|stiffness| *stiffness > 0.0)
}

/// Share of the device's damping that the coupling's takes at most where the spring has to give way (1): it may then be
/// two thirds as stiff as without a damper.
const DAMPER: f64 = 1.0 / 3.0;

/// Returns `spec` with the gains that break a bound changed so that they keep it, and the others as they are: the
/// proxy's damping as [`damped`] raises it; the coupling's damping lowered where that is enough, else its stiffness as
/// well. The changed ones have [`DIGITS`] digits. The stiffness is zero where the device allows none.
fn passive(spec: &HapticsSpec, source: &TorqueSource) -> HapticsSpec {
    let mut passive = damped(spec, source);
    for (damping, own) in passive.proxy_damping.iter_mut().zip(spec.proxy_damping.iter()) {
        if *damping > *own {
            *damping = at_least(*damping);
        }
    }
    for joint in 0..source.joints() {
        let (stiffness, damping) = (spec.coupling_stiffness[joint], spec.coupling_damping[joint]);
        if stiffness <= greatest_stiffness(spec, joint) {
            continue;
        }
        let least = DAMPER * spec.device_damping[joint];
        if damping > least * (1.0 + ADVICE_ROUNDING) {
            passive.coupling_damping[joint] = at_most(least);
        }
        let greatest = greatest_stiffness(&passive, joint);
        if stiffness <= greatest {
            // The spring may stay, and the damper as much as goes with it.
            passive.coupling_damping[joint] = damping.min(at_most(greatest_damping(spec, joint)));
        } else {
            passive.coupling_stiffness[joint] = at_most(greatest);
        }
    }
    passive
}

/// The gains of `passive` that are not those of `spec`, as a scene has them: damping of the proxy, stiffness and damping
/// of the coupling.
fn changes(spec: &HapticsSpec, passive: &HapticsSpec) -> [Option<String>; 3] {
    type Gain = fn(&HapticsSpec) -> &JointVector;
    let gains: [(&str, Gain); 3] = [
        ("proxy_damping", |gains| &gains.proxy_damping),
        ("coupling_stiffness", |gains| &gains.coupling_stiffness),
        ("coupling_damping", |gains| &gains.coupling_damping),
    ];
    gains.map(|(key, of)| (of(passive) != of(spec)).then(|| format!("{key} = {}", list(of(passive).iter().copied()))))
}

/// Digits that an advised gain has.
const DIGITS: i32 = 4;

/// The least number of [`DIGITS`] digits that is beyond `bound`, a lower bound, by more than rounding.
fn at_least(bound: f64) -> f64 {
    to_digits(bound * (1.0 + ADVICE_ROUNDING), f64::ceil)
}

/// The greatest number of [`DIGITS`] digits that is below `bound`, an upper bound, by more than rounding.
fn at_most(bound: f64) -> f64 {
    to_digits(bound * (1.0 - ADVICE_ROUNDING), f64::floor)
}

/// `value` with [`DIGITS`] digits, rounded by `round`.
fn to_digits(value: f64, round: fn(f64) -> f64) -> f64 {
    if value == 0.0 || !value.is_finite() {
        return value;
    }
    let shift = DIGITS - 1 - value.abs().log10().floor() as i32;
    // Divided by a whole power of ten, the number reads as it is meant.
    let power = 10.0_f64.powi(shift.abs());
    if shift >= 0 { round(value * power) / power } else { round(value / power) * power }
}

/// Keeps an advised gain from being beyond its bound by the rounding of the sums on both sides (1): much more than
/// some eps, much less than its digits.
const ADVICE_ROUNDING: f64 = 1e-9;

/// Writes numbers as the scene takes them: one for all joints, or a list.
fn list(values: impl Iterator<Item = f64>) -> String {
    let texts: Vec<String> = values.map(|value| value.to_string()).collect();
    match texts.split_first() {
        Some((first, rest)) if rest.iter().all(|text| text == first) => first.clone(),
        _ => format!("[{}]", texts.join(", ")),
    }
}

/// All bounds on the gains of `spec`, with `source` and the names of the joints.
#[must_use]
pub fn bounds(spec: &HapticsSpec, source: &TorqueSource, joints: &[JointLabel]) -> Vec<Bound> {
    let period = 1.0 / spec.rate;
    let mut found = Vec::new();
    for (a, joint) in joints.iter().enumerate().take(source.joints()) {
        let (torque, angle) = if joint.unit == "m" { ("N", "m") } else { ("N m", "rad") };
        // A potential has no boundary layer.
        if !source.is_potential() {
            let slope = greatest_slope(spec, a);
            found.push(Bound {
                what: format!("boundary slope Ks of joint {}", joint.name),
                value: spec.boundary_slope[a],
                safe: slope,
                remedy: format!(
                    "lower Ks to {} {torque}/{angle}, or raise the proxy's damping bv to {} {torque} s/{angle}",
                    at_most(slope),
                    at_least(spec.boundary_slope[a] * period / spec.passivity_factor)
                ),
            });
        }
        let stiffness = spec.coupling_stiffness[a] + handed_stiffness(spec, a);
        let name =
            if spec.four_channel.is_some() { "stiffness Kvc + c2 Ks on the device" } else { "coupling stiffness Kvc" };
        found.push(Bound {
            what: format!("{name} of joint {}", joint.name),
            value: stiffness,
            safe: wall_bound(spec, a),
            remedy: format!(
                "lower it, or give the device a damping bd of {} {torque} s/{angle} (a hand on the device adds to it)",
                at_least(0.5 * stiffness * period + spec.coupling_damping[a])
            ),
        });
        if spec.encoder_step[a] > 0.0 {
            found.push(Bound {
                what: format!("{name} of joint {}, against the encoder's step,", joint.name),
                value: stiffness,
                safe: encoder_bound(spec, a),
                remedy: format!(
                    "lower it, or take an encoder of {:e} {angle} for the device's friction of {} {torque}",
                    at_most(2.0 * spec.device_friction[a] / stiffness),
                    spec.device_friction[a]
                ),
            });
        }
    }
    if greatest_slopes(spec).iter().all(|slope| *slope > 0.0) {
        let [object, both] = relative_stiffness(spec, source);
        found.push(Bound {
            what: "stiffness of the contact torque over mu bv / T".into(),
            value: object,
            safe: 1.0,
            remedy: format!(
                "raise the proxy's damping bv {}-fold, or keep to a slope Ks that is passive",
                at_least(object)
            ),
        });
        if !source.is_potential() {
            found.push(Bound {
                what: "stiffness of layer and object together over 2 bv / T".into(),
                value: both,
                safe: 1.0,
                remedy: format!("raise the proxy's damping bv {}-fold, or lower the slope Ks", at_least(both)),
            });
        }
    }
    found
}

/// The bounds that are exceeded.
#[must_use]
pub fn exceeded(spec: &HapticsSpec, source: &TorqueSource, joints: &[JointLabel]) -> Vec<Bound> {
    bounds(spec, source, joints).into_iter().filter(Bound::is_exceeded).collect()
}
