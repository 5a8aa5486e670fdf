// Displacements of the object's own nodes, which follow those that K moves (twin: `Attachment::follow` in
// src/object/attachment.rs): u_i = sum_a N_ia u_a. One invocation a node.

override WORKGROUP: u32 = 64u;

// Row starts of N (one more than there are nodes), then the column of each weight.
@group(0) @binding(0) var<storage, read> rows: array<u32>;
// [1].
@group(0) @binding(1) var<storage, read> weights: array<f32>;
// Displacements of the nodes of K [m]; w is unused.
@group(0) @binding(2) var<storage, read> state: array<vec4<f32>>;
// Displacements of the object's nodes [m]; w is unused.
@group(0) @binding(3) var<storage, read_write> followers: array<vec4<f32>>;

@compute @workgroup_size(WORKGROUP)
fn main(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) local: u32,
) {
    let node = unfold(group, groups) * WORKGROUP + local;
    let nodes = arrayLength(&followers);
    if node >= nodes {
        return;
    }
    var sum = vec3<f32>(0.0);
    for (var entry = rows[node]; entry < rows[node + 1u]; entry += 1u) {
        sum += weights[entry] * state[rows[nodes + 1u + entry]].xyz;
    }
    followers[node] = vec4<f32>(sum, 0.0);
}
