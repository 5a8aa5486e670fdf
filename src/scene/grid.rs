//! `[grid]`: the uniform grid over C-space.
//!
//! Without `axes`, every joint's range between its limits is cut into steps of `spacing`. An axis gives its start and
//! two of step (default: `spacing`), stop and count.

use super::JointSpec;
use super::check::Checker;
use super::value::{count, finite, positive};
use crate::MAX_AXES;
use crate::{Error, names::counted};
use serde::Deserialize;

/// How far beyond an end a grid line may lie and still count, in steps (1): spacings such as pi/60 are written with a
/// handful of digits, and 1e-6 of a step changes no torque that is interpolated between lines.
pub const GRID_STEP_SLACK: f64 = 1e-6;

/// A grid line this fraction of a step outside the samples' range still lies on its end.
pub const GRID_LINE: f64 = 1e-9;

/// Most grid points: `point * joints + joint` then fits 32 bits, as GPU kernels count.
const MAX_POINTS: usize = 1 << 28;
/// Disk of one point beside its torques: energy, gap, status, residual, iterations, contact offset (B).
const BYTES_PER_POINT: usize = 8 + 4 + 1 + 4 + 4 + 8;

/// The uniform grid over C-space.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct GridSpec {
    /// One per joint, in the chain's order; none where the scene leaves the grid out.
    pub axes: Vec<AxisSpec>,
}

/// Grid coordinates `start + k step`, `k < count`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AxisSpec {
    /// (rad or m)
    pub start: f64,
    /// Positive (rad or m).
    pub step: f64,
    /// At least 2.
    pub count: usize,
}

/// `[grid]` as it is written.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct GridTable {
    #[serde(default, deserialize_with = "positive")]
    spacing: Option<f64>,
    axes: Option<Vec<AxisTable>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct AxisTable {
    #[serde(default, deserialize_with = "finite")]
    start: Option<f64>,
    #[serde(default, deserialize_with = "finite")]
    stop: Option<f64>,
    #[serde(default, deserialize_with = "positive")]
    step: Option<f64>,
    #[serde(default, deserialize_with = "count::<2, MAX_POINTS, _, _>")]
    count: Option<usize>,
}

impl GridTable {
    /// The grid, which stands at `path` in the text, for an arm with `joints`.
    pub fn check(&self, checker: &Checker<'_>, path: &str, joints: &[JointSpec]) -> Result<GridSpec, Error> {
        let at = |message: String| checker.at(path, message);
        if joints.len() > MAX_AXES {
            return Err(at(format!(
                "a grid has at most {MAX_AXES} axes, and the arm has {} joints: leave it out; `haptize play` and \
                 `haptize view` solve contact of the scene in every tick",
                joints.len()
            )));
        }
        let axes: Vec<AxisSpec> = match (&self.axes, self.spacing) {
            (None, None) => {
                return Err(at("the grid has no resolution: give spacing, or axes with start, step and count".into()));
            }
            (None, Some(step)) => {
                let axis =
                    |joint: &JointSpec| AxisSpec { start: joint.limits[0], step, count: steps(joint.limits, step) };
                joints.iter().map(axis).collect()
            }
            (Some(axes), _) if axes.len() != joints.len() => {
                let message = format!(
                    "the grid has {} for {}",
                    counted(axes.len(), ["axis", "axes"]),
                    counted(joints.len(), ["joint", "joints"])
                );
                return Err(checker.at(&format!("{path}.axes"), message));
            }
            (Some(axes), spacing) => {
                let spec = |(number, (axis, joint)): (usize, (&AxisTable, &JointSpec))| {
                    axis.check(spacing, joint).map_err(|message| checker.at(&format!("{path}.axes.{number}"), message))
                };
                axes.iter().zip(joints).enumerate().map(spec).collect::<Result<_, _>>()?
            }
        };
        if let Some((_, joint)) = axes.iter().zip(joints).find(|(axis, _)| axis.count < 2) {
            return Err(at(format!(
                "the grid has a single point along {:?}: reduce the spacing to have two",
                joint.name
            )));
        }
        let points: f64 = axes.iter().map(|axis| axis.count as f64).product();
        if points > MAX_POINTS as f64 {
            let bytes = points * (BYTES_PER_POINT + size_of::<f64>() * axes.len()) as f64;
            return Err(at(format!(
                "the grid has {points:.3e} points and would need at least {:.0} GB on the disk; at most {MAX_POINTS} \
                 points are possible: widen the spacing or shorten the axes",
                bytes / 1e9
            )));
        }
        Ok(GridSpec { axes })
    }
}

/// Grid lines from the first to the second of `range`; as good as infinite where there are too many.
fn steps(range: [f64; 2], step: f64) -> usize {
    (((range[1] - range[0]) / step + GRID_STEP_SLACK).floor() as usize).saturating_add(1)
}

impl AxisTable {
    fn check(&self, spacing: Option<f64>, joint: &JointSpec) -> Result<AxisSpec, String> {
        let missing = "an axis needs start, and two of step (or spacing), stop and count";
        let start = self.start.ok_or(missing)?;
        if let Some(stop) = self.stop.filter(|&stop| stop <= start) {
            return Err(format!("the axis runs from {start} to {stop}: it must run upwards"));
        }
        let step = self.step.or(spacing);
        let axis = match (self.stop, self.count) {
            (Some(_), Some(_)) if self.step.is_some() => {
                return Err("the axis has step, stop and count: leave one of them out".into());
            }
            (Some(stop), Some(count)) => AxisSpec { start, step: (stop - start) / (count - 1) as f64, count },
            (Some(stop), None) => {
                let step = step.ok_or(missing)?;
                AxisSpec { start, step, count: steps([start, stop], step) }
            }
            (None, Some(count)) => AxisSpec { start, step: step.ok_or(missing)?, count },
            (None, None) => return Err(missing.into()),
        };
        let end = axis.start + axis.count.saturating_sub(1) as f64 * axis.step;
        let slack = GRID_STEP_SLACK * axis.step;
        let [least, greatest] = joint.limits;
        if axis.start < least - slack || end > greatest + slack {
            return Err(format!(
                "the axis runs from {start} to {end}, but joint {:?} is limited to [{least}, {greatest}]: widen the \
                 limits or shorten the axis",
                joint.name
            ));
        }
        Ok(axis)
    }
}
