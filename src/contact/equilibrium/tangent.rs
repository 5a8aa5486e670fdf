//! The tangent d tau/d q of the contact torque at an equilibrium.
//!
//! The equilibrium u(q) minimises E(u; q), so that U(q) = E(u(q); q), tau = -dU/dq, and by implicit differentiation
//! `d tau/d q = -(E_qq - E_qu E_uu^-1 E_uq)`: minus the Hessian of U, symmetric. E_uu = K + B is what a Newton step is
//! made with, B being the Hessian of the contact springs.
//!
//! A depth depends on the difference of its proxy node and the surface alone. To move the proxy node by J_i dq is
//! therefore to move the nodes of its contact by v = -J_i dq, and B gives the other derivatives as well: E_uq dq = B v,
//! and `dq . E_qq dq' = v . B v' - lambda_i N_i . x_i''(dq, dq')`, with the second derivative of the forward kinematics
//! `d^2 x_i / dq_k dq_l = a_k x J_il` for k <= l where joint k is revolute, and zero where it is prismatic.

use super::newton::Newton;
use crate::contact::law::depth::Variation;
use crate::contact::law::springs::Springs;
use crate::contact::linear::support::{Support, dot};
use crate::contact::model::Model;
use crate::joint_matrix::{JointMatrix, add_symmetric};
use crate::proxy::Pose;
use glam::DVec3;

/// Relative residual of the linear solves behind a tangent d tau/d q (1): the tangent errs by its square, relative to
/// the response, below the 6e-8 to which f32 stores it.
pub const RESPONSE_TOLERANCE: f64 = 1e-4;

/// The tangent at the equilibrium that `springs` and `support` describe, multipliers being the forces of the contacts,
/// with the proxy in `pose`; `None` where the equilibrium is no strict minimum, so that there is no derivative
/// (N m/rad).
pub(super) fn tangent(
    model: &Model,
    pose: &Pose,
    springs: Springs,
    support: &Support,
    newton: &mut Newton,
) -> Option<JointMatrix> {
    let joints = model.chain.joints.len();
    let order = support.order();
    let mut tangent = JointMatrix::default();
    // E_uq, column by column.
    let mut loads = vec![vec![0.0; order]; joints];
    for (row, contact) in springs.contacts.iter().enumerate().filter(|(_, contact)| contact.is_active()) {
        let node = contact.proxy_node as usize;
        let columns: Vec<DVec3> = (0..joints).map(|k| model.chain.jacobian_column(pose, node, k)).collect();
        let force = contact.normal * contact.multiplier;
        for (k, column) in columns.iter().enumerate() {
            let reaction = springs.resist(row, true, &Variation::translation(-*column)).unwrap_or_default();
            springs.add_reaction(row, &reaction, &mut loads[k]);
            for (l, other) in columns.iter().enumerate().take(k + 1) {
                let turn = model.chain.node_curvature(pose, node, [k, l]);
                add_symmetric(&mut tangent, k, l, reaction.point.dot(*other) + force.dot(turn));
            }
        }
    }
    newton.factorise(support, springs);
    let mut responses: Vec<Vec<f64>> = Vec::with_capacity(joints);
    for k in 0..joints {
        let (moved, residual) = newton.respond(support, springs, &loads[k], RESPONSE_TOLERANCE)?;
        responses.push(moved.to_vec());
        for (l, (load, response)) in loads.iter().zip(&responses).enumerate() {
            // What the residual adds makes the error a product of those of both responses.
            add_symmetric(&mut tangent, k, l, dot(load, moved) + dot(response, residual));
        }
    }
    Some(tangent)
}

#[cfg(test)]
mod tests {
    use crate::contact::{Model, Solver, Status};
    use crate::joint_matrix::lower;
    use crate::object::Object;
    use crate::proxy::Chain;
    use crate::scene::Scene;

    /// Two revolute joints and a slide press points of both links into a sphere.
    const SCENE: &str = r#"
        [object]
        sphere = { radius = 0.05, rings = 9, segments = 10 }
        springs = { kind = "isotropic", stiffness = 300.0 }
        ground = { stiffness = 100.0 }
        [contact]
        stiffness_per_length = 1.8e5
        tolerance = 1e-11
        [[proxy.joint]]
        kind = "revolute"
        axis = [0.0, 1.0, 0.0]
        limits = [-4.0, 4.0]
        nodes = [{ from = [-0.004, 0.003, 0.049], to = [0.006, 0.003, 0.048], count = 3 }]
        [[proxy.joint]]
        kind = "revolute"
        origin = [0.0, 0.0, 0.07]
        axis = [0.6, 0.0, 0.8]
        limits = [-4.0, 4.0]
        [[proxy.joint]]
        kind = "prismatic"
        axis = [0.0, 0.0, -1.0]
        limits = [-0.1, 0.1]
        nodes = [{ from = [0.01, -0.01, -0.02], to = [0.012, 0.01, -0.022], count = 4 }]
    "#;

    /// Step of central differences of the torque (rad or m): small beside the facets, large beside what the solver
    /// leaves of 1e-11.
    const STEP: f64 = 1e-7;

    #[test]
    fn the_tangent_is_the_derivative_of_the_torque_and_symmetric() {
        check(SCENE, 100);
        check(&SCENE.replace("[contact]", "[contact]\n        surface = \"smooth\""), 60);
        // The second joint is where it was, but follows the first.
        let follows =
            "limits = [-4.0, 4.0]\n        follows = { joint = \"q1\", multiplier = -1.6666, offset = 0.1166 }\n";
        let (before, after) = SCENE.rsplit_once("limits = [-4.0, 4.0]\n").unwrap();
        check(&format!("{before}{follows}{after}"), 40);
    }

    /// Compares the tangents of a scene with differences; at least `count` of them.
    fn check(text: &str, count: usize) {
        let scene = Scene::parse(text, "tangent.toml").unwrap();
        let object = Object::build(&scene.object).unwrap();
        let chain = Chain::new(&scene.proxy);
        let mut model = Model::new(&object, &chain, scene.contact);
        model.with_tangent = true;
        let mut solver = Solver::new(&model);
        let (mut checked, mut contacts) = (0, 0);
        for turn in 0..5 {
            for depth in 0..5 {
                let mut q =
                    vec![0.03 * f64::from(turn) - 0.05, 0.2 - 0.05 * f64::from(turn), 0.0021 * f64::from(depth)];
                if chain.joints.len() < 3 {
                    q.remove(1);
                }
                let here = solver.solve(&q);
                if here.status != Status::Contact {
                    assert!(here.tangent.is_none());
                    continue;
                }
                let tangent = here.tangent.unwrap();
                let pressing = |solver: &mut Solver<'_>, l: usize, step: f64| {
                    let mut moved = q.clone();
                    moved[l] += step;
                    solver.solve(&moved)
                };
                let size = lower(&tangent, q.len()).fold(0.0_f64, |size, entry| size.max(entry.abs()));
                for l in 0..q.len() {
                    let (after, before) = (pressing(&mut solver, l, STEP), pressing(&mut solver, l, -STEP));
                    // At a kink, where contacts come and go or a closest feature changes, there is no derivative.
                    let touched = |e: &crate::contact::Equilibrium| {
                        e.touches
                            .iter()
                            .map(|t| {
                                let carrying = t.carriers.iter().filter(|(_, weight)| *weight != 0.0);
                                (t.proxy_node, carrying.map(|(node, _)| *node).collect::<Vec<_>>())
                            })
                            .collect::<Vec<_>>()
                    };
                    if touched(&after) != touched(&before) {
                        continue;
                    }
                    for k in 0..q.len() {
                        // The potential's own gradient: tau = -dU/dq.
                        let force = (before.energy - after.energy) / (2.0 * STEP);
                        assert!((force - here.torque[l]).abs() < 1e-5 * size, "{q:?} {l}: {force} {:?}", here.torque);
                        let slope = (after.torque[k] - before.torque[k]) / (2.0 * STEP);
                        assert!((slope - tangent[k][l]).abs() < 1e-4 * size, "{q:?} {k} {l}: {slope} {tangent:?}");
                        assert_eq!(tangent[k][l], tangent[l][k]);
                        checked += 1;
                    }
                }
                contacts = contacts.max(here.touches.len());
            }
        }
        assert!(checked > count && contacts > 3, "{checked} {contacts}");
    }
}
