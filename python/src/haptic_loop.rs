//! The passive haptic loop, driven tick by tick by the caller's own device.

use crate::{arrays, dataset::Dataset, errors, threads};
use haptize::{
    JointVector,
    render::{
        haptic::{Haptics, Inputs, Output, State},
        setup::Setup,
    },
};
use numpy::PyArray1;
use pyo3::{
    exceptions::{PyRuntimeError, PyValueError},
    prelude::*,
    types::PyDict,
};
use std::sync::Arc;

/// The haptic loop of a dataset's scene: the virtual proxy, its coupling to the device, the torque field, and the
/// watchdog.
///
/// Loop(dataset, gains=None): gains in the place of the scene's, a dict of what `[haptics]` names, one number for all
/// joints or one each: coupling_stiffness, coupling_damping, device_damping, proxy_damping, boundary_slope,
/// torque_limit, torque_rate_limit, speed_limit.
///
/// Call start with the device's position, then tick once a period. Python cannot promise to come in time: the loop lets
/// go where it does not.
#[pyclass(module = "haptize")]
pub struct Loop {
    haptics: Arc<Haptics>,
    warnings: Vec<String>,
    state: Option<State>,
    last: Option<Output>,
}

#[pymethods]
impl Loop {
    #[new]
    #[pyo3(signature = (dataset, gains = None))]
    fn new(py: Python<'_>, dataset: &Bound<'_, Dataset>, gains: Option<&Bound<'_, PyDict>>) -> PyResult<Self> {
        let dataset = &dataset.get().dataset;
        let setup = threads::detach(py, || Setup::new(dataset))?.map_err(|error| errors::dataset(py, &error))?;
        let (haptics, advice) = match gains {
            None => (setup.haptics, setup.advice),
            Some(gains) => {
                let mut spec = setup.scene.haptics.clone();
                for (key, value) in gains {
                    let values = arrays::numbers(&value)?.0;
                    let key: String = key.extract()?;
                    spec.set_gain(&key, &values).map_err(|error| PyValueError::new_err(error.to_string()))?;
                }
                let retuned = threads::detach(py, || setup.retuned(dataset, &spec))?;
                let retuned = retuned.map_err(|error| errors::dataset(py, &error))?;
                (Arc::new(retuned.0), retuned.1)
            }
        };
        let warnings = advice.into_iter().collect();
        Ok(Self { haptics, warnings, state: None, last: None })
    }

    /// Gains beyond their passivity bounds, with values that would be passive; empty where all gains keep theirs.
    #[getter]
    fn warnings(&self) -> Vec<String> {
        self.warnings.clone()
    }

    /// Number of joints d.
    #[getter]
    fn joints(&self) -> usize {
        self.haptics.joints()
    }

    /// Time between two ticks for which the gains are meant (s).
    #[getter]
    fn period(&self) -> f64 {
        self.haptics.period()
    }

    /// Begin at the device's position y (rad; m), or begin anew after a fault; the torque goes on from what the device
    /// is under.
    fn start(&mut self, y: &Bound<'_, PyAny>) -> PyResult<()> {
        let position = arrays::vector("y", y, self.haptics.joints())?;
        let started = match &mut self.state {
            Some(state) => self.haptics.restart(state, &position),
            None => self.haptics.start(&position).map(|state| self.state = Some(state)),
        };
        self.last = None;
        started.map_err(|fault| PyValueError::new_err(fault.to_string()))
    }

    /// One tick: returns the torque that the device is to exert until the next (N m; N), in `out` where that is given,
    /// an array of float64.
    ///
    /// y: the device's position (rad; m). dt: time since the tick before (s). age: time since y was measured (s).
    ///
    /// Whatever is wrong with them makes `fault` a text and lets the torque go to zero, until start; only shapes raise.
    #[pyo3(signature = (y, dt, age = 0.0, out = None))]
    fn tick<'py>(
        &mut self,
        py: Python<'py>,
        y: &Bound<'py, PyAny>,
        dt: f64,
        age: f64,
        out: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let joints = self.haptics.joints();
        let position = arrays::vector("y", y, joints)?;
        let state = self.state.as_mut().ok_or_else(|| PyRuntimeError::new_err("call start before the first tick"))?;
        let out = arrays::Output::new(out, joints)?;
        let output = self.haptics.tick(state, &Inputs { position, age, elapsed: dt, interval: dt });
        self.last = Some(output);
        Ok(out.write(py, &output.torque))
    }

    /// Why the loop has let go and what to do about it; None where it has not.
    #[getter]
    fn fault(&self) -> Option<String> {
        Some(self.state.as_ref()?.fault()?.to_string())
    }

    /// Position of the virtual proxy at the last tick (rad; m); None before the first.
    #[getter]
    fn proxy<'py>(&self, py: Python<'py>) -> Option<Bound<'py, PyArray1<f64>>> {
        self.vector(py, |output| output.proxy)
    }

    /// Contact torque on the proxy at the last tick (N m; N); None before the first.
    #[getter]
    fn contact_torque<'py>(&self, py: Python<'py>) -> Option<Bound<'py, PyArray1<f64>>> {
        self.vector(py, |output| output.sample.torque)
    }

    /// Whether the proxy was in contact at the last tick.
    #[getter]
    fn contact(&self) -> bool {
        self.last.is_some_and(|output| output.sample.contact)
    }

    /// Remarks on the last tick, as bits: 1 outside the grid, 2 beside a grid point that was not computed, 4 beside one
    /// that did not converge, 8 held by the boundary layer, 16 a joint at its limit, 32 torque cut in size, 64 torque
    /// cut in rate, 128 held at the border of the haptized range.
    #[getter]
    fn flags(&self) -> u8 {
        self.last.map_or(0, |output| output.flags.bits())
    }
}

impl Loop {
    fn vector<'py>(&self, py: Python<'py>, of: impl Fn(&Output) -> JointVector) -> Option<Bound<'py, PyArray1<f64>>> {
        Some(PyArray1::from_slice(py, &of(self.last.as_ref()?)))
    }
}
