// List of the configurations in contact at rest, ascending: `list[0]` is their number plus one, the numbers follow.

@group(0) @binding(0) var<uniform> parameters: Parameters;
// Smallest gap of each configuration.
@group(0) @binding(1) var<storage, read> gaps: array<real>;
@group(0) @binding(2) var<storage, read_write> list: array<u32>;

@compute @workgroup_size(WORKGROUP)
fn main(@builtin(local_invocation_index) local: u32) {
    let run = run_of(local, parameters.configurations);
    var count = 0u;
    for (var configuration = run.x; configuration < run.y; configuration += 1u) {
        count += select(0u, 1u, gaps[configuration] < 0.0);
    }
    var place = sum_before(local, count);
    for (var configuration = run.x; configuration < run.y; configuration += 1u) {
        if gaps[configuration] < 0.0 {
            list[1u + place] = configuration;
            place += 1u;
        }
    }
    if local == WORKGROUP - 1u {
        list[0] = 1u + sums[local];
    }
}
