//! Command line: one thin file a subcommand, everything else in the library.
//!
//! A subcommand `name` is a file `name.rs` beside this one with
//! - `pub struct Arguments`, deriving `clap::Args`: its arguments, documented, since the doc comments are the help text;
//! - `pub fn run(arguments: &Arguments) -> Result<Report, Failure>`: its work.
//!
//! and three lines here: `mod name;`, a variant of [`Command`] and an arm of [`Command::run`]. A subcommand appears
//! here only once it works. It never prints its result itself: it returns a [`Report`], and `--json` (an option of every
//! subcommand) decides here which half of it goes to standard output. Notes and progress go to standard error.
//!
//! Exit codes: 0 the work is whole, 1 it failed or is not whole, 2 the command line itself is wrong (given by clap).

mod accuracy;
mod bake;
mod bar;
mod demo;
mod doctor;
mod export;
mod felt;
mod gridize;
mod info;
mod inspect;
mod interrupt;
mod max_error;
mod output;
mod paper;
mod play;
mod scan;
mod stability;
mod view;

use clap::{Parser, Subcommand};
use std::{
    error::Error,
    ffi::OsString,
    io::{self, ErrorKind, Write},
};

/// Which adapter draws and computes, for the commands that use one.
const ADAPTER_HELP: &str = "Of several graphics adapters the best is taken. The environment variable WGPU_ADAPTER_NAME, set to \
                            a part of its name, takes another; `haptize doctor` lists them.";

/// Haptize: contact solved beforehand for every joint configuration, felt at 1 kHz.
#[derive(Parser)]
#[command(version, after_help = "Without a command: a demo. A soft sphere is haptized, pressed and drawn, into ./out.")]
struct CommandLine {
    #[command(subcommand)]
    command: Option<Command>,
    /// Print one machine-readable JSON object on standard output.
    #[arg(long, global = true)]
    json: bool,
}

#[derive(Subcommand)]
enum Command {
    /// Show what accuracy costs in time: error against spacing, interpolation, tolerance and more, with figures.
    Accuracy(accuracy::Arguments),
    /// Haptize a scene: solve contact at every point of its grid.
    Bake(bake::Arguments),
    /// Say what this machine offers: threads, graphics adapters, real-time rights.
    Doctor(doctor::Arguments),
    /// Write a dataset for other programs.
    Export(export::Arguments),
    /// Make a dataset of scattered measurements: a scan's log, or any tables of joint positions and torques.
    Gridize(gridize::Arguments),
    /// Say what a dataset holds, after checking all of it.
    Info(info::Arguments),
    /// Solve one configuration and tell all of it.
    Inspect(inspect::Arguments),
    /// Remake the figures and numbers of the paper, with a table that compares them.
    Paper(paper::Arguments),
    /// Feel a dataset through a simulated hand: traces and figures.
    Play(play::Arguments),
    /// Haptize a real object by touching it on a rig (the one that ships is simulated).
    Scan(scan::Arguments),
    /// Run the hard cases of every room on this machine, and say what stayed within its bound.
    Stability(stability::Arguments),
    /// See and press a dataset in a window.
    View(view::Arguments),
}

impl Command {
    fn run(&self) -> Result<Report, Failure> {
        match self {
            Self::Accuracy(arguments) => accuracy::run(arguments),
            Self::Bake(arguments) => bake::run(arguments),
            Self::Doctor(arguments) => doctor::run(arguments),
            Self::Export(arguments) => export::run(arguments),
            Self::Gridize(arguments) => gridize::run(arguments),
            Self::Info(arguments) => info::run(arguments),
            Self::Inspect(arguments) => inspect::run(arguments),
            Self::Paper(arguments) => paper::run(arguments),
            Self::Play(arguments) => play::run(arguments),
            Self::Scan(arguments) => scan::run(arguments),
            Self::Stability(arguments) => stability::run(arguments),
            Self::View(arguments) => view::run(arguments),
        }
    }
}

/// Why a subcommand failed: any room's error. Its message names file and line where there is one, and the remedy.
type Failure = Box<dyn Error + Send + Sync>;

/// What a subcommand found out or did, for people and for programs.
struct Report {
    /// For people: whole lines, the last one ended too.
    text: String,
    /// For programs: one object.
    json: serde_json::Value,
    /// False where something is missing from the result (unfinished, or not as it should be): exit code 1.
    whole: bool,
}

/// Runs what the command line `arguments`, the program's name first, asks for; returns the exit code. Ends the process where they are
/// wrong, or ask for help.
pub fn run(arguments: impl IntoIterator<Item = OsString>) -> u8 {
    let line = CommandLine::parse_from(arguments);
    let report = start_threads().and_then(|()| line.command.as_ref().map_or_else(demo::run, Command::run));
    match report.and_then(|report| print(&report, line.json).map(|()| report.whole)) {
        Ok(true) => 0,
        Ok(false) => 1,
        Err(failure) => {
            let message = explain(failure.as_ref());
            tell(format_args!("haptize: {message}"));
            if line.json {
                let report =
                    Report { text: String::new(), json: serde_json::json!({ "error": message }), whole: false };
                // Where standard output is what failed there is nobody left to tell.
                let _ = print(&report, true);
            }
            1
        }
    }
}

/// Prints a line on standard error. It may be closed or full: then there is nobody to tell, and the work goes on.
fn tell(line: std::fmt::Arguments<'_>) {
    let _ = writeln!(io::stderr(), "{line}");
}

/// Starts the threads that all work shares: where the system gives none, this is an error here and a panic later.
fn start_threads() -> Result<(), Failure> {
    let remedy = "close other programs, or raise the limits on processes and memory (ulimit -u, ulimit -v)";
    let started = rayon::ThreadPoolBuilder::new().build_global();
    started.map_err(|error| format!("no threads to work with: {error}; {remedy}").into())
}

/// Prints one half of `report`. A reader that has seen enough (`haptize info ... | head`) is no failure.
fn print(report: &Report, json: bool) -> Result<(), Failure> {
    let mut out = io::stdout().lock();
    let printed = if json { writeln!(out, "{:#}", report.json) } else { write!(out, "{}", report.text) };
    match printed.and_then(|()| out.flush()) {
        Err(error) if error.kind() != ErrorKind::BrokenPipe => {
            Err(format!("cannot write to standard output: {error}; free some space or redirect it elsewhere").into())
        }
        _ => Ok(()),
    }
}

/// The error's message, and those of its causes that it does not already quote.
fn explain(error: &(dyn Error + 'static)) -> String {
    let mut text = error.to_string();
    let mut cause = error.source();
    while let Some(inner) = cause {
        let message = inner.to_string();
        if !text.contains(&message) {
            text.push_str("\n  because: ");
            text.push_str(&message);
        }
        cause = inner.source();
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::CommandFactory;

    #[test]
    fn the_command_line_is_consistent() {
        CommandLine::command().debug_assert();
    }

    #[derive(Debug, thiserror::Error)]
    #[error("outer {quoted}")]
    struct Outer {
        quoted: &'static str,
        source: io::Error,
    }

    #[test]
    fn an_explanation_names_each_cause_once() {
        let outer = |quoted| Outer { quoted, source: io::Error::other("inner") };
        assert_eq!(explain(&outer("quotes inner")), "outer quotes inner");
        assert_eq!(explain(&outer("alone")), "outer alone\n  because: inner");
    }
}
