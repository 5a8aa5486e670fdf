//! `haptize man`: manual pages, one for the program and one for each command.

use super::{
    Failure,
    output::{Folder, Overwritten},
    report::{self, Describe, Report, Text},
};
use crate::dataset::replace_file;
use clap_mangen::Man;
use serde::Serialize;
use std::path::PathBuf;

/// Where the pages go.
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  haptize man -o ~/.local/share/man/man1     then: man haptize, man haptize-bake")]
pub struct Arguments {
    /// The folder to write the pages to.
    #[arg(short, long, default_value = "man")]
    output: PathBuf,
}

/// Writes all pages; those of an earlier version are replaced.
pub fn run(arguments: &Arguments) -> Result<Report, Failure> {
    let folder = &arguments.output;
    let mut line = super::command_line().disable_help_subcommand(true);
    line.build();
    let commands = line.get_subcommands().filter(|command| !command.is_hide_set()).cloned();
    let pages: Vec<Man> = std::iter::once(line.clone()).chain(commands).map(Man::new).collect();
    let names: Vec<String> = pages.iter().map(Man::get_filename).collect();
    let earlier = Folder::check(folder, names.iter().map(String::as_str), [])?;
    std::fs::create_dir_all(folder)
        .map_err(|error| format!("cannot make the folder {}: {error}; give another by -o", folder.display()))?;
    let files: Vec<PathBuf> = names.iter().map(|name| folder.join(name)).collect();
    for (page, file) in pages.iter().zip(&files) {
        replace_file(file, |out| page.render(out))
            .map_err(|error| format!("cannot write {}: {error}; give another place by -o", file.display()))?;
    }
    let (shown, folder) = (report::names(&files), folder.display().to_string());
    Report::new(&Pages { files: shown, folder, overwritten: earlier.close(&files)? })
}

/// Pages that were written.
#[derive(Serialize)]
struct Pages {
    files: Vec<String>,
    #[serde(skip)]
    folder: String,
    #[serde(flatten)]
    overwritten: Overwritten,
}

impl Describe for Pages {
    fn describe(&self, text: &mut Text) {
        text.line(format_args!("{} manual pages in {}", self.files.len(), self.folder));
        self.overwritten.describe(text);
    }
}
