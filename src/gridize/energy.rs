//! The energy of which gridized torques are most nearly the gradient: what a measured object stores, so far as its
//! torque has a potential.
//!
//! Between neighbouring grid points of which one touches at least, `U_b - U_a = -h (tau_a + tau_b) / 2`. There are more
//! such differences than points; U is their least squares, zero where nothing touches, by conjugate gradients. Where
//! contact begins between a free point and one that touches, the trapezoid is too large: there the torque is taken to
//! grow from zero as fast as it grows on to the next point behind, `U_b = tau_b^2 / (2 k)`.

use crate::{
    contact::{Status, linear::support::dot},
    dataset::Grid,
};

/// Residual over that of zero energies at which U is as good as its torques, which are known to four digits at best
/// (1).
const RESIDUAL: f64 = 1e-8;

/// One difference of U.
struct Difference {
    /// Points, and U at the second less U at the first (J). Without a first one, U itself.
    first: Option<usize>,
    second: usize,
    value: f64,
}

/// Returns U at every point of `grid` (J); `torque` and `status` as in a dataset.
pub(super) fn energy(grid: &Grid, torque: &[f64], status: &[u8]) -> Vec<f64> {
    let touches = |point: usize| status[point] == Status::Contact as u8;
    let mut differences = Vec::new();
    for point in (0..grid.points()).filter(|&point| touches(point)) {
        for axis in 0..grid.joints() {
            differences.extend(beside(grid, torque, status, point, axis));
        }
    }
    if differences.iter().all(|difference| difference.first.is_some()) {
        // Nothing is free: U is known but for a constant, which the least torque tells.
        let size = |point: usize| norm(torque, grid.joints(), point);
        let least = (0..grid.points()).filter(|&point| touches(point)).min_by(|&a, &b| size(a).total_cmp(&size(b)));
        let onset = |point| {
            let ways = (0..grid.joints()).flat_map(|axis| [(axis, 0), (axis, 1)]);
            ways.map(|(axis, side)| onset(grid, torque, status, point, axis, side)).fold(0.0, f64::max)
        };
        differences.extend(least.map(|second| Difference { first: None, second, value: onset(second) }));
    }
    solve(grid.points(), &differences)
}

/// The differences between `point`, which touches, and its neighbours along `axis`: that behind, and free ones.
fn beside(grid: &Grid, torque: &[f64], status: &[u8], point: usize, axis: usize) -> Vec<Difference> {
    let joints = grid.joints();
    let step = grid.axes[axis].step;
    let mut found = Vec::new();
    for (side, other) in grid.beside(point, axis).into_iter().enumerate() {
        let Some(other) = other else { continue };
        if status[other] == Status::Contact as u8 {
            if side == 1 {
                let mean = 0.5 * (torque[point * joints + axis] + torque[other * joints + axis]);
                found.push(Difference { first: Some(point), second: other, value: -step * mean });
            }
        } else if status[other] != Status::Outside as u8 {
            found.push(Difference {
                first: None,
                second: point,
                value: onset(grid, torque, status, point, axis, 1 - side),
            });
        }
    }
    found
}

/// U at `point`, whose torque grows along `axis` towards `side` and begins within a step on the other side (J).
fn onset(grid: &Grid, torque: &[f64], status: &[u8], point: usize, axis: usize, side: usize) -> f64 {
    let (joints, step) = (grid.joints(), grid.axes[axis].step);
    let of = |point: usize| torque[point * joints + axis].abs();
    let trapezoid = 0.5 * step * of(point);
    let behind = grid.beside(point, axis)[side].filter(|&behind| status[behind] == Status::Contact as u8);
    match behind.map(|behind| (of(behind) - of(point)) / step) {
        Some(stiffness) if stiffness > 0.0 => (0.5 * of(point) * of(point) / stiffness).min(trapezoid),
        _ => trapezoid,
    }
}

fn norm(torque: &[f64], joints: usize, point: usize) -> f64 {
    torque[point * joints..(point + 1) * joints].iter().map(|tau| tau * tau).sum::<f64>().sqrt()
}

/// Least squares of the differences; zero at points in none.
fn solve(points: usize, differences: &[Difference]) -> Vec<f64> {
    let normal = |x: &[f64], product: &mut [f64]| {
        product.fill(0.0);
        for &Difference { first, second, .. } in differences {
            let change = x[second] - first.map_or(0.0, |first| x[first]);
            product[second] += change;
            first.into_iter().for_each(|first| product[first] -= change);
        }
    };
    let mut residual = vec![0.0; points];
    for &Difference { first, second, value } in differences {
        residual[second] += value;
        first.into_iter().for_each(|first| residual[first] -= value);
    }
    let (mut energy, mut product) = (vec![0.0; points], vec![0.0; points]);
    let mut direction = residual.clone();
    let mut square = dot(&residual, &residual);
    let enough = RESIDUAL * RESIDUAL * square;
    // In exact arithmetic it ends after as many steps as there are points.
    for _ in 0..points {
        if square <= enough {
            break;
        }
        normal(&direction, &mut product);
        let step = square / dot(&direction, &product);
        energy.iter_mut().zip(&direction).for_each(|(x, way)| *x += step * way);
        residual.iter_mut().zip(&product).for_each(|(left, change)| *left -= step * change);
        let next = dot(&residual, &residual);
        direction.iter_mut().zip(&residual).for_each(|(way, left)| *way = left + next / square * *way);
        square = next;
    }
    energy.iter_mut().for_each(|x| *x = x.max(0.0));
    energy
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::dataset::Axis;

    #[test]
    fn a_torque_with_a_potential_has_its_energy_and_a_curl_adds_none() {
        let axis = |name: &str, count| Axis { name: name.into(), unit: "rad".into(), start: -0.2, step: 0.05, count };
        let grid = Grid { axes: vec![axis("a", 21), axis("b", 17)] };
        let (mut torque, mut status, mut expected) = (Vec::new(), Vec::new(), Vec::new());
        for point in 0..grid.points() {
            let q = grid.configuration(point);
            // A plane spring of 10 N m/rad whose surface lies between grid lines, and a small curl.
            let depth = (q[0] + 0.5 * q[1] - 0.013).max(0.0);
            let curl = if depth > 0.0 { 0.02 } else { 0.0 };
            torque.extend([-10.0 * depth - curl * q[1], -5.0 * depth + curl * q[0]]);
            status.push(if depth > 0.0 { Status::Contact } else { Status::Free } as u8);
            expected.push(5.0 * depth * depth);
        }
        let energy = energy(&grid, &torque, &status);
        let greatest = expected.iter().copied().fold(0.0, f64::max);
        for (found, expected) in energy.iter().zip(&expected) {
            assert!((found - expected).abs() < 0.01 * greatest, "{found} {expected}");
        }
    }
}
