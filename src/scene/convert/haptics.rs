//! `[haptics]`: gains of the 1 kHz loop. The defaults are those of a desktop device.
//!
//! Defaults of a prismatic joint follow from those of a revolute one by a lever arm of 0.1 m: stiffness, damping and
//! inertia are divided by its square, torques by itself, speeds multiplied by it.

use super::super::check::Checker;
use super::super::error::SceneError;
use super::super::file::{FourChannelTable, FrictionTable, HapticsTable, PerJoint};
use super::super::{
    BOUNDARY_SLOPE, ContactDampingSpec, FourChannelSpec, FrictionSpec, GREATEST_INTERVAL, HandSpec, HapticEffects,
    HapticsSpec, Interpolation, JointKind, JointSpec, LEVER_ARM, ProxyInertia, THRESHOLD,
};
use crate::JointVector;
use toml::Spanned;

/// How a default changes from revolute to prismatic joints.
#[derive(Clone, Copy)]
enum Quantity {
    /// Stiffness, damping, inertia.
    Gain(f64),
    /// Torque and its rate.
    Torque(f64),
    Speed(f64),
}

impl Quantity {
    fn of(self, kind: JointKind) -> f64 {
        match (self, kind) {
            (Self::Gain(value) | Self::Torque(value) | Self::Speed(value), JointKind::Revolute) => value,
            (Self::Gain(value), JointKind::Prismatic) => value / (LEVER_ARM * LEVER_ARM),
            (Self::Torque(value), JointKind::Prismatic) => value / LEVER_ARM,
            (Self::Speed(value), JointKind::Prismatic) => value * LEVER_ARM,
        }
    }
}

/// `interpolation`: the default.
pub(super) fn convert(
    checker: &Checker<'_>,
    table: &HapticsTable,
    joints: &[JointSpec],
    interpolation: Interpolation,
) -> Result<HapticsSpec, SceneError> {
    let vector =
        |key, value: &Option<Spanned<PerJoint>>, strictly, default: Quantity| -> Result<JointVector, SceneError> {
            checker.per_joint(key, value.as_ref(), joints, strictly, |kind| default.of(kind))
        };
    use Quantity::{Gain, Speed, Torque};
    let rate = table
        .rate
        .as_ref()
        .map_or(Ok(1000.0), |value| checker.within("rate", value, 1.0 / GREATEST_INTERVAL, HIGHEST_RATE));
    let threshold =
        table.threshold.as_ref().map_or(Ok(THRESHOLD), |value| checker.between("threshold", value, 0.0, 1.0));
    let factor = table.passivity_factor.as_ref().map_or(Ok(1.0), |value| checker.positive("passivity_factor", value));
    let hand = &table.hand;
    Ok(HapticsSpec {
        rate: rate?,
        threshold: threshold?,
        interpolation: table.interpolation.unwrap_or(interpolation),
        passivity_factor: factor?,
        boundary_slope: vector("boundary_slope", &table.boundary_slope, true, Gain(BOUNDARY_SLOPE))?,
        proxy_damping: vector("proxy_damping", &table.proxy_damping, false, Gain(0.02))?,
        proxy_damping_is_free: table.proxy_damping.is_none(),
        proxy_inertia: table.proxy_inertia.unwrap_or(ProxyInertia::Constant),
        coupling_stiffness: vector("coupling_stiffness", &table.coupling_stiffness, true, Gain(20.0))?,
        coupling_damping: vector("coupling_damping", &table.coupling_damping, false, Gain(0.01))?,
        device_damping: vector("device_damping", &table.device_damping, false, Gain(0.03))?,
        device_inertia: vector("device_inertia", &table.device_inertia, true, Gain(1e-3))?,
        torque_limit: vector("torque_limit", &table.torque_limit, true, Torque(1.5))?,
        torque_rate_limit: vector("torque_rate_limit", &table.torque_rate_limit, true, Torque(500.0))?,
        speed_limit: vector("speed_limit", &table.speed_limit, true, Speed(50.0))?,
        encoder_step: vector("encoder_step", &table.encoder_step, false, Torque(0.0))?,
        device_friction: vector("device_friction", &table.device_friction, false, Torque(0.0))?,
        effects: effects(checker, table)?,
        hand: HandSpec {
            stiffness: vector("stiffness", &hand.stiffness, false, Gain(20.0))?,
            damping: vector("damping", &hand.damping, false, Gain(0.4))?,
            inertia: vector("inertia", &hand.inertia, false, Gain(2e-3))?,
        },
    })
}

/// Highest rate of the loop (Hz): a tick takes some microseconds.
const HIGHEST_RATE: f64 = 1e5;
/// Default stiffness of a bristle (N/m): a friction of 1 N builds up over 2 mm, below what a fingertip takes for a
/// slip.
const BRISTLE_STIFFNESS: f64 = 500.0;
/// Default damping of a bristle (N s/m).
const BRISTLE_DAMPING: f64 = 1.0;
/// Default channels of the four-channel coupling: both force channels whole, half of the inertias (see `coupling.rs`).
const CHANNELS: [f64; 4] = [0.5, 1.0, 1.0, 0.5];
/// Default time constant of its filter (s).
const CHANNEL_FILTER: f64 = 0.005;

fn effects(checker: &Checker<'_>, table: &HapticsTable) -> Result<HapticEffects, SceneError> {
    let damping = |value| -> Result<ContactDampingSpec, SceneError> {
        let damping = checker.positive("contact_damping", value)?;
        Ok(ContactDampingSpec { damping, place: value.span() })
    };
    Ok(HapticEffects {
        friction: table.friction.as_ref().map(|table| friction(checker, table)).transpose()?,
        contact_damping: table.contact_damping.as_ref().map(damping).transpose()?,
        four_channel: table.four_channel.as_ref().map(|table| four_channel(checker, table)).transpose()?,
        passivity_control: table.passivity_control.unwrap_or(false),
    })
}

fn friction(checker: &Checker<'_>, table: &Spanned<FrictionTable>) -> Result<FrictionSpec, SceneError> {
    let place = table.span();
    let table = table.get_ref();
    let stiffness = table.stiffness.as_ref().map(|value| checker.positive("stiffness", value));
    let damping = table.damping.as_ref().map(|value| checker.not_negative("damping", value));
    let coefficient = checker.positive("coefficient", &table.coefficient)?;
    let static_coefficient = match &table.static_coefficient {
        None => coefficient,
        Some(value) => checker.positive("static_coefficient", value)?,
    };
    if let Some(value) = table.static_coefficient.as_ref().filter(|_| static_coefficient < coefficient) {
        let message =
            format!("static_coefficient is less than coefficient, {coefficient}: what slips would stick no more");
        return Err(checker.error(value.span(), message));
    }
    Ok(FrictionSpec {
        coefficient,
        static_coefficient,
        stiffness: stiffness.unwrap_or(Ok(BRISTLE_STIFFNESS))?,
        damping: damping.unwrap_or(Ok(BRISTLE_DAMPING))?,
        place,
    })
}

fn four_channel(checker: &Checker<'_>, table: &FourChannelTable) -> Result<FourChannelSpec, SceneError> {
    let channels = match &table.channels {
        None => CHANNELS,
        Some(channels) if channels.get_ref().iter().all(|share| (0.0..=1.0).contains(share)) => *channels.get_ref(),
        Some(channels) => {
            let message = "channels are shares of the ideal C1 to C4: each must be at least 0 and at most 1";
            return Err(checker.error(channels.span(), message));
        }
    };
    if let (Some(given), [0.0, 0.0, 0.0, 0.0]) = (&table.channels, channels) {
        let message = "four_channel cannot act where all of its channels are zero: leave it out";
        return Err(checker.error(given.span(), message));
    }
    let filter = table.filter.as_ref().map(|value| checker.positive("filter", value));
    Ok(FourChannelSpec { channels, filter: filter.unwrap_or(Ok(CHANNEL_FILTER))? })
}
