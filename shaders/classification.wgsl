// Free or in contact, by the smallest gap of a configuration's nodes: one invocation a configuration.

override WORKGROUP: u32 = 64u;

@group(0) @binding(0) var<uniform> parameters: Parameters;
@group(0) @binding(1) var<storage, read> gaps: array<f32>;
@group(0) @binding(2) var<storage, read_write> outcomes: array<Outcome>;

@compute @workgroup_size(WORKGROUP)
fn main(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) local: u32,
) {
    let configuration = unfold(group, groups) * WORKGROUP + local;
    if configuration >= parameters.configurations {
        return;
    }
    var gap = FAR_AWAY;
    for (var node = 0u; node < parameters.proxy_nodes; node += 1u) {
        gap = min(gap, gaps[configuration * parameters.proxy_nodes + node]);
    }
    var outcome = Outcome();
    // Until the equilibrium stage has been here, a contact counts as not converged.
    outcome.status = select(STATUS_FREE, STATUS_UNCONVERGED, gap < 0.0);
    outcome.gap = gap;
    outcomes[configuration] = outcome;
}
