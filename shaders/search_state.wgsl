// What the stages of the search work on: their bindings, proxy and object.

// Passes through loops after which an invocation goes on in another dispatch. llvmpipe stops all loops after 65,535.
override LOOP_BUDGET: u32 = 30000u;

@group(0) @binding(0) var<uniform> parameters: SearchParameters;
// Bounding spheres (bounding_spheres.wgsl); radius, and share of the stiffness, of each proxy node; nodes at rest; the
// parts named above.
@group(0) @binding(1) var<storage, read> surface: array<vec4<real>>;
@group(0) @binding(2) var<storage, read> mesh: array<u32>;
// C over the places that it covers, row-major: 3 x 3 numbers for each pair, or one [m/N].
@group(0) @binding(3) var<storage, read> compliance: array<real>;
// Proxy nodes of all configurations of the section, three coordinates each.
@group(0) @binding(4) var<storage, read> placed: array<real>;
// The same in f32; w is the gap to the flat triangles at rest.
@group(0) @binding(5) var<storage, read> positions: array<vec4<f32>>;
// Places in the section of unfinished configurations, room for as many, their number, then the words of each workspace.
@group(0) @binding(6) var<storage, read_write> words: array<u32>;
@group(0) @binding(7) var<storage, read_write> reals: array<vec4<real>>;
// Of each workspace the vectors on its support, four numbers an entry.
@group(0) @binding(8) var<storage, read_write> vectors: array<vec4<real>>;

// Adds to what the search took; for one invocation.
fn tally(what: u32, amount: u32) {
    set_word(what, word(what) + amount);
}

fn proxy_position(node: u32) -> vec3<real> {
    let at = 3u * (member * parameters.proxy_nodes + node);
    return vec3<real>(placed[at], placed[at + 1u], placed[at + 2u]);
}

// Radius of a proxy node, its share of the stiffness, and the link that it hangs on.
fn proxy_radius(node: u32) -> real {
    return surface[at_proxy() + node].x;
}

fn proxy_share(node: u32) -> real {
    return surface[at_proxy() + node].y;
}

fn proxy_link(node: u32) -> u32 {
    return mesh[parameters.at_links + node];
}

fn at_proxy() -> u32 {
    return 2u * parameters.leaves;
}

// Signed distance of a proxy node to the flat triangles at rest, known to gap_band, or a bound below it.
fn rest_distance(node: u32) -> real {
    return real(positions[member * parameters.proxy_nodes + node].w) + proxy_radius(node);
}

// A bound above its distance to the surface at rest.
fn farthest_at_rest(node: u32) -> real {
    let gap = real(positions[member * parameters.proxy_nodes + node].w);
    return select(FAR_AWAY, abs(gap + proxy_radius(node)) + parameters.gap_band, gap <= parameters.known_to);
}

// Position at rest of the surface node in `place`.
fn at_rest(place: u32) -> vec3<real> {
    return surface[at_proxy() + parameters.proxy_nodes + place].xyz;
}

// Where column `entry`, and vector `vector`, of this workspace begin: there is room for as many columns as rows.
fn column_base(entry: u32) -> u32 {
    let all = VECTORS + select(0u, 2u * parameters.joints, WITH_TANGENT);
    let length = parameters.contacts * column_length() + all * parameters.support;
    return place_taken * length + entry * column_length();
}

fn column_length() -> u32 {
    return select(parameters.support, (parameters.support + 3u) / 4u, ISOTROPIC);
}

fn vector_base(vector: u32) -> u32 {
    return column_base(parameters.contacts) + vector * parameters.support;
}

fn vector_entry(vector: u32, slot: u32) -> vec3<real> {
    return vectors[vector_base(vector) + slot].xyz;
}

fn put(vector: u32, slot: u32, value: vec3<real>) {
    vectors[vector_base(vector) + slot] = vec4<real>(value, 0.0);
}

// Displacement of the support by a unit push of the row that touches in place `entry`: of an isotropic object its size
// at each node, along the row's normal.
fn column_entry(entry: u32, slot: u32) -> vec3<real> {
    return vectors[column_base(entry) + slot].xyz;
}

fn column_size(entry: u32, slot: u32) -> real {
    return vectors[column_base(entry) + slot / 4u][slot % 4u];
}

// Some slots of the support, and the forces on them.
var<workgroup> pressed: array<u32, WORKGROUP>;
var<workgroup> pressing: array<vec3<real>, WORKGROUP>;

// Displacements of the nodes in four places by a vector of forces on the support: their rows of C times the vector. For
// all invocations together.
fn responses(vector: u32, places: vec4<u32>, local: u32) -> array<vec3<real>, 4> {
    var u = array<vec3<real>, 4>();
    let slots = word(SLOTS);
    for (var first = 0u; first < slots; first += WORKGROUP) {
        let count = min(slots - first, WORKGROUP);
        workgroupBarrier();
        if local < count {
            pressed[local] = word(at_place(first + local));
            pressing[local] = vector_entry(vector, first + local);
        }
        workgroupBarrier();
        for (var k = 0u; k < count; k += 1u) {
            u[0] += moved_by(pressed[k], pressing[k], places.x);
            u[1] += moved_by(pressed[k], pressing[k], places.y);
            u[2] += moved_by(pressed[k], pressing[k], places.z);
            u[3] += moved_by(pressed[k], pressing[k], places.w);
        }
    }
    return u;
}

// Displacement of the node in `place` by a force on another one. C is symmetric: along a row of the other node,
// neighbouring invocations read neighbouring entries.
fn moved_by(other: u32, force: vec3<real>, place: u32) -> vec3<real> {
    if ISOTROPIC {
        return compliance[other * parameters.covered + place] * force;
    }
    let first = 9u * other * parameters.covered + 3u * place;
    let second = first + 3u * parameters.covered;
    let third = second + 3u * parameters.covered;
    return vec3<real>(compliance[first], compliance[first + 1u], compliance[first + 2u]) * force.x
        + vec3<real>(compliance[second], compliance[second + 1u], compliance[second + 2u]) * force.y
        + vec3<real>(compliance[third], compliance[third + 1u], compliance[third + 2u]) * force.z;
}
