//! A lattice of cubes in a closed surface: a solid without a mesher.
//!
//! Cubes of one size cover the surface, each an element of 27 nodes. A cube that the surface cuts is integrated over
//! what lies inside, and over the rest with a small factor (finite cells: Parvizian, Düster & Rank 2007). Lines through
//! points of Gauss, along the axis that the surface in the cube faces most, cross the surface an odd number of times
//! before a point inside; each stretch inside has three points of Gauss. So the surface may lie in the lattice anyhow,
//! and be finer or coarser than it.
//!
//! Walls thinner than half a cube have lines in them, but bend as polynomials of a whole cube do.

use super::attachment::SurfacePoint;
use super::element::{CUBE_NODES, GAUSS, Lame, Quadrature, cube};
use super::inclusion::Materials;
use super::solid::Elements;
use crate::{Error, error, scene::GRID_LINE};
use glam::{DVec2, DVec3, IVec3};
use robust::{Coord, orient2d};

/// Factor on the material of a cut cube outside the surface (1). Smaller: K is worse conditioned, by its inverse.
/// Larger: the body is stiffer; at this one compliance is less by some 0.1 %.
const OUTSIDE: f64 = 1e-4;

/// Lines through a cube along each of two axes: three points of Gauss in each half.
const LINES: usize = 6;

/// Ends of a stretch this near to a cube's face lie on it, in cubes (1): far above rounding, and far below what
/// matters.
const FACE: f64 = 1e-9;

/// Most cubes over the box around a surface: their numbers alone take some MB.
const MAX_CUBES: f64 = 1e6;

/// Size of cubes in mean edges of the surface (1): where the surface is as fine as contact needs, three edges along the
/// radius a of contact, these are 0.8 a, at which the compliance under it errs by 2 % (`docs/solids.md`).
const EDGES_PER_CUBE: f64 = 2.4;

/// Distance of the points at which the surface is taken to follow the solid, at most, in cubes (1).
pub(super) const POINT_SPACING: f64 = 0.5;

/// Number of no cube or node.
const ABSENT: u32 = u32::MAX;

/// A stretch of one of the lines through a cube, of those of [`line`], that lies inside: from and to, 0 to 1.
type Stretch = (u8, [f64; 2]);

/// Cubes that hold a part of a body.
pub(super) struct Lattice {
    origin: DVec3,
    size: f64,
    counts: IVec3,
    /// Number of each cube in `cubes`, or [`ABSENT`].
    numbers: Vec<u32>,
    cubes: Vec<Cube>,
    nodes: Vec<DVec3>,
}

struct Cube {
    at: IVec3,
    nodes: [u32; CUBE_NODES],
    /// Along which axis its lines run.
    axis: usize,
    /// What lies inside; none where all does.
    inside: Option<Vec<Stretch>>,
}

/// Position 0 to 1 across a cube and weight of line `number`.
fn line(number: usize) -> [f64; 2] {
    let [at, weight] = GAUSS[number % 3];
    [0.5 * ((number / 3) as f64 + at), 0.5 * weight]
}

/// Size of cubes that suits a surface of `nodes` and of mean edge `edge` (m): no larger than the body's least extent.
pub(super) fn suitable_size(nodes: &[DVec3], edge: f64) -> f64 {
    let low = nodes.iter().copied().fold(DVec3::INFINITY, DVec3::min);
    let high = nodes.iter().copied().fold(DVec3::NEG_INFINITY, DVec3::max);
    (EDGES_PER_CUBE * edge).min((high - low).min_element())
}

impl Lattice {
    /// Fills the closed surface with the cubes. `points`: on all of the surface, so that each has a cube.
    pub fn fill(mut self, nodes: &[DVec3], triangles: &[[u32; 3]], points: &[SurfacePoint]) -> Self {
        let lattice = &mut self;
        let mut facing = vec![DVec3::ZERO; lattice.numbers.len()];
        for point in points {
            facing[lattice.number(lattice.place(point).0)] += point.area * point.normal.abs();
        }
        // Where no surface is, along z.
        let axes: Vec<usize> =
            facing.iter().map(|facing| if *facing == DVec3::ZERO { 2 } else { facing.max_position() }).collect();
        let mut inside = vec![Vec::new(); axes.len()];
        (0..3).for_each(|axis| lattice.cut(nodes, triangles, axis, &axes, &mut inside));
        let held: Vec<bool> =
            inside.iter().zip(&facing).map(|(some, facing)| !some.is_empty() || *facing != DVec3::ZERO).collect();
        let whole = |stretches: &[Stretch]| {
            stretches.len() == LINES * LINES && stretches.iter().all(|(_, ends)| *ends == [0.0, 1.0])
        };
        let most = 2 * lattice.counts + 1;
        let mut numbers = vec![ABSENT; most.element_product() as usize];
        for number in (0..held.len()).filter(|&number| held[number]) {
            let at = lattice.cube_at(number);
            let nodes = std::array::from_fn(|a| {
                let node = 2 * at + IVec3::new(a as i32 / 9, a as i32 / 3 % 3, a as i32 % 3);
                let known = &mut numbers[((node.x * most.y + node.y) * most.z + node.z) as usize];
                if *known == ABSENT {
                    *known = lattice.nodes.len() as u32;
                    lattice.nodes.push(lattice.origin + 0.5 * lattice.size * node.as_dvec3());
                }
                *known
            });
            lattice.numbers[number] = lattice.cubes.len() as u32;
            let stretches = std::mem::take(&mut inside[number]);
            let inside = (!whole(&stretches)).then_some(stretches);
            lattice.cubes.push(Cube { at, nodes, axis: axes[number], inside });
        }
        self
    }

    /// Cubes of `size` over the box around `nodes` (m), none of them in the solid yet.
    ///
    /// # Errors
    /// When there are too many.
    pub fn around(nodes: &[DVec3], size: f64) -> Result<Self, Error> {
        let low = nodes.iter().copied().fold(DVec3::INFINITY, DVec3::min);
        let high = nodes.iter().copied().fold(DVec3::NEG_INFINITY, DVec3::max);
        // A whole number of cubes, however it is rounded, is that number.
        let counts = ((high - low) / size - GRID_LINE).ceil().max(DVec3::ONE);
        let cubes = counts.element_product();
        let countable = cubes <= MAX_CUBES;
        if !countable {
            let length = (high - low).max_element();
            return Err(error!(
                "cells of {size} m make {cubes:.0} cubes of an object that is {length:.3} m long, more than {MAX_CUBES:.0}: \
                 make object.elasticity.cell larger, or scale a mesh that was drawn in millimetres"
            ));
        }
        // In the middle, so that a box of a whole number of cubes is met exactly.
        let origin = low.midpoint(high) - 0.5 * size * counts;
        let numbers = vec![ABSENT; cubes as usize];
        Ok(Self { origin, size, counts: counts.as_ivec3(), numbers, cubes: Vec::new(), nodes: Vec::new() })
    }

    fn number(&self, at: IVec3) -> usize {
        ((at.x * self.counts.y + at.y) * self.counts.z + at.z) as usize
    }

    fn cube_at(&self, number: usize) -> IVec3 {
        let (number, counts) = (number as i32, self.counts);
        IVec3::new(number / (counts.y * counts.z), number / counts.z % counts.y, number % counts.z)
    }

    /// The cube that `point` lies in, and where in it, 0 to 1 along each axis. On a face between two it is the one on
    /// the side of the material.
    fn place(&self, point: &SurfacePoint) -> (IVec3, DVec3) {
        let at = (point.place - self.origin) / self.size;
        let cube = (at - FACE * point.normal).floor().as_ivec3().clamp(IVec3::ZERO, self.counts - 1);
        (cube, (at - cube.as_dvec3()).clamp(DVec3::ZERO, DVec3::ONE))
    }

    /// Adds to `inside` what lies inside the surface, of those cubes whose lines run along `axis`.
    fn cut(&self, nodes: &[DVec3], triangles: &[[u32; 3]], axis: usize, axes: &[usize], inside: &mut [Vec<Stretch>]) {
        let counts = along(axis, self.counts.to_array());
        let lines = counts.map(|count| LINES as i32 * count);
        let place = |number: i32| f64::from(number / LINES as i32) + line(number as usize % LINES)[0];
        let mut crossings: Vec<Vec<f64>> = vec![Vec::new(); (lines[0] * lines[1]) as usize];
        for triangle in triangles {
            let corners = triangle.map(|node| {
                DVec3::from_array(along(axis, ((nodes[node as usize] - self.origin) / self.size).to_array()))
            });
            let [a, b, c] = corners;
            let low = (a.min(b).min(c).floor().as_ivec3() * LINES as i32).max(IVec3::ZERO);
            let high = ((a.max(b).max(c).floor().as_ivec3() + 1) * LINES as i32).min(IVec3::from_array(lines));
            for (x, y) in (low.x..high.x).flat_map(|x| (low.y..high.y).map(move |y| (x, y))) {
                if let Some(height) = crossing(corners, DVec2::new(place(x), place(y))) {
                    crossings[(x * lines[1] + y) as usize].push(height);
                }
            }
        }
        for (number, heights) in crossings.iter_mut().enumerate() {
            heights.sort_by(f64::total_cmp);
            let (x, y) = (number as i32 / lines[1], number as i32 % lines[1]);
            let own = (x % LINES as i32 * LINES as i32 + y % LINES as i32) as u8;
            for &[from, to] in heights.as_chunks().0 {
                let first = (from + FACE).floor().max(0.0) as i32;
                let last = ((to - FACE).floor() as i32).min(counts[2] - 1);
                for z in first..=last {
                    let end = |height: f64| {
                        let at = height - f64::from(z);
                        if at < FACE {
                            0.0
                        } else if at > 1.0 - FACE {
                            1.0
                        } else {
                            at
                        }
                    };
                    let at = across(axis, [x / LINES as i32, y / LINES as i32, z]);
                    let cube = self.number(IVec3::from_array(at));
                    if axes[cube] == axis {
                        inside[cube].push((own, [end(from), end(to)]));
                    }
                }
            }
        }
    }

    /// Adds a point at `at` in `cube`, 0 to 1 along each axis, of `weight` in cubes.
    fn push(&self, quadrature: &mut Quadrature, cube_at: IVec3, at: DVec3, weight: f64) {
        let (values, mut gradients) = cube(at);
        gradients.iter_mut().for_each(|gradient| *gradient /= self.size);
        let place = self.origin + self.size * (cube_at.as_dvec3() + at);
        quadrature.push(place, weight * self.size.powi(3), &values, &gradients, (at - 0.5).extend(1.0));
    }

    /// Adds three points on that part of each stretch of `cube` that lies between `range` on its line, 0 to 1, all of
    /// weight times `factor`.
    fn push_stretches(&self, quadrature: &mut Quadrature, cube: &Cube, [low, high]: [f64; 2], factor: f64) {
        for (number, [from, to]) in cube.stretches() {
            let ([x, wx], [y, wy]) = (line(number as usize / LINES), line(number as usize % LINES));
            let (from, to) = (from.max(low), to.min(high));
            for [z, wz] in GAUSS.into_iter().filter(|_| to > from) {
                let place = DVec3::from_array(across(cube.axis, [x, y, from + z * (to - from)]));
                self.push(quadrature, cube.at, place, factor * wx * wy * wz * (to - from));
            }
        }
    }

    /// Adds the points of a whole cube, all of weight times `factor`.
    fn push_whole(&self, quadrature: &mut Quadrature, at: IVec3, factor: f64) {
        for [[x, wx], [y, wy], [z, wz]] in
            GAUSS.into_iter().flat_map(|x| GAUSS.into_iter().flat_map(move |y| GAUSS.map(|z| [x, y, z])))
        {
            self.push(quadrature, at, DVec3::new(x, y, z), factor * wx * wy * wz);
        }
    }
}

impl Cube {
    fn stretches(&self) -> impl Iterator<Item = Stretch> + '_ {
        let whole = self.inside.is_none().then(|| (0..(LINES * LINES) as u8).map(|number| (number, [0.0, 1.0])));
        self.inside.iter().flatten().copied().chain(whole.into_iter().flatten())
    }
}

/// Coordinates with that along `axis` last.
fn along<T: Copy>(axis: usize, coordinates: [T; 3]) -> [T; 3] {
    [1, 2, 3].map(|k| coordinates[(axis + k) % 3])
}

/// The inverse of [`along`].
fn across<T: Copy>(axis: usize, coordinates: [T; 3]) -> [T; 3] {
    [0, 1, 2].map(|k| coordinates[(k + 2 - axis) % 3])
}

/// Height at which the line through `point` along z crosses the triangle, if it does. A line through an edge crosses
/// just one of the triangles beside it, or both where the surface turns back there.
fn crossing(corners: [DVec3; 3], point: DVec2) -> Option<f64> {
    let flat = corners.map(|corner| corner.truncate());
    let coord = |p: DVec2| Coord { x: p.x, y: p.y };
    let side = |a: DVec2, b: DVec2| orient2d(coord(a), coord(b), coord(point));
    let sides = [0, 1, 2].map(|k| side(flat[(k + 1) % 3], flat[(k + 2) % 3]));
    let double_area = orient2d(coord(flat[0]), coord(flat[1]), coord(flat[2]));
    if double_area == 0.0 {
        return None;
    }
    let holds = |k: usize| {
        let along = double_area.signum() * (flat[(k + 2) % 3] - flat[(k + 1) % 3]);
        let side = double_area.signum() * sides[k];
        side > 0.0 || side == 0.0 && (along.y > 0.0 || along.y == 0.0 && along.x < 0.0)
    };
    (0..3).all(holds).then(|| (0..3).map(|k| sides[k] / double_area * corners[k].z).sum())
}

impl Elements for Lattice {
    fn positions(&self) -> &[DVec3] {
        &self.nodes
    }

    fn count(&self) -> usize {
        self.cubes.len()
    }

    fn nodes(&self, element: usize) -> &[u32] {
        &self.cubes[element].nodes
    }

    fn quadrature(&self, element: usize, materials: &Materials<'_>) -> Result<(Quadrature, Vec<Lame>), Error> {
        let cube = &self.cubes[element];
        let low = self.origin + self.size * cube.at.as_dvec3();
        let mut quadrature = Quadrature::default();
        let mut lame = Vec::new();
        let factor = if cube.inside.is_some() { 1.0 - OUTSIDE } else { 1.0 };
        if materials.is_cut([low, low + self.size]) {
            // Points and materials in each eighth.
            let eighth =
                |k: usize| low + 0.5 * self.size * DVec3::from_array([k / 4, k / 2 % 2, k % 2].map(|i| i as f64));
            let means: Vec<Option<Lame>> =
                (0..8).map(|k| materials.stiff_mean([eighth(k), eighth(k) + 0.5 * self.size])).collect();
            for range in [[0.0, 0.5], [0.5, 1.0]] {
                self.push_stretches(&mut quadrature, cube, range, factor);
            }
            let middle = low + 0.5 * self.size;
            lame.extend(quadrature.places.iter().map(|place| {
                let [x, y, z]: [bool; 3] = place.cmpge(middle).into();
                let own = materials.at(*place, None);
                means[usize::from(x) * 4 + usize::from(y) * 2 + usize::from(z)].unwrap_or(own)
            }));
        } else {
            match &cube.inside {
                Some(_) => self.push_stretches(&mut quadrature, cube, [0.0, 1.0], factor),
                None => self.push_whole(&mut quadrature, cube.at, 1.0),
            }
            lame.extend(quadrature.places.iter().map(|place| materials.at(*place, None)));
        }
        if cube.inside.is_some() {
            self.push_whole(&mut quadrature, cube.at, OUTSIDE);
            lame.resize(quadrature.places.len(), materials.body());
        }
        Ok((quadrature, lame))
    }

    fn kind(&self, element: usize, materials: &Materials<'_>) -> Option<usize> {
        let Cube { at, inside, .. } = &self.cubes[element];
        let low = self.origin + self.size * at.as_dvec3();
        let alike = inside.is_none() && !materials.is_cut([low, low + self.size]);
        alike.then(|| materials.number(low + 0.5 * self.size, None))
    }

    fn below(&self, element: usize, height: f64) -> Quadrature {
        let cube = &self.cubes[element];
        let local = (height - self.origin.z) / self.size - f64::from(cube.at.z);
        let mut quadrature = Quadrature::default();
        if cube.axis == 2 {
            self.push_stretches(&mut quadrature, cube, [0.0, local], 1.0);
        } else {
            self.push_stretches(&mut quadrature, cube, [0.0, 1.0], 1.0);
            quadrature.keep(|place| place.z < height);
        }
        quadrature
    }

    fn locate(&self, point: &SurfacePoint) -> (usize, Vec<f64>) {
        let (at, inner) = self.place(point);
        (self.numbers[self.number(at)] as usize, cube(inner).0.to_vec())
    }
}
