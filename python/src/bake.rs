//! Bakes: the interpreter is free meanwhile, and Ctrl-C stops them.

use crate::{background, dataset::Dataset, errors, scene::Scene, threads};
use haptize::{
    dataset,
    sweep::{BackendChoice, Bake, Progress},
};
use pyo3::{exceptions::PyValueError, prelude::*};
use std::{
    path::PathBuf,
    sync::{Arc, atomic::AtomicBool},
    time::SystemTime,
};

/// Haptize a scene: solve contact at every point of its grid.
///
/// output: the file to write; without one the dataset stays in memory. resume: go on with a bake into that file that
/// was interrupted. backend: "auto", "cpu" or "gpu". measure_error: random configurations at which the dataset's error
/// is measured; 0 leaves it out. progress: called with (points done, points) several times a second; what it raises
/// stops the bake, as Ctrl-C does, within a second.
///
/// Other threads run meanwhile. BakeError where the scene cannot be haptized; what a bake into a file has solved is
/// kept.
#[pyfunction]
#[pyo3(signature = (scene, output = None, *, resume = false, backend = "auto", measure_error = None, progress = None))]
pub fn bake(
    py: Python<'_>,
    scene: &Bound<'_, Scene>,
    output: Option<PathBuf>,
    resume: bool,
    backend: &str,
    measure_error: Option<usize>,
    progress: Option<Py<PyAny>>,
) -> PyResult<Dataset> {
    let backend = match backend {
        "auto" => BackendChoice::Auto,
        "cpu" => BackendChoice::Cpu,
        "gpu" => BackendChoice::Gpu,
        other => return Err(PyValueError::new_err(format!("no backend {other:?}: take \"auto\", \"cpu\" or \"gpu\""))),
    };
    let stop = Arc::new(AtomicBool::new(false));
    let (scene, file, stopped) = (scene.get().scene.clone(), output.clone(), Arc::clone(&stop));
    let work = move |tell: &dyn Fn([usize; 2])| {
        let date = humantime::format_rfc3339_seconds(SystemTime::now()).to_string();
        let bake = Bake {
            scene: &scene,
            backend,
            measured: measure_error,
            aim: None,
            date: &date,
            stop: &stopped,
            progress: &mut |told: Progress| tell([told.done, told.points]),
        };
        match &file {
            Some(file) => bake.to_file(file, resume).map(|report| (None, report)),
            None => bake.in_memory().map(|(dataset, report)| (Some(dataset), report)),
        }
    };
    let baked = background::run(py, &stop, work, |[done, points]| {
        progress.as_ref().map_or(Ok(()), |progress| progress.call1(py, (done, points)).map(drop))
    })?;
    let (dataset, report) = baked.map_err(|error| errors::bake(&error))?;
    let report = serde_json::to_value(&report).map_err(|error| PyValueError::new_err(error.to_string()))?;
    let dataset = match (dataset, output) {
        (None, Some(output)) => {
            let opened = threads::detach(py, || dataset::Dataset::open(&output))?;
            opened.map_err(|error| errors::dataset(py, &error))?
        }
        (dataset, _) => dataset.ok_or_else(|| errors::BakeError::new_err("the bake gave no dataset"))?,
    };
    Ok(Dataset::new(dataset, Some(report)))
}
