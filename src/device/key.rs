//! The dead-man key: torque only while somebody holds it.
//!
//! A terminal reports no release of a key, only repetitions of it. So the key counts as held for [`FIRST`] after it
//! went down, the delay before a keyboard repeats, and for [`REPEATED`] after each repetition. Presses cross to the
//! real-time thread as a number, without a lock; time passes there by the ticks' own durations.

use std::sync::{
    Arc,
    atomic::{AtomicU32, Ordering},
};

/// Time after the first press for which the key counts as held (s): keyboards begin to repeat after 0.25 to 0.66 s.
pub const FIRST: f64 = 0.75;

/// Time after a repetition for which the key counts as held (s): keyboards repeat at 10 to 30 Hz.
pub const REPEATED: f64 = 0.2;

/// The key as the real-time thread sees it.
#[derive(Debug)]
pub struct Key {
    presses: Arc<AtomicU32>,
    seen: u32,
    /// Since the last press (s).
    since: f64,
    /// How long the last press counts (s); zero while the key is up.
    counts: f64,
}

/// The key, for the thread that reads the keyboard.
#[derive(Clone, Debug)]
pub struct KeyInput(Arc<AtomicU32>);

impl Key {
    /// Returns a key that is up, and what presses it.
    #[must_use]
    pub fn new() -> (Self, KeyInput) {
        let presses = Arc::new(AtomicU32::new(0));
        (Self { presses: Arc::clone(&presses), seen: 0, since: 0.0, counts: 0.0 }, KeyInput(presses))
    }

    /// Lets `elapsed` (s) pass.
    pub(super) fn pass(&mut self, elapsed: f64) {
        self.since += elapsed;
        let presses = self.presses.load(Ordering::Acquire);
        if presses != self.seen {
            self.seen = presses;
            self.counts = if self.is_held() { REPEATED } else { FIRST };
            self.since = 0.0;
        } else if !self.is_held() {
            self.counts = 0.0;
        }
    }

    /// Returns whether the key is held.
    #[must_use]
    pub fn is_held(&self) -> bool {
        self.since < self.counts
    }
}

impl KeyInput {
    /// Presses the key, or repeats it. Never waits.
    pub fn press(&self) {
        self.0.fetch_add(1, Ordering::Release);
    }
}
