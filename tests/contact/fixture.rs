//! Objects, proxies and configurations that the tests share.

use glam::DVec3;
use haptize::object::Object;
use haptize::proxy::Chain;
use haptize::scene::{
    Algorithm, ContactSpec, GroundNodes, GroundSpec, JointKind, JointSpec, Material, ObjectSpec, ProxyNodeSpec,
    ProxySpec, Shape, SpringKind, SpringSpec,
};

/// A fixed pseudo-random sequence in [-1, 1).
pub struct Sequence(u64);

impl Sequence {
    pub fn new(seed: u64) -> Self {
        Self(seed)
    }

    pub fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        (self.0 >> 11) as f64 / (1u64 << 52) as f64 - 1.0
    }

    /// Uniform in `[low, high)`.
    pub fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * 0.5 * (self.next() + 1.0)
    }
}

/// Springs of 300 N/m and ground of 100 N/m at every node.
pub fn spec(shape: Shape, kind: SpringKind) -> ObjectSpec {
    ObjectSpec {
        shape,
        material: Material::Springs(SpringSpec { kind, stiffness: 300.0 }),
        ground: GroundSpec { stiffness: 100.0, nodes: GroundNodes::All },
        node_mass: 0.01,
        node_damping: 0.1,
    }
}

/// Where the sphere of [`sphere`] lies [m].
pub const SPHERE_CENTRE: DVec3 = DVec3::new(0.16, 0.0, 0.0);

/// The paper's sphere of 102 nodes, radius 50 mm.
pub fn sphere(kind: SpringKind) -> Object {
    Object::build(&spec(Shape::Sphere { centre: SPHERE_CENTRE, radius: 0.05, rings: 10, segments: 10 }, kind)).unwrap()
}

/// An object on a surface given by nodes and triangles.
pub fn object(nodes: Vec<DVec3>, triangles: Vec<[u32; 3]>) -> Object {
    let shape = Shape::Sphere { centre: DVec3::ZERO, radius: 1.0, rings: 3, segments: 3 };
    Object::from_surface(&spec(shape, SpringKind::Isotropic), nodes, triangles).unwrap()
}

/// The same object held at every node by springs of this stiffness [N/m].
pub fn grounded(object: &Object, stiffness: f64) -> Object {
    let shape = Shape::Sphere { centre: DVec3::ZERO, radius: 1.0, rings: 3, segments: 3 };
    let mut spec = spec(shape, SpringKind::Isotropic);
    spec.ground.stiffness = stiffness;
    Object::from_surface(&spec, object.rest.clone(), object.triangles.clone()).unwrap()
}

/// A torus around z in place of the sphere: a surface with concave parts. Radii 35 and 16 mm.
pub fn torus() -> Object {
    let (around, across) = (18u32, 8u32);
    let mut nodes = Vec::new();
    let mut triangles = Vec::new();
    for i in 0..around {
        for j in 0..across {
            let (a, b) = (
                std::f64::consts::TAU * f64::from(i) / f64::from(around),
                std::f64::consts::TAU * f64::from(j) / f64::from(across),
            );
            let from_axis = 0.035 + 0.016 * b.cos();
            nodes.push(SPHERE_CENTRE + DVec3::new(from_axis * a.cos(), from_axis * a.sin(), 0.016 * b.sin()));
            let at = |i: u32, j: u32| (i % around) * across + j % across;
            triangles.push([at(i, j), at(i + 1, j), at(i + 1, j + 1)]);
            triangles.push([at(i, j), at(i + 1, j + 1), at(i, j + 1)]);
        }
    }
    object(nodes, triangles)
}

/// A regular octahedron of edge 0.1 m around the origin.
pub fn octahedron() -> Object {
    let r = 0.1 / 2.0f64.sqrt();
    let nodes = vec![DVec3::X * r, DVec3::Y * r, DVec3::Z * r, -DVec3::X * r, -DVec3::Y * r, -DVec3::Z * r];
    let triangles = vec![[0, 1, 2], [1, 3, 2], [3, 4, 2], [4, 0, 2], [1, 0, 5], [3, 1, 5], [4, 3, 5], [0, 4, 5]];
    object(nodes, triangles)
}

pub fn joint(kind: JointKind, origin: DVec3, axis: DVec3, nodes: Vec<ProxyNodeSpec>) -> JointSpec {
    JointSpec {
        name: "joint".into(),
        kind,
        origin,
        axis,
        limits: [-10.0, 10.0],
        mass: 0.1,
        centre_of_mass: DVec3::ZERO,
        inertia: DVec3::splat(1e-4),
        rotor_inertia: 1e-3,
        nodes,
    }
}

/// Nodes along x from `from` to `to` [m].
fn row(from: f64, to: f64, count: usize, radius: f64) -> Vec<ProxyNodeSpec> {
    (0..count)
        .map(|k| {
            let position = DVec3::X * (from + (to - from) * k as f64 / (count - 1) as f64);
            ProxyNodeSpec { position, radius }
        })
        .collect()
}

/// An arm like a Phantom's above the sphere: turning base, shoulder, elbow; 25 nodes along both moving links.
pub fn arm(radius: f64) -> ProxySpec {
    ProxySpec {
        joints: vec![
            joint(JointKind::Revolute, DVec3::new(0.0, 0.0, 0.07), DVec3::Z, vec![]),
            joint(JointKind::Revolute, DVec3::ZERO, DVec3::Y, row(0.03, 0.15, 12, radius)),
            joint(JointKind::Revolute, DVec3::X * 0.16, DVec3::Y, row(0.01, 0.13, 13, radius)),
        ],
    }
}

/// An arm of six joints, the third sliding, that reaches the sphere too.
pub fn arm_of_six() -> ProxySpec {
    let mut spec = arm(0.0);
    spec.joints.insert(2, joint(JointKind::Prismatic, DVec3::ZERO, DVec3::X, row(0.1, 0.15, 3, 0.0)));
    spec.joints.push(joint(JointKind::Revolute, DVec3::X * 0.13, DVec3::X, vec![]));
    spec.joints.push(joint(JointKind::Revolute, DVec3::ZERO, DVec3::Z, row(0.005, 0.02, 2, 0.0)));
    spec
}

/// A single node that slides from `from` along `axis`: depth is the joint's coordinate where `axis` is a face's inward normal.
pub fn probe(from: DVec3, axis: DVec3) -> Chain {
    ball(from, axis, 0.0)
}

/// The same with a radius.
pub fn ball(from: DVec3, axis: DVec3, radius: f64) -> Chain {
    let node = ProxyNodeSpec { position: DVec3::ZERO, radius };
    Chain::new(&ProxySpec { joints: vec![joint(JointKind::Prismatic, from, axis, vec![node])] })
}

pub fn contact(algorithm: Algorithm, stiffness: f64) -> ContactSpec {
    ContactSpec { stiffness, algorithm, tolerance: 1e-8, max_iterations: 100 }
}

/// Joint coordinates of [`arm`] at random, about a third of them in contact with the sphere.
pub fn random_configurations(seed: u64, count: usize) -> Vec<Vec<f64>> {
    let mut sequence = Sequence::new(seed);
    (0..count)
        .map(|_| vec![sequence.between(-0.4, 0.4), sequence.between(-0.1, 0.45), sequence.between(-0.1, 0.7)])
        .collect()
}
