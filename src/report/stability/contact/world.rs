//! The objects that the cases and the tests of contact touch, and the arms that touch them.

use super::super::Failure;
use crate::{
    JointVector,
    contact::{Model, Solver},
    object::Object,
    proxy::Chain,
    scene::{
        Algorithm, ContactSpec, GroundNodes, GroundSpec, JointKind, JointSpec, Material, ObjectSpec, ProxyNodeSpec,
        ProxySpec, Shape, SkinSpec, SpringKind, SpringSpec,
    },
};
use glam::{DMat3, DVec3};
use std::f64::consts::{PI, TAU};

/// Radius of the sphere [m].
pub const RADIUS: f64 = 0.05;

/// Radius of proxy nodes that are balls [m]: they overlap along a link, as a link's hull would.
pub const BALL: f64 = 0.008;

/// Iterations of a configuration at most: the scenes' default.
pub const ITERATIONS: u32 = 400;

/// A fixed pseudo-random sequence.
pub struct Sequence(u64);

impl Sequence {
    /// The sequence of this number.
    #[must_use]
    pub fn new(seed: u64) -> Self {
        Self(seed)
    }

    /// Uniform in `[low, high)` (Knuth's linear congruential generator, its upper 53 bits).
    pub fn between(&mut self, low: f64, high: f64) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        low + (high - low) * (self.0 >> 11) as f64 / (1_u64 << 53) as f64
    }
}

/// How a sphere is made and held.
#[derive(Clone, Copy, Debug)]
pub struct Ball {
    /// Rings, and nodes of each: 10 for 102 nodes, 45 for 2,027.
    pub rings: usize,
    /// How its springs resist.
    pub springs: SpringKind,
    /// Kg [N/m].
    pub ground: f64,
    /// Held at its underside only.
    pub patch: bool,
}

/// The paper's sphere of 102 nodes, springs of 300 N/m, ground of 100 N/m at every node.
pub const PAPER: Ball = Ball { rings: 10, springs: SpringKind::Isotropic, ground: 100.0, patch: false };

/// The specification of a sphere around `centre`, all lengths times `scale`, all stiffnesses times `stiffness`.
#[must_use]
pub fn sphere_spec(ball: Ball, centre: DVec3, scale: f64, stiffness: f64) -> ObjectSpec {
    let Ball { rings, springs, ground, patch } = ball;
    let radius = RADIUS * scale;
    ObjectSpec {
        shape: Shape::Sphere { centre, radius, rings, segments: rings },
        material: Material::Springs(SpringSpec { kind: springs, stiffness: 300.0 * stiffness }),
        skin: None,
        ground: Some(GroundSpec {
            stiffness: ground * stiffness,
            nodes: if patch { GroundNodes::Below(centre.z - 0.6 * radius) } else { GroundNodes::All },
        }),
        node_mass: 0.01,
        node_damping: 0.1,
    }
}

/// A sphere around the origin.
///
/// # Errors
/// When it cannot be built.
pub fn sphere(ball: Ball) -> Result<Object, Failure> {
    Ok(Object::build(&sphere_spec(ball, DVec3::ZERO, 1.0, 1.0))?)
}

/// A sphere around the origin with the skin of the scene that ships, edges of the icosahedron in `divisions` parts.
///
/// # Errors
/// When it cannot be built.
pub fn skinned(divisions: usize) -> Result<Object, Failure> {
    Ok(Object::build(&ObjectSpec {
        shape: Shape::Icosphere { centre: DVec3::ZERO, radius: RADIUS, divisions },
        material: Material::Hollow,
        skin: Some(SkinSpec { tension: 260.0, bending: 0.08, foundation: 1.6e5 }),
        ground: None,
        ..sphere_spec(PAPER, DVec3::ZERO, 1.0, 1.0)
    })?)
}

/// A surface with springs of 300 N/m, held at every node by 100 N/m.
///
/// # Errors
/// When it is no closed surface.
pub fn object(nodes: Vec<DVec3>, triangles: Vec<[u32; 3]>) -> Result<Object, Failure> {
    Ok(Object::from_surface(&sphere_spec(PAPER, DVec3::ZERO, 1.0, 1.0), nodes, triangles)?)
}

/// A torus around an axis along z through `centre`, radii 35 and 16 mm: a surface with concave parts.
///
/// # Errors
/// None.
pub fn torus(centre: DVec3) -> Result<Object, Failure> {
    let (around, across) = (18_u32, 8_u32);
    let at = |i: u32, j: u32| (i % around) * across + j % across;
    let mut nodes = Vec::new();
    let mut triangles = Vec::new();
    for i in 0..around {
        for j in 0..across {
            let (a, b) = (TAU * f64::from(i) / f64::from(around), TAU * f64::from(j) / f64::from(across));
            let from_axis = 0.035 + 0.016 * b.cos();
            nodes.push(centre + DVec3::new(from_axis * a.cos(), from_axis * a.sin(), 0.016 * b.sin()));
            triangles.push([at(i, j), at(i + 1, j), at(i + 1, j + 1)]);
            triangles.push([at(i, j), at(i + 1, j + 1), at(i, j + 1)]);
        }
    }
    object(nodes, triangles)
}

/// A joint at `origin` of its parent, with nodes.
#[must_use]
pub fn joint(kind: JointKind, origin: DVec3, axis: DVec3, nodes: Vec<ProxyNodeSpec>) -> JointSpec {
    JointSpec {
        name: "joint".into(),
        kind,
        origin,
        axis,
        limits: [-10.0, 10.0],
        mass: 0.1,
        centre_of_mass: DVec3::ZERO,
        inertia: DMat3::from_diagonal(DVec3::splat(1e-4)),
        rotor_inertia: 1e-3,
        nodes,
    }
}

/// One node that slides from `from` along `axis`.
#[must_use]
pub fn probe(from: DVec3, axis: DVec3, radius: f64) -> Chain {
    let nodes = vec![ProxyNodeSpec { position: DVec3::ZERO, radius, length: 0.0 }];
    Chain::new(&ProxySpec { joints: vec![joint(JointKind::Prismatic, from, axis, nodes)] })
}

/// Nodes on three slides along the axes of the world: the joint coordinates are where their origin is [m].
#[must_use]
pub fn gantry(nodes: Vec<ProxyNodeSpec>) -> Chain {
    let slide = |axis, nodes| joint(JointKind::Prismatic, DVec3::ZERO, axis, nodes);
    let joints = vec![slide(DVec3::X, vec![]), slide(DVec3::Y, vec![]), slide(DVec3::Z, nodes)];
    Chain::new(&ProxySpec { joints })
}

/// A bent bar of 17 nodes that floats: three slides, three turns.
#[must_use]
pub fn floating_bar(radius: f64) -> Chain {
    use JointKind::{Prismatic, Revolute};
    let straight = (0..11).map(|k| DVec3::X * (0.01 * f64::from(k) - 0.05));
    let bent = (1..7).map(|k| DVec3::new(0.05 - 0.004 * f64::from(k), 0.0, -0.01 * f64::from(k)));
    let nodes = straight.chain(bent).map(|position| ProxyNodeSpec { position, radius, length: 0.0 }).collect();
    let plain = |kind, axis| joint(kind, DVec3::ZERO, axis, vec![]);
    Chain::new(&ProxySpec {
        joints: vec![
            plain(Prismatic, DVec3::X),
            plain(Prismatic, DVec3::Y),
            plain(Prismatic, DVec3::Z),
            plain(Revolute, DVec3::X),
            plain(Revolute, DVec3::Y),
            joint(Revolute, DVec3::ZERO, DVec3::Z, nodes),
        ],
    })
}

/// Random configurations of [`floating_bar`] whose deepest node lies between `least` and `most` below the surface of a
/// sphere around the origin [m].
#[must_use]
pub fn pressed(model: &Model<'_>, seed: u64, count: usize, least: f64, most: f64) -> Vec<JointVector> {
    let mut sequence = Sequence::new(seed);
    let mut solver = Solver::new(model);
    let mut found = Vec::with_capacity(count);
    while found.len() < count {
        let direction = DVec3::from_array([0; 3].map(|_| sequence.between(-1.0, 1.0)));
        if !(0.1..1.0).contains(&direction.length()) {
            continue;
        }
        let direction = direction.normalize();
        let turns = [0; 3].map(|_| sequence.between(-PI, PI));
        let wanted = -sequence.between(least, most);
        // From afar inwards by what is missing: the gap grows no faster than the way.
        let mut away = 2.0 * RADIUS + 0.06;
        for _ in 0..20 {
            let q = JointVector::from_slice(&[(direction * away).to_array(), turns].concat());
            let gap = solver.gap(&q);
            if (gap - wanted).abs() < 1e-4 && -gap > least && -gap <= most {
                found.push(q);
                break;
            }
            away -= gap - wanted;
        }
    }
    found
}

/// The energy form with contact springs Kc [N/m]; infinity is rigid.
#[must_use]
pub fn contact(stiffness: f64) -> ContactSpec {
    ContactSpec {
        stiffness,
        stiffness_per_length: None,
        algorithm: Algorithm::Energy,
        tolerance: 1e-8,
        max_iterations: ITERATIONS,
        updates: 0,
        surface: crate::scene::ContactSurface::Facets,
    }
}
