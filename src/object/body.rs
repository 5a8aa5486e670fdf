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
        let [count, tetrahedra] = [self.nodes.len(), self.tetrahedra.len()];
        let is_wild = |nodes: &[u32]| nodes.iter().any(|&node| node as usize >= count);
        let fits = |numbers: usize| numbers == 0 || numbers == tetrahedra;
        let defect = if is_wild(self.mid_nodes.as_flattened()) || !fits(self.mid_nodes.len()) {
            format!("the nodes in the middles of edges do not fit {tetrahedra} tetrahedra and {count} nodes")
        } else if !fits(self.regions.len()) {
            format!("there are {} regions for {tetrahedra} tetrahedra", self.regions.len())
        } else if let Some(corners) = self.tetrahedra.iter().find(|corners| is_wild(*corners)) {
            format!("a tetrahedron has the nodes {corners:?}, of {count}")
        } else if self.surface_nodes > count {
            format!("{} of {count} nodes are on the surface", self.surface_nodes)
        } else {
            return Ok(());
        };
        Err(error!("{defect}: build the object again from its scene"))
    }
}
