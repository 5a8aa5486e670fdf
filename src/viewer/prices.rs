//! The cost of each effect and of each way to interpolate, measured on this machine for what is open.
//!
//! A tick: the scene's first motion is played by a simulated hand as fast as it goes. A frame: the object is advanced
//! on the window's device, and waited for after some frames. Both are timed in short blocks, again and again, in the
//! background, and of each block the fastest time counts, because everything else that a machine does only adds to it.
//! The price of an effect is the difference in cost with it and without it, which take turns. All of that is done
//! [`REPEATS`] times: the median is shown with its spread, and a difference whose sign varies is shown as below the
//! noise.

use super::{background::spawn, body::Nodes, loaded::Loaded};
use crate::{
    device::{Motion, SimulatedHand},
    gpu::Context,
    render::session::{Driver, Latest},
    scene::{EFFECTS, GraphicsEffects, HapticsSpec, Interpolation, Tuning, Waypoint},
};
use std::{
    hint::black_box,
    sync::{Arc, mpsc},
    time::Instant,
};

/// The cost of something.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Price {
    /// It is being measured.
    Coming,
    /// A tick or a frame.
    Known(Estimate),
    /// It could not be measured: it does not work here.
    Unknown,
}

/// A time, or a difference of two, as it was found again and again (us).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Estimate {
    median: f64,
    least: f64,
    greatest: f64,
}

/// Times that everything is measured. What costs nothing has the same sign every time, and so is shown with a price,
/// once in 64.
const REPEATS: usize = 7;

/// Time from which on it is shown without decimals (us).
const WHOLE: f64 = 10.0;

impl Estimate {
    fn of(mut found: [f64; REPEATS]) -> Self {
        found.sort_unstable_by(f64::total_cmp);
        Self { median: found[REPEATS / 2], least: found[0], greatest: found[REPEATS - 1] }
    }

    /// Upper bound of a cost too small to be measured (us); absent where it was measured.
    fn noise(self) -> Option<f64> {
        (self.least <= 0.0 && self.greatest >= 0.0).then(|| self.greatest.max(-self.least))
    }

    /// Half the spread (us).
    fn spread(self) -> f64 {
        0.5 * (self.greatest - self.least)
    }
}

impl Price {
    /// Returns the price of something whole (us); none if it does not work.
    #[must_use]
    pub fn cost(self) -> Option<String> {
        match self {
            Self::Known(cost) => Some(microseconds(cost.median)),
            Self::Coming => Some("…".into()),
            Self::Unknown => None,
        }
    }

    /// Returns the price of an effect that is part `of` a tick or a frame.
    #[must_use]
    pub fn told(self, of: &str) -> String {
        match self {
            Self::Known(price) => match price.noise() {
                Some(noise) => format!("< {} µs a {of}", microseconds(noise)),
                None => {
                    let sign = if price.median < 0.0 { '−' } else { '+' };
                    let [size, spread] = [price.median.abs(), price.spread()].map(microseconds);
                    format!("{sign}{size} ± {spread} µs a {of}")
                }
            },
            Self::Coming => "measuring …".into(),
            Self::Unknown => "price unknown".into(),
        }
    }

    /// Returns an explanation of the price.
    #[must_use]
    pub fn meaning(self) -> String {
        match self {
            Self::Known(price) => {
                let [least, greatest] = [price.least, price.greatest].map(|time| format!("{time:+.2}"));
                let verdict =
                    if price.noise().is_some() { "; with both signs, it cannot be told from nothing here" } else { "" };
                format!("With it over without it, {REPEATS} times in turns: from {least} to {greatest} µs{verdict}")
            }
            Self::Coming => "With it and without it, in turns, in the background".into(),
            Self::Unknown => "It does not work here without it, or the system gave no thread to measure it".into(),
        }
    }
}

/// With the digits that a measurement bears.
fn microseconds(time: f64) -> String {
    if time.abs() < WHOLE { format!("{time:.2}") } else { format!("{time:.0}") }
}

/// Something with a price.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Item {
    /// An effect, by its number in [`EFFECTS`]: with it over without it.
    Effect(usize),
    /// A tick with this interpolation, all of it.
    Tick(Interpolation),
}

/// The prices of everything, as far as they are known.
pub struct Prices {
    known: Vec<(Item, Price)>,
    news: Option<mpsc::Receiver<(Item, Price)>>,
}

/// Times that a block is timed in each measurement: on a machine that is busy twice over, where every second one is
/// disturbed, one block in thirty never comes through alone.
const ROUNDS: usize = 5;

/// Blocks of the loop, and ticks of one: two seconds of the motion at 1 kHz, in pieces far shorter than the turn that a
/// system gives to others in between.
const BLOCKS: usize = 40;
const TICKS: usize = 50;

/// Frames of a block, which share the wait at its end, some tens of microseconds.
const FRAMES: usize = 4;

impl Prices {
    /// Begins to measure interpolations, and the effects that the scene of `loaded` names. `wake` is called whenever
    /// there is news.
    #[must_use]
    pub fn measure(loaded: &Loaded, context: &Arc<Context>, wake: impl Fn() + Send + 'static) -> Self {
        let scene = loaded.tuning();
        let ticks = Interpolation::ALL.into_iter().map(Item::Tick);
        let named = (0..EFFECTS.len()).filter(|&number| EFFECTS[number].is_in(&scene)).map(Item::Effect);
        let items: Vec<Item> = ticks.chain(named).collect();
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
        let news = spawn("prices", work).ok().map(|_| news);
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

/// Price of `item`; none where it does not work.
fn price(item: Item, loaded: &Loaded, context: &Arc<Context>, scene: &Tuning) -> Option<Estimate> {
    let [with, without] = match item {
        Item::Tick(interpolation) => {
            let [cost] = tick_costs(loaded, [&HapticsSpec { interpolation, ..scene.haptics.clone() }])?;
            return Some(Estimate::of(cost));
        }
        Item::Effect(number) => {
            let effect = &EFFECTS[number];
            let mut without = scene.clone();
            effect.leave_out(&mut without);
            if effect.is_drawn() {
                frame_costs(loaded, context, [&scene.graphics, &without.graphics])?
            } else {
                tick_costs(loaded, [&scene.haptics, &without.haptics])?
            }
        }
    };
    Some(Estimate::of(std::array::from_fn(|repeat| with[repeat] - without[repeat])))
}

/// Costs of a tick with each of `gains` (us); none where the loop cannot run.
fn tick_costs<const N: usize>(loaded: &Loaded, gains: [&HapticsSpec; N]) -> Option<[[f64; REPEATS]; N]> {
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
    in_turns(|turn| {
        let (haptics, gains) = &loops[turn];
        let mut hand = SimulatedHand::new(gains, motion.clone()).ok()?;
        let mut driver = Driver::new(haptics, &mut hand, None).ok()?;
        let period = haptics.period();
        let block = |_| {
            let begin = Instant::now();
            for _ in 0..TICKS {
                black_box(driver.tick(period, period));
            }
            1e6 * begin.elapsed().as_secs_f64() / (BLOCKS * TICKS) as f64
        };
        Some((0..BLOCKS).map(block).collect())
    })
}

/// Costs of a frame of the object with each of `effects` (us); none where there is no object, or the device fails.
fn frame_costs<const N: usize>(
    loaded: &Loaded,
    context: &Arc<Context>,
    effects: [&GraphicsEffects; N],
) -> Option<[[f64; REPEATS]; N]> {
    let mut objects = Vec::with_capacity(N);
    for effects in effects {
        objects.push(Nodes::new(context, loaded, effects).ok()??);
    }
    let start = loaded.start();
    let latest = Latest { time: 0.0, proxy: start, device: start, share: 1.0 };
    in_turns(|turn| {
        let nodes = &mut objects[turn];
        let begin = Instant::now();
        for _ in 0..FRAMES {
            nodes.advance(&latest, nodes.period()).ok()?;
        }
        nodes.update.read().ok()?;
        Some(vec![1e6 * begin.elapsed().as_secs_f64() / FRAMES as f64])
    })
}

/// Costs of `N` kinds of work, of which `work` does one in blocks and answers with the time of each (us): the sum over
/// blocks, each the fastest of some rounds; and that again and again.
fn in_turns<const N: usize>(mut work: impl FnMut(usize) -> Option<Vec<f64>>) -> Option<[[f64; REPEATS]; N]> {
    let mut costs = [[0.0; REPEATS]; N];
    for repeat in 0..REPEATS {
        let mut least: [Vec<f64>; N] = std::array::from_fn(|_| Vec::new());
        for _ in 0..ROUNDS {
            for (turn, least) in least.iter_mut().enumerate() {
                let blocks = work(turn)?;
                least.resize(blocks.len(), f64::INFINITY);
                least.iter_mut().zip(blocks).for_each(|(least, time)| *least = least.min(time));
            }
        }
        costs.iter_mut().zip(&least).for_each(|(cost, blocks)| cost[repeat] = blocks.iter().sum());
    }
    Some(costs)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_price_is_told_with_its_spread_or_to_be_below_the_noise() {
        let told = |found| Price::Known(Estimate::of(found)).told("tick");
        assert_eq!(told([0.5, 0.3, 0.4, 0.6, 0.45, 0.42, 0.38]), "+0.42 ± 0.15 µs a tick");
        assert_eq!(told([-20.0, -12.0, -30.0, -25.0, -18.0, -21.0, -28.0]), "−21 ± 9.00 µs a tick");
        let noisy = Price::Known(Estimate::of([0.1, -0.3, 0.2, 0.2, 0.2, 0.2, 0.2]));
        assert_eq!(noisy.told("frame"), "< 0.30 µs a frame");
        assert!(noisy.meaning().contains("from -0.30 to +0.20 µs; with both signs"), "{}", noisy.meaning());
    }

    #[test]
    fn of_each_block_the_fastest_time_counts() {
        // The second kind takes twice as long; now and then something else delays a block.
        let mut calls = 0;
        let costs: [[f64; REPEATS]; 2] = in_turns(|turn| {
            calls += 1;
            let time = [1.0, 2.0][turn];
            Some((0..4).map(|block| time + if (calls / 2 + block) % 3 == 0 { 50.0 } else { 0.0 }).collect())
        })
        .unwrap();
        assert_eq!(costs, [[4.0; REPEATS], [8.0; REPEATS]]);
        assert_eq!(in_turns::<1>(|_| None), None);
    }
}
