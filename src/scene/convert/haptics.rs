//! `[haptics]`: gains of the 1 kHz loop. The defaults are those of a desktop device.
//!
//! Defaults of a prismatic joint follow from those of a revolute one by a lever arm of 0.1 m: stiffness, damping and
//! inertia are divided by its square, torques by itself.

use super::super::check::Checker;
use super::super::error::SceneError;
use super::super::file::{HapticsTable, PerJoint};
use super::super::{HandSpec, HapticsSpec, JointKind, JointSpec};
use crate::JointVector;
use toml::Spanned;

/// Lever arm between a revolute joint's defaults and a prismatic joint's [m].
const LEVER_ARM: f64 = 0.1;

/// How a default changes from revolute to prismatic joints.
#[derive(Clone, Copy)]
enum Quantity {
    /// Stiffness, damping, inertia.
    Gain(f64),
    /// Torque and its rate.
    Torque(f64),
}

impl Quantity {
    fn of(self, kind: JointKind) -> f64 {
        match (self, kind) {
            (Self::Gain(value) | Self::Torque(value), JointKind::Revolute) => value,
            (Self::Gain(value), JointKind::Prismatic) => value / (LEVER_ARM * LEVER_ARM),
            (Self::Torque(value), JointKind::Prismatic) => value / LEVER_ARM,
        }
    }
}

pub(super) fn convert(
    checker: &Checker<'_>,
    table: &HapticsTable,
    joints: &[JointSpec],
) -> Result<HapticsSpec, SceneError> {
    let vector =
        |key, value: &Option<Spanned<PerJoint>>, strictly, default: Quantity| -> Result<JointVector, SceneError> {
            checker.per_joint(key, value.as_ref(), joints, strictly, |kind| default.of(kind))
        };
    use Quantity::{Gain, Torque};
    let rate = table.rate.as_ref().map_or(Ok(1000.0), |value| checker.between("rate", value, 0.0, 1e6));
    let threshold = table.threshold.as_ref().map_or(Ok(0.5), |value| checker.between("threshold", value, 0.0, 1.0));
    let factor = table.passivity_factor.as_ref().map_or(Ok(1.0), |value| checker.positive("passivity_factor", value));
    let hand = &table.hand;
    Ok(HapticsSpec {
        rate: rate?,
        threshold: threshold?,
        passivity_factor: factor?,
        boundary_slope: vector("boundary_slope", &table.boundary_slope, true, Gain(15.0))?,
        proxy_damping: vector("proxy_damping", &table.proxy_damping, false, Gain(0.02))?,
        coupling_stiffness: vector("coupling_stiffness", &table.coupling_stiffness, true, Gain(20.0))?,
        coupling_damping: vector("coupling_damping", &table.coupling_damping, false, Gain(0.01))?,
        device_damping: vector("device_damping", &table.device_damping, false, Gain(0.03))?,
        device_inertia: vector("device_inertia", &table.device_inertia, true, Gain(1e-3))?,
        torque_limit: vector("torque_limit", &table.torque_limit, true, Torque(1.5))?,
        torque_rate_limit: vector("torque_rate_limit", &table.torque_rate_limit, true, Torque(500.0))?,
        hand: HandSpec {
            stiffness: vector("stiffness", &hand.stiffness, false, Gain(20.0))?,
            damping: vector("damping", &hand.damping, false, Gain(0.4))?,
            inertia: vector("inertia", &hand.inertia, false, Gain(2e-3))?,
        },
    })
}
