//! From what the kernel wrote of one configuration to its equilibrium.

use super::{device::record_length, model::gap_band};
use crate::{
    JointVector,
    contact::{
        self, Equilibrium, NodeForce, Slip, Status, Touch,
        geometry::closest_point::{ClosestPoint, Feature},
        law::depth::Carriers,
    },
    joint_matrix::{JointMatrix, add_symmetric},
};
use glam::DVec3;

/// Greatest depth that the forces of a result do not account for, over the greatest at rest (1): a slack is a sum of
/// as many products as there are rows, each rounded by 6e-8 of numbers that may be some ten times their sum.
pub const GPU_RESIDUAL: f64 = 1e-4;

/// The equilibrium at `q` by the kernel's `record` and the touches of its section. `None` where f32 or the kernel's
/// room leaves it open: contact within rounding of none, too many rows, forces that do not balance the depths, numbers
/// that are not finite, or nodes that the compliance may not cover.
pub(super) fn unpack(
    model: &contact::Model<'_>,
    q: &JointVector,
    record: &[u32],
    touches: &[[u32; 12]],
) -> Option<Equilibrium> {
    let &[status, iterations, count, first, gap, energy, residual] = record.first_chunk()?;
    let [gap, energy, residual] = [gap, energy, residual].map(number);
    let status = Status::from_number(u8::try_from(status).ok()?)?;
    let (joints, links) = (q.len(), model.chain.links.len());
    if gap.is_nan() || gap.abs() <= gap_band(model) {
        return None;
    }
    match status {
        Status::Free => return Some(Equilibrium::free(gap, joints)),
        Status::Contact if residual <= GPU_RESIDUAL && energy.is_finite() => {}
        _ => return None,
    }
    let numbers: Vec<f64> =
        record.get(7..record_length(links, model.with_tangent))?.iter().map(|it| number(*it)).collect();
    // The kernel's joints are all links.
    let (torque, tangent) = numbers.split_at_checked(links)?;
    let torque = model.chain.joint_torque(torque);
    let mut equilibrium =
        Equilibrium { status, iterations, residual, energy, torque, ..Equilibrium::free(gap, joints) };
    if model.with_tangent {
        let mut matrix = JointMatrix::default();
        let places = (0..links).flat_map(|k| (0..=k).map(move |l| (k, l)));
        places.zip(tangent).for_each(|((k, l), entry)| add_symmetric(&mut matrix, k, l, *entry));
        equilibrium.tangent = Some(model.chain.joint_matrix(&matrix));
    }
    let mut parts = Vec::new();
    for words in touches.get(first as usize..)?.get(..count as usize)? {
        equilibrium.touches.push(touch(model, words, &mut parts)?);
    }
    equilibrium.touches.sort_by_key(|touch| touch.proxy_node);
    equilibrium.slip = model.with_slip.then(|| Slip::of(model.chain, q, equilibrium.on_proxy()));
    add_up(parts, &mut equilibrium);
    numbers.iter().all(|number| number.is_finite()).then_some(equilibrium)
}

/// The number with these bits.
fn number(bits: u32) -> f64 {
    f32::from_bits(bits).into()
}

/// A touch by its words, whose forces on the object's nodes join `parts`; `None` where they name no facet or feature.
fn touch(model: &contact::Model<'_>, words: &[u32; 12], parts: &mut Vec<(u32, DVec3)>) -> Option<Touch> {
    let &[proxy_node, facet, feature, ref numbers @ ..] = words;
    let &[push, first, second, x, y, a, b, c, z] = &numbers.map(number);
    if facet as usize >= model.object.triangles.len() || proxy_node as usize >= model.chain.nodes.len() {
        return None;
    }
    let point =
        ClosestPoint { weights: [first, second, 1.0 - first - second], feature: Feature::from_number(feature)? };
    let carriers: Vec<(u32, f64)> = Carriers::new(model.surface.carriers(facet), &point).iter().collect();
    let pushed_back = DVec3::new(x, y, z) * -push;
    let pressing = carriers.iter().filter(|(_, weight)| *weight != 0.0);
    parts.extend(pressing.map(|&(node, weight)| (node, pushed_back * weight)));
    Some(Touch { proxy_node, carriers, force: DVec3::new(a, b, c) })
}

/// Forces on the object's nodes, each node once, ascending.
fn add_up(mut parts: Vec<(u32, DVec3)>, equilibrium: &mut Equilibrium) {
    parts.sort_by_key(|&(node, _)| node);
    for (node, part) in parts {
        match equilibrium.forces.last_mut() {
            Some(last) if last.node == node => last.force += part,
            _ => equilibrium.forces.push(NodeForce { node, force: part }),
        }
    }
}
