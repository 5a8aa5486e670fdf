//! The tangent d tau/d q of contact with the surface at rest.
//!
//! With L(lambda, q) the function whose greatest value is U, and the rows that push, `d tau/d q = -(L_qq + P^T S^-1 P)`.
//! Moving the joints by dq moves node i by J_i dq, and changes the load on the object by `dl = sum_i lambda_i dg_i`, so
//! that
//! - `P dq` is how the depths change that are left under the same forces: `a_i . J_i dq - g_i . C dl`, a_i = grad D_i +
//!   grad g_i . u;
//! - `dq . L_qq dq' = sum_i lambda_i ( J_i dq . H_i J_i dq' + a_i . x_i''(dq, dq') ) - dl . C dl'`, H_i the second
//!   derivative of the depth of node i before the displaced surface, u held.
//!
//! All is in closed form but H_i before a surface that is not rounded, which is a difference of the gradients a_i on both
//! sides of the node, [`STEP`] away.

use super::RestProgram;
use crate::MAX_JOINTS;
use crate::contact::detection::Detection;
use crate::contact::geometry::smooth::CARRIERS;
use crate::contact::linear::{cholesky, support::dot};
use crate::contact::model::Model;
use crate::joint_matrix::{JointMatrix, add_symmetric};
use crate::proxy::Pose;
use glam::{DMat3, DVec3};

/// Step of the differences of the depth's gradient, over the mean edge (1). The gradient bends over an edge, or over
/// the distance to where the closest point leaps: a hundredth of an edge before that point the differences leave 1e-6
/// of the second derivative. The rounding of the gradient, 1e-15, leaves its share of this: 1e-10.
const STEP: f64 = 1e-5;

/// How the program changes when the joints move under the same forces.
pub(super) struct Moved {
    /// Rows that push.
    pub pushing: Vec<usize>,
    /// dl of each joint on the support (N/rad).
    pub loads: Vec<Vec<f64>>,
    /// C dl of each joint (m/rad).
    pub responses: Vec<Vec<f64>>,
    /// P, row by row (m/rad).
    pub deepening: Vec<[f64; MAX_JOINTS]>,
    /// S^-1 P (N/rad).
    pub answers: Vec<[f64; MAX_JOINTS]>,
}

impl RestProgram {
    /// Returns how the solution that was found last changes with the joints of the proxy in `pose`.
    pub(super) fn moved(&self, model: &Model, pose: &Pose) -> Moved {
        let Self { rows, compliance, .. } = self;
        let joints = model.chain.joints.len();
        let pushing: Vec<usize> = (0..rows.len()).filter(|i| rows[*i].multiplier > 0.0).collect();
        let mut loads = vec![vec![0.0; self.order()]; joints];
        let mut deepening = vec![[0.0; MAX_JOINTS]; pushing.len()];
        for (&i, deepening) in pushing.iter().zip(&mut deepening) {
            let (row, force) = (&rows[i], self.force(i));
            for (k, load) in loads.iter_mut().enumerate() {
                let column = model.chain.jacobian_column(pose, row.proxy_node as usize, k);
                self.add_turn(i, column, load);
                deepening[k] = -force.dot(column) / row.multiplier;
            }
        }
        let respond = |load: &Vec<f64>| {
            let mut response = vec![0.0; load.len()];
            self.respond(load, &mut response);
            response
        };
        let responses: Vec<Vec<f64>> = loads.iter().map(respond).collect();
        for (&i, deepening) in pushing.iter().zip(&mut deepening) {
            for (deepening, response) in deepening.iter_mut().zip(&responses) {
                *deepening -= self.depth_change(i, response);
            }
        }
        let row = |i: usize| pushing.iter().map(move |j| compliance[i * rows.len() + j]);
        let mut factor: Vec<f64> = pushing.iter().flat_map(|i| row(*i)).collect();
        cholesky::factorize(&mut factor, pushing.len());
        let mut answers = deepening.clone();
        cholesky::solve(&factor, &mut answers);
        Moved { pushing, loads, responses, deepening, answers }
    }

    /// Returns the tangent at the solution that was found last, of the configuration that `detection` has taken up,
    /// with the proxy in `pose` (N m/rad).
    pub fn tangent(&self, model: &Model, detection: &mut Detection, pose: &Pose) -> JointMatrix {
        let joints = model.chain.joints.len();
        let Moved { pushing, loads, responses, deepening, answers } = self.moved(model, pose);
        if self.blended.is_none() {
            self.displace(model, detection);
        }
        let mut tangent = JointMatrix::default();
        for &i in &pushing {
            let (row, force) = (&self.rows[i], self.force(i));
            let node = row.proxy_node as usize;
            let columns: Vec<DVec3> = (0..joints).map(|k| model.chain.jacobian_column(pose, node, k)).collect();
            let bend = match &self.blended {
                None => bend(model, detection, node),
                Some(blended) => blended.bend(i, |node| self.stands(node)),
            };
            for k in 0..joints {
                for l in 0..=k {
                    let turn = model.chain.node_curvature(pose, node, [k, l]);
                    let bent = columns[l].dot(bend * columns[k]);
                    add_symmetric(&mut tangent, k, l, force.dot(turn) - row.multiplier * bent);
                }
            }
        }
        for (k, response) in responses.iter().enumerate() {
            (0..=k).for_each(|l| add_symmetric(&mut tangent, k, l, dot(&loads[l], response)));
        }
        for (deepening, answer) in deepening.iter().zip(&answers) {
            for (k, answer) in answer.iter().enumerate().take(joints) {
                (0..=k).for_each(|l| add_symmetric(&mut tangent, k, l, -deepening[l] * answer));
            }
        }
        tangent
    }
}

/// Second derivative of the depth of proxy node `node` in its place before the surface that `detection` has displaced,
/// the displacement held (1/m).
fn bend(model: &Model, detection: &mut Detection, node: usize) -> DMat3 {
    let step = STEP * model.surface.mean_edge;
    let x = detection.nodes()[node];
    let mut pushed = |x: DVec3| {
        let Some(row) = detection.near_at_rest(model, node, x) else { return DVec3::ZERO };
        let mut moved = [DVec3::ZERO; CARRIERS];
        moved.iter_mut().zip(row.carriers.nodes()).for_each(|(u, node)| *u = detection.displacement(model, *node));
        row.pushed(|j| moved[j])
    };
    let slope = |along: DVec3| (pushed(x - along * step) - pushed(x + along * step)) / (2.0 * step);
    let bend = DMat3::from_cols_array_2d(&DVec3::AXES.map(slope).map(|column| column.to_array()));
    0.5 * (bend + bend.transpose())
}
