//! The columns of a dataset as the plane of C-space shows them: names with units, numbers, colours.

use super::palette::Palette;
use crate::{
    contact::Status,
    dataset::{Dataset, Grid},
    draw::colour::ColourMap,
};
use eframe::egui::Color32;

/// Quantity that a cell's colour shows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Column {
    /// Torque of a joint, by its number.
    Torque(usize),
    /// Stored energy U.
    Energy,
    /// Smallest signed distance at rest.
    Gap,
    /// Status of the point.
    Status,
    /// Relative residual.
    Residual,
}

impl Column {
    /// Those that `dataset` has.
    #[must_use]
    pub fn all(dataset: &Dataset) -> Vec<Self> {
        let torques = (0..dataset.grid.joints()).map(Self::Torque);
        let rest = [
            dataset.energy.is_some().then_some(Self::Energy),
            dataset.gap.is_some().then_some(Self::Gap),
            Some(Self::Status),
            dataset.residual.is_some().then_some(Self::Residual),
        ];
        torques.chain(rest.into_iter().flatten()).collect()
    }

    /// With its unit.
    #[must_use]
    pub fn name(self, grid: &Grid) -> String {
        match self {
            Self::Torque(joint) => {
                let axis = &grid.axes[joint];
                let effort = if axis.unit == "m" { "force" } else { "torque" };
                format!("{} {effort} [{}]", axis.name, axis.effort_unit())
            }
            Self::Energy => "energy U [mJ]".into(),
            Self::Gap => "gap [mm]".into(),
            Self::Status => "status".into(),
            Self::Residual => "log10 of residual".into(),
        }
    }

    /// Its number at grid point `point`, in the unit of its name.
    #[must_use]
    pub fn value(self, dataset: &Dataset, point: usize) -> f64 {
        match self {
            Self::Torque(joint) => dataset.torque(point)[joint],
            Self::Energy => dataset.energy.as_ref().map_or(f64::NAN, |energy| 1e3 * energy[point]),
            Self::Gap => dataset.gap.as_ref().map_or(f64::NAN, |gap| 1e3 * f64::from(gap[point])),
            Self::Status => f64::from(dataset.status[point]),
            // Free points have no residual.
            Self::Residual => {
                let residual = dataset.residual.as_ref().map_or(f64::NAN, |residual| residual[point].into());
                if residual > 0.0 { residual.log10() } else { f64::NAN }
            }
        }
    }

    /// Colours over the whole dataset, so that planes can be compared.
    #[must_use]
    pub fn map(self, dataset: &Dataset) -> ColourMap {
        let trusted = (0..dataset.grid.points())
            .filter(|&point| matches!(dataset.status(point), Status::Contact | Status::Free))
            .map(|point| self.value(dataset, point))
            .filter(|value| value.is_finite());
        let [low, high] = trusted.fold([f64::INFINITY, f64::NEG_INFINITY], |[l, h], v| [l.min(v), h.max(v)]);
        match self {
            Self::Torque(_) | Self::Gap => ColourMap::Diverging { bound: low.abs().max(high.abs()) },
            Self::Energy => ColourMap::Root { high },
            Self::Status | Self::Residual => ColourMap::Sequential { low, high },
        }
    }
}

/// Colour of a status wherever colour stands for a status.
#[must_use]
pub fn status_colour(status: Status, palette: &Palette) -> Color32 {
    match status {
        Status::Free => palette.free,
        Status::Contact => palette.ghost,
        Status::Unconverged => palette.flagged,
        Status::Overflow => palette.force,
        Status::Outside => palette.absent,
    }
}
