//! Work in the background, so that the window never freezes: opening a file, baking a scene. It reports progress, can
//! be cancelled, and ends with something [`Loaded`] or with the reason in words.

use super::{
    background::Pending,
    body::Body,
    loaded::Loaded,
    placing::{Edit, edited},
};
use crate::{
    Error, ErrorKind,
    dataset::{Dataset, Surface},
    gpu::{AdapterChoice, AdapterSummary, Context, GpuError, GpuSolver},
    proxy::Chain,
    scene::Scene,
    sweep::{BackendChoice, ChosenBackend, Progress, Run, build_object, is_worth_a_gpu, model_of, remedied, sweep_of},
};
use std::{
    fmt,
    path::PathBuf,
    sync::{
        Arc,
        atomic::{AtomicBool, Ordering},
        mpsc,
    },
    time::SystemTime,
};

/// The work to be done.
#[derive(Clone)]
pub enum Task {
    /// Open a scene, to be solved live, or a dataset.
    Open(PathBuf),
    /// Open the dataset of a real object, and the scene of its twin.
    OpenTwinned(PathBuf, PathBuf),
    /// Bake a scene, on the geometry that a dataset holds of its object where there is one: its mesh is not read again
    /// then.
    Bake(Arc<Scene>, Option<Surface>),
    /// Change a scene, which is then solved live.
    Edit(Arc<Scene>, Edit),
}

/// The backend of a bake.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub enum Solver {
    /// The CPU for what it solves in seconds; else the window's adapter if it is a hardware GPU.
    #[default]
    Auto,
    /// All cores, f64.
    Cpu,
    /// This adapter.
    Adapter(AdapterSummary),
}

impl Solver {
    /// All that this machine has.
    #[must_use]
    pub fn all() -> Vec<Self> {
        [Self::Auto, Self::Cpu].into_iter().chain(crate::gpu::adapters().into_iter().map(Self::Adapter)).collect()
    }

    /// Returns what the name stands for.
    #[must_use]
    pub fn what(&self) -> String {
        match self {
            Self::Auto => {
                "The CPU for what it solves in seconds, else the window's adapter if it is a hardware GPU".into()
            }
            Self::Cpu => "All cores, in f64".into(),
            Self::Adapter(adapter) => adapter.to_string(),
        }
    }

    /// The device to bake on; none for the CPU. `context` is the window's.
    fn device(&self, context: &Arc<Context>) -> Result<Option<Arc<Context>>, GpuError> {
        Ok(match self {
            Self::Cpu => None,
            Self::Auto => context.adapter().hardware.then(|| Arc::clone(context)),
            Self::Adapter(adapter) if adapter == context.adapter() => Some(Arc::clone(context)),
            Self::Adapter(adapter) => Some(Arc::new(Context::open(AdapterChoice::This(adapter.clone()))?)),
        })
    }
}

impl fmt::Display for Solver {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Auto => f.write_str("auto"),
            Self::Cpu => f.write_str("CPU"),
            Self::Adapter(adapter) => {
                write!(f, "{}, {}", short(&adapter.name), adapter.interface)?;
                if adapter.address.is_empty() { Ok(()) } else { write!(f, ", {}", adapter.address) }
            }
        }
    }
}

/// The beginning of an adapter's name.
#[must_use]
pub fn short(name: &str) -> &str {
    name.split(" (").next().unwrap_or(name)
}

/// The remedy in the window where a GPU cannot bake.
const ON_THE_CPU: &str = "the CPU (Haptization: Solve on CPU)";

/// How a job ended.
pub enum JobResult {
    /// Ready, with the object where there is one to draw.
    Loaded(Box<(Loaded, Option<Body>)>),
    /// Somebody cancelled it.
    Cancelled,
    /// Why it failed and what to do.
    Failed(String),
}

/// A job under way. Dropping it cancels it.
pub struct Job {
    /// The work that it does, for its progress bar.
    pub title: String,
    /// How far it has come, as far as is known.
    pub progress: Progress,
    news: mpsc::Receiver<Progress>,
    stop: Arc<AtomicBool>,
    outcome: Pending<JobResult>,
}

impl Job {
    /// Begins `task`; a bake is done by `solver`. `context` is the window's device. `wake` is called whenever there is
    /// news.
    ///
    /// # Errors
    /// In words, when the system gives no thread.
    pub fn begin(
        task: Task,
        solver: Solver,
        context: Arc<Context>,
        wake: impl Fn() + Clone + Send + 'static,
    ) -> Result<Self, String> {
        let title = match &task {
            Task::Open(path) | Task::OpenTwinned(path, _) => {
                format!("Opening {}", path.file_name().unwrap_or(path.as_os_str()).display())
            }
            Task::Bake(scene, _) => format!("Haptizing {}", scene.name),
            Task::Edit(scene, _) => format!("Placing {}", scene.name),
        };
        let stop = Arc::new(AtomicBool::new(false));
        let (sender, news) = mpsc::channel();
        let (flag, tell) = (Arc::clone(&stop), wake.clone());
        let work = move || {
            let mut progress = |progress| {
                // A window that is gone needs no news.
                let _ = sender.send(progress);
                tell();
            };
            match run(task, &solver, &context, &flag, &mut progress) {
                Ok(loaded) => JobResult::Loaded(Box::new(loaded)),
                Err(error) if error.kind() == ErrorKind::Stopped => JobResult::Cancelled,
                Err(error) => JobResult::Failed(remedied(&error.to_string(), ON_THE_CPU)),
            }
        };
        let outcome = Pending::begin("bake", work, wake)?;
        Ok(Self { title, progress: Progress::default(), news, stop, outcome })
    }

    /// Takes the news; answers with the outcome once it is over.
    pub fn poll(&mut self) -> Option<JobResult> {
        self.progress = self.news.try_iter().last().unwrap_or(self.progress);
        Some(self.outcome.poll()?.unwrap_or_else(JobResult::Failed))
    }

    /// Asks it to end soon.
    pub fn cancel(&self) {
        self.stop.store(true, Ordering::Relaxed);
    }
}

impl Drop for Job {
    fn drop(&mut self) {
        self.cancel();
    }
}

fn run(
    task: Task,
    solver: &Solver,
    context: &Arc<Context>,
    stop: &AtomicBool,
    progress: &mut dyn FnMut(Progress),
) -> Result<(Loaded, Option<Body>), Error> {
    let loaded = match task {
        Task::Open(path) if Scene::is_at(&path) => Loaded::live(Scene::load(&path)?)?,
        Task::Open(path) => {
            let dataset = Dataset::load(&path)?;
            Loaded::new(dataset, None, Some(path.clone())).map_err(|error| format!("{}: {error}", path.display()))?
        }
        Task::Edit(scene, edit) => {
            let (scene, start) = edited(&scene, &edit)?;
            Loaded { edited: true, at: start, ..Loaded::live(scene)? }
        }
        Task::OpenTwinned(path, twin) => {
            let (dataset, twin) = (Dataset::load(&path)?, Scene::load(&twin)?);
            Loaded::twinned(dataset, twin, path.clone()).map_err(|error| format!("{}: {error}", path.display()))?
        }
        Task::Bake(scene, surface) => bake((*scene).clone(), surface, solver, context, stop, progress)?,
    };
    let body = Body::new(context, &loaded, &loaded.tuning().graphics)?;
    Ok((loaded, body))
}

fn bake(
    scene: Scene,
    surface: Option<Surface>,
    solver: &Solver,
    context: &Arc<Context>,
    stop: &AtomicBool,
    progress: &mut dyn FnMut(Progress),
) -> Result<Loaded, Error> {
    let object = match surface {
        Some(surface) => surface.object(&scene.object)?,
        None => build_object(&scene)?,
    };
    let chain = Chain::new(&scene.proxy);
    let model = model_of(&scene, &object, &chain)?;
    let on = |device| GpuSolver::new(device, &model).map(|solver| ChosenBackend::on(solver, &model));
    let cpu = || ChosenBackend::open(BackendChoice::Cpu, &model);
    let device = solver.device(context);
    let (mut backend, for_long_work) = match solver {
        Solver::Auto => (cpu()?, device?),
        _ => {
            let gpu = device.and_then(|device| device.map(on).transpose());
            let gpu = gpu.map_err(|error| {
                format!("{solver} cannot bake: {error}. Choose the CPU or another adapter in the window")
            })?;
            (gpu.map_or_else(cpu, Ok)?, None)
        }
    };
    let date = humantime::format_rfc3339_seconds(SystemTime::now()).to_string();
    let mut sweep = sweep_of(&scene, &model, [backend.name(), &backend.adapter(), &date], None)?;
    if let Some(device) = for_long_work
        && is_worth_a_gpu(sweep.predict(&mut backend, true)?)
        // Where the GPU cannot take the scene the CPU can.
        && let Ok(gpu) = on(device)
    {
        backend = gpu;
        sweep.solved_by(&backend);
    }
    let chunk = backend.chunk();
    let (dataset, report) = sweep.run(&mut backend, Run { chunk, stop, progress })?;
    let mut loaded = Loaded::new(dataset, Some(scene), None)?;
    loaded.report = Some(Arc::new(report));
    Ok(loaded)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{object::Object, scene::Placement, scene::Shape};

    /// How `task` ends on `solver`.
    fn done(task: Task, solver: Solver, context: &Arc<Context>) -> JobResult {
        let (wake, woken) = mpsc::channel();
        let mut job = Job::begin(task, solver, Arc::clone(context), move || {
            let _ = wake.send(());
        })
        .unwrap();
        woken.iter().find_map(|()| job.poll()).unwrap()
    }

    #[test]
    fn an_adapter_that_does_not_answer_is_told_with_what_to_do() {
        let context = Arc::new(Context::open(AdapterChoice::Any).unwrap());
        let scene = Scene::parse(include_str!("../../tests/scenes/sphere.toml"), "sphere.toml").unwrap();
        let gone = AdapterSummary { name: "Unplugged (1)".into(), ..context.adapter().clone() };
        let task = Task::Bake(Arc::new(scene), None);
        let JobResult::Failed(why) = done(task, Solver::Adapter(gone), &context) else {
            panic!("an adapter that is not there baked")
        };
        assert!(why.contains("Unplugged") && why.contains(&context.adapter().name), "{why}");
        assert!(why.contains("Choose the CPU or another adapter"), "{why}");
    }

    #[test]
    fn a_bake_on_a_stored_surface_reads_no_mesh() {
        let context = Arc::new(Context::open(AdapterChoice::Any).unwrap());
        let mut scene = Scene::parse(include_str!("../../tests/scenes/sphere.toml"), "sphere.toml").unwrap();
        let surface = Surface::of(&Object::build(&scene.object).unwrap());
        let file = "gone.obj".into();
        scene.object.shape = Shape::Mesh { file, placement: Placement::METRES, refine: None };
        scene.grid.axes.iter_mut().for_each(|axis| axis.count = 2);
        let bake = |surface| done(Task::Bake(Arc::new(scene.clone()), surface), Solver::Cpu, &context);
        assert!(matches!(bake(Some(surface)), JobResult::Loaded(_)));
        assert!(matches!(bake(None), JobResult::Failed(why) if why.contains("gone.obj")));
    }
}
