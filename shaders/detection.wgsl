// Signed distance of every proxy node to the surface at rest, less its radius: one invocation a (configuration, node).
// Neighbouring invocations are neighbouring nodes and walk the triangles in step, but for clusters that are too far
// away.

override WORKGROUP: u32 = 64u;

@group(0) @binding(0) var<uniform> parameters: Parameters;
// Surface nodes at rest; then the bounding sphere (centre, radius) of each triangle; then each proxy node's radius in
// x; then the bounding sphere of each cluster of triangles.
@group(0) @binding(1) var<storage, read> rest: array<vec4<f32>>;
@group(0) @binding(2) var<storage, read> mesh: array<u32>;
// Proxy nodes; w receives the gap.
@group(0) @binding(3) var<storage, read_write> positions: array<vec4<f32>>;
// All triangles, CLUSTER of them side by side in each cluster.
@group(0) @binding(4) var<storage, read> clusters: array<u32>;

fn node_from(node: u32, x: vec3<f32>) -> vec3<f32> {
    return rest[node].xyz - x;
}

@compute @workgroup_size(WORKGROUP)
fn main(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) local: u32,
) {
    let index = unfold(group, groups) * WORKGROUP + local;
    if index / parameters.proxy_nodes >= parameters.configurations {
        return;
    }
    let x = positions[index].xyz;
    var least = FAR_AWAY;
    var best = 0u;
    var best_point = ClosestPoint();
    var best_offset = vec3<f32>(0.0);
    let first_sphere = parameters.surface_nodes + parameters.triangles + parameters.proxy_nodes;
    for (var first = 0u; first < parameters.triangles; first += CLUSTER) {
        let whole = rest[first_sphere + first / CLUSTER];
        if distance(x, whole.xyz) - whole.w > least {
            continue;
        }
        for (var k = first; k < min(parameters.triangles, first + CLUSTER); k += 1u) {
            let triangle = clusters[k];
            let sphere = rest[parameters.surface_nodes + triangle];
            if distance(x, sphere.xyz) - sphere.w > least {
                continue;
            }
            let a = node_from(corner(triangle, 0u), x);
            let b = node_from(corner(triangle, 1u), x);
            let c = node_from(corner(triangle, 2u), x);
            let closest = closest_point(vec3<f32>(0.0), a, b, c);
            let offset = closest.weights.x * a + closest.weights.y * b + closest.weights.z * c;
            let away = length(offset);
            if away < least || (away == least && triangle < best) {
                least = away;
                best = triangle;
                best_point = closest;
                best_offset = offset;
            }
        }
    }
    let inside = dot(best_offset, pseudonormal(best, best_point.feature, x)) > 0.0;
    let radius = rest[parameters.surface_nodes + parameters.triangles + index % parameters.proxy_nodes].x;
    positions[index].w = select(least, -least, inside) - radius;
}
