//! The order in which points enter a triangulation: rounds that double in size (a biased randomised insertion order,
//! Amenta, Choi and Rote 2003), each along a Hilbert curve (Skilling 2004).
//!
//! Neighbours on the curve are neighbours in space, so locating the next point is a short walk; the random rounds keep
//! points on lines and surfaces from building many simplices that later points destroy.

use super::cloud::Position;
use crate::random::mix;

/// Rounds stop halving here: a Hilbert sort of so few points is as good as a random order.
const SMALLEST_ROUND: usize = 64;
/// Bits of each coordinate on the curve: three coordinates fit a 64-bit index.
const BITS: u32 = 21;

/// A permutation of `0..positions.len()`; positions lie in the unit cube.
pub(super) fn insertion_order(positions: &[Position]) -> Vec<u32> {
    let mut order: Vec<u32> = (0..positions.len() as u32).collect();
    order.sort_unstable_by_key(|&point| (mix(u64::from(point)), point));
    let mut end = order.len();
    while end > 0 {
        let start = if end > SMALLEST_ROUND { end / 2 } else { 0 };
        order[start..end].sort_by_cached_key(|&point| hilbert(&positions[point as usize]));
        end = start;
    }
    order
}

/// Index of the first three coordinates along the Hilbert curve.
fn hilbert(position: &Position) -> u64 {
    let cells = f64::from(1_u32 << BITS);
    let mut x: [u32; 3] = std::array::from_fn(|axis| (position[axis].clamp(0.0, 1.0) * cells).min(cells - 1.0) as u32);
    let mut bit = 1_u32 << (BITS - 1);
    while bit > 1 {
        let low = bit - 1;
        for axis in 0..3 {
            if x[axis] & bit != 0 {
                x[0] ^= low;
            } else {
                let swap = (x[0] ^ x[axis]) & low;
                x[0] ^= swap;
                x[axis] ^= swap;
            }
        }
        bit >>= 1;
    }
    x[1] ^= x[0];
    x[2] ^= x[1];
    let mut flip = 0;
    let mut bit = 1_u32 << (BITS - 1);
    while bit > 1 {
        if x[2] & bit != 0 {
            flip ^= bit - 1;
        }
        bit >>= 1;
    }
    let x = x.map(|coordinate| coordinate ^ flip);
    (0..BITS).rev().fold(0, |index, bit| x.iter().fold(index, |index, c| index << 1 | u64::from(c >> bit & 1)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn consecutive_cells_of_the_curve_are_neighbours() {
        let side = 8;
        let mut cells: Vec<[i32; 3]> = Vec::new();
        for i in 0..side {
            for j in 0..side {
                cells.extend((0..side).map(|k| [i, j, k]));
            }
        }
        cells.sort_by_key(|cell| {
            let mut position = [0.0; crate::MAX_AXES];
            for (x, c) in position.iter_mut().zip(cell) {
                *x = f64::from(*c) / f64::from(side);
            }
            hilbert(&position)
        });
        for pair in cells.windows(2) {
            let steps: i32 = pair[0].iter().zip(pair[1]).map(|(a, b)| (a - b).abs()).sum();
            assert_eq!(steps, 1, "{pair:?}");
        }
    }

    #[test]
    fn every_point_is_inserted_once() {
        let positions: Vec<Position> = (0..1000_u64)
            .map(|i| std::array::from_fn(|axis| (mix(i * 6 + axis as u64) >> 11) as f64 / 9.1e15))
            .collect();
        let mut order = insertion_order(&positions);
        order.sort_unstable();
        assert!(order.iter().copied().eq(0..1000));
    }
}
