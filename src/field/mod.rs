//! The contact torque as a function of configuration: interpolation over the dataset's grid (section 3.1).
//!
//! The scene chooses one of two ways ([`Interpolation`]): `linear` (`layered.rs`) interpolates the torque and holds it
//! behind a boundary layer, `potential` (`potential.rs`) interpolates the energy and takes its gradient; `direct`,
//! which solves contact while it is felt, has `potential` wherever its solution is late. A refined dataset is
//! interpolated by its store, in the store's own way (`refined.rs`). All are continuous and without memory. What they
//! share is here: the cell around q, the fade outside the grid (`dataset/stencil.rs`), what is said of points that were not
//! computed or did not converge, and the contact index `I(q) = sum_c w_c I_c`, I_c = 1 where a torque is stored
//! (contact, unconverged, overflowed) and 0 at free points.
//!
//! A field owns a copy of what it needs, interleaved point by point. The real-time thread thus never touches a mapped
//! file, which would end the process when somebody else truncates it.

mod batch;
mod bernstein;
pub mod boundary;
mod error;
mod flags;
mod hermite;
mod layered;
mod points;
mod potential;
pub mod range;
mod refined;
mod slope;
mod stiffness;
mod work;

pub use batch::{BatchError, check_rows, fill_rows};
pub use error::FieldError;
pub use flags::Flags;
pub(crate) use potential::LEAST_ENERGY;
pub(crate) use slope::GRADIENT_STEP;

use crate::{
    JointVector, MAX_JOINTS,
    contact::Status,
    dataset::{Dataset, Grid, Stencil},
    scene::Interpolation,
    store::{Order, Store},
};
use layered::Layered;
use points::{Checked, Point};
use potential::Potential;
use std::sync::Arc;
use stiffness::Steepest;

/// The contact torque around one object.
pub struct TorqueField {
    grid: Grid,
    source: Source,
    steepest: Steepest,
}

/// Source of answers.
enum Source {
    Grid(OnGrid),
    Store(Arc<Store>),
}

/// Numbers at the points of the grid.
struct OnGrid {
    points: Vec<Point>,
    has_energy: bool,
    interpolant: Interpolant,
}

/// The interpolated quantity.
enum Interpolant {
    Layered(Layered),
    Potential(Potential),
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

/// Flags and contact of a cell's corners, whatever is interpolated.
#[derive(Default)]
struct Corners {
    flags: Flags,
    index: f64,
    contact_nodes: u32,
}

impl TorqueField {
    /// The paper's interpolation, [`Interpolation::Linear`], over `dataset`. `threshold`: Ith (1); `slope`: Ks of the
    /// boundary layer, one per joint (N m/rad).
    ///
    /// # Errors
    /// When the dataset is not consistent, holds numbers that are not finite, or a parameter is out of its range.
    pub fn new(dataset: &Dataset, threshold: f64, slope: &JointVector) -> Result<Self, FieldError> {
        Self::interpolated(dataset, Interpolation::Linear, threshold, slope)
    }

    /// Any interpolation over `dataset`; a refined one is interpolated in the way of its store, whatever
    /// `interpolation` says. `threshold` counts for `linear` alone, `slope` for all but `potential`, which takes its
    /// mixed derivatives from the dataset's tangents where it has them.
    ///
    /// # Errors
    /// As [`TorqueField::new`]; also when the dataset lacks the column that `interpolation` needs.
    pub fn interpolated(
        dataset: &Dataset,
        interpolation: Interpolation,
        threshold: f64,
        slope: &JointVector,
    ) -> Result<Self, FieldError> {
        if !(0.0..1.0).contains(&threshold) {
            return Err(FieldError::Threshold(threshold));
        }
        dataset.grid.check().map_err(FieldError::Grid)?;
        let grid = dataset.grid.clone();
        if slope.len() != grid.joints() || !slope.iter().all(|slope| *slope > 0.0 && slope.is_finite()) {
            return Err(FieldError::Slope(*slope));
        }
        if let Some(store) = &dataset.refinement {
            let source = Source::Store(Arc::clone(store));
            return Ok(Self { grid, source, steepest: Steepest::default() });
        }
        let (points, nearest) = points::survey(dataset)?;
        let data = Checked { dataset, points: &points, nearest: &nearest };
        let interpolant = match interpolation {
            Interpolation::Linear => Interpolant::Layered(Layered::linear(&data, threshold, slope)?),
            Interpolation::Potential | Interpolation::Direct => Interpolant::Potential(Potential::new(&data)?),
        };
        let on_grid = OnGrid { points, has_energy: dataset.energy.is_some(), interpolant };
        Ok(Self { grid, source: Source::Grid(on_grid), steepest: Steepest::default() })
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
        match &self.source {
            Source::Grid(on_grid) => on_grid.has_energy,
            Source::Store(_) => true,
        }
    }

    /// Whether the torque is minus the gradient of [`Sample::energy`] inside the grid.
    #[must_use]
    pub fn is_potential(&self) -> bool {
        match &self.source {
            Source::Grid(on_grid) => matches!(on_grid.interpolant, Interpolant::Potential(_)),
            Source::Store(store) => store.order() == Order::Potential,
        }
    }

    /// Upper bound of the stiffness of the interpolated torque inside the grid, before any boundary layer, relative to
    /// `slopes`, one per joint (N m/rad): no Frobenius norm of `S^-1/2 (d tau/d q) S^-1/2`, S = diag(slopes), is
    /// greater. One or less: nowhere steeper than `slopes`. It is the layer's Lipschitz bound L for `slopes` = Ks.
    ///
    /// A store that grows is bounded as it is when this is called. All cells are searched the first time, and not again
    /// for the same slopes or multiples of them.
    #[must_use]
    pub fn relative_stiffness(&self, slopes: &JointVector) -> f64 {
        match &self.source {
            Source::Grid(OnGrid { interpolant: Interpolant::Layered(layered), .. }) => {
                layered.relative_stiffness(&self.grid, slopes)
            }
            Source::Grid(OnGrid { interpolant: Interpolant::Potential(potential), .. }) => {
                self.steepest.norm(slopes, 0, || potential.steepest(&self.grid, slopes))
            }
            Source::Store(store) => self.steepest.norm(slopes, store.horizon(), || refined::steepest(store, slopes)),
        }
    }

    /// The field at `q`, one entry per joint. Never allocates; takes the same time wherever `q` is.
    #[must_use]
    pub fn sample(&self, q: &[f64]) -> Sample {
        let on_grid = match &self.source {
            Source::Grid(on_grid) => on_grid,
            Source::Store(store) => return refined::sample(&self.grid, store, q, u64::MAX).0,
        };
        let stencil = self.grid.locate(q);
        match self.joints() {
            1 => on_grid.sample_joints::<1, 1>(&stencil),
            2 => on_grid.sample_joints::<2, 4>(&stencil),
            3 => on_grid.sample_joints::<3, 16>(&stencil),
            4 => on_grid.sample_joints::<4, 64>(&stencil),
            5 => on_grid.sample_joints::<5, 256>(&stencil),
            _ => on_grid.sample_joints::<MAX_JOINTS, 1024>(&stencil),
        }
    }

    /// The store of a refined dataset.
    #[must_use]
    pub fn store(&self) -> Option<&Store> {
        match &self.source {
            Source::Store(store) => Some(store),
            Source::Grid(_) => None,
        }
    }

    /// The field of a refined dataset at `q`, of the first `horizon` blocks of its store, and the levels, from the base
    /// up, whose cell around `q` is whole. Other fields have no blocks and no levels. Never allocates.
    #[must_use]
    pub fn sample_within(&self, q: &[f64], horizon: u64) -> (Sample, u32) {
        match &self.source {
            Source::Store(store) => refined::sample(&self.grid, store, q, horizon),
            Source::Grid(_) => (self.sample(q), 0),
        }
    }
}

impl OnGrid {
    /// The field in the cell of `stencil`. `N = 4^(D-1)`.
    fn sample_joints<const D: usize, const N: usize>(&self, stencil: &Stencil) -> Sample {
        let mut corners = Corners::default();
        let mut heaviest = 0.0;
        for (point, weight) in stencil.corners().filter(|(_, weight)| *weight > 0.0) {
            let corner = self.points[point];
            corners.flags |= corner.flags;
            corners.index += if corner.touching { weight } else { 0.0 };
            if corner.in_contact && weight > heaviest {
                (corners.contact_nodes, heaviest) = (corner.contacts, weight);
            }
        }
        if stencil.fade < 1.0 {
            corners.flags |= Flags::OUTSIDE;
        }
        let (mut torque, energy, inside, share);
        match &self.interpolant {
            Interpolant::Layered(layered) => {
                let at = layered.at::<D>(stencil);
                (torque, energy, inside, share) = (at.torque, at.energy, at.depth > 0.0, at.held);
                if at.held < 1.0 {
                    corners.flags |= Flags::LAYER;
                }
            }
            Interpolant::Potential(potential) => {
                let at = potential.at::<D, N>(stencil);
                (torque, energy, inside, share) = (at.torque, at.energy, at.contact, at.share);
            }
        }
        torque.iter_mut().for_each(|tau| *tau *= stencil.fade);
        let contact = inside && stencil.fade > 0.0;
        Sample {
            torque,
            index: corners.index,
            contact,
            contact_nodes: if contact { corners.contact_nodes } else { 0 },
            energy,
            share: share * stencil.fade,
            flags: corners.flags,
        }
    }
}

#[cfg(test)]
use crate as engine;

#[cfg(test)]
#[path = "../../tests/synthetic/mod.rs"]
pub(crate) mod synthetic;

#[cfg(test)]
mod tests;
