//! `haptize gridize --guess`: a column mapping to begin with.

use super::{
    Failure,
    output::{self, Content},
    report::{Describe, Report, Text},
    shell,
};
use crate::{
    dataset::replace_file,
    logs::{GuessedMapping, guess},
    ros::is_mcap,
    toml_text::coarse,
};
use serde::Serialize;
use std::{
    io::Write as _,
    path::{Path, PathBuf},
};

/// A mapping that was written.
#[derive(Serialize)]
struct Guessed {
    file: String,
    /// What to check, one sentence each.
    doubts: Vec<String>,
    /// Spacing of a grid to begin with, a number a joint (rad or m).
    steps: Vec<f64>,
    next: String,
}

impl Describe for Guessed {
    fn describe(&self, text: &mut Text) {
        text.line(format_args!("wrote {}; check:", self.file));
        self.doubts.iter().for_each(|doubt| text.line(format_args!("  - {doubt}")));
        text.line(format_args!("next: {}", self.next));
        text.line("      with --scene ARM.toml, a scene with the joints of the log, it can be played, too");
    }
}

/// Writes the mapping of the first of `logs`, to `output` or a name like the log's.
pub fn run(logs: &[PathBuf], output: Option<&Path>) -> Result<Report, Failure> {
    let [log] = logs else { return Err("--guess looks at one log: name one".into()) };
    if is_mcap(log) {
        let next = format!("haptize gridize {} --topic NAME --step H", shell::file(log));
        return Err(format!("{}: joint states in MCAP need no mapping: {next}", log.display()).into());
    }
    let name = log.file_name().ok_or("the log's path names no file; give -o")?;
    let file = output.map_or_else(|| Path::new(name).with_extension("columns.toml"), Path::to_owned);
    if file.exists() && !output::is_forced() {
        return Err(format!("{} is there already: name another file by -o, or add --force", file.display()).into());
    }
    output::check(&file, Content::Product, [log.as_path()])?;
    let GuessedMapping { text, doubts, steps } = guess(log)?;
    replace_file(&file, |out| out.write_all(text.as_bytes()))
        .map_err(|error| format!("cannot write {}: {error}; give another place by -o", file.display()))?;
    let step = steps.iter().map(|step| coarse(*step)).collect::<Vec<_>>().join(",");
    let next = format!("haptize gridize {} --columns {} --step {step}", shell::file(log), shell::file(&file));
    Report::new(&Guessed { file: file.display().to_string(), doubts, steps, next })
}
