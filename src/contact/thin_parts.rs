//! Parts of the object that the arm pushes through.
//!
//! Contact is with the closest surface. A contact node that gets past the middle of a part is therefore pushed out on
//! the far side, and one that leaves the part there is free: the torque changes its sign at the middle and ends beyond.

use super::Proximity;
use super::geometry::RestSurface;
use crate::JointVector;
use glam::DVec3;

/// How near a contact node comes to the middle when it gets there, over the thickness (1): coordinates that are a
/// thousand times as large as a thickness are rounded by some 1e-12 of it, and a grid point may lie on the middle.
const ROUNDING: f64 = 1e-9;

/// Triangles below which the thickness of a surface is measured (1): a part of one in a thousand of them may be missed.
const LOOKED_AT: usize = 1000;

/// A contact node that gets to the middle of a part of the object, or past it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PastMiddle {
    /// Number of the node.
    pub node: usize,
    /// Thickness of the part: length within the object of the surface's normal through the node (m).
    pub thickness: f64,
}

impl Proximity<'_> {
    /// Returns the contact node that gets to the middle of the thinnest part, or past it, while the arm moves from `q`
    /// to one of the configurations `reached`. Contact nodes whose middles are outside the object at `q` are left out.
    pub fn past_middle(&mut self, q: &[f64], reached: impl IntoIterator<Item = JointVector>) -> Option<PastMiddle> {
        self.gap(q);
        let model = self.model();
        let surface = &model.surface;
        // Distances of what lies inside are exact after that.
        let is_inside = |(node, clearance): (usize, f64)| clearance + model.chain.nodes[node].radius < 0.0;
        let inside: Vec<usize> =
            self.clearances().enumerate().filter(|item| is_inside(*item)).map(|(node, _)| node).collect();
        let mut parts: Vec<(PastMiddle, DVec3, DVec3)> = Vec::with_capacity(inside.len());
        for node in inside {
            let x = self.pose().nodes[node] - surface.centre;
            let closest = surface.closest(x, u32::MAX);
            // A rounded surface may be as far outside.
            if !surface.is_inside(x, &closest) {
                continue;
            }
            let foot = surface.facet_at_rest(closest.triangle).point(closest.point.weights);
            let inwards = (x - foot).normalize_or_zero();
            // Everything around the node that is nearer than the surface lies within the object.
            if let Some(beyond) = way_out(surface, x, inwards) {
                parts.push((PastMiddle { node, thickness: x.distance(foot) + beyond }, foot, inwards));
            }
        }
        if parts.is_empty() {
            return None;
        }
        let mut passed: Option<PastMiddle> = None;
        for q in reached {
            self.place(&q);
            for (part, foot, inwards) in &parts {
                let depth = (self.pose().nodes[part.node] - surface.centre - foot).dot(*inwards);
                if 2.0 * depth >= part.thickness * (1.0 - ROUNDING)
                    && passed.is_none_or(|other| part.thickness < other.thickness)
                {
                    passed = Some(*part);
                }
            }
        }
        passed
    }
}

/// Least thickness of `surface` below the middles of its triangles, [`LOOKED_AT`] of them (m).
pub(super) fn least_thickness(surface: &RestSurface<'_>) -> f64 {
    let count = surface.triangles.len();
    let below = |t: usize| {
        let middle = surface.triangles[t].iter().map(|&node| surface.positions[node as usize]).sum::<DVec3>() / 3.0;
        way_out(surface, middle, -surface.normals[t])
    };
    (0..count).step_by(count.div_ceil(LOOKED_AT).max(1)).filter_map(below).fold(f64::INFINITY, f64::min)
}

/// Distance from `x` inside the object to its flat triangles in `direction`; none where the direction is zero, or where
/// rounding lets the line pass between triangles (m).
fn way_out(surface: &RestSurface<'_>, x: DVec3, direction: DVec3) -> Option<f64> {
    let corners = |triangle: &[u32; 3]| triangle.map(|node| surface.positions[node as usize] - x);
    let distance = |triangle: &[u32; 3]| {
        let [a, b, c] = corners(triangle);
        // Twice the areas that the edges span as seen along the direction: all positive where the line leaves here.
        let areas = [b.cross(c), c.cross(a), a.cross(b)].map(|area| area.dot(direction));
        let normal = (b - a).cross(c - a);
        let along = normal.dot(direction);
        (along > 0.0 && areas.iter().all(|area| *area >= 0.0)).then(|| a.dot(normal) / along)
    };
    // Behind `x` the line leaves other parts.
    surface.triangles.iter().filter_map(distance).filter(|distance| *distance >= 0.0).min_by(f64::total_cmp)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        contact::Model,
        fixtures::bodies::{PAPER, RADIUS, contact, gantry, object, sphere},
        object::Object,
        random::Random,
        scene::ProxyNodeSpec,
    };

    /// Sides of a plate (m).
    const SIDES: [f64; 3] = [0.04, 0.04, 0.002];

    fn plate() -> Object {
        plates(&[0.0])
    }

    /// Plates in the middle of each of `heights` (m).
    fn plates(heights: &[f64]) -> Object {
        let corner = |k: usize| DVec3::from_array([0, 1, 2].map(|a| ((k >> a & 1) as f64 - 0.5) * SIDES[a]));
        // Each side by its corners, anticlockwise seen from outside.
        let sides = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
        let triangles = sides.into_iter().flat_map(|[a, b, c, d]| [[a, b, c], [a, c, d]]);
        let (mut nodes, mut all) = (Vec::new(), Vec::new());
        for height in heights {
            let first = nodes.len() as u32;
            nodes.extend((0..8).map(|k| corner(k) + *height * DVec3::Z));
            all.extend(triangles.clone().map(|triangle| triangle.map(|node| first + node)));
        }
        object(nodes, all).unwrap()
    }

    /// What a ball on three slides, at `from`, gets past on its way to the places `to`.
    fn passed(object: &Object, from: DVec3, to: &[DVec3]) -> Option<PastMiddle> {
        let chain = gantry(vec![ProxyNodeSpec { position: DVec3::ZERO, radius: 0.0003, length: 0.0 }]);
        let model = Model::new(object, &chain, contact(500.0));
        let q = |x: &DVec3| JointVector::from_slice(&x.to_array());
        Proximity::new(&model).past_middle(&q(&from), to.iter().map(q))
    }

    #[test]
    fn a_plate_is_passed_beyond_half_its_thickness_from_either_side() {
        let (plate, mut random) = (plate(), Random::new(7));
        let (mut through, half) = (0, 0.5 * SIDES[2]);
        for _ in 0..200 {
            let mut across = || 0.4 * SIDES[0] * random.between(-1.0, 1.0);
            let (from, to) = ([across(), across()], [across(), across()]);
            let side = random.between(-1.0, 1.0).signum();
            let [depth, reached] = [(0.01, 0.99), (0.01, 6.0)].map(|(least, most)| half * random.between(least, most));
            let place = |[x, y]: [f64; 2], depth: f64| DVec3::new(x, y, side * (half - depth));
            let passed = passed(&plate, place(from, depth), &[place(from, 0.0), place(to, reached)]);
            assert_eq!(passed.is_some(), reached >= half, "{depth} to {reached} m");
            if let Some(part) = passed {
                assert!((part.thickness - SIDES[2]).abs() < 1e-12, "{part:?}");
                through += 1;
            }
        }
        assert!((100..200).contains(&through), "{through}");
        // A grid may have a point on the middle.
        let at = |z: f64| DVec3::new(0.001, 0.002, z);
        assert!(passed(&plate, at(-0.0003), &[at(0.0)]).is_some());
    }

    #[test]
    fn a_part_is_as_thick_as_itself_whatever_lies_before_and_behind_it() {
        let three = plates(&[-0.03, 0.0, 0.05]);
        let at = |z: f64| DVec3::new(0.001, 0.002, z);
        for side in [-1.0, 1.0] {
            assert_eq!(passed(&three, at(0.0008 * side), &[at(0.0005 * side)]), None);
            let part = passed(&three, at(0.0008 * side), &[at(-0.0005 * side)]).unwrap();
            assert!((part.thickness - SIDES[2]).abs() < 1e-12, "{part:?}");
        }
    }

    #[test]
    fn a_thick_body_is_passed_beyond_its_centre_only_and_what_is_outside_passes_nothing() {
        let ball = sphere(PAPER).unwrap();
        let out = DVec3::new(0.3, -0.5, 0.8).normalize();
        let at = |depth: f64| (RADIUS - depth) * out;
        // The mesh cuts off up to a tenth of the radius.
        assert_eq!(passed(&ball, at(0.3 * RADIUS), &[at(0.4 * RADIUS), at(0.8 * RADIUS)]), None);
        let part = passed(&ball, at(0.3 * RADIUS), &[at(1.2 * RADIUS)]).unwrap();
        assert!((part.thickness / (2.0 * RADIUS) - 1.0).abs() < 0.1, "{part:?}");
        assert_eq!(passed(&ball, at(-0.0001), &[at(1.9 * RADIUS)]), None);
    }
}
