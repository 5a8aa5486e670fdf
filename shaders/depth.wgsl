// Depth of a proxy node below the surface, with its first and second derivative in the object's nodes (twin, with the
// formulas: src/contact/law/depth.rs).

struct Contact {
    nodes: vec3<u32>,
    proxy_node: u32,
    // Barycentric weights of the closest point; zero for nodes that the feature does not touch.
    weights: vec3<f32>,
    // r + s, positive in contact.
    depth: f32,
    // Outward unit direction N.
    normal: vec3<f32>,
    // s.
    distance: f32,
    // Unit direction of the edge, else zero.
    along: vec3<f32>,
    // 1/s on edges and at vertices, zero on faces.
    inverse_distance: f32,
    // Force lambda by which the curvature counts; kc depth at the solution.
    multiplier: f32,
    // g_j: columns.
    gradients: mat3x3<f32>,
}

// Depth of a node of the given radius at the origin, from the closest feature of the triangle (a, b, c).
// `normal_there`, its pseudonormal, decides the side, and stands in for N where the origin lies on the edge or vertex.
fn measure(
    radius: f32, a: vec3<f32>, b: vec3<f32>, c: vec3<f32>, closest: ClosestPoint, normal_there: vec3<f32>,
) -> Contact {
    var contact = Contact();
    contact.weights = closest.weights;
    let offset = closest.weights.x * a + closest.weights.y * b + closest.weights.z * c;
    if closest.feature == FEATURE_FACE {
        contact.normal = normal_there;
        contact.distance = dot(contact.normal, a);
        contact.gradients = face_gradients(a, b, c);
    } else {
        let length = length(offset);
        let side = select(-1.0, 1.0, dot(offset, normal_there) >= 0.0);
        contact.distance = side * length;
        contact.inverse_distance = side / max(length, parameters.least_distance);
        contact.normal = select(unit_or_zero(normal_there), side * offset / max(length, LEAST_DIVISOR),
            length > parameters.least_distance);
        if closest.feature >= FEATURE_EDGE {
            let tail = one_hot(closest.feature - FEATURE_EDGE);
            let head = one_hot((closest.feature - FEATURE_EDGE + 1u) % 3u);
            let corners = mat3x3<f32>(a, b, c);
            let along = corners * head - corners * tail;
            let square = max(dot(along, along), LEAST_DIVISOR);
            contact.along = along / sqrt(square);
            let share = head - tail;
            let gradient = along / square;
            contact.gradients = mat3x3<f32>(share.x * gradient, share.y * gradient, share.z * gradient);
        }
    }
    contact.depth = radius + contact.distance;
    return contact;
}

// In-plane gradients of the three barycentric weights.
fn face_gradients(a: vec3<f32>, b: vec3<f32>, c: vec3<f32>) -> mat3x3<f32> {
    let area_vector = cross(b - a, c - a);
    let square = max(dot(area_vector, area_vector), LEAST_DIVISOR);
    return mat3x3<f32>(
        cross(area_vector, c - b) / square, cross(area_vector, a - c) / square, cross(area_vector, b - a) / square);
}

// Second variation of the depth along node displacements v (columns): one vector a node.
fn second_variation(contact: Contact, v: mat3x3<f32>) -> mat3x3<f32> {
    let dp = v * contact.weights;
    let turn = contact.gradients * (contact.normal * v);
    let across = dp - contact.normal * dot(contact.normal, dp) - contact.along * dot(contact.along, dp);
    let carried = across * contact.inverse_distance - turn;
    let tilting = turn * contact.distance + dp;
    let tilt = tilting * contact.gradients;
    return mat3x3<f32>(
        carried * contact.weights.x - contact.normal * tilt.x,
        carried * contact.weights.y - contact.normal * tilt.y,
        carried * contact.weights.z - contact.normal * tilt.z,
    );
}

// Product of the Hessian of 1/2 kc depth^2 with node displacements v (columns): one vector a node. The force kc depth
// that weighs the curvature is the contact's multiplier.
fn hessian_product(contact: Contact, kc: f32, v: mat3x3<f32>) -> mat3x3<f32> {
    let stretch = contact.normal * (kc * dot(contact.normal, v * contact.weights));
    let product = second_variation(contact, v);
    return mat3x3<f32>(
        stretch * contact.weights.x + product[0] * contact.multiplier,
        stretch * contact.weights.y + product[1] * contact.multiplier,
        stretch * contact.weights.z + product[2] * contact.multiplier,
    );
}
