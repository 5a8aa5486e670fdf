//! What each effect of a scene costs in baking, in a tick, in a frame and in the dataset. Prints the table of
//! docs/effects.md.
//!
//! *Plain* is the scene without effects and without graphics, *graphics* adds what is drawn, each further row one
//! effect with the scene's own value, or a usual one; *whole* has all effects that the scene names, or, where it names
//! none, all that can act together. A number is the time over that of the baseline: `plain`, or `graphics` for frames;
//! in brackets, the whole scene with the effect over the whole without it. All variants are baked, felt along the same
//! motion and drawn under the same forces, in rounds that go to and fro, so that a busy machine falls on all alike; of
//! each piece of work the fastest round counts, because the work is the same in each and everything else only adds to
//! it.
//!
//!     cargo bench --bench effects

#![allow(clippy::unwrap_used)] // A benchmark may stop.

use haptize::{
    JointVector,
    dataset::Dataset,
    device::Motion,
    render::{graphics::Graphics, haptic::Inputs, session::Latest, setup::Setup},
    scene::{EFFECTS, Effect, Scene},
    sweep::baked,
};
use std::{path::Path, time::Instant};

/// Rounds of bakes, of ticks and of frames.
const BAKES: usize = 5;
const ROUNDS: usize = 15;

/// Ticks of a block: a tenth of a millisecond, which is mostly not interrupted, and long enough for any clock.
const BLOCK: usize = 100;

/// Frames of a round, evenly along the motion.
const FRAMES: usize = 60;

/// Numbers of the two baselines among the variants.
const PLAIN: usize = 0;
const GRAPHICS: usize = 1;

/// Configuration, and share of the forces, of a frame.
type Place = (JointVector, f64);

/// A row of the table.
struct Row {
    name: &'static str,
    /// The variant that has this effect alone.
    alone: usize,
    /// The whole scene with it and without it.
    within: Option<[usize; 2]>,
}

fn main() {
    let scene = Scene::load(Path::new("datasets/sphere.toml")).unwrap();
    let (rows, variants) = variants(&scene);
    let count = variants.len();
    let mut datasets: Vec<Option<Dataset>> = variants.iter().map(|_| None).collect();
    let bakes = in_turns(BAKES, count, |k| {
        let (seconds, dataset) = timed(|| baked(&variants[k]).unwrap().0);
        datasets[k] = Some(dataset);
        vec![seconds]
    });
    let datasets: Vec<Dataset> = datasets.into_iter().flatten().collect();
    let setups: Vec<Setup> = datasets.iter().map(|dataset| Setup::new(dataset).unwrap()).collect();
    let motion = Motion::through(&setups[PLAIN].scene.motion.press, scene.proxy.joints.len()).unwrap();
    let ticks = in_turns(ROUNDS, count, |k| felt(&setups[k], &motion));
    let sampled = |k: usize| {
        let q = motion.at(motion.duration() * k as f64 / FRAMES as f64).0;
        let sample = setups[PLAIN].haptics.source().field().unwrap().sample(&q);
        (q, if sample.contact { sample.share } else { 0.0 })
    };
    let places: Vec<Place> = (0..FRAMES).map(sampled).collect();
    let mut drawn: Vec<Option<Graphics<'_>>> =
        setups.iter().zip(&datasets).map(|(setup, dataset)| setup.graphics(dataset).unwrap()).collect();
    let frames = in_turns(ROUNDS, count, |k| {
        let Some(graphics) = &mut drawn[k] else { return Vec::new() };
        places.iter().map(|(q, share)| timed(|| graphics.frame(&latest(q, *share), true)).0).collect()
    });
    let bytes: Vec<f64> = datasets.iter().map(|dataset| dataset.summary().bytes as f64).collect();
    println!("plain: {:.2} s a bake, {:.0} bytes", bakes[PLAIN], bytes[PLAIN]);
    println!("plain: {:.2} us a tick", 1e6 * ticks[PLAIN] / (1e3 * motion.duration()));
    println!("graphics: {:.3} ms a frame\n", 1e3 * frames[GRAPHICS] / FRAMES as f64);
    println!("| | bake | tick | frame | dataset |\n|---|---|---|---|---|");
    for Row { name, alone, within } in rows {
        print!("| {name} |");
        for (costs, baseline) in [(&bakes, PLAIN), (&ticks, PLAIN), (&frames, GRAPHICS), (&bytes, PLAIN)] {
            let ratio = |[k, baseline]: [usize; 2]| costs[k] / costs[baseline];
            match (costs[alone] > 0.0, within) {
                (false, _) => print!(" |"),
                (true, Some(within)) => print!(" {:.2} ({:.2}) |", ratio([alone, baseline]), ratio(within)),
                (true, None) => print!(" {:.2} |", ratio([alone, baseline])),
            }
        }
        println!();
    }
}

/// The table's rows and the variants of `scene` that they compare: plain, graphics, each effect that can act, the
/// whole, and the whole with each effect that it lacks or without one that it has.
fn variants(scene: &Scene) -> (Vec<Row>, Vec<Scene>) {
    let row = |name, alone| Row { name, alone, within: None };
    let mut variants = [false, true].map(|graphics| scene.with_effects(graphics, &[]).unwrap()).to_vec();
    let mut rows = vec![row("plain", PLAIN), row("graphics", GRAPHICS)];
    let mut can_act: Vec<Effect> = Vec::new();
    for effect in EFFECTS {
        match scene.with_effects(false, &[effect]) {
            Ok(with) => {
                rows.push(row(effect.key, variants.len()));
                variants.push(with);
                can_act.push(effect);
            }
            Err(error) => println!("{} is not measured: {error}", effect.key),
        }
    }
    let named: Vec<Effect> = EFFECTS.into_iter().filter(|effect| effect.is_named(scene)).collect();
    let is_drawn = named.is_empty() || scene.graphics.is_some();
    let whole = if named.is_empty() { together(scene, &can_act) } else { named };
    let whole_number = variants.len();
    variants.push(scene.with_effects(is_drawn, &whole).unwrap());
    for (row, effect) in rows[GRAPHICS + 1..].iter_mut().zip(can_act) {
        let has = whole.contains(&effect);
        let mut others: Vec<Effect> = whole.iter().copied().filter(|other| *other != effect).collect();
        if !has {
            others.push(effect);
        }
        let Ok(other) = scene.with_effects(is_drawn, &others) else { continue };
        row.within = Some(if has { [whole_number, variants.len()] } else { [variants.len(), whole_number] });
        variants.push(other);
    }
    rows.push(row("whole", whole_number));
    (rows, variants)
}

/// Those of `effects` that can act together.
fn together(scene: &Scene, effects: &[Effect]) -> Vec<Effect> {
    let mut together = Vec::new();
    for effect in effects {
        together.push(*effect);
        if scene.with_effects(true, &together).is_err() {
            together.pop();
        }
    }
    together
}

/// Seconds of each block of ticks along `motion`.
fn felt(setup: &Setup, motion: &Motion) -> Vec<f64> {
    let (haptics, period) = (&setup.haptics, setup.haptics.period());
    let mut state = haptics.start(&motion.at(0.0).0).unwrap();
    let blocks = (motion.duration() / period) as usize / BLOCK;
    let block = |block: usize| {
        let inputs = |tick: usize| Inputs {
            position: motion.at((block * BLOCK + tick) as f64 * period).0,
            age: 0.0,
            elapsed: period,
            interval: period,
        };
        let inputs: Vec<Inputs> = (0..BLOCK).map(inputs).collect();
        timed(|| inputs.iter().for_each(|inputs| assert_eq!(haptics.tick(&mut state, inputs).fault, None))).0
    };
    (0..blocks).map(block).collect()
}

/// The tick before a frame, with the proxy at `q`.
fn latest(q: &JointVector, share: f64) -> Latest {
    Latest { proxy: *q, share, dent: Some(0.0), ..Latest::default() }
}

/// Time that `work` takes (s), and what it made.
fn timed<T>(work: impl FnOnce() -> T) -> (f64, T) {
    let start = Instant::now();
    let made = work();
    (start.elapsed().as_secs_f64(), made)
}

/// Seconds that `work` takes of each of `count` variants, which answers with those of each of its blocks: the least of
/// the rounds, summed over blocks.
fn in_turns(rounds: usize, count: usize, mut work: impl FnMut(usize) -> Vec<f64>) -> Vec<f64> {
    let mut least: Vec<Vec<f64>> = vec![Vec::new(); count];
    for round in 0..rounds {
        for step in 0..count {
            let k = if round % 2 == 0 { step } else { count - 1 - step };
            let blocks = work(k);
            least[k].resize(blocks.len(), f64::INFINITY);
            least[k].iter_mut().zip(blocks).for_each(|(least, seconds)| *least = least.min(seconds));
        }
    }
    least.iter().map(|blocks| blocks.iter().sum()).collect()
}
