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
