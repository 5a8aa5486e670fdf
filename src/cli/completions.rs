//! `haptize completions`: what makes a shell complete commands and options.

use super::{Failure, Report};
use clap_complete::Shell;

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
    let text = String::from_utf8(script)?;
    let json = serde_json::json!({ "shell": arguments.shell.to_string(), "script": text });
    Ok(Report { text, json, whole: true })
}
