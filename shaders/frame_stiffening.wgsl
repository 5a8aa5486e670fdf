// Strain stiffening of the object's springs (twin: `Stiffening::relieve` in src/object/stiffening.rs): by how much K1 u
// exceeds the springs' force, added to the loads. `blocks` holds K1, the springs FACTOR times as stiff; one invocation
// a node.

// kappa [1].
override FACTOR: f32;
// eps [1].
override STRAIN: f32;

// Force of a spring in K1 at strain one, for each block; zero on the diagonal [N].
@group(0) @binding(6) var<storage, read> reach: array<f32>;
// Load on each node [N]; w is unused.
@group(0) @binding(7) var<storage, read_write> loads: array<vec4<f32>>;

@compute @workgroup_size(WORKGROUP)
fn relieve(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) local: u32,
) {
    let node = unfold(group, groups) * WORKGROUP + local;
    if node >= parameters.nodes {
        return;
    }
    var sum = vec3<f32>(0.0);
    for (var entry = structure[node]; entry < structure[node + 1u]; entry += 1u) {
        if reach[entry] > 0.0 {
            let pull = block(entry) * (state[column(entry)].xyz - state[node].xyz);
            let strain = sqrt(dot(pull, pull)) / reach[entry];
            let sigma = 1.0 + (FACTOR - 1.0) * strain / (sqrt(strain * strain + STRAIN * STRAIN) + STRAIN);
            sum += (1.0 - sigma / FACTOR) * pull;
        }
    }
    loads[node] += vec4<f32>(sum, 0.0);
}
