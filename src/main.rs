//! The command line of haptize; see [`haptize::cli`].

fn main() -> std::process::ExitCode {
    // Mesa's device-select layer reorders adapters, which haptize ranks itself, and prints errors where there is no
    // display. This is the layer's own switch.
    // SAFETY: no other thread runs yet.
    unsafe { std::env::set_var("NODEVICE_SELECT", "1") };
    haptize::cli::run(std::env::args_os()).into()
}
