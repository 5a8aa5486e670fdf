// Signed distance of every proxy node to the flat triangles at rest, less its radius: one invocation a (configuration,
// node).

override WORKGROUP: u32 = 64u;
const SMOOTH: bool = false;

@group(0) @binding(0) var<uniform> parameters: Parameters;
// Bounding spheres of the triangles (bounding_spheres.wgsl); then each proxy node's radius in x; then the surface nodes
// at rest.
@group(0) @binding(1) var<storage, read> surface: array<vec4<f32>>;
@group(0) @binding(2) var<storage, read> mesh: array<u32>;
// Proxy nodes; w receives the gap.
@group(0) @binding(3) var<storage, read_write> positions: array<vec4<f32>>;
@group(0) @binding(4) var<storage, read> order: array<u32>;

fn radii() -> u32 {
    return 2u * parameters.leaves;
}

fn node_from(node: u32, x: vec3<f32>) -> vec3<f32> {
    return surface[radii() + parameters.proxy_nodes + node].xyz - x;
}

fn facet_in_order(place: u32) -> u32 {
    return order[place];
}

// Takes `facet` for the current one.
fn form(facet: u32, x: vec3<f32>) {
    net[0] = node_from(corner(facet, 0u), x);
    net[10] = node_from(corner(facet, 1u), x);
    net[14] = node_from(corner(facet, 2u), x);
}

// Whether it is known without forming the facet that it is farther than `distance` from x.
fn is_beyond(facet: u32, x: vec3<f32>, distance: f32) -> bool {
    return false;
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
    let closest = closest_facet(x, FAR_AWAY, 0.0, facet_in_order(leaf_near(x) - parameters.leaves));
    var gap = closest.distance;
    if closest.facet != ABSENT {
        let direction = pseudonormal(closest.facet, closest.point, x);
        if dot(jet_at(closest.point.weights).point, direction) > 0.0 {
            gap = -gap;
        }
    }
    positions[index].w = gap - surface[radii() + index % parameters.proxy_nodes].x;
}
