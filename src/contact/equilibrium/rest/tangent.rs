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
//! All is in closed form but H_i, which is a difference of the gradients a_i on both sides of the node, [`STEP`] away.

use super::RestProgram;
use crate::MAX_JOINTS;
use crate::contact::detection::Detection;
use crate::contact::geometry::smooth::CARRIERS;
use crate::contact::law::depth::Variation;
use crate::contact::law::springs::{Springs, stretched_and_bent};
use crate::contact::linear::{cholesky, support::dot};
use crate::contact::model::Model;
use crate::joint_matrix::{JointMatrix, add_symmetric};
use crate::proxy::Pose;
use crate::scene::JointKind;
use glam::{DMat3, DVec3};

/// Step of the differences of the depth's gradient, over the mean edge (1). The gradient bends over an edge, or over
/// the distance to where the closest point leaps: a hundredth of an edge before that point the differences leave 1e-6
/// of the second derivative. The rounding of the gradient, 1e-15, leaves its share of this: 1e-10.
const STEP: f64 = 1e-5;

impl RestProgram {
    /// Returns the tangent at the solution that was found last, of the configuration that `detection` has taken up,
    /// with the proxy in `pose` (N m/rad).
    pub fn tangent(&self, model: &Model, detection: &mut Detection, pose: &Pose) -> JointMatrix {
        let Self { support, rows, slots, compliance, .. } = self;
        let joints = model.chain.joints.len();
        let springs = Springs { contacts: rows, slots, kc: model.kc };
        let pushing: Vec<usize> = (0..rows.len()).filter(|i| rows[*i].multiplier > 0.0).collect();
        self.displace(model, detection);
        let mut tangent = JointMatrix::default();
        let mut loads = vec![vec![0.0; support.order()]; joints];
        // P, row by row.
        let mut deepening = vec![[0.0; MAX_JOINTS]; pushing.len()];
        for (&i, deepening) in pushing.iter().zip(&mut deepening) {
            let (row, force) = (&rows[i], self.force(i));
            let node = row.proxy_node as usize;
            let columns: Vec<DVec3> = (0..joints).map(|k| model.chain.jacobian_column(pose, node, k)).collect();
            let bend = bend(model, detection, node);
            for k in 0..joints {
                let reaction = stretched_and_bent(row, 0.0, &Variation::translation(-columns[k]));
                springs.add_reaction(i, &reaction, &mut loads[k]);
                deepening[k] = -force.dot(columns[k]) / row.multiplier;
                for l in 0..=k {
                    let turn = match model.chain.joints[l].kind {
                        JointKind::Revolute => pose.axes[l].cross(columns[k]),
                        JointKind::Prismatic => DVec3::ZERO,
                    };
                    let bent = columns[l].dot(bend * columns[k]);
                    add_symmetric(&mut tangent, k, l, force.dot(turn) - row.multiplier * bent);
                }
            }
        }
        let mut moved = vec![0.0; support.order()];
        for k in 0..joints {
            support.multiply(&loads[k], &mut moved);
            (0..=k).for_each(|l| add_symmetric(&mut tangent, k, l, dot(&loads[l], &moved)));
            for (&i, deepening) in pushing.iter().zip(&mut deepening) {
                deepening[k] -= springs.depth_change(i, &moved);
            }
        }
        let row = |i: usize| pushing.iter().map(move |j| compliance[i * rows.len() + j]);
        let mut factor: Vec<f64> = pushing.iter().flat_map(|i| row(*i)).collect();
        cholesky::factorize(&mut factor, pushing.len());
        let mut answers = deepening.clone();
        cholesky::solve(&factor, &mut answers);
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
