//! `[scan]`: how a real object is haptized, and the simulated specimen in its place.

use super::super::check::Checker;
use super::super::error::SceneError;
use super::super::file::{ControlTable, LimitsTable, Number, PlanAxisTable, ScanTable, SimulatedTable, WorkspaceTable};
use super::super::{
    Cover, JointKind, PlanAxis, PlanSpec, ProxySpec, ScanControl, ScanLimits, ScanSpec, SpecimenSpec, WorkspacePlan,
};
use glam::DVec3;
use toml::Spanned;

/// Most positions along one axis of a plan.
const MOST: usize = 100_000;

pub(super) fn convert(
    checker: &Checker<'_>,
    table: &Spanned<ScanTable>,
    proxy: &ProxySpec,
) -> Result<ScanSpec, SceneError> {
    let span = table.span();
    let table = table.get_ref();
    let plan = match (&table.workspace, &table.joints) {
        (Some(plan), None) => PlanSpec::Workspace(workspace(checker, plan, proxy)?),
        (None, Some(grid)) => PlanSpec::Joints(super::grid::convert(checker, grid, &proxy.joints)?),
        _ => return Err(checker.error(span, "scan needs either [scan.workspace] or [scan.joints]")),
    };
    Ok(ScanSpec {
        plan,
        control: control(checker, &table.control, proxy)?,
        limits: limits(checker, &table.limits, proxy)?,
        simulated: simulated(checker, &table.simulated)?,
    })
}

fn workspace(checker: &Checker<'_>, table: &WorkspaceTable, proxy: &ProxySpec) -> Result<WorkspacePlan, SceneError> {
    let nodes: usize = proxy.joints.iter().map(|joint| joint.nodes.len()).sum();
    let last = nodes.saturating_sub(1);
    let node = table.node.as_ref().map_or(Ok(last), |node| checker.count("node", node, 0, last))?;
    let [first, second] = table.across.get_ref().as_slice() else {
        return Err(checker.error(table.across.span(), "across needs two axes: from line to line, slowest first"));
    };
    Ok(WorkspacePlan {
        node,
        start: checker.vector("start", Some(&table.start))?,
        across: [axis(checker, first)?, axis(checker, second)?],
        depth: axis(checker, &table.depth)?,
        clearance: optional(&table.clearance, 0.0, |value| checker.not_negative("clearance", value))?,
    })
}

fn axis(checker: &Checker<'_>, table: &PlanAxisTable) -> Result<PlanAxis, SceneError> {
    let direction = checker
        .vector("direction", Some(&table.direction))?
        .try_normalize()
        .ok_or_else(|| checker.error(table.direction.span(), "direction is zero: it must point somewhere"))?;
    let spacing = checker.positive("spacing", &table.spacing)?;
    Ok(PlanAxis { direction, spacing, count: checker.count("count", &table.count, 1, MOST)? })
}

fn control(checker: &Checker<'_>, table: &ControlTable, proxy: &ProxySpec) -> Result<ScanControl, SceneError> {
    let joints = &proxy.joints;
    let gain =
        |revolute: f64, prismatic: f64| move |kind| if kind == JointKind::Revolute { revolute } else { prismatic };
    let stiffness = checker.per_joint("stiffness", table.stiffness.as_ref(), joints, true, gain(40.0, 4000.0))?;
    let damping = checker.per_joint("damping", table.damping.as_ref(), joints, false, gain(0.3, 30.0))?;
    let positive = |key: &'static str, value: &Option<Number>, default: f64| {
        optional(value, default, |value| checker.positive(key, value))
    };
    let rate = optional(&table.rate, 1000.0, |value| checker.between("rate", value, 1.0, 1e5))?;
    let window = positive("window", &table.window, 0.1)?;
    if window * rate < 4.0 {
        let span = table.window.as_ref().map_or(0..0, Spanned::span);
        return Err(checker.error(span, "window must hold at least four ticks of the control rate"));
    }
    Ok(ScanControl {
        rate,
        stiffness,
        damping,
        speed: positive("speed", &table.speed, 0.3)?,
        window,
        still: positive("still", &table.still, 1e-3)?,
        drift: positive("drift", &table.drift, 5e-3)?,
        timeout: positive("timeout", &table.timeout, 5.0)?,
        average: positive("average", &table.average, 0.1)?,
        epsilon: optional(&table.epsilon, 0.01, |value| checker.not_negative("epsilon", value))?,
    })
}

fn limits(checker: &Checker<'_>, table: &LimitsTable, proxy: &ProxySpec) -> Result<ScanLimits, SceneError> {
    let torque = checker.per_joint("torque", table.torque.as_ref(), &proxy.joints, true, |kind| {
        if kind == JointKind::Revolute { 2.0 } else { 20.0 }
    })?;
    let [least, greatest] = table.workspace.get_ref();
    checker.all_finite("workspace", least, table.workspace.span())?;
    checker.all_finite("workspace", greatest, table.workspace.span())?;
    if least.iter().zip(greatest).any(|(least, greatest)| least >= greatest) {
        let message = "workspace must be [[least x, y, z], [greatest x, y, z]], each least below its greatest";
        return Err(checker.error(table.workspace.span(), message));
    }
    Ok(ScanLimits {
        torque,
        speed: optional(&table.speed, 3.0, |value| checker.positive("speed", value))?,
        workspace: [DVec3::from_array(*least), DVec3::from_array(*greatest)],
    })
}

fn simulated(checker: &Checker<'_>, table: &SimulatedTable) -> Result<SpecimenSpec, SceneError> {
    let size = checker.vector("size", Some(&table.size))?;
    if size.min_element() <= 0.0 {
        return Err(checker.error(table.size.span(), "size must be three positive lengths"));
    }
    let not_negative = |key: &'static str, value: &Option<Number>, default: f64| {
        optional(value, default, |value| checker.not_negative(key, value))
    };
    Ok(SpecimenSpec {
        corner: checker.vector("corner", Some(&table.corner))?,
        size,
        cover: table.cover.unwrap_or(Cover::Bare),
        friction: not_negative("friction", &table.friction, 0.4)?,
        encoder: not_negative("encoder", &table.encoder, 40_000.0)?,
        noise: not_negative("noise", &table.noise, 2e-3)?,
        joint_friction: not_negative("joint_friction", &table.joint_friction, 2e-3)?,
    })
}

fn optional(
    value: &Option<Number>,
    default: f64,
    check: impl FnOnce(&Number) -> Result<f64, SceneError>,
) -> Result<f64, SceneError> {
    value.as_ref().map_or(Ok(default), check)
}
