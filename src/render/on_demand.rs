//! A scene that is felt while its contact is solved, ahead of the motion, and what was solved for it.

use super::live::{Answers, Followed, Live, LiveEnds};
use crate::{
    JointVector,
    contact::Model,
    dataset::{Dataset, Error as DatasetError, Grid, Provenance, Surface},
    memory::Shortage,
    object::{Object, ObjectError},
    proxy::Chain,
    scene::{Interpolation, Scene, SceneError},
    store::{Space, SpaceError, Store, check_memory},
    sweep::{
        CpuBackend, NoEnergy, SceneObjectError,
        ahead::{Ahead, Follower, Solution, Solved, Whereabouts, follow},
        build_object, check_algorithm, grid_of, sample, thin_parts,
    },
};
use std::{
    io,
    path::{Path, PathBuf},
    sync::{
        Arc, OnceLock,
        atomic::{AtomicBool, Ordering},
        mpsc,
    },
    thread::{self, JoinHandle},
    time::{Duration, Instant},
};

/// Blocks for which there is room beside those that are known (1): some 0.7 GB with six joints, hours of touching.
const ROOM: usize = 2_000_000;

/// Longest time that the levels around the first configuration may take before the loop begins (s).
const LONGEST_START: Duration = Duration::from_millis(1500);

/// A scene that is solved while it is felt. Threads share it.
pub struct OnDemand {
    scene: Scene,
    object: Object,
    chain: Chain,
    store: Arc<Store>,
    grid: Grid,
    provenance: Provenance,
    threads: usize,
    /// Blocks that an earlier session left.
    known: u64,
    /// What to tell of what was explored, once a session is over.
    notice: OnceLock<String>,
}

/// A scene cannot be solved while it is felt.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum OnDemandError {
    /// It is not valid.
    #[error(transparent)]
    Scene(#[from] SceneError),
    /// Its algorithm gives no nodes.
    #[error("{}: {reason}", path.display())]
    Algorithm {
        /// The scene's file.
        path: PathBuf,
        /// Why.
        reason: NoEnergy,
    },
    /// It has no grid.
    #[error("{}: has no [grid], which is the coarsest level: haptize reach --write prints one", .0.display())]
    NoGrid(PathBuf),
    /// Its object cannot be built.
    #[error(transparent)]
    Object(#[from] SceneObjectError),
    /// The object's compliance cannot be formed.
    #[error(transparent)]
    Compliance(#[from] ObjectError),
    /// No store can be laid over its grid.
    #[error(transparent)]
    Space(#[from] SpaceError),
    /// The kept dataset cannot be read.
    #[error(transparent)]
    Kept(#[from] DatasetError),
    /// The kept dataset is of another scene.
    #[error(
        "{}: was not explored with this scene and these levels: give another file, or the scene and --levels of that \
         session",
        .0.display()
    )]
    Another(PathBuf),
    /// The system gives no threads.
    #[error("no threads can be had that solve: {0}; close other programs")]
    Threads(#[from] io::Error),
    /// A thread that solves ended.
    #[error("the thread that solves contact ended; please report this")]
    Ended,
    /// The grid is larger than the memory that is left.
    #[error(
        "the scene's grid has too many points: {0}; or give a coarser one, which levels refine where the proxy goes"
    )]
    Memory(Shortage),
}

/// Work done for a session.
#[derive(Clone, Copy, Debug, Default)]
pub struct Explored {
    /// Nodes and equilibria.
    pub solved: Solved,
    /// The sources that answered the ticks.
    pub answers: Answers,
    /// Blocks that an earlier session left.
    pub known: u64,
    /// Blocks that there are.
    pub blocks: u64,
    /// Levels of the store.
    pub levels: u32,
    /// Whether the store had no room for a block.
    pub full: bool,
}

impl OnDemand {
    /// Builds the scene at `path` with a store of so many `levels`, and takes what an earlier session left in `file`.
    /// `threads` solve, by default one less than there are processors.
    ///
    /// # Errors
    /// When scene or file cannot be used.
    pub fn open(path: &Path, file: &Path, levels: u32, threads: Option<usize>) -> Result<Self, OnDemandError> {
        let scene = Scene::load(path)?;
        check_algorithm(&scene).map_err(|reason| OnDemandError::Algorithm { path: path.into(), reason })?;
        if scene.grid.axes.is_empty() {
            return Err(OnDemandError::NoGrid(path.into()));
        }
        let object = build_object(&scene)?;
        let chain = Chain::new(&scene.proxy);
        let grid = grid_of(&scene);
        check_memory(&grid).map_err(OnDemandError::Memory)?;
        let provenance = CpuBackend::provenance(&scene);
        let mut store = Store::new(Space::new(&grid, levels)?, 0);
        if file.exists() {
            let earlier = Dataset::load(file)?;
            let same_scene = earlier.scene == scene.text;
            let is_alike = |found: &Store| found.space() == store.space();
            let found = earlier.refinement.filter(|found| same_scene && is_alike(found));
            store = found.and_then(Arc::into_inner).ok_or_else(|| OnDemandError::Another(file.into()))?;
        }
        let known = store.horizon();
        store.reserve(known as usize + ROOM);
        let processors = thread::available_parallelism().map_or(1, usize::from);
        let threads = threads.unwrap_or_else(|| processors.saturating_sub(1).max(1));
        let (store, notice) = (Arc::new(store), OnceLock::new());
        Ok(Self { scene, object, chain, store, grid, provenance, threads, known, notice })
    }

    /// The scene.
    #[must_use]
    pub fn scene(&self) -> &Scene {
        &self.scene
    }

    /// Blocks known so far.
    #[must_use]
    pub fn blocks(&self) -> u64 {
        self.store.horizon()
    }

    /// Returns what the session that is over tells of the object, as a sentence without its full stop.
    #[must_use]
    pub fn notice(&self) -> Option<&str> {
        self.notice.get().map(String::as_str)
    }

    /// How what is known was made.
    fn provenance(&self) -> Provenance {
        Provenance { notices: self.notice.get().cloned().into_iter().collect(), ..self.provenance.clone() }
    }

    /// Returns everything known so far, as a dataset.
    #[must_use]
    pub fn dataset(&self) -> Dataset {
        let surface = Some(Surface::of(&self.object));
        let (grid, text) = (self.grid.clone(), self.scene.text.clone());
        Dataset::refined(Arc::clone(&self.store), grid, surface, text, self.provenance())
    }

    /// Writes everything known so far to `file`, as a dataset. Nothing is made at the points of the grid: the memory
    /// that it takes is that of what is written.
    ///
    /// # Errors
    /// As [`Dataset::save`].
    pub fn save(&self, file: &Path) -> Result<(), DatasetError> {
        let surface = Surface::of(&self.object);
        self.store.save(&self.grid, Some(&surface), &self.scene.text, &self.provenance(), file)
    }

    /// Begins to solve around `start` and wherever the loop then goes that has the [`Live`]. Returns once the levels
    /// around `start` are there, after 1.5 s at the latest. The equilibrium at the proxy is solved, too, where the loop
    /// has that for its `interpolation`.
    ///
    /// # Errors
    /// When the model cannot be made, or the system gives no threads.
    pub fn begin(
        self: &Arc<Self>,
        start: &JointVector,
        interpolation: Interpolation,
    ) -> Result<(Live, Exploration), OnDemandError> {
        let began = Instant::now();
        let followed = Followed {
            torque: interpolation == Interpolation::Direct,
            forces: self.scene.haptics.at_contacts().is_some(),
        };
        let levels = self.store.space().levels();
        let (live, ends) = Live::new(start, levels, &self.levers(), self.threads, followed);
        let LiveEnds { whereabouts, solutions, answers } = ends;
        let ends = WorkerEnds { whereabouts, solutions, with_forces: followed.forces };
        let over = Arc::new(AtomicBool::new(false));
        let (report, ready) = mpsc::channel();
        let (this, raised, start) = (Arc::clone(self), Arc::clone(&over), *start);
        let work = move || {
            let model = Model::reaching(&this.object, &this.chain, this.scene.contact, &sample(&this.scene));
            let mut model = match model {
                Ok(model) => model,
                Err(error) => {
                    drop(report.send(Err(error.into())));
                    return Done::default();
                }
            };
            model.with_tangent = true;
            let ahead = Ahead::new(&model, Arc::clone(&this.store));
            ahead.prepare(&start, this.threads, LONGEST_START.saturating_sub(began.elapsed()));
            ends.serve(&model, &ahead, &raised, &report);
            if let Some(notice) = thin_parts::of_store(&model, &this.store) {
                // The window begins again and again: the first session that sees it tells it.
                let _ = this.notice.set(notice);
            }
            Done { solved: ahead.solved(), full: ahead.is_full() }
        };
        let thread = thread::Builder::new().name("explorer".into()).spawn(work)?;
        let exploration = Exploration { on_demand: Arc::clone(self), over, answers, thread: Some(thread) };
        ready.recv().unwrap_or(Err(OnDemandError::Ended))?;
        Ok((live, exploration))
    }

    /// Greatest lever of each joint over the contact nodes (m/rad or 1).
    fn levers(&self) -> JointVector {
        let ranges: Vec<[f64; 2]> = self.grid.axes.iter().map(|axis| [axis.start, axis.last()]).collect();
        let mut levers = JointVector::zeros(self.grid.joints());
        for bounds in self.chain.jacobian_bounds(&ranges) {
            levers.iter_mut().zip(bounds.iter()).for_each(|(lever, bound)| *lever = lever.max(*bound));
        }
        levers
    }
}

/// The ends of a [`Live`] that the solving threads have.
struct WorkerEnds {
    whereabouts: Vec<triple_buffer::Output<Whereabouts>>,
    solutions: Option<triple_buffer::Input<Solution>>,
    with_forces: bool,
}

impl WorkerEnds {
    /// Solves in threads of their own until `over` is raised; reports through `ready` that they have begun, or why not.
    fn serve(
        self,
        model: &Model<'_>,
        ahead: &Ahead<'_>,
        over: &AtomicBool,
        ready: &mpsc::Sender<Result<(), OnDemandError>>,
    ) {
        let Self { mut whereabouts, solutions, with_forces } = self;
        thread::scope(|scope| {
            let begin = || -> io::Result<()> {
                if let Some(solutions) = solutions
                    && let Some(end) = whereabouts.pop()
                {
                    let follower = Follower::new(model).with_forces(with_forces);
                    let work = move || follow(follower, end, solutions, over);
                    thread::Builder::new().name("equilibrium".into()).spawn_scoped(scope, work)?;
                }
                for end in whereabouts {
                    let work = move || ahead.serve(end, over);
                    thread::Builder::new().name("ahead".into()).spawn_scoped(scope, work)?;
                }
                Ok(())
            };
            let begun = begin();
            if begun.is_err() {
                over.store(true, Ordering::Release);
            }
            drop(ready.send(begun.map_err(OnDemandError::from)));
        });
    }
}

/// The work that the explorer's thread did.
#[derive(Default)]
struct Done {
    solved: Solved,
    full: bool,
}

/// Contact being solved for a loop. Dropping it ends its threads, once they have published what they were solving.
pub struct Exploration {
    on_demand: Arc<OnDemand>,
    over: Arc<AtomicBool>,
    answers: triple_buffer::Output<Answers>,
    thread: Option<JoinHandle<Done>>,
}

impl Exploration {
    /// The sources that answered the ticks so far.
    pub fn answers(&mut self) -> Answers {
        *self.answers.read()
    }

    /// Ends it, once its threads have published what they were solving.
    ///
    /// # Errors
    /// When one of them has panicked.
    pub fn end(mut self) -> Result<Explored, OnDemandError> {
        self.over.store(true, Ordering::Release);
        let done = self.thread.take().map(JoinHandle::join).transpose().map_err(|_| OnDemandError::Ended)?;
        let Done { solved, full } = done.unwrap_or_default();
        let OnDemand { store, known, .. } = &*self.on_demand;
        let (blocks, levels) = (store.horizon(), store.space().levels());
        Ok(Explored { solved, answers: *self.answers.read(), known: *known, blocks, levels, full })
    }
}

impl Drop for Exploration {
    fn drop(&mut self) {
        self.over.store(true, Ordering::Release);
        if let Some(thread) = self.thread.take() {
            // A thread that panicked has said so already.
            let _ = thread.join();
        }
    }
}
