//! A lattice of cubes in a closed surface: a solid without a mesher.
//!
//! Cubes cover the surface, each an element of 27 nodes. One that the surface cuts is integrated over what lies inside,
//! and over the rest with a small factor (finite cells: Parvizian, Düster & Rank 2007). They are smallest where the
//! edges of the surface are shortest, for contact is awaited there; twice, four times, ... as large where the edges are
//! so much longer, and as far inside as they are large, for strain fades with depth. Those that an inclusion cuts are
//! halved until they are small beside it. A node on the face of a larger cube
//! that is none of its nodes hangs on them, by their shape functions, so displacement is continuous.
//!
//! Walls thinner than half a cube have lines in them, but bend as polynomials of a whole cube do. Where the surface only
//! grazes a cube, no line has a stretch in it. Such a cube would be of the material outside alone; it is left out, and
//! the surface follows the nearest one.

use super::attachment::{SurfacePoint, surface_points};
use super::element::{self, CUBE_NODES, GAUSS, Lame, Quadrature};
use super::inclusion::Materials;
use super::level::{Filling, LINES, Level, across, line};
use super::solid::Elements;
use super::spacing::Spacing;
use crate::{Error, error};
use glam::{DVec3, IVec3};
use std::collections::BTreeMap;

/// Factor on the material of a cut cube outside the surface (1). Smaller: K is worse conditioned, by its inverse.
/// Larger: the body is stiffer; at this one compliance is less by some 0.1 %.
const OUTSIDE: f64 = 1e-4;

/// Distance of the points at which the surface is taken to follow the solid, at most, in cubes (1).
const POINT_SPACING: f64 = 0.5;

/// Number of no cube or node.
const ABSENT: u32 = u32::MAX;

/// Cubes that hold a part of a body.
pub(super) struct Lattice {
    /// Finest first, each of cubes twice as large as those before.
    levels: Vec<Level>,
    /// Number in `cubes` of that which covers each of the smallest, or which is nearest to the surface in it; else
    /// [`ABSENT`].
    numbers: Vec<u32>,
    cubes: Vec<Cube>,
    nodes: Vec<DVec3>,
}

struct Cube {
    level: usize,
    at: IVec3,
    /// Nodes that it moves with.
    nodes: Vec<u32>,
    /// Of each of its 27 nodes, those of `nodes` that carry it, with their weights; none where they are the same.
    carriers: Option<Vec<Vec<(usize, f64)>>>,
    filling: Filling,
}

impl Lattice {
    /// Fills the closed surface of `triangles` with cubes of `size` (m) and larger ones, and smaller ones where a sphere of
    /// `materials` cuts them. Returns points on all of the surface, too, each of which has a cube.
    ///
    /// # Errors
    /// When there are too many cubes, or none holds a part of the body.
    pub fn fill(
        size: f64,
        (nodes, triangles): (&[DVec3], &[[u32; 3]]),
        materials: &Materials<'_>,
    ) -> Result<(Self, Vec<SurfacePoint>), Error> {
        let level = Level::around(nodes, size)?;
        let spacing = Spacing::new(nodes, triangles);
        let points = surface_points(nodes, triangles, POINT_SPACING * size);
        let halvings = level.halvings(materials.largest_cut());
        let finest = level.finer(halvings);
        let coarsest = finest.counts.min_element().ilog2();
        // As many as whole ones of the largest size hold.
        let finest = Level { counts: (finest.counts + (1 << coarsest) - 1) >> coarsest << coarsest, ..finest };
        let levels: Vec<Level> = (0..=coarsest).map(|level| finest.coarser(1 << level)).collect();
        let numbers = vec![ABSENT; finest.counts.element_product() as usize];
        let mut lattice = Self { levels, numbers, cubes: Vec::new(), nodes: Vec::new() };
        for (number, level) in lattice.levels.clone().into_iter().enumerate().rev() {
            let mut facing = vec![DVec3::ZERO; level.counts.element_product() as usize];
            let mut is_fine = vec![false; facing.len()];
            for point in &points {
                let cube = level.number(finest.place(point) >> number as u32);
                facing[cube] += point.area * point.normal.abs();
                is_fine[cube] |= spacing.level(triangles[point.triangle], point.weights) + halvings < number;
            }
            let filled = level.fill(nodes, triangles, &facing);
            for (cube, filling) in filled.into_iter().enumerate() {
                let at = level.cube_at(cube);
                let [low, high] = [(at - 1).max(IVec3::ZERO), (at + 2).min(level.counts)];
                let is_covered = lattice.numbers[finest.number(at << number as u32)] != ABSENT;
                let is_halved = number > 0 && materials.cut(level.corners(at)).is_some_and(|size| level.size > size)
                    || within(low, high).any(|at| is_fine[level.number(at)]);
                if let Some(filling) = filling.filter(|_| !is_covered && !is_halved) {
                    for covered in within(at << number as u32, (at + 1) << number as u32) {
                        lattice.numbers[finest.number(covered)] = lattice.cubes.len() as u32;
                    }
                    lattice.cubes.push(Cube { level: number, at, nodes: Vec::new(), carriers: None, filling });
                }
            }
        }
        lattice.number_nodes();
        for point in &points {
            let place = finest.number(finest.place(point));
            if lattice.numbers[place] == ABSENT {
                lattice.numbers[place] = lattice.nearest(point.place)?;
            }
        }
        Ok((lattice, points))
    }

    /// Finds the nodes of all cubes, and what those that hang are carried by.
    fn number_nodes(&mut self) {
        let most = 2 * self.levels[0].counts + 1;
        let mut numbers = vec![ABSENT; most.element_product() as usize];
        for element in 0..self.cubes.len() {
            let mut columns: BTreeMap<usize, usize> = BTreeMap::new();
            let mut nodes = Vec::with_capacity(CUBE_NODES);
            let carriers: Vec<Vec<(usize, f64)>> = (0..CUBE_NODES)
                .map(|a| {
                    let mut carriers = Vec::new();
                    self.carry(self.cubes[element].node(a), 1.0, &mut carriers);
                    carriers
                        .into_iter()
                        .map(|(at, weight)| {
                            let key = ((at.x * most.y + at.y) * most.z + at.z) as usize;
                            let column = *columns.entry(key).or_insert_with(|| {
                                if numbers[key] == ABSENT {
                                    numbers[key] = self.nodes.len() as u32;
                                    let finest = self.levels[0];
                                    self.nodes.push(finest.origin + 0.5 * finest.size * at.as_dvec3());
                                }
                                nodes.push(numbers[key]);
                                nodes.len() - 1
                            });
                            (column, weight)
                        })
                        .collect()
                })
                .collect();
            let hangs = carriers.iter().any(|carriers| carriers.len() > 1);
            let cube = &mut self.cubes[element];
            (cube.nodes, cube.carriers) = (nodes, hangs.then_some(carriers));
        }
    }

    /// Adds to `carriers` the places of the nodes that carry what is at `at`, of weights times `weight`. Places are in
    /// halves of the smallest cubes.
    fn carry(&self, at: IVec3, weight: f64, carriers: &mut Vec<(IVec3, f64)>) {
        let finest = &self.levels[0];
        let [low, high] = [(at - 1).max(IVec3::ZERO) / 2, (at / 2 + 1).min(finest.counts)];
        let beside = within(low, high).map(|cube| self.numbers[finest.number(cube)]).filter(|cube| *cube != ABSENT);
        let beside = beside.map(|cube| &self.cubes[cube as usize]);
        let is_node = |cube: &Cube| (at - cube.node(0)) % (1 << cube.level) == IVec3::ZERO;
        match beside.filter(|cube| !is_node(cube)).max_by_key(|cube| cube.level) {
            None => carriers.push((at, weight)),
            Some(cube) => {
                let inner = (at - cube.node(0)).as_dvec3() / f64::from(2 << cube.level);
                let values = element::cube(inner).0.into_iter().enumerate();
                values
                    .filter(|(_, value)| *value != 0.0)
                    .for_each(|(a, value)| self.carry(cube.node(a), weight * value, carriers));
            }
        }
    }

    /// Number of the cube that is nearest to `place`.
    ///
    /// # Errors
    /// When there is none.
    fn nearest(&self, place: DVec3) -> Result<u32, Error> {
        let distance = |cube: &Cube| {
            let [low, high] = self.level(cube).corners(cube.at);
            place.distance_squared(place.clamp(low, high))
        };
        let distances = self.cubes.iter().map(distance).zip(0..);
        let nearest = distances.min_by(|one, other| one.0.total_cmp(&other.0)).map(|(_, cube)| cube);
        nearest.ok_or_else(|| {
            error!(
                "the object is too thin for cubes of {} m: make object.elasticity.cell smaller, or refine the surface",
                self.levels[0].size
            )
            .about("object.elasticity.cell")
        })
    }

    fn level(&self, cube: &Cube) -> &Level {
        &self.levels[cube.level]
    }

    /// Lowest corner of a cube (m).
    fn low(&self, cube: &Cube) -> DVec3 {
        self.level(cube).corners(cube.at)[0]
    }

    /// Adds a point at `at` in `cube`, 0 to 1 along each axis, of `weight` in cubes.
    fn push(&self, quadrature: &mut Quadrature, cube: &Cube, at: DVec3, weight: f64) {
        let size = self.level(cube).size;
        let (values, mut gradients) = element::cube(at);
        gradients.iter_mut().for_each(|gradient| *gradient /= size);
        let place = self.low(cube) + size * at;
        let (values, gradients) = (cube.carried(&values), cube.carried(&gradients));
        quadrature.push(place, weight * size.powi(3), &values, &gradients, (at - 0.5).extend(1.0));
    }

    /// Adds three points on that part of each stretch of `cube` that lies between `range` on its line, 0 to 1, all of
    /// weight times `factor`.
    fn push_stretches(&self, quadrature: &mut Quadrature, cube: &Cube, [low, high]: [f64; 2], factor: f64) {
        for (number, [from, to]) in cube.filling.stretches() {
            let ([x, wx], [y, wy]) = (line(number as usize / LINES), line(number as usize % LINES));
            let (from, to) = (from.max(low), to.min(high));
            for [z, wz] in GAUSS.into_iter().filter(|_| to > from) {
                let place = DVec3::from_array(across(cube.filling.axis, [x, y, from + z * (to - from)]));
                self.push(quadrature, cube, place, factor * wx * wy * wz * (to - from));
            }
        }
    }

    /// Adds the points of a whole cube, all of weight times `factor`.
    fn push_whole(&self, quadrature: &mut Quadrature, cube: &Cube, factor: f64) {
        for [[x, wx], [y, wy], [z, wz]] in
            GAUSS.into_iter().flat_map(|x| GAUSS.into_iter().flat_map(move |y| GAUSS.map(|z| [x, y, z])))
        {
            self.push(quadrature, cube, DVec3::new(x, y, z), factor * wx * wy * wz);
        }
    }
}

impl Cube {
    /// Place of one of its 27 nodes, in halves of the smallest cubes.
    fn node(&self, a: usize) -> IVec3 {
        (2 * self.at + IVec3::new(a as i32 / 9, a as i32 / 3 % 3, a as i32 % 3)) << self.level as u32
    }

    /// Sums over its 27 nodes as sums over those that it moves with.
    fn carried<T: Copy + Default + std::ops::AddAssign + std::ops::Mul<f64, Output = T>>(&self, of: &[T]) -> Vec<T> {
        let Some(carriers) = &self.carriers else { return of.to_vec() };
        let mut sums = vec![T::default(); self.nodes.len()];
        for (&value, carriers) in of.iter().zip(carriers) {
            carriers.iter().for_each(|&(column, weight)| sums[column] += value * weight);
        }
        sums
    }
}

/// Places from `low` to below `high`.
fn within(low: IVec3, high: IVec3) -> impl Iterator<Item = IVec3> {
    (low.x..high.x)
        .flat_map(move |x| (low.y..high.y).flat_map(move |y| (low.z..high.z).map(move |z| IVec3::new(x, y, z))))
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
        let (low, size) = (self.low(cube), self.level(cube).size);
        let mut quadrature = Quadrature::default();
        let mut lame = Vec::new();
        let factor = if cube.filling.inside.is_some() { 1.0 - OUTSIDE } else { 1.0 };
        if materials.cut([low, low + size]).is_some() {
            for range in [[0.0, 0.5], [0.5, 1.0]] {
                self.push_stretches(&mut quadrature, cube, range, factor);
            }
            let middle = low + 0.5 * size;
            let eighth = |place: DVec3| place.cmpge(middle).bitmask() as usize;
            let means = [0, 1, 2, 3, 4, 5, 6, 7]
                .map(|k| materials.stiff_mean(quadrature.points().filter(|(place, _)| eighth(*place) == k), None));
            lame.extend(quadrature.places.iter().map(|place| {
                let own = materials.at(*place, None);
                means[eighth(*place)].unwrap_or(own)
            }));
        } else {
            match &cube.filling.inside {
                Some(_) => self.push_stretches(&mut quadrature, cube, [0.0, 1.0], factor),
                None => self.push_whole(&mut quadrature, cube, 1.0),
            }
            lame.extend(quadrature.places.iter().map(|place| materials.at(*place, None)));
        }
        if cube.filling.inside.is_some() {
            self.push_whole(&mut quadrature, cube, OUTSIDE);
            lame.resize(quadrature.places.len(), materials.body());
        }
        Ok((quadrature, lame))
    }

    fn kind(&self, element: usize, materials: &Materials<'_>) -> Option<usize> {
        let cube = &self.cubes[element];
        let corners = self.level(cube).corners(cube.at);
        let alike = cube.filling.inside.is_none() && cube.carriers.is_none() && materials.cut(corners).is_none();
        let [low, high] = corners;
        alike.then(|| materials.number(low.midpoint(high), None) * self.levels.len() + cube.level)
    }

    fn below(&self, element: usize, height: f64) -> Quadrature {
        let cube = &self.cubes[element];
        let local = (height - self.low(cube).z) / self.level(cube).size;
        let mut quadrature = Quadrature::default();
        if cube.filling.axis == 2 {
            self.push_stretches(&mut quadrature, cube, [0.0, local], 1.0);
        } else {
            self.push_stretches(&mut quadrature, cube, [0.0, 1.0], 1.0);
            quadrature.keep(|place| place.z < height);
        }
        quadrature
    }

    fn locate(&self, point: &SurfacePoint) -> (usize, Vec<f64>) {
        let finest = &self.levels[0];
        let element = self.numbers[finest.number(finest.place(point))] as usize;
        let cube = &self.cubes[element];
        let inner = (point.place - self.low(cube)) / self.level(cube).size;
        (element, cube.carried(&element::cube(inner.clamp(DVec3::ZERO, DVec3::ONE)).0))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::object::icosphere;
    use crate::scene::ElasticSpec;

    /// The material of a cube does not depend on where points are laid on the surface in it.
    #[test]
    fn every_cube_holds_material_and_a_grazed_one_leaves_its_surface_to_the_nearest() {
        let (nodes, triangles) = icosphere(DVec3::ZERO, 0.05, 10).unwrap();
        let elastic = ElasticSpec { young: 1e4, poisson: 0.45, cell: None, inclusions: Vec::new() };
        let materials = Materials::new(&elastic, &nodes);
        let mut grazing = 0;
        for size in [0.0053, 0.0081, 0.0123] {
            let (lattice, points) = Lattice::fill(size, (&nodes, &triangles), &materials).unwrap();
            assert!(lattice.cubes.iter().all(|cube| cube.filling.stretches().count() > 0), "cubes of {size} m");
            for point in &points {
                let cube = &lattice.cubes[lattice.locate(point).0];
                let [low, high] = lattice.level(cube).corners(cube.at);
                let distance = point.place.distance(point.place.clamp(low, high));
                assert!(distance < size / LINES as f64, "{distance} m from a cube of {size} m");
                grazing += usize::from(distance > 1e-6 * size);
            }
        }
        assert!(grazing > 0, "no cube is grazed");
    }
}
