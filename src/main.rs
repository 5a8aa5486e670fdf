//! The command line of haptize; see [`cli`].

mod cli;

fn main() -> std::process::ExitCode {
    cli::run()
}
