//! Progress on standard error: a bar on a terminal, a line now and then elsewhere.

use super::tell;
use crate::names::duration;
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
    state: Mutex<State>,
}

/// What is told beside the steps.
#[derive(Default)]
struct State {
    message: String,
    /// Time left, where the steps that are done do not tell it (s).
    left: Option<f64>,
}

impl Bar {
    /// Returns a bar of so many `unit`, without a length yet, drawn as `template` says; its message ends in the time left.
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
            state: Mutex::default(),
        }
    }

    /// Shows `done` of `length` steps, and `message`. `left`: time left; none where a step takes as long as another (s).
    pub fn set(&self, done: u64, length: u64, message: String, left: Option<f64>) {
        *self.state.lock().unwrap_or_else(PoisonError::into_inner) = State { message, left };
        self.bar.set_length(length);
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
        let State { message, left } = &*self.state.lock().unwrap_or_else(PoisonError::into_inner);
        let left = left.unwrap_or_else(|| self.bar.eta().as_secs_f64());
        let left = (self.bar.position() > 0).then(|| format!("about {} left", duration(left)));
        let told: Vec<&str> =
            [message.as_str()].into_iter().filter(|text| !text.is_empty()).chain(left.as_deref()).collect();
        let told = told.join(", ");
        let Some(last_line) = &self.last_line else {
            self.bar.set_message(told);
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
        tell(format_args!("haptize: {done} of {length} {}, {told}", self.unit));
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
