//! A simulated spongy block, fixed to the ground: the stand-in for the paper's real one (section 4.2). Its physics is
//! its own: no mesh, no springs between nodes, nothing of `object/` or `contact/`.
//!
//! **Elastic.** The block is a bed of independent foam columns under the pressed face. A column of height H compressed
//! by d has strain e = d / H and pressure `p(e) = pc (1 - exp(-E e / pc)) + pd e^3 / (1 - e)^2`: linear at first, a
//! plateau where the cell walls buckle, then densification (the three regimes of Gibson and Ashby, Cellular Solids,
//! 1997). A proxy node is a rod with a hemispherical end of radius r; its pressure is integrated over rings of its
//! shadow on the face, as far as the block reaches there. What surrounds the node is dragged along like a taut sheet of
//! tension S held at distance R: `F = 2 pi S d / ln(R / r)`: small for foam alone, large for a fabric. That is what
//! makes the cover stiffer.
//!
//! **Viscous.** Overstress relaxes: a Maxwell branch for each term of the specimen, `dq_k/dt = G_k dFe/dt - q_k /
//! theta_k` (quasi-linear viscoelasticity, Fung 1981), G_k the term's share over that of the force that lasts. A node
//! that retracts faster than the foam recovers loses contact: force is never negative.
//!
//! **Friction.** Where a node first touches a face it sticks; the tangential spring slides at mu times the normal
//! force.
//!
//! A node presses the face through which it came in until it leaves the block, however deep it goes: distance to
//! the nearest face would let it slip out sideways.

use crate::scene::{Cover, MOST_TERMS, SpecimenSpec};
use glam::DVec3;

/// Young's modulus of the foam at small strain (Pa).
const MODULUS: f64 = 9e3;
/// Plateau pressure (Pa).
const PLATEAU: f64 = 3.5e3;
/// Scale of densification (Pa).
const DENSIFICATION: f64 = 6e3;
/// Strain beyond which the pressure goes on linearly, so that it stays finite (1).
const GREATEST_STRAIN: f64 = 0.9;
/// Tension of the foam's own skin, and of the fabric (N/m).
const TENSION: [f64; 2] = [4.0, 22.0];
/// Where the sheet is held, from the node (m).
const SHEET_RADIUS: f64 = 0.05;
/// Tangential stiffness while a node sticks (N/m).
const STICKING: f64 = 300.0;
/// Rings over which the pressure under a node is summed, and points on each.
const RINGS: usize = 4;
const POINTS: usize = 8;
/// Least radius of a node: a point has no shadow (m).
const LEAST_RADIUS: f64 = 1e-3;

/// The block.
#[derive(Clone, Debug)]
pub struct Sponge {
    corner: DVec3,
    size: DVec3,
    tension: f64,
    friction: f64,
    /// Strength of each Maxwell branch over the force that lasts, and its time (1, s).
    branches: Vec<[f64; 2]>,
}

/// One node's contact, from step to step.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct NodeContact {
    face: Option<Face>,
    /// Overstress of each branch (N).
    overstress: [f64; MOST_TERMS],
    /// Elastic force at the last step (N).
    elastic: f64,
    /// Tangential stretch of the sticking spring (m).
    stretch: DVec3,
    /// Position at the last step (m).
    position: DVec3,
}

/// One side of the block.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Face {
    /// 0 to 2.
    axis: usize,
    /// True for the side with the greater coordinate.
    upper: bool,
}

impl Face {
    fn normal(self) -> DVec3 {
        let mut normal = DVec3::ZERO;
        normal[self.axis] = if self.upper { 1.0 } else { -1.0 };
        normal
    }
}

impl Sponge {
    /// The block of `spec`.
    #[must_use]
    pub fn new(spec: &SpecimenSpec) -> Self {
        let tension = TENSION[usize::from(spec.cover == Cover::Fabric)];
        let lasting = 1.0 - spec.relaxation.iter().map(|[share, _]| share).sum::<f64>();
        let branches = spec.relaxation.iter().map(|[share, time]| [share / lasting, *time]).collect();
        Self { corner: spec.corner, size: spec.size, tension, friction: spec.friction, branches }
    }

    /// Force on a node of `radius` at `position`, `time` (s) after the last step; `contact` is its history.
    pub fn force(&self, contact: &mut NodeContact, position: DVec3, radius: f64, time: f64) -> DVec3 {
        let radius = radius.max(LEAST_RADIUS);
        let face = contact.face.or_else(|| self.entered(position, radius));
        let depth = face.map_or(0.0, |face| self.depth(face, position, radius));
        let moved = position - contact.position;
        contact.position = position;
        let Some(face) = face.filter(|_| depth > 0.0) else {
            *contact = NodeContact { position, ..NodeContact::default() };
            return DVec3::ZERO;
        };
        let fresh = contact.face.is_none();
        contact.face = Some(face);
        let elastic = self.elastic(face, position, radius, depth);
        let mut normal_force = elastic;
        for (q, [strength, theta]) in contact.overstress.iter_mut().zip(&self.branches) {
            // Backward Euler: stable for any step.
            *q = (*q + strength * (elastic - contact.elastic)) / (1.0 + time / theta);
            normal_force += *q;
        }
        contact.elastic = elastic;
        let normal_force = normal_force.max(0.0);
        let normal = face.normal();
        contact.stretch = if fresh { DVec3::ZERO } else { contact.stretch + moved - normal * moved.dot(normal) };
        let greatest = self.friction * normal_force / STICKING;
        contact.stretch = contact.stretch.clamp_length_max(greatest);
        normal * normal_force - contact.stretch * STICKING
    }

    /// The face through which a node outside the block before now overlaps it.
    fn entered(&self, position: DVec3, radius: f64) -> Option<Face> {
        let faces = (0..3).flat_map(|axis| [Face { axis, upper: false }, Face { axis, upper: true }]);
        let least = faces.map(|face| (self.depth(face, position, radius), face)).min_by(|a, b| a.0.total_cmp(&b.0))?;
        // Beyond an edge the shadow must still fall on the face.
        (least.0 > 0.0 && least.0 <= 2.0 * radius && self.shadow(least.1, position, radius) > 0.0).then_some(least.1)
    }

    /// Returns how far the node's foremost point is below `face`, if it is above the block's shadow; negative outside
    /// (m).
    fn depth(&self, face: Face, position: DVec3, radius: f64) -> f64 {
        let relative = position[face.axis] - self.corner[face.axis];
        let below = if face.upper { self.size[face.axis] - relative } else { relative };
        let beside = (0..3).filter(|&axis| axis != face.axis).any(|axis| {
            let along = position[axis] - self.corner[axis];
            along < -radius || along > self.size[axis] + radius
        });
        if beside { -radius } else { below + radius }
    }

    /// Share of the node's shadow that falls on `face` (1).
    fn shadow(&self, face: Face, position: DVec3, radius: f64) -> f64 {
        let on_face = self.samples(face, position, radius).filter(|(_, on)| *on).count();
        on_face as f64 / (RINGS * POINTS) as f64
    }

    /// Elastic normal force of a node whose foremost point is at `depth` (N).
    fn elastic(&self, face: Face, position: DVec3, radius: f64, depth: f64) -> f64 {
        let height = self.size[face.axis];
        let area = std::f64::consts::PI * radius * radius / (RINGS * POINTS) as f64;
        let (mut force, mut share) = (0.0, 0.0);
        for (square, on) in self.samples(face, position, radius) {
            if on {
                share += 1.0 / (RINGS * POINTS) as f64;
                let compression = depth - radius + (radius * radius - square).max(0.0).sqrt();
                force += area * pressure((compression / height).max(0.0));
            }
        }
        let sheet = std::f64::consts::TAU * self.tension / (SHEET_RADIUS / radius.min(0.5 * SHEET_RADIUS)).ln();
        force + share * sheet * depth
    }

    /// Points of equal area on the shadow: squared distance from its centre, and whether the block is there.
    fn samples(&self, face: Face, position: DVec3, radius: f64) -> impl Iterator<Item = (f64, bool)> {
        let (u, v) = ((face.axis + 1) % 3, (face.axis + 2) % 3);
        let (corner, size) = (self.corner, self.size);
        let inside = move |axis: usize, x: f64| (0.0..=size[axis]).contains(&(x - corner[axis]));
        (0..RINGS * POINTS).map(move |sample| {
            let (ring, point) = (sample / POINTS, sample % POINTS);
            let square = radius * radius * (ring as f64 + 0.5) / RINGS as f64;
            let angle = std::f64::consts::TAU * (point as f64 + 0.5 * (ring % 2) as f64) / POINTS as f64;
            let (x, y) = (position[u] + square.sqrt() * angle.cos(), position[v] + square.sqrt() * angle.sin());
            (square, inside(u, x) && inside(v, y))
        })
    }
}

/// Pressure of a foam column at a strain (Pa).
fn pressure(strain: f64) -> f64 {
    let bounded = strain.min(GREATEST_STRAIN);
    let gap = 1.0 - bounded;
    let buckled = PLATEAU * (1.0 - (-MODULUS * bounded / PLATEAU).exp());
    let slope = DENSIFICATION * bounded * bounded * (3.0 - bounded) / (gap * gap * gap);
    buckled + DENSIFICATION * bounded.powi(3) / (gap * gap) + slope * (strain - bounded)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn block(cover: Cover) -> Sponge {
        Sponge::new(&SpecimenSpec {
            corner: DVec3::ZERO,
            size: DVec3::new(0.18, 0.08, 0.05),
            cover,
            relaxation: vec![[0.2, 0.03], [0.1, 0.25]],
            friction: 0.4,
            encoder: 0.0,
            noise: 0.0,
            joint_friction: 0.0,
        })
    }

    /// Force after pressing from above to `depth` at (x, y) within 0.2 s and waiting for `wait` seconds.
    fn pressed(sponge: &Sponge, [x, y]: [f64; 2], depth: f64, wait: f64) -> DVec3 {
        let mut contact = NodeContact::default();
        let at = |depth: f64| DVec3::new(x, y, 0.05 + 0.008 - depth);
        sponge.force(&mut contact, at(-0.001), 0.008, 1e-3);
        for k in 0..200 {
            sponge.force(&mut contact, at(depth * f64::from(k) / 200.0), 0.008, 1e-3);
        }
        let ticks = (wait / 1e-3) as usize;
        (0..=ticks).map(|_| sponge.force(&mut contact, at(depth), 0.008, 1e-3)).last().unwrap()
    }

    #[test]
    fn force_grows_more_than_linearly_when_deep_and_the_fabric_is_stiffer() {
        let forces: Vec<f64> =
            [0.006, 0.012, 0.024, 0.036].map(|d| pressed(&block(Cover::Bare), [0.09, 0.04], d, 3.0).z).into();
        assert!(forces.windows(2).all(|pair| pair[1] > pair[0]), "{forces:?}");
        assert!(forces[3] - forces[2] > 1.3 * (forces[2] - forces[1]), "{forces:?}");
        for depth in [0.006, 0.024] {
            let [bare, fabric] = [Cover::Bare, Cover::Fabric].map(|c| pressed(&block(c), [0.09, 0.04], depth, 3.0).z);
            assert!(fabric > 1.5 * bare, "{bare} {fabric}");
        }
        assert!(forces[3] < 10.0, "within a desktop device's force: {forces:?}");
    }

    #[test]
    fn force_relaxes_after_a_quick_press_and_none_pulls_during_retraction() {
        let sponge = block(Cover::Bare);
        let (early, late) = (pressed(&sponge, [0.09, 0.04], 0.02, 0.0).z, pressed(&sponge, [0.09, 0.04], 0.02, 5.0).z);
        assert!(early > 1.05 * late, "{early} {late}");
        let mut contact = NodeContact::default();
        for k in 0..600 {
            let depth = 0.02 - 0.04 * (f64::from(k) / 300.0 - 1.0).abs();
            let force = sponge.force(&mut contact, DVec3::new(0.09, 0.04, 0.058 - depth), 0.008, 1e-3);
            assert!(force.z >= 0.0, "{k}: {force}");
        }
    }

    #[test]
    fn the_face_of_entry_is_kept_and_edges_carry_less() {
        let sponge = block(Cover::Bare);
        let deep_at_the_edge = pressed(&sponge, [0.09, 0.002], 0.03, 3.0);
        assert!(deep_at_the_edge.z > 0.0 && deep_at_the_edge.y.abs() < 1e-12, "{deep_at_the_edge}");
        assert!(deep_at_the_edge.z < 0.8 * pressed(&sponge, [0.09, 0.04], 0.03, 3.0).z);
        assert_eq!(pressed(&sponge, [0.09, -0.02], 0.03, 1.0), DVec3::ZERO);
        let mut contact = NodeContact::default();
        for k in 0..100 {
            let force = sponge.force(&mut contact, DVec3::new(0.09, -0.009 + 1e-4 * f64::from(k), 0.03), 0.008, 1e-3);
            assert!(force.x.abs() + force.z.abs() < 1e-12 && force.y <= 0.0, "{force}");
        }
        assert!(contact.face == Some(Face { axis: 1, upper: false }));
    }

    #[test]
    fn friction_is_bounded_and_opposes_sliding() {
        let sponge = block(Cover::Bare);
        let mut contact = NodeContact::default();
        let mut force = DVec3::ZERO;
        for k in 0..100 {
            force = sponge.force(&mut contact, DVec3::new(0.05, 0.04, 0.058 - 1e-4 * f64::from(k)), 0.008, 1e-3);
        }
        assert!(force.x.abs() < 1e-12);
        for k in 0..400 {
            force = sponge.force(&mut contact, DVec3::new(0.05 + 1e-4 * f64::from(k), 0.04, 0.0481), 0.008, 1e-3);
            assert!(force.x <= 0.0 && force.x.abs() <= 0.4 * force.z * (1.0 + 1e-12), "{k}: {force}");
        }
        assert!((force.x / force.z + 0.4).abs() < 1e-9);
    }
}
