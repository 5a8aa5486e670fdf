// The least of one number from each invocation of a workgroup. The stage declares WORKGROUP.

var<workgroup> least: array<real, WORKGROUP>;

// For all invocations together; in every one.
fn least_of(number: real, local: u32) -> real {
    least[local] = number;
    workgroupBarrier();
    var all = least[0];
    for (var k = 1u; k < WORKGROUP; k += 1u) {
        all = min(all, least[k]);
    }
    workgroupBarrier();
    return all;
}
