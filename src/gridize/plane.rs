//! Two joints: Delaunay triangulation by `spade`, exact for every arrangement of points, with linear or natural
//! neighbour interpolation on it.

use super::{
    HULL_PULL,
    cloud::{JITTER, MERGE_DISTANCE},
};
use super::{
    cloud::{Cloud, Position},
    interpolant::{Interpolant, Simplex, Triangulation, pulled_in},
};
use crate::{Error, MAX_AXES, error};
use spade::{
    DelaunayTriangulation, HasPosition, HierarchyHintGenerator, NaturalNeighbor, Point2, PositionInTriangulation,
    Triangulation as _, handles::FixedVertexHandle,
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

fn triangulate(cloud: &Cloud) -> Result<Mesh, Error> {
    let vertices = cloud.positions.iter().zip(0..).map(|(at, point)| Vertex { position: planar(at), point }).collect();
    Mesh::bulk_load(vertices).map_err(|error| error!("the samples cannot be triangulated: {error}"))
}

/// Triangles in the plane.
pub(super) struct Plane<'a> {
    cloud: &'a Cloud,
    mesh: Mesh,
}

impl<'a> Plane<'a> {
    pub fn new(cloud: &'a Cloud) -> Result<Self, Error> {
        Ok(Self { cloud, mesh: triangulate(cloud)? })
    }
}

impl Triangulation for Plane<'_> {
    type Walk = ();

    fn walk(&self) {}

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

/// Natural neighbour interpolation (Sibson 1981): smooth except at the samples.
pub(super) struct NaturalNeighbours<'a> {
    cloud: &'a Cloud,
    mesh: Mesh,
}

/// Spade's own buffers, which no two threads may share, and its answer.
pub(super) struct NeighbourWalk<'a> {
    neighbours: NaturalNeighbor<'a, Mesh>,
    found: Vec<(FixedVertexHandle, f64)>,
}

impl<'a> NaturalNeighbours<'a> {
    pub fn new(cloud: &'a Cloud) -> Result<Self, Error> {
        Ok(Self { cloud, mesh: triangulate(cloud)? })
    }
}

impl Interpolant for NaturalNeighbours<'_> {
    type Walk<'w>
        = NeighbourWalk<'w>
    where
        Self: 'w;

    fn walk(&self) -> NeighbourWalk<'_> {
        NeighbourWalk { neighbours: self.mesh.natural_neighbor(), found: Vec::new() }
    }

    fn weights(&self, walk: &mut NeighbourWalk<'_>, at: &Position, weights: &mut Vec<(u32, f64)>) {
        walk.neighbours.get_weights(planar(at), &mut walk.found);
        if walk.found.is_empty() {
            walk.neighbours.get_weights(planar(&pulled_in(at, &self.cloud.centre, HULL_PULL)), &mut walk.found);
        }
        weights.clear();
        weights.extend(walk.found.iter().map(|&(vertex, weight)| (self.mesh.vertex(vertex).data().point, weight)));
    }
}
