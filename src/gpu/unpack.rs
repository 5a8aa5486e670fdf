//! From what the kernels wrote of one configuration to its equilibrium, in f64.
//!
//! Of the energy form, and of linearised contact, the kernel returns the forces on the object's nodes. A depth in f32 is
//! known to some nanometres, which shallow contact feels in its energy and stiff contact in its forces; worse, the
//! kernel cannot see it. So the CPU's search settles each result from these forces on, a step or two away: on the
//! smooth surface, which the kernel knows at rest only, and to a residual that owes nothing to f32. The paper's iteration is taken as it is:
//! what it leads to is defined by its steps.

use super::{
    layout::{SolverResult, Touch},
    model::stiffness,
    solver::free,
};
use crate::{
    contact::{self, Equilibrium, NodeForce, Status, equilibrium::energy::StoppingCriteria},
    scene::Algorithm,
    tolerances::{GPU_RESOLVED_RESIDUAL, GPU_SETTLED_RESIDUAL, MINIMUM_SQUARE, SETTLING_STEPS},
};
use glam::DVec3;

/// The equilibrium at `q` by what the kernel wrote; `None` when it wrote nothing: outcomes are zero before, which is
/// the status of free configurations, and no kernel is given these. Of the paper's iteration the gap is left at zero,
/// and what the kernel gave up is left to the CPU but for its status.
pub(super) fn unpack(
    model: &contact::Model<'_>,
    solver: &mut contact::Solver<'_>,
    q: &[f64],
    outcome: &SolverResult,
    list: &[Touch],
) -> Option<Equilibrium> {
    let status = Status::from_number(u8::try_from(outcome.status).ok()?)?;
    if status == Status::Free {
        return None;
    }
    if status == Status::Overflow || status == Status::Unconverged && model.contact.algorithm != Algorithm::Paper {
        return Some(Equilibrium { status, iterations: outcome.iterations, residual: 1.0, ..free(0.0, q.len()) });
    }
    let list = list.get(..outcome.touches as usize)?;
    Some(match model.contact.algorithm {
        Algorithm::Paper => iterated(model, q, status, outcome, list),
        Algorithm::Energy | Algorithm::Linearised => settled(model, solver, q, outcome, list),
    })
}

/// Searches on the CPU from the kernel's forces.
fn settled(
    model: &contact::Model<'_>,
    solver: &mut contact::Solver<'_>,
    q: &[f64],
    outcome: &SolverResult,
    list: &[Touch],
) -> Equilibrium {
    let nodes = |touch: &Touch| touch.nodes.into_iter().zip([touch.force_0, touch.force_1, touch.force_2]);
    let forces: Vec<NodeForce> = list
        .iter()
        .flat_map(nodes)
        .filter(|(node, force)| *node != contact::linear::support::ABSENT && *force != [0.0; 3])
        .map(|(node, force)| NodeForce { node, force: DVec3::from(force.map(f64::from)) })
        .collect();
    let tolerance = model.contact.tolerance.clamp(GPU_SETTLED_RESIDUAL, GPU_RESOLVED_RESIDUAL);
    let limits = StoppingCriteria { tolerance, iterations: SETTLING_STEPS };
    let result = solver.solve_with_guess(q, &forces, stiffness(model), limits);
    Equilibrium { iterations: outcome.iterations + result.iterations, ..result }
}

/// Result of the paper's iteration: torque tau = sum_i J_i^T (force on x_i), energy and node forces summed up in
/// f64.
fn iterated(
    model: &contact::Model<'_>,
    q: &[f64],
    status: Status,
    outcome: &SolverResult,
    list: &[Touch],
) -> Equilibrium {
    let mut pose = model.chain.new_pose();
    model.chain.pose(q, &mut pose);
    let mut result = Equilibrium {
        status,
        iterations: outcome.iterations,
        residual: f64::from(outcome.residual),
        energy: f64::from(outcome.elastic),
        ..free(0.0, q.len())
    };
    let mut parts = Vec::new();
    for touch in list {
        let forces = [touch.force_0, touch.force_1, touch.force_2].map(|f| DVec3::from(f.map(f64::from)));
        let force = -(forces[0] + forces[1] + forces[2]);
        if force == DVec3::ZERO {
            continue;
        }
        // Their shares along the whole.
        let square = force.length_squared().max(MINIMUM_SQUARE);
        let weights = forces.map(|part| -part.dot(force) / square);
        // Three springs Kc, stretched to these forces.
        let squares: f64 = forces.iter().map(|part| part.length_squared()).sum();
        result.energy += squares / (2.0 * model.contact.stiffness);
        model.chain.add_torque(&pose, touch.proxy_node as usize, force, &mut result.torque);
        let carriers = touch.nodes.into_iter().zip(weights).collect();
        result.touches.push(contact::Touch { proxy_node: touch.proxy_node, carriers, force });
        parts.extend(touch.nodes.into_iter().zip(forces).filter(|(_, part)| *part != DVec3::ZERO));
    }
    // The kernel lists contacts in the order of their first touch.
    result.touches.sort_by_key(|touch| touch.proxy_node);
    add_up(parts, &mut result);
    result
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
