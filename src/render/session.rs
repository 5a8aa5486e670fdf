//! A rendering session: device, haptic loop and graphics loop, recorded. Offline, as fast as it goes and deterministic;
//! `realtime.rs` runs the same ticks and frames against the clock.
//!
//! Two loops at two rates (section 3.2): a tick every T, and a frame of the object every T_g. Frame j is drawn at the
//! first tick at or after `j T_g`, from the proxy's configuration then.

use super::{
    effects::ContactEffects,
    flags::Fault,
    graphics::{Graphics, GraphicsError},
    haptic::{ContactSource, Haptics, Inputs, State},
    live::Live,
    trace::{Frame, Tick, Trace},
};
use crate::{JointVector, dataset::JointLabel, device::Device, field::Sample, memory};

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

/// A session cannot run.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum SessionError {
    /// The device's first position is none.
    #[error("the session cannot start: {0}")]
    Start(#[from] Fault),
    /// An effect needs contact forces that are solved meanwhile, and nobody solves them.
    #[error("the session cannot start: friction and contact damping need contact forces, and nobody solves them")]
    NoForces,
    /// The device's own thread calls at another rate than the scene's.
    #[error(
        "the session cannot start: the device's own thread calls {device} times a second, and the scene's loop runs at \
         {scene} Hz: set rate = {device} in [haptics] of the scene, and bake it again"
    )]
    Rate {
        /// The device's (Hz).
        device: f64,
        /// The scene's (Hz).
        scene: f64,
    },
    /// The object cannot be drawn.
    #[error(transparent)]
    Graphics(#[from] GraphicsError),
    /// The system gives no thread or memory.
    #[error("the session cannot start: {0}")]
    Resources(String),
    /// A thread ended by a panic.
    #[error("the {0} thread ended unexpectedly")]
    Thread(&'static str),
}

/// The part of a tick that graphics needs.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Latest {
    /// Time of the tick (s); negative before the first.
    pub time: f64,
    /// Proxy x (rad or m).
    pub proxy: JointVector,
    /// Device y (rad or m).
    pub device: JointVector,
    /// Factor on the dataset's contact forces; zero out of contact.
    pub share: f64,
}

/// The haptic loop with its device: one call a tick. However it ends, it leaves the device without torque.
pub struct Driver<'session> {
    haptics: &'session Haptics,
    device: &'session mut dyn Device,
    state: State,
    time: f64,
    ticks: usize,
    restart: bool,
    start: JointVector,
    source: ContactSource,
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
    pub(super) fn new_ticks(&self) -> Result<Vec<Tick>, SessionError> {
        memory::check(self.ticks.saturating_mul(size_of::<Tick>()))
            .map_err(|shortage| SessionError::Resources(format!("{} ticks: {shortage}", self.ticks)))?;
        let mut ticks = Vec::new();
        ticks.try_reserve_exact(self.ticks).map_err(|error| SessionError::Resources(error.to_string()))?;
        Ok(ticks)
    }
}

impl<'session> Driver<'session> {
    /// Reads the device and puts the proxy there, at rest; with `live` over contact that is solved meanwhile.
    ///
    /// # Errors
    /// When the device reports no position, or contact forces are needed that nobody gives.
    pub fn new(
        haptics: &'session Haptics,
        device: &'session mut dyn Device,
        live: Option<Live>,
    ) -> Result<Self, SessionError> {
        let are_solved = live.as_ref().is_some_and(Live::solves_forces);
        if haptics.effects().is_some_and(ContactEffects::need_solved_forces) && !are_solved {
            return Err(SessionError::NoForces);
        }
        let position = device.read(0.0).position;
        let state = haptics.start(&position)?;
        let source = live.map_or(ContactSource::Dataset, |live| ContactSource::Live(Box::new(live)));
        Ok(Self { haptics, device, state, time: 0.0, ticks: 0, restart: false, start: position, source })
    }

    /// Asks for a fault to be cleared at the next tick: the loop then starts again where the device is. Nothing happens
    /// where there is no fault, or the device still reports no position.
    pub fn clear_fault(&mut self) {
        self.restart = true;
    }

    /// Has the next ticks feel the contact of `sample`.
    pub(super) fn feel(&mut self, sample: Sample) {
        self.source = ContactSource::Recorded(sample);
    }

    /// Returns where the device was when the session began (rad or m).
    #[must_use]
    pub fn start(&self) -> &JointVector {
        &self.start
    }

    /// Commands zero torque: the last that a device hears of a session.
    pub fn let_go(&mut self) {
        self.device.apply(&JointVector::zeros(self.haptics.joints()));
    }

    /// One tick, `elapsed` after the one before and `interval` before the next (s): read, compute, apply. Answers with
    /// the record and what graphics needs of it. Never allocates.
    pub fn tick(&mut self, elapsed: f64, interval: f64) -> (Tick, Latest) {
        // The first tick follows the reading in `new` at once.
        let since = if self.ticks == 0 { 0.0 } else { elapsed };
        self.ticks += 1;
        self.time += since;
        let reading = self.device.read(since);
        // A device that still fails keeps its fault.
        let restart = std::mem::take(&mut self.restart)
            && self.state.fault().is_some()
            && self.haptics.restart(&mut self.state, &reading.position).is_ok();
        let inputs = Inputs { position: reading.position, age: reading.age, elapsed, interval };
        let output = self.haptics.tick_with(&mut self.state, &inputs, &mut self.source);
        let applied = self.device.apply(&output.torque);
        self.state.hold(&applied.torque);
        let share = if output.sample.contact { output.sample.share } else { 0.0 };
        let latest = Latest { time: self.time, proxy: output.proxy, device: output.device, share };
        let tick = Tick {
            time: self.time,
            inputs,
            in_arrears: false,
            restart,
            hand: reading.hand,
            device: output.device,
            proxy: output.proxy,
            device_torque: output.torque,
            applied,
            sample: output.sample,
            flags: output.flags,
            fault: output.fault,
            accounts: output.accounts,
            frames: 0,
        };
        (tick, latest)
    }
}

impl Drop for Driver<'_> {
    fn drop(&mut self) {
        self.device.apply(&JointVector::zeros(self.haptics.joints()));
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

    /// Draws the next frame.
    pub(super) fn draw(&mut self, latest: &Latest) {
        let time = self.due();
        self.graphics.frame(&latest.proxy, latest.share);
        self.shown.push(latest.time);
        let mut wanted = false;
        while self.snapshots.next_if(|&instant| instant <= time).is_some() {
            wanted = true;
        }
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
) -> Result<Trace, SessionError> {
    let mut driver = Driver::new(haptics, device, None)?;
    let mut frames = graphics.map(|graphics| Frames::new(graphics, plan));
    let mut ticks = plan.new_ticks()?;
    for _ in 0..plan.ticks {
        let (tick, latest) = driver.tick(haptics.period(), haptics.period());
        if let Some(frames) = &mut frames {
            while frames.due() <= tick.time {
                frames.draw(&latest);
            }
        }
        ticks.push(tick);
    }
    if let Some(frames) = &frames {
        frames.count(&mut ticks);
    }
    let frames = frames.map(Frames::kept).unwrap_or_default();
    Ok(Trace { joints: plan.joints.clone(), start: *driver.start(), ticks, frames, solved_meanwhile: false })
}
