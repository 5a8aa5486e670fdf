// Lists that the invocations of a workgroup make together, in an order that does not depend on timing. The stage
// declares WORKGROUP.

var<workgroup> listed: u32;
var<workgroup> marks: array<u32, WORKGROUP>;

// What was stored is seen by all from here on.
fn sync() {
    storageBarrier();
}

// Begins a list behind its first `count` entries.
fn begin_list(count: u32, local: u32) {
    workgroupBarrier();
    if local == 0u {
        listed = count;
    }
    workgroupBarrier();
}

// Place in the list of what this invocation has, as many entries as `own`: behind those of the invocations before it.
// For all invocations together.
fn place_in_list(own: u32, local: u32) -> u32 {
    marks[local] = own;
    workgroupBarrier();
    var place = listed;
    for (var k = 0u; k < local; k += 1u) {
        place += marks[k];
    }
    workgroupBarrier();
    if local == WORKGROUP - 1u {
        listed = place + own;
    }
    workgroupBarrier();
    return place;
}
