//! The surface at rest: what of its geometry is computed once and shared by all threads.

use super::bounding_volumes::BoundingVolumes;
use super::closest_point::{ClosestPoint, Feature};
use super::distance_bounds::DistanceBounds;
use super::facet::Facet;
use super::nearest::Closest;
use super::normals;
use super::smooth::{Shape, SmoothSurface, across};
use crate::object::{Object, Topology};
use crate::scene::ContactSurface;
use glam::DVec3;
use std::borrow::Borrow;

/// A closed surface of triangles at rest, prepared for searches.
///
/// Contact is with the triangles themselves, or with the smooth surface that they span. Searches go through the flat
/// triangles; a smooth facet is nowhere farther from its triangle than the bulge.
pub struct RestSurface<'a> {
    /// Middle of the surface's box (m). All contact geometry is relative to it, so that an object far from the world's
    /// origin loses no digits.
    pub centre: DVec3,
    /// Distance of the farthest node from the centre (m).
    pub extent: f64,
    /// Positions of the nodes, relative to the centre (m).
    pub positions: Vec<DVec3>,
    /// Nodes of each triangle, anticlockwise seen from outside.
    pub triangles: &'a [[u32; 3]],
    /// Which triangles lie side by side.
    pub topology: &'a Topology,
    /// The triangles, for closest-point queries.
    pub bounds: BoundingVolumes,
    /// Bounds on the distance to the flat triangles, without such a query.
    distance_bounds: DistanceBounds,
    /// The smooth surface, where contact is with that.
    pub smooth: Option<SmoothSurface>,
    /// The facets at rest.
    facets: Vec<Facet>,
    /// By how much its facets stand off the flat triangles at most; zero where there is none (m).
    pub bulge: f64,
    /// Mean length of the edges (m).
    pub mean_edge: f64,
    /// Unit normals of the triangles.
    pub normals: Vec<DVec3>,
    /// Angle-weighted pseudonormals of the nodes, not of length one.
    pub pseudonormals: Vec<DVec3>,
}

impl<'a> RestSurface<'a> {
    /// The surface of `object`, as contact is to feel it.
    #[must_use]
    pub fn new(object: &'a Object, felt: ContactSurface) -> Self {
        let Object { triangles, topology, .. } = object;
        let nodes = &object.rest[..object.surface_nodes];
        let low = nodes.iter().copied().fold(DVec3::MAX, DVec3::min);
        let high = nodes.iter().copied().fold(DVec3::MIN, DVec3::max);
        let centre = low.midpoint(high);
        let positions: Vec<DVec3> = nodes.iter().map(|&position| position - centre).collect();
        let pseudonormal = |t, feature| normals::pseudonormal(&positions, triangles, topology, t, feature);
        let mut pseudonormals = vec![DVec3::ZERO; positions.len()];
        for (t, triangle) in triangles.iter().enumerate() {
            for (k, &node) in triangle.iter().enumerate() {
                pseudonormals[node as usize] = pseudonormal(t, Feature::Vertex(k));
            }
        }
        let mut surface = Self {
            centre,
            extent: positions.iter().map(|position| position.length()).fold(0.0, f64::max),
            bounds: BoundingVolumes::new(&positions, triangles),
            distance_bounds: DistanceBounds::none(),
            smooth: None,
            facets: triangles.iter().map(|&triangle| Facet::flat(normals::corners(&positions, triangle))).collect(),
            bulge: 0.0,
            mean_edge: normals::mean_edge(&positions, triangles),
            normals: (0..triangles.len()).map(|t| pseudonormal(t, Feature::Face)).collect(),
            pseudonormals,
            positions,
            triangles,
            topology,
        };
        surface.distance_bounds = DistanceBounds::new(&surface);
        if felt == ContactSurface::Smooth {
            let smooth = SmoothSurface::new(&surface.positions, triangles, topology);
            surface.facets = (0..triangles.len() as u32).map(|t| smooth.facet(&surface.positions, t)).collect();
            surface.bulge = smooth.bulge(&surface.positions, &surface.facets);
            surface.smooth = Some(smooth);
        }
        surface
    }

    /// Bounds on the distance to the flat triangles.
    #[must_use]
    pub(crate) fn distance_bounds(&self) -> &DistanceBounds {
        &self.distance_bounds
    }

    /// A lower bound of the signed distance of `x`, and a triangle near by, if one is known (m).
    #[inline]
    #[must_use]
    pub fn distance_bound(&self, x: DVec3) -> (f64, Option<u32>) {
        // Beyond the lattice of bounds the surface's box bounds the distance.
        let (bound, near) = match self.distance_bounds.at(x) {
            Some((bound, near)) => (bound, Some(near)),
            None => (self.bounds.distance_squared(x).sqrt(), None),
        };
        (bound - self.bulge, near)
    }

    /// The nodes on which facet `t` depends, its corners first, and where it is smooth how it hangs on them.
    #[inline]
    #[must_use]
    pub fn carriers(&self, t: u32) -> (&[u32], Option<&Shape>) {
        match &self.smooth {
            None => (&self.triangles[t as usize], None),
            Some(smooth) => (smooth.nodes(t), Some(smooth.shape(t))),
        }
    }

    /// Facet `t` with nodes at `positions`, relative to the centre (m).
    #[inline]
    #[must_use]
    pub fn facet(&self, positions: &[DVec3], t: u32) -> Facet {
        match &self.smooth {
            None => Facet::flat(normals::corners(positions, self.triangles[t as usize])),
            Some(smooth) => smooth.facet(positions, t),
        }
    }

    /// Facet `t` at rest (m).
    #[inline]
    #[must_use]
    pub fn facet_at_rest(&self, t: u32) -> &Facet {
        &self.facets[t as usize]
    }

    /// Pseudonormal at `point` of facet `t`, outward, not of length one, with nodes at `positions`; see [`normals`].
    #[must_use]
    pub fn pseudonormal(&self, positions: &[DVec3], t: u32, point: &ClosestPoint) -> DVec3 {
        if self.smooth.is_none() {
            return normals::pseudonormal(positions, self.triangles, self.topology, t as usize, point.feature);
        }
        self.smooth_pseudonormal(|t| self.facet(positions, t as u32), t as usize, point)
    }

    /// The same of a smooth surface with these facets.
    fn smooth_pseudonormal<F: Borrow<Facet>>(
        &self,
        facet: impl Fn(usize) -> F,
        t: usize,
        point: &ClosestPoint,
    ) -> DVec3 {
        let (triangles, topology) = (self.triangles, self.topology);
        match point.feature {
            Feature::Face => facet(t).borrow().normal(point.weights),
            Feature::Edge(k) => {
                let (other, back) = across(triangles, topology, t, k);
                let mut there = [0.0; 3];
                (there[back], there[(back + 1) % 3]) = (point.weights[(k + 1) % 3], point.weights[k]);
                facet(t).borrow().normal(point.weights) + facet(other).borrow().normal(there)
            }
            Feature::Vertex(k) => {
                let node = triangles[t][k];
                let around = topology.triangles_around(node as usize).iter().map(|&around| {
                    let corner = triangles[around as usize].iter().position(|&corner| corner == node).unwrap_or(0);
                    let mut there = [0.0; 3];
                    there[corner] = 1.0;
                    let facet = facet(around as usize);
                    facet.borrow().normal(there) * facet.borrow().angle(corner)
                });
                around.sum()
            }
        }
    }

    /// The same at rest.
    #[must_use]
    pub fn pseudonormal_at_rest(&self, t: u32, point: &ClosestPoint) -> DVec3 {
        let t = t as usize;
        if self.smooth.is_some() {
            return self.smooth_pseudonormal(|t| self.facet_at_rest(t as u32), t, point);
        }
        match point.feature {
            Feature::Face => self.normals[t],
            Feature::Edge(k) => self.normals[t] + self.normals[self.topology.across[t][k] as usize],
            Feature::Vertex(k) => self.pseudonormals[self.triangles[t][k] as usize],
        }
    }

    /// Closest feature to `x`; `near` is a triangle near by, if any is known.
    #[must_use]
    pub fn closest(&self, x: DVec3, near: u32) -> Closest {
        let mut closest = Closest::none();
        if (near as usize) < self.triangles.len() {
            closest.consider(x, self.facet_at_rest(near), near, f64::MAX);
        }
        self.bounds.search(x, closest.within(self.bulge), |t| {
            if t != near {
                let least = closest.distance_squared.sqrt();
                closest.consider(x, self.facet_at_rest(t), t, least);
            }
            closest.within(self.bulge)
        });
        closest
    }

    /// Distance of `x` to the surface, negative inside; `near` is a triangle near by, if any is known (m).
    #[must_use]
    pub fn signed_distance(&self, x: DVec3, near: u32) -> f64 {
        let closest = self.closest(x, near);
        let distance = closest.distance_squared.sqrt();
        if self.is_inside(x, &closest) { -distance } else { distance }
    }

    /// Whether `x`, to which `closest` is closest, lies inside.
    #[must_use]
    pub fn is_inside(&self, x: DVec3, closest: &Closest) -> bool {
        if closest.triangle == u32::MAX {
            return false;
        }
        let (facet, point) = (self.facet_at_rest(closest.triangle), &closest.point);
        let jet = facet.jet(point.weights);
        let outward = if point.feature == Feature::Face {
            let [first, second] = jet.face_tangents();
            first.cross(second)
        } else {
            self.pseudonormal_at_rest(closest.triangle, point)
        };
        (jet.point - x).dot(outward) > 0.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Random;
    use crate::scene::Scene;
    use std::path::Path;

    const RADIUS: f64 = 0.05;

    fn sphere(divisions: u32) -> Object {
        let text = format!(
            "[object]\nsphere = {{ radius = {RADIUS}, subdivisions = {divisions} }}\n\
             skin = {{ tension = 1.0, foundation = 1.0 }}\n\
             [[proxy.joint]]\nkind = \"prismatic\"\naxis = [1.0, 0.0, 0.0]\nlimits = [0.0, 1.0]\n\
             nodes = [{{ at = [0.0, 0.0, 0.0] }}]\n\
             [contact]\nstiffness = 1.0\n[grid]\nspacing = 0.5\n"
        );
        Object::build(&Scene::parse(&text, "sphere.toml").unwrap().object).unwrap()
    }

    fn signed(surface: &RestSurface, x: DVec3) -> f64 {
        let closest = surface.closest(x, u32::MAX);
        let distance = closest.distance_squared.sqrt();
        if surface.is_inside(x, &closest) { -distance } else { distance }
    }

    /// The error of the distance to a sphere near its surface, and the angle between normals on either side of an edge,
    /// both rms (m, rad).
    fn errors(divisions: u32, felt: ContactSurface) -> (f64, f64) {
        let object = sphere(divisions);
        let surface = RestSurface::new(&object, felt);
        let mut random = Random::new(3);
        let mut distance = 0.0;
        for _ in 0..2000 {
            let x = random.vector().normalize() * RADIUS * random.between(0.8, 1.2);
            distance += (signed(&surface, x) - (x.length() - RADIUS)).powi(2);
        }
        let mut angle = 0.0;
        for t in 0..object.triangles.len() {
            for (k, middle) in [[0.5, 0.5, 0.0], [0.0, 0.5, 0.5], [0.5, 0.0, 0.5]].into_iter().enumerate() {
                let (other, back) = across(surface.triangles, surface.topology, t, k);
                let mut there = [0.5; 3];
                there[(back + 2) % 3] = 0.0;
                let normal = |t: usize, w: [f64; 3]| surface.facet(&surface.positions, t as u32).normal(w);
                angle += normal(t, middle).angle_between(normal(other, there)).powi(2);
            }
        }
        ((distance / 2000.0).sqrt(), (angle / (3 * object.triangles.len()) as f64).sqrt())
    }

    /// Flat facets are second order in the distance and first in the normal; smooth ones are third and second, and much
    /// nearer already.
    #[test]
    fn a_smooth_surface_is_nearer_to_what_the_mesh_samples() {
        let [coarse, fine] = [2, 3].map(|divisions| errors(divisions, ContactSurface::Smooth));
        let flat = errors(3, ContactSurface::Facets);
        println!("{coarse:?} {fine:?} {flat:?}");
        assert!(fine.0 < 0.1 * flat.0 && fine.1 < 0.1 * flat.1, "{fine:?} {flat:?}");
        assert!(coarse.0 > 6.0 * fine.0 && coarse.1 > 2.2 * fine.1, "{coarse:?} {fine:?}");
    }

    /// On a surface with a hollow: no point of a dense sample is closer, distances are bounded from below, and sides
    /// are those of the triangles wherever the bulge leaves no doubt.
    #[test]
    fn the_closest_point_of_a_smooth_surface_is_found_and_its_side() {
        let scene = Scene::load(Path::new(env!("CARGO_MANIFEST_DIR")).join("datasets/mesh.toml")).unwrap();
        let object = Object::build(&scene.object).unwrap();
        let smooth = RestSurface::new(&object, ContactSurface::Smooth);
        let flat = RestSurface::new(&object, ContactSurface::Facets);
        assert!(smooth.bulge > 1e-5 && smooth.bulge < 0.3 * smooth.mean_edge, "{}", smooth.bulge);
        let mut samples = Vec::new();
        for t in 0..object.triangles.len() as u32 {
            let facet = smooth.facet(&smooth.positions, t);
            for i in 0..=12 {
                for j in 0..=12 - i {
                    let (u, v) = (f64::from(i) / 12.0, f64::from(j) / 12.0);
                    samples.push(facet.point([1.0 - u - v, u, v]));
                }
            }
        }
        let mut random = Random::new(5);
        let (mut inside, mut compared) = (0, 0);
        for _ in 0..400 {
            let near = samples[random.between(0.0, samples.len() as f64) as usize];
            let x = near + random.vector() * 0.01;
            let closest = smooth.closest(x, u32::MAX);
            let distance = closest.distance_squared.sqrt();
            let sampled = samples.iter().map(|sample| sample.distance(x)).fold(f64::MAX, f64::min);
            assert!(distance <= sampled + 1e-12, "{distance} {sampled}");
            let here = signed(&smooth, x);
            assert!(smooth.distance_bound(x).0 <= here + 1e-12);
            if signed(&flat, x).abs() > smooth.bulge {
                compared += 1;
                inside += usize::from(here < 0.0);
                assert_eq!(here < 0.0, signed(&flat, x) < 0.0, "{x}");
            }
        }
        assert!(compared > 200 && inside > 50, "{compared} {inside}");
    }
}
