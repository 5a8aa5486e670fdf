//! Exceptions of the package: one kind for each thing that can be wrong, with file and line where there are such.

use haptize::{Error as Failure, ErrorKind};
use pyo3::{
    create_exception,
    exceptions::{PyException, PyFileNotFoundError, PyValueError},
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

/// POSIX's ENOENT, which Windows has, too.
const NO_ENTRY: i32 = 2;

/// Adds the exceptions to `module`.
pub fn add(module: &Bound<'_, PyModule>) -> PyResult<()> {
    let py = module.py();
    module.add("Error", py.get_type::<Error>())?;
    module.add("SceneError", py.get_type::<SceneError>())?;
    module.add("DatasetError", py.get_type::<DatasetError>())?;
    module.add("BakeError", py.get_type::<BakeError>())?;
    module.add("GridizeError", py.get_type::<GridizeError>())
}

/// Python's own error of a file that is not there, or of a folder to write one to.
fn not_found(error: &Failure) -> Option<PyErr> {
    let at = error.location().filter(|at| error.kind() == ErrorKind::File && !at.path.exists())?;
    let text = error.to_string();
    let text = text.strip_prefix(&format!("{}: ", at.path.display())).unwrap_or(&text).to_owned();
    Some(PyFileNotFoundError::new_err((NO_ENTRY, text, at.path.as_os_str().to_owned())))
}

/// A [`SceneError`], or FileNotFoundError.
pub fn scene(py: Python<'_>, error: impl Into<Failure>) -> PyErr {
    let error = error.into();
    if let Some(missing) = not_found(&error) {
        return missing;
    }
    let (path, place) = error.location().map_or((None, None), |at| (Some(&at.path), at.line));
    let raised = SceneError::new_err(error.to_string());
    let value = raised.value(py);
    let told = value
        .setattr("path", path)
        .and_then(|()| value.setattr("line", place.map(|place| place.0)))
        .and_then(|()| value.setattr("column", place.map(|place| place.1)));
    told.err().unwrap_or(raised)
}

/// A [`DatasetError`], a [`SceneError`] where the scene in the dataset is not valid, or FileNotFoundError.
pub fn dataset(py: Python<'_>, error: &Failure) -> PyErr {
    if let Some(missing) = not_found(error) {
        return missing;
    }
    match error.kind() {
        ErrorKind::Scene => scene(py, error.clone()),
        _ => with_path(py, error.to_string(), error.location().map(|at| at.path.as_path())),
    }
}

/// A [`DatasetError`] about `path`.
fn with_path(py: Python<'_>, message: String, path: Option<&Path>) -> PyErr {
    let raised = DatasetError::new_err(message);
    raised.value(py).setattr("path", path).err().unwrap_or(raised)
}

/// The dataset has no `column`.
pub fn absent(py: Python<'_>, column: &str) -> PyErr {
    with_path(py, format!("the dataset holds no {column}, as datasets of real objects do not"), None)
}

/// The dataset is refined where a uniform grid is needed.
pub fn refined(py: Python<'_>) -> PyErr {
    let message = "the dataset is refined, and array look-ups take a uniform grid: bake the scene without --refine";
    with_path(py, message.into(), None)
}

pub fn bake(error: &Failure) -> PyErr {
    BakeError::new_err(error.to_string())
}

pub fn gridize(error: &Failure) -> PyErr {
    GridizeError::new_err(error.to_string())
}

/// A wrong shape, or a number that is not finite.
pub fn rows(error: Failure) -> PyErr {
    PyValueError::new_err(error.to_string())
}
