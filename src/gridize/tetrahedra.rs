//! Delaunay tetrahedralisation of points in general position: Bowyer (1981) and Watson (1981), with exact predicates.
//!
//! A tetrahedron is four vertices, positively oriented (Shewchuk's orient3d > 0), and the four neighbours opposite to
//! them. The outside is tiled too, by ghost tetrahedra that join each hull facet with a vertex at infinity: inserting
//! inside and outside the hull is one case. A point's cavity is the connected set of tetrahedra whose open circumball
//! holds it; its boundary facets, joined with the point, fill it again. Predicates decide by their exact sign
//! (`robust`), so the cavity is star-shaped and no tetrahedron is ever inverted.

use super::{
    cloud::{Cloud, JITTER, Position},
    interpolant::{Simplex, Triangulation},
    order::insertion_order,
};
use crate::{Error, MAX_AXES, error};
use robust::{Coord3D, insphere, orient3d};

/// Simplices that may be created per point before an arrangement is called degenerate. Random points create about 27
/// on the way to 6.8, scan lines up to 60.
const SIMPLICES_PER_POINT: usize = 400;

/// Simplices that any number of points may create.
const FREE_SIMPLICES: usize = 1_000_000;

/// The vertex at infinity.
const INFINITE: u32 = u32::MAX;
/// No tetrahedron.
const NONE: u32 = u32::MAX;

/// A tetrahedralisation with adjacency.
pub(super) struct Tetrahedra {
    points: Vec<Position>,
    vertices: Vec<[u32; 4]>,
    /// Entry i: the tetrahedron across the facet opposite vertex i.
    neighbours: Vec<[u32; 4]>,
    /// A tetrahedron that is alive: where a walk without a hint begins.
    last: u32,
}

/// Scratch memory of the insertion, reused from point to point.
#[derive(Default)]
struct Work {
    /// Stamp of the last point that tested a tetrahedron, twice, plus one when it lay in the cavity.
    marks: Vec<u64>,
    stamp: u64,
    cavity: Vec<u32>,
    boundary: Vec<(u32, usize)>,
    free: Vec<u32>,
    /// Open facets of the new tetrahedra around the new point: edge, tetrahedron, slot.
    open: Vec<((u32, u32), u32, usize)>,
    created: usize,
}

impl Tetrahedra {
    /// Tetrahedralises the jittered points of `cloud`.
    pub fn new(cloud: &Cloud) -> Result<Self, Error> {
        let mut first: [u32; 4] = std::array::from_fn(|k| cloud.spanning[k]);
        let points = cloud.jittered(JITTER);
        let order = insertion_order(&points);
        let mut mesh = Self { points, vertices: Vec::new(), neighbours: Vec::new(), last: 0 };
        if mesh.orientation(&first) < 0.0 {
            first.swap(0, 1);
        }
        mesh.begin(first);
        let limit = SIMPLICES_PER_POINT * mesh.points.len() + FREE_SIMPLICES;
        let mut work = Work { marks: vec![0; mesh.vertices.len()], ..Work::default() };
        for point in order {
            if first.contains(&point) {
                continue;
            }
            mesh.insert(point, &mut work);
            if work.created > limit {
                let points = mesh.points.len();
                return Err(error!(
                    "triangulating {points} samples passed the limit of {limit} simplices: their arrangement is degenerate \
                     (two skew lines, say); decimate them"
                ));
            }
        }
        Ok(mesh)
    }

    fn coordinate(&self, vertex: u32) -> Coord3D<f64> {
        let [x, y, z, ..] = self.points[vertex as usize];
        Coord3D { x, y, z }
    }

    fn orientation(&self, v: &[u32; 4]) -> f64 {
        let [a, b, c, d] = v.map(|vertex| self.coordinate(vertex));
        orient3d(a, b, c, d)
    }

    /// The first tetrahedron and its four ghosts.
    fn begin(&mut self, first: [u32; 4]) {
        self.vertices.push(first);
        self.neighbours.push([1, 2, 3, 4]);
        for slot in 0..4 {
            // Two other vertices change places: seen from outside, the facet has the opposite orientation.
            let (a, b) = ((slot + 1) % 4, (slot + 2) % 4);
            let mut ghost = first;
            ghost[slot] = INFINITE;
            ghost.swap(a, b);
            let mut around = [1, 2, 3, 4];
            around[slot] = 0;
            around.swap(a, b);
            self.vertices.push(ghost);
            self.neighbours.push(around);
        }
    }

    /// Visibility walk: leaves through any facet that has `at` on its far side. On a Delaunay triangulation it never
    /// returns to a tetrahedron (Devillers, Pion and Teillaud 2002). Ends in the tetrahedron that holds `at`, or in a
    /// ghost whose facet sees it.
    fn walk(&self, at: &Position, from: u32) -> u32 {
        let at = Coord3D { x: at[0], y: at[1], z: at[2] };
        let mut here = from;
        let mut came_from = NONE;
        if let Some(slot) = self.infinite_slot(here) {
            here = self.neighbours[here as usize][slot];
        }
        'walk: loop {
            let vertices = self.vertices[here as usize];
            let corners = vertices.map(|vertex| self.coordinate(vertex));
            for slot in 0..4 {
                let next = self.neighbours[here as usize][slot];
                if next == came_from {
                    continue;
                }
                let mut moved = corners;
                moved[slot] = at;
                if orient3d(moved[0], moved[1], moved[2], moved[3]) < 0.0 {
                    came_from = here;
                    here = next;
                    if self.infinite_slot(here).is_some() {
                        return here;
                    }
                    continue 'walk;
                }
            }
            return here;
        }
    }

    fn infinite_slot(&self, tetrahedron: u32) -> Option<usize> {
        self.vertices[tetrahedron as usize].iter().position(|&vertex| vertex == INFINITE)
    }

    /// True when the open circumball of `tetrahedron` holds `at`. A ghost's ball is the open half-space beyond its
    /// facet, and the facet's own circumdisc.
    fn conflicts(&self, tetrahedron: u32, at: Coord3D<f64>) -> bool {
        let vertices = self.vertices[tetrahedron as usize];
        let Some(slot) = self.infinite_slot(tetrahedron) else {
            let [a, b, c, d] = vertices.map(|vertex| self.coordinate(vertex));
            return insphere(a, b, c, d, at) > 0.0;
        };
        let corners: [_; 4] = std::array::from_fn(|i| if i == slot { at } else { self.coordinate(vertices[i]) });
        let side = orient3d(corners[0], corners[1], corners[2], corners[3]);
        side > 0.0 || side == 0.0 && self.conflicts(self.neighbours[tetrahedron as usize][slot], at)
    }

    fn insert(&mut self, point: u32, work: &mut Work) {
        let position = self.points[point as usize];
        let at = self.coordinate(point);
        let start = self.walk(&position, self.last);
        if !self.conflicts(start, at) {
            return; // the point is a vertex already
        }
        self.dig(start, at, work);
        work.open.clear();
        for index in 0..work.boundary.len() {
            let (outside, back) = work.boundary[index];
            let inside = self.neighbours[outside as usize][back];
            let slot = self.slot_towards(inside, outside);
            let mut vertices = self.vertices[inside as usize];
            vertices[slot] = point;
            let new = self.allocate(vertices, work);
            self.neighbours[new as usize][slot] = outside;
            self.neighbours[outside as usize][back] = new;
            for other in (0..4).filter(|&other| other != slot) {
                self.join(new, other, slot, &mut work.open);
            }
            self.last = new;
        }
        work.free.append(&mut work.cavity);
    }

    /// Finds the cavity around `at` and its boundary, as (tetrahedron outside, slot that faces the cavity).
    fn dig(&self, start: u32, at: Coord3D<f64>, work: &mut Work) {
        work.stamp += 2;
        let (kept, dug) = (work.stamp, work.stamp + 1);
        work.cavity.clear();
        work.boundary.clear();
        work.cavity.push(start);
        work.marks[start as usize] = dug;
        let mut next = 0;
        while next < work.cavity.len() {
            let here = work.cavity[next];
            next += 1;
            for neighbour in self.neighbours[here as usize] {
                let mark = work.marks[neighbour as usize];
                if mark == dug {
                    continue;
                }
                if mark != kept && self.conflicts(neighbour, at) {
                    work.marks[neighbour as usize] = dug;
                    work.cavity.push(neighbour);
                    continue;
                }
                work.marks[neighbour as usize] = kept;
                work.boundary.push((neighbour, self.slot_towards(neighbour, here)));
            }
        }
    }

    fn slot_towards(&self, tetrahedron: u32, neighbour: u32) -> usize {
        self.neighbours[tetrahedron as usize].iter().position(|&n| n == neighbour).unwrap_or(0)
    }

    fn allocate(&mut self, vertices: [u32; 4], work: &mut Work) -> u32 {
        work.created += 1;
        if let Some(index) = work.free.pop() {
            self.vertices[index as usize] = vertices;
            self.neighbours[index as usize] = [NONE; 4];
            return index;
        }
        self.vertices.push(vertices);
        self.neighbours.push([NONE; 4]);
        work.marks.push(0);
        (self.vertices.len() - 1) as u32
    }

    /// Joins facet `slot` of `new` with the new tetrahedron that shares it: both hold the new point (`point_slot`) and
    /// one edge of the cavity's boundary.
    fn join(&mut self, new: u32, slot: usize, point_slot: usize, open: &mut Vec<((u32, u32), u32, usize)>) {
        let vertices = self.vertices[new as usize];
        let mut edge = (0..4).filter(|&i| i != slot && i != point_slot).map(|i| vertices[i]);
        let (a, b) = (edge.next().unwrap_or(INFINITE), edge.next().unwrap_or(INFINITE));
        let edge = (a.min(b), a.max(b));
        if let Some(found) = open.iter().position(|(key, ..)| *key == edge) {
            let (_, other, other_slot) = open.swap_remove(found);
            self.neighbours[new as usize][slot] = other;
            self.neighbours[other as usize][other_slot] = new;
        } else {
            open.push((edge, new, slot));
        }
    }
}

impl Triangulation for Tetrahedra {
    /// Where the last walk ended.
    type Walk = Option<u32>;

    fn simplex(&self, hint: &mut Option<u32>, at: &Position) -> Option<Simplex> {
        let found = self.walk(at, hint.unwrap_or(self.last));
        *hint = Some(found);
        let vertices = self.vertices[found as usize];
        let mut simplex = [0; MAX_AXES + 1];
        simplex[..4].copy_from_slice(&vertices);
        (!vertices.contains(&INFINITE)).then_some(simplex)
    }

    fn position(&self, vertex: u32) -> &Position {
        &self.points[vertex as usize]
    }
}
