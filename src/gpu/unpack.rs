//! From what the kernels wrote of one configuration to its equilibrium, in f64.
//!
//! The search in f64 leaves little to do: carriers of its touches, and sums of their forces on the object's nodes.
//!
//! A depth in f32 is known to some nanometres, which shallow contact feels in its energy and stiff contact in its
//! forces; worse, the kernels cannot see it. So the CPU's search settles each result in f32 from its forces on, a step
//! or two away, to a residual that owes nothing to f32.

use super::{model::stiffness, precision::Precision, stages::Found};
use crate::{
    JointVector,
    contact::{
        self, Equilibrium, NodeForce, Status,
        equilibrium::energy::StoppingCriteria,
        geometry::closest_point::{ClosestPoint, Feature},
        law::depth::Carriers,
    },
    joint_matrix::{JointMatrix, add_symmetric},
};
use glam::DVec3;

/// Largest relative residual of a GPU's result that is passed on as converged, however rough the scene's tolerance (1):
/// what is promised of f32. What has more is solved in f64.
pub const GPU_RESOLVED_RESIDUAL: f64 = 1e-4;

/// Steps in f64 from a result of the f32 kernel at most (1). They converge quadratically: where f32 found an
/// equilibrium, one leads from its 1e-5 to 1e-8. Four let contacts within rounding of none come and go; what needs more
/// was not near one, and may end at another.
const SETTLING_STEPS: u32 = 4;

/// Residual of the contact forces of the energy form that is allowed after these steps unless the scene asks for less,
/// relative, in the energy norm (1): soft directions of a deep dent raise it a hundredfold in the torque, which is to
/// agree to 1e-5 with the CPU's.
pub const GPU_SETTLED_RESIDUAL: f64 = 1e-7;

/// The equilibrium at `q`, where the gap at rest is `gap`, that the kernels `found` in `precision` for the
/// configuration in this place, whose touches begin there; `None` when they wrote nothing: records are zero before,
/// which is the status of free configurations. What they gave up for want of room, or what is not finite, has
/// overflown.
pub(super) fn unpack(
    model: &contact::Model<'_>,
    solver: &mut contact::Solver<'_>,
    (q, gap): (&[f64], f64),
    found: &Found,
    (place, start): (usize, usize),
    precision: Precision,
) -> Option<Equilibrium> {
    let &[status, iterations, touches, flags] = found.records.get(place)?;
    let status = Status::from_number(u8::try_from(status).ok()?).filter(|status| *status != Status::Free)?;
    let each = found.amounts.len() / found.records.len();
    let (&[residual, energy], amounts) = found.amounts.get(each * place..each * (place + 1))?.split_first_chunk()?;
    let (torque, tangent) = amounts.split_at_checked(q.len())?;
    let torque = JointVector::from_slice(torque);
    let mut result = Equilibrium { status, iterations, residual, energy, torque, ..Equilibrium::free(gap, q.len()) };
    let mut parts = Vec::new();
    for k in start..start + touches as usize {
        let touch = touch_of(model, found, k, &mut parts)?;
        result.touches.push(touch);
    }
    if flags & HAS_TANGENT != 0 {
        let mut matrix = JointMatrix::default();
        (0..q.len()).for_each(|k| (0..=k).for_each(|l| add_symmetric(&mut matrix, k, l, tangent[q.len() * k + l])));
        result.tangent = Some(matrix);
    }
    add_up(parts, &mut result);
    if precision == Precision::Single {
        return Some(if status == Status::Contact { settled(model, solver, q, result) } else { result });
    }
    let is_finite = energy.is_finite() && residual.is_finite() && result.torque.is_finite();
    if !is_finite || flags & IS_DOUBTFUL != 0 && !solver.covers(q, &result) {
        result.status = Status::Overflow;
    }
    Some(result)
}

/// Bits of the last word of a record: see `shaders/search_results.wgsl`.
const HAS_TANGENT: u32 = 1;
const IS_DOUBTFUL: u32 = 2;

/// Touch `k` that the kernels wrote, whose forces on the object's nodes join `parts`; `None` where it is not there, or
/// no facet, feature or node is what they wrote.
fn touch_of(
    model: &contact::Model<'_>,
    found: &Found,
    k: usize,
    parts: &mut Vec<(u32, DVec3)>,
) -> Option<contact::Touch> {
    let (&[proxy_node, rest @ ..], each) = (found.touches.get(k)?, found.presses.len() / found.touches.len());
    let presses = found.presses.get(each * k..each * (k + 1))?.as_chunks::<3>().0;
    let ([facet, feature, _], &[weights, force]) = (rest, presses) else { return None };
    let point = ClosestPoint { weights, feature: Feature::from_number(feature)? };
    if facet as usize >= model.object.triangles.len() {
        return None;
    }
    let force = DVec3::from_array(force);
    let carriers: Vec<(u32, f64)> = Carriers::new(model.surface.carriers(facet), &point).iter().collect();
    let pressing = carriers.iter().filter(|(_, weight)| *weight != 0.0);
    parts.extend(pressing.map(|&(node, weight)| (node, -force * weight)));
    Some(contact::Touch { proxy_node, carriers, force })
}

/// Searches on the CPU from the forces of what was `found` in f32.
fn settled(model: &contact::Model<'_>, solver: &mut contact::Solver<'_>, q: &[f64], found: Equilibrium) -> Equilibrium {
    let tolerance = model.contact.tolerance.clamp(GPU_SETTLED_RESIDUAL, GPU_RESOLVED_RESIDUAL);
    let limits = StoppingCriteria { tolerance, iterations: SETTLING_STEPS };
    let result = solver.solve_with_guess(q, &found.forces, stiffness(model), limits);
    Equilibrium { iterations: found.iterations + result.iterations, ..result }
}

/// Forces on the object's nodes, each node once, ascending.
fn add_up(mut parts: Vec<(u32, DVec3)>, result: &mut Equilibrium) {
    parts.sort_by_key(|&(node, _)| node);
    for (node, part) in parts {
        match result.forces.last_mut() {
            Some(last) if last.node == node => last.force += part,
            _ => result.forces.push(NodeForce { node, force: part }),
        }
    }
}
