//! The object itself with its whole history: what the one number a term of `relaxation.rs` stands for.
//!
//! A synchronous material obeys `K u = f + sum g_i K z_i`, `z_i' = (u - z_i) / theta_i`, with a displacement z_i of each
//! node for each term. Without contact its surface stands at `s = sum g_i z_i`, and contact is solved before that
//! surface, `u = s + C f`. With `y_i = K z_i` and `h = sum g_i y_i` it stores, beside `f . C f / 2` and the springs of
//! contact, `(sum g_i z_i . y_i - s . h) / 2`. A reference, for figures and tests: the loop has no time for it.

use super::object_memory::ObjectMemory;
use crate::{
    contact::{LiveSolver, Model},
    scene::RelaxationSpec,
};
use glam::DVec3;

/// History of the object of one session.
pub(super) struct ObjectHistory {
    /// z_i, and C f (m).
    displacements: ObjectMemory,
    displacement: Vec<DVec3>,
    /// y_i, and f (N).
    forces: ObjectMemory,
    force: Vec<DVec3>,
}

impl ObjectHistory {
    /// None yet, of the object of `model` in ticks every `period` (s).
    pub fn new(spec: &RelaxationSpec, period: f64, model: &Model<'_>) -> Self {
        let nodes = model.surface.positions.len();
        let [displacements, forces] = [(); 2].map(|()| ObjectMemory::new(spec, period, nodes));
        let zero = vec![DVec3::ZERO; nodes];
        Self { displacements, displacement: zero.clone(), forces, force: zero }
    }

    /// Displacement s of the surface without contact (m).
    pub fn standing(&mut self) -> &[DVec3] {
        self.displacements.past()
    }

    /// Lets a tick under the contact that `solver` has solved go by. Returns what the past stores beside it (J).
    pub fn pass(&mut self, model: &Model<'_>, solver: &LiveSolver<'_>) -> f64 {
        let compliance = &model.compliance;
        self.displacement.fill(DVec3::ZERO);
        self.force.fill(DVec3::ZERO);
        for on in solver.on_object() {
            let Some(place) = compliance.place(on.node) else { continue };
            self.force[on.node as usize] = on.force;
            for (other, &node) in compliance.nodes.iter().enumerate() {
                self.displacement[node as usize] += compliance.block(other, place) * on.force;
            }
        }
        let stored = self.displacements.stored(&mut self.forces);
        self.displacements.frame(&self.displacement);
        self.forces.frame(&self.force);
        stored
    }
}
