//! Three joints: linear interpolation on Delaunay tetrahedra.

use super::cloud::JITTER;
use super::{
    cloud::{Cloud, Position},
    interpolant::{Simplex, Triangulation},
    tetrahedra::Tetrahedra,
};
use crate::{Error, MAX_AXES};

/// Tetrahedra of the jittered points of a cloud.
pub(super) struct Space(Tetrahedra);

impl Space {
    pub fn new(cloud: &Cloud) -> Result<Self, Error> {
        Tetrahedra::new(cloud.jittered(JITTER), &cloud.spanning).map(Self)
    }
}

impl Triangulation for Space {
    type Walk = u32;

    fn walk(&self) -> u32 {
        Tetrahedra::no_hint()
    }

    fn simplex(&self, hint: &mut u32, at: &Position) -> Option<Simplex> {
        let vertices = self.0.locate(at, hint)?;
        let mut simplex = [0; MAX_AXES + 1];
        simplex[..4].copy_from_slice(&vertices);
        Some(simplex)
    }

    fn position(&self, vertex: u32) -> &Position {
        &self.0.points[vertex as usize]
    }
}
