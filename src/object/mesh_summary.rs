//! What a mesh file holds, before it is an object of a scene.

use super::{LengthUnit, import, topology};
use crate::{Error, scene::Placement};
use glam::DVec3;
use serde::Serialize;
use std::path::Path;

/// Longest body that is taken to be given in metres where no unit is named (m).
const LONGEST: f64 = 2.0;

/// Lengths of bodies that are touched (m).
const LIKELY: std::ops::RangeInclusive<f64> = 1e-3..=LONGEST;

/// A mesh file in numbers. Lengths are in the unit of the file's coordinates.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct MeshSummary {
    /// Nodes of the surface, and all.
    pub surface_nodes: usize,
    /// See `surface_nodes`.
    pub nodes: usize,
    /// Triangles of the surface.
    pub triangles: usize,
    /// Tetrahedra; none in a file of a surface.
    pub tetrahedra: usize,
    /// Connected parts of the surface; zero where it cannot be an object's.
    pub parts: usize,
    /// Least coordinates.
    pub low: DVec3,
    /// Greatest coordinates.
    pub high: DVec3,
    /// Mean length of the surface's edges.
    pub mean_edge: f64,
    /// Volume that the surface encloses.
    pub volume: f64,
    /// The unit that the size suggests, if one does.
    pub unit: Option<LengthUnit>,
    /// What its reader says of it.
    pub warnings: Vec<String>,
    /// Why it cannot be an object, and what to do.
    pub defect: Option<String>,
}

impl MeshSummary {
    /// Returns whether the name of `file` is that of a mesh.
    #[must_use]
    pub fn is_mesh(file: &Path) -> bool {
        import::is_mesh(file)
    }

    /// Reads and checks the mesh in `file`.
    ///
    /// # Errors
    /// When it cannot be read.
    pub fn read(file: &Path) -> Result<Self, Error> {
        let mut warnings = Vec::new();
        let mut body = import::read_body(file, &Placement::METRES, &[], &mut warnings)?;
        let surface = &body.nodes[..body.surface_nodes];
        let closed = topology::close(surface, &mut body.triangles);
        let parts = closed.as_ref().map_or(0, |closed| closed.components.len());
        let defect = match closed {
            Ok(closed) => {
                warnings.extend(closed.warnings);
                None
            }
            Err(defect) => Some(defect),
        };
        let [low, high] = import::corners(&body.nodes);
        Ok(Self {
            surface_nodes: body.surface_nodes,
            nodes: body.nodes.len(),
            triangles: body.triangles.len(),
            tetrahedra: body.tetrahedra.len(),
            parts,
            low,
            high,
            mean_edge: topology::mean_edge(&body.nodes, &body.triangles),
            volume: enclosed(&body.nodes, &body.triangles),
            unit: Some(suggested(high - low))
                .filter(|unit| LIKELY.contains(&(unit.metres() * (high - low).max_element()))),
            warnings,
            defect,
        })
    }
}

/// The unit in which a body of this `size` may be given.
pub(super) fn suggested(size: DVec3) -> LengthUnit {
    if size.max_element() > LONGEST { LengthUnit::Mm } else { LengthUnit::M }
}

/// Volume that the closed surface of `triangles` encloses.
pub(super) fn enclosed(nodes: &[DVec3], triangles: &[[u32; 3]]) -> f64 {
    let corner = |node: u32| nodes.get(node as usize).copied().unwrap_or_default();
    let volumes = triangles.iter().map(|triangle| {
        let [a, b, c] = triangle.map(corner);
        a.dot(b.cross(c)) / 6.0
    });
    volumes.sum::<f64>().abs()
}
