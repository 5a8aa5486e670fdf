// Signed distance of proxy nodes to the flat triangles at rest, less their radii: one workgroup a configuration.
//
// Of nodes that are far outside only bounds are known, from spheres around many triangles each: there nothing touches,
// the smallest gap is that of another node, and the closest triangle is hard to find, since many are about as far.

override WORKGROUP: u32 = 64u;
const SMOOTH: bool = false;

@group(0) @binding(0) var<uniform> parameters: Parameters;
// Bounding spheres of the triangles (bounding_spheres.wgsl); then each proxy node's radius in x; then the surface nodes
// at rest.
@group(0) @binding(1) var<storage, read> surface: array<vec4<f32>>;
@group(0) @binding(2) var<storage, read> mesh: array<u32>;
// Proxy nodes; w receives the gap or, where that is greater than known_to, a bound below it.
@group(0) @binding(3) var<storage, read_write> positions: array<vec4<f32>>;
@group(0) @binding(4) var<storage, read> order: array<u32>;

// Spheres by which distances are bounded: a level of the tree.
const BOUNDING: u32 = 128u;

fn radius_of(node: u32) -> f32 {
    return surface[2u * parameters.leaves + node].x;
}

fn node_from(node: u32, x: vec3<f32>) -> vec3<f32> {
    return surface[2u * parameters.leaves + parameters.proxy_nodes + node].xyz - x;
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
            let found = closest_on_facet();
            if is_closer(found.distance, facet, best) {
                best = Closest(found.distance, facet, found.point);
            }
        }
        facet = ABSENT;
    }
    return best;
}

// Bounds on the distance of x to the triangles, from below and from above.
fn bounds_on_distance(x: vec3<f32>) -> vec2<f32> {
    let level = min(BOUNDING, parameters.leaves);
    var bounds = vec2<f32>(FAR_AWAY);
    for (var node = level; node < 2u * level; node += 1u) {
        let sphere = surface[node];
        let away = distance(x, sphere.xyz);
        // Where there is no triangle the radius is far below zero.
        bounds = min(bounds, vec2<f32>(away - sphere.w, away + abs(sphere.w)));
    }
    return bounds;
}

// Signed distance of x to the triangles.
fn signed_distance(x: vec3<f32>) -> f32 {
    let closest = closest_facet(x, facet_in_order(leaf_near(x) - parameters.leaves));
    if closest.facet == ABSENT {
        return closest.distance;
    }
    let direction = pseudonormal(closest.facet, closest.point, x);
    return select(closest.distance, -closest.distance, dot(jet_at(closest.point.weights).point, direction) > 0.0);
}

@compute @workgroup_size(WORKGROUP)
fn main(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) local: u32,
) {
    let configuration = unfold(group, groups);
    if configuration >= parameters.configurations {
        return;
    }
    let first = configuration * parameters.proxy_nodes;
    var smallest = FAR_AWAY;
    for (var node = local; node < parameters.proxy_nodes; node += WORKGROUP) {
        let x = positions[first + node].xyz;
        let bounds = bounds_on_distance(x) - radius_of(node);
        smallest = min(smallest, bounds.y);
        // What lies in the sphere around all triangles may be inside.
        positions[first + node].w = select(-FAR_AWAY, bounds.x, distance_to_sphere(1u, x) > 0.0);
    }
    let known_to = max(least_of(smallest, local), parameters.known_to);
    for (var node = local; node < parameters.proxy_nodes; node += WORKGROUP) {
        let at = positions[first + node];
        if at.w <= known_to {
            positions[first + node].w = signed_distance(at.xyz) - radius_of(node);
        }
    }
}
