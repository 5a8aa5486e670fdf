//! Which late ticks the hypervisor made late: on a virtual machine, time in which a processor was taken away counts as
//! *steal* in /proc/stat.
//!
//! The counters advance by hundredths of a second, so that a short pause may show late or, of itself, not at all. A
//! late tick counts as beside steal where the counter of its processor advanced between `BEFORE` before its deadline
//! and `AFTER` after its beginning. The haptic thread only notes when and where a tick was late; the recorder reads the
//! counters.

use serde::Serialize;
use std::{collections::VecDeque, time::Duration};

/// A counter's step.
const BEFORE: Duration = Duration::from_millis(10);

/// A counter's step, and the time between two of its readings.
const AFTER: Duration = Duration::from_millis(20);

/// A tick that began late.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LateTick {
    /// When it began, in time since the clock's origin.
    pub at: Duration,
    /// How late.
    pub by: Duration,
    /// Number of the processor that it ran on.
    pub processor: usize,
}

/// Late ticks and stolen time of a session.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Steal {
    /// Ticks that began more than half a period late.
    pub late: u64,
    /// Those of them beside which the hypervisor took their processor.
    pub late_beside_steal: u64,
    /// Time that it took from all processors during the session (s).
    pub seconds: f64,
}

/// Compares late ticks with the counters of stolen time.
pub struct StealObserver {
    /// Steps of the counters in a second.
    per_second: f64,
    /// When the counters were read, and what they were, processor by processor; ascending in time.
    readings: VecDeque<(Duration, Vec<u64>)>,
    pending: VecDeque<LateTick>,
    first: u64,
    found: Steal,
}

impl StealObserver {
    /// An observer whose counters stand at `counters` at the time `now` and make `per_second` steps a second.
    #[must_use]
    pub fn new(now: Duration, counters: Vec<u64>, per_second: f64) -> Self {
        let first = counters.iter().sum();
        Self {
            per_second,
            readings: [(now, counters)].into(),
            pending: VecDeque::new(),
            first,
            found: Steal::default(),
        }
    }

    /// Takes in a late tick.
    pub fn add(&mut self, tick: LateTick) {
        self.found.late += 1;
        self.pending.push_back(tick);
    }

    /// Takes in that the counters stand at `counters` at the time `now`, and judges the late ticks that are old enough.
    pub fn read(&mut self, now: Duration, counters: Vec<u64>) {
        self.readings.push_back((now, counters));
        while let Some(tick) = self.pending.front().copied().filter(|tick| tick.at + AFTER <= now) {
            self.pending.pop_front();
            self.judge(&tick);
        }
        let oldest = self.pending.front().map_or(now, |tick| tick.at - tick.by).saturating_sub(BEFORE);
        // The last reading before what may still be asked for is kept.
        while self.readings.get(1).is_some_and(|(at, _)| *at + Duration::from_secs(1) <= oldest) {
            self.readings.pop_front();
        }
    }

    /// Returns the result, once the counters have been read for the last time; none if there are no counters.
    #[must_use]
    pub fn finish(mut self) -> Option<Steal> {
        for tick in std::mem::take(&mut self.pending) {
            self.judge(&tick);
        }
        let last: u64 = self.readings.back().map_or(self.first, |(_, counters)| counters.iter().sum());
        self.found.seconds = last.saturating_sub(self.first) as f64 / self.per_second;
        self.readings.back().filter(|(_, counters)| !counters.is_empty()).map(|_| self.found)
    }

    fn judge(&mut self, tick: &LateTick) {
        let counter = |(_, counters): &(Duration, Vec<u64>)| counters.get(tick.processor).copied();
        let since = (tick.at - tick.by).saturating_sub(BEFORE);
        let before =
            self.readings.iter().rev().find(|(at, _)| *at <= since).or(self.readings.front()).and_then(counter);
        let after =
            self.readings.iter().find(|(at, _)| *at >= tick.at + AFTER).or(self.readings.back()).and_then(counter);
        if before.is_some() && before < after {
            self.found.late_beside_steal += 1;
        }
    }
}

/// Counters of stolen time, processor by processor, in the text of /proc/stat.
#[must_use]
pub fn counters(text: &str) -> Vec<u64> {
    let mut counters = Vec::new();
    for line in text.lines() {
        let mut words = line.split_ascii_whitespace();
        let number =
            words.next().and_then(|name| name.strip_prefix("cpu")).and_then(|number| number.parse::<usize>().ok());
        // user, nice, system, idle, iowait, irq, softirq, steal.
        if let (Some(number), Some(Ok(steal))) = (number, words.nth(7).map(str::parse)) {
            // Processors that are switched off have no line.
            if number < 1 << 16 {
                counters.resize(counters.len().max(number + 1), 0);
                counters[number] = steal;
            }
        }
    }
    counters
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: Duration = Duration::from_millis(1);

    #[test]
    fn counters_are_the_eighth_number_of_each_processor() {
        let text = "cpu  9 9 9 9 9 9 9 77 0 0\ncpu0 1 2 3 4 5 6 7 42 9 9\ncpu2 1 2 3 4 5 6 7 8 9 9\nintr 5\ncpu3 1 2\n";
        assert_eq!(counters(text), [42, 0, 8]);
        assert_eq!(counters(""), [0; 0]);
    }

    #[test]
    fn a_late_tick_is_beside_steal_where_its_own_processor_was_taken_then() {
        let late = |at: u32, processor| LateTick { at: at * MS, by: 3 * MS, processor };
        let mut observer = StealObserver::new(Duration::ZERO, vec![5, 5], 100.0);
        for now in (5..4000).step_by(5) {
            for tick in [late(1000, 0), late(1001, 1), late(2000, 0), late(3000, 0)] {
                if (now..now + 5).contains(&(tick.at.as_millis() as u32)) {
                    observer.add(tick);
                }
            }
            // Processor 0 is taken at 1.0 s for 30 ms, 1 at 2.0 s.
            observer.read(now * MS, vec![if now > 1005 { 8 } else { 5 }, if now > 2000 { 6 } else { 5 }]);
        }
        observer.add(late(3999, 1));
        let found = observer.finish().unwrap();
        assert_eq!((found.late, found.late_beside_steal), (5, 1));
        assert!((found.seconds - 0.04).abs() < 1e-12, "{found:?}");
        assert_eq!(StealObserver::new(Duration::ZERO, Vec::new(), 100.0).finish(), None);
    }
}
