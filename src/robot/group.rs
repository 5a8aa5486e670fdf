//! Links that do not move against each other, as one body.

use super::{Inertial, Link, Placed, Robot};
use crate::proxy::outer;
use glam::{DAffine3, DMat3, DVec3};

/// Rigidly joined links.
#[derive(Default)]
pub(super) struct Group {
    /// Numbers of the links.
    pub links: Vec<usize>,
    /// Their shapes, in the frame of the group.
    pub shapes: Vec<Placed>,
    /// Their inertias, in the frame of the group.
    inertials: Vec<Inertial>,
}

impl Group {
    /// Adds `link`, which is at `place` in the frame of the group.
    pub fn add(&mut self, number: usize, link: &Link, place: DAffine3) {
        self.links.push(number);
        self.shapes.extend(link.shapes.iter().map(|shape| Placed { place: place * shape.place, ..shape.clone() }));
        self.inertials.extend(link.inertial.map(|own| Inertial {
            mass: own.mass,
            centre: place.transform_point3(own.centre),
            inertia: place.matrix3 * own.inertia * place.matrix3.transpose(),
        }));
    }

    /// Returns the group in the frame with the same axes and its origin at `point` (m).
    pub fn about(mut self, point: DVec3) -> Self {
        self.shapes.iter_mut().for_each(|shape| shape.place.translation -= point);
        self.inertials.iter_mut().for_each(|own| own.centre -= point);
        self
    }

    /// Returns mass, centre and inertia of all links together, by the theorem of Huygens and Steiner.
    pub fn inertial(&self) -> Inertial {
        let mass: f64 = self.inertials.iter().map(|own| own.mass).sum();
        let moment: DVec3 = self.inertials.iter().map(|own| own.mass * own.centre).sum();
        let centre = if mass > 0.0 { moment / mass } else { DVec3::ZERO };
        let about_centre = |own: &Inertial| {
            let d = own.centre - centre;
            own.inertia + own.mass * (DMat3::from_diagonal(DVec3::splat(d.length_squared())) - outer(d))
        };
        let inertia = self.inertials.iter().map(about_centre).fold(DMat3::ZERO, |sum, term| sum + term);
        Inertial { mass, centre, inertia: 0.5 * (inertia + inertia.transpose()) }
    }

    /// Returns the names of the links.
    pub fn names(&self, robot: &Robot) -> Vec<String> {
        self.links.iter().map(|&link| robot.links[link].name.clone()).collect()
    }
}
