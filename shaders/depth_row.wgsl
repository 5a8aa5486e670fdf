// The row of a proxy node before the surface at rest (twin, with the formulas: src/contact/law/depth.rs): this
// invocation's own one, and those of the workgroup.
//
// Of the second derivative of the depth two parts are needed: with u the displacement of the facet's nodes, dp that of
// the closest point and dT_a those of the tangents there, the node is pushed along
//     N + M dp + sum_a t_a (N . dT_a),    M = I^-1 B H^-1 along the tangents and (1/s) P across,    t_a = -H^-1_ab T_b.

struct Row {
    x: vec3<f32>,
    depth: f32,
    normal: vec3<f32>,
    facet: u32,
    point: ClosestPoint,
    bending: mat3x3<f32>,
    turning: mat2x3<f32>,
}

var<private> own: Row;
// Weights of its facet's nodes in the closest point, and their slopes by its two parameters; the nodes' places.
var<private> own_weights: array<array<vec4<f32>, CARRIERS>, 3>;
var<private> own_places: array<vec4<u32>, CARRIERS>;
// How fast x moves along the surface where its closest point does, about: one before a flat facet, zero where that leaps.
var<private> own_convexity: f32;
// Displacements of its facet's nodes.
var<private> own_displacements: array<vec3<f32>, 4u * CARRIERS>;

// The inverse of a symmetric matrix of two rows, its entries 00, 01, 11.
fn inverse_of(m: vec3<f32>) -> vec3<f32> {
    return vec3<f32>(m.z, -m.y, m.x) / max(m.x * m.z - m.y * m.y, LEAST_DIVISOR);
}

// The product A B C of symmetric matrices of two rows where that is symmetric.
fn symmetric_product(a: vec3<f32>, b: vec3<f32>, c: vec3<f32>) -> vec3<f32> {
    let first = vec2<f32>(a.x * b.x + a.y * b.y, a.x * b.y + a.y * b.z);
    let second = vec2<f32>(a.y * b.x + a.z * b.y, a.y * b.y + a.z * b.z);
    return vec3<f32>(dot(first, c.xy), dot(first, c.yz), dot(second, c.yz));
}

// The matrix a b^T.
fn outer(a: vec3<f32>, b: vec3<f32>) -> mat3x3<f32> {
    return mat3x3<f32>(a * b.x, a * b.y, a * b.z);
}

// Sets what depends on the directions in which the point may move on its feature, `s` away.
fn set_curvature(jet: Jet, s: f32, inverse_distance: f32) {
    let normal = own.normal;
    own_convexity = 1.0;
    var along = vec3<f32>(0.0);
    var a = vec3<f32>(0.0);
    var b = vec3<f32>(0.0);
    var bending = vec3<f32>(0.0);
    var turning = vec3<f32>(0.0);
    if own.point.feature == FEATURE_FACE {
        a = tangent(jet, TOWARDS_1);
        b = tangent(jet, TOWARDS_2);
        let metric = vec3<f32>(dot(a, a), dot(a, b), dot(b, b));
        let inverse = inverse_of(metric);
        turning = inverse;
        if SMOOTH {
            let bends = vec3<f32>(dot(normal, bend(jet, TOWARDS_1, TOWARDS_1)),
                dot(normal, bend(jet, TOWARDS_1, TOWARDS_2)), dot(normal, bend(jet, TOWARDS_2, TOWARDS_2)));
            let full = metric + s * bends;
            let area = metric.x * metric.z - metric.y * metric.y;
            own_convexity = (full.x * full.z - full.y * full.y) / max(area, LEAST_DIVISOR);
            if full.x > 0.0 && own_convexity > LEAST_CONVEXITY {
                turning = inverse_of(full);
                bending = symmetric_product(inverse, bends, turning);
            }
        }
    } else if own.point.feature >= FEATURE_EDGE {
        let d = along_edge(own.point.feature - FEATURE_EDGE);
        a = tangent(jet, d);
        let metric = max(dot(a, a), LEAST_DIVISOR);
        along = a / sqrt(metric);
        turning.x = 1.0 / metric;
        let bent = dot(normal, bend(jet, d, d));
        let full = metric + s * bent;
        own_convexity = full / metric;
        if own_convexity > LEAST_CONVEXITY {
            turning.x = 1.0 / full;
            bending.x = bent / (metric * full);
        }
    }
    let across = mat3x3<f32>(1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0) - outer(normal, normal) - outer(along, along);
    own.bending = inverse_distance * across + outer(a, bending.x * a + bending.y * b)
        + outer(b, bending.y * a + bending.z * b);
    own.turning = mat2x3<f32>(-(turning.x * a + turning.y * b), -(turning.y * a + turning.z * b));
}

// Bernstein polynomials of degree four at weights w, or their derivative along d: cubics at w, raised by `by`, which is
// w or 4 d.
fn raised(w: vec3<f32>, by: vec3<f32>) -> array<vec4<f32>, 4> {
    let c0 = w.x * w.x * w.x;
    let c1 = 3.0 * w.x * w.x * w.y;
    let c2 = 3.0 * w.x * w.x * w.z;
    let c3 = 3.0 * w.x * w.y * w.y;
    let c4 = 6.0 * w.x * w.y * w.z;
    let c5 = 3.0 * w.x * w.z * w.z;
    let c6 = w.y * w.y * w.y;
    let c7 = 3.0 * w.y * w.y * w.z;
    let c8 = 3.0 * w.y * w.z * w.z;
    let c9 = w.z * w.z * w.z;
    return array<vec4<f32>, 4>(
        vec4<f32>(c0 * by.x, c0 * by.y + c1 * by.x, c0 * by.z + c2 * by.x, c1 * by.y + c3 * by.x),
        vec4<f32>(c1 * by.z + c2 * by.y + c4 * by.x, c2 * by.z + c5 * by.x, c3 * by.y + c6 * by.x,
            c3 * by.z + c4 * by.y + c7 * by.x),
        vec4<f32>(c4 * by.z + c5 * by.y + c8 * by.x, c5 * by.z + c9 * by.x, c6 * by.y, c6 * by.z + c7 * by.y),
        vec4<f32>(c7 * by.z + c8 * by.y, c8 * by.z + c9 * by.y, c9 * by.z, 0.0),
    );
}

// Sets list `list` of the own weights: what each node of the facet weighs if its control points count as Bernstein
// polynomials raised by `by` or, of a flat one, its corners as `corners`.
fn spread(list: u32, by: vec3<f32>, corners: vec3<f32>) {
    if !SMOOTH {
        own_weights[list][0] = vec4<f32>(corners, 0.0);
        return;
    }
    let counts = raised(own.point.weights, by);
    let first = parameters.at_masks + 16u * mesh[parameters.at_shapes + own.facet] * parameters.carriers;
    for (var j = 0u; j < 4u * parameters.carriers; j += 1u) {
        let at = first + 4u * j;
        own_weights[list][j / 4u][j % 4u] = dot(counts[0], surface[at]) + dot(counts[1], surface[at + 1u])
            + dot(counts[2], surface[at + 2u]) + dot(counts[3], surface[at + 3u]);
    }
}

// Makes the row of a proxy node of this radius at x, with the closest point of a facet, which is the current one, and
// the outward direction there.
fn make_row(x: vec3<f32>, radius: f32, facet: u32, point: ClosestPoint, outward: vec3<f32>) {
    let jet = jet_at(point.weights);
    own.x = x;
    own.facet = facet;
    own.point = point;
    own.normal = outward;
    var s = dot(outward, jet.point);
    var inverse_distance = 0.0;
    if point.feature != FEATURE_FACE {
        let away = length(jet.point);
        s = select(-away, away, s >= 0.0);
        inverse_distance = select(-1.0, 1.0, s >= 0.0) / max(away, parameters.least_distance);
        own.normal = select(outward / sqrt(max(dot(outward, outward), LEAST_DIVISOR)), jet.point / s,
            away > parameters.least_distance);
    }
    own.depth = radius + s;
    set_curvature(jet, s, inverse_distance);
    var d = vec3<f32>(0.0);
    var e = vec3<f32>(0.0);
    if point.feature == FEATURE_FACE {
        d = TOWARDS_1;
        e = TOWARDS_2;
    } else if point.feature >= FEATURE_EDGE {
        d = along_edge(point.feature - FEATURE_EDGE);
    }
    spread(0u, point.weights, point.weights);
    spread(1u, 4.0 * d, d);
    spread(2u, 4.0 * e, e);
}

// Sets the places of the own row's nodes.
fn take_places() {
    for (var four = 0u; four < parameters.carriers; four += 1u) {
        own_places[four] = places_of(own.facet, four);
    }
}

// How the displacements of the own row's nodes move its closest point, and the two tangents there.
fn own_moved() -> array<vec3<f32>, 3> {
    var moved = array<vec3<f32>, 3>();
    for (var j = 0u; j < 4u * parameters.carriers; j += 1u) {
        moved[0] += own_weights[0][j / 4u][j % 4u] * own_displacements[j];
        moved[1] += own_weights[1][j / 4u][j % 4u] * own_displacements[j];
        moved[2] += own_weights[2][j / 4u][j % 4u] * own_displacements[j];
    }
    return moved;
}

// The direction in which the own row's proxy node is pushed, by these displacements.
fn own_push() -> vec3<f32> {
    let moved = own_moved();
    let tilting = vec2<f32>(dot(own.normal, moved[1]), dot(own.normal, moved[2]));
    return own.normal + own.bending * moved[0] + own.turning * tilting;
}

// --- Rows of the workgroup ---

// Fours of a row: x and depth; normal; the matrices t and M; weights of the corners and share; force on the proxy node;
// three lists of weights.
const FOURS: u32 = 7u;
const AT_X: u32 = 0u;
const AT_NORMAL: u32 = 1u;
const AT_TURNING: u32 = 2u;
const AT_OFF_DIAGONAL: u32 = 4u;
const AT_CORNERS: u32 = 5u;
const AT_FORCE: u32 = 6u;
const AT_WEIGHTS: u32 = 7u;

var<workgroup> rows: array<vec4<f32>, ROW_FOURS>;
// Proxy node, facet and feature.
var<workgroup> row_names: array<vec3<u32>, ROOM>;

fn at_row(row: u32) -> u32 {
    return row * (FOURS + 3u * parameters.carriers);
}

// Stores the own row, of proxy node `node`, in a place.
fn store_row(row: u32, node: u32) {
    let m = own.bending;
    row_names[row] = vec3<u32>(node, own.facet, own.point.feature);
    rows[at_row(row) + AT_X] = vec4<f32>(own.x, own.depth);
    rows[at_row(row) + AT_NORMAL] = vec4<f32>(own.normal, 0.0);
    rows[at_row(row) + AT_TURNING] = vec4<f32>(own.turning[0], m[0].x);
    rows[at_row(row) + AT_TURNING + 1u] = vec4<f32>(own.turning[1], m[1].y);
    rows[at_row(row) + AT_OFF_DIAGONAL] = vec4<f32>(m[1].z, m[0].z, m[0].y, m[2].z);
    rows[at_row(row) + AT_CORNERS] = vec4<f32>(own.point.weights, share_of(node));
    for (var four = 0u; four < parameters.carriers; four += 1u) {
        rows[at_row(row) + AT_WEIGHTS + four] = own_weights[0][four];
        rows[at_row(row) + AT_WEIGHTS + parameters.carriers + four] = own_weights[1][four];
        rows[at_row(row) + AT_WEIGHTS + 2u * parameters.carriers + four] = own_weights[2][four];
    }
}

fn bending_of(row: u32) -> mat3x3<f32> {
    let off = rows[at_row(row) + AT_OFF_DIAGONAL];
    return mat3x3<f32>(rows[at_row(row) + AT_TURNING].w, off.z, off.y, off.z, rows[at_row(row) + AT_TURNING + 1u].w, off.x,
        off.y, off.x, off.w);
}

// Takes a stored row for the own one.
fn take_row(row: u32) {
    own.x = rows[at_row(row) + AT_X].xyz;
    own.depth = rows[at_row(row) + AT_X].w;
    own.normal = rows[at_row(row) + AT_NORMAL].xyz;
    own.facet = row_names[row].y;
    own.point = ClosestPoint(rows[at_row(row) + AT_CORNERS].xyz, row_names[row].z);
    own.bending = bending_of(row);
    own.turning = mat2x3<f32>(rows[at_row(row) + AT_TURNING].xyz, rows[at_row(row) + AT_TURNING + 1u].xyz);
    for (var four = 0u; four < parameters.carriers; four += 1u) {
        own_weights[0][four] = rows[at_row(row) + AT_WEIGHTS + four];
        own_weights[1][four] = rows[at_row(row) + AT_WEIGHTS + parameters.carriers + four];
        own_weights[2][four] = rows[at_row(row) + AT_WEIGHTS + 2u * parameters.carriers + four];
    }
}

// Depth of the own row by a force of one newton along row `row`: an entry of G C G^T.
fn coupling(row: u32) -> f32 {
    let normal = rows[at_row(row) + AT_NORMAL].xyz;
    var sum = 0.0;
    var moved = vec3<f32>(0.0);
    for (var l = 0u; l < 4u * parameters.carriers; l += 1u) {
        let weight = rows[at_row(row) + AT_WEIGHTS + l / 4u][l % 4u];
        if weight == 0.0 {
            continue;
        }
        let place = places_of(row_names[row].y, l / 4u)[l % 4u];
        for (var four = 0u; four < parameters.carriers; four += 1u) {
            let weights = weight * own_weights[0][four];
            let i = own_places[four];
            if ISOTROPIC {
                sum += dot(weights, scalar_compliances(i, place));
            } else {
                moved += weights.x * (block_of_compliance(i.x, place) * normal);
                moved += weights.y * (block_of_compliance(i.y, place) * normal);
                moved += weights.z * (block_of_compliance(i.z, place) * normal);
                moved += weights.w * (block_of_compliance(i.w, place) * normal);
            }
        }
    }
    return select(dot(own.normal, moved), dot(own.normal, normal) * sum, ISOTROPIC);
}

// Displaces the own row's nodes by a force on the node in `place`.
fn displace(place: u32, force: vec3<f32>) {
    for (var four = 0u; four < parameters.carriers; four += 1u) {
        let i = own_places[four];
        if ISOTROPIC {
            let c = scalar_compliances(i, place);
            own_displacements[4u * four] += c.x * force;
            own_displacements[4u * four + 1u] += c.y * force;
            own_displacements[4u * four + 2u] += c.z * force;
            own_displacements[4u * four + 3u] += c.w * force;
        } else {
            own_displacements[4u * four] += block_of_compliance(i.x, place) * force;
            own_displacements[4u * four + 1u] += block_of_compliance(i.y, place) * force;
            own_displacements[4u * four + 2u] += block_of_compliance(i.z, place) * force;
            own_displacements[4u * four + 3u] += block_of_compliance(i.w, place) * force;
        }
    }
}
