//! `[[proxy.joint]]`: the chain, link by link.

use super::super::check::Checker;
use super::super::error::SceneError;
use super::super::file::{JointTable, NodesTable, Number, ProxyTable};
use super::super::inertia::positive_semidefinite;
use super::super::{GRID_LINE, JointKind, JointSpec, MAX_CONTACT_NODES, ProxyNodeSpec, ProxySpec};
use crate::MAX_JOINTS;
use glam::DMat3;
use toml::Spanned;

/// Default reflected inertia of the actuator of a revolute joint, that of a desktop device (kg m^2).
const ROTOR_INERTIA: f64 = 1e-3;
/// The same of a prismatic joint (kg).
const ROTOR_MASS: f64 = 0.05;
/// Longest name, in characters, that still fits a figure's legend.
const MAX_NAME: usize = 40;

pub(super) fn convert(checker: &Checker<'_>, table: &ProxyTable) -> Result<ProxySpec, SceneError> {
    let tables = table.joint.get_ref();
    if tables.is_empty() || tables.len() > MAX_JOINTS {
        let message = format!("the proxy has {} joints: it must have 1 to {MAX_JOINTS}", tables.len());
        return Err(checker.error(table.joint.span(), message));
    }
    let mut joints: Vec<JointSpec> = Vec::new();
    for table in tables {
        let spec = joint(checker, table, joints.len())?;
        if joints.iter().any(|earlier| earlier.name == spec.name) {
            let span = table.name.as_ref().map_or(table.axis.span(), Spanned::span);
            return Err(checker.error(span, format!("two joints are called {:?}: give each its own name", spec.name)));
        }
        joints.push(spec);
    }
    let nodes: usize = joints.iter().map(|joint| joint.nodes.len()).sum();
    if nodes == 0 {
        return Err(checker.error(table.joint.span(), "no link has contact nodes: give one of the joints a nodes list"));
    }
    if nodes > MAX_CONTACT_NODES {
        let message = format!("the proxy has {nodes} contact nodes: it may have at most {MAX_CONTACT_NODES}");
        return Err(checker.error(table.joint.span(), message));
    }
    Ok(ProxySpec { joints })
}

fn joint(checker: &Checker<'_>, table: &JointTable, index: usize) -> Result<JointSpec, SceneError> {
    let axis = checker
        .vector("axis", Some(&table.axis))?
        .try_normalize()
        .ok_or_else(|| checker.error(table.axis.span(), "axis is zero: it must have a direction"))?;
    let limits = *table.limits.get_ref();
    checker.all_finite("limits", &limits, table.limits.span())?;
    if limits[0] >= limits[1] {
        let message = format!("limits are [{}, {}]: the first must be less than the second", limits[0], limits[1]);
        return Err(checker.error(table.limits.span(), message));
    }
    let rotor_inertia = table.rotor_inertia.as_ref().map(|value| checker.positive("rotor_inertia", value));
    let default_rotor_inertia = match table.kind {
        JointKind::Revolute => ROTOR_INERTIA,
        JointKind::Prismatic => ROTOR_MASS,
    };
    let mut nodes = Vec::new();
    for table in &table.nodes {
        add_nodes(checker, table, &mut nodes)?;
    }
    Ok(JointSpec {
        name: name(checker, table.name.as_ref(), index)?,
        kind: table.kind,
        origin: checker.vector("origin", table.origin.as_ref())?,
        axis,
        limits,
        mass: table.mass.as_ref().map_or(Ok(0.0), |value| checker.not_negative("mass", value))?,
        centre_of_mass: checker.vector("centre_of_mass", table.centre_of_mass.as_ref())?,
        inertia: table.inertia.as_ref().map_or(Ok(DMat3::ZERO), |value| inertia(checker, value))?,
        rotor_inertia: rotor_inertia.unwrap_or(Ok(default_rotor_inertia))?,
        nodes,
    })
}

/// Moments, or moments and products, of inertia as a matrix (kg m^2).
fn inertia(checker: &Checker<'_>, value: &Spanned<Vec<f64>>) -> Result<DMat3, SceneError> {
    let numbers = value.get_ref();
    checker.all_finite("inertia", numbers, value.span())?;
    let (moments, products) = match numbers[..] {
        [xx, yy, zz] => ([xx, yy, zz], [0.0; 3]),
        [xx, yy, zz, xy, xz, yz] => ([xx, yy, zz], [xy, xz, yz]),
        _ => {
            let message = format!(
                "inertia has {} numbers: it is a list of three moments [xx, yy, zz], or of moments and products [xx, \
                 yy, zz, xy, xz, yz]",
                numbers.len()
            );
            return Err(checker.error(value.span(), message));
        }
    };
    let [[xx, yy, zz], [xy, xz, yz]] = [moments, products];
    let message = "no body has this inertia, since its matrix has a negative eigenvalue: moments are zero or \
                   positive, and products of inertia are no larger than those moments allow";
    positive_semidefinite(DMat3::from_cols_array(&[xx, xy, xz, xy, yy, yz, xz, yz, zz]))
        .ok_or_else(|| checker.error(value.span(), message))
}

/// Names become columns of tables and legends of figures.
fn name(checker: &Checker<'_>, name: Option<&Spanned<String>>, index: usize) -> Result<String, SceneError> {
    let Some(name) = name else { return Ok(format!("q{}", index + 1)) };
    let fits = |c: char| c.is_alphanumeric() || matches!(c, ' ' | '_' | '-');
    let text = name.get_ref();
    if text.trim().is_empty() || text.chars().count() > MAX_NAME || !text.chars().all(fits) {
        let message = format!("name must be 1 to {MAX_NAME} letters, digits, spaces, _ or -");
        return Err(checker.error(name.span(), message));
    }
    Ok(text.clone())
}

fn add_nodes(
    checker: &Checker<'_>,
    table: &Spanned<NodesTable>,
    nodes: &mut Vec<ProxyNodeSpec>,
) -> Result<(), SceneError> {
    let span = table.span();
    let table = table.get_ref();
    let radius = table.radius.as_ref().map_or(Ok(0.0), |value| checker.not_negative("radius", value))?;
    match (&table.at, &table.from, &table.to, &table.count, &table.spacing) {
        (Some(at), None, None, None, None) => {
            nodes.push(ProxyNodeSpec { position: checker.vector("at", Some(at))?, radius, length: 0.0 });
        }
        (None, Some(from), Some(to), count, spacing) if count.is_some() != spacing.is_some() => {
            let (from, to) = (checker.vector("from", Some(from))?, checker.vector("to", Some(to))?);
            let intervals = match (count, spacing) {
                (Some(count), _) => checker.count("count", count, 2, MAX_CONTACT_NODES)? - 1,
                (None, Some(spacing)) => intervals(checker, spacing, from.distance(to))?,
                (None, None) => 1,
            };
            let step = from.distance(to) / intervals as f64;
            nodes.extend((0..=intervals).map(|k| ProxyNodeSpec {
                position: from.lerp(to, k as f64 / intervals as f64),
                radius,
                // The trapezoidal rule.
                length: if k == 0 || k == intervals { 0.5 * step } else { step },
            }));
        }
        _ => {
            let message = "nodes need either { at = [x, y, z] } or { from = [x, y, z], to = [x, y, z] } with one of \
                           count = n and spacing = s, and may have a radius";
            return Err(checker.error(span, message));
        }
    }
    Ok(())
}

/// Number of equal parts, each at most `spacing` long, of a line of `length` (m).
fn intervals(checker: &Checker<'_>, spacing: &Number, length: f64) -> Result<usize, SceneError> {
    let parts = (length / checker.positive("spacing", spacing)? - GRID_LINE).ceil().max(1.0);
    if parts >= MAX_CONTACT_NODES as f64 {
        let message =
            format!("spacing makes {parts:.0} parts of a line: a chain may have at most {MAX_CONTACT_NODES} nodes");
        return Err(checker.error(spacing.span(), message));
    }
    Ok(parts as usize)
}
