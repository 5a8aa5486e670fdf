//! `haptize play SCENE --on-demand FILE`: contact that is solved while it is felt, and kept.

use super::{
    Failure, interrupt,
    played::{Played, play_timed},
    tell,
};
use crate::{
    dataset::{Claim, Grid},
    device::Device,
    render::{
        graphics::Graphics,
        haptic::Haptics,
        on_demand::{self, OnDemand},
        realtime::Options,
        session::Plan,
        trace::Tick,
    },
    scene::efforts,
    store::space::MAX_LEVELS,
};
use serde_json::json;
use std::{
    fmt::{self, Write},
    path::{Path, PathBuf},
    sync::{
        Arc,
        atomic::{AtomicBool, Ordering},
        mpsc::{self, RecvTimeoutError},
    },
    thread,
    time::{Duration, Instant},
};

/// How often what was explored is saved while it is felt: a session that is killed loses as much at most, which is
/// solved again in the same time. Oftener, and writing would take a share of the processor and the disk that is felt.
const KEPT_EVERY: Duration = Duration::from_secs(5);

/// Pause after each saving (times that it took): however large the store, a tenth of one processor at most saves it.
const PAUSE: u32 = 9;

/// How often the thread that saves looks for a signal.
const LOOK: Duration = Duration::from_millis(50);

/// How it is solved.
#[derive(Clone, Copy, Debug, clap::Args)]
pub struct Choices {
    /// Levels of the store: the scene's grid, and as many finer ones less one, each of half the spacing.
    #[arg(long, default_value_t = 2, value_name = "COUNT", requires = "on_demand",
        value_parser = clap::value_parser!(u32).range(1..=i64::from(MAX_LEVELS)))]
    levels: u32,
    /// Threads that solve; by default one less than there are processors.
    #[arg(long, value_name = "COUNT", requires = "on_demand", value_parser = clap::value_parser!(u16).range(1..=64))]
    threads: Option<u16>,
}

impl Choices {
    /// The scene at `path`, with what an earlier session left in `file`, which no other session may have.
    pub fn open(self, path: &Path, file: &Path) -> Result<Exploring, Failure> {
        let began = Instant::now();
        let failed = |why: String| format!("{}: {why}", file.display());
        let claim =
            Claim::new(file).map_err(|error| failed(format!("cannot be written: {error}; name another file")))?;
        let claim = claim.ok_or_else(|| {
            failed(
                "another session on demand keeps this file and would be overwritten: end it, or name another file"
                    .into(),
            )
        })?;
        let on_demand = OnDemand::open(path, file, self.levels, self.threads.map(usize::from))?;
        Ok(Exploring { on_demand: Arc::new(on_demand), file: file.into(), began, _claim: claim })
    }
}

/// A scene that is solved while it is felt, and since when the program has been at work.
pub struct Exploring {
    pub on_demand: Arc<OnDemand>,
    /// The file that keeps the explored part.
    file: PathBuf,
    began: Instant,
    _claim: Claim,
}

/// Work done, and answers.
#[derive(Clone, Copy, Debug)]
pub struct Explored {
    done: on_demand::Explored,
    /// From the start of the program's work to the first tick (s).
    start: f64,
}

impl Exploring {
    /// Runs `session` while a thread of its own saves what is explored from time to time; what there is in the end is
    /// saved whether the session succeeds or not. A process that is killed leaves what was last saved, whole. With a
    /// `signal`, which ends the program without ending `session`, all is saved once more when it is raised.
    pub fn keep<T>(
        &self,
        signal: Option<&AtomicBool>,
        session: impl FnOnce() -> Result<T, Failure>,
    ) -> Result<T, Failure> {
        let before = self.on_demand.blocks();
        let (under_way, over) = mpsc::channel::<()>();
        let played = thread::scope(|scope| {
            let save = move || self.save_until(&over, signal);
            thread::Builder::new().name("keeper".into()).spawn_scoped(scope, save)?;
            let played = session();
            drop(under_way);
            played
        });
        if played.is_ok() || self.on_demand.blocks() > before {
            self.on_demand.save(self.file.as_path())?;
        }
        if let Some(notice) = self.on_demand.notice() {
            tell(format_args!("haptize: {notice}"));
        }
        played
    }

    /// Saves what is explored every [`KEPT_EVERY`] until the session is `over`, or `signal` is raised.
    fn save_until(&self, over: &mpsc::Receiver<()>, signal: Option<&AtomicBool>) {
        let (file, mut failed) = (self.file.display(), false);
        let (mut kept, mut due) = (self.on_demand.blocks(), Instant::now() + KEPT_EVERY);
        while over.recv_timeout(LOOK) == Err(RecvTimeoutError::Timeout) {
            let is_last = signal.is_some_and(|signal| signal.load(Ordering::Relaxed));
            let (blocks, began) = (self.on_demand.blocks(), Instant::now());
            if !is_last && (began < due || blocks == kept) {
                continue;
            }
            let saved = self.on_demand.save(self.file.as_path());
            if is_last {
                let what = saved.map_or_else(|error| error.to_string(), |()| format!("kept in {file}"));
                return tell(format_args!("haptize: {blocks} blocks explored, {what}"));
            }
            due = Instant::now() + KEPT_EVERY.max(PAUSE * began.elapsed());
            match saved {
                Ok(()) => (kept, failed) = (blocks, false),
                Err(error) if !failed => {
                    failed = true;
                    tell(format_args!("haptize: note: what is explored is not kept yet: {error}"));
                }
                Err(_) => (),
            }
        }
    }

    /// Plays `device` against the clock while contact is solved where it goes, until `stop` is raised at the latest.
    /// Hands over each tick soon after it.
    pub fn play(
        &self,
        haptics: &Haptics,
        device: &mut dyn Device,
        graphics: Option<&mut Graphics<'_>>,
        plan: &Plan,
        stop: &AtomicBool,
        on_tick: &mut dyn FnMut(&Tick),
    ) -> Result<Played, Failure> {
        let start = *haptics.start(&device.read(0.0).position)?.proxy();
        let (live, exploration) = self.on_demand.begin(&start, self.on_demand.scene().haptics.interpolation)?;
        let begun = self.began.elapsed().as_secs_f64();
        let options = Options { stop, live: Some(live), on_tick: Some(on_tick) };
        let played = play_timed(haptics, device, graphics, plan, options);
        let done = exploration.end()?;
        interrupt::over();
        let played = played?;
        if done.full {
            tell(format_args!("haptize: note: the store is full with {} blocks: what is new is not kept", done.blocks));
        }
        Ok(Played { explored: Some(Explored { done, start: begun }), ..played })
    }
}

impl Explored {
    /// For programs.
    pub fn json(&self) -> serde_json::Value {
        let Self { done: on_demand::Explored { answers, solved, known, blocks, levels, full }, start } = self;
        json!({
            "answers": answers, "solved": solved, "known_blocks": known, "blocks": blocks, "levels": levels,
            "start": start,
            "full": full,
        })
    }

    /// For people.
    pub fn describe(&self, text: &mut String, grid: &Grid) -> fmt::Result {
        let Self { done: on_demand::Explored { answers, solved, levels, .. }, start } = self;
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
            "  passed over  {} changes, at most {}; {:.3} mJ given, {:.3} mJ taken",
            answers.changes,
            efforts(&answers.greatest_change, grid.axes.iter().map(|axis| (axis.name.as_str(), axis.unit.as_str()))),
            1e3 * answers.given,
            1e3 * answers.taken
        )
    }
}
