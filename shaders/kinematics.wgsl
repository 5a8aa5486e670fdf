// Positions x_i of all proxy nodes for a batch of configurations: one invocation a (configuration, node).
// No trigonometry: the host sends cosine and sine of every joint (or the displacement of a prismatic one).

override WORKGROUP: u32 = 64u;

@group(0) @binding(0) var<uniform> parameters: Parameters;
@group(0) @binding(1) var<storage, read> joints: array<Joint>;
@group(0) @binding(2) var<storage, read> proxy_nodes: array<ProxyNode>;
// Configuration by configuration, joint fastest: (cos q, sin q), or (q, 0) of a prismatic joint.
@group(0) @binding(3) var<storage, read> motions: array<vec2<f32>>;
// Configuration by configuration, node fastest; w is left for the gap.
@group(0) @binding(4) var<storage, read_write> positions: array<vec4<f32>>;

// Rodrigues: v turned about the unit vector `axis` by the angle with the given cosine and sine.
fn turn(axis: vec3<f32>, motion: vec2<f32>, v: vec3<f32>) -> vec3<f32> {
    return motion.x * v + motion.y * cross(axis, v) + ((1.0 - motion.x) * dot(axis, v)) * axis;
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
    let node = proxy_nodes[index % parameters.proxy_nodes];
    // From the tip inwards: each joint moves the point from its link's frame into its parent's. One vector is turned,
    // instead of a matrix being built from the root outwards.
    var x = node.position;
    for (var k = i32(node.link); k >= 0; k -= 1) {
        let joint = joints[k];
        let motion = motions[configuration * parameters.joints + u32(k)];
        if joint.kind == 0u {
            x = turn(joint.axis, motion, x);
        } else {
            x += motion.x * joint.axis;
        }
        x += joint.origin;
    }
    positions[index] = vec4<f32>(x, 0.0);
}
