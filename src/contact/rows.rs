//! Sums of scaled rows, in which most products of a solve are.

use super::wide::{Kernel, widest};

/// Adds to `sums` three rows for each of `blocks`, which lie one after the other and are as long as it, times the three numbers.
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
