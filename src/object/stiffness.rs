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
    /// Zero blocks on the diagonal and between all nodes of each of `cliques`, such as the ends of an edge or the nodes
    /// of an element; these are in range.
    pub(super) fn with_pattern<C: AsRef<[u32]>>(nodes: usize, cliques: &[C]) -> Self {
        let mut around: Vec<Vec<u32>> = vec![Vec::new(); nodes];
        for (clique, number) in cliques.iter().zip(0..) {
            clique.as_ref().iter().for_each(|&node| around[node as usize].push(number));
        }
        let (mut offsets, mut columns) = (vec![0], Vec::new());
        // The row that a node has been added to last.
        let mut added: Vec<u32> = vec![u32::MAX; nodes];
        for (around, row) in around.iter().zip(0..) {
            let start = columns.len();
            let others = around.iter().flat_map(|&clique| cliques[clique as usize].as_ref());
            for &node in std::iter::once(&row).chain(others) {
                if added[node as usize] != row {
                    added[node as usize] = row;
                    columns.push(node);
                }
            }
            columns[start..].sort_unstable();
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

    /// Adds `k` times the identity times the product of weights of nodes in `left` and of nodes in `right`, in the
    /// pattern.
    pub(super) fn add_products(&mut self, left: &[(u32, f64)], right: &[(u32, f64)], k: f64) {
        for &(row, a) in left {
            right.iter().for_each(|&(column, b)| {
                self.add(row as usize, column as usize, DMat3::from_diagonal(DVec3::splat(k * a * b)));
            });
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
        self.scaled_norm(&vec![1.0; self.nodes()])
    }

    /// The same of S K S, S being the diagonal matrix of `scales`, one a node.
    pub(super) fn scaled_norm(&self, scales: &[f64]) -> f64 {
        let row_sum = |node: usize| {
            let sums = self.row(node).map(|(other, block)| scales[other] * absolute_row_sums(block));
            scales[node] * sums.sum::<DVec3>().max_element()
        };
        (0..self.nodes()).map(row_sum).fold(0.0, f64::max)
    }

    /// Mean of the diagonal of each node's own block (N/m).
    pub(super) fn diagonal(&self) -> Vec<f64> {
        let own = |node: usize| self.row(node).find(|(other, _)| *other == node).map(|(_, block)| *block);
        let trace = |block: DMat3| block.x_axis.x + block.y_axis.y + block.z_axis.z;
        (0..self.nodes()).map(|node| own(node).map_or(0.0, trace) / 3.0).collect()
    }
}

fn absolute_row_sums(block: &DMat3) -> DVec3 {
    block.x_axis.abs() + block.y_axis.abs() + block.z_axis.abs()
}
