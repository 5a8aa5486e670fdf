//! How the torque of contact with the surface at rest depends on the object and on the contact's stiffness.
//!
//! `tau = -dU/dq`, and U changes with the compliance C by `-1/2 l . dC l`, l = G^T lambda being the load (envelope
//! theorem). Differentiated by q, with P and dl as in [`super::tangent`],
//! `d tau_k = m_k . dC l`, `m_k = dl_k + G^T S^-1 P_k`: the same systems that the tangent solves, whatever changes C. The
//! compliance 1/kc of the contacts adds `(S^-1 P_k)_i lambda_i` for a change of its own.

use super::RestProgram;
use super::tangent::Moved;
use crate::JointVector;
use crate::contact::model::Model;
use crate::proxy::Pose;

/// The derivative of an equilibrium's torque by whatever changes the object's compliance.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Sensitivity {
    /// Nodes of the surface that the vectors below are on, three numbers each.
    pub nodes: Vec<u32>,
    /// The load l (N).
    pub load: Vec<f64>,
    /// m of each joint (N/rad).
    pub adjoints: Vec<Vec<f64>>,
    /// C l, by which the nodes are pushed in (m).
    pub response: Vec<f64>,
    /// d tau / d ln kc (N m).
    pub by_contact: JointVector,
}

impl Sensitivity {
    /// Returns d tau / d ln E of an object all of whose stiffness grows with E, so that dC = -C (N m).
    #[must_use]
    pub fn by_modulus(&self) -> JointVector {
        let by: Vec<f64> = self
            .adjoints
            .iter()
            .map(|adjoint| -adjoint.iter().zip(&self.response).map(|(m, u)| m * u).sum::<f64>())
            .collect();
        JointVector::from_slice(&by)
    }
}

impl RestProgram {
    /// Returns the sensitivity of the solution that was found last, with the proxy in `pose`.
    pub fn sensitivity(&mut self, model: &Model, pose: &Pose) -> Sensitivity {
        let Self { rows, .. } = &*self;
        let Moved { pushing, loads: mut adjoints, answers, .. } = self.moved(model, pose);
        let mut by_contact = JointVector::zeros(adjoints.len());
        for (&i, answers) in pushing.iter().zip(&answers) {
            let row = &rows[i];
            for (k, (adjoint, answer)) in adjoints.iter_mut().zip(answers).enumerate() {
                self.add_load(i, *answer, adjoint);
                by_contact[k] -= answer * row.multiplier / (model.kc * row.share);
            }
        }
        let Self { support, forces, blended, .. } = self;
        if let Some(blended) = blended {
            let on_nodes = |adjoint: &mut Vec<f64>| blended.spread(&std::mem::take(adjoint), support, adjoint);
            adjoints.iter_mut().for_each(on_nodes);
            support.gather(&model.compliance);
        }
        // The forces on the object's nodes are minus the load.
        let load: Vec<f64> = forces.iter().map(|force| -force).collect();
        let mut response = vec![0.0; load.len()];
        support.multiply(&load, &mut response);
        Sensitivity { nodes: support.nodes().to_vec(), load, adjoints, response, by_contact }
    }
}
