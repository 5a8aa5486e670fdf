//! From what the kernels wrote to equilibria: torque tau = sum_i J_i^T (force on x_i) and node forces, in f64.

use super::{
    context::GpuError,
    kernel::POISON,
    layout::{Outcome, Touch},
    refinement::Refinement,
    solver::free,
};
use crate::{
    JointVector,
    contact::{self, Equilibrium, NodeForce, Status, energy::Limits},
    proxy::Pose,
    scene::Algorithm,
    tolerances::{GPU_REFINED_RESIDUAL, MINIMUM_SQUARE, REFINEMENT_PASSES},
};
use glam::DVec3;
use rayon::prelude::*;

/// Equilibria of the configurations `chunk[member]`; their gaps are left at zero, but between blended facets, where they are
/// found anew. `touches` holds `contacts` entries a member.
///
/// # Errors
/// When a result was never written.
pub(super) fn unpack(
    model: &contact::Model<'_>,
    contacts: usize,
    chunk: &[JointVector],
    members: &[u32],
    outcomes: &[Outcome],
    touches: &[Touch],
) -> Result<Vec<Equilibrium>, GpuError> {
    let lists = touches.par_chunks_exact(contacts);
    let results = (members.par_iter(), outcomes, lists).into_par_iter();
    let unpacked: Vec<Option<Equilibrium>> = if model.blending > 0.0 || !model.compliance.is_whole() {
        results
            .map_init(
                || contact::Solver::new(model),
                |solver, (&member, outcome, list)| settled(solver, &chunk[member as usize], outcome, list),
            )
            .collect()
    } else {
        results
            .map_init(
                || (model.chain.new_pose(), Refinement::new(model)),
                |(pose, refinement), (&member, outcome, list)| {
                    equilibrium(model, &chunk[member as usize], pose, refinement, outcome, list)
                },
            )
            .collect()
    };
    let total = unpacked.len();
    let written: Vec<Equilibrium> = unpacked.into_iter().flatten().collect();
    if written.len() < total {
        return Err(GpuError::NeverWritten { count: total - written.len(), total });
    }
    Ok(written)
}

/// As a number that no kernel writes.
const UNWRITTEN: u32 = u32::from_ne_bytes([POISON; 4]);

/// What the kernel wrote of touches; `None` when it did not write them.
fn written<'a>(outcome: &Outcome, list: &'a [Touch]) -> Option<&'a [Touch]> {
    let list = list.get(..outcome.touches as usize)?;
    list.iter().all(|touch| touch.proxy_node != UNWRITTEN).then_some(list)
}

/// One equilibrium between blended facets, or with a part of the compliance, whose limits the CPU keeps an eye on: the kernel
/// tells the forces on the object's nodes, near which the CPU's search finds it. `None` when the kernel did not write it.
fn settled(solver: &mut contact::Solver<'_>, q: &[f64], outcome: &Outcome, list: &[Touch]) -> Option<Equilibrium> {
    let status = Status::from_number(u8::try_from(outcome.status).ok()?)?;
    if status != Status::Contact {
        return Some(Equilibrium { status, residual: 1.0, ..free(0.0, q.len()) });
    }
    let nodes = |touch: &Touch| touch.nodes.into_iter().zip([touch.force_0, touch.force_1, touch.force_2]);
    let forces: Vec<NodeForce> = written(outcome, list)?
        .iter()
        .flat_map(nodes)
        .filter(|(node, force)| *node != contact::support::ABSENT && *force != [0.0; 3])
        .map(|(node, force)| NodeForce { node, force: DVec3::from(force.map(f64::from)) })
        .collect();
    let limits = Limits { tolerance: GPU_REFINED_RESIDUAL, iterations: REFINEMENT_PASSES as u32 };
    let result = solver.settle(q, &forces, limits);
    Some(Equilibrium { iterations: outcome.iterations + result.iterations, ..result })
}

/// One equilibrium; `None` when the kernel did not write it.
fn equilibrium(
    model: &contact::Model<'_>,
    q: &[f64],
    pose: &mut Pose,
    refinement: &mut Refinement,
    outcome: &Outcome,
    list: &[Touch],
) -> Option<Equilibrium> {
    let status = Status::from_number(u8::try_from(outcome.status).ok()?)?;
    let mut result = free(0.0, model.chain.joints.len());
    result.status = status;
    result.iterations = outcome.iterations;
    result.residual = f64::from(outcome.residual);
    if status == Status::Overflow {
        return Some(result);
    }
    result.energy = f64::from(outcome.elastic);
    model.chain.pose(q, pose);
    let list = written(outcome, list)?;
    let mut parts = Vec::new();
    if model.contact.algorithm == Algorithm::Energy && status == Status::Contact {
        // Without a result in f64 nothing is known to be balanced.
        let refined = refinement.find(model, pose, list);
        (result.energy, result.residual) = refined.map_or((0.0, 1.0), |refined| (refined.energy, refined.residual));
        for touch in refinement.touches() {
            model.chain.add_torque(pose, touch.proxy_node as usize, touch.force, &mut result.torque);
            let shares = touch.nodes.into_iter().zip(touch.weights).map(|(node, w)| (node, touch.force * -w));
            parts.extend(shares.filter(|(_, part)| *part != DVec3::ZERO));
            result.touches.push(touch);
        }
        add_up(parts, &mut result);
        return Some(result);
    }
    for touch in list {
        let forces = [touch.force_0, touch.force_1, touch.force_2].map(|f| DVec3::from(f.map(f64::from)));
        let force = -(forces[0] + forces[1] + forces[2]);
        if force == DVec3::ZERO {
            continue;
        }
        // Of a force spread by weights these are the weights; of the paper's three forces, their shares along the whole.
        let square = force.length_squared().max(MINIMUM_SQUARE);
        let weights = forces.map(|part| -part.dot(force) / square);
        // A contact spring kc at the contact point, or the paper's three springs Kc, stretched to these forces.
        result.energy += match model.contact.algorithm {
            Algorithm::Energy | Algorithm::Linearised => square / (2.0 * model.kc),
            Algorithm::Paper => {
                forces.iter().map(|part| part.length_squared()).sum::<f64>() / (2.0 * model.contact.stiffness)
            }
        };
        model.chain.add_torque(pose, touch.proxy_node as usize, force, &mut result.torque);
        result.touches.push(contact::Touch { proxy_node: touch.proxy_node, nodes: touch.nodes, weights, force });
        parts.extend(touch.nodes.into_iter().zip(forces).filter(|(_, part)| *part != DVec3::ZERO));
    }
    // The kernel lists contacts in the order of their first touch.
    result.touches.sort_by_key(|touch| touch.proxy_node);
    add_up(parts, &mut result);
    Some(result)
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
