// The touches of a batch without the gaps between one configuration's and the next's, behind those of the batches
// before.

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

// Touches of a configuration; none where the number cannot be.
fn touches_of(configuration: u32) -> u32 {
    let number = results[configuration].touches;
    return select(0u, number, number <= CONTACTS);
}

@compute @workgroup_size(WORKGROUP)
fn count(@builtin(local_invocation_index) local: u32) {
    let run = run_of(local);
    let before_batch = total[0];
    var own = 0u;
    for (var configuration = run.x; configuration < run.y; configuration += 1u) {
        own += touches_of(configuration);
    }
    var place = before_batch + sum_before(local, own);
    for (var configuration = run.x; configuration < run.y; configuration += 1u) {
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
