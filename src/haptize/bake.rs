//! From a scene to its dataset: object and proxy are built, a backend is chosen, and the grid is swept.

use super::{BackendChoice, BackendError, ChosenBackend, Progress, Run, Sweep, SweepError, SweepReport};
use crate::{
    contact::Model,
    dataset::Dataset,
    object::{Object, ObjectError},
    proxy::Chain,
    scene::Scene,
};
use std::{path::Path, sync::atomic::AtomicBool};

/// A scene could not be haptized.
#[derive(Debug, thiserror::Error)]
pub enum BakeError {
    /// The object cannot be built.
    #[error(transparent)]
    Object(#[from] ObjectError),
    /// No backend.
    #[error(transparent)]
    Backend(#[from] BackendError),
    /// The sweep failed or was stopped.
    #[error(transparent)]
    Sweep(#[from] SweepError),
}

/// How a scene is haptized.
pub struct Bake<'a> {
    /// What is haptized.
    pub scene: &'a Scene,
    /// What solves.
    pub backend: BackendChoice,
    /// Date that the dataset bears, ISO 8601, UTC.
    pub date: &'a str,
    /// When this becomes true the sweep stops soon.
    pub stop: &'a AtomicBool,
    /// Called at the start and several times a second.
    pub progress: &'a mut dyn FnMut(Progress),
}

/// Where the dataset goes.
#[derive(Clone, Copy)]
enum Destination<'a> {
    Memory,
    File { output: &'a Path, resume: bool },
}

impl Bake<'_> {
    /// Haptizes into the file `output`; see [`Sweep::bake`].
    ///
    /// # Errors
    /// Any [`BakeError`].
    pub fn to_file(self, output: &Path, resume: bool) -> Result<(Dataset, SweepReport), BakeError> {
        self.run(Destination::File { output, resume })
    }

    /// Haptizes in memory.
    ///
    /// # Errors
    /// Any [`BakeError`].
    pub fn in_memory(self) -> Result<(Dataset, SweepReport), BakeError> {
        self.run(Destination::Memory)
    }

    fn run(self, destination: Destination<'_>) -> Result<(Dataset, SweepReport), BakeError> {
        let Self { scene, backend, date, stop, progress } = self;
        let object = Object::build(&scene.object)?;
        let chain = Chain::new(&scene.proxy);
        let model = Model::new(&object, &chain, scene.contact);
        let mut backend = ChosenBackend::open(backend, &model)?;
        let sweep = Sweep::new(scene, &object, backend.name(), &backend.adapter(), date)?;
        let run = Run { chunk: backend.chunk(), stop, progress };
        Ok(match destination {
            Destination::Memory => sweep.run(&mut backend, run),
            Destination::File { output, resume } => sweep.bake(&mut backend, output, resume, run),
        }?)
    }
}
