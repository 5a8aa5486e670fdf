// The touches of a batch without the gaps between one configuration's and the next's, behind those of the batches
// before. Places are prefix sums, so that the order does not depend on timing.

override WORKGROUP: u32 = 256u;
override GATHER_WORKGROUP: u32 = 64u;
// Room for touches of each configuration.
override CONTACTS: u32 = 32u;

@group(0) @binding(0) var<uniform> parameters: Parameters;
@group(0) @binding(1) var<storage, read> results: array<SolverResult>;
// CONTACTS a configuration.
@group(0) @binding(2) var<storage, read> listed: array<Touch>;
// Where the touches of each configuration begin in `touches`.
@group(0) @binding(3) var<storage, read_write> starts: array<u32>;
// Number of touches so far.
@group(0) @binding(4) var<storage, read_write> total: array<u32>;
@group(0) @binding(5) var<storage, read_write> touches: array<Touch>;

// Number of touches in the runs of all invocations so far.
var<workgroup> sums: array<u32, WORKGROUP>;

// Touches of a configuration; none where the number cannot be.
fn touches_of(configuration: u32) -> u32 {
    let number = results[configuration].touches;
    return select(0u, number, number <= CONTACTS);
}

// One workgroup; each invocation owns a run of consecutive configurations.
@compute @workgroup_size(WORKGROUP)
fn count(@builtin(local_invocation_index) local: u32) {
    let run = (parameters.configurations + WORKGROUP - 1u) / WORKGROUP;
    let first = min(local * run, parameters.configurations);
    let last = min(first + run, parameters.configurations);
    let before_batch = total[0];
    var own = 0u;
    for (var configuration = first; configuration < last; configuration += 1u) {
        own += touches_of(configuration);
    }
    sums[local] = own;
    workgroupBarrier();
    // Inclusive prefix sum by doubling strides.
    for (var stride = 1u; stride < WORKGROUP; stride *= 2u) {
        var before = 0u;
        if local >= stride {
            before = sums[local - stride];
        }
        workgroupBarrier();
        sums[local] += before;
        workgroupBarrier();
    }
    var place = before_batch + sums[local] - own;
    for (var configuration = first; configuration < last; configuration += 1u) {
        starts[configuration] = place;
        place += touches_of(configuration);
    }
    if local == WORKGROUP - 1u {
        total[0] = before_batch + sums[local];
    }
}

// One invocation a touch that there is room for.
@compute @workgroup_size(GATHER_WORKGROUP)
fn gather(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) local: u32,
) {
    let index = unfold(group, groups) * GATHER_WORKGROUP + local;
    let configuration = index / CONTACTS;
    let place = index % CONTACTS;
    if configuration < parameters.configurations && place < touches_of(configuration) {
        touches[starts[configuration] + place] = listed[index];
    }
}
