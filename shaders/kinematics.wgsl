// Positions x_i of all proxy nodes for a batch of configurations: one invocation a (configuration, node). No
// trigonometry: the host sends cosine and sine of every joint, or the displacement of a prismatic one.

override WORKGROUP: u32 = 64u;

@group(0) @binding(0) var<uniform> parameters: Parameters;
// Of each joint its origin, axis and kind (0 revolute, 1 prismatic); then of each proxy node its position in its link's
// frame and that link.
@group(0) @binding(1) var<storage, read> chain: array<real>;
// Configuration by configuration, joint fastest: (cos q, sin q), or (q, 0) of a prismatic joint.
@group(0) @binding(2) var<storage, read> motions: array<vec2<real>>;
// Configuration by configuration, node fastest: three coordinates each.
@group(0) @binding(3) var<storage, read_write> placed: array<real>;
// The same in f32; w is left for the gap.
@group(0) @binding(4) var<storage, read_write> positions: array<vec4<f32>>;

fn vector_at(at: u32) -> vec3<real> {
    return vec3<real>(chain[at], chain[at + 1u], chain[at + 2u]);
}

@compute @workgroup_size(WORKGROUP)
fn main(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) local: u32,
) {
    let index = unfold(group, groups) * WORKGROUP + local;
    let configuration = index / parameters.proxy_nodes;
    if configuration >= parameters.configurations {
        return;
    }
    let node = 7u * parameters.joints + 4u * (index % parameters.proxy_nodes);
    // From the tip inwards: each joint moves the point from its link's frame into its parent's. One vector is turned,
    // instead of a matrix being built from the root outwards.
    var x = vector_at(node);
    for (var k = i32(chain[node + 3u]); k >= 0; k -= 1) {
        let joint = 7u * u32(k);
        let axis = vector_at(joint + 3u);
        let motion = motions[configuration * parameters.joints + u32(k)];
        if chain[joint + 6u] == 0.0 {
            x = turn(axis, motion, x);
        } else {
            x += motion.x * axis;
        }
        x += vector_at(joint);
    }
    placed[3u * index] = x.x;
    placed[3u * index + 1u] = x.y;
    placed[3u * index + 2u] = x.z;
    positions[index] = vec4<f32>(vec3<f32>(x), 0.0);
}
