// The object's frame update: the inverse of the matrix on the left was computed beforehand. Two stages, because the
// second needs the whole of the first's result.

// Whether the three coordinates are alike and independent: then the inverse has one number for a pair of nodes.
override ISOTROPIC: bool = false;

// Inverse of 2M/T + B + (T/2) K, row-major: 3 x 3 numbers for each pair of nodes, or one.
@group(0) @binding(6) var<storage, read> inverse: array<f32>;
// Right-hand side, three numbers a node [N].
@group(0) @binding(7) var<storage, read_write> right: array<f32>;

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
    let sum = right_side(node);
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
        advance_node(node, partial[0]);
    }
}
