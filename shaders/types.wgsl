// Structs shared with Rust (src/gpu/layout.rs checks them by reflection). All positions are relative to the object's
// centroid, in metres; forces in newtons.

// Numbers that shared functions compute in.
alias real = f32;

struct Parameters {
    // Configurations of this dispatch.
    configurations: u32,
    // Place in the list of contacts of this dispatch's first one.
    first: u32,
    joints: u32,
    proxy_nodes: u32,
    surface_nodes: u32,
    triangles: u32,
    max_iterations: u32,
    // Contact stiffness Kc of one spring [N/m].
    stiffness: f32,
    // The energy form's stiffness at a contact point [N/m].
    kc: f32,
    // Relative residual at which a configuration counts as converged.
    tolerance: f32,
    // Largest trace of a node's own block of C [m/N].
    softest: f32,
    // Below this distance to an edge or vertex the direction to it is rounding [m].
    least_distance: f32,
    // What a depth is rounded by [m].
    depth_rounding: f32,
    // Surface nodes that the compliance covers.
    covered: u32,
    // Clusters of triangles.
    clusters: u32,
    // Largest eigenvalue of a covered node's own block of C [m/N].
    mobility: f32,
}

// One joint of the chain; axis is a unit vector.
struct Joint {
    origin: vec3<f32>,
    // 0 revolute, 1 prismatic.
    kind: u32,
    axis: vec3<f32>,
    padding: u32,
}

struct ProxyNode {
    // In the link's frame.
    position: vec3<f32>,
    link: u32,
}

// What became of one configuration.
struct SolverResult {
    status: u32,
    iterations: u32,
    residual: f32,
    // Elastic part of the stored energy [J]; that of the contact springs follows from the touches.
    elastic: f32,
    // Entries of the list of touches in use.
    touches: u32,
    padding_0: u32,
    padding_1: u32,
    padding_2: u32,
}

// Forces of one proxy node on three object nodes [N].
struct Touch {
    nodes: vec3<u32>,
    proxy_node: u32,
    force_0: vec3<f32>,
    padding_0: u32,
    force_1: vec3<f32>,
    padding_1: u32,
    force_2: vec3<f32>,
    padding_2: u32,
}

// Number of this workgroup when a dispatch is folded into two dimensions.
fn unfold(group: vec3<u32>, groups: vec3<u32>) -> u32 {
    return group.y * groups.x + group.x;
}
