// The list of unfinished configurations without those that are done: one workgroup over all.

@group(0) @binding(0) var<uniform> parameters: SearchParameters;
@group(0) @binding(1) var<storage, read_write> words: array<u32>;

// Whether entry `index` of the list is a configuration that is not done.
fn goes_on(index: u32) -> bool {
    return words[2u * parameters.room + 1u + words[index] * parameters.words + PHASE] != DONE;
}

@compute @workgroup_size(WORKGROUP)
fn main(@builtin(local_invocation_index) local: u32) {
    let run = run_of(local, words[2u * parameters.room]);
    var own = 0u;
    for (var index = run.x; index < run.y; index += 1u) {
        own += select(0u, 1u, goes_on(index));
    }
    var place = sum_before(local, own);
    for (var index = run.x; index < run.y; index += 1u) {
        if goes_on(index) {
            words[parameters.room + place] = words[index];
            place += 1u;
        }
    }
    storageBarrier();
    workgroupBarrier();
    let count = sums[WORKGROUP - 1u];
    for (var index = run.x; index < min(run.y, count); index += 1u) {
        words[index] = words[parameters.room + index];
    }
    if local == 0u {
        words[2u * parameters.room] = count;
    }
}
