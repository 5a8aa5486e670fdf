// Signed distance of every proxy node to the surface at rest, less its radius: one invocation a (configuration, node).
// Triangles are searched group by group of clusters, past those whose bounding sphere leaves no room for the closest
// one; ties go to the lower number.

override WORKGROUP: u32 = 64u;

@group(0) @binding(0) var<uniform> parameters: Parameters;
// Surface nodes at rest; then the bounding sphere (centre, radius) of each triangle; then each proxy node's radius in
// x; then the bounding spheres of the clusters of triangles, and of the groups of clusters.
@group(0) @binding(1) var<storage, read> rest: array<vec4<f32>>;
@group(0) @binding(2) var<storage, read> mesh: array<u32>;
// Proxy nodes; w receives the gap.
@group(0) @binding(3) var<storage, read_write> positions: array<vec4<f32>>;
// All triangles, CLUSTER of them side by side in each cluster.
@group(0) @binding(4) var<storage, read> clusters: array<u32>;

fn node_from(node: u32, x: vec3<f32>) -> vec3<f32> {
    return rest[node].xyz - x;
}

// Whether the bounding sphere in this place is farther from x than `away`.
fn is_beyond(sphere: u32, x: vec3<f32>, away: f32) -> bool {
    return distance(x, rest[sphere].xyz) - rest[sphere].w > away;
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
    var best = ABSENT;
    var best_point = ClosestPoint();
    var best_offset = vec3<f32>(0.0);
    // No point of the surface is closer than the closest one to the farthest point of a sphere around some.
    let at_clusters = parameters.surface_nodes + parameters.triangles + parameters.proxy_nodes;
    let at_groups = at_clusters + parameters.clusters;
    for (var k = 0u; k < parameters.groups; k += 1u) {
        let sphere = rest[at_groups + k];
        least = min(least, distance(x, sphere.xyz) + sphere.w);
    }
    var entry = 0u;
    loop {
        // The next triangle that may be closer.
        var triangle = ABSENT;
        while triangle == ABSENT && entry < parameters.triangles {
            if entry % (GROUP * CLUSTER) == 0u && is_beyond(at_groups + entry / (GROUP * CLUSTER), x, least) {
                entry += GROUP * CLUSTER;
                continue;
            }
            if entry % CLUSTER == 0u && is_beyond(at_clusters + entry / CLUSTER, x, least) {
                entry += CLUSTER;
                continue;
            }
            triangle = clusters[entry];
            if is_beyond(parameters.surface_nodes + triangle, x, least) {
                triangle = ABSENT;
            }
            entry += 1u;
        }
        if triangle == ABSENT {
            break;
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
    let inside = dot(best_offset, pseudonormal(best, best_point.feature, x)) > 0.0;
    let radius = rest[parameters.surface_nodes + parameters.triangles + index % parameters.proxy_nodes].x;
    positions[index].w = select(least, -least, inside) - radius;
}
