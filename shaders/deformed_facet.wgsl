// Facets of the displaced surface: their control points, and how their points hang on the object's nodes (twin:
// src/contact/geometry/smooth.rs).

// Whether facets are of degree four.
override SMOOTH: bool = false;

fn facet_in_order(place: u32) -> u32 {
    return mesh[parameters.at_order + place];
}

// Place of node j of a facet: its corners first; ABSENT behind the last.
fn carrier(facet: u32, j: u32) -> u32 {
    return mesh[parameters.at_carriers + facet * parameters.carriers + j];
}

// Displacement of the node in `place`. A node that the compliance does not cover does not move.
fn displacement_of(place: u32) -> vec3<real> {
    if place >= parameters.covered {
        return vec3<real>(0.0);
    }
    return vector_at(at_displacement(place));
}

// Position of the node in `place` less x.
fn node_from(place: u32, x: vec3<real>) -> vec3<real> {
    return at_rest(place) - x + displacement_of(place);
}

// Its point of the control net less x.
fn control_from(place: u32, x: vec3<real>) -> vec3<real> {
    return surface[parameters.at_net + place].xyz - x + displacement_of(place);
}

// Whose corners all have six neighbours: see Shape::REGULAR of the twin.
const REGULAR: u32 = 0u;

fn shape_of(facet: u32) -> u32 {
    return mesh[parameters.at_shapes + facet];
}

// Where the mask of node j begins, its weight in each control point, four by four.
fn at_mask(shape: u32, j: u32) -> u32 {
    return parameters.at_masks + 4u * (shape * parameters.carriers + j);
}

// Takes `facet` for the current one.
fn form(facet: u32, x: vec3<real>) {
    if !SMOOTH {
        net[0] = node_from(carrier(facet, 0u), x);
        net[10] = node_from(carrier(facet, 1u), x);
        net[14] = node_from(carrier(facet, 2u), x);
        return;
    }
    let shape = shape_of(facet);
    if shape == REGULAR {
        form_regular(facet, x);
        return;
    }
    net = array<vec3<real>, 15>();
    for (var j = 0u; j < parameters.carriers; j += 1u) {
        let place = carrier(facet, j);
        if place == ABSENT {
            break;
        }
        let p = control_from(place, x);
        let m = at_mask(shape, j);
        let m_0 = surface[m];
        let m_1 = surface[m + 1u];
        let m_2 = surface[m + 2u];
        let m_3 = surface[m + 3u];
        net[0] += m_0.x * p;
        net[1] += m_0.y * p;
        net[2] += m_0.z * p;
        net[3] += m_0.w * p;
        net[4] += m_1.x * p;
        net[5] += m_1.y * p;
        net[6] += m_1.z * p;
        net[7] += m_1.w * p;
        net[8] += m_2.x * p;
        net[9] += m_2.y * p;
        net[10] += m_2.z * p;
        net[11] += m_2.w * p;
        net[12] += m_3.x * p;
        net[13] += m_3.y * p;
        net[14] += m_3.z * p;
    }
}

// The twenty-fourth part of the point of the net that belongs to node j of a facet, less x.
fn part_from(facet: u32, j: u32, x: vec3<real>) -> vec3<real> {
    return control_from(carrier(facet, j), x) / 24.0;
}

// The same of a regular facet, whose masks are the same everywhere, in twenty-fourths.
fn form_regular(facet: u32, x: vec3<real>) {
    let a = part_from(facet, 0u, x);
    let b = part_from(facet, 1u, x);
    let c = part_from(facet, 2u, x);
    // Across the edges.
    let ab = part_from(facet, 3u, x);
    let bc = part_from(facet, 4u, x);
    let ca = part_from(facet, 5u, x);
    // The other neighbours of each corner, anticlockwise.
    let a_0 = part_from(facet, 6u, x);
    let a_1 = part_from(facet, 7u, x);
    let b_0 = part_from(facet, 8u, x);
    let b_1 = part_from(facet, 9u, x);
    let c_0 = part_from(facet, 10u, x);
    let c_1 = part_from(facet, 11u, x);
    net[0] = 12.0 * a + 2.0 * (b + c + ca + a_0 + a_1 + ab);
    net[1] = 12.0 * a + 4.0 * b + 3.0 * (c + ab) + ca + a_1;
    net[2] = 12.0 * a + 4.0 * c + 3.0 * (b + ca) + ab + a_0;
    net[3] = 8.0 * (a + b) + 4.0 * (c + ab);
    net[4] = 10.0 * a + 6.0 * (b + c) + ab + ca;
    net[5] = 8.0 * (a + c) + 4.0 * (b + ca);
    net[6] = 12.0 * b + 4.0 * a + 3.0 * (c + ab) + bc + b_0;
    net[7] = 10.0 * b + 6.0 * (c + a) + bc + ab;
    net[8] = 10.0 * c + 6.0 * (a + b) + ca + bc;
    net[9] = 12.0 * c + 4.0 * a + 3.0 * (b + ca) + bc + c_1;
    net[10] = 12.0 * b + 2.0 * (c + a + ab + b_0 + b_1 + bc);
    net[11] = 12.0 * b + 4.0 * c + 3.0 * (a + bc) + ab + b_1;
    net[12] = 8.0 * (b + c) + 4.0 * (a + bc);
    net[13] = 12.0 * c + 4.0 * b + 3.0 * (a + bc) + ca + c_0;
    net[14] = 12.0 * c + 2.0 * (a + b + bc + c_0 + c_1 + ca);
}

// Corners of a facet.
fn triangle_of(facet: u32) -> mat3x3<real> {
    let origin = vec3<real>(0.0);
    return mat3x3<real>(node_from(carrier(facet, 0u), origin), node_from(carrier(facet, 1u), origin),
        node_from(carrier(facet, 2u), origin));
}

// By how much facets stand off their triangles, at most.
fn bulge() -> real {
    return scalar(BULGE);
}
