//! The facts that a field has at each grid point beside numbers that are interpolated, and those where nothing was
//! computed.

use super::{Flags, Sample, unfit};
use crate::{
    Error, JointVector,
    contact::Status,
    dataset::{Dataset, Grid, check::lengths},
    input::GREATEST_INPUT,
    joint_matrix, memory,
};
use std::collections::VecDeque;

/// Values of a grid point that are not interpolated.
#[derive(Clone, Copy)]
pub(super) struct Point {
    /// Object nodes in contact.
    pub contacts: u32,
    pub flags: Flags,
    /// A torque is stored: contact, unconverged or overflowed.
    pub in_contact: bool,
    /// Contact index Ic: that of the nearest point that was computed, lest a missing measurement be taken for a
    /// boundary of the object.
    pub touching: bool,
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
        let in_contact = status.is_in_contact();
        Self { contacts, flags, in_contact, touching: in_contact }
    }

    /// Whether the point was computed.
    pub fn is_present(&self) -> bool {
        !self.flags.contains(Flags::ABSENT)
    }

    /// Whether its torque is minus the gradient of its energy.
    pub fn is_converged(&self) -> bool {
        !self.flags.contains(Flags::UNCONVERGED)
    }
}

/// What the points around a configuration tell beside numbers that are interpolated.
pub(super) struct Around {
    /// One inside the grid, falling to zero one cell outside.
    pub fade: f64,
    /// Factor on interpolated contact forces inside the grid, 0 to 1.
    pub share: f64,
    pub flags: Flags,
    /// Interpolated contact index, 0 to 1.
    pub index: f64,
    /// Object nodes in contact at the heaviest corner in contact.
    pub contact_nodes: u32,
}

impl Around {
    /// What `points` tell at `corners` with their weights.
    pub fn of(points: &[Point], fade: f64, corners: impl Iterator<Item = (usize, f64)>) -> Self {
        let mut around = Self { fade, share: 1.0, flags: Flags::empty(), index: 0.0, contact_nodes: 0 };
        let mut heaviest = 0.0;
        for (point, weight) in corners.filter(|(_, weight)| *weight > 0.0) {
            let corner = points[point];
            around.flags |= corner.flags;
            around.index += if corner.touching { weight } else { 0.0 };
            if corner.in_contact && weight > heaviest {
                (around.contact_nodes, heaviest) = (corner.contacts, weight);
            }
        }
        around
    }

    /// The field where `torque` and `energy` were interpolated, beyond the object's boundary if `inside`.
    pub fn sample(self, mut torque: JointVector, energy: f64, inside: bool) -> Sample {
        torque.iter_mut().for_each(|tau| *tau *= self.fade);
        let contact = inside && self.fade > 0.0;
        let mut flags = self.flags;
        flags.set(Flags::OUTSIDE, self.fade < 1.0);
        Sample {
            torque,
            index: self.index,
            contact,
            contact_nodes: if contact { self.contact_nodes } else { 0 },
            energy,
            share: self.share * self.fade,
            twin: 0.0,
            flags,
        }
    }
}

/// A dataset whose columns have been checked, point by point.
pub(super) struct Checked<'a> {
    pub dataset: &'a Dataset,
    pub points: Vec<Point>,
    /// For each point the nearest one that was computed; itself if it was.
    pub nearest: Vec<usize>,
}

impl<'a> Checked<'a> {
    /// Checks `dataset`.
    pub fn new(dataset: &'a Dataset) -> Result<Self, Error> {
        lengths(dataset).map_err(|what| unfit(format!("the dataset's {what}: bake it again")))?;
        let (grid, count) = (&dataset.grid, dataset.grid.points());
        // Facts of each point and the number of another, and what is found from these beside them.
        memory::check(count.saturating_mul(2 * (size_of::<Point>() + size_of::<usize>())))
            .map_err(|shortage| unfit(format!("the dataset's {count} grid points: {shortage}")))?;
        let mut points: Vec<Point> = (0..count).map(|point| Point::of(dataset, point)).collect();
        let nearest = nearest_present(grid, &points)
            .ok_or_else(|| unfit("no grid point of the dataset was computed: finish the bake first"))?;
        for (point, &source) in nearest.iter().enumerate() {
            points[point].touching = points[source].in_contact;
        }
        Ok(Self { dataset, points, nearest })
    }

    /// tau of `point`, or of the nearest that was computed; zeros where that is free.
    pub fn torque<'b>(&'b self, point: usize, zeros: &'b [f64]) -> Result<&'b [f64], Error> {
        let source = self.nearest[point];
        let torque = if self.points[source].in_contact { self.dataset.torque(source) } else { zeros };
        torque.iter().try_for_each(|&tau| plausible("torque", source, tau))?;
        Ok(torque)
    }

    /// Lower triangle of d tau/d q of `point` (N m/rad), where it is known and belongs to the energy.
    pub fn tangent(&self, point: usize) -> Option<&[f32]> {
        let entries = joint_matrix::entries(self.dataset.grid.joints());
        let tangent = self.dataset.tangent.as_ref()?.get(point * entries..(point + 1) * entries)?;
        (self.points[point].is_converged() && tangent.iter().any(|entry| *entry != 0.0)).then_some(tangent)
    }

    /// U of `point`, or of the nearest that was computed; zero where the dataset has none (J).
    pub fn energy(&self, point: usize) -> Result<f64, Error> {
        let source = self.nearest[point];
        let energy = self.dataset.energy.as_ref().map_or(0.0, |energy| energy[source]);
        plausible("energy", source, energy)?;
        Ok(energy)
    }
}

/// Whether `value` of `column` may enter the loop.
pub(super) fn plausible(column: &str, point: usize, value: f64) -> Result<(), Error> {
    // False for what is not a number.
    if value.abs() <= GREATEST_INPUT {
        return Ok(());
    }
    Err(unfit(format!("the dataset's {column} at grid point {point} is {value}: bake it again")))
}

/// For each grid point the nearest one that was computed, in steps along the axes; itself if it was. `None` if none
/// was.
fn nearest_present(grid: &Grid, points: &[Point]) -> Option<Vec<usize>> {
    let mut nearest: Vec<Option<usize>> = vec![None; points.len()];
    let mut queue = VecDeque::new();
    // Points in contact come first: where both are as near, the absent point counts as in contact.
    for in_contact in [true, false] {
        for (point, slot) in nearest.iter_mut().enumerate() {
            if points[point].in_contact == in_contact && points[point].is_present() {
                *slot = Some(point);
                queue.push_back(point);
            }
        }
    }
    while let Some(point) = queue.pop_front() {
        for neighbour in grid.neighbours(point).flatten().flatten() {
            if nearest[neighbour].is_none() {
                nearest[neighbour] = nearest[point];
                queue.push_back(neighbour);
            }
        }
    }
    nearest.into_iter().collect()
}

/// How far all points are from those that `known` marks, in steps along the axes.
pub(super) struct Generations {
    /// Steps to the nearest known point; `u32::MAX` where nothing is known.
    pub steps: Vec<u32>,
    /// The other points, nearest first.
    pub outwards: Vec<usize>,
}

impl Generations {
    /// Counts the steps, outwards from what is known.
    pub fn new(grid: &Grid, known: impl Fn(usize) -> bool) -> Self {
        let mut steps: Vec<u32> = (0..grid.points()).map(|p| if known(p) { 0 } else { u32::MAX }).collect();
        let mut queue: VecDeque<usize> = (0..grid.points()).filter(|&p| steps[p] == 0).collect();
        let mut outwards = Vec::new();
        while let Some(point) = queue.pop_front() {
            for neighbour in grid.neighbours(point).flatten().flatten() {
                if steps[neighbour] == u32::MAX {
                    steps[neighbour] = steps[point] + 1;
                    queue.push_back(neighbour);
                    outwards.push(neighbour);
                }
            }
        }
        Self { steps, outwards }
    }

    /// The neighbours of `point` that are one step nearer to what is known: axis, distance of `point` from them along
    /// it (with its sign), and point.
    pub fn nearer<'a>(&'a self, grid: &'a Grid, point: usize) -> impl Iterator<Item = (usize, f64, usize)> + 'a {
        grid.neighbours(point).enumerate().flat_map(move |(axis, [before, after])| {
            let step = grid.axes[axis].step;
            let nearer = move |p: &usize| self.steps[*p] < self.steps[point];
            let before = before.filter(nearer).map(|p| (axis, step, p));
            before.into_iter().chain(after.filter(nearer).map(|p| (axis, -step, p)))
        })
    }
}
