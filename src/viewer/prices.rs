//! What each effect costs, and each way to interpolate, measured on this machine for what is open.
//!
//! A tick: the scene's first motion is played by a simulated hand as fast as it goes. A frame: the object is advanced on
//! the window's device, and waited for after some frames. Both are timed in short blocks, again and again, in the background,
//! and of each block the fastest time counts, because everything else that a machine does only adds to it. The price of an
//! effect is the difference in cost with it and without it, which take turns.

use super::{
    body::Nodes,
    effects::{EFFECTS, Part, Tuning},
    loaded::Loaded,
};
use crate::{
    device::{Motion, SimulatedHand},
    gpu::Context,
    render::session::{Driver, Latest},
    scene::{GraphicsEffects, HapticsSpec, Interpolation, Waypoint},
};
use std::{
    hint::black_box,
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

/// Times that each block is timed: on a machine that is busy three times over, where two of three are disturbed, less than a
/// hundredth of the blocks never come through alone.
const ROUNDS: usize = 12;

/// Blocks of the loop, and ticks of one: two seconds of the motion at 1 kHz, in pieces far shorter than the turn that a
/// system gives to others in between.
const BLOCKS: usize = 40;
const TICKS: usize = 50;

/// Frames of a block, which share the wait at its end, some tens of microseconds; and times that it is timed. A software
/// device has several threads that all have to come through alone.
const FRAMES: usize = 4;
const FRAME_ROUNDS: usize = 36;

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
    let [with, without] = match item {
        Item::Tick(interpolation) => {
            let [cost] = tick_costs(loaded, [&HapticsSpec { interpolation, ..scene.haptics.clone() }])?;
            return Some(cost);
        }
        Item::Effect(number) => {
            let effect = &EFFECTS[number];
            let mut without = scene.clone();
            (effect.leave_out)(&mut without);
            match effect.part {
                Part::Tick => tick_costs(loaded, [&scene.haptics, &without.haptics])?,
                Part::Frame => frame_costs(loaded, context, [&scene.graphics, &without.graphics])?,
            }
        }
    };
    Some(with - without)
}

/// Costs of a tick with each of `gains` [us]; none where the loop cannot run.
fn tick_costs<const N: usize>(loaded: &Loaded, gains: [&HapticsSpec; N]) -> Option<[f64; N]> {
    let motion = match loaded.motions().into_iter().next() {
        Some((_, motion)) => motion,
        None => {
            let rest = [0.0, 1.0].map(|time| Waypoint { time, q: loaded.middle() });
            Motion::through(&rest, loaded.dataset.grid.joints()).ok()?
        }
    };
    let mut loops = Vec::with_capacity(N);
    for gains in gains {
        loops.push((loaded.tuned(gains).ok()?.0, gains));
    }
    let mut least = [[f64::INFINITY; BLOCKS]; N];
    for _ in 0..ROUNDS {
        for ((haptics, gains), least) in loops.iter().zip(&mut least) {
            let mut hand = SimulatedHand::new(gains, motion.clone()).ok()?;
            let mut driver = Driver::new(haptics, &mut hand).ok()?;
            let period = haptics.period();
            for least in least {
                let begin = Instant::now();
                for _ in 0..TICKS {
                    black_box(driver.tick(period, period));
                }
                *least = least.min(microseconds(begin));
            }
        }
    }
    Some(least.map(|blocks| blocks.iter().sum::<f64>() / (BLOCKS * TICKS) as f64))
}

/// Costs of a frame of the object with each of `effects` [us]; none where there is no object, or the device fails.
fn frame_costs<const N: usize>(
    loaded: &Loaded,
    context: &Arc<Context>,
    effects: [&GraphicsEffects; N],
) -> Option<[f64; N]> {
    let mut objects = Vec::with_capacity(N);
    for effects in effects {
        objects.push(Nodes::new(context, loaded, effects).ok()??);
    }
    let start = loaded.start();
    let latest = Latest { time: 0.0, proxy: start, device: start, share: 1.0 };
    let mut least = [f64::INFINITY; N];
    for _ in 0..FRAME_ROUNDS {
        for (nodes, least) in objects.iter_mut().zip(&mut least) {
            let begin = Instant::now();
            for _ in 0..FRAMES {
                nodes.advance(&latest, nodes.period()).ok()?;
            }
            nodes.update.read().ok()?;
            *least = least.min(microseconds(begin));
        }
    }
    Some(least.map(|block| block / FRAMES as f64))
}

fn microseconds(since: Instant) -> f64 {
    1e6 * since.elapsed().as_secs_f64()
}
