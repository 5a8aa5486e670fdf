// Signed distance of every proxy node to the surface at rest, less its radius: one invocation a (configuration, node).
// Neighbouring invocations are neighbouring nodes and walk the triangles in step.

override WORKGROUP: u32 = 64u;

@group(0) @binding(0) var<uniform> parameters: Parameters;
// Surface nodes at rest; w is unused.
@group(0) @binding(1) var<storage, read> rest: array<vec4<f32>>;
@group(0) @binding(2) var<storage, read> mesh: array<u32>;
// Bounding sphere of each triangle: centre, radius.
@group(0) @binding(3) var<storage, read> spheres: array<vec4<f32>>;
// Of each proxy node.
@group(0) @binding(4) var<storage, read> radii: array<f32>;
@group(0) @binding(5) var<storage, read> positions: array<vec4<f32>>;
@group(0) @binding(6) var<storage, read_write> gaps: array<f32>;

fn node_position(node: u32) -> vec3<f32> {
    return rest[node].xyz;
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
    var best_closest = Closest(vec3<f32>(1.0, 0.0, 0.0), 0u);
    for (var triangle = 0u; triangle < parameters.triangles; triangle += 1u) {
        let sphere = spheres[triangle];
        if distance(x, sphere.xyz) - sphere.w >= least {
            continue;
        }
        let a = node_position(corner(triangle, 0u));
        let b = node_position(corner(triangle, 1u));
        let c = node_position(corner(triangle, 2u));
        let closest = closest_on_triangle(x, a, b, c);
        let foot = closest.weights.x * a + closest.weights.y * b + closest.weights.z * c;
        if distance(x, foot) < least {
            least = distance(x, foot);
            best = triangle;
            best_closest = closest;
        }
    }
    gaps[index] = signed_distance(x, best, best_closest) - radii[index % parameters.proxy_nodes];
}
