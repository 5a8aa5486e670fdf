// Closest point of a triangle to a point, and the feature that it lies on (twin:
// src/contact/geometry/closest_point.rs).

// Features are numbers: corner k is k, edge k (from corner k to k + 1) is FEATURE_EDGE + k, the interior FEATURE_FACE.
const FEATURE_EDGE: u32 = 3u;
const FEATURE_FACE: u32 = 6u;

struct ClosestPoint {
    // Barycentric weights of the three corners.
    weights: vec3<f32>,
    feature: u32,
}

// Closest point of the triangle (a, b, c) to x.
fn closest_point(x: vec3<f32>, a: vec3<f32>, b: vec3<f32>, c: vec3<f32>) -> ClosestPoint {
    let ab = b - a;
    let ac = c - a;
    let ax = x - a;
    let d1 = dot(ab, ax);
    let d2 = dot(ac, ax);
    if d1 <= 0.0 && d2 <= 0.0 {
        return vertex(0u);
    }
    let bx = x - b;
    let d3 = dot(ab, bx);
    let d4 = dot(ac, bx);
    if d3 >= 0.0 && d4 <= d3 {
        return vertex(1u);
    }
    let cx = x - c;
    let d5 = dot(ab, cx);
    let d6 = dot(ac, cx);
    if d6 >= 0.0 && d5 <= d6 {
        return vertex(2u);
    }
    let area_c = d1 * d4 - d3 * d2;
    if area_c <= 0.0 && d1 >= 0.0 && d3 <= 0.0 {
        return edge(0u, d1 / max(d1 - d3, LEAST_DIVISOR));
    }
    let area_a = d3 * d6 - d5 * d4;
    if area_a <= 0.0 && d4 >= d3 && d5 >= d6 {
        return edge(1u, (d4 - d3) / max((d4 - d3) + (d5 - d6), LEAST_DIVISOR));
    }
    let area_b = d5 * d2 - d1 * d6;
    if area_b <= 0.0 && d2 >= 0.0 && d6 <= 0.0 {
        return edge(2u, 1.0 - d2 / max(d2 - d6, LEAST_DIVISOR));
    }
    let area = max(area_a + area_b + area_c, LEAST_DIVISOR);
    let weight_b = area_b / area;
    let weight_c = area_c / area;
    return ClosestPoint(vec3<f32>(1.0 - weight_b - weight_c, weight_b, weight_c), FEATURE_FACE);
}

// One at corner k, zero at the others.
fn one_hot(k: u32) -> vec3<f32> {
    return vec3<f32>(vec3<u32>(0u, 1u, 2u) == vec3<u32>(k));
}

// Corner k.
fn vertex(k: u32) -> ClosestPoint {
    return ClosestPoint(one_hot(k), k);
}

// The point at share t along edge k.
fn edge(k: u32, t: f32) -> ClosestPoint {
    return ClosestPoint((1.0 - t) * one_hot(k) + t * one_hot((k + 1u) % 3u), FEATURE_EDGE + k);
}
