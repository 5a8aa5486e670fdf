//! The haptic loop beside the window, and what the window sees of it. The haptic thread waits for nobody: the hand's
//! goal, ticks and costs cross through wait-free buffers; a second, ordinary thread moves the hand's goal at 500 Hz, so
//! that a motion does not depend on the window's frame rate.
//!
//! A picture without a window has no time of its own: there the same loop runs by steps of given length
//! ([`TickSource::Steps`]), and gives the same numbers on every machine.

use super::{background::spawn, guide::Guide};
use crate::{
    Error,
    control::{Clock, Patience, real_time},
    device::{Device, Pointer, PointerInput},
    render::{
        haptic::Haptics,
        realtime::{Ends, RATE, Recorder},
        session::{ClearFault, Driver, Latest, cannot_start},
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
    thread::{JoinHandle, Thread},
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
    shared: Arc<Shared>,
    ticks: rtrb::Consumer<Tick>,
    costs: rtrb::Consumer<Duration>,
    latest: triple_buffer::Output<Latest>,
    clear: ClearFault,
    steps: Option<mpsc::Sender<usize>>,
    stepped: mpsc::Receiver<()>,
    refused: mpsc::Receiver<Vec<String>>,
    returned: mpsc::Receiver<Box<dyn Device>>,
    threads: Vec<JoinHandle<()>>,
}

/// What window and threads share.
struct Shared {
    guide: Mutex<Guide>,
    /// Ends the threads.
    stop: AtomicBool,
    /// Whether the hand of a simulated device is still.
    is_still: AtomicBool,
    /// Whether every tick is waited for, even while the hand is still.
    keeps_pace: AtomicBool,
}

impl Shared {
    fn guide(&self) -> MutexGuard<'_, Guide> {
        // A guide is a plain value: a panic elsewhere leaves nothing half-written that would matter.
        self.guide.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// How often the hand's goal is moved.
const GUIDE_PERIOD: Duration = Duration::from_millis(2);

/// How often a goal at rest is looked at: what moves it again is felt after a hundredth of a second.
const GUIDE_AT_REST: Duration = Duration::from_millis(10);

/// Looks at a goal that has not moved after which the hand counts as still: half a second, in which it settles.
const LOOKS_UNTIL_STILL: usize = 50;

/// Ticks and costs that wait for the window: sixteen seconds at 1 kHz. A window at rest looks at them once a minute;
/// what does not fit then is a hand that has not moved.
const RING: usize = 1 << 14;

/// Everything that the haptic thread owns.
struct Body {
    shared: Arc<Shared>,
    haptics: Arc<Haptics>,
    device: Box<dyn Device>,
    /// Takes what ticks cost.
    cost: rtrb::Producer<Duration>,
    /// Whether the device is the simulated one that is led, which may wait a little longer.
    is_led: bool,
    /// Takes the device in the end.
    give_back: mpsc::Sender<Box<dyn Device>>,
}

/// The haptic thread's answer before its first tick.
type Began = Result<(Ends, ClearFault), Error>;

/// Steps that the caller asks for.
struct Steps {
    shared: Arc<Shared>,
    input: Option<PointerInput>,
    asked: mpsc::Receiver<usize>,
    done: mpsc::Sender<()>,
    /// Those left of the last request; none before the first.
    left: Option<usize>,
}

impl Steps {
    /// Waits until there is a step to be done, and moves the goal on by `period` (s). False when the caller is gone.
    fn next(&mut self, period: f64) -> bool {
        while self.left.is_none_or(|left| left == 0) {
            let Ok(count) = self
                .left
                .map_or(Ok(()), |_| self.done.send(()))
                .map_err(drop)
                .and_then(|()| self.asked.recv().map_err(drop))
            else {
                return false;
            };
            self.left = Some(count);
        }
        self.left = self.left.map(|left| left - 1);
        if let Some(input) = &mut self.input {
            let goal = self.shared.guide().follow(period);
            let _ = input.move_to(&goal);
        }
        true
    }
}

impl Feel {
    /// Starts the loop with `device`; without one, with a simulated one that is held where `guide` leads it.
    ///
    /// # Errors
    /// In words, when device and loop do not fit or the system gives no threads.
    pub fn start(
        haptics: Arc<Haptics>,
        gains: &HapticsSpec,
        guide: Guide,
        pace: TickSource,
        device: Option<Box<dyn Device>>,
    ) -> Result<Self, String> {
        let (device, input): (Box<dyn Device>, _) = match device {
            Some(device) => (device, None),
            None => {
                let (pointer, input) = Pointer::new(gains, &guide.goal()).map_err(|error| error.to_string())?;
                (Box::new(pointer), Some(input))
            }
        };
        let is_led = input.is_some();
        let [stop, is_still, keeps_pace] = [(); 3].map(|()| AtomicBool::new(false));
        let shared = Arc::new(Shared { guide: Mutex::new(guide), stop, is_still, keeps_pace });
        let own = || Arc::clone(&shared);
        let (cost, costs) = rtrb::RingBuffer::new(RING);
        let (give_back, returned) = mpsc::channel();
        let body = Body { shared: own(), haptics, device, cost, is_led, give_back };
        let (report, began) = mpsc::channel();
        let (refuse, refused) = mpsc::channel();
        let (acknowledge, stepped) = mpsc::channel();
        let (steps, asked) = mpsc::channel();
        let mut threads = Vec::new();
        let steps = match pace {
            TickSource::Clock => {
                let felt = spawn("haptic", move || body.run(None, &report, &refuse))?;
                let feeling = felt.thread().clone();
                threads.push(felt);
                if let Some(input) = input {
                    let leader = Leader { shared: own(), input, feeling };
                    threads.push(spawn("guide", move || leader.lead())?);
                }
                None
            }
            TickSource::Steps => {
                let asked = Steps { shared: own(), input, asked, done: acknowledge, left: None };
                threads.push(spawn("haptic", move || body.run(Some(asked), &report, &refuse))?);
                Some(steps)
            }
        };
        let ended = "the haptic thread ended before its first tick; start haptize again".to_owned();
        let (Ends { ticks, latest }, clear) = began.recv().map_err(|_| ended)?.map_err(|error| error.to_string())?;
        Ok(Self { shared, ticks, costs, latest, clear, steps, stepped, refused, returned, threads })
    }

    /// Ends the loop and gives back the device, without torque; none where its thread ended before.
    pub fn end(&mut self) -> Option<Box<dyn Device>> {
        self.shared.stop.store(true, Ordering::Release);
        self.steps = None;
        for thread in self.threads.drain(..) {
            // A thread that panicked has said so already.
            let _ = thread.join();
        }
        self.returned.try_recv().ok()
    }

    /// The hand's leader. The haptic thread never locks it.
    pub fn guide(&self) -> MutexGuard<'_, Guide> {
        self.shared.guide()
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

    /// Whether ticks are waited for even while the hand is still, for whom looks at how punctual they are.
    pub fn keep_pace(&self, keeps_pace: bool) {
        self.shared.keeps_pace.store(keeps_pace, Ordering::Release);
    }

    /// Lets the loop start again after a fault.
    pub fn clear_fault(&self) {
        self.clear.ask();
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

/// The part that moves the hand's goal.
struct Leader {
    shared: Arc<Shared>,
    input: PointerInput,
    /// The haptic thread, which waits while the hand is still.
    feeling: Thread,
}

impl Leader {
    /// Moves the goal until the loop is over.
    fn lead(mut self) {
        let Shared { stop, is_still, keeps_pace, .. } = &*self.shared;
        let mut last = Instant::now();
        let (mut before, mut looks) = (None, 0);
        while !stop.load(Ordering::Acquire) {
            let now = Instant::now();
            let goal = self.shared.guide().follow((now - last).as_secs_f64());
            last = now;
            // A goal that is none is refused, and the hand stays.
            let _ = self.input.move_to(&goal);
            let rests = before == Some(goal);
            looks = if rests { looks + 1 } else { 0 };
            let rested = looks >= LOOKS_UNTIL_STILL && !keeps_pace.load(Ordering::Acquire);
            if is_still.swap(rested, Ordering::AcqRel) && !rested {
                self.feeling.unpark();
            }
            std::thread::sleep(if rests { GUIDE_AT_REST } else { GUIDE_PERIOD });
            before = Some(goal);
        }
        is_still.store(false, Ordering::Release);
        self.feeling.unpark();
    }
}

impl Body {
    /// Runs the loop by `steps`, or else by the device's clock.
    fn run(mut self, mut steps: Option<Steps>, report: &mpsc::Sender<Began>, refuse: &mpsc::Sender<Vec<String>>) {
        let (haptics, is_led, Shared { stop, is_still, .. }) = (&self.haptics, self.is_led, &*self.shared);
        let patience = || {
            let waits = if is_still.load(Ordering::Acquire) {
                Patience::Rests
            } else if is_led {
                Patience::Sleeps
            } else {
                Patience::Spins
            };
            (!stop.load(Ordering::Acquire)).then_some(waits)
        };
        let period = haptics.period();
        let clock = match &steps {
            Some(_) => Ok(Clock::Steps(period)),
            None => Clock::of(self.device.as_ref(), period, RATE, &patience),
        };
        let (mut recorder, ends) = Recorder::new(haptics.joints());
        let driver = Driver::new(haptics, self.device.as_mut());
        match clock.map_err(cannot_start).and_then(|clock| Ok((clock, driver?))) {
            Err(error) => drop(report.send(Err(error))),
            Ok((mut clock, mut driver)) => {
                drop(report.send(Ok((ends, driver.controller.clear()))));
                drop(refuse.send(clock.begin()));
                let mut goes_on = || steps.as_mut().is_none_or(|steps| steps.next(period));
                if goes_on() {
                    // By steps a tick begins where the one before ended, or a step was asked for.
                    let mut begun = real_time::now();
                    let stopped = driver.pace(&mut clock, &mut |_, record, paced| {
                        recorder.take(record, paced);
                        // Unread costs of the last seconds are as good as newer ones.
                        let _ = self.cost.push(real_time::now() - paced.began.unwrap_or(begun));
                        let goes_on = goes_on();
                        begun = real_time::now();
                        goes_on
                    });
                    stopped.into_iter().for_each(|stopped| drop(refuse.send(vec![stopped])));
                }
            }
        }
        // Whoever is gone needs no device.
        let _ = self.give_back.send(self.device);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{scene::Scene, sweep::baked, viewer::loaded::Loaded};

    /// Ticks until one for which `enough` holds; a loop that never has one fails after half a minute.
    fn until(feel: &mut Feel, enough: impl Fn(&Feel, &Tick) -> bool) -> Vec<Tick> {
        let mut ticks = Vec::new();
        for _ in 0..3000 {
            while let Some(tick) = feel.next_tick() {
                ticks.push(tick);
                if enough(feel, &tick) {
                    return ticks;
                }
            }
            std::thread::sleep(Duration::from_millis(10));
        }
        panic!("{} ticks and none as wanted; the last: {:?}", ticks.len(), ticks.last());
    }

    #[test]
    fn a_hand_that_is_still_costs_few_wake_ups_and_is_led_on_without_a_gap() {
        let text = include_str!("../../tests/scenes/sphere.toml").replace("count = 36", "count = 3");
        let scene = Scene::parse(&text, "sphere.toml").unwrap();
        let loaded = Loaded::new(baked(&scene).unwrap().0, None, None).unwrap();
        let haptics = Arc::clone(&loaded.setup.haptics);
        let guide = Guide::new(&loaded);
        let mut feel = Feel::start(haptics, &scene.haptics, guide, TickSource::Clock, None).unwrap();
        let rests = |_: &Feel, tick: &Tick| tick.in_arrears;
        let mut ticks = until(&mut feel, rests);
        let at_rest = *ticks.last().unwrap();
        let mut goal = at_rest.hand;
        goal[0] += 0.1;
        feel.guide().point(goal);
        ticks.extend(until(&mut feel, |_, tick| (tick.device[0] - at_rest.device[0]).abs() > 0.01));
        ticks.extend(until(&mut feel, |feel, tick| !rests(feel, tick)));
        // As the clock has it: no time is lost between two of them.
        for pair in ticks.windows(2) {
            assert!((pair[1].time - pair[0].time - pair[1].inputs.elapsed).abs() < 1e-9);
        }
        // Who looks at punctuality has every tick waited for.
        until(&mut feel, rests);
        feel.keep_pace(true);
        until(&mut feel, |feel, tick| !rests(feel, tick));
    }
}
