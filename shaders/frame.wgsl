// One frame of the object's nodes (non-iterative passive mechanical integration, paper's section 3.2), small objects:
//     (2M/T + B + (T/2) K) v_hat = (2M/T) v_k - K u_k + f,    u_{k+1} = u_k + T v_hat,    v_{k+1} = 2 v_hat - v_k
// with u = n - n0 and the inverse of the matrix on the left computed beforehand. Two stages, because the second needs
// the whole of the first's result.

override WORKGROUP: u32 = 64u;

@group(0) @binding(0) var<uniform> parameters: FrameParameters;
// Row starts of K (one more than there are nodes), then the column of each block.
@group(0) @binding(1) var<storage, read> structure: array<u32>;
// Nine numbers a block, column by column [N/m].
@group(0) @binding(2) var<storage, read> blocks: array<f32>;
// Mass [kg] of each node.
@group(0) @binding(3) var<storage, read> masses: array<f32>;
// External force f on each node [N]; w is unused.
@group(0) @binding(4) var<storage, read> forces: array<vec4<f32>>;
// Inverse of the matrix on the left, row-major, three rows a node.
@group(0) @binding(5) var<storage, read> inverse: array<f32>;
// Displacements u [m] of all nodes, then velocities v [m/s]; w is unused.
@group(0) @binding(6) var<storage, read_write> state: array<vec4<f32>>;
// Right-hand side, three numbers a node [N].
@group(0) @binding(7) var<storage, read_write> right: array<f32>;

struct FrameParameters {
    nodes: u32,
    // T [s].
    period: f32,
    padding_0: u32,
    padding_1: u32,
}

// Right-hand side: one invocation a node.
@compute @workgroup_size(WORKGROUP)
fn load(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) local: u32,
) {
    let node = unfold(group, groups) * WORKGROUP + local;
    if node >= parameters.nodes {
        return;
    }
    var sum = forces[node].xyz + (2.0 * masses[node] / parameters.period) * state[parameters.nodes + node].xyz;
    for (var entry = structure[node]; entry < structure[node + 1u]; entry += 1u) {
        let u = state[structure[parameters.nodes + 1u + entry]].xyz;
        let at = 9u * entry;
        sum -= vec3<f32>(blocks[at], blocks[at + 1u], blocks[at + 2u]) * u.x
            + vec3<f32>(blocks[at + 3u], blocks[at + 4u], blocks[at + 5u]) * u.y
            + vec3<f32>(blocks[at + 6u], blocks[at + 7u], blocks[at + 8u]) * u.z;
    }
    right[3u * node] = sum.x;
    right[3u * node + 1u] = sum.y;
    right[3u * node + 2u] = sum.z;
}

var<workgroup> partial: array<vec3<f32>, WORKGROUP>;

// v_hat and the new state: one workgroup a node, its invocations along the row.
@compute @workgroup_size(WORKGROUP)
fn advance(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) local: u32,
) {
    let node = unfold(group, groups);
    let order = 3u * parameters.nodes;
    // A workgroup of the fold's tail reads beyond the matrix, which bounds checks allow, and writes nothing.
    let row = 3u * node * order;
    var sum = vec3<f32>(0.0);
    for (var column = local; column < order; column += WORKGROUP) {
        sum += vec3<f32>(inverse[row + column], inverse[row + order + column], inverse[row + 2u * order + column])
            * right[column];
    }
    partial[local] = sum;
    workgroupBarrier();
    for (var half = WORKGROUP / 2u; half > 0u; half /= 2u) {
        if local < half {
            partial[local] += partial[local + half];
        }
        workgroupBarrier();
    }
    if local == 0u && node < parameters.nodes {
        let v_hat = partial[0];
        state[node] += vec4<f32>(parameters.period * v_hat, 0.0);
        state[parameters.nodes + node] = vec4<f32>(2.0 * v_hat - state[parameters.nodes + node].xyz, 0.0);
    }
}
