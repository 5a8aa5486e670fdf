//! How punctual a real-time session was: histograms of lateness and cost, filled without allocation.

use hdrhistogram::Histogram;
use serde::Serialize;
use std::time::Duration;

/// Longest time that is resolved (ns): ten seconds; longer ones count as this.
const GREATEST: u64 = 10_000_000_000;

/// Decimal digits kept of each time.
const DIGITS: u8 = 3;

/// A histogram of durations from a nanosecond to ten seconds, of fixed size.
#[derive(Clone, Debug)]
pub struct Durations(Histogram<u64>);

/// Durations at given shares of all (us).
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

/// Number of durations within an interval.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Bin {
    /// Lower end (us); included.
    pub from: f64,
    /// Upper end (us); not included, but for the rounding of the histogram's own bins.
    pub to: f64,
    /// How many.
    pub count: u64,
}

/// Punctuality and costs of a real-time session.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Timing {
    /// Requests that the system refused, in words; empty if the thread had its priority and its memory locked.
    pub refused: Vec<String>,
    /// From a tick's deadline to its beginning.
    pub lateness: Percentiles,
    /// The same as a histogram, ten bins a decade from 0.1 us on, ascending; the first holds all that was shorter.
    pub lateness_bins: Vec<Bin>,
    /// From a tick's beginning to that of the next.
    pub interval: Percentiles,
    /// From a tick's beginning to its torque.
    pub tick_cost: Percentiles,
    /// Cost of a frame.
    pub frame_cost: Percentiles,
    /// Deadlines that passed before their tick could begin; those ticks were left out.
    pub missed_deadlines: u64,
    /// Frames that began more than a frame late.
    pub missed_frames: u64,
    /// Ticks that began more than half a period late.
    pub late: u64,
    /// Time that the hypervisor took from all processors meanwhile, which makes ticks late (s); absent where the system
    /// does not count it.
    pub stolen: Option<f64>,
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

    /// Returns the histogram, ten bins a decade from 0.1 us to the longest; the first holds all that was shorter. None
    /// where nothing was counted.
    #[must_use]
    pub fn bins(&self) -> Vec<Bin> {
        /// Ratio of a bin's ends.
        const RATIO: f64 = 1.258_925_411_794_167_2;
        /// Upper end of the first bin (ns): clocks resolve little less.
        const FIRST: u64 = 100;
        if self.0.is_empty() {
            return Vec::new();
        }
        let mut from = FIRST as f64 / RATIO;
        self.0
            .iter_log(FIRST, RATIO)
            .map(|step| {
                let to = (step.value_iterated_to() + 1) as f64;
                let bin = Bin { from: from * 1e-3, to: to * 1e-3, count: step.count_since_last_iteration() };
                from = to;
                bin
            })
            .collect()
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

    #[test]
    fn bins_are_seamless_and_hold_everything() {
        let mut durations = Durations::new().unwrap();
        for nanoseconds in [0, 40, 99, 101, 5_000, 5_001, 800_000] {
            durations.record(Duration::from_nanos(nanoseconds));
        }
        let bins = durations.bins();
        assert_eq!(bins.iter().map(|bin| bin.count).sum::<u64>(), 7);
        assert_eq!(bins[0].count, 3);
        assert!(bins.windows(2).all(|pair| pair[0].to == pair[1].from && pair[0].from < pair[0].to));
        let five = bins.iter().find(|bin| (bin.from..bin.to).contains(&5.0)).unwrap();
        assert_eq!(five.count, 2);
        assert!(bins.last().unwrap().to >= 800.0);
        assert!(Durations::new().unwrap().bins().is_empty());
    }
}
