//! The contact springs on the support: their forces, and products with the Hessian of their energy.

use super::depth::{Contact, second_variation};
use super::series::shared_change;
use crate::tolerances::FACET_COMPLIANCE;
use glam::DVec3;

/// Rows of the contact problem, where their nodes are on the support, and their stiffness.
#[derive(Clone, Copy)]
pub struct Springs<'a> {
    /// Contacts and near misses, the rows of a proxy node one after the other.
    pub contacts: &'a [Contact],
    /// Slots of each row's three nodes.
    pub slots: &'a [[usize; 3]],
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

    /// Calls `add` with each row of the spring `rows` and the forces on the row's nodes with which it resists displacements `v` of
    /// the rows' nodes: the Hessian of its energy, with the rows that are `touching` and the multipliers as they are [N].
    pub fn resist(
        self,
        rows: &[Contact],
        touching: impl Fn(usize) -> bool,
        v: impl Fn(usize) -> [DVec3; 3],
        mut add: impl FnMut(usize, [DVec3; 3]),
    ) {
        let shared = if rows.len() == 1 {
            0.0
        } else {
            shared_change((0..rows.len()).filter(|&k| touching(k)).map(|k| rows[k].deepening(v(k))))
        };
        for (k, row) in rows.iter().enumerate() {
            let own = match (touching(k), rows.len()) {
                (false, _) => 0.0,
                (true, 1) => row.deepening(v(k)),
                (true, _) => (row.deepening(v(k)) - shared) / FACET_COMPLIANCE,
            };
            if own != 0.0 || row.multiplier != 0.0 {
                add(k, stretched_and_bent(row, self.kc * row.share * own, v(k)));
            }
        }
    }
}

/// Forces on a row's nodes where its spring takes `push` more [N] and its nodes are displaced by `v` [m].
pub fn stretched_and_bent(row: &Contact, push: f64, v: [DVec3; 3]) -> [DVec3; 3] {
    let straight = row.spread(push);
    if row.multiplier == 0.0 {
        return straight;
    }
    let bent = second_variation(row, v);
    [0, 1, 2].map(|j| straight[j] + bent[j] * row.multiplier)
}

/// Adds B p, the product of the Hessian of the contact energy with the displacement `p` on the support, to `product`.
pub fn add_contact_hessian(springs: Springs, touching: &[bool], p: &[f64], product: &mut [f64]) {
    springs.for_each(|first, rows| {
        springs.resist(
            rows,
            |k| touching[first + k],
            |k| nodes_of(p, springs.slots[first + k]),
            |k, forces| add_on_nodes(forces, springs.slots[first + k], product),
        );
    });
}

/// Adds the forces of the contact springs on the object's nodes, -kc share_i p_i w_ij N_i, to `forces` on the support.
pub fn add_contact_forces(springs: Springs, forces: &mut [f64]) {
    for (contact, &slots) in springs.contacts.iter().zip(springs.slots) {
        add_on_nodes(contact.spread(-springs.kc * contact.force_over_kc()), slots, forces);
    }
}

/// The three nodes' parts of a vector on the support.
#[inline]
pub fn nodes_of(vector: &[f64], [a, b, c]: [usize; 3]) -> [DVec3; 3] {
    let (nodes, _) = vector.as_chunks();
    [DVec3::from_array(nodes[a]), DVec3::from_array(nodes[b]), DVec3::from_array(nodes[c])]
}

/// Adds one vector for each of three nodes to a vector on the support.
#[inline]
pub fn add_on_nodes(parts: [DVec3; 3], slots: [usize; 3], vector: &mut [f64]) {
    let (nodes, _) = vector.as_chunks_mut();
    for (part, slot) in parts.into_iter().zip(slots) {
        let node: &mut [f64; 3] = &mut nodes[slot];
        *node = (DVec3::from_array(*node) + part).to_array();
    }
}

#[cfg(test)]
pub mod samples;
