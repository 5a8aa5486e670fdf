// The facet that is closest to a point, and the surface's pseudonormal there (twins: src/contact/detection.rs and
// src/contact/geometry/rest.rs).
//
// Facets are searched from left to right of the tree of bounding spheres at rest, past nodes whose sphere leaves no
// room for the closest one; ties go to the lower number. The stage declares `parameters`, `mesh`, `facet_in_order`,
// `form` and `is_beyond`.

// The current facet.
var<private> formed: u32;

// Takes `facet` for the current one, relative to the x of the search.
fn take(facet: u32, x: vec3<real>) {
    if formed != facet {
        form(facet, x);
        formed = facet;
    }
}

struct Closest {
    distance: real,
    facet: u32,
    point: ClosestPoint,
}

// Facets that this invocation has measured.
var<private> measured: u32;

// The facet closest to x, if there is one no farther than `within`; facet `likely`, where there is one, is tried first.
// No facet has left its place at rest by more than `moved`.
fn closest_facet(x: vec3<real>, within: real, moved: real, likely: u32) -> Closest {
    var best = Closest();
    best.distance = within;
    best.facet = ABSENT;
    formed = ABSENT;
    var node = 1u;
    var facet = likely;
    loop {
        // The next facet that may be closer.
        while facet == ABSENT && node != 0u {
            let has_room = distance_to_sphere(node, x) <= best.distance + moved;
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
        if facet != best.facet && !is_beyond(facet, x, best.distance) {
            take(facet, x);
            let point = closest_on_facet();
            measured += 1u;
            let away = length(jet_at(point.weights).point);
            if away < best.distance || (away == best.distance && facet < best.facet) {
                best = Closest(away, facet, point);
            }
        }
        facet = ABSENT;
    }
    return best;
}

// Pseudonormal at a point of a facet, outward, not of length one. The facet is the current one afterwards.
fn pseudonormal(facet: u32, point: ClosestPoint, x: vec3<real>) -> vec3<real> {
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
    var sum = vec3<real>(0.0);
    for (var entry = first; entry <= last; entry += 1u) {
        // One loop for all features: a facet formed at each of four places would quadruple the program.
        var face = facet;
        var there = point.weights;
        var k = 0u;
        if entry == last {
            take(facet, x);
            break;
        }
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
        take(face, x);
        let jet = jet_at(there);
        sum += select(real(1.0), angle_at(jet, k), point.feature < FEATURE_EDGE) * normal_of(jet);
    }
    return sum;
}
