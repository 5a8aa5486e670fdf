//! The potential: a torque field that is minus the gradient of one smooth energy, and so makes no energy around any
//! loop.
//!
//! An object of finite stiffness stores `U = 1/2 k depth^2` where contact begins: U and its gradient vanish at the
//! boundary, its curvature jumps there. So not U is interpolated but its signed root, `w = sqrt(2 (U - U_free))`,
//! `dw/dq = -tau / w`, continued to negative values on the free side, which is smooth through the boundary and, for a
//! linear object, linear. Then
//!
//! `U_bar = U_free + 1/2 max(0, w_bar)^2`,  `tau_bar = -dU_bar/dq = -max(0, w_bar) dw_bar/dq`.
//!
//! w_bar is the C1 tensor product of cubic Hermite polynomials (`hermite.rs`): U_bar is C1, tau_bar continuous, equal
//! to the dataset's tau at its points, and errs with h^3 where the field is smooth. It begins at zero at the boundary
//! w_bar = 0, without a jump and so without a boundary layer, which would break the gradient.
//!
//! *Mixed derivatives* of w, which a tensor product needs beside w and its gradient: the second ones follow from the
//! tangent d tau/d q where it is known, `w_ab = -(d tau_a/d q_b + w_a w_b) / w`. All others are differences between
//! neighbouring points of the derivatives of one order less, the mean over the orders of differentiation. Each grid
//! point has one number for each, so that w_bar is C1 whatever they are. On a smooth field tangents leave a fifth to a
//! half of the error of differences; zeros instead of differences for the third ones add 1 to 10 % to it.
//!
//! *Free points* take w and its gradient from the nearest points in contact by Taylor's formula, at most zero. Points
//! that were not computed do so, too, but there w may be positive: the torque goes on where the data end. *Unconverged
//! points* have an energy and a torque that do not belong together: the energy is taken, the gradient from differences
//! of w.
//!
//! Where equilibria change abruptly (the object snaps from one to another), U jumps between two grid points. The field
//! then goes from one to the other within the cell, smoothly, with a torque of about the jump over h.

use super::{
    FieldError,
    hermite::Hermite,
    points::{Checked, Generations},
    stiffness::Stiffness,
};
use crate::{
    JointVector,
    contact::RESIDUAL_FLOOR,
    dataset::{Grid, Stencil},
    memory,
};
use rayon::prelude::*;

/// Least stored energy over that of free space whose square root is distinguished from zero (J): a nanonewton over a
/// femtometre, as in [`RESIDUAL_FLOOR`].
pub const LEAST_ENERGY: f64 = RESIDUAL_FLOOR * RESIDUAL_FLOOR;

/// The potential of one dataset.
pub(super) struct Potential {
    root: Hermite,
    /// U without contact (J).
    free_energy: f64,
}

/// The potential at one configuration.
pub(super) struct Gradient {
    pub torque: JointVector,
    /// U (J).
    pub energy: f64,
    /// Whether w is positive.
    pub contact: bool,
    /// Factor from the multilinear interpolation of w over the corners in contact to w, 0 to 1: contact
    /// forces, which grow like w, end with it at the boundary.
    pub share: f64,
}

impl Potential {
    /// Interpolates the energy of `data`.
    pub fn new(data: &Checked<'_>) -> Result<Self, FieldError> {
        if data.dataset.energy.is_none() {
            return Err(FieldError::Missing { column: "energy", interpolation: "potential" });
        }
        let (grid, count) = (&data.dataset.grid, data.points.len());
        memory::check(Hermite::bytes(grid))?;
        let is_free = |p: &usize| data.points[*p].is_present() && !data.points[*p].in_contact;
        let free_energy = (0..count).find(is_free).map_or(Ok(0.0), |point| data.energy(point))?;
        let zeros = JointVector::zeros(grid.joints());
        let mut root = vec![0.0; count];
        let mut known = vec![false; count];
        for point in 0..count {
            // Checked whether or not it is used.
            let excess = data.energy(point)? - free_energy;
            data.torque(point, &zeros)?;
            if data.points[point].in_contact && excess > LEAST_ENERGY {
                root[point] = (2.0 * excess).sqrt();
                known[point] = true;
            }
        }
        let mut slopes = vec![zeros; count];
        for point in (0..count).filter(|&point| known[point]) {
            for (a, axis) in grid.axes.iter().enumerate() {
                slopes[point][a] = if data.points[point].is_converged() {
                    -data.torque(point, &zeros)?[a] / root[point]
                } else {
                    let [before, after] = grid.beside(point, a).map(|p| p.filter(|&p| known[p]));
                    let apart = f64::from(u8::from(before.is_some()) + u8::from(after.is_some()));
                    let rise = root[after.unwrap_or(point)] - root[before.unwrap_or(point)];
                    if apart > 0.0 { rise / (apart * axis.step) } else { 0.0 }
                };
            }
        }
        let generations = Generations::new(grid, |point| known[point]);
        for &point in &generations.outwards {
            let (mut value, mut slope, mut sources) = (0.0, zeros, 0.0);
            for (axis, distance, source) in generations.nearer(grid, point) {
                value += root[source] + distance * slopes[source][axis];
                slope.iter_mut().zip(slopes[source].iter()).for_each(|(sum, slope)| *sum += slope);
                sources += 1.0;
            }
            slope.iter_mut().for_each(|slope| *slope /= sources);
            value /= sources;
            root[point] = if data.points[point].is_present() { value.min(0.0) } else { value };
            slopes[point] = slope;
        }
        // From d^2 U / dq_a dq_b = w_a w_b + w w_ab, and d tau_a / d q_b = -d^2 U / dq_a dq_b.
        let mixed = |point: usize, a: usize, b: usize| {
            let (row, column) = (a.max(b), a.min(b));
            let tangent = f64::from(data.tangent(point).filter(|_| known[point])?[row * (row + 1) / 2 + column]);
            Some((-tangent - slopes[point][a] * slopes[point][b]) / root[point])
        };
        Ok(Self { root: Hermite::new(grid, &root, &slopes, mixed), free_energy })
    }

    /// The potential in the cell of `stencil`. `N = 4^(D-1)`.
    pub fn at<const D: usize, const N: usize>(&self, stencil: &Stencil) -> Gradient {
        let (root, slopes) = self.root.at::<D, N>(stencil);
        let depth = root.max(0.0);
        let mut torque = JointVector::zeros(D);
        torque.iter_mut().zip(slopes).for_each(|(tau, slope)| *tau = -depth * slope);
        let linear: f64 = stencil.corners().map(|(point, weight)| weight * self.root.value(point).max(0.0)).sum();
        let share = if depth < linear { depth / linear } else { 1.0 };
        Gradient { torque, energy: self.free_energy + 0.5 * depth * depth, contact: root > 0.0, share }
    }

    /// Returns the greatest bound of the stiffness relative to `slopes` over all cells.
    pub fn steepest(&self, grid: &Grid, slopes: &JointVector) -> Stiffness {
        let of_cell = |point: usize| {
            let bounds = self.root.bounds(grid, point).filter(|w| w.greatest > 0.0);
            bounds.map_or_else(Stiffness::default, |w| w.stiffness(slopes))
        };
        (0..grid.points()).into_par_iter().map(of_cell).reduce(Stiffness::default, Stiffness::max)
    }
}
