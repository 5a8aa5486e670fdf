//! `haptize man`: manual pages, one for the program and one for each command.

use super::{
    Failure, Report,
    output::{self, Kind},
};
use crate::dataset::replace_file;
use clap_mangen::Man;
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
    std::fs::create_dir_all(folder)
        .map_err(|error| format!("cannot make the folder {}: {error}; give another by -o", folder.display()))?;
    let mut line = super::command_line().disable_help_subcommand(true);
    line.build();
    let commands = line.get_subcommands().filter(|command| !command.is_hide_set()).cloned();
    let pages: Vec<Man> = std::iter::once(line.clone()).chain(commands).map(Man::new).collect();
    let mut files = Vec::new();
    for page in pages {
        let file = folder.join(page.get_filename());
        output::check(&file, Kind::Page, [])?;
        replace_file(&file, |out| page.render(out))
            .map_err(|error| format!("cannot write {}: {error}; give another place by -o", file.display()))?;
        files.push(file.display().to_string());
    }
    let text = format!("{} manual pages in {}\n", files.len(), folder.display());
    Ok(Report { text, json: serde_json::json!({ "files": files }), whole: true })
}
