//! Datasets: their columns as read-only views, without a copy.

use crate::{arrays, errors, threads};
use haptize::{
    JointVector,
    dataset::{self, Format},
    report::{self, page::Page},
    store::StoredNode,
};
use numpy::{Element, PyArrayDyn, PyArrayMethods, ndarray::ArrayViewD};
use pyo3::{exceptions::PyValueError, prelude::*, types::PyDict};
use std::path::PathBuf;

/// A dataset over a grid of joint configurations, made by bake or gridize, or opened from a file.
///
/// Columns are read-only NumPy arrays of the grid's shape that lie where the dataset lies, in its file or in memory; a
/// column that the dataset does not hold is None.
#[pyclass(frozen, module = "haptize")]
pub struct Dataset {
    pub dataset: dataset::Dataset,
    report: Option<serde_json::Value>,
}

type View<'py, T> = Bound<'py, PyArrayDyn<T>>;

/// `column`, which lies in the dataset of `owner`, in `shape`.
fn view<'py, T: Element>(owner: &Bound<'py, Dataset>, column: &[T], shape: &[usize]) -> PyResult<View<'py, T>> {
    let array = ArrayViewD::from_shape(shape, column).map_err(|error| PyValueError::new_err(error.to_string()))?;
    // SAFETY: a dataset never changes, and the array keeps its owner alive, in which the column lies.
    let array = unsafe { PyArrayDyn::borrow_from_array(&array, owner.clone().into_any()) };
    array.try_readwrite().map_err(|error| PyValueError::new_err(error.to_string()))?.make_nonwriteable();
    Ok(array)
}

impl Dataset {
    pub fn new(dataset: dataset::Dataset, report: Option<serde_json::Value>) -> Self {
        Self { dataset, report }
    }

    fn shape_with(&self, last: Option<usize>) -> Vec<usize> {
        self.dataset.grid.counts().into_iter().chain(last).collect()
    }
}

/// A value as Python has it.
fn python_of<'py>(py: Python<'py>, value: &impl serde::Serialize) -> PyResult<Bound<'py, PyAny>> {
    let text = serde_json::to_string(value).map_err(|error| PyValueError::new_err(error.to_string()))?;
    py.import("json")?.call_method1("loads", (text,))
}

#[pymethods]
impl Dataset {
    /// Open the file at `path` and check all of it. Columns are read where they lie in the file: memory is taken only
    /// by what is looked at. The file must not be cut short by another program meanwhile, which would end the process;
    /// `load` copies it.
    #[staticmethod]
    fn open(py: Python<'_>, path: PathBuf) -> PyResult<Self> {
        let opened = threads::detach(py, || dataset::Dataset::open(&path))?;
        Ok(Self::new(opened.map_err(|error| errors::dataset(py, &error))?, None))
    }

    /// Copy the file at `path` into memory, and check all of it.
    #[staticmethod]
    fn load(py: Python<'_>, path: PathBuf) -> PyResult<Self> {
        let opened = threads::detach(py, || dataset::Dataset::load(&path))?;
        Ok(Self::new(opened.map_err(|error| errors::dataset(py, &error))?, None))
    }

    /// Write the dataset to `path`, replacing it whole or not at all.
    fn save(&self, py: Python<'_>, path: PathBuf) -> PyResult<()> {
        threads::detach(py, || self.dataset.save(&path))?.map_err(|error| errors::dataset(py, &error))
    }

    /// Write the dataset for other programs, format "npz", "hdf5", "csv" or "vti". Returns the files written.
    fn export(&self, py: Python<'_>, path: PathBuf, format: &str) -> PyResult<Vec<PathBuf>> {
        let Some(format) = Format::named(format) else {
            return Err(PyValueError::new_err(format!(
                "no format {format:?}: take \"npz\", \"hdf5\", \"csv\" or \"vti\""
            )));
        };
        threads::detach(py, || self.dataset.export(&path, format))?.map_err(|error| errors::dataset(py, &error))
    }

    /// Draw the configurations in contact and the torque as PNG and SVG files into `folder`. Returns the files written.
    fn figures(&self, py: Python<'_>, folder: PathBuf) -> PyResult<Vec<PathBuf>> {
        let written = threads::detach(py, || report::write_figures(&folder, &self.dataset, None))?;
        written.map_err(|error| errors::Error::new_err(error.to_string()))
    }

    /// Number of grid lines of each joint.
    #[getter]
    fn shape<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, pyo3::types::PyTuple>> {
        pyo3::types::PyTuple::new(py, self.dataset.grid.counts())
    }

    /// The grid's axes, a dict each: name, unit ("rad" or "m"), start, step, count.
    #[getter]
    fn axes<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        python_of(py, &self.dataset.grid.axes)
    }

    /// Coordinates of the grid lines of each joint (rad; m).
    #[getter]
    fn lines(&self, py: Python<'_>) -> PyResult<Vec<Py<PyArrayDyn<f64>>>> {
        let lines = |axis: &dataset::Axis| {
            arrays::array(py, (0..axis.count).map(|line| axis.coordinate(line)).collect(), &[axis.count])
        };
        self.dataset.grid.axes.iter().map(lines).collect()
    }

    /// Torque tau (N m; N at prismatic joints), the grid's shape and one entry per joint.
    #[getter]
    fn torque<'py>(slf: &Bound<'py, Self>) -> PyResult<View<'py, f64>> {
        let this = slf.get();
        view(slf, &this.dataset.torque, &this.shape_with(Some(this.dataset.grid.joints())))
    }

    /// Energy that object and contact store (J), or None.
    #[getter]
    fn energy<'py>(slf: &Bound<'py, Self>) -> PyResult<Option<View<'py, f64>>> {
        let this = slf.get();
        this.dataset.energy.as_ref().map(|column| view(slf, column, &this.shape_with(None))).transpose()
    }

    /// Smallest signed distance of the arm to the surface at rest, or far from contact a lower bound of it (m); or
    /// None.
    #[getter]
    fn gap<'py>(slf: &Bound<'py, Self>) -> PyResult<Option<View<'py, f32>>> {
        let this = slf.get();
        this.dataset.gap.as_ref().map(|column| view(slf, column, &this.shape_with(None))).transpose()
    }

    /// 0 free, 1 contact, 2 unconverged, 3 overflow, 4 outside or not computed.
    #[getter]
    fn status<'py>(slf: &Bound<'py, Self>) -> PyResult<View<'py, u8>> {
        let this = slf.get();
        view(slf, &this.dataset.status, &this.shape_with(None))
    }

    /// Relative imbalance of forces (1), or None.
    #[getter]
    fn residual<'py>(slf: &Bound<'py, Self>) -> PyResult<Option<View<'py, f32>>> {
        let this = slf.get();
        this.dataset.residual.as_ref().map(|column| view(slf, column, &this.shape_with(None))).transpose()
    }

    /// Iterations of the contact solver, or None.
    #[getter]
    fn iterations<'py>(slf: &Bound<'py, Self>) -> PyResult<Option<View<'py, u32>>> {
        let this = slf.get();
        this.dataset.iterations.as_ref().map(|column| view(slf, column, &this.shape_with(None))).transpose()
    }

    /// Contact forces as compressed rows, or None: those of grid point p (C order) are entries offsets[p] to
    /// offsets[p + 1] of `nodes`, the object's node, and `forces` (N), three numbers each.
    #[getter]
    #[allow(clippy::type_complexity)]
    fn contacts<'py>(slf: &Bound<'py, Self>) -> PyResult<Option<(View<'py, u64>, View<'py, u32>, View<'py, f32>)>> {
        let this = slf.get();
        let Some(contacts) = &this.dataset.contacts else { return Ok(None) };
        let count = contacts.nodes.len();
        Ok(Some((
            view(slf, &contacts.offsets, &[contacts.offsets.len()])?,
            view(slf, &contacts.nodes, &[count])?,
            view(slf, &contacts.forces, &[count, 3])?,
        )))
    }

    /// The solved nodes of a refined dataset, the coarsest level first, or None where the grid is uniform: a dict of
    /// arrays with one row a node, `level`, configuration `q` (rad; m), `torque` (N m; N), `energy` (J), `gap` (m) and
    /// `status`.
    #[getter]
    fn nodes<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyDict>>> {
        let Some(store) = &self.dataset.refinement else { return Ok(None) };
        let (nodes, joints) = (store.nodes().collect::<Vec<_>>(), store.space().joints());
        let count = nodes.len();
        let vectors = |of: fn(&StoredNode) -> &JointVector| -> Vec<f64> {
            nodes.iter().flat_map(|node| of(node).iter().copied().take(joints)).collect()
        };
        let columns = PyDict::new(py);
        columns.set_item("level", arrays::array(py, nodes.iter().map(|node| node.level).collect(), &[count])?)?;
        columns.set_item("q", arrays::array(py, vectors(|node| &node.q), &[count, joints])?)?;
        columns.set_item("torque", arrays::array(py, vectors(|node| &node.torque), &[count, joints])?)?;
        columns.set_item("energy", arrays::array(py, nodes.iter().map(|node| node.energy).collect(), &[count])?)?;
        columns.set_item("gap", arrays::array(py, nodes.iter().map(|node| node.gap).collect(), &[count])?)?;
        columns.set_item("status", arrays::array(py, nodes.iter().map(|node| node.status).collect(), &[count])?)?;
        Ok(Some(columns))
    }

    /// The object's surface at rest, or None: nodes (m), three numbers each, and triangles, three node numbers each.
    #[getter]
    fn surface<'py>(slf: &Bound<'py, Self>) -> PyResult<Option<(View<'py, f64>, View<'py, u32>)>> {
        let this = slf.get();
        let Some(surface) = &this.dataset.surface else { return Ok(None) };
        Ok(Some((
            view(slf, &surface.nodes, &[surface.nodes.len() / 3, 3])?,
            view(slf, &surface.triangles, &[surface.triangles.len() / 3, 3])?,
        )))
    }

    /// The scene's text; empty where there is none.
    #[getter]
    fn scene(&self) -> &str {
        &self.dataset.scene
    }

    /// Where the dataset comes from: version, algorithm, tolerance (1), backend, adapter, date, and the error that the
    /// bake measured.
    #[getter]
    fn provenance<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        python_of(py, &self.dataset.provenance)
    }

    /// The report of the bake or the gridization that made this dataset; None for one that was opened.
    #[getter]
    fn report<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyAny>>> {
        self.report.as_ref().map(|report| python_of(py, report)).transpose()
    }

    /// Sum the dataset up, as `haptize info` does.
    fn summary<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        python_of(py, &self.dataset.summary())
    }

    /// Object, arm and a plane of C-space as a page that can be turned, in a notebook.
    pub fn _repr_html_(&self, py: Python<'_>) -> PyResult<String> {
        let page = threads::detach(py, || Page::dataset("Dataset".into(), &self.dataset).frame())?;
        page.map_err(|error| errors::Error::new_err(error.to_string()))
    }

    fn __repr__(&self) -> String {
        let axes = &self.dataset.grid.axes;
        let axes: Vec<String> = axes.iter().map(|axis| format!("{}: {}", axis.name, axis.count)).collect();
        format!("Dataset({})", axes.join(", "))
    }
}
