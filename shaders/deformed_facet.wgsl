// Facets of the displaced surface: their control points, and how their points hang on the object's nodes (twin:
// src/contact/geometry/smooth.rs).

// Whether facets are of degree four.
override SMOOTH: bool = false;

fn facet_in_order(entry: u32) -> u32 {
    return mesh[parameters.at_order + entry];
}

// Place of node j of a facet: its corners first; ABSENT behind the last.
fn carrier(facet: u32, j: u32) -> u32 {
    return mesh[parameters.at_carriers + facet * parameters.carriers + j];
}

// Position of the node in `place` less x. A node that the compliance does not cover does not move.
fn node_from(place: u32, x: vec3<real>) -> vec3<real> {
    let at_rest = surface_vector(parameters.at_rest + 3u * place) - x;
    if place >= parameters.covered {
        return at_rest;
    }
    return at_rest + vector_at(at_displacement(place));
}

// Where the mask of node j begins: its weight in each control point.
fn at_mask(facet: u32, j: u32) -> u32 {
    return parameters.at_masks + 15u * (mesh[parameters.at_shapes + facet] * parameters.carriers + j);
}

// Takes `facet` for the current one.
fn form(facet: u32, x: vec3<real>) {
    if !SMOOTH {
        net[0] = node_from(carrier(facet, 0u), x);
        net[10] = node_from(carrier(facet, 1u), x);
        net[14] = node_from(carrier(facet, 2u), x);
        return;
    }
    net = array<vec3<real>, 15>();
    for (var j = 0u; j < parameters.carriers; j += 1u) {
        let place = carrier(facet, j);
        if place == ABSENT {
            break;
        }
        let p = node_from(place, x) + surface_vector(parameters.at_offsets + 3u * place);
        let m = at_mask(facet, j);
        net[0] += surface[m + 0u] * p;
        net[1] += surface[m + 1u] * p;
        net[2] += surface[m + 2u] * p;
        net[3] += surface[m + 3u] * p;
        net[4] += surface[m + 4u] * p;
        net[5] += surface[m + 5u] * p;
        net[6] += surface[m + 6u] * p;
        net[7] += surface[m + 7u] * p;
        net[8] += surface[m + 8u] * p;
        net[9] += surface[m + 9u] * p;
        net[10] += surface[m + 10u] * p;
        net[11] += surface[m + 11u] * p;
        net[12] += surface[m + 12u] * p;
        net[13] += surface[m + 13u] * p;
        net[14] += surface[m + 14u] * p;
    }
}

// Whether it is known without forming the facet that it is farther than `distance` from x: by its flat triangle.
fn is_beyond(facet: u32, x: vec3<real>, distance: real) -> bool {
    if !SMOOTH {
        return false;
    }
    let a = node_from(carrier(facet, 0u), x);
    let b = node_from(carrier(facet, 1u), x);
    let c = node_from(carrier(facet, 2u), x);
    let w = closest_point(vec3<real>(0.0), a, b, c).weights;
    return length(blend(w, a, b, c)) > distance + scalar(BULGE);
}
