// What the stages in f64 share with Rust (src/gpu/layout.rs checks the struct by reflection). Positions are relative to
// the object's centre [m].

// Numbers that shared functions compute in.
alias real = f64;

struct DoubleParameters {
    // Configurations of this dispatch.
    configurations: u32,
    joints: u32,
    proxy_nodes: u32,
    surface_nodes: u32,
    triangles: u32,
    // Clusters of triangles, and groups of clusters.
    clusters: u32,
    groups: u32,
    padding: u32,
    // Gaps in f32 are known to this [m].
    gap_band: f64,
}

alias Parameters = DoubleParameters;

// Number of this workgroup when a dispatch is folded into two dimensions.
fn unfold(group: vec3<u32>, groups: vec3<u32>) -> u32 {
    return group.y * groups.x + group.x;
}
