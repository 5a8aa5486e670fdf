//! From a scene to its dataset: object and proxy are built, a backend is chosen, and the grid is swept.

use super::{BackendChoice, ChosenBackend, Progress, Run, Shard, Sweep, SweepReport};
use crate::{
    Error, ErrorKind, JointVector, MAX_AXES,
    contact::{MeshRipple, Model},
    dataset::Dataset,
    object::{Compliance, LatticeError, Object},
    proxy::Chain,
    random::Random,
    scene::{AxisSpec, JointSpec, Scene},
};
use std::{
    path::{Path, PathBuf},
    sync::atomic::AtomicBool,
};

/// Builds the object of `scene`, where there is memory to solve contact with it.
///
/// # Errors
/// Where it is refused, with its line in the scene.
pub fn build_object(scene: &Scene) -> Result<Object, Error> {
    let object = Object::build(&scene.object).and_then(|object| {
        // Of a larger surface only a part of the compliance is formed, and its size is checked when it is known.
        if object.surface_nodes <= Model::WHOLE {
            Compliance::check(&object, object.surface_nodes)?;
        }
        Ok(object)
    });
    object.map_err(|source| {
        let line = scene.text.lines().position(|line| line.trim_start_matches([' ', '[']).starts_with("object"));
        Error::on_line(&scene.path, line.map_or(1, |line| line + 1) as u64, source).of(ErrorKind::Scene)
    })
}

/// Remarks, before `model` is solved, on a mesh that shows through and on coarse cubes. Returns the error of the lattice in
/// its object, where there is one.
pub fn remark_on_mesh(model: &Model<'_>) -> Option<LatticeError> {
    if let Some(remedy) = MeshRipple::new(model).and_then(|ripple| ripple.remedy()) {
        log::warn!("{remedy}");
    }
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
        let Self { scene, backend, measured, aim, date, stop, progress } = self;
        let object = build_object(scene)?;
        let chain = Chain::new(&scene.proxy);
        let model = model_of(scene, &object, &chain)?;
        let at_first = backend.for_work(0.0);
        let mut chosen = ChosenBackend::open(at_first, &model)?;
        let mut sweep = sweep_of(scene, &object, &model, [chosen.name(), &chosen.adapter(), date], measured)?;
        if at_first != backend {
            let better = backend.for_work(sweep.predict(&mut chosen, true)?);
            if better != at_first {
                chosen = ChosenBackend::open(better, &model)?;
                sweep.solved_by(&chosen);
            }
        }
        sweep.binding.provenance.aim = aim;
        sweep.lattice = remark_on_mesh(&model);
        sweep.warnings.extend(sweep.lattice.and_then(|error| error.warning()));
        let run = Run { chunk: chosen.chunk(), stop, progress };
        work(&mut sweep, &mut chosen, run)
    }
}

/// The model by which the grid of `scene` is solved.
pub(crate) fn model_of<'a>(scene: &Scene, object: &'a Object, chain: &'a Chain) -> Result<Model<'a>, Error> {
    let mut model = Model::reaching(object, chain, scene.contact, &sample(scene))?;
    model.with_tangent = scene.uses_tangent();
    model.with_slip = scene.haptics.uses_slip();
    Ok(model)
}

/// The sweep of `scene`, whose object and model these are, with all that a dataset is to say; `solved` are backend,
/// adapter and date, and `measured` is as in [`Bake::measured`].
pub(crate) fn sweep_of<'a>(
    scene: &Scene,
    object: &Object,
    model: &'a Model<'a>,
    solved: [&str; 3],
    measured: Option<usize>,
) -> Result<Sweep<'a>, Error> {
    let mut sweep = Sweep::new(scene, object, solved[0], solved[1], solved[2])?;
    sweep.diagnose(model);
    sweep.skip_free_space(model)?;
    sweep.find_lowest(model)?;
    sweep.measure_error(model, &scene.haptics, measured)?;
    Ok(sweep)
}

/// A random configuration within the limits of `joints`.
pub(super) fn drawn(random: &mut Random, joints: &[JointSpec]) -> JointVector {
    joints.iter().map(|joint| random.between(joint.limits[0], joint.limits[1])).collect()
}

/// Grid points at which the proxy's reach is looked up, at most: between them it grows by less than what is added to
/// it.
const SAMPLES: usize = 1 << 16;

/// Configurations spread over the scene's grid, all of them where they are few, or over the joint limits where it
/// leaves the grid out, at random where the arm has more joints than a grid has axes: what [`Model::reaching`] looks
/// at.
#[must_use]
pub fn sample(scene: &Scene) -> Vec<JointVector> {
    let joints = &scene.proxy.joints;
    if joints.len() > MAX_AXES {
        let mut random = Random::new(1);
        return (0..SAMPLES).map(|_| drawn(&mut random, joints)).collect();
    }
    let count = (SAMPLES as f64).powf(1.0 / joints.len().max(1) as f64) as usize;
    let limits =
        |[least, greatest]: [f64; 2]| AxisSpec { start: least, step: (greatest - least) / (count - 1) as f64, count };
    let axes = match &scene.grid.axes[..] {
        [] => joints.iter().map(|joint| limits(joint.limits)).collect(),
        axes => axes.to_vec(),
    };
    let points: usize = axes.iter().map(|axis| axis.count).fold(1, usize::saturating_mul);
    // The same stride along each axis, the last line always included.
    let stride = (1..).find(|stride| points / usize::pow(*stride, axes.len() as u32).max(1) <= SAMPLES).unwrap_or(1);
    let mut configurations = vec![JointVector::zeros(axes.len())];
    for (j, axis) in axes.iter().enumerate() {
        let lines = (0..axis.count - 1).step_by(stride).chain([axis.count - 1]);
        let values: Vec<f64> = lines.map(|k| axis.start + k as f64 * axis.step).collect();
        let grown = configurations.iter().flat_map(|q| {
            values.iter().map(move |&value| {
                let mut q = *q;
                q[j] = value;
                q
            })
        });
        configurations = grown.collect();
    }
    configurations
}
