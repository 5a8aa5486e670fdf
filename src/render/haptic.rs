//! One tick of the haptic loop: device position in, device torque out (section 3.1). Pure: no clock, no thread, no
//! allocation, no panic.
//!
//! At t_k: check the device's position; coupling torque for the device from y_k and x_k; contact torque tau_bar(x_k)
//! from a dataset, or solved; one NPMI step of the proxy to x_{k+1}; energy accounts. The device's torque is limited in
//! size, and in rate against the torque before it. On a fault (see [`Watchdog`]) its goal is zero, which it reaches at
//! the greatest rate, without a jump; the fault stays, the proxy tied to the last good position, until
//! [`Haptics::restart`]. So it is when the passivity observer of the device's port finds that the hand has been given
//! energy from nowhere ([`Fault::Energy`]).
//!
//! What the scene may name beside (channels, controller, friction, relaxation) is decided once, in [`Haptics::new`];
//! what it does not name has no state and does no work.

pub use super::inputs::Inputs;
use super::{
    accounts::{Accounts, Extra},
    channels::{ChannelState, Channels},
    control::PassivityControl,
    coupling::Coupling,
    flags::{Fault, Flags},
    friction::{Friction, FrictionState, Pending},
    npmi::{Motion, Npmi},
    relaxation::{Memory, Relaxation, Remembered},
    source::{ContactSession, TorqueSource},
    torque_history::TorqueHistory,
    watchdog::{self, GREATEST_POSITION_AGE, TickRate, Watchdog},
};
use crate::{
    Error, JointVector, error,
    field::{Sample, range::HaptizedRange},
    names::counted,
    scene::HapticsSpec,
};

/// Energy that the loop may give the device from nowhere before its torque is brought to zero (J): what 0.1 kg at the
/// hand has at 1.4 m/s, which a hand stops within a centimetre with 10 N.
pub const GREATEST_GIVEN_ENERGY: f64 = 0.1;

/// Everything of the haptic loop that does not change from tick to tick.
pub struct Haptics {
    source: TorqueSource,
    range: HaptizedRange,
    npmi: Npmi,
    coupling: Coupling,
    /// Absent unless the scene names them.
    channels: Option<Channels>,
    control: Option<PassivityControl>,
    friction: Option<Friction>,
    relaxation: Option<Relaxation>,
    /// Whether one of them needs to know how contacts slip.
    slips: bool,
    watchdog: Watchdog,
    torque_limit: JointVector,
    torque_rate_limit: JointVector,
    period: f64,
}

/// State that one tick hands to the next.
#[derive(Clone, Debug, PartialEq)]
pub struct State {
    /// Proxy.
    motion: Motion,
    /// v_hat of the last step (rad/s or m/s).
    proxy_velocity: JointVector,
    /// Last good device position y (rad or m).
    device: JointVector,
    /// Torques on the device.
    held: TorqueHistory,
    /// How the ticks have come lately.
    pace: TickRate,
    /// The first fault since the loop began.
    fault: Option<Fault>,
    accounts: Accounts,
    channels: Option<ChannelState>,
    friction: Option<FrictionState>,
    memory: Option<Memory>,
}

/// Output of a tick. All but `torque` is for recording and drawing.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Output {
    /// For the device until the next tick (N m or N).
    pub torque: JointVector,
    /// Device position that was used (rad or m).
    pub device: JointVector,
    /// Proxy position x_k (rad or m).
    pub proxy: JointVector,
    /// The contact field at x_k.
    pub sample: Sample,
    /// See [`Tick::dent`](super::trace::Tick::dent).
    pub dent: Option<f64>,
    /// The field's remarks and the loop's.
    pub flags: Flags,
    /// Why the torque is being brought to zero or has been, if so.
    pub fault: Option<Fault>,
    /// At t_k.
    pub accounts: Accounts,
}

/// Contact at the proxy.
struct Felt {
    /// As it would be without a past.
    elastic: Sample,
    /// As it is.
    sample: Sample,
    remembered: Remembered,
}

impl Haptics {
    /// A loop over the torque of `source` with the proxy `npmi` and the gains of `spec`. The proxy stays in the grid.
    ///
    /// # Errors
    /// When they differ in their number of joints.
    pub fn new(source: impl Into<TorqueSource>, npmi: Npmi, spec: &HapticsSpec) -> Result<Self, Error> {
        let source = source.into();
        let coupling = Coupling::new(spec);
        let (torque_limit, torque_rate_limit) = (spec.torque_limit, spec.torque_rate_limit);
        let lists = [
            coupling.stiffness,
            coupling.damping,
            coupling.proxy_damping,
            coupling.device_damping,
            spec.device_inertia,
            torque_limit,
            torque_rate_limit,
            spec.speed_limit,
        ];
        let lists = lists.map(|list| list.len());
        let gains = lists.into_iter().find(|&len| len != source.joints()).unwrap_or(lists[0]);
        if gains != source.joints() || npmi.joints() != source.joints() {
            let (field, proxy) = (source.joints(), npmi.joints());
            return Err(error!(
                "the dataset has {}, the proxy {proxy}, and the haptic gains are for {gains}: they must agree",
                counted(field, ["joint", "joints"])
            ));
        }
        let period = 1.0 / spec.rate;
        let watchdog = Watchdog::new(period, spec.speed_limit);
        let channels = spec.four_channel.map(|channels| Channels::new(channels, spec));
        let control = PassivityControl::new(spec);
        Ok(Self {
            range: HaptizedRange::of_grid(source.grid()),
            source,
            npmi,
            coupling,
            channels,
            control,
            friction: spec.friction.as_ref().map(Friction::new),
            relaxation: spec.relaxation.as_ref().map(|spec| Relaxation::new(spec, period)),
            slips: spec.uses_slip(),
            watchdog,
            torque_limit,
            torque_rate_limit,
            period,
        })
    }

    /// The same loop with a proxy that stays in `range`, a range of the same dataset.
    #[must_use]
    pub fn with_range(self, range: HaptizedRange) -> Self {
        Self { range, ..self }
    }

    /// Number of joints d.
    #[must_use]
    pub fn joints(&self) -> usize {
        self.source.joints()
    }

    /// Where its contact torque comes from.
    #[must_use]
    pub fn source(&self) -> &TorqueSource {
        &self.source
    }

    /// Nominal time between two ticks T (s).
    #[must_use]
    pub fn period(&self) -> f64 {
        self.period
    }

    /// The state before the first tick: device and proxy at rest at `position`, the proxy within its limits and the
    /// haptized range, no torque.
    ///
    /// # Errors
    /// When `position` is not a position of the device.
    pub fn start(&self, position: &JointVector) -> Result<State, Fault> {
        self.watchdog.check_position(position)?;
        let joints = self.joints();
        let mut state = State {
            motion: Motion::at_rest(position),
            proxy_velocity: JointVector::zeros(joints),
            device: *position,
            held: TorqueHistory::new(joints, self.period),
            pace: self.watchdog.start(),
            fault: None,
            accounts: Accounts::default(),
            channels: None,
            friction: None,
            memory: None,
        };
        self.begin(&mut state, position);
        Ok(state)
    }

    /// Ends a fault: starts again at `position` as [`Haptics::start`] does, accounts included, but from the torque that
    /// the device is under, so that there is no jump. Never allocates.
    ///
    /// # Errors
    /// When `position` is not a position of the device; the fault then stays.
    pub fn restart(&self, state: &mut State, position: &JointVector) -> Result<(), Fault> {
        self.watchdog.check_position(position)?;
        self.begin(state, position);
        Ok(())
    }

    /// Device and proxy at rest at `position`.
    fn begin(&self, state: &mut State, position: &JointVector) {
        state.motion = Motion::at_rest(&self.npmi.within_limits(&self.range.nearest(position)));
        state.proxy_velocity = JointVector::zeros(self.joints());
        state.device = *position;
        state.pace = self.watchdog.start();
        state.fault = None;
        let initial = self.coupling.spring_energy(&state.motion.position, position);
        state.accounts = Accounts { initial, ..Accounts::default() };
        state.channels = self.channels.as_ref().map(Channels::start);
        state.friction = self.friction.map(|_| FrictionState::at_rest(self.joints()));
        state.memory = self.relaxation.map(|_| Memory::default());
    }

    /// One tick. Over a scene that is solved in every tick this makes room for that each time: a session has its own
    /// ([`TorqueSource::begin`], [`Haptics::tick_with`]).
    pub fn tick(&self, state: &mut State, inputs: &Inputs) -> Output {
        self.tick_with(state, inputs, &mut self.source.begin())
    }

    /// One tick over `contact`, which the session has of this loop's source.
    pub fn tick_with(&self, state: &mut State, inputs: &Inputs, contact: &mut ContactSession<'_>) -> Output {
        let checked = self
            .watchdog
            .check(inputs, &state.device)
            .and_then(|()| self.watchdog.follow(&mut state.pace, inputs.elapsed));
        let mut fault = state.fault.or(checked.err());
        let mut velocity = JointVector::zeros(self.joints());
        let proxy = state.motion.position;
        if fault.is_none() {
            for (a, velocity) in velocity.iter_mut().enumerate() {
                *velocity = (inputs.position[a] - state.device[a]) / inputs.elapsed;
            }
            let moved = [&state.device, &inputs.position];
            let torque = state.held.before(inputs.age);
            state.accounts.device_moved(&self.coupling, inputs.elapsed, moved, &proxy, torque);
            state.device = inputs.position;
        }
        let (elastic, age) = contact.sample(&proxy);
        let (sample, remembered) = self.remember(state, &elastic);
        let stored = self.source.has_energy().then_some(sample.energy);
        let spring = self.coupling.spring_energy(&proxy, &state.device);
        state.accounts.at_tick(state.motion.kinetic_energy(), spring, (stored, remembered.relaxed), sample.index > 0.0);
        let accounts = state.accounts;
        if fault.is_none() && accounts.device_port().is_some_and(|port| port < -GREATEST_GIVEN_ENERGY) {
            fault = Some(Fault::Energy);
        }
        if fault.is_none() && f64::from(age) * self.period > GREATEST_POSITION_AGE {
            fault = Some(Fault::Unsolved);
        }

        let mut wanted = JointVector::zeros(self.joints());
        if fault.is_none() {
            let torque = self.device_torque(state, inputs, &velocity, &sample);
            if torque.is_finite() {
                wanted = torque;
            } else {
                fault = Some(Fault::Torque);
            }
        }
        state.fault = fault;
        let elapsed = if fault.is_none() { inputs.elapsed } else { self.period };
        let (torque, limited) = self.limit(&wanted, state.held.asked(), elapsed);
        state.held.push(&torque);

        let interval = if watchdog::is_interval(inputs.interval) { inputs.interval } else { self.period };
        let felt = Felt { elastic, sample, remembered };
        let stopped = self.move_proxy(state, interval, &velocity, &felt, contact);
        let flags = sample.flags | limited | stopped;
        Output { torque, device: state.device, proxy, sample, dent: remembered.dent, flags, fault, accounts }
    }

    /// Returns what is felt of the `elastic` contact at the proxy, after what the object remembers of its past.
    fn remember(&self, state: &mut State, elastic: &Sample) -> (Sample, Remembered) {
        let (Some(relaxation), Some(memory)) = (&self.relaxation, &mut state.memory) else {
            return (*elastic, Remembered { share: 1.0, stored: elastic.energy, relaxed: 0.0, dent: None });
        };
        let remembered = relaxation.arrive(memory, elastic.energy);
        let mut sample = Sample { energy: remembered.stored, ..*elastic };
        sample.torque.iter_mut().for_each(|tau| *tau *= remembered.share);
        sample.share *= remembered.share;
        sample.contact &= remembered.share > 0.0;
        if !sample.contact {
            sample.contact_nodes = 0;
        }
        (sample, remembered)
    }

    /// Returns the torque to command to the device, which moves at `velocity`: coupling, channels, controller [N m or
    /// N].
    fn device_torque(
        &self,
        state: &mut State,
        inputs: &Inputs,
        velocity: &JointVector,
        sample: &Sample,
    ) -> JointVector {
        let mut torque =
            self.coupling.device_torque(&state.device, velocity, &state.motion.position, &state.proxy_velocity);
        if let (Some(channels), Some(memory)) = (&self.channels, &mut state.channels) {
            let held = state.held.before(inputs.age);
            channels.observe(memory, inputs.elapsed, velocity, &state.proxy_velocity, held);
            let added = channels.device_torque(memory, &sample.torque);
            torque.iter_mut().zip(added.iter()).for_each(|(torque, added)| *torque += added);
        }
        if let Some(control) = &self.control {
            control.brake_device(&state.accounts, inputs.elapsed, velocity, &mut torque);
        }
        torque
    }

    /// One step of the proxy over `interval` (s), booked; what stopped it. The device moves at `velocity`, and
    /// `contact` was sampled at the proxy.
    fn move_proxy(
        &self,
        state: &mut State,
        interval: f64,
        velocity: &JointVector,
        felt: &Felt,
        contact: &mut ContactSession<'_>,
    ) -> Flags {
        let Felt { elastic, sample, remembered } = felt;
        let stage = self.npmi.stage(&state.motion, interval);
        let limits = self.npmi.limits();
        let stops = self.range.stops(&state.motion.position, &state.motion.velocity, interval, limits);
        let mut load = self.coupling.proxy_load(&state.device, velocity, &sample.torque, stops);
        let mut extra = Extra { channels: JointVector::zeros(self.joints()), ..Extra::default() };
        // After a fault nothing is known of the hand any more: its channel falls silent.
        if let (Some(channels), Some(memory), None) = (&self.channels, &state.channels, state.fault) {
            extra.channels = channels.proxy_torque(memory, &stage);
            load.torque.iter_mut().zip(extra.channels.iter()).for_each(|(torque, added)| *torque += added);
        }
        let mut rate = 0.0;
        if let Some(control) = &self.control {
            rate = control.proxy_rate(&state.accounts, interval, &state.motion);
            stage.add_inertia(rate, &mut load.damping);
        }
        let mut slip = self.slips.then(|| contact.slip(&state.motion.position, elastic));
        if let Some(slip) = &mut slip {
            slip.normal_force *= remembered.share;
        }
        let mut drag = None;
        if let (Some(relaxation), Some(memory), Some(slip)) = (&self.relaxation, &state.memory, &slip) {
            let damper = relaxation.drag(memory, elastic.energy, slip, &state.proxy_velocity, &mut load);
            drag = Some((slip, damper));
        }
        let step = match (&self.friction, &mut state.friction, &slip) {
            (Some(friction), Some(memory), Some(slip)) => {
                let velocity = state.proxy_velocity;
                let pending = Pending { npmi: &self.npmi, stage: &stage, interval, velocity, load: &mut load };
                friction.step(pending, slip, memory, &mut state.motion, &mut extra)
            }
            _ => self.npmi.advance(&stage, &mut state.motion, interval, &load),
        };
        if let (Some(relaxation), Some(memory)) = (&self.relaxation, &mut state.memory) {
            extra.drag = relaxation.depart(memory, interval, &step.velocity, drag);
        }
        extra.control_dissipation = interval * rate * stage.twice_kinetic_energy(&step.velocity);
        state.proxy_velocity = step.velocity;
        state.accounts.stepped(&self.coupling, interval, velocity, &sample.torque, &step, &extra);
        let mut flags = Flags::empty();
        for (a, &x) in state.motion.position.iter().enumerate().filter(|(a, _)| step.stopped[*a]) {
            flags |= if limits[a].contains(&x) { Flags::STOPPED } else { Flags::HELD };
        }
        flags
    }

    /// `wanted`, limited in size and in rate of change from `before` over `elapsed` (s).
    fn limit(&self, wanted: &JointVector, before: &JointVector, elapsed: f64) -> (JointVector, Flags) {
        let (mut torque, mut flags) = (*wanted, Flags::empty());
        for (a, torque) in torque.iter_mut().enumerate() {
            let size = torque.min(self.torque_limit[a]).max(-self.torque_limit[a]);
            if size != *torque {
                flags |= Flags::SIZE_LIMITED;
            }
            let change = self.torque_rate_limit[a] * elapsed;
            *torque = size.min(before[a] + change).max(before[a] - change);
            if *torque != size {
                flags |= Flags::RATE_LIMITED;
            }
        }
        (torque, flags)
    }
}

impl State {
    /// Takes the torque that the device holds of what the last tick answered (N m or N): accounts and channels rest on
    /// it.
    pub fn hold(&mut self, torque: &JointVector) {
        self.held.correct(torque);
    }

    /// Proxy position x at the next tick (rad or m).
    #[must_use]
    pub fn proxy(&self) -> &JointVector {
        &self.motion.position
    }

    /// The first fault since the loop began or was restarted.
    #[must_use]
    pub fn fault(&self) -> Option<Fault> {
        self.fault
    }
}
