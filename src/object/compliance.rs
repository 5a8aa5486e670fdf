//! The compliance C = N K^-1 N^T on surface nodes, N being how these follow the nodes of K.
//!
//! Contact acts on surface nodes only, and only on those that the proxy can reach, so the rows and columns of C at
//! these nodes are all that it needs: leaving out the others is exact static condensation, not an approximation. K is
//! fixed per object: one factorisation, then half a solve a column (`condensation.rs`).
//!
//! Where springs and ground are isotropic C = c (x) I: a force moves every node along itself, and one number a pair of
//! nodes is all there is to store and to multiply with, instead of nine.

use super::{Attachment, Factor, Mechanics, Object};
use crate::scene::{Material, SpringKind, SpringSpec};
use crate::{Error, cache::Cache, error, memory};
use glam::{DMat3, DVec3};
use std::sync::Arc;

/// Dense symmetric matrix over R covered surface nodes (m/N).
#[derive(Clone, Debug, PartialEq)]
pub struct Compliance {
    /// The covered surface nodes, ascending.
    pub nodes: Vec<u32>,
    /// Place in `nodes` of each surface node, or [`ABSENT`].
    places: Vec<u32>,
    /// Rows and columns per node: 3, or 1 where the object is isotropic and each stands for all three coordinates.
    pub rows_per_node: usize,
    /// Row-major, `rows_per_node` R numbers a row: entry (3i + a, 3j + b) is for coordinates a and b of the nodes in
    /// places i and j, or (i, j) for each coordinate of both (m/N).
    pub entries: Vec<f64>,
}

/// No place.
const ABSENT: u32 = u32::MAX;

/// Most memory that the dense compliance may take, where so much is left (B): it is what a laptop can hold beside
/// everything else.
const MAX_BYTES: usize = 4 << 30;

impl Compliance {
    /// The compliance on all surface nodes of `object`; on none if it has no mechanics yet, and there is no memory for
    /// them.
    #[must_use]
    pub fn new(object: &Object) -> Self {
        let formed = object.mechanics().map(|mechanics| (mechanics, (0..object.surface_nodes as u32).collect()));
        let on = |(mechanics, nodes): (&Mechanics, Vec<u32>)| {
            Self::of(&mechanics.factor, &mechanics.attachment, object.surface_nodes, nodes)
        };
        formed.map_or_else(|_| Self::from_parts(Vec::new(), object.surface_nodes, 3, Vec::new()), on)
    }

    /// The compliance on some surface nodes of `object`, ascending and each once: what an earlier run has kept, or
    /// formed, and kept for later ones.
    ///
    /// # Errors
    /// When it would not fit in memory; nothing has been allocated then.
    pub fn on(object: &Object, nodes: Vec<u32>) -> Result<Arc<Self>, Error> {
        if nodes.is_empty() {
            return Ok(Arc::new(Self::from_parts(nodes, object.surface_nodes, 3, Vec::new())));
        }
        Self::check(object, nodes.len())?;
        let entries = Cache::numbers(&key(object, &nodes), || {
            let mechanics = object.mechanics()?;
            Ok::<_, Error>(entries(&mechanics.factor, &mechanics.attachment, &nodes))
        })?;
        let known = object.proven.map_or_else(|| Ok(object.mechanics()?.factor.rows_per_node()), Ok::<_, Error>);
        Ok(Arc::new(Self::from_parts(nodes, object.surface_nodes, known?, entries)))
    }

    /// Whether an earlier run has kept the compliance on all surface nodes of `object`.
    #[must_use]
    pub fn is_kept(object: &Object) -> bool {
        let nodes: Vec<u32> = (0..object.surface_nodes as u32).collect();
        Cache::used().is_some_and(|cache| cache.holds(&key(object, &nodes)))
    }

    fn from_parts(nodes: Vec<u32>, surface_nodes: usize, rows_per_node: usize, entries: Vec<f64>) -> Self {
        let mut places = vec![ABSENT; surface_nodes];
        nodes.iter().zip(0..).for_each(|(&node, place)| places[node as usize] = place);
        Self { nodes, places, rows_per_node, entries }
    }

    /// Checks that the compliance on `nodes` surface nodes of `object` would fit in memory, before anything is formed.
    ///
    /// # Errors
    /// When it would not.
    pub fn check(object: &Object, nodes: usize) -> Result<(), Error> {
        let is_isotropic = match object.spec.material {
            Material::Springs(SpringSpec { kind, .. }) => kind == SpringKind::Isotropic,
            Material::Elastic(_) => false,
            Material::Hollow => true,
        };
        let order = nodes.saturating_mul(if is_isotropic { 1 } else { 3 });
        let bytes = order.saturating_mul(order).saturating_mul(size_of::<f64>());
        if bytes <= memory::SMALL {
            return Ok(());
        }
        let limit = memory::left().map_or(MAX_BYTES, |left| left.min(MAX_BYTES));
        if bytes > limit {
            let [needed, limit] = [bytes.div_ceil(1_000_000), limit / 1_000_000];
            return Err(error!(
                "the proxy reaches {nodes} surface nodes, which need {needed} MB of compliance, more than the {limit} MB of \
                 memory that it may take: use a coarser surface or a smaller grid, close other programs, or raise the \
                 limit (ulimit -v)"
            ));
        }
        Ok(())
    }

    /// The whole inverse of the matrix that `factor` factorises, over `nodes` nodes, surface and inner ones.
    #[must_use]
    pub fn inverse(factor: &Factor, nodes: usize) -> Self {
        Self::of(factor, &Attachment::identity(nodes), nodes, (0..nodes as u32).collect())
    }

    /// The part of N K^-1 N^T at `covered` ones of the first `surface_nodes` nodes; N is `attachment`.
    fn of(factor: &Factor, attachment: &Attachment, surface_nodes: usize, covered: Vec<u32>) -> Self {
        let entries = entries(factor, attachment, &covered);
        Self::from_parts(covered, surface_nodes, factor.rows_per_node(), entries)
    }

    /// Whether all surface nodes are covered.
    #[must_use]
    pub fn is_whole(&self) -> bool {
        self.nodes.len() == self.places.len()
    }

    /// Place of surface node `node`, if it is covered.
    #[must_use]
    pub fn place(&self, node: u32) -> Option<usize> {
        self.places.get(node as usize).filter(|&&place| place != ABSENT).map(|&place| place as usize)
    }

    /// Rows and columns: `rows_per_node` R.
    #[must_use]
    pub fn order(&self) -> usize {
        self.rows_per_node * self.nodes.len()
    }

    /// The `rows_per_node` rows of the node in place i, one after the other (m/N).
    #[must_use]
    pub fn rows(&self, i: usize) -> &[f64] {
        let length = self.rows_per_node * self.order();
        &self.entries[i * length..(i + 1) * length]
    }

    /// Displacement of the node in place i per force on the node in place j (m/N).
    #[must_use]
    pub fn block(&self, i: usize, j: usize) -> DMat3 {
        let rows = self.rows(i);
        if self.rows_per_node == 1 {
            return DMat3::from_diagonal(DVec3::splat(rows[j]));
        }
        let row = |a: usize| DVec3::from_slice(&rows[a * self.order() + 3 * j..][..3]);
        DMat3::from_cols(row(0), row(1), row(2)).transpose()
    }
}

/// Under what the compliance of `object` on `nodes` is kept.
fn key(object: &Object, nodes: &[u32]) -> Vec<u8> {
    [&object.key[..], b"compliance", bytemuck::cast_slice(nodes)].concat()
}

/// The entries of N K^-1 N^T at the nodes `covered`, row by row.
fn entries(factor: &Factor, attachment: &Attachment, covered: &[u32]) -> Vec<f64> {
    let rows_per_node = factor.rows_per_node();
    // Rows of N, one for each coordinate of a node.
    let row = |k: usize| {
        let nodes = attachment.row(covered[k / rows_per_node] as usize).iter();
        nodes.map(|&(node, weight)| (rows_per_node * node as usize + k % rows_per_node, weight)).collect()
    };
    let rows: Vec<Vec<(usize, f64)>> = (0..rows_per_node * covered.len()).map(row).collect();
    factor.condensed(&rows)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::object::Stiffness;

    /// Six nodes in a chain with a cross link, all held; the last two are interior.
    fn stiffness() -> Stiffness {
        let edges = [[0, 1], [1, 2], [2, 3], [3, 4], [4, 5], [0, 5]];
        let mut stiffness = Stiffness::with_pattern(6, &edges);
        for (index, [a, b]) in edges.map(|edge| edge.map(|node| node as usize)).into_iter().enumerate() {
            let e = DVec3::new(1.0, 0.3 * index as f64, -0.5);
            let block = 10.0 * DMat3::from_cols(e * e.x, e * e.y, e * e.z) + DMat3::from_diagonal(DVec3::splat(2.0));
            for (row, column, sign) in [(a, a, 1.0), (b, b, 1.0), (a, b, -1.0), (b, a, -1.0)] {
                stiffness.add(row, column, sign * block);
            }
        }
        (0..6).for_each(|node| stiffness.add(node, node, DMat3::from_diagonal(DVec3::splat(0.5))));
        stiffness
    }

    #[test]
    fn condensation_leaves_interior_nodes_without_force() {
        let stiffness = stiffness();
        let factor = Factor::of(&stiffness, 1.0, &[0.0; 6]).unwrap();
        let compliance = Compliance::of(&factor, &Attachment::identity(6), 4, vec![0, 1, 2, 3]);
        assert_eq!((compliance.order(), compliance.entries.len()), (12, 144));
        // The displacement that the whole object takes under a force on node 2 is, on the surface, C's column; and its
        // forces vanish everywhere else, interior nodes included.
        let mut displacement = [DVec3::ZERO; 6];
        displacement[2] = DVec3::new(1.0, -2.0, 0.5);
        let force = displacement;
        factor.solve(&mut displacement);
        for (i, displacement) in displacement.iter().enumerate().take(4) {
            assert!((compliance.block(i, 2) * force[2] - *displacement).length() < 1e-14, "node {i}");
        }
        let mut resisted = [DVec3::NAN; 6];
        stiffness.apply(&displacement, &mut resisted);
        assert!(resisted.iter().zip(&force).all(|(a, b)| (*a - *b).length() < 1e-13), "{resisted:?}");
    }

    #[test]
    fn covering_fewer_nodes_changes_no_entry() {
        let factor = Factor::of(&stiffness(), 1.0, &[0.0; 6]).unwrap();
        let whole = Compliance::of(&factor, &Attachment::identity(6), 4, vec![0, 1, 2, 3]);
        let some = Compliance::of(&factor, &Attachment::identity(6), 4, vec![1, 3]);
        assert!(whole.is_whole() && !some.is_whole());
        assert_eq!([0, 1, 2, 3, 9].map(|node| some.place(node)), [None, Some(0), None, Some(1), None]);
        for (i, a) in [1, 3].into_iter().enumerate() {
            for (j, b) in [1, 3].into_iter().enumerate() {
                let difference = some.block(i, j) - whole.block(a, b);
                assert!(difference.to_cols_array().iter().all(|x| x.abs() < 1e-16), "{difference}");
            }
        }
    }

    #[test]
    fn a_factor_covers_shifted_and_scaled_matrices() {
        let stiffness = stiffness();
        let diagonal = [1.0, 2.0, 3.0, 4.0, 5.0, 6.0];
        let solution: Vec<DVec3> = (0..6).map(|i| DVec3::new(i as f64, 1.0 - i as f64, 0.25)).collect();
        let mut vectors = vec![DVec3::ZERO; 6];
        stiffness.apply(&solution, &mut vectors);
        for ((vector, u), d) in vectors.iter_mut().zip(&solution).zip(diagonal) {
            *vector = 0.25 * *vector + d * *u;
        }
        Factor::of(&stiffness, 0.25, &diagonal).unwrap().solve(&mut vectors);
        assert!(vectors.iter().zip(&solution).all(|(a, b)| (*a - *b).length() < 1e-13));
        let indefinite = Factor::of(&stiffness, 1.0, &[-100.0; 6]);
        assert_eq!(indefinite.unwrap_err().kind(), crate::ErrorKind::Indefinite);
    }
}
