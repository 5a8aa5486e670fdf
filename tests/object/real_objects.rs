//! Real objects from the first touch to the hand (sections 2.2, 2.3 and 4.2): the simulated spongy block, scanned,
//! gridized and felt, and the logs of a real instrument where they are at hand.
use crate::common::scanned::scanned;
use glam::DVec3;
use haptize::{
    dataset::Dataset,
    device::Motion,
    gridize::{
        GridizeOptions, Reversals, gridize, gridize_sliding,
        prediction::{held_out, predict},
    },
    logs::{Imported, Keep, Mapping, import},
    render::{session, setup::Setup, trace::Trace},
    report::force::EndForce,
    scene::{PlanSpec, ScanScene, Waypoint, WorkspacePlan},
};
use std::path::PathBuf;

const SEED: u64 = 1;

fn options(step: f64, epsilon: f64) -> GridizeOptions {
    GridizeOptions { epsilon: Some(epsilon), within: f64::INFINITY, ..GridizeOptions::new(vec![step]) }
}

/// Scans the part of `datasets/NAME.toml` that `part` leaves of its plan, and gridizes it at the paper's 0.03 rad.
fn haptized(name: &str, part: impl FnOnce(&mut WorkspacePlan)) -> Dataset {
    let path = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("datasets").join(name).with_extension("toml");
    let mut scene = ScanScene::load(path).unwrap();
    let PlanSpec::Workspace(plan) = &mut scene.scan.plan else { unreachable!() };
    part(plan);
    let samples = scanned(&scene, SEED);
    let (mut dataset, _) = gridize(&samples, &options(0.03, scene.scan.control.epsilon)).unwrap();
    dataset.scene = scene.text;
    dataset
}

/// `dataset` felt by a hand that follows its scene's `motion`.
fn felt(dataset: &Dataset, motion: impl Fn(&Setup) -> Vec<Waypoint>) -> (Setup, Trace) {
    let setup = Setup::new(dataset).unwrap();
    let motion = Motion::through(&motion(&setup), 3).unwrap();
    let plan = setup.plan(dataset, motion.duration(), 0);
    let trace = session::run(&setup.haptics, &mut setup.hand(motion).unwrap(), None, &plan).unwrap();
    (setup, trace)
}

#[test]
fn scraping_at_constant_depth_gives_a_constant_normal_force_and_the_fabric_a_greater_one() {
    let [bare, fabric] = ["sponge", "sponge_fabric"].map(|name| {
        // A strip along the way of the scrape, wide enough for its neighbours.
        let dataset = haptized(name, |plan| {
            plan.start = DVec3::new(0.145, -0.066, 0.012);
            (plan.across[0].count, plan.across[1].count, plan.depth.count) = (23, 6, 6);
        });
        assert_eq!(dataset.absent().len(), 5);
        let (setup, trace) = felt(&dataset, |setup| setup.scene.motion.scrape.clone());
        let summary = trace.summary();
        assert!(summary.contact_share > 0.6 && summary.contact_share < 0.95 && summary.faults == 0, "{summary:?}");
        EndForce::new(name, &setup.chain, &trace).unwrap().held().unwrap()
    });
    for held in [bare, fabric] {
        assert!(held.axis == 'z' && held.mean > 0.2 && held.variation < 0.03, "{held:?}");
    }
    assert!(fabric.mean > 2.0 * bare.mean, "{bare:?} {fabric:?}");
}

#[test]
fn a_press_from_the_side_touches_with_several_nodes_and_its_torque_is_smooth() {
    let dataset = haptized("sponge_side", |plan| {
        plan.start.y = -0.018;
        plan.across[0].count = 7;
    });
    let (setup, trace) = felt(&dataset, |setup| setup.scene.motion.press.clone());
    let summary = trace.summary();
    assert!(summary.contact_share > 0.3 && summary.contact_share < 0.9, "{summary:?}");
    assert!(!trace.ticks[0].sample.contact && summary.max_contact_torque > 0.1, "{summary:?}");
    assert!(summary.max_contact_torque_step < 0.03 * summary.max_contact_torque, "{summary:?}");
    // What no dataset of a real object tells: how many points of the proxy touch where it presses deepest.
    let deepest = trace.ticks.iter().max_by(|a, b| a.sample.torque.norm().total_cmp(&b.sample.torque.norm())).unwrap();
    let mut pose = setup.chain.new_pose();
    setup.chain.pose(&deepest.proxy, &mut pose);
    let touching = pose.nodes.iter().filter(|node| node.x + 0.006 > 0.120 && node.z < 0.0).count();
    assert!(touching >= 3, "{touching} of {} nodes in the block", pose.nodes.len());
}

/// The folder with the instrument's logs: beside the repository or further up.
fn real_logs() -> Option<Vec<PathBuf>> {
    let folder = PathBuf::from(env!("CARGO_MANIFEST_DIR"))
        .ancestors()
        .map(|folder| folder.join("shared/real-logs"))
        .find(|folder| folder.is_dir())?;
    let mut logs: Vec<PathBuf> = folder.read_dir().unwrap().map(|entry| entry.unwrap().path()).collect();
    logs.retain(|path| path.extension().is_some_and(|extension| extension == "txt"));
    logs.sort();
    Some(logs)
}

#[test]
fn a_real_instrument_is_predicted_about_as_well_as_it_repeats_itself() {
    let Some(logs) = real_logs() else {
        println!("not run: the instrument's logs (../shared/real-logs) are not on this machine");
        return;
    };
    let mapping = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("datasets/instrument.toml");
    let mut mapping = Mapping::load(&mapping).unwrap();
    let Imported { samples, branches, histories, report } = import(&mapping, &logs, &mut |_| {}).unwrap();
    let cells = report.cells.unwrap();
    assert!(report.rows > 190_000 && samples.len() > 500, "{} rows, {} samples", report.rows, samples.len());
    // Friction: the torque on the way up is lower than on the way down, by far more than repeating a pass changes it.
    assert!(cells.hysteresis[0] > 3.0 * cells.repeatability[0], "{cells:?}");
    let mean = |branch: &[f64]| branch.iter().step_by(2).sum::<f64>() / (branch.len() / 2) as f64;
    let [up, down] = branches.unwrap();
    assert!(mean(&up.torques) < mean(&down.torques));
    let held_out = held_out(&samples, &options(0.02, 0.0), 0.1).unwrap();
    println!("repeatability {:?} N m, held out {held_out:?}", cells.repeatability);
    for joint in 0..2 {
        let (error, repeated) = (held_out.rms[joint], cells.repeatability[joint]);
        assert!(error < 1.1 * repeated && error > 0.1 * repeated, "joint {joint}: {error} {repeated}");
    }
    assert!(held_out.predicted > held_out.samples / 2);
    // Friction tells one direction from the other. Strokes that were held out are predicted with it.
    let reversals = Reversals { histories: &histories, lead: 0, cell: &mapping.torque.cell };
    let (dataset, _) = gridize_sliding(&samples.joints, &reversals, &options(0.02, 0.0)).unwrap();
    let friction = dataset.provenance.friction.unwrap();
    println!("{friction:?}");
    let [with, without] = friction.predicted[0];
    assert!(friction.strokes > 90 && with < 0.016 && without > 0.035, "{friction:?}");
    // A whole run under a load that no other run had is harder: nothing was measured between its neighbours, one
    // direction of motion at a time. It is predicted to a tenth of the range.
    (mapping.torque.keep, mapping.torque.friction) = (Keep::Forward, false);
    let (rest, run): (Vec<_>, Vec<_>) = logs.iter().cloned().partition(|log| !log.ends_with("tool5_04.txt"));
    let rest = import(&mapping, &rest, &mut |_| {}).unwrap().samples;
    let run = import(&mapping, &run, &mut |_| {}).unwrap().samples;
    let against = predict(&gridize(&rest, &options(0.02, 0.0)).unwrap().0, &run).unwrap();
    println!("a run held out {against:?}");
    assert!(against.predicted > run.len() / 2, "{against:?}");
    for joint in 0..2 {
        let torques = || rest.torques.iter().skip(joint).step_by(2).copied();
        let range = torques().fold(f64::NEG_INFINITY, f64::max) - torques().fold(f64::INFINITY, f64::min);
        assert!(against.rms[joint] < 0.2 * range, "joint {joint}: {against:?} {range}");
    }
}
