// Structs shared with Rust (src/gpu/layout.rs checks them by reflection). All positions are relative to the object's
// centroid, in metres; forces in newtons.

struct Parameters {
    // Configurations in this chunk.
    configurations: u32,
    joints: u32,
    proxy_nodes: u32,
    surface_nodes: u32,
    triangles: u32,
    max_iterations: u32,
    // Contact stiffness Kc of one spring [N/m].
    stiffness: f32,
    // Relative residual at which a configuration counts as converged.
    tolerance: f32,
    // Half the diagonal of the object's bounding box [m]: the scale of rounding errors.
    extent: f32,
    padding_0: u32,
    padding_1: u32,
    padding_2: u32,
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
struct Outcome {
    status: u32,
    iterations: u32,
    residual: f32,
    energy: f32,
    // Smallest signed distance at rest, less the node's radius.
    gap: f32,
    // Contacts found; those beyond the list's capacity are not in it.
    touches: u32,
    padding_0: u32,
    padding_1: u32,
}

// One proxy node in contact: `force` on it, its reaction spread on three nodes.
struct Touch {
    nodes: vec3<u32>,
    proxy_node: u32,
    weights: vec3<f32>,
    depth: f32,
    force: vec3<f32>,
    padding: u32,
}

// Number of this workgroup when a dispatch is folded into two dimensions.
fn unfold(group: vec3<u32>, groups: vec3<u32>) -> u32 {
    return group.y * groups.x + group.x;
}
