//! Sums of scaled rows, in which most products of a solve are.

use super::wide::{Kernel, widest};

/// Adds to `sums` three rows for each of `blocks`, which lie one after the other and are as long as it, times the three
/// numbers.
pub fn add_rows<'a>(blocks: impl Iterator<Item = (&'a [f64], [f64; 3])>, sums: &mut [f64]) {
    widest(AddRows { blocks, sums });
}

struct AddRows<'s, B> {
    blocks: B,
    sums: &'s mut [f64],
}

impl<'a, B: Iterator<Item = (&'a [f64], [f64; 3])>> Kernel for AddRows<'_, B> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let Self { blocks, sums } = self;
        for (rows, [a, b, c]) in blocks {
            let (first, rest) = rows.split_at(sums.len());
            let (second, third) = rest.split_at(sums.len());
            for (((sum, x), y), z) in sums.iter_mut().zip(first).zip(second).zip(third) {
                *sum += a * x + b * y + c * z;
            }
        }
    }
}

/// Sets `sums` to the sum of `rows`, as long as it, times a number each.
pub fn combine<'a>(rows: impl Iterator<Item = (&'a [f64], f64)>, sums: &mut [f64]) {
    widest(Combine { rows, sums });
}

struct Combine<'s, R> {
    rows: R,
    sums: &'s mut [f64],
}

impl<'a, R: Iterator<Item = (&'a [f64], f64)>> Kernel for Combine<'_, R> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let Self { mut rows, sums } = self;
        sums.fill(0.0);
        // Four rows at a time, so that each sum is loaded and stored once for them.
        while let Some((first, a)) = rows.next() {
            let [(second, b), (third, c), (fourth, d)] = [(); 3].map(|()| rows.next().unwrap_or((first, 0.0)));
            let four = first.iter().zip(second).zip(third).zip(fourth);
            for (sum, (((w, x), y), z)) in sums.iter_mut().zip(four) {
                *sum += (a * w + b * x) + (c * y + d * z);
            }
        }
    }
}

/// Sets `displacement`, three numbers a node, to how nodes move under `loads`, each the place of a node and the force on it
/// (N), where `entries` are the compliance among them with so many rows a node (m/N). It is symmetric: its columns are its
/// rows, which lie in order.
pub fn respond(
    entries: &[f64],
    rows_per_node: usize,
    loads: impl Iterator<Item = (usize, [f64; 3])> + Clone,
    displacement: &mut [f64],
) {
    let block = rows_per_node * (rows_per_node * displacement.len() / 3);
    if rows_per_node == 1 {
        weigh(entries, loads.map(|(place, force)| (place * block, force)), displacement);
    } else {
        displacement.fill(0.0);
        add_rows(loads.map(|(place, force)| (&entries[place * block..(place + 1) * block], force)), displacement);
    }
}

/// Sets `sums`, three numbers a node, to the sum of `loads`: of rows that begin at a place in `entries` and have a
/// number for each node, times a vector.
fn weigh(entries: &[f64], loads: impl Iterator<Item = (usize, [f64; 3])> + Clone, sums: &mut [f64]) {
    widest(Weigh { entries, loads, sums });
}

struct Weigh<'s, L> {
    entries: &'s [f64],
    loads: L,
    sums: &'s mut [f64],
}

/// Nodes whose sums are kept in registers, and numbers of so many vectors.
const BLOCK_SIZE: usize = 4;
const NUMBERS: usize = 3 * BLOCK_SIZE;

impl<L: Iterator<Item = (usize, [f64; 3])> + Clone> Kernel for Weigh<'_, L> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let Self { entries, loads, sums } = self;
        let (together, rest) = sums.as_chunks_mut::<NUMBERS>();
        let done = BLOCK_SIZE * together.len();
        for (k, together) in together.iter_mut().enumerate() {
            let mut vectors = [[0.0; 4]; BLOCK_SIZE];
            for (start, [a, b, c]) in loads.clone() {
                let row = &entries[start + BLOCK_SIZE * k..][..BLOCK_SIZE];
                for (sum, entry) in vectors.iter_mut().zip(row) {
                    for (sum, scale) in sum.iter_mut().zip([a, b, c, 0.0]) {
                        *sum += entry * scale;
                    }
                }
            }
            for (sum, vector) in together.as_chunks_mut::<3>().0.iter_mut().zip(vectors) {
                sum.copy_from_slice(&vector[..3]);
            }
        }
        for (k, sum) in rest.as_chunks_mut::<3>().0.iter_mut().enumerate() {
            *sum = [0.0; 3];
            for (start, vector) in loads.clone() {
                for (sum, scale) in sum.iter_mut().zip(vector) {
                    *sum += entries[start + done + k] * scale;
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::sequence;

    /// For every number of nodes and of rows, against sums over blocks c I, on every width.
    #[test]
    fn one_number_a_pair_is_a_block_of_it() {
        let mut next = sequence(3);
        for nodes in 0..11 {
            for rows in 0..4 {
                let entries: Vec<f64> = (0..rows * nodes).map(|_| next()).collect();
                let loads: Vec<(usize, [f64; 3])> = (0..rows).map(|k| (k * nodes, [next(), next(), next()])).collect();
                let mut expected = vec![0.0; 3 * nodes];
                for (start, vector) in &loads {
                    let mut blocks = vec![0.0; 9 * nodes];
                    for j in 0..nodes {
                        (0..3).for_each(|a| blocks[3 * nodes * a + 3 * j + a] = entries[start + j]);
                    }
                    add_rows(std::iter::once((&blocks[..], *vector)), &mut expected);
                }
                let loads = loads.iter().copied();
                let mut sums = vec![f64::NAN; 3 * nodes];
                Weigh { entries: &entries, loads: loads.clone(), sums: &mut sums }.run();
                assert_eq!(sums, expected, "{rows} rows of {nodes}");
                sums.fill(f64::NAN);
                weigh(&entries, loads, &mut sums);
                assert_eq!(sums, expected, "{rows} rows of {nodes}");
            }
        }
    }
}
