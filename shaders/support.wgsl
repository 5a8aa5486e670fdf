// What the equilibrium stages share: one workgroup a configuration, the object nodes A that carry contact force, and
// the compliance among them (twin: src/contact/linear/support.rs).
//
// Forces live on A only and displacement is u = C f. Every sum runs in the same order in every invocation, so that all
// agree to the bit on what to do next, and barriers stay in uniform control flow.
//
// How contacts act on A stands in springs.wgsl, which also keeps the vectors on A; what they are, by deformed.wgsl.

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
// Surface nodes at rest; then the bounding sphere (centre, radius) of each triangle; then each proxy node's radius in
// x; then the bounding sphere of each cluster of triangles.
@group(0) @binding(1) var<storage, read> rest: array<vec4<f32>>;
@group(0) @binding(2) var<storage, read> mesh: array<u32>;
// C over the surface nodes that it covers, row-major: 3 x 3 numbers for each pair, or one [m/N].
@group(0) @binding(3) var<storage, read> compliance: array<f32>;
// Proxy nodes of all configurations of the chunk; w is the gap at rest.
@group(0) @binding(4) var<storage, read> positions: array<vec4<f32>>;
// Number of configurations in contact, then their numbers.
@group(0) @binding(5) var<storage, read> list: array<u32>;
@group(0) @binding(6) var<storage, read_write> outcomes: array<SolverResult>;
// CONTACTS a configuration.
@group(0) @binding(7) var<storage, read_write> touches: array<Touch>;
// One configuration behind the other: what deformed.wgsl keeps of the covered surface nodes and the clusters of
// triangles.
@group(0) @binding(8) var<storage, read_write> workspace: array<vec4<f32>>;

// First entry of the workspace and first proxy node of this workgroup's configuration.
var<private> workspace_base: u32;
var<private> position_base: u32;

var<workgroup> partial: array<vec4<f32>, WORKGROUP>;

// Sum of `value` over the first `count` invocations, in every invocation.
fn add_up(value: vec4<f32>, count: u32, local: u32) -> vec4<f32> {
    partial[local] = value;
    workgroupBarrier();
    var sum = vec4<f32>(0.0);
    for (var k = 0u; k < min(count, WORKGROUP); k += 1u) {
        sum += partial[k];
    }
    workgroupBarrier();
    return sum;
}

// Greatest `value` of the first `count` invocations, in every invocation.
fn greatest(value: f32, count: u32, local: u32) -> f32 {
    partial[local].x = value;
    workgroupBarrier();
    var most = partial[0].x;
    for (var k = 1u; k < min(count, WORKGROUP); k += 1u) {
        most = max(most, partial[k].x);
    }
    workgroupBarrier();
    return most;
}

// How many invocations have a contact or a slot of the support.
fn busy() -> u32 {
    return max(contact_count, support_count);
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

// Slot of `node`, or ABSENT.
fn slot_of(node: u32) -> u32 {
    for (var slot = 0u; slot < support_count; slot += 1u) {
        if support_nodes[slot] == node {
            return slot;
        }
    }
    return ABSENT;
}

// Slot of `node`, which is added if it has none. For one invocation.
fn support_add(node: u32) -> u32 {
    if PARTIAL && place_of(node) == ABSENT {
        overflow = 1u;
        return ABSENT;
    }
    let slot = slot_of(node);
    if slot != ABSENT {
        return slot;
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
        let v = entry(vector, slot);
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

// --- Results ---

// Where room ran out, nothing of the result counts.
fn write_outcome(place: u32, outcome: SolverResult) {
    outcomes[place] = outcome;
    if overflow != 0u {
        outcomes[place].status = STATUS_OVERFLOW;
    }
}
