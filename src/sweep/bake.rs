//! From a scene to its dataset: object and proxy are built, a backend is chosen, and the grid is swept.

use super::{BackendChoice, ChosenBackend, Progress, Run, Shard, Sweep, SweepReport, model_within};
use crate::{
    Error,
    contact::{MeshRipple, Model},
    dataset::Dataset,
    object::{Compliance, LatticeError, Object},
    proxy::Chain,
    scene::{Checker, Scene},
};
use std::{
    path::{Path, PathBuf},
    sync::atomic::AtomicBool,
};

/// Builds the object of `scene`, where there is memory to solve contact with it.
///
/// # Errors
/// Where it is refused, with its place in the scene.
pub fn build_object(scene: &Scene) -> Result<Object, Error> {
    let object = shaped_object(scene)?;
    prove(scene, &object)?;
    Ok(object)
}

/// The same for who asks for its surface alone.
///
/// # Errors
/// As [`build_object`], but where the ground does not hold it.
pub fn shaped_object(scene: &Scene) -> Result<Object, Error> {
    Object::unproven(&scene.object).map_err(|source| refused(scene, source))
}

/// Sees to it that the ground of `scene` holds its `object`, and that there is memory to solve contact with it.
pub(super) fn prove(scene: &Scene, object: &Object) -> Result<(), Error> {
    // Of a larger surface only a part of the compliance is formed, and its size is checked when it is known.
    let is_whole = object.surface_nodes <= Model::WHOLE;
    let check = || if is_whole { Compliance::check(object, object.surface_nodes) } else { Ok(()) };
    check().and_then(|()| object.prove()).map_err(|source| refused(scene, source))
}

/// The error of the object of `scene`, with its place there.
fn refused(scene: &Scene, error: Error) -> Error {
    let checker = Checker { path: &scene.path, text: &scene.text };
    checker.at(error.key().unwrap_or("object"), &error)
}

/// Remarks, before `model` is solved, on a mesh that shows through.
pub fn remark_on_ripple(model: &Model<'_>) {
    if let Some(remedy) = MeshRipple::new(model).and_then(|ripple| ripple.remedy()) {
        log::warn!("{remedy}");
    }
}

/// The same, and on coarse cubes. Returns the error of the lattice in its object, where there is one.
pub fn remark_on_mesh(model: &Model<'_>) -> Option<LatticeError> {
    remark_on_ripple(model);
    let error = model.object.lattice_error(&model.compliance);
    error.and_then(|error| error.warning()).into_iter().for_each(|warning| log::warn!("{warning}"));
    error
}

/// How a scene is haptized.
pub struct Bake<'a> {
    /// Scene.
    pub scene: &'a Scene,
    /// Backend that solves.
    pub backend: BackendChoice,
    /// Random configurations at which the dataset's error is measured; 0 leaves it out. By default a tenth of the
    /// points in contact, at least 100 and at most 1,000.
    pub measured: Option<usize>,
    /// Rms error that the grid was chosen for, over the rms torque, where it was (1).
    pub aim: Option<f64>,
    /// Date that the dataset bears, ISO 8601, UTC.
    pub date: &'a str,
    /// When this becomes true the sweep stops soon.
    pub stop: &'a AtomicBool,
    /// Called at the start and several times a second.
    pub progress: &'a mut dyn FnMut(Progress),
}

/// Haptizes `scene` in memory on the CPU; its error is not measured, and it bears no date.
///
/// # Errors
/// As [`Bake::in_memory`].
pub fn baked(scene: &Scene) -> Result<(Dataset, SweepReport), Error> {
    let (backend, stop) = (BackendChoice::Cpu, AtomicBool::new(false));
    let bake = Bake { scene, backend, measured: Some(0), aim: None, date: "", stop: &stop, progress: &mut |_| () };
    bake.in_memory()
}

impl Bake<'_> {
    /// Haptizes into the file `output`, in memory that does not grow with the grid; see
    /// [`Sweep::bake`].
    ///
    /// # Errors
    /// When the object or the grid is refused, no backend opens, or the sweep fails or is stopped.
    pub fn to_file(self, output: &Path, resume: bool) -> Result<SweepReport, Error> {
        self.with(|sweep, backend, run| sweep.bake(backend, output, resume, run))
    }

    /// Haptizes in memory.
    ///
    /// # Errors
    /// When the object or the grid is refused, no backend opens, or the sweep fails or is stopped.
    pub fn in_memory(self) -> Result<(Dataset, SweepReport), Error> {
        self.with(|sweep, backend, run| sweep.run(backend, run))
    }

    /// The same with `model`, which knows all that the grid reaches; nobody asks for an error.
    pub(super) fn tried(self, model: &Model<'_>) -> Result<(Dataset, SweepReport), Error> {
        self.over(model, |sweep, backend, run| sweep.run(backend, run))
    }

    /// Solves one shard into a file in `folder`; see [`Sweep::bake_shard`].
    ///
    /// # Errors
    /// When the object or the grid is refused, no backend opens, or the sweep fails or is stopped.
    pub fn to_shard(self, folder: &Path, shard: Shard) -> Result<(PathBuf, Option<SweepReport>), Error> {
        self.prepared(|sweep, backend, run| {
            // What was sampled is the whole grid.
            sweep.forecast = None;
            sweep.bake_shard(backend, folder, shard, run)
        })
    }

    fn with<T>(
        self,
        sweep_with: impl FnOnce(&Sweep<'_>, &mut ChosenBackend<'_>, Run<'_>) -> Result<T, Error>,
    ) -> Result<T, Error> {
        self.prepared(|sweep, backend, run| {
            if sweep.forecast.is_none() {
                let is_timed = backend.is_cpu_alone();
                sweep.predict(backend, is_timed)?;
            }
            sweep_with(sweep, backend, run)
        })
    }

    /// Builds all that a sweep needs, and does `work` with it.
    pub(super) fn prepared<T>(
        self,
        work: impl FnOnce(&mut Sweep<'_>, &mut ChosenBackend<'_>, Run<'_>) -> Result<T, Error>,
    ) -> Result<T, Error> {
        let object = build_object(self.scene)?;
        let chain = Chain::new(&self.scene.proxy);
        let model = model_of(self.scene, &object, &chain)?;
        self.over(&model, |sweep, backend, run| {
            sweep.lattice = remark_on_mesh(&model);
            sweep.warnings.extend(sweep.lattice.and_then(|error| error.warning()));
            work(sweep, backend, run)
        })
    }

    /// The same with `model`, which knows all that the grid reaches.
    fn over<T>(
        self,
        model: &Model<'_>,
        work: impl FnOnce(&mut Sweep<'_>, &mut ChosenBackend<'_>, Run<'_>) -> Result<T, Error>,
    ) -> Result<T, Error> {
        let Self { scene, backend, measured, aim, date, stop, progress } = self;
        let at_first = backend.for_work(0.0);
        let mut chosen = ChosenBackend::open(at_first, model)?;
        let mut sweep = sweep_of(scene, model, [chosen.name(), &chosen.adapter(), date], measured)?;
        if at_first != backend {
            let better = backend.for_work(sweep.predict(&mut chosen, true)?);
            if better != at_first {
                chosen = ChosenBackend::open(better, model)?;
                sweep.solved_by(&chosen);
            }
        }
        sweep.binding.provenance.aim = aim;
        let run = Run { chunk: chosen.chunk(), stop, progress };
        work(&mut sweep, &mut chosen, run)
    }
}

/// The model by which the grid of `scene` is solved.
pub(crate) fn model_of<'a>(scene: &Scene, object: &'a Object, chain: &'a Chain) -> Result<Model<'a>, Error> {
    let mut model = model_within(scene, object, chain)?;
    add_extras(&mut model, scene);
    Ok(model)
}

/// Lets `model` solve what a dataset of `scene` holds beside torques.
pub(super) fn add_extras(model: &mut Model<'_>, scene: &Scene) {
    model.with_tangent = scene.uses_tangent();
    model.with_slip = scene.haptics.uses_slip();
}

/// The sweep of `scene`, whose model this is, with all that a dataset is to say; `solved` are backend, adapter and date,
/// and `measured` is as in [`Bake::measured`].
pub(crate) fn sweep_of<'a>(
    scene: &Scene,
    model: &'a Model<'a>,
    solved: [&str; 3],
    measured: Option<usize>,
) -> Result<Sweep<'a>, Error> {
    let mut sweep = Sweep::new(scene, model.object, solved[0], solved[1], solved[2])?;
    sweep.diagnose(model);
    sweep.skip_free_space(model)?;
    sweep.find_lowest(model)?;
    sweep.measure_error(model, &scene.haptics, measured)?;
    Ok(sweep)
}
