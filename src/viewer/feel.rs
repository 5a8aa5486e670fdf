//! The haptic loop beside the window, and what the window sees of it. The haptic thread waits for nobody: the hand's
//! goal, ticks and costs cross through wait-free buffers; a second, ordinary thread moves the hand's goal at 500 Hz, so
//! that a motion does not depend on the window's frame rate.
//!
//! A picture without a window has no time of its own: there the same loop runs by steps of given length
//! ([`TickSource::Steps`]), and gives the same numbers on every machine.

use super::{background::spawn, guide::Guide};
use crate::{
    JointVector,
    device::{Applied, Device, Pointer, PointerInput, Reading, Scheduler},
    render::{
        haptic::Haptics,
        live::{Answers, Live},
        on_demand::{Exploration, OnDemand},
        realtime::{ClearFault, Ends, HapticLoop},
        session::{Driver, Latest},
        trace::Tick,
    },
    scene::HapticsSpec,
};
use std::{
    sync::{
        Arc, Mutex, MutexGuard, PoisonError,
        atomic::{AtomicBool, Ordering},
        mpsc,
    },
    thread::JoinHandle,
    time::{Duration, Instant},
};

/// The source of ticks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TickSource {
    /// The clock, in a thread with real-time priority where that is permitted.
    Clock,
    /// The caller.
    Steps,
}

/// The loop as the window holds it. Dropping it ends its threads.
pub struct Feel {
    guide: Arc<Mutex<Guide>>,
    ticks: rtrb::Consumer<Tick>,
    costs: rtrb::Consumer<Duration>,
    latest: triple_buffer::Output<Latest>,
    clear: Option<ClearFault>,
    stop: Arc<AtomicBool>,
    steps: Option<mpsc::Sender<usize>>,
    stepped: mpsc::Receiver<()>,
    refused: mpsc::Receiver<Vec<String>>,
    returned: mpsc::Receiver<Box<dyn Device>>,
    threads: Vec<JoinHandle<()>>,
    exploration: Option<Exploration>,
}

/// How often the hand's goal is moved.
const GUIDE_PERIOD: Duration = Duration::from_millis(2);

/// How often a goal at rest is looked at: what moves it again is felt after a hundredth of a second.
const GUIDE_AT_REST: Duration = Duration::from_millis(10);

/// Ticks and costs that wait for the window: sixteen seconds at 1 kHz. A window at rest looks at them once a minute;
/// what does not fit then is a hand that has not moved.
const RING: usize = 1 << 14;

/// Everything that the haptic thread owns.
struct Body {
    haptics: Arc<Haptics>,
    device: Timed,
    /// The contact that is solved meanwhile.
    live: Option<Live>,
    stop: Arc<AtomicBool>,
    /// Whether the device is the simulated one that is led, which may wait a little longer.
    is_led: bool,
    /// Takes the device in the end.
    give_back: mpsc::Sender<Box<dyn Device>>,
}

/// The ends of the buffers that the haptic thread returns before its first tick.
type Seen = (rtrb::Consumer<Tick>, triple_buffer::Output<Latest>, Option<ClearFault>);

impl Feel {
    /// Starts the loop with `device`; without one, with a simulated one that is held where `guide` leads it. Contact is
    /// solved meanwhile where it is `on_demand`.
    ///
    /// # Errors
    /// In words, when device and loop do not fit or the system gives no threads.
    pub fn start(
        haptics: Arc<Haptics>,
        gains: &HapticsSpec,
        guide: Guide,
        pace: TickSource,
        device: Option<Box<dyn Device>>,
        on_demand: Option<&Arc<OnDemand>>,
    ) -> Result<Self, String> {
        let (mut device, input): (Box<dyn Device>, _) = match device {
            Some(device) => (device, None),
            None => {
                let (pointer, input) = Pointer::new(gains, &guide.goal()).map_err(|error| error.to_string())?;
                (Box::new(pointer), Some(input))
            }
        };
        let is_led = input.is_some();
        let explored = on_demand.map(|on_demand| explore(on_demand, &haptics, device.as_mut())).transpose()?;
        let (live, exploration) = explored.unzip();
        let guide = Arc::new(Mutex::new(guide));
        let stop = Arc::new(AtomicBool::new(false));
        let (cost, costs) = rtrb::RingBuffer::new(RING);
        let device = Timed { device, read: Instant::now(), cost };
        let (give_back, returned) = mpsc::channel();
        let body = Body { haptics, device, live, stop: Arc::clone(&stop), is_led, give_back };
        let (report, began) = mpsc::channel();
        let (refuse, refused) = mpsc::channel();
        let (acknowledge, stepped) = mpsc::channel();
        let (steps, asked) = mpsc::channel();
        let mut threads = Vec::new();
        let steps = match pace {
            TickSource::Clock => {
                if let Some(input) = input {
                    let (leader, over) = (Arc::clone(&guide), Arc::clone(&stop));
                    threads.push(spawn("guide", move || lead(&leader, input, &over))?);
                }
                threads.push(spawn("haptic", move || body.by_the_clock(&report, &refuse))?);
                None
            }
            TickSource::Steps => {
                let leader = Arc::clone(&guide);
                threads.push(spawn("haptic", move || body.by_steps(&leader, input, &report, &asked, &acknowledge))?);
                Some(steps)
            }
        };
        let ended = "the haptic thread ended before its first tick; start haptize again".to_owned();
        let (ticks, latest, clear) = began.recv().map_err(|_| ended)??;
        Ok(Self { guide, ticks, costs, latest, clear, stop, steps, stepped, refused, returned, threads, exploration })
    }

    /// Ends the loop and gives back the device, without torque; none where its thread ended before.
    pub fn end(&mut self) -> Option<Box<dyn Device>> {
        self.stop.store(true, Ordering::Release);
        self.steps = None;
        for thread in self.threads.drain(..) {
            // A thread that panicked has said so already.
            let _ = thread.join();
        }
        self.returned.try_recv().ok()
    }

    /// The hand's leader. The haptic thread never locks it.
    pub fn guide(&self) -> MutexGuard<'_, Guide> {
        lock(&self.guide)
    }

    /// Does `count` ticks and waits for them, where the loop runs by steps.
    pub fn step(&self, count: usize) {
        if let Some(steps) = &self.steps
            && steps.send(count).is_ok()
        {
            // The thread ended where there is no answer; there are no ticks then.
            let _ = self.stepped.recv();
        }
    }

    /// Lets the loop start again after a fault.
    pub fn clear_fault(&self) {
        if let Some(clear) = &self.clear {
            clear.ask();
        }
    }

    /// The next tick that has not been seen.
    pub fn next_tick(&mut self) -> Option<Tick> {
        self.ticks.pop().ok()
    }

    /// The next cost of a tick that has not been seen.
    pub fn next_cost(&mut self) -> Option<Duration> {
        self.costs.pop().ok()
    }

    /// The latest tick, as graphics needs it.
    pub fn latest(&mut self) -> Latest {
        *self.latest.read()
    }

    /// What answered the ticks so far, where contact is solved meanwhile.
    pub fn answers(&mut self) -> Option<Answers> {
        self.exploration.as_mut().map(Exploration::answers)
    }

    /// Returns the requests of the haptic thread that the system refused, once.
    #[must_use]
    pub fn refused(&self) -> Option<Vec<String>> {
        self.refused.try_recv().ok()
    }
}

impl Drop for Feel {
    fn drop(&mut self) {
        self.end();
    }
}

/// Begins to solve where `device` has the proxy start.
fn explore(
    on_demand: &Arc<OnDemand>,
    haptics: &Haptics,
    device: &mut dyn Device,
) -> Result<(Live, Exploration), String> {
    let start = haptics.start(&device.read(0.0).position).map_err(|fault| fault.to_string())?;
    on_demand.begin(start.proxy()).map_err(|error| error.to_string())
}

fn lock(guide: &Mutex<Guide>) -> MutexGuard<'_, Guide> {
    // A guide is a plain value: a panic elsewhere leaves nothing half-written that would matter.
    guide.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Moves the hand's goal until the loop is over.
fn lead(guide: &Mutex<Guide>, mut input: PointerInput, over: &AtomicBool) {
    let mut last = Instant::now();
    let mut before = None;
    while !over.load(Ordering::Acquire) {
        let now = Instant::now();
        let goal = lock(guide).follow((now - last).as_secs_f64());
        last = now;
        // A goal that is none is refused, and the hand stays.
        let _ = input.move_to(&goal);
        std::thread::sleep(if before == Some(goal) { GUIDE_AT_REST } else { GUIDE_PERIOD });
        before = Some(goal);
    }
}

impl Body {
    fn by_the_clock(mut self, report: &mpsc::Sender<Result<Seen, String>>, refuse: &mpsc::Sender<Vec<String>>) {
        let scheduler = self.device.scheduler();
        let goes_on = || !self.stop.load(Ordering::Acquire);
        match HapticLoop::new(&self.haptics, &mut self.device) {
            Err(error) => drop(report.send(Err(error.to_string()))),
            Ok((body, Ends { ticks, latest, clear, .. })) => {
                let mut body = body.with_live(self.live);
                drop(report.send(Ok((ticks, latest, Some(clear)))));
                match scheduler {
                    None => {
                        drop(refuse.send(body.begin()));
                        while goes_on() {
                            if self.is_led {
                                body.tick_relaxed();
                            } else {
                                body.tick();
                            }
                        }
                    }
                    Some(scheduler) => {
                        let run = scheduler.run(&mut || {
                            body.tick_now();
                            goes_on()
                        });
                        let stopped = run.err().map(|halt| format!("the device's own thread stopped: {halt}"));
                        drop(refuse.send(stopped.into_iter().collect()));
                    }
                }
            }
        }
        // Whoever is gone needs no device.
        let _ = self.give_back.send(self.device.device);
    }

    fn by_steps(
        mut self,
        guide: &Mutex<Guide>,
        mut input: Option<PointerInput>,
        report: &mpsc::Sender<Result<Seen, String>>,
        asked: &mpsc::Receiver<usize>,
        done: &mpsc::Sender<()>,
    ) {
        let mut driver = match Driver::new(&self.haptics, &mut self.device) {
            Ok(driver) => driver.with_live(self.live),
            Err(error) => return drop(report.send(Err(error.to_string()))),
        };
        let (mut record, ticks) = rtrb::RingBuffer::new(RING);
        let start = JointVector::zeros(self.haptics.joints());
        let (mut latest, read) =
            triple_buffer::triple_buffer(&Latest { time: 0.0, proxy: start, device: start, share: 0.0 });
        drop(report.send(Ok((ticks, read, None))));
        let period = self.haptics.period();
        for count in asked {
            for _ in 0..count {
                if let Some(input) = &mut input {
                    let goal = lock(guide).follow(period);
                    let _ = input.move_to(&goal);
                }
                let (tick, state) = driver.tick(period, period);
                latest.write(state);
                // Ticks beyond the ring are not recorded; steps are far shorter than it.
                let _ = record.push(tick);
            }
            if done.send(()).is_err() {
                break;
            }
        }
        drop(driver);
        let _ = self.give_back.send(self.device.device);
    }
}

/// The device, with the time from its reading to the torque that answers it: what a tick costs.
struct Timed {
    device: Box<dyn Device>,
    read: Instant,
    cost: rtrb::Producer<Duration>,
}

impl Device for Timed {
    fn read(&mut self, elapsed: f64) -> Reading {
        let reading = self.device.read(elapsed);
        self.read = Instant::now();
        reading
    }

    fn apply(&mut self, torque: &JointVector) -> Applied {
        // Unread costs of the last seconds are as good as newer ones.
        let _ = self.cost.push(self.read.elapsed());
        self.device.apply(torque)
    }

    fn scheduler(&self) -> Option<Arc<dyn Scheduler>> {
        self.device.scheduler()
    }
}
