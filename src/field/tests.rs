//! Properties of the field whatever is interpolated, and of each interpolation.

use super::*;
use crate::fixtures::grids::{grid, half_space};
use crate::{
    MAX_AXES,
    contact::Status,
    dataset::Provenance,
    joint_matrix::{JointMatrix, add_symmetric},
    store::{Nodes, Place, Space, Store, root_of},
};
use std::collections::BTreeSet;

/// So steep a layer that it holds nothing back.
const SOFT: f64 = 1e6;

fn rendered(data: &Dataset, slope: f64) -> TorqueField {
    TorqueField::interpolated(data, Interpolation::Linear, 0.5, &vector(&vec![slope; data.grid.joints()])).unwrap()
}

fn vector(values: &[f64]) -> JointVector {
    JointVector::from_slice(values)
}

/// `count` points 0.2 rad apart on every axis, centred on zero.
fn centred(joints: usize, count: usize) -> crate::dataset::Grid {
    grid(&vec![(-0.1 * (count - 1) as f64, 0.2, count); joints])
}

/// Every joint's torque a product of affine functions of all coordinates: what multilinear interpolation keeps.
fn multilinear(q: &JointVector) -> JointVector {
    let mut tau = *q;
    for (a, tau) in tau.iter_mut().enumerate() {
        *tau = q.iter().enumerate().map(|(b, x)| 1.0 + (0.3 + 0.1 * (a + b) as f64) * x).product();
    }
    tau
}

#[test]
fn multilinear_fields_are_reproduced_in_one_to_six_joints() {
    for joints in 1..=MAX_AXES {
        let data = Dataset::of_field(grid(&vec![(-0.4, 0.2, 5); joints]), |q| (multilinear(q), 1.0, Status::Contact));
        let field = rendered(&data, SOFT);
        let mut q = JointVector::zeros(joints);
        for k in 0..50 {
            for (a, x) in q.iter_mut().enumerate() {
                *x = 0.39 * (1.0 + 1.7 * k as f64 + 2.3 * a as f64).sin();
            }
            let sample = field.sample(&q);
            let exact = multilinear(&q);
            for (tau, exact) in sample.torque.iter().zip(exact.iter()) {
                assert!((tau - exact).abs() < 1e-13 * exact.abs().max(1.0), "{joints} joints: {tau} for {exact}");
            }
            assert!((sample.index - 1.0).abs() < 1e-14 && sample.contact && sample.flags.is_empty());
            assert!((sample.energy - 1.0).abs() < 1e-14);
        }
    }
}

#[test]
fn contact_begins_where_the_index_passes_its_threshold() {
    let data = half_space(grid(&[(-1.0, 0.5, 5)]), 2.0);
    let field = rendered(&data, SOFT);
    // Free at 0, contact at 0.5: the index passes one half at 0.25.
    assert!(!field.sample(&[0.249]).contact);
    assert!(field.sample(&[0.251]).contact);
    assert_eq!(field.sample(&[0.125]).index, 0.25);
    assert_eq!(field.sample(&[0.2]).torque[0], 0.0);
    assert_eq!(field.sample(&[0.75]).torque[0], -1.5);
}

/// Steepest change of torque along a winding path through and out of a grid of `count` points 0.2 apart an axis,
/// centred on zero (N m/rad).
fn steepest(field: &TorqueField, count: usize, reach: f64) -> f64 {
    let half = 0.1 * (count - 1) as f64 * reach;
    let place = |k: f64| {
        let x = |a: usize| half * (0.11 * k + 1.3 * a as f64).sin() * (0.013 * k).cos();
        vector(&(0..field.joints()).map(x).collect::<Vec<_>>())
    };
    let distance = |p: &[f64], q: &[f64]| p.iter().zip(q).map(|(p, q)| (p - q).powi(2)).sum::<f64>().sqrt();
    let slope = |k: i32| {
        let (p, q) = (place(0.01 * f64::from(k)), place(0.01 * f64::from(k + 1)));
        // Short steps would measure rounding.
        let moved = distance(&p, &q).max(1e-6);
        distance(&field.sample(&p).torque, &field.sample(&q).torque) / moved
    };
    (0..40_000).map(slope).fold(0.0, f64::max)
}

#[test]
fn torque_is_continuous_with_the_stated_bound_whatever_the_data() {
    for (joints, count) in [(1, 40), (2, 9), (3, 7), (6, 3)] {
        let wild = Dataset::of_field(centred(joints, count), |q| {
            let noise = |a: usize| (q.iter().map(|x| 7e3 * x).sum::<f64>() + 5.0 * a as f64).sin();
            let status = if noise(9) > -0.3 { Status::Contact } else { Status::Free };
            (vector(&(0..joints).map(noise).collect::<Vec<_>>()), 0.0, status)
        });
        for slope in [0.1, 10.0, 1e4] {
            let field = rendered(&wild, slope);
            let slopes = vector(&vec![slope; joints]);
            let stiffness = slope * field.relative_stiffness(&slopes);
            let (steepest, bound) = (steepest(&field, count, 1.0), stiffness.hypot(slope));
            assert!(steepest <= bound * (1.0 + 1e-6), "{joints} joints: {steepest} of {bound}");
            assert!(steepest > 0.02 * stiffness.min(slope), "{joints} joints: {steepest} of {bound}");
        }
    }
}

#[test]
fn a_jump_at_contact_is_felt_with_the_slope_of_the_layer_alone() {
    for (joints, count) in [(1, 9), (2, 9), (3, 9), (6, 4)] {
        // One newton metre at once, then 1 N m/rad in each joint: along a fixed direction.
        let jump = Dataset::of_field(centred(joints, count), |q| {
            let depth = q.iter().sum::<f64>();
            let inside = depth > 0.05;
            let tau = vector(&vec![if inside { -1.0 - depth } else { 0.0 }; q.len()]);
            (tau, 0.0, if inside { Status::Contact } else { Status::Free })
        });
        let slope = 2.0;
        let field = rendered(&jump, slope);
        let steepest = steepest(&field, count, 1.0);
        let expected = slope.max(joints as f64);
        assert!(steepest <= expected * (1.0 + 1e-6), "{joints} joints: {steepest} of {expected}");
        // Without the layer the same path is steeper than the object: the test can fail.
        let bare = rendered(&jump, SOFT);
        assert!(self::steepest(&bare, count, 1.0) > 2.0 * expected, "{joints} joints");
    }
}

#[test]
fn the_layer_holds_a_jump_to_the_slope_and_leaves_a_soft_object_alone() {
    let jump = Dataset::of_field(grid(&[(-0.5, 0.1, 21)]), |q| {
        let inside = q[0] > 0.01;
        (vector(&[if inside { -1.0 } else { 0.0 }]), 0.0, if inside { Status::Contact } else { Status::Free })
    });
    let field = rendered(&jump, 2.0);
    // Boundary at 0.05; 2 N m/rad from there until 1 N m is reached half a radian further on.
    for (q, torque) in [(0.04, 0.0), (0.1, -0.1), (0.3, -0.5), (0.54, -0.98), (0.6, -1.0), (1.2, -1.0)] {
        let sample = field.sample(&[q]);
        assert!((sample.torque[0] - torque).abs() < 1e-12, "{} at {q}", sample.torque[0]);
        assert_eq!(sample.flags.contains(Flags::LAYER), q < 0.55, "at {q}");
    }
    let soft = half_space(grid(&[(-0.5, 0.1, 21)]), 0.5);
    let field = rendered(&soft, 2.0);
    for k in 2..10 {
        let q = 0.1 * k as f64;
        assert!((field.sample(&[q]).torque[0] + 0.5 * q).abs() < 1e-12, "at {q}");
    }
}

#[test]
fn torque_fades_out_over_one_cell_beyond_the_grid() {
    let data =
        Dataset::of_field(grid(&[(0.0, 0.1, 3), (0.0, 0.1, 3)]), |_| (vector(&[1.0, -2.0]), 0.0, Status::Contact));
    let field = rendered(&data, 1.0);
    let at = |x: f64| field.sample(&[x, 0.05]);
    assert!(!at(0.2).flags.contains(Flags::OUTSIDE));
    assert_eq!(at(0.2).torque[1], -2.0);
    assert!((at(0.25).torque[1] + 1.0).abs() < 1e-12);
    assert!(at(0.25).flags.contains(Flags::OUTSIDE));
    assert_eq!(*at(0.31).torque, [0.0, 0.0]);
    assert!(!at(0.31).contact);
    assert_eq!(*at(f64::NAN).torque, [0.0, 0.0]);
}

/// A scan that ends inside the object, and has a hole there: the torque must not fall to zero in either.
#[test]
fn torque_goes_on_where_points_in_contact_are_absent_and_free_ones_stay_free() {
    let data = Dataset::of_field(grid(&[(0.0, 0.1, 10), (0.0, 0.1, 6)]), |q| {
        let depth = q[0] - 0.25;
        let absent = q[0] > 0.65 || q[0] < 0.05 || (q[0] - 0.4).hypot(q[1] - 0.2) < 0.05;
        let tau = if absent { f64::NAN } else { -2.0 * depth.max(0.0) };
        let status = match depth > 0.0 {
            _ if absent => Status::Outside,
            true => Status::Contact,
            false => Status::Free,
        };
        (vector(&[tau, 0.0]), depth.max(0.0).powi(2), status)
    });
    for interpolation in [Interpolation::Linear, Interpolation::Potential] {
        let field = field_of(&data, interpolation);
        for across in [0.2, 0.25, 0.5] {
            for k in 36..=90 {
                let at = field.sample(&[f64::from(k) * 0.01, across]);
                // No less than at the point before the hole.
                assert!(at.torque[0] < -0.099 && at.contact, "{interpolation:?} at {k}, {across}: {at:?}");
                assert!(at.flags.contains(Flags::ABSENT) || k <= 60);
            }
            let free = field.sample(&[0.0, across]);
            assert!(free.torque[0] == 0.0 && !free.contact && free.flags.contains(Flags::ABSENT));
        }
        let (last, beyond) = (field.sample(&[0.6, 0.5]).torque[0], field.sample(&[0.85, 0.5]).torque[0]);
        assert!((last + 0.7).abs() < 1e-12);
        let expected = if interpolation == Interpolation::Linear { last } else { -2.0 * (0.85 - 0.25) };
        assert!((beyond - expected).abs() < 1e-12, "{interpolation:?}: {beyond}");
    }
}

#[test]
fn unconverged_points_are_used_and_flagged() {
    let data = Dataset::of_field(grid(&[(0.0, 0.1, 3)]), |q| {
        (vector(&[1.0]), 0.0, if q[0] > 0.15 { Status::Unconverged } else { Status::Contact })
    });
    let field = rendered(&data, SOFT);
    assert!(field.sample(&[0.05]).flags.is_empty());
    let sample = field.sample(&[0.15]);
    assert!(sample.flags == Flags::UNCONVERGED && (sample.torque[0] - 1.0).abs() < 1e-12);
}

#[test]
fn inconsistent_datasets_are_refused_with_the_reason() {
    let good = || half_space(grid(&[(-1.0, 0.5, 5), (-1.0, 0.5, 3)]), 2.0);
    let new = |data: Dataset, threshold: f64, slope: &[f64]| {
        let field = TorqueField::interpolated(&data, Interpolation::Linear, threshold, &vector(slope));
        field.err().map_or_else(String::new, |error| error.to_string())
    };
    assert_eq!(new(good(), 0.5, &[1.0, 2.0]), "");
    assert!(new(good(), 1.0, &[1.0, 2.0]).contains("threshold is 1;"));
    assert!(new(good(), f64::NAN, &[1.0, 2.0]).contains("threshold is NaN;"));
    for slope in [&[0.0, 1.0][..], &[1.0, f64::NAN], &[1.0], &[1.0, 1.0, 1.0], &[1.0, f64::INFINITY]] {
        assert!(new(good(), 0.5, slope).starts_with("the boundary slope"), "{slope:?}");
    }
    let mut short = good();
    short.torque = vec![0.0; 29].into();
    assert!(new(short, 0.5, &[1.0, 1.0]).contains("torque has 29 entries where the grid asks for 30"));
    let mut wild = good();
    wild.torque = vec![f64::NAN; 30].into();
    assert!(new(wild, 0.5, &[1.0, 1.0]).contains(" is NaN: bake it again"));
    let mut nothing = good();
    nothing.status = vec![Status::Outside as u8; 15].into();
    assert!(new(nothing, 0.5, &[1.0, 1.0]).contains("no grid point"));
}

#[test]
fn relative_stiffness_of_a_half_space_is_its_stiffness() {
    for joints in [1, 2, 4] {
        let data = half_space(centred(joints, 5), 3.0);
        let stiffness = rendered(&data, SOFT).relative_stiffness(&vector(&vec![1.5; joints]));
        assert!((stiffness - 2.0).abs() < 1e-12, "{joints} joints: {stiffness}");
    }
}

fn field_of(data: &Dataset, interpolation: Interpolation) -> TorqueField {
    TorqueField::interpolated(data, interpolation, 0.5, &vector(&vec![SOFT; data.grid.joints()])).unwrap()
}

/// A configuration within 0.36 of zero in each joint; the same for the same `k`.
fn place(joints: usize, k: usize) -> JointVector {
    let mut q = JointVector::zeros(joints);
    q.iter_mut().enumerate().for_each(|(a, x)| *x = 0.36 * (0.7 + (1.9 + 0.83 * a as f64) * k as f64).sin());
    q
}

#[test]
fn a_linear_object_is_rendered_exactly_by_its_potential() {
    for joints in 1..=MAX_AXES {
        // No grid point lies on the boundary.
        let axes: Vec<_> = (0..joints).map(|a| (-0.43 + 0.01 * a as f64, 0.2, 5)).collect();
        let data = half_space(grid(&axes), 3.0);
        let part = 1.0 / (joints as f64).sqrt();
        for interpolation in Interpolation::ALL {
            let field = field_of(&data, interpolation);
            let mut worst = 0.0_f64;
            for k in 0..200 {
                let q = place(joints, k);
                let depth = (q.iter().sum::<f64>() * part).max(0.0);
                let sample = field.sample(&q);
                for tau in sample.torque.iter() {
                    worst = worst.max((tau + 3.0 * depth * part).abs());
                }
                if interpolation == Interpolation::Potential {
                    assert!((sample.energy - 1.5 * depth * depth).abs() < 1e-12, "{} at {q:?}", sample.energy);
                    assert_eq!(sample.contact, depth > 0.0, "at {q:?}");
                }
            }
            match interpolation {
                // The paper's boundary and the kink behind it: a quarter of a cell's torque.
                Interpolation::Linear => assert!(worst > 0.02, "{joints} joints: {worst}"),
                Interpolation::Potential => {
                    assert!(worst < 1e-12, "{joints} joints: {worst}");
                }
            }
        }
    }
}

/// A curved potential that begins at the surface of a ball of radius 0.6.
fn ball(grid: crate::dataset::Grid) -> Dataset {
    Dataset::of_field(grid, |q| {
        let (tau, energy) = push(q);
        (tau, energy, if energy > 0.0 { Status::Contact } else { Status::Free })
    })
}

/// Torque and energy of [`ball`]: `1/2 k d^2 (1 + d)`, d the depth.
fn push(q: &[f64]) -> (JointVector, f64) {
    let radius = q.iter().map(|x| x * x).sum::<f64>().sqrt();
    let depth = (0.6 - radius).max(0.0);
    let slope = 4.0 * (depth + 1.5 * depth * depth) / radius.max(1e-9);
    (vector(&q.iter().map(|x| slope * x).collect::<Vec<_>>()), 2.0 * depth * depth * (1.0 + depth))
}

#[test]
fn potential_passes_through_the_data_and_is_the_gradient_of_its_energy_wherever_it_is_looked_up() {
    for (joints, count) in [(1, 21), (2, 9), (3, 7), (4, 5), (6, 4)] {
        let data = ball(grid(&vec![(-0.401, 0.8 / (count - 1) as f64, count); joints]));
        let field = field_of(&data, Interpolation::Potential);
        for point in (0..data.grid.points()).step_by(1 + data.grid.points() / 300) {
            let sample = field.sample(&data.grid.configuration(point));
            let error = sample.torque.iter().zip(data.torque(point)).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
            assert!(error < 1e-12 && (sample.energy - data.energy.as_ref().unwrap()[point]).abs() < 1e-12);
        }
        let mut pushed = 0;
        for k in 0..200 {
            let q = place(joints, k);
            let sample = field.sample(&q);
            pushed += usize::from(sample.contact);
            for a in 0..joints {
                let at = |step: f64| {
                    let mut q = q;
                    q[a] += step;
                    field.sample(&q).energy
                };
                let slope = (at(1e-6) - at(-1e-6)) / 2e-6;
                assert!((sample.torque[a] + slope).abs() < 1e-6, "{joints} joints at {q:?}: {slope}");
            }
        }
        assert!(pushed > 10, "{joints} joints: {pushed}");
    }
}

#[test]
fn every_interpolation_is_continuous_over_faces_edges_and_the_rim() {
    for joints in [1, 2, 3] {
        let mut data = half_space(grid(&vec![(-0.43, 0.2, 5); joints]), 3.0);
        // Noise, a hole and a point that did not converge.
        let mut torque = data.torque.to_vec();
        torque.iter_mut().enumerate().for_each(|(k, tau)| *tau *= 1.0 + 0.3 * (7.0 * k as f64).sin());
        data.torque = torque.into();
        let mut status = data.status.to_vec();
        let last = status.len() - 1;
        (status[last - 1], status[last]) = (Status::Outside as u8, Status::Unconverged as u8);
        data.status = status.into();
        for interpolation in Interpolation::ALL {
            let field = TorqueField::interpolated(&data, interpolation, 0.5, &vector(&vec![50.0; joints])).unwrap();
            let at = |k: f64| {
                let q: Vec<f64> =
                    (0..joints).map(|a| 0.7 * ((0.3 + 0.17 * a as f64) * k + 1.1 * a as f64).sin()).collect();
                field.sample(&q).torque
            };
            let mut greatest = 0.0_f64;
            for k in 0..40_000 {
                let (p, q) = (at(0.002 * f64::from(k)), at(0.002 * f64::from(k + 1)));
                greatest = p.iter().zip(q.iter()).map(|(p, q)| (p - q).abs()).fold(greatest, f64::max);
            }
            // 4e-4 rad at most 100 N m/rad.
            assert!(greatest < 0.04 && greatest > 1e-4, "{joints} joints, {interpolation:?}: {greatest}");
        }
    }
}

#[test]
fn potential_fades_out_beyond_the_grid() {
    let data = Dataset::of_field(grid(&[(0.0, 0.1, 8)]), |q| {
        (vector(&[-2.0 * (q[0] + 0.1)]), (q[0] + 0.1).powi(2), Status::Contact)
    });
    let field = field_of(&data, Interpolation::Potential);
    let exact = |x: f64| -2.0 * (x + 0.1);
    assert!((field.sample(&[0.37]).torque[0] - exact(0.37)).abs() < 1e-12);
    let outside = field.sample(&[-0.05]);
    assert!((outside.torque[0] - 0.5 * exact(0.0)).abs() < 1e-12 && outside.flags.contains(Flags::OUTSIDE));
    assert_eq!(field.sample(&[f64::NAN]).torque[0], 0.0);
}

#[test]
fn contradictory_energies_and_torques_stay_bounded() {
    // Overflowed and unconverged points may hold a torque without energy, or the other way round.
    let data = Dataset::of_field(grid(&[(0.0, 0.1, 9), (0.0, 0.1, 9)]), |q| {
        let odd = ((q[0] + 3.0 * q[1]) * 10.0).round() as i64 % 3;
        let depth = q[0] - 0.05;
        let state = [Status::Contact, Status::Unconverged, Status::Overflow][odd as usize];
        let energy = [0.5 * depth * depth, -1.0, 0.0][odd as usize];
        (vector(&[-depth - 3.0 * odd as f64, 0.0]), energy, if q[0] < 0.05 { Status::Free } else { state })
    });
    let field = field_of(&data, Interpolation::Potential);
    for k in 0..2000 {
        let q = [0.8 * (0.37 * k as f64).sin().abs(), 0.8 * (0.11 * k as f64).sin().abs()];
        let torque = field.sample(&q).torque;
        assert!(torque.norm() < 10.0, "{torque:?} at {q:?}");
    }
}

#[test]
fn energy_is_counted_from_free_space() {
    // A force on the object, gravity say, gives it energy without contact.
    let mut data = half_space(grid(&[(-0.43, 0.1, 9), (-0.43, 0.1, 9)]), 3.0);
    let plain = field_of(&data, Interpolation::Potential);
    data.energy = Some(data.energy.unwrap().iter().map(|energy| energy - 0.7).collect::<Vec<_>>().into());
    let shifted = field_of(&data, Interpolation::Potential);
    for k in 0..50 {
        let (a, b) = (plain.sample(&place(2, k)), shifted.sample(&place(2, k)));
        assert!((a.torque[0] - b.torque[0]).abs() < 1e-9 && (a.energy - b.energy - 0.7).abs() < 1e-12);
    }
}

#[test]
fn interpolations_name_the_column_that_a_dataset_lacks() {
    let mut data = half_space(grid(&[(-0.43, 0.1, 9)]), 3.0);
    let refused = |data: &Dataset, interpolation| {
        TorqueField::interpolated(data, interpolation, 0.5, &vector(&[1.0])).err().unwrap().to_string()
    };
    data.energy = None;
    let message = refused(&data, Interpolation::Potential);
    assert!(message.contains("no energy") && message.contains("interpolation = \"linear\""), "{message}");
}

#[test]
fn stiffness_of_a_potential_is_that_of_its_object() {
    for joints in [1, 2, 4] {
        let data = half_space(grid(&vec![(-0.43, 0.2, 5); joints]), 3.0);
        let field = field_of(&data, Interpolation::Potential);
        let stiffness = field.relative_stiffness(&vector(&vec![1.5; joints]));
        assert!((stiffness - 2.0).abs() < 1e-9, "{joints} joints: {stiffness}");
        assert!(field.is_potential() && !field_of(&data, Interpolation::Linear).is_potential());
    }
}

/// Root w, its gradient and its second derivatives at `q`, of the energy `1/2 max(0, w)^2`: curved along every joint
/// and every pair.
fn wavy_root(q: &[f64]) -> (f64, JointVector, JointMatrix) {
    let (mut w, mut slope, mut second) = (0.1, JointVector::zeros(q.len()), JointMatrix::default());
    for wave in 0..3 {
        let rate = |a: usize| 1.0 + (1.7 * (a as f64 + 1.0) * (f64::from(wave) + 1.0)).sin();
        let phase = f64::from(wave) + q.iter().enumerate().map(|(a, x)| rate(a) * x).sum::<f64>();
        w += 0.4 * phase.sin();
        for a in 0..q.len() {
            slope[a] += 0.4 * rate(a) * phase.cos();
            (0..=a).for_each(|b| add_symmetric(&mut second, a, b, -0.4 * rate(a) * rate(b) * phase.sin()));
        }
    }
    (w, slope, second)
}

/// Torque and energy of [`wavy_root`].
fn wave(q: &[f64]) -> (JointVector, f64) {
    let (w, mut tau, _) = wavy_root(q);
    tau.iter_mut().for_each(|slope| *slope *= -w.max(0.0));
    (tau, 0.5 * w.max(0.0).powi(2))
}

fn waves(grid: crate::dataset::Grid) -> Dataset {
    Dataset::of_field(grid, |q| {
        let (tau, energy) = wave(q);
        (tau, energy, if energy > 0.0 { Status::Contact } else { Status::Free })
    })
}

/// Frobenius norm of the slope of the torque at `q`, over `slope`, by central differences.
fn steepness(field: &TorqueField, q: &JointVector, slope: f64) -> f64 {
    let mut sum = 0.0;
    for b in 0..q.len() {
        let at = |step: f64| {
            let mut q = *q;
            q[b] += step;
            field.sample(&q).torque
        };
        let (before, after) = (at(-1e-6), at(1e-6));
        sum += before.iter().zip(after.iter()).map(|(a, b)| ((b - a) / 2e-6 / slope).powi(2)).sum::<f64>();
    }
    sum.sqrt()
}

#[test]
fn the_stiffness_of_a_potential_is_nowhere_greater_than_its_bound() {
    for (joints, count) in [(1, 9), (2, 7), (3, 5)] {
        let axes = vec![(-0.401, 0.8 / (count - 1) as f64, count); joints];
        for noise in [0.0, 0.5] {
            let mut data = waves(grid(&axes));
            let uneven = |column: Vec<f64>, seed: f64| -> Vec<f64> {
                let factor = |k: usize| 1.0 + noise * (seed * (k * k) as f64 + k as f64).sin();
                column.into_iter().enumerate().map(|(k, x)| x * factor(k)).collect()
            };
            data.torque = uneven(data.torque.to_vec(), 3.7).into();
            data.energy = Some(uneven(data.energy.unwrap().to_vec(), 1.3).into());
            let field = field_of(&data, Interpolation::Potential);
            let bound = field.relative_stiffness(&vector(&vec![1.5; joints]));
            let steepest = (0..4000).map(|k| steepness(&field, &place(joints, k), 1.5)).fold(0.0, f64::max);
            assert!(steepest <= bound * (1.0 + 1e-6), "{joints} joints: {steepest} beyond {bound}");
            // The bound is of use.
            assert!(noise > 0.0 || bound < 2.0 * steepest, "{joints} joints: {steepest}, bound {bound}");
        }
    }
}

#[test]
fn tangents_make_a_potential_more_accurate_than_differences() {
    for (joints, count) in [(2, 9), (2, 17), (3, 7), (3, 13), (4, 9)] {
        let mut data = waves(grid(&vec![(-0.401, 0.8 / (count - 1) as f64, count); joints]));
        let mut tangents = Vec::new();
        for point in 0..data.grid.points() {
            let (w, slope, second) = wavy_root(&data.grid.configuration(point));
            let entry = |a: usize, b: usize| (-slope[a] * slope[b] - w * second[a][b]) as f32;
            tangents.extend((0..joints).flat_map(|a| (0..=a).map(move |b| (a, b))).map(|(a, b)| entry(a, b)));
        }
        let slope = vector(&vec![SOFT; joints]);
        let error = |data: &Dataset| {
            let field = TorqueField::interpolated(data, Interpolation::Potential, 0.5, &slope).unwrap();
            let (mut sum, mut whole) = (0.0, 0.0);
            for k in 0..3000 {
                let q = place(joints, k);
                let exact = wave(&q).0;
                let found = field.sample(&q).torque;
                sum += exact.iter().zip(found.iter()).map(|(a, b)| (a - b).powi(2)).sum::<f64>();
                whole += exact.dot(&exact);
            }
            (sum / whole).sqrt()
        };
        let without = error(&data);
        data.tangent = Some(tangents.into());
        let with = error(&data);
        // Measured: 0.21, 0.48, 0.26, 0.28 and 0.35.
        assert!(with < 0.6 * without, "{joints} joints, {count} lines: {with} with tangents, {without} without");
    }
}

#[test]
fn a_store_of_one_level_is_the_grid_of_its_nodes() {
    for (joints, count) in [(1, 9), (2, 6), (3, 5), (4, 4), (6, 2)] {
        // In contact everywhere: free points are continued in two ways.
        let deep = |q: &[f64]| {
            let (w, slope, second) = wavy_root(q);
            (w + 2.0, slope, second)
        };
        let mut data = Dataset::of_field(grid(&vec![(-0.401, 0.8 / (count - 1) as f64, count); joints]), |q| {
            let (w, mut tau, _) = deep(q);
            tau.iter_mut().for_each(|slope| *slope *= -w);
            (tau, 0.5 * w * w, Status::Contact)
        });
        let tangent = |point: usize| -> Vec<f64> {
            let (w, slope, second) = deep(&data.grid.configuration(point));
            let entry = |(a, b): (usize, usize)| -slope[a] * slope[b] - w * second[a][b];
            (0..joints).flat_map(|a| (0..=a).map(move |b| (a, b))).map(entry).collect()
        };
        let tangents: Vec<Vec<f64>> = (0..data.grid.points()).map(tangent).collect();
        let space = Space::new(&data.grid, 1).unwrap();
        let mut store = Store::new(space.clone());
        let blocks: BTreeSet<Place> = space.base_nodes().map(|node| space.block_of(&node)).collect();
        for block in blocks {
            let mut nodes = Nodes::default();
            for (place, node) in space.nodes(0, &block) {
                let point = data.grid.point(node.map(|line| line as usize));
                let energy = data.energy.as_ref().unwrap()[point];
                let record = root_of(energy, data.torque(point), Some(&tangents[point]));
                nodes.push(place, &record.iter().map(|x| *x as f32).collect::<Vec<_>>(), &[], 0.0, Status::Contact);
            }
            store.publish(0, &block, nodes).unwrap();
        }
        let base = data.grid.clone();
        let stored = Dataset::refined(Arc::new(store), base, None, String::new(), Provenance::default());
        data.tangent = Some(tangents.concat().into_iter().map(|x| x as f32).collect::<Vec<_>>().into());
        let [dense, stored] = [&data, &stored].map(|data| field_of(data, Interpolation::Potential));
        let slopes = vector(&vec![1.5; joints]);
        let [a, b] = [&dense, &stored].map(|field| field.relative_stiffness(&slopes));
        // Numbers of the store are f32: w, below four, is rounded by so much, its derivatives over a cell by six times
        // as much at most for each step, along each joint.
        let rounding = 4.0 * f64::from(f32::EPSILON) * joints as f64;
        let rate = 6.0 / (data.grid.axes[0].step);
        assert!((a - b).abs() < 4.0 * rate * rate * rounding, "{joints} joints: {a} and {b}");
        for k in 0..200 {
            let q = place(joints, k);
            let (a, b) = (dense.sample(&q), stored.sample(&q));
            let apart = a.torque.iter().zip(b.torque.iter()).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
            let energies = (a.energy - b.energy).abs();
            assert!(
                apart < 4.0 * rate * rounding && energies < 4.0 * rounding,
                "{joints} joints at {q:?}: {apart}, {energies}"
            );
            assert!(
                (a.index - b.index).abs() < 1e-14 && (a.contact, a.flags) == (b.contact, b.flags),
                "{a:?} and {b:?}"
            );
        }
    }
}
