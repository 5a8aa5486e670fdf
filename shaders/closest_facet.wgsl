// The closest facet of the surface at rest, and the pseudonormal there (twins: src/contact/geometry/rest.rs and
// distance_bounds.rs).
//
// `surface` begins with spheres around the control points of facets: a binary tree over the facets in an order in which
// neighbours are near each other. Node 1 is the root, node i has the children 2 i and 2 i + 1, and the facet in place k
// of the order is node leaves + k. Behind the last facet leaves have spheres that are far from everything.

// Distance of x to the sphere of a node; below zero inside.
fn distance_to_sphere(node: u32, x: vec3<f32>) -> f32 {
    let sphere = surface[node];
    return distance(x, sphere.xyz) - sphere.w;
}

// The node that a search from left to right comes to behind a node and all under it; zero behind the last.
fn behind(node: u32) -> u32 {
    let next = (node + 1u) >> firstTrailingBit(node + 1u);
    return select(next, 0u, next == 1u);
}

// The facet to which the nearer child leads, from the root down.
fn facet_near(x: vec3<f32>) -> u32 {
    var node = 1u;
    while node < parameters.leaves {
        node = 2u * node;
        if distance_to_sphere(node + 1u, x) < distance_to_sphere(node, x) {
            node += 1u;
        }
    }
    return facet_in_order(node - parameters.leaves);
}

// Bounds on the signed distance of x from below and from above, and a facet near by.
struct Bounds {
    lower: f32,
    upper: f32,
    near: u32,
}

fn bounds_at(x: vec3<f32>) -> Bounds {
    let place = (x - vec3<f32>(parameters.low_x, parameters.low_y, parameters.low_z)) * parameters.inverse_side;
    let counts = vec3<u32>(parameters.cubes_x, parameters.cubes_y, parameters.cubes_z);
    var bounds: Bounds;
    if all(place >= vec3<f32>(0.0)) && all(vec3<u32>(place) < counts) {
        let at = vec3<u32>(place);
        let cube = (at.x * counts.y + at.y) * counts.z + at.z;
        let bound = surface[parameters.at_cubes + cube];
        bounds.lower = bound.w + dot(bound.xyz, x) - parameters.bulge;
        bounds.near = mesh[parameters.at_near + cube];
    } else {
        bounds.lower = distance_to_sphere(1u, x);
        bounds.near = facet_near(x);
    }
    bounds.lower -= parameters.band;
    bounds.upper = distance_to_triangle(bounds.near, x) + parameters.bulge + parameters.band;
    return bounds;
}

// Distance of x to the flat triangle between the corners of a facet.
fn distance_to_triangle(facet: u32, x: vec3<f32>) -> f32 {
    let a = control(facet, 0u) - x;
    let b = control(facet, select(1u, 10u, SMOOTH)) - x;
    let c = control(facet, select(2u, 14u, SMOOTH)) - x;
    return length(blend(closest_point(vec3<f32>(0.0), a, b, c).weights, a, b, c));
}

// Takes `facet` for the current one, relative to x.
fn form(facet: u32, x: vec3<f32>) {
    net[0] = control(facet, 0u) - x;
    if !SMOOTH {
        net[10] = control(facet, 1u) - x;
        net[14] = control(facet, 2u) - x;
        return;
    }
    net[1] = control(facet, 1u) - x;
    net[2] = control(facet, 2u) - x;
    net[3] = control(facet, 3u) - x;
    net[4] = control(facet, 4u) - x;
    net[5] = control(facet, 5u) - x;
    net[6] = control(facet, 6u) - x;
    net[7] = control(facet, 7u) - x;
    net[8] = control(facet, 8u) - x;
    net[9] = control(facet, 9u) - x;
    net[10] = control(facet, 10u) - x;
    net[11] = control(facet, 11u) - x;
    net[12] = control(facet, 12u) - x;
    net[13] = control(facet, 13u) - x;
    net[14] = control(facet, 14u) - x;
}

struct Closest {
    distance: f32,
    facet: u32,
    point: ClosestPoint,
}

// The facet closest to x; facet `likely` is measured first. Facets are searched from left to right of the tree, past
// nodes whose sphere leaves no room for the closest one, and past bent facets whose triangle is too far.
fn closest_facet(x: vec3<f32>, likely: u32) -> Closest {
    var best = Closest(FAR_AWAY, ABSENT, ClosestPoint(vec3<f32>(0.0), FEATURE_FACE));
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
                let is_far = SMOOTH && distance_to_triangle(facet, x) > best.distance + parameters.bulge + parameters.band;
                facet = select(facet, ABSENT, facet == best.facet || is_far);
            }
            node = behind(node);
        }
        if facet == ABSENT {
            break;
        }
        form(facet, x);
        let found = closest_on_facet();
        // Ties go to the lower number.
        if found.distance < best.distance || (found.distance == best.distance && facet < best.facet) {
            best = Closest(found.distance, facet, found.point);
        }
        facet = ABSENT;
    }
    return best;
}

// Pseudonormal at a point of a facet, outward, not of length one. The facet is the current one afterwards.
fn pseudonormal(facet: u32, point: ClosestPoint, x: vec3<f32>) -> vec3<f32> {
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
    var sum = vec3<f32>(0.0);
    for (var entry = first; entry <= last; entry += 1u) {
        // One loop for all features: a facet formed at each of four places would quadruple the program.
        var face = facet;
        var there = point.weights;
        var k = 0u;
        let is_last = entry == last;
        if !is_last && point.feature < FEATURE_EDGE {
            face = around(entry);
            k = place_of_corner(face, node);
            there = one_hot(k);
        } else if !is_last && entry == 1u {
            let edge = point.feature - FEATURE_EDGE;
            face = across(facet, edge);
            let back = place_of_corner(face, corner(facet, (edge + 1u) % 3u));
            there = dot(point.weights, one_hot((edge + 1u) % 3u)) * one_hot(back)
                + dot(point.weights, one_hot(edge)) * one_hot((back + 1u) % 3u);
        }
        // At the end the facet itself.
        form(face, x);
        if is_last {
            break;
        }
        let jet = jet_at(there);
        sum += select(1.0, angle_at(jet, k), point.feature < FEATURE_EDGE) * normal_of(jet);
    }
    return sum;
}
