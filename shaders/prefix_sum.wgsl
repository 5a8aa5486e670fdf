// One workgroup over all configurations of a batch: each invocation owns a run of consecutive ones, so that the order
// of what it lists does not depend on timing.

override WORKGROUP: u32 = 256u;

// Numbers of all invocations up to each.
var<workgroup> sums: array<u32, WORKGROUP>;

// First configuration of the run of invocation `local`, of `count` in all, and the one behind its last.
fn run_of(local: u32, count: u32) -> vec2<u32> {
    let length = (count + WORKGROUP - 1u) / WORKGROUP;
    let first = min(local * length, count);
    return vec2<u32>(first, min(first + length, count));
}

// Sum of the numbers of the invocations before `local`, whose own is `number`: by doubling strides.
fn sum_before(local: u32, number: u32) -> u32 {
    sums[local] = number;
    workgroupBarrier();
    for (var stride = 1u; stride < WORKGROUP; stride *= 2u) {
        var before = 0u;
        if local >= stride {
            before = sums[local - stride];
        }
        workgroupBarrier();
        sums[local] += before;
        workgroupBarrier();
    }
    return sums[local] - number;
}
