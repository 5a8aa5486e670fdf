//! Depth of a node below one facet of a blended surface, as [`super::blend`] takes the mean of.
//!
//! Near the facet it is the depth s below the facet's plane. But a node outside and far to the facet's side, as a ball's centre
//! beyond a sharp edge, is farther from the facet than from its plane; and one far behind it, across a thin part of the object,
//! is not below it. There the depth tends to minus the distance. With e the squared distance, h = -s the height over the plane,
//! l the lateral distance, `l^2 = e - h^2`, w the blending, k = [`BLEND_LATERAL`], and mu(x) = (1 - k^2 w^2 / x^2)^2 for
//! x > k w, else 0:
//! `p = l mu(l)`,
//! `g = -sqrt(h^2 + p^2)` over the plane, and behind it `g = (|h| - p - p |h| / (p + |h|)) (1 - mu(|h|)) - sqrt(e) mu(|h|)`.
//! So g = s for l, |h| <= k w, and over the plane for all l <= k w; g is `-sqrt(e) (1 + O(w^2 / e))` far off, and never less;
//! it has a continuous first derivative.

use crate::tolerances::{BLEND_LATERAL, MINIMUM_CURVATURE_RADIUS};

/// g and its derivatives in s [m] and e [m^2].
#[derive(Clone, Copy, Debug)]
pub struct FacetDepth {
    /// g [m].
    pub value: f64,
    /// dg/ds [1].
    pub by_plane: f64,
    /// dg/de [1/m].
    pub by_square: f64,
    /// d2g/ds2 [1/m].
    pub by_plane_plane: f64,
    /// d2g/ds de [1/m^2].
    pub by_plane_square: f64,
    /// d2g/de2 [1/m^3].
    pub by_square_square: f64,
}

impl FacetDepth {
    /// The depth s below the plane [m].
    #[must_use]
    pub fn below_plane(depth: f64) -> Self {
        Self {
            value: depth,
            by_plane: 1.0,
            by_square: 0.0,
            by_plane_plane: 0.0,
            by_plane_square: 0.0,
            by_square_square: 0.0,
        }
    }

    /// Depth of a node outside the surface, `depth` below the plane [m] and `square` from the facet [m^2], for the width
    /// `blending` [m].
    #[must_use]
    pub fn outside(depth: f64, square: f64, blending: f64) -> Self {
        let beside = Self::beside(depth, square, blending);
        let z = (BLEND_LATERAL * blending / depth).powi(2);
        if depth <= 0.0 || z >= 1.0 {
            return beside;
        }
        let distance = square.sqrt();
        let (mu, mu_1) = ((1.0 - z) * (1.0 - z), 4.0 * z * (1.0 - z) / depth);
        let mu_2 = 4.0 * z * (5.0 * z - 3.0) / (depth * depth);
        Self {
            value: beside.value * (1.0 - mu) - distance * mu,
            by_plane: beside.by_plane * (1.0 - mu) - (beside.value + distance) * mu_1,
            by_square: beside.by_square * (1.0 - mu) - mu / (2.0 * distance),
            by_plane_plane: beside.by_plane_plane * (1.0 - mu)
                - 2.0 * beside.by_plane * mu_1
                - (beside.value + distance) * mu_2,
            by_plane_square: beside.by_plane_square * (1.0 - mu) - (beside.by_square + 0.5 / distance) * mu_1,
            by_square_square: beside.by_square_square * (1.0 - mu) + mu / (4.0 * square * distance),
        }
    }

    /// The same but for what is far behind the plane.
    fn beside(depth: f64, square: f64, blending: f64) -> Self {
        let height = -depth;
        let lateral_square = square - height * height;
        let flat = BLEND_LATERAL * BLEND_LATERAL * blending * blending;
        if lateral_square <= flat {
            return Self::below_plane(depth);
        }
        // p and its derivatives in l^2.
        let lateral = lateral_square.sqrt();
        let z = flat / lateral_square;
        let p = lateral * (1.0 - z) * (1.0 - z);
        let slope = (1.0 - z) * (1.0 + 3.0 * z);
        let p_1 = slope / (2.0 * lateral);
        let p_2 = -(z * (1.0 - 3.0 * z) + 0.25 * slope) / (lateral_square * lateral);
        // p's derivatives in s and e.
        let (p_s, p_e) = (2.0 * height * p_1, p_1);
        let (p_ss, p_se, p_ee) = (4.0 * height * height * p_2 - 2.0 * p_1, 2.0 * height * p_2, p_2);
        // g and its derivatives in h and p.
        let (value, g_h, g_p, g_hh, g_hp, g_pp);
        if height >= 0.0 {
            let distance = height.hypot(p).max(MINIMUM_CURVATURE_RADIUS);
            let cube = distance * distance * distance;
            value = -distance;
            (g_h, g_p) = (-height / distance, -p / distance);
            (g_hh, g_hp, g_pp) = (-p * p / cube, height * p / cube, -height * height / cube);
        } else {
            let below = -height;
            let sum = (p + below).max(MINIMUM_CURVATURE_RADIUS);
            let (share, rest) = (p / sum, below / sum);
            value = below - p - p * rest;
            (g_h, g_p) = (share * share - 1.0, -1.0 - rest * rest);
            (g_hh, g_hp, g_pp) = (2.0 * share * share / sum, 2.0 * share * rest / sum, 2.0 * rest * rest / sum);
        }
        Self {
            value,
            by_plane: g_p * p_s - g_h,
            by_square: g_p * p_e,
            by_plane_plane: g_hh - 2.0 * g_hp * p_s + g_pp * p_s * p_s + g_p * p_ss,
            by_plane_square: (g_pp * p_s - g_hp) * p_e + g_p * p_se,
            by_square_square: g_pp * p_e * p_e + g_p * p_ee,
        }
    }

    /// Change of dg/ds, and of dg/de, by a change of s and one of e.
    #[must_use]
    pub fn slope_changes(&self, plane: f64, square: f64) -> [f64; 2] {
        [
            self.by_plane_plane * plane + self.by_plane_square * square,
            self.by_plane_square * plane + self.by_square_square * square,
        ]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const WIDTH: f64 = 0.01;

    /// Places (height over the plane, lateral distance) on both sides of the plane and of where facets count as flat.
    fn places() -> impl Iterator<Item = (f64, f64)> {
        (-40..=40).flat_map(|i| (0..40).map(move |j| (0.0013 * f64::from(i) + 1e-4, 0.0011 * f64::from(j) + 1e-4)))
    }

    fn at(height: f64, lateral: f64) -> FacetDepth {
        FacetDepth::outside(-height, height * height + lateral * lateral, WIDTH)
    }

    #[test]
    fn derivatives_agree_with_finite_differences() {
        let mut bent = [0; 2];
        for (height, lateral) in places() {
            let (s, e) = (-height, height * height + lateral * lateral);
            let here = FacetDepth::outside(s, e, WIDTH);
            let (hs, he) = (1e-7, 1e-9);
            let along = |ds: f64, de: f64| FacetDepth::outside(s + ds, e + de, WIDTH);
            let (up, down, out, back) = (along(hs, 0.0), along(-hs, 0.0), along(0.0, he), along(0.0, -he));
            let close = |found: f64, expected: f64, scale: f64| {
                assert!(
                    (found - expected).abs() < 1e-4 * (scale + expected.abs()),
                    "{found} {expected} at {height} {lateral}"
                );
            };
            close((up.value - down.value) / (2.0 * hs), here.by_plane, 1.0);
            close((out.value - back.value) / (2.0 * he), here.by_square, 1.0 / WIDTH);
            close((up.by_plane - down.by_plane) / (2.0 * hs), here.by_plane_plane, 1.0 / WIDTH);
            close((up.by_square - down.by_square) / (2.0 * hs), here.by_plane_square, 1.0 / WIDTH.powi(2));
            close((out.by_square - back.by_square) / (2.0 * he), here.by_square_square, 1.0 / WIDTH.powi(3));
            bent[usize::from(height < 0.0)] += usize::from(here.by_square != 0.0);
        }
        assert!(bent.iter().all(|&count| count > 100), "{bent:?}");
    }

    #[test]
    fn it_is_the_depth_below_the_plane_near_the_facet_and_minus_the_distance_far_from_it() {
        let rim = BLEND_LATERAL * WIDTH;
        for (height, lateral) in places() {
            let found = at(height, lateral).value;
            let distance = height.hypot(lateral);
            assert!(found >= -distance * (1.0 + 1e-12), "{found} {distance}");
            if lateral <= rim && height >= -rim {
                assert!((found + height).abs() < 1e-12, "{found} {height}");
            } else if height >= 0.0 || lateral <= rim {
                assert!(found + distance <= 8.0 * rim * rim / distance, "{found} at {distance}");
            }
        }
    }

    #[test]
    fn slopes_pass_over_the_borders_without_a_step() {
        let rim = BLEND_LATERAL * WIDTH;
        for k in 1..60 {
            let along = 0.001 * f64::from(k);
            let step = 1e-9;
            for (one, other) in [
                (at(along, rim - step), at(along, rim + step)),
                (at(-along, rim - step), at(-along, rim + step)),
                (at(-step, rim + along), at(step, rim + along)),
                (at(-rim - step, along), at(-rim + step, along)),
            ] {
                assert!((one.value - other.value).abs() < 1e-8);
                assert!((one.by_plane - other.by_plane).abs() < 1e-4, "{} {}", one.by_plane, other.by_plane);
                assert!((one.by_square - other.by_square).abs() < 1e-4 / WIDTH);
            }
        }
    }
}
