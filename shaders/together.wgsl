// What the invocations of a workgroup find together: the least of numbers, their sum, and a list. The order does not
// depend on timing. The stage declares WORKGROUP.

var<workgroup> numbers: array<f32, WORKGROUP>;
var<workgroup> marks: array<u32, WORKGROUP>;
// Entries of the list.
var<workgroup> listed: u32;

// The least of one number from each invocation. For all together; in every one.
fn least_of(number: f32, local: u32) -> f32 {
    numbers[local] = number;
    workgroupBarrier();
    var all = numbers[0];
    for (var k = 1u; k < WORKGROUP; k += 1u) {
        all = min(all, numbers[k]);
    }
    workgroupBarrier();
    return all;
}

// The sum of one number from each invocation. For all together; in every one.
fn sum_of(number: f32, local: u32) -> f32 {
    numbers[local] = number;
    workgroupBarrier();
    var all = numbers[0];
    for (var k = 1u; k < WORKGROUP; k += 1u) {
        all += numbers[k];
    }
    workgroupBarrier();
    return all;
}

// Place in the list of what this invocation adds to it, if `is_own`: behind that of the invocations before it. For all
// together.
fn place_in_list(is_own: bool, local: u32) -> u32 {
    marks[local] = u32(is_own);
    workgroupBarrier();
    var place = listed;
    for (var k = 0u; k < local; k += 1u) {
        place += marks[k];
    }
    workgroupBarrier();
    if local == WORKGROUP - 1u {
        listed = place + marks[local];
    }
    workgroupBarrier();
    return place;
}
