//! `haptize completions`: what makes a shell complete commands and options.

use super::{
    Failure,
    report::{Describe, Report, Text},
};
use clap_complete::Shell;
use serde::Serialize;

/// For which shell.
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  haptize completions bash > ~/.local/share/bash-completion/completions/haptize
  haptize completions zsh > ~/.zfunc/_haptize
  haptize completions fish > ~/.config/fish/completions/haptize.fish")]
pub struct Arguments {
    /// The shell.
    shell: Shell,
}

/// Prints the shell's script.
pub fn run(arguments: &Arguments) -> Result<Report, Failure> {
    let mut script = Vec::new();
    clap_complete::generate(arguments.shell, &mut super::command_line(), "haptize", &mut script);
    Report::new(&Completions { shell: arguments.shell.to_string(), script: String::from_utf8(script)? })
}

/// The script of a shell.
#[derive(Serialize)]
struct Completions {
    shell: String,
    script: String,
}

impl Describe for Completions {
    fn describe(&self, text: &mut Text) {
        text.line(self.script.trim_end());
    }
}
