//! The contact torque as a function of configuration: interpolation over the dataset's grid (section 3.1).
//!
//! `tau(q) = sum_c w_c tau_c` over the 2^d corners of the cell around q, then the boundary layer (`boundary.rs`), then
//! the fade outside the grid (`stencil.rs`). The contact index `I(q) = sum_c w_c I_c` has I_c = 1 where a torque is
//! stored (contact, unconverged, overflowed) and 0 at free points. Points that were not computed or measured carry zero
//! torque, so that the torque fades out over the cells towards them; their index and energy are those of the nearest
//! point that was, lest a missing measurement be taken for a boundary of the object.
//!
//! A field owns a copy of what it needs, interleaved point by point: `tau_0 .. tau_{d-1}, level, U`. The real-time
//! thread thus never touches a mapped file, which would end the process when somebody else truncates it.

use super::{
    boundary::BoundaryLayer,
    flags::Flags,
    stencil::{Lattice, LatticeError},
};
use crate::{JointVector, MAX_JOINTS, contact::Status, dataset::Dataset, tolerances::GREATEST_INPUT};
use std::collections::VecDeque;

/// The contact torque around one object.
pub struct TorqueField {
    lattice: Lattice,
    layer: BoundaryLayer,
    /// `joints + 2` numbers a grid point: torque, level (see `boundary.rs`), energy.
    records: Vec<f64>,
    points: Vec<Point>,
    has_energy: bool,
}

/// What is not interpolated.
#[derive(Clone, Copy)]
struct Point {
    /// Object nodes in contact.
    contacts: u32,
    flags: Flags,
    in_contact: bool,
}

/// The field at one configuration.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sample {
    /// tau_bar on the proxy [N m or N].
    pub torque: JointVector,
    /// Interpolated contact index, 0 to 1.
    pub index: f64,
    /// Whether the index exceeds the threshold Ith, beside at least one point that was computed.
    pub contact: bool,
    /// Object nodes in contact at the heaviest corner in contact; 0 out of contact.
    pub contact_nodes: u32,
    /// Interpolated energy U of the object [J]; zero for datasets without it.
    pub energy: f64,
    /// Factor on the interpolated torque, 0 to 1: boundary layer and fade together. Contact forces take the same.
    pub share: f64,
    /// [`Flags::OUTSIDE`], [`Flags::ABSENT`], [`Flags::UNCONVERGED`], [`Flags::LAYER`].
    pub flags: Flags,
}

/// A dataset cannot be rendered.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum FieldError {
    /// Its grid is none.
    #[error(transparent)]
    Grid(#[from] LatticeError),
    /// A column's length does not fit the grid.
    #[error("the dataset's {column} has {found} entries where its grid asks for {expected}: bake it again")]
    Length {
        /// Name of the column.
        column: &'static str,
        /// Entries that the grid asks for.
        expected: usize,
        /// Entries found.
        found: usize,
    },
    /// A torque or an energy is not a number, or beyond anything physical.
    #[error("the dataset's {column} at grid point {point} is {value}: bake it again")]
    Value {
        /// Name of the column.
        column: &'static str,
        /// Number of the grid point.
        point: usize,
        /// What is there.
        value: f64,
    },
    /// Not a single grid point was computed.
    #[error("no grid point of the dataset was computed: finish the bake first")]
    Empty,
    /// The threshold is not in 0 <= Ith < 1.
    #[error("the contact index threshold is {0}; it must be at least 0 and below 1 (the paper uses 0.5)")]
    Threshold(f64),
    /// The slope is not one positive number per joint.
    #[error("the boundary slope is {0:?}; it must be one positive number of N m/rad per joint of the dataset")]
    Slope(JointVector),
}

impl TorqueField {
    /// Copies what rendering needs out of `dataset`. `threshold`: Ith [1]; `slope`: Ks of the boundary layer,
    /// one per joint [N m/rad].
    ///
    /// # Errors
    /// When the dataset is not consistent, holds numbers that are not finite, or a parameter is out of its range.
    pub fn new(dataset: &Dataset, threshold: f64, slope: &JointVector) -> Result<Self, FieldError> {
        if !(0.0..1.0).contains(&threshold) {
            return Err(FieldError::Threshold(threshold));
        }
        let lattice = Lattice::new(&dataset.grid)?;
        if slope.len() != lattice.joints() || !slope.iter().all(|slope| *slope > 0.0 && slope.is_finite()) {
            return Err(FieldError::Slope(*slope));
        }
        let (joints, count) = (lattice.joints(), lattice.points());
        expect("torque", count.saturating_mul(joints), dataset.torque.len())?;
        expect("status", count, dataset.status.len())?;
        if let Some(energy) = &dataset.energy {
            expect("energy", count, energy.len())?;
        }
        if let Some(contacts) = &dataset.contacts {
            expect("contact offsets", count + 1, contacts.offsets.len())?;
        }
        let points: Vec<Point> = (0..count).map(|point| Point::of(dataset, point)).collect();
        let nearest = nearest_present(&lattice, &points).ok_or(FieldError::Empty)?;
        let free: Vec<bool> = nearest.iter().map(|&source| !points[source].in_contact).collect();
        let layer = BoundaryLayer::new(&lattice, threshold, slope);
        let mut records = Vec::with_capacity(count * (joints + 2));
        let mut greatest: f64 = 0.0;
        for (point, state) in points.iter().enumerate() {
            let zeros = JointVector::zeros(joints);
            let torque = if state.in_contact { dataset.torque(point) } else { &zeros };
            torque.iter().try_for_each(|&tau| plausible("torque", point, tau))?;
            greatest = greatest.max(layer.size(torque));
            let energy = dataset.energy.as_ref().map_or(0.0, |energy| energy[nearest[point]]);
            plausible("energy", nearest[point], energy)?;
            records.extend_from_slice(torque);
            records.extend([0.0, energy]);
        }
        for (record, level) in records.chunks_exact_mut(joints + 2).zip(layer.levels(&lattice, &free, greatest)) {
            record[joints] = level;
        }
        Ok(Self { lattice, layer, records, points, has_energy: dataset.energy.is_some() })
    }

    /// Number of joints d.
    #[must_use]
    pub fn joints(&self) -> usize {
        self.lattice.joints()
    }

    /// The grid.
    #[must_use]
    pub fn lattice(&self) -> &Lattice {
        &self.lattice
    }

    /// Whether the dataset has the energy U.
    #[must_use]
    pub fn has_energy(&self) -> bool {
        self.has_energy
    }

    /// Greatest stiffness of the interpolated torque inside the grid, before the boundary layer, relative to `slopes`,
    /// one per joint [N m/rad]: the greatest Frobenius norm of `S^-1/2 (d tau/d q) S^-1/2`, S = diag(slopes). One or
    /// less: nowhere steeper than `slopes`. It is the layer's Lipschitz bound L for `slopes` = Ks.
    ///
    /// The gradient is affine in each coordinate of a cell, so that its norm is greatest at a corner, where its columns
    /// are the differences along the edges that meet there.
    #[must_use]
    pub fn relative_stiffness(&self, slopes: &JointVector) -> f64 {
        let joints = self.joints();
        let torque = |point: usize| &self.records[point * (joints + 2)..point * (joints + 2) + joints];
        let steepness = |p: usize, q: usize| {
            let scaled = |((a, b), slope): ((&f64, &f64), &f64)| (a - b).powi(2) / slope;
            torque(p).iter().zip(torque(q)).zip(slopes.iter()).map(scaled).sum::<f64>()
        };
        let norm = |point: usize| {
            let along = |((count, step, stride), slope): ((usize, f64, usize), &f64)| {
                let position = Lattice::position(point, count, stride);
                let below = if position > 0 { steepness(point, point - stride) } else { 0.0 };
                let above = if position + 1 < count { steepness(point, point + stride) } else { 0.0 };
                below.max(above) / (step * step * slope)
            };
            self.lattice.lines().zip(slopes.iter()).map(along).sum::<f64>()
        };
        (0..self.points.len()).map(norm).fold(0.0, f64::max).sqrt()
    }

    /// The field at `q`, one entry per joint. Never allocates; takes the same time wherever `q` is.
    #[must_use]
    pub fn sample(&self, q: &[f64]) -> Sample {
        match self.joints() {
            1 => self.sample_joints::<1>(q),
            2 => self.sample_joints::<2>(q),
            3 => self.sample_joints::<3>(q),
            4 => self.sample_joints::<4>(q),
            5 => self.sample_joints::<5>(q),
            _ => self.sample_joints::<MAX_JOINTS>(q),
        }
    }

    fn sample_joints<const D: usize>(&self, q: &[f64]) -> Sample {
        let stencil = self.lattice.locate(q);
        let mut torque = [0.0; D];
        let (mut level, mut energy, mut index) = (0.0, 0.0, 0.0);
        let mut flags = Flags::default();
        let mut present = false;
        let (mut contact_nodes, mut heaviest) = (0, 0.0);
        for (point, weight) in stencil.corners() {
            let record = &self.records[point * (D + 2)..(point + 1) * (D + 2)];
            for (sum, tau) in torque.iter_mut().zip(record) {
                *sum += weight * tau;
            }
            level += weight * record[D];
            index += weight * record[D].min(1.0);
            energy += weight * record[D + 1];
            if weight > 0.0 {
                let corner = self.points[point];
                flags |= corner.flags;
                present |= !corner.flags.contains(Flags::ABSENT);
                if corner.in_contact && weight > heaviest {
                    (contact_nodes, heaviest) = (corner.contacts, weight);
                }
            }
        }
        let mut torque = JointVector::from_slice(&torque);
        let held = self.layer.share(&torque, level);
        if held < 1.0 {
            flags |= Flags::LAYER;
        }
        if stencil.fade < 1.0 {
            flags |= Flags::OUTSIDE;
        }
        let share = held * stencil.fade;
        torque.iter_mut().for_each(|tau| *tau *= share);
        let contact = index > self.layer.threshold() && present && stencil.fade > 0.0;
        Sample { torque, index, contact, contact_nodes: if contact { contact_nodes } else { 0 }, energy, share, flags }
    }
}

impl Point {
    fn of(dataset: &Dataset, point: usize) -> Self {
        let status = dataset.status(point);
        let contacts = dataset.contacts.as_ref().map_or(0, |contacts| {
            let count = contacts.offsets[point + 1].saturating_sub(contacts.offsets[point]);
            u32::try_from(count).unwrap_or(u32::MAX)
        });
        let flags = match status {
            Status::Free | Status::Contact => Flags::default(),
            Status::Unconverged | Status::Overflow => Flags::UNCONVERGED,
            Status::Outside => Flags::ABSENT,
        };
        let in_contact = matches!(status, Status::Contact | Status::Unconverged | Status::Overflow);
        Self { contacts, flags, in_contact }
    }
}

fn expect(column: &'static str, expected: usize, found: usize) -> Result<(), FieldError> {
    if expected == found { Ok(()) } else { Err(FieldError::Length { column, expected, found }) }
}

fn plausible(column: &'static str, point: usize, value: f64) -> Result<(), FieldError> {
    // False for what is not a number.
    if value.abs() <= GREATEST_INPUT { Ok(()) } else { Err(FieldError::Value { column, point, value }) }
}

/// For each grid point the nearest one that was computed, in steps along the axes; itself if it was. `None` if none was.
fn nearest_present(lattice: &Lattice, points: &[Point]) -> Option<Vec<usize>> {
    let mut nearest: Vec<Option<usize>> = vec![None; points.len()];
    let mut queue = VecDeque::new();
    // Points in contact come first: where both are as near, the absent point counts as in contact.
    for in_contact in [true, false] {
        for (point, slot) in nearest.iter_mut().enumerate() {
            if points[point].in_contact == in_contact && !points[point].flags.contains(Flags::ABSENT) {
                *slot = Some(point);
                queue.push_back(point);
            }
        }
    }
    while let Some(point) = queue.pop_front() {
        for (count, _, stride) in lattice.lines() {
            let position = Lattice::position(point, count, stride);
            let below = (position > 0).then(|| point - stride);
            let above = (position + 1 < count).then(|| point + stride);
            for neighbour in below.into_iter().chain(above) {
                if nearest[neighbour].is_none() {
                    nearest[neighbour] = nearest[point];
                    queue.push_back(neighbour);
                }
            }
        }
    }
    nearest.into_iter().collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::render::synthetic::{dataset, grid, half_space};

    /// So steep a layer that it holds nothing back.
    const SOFT: f64 = 1e6;

    fn rendered(data: &Dataset, slope: f64) -> TorqueField {
        TorqueField::new(data, 0.5, &vector(&vec![slope; data.grid.joints()])).unwrap()
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
        for joints in 1..=MAX_JOINTS {
            let data = dataset(grid(&vec![(-0.4, 0.2, 5); joints]), |q| (multilinear(q), 1.0, Status::Contact));
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
    /// centred on zero [N m/rad].
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
            let wild = dataset(centred(joints, count), |q| {
                let noise = |a: usize| (q.iter().map(|x| 7e3 * x).sum::<f64>() + 5.0 * a as f64).sin();
                let status = if noise(9) > -0.3 { Status::Contact } else { Status::Free };
                (vector(&(0..joints).map(noise).collect::<Vec<_>>()), 0.0, status)
            });
            for slope in [0.1, 10.0, 1e4] {
                let field = rendered(&wild, slope);
                let slopes = vector(&vec![slope; joints]);
                let stiffness = slope * field.relative_stiffness(&slopes);
                let (steepest, bound) = (steepest(&field, count, 1.0), stiffness + slope);
                assert!(steepest <= bound * (1.0 + 1e-6), "{joints} joints: {steepest} of {bound}");
                assert!(steepest > 0.02 * stiffness.min(slope), "{joints} joints: {steepest} of {bound}");
            }
        }
    }

    #[test]
    fn a_jump_at_contact_is_felt_with_the_slope_of_the_layer_alone() {
        for (joints, count) in [(1, 9), (2, 9), (3, 9), (6, 4)] {
            // One newton metre at once, then 1 N m/rad in each joint: along a fixed direction.
            let jump = dataset(centred(joints, count), |q| {
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
        let jump = dataset(grid(&[(-0.5, 0.1, 21)]), |q| {
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
        let data = dataset(grid(&[(0.0, 0.1, 3), (0.0, 0.1, 3)]), |_| (vector(&[1.0, -2.0]), 0.0, Status::Contact));
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

    #[test]
    fn torque_fades_out_towards_absent_points_without_making_a_boundary_there() {
        let data = dataset(grid(&[(0.0, 0.1, 8)]), |q| {
            let status = if q[0] > 0.45 { Status::Outside } else { Status::Contact };
            (vector(&[if q[0] > 0.45 { f64::NAN } else { 1.0 }]), q[0], status)
        });
        let field = rendered(&data, 0.1);
        assert_eq!(field.sample(&[0.4]).torque[0], 1.0);
        let fading = field.sample(&[0.45]);
        assert!((fading.torque[0] - 0.5).abs() < 1e-12 && fading.flags.contains(Flags::ABSENT) && fading.contact);
        let gone = field.sample(&[0.65]);
        assert!(gone.torque[0] == 0.0 && gone.flags.contains(Flags::ABSENT) && !gone.contact);
    }

    #[test]
    fn unconverged_points_are_used_and_flagged() {
        let data = dataset(grid(&[(0.0, 0.1, 3)]), |q| {
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
        let new =
            |data: Dataset, threshold: f64, slope: &[f64]| TorqueField::new(&data, threshold, &vector(slope)).err();
        assert_eq!(new(good(), 0.5, &[1.0, 2.0]), None);
        assert!(matches!(new(good(), 1.0, &[1.0, 2.0]), Some(FieldError::Threshold(_))));
        assert!(matches!(new(good(), f64::NAN, &[1.0, 2.0]), Some(FieldError::Threshold(_))));
        for slope in [&[0.0, 1.0][..], &[1.0, f64::NAN], &[1.0], &[1.0, 1.0, 1.0], &[1.0, f64::INFINITY]] {
            assert!(matches!(new(good(), 0.5, slope), Some(FieldError::Slope(_))), "{slope:?}");
        }
        let mut short = good();
        short.torque = vec![0.0; 29].into();
        let expected = FieldError::Length { column: "torque", expected: 30, found: 29 };
        assert_eq!(new(short, 0.5, &[1.0, 1.0]), Some(expected));
        let mut wild = good();
        wild.torque = vec![f64::NAN; 30].into();
        assert!(matches!(new(wild, 0.5, &[1.0, 1.0]), Some(FieldError::Value { column: "torque", .. })));
        let mut nothing = good();
        nothing.status = vec![Status::Outside as u8; 15].into();
        assert_eq!(new(nothing, 0.5, &[1.0, 1.0]), Some(FieldError::Empty));
    }

    #[test]
    fn relative_stiffness_of_a_half_space_is_its_stiffness() {
        for joints in [1, 2, 4] {
            let data = half_space(centred(joints, 5), 3.0);
            let stiffness = rendered(&data, SOFT).relative_stiffness(&vector(&vec![1.5; joints]));
            assert!((stiffness - 2.0).abs() < 1e-12, "{joints} joints: {stiffness}");
        }
    }
}
