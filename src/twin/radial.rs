//! A signed distance from scattered values: biharmonic radial basis functions with smoothing, dense.
//!
//! `s(x) = sum_j c_j (-|x - x_j|) + p(x)` with a linear p solves `(Phi + rho I) c + P a = f`, `P^T c = 0` (Carr et al.,
//! Reconstruction and representation of 3D objects with radial basis functions, 2001). It is the best linear prediction
//! of a random function whose increments grow as `2 C |x - y|`, measured with variances C rho: so the same system gives
//! what is left unknown between the points (kriging; Matheron 1973), with the scale C from how well each value is
//! predicted by all others.

use crate::{Error, error};
use faer::{Accum, Mat, Par, linalg::matmul::matmul, linalg::solvers::DenseSolveCore};
use glam::DVec3;

/// Numbers of a linear polynomial in space.
const LINEAR: usize = 4;

/// Most values: their dense system and its inverse take some 0.5 GB.
pub const MOST_VALUES: usize = 5000;

/// Places whose variances are found at once.
const TOGETHER: usize = 512;

/// A function in space that is known at points.
pub struct RadialField {
    /// Origin and unit of length of the points (m): the system is then well scaled.
    origin: DVec3,
    unit: f64,
    points: Vec<DVec3>,
    /// c, then a.
    coefficients: Vec<f64>,
    inverse: Mat<f64>,
}

impl RadialField {
    /// The field with `values` at `points` (m), smoothed by `rho` (m).
    ///
    /// # Errors
    /// When there are too many, or the points lie in a plane.
    pub fn new(points: &[DVec3], values: &[f64], rho: &[f64]) -> Result<Self, Error> {
        let n = points.len();
        if n > MOST_VALUES {
            return Err(error!("a surface through {n} values, more than {MOST_VALUES}: scan fewer approaches"));
        }
        let low = points.iter().copied().fold(DVec3::INFINITY, DVec3::min);
        let high = points.iter().copied().fold(DVec3::NEG_INFINITY, DVec3::max);
        let unit = (high - low).max_element().max(f64::MIN_POSITIVE);
        let mut field = Self {
            origin: low.midpoint(high),
            unit,
            points: points.to_vec(),
            coefficients: Vec::new(),
            inverse: Mat::zeros(0, 0),
        };
        let system = Mat::from_fn(n + LINEAR, n + LINEAR, |i, j| match (i < n, j < n) {
            (true, true) if i == j => rho[i] / unit,
            (true, true) => -points[i].distance(points[j]) / unit,
            (true, false) => field.linear(points[i])[j - n],
            (false, true) => field.linear(points[j])[i - n],
            (false, false) => 0.0,
        });
        field.inverse = system.partial_piv_lu().inverse();
        field.coefficients = (0..n + LINEAR).map(|i| (0..n).map(|j| field.inverse[(i, j)] * values[j]).sum()).collect();
        if !field.coefficients.iter().all(|c| c.is_finite()) {
            return Err("the surface cannot be found: all its points lie in a plane with their normals".into());
        }
        Ok(field)
    }

    /// 1, x, y, z at a point, in the field's own units.
    fn linear(&self, x: DVec3) -> [f64; LINEAR] {
        let x = (x - self.origin) / self.unit;
        [1.0, x.x, x.y, x.z]
    }

    /// The value at `x`.
    #[must_use]
    pub fn value(&self, x: DVec3) -> f64 {
        let n = self.points.len();
        let sum: f64 = self.points.iter().zip(&self.coefficients).map(|(point, c)| c * x.distance(*point)).sum();
        let linear: f64 = self.linear(x).iter().zip(&self.coefficients[n..]).map(|(x, a)| x * a).sum();
        linear - sum / self.unit
    }

    /// Its gradient (1/m).
    #[must_use]
    pub fn gradient(&self, x: DVec3) -> DVec3 {
        let n = self.points.len();
        let sum: DVec3 =
            self.points.iter().zip(&self.coefficients).map(|(point, c)| *c * (x - *point).normalize_or_zero()).sum();
        (DVec3::from_slice(&self.coefficients[n + 1..]) - sum) / self.unit
    }

    /// By how much the values in `groups` differ from what all others predict, each group left out whole, and the
    /// variance of that over the scale C, in metres (kriging's leave-one-out; Dubrule 1983). Of each group the first.
    #[must_use]
    pub fn held_out(&self, groups: &[Vec<usize>]) -> Vec<[f64; 2]> {
        let predict = |group: &Vec<usize>| {
            let block = Mat::from_fn(group.len(), group.len(), |a, b| self.inverse[(group[a], group[b])]);
            let variances = block.partial_piv_lu().inverse();
            let difference = group.iter().enumerate().map(|(a, &i)| variances[(0, a)] * self.coefficients[i]).sum();
            [difference, variances[(0, 0)] * self.unit]
        };
        groups.iter().map(predict).collect()
    }

    /// What is not known of the value at each of `places`: its variance over the scale C (m).
    #[must_use]
    pub fn variances(&self, places: &[DVec3]) -> Vec<f64> {
        let n = self.points.len();
        let mut variances = Vec::with_capacity(places.len());
        for some in places.chunks(TOGETHER) {
            let near = Mat::from_fn(n + LINEAR, some.len(), |i, k| match i < n {
                true => -some[k].distance(self.points[i]) / self.unit,
                false => self.linear(some[k])[i - n],
            });
            let mut solved = Mat::zeros(n + LINEAR, some.len());
            matmul(solved.as_mut(), Accum::Replace, &self.inverse, &near, 1.0, Par::Seq);
            variances.extend((0..some.len()).map(|k| {
                let sum: f64 = near.col(k).iter().zip(solved.col(k).iter()).map(|(a, b)| a * b).sum();
                (-sum * self.unit).max(0.0)
            }));
        }
        variances
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Random;

    #[test]
    fn a_field_goes_through_its_values_and_its_gradient_is_their_slope() {
        let points = Random::vectors(60, 3);
        let values: Vec<f64> = points.iter().map(|x| x.length() - 0.7).collect();
        let field = RadialField::new(&points, &values, &vec![0.0; 60]).unwrap();
        for (point, value) in points.iter().zip(&values) {
            assert!((field.value(*point) - value).abs() < 1e-10);
        }
        for x in Random::vectors(10, 4) {
            let slope = DVec3::AXES.map(|e| (field.value(x + 1e-6 * e) - field.value(x - 1e-6 * e)) / 2e-6);
            assert!(field.gradient(x).distance(DVec3::from_array(slope)) < 1e-7);
        }
        // A linear function is reproduced everywhere.
        let values: Vec<f64> = points.iter().map(|x| 1.0 + x.dot(DVec3::new(1.0, -2.0, 0.5))).collect();
        let field = RadialField::new(&points, &values, &vec![0.3; 60]).unwrap();
        let far = DVec3::new(9.0, -7.0, 3.0);
        assert!((field.value(far) - 1.0 - far.dot(DVec3::new(1.0, -2.0, 0.5))).abs() < 1e-9);
    }

    #[test]
    fn values_held_out_differ_as_from_a_field_without_them() {
        let points = Random::vectors(30, 5);
        let values: Vec<f64> = points.iter().map(|x| (3.0 * x.x).sin() + x.y * x.z).collect();
        let rho = vec![0.02; 30];
        let field = RadialField::new(&points, &values, &rho).unwrap();
        let held = field.held_out(&[vec![4, 9]])[0];
        let keep = |i: &usize| ![4, 9].contains(i);
        let others: Vec<usize> = (0..30).filter(keep).collect();
        let some: Vec<DVec3> = others.iter().map(|&i| points[i]).collect();
        let without =
            RadialField::new(&some, &others.iter().map(|&i| values[i]).collect::<Vec<_>>(), &rho[..28]).unwrap();
        assert!((held[0] - (values[4] - without.value(points[4]))).abs() < 1e-10);
        assert!((held[1] - without.variances(&points[4..5])[0] - rho[4]).abs() < 1e-10);
    }
}
