//! `haptize play SCENE --on-demand FILE`: contact that is solved while it is felt, and kept.

use super::{Failure, interrupt, play::Played, tell};
use crate::{
    device::Device,
    render::{
        graphics::Graphics,
        haptic::Haptics,
        on_demand::{self, OnDemand},
        realtime,
        session::Plan,
    },
    store::space::MAX_LEVELS,
};
use serde_json::json;
use std::{
    fmt::{self, Write},
    path::Path,
    sync::Arc,
    time::Instant,
};

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

impl Choices {
    /// The scene at `path`, with what an earlier session left in `file`.
    pub fn open(self, path: &Path, file: &Path) -> Result<Exploring, Failure> {
        let began = Instant::now();
        let on_demand = OnDemand::open(path, file, self.levels, self.threads.map(usize::from))?;
        Ok(Exploring { on_demand: Arc::new(on_demand), began })
    }
}

/// A scene that is solved while it is felt, and since when the program has been at work.
pub struct Exploring {
    pub on_demand: Arc<OnDemand>,
    began: Instant,
}

/// Work done, and answers.
#[derive(Clone, Copy, Debug)]
pub struct Explored {
    done: on_demand::Explored,
    /// From the start of the program's work to the first tick [s].
    start: f64,
}

impl Exploring {
    /// Plays `device` against the clock while contact is solved where it goes.
    pub fn play(
        &self,
        haptics: &Haptics,
        device: &mut dyn Device,
        graphics: Option<&mut Graphics<'_>>,
        plan: &Plan,
    ) -> Result<Played, Failure> {
        let start = *haptics.start(&device.read(0.0).position)?.proxy();
        let (live, exploration) = self.on_demand.begin(&start)?;
        let begun = self.began.elapsed().as_secs_f64();
        let stop = interrupt::stop_flag();
        let played = realtime::run_live(haptics, device, graphics, plan, stop, Some(live));
        let done = exploration.end()?;
        interrupt::over();
        let (trace, timing) = played?;
        if done.full {
            tell(format_args!("haptize: note: the store is full with {} blocks: what is new is not kept", done.blocks));
        }
        Ok(Played { trace, timing: Some(timing), explored: Some(Explored { done, start: begun }) })
    }
}

impl Explored {
    /// For programs.
    pub fn json(&self) -> serde_json::Value {
        let Self { done: on_demand::Explored { answers, solved, known, blocks, levels, full }, start } = self;
        json!({
            "answers": answers, "solved": solved, "known_blocks": known, "blocks": blocks, "levels": levels, "start": start,
            "full": full,
        })
    }

    /// For people.
    pub fn describe(&self, text: &mut String) -> fmt::Result {
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
            "  passed over  {} changes, at most {:.4} N m; {:.3} mJ given, {:.3} mJ taken",
            answers.changes,
            answers.greatest_change,
            1e3 * answers.given,
            1e3 * answers.taken
        )
    }
}
