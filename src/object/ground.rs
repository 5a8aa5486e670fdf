//! Which nodes the ground springs Kg hold, and whether they hold every part of the object.

use super::ObjectError;
use crate::scene::{GroundNodes, GroundSpec};
use glam::DVec3;

/// Per node: is it grounded?
pub(super) fn select(ground: &GroundSpec, nodes: &[DVec3]) -> Result<Vec<bool>, ObjectError> {
    match &ground.nodes {
        GroundNodes::All => Ok(vec![true; nodes.len()]),
        GroundNodes::Listed(list) => {
            let mut grounded = vec![false; nodes.len()];
            for &node in list {
                let slot = grounded.get_mut(node as usize);
                *slot.ok_or(ObjectError::GroundNode { node, count: nodes.len() })? = true;
            }
            Ok(grounded)
        }
        GroundNodes::Below(height) => {
            let grounded: Vec<bool> = nodes.iter().map(|n| n.z < *height).collect();
            if !grounded.contains(&true) {
                let lowest = nodes.iter().map(|n| n.z).fold(f64::INFINITY, f64::min);
                return Err(ObjectError::NothingBelow { height: *height, lowest });
            }
            Ok(grounded)
        }
    }
}

/// Refuses an object of which a connected part has no grounded node. `components`: nodes of each part; `grounded`: per
/// node, empty where there is no ground.
pub(super) fn check_components(components: &[Vec<u32>], grounded: &[bool]) -> Result<(), ObjectError> {
    for part in components {
        if !part.iter().any(|&node| grounded.get(node as usize) == Some(&true)) {
            return Err(ObjectError::Ungrounded { node: part[0], nodes: part.len() });
        }
    }
    Ok(())
}
