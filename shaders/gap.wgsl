// Smallest signed distance of a configuration's proxy nodes to the surface at rest, less their radii (twin:
// src/contact/geometry/rest.rs): one workgroup a configuration. Below zero there is contact.
//
// Of the gaps that f32 found, to flat triangles, those that may be the smallest are measured again.

override WORKGROUP: u32 = 32u;
// Whether facets are of degree four.
override SMOOTH: bool = false;

@group(0) @binding(0) var<uniform> parameters: Parameters;
// Bounding spheres of the facets (bounding_spheres.wgsl); then each proxy node's radius in x; then the control points
// of the facets.
@group(0) @binding(1) var<storage, read> surface: array<vec4<real>>;
@group(0) @binding(2) var<storage, read> mesh: array<u32>;
@group(0) @binding(3) var<storage, read> order: array<u32>;
// Proxy nodes in f32; w is the gap of each.
@group(0) @binding(4) var<storage, read> positions: array<vec4<f32>>;
// The same in the numbers of this stage, three coordinates each.
@group(0) @binding(5) var<storage, read> placed: array<real>;
@group(0) @binding(6) var<storage, read_write> gaps: array<real>;

// Where the radii of the proxy nodes begin.
fn radii() -> u32 {
    return 2u * parameters.leaves;
}

fn control(facet: u32, k: u32, x: vec3<real>) -> vec3<real> {
    return surface[radii() + parameters.proxy_nodes + facet * select(3u, 15u, SMOOTH) + k].xyz - x;
}

fn facet_in_order(place: u32) -> u32 {
    return order[place];
}

// Takes `facet` for the current one.
fn form(facet: u32, x: vec3<real>) {
    net[0] = control(facet, 0u, x);
    if !SMOOTH {
        net[10] = control(facet, 1u, x);
        net[14] = control(facet, 2u, x);
        return;
    }
    net[1] = control(facet, 1u, x);
    net[2] = control(facet, 2u, x);
    net[3] = control(facet, 3u, x);
    net[4] = control(facet, 4u, x);
    net[5] = control(facet, 5u, x);
    net[6] = control(facet, 6u, x);
    net[7] = control(facet, 7u, x);
    net[8] = control(facet, 8u, x);
    net[9] = control(facet, 9u, x);
    net[10] = control(facet, 10u, x);
    net[11] = control(facet, 11u, x);
    net[12] = control(facet, 12u, x);
    net[13] = control(facet, 13u, x);
    net[14] = control(facet, 14u, x);
}

// The surface at rest is ready.
fn need(facet: u32) {}

fn make_ready(local: u32) {}

// Corners of a facet.
fn triangle_of(facet: u32) -> mat3x3<real> {
    let origin = vec3<real>(0.0);
    return mat3x3<real>(control(facet, 0u, origin), control(facet, 10u, origin), control(facet, 14u, origin));
}

// By how much facets stand off their triangles, at most.
fn bulge() -> real {
    return real(parameters.gap_band);
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
    let band = 2.0 * real(parameters.gap_band);
    var known = FAR_AWAY;
    for (var node = local; node < parameters.proxy_nodes; node += WORKGROUP) {
        known = min(known, real(positions[first + node].w));
    }
    known = least_of(known, local);
    var gap = FAR_AWAY;
    for (var run = 0u; run < parameters.proxy_nodes; run += WORKGROUP) {
        let node = run + local;
        var x = vec3<real>(0.0);
        var radius = real(0.0);
        var within = -FAR_AWAY;
        if node < parameters.proxy_nodes {
            let flat = real(positions[first + node].w);
            let at = 3u * (first + node);
            x = vec3<real>(placed[at], placed[at + 1u], placed[at + 2u]);
            radius = surface[radii() + node].x;
            within = select(-FAR_AWAY, abs(flat + radius) + band, flat <= known + band);
        }
        take_point(x, within, local);
        let closest = closest_facet(real(0.0), ABSENT, local);
        if closest.facet != ABSENT {
            let direction = pseudonormal(closest.facet, closest.point, x);
            let is_inside = dot(jet_at(closest.point.weights).point, direction) > 0.0;
            gap = min(gap, select(closest.distance, -closest.distance, is_inside) - radius);
        }
    }
    gap = least_of(gap, local);
    if local == 0u {
        gaps[configuration] = gap;
    }
}
