//! A scan on a device, through the safety layer: what it measures is what the same rig measures without it.

use crate::felt::{PERIOD, all};
use haptize::{
    JointVector,
    device::{
        Applied, Coordinates, Device, DeviceRig, Failure, Guard, Halt, JointDevice, Limits, LinearMap, Reading, Script,
        Simulated, Watchdog, relay,
    },
    proxy::Chain,
    scan::{
        LogHeader, LogWriter, Plan, Rig, RowStatus, ScanError, ScanLog, ScanRow, Session, labels,
        simulated::SimulatedRig,
    },
    scene::{PlanAxis, PlanSpec, ScanScene},
};
use std::{path::Path, sync::atomic::AtomicBool};

/// The simulated rig of a scan as a device: its joints, and the sponge that they touch.
struct Sponge {
    rig: SimulatedRig,
    torque: JointVector,
    position: JointVector,
}

impl Device for Sponge {
    fn read(&mut self, elapsed: f64) -> Reading {
        if elapsed > 0.0 {
            self.position = self.rig.hold(&self.torque, elapsed).unwrap().position;
        }
        Reading { position: self.position, age: 0.0, hand: self.position }
    }

    fn apply(&mut self, torque: &JointVector) -> Applied {
        self.torque = *torque;
        Applied::whole(torque)
    }
}

/// Three levels of one line on the sponge.
fn scene() -> ScanScene {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("datasets/sponge.toml");
    let mut scene = ScanScene::load(path).unwrap();
    if let PlanSpec::Workspace(plan) = &mut scene.scan.plan {
        plan.start = glam::DVec3::new(0.15, -0.03, 0.012);
        plan.across = plan.across.map(|axis| PlanAxis { count: 1, ..axis });
        plan.depth = PlanAxis { spacing: 0.008, count: 3, ..plan.depth };
    }
    scene
}

/// How the device is driven.
#[derive(Clone, Copy, PartialEq)]
enum Thread {
    /// By the scan itself.
    Own,
    /// By a library's thread, whose calls the scan follows.
    Library,
}

/// Scans `scene` with a device of so much torque (N m) that fails as `scripts` say; its rows.
fn scan(scene: &ScanScene, most: f64, scripts: &[Script]) -> (Result<(), ScanError>, Vec<ScanRow>) {
    scan_by(Thread::Own, scene, most, scripts)
}

fn scan_by(thread: Thread, scene: &ScanScene, most: f64, scripts: &[Script]) -> (Result<(), ScanError>, Vec<ScanRow>) {
    let chain = Chain::new(&scene.proxy);
    let plan = Plan::new(&scene.scan.plan, &chain).unwrap();
    let first = plan.stops[0].q;
    let rig = SimulatedRig::new(&scene.proxy, &scene.scan.simulated, first, 7);
    let sponge = Sponge { rig, torque: all(3, 0.0), position: first };
    let limits = Limits { effort: all(3, most), watchdog: Watchdog::None };
    let hardware = Simulated::new(sponge, Coordinates::Joints(3), limits, scripts.to_vec());
    let mut guard = Guard::new(Box::new(hardware), None).unwrap();
    guard.enable().unwrap();
    let device = JointDevice::new(guard, LinearMap::identity(3));
    let stop = AtomicBool::new(false);
    let mut rig = match thread {
        Thread::Own => DeviceRig::new(device, "a device".into(), true, None, &stop, |period| period),
        Thread::Library => {
            let (mut ticker, device) = relay(device);
            let call = move |period| {
                ticker.tick(period);
                period
            };
            DeviceRig::new(device, "a device".into(), true, None, &stop, call)
        }
    };
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("log.csv");
    let header = LogHeader {
        rig: rig.description(),
        simulated: true,
        guided: false,
        joints: labels(&chain),
        scene: scene.text.clone(),
    };
    let mut log = LogWriter::create(&path, &header).unwrap();
    let mut session =
        Session { spec: &scene.scan, chain: &chain, rig: &mut rig, log: &mut log, stop: &stop, progress: &mut |_| () };
    let result = session.scan(&plan, &[]).map(drop);
    drop(log);
    (result, ScanLog::read(&path).unwrap().rows)
}

#[test]
fn a_device_measures_what_the_rig_does() {
    let scene = scene();
    let (result, rows) = scan(&scene, 3.0, &[]);
    result.unwrap();
    assert_eq!(rows.len(), 3);
    assert!(rows.iter().all(|row| row.status == RowStatus::Steady));
    let deepest = rows.last().unwrap();
    assert!(deepest.torque.norm() > 0.02, "the sponge pushes back: {deepest:?}");
    assert!(rows[0].torque.norm() < 0.01, "free space: {:?}", rows[0]);
    assert!(deepest.time > 100.0 * PERIOD);
}

#[test]
fn a_scan_ends_where_the_device_cannot_hold_what_is_measured() {
    let scene = scene();
    // The arm's own weight is more than the device has.
    let (result, rows) = scan(&scene, 0.02, &[]);
    let error = result.unwrap_err().to_string();
    assert!(error.contains("cannot hold"), "{error}");
    assert!(rows.is_empty());
    let unplugged = Script { failure: Failure::Unplugged, from: 1.0, until: f64::INFINITY };
    let (result, _) = scan(&scene, 3.0, &[unplugged]);
    assert!(result.unwrap_err().to_string().contains("unplugged"));
}

#[test]
fn a_device_that_a_library_s_thread_drives_measures_the_same() {
    let scene = scene();
    let (result, own) = scan(&scene, 3.0, &[]);
    result.unwrap();
    let (result, relayed) = scan_by(Thread::Library, &scene, 3.0, &[]);
    result.unwrap();
    assert_eq!(relayed.len(), own.len());
    for (a, b) in own.iter().zip(&relayed) {
        assert_eq!(b.status, RowStatus::Steady);
        // Friction and noise of the rig leave this much between two visits of a place.
        let apart = |a: &JointVector, b: &JointVector| (0..3).map(|k| (a[k] - b[k]).abs()).fold(0.0, f64::max);
        assert!(apart(&a.torque, &b.torque) < 0.02 && apart(&a.q, &b.q) < 0.02, "{a:?}\n{b:?}");
    }
    let unplugged = Script { failure: Failure::Unplugged, from: 1.0, until: f64::INFINITY };
    let (result, _) = scan_by(Thread::Library, &scene, 3.0, &[unplugged]);
    assert!(result.unwrap_err().to_string().contains("unplugged"));
}

#[test]
fn a_library_s_thread_lets_go_where_the_scan_is_silent_and_when_it_is_over() {
    let hand = haptize::device::SimulatedHand::holding(
        &haptize::scene::HandSpec { stiffness: all(3, 20.0), damping: all(3, 0.4), inertia: all(3, 2e-3) },
        &all(3, 1e-3),
        &all(3, 0.03),
        haptize::device::Motion::through(&[haptize::scene::Waypoint { time: 0.0, q: all(3, 0.0) }], 3).unwrap(),
    );
    let limits = Limits { effort: all(3, 1.0), watchdog: Watchdog::None };
    let hardware = Simulated::new(hand.unwrap(), Coordinates::Joints(3), limits, Vec::new());
    let mut guard = Guard::new(Box::new(hardware), None).unwrap();
    guard.enable().unwrap();
    let (mut ticker, mut device) = relay(JointDevice::new(guard, LinearMap::identity(3)));
    // Nothing was asked for yet: no torque, and no complaint.
    for _ in 0..20 {
        assert!(ticker.tick(PERIOD));
    }
    for _ in 0..800 {
        device.apply(&all(3, 0.3));
        assert!(ticker.tick(PERIOD));
    }
    let held = device.apply(&all(3, 0.3));
    assert_eq!((held.torque, held.halt), (all(3, 0.3), None));
    // The order before was for the next call; ten more go on with it.
    let mut silent = 0;
    while device_torque(&mut ticker, &mut device) > 0.0 {
        silent += 1;
        assert!(silent < 20);
    }
    assert!((10..=12).contains(&silent), "{silent} calls");
    let held = device.apply(&all(3, 0.3));
    assert_eq!((held.torque, held.halt), (all(3, 0.0), Some(Halt::Late)));
    // It comes back, from zero.
    ticker.tick(PERIOD);
    let held = device.apply(&all(3, 0.3));
    assert!(held.halt.is_none() && held.torque[0] < 0.01, "{held:?}");
}

/// Torque after a call without an order (N m).
fn device_torque(ticker: &mut haptize::device::Ticker, device: &mut haptize::device::Relayed) -> f64 {
    ticker.tick(PERIOD);
    device.held().torque[0]
}
