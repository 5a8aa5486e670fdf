//! An object's geometry as columns, and back: a dataset needs neither scene nor mesh file.

use super::{Column, Solid, Surface};
use crate::{
    Error,
    object::{Body, Object},
    scene::ObjectSpec,
};
use glam::DVec3;

impl Surface {
    /// Returns the geometry of `object`.
    #[must_use]
    pub fn of(object: &Object) -> Self {
        let (surface, inner) = object.rest.split_at(object.surface_nodes);
        let numbers = |nodes: &[DVec3]| Column::from(nodes.iter().flat_map(|node| node.to_array()).collect::<Vec<_>>());
        Self {
            nodes: numbers(surface),
            triangles: object.triangles.as_flattened().to_vec().into(),
            solid: (!object.tetrahedra.is_empty()).then(|| Solid {
                inner_nodes: numbers(inner),
                tetrahedra: object.tetrahedra.as_flattened().to_vec().into(),
                mid_nodes: object.mid_nodes.as_flattened().to_vec().into(),
                regions: object.regions.clone().into(),
            }),
        }
    }

    /// Returns where its nodes are at rest (m).
    pub fn places(&self) -> impl Iterator<Item = DVec3> {
        self.nodes.chunks_exact(3).map(DVec3::from_slice)
    }

    /// Returns the nodes of each of its triangles.
    #[must_use]
    pub fn facets(&self) -> &[[u32; 3]] {
        self.triangles.as_chunks().0
    }

    /// Builds the object that was baked; `spec` is that of the dataset's scene. No file is read.
    ///
    /// # Errors
    /// As for [`Object::from_body`].
    pub fn object(&self, spec: &ObjectSpec) -> Result<Object, Error> {
        let mut body = Body {
            nodes: self.places().collect(),
            surface_nodes: self.nodes.len() / 3,
            triangles: self.facets().to_vec(),
            ..Body::default()
        };
        if let Some(Solid { inner_nodes, tetrahedra, mid_nodes, regions }) = &self.solid {
            body.nodes.extend(inner_nodes.chunks_exact(3).map(DVec3::from_slice));
            body.tetrahedra = tetrahedra.as_chunks().0.to_vec();
            body.mid_nodes = mid_nodes.as_chunks().0.to_vec();
            body.regions = regions.to_vec();
        }
        Object::from_body(spec, body)
    }
}
