//! `[device]`: how a real haptic device stands to the scene's arm.

use super::ProxySpec;
use super::check::Checker;
use super::value::{KEY, Range, coordinates, not_negative, positive};
use crate::JointVector;
use crate::{Error, names::counted};
use serde::de::{Deserialize, Deserializer, Error as _};

/// How the coordinates of a real device become those of the scene, and how its tip holds the arm. Which device it is,
/// is said on the command line: any device with such coordinates will do.
#[derive(Clone, Debug, PartialEq, serde::Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct DeviceSpec {
    /// Rows of A in `q = A m + b`, m the device's coordinates, q the scene's joints or, for a Cartesian device, the
    /// position of its tip; `None` for the identity.
    #[serde(deserialize_with = "square")]
    pub map: Option<Vec<JointVector>>,
    /// b (rad or m); `None` for zero.
    #[serde(deserialize_with = "coordinates")]
    pub offset: Option<JointVector>,
    /// Number of the contact node that the tip of a Cartesian device leads; `None` for the last one.
    pub node: Option<usize>,
    /// Stiffness of the spring between a Cartesian device's tip and that node (N/m).
    #[serde(deserialize_with = "positive")]
    pub stiffness: f64,
    /// Damping of the damper beside it (N s/m).
    #[serde(deserialize_with = "not_negative")]
    pub damping: f64,
    /// Maximum size of each of the device's efforts, where that is to be less than the device allows (N m or N).
    #[serde(deserialize_with = "sizes")]
    pub effort_limit: Option<JointVector>,
}

impl Default for DeviceSpec {
    fn default() -> Self {
        Self { map: None, offset: None, node: None, stiffness: TIP_STIFFNESS, damping: TIP_DAMPING, effort_limit: None }
    }
}

/// Default stiffness between tip and node (N/m): at 1 kHz a held spring gives no energy to a hand with K T/2 = 0.15 N
/// s/m of damping, which a hand on a desktop device has ten times over (Kuchenbecker, Park and Niemeyer 2003).
const TIP_STIFFNESS: f64 = 300.0;

/// Default damping between tip and node (N s/m): larger than what holding takes, and below what differences of a
/// position that is measured in steps of 0.05 mm make audible.
const TIP_DAMPING: f64 = 0.5;

impl DeviceSpec {
    /// Checks it against the arm.
    pub(super) fn check(&self, checker: &Checker<'_>, proxy: &ProxySpec) -> Result<(), Error> {
        checker.node("device.node", self.node, proxy)
    }
}

fn sizes<'de, D: Deserializer<'de>>(value: D) -> Result<Option<JointVector>, D::Error> {
    Range::NotNegative.joints(value)
}

/// Reads the rows of a square matrix.
fn square<'de, D: Deserializer<'de>>(value: D) -> Result<Option<Vec<JointVector>>, D::Error> {
    #[derive(serde::Deserialize)]
    struct Row(#[serde(deserialize_with = "coordinates")] JointVector);

    let rows: Vec<JointVector> = Vec::<Row>::deserialize(value)?.into_iter().map(|Row(row)| row).collect();
    match rows.iter().find(|row| row.len() != rows.len()) {
        None => Ok(Some(rows)),
        Some(row) => Err(D::Error::custom(format!(
            "{KEY}has {}, one of them of {}: it must be square",
            counted(rows.len(), ["row", "rows"]),
            counted(row.len(), ["number", "numbers"])
        ))),
    }
}
