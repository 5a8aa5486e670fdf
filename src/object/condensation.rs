//! The condensed inverse R^T A^-1 R on the columns of a sparse R.
//!
//! With A = L L^T it is Y^T Y, where L Y = R: one forward substitution, and symmetric by construction. A column of Y
//! is zero outside the paths that lead in the elimination tree from the rows of its entries to the root (Gilbert &
//! Peierls 1988), which are a small part of L: those of a solid of n rows have O(n^(2/3)). Columns that are close in
//! the order of elimination share most of their paths. So they are solved in blocks, dense over the supernodes that
//! lie on any path of the block, and two blocks are multiplied over the supernodes that both have.

use super::{outlook, supernodes::Supernodes};
use faer::linalg::{matmul::matmul, triangular_solve::solve_lower_triangular_in_place};
use faer::{Accum, Mat, MatRef, Par};
use rayon::prelude::*;
use std::collections::BTreeSet;

/// Columns of a block. More: longer rows for dense products. Fewer: fewer paths that most columns of a block lack.
const COLUMNS_PER_BLOCK: usize = 48;

/// Some columns of Y.
struct Block<'c> {
    /// Their numbers.
    columns: &'c [usize],
    /// Supernodes in which some of them are not zero, ascending.
    supernodes: Vec<usize>,
    /// First row of each in `entries`, and their number.
    starts: Vec<usize>,
    entries: Mat<f64>,
}

/// Returns R^T A^-1 R, row-major. `supernodes`, `values`: L. `columns`: the entries of each column of R, as row of L
/// and value.
pub(super) fn condense(supernodes: &Supernodes, values: &[f64], columns: &[Vec<(usize, f64)>]) -> Vec<f64> {
    let mut numbers: Vec<usize> = (0..columns.len()).collect();
    numbers.sort_by_key(|&number| columns[number].first().map(|(row, _)| *row));
    let path = |some: &[usize]| path(supernodes, some.iter().flat_map(|&column| &columns[column]));
    let paths: Vec<Vec<usize>> = numbers.par_chunks(COLUMNS_PER_BLOCK).map(path).collect();
    announce(supernodes, numbers.chunks(COLUMNS_PER_BLOCK).zip(&paths));
    let solve = |(some, path)| Block::solve(supernodes, values, columns, some, path);
    let blocks: Vec<Block<'_>> = numbers.par_chunks(COLUMNS_PER_BLOCK).zip(paths).map(solve).collect();
    let order = columns.len();
    let mut entries = vec![0.0; order * order];
    for (k, block) in blocks.iter().enumerate() {
        let products: Vec<Mat<f64>> = blocks[..=k].par_iter().map(|other| block.product(other)).collect();
        for (other, product) in blocks.iter().zip(products) {
            for (b, &column) in other.columns.iter().enumerate() {
                for (a, &row) in block.columns.iter().enumerate() {
                    entries[row * order + column] = product[(a, b)];
                    entries[column * order + row] = product[(a, b)];
                }
            }
        }
    }
    entries
}

/// Supernodes on the paths of `entries` to the root, ascending.
fn path<'e>(all: &Supernodes, entries: impl Iterator<Item = &'e (usize, f64)>) -> Vec<usize> {
    let mut on_path = BTreeSet::new();
    for &(row, _) in entries {
        let mut next = Some(all.with(row));
        while let Some(s) = next.filter(|s| on_path.insert(*s)) {
            next = all.parent(s);
        }
    }
    on_path.into_iter().collect()
}

/// Says how long blocks of columns take that have these supernodes.
fn announce<'b>(all: &Supernodes, blocks: impl Iterator<Item = (&'b [usize], &'b Vec<usize>)>) {
    let (mut sharing, mut order) = (vec![0.0; all.count()], 0);
    for (columns, path) in blocks {
        path.iter().for_each(|&s| sharing[s] += columns.len() as f64);
        order += columns.len();
    }
    let operations = sharing.iter().enumerate().map(|(s, columns)| {
        let [width, below] = [all.columns(s).len(), all.pattern(s).len()].map(|count| count as f64);
        // Substitution, and half of the products of all columns that have this supernode.
        columns * width * (width + 2.0 * below + columns)
    });
    let what = format_args!("finding the object's compliance, a matrix of {order} rows,");
    outlook::announce(what, operations.sum(), rayon::current_num_threads());
}

impl<'c> Block<'c> {
    /// Solves L Y = R for some columns, which have these supernodes.
    fn solve(
        all: &Supernodes,
        values: &[f64],
        right: &[Vec<(usize, f64)>],
        columns: &'c [usize],
        supernodes: Vec<usize>,
    ) -> Self {
        let mut starts = vec![0];
        for (k, &s) in supernodes.iter().enumerate() {
            starts.push(starts[k] + all.columns(s).len());
        }
        // Where a row of L is among those of the block.
        let place = |row: usize| {
            let s = all.with(row);
            starts[supernodes.partition_point(|other| *other < s)] + row - all.columns(s).start
        };
        let mut entries = Mat::zeros(starts[supernodes.len()], columns.len());
        for (k, &column) in columns.iter().enumerate() {
            right[column].iter().for_each(|&(row, value)| entries[(place(row), k)] += value);
        }
        let mut update = Mat::zeros(0, 0);
        for (&s, &start) in supernodes.iter().zip(&starts) {
            let supernode = all.get(values, s);
            let (width, below) = (supernode.columns.len(), supernode.pattern.len());
            let l = MatRef::from_column_major_slice(supernode.values, width + below, width);
            let (diagonal, rest) = l.split_at_row(width);
            let mut own = entries.as_mut().subrows_mut(start, width);
            solve_lower_triangular_in_place(diagonal, own.as_mut(), Par::Seq);
            update.resize_with(below, columns.len(), |_, _| 0.0);
            matmul(update.as_mut(), Accum::Replace, rest, own.as_ref(), 1.0, Par::Seq);
            let places: Vec<usize> = supernode.pattern.iter().map(|&row| place(row)).collect();
            for (mut column, update) in entries.col_iter_mut().zip(update.col_iter()) {
                places.iter().zip(update.iter()).for_each(|(&place, update)| column[place] -= update);
            }
        }
        Self { columns, supernodes, starts, entries }
    }

    /// Returns Y_a^T Y_b of its columns a and those b of `other`.
    fn product(&self, other: &Self) -> Mat<f64> {
        let mut product = Mat::zeros(self.columns.len(), other.columns.len());
        for (k, s) in self.supernodes.iter().enumerate() {
            let Ok(l) = other.supernodes.binary_search(s) else { continue };
            let width = self.starts[k + 1] - self.starts[k];
            let [a, b] = [(self, k), (other, l)].map(|(block, k)| block.entries.subrows(block.starts[k], width));
            matmul(product.as_mut(), Accum::Add, a.transpose(), b, 1.0, Par::Seq);
        }
        product
    }
}

#[cfg(test)]
mod tests {
    use crate::object::{Factor, Stiffness};
    use glam::{DMat3, DVec3};

    /// Columns of one to three entries anywhere in a grid, more than one block of them, against one solve for each.
    #[test]
    fn the_condensed_inverse_is_that_of_single_solves() {
        let n = 12;
        let number = |x: u32, y: u32| n * x + y;
        let across = (0..n - 1).flat_map(|x| (0..n).map(move |y| [number(x, y), number(x + 1, y)]));
        let along = (0..n).flat_map(|x| (0..n - 1).map(move |y| [number(x, y), number(x, y + 1)]));
        let edges: Vec<[u32; 2]> = across.chain(along).collect();
        let nodes = (n * n) as usize;
        let mut stiffness = Stiffness::with_pattern(nodes, &edges);
        for (k, [a, b]) in edges.iter().map(|edge| edge.map(|node| node as usize)).enumerate() {
            let e = DVec3::new(1.0, 0.2 * (k % 5) as f64, -0.4);
            let block = DMat3::from_cols(e * e.x, e * e.y, e * e.z) + DMat3::from_diagonal(DVec3::splat(0.3));
            [(a, a, 1.0), (b, b, 1.0), (a, b, -1.0), (b, a, -1.0)]
                .into_iter()
                .for_each(|(row, column, sign)| stiffness.add(row, column, sign * block));
        }
        let factor = Factor::of(&stiffness, 1.0, &vec![0.1; nodes]).unwrap();
        let entries = |k: usize| (0..=k % 3).map(move |m| ((37 * k + 101 * m) % (3 * nodes), 1.0 - 0.3 * m as f64));
        let columns: Vec<Vec<(usize, f64)>> = (0..110).map(|k| entries(k).collect()).collect();
        let condensed = factor.condensed(&columns);
        let scale = condensed.iter().fold(0.0, |most: f64, c| most.max(c.abs()));
        for (k, column) in columns.iter().enumerate() {
            let mut solved = vec![DVec3::ZERO; nodes];
            column.iter().for_each(|&(row, value)| solved[row / 3][row % 3] += value);
            factor.solve(&mut solved);
            for (l, other) in columns.iter().enumerate() {
                let expected: f64 = other.iter().map(|&(row, value)| value * solved[row / 3][row % 3]).sum();
                let found = condensed[k * columns.len() + l];
                assert!((found - expected).abs() < 1e-13 * scale, "columns {k} and {l}: {found}, {expected}");
                assert_eq!(found, condensed[l * columns.len() + k], "columns {k} and {l}");
            }
        }
    }
}
