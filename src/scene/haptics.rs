//! `[haptics]`: gains and effects of the 1 kHz loop. The defaults are those of a desktop device.
//!
//! Gains are given joint by joint, because the coordinates of a chain may mix radians and metres: where a doc says (N
//! m/rad), a prismatic joint has (N/m), and so on.

use super::check::Checker;
use super::gains::{GAINS, OF_THE_DEVICE, OF_THE_HAND};
use super::value::{KEY, Range, defaults, gains, positive, positive_gains, share};
use super::{JointSpec, RelaxationSpec};
use crate::Error;
use crate::JointVector;
use serde::Deserialize;
use serde::de::{Deserializer, Error as _};

/// Greatest time between two ticks (s): a whole period of a hand's fastest motion, 10 Hz. After more, the position
/// before says nothing about the velocity.
pub const GREATEST_INTERVAL: f64 = 0.1;

/// Lever arm with which a prismatic joint counts among revolute ones (m): a tenth of a metre, the size of a tool in a
/// hand. Gains' defaults and errors over joints of both kinds are converted with it.
pub const LEVER_ARM: f64 = 0.1;

/// Threshold Ith of the contact index unless the scene names one (1): the paper's.
pub const THRESHOLD: f64 = 0.5;

/// Slope Ks of the boundary layer at a revolute joint unless the scene names one (N m/rad).
pub const BOUNDARY_SLOPE: f64 = 15.0;

/// The 1 kHz loop (section 3.1).
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct HapticsSpec {
    /// Ticks per second (Hz).
    #[serde(deserialize_with = "loop_rate")]
    pub rate: f64,
    /// Contact where the interpolated contact index exceeds this, Ith (1).
    #[serde(deserialize_with = "share")]
    pub threshold: f64,
    /// How the torque is interpolated between grid points.
    pub interpolation: Interpolation,
    /// Slope Ks of the boundary layer at each joint (N m/rad).
    #[serde(deserialize_with = "positive_gains")]
    pub boundary_slope: JointVector,
    /// mu of the passivity condition Ks <= mu bv / T (1).
    #[serde(deserialize_with = "positive")]
    pub passivity_factor: f64,
    /// Extra damping bv of the proxy at each joint (N m s/rad).
    #[serde(deserialize_with = "gains")]
    pub proxy_damping: JointVector,
    /// Whether the scene leaves bv to the dataset, which raises it as far as passivity asks.
    #[serde(skip)]
    pub proxy_damping_is_free: bool,
    /// Which inertia the proxy moves with.
    pub proxy_inertia: ProxyInertia,
    /// Stiffness Kvc of the virtual coupling at each joint (N m/rad).
    #[serde(deserialize_with = "positive_gains")]
    pub coupling_stiffness: JointVector,
    /// Damping Bvc of the virtual coupling at each joint (N m s/rad).
    #[serde(deserialize_with = "gains")]
    pub coupling_damping: JointVector,
    /// Device damping bd at each joint (N m s/rad).
    #[serde(deserialize_with = "gains")]
    pub device_damping: JointVector,
    /// Apparent inertia of the device at each joint (kg m^2).
    #[serde(deserialize_with = "positive_gains")]
    pub device_inertia: JointVector,
    /// Greatest torque of each joint, in size (N m).
    #[serde(deserialize_with = "positive_gains")]
    pub torque_limit: JointVector,
    /// Greatest rate of change of each joint's torque, in size (N m/s).
    #[serde(deserialize_with = "positive_gains")]
    pub torque_rate_limit: JointVector,
    /// Greatest speed of each joint of the device; what moves faster is taken for a fault of the device (rad/s).
    #[serde(deserialize_with = "positive_gains")]
    pub speed_limit: JointVector,
    /// Resolution of each joint's encoder; zero if not given (rad).
    #[serde(deserialize_with = "gains")]
    pub encoder_step: JointVector,
    /// Dry friction of each joint of the device; zero if not given (N m).
    #[serde(deserialize_with = "gains")]
    pub device_friction: JointVector,
    /// Friction between the proxy and the object, where the scene names it, as each of the two effects below.
    pub friction: Option<FrictionSpec>,
    /// Memory of the object, which the scene names in its table.
    #[serde(skip)]
    pub relaxation: Option<RelaxationSpec>,
    /// Force channels beside the spring and damper of the virtual coupling.
    pub four_channel: Option<FourChannelSpec>,
    /// Whether a passivity controller acts when the passivity observer is negative.
    pub passivity_control: bool,
    /// The hand that holds the device.
    pub hand: HandSpec,
}

/// Coulomb friction of an elastic-plastic spring between proxy and object.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FrictionSpec {
    /// Tangential over normal force while slipping (1).
    #[serde(deserialize_with = "positive")]
    pub coefficient: f64,
    /// Tangential over normal force at which sticking ends; at least `coefficient`, which it is where it is `None` (1).
    #[serde(deserialize_with = "positive", default)]
    pub static_coefficient: Option<f64>,
    /// Stiffness of the spring: how fast friction builds up while sticking (N/m).
    #[serde(deserialize_with = "positive", default = "sticking_stiffness")]
    pub stiffness: f64,
}

/// Four-channel coupling (Lawrence 1993).
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct FourChannelSpec {
    /// C1 to C4 as shares of their ideal values Zs, 1, 1 and -Zm, from 0 to 1 (1).
    #[serde(deserialize_with = "channels")]
    pub channels: [f64; 4],
    /// Time constant of the low-pass filter on accelerations and on the estimated force of the hand (s).
    #[serde(deserialize_with = "positive")]
    pub filter: f64,
}

/// Which inertia the proxy moves with.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum ProxyInertia {
    /// That of the chain in the middle of the grid, everywhere.
    Constant,
    /// That of the chain in each configuration.
    Configuration,
}

/// How the torque is interpolated between grid points.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, serde::Serialize, clap::ValueEnum)]
#[serde(rename_all = "kebab-case")]
pub enum Interpolation {
    /// Multilinear torque behind the boundary of the contact index (section 3.1).
    Linear,
    /// Minus the gradient of a smoothly interpolated energy: makes no energy around any loop. Scenes of datasets that
    /// were filled while they were felt named it `direct`.
    #[serde(alias = "direct")]
    Potential,
}

impl Interpolation {
    /// All between the points of a grid, from the roughest on.
    pub const ALL: [Self; 2] = [Self::Linear, Self::Potential];

    /// Whether the torque is the gradient of an interpolated energy, which a dataset must hold; a boundary layer limits
    /// the others'.
    #[must_use]
    pub fn is_potential(self) -> bool {
        self == Self::Potential
    }

    /// As the scene names it.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Linear => "linear",
            Self::Potential => "potential",
        }
    }
}

/// The simulated hand: a mass on the device, pulled along the motion by a spring and a damper at each joint.
#[derive(Clone, Copy, Debug, Default, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct HandSpec {
    /// Between the motion and the hand (N m/rad).
    #[serde(deserialize_with = "gains")]
    pub stiffness: JointVector,
    /// Between the motion and the hand (N m s/rad).
    #[serde(deserialize_with = "gains")]
    pub damping: JointVector,
    /// Inertia of the hand itself, moving with the device (kg m^2).
    #[serde(deserialize_with = "gains")]
    pub inertia: JointVector,
}

/// Damping of the proxy over the stiffness of its coupling where the scene leaves it out (s): the proxy lags behind the
/// device by no more than a tick. That of a desktop device's defaults.
const PROXY_LAG: f64 = 1e-3;
/// Highest rate of the loop (Hz): a tick takes some microseconds.
const HIGHEST_RATE: f64 = 1e5;
/// Default channels of the four-channel coupling: both force channels whole, half of the inertias (see `coupling.rs`).
const CHANNELS: [f64; 4] = [0.5, 1.0, 1.0, 0.5];
/// Default time constant of its filter (s).
const CHANNEL_FILTER: f64 = 0.005;

defaults! {
    /// Default stiffness of friction (N/m): a friction of 1 N builds up over 2 mm, below what a fingertip takes for
    /// a slip.
    sticking_stiffness: f64 = 500.0;
}

impl Default for HapticsSpec {
    /// A loop of no arm yet: lists are empty until `check` fits them to one.
    fn default() -> Self {
        let unset = JointVector::default();
        Self {
            rate: 1000.0,
            threshold: THRESHOLD,
            interpolation: Interpolation::Potential,
            boundary_slope: unset,
            passivity_factor: 1.0,
            proxy_damping: unset,
            proxy_damping_is_free: false,
            proxy_inertia: ProxyInertia::Constant,
            coupling_stiffness: unset,
            coupling_damping: unset,
            device_damping: unset,
            device_inertia: unset,
            torque_limit: unset,
            torque_rate_limit: unset,
            speed_limit: unset,
            encoder_step: unset,
            device_friction: unset,
            friction: None,
            relaxation: None,
            four_channel: None,
            passivity_control: false,
            hand: HandSpec::default(),
        }
    }
}

impl Default for FourChannelSpec {
    fn default() -> Self {
        Self { channels: CHANNELS, filter: CHANNEL_FILTER }
    }
}

impl HapticsSpec {
    /// Whether the loop needs to know how contacts slip.
    #[must_use]
    pub fn uses_slip(&self) -> bool {
        self.friction.is_some() || self.relaxation.as_ref().is_some_and(|relaxation| relaxation.dent.is_some())
    }

    /// Fits it to the arm's `joints`, and checks it.
    pub(super) fn check(&mut self, checker: &Checker<'_>, joints: &[JointSpec]) -> Result<(), Error> {
        self.proxy_damping_is_free = self.proxy_damping.is_empty();
        let gains = GAINS.into_iter().map(|(list, _)| list).chain(OF_THE_DEVICE).map(|list| ("haptics", list));
        for (table, (key, list, default)) in gains.chain(OF_THE_HAND.map(|list| ("haptics.hand", list))) {
            checker.fit(&format!("{table}.{key}"), list(self), joints, |kind| default.of(kind))?;
        }
        if self.proxy_damping_is_free {
            let stiffness = self.coupling_stiffness;
            self.proxy_damping.iter_mut().zip(stiffness.iter()).for_each(|(damping, k)| *damping = PROXY_LAG * k);
        }
        let Some(FrictionSpec { coefficient, static_coefficient: Some(most), .. }) = self.friction else {
            return Ok(());
        };
        if most < coefficient {
            let message =
                format!("static_coefficient is less than coefficient, {coefficient}: what slips would stick no more");
            return Err(checker.at("haptics.friction.static_coefficient", message));
        }
        Ok(())
    }
}

fn loop_rate<'de, D: Deserializer<'de>>(value: D) -> Result<f64, D::Error> {
    Range::Within(1.0 / GREATEST_INTERVAL, HIGHEST_RATE).number(value)
}

fn channels<'de, D: Deserializer<'de>>(value: D) -> Result<[f64; 4], D::Error> {
    let channels = Range::Within(0.0, 1.0).array(value)?;
    if channels == [0.0; 4] {
        let what = format!("{KEY}are all zero, and four_channel cannot act so: leave it out");
        return Err(D::Error::custom(what));
    }
    Ok(channels)
}
