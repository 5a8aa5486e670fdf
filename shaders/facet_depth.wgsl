// Depth of a node below one facet of a blended surface (twin, with the formulas: src/contact/facet_depth.rs).

struct FacetDepth {
    // g [m].
    value: f32,
    // dg/ds, dg/de and their derivatives, e the squared distance.
    by_plane: f32,
    by_square: f32,
    by_plane_plane: f32,
    by_plane_square: f32,
    by_square_square: f32,
}

// The depth s below the plane.
fn below_plane(depth: f32) -> FacetDepth {
    return FacetDepth(depth, 1.0, 0.0, 0.0, 0.0, 0.0);
}

// Depth of a node outside the surface, `depth` below the plane, and by the offset whose square is `square` from the facet;
// that offset's part along the plane, squared, is given as well, because in f32 it is no good as a difference.
fn outside_facet(depth: f32, square: f32, lateral_square: f32) -> FacetDepth {
    let beside = beside_facet(depth, lateral_square);
    let rim = BLEND_LATERAL * parameters.blending;
    if depth <= rim {
        return beside;
    }
    let z = rim * rim / (depth * depth);
    let distance = sqrt(square);
    let mu = (1.0 - z) * (1.0 - z);
    let mu_1 = 4.0 * z * (1.0 - z) / depth;
    let mu_2 = 4.0 * z * (5.0 * z - 3.0) / (depth * depth);
    return FacetDepth(
        beside.value * (1.0 - mu) - distance * mu,
        beside.by_plane * (1.0 - mu) - (beside.value + distance) * mu_1,
        beside.by_square * (1.0 - mu) - mu / (2.0 * distance),
        beside.by_plane_plane * (1.0 - mu) - 2.0 * beside.by_plane * mu_1 - (beside.value + distance) * mu_2,
        beside.by_plane_square * (1.0 - mu) - (beside.by_square + 0.5 / distance) * mu_1,
        beside.by_square_square * (1.0 - mu) + mu / (4.0 * square * distance),
    );
}

// The same but for what is far behind the plane.
fn beside_facet(depth: f32, lateral_square: f32) -> FacetDepth {
    let height = -depth;
    let rim = BLEND_LATERAL * parameters.blending;
    let flat = rim * rim;
    if lateral_square <= flat {
        return below_plane(depth);
    }
    // p and its derivatives in l^2.
    let lateral = sqrt(lateral_square);
    let z = flat / lateral_square;
    let p = lateral * (1.0 - z) * (1.0 - z);
    let slope = (1.0 - z) * (1.0 + 3.0 * z);
    let p_1 = slope / (2.0 * lateral);
    let p_2 = -(z * (1.0 - 3.0 * z) + 0.25 * slope) / (lateral_square * lateral);
    // p's derivatives in s and e.
    let p_s = 2.0 * height * p_1;
    let p_ss = 4.0 * height * height * p_2 - 2.0 * p_1;
    let p_se = 2.0 * height * p_2;
    // g and its derivatives in h and p.
    var value: f32;
    var g_h: f32;
    var g_p: f32;
    var g_hh: f32;
    var g_hp: f32;
    var g_pp: f32;
    if height >= 0.0 {
        let distance = max(sqrt(height * height + p * p), parameters.least_distance);
        let cube = distance * distance * distance;
        value = -distance;
        g_h = -height / distance;
        g_p = -p / distance;
        g_hh = -p * p / cube;
        g_hp = height * p / cube;
        g_pp = -height * height / cube;
    } else {
        let sum = max(p + depth, parameters.least_distance);
        let share = p / sum;
        let rest_share = depth / sum;
        value = depth - p - p * rest_share;
        g_h = share * share - 1.0;
        g_p = -1.0 - rest_share * rest_share;
        g_hh = 2.0 * share * share / sum;
        g_hp = 2.0 * share * rest_share / sum;
        g_pp = 2.0 * rest_share * rest_share / sum;
    }
    return FacetDepth(
        value,
        g_p * p_s - g_h,
        g_p * p_1,
        g_hh - 2.0 * g_hp * p_s + g_pp * p_s * p_s + g_p * p_ss,
        (g_pp * p_s - g_hp) * p_1 + g_p * p_se,
        g_pp * p_1 * p_1 + g_p * p_2,
    );
}
