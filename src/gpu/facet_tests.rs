//! Facets of the contact surface on the device, in either precision, function by function, against their twins on the
//! CPU.

use super::{
    adapter::AdapterChoice,
    buffer::StorageBuffer,
    context::Context,
    kernel::Kernel,
    layout::Parameters,
    precision::Precision,
    shaders::{self, Shader},
};
use crate::{
    contact::geometry::{
        closest_point::Feature,
        facet::{Facet, directions},
        quartic::{CONTROLS, EXPONENTS},
    },
    random::Random,
};
use bytemuck::Zeroable;
use glam::DVec3;

/// A point, and the control points of a facet.
const QUESTION: usize = 3 + 3 * CONTROLS;

/// Weights and feature of the closest point, and at the facet's middle: point, normal, second derivative, angle at
/// corner 1.
const ANSWER: usize = 4 + 3 + 3 + 3 + 1;

const LEAF: &str = "
override SMOOTH: bool = true;
@group(0) @binding(0) var<uniform> parameters: Parameters;
@group(0) @binding(1) var<storage, read> questions: array<real>;
@group(0) @binding(2) var<storage, read_write> answers: array<real>;
// Read by functions that this kernel does not call.
@group(0) @binding(3) var<storage, read> mesh: array<u32>;
fn question(place: u32) -> vec3<real> {
    return vec3<real>(questions[3u * place], questions[3u * place + 1u], questions[3u * place + 2u]);
}
fn form(facet: u32, x: vec3<real>) {
    for (var k = 0u; k < 15u; k += 1u) {
        net[k] = question(16u * facet + 1u + k) - x;
    }
}
fn answer(at: u32, v: vec3<real>) {
    answers[at] = v.x;
    answers[at + 1u] = v.y;
    answers[at + 2u] = v.z;
}
@compute @workgroup_size(32)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x >= parameters.configurations {
        return;
    }
    form(id.x, question(16u * id.x));
    let closest = closest_on_facet().point;
    let at = 14u * id.x;
    answer(at, closest.weights);
    answers[at + 3u] = real(closest.feature);
    let jet = jet_at(vec3<real>(1.0, 1.0, 1.0) / 3.0);
    answer(at + 4u, jet.point);
    answer(at + 7u, normal_of(jet));
    answer(at + 10u, bend(jet, TOWARDS_1, TOWARDS_2));
    answers[at + 13u] = angle_at(jet_at(one_hot(1u)), 1u);
}
";

static LEAF_SHADER: [Shader; 2] = shaders::in_both(Shader {
    name: "facet_leaf",
    entry: "main",
    parts: &[shaders::TYPES, shaders::CLOSEST_POINT, shaders::MESH, shaders::FACET, LEAF],
    overrides: &[&[]],
    precision: Precision::Single,
});

fn ask(context: &Context, precision: Precision, questions: &[f64]) -> Vec<f64> {
    let count = questions.len() / QUESTION;
    let parameters = Parameters { configurations: count as u32, ..Zeroable::zeroed() };
    let parameters = StorageBuffer::uniform(context, "parameters", &[parameters]).unwrap();
    let input = StorageBuffer::from_slice(context, "questions", &precision.encode(questions)).unwrap();
    let bytes = precision.size() * ANSWER * count;
    let output = StorageBuffer::new(context, "answers", bytes as u64).unwrap();
    output.poison(context, output.size());
    let kernel = Kernel::new(context, precision.of(&LEAF_SHADER), &[]).unwrap();
    let bound =
        kernel.bind(context, &[("parameters", &parameters), ("questions", &input), ("answers", &output)]).unwrap();
    let mut encoder = context.device.create_command_encoder(&Default::default());
    let workgroups = (count as u32).div_ceil(32);
    context.record(&mut encoder, [kernel.dispatch(&bound, workgroups, 0)]);
    context.wait(&context.queue.submit([encoder.finish()])).unwrap();
    precision.decode(&output.read::<u8>(context, bytes).unwrap())
}

/// Bent facets with edges of about one, each with a point near it: above and below its inside, beside its edges, beyond
/// its corners.
fn samples(count: usize) -> Vec<(DVec3, [DVec3; CONTROLS])> {
    let mut random = Random::new(9);
    (0..count)
        .map(|_| {
            let corners = [DVec3::ZERO, DVec3::X, DVec3::Y].map(|corner| corner + 0.2 * random.vector());
            let flat =
                |[i, j, k]: [usize; 3]| 0.25 * (corners[0] * i as f64 + corners[1] * j as f64 + corners[2] * k as f64);
            let net = EXPONENTS.map(|at| flat(at) + 0.03 * random.vector());
            let facet = Facet::bent(net);
            let (u, v) = (random.between(-0.2, 1.0), random.between(-0.2, 1.0));
            let w = [1.0 - u - v, u, v];
            (facet.point(w) + facet.normal(w) * random.between(-0.2, 0.2), net)
        })
        .collect()
}

/// Greatest difference between numbers of about one after some hundred operations (1).
fn rounding(precision: Precision) -> f64 {
    match precision {
        Precision::Single => 1e-5,
        Precision::Double => 1e-13,
    }
}

/// Closest points, jets, normals and angles of facets of degree four are the twin's to rounding.
#[test]
fn bent_facets_are_the_twins() {
    let context = Context::open(AdapterChoice::Any).unwrap();
    compare(&context, Precision::Single);
    if context.adapter().double {
        compare(&context, Precision::Double);
    }
}

fn compare(context: &Context, precision: Precision) {
    let rounding = rounding(precision);
    let differ = |a: DVec3, b: DVec3| a.distance(b) > rounding * (1.0 + b.length());
    let samples = samples(500);
    let number = |v: DVec3| v.to_array();
    let questions: Vec<f64> =
        samples.iter().flat_map(|(x, net)| number(*x).into_iter().chain(net.iter().flat_map(|b| number(*b)))).collect();
    let (mut seen, mut vague) = ([0; 3], 0);
    for ((x, net), answer) in samples.iter().zip(ask(context, precision, &questions).chunks_exact(ANSWER)) {
        let facet = Facet::bent(*net);
        let expected = facet.closest(*x, f64::INFINITY).unwrap();
        let found = facet.point([answer[0], answer[1], answer[2]]);
        let nearest = facet.point(expected.weights);
        // Where a point is about as far from two edges rounding decides between them, but not on the distance.
        assert!((x.distance(found) - x.distance(nearest)).abs() < rounding, "{x} {expected:?} {answer:?}");
        // Where the distance hardly changes with the point, that is known to a root of rounding.
        vague += usize::from(found.distance(nearest) > rounding.sqrt());
        seen[if answer[3] < 3.0 { 0 } else { usize::from(answer[3] == 6.0) + 1 }] += 1;
        let kind = match expected.feature {
            Feature::Vertex(k) => k,
            Feature::Edge(k) => 3 + k,
            Feature::Face => 6,
        };
        vague += usize::from(kind as f64 != answer[3]);
        let middle = [1.0 / 3.0; 3];
        let jet = facet.jet(middle);
        let [d, e] = directions(Feature::Face) else { unreachable!() };
        let vector = |at: usize| DVec3::from_slice(&answer[at..]);
        // The device's are relative to x.
        assert!(!differ(vector(4) + *x, jet.point), "{} {}", vector(4) + *x, jet.point);
        assert!(!differ(vector(7), facet.normal(middle)));
        assert!(!differ(vector(10), jet.bend(*d, *e)), "{} {}", vector(10), jet.bend(*d, *e));
        assert!((answer[13] - facet.angle(1)).abs() < 1e-3, "{} {}", answer[13], facet.angle(1));
        let off = DVec3::X * 10.0 * rounding;
        assert!(differ(vector(4) + *x + off, jet.point), "the comparator must see ten times rounding");
    }
    assert!(seen.iter().all(|&count| count > 10) && vague < 5, "corners, edges, faces: {seen:?}; {vague}");
}
