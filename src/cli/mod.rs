//! Command line: one thin file a subcommand, everything else in the library.
//!
//! A subcommand `name` is a file `name.rs` beside this one with
//! - `pub struct Arguments`, deriving `clap::Args`: its arguments, documented, since the doc comments are the help
//!   text;
//! - `pub fn run(arguments: &Arguments) -> Result<Report, Failure>`: its work.
//!
//! and two lines here: `mod name;` and one of `commands`. A subcommand appears
//! here only once it works. It never prints its result itself: it returns a `Report` of one value that is both described
//! and serialised, and `--json` (an option of every subcommand) decides here which of the two goes to standard output.
//! Notes and progress go to standard error.
//!
//! Exit codes: 0 the work is whole, 1 it failed or is not whole, 2 the command line itself is wrong (given by clap),
//! 130 a signal ended it.

/// Which adapter draws and computes, for the help of commands that use one.
macro_rules! adapter_help {
    () => {
        "\n\nWith several GPUs the first that `haptize doctor` lists draws, and all of the fastest kind solve. Set \
         WGPU_ADAPTER_NAME to parts of their names or to their addresses, with commas between, to choose others: \
         \"RTX 4090\", \"01:00.0,02:00.0\"."
    };
}

mod accuracy;
mod bake;
mod baked;
mod bar;
mod completions;
mod crash;
mod demo;
mod device;
mod doctor;
mod export;
mod gridize;
mod guessed;
mod import;
mod info;
mod inspect;
mod interrupt;
mod keyboard;
mod man;
mod max_error;
mod merge;
mod motion;
mod new;
mod output;
mod paper;
mod place;
mod plan;
mod play;
mod playback_report;
mod played;
mod reach;
mod refine;
mod remarks;
mod report;
mod scan;
mod shape;
mod shard;
mod shell;
mod twin;
mod view;
mod watch;

use self::report::Report;
use crate::{
    cache::Cache,
    names,
    render::trace::Tick,
    sweep::{OTHER_ADAPTER, remedied},
    threads,
};
use clap::{ArgMatches, CommandFactory, FromArgMatches, Parser, Subcommand};
use std::{
    borrow::Cow,
    error::Error,
    ffi::OsString,
    io::{self, ErrorKind, Write},
};

/// Precomputed contact between an arm and a deformable object, rendered at 1 kHz.
#[derive(Parser)]
#[command(
    name = "haptize",
    version,
    after_help = "\
Examples:
  haptize                                the demo: bakes, presses and draws a soft sphere, into ./out
  haptize new                            writes a commented scene, sphere.toml
  haptize bake sphere.toml               solves contact at every point of its grid
  haptize play sphere.haptize            feels the result with a simulated hand
  haptize view sphere.haptize            opens it in a window"
)]
struct CommandLine {
    #[command(subcommand)]
    command: Option<Command>,
    /// Print one machine-readable JSON object on standard output.
    #[arg(long, global = true)]
    json: bool,
    /// Replace existing files even if haptize did not write them.
    #[arg(long, global = true)]
    force: bool,
    /// Ignore what earlier commands kept of the same body, and keep nothing.
    #[arg(long, global = true)]
    no_cache: bool,
}

/// The subcommands, each with the module of its arguments and its work.
macro_rules! commands {
    ($($(#[$help:meta])* $name:ident: $module:ident;)*) => {
        #[derive(Subcommand)]
        enum Command {
            $($(#[$help])* $name($module::Arguments),)*
        }

        impl Command {
            fn run(&self) -> Result<Report, Failure> {
                match self {
                    $(Self::$name(arguments) => $module::run(arguments),)*
                }
            }
        }
    };
}

commands! {
    /// Measure error and computing time for many grids, interpolations and tolerances, with figures.
    Accuracy: accuracy;
    /// Solve contact at every point of a scene's grid and write the dataset.
    Bake: bake;
    /// Print the completion script of a shell.
    Completions: completions;
    /// List real haptic devices, and run one carefully for the first time.
    Device: device;
    /// Report what this machine offers: threads, graphics adapters, real-time priority.
    Doctor: doctor;
    /// Convert a dataset for other programs.
    Export: export;
    /// Interpolate scattered measurements onto a grid: a scan's log, or tables of joint positions and torques.
    Gridize: gridize;
    /// Turn a robot file (URDF, MJCF) into a scene: its joints, inertias and shapes, before a soft ball.
    Import: import;
    /// Check a dataset and summarise it.
    Info: info;
    /// Solve one configuration and print every detail, beside what a dataset interpolates there.
    Inspect: inspect;
    /// Write the manual pages.
    Man: man;
    /// Join the shards of a bake into one dataset.
    Merge: merge;
    /// Write a commented scene to begin with.
    New: new;
    /// Remake the figures and numbers of the paper, and compare them with the published ones.
    Paper: paper;
    /// Put the tip of an arm before an object, and find a grid and a press there.
    Place: place;
    /// Estimate time and memory of each shard of a bake, with lines for job schedulers.
    Plan: plan;
    /// Feel a dataset with a simulated hand or a real device: traces and figures.
    Play: play;
    /// Find where contact is, before anything is baked: ranges, depth, and what a grid over them takes.
    Reach: reach;
    /// Measure a real object by touching it with a rig (the rig that ships is simulated).
    Scan: scan;
    /// Find the surface of a scanned object from the log of its scan.
    Shape: shape;
    /// Make a scene of what was scanned: an elastic object that answers with the torques of the log.
    Twin: twin;
    /// Open a dataset or a scene in a window.
    View: view;
}

/// Returns the command line as it is parsed.
fn command_line() -> clap::Command {
    CommandLine::command()
}

/// Why a subcommand failed: any module's error. Its message names file and line if there is one, and the remedy.
type Failure = Box<dyn Error + Send + Sync>;

/// Runs what the command line `arguments`, the program's name first, asks for; returns the exit code.
pub fn run(arguments: impl IntoIterator<Item = OsString>) -> u8 {
    let arguments: Vec<OsString> = arguments.into_iter().collect();
    // A name that forges a line would be printed again and again.
    let mut texts = arguments.iter().skip(1).map(|argument| argument.to_string_lossy());
    if let Some(argument) = texts.find(|argument| argument.contains(names::is_disruptive)) {
        let what = format!(
            "\"{}\" holds characters that break or turn a line: leave them out, or rename the file",
            names::escaped(&argument)
        );
        last_words(&what, arguments.iter().any(|argument| argument == "--json"));
        return WRONG_COMMAND_LINE;
    }
    let parsed = command_line().try_get_matches_from(arguments);
    let parsed = parsed.and_then(|matches| Ok((CommandLine::from_arg_matches(&matches)?, matches)));
    let (line, matches) = match parsed {
        Ok(parsed) => parsed,
        Err(error) => return usage(&error),
    };
    if line.force {
        output::force();
    }
    if !line.no_cache {
        Cache::of_user(|note| tell(format_args!("haptize: note: {note}"))).into_iter().for_each(Cache::begin);
    }
    remarks::listen();
    crash::let_go_first();
    // What refines a grid keeps nothing before its end.
    let refines = matches.subcommand().is_some_and(|(_, given)| given.try_contains_id("refine").unwrap_or(false));
    let resumes = has(&matches, "resume") && !refines;
    let begun = interrupt::listen(line.json, resumes).and_then(|()| Ok(threads::begin_shared()?));
    let report = begun.and_then(|()| line.command.as_ref().map_or_else(demo::run, Command::run));
    match report.and_then(|report| print(&report, line.json).map(|()| report.whole)) {
        Ok(true) => 0,
        Ok(false) => 1,
        Err(failure) => {
            last_words(&remedied(&explain(failure.as_ref()), remedy(&matches)), line.json);
            1
        }
    }
}

/// Whether the command that is asked for has `option`.
fn has(matches: &ArgMatches, option: &str) -> bool {
    let line = command_line();
    let command = matches.subcommand_name().and_then(|name| line.find_subcommand(name));
    command.is_some_and(|command| command.get_arguments().any(|argument| argument.get_long() == Some(option)))
}

/// Returns what helps where a GPU fails: an option of the command, if it has one.
fn remedy(matches: &ArgMatches) -> &'static str {
    match () {
        () if has(matches, "backend") => "--backend cpu",
        () if has(matches, "no-gpu") => "--no-gpu",
        () => OTHER_ADAPTER,
    }
}

/// Parses a fraction: `0.05` or `5%`.
fn fraction(text: &str) -> Result<f64, String> {
    let (digits, scale) = text.trim().strip_suffix('%').map_or((text.trim(), 1.0), |digits| (digits.trim(), 0.01));
    let number = digits.parse::<f64>().map_err(|_| "give a fraction such as 0.05 or 5%".to_owned())?;
    Ok(number * scale)
}

/// Answers a command line that is wrong, or asks for help.
fn usage(error: &clap::Error) -> u8 {
    let text = error.render().to_string();
    if printable(&text) == text {
        // In colour on a terminal. Where nobody listens there is nobody to tell.
        let _ = error.print();
    } else {
        tell(format_args!("{}", text.trim_end()));
    }
    // It could not be parsed, so that the option is looked for in the words themselves.
    if error.use_stderr() && std::env::args_os().any(|word| word == "--json") {
        print_error(&text);
    }
    u8::try_from(error.exit_code()).unwrap_or(1)
}

/// Exit code of a wrong command line, as clap has it.
const WRONG_COMMAND_LINE: u8 = 2;

/// Tells why the program ends: on standard error, and with `json` in one object on standard output.
fn last_words(message: &str, json: bool) {
    tell(format_args!("haptize: {message}"));
    if json {
        print_error(message);
    }
}

/// Prints the object of a failure. Where standard output is what failed there is nobody left to tell.
fn print_error(message: &str) {
    let json = serde_json::json!({ "error": message.trim_end() });
    let _ = print(&Report { text: String::new(), json, whole: false }, true);
}

/// Prints a line on standard error. It may be closed or full: then there is nobody to tell, and the work goes on.
fn tell(line: std::fmt::Arguments<'_>) {
    let _ = writeln!(io::stderr(), "{}", printable(&line.to_string()));
}

/// Returns what hands ticks on to `next` and says at the first fault that the torque went to zero, and why: whoever
/// holds the device feels nothing any more.
fn telling_faults(next: &mut dyn FnMut(&Tick)) -> impl FnMut(&Tick) {
    let mut is_told = false;
    move |tick| {
        if let Some(fault) = tick.fault
            && !std::mem::replace(&mut is_told, true)
        {
            let time = tick.time;
            tell(format_args!("haptize: at {time:.4} s the torque went to zero: {fault}; play again to clear it"));
        }
        next(tick);
    }
}

/// Returns `text`, which has lines, with other control characters spelt as `\u001b`: names and texts of files must not
/// command a terminal.
fn printable(text: &str) -> Cow<'_, str> {
    names::escaped_but(text, &['\n'])
}

/// Prints one half of `report`. A reader that has seen enough (`haptize info ... | head`) is no failure.
fn print(report: &Report, json: bool) -> Result<(), Failure> {
    let mut out = io::stdout().lock();
    let text = if json { format!("{:#}\n", report.json) } else { report.text.clone() };
    let printed = write!(out, "{}", printable(&text));
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

    #[test]
    fn the_command_line_is_consistent() {
        command_line().debug_assert();
    }

    #[test]
    fn every_command_shows_examples_that_parse() {
        let mut line = command_line();
        line.build();
        let helps = line.get_subcommands().filter(|command| command.get_name() != "help").cloned();
        for command in std::iter::once(command_line()).chain(helps) {
            let help = command.get_after_help().map(ToString::to_string).unwrap_or_default();
            let examples: Vec<&str> = help.lines().filter_map(|line| line.strip_prefix("  haptize")).collect();
            assert!(help.starts_with("Examples:\n  haptize") && !examples.is_empty(), "{}", command.get_name());
            for example in examples {
                // The command ends at a redirection or where its explanation begins.
                let words = example.split('>').next().unwrap_or_default().split("  ").next().unwrap_or_default();
                let words = words.split_whitespace().map(|word| word.trim_matches('"'));
                let parsed = CommandLine::try_parse_from(std::iter::once("haptize").chain(words));
                assert!(parsed.is_ok(), "{example}: {}", parsed.err().map_or(String::new(), |error| error.to_string()));
            }
        }
    }

    #[test]
    fn nothing_that_is_printed_commands_a_terminal() {
        let text = "a\u{1b}[31mred\u{7}\r\u{9b}2J\tz\nä\u{202e}\u{2028}";
        assert_eq!(printable(text), "a\\u001b[31mred\\u0007\\u000d\\u009b2J\\u0009z\nä\\u202e\\u2028");
        // The same escapes are JSON's.
        let json = serde_json::json!({ "error": text }).to_string();
        assert_eq!(serde_json::from_str::<serde_json::Value>(&printable(&json)).unwrap()["error"], text);
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
