//! What one thread of a bake on the CPU does while no other can: the serial share, which bounds what many cores gain.
//!
//! `cargo bench --bench serial`, on Unix. All is processor time of threads, so that other work on the machine, and how
//! many cores it has, change the figures little. A bake shares its work out to pools, and waits for them in the thread
//! that called it: what that thread itself takes is not shared out. Some of it is done while configurations of another
//! chunk are solved, and holds nobody up as long as it takes less time than they.

use haptize::{
    JointVector,
    contact::{Equilibrium, Model, Work},
    object::Object,
    proxy::Chain,
    scene::{AxisSpec, ContactLaw, Scene},
    sweep::{Backend, CpuBackend, Run, Sweep},
};
use rustix::time::{ClockId, clock_gettime};
use std::{convert::Infallible, error::Error, path::Path, sync::atomic::AtomicBool};

/// Cores for which the share is told.
const CORES: f64 = 64.0;

/// Bakes of each kind, of which the one with the least of each time counts: caches and interrupts only add to it.
const TURNS: usize = 5;

fn main() -> Result<(), Box<dyn Error>> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut scene = Scene::load(root.join("tests/scenes/sphere.toml"))?;
    for axis in &mut scene.grid.axes {
        *axis = AxisSpec { step: axis.step / 2.0, count: 2 * axis.count - 1, ..*axis };
    }
    println!("processor time of a configuration [us]; serial share of the time on {CORES} cores\n");
    println!(
        "{:<24} {:>10} {:>12} {:>20} {:>18}",
        "", "shared out", "beside that", "alone or awaited", "and behind that"
    );
    for law in [ContactLaw::Following, ContactLaw::Rest] {
        scene.contact.law = law;
        for work in [Extent::Solved, Extent::Lowest, Extent::Measured] {
            let mut least = bake(&scene, work)?;
            for _ in 1..TURNS {
                let turn = bake(&scene, work)?;
                least = Times {
                    shared: least.shared.min(turn.shared),
                    beside: least.beside.min(turn.beside),
                    alone: least.alone.min(turn.alone),
                    behind: least.behind.min(turn.behind),
                };
            }
            let Times { shared, beside, alone, behind } = least;
            // What is done beside the solving ends when both have.
            let alone = alone + (beside - shared / CORES).max(0.0);
            let share = |alone: f64| 100.0 * alone / (alone + shared / CORES);
            let name = format!("{law:?}, {work:?}").to_lowercase();
            println!(
                "{name:<24} {shared:>10.2} {beside:>12.3} {alone:>11.4} {:>6.1} % {behind:>9.4} {:>6.1} %",
                share(alone),
                share(alone + behind)
            );
        }
    }
    Ok(())
}

/// How much of a bake is done.
#[derive(Clone, Copy, Debug, PartialEq, PartialOrd)]
enum Extent {
    /// All points are solved, and written.
    Solved,
    /// Lower equilibria are looked for, too.
    Lowest,
    /// And the error is measured: as `haptize bake` does it.
    Measured,
}

/// Processor time of a configuration (us).
struct Times {
    /// What any number of threads can do at once.
    shared: f64,
    /// What one thread does while others solve.
    beside: f64,
    /// What one thread does while all others wait, until all points are solved.
    alone: f64,
    /// The same afterwards, when the file is put together.
    behind: f64,
}

/// Bakes `scene` into a file.
fn bake(scene: &Scene, extent: Extent) -> Result<Times, Box<dyn Error>> {
    let (object, chain) = (Object::build(&scene.object)?, Chain::new(&scene.proxy));
    let model = Model::new(&object, &chain, scene.contact);
    let mut sweep = Sweep::new(scene, &object, "cpu", "bench", "")?;
    sweep.skip_free_space(&model)?;
    if extent >= Extent::Lowest {
        sweep.find_lowest(&model)?;
    }
    if extent == Extent::Measured {
        sweep.measure_error(&model, &scene.haptics, None)?;
    }
    let mut backend = Watched { backend: CpuBackend::new(&model, 0)?, beside: 0.0, alone: 0.0 };
    let (folder, stop) = (tempfile::tempdir()?, AtomicBool::new(false));
    let run = Run { chunk: backend.backend.chunk(), stop: &stop, progress: &mut |_| () };
    let (all, own) = (time(ClockId::ProcessCPUTime), time(ClockId::ThreadCPUTime));
    let report = sweep.bake(&mut backend, &folder.path().join("x.haptize"), false, run)?;
    let own = time(ClockId::ThreadCPUTime) - own;
    let shared = time(ClockId::ProcessCPUTime) - all - own;
    let each = |seconds: f64| 1e6 * seconds / report.points as f64;
    let Watched { beside, alone, .. } = backend;
    Ok(Times { shared: each(shared), beside: each(beside), alone: each(alone), behind: each(own - beside - alone) })
}

/// Processor time so far (s).
fn time(clock: ClockId) -> f64 {
    let time = clock_gettime(clock);
    time.tv_sec as f64 + 1e-9 * time.tv_nsec as f64
}

/// A backend, and how long the thread that calls it works while others solve, and while they do not.
struct Watched<'a> {
    backend: CpuBackend<'a>,
    /// (s)
    beside: f64,
    /// How long it works while nobody solves (s).
    alone: f64,
}

/// Work whose chunks are counted.
struct Counted<'w> {
    work: &'w mut dyn Work,
    /// Chunks that are out.
    out: usize,
    /// Since when there are some (s).
    since: f64,
    /// How long there were some (s).
    beside: f64,
}

impl Work for Counted<'_> {
    fn next(&mut self) -> Option<Vec<JointVector>> {
        let chunk = self.work.next()?;
        if self.out == 0 {
            self.since = time(ClockId::ThreadCPUTime);
        }
        self.out += 1;
        Some(chunk)
    }

    fn rewind(&mut self) {
        self.work.rewind();
    }

    fn take(&mut self, equilibria: Vec<Equilibrium>) {
        self.out -= 1;
        if self.out == 0 {
            self.beside += time(ClockId::ThreadCPUTime) - self.since;
        }
        self.work.take(equilibria);
    }

    fn note(&mut self, notice: String) {
        self.work.note(notice);
    }
}

impl Backend for Watched<'_> {
    type Error = Infallible;

    fn solve(&mut self, configurations: &[JointVector]) -> Result<Vec<Equilibrium>, Infallible> {
        self.backend.solve(configurations)
    }

    fn stream(&mut self, work: &mut dyn Work) -> Result<(), Infallible> {
        let mut counted = Counted { work, out: 0, since: 0.0, beside: 0.0 };
        let before = time(ClockId::ThreadCPUTime);
        self.backend.stream(&mut counted)?;
        self.alone += time(ClockId::ThreadCPUTime) - before - counted.beside;
        self.beside += counted.beside;
        Ok(())
    }
}
