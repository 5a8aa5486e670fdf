//! Scattered measurements put on a grid.

use crate::{arrays, dataset::Dataset, errors, threads};
use haptize::{
    dataset::JointLabel,
    gridize::{self as library, GridizeOptions, Interpolation, Samples},
};
use pyo3::{exceptions::PyValueError, prelude::*};
use std::time::SystemTime;

// The signature shows literals alone.
const _: () = assert!(library::WITHIN == 1.5, "the default of `within` below is another one than the library's");

/// Interpolate scattered torques on a uniform grid: linear on Delaunay simplices, absent outside their hull.
///
/// q: configurations (rad; m), shape (n, d). tau: the torque measured at each (N m; N), the same shape. step: the
/// grid's step (rad; m), one number or one per joint. deviations: standard deviation of each torque, the same shape.
/// names, units ("rad" or "m"): of the joints. epsilon: torque above which a configuration counts as contact (N m).
/// smooth: smooth torques within their deviation first. interpolation: "linear", or "natural" for two joints.
/// within: distance from the samples at which the measured region ends inside their hull, too, in spacings.
#[pyfunction]
#[pyo3(signature = (
    q, tau, step, *, deviations = None, names = None, units = None, epsilon = None, smooth = false,
    interpolation = "linear", within = 1.5
))]
#[allow(clippy::too_many_arguments)] // As many as Python's caller may name.
pub fn gridize(
    py: Python<'_>,
    q: &Bound<'_, PyAny>,
    tau: &Bound<'_, PyAny>,
    step: &Bound<'_, PyAny>,
    deviations: Option<&Bound<'_, PyAny>>,
    names: Option<Vec<String>>,
    units: Option<Vec<String>>,
    epsilon: Option<f64>,
    smooth: bool,
    interpolation: &str,
    within: f64,
) -> PyResult<Dataset> {
    let interpolation = match interpolation {
        "linear" => Interpolation::Linear,
        "natural" => Interpolation::Natural,
        other => {
            return Err(PyValueError::new_err(format!("no interpolation {other:?}: take \"linear\" or \"natural\"")));
        }
    };
    let (configurations, shape) = arrays::numbers(q)?;
    let &[_, joints] = shape.as_slice() else {
        return Err(PyValueError::new_err(format!("q has shape {shape:?}: it must be (samples, joints)")));
    };
    let like = |name: &str, values: &Bound<'_, PyAny>| {
        let (numbers, found) = arrays::numbers(values)?;
        if found == shape {
            Ok(numbers)
        } else {
            Err(PyValueError::new_err(format!("{name} has shape {found:?}, q has {shape:?}: they must be alike")))
        }
    };
    let torques = like("tau", tau)?;
    let deviations = deviations.map(|values| like("deviations", values)).transpose()?;
    let names = names.unwrap_or_else(|| (1..=joints).map(|joint| format!("joint {joint}")).collect());
    let units = units.unwrap_or_else(|| vec!["rad".into(); joints]);
    if names.len() != joints || units.len() != joints || units.iter().any(|unit| unit != "rad" && unit != "m") {
        let message = format!("names and units must be {joints} each, one per joint, and units \"rad\" or \"m\"");
        return Err(PyValueError::new_err(message));
    }
    let joints = names.into_iter().zip(units).map(|(name, unit)| JointLabel { name, unit }).collect();
    let samples = Samples { joints, configurations, torques, deviations };
    let options = GridizeOptions { steps: arrays::numbers(step)?.0, epsilon, interpolation, smooth, within };
    let gridized = threads::detach(py, || library::gridize(&samples, &options))?;
    let (mut dataset, report) = gridized.map_err(|error| errors::gridize(&error))?;
    dataset.provenance.backend = "import".into();
    dataset.provenance.adapter = "Python".into();
    dataset.provenance.date = humantime::format_rfc3339_seconds(SystemTime::now()).to_string();
    let report = serde_json::to_value(&report).map_err(|error| PyValueError::new_err(error.to_string()))?;
    Ok(Dataset::new(dataset, Some(report)))
}
