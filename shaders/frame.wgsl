// The object's frame update (non-iterative passive mechanical integration, paper's section 3.2):
//     (2M/T + B + (T/2) K) v_hat = (2M/T) v_k - K u_k + f,    u_{k+1} = u_k + T v_hat,    v_{k+1} = 2 v_hat - v_k
// with u = n - n0. Displacements are the state, not positions: f32 resolves them better. The inverse of the matrix on the
// left was computed beforehand. Two stages, because the second needs the whole of the first's result.

struct FrameParameters {
    nodes: u32,
    // T [s].
    period: f32,
}

override WORKGROUP: u32 = 64u;
// Whether the three coordinates are alike and independent: then the inverse has one number for a pair of nodes.
override ISOTROPIC: bool = false;

@group(0) @binding(0) var<uniform> parameters: FrameParameters;
// Row starts of K (one more than there are nodes), then the column of each block.
@group(0) @binding(1) var<storage, read> structure: array<u32>;
// Nine numbers a block, column by column [N/m].
@group(0) @binding(2) var<storage, read> blocks: array<f32>;
// Mass [kg] and damping against the ground [N s/m] of each node.
@group(0) @binding(3) var<storage, read> inertia: array<vec2<f32>>;
// External force f on each node [N]; w is unused.
@group(0) @binding(4) var<storage, read> forces: array<vec4<f32>>;
// Displacements u [m] of all nodes, then velocities v [m/s]; w is unused.
@group(0) @binding(5) var<storage, read_write> state: array<vec4<f32>>;
// Inverse of 2M/T + B + (T/2) K, row-major: 3 x 3 numbers for each pair of nodes, or one.
@group(0) @binding(6) var<storage, read> inverse: array<f32>;
// Right-hand side, three numbers a node [N].
@group(0) @binding(7) var<storage, read_write> right: array<f32>;

// Right-hand side, (2M/T) v_k - K u_k + f: one invocation a node.
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
    var sum = forces[node].xyz + (2.0 * inertia[node].x / parameters.period) * state[parameters.nodes + node].xyz;
    for (var entry = structure[node]; entry < structure[node + 1u]; entry += 1u) {
        let at = 9u * entry;
        let block = mat3x3<f32>(
            blocks[at], blocks[at + 1u], blocks[at + 2u],
            blocks[at + 3u], blocks[at + 4u], blocks[at + 5u],
            blocks[at + 6u], blocks[at + 7u], blocks[at + 8u],
        );
        sum -= block * state[structure[parameters.nodes + 1u + entry]].xyz;
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
    // A workgroup of the fold's tail repeats the last node, and writes nothing.
    let index = unfold(group, groups);
    let node = min(index, parameters.nodes - 1u);
    var sum = vec3<f32>(0.0);
    if ISOTROPIC {
        let row = node * parameters.nodes;
        for (var k = local; k < parameters.nodes; k += WORKGROUP) {
            sum += inverse[row + k] * vec3<f32>(right[3u * k], right[3u * k + 1u], right[3u * k + 2u]);
        }
    } else {
        let order = 3u * parameters.nodes;
        let row = 3u * node * order;
        for (var k = local; k < order; k += WORKGROUP) {
            sum += vec3<f32>(inverse[row + k], inverse[row + order + k], inverse[row + 2u * order + k]) * right[k];
        }
    }
    partial[local] = sum;
    workgroupBarrier();
    for (var half = WORKGROUP / 2u; half > 0u; half /= 2u) {
        if local < half {
            partial[local] += partial[local + half];
        }
        workgroupBarrier();
    }
    if local == 0u && index < parameters.nodes {
        let v_hat = partial[0];
        let velocity = state[parameters.nodes + node].xyz;
        state[node] = vec4<f32>(state[node].xyz + parameters.period * v_hat, 0.0);
        state[parameters.nodes + node] = vec4<f32>(2.0 * v_hat - velocity, 0.0);
    }
}
