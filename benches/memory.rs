//! What memory and friction do, in figures, and what they cost.
//!
//!     cargo bench --bench memory -- [FOLDER]
//!
//! Draws holds and presses, scrapes at four speeds, stick and slip, the energy of loops beside relaxed torques, and how
//! far friction lies above that of several contacts; `FOLDER` is out/memory by default. Then it prints what a tick costs
//! with either. The figures are those of docs/effects.md.

#![allow(clippy::unwrap_used)] // A benchmark may stop.

mod clock;

use clock::nanoseconds;
use haptize::{
    JointVector,
    contact::{Slip, exact_dissipation},
    dataset::{Dataset, SlipColumns},
    draw::{
        chart::{Lane, Stack},
        plot::Curve,
    },
    fixtures::{
        Random,
        worlds::{block, bump, half_space},
    },
    proxy::Chain,
    render::{
        haptic::{Inputs, Output},
        setup::Setup,
    },
    report::write_png,
    scene::Scene,
};
use std::{hint::black_box, path::Path};

/// Shares and times of the relaxation (1, s).
const TERMS: [[f64; 2]; 2] = [[0.4, 0.05], [0.2, 0.5]];

/// The proxy goes where the device goes.
const STIFF: &str = "[haptics]\ninterpolation = \"potential\"\ncoupling_stiffness = 1e6\ncoupling_damping = 50.0\n\
                     device_damping = 1e3\nproxy_damping = [2.0, 2.0]\nspeed_limit = 10.0\n";

/// How deep is pressed (m), and how far beside a point its dent is 1/e as deep (m).
const DEPTH: f64 = 0.01;
const DENT: f64 = 0.01;

/// Radius of the circle in the bump (m).
const CIRCLE: f64 = 0.02;
/// Loops a second, and loops.
const RATE: f64 = 2.0;
const LOOPS: f64 = 10.0;

/// Configurations of random contacts for each number of contacts.
const CONFIGURATIONS: usize = 4000;
const MOST_CONTACTS: usize = 7;

/// Blocks of ticks that are timed in a round, and ticks in each.
const BLOCKS: u32 = 100;
const TICKS: u32 = 200;
/// Rounds in which each variant has its turn.
const ROUNDS: usize = 20;

fn relaxation(more: &str) -> String {
    let [[a, b], [c, d]] = TERMS;
    format!("[object.relaxation]\nterms = [[{a}, {b}], [{c}, {d}]]\n{more}\n")
}

/// Ticks of a millisecond over `data` with the device at `position(t)`.
fn felt(data: &Dataset, seconds: f64, position: impl Fn(f64) -> [f64; 2]) -> Vec<Output> {
    let haptics = Setup::new(data).unwrap().haptics;
    let at = |k: usize| JointVector::from_slice(&position(1e-3 * k as f64));
    let mut state = haptics.start(&at(0)).unwrap();
    let tick = |k: usize| {
        let output = haptics.tick(&mut state, &Inputs { position: at(k), age: 0.0, elapsed: 1e-3, interval: 1e-3 });
        assert_eq!(output.fault, None);
        output
    };
    (0..(1e3 * seconds) as usize).map(tick).collect()
}

fn lane(title: &str, curves: Vec<Curve>) -> Lane {
    Lane { height: 170.0, ..Lane::new(title, curves) }
}

fn draw(folder: &Path, name: &str, [headline, across]: [&str; 2], lanes: Vec<Lane>) {
    let [headline, across] = [headline, across].map(str::to_owned);
    let stack = Stack { headline, across, lanes, contact: Vec::new() };
    println!("{}", write_png(folder, name, &stack.draw()).unwrap().display());
}

/// Every tenth tick, by time.
fn over_time(ticks: &[Output], of: impl Fn(&Output) -> f64) -> impl Iterator<Item = (f64, f64)> {
    ticks.iter().enumerate().step_by(10).map(move |(k, output)| (1e-3 * k as f64, of(output)))
}

/// Pressed in some time, held, and let go.
fn presses(folder: &Path) {
    let data = block(&(STIFF.to_owned() + &relaxation("")));
    let (mut forces, mut dents) = (Vec::new(), Vec::new());
    for (number, ramp) in [0.02, 0.2, 1.0].into_iter().enumerate() {
        let depth = |t: f64| if t < 2.5 { (DEPTH / ramp * t).min(DEPTH) } else { DEPTH - 0.2 * (t - 2.5) };
        let ticks = felt(&data, 4.0, |t| [0.0, depth(t).max(-0.002)]);
        let name = format!("pressed in {ramp} s");
        forces.push(Curve::new(name.clone(), number, over_time(&ticks, |output| -output.sample.torque[1])));
        dents.push(Curve::new(name, number, over_time(&ticks, |output| 100.0 * output.dent.unwrap())));
        let held = -ticks[2400].sample.torque[1];
        let most = ticks.iter().map(|output| -output.sample.torque[1]).fold(0.0, f64::max);
        println!("pressed in {ramp} s: {most:.2} N at most, {held:.2} N after 2.4 s");
    }
    let lanes = vec![lane("force [N]", forces), lane("dent left [%]", dents)];
    draw(folder, "memory-press", ["Press, hold, let go after 2.5 s", "time [s]"], lanes);
}

/// Pressed for a second, then along at four speeds.
fn scrapes(folder: &Path) {
    let data = block(&(STIFF.to_owned() + &relaxation(&format!("dent = {DENT}"))));
    let mut curves = Vec::new();
    for (number, speed) in [0.5, 2.0, 8.0, 32.0].into_iter().enumerate() {
        let along = |t: f64| -0.05 + speed * DENT * (t - 1.0).max(0.0);
        let ticks = felt(&data, 1.0 + 8.0 / speed, |t| [along(t), (0.2 * t).min(DEPTH)]);
        let place = |output: &Output| (output.proxy[0] + 0.05) / DENT;
        let rows = ticks.iter().skip(1000).map(|output| (place(output), -output.sample.torque[1]));
        let last = -ticks.last().unwrap().sample.torque[1];
        println!("scraped at {speed} dents/s: {last:.2} N after 8 dents");
        curves.push(Curve::new(format!("{speed} dents/s"), number, rows));
    }
    let texts = ["Pressed for a second, then scraped", "way over the width of a dent [1]"];
    draw(folder, "memory-scrape", texts, vec![lane("force [N]", curves)]);
}

/// A soft hand that drags the finger along.
fn stick_and_slip(folder: &Path) {
    let coupling = "[haptics]\ncoupling_stiffness = 300.0\nproxy_damping = [0.5, 2.0]\n";
    let friction = |more: &str| format!("{coupling}[haptics.friction]\ncoefficient = 0.3\n{more}\n");
    let (mut forces, mut places) = (Vec::new(), Vec::new());
    for (number, (name, more)) in
        [("static 0.6, kinetic 0.3", "static_coefficient = 0.6"), ("0.3 alone", "")].into_iter().enumerate()
    {
        let ticks = felt(&block(&friction(more)), 3.0, |t| [0.02 * (t - 0.5).max(0.0), (0.2 * t).min(0.02)]);
        forces.push(Curve::new(name, number, over_time(&ticks, |output| -output.torque[0])));
        places.push(Curve::new(name, number, over_time(&ticks, |output| 1e3 * output.proxy[0])));
    }
    let lanes = vec![lane("force along [N]", forces), lane("finger [mm]", places)];
    draw(folder, "memory-stick-slip", ["Dragged along at 20 mm/s by a soft hand", "time [s]"], lanes);
}

/// Round the bump again and again: what the object gives, and what it would give if each joint's torque relaxed.
fn loops(folder: &Path) {
    let data = bump(&(STIFF.to_owned() + &relaxation("")));
    let ticks = felt(&data, LOOPS / RATE, |t| {
        let (sin, cos) = (std::f64::consts::TAU * RATE * t).sin_cos();
        [CIRCLE * cos, CIRCLE * sin]
    });
    let field = Setup::new(&data).unwrap().haptics;
    let field = field.source().field().unwrap();
    let lasting = 1.0 - TERMS.iter().map(|[share, _]| share).sum::<f64>();
    let (mut past, mut given, mut sums) = (TERMS.map(|_| [0.0; 2]), 0.0, Vec::new());
    let first = field.sample(&ticks[0].proxy).torque;
    let mut last = (ticks[0].proxy, first, first);
    for output in &ticks {
        let torque = field.sample(&output.proxy).torque;
        let mut relaxed = torque;
        for joint in 0..2 {
            relaxed[joint] *= lasting;
            for (past, [share, time]) in past.iter_mut().zip(TERMS) {
                past[joint] = (-1e-3 / time).exp() * past[joint] + share * (torque[joint] - last.1[joint]);
                relaxed[joint] += past[joint];
            }
            given += 0.5 * (last.2[joint] + relaxed[joint]) * (output.proxy[joint] - last.0[joint]);
        }
        last = (output.proxy, torque, relaxed);
        sums.push(given);
    }
    let time = |k: usize| 1e-3 * k as f64;
    let qlv = (0..sums.len()).step_by(10).map(|k| (time(k), sums[k]));
    let ours = over_time(&ticks, |output| output.accounts.field_work);
    let a_loop = (1e3 / RATE) as usize;
    let rise = sums[sums.len() - 1] - sums[sums.len() - 1 - a_loop];
    let own = ticks[ticks.len() - 1].accounts.field_work - ticks[ticks.len() - 1 - a_loop].accounts.field_work;
    println!(
        "the last loop gives {:.3} mJ where torques relax, {:.1e} mJ where the root of the energy does",
        1e3 * rise,
        1e3 * own
    );
    let curves =
        vec![Curve::new("each torque relaxes (QLV)", 1, qlv), Curve::new("the root of the energy relaxes", 0, ours)];
    let texts = ["Round a bump, two loops a second", "time [s]"];
    draw(folder, "memory-loops", texts, vec![lane("energy given [J]", curves)]);
}

/// Friction of several contacts together over that of each alone, by the number of contacts.
fn several(folder: &Path) {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/datasets/sphere.toml");
    let chain = Chain::new(&Scene::load(path).unwrap().proxy);
    let (mut random, mut curves) = (Random::new(1), [Vec::new(), Vec::new(), Vec::new()]);
    for count in 1..=MOST_CONTACTS {
        let mut vector = || glam::DVec3::from_array([(); 3].map(|()| random.normal()));
        let mut ratios: Vec<f64> = (0..CONFIGURATIONS)
            .map(|_| {
                let [q, rates] = [vector(), vector()].map(|v| v.to_array());
                let nodes = chain.nodes.len() as f64;
                let forces: Vec<_> =
                    (0..count).map(|_| ((vector().x.abs() * 7919.0 % nodes) as u32, vector())).collect();
                let together = Slip::of(&chain, &q, forces.iter().copied()).dissipation(&rates);
                together / exact_dissipation(&chain, &q, forces.iter().copied(), &rates)
            })
            .collect();
        ratios.sort_by(f64::total_cmp);
        let [middle, high, most] = [ratios.len() / 2, ratios.len() * 19 / 20, ratios.len() - 1].map(|k| ratios[k]);
        println!("{count} contacts: friction {middle:.3} times theirs (median), {high:.3} (95 %), {most:.3} at most");
        for (curve, ratio) in curves.iter_mut().zip([middle, high, most]) {
            curve.push((count as f64, ratio));
        }
    }
    let names = ["median", "95 %", "most"];
    let curves = curves.into_iter().zip(names).enumerate();
    let curves = curves.map(|(number, (points, name))| Curve::new(name, number, points)).collect();
    let texts = ["Friction of all contacts together over that of each", "contacts with random forces"];
    draw(folder, "memory-several", texts, vec![lane("ratio [1]", curves)]);
}

/// What a tick costs over three joints: plain, with two terms, and with friction (ns); the least of rounds in turns.
fn prices() {
    let loops = ["", &relaxation(""), "[haptics.friction]\ncoefficient = 0.4\n"].map(|effect| {
        let mut data = half_space(3, &format!("[haptics]\ninterpolation = \"potential\"\n{effect}"));
        let points = data.grid.points();
        let force = |point: usize| data.torque(point).iter().map(|tau| tau * tau).sum::<f64>().sqrt() as f32;
        data.slip = Some(SlipColumns {
            normal_force: (0..points).map(force).collect::<Vec<_>>().into(),
            jacobian: [0.1, 0.0, 0.1, 0.0, 0.0, 0.1].repeat(points).into(),
        });
        Setup::new(&data).unwrap().haptics
    });
    let mut least = [f64::INFINITY; 3];
    for _ in 0..ROUNDS {
        for (least, haptics) in least.iter_mut().zip(&loops) {
            let mut state = haptics.start(&JointVector::from_slice(&[0.1; 3])).unwrap();
            let spent = nanoseconds(BLOCKS, TICKS, |k| {
                let position =
                    JointVector::from_slice(&[0, 1, 2].map(|a| 0.12 + 0.05 * (2e-3 * k + f64::from(a)).sin()));
                let inputs = Inputs { position, age: 0.0, elapsed: 1e-3, interval: 1e-3 };
                black_box(haptics.tick(&mut state, black_box(&inputs)));
            });
            *least = least.min(spent);
        }
    }
    let [plain, memory, friction] = least;
    println!(
        "a tick of three joints: {plain:.0} ns; two terms {:+.0} ns, friction {:+.0} ns",
        memory - plain,
        friction - plain
    );
}

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).filter(|argument| !argument.starts_with("--")).collect();
    let folder = Path::new(arguments.first().map_or("out/memory", String::as_str));
    presses(folder);
    scrapes(folder);
    stick_and_slip(folder);
    loops(folder);
    several(folder);
    prices();
}
