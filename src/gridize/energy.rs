//! The energy of which gridized torques are most nearly the gradient: what a measured object stores, so far as its
//! torque has a potential.
//!
//! Between neighbouring grid points of which one touches at least, `U_b - U_a = -h (tau_a + tau_b) / 2`. There are more
//! such differences than points; U is their least squares, zero where nothing touches, by conjugate gradients. Where
//! contact begins between a free point and one that touches, the trapezoid is too large: there the torque is taken to
//! grow from zero as fast as it grows on to the next point behind, `U_b = tau_b^2 / (2 k)`. Points in contact that no free one
//! is beside, in holes of what was measured, have a constant of their own, which the least torque among them tells.
//!
//! Where K_a is the greatest stiffness along joint a, a torque tau_a holds at least `tau_a^2 / (2 K_a)`: less, left by noise and
//! by torques without a potential, would be interpolated more steeply than anything that was measured.

use crate::{
    contact::{Status, linear::support::dot},
    dataset::Dataset,
};
use std::collections::BTreeMap;

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

/// `dataset` with an energy: its own, or that whose gradient is nearest to its torques.
#[must_use]
pub fn with_energy(dataset: Dataset) -> Dataset {
    if dataset.energy.is_some() {
        return dataset;
    }
    let energy = energy(&dataset);
    Dataset { energy: Some(energy.into()), ..dataset }
}

/// Returns U at every point of `dataset` (J).
fn energy(dataset: &Dataset) -> Vec<f64> {
    let (points, joints) = (dataset.grid.points(), dataset.grid.joints());
    let touching: Vec<usize> = (0..points).filter(|&point| dataset.status(point) == Status::Contact).collect();
    let ways = |point: usize| (0..joints).map(move |axis| (point, axis));
    let mut differences: Vec<Difference> =
        touching.iter().flat_map(|&point| ways(point)).flat_map(|(point, axis)| beside(dataset, point, axis)).collect();
    let onset = |point: usize| {
        let onsets = ways(point).flat_map(|(point, axis)| [0, 1].map(|side| onset(dataset, point, axis, side)));
        onsets.fold(0.0, f64::max)
    };
    let size = |point: usize| dataset.torque(point).iter().map(|tau| tau * tau).sum::<f64>().sqrt();
    let adrift = adrift(points, &differences, &touching, size);
    differences.extend(adrift.into_iter().map(|second| Difference { first: None, second, value: onset(second) }));
    let mut energy = solve(points, &differences);
    let stiffest: Vec<f64> = (0..joints).map(|axis| stiffest(dataset, &touching, axis)).collect();
    for point in touching {
        let held = dataset.torque(point).iter().zip(&stiffest).filter(|(_, stiffness)| **stiffness > 0.0);
        energy[point] = held.map(|(tau, stiffness)| 0.5 * tau * tau / stiffness).fold(energy[point], f64::max);
    }
    energy
}

/// Of each set of `touching` points that `differences` tie together and to nothing free, that of the least `size`.
fn adrift(points: usize, differences: &[Difference], touching: &[usize], size: impl Fn(usize) -> f64) -> Vec<usize> {
    // Each point leads to another of its set, in the end to the set's first.
    let mut leads: Vec<usize> = (0..points).collect();
    let find = |leads: &mut Vec<usize>, mut point: usize| {
        while leads[point] != point {
            leads[point] = leads[leads[point]];
            point = leads[point];
        }
        point
    };
    for difference in differences {
        let Some(first) = difference.first else { continue };
        let [a, b] = [first, difference.second].map(|point| find(&mut leads, point));
        leads[a.max(b)] = a.min(b);
    }
    let mut least: BTreeMap<usize, usize> = BTreeMap::new();
    for &point in touching {
        let kept = least.entry(find(&mut leads, point)).or_insert(point);
        if size(point) < size(*kept) {
            *kept = point;
        }
    }
    for difference in differences.iter().filter(|difference| difference.first.is_none()) {
        least.remove(&find(&mut leads, difference.second));
    }
    least.into_values().collect()
}

/// Greatest change of the torque along `axis` between a point of `touching` and a neighbour that was measured (N m/rad or
/// N/m).
fn stiffest(dataset: &Dataset, touching: &[usize], axis: usize) -> f64 {
    let mut greatest = 0.0_f64;
    for &point in touching {
        let beside = dataset.grid.beside(point, axis).into_iter().flatten();
        for beside in beside.filter(|&beside| dataset.status(beside) != Status::Outside) {
            let change = dataset.torque(point)[axis] - dataset.torque(beside)[axis];
            greatest = greatest.max(change.abs() / dataset.grid.axes[axis].step);
        }
    }
    greatest
}

/// The differences between `point`, which touches, and its neighbours along `axis`: that behind, and free ones.
fn beside(dataset: &Dataset, point: usize, axis: usize) -> impl Iterator<Item = Difference> {
    let step = dataset.grid.axes[axis].step;
    let beside = dataset.grid.beside(point, axis).into_iter().enumerate();
    beside.filter_map(move |(side, other)| match (other?, dataset.status(other?)) {
        (other, Status::Contact) => (side == 1).then(|| {
            let mean = 0.5 * (dataset.torque(point)[axis] + dataset.torque(other)[axis]);
            Difference { first: Some(point), second: other, value: -step * mean }
        }),
        (_, Status::Outside) => None,
        _ => Some(Difference { first: None, second: point, value: onset(dataset, point, axis, 1 - side) }),
    })
}

/// U at `point`, whose torque grows along `axis` towards `side` and begins within a step on the other side (J).
fn onset(dataset: &Dataset, point: usize, axis: usize, side: usize) -> f64 {
    let step = dataset.grid.axes[axis].step;
    let of = |point: usize| dataset.torque(point)[axis].abs();
    let trapezoid = 0.5 * step * of(point);
    let behind = dataset.grid.beside(point, axis)[side].filter(|&behind| dataset.status(behind) == Status::Contact);
    match behind.map(|behind| (of(behind) - of(point)) / step) {
        Some(stiffness) if stiffness > 0.0 => (0.5 * of(point) * of(point) / stiffness).min(trapezoid),
        _ => trapezoid,
    }
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
    use crate::dataset::{Axis, Grid};

    /// Two walls of 10 N m/rad, one of which was measured from 0.1 rad behind its surface on.
    #[test]
    fn what_no_free_point_is_beside_has_an_energy_of_its_own_and_none_holds_less_than_its_torque() {
        let axis = Axis { name: "a".into(), unit: "rad".into(), start: -0.5, step: 0.05, count: 21 };
        let grid = Grid { axes: vec![axis] };
        let depths: Vec<f64> = (0..21).map(|point| grid.configuration(point)[0].abs() - 0.2).collect();
        let of =
            |depth: f64, point: usize| if depth > 0.0 { -10.0 * depth * (point as f64 - 10.0).signum() } else { 0.0 };
        let torque: Vec<f64> = depths.iter().zip(0..).map(|(depth, point)| of(*depth, point)).collect();
        let of = |(point, depth): (usize, &f64)| match *depth {
            depth if point > 10 && depth < 0.09 => Status::Outside,
            depth if depth > 1e-9 => Status::Contact,
            _ => Status::Free,
        } as u8;
        let status: Vec<u8> = depths.iter().enumerate().map(of).collect();
        let torque: Vec<f64> = torque.iter().zip(&status).map(|(tau, s)| if *s == 1 { *tau } else { 0.0 }).collect();
        let energy = energy(&Dataset::bare(grid, torque, status.clone()));
        for point in (0..21).filter(|&point| status[point] == Status::Contact as u8) {
            // What nobody measured before the first point behind the hole is at most what it would be at this stiffness.
            assert!((energy[point] - 5.0 * depths[point].powi(2)).abs() < 1e-6, "{point}: {}", energy[point]);
        }
    }

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
        let energy = energy(&Dataset::bare(grid, torque, status));
        let greatest = expected.iter().copied().fold(0.0, f64::max);
        for (found, expected) in energy.iter().zip(&expected) {
            assert!((found - expected).abs() < 0.01 * greatest, "{found} {expected}");
        }
    }
}
