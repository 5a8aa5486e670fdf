//! The object nodes A that carry contact force, and the compliance among them.
//!
//! Forces live on A only (3 |A| numbers) and displacement is u = C f, so the stiffness itself is never touched and the
//! size of a problem is the size of its contact, not of its object.

use crate::object::Compliance;

/// Nodes in contact, each with a slot; C restricted to them.
pub struct Support {
    /// Slot of each surface node, or [`ABSENT`].
    slots: Vec<u32>,
    /// Surface node of each slot.
    nodes: Vec<u32>,
    /// C_AA, row-major, of order 3 |A| [m/N].
    compliance: Vec<f64>,
    /// Number of slots for which `compliance` was gathered.
    gathered: usize,
}

/// No slot.
pub const ABSENT: u32 = u32::MAX;

impl Support {
    /// An empty support on `surface_nodes` nodes.
    #[must_use]
    pub fn new(surface_nodes: usize) -> Self {
        Self { slots: vec![ABSENT; surface_nodes], nodes: Vec::new(), compliance: Vec::new(), gathered: 0 }
    }

    /// Forgets all nodes.
    pub fn clear(&mut self) {
        for &node in &self.nodes {
            self.slots[node as usize] = ABSENT;
        }
        self.nodes.clear();
        self.gathered = 0;
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

    /// Brings C_AA up to date with the nodes.
    pub fn gather(&mut self, compliance: &Compliance) {
        if self.gathered == self.nodes.len() {
            return;
        }
        self.gathered = self.nodes.len();
        self.compliance.clear();
        for &row_node in &self.nodes {
            for a in 0..3 {
                let start = (3 * row_node as usize + a) * compliance.order;
                let row = &compliance.entries[start..start + compliance.order];
                for &column_node in &self.nodes {
                    let column = 3 * column_node as usize;
                    self.compliance.extend_from_slice(&row[column..column + 3]);
                }
            }
        }
    }

    /// `product = C_AA vector`.
    pub fn multiply(&self, vector: &[f64], product: &mut [f64]) {
        let order = self.order();
        product[..order].fill(0.0);
        // C is symmetric: adding rows, scaled, runs through memory in order and lets the compiler use wide registers.
        for (row, &scale) in self.compliance.chunks_exact(order.max(1)).zip(vector) {
            for (entry, &c) in product.iter_mut().zip(row) {
                *entry += scale * c;
            }
        }
    }

    /// `displacement = C forces` on all surface nodes, `forces` being on A.
    pub fn displace(&self, compliance: &Compliance, forces: &[f64], displacement: &mut [f64]) {
        displacement.fill(0.0);
        for (slot, &node) in self.nodes.iter().enumerate() {
            for a in 0..3 {
                let start = (3 * node as usize + a) * compliance.order;
                let row = &compliance.entries[start..start + compliance.order];
                let scale = forces[3 * slot + a];
                for (entry, &c) in displacement.iter_mut().zip(row) {
                    *entry += scale * c;
                }
            }
        }
    }
}

/// Inner product.
#[must_use]
pub fn dot(a: &[f64], b: &[f64]) -> f64 {
    let mut sum = 0.0;
    for (a, b) in a.iter().zip(b) {
        sum += a * b;
    }
    sum
}

/// Length whose square is `square`; rounding below zero counts as zero, what is not a number stays so.
#[must_use]
pub fn root(square: f64) -> f64 {
    if square < 0.0 { 0.0 } else { square.sqrt() }
}
