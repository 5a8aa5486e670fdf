//! What each effect costs, and each way to interpolate, measured on this machine for what is open.
//!
//! A tick: the scene's first motion is played by a simulated hand as fast as it goes. A frame: the object is advanced on
//! the window's device, and waited for after many frames. Each is done a few times, in the background, and the fastest run
//! counts, because everything else that a machine does only adds to it. The price of an effect is the difference in cost
//! with it and without it.

use super::{
    body::Nodes,
    effects::{EFFECTS, Part, Tuning},
    loaded::Loaded,
};
use crate::{
    device::{Motion, SimulatedHand},
    gpu::Context,
    render::session::{self, Latest},
    scene::{GraphicsEffects, HapticsSpec, Interpolation, Waypoint},
};
use std::{
    sync::{Arc, mpsc},
    time::Instant,
};

/// What something costs.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Price {
    /// It is being measured.
    Coming,
    /// [us] a tick or a frame.
    Known(f64),
    /// It could not be measured: it does not work here.
    Unknown,
}

/// What has a price.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Item {
    /// An effect, by its number in [`EFFECTS`]: with it over without it.
    Effect(usize),
    /// A tick with this interpolation, all of it.
    Tick(Interpolation),
}

/// What everything costs, as far as it is known.
pub struct Prices {
    known: Vec<(Item, Price)>,
    news: Option<mpsc::Receiver<(Item, Price)>>,
}

/// Runs of which the fastest counts.
const RUNS: usize = 5;

/// Length of a run of the loop [s].
const LENGTH: f64 = 2.0;

/// Frames of a run of the object: the wait at its end, some tens of microseconds, is shared by this many.
const FRAMES: usize = 60;

impl Prices {
    /// Begins to measure interpolations, and the effects that the scene of `loaded` names. `wake` is called whenever there
    /// is news.
    #[must_use]
    pub fn measure(loaded: &Loaded, context: &Arc<Context>, wake: impl Fn() + Send + 'static) -> Self {
        let scene = Tuning::of(loaded);
        let ticks = Interpolation::ALL.into_iter().map(Item::Tick);
        let items: Vec<Item> = ticks.chain(scene.named().map(Item::Effect)).collect();
        let known = items.iter().map(|item| (*item, Price::Coming)).collect();
        let (sender, news) = mpsc::channel();
        let (loaded, context) = (loaded.clone(), Arc::clone(context));
        let work = move || {
            for item in items {
                let price = price(item, &loaded, &context, &scene).map_or(Price::Unknown, Price::Known);
                // A window that is gone needs no news.
                if sender.send((item, price)).is_err() {
                    return;
                }
                wake();
            }
        };
        // Without a thread prices stay unknown, which is what the window says.
        let news = std::thread::Builder::new().name("prices".into()).spawn(work).ok().map(|_| news);
        Self { known, news }
    }

    /// Waits until everything is measured.
    pub fn wait(&mut self) {
        if let Some(news) = self.news.take() {
            news.iter().for_each(|(item, price)| self.told(item, price));
        }
    }

    fn told(&mut self, item: Item, price: Price) {
        self.known.iter_mut().filter(|known| known.0 == item).for_each(|known| known.1 = price);
    }

    /// Price of `item`.
    pub fn of(&mut self, item: Item) -> Price {
        while let Some(news) = self.news.as_ref().map(mpsc::Receiver::try_recv) {
            match news {
                Ok((item, price)) => self.told(item, price),
                Err(mpsc::TryRecvError::Empty) => break,
                Err(mpsc::TryRecvError::Disconnected) => self.news = None,
            }
        }
        match self.known.iter().find(|known| known.0 == item) {
            Some((_, Price::Coming)) if self.news.is_none() => Price::Unknown,
            Some((_, price)) => *price,
            None => Price::Unknown,
        }
    }
}

/// Price of `item` [us]; none where it does not work.
fn price(item: Item, loaded: &Loaded, context: &Arc<Context>, scene: &Tuning) -> Option<f64> {
    match item {
        Item::Tick(interpolation) => tick_cost(loaded, &HapticsSpec { interpolation, ..scene.haptics.clone() }),
        Item::Effect(number) => {
            let effect = &EFFECTS[number];
            let mut without = scene.clone();
            (effect.leave_out)(&mut without);
            Some(match effect.part {
                Part::Tick => tick_cost(loaded, &scene.haptics)? - tick_cost(loaded, &without.haptics)?,
                Part::Frame => {
                    frame_cost(loaded, context, &scene.graphics)? - frame_cost(loaded, context, &without.graphics)?
                }
            })
        }
    }
}

/// Cost of a tick with `gains` [us]; none where the loop cannot run.
fn tick_cost(loaded: &Loaded, gains: &HapticsSpec) -> Option<f64> {
    let (haptics, _) = loaded.tuned(gains).ok()?;
    let motion = match loaded.motions().into_iter().next() {
        Some((_, motion)) => motion,
        None => {
            let rest = [0.0, LENGTH].map(|time| Waypoint { time, q: loaded.middle() });
            Motion::through(&rest, gains.boundary_slope.len()).ok()?
        }
    };
    let plan = loaded.setup.plan(&loaded.dataset, LENGTH, 0);
    let mut fastest = f64::INFINITY;
    for _ in 0..RUNS {
        let mut hand = SimulatedHand::new(gains, motion.clone()).ok()?;
        let begin = Instant::now();
        session::run(&haptics, &mut hand, None, &plan).ok()?;
        fastest = fastest.min(begin.elapsed().as_secs_f64() * 1e6 / plan.ticks as f64);
    }
    Some(fastest)
}

/// Cost of a frame of the object with `effects` [us]; none where there is no object, or the device fails.
fn frame_cost(loaded: &Loaded, context: &Arc<Context>, effects: &GraphicsEffects) -> Option<f64> {
    let mut nodes = Nodes::new(context, loaded, effects).ok()??;
    let start = loaded.start();
    let latest = Latest { time: 0.0, proxy: start, device: start, share: 1.0 };
    let mut fastest = f64::INFINITY;
    for _ in 0..RUNS {
        let begin = Instant::now();
        for _ in 0..FRAMES {
            nodes.advance(&latest, nodes.period()).ok()?;
        }
        nodes.update.read().ok()?;
        fastest = fastest.min(begin.elapsed().as_secs_f64() * 1e6 / FRAMES as f64);
    }
    Some(fastest)
}
