//! Two joints: Delaunay triangulation by `spade`, exact for every arrangement of points, with linear or natural
//! neighbour interpolation on it.

use super::{
    HULL_PULL,
    cloud::{Cloud, JITTER, MERGE_DISTANCE, Position},
    interpolant::{Simplex, Triangulation, pulled_in},
};
use crate::{Error, MAX_AXES, error};
use spade::{
    DelaunayTriangulation, HasPosition, HierarchyHintGenerator, Point2, PositionInTriangulation, Triangulation as _,
};

type Mesh = DelaunayTriangulation<Vertex, (), (), (), HierarchyHintGenerator<f64>>;

struct Vertex {
    position: Point2<f64>,
    point: u32,
}

impl HasPosition for Vertex {
    type Scalar = f64;
    fn position(&self) -> Point2<f64> {
        self.position
    }
}

/// `at` as spade takes it: it refuses denormal numbers, which the unit box has no use for.
fn planar(at: &Position) -> Point2<f64> {
    let clear = |x: f64| if x.abs() < MERGE_DISTANCE * JITTER { 0.0 } else { x };
    Point2::new(clear(at[0]), clear(at[1]))
}

/// Triangles in the plane.
pub(super) struct Plane<'a> {
    cloud: &'a Cloud,
    mesh: Mesh,
}

impl<'a> Plane<'a> {
    pub fn new(cloud: &'a Cloud) -> Result<Self, Error> {
        let vertex = |(at, point): (&Position, u32)| Vertex { position: planar(at), point };
        let mesh = Mesh::bulk_load(cloud.positions.iter().zip(0..).map(vertex).collect())
            .map_err(|error| error!("the samples cannot be triangulated: {error}"))?;
        Ok(Self { cloud, mesh })
    }

    /// As [`Linear::walk`](super::interpolant::Linear::walk), by natural neighbours (Sibson 1981): smooth except at the
    /// samples.
    pub fn natural_neighbours(&self) -> impl FnMut(&Position, &mut Vec<(u32, f64)>) {
        let (neighbours, mut found) = (self.mesh.natural_neighbor(), Vec::new());
        move |at, weights| {
            neighbours.get_weights(planar(at), &mut found);
            if found.is_empty() {
                neighbours.get_weights(planar(&pulled_in(at, &self.cloud.centre, HULL_PULL)), &mut found);
            }
            weights.clear();
            weights.extend(found.iter().map(|&(vertex, weight)| (self.mesh.vertex(vertex).data().point, weight)));
        }
    }
}

impl Triangulation for Plane<'_> {
    type Walk = ();

    fn simplex(&self, (): &mut (), at: &Position) -> Option<Simplex> {
        let mesh = &self.mesh;
        let face = match mesh.locate(planar(at)) {
            PositionInTriangulation::OnFace(face) => mesh.face(face),
            PositionInTriangulation::OnEdge(edge) => {
                let edge = mesh.directed_edge(edge);
                edge.face().as_inner().or_else(|| edge.rev().face().as_inner())?
            }
            PositionInTriangulation::OnVertex(vertex) => {
                mesh.vertex(vertex).out_edges().find_map(|edge| edge.face().as_inner())?
            }
            PositionInTriangulation::OutsideOfConvexHull(_) | PositionInTriangulation::NoTriangulation => return None,
        };
        let mut simplex = [0; MAX_AXES + 1];
        for (entry, vertex) in simplex.iter_mut().zip(face.vertices()) {
            *entry = vertex.data().point;
        }
        Some(simplex)
    }

    fn position(&self, vertex: u32) -> &Position {
        &self.cloud.positions[vertex as usize]
    }
}
