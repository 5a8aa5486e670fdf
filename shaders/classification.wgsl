// Smallest gap of a configuration's nodes at rest: one invocation a configuration. Below zero there is contact.

override WORKGROUP: u32 = 64u;

@group(0) @binding(0) var<uniform> parameters: Parameters;
// Proxy nodes; w is the gap of each.
@group(0) @binding(1) var<storage, read> positions: array<vec4<f32>>;
@group(0) @binding(2) var<storage, read_write> gaps: array<f32>;

@compute @workgroup_size(WORKGROUP)
fn main(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) local: u32,
) {
    let configuration = unfold(group, groups) * WORKGROUP + local;
    if configuration >= parameters.configurations {
        return;
    }
    var gap = FAR_AWAY;
    for (var node = 0u; node < parameters.proxy_nodes; node += 1u) {
        gap = min(gap, positions[configuration * parameters.proxy_nodes + node].w);
    }
    gaps[configuration] = gap;
}
