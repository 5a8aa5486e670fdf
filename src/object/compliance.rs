//! The compliance C = K^-1 on the surface nodes.
//!
//! Contact acts on surface nodes only, so the rows and columns of K^-1 at those nodes are all that it needs: leaving out
//! the others is exact static condensation, not an approximation. K is fixed per object: one factorisation, then one
//! solve a column, in blocks of columns on all cores.

use super::Factor;
use glam::{DMat3, DVec3};
use rayon::prelude::*;

/// Dense symmetric matrix over the 3S surface coordinates, row-major: entry (3i + a, 3j + b) [m/N].
#[derive(Clone, Debug, PartialEq)]
pub struct Compliance {
    /// 3S.
    pub order: usize,
    /// `order * order` numbers [m/N].
    pub entries: Vec<f64>,
}

/// Right-hand sides solved at once: enough for the factor to be read once for many columns, few enough that a block of
/// columns stays in cache.
const COLUMNS_PER_SOLVE: usize = 32;

impl Compliance {
    /// The part of K^-1 at the first `surface_nodes` of `nodes` nodes.
    pub(super) fn of(factor: &Factor, nodes: usize, surface_nodes: usize) -> Self {
        let order = 3 * surface_nodes;
        let mut entries = vec![0.0; order * order];
        entries.par_chunks_mut((COLUMNS_PER_SOLVE * order).max(1)).enumerate().for_each(|(chunk, rows)| {
            let width = rows.len() / order;
            let first = chunk * COLUMNS_PER_SOLVE;
            let mut columns = faer::Mat::zeros(3 * nodes, width);
            for k in 0..width {
                columns[(first + k, k)] = 1.0;
            }
            factor.solve_columns(columns.as_mut());
            for (k, row) in rows.chunks_exact_mut(order).enumerate() {
                for (entry, value) in row.iter_mut().zip(columns.col(k).iter()) {
                    *entry = *value;
                }
            }
        });
        symmetrise(&mut entries, order);
        Self { order, entries }
    }

    /// Row 3i + a of coordinate a at node i, one number per surface coordinate [m/N].
    #[must_use]
    pub fn row(&self, row: usize) -> &[f64] {
        &self.entries[row * self.order..(row + 1) * self.order]
    }

    /// Displacement of surface node i per force on surface node j [m/N].
    #[must_use]
    pub fn block(&self, i: usize, j: usize) -> DMat3 {
        let row = |a: usize| {
            let start = (3 * i + a) * self.order + 3 * j;
            DVec3::from_slice(&self.entries[start..start + 3])
        };
        DMat3::from_cols(row(0), row(1), row(2)).transpose()
    }
}

/// Replaces C by (C + C^T) / 2: K^-1 is symmetric, its solved columns only to rounding.
fn symmetrise(entries: &mut [f64], order: usize) {
    for i in 0..order {
        for j in 0..i {
            let mean = 0.5 * (entries[i * order + j] + entries[j * order + i]);
            entries[i * order + j] = mean;
            entries[j * order + i] = mean;
        }
    }
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
        let compliance = Compliance::of(&factor, 6, 4);
        assert_eq!((compliance.order, compliance.entries.len()), (12, 144));
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
        assert_eq!(indefinite.unwrap_err(), crate::object::FactorError::NotPositiveDefinite);
    }
}
