//! The rounded surface: depth and rows of the surface at rest, blended over a length.
//!
//! Where the nearest side of a thick body changes, depth is continuous and its direction is not, and neither is the
//! stored energy. On a lattice of spacing H stand at each point x_l, p_l being the closest point of the surface at rest
//! and n_l the outward normal there, the depth `d_l = n_l . (p_l - x_l)` and the row `G_l = n_l (x) w_l`, w_l the weights
//! of the object's nodes in p_l. In between both are sums over cubic B-splines,
//!
//! `D(x) = sum_l B_l(x) d'_l`, `g(x) = sum_l B_l(x) G'_l`, `f'_l = f_l - chi_l lap f_l / 6`,
//!
//! lap f_l being the sum of what the six neighbours exceed f_l by: so the sums are exact to the fourth order in H where
//! the surface is smooth (C. de Boor, A practical guide to splines, 1978, quasi-interpolants), and are twice continuously
//! differentiable everywhere. At ridges of the depth, where the correction would overshoot, it fades by
//! `chi_l = clamp(2 - 2 |lap d_l| / H, 0, 1)`: there the sides blend over some 2 H.

use super::depth::{Carriers, measure};
use crate::contact::geometry::RestSurface;
use crate::contact::linear::condensed::NodeRow;
use glam::{DMat3, DVec3};
use rayon::prelude::*;

/// How far the blended depth is from the distance to the surface at most, over H (1): distances change by no more than
/// places move, the root mean square of a cubic B-spline is 3^(-1/2) H along each axis, and the correction is at most
/// chi |lap d| / 6 = H / 12.
const BLUR: f64 = 1.0 + 1.0 / 12.0;

/// Greatest size of a row, over that of a row of the surface at rest (1): the sum of the sizes of f'_l's coefficients, 1
/// + chi and six times chi / 6.
pub const MOST_SIZE: f64 = 3.0;

/// Spacings of the lattice around the body's box and the arm's greatest radius (1): beyond them no place is below the
/// rounded surface, and each place within has all 64 points of its blend.
const MARGIN: f64 = 4.0;

/// Depth and rows on the lattice.
pub struct Rounded {
    spacing: f64,
    /// Its low corner, relative to the surface's centre (m).
    low: DVec3,
    /// Points along each axis; the last axis is the fastest.
    counts: [usize; 3],
    /// d' (m).
    depths: Vec<f64>,
    /// G: the object's nodes, and by how much each deepens along its displacement (1).
    pub rows: Vec<NodeRow>,
    /// chi (1).
    corrected: Vec<f64>,
}

/// Where a place lies among the points of the lattice.
#[derive(Clone, Copy, Debug)]
pub struct Blend {
    /// The lowest of the 64 points.
    first: [usize; 3],
    /// The factors of B along each axis, their first (1/m) and second derivatives (1/m^2).
    values: [[f64; 4]; 3],
    slopes: [[f64; 4]; 3],
    bends: [[f64; 4]; 3],
}

impl Rounded {
    /// Points of the lattice of `spacing` around `surface` for nodes of at most `radius` (m).
    #[must_use]
    pub fn points(surface: &RestSurface, spacing: f64, radius: f64) -> [usize; 3] {
        let margin = radius + MARGIN * spacing;
        let half = surface.positions.iter().fold(DVec3::ZERO, |half, position| half.max(position.abs()));
        ((half + margin) * (2.0 / spacing)).to_array().map(|count| count.ceil() as usize + 1)
    }

    /// Rounds `surface` over `spacing` for nodes of at most `radius` (m).
    #[must_use]
    pub fn new(surface: &RestSurface, spacing: f64, radius: f64) -> Self {
        let counts = Self::points(surface, spacing, radius);
        let low = DVec3::from_array(counts.map(|count| (count - 1) as f64)) * (-0.5 * spacing);
        let all = counts.iter().product();
        let sharp: Vec<(f64, NodeRow)> =
            (0..all).into_par_iter().map(|l| sharp_row(surface, low + spacing * place(l, counts))).collect();
        let strides = [counts[1] * counts[2], counts[2], 1];
        let corrected = |l: usize| {
            let (depth, index) = (sharp[l].0, indices(l, counts));
            if (0..3).any(|a| index[a] == 0 || index[a] + 1 == counts[a]) {
                return (depth, 0.0);
            }
            let around = strides.iter().flat_map(|stride| [l - stride, l + stride]);
            let bend: f64 = around.map(|other| sharp[other].0 - depth).sum();
            let chi = (2.0 - 2.0 * bend.abs() / spacing).clamp(0.0, 1.0);
            (depth - chi * bend / 6.0, chi)
        };
        let (depths, corrected) = (0..all).map(corrected).unzip();
        let rows = sharp.into_iter().map(|(_, row)| row).collect();
        Self { spacing, low, counts, depths, rows, corrected }
    }

    /// G'_l as a sum of G: its points, and how much of each (1).
    pub fn sources(&self, l: u32) -> impl Iterator<Item = (u32, f64)> + Clone {
        let (chi, [_, m, n]) = (self.corrected[l as usize], self.counts.map(|count| count as u32));
        let around = [m * n, n, 1].into_iter().flat_map(move |stride| [l.wrapping_sub(stride), l.wrapping_add(stride)]);
        let around = around.filter(move |_| chi > 0.0).map(move |other| (other, -chi / 6.0));
        std::iter::once((l, 1.0 + chi)).chain(around)
    }

    /// G'_l: the object's nodes, some more than once, and by how much each deepens along its displacement (1).
    pub fn row(&self, l: u32) -> impl Iterator<Item = (u32, DVec3)> {
        let scaled =
            |(m, factor): (u32, f64)| self.rows[m as usize].iter().map(move |(node, weight)| (*node, *weight * factor));
        self.sources(l).flat_map(scaled)
    }

    /// How far the blended depth is from the distance to the surface at most (m).
    #[must_use]
    pub fn blur(&self) -> f64 {
        BLUR * self.spacing
    }

    /// Number of points.
    #[must_use]
    pub fn count(&self) -> usize {
        self.depths.len()
    }

    /// Which points weigh in the depth of places that may be below the rounded surface less `radius` (m).
    #[must_use]
    pub fn near(&self, radius: f64) -> Vec<bool> {
        let mut near = vec![false; self.count()];
        // A blend is no deeper than its deepest point.
        let [m, n] = [1, 2].map(|a| self.counts[a]);
        let within = |index: usize, count: usize| index.saturating_sub(3)..(index + 4).min(count);
        for l in (0..self.count()).filter(|&l| self.depths[l] > -radius) {
            let [i, j, k] = indices(l, self.counts);
            for (i, j) in within(i, self.counts[0]).flat_map(|i| within(j, m).map(move |j| (i, j))) {
                near[(i * m + j) * n..][within(k, n)].fill(true);
            }
        }
        near
    }

    /// Notes in `marked` which points weigh in the depths of places within `radius` of `x` (m).
    pub fn mark(&self, x: DVec3, radius: f64, marked: &mut [bool]) {
        let [low, high] = [-radius, radius].map(|way| ((x + way - self.low) / self.spacing).to_array());
        let range = |a: usize| {
            let end = |place: f64| place.clamp(0.0, self.counts[a] as f64) as usize;
            end(low[a] - 1.0)..end(high[a] + 3.0)
        };
        for (i, j) in range(0).flat_map(|i| range(1).map(move |j| (i, j))) {
            marked[(i * self.counts[1] + j) * self.counts[2]..][range(2)].fill(true);
        }
    }

    /// The object's nodes on which the points `marked` hang, ascending.
    #[must_use]
    pub fn nodes(&self, marked: &[bool]) -> Vec<u32> {
        let marked = (0..).zip(marked).filter(|(_, marked)| **marked);
        let mut nodes: Vec<u32> = marked.flat_map(|(l, _)| self.row(l).map(|(node, _)| node)).collect();
        nodes.sort_unstable();
        nodes.dedup();
        nodes
    }

    /// D at `x`, relative to the surface's centre; none beyond the lattice, where nothing is below the surface (m).
    #[must_use]
    pub fn depth(&self, x: DVec3) -> Option<f64> {
        let blend = self.blend(x)?;
        Some(self.values(&blend).map(|(l, value)| value * self.depths[l as usize]).sum())
    }

    /// d' at point `l` where the object's nodes are displaced by `u` (m).
    pub fn displaced(&self, l: u32, u: impl Fn(u32) -> DVec3) -> f64 {
        self.depths[l as usize] + self.row(l).map(|(node, weight)| weight.dot(u(node))).sum::<f64>()
    }

    /// Returns the second derivative of the depth in the place of `blend`, where points are `depth` deep (1/m).
    pub fn bend(&self, blend: &Blend, mut depth: impl FnMut(u32) -> f64) -> DMat3 {
        let Blend { values: v, slopes: s, bends: b, .. } = *blend;
        // xx, yy, zz, yz, xz, xy.
        let factors = [
            [b[0], v[1], v[2]],
            [v[0], b[1], v[2]],
            [v[0], v[1], b[2]],
            [v[0], s[1], s[2]],
            [s[0], v[1], s[2]],
            [s[0], s[1], v[2]],
        ];
        let mut sums = [0.0; 6];
        for (l, bends) in self.taps(blend, factors) {
            let depth = depth(l);
            sums.iter_mut().zip(bends).for_each(|(sum, bend)| *sum += bend * depth);
        }
        let [xx, yy, zz, yz, xz, xy] = sums;
        DMat3::from_cols_array(&[xx, xy, xz, xy, yy, yz, xz, yz, zz])
    }

    /// How the place `x` lies among the points; none beyond the lattice.
    #[must_use]
    pub fn blend(&self, x: DVec3) -> Option<Blend> {
        let place = (x - self.low) / self.spacing;
        let mut blend = Blend { first: [0; 3], values: [[0.0; 4]; 3], slopes: [[0.0; 4]; 3], bends: [[0.0; 4]; 3] };
        for (a, &place) in place.to_array().iter().enumerate() {
            if !(place >= 1.0 && place < (self.counts[a] - 2) as f64) {
                return None;
            }
            let (t, s, h) = (place.fract(), 1.0 - place.fract(), self.spacing);
            blend.first[a] = place as usize - 1;
            let middle = |t: f64| (3.0 * t - 6.0) * t * t + 4.0;
            blend.values[a] = [s * s * s, middle(t), middle(s), t * t * t].map(|value| value / 6.0);
            let middle = |t: f64| (3.0 * t - 4.0) * t;
            blend.slopes[a] = [-s * s, middle(t), -middle(s), t * t].map(|slope| slope / (2.0 * h));
            blend.bends[a] = [s, 3.0 * t - 2.0, 3.0 * s - 2.0, t].map(|bend| bend / (h * h));
        }
        Some(blend)
    }

    /// The 64 points of `blend`, with the values of B there (1).
    pub fn values(&self, blend: &Blend) -> impl Iterator<Item = (u32, f64)> {
        self.taps(blend, [blend.values]).map(|(l, [value])| (l, value))
    }

    /// The gradients of B at the 64 points of `blend` (1/m).
    pub fn slopes(&self, blend: &Blend) -> impl Iterator<Item = (u32, DVec3)> {
        let Blend { values: v, slopes: s, .. } = *blend;
        let factors = [[s[0], v[1], v[2]], [v[0], s[1], v[2]], [v[0], v[1], s[2]]];
        self.taps(blend, factors).map(|(l, slopes)| (l, DVec3::from_array(slopes)))
    }

    /// The 64 points of `blend`, with products of `factors` along the axes.
    fn taps<const N: usize>(
        &self,
        blend: &Blend,
        factors: [[[f64; 4]; 3]; N],
    ) -> impl Iterator<Item = (u32, [f64; N])> {
        let (first, [_, m, n]) = (blend.first, self.counts);
        (0..64).map(move |tap| {
            let [i, j, k] = [tap >> 4, tap >> 2 & 3, tap & 3];
            let l = ((first[0] + i) * m + first[1] + j) * n + first[2] + k;
            (l as u32, factors.map(|[x, y, z]| x[i] * y[j] * z[k]))
        })
    }
}

/// Depth of `x` below the surface at rest, and its row.
fn sharp_row(surface: &RestSurface, x: DVec3) -> (f64, NodeRow) {
    let closest = surface.closest(x, u32::MAX);
    let facet = surface.facet_at_rest(closest.triangle);
    let pseudonormal = surface.pseudonormal_at_rest(closest.triangle, &closest.point);
    let (normal, depth, _) = measure(x, 0.0, facet, &closest.point, pseudonormal);
    let carriers = Carriers::new(surface.carriers(closest.triangle), &closest.point);
    (
        depth,
        carriers.iter().filter(|(_, weight)| *weight != 0.0).map(|(node, weight)| (node, normal * weight)).collect(),
    )
}

/// The numbers of point `l` along the axes.
fn indices(l: usize, [_, m, n]: [usize; 3]) -> [usize; 3] {
    [l / (m * n), l / n % m, l % n]
}

/// Its place, in spacings from the low corner.
fn place(l: usize, counts: [usize; 3]) -> DVec3 {
    DVec3::from_array(indices(l, counts).map(|index| index as f64))
}
