//! Nodes, surface and tetrahedra of an object: what a mesh file or a dataset holds of it.

use crate::{Error, error};
use glam::DVec3;

/// The geometry of an object at rest, its surface nodes first.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Body {
    /// Surface nodes, then interior ones (m).
    pub nodes: Vec<DVec3>,
    /// Number of surface nodes.
    pub surface_nodes: usize,
    /// Faces of the surface, facing outward.
    pub triangles: Vec<[u32; 3]>,
    /// Corners of tetrahedra of positive volume; empty for a surface.
    pub tetrahedra: Vec<[u32; 4]>,
    /// Nodes in the middles of each tetrahedron's edges 01, 12, 02, 03, 23 and 13 (Gmsh's order), those of the surface
    /// being surface nodes; empty if the edges are straight and have none.
    pub mid_nodes: Vec<[u32; 6]>,
    /// Physical volume of each tetrahedron, 0 outside all; empty if the mesh names none.
    pub regions: Vec<u32>,
}

impl Body {
    /// A surface.
    #[must_use]
    pub fn shell((nodes, triangles): (Vec<DVec3>, Vec<[u32; 3]>)) -> Self {
        Self { surface_nodes: nodes.len(), nodes, triangles, ..Self::default() }
    }

    /// Refuses node numbers that are out of range. Those of the triangles are checked with the surface.
    pub(super) fn check(&self) -> Result<(), Error> {
        let count = self.nodes.len();
        let wild = |corners: &&[u32; 4]| corners.iter().any(|&corner| corner as usize >= count);
        let is_wild = self.mid_nodes.as_flattened().iter().any(|&node| node as usize >= count);
        if is_wild || !self.mid_nodes.is_empty() && self.mid_nodes.len() != self.tetrahedra.len() {
            return Err(error!(
                "the nodes in the middles of edges do not fit {} tetrahedra and {count} nodes: build the object again \
                 from its scene",
                self.tetrahedra.len()
            ));
        }
        if !self.regions.is_empty() && self.regions.len() != self.tetrahedra.len() {
            let (regions, tetrahedra) = (self.regions.len(), self.tetrahedra.len());
            return Err(error!(
                "there are {regions} regions for {tetrahedra} tetrahedra: build the object again from its scene"
            ));
        }
        match self.tetrahedra.iter().find(wild) {
            Some(corners) => Err(error!(
                "a tetrahedron has the nodes {corners:?}, of {count}: build the object again from its scene"
            )),
            None if self.surface_nodes > count => Err(error!(
                "{} of {count} nodes are on the surface: build the object again from its scene",
                self.surface_nodes
            )),
            None => Ok(()),
        }
    }
}
