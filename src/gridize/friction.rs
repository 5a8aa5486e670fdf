//! The friction of an object, identified from logs that go to and fro.
//!
//! Where the joints go one way and the other, half the sum of the torques is the object's without friction, and half
//! their difference h its friction against that way: so it is in each cell of C-space, by the direction of a joint that
//! leads. Friction that is h along the way and nothing across is that of `R = h h^T`, which the dataset stores as a
//! normal force N = |h| and a slip Jacobian B = h h^T / |h|^2, under a coefficient of one ([`Slip`]). What friction is
//! across the way, a log that goes one way does not tell.
//!
//! At a turn friction does not change sides at once. The stiffness by which it builds up is that with which the law of
//! the loop meets the rows of the log, in their order, best. Every fourth *stroke*, from turn to turn, is held out of a
//! second identification, which has to predict it. A joint whose torque it predicts worse than without friction has none:
//! something else makes its directions differ.

use super::{
    Branches, Cells, ForceHistory, GridizeOptions, GridizeReport, LeadDirection, golden::golden_section, gridize,
};
use crate::{
    Error, JointVector,
    contact::Status,
    dataset::{Dataset, IdentifiedFriction, JointLabel, SlipColumns},
    field::{Flags, TorqueField},
    joint_matrix::entries,
    scene::{Interpolation, THRESHOLD},
};
use rayon::prelude::*;

/// Every so many strokes one is held out of the identification that predicts it (1).
const HELD_OUT: usize = 4;
/// Ways from the turn to where all of the friction acts, among which the stiffness is sought, over the side of a cell
/// (1): shorter ones a cell does not show, and longer ones than a few cells would show in its torques.
const BUILDING_UP: [f64; 2] = [0.01, 10.0];
/// Stiffnesses that are tried, a decade, and shrinkings of the interval around the best: to a part in a thousand.
const A_DECADE: f64 = 3.0;
const SHRINKINGS: usize = 14;
/// Slope of the boundary layer (N m/rad): so steep that it changes no torque.
const NO_LAYER: f64 = 1e12;

/// Logs that go to and fro.
#[derive(Clone, Copy, Debug)]
pub struct Reversals<'a> {
    /// Their rows, with the directions of the joint that leads.
    pub histories: &'a [ForceHistory],
    /// That joint.
    pub lead: usize,
    /// Sides of the cells in which rows are averaged, one a joint (rad or m).
    pub cell: &'a [f64],
}

/// Gridizes the torque without friction, and how friction acts beside it.
///
/// # Errors
/// Those of [`gridize`].
pub fn gridize_sliding(
    joints: &[JointLabel],
    reversals: &Reversals<'_>,
    options: &GridizeOptions,
) -> Result<(Dataset, GridizeReport), Error> {
    let mut has_friction = vec![true; joints.len()];
    let strokes = reversals.strokes().into_iter().flatten().max().map_or(0, |last| last + 1);
    let mut predicted = Vec::new();
    if strokes >= HELD_OUT {
        let is_out = |stroke: usize| stroke % HELD_OUT == HELD_OUT - 1;
        let (rest, ..) = reversals.gridize(joints, &has_friction, options, |stroke| !is_out(stroke))?;
        let known = reversals.stiffness(&rest, |stroke| !is_out(stroke))?;
        if let Some(known) = known {
            predicted = reversals.misfit(&rest, known, is_out)?.unwrap_or_default();
        }
    }
    has_friction.iter_mut().zip(&predicted).for_each(|(has, [with, without])| *has = with < without);
    let (mut dataset, report, deviation) = reversals.gridize(joints, &has_friction, options, |_| true)?;
    let stiffness = reversals.stiffness(&dataset, |_| true)?;
    dataset.provenance.friction =
        Some(IdentifiedFriction { coefficient: 1.0, strokes, deviation, stiffness, predicted });
    Ok((dataset, report))
}

impl Reversals<'_> {
    /// The number of the stroke of each row of each history.
    fn strokes(&self) -> Vec<Vec<usize>> {
        let mut stroke = 0;
        let of = |history: &ForceHistory| {
            let mut way = None;
            let number = |direction: &Option<LeadDirection>| {
                if direction.is_some() && way.is_some() && way != *direction {
                    stroke += 1;
                }
                way = direction.or(way);
                stroke
            };
            let numbers: Vec<usize> = history.directions.iter().map(number).collect();
            stroke += 1;
            numbers
        };
        self.histories.iter().map(of).collect()
    }

    /// The dataset of the strokes that `takes` says, with the friction of those joints that have it, and by how much that
    /// of all differs from pass to pass, over its size, rms (1).
    fn gridize(
        &self,
        joints: &[JointLabel],
        has_friction: &[bool],
        options: &GridizeOptions,
        takes: impl Fn(usize) -> bool,
    ) -> Result<(Dataset, GridizeReport, f64), Error> {
        let count = joints.len();
        let mut cells = Cells::new(self.cell);
        for (history, strokes) in self.histories.iter().zip(self.strokes()) {
            for (row, (direction, stroke)) in history.directions.iter().zip(strokes).enumerate() {
                match direction.filter(|_| takes(stroke)) {
                    Some(direction) => {
                        let [q, torque] = history.row(row, count);
                        cells.add(&q, &torque, direction)?;
                    }
                    None => cells.end_visit(),
                }
            }
            cells.end_visit();
        }
        let (mut dataset, mut report) = gridize(&cells.samples(Branches::Mean, joints), options)?;
        let halves = cells.samples(Branches::HalfDifference, joints);
        let square = |all: &[f64]| all.iter().map(|x| x * x).sum::<f64>();
        let deviation = (square(halves.deviations.as_deref().unwrap_or(&[])) / square(&halves.torques)).sqrt();
        let (friction, _) = gridize(&halves, &GridizeOptions { epsilon: Some(0.0), ..options.clone() })?;

        let points = dataset.grid.points();
        let (mut forces, mut jacobians) = (vec![0.0; points], Vec::with_capacity(points * entries(count)));
        let mut status = dataset.status.to_vec();
        for point in 0..points {
            let (centre, mut half) = (dataset.torque(point), JointVector::from_slice(friction.torque(point)));
            half.iter_mut().zip(has_friction).filter(|(_, has)| !**has).for_each(|(half, _)| *half = 0.0);
            // Where the torque is no lower on the way up, noise is all there is.
            let size = if half[self.lead] > 0.0 { half.norm() } else { 0.0 };
            forces[point] = size as f32;
            for k in 0..count {
                jacobians
                    .extend((0..=k).map(|l| if size > 0.0 { (half[k] * half[l] / (size * size)) as f32 } else { 0.0 }));
            }
            if status[point] != Status::Outside as u8 {
                let both = || centre.iter().zip(half.iter());
                let felt = |side: f64| both().map(|(centre, half)| (centre + side * half).powi(2)).sum::<f64>().sqrt();
                let touches = felt(-1.0).max(felt(1.0)) > report.epsilon;
                status[point] = if touches { Status::Contact } else { Status::Free } as u8;
            }
        }
        report.contact_points = status.iter().filter(|status| **status == Status::Contact as u8).count();
        dataset.status = status.into();
        dataset.slip = Some(SlipColumns { normal_force: forces.into(), jacobian: jacobians.into() });
        Ok((dataset, report, deviation))
    }

    /// The stiffness with which the rows of strokes that `takes` says are met best (N m/rad); `None` where no row lies
    /// inside the grid.
    fn stiffness(&self, dataset: &Dataset, takes: impl Fn(usize) -> bool + Sync) -> Result<Option<f64>, Error> {
        let forces =
            dataset.slip.iter().flat_map(|slip| slip.normal_force.iter().copied().filter(|force| *force > 0.0));
        let (count, sum) = forces.fold((0.0, 0.0), |(count, sum), force| (count + 1.0, sum + f64::from(force)));
        if count == 0.0 {
            return Ok(None);
        }
        let side = self.cell.iter().copied().fold(f64::INFINITY, f64::min);
        let [stiffest, softest] = BUILDING_UP.map(|way| (sum / count / (way * side)).ln());
        let misfit = |logarithm: f64| -> Result<f64, Error> {
            let errors = self.misfit(dataset, logarithm.exp(), &takes)?;
            Ok(errors.map_or(f64::INFINITY, |errors| errors.iter().map(|[with, _]| with * with).sum()))
        };
        let step = std::f64::consts::LN_10 / A_DECADE;
        let tries = ((stiffest - softest) / step) as usize;
        let tried: Result<Vec<f64>, Error> =
            (0..=tries).into_par_iter().map(|k| misfit(softest + step * k as f64)).collect();
        let tried = tried?;
        let best = (0..=tries).min_by(|&a, &b| tried[a].total_cmp(&tried[b])).unwrap_or(0);
        if !tried[best].is_finite() {
            return Ok(None);
        }
        let middle = softest + step * best as f64;
        let [found, _] =
            golden_section([middle - step, middle + step], SHRINKINGS, |x| misfit(x).unwrap_or(f64::INFINITY));
        Ok(Some(found.exp()))
    }

    /// Errors of `dataset` under a `stiffness`, rms over the rows of strokes that `takes` says and that lie inside its
    /// grid, a joint each: with friction, and without (N m or N). `None` where there are none.
    fn misfit(
        &self,
        dataset: &Dataset,
        stiffness: f64,
        takes: impl Fn(usize) -> bool,
    ) -> Result<Option<Vec<[f64; 2]>>, Error> {
        let joints = dataset.grid.joints();
        let slopes = std::iter::repeat_n(NO_LAYER, joints).collect();
        let field = TorqueField::interpolated(dataset, Interpolation::Linear, THRESHOLD, &slopes)?;
        let (mut count, mut squares) = (0.0, vec![[0.0; 2]; joints]);
        for (history, strokes) in self.histories.iter().zip(self.strokes()) {
            let mut deflection = JointVector::zeros(joints);
            let mut before: Option<JointVector> = None;
            for (row, stroke) in strokes.into_iter().enumerate() {
                let [q, measured] = history.row(row, joints);
                let way = q.iter().zip(before.replace(q).unwrap_or(q).iter()).map(|(q, before)| q - before).collect();
                let sample = field.sample(&q);
                let slip = field.slip(&q, &sample);
                deflection = slip.deflected(&deflection, &way).shortened(slip.normal_force / stiffness);
                if !takes(stroke) || sample.flags.intersects(Flags::OUTSIDE | Flags::ABSENT) {
                    continue;
                }
                count += 1.0;
                for (joint, [with, without]) in squares.iter_mut().enumerate() {
                    let friction = -stiffness * deflection.dot(&slip.jacobian[joint]);
                    let error = sample.torque[joint] - measured[joint];
                    *with += (error + friction).powi(2);
                    *without += error * error;
                }
            }
        }
        let root = |square: f64| (square / count).sqrt();
        Ok((count > 0.0).then(|| squares.into_iter().map(|pair| pair.map(root)).collect()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{dataset::JointLabel, random::Random};

    /// Friction of the drive and the other joint where the drive is at `q` (N m).
    fn half(q: f64) -> [f64; 2] {
        [0.04 + 0.02 * q, 0.01]
    }
    /// With which it builds up (N m/rad).
    const STIFFNESS: f64 = 5.0;

    /// A drive that swings over 1 rad, `swings` times in 20 s, and turns another joint against it, by `gear`; rows at
    /// 1 kHz.
    fn log(swings: f64, gear: f64, noise: &mut Random) -> ForceHistory {
        let (mut history, mut before, mut force) = (ForceHistory::default(), 0.5, 0.0_f64);
        for k in 0..20_000 {
            let time = 1e-3 * f64::from(k);
            let phase = std::f64::consts::TAU * swings * time / 20.0;
            let q = 0.5 + 0.5 * phase.sin();
            let [h, other] = half(q);
            let size = h.hypot(other);
            let way = [q - before, -gear * (q - before)];
            force = (force + STIFFNESS * (way[0] * h + way[1] * other) / size).clamp(-size, size);
            before = q;
            let speed = phase.cos();
            let direction = if speed > 0.0 { LeadDirection::Forward } else { LeadDirection::Backward };
            let torque = [(3.0 * q).sin() / 3.0 - force * h / size, 0.2 * q - force * other / size];
            let torque = torque.map(|tau| tau + 2e-3 * noise.normal());
            history.push(time, &[q, 0.7 - gear * q], &torque, (true, (speed.abs() > 0.05).then_some(direction)));
        }
        history
    }

    /// Grid and friction of the logs.
    fn identified(histories: &[ForceHistory]) -> Dataset {
        let joints = ["drive", "other"].map(|name| JointLabel { name: name.into(), unit: "rad".into() });
        let reversals = Reversals { histories, lead: 0, cell: &[0.01, 0.01] };
        let options = GridizeOptions { epsilon: Some(0.0), within: f64::INFINITY, ..GridizeOptions::new(vec![0.02]) };
        gridize_sliding(&joints, &reversals, &options).unwrap().0
    }

    /// What tells the directions of a joint apart from stroke to stroke otherwise is no friction.
    #[test]
    fn a_joint_whose_held_out_strokes_friction_predicts_worse_has_none() {
        let mut noise = Random::new(4);
        let mut histories = [0.4, 0.5, 0.6].map(|gear| log(10.0 * gear, gear, &mut noise));
        let strokes = Reversals { histories: &histories, lead: 0, cell: &[] }.strokes();
        for (history, strokes) in histories.iter_mut().zip(strokes) {
            for (torque, stroke) in history.torques.chunks_exact_mut(2).zip(strokes) {
                // A load on the way back that those held out do not have.
                torque[1] += if stroke % HELD_OUT == 1 { -0.05 } else { 0.05 };
            }
        }
        let dataset = identified(&histories);
        let found = dataset.provenance.friction.as_ref().unwrap();
        let [[drive, without_drive], [other, without_other]] = found.predicted[..] else { panic!("{found:?}") };
        assert!(drive < 0.5 * without_drive && other >= without_other, "{found:?}");
        let rows = dataset.slip.as_ref().unwrap();
        assert!(rows.jacobian.chunks_exact(entries(2)).all(|row| row[1..] == [0.0; 2]));
        assert!(rows.normal_force.iter().copied().fold(0.0, f32::max) > 0.03);
    }

    #[test]
    fn friction_comes_back_from_a_log_that_goes_to_and_fro_and_predicts_strokes_held_out() {
        let mut noise = Random::new(3);
        let histories = [0.4, 0.5, 0.6].map(|gear| log(10.0 * gear, gear, &mut noise));
        let dataset = identified(&histories);
        let found = dataset.provenance.friction.clone().unwrap();
        println!("{found:?}");
        assert_eq!(found.strokes, 9 + 11 + 13);
        assert!((found.stiffness.unwrap() / STIFFNESS - 1.0).abs() < 0.1, "{found:?}");
        let slip = dataset.slip.as_ref().unwrap();
        let mut seen = 0;
        for point in (0..dataset.grid.points()).filter(|&point| dataset.status(point) == Status::Contact) {
            let q = dataset.grid.configuration(point);
            if (0.1..0.9).contains(&q[0]) {
                let [h, other] = half(q[0]);
                let force = f64::from(slip.normal_force[point]);
                assert!((force / h.hypot(other) - 1.0).abs() < 0.05, "{q:?}: {force}");
                // B of the drive and the drive, and of the other and the drive.
                let row = &slip.jacobian[point * entries(2)..];
                let expected = [h * h, h * other].map(|entry| entry / (h * h + other * other));
                assert!((0..2).all(|k| (f64::from(row[k]) - expected[k]).abs() < 0.05), "{q:?}: {:?}", &row[..3]);
                seen += 1;
            }
        }
        assert!(seen > 30, "{seen}");
        let [with, without] = found.predicted[0];
        assert!(with < 4e-3 && without > 0.03, "{found:?}");
    }
}
