//! The rounds in which the variants of a scene are haptized, felt and drawn.

use super::{
    super::{AccuracyError, Cost, dynamics::deepest},
    Baseline, Costs, Effects, Price,
};
use crate::{
    JointVector,
    dataset::Dataset,
    device::{Motion, Recorded},
    gpu::{AdapterChoice, Context, FrameCost, FrameError, FrameMethod, FrameUpdate},
    render::{
        graphics::{ContactForces, Graphics, Smoothing},
        session::{self, Driver},
        setup::Setup,
        trace::Trace,
    },
    scene::{EFFECTS, Effect, Scene, Waypoint},
    sweep::{OTHER_ADAPTER, baked, remedied},
};
use glam::DVec3;
use std::{collections::BTreeSet, sync::Arc, time::Instant};

/// Configuration, and share of the forces, of a frame.
type Place = (JointVector, f64);

/// A variant of the scene.
struct Variant {
    name: String,
    setting: String,
    scene: Scene,
    /// For an effect: the numbers of the whole scene with it and without it.
    within: Option<[usize; 2]>,
}

/// Seconds of each variant in each round; none where the variant does not do the work.
type Times = Vec<Option<Vec<f64>>>;

/// Prices the effects of `scene` in so many rounds. `progress` receives the name of the next step.
///
/// # Errors
/// When a variant cannot be haptized, felt or drawn. A machine without a GPU is none: a note says so.
pub fn price(scene: &Scene, rounds: usize, progress: &mut dyn FnMut(&str)) -> Result<Effects, AccuracyError> {
    let mut notes = Vec::new();
    let (variants, priced) = variants(scene, &mut notes)?;
    let timed = (rounds, variants.len());
    progress("effects: bake");
    let (datasets, bakes) = bake_all(&variants, timed)?;
    let setups: Vec<Setup> = datasets.iter().map(Setup::new).collect::<Result<_, _>>()?;
    progress("effects: ticks");
    let motion = motion(scene, &datasets[0])?;
    let plain = &setups[PLAIN];
    let plan = plain.plan(&datasets[PLAIN], motion.duration(), 0);
    let felt = session::run(&plain.haptics, &mut Recorded::new(motion.clone()), None, &plan)?;
    let (ticks, faults) = feel_all(&setups, &motion, plan.ticks / BLOCK + 1, timed)?;
    if !faults.is_empty() {
        let names: Vec<&str> = faults.into_iter().map(|k| variants[k].name.as_str()).collect();
        notes.push(format!("the loop let go along the motion, so that its tick is too cheap: {}", names.join(", ")));
    }
    progress("effects: frames");
    let places = places(&setups, &felt, motion.duration());
    let frames = draw_all(&setups, &datasets, &places, timed)?;
    let mut device = match on_the_device(&setups, &datasets) {
        Ok(device) => device,
        Err(error) => {
            let why = remedied(&error.to_string(), OTHER_ADAPTER);
            notes.push(format!("frames on a GPU are not priced: {why}"));
            Device { adapter: None, bodies: variants.iter().map(|_| None).collect() }
        }
    };
    let gpu_places = match &mut device.bodies[GRAPHICS] {
        Some(body) => fitting(&places, |place| body.play(place))?,
        None => Vec::new(),
    };
    let gpu_frames = by_rounds(timed, TRIES, |k| {
        let Some(body) = &mut device.bodies[k] else { return Ok(None) };
        let begun = Instant::now();
        body.play(&gpu_places)?;
        Ok(Some(vec![begun.elapsed().as_secs_f64() / gpu_places.len() as f64]))
    })?;
    let takes = |k: usize| match (&device.bodies[k], &device.adapter) {
        (Some(body), _) => Some(body.update.takes()),
        (None, adapter) => adapter.as_ref().map(|_| FrameCost::default()),
    };
    let sizes: Vec<usize> = datasets.iter().map(|dataset| dataset.summary().bytes).collect();
    // Costs of variant k over those of `plain`, and of `drawn` for what is drawn.
    let costs = |k: usize, plain: usize, drawn: usize| {
        let bytes = |k: usize| takes(k).map_or(0.0, |takes| takes.bytes as f64);
        Costs {
            bake: cost(&bakes, k, plain).unwrap_or_default(),
            tick: cost(&ticks, k, plain).unwrap_or_default(),
            frame: cost(&frames, k, drawn),
            gpu_frame: cost(&gpu_frames, k, drawn),
            device: (bytes(drawn) > 0.0).then(|| bytes(k) / bytes(drawn)),
            dataset: sizes[k] as f64 / sizes[plain] as f64,
        }
    };
    let price = |k: usize| Price {
        name: variants[k].name.clone(),
        setting: variants[k].setting.clone(),
        alone: costs(k, PLAIN, GRAPHICS),
        within: variants[k].within.map(|[with, without]| costs(with, without, without)),
        device: takes(k),
        dataset_bytes: sizes[k],
    };
    let least = |times: &Times, k: usize| times[k].as_ref().map(|times| Cost::of(times).least);
    let contacts = felt.ticks.iter().filter(|tick| tick.sample.contact).count();
    Ok(Effects {
        baseline: Baseline {
            bake: least(&bakes, PLAIN).unwrap_or(0.0),
            tick: least(&ticks, PLAIN).unwrap_or(0.0),
            frame: least(&frames, GRAPHICS).unwrap_or(0.0),
            gpu_frame: least(&gpu_frames, GRAPHICS),
        },
        prices: (0..priced).map(price).collect(),
        in_contact: contacts as f64 / felt.ticks.len().max(1) as f64,
        nodes: setups.iter().find_map(|setup| setup.object.as_ref()).map_or(0, |object| object.rest.len()),
        adapter: device.adapter,
        notes,
        rounds,
    })
}

/// Haptizes all variants in each round; the datasets, and the times.
fn bake_all(variants: &[Variant], timed: (usize, usize)) -> Result<(Vec<Dataset>, Times), AccuracyError> {
    let mut datasets: Vec<Option<Dataset>> = variants.iter().map(|_| None).collect();
    let times = by_rounds(timed, 1, |k| {
        let begun = Instant::now();
        let (dataset, _) = baked(&variants[k].scene)?;
        let seconds = begun.elapsed().as_secs_f64();
        datasets[k] = Some(dataset);
        Ok(Some(vec![seconds]))
    })?;
    Ok((datasets.into_iter().flatten().collect(), times))
}

/// Feels all variants along `motion`, in so many blocks of ticks; the times, and the variants whose loop had a fault.
fn feel_all(
    setups: &[Setup],
    motion: &Motion,
    blocks: usize,
    timed: (usize, usize),
) -> Result<(Times, BTreeSet<usize>), AccuracyError> {
    let mut faults = BTreeSet::new();
    let times = by_rounds(timed, TRIES, |k| {
        let haptics = &setups[k].haptics;
        let mut device = Recorded::new(motion.clone());
        let mut driver = Driver::new(haptics, &mut device, None)?;
        let mut fault = false;
        let block = |_| {
            let begun = Instant::now();
            for _ in 0..BLOCK {
                fault |= driver.tick(haptics.period(), haptics.period()).0.fault.is_some();
            }
            begun.elapsed().as_secs_f64() / (blocks * BLOCK) as f64
        };
        let seconds = (0..blocks).map(block).collect();
        if fault {
            faults.insert(k);
        }
        Ok(Some(seconds))
    })?;
    Ok((times, faults))
}

/// Configuration and share of the forces in each frame of the session `felt`: those of the plain scene for all
/// variants.
fn places(setups: &[Setup], felt: &Trace, duration: f64) -> Vec<Place> {
    let rate = setups.iter().find_map(|setup| setup.scene.graphics).map_or(0.0, |graphics| graphics.rate);
    let frames = (duration * rate) as usize;
    (0..frames)
        .map(|frame| felt.ticks[frame * felt.ticks.len() / frames].proxy)
        .map(|q| (q, setups[PLAIN].haptics.field().sample(&q)))
        .map(|(q, sample)| (q, if sample.contact { sample.share } else { 0.0 }))
        .collect()
}

/// As many of `places` as can be drawn within [`FRAMES_TIME`], all along the way. `draw` draws some; its first time
/// does not count.
fn fitting(
    places: &[Place],
    mut draw: impl FnMut(&[Place]) -> Result<(), FrameError>,
) -> Result<Vec<Place>, FrameError> {
    let one = &places[..places.len().min(1)];
    draw(one)?;
    let begun = Instant::now();
    draw(one)?;
    let most = (FRAMES_TIME / begun.elapsed().as_secs_f64().max(1e-9)).max(1.0) as usize;
    Ok(places.iter().step_by(places.len().div_ceil(most).max(1)).copied().collect())
}

/// Draws the frames at `places` of all variants, on the CPU; the times.
fn draw_all(
    setups: &[Setup],
    datasets: &[Dataset],
    places: &[Place],
    timed: (usize, usize),
) -> Result<Times, AccuracyError> {
    let mut drawn: Vec<Option<Graphics<'_>>> =
        setups.iter().zip(datasets).map(|(setup, data)| setup.graphics(data)).collect::<Result<_, _>>()?;
    let places = match &mut drawn[GRAPHICS] {
        Some(graphics) => fitting(places, |some| {
            some.iter().for_each(|(q, share)| graphics.frame(q, *share));
            Ok(())
        })?,
        None => Vec::new(),
    };
    by_rounds(timed, TRIES, |k| {
        let Some(graphics) = &mut drawn[k] else { return Ok(None) };
        let frame = |(q, share): &Place| {
            let begun = Instant::now();
            graphics.frame(q, *share);
            begun.elapsed().as_secs_f64() / places.len() as f64
        };
        Ok(Some(places.iter().map(frame).collect()))
    })
}

/// Numbers of the two baselines among the variants.
const PLAIN: usize = 0;
const GRAPHICS: usize = 1;

/// Plain, graphics, each effect that can act, and the whole; and how many of them are priced. After them the whole with
/// each effect that it lacks, or without one that it has.
fn variants(scene: &Scene, notes: &mut Vec<String>) -> Result<(Vec<Variant>, usize), AccuracyError> {
    let variant = |name: &str, setting: String, scene| Variant { name: name.to_owned(), setting, scene, within: None };
    let mut variants = vec![
        variant("plain", String::new(), scene.with_effects(false, &[])?),
        variant("graphics", String::new(), scene.with_effects(true, &[])?),
    ];
    let mut can_act: Vec<Effect> = Vec::new();
    for effect in EFFECTS {
        match scene.with_effects(false, &[effect]) {
            Ok(with) => variants.push(variant(effect.key, effect.value(scene).to_string(), with)),
            Err(error) => {
                notes.push(format!("{} is not priced: {error}", effect.key));
                continue;
            }
        }
        can_act.push(effect);
    }
    let (graphics, whole) = whole(scene, &can_act);
    let setting = whole.iter().map(|effect| effect.key).collect::<Vec<_>>().join(", ");
    variants.push(variant("whole", setting, scene.with_effects(graphics, &whole)?));
    let priced = variants.len();
    for (k, effect) in (GRAPHICS + 1..).zip(can_act) {
        let is_in = whole.contains(&effect);
        let mut others: Vec<Effect> = whole.iter().copied().filter(|other| *other != effect).collect();
        if !is_in {
            others.push(effect);
        }
        let Ok(other) = scene.with_effects(graphics, &others) else { continue };
        let (same, changed) = (priced - 1, variants.len());
        variants[k].within = Some(if is_in { [same, changed] } else { [changed, same] });
        let how = if is_in { "without" } else { "with" };
        variants.push(variant(&format!("whole {how} {}", effect.key), String::new(), other));
    }
    Ok((variants, priced))
}

/// Whether the whole scene is drawn, and its effects: those that it names; where it names none, all of `can_act` that
/// can act together.
fn whole(scene: &Scene, can_act: &[Effect]) -> (bool, Vec<Effect>) {
    let named: Vec<Effect> = EFFECTS.into_iter().filter(|effect| effect.is_named(scene)).collect();
    if !named.is_empty() {
        return (scene.graphics.is_some(), named);
    }
    let mut together = Vec::new();
    for effect in can_act {
        together.push(*effect);
        if scene.with_effects(true, &together).is_err() {
            together.pop();
        }
    }
    (true, together)
}

/// Runs of a loop in one round. Of each of its blocks the fastest counts: the work of a block is the same in every run,
/// and whatever else a machine does only adds to it.
const TRIES: usize = 3;

/// Time that the frames of one run take, about (s): with all variants, rounds and tries there are some hundred runs.
const FRAMES_TIME: f64 = 0.2;

/// Ticks of a block: a tenth of a millisecond, which is mostly not interrupted, and long enough for any clock.
const BLOCK: usize = 100;

/// Seconds that `work` takes of each variant, round by round: the sum of its blocks, each the least of `tries`.
fn by_rounds(
    (rounds, count): (usize, usize),
    tries: usize,
    mut work: impl FnMut(usize) -> Result<Option<Vec<f64>>, AccuracyError>,
) -> Result<Times, AccuracyError> {
    let mut times: Times = vec![Some(Vec::new()); count];
    for round in 0..rounds.max(1) {
        for step in 0..count {
            let k = if round % 2 == 0 { step } else { count - 1 - step };
            let mut blocks = work(k)?;
            for _ in 1..tries {
                if let (Some(blocks), Some(again)) = (&mut blocks, work(k)?) {
                    blocks.iter_mut().zip(again).for_each(|(least, seconds)| *least = least.min(seconds));
                }
            }
            times[k] = times[k].take().zip(blocks).map(|(mut times, blocks)| {
                times.push(blocks.iter().sum());
                times
            });
        }
    }
    Ok(times)
}

/// Times of variant `k` over the least of `baseline`.
fn cost(times: &Times, k: usize, baseline: usize) -> Option<Cost> {
    let (times, whole) = times[k].as_ref().zip(times[baseline].as_ref())?;
    Some(Cost::of(times).over(Cost::of(whole).least))
}

/// The scene's first motion; where it has none, from the grid point farthest from contact to the deepest, and back.
fn motion(scene: &Scene, own: &Dataset) -> Result<Motion, AccuracyError> {
    let named = [&scene.motion.press, &scene.motion.scrape].into_iter().find(|waypoints| !waypoints.is_empty());
    let gap = |point: &usize| own.gap.as_ref().map_or(0.0, |gap| gap[*point]);
    let freest = (0..own.grid.points()).max_by(|a, b| gap(a).total_cmp(&gap(b))).unwrap_or(0);
    let way = [(0.0, freest), (2.0, deepest(own)), (3.0, deepest(own)), (5.0, freest)];
    let waypoints = named
        .cloned()
        .unwrap_or_else(|| way.map(|(time, point)| Waypoint { time, q: own.grid.configuration(point) }).to_vec());
    Ok(Motion::through(&waypoints, own.grid.joints())?)
}

/// The object on the GPU.
struct Device {
    adapter: Option<String>,
    /// One per variant; none without graphics.
    bodies: Vec<Option<Body>>,
}

/// The object of one variant on the GPU: forces are interpolated and smoothed by the host.
struct Body {
    contact: ContactForces,
    forces: Vec<DVec3>,
    smoothing: Option<Smoothing>,
    update: FrameUpdate,
}

impl Body {
    /// A frame for each of `places`, and a wait for the last.
    fn play(&mut self, places: &[Place]) -> Result<(), FrameError> {
        for (q, share) in places {
            self.contact.at(q, *share, &mut self.forces);
            let forces = match &mut self.smoothing {
                Some(smoothing) => smoothing.toward(&self.forces),
                None => &self.forces,
            };
            self.update.step(forces)?;
        }
        self.update.read()?;
        Ok(())
    }
}

fn on_the_device(setups: &[Setup], datasets: &[Dataset]) -> Result<Device, AccuracyError> {
    let context = Arc::new(Context::open(AdapterChoice::Any).map_err(FrameError::from)?);
    let body = |(setup, data): (&Setup, &Dataset)| -> Result<Option<Body>, AccuracyError> {
        let (Some(object), Some(graphics)) = (&setup.object, &setup.scene.graphics) else { return Ok(None) };
        let (nodes, period) = (object.rest.len(), 1.0 / graphics.rate);
        let method = FrameMethod::suitable(object);
        Ok(Some(Body {
            contact: ContactForces::new(data, nodes)?,
            forces: vec![DVec3::ZERO; nodes],
            smoothing: graphics.effects.smoothing.map(|time| Smoothing::new(time, period, nodes)),
            update: FrameUpdate::new(Arc::clone(&context), object, period, method, &graphics.effects)?,
        }))
    };
    let bodies = setups.iter().zip(datasets).map(body).collect::<Result<_, _>>()?;
    Ok(Device { adapter: Some(context.adapter().name.clone()), bodies })
}
