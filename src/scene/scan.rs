//! The content of `[scan]`: how a real object is haptized (section 2.2), and the simulated specimen that stands in for
//! it.

use super::check::Checker;
use super::grid::GridTable;
use super::value::{
    KEY, Range, count, defaults, direction, edges, gains, not_negative, positive, positive_gains, vector,
};
use super::{GridSpec, JointKind, ProxySpec, RelaxationSpec};
use crate::Error;
use crate::JointVector;
use glam::DVec3;
use serde::de::{Deserialize, Deserializer, Error as _};

/// Most positions along one axis of a plan.
const MOST: usize = 100_000;

/// Most speeds of recorded presses.
const MOST_SPEEDS: usize = 8;

/// Haptization of a real object.
#[derive(Clone, Debug, PartialEq)]
pub struct ScanSpec {
    /// Where the proxy goes.
    pub plan: PlanSpec,
    /// How it is driven there, and when a measurement counts.
    pub control: ScanControl,
    /// What is recorded beside, of how the object remembers and holds back; absent where the scene does not name it.
    pub history: Option<HistorySpec>,
    /// Limits that stop it.
    pub limits: ScanLimits,
    /// The specimen that is simulated in place of a real one.
    pub simulated: SpecimenSpec,
}

/// Where the proxy goes.
#[derive(Clone, Debug, PartialEq)]
pub enum PlanSpec {
    /// A grid in the workspace, visited by one contact node.
    Workspace(WorkspacePlan),
    /// A grid in C-space.
    Joints(GridSpec),
}

impl PlanSpec {
    /// Number of the contact node that is watched, of so many `nodes` of the chain.
    #[must_use]
    pub fn node(&self, nodes: usize) -> usize {
        match self {
            Self::Workspace(WorkspacePlan { node: Some(node), .. }) => *node,
            _ => nodes.saturating_sub(1),
        }
    }
}

/// A grid of positions of one contact node: lines of increasing depth, one beside the other.
#[derive(Clone, Copy, Debug, PartialEq, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct WorkspacePlan {
    /// Number of the contact node that visits the grid, from the chain's first; `None` for the last one.
    pub node: Option<usize>,
    /// First position (m).
    #[serde(deserialize_with = "vector")]
    pub start: DVec3,
    /// From line to line, slowest first.
    #[serde(deserialize_with = "two_axes")]
    pub across: [PlanAxis; 2],
    /// Along each line, into the object.
    pub depth: PlanAxis,
    /// How far the node backs out of a line before it moves to the next (m).
    #[serde(deserialize_with = "not_negative", default)]
    pub clearance: f64,
}

/// Positions at equal distances along a direction.
#[derive(Clone, Copy, Debug, PartialEq, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PlanAxis {
    /// Unit vector.
    #[serde(deserialize_with = "direction")]
    pub direction: DVec3,
    /// (m)
    #[serde(deserialize_with = "positive")]
    pub spacing: f64,
    /// At least 1.
    #[serde(deserialize_with = "count::<1, MOST, _, _>")]
    pub count: usize,
}

/// How the device is driven, and when a measurement counts.
#[derive(Clone, Debug, PartialEq, serde::Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct ScanControl {
    /// Ticks per second (Hz).
    #[serde(deserialize_with = "control_rate")]
    pub rate: f64,
    /// Proportional gain (N m/rad).
    #[serde(deserialize_with = "positive_gains")]
    pub stiffness: JointVector,
    /// Derivative gain (N m s/rad).
    #[serde(deserialize_with = "gains")]
    pub damping: JointVector,
    /// Greatest speed of the commanded position, in any joint (rad/s or m/s).
    #[serde(deserialize_with = "positive")]
    pub speed: f64,
    /// Length of the window in which the device must be steady (s).
    #[serde(deserialize_with = "positive")]
    pub window: f64,
    /// Range of each measured position within the window, at most (rad or m).
    #[serde(deserialize_with = "positive")]
    pub still: f64,
    /// Change of the mean torque from one half of the window to the other, at most (N m).
    #[serde(deserialize_with = "positive")]
    pub drift: f64,
    /// Time after which a configuration that is not steady is logged as such (s).
    #[serde(deserialize_with = "positive")]
    pub timeout: f64,
    /// Time over which position and torque are averaged (s).
    #[serde(deserialize_with = "positive")]
    pub average: f64,
    /// Norm of the torque above which a configuration counts as contact, epsilon of section 3.1: above the device's own
    /// dry friction, which no force sensor can distinguish from contact (N m).
    #[serde(deserialize_with = "not_negative")]
    pub epsilon: f64,
}

impl Default for ScanControl {
    fn default() -> Self {
        Self {
            rate: 1000.0,
            stiffness: JointVector::default(),
            damping: JointVector::default(),
            speed: 0.3,
            window: 0.1,
            still: 1e-3,
            drift: 5e-3,
            timeout: 5.0,
            average: 0.1,
            epsilon: 0.01,
        }
    }
}

/// Presses that are recorded from the first touch on, at some lines of a [`WorkspacePlan`]: to the end of the line at
/// each of the speeds, held there, moved aside to and fro, and back out.
#[derive(Clone, Debug, PartialEq, serde::Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct HistorySpec {
    /// Share of the plan's lines, at least one (1).
    #[serde(deserialize_with = "share_of_lines")]
    pub share: f64,
    /// Speed of the commanded position in each press (rad/s or m/s).
    #[serde(deserialize_with = "speeds")]
    pub speeds: Vec<f64>,
    /// How long each is held (s).
    #[serde(deserialize_with = "positive")]
    pub hold: f64,
    /// How far the node goes to either side in the first press, along both axes across; zero: nowhere (m).
    #[serde(deserialize_with = "not_negative")]
    pub stroke: f64,
}

impl Default for HistorySpec {
    fn default() -> Self {
        Self { share: 0.05, speeds: vec![1.0, 0.1], hold: 10.0, stroke: 0.0 }
    }
}

/// Limits that stop a scan at once.
#[derive(Clone, Debug, PartialEq, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ScanLimits {
    /// Control torque less gravity, in size (N m).
    #[serde(deserialize_with = "positive_gains", default)]
    pub torque: JointVector,
    /// Measured speed, in size (rad/s or m/s).
    #[serde(deserialize_with = "positive", default = "limit_speed")]
    pub speed: f64,
    /// Box that the visiting node (the last one in plans over joints) must not leave: least and greatest corner (m).
    #[serde(deserialize_with = "corners")]
    pub workspace: [DVec3; 2],
}

/// A simulated spongy block, mounted so that it does not move.
#[derive(Clone, Debug, PartialEq, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SpecimenSpec {
    /// Corner with the least coordinates (m).
    #[serde(deserialize_with = "vector")]
    pub corner: DVec3,
    /// Extent along x, y and z (m).
    #[serde(deserialize_with = "edges")]
    pub size: DVec3,
    /// Layer on its surface.
    #[serde(default)]
    pub cover: Cover,
    /// Share of the force after a step that fades, and the time in which it does (1, s).
    #[serde(default = "foam")]
    pub relaxation: Vec<[f64; 2]>,
    /// Coefficient of friction between proxy and surface (1).
    #[serde(deserialize_with = "not_negative", default = "friction")]
    pub friction: f64,
    /// Encoder counts a revolution, or a metre of a prismatic joint; 0 for exact positions.
    #[serde(deserialize_with = "not_negative", default = "encoder")]
    pub encoder: f64,
    /// Standard deviation of the actuators' torque at each tick (N m).
    #[serde(deserialize_with = "not_negative", default = "noise")]
    pub noise: f64,
    /// Dry friction of each joint of the device (N m).
    #[serde(deserialize_with = "not_negative", default = "joint_friction")]
    pub joint_friction: f64,
}

/// Layer on the specimen's surface.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Cover {
    /// Nothing.
    #[default]
    Bare,
    /// A taut fabric: stiffer.
    Fabric,
}

/// `[scan]` as it is written.
#[derive(serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct ScanTable {
    workspace: Option<WorkspacePlan>,
    joints: Option<GridTable>,
    #[serde(default)]
    control: ScanControl,
    history: Option<HistorySpec>,
    limits: ScanLimits,
    simulated: SpecimenSpec,
}

impl ScanTable {
    /// The scan for the arm `proxy`.
    pub fn check(self, checker: &Checker<'_>, proxy: &ProxySpec) -> Result<ScanSpec, Error> {
        let Self { workspace, joints, mut control, history, mut limits, simulated } = self;
        let plan = match (workspace, joints) {
            (Some(plan), None) => {
                checker.node("scan.workspace.node", plan.node, proxy)?;
                PlanSpec::Workspace(plan)
            }
            (None, Some(grid)) => PlanSpec::Joints(grid.check(checker, "scan.joints", &proxy.joints)?),
            _ => return Err(checker.at("scan", "scan needs either [scan.workspace] or [scan.joints]")),
        };
        let by_kind = |revolute, prismatic| move |kind| if kind == JointKind::Revolute { revolute } else { prismatic };
        let joints = &proxy.joints;
        checker.fit("scan.control.stiffness", &mut control.stiffness, joints, by_kind(40.0, 4000.0))?;
        checker.fit("scan.control.damping", &mut control.damping, joints, by_kind(0.3, 30.0))?;
        checker.fit("scan.limits.torque", &mut limits.torque, joints, by_kind(2.0, 20.0))?;
        if control.window * control.rate < 4.0 {
            let message = "window must hold at least four ticks of the control rate";
            return Err(checker.at("scan.control.window", message));
        }
        if history.is_some() && matches!(plan, PlanSpec::Joints(_)) {
            let message =
                "history presses along the lines of [scan.workspace], which [scan.joints] has not: leave it out";
            return Err(checker.at("scan.history", message));
        }
        let relaxation = RelaxationSpec { terms: simulated.relaxation.clone(), dent: None };
        if !relaxation.terms.is_empty() {
            relaxation.check_terms(checker, "scan.simulated.relaxation")?;
        }
        Ok(ScanSpec { plan, control, history, limits, simulated })
    }
}

fn control_rate<'de, D: Deserializer<'de>>(value: D) -> Result<f64, D::Error> {
    Range::Between(1.0, 1e5).number(value)
}

fn share_of_lines<'de, D: Deserializer<'de>>(value: D) -> Result<f64, D::Error> {
    Range::Within(0.0, 1.0).number(value)
}

fn speeds<'de, D: Deserializer<'de>>(value: D) -> Result<Vec<f64>, D::Error> {
    let speeds = Range::Positive.list(value)?;
    if (1..=MOST_SPEEDS).contains(&speeds.len()) {
        return Ok(speeds);
    }
    Err(D::Error::custom(format!("{KEY}has {} speeds: it needs 1 to {MOST_SPEEDS}", speeds.len())))
}

/// Two terms of an overstress of 0.25 and 0.12 times the lasting force.
fn foam() -> Vec<[f64; 2]> {
    vec![[0.25 / 1.37, 0.03], [0.12 / 1.37, 0.25]]
}

fn two_axes<'de, D: Deserializer<'de>>(value: D) -> Result<[PlanAxis; 2], D::Error> {
    let what = format!("{KEY}needs two axes: from line to line, slowest first");
    Vec::deserialize(value)?.try_into().map_err(|_| D::Error::custom(what))
}

/// Reads two opposite corners of a box.
fn corners<'de, D: Deserializer<'de>>(value: D) -> Result<[DVec3; 2], D::Error> {
    #[derive(serde::Deserialize)]
    struct Corner(#[serde(deserialize_with = "vector")] DVec3);

    match Vec::deserialize(value)?[..] {
        [Corner(least), Corner(greatest)] if least.cmplt(greatest).all() => Ok([least, greatest]),
        _ => Err(D::Error::custom(format!(
            "{KEY}must be [[least x, y, z], [greatest x, y, z]], each least below its greatest"
        ))),
    }
}

defaults! {
    /// Default greatest speed (rad/s or m/s).
    limit_speed: f64 = 3.0;
    /// Default coefficient of friction on the specimen (1).
    friction: f64 = 0.4;
    /// Default encoder counts a revolution or metre.
    encoder: f64 = 40_000.0;
    /// Default noise of the actuators (N m).
    noise: f64 = 2e-3;
    /// Default dry friction of the joints (N m).
    joint_friction: f64 = 2e-3;
}
