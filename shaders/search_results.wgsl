// What the search found, without gaps: a record a configuration, and the touches of one behind those of another.

override GATHER_WORKGROUP: u32 = 64u;

@group(0) @binding(0) var<uniform> parameters: SearchParameters;
@group(0) @binding(1) var<storage, read_write> words: array<u32>;
@group(0) @binding(2) var<storage, read_write> reals: array<vec4<real>>;
// Where the touches of each configuration begin; behind the last, where they end.
@group(0) @binding(3) var<storage, read_write> starts: array<u32>;
// Four words a configuration: status, iterations, touches, and two bits: whether there is a tangent, and whether the
// result may depend on nodes that the compliance does not cover.
@group(0) @binding(4) var<storage, read_write> records: array<vec4<u32>>;
// Residual, energy, torque and, where it is wanted, the tangent row by row.
@group(0) @binding(5) var<storage, read_write> amounts: array<real>;
// Proxy node, facet and feature of each touch.
@group(0) @binding(6) var<storage, read_write> touches: array<vec4<u32>>;
// Weights of the corners and the force on the proxy node [N].
@group(0) @binding(7) var<storage, read_write> presses: array<real>;

// One workgroup over all configurations.
@compute @workgroup_size(WORKGROUP)
fn count(@builtin(local_invocation_index) local: u32) {
    let run = run_of(local, parameters.configurations);
    var own = 0u;
    for (var place = run.x; place < run.y; place += 1u) {
        take_place(place);
        own += word(TOUCHES);
    }
    var start = sum_before(local, own);
    for (var place = run.x; place < run.y; place += 1u) {
        take_place(place);
        starts[place] = start;
        start += word(TOUCHES);
    }
    if local == WORKGROUP - 1u {
        starts[parameters.configurations] = sums[local];
    }
}

fn write_record(place: u32) {
    let flags = word(HAS_TANGENT) + 2u * word(IS_DOUBTFUL);
    records[place] = vec4<u32>(word(STATUS), word(ITERATIONS), word(TOUCHES), flags);
    let joints = parameters.joints;
    let length = 2u + joints + select(0u, joints * joints, WITH_TANGENT);
    let first = place * length;
    amounts[first] = scalar(IMBALANCE);
    amounts[first + 1u] = scalar(ENERGY);
    for (var joint = 0u; joint < joints; joint += 1u) {
        amounts[first + 2u + joint] = scalar(at_torque(joint));
    }
    if WITH_TANGENT {
        for (var k = 0u; k < joints * joints; k += 1u) {
            amounts[first + 2u + joints + k] = scalar(at_tangent(0u, k));
        }
    }
}

// One invocation a row that there is room for.
@compute @workgroup_size(GATHER_WORKGROUP)
fn gather(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) local: u32,
) {
    let index = unfold(group, groups) * GATHER_WORKGROUP + local;
    let place = index / parameters.contacts;
    let row = index % parameters.contacts;
    if place >= parameters.configurations {
        return;
    }
    take_place(place);
    if row == 0u {
        write_record(place);
    }
    let half = word(HALF);
    if word(TOUCHES) == 0u || row >= word(ROWS + half) || scalar(at_numbers(half, row) + DEPTH) <= 0.0 {
        return;
    }
    var touch = starts[place];
    for (var other = 0u; other < row; other += 1u) {
        touch += select(0u, 1u, scalar(at_numbers(half, other) + DEPTH) > 0.0);
    }
    let at = at_numbers(half, row);
    let at_words = at_row(half, row);
    touches[touch] = vec4<u32>(word(at_words), word(at_words + 1u), word(at_words + 2u), 0u);
    let force = parameters.kc * scalar(at + SHARE) * scalar(at + DEPTH) * vector_at(at + NORMAL);
    write_press(6u * touch, vector_at(at + CORNERS));
    write_press(6u * touch + 3u, force);
}

fn write_press(at: u32, v: vec3<real>) {
    presses[at] = v.x;
    presses[at + 1u] = v.y;
    presses[at + 2u] = v.z;
}
