//! The time that the linear algebra of a body takes, said before it is spent.
//!
//! Operations are counted from the pattern of the factor, and divided by the speed at which this machine multiplies
//! dense matrices: what takes long is done by such products.

use crate::names::duration;
use faer::{Accum, Mat, Par, linalg::matmul::matmul};
use std::{fmt, sync::OnceLock, time::Instant};

/// Time from which on it is said (s): nobody wonders whether a program still works before.
const LONG: f64 = 2.0;

/// Operations that no core does in [`LONG`] (1): of fewer the speed does not matter.
const FEW: f64 = 1e10;

/// Rows and columns of the matrices that are multiplied to see how fast it goes: they take some milliseconds.
const SIDE: usize = 256;

/// Products that are timed, of which the fastest counts.
const ROUNDS: usize = 3;

/// Speed of a factorisation in that of a dense product (1): its blocks are smaller.
const EFFICIENCY: f64 = 0.5;

/// Operations of the columns of a factor that share `width` columns and have `below` rows under these: the squares of
/// their entries (Davis, Direct Methods for Sparse Linear Systems, 2006, section 4.1).
pub(super) fn factorisation(width: usize, below: usize) -> f64 {
    let [width, below] = [width, below].map(|count| count as f64);
    width * (width + 1.0) * (2.0 * width + 1.0) / 6.0 + below * width * (width + 1.0) + below * below * width
}

/// Says that `what` takes long, if it does: `operations` are additions and multiplications, shared out among `threads`.
pub(super) fn announce(what: impl fmt::Display, operations: f64, threads: usize) {
    if operations > FEW
        && let Some(time) = said(operations / (EFFICIENCY * speed() * threads as f64))
    {
        log::info!("{what} takes about {time}");
    }
}

/// Returns `seconds` in words, if they are many.
fn said(seconds: f64) -> Option<String> {
    (seconds > LONG).then(|| duration(seconds))
}

/// Operations of a dense product on one core in a second.
fn speed() -> f64 {
    static SPEED: OnceLock<f64> = OnceLock::new();
    *SPEED.get_or_init(|| {
        let factor = Mat::from_fn(SIDE, SIDE, |i, j| 1.0 / (1.0 + i as f64 + j as f64));
        let mut product = Mat::zeros(SIDE, SIDE);
        let mut timed = || {
            let begin = Instant::now();
            matmul(product.as_mut(), Accum::Replace, factor.as_ref(), factor.as_ref(), 1.0, Par::Seq);
            begin.elapsed().as_secs_f64()
        };
        let fastest = (0..ROUNDS).map(|_| timed()).fold(f64::INFINITY, f64::min);
        2.0 * (SIDE * SIDE * SIDE) as f64 / fastest.max(f64::MIN_POSITIVE)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn operations_are_the_squares_of_the_entries_of_each_column() {
        for (width, below) in [(1, 0), (1, 7), (6, 0), (5, 12)] {
            let columns = (1..=width).map(|own: usize| ((own + below) * (own + below)) as f64);
            assert_eq!(factorisation(width, below), columns.sum::<f64>(), "{width} and {below}");
        }
    }

    #[test]
    fn what_is_done_at_once_is_not_spoken_of() {
        assert_eq!([0.0, LONG, 35.2, 1000.0].map(said), [None, None, Some("35 s".into()), Some("17 min".into())]);
        assert!(speed() > 0.0 && speed().is_finite());
    }
}
