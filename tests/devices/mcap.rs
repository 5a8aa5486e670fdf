//! Joint states in MCAP: sessions and plans written, logs of robots read.

use crate::{
    common::program::{self, message},
    program::finger,
};
use haptize::{
    Error, JointVector,
    gridize::{GridizeOptions, Reversals, gridize_sliding},
    logs::{Effort, Keep, Mapping, import},
    proxy::Chain,
    ros::{Course, JointState, JointStateTable, Message, MessageWriter, is_mcap, topics},
    scan::{Plan, Trajectory, labels},
    scene::ScanScene,
};
use std::{
    collections::BTreeMap,
    fs,
    io::Read,
    path::{Path, PathBuf},
};

/// A file of `states`, each with its topic.
fn file(folder: &Path, name: &str, states: &[(&str, JointState)]) -> PathBuf {
    let path = folder.join(name);
    let mut writer = MessageWriter::new(fs::File::create(&path).unwrap(), "haptize").unwrap();
    let mut known: BTreeMap<&str, u16> = BTreeMap::new();
    for (topic, state) in states {
        let number = *known.entry(topic).or_insert_with(|| writer.topic::<JointState>(topic).unwrap());
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

fn text(path: &Path, topic: Option<&str>) -> Result<String, Error> {
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
    assert!(error.contains("--topic") && error.contains("/a (3 messages), /b (1 message)"), "{error}");
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
    let mapping = Mapping::of_joint_states(&["x".to_owned()], "/joint_states", Effort::Motor);
    let imported = import(&mapping, &[path], &mut |_| ()).unwrap();
    assert_eq!(imported.report.samples, 48);
    let dropped = &imported.report.dropped[0];
    assert_eq!(
        dropped.to_string().split(',').next(),
        Some("2 rows have a field that is missing or not a finite number")
    );
    assert_eq!(imported.report.dropped[0].rows, 2);
    assert!(imported.samples.torques.iter().all(|torque| *torque == -0.5));
}

#[test]
fn strokes_in_a_recording_of_a_robot_tell_friction_as_those_in_a_table_do() {
    /// Of the joint (N m).
    const FRICTION: f64 = 0.3;
    let folder = tempfile::tempdir().unwrap();
    let row = |k: u32| {
        let phase = 2e-3 * f64::from(k);
        let (q, up) = (0.5 - 0.5 * phase.cos(), phase.sin() > 0.0);
        (q, -2.0 * q - if up { FRICTION } else { -FRICTION })
    };
    let rows = (0..20_000_u32).map(|k| (k, row(k)));
    let states: Vec<(&str, JointState)> =
        rows.clone().map(|(k, (q, torque))| ("/joint_states", state(u64::from(k), &["x"], &[q], &[torque]))).collect();
    let recording = file(folder.path(), "log.mcap", &states);
    let table = folder.path().join("log.csv");
    let lines: String = rows.map(|(k, (q, torque))| format!("{},{q},{torque}\n", f64::from(k) / 1e3)).collect();
    fs::write(&table, format!("time,position x,effort x\n{lines}")).unwrap();

    let mut mapping = Mapping::of_joint_states(&["x".to_owned()], "/joint_states", Effort::Contact);
    mapping.torque.cell = vec![0.01];
    (mapping.torque.keep, mapping.torque.friction, mapping.torque.still) = (Keep::Average, true, 0.02);
    let [of_robot, of_table] = [recording, table].map(|path| import(&mapping, &[path], &mut |_| ()).unwrap());
    assert_eq!(of_robot.histories, of_table.histories);
    let reversals = Reversals { histories: &of_robot.histories, lead: 0, cell: &mapping.torque.cell };
    let options = GridizeOptions { within: f64::INFINITY, ..GridizeOptions::new(vec![0.05]) };
    let (dataset, _) = gridize_sliding(&of_robot.samples.joints, &reversals, &options).unwrap();
    let forces = &dataset.slip.as_ref().unwrap().normal_force;
    assert!(forces.len() > 15 && forces.iter().all(|force| (f64::from(*force) / FRICTION - 1.0).abs() < 0.05));
    let [with, without] = dataset.provenance.friction.unwrap().predicted[0];
    assert!(with < 0.1 * FRICTION && (without / FRICTION - 1.0).abs() < 0.05, "{with} {without}");
}

#[test]
fn joint_states_of_which_no_torque_can_be_made_are_refused_with_the_cause() {
    let folder = tempfile::tempdir().unwrap();
    let refused = |states: Vec<(&str, JointState)>, joints: &[&str]| {
        let path = file(folder.path(), "log.mcap", &states);
        let joints: Vec<String> = joints.iter().map(|joint| (*joint).to_owned()).collect();
        let mapping = Mapping::of_joint_states(&joints, "/joint_states", Effort::Motor);
        import(&mapping, &[path], &mut |_| ()).unwrap_err().to_string()
    };
    let states = |effort: &'static [f64], names: fn(u32) -> &'static str| -> Vec<(&'static str, JointState)> {
        let state = |k: u32| state(u64::from(k), &[names(k)], &[0.01 * f64::from(k)], effort);
        (0..50).map(|k| ("/joint_states", state(k))).collect()
    };
    for effort in [&[][..], &[f64::NAN]] {
        let error = refused(states(effort, |_| "x"), &["x"]);
        assert!(error.contains("no message of /joint_states gives an effort, of 50 in all"), "{error}");
    }
    // Of a topic with several publishers some joints may be chosen, however seldom they are told.
    let states_of_two = states(&[0.5], |k| ["gripper", "gripper", "arm"][k as usize % 3]);
    let path = file(folder.path(), "two.mcap", &states_of_two);
    let mapping = Mapping::of_joint_states(&["arm".to_owned()], "/joint_states", Effort::Motor);
    let report = import(&mapping, &[path], &mut |_| ()).unwrap().report;
    assert_eq!((report.samples, report.dropped[0].rows), (16, 34));
    // Two publishers, each of its own joint.
    let error = refused(states(&[0.5], |k| ["arm", "gripper"][k as usize % 2]), &["arm", "gripper"]);
    assert!(
        error.contains("50 of 50 rows cannot be used") && error.contains("(--columns) with `bad_rows = \"drop\"`"),
        "{error}"
    );
    let nameless = refused(states(&[0.5], |k| ["x", " "][usize::from(k > 2)]), &["x"]);
    assert!(nameless.contains("message 4 of /joint_states is no") && nameless.contains("a name is blank"));
    let states_of_none = refused(vec![("/joint_states", state(0, &[], &[], &[]))], &["x"]);
    assert!(states_of_none.contains("no message of /joint_states names a joint"), "{states_of_none}");
    let mut many = state(0, &["x"; 1025], &[], &[]);
    many.frame = "base".to_owned();
    assert!(refused(vec![("/joint_states", many)], &["x"]).contains("it names 1025 joints, more than 1024"));
}

#[test]
fn recordings_of_other_kinds_are_named_with_the_program_that_converts_them() {
    let folder = tempfile::tempdir().unwrap();
    let mapping = Mapping::of_joint_states(&["x".to_owned()], "/joint_states", Effort::Motor);
    let starts: [(&[u8], &str); 4] = [
        (b"\x28\xb5\x2f\xfd\x00\x50", "zstd -d"),
        (b"\x1f\x8b\x08", "gunzip"),
        (b"SQLite format 3\0\x10", "ros2 bag convert"),
        (b"#ROSBAG V2.0\nE", "rosbags-convert"),
    ];
    for (start, remedy) in starts {
        let path = folder.path().join("recording");
        fs::write(&path, start).unwrap();
        let error = import(&mapping, &[path], &mut |_| ()).unwrap_err().to_string();
        assert!(error.contains(remedy), "{error}");
    }
}

/// A file of `states` of one topic in chunks that `compress` compresses, which are said to hold `size` bytes.
fn chunked(
    path: &Path,
    states: &[JointState],
    name: &str,
    compress: impl Fn(&[u8]) -> Vec<u8>,
    size: impl Fn(u64) -> u64,
) {
    let options = mcap::WriteOptions::new().compression(None).disable_seeking(true);
    let mut bytes = std::io::Cursor::new(Vec::new());
    let mut writer = options.create(&mut bytes).unwrap();
    let schema = writer.add_schema("sensor_msgs/msg/JointState", "ros2msg", b"").unwrap();
    let channel = writer.add_channel(schema, "/a", "cdr", &BTreeMap::new()).unwrap();
    for (state, sequence) in states.iter().zip(0..) {
        let (log_time, publish_time) = (state.stamp, state.stamp);
        let header = mcap::records::MessageHeader { channel_id: channel, sequence, log_time, publish_time };
        writer.write_to_known_channel(&header, &state.encode()).unwrap();
    }
    writer.finish().unwrap();
    drop(writer);
    // Records behind the magic bytes: a code, a length, the content.
    let plain = bytes.into_inner();
    let (magic, mut rest) = plain.split_at(8);
    let mut file = magic.to_vec();
    while rest.len() > 8 {
        let length = u64::from_le_bytes(rest[1..9].try_into().unwrap()) as usize;
        let (code, content) = (rest[0], &rest[9..9 + length]);
        rest = &rest[9 + length..];
        let mut content = content.to_vec();
        if code == 6 {
            let told = u64::from_le_bytes(content[16..24].try_into().unwrap());
            let taken = compress(&content[40..]);
            content.truncate(28);
            content[16..24].copy_from_slice(&size(told).to_le_bytes());
            content.extend((name.len() as u32).to_le_bytes());
            content.extend(name.as_bytes());
            content.extend((taken.len() as u64).to_le_bytes());
            content.extend(taken);
        }
        // The sum of the data section stands no longer: none.
        if code == 15 {
            content.fill(0);
        }
        file.push(code);
        file.extend((content.len() as u64).to_le_bytes());
        file.extend(content);
    }
    file.extend(magic);
    fs::write(path, file).unwrap();
}

fn lz4(bytes: &[u8]) -> Vec<u8> {
    let mut encoder = lz4_flex::frame::FrameEncoder::new(Vec::new());
    std::io::Write::write_all(&mut encoder, bytes).unwrap();
    encoder.finish().unwrap()
}

fn zstd(bytes: &[u8]) -> Vec<u8> {
    ruzstd::encoding::compress_to_vec(bytes, ruzstd::encoding::CompressionLevel::Fastest)
}

#[test]
fn compressed_chunks_hold_what_they_held_before_and_no_more_than_they_say() {
    let folder = tempfile::tempdir().unwrap();
    let states: Vec<JointState> = (0..200_u32).map(|k| state(u64::from(k), &["x"], &[f64::from(k)], &[1.0])).collect();
    let read = |name: &str, compress: &dyn Fn(&[u8]) -> Vec<u8>, size: &dyn Fn(u64) -> u64| {
        let path = folder.path().join(format!("{name}.mcap"));
        chunked(&path, &states, name, compress, size);
        (text(&path, None), fs::metadata(&path).unwrap().len())
    };
    let as_is = |size: u64| size;
    let (plain, longest) = read("", &|bytes| bytes.to_vec(), &as_is);
    let plain = plain.unwrap();
    assert_eq!(plain.lines().count(), 201);
    for (name, compress) in [("lz4", &lz4 as &dyn Fn(&[u8]) -> Vec<u8>), ("zstd", &zstd)] {
        let (taken, length) = read(name, compress, &as_is);
        assert_eq!(taken.unwrap(), plain, "{name}");
        assert!(length < longest, "{name}: {length} of {longest} bytes");
        // A chunk that holds more or less than it says, more than anybody wants, or nothing that was compressed.
        for (size, told) in [(-1, "holds more"), (1, "it holds"), (1 << 40, "smaller chunks")] {
            let error = read(name, compress, &|told| told.wrapping_add_signed(size)).0.unwrap_err().to_string();
            assert!(error.contains(told), "{name} {size}: {error}");
        }
        let error = read(name, &|bytes| bytes.to_vec(), &as_is).0.unwrap_err().to_string();
        assert!(error.contains("mcap recover"), "{error}");
        // What was altered is found, by the frame or by the checksum.
        let altered = |bytes: &[u8]| {
            let mut taken = compress(bytes);
            let middle = taken.len() / 2;
            taken[middle] ^= 0x55;
            taken
        };
        assert!(read(name, &altered, &as_is).0.is_err(), "{name}");
    }
    let error = read("snappy", &|bytes| bytes.to_vec(), &as_is).0.unwrap_err().to_string();
    assert!(error.contains("snappy") && error.contains("mcap decompress"), "{error}");
}

#[test]
fn a_small_file_takes_no_more_memory_than_its_chunk_says() {
    // A gigabyte of zeros in some kilobytes, said to be a kilobyte: the rest is never taken out.
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("bomb.mcap");
    let states = [state(1, &["x"], &[0.0], &[])];
    // Blocks of 128 KiB of one byte each, as zstd writes them: magic, a window of 1 MiB, blocks, the last one marked.
    let bomb = |_: &[u8]| {
        let mut bytes = vec![0x28, 0xb5, 0x2f, 0xfd, 0x00, 0x50];
        for block in 0..8192_u32 {
            let header = u32::from(block == 8191) | 1 << 1 | (1 << 17) << 3;
            bytes.extend(&header.to_le_bytes()[..3]);
            bytes.push(0);
        }
        bytes
    };
    chunked(&path, &states, "zstd", bomb, |_| 1024);
    let error = text(&path, None).unwrap_err().to_string();
    assert!(error.contains("holds more of 1024 bytes"), "{error}");
}

#[test]
fn the_hand_s_way_comes_back_from_a_session_and_the_joints_way_from_a_robot_s_log() {
    let folder = tempfile::tempdir().unwrap();
    let joints = ["x", "y"].map(str::to_owned);
    let states = [
        ("/device", state(0, &["x", "y"], &[9.0, 9.0], &[])),
        ("/hand", state(1_700_000_000_000, &["y", "x"], &[1.0, 0.0], &[])),
        ("/hand", state(1_700_000_000_250, &["x"], &[7.0], &[])),
        ("/hand", state(1_700_000_000_500, &["x", "y"], &[0.5, 1.5], &[])),
        ("/hand", state(1_700_000_000_500, &["x", "y"], &[8.0, 8.0], &[])),
        ("/hand", state(1_700_000_000_100, &["x", "y"], &[8.0, 8.0], &[])),
        ("/hand", state(1_700_000_002_000, &["x", "y"], &[1.0, f64::NAN], &[])),
    ];
    let path = file(folder.path(), "log.mcap", &states);
    let course = Course::read(&path, None, &joints).unwrap();
    let expected = [(0.0, JointVector::from_slice(&[0.0, 1.0])), (0.5, JointVector::from_slice(&[0.5, 1.5]))];
    assert_eq!((course.topic.as_str(), &course.samples[..], course.left_out), ("/hand", &expected[..], 4));
    assert_eq!(Course::read(&path, Some("/device"), &joints).unwrap().samples.len(), 1);
    let error = Course::read(&path, None, &["z".to_owned()]).unwrap_err().to_string();
    assert!(error.contains("gives the positions of z") && error.contains("--topic"), "{error}");
    assert!(Course::read(&path, Some("/nothing"), &joints).unwrap_err().to_string().contains("no topic /nothing"));
}

#[test]
fn damaged_files_are_errors_with_the_remedy_and_never_panics() {
    let folder = tempfile::tempdir().unwrap();
    let states: Vec<(&str, JointState)> =
        (0..20_u32).map(|k| ("/a", state(u64::from(k), &["x"], &[f64::from(k)], &[1.0]))).collect();
    let path = file(folder.path(), "log.mcap", &states);
    let whole = fs::read(&path).unwrap();
    let mapping = Mapping::of_joint_states(&["x".to_owned()], "/a", Effort::Contact);
    let damaged = folder.path().join("damaged.mcap");
    for length in (8..whole.len()).step_by(7) {
        fs::write(&damaged, &whole[..length]).unwrap();
        let error = import(&mapping, std::slice::from_ref(&damaged), &mut |_| ()).err();
        let text = error.map(|error| error.to_string()).unwrap_or_default();
        assert!(text.starts_with(&format!("{}: ", damaged.display())), "{length} bytes: {text}");
        assert!(!text.contains("permissions"), "{length} bytes: {text}");
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

/// Greatest distance between the ways of a device whose hand went the same way twice (rad): the hand's speed of 1 rad/s
/// at most over half of a tick, by which its recording is interpolated, is less.
const SAME_WAY: f64 = 1e-4;

fn haptize(folder: &Path, arguments: &[&str]) -> (bool, String) {
    let output = program::haptize(folder, arguments);
    (output.status.success(), if output.status.success() { program::text(&output.stdout) } else { message(&output) })
}

#[test]
fn a_session_is_recorded_as_mcap_and_gridized_again() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path();
    fs::write(path.join("finger.toml"), finger()).unwrap();
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
    // The hand goes the same way again, and the device is where it was, to the nanosecond of the stamps.
    let (fine, told) =
        haptize(path, &["play", "f.haptize", "--motion", "session.mcap", "-o", "again", "--record", "again.mcap"]);
    assert!(fine, "{told}");
    let joints = ["q1".to_owned()];
    let way = |name: &str, topic| Course::read(&path.join(name), Some(topic), &joints).unwrap().samples;
    let (before, after) = (way("session.mcap", "/device"), way("again.mcap", "/device"));
    assert!(before.len() > 900 && after.len() + 2 > before.len(), "{} {}", before.len(), after.len());
    let farthest = before.iter().zip(&after).map(|(a, b)| (a.1[0] - b.1[0]).abs()).fold(0.0, f64::max);
    assert!(farthest < SAME_WAY, "{farthest}");
    let (fine, told) = haptize(path, &["play", "f.haptize", "--topic", "/hand"]);
    assert!(!fine && told.contains("--topic is for"), "{told}");
    let (fine, told) = haptize(path, &["play", "f.haptize", "--replay", "session.mcap"]);
    assert!(!fine && told.contains("session.mcap"), "{told}");
}

#[test]
fn a_plan_goes_out_as_a_trajectory_that_rests_at_every_point() {
    let scene = ScanScene::load(Path::new(env!("CARGO_MANIFEST_DIR")).join("datasets/sponge.toml")).unwrap();
    let chain = Chain::new(&scene.proxy);
    let plan = Plan::new(&scene.scan, &chain).unwrap();
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
    let motion = haptize::device::Motion::from_csv(&path.join("plan.csv"), &labels(&chain)).unwrap();
    assert_eq!(motion.duration(), Trajectory::new(&plan, scene_speed(), 0.5).duration());
    let (fine, told) = haptize(path, &["scan", scene.to_str().unwrap(), "--plan-out", "plan.csv", "--dwell", "-1"]);
    assert!(!fine && told.contains("dwell"), "{told}");
}

fn scene_speed() -> f64 {
    let scene = Path::new(env!("CARGO_MANIFEST_DIR")).join("datasets/sponge.toml");
    ScanScene::load(scene).unwrap().scan.control.speed
}
