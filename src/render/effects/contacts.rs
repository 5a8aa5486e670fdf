//! Where the proxy is touched, and how hard: contact forces on the proxy's nodes, interpolated between grid points like
//! the torque, or solved where the proxy is.
//!
//! Between grid points `F_i(q) = share sum_c w_c F_i(q_c)`, with the weights of the torque and the factor of boundary
//! layer and fade; likewise the share of the corners at which node i is touched. Both are continuous in q.
//!
//! A store of nodes at several levels keeps no forces. Over it the forces of the equilibrium solved at the proxy, times
//! the same factor, take their place ([`crate::render::live`]).

use crate::{
    contact::NodeForce,
    dataset::Dataset,
    field::stencil::{Lattice, LatticeError},
};
use glam::DVec3;

/// Least force that counts as a contact when friction or damping acts on it [N]: far below what is felt, and large
/// enough that a normal is known to rounding.
const LEAST_CONTACT_FORCE: f64 = 1e-9;

/// Contact forces on the proxy's nodes.
pub enum Contacts {
    /// At the grid points.
    Stored(Box<Rows>),
    /// Solved at the proxy.
    Solved,
}

/// Contact forces on the proxy's nodes, compressed rows over the grid points.
pub struct Rows {
    lattice: Lattice,
    /// One more than there are grid points.
    offsets: Vec<usize>,
    nodes: Vec<u16>,
    /// [N]
    forces: Vec<[f32; 3]>,
}

/// The contact of one proxy node.
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
    /// The contacts of `dataset` with a proxy of `nodes` nodes; `None` where the dataset does not hold them, or holds
    /// those of another proxy.
    ///
    /// # Errors
    /// When its grid is none.
    pub fn new(dataset: &Dataset, nodes: usize) -> Result<Option<Self>, LatticeError> {
        let Some(touches) = &dataset.touches else { return Ok(None) };
        let known = |node: &u32| u16::try_from(*node).ok().filter(|&node| usize::from(node) < nodes);
        let Some(nodes) = touches.nodes.iter().map(known).collect() else { return Ok(None) };
        Ok(Some(Self::Stored(Box::new(Rows {
            lattice: Lattice::new(&dataset.grid)?,
            offsets: touches.offsets.iter().map(|&offset| offset as usize).collect(),
            nodes,
            forces: touches.forces.as_chunks().0.to_vec(),
        }))))
    }

    /// Writes what touches each proxy node at `q` to `touches`, one entry per node, forces times `share`. `solved` are
    /// those at the proxy.
    pub(super) fn at(&self, q: &[f64], share: f64, solved: &[NodeForce], touches: &mut [Touch]) {
        touches.fill(Touch::default());
        match self {
            Self::Stored(rows) => rows.interpolate(q, share, touches),
            Self::Solved if share > 0.0 => {
                for &NodeForce { node, force } in solved {
                    if let Some(touch) = touches.get_mut(node as usize) {
                        *touch = Touch { force: share * force, share };
                    }
                }
            }
            Self::Solved => {}
        }
    }
}

impl Rows {
    fn interpolate(&self, q: &[f64], share: f64, touches: &mut [Touch]) {
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
