//! A session against the clock: a haptic thread, a graphics thread, and the caller as recorder.
//!
//! The haptic thread never waits for anybody: graphics takes the latest tick from a triple buffer, the recorder takes
//! all ticks from a ring. When the ring is full, ticks go unrecorded, and are counted. Where a deadline is left out the
//! proxy steps by the longer time, which its integration allows.

use super::{
    graphics::Graphics,
    haptic::Haptics,
    session::{Driver, Frames, Latest, Plan, cannot_start},
    timing::{Durations, Percentiles, Timing},
    trace::{Tick, Trace},
};
use crate::{
    Error, JointVector,
    control::{Clock, Paced, Patience, beside, real_time},
    device::{Device, Halt},
    error,
    threads::spawn_scoped,
};
use std::{
    sync::atomic::{AtomicBool, Ordering},
    thread,
    time::Duration,
};

/// Where the rate of a session is set.
pub const RATE: &str = "[haptics] of the scene, and bake it again";

/// Ticks that the ring to the recorder holds: sixteen seconds at 1 kHz. A window at rest reads them once a minute.
const RING: usize = 1 << 14;

/// How long the graphics thread sleeps at most before it looks whether the session is over.
const LONGEST_SLEEP: Duration = Duration::from_millis(20);

/// How often the graphics thread looks for the first tick.
const FIRST_TICK_PERIOD: Duration = Duration::from_millis(1);

/// Takes the ticks of the haptic thread. Never waits.
pub struct Recorder {
    ticks: rtrb::Producer<Tick>,
    latest: triple_buffer::Input<Latest>,
    unrecorded: u64,
}

/// The other ends of a [`Recorder`].
pub struct Ends {
    /// All ticks.
    pub ticks: rtrb::Consumer<Tick>,
    /// The latest tick.
    pub latest: triple_buffer::Output<Latest>,
}

impl Recorder {
    /// For a proxy of so many `joints`.
    #[must_use]
    pub fn new(joints: usize) -> (Self, Ends) {
        let (recorder, ticks) = rtrb::RingBuffer::new(RING);
        let start = JointVector::zeros(joints);
        let before = Latest { time: -1.0, proxy: start, device: start, share: 0.0, dent: None };
        let (latest, reader) = triple_buffer::triple_buffer(&before);
        (Self { ticks: recorder, latest, unrecorded: 0 }, Ends { ticks, latest: reader })
    }

    /// Takes a tick. Allocates, locks and prints nothing.
    pub fn take(&mut self, (tick, latest): (Tick, Latest), paced: Paced) {
        self.latest.write(latest);
        if self.ticks.push(Tick { in_arrears: paced.in_arrears, ..tick }).is_err() {
            self.unrecorded += 1;
        }
    }
}

/// What a session against the clock is run with. By default nothing ends it early, and nobody looks at its ticks before
/// the end.
pub struct Options<'a> {
    /// Ends the session when it is raised.
    pub stop: &'a AtomicBool,
    /// Called with each tick soon after it, in the order of time; not in the real-time thread. Up to sixteen seconds of
    /// ticks wait for a call that takes long.
    pub on_tick: Option<&'a mut dyn FnMut(&Tick)>,
}

impl Default for Options<'_> {
    fn default() -> Self {
        static NEVER: AtomicBool = AtomicBool::new(false);
        Self { stop: &NEVER, on_tick: None }
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
) -> Result<(Trace, Timing), Error> {
    let Options { stop, mut on_tick } = options;
    let goes_on = || (!stop.load(Ordering::Relaxed)).then_some(Patience::Spins);
    let clock = Clock::of(device, haptics.period(), RATE, &goes_on).map_err(cannot_start)?;
    let mut driver = Driver::new(haptics, device)?;
    let (mut recorder, Ends { ticks, latest }) = Recorder::new(haptics.joints());
    let start = *driver.start();
    let frame_cost = Durations::new().ok_or_else(|| cannot_start("no memory for histograms"))?;
    let mut recorded = plan.new_ticks()?;
    let over = AtomicBool::new(false);
    let panicked = |thread: &str| error!("the {thread} thread ended unexpectedly");
    thread::scope(|scope| {
        let drawing = graphics.map(|graphics| {
            let frames = Frames::new(graphics, plan);
            let over = &over;
            spawn_scoped(scope, "graphics", move || draw(frames, latest, frame_cost, over))
        });
        let drawing = drawing.transpose().map_err(cannot_start)?;
        let work = || {
            let timing = driver.run(clock, |_, record, paced| {
                let has_stopped = record.0.applied.halt.is_some_and(Halt::is_final);
                recorder.take(record, paced);
                !has_stopped && paced.deadlines < plan.ticks as u64
            });
            Timing { unrecorded: recorder.unrecorded, ..timing }
        };
        let stolen_before = real_time::stolen();
        let felt = beside("haptic", ticks, work, &mut |tick| {
            if let Some(on_tick) = &mut on_tick {
                on_tick(&tick);
            }
            recorded.push(tick);
        });
        over.store(true, Ordering::Release);
        let mut timing = felt.map_err(cannot_start)?.map_err(|_| panicked("haptic"))?;
        let drawn = drawing.map(|thread| thread.join().map_err(|_| panicked("graphics"))).transpose()?;
        real_time::unlock_memory();
        timing.stolen = real_time::stolen().zip(stolen_before).map(|(after, before)| after - before);
        let mut frames = Vec::new();
        if let Some(drawn) = drawn {
            drawn.frames.count(&mut recorded);
            (frames, timing.frame_cost, timing.missed_frames) = (drawn.frames.kept(), drawn.cost, drawn.missed);
        }
        let joints = plan.joints.clone();
        Ok((Trace { joints, start, ticks: recorded, frames }, timing))
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
    let began = real_time::now();
    let mut missed = 0;
    while !over.load(Ordering::Acquire) {
        let due = began + Duration::from_secs_f64(frames.due());
        real_time::sleep_until(due.min(real_time::now() + LONGEST_SLEEP));
        let now = real_time::now();
        if now < due {
            continue;
        }
        let before = frames.due();
        frames.draw(latest.read(), true);
        cost.record(real_time::now() - now);
        if (now.saturating_sub(due)).as_secs_f64() > frames.due() - before {
            missed += 1;
        }
    }
    Drawn { frames, cost: cost.percentiles(), missed }
}
