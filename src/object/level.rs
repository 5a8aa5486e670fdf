//! Cubes of one size over the box around a closed surface, and what of each lies inside.
//!
//! Lines through points of Gauss, along the axis that the surface in a cube faces most, cross the surface an odd number
//! of times before a point inside; each stretch inside has three points of Gauss. So the surface may lie in the cubes
//! anyhow, and be finer or coarser than they are.

use super::attachment::SurfacePoint;
use super::element::GAUSS;
use crate::{Error, error, scene::GRID_LINE};
use glam::{DVec2, DVec3, IVec3};
use robust::{Coord, orient2d};

/// Lines through a cube along each of two axes: three points of Gauss in each half.
pub(super) const LINES: usize = 6;

/// Ends of a stretch this near to a cube's face lie on it, in cubes (1): far above rounding, and far below what
/// matters.
const FACE: f64 = 1e-9;

/// Most cubes over the box around a surface: their numbers alone take some MB.
const MAX_CUBES: f64 = 1e6;

/// A stretch of one of the lines through a cube, of those of [`line`], that lies inside: from and to, 0 to 1.
pub(super) type Stretch = (u8, [f64; 2]);

/// Cubes of one size.
#[derive(Clone, Copy, Debug)]
pub(super) struct Level {
    pub origin: DVec3,
    /// (m)
    pub size: f64,
    pub counts: IVec3,
}

/// What a cube holds of the body.
pub(super) struct Filling {
    /// Along which axis its lines run.
    pub axis: usize,
    /// What lies inside; none where all does.
    pub inside: Option<Vec<Stretch>>,
}

/// Position 0 to 1 across a cube and weight of line `number`.
pub(super) fn line(number: usize) -> [f64; 2] {
    let [at, weight] = GAUSS[number % 3];
    [0.5 * ((number / 3) as f64 + at), 0.5 * weight]
}

impl Level {
    /// Cubes of `size` over the box around `nodes` (m).
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
            )
            .about("object.elasticity.cell"));
        }
        // In the middle, so that a box of a whole number of cubes is met exactly.
        let origin = low.midpoint(high) - 0.5 * size * counts;
        Ok(Self { origin, size, counts: counts.as_ivec3() })
    }

    /// Cubes `factor` times as large over the same box, from the same corner.
    pub fn coarser(self, factor: i32) -> Self {
        let counts = (self.counts + factor - 1) / factor;
        Self { size: f64::from(factor) * self.size, counts, ..self }
    }

    /// How often these must be halved to be no larger than `size` (m), as far as they can be counted then.
    pub fn halvings(&self, size: f64) -> usize {
        let countable = (MAX_CUBES / self.counts.as_dvec3().element_product()).log2() / 3.0;
        ((self.size / size).log2() - GRID_LINE).ceil().min(countable.floor()) as usize
    }

    /// Cubes that are halved `halvings` times, over the same box.
    pub fn finer(self, halvings: usize) -> Self {
        Self { size: self.size / f64::from(1 << halvings), counts: self.counts << halvings as u32, ..self }
    }

    pub fn number(&self, at: IVec3) -> usize {
        ((at.x * self.counts.y + at.y) * self.counts.z + at.z) as usize
    }

    pub fn cube_at(&self, number: usize) -> IVec3 {
        let (number, counts) = (number as i32, self.counts);
        IVec3::new(number / (counts.y * counts.z), number / counts.z % counts.y, number % counts.z)
    }

    /// Corners of a cube (m).
    pub fn corners(&self, at: IVec3) -> [DVec3; 2] {
        [at, at + 1].map(|at| self.origin + self.size * at.as_dvec3())
    }

    /// The cube that `point` lies in. On a face between two it is the one on the side of the material.
    pub fn place(&self, point: &SurfacePoint) -> IVec3 {
        let at = (point.place - self.origin) / self.size;
        (at - FACE * point.normal).floor().as_ivec3().clamp(IVec3::ZERO, self.counts - 1)
    }

    /// What each cube holds of the inside of the closed surface, if anything. `facing`: the areas of the surface in it
    /// across each axis.
    pub fn fill(&self, nodes: &[DVec3], triangles: &[[u32; 3]], facing: &[DVec3]) -> Vec<Option<Filling>> {
        // Where no surface is, along z.
        let axes: Vec<usize> =
            facing.iter().map(|facing| if *facing == DVec3::ZERO { 2 } else { facing.max_position() }).collect();
        let mut inside = vec![Vec::new(); axes.len()];
        (0..3).for_each(|axis| self.cut(nodes, triangles, axis, &axes, &mut inside));
        let whole = |stretches: &[Stretch]| {
            stretches.len() == LINES * LINES && stretches.iter().all(|(_, ends)| *ends == [0.0, 1.0])
        };
        let filling = |(stretches, axis): (Vec<Stretch>, usize)| {
            (!stretches.is_empty()).then(|| Filling { axis, inside: (!whole(&stretches)).then_some(stretches) })
        };
        inside.into_iter().zip(axes).map(filling).collect()
    }

    /// The narrowest gap that lines cross between two of the surface's `components`, and that cubes bridge: they share one,
    /// or neighbours. Its middle and its width (m).
    pub fn bridged(&self, nodes: &[DVec3], triangles: &[[u32; 3]], components: &[Vec<u32>]) -> Option<(DVec3, f64)> {
        let mut part = vec![0; nodes.len()];
        for (number, component) in components.iter().enumerate() {
            component.iter().for_each(|&node| part[node as usize] = number);
        }
        let mut narrowest: Option<(DVec3, f64)> = None;
        for axis in 0..3 {
            let lines = along(axis, self.counts.to_array())[1] * LINES as i32;
            for (number, heights) in self.crossings(nodes, triangles, axis).iter().enumerate() {
                for gap in heights.get(1..).unwrap_or_default().as_chunks().0 {
                    let [(from, one), (to, other)] = gap.map(|(height, node)| (height, part[node as usize]));
                    let width = self.size * (to - from);
                    if one != other
                        && (to + FACE).floor() - (from - FACE).floor() <= 1.0
                        && narrowest.is_none_or(|(_, narrowest)| width < narrowest)
                    {
                        let [x, y] = [number as i32 / lines, number as i32 % lines].map(line_place);
                        let middle = DVec3::from_array(across(axis, [x, y, 0.5 * (from + to)]));
                        narrowest = Some((self.origin + self.size * middle, width));
                    }
                }
            }
        }
        narrowest
    }

    /// Where each line along `axis` crosses the surface, ascending (cubes), and a node of the triangle there.
    fn crossings(&self, nodes: &[DVec3], triangles: &[[u32; 3]], axis: usize) -> Vec<Vec<(f64, u32)>> {
        let lines = along(axis, self.counts.to_array()).map(|count| LINES as i32 * count);
        let mut crossings = vec![Vec::new(); (lines[0] * lines[1]) as usize];
        for triangle in triangles {
            let corners = triangle.map(|node| {
                DVec3::from_array(along(axis, ((nodes[node as usize] - self.origin) / self.size).to_array()))
            });
            let [a, b, c] = corners;
            let low = (a.min(b).min(c).floor().as_ivec3() * LINES as i32).max(IVec3::ZERO);
            let high = ((a.max(b).max(c).floor().as_ivec3() + 1) * LINES as i32).min(IVec3::from_array(lines));
            for (x, y) in (low.x..high.x).flat_map(|x| (low.y..high.y).map(move |y| (x, y))) {
                if let Some(height) = crossing(corners, DVec2::new(line_place(x), line_place(y))) {
                    crossings[(x * lines[1] + y) as usize].push((height, triangle[0]));
                }
            }
        }
        crossings.iter_mut().for_each(|heights: &mut Vec<(f64, u32)>| heights.sort_by(|a, b| a.0.total_cmp(&b.0)));
        crossings
    }

    /// Adds to `inside` what lies inside the surface, of those cubes whose lines run along `axis`.
    fn cut(&self, nodes: &[DVec3], triangles: &[[u32; 3]], axis: usize, axes: &[usize], inside: &mut [Vec<Stretch>]) {
        let counts = along(axis, self.counts.to_array());
        for (number, heights) in self.crossings(nodes, triangles, axis).iter().enumerate() {
            let (x, y) = (number as i32 / (LINES as i32 * counts[1]), number as i32 % (LINES as i32 * counts[1]));
            let own = (x % LINES as i32 * LINES as i32 + y % LINES as i32) as u8;
            for &[(from, _), (to, _)] in heights.as_chunks().0 {
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
}

impl Filling {
    pub fn stretches(&self) -> impl Iterator<Item = Stretch> + '_ {
        let whole = self.inside.is_none().then(|| (0..(LINES * LINES) as u8).map(|number| (number, [0.0, 1.0])));
        self.inside.iter().flatten().copied().chain(whole.into_iter().flatten())
    }
}

/// Position across all cubes of line `number` of them (cubes).
fn line_place(number: i32) -> f64 {
    f64::from(number / LINES as i32) + line(number as usize % LINES)[0]
}

/// Coordinates with that along `axis` last.
fn along<T: Copy>(axis: usize, coordinates: [T; 3]) -> [T; 3] {
    [1, 2, 3].map(|k| coordinates[(axis + k) % 3])
}

/// The inverse of [`along`].
pub(super) fn across<T: Copy>(axis: usize, coordinates: [T; 3]) -> [T; 3] {
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
