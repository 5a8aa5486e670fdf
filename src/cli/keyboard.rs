//! The dead-man key on the terminal: while this is held, every character that arrives presses the key.
//!
//! The terminal hands characters over at once and does not show them; it is as before when this is dropped.

use super::Failure;
use crate::device::KeyInput;

/// A terminal that presses a key.
#[cfg(unix)]
pub struct Keyboard {
    before: rustix::termios::Termios,
    over: std::sync::Arc<std::sync::atomic::AtomicBool>,
    reader: Option<std::thread::JoinHandle<()>>,
}

#[cfg(unix)]
mod unix {
    use super::{Failure, KeyInput, Keyboard};
    use crate::threads::spawn;
    use rustix::{
        event::{PollFd, PollFlags, Timespec, poll},
        io::read,
        termios::{LocalModes, OptionalActions, isatty, tcgetattr, tcsetattr},
    };
    use std::{
        io::stdin,
        sync::{
            Arc,
            atomic::{AtomicBool, Ordering},
        },
    };

    /// How long the reader waits before it looks whether it is over.
    const PATIENCE: Timespec = Timespec { tv_sec: 0, tv_nsec: 50_000_000 };

    impl Keyboard {
        /// Starts to press `key`.
        ///
        /// # Errors
        /// If standard input is no terminal.
        pub fn start(key: KeyInput) -> Result<Self, Failure> {
            if !isatty(stdin()) {
                return Err(
                    "the dead-man key is read from the terminal, and standard input is none: run haptize in one".into(),
                );
            }
            let before = tcgetattr(stdin())?;
            let mut raw = before.clone();
            // Ctrl-C stays a signal.
            raw.local_modes -= LocalModes::ICANON | LocalModes::ECHO;
            tcsetattr(stdin(), OptionalActions::Now, &raw)?;
            let over = Arc::new(AtomicBool::new(false));
            let ends = Arc::clone(&over);
            // Dropped, it gives the terminal back.
            let mut keyboard = Self { before, over, reader: None };
            keyboard.reader = Some(spawn("keyboard", move || {
                let mut characters = [0; 64];
                while !ends.load(Ordering::Relaxed) {
                    let input = stdin();
                    let mut ready = [PollFd::new(&input, PollFlags::IN)];
                    let pressed = poll(&mut ready, Some(&PATIENCE)).is_ok_and(|ready| ready > 0)
                        && read(&input, &mut characters).is_ok_and(|count| count > 0);
                    if pressed {
                        key.press();
                    }
                }
            })?);
            Ok(keyboard)
        }
    }

    impl Drop for Keyboard {
        fn drop(&mut self) {
            self.over.store(true, Ordering::Relaxed);
            if let Some(reader) = self.reader.take() {
                // It has no result.
                let _ = reader.join();
            }
            // What the key has typed and nobody read is thrown away. Nothing could be done about a failure.
            let _ = tcsetattr(stdin(), OptionalActions::Flush, &self.before);
        }
    }
}

/// Elsewhere than on Unix no terminal is read.
#[cfg(not(unix))]
pub struct Keyboard;

#[cfg(not(unix))]
impl Keyboard {
    /// Refuses.
    ///
    /// # Errors
    /// Always.
    pub fn start(_: KeyInput) -> Result<Self, Failure> {
        Err("the dead-man key needs a terminal of Linux or macOS".into())
    }
}
