// Frame update of large objects: conjugate gradients on (2M/T + B + (T/2) K) v_hat = right-hand side, preconditioned by
// the diagonal, a fixed number of iterations from v_hat = 0.
//
// Passive however early it stops: the energy that a step adds beyond the work of f and the loss in B is
// -T v_hat . r, r the residual; iterates of conjugate gradients from zero lie in the Krylov space that r is orthogonal
// to, so that it vanishes. A start from the last frame's v_hat would lose this.
//
// One invocation a node in every stage. Each stage adds up what the one before left, one number a workgroup, again in
// every workgroup: sums need no further dispatch.

// v_hat, r, direction p, product A p, and inverse diagonal, one behind the other.
@group(0) @binding(6) var<storage, read_write> work: array<vec4<f32>>;
// Sums a workgroup: r . z of even iterations, of odd ones, and p . A p.
@group(0) @binding(7) var<storage, read_write> sums: array<f32>;

var<workgroup> partial: array<f32, WORKGROUP>;

// Sum of `value` over the workgroup, in every invocation.
fn add_up(value: f32, local: u32) -> f32 {
    partial[local] = value;
    workgroupBarrier();
    for (var half = WORKGROUP / 2u; half > 0u; half /= 2u) {
        if local < half {
            partial[local] += partial[local + half];
        }
        workgroupBarrier();
    }
    let sum = partial[0];
    workgroupBarrier();
    return sum;
}

// The whole sum number `kind`, from all workgroups' shares.
fn collect(kind: u32, local: u32) -> f32 {
    var sum = 0.0;
    for (var k = local; k < parameters.groups; k += WORKGROUP) {
        sum += sums[kind * parameters.groups + k];
    }
    return add_up(sum, local);
}

fn keep(kind: u32, value: f32, group: u32, local: u32) {
    let sum = add_up(value, local);
    if local == 0u && group < parameters.groups {
        sums[kind * parameters.groups + group] = sum;
    }
}

fn ratio(above: f32, below: f32) -> f32 {
    return select(0.0, above / max(below, LEAST_DIVISOR), below > LEAST_DIVISOR);
}

@compute @workgroup_size(WORKGROUP)
fn begin(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) local: u32,
) {
    let node = unfold(group, groups) * WORKGROUP + local;
    let n = parameters.nodes;
    var power = 0.0;
    if node < n {
        var diagonal = vec3<f32>(inertial(node));
        for (var entry = structure[node]; entry < structure[node + 1u]; entry += 1u) {
            if column(entry) == node {
                let own = block(entry);
                diagonal += 0.5 * parameters.period * vec3<f32>(own[0].x, own[1].y, own[2].z);
            }
        }
        let inverse = 1.0 / max(diagonal, vec3<f32>(LEAST_DIVISOR));
        let r = right_side(node);
        let z = inverse * r;
        work[node] = vec4<f32>(0.0);
        work[n + node] = vec4<f32>(r, 0.0);
        work[2u * n + node] = vec4<f32>(z, 0.0);
        work[4u * n + node] = vec4<f32>(inverse, 0.0);
        power = dot(r, z);
    }
    keep(0u, power, unfold(group, groups), local);
}

@compute @workgroup_size(WORKGROUP)
fn product(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) local: u32,
) {
    let node = unfold(group, groups) * WORKGROUP + local;
    let n = parameters.nodes;
    var power = 0.0;
    if node < n {
        let p = work[2u * n + node].xyz;
        var sum = inertial(node) * p;
        for (var entry = structure[node]; entry < structure[node + 1u]; entry += 1u) {
            sum += 0.5 * parameters.period * (block(entry) * work[2u * n + column(entry)].xyz);
        }
        work[3u * n + node] = vec4<f32>(sum, 0.0);
        power = dot(p, sum);
    }
    keep(2u, power, unfold(group, groups), local);
}

@compute @workgroup_size(WORKGROUP)
fn correct(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) local: u32,
) {
    let node = unfold(group, groups) * WORKGROUP + local;
    let n = parameters.nodes;
    let alpha = ratio(collect(parameters.odd, local), collect(2u, local));
    var power = 0.0;
    if node < n {
        work[node] += alpha * work[2u * n + node];
        let r = work[n + node] - alpha * work[3u * n + node];
        work[n + node] = r;
        power = dot(r.xyz, work[4u * n + node].xyz * r.xyz);
    }
    keep(1u - parameters.odd, power, unfold(group, groups), local);
}

@compute @workgroup_size(WORKGROUP)
fn turn(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) local: u32,
) {
    let node = unfold(group, groups) * WORKGROUP + local;
    let n = parameters.nodes;
    let beta = ratio(collect(1u - parameters.odd, local), collect(parameters.odd, local));
    if node < n {
        work[2u * n + node] = work[4u * n + node] * work[n + node] + beta * work[2u * n + node];
    }
}

@compute @workgroup_size(WORKGROUP)
fn finish(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) local: u32,
) {
    let node = unfold(group, groups) * WORKGROUP + local;
    if node < parameters.nodes {
        advance_node(node, work[node].xyz);
    }
}
