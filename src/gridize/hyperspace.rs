//! Four to six joints: the Delaunay simplex that holds a position, found without the triangulation.
//!
//! The number of Delaunay simplices explodes with the dimension (5,000 points in 5 dimensions: 741,000 simplices), but
//! the one that holds a given position can be grown and walked to on its own, after DELAUNAYSPARSE (Chang, Watson, Lux,
//! Butt, Cameron and Hong, ACM Transactions on Mathematical Software 46, 2020). So 4 to 6 joints have the same
//! interpolation as 1 to 3 (linear on Delaunay simplices, exact for linear torque, absent outside the convex hull)
//! in memory proportional to the samples.
//!
//! Every facet F of a Delaunay simplex with circumcentre c and radius R bounds a pencil of balls with centres c + t n,
//! n the facet's outward unit normal. A point p beyond F enters the ball at
//! `t_p = (|p - c|^2 - R^2) / (2 n . (p - F))`; the least t_p names the neighbour across F, and no such p means that F
//! lies on the hull. The first simplex grows from a point and its nearest neighbour in the same way, by the least
//! circumsphere. Each step looks at every point once: O(n d).
//!
//! Chosen over three others by measured error (benches/peers/README.md): a moving least squares plane through the
//! nearest samples, the nearest sample, and a thin-plate spline, whose system is dense in n and which extrapolates.

use super::{
    barycentric::barycentric,
    cloud::{Cloud, Position, distance_squared, dot},
    interpolant::{Simplex, Triangulation},
};
use crate::MAX_AXES;
use std::collections::HashMap;

/// [`JITTER`](super::cloud::JITTER) for 4 to 6 joints, where circumspheres are computed in floating point: on a cell of
/// cospherical points squeezed to thickness t the centre is known to about 1e-16 / t, and must be known better than t.
pub(super) const HYPER_JITTER: f64 = 1e-7;

/// A point counts as beyond a facet from this height on: below the jitter, above the rounding of a height.
const HYPER_FACET: f64 = 1e-12;

/// A weight down to minus this counts as inside: the rounding of a weight in a cell of thickness `HYPER_JITTER`.
const HYPER_WEIGHT: f64 = 1e-9;

/// Steps after which a walk in 4 to 6 joints is given up. Walks cross about d n^(1/d) cells; 10^5 samples in 4 joints
/// give 70.
const HYPER_STEPS: usize = 10_000;

/// Cells that one worker keeps in 4 to 6 joints before it starts again: about 500 bytes each.
const HYPER_CELLS: usize = 200_000;

/// Points that answer for their Delaunay simplices one at a time.
pub(super) struct Hyperspace {
    joints: usize,
    points: Vec<Position>,
}

/// A Delaunay simplex with its facets' geometry.
#[derive(Clone)]
struct Cell {
    vertices: Simplex,
    /// Neighbours found so far, opposite to each vertex.
    across: [Across; MAX_AXES + 1],
    /// Entry i: the gradient of the weight of vertex i.
    gradients: [Position; MAX_AXES + 1],
    centre: Position,
    square_radius: f64,
}

#[derive(Clone, Copy, PartialEq)]
enum Across {
    Unknown,
    Hull,
    Cell(u32),
}

/// The cells that one worker has met.
#[derive(Default)]
pub(super) struct HyperWalk {
    cells: Vec<Cell>,
    by_vertices: HashMap<Simplex, u32>,
    here: u32,
}

impl Hyperspace {
    pub fn new(cloud: &Cloud) -> Self {
        Self { joints: cloud.joints, points: cloud.jittered(HYPER_JITTER) }
    }

    fn corners(&self) -> usize {
        self.joints + 1
    }

    /// The cell of `vertices` in `walk`, made when it is new; `None` when they span nothing.
    fn cell(&self, walk: &mut HyperWalk, mut vertices: Simplex) -> Option<u32> {
        let count = self.corners();
        vertices[..count].sort_unstable();
        if let Some(&cell) = walk.by_vertices.get(&vertices) {
            return Some(cell);
        }
        let corners: Vec<&Position> = vertices[..count].iter().map(|&v| &self.points[v as usize]).collect();
        let gradients = weight_gradients(&corners)?;
        let centre = circumcentre(&corners, &gradients);
        let square_radius = distance_squared(corners[0], &centre);
        let index = walk.cells.len() as u32;
        walk.cells.push(Cell { vertices, across: [Across::Unknown; MAX_AXES + 1], gradients, centre, square_radius });
        walk.by_vertices.insert(vertices, index);
        Some(index)
    }

    /// Grows a Delaunay simplex from the point nearest to `at`: each further vertex is the one whose circumsphere with
    /// those before is least.
    fn grow(&self, at: &Position) -> Option<Simplex> {
        let nearest = self.least(|point| Some(distance_squared(point, at)), &[])?;
        let mut vertices = [0; MAX_AXES + 1];
        vertices[0] = nearest;
        let first = self.points[nearest as usize];
        let mut centre = first;
        let mut square_radius = 0.0;
        let mut basis: Vec<Position> = Vec::new();
        for filled in 1..self.corners() {
            let parameter = |point: &Position| {
                let (_, height) = off_span(point, &first, &basis);
                (height > HYPER_FACET).then(|| (distance_squared(point, &centre) - square_radius) / (2.0 * height))
            };
            let next = self.least(parameter, &vertices[..filled])?;
            let point = &self.points[next as usize];
            let shift = parameter(point)?;
            let (direction, _) = off_span(point, &first, &basis);
            for (c, n) in centre.iter_mut().zip(direction) {
                *c += shift * n;
            }
            square_radius += shift * shift;
            basis.push(direction);
            vertices[filled] = next;
        }
        Some(vertices)
    }

    /// The neighbour of `cell` opposite its vertex `slot`: `None` on the hull.
    fn neighbour(&self, cell: &Cell, slot: usize) -> Option<u32> {
        let gradient = cell.gradients[slot];
        let length = dot(&gradient, &gradient).sqrt();
        let outward = gradient.map(|g| -g / length);
        let on_facet = &self.points[cell.vertices[usize::from(slot == 0)] as usize];
        let parameter = |point: &Position| {
            let height = dot(&outward, point) - dot(&outward, on_facet);
            (height > HYPER_FACET)
                .then(|| (distance_squared(point, &cell.centre) - cell.square_radius) / (2.0 * height))
        };
        self.least(parameter, &cell.vertices[..self.corners()])
    }

    /// The point of least `measure` that is not `excluded`.
    fn least(&self, measure: impl Fn(&Position) -> Option<f64>, excluded: &[u32]) -> Option<u32> {
        let mut best = None;
        let mut least = f64::INFINITY;
        for (point, index) in self.points.iter().zip(0..) {
            if let Some(value) = measure(point)
                && value < least
                && !excluded.contains(&index)
            {
                (best, least) = (Some(index), value);
            }
        }
        best
    }

    /// Walks to the cell that holds `at`. Leaves through the facet with the most negative weight; a Delaunay walk never
    /// returns, so the bound on its steps only guards against rounding.
    fn walk_to(&self, walk: &mut HyperWalk, at: &Position) -> Option<Simplex> {
        let steps = HYPER_STEPS;
        for _ in 0..steps {
            let cell = &walk.cells[walk.here as usize];
            let base = &self.points[cell.vertices[self.joints] as usize];
            let offset: Position = std::array::from_fn(|axis| at[axis] - base[axis]);
            let (slot, weight) = (0..self.corners())
                .map(|slot| (slot, dot(&cell.gradients[slot], &offset) + f64::from(slot == self.joints)))
                .fold((0, f64::INFINITY), |least, next| if next.1 < least.1 { next } else { least });
            if weight >= -HYPER_WEIGHT {
                return Some(cell.vertices);
            }
            if cell.across[slot] == Across::Unknown {
                let found = self.neighbour(cell, slot);
                let mut vertices = cell.vertices;
                let here = walk.here as usize;
                walk.cells[here].across[slot] = match found {
                    None => Across::Hull,
                    Some(point) => {
                        vertices[slot] = point;
                        Across::Cell(self.cell(walk, vertices)?)
                    }
                };
            }
            match walk.cells[walk.here as usize].across[slot] {
                Across::Cell(next) => walk.here = next,
                Across::Hull | Across::Unknown => return None,
            }
        }
        None
    }
}

impl Triangulation for Hyperspace {
    type Walk = HyperWalk;

    fn simplex(&self, walk: &mut HyperWalk, at: &Position) -> Option<Simplex> {
        if walk.cells.len() > HYPER_CELLS {
            *walk = HyperWalk::default();
        }
        if walk.cells.is_empty() {
            let first = self.grow(at)?;
            walk.here = self.cell(walk, first)?;
        }
        self.walk_to(walk, at)
    }

    fn position(&self, vertex: u32) -> &Position {
        &self.points[vertex as usize]
    }
}

/// Unit vector and length of the part of `point - origin` off the span of the orthonormal `basis`.
fn off_span(point: &Position, origin: &Position, basis: &[Position]) -> (Position, f64) {
    let mut off: Position = std::array::from_fn(|axis| point[axis] - origin[axis]);
    for direction in basis {
        let along = dot(&off, direction);
        for (x, n) in off.iter_mut().zip(direction) {
            *x -= along * n;
        }
    }
    let height = dot(&off, &off).sqrt();
    (off.map(|x| x / height.max(f64::MIN_POSITIVE)), height)
}

/// Gradients of the weights of the vertices of a simplex; `None` when it is flat.
fn weight_gradients(corners: &[&Position]) -> Option<[Position; MAX_AXES + 1]> {
    let joints = corners.len() - 1;
    let mut gradients = [[0.0; MAX_AXES]; MAX_AXES + 1];
    for axis in 0..joints {
        let mut at = *corners[joints];
        at[axis] += 1.0;
        let weights = barycentric(corners, &at)?;
        for (gradient, weight) in gradients.iter_mut().zip(weights).take(joints) {
            gradient[axis] = weight;
        }
        gradients[joints][axis] = weights[joints] - 1.0;
    }
    Some(gradients)
}

/// Circumcentre: with the last corner as origin, c = 1/2 sum_i |x_i|^2 g_i, because g_i . x_j is one where i = j and
/// zero elsewhere.
fn circumcentre(corners: &[&Position], gradients: &[Position; MAX_AXES + 1]) -> Position {
    let joints = corners.len() - 1;
    let mut centre = *corners[joints];
    for (corner, gradient) in corners.iter().zip(gradients).take(joints) {
        let half_square = 0.5 * distance_squared(corner, corners[joints]);
        for (c, g) in centre.iter_mut().zip(gradient) {
            *c += half_square * g;
        }
    }
    centre
}
