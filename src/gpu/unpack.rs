//! From what the kernels wrote of one configuration to its equilibrium, in f64.
//!
//! The search in f64 leaves little to do: carriers of its touches, and sums of their forces on the object's nodes.
//!
//! Of the kernels in f32 that of the energy form, and of linearised contact, returns the forces on the object's nodes. A depth in f32 is
//! known to some nanometres, which shallow contact feels in its energy and stiff contact in its forces; worse, the
//! kernel cannot see it. So the CPU's search settles each result from these forces on, a step or two away: on the
//! smooth surface, which the kernel knows at rest only, and to a residual that owes nothing to f32. The paper's iteration is taken as it is:
//! what it leads to is defined by its steps.

use super::{
    layout::{SearchTouch, SolverResult, Touch},
    model::stiffness,
    solver::free,
    stages::Solved,
};
use crate::{
    JointMatrix, JointVector,
    contact::{
        self, Equilibrium, NodeForce, Status,
        equilibrium::energy::StoppingCriteria,
        geometry::closest_point::{ClosestPoint, Feature},
        law::depth::Carriers,
    },
    scene::Algorithm,
    tolerances::{GPU_RESOLVED_RESIDUAL, GPU_SETTLED_RESIDUAL, MINIMUM_SQUARE, SETTLING_STEPS},
};
use glam::DVec3;

/// The equilibrium at `q`, where the gap at rest is `gap`, that the search on the device `found` for the configuration
/// in this place, whose touches begin there; `None` when it wrote nothing. What it gave up for want of room, or what is
/// not finite, has overflown.
pub(super) fn solved(
    model: &contact::Model<'_>,
    solver: &mut contact::Solver<'_>,
    (q, gap): (&[f64], f64),
    found: &Solved,
    (place, start): (usize, usize),
) -> Option<Equilibrium> {
    let &[status, iterations, touches, flags] = found.records.get(place)?;
    let status = Status::from_number(u8::try_from(status).ok()?).filter(|status| *status != Status::Free)?;
    let each = found.amounts.len() / found.records.len();
    let (&[residual, energy], amounts) = found.amounts.get(each * place..each * (place + 1))?.split_first_chunk()?;
    let (torque, tangent) = amounts.split_at_checked(q.len())?;
    let mut parts = Vec::new();
    let touches = found.touches.get(start..start + touches as usize)?;
    let touches = touches.iter().map(|touch| {
        let touch = touch_of(model, touch)?;
        let pressing = touch.carriers.iter().filter(|(_, weight)| *weight != 0.0);
        parts.extend(pressing.map(|&(node, weight)| (node, -touch.force * weight)));
        Some(touch)
    });
    let touches = touches.collect::<Option<_>>()?;
    let torque = JointVector::from_slice(torque);
    let mut result = Equilibrium { status, iterations, residual, energy, torque, touches, ..free(gap, q.len()) };
    if flags & HAS_TANGENT != 0 {
        let mut matrix = JointMatrix::zeros(q.len());
        (0..q.len()).for_each(|k| (0..=k).for_each(|l| matrix.add(k, l, tangent[q.len() * k + l])));
        result.tangent = Some(matrix);
    }
    add_up(parts, &mut result);
    let is_finite = energy.is_finite() && residual.is_finite() && result.torque.is_finite();
    if !is_finite || flags & IS_DOUBTFUL != 0 && !solver.covers(q, &result) {
        result.status = Status::Overflow;
    }
    Some(result)
}

/// Bits of the last word of a record: see `shaders/search_results.wgsl`.
const HAS_TANGENT: u32 = 1;
const IS_DOUBTFUL: u32 = 2;

/// The touch that the search wrote; `None` where no facet or feature is what it wrote.
fn touch_of(model: &contact::Model<'_>, touch: &SearchTouch) -> Option<contact::Touch> {
    let point = ClosestPoint { weights: touch.weights, feature: Feature::from_number(touch.feature)? };
    if touch.facet as usize >= model.object.triangles.len() {
        return None;
    }
    let carriers = Carriers::new(model.surface.carriers(touch.facet), &point).iter().collect();
    Some(contact::Touch { proxy_node: touch.proxy_node, carriers, force: DVec3::from_array(touch.force) })
}

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
