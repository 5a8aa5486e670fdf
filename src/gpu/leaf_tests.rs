//! Leaf functions of the kernels, each on its own, against their CPU twins in f64 on the same inputs.

use super::{
    adapter::AdapterChoice,
    buffer::StorageBuffer,
    context::Context,
    error::GpuError,
    kernel::Kernel,
    layout::{Parameters, SearchParameters},
    model::{DeviceModel, joints_and_nodes},
    pipeline::BatchCapacity,
    precision::Precision,
    search_model::{SearchModel, reals, words},
    shaders::{self, Shader},
    solver::GpuSolver,
    stages::Found,
    unpack::unpack,
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
use bytemuck::Zeroable;
use glam::DVec3;
use std::sync::{Arc, OnceLock};

fn context() -> Arc<Context> {
    static CONTEXT: OnceLock<Arc<Context>> = OnceLock::new();
    Arc::clone(CONTEXT.get_or_init(|| {
        Arc::new(Context::open(AdapterChoice::Any).unwrap_or_else(|error| panic!("GPU tests need an adapter: {error}")))
    }))
}

/// A triangle relative to a proxy node, and displacements of its corners.
#[derive(Clone, Copy)]
struct Question {
    corners: [DVec3; 3],
    moves: [DVec3; 3],
}

/// The kernel's answer: the closest point, and the row of the contact.
struct Answer {
    weights: [f64; 3],
    feature: usize,
    normal: DVec3,
    depth: f64,
    /// Force on each corner by the second variation of the depth.
    variation: [DVec3; 3],
}

/// Numbers of an answer.
const ANSWER: usize = 17;

/// A row for each invocation, in a workspace of its own.
const LEAF: &str = "
@group(0) @binding(9) var<storage, read> questions: array<real>;
@group(0) @binding(10) var<storage, read_write> answers: array<real>;
fn question(place: u32) -> vec3<real> {
    return vec3<real>(questions[3u * place], questions[3u * place + 1u], questions[3u * place + 2u]);
}
fn answer(at: u32, v: vec3<real>) {
    answers[at] = v.x;
    answers[at + 1u] = v.y;
    answers[at + 2u] = v.z;
}
@compute @workgroup_size(WORKGROUP)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x >= parameters.configurations {
        return;
    }
    take_place(id.x);
    net[0] = question(6u * id.x);
    net[10] = question(6u * id.x + 1u);
    net[14] = question(6u * id.x + 2u);
    let closest = closest_on_facet().point;
    let jet = jet_at(closest.weights);
    write_row(0u, 0u, 0u, 0u, closest, jet, normal_of(jet));
    let at = at_numbers(0u, 0u);
    let weights = at + NODE_WEIGHTS;
    let carriers = parameters.carriers;
    var v = Variation();
    for (var j = 0u; j < 3u; j += 1u) {
        let moved = question(6u * id.x + 3u + j);
        v.point += scalar(weights + j) * moved;
        v.tangent_0 += scalar(weights + carriers + j) * moved;
        v.tangent_1 += scalar(weights + 2u * carriers + j) * moved;
    }
    let bend = second_variation(at, v);
    let first = 17u * id.x;
    answer(first, closest.weights);
    answers[first + 3u] = real(closest.feature);
    answer(first + 4u, vector_at(at + NORMAL));
    answers[first + 7u] = scalar(at + DEPTH);
    for (var j = 0u; j < 3u; j += 1u) {
        answer(first + 8u + 3u * j, scalar(weights + j) * bend.point + scalar(weights + carriers + j) * bend.tangent_0
            + scalar(weights + 2u * carriers + j) * bend.tangent_1);
    }
}
";

static LEAF_SHADER: [Shader; 2] = shaders::in_both(Shader {
    name: "leaf",
    entry: "main",
    parts: &[
        shaders::SEARCH_TYPES,
        shaders::WORKSPACE,
        shaders::SEARCH_STATE,
        shaders::LISTING,
        shaders::CLOSEST_POINT,
        shaders::MESH,
        shaders::FACET,
        shaders::DEFORMED_FACET,
        shaders::DEPTH_ROWS,
        "const OWN_PAIRS: u32 = STEPPED_PAIRS;\n",
        shaders::SEARCH_SUPPORT,
        LEAF,
    ],
    overrides: &[&[]],
    precision: Precision::Single,
});

/// Returns the precisions of the adapter: both where it has f64.
fn precisions() -> &'static [Precision] {
    if context().adapter().double { &[Precision::Single, Precision::Double] } else { &[Precision::Single] }
}

fn ask(precision: Precision, questions: &[Question]) -> Vec<Answer> {
    let context = context();
    let count = questions.len();
    let mut parameters = SearchParameters {
        configurations: count as u32,
        room: count as u32,
        proxy_nodes: 1,
        contacts: 1,
        support: 1,
        carriers: 4,
        least_distance: 1e-9,
        ..Zeroable::zeroed()
    };
    (parameters.words, parameters.reals) = (words(&parameters), reals(&parameters));
    let numbers: Vec<f64> =
        questions.iter().flat_map(|q| [q.corners, q.moves].concat()).flat_map(|v| v.to_array()).collect();
    let of = |what, numbers: &[f64]| StorageBuffer::from_slice(&context, what, &precision.encode(numbers)).unwrap();
    let room = |what, bytes: usize| StorageBuffer::new(&context, what, bytes as u64).unwrap();
    let bytes = precision.size() * ANSWER * count;
    let output = room("answers", bytes);
    output.poison(&context, output.size());
    let kernel = Kernel::new(&context, precision.of(&LEAF_SHADER), &[]).unwrap();
    let uniform = StorageBuffer::uniform(&context, "parameters", &parameters.encode(precision)).unwrap();
    let buffers = [
        ("parameters", &uniform),
        // Radius and share of the proxy node.
        ("surface", &of("surface", &[0.0, 1.0, 0.0, 0.0])),
        ("mesh", &StorageBuffer::from_slice(&context, "mesh", &[0, 1, 2, u32::MAX]).unwrap()),
        ("list", &room("list", 4 * (count + 1))),
        ("words", &room("words", 4 * (2 * count + 1 + count * parameters.words as usize))),
        ("reals", &room("reals", precision.size() * count * parameters.reals as usize)),
        ("questions", &of("questions", &numbers)),
        ("answers", &output),
    ];
    run(&context, &kernel, &buffers, (count as u32).div_ceil(32));
    let answers = precision.decode(&output.read::<u8>(&context, bytes).unwrap());
    let vector = |at: &[f64]| DVec3::from_slice(at);
    let answer = |at: &[f64]| Answer {
        weights: [at[0], at[1], at[2]],
        feature: at[3] as usize,
        normal: vector(&at[4..]),
        depth: at[7],
        variation: [vector(&at[8..]), vector(&at[11..]), vector(&at[14..])],
    };
    answers.chunks_exact(ANSWER).map(answer).collect()
}

fn run(context: &Context, kernel: &Kernel, buffers: &[(&str, &StorageBuffer)], workgroups: u32) {
    let bound = kernel.bind(context, buffers).unwrap();
    let mut encoder = context.device.create_command_encoder(&Default::default());
    context.record(&mut encoder, [kernel.dispatch(&bound, workgroups, 0)]);
    let submission = context.queue.submit([encoder.finish()]);
    context.wait(&submission).unwrap();
}

/// Triangles of centimetres around a proxy node at the origin, of numbers that f32 has.
fn random_questions(count: usize) -> Vec<Question> {
    let mut next = sequence(7);
    let mut point = |size: f64| DVec3::from_array([(); 3].map(|()| f64::from((next() * size) as f32)));
    (0..count)
        .map(|_| Question { corners: [(); 3].map(|()| point(0.02)), moves: [(); 3].map(|()| point(1.0)) })
        .collect()
}

/// Rounding of a distance to plump triangles: sixteen roundings of their size, which is what closest_point adds up (m).
/// The weights are quotients of areas, whose rounding grows with the square of the triangle's aspect.
fn distance_rounding(precision: Precision) -> f64 {
    16.0 * 0.02 * unit_rounding(precision)
}

/// Rounding of a number, relative to it (1).
fn unit_rounding(precision: Precision) -> f64 {
    match precision {
        Precision::Single => f64::from(f32::EPSILON) / 2.0,
        Precision::Double => f64::EPSILON / 2.0,
    }
}

#[test]
fn closest_points_are_as_close_as_the_twins() {
    let mut questions = random_questions(2000);
    // Needles, doubled corners, single points, and the node on a corner, an edge, the face.
    for k in 0..questions.len() / 4 {
        let corners = &mut questions[4 * k].corners;
        match k % 6 {
            0 => corners[1] = corners[0],
            1 => corners[2] = (corners[0] * (1.0 + 1e-6)).as_vec3().as_dvec3(),
            2 => (corners[1], corners[2]) = (corners[0], corners[0]),
            3 => corners[0] = DVec3::ZERO,
            4 => corners[1] = -corners[0],
            _ => corners[2] = -corners[0] - corners[1],
        }
    }
    for &precision in precisions() {
        let mut seen = [0; 3];
        for (question, answer) in questions.iter().zip(ask(precision, &questions)) {
            let corners = question.corners;
            let reference = closest_point(DVec3::ZERO, corners);
            let best = point_at(corners, reference.weights).length();
            let weights = answer.weights;
            assert!(
                (weights.iter().sum::<f64>() - 1.0).abs() < 1e-6 && weights.iter().all(|w| *w >= -1e-6),
                "{weights:?}"
            );
            let found = point_at(corners, weights).length();
            let [a, b, c] = corners;
            let longest = a.distance(b).max(b.distance(c)).max(c.distance(a));
            let aspect = longest * longest / area_vector(corners).length().max(1e-30);
            let farthest = corners.iter().map(|corner| corner.length()).fold(0.0, f64::max);
            let rounding = distance_rounding(precision);
            assert!((found - best).abs() <= rounding * (1.0 + aspect * aspect), "{corners:?}: {found:e}, {best:e}");
            assert!(found <= farthest + rounding, "{corners:?}: {found:e}");
            seen[if answer.feature < 3 { 0 } else { usize::from(answer.feature == 6) + 1 }] += 1;
        }
        assert!(seen.iter().all(|&count| count > 100), "corners, edges, faces: {seen:?}");
    }
}

#[test]
fn depth_and_its_derivatives_are_the_twins() {
    let questions = random_questions(2000);
    for &precision in precisions() {
        let mut compared = 0;
        for (question, answer) in questions.iter().zip(ask(precision, &questions)) {
            let corners = question.corners;
            let point = closest_point(DVec3::ZERO, corners);
            let number = match point.feature {
                Feature::Vertex(k) => k,
                Feature::Edge(k) => 3 + k,
                Feature::Face => 6,
            };
            let doubled = area_vector(corners);
            let distance = point_at(corners, point.weights).length();
            // Where a feature's border is near, rounding chooses the side; slivers and near hits have steep
            // derivatives.
            if number != answer.feature || doubled.length() < 1e-5 || distance < 1e-3 {
                continue;
            }
            compared += 1;
            let measured @ (normal, depth, _) =
                measure(DVec3::ZERO, 0.0, &Facet::flat(corners), &point, unit_or_zero(doubled));
            assert!((depth - answer.depth).abs() < 4.0 * distance_rounding(precision));
            // Directions: rounding over the shortest length that is divided by, 16 of 0.02 m over 1 mm, with its
            // square.
            let steep = 1600.0 * unit_rounding(precision);
            assert!(normal.distance(answer.normal) < steep, "{normal} {}", answer.normal);
            let carriers = Carriers::new((&[0, 1, 2], None), &point);
            let contact = Contact { multiplier: 1.0, ..Contact::new(0, carriers, measured) };
            let reaction = contact.second_variation(&contact.variation(|j| question.moves[j]));
            let reference = [0, 1, 2].map(|j| contact.at_node(&reaction, j));
            let size = reference.iter().map(|v| v.length()).fold(0.0, f64::max);
            for (expected, found) in reference.iter().zip(answer.variation) {
                // Weights of a sliver are known to rounding over its height: 2e-8 m in f32 over 1e-5 m^2 / 0.05 m, with
                // some margin.
                let error = expected.distance(found);
                assert!(error <= 20.0 * steep * size, "{number}: {expected} {found}");
            }
        }
        assert!(compared > 1200, "{compared}");
    }
}

#[test]
fn proxy_nodes_are_placed_to_rounding() {
    for name in ["sphere.toml", "mesh.toml"] {
        let scene = Scene::load(format!("{}/datasets/{name}", env!("CARGO_MANIFEST_DIR"))).unwrap();
        let object = Object::build(&scene.object).unwrap();
        let chain = Chain::new(&scene.proxy);
        let model = Model::new(&object, &chain, scene.contact);
        let mut next = sequence(3);
        let mut within =
            |axis: &crate::scene::AxisSpec| axis.start + axis.step * axis.count as f64 * (0.5 + 0.5 * next());
        let poses: Vec<Vec<f64>> = (0..300).map(|_| scene.grid.axes.iter().map(&mut within).collect()).collect();
        for &precision in precisions() {
            let mut pose = chain.new_pose();
            let placed = place(precision, &model, &poses);
            for (q, placed) in poses.iter().zip(placed.chunks_exact(3 * chain.nodes.len())) {
                chain.pose(q, &mut pose);
                for (expected, found) in pose.nodes.iter().zip(placed.as_chunks::<3>().0) {
                    let found = DVec3::from_array(*found) + model.surface.centre;
                    // Levers of 0.3 m, some twenty roundings of them in a root-sum-of-squares.
                    let rounding = 10.0 * 0.3 * unit_rounding(precision);
                    assert!(expected.distance(found) < rounding, "{name}: {expected} {found}");
                }
            }
        }
    }
}

/// Proxy nodes relative to the object's centre, three coordinates each (m).
fn place(precision: Precision, model: &Model<'_>, poses: &[Vec<f64>]) -> Vec<f64> {
    let chain = model.chain;
    let motion = |(q, joint): (&f64, &crate::scene::JointSpec)| match joint.kind {
        JointKind::Revolute => [q.cos(), q.sin()],
        JointKind::Prismatic => [*q, 0.0],
    };
    let motions: Vec<f64> = poses.iter().flat_map(|q| q.iter().zip(&chain.joints).flat_map(motion)).collect();
    let context = context();
    let parameters = Parameters {
        configurations: poses.len() as u32,
        joints: chain.joints.len() as u32,
        proxy_nodes: chain.nodes.len() as u32,
        ..Zeroable::zeroed()
    };
    let of = |what, numbers: &[f64]| StorageBuffer::from_slice(&context, what, &precision.encode(numbers)).unwrap();
    let count = poses.len() * chain.nodes.len();
    let bytes = 3 * precision.size() * count;
    let output = StorageBuffer::new(&context, "placed", bytes as u64).unwrap();
    output.poison(&context, output.size());
    let kernel = Kernel::new(&context, precision.of(&shaders::KINEMATICS), &[]).unwrap();
    let buffers = [
        ("parameters", &StorageBuffer::uniform(&context, "parameters", &[parameters]).unwrap()),
        ("chain", &of("chain", &joints_and_nodes(model))),
        ("motions", &of("motions", &motions)),
        ("placed", &output),
        ("positions", &StorageBuffer::new(&context, "positions", 16 * count as u64).unwrap()),
    ];
    run(&context, &kernel, &buffers, (count as u32).div_ceil(64));
    precision.decode(&output.read::<u8>(&context, bytes).unwrap())
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
        GpuSolver::with_room(Arc::clone(&own), &model, BatchCapacity { chunk: 64, ..BatchCapacity::default() })
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
        for &precision in precisions() {
            let device = DeviceModel::new(&context(), &model, precision).unwrap();
            let search = SearchModel::new(&context(), &model, &device, 1).unwrap();
            let entries = numbers * (object.surface_nodes as u64).pow(2);
            assert_eq!(search.compliance.size(), precision.size() as u64 * entries, "{kind:?}");
        }
    }
}

#[test]
fn a_refused_shader_is_an_error_and_the_device_lives_on() {
    let broken = Shader { name: "broken", entry: "nowhere", parts: &[shaders::TYPES], ..shaders::DETECTION };
    let refused = Kernel::new(&context(), &broken, &[]);
    assert!(matches!(refused, Err(GpuError::Refused(_))));
    let kernel = Kernel::new(&context(), &shaders::KINEMATICS[0], &[]).unwrap();
    let some = StorageBuffer::new(&context(), "some", 4096).unwrap();
    let Err(GpuError::Refused(missing)) = kernel.bind(&context(), &[("parameters", &some), ("chain", &some)]) else {
        panic!("a binding is missing");
    };
    assert!(missing.contains("motions"), "{missing}");
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
    let q = crate::JointVector::zeros(3);
    let mut solver = Solver::new(&model);
    let mut unpack = |record, touches: usize| {
        let found = Found {
            records: vec![record],
            amounts: vec![0.0; 2 + q.len()],
            touches: vec![[0; 4]; touches],
            presses: vec![0.5; 6 * touches],
        };
        unpack(&model, &mut solver, (&q, -0.01), &found, (0, 0), Precision::Double)
    };
    assert!(unpack([0; 4], 1).is_none());
    let written = [Status::Contact as u32, 1, 1, 0];
    assert!(unpack(written, 1).is_some());
    assert!(unpack(written, 0).is_none(), "more touches than there are");
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
