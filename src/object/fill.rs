//! A lattice of tetrahedra in a closed surface: a solid without a mesher.
//!
//! Cubes of the size that the scene names cover the surface; each is cut into six tetrahedra along one diagonal (Kuhn),
//! alike in all of them, so that neighbours fit. A cube counts by the share of it that lies inside, sampled at 4 x 4 x
//! 4 points (fictitious domain method: Parvizian, Düster & Rank 2007), and not at all where neither a sample nor a
//! surface node lies in it. The surface keeps its own nodes, each tied to the point of the lattice that it lies at by a
//! spring a hundred times as stiff as a cube: the surface moves with the solid, and a force on it goes into the four
//! nodes around.
//!
//! So the surface may be finer or coarser than the lattice. A box that the lattice fits is represented exactly; a
//! curved surface to the order of the cubes' size, and a wall thinner than a cube only by its volume.

use super::ObjectError;
use super::solid::Solid;
use crate::scene::GRID_LINE;
use glam::{DVec3, IVec3};
use std::collections::HashMap;

/// Points along each edge of a cube at which inside is sampled.
const SAMPLES: i32 = 4;

/// Least share of a cube that is taken as filled, so that a cube that the surface hardly enters gives the nodes on it a
/// hold (1).
const LEAST_FILLED: f64 = 1.0 / 64.0;

/// Stiffness of a tie in units of Young's modulus times the cubes' size (1): a cube's own is about one of these, so
/// that ties add one percent to what gives way under a force on one node.
const TIE: f64 = 100.0;

/// Most cubes of a lattice: its factor takes some GB then.
const MAX_CUBES: f64 = 1e6;

/// The steps from corner to corner of the six tetrahedra of a cube: the order in which the coordinates go from 0 to 1.
const PATHS: [[usize; 3]; 6] = [[0, 1, 2], [1, 2, 0], [2, 0, 1], [0, 2, 1], [2, 1, 0], [1, 0, 2]];

/// Fills the surface with cubes of size `cell` (m); appends the lattice's nodes to `nodes`, which are the surface's.
pub(super) fn fill(nodes: &mut Vec<DVec3>, triangles: &[[u32; 3]], cell: f64) -> Result<Solid, ObjectError> {
    let lattice = Lattice::around(nodes, cell)?;
    let places: Vec<(IVec3, DVec3)> = nodes.iter().map(|node| lattice.place(*node)).collect();
    let mut filled = lattice.sample(nodes, triangles);
    for (cube, _) in &places {
        let share = filled.entry(*cube).or_insert(0.0);
        *share = share.max(LEAST_FILLED);
    }
    let mut cubes: Vec<(IVec3, f64)> = filled.into_iter().collect();
    cubes.sort_unstable_by_key(|(cube, _)| cube.to_array());
    let mut numbers: HashMap<IVec3, u32> = HashMap::new();
    let mut number = |corner: IVec3| {
        *numbers.entry(corner).or_insert_with(|| {
            nodes.push(lattice.origin + cell * corner.as_dvec3());
            nodes.len() as u32 - 1
        })
    };
    let mut corners_of = |cube: IVec3, path: [usize; 3]| {
        let mut corner = cube;
        let mut corners = [number(corner); 4];
        for (k, axis) in path.into_iter().enumerate() {
            corner[axis] += 1;
            corners[k + 1] = number(corner);
        }
        corners
    };
    let mut solid = Solid { tie_length: TIE * cell, ..Solid::default() };
    for (cube, share) in cubes {
        for (k, path) in PATHS.into_iter().enumerate() {
            let mut corners = corners_of(cube, path);
            // The first three paths are even permutations, whose tetrahedra have positive volume.
            if k >= 3 {
                corners.swap(2, 3);
            }
            solid.tetrahedra.push(corners);
            solid.filled.push(share);
        }
    }
    for (node, (cube, inner)) in places.into_iter().enumerate() {
        // The tetrahedron around a point is the one whose path takes the greatest coordinate first.
        let mut path = [0, 1, 2];
        path.sort_by(|&a, &b| inner[b].total_cmp(&inner[a]));
        let [first, second, third] = path.map(|axis| inner[axis]);
        let weights = [1.0 - first, first - second, second - third, third];
        solid.ties.push((node as u32, corners_of(cube, path), weights));
    }
    Ok(solid)
}

/// Cubes over a box.
struct Lattice {
    origin: DVec3,
    cell: f64,
    counts: IVec3,
}

impl Lattice {
    fn around(nodes: &[DVec3], cell: f64) -> Result<Self, ObjectError> {
        let low = nodes.iter().copied().fold(DVec3::INFINITY, DVec3::min);
        let high = nodes.iter().copied().fold(DVec3::NEG_INFINITY, DVec3::max);
        // A whole number of cubes, however it is rounded, is that number.
        let counts = ((high - low) / cell - GRID_LINE).ceil().max(DVec3::ONE);
        let cubes = counts.element_product();
        let countable = cubes <= MAX_CUBES;
        if !countable {
            let length = (high - low).max_element();
            return Err(ObjectError::TooManyCubes { cell, length, cubes, limit: MAX_CUBES });
        }
        // In the middle, so that a box of a whole number of cubes is met exactly.
        let origin = low.midpoint(high) - 0.5 * cell * counts;
        Ok(Self { origin, cell, counts: counts.as_ivec3() })
    }

    /// The cube that `point` lies in, and where in it, 0 to 1 along each axis.
    fn place(&self, point: DVec3) -> (IVec3, DVec3) {
        let at = (point - self.origin) / self.cell;
        let cube = at.floor().as_ivec3().clamp(IVec3::ZERO, self.counts - 1);
        (cube, (at - cube.as_dvec3()).clamp(DVec3::ZERO, DVec3::ONE))
    }

    /// Share of each cube that lies inside the surface, of those where it is not zero: lines along z cross it an odd
    /// number of times below a point inside.
    fn sample(&self, nodes: &[DVec3], triangles: &[[u32; 3]]) -> HashMap<IVec3, f64> {
        let step = self.cell / f64::from(SAMPLES);
        let lines = SAMPLES * self.counts;
        // A little off the middle, so that no line meets an edge of a regular mesh.
        let offset = step * DVec3::new(0.5 + 1.3e-5, 0.5 + 0.7e-5, 0.5);
        let mut crossings: Vec<Vec<f64>> = vec![Vec::new(); (lines.x * lines.y) as usize];
        for triangle in triangles {
            let [a, b, c] = triangle.map(|node| nodes[node as usize] - self.origin - offset);
            let area = (b - a).truncate().perp_dot((c - a).truncate());
            let first = (a.min(b).min(c) / step).ceil().as_ivec3().max(IVec3::ZERO);
            let last = (a.max(b).max(c) / step).floor().as_ivec3().min(lines - 1);
            for x in first.x..=last.x {
                for y in first.y..=last.y {
                    let p = DVec3::new(f64::from(x), f64::from(y), 0.0) * step;
                    let share = |b: DVec3, c: DVec3| (b - p).truncate().perp_dot((c - p).truncate()) / area;
                    let (wa, wb, wc) = (share(b, c), share(c, a), share(a, b));
                    if wa >= 0.0 && wb >= 0.0 && wc >= 0.0 {
                        crossings[(x * lines.y + y) as usize].push(wa * a.z + wb * b.z + wc * c.z);
                    }
                }
            }
        }
        let mut filled = HashMap::new();
        for (line, heights) in crossings.iter_mut().enumerate() {
            heights.sort_by(f64::total_cmp);
            let (x, y) = (line as i32 / lines.y, line as i32 % lines.y);
            for inside in heights.chunks_exact(2) {
                let first = ((inside[0] / step).ceil() as i32).max(0);
                let last = ((inside[1] / step).floor() as i32).min(lines.z - 1);
                for z in first..=last {
                    *filled.entry(IVec3::new(x, y, z) / SAMPLES).or_insert(0.0) += f64::from(SAMPLES.pow(3)).recip();
                }
            }
        }
        filled
    }
}
