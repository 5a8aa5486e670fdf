// The closed triangle surface: closest point, pseudonormal, signed distance.
//
// The stage declares `parameters`, `mesh` and `node_position(j)`. `mesh` holds, one behind the other, three corners a
// triangle, three neighbours a triangle (across edge k, from corner k to corner k + 1), the starts of the lists of
// triangles around each node (one more than there are nodes), and those lists.

// Where on a triangle: at corner k (k), inside edge k (3 + k), or inside the face (6).
const FEATURE_EDGE: u32 = 3u;
const FEATURE_FACE: u32 = 6u;

// Closest point of a triangle as the weights of its corners.
struct Closest {
    weights: vec3<f32>,
    feature: u32,
}

fn corner(triangle: u32, k: u32) -> u32 {
    return mesh[3u * triangle + k];
}

fn across(triangle: u32, k: u32) -> u32 {
    return mesh[3u * (parameters.triangles + triangle) + k];
}

fn around_start(node: u32) -> u32 {
    return mesh[6u * parameters.triangles + node];
}

fn around(entry: u32) -> u32 {
    return mesh[6u * parameters.triangles + parameters.surface_nodes + 1u + entry];
}

// Point of triangle (a, b, c) closest to p (Ericson, Real-Time Collision Detection, section 5.1.5).
fn closest_on_triangle(p: vec3<f32>, a: vec3<f32>, b: vec3<f32>, c: vec3<f32>) -> Closest {
    let ab = b - a;
    let ac = c - a;
    let ap = p - a;
    let d1 = dot(ab, ap);
    let d2 = dot(ac, ap);
    if d1 <= 0.0 && d2 <= 0.0 {
        return Closest(vec3<f32>(1.0, 0.0, 0.0), 0u);
    }
    let bp = p - b;
    let d3 = dot(ab, bp);
    let d4 = dot(ac, bp);
    if d3 >= 0.0 && d4 <= d3 {
        return Closest(vec3<f32>(0.0, 1.0, 0.0), 1u);
    }
    let cp = p - c;
    let d5 = dot(ab, cp);
    let d6 = dot(ac, cp);
    if d6 >= 0.0 && d5 <= d6 {
        return Closest(vec3<f32>(0.0, 0.0, 1.0), 2u);
    }
    let vc = d1 * d4 - d3 * d2;
    if vc <= 0.0 && d1 >= 0.0 && d3 <= 0.0 {
        let t = d1 / max(d1 - d3, LEAST_DIVISOR);
        return Closest(vec3<f32>(1.0 - t, t, 0.0), FEATURE_EDGE);
    }
    let va = d3 * d6 - d5 * d4;
    if va <= 0.0 && d4 - d3 >= 0.0 && d5 - d6 >= 0.0 {
        let t = (d4 - d3) / max((d4 - d3) + (d5 - d6), LEAST_DIVISOR);
        return Closest(vec3<f32>(0.0, 1.0 - t, t), FEATURE_EDGE + 1u);
    }
    let vb = d5 * d2 - d1 * d6;
    if vb <= 0.0 && d2 >= 0.0 && d6 <= 0.0 {
        let t = d2 / max(d2 - d6, LEAST_DIVISOR);
        return Closest(vec3<f32>(1.0 - t, 0.0, t), FEATURE_EDGE + 2u);
    }
    let whole = max(va + vb + vc, LEAST_DIVISOR);
    return Closest(vec3<f32>(va, vb, vc) / whole, FEATURE_FACE);
}

// Unit vector along v, or zero where v has no direction.
fn direction(v: vec3<f32>) -> vec3<f32> {
    let squared = dot(v, v);
    return select(vec3<f32>(0.0), v * inverseSqrt(max(squared, LEAST_DIVISOR)), squared > LEAST_DIVISOR);
}

// Outward unit normal of a triangle.
fn face_normal(triangle: u32) -> vec3<f32> {
    let a = node_position(corner(triangle, 0u));
    return direction(cross(node_position(corner(triangle, 1u)) - a, node_position(corner(triangle, 2u)) - a));
}

// Normals of the faces around `node`, each weighted by its angle there. The angle comes from arctangent by WGSL's atan2,
// good to 4096 ULP: weights need no more, the sign of a distance is right for any positive weights close to the angles.
fn corner_normal(node: u32) -> vec3<f32> {
    var sum = vec3<f32>(0.0);
    let here = node_position(node);
    for (var entry = around_start(node); entry < around_start(node + 1u); entry += 1u) {
        let triangle = around(entry);
        let k = select(select(2u, 1u, corner(triangle, 1u) == node), 0u, corner(triangle, 0u) == node);
        let left = node_position(corner(triangle, (k + 1u) % 3u)) - here;
        let right = node_position(corner(triangle, (k + 2u) % 3u)) - here;
        let normal = cross(left, right);
        let angle = atan2(length(normal), dot(left, right));
        sum += angle * direction(normal);
    }
    return sum;
}

// Angle-weighted pseudonormal (Baerentzen and Aanaes 2005) where on the surface the closest point lies; not a unit
// vector.
fn pseudonormal(triangle: u32, feature: u32) -> vec3<f32> {
    if feature == FEATURE_FACE {
        return face_normal(triangle);
    }
    if feature >= FEATURE_EDGE {
        return face_normal(triangle) + face_normal(across(triangle, feature - FEATURE_EDGE));
    }
    return corner_normal(corner(triangle, feature));
}

// The foot's place in space.
fn foot_point(triangle: u32, weights: vec3<f32>) -> vec3<f32> {
    return weights.x * node_position(corner(triangle, 0u)) + weights.y * node_position(corner(triangle, 1u))
        + weights.z * node_position(corner(triangle, 2u));
}

// Distance from p to a foot, negative inside.
fn signed_distance(p: vec3<f32>, triangle: u32, closest: Closest) -> f32 {
    let offset = p - foot_point(triangle, closest.weights);
    return select(length(offset), -length(offset), dot(offset, pseudonormal(triangle, closest.feature)) < 0.0);
}
