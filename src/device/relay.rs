//! A joint-true device that its maker's library drives in a thread of its own, for a program that waits: a scan.
//!
//! The library's thread reads the device, hands the reading over and applies the newest torque that was given. It waits
//! for nobody. So a torque acts one call after the reading that it answers. Where none has come for [`STALE_COMMAND`],
//! the torque is zero until one does.

use super::{Applied, Device, Halt, JointDevice, Reading, STALE_COMMAND, Scheduler};
use crate::JointVector;
use std::{
    io,
    sync::{
        Arc, OnceLock,
        atomic::{AtomicBool, AtomicU64, Ordering},
    },
    thread,
    time::{Duration, Instant},
};

/// Part of the period that must have passed before a reading counts as the next (1): calls come a little early and
/// late, and every second one is wanted at half the rate.
const PASSED: f64 = 0.75;

/// How often the program looks for the next reading: several times in a period of 1 ms.
const LOOK: Duration = Duration::from_micros(100);

/// A torque, numbered so that a new one of the same size differs from an old one.
#[derive(Clone, Copy)]
struct Order {
    number: u64,
    torque: JointVector,
}

/// The end of the library's thread.
pub struct Ticker {
    device: JointDevice,
    orders: triple_buffer::Output<Order>,
    reports: triple_buffer::Input<(Reading, Applied)>,
    shared: Arc<Shared>,
    /// Number of the last order, and the time since it came (s).
    known: u64,
    silent: f64,
}

/// The end of the program: the same device, as it was at the last call.
pub struct Relayed {
    orders: triple_buffer::Input<Order>,
    number: u64,
    reports: triple_buffer::Output<(Reading, Applied)>,
    shared: Arc<Shared>,
}

/// The state that both ends share.
#[derive(Default)]
struct Shared {
    /// Time of the last call, since the first (ns).
    time: AtomicU64,
    /// Whether the program is done.
    over: AtomicBool,
    /// Whether the library calls no more.
    ended: AtomicBool,
    /// Why it does not.
    reason: OnceLock<Halt>,
}

/// Parts `device` into the end of the library's thread and that of the program.
#[must_use]
pub fn relay(mut device: JointDevice) -> (Ticker, Relayed) {
    let reading = device.read(0.0);
    let zero = JointVector::zeros(reading.position.len());
    let shared = Arc::new(Shared::default());
    let (input, orders) = triple_buffer::triple_buffer(&Order { number: 0, torque: zero });
    let (reports, output) = triple_buffer::triple_buffer(&(reading, Applied::whole(&zero)));
    let relayed = Relayed { orders: input, number: 0, reports: output, shared: Arc::clone(&shared) };
    (Ticker { device, orders, reports, shared, known: 0, silent: 0.0 }, relayed)
}

/// Calls `body` with `device`, which `scheduler` drives meanwhile, and with what waits for its readings. The motors are
/// off when this returns.
///
/// # Errors
/// When the system gives no thread.
pub fn with_scheduler<T>(
    device: JointDevice,
    scheduler: &dyn Scheduler,
    body: impl FnOnce(Relayed, Wait) -> T,
) -> io::Result<T> {
    let (mut ticker, relayed) = relay(device);
    let shared = Arc::clone(&relayed.shared);
    let wait = Wait { shared: Arc::clone(&shared), last: 0 };
    thread::scope(|scope| {
        // Also when `body` panics: else the library would call for ever.
        let _over = OnDrop(|| shared.over.store(true, Ordering::Release));
        let shared = Arc::clone(&shared);
        thread::Builder::new().name("device".into()).spawn_scoped(scope, move || {
            let _ended = OnDrop(|| shared.ended.store(true, Ordering::Release));
            let mut last = Instant::now();
            let run = scheduler.run(&mut || {
                let now = Instant::now();
                ticker.tick((now - std::mem::replace(&mut last, now)).as_secs_f64())
            });
            if let Err(halt) = run {
                let _ = shared.reason.set(halt);
            }
            // Motors off.
            drop(ticker);
        })?;
        Ok(body(relayed, wait))
    })
}

/// Calls a function when it is dropped.
struct OnDrop<F: Fn()>(F);

impl<F: Fn()> Drop for OnDrop<F> {
    fn drop(&mut self) {
        (self.0)();
    }
}

/// Waits for readings.
pub struct Wait {
    shared: Arc<Shared>,
    /// Time of the last one (ns).
    last: u64,
}

impl Wait {
    /// Waits for the reading that comes `period` (s) after the last, or the end of the library's calls. Returns the
    /// time since the last (s).
    pub fn wait(&mut self, period: f64) -> f64 {
        let due = self.last + (PASSED * period * 1e9) as u64;
        loop {
            let time = self.shared.time.load(Ordering::Acquire);
            if time >= due || self.shared.ended.load(Ordering::Acquire) {
                return (time - std::mem::replace(&mut self.last, time)) as f64 * 1e-9;
            }
            thread::sleep(LOOK);
        }
    }
}

impl Ticker {
    /// One call of the library's thread, `elapsed` (s) after the last. False when it is to be the last one.
    pub fn tick(&mut self, elapsed: f64) -> bool {
        let over = self.shared.over.load(Ordering::Acquire);
        let reading = self.device.read(elapsed);
        let Order { number, torque } = *self.orders.read();
        // Before the first order there is nothing to wait for.
        let renewed = number != self.known || number == 0;
        self.silent = if renewed { 0.0 } else { self.silent + elapsed };
        self.known = number;
        let late = self.silent > STALE_COMMAND.as_secs_f64();
        if late {
            self.device.interrupt();
        }
        let torque = if late || over { JointVector::zeros(torque.len()) } else { torque };
        let mut applied = self.device.apply(&torque);
        applied.halt = applied.halt.or(late.then_some(Halt::Late));
        self.reports.write((reading, applied));
        self.shared.time.fetch_add((elapsed * 1e9) as u64, Ordering::Release);
        !over && !applied.halt.is_some_and(Halt::is_final)
    }
}

impl Relayed {
    /// Returns what the last call left the device with.
    pub fn held(&mut self) -> Applied {
        let ended = self.shared.ended.load(Ordering::Acquire).then_some(Halt::Over);
        let (_, applied) = self.reports.read();
        Applied { halt: applied.halt.or(self.shared.reason.get().copied()).or(ended), ..*applied }
    }
}

impl Device for Relayed {
    fn read(&mut self, elapsed: f64) -> Reading {
        let (reading, _) = self.reports.read();
        let age = if self.shared.ended.load(Ordering::Acquire) { reading.age + elapsed } else { reading.age };
        Reading { age, ..*reading }
    }

    /// Orders `torque` for the next call. Returns what the last call left the device with.
    fn apply(&mut self, torque: &JointVector) -> Applied {
        self.number += 1;
        self.orders.write(Order { number: self.number, torque: *torque });
        self.held()
    }
}
