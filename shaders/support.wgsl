// What the equilibrium stages share: one workgroup a configuration, the object nodes A that carry contact force, the
// compliance among them, and the closest triangle of the deformed surface (twins: src/contact/support.rs and detection.rs).
//
// Forces live on A only and displacement is u = C f. Every sum runs in the same order in every invocation, so that all
// agree to the bit on what to do next, and barriers stay in uniform control flow.
//
// How contacts act on A is told by springs.wgsl, which also keeps the vectors on A.

// Invocations of the workgroup, and most proxy nodes in contact at a time: invocation k keeps contact k.
override WORKGROUP: u32 = 32u;
// Most object nodes in A.
override SUPPORT: u32 = 64u;
// Most contacts, at most WORKGROUP.
override CONTACTS: u32 = 32u;
// Whether the compliance leaves out surface nodes: then they do not give way, and none may carry force.
override PARTIAL: bool = false;
// Whether forces move nodes along themselves only: then the compliance has one number for a pair of nodes.
override ISOTROPIC: bool = false;

@group(0) @binding(0) var<uniform> parameters: Parameters;
// Surface nodes at rest; then the bounding sphere (centre, radius) of each triangle; then each proxy node's radius in x.
@group(0) @binding(1) var<storage, read> rest: array<vec4<f32>>;
@group(0) @binding(2) var<storage, read> mesh: array<u32>;
// C over the surface nodes that it covers, row-major: 3 x 3 numbers for each pair, or one [m/N].
@group(0) @binding(3) var<storage, read> compliance: array<f32>;
// Proxy nodes of all configurations of the chunk; w is the gap at rest.
@group(0) @binding(4) var<storage, read> positions: array<vec4<f32>>;
// Number of configurations in contact, then their numbers.
@group(0) @binding(5) var<storage, read> list: array<u32>;
@group(0) @binding(6) var<storage, read_write> outcomes: array<Outcome>;
// CONTACTS a configuration.
@group(0) @binding(7) var<storage, read_write> touches: array<Touch>;
// Displacement of the covered surface nodes, one configuration behind the other; w is unused.
@group(0) @binding(8) var<storage, read_write> displacement: array<vec4<f32>>;

const ABSENT: u32 = 0xffffffffu;

// First displacement and first proxy node of this workgroup's configuration.
var<private> displacement_base: u32;
var<private> position_base: u32;

var<workgroup> partial: array<vec4<f32>, WORKGROUP>;

// Sum of `value` over the workgroup, in every invocation.
fn add_up(value: vec4<f32>, local: u32) -> vec4<f32> {
    partial[local] = value;
    workgroupBarrier();
    var sum = vec4<f32>(0.0);
    for (var k = 0u; k < parameters.lanes; k += 1u) {
        sum += partial[k];
    }
    workgroupBarrier();
    return sum;
}

// Greatest `value` of the workgroup, in every invocation.
fn greatest(value: f32, local: u32) -> f32 {
    partial[local].x = value;
    workgroupBarrier();
    var most = partial[0].x;
    for (var k = 1u; k < parameters.lanes; k += 1u) {
        most = max(most, partial[k].x);
    }
    workgroupBarrier();
    return most;
}

// --- Support ---

// Surface node of each slot.
var<workgroup> support_nodes: array<u32, SUPPORT>;
var<workgroup> support_count: u32;
// Not zero once A or the contacts outgrew their room, or the compliance.
var<workgroup> overflow: u32;

// Place of a node among those that the compliance covers, or ABSENT.
fn place_of(node: u32) -> u32 {
    if PARTIAL {
        return mesh[9u * parameters.triangles + parameters.surface_nodes + 1u + node];
    }
    return node;
}

// Displacement of a surface node.
fn displaced(node: u32) -> vec3<f32> {
    let place = place_of(node);
    if PARTIAL && place == ABSENT {
        return vec3<f32>(0.0);
    }
    return displacement[displacement_base + place].xyz;
}

// Slot of `node`, which is added if it has none. For one invocation.
fn support_add(node: u32) -> u32 {
    if node == ABSENT {
        return ABSENT;
    }
    if PARTIAL && place_of(node) == ABSENT {
        overflow = 1u;
        return ABSENT;
    }
    for (var slot = 0u; slot < support_count; slot += 1u) {
        if support_nodes[slot] == node {
            return slot;
        }
    }
    if support_count == SUPPORT {
        overflow = 1u;
        return ABSENT;
    }
    support_nodes[support_count] = node;
    support_count += 1u;
    return support_count - 1u;
}

// Displacement of the node in `place` by a vector v on the support: its row of C times v.
fn response(vector: u32, place: u32) -> vec3<f32> {
    var u = vec3<f32>(0.0);
    for (var slot = 0u; slot < support_count; slot += 1u) {
        let v = vectors[at(vector, slot)];
        // C is symmetric: along a row of the other node, neighbouring invocations read neighbouring entries.
        let row = place_of(support_nodes[slot]) * parameters.covered;
        if ISOTROPIC {
            u += compliance[row + place] * v;
        } else {
            let first = 9u * row + 3u * place;
            let second = first + 3u * parameters.covered;
            let third = second + 3u * parameters.covered;
            u += vec3<f32>(compliance[first], compliance[first + 1u], compliance[first + 2u]) * v.x;
            u += vec3<f32>(compliance[second], compliance[second + 1u], compliance[second + 2u]) * v.y;
            u += vec3<f32>(compliance[third], compliance[third + 1u], compliance[third + 2u]) * v.z;
        }
    }
    return u;
}

// Entry `slot` of C_AA times a vector.
fn multiply(vector: u32, slot: u32) -> vec3<f32> {
    return response(vector, place_of(support_nodes[slot]));
}

// Displacement C v of all covered nodes, v a vector on the support; returns its greatest length.
fn displace(vector: u32, local: u32) -> f32 {
    var most = 0.0;
    for (var place = local; place < parameters.covered; place += WORKGROUP) {
        let u = response(vector, place);
        displacement[displacement_base + place] = vec4<f32>(u, 0.0);
        most = max(most, length(u));
    }
    storageBarrier();
    return greatest(most, local);
}

// --- Detection ---

// Node j's position less x.
fn node_from(node: u32, x: vec3<f32>) -> vec3<f32> {
    return (rest[node].xyz - x) + displaced(node);
}

fn proxy_position(proxy_node: u32) -> vec3<f32> {
    return positions[position_base + proxy_node].xyz;
}

fn proxy_radius(proxy_node: u32) -> f32 {
    return rest[parameters.surface_nodes + parameters.triangles + proxy_node].x;
}

// Proxy node of each contact. Invocation k keeps contact k from the first touch on, also as a near miss.
var<workgroup> contact_nodes: array<u32, WORKGROUP>;
var<workgroup> contact_count: u32;
// Closest triangle among each invocation's.
var<workgroup> candidates: array<u32, WORKGROUP>;

// The contact (or near miss, with depth <= 0) of a proxy node with the closest point of a triangle.
fn contact_at(proxy_node: u32, triangle: u32) -> Contact {
    let x = proxy_position(proxy_node);
    let nodes = vec3<u32>(corner(triangle, 0u), corner(triangle, 1u), corner(triangle, 2u));
    let a = node_from(nodes.x, x);
    let b = node_from(nodes.y, x);
    let c = node_from(nodes.z, x);
    let closest = closest_point(vec3<f32>(0.0), a, b, c);
    let normal = pseudonormal(triangle, closest.feature, x);
    var contact = measure(proxy_radius(proxy_node), a, b, c, closest, normal);
    contact.nodes = nodes;
    contact.proxy_node = proxy_node;
    return contact;
}

// Triangle of the deformed surface closest to a proxy node, by the whole workgroup; ties go to the lower number.
fn closest_triangle(proxy_node: u32, moved: f32, local: u32) -> u32 {
    let x = proxy_position(proxy_node);
    var least = FAR_AWAY;
    var best = 0u;
    for (var triangle = local; triangle < parameters.triangles; triangle += WORKGROUP) {
        let sphere = rest[parameters.surface_nodes + triangle];
        if distance(x, sphere.xyz) - sphere.w - moved > least {
            continue;
        }
        let a = node_from(corner(triangle, 0u), x);
        let b = node_from(corner(triangle, 1u), x);
        let c = node_from(corner(triangle, 2u), x);
        let closest = closest_point(vec3<f32>(0.0), a, b, c);
        let offset = closest.weights.x * a + closest.weights.y * b + closest.weights.z * c;
        if length(offset) < least {
            least = length(offset);
            best = triangle;
        }
    }
    partial[local].x = least;
    candidates[local] = best;
    workgroupBarrier();
    var nearest = partial[0].x;
    var triangle = candidates[0];
    for (var k = 1u; k < parameters.lanes; k += 1u) {
        if partial[k].x < nearest || (partial[k].x == nearest && candidates[k] < triangle) {
            nearest = partial[k].x;
            triangle = candidates[k];
        }
    }
    workgroupBarrier();
    return triangle;
}

// --- Results ---

// Where room ran out, nothing of the result counts.
fn write_outcome(place: u32, outcome: Outcome) {
    outcomes[place] = outcome;
    if overflow != 0u {
        outcomes[place].status = STATUS_OVERFLOW;
    }
}
