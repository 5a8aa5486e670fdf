//! A scan on a device, through the safety layer: what it measures is what the same rig measures without it.

use crate::felt::{PERIOD, all};
use assert_no_alloc::assert_no_alloc;
use haptize::{
    Error, JointVector,
    device::{
        Applied, Coordinates, Device, Failure, Guard, Halt, JointDevice, Limits, LinearMap, Reading, Scheduler, Script,
        Simulated, Watchdog,
    },
    proxy::Chain,
    scan::{LogHeader, LogWriter, Plan, RowStatus, ScanLog, ScanRow, Session, labels, simulated::SimulatedRig},
    scene::{PlanAxis, PlanSpec, ScanScene},
};
use std::{
    path::Path,
    sync::{Arc, Mutex, atomic::AtomicBool},
};

/// A device that passes its readings and torques on; the time of its own is a period a tick.
struct Watched {
    device: JointDevice,
    thread: Thread,
    /// That it was given last.
    last: Arc<Mutex<JointVector>>,
}

impl Device for Watched {
    fn read(&mut self, elapsed: f64) -> Reading {
        self.device.read(if elapsed > 0.0 { PERIOD } else { 0.0 })
    }

    fn apply(&mut self, torque: &JointVector) -> Applied {
        *self.last.lock().unwrap() = *torque;
        self.device.apply(torque)
    }

    fn scheduler(&self) -> Option<Arc<dyn Scheduler>> {
        match self.thread {
            Thread::Own => None,
            Thread::Library(rate) => Some(Arc::new(Library(rate))),
        }
    }
}

/// A library that calls without a pause, whatever rate (Hz) it states. It must not be kept waiting: a tick of a scan
/// allocates nothing.
struct Library(f64);

impl Scheduler for Library {
    fn run(&self, tick: &mut (dyn FnMut() -> bool + Send)) -> Result<(), Halt> {
        while assert_no_alloc(&mut *tick) {}
        Ok(())
    }

    fn rate(&self) -> f64 {
        self.0
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
    /// By a library's thread, which says that it calls so often (Hz).
    Library(f64),
}

/// Scans `scene` with a device of so much torque (N m) that fails as `scripts` say; its rows.
fn scan(scene: &ScanScene, most: f64, scripts: &[Script]) -> (Result<(), Error>, Vec<ScanRow>) {
    scan_by(Thread::Own, scene, most, scripts)
}

fn scan_by(thread: Thread, scene: &ScanScene, most: f64, scripts: &[Script]) -> (Result<(), Error>, Vec<ScanRow>) {
    let chain = Chain::new(&scene.proxy);
    let plan = Plan::new(&scene.scan, &chain).unwrap();
    let first = plan.stops[0].q;
    let rig = SimulatedRig::new(&scene.proxy, &scene.scan.simulated, first, 7);
    let limits = Limits { effort: all(3, most), watchdog: Watchdog::None };
    let hardware = Simulated::new(rig, Coordinates::Joints(3), limits, scripts.to_vec());
    let mut guard = Guard::new(Box::new(hardware), None).unwrap();
    guard.enable().unwrap();
    let last = Arc::new(Mutex::new(all(3, 1.0)));
    let mut device =
        Watched { device: JointDevice::new(guard, LinearMap::identity(3)), thread, last: Arc::clone(&last) };
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("log.csv");
    let header = LogHeader {
        rig: "a device".into(),
        simulated: true,
        guided: false,
        joints: labels(&chain),
        scene: scene.text.clone(),
    };
    let mut log = LogWriter::create(&path, &header).unwrap();
    let mut session = Session {
        spec: &scene.scan,
        chain: &chain,
        device: &mut device,
        against_time: thread != Thread::Own,
        header: &header,
        log: &mut log,
        stop: &AtomicBool::new(false),
        progress: &mut |_| (),
    };
    let result = session.scan(&plan, &[]).map(drop);
    if !result.as_ref().is_err_and(|error| error.to_string().contains("set rate =")) {
        assert_eq!(*last.lock().unwrap(), all(3, 0.0), "the last torque");
    }
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
    let library = Thread::Library(scene.scan.control.rate);
    let (result, called) = scan_by(library, &scene, 3.0, &[]);
    result.unwrap();
    let measured =
        |rows: &[ScanRow]| -> Vec<ScanRow> { rows.iter().map(|row| ScanRow { time: 0.0, ..*row }).collect() };
    assert_eq!(measured(&called), measured(&own), "to the last bit");
    let unplugged = Script { failure: Failure::Unplugged, from: 1.0, until: f64::INFINITY };
    let (result, _) = scan_by(library, &scene, 3.0, &[unplugged]);
    assert!(result.unwrap_err().to_string().contains("unplugged"));
    for rate in [0.5, 2.0, 1.001].map(|part| part * scene.scan.control.rate) {
        let refused = scan_by(Thread::Library(rate), &scene, 3.0, &[]).0.unwrap_err().to_string();
        assert!(refused.contains(&format!("rate = {rate} in [scan.control]")), "{refused}");
    }
}
