// List of the configurations in contact at rest, ascending: `list[0]` is their number plus one, the numbers follow.
// One workgroup; each invocation owns a run of consecutive configurations, so that the order does not depend on timing.

override WORKGROUP: u32 = 256u;

@group(0) @binding(0) var<uniform> parameters: Parameters;
// Smallest gap of each configuration.
@group(0) @binding(1) var<storage, read> gaps: array<real>;
@group(0) @binding(2) var<storage, read_write> list: array<u32>;

// Number of contacts in the runs of all invocations so far.
var<workgroup> sums: array<u32, WORKGROUP>;

@compute @workgroup_size(WORKGROUP)
fn main(@builtin(local_invocation_index) local: u32) {
    let run = (parameters.configurations + WORKGROUP - 1u) / WORKGROUP;
    let first = min(local * run, parameters.configurations);
    let last = min(first + run, parameters.configurations);
    var count = 0u;
    for (var configuration = first; configuration < last; configuration += 1u) {
        count += select(0u, 1u, gaps[configuration] < 0.0);
    }
    sums[local] = count;
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
    var place = sums[local] - count;
    for (var configuration = first; configuration < last; configuration += 1u) {
        if gaps[configuration] < 0.0 {
            list[1u + place] = configuration;
            place += 1u;
        }
    }
    if local == WORKGROUP - 1u {
        list[0] = 1u + sums[local];
    }
}
