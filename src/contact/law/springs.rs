//! The contact springs on the support: their forces, and products with the Hessian of their energy.

use super::depth::{Contact, Variation};
use super::series::shared_change;
use crate::contact::geometry::smooth::CARRIERS;
use crate::tolerances::FACET_COMPLIANCE;
use glam::DVec3;

/// The slots of a row's nodes on the support, by their place; nodes without weight have any.
pub type Slots = [u32; CARRIERS];

/// Rows of the contact problem, where their nodes are on the support, and their stiffness.
#[derive(Clone, Copy)]
pub struct Springs<'a> {
    /// Contacts and near misses, the rows of a proxy node one after the other.
    pub contacts: &'a [Contact],
    /// Slots of each row's nodes.
    pub slots: &'a [Slots],
    /// kc [N/m].
    pub kc: f64,
}

impl<'a> Springs<'a> {
    /// Visits the rows of each proxy node's spring, with the place of the first.
    pub fn for_each(self, mut visit: impl FnMut(usize, &'a [Contact])) {
        let mut first = 0;
        for rows in self.contacts.chunk_by(Contact::shares_spring) {
            visit(first, rows);
            first += rows.len();
        }
    }

    /// Calls `add` with each row of the spring `rows` and the reaction with which it resists the variation `v` of the
    /// row: the Hessian of its energy, with the rows that are `active` and the multipliers as they are [N].
    pub fn resist(
        self,
        rows: &[Contact],
        active: impl Fn(usize) -> bool,
        v: impl Fn(usize) -> Variation,
        mut add: impl FnMut(usize, Variation),
    ) {
        let shared = if rows.len() == 1 {
            0.0
        } else {
            shared_change((0..rows.len()).filter(|&k| active(k)).map(|k| rows[k].depth_change(&v(k))))
        };
        for (k, row) in rows.iter().enumerate() {
            if !active(k) && row.multiplier == 0.0 {
                continue;
            }
            let v = v(k);
            let own = match (active(k), rows.len()) {
                (false, _) => 0.0,
                (true, 1) => row.depth_change(&v),
                (true, _) => (row.depth_change(&v) - shared) / FACET_COMPLIANCE,
            };
            if own != 0.0 || row.multiplier != 0.0 {
                add(k, stretched_and_bent(row, self.kc * row.share * own, &v));
            }
        }
    }

    /// How the displacement `vector` on the support varies row `k`.
    #[inline]
    #[must_use]
    pub fn variation(self, k: usize, vector: &[f64]) -> Variation {
        let (nodes, slots) = (vector.as_chunks::<3>().0, &self.slots[k]);
        self.contacts[k].variation(|j| DVec3::from_array(nodes[slots[j] as usize]))
    }

    /// By how much the displacement `vector` on the support deepens row `k`, to first order [m].
    #[inline]
    #[must_use]
    pub fn depth_change(self, k: usize, vector: &[f64]) -> f64 {
        let (nodes, slots, row) = (vector.as_chunks::<3>().0, &self.slots[k], &self.contacts[k]);
        row.normal.dot(row.moved(|j| DVec3::from_array(nodes[slots[j] as usize])))
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

/// The reaction of a row whose spring takes `push` more [N] under the variation `v`.
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
    springs.for_each(|first, rows| {
        springs.resist(
            rows,
            |k| active[first + k],
            |k| springs.variation(first + k, p),
            |k, reaction| springs.add_reaction(first + k, &reaction, product),
        );
    });
}

/// Adds the forces of the contact springs on the object's nodes, -kc share_i p_i w_ij N_i, to `forces` on the support.
pub fn add_contact_forces(springs: Springs, forces: &mut [f64]) {
    for (k, contact) in springs.contacts.iter().enumerate() {
        springs.add_reaction(k, &contact.spread(-springs.kc * contact.force_over_kc()), forces);
    }
}

#[cfg(test)]
pub mod samples;
