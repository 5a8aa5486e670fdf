//! Samples made ready for a triangulation: scaled, merged, checked for extent, and jittered.
//!
//! Delaunay triangulations depend on the metric. Joints of one unit keep theirs: all angles are divided by the widest
//! extent among the angles, all lengths by the widest among the lengths, so that each group fits the unit box and
//! radians are never weighed against metres by their accidental size. With joints of a single unit this is the
//! triangulation of the raw coordinates.
//!
//! Samples within [`MERGE_DISTANCE`] are averaged into one point: duplicates have no triangulation. The jitter is a
//! hash of a point's own coordinates, hence the same in every run and in any order.

use super::samples::Samples;
use crate::{Error, MAX_AXES, error, names::counted, random::mix};
use rayon::prelude::*;
use std::collections::HashMap;

/// Samples closer than this fraction of the extent are one point: far below any encoder's resolution (a 16-bit encoder
/// over the range resolves 1.5e-5), far above rounding.
pub const MERGE_DISTANCE: f64 = 1e-9;

/// Greatest displacement of a point before it is tetrahedralised, as a fraction of the extent. Without it every cell
/// of an exact grid is cospherical and each predicate runs its exact branch. It must exceed the predicates' static
/// error, about 1e-15 of the products involved, by a margin for cells of 1/100 of the extent.
pub const JITTER: f64 = 1.0 / (1_u64 << 40) as f64;

/// Extent of the samples off the best line or plane below which they count as flat: less than an encoder resolves.
const FLAT_CLOUD: f64 = 1e-6;

/// Points whose spacing is looked at (1): the median of so many is known to some percent.
const SPACING_POINTS: usize = 100;

/// Sine of the least angle between a direction and those before it (1): thirty degrees, far above what bends the lines of a
/// scan.
const OTHER_DIRECTION: f64 = 0.5;

/// A position in scaled C-space; entries beyond the number of joints are zero.
pub(super) type Position = [f64; MAX_AXES];

/// Distinct points in scaled C-space with the averaged torque of each.
pub(super) struct Cloud {
    /// Number of joints d.
    pub joints: usize,
    /// Scaled position = (q - origin) * scale.
    origin: Position,
    scale: Position,
    /// Scaled positions.
    pub positions: Vec<Position>,
    /// Torque, joint fastest.
    pub torques: Vec<f64>,
    /// Variance of each torque, laid out alike; empty where none was measured.
    pub variances: Vec<f64>,
    /// Mean of all positions, inside the convex hull.
    pub centre: Position,
    /// d + 1 points that span a simplex of good volume.
    pub spanning: Vec<u32>,
    /// How many samples were averaged into others.
    pub merged: usize,
}

/// The error of so few distinct samples that they cannot span `joints` joints.
fn too_few(have: usize, joints: usize) -> Error {
    let need = joints + 1;
    error!(
        "{} cannot span {}; at least {need} are needed",
        counted(have, ["distinct sample", "distinct samples"]),
        counted(joints, ["joint", "joints"])
    )
}

impl Cloud {
    /// Scales and merges `samples`, which must have passed [`Samples::check`].
    pub fn new(samples: &Samples) -> Result<Self, Error> {
        let joints = samples.joints.len();
        let need = joints + 1;
        if samples.len() < need {
            return Err(too_few(samples.len(), joints));
        }
        let (origin, scale) = frame(samples)?;
        let mut cloud = Self {
            joints,
            origin,
            scale,
            positions: Vec::new(),
            torques: Vec::new(),
            variances: Vec::new(),
            centre: [0.0; MAX_AXES],
            spanning: Vec::new(),
            merged: 0,
        };
        cloud.merge(samples);
        if cloud.positions.len() < need {
            return Err(too_few(cloud.positions.len(), joints));
        }
        for position in &cloud.positions {
            for (sum, x) in cloud.centre.iter_mut().zip(position) {
                *sum += x / cloud.positions.len() as f64;
            }
        }
        cloud.spanning = spanning_simplex(&cloud.positions, joints)?;
        Ok(cloud)
    }

    /// `q` in scaled coordinates.
    pub fn scaled(&self, q: &[f64]) -> Position {
        let mut position = [0.0; MAX_AXES];
        for (joint, x) in position.iter_mut().enumerate().take(self.joints) {
            *x = (q[joint] - self.origin[joint]) * self.scale[joint];
        }
        position
    }

    /// Length of a move by `steps`, one a joint, in scaled coordinates (1).
    pub fn length(&self, steps: &[f64]) -> f64 {
        steps.iter().zip(&self.scale).map(|(step, scale)| (step * scale).powi(2)).sum::<f64>().sqrt()
    }

    /// How far `length` in scaled coordinates is along each joint (rad or m).
    pub fn unscaled(&self, length: f64) -> Vec<f64> {
        self.scale.iter().take(self.joints).map(|scale| length / scale).collect()
    }

    /// Spacing of the points, scaled: the distance from a point to the nearest ones that together span all directions,
    /// median over points. Lines of a scan are finely divided along their depth; what counts is the way to the next line.
    pub fn spacing(&self) -> f64 {
        let every = self.positions.len().div_ceil(SPACING_POINTS);
        let points = (0..self.positions.len()).into_par_iter().step_by(every);
        let mut spacings: Vec<f64> = points.map(|point| self.spacing_at(point)).collect();
        let middle = spacings.len() / 2;
        *spacings.select_nth_unstable_by(middle, f64::total_cmp).1
    }

    fn spacing_at(&self, point: usize) -> f64 {
        let mut basis: Vec<Position> = Vec::with_capacity(self.joints);
        let mut spacing = 0.0;
        while basis.len() < self.joints {
            let mut nearest = (f64::INFINITY, [0.0; MAX_AXES]);
            for other in &self.positions {
                let offset: Position = std::array::from_fn(|axis| other[axis] - self.positions[point][axis]);
                let square = dot(&offset, &offset);
                if square >= nearest.0 {
                    continue;
                }
                let mut rest = offset;
                for direction in &basis {
                    let along = dot(&offset, direction);
                    rest.iter_mut().zip(direction).for_each(|(x, n)| *x -= along * n);
                }
                let length = dot(&rest, &rest).sqrt();
                if length > OTHER_DIRECTION * square.sqrt() {
                    nearest = (square, rest.map(|x| x / length));
                }
            }
            // Where all others lie in fewer directions, this point has no spacing.
            spacing = nearest.0.sqrt();
            if spacing.is_infinite() {
                break;
            }
            basis.push(nearest.1);
        }
        spacing
    }

    /// Torque of point `point`.
    pub fn torque(&self, point: u32) -> &[f64] {
        let start = point as usize * self.joints;
        &self.torques[start..start + self.joints]
    }

    /// Positions moved by up to `most` along each axis, so that no d + 2 are cospherical.
    pub fn jittered(&self, most: f64) -> Vec<Position> {
        self.positions.iter().map(|position| jitter(position, self.joints, most)).collect()
    }

    fn merge(&mut self, samples: &Samples) {
        let joints = self.joints;
        let mut cells: HashMap<[i64; MAX_AXES], usize> = HashMap::with_capacity(samples.len());
        let mut counts: Vec<f64> = Vec::new();
        let rows = samples.configurations.chunks_exact(joints).zip(samples.torques.chunks_exact(joints));
        for (sample, (q, torque)) in rows.enumerate() {
            let squares = samples.deviations.iter().flat_map(|column| &column[sample * joints..(sample + 1) * joints]);
            let squares = squares.map(|deviation| deviation * deviation);
            let position = self.scaled(q);
            let cell = position.map(|x| (x / MERGE_DISTANCE).round() as i64);
            let point = *cells.entry(cell).or_insert(counts.len());
            if point == counts.len() {
                counts.push(1.0);
                self.positions.push(position);
                self.torques.extend_from_slice(torque);
                self.variances.extend(squares);
            } else {
                counts[point] += 1.0;
                self.merged += 1;
                for (mean, value) in self.positions[point].iter_mut().zip(position) {
                    *mean += (value - *mean) / counts[point];
                }
                for (mean, value) in self.torques[point * joints..].iter_mut().zip(torque) {
                    *mean += (value - *mean) / counts[point];
                }
                // Variance of a mean of independent values: sum of variances over the square of their number.
                let kept = ((counts[point] - 1.0) / counts[point]).powi(2);
                for (variance, square) in self.variances.iter_mut().skip(point * joints).zip(squares) {
                    *variance = kept * *variance + square / counts[point].powi(2);
                }
            }
        }
    }
}

/// Origin and scale of the unit box of each unit.
fn frame(samples: &Samples) -> Result<(Position, Position), Error> {
    let joints = samples.joints.len();
    let mut low = [0.0; MAX_AXES];
    let mut extent = [0.0; MAX_AXES];
    for joint in 0..joints {
        let [least, greatest] = samples.range(joint);
        (low[joint], extent[joint]) = (least, greatest - least);
        if !extent[joint].is_finite() || extent[joint] <= f64::MIN_POSITIVE {
            let joint = &samples.joints[joint].name;
            return Err(error!(
                "joint `{joint}` has the same position in every sample: leave it out, or move it in the scan"
            ));
        }
    }
    let mut scale = [0.0; MAX_AXES];
    for (scale, label) in scale.iter_mut().zip(&samples.joints) {
        let group = samples.joints.iter().zip(extent).filter(|(other, _)| other.unit == label.unit);
        *scale = 1.0 / group.map(|(_, extent)| extent).fold(0.0, f64::max);
    }
    Ok((low, scale))
}

/// Grows a simplex by the point farthest from the span of those chosen before; refuses a cloud that is flat.
fn spanning_simplex(positions: &[Position], joints: usize) -> Result<Vec<u32>, Error> {
    let origin = positions[0];
    let mut residuals: Vec<Position> =
        positions.iter().map(|position| std::array::from_fn(|joint| position[joint] - origin[joint])).collect();
    let mut chosen = vec![0];
    for rank in 0..joints {
        let length = |r: &Position| dot(r, r);
        let (farthest, square) = residuals
            .iter()
            .enumerate()
            .map(|(point, residual)| (point, length(residual)))
            .fold((0, 0.0), |best, next| if next.1 > best.1 { next } else { best });
        let distance = square.sqrt();
        if distance < FLAT_CLOUD {
            return Err(error!(
                "the samples span only {rank} of {joints} joint directions (thickness {distance:.1e} of the extent): \
                 measure off that line or plane too, or leave out a joint"
            ));
        }
        let direction = residuals[farthest].map(|x| x / distance);
        for residual in &mut residuals {
            let along = dot(residual, &direction);
            for (x, n) in residual.iter_mut().zip(direction) {
                *x -= along * n;
            }
        }
        chosen.push(farthest as u32);
    }
    Ok(chosen)
}

/// Inner product of two positions.
pub(super) fn dot(a: &Position, b: &Position) -> f64 {
    a.iter().zip(b).map(|(x, y)| x * y).sum()
}

/// Squared distance of two positions.
pub(super) fn distance_squared(a: &Position, b: &Position) -> f64 {
    a.iter().zip(b).map(|(x, y)| (x - y) * (x - y)).sum()
}

/// `position` moved along each axis by a hash of its coordinates, by at most `most`.
fn jitter(position: &Position, joints: usize, most: f64) -> Position {
    let mut seed = position.iter().fold(0, |seed, x| mix(seed ^ x.to_bits()));
    let mut moved = *position;
    for x in moved.iter_mut().take(joints) {
        seed = mix(seed);
        let unit = (seed >> 11) as f64 / (1_u64 << 52) as f64 - 1.0;
        *x += most * unit;
    }
    moved
}
