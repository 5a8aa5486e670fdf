//! The stiffness K as a symmetric sparse matrix of 3 x 3 blocks.

use glam::{DMat3, DVec3};

/// Symmetric sparse matrix of 3 x 3 blocks, both halves stored, rows compressed.
#[derive(Clone, Debug, PartialEq)]
pub struct Stiffness {
    /// Row starts, one more than there are nodes.
    pub offsets: Vec<usize>,
    /// Column (node) of each block, ascending within a row.
    pub columns: Vec<u32>,
    /// The blocks (N/m).
    pub blocks: Vec<DMat3>,
    /// All nodes, in the order in which a factorisation takes them.
    pub ordering: Vec<u32>,
}

impl Stiffness {
    /// Zero blocks on the diagonal and at both halves of every edge. `edges`: ends in range; what is repeated counts
    /// once.
    pub(super) fn with_pattern(nodes: usize, edges: &[[u32; 2]]) -> Self {
        let mut rows: Vec<Vec<u32>> = (0..nodes as u32).map(|node| vec![node]).collect();
        for &[a, b] in edges {
            rows[a as usize].push(b);
            rows[b as usize].push(a);
        }
        let mut offsets = vec![0];
        let mut columns = Vec::with_capacity(nodes + 2 * edges.len());
        for mut row in rows {
            row.sort_unstable();
            row.dedup();
            columns.extend(row);
            offsets.push(columns.len());
        }
        let blocks = vec![DMat3::ZERO; columns.len()];
        Self { offsets, columns, blocks, ordering: (0..nodes as u32).collect() }
    }

    /// Number of nodes N; the matrix is 3N x 3N.
    #[must_use]
    pub fn nodes(&self) -> usize {
        self.offsets.len().saturating_sub(1)
    }

    /// Whether every block is a multiple of the identity, so that K acts on the three coordinates alike and apart.
    #[must_use]
    pub fn is_isotropic(&self) -> bool {
        self.blocks.iter().all(|block| *block == DMat3::from_diagonal(DVec3::splat(block.x_axis.x)))
    }

    /// Factor of the identity in each block, if every block is a multiple of it: a ninth of the numbers, for products
    /// frame after frame (N/m).
    #[must_use]
    pub fn scales(&self) -> Option<Vec<f64>> {
        self.is_isotropic().then(|| self.blocks.iter().map(|block| block.x_axis.x).collect())
    }

    /// Column and block of each stored entry of row `node`, ascending.
    pub fn row(&self, node: usize) -> impl Iterator<Item = (usize, &DMat3)> {
        let range = self.offsets[node]..self.offsets[node + 1];
        self.columns[range.clone()].iter().map(|&column| column as usize).zip(&self.blocks[range])
    }

    /// Adds to the block at (`row`, `column`), which must be in the pattern.
    pub(super) fn add(&mut self, row: usize, column: usize, block: DMat3) {
        let start = self.offsets[row];
        let range = start..self.offsets[row + 1];
        if let Ok(position) = self.columns[range].binary_search(&(column as u32)) {
            self.blocks[start + position] += block;
        }
    }

    /// `force = K displacement`: elastic force that holds the nodes displaced by `displacement` (m), (N). Both have one
    /// entry per node.
    pub fn apply(&self, displacement: &[DVec3], force: &mut [DVec3]) {
        for (node, out) in force.iter_mut().enumerate() {
            *out = self.force_on(node, displacement);
        }
    }

    /// The same for one node (N).
    #[must_use]
    pub fn force_on(&self, node: usize, displacement: &[DVec3]) -> DVec3 {
        self.row(node).map(|(column, block)| *block * displacement[column]).sum()
    }

    /// The same by the matrix's [`Stiffness::scales`] (N).
    #[must_use]
    pub fn force_by_scales(&self, scales: &[f64], node: usize, displacement: &[DVec3]) -> DVec3 {
        let range = self.offsets[node]..self.offsets[node + 1];
        let columns = self.columns[range.clone()].iter().map(|&column| displacement[column as usize]);
        columns.zip(&scales[range]).map(|(u, scale)| u * *scale).sum()
    }

    /// Energy stored at `displacement` u, 1/2 u^T K u (J).
    #[must_use]
    pub fn energy(&self, displacement: &[DVec3]) -> f64 {
        0.5 * displacement.iter().enumerate().map(|(node, u)| u.dot(self.force_on(node, displacement))).sum::<f64>()
    }

    /// Largest sum of absolute values in a row: a bound on the largest eigenvalue (Gershgorin) (N/m).
    #[must_use]
    pub fn norm(&self) -> f64 {
        let row_sum = |node| self.row(node).map(|(_, block)| absolute_row_sums(block)).sum::<DVec3>().max_element();
        (0..self.nodes()).map(row_sum).fold(0.0, f64::max)
    }
}

fn absolute_row_sums(block: &DMat3) -> DVec3 {
    block.x_axis.abs() + block.y_axis.abs() + block.z_axis.abs()
}
