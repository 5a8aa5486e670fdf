//! Where the proxy is touched, and how hard: contact forces of the dataset, brought from the object's nodes to the
//! proxy's and interpolated like the torque.
//!
//! A dataset stores the forces f_j on the object's nodes. The proxy node that a force belongs to is taken to be the one
//! nearest to the object's node at rest, of those that press: the force on it is minus the sum of its object nodes'.
//! The forces in sum are exact; their torque J^T F differs from the dataset's by the lever arm between the contact and
//! the node that was chosen, [`Contacts::torque_error`]: friction and damping are known to no better than
//! that, while the contact torque itself stays the dataset's.
//!
//! Between grid points `F_i(q) = share sum_c w_c F_i(q_c)`, with the weights of the torque and the factor of boundary
//! layer and fade; likewise the share of the corners at which node i is touched. Both are continuous in q.

use crate::{
    JointVector,
    dataset::Dataset,
    field::stencil::{Lattice, LatticeError},
    proxy::Chain,
    tolerances::LEAST_CONTACT_FORCE,
};
use glam::DVec3;

/// Contact forces on the proxy's nodes, compressed rows over the grid points.
pub struct Contacts {
    lattice: Lattice,
    /// One more than there are grid points.
    offsets: Vec<usize>,
    nodes: Vec<u16>,
    /// [N]
    forces: Vec<[f32; 3]>,
    torque_error: f64,
}

/// What touches one proxy node.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Touch {
    /// On the proxy node [N].
    pub force: DVec3,
    /// Share of the corners at which it is touched, 0 to 1.
    pub share: f64,
}

impl Touch {
    /// Outward normal and normal force [N]; `None` where nothing touches.
    pub fn normal(&self) -> Option<(DVec3, f64)> {
        let force = self.force.length();
        (force > LEAST_CONTACT_FORCE).then(|| (self.force / force, force))
    }
}

impl Contacts {
    /// The contacts of `dataset` with `chain`; `None` where the dataset has no contact forces.
    ///
    /// # Errors
    /// When its grid is none.
    pub fn new(dataset: &Dataset, chain: &Chain) -> Result<Option<Self>, LatticeError> {
        let (Some(_), Some(surface)) = (&dataset.contacts, &dataset.surface) else { return Ok(None) };
        let lattice = Lattice::new(&dataset.grid)?;
        let rest: Vec<DVec3> = surface.nodes.chunks_exact(3).map(DVec3::from_slice).collect();
        let mut this = Self { lattice, offsets: vec![0], nodes: Vec::new(), forces: Vec::new(), torque_error: 0.0 };
        let mut on_node = vec![DVec3::ZERO; chain.nodes.len()];
        let mut pose = chain.new_pose();
        let (mut missed, mut whole) = (0.0, 0.0);
        for point in 0..dataset.grid.points() {
            chain.pose(&dataset.grid.configuration(point), &mut pose);
            on_node.fill(DVec3::ZERO);
            for contact in dataset.forces(point) {
                let Some(&place) = rest.get(contact.node as usize) else { continue };
                // Of a proxy node inside the object, the force points away from the object's node: it is pressed outwards.
                let distance = |node: usize| pose.nodes[node].distance(place) - chain.nodes[node].radius;
                let nearest = (0..chain.nodes.len()).min_by(|&a, &b| distance(a).total_cmp(&distance(b)));
                if let Some(node) = nearest {
                    on_node[node] -= contact.force;
                }
            }
            let mut torque = JointVector::zeros(dataset.grid.joints());
            for (node, &force) in on_node.iter().enumerate().filter(|(_, force)| **force != DVec3::ZERO) {
                chain.add_torque(&pose, node, force, &mut torque);
                // A scene has at most 4096 nodes.
                this.nodes.push(node as u16);
                this.forces.push(force.as_vec3().to_array());
            }
            this.offsets.push(this.nodes.len());
            for (found, stored) in torque.iter().zip(dataset.torque(point)) {
                missed += (found - stored).powi(2);
                whole += stored * stored;
            }
        }
        if whole > 0.0 {
            this.torque_error = (missed / whole).sqrt();
        }
        Ok(Some(this))
    }

    /// Root mean square of the torque that the chosen proxy nodes miss, over that of the dataset's torque [1].
    #[must_use]
    pub fn torque_error(&self) -> f64 {
        self.torque_error
    }

    /// Writes what touches each proxy node at `q` to `touches`, one entry per node, forces times `share`.
    pub(super) fn interpolate(&self, q: &[f64], share: f64, touches: &mut [Touch]) {
        touches.fill(Touch::default());
        for (point, weight) in self.lattice.locate(q).corners() {
            let scale = share * weight;
            if scale > 0.0 {
                let row = self.offsets[point]..self.offsets[point + 1];
                for (&node, force) in self.nodes[row.clone()].iter().zip(&self.forces[row]) {
                    let touch = &mut touches[node as usize];
                    touch.force += scale * DVec3::from(force.map(f64::from));
                    touch.share += scale;
                }
            }
        }
    }
}
