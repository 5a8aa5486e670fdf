//! Forward and backward substitution with a supernodal Cholesky factor, for one right-hand side at a time.
//!
//! Supernodes of a surface are a few columns wide, and a frame has one right-hand side: routines for dense blocks then
//! spend most of their time on being called. Plain loops over the columns read L once in each direction and do little
//! else. A right-hand side is of numbers, or of vectors where one matrix stands for all three coordinates.
//!
//! Reading L from memory takes most of the time. So subtrees of the elimination tree, which do not touch each other's
//! rows, are solved side by side, before the rest forward and after it backward; what they leave in the rest's rows is
//! added up in their order, so that the result is the same for any number of threads (Liu, The role of elimination
//! trees in sparse factorization, 1990).
//!
//! Sharing out is what it is for. On one thread it takes as long as faer's own solve, 24.5 ms and 24.8 with the factor
//! of 100,000 nodes; on two it takes 14.4 ms, where a frame may last 16.7 (`cargo bench --bench frame`).

use super::supernodes::{Supernode, Supernodes};
use rayon::prelude::*;
use std::ops::{AddAssign, Mul, Range, SubAssign};

/// An element of a right-hand side.
pub(super) trait Entry: Copy + Default + Send + Sync + AddAssign + SubAssign + Mul<f64, Output = Self> {}

impl<T: Copy + Default + Send + Sync + AddAssign + SubAssign + Mul<f64, Output = T>> Entry for T {}

/// Entries of a factor from which on a substitution is shared out among threads: 8 MB, beyond what one core's caches
/// hold, take some milliseconds to read; waking threads takes hundredths of one.
const LEAST_FACTOR_TO_SHARE: usize = 1 << 20;

/// A subtree that one thread solves has at most one in so many of the factor's entries. What is left to the rest, which
/// one thread solves, grows with it: of a surface of 100,000 nodes a quarter.
const LEAST_SUBTREES: usize = 8;

/// Which supernodes are solved side by side.
#[derive(Clone, Debug, Default)]
pub(super) struct Partition {
    /// Ascending, none touching another.
    subtrees: Vec<Subtree>,
    /// The other supernodes, ascending.
    rest: Vec<usize>,
}

/// A subtree of the elimination tree whose supernodes follow each other.
#[derive(Clone, Debug)]
struct Subtree {
    supernodes: Range<usize>,
    rows: Range<usize>,
    /// The rest's rows that it touches, ascending.
    border: Vec<usize>,
    /// For supernode after supernode and each of its rows in the border: its place there.
    places: Vec<u32>,
    /// Where the places of each supernode begin.
    starts: Vec<usize>,
}

impl Partition {
    /// Subtrees of a factor large enough to be worth it; else all is the rest.
    pub fn new(supernodes: &Supernodes) -> Self {
        let count = supernodes.count();
        let entries = supernodes.entries();
        if entries < LEAST_FACTOR_TO_SHARE {
            return Self { subtrees: Vec::new(), rest: (0..count).collect() };
        }
        // Of the subtree below each supernode: its entries, its first supernode, and how many there are.
        let mut below: Vec<(usize, usize, usize)> = (0..count).map(|s| (supernodes.range(s).len(), s, 1)).collect();
        for s in 0..count {
            let (size, first, members) = below[s];
            if let Some(parent) = supernodes.parent(s) {
                let parent = &mut below[parent];
                *parent = (parent.0 + size, parent.1.min(first), parent.2 + members);
            }
        }
        let most = entries / LEAST_SUBTREES;
        let mut partition = Self::default();
        let mut s = count;
        while s > 0 {
            s -= 1;
            let (size, first, members) = below[s];
            if size <= most && members == s + 1 - first {
                partition.subtrees.push(Subtree::new(supernodes, first..s + 1));
                s = first;
            } else {
                partition.rest.push(s);
            }
        }
        partition.subtrees.reverse();
        partition.rest.reverse();
        partition
    }

    /// Whether anything is solved side by side.
    pub fn is_shared(&self) -> bool {
        !self.subtrees.is_empty()
    }
}

impl Subtree {
    fn new(all: &Supernodes, supernodes: Range<usize>) -> Self {
        let rows = all.columns(supernodes.start).start..all.columns(supernodes.end - 1).end;
        let beyond = |s: usize| all.pattern(s).iter().copied().filter(|&row| row >= rows.end);
        let mut border: Vec<usize> = supernodes.clone().flat_map(beyond).collect();
        border.sort_unstable();
        border.dedup();
        let (mut places, mut starts) = (Vec::new(), Vec::new());
        for s in supernodes.clone() {
            starts.push(places.len());
            places.extend(beyond(s).map(|row| border.partition_point(|&other| other < row) as u32));
        }
        Self { supernodes, rows, border, places, starts }
    }

    /// The parts of `pattern` among its own rows, counted from the first of them, and in the border.
    fn split<'a>(&'a self, s: usize, pattern: &'a [usize]) -> (impl Iterator<Item = usize> + 'a, &'a [u32]) {
        let own = pattern.partition_point(|&row| row < self.rows.end);
        let start = self.starts[s - self.supernodes.start];
        (pattern[..own].iter().map(|row| row - self.rows.start), &self.places[start..start + pattern.len() - own])
    }
}

/// Solves `L L^T x = right` in place, both in the order of elimination; on rayon's threads where the partition shares
/// it out.
pub(super) fn substitute<T: Entry>(supernodes: &Supernodes, values: &[f64], partition: &Partition, right: &mut [T]) {
    let Partition { subtrees, rest } = partition;
    let borders: Vec<Vec<T>> = apart(subtrees, right)
        .into_par_iter()
        .map(|(subtree, own)| {
            let mut border = vec![T::default(); subtree.border.len()];
            let mut below = Vec::new();
            for s in subtree.supernodes.clone() {
                let supernode = supernodes.get(values, s);
                supernode.forward(subtree.rows.start, own, &mut below);
                let (rows, places) = subtree.split(s, supernode.pattern);
                let mut entries = below.iter();
                rows.zip(&mut entries).for_each(|(row, &entry)| own[row] -= entry);
                places.iter().zip(entries).for_each(|(&place, &entry)| border[place as usize] += entry);
            }
            border
        })
        .collect();
    for (subtree, border) in subtrees.iter().zip(borders) {
        subtree.border.iter().zip(border).for_each(|(&row, entry)| right[row] -= entry);
    }
    let mut below = Vec::new();
    for &s in rest {
        let supernode = supernodes.get(values, s);
        supernode.forward(0, right, &mut below);
        supernode.pattern.iter().zip(&below).for_each(|(&row, &entry)| right[row] -= entry);
    }
    for &s in rest.iter().rev() {
        let supernode = supernodes.get(values, s);
        below.clear();
        below.extend(supernode.pattern.iter().map(|&row| right[row]));
        supernode.backward(0, right, &below);
    }
    let borders: Vec<Vec<T>> =
        subtrees.iter().map(|subtree| subtree.border.iter().map(|&row| right[row]).collect()).collect();
    apart(subtrees, right).into_par_iter().zip(borders).for_each(|((subtree, own), border)| {
        let mut below = Vec::new();
        for s in subtree.supernodes.clone().rev() {
            let supernode = supernodes.get(values, s);
            let (rows, places) = subtree.split(s, supernode.pattern);
            below.clear();
            below.extend(rows.map(|row| own[row]));
            below.extend(places.iter().map(|&place| border[place as usize]));
            supernode.backward(subtree.rows.start, own, &below);
        }
    });
}

/// Each subtree with its rows.
fn apart<'a, T>(subtrees: &'a [Subtree], mut right: &'a mut [T]) -> Vec<(&'a Subtree, &'a mut [T])> {
    let mut taken = 0;
    let mut all = Vec::with_capacity(subtrees.len());
    for subtree in subtrees {
        let (own, after) = right.split_at_mut(subtree.rows.end - taken);
        all.push((subtree, &mut own[subtree.rows.start - taken..]));
        (right, taken) = (after, subtree.rows.end);
    }
    all
}

impl Supernode<'_> {
    /// Solves for its rows of `right`, of which the first is row `first`; `below` takes what they leave in the rows of
    /// its pattern.
    fn forward<T: Entry>(&self, first: usize, right: &mut [T], below: &mut Vec<T>) {
        let width = self.columns.len();
        let own = &mut right[self.columns.start - first..self.columns.end - first];
        below.clear();
        below.resize(self.pattern.len(), T::default());
        for (c, column) in self.values.chunks_exact(width + self.pattern.len()).enumerate() {
            let (diagonal, rest) = column.split_at(width);
            let solved = own[c] * diagonal[c].recip();
            own[c] = solved;
            add(solved * -1.0, &diagonal[c + 1..], &mut own[c + 1..]);
            add(solved, rest, below);
        }
    }

    /// Solves for its rows of `right`, of which the first is row `first`, those of its pattern being `below`.
    fn backward<T: Entry>(&self, first: usize, right: &mut [T], below: &[T]) {
        let width = self.columns.len();
        let own = &mut right[self.columns.start - first..self.columns.end - first];
        for (c, column) in self.values.chunks_exact(width + self.pattern.len()).enumerate().rev() {
            let (diagonal, rest) = column.split_at(width);
            let mut entry = own[c];
            entry -= dot(&diagonal[c + 1..], &own[c + 1..]);
            entry -= dot(rest, below);
            own[c] = entry * diagonal[c].recip();
        }
    }
}

/// Sums that run side by side, so that none waits for the one before. The loops over them are written out: builds for
/// tests, which optimise little, took some three times as long.
const SUMS: usize = 4;

/// Adds `factor` times `weights` to `entries`, which are as many.
fn add<T: Entry>(factor: T, weights: &[f64], entries: &mut [T]) {
    let (weights, last_weights) = weights.as_chunks::<SUMS>();
    let (entries, last_entries) = entries.as_chunks_mut::<SUMS>();
    for (entries, weights) in entries.iter_mut().zip(weights) {
        entries[0] += factor * weights[0];
        entries[1] += factor * weights[1];
        entries[2] += factor * weights[2];
        entries[3] += factor * weights[3];
    }
    last_entries.iter_mut().zip(last_weights).for_each(|(entry, &weight)| *entry += factor * weight);
}

/// Sum of `weights` times `entries`, which are as many.
fn dot<T: Entry>(weights: &[f64], entries: &[T]) -> T {
    let mut sums = [T::default(); SUMS];
    let (weights, last_weights) = weights.as_chunks::<SUMS>();
    let (entries, last_entries) = entries.as_chunks::<SUMS>();
    for (entries, weights) in entries.iter().zip(weights) {
        sums[0] += entries[0] * weights[0];
        sums[1] += entries[1] * weights[1];
        sums[2] += entries[2] * weights[2];
        sums[3] += entries[3] * weights[3];
    }
    let [mut total, others @ ..] = sums;
    others.into_iter().for_each(|sum| total += sum);
    last_weights.iter().zip(last_entries).for_each(|(&weight, &entry)| total += entry * weight);
    total
}
