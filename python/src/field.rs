//! Torque fields: look-ups of one configuration or a million.

use crate::{
    arrays::{self, Configurations, Output, plain_vector},
    dataset::Dataset,
    errors, threads,
};
use glam::DVec3;
use haptize::{
    JointVector, dataset,
    field::{TorqueField, fill_rows},
    object::Object,
    render::{
        graphics::ContactForces,
        setup::{self, Setup},
    },
    scene::Interpolation,
};
use numpy::PyArrayDyn;
use pyo3::{exceptions::PyValueError, prelude::*, types::PyDict};
use std::{path::PathBuf, sync::OnceLock};

/// The torque field of a dataset, looked up between grid points as its scene has it felt.
///
/// Field(dataset, interpolation=None, bounds_error=False, fill_value=None): interpolation is "linear" or "potential"; by
/// default the scene's. Outside the grid the torque falls to zero within one cell; with bounds_error a ValueError says
/// so, with fill_value torque, energy, gap and gradient are that number there.
///
/// Each look-up takes a configuration q (rad; m), an array of one entry per joint, or any array of such in its last
/// axis, and works on all cores; Ctrl-C ends it. Wrong shapes and numbers that are not finite raise ValueError. Threads
/// may share a field.
#[pyclass(frozen, module = "haptize")]
pub struct Field {
    field: TorqueField,
    /// The dataset, which only a look at it needs.
    dataset: Py<Dataset>,
    interpolation: Option<Interpolation>,
    bounds_error: bool,
    fill_value: Option<f64>,
    /// Made when it is first asked for.
    body: OnceLock<Body>,
}

/// The object of a dataset, and the forces on it.
struct Body {
    object: Object,
    forces: ContactForces,
}

impl Field {
    /// Answers for the rows of `q` that lie outside the grid, as was asked for: by an error, or by other numbers in
    /// `out`. `first`: number of the first row.
    fn bound(&self, first: usize, q: &[f64], out: &mut [f64]) -> PyResult<()> {
        let joints = self.field.joints();
        let outside = |q: &[f64]| self.field.grid().fade(q) < 1.0;
        if self.bounds_error
            && let Some(row) = q.chunks_exact(joints).position(outside)
        {
            let row = first + row;
            return Err(PyValueError::new_err(format!("configuration {row} is outside the grid (counted from 0)")));
        }
        if let Some(fill) = self.fill_value {
            let width = joints * out.len() / q.len().max(1);
            let rows = q.chunks_exact(joints).zip(out.chunks_exact_mut(width.max(1)));
            rows.filter(|(q, _)| outside(q)).for_each(|(_, out)| out.fill(fill));
        }
        Ok(())
    }

    /// One row of `out` for each of `q`, by `write`.
    fn fill<'py>(
        &self,
        q: &Bound<'py, PyAny>,
        row: &[usize],
        write: impl Fn(&[f64], &mut [f64]) + Sync + Send,
    ) -> PyResult<Array<'py, f64>> {
        let joints = self.field.joints();
        Configurations::new(q, joints)?.fill(row, None, |first, q, out: &mut [f64]| {
            fill_rows(q, joints, out, &write).map_err(errors::rows)?;
            self.bound(first, q, out)
        })
    }

    /// The object and the forces on it; DatasetError where the dataset does not hold them.
    fn body(&self, py: Python<'_>) -> PyResult<&Body> {
        if let Some(body) = self.body.get() {
            return Ok(body);
        }
        let dataset = &self.dataset.get().dataset;
        let made = threads::detach(py, || {
            let object = Setup::new(dataset)?.object;
            object
                .map(|object| Ok(Body { forces: ContactForces::new(dataset, object.rest.len())?, object }))
                .transpose()
        })?;
        let made = made.map_err(|error: haptize::Error| errors::dataset(py, &error))?;
        let made = made.ok_or_else(|| errors::absent(py, "contact forces and surface"))?;
        Ok(self.body.get_or_init(|| made))
    }

    /// Three numbers for each node of the object's surface, by what `of_forces` makes of the forces on all nodes (N).
    fn vectors<'py>(
        &self,
        q: &Bound<'py, PyAny>,
        of_forces: impl Fn(&Object, Vec<DVec3>) -> PyResult<Vec<DVec3>> + Send + Sync,
    ) -> PyResult<Array<'py, f64>> {
        let Body { object, forces } = self.body(q.py())?;
        let (joints, nodes) = (self.field.joints(), object.surface_nodes);
        Configurations::new(q, joints)?.fill(&[nodes, 3], None, |_, q, out: &mut [f64]| {
            for (q, out) in q.chunks_exact(joints).zip(out.chunks_exact_mut(3 * nodes)) {
                let mut on_nodes = vec![DVec3::ZERO; object.rest.len()];
                forces.at(q, self.field.sample(q).share, &mut on_nodes);
                let vectors = of_forces(object, on_nodes)?;
                out.chunks_exact_mut(3).zip(vectors).for_each(|(out, vector)| out.copy_from_slice(&vector.to_array()));
            }
            Ok(())
        })
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
    #[pyo3(signature = (dataset, interpolation = None, bounds_error = false, fill_value = None))]
    fn new(
        py: Python<'_>,
        dataset: Py<Dataset>,
        interpolation: Option<&str>,
        bounds_error: bool,
        fill_value: Option<f64>,
    ) -> PyResult<Self> {
        let interpolation = interpolation.map(named).transpose()?;
        let data = &dataset.get().dataset;
        let field = threads::detach(py, || setup::field(data, interpolation))?;
        let field = field.map_err(|error| errors::dataset(py, &error))?;
        Ok(Self { field, dataset, interpolation, bounds_error, fill_value, body: OnceLock::new() })
    }

    /// Open the dataset file at `path` and make its field.
    #[staticmethod]
    #[pyo3(signature = (path, interpolation = None, bounds_error = false, fill_value = None))]
    fn open(
        py: Python<'_>,
        path: PathBuf,
        interpolation: Option<&str>,
        bounds_error: bool,
        fill_value: Option<f64>,
    ) -> PyResult<Self> {
        let opened = threads::detach(py, || dataset::Dataset::open(&path))?;
        let opened = opened.map_err(|error| errors::dataset(py, &error))?;
        Self::new(py, Py::new(py, Dataset::new(opened, None))?, interpolation, bounds_error, fill_value)
    }

    /// The interpolation that was asked for, or None.
    #[getter]
    fn interpolation(&self) -> Option<&str> {
        self.interpolation.map(Interpolation::name)
    }

    /// Whether a configuration outside the grid raises ValueError.
    #[getter]
    fn bounds_error(&self) -> bool {
        self.bounds_error
    }

    /// Torque, energy, gap and gradient outside the grid, or None.
    #[getter]
    fn fill_value(&self) -> Option<f64> {
        self.fill_value
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
            let mut torque = self.field.sample(&one).torque;
            self.bound(0, &one, &mut torque)?;
            return Ok(out.write(q.py(), &torque));
        }
        let configurations = Configurations::new(q, joints)?;
        let look_up = |first: usize, q: &[f64], out: &mut [f64]| {
            self.field.torques(q, out, None).map_err(errors::rows)?;
            self.bound(first, q, out)
        };
        Ok(configurations.fill(&[joints], out, look_up)?.into_any())
    }

    /// Energy that the object stores (J), one number for each configuration; zero where the dataset does not hold it.
    fn energy<'py>(&self, q: &Bound<'py, PyAny>) -> PyResult<Array<'py, f64>> {
        self.fill(q, &[], |q, out| out[0] = self.field.sample(q).energy)
    }

    /// Signed distance of the arm to the surface at rest (m), interpolated linearly; far from contact a lower bound of
    /// it, and NaN outside the grid. DatasetError where the dataset does not hold it.
    fn gap<'py>(&self, py: Python<'py>, q: &Bound<'py, PyAny>) -> PyResult<Array<'py, f64>> {
        let gap = self.dataset.get().dataset.gap.as_ref().ok_or_else(|| errors::absent(py, "gap"))?;
        self.fill(q, &[], |q, out| out[0] = self.field.grid().interpolate(gap, q))
    }

    /// Slope d tau/d q (N m/rad), a matrix for each configuration: entry (k, l) is the change of torque k with joint l.
    /// On a face of a grid cell it is the mean of both sides.
    fn gradient<'py>(&self, q: &Bound<'py, PyAny>) -> PyResult<Array<'py, f64>> {
        let joints = self.field.joints();
        self.fill(q, &[joints, joints], |q, out| self.field.slope(q, out))
    }

    /// Contact forces on the nodes of the object's surface (N), shape (nodes, 3) for each configuration: those that are
    /// stored, interpolated like the torque, or over a refined dataset solved. DatasetError where the dataset does not
    /// hold them.
    fn forces<'py>(&self, q: &Bound<'py, PyAny>) -> PyResult<Array<'py, f64>> {
        self.vectors(q, |_, forces| Ok(forces))
    }

    /// How far these forces move the nodes of the object's surface from `dataset.surface` (m), shape (nodes, 3) for each
    /// configuration. The first call prepares the object, for seconds where it is large.
    fn displacement<'py>(&self, q: &Bound<'py, PyAny>) -> PyResult<Array<'py, f64>> {
        self.vectors(q, |object, forces| {
            let mechanics = object.mechanics().map_err(|error| errors::bake(&error))?;
            Ok(mechanics.displacement_under(&forces))
        })
    }

    /// The numbers that look-ups read, for those in array operations (haptize.torch, haptize.jax): a dict of `start` and
    /// `step` (rad; m), `count`, `records`, one row for each grid point in C order, `free_energy` (J), and `compliance`,
    /// which is None where the energy is interpolated. DatasetError where the dataset is refined.
    fn tables<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let tables = self.field.tables().ok_or_else(|| errors::refined(py))?;
        let axes = &self.field.grid().axes;
        let line = |values: Vec<f64>| arrays::array(py, values, &[axes.len()]);
        let rows = self.field.grid().points();
        let found = PyDict::new(py);
        found.set_item("start", line(axes.iter().map(|axis| axis.start).collect())?)?;
        found.set_item("step", line(axes.iter().map(|axis| axis.step).collect())?)?;
        let counts = axes.iter().map(|axis| axis.count as i64).collect();
        found.set_item("count", arrays::array::<i64>(py, counts, &[axes.len()])?)?;
        let width = tables.records.len() / rows;
        found.set_item("records", arrays::array(py, tables.records.to_vec(), &[rows, width])?)?;
        found.set_item("free_energy", tables.free_energy)?;
        found.set_item("compliance", tables.compliance.map(|compliance| line(compliance.to_vec())).transpose()?)?;
        Ok(found)
    }

    /// 0 free, 1 contact, 2 beside a grid point that did not converge, 4 outside the grid or beside one that was not
    /// computed.
    fn status<'py>(&self, q: &Bound<'py, PyAny>) -> PyResult<Array<'py, u8>> {
        let joints = self.field.joints();
        Configurations::new(q, joints)?.fill(&[], None, |_, q, out: &mut [u8]| {
            fill_rows(q, joints, out, |q, out| out[0] = self.field.sample(q).status() as u8).map_err(errors::rows)
        })
    }

    /// The page of the field's dataset.
    fn _repr_html_(&self, py: Python<'_>) -> PyResult<String> {
        self.dataset.get()._repr_html_(py)
    }

    fn __repr__(&self) -> String {
        format!("Field(joints={})", self.field.joints())
    }
}
