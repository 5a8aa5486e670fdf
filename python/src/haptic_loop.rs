//! The passive haptic loop, driven tick by tick by the caller's own device.

use crate::{arrays, background, dataset::Dataset, errors, scene::Scene, threads};
use haptize::{
    JointVector, dataset,
    render::{
        driven::DrivenLoop,
        haptic::{Haptics, Inputs, Output},
        live::LiveScene,
        setup::Setup,
    },
};
use numpy::PyArray1;
use pyo3::{
    exceptions::{PyRuntimeError, PyValueError},
    prelude::*,
    types::PyDict,
};
use std::sync::{Arc, atomic::AtomicBool};

/// The haptic loop of a dataset's scene: the virtual proxy, its coupling to the device, the torque field, and the
/// watchdog. Or that of a scene for which nothing was baked: contact is then solved in every tick, before the surface at
/// rest.
///
/// Loop(source, gains=None): source is a Dataset or a Scene; gains in the place of the scene's, a dict of what `[haptics]` names, one number for all
/// joints or one each: coupling_stiffness, coupling_damping, device_damping, proxy_damping, boundary_slope,
/// torque_limit, torque_rate_limit, speed_limit.
///
/// Call start with the device's position, then tick once a period. Python cannot promise to come in time: the loop lets
/// go where it does not.
#[pyclass(module = "haptize")]
pub struct Loop {
    haptics: Arc<Haptics>,
    warnings: Vec<String>,
    driven: Option<DrivenLoop>,
    last: Option<Output>,
}

/// The setup of a scene that is solved in every tick, and its dataset, in which nothing is stored.
fn live(py: Python<'_>, scene: &Bound<'_, Scene>) -> PyResult<(Setup, dataset::Dataset, Option<&'static str>)> {
    let scene = scene.get().scene.clone();
    let build = move |_: &dyn Fn(())| LiveScene::new(scene);
    let built = background::run(py, &AtomicBool::new(false), build, |()| Ok(()))?;
    let scene = Arc::new(built.map_err(|error| errors::bake(&error))?);
    let (dataset, notice) = (scene.dataset(), scene.notice());
    let setup = threads::detach(py, || Setup::live(scene, &dataset))?.map_err(|error| errors::dataset(py, &error))?;
    Ok((setup, dataset, notice))
}

#[pymethods]
impl Loop {
    #[new]
    #[pyo3(signature = (source, gains = None))]
    fn new(py: Python<'_>, source: &Bound<'_, PyAny>, gains: Option<&Bound<'_, PyDict>>) -> PyResult<Self> {
        let (bare, notice);
        let (setup, dataset) = if let Ok(scene) = source.cast::<Scene>() {
            let setup;
            (setup, bare, notice) = live(py, scene)?;
            (setup, &bare)
        } else {
            notice = None;
            let dataset = &source.cast::<Dataset>()?.get().dataset;
            let setup = threads::detach(py, || Setup::new(dataset))?;
            (setup.map_err(|error| errors::dataset(py, &error))?, dataset)
        };
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
        let warnings = notice.map(str::to_owned).into_iter().chain(advice.map(|advice| advice.text)).collect();
        Ok(Self { haptics, warnings, driven: None, last: None })
    }

    /// Gains beyond their passivity bounds, with values that would be passive, and whether contact is solved otherwise
    /// than the scene says; empty where all is as it should be.
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
        let started = match &mut self.driven {
            Some(driven) => driven.restart(&position),
            None => DrivenLoop::new(Arc::clone(&self.haptics), &position).map(|driven| self.driven = Some(driven)),
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
        let driven = self.driven.as_mut().ok_or_else(|| PyRuntimeError::new_err("call start before the first tick"))?;
        let out = arrays::Output::new(out, joints)?;
        let output = driven.tick(&Inputs { position, age, elapsed: dt, interval: dt });
        self.last = Some(output);
        Ok(out.write(py, &output.torque))
    }

    /// Why the loop has let go and what to do about it; None where it has not.
    #[getter]
    fn fault(&self) -> Option<String> {
        Some(self.driven.as_ref()?.fault()?.to_string())
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
