//! The object nodes A that carry contact force, and the compliance among them.
//!
//! Forces live on A only (3 |A| numbers) and displacement is u = C f, so the stiffness itself is never touched and the
//! size of a problem is the size of its contact, not of its object.

use super::rows::{add_rows, respond};
use crate::object::Compliance;
use glam::DVec3;

/// Nodes in contact, each with a slot; C restricted to them.
pub struct Support {
    /// Slot of each surface node, or [`ABSENT`].
    slots: Vec<u32>,
    /// Surface node of each slot.
    nodes: Vec<u32>,
    /// C_AA, row-major, as many rows per node as C has (m/N).
    compliance: Vec<f64>,
    rows_per_node: usize,
    /// Nodes for which `compliance` was gathered.
    gathered: Vec<u32>,
    /// Their places in the compliance.
    places: Vec<Option<usize>>,
    /// Places in the compliance of nodes that carry force, and that force.
    loads: Vec<(usize, [f64; 3])>,
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
            rows_per_node: 3,
            gathered: Vec::new(),
            places: Vec::new(),
            loads: Vec::new(),
        }
    }

    /// Makes room for `nodes` nodes of an object with so many rows a node: nothing is allocated for them from then on.
    pub fn reserve(&mut self, nodes: usize, rows_per_node: usize) {
        self.reserve_nodes(nodes);
        self.gathered.reserve(nodes);
        self.places.reserve(nodes);
        self.compliance.reserve((rows_per_node * nodes).pow(2));
    }

    /// The same where the compliance among them is not asked for.
    pub fn reserve_nodes(&mut self, nodes: usize) {
        self.nodes.reserve(nodes);
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

    /// Slot of `node`, which has one.
    #[must_use]
    pub fn slot(&self, node: u32) -> usize {
        self.slots[node as usize] as usize
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

    /// Brings C_AA up to date with the nodes. A node that the compliance does not cover does not give way: what touches
    /// it is flagged at the end.
    pub fn gather(&mut self, compliance: &Compliance) {
        if self.gathered == self.nodes {
            return;
        }
        self.gathered.clone_from(&self.nodes);
        self.places.clear();
        self.places.extend(self.nodes.iter().map(|&node| compliance.place(node)));
        self.rows_per_node = compliance.rows_per_node;
        let order = self.rows_per_node * self.nodes.len();
        self.compliance.resize(order * order, 0.0);
        let Self { places, compliance: gathered, rows_per_node, .. } = self;
        if *rows_per_node == 1 {
            gather_blocks::<1>(compliance, places, gathered);
        } else {
            gather_blocks::<3>(compliance, places, gathered);
        }
    }

    /// C_AA, row-major, and its rows per node: 3, or 1 where each stands for all three coordinates (m/N).
    #[must_use]
    pub fn compliance(&self) -> (&[f64], usize) {
        (&self.compliance, self.rows_per_node)
    }

    /// `product = C_AA vector`.
    pub fn multiply(&self, vector: &[f64], product: &mut [f64]) {
        let loads = vector.as_chunks().0.iter().copied().enumerate();
        respond(&self.compliance, self.rows_per_node, loads, &mut product[..vector.len()]);
    }

    /// Numbers a node of a [response](Self::respond_along): its displacement, or where the object is isotropic, so that
    /// every node moves along the force, the size of that alone (1).
    #[must_use]
    pub fn response_width(&self) -> usize {
        self.rows_per_node
    }

    /// Sets `response`, [`response_width`](Self::response_width) numbers a node, to how the support moves under a force
    /// of one newton along `direction`, shared among slots by their weights (m/N).
    pub fn respond_along(&self, direction: DVec3, weights: impl Iterator<Item = (usize, f64)>, response: &mut [f64]) {
        let count = self.nodes.len();
        response.fill(0.0);
        if self.rows_per_node == 1 {
            for (slot, weight) in weights {
                let row = &self.compliance[slot * count..(slot + 1) * count];
                response.iter_mut().zip(row).for_each(|(sum, entry)| *sum += weight * entry);
            }
        } else {
            let block = 9 * count;
            let rows = |slot: usize| &self.compliance[slot * block..(slot + 1) * block];
            add_rows(weights.map(|(slot, weight)| (rows(slot), (direction * weight).to_array())), response);
        }
    }

    /// Adds the displacement that `force` newtons along `direction` make, by their `response`, to `displacement` (m).
    pub fn add_response(&self, direction: DVec3, response: &[f64], force: f64, displacement: &mut [f64]) {
        if self.rows_per_node == 1 {
            let push = direction * force;
            for (node, size) in displacement.as_chunks_mut::<3>().0.iter_mut().zip(response) {
                *node = (DVec3::from_array(*node) + push * *size).to_array();
            }
        } else {
            displacement.iter_mut().zip(response).for_each(|(sum, entry)| *sum += force * entry);
        }
    }

    /// `displacement = C forces` on all surface nodes that the compliance covers, zero on others; `forces` are on A.
    pub fn displace(&mut self, compliance: &Compliance, forces: &[f64], displacement: &mut [f64]) {
        let loads = self.nodes.iter().zip(forces.as_chunks().0).filter_map(|(&node, &force)| {
            let place = (force != [0.0; 3]).then(|| compliance.place(node)).flatten()?;
            Some((place, force))
        });
        self.loads.clear();
        self.loads.extend(loads);
        let covered = &mut displacement[..3 * compliance.nodes.len()];
        respond(&compliance.entries, compliance.rows_per_node, self.loads.iter().copied(), covered);
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

/// Entries of `compliance`, N rows a node, between nodes in `places`; zero for nodes without one.
fn gather_blocks<const N: usize>(compliance: &Compliance, places: &[Option<usize>], gathered: &mut [f64]) {
    let order = N * places.len();
    for (rows, place) in gathered.chunks_exact_mut((N * order).max(1)).zip(places) {
        let all = place.map_or(&[][..], |place| compliance.rows(place));
        for (a, row) in rows.chunks_exact_mut(order).enumerate() {
            let entries = all.get(a * compliance.order()..).unwrap_or_default().as_chunks::<N>().0;
            for (block, column) in row.as_chunks_mut::<N>().0.iter_mut().zip(places) {
                *block = column.and_then(|column| entries.get(column)).copied().unwrap_or([0.0; N]);
            }
        }
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
