//! A scan against the simulated rig: what it logs is the block's own force, nothing else, and it stops and resumes.

use super::simulated::{Hand, NodeContact, SimulatedRig, Sponge};
use super::*;
use crate::JointVector;
use crate::device::{Applied, Halt, Reading};
use crate::gridize::{GridizeOptions, Past, gridize_remembering};
use crate::proxy::inverse_kinematics::reach;
use crate::scene::{Cover, HistorySpec, PlanAxis, PlanSpec, ScanScene, WorkspacePlan};
use glam::DVec3;
use std::path::PathBuf;

fn scene() -> ScanScene {
    let path = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("datasets/sponge.toml");
    let mut scene = ScanScene::load(path).unwrap();
    scene.scan.plan = plan([2, 2, 4], DVec3::new(0.15, -0.03, 0.012));
    scene
}

fn plan([first, second, depth]: [usize; 3], start: DVec3) -> PlanSpec {
    let axis = |direction, spacing, count| PlanAxis { direction, spacing, count };
    PlanSpec::Workspace(WorkspacePlan {
        node: Some(0),
        start,
        across: [axis(DVec3::Y, 0.03, first), axis(DVec3::X, 0.02, second)],
        depth: axis(DVec3::NEG_Z, 0.008, depth),
        clearance: 0.004,
    })
}

/// A rig of the scene, its log, and what is needed to scan.
struct Bench {
    scene: ScanScene,
    chain: Chain,
    plan: Plan,
    folder: tempfile::TempDir,
    stop: AtomicBool,
}

impl Bench {
    fn new(scene: ScanScene) -> Self {
        let chain = Chain::new(&scene.proxy);
        let plan = Plan::new(&scene.scan, &chain).unwrap();
        Self { chain, plan, folder: tempfile::tempdir().unwrap(), stop: AtomicBool::new(false), scene }
    }

    fn rig(&self) -> SimulatedRig {
        SimulatedRig::new(&self.scene.proxy, &self.scene.scan.simulated, self.plan.stops[0].q, 7)
    }

    fn header(&self) -> LogHeader {
        let rig = self.rig();
        LogHeader {
            rig: rig.description(),
            simulated: true,
            guided: false,
            joints: labels(&self.chain),
            scene: self.scene.text.clone(),
        }
    }

    fn path(&self) -> PathBuf {
        self.folder.path().join("log.csv")
    }

    fn session<T>(&self, device: &mut dyn Device, log: &mut LogWriter, run: impl FnOnce(&mut Session<'_>) -> T) -> T {
        self.session_with(device, log, &mut |_| {}, run)
    }

    fn session_with<T>(
        &self,
        device: &mut dyn Device,
        log: &mut LogWriter,
        progress: &mut (dyn FnMut(ScanProgress) + Send),
        run: impl FnOnce(&mut Session<'_>) -> T,
    ) -> T {
        let (spec, chain, stop, header) = (&self.scene.scan, &self.chain, &self.stop, &self.header());
        run(&mut Session { spec, chain, device, against_time: false, header, log, stop, progress })
    }

    fn scan(&self) -> (Result<ScanReport, Error>, Vec<ScanRow>) {
        let mut log = LogWriter::create(&self.path(), &self.header()).unwrap();
        let report = self.session(&mut self.rig(), &mut log, |session| session.scan(&self.plan, &[]));
        drop(log);
        (report, ScanLog::read(&self.path()).unwrap().rows)
    }

    /// The block's relaxed force as joint torque at `q`, pressed straight down from above.
    fn relaxed_torque(&self, q: &JointVector) -> JointVector {
        let sponge = Sponge::new(&self.scene.scan.simulated);
        let mut pose = self.chain.new_pose();
        self.chain.pose(q, &mut pose);
        let (end, radius) = (pose.nodes[0], self.chain.nodes[0].radius);
        let mut contact = NodeContact::default();
        for k in 0..=100 {
            let above = DVec3::Z * (0.05 * (1.0 - f64::from(k) / 100.0));
            sponge.force(&mut contact, end + above, radius, 0.01);
        }
        let force = (0..1000).map(|_| sponge.force(&mut contact, end, radius, 0.01)).last().unwrap();
        let mut torque = JointVector::zeros(q.len());
        self.chain.add_torque(&pose, 0, force, &mut torque);
        torque
    }
}

/// Whether a row's torque is the block's but for dry friction of the joints, tangential friction of the tip, and what
/// has not relaxed (a `share` of the torque).
fn is(row: &ScanRow, expected: &JointVector, share: f64) -> bool {
    let slack = 0.004 + share * expected.norm();
    row.torque.iter().zip(expected.iter()).all(|(measured, expected)| (measured - expected).abs() < slack)
}

fn assert_is(row: &ScanRow, expected: &JointVector, share: f64) {
    assert!(is(row, expected, share), "{row:?} {expected:?}");
}

#[test]
fn steady_torque_is_that_of_the_block_where_it_is_touched_and_nothing_elsewhere() {
    let bench = Bench::new(scene());
    let (report, rows) = bench.scan();
    let report = report.unwrap();
    assert_eq!((report.points, report.steady, report.whole, report.simulated), (16, 16, true, true));
    let mut touched = 0;
    for row in &rows {
        let expected = bench.relaxed_torque(&row.q);
        touched += usize::from(expected.norm() > 0.0);
        assert_is(row, &expected, 0.15);
        // A joint held by friction within one encoder step is commanded a constant torque: no deviation.
        assert!(row.deviation.iter().all(|deviation| (0.0..0.05).contains(deviation)), "{row:?}");
    }
    assert!(rows.iter().any(|row| row.deviation.norm() > 0.0), "noise reaches the log");
    assert_eq!(touched, 12, "one level of four lies above the block");
}

#[test]
fn gravity_is_subtracted() {
    let mut scene = scene();
    scene.scan.simulated.corner.z -= 1.0;
    let heavy = scene.proxy.joints.iter().map(|joint| joint.mass).sum::<f64>() * GRAVITY * 0.1;
    let bench = Bench::new(scene);
    let (report, rows) = bench.scan();
    assert_eq!(report.unwrap().steady, 16);
    for row in rows {
        assert!(row.torque.norm() < 0.006 && row.torque.norm() < 0.05 * heavy, "{row:?}");
    }
}

#[test]
fn an_interrupted_scan_is_resumed_where_it_was() {
    let bench = Bench::new(scene());
    let mut log = LogWriter::create(&bench.path(), &bench.header()).unwrap();
    let mut interrupt = |progress: ScanProgress| bench.stop.store(progress.done >= 6, Ordering::Relaxed);
    let report =
        bench.session_with(&mut bench.rig(), &mut log, &mut interrupt, |session| session.scan(&bench.plan, &[]));
    drop(log);
    let report = report.unwrap();
    assert!(!report.whole && report.steady == 6);
    bench.stop.store(false, Ordering::Relaxed);
    let (mut log, logged) = LogWriter::resume(&bench.path(), &bench.header()).unwrap();
    let report = bench.session(&mut bench.rig(), &mut log, |session| session.scan(&bench.plan, &logged)).unwrap();
    assert!(report.whole && report.steady == 16);
    let mut points: Vec<usize> = ScanLog::read(&bench.path()).unwrap().rows.iter().map(|row| row.point).collect();
    points.sort_unstable();
    assert!(points.into_iter().eq(0..16));
}

#[test]
fn limits_stop_the_scan_log_the_point_and_let_it_go_on_after_it() {
    let limited = |change: &dyn Fn(&mut ScanScene), what: &str| {
        let mut scene = scene();
        change(&mut scene);
        let bench = Bench::new(scene);
        let (report, rows) = bench.scan();
        let error = report.err().unwrap().to_string();
        assert!(error.contains(what) && error.contains("--resume"), "{error}");
        let last = *rows.last().unwrap();
        assert!(last.status == RowStatus::Limit && last.torque.norm() == 0.0);
        assert!(rows.iter().all(|row| row.point != last.point || row.status == RowStatus::Limit));
        let (mut log, logged) = LogWriter::resume(&bench.path(), &bench.header()).unwrap();
        let again = bench.session(&mut bench.rig(), &mut log, |session| session.scan(&bench.plan, &logged));
        drop(log);
        let rows = ScanLog::read(&bench.path()).unwrap().rows;
        assert_eq!(rows.iter().filter(|row| row.point == last.point).count(), 1, "{again:?}");
    };
    limited(&|scene| scene.scan.limits.torque.fill(0.12), "torque of joint");
    limited(&|scene| scene.scan.limits.speed = 0.05, "speed of joint");
    limited(&|scene| scene.scan.limits.workspace[0].z = -0.008, "outside the workspace");
}

/// A simulated rig whose readings pass through a function of time, which may have it fail.
struct Altered<F>(SimulatedRig, f64, F, Option<Halt>);

impl<F: FnMut(f64, &mut Reading) -> Option<Halt> + Send> Device for Altered<F> {
    fn read(&mut self, elapsed: f64) -> Reading {
        let mut reading = self.0.read(elapsed);
        self.1 += elapsed;
        self.3 = (self.2)(self.1, &mut reading);
        reading
    }

    fn apply(&mut self, torque: &JointVector) -> Applied {
        let applied = self.0.apply(torque);
        Applied { halt: self.3.or(applied.halt), ..applied }
    }
}

#[test]
fn a_rig_that_fails_ends_the_scan_and_keeps_the_log() {
    let bench = Bench::new(scene());
    let mut log = LogWriter::create(&bench.path(), &bench.header()).unwrap();
    let mut readings = 0;
    let fails = |_: f64, _: &mut Reading| {
        readings += 1;
        (readings > 3000).then_some(Halt::Unplugged)
    };
    let mut rig = Altered(bench.rig(), 0.0, fails, None);
    let result = bench.session(&mut rig, &mut log, |session| session.scan(&bench.plan, &[]));
    assert!(result.err().unwrap().to_string().contains("unplugged"));
    assert!(!ScanLog::read(&bench.path()).unwrap().rows.is_empty());
}

#[test]
fn a_guided_scan_logs_the_object_alone_and_never_the_hand() {
    let bench = Bench::new(scene());
    let places = bench.plan.spread(0, 12);
    let hand = Hand::new(places.clone());
    let seconds = hand.duration();
    let mut log = LogWriter::create(&bench.path(), &LogHeader { guided: true, ..bench.header() }).unwrap();
    let report =
        bench.session(&mut bench.rig().led_by(hand), &mut log, |session| session.guided(seconds, &[])).unwrap();
    drop(log);
    let ScanLog { header, rows } = ScanLog::read(&bench.path()).unwrap();
    assert!(header.guided && report.whole && report.steady == 12 && rows.len() == 12, "{report:?}");
    let mut touched = 0;
    for (row, [_, place]) in rows.iter().zip(&places) {
        let expected = bench.relaxed_torque(&row.q);
        assert_is(row, &expected, 0.25);
        touched += usize::from(expected.norm() > 0.0);
        let off = row.q.iter().zip(place.iter()).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        assert!(off < 0.1, "led there: {row:?} {place:?}");
    }
    assert!(touched >= 6);
    let pulled = |row: &ScanRow| {
        let mut torque = row.torque;
        torque.iter_mut().for_each(|tau| *tau += 0.1);
        ScanRow { torque, ..*row }
    };
    assert!(
        rows.iter().all(|row| !is(&pulled(row), &bench.relaxed_torque(&row.q), 0.25)),
        "a hand's torque would show"
    );
}

#[test]
fn a_hand_on_the_device_in_a_planned_scan_leaves_the_point_open() {
    let bench = Bench::new(scene());
    let mut log = LogWriter::create(&bench.path(), &bench.header()).unwrap();
    let held = |time: f64, reading: &mut Reading| {
        reading.held = (2.0..3.5).contains(&time);
        None
    };
    let mut rig = Altered(bench.rig(), 0.0, held, None);
    let report = bench.session(&mut rig, &mut log, |session| session.scan(&bench.plan, &[])).unwrap();
    assert!(!report.whole && report.steady < 16 && report.steady > 0, "{report:?}");
    drop(log);
    let (mut log, logged) = LogWriter::resume(&bench.path(), &bench.header()).unwrap();
    let report = bench.session(&mut bench.rig(), &mut log, |session| session.scan(&bench.plan, &logged)).unwrap();
    assert!(report.whole && report.steady == 16, "{report:?}");
    let guided = LogHeader { guided: true, ..bench.header() };
    assert!(LogWriter::resume(&bench.path(), &guided).unwrap_err().to_string().contains("another scene"));
}

#[test]
fn points_out_of_reach_are_reported_and_the_rest_is_scanned() {
    let mut scene = scene();
    scene.scan.plan = plan([1, 3, 2], DVec3::new(0.24, 0.0, 0.012));
    scene.scan.limits.workspace = [DVec3::splat(-1.0), DVec3::splat(1.0)];
    let bench = Bench::new(scene);
    assert!(!bench.plan.unreachable.is_empty() && bench.plan.unreachable.len() < 6, "{:?}", bench.plan.unreachable);
    let report = bench.scan().0.unwrap();
    assert_eq!(report.steady + report.unreachable, 6);
    assert!(report.whole);
    let far = ScanSpec { plan: plan([1, 1, 1], DVec3::new(2.0, 0.0, 0.0)), ..bench.scene.scan.clone() };
    assert!(Plan::new(&far, &bench.chain).unwrap_err().to_string().contains("reach no point"));
}

#[test]
fn a_plan_over_joints_visits_its_grid() {
    let text = scene().text.replace("[scan.workspace]", "[ignored]");
    let start = text.find("[ignored]").unwrap();
    let end = text.find("[scan.control]").unwrap();
    let axes = "[scan.joints]\nspacing = 0.05\naxes = [{ start = 0.0, count = 2 }, { start = 0.0, count = 2 }, \
                { start = 1.3, count = 3 }]\n";
    let text = text[..start].to_owned() + axes + &text[end..];
    let bench = Bench::new(ScanScene::parse(&text, "joints.toml").unwrap());
    let (report, rows) = bench.scan();
    assert_eq!(report.unwrap().steady, 12);
    for row in &rows {
        let commanded = bench.plan.stops.iter().find(|stop| stop.point == Some(row.point)).unwrap().q;
        let off = row.q.iter().zip(commanded.iter()).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        assert!(off < 0.02, "{row:?} {commanded:?}");
    }
}

#[test]
fn inverse_kinematics_reaches_what_forward_kinematics_can() {
    let bench = Bench::new(scene());
    let mut pose = bench.chain.new_pose();
    for k in 0..50 {
        let share = |step: f64| (f64::from(k) * step).fract();
        let q = JointVector::from_slice(&[2.0 * share(0.37) - 1.0, 1.4 * share(0.73) - 0.7, 0.7 + 1.6 * share(0.19)]);
        bench.chain.pose(&q, &mut pose);
        let target = pose.nodes[0];
        let found = reach(&bench.chain, 0, target, &JointVector::from_slice(&[0.0, 0.0, 1.5])).unwrap();
        bench.chain.pose(&found, &mut pose);
        assert!(pose.nodes[0].distance(target) < 1e-6, "{q:?} {found:?}");
    }
}

#[test]
fn recorded_presses_tell_how_the_block_relaxes_and_holds_back() {
    let mut scene = scene();
    let terms = [[0.25, 0.2], [0.15, 2.0]];
    scene.scan.simulated.relaxation = terms.to_vec();
    scene.scan.simulated.cover = Cover::Fabric;
    scene.scan.simulated.joint_friction = 5e-4;
    scene.scan.control.drift = 1e-3;
    let axis = |direction, spacing, count| PlanAxis { direction, spacing, count };
    scene.scan.plan = PlanSpec::Workspace(WorkspacePlan {
        node: Some(0),
        start: DVec3::new(0.14, -0.06, 0.012),
        across: [axis(DVec3::Y, 0.03, 5), axis(DVec3::X, 0.02, 3)],
        depth: axis(DVec3::NEG_Z, 0.003, 9),
        clearance: 0.004,
    });
    scene.scan.history = Some(HistorySpec { share: 1.0, speeds: vec![0.5, 0.25, 0.1], hold: 10.0, stroke: 0.008 });
    let bench = Bench::new(scene);
    let mut log = LogWriter::create(&bench.path(), &bench.header()).unwrap();
    let report = bench.session(&mut bench.rig(), &mut log, |session| session.scan(&bench.plan, &[])).unwrap();
    drop(log);
    assert_eq!((report.steady, report.histories, report.whole), (135, Some(45), true));
    let log = ScanLog::read(&bench.path()).unwrap();
    let histories = log.histories();
    assert_eq!((histories.len(), log.samples().len()), (45, 135));
    let interpolation = crate::gridize::Interpolation::Linear;
    let options =
        GridizeOptions { steps: vec![0.03], epsilon: Some(0.01), interpolation, smooth: false, within: f64::INFINITY };
    let (mut dataset, _) = gridize_remembering(&log.samples(), (&histories, Past::Presses), &options).unwrap();
    let found = dataset.provenance.relaxation.clone().unwrap();
    assert_eq!(found.terms.len(), 2, "{found:?}");
    for (found, expected) in found.terms.as_flattened().iter().zip(terms.as_flattened()) {
        assert!((found - expected).abs() < 0.05 * expected, "{found} {expected}");
    }
    assert!(found.misfit < 0.01 && found.held_out.unwrap() < 0.01, "{found:?}");
    let friction = identify_friction(&log, &bench.scene.scan, &bench.chain).unwrap();
    assert!((friction.coefficient - 0.4).abs() < 0.05 * 0.4 && friction.deviation < 0.02, "{friction:?}");
    assert!(friction.strokes >= 28, "{friction:?}");
    // The limit of friction at once after a quick press is mu times the block's force before any of it fades.
    add_slip(&mut dataset, &bench.chain, 0);
    let norm = |point: usize| JointVector::from_slice(dataset.torque(point)).norm();
    let greatest = (0..dataset.grid.points()).map(norm).fold(0.0, f64::max);
    let deep: Vec<usize> = (0..dataset.grid.points()).filter(|&point| norm(point) > 0.5 * greatest).collect();
    assert!(deep.len() > 10, "{}", deep.len());
    let mut errors = 0.0;
    for &point in &deep {
        let q = dataset.grid.configuration(point);
        let expected = bench.relaxed_torque(&q).norm() / (1.0 - 0.4);
        errors += (friction.coefficient / 0.4 * norm(point) / expected - 1.0).powi(2);
        let slip = dataset.slip.as_ref().unwrap();
        assert!(slip.normal_force[point] > 0.0);
    }
    let error = (errors / deep.len() as f64).sqrt();
    assert!(error < 0.1, "{error}");
    // Nothing else of the log is taken for a measurement at rest, and a scan goes on after it.
    let (mut log, logged) = LogWriter::resume(&bench.path(), &bench.header()).unwrap();
    let again = bench.session(&mut bench.rig(), &mut log, |session| session.scan(&bench.plan, &logged)).unwrap();
    assert!(again.whole && again.seconds == 0.0 && again.histories == Some(45), "{again:?}");
}
