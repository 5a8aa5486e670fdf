//! Sums of scaled rows, in which most products of a solve are, with the widest registers that the processor has.
//!
//! Products and sums are not fused, and each entry is summed in the same order whatever the width: results are the same on all
//! machines.

/// Adds to `sums` three rows for each of `blocks`, which lie one after the other and are as long as it, times the three numbers.
pub fn add_rows<'a>(blocks: impl Iterator<Item = (&'a [f64], [f64; 3])>, sums: &mut [f64]) {
    #[cfg(target_arch = "x86_64")]
    if is_x86_feature_detected!("avx2") {
        // SAFETY: the processor has what the function is compiled for.
        return unsafe { add_rows_wide(blocks, sums) };
    }
    add_rows_here(blocks, sums);
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2")]
fn add_rows_wide<'a>(blocks: impl Iterator<Item = (&'a [f64], [f64; 3])>, sums: &mut [f64]) {
    add_rows_here(blocks, sums);
}

#[inline(always)]
fn add_rows_here<'a>(blocks: impl Iterator<Item = (&'a [f64], [f64; 3])>, sums: &mut [f64]) {
    for (rows, [a, b, c]) in blocks {
        let (first, rest) = rows.split_at(sums.len());
        let (second, third) = rest.split_at(sums.len());
        for (((sum, x), y), z) in sums.iter_mut().zip(first).zip(second).zip(third) {
            *sum += a * x + b * y + c * z;
        }
    }
}
