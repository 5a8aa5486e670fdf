//! An object that remembers, made of measurements: how its torque fades is identified from histories
//! ([`super::relaxation`]), and the dataset holds the torque that it has at first.
//!
//! What was measured at rest ([`Past::Presses`]) has faded already. Histories of single presses then tell by how much,
//! each up to a factor of its own, since the grid errs by as much from place to place. Or the samples are the histories
//! themselves, of a log in which the object never rests ([`Past::Log`]): then each row's torque is divided by what
//! memory left of it, gridized again, and so on until the terms stay.

use super::{
    Branches, Cells, GridizeOptions, GridizeReport, LeadDirection, Samples,
    energy::with_energy,
    gridize,
    relaxation::{Identified, Stretch, identify},
};
use crate::{
    Error, JointVector,
    dataset::{Dataset, IdentifiedRelaxation, JointLabel},
    error,
    field::{Flags, TorqueField},
    scene::{Interpolation, MOST_TERMS, THRESHOLD},
};

/// What is wrong with histories of which nothing can be compared.
const NO_HISTORY: &str = "no history has rows that count inside the grid: take a smaller step, so that it reaches \
                          farther, or record in the middle of the range";

/// What is wrong where nothing fades.
const NO_RELAXATION: &str = "no relaxation is found: the torque does not fade measurably while the object is held; \
                             leave it out, or hold longer";

/// Rounds of gridizing and identifying, at most; and the change of every term over its size at which they end: a tenth
/// of what is asked of an identified term.
const ROUNDS: usize = 60;
const SETTLED: f64 = 5e-3;
/// Share of the elastic torque below which a row tells nothing of it, since noise is divided by it (1).
const LEAST_LEFT: f64 = 0.05;
/// Every so many presses one is held out of the fit that predicts it (1).
const HELD_OUT: usize = 4;

/// A stretch of time in which configuration and torque were recorded.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ForceHistory {
    /// (s), ascending.
    pub times: Vec<f64>,
    /// Joint fastest (rad or m).
    pub configurations: Vec<f64>,
    /// Contact torque on the proxy, laid out alike (N m or N).
    pub torques: Vec<f64>,
    /// Whether each row counts: held by a device whose own inertia and friction are not in it.
    pub counts: Vec<bool>,
    /// Where the lead joint goes in each row, where there is one and it moves.
    pub directions: Vec<Option<LeadDirection>>,
}

impl ForceHistory {
    /// Adds a row: whether it counts, and where the lead joint goes.
    pub fn push(&mut self, time: f64, q: &[f64], torque: &[f64], (counts, way): (bool, Option<LeadDirection>)) {
        self.times.push(time);
        self.configurations.extend_from_slice(q);
        self.torques.extend_from_slice(torque);
        self.counts.push(counts);
        self.directions.push(way);
    }

    /// Configuration and torque of row `row`, of `joints` numbers each.
    pub(crate) fn row(&self, row: usize, joints: usize) -> [JointVector; 2] {
        [&self.configurations, &self.torques].map(|all| JointVector::from_slice(&all[row * joints..(row + 1) * joints]))
    }
}

/// What tells of the object's memory.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Past {
    /// Presses beside samples that were measured at rest.
    Presses,
    /// The samples themselves.
    Log,
}

/// Gridizes the torque that the object has at first, and its energy, from histories and, beside
/// [presses](Past::Presses), `samples` at rest; the dataset's provenance says how it fades.
///
/// # Errors
/// Those of [`gridize`]; when no history lies inside the grid, and when a log shows no relaxation.
pub fn gridize_remembering(
    samples: &Samples,
    (histories, past): (&[ForceHistory], Past),
    options: &GridizeOptions,
) -> Result<(Dataset, GridizeReport), Error> {
    let scaled = past == Past::Presses;
    let mut samples = match past {
        Past::Presses => samples.clone(),
        Past::Log => fresh(&samples.joints, histories, &[], &options.steps),
    };
    let mut last = Identified::default();
    for _ in 0..ROUNDS {
        let (dataset, report) = gridize(&samples, options)?;
        let mut dataset = with_energy(dataset);
        let stretches = stretches(&dataset, histories)?;
        let found = identify(&stretches, MOST_TERMS, scaled).ok_or_else(|| Error::from(NO_HISTORY))?;
        if found.terms.is_empty() {
            // An object that does not relax is as it was measured at rest.
            return if scaled { Ok((dataset, report)) } else { Err(NO_RELAXATION.into()) };
        }
        if scaled || found.is_near(&last, SETTLED) {
            scale(&mut dataset, found.scale);
            dataset.provenance.relaxation = Some(IdentifiedRelaxation {
                misfit: misfit(&stretches, &found.terms, scaled),
                held_out: if scaled { held_out(&stretches) } else { None },
                histories: histories.len(),
                terms: found.terms,
            });
            return Ok((dataset, report));
        }
        let left: Vec<Vec<f64>> = stretches.iter().map(|stretch| stretch.left(&found.terms)).collect();
        samples = fresh(&samples.joints, histories, &left, &options.steps);
        last = found;
    }
    Err(error!(
        "relaxation was still changing after {ROUNDS} rounds: take a larger step, so that each cell holds more rows"
    ))
}

/// The misfit of `dataset` and its relaxation on other histories, over their torque, rms (1).
///
/// # Errors
/// When the dataset has no energy.
pub fn predict_histories(dataset: &Dataset, histories: &[ForceHistory]) -> Result<f64, Error> {
    let terms = dataset.provenance.relaxation.as_ref().map_or(&[][..], |relaxation| &relaxation.terms);
    Ok(misfit(&stretches(dataset, histories)?, terms, false))
}

/// Multiplies torque and energy of `dataset`.
fn scale(dataset: &mut Dataset, scale: f64) {
    dataset.torque = dataset.torque.iter().map(|tau| scale * tau).collect::<Vec<f64>>().into();
    dataset.energy = dataset.energy.as_ref().map(|all| all.iter().map(|u| scale * u).collect::<Vec<f64>>().into());
}

/// The histories as the potential of `dataset` has them.
fn stretches(dataset: &Dataset, histories: &[ForceHistory]) -> Result<Vec<Stretch>, Error> {
    let joints = dataset.grid.joints();
    let slopes = std::iter::repeat_n(1.0, joints).collect();
    let field = TorqueField::interpolated(dataset, Interpolation::Potential, THRESHOLD, &slopes);
    let field = field.map_err(|error| error.within("the gridized torque cannot be interpolated"))?;
    let of = |history: &ForceHistory| {
        let mut stretch =
            Stretch { times: history.times.clone(), counts: history.counts.clone(), ..Stretch::default() };
        let mut inside = Vec::new();
        for [q, torque] in (0..history.times.len()).map(|row| history.row(row, joints)) {
            let sample = field.sample(&q);
            let (size, along) = (sample.torque.norm(), sample.torque.dot(&torque));
            stretch.roots.push((2.0 * sample.energy.max(0.0)).sqrt());
            stretch.elastic.push(size);
            stretch.measured.push(if size > 0.0 { along / size } else { 0.0 });
            inside.push(size > 0.0 && !sample.flags.intersects(Flags::OUTSIDE | Flags::ABSENT));
        }
        stretch.counts.iter_mut().zip(inside).for_each(|(counts, inside)| *counts &= inside);
        stretch
    };
    Ok(histories.iter().map(of).collect())
}

/// One sample for each cell of the grid that a history goes through: the mean torque without memory, which left the
/// share `left` of each row, weighted by that share's square as noise is.
fn fresh(joints: &[JointLabel], histories: &[ForceHistory], left: &[Vec<f64>], steps: &[f64]) -> Samples {
    let sides: Vec<f64> = steps.iter().cycle().take(joints.len()).copied().collect();
    let mut cells = Cells::new(&sides);
    for (number, history) in histories.iter().enumerate() {
        for row in 0..history.times.len() {
            let left = left.get(number).map_or(1.0, |left| left[row]);
            if left >= LEAST_LEFT {
                let [q, mut torque] = history.row(row, joints.len());
                torque.iter_mut().for_each(|tau| *tau /= left);
                cells.add_alone(&q, &torque, left * left);
            }
        }
    }
    // How far rows of a cell are apart is how the torque changes across it, not noise.
    Samples { deviations: None, ..cells.samples(Branches::Any, joints) }
}

/// Predicted less measured over measured torque, rms over all rows that count (1); `scaled`: each stretch by the factor
/// that suits it best.
fn misfit(stretches: &[Stretch], terms: &[[f64; 2]], scaled: bool) -> f64 {
    let (mut error, mut whole) = (0.0, 0.0);
    for stretch in stretches {
        let predicted = stretch.predicted(terms);
        let rows = || (0..predicted.len()).filter(|&k| stretch.counts[k]);
        let sum = |of: &dyn Fn(usize) -> f64| rows().map(of).sum::<f64>();
        let square = sum(&|k| predicted[k] * predicted[k]);
        let along = sum(&|k| predicted[k] * stretch.measured[k]);
        let scale = if scaled && square > 0.0 { along / square } else { 1.0 };
        error += sum(&|k| (scale * predicted[k] - stretch.measured[k]).powi(2));
        whole += sum(&|k| stretch.measured[k].powi(2));
    }
    (error / whole).sqrt()
}

/// The misfit of presses by terms of the others (1).
fn held_out(stretches: &[Stretch]) -> Option<f64> {
    let part = |out: bool| -> Vec<Stretch> {
        let chosen = stretches.iter().enumerate().filter(|(k, _)| (k % HELD_OUT == HELD_OUT - 1) == out);
        chosen.map(|(_, stretch)| stretch.clone()).collect()
    };
    let (rest, out) = (part(false), part(true));
    let found = identify(&rest, MOST_TERMS, true).filter(|_| !out.is_empty())?;
    Some(misfit(&out, &found.terms, true))
}

#[cfg(test)]
mod tests {
    use super::*;

    const TERMS: [[f64; 2]; 2] = [[0.4, 3.0], [0.25, 60.0]];

    /// A log of steps to 0.2, 0.4 up to 1.0 rad at `speed`, each held for 60 s; torque on the arm, an exponential
    /// spring's with the loop's memory, z by small steps.
    fn log(speed: f64) -> ForceHistory {
        const STEP: f64 = 0.01;
        let (mut q, mut z, mut history) = (0.0_f64, [0.0; 2], ForceHistory::default());
        let mut time = 0.0;
        for level in 1..=5 {
            let held = f64::from(level) * 0.2;
            let ticks = ((held - q) / speed / STEP) as usize;
            for tick in 0..ticks + 6000 {
                q = if tick < ticks { q + speed * STEP } else { held };
                time += STEP;
                let energy = (2.0 * q).exp() - 1.0 - 2.0 * q;
                let w = (2.0 * energy).sqrt();
                for (z, [_, theta]) in z.iter_mut().zip(TERMS) {
                    *z += STEP / theta * (w - *z);
                }
                let separation = TERMS[0][0] * z[0] + TERMS[1][0] * z[1];
                if tick % 20 == 0 && w > 0.0 {
                    let torque = -2.0 * ((2.0 * q).exp() - 1.0) * (1.0 - separation / w).max(0.0);
                    history.push(time, &[q], &[torque], (true, None));
                }
            }
        }
        history
    }

    #[test]
    fn a_log_that_never_rests_tells_the_terms_and_predicts_another_rate() {
        let samples =
            Samples { joints: vec![JointLabel { name: "a".into(), unit: "rad".into() }], ..Samples::default() };
        let options = GridizeOptions { epsilon: Some(1e-3), within: f64::INFINITY, ..GridizeOptions::new(vec![0.02]) };
        let (dataset, _) = gridize_remembering(&samples, (&[log(0.005), log(0.1)], Past::Log), &options).unwrap();
        let found = dataset.provenance.relaxation.clone().unwrap();
        let identified = Identified { terms: found.terms.clone(), scale: 1.0 };
        assert!(identified.is_near(&Identified { terms: TERMS.to_vec(), scale: 1.0 }, 0.05), "{found:?}");
        let other = predict_histories(&dataset, &[log(0.02)]).unwrap();
        assert!(found.misfit < 0.02 && other < 0.02, "{found:?} {other}");
        // An elastic field of the same rows errs by what fades.
        let elastic = Dataset { provenance: crate::dataset::Provenance::default(), ..dataset };
        assert!(predict_histories(&elastic, &[log(0.02)]).unwrap() > 0.2);
    }
}
