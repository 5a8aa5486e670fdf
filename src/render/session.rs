//! A rendering session: device, haptic loop and graphics loop, recorded. The haptic loop is a [`Controller`], so that any
//! clock ticks it: here as fast as it goes and deterministic; in `realtime.rs` against time, in `recording.rs` as it
//! was.
//!
//! Two loops at two rates (section 3.2): a tick every T, and a frame of the object every T_g. Frame j is drawn at the
//! first tick at or after `j T_g`, from the proxy's configuration then.

use super::{
    graphics::Graphics,
    haptic::{Haptics, Inputs, State},
    source::ContactSession,
    trace::{Frame, Tick, Trace},
};
use crate::{
    Error, JointVector,
    control::{Clock, ControlLoop, Controller},
    dataset::JointLabel,
    device::{Applied, Device, Reading},
    error, memory,
};
use std::{
    fmt::Display,
    sync::{
        Arc,
        atomic::{AtomicBool, Ordering},
    },
};

/// How long, and what to keep of the object's shape.
#[derive(Clone, Debug, PartialEq)]
pub struct Plan {
    /// Names and units of the joints.
    pub joints: Vec<JointLabel>,
    /// Number of ticks.
    pub ticks: usize,
    /// Instants (s), ascending, of which the first frame at or after is kept.
    pub snapshots: Vec<f64>,
}

/// The error of a session for which something is missing.
pub(crate) fn cannot_start(why: impl Display) -> Error {
    error!("the session cannot start: {why}")
}

/// The part of a tick that graphics needs.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Latest {
    /// Time of the tick (s); negative before the first.
    pub time: f64,
    /// Proxy x (rad or m).
    pub proxy: JointVector,
    /// Device y (rad or m).
    pub device: JointVector,
    /// Factor on the dataset's contact forces; zero out of contact.
    pub share: f64,
    /// See [`Tick::dent`].
    pub dent: Option<f64>,
}

/// The haptic loop as what answers a device. A tick gives its record and what graphics needs of it.
pub struct HapticController<'session> {
    haptics: &'session Haptics,
    state: State,
    contact: ContactSession<'session>,
    start: JointVector,
    /// The tick that is under way, or was the last; none before the first.
    tick: Option<(Tick, Latest)>,
    clear: ClearFault,
}

/// The haptic loop with its device.
pub type Driver<'session> = ControlLoop<'session, HapticController<'session>>;

/// A way to clear the haptic loop's fault from any thread: its next tick starts again where the device is, unless the
/// device still fails.
#[derive(Clone, Debug, Default)]
pub struct ClearFault(Arc<AtomicBool>);

impl ClearFault {
    /// Asks for it. Nothing happens where there is no fault. Never waits.
    pub fn ask(&self) {
        self.0.store(true, Ordering::Release);
    }
}

impl Plan {
    /// A session of `seconds` with a tick every `period` (s), and `snapshots` instants spread evenly over it.
    #[must_use]
    pub fn new(joints: Vec<JointLabel>, period: f64, seconds: f64, snapshots: usize) -> Self {
        Self {
            joints,
            ticks: (seconds.max(0.0) / period).round() as usize,
            snapshots: (0..snapshots).map(|k| k as f64 * seconds / snapshots as f64).collect(),
        }
    }

    /// Room for all ticks.
    pub(super) fn new_ticks(&self) -> Result<Vec<Tick>, Error> {
        memory::check(self.ticks.saturating_mul(size_of::<Tick>()))
            .map_err(|shortage| cannot_start(format_args!("{} ticks: {shortage}", self.ticks)))?;
        let mut ticks = Vec::new();
        ticks.try_reserve_exact(self.ticks).map_err(cannot_start)?;
        Ok(ticks)
    }
}

impl<'session> Driver<'session> {
    /// Reads the device and puts the proxy there, at rest.
    ///
    /// # Errors
    /// When the device reports no position.
    pub fn new(haptics: &'session Haptics, device: &'session mut dyn Device) -> Result<Self, Error> {
        let start = device.read(0.0).position;
        let state = haptics.start(&start).map_err(cannot_start)?;
        let (contact, clear) = (haptics.source().begin(), ClearFault::default());
        Ok(Self::of(HapticController { haptics, state, contact, start, tick: None, clear }, device))
    }

    /// Asks for a fault to be cleared at the next tick: the loop then starts again where the device is. Nothing happens
    /// where there is no fault, or the device still reports no position.
    pub fn clear_fault(&self) {
        self.controller.clear.ask();
    }

    /// Returns where the device was when the session began (rad or m).
    #[must_use]
    pub fn start(&self) -> &JointVector {
        &self.controller.start
    }
}

impl HapticController<'_> {
    /// What clears its fault.
    #[must_use]
    pub fn clear(&self) -> ClearFault {
        self.clear.clone()
    }
}

impl Controller for HapticController<'_> {
    type Record = (Tick, Latest);

    fn joints(&self) -> usize {
        self.haptics.joints()
    }

    fn answer(&mut self, reading: &Reading, elapsed: f64, interval: f64) -> JointVector {
        let time = self.tick.map_or(0.0, |(last, _)| last.time + elapsed);
        // A device that still fails keeps its fault.
        let restart = self.clear.0.swap(false, Ordering::Acquire)
            && self.state.fault().is_some()
            && self.haptics.restart(&mut self.state, &reading.position).is_ok();
        let inputs = Inputs { position: reading.position, age: reading.age, elapsed, interval };
        let output = self.haptics.tick_with(&mut self.state, &inputs, &mut self.contact);
        let tick = Tick {
            time,
            inputs,
            in_arrears: false,
            restart,
            hand: reading.hand,
            device: output.device,
            proxy: output.proxy,
            device_torque: output.torque,
            applied: Applied::default(),
            sample: output.sample,
            dent: output.dent,
            flags: output.flags,
            fault: output.fault,
            accounts: output.accounts,
            frames: 0,
        };
        let share = if output.sample.contact { output.sample.share } else { 0.0 };
        self.tick = Some((tick, Latest { time, proxy: output.proxy, device: output.device, share, dent: output.dent }));
        output.torque
    }

    fn held(&mut self, applied: &Applied) -> Self::Record {
        self.state.hold(&applied.torque);
        let (tick, latest) = self.tick.unwrap_or_default();
        (Tick { applied: *applied, ..tick }, latest)
    }
}

/// The graphics loop: frames as they become due, some of them kept.
pub(super) struct Frames<'session, 'object> {
    graphics: &'session mut Graphics<'object>,
    snapshots: std::iter::Peekable<std::vec::IntoIter<f64>>,
    kept: Vec<Frame>,
    /// Time of the tick that each frame showed (s); ascending.
    shown: Vec<f64>,
}

impl<'session, 'object> Frames<'session, 'object> {
    pub(super) fn new(graphics: &'session mut Graphics<'object>, plan: &Plan) -> Self {
        let snapshots = plan.snapshots.clone().into_iter().peekable();
        Self { graphics, snapshots, kept: Vec::with_capacity(plan.snapshots.len()), shown: Vec::new() }
    }

    /// When the next frame is due (s).
    pub(super) fn due(&self) -> f64 {
        self.shown.len() as f64 * self.graphics.motion().period()
    }

    /// Draws the next frame, as far as anything depends on it, or, where they are `timed`, as one that is seen.
    pub(super) fn draw(&mut self, latest: &Latest, timed: bool) {
        let time = self.due();
        let mut wanted = false;
        while self.snapshots.next_if(|&instant| instant <= time).is_some() {
            wanted = true;
        }
        self.graphics.frame(latest, wanted || timed);
        self.shown.push(latest.time);
        if wanted {
            let nodes = self.graphics.motion().nodes().collect();
            self.kept.push(Frame { time, proxy: latest.proxy, nodes });
        }
    }

    /// Counts in each of `ticks` the frames that showed it.
    pub(super) fn count(&self, ticks: &mut [Tick]) {
        for shown in &self.shown {
            let tick = ticks.partition_point(|tick| tick.time < *shown);
            if let Some(tick) = ticks.get_mut(tick) {
                tick.frames += 1;
            }
        }
    }

    /// The frames that were kept.
    pub(super) fn kept(self) -> Vec<Frame> {
        self.kept
    }
}

/// Runs a session as fast as it goes. The same inputs give the same numbers, bit for bit.
///
/// # Errors
/// When the device reports no first position.
pub fn run(
    haptics: &Haptics,
    device: &mut dyn Device,
    graphics: Option<&mut Graphics<'_>>,
    plan: &Plan,
) -> Result<Trace, Error> {
    let (driver, period) = (Driver::new(haptics, device)?, haptics.period());
    let start = *driver.start();
    let as_due =
        |_: &mut HapticController<'_>, tick: &mut Tick, frames: Option<&mut Frames<'_, '_>>, latest: &Latest| {
            if let Some(frames) = frames {
                while frames.due() <= tick.time {
                    frames.draw(latest, false);
                    tick.frames += 1;
                }
            }
        };
    let (ticks, frames) = collect(driver, Clock::Steps(period), graphics, plan, as_due)?;
    Ok(Trace { joints: plan.joints.clone(), start, ticks, frames })
}

/// Runs `driver` by `clock` for the ticks of `plan`, and calls `each` after each of them. Returns all ticks, and the
/// frames that are kept.
pub(super) fn collect<'session>(
    mut driver: Driver<'session>,
    clock: Clock<'_>,
    graphics: Option<&mut Graphics<'_>>,
    plan: &Plan,
    mut each: impl FnMut(&mut HapticController<'session>, &mut Tick, Option<&mut Frames<'_, '_>>, &Latest) + Send,
) -> Result<(Vec<Tick>, Vec<Frame>), Error> {
    let mut frames = graphics.map(|graphics| Frames::new(graphics, plan));
    let mut ticks = plan.new_ticks()?;
    if plan.ticks > 0 {
        driver.run(clock, |controller, (mut tick, latest), _| {
            each(controller, &mut tick, frames.as_mut(), &latest);
            ticks.push(tick);
            ticks.len() < plan.ticks
        });
    }
    Ok((ticks, frames.map(Frames::kept).unwrap_or_default()))
}
