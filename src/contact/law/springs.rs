//! The contact springs on the support: their forces, and products with the Hessian of their energy.

use super::depth::{Contact, Variation};
use crate::contact::geometry::smooth::CARRIERS;
use crate::contact::linear::support::Support;
use glam::DVec3;

/// The slots of a row's nodes on the support, by their place; nodes without weight have any.
pub type Slots = [u32; CARRIERS];

/// Rows of the contact problem, where their nodes are on the support, and their stiffness.
#[derive(Clone, Copy)]
pub struct Springs<'a> {
    /// Contacts and near misses.
    pub contacts: &'a [Contact],
    /// Slots of each row's nodes.
    pub slots: &'a [Slots],
    /// kc (N/m).
    pub kc: f64,
}

impl<'a> Springs<'a> {
    /// Returns the reaction with which row `k` resists the variation `v`: the Hessian of its energy, with its
    /// multiplier as it is (N). `None` if it is zero because the row is neither `active` nor bent.
    #[must_use]
    pub fn resist(self, k: usize, active: bool, v: &Variation) -> Option<Variation> {
        let row = &self.contacts[k];
        let push = if active { self.kc * row.share * row.depth_change(v) } else { 0.0 };
        (push != 0.0 || row.multiplier != 0.0).then(|| stretched_and_bent(row, push, v))
    }

    /// Returns how the displacement `vector` on the support varies row `k`.
    #[inline]
    #[must_use]
    pub fn variation(self, k: usize, vector: &[f64]) -> Variation {
        let (nodes, slots) = (vector.as_chunks::<3>().0, &self.slots[k]);
        self.contacts[k].variation(|j| DVec3::from_array(nodes[slots[j] as usize]))
    }

    /// Returns by how much the displacement `vector` on the support deepens row `k`, to first order (m).
    #[inline]
    #[must_use]
    pub fn depth_change(self, k: usize, vector: &[f64]) -> f64 {
        let (nodes, slots, row) = (vector.as_chunks::<3>().0, &self.slots[k], &self.contacts[k]);
        row.normal.dot(row.moved(|j| DVec3::from_array(nodes[slots[j] as usize])))
    }

    /// Sets `response` to how the support moves under a force of one newton along row `k`, C g_k as
    /// [`Support::respond_along`] has it, and `deepened` to by how much that deepens each of the rows `others` (m/N).
    pub fn respond(
        self,
        support: &Support,
        (k, others): (usize, impl Iterator<Item = usize>),
        response: &mut [f64],
        deepened: &mut [f64],
    ) {
        let normal = self.contacts[k].normal;
        support.respond_along(normal, self.carrying(k), response);
        for (deepened, other) in deepened.iter_mut().zip(others) {
            *deepened = if support.response_width() == 1 {
                let along = self.carrying(other).map(|(slot, weight)| weight * response[slot]).sum::<f64>();
                normal.dot(self.contacts[other].normal) * along
            } else {
                self.depth_change(other, response)
            };
        }
    }

    /// The slots of a row's nodes on the support, with their weights.
    fn carrying(self, k: usize) -> impl Iterator<Item = (usize, f64)> + Clone + 'a {
        let slots = self.slots[k].iter().map(|&slot| slot as usize);
        slots.zip(self.contacts[k].carriers.weights().iter().copied())
    }

    /// Adds a reaction of row `k` to the forces `vector` on the support.
    #[inline]
    pub fn add_reaction(self, k: usize, reaction: &Variation, vector: &mut [f64]) {
        let (nodes, slots, row) = (vector.as_chunks_mut::<3>().0, &self.slots[k], &self.contacts[k]);
        for j in 0..row.carriers.nodes().len() {
            let node: &mut [f64; 3] = &mut nodes[slots[j] as usize];
            *node = (DVec3::from_array(*node) + row.at_node(reaction, j)).to_array();
        }
    }
}

/// The reaction of a row whose spring takes `push` more (N) under the variation `v`.
pub fn stretched_and_bent(row: &Contact, push: f64, v: &Variation) -> Variation {
    let straight = row.spread(push);
    if row.multiplier == 0.0 {
        return straight;
    }
    let bent = row.second_variation(v);
    let tangent = |a: usize| bent.tangents[a] * row.multiplier;
    Variation { point: straight.point + bent.point * row.multiplier, tangents: [tangent(0), tangent(1)] }
}

/// Adds B p, the product of the Hessian of the contact energy with the displacement `p` on the support, to `product`.
pub fn add_contact_hessian(springs: Springs, active: &[bool], p: &[f64], product: &mut [f64]) {
    for (k, &active) in active.iter().enumerate() {
        if (active || springs.contacts[k].multiplier != 0.0)
            && let Some(reaction) = springs.resist(k, active, &springs.variation(k, p))
        {
            springs.add_reaction(k, &reaction, product);
        }
    }
}

/// Adds the forces of the contact springs on the object's nodes, -kc share_i max(0, depth_i) w_ij N_i, to `forces` on
/// the support.
pub fn add_contact_forces(springs: Springs, forces: &mut [f64]) {
    for (k, contact) in springs.contacts.iter().enumerate() {
        springs.add_reaction(k, &contact.spread(-springs.kc * contact.force_over_kc()), forces);
    }
}

#[cfg(test)]
pub mod samples;
