//! Where the proxy is touched, and how hard: contact forces on the proxy's nodes, interpolated between grid points like
//! the torque, or solved where the proxy is.
//!
//! Between grid points `F_i(q) = share sum_c w_c F_i(q_c)`, with the weights of the torque and the factor of boundary
//! layer and fade; likewise the share of the corners at which node i is touched. Both are continuous in q.
//!
//! A scene that is solved live ([`crate::render::live`]) has those of the equilibrium at the proxy, times the same
//! factor.

use crate::{contact::NodeForce, dataset::Dataset, render::force_rows::ForceRows};
use glam::DVec3;

/// Least force that counts as a contact when friction or damping acts on it (N): far below what is felt, and large
/// enough that a normal is known to rounding.
const LEAST_CONTACT_FORCE: f64 = 1e-9;

/// Contact forces on the proxy's nodes.
pub enum Contacts {
    /// At the grid points.
    Stored(Box<ForceRows>),
    /// Solved at the proxy.
    Solved,
}

/// The contact of one proxy node.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Touch {
    /// On the proxy node (N).
    pub force: DVec3,
    /// Share of the corners at which it is touched, 0 to 1.
    pub share: f64,
}

impl Touch {
    /// Outward normal and normal force (N); `None` where nothing touches.
    pub fn normal(&self) -> Option<(DVec3, f64)> {
        let force = self.force.length();
        (force > LEAST_CONTACT_FORCE).then(|| (self.force / force, force))
    }
}

impl Contacts {
    /// The contacts of `dataset` with a proxy of `nodes` nodes; `None` where the dataset does not hold them, or holds
    /// those of another proxy.
    pub fn new(dataset: &Dataset, nodes: usize) -> Option<Self> {
        let rows = ForceRows::new(&dataset.grid, dataset.touches.as_ref()?, nodes)?;
        Some(Self::Stored(Box::new(rows)))
    }

    /// Writes what touches each proxy node at `q` to `touches`, one entry per node, forces times `share`. `solved` are
    /// those at the proxy.
    pub(super) fn at(&self, q: &[f64], share: f64, solved: &[NodeForce], touches: &mut [Touch]) {
        touches.fill(Touch::default());
        match self {
            Self::Stored(rows) => rows.at(q, share, |node, scale, force| {
                let touch = &mut touches[node];
                touch.force += scale * force;
                touch.share += scale;
            }),
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
