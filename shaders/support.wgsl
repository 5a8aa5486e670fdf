// What the equilibrium stages share: one workgroup a configuration, the object nodes A that carry contact force, the
// compliance among them, and contact with the deformed surface (twins: src/contact/support.rs and detection.rs).
//
// Forces live on A only and displacement is u = C f. Every sum runs in the same order in every invocation, so that all
// agree to the bit on what to do next, and barriers stay in uniform control flow.

// Invocations of the workgroup, and most proxy nodes in contact at a time: invocation k keeps contact k.
override WORKGROUP: u32 = 32u;
// Most object nodes in A.
override SUPPORT: u32 = 64u;
// Most contacts, at most WORKGROUP.
override CONTACTS: u32 = 32u;
// A size that follows; named, because naga 30 loses count of overrides in array sizes that are expressions.
override VECTOR_ENTRIES: u32 = VECTORS * SUPPORT;

@group(0) @binding(0) var<uniform> parameters: Parameters;
// Surface nodes at rest; then the bounding sphere (centre, radius) of each triangle; then each proxy node's radius in x.
@group(0) @binding(1) var<storage, read> rest: array<vec4<f32>>;
@group(0) @binding(2) var<storage, read> mesh: array<u32>;
// C over the surface coordinates, row-major [m/N].
@group(0) @binding(3) var<storage, read> compliance: array<f32>;
// Proxy nodes of all configurations of the chunk; w is the gap at rest.
@group(0) @binding(4) var<storage, read> positions: array<vec4<f32>>;
// Number of configurations in contact, then their numbers.
@group(0) @binding(5) var<storage, read> list: array<u32>;
@group(0) @binding(6) var<storage, read_write> outcomes: array<Outcome>;
// CONTACTS a configuration.
@group(0) @binding(7) var<storage, read_write> touches: array<Touch>;
// Displacement of all surface nodes, one configuration behind the other; w is unused.
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
// Not zero once A or the contacts outgrew their room.
var<workgroup> overflow: u32;
// Slots of each contact's three nodes, ABSENT for nodes that it does not act on.
var<workgroup> slots: array<vec3<u32>, WORKGROUP>;
// What each contact gives to its three nodes.
var<workgroup> shares: array<mat3x3<f32>, WORKGROUP>;
// Vectors on the support, one behind the other.
var<workgroup> vectors: array<vec3<f32>, VECTOR_ENTRIES>;

// Place of a vector's entry.
fn at(vector: u32, slot: u32) -> u32 {
    return vector * SUPPORT + slot;
}

// Slot of `node`, which is added if it has none. For one invocation.
fn support_add(node: u32) -> u32 {
    if node == ABSENT {
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

// Gives slots to the nodes of every contact; `nodes` is ABSENT where the contact does not act.
fn assign_slots(nodes: vec3<u32>, local: u32) {
    slots[local] = nodes;
    workgroupBarrier();
    if local == 0u {
        for (var k = 0u; k < parameters.lanes; k += 1u) {
            let nodes_k = slots[k];
            let slot_0 = support_add(nodes_k.x);
            let slot_1 = support_add(nodes_k.y);
            slots[k] = vec3<u32>(slot_0, slot_1, support_add(nodes_k.z));
        }
    }
    workgroupBarrier();
}

// Sum of all contacts' shares on one slot.
fn gather(slot: u32) -> vec3<f32> {
    var sum = vec3<f32>(0.0);
    for (var k = 0u; k < parameters.lanes; k += 1u) {
        let mine = vec3<f32>(slots[k] == vec3<u32>(slot));
        sum += shares[k] * mine;
    }
    return sum;
}

// A vector's entries at a contact's three nodes: columns.
fn entries(vector: u32, contact_slots: vec3<u32>) -> mat3x3<f32> {
    // ABSENT slots read slot 0: what is read there is multiplied by zero.
    let safe = select(contact_slots, vec3<u32>(0u), contact_slots == vec3<u32>(ABSENT));
    return mat3x3<f32>(vectors[at(vector, safe.x)], vectors[at(vector, safe.y)], vectors[at(vector, safe.z)]);
}

// Entry `slot` of C_AA times a vector.
fn multiply(vector: u32, slot: u32) -> vec3<f32> {
    let order = 3u * parameters.surface_nodes;
    let row = 3u * support_nodes[slot] * order;
    var sum = vec3<f32>(0.0);
    for (var other = 0u; other < support_count; other += 1u) {
        let v = vectors[at(vector, other)];
        let first = row + 3u * support_nodes[other];
        let second = first + order;
        let third = second + order;
        sum += vec3<f32>(compliance[first], compliance[second], compliance[third]) * v.x
            + vec3<f32>(compliance[first + 1u], compliance[second + 1u], compliance[third + 1u]) * v.y
            + vec3<f32>(compliance[first + 2u], compliance[second + 2u], compliance[third + 2u]) * v.z;
    }
    return sum;
}

// Displacement C v of all surface nodes, v a vector on the support; returns its greatest length.
fn displace(vector: u32, local: u32) -> f32 {
    let order = 3u * parameters.surface_nodes;
    var most = 0.0;
    for (var node = local; node < parameters.surface_nodes; node += WORKGROUP) {
        var u = vec3<f32>(0.0);
        for (var slot = 0u; slot < support_count; slot += 1u) {
            // C is symmetric: along a row, neighbouring invocations read neighbouring entries.
            let row = 3u * support_nodes[slot] * order + 3u * node;
            let v = vectors[at(vector, slot)];
            u += vec3<f32>(compliance[row], compliance[row + 1u], compliance[row + 2u]) * v.x;
            let second = row + order;
            u += vec3<f32>(compliance[second], compliance[second + 1u], compliance[second + 2u]) * v.y;
            let third = second + order;
            u += vec3<f32>(compliance[third], compliance[third + 1u], compliance[third + 2u]) * v.z;
        }
        displacement[displacement_base + node] = vec4<f32>(u, 0.0);
        most = max(most, length(u));
    }
    storageBarrier();
    return greatest(most, local);
}

// --- Detection ---

// Node j's position less x.
fn node_from(node: u32, x: vec3<f32>) -> vec3<f32> {
    return (rest[node].xyz - x) + displacement[displacement_base + node].xyz;
}

fn proxy_position(proxy_node: u32) -> vec3<f32> {
    return positions[position_base + proxy_node].xyz;
}

fn proxy_radius(proxy_node: u32) -> f32 {
    return rest[parameters.surface_nodes + parameters.triangles + proxy_node].x;
}

// Proxy node of each contact. Invocation k keeps contact k from the first touch on, also as a near miss.
var<workgroup> contact_nodes: array<u32, WORKGROUP>;
// Closest triangle of each contact, ABSENT while the node is far outside.
var<workgroup> contact_triangles: array<u32, WORKGROUP>;
var<workgroup> contact_count: u32;
// Proxy nodes near the surface, with their closest triangles, on their way to the contacts.
var<workgroup> near: array<vec2<u32>, WORKGROUP>;
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

// Brings the contacts up to date with `waiting` near nodes, of which `partial` says which touch. For one invocation.
fn sift(waiting: u32) {
    for (var k = 0u; k < waiting; k += 1u) {
        let place = near[k];
        var contact = 0u;
        while contact < contact_count && contact_nodes[contact] != place.x {
            contact += 1u;
        }
        if contact == contact_count {
            if partial[k].x == 0.0 {
                continue;
            }
            if contact == CONTACTS {
                overflow = 1u;
                continue;
            }
            contact_nodes[contact] = place.x;
            contact_count += 1u;
        }
        contact_triangles[contact] = place.y;
    }
}

// This invocation's contact with the surface as displaced, at most by `moved`: of every node that touches, or comes within
// `reach`, now or did so before in this configuration (then with a depth below zero, as it may touch again). Without one,
// depth and weights are zero.
fn deformed(moved: f32, reach: f32, local: u32) -> Contact {
    contact_triangles[local] = ABSENT;
    var contact = Contact();
    var proxy_node = 0u;
    var finished = false;
    // Passes over as many near nodes as there are invocations; a last one, without any, turns to the contacts.
    while !finished {
        var waiting = 0u;
        while proxy_node < parameters.proxy_nodes && waiting < WORKGROUP {
            // A node outside at rest by more than the surface moves is outside still.
            if positions[position_base + proxy_node].w <= moved + reach + parameters.least_distance {
                let triangle = closest_triangle(proxy_node, moved, local);
                if local == 0u {
                    near[waiting] = vec2<u32>(proxy_node, triangle);
                }
                waiting += 1u;
            }
            proxy_node += 1u;
        }
        workgroupBarrier();
        finished = waiting == 0u;
        var place = near[local];
        var taking_part = local < waiting;
        if finished {
            place = vec2<u32>(contact_nodes[local], contact_triangles[local]);
            taking_part = local < contact_count && place.y != ABSENT;
        }
        contact = Contact();
        if taking_part {
            contact = contact_at(place.x, place.y);
        }
        partial[local].x = select(0.0, 1.0, contact.depth > -reach);
        workgroupBarrier();
        if local == 0u {
            sift(waiting);
        }
        workgroupBarrier();
    }
    return contact;
}

// Nodes that a contact acts on.
fn acting_nodes(contact: Contact) -> vec3<u32> {
    return select(vec3<u32>(ABSENT), contact.nodes, contact.weights != vec3<f32>(0.0));
}

// --- Results ---

fn write_touch(place: u32, k: u32, nodes: vec3<u32>, proxy_node: u32, forces: mat3x3<f32>) {
    touches[place * CONTACTS + k] = Touch(nodes, proxy_node, forces[0], 0u, forces[1], 0u, forces[2], 0u);
}

// Where room ran out, nothing of the result counts.
fn write_outcome(place: u32, outcome: Outcome) {
    outcomes[place] = outcome;
    if overflow != 0u {
        outcomes[place].status = STATUS_OVERFLOW;
    }
}
