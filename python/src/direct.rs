//! Direct equilibria of a scene.

use crate::{
    arrays::{self, Configurations},
    background, errors,
    scene::Scene,
    threads,
};
use haptize::sweep::{Contact, Direct, Inspection};
use numpy::PyArrayDyn;
use pyo3::prelude::*;
use std::sync::atomic::AtomicBool;

/// The object and the arm of a scene, ready to be solved at any configuration. Threads may share it.
///
/// Solver(scene): builds the object, which takes seconds where it is large; Ctrl-C ends it. BakeError where it cannot
/// be built.
#[pyclass(frozen, module = "haptize")]
pub struct Solver {
    direct: Direct,
}

#[pymethods]
impl Solver {
    #[new]
    fn new(py: Python<'_>, scene: &Bound<'_, Scene>) -> PyResult<Self> {
        let scene = scene.get().scene.clone();
        let build = move |_: &dyn Fn(())| Direct::new(&scene);
        let built = background::run(py, &AtomicBool::new(false), build, |()| Ok(()))?;
        Ok(Self { direct: built.map_err(|error| errors::bake(&error))? })
    }

    /// Solve the configuration q (rad; m), one entry per joint, from the object at rest.
    fn solve(&self, py: Python<'_>, q: &Bound<'_, PyAny>) -> PyResult<Equilibrium> {
        let q = arrays::vector("q", q, self.direct.joints())?;
        let inspection = threads::detach(py, || self.direct.inspect(&q))?.map_err(errors::rows)?;
        Ok(Equilibrium { inspection })
    }

    /// Torques (N m; N) at many configurations, one in each row of the last axis of q, on all cores.
    fn torque<'py>(&self, q: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyArrayDyn<f64>>> {
        let joints = self.direct.joints();
        Configurations::new(q, joints)?.fill(&[joints], None, |_, q, out: &mut [f64]| {
            let torques = threads::run(|| self.direct.torques(q))?;
            out.copy_from_slice(&torques.map_err(errors::rows)?.0);
            Ok(())
        })
    }
}

/// Solve one configuration of a scene; Solver(scene) prepares once for many.
#[pyfunction]
pub fn solve(py: Python<'_>, scene: &Bound<'_, Scene>, q: &Bound<'_, PyAny>) -> PyResult<Equilibrium> {
    Solver::new(py, scene)?.solve(py, q)
}

/// The equilibrium of one configuration.
#[pyclass(frozen, module = "haptize")]
pub struct Equilibrium {
    inspection: Inspection,
}

impl Equilibrium {
    /// Three numbers for each of `vectors`.
    fn vectors(py: Python<'_>, vectors: impl ExactSizeIterator<Item = [f64; 3]>) -> PyResult<Py<PyArrayDyn<f64>>> {
        let count = vectors.len();
        arrays::array(py, vectors.flatten().collect(), &[count, 3])
    }
}

#[pymethods]
impl Equilibrium {
    /// "free", "contact", "unconverged" or "overflow".
    #[getter]
    fn status(&self) -> &str {
        &self.inspection.status
    }

    /// Torque on the arm (N m; N at prismatic joints).
    #[getter]
    fn torque(&self, py: Python<'_>) -> PyResult<Py<PyArrayDyn<f64>>> {
        arrays::array(py, self.inspection.torque.clone(), &[self.inspection.torque.len()])
    }

    /// Energy that object and contact store (J).
    #[getter]
    fn energy(&self) -> f64 {
        self.inspection.energy
    }

    /// Smallest signed distance of the arm's nodes to the surface at rest (m).
    #[getter]
    fn gap(&self) -> f64 {
        self.inspection.gap
    }

    /// Relative imbalance of forces (1).
    #[getter]
    fn residual(&self) -> f64 {
        self.inspection.residual
    }

    /// Iterations of the contact solver.
    #[getter]
    fn iterations(&self) -> u32 {
        self.inspection.iterations
    }

    /// Nodes of the object's surface at rest (m), shape (nodes, 3).
    #[getter]
    fn rest(&self, py: Python<'_>) -> PyResult<Py<PyArrayDyn<f64>>> {
        Self::vectors(py, self.inspection.object_nodes.iter().map(|node| node.rest.to_array()))
    }

    /// How far they have moved (m), shape (nodes, 3).
    #[getter]
    fn displacement(&self, py: Python<'_>) -> PyResult<Py<PyArrayDyn<f64>>> {
        Self::vectors(py, self.inspection.object_nodes.iter().map(|node| (node.position - node.rest).to_array()))
    }

    /// Contact forces on them (N), shape (nodes, 3).
    #[getter]
    fn forces(&self, py: Python<'_>) -> PyResult<Py<PyArrayDyn<f64>>> {
        Self::vectors(py, self.inspection.object_nodes.iter().map(|node| node.force.to_array()))
    }

    /// The arm's contact nodes (m), shape (nodes, 3).
    #[getter]
    fn arm(&self, py: Python<'_>) -> PyResult<Py<PyArrayDyn<f64>>> {
        Self::vectors(py, self.inspection.proxy_nodes.iter().map(|node| node.position.to_array()))
    }

    /// Contact forces on the arm's nodes (N), shape (nodes, 3). Before the surface at rest they have a part along it that
    /// does not act on the object.
    #[getter]
    fn arm_forces(&self, py: Python<'_>) -> PyResult<Py<PyArrayDyn<f64>>> {
        let force = |contact: &Contact| contact.force.to_array();
        let forces = self.inspection.proxy_nodes.iter().map(|node| node.contact.as_ref().map_or([0.0; 3], force));
        Self::vectors(py, forces)
    }

    fn __repr__(&self) -> String {
        format!("Equilibrium({}, torque={:?})", self.inspection.status, self.inspection.torque)
    }
}
