//! Effects on the proxy that need to know where it is touched: contact friction and contact damping (beyond the paper).
//!
//! They are built for scenes that name one of them, and for no others there is neither a contact list nor a pass over
//! it.

mod contacts;
mod friction;

pub use contacts::Contacts;
pub use friction::Friction;

use super::{
    accounts::Extra,
    npmi::{Load, MidpointInertia, Motion, Npmi, Step},
};
use crate::{
    JointMatrix, JointVector, MAX_JOINTS,
    contact::NodeForce,
    dataset::Dataset,
    proxy::Chain,
    scene::{Diagnostic, HapticsSpec},
};
use contacts::Touch;
use glam::DVec3;
use std::path::Path;

/// The effects of a scene that act at contacts.
pub struct ContactEffects {
    chain: Chain,
    contacts: Contacts,
    friction: Option<Friction>,
    /// c (N s/m); zero where the scene names no contact damping.
    damping: f64,
}

/// A step of the proxy that is about to be made.
pub(super) struct Pending<'a> {
    /// Who makes it.
    pub npmi: &'a Npmi,
    /// Inertia in its middle.
    pub stage: &'a MidpointInertia,
    /// T (s).
    pub interval: f64,
    /// Forces beside those of the effects.
    pub load: Load,
    /// The factor that the field puts on contact torque and forces; zero out of contact (1).
    pub share: f64,
    /// Contact forces that were solved at the proxy, where they are solved live (N).
    pub solved: &'a [NodeForce],
}

/// State of the effects, and their work space.
#[derive(Clone, Debug, PartialEq)]
pub struct EffectState {
    /// Force of each proxy node's contacts and share of them, one per node.
    touches: Vec<Touch>,
    /// Proxy nodes in contact.
    patches: Vec<Patch>,
    /// One per proxy node.
    bristles: Vec<Bristle>,
}

/// State of the friction at a proxy node.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Bristle {
    /// In the world (m).
    deflection: DVec3,
    /// Whether it slipped in the last step.
    slipped: bool,
}

/// A proxy node in contact.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Patch {
    node: usize,
    /// Outwards of the object.
    normal: DVec3,
    /// Normal force (N).
    pressure: f64,
    /// Share of the contact, 0 to 1.
    share: f64,
    /// J_i.
    columns: [DVec3; MAX_JOINTS],
    /// Deflection of the bristle, tangential (m).
    bristle: DVec3,
    /// Whether it slipped in the last step.
    slipped: bool,
    mode: friction::Mode,
}

/// An effect that the scene names cannot act.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum EffectError {
    /// The dataset lacks what it needs.
    #[error(transparent)]
    Cannot(#[from] Diagnostic),
}

impl ContactEffects {
    /// The effects of `spec` over `dataset`, felt by `chain`; `None` where the scene names none. Where contact is solved
    /// `live` they act by its forces. `text` and `path` are the scene's, for messages.
    ///
    /// # Errors
    /// When the dataset lacks the contact forces.
    pub fn new(
        spec: &HapticsSpec,
        (dataset, live): (&Dataset, bool),
        chain: &Chain,
        text: &str,
        path: &Path,
    ) -> Result<Option<Self>, EffectError> {
        let Some(name) = spec.at_contacts() else { return Ok(None) };
        let contacts = if live { Some(Contacts::Solved) } else { Contacts::new(dataset, chain.nodes.len()) };
        let contacts = contacts.ok_or_else(|| {
            let remedy = if dataset.refinement.is_some() {
                "play or view the scene itself, which solves them while they are felt, or bake its grid without --refine"
            } else {
                "bake a virtual object again with this scene; for a real object, which tells no contact forces, leave \
                 it out"
            };
            let message =
                format!("{name} needs the contact forces on this proxy, which the dataset does not hold: {remedy}");
            Diagnostic::at(path, text, &format!("haptics.{name}"), message)
        })?;
        Ok(Some(Self {
            chain: chain.clone(),
            contacts,
            friction: spec.friction.as_ref().map(Friction::new),
            damping: spec.contact_damping.unwrap_or(0.0),
        }))
    }

    /// Untouched. Allocates what all later ticks need.
    #[must_use]
    pub fn start(&self) -> EffectState {
        let nodes = self.chain.nodes.len();
        EffectState {
            touches: vec![Touch::default(); nodes],
            patches: Vec::with_capacity(nodes),
            bristles: vec![Bristle::default(); nodes],
        }
    }

    /// The `pending` step of the proxy with the effects. Books into `extra`. Never allocates.
    pub(super) fn step(
        &self,
        mut pending: Pending<'_>,
        state: &mut EffectState,
        motion: &mut Motion,
        extra: &mut Extra,
    ) -> Step {
        self.touch(state, &motion.position, &pending);
        let damping = self.contact_damping(&state.patches);
        add(&mut pending.load.damping, 1.0, &damping);
        let step = match &self.friction {
            Some(friction) => friction.step(&pending, state, motion, extra),
            None => pending.npmi.advance(pending.stage, motion, pending.interval, &pending.load),
        };
        extra.contact_dissipation = pending.interval * quadratic(&damping, &step.velocity);
        step
    }

    /// Finds the proxy nodes in contact at `position`.
    fn touch(&self, state: &mut EffectState, position: &JointVector, pending: &Pending<'_>) {
        state.patches.clear();
        self.contacts.at(position, pending.share, pending.solved, &mut state.touches);
        let mut links = None;
        for (node, touch) in state.touches.iter().enumerate() {
            let Some((normal, pressure)) = touch.normal() else { continue };
            let links = links.get_or_insert_with(|| self.chain.links(position));
            let columns = self.chain.node_jacobian(links, node, self.chain.node_position(links, node));
            let Bristle { deflection, slipped } = state.bristles[node];
            let bristle = deflection.reject_from_normalized(normal);
            let (share, mode) = (touch.share, friction::Mode::Stick);
            state.patches.push(Patch { node, normal, pressure, share, columns, bristle, slipped, mode });
        }
    }

    /// `sum_i c share_i J_i^T N N^T J_i` (N m s/rad).
    fn contact_damping(&self, patches: &[Patch]) -> JointMatrix {
        let mut damping = [[0.0; MAX_JOINTS]; MAX_JOINTS];
        if self.damping > 0.0 {
            for patch in patches {
                let along = patch.columns.map(|column| column.dot(patch.normal));
                for (row, a) in damping.iter_mut().zip(along) {
                    for (entry, b) in row.iter_mut().zip(along) {
                        *entry += self.damping * patch.share * a * b;
                    }
                }
            }
        }
        damping
    }
}

impl EffectState {
    /// Untouched again.
    pub(super) fn release(&mut self) {
        self.patches.clear();
        self.bristles.fill(Bristle::default());
    }
}

impl Patch {
    /// Tangential way for joint rates `velocity` over `interval` (m).
    fn slide(&self, velocity: &JointVector, interval: f64) -> DVec3 {
        let way: DVec3 = self.columns.iter().zip(velocity.iter()).map(|(column, v)| interval * v * *column).sum();
        way.reject_from_normalized(self.normal)
    }
}

/// `matrix += factor other`.
fn add(matrix: &mut JointMatrix, factor: f64, other: &JointMatrix) {
    for (entry, other) in matrix.iter_mut().flatten().zip(other.iter().flatten()) {
        *entry += factor * other;
    }
}

/// v^T A v.
fn quadratic(matrix: &JointMatrix, v: &JointVector) -> f64 {
    matrix.iter().zip(v.iter()).map(|(row, a)| a * v.dot(row)).sum()
}
