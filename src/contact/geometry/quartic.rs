//! Triangles of degree four in Bernstein form.
//!
//! `p(w) = sum_ijk B_ijk(w) b_ijk`, i + j + k = n, `B_ijk(w) = n! / (i! j! k!) w_0^i w_1^j w_2^k`. Control points of
//! every degree are in one order: by j + k, then by k. So that of b_ijk does not depend on i, and one step of de
//! Casteljau's algorithm runs along the lists.

use glam::DVec3;
use std::ops::{Add, Mul};

/// Control points of a triangle of degree four.
pub const CONTROLS: usize = 15;

/// Those of degrees one to three.
const LINES: usize = 3;
const QUADRATICS: usize = 6;
const CUBICS: usize = 10;

/// The place of the control point that belongs to these exponents of the weights.
#[must_use]
pub const fn place([_, j, k]: [usize; 3]) -> usize {
    let row = j + k;
    row * (row + 1) / 2 + k
}

/// The exponents of the weights that belong to each control point.
pub const EXPONENTS: [[usize; 3]; CONTROLS] = {
    let mut all = [[0; 3]; CONTROLS];
    let mut row = 0;
    while row <= 4 {
        let mut k = 0;
        while k <= row {
            all[row * (row + 1) / 2 + k] = [4 - row, row - k, k];
            k += 1;
        }
        row += 1;
    }
    all
};

/// One step of de Casteljau's algorithm: the net of degree n - 1 that `net` of degree n becomes at weights `w`.
#[inline(always)]
fn lower<T: Copy + Add<Output = T> + Mul<f64, Output = T>, const N: usize, const M: usize>(
    net: &[T; N],
    w: [f64; 3],
) -> [T; M] {
    let mut lowered = [net[0]; M];
    let (mut row, mut end) = (0, 1);
    for (at, lowered) in lowered.iter_mut().enumerate() {
        if at == end {
            row += 1;
            end += row + 1;
        }
        *lowered = net[at] * w[0] + net[at + row + 1] * w[1] + net[at + row + 2] * w[2];
    }
    lowered
}

/// The transpose of [`lower`]: what each control point of degree n counts, if those of degree n - 1 count `basis`.
#[inline(always)]
fn raise<const M: usize, const N: usize>(basis: &[f64; M], w: [f64; 3]) -> [f64; N] {
    let mut raised = [0.0; N];
    let (mut row, mut end) = (0, 1);
    for (at, &count) in basis.iter().enumerate() {
        if at == end {
            row += 1;
            end += row + 1;
        }
        raised[at] += count * w[0];
        raised[at + row + 1] += count * w[1];
        raised[at + row + 2] += count * w[2];
    }
    raised
}

/// The Bernstein polynomials of degree four at weights `w` (1).
#[inline]
#[must_use]
pub fn basis(w: [f64; 3]) -> [f64; CONTROLS] {
    raise(&cubics(w), w)
}

/// Their derivative at `w` along `d` (1).
#[inline]
#[must_use]
pub fn basis_slopes(w: [f64; 3], d: [f64; 3]) -> [f64; CONTROLS] {
    raise(&cubics(w), d.map(|change| 4.0 * change))
}

#[inline(always)]
fn cubics(w: [f64; 3]) -> [f64; CUBICS] {
    let quadratics: [f64; QUADRATICS] = raise(&w, w);
    raise(&quadratics, w)
}

/// A point of a surface and its derivatives there.
#[derive(Clone, Copy, Debug)]
pub struct Jet {
    /// The point (m).
    pub point: DVec3,
    /// Its derivative by each weight, the others held (m).
    slopes: [DVec3; LINES],
    /// Its second derivatives by weights 00, 01, 02, 11, 12 and 22 (m).
    bends: [DVec3; QUADRATICS],
}

impl Jet {
    /// That of the triangle with this control net at `w`.
    #[inline]
    #[must_use]
    pub fn new(net: &[DVec3; CONTROLS], w: [f64; 3]) -> Self {
        let cubic: [DVec3; CUBICS] = lower(net, w);
        let quadratic: [DVec3; QUADRATICS] = lower(&cubic, w);
        let linear: [DVec3; LINES] = lower(&quadratic, w);
        let [point] = lower(&linear, w);
        Self { point, slopes: linear.map(|b| b * 4.0), bends: quadratic.map(|b| b * 12.0) }
    }

    /// That of the flat triangle with these corners.
    #[inline]
    #[must_use]
    pub fn flat(corners: &[DVec3; 3], w: [f64; 3]) -> Self {
        let [point] = lower(corners, w);
        Self { point, slopes: *corners, bends: [DVec3::ZERO; QUADRATICS] }
    }

    /// The derivatives along the two directions in which a point moves over a face, towards corners 1 and 2 (m).
    #[inline]
    #[must_use]
    pub fn face_tangents(&self) -> [DVec3; 2] {
        let [from, first, second] = self.slopes;
        [first - from, second - from]
    }

    /// The second derivatives along those: of the first, of both and of the second (m).
    #[inline]
    #[must_use]
    pub fn face_bends(&self) -> [DVec3; 3] {
        let [b00, b01, b02, b11, b12, b22] = self.bends;
        let (first, second) = (b01 - b00, b02 - b00);
        [(b11 - b01) - first, (b12 - b02) - first, (b22 - b02) - second]
    }

    /// The derivative along `d` (m).
    #[inline]
    #[must_use]
    pub fn tangent(&self, d: [f64; 3]) -> DVec3 {
        self.slopes[0] * d[0] + self.slopes[1] * d[1] + self.slopes[2] * d[2]
    }

    /// The second derivative along `d` and `e` (m).
    #[inline]
    #[must_use]
    pub fn bend(&self, d: [f64; 3], e: [f64; 3]) -> DVec3 {
        let [slope] = lower::<_, LINES, 1>(&lower(&self.bends, d), e);
        slope
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Random;

    fn product(basis: [f64; CONTROLS], net: &[DVec3; CONTROLS]) -> DVec3 {
        basis.iter().zip(net).map(|(count, control)| *control * *count).sum()
    }

    /// The basis is that of the definition, and the jet is the product of basis and net, with the derivatives that
    /// differences give.
    #[test]
    fn points_and_derivatives_are_those_of_the_definition() {
        let mut random = Random::new(4);
        for _ in 0..50 {
            let net: [DVec3; CONTROLS] = std::array::from_fn(|_| random.vector());
            let (u, v) = (random.between(0.0, 1.0), random.between(0.0, 1.0));
            let w = [1.0 - u - v, u, v];
            let factorial = |n: usize| (1..=n).product::<usize>() as f64;
            for (exponents, count) in EXPONENTS.into_iter().zip(basis(w)) {
                let divisor: f64 = exponents.map(factorial).iter().product();
                let powers: f64 = w.iter().zip(exponents).map(|(w, exponent)| w.powi(exponent as i32)).product();
                assert!((count - 24.0 / divisor * powers).abs() < 1e-14);
            }
            assert!(EXPONENTS.into_iter().enumerate().all(|(at, exponents)| place(exponents) == at));
            let jet = Jet::new(&net, w);
            assert!((jet.point - product(basis(w), &net)).length() < 1e-14);
            let directions = [[-1.0, 1.0, 0.0], [0.3, 0.4, -0.7]];
            let moved = |step: f64, d: [f64; 3]| [0, 1, 2].map(|k| w[k] + step * d[k]);
            let h = 1e-5;
            for d in directions {
                let slope = (product(basis(moved(h, d)), &net) - product(basis(moved(-h, d)), &net)) / (2.0 * h);
                assert!((jet.tangent(d) - slope).length() < 1e-7);
                assert!((jet.tangent(d) - product(basis_slopes(w, d), &net)).length() < 1e-13);
                let face = [[-1.0, 1.0, 0.0], [-1.0, 0.0, 1.0]];
                assert_eq!(jet.face_tangents(), face.map(|d| jet.tangent(d)));
                let bends = [(0, 0), (0, 1), (1, 1)].map(|(k, l): (usize, usize)| jet.bend(face[k], face[l]));
                assert_eq!(jet.face_bends(), bends);
                for e in directions {
                    let bend = Jet::new(&net, moved(h, e)).tangent(d) - Jet::new(&net, moved(-h, e)).tangent(d);
                    assert!((jet.bend(d, e) - bend / (2.0 * h)).length() < 1e-7);
                }
            }
        }
    }
}
