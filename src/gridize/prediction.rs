//! How well a gridized dataset predicts measurements that it was not made of.
//!
//! The torque of each is looked up as rendering does, multilinearly between grid points, and compared: with other logs
//! of the same object, or with a share of the samples, chosen by chance (the same ones in every run), that was left
//! out. What remains is the error of interpolation and grid together with the noise of the measurement itself: no
//! dataset can predict a measurement better than measuring again does. Samples beside grid points outside the hull are
//! not predicted.

use super::{GridizeOptions, Samples, gridize};
use crate::{Error, contact::Status, dataset::Dataset, error, names::counted};

/// Predicted beside measured torque.
#[derive(Clone, Debug, Default, PartialEq, serde::Serialize)]
pub struct Prediction {
    /// Samples to be predicted.
    pub samples: usize,
    /// Number of these that the dataset predicts.
    pub predicted: usize,
    /// Root mean square of predicted less measured torque, a joint each (N m or N).
    pub rms: Vec<f64>,
    /// Greatest of these in size, a joint each (N m or N).
    pub worst: Vec<f64>,
    /// Root mean square of the samples' own standard deviations, a joint each, where they were measured (N m or N).
    pub deviation: Option<Vec<f64>>,
}

/// Leaves out `share` of `samples` and predicts them by a dataset of the rest.
///
/// # Errors
/// When `share` leaves nothing on one side, or the rest cannot be gridized.
pub fn held_out(samples: &Samples, options: &GridizeOptions, share: f64) -> Result<Prediction, Error> {
    let (rest, left_out) = samples.split(share);
    if rest.is_empty() || left_out.is_empty() || !share.is_finite() {
        let samples = samples.len();
        return Err(error!(
            "a share of {share} of {} cannot be held out: it must leave some on both sides",
            counted(samples, ["sample", "samples"])
        ));
    }
    let (dataset, _) = gridize(&rest, options).map_err(|error| error.within("without the samples held out"))?;
    predict(&dataset, &left_out)
}

/// Predicts `samples` by `dataset`, which was not made of them.
///
/// # Errors
/// When their joints are not the dataset's.
pub fn predict(dataset: &Dataset, samples: &Samples) -> Result<Prediction, Error> {
    dataset.grid.check()?;
    let joints = dataset.grid.joints();
    if samples.joints.len() != joints {
        let found = samples.joints.len();
        return Err(error!("the samples have {}, the dataset has {joints}", counted(found, ["joint", "joints"])));
    }
    let mut found = Prediction { samples: samples.len(), ..Prediction::default() };
    let (mut squares, mut variances) = (vec![0.0; joints], vec![0.0; joints]);
    found.worst = vec![0.0; joints];
    for sample in 0..samples.len() {
        let row = sample * joints..(sample + 1) * joints;
        let Some(torque) = predicted(dataset, &samples.configurations[row.clone()]) else { continue };
        found.predicted += 1;
        for (joint, (torque, measured)) in torque.iter().zip(&samples.torques[row.clone()]).enumerate() {
            let error = torque - measured;
            squares[joint] += error * error;
            found.worst[joint] = found.worst[joint].max(error.abs());
        }
        for (sum, deviation) in variances.iter_mut().zip(samples.deviations.iter().flat_map(|all| &all[row.clone()])) {
            *sum += deviation * deviation;
        }
    }
    let root = |sums: Vec<f64>| sums.into_iter().map(|sum| (sum / found.predicted.max(1) as f64).sqrt()).collect();
    found.rms = root(squares);
    found.deviation = samples.deviations.as_ref().map(|_| root(variances));
    Ok(found)
}

/// Torque at `q` as rendering interpolates it; `None` where not all points around are inside the measured region.
fn predicted(dataset: &Dataset, q: &[f64]) -> Option<Vec<f64>> {
    let stencil = dataset.grid.locate(q);
    let mut torque = vec![0.0; q.len()];
    for (point, weight) in stencil.corners().filter(|(_, weight)| *weight > 0.0) {
        if stencil.fade < 1.0 || dataset.status(point) == Status::Outside {
            return None;
        }
        torque.iter_mut().zip(dataset.torque(point)).for_each(|(sum, value)| *sum += weight * value);
    }
    Some(torque)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::dataset::JointLabel;

    /// Samples of sin 4 q1 + q2 over a jittered lattice, each with an error of `noise` of one sign or the other.
    fn samples(noise: f64) -> Samples {
        let label = |name: &str| JointLabel { name: name.to_owned(), unit: "rad".to_owned() };
        let mut samples = Samples { joints: vec![label("a"), label("b")], ..Samples::default() };
        for k in 0..3600_u32 {
            let (i, j) = (f64::from(k % 60), f64::from(k / 60));
            let q = [0.02 * i + 0.004 * (1.7 * j).sin(), 0.02 * j + 0.004 * (2.3 * i).sin()];
            let error =
                if (f64::from(k) * 12.9898).sin().mul_add(43_758.545, 1e5).fract() < 0.5 { noise } else { -noise };
            samples.configurations.extend(q);
            samples.torques.extend([(4.0 * q[0]).sin() + q[1] + error, 2.0 * q[1]]);
        }
        samples
    }

    fn options() -> GridizeOptions {
        GridizeOptions { within: f64::INFINITY, ..GridizeOptions::new(vec![0.02]) }
    }

    #[test]
    fn smooth_torque_is_predicted_and_noise_is_not() {
        let clean = held_out(&samples(0.0), &options(), 0.1).unwrap();
        assert!((300..420).contains(&clean.samples) && clean.predicted > clean.samples * 8 / 10, "{clean:?}");
        assert!(clean.rms[0] < 2e-3 && clean.rms[1] < 1e-12, "{clean:?}");
        let noisy = held_out(&samples(0.05), &options(), 0.1).unwrap();
        // The error of a sample itself, and what is left of its neighbours' after averaging.
        assert!(noisy.rms[0] > 0.05 && noisy.rms[0] < 0.05 * 2_f64.sqrt() && noisy.rms[1] < 1e-12, "{noisy:?}");
        assert!(noisy.worst[0] > noisy.rms[0] && noisy.deviation.is_none());
    }

    #[test]
    fn another_log_is_predicted_where_it_lies_inside() {
        let (dataset, _) = gridize(&samples(0.0), &options()).unwrap();
        let mut other = samples(0.0);
        other.configurations.iter_mut().step_by(2).for_each(|q| *q += 0.007);
        other.deviations = Some([0.3, 0.1].repeat(other.len()));
        let rows = other.configurations.chunks_exact(2).map(<[f64]>::to_vec).collect::<Vec<_>>();
        for (torque, q) in other.torques.chunks_exact_mut(2).zip(&rows) {
            torque.copy_from_slice(&[(4.0 * q[0]).sin() + q[1] + 0.25, 2.0 * q[1]]);
        }
        let found = predict(&dataset, &other).unwrap();
        assert!(found.predicted > 3000 && found.predicted < found.samples, "{found:?}");
        assert!((found.rms[0] - 0.25).abs() < 2e-3 && found.rms[1] < 1e-12, "{found:?}");
        let deviation = found.deviation.unwrap();
        assert!((deviation[0] - 0.3).abs() < 1e-12 && (deviation[1] - 0.1).abs() < 1e-12);
        other.joints.pop();
        assert!(predict(&dataset, &other).is_err());
    }

    #[test]
    fn shares_that_leave_nothing_are_refused() {
        for share in [0.0, 1.0, -0.5, f64::NAN, f64::INFINITY] {
            let error = held_out(&samples(0.0), &options(), share).err().unwrap().to_string();
            assert!(error.contains("cannot be held out"), "{error}");
        }
    }
}
