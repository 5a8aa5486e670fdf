// What the kernel of contact with the surface at rest reads and writes (src/gpu/layout.rs checks the struct by
// reflection). All positions are relative to the object's centre [m].

struct Parameters {
    // Configurations of this dispatch.
    configurations: u32,
    joints: u32,
    proxy_nodes: u32,
    surface_nodes: u32,
    triangles: u32,
    // Leaves of the tree of bounding spheres.
    leaves: u32,
    // Nodes that the compliance covers; the places of others are not below.
    covered: u32,
    // Nodes of a facet at most, in fours.
    carriers: u32,
    // Where parts of `surface` begin: control points of the facets, masks of the control points, cubes of the lattice.
    at_controls: u32,
    at_masks: u32,
    at_cubes: u32,
    // Where parts of `mesh` begin: facets in the order of the leaves, places of each facet's nodes, its shape, and the
    // triangle closest to the middle of each cube.
    at_order: u32,
    at_carriers: u32,
    at_shapes: u32,
    at_near: u32,
    // Cubes along each axis, low corner of their lattice, and one over their side [1/m].
    cubes_x: u32,
    cubes_y: u32,
    cubes_z: u32,
    low_x: f32,
    low_y: f32,
    low_z: f32,
    inverse_side: f32,
    // By how much facets stand off their triangles at most [m].
    bulge: f32,
    // Rounding of a gap [m].
    band: f32,
    // 1/kc [m/N].
    softness: f32,
    // How far the surface moves at most, over the norm of the elastic energy [sqrt(m/N)].
    mobility: f32,
    // Below this distance to an edge or vertex the direction to it is rounding [m].
    least_distance: f32,
    // Step of differences of the depth's gradient [m].
    step: f32,
    // Most rounds of one program.
    rounds: u32,
}

override WORKGROUP: u32 = 32u;
// Most rows of a configuration, their size in fours, and entries of what joints deepen them by.
override ROOM: u32 = 32u;
override ROW_FOURS: u32 = 800u;
override DEEPENINGS: u32 = 1u;
// Whether facets are of degree four, the compliance has one number for a pair of nodes, and the tangent is wanted.
override SMOOTH: bool = false;
override ISOTROPIC: bool = false;
override WITH_TANGENT: bool = false;
// Whether the compliance covers all nodes.
override WHOLE: bool = true;

@group(0) @binding(0) var<uniform> parameters: Parameters;
// Of each joint its origin, axis and kind (0 revolute, 1 prismatic); then of each proxy node its position in its link's
// frame, that link, its radius and its share of stiffness.
@group(0) @binding(1) var<storage, read> chain: array<f32>;
// Configuration by configuration, joint fastest: (cos q, sin q), or (q, 0) of a prismatic joint.
@group(0) @binding(2) var<storage, read> motions: array<vec2<f32>>;
// Bounding spheres of the facets (bounding_spheres.wgsl); control points of each facet; masks of each shape; of each
// cube of the lattice the gradient of the bound on the distance and its value at the centre.
@group(0) @binding(3) var<storage, read> surface: array<vec4<f32>>;
@group(0) @binding(4) var<storage, read> mesh: array<u32>;
// C [m/N]: row by row, three rows a node or, where it is isotropic, one.
@group(0) @binding(5) var<storage, read> compliance: array<f32>;
// Of each configuration: status, rounds, touches, their first place; gap, energy, residual, torque and, where it is
// wanted, the lower triangle of the tangent.
@group(0) @binding(6) var<storage, read_write> records: array<u32>;
@group(0) @binding(7) var<storage, read_write> touches: Touches;

struct Touches {
    // How many there are.
    count: atomic<u32>,
    // Three fours each: proxy node, facet, feature, force along the normal; two weights of the closest point, x and y
    // of the normal; force on the proxy node and z of the normal.
    fours: array<vec4<u32>>,
}

const HEAD: u32 = 7u;

fn record_length() -> u32 {
    return HEAD + parameters.joints + select(0u, parameters.joints * (parameters.joints + 1u) / 2u, WITH_TANGENT);
}

fn facet_in_order(place: u32) -> u32 {
    return mesh[parameters.at_order + place];
}

// Control point k of a facet; a flat one has three, its corners.
fn control(facet: u32, k: u32) -> vec3<f32> {
    return surface[parameters.at_controls + facet * select(3u, 15u, SMOOTH) + k].xyz;
}

// Places of four nodes of a facet.
fn places_of(facet: u32, four: u32) -> vec4<u32> {
    let at = parameters.at_carriers + 4u * (facet * parameters.carriers + four);
    return vec4<u32>(mesh[at], mesh[at + 1u], mesh[at + 2u], mesh[at + 3u]);
}

// Displacement of the node in place i by a force of one newton on that in place j, of an isotropic object.
fn scalar_compliance(i: u32, j: u32) -> f32 {
    if max(i, j) >= parameters.covered {
        return 0.0;
    }
    return compliance[i * parameters.covered + j];
}

fn scalar_compliances(i: vec4<u32>, j: u32) -> vec4<f32> {
    return vec4<f32>(scalar_compliance(i.x, j), scalar_compliance(i.y, j), scalar_compliance(i.z, j),
        scalar_compliance(i.w, j));
}

// The same of any object.
fn block_of_compliance(i: u32, j: u32) -> mat3x3<f32> {
    if max(i, j) >= parameters.covered {
        return mat3x3<f32>();
    }
    // C is symmetric: its rows are its columns.
    let width = 3u * parameters.covered;
    let at = 3u * j * width + 3u * i;
    return mat3x3<f32>(
        compliance[at], compliance[at + 1u], compliance[at + 2u],
        compliance[at + width], compliance[at + width + 1u], compliance[at + width + 2u],
        compliance[at + 2u * width], compliance[at + 2u * width + 1u], compliance[at + 2u * width + 2u],
    );
}
