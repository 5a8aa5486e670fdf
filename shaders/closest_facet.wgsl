// The closest facet of the surface, and the pseudonormal there (twins: src/contact/detection.rs and
// src/contact/geometry/rest.rs).
//
// The stage declares `mesh`, and `form(facet, x)`.

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

// Nothing yet, and nothing farther than `within`.
fn none_within(within: real) -> Closest {
    return Closest(within, ABSENT, ClosestPoint(vec3<real>(0.0), FEATURE_FACE));
}

// Whether a facet at this distance is closer; ties go to the lower number.
fn is_closer(distance: real, facet: u32, best: Closest) -> bool {
    return distance < best.distance || (distance == best.distance && facet < best.facet);
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
        take(face, x);
        if is_last {
            break;
        }
        let jet = jet_at(there);
        sum += select(real(1.0), angle_at(jet, k), point.feature < FEATURE_EDGE) * normal_of(jet);
    }
    return sum;
}
