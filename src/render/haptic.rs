//! One tick of the haptic loop: device position in, device torque out (section 3.1). Pure: no clock, no thread, no
//! allocation, no panic.
//!
//! At t_k: check the device's position; coupling torque for the device from y_k and x_k; contact torque tau_bar(x_k) from
//! the dataset; one NPMI step of the proxy to x_{k+1}; energy accounts. The device's torque is limited in size, and in
//! rate against the torque before it. On a fault (see [`Fault`]) its goal is zero, which it reaches at the greatest rate,
//! without a jump; the proxy stays tied to the last good position meanwhile, and the loop goes on when the fault ends.

use super::{
    accounts::Accounts,
    coupling::Coupling,
    field::{Sample, TorqueField},
    flags::{Fault, Flags},
    npmi::{Motion, Npmi},
};
use crate::{
    JointVector,
    scene::HapticsSpec,
    tolerances::{GREATEST_INPUT, GREATEST_INTERVAL, GREATEST_POSITION_AGE, LEAST_INTERVAL},
};

/// Everything of the haptic loop that does not change from tick to tick.
pub struct Haptics {
    field: TorqueField,
    npmi: Npmi,
    coupling: Coupling,
    torque_limit: JointVector,
    torque_rate_limit: JointVector,
    period: f64,
}

/// What one tick hands to the next.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct State {
    /// Proxy.
    motion: Motion,
    /// v_hat of the last step [rad/s or m/s].
    proxy_velocity: JointVector,
    /// Last good device position y [rad or m].
    device: JointVector,
    /// Torque on the device since the last tick [N m or N].
    torque: JointVector,
    /// Whether the last tick had a fault.
    faulty: bool,
    /// U at the first tick [J].
    first_stored: Option<f64>,
    accounts: Accounts,
}

/// What a tick is told.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Inputs {
    /// Device position y_k [rad or m].
    pub position: JointVector,
    /// Age of that position [s].
    pub age: f64,
    /// Time since the tick before, T_{k-1} [s].
    pub elapsed: f64,
    /// Time to the next tick, T_k, by which the proxy moves on [s].
    pub interval: f64,
}

/// What a tick answers. All but `torque` is for recording and drawing.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Output {
    /// For the device until the next tick [N m or N].
    pub torque: JointVector,
    /// Device position that was used [rad or m].
    pub device: JointVector,
    /// Proxy position x_k [rad or m].
    pub proxy: JointVector,
    /// The contact field at x_k.
    pub sample: Sample,
    /// The field's remarks and the loop's.
    pub flags: Flags,
    /// Why the torque is being brought to zero, if it is.
    pub fault: Option<Fault>,
    /// At t_k.
    pub accounts: Accounts,
}

/// Field, proxy and gains do not make a loop.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("the dataset has {field} joints, the proxy {proxy}, and the haptic gains are for {gains}: they must agree")]
pub struct JointsError {
    /// Joints of the dataset.
    pub field: usize,
    /// Joints of the proxy.
    pub proxy: usize,
    /// Numbers in the first list of gains that differs, or in the last.
    pub gains: usize,
}

impl Haptics {
    /// A loop over `field` with the proxy `npmi` and the gains of `spec`.
    ///
    /// # Errors
    /// When they differ in their number of joints.
    pub fn new(field: TorqueField, npmi: Npmi, spec: &HapticsSpec) -> Result<Self, JointsError> {
        let coupling = Coupling::new(spec);
        let (torque_limit, torque_rate_limit) = (spec.torque_limit, spec.torque_rate_limit);
        let lists = [coupling.stiffness, coupling.damping, coupling.proxy_damping, torque_limit, torque_rate_limit]
            .map(|v| v.len());
        let gains = lists.into_iter().find(|&len| len != field.joints()).unwrap_or(lists[0]);
        if gains != field.joints() || npmi.joints() != field.joints() {
            return Err(JointsError { field: field.joints(), proxy: npmi.joints(), gains });
        }
        Ok(Self { field, npmi, coupling, torque_limit, torque_rate_limit, period: 1.0 / spec.rate })
    }

    /// Number of joints d.
    #[must_use]
    pub fn joints(&self) -> usize {
        self.field.joints()
    }

    /// The contact field.
    #[must_use]
    pub fn field(&self) -> &TorqueField {
        &self.field
    }

    /// Nominal time between two ticks T [s].
    #[must_use]
    pub fn period(&self) -> f64 {
        self.period
    }

    /// The state before the first tick: device and proxy at rest at `position`, the proxy within its limits, no torque.
    ///
    /// # Errors
    /// When `position` is not a position of the device.
    pub fn start(&self, position: &JointVector) -> Result<State, Fault> {
        self.check_position(position)?;
        let motion =
            Motion { position: self.npmi.within_limits(position), velocity: JointVector::zeros(self.joints()) };
        let initial = self.coupling.spring_energy(&motion.position, position);
        Ok(State {
            motion,
            proxy_velocity: JointVector::zeros(self.joints()),
            device: *position,
            torque: JointVector::zeros(self.joints()),
            faulty: false,
            first_stored: None,
            accounts: Accounts { initial, ..Accounts::default() },
        })
    }

    /// One tick.
    pub fn tick(&self, state: &mut State, inputs: &Inputs) -> Output {
        let fault = self.check(inputs).err();
        let mut velocity = JointVector::zeros(self.joints());
        if fault.is_none() {
            // After a fault the last good position is older than one tick: no velocity can be told from it.
            if !state.faulty {
                for (a, velocity) in velocity.iter_mut().enumerate() {
                    *velocity = (inputs.position[a] - state.device[a]) / inputs.elapsed;
                }
            }
            let proxy = &state.motion.position;
            state.accounts.device_moved(&self.coupling, &state.device, &inputs.position, proxy, &state.torque);
            state.device = inputs.position;
        }
        state.faulty = fault.is_some();

        let proxy = state.motion.position;
        let wanted = match fault {
            None => self.coupling.device_torque(&state.device, &velocity, &proxy, &state.proxy_velocity),
            Some(_) => JointVector::zeros(self.joints()),
        };
        let elapsed = if fault.is_none() { inputs.elapsed } else { self.period };
        let (torque, limited) = self.limit(&wanted, &state.torque, elapsed);
        state.torque = torque;

        let sample = self.field.sample(&proxy);
        let accounts = &mut state.accounts;
        accounts.kinetic = self.npmi.kinetic_energy(&state.motion.velocity);
        accounts.spring = self.coupling.spring_energy(&proxy, &state.device);
        accounts.stored = sample.energy;
        if self.field.has_energy() {
            accounts.leak = accounts.field_work + sample.energy - *state.first_stored.get_or_insert(sample.energy);
        }
        let accounts_now = *accounts;

        let interval = if is_interval(inputs.interval) { inputs.interval } else { self.period };
        let load = self.coupling.proxy_load(&state.device, &velocity, &sample.torque);
        let step = self.npmi.step(&mut state.motion, interval, &load);
        state.proxy_velocity = step.velocity;
        state.accounts.stepped(&self.coupling, interval, &velocity, &sample.torque, &step);

        let stopped = if step.stopped.contains(&true) { Flags::STOPPED } else { Flags::empty() };
        Output {
            torque,
            device: state.device,
            proxy,
            sample,
            flags: sample.flags | limited | stopped,
            fault,
            accounts: accounts_now,
        }
    }

    fn check(&self, inputs: &Inputs) -> Result<(), Fault> {
        self.check_position(&inputs.position)?;
        if inputs.age > GREATEST_POSITION_AGE || inputs.age.is_nan() {
            return Err(Fault::Stale);
        }
        if is_interval(inputs.elapsed) && is_interval(inputs.interval) { Ok(()) } else { Err(Fault::Interval) }
    }

    fn check_position(&self, position: &JointVector) -> Result<(), Fault> {
        if position.len() != self.joints() {
            return Err(Fault::Joints);
        }
        // Comparisons are false for what is not a number.
        if position.iter().all(|y| y.abs() <= GREATEST_INPUT) { Ok(()) } else { Err(Fault::NotFinite) }
    }

    /// `wanted`, limited in size and in rate of change from `before` over `elapsed` [s].
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

fn is_interval(seconds: f64) -> bool {
    (LEAST_INTERVAL..=GREATEST_INTERVAL).contains(&seconds)
}

impl State {
    /// Proxy position x at the next tick [rad or m].
    #[must_use]
    pub fn proxy(&self) -> &JointVector {
        &self.motion.position
    }
}
