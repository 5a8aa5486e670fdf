//! Leaf functions of the kernels, each on its own, against their CPU twins in f64 on the same (f32) inputs.

use super::{
    adapter::AdapterChoice,
    context::{Context, GpuError},
    forces::ForceSearch,
    kernel::{Dispatch, Kernel, StorageBuffer},
    layout::{Joint, Parameters, ProxyNode},
    model::DeviceModel,
    pipeline::BatchCapacity,
    shaders::{self, Shader},
    solver::GpuSolver,
};
use crate::{
    contact::Backend,
    contact::{
        Model, Solver, Status,
        geometry::{
            closest_point::{Feature, closest_point, point_at},
            facet::Facet,
            normals::{area_vector, unit_or_zero},
        },
        law::depth::{Carriers, Contact, measure},
    },
    object::Object,
    proxy::Chain,
    random::sequence,
    scene::{JointKind, Material, Scene, SpringKind, SpringSpec},
};
use bytemuck::{Pod, Zeroable};
use glam::DVec3;
use std::sync::{Arc, OnceLock};

fn context() -> Arc<Context> {
    static CONTEXT: OnceLock<Arc<Context>> = OnceLock::new();
    Arc::clone(CONTEXT.get_or_init(|| {
        Arc::new(Context::open(AdapterChoice::Any).unwrap_or_else(|error| panic!("GPU tests need an adapter: {error}")))
    }))
}

/// A triangle relative to a proxy node, and displacements of its corners.
#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct Question {
    corners: [[f32; 4]; 3],
    moves: [[f32; 4]; 3],
}

/// Result of the kernel.
#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct Answer {
    weights: [f32; 3],
    feature: u32,
    normal: [f32; 3],
    depth: f32,
    variation: [[f32; 4]; 3],
}

const LEAF: &str = "
struct Question { corners: array<vec4<f32>, 3>, moves: array<vec4<f32>, 3> }
struct Answer { weights: vec3<f32>, feature: u32, normal: vec3<f32>, depth: f32, variation: array<vec4<f32>, 3> }
@group(0) @binding(0) var<uniform> parameters: Parameters;
@group(0) @binding(1) var<storage, read> questions: array<Question>;
@group(0) @binding(2) var<storage, read_write> answers: array<Answer>;
// Functions of the surface that this kernel does not call.
@group(0) @binding(3) var<storage, read> mesh: array<u32>;
fn node_from(node: u32, x: vec3<f32>) -> vec3<f32> { return x; }
@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x >= parameters.configurations {
        return;
    }
    let question = questions[id.x];
    let a = question.corners[0].xyz;
    let b = question.corners[1].xyz;
    let c = question.corners[2].xyz;
    let closest = closest_point(vec3<f32>(0.0), a, b, c);
    let n = cross(b - a, c - a);
    let contact = measure(0.0, a, b, c, closest, n / sqrt(max(dot(n, n), LEAST_DIVISOR)));
    let v = mat3x3<f32>(question.moves[0].xyz, question.moves[1].xyz, question.moves[2].xyz);
    let bend = second_variation(contact, v);
    answers[id.x] = Answer(closest.weights, closest.feature, contact.normal, contact.depth,
        array<vec4<f32>, 3>(vec4<f32>(bend[0], 0.0), vec4<f32>(bend[1], 0.0), vec4<f32>(bend[2], 0.0)));
}
";

static LEAF_SHADER: Shader = Shader {
    name: "leaf",
    entry: "main",
    parts: &[shaders::TYPES, shaders::CLOSEST_POINT, shaders::MESH, shaders::SURFACE, shaders::DEPTH, LEAF],
    overrides: &[&[]],
};

fn ask(questions: &[Question]) -> Vec<Answer> {
    let context = context();
    let parameters = Parameters { configurations: questions.len() as u32, least_distance: 1e-9, ..Zeroable::zeroed() };
    let parameters = StorageBuffer::uniform(&context, "parameters", &parameters).unwrap();
    let input = StorageBuffer::from_slice(&context, "questions", questions).unwrap();
    let output = StorageBuffer::new(&context, "answers", (size_of::<Answer>() * questions.len()) as u64).unwrap();
    output.poison(&context, output.size());
    let kernel = Kernel::new(&context, &LEAF_SHADER, &[]).unwrap();
    let buffers = [("parameters", &parameters), ("questions", &input), ("answers", &output)];
    run(&context, &kernel, &buffers, (questions.len() as u32).div_ceil(64));
    output.read(&context, questions.len()).unwrap()
}

fn run(context: &Context, kernel: &Kernel, buffers: &[(&str, &StorageBuffer)], workgroups: u32) {
    let bound = kernel.bind(context, buffers).unwrap();
    let mut encoder = context.device.create_command_encoder(&Default::default());
    context.record(&mut encoder, [Dispatch { kernel, bound: &bound, workgroups, bytes: 0 }]);
    let submission = context.queue.submit([encoder.finish()]);
    context.wait(&submission).unwrap();
}

fn vector(v: &[f32]) -> DVec3 {
    DVec3::new(v[0].into(), v[1].into(), v[2].into())
}

/// Triangles of centimetres around a proxy node at the origin.
fn random_questions(count: usize) -> Vec<Question> {
    let mut next = sequence(7);
    let mut point = |size: f64| [(next() * size) as f32, (next() * size) as f32, (next() * size) as f32, 0.0];
    (0..count)
        .map(|_| Question { corners: [(); 3].map(|()| point(0.02)), moves: [(); 3].map(|()| point(1.0)) })
        .collect()
}

/// Distances to plump triangles agree to 16 roundings of 6e-8 of their size: what closest_point adds up. The weights
/// are quotients of areas, whose rounding grows with the square of the triangle's aspect.
const DISTANCE_ROUNDING: f64 = 1e-6 * 0.02;

#[test]
fn closest_points_are_as_close_as_the_twins() {
    let mut questions = random_questions(2000);
    // Needles, doubled corners, single points, and the node on a corner, an edge, the face.
    for k in 0..questions.len() / 4 {
        let corners = &mut questions[4 * k].corners;
        match k % 6 {
            0 => corners[1] = corners[0],
            1 => corners[2] = corners[0].map(|x| x * (1.0 + 1e-6)),
            2 => (corners[1], corners[2]) = (corners[0], corners[0]),
            3 => corners[0] = [0.0; 4],
            4 => corners[1] = corners[0].map(|x| -x),
            _ => corners[2] = std::array::from_fn(|a| -corners[0][a] - corners[1][a]),
        }
    }
    let mut seen = [0; 3];
    for (question, answer) in questions.iter().zip(ask(&questions)) {
        let corners = question.corners.map(|c| vector(&c));
        let reference = closest_point(DVec3::ZERO, corners);
        let best = point_at(corners, reference.weights).length();
        let weights = answer.weights.map(f64::from);
        assert!((weights.iter().sum::<f64>() - 1.0).abs() < 1e-6 && weights.iter().all(|w| *w >= -1e-6), "{weights:?}");
        let found = point_at(corners, weights).length();
        let [a, b, c] = corners;
        let longest = a.distance(b).max(b.distance(c)).max(c.distance(a));
        let aspect = longest * longest / area_vector(corners).length().max(1e-30);
        let farthest = corners.iter().map(|corner| corner.length()).fold(0.0, f64::max);
        assert!(
            (found - best).abs() <= DISTANCE_ROUNDING * (1.0 + aspect * aspect),
            "{corners:?}: {found:e}, {best:e}"
        );
        assert!(found <= farthest + DISTANCE_ROUNDING, "{corners:?}: {found:e}");
        seen[if answer.feature < 3 { 0 } else { usize::from(answer.feature == 6) + 1 }] += 1;
    }
    assert!(seen.iter().all(|&count| count > 100), "corners, edges, faces: {seen:?}");
}

#[test]
fn depth_and_its_derivatives_are_the_twins() {
    let questions = random_questions(2000);
    let mut compared = 0;
    for (question, answer) in questions.iter().zip(ask(&questions)) {
        let corners = question.corners.map(|c| vector(&c));
        let point = closest_point(DVec3::ZERO, corners);
        let number = match point.feature {
            Feature::Vertex(k) => k,
            Feature::Edge(k) => 3 + k,
            Feature::Face => 6,
        };
        let doubled = area_vector(corners);
        let distance = point_at(corners, point.weights).length();
        // Where a feature's border is near, rounding chooses the side; slivers and near hits have steep derivatives.
        if number as u32 != answer.feature || doubled.length() < 1e-5 || distance < 1e-3 {
            continue;
        }
        compared += 1;
        let face = unit_or_zero(doubled);
        let measured @ (normal, depth, _) = measure(DVec3::ZERO, 0.0, &Facet::flat(corners), &point, face);
        assert!((depth - f64::from(answer.depth)).abs() < 4.0 * DISTANCE_ROUNDING);
        // Directions: rounding over the shortest length that is divided by.
        assert!(normal.distance(vector(&answer.normal)) < 1e-4, "{normal} {:?}", answer.normal);
        let carriers = Carriers::new((&[0, 1, 2], None), &point);
        let contact = Contact { multiplier: 1.0, ..Contact::new(0, carriers, measured) };
        let moves = question.moves.map(|v| vector(&v));
        let reaction = contact.second_variation(&contact.variation(|j| moves[j]));
        let reference = [0, 1, 2].map(|j| contact.at_node(&reaction, j));
        let size = reference.iter().map(|v| v.length()).fold(0.0, f64::max);
        for (expected, found) in reference.iter().zip(&answer.variation) {
            let error = expected.distance(vector(found));
            // Weights of a sliver are known to rounding over its height: 2e-8 m over 1e-5 m^2 / 0.05 m, with some
            // margin.
            assert!(error <= 2e-3 * size, "{number}: {expected} {found:?}");
        }
    }
    assert!(compared > 1200, "{compared}");
}

#[test]
fn proxy_nodes_are_placed_to_f32() {
    let chain_of = |name: &str| {
        let scene = Scene::load(format!("{}/datasets/{name}", env!("CARGO_MANIFEST_DIR"))).unwrap();
        (Chain::new(&scene.proxy), scene.grid.axes)
    };
    for name in ["sphere.toml", "mesh.toml"] {
        let (chain, axes) = chain_of(name);
        let mut next = sequence(3);
        let poses: Vec<Vec<f64>> = (0..300)
            .map(|_| {
                let within =
                    |axis: &crate::scene::AxisSpec| axis.start + axis.step * axis.count as f64 * (0.5 + 0.5 * next());
                axes.iter().map(within).collect()
            })
            .collect();
        let motions: Vec<[f32; 2]> = poses
            .iter()
            .flat_map(|q| q.iter().zip(&chain.joints))
            .map(|(q, joint)| match joint.kind {
                JointKind::Revolute => [q.cos() as f32, q.sin() as f32],
                JointKind::Prismatic => [*q as f32, 0.0],
            })
            .collect();
        let joints: Vec<Joint> = chain
            .joints
            .iter()
            .map(|joint| Joint {
                origin: joint.origin.as_vec3().to_array(),
                kind: u32::from(joint.kind == JointKind::Prismatic),
                axis: joint.axis.as_vec3().to_array(),
                padding: 0,
            })
            .collect();
        let nodes: Vec<ProxyNode> = chain
            .nodes
            .iter()
            .map(|node| ProxyNode { position: node.position.as_vec3().to_array(), link: node.link as u32 })
            .collect();
        let context = context();
        let parameters = Parameters {
            configurations: poses.len() as u32,
            joints: joints.len() as u32,
            proxy_nodes: nodes.len() as u32,
            ..Zeroable::zeroed()
        };
        let count = poses.len() * nodes.len();
        let output = StorageBuffer::new(&context, "positions", 16 * count as u64).unwrap();
        output.poison(&context, output.size());
        let kernel = Kernel::new(&context, &shaders::KINEMATICS, &[]).unwrap();
        let buffers = [
            ("parameters", &StorageBuffer::uniform(&context, "parameters", &parameters).unwrap()),
            ("joints", &StorageBuffer::from_slice(&context, "joints", &joints).unwrap()),
            ("proxy_nodes", &StorageBuffer::from_slice(&context, "nodes", &nodes).unwrap()),
            ("motions", &StorageBuffer::from_slice(&context, "motions", &motions).unwrap()),
            ("positions", &output),
        ];
        run(&context, &kernel, &buffers, (count as u32).div_ceil(64));
        let positions: Vec<[f32; 4]> = output.read(&context, count).unwrap();
        let mut pose = chain.new_pose();
        for (q, positions) in poses.iter().zip(positions.chunks(chain.nodes.len())) {
            chain.pose(q, &mut pose);
            for (expected, found) in pose.nodes.iter().zip(positions) {
                // Levers of 0.3 m, some twenty roundings of 6e-8 of them in a root-sum-of-squares.
                assert!(expected.distance(vector(found)) < 2e-7, "{name}: {expected} {found:?}");
            }
        }
    }
}

#[test]
fn a_lost_device_is_opened_anew() {
    let scene = Scene::load(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/scenes/sphere.toml")).unwrap();
    let object = Object::build(&scene.object).unwrap();
    let chain = Chain::new(&scene.proxy);
    let model = Model::new(&object, &chain, scene.contact);
    // A device of its own: the other tests want theirs.
    let own = Arc::new(Context::open(AdapterChoice::Any).unwrap());
    let mut solver =
        GpuSolver::with_room(Arc::clone(&own), &model, BatchCapacity { batch: 64, ..BatchCapacity::default() })
            .unwrap();
    let middle = |axis: &crate::scene::AxisSpec| axis.start + axis.step * (axis.count / 2) as f64;
    let q = crate::JointVector::from_slice(&scene.grid.axes.iter().map(middle).collect::<Vec<_>>());
    let before = solver.solve(&[q]).unwrap();
    assert_ne!(before[0].status, Status::Free);
    own.device.destroy();
    assert_eq!(format!("{:?}", solver.solve(&[q]).unwrap()), format!("{before:?}"));
    assert_eq!(Arc::strong_count(&own), 1, "the solver has let go of the lost device");
}

#[test]
fn one_number_for_a_pair_of_nodes_holds_the_compliance_of_isotropic_objects() {
    let mut scene = Scene::load(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/scenes/sphere.toml")).unwrap();
    for (kind, numbers) in [(SpringKind::Isotropic, 1), (SpringKind::Axial, 9)] {
        scene.object.material = Material::Springs(SpringSpec { kind, stiffness: 150.0 });
        let object = Object::build(&scene.object).unwrap();
        let chain = Chain::new(&scene.proxy);
        let model = Model::new(&object, &chain, scene.contact);
        let device = DeviceModel::new(&context(), &model).unwrap();
        let search = ForceSearch::new(&context(), &model, &device, BatchCapacity::default()).unwrap();
        assert_eq!(search.compliance.size(), 4 * numbers * (object.surface_nodes as u64).pow(2), "{kind:?}");
    }
}

#[test]
fn a_refused_shader_is_an_error_and_the_device_lives_on() {
    let broken = Shader { name: "broken", entry: "nowhere", parts: &[shaders::TYPES], overrides: &[&[]] };
    let refused = Kernel::new(&context(), &broken, &[]);
    assert!(matches!(refused, Err(GpuError::Refused(_))));
    let kernel = Kernel::new(&context(), &shaders::COMPACTION, &[]).unwrap();
    let some = StorageBuffer::new(&context(), "some", 4096).unwrap();
    let Err(GpuError::Refused(missing)) = kernel.bind(&context(), &[("parameters", &some), ("gaps", &some)]) else {
        panic!("a binding is missing");
    };
    assert!(missing.contains("list"), "{missing}");
    assert!(context().check().is_ok());
    let limit = context().binding_limit();
    assert!(matches!(StorageBuffer::new(&context(), "too much", limit + 1), Err(GpuError::TooLarge { .. })));
}

#[test]
fn what_no_kernel_wrote_is_found_out() {
    let scene = Scene::load(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/scenes/sphere.toml")).unwrap();
    let object = Object::build(&scene.object).unwrap();
    let chain = Chain::new(&scene.proxy);
    let model = Model::new(&object, &chain, scene.contact);
    let outcome: super::layout::SolverResult = Zeroable::zeroed();
    let touch: super::layout::Touch = Zeroable::zeroed();
    let q = crate::JointVector::zeros(3);
    let mut solver = Solver::new(&model);
    let mut unpack = |outcome, touch| super::unpack::unpack(&model, &mut solver, &q, &outcome, &[touch]);
    assert!(unpack(outcome, touch).is_none());
    let written = super::layout::SolverResult { status: Status::Contact as u32, touches: 1, ..Zeroable::zeroed() };
    assert!(unpack(written, touch).is_some());
    let beyond = super::layout::SolverResult { touches: 2, ..written };
    assert!(unpack(beyond, touch).is_none(), "more touches than there is room for");
}

#[test]
fn threads_that_share_a_device_each_read_back_what_is_theirs() {
    std::thread::scope(|scope| {
        for thread in 0..8u32 {
            scope.spawn(move || {
                for round in 0..200 {
                    let values = [1000 * thread + round; 5];
                    let buffer = StorageBuffer::from_slice(&context(), "shared", &values).unwrap();
                    assert_eq!(buffer.read::<u32>(&context(), values.len()).unwrap(), values);
                }
            });
        }
    });
}
