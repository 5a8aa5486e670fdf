//! Progress on standard error: a bar on a terminal, a line now and then elsewhere.

use super::tell;
use indicatif::{ProgressBar, ProgressStyle};
use std::{
    io::{IsTerminal, stderr},
    sync::{
        Mutex, PoisonError,
        atomic::{AtomicBool, Ordering},
    },
    time::{Duration, Instant},
};

/// Time between two lines (s): work of a few seconds prints none.
const BETWEEN_LINES: Duration = Duration::from_secs(5);

/// How far some work has come.
pub struct Bar {
    bar: ProgressBar,
    /// Name of what is counted.
    unit: &'static str,
    /// Whether it has a length: a bar without one is not drawn.
    begun: AtomicBool,
    /// When the last line was printed; absent on a terminal.
    last_line: Option<Mutex<Instant>>,
}

impl Bar {
    /// Returns a bar of so many `unit`, without a length yet, drawn as `template` says.
    pub fn new(unit: &'static str, template: &str) -> Self {
        let style = ProgressStyle::with_template(template).unwrap_or_else(|_| ProgressStyle::default_bar());
        let bar = ProgressBar::hidden().with_style(style);
        // Without a length it could not be lengthened.
        bar.set_length(0);
        Self {
            bar,
            unit,
            begun: AtomicBool::new(false),
            last_line: (!stderr().is_terminal()).then(|| Mutex::new(Instant::now())),
        }
    }

    /// Shows `done` of `length` steps, and `message`.
    pub fn set(&self, done: u64, length: u64, message: String) {
        self.bar.set_length(length);
        self.bar.set_message(message);
        self.bar.set_position(done);
        self.show();
    }

    /// Adds `steps` to the length.
    pub fn lengthen(&self, steps: usize) {
        self.bar.inc_length(steps as u64);
    }

    /// Adds a step that is done.
    pub fn step(&self) {
        self.bar.inc(1);
        self.show();
    }

    /// Takes the bar off the terminal.
    pub fn finish(&self) {
        self.bar.finish_and_clear();
    }

    fn show(&self) {
        let begins = !self.begun.swap(true, Ordering::Relaxed);
        if begins {
            // What was done before the first step says nothing of the rest.
            self.bar.reset_eta();
        }
        let Some(last_line) = &self.last_line else {
            if begins {
                self.bar.set_draw_target(indicatif::ProgressDrawTarget::stderr());
            }
            return;
        };
        let mut last_line = last_line.lock().unwrap_or_else(PoisonError::into_inner);
        if last_line.elapsed() < BETWEEN_LINES {
            return;
        }
        let (done, length) = (self.bar.position(), self.bar.length().unwrap_or(0));
        if done == 0 {
            return;
        }
        *last_line = Instant::now();
        let message = self.bar.message();
        let message = if message.is_empty() { message } else { format!(", {message}") };
        let (unit, left) = (self.unit, self.bar.eta().as_secs());
        tell(format_args!("haptize: {done} of {length} {unit}{message}, about {left} s left"));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_bar_is_as_long_as_all_that_was_added() {
        let bar = Bar::new("points", "{pos}/{len}");
        bar.lengthen(3);
        bar.step();
        bar.lengthen(4);
        assert_eq!((bar.bar.position(), bar.bar.length()), (1, Some(7)));
    }
}
