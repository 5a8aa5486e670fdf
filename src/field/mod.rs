//! The contact torque as a function of configuration: interpolation over the dataset's grid (section 3.1).
//!
//! The scene chooses the way ([`Interpolation`]): `linear` (`linear.rs`) interpolates the torque and holds it behind a
//! boundary layer; `potential` (`potential.rs`) interpolates the energy and takes its gradient, over the points of a
//! uniform grid (`grid_root.rs`) or the nodes of the store that refines one. Both are
//! continuous and without memory. What they share is in `points.rs`: the fade outside the grid, what is said of points
//! that were not computed or did not converge, and the contact index `I(q) = sum_c w_c I_c`, I_c = 1 where a torque is
//! stored (contact, unconverged, overflowed) and 0 at free points.
//!
//! Another way is a variant of [`Interpolation`], a file here that implements `Interpolant`, and its line in
//! [`TorqueField::interpolated`].
//!
//! A field owns a copy of what it needs, interleaved point by point. The real-time thread thus never touches a mapped
//! file, which would end the process when somebody else truncates it.

mod batch;
mod bernstein;
pub mod boundary;
mod flags;
mod grid_root;
mod linear;
mod points;
mod potential;
pub mod range;
mod slip;
mod slope;
mod stiffness;

pub use batch::{check_rows, fill_rows};
pub use flags::Flags;
pub(crate) use grid_root::LEAST_ENERGY;
pub(crate) use slope::GRADIENT_STEP;

use crate::{
    Error, ErrorKind, JointVector,
    contact::{Slip, Status},
    dataset::{Dataset, Grid},
    error,
    scene::Interpolation,
};
use grid_root::GridRoot;
use linear::Linear;
use points::Checked;
use potential::Potential;
use slip::{GridSlips, SlipField};
use std::sync::Arc;

/// The contact torque around one object.
pub struct TorqueField {
    grid: Grid,
    interpolant: Box<dyn Interpolant>,
    /// Absent where the dataset says nothing of it.
    slip: Option<SlipField>,
    has_energy: bool,
    is_potential: bool,
}

/// A way to interpolate.
trait Interpolant: Send + Sync {
    /// [`TorqueField::sample`]. Never allocates.
    fn sample(&self, q: &[f64]) -> Sample;

    /// The torque alone of each row of `q`, to the bit that of [`Interpolant::sample`], to the same row of `torques`; both
    /// of one entry per joint. Never allocates.
    fn torques(&self, q: &[f64], torques: &mut [f64]);

    /// [`TorqueField::relative_stiffness`].
    fn relative_stiffness(&self, slopes: &JointVector) -> f64;

    /// [`TorqueField::tables`].
    fn tables(&self) -> Option<Tables<'_>>;
}

/// The numbers that a look-up over a uniform grid reads, for look-ups elsewhere: in arrays that learners differentiate, on
/// a graphics card.
#[derive(Clone, Copy, Debug)]
pub struct Tables<'a> {
    /// Those of each grid point, in C order. Of a potential w, its gradient and its mixed derivatives in the order of
    /// [`crate::store::record`], lengths in steps of the grid (sqrt(J)); of a linear field the torque (N m or N), the depth
    /// below the boundary (sqrt(J)) and the energy (J).
    pub records: &'a [f64],
    /// Energy of a potential without contact (J).
    pub free_energy: f64,
    /// 1 / Ks of the boundary layer of a linear field, joint by joint (rad/(N m)); a potential has none.
    pub compliance: Option<JointVector>,
}

/// The field at one configuration.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Sample {
    /// tau_bar on the proxy (N m or N).
    pub torque: JointVector,
    /// Interpolated contact index, 0 to 1.
    pub index: f64,
    /// Whether the proxy is beyond the object's boundary; beside points that were not computed, as far as the nearest
    /// ones that were say.
    pub contact: bool,
    /// Object nodes in contact at the heaviest corner in contact; 0 out of contact.
    pub contact_nodes: u32,
    /// Interpolated energy U of the object (J); zero for datasets without it.
    pub energy: f64,
    /// Factor on interpolated contact forces, 0 to 1, so that they begin at the boundary and fade with the torque.
    pub share: f64,
    /// Part of it that the twin of a real object answers, 0 to 1; zero where there is none.
    pub twin: f64,
    /// [`Flags::OUTSIDE`], [`Flags::ABSENT`], [`Flags::UNCONVERGED`], [`Flags::LAYER`].
    pub flags: Flags,
}

impl Sample {
    /// Returns the status of the configuration: [`Status::Outside`] outside the grid or beside a grid point that was
    /// not computed, [`Status::Unconverged`] beside one that did not converge; else whether there is contact.
    #[must_use]
    pub fn status(&self) -> Status {
        if self.flags.intersects(Flags::OUTSIDE | Flags::ABSENT) {
            Status::Outside
        } else if self.flags.contains(Flags::UNCONVERGED) {
            Status::Unconverged
        } else if self.contact {
            Status::Contact
        } else {
            Status::Free
        }
    }
}

/// The error of a dataset that cannot be rendered.
fn unfit(what: impl Into<String>) -> Error {
    Error::new(what).of(ErrorKind::Dataset)
}

impl TorqueField {
    /// The field of `dataset`; a refined one is interpolated by `potential`, whatever `interpolation` says. `threshold`,
    /// Ith (1), and `slope`, Ks of the boundary layer, one per joint (N m/rad), count for `linear` alone; `potential`
    /// takes its mixed derivatives from the dataset's tangents where it has them.
    ///
    /// # Errors
    /// When the dataset is not consistent, holds numbers that are not finite, or lacks the column that `interpolation`
    /// needs; or a parameter is out of its range.
    pub fn interpolated(
        dataset: &Dataset,
        interpolation: Interpolation,
        threshold: f64,
        slope: &JointVector,
    ) -> Result<Self, Error> {
        if !(0.0..1.0).contains(&threshold) {
            return Err(error!(
                "the contact index threshold is {threshold}; it must be at least 0 and below 1 (the paper uses 0.5)"
            ));
        }
        dataset.grid.check().map_err(unfit)?;
        let grid = dataset.grid.clone();
        if slope.len() != grid.joints() || !slope.iter().all(|slope| *slope > 0.0 && slope.is_finite()) {
            return Err(error!(
                "the boundary slope is {slope:?}; it must be one positive number of N m/rad per joint of the dataset"
            ));
        }
        let interpolant: Box<dyn Interpolant> = match (&dataset.refinement, interpolation) {
            (Some(store), _) => Box::new(Potential::new(Arc::clone(store), 0.0)),
            (None, Interpolation::Linear) => Box::new(Linear::new(Checked::new(dataset)?, threshold, slope)?),
            (None, Interpolation::Potential) => Box::new(GridRoot::potential(Checked::new(dataset)?)?),
        };
        let is_potential = dataset.refinement.is_some() || interpolation.is_potential();
        let slip = match (&dataset.refinement, &dataset.slip) {
            (Some(store), _) => store.has_slips().then(|| SlipField::Store(Arc::clone(store))),
            (None, Some(slip)) => Some(SlipField::Grid(GridSlips::new(&Checked::new(dataset)?, slip, is_potential)?)),
            (None, None) => None,
        };
        Ok(Self { grid, interpolant, slip, has_energy: dataset.energy.is_some(), is_potential })
    }

    /// Number of joints d.
    #[must_use]
    pub fn joints(&self) -> usize {
        self.grid.joints()
    }

    /// The grid.
    #[must_use]
    pub fn grid(&self) -> &Grid {
        &self.grid
    }

    /// Whether the dataset has the energy U.
    #[must_use]
    pub fn has_energy(&self) -> bool {
        self.has_energy
    }

    /// Whether it is known how contacts slip.
    #[must_use]
    pub fn has_slip(&self) -> bool {
        self.slip.is_some()
    }

    /// How the contacts slip at `q`, of which `sample` is the field; none out of contact, or where that is not known.
    /// Never allocates.
    #[must_use]
    pub fn slip(&self, q: &[f64], sample: &Sample) -> Slip {
        let Some(slip) = self.slip.as_ref().filter(|_| sample.contact) else { return Slip::default() };
        let fade = if sample.flags.contains(Flags::OUTSIDE) { self.grid.fade(q) } else { 1.0 };
        slip.at(q, if self.is_potential { fade * (2.0 * sample.energy).sqrt() } else { sample.share })
    }

    /// Whether the torque is minus the gradient of [`Sample::energy`] inside the grid.
    #[must_use]
    pub fn is_potential(&self) -> bool {
        self.is_potential
    }

    /// Upper bound of the stiffness of the interpolated torque inside the grid, before any boundary layer, relative to
    /// `slopes`, one per joint (N m/rad): no Frobenius norm of `S^-1/2 (d tau/d q) S^-1/2`, S = diag(slopes), is
    /// greater. One or less: nowhere steeper than `slopes`. It is the layer's Lipschitz bound L for `slopes` = Ks.
    ///
    /// All cells are searched the first time, and not again for the same slopes or multiples of them.
    #[must_use]
    pub fn relative_stiffness(&self, slopes: &JointVector) -> f64 {
        self.interpolant.relative_stiffness(slopes)
    }

    /// The numbers that look-ups read; none where several levels of a store hold them.
    #[must_use]
    pub fn tables(&self) -> Option<Tables<'_>> {
        self.interpolant.tables()
    }

    /// The field at `q`, one entry per joint. Never allocates; takes the same time wherever `q` is.
    #[must_use]
    pub fn sample(&self, q: &[f64]) -> Sample {
        self.interpolant.sample(q)
    }
}

#[cfg(test)]
mod tests;
