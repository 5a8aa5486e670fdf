//! The contact springs on the support: their forces, and products with the Hessian of their energy.

use super::depth::{Contact, second_variation, stiffness_product};
use super::series::common_change;
use crate::tolerances::WALL_COMPLIANCE;
use glam::DVec3;

/// Contacts, where their nodes are on the support, and their stiffness.
#[derive(Clone, Copy)]
pub struct Springs<'a> {
    /// The contacts and near misses.
    pub contacts: &'a [Contact],
    /// Slots of each contact's three nodes.
    pub slots: &'a [[usize; 3]],
    /// kc [N/m].
    pub kc: f64,
    /// How walls bend.
    pub bending: Bending,
}

/// How much of a wall's curvature counts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Bending {
    /// All of it.
    Exact,
    /// What makes the energy convex.
    Convex,
}

impl<'a> Springs<'a> {
    /// Visits the rows of each depth, with the place of the first.
    pub fn for_each_depth(self, mut visit: impl FnMut(usize, &'a [Contact])) {
        let mut first = 0;
        for rows in self.contacts.chunk_by(Contact::shares_ball) {
            visit(first, rows);
            first += rows.len();
        }
    }

    /// What a wall that bears `push` more, bent by displacements `v` of its nodes, resists with at each of them [N].
    pub fn wall_forces(self, row: &Contact, push: f64, v: [DVec3; 3]) -> [DVec3; 3] {
        let straight = row.spread(push);
        if row.multiplier == 0.0 {
            return straight;
        }
        let bent = self.bent(row, v);
        [0, 1, 2].map(|j| straight[j] + bent[j])
    }

    /// The same of its bending alone: its multiplier times the second variation of its depth [N].
    pub fn bent(self, row: &Contact, v: [DVec3; 3]) -> [DVec3; 3] {
        let varied = match (&row.wall, self.bending) {
            (Some(wall), Bending::Convex) => wall.convex_variation(row.weights, row.normal, v),
            _ => second_variation(row, v),
        };
        varied.map(|part| part * row.multiplier)
    }
}

/// Adds B p, the product of the Hessian of the contact terms with the displacement `p` on the support, to `product`.
pub fn add_contact_hessian(springs: Springs, touching: &[bool], p: &[f64], product: &mut [f64]) {
    springs.for_each_depth(|first, rows| {
        let multiplier = rows[0].multiplier;
        if rows[0].wall.is_some() {
            let v = |k: usize| nodes_of(p, springs.slots[first + k]);
            let bearing = rows.iter().enumerate().filter(|&(k, _)| touching[first + k]);
            let common = common_change(bearing.map(|(k, row)| row.deepening(v(k))));
            for (k, row) in rows.iter().enumerate() {
                let touches = touching[first + k];
                if touches || row.multiplier != 0.0 {
                    let change = if touches { (row.deepening(v(k)) - common) / WALL_COMPLIANCE } else { 0.0 };
                    add_on_nodes(
                        springs.wall_forces(row, springs.kc * row.share * change, v(k)),
                        springs.slots[first + k],
                        product,
                    );
                }
            }
            return;
        }
        if !touching[first] && multiplier == 0.0 {
            return;
        }
        let kc = if touching[first] { springs.kc * rows[0].share } else { 0.0 };
        let slots = springs.slots[first];
        add_on_nodes(stiffness_product(&rows[0], kc, nodes_of(p, slots)), slots, product);
    });
}

/// Adds the forces of the contact springs on the object's nodes, -kc share_i depth_i w_ij N_i, to `forces` on the support.
pub fn add_contact_forces(springs: Springs, forces: &mut [f64]) {
    for (contact, &slots) in springs.contacts.iter().zip(springs.slots) {
        add_on_nodes(contact.spread(-springs.kc * contact.bears()), slots, forces);
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
