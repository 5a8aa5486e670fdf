//! How contact is solved, away from any grid: tolerance, algorithm, arithmetic.

use super::{Accuracy, AccuracyError, Cost, Row, Study, timed};
use crate::{
    JointVector,
    contact::{Equilibrium, Model, Status},
    gpu::{AdapterChoice, BatchCapacity, Context, GpuError, GpuSolver},
    scene::{Algorithm, ContactSpec, Scene},
    sweep::{
        Backend, OTHER_ADAPTER,
        reference::{Reference, equilibria},
        remedied,
    },
};

/// Relative residuals that are asked for.
const TOLERANCES: [f64; 6] = [0.3, 0.1, 1e-2, 1e-3, 1e-5, 1e-8];

/// Configurations on the GPU: as many as a software adapter solves in some seconds.
const GPU_CONFIGURATIONS: usize = 256;

fn row(
    study: Study,
    series: &str,
    setting: String,
    value: f64,
    cost: Cost,
    reference: &Reference,
    found: &[Equilibrium],
) -> Row {
    let mut torques = found.iter().map(|equilibrium| equilibrium.torque);
    let zero = JointVector::zeros(reference.exact.first().map_or(0, |tau| tau.len()));
    let (rms, worst) = reference.errors(|_| torques.next().unwrap_or(zero));
    let contacts = found.iter().filter(|e| e.status != Status::Free).count().max(1);
    let iterations = found.iter().map(|e| e.iterations as usize).sum::<usize>() as f64 / contacts as f64;
    Row {
        study,
        series: series.to_owned(),
        setting,
        value,
        points: iterations.round() as usize,
        solved: 0,
        bytes: 0,
        cost,
        unit: "N m",
        rms,
        worst,
        size: reference.torque,
    }
}

/// Error and time against tolerance and algorithm, relative to the time of the scene as it is.
pub(super) fn settings(
    scene: &Scene,
    model: &Model<'_>,
    reference: &Reference,
    study: &mut Accuracy,
) -> Result<(), AccuracyError> {
    let tolerances = TOLERANCES.map(|tolerance| {
        let contact = ContactSpec { tolerance, ..scene.contact };
        (Study::Tolerance, "energy", format!("{tolerance:.0e}"), tolerance, contact)
    });
    let algorithms = [(Algorithm::Paper, "paper"), (Algorithm::Rest, "rest"), (Algorithm::Energy, "energy")];
    let algorithms = algorithms.map(|(algorithm, name)| {
        (Study::Algorithm, name, name.to_owned(), 0.0, ContactSpec { algorithm, ..scene.contact })
    });
    let (baseline, _) = timed(study.rounds, || equilibria(model, scene.contact, &reference.places))?;
    for (varied, series, mut setting, value, contact) in tolerances.into_iter().chain(algorithms) {
        let (cost, found) = timed(study.rounds, || equilibria(model, contact, &reference.places))?;
        let lost = found.iter().filter(|e| e.status == Status::Unconverged).count();
        if lost > 0 {
            setting += &format!(", {lost} of {} not converged", reference.in_contact);
        }
        study.rows.push(row(varied, series, setting, value, cost.over(baseline.least), reference, &found));
    }
    Ok(())
}

/// f64 and f32 on GPUs, where there are some, against the CPU.
pub(super) fn arithmetic(model: &Model<'_>, reference: &Reference, study: &mut Accuracy) -> Result<(), AccuracyError> {
    let places = &reference.places[..reference.places.len().min(GPU_CONFIGURATIONS)];
    let (baseline, found) = timed(study.rounds, || equilibria(model, model.contact, places))?;
    let part = reference.first(places.len());
    let cost = baseline.over(baseline.least);
    study.rows.push(row(Study::Arithmetic, "cpu", "cpu, f64".to_owned(), 64.0, cost, &part, &found));
    for (double, name, bits) in [(true, "f64", 64.0), (false, "f32", 32.0)] {
        let measure = || -> Result<Option<Row>, GpuError> {
            let room = BatchCapacity { double, ..BatchCapacity::default() };
            let mut gpu = GpuSolver::on(Context::open_all(&AdapterChoice::Any)?, model, room)?;
            if double && !gpu.is_exact() {
                return Ok(None);
            }
            let (cost, found) = timed(study.rounds, || gpu.solve(places))?;
            let setting = gpu.adapters().map(|adapter| format!("{adapter}, {name}")).collect::<Vec<_>>().join("; ");
            Ok(Some(row(Study::Arithmetic, "gpu", setting, bits, cost.over(baseline.least), &part, &found)))
        };
        match measure() {
            Ok(row) => study.rows.extend(row),
            Err(error) => study
                .notes
                .push(format!("{name} on a GPU is not measured: {}", remedied(&error.to_string(), OTHER_ADAPTER))),
        }
    }
    Ok(())
}
