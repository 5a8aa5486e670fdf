//! Joint states in MCAP: sessions and plans written, logs of robots read.

use crate::program::FINGER;
use haptize::{
    logs::{ImportError, Mapping, import},
    proxy::Chain,
    ros::{JointState, JointStateTable, JointStateWriter, RosError, is_mcap, topics},
    scan::{Plan, Trajectory, labels},
    scene::ScanScene,
};
use std::{
    collections::BTreeMap,
    fs,
    io::Read,
    path::{Path, PathBuf},
    process::Command,
};

/// A file of `states`, each with its topic.
fn file(folder: &Path, name: &str, states: &[(&str, JointState)]) -> PathBuf {
    let path = folder.join(name);
    let mut writer = JointStateWriter::new(fs::File::create(&path).unwrap()).unwrap();
    let mut known: BTreeMap<&str, u16> = BTreeMap::new();
    for (topic, state) in states {
        let number = *known.entry(topic).or_insert_with(|| writer.topic(topic).unwrap());
        writer.write(number, state).unwrap();
    }
    writer.finish(BTreeMap::new()).unwrap();
    path
}

fn state(milliseconds: u64, names: &[&str], position: &[f64], effort: &[f64]) -> JointState {
    JointState {
        stamp: milliseconds * 1_000_000,
        names: names.iter().map(|name| (*name).to_owned()).collect(),
        position: position.to_vec(),
        effort: effort.to_vec(),
        ..JointState::default()
    }
}

fn text(path: &Path, topic: Option<&str>) -> Result<String, RosError> {
    let mut text = String::new();
    JointStateTable::open(path, topic)?.read_to_string(&mut text).unwrap();
    Ok(text)
}

#[test]
fn a_topic_is_a_table_whatever_order_its_messages_name_joints_in() {
    let folder = tempfile::tempdir().unwrap();
    let states = [
        ("/a", state(1, &["x", "y"], &[0.5, 1.5], &[2.0, 3.0])),
        ("/b", state(1, &["z"], &[9.0], &[])),
        ("/a", state(2, &["y", "x"], &[1.6, 0.6], &[])),
        ("/a", state(3, &["w"], &[7.0], &[8.0])),
    ];
    let path = file(folder.path(), "log.mcap", &states);
    assert!(is_mcap(&path));
    let found = topics(&path).unwrap();
    assert_eq!(
        found.iter().map(|topic| (topic.name.as_str(), topic.messages)).collect::<Vec<_>>(),
        [("/a", 3), ("/b", 1)]
    );
    let head = "time,position x,velocity x,effort x,position y,velocity y,effort y,position w,velocity w,effort w\n";
    let expected = "0.001000000,0.5,,2,1.5,,3,,,\n0.002000000,0.6,,,1.6,,,,,\n0.003000000,,,,,,,7,,8\n";
    assert_eq!(text(&path, Some("/a")).unwrap(), head.to_owned() + expected);

    let error = text(&path, None).unwrap_err().to_string();
    assert!(error.contains("--topic") && error.contains("/a (3 messages), /b (1 messages)"), "{error}");
    assert!(text(&path, Some("/c")).unwrap_err().to_string().contains("no topic /c"));
}

#[test]
fn drop_outs_are_counted_and_efforts_become_contact_torques() {
    let folder = tempfile::tempdir().unwrap();
    let mut states: Vec<(&str, JointState)> =
        (0..50_u32).map(|k| ("/joint_states", state(u64::from(k), &["x"], &[0.01 * f64::from(k)], &[0.5]))).collect();
    states[10].1.effort.clear();
    states[20].1.position = vec![f64::NAN];
    let path = file(folder.path(), "log.mcap", &states);
    let mapping = Mapping::of_joint_states(&["x".to_owned()], "/joint_states", -1.0);
    let imported = import(&mapping, &[path], &mut |_| ()).unwrap();
    assert_eq!(imported.report.samples, 48);
    assert_eq!(imported.report.dropped[0].rows, 2);
    assert!(imported.samples.torques.iter().all(|torque| *torque == -0.5));
}

#[test]
fn damaged_files_are_errors_with_the_remedy_and_never_panics() {
    let folder = tempfile::tempdir().unwrap();
    let states: Vec<(&str, JointState)> =
        (0..20_u32).map(|k| ("/a", state(u64::from(k), &["x"], &[f64::from(k)], &[1.0]))).collect();
    let path = file(folder.path(), "log.mcap", &states);
    let whole = fs::read(&path).unwrap();
    let mapping = Mapping::of_joint_states(&["x".to_owned()], "/a", 1.0);
    let damaged = folder.path().join("damaged.mcap");
    for length in (8..whole.len()).step_by(7) {
        fs::write(&damaged, &whole[..length]).unwrap();
        let error = import(&mapping, std::slice::from_ref(&damaged), &mut |_| ()).err();
        assert!(matches!(error, Some(ImportError::Ros(_))), "{length} bytes: {error:?}");
    }
    let mut random = 12345_u32;
    for _ in 0..300 {
        let mut bytes = whole.clone();
        for _ in 0..3 {
            random = random.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            let at = 8 + (random >> 8) as usize % (bytes.len() - 8);
            bytes[at] = (random >> 24) as u8;
        }
        fs::write(&damaged, &bytes).unwrap();
        // Fine or an error; no panic, no endless loop, no huge allocation.
        let _ = import(&mapping, std::slice::from_ref(&damaged), &mut |_| ());
    }
    fs::write(&damaged, "time,x\n").unwrap();
    assert!(!is_mcap(&damaged));
    assert!(text(&damaged, None).unwrap_err().to_string().contains("not an MCAP file"));
}

fn haptize(folder: &Path, arguments: &[&str]) -> (bool, String) {
    let output = Command::new(env!("CARGO_BIN_EXE_haptize")).args(arguments).current_dir(folder).output().unwrap();
    let text = String::from_utf8_lossy(if output.status.success() { &output.stdout } else { &output.stderr });
    (output.status.success(), text.into_owned())
}

#[test]
fn a_session_is_recorded_as_mcap_and_gridized_again() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path();
    fs::write(path.join("finger.toml"), FINGER).unwrap();
    assert!(haptize(path, &["bake", "finger.toml", "-o", "f.haptize", "--backend", "cpu"]).0);
    let (fine, told) = haptize(path, &["play", "f.haptize", "--record", "session.mcap"]);
    assert!(fine, "{told}");
    let names: Vec<String> = topics(&path.join("session.mcap")).unwrap().into_iter().map(|topic| topic.name).collect();
    assert_eq!(names, ["/command", "/device", "/hand", "/proxy"]);
    // The proxy's contact torque, over the way that it went.
    let arguments = [
        "gridize",
        "session.mcap",
        "--topic",
        "/proxy",
        "--effort",
        "contact",
        "--step",
        "0.02",
        "-o",
        "again.haptize",
    ];
    let (fine, told) = haptize(path, &arguments);
    assert!(fine, "{told}");
    let (fine, told) = haptize(path, &["gridize", "session.mcap", "--step", "0.02"]);
    assert!(!fine && told.contains("--topic"), "{told}");
    let (fine, told) = haptize(path, &["play", "f.haptize", "--replay", "session.mcap"]);
    assert!(!fine && told.contains("session.mcap"), "{told}");
}

#[test]
fn a_plan_goes_out_as_a_trajectory_that_rests_at_every_point() {
    let scene = ScanScene::load(Path::new(env!("CARGO_MANIFEST_DIR")).join("datasets/sponge.toml")).unwrap();
    let chain = Chain::new(&scene.proxy);
    let plan = Plan::new(&scene.scan.plan, &chain).unwrap();
    let trajectory = Trajectory::new(&plan, 0.3, 0.25);
    for pair in trajectory.rows.windows(2) {
        let ((before, from), (after, to)) = (pair[0], pair[1]);
        assert!(after > before, "time ascends");
        let farthest = (0..3).map(|a| (to[a] - from[a]).abs()).fold(0.0, f64::max);
        assert!(farthest <= 0.3 * (after - before) + 1e-12, "no faster than the scan");
    }
    for stop in plan.stops.iter().filter(|stop| stop.point.is_some()) {
        let rests = trajectory
            .rows
            .windows(2)
            .any(|pair| pair[0].1 == stop.q && pair[1].1 == stop.q && (pair[1].0 - pair[0].0 - 0.25).abs() < 1e-9);
        assert!(rests, "{stop:?}");
    }
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path();
    let mut bytes = Vec::new();
    trajectory.write_mcap(&labels(&chain), &mut bytes).unwrap();
    fs::write(path.join("plan.mcap"), bytes).unwrap();
    assert_eq!(topics(&path.join("plan.mcap")).unwrap()[0].messages, trajectory.rows.len() as u64);

    let scene = Path::new(env!("CARGO_MANIFEST_DIR")).join("datasets/sponge.toml");
    let (fine, told) = haptize(path, &["scan", scene.to_str().unwrap(), "--plan-out", "plan.csv", "--dwell", "0.5"]);
    assert!(fine, "{told}");
    let motion = haptize::device::Motion::from_csv(&path.join("plan.csv"), 3).unwrap();
    assert_eq!(motion.duration(), Trajectory::new(&plan, scene_speed(), 0.5).duration());
    let (fine, told) = haptize(path, &["scan", scene.to_str().unwrap(), "--plan-out", "plan.csv", "--dwell", "-1"]);
    assert!(!fine && told.contains("dwell"), "{told}");
}

fn scene_speed() -> f64 {
    let scene = Path::new(env!("CARGO_MANIFEST_DIR")).join("datasets/sponge.toml");
    ScanScene::load(scene).unwrap().scan.control.speed
}
