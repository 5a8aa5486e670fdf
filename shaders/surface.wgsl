// Normals of the deformed faceted surface (twin: src/contact/geometry/normals.rs).
//
// The stage declares `parameters`, `mesh` (mesh.wgsl) and `node_from(j, x)`: node j's position less x. Geometry is
// computed relative to the point in question, where f32 is finest.

// Outward unit normal of a triangle near x.
fn face_normal(triangle: u32, x: vec3<f32>) -> vec3<f32> {
    let a = node_from(corner(triangle, 0u), x);
    return unit_or_zero(cross(node_from(corner(triangle, 1u), x) - a, node_from(corner(triangle, 2u), x) - a));
}

// Angle of a triangle at its corner `node`. It is only a weight: arctangent, good to 4096 ULP, is more than it needs.
fn corner_angle(triangle: u32, node: u32, x: vec3<f32>) -> f32 {
    let k = place_of_corner(triangle, node);
    let apex = node_from(node, x);
    let left = node_from(corner(triangle, (k + 1u) % 3u), x) - apex;
    let right = node_from(corner(triangle, (k + 2u) % 3u), x) - apex;
    return atan2(length(cross(left, right)), dot(left, right));
}

// Pseudonormal of a feature of a triangle near x, outward, not of length one (Baerentzen & Aanaes 2005): normals of the
// face, of the two faces at an edge, or of those around a vertex weighted by their angles there.
fn pseudonormal(triangle: u32, feature: u32, x: vec3<f32>) -> vec3<f32> {
    var first = 0u;
    var last = 1u;
    var node = 0u;
    if feature < FEATURE_EDGE {
        node = corner(triangle, feature);
        first = around_start(node);
        last = around_start(node + 1u);
    } else if feature < FEATURE_FACE {
        last = 2u;
    }
    var sum = vec3<f32>(0.0);
    for (var entry = first; entry < last; entry += 1u) {
        // One loop for all features: a normal at each of four places would quadruple the program.
        var face = triangle;
        var weight = 1.0;
        if feature < FEATURE_EDGE {
            face = around(entry);
            weight = corner_angle(face, node, x);
        } else if entry == 1u {
            face = across(triangle, feature - FEATURE_EDGE);
        }
        sum += weight * face_normal(face, x);
    }
    return sum;
}
