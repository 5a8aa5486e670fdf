//! Equilibrium of one configuration, equation (2), in f64 on the CPU.
//!
//! Prepare a [`Model`] once, give each thread a [`Solver`], and solve configuration after configuration.
//!
//! Each room uses those before it: `linear` (algebra), `geometry` (the surface), `law` (depth, springs), `detection`
//! (which proxy nodes touch), `equilibrium` (the searches), and the solver.

use crate::{JointMatrix, JointVector};
use glam::DVec3;

mod backend;
pub(crate) mod detection;
pub(crate) mod equilibrium;
pub(crate) mod geometry;
pub(crate) mod law;
pub(crate) mod linear;
mod live;
mod mesh_ripple;
mod model;
mod node_tree;
mod proximity;
pub(crate) mod reach;
pub(crate) mod reactions;
mod slip;
mod solver;
mod solvers;
mod thin_parts;

pub use backend::{Backend, CHUNKS_IN_FLIGHT, Work};
pub(crate) use equilibrium::energy::RESIDUAL_FLOOR;
pub use equilibrium::rest::Sensitivity;
pub use live::{LiveContact, LiveSolver};
pub use mesh_ripple::MeshRipple;
pub use model::{Model, MotionBound};
pub use node_tree::NodeTree;
pub use proximity::{NearestNode, Proximity};
pub use slip::{Slip, exact_dissipation};
pub use solver::Solver;
pub(crate) use solvers::{SHARE, Solvers};
pub use thin_parts::PastMiddle;

/// Least squared length, area or distance that is divided by [m^2, m^4]: far below any mesh of this world (edges over
/// 1 nm) and far above the smallest normal f64, so that a quotient stays finite.
pub(crate) const MINIMUM_SQUARE: f64 = 1e-60;

/// How the solution of one configuration ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum Status {
    /// Nothing touches: tau = 0.
    Free = 0,
    /// In contact, converged.
    Contact = 1,
    /// In contact, not converged: torque and forces are the last iterate's and are not to be trusted.
    Unconverged = 2,
    /// More contacts than the solver has room for, or contact beyond the surface whose compliance was formed.
    Overflow = 3,
    /// Not computed, or outside the measured region.
    Outside = 4,
}

impl Status {
    /// The status whose number is `number`, if there is one.
    #[must_use]
    pub fn from_number(number: u8) -> Option<Self> {
        let all = [Self::Free, Self::Contact, Self::Unconverged, Self::Overflow, Self::Outside];
        all.into_iter().nth(number.into())
    }

    /// Whether the proxy touches the object, converged or not.
    #[must_use]
    pub fn is_in_contact(self) -> bool {
        self == Self::Contact || self.is_failed()
    }

    /// Whether there is contact whose torque is not to be trusted.
    #[must_use]
    pub fn is_failed(self) -> bool {
        matches!(self, Self::Unconverged | Self::Overflow)
    }
}

/// Equilibrium of the object with the proxy at one configuration.
#[derive(Clone, Debug)]
pub struct Equilibrium {
    /// How it ended.
    pub status: Status,
    /// Steps tried (`following`), systems solved (`rest`), or passes (the paper's iteration).
    pub iterations: u32,
    /// Relative residual of the force balance, in the energy norm; with `rest` the greatest depth that the forces do
    /// not account for, over the greatest at rest; one where nothing could be computed (1). In contact so stiff that
    /// forces follow the rounding of depths it may exceed the tolerance of a converged equilibrium.
    pub residual: f64,
    /// Stored energy U: elastic and contact springs (J).
    pub energy: f64,
    /// Smallest signed distance of the proxy's nodes to the surface at rest, less their radius; negative inside (m).
    pub gap: f64,
    /// Contact torque on the proxy, tau = sum_i J_i^T (force on x_i) (N m).
    pub torque: JointVector,
    /// Tangent d tau/d q (N m/rad), where the model asks for it ([`Model::with_tangent`]), and the equilibrium is
    /// a converged, strict minimum.
    pub tangent: Option<JointMatrix>,
    /// How the arm slides on its contacts, where the model asks for it ([`Model::with_slip`]) and something touches.
    pub slip: Option<Slip>,
    /// Contact forces on the object's nodes, ascending by node, each node once (N).
    pub forces: Vec<NodeForce>,
    /// Contacts seen from the proxy.
    pub touches: Vec<Touch>,
}

impl Equilibrium {
    /// Returns the result of a configuration of `joints` joints without contact, `gap` away from it (m).
    #[must_use]
    pub fn free(gap: f64, joints: usize) -> Self {
        Self {
            status: Status::Free,
            iterations: 0,
            residual: 0.0,
            energy: 0.0,
            gap,
            torque: JointVector::zeros(joints),
            forces: Vec::new(),
            tangent: None,
            slip: None,
            touches: Vec::new(),
        }
    }

    /// No result: nothing is known to be balanced.
    pub(crate) fn unknown(joints: usize) -> Self {
        Self { status: Status::Unconverged, residual: 1.0, ..Self::free(0.0, joints) }
    }

    /// Whether every number is finite.
    pub(crate) fn is_finite(&self) -> bool {
        let carried = |touch: &Touch| touch.carriers.iter().all(|(_, weight)| weight.is_finite());
        self.energy.is_finite()
            && self.residual.is_finite()
            && self.torque.is_finite()
            && self.forces.iter().all(|force| force.force.is_finite())
            && self.touches.iter().all(|touch| touch.force.is_finite() && carried(touch))
    }

    /// Returns the nodes of the proxy that are touched, ascending, and the force on each (N).
    pub fn on_proxy(&self) -> impl Iterator<Item = (u32, DVec3)> {
        self.touches.iter().map(|touch| (touch.proxy_node, touch.force))
    }
}

/// Contact force f_j on one node of the object.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct NodeForce {
    /// Number of the object's node.
    pub node: u32,
    /// (N)
    pub force: DVec3,
}

/// One proxy node in contact with one feature of the surface: pushed by `force` at x_i, pushing back on the object's
/// nodes.
///
/// A node of the proxy has at most one.
#[derive(Clone, Debug)]
pub struct Touch {
    /// Number of the proxy's node.
    pub proxy_node: u32,
    /// The object's nodes of the touched facet, and the share of the reaction that each carries, in sum one: the three
    /// corners of a flat facet, or the nodes on which a smooth one depends: its corners and all their neighbours.
    pub carriers: Vec<(u32, f64)>,
    /// Force on the proxy node (N). With `rest` its part along the surface has no reaction: the object is pushed back
    /// along the normal.
    pub force: DVec3,
}
