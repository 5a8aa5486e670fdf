//! Contact that is solved while it is felt: no jump, no energy from nowhere, no allocation, and the same store whoever
//! solved it.

use super::world::World;
use assert_no_alloc::assert_no_alloc;
use haptize::{
    JointVector,
    contact::{Solver, Status},
    dataset::{Dataset, Provenance, Surface},
    device::Motion,
    render::{
        live::{Answers, Followed, Live},
        on_demand::OnDemand,
        recording::Recording,
        session::{Driver, SessionError},
        setup::{Setup, labels},
        trace::Trace,
    },
    scene::Waypoint,
    store::{Space, Store},
    sweep::{
        ahead::{Ahead, Follower, Whereabouts},
        grid_of,
    },
};
use std::{sync::Arc, thread};

const LEVELS: u32 = 3;

impl World {
    /// Two joints beside a ball.
    fn new() -> Self {
        Self::with(2)
    }

    /// The same arm with as many joints, those beyond two in its wrist.
    fn with(joints: usize) -> Self {
        let mut text = include_str!("../scenes/small.toml").to_owned();
        for k in 2..joints {
            text = text.replace("count = 9 }", "count = 9 }, { start = -0.2, step = 0.2, count = 3 }");
            let axis = ["[0, 0, 1]", "[0, 1, 0]"][k % 2];
            let wrist = format!(
                "[[proxy.joint]]\nname = \"wrist {k}\"\nkind = \"revolute\"\naxis = {axis}\nlimits = [-1, 1]\nnodes = ["
            );
            text = text.replace("nodes = [", &wrist);
        }
        Self::of(&text)
    }

    fn store(&self) -> Arc<Store> {
        Arc::new(Store::new(Space::new(&grid_of(&self.scene), LEVELS).unwrap(), 40_000))
    }

    fn dataset(&self, store: &Arc<Store>) -> Dataset {
        let surface = Some(Surface::of(&self.object));
        let (grid, text) = (grid_of(&self.scene), self.scene.text.clone());
        Dataset::refined(Arc::clone(store), grid, surface, text, Provenance::default())
    }

    /// From one random place of the grid to another, four in a second.
    fn motion(&self, seconds: usize, seed: u64) -> Motion {
        let mut random = crate::fixture::Random(seed);
        let grid = grid_of(&self.scene);
        let mut place = || {
            // The slide from where contact begins on.
            let q = grid.axes.iter().map(|axis| {
                let (first, last) = (axis.start, axis.coordinate(axis.count - 1));
                let least = if axis.unit == "m" { 0.8 } else { 0.0 };
                first + (least + (1.0 - least) * 0.5 * (1.0 + random.next())) * (last - first)
            });
            JointVector::from_slice(&q.collect::<Vec<_>>())
        };
        let waypoints: Vec<Waypoint> =
            (0..=4 * seconds).map(|k| Waypoint { time: 0.25 * k as f64, q: place() }).collect();
        Motion::through(&waypoints, grid.joints()).unwrap()
    }
}

/// Ticks of a session, with a batch of blocks solved after each `every`-th.
fn session(
    seed: u64,
    seconds: usize,
    every: usize,
    mut check: impl FnMut(&haptize::render::trace::Tick),
) -> (Answers, Arc<Store>) {
    let world = World::new();
    let (model, store) = (world.model(), world.store());
    let ahead = Ahead::new(&model, Arc::clone(&store));
    let setup = Setup::new(&world.dataset(&store)).unwrap();
    let mut hand = setup.hand(world.motion(seconds, seed)).unwrap();
    let start = world.motion(seconds, seed).at(0.0).0;
    let levers = JointVector::from_slice(&[0.1, 1.0]);
    let (live, mut ends) = Live::new(&start, LEVELS, &levers, 1, Followed::default());
    let mut driver = Driver::new(&setup.haptics, &mut hand, Some(live)).unwrap();
    let mut solver = ahead.solver();
    for k in 0..1000 * seconds {
        let (tick, _) = assert_no_alloc(|| driver.tick(1e-3, 1e-3));
        check(&tick);
        if k % every == every - 1 {
            ahead.advance(&mut solver, ends.whereabouts[0].read(), true);
        }
    }
    (*ends.answers.read(), store)
}

#[test]
fn a_session_on_demand_is_replayed_as_it_was_felt_wherever_its_store_has_come_since() {
    let world = World::new();
    let setup = Setup::new(&world.dataset(&world.store())).unwrap();
    let mut trace = Trace { joints: labels(&grid_of(&world.scene)), ..Trace::default() };
    trace.solved_meanwhile = true;
    trace.start = world.motion(4, 24).at(0.0).0;
    let (answers, _) = session(24, 4, 400, |tick| trace.ticks.push(*tick));
    assert!(answers.changes > 0 && trace.ticks.iter().any(|tick| tick.sample.contact), "{answers:?}");
    let file = tempfile::NamedTempFile::new().unwrap();
    let replayed = |trace: &Trace| {
        Recording::write(trace, &mut file.as_file()).unwrap();
        let recording = Recording::read(file.path(), 2).unwrap();
        let again = recording.replay(&setup.haptics, None, trace.joints.clone()).unwrap();
        (recording.first_difference(&again), again)
    };
    let (difference, again) = replayed(&trace);
    assert_eq!(difference, None);
    assert!(again == trace);
    // The store by itself, in which nothing was solved, says something else.
    file.as_file().set_len(0).unwrap();
    std::io::Seek::rewind(&mut file.as_file()).unwrap();
    assert!(replayed(&Trace { solved_meanwhile: false, ..trace }).0.is_some());
}

#[test]
fn what_arrives_while_it_is_felt_makes_no_jump_and_no_energy_from_nowhere() {
    let mut changes = 0;
    for seed in [24, 25, 26] {
        let mut before: Option<JointVector> = None;
        let (mut steepest, mut contact) = (0.0_f64, 0);
        let (answers, _) = session(seed, 20, 400, |tick| {
            assert!(tick.sample.torque.is_finite() && tick.fault.is_none(), "{tick:?}");
            let accounts = &tick.accounts;
            // The field, arrivals included, gives no more than the proxy's damping takes.
            assert!(accounts.created() <= accounts.taken_from_field() + 1e-12, "{accounts:?}");
            assert!(accounts.residual().abs() <= 1e-10 * accounts.exchanged.max(1e-6), "{accounts:?}");
            assert!(accounts.device_port().unwrap() > -1e-9, "{accounts:?}");
            if let Some(before) = before {
                // The turning joint's, in N m.
                steepest = steepest.max((tick.sample.torque[0] - before[0]).abs());
            }
            before = Some(tick.sample.torque);
            contact += usize::from(tick.sample.contact);
        });
        assert_eq!(answers.ticks, 20_000);
        assert_eq!(answers.by_levels.iter().sum::<u64>(), answers.ticks);
        assert!(contact > 2000 && answers.coarser > 1000 && answers.coarser < answers.ticks, "{contact} {answers:?}");
        changes += answers.changes;
        // Without the passage the torque would jump by as much, which is far more than any motion changes it by in a
        // tick.
        let greatest = answers.greatest_change.into_iter().fold(0.0, f64::max);
        assert!(greatest > 3.0 * steepest, "{steepest} N m in a tick, {answers:?}");
        assert!(answers.given > 0.0 && answers.taken > 0.0, "{answers:?}");
    }
    assert!(changes > 20, "{changes}");
}

#[test]
fn solved_in_time_nothing_is_missed() {
    let (answers, store) = session(24, 2, 1, |_| ());
    // The first ticks find nothing.
    assert!(answers.coarser < 200, "{answers:?}");
    assert!(store.horizon() > 50);
}

#[test]
fn what_was_explored_is_what_a_bake_of_the_same_blocks_is_to_the_bit() {
    [2, 3, 6].into_iter().for_each(explored_is_baked);
}

fn explored_is_baked(joints: usize) {
    let world = World::with(joints);
    let model = world.model();
    let store = world.store();
    let ahead = Ahead::new(&model, Arc::clone(&store));
    // Three threads, each about its own business.
    thread::scope(|scope| {
        for k in 0..3 {
            let (ahead, world) = (&ahead, &world);
            scope.spawn(move || {
                let mut solver = ahead.solver();
                for step in 0..40 {
                    let (position, velocity) = world.motion(4, 24).at(0.1 * f64::from(step) + 0.01 * f64::from(k));
                    ahead.advance(&mut solver, &Whereabouts { position, velocity, tick: 0 }, true);
                }
                // To the finest level at the last place.
                let last = Whereabouts::at_rest(&world.motion(4, 24).at(3.9 + 0.01 * f64::from(k)).0);
                while ahead.advance(&mut solver, &last, false) {}
            });
        }
    });
    let [again, fewer] = [(); 2].map(|()| world.store());
    let other = Ahead::new(&model, Arc::clone(&again));
    let mut solver = other.solver();
    let blocks = store.blocks();
    assert!(blocks.len() > 60, "{}", blocks.len());
    for (key, block) in &blocks {
        let (level, place) = store.space().block(*key).unwrap();
        assert!(other.solve(&mut solver, level, &place));
        assert_eq!(again.get(level, &place).unwrap().nodes(), block.nodes());
        if fewer.horizon() + 1 < blocks.len() as u64 {
            fewer.publish(level, &place, block.nodes().clone()).unwrap();
        }
    }
    assert!(blocks.iter().any(|(key, _)| store.space().block(*key).unwrap().0 == LEVELS - 1));
    let folder = tempfile::tempdir().unwrap();
    let files = [(&store, "explored"), (&again, "baked"), (&fewer, "fewer")].map(|(store, name)| {
        let path = folder.path().join(name);
        world.dataset(store).save(path.as_path()).unwrap();
        std::fs::read(path).unwrap()
    });
    assert!(files[0] == files[1], "{joints} joints");
    assert!(files[0] != files[2], "{joints} joints: a block less is not seen");
}

#[test]
fn preparing_makes_all_levels_whole_around_a_place() {
    let world = World::new();
    let (model, store) = (world.model(), world.store());
    let ahead = Ahead::new(&model, Arc::clone(&store));
    let q = world.motion(1, 24).at(0.0).0;
    assert_eq!(store.sample(&q).whole, 0);
    ahead.prepare(&q, 2, std::time::Duration::from_secs(60));
    assert_eq!(store.sample(&q).whole, LEVELS);
    let solved = ahead.solved();
    assert!(solved.nodes > 0 && solved.nodes >= store.blocks().len() as u64, "{solved:?}");
}

#[test]
fn a_cell_is_whole_wherever_it_lies_within_the_cells_below() {
    let world = World::new();
    let model = world.model();
    let motion = world.motion(5, 24);
    // At places in all corners of the cells below blocks rest on others that are no corners of those cells.
    for k in 0..20 {
        let store = world.store();
        let ahead = Ahead::new(&model, Arc::clone(&store));
        let at = Whereabouts::at_rest(&motion.at(0.25 * f64::from(k)).0);
        let mut solver = ahead.solver();
        while ahead.advance(&mut solver, &at, false) {}
        assert_eq!(store.sample(&at.position).whole, LEVELS, "{at:?}");
    }
}

#[test]
fn a_solution_followed_is_followed_by_its_tangent_to_second_order() {
    let world = World::new();
    let model = world.model();
    let start = JointVector::from_slice(&[0.05, 0.04]);
    let mut follower = Follower::new(&model);
    let mut solver = Solver::new(&model);
    let mut torque = |q: &JointVector| solver.solve(q).torque;
    let mut errors = Vec::new();
    for (tick, ahead) in (1..).zip([1e-3, 5e-4]) {
        let at = Whereabouts { position: start, velocity: JointVector::zeros(2), tick };
        let solution = follower.solve(&at);
        assert_eq!((solution.number, solution.place, solution.status), (tick, start, Status::Contact));
        let here = solution.at(&start);
        assert!((here.0[1] - torque(&start)[1]).abs() < 1e-5 * here.0.norm(), "{here:?}");
        let mut q = start;
        q[1] += ahead;
        let (followed, energy) = solution.at(&q);
        assert!(energy > solution.energy);
        errors.push((followed[1] - torque(&q)[1]).abs() / torque(&q)[1].abs());
        // Far out nothing is felt.
        q[1] = -0.05;
        assert_eq!(solution.at(&q).0.norm(), 0.0);
    }
    assert!(errors[0] < 0.05 && errors[1] < 0.6 * errors[0] + 1e-6, "{errors:?}");
}

#[test]
fn a_scene_is_explored_whatever_its_interpolation() {
    let folder = tempfile::tempdir().unwrap();
    let text = include_str!("../scenes/small.toml");
    for name in ["linear", "potential", "direct"] {
        let path = folder.path().join(name).with_extension("toml");
        std::fs::write(&path, format!("{text}\n[haptics]\ninterpolation = \"{name}\"\n")).unwrap();
        let kept = folder.path().join(name).with_extension("haptize");
        let on_demand = Arc::new(OnDemand::open(&path, &kept, 2, Some(1)).unwrap());
        let start = grid_of(on_demand.scene()).configuration(0);
        let (_, exploration) = on_demand.begin(&start, on_demand.scene().haptics.interpolation).unwrap();
        assert!(exploration.end().unwrap().solved.nodes > 0, "{name}");
        let dataset = on_demand.dataset();
        assert!(dataset.refinement.is_some(), "{name}");
        // What was kept goes on with the same scene.
        dataset.save(&kept).unwrap();
        assert!(OnDemand::open(&path, &kept, 2, Some(1)).is_ok(), "{name}");
    }
}

/// A store keeps no contact forces; friction has those of the equilibria that are solved at the proxy.
#[test]
fn friction_over_a_store_takes_the_work_of_the_solved_normal_forces() {
    const COEFFICIENT: f64 = 0.5;
    let friction = format!("\n[haptics.friction]\ncoefficient = {COEFFICIENT}\nstiffness = 5000.0\n");
    let world = World::of(&(include_str!("../scenes/small.toml").to_owned() + &friction));
    let (model, store) = (world.model(), world.store());
    let ahead = Ahead::new(&model, Arc::clone(&store));
    let refused = Setup::new(&world.dataset(&store)).err().unwrap().to_string();
    assert!(refused.contains("[haptics.friction]") && refused.contains("--on-demand"), "{refused}");
    let setup = Setup::explored(&world.dataset(&store)).unwrap();
    // Into the ball, and across it.
    let way = [[0.0, -0.25, 0.0], [0.3, -0.25, 0.04], [1.3, 0.25, 0.04]];
    let way = way.map(|[time, turn, slide]| Waypoint { time, q: JointVector::from_slice(&[turn, slide]) });
    let motion = || Motion::through(&way, 2).unwrap();
    let levers = JointVector::from_slice(&[0.1, 1.0]);
    let live = |forces| Live::new(&way[0].q, LEVELS, &levers, 1, Followed { torque: false, forces });
    let (answering, mut ends) = live(true);
    let mut hand = setup.hand(motion()).unwrap();
    // Whoever solves no forces is refused at the start, and so is a session in which nobody solves.
    for without in [Some(live(false).0), None] {
        let refused = Driver::new(&setup.haptics, &mut hand, without).err();
        assert!(matches!(refused, Some(SessionError::NoForces)), "{refused:?}");
    }
    let mut driver = Driver::new(&setup.haptics, &mut hand, Some(answering)).unwrap();
    let (mut solver, mut follower) = (ahead.solver(), Follower::new(&model).with_forces(true));
    let (mut expected, mut taken, mut before) = (0.0, 0.0, None::<JointVector>);
    let (mut one, mut other) = (world.chain.new_pose(), world.chain.new_pose());
    for _ in 0..1300 {
        let (tick, _) = assert_no_alloc(|| driver.tick(1e-3, 1e-3));
        let accounts = &tick.accounts;
        assert!(tick.fault.is_none() && accounts.residual().abs() <= 1e-10 * accounts.exchanged.max(1e-6));
        assert!(accounts.friction_dissipation >= taken - 1e-12 * accounts.exchanged, "{accounts:?}");
        taken = accounts.friction_dissipation;
        if let Some(before) = before {
            world.chain.pose(&before, &mut one);
            world.chain.pose(&tick.proxy, &mut other);
            for touch in solver.solve(&tick.proxy).touches {
                let node = touch.proxy_node as usize;
                let way = other.nodes[node] - one.nodes[node];
                let normal = touch.force.normalize();
                expected += COEFFICIENT * touch.force.length() * way.reject_from_normalized(normal).length();
            }
        }
        before = Some(tick.proxy);
        while ahead.advance(&mut solver, ends.whereabouts[0].read(), false) {}
        ends.solutions.as_mut().unwrap().write(follower.solve(ends.whereabouts[1].read()));
    }
    // It sticks before it slips, and the bristles hold something in the end.
    let kept = taken + driver.tick(1e-3, 1e-3).0.accounts.bristles;
    assert!(expected > 1e-3 && (kept / expected - 1.0).abs() < 0.1, "{kept} J for {expected} J");
}
