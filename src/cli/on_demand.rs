//! `haptize play SCENE --on-demand FILE`: contact that is solved while it is felt, and kept.

use super::{Failure, interrupt, play::Played, tell};
use crate::{
    JointVector,
    contact::Model,
    dataset::{Dataset, Grid, Provenance, Surface},
    device::Device,
    object::Object,
    proxy::Chain,
    render::{
        live::{Answers, Live, LiveEnds},
        realtime,
        session::Plan,
        setup::Setup,
    },
    scene::{Interpolation, Scene},
    store::{Order, Space, Store, space::MAX_LEVELS},
    sweep::{
        CpuBackend,
        ahead::{Ahead, Solved, follow},
        build_object, check_algorithm, grid_of, sample,
    },
};
use serde_json::json;
use std::{
    fmt::{self, Write},
    path::Path,
    sync::{
        Arc,
        atomic::{AtomicBool, Ordering},
    },
    thread,
    time::{Duration, Instant},
};

/// Blocks for which there is room beside those that are known [1]: some 0.7 GB with six joints, hours of touching.
const ROOM: usize = 2_000_000;

/// Longest time that the levels around the first configuration may take before the loop begins [s].
const LONGEST_START: Duration = Duration::from_millis(1500);

/// How it is solved.
#[derive(Clone, Copy, Debug, clap::Args)]
pub struct Choices {
    /// Levels of the store: the scene's grid, and as many finer ones less one, each of half the spacing.
    #[arg(long, default_value_t = 2, value_name = "COUNT", requires = "on_demand", value_parser = clap::value_parser!(u32).range(1..=i64::from(MAX_LEVELS)))]
    levels: u32,
    /// Threads that solve; by default one less than there are processors.
    #[arg(long, value_name = "COUNT", requires = "on_demand", value_parser = clap::value_parser!(u16).range(1..=64))]
    threads: Option<u16>,
}

/// A scene that is solved while it is felt.
pub struct OnDemand {
    scene: Scene,
    object: Object,
    chain: Chain,
    store: Arc<Store>,
    grid: Grid,
    provenance: Provenance,
    threads: usize,
    began: Instant,
    /// Blocks that an earlier session left.
    known: u64,
}

/// Work done, and answers.
#[derive(Clone, Copy, Debug)]
pub struct Explored {
    answers: Answers,
    solved: Solved,
    known: u64,
    blocks: u64,
    levels: u32,
    /// From the start of the program's work to the first tick [s].
    start: f64,
    full: bool,
}

impl OnDemand {
    /// Builds the scene at `path`, and takes what an earlier session left in `file`.
    pub fn open(path: &Path, file: &Path, choices: Choices) -> Result<Self, Failure> {
        let began = Instant::now();
        let scene = Scene::load(path)?;
        check_algorithm(&scene).map_err(|error| format!("{}: {error}", path.display()))?;
        if scene.grid.axes.is_empty() {
            return Err(format!(
                "{}: has no [grid], which is the coarsest level: haptize reach --write prints one",
                path.display()
            )
            .into());
        }
        let object = build_object(&scene)?;
        let chain = Chain::new(&scene.proxy);
        let grid = grid_of(&scene);
        let provenance = CpuBackend::provenance(&scene);
        let mut store = Store::new(Space::new(&grid, choices.levels)?, Order::Potential, 0);
        if file.exists() {
            let earlier = Dataset::load(file)?;
            let Some(found) =
                earlier.refinement.filter(|found| found.space() == store.space() && earlier.scene == scene.text)
            else {
                return Err(format!(
                    "{}: was not explored with this scene and these levels: give another file, or the scene and \
                     --levels of that session",
                    file.display()
                )
                .into());
            };
            store = Arc::try_unwrap(found).map_err(|_| "the store is in use")?;
        }
        let known = store.horizon();
        store.reserve(known as usize + ROOM);
        let processors = thread::available_parallelism().map_or(1, usize::from);
        let threads = choices.threads.map_or(processors.saturating_sub(1).max(1), usize::from);
        Ok(Self { scene, object, chain, store: Arc::new(store), grid, provenance, threads, began, known })
    }

    /// Returns everything known so far, as a dataset.
    pub fn dataset(&self) -> Dataset {
        let surface = Some(Surface::of(&self.object));
        let (grid, text) = (self.grid.clone(), self.scene.text.clone());
        Dataset::refined(Arc::clone(&self.store), grid, surface, text, self.provenance.clone())
    }

    /// Plays `device` against the clock while contact is solved where it goes.
    pub fn play(&self, setup: &Setup, device: &mut dyn Device, plan: &Plan) -> Result<Played, Failure> {
        let mut model = Model::reaching(&self.object, &self.chain, self.scene.contact, &sample(&self.scene))?;
        model.with_tangent = true;
        let ahead = Ahead::new(&model, Arc::clone(&self.store));
        let start = *setup.haptics.start(&device.read(0.0).position)?.proxy();
        let spent = self.began.elapsed();
        ahead.prepare(&start, self.threads, LONGEST_START.saturating_sub(spent));
        let direct = self.scene.haptics.interpolation == Interpolation::Direct;
        let levels = self.store.space().levels();
        let (live, ends) = Live::new(&start, levels, &levers(&self.chain, &self.grid), self.threads, direct);
        let begun = self.began.elapsed().as_secs_f64();
        let over = AtomicBool::new(false);
        let LiveEnds { mut whereabouts, solutions } = ends;
        let played = thread::scope(|scope| {
            let work = || -> Result<_, Failure> {
                if let (Some(solutions), Some(end)) = (solutions, direct.then(|| whereabouts.pop()).flatten()) {
                    let (model, over) = (&model, &over);
                    let work = move || follow(model, end, solutions, over);
                    thread::Builder::new().name("equilibrium".into()).spawn_scoped(scope, work)?;
                }
                for end in whereabouts {
                    let (ahead, over) = (&ahead, &over);
                    let work = move || ahead.serve(end, over);
                    thread::Builder::new().name("ahead".into()).spawn_scoped(scope, work)?;
                }
                Ok(realtime::run_live(&setup.haptics, device, None, plan, interrupt::stop_flag(), Some(live))?)
            };
            let played = work();
            over.store(true, Ordering::Release);
            played
        });
        interrupt::over();
        let (trace, timing, answers) = played?;
        if ahead.is_full() {
            tell(format_args!(
                "haptize: note: the store is full with {} blocks: what is new is not kept",
                self.store.horizon()
            ));
        }
        let explored = Explored {
            answers: answers.unwrap_or_default(),
            solved: ahead.solved(),
            known: self.known,
            blocks: self.store.horizon(),
            levels,
            start: begun,
            full: ahead.is_full(),
        };
        Ok(Played { trace, timing: Some(timing), explored: Some(explored) })
    }
}

/// Greatest lever of each joint over the contact nodes [m/rad or 1].
fn levers(chain: &Chain, grid: &Grid) -> JointVector {
    let ranges: Vec<[f64; 2]> =
        grid.axes.iter().map(|axis| [axis.start, axis.coordinate(axis.count.saturating_sub(1))]).collect();
    let mut levers = JointVector::zeros(grid.joints());
    for bounds in chain.jacobian_bounds(&ranges) {
        levers.iter_mut().zip(bounds.iter()).for_each(|(lever, bound)| *lever = lever.max(*bound));
    }
    levers
}

impl Explored {
    /// For programs.
    pub fn json(&self) -> serde_json::Value {
        let Self { answers, solved, known, blocks, levels, start, full } = self;
        json!({
            "answers": answers, "solved": solved, "known_blocks": known, "blocks": blocks, "levels": levels, "start": start,
            "full": full,
        })
    }

    /// For people.
    pub fn describe(&self, text: &mut String) -> fmt::Result {
        let Self { answers, solved, levels, start, .. } = self;
        let percent = |part: u64| 100.0 * part as f64 / answers.ticks.max(1) as f64;
        writeln!(
            text,
            "  on demand    began after {start:.2} s; {} nodes solved, {} equilibria",
            solved.nodes, solved.equilibria
        )?;
        let there: Vec<String> = (0..=*levels as usize)
            .filter(|&count| answers.by_levels[count] > 0)
            .map(|count| format!("{:.2} % by {count} of {levels} levels", percent(answers.by_levels[count])))
            .collect();
        if answers.direct > 0 {
            writeln!(
                text,
                "  direct       {:.2} % of the ticks followed an equilibrium solved at the proxy",
                percent(answers.direct)
            )?;
        }
        if !there.is_empty() {
            writeln!(text, "  answered     {}", there.join(", "))?;
        }
        writeln!(
            text,
            "  missed       {} ticks ({:.2} %) answered by a coarser level than wanted, {} of them in contact",
            answers.coarser,
            percent(answers.coarser),
            answers.coarser_in_contact
        )?;
        writeln!(
            text,
            "  passed over  {} changes, at most {:.4} N m; {:.3} mJ given, {:.3} mJ taken",
            answers.changes,
            answers.greatest_change,
            1e3 * answers.given,
            1e3 * answers.taken
        )
    }
}
