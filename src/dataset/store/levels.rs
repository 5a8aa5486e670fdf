//! A function w over nodes of several levels: the sum of what each level's cell adds.
//!
//! The nodes of a uniform grid are one level, those of a [store](super::Store) several: one look-up serves both. It
//! visits one cell a level, from the base up, until a level has nothing there.

use super::{
    kernel,
    record::{MAX_WIDTH, width},
    space::{Cell, Place, weights},
};
use crate::{JointVector, dataset::Grid};

/// Nodes of a function w.
pub(crate) trait Levels: Send + Sync {
    /// The grid of the base, level 0.
    fn base(&self) -> &Grid;

    /// Number of levels, the base included.
    fn count(&self) -> u32;

    /// Copies the numbers ([`super::record`]) that the blocks of `level` add at the corners of its cell
    /// with first corner `low`: kind by kind, lengths in steps of the level, zeros where there is no node; nothing where
    /// there is no block. `C = 2^d`, `W = width(d)`.
    fn gather<const C: usize, const W: usize>(&self, level: u32, low: &Place, numbers: &mut [[f64; C]; W]) -> Gathered;
}

/// What there is at the corners of a cell.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Gathered {
    /// A block.
    pub found: bool,
    /// All blocks.
    pub whole: bool,
    /// A node.
    pub any: bool,
    /// A node that did not converge.
    pub failed: bool,
}

/// The interpolated function at one configuration.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Root {
    /// w (sqrt(J)).
    pub value: f64,
    /// Its gradient (sqrt(J)/rad or /m).
    pub slopes: JointVector,
    /// Whether the base lacks a block around the configuration.
    pub absent: bool,
    /// Whether a node around the configuration did not converge.
    pub failed: bool,
}

impl Root {
    /// Energy of contact, `U = max(0, w)^2 / 2` (J).
    #[must_use]
    pub fn energy(&self) -> f64 {
        0.5 * self.value.max(0.0).powi(2)
    }

    /// Contact torque, `-dU/dq` where the slopes are the gradient of w: zero at w = 0, without a jump (N m or N).
    #[must_use]
    pub fn torque(&self) -> JointVector {
        self.slopes.scaled(-self.value.max(0.0))
    }
}

/// Evaluates an expression with the constant `$d`, the number of joints `$joints`.
macro_rules! with_joints {
    ($joints:expr, $d:ident => $value:expr) => {
        match $joints {
            1 => with_joints!(@ $d = 1, $value),
            2 => with_joints!(@ $d = 2, $value),
            3 => with_joints!(@ $d = 3, $value),
            4 => with_joints!(@ $d = 4, $value),
            5 => with_joints!(@ $d = 5, $value),
            _ => with_joints!(@ $d = $crate::MAX_AXES, $value),
        }
    };
    (@ $d:ident = $joints:expr, $value:expr) => {{
        const $d: usize = $joints;
        $value
    }};
}
pub(crate) use with_joints;

/// The function of `nodes` in a `cell` of the base. Never allocates.
pub(crate) fn root<N: Levels>(nodes: &N, cell: Cell) -> Root {
    use kernel::rates;
    with_joints!(nodes.base().joints(), D => sum::<N, D, { 1 << D }, { width(D) }, { rates(D) }>(nodes, cell))
}

/// Hands `add` each level with a node around the `cell` of the base: its number, the `W` numbers at the `C` corners of
/// its cell, and that cell. Returns whether the base lacks a block there, and whether a node there did not converge.
fn walk<N: Levels, const C: usize, const W: usize>(
    nodes: &N,
    mut cell: Cell,
    mut add: impl FnMut(u32, &mut [[f64; C]; W], &Cell),
) -> (bool, bool) {
    let (mut absent, mut failed) = (false, false);
    let mut numbers = [[0.0; C]; W];
    for level in 0..nodes.count() {
        if level > 0 {
            cell.halve();
        }
        let gathered = nodes.gather(level, &cell.low, &mut numbers);
        absent |= level == 0 && !gathered.whole;
        failed |= gathered.failed;
        if gathered.any {
            add(level, &mut numbers, &cell);
        }
        if !gathered.found {
            break;
        }
    }
    (absent, failed)
}

/// The sum of the levels, with slopes. `C = 2^D`, `W = width(D)`, `R = rates(D)`.
fn sum<N: Levels, const D: usize, const C: usize, const W: usize, const R: usize>(nodes: &N, cell: Cell) -> Root {
    let (mut value, mut slopes) = (0.0, JointVector::zeros(D));
    let (absent, failed) = walk::<N, C, W>(nodes, cell, |level, numbers, cell| {
        let (added, rates) = kernel::hermite::<D, C, W, R>(numbers, &cell.fractions);
        let rise = f64::from(1_u32 << level);
        value += added;
        slopes.iter_mut().zip(rates).for_each(|(sum, rate)| *sum += rise * rate);
    });
    slopes.iter_mut().zip(&nodes.base().axes).for_each(|(slope, axis)| *slope /= axis.step);
    Root { value, slopes, absent, failed }
}

/// The numbers of `nodes` in a `cell` of the base, each interpolated multilinearly; those of the first axes first, zeros
/// beyond [`width`]. Never allocates.
pub(crate) fn linear<N: Levels>(nodes: &N, cell: Cell) -> [f64; MAX_WIDTH] {
    with_joints!(nodes.base().joints(), D => linear_sum::<N, { 1 << D }, { width(D) }>(nodes, cell))
}

/// The sum of the levels. `C = 2^d`, `W = width(d)`.
fn linear_sum<N: Levels, const C: usize, const W: usize>(nodes: &N, cell: Cell) -> [f64; MAX_WIDTH] {
    let mut sums = [0.0; MAX_WIDTH];
    walk::<N, C, W>(nodes, cell, |_, numbers, cell| {
        let weights = weights::<C>(&cell.fractions);
        for (sum, numbers) in sums.iter_mut().zip(numbers) {
            *sum += numbers.iter().zip(&weights).map(|(number, weight)| weight * number).sum::<f64>();
        }
    });
    sums
}

/// The numbers that `level` of `nodes` adds at the corners of its cell with first corner `low`, kind by kind; `None`
/// where it has nothing there.
pub(crate) fn added<N: Levels>(nodes: &N, level: u32, low: &Place) -> Option<Vec<f64>> {
    with_joints!(nodes.base().joints(), D => {
        let mut numbers = [[0.0; 1 << D]; width(D)];
        let gathered = nodes.gather(level, low, &mut numbers);
        gathered.found.then(|| numbers.as_flattened().to_vec())
    })
}
