// What the stages of the object's frame update share (non-iterative passive mechanical integration, paper's section
// 3.2):
//     (2M/T + B + (T/2) K) v_hat = (2M/T) v_k - K u_k + f,    u_{k+1} = u_k + T v_hat,    v_{k+1} = 2 v_hat - v_k
// with u = n - n0. Displacements are the state, not positions: f32 resolves them better. Quasi-static graphics has no
// M, B and v, and goes half the way: u_{k+1} = u_k + (T/2) v_hat = K^-1 f.

struct FrameParameters {
    nodes: u32,
    // T [s].
    period: f32,
}

override WORKGROUP: u32 = 64u;
override QUASI_STATIC: bool = false;

@group(0) @binding(0) var<uniform> parameters: FrameParameters;
// Row starts of K (one more than there are nodes), then the column of each block.
@group(0) @binding(1) var<storage, read> structure: array<u32>;
// Nine numbers a block, column by column [N/m].
@group(0) @binding(2) var<storage, read> blocks: array<f32>;
// Mass [kg] and damping against the ground [N s/m] of each node.
@group(0) @binding(3) var<storage, read> inertia: array<vec2<f32>>;
// External force f on each node [N]; w is unused.
@group(0) @binding(4) var<storage, read> forces: array<vec4<f32>>;
// Displacements u [m] of all nodes, then velocities v [m/s] where there are any; w is unused.
@group(0) @binding(5) var<storage, read_write> state: array<vec4<f32>>;

fn block(entry: u32) -> mat3x3<f32> {
    let at = 9u * entry;
    return mat3x3<f32>(
        blocks[at], blocks[at + 1u], blocks[at + 2u],
        blocks[at + 3u], blocks[at + 4u], blocks[at + 5u],
        blocks[at + 6u], blocks[at + 7u], blocks[at + 8u],
    );
}

fn column(entry: u32) -> u32 {
    return structure[parameters.nodes + 1u + entry];
}

// (2M/T) v_k - K u_k + f at one node.
fn right_side(node: u32) -> vec3<f32> {
    var sum = forces[node].xyz;
    if !QUASI_STATIC {
        sum += (2.0 * inertia[node].x / parameters.period) * state[parameters.nodes + node].xyz;
    }
    for (var entry = structure[node]; entry < structure[node + 1u]; entry += 1u) {
        sum -= block(entry) * state[column(entry)].xyz;
    }
    return sum;
}

// u_{k+1} and v_{k+1} of one node.
fn advance_node(node: u32, v_hat: vec3<f32>) {
    if QUASI_STATIC {
        state[node] = vec4<f32>(state[node].xyz + 0.5 * parameters.period * v_hat, 0.0);
        return;
    }
    let velocity = state[parameters.nodes + node].xyz;
    state[node] = vec4<f32>(state[node].xyz + parameters.period * v_hat, 0.0);
    state[parameters.nodes + node] = vec4<f32>(2.0 * v_hat - velocity, 0.0);
}
