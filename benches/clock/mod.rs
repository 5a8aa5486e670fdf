//! The time of work that takes nanoseconds.

use std::time::Instant;

/// Median over `blocks` of the mean time of `work` in each, which is done `count` times and gets its number (ns).
pub fn nanoseconds(blocks: u32, count: u32, mut work: impl FnMut(f64)) -> f64 {
    let mut means: Vec<f64> = (0..blocks)
        .map(|block| {
            let start = Instant::now();
            (0..count).for_each(|k| work(f64::from(count * block + k)));
            start.elapsed().as_nanos() as f64 / f64::from(count)
        })
        .collect();
    means.sort_by(f64::total_cmp);
    means[means.len() / 2]
}
