//! The effects of the scene's loop, each of which can be left out while one feels, and what each of them costs.
//!
//! The price of an effect is the difference in the cost of a tick with it and without it: the scene's first motion is
//! played by a simulated hand as fast as it goes, a few times, in the background; the fastest run counts, because
//! everything else that a machine does only adds to it.

use super::loaded::Loaded;
use crate::{
    device::SimulatedHand,
    render::session,
    scene::{HapticsSpec, ProxyInertia},
};
use std::{sync::mpsc, time::Instant};

/// Something that the loop does because the scene asks for it.
pub struct Effect {
    /// For its box.
    pub name: &'static str,
    /// What it does.
    pub what: &'static str,
    /// Whether gains ask for it.
    pub is_on: fn(&HapticsSpec) -> bool,
    /// Leaves it out.
    pub leave_out: fn(&mut HapticsSpec),
    /// Takes it back as the scene has it.
    pub take_back: fn(&mut HapticsSpec, &HapticsSpec),
}

/// All effects of the loop; a scene shows those that it names.
pub const EFFECTS: [Effect; 1] = [Effect {
    name: "Inertia of each configuration",
    what: "The proxy moves with the chain's inertia where it is, instead of that in the middle of the grid",
    is_on: |gains| gains.proxy_inertia == ProxyInertia::Configuration,
    leave_out: |gains| gains.proxy_inertia = ProxyInertia::Constant,
    take_back: |gains, scene| gains.proxy_inertia = scene.proxy_inertia,
}];

/// What effects cost, as far as it is known.
pub struct Prices {
    known: Vec<Option<f64>>,
    news: Option<mpsc::Receiver<(usize, f64)>>,
}

/// Runs of which the fastest counts.
const RUNS: usize = 5;

/// Length of a run [s].
const LENGTH: f64 = 2.0;

impl Prices {
    /// Begins to measure the effects that the scene of `loaded` names. `wake` is called whenever there is news.
    #[must_use]
    pub fn measure(loaded: &Loaded, wake: impl Fn() + Send + 'static) -> Self {
        let scene = loaded.setup.scene.haptics.clone();
        let named: Vec<usize> = (0..EFFECTS.len()).filter(|&number| (EFFECTS[number].is_on)(&scene)).collect();
        let known = vec![None; EFFECTS.len()];
        if named.is_empty() {
            return Self { known, news: None };
        }
        let (sender, news) = mpsc::channel();
        let loaded = loaded.clone();
        let work = move || {
            let Some(whole) = cost(&loaded, &scene) else { return };
            for number in named {
                let mut without = scene.clone();
                (EFFECTS[number].leave_out)(&mut without);
                // A window that is gone needs no news.
                let told = cost(&loaded, &without).map(|cost| sender.send((number, whole - cost)));
                if !matches!(told, Some(Ok(()))) {
                    return;
                }
                wake();
            }
        };
        // Without a thread prices stay unknown, which is what the window says.
        let news = std::thread::Builder::new().name("prices".into()).spawn(work).ok().map(|_| news);
        Self { known, news }
    }

    /// Price of effect `number` [us a tick]; none while it is not known.
    pub fn of(&mut self, number: usize) -> Option<f64> {
        while let Some(Ok((effect, price))) = self.news.as_ref().map(mpsc::Receiver::try_recv) {
            self.known[effect] = Some(price);
        }
        self.known[number]
    }
}

/// Cost of a tick with `gains` [us]; none where the loop cannot run.
fn cost(loaded: &Loaded, gains: &HapticsSpec) -> Option<f64> {
    let (haptics, _) = loaded.tuned(gains).ok()?;
    let motion = loaded.motions().into_iter().next()?.1;
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
