//! The last seconds of the haptic loop, for plots and export.

use super::{feel::Feel, loaded::Loaded};
use crate::render::{
    setup::labels,
    timing::{Durations, Timing},
    trace::{Tick, Trace},
};
use std::{collections::VecDeque, thread, time::Duration};

/// Ticks that are kept: twenty seconds at 1 kHz.
const KEPT: usize = 20_000;

/// How long the window holds still, and what it gives its last frame before; the ring of ticks holds sixteen seconds.
const STILL: Duration = Duration::from_secs(2);
const SETTLING: Duration = Duration::from_millis(200);

/// The latest ticks, and how punctual they were.
#[derive(Clone)]
pub struct History {
    ticks: VecDeque<Tick>,
    /// Number of the first tick kept, since the loop began.
    first: usize,
    /// Nominal time between ticks (s).
    period: f64,
    /// When the loop began, since the first one did (s).
    begun: f64,
    /// Whether no tick of this loop was seen yet.
    new: bool,
    /// Whether the arm was free since the first loop began: only then is it known from which side it met the object.
    pub was_free: bool,
    /// From a tick's reading to its torque.
    pub cost: Durations,
    /// Difference of the time between two ticks from the nominal one.
    pub jitter: Durations,
    /// The same while the window held still; nothing where it has not.
    pub still: Durations,
    /// Requests that the system refused, in words.
    pub refused: Vec<String>,
}

impl History {
    /// Nothing yet, of a loop with `period` (s) between ticks; none without memory.
    #[must_use]
    pub fn new(period: f64) -> Option<Self> {
        let [cost, jitter, still] = [Durations::new()?, Durations::new()?, Durations::new()?];
        let ticks = VecDeque::with_capacity(KEPT);
        let refused = Vec::new();
        Some(Self { ticks, first: 0, period, begun: 0.0, new: true, was_free: false, cost, jitter, still, refused })
    }

    /// Another loop begins, whose time goes on where that of the last one ended.
    pub fn begin_anew(&mut self) {
        self.begun = self.last().map_or(0.0, |tick| tick.time + self.period);
        self.new = true;
        self.reset_timing();
    }

    /// Takes what `feel` has to say.
    pub fn collect(&mut self, feel: &mut Feel) {
        self.take(feel, |history| &mut history.jitter);
    }

    /// Lets the window hold still for some seconds, the loop going on, so that what is left of its jitter is the
    /// machine's own.
    pub fn hold_still(&mut self, feel: &mut Feel) {
        // What has been drawn is let through.
        feel.keep_pace(true);
        thread::sleep(SETTLING);
        self.collect(feel);
        thread::sleep(STILL);
        feel.keep_pace(false);
        if let Some(still) = Durations::new() {
            self.still = still;
        }
        self.take(feel, |history| &mut history.still);
    }

    fn take(&mut self, feel: &mut Feel, jitter: fn(&mut Self) -> &mut Durations) {
        while let Some(tick) = feel.next_tick() {
            let tick = Tick { time: self.begun + tick.time, ..tick };
            if let (false, false, Some(last)) = (std::mem::take(&mut self.new), tick.in_arrears, self.ticks.back()) {
                let late = (tick.time - last.time - self.period).abs();
                jitter(self).record(Duration::from_secs_f64(late));
            }
            self.was_free |= !tick.sample.contact;
            if self.ticks.len() == KEPT {
                self.ticks.pop_front();
                self.first += 1;
            }
            self.ticks.push_back(tick);
        }
        while let Some(cost) = feel.next_cost() {
            self.cost.record(cost);
        }
        if let Some(refused) = feel.refused() {
            self.refused = refused;
        }
    }

    /// The latest tick.
    #[must_use]
    pub fn last(&self) -> Option<&Tick> {
        self.ticks.back()
    }

    /// About `count` ticks of the last `seconds`, evenly, always the same ones while time goes on.
    pub fn recent(&self, seconds: f64, count: usize) -> impl Iterator<Item = &Tick> {
        let from = self.last().map_or(0.0, |tick| tick.time - seconds);
        let begin = self.ticks.partition_point(|tick| tick.time < from);
        let stride = ((self.ticks.len() - begin) / count.max(1)).max(1).next_power_of_two();
        let offset = (stride - (self.first + begin) % stride) % stride;
        self.ticks.iter().skip(begin + offset).step_by(stride)
    }

    /// Everything that is kept, as a recording of `loaded`.
    #[must_use]
    pub fn trace(&self, loaded: &Loaded) -> Trace {
        let joints = labels(&loaded.dataset.grid);
        Trace { joints, ticks: self.ticks.iter().copied().collect(), ..Trace::default() }
    }

    /// Forgets how punctual the loop was so far.
    pub fn reset_timing(&mut self) {
        if let (Some(cost), Some(jitter), Some(still)) = (Durations::new(), Durations::new(), Durations::new()) {
            (self.cost, self.jitter, self.still) = (cost, jitter, still);
        }
    }

    /// Punctuality for the figure of `report::jitter`.
    #[must_use]
    pub fn timing(&self) -> Timing {
        Timing {
            refused: self.refused.clone(),
            lateness: self.jitter.percentiles(),
            lateness_bins: self.jitter.bins(),
            tick_cost: self.cost.percentiles(),
            ..Timing::default()
        }
    }
}
