//! Work in the background, so that the window never freezes: opening a file, baking a scene. It reports progress, can be
//! cancelled, and ends with something [`Loaded`] or with the reason in words.

use super::loaded::Loaded;
use crate::{
    contact::Model,
    dataset::Dataset,
    gpu::{Context, GpuSolver},
    haptize::{BackendChoice, ChosenBackend, Progress, Run, Sweep, SweepError, sample},
    object::Object,
    proxy::Chain,
    scene::Scene,
};
use std::{
    error::Error,
    path::{Path, PathBuf},
    sync::{
        Arc,
        atomic::{AtomicBool, Ordering},
        mpsc,
    },
    thread,
    time::SystemTime,
};

/// What is to be done.
#[derive(Clone)]
pub enum Task {
    /// Open a scene, and bake it, or a dataset.
    Open(PathBuf),
    /// Bake a scene.
    Bake(Arc<Scene>),
}

/// How a job ended.
pub enum Outcome {
    /// Ready.
    Loaded(Box<Loaded>),
    /// Somebody cancelled it.
    Cancelled,
    /// Why it failed and what to do.
    Failed(String),
}

/// A job under way. Dropping it cancels it.
pub struct Job {
    /// What it does, for its progress bar.
    pub title: String,
    progress: Progress,
    stop: Arc<AtomicBool>,
    reports: mpsc::Receiver<Report>,
}

enum Report {
    Progress(Progress),
    Over(Outcome),
}

impl Job {
    /// Begins `task`. A bake on the GPU takes the window's device. `wake` is called whenever there is news.
    ///
    /// # Errors
    /// In words, when the system gives no thread.
    pub fn begin(
        task: Task,
        backend: BackendChoice,
        context: Arc<Context>,
        wake: impl Fn() + Send + 'static,
    ) -> Result<Self, String> {
        let title = match &task {
            Task::Open(path) => format!("Opening {}", path.file_name().unwrap_or(path.as_os_str()).display()),
            Task::Bake(scene) => format!("Haptizing {}", scene.name),
        };
        let stop = Arc::new(AtomicBool::new(false));
        let (sender, reports) = mpsc::channel();
        let flag = Arc::clone(&stop);
        let work = move || {
            let mut progress = |progress| {
                // A window that is gone needs no news.
                let _ = sender.send(Report::Progress(progress));
                wake();
            };
            let outcome = match run(task, backend, &context, &flag, &mut progress) {
                Ok(loaded) => Outcome::Loaded(Box::new(loaded)),
                Err(error) if is_cancelled(error.as_ref()) => Outcome::Cancelled,
                Err(error) => Outcome::Failed(error.to_string()),
            };
            let _ = sender.send(Report::Over(outcome));
            wake();
        };
        let spawned = thread::Builder::new().name("bake".into()).spawn(work);
        spawned.map_err(|error| format!("the system gives no thread: {error}; close other programs"))?;
        let progress = Progress::default();
        Ok(Self { title, progress, stop, reports })
    }

    /// Takes the news; answers with the outcome once it is over.
    pub fn poll(&mut self) -> Option<Outcome> {
        loop {
            match self.reports.try_recv() {
                Ok(Report::Progress(progress)) => self.progress = progress,
                Ok(Report::Over(outcome)) => return Some(outcome),
                Err(mpsc::TryRecvError::Empty) => return None,
                Err(mpsc::TryRecvError::Disconnected) => {
                    return Some(Outcome::Failed("the work ended unexpectedly; please report this".into()));
                }
            }
        }
    }

    /// Waits until it is over.
    #[must_use]
    pub fn wait(mut self) -> Outcome {
        loop {
            if let Some(outcome) = self.poll() {
                return outcome;
            }
            thread::sleep(std::time::Duration::from_millis(2));
        }
    }

    /// How far it has come.
    #[must_use]
    pub fn progress(&self) -> Progress {
        self.progress
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

type Failure = Box<dyn Error + Send + Sync>;

fn run(
    task: Task,
    backend: BackendChoice,
    context: &Arc<Context>,
    stop: &AtomicBool,
    progress: &mut dyn FnMut(Progress),
) -> Result<Loaded, Failure> {
    match task {
        Task::Open(path) if is_scene(&path) => bake(Scene::load(&path)?, backend, context, stop, progress),
        Task::Open(path) => {
            let dataset = Dataset::open(&path)?;
            Loaded::new(dataset, None, Some(path.clone()))
                .map_err(|error| format!("{}: {error}", path.display()).into())
        }
        Task::Bake(scene) => bake((*scene).clone(), backend, context, stop, progress),
    }
}

/// Scenes end in .toml; everything else is taken for a dataset, whose reader says what it is not.
fn is_scene(path: &Path) -> bool {
    path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("toml"))
}

fn bake(
    scene: Scene,
    choice: BackendChoice,
    context: &Arc<Context>,
    stop: &AtomicBool,
    progress: &mut dyn FnMut(Progress),
) -> Result<Loaded, Failure> {
    let object = Object::build(&scene.object)?;
    let chain = Chain::new(&scene.proxy);
    let model = Model::reaching(&object, &chain, scene.contact, &sample(&scene))?;
    let on_device = match choice {
        BackendChoice::Gpu => true,
        BackendChoice::Auto => context.adapter().hardware,
        BackendChoice::Cpu => false,
    };
    let mut backend = if on_device {
        match GpuSolver::new(Arc::clone(context), &model) {
            Ok(solver) => ChosenBackend::on(solver, &model),
            // Where the GPU cannot take the scene the CPU can.
            Err(_) if choice == BackendChoice::Auto => ChosenBackend::open(BackendChoice::Cpu, &model)?,
            Err(error) => return Err(error.into()),
        }
    } else {
        ChosenBackend::open(BackendChoice::Cpu, &model)?
    };
    let date = humantime::format_rfc3339_seconds(SystemTime::now()).to_string();
    let mut sweep = Sweep::new(&scene, &object, backend.name(), &backend.adapter(), &date)?;
    sweep.skip_free_space(&model)?;
    let chunk = backend.chunk();
    let (dataset, report) = sweep.run(&mut backend, Run { chunk, stop, progress })?;
    let mut loaded = Loaded::new(dataset, Some(scene), None)?;
    loaded.report = Some(Arc::new(report));
    Ok(loaded)
}

fn is_cancelled(error: &(dyn Error + 'static)) -> bool {
    matches!(error.downcast_ref::<SweepError>(), Some(SweepError::Stopped { .. }))
}
