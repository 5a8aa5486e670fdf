//! How punctual a real-time session was: histograms of lateness and cost, filled without allocation.

use hdrhistogram::Histogram;
use serde::Serialize;
use std::time::Duration;

/// Longest time that is told apart [ns]: ten seconds; longer ones count as this.
const GREATEST: u64 = 10_000_000_000;

/// Decimal digits kept of each time.
const DIGITS: u8 = 3;

/// A histogram of durations from a nanosecond to ten seconds, of fixed size.
#[derive(Clone, Debug)]
pub struct Durations(Histogram<u64>);

/// Durations at given shares of all [us].
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Percentiles {
    /// Number of durations.
    pub count: u64,
    /// Half are shorter.
    pub p50: f64,
    /// 99 % are shorter.
    pub p99: f64,
    /// 99.9 % are shorter.
    pub p999: f64,
    /// 99.99 % are shorter.
    pub p9999: f64,
    /// The longest.
    pub max: f64,
}

/// What a real-time session says about time.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Timing {
    /// What the system did not grant, in words; empty if the thread had its priority and its memory locked.
    pub refused: Vec<String>,
    /// From a tick's deadline to its beginning.
    pub lateness: Percentiles,
    /// From a tick's beginning to its torque.
    pub tick_cost: Percentiles,
    /// Cost of a frame.
    pub frame_cost: Percentiles,
    /// Deadlines that passed before their tick could begin; those ticks were left out.
    pub missed_deadlines: u64,
    /// Frames that began more than a frame late.
    pub missed_frames: u64,
    /// Ticks that ran but could not be recorded, because the recorder fell behind.
    pub unrecorded: u64,
}

impl Durations {
    /// An empty histogram; `None` when there is no memory for it.
    #[must_use]
    pub fn new() -> Option<Self> {
        Histogram::new_with_bounds(1, GREATEST, DIGITS).ok().map(Self)
    }

    /// Counts `duration`. Allocates nothing.
    pub fn record(&mut self, duration: Duration) {
        self.0.saturating_record(u64::try_from(duration.as_nanos()).unwrap_or(GREATEST));
    }

    /// Shares of what was counted.
    #[must_use]
    pub fn percentiles(&self) -> Percentiles {
        let microseconds = |share: f64| self.0.value_at_quantile(share) as f64 * 1e-3;
        Percentiles {
            count: self.0.len(),
            p50: microseconds(0.5),
            p99: microseconds(0.99),
            p999: microseconds(0.999),
            p9999: microseconds(0.9999),
            max: self.0.max() as f64 * 1e-3,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn percentiles_are_in_microseconds_and_long_times_are_kept_as_the_longest() {
        let mut durations = Durations::new().unwrap();
        for microseconds in 1..=999 {
            durations.record(Duration::from_micros(microseconds));
        }
        durations.record(Duration::from_secs(3600));
        let percentiles = durations.percentiles();
        assert_eq!(percentiles.count, 1000);
        assert!((percentiles.p50 - 500.0).abs() < 1.0, "{percentiles:?}");
        assert!((percentiles.max - 1e7).abs() < 1e4, "{percentiles:?}");
    }
}
