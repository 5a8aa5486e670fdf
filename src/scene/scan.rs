//! The content of `[scan]`: how a real object is haptized (section 2.2), and the simulated specimen that stands in for
//! it.

use super::GridSpec;
use crate::JointVector;
use glam::DVec3;

/// Haptization of a real object.
#[derive(Clone, Debug, PartialEq)]
pub struct ScanSpec {
    /// Where the proxy goes.
    pub plan: PlanSpec,
    /// How it is driven there, and when a measurement counts.
    pub control: ScanControl,
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

/// A grid of positions of one contact node: lines of increasing depth, one beside the other.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WorkspacePlan {
    /// Number of the contact node that visits the grid, from the chain's first.
    pub node: usize,
    /// First position (m).
    pub start: DVec3,
    /// From line to line, slowest first.
    pub across: [PlanAxis; 2],
    /// Along each line, into the object.
    pub depth: PlanAxis,
    /// How far the node backs out of a line before it moves to the next (m).
    pub clearance: f64,
}

/// Positions at equal distances along a direction.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlanAxis {
    /// Unit vector.
    pub direction: DVec3,
    /// (m)
    pub spacing: f64,
    /// At least 1.
    pub count: usize,
}

/// How the device is driven, and when a measurement counts.
#[derive(Clone, Debug, PartialEq)]
pub struct ScanControl {
    /// Ticks per second (Hz).
    pub rate: f64,
    /// Proportional gain (N m/rad).
    pub stiffness: JointVector,
    /// Derivative gain (N m s/rad).
    pub damping: JointVector,
    /// Greatest speed of the commanded position, in any joint (rad/s or m/s).
    pub speed: f64,
    /// Length of the window in which the device must be steady (s).
    pub window: f64,
    /// Range of each measured position within the window, at most (rad or m).
    pub still: f64,
    /// Change of the mean torque from one half of the window to the other, at most (N m).
    pub drift: f64,
    /// Time after which a configuration that is not steady is logged as such (s).
    pub timeout: f64,
    /// Time over which position and torque are averaged (s).
    pub average: f64,
    /// Norm of the torque above which a configuration counts as contact, epsilon of section 3.1: above the device's own
    /// dry friction, which no force sensor can distinguish from contact (N m).
    pub epsilon: f64,
}

/// Limits that stop a scan at once.
#[derive(Clone, Debug, PartialEq)]
pub struct ScanLimits {
    /// Control torque less gravity, in size (N m).
    pub torque: JointVector,
    /// Measured speed, in size (rad/s or m/s).
    pub speed: f64,
    /// Box that the visiting node (the last one in plans over joints) must not leave: least and greatest corner (m).
    pub workspace: [DVec3; 2],
}

/// A simulated spongy block, mounted so that it does not move.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SpecimenSpec {
    /// Corner with the least coordinates (m).
    pub corner: DVec3,
    /// Extent along x, y and z (m).
    pub size: DVec3,
    /// Layer on its surface.
    pub cover: Cover,
    /// Coefficient of friction between proxy and surface (1).
    pub friction: f64,
    /// Encoder counts a revolution, or a metre of a prismatic joint; 0 for exact positions.
    pub encoder: f64,
    /// Standard deviation of the actuators' torque at each tick (N m).
    pub noise: f64,
    /// Dry friction of each joint of the device (N m).
    pub joint_friction: f64,
}

/// Layer on the specimen's surface.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Cover {
    /// Nothing.
    Bare,
    /// A taut fabric: stiffer.
    Fabric,
}
