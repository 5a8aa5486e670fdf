//! Objects, proxies and configurations that the tests share, made of those of the hard cases.

use glam::DVec3;
use haptize::contact::{Equilibrium, Model, Solver};
pub use haptize::fixtures::Random;
use haptize::paper::PaperSolver;
use haptize::{
    fixtures::bodies::{self, Ball, PAPER, joint},
    object::Object,
    proxy::Chain,
    scene::{
        ContactLaw, ContactSpec, Follows, GroundStiffness, JointKind, ObjectSpec, ProxyNodeSpec, ProxySpec, Shape,
        SpringKind,
    },
};

/// Springs of 300 N/m and ground of 100 N/m at every node.
pub fn spec(shape: Shape, kind: SpringKind) -> ObjectSpec {
    ObjectSpec { shape, ..bodies::sphere_spec(Ball { springs: kind, ..PAPER }, SPHERE_CENTRE, 1.0, 1.0) }
}

/// Where the sphere of [`sphere`] lies (m).
pub const SPHERE_CENTRE: DVec3 = DVec3::new(0.16, 0.0, 0.0);

/// The paper's sphere of 102 nodes, radius 50 mm.
pub fn sphere(kind: SpringKind) -> Object {
    Object::build(&bodies::sphere_spec(Ball { springs: kind, ..PAPER }, SPHERE_CENTRE, 1.0, 1.0)).unwrap()
}

/// An object on a surface given by nodes and triangles.
pub fn object(nodes: Vec<DVec3>, triangles: Vec<[u32; 3]>) -> Object {
    bodies::object(nodes, triangles).unwrap()
}

/// The same object held at every node by springs of this stiffness (N/m).
pub fn grounded(object: &Object, stiffness: f64) -> Object {
    let mut spec = bodies::sphere_spec(PAPER, SPHERE_CENTRE, 1.0, 1.0);
    spec.ground.as_mut().unwrap().stiffness = GroundStiffness::PerNode(stiffness);
    Object::from_surface(&spec, object.rest.clone(), object.triangles.clone()).unwrap()
}

/// A torus in place of the sphere: a surface with concave parts.
pub fn torus() -> Object {
    bodies::torus(SPHERE_CENTRE).unwrap()
}

/// A regular octahedron of edge 0.1 m around the origin.
pub fn octahedron() -> Object {
    let r = 0.1 / 2.0f64.sqrt();
    let nodes = vec![DVec3::X * r, DVec3::Y * r, DVec3::Z * r, -DVec3::X * r, -DVec3::Y * r, -DVec3::Z * r];
    let triangles = vec![[0, 1, 2], [1, 3, 2], [3, 4, 2], [4, 0, 2], [1, 0, 5], [3, 1, 5], [4, 3, 5], [0, 4, 5]];
    object(nodes, triangles)
}

/// Nodes along x from `from` to `to` (m).
fn row(from: f64, to: f64, count: usize, radius: f64) -> Vec<ProxyNodeSpec> {
    (0..count)
        .map(|k| {
            let position = DVec3::X * (from + (to - from) * k as f64 / (count - 1) as f64);
            ProxyNodeSpec { position, radius, length: 0.0 }
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
        ..Default::default()
    }
}

/// [`arm`] with a slide before its elbow, both of which follow its shoulder: two coordinates move four links.
pub fn arm_of_followers() -> ProxySpec {
    let mut joints = arm(0.0).joints;
    joints.insert(2, joint(JointKind::Prismatic, DVec3::ZERO, DVec3::X, row(0.1, 0.15, 3, 0.0)));
    joints.iter_mut().zip(["turn", "lift", "slide", "bend"]).for_each(|(joint, name)| joint.name = name.into());
    let follows = |multiplier, offset| Some(Follows { joint: "lift".into(), multiplier, offset });
    (joints[2].follows, joints[3].follows) = (follows(-0.03, 0.004), follows(0.8, 0.25));
    ProxySpec::new(joints).unwrap()
}

/// An arm of six joints, the third sliding, that reaches the sphere too.
pub fn arm_of_six() -> ProxySpec {
    let mut spec = arm(0.0);
    spec.joints.insert(2, joint(JointKind::Prismatic, DVec3::ZERO, DVec3::X, row(0.1, 0.15, 3, 0.0)));
    spec.joints.push(joint(JointKind::Revolute, DVec3::X * 0.13, DVec3::X, vec![]));
    spec.joints.push(joint(JointKind::Revolute, DVec3::ZERO, DVec3::Z, row(0.005, 0.02, 2, 0.0)));
    spec
}

/// A single node that slides from `from` along `axis`: depth is the joint's coordinate where `axis` is a face's inward
/// normal.
pub fn probe(from: DVec3, axis: DVec3) -> Chain {
    ball(from, axis, 0.0)
}

/// The same with a radius.
pub fn ball(from: DVec3, axis: DVec3, radius: f64) -> Chain {
    bodies::probe(from, axis, radius)
}

/// Contact springs Kc (N/m), and few iterations: what converges here does so soon.
pub fn contact(law: ContactLaw, stiffness: f64) -> ContactSpec {
    ContactSpec { law, max_iterations: 100, ..bodies::contact(stiffness) }
}

/// What solves configurations, by a law or by the paper's iteration.
pub type Search<'a> = Box<dyn FnMut(&[f64]) -> Equilibrium + 'a>;

/// The models of the two laws at contact stiffness Kc (N/m).
pub fn models<'a>(object: &'a Object, chain: &'a Chain, stiffness: f64) -> [Model<'a>; 2] {
    [ContactLaw::Following, ContactLaw::Rest].map(|law| Model::new(object, chain, contact(law, stiffness)))
}

/// All that solves one configuration: the laws of `models`, and the paper's iteration.
pub fn searches<'a>(models: &'a [Model<'a>; 2]) -> [Search<'a>; 3] {
    let [mut following, mut rest] = models.each_ref().map(Solver::new);
    let mut paper = PaperSolver::new(&models[0]);
    [Box::new(move |q| following.solve(q)), Box::new(move |q| rest.solve(q)), Box::new(move |q| paper.solve(q))]
}

/// Joint coordinates of [`arm`] at random, about a third of them in contact with the sphere.
pub fn random_configurations(seed: u64, count: usize) -> Vec<Vec<f64>> {
    let mut sequence = Random::new(seed);
    (0..count)
        .map(|_| vec![sequence.between(-0.4, 0.4), sequence.between(-0.1, 0.45), sequence.between(-0.1, 0.7)])
        .collect()
}
