//! Contact solved while it is felt: what the loop misses, how much the torque errs and how it changes.
//!
//!     cargo bench --bench on_demand -- [SCENE [LEVELS [SECONDS [SPEED]]]]
//!
//! `SCENE`: by default datasets/organ.toml; `SPEED`: greatest speed of the tip between two places (m/s), by default
//! several, which are drawn in out/store. Time is simulated: for each millisecond of the loop the thread that solves
//! gets a millisecond of processor time, as one that has a core to itself. So other work on the machine changes the
//! figures little.

#![allow(clippy::unwrap_used)] // A benchmark may stop.

use haptize::{
    JointVector,
    contact::{Model, Solver, Status},
    dataset::{Dataset, Provenance},
    device::{Device, Motion, Recorded},
    draw::{
        colour,
        diagram::{Diagram, Series},
        plot::{Entry, Mark},
    },
    proxy::Chain,
    render::{
        live::{Followed, Live, LiveEnds},
        session::Driver,
        setup::Setup,
        trace::Tick,
    },
    report::write_both,
    scene::{Scene, Waypoint},
    store::{Space, Store},
    sweep::{
        ahead::{Ahead, Follower},
        build_object, grid_of,
    },
};
use rustix::time::{ClockId, clock_gettime};
use std::{path::Path, sync::Arc, time::Duration};

/// Greatest speeds of the tip between two places (m/s). At 0.4 m/s the roll turns faster than the device may
/// (`speed_limit`), and the loop stops such a walk with a fault.
const SPEEDS: [f64; 5] = [0.05, 0.1, 0.15, 0.2, 0.3];

/// Greatest speed of a minimum-jerk motion over its mean (1).
const MINIMUM_JERK: f64 = 1.875;

/// Processor time of this thread (s).
fn processor_time() -> f64 {
    let time = clock_gettime(ClockId::ThreadCPUTime);
    time.tv_sec as f64 + 1e-9 * time.tv_nsec as f64
}

/// Position of the last contact node (m).
fn tip(chain: &Chain, q: &[f64]) -> glam::DVec3 {
    chain.node_position(&chain.links(q), chain.nodes.len() - 1)
}

/// A walk through contact, at the speed of the tip: from one random place to another, as deep as `depths` say.
fn walk(scene: &Scene, chain: &Chain, solver: &mut Solver<'_>, seconds: f64, speed: f64) -> Motion {
    let grid = grid_of(scene);
    let mut seed = 24_u64;
    let mut random = || {
        seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (seed >> 11) as f64 / (1_u64 << 53) as f64
    };
    let mut before = scene.motion.press[0].q;
    let mut waypoints = vec![Waypoint { time: 0.0, q: before }, Waypoint { time: 0.2, q: before }];
    while waypoints.last().unwrap().time < seconds {
        let mut q = before;
        q.iter_mut().zip(&grid.axes).for_each(|(q, axis)| {
            *q = axis.start + (0.1 + 0.8 * random()) * axis.step * (axis.count - 1) as f64;
        });
        let gap = solver.gap(&q);
        if !(-0.012..0.004).contains(&gap) {
            continue;
        }
        // The way of the tip, in steps: the joints turn evenly.
        let places: Vec<_> = (0..=20)
            .map(|k| {
                let mut at = before;
                at.iter_mut().zip(q.iter()).for_each(|(at, to)| *at += f64::from(k) / 20.0 * (to - *at));
                tip(chain, &at)
            })
            .collect();
        let way: f64 = places.windows(2).map(|pair| pair[0].distance(pair[1])).sum();
        let time = waypoints.last().unwrap().time + MINIMUM_JERK * way / speed;
        waypoints.push(Waypoint { time, q });
        before = q;
    }
    Motion::through(&waypoints, scene.proxy.joints.len()).unwrap()
}

struct World<'a> {
    scene: &'a Scene,
    chain: &'a Chain,
    model: &'a Model<'a>,
    levels: u32,
}

impl World<'_> {
    /// Plays a session and tells of it.
    fn session(&self, device: &mut dyn Device, direct: bool, seconds: f64) -> Seen {
        let grid = grid_of(self.scene);
        let store = Arc::new(Store::new(Space::new(&grid, self.levels).unwrap(), 2_000_000));
        let ahead = Ahead::new(self.model, Arc::clone(&store));
        let dataset = Dataset::refined(Arc::clone(&store), grid, None, self.scene.text.clone(), Provenance::default());
        let setup = Setup::new(&dataset).unwrap();
        let start = *setup.haptics.start(&device.read(0.0).position).unwrap().proxy();
        let mut levers = JointVector::zeros(start.len());
        for bounds in self.chain.jacobian_bounds(&self.chain.joints.iter().map(|j| j.limits).collect::<Vec<_>>()) {
            levers.iter_mut().zip(bounds.iter()).for_each(|(lever, bound)| *lever = lever.max(*bound));
        }
        let followed = Followed { torque: direct, forces: false };
        let (live, ends) = Live::new(&start, self.levels, &levers, 1, followed);
        let LiveEnds { mut whereabouts, solutions, mut answers } = ends;
        let mut solver = ahead.solver();
        ahead.prepare(&start, 1, Duration::from_secs(600));
        println!("prepared: {:?}", ahead.solved());
        let mut driver = Driver::new(&setup.haptics, device, Some(live)).unwrap();
        let mut follower = Follower::new(self.model);
        let mut solutions = solutions;
        let (mut spent, mut spent_direct, mut ticks) = (0.0, 0.0_f64, Vec::<Tick>::new());
        let mut costs = Vec::new();
        for k in 0..(1000.0 * seconds) as u32 {
            ticks.push(driver.tick(1e-3, 1e-3).0);
            let now = 1e-3 * f64::from(k + 1);
            if let Some(solutions) = &mut solutions {
                // Solved in time if the one before is done.
                if spent_direct <= now {
                    let began = processor_time();
                    let solution = follower.solve(whereabouts[1].read());
                    let cost = processor_time() - began;
                    costs.push(cost);
                    spent_direct = spent_direct.max(now - 1e-3) + cost;
                    solutions.write(solution);
                }
            }
            while spent < now {
                let began = processor_time();
                if !ahead.advance(&mut solver, whereabouts[0].read(), true) {
                    spent = now;
                }
                spent += processor_time() - began;
            }
        }
        let seen = self.report(&ticks, &store);
        println!("{:?}\n{:?}, {} blocks", answers.read(), ahead.solved(), store.horizon());
        costs.sort_by(f64::total_cmp);
        if !costs.is_empty() {
            println!(
                "a solution: median {:.0} us, 99 % {:.0} us",
                1e6 * costs[costs.len() / 2],
                1e6 * costs[costs.len() * 99 / 100]
            );
        }
        seen
    }

    /// Errors along the way.
    fn report(&self, ticks: &[Tick], store: &Store) -> Seen {
        let mut solver = Solver::new(self.model);
        let (mut felt, mut full, mut size, mut contacts, mut steepest, mut exact) =
            (0.0, 0.0, 0.0, 0, 0.0_f64, 0.0_f64);
        let distance =
            |a: &JointVector, b: &JointVector| a.iter().zip(b.iter()).map(|(a, b)| (a - b).powi(2)).sum::<f64>();
        let mut last: Option<(usize, JointVector)> = None;
        for (k, tick) in ticks.iter().enumerate() {
            if k > 0 {
                steepest = steepest.max(distance(&tick.sample.torque, &ticks[k - 1].sample.torque).sqrt());
            }
            if k % 4 > 1 {
                continue;
            }
            let solved = solver.solve(&tick.proxy);
            if solved.status.is_failed() {
                continue;
            }
            if let Some((before, torque)) = last.replace((k, solved.torque))
                && before + 1 == k
            {
                exact = exact.max(distance(&torque, &solved.torque).sqrt());
            }
            contacts += usize::from(solved.status == Status::Contact);
            size += distance(&solved.torque, &JointVector::zeros(tick.proxy.len()));
            felt += distance(&solved.torque, &tick.sample.torque);
            full += distance(&solved.torque, &store.sample(&tick.proxy).torque());
        }
        let speeds = ticks
            .windows(2)
            .map(|pair| 1e3 * tip(self.chain, &pair[1].proxy).distance(tip(self.chain, &pair[0].proxy)));
        let (mut sum, mut fastest) = (0.0, 0.0_f64);
        speeds.for_each(|speed| {
            sum += speed;
            fastest = fastest.max(speed);
        });
        println!(
            "tip: mean {:.3} m/s, at most {fastest:.3}; {contacts} of {} solved places in contact",
            sum / ticks.len() as f64,
            ticks.len() / 2
        );
        println!(
            "error: felt {:.2} %, of the store at the end {:.2} % rms; steepest {steepest:.4} N m a tick, of direct \
             solves {exact:.4}",
            100.0 * (felt / size).sqrt(),
            100.0 * (full / size).sqrt()
        );
        let created =
            ticks.iter().map(|t| t.accounts.created() - t.accounts.taken_from_field()).fold(f64::MIN, f64::max);
        let residual =
            ticks.iter().map(|t| t.accounts.residual().abs() / t.accounts.exchanged.max(1e-6)).fold(0.0, f64::max);
        let port = ticks.iter().filter_map(|t| t.accounts.device_port()).fold(f64::MAX, f64::min);
        let odd = ticks.iter().filter(|t| !t.sample.torque.is_finite() || t.fault.is_some()).count();
        println!(
            "created less taken: at most {created:.2e} J; energy balance error at most {residual:.1e} of the energy \
             exchanged; the device's port at least {port:.2e} J; {odd} ticks not finite or at fault"
        );
        Seen { felt: (felt / size).sqrt(), steepest, exact }
    }
}

/// What a session showed.
struct Seen {
    /// Rms error over the rms torque, as felt (1).
    felt: f64,
    /// Greatest changes of the torque in a tick: as felt, and of direct solves (N m).
    steepest: f64,
    exact: f64,
}

/// Draws the sessions with the store and those with `direct` against the speed.
fn draw(seen: &[[Seen; 2]]) {
    let curve = |name: &str, colour, dashed, up: &dyn Fn(&[Seen; 2]) -> f64| Series {
        name: name.to_owned(),
        points: SPEEDS.iter().zip(seen).map(|(speed, seen)| (*speed, up(seen))).collect(),
        dashed,
        colour,
    };
    let mut sheet =
        Diagram::new("Six joints felt while they are solved", "one thread solves ahead; the store has two levels", 1);
    let speed = "Greatest speed of the tip between two places [m/s]";
    let errors =
        [curve("store", 0, false, &|[store, _]| store.felt), curve("direct", 1, false, &|[_, direct]| direct.felt)];
    sheet.panel(0, speed, "Rms error over rms torque [1]", &errors, &[]);
    let changes = [
        curve("", 0, false, &|[store, _]| store.steepest),
        curve("", 1, false, &|[_, direct]| direct.steepest),
        curve("", 2, true, &|[_, direct]| direct.exact),
    ];
    sheet.panel(1, speed, "Greatest change of the torque in a tick [N m]", &changes, &[]);
    let dashes = Entry { name: "direct solves".into(), colour: colour::series(2), mark: Mark::Dashes };
    sheet.legend(&errors, vec![dashes]);
    for file in write_both(Path::new("out/store"), "store-on-demand", &sheet.canvas()).unwrap() {
        println!("{}", file.display());
    }
}

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).filter(|word| !word.starts_with("--")).collect();
    let shipped = concat!(env!("CARGO_MANIFEST_DIR"), "/datasets/organ.toml").to_owned();
    let scene = Scene::load(Path::new(arguments.first().unwrap_or(&shipped))).unwrap();
    let levels = arguments.get(1).map_or(2, |levels| levels.parse().unwrap());
    let seconds = arguments.get(2).map_or(10.0, |seconds| seconds.parse().unwrap());
    let (object, chain) = (build_object(&scene).unwrap(), Chain::new(&scene.proxy));
    let mut model = Model::new(&object, &chain, scene.contact);
    model.with_tangent = true;
    let world = World { scene: &scene, chain: &chain, model: &model, levels };
    let play = |speed: f64| {
        [false, true].map(|direct| {
            println!("\n{}, {speed} m/s", if direct { "direct" } else { "store" });
            let motion = walk(&scene, &chain, &mut Solver::new(&model), seconds, speed);
            world.session(&mut Recorded::new(motion), direct, seconds)
        })
    };
    match arguments.get(3) {
        Some(speed) => drop(play(speed.parse().unwrap())),
        None => draw(&SPEEDS.map(play)),
    }
}
