// What the stages share that place the proxy and test it for contact at rest (src/gpu/layout.rs checks the struct by
// reflection). All positions are relative to the object's centre [m].
//
// `real` is f64 or f32; the stage's text is the same for both.

struct Parameters {
    // Configurations of this dispatch.
    configurations: u32,
    joints: u32,
    proxy_nodes: u32,
    surface_nodes: u32,
    triangles: u32,
    // Leaves of the tree of bounding spheres.
    leaves: u32,
    // Gaps in f32 are known to this, if they are no greater than known_to [m].
    gap_band: f32,
    known_to: f32,
}
