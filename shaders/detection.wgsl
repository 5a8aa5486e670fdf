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

// The facet closest to x; facet `likely` is tried first. Facets are searched from left to right of the tree of bounding
// spheres, past nodes whose sphere leaves no room for the closest one.
fn closest_facet(x: vec3<real>, likely: u32) -> Closest {
    var best = none_within(FAR_AWAY);
    formed = ABSENT;
    var node = 1u;
    var facet = likely;
    loop {
        // The next facet that may be closer.
        while facet == ABSENT && node != 0u {
            let has_room = distance_to_sphere(node, x) <= best.distance;
            if has_room && node < parameters.leaves {
                node = 2u * node;
                continue;
            }
            if has_room {
                facet = facet_in_order(node - parameters.leaves);
            }
            node = behind(node);
        }
        if facet == ABSENT {
            break;
        }
        if facet != best.facet {
            take(facet, x);
            let point = closest_on_facet();
            let away = length(jet_at(point.weights).point);
            if is_closer(away, facet, best) {
                best = Closest(away, facet, point);
            }
        }
        facet = ABSENT;
    }
    return best;
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
    let closest = closest_facet(x, facet_in_order(leaf_near(x) - parameters.leaves));
    var gap = closest.distance;
    if closest.facet != ABSENT {
        let direction = pseudonormal(closest.facet, closest.point, x);
        if dot(jet_at(closest.point.weights).point, direction) > 0.0 {
            gap = -gap;
        }
    }
    positions[index].w = gap - surface[radii() + index % parameters.proxy_nodes].x;
}
