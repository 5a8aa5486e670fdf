//! A scan by the simulated rig, whole.

use haptize::{
    gridize::Samples,
    proxy::Chain,
    scan::{LogHeader, LogWriter, Plan, ScanLog, Session, labels, simulated::SimulatedRig},
    scene::ScanScene,
};
use std::sync::atomic::AtomicBool;

/// What is measured of the plan of `scene`, with noise of `seed`.
pub fn scanned(scene: &ScanScene, seed: u64) -> Samples {
    let chain = Chain::new(&scene.proxy);
    let plan = Plan::new(&scene.scan, &chain).unwrap();
    let mut rig = SimulatedRig::new(&scene.proxy, &scene.scan.simulated, plan.stops[0].q, seed);
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("log.csv");
    let header = LogHeader {
        rig: rig.description(),
        simulated: true,
        guided: false,
        joints: labels(&chain),
        scene: scene.text.clone(),
    };
    let mut log = LogWriter::create(&file, &header).unwrap();
    let report = Session {
        spec: &scene.scan,
        chain: &chain,
        device: &mut rig,
        against_time: false,
        header: &header,
        log: &mut log,
        stop: &AtomicBool::new(false),
        progress: &mut |_| {},
    }
    .scan(&plan, &[])
    .unwrap();
    assert!(report.whole && report.simulated && report.steady == report.points, "{report:?}");
    ScanLog::read(&file).unwrap().samples()
}
