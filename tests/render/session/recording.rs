//! Sessions that are recorded, replayed and read back.

use super::*;

#[test]
fn a_device_that_moves_as_recorded_is_given_the_recorded_torques_bit_for_bit() {
    let (data, spec) = (half_space_of(2), haptics(2));
    let trace = pressed(2, &spec);
    let mut file = tempfile::NamedTempFile::new().unwrap();
    for tick in &trace.ticks {
        use std::io::Write;
        writeln!(file, "{},{},{}", tick.time, tick.device[0], tick.device[1]).unwrap();
    }
    let mut device = Recorded::new(
        Motion::from_csv(
            file.path(),
            &["a", "b"].map(|name| haptize::dataset::JointLabel { name: name.into(), unit: "rad".into() }),
        )
        .unwrap(),
    );
    let haptics = build(&data, &spec);
    let again = session::run(&haptics, &mut device, None, &plan(&data, 2.0)).unwrap();
    assert_eq!(again.ticks.len(), trace.ticks.len());
    for (a, b) in again.ticks.iter().zip(&trace.ticks) {
        assert_eq!((a.device_torque, a.proxy, a.accounts), (b.device_torque, b.proxy, b.accounts), "at {} s", a.time);
    }
}

/// Two ticks of two joints, every column with a number of its own.
fn marked() -> Trace {
    let labels = [("a,b", "rad"), ("c", "m")];
    let joints = labels.map(|(name, unit)| JointLabel { name: name.into(), unit: unit.into() }).into();
    let mut number = 0.0;
    let mut next = || {
        number += 1.0;
        number
    };
    let mut both = || vector(&[next(), next() / 16.0]);
    let tick = Tick {
        inputs: Inputs { position: both(), age: 0.25, elapsed: 0.5, interval: 0.75 },
        hand: both(),
        device: both(),
        proxy: both(),
        device_torque: both(),
        applied: Applied { torque: both(), clamps: Clamps::SIZE, halt: Some(Halt::Stale) },
        sample: Sample {
            torque: both(),
            index: 0.125,
            contact: true,
            contact_nodes: 7,
            energy: 1e-30,
            share: 0.875,
            twin: 0.25,
            flags: Flags::LAYER,
        },
        flags: Flags::LAYER | Flags::HELD,
        fault: Some(Fault::Late),
        accounts: Accounts { kinetic: -0.0, ..Accounts::default() },
        frames: 3,
        ..Tick::default()
    };
    let lost = Inputs { position: vector(&[f64::NAN]), ..tick.inputs };
    let ticks = vec![tick, Tick { time: 1.5, inputs: lost, restart: true, fault: None, ..tick }];
    let frames = vec![Frame { time: 0.0, proxy: tick.proxy, nodes: Vec::new() }];
    Trace { joints, start: vector(&[0.5, -1.0]), ticks, frames }
}

const TRACE_FILE: &str = "\
time [s],hand a_b [rad],hand c [m],device a_b [rad],device c [m],proxy a_b [rad],proxy c [m],device torque a_b [N m],\
device torque c [N],held torque a_b [N m],held torque c [N],contact torque a_b [N m],contact torque c [N],\
contact index,contact,contact nodes,twin share,flags,fault,clamps,halt,initial [J],kinetic [J],spring [J],presliding [J],\
coupling work [J],channel work [J],field work [J],stop work [J],proxy dissipation [J],coupling dissipation [J],\
friction dissipation [J],control dissipation [J],residual [J],exchanged [J],stored [J],relaxed [J],\
first stored [J],leak [J],port work [J],device dissipation [J]
";

/// What a program that was written for these files relies on: names, units, order, and how numbers are spelt.
#[test]
fn files_of_a_session_have_the_columns_that_programs_know() {
    let trace = marked();
    let mut written = Vec::new();
    trace.write_ticks(&mut written).unwrap();
    let text = String::from_utf8(written).unwrap();
    let (fault, halt) = (Fault::Late, Halt::Stale);
    let start = "3,0.25,5,0.375,7,0.5,9,0.625,11,0.75,13,0.875,0.125,1,7,0.25,136";
    let end = "0,-0,0,0,0,0,0,0,0,0,0,0,0,0,0,0,,0,0,0";
    assert_eq!(text, format!("{TRACE_FILE}0,{start},{fault},1,{halt},{end}\n1.5,{start},,1,{halt},{end}\n"));

    let mut written = Vec::new();
    Recording::write(&trace, &mut written).unwrap();
    let text = String::from_utf8(written).unwrap();
    let head = "# start,0.5,-1\n# frames,0\nelapsed [s],interval [s],age [s],restart,frames,position a_b [rad],\
                position c [m],hand a_b [rad],hand c [m],torque a_b [N m],torque c [N],proxy a_b [rad],proxy c [m],\
                held a_b [N m],held c [N]";
    let rest = "3,0.25,9,0.625,7,0.5,11,0.75";
    let [first, second] = [format!("0.5,0.75,0.25,0,3,1,0.125,{rest}"), format!("0.5,0.75,0.25,1,3,NaN,,{rest}")];
    assert_eq!(text.split_once('\n').unwrap().1, format!("{head}\n{first}\n{second}\n"));
}

/// A session as it happens at its worst: ticks that come early and late, a device that fails twice, a fault cleared.
fn eventful(haptics: &Haptics) -> Trace {
    let mut positions: Vec<JointVector> = (0..600).map(|k| all(2, 0.3 * (0.02 * f64::from(k)).sin())).collect();
    positions[300] = vector(&[0.1, f64::NAN]);
    positions[500] = vector(&[]);
    let mut device = Scripted::new(positions);
    let mut driver = Driver::new(haptics, &mut device).unwrap();
    let mut trace = Trace { start: *driver.start(), ..Trace::default() };
    let mut elapsed = 1e-3;
    for k in 0..599 {
        if k == 400 {
            driver.clear_fault();
        }
        let interval = 1e-3 * (1.2 + (1.7 * f64::from(k)).sin());
        trace.ticks.push(driver.tick(elapsed, interval).0);
        elapsed = interval;
    }
    trace
}

#[test]
fn a_recorded_session_replays_bit_for_bit_with_its_faults() {
    let data = half_space_of(2);
    let haptics = build(&data, &haptics(2));
    let mut trace = eventful(&haptics);
    trace.joints = labels(&data.grid);
    let restarts = trace.ticks.iter().filter(|tick| tick.restart).count();
    let reasons: Vec<_> = [0, 299, 398, 400, 499].map(|k| trace.ticks[k].fault).into();
    assert_eq!(restarts, 1);
    assert_eq!(reasons, [None, Some(Fault::NotFinite), Some(Fault::NotFinite), None, Some(Fault::Joints)]);

    let file = tempfile::NamedTempFile::new().unwrap();
    Recording::write(&trace, &mut file.as_file()).unwrap();
    let recording = Recording::read(file.path(), 2).unwrap();
    let again = recording.replay(&haptics, None, labels(&data.grid)).unwrap();
    assert_eq!(recording.first_difference(&again), None);
    for (a, b) in again.ticks.iter().zip(&trace.ticks) {
        assert_eq!((a.time, a.accounts, a.fault, a.restart), (b.time, b.accounts, b.fault, b.restart));
    }
    // The comparison sees the last bit of one torque, another tick, and other gains.
    let mut altered = again.clone();
    altered.ticks[7].device_torque[1] = f64::from_bits(altered.ticks[7].device_torque[1].to_bits() ^ 1);
    assert_eq!(recording.first_difference(&altered), Some(7));
    altered.ticks.truncate(5);
    assert_eq!(recording.first_difference(&altered), Some(5));
    let other = HapticsSpec { coupling_stiffness: all(2, 15.1), ..crate::common::desktop::haptics(2) };
    let other = recording.replay(&build(&data, &other), None, labels(&data.grid)).unwrap();
    assert!(recording.first_difference(&other).is_some_and(|tick| tick < 5));
}

#[test]
fn files_that_are_no_recording_are_refused_with_their_line() {
    let good = "# start,0,0\nelapsed [s],...\n0.001,0.001,0,0,0,1,1,1,1,1,1,1,1,1,1\n";
    let file = tempfile::NamedTempFile::new().unwrap();
    let read = |text: &str| {
        std::fs::write(file.path(), text).unwrap();
        Recording::read(file.path(), 2).map_err(|error| error.to_string())
    };
    assert_eq!(read(good).unwrap().ticks(), 1);
    for (old, new, expected) in [
        ("0.001,0.001,0,0,0,1", "0.001,0.001,0,0,0,1,1", ":3: 16 fields in the place of 15"),
        ("0.001,0.001,0,0,0,1", "0.001,x,0,0,0,1", ":3: \"x\" is not such a number"),
        ("0.001,0.001,0,0,0,1", "0.001,0.001,0,-1,0,1", ":3: \"-1\" is not such a number"),
        ("0.001,0.001,0,0,0,1", "0.001,0.001,0,0,0,", ":3: \"\" is not such a number"),
        ("# start,0,0\n", "", ":2: 1 tick and a first position of 0 joints"),
        ("# start,0,0\n", "# start,0\n", ":1: 1 coordinate"),
        ("0.001,0.001,0,0,0,1,1,1,1,1,1,1,1,1,1\n", "", ":2: 0 ticks"),
    ] {
        assert_eq!(good.matches(old).count(), 1);
        let message = read(&good.replace(old, new)).unwrap_err();
        assert!(message.contains(expected) && message.contains("--record"), "{message}");
    }
    assert!(Recording::read(std::path::Path::new("/nowhere.csv"), 2).is_err());
}
