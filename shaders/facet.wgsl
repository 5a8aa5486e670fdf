// One facet of the contact surface: a flat triangle, or one of degree four (twins, with the formulas:
// src/contact/geometry/facet.rs and quartic.rs). For one invocation; geometry is relative to the point in question,
// which is the origin.
//
// The stage declares SMOOTH.

// Control points of the current facet, in the twin's order; of a flat one only the corners, in places 0, 10 and 14.
var<private> net: array<vec3<f32>, 15>;

// Directions of the weights in which a point moves over a face.
const TOWARDS_1: vec3<f32> = vec3<f32>(-1.0, 1.0, 0.0);
const TOWARDS_2: vec3<f32> = vec3<f32>(-1.0, 0.0, 1.0);

// That in which it moves along edge k.
fn along_edge(k: u32) -> vec3<f32> {
    return one_hot((k + 1u) % 3u) - one_hot(k);
}

// A point with its derivatives by the weights: `slopes` by each, `bend_ij` by two of them.
struct Jet {
    point: vec3<f32>,
    slopes: mat3x3<f32>,
    bend_00: vec3<f32>,
    bend_01: vec3<f32>,
    bend_02: vec3<f32>,
    bend_11: vec3<f32>,
    bend_12: vec3<f32>,
    bend_22: vec3<f32>,
}

fn blend(w: vec3<f32>, a: vec3<f32>, b: vec3<f32>, c: vec3<f32>) -> vec3<f32> {
    return w.x * a + w.y * b + w.z * c;
}

// Its point at weights w, by de Casteljau's algorithm. Without loops, so that compilers keep all control points in
// registers.
fn jet_at(w: vec3<f32>) -> Jet {
    if !SMOOTH {
        var flat = Jet();
        flat.slopes = mat3x3<f32>(net[0], net[10], net[14]);
        flat.point = blend(w, net[0], net[10], net[14]);
        return flat;
    }
    let c0 = blend(w, net[0], net[1], net[2]);
    let c1 = blend(w, net[1], net[3], net[4]);
    let c2 = blend(w, net[2], net[4], net[5]);
    let c3 = blend(w, net[3], net[6], net[7]);
    let c4 = blend(w, net[4], net[7], net[8]);
    let c5 = blend(w, net[5], net[8], net[9]);
    let c6 = blend(w, net[6], net[10], net[11]);
    let c7 = blend(w, net[7], net[11], net[12]);
    let c8 = blend(w, net[8], net[12], net[13]);
    let c9 = blend(w, net[9], net[13], net[14]);
    let q0 = blend(w, c0, c1, c2);
    let q1 = blend(w, c1, c3, c4);
    let q2 = blend(w, c2, c4, c5);
    let q3 = blend(w, c3, c6, c7);
    let q4 = blend(w, c4, c7, c8);
    let q5 = blend(w, c5, c8, c9);
    let l0 = blend(w, q0, q1, q2);
    let l1 = blend(w, q1, q3, q4);
    let l2 = blend(w, q2, q4, q5);
    return Jet(blend(w, l0, l1, l2), mat3x3<f32>(4.0 * l0, 4.0 * l1, 4.0 * l2),
        12.0 * q0, 12.0 * q1, 12.0 * q2, 12.0 * q3, 12.0 * q4, 12.0 * q5);
}

// Derivative along d, and along d and e.
fn tangent(jet: Jet, d: vec3<f32>) -> vec3<f32> {
    return blend(d, jet.slopes[0], jet.slopes[1], jet.slopes[2]);
}

fn bend(jet: Jet, d: vec3<f32>, e: vec3<f32>) -> vec3<f32> {
    return blend(e, blend(d, jet.bend_00, jet.bend_01, jet.bend_02), blend(d, jet.bend_01, jet.bend_11, jet.bend_12),
        blend(d, jet.bend_02, jet.bend_12, jet.bend_22));
}

// Its outward unit normal; zero where it has none.
fn normal_of(jet: Jet) -> vec3<f32> {
    return unit_or_zero(cross(tangent(jet, TOWARDS_1), tangent(jet, TOWARDS_2)));
}

// Angle at corner k between the two edges. It is only a weight: arctangent, good to 4096 ULP, is more than it
// needs.
fn angle_at(jet: Jet, k: u32) -> f32 {
    let left = unit_or_zero(tangent(jet, along_edge(k)));
    let right = -unit_or_zero(tangent(jet, along_edge((k + 2u) % 3u)));
    return atan2(length(cross(left, right)), dot(left, right));
}

// A point of a facet, and its distance from the origin.
struct MeasuredPoint {
    point: ClosestPoint,
    distance: f32,
}

// The point of the current facet that is closest to the origin.
fn closest_on_facet() -> MeasuredPoint {
    let flat = closest_point(vec3<f32>(0.0), net[0], net[10], net[14]);
    if !SMOOTH {
        return MeasuredPoint(flat, length(blend(flat.weights, net[0], net[10], net[14])));
    }
    return closest_on_bent_facet(flat.weights);
}

// What the search below looks at next: an edge, by its number; the face; or a point that it has found.
const ON_FACE: u32 = 3u;
const FOUND: u32 = 4u;

// The same on a bent facet, searched from `start`: where the distance is least on the facet continued beyond its edges
// or, if that is outside, on the edges beyond which it lies. One loop for all, so that invocations that are on the face
// and on edges go together.
fn closest_on_bent_facet(start: vec3<f32>) -> MeasuredPoint {
    var best = MeasuredPoint(ClosestPoint(start, FEATURE_FACE), FAR_AWAY);
    var on = ON_FACE;
    var point = best.point;
    // Place on the edge, from its first corner to its second.
    var t = 0.0;
    var steps = 0u;
    // A bit for each edge that is left.
    var edges = 0u;
    loop {
        let jet = jet_at(point.weights);
        if on == FOUND {
            let away = length(jet.point);
            if away < best.distance {
                best = MeasuredPoint(point, away);
            }
        } else if on == ON_FACE {
            let step = step_on_face(jet);
            let u = point.weights.y + step.x;
            let v = point.weights.z + step.y;
            let w = vec3<f32>(1.0 - u - v, u, v);
            point.weights = w;
            steps += 1u;
            // Far outside Newton's method would not come back.
            let is_far = w.x < -1.0 || w.y < -1.0 || w.z < -1.0;
            if !(is_far || abs(step.x) + abs(step.y) < FACET_STEP || steps == FACET_ITERATIONS) {
                continue;
            }
            if w.x >= 0.0 && w.y >= 0.0 && w.z >= 0.0 {
                on = FOUND;
                continue;
            }
            edges = select(0u, 1u, w.z < 0.0) + select(0u, 2u, w.x < 0.0) + select(0u, 4u, w.y < 0.0);
        } else {
            let before = t;
            t = step_on_edge(jet, on, t);
            steps += 1u;
            point.weights = on_edge(on, t);
            if abs(t - before) < FACET_STEP || steps == FACET_ITERATIONS {
                point.feature = select(select(FEATURE_EDGE + on, (on + 1u) % 3u, t == 1.0), on, t == 0.0);
                on = FOUND;
            }
            continue;
        }
        if edges == 0u {
            break;
        }
        // On the next edge, from the point of it that is next to the start.
        on = firstTrailingBit(edges);
        edges &= edges - 1u;
        let head = dot(start, one_hot((on + 1u) % 3u));
        let sum = head + dot(start, one_hot(on));
        t = select(0.5, head / max(sum, LEAST_DIVISOR), sum > 0.0);
        point.weights = on_edge(on, t);
        steps = 0u;
    }
    return best;
}

// The point at t along edge k.
fn on_edge(k: u32, t: f32) -> vec3<f32> {
    return (1.0 - t) * one_hot(k) + t * one_hot((k + 1u) % 3u);
}

// Newton's step of the last two weights towards the least distance.
fn step_on_face(jet: Jet) -> vec2<f32> {
    let a = tangent(jet, TOWARDS_1);
    let b = tangent(jet, TOWARDS_2);
    let slope = vec2<f32>(dot(jet.point, a), dot(jet.point, b));
    let metric = vec3<f32>(dot(a, a), dot(a, b), dot(b, b));
    let full = metric + vec3<f32>(dot(jet.point, bend(jet, TOWARDS_1, TOWARDS_1)),
        dot(jet.point, bend(jet, TOWARDS_1, TOWARDS_2)), dot(jet.point, bend(jet, TOWARDS_2, TOWARDS_2)));
    // Where the distance is not convex, the metric alone leads downhill.
    let h = select(metric, full, full.x > 0.0 && full.x * full.z > full.y * full.y);
    let determinant = max(h.x * h.z - h.y * h.y, LEAST_DIVISOR);
    return vec2<f32>(h.y * slope.y - h.z * slope.x, h.y * slope.x - h.x * slope.y) / determinant;
}

// Where Newton's step leads from t along edge k.
fn step_on_edge(jet: Jet, k: u32, t: f32) -> f32 {
    let direction = along_edge(k);
    let along = tangent(jet, direction);
    let metric = dot(along, along);
    let full = metric + dot(jet.point, bend(jet, direction, direction));
    let next = t - dot(jet.point, along) / max(select(metric, full, full > 0.0), LEAST_DIVISOR);
    return min(max(next, 0.0), 1.0);
}
