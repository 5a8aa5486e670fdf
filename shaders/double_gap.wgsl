// Smallest signed distance of a configuration's proxy nodes to the surface at rest, less their radii, in f64 (twin:
// src/contact/geometry/rest.rs): one invocation a configuration. Below zero there is contact.
//
// Of the gaps that f32 found, to flat triangles, those that may be the smallest are measured again. Facets are searched
// group by group of clusters, past those whose bounding sphere leaves no room for the closest one; ties go to the lower
// number.

override WORKGROUP: u32 = 32u;
// Whether facets are of degree four.
override SMOOTH: bool = false;

@group(0) @binding(0) var<uniform> parameters: DoubleParameters;
// One behind the other: the bounding spheres (centre, radius) of the clusters of facets, of the groups of clusters, and
// of the facets in the order of the clusters; the radius of each proxy node; the control points of the facets.
@group(0) @binding(1) var<storage, read> surface: array<f64>;
@group(0) @binding(2) var<storage, read> mesh: array<u32>;
// All facets, CLUSTER of them side by side in each cluster.
@group(0) @binding(3) var<storage, read> order: array<u32>;
// Proxy nodes in f32; w is the gap of each.
@group(0) @binding(4) var<storage, read> positions: array<vec4<f32>>;
// The same in f64, three coordinates each.
@group(0) @binding(5) var<storage, read> placed: array<f64>;
@group(0) @binding(6) var<storage, read_write> gaps: array<f64>;

const ABSENT: u32 = 0xffffffffu;

// Distance of x to a bounding sphere; below zero inside.
fn distance_to_sphere(number: u32, x: vec3<f64>) -> f64 {
    let at = 4u * number;
    return distance(x, vec3<f64>(surface[at], surface[at + 1u], surface[at + 2u])) - surface[at + 3u];
}

// Where the radii of the proxy nodes begin.
fn radii() -> u32 {
    return 4u * (parameters.clusters + parameters.groups + parameters.triangles);
}

fn control(facet: u32, k: u32, x: vec3<f64>) -> vec3<f64> {
    let at = radii() + parameters.proxy_nodes + 3u * (facet * select(3u, 15u, SMOOTH) + k);
    return vec3<f64>(surface[at], surface[at + 1u], surface[at + 2u]) - x;
}

struct Closest {
    distance: f64,
    facet: u32,
    point: ClosestPoint,
}

// The facet closest to x, if there is one no farther than `within`.
fn closest_facet(x: vec3<f64>, within: f64) -> Closest {
    var best = Closest();
    best.distance = within;
    best.facet = ABSENT;
    var entry = 0u;
    loop {
        // The next facet that may be closer.
        var facet = ABSENT;
        while entry < parameters.triangles {
            if entry % (GROUP * CLUSTER) == 0u
                && distance_to_sphere(parameters.clusters + entry / (GROUP * CLUSTER), x) > best.distance {
                entry += GROUP * CLUSTER;
                continue;
            }
            if entry % CLUSTER == 0u && distance_to_sphere(entry / CLUSTER, x) > best.distance {
                entry += CLUSTER;
                continue;
            }
            entry += 1u;
            if distance_to_sphere(parameters.clusters + parameters.groups + entry - 1u, x) <= best.distance {
                facet = order[entry - 1u];
                break;
            }
        }
        if facet == ABSENT {
            break;
        }
        form(facet, x);
        let point = closest_on_facet();
        let away = length(jet_at(point.weights).point);
        if away < best.distance || (away == best.distance && facet < best.facet) {
            best = Closest(away, facet, point);
        }
    }
    return best;
}

// Pseudonormal at a point of a facet, outward, not of length one.
fn pseudonormal(facet: u32, point: ClosestPoint, x: vec3<f64>) -> vec3<f64> {
    var first = 0u;
    var last = 1u;
    var node = 0u;
    if point.feature < FEATURE_EDGE {
        node = corner(facet, point.feature);
        first = around_start(node);
        last = around_start(node + 1u);
    } else if point.feature < FEATURE_FACE {
        last = 2u;
    }
    var sum = vec3<f64>(0.0);
    for (var entry = first; entry < last; entry += 1u) {
        // One loop for all features: a facet formed at each of three places would triple the program.
        var face = facet;
        var there = point.weights;
        var k = 0u;
        if point.feature < FEATURE_EDGE {
            face = around(entry);
            k = place_of_corner(face, node);
            there = one_hot(k);
        } else if entry == 1u {
            let edge = point.feature - FEATURE_EDGE;
            face = across(facet, edge);
            let back = place_of_corner(face, corner(facet, (edge + 1u) % 3u));
            there = dot(point.weights, one_hot((edge + 1u) % 3u)) * one_hot(back)
                + dot(point.weights, one_hot(edge)) * one_hot((back + 1u) % 3u);
        }
        form(face, x);
        let jet = jet_at(there);
        sum += select(f64(1.0), angle_at(jet, k), point.feature < FEATURE_EDGE) * normal_of(jet);
    }
    return sum;
}

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
    let first = configuration * parameters.proxy_nodes;
    var least = FAR_AWAY;
    for (var node = 0u; node < parameters.proxy_nodes; node += 1u) {
        least = min(least, f64(positions[first + node].w));
    }
    least += 2.0 * parameters.gap_band;
    var gap = FAR_AWAY;
    for (var node = 0u; node < parameters.proxy_nodes; node += 1u) {
        let known = f64(positions[first + node].w);
        if known > least {
            continue;
        }
        let at = 3u * (first + node);
        let x = vec3<f64>(placed[at], placed[at + 1u], placed[at + 2u]);
        let radius = surface[radii() + node];
        let closest = closest_facet(x, abs(known + radius) + 2.0 * parameters.gap_band);
        if closest.facet == ABSENT {
            continue;
        }
        let direction = pseudonormal(closest.facet, closest.point, x);
        form(closest.facet, x);
        let inside = dot(jet_at(closest.point.weights).point, direction) > 0.0;
        gap = min(gap, select(closest.distance, -closest.distance, inside) - radius);
    }
    gaps[configuration] = gap;
}
