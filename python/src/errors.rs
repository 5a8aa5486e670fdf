//! Exceptions of the package: one kind for each thing that can be wrong, with file and line where there are such.

use haptize::{
    dataset,
    field::BatchError,
    gridize::GridizeError as GridizeFailure,
    render::setup::SetupError,
    scene::SceneError as SceneFailure,
    sweep::{BakeError as BakeFailure, DirectError},
};
use pyo3::{
    create_exception,
    exceptions::{PyException, PyValueError},
    prelude::*,
};
use std::path::Path;

create_exception!(haptize, Error, PyException, "Something is wrong with a file, a scene, or what is made of them.");
create_exception!(
    haptize,
    SceneError,
    Error,
    "A scene is not valid or cannot be read. `path`, `line` and `column` (from 1) say where, or are None."
);
create_exception!(
    haptize,
    DatasetError,
    Error,
    "A dataset cannot be read, written or rendered. `path` is its file, or None."
);
create_exception!(haptize, BakeError, Error, "A scene cannot be haptized, or its object not be built.");
create_exception!(haptize, GridizeError, Error, "Measurements cannot be put on a grid.");

/// Adds the exceptions to `module`.
pub fn add(module: &Bound<'_, PyModule>) -> PyResult<()> {
    let py = module.py();
    module.add("Error", py.get_type::<Error>())?;
    module.add("SceneError", py.get_type::<SceneError>())?;
    module.add("DatasetError", py.get_type::<DatasetError>())?;
    module.add("BakeError", py.get_type::<BakeError>())?;
    module.add("GridizeError", py.get_type::<GridizeError>())
}

pub fn scene(py: Python<'_>, error: &SceneFailure) -> PyErr {
    let (path, place) = match error {
        SceneFailure::Unreadable { path, .. } => (Some(path), None),
        SceneFailure::Invalid(diagnostic) => (Some(&diagnostic.path), Some((diagnostic.line, diagnostic.column))),
        _ => (None, None),
    };
    let raised = SceneError::new_err(error.to_string());
    let value = raised.value(py);
    let told = value
        .setattr("path", path)
        .and_then(|()| value.setattr("line", place.map(|place| place.0)))
        .and_then(|()| value.setattr("column", place.map(|place| place.1)));
    told.err().unwrap_or(raised)
}

pub fn dataset(py: Python<'_>, error: &dataset::Error) -> PyErr {
    use dataset::Error::{Damaged, Foreign, Inconsistent, Memory, Occupied, Read, Version, Write};
    let path = match error {
        Read { path, .. }
        | Memory { path, .. }
        | Write { path, .. }
        | Occupied { path }
        | Foreign { path, .. }
        | Version { path, .. }
        | Damaged { path, .. }
        | Inconsistent { path, .. } => Some(path.as_path()),
        _ => None,
    };
    with_path(py, error.to_string(), path)
}

/// A [`DatasetError`] about `path`.
fn with_path(py: Python<'_>, message: String, path: Option<&Path>) -> PyErr {
    let raised = DatasetError::new_err(message);
    raised.value(py).setattr("path", path).err().unwrap_or(raised)
}

pub fn setup(py: Python<'_>, error: &SetupError) -> PyErr {
    match error {
        SetupError::Scene(error) => scene(py, error),
        error => with_path(py, error.to_string(), None),
    }
}

/// The dataset has no `column`.
pub fn absent(py: Python<'_>, column: &str) -> PyErr {
    with_path(py, format!("the dataset holds no {column}, as datasets of real objects do not"), None)
}

pub fn bake(error: &BakeFailure) -> PyErr {
    BakeError::new_err(error.to_string())
}

pub fn gridize(error: &GridizeFailure) -> PyErr {
    GridizeError::new_err(error.to_string())
}

pub fn batch(error: BatchError) -> PyErr {
    PyValueError::new_err(error.to_string())
}

pub fn direct(error: DirectError) -> PyErr {
    PyValueError::new_err(error.to_string())
}
