//! Scenes from files, texts and dicts.

use crate::{errors, threads};
use haptize::{report::page::Page, scene};
use pyo3::{
    exceptions::{PyAttributeError, PyTypeError},
    prelude::*,
    types::{PyDict, PyString},
};
use std::path::{Path, PathBuf};

/// A scene: what is haptized, with what, how finely, and how it is felt. datasets/README.md explains every key.
///
/// Scene(text, path="scene"): from the text of a scene file, or a dict of the same tables; files that it names are
/// relative to the folder of `path`, which messages name. SceneError says where it is not valid.
#[pyclass(frozen, module = "haptize")]
pub struct Scene {
    pub scene: scene::Scene,
}

#[pymethods]
impl Scene {
    #[new]
    #[pyo3(signature = (text, path = None))]
    fn new(py: Python<'_>, text: &Bound<'_, PyAny>, path: Option<PathBuf>) -> PyResult<Self> {
        let path = path.unwrap_or_else(|| "scene".into());
        let text = if let Ok(text) = text.cast::<PyString>() {
            text.to_str()?.to_owned()
        } else if let Ok(tables) = text.cast::<PyDict>() {
            text_of(tables)?
        } else {
            return Err(PyTypeError::new_err("a scene is made of a text or a dict"));
        };
        let scene = scene::Scene::parse(&text, path).map_err(|error| errors::scene(py, error))?;
        Ok(Self { scene })
    }

    /// Read and check the scene file at `path`.
    #[staticmethod]
    fn load(py: Python<'_>, path: PathBuf) -> PyResult<Self> {
        Ok(Self { scene: scene::Scene::load(path).map_err(|error| errors::scene(py, error))? })
    }

    /// For titles and lists.
    #[getter]
    fn name(&self) -> &str {
        &self.scene.name
    }

    /// The text, as every dataset baked from the scene holds it.
    #[getter]
    fn text(&self) -> &str {
        &self.scene.text
    }

    /// Path of the file that messages name; files that the scene names are relative to its folder.
    #[getter]
    fn path(&self) -> &Path {
        &self.scene.path
    }

    /// Names of the joints.
    #[getter]
    fn joints(&self) -> Vec<&str> {
        self.scene.proxy.joints.iter().map(|joint| joint.name.as_str()).collect()
    }

    /// Object and arm as a page that can be turned, in a notebook.
    fn _repr_html_(&self, py: Python<'_>) -> PyResult<String> {
        let page = threads::detach(py, || Page::scene(&self.scene)?.frame())?;
        page.map_err(|error| errors::Error::new_err(error.to_string()))
    }

    fn __repr__(&self) -> String {
        format!("Scene({:?}, joints={:?})", self.scene.name, self.joints())
    }
}

/// The scene of `tables` as text, by way of JSON. NumPy's arrays and numbers become lists and numbers.
fn text_of(tables: &Bound<'_, PyDict>) -> PyResult<String> {
    let py = tables.py();
    let plain = py.eval(c"lambda value: value.tolist()", None, None)?;
    let options = PyDict::new(py);
    options.set_item("default", plain)?;
    let dumped = py.import("json")?.call_method("dumps", (tables,), Some(&options)).map_err(|error| {
        // What has no `tolist`.
        let is_foreign = error.is_instance_of::<PyAttributeError>(py);
        if is_foreign { PyTypeError::new_err(format!("not a scene: {error}")) } else { error }
    });
    let json: String = dumped?.extract()?;
    let table: toml::Table = serde_json::from_str(&json).map_err(|error| {
        PyTypeError::new_err(format!("not a scene: {error} (None, NaN and infinities have no place in one)"))
    })?;
    toml::to_string(&table).map_err(|error| PyTypeError::new_err(format!("not a scene: {error}")))
}
