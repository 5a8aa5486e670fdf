//! Many look-ups at once, on all cores: row k of an output is made from row k of the configurations.

use super::TorqueField;
use crate::{Error, error, names::counted};
use rayon::prelude::*;

/// Rows that one thread takes at a time: some tens of microseconds of work, beside which sharing them out costs
/// nothing.
const SHARE: usize = 256;

fn other_length(buffer: &str, found: usize, expected: usize, [rows, joints]: [usize; 2]) -> Error {
    error!(
        "the {buffer} hold {} where {expected} are needed: {} of {}",
        counted(found, ["number", "numbers"]),
        counted(rows, ["configuration", "configurations"]),
        counted(joints, ["joint", "joints"])
    )
}

/// Checks `configurations`, `joints` coordinates each, and returns their number.
///
/// # Errors
/// When they are not whole rows of finite numbers.
pub fn check_rows(configurations: &[f64], joints: usize) -> Result<usize, Error> {
    let (found, rows) = (configurations.len(), configurations.len() / joints);
    if rows * joints != found {
        let (buffer, expected) = ("configurations", (rows + 1) * joints);
        return Err(other_length(buffer, found, expected, [rows, joints]));
    }
    match configurations.iter().position(|coordinate| !coordinate.is_finite()) {
        Some(entry) => {
            let (joint, row) = (entry % joints, entry / joints);
            Err(error!("coordinate {joint} of configuration {row} is not a finite number (both counted from 0)"))
        }
        None => Ok(rows),
    }
}

/// Fills the rows of `out` on all cores: `write` makes each of a configuration, a row of `joints` coordinates
/// (rad or m). Few rows are filled on the calling thread.
///
/// # Errors
/// When `configurations` are not whole rows of finite numbers, or `out` is not as many whole rows.
pub fn fill_rows<T: Send>(
    configurations: &[f64],
    joints: usize,
    out: &mut [T],
    write: impl Fn(&[f64], &mut [T]) + Sync,
) -> Result<(), Error> {
    let rows = check_rows(configurations, joints)?;
    let width = out.len().checked_div(rows).unwrap_or(0);
    if width * rows != out.len() {
        let (found, expected) = (out.len(), (width + 1) * rows);
        return Err(other_length("results", found, expected, [rows, joints]));
    }
    if width > 0 {
        let write_all = |q: &[f64], out: &mut [T]| {
            q.chunks_exact(joints).zip(out.chunks_exact_mut(width)).for_each(|(q, out)| write(q, out))
        };
        fill((configurations, joints), (out, width), &write_all);
    }
    Ok(())
}

/// Fills whole rows, shares of them by `write`.
fn fill<T: Send>(
    (configurations, joints): (&[f64], usize),
    (out, width): (&mut [T], usize),
    write: &(impl Fn(&[f64], &mut [T]) + Sync),
) {
    let share = |(q, out): (&[f64], &mut [T])| write(q, out);
    if configurations.len() <= SHARE * joints {
        share((configurations, out));
    } else {
        configurations.par_chunks(SHARE * joints).zip(out.par_chunks_mut(SHARE * width)).for_each(share);
    }
}

impl TorqueField {
    /// Torques at `configurations`, one entry per joint in each row of both (rad or m; N m or N), on all cores; and
    /// where it is asked for the number of the status of each, as [`Sample::status`](super::Sample::status) reports it.
    /// The same numbers as [`TorqueField::sample`] gives.
    ///
    /// # Errors
    /// When the lengths do not fit, or a coordinate is not finite.
    pub fn torques(
        &self,
        configurations: &[f64],
        torques: &mut [f64],
        statuses: Option<&mut [u8]>,
    ) -> Result<(), Error> {
        let joints = self.joints();
        let rows = check_rows(configurations, joints)?;
        let lengths = [("torques", torques.len(), rows * joints)];
        let optional = statuses.as_ref().map(|statuses| ("statuses", statuses.len(), rows));
        for (buffer, found, expected) in lengths.into_iter().chain(optional) {
            if found != expected {
                return Err(other_length(buffer, found, expected, [rows, joints]));
            }
        }
        let Some(statuses) = statuses else {
            fill((configurations, joints), (torques, joints), &|q, torques| self.interpolant.torques(q, torques));
            return Ok(());
        };
        let rows = configurations.par_chunks_exact(joints).zip(torques.par_chunks_exact_mut(joints)).zip(statuses);
        rows.with_min_len(SHARE).for_each(|((q, torque), status)| {
            let sample = self.sample(q);
            torque.copy_from_slice(&sample.torque);
            *status = sample.status() as u8;
        });
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        JointVector,
        field::Sample,
        fixtures::grids::{grid, half_space},
        scene::Interpolation,
    };

    fn field(joints: usize) -> TorqueField {
        let data = half_space(grid(&vec![(-0.6, 0.3, 5); joints]), 5.0);
        TorqueField::interpolated(&data, Interpolation::Linear, 0.5, &JointVector::from_slice(&vec![15.0; joints]))
            .unwrap()
    }

    #[test]
    fn a_batch_gives_the_same_bits_as_its_look_ups_one_by_one() {
        for joints in 1..=3 {
            let field = field(joints);
            for rows in [0, 1, SHARE, SHARE + 1, 5 * SHARE + 7] {
                let q: Vec<f64> = (0..rows * joints).map(|k| (k as f64 * 0.7).sin()).collect();
                let mut torques = vec![f64::NAN; q.len()];
                let mut statuses = vec![u8::MAX; rows];
                field.torques(&q, &mut torques, Some(&mut statuses)).unwrap();
                let samples: Vec<Sample> = q.chunks_exact(joints).map(|q| field.sample(q)).collect();
                let one_by_one: Vec<f64> = samples.iter().flat_map(|sample| sample.torque.to_vec()).collect();
                assert_eq!(torques, one_by_one, "{rows} rows of {joints}");
                assert!(samples.iter().zip(&statuses).all(|(sample, status)| sample.status() as u8 == *status));
                torques.fill(f64::NAN);
                field.torques(&q, &mut torques, None).unwrap();
                assert_eq!(torques, one_by_one, "{rows} rows of {joints}");
                assert!(rows < SHARE || torques.iter().any(|tau| *tau != 0.0));
            }
        }
    }

    #[test]
    fn what_is_no_batch_is_refused_and_nothing_written() {
        let field = field(2);
        let mut out = [7.0; 4];
        let refused = |done: Result<(), Error>| done.unwrap_err().to_string();
        let length = |buffer, found, expected, rows| other_length(buffer, found, expected, [rows, 2]).to_string();
        assert_eq!(refused(field.torques(&[0.0; 3], &mut out, None)), length("configurations", 3, 4, 1));
        assert_eq!(refused(field.torques(&[0.0; 6], &mut out, None)), length("torques", 4, 6, 3));
        assert_eq!(refused(field.torques(&[0.0; 4], &mut out, Some(&mut [0; 3]))), length("statuses", 3, 2, 2));
        assert_eq!(refused(fill_rows(&[0.0; 6], 2, &mut out, |_, _| ())), length("results", 4, 6, 3));
        for bad in [f64::NAN, f64::INFINITY] {
            let refused = refused(field.torques(&[0.3, 0.3, 0.3, bad], &mut out, None));
            assert!(refused.starts_with("coordinate 1 of configuration 1"), "{refused}");
        }
        assert_eq!(out, [7.0; 4]);
    }
}
