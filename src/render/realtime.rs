//! A session against the clock: a haptic thread with absolute deadlines, a graphics thread, and the caller as recorder.
//!
//! The haptic thread never waits for anybody: graphics takes the latest tick from a triple buffer, the recorder takes
//! all ticks from a ring. When the ring is full, ticks go unrecorded, and are counted. A deadline that has passed
//! before its tick could begin is left out, and counted; the proxy then steps by the longer time, which its integration
//! allows.

use super::{
    clock,
    graphics::Graphics,
    haptic::Haptics,
    live::Live,
    session::{Driver, Frames, Latest, Plan, SessionError},
    timing::{Durations, Percentiles, Timing},
    trace::{Tick, Trace},
};
use crate::device::{Device, Halt, Scheduler};
use std::{
    sync::{
        Arc,
        atomic::{AtomicBool, Ordering},
    },
    thread,
    time::Duration,
};

/// Ticks that the ring to the recorder holds: sixteen seconds at 1 kHz. A window at rest reads them once a minute.
const RING: usize = 1 << 14;

/// How long the graphics thread sleeps at most before it looks whether the session is over.
const LONGEST_SLEEP: Duration = Duration::from_millis(20);

/// How often the recorder empties the ring.
const RECORDER_PERIOD: Duration = Duration::from_millis(5);

/// How often the graphics thread looks for the first tick.
const FIRST_TICK_PERIOD: Duration = Duration::from_millis(1);

/// Relative difference of two rates of which one is the inverse of a period that is the inverse of the other (1): each
/// division rounds once.
const SAME_RATE: f64 = 2.0 * f64::EPSILON;

/// The haptic thread's body: everything that a tick touches, allocated beforehand.
pub struct HapticLoop<'session> {
    driver: Driver<'session>,
    recorder: rtrb::Producer<Tick>,
    latest: triple_buffer::Input<Latest>,
    lateness: Durations,
    interval: Durations,
    cost: Durations,
    period: Duration,
    began: Duration,
    /// When the last tick began; none before the first.
    last: Option<Duration>,
    /// Number of the next deadline.
    next: u64,
    missed: u64,
    /// Ticks that began more than half a period late.
    late: u64,
    unrecorded: u64,
    clear: Arc<AtomicBool>,
    /// Whether the device has stopped for good.
    stopped: bool,
}

/// The other ends of a [`HapticLoop`].
pub struct Ends {
    /// All ticks.
    pub ticks: rtrb::Consumer<Tick>,
    /// The latest tick.
    pub latest: triple_buffer::Output<Latest>,
    /// Clears a fault.
    pub clear: ClearFault,
}

/// A way to clear the haptic loop's fault from any thread: its next tick starts again where the device is, unless the
/// device still fails.
#[derive(Clone, Debug)]
pub struct ClearFault(Arc<AtomicBool>);

impl ClearFault {
    /// Asks for it. Never waits.
    pub fn ask(&self) {
        self.0.store(true, Ordering::Release);
    }
}

impl<'session> HapticLoop<'session> {
    /// A loop with its first deadline now; with `live` over contact that is solved meanwhile.
    ///
    /// # Errors
    /// As [`Driver::new`], when the device's own thread calls at another rate than that of `haptics`, or when there is
    /// no memory.
    pub fn new(
        haptics: &'session Haptics,
        device: &'session mut dyn Device,
        live: Option<Live>,
    ) -> Result<(Self, Ends), SessionError> {
        if let Some(rate) = device.scheduler().map(|scheduler| scheduler.rate()) {
            let scene = 1.0 / haptics.period();
            if (rate - scene).abs() > SAME_RATE * scene {
                return Err(SessionError::Rate { device: rate, scene });
            }
        }
        let driver = Driver::new(haptics, device, live)?;
        let (recorder, ticks) = rtrb::RingBuffer::new(RING);
        let start = crate::JointVector::zeros(haptics.joints());
        let (latest, reader) =
            triple_buffer::triple_buffer(&Latest { time: -1.0, proxy: start, device: start, share: 0.0 });
        let clear = Arc::new(AtomicBool::new(false));
        let histogram = || Durations::new().ok_or_else(|| SessionError::Resources("no memory for histograms".into()));
        let this = Self {
            driver,
            recorder,
            latest,
            lateness: histogram()?,
            interval: histogram()?,
            cost: histogram()?,
            period: Duration::from_secs_f64(haptics.period()),
            began: clock::now(),
            last: None,
            next: 0,
            missed: 0,
            late: 0,
            unrecorded: 0,
            clear: Arc::clone(&clear),
            stopped: false,
        };
        Ok((this, Ends { ticks, latest: reader, clear: ClearFault(clear) }))
    }

    /// Asks the system for a real-time priority for the calling thread, and sets the first deadline to now. Returns
    /// what was not granted.
    pub fn begin(&mut self) -> Vec<String> {
        let refused = clock::ask_for_real_time();
        self.began = clock::now();
        refused
    }

    /// Waits for the next deadline and does its tick. Allocates, locks and prints nothing.
    pub fn tick(&mut self) {
        self.tick_after(true);
    }

    /// As [`HapticLoop::tick`], some tens of microseconds later, and without keeping the processor busy meanwhile: for
    /// a hand that is simulated.
    pub fn tick_relaxed(&mut self) {
        self.tick_after(false);
    }

    /// Lets `wait` take its time, and then does the ticks whose deadlines have come meanwhile, one behind the other and
    /// each at its deadline's time: for a simulated hand at rest, which nobody sees tick. `wait` should not take longer
    /// than [`Self::ARREARS`]; beyond that deadlines are left out as ever. Such ticks are marked
    /// ([`Tick::in_arrears`]).
    pub fn tick_in_arrears(&mut self, wait: impl FnOnce()) {
        wait();
        let now = clock::now();
        loop {
            let deadline = self.deadline(self.next);
            if deadline > now {
                return;
            }
            let in_arrears = now - deadline <= Self::ARREARS;
            self.tick_at(if in_arrears { deadline } else { now }, deadline, in_arrears);
        }
    }

    /// Longest time for which ticks are done afterwards.
    pub const ARREARS: Duration = Duration::from_secs(1);

    fn tick_after(&mut self, spins: bool) {
        let deadline = self.deadline(self.next);
        let now = clock::wait_until(deadline, spins);
        self.tick_at(now, deadline, false);
    }

    /// Does a tick now: for a thread that somebody else paces. The deadline is a period after the last tick, or now, if
    /// that was less long ago. Allocates, locks and prints nothing.
    pub fn tick_now(&mut self) {
        let now = clock::now();
        let deadline = self.last.map_or(now, |last| (last + self.period).min(now));
        self.began = deadline.saturating_sub(times(self.period, self.next));
        self.tick_at(now, deadline, false);
    }

    /// From deadline to beginning of the ticks so far.
    #[must_use]
    pub fn lateness(&self) -> Percentiles {
        self.lateness.percentiles()
    }

    /// Ticks against the clock, or as `scheduler` calls, while `goes_on`. Returns what the system refused or what
    /// stopped the scheduler.
    fn pace(&mut self, scheduler: Option<Arc<dyn Scheduler>>, goes_on: impl Fn(&Self) -> bool + Sync) -> Vec<String> {
        let Some(scheduler) = scheduler else {
            let refused = self.begin();
            while goes_on(self) {
                self.tick();
            }
            return refused;
        };
        self.called_by(scheduler.as_ref(), goes_on)
    }

    /// Ticks as `scheduler` calls, while `goes_on`, and commands zero torque in its last call. Returns what stopped it.
    pub fn called_by(&mut self, scheduler: &dyn Scheduler, goes_on: impl Fn(&Self) -> bool + Sync) -> Vec<String> {
        let run = scheduler.run(&mut || {
            self.tick_now();
            let goes_on = goes_on(self);
            if !goes_on {
                self.driver.let_go();
            }
            goes_on
        });
        run.err().map(|halt| format!("the device's own thread stopped: {halt}")).into_iter().collect()
    }

    fn tick_at(&mut self, now: Duration, deadline: Duration, in_arrears: bool) {
        let begun = clock::now();
        let by = now - deadline;
        self.lateness.record(by);
        self.late += u64::from(by > self.period / 2);
        // The next deadline that is at least half a period away.
        let behind = (now + self.period / 2).saturating_sub(self.deadline(self.next + 1));
        let skipped = behind.as_nanos().div_ceil(self.period.as_nanos().max(1)) as u64;
        self.missed += skipped;
        self.next += 1 + skipped;
        let elapsed = self.last.map_or(self.period, |last| now.saturating_sub(last));
        if self.last.is_some() {
            self.interval.record(elapsed);
        }
        let interval = self.deadline(self.next).saturating_sub(now);
        self.last = Some(now);
        if self.clear.swap(false, Ordering::Acquire) {
            self.driver.clear_fault();
        }
        let (tick, latest) = self.driver.tick(elapsed.as_secs_f64(), interval.as_secs_f64());
        self.cost.record(clock::now() - begun);
        self.latest.write(latest);
        self.stopped |= tick.applied.halt.is_some_and(Halt::is_final);
        if self.recorder.push(Tick { in_arrears, ..tick }).is_err() {
            self.unrecorded += 1;
        }
    }

    /// Deadline `number`, in time since the clock's origin.
    fn deadline(&self, number: u64) -> Duration {
        self.began + times(self.period, number)
    }

    /// Whether `ticks` deadlines have come, or the device has stopped for good.
    fn is_over(&self, ticks: usize) -> bool {
        self.next as usize >= ticks || self.stopped
    }
}

/// `count` periods. Unlike `Duration * u32` it does not run out within a session of some weeks.
fn times(period: Duration, count: u64) -> Duration {
    let nanoseconds = period.as_nanos() * u128::from(count);
    Duration::new((nanoseconds / 1_000_000_000) as u64, (nanoseconds % 1_000_000_000) as u32)
}

/// What a session against the clock is run with. By default nothing ends it early, its dataset does not change, and
/// nobody looks at its ticks before the end.
pub struct Options<'a> {
    /// Ends the session when it is raised.
    pub stop: &'a AtomicBool,
    /// Contact that is solved meanwhile.
    pub live: Option<Live>,
    /// Called with each tick soon after it, in the order of time; not in the real-time thread. Up to sixteen seconds of
    /// ticks wait for a call that takes long.
    pub on_tick: Option<&'a mut dyn FnMut(&Tick)>,
}

impl Default for Options<'_> {
    fn default() -> Self {
        static NEVER: AtomicBool = AtomicBool::new(false);
        Self { stop: &NEVER, live: None, on_tick: None }
    }
}

/// Runs a session against the clock, as long as `plan` says, until `options.stop` is raised or the device stops for
/// good. Graphics, where there is any, runs in a thread of its own.
///
/// # Errors
/// When the device reports no position, or the system gives no threads or memory.
pub fn run(
    haptics: &Haptics,
    device: &mut dyn Device,
    graphics: Option<&mut Graphics<'_>>,
    plan: &Plan,
    options: Options<'_>,
) -> Result<(Trace, Timing), SessionError> {
    let Options { stop, live, mut on_tick } = options;
    let solved_meanwhile = live.is_some();
    let scheduler = device.scheduler();
    let (mut body, Ends { mut ticks, latest, .. }) = HapticLoop::new(haptics, device, live)?;
    let start = *body.driver.start();
    let frame_cost = Durations::new().ok_or_else(|| SessionError::Resources("no memory for histograms".into()))?;
    let mut recorded = plan.new_ticks()?;
    let over = AtomicBool::new(false);
    let resources = |error: std::io::Error| SessionError::Resources(error.to_string());
    thread::scope(|scope| {
        let drawing = graphics.map(|graphics| {
            let frames = Frames::new(graphics, plan);
            let over = &over;
            thread::Builder::new()
                .name("graphics".into())
                .spawn_scoped(scope, move || draw(frames, latest, frame_cost, over))
        });
        let drawing = drawing.transpose().map_err(resources)?;
        let feeling = thread::Builder::new().name("haptic".into()).spawn_scoped(scope, move || {
            let goes_on = |body: &HapticLoop<'_>| !body.is_over(plan.ticks) && !stop.load(Ordering::Relaxed);
            let refused = body.pace(scheduler, goes_on);
            (refused, body.lateness, body.interval, body.cost, [body.missed, body.late, body.unrecorded])
        });
        let feeling = match feeling {
            Ok(thread) => thread,
            Err(error) => {
                over.store(true, Ordering::Release);
                return Err(resources(error));
            }
        };
        let stolen_before = clock::stolen();
        loop {
            let last = feeling.is_finished();
            while let Ok(tick) = ticks.pop() {
                if let Some(on_tick) = &mut on_tick {
                    on_tick(&tick);
                }
                recorded.push(tick);
            }
            if last {
                break;
            }
            thread::sleep(RECORDER_PERIOD);
        }
        over.store(true, Ordering::Release);
        let felt = feeling.join().map_err(|_| SessionError::Thread("haptic"))?;
        let drawn = drawing.map(|thread| thread.join().map_err(|_| SessionError::Thread("graphics"))).transpose()?;
        clock::unlock_memory();
        let (refused, lateness, interval, cost, [missed_deadlines, late, unrecorded]) = felt;
        let (mut frames, mut frame_cost, mut missed_frames) = Default::default();
        if let Some(drawn) = drawn {
            drawn.frames.count(&mut recorded);
            (frames, frame_cost, missed_frames) = (drawn.frames.kept(), drawn.cost, drawn.missed);
        }
        let timing = Timing {
            refused,
            lateness: lateness.percentiles(),
            lateness_bins: lateness.bins(),
            interval: interval.percentiles(),
            tick_cost: cost.percentiles(),
            frame_cost,
            missed_deadlines,
            missed_frames,
            late,
            stolen: clock::stolen().zip(stolen_before).map(|(after, before)| after - before),
            unrecorded,
        };
        let joints = plan.joints.clone();
        Ok((Trace { joints, start, ticks: recorded, frames, solved_meanwhile }, timing))
    })
}

/// Result of the graphics thread.
struct Drawn<'session, 'object> {
    frames: Frames<'session, 'object>,
    cost: Percentiles,
    missed: u64,
}

/// The graphics thread: a frame whenever one is due, from the first tick on, until the session is over. When it falls
/// behind by more than a frame it draws the frames that it owes, without waiting: the object's time must not slow down.
fn draw<'session, 'object>(
    mut frames: Frames<'session, 'object>,
    mut latest: triple_buffer::Output<Latest>,
    mut cost: Durations,
    over: &AtomicBool,
) -> Drawn<'session, 'object> {
    while latest.read().time < 0.0 && !over.load(Ordering::Acquire) {
        thread::sleep(FIRST_TICK_PERIOD);
    }
    let began = clock::now();
    let mut missed = 0;
    while !over.load(Ordering::Acquire) {
        let due = began + Duration::from_secs_f64(frames.due());
        clock::sleep_until(due.min(clock::now() + LONGEST_SLEEP));
        let now = clock::now();
        if now < due {
            continue;
        }
        let before = frames.due();
        frames.draw(latest.read());
        cost.record(clock::now() - now);
        if (now.saturating_sub(due)).as_secs_f64() > frames.due() - before {
            missed += 1;
        }
    }
    Drawn { frames, cost: cost.percentiles(), missed }
}
