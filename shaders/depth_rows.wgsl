// Depth of a proxy node below the displaced surface, with its derivatives in the object's nodes: a row of the contact
// problem (twin, with the formulas: src/contact/law/depth.rs).

// The inverse of a symmetric matrix of two rows, its entries 00, 01, 11.
fn inverse_of(m: vec3<real>) -> vec3<real> {
    return vec3<real>(m.z, -m.y, m.x) / max(m.x * m.z - m.y * m.y, LEAST_DIVISOR);
}

// The product A B C of symmetric matrices of two rows where that is symmetric.
fn symmetric_product(a: vec3<real>, b: vec3<real>, c: vec3<real>) -> vec3<real> {
    let first = vec2<real>(a.x * b.x + a.y * b.y, a.x * b.y + a.y * b.z);
    let second = vec2<real>(a.y * b.x + a.z * b.y, a.y * b.y + a.z * b.z);
    return vec3<real>(dot(first, c.xy), dot(first, c.yz), dot(second, c.yz));
}

// Writes what depends on the directions in which a point may move on its feature.
fn write_curvature(at: u32, jet: Jet, feature: u32, normal: vec3<real>, s: real) {
    var along = vec3<real>(0.0);
    var tangent_0 = vec3<real>(0.0);
    var tangent_1 = vec3<real>(0.0);
    var bending = vec3<real>(0.0);
    var turning = vec3<real>(0.0);
    if feature == FEATURE_FACE {
        let d = TOWARDS_1;
        let e = TOWARDS_2;
        tangent_0 = tangent(jet, d);
        tangent_1 = tangent(jet, e);
        let metric = vec3<real>(dot(tangent_0, tangent_0), dot(tangent_0, tangent_1), dot(tangent_1, tangent_1));
        let inverse = inverse_of(metric);
        turning = inverse;
        if SMOOTH {
            let bends =
                vec3<real>(dot(normal, bend(jet, d, d)), dot(normal, bend(jet, d, e)), dot(normal, bend(jet, e, e)));
            let full = metric + s * bends;
            let area = metric.x * metric.z - metric.y * metric.y;
            if full.x > 0.0 && full.x * full.z - full.y * full.y > LEAST_CONVEXITY * area {
                turning = inverse_of(full);
                bending = symmetric_product(inverse, bends, turning);
            }
        }
    } else if feature >= FEATURE_EDGE {
        let d = along_edge(feature - FEATURE_EDGE);
        tangent_0 = tangent(jet, d);
        let metric = max(dot(tangent_0, tangent_0), LEAST_DIVISOR);
        along = tangent_0 / sqrt(metric);
        turning.x = 1.0 / metric;
        let bent = dot(normal, bend(jet, d, d));
        let full = metric + s * bent;
        if full > LEAST_CONVEXITY * metric {
            turning.x = 1.0 / full;
            bending.x = bent / (metric * full);
        }
    }
    set_vector(at + ALONG, along);
    set_vector(at + TANGENT_0, tangent_0);
    set_vector(at + TANGENT_1, tangent_1);
    set_vector(at + BENDING, bending);
    set_vector(at + TURNING, turning);
}

// Bernstein polynomials of degree four at weights w, or their derivative along d: cubics at w, raised by `by`, which is
// w or 4 d.
fn raised(w: vec3<real>, by: vec3<real>) -> array<real, 15> {
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
    return array<real, 15>(
        c0 * by.x,
        c0 * by.y + c1 * by.x,
        c0 * by.z + c2 * by.x,
        c1 * by.y + c3 * by.x,
        c1 * by.z + c2 * by.y + c4 * by.x,
        c2 * by.z + c5 * by.x,
        c3 * by.y + c6 * by.x,
        c3 * by.z + c4 * by.y + c7 * by.x,
        c4 * by.z + c5 * by.y + c8 * by.x,
        c5 * by.z + c9 * by.x,
        c6 * by.y,
        c6 * by.z + c7 * by.y,
        c7 * by.z + c8 * by.y,
        c8 * by.z + c9 * by.y,
        c9 * by.z,
    );
}

// Writes three numbers for each node of a facet: what it weighs if its control points count as `counts`, or of a flat
// one its corners as `corners`.
fn spread(at: u32, facet: u32, counts: array<array<real, 15>, 3>, corners: array<vec3<real>, 3>) {
    var shape = REGULAR;
    if SMOOTH {
        shape = shape_of(facet);
    }
    for (var j = 0u; j < parameters.carriers; j += 1u) {
        var weights = vec3<real>(dot(corners[0], one_hot(j)), dot(corners[1], one_hot(j)), dot(corners[2], one_hot(j)));
        if SMOOTH {
            let m = at_mask(shape, j);
            let m_0 = surface[m];
            let m_1 = surface[m + 1u];
            let m_2 = surface[m + 2u];
            let m_3 = surface[m + 3u];
            weights = vec3<real>(0.0);
            weights += m_0.x * vec3<real>(counts[0][0], counts[1][0], counts[2][0]);
            weights += m_0.y * vec3<real>(counts[0][1], counts[1][1], counts[2][1]);
            weights += m_0.z * vec3<real>(counts[0][2], counts[1][2], counts[2][2]);
            weights += m_0.w * vec3<real>(counts[0][3], counts[1][3], counts[2][3]);
            weights += m_1.x * vec3<real>(counts[0][4], counts[1][4], counts[2][4]);
            weights += m_1.y * vec3<real>(counts[0][5], counts[1][5], counts[2][5]);
            weights += m_1.z * vec3<real>(counts[0][6], counts[1][6], counts[2][6]);
            weights += m_1.w * vec3<real>(counts[0][7], counts[1][7], counts[2][7]);
            weights += m_2.x * vec3<real>(counts[0][8], counts[1][8], counts[2][8]);
            weights += m_2.y * vec3<real>(counts[0][9], counts[1][9], counts[2][9]);
            weights += m_2.z * vec3<real>(counts[0][10], counts[1][10], counts[2][10]);
            weights += m_2.w * vec3<real>(counts[0][11], counts[1][11], counts[2][11]);
            weights += m_3.x * vec3<real>(counts[0][12], counts[1][12], counts[2][12]);
            weights += m_3.y * vec3<real>(counts[0][13], counts[1][13], counts[2][13]);
            weights += m_3.z * vec3<real>(counts[0][14], counts[1][14], counts[2][14]);
        }
        set_scalar(at + j, weights.x);
        set_scalar(at + parameters.carriers + j, weights.y);
        set_scalar(at + 2u * parameters.carriers + j, weights.z);
    }
}

// Writes row `row` of the list `half`: proxy node `node`, with the closest point of facet `facet`, the jet and the outward
// direction there.
fn write_row(half: u32, row: u32, node: u32, facet: u32, point: ClosestPoint, jet: Jet, outward: vec3<real>) {
    var normal = outward;
    var s = dot(outward, jet.point);
    var inverse_distance = real(0.0);
    if point.feature != FEATURE_FACE {
        let away = length(jet.point);
        s = select(-away, away, dot(jet.point, outward) >= 0.0);
        inverse_distance = select(real(-1.0), real(1.0), s >= 0.0) / max(away, parameters.least_distance);
        normal = select(outward / sqrt(max(dot(outward, outward), LEAST_DIVISOR)), jet.point / s,
            away > parameters.least_distance);
    }
    let at = at_numbers(half, row);
    set_vector(at + NORMAL, normal);
    set_scalar(at + DEPTH, proxy_radius(node) + s);
    set_scalar(at + SHARE, proxy_share(node));
    set_scalar(at + DISTANCE, s);
    set_scalar(at + INVERSE_DISTANCE, inverse_distance);
    set_vector(at + CORNERS, point.weights);
    write_curvature(at, jet, point.feature, normal, s);
    let words_at = at_row(half, row);
    var nodes = 0u;
    for (var j = 0u; j < parameters.carriers; j += 1u) {
        let place = carrier(facet, j);
        // A place behind the last is any, and carries nothing.
        set_word(words_at + ROW_WORDS + j, select(place, 0u, place == ABSENT));
        nodes += select(1u, 0u, place == ABSENT);
    }
    set_word(words_at, node);
    set_word(words_at + 1u, facet);
    set_word(words_at + 2u, point.feature);
    set_word(words_at + 3u, nodes);
    var d = vec3<real>(0.0);
    var e = vec3<real>(0.0);
    if point.feature == FEATURE_FACE {
        d = TOWARDS_1;
        e = TOWARDS_2;
    } else if point.feature >= FEATURE_EDGE {
        d = along_edge(point.feature - FEATURE_EDGE);
    }
    let w = point.weights;
    spread(at + NODE_WEIGHTS, facet, array<array<real, 15>, 3>(raised(w, w), raised(w, 4.0 * d), raised(w, 4.0 * e)),
        array<vec3<real>, 3>(w, d, e));
}
