//! The object nodes A that carry contact force, and the compliance among them.
//!
//! Forces live on A only (3 |A| numbers) and displacement is u = C f, so the stiffness itself is never touched and the
//! size of a problem is the size of its contact, not of its object.

use super::rows::add_rows;
use crate::object::Compliance;

/// Nodes in contact, each with a slot; C restricted to them.
pub struct Support {
    /// Slot of each surface node, or [`ABSENT`].
    slots: Vec<u32>,
    /// Surface node of each slot.
    nodes: Vec<u32>,
    /// C_AA, row-major, of order 3 |A| [m/N].
    compliance: Vec<f64>,
    /// Nodes for which `compliance` was gathered.
    gathered: Vec<u32>,
    /// Their places in the compliance.
    places: Vec<Option<usize>>,
}

/// No slot.
pub const ABSENT: u32 = u32::MAX;

impl Support {
    /// An empty support on `surface_nodes` nodes.
    #[must_use]
    pub fn new(surface_nodes: usize) -> Self {
        Self {
            slots: vec![ABSENT; surface_nodes],
            nodes: Vec::new(),
            compliance: Vec::new(),
            gathered: Vec::new(),
            places: Vec::new(),
        }
    }

    /// Forgets all nodes.
    pub fn clear(&mut self) {
        for &node in &self.nodes {
            self.slots[node as usize] = ABSENT;
        }
        self.nodes.clear();
    }

    /// Slot of `node`, which is added if it has none.
    pub fn add(&mut self, node: u32) -> usize {
        let slot = &mut self.slots[node as usize];
        if *slot == ABSENT {
            *slot = self.nodes.len() as u32;
            self.nodes.push(node);
        }
        *slot as usize
    }

    /// Nodes in the order of their slots.
    #[must_use]
    pub fn nodes(&self) -> &[u32] {
        &self.nodes
    }

    /// Number of force components, 3 |A|.
    #[must_use]
    pub fn order(&self) -> usize {
        3 * self.nodes.len()
    }

    /// Brings C_AA up to date with the nodes. A node that the compliance does not cover does not give way: what touches it is
    /// flagged at the end.
    pub fn gather(&mut self, compliance: &Compliance) {
        if self.gathered == self.nodes {
            return;
        }
        self.gathered.clone_from(&self.nodes);
        self.places.clear();
        self.places.extend(self.nodes.iter().map(|&node| compliance.place(node)));
        let order = self.order();
        self.compliance.resize(order * order, 0.0);
        for (k, row) in self.compliance.chunks_exact_mut(order.max(1)).enumerate() {
            let entries = self.places[k / 3].map_or(&[][..], |place| compliance.row(3 * place + k % 3).as_chunks().0);
            for (block, column) in row.as_chunks_mut().0.iter_mut().zip(&self.places) {
                *block = column.and_then(|column| entries.get(column)).copied().unwrap_or([0.0; 3]);
            }
        }
    }

    /// `product = C_AA vector`.
    pub fn multiply(&self, vector: &[f64], product: &mut [f64]) {
        let order = self.order();
        let product = &mut product[..order];
        product.fill(0.0);
        // C is symmetric: adding rows, scaled, runs through memory in order.
        let scales = vector.as_chunks().0.iter().copied();
        add_rows(self.compliance.chunks_exact((3 * order).max(1)).zip(scales), product);
    }

    /// `displacement = C forces` on all surface nodes that the compliance covers, zero on others; `forces` are on A.
    pub fn displace(&self, compliance: &Compliance, forces: &[f64], displacement: &mut [f64]) {
        let blocks = self.nodes.iter().zip(forces.as_chunks().0).filter_map(|(&node, &force)| {
            if force == [0.0; 3] {
                return None;
            }
            let rows = 3 * compliance.place(node)? * compliance.order;
            Some((&compliance.entries[rows..rows + 3 * compliance.order], force))
        });
        let covered = &mut displacement[..compliance.order];
        covered.fill(0.0);
        add_rows(blocks, covered);
        if compliance.is_whole() {
            return;
        }
        // From the covered nodes' places, which are no higher, to the nodes' own.
        let mut end = displacement.len();
        for (place, &node) in compliance.nodes.iter().enumerate().rev() {
            let at = 3 * node as usize;
            displacement.copy_within(3 * place..3 * place + 3, at);
            displacement[at + 3..end].fill(0.0);
            end = at;
        }
        displacement[..end].fill(0.0);
    }
}

/// Inner product.
#[inline(always)]
#[must_use]
pub fn dot(a: &[f64], b: &[f64]) -> f64 {
    // Four sums, none of which waits for another.
    let ((fours, rest), (other_fours, other_rest)) = (a.as_chunks::<4>(), b.as_chunks::<4>());
    let mut sums = [0.0; 4];
    for (a, b) in fours.iter().zip(other_fours) {
        for k in 0..4 {
            sums[k] += a[k] * b[k];
        }
    }
    for ((sum, a), b) in sums.iter_mut().zip(rest).zip(other_rest) {
        *sum += a * b;
    }
    (sums[0] + sums[1]) + (sums[2] + sums[3])
}

/// Length whose square is `square`; rounding below zero counts as zero, what is not a number stays so.
#[must_use]
pub fn root(square: f64) -> f64 {
    if square < 0.0 { 0.0 } else { square.sqrt() }
}
