//! `[grid]`: the uniform grid over C-space.
//!
//! Without `axes`, every joint's range between its limits is cut into steps of `spacing`. An axis gives its start and
//! two of step (default: `spacing`), stop and count.

use super::super::check::Checker;
use super::super::error::SceneError;
use super::super::file::{AxisTable, GridTable};
use super::super::{AxisSpec, GRID_STEP_SLACK, GridSpec, JointSpec};
use toml::Spanned;

/// Most grid points: `point * joints + joint` then fits 32 bits, as GPU kernels count.
const MAX_POINTS: usize = 1 << 28;
/// Disk of one point beside its torques: energy, gap, status, residual, iterations, contact offset (B).
const BYTES_PER_POINT: usize = 8 + 4 + 1 + 4 + 4 + 8;

pub(super) fn convert(
    checker: &Checker<'_>,
    table: &Spanned<GridTable>,
    joints: &[JointSpec],
) -> Result<GridSpec, SceneError> {
    let span = table.span();
    let table = table.get_ref();
    let spacing = table.spacing.as_ref().map(|value| checker.positive("spacing", value)).transpose()?;
    let axes: Vec<AxisSpec> = match (&table.axes, spacing) {
        (None, None) => {
            let message = "the grid has no resolution: give spacing, or axes with start, step and count";
            return Err(checker.error(span, message));
        }
        (None, Some(step)) => {
            let axis = |joint: &JointSpec| AxisSpec { start: joint.limits[0], step, count: steps(joint.limits, step) };
            joints.iter().map(axis).collect()
        }
        (Some(axes), _) => {
            if axes.get_ref().len() != joints.len() {
                let message = format!("the grid has {} axes for {} joints", axes.get_ref().len(), joints.len());
                return Err(checker.error(axes.span(), message));
            }
            let pairs = axes.get_ref().iter().zip(joints);
            pairs.map(|(axis, joint)| convert_axis(checker, axis, spacing, joint)).collect::<Result<_, _>>()?
        }
    };
    if let Some((_, joint)) = axes.iter().zip(joints).find(|(axis, _)| axis.count < 2) {
        let message = format!("the grid has a single point along {:?}: reduce the spacing to have two", joint.name);
        return Err(checker.error(span, message));
    }
    check_size(checker, &axes, span)?;
    Ok(GridSpec { axes })
}

/// Grid lines from the first to the second of `range`; as good as infinite where there are too many.
fn steps(range: [f64; 2], step: f64) -> usize {
    (((range[1] - range[0]) / step + GRID_STEP_SLACK).floor() as usize).saturating_add(1)
}

fn convert_axis(
    checker: &Checker<'_>,
    table: &Spanned<AxisTable>,
    spacing: Option<f64>,
    joint: &JointSpec,
) -> Result<AxisSpec, SceneError> {
    let span = table.span();
    let table = table.get_ref();
    let missing = || checker.error(span.clone(), "an axis needs start, and two of step (or spacing), stop and count");
    let start = checker.finite("start", table.start.as_ref().ok_or_else(missing)?)?;
    let stop = table.stop.as_ref().map(|value| checker.finite("stop", value)).transpose()?;
    let step = table.step.as_ref().map(|value| checker.positive("step", value)).transpose()?;
    let count = table.count.as_ref().map(|value| checker.count("count", value, 2, MAX_POINTS)).transpose()?;
    if let Some(stop) = stop.filter(|&stop| stop <= start) {
        return Err(checker.error(span, format!("the axis runs from {start} to {stop}: it must run upwards")));
    }
    let axis = match (stop, step, count) {
        (Some(_), Some(_), Some(_)) => {
            return Err(checker.error(span, "the axis has step, stop and count: leave one of them out"));
        }
        (Some(stop), None, Some(count)) => AxisSpec { start, step: (stop - start) / (count - 1) as f64, count },
        (Some(stop), step, None) => {
            let step = step.or(spacing).ok_or_else(missing)?;
            AxisSpec { start, step, count: steps([start, stop], step) }
        }
        (None, step, Some(count)) => AxisSpec { start, step: step.or(spacing).ok_or_else(missing)?, count },
        (None, _, None) => return Err(missing()),
    };
    let end = axis.start + axis.count.saturating_sub(1) as f64 * axis.step;
    let slack = GRID_STEP_SLACK * axis.step;
    let [least, greatest] = joint.limits;
    if axis.start < least - slack || end > greatest + slack {
        let message = format!(
            "the axis runs from {start} to {end}, but joint {:?} is limited to [{least}, {greatest}]: widen the \
             limits or shorten the axis",
            joint.name
        );
        return Err(checker.error(span, message));
    }
    Ok(axis)
}

fn check_size(checker: &Checker<'_>, axes: &[AxisSpec], span: std::ops::Range<usize>) -> Result<(), SceneError> {
    let points: f64 = axes.iter().map(|axis| axis.count as f64).product();
    if points <= MAX_POINTS as f64 {
        return Ok(());
    }
    let bytes = points * (BYTES_PER_POINT + size_of::<f64>() * axes.len()) as f64;
    let message = format!(
        "the grid has {points:.3e} points and would need at least {:.0} GB on the disk; at most {MAX_POINTS} points \
         are possible: widen the spacing or shorten the axes",
        bytes / 1e9
    );
    Err(checker.error(span, message))
}
