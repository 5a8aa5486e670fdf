//! `[device]`: how a real haptic device stands to the scene's arm.

use super::super::check::Checker;
use super::super::error::SceneError;
use super::super::file::DeviceTable;
use super::super::{DeviceSpec, ProxySpec};
use crate::{JointVector, MAX_JOINTS};
use std::ops::Range;

pub(super) fn convert(checker: &Checker<'_>, table: &DeviceTable, proxy: &ProxySpec) -> Result<DeviceSpec, SceneError> {
    let vector = |key: &str, values: &[f64], span: Range<usize>| {
        if values.is_empty() || values.len() > MAX_JOINTS {
            let message = format!("{key} has {} numbers: it needs 1 to {MAX_JOINTS}", values.len());
            return Err(checker.error(span, message));
        }
        checker.all_finite(key, values, span)?;
        Ok(JointVector::from_slice(values))
    };
    let mut spec = DeviceSpec::default();
    if let Some(map) = &table.map {
        let rows = map.get_ref();
        if let Some(row) = rows.iter().find(|row| row.len() != rows.len()) {
            let message =
                format!("map has {} rows, one of them of {} numbers: it must be square", rows.len(), row.len());
            return Err(checker.error(map.span(), message));
        }
        spec.map = Some(rows.iter().map(|row| vector("map", row, map.span())).collect::<Result<_, _>>()?);
    }
    if let Some(offset) = &table.offset {
        spec.offset = Some(vector("offset", offset.get_ref(), offset.span())?);
    }
    if let Some(limit) = &table.effort_limit {
        let limits = vector("effort_limit", limit.get_ref(), limit.span())?;
        if limits.iter().any(|most| *most < 0.0) {
            return Err(checker.error(limit.span(), "effort_limit has a negative number: it limits a size"));
        }
        spec.effort_limit = Some(limits);
    }
    if let Some(node) = &table.node {
        let nodes: usize = proxy.joints.iter().map(|joint| joint.nodes.len()).sum();
        spec.node = Some(checker.count("node", node, 0, nodes.saturating_sub(1))?);
    }
    if let Some(stiffness) = &table.stiffness {
        spec.stiffness = checker.positive("stiffness", stiffness)?;
    }
    if let Some(damping) = &table.damping {
        spec.damping = checker.not_negative("damping", damping)?;
    }
    Ok(spec)
}
