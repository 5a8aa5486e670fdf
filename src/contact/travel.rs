//! How far the surface has travelled since a configuration was taken up, from pass to pass of detection.

use super::model::Model;
use crate::tolerances::TRAVEL_ROUNDING;
use glam::DVec3;

/// The length of a path.
pub struct Travel {
    /// Whether no pass has been made.
    at_rest: bool,
    /// Surface nodes in the pass before [m].
    positions: Vec<DVec3>,
    /// An upper bound of how far any point of the surface is from where it rests [m].
    pub moved: f64,
    /// An upper bound of how far any has come along its path [m].
    pub travelled: f64,
}

impl Travel {
    /// For the surface of `model`, at rest.
    #[must_use]
    pub fn new(model: &Model) -> Self {
        Self { at_rest: true, positions: model.rest.clone(), moved: 0.0, travelled: 0.0 }
    }

    /// Starts anew from the surface at rest.
    pub fn restart(&mut self) {
        self.at_rest = true;
    }

    /// Goes on in straight lines to the surface displaced by `displacement`, i.e. at `positions` [m].
    pub fn go_on(&mut self, model: &Model, displacement: &[f64], positions: &[DVec3]) {
        if std::mem::take(&mut self.at_rest) {
            self.positions.copy_from_slice(&model.rest);
            self.travelled = 0.0;
        }
        let squares = displacement.as_chunks().0.iter().map(|u| DVec3::from_array(*u).length_squared());
        self.moved = greatest(squares).sqrt() * (1.0 + TRAVEL_ROUNDING);
        let steps = self.positions.iter().zip(positions).map(|(before, position)| position.distance_squared(*before));
        self.travelled = (self.travelled + greatest(steps).sqrt()) * (1.0 + TRAVEL_ROUNDING);
        self.positions.copy_from_slice(positions);
    }
}

/// The greatest number that is one, or zero.
fn greatest(numbers: impl Iterator<Item = f64>) -> f64 {
    numbers.fold(0.0, |greatest, number| if number > greatest { number } else { greatest })
}
