//! Torque fields: look-ups of one configuration or a million.

use crate::{
    arrays::{Configurations, Output, plain_vector},
    dataset::Dataset,
    errors, threads,
};
use haptize::{
    JointVector, dataset,
    field::{TorqueField, fill_rows},
    render::setup,
    scene::Interpolation,
};
use numpy::PyArrayDyn;
use pyo3::{exceptions::PyValueError, prelude::*};
use std::path::PathBuf;

/// The torque field of a dataset, looked up between grid points as its scene has it felt.
///
/// Field(dataset, interpolation=None): interpolation is "linear" or "potential"; by default the
/// scene's.
///
/// Each look-up takes a configuration q (rad; m), an array of one entry per joint, or any array of such in its last
/// axis, and works on all cores. Wrong shapes and numbers that are not finite raise ValueError. Threads may share a
/// field.
#[pyclass(frozen, module = "haptize")]
pub struct Field {
    field: TorqueField,
    /// The dataset, which only a look at it needs.
    dataset: Py<Dataset>,
}

impl Field {
    fn of(py: Python<'_>, dataset: Py<Dataset>, interpolation: Option<&str>) -> PyResult<Self> {
        let interpolation = interpolation.map(named).transpose()?;
        let data = &dataset.get().dataset;
        let field = threads::detach(py, || setup::field(data, interpolation))?;
        Ok(Self { field: field.map_err(|error| errors::dataset(py, &error))?, dataset })
    }
}

fn named(name: &str) -> PyResult<Interpolation> {
    Interpolation::ALL.into_iter().find(|interpolation| interpolation.name() == name).ok_or_else(|| {
        let names: Vec<&str> = Interpolation::ALL.into_iter().map(Interpolation::name).collect();
        PyValueError::new_err(format!("no interpolation {name:?}: take one of {}", names.join(", ")))
    })
}

type Array<'py, T> = Bound<'py, PyArrayDyn<T>>;

#[pymethods]
impl Field {
    #[new]
    #[pyo3(signature = (dataset, interpolation = None))]
    fn new(py: Python<'_>, dataset: Py<Dataset>, interpolation: Option<&str>) -> PyResult<Self> {
        Self::of(py, dataset, interpolation)
    }

    /// Open the dataset file at `path` and make its field.
    #[staticmethod]
    #[pyo3(signature = (path, interpolation = None))]
    fn open(py: Python<'_>, path: PathBuf, interpolation: Option<&str>) -> PyResult<Self> {
        let opened = threads::detach(py, || dataset::Dataset::open(&path))?;
        let opened = opened.map_err(|error| errors::dataset(py, &error))?;
        Self::of(py, Py::new(py, Dataset::new(opened, None))?, interpolation)
    }

    /// Number of joints d.
    #[getter]
    fn joints(&self) -> usize {
        self.field.joints()
    }

    /// The dataset.
    #[getter]
    fn dataset(&self, py: Python<'_>) -> Py<Dataset> {
        self.dataset.clone_ref(py)
    }

    /// Torque on the arm (N m; N at prismatic joints), of the shape of q; into `out`, an array of float64, where that
    /// is given.
    #[pyo3(signature = (q, out = None))]
    fn torque<'py>(&self, q: &Bound<'py, PyAny>, out: Option<&Bound<'py, PyAny>>) -> PyResult<Bound<'py, PyAny>> {
        let joints = self.field.joints();
        if let Some(one) = plain_vector(q, joints).map(|q| q.read()).filter(JointVector::is_finite) {
            let out = Output::new(out, joints)?;
            return Ok(out.write(q.py(), &self.field.sample(&one).torque));
        }
        let configurations = Configurations::new(q, joints)?;
        let look_up = |q: &[f64], out: &mut [f64]| self.field.torques(q, out, None).map_err(errors::rows);
        Ok(configurations.fill(&[joints], out, look_up)?.into_any())
    }

    /// Energy that the object stores (J), one number for each configuration; zero where the dataset does not hold it.
    fn energy<'py>(&self, q: &Bound<'py, PyAny>) -> PyResult<Array<'py, f64>> {
        let joints = self.field.joints();
        Configurations::new(q, joints)?.fill(&[], None, |q, out: &mut [f64]| {
            fill_rows(q, joints, out, |q, out| out[0] = self.field.sample(q).energy).map_err(errors::rows)
        })
    }

    /// Signed distance of the arm to the surface at rest (m), interpolated linearly; far from contact a lower bound of
    /// it, and NaN outside the grid. DatasetError where the dataset does not hold it.
    fn gap<'py>(&self, py: Python<'py>, q: &Bound<'py, PyAny>) -> PyResult<Array<'py, f64>> {
        let joints = self.field.joints();
        let gap = self.dataset.get().dataset.gap.as_ref().ok_or_else(|| errors::absent(py, "gap"))?;
        Configurations::new(q, joints)?.fill(&[], None, |q, out: &mut [f64]| {
            let write = |q: &[f64], out: &mut [f64]| out[0] = self.field.grid().interpolate(gap, q);
            fill_rows(q, joints, out, write).map_err(errors::rows)
        })
    }

    /// Slope d tau/d q (N m/rad), a matrix for each configuration: entry (k, l) is the change of torque k with joint l.
    /// On a face of a grid cell it is the mean of both sides.
    fn gradient<'py>(&self, q: &Bound<'py, PyAny>) -> PyResult<Array<'py, f64>> {
        let joints = self.field.joints();
        Configurations::new(q, joints)?.fill(&[joints, joints], None, |q, out: &mut [f64]| {
            fill_rows(q, joints, out, |q, out| self.field.slope(q, out)).map_err(errors::rows)
        })
    }

    /// 0 free, 1 contact, 2 beside a grid point that did not converge, 4 outside the grid or beside one that was not
    /// computed.
    fn status<'py>(&self, q: &Bound<'py, PyAny>) -> PyResult<Array<'py, u8>> {
        let joints = self.field.joints();
        Configurations::new(q, joints)?.fill(&[], None, |q, out: &mut [u8]| {
            fill_rows(q, joints, out, |q, out| out[0] = self.field.sample(q).status() as u8).map_err(errors::rows)
        })
    }

    fn __repr__(&self) -> String {
        format!("Field(joints={})", self.field.joints())
    }
}
