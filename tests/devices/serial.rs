//! Serial devices against emulators behind pseudo-terminals: golden bytes, a simulated hand, and a line that
//! misbehaves.

use crate::{
    emulator::{Emulator, Fault, Firmware, Line, TwoDiyFirmware, WoodenFirmware},
    felt::{PERIOD, accounts_close, all, half_space_loop, pressing, run},
};
use haptize::{
    JointVector,
    device::{
        Device, Guard, Halt, Hardware, JointDevice, LONGEST_AGE, LinearMap,
        serial::{Port, Protocol, Reply, TwoDiy, Version, WoodenHaptics},
    },
};

/// Configuration of the 2DIY around which the tests move (rad).
fn middle() -> JointVector {
    JointVector::from_slice(&[168.25_f64.to_radians(), 12.5_f64.to_radians()])
}

/// The map that puts `middle` at the origin.
fn centred(middle: &JointVector) -> LinearMap {
    let mut offset = *middle;
    offset.iter_mut().for_each(|x| *x = -*x);
    LinearMap::identity(middle.len()).moved(&offset).unwrap()
}

fn two_diy() -> (Emulator<TwoDiyFirmware>, Guard) {
    let emulator = Emulator::new(TwoDiyFirmware::default(), pressing(2, &middle()));
    emulator.while_opening(|path| patiently(|| enabled(Box::new(TwoDiy::open(path, Version::V3)?))))
}

fn wooden() -> (Emulator<WoodenFirmware>, Guard) {
    let emulator = Emulator::new(WoodenFirmware::default(), pressing(3, &wooden_middle()));
    emulator.while_opening(|path| patiently(|| enabled(Box::new(WoodenHaptics::open(path)?))))
}

fn wooden_middle() -> JointVector {
    JointVector::from_slice(&[0.0, 0.0, 1.5])
}

fn enabled(hardware: Box<dyn Hardware>) -> Result<Guard, String> {
    let mut guard = Guard::new(hardware, None).map_err(|halt| halt.to_string())?;
    guard.enable().map_err(|halt| halt.to_string())?;
    Ok(guard)
}

/// Opens a device on a machine that may be too busy for the emulator's thread to answer in the milliseconds that a
/// device takes.
fn patiently<T>(mut open: impl FnMut() -> Result<T, String>) -> T {
    for _ in 0..50 {
        if let Ok(opened) = open() {
            return opened;
        }
    }
    open().unwrap()
}

/// A terminal that was named by mistake is one again.
#[test]
fn a_line_has_its_settings_back_whether_a_device_was_there_or_not() {
    use rustix::termios::{LocalModes, OptionalActions, tcgetattr, tcsetattr};
    let line = Line::new();
    let terminal = std::fs::File::open(&line.path).unwrap();
    let mut settings = tcgetattr(&terminal).unwrap();
    settings.local_modes |= LocalModes::ICANON | LocalModes::ISIG;
    tcsetattr(&terminal, OptionalActions::Now, &settings).unwrap();
    let found = tcgetattr(&terminal).unwrap();
    let port = Port::open(&line.path).unwrap();
    assert_ne!(tcgetattr(&terminal).unwrap().local_modes, found.local_modes);
    drop(port);
    let again = || {
        let settings = tcgetattr(&terminal).unwrap();
        (settings.local_modes, settings.input_modes, settings.output_modes, settings.control_modes)
    };
    let before = (found.local_modes, found.input_modes, found.output_modes, found.control_modes);
    assert_eq!(again(), before);
    // Nobody answers there.
    assert!(TwoDiy::open(&line.path, Version::V3).is_err() && WoodenHaptics::open(&line.path).is_err());
    assert_eq!(again(), before);
    // Others may open it, too.
    std::fs::File::open(&line.path).unwrap();
}

/// Calls `session` with a 2DIY whose emulator runs beside it.
pub fn beside_two_diy(session: impl FnOnce(&mut dyn Device)) {
    let emulator = Emulator::new(TwoDiyFirmware::default(), pressing(2, &middle()));
    emulator.beside(true, |path| {
        let guard = patiently(|| enabled(Box::new(TwoDiy::open(path, Version::V3)?)));
        session(&mut JointDevice::new(guard, centred(&middle())));
    });
}

/// Calls `session` with a WoodenHaptics whose emulator runs beside it.
pub fn beside_wooden_haptics(session: impl FnOnce(&mut dyn Device)) {
    let emulator = Emulator::new(WoodenFirmware::default(), pressing(3, &wooden_middle()));
    emulator.beside(true, |path| {
        let guard = patiently(|| enabled(Box::new(WoodenHaptics::open(path)?)));
        session(&mut JointDevice::new(guard, centred(&wooden_middle())));
    });
}

#[test]
fn the_two_diy_s_bytes_are_those_of_the_maker_s_own_client() {
    let setup = "01 05 03 01 01 03 01 01 00 00 00 00 40 41 00 80 98 45 00 00 28 43 00 80 98 45";
    let hex: Vec<String> = Version::V3.setup().iter().map(|byte| format!("{byte:02x}")).collect();
    assert_eq!(hex.join(" "), setup);
    let emulator = Emulator::new(TwoDiyFirmware::default(), pressing(2, &middle()));
    let (mut emulator, mut device) = emulator.while_opening(|path| patiently(|| TwoDiy::open(path, Version::V3)));
    assert_eq!(emulator.firmware.setup, Version::V3.setup());
    let expected = [2, 5, 0x47, 0xf1, 0x38, 0x3c, 0xe7, 0xa9, 0x6b, 0xbc];
    let torque = |at: usize| f64::from(f32::from_le_bytes(expected[at..at + 4].try_into().unwrap()));
    let (first, second) = (torque(6), torque(2));
    assert!((first + 0.014_384).abs() < 1e-6 && (second - 0.011_288).abs() < 1e-6, "by joint");
    device.write(&JointVector::from_slice(&[first, second])).unwrap();
    emulator.step(0.0);
    assert_eq!(emulator.firmware.requests.last().unwrap()[..], expected);
    let measured = device.read(PERIOD).unwrap();
    assert!((measured.position[0] - 168.25_f64.to_radians()).abs() < 0.3, "{measured:?}");
}

#[test]
fn wooden_haptics_numbers_are_those_of_its_makers_software() {
    let emulator = Emulator::new(WoodenFirmware::default(), pressing(3, &wooden_middle()));
    let (mut emulator, mut device) = emulator.while_opening(|path| patiently(|| WoodenHaptics::open(path)));
    device.write(&JointVector::from_slice(&[0.0, 0.016_084_11, 0.244_664_24])).unwrap();
    emulator.step(0.0);
    assert_eq!(emulator.firmware.milliamps, [0.0, 52.0, 787.0]);
    // Home counts are added: (100, -300, 5800) after them.
    emulator.angles = JointVector::from_slice(&[0.019_635_0, -0.078_539_8, 1.518_436_4]);
    emulator.line.send(b"");
    let reply = emulator.firmware.take(b"[0,0,0]\n", &emulator.angles)[0].clone();
    assert_eq!(String::from_utf8(reply).unwrap(), "[3,100,-300,-200,0,0,0,0]\n");
}

/// Sessions against `emulator` close their accounts and feel the contact, without an allocation in a tick.
fn feels<F: Firmware + 'static>(mut emulator: Emulator<F>, guard: Guard, middle: &JointVector) {
    let joints = middle.len();
    let haptics = half_space_loop(joints);
    let mut device = JointDevice::new(guard, centred(middle));
    let ticks = run(&haptics, &mut device, 1200, |_| emulator.step(PERIOD));
    let halts: Vec<_> = ticks.iter().filter_map(|tick| tick.applied.halt).collect();
    assert!(halts.is_empty(), "{halts:?}");
    assert!(ticks.iter().all(|tick| tick.fault.is_none()));
    assert!(ticks.iter().skip(1).all(|tick| tick.inputs.age <= 3.0 * PERIOD + 1e-12), "replies are fresh");
    assert!(
        ticks[1000..].iter().all(|tick| tick.sample.contact && tick.applied.torque[0] < -0.01),
        "{:?}",
        ticks.last()
    );
    assert!(accounts_close(&ticks));
    // The torque that the device holds is the one that was sent, to the resolution of its message.
    let [sent, held] = [&ticks.last().unwrap().applied.torque, &emulator.firmware.torque()];
    assert!((0..joints).all(|a| (sent[a] - held[a]).abs() < 1e-3), "{sent:?} {held:?}");
    drop(device);
    emulator.step(0.0);
    assert_eq!(emulator.firmware.torque().norm(), 0.0, "dropped without torque");
}

#[test]
fn a_half_space_is_felt_through_a_two_diy() {
    let (emulator, guard) = two_diy();
    feels(emulator, guard, &middle());
}

#[test]
fn a_half_space_is_felt_through_a_wooden_haptics() {
    let (emulator, guard) = wooden();
    feels(emulator, guard, &wooden_middle());
}

/// What becomes of a session whose line misbehaves as `fault` from tick 700 to tick `until`.
fn misbehaves<F: Firmware + 'static>(
    (mut emulator, guard): (Emulator<F>, Guard),
    middle: &JointVector,
    fault: Fault,
    until: usize,
) -> (Vec<Option<Halt>>, Vec<f64>) {
    let haptics = half_space_loop(middle.len());
    let mut device = JointDevice::new(guard, centred(middle));
    let (mut torques, mut tick_number) = (Vec::new(), 0);
    let ticks = run(&haptics, &mut device, 830, |_| {
        tick_number += 1;
        emulator.fault = if (700..until).contains(&tick_number) { fault } else { Fault::None };
        emulator.step(PERIOD);
        torques.push(emulator.firmware.torque().norm());
    });
    assert!(torques[690] > 1e-3, "there was a torque to lose");
    (ticks.iter().map(|tick| tick.applied.halt).collect(), torques)
}

fn check_line<F: Firmware + 'static>(open: fn() -> (Emulator<F>, Guard), middle: &JointVector) {
    // What is over soon costs nothing: one reply split, lost in part, or late by a tick or two.
    for fault in [Fault::Split(1), Fault::Split(5), Fault::Dropped(0), Fault::Dropped(3), Fault::Late(1), Fault::Mute] {
        let (halts, _) = misbehaves(open(), middle, fault, 701);
        let lost = halts.iter().filter(|halt| halt.is_some()).count();
        assert_eq!(lost, 0, "{fault:?}: {:?}", halts.iter().flatten().next());
    }
    // What stays ends in zero torque within two ticks of its finding, with its reason.
    let lasting = [
        (Fault::Mute, vec![Halt::Stale]),
        (Fault::Late(8), vec![Halt::Stale]),
        (Fault::Noise, vec![Halt::Stale, Halt::Garbage]),
        (Fault::Flood, vec![Halt::Stale, Halt::Garbage]),
        (Fault::OtherDevice, vec![Halt::Stale, Halt::WrongDevice]),
    ];
    for (fault, reasons) in lasting {
        let (halts, torques) = misbehaves(open(), middle, fault, 1000);
        let first = halts.iter().position(Option::is_some).unwrap_or_else(|| panic!("{fault:?} was not found"));
        assert!(first <= 709, "{fault:?}: found at tick {first}");
        assert!(torques[first + 2..].iter().all(|torque| *torque == 0.0), "{fault:?}");
        let mut found: Vec<Halt> = halts.into_iter().flatten().collect();
        found.dedup();
        assert!(found.iter().all(|halt| reasons.contains(halt)), "{fault:?}: {found:?}");
        assert_eq!(found.last(), reasons.last(), "{fault:?}");
    }
}

#[test]
fn a_line_that_misbehaves_never_leaves_a_two_diy_under_torque() {
    check_line(two_diy, &middle());
}

#[test]
fn a_line_that_misbehaves_never_leaves_a_wooden_haptics_under_torque() {
    check_line(wooden, &wooden_middle());
}

#[test]
fn lost_replies_make_a_line_stale_but_not_for_good() {
    let emulator = Emulator::new(TwoDiyFirmware::default(), pressing(2, &middle()));
    let (mut emulator, mut device) = emulator.while_opening(|path| patiently(|| TwoDiy::open(path, Version::V3)));
    // A device that is not driven asks by itself.
    let ages = (0..600).map(|tick| {
        let age = device.read(PERIOD).unwrap().age;
        emulator.fault = if tick < 100 && tick % 10 == 9 { Fault::Mute } else { Fault::None };
        emulator.step(PERIOD);
        age
    });
    let ages: Vec<f64> = ages.collect();
    assert!(ages[..200].iter().any(|age| *age > LONGEST_AGE), "{ages:?}");
    assert!(ages[400..].iter().all(|age| *age <= 2.0 * PERIOD + 1e-12), "{:?}", &ages[400..]);
}

#[test]
fn an_unplugged_line_is_found_at_the_next_tick() {
    let (mut emulator, guard) = two_diy();
    let haptics = half_space_loop(2);
    let mut device = JointDevice::new(guard, centred(&middle()));
    let mut line = None;
    let mut count = 0;
    let ticks = run(&haptics, &mut device, 800, |_| {
        count += 1;
        if count < 700 {
            emulator.step(PERIOD);
        } else if count == 700 {
            line = Some(std::mem::replace(&mut emulator.line, Line::new()));
            // The master goes: what is left of the line gives errors.
            line = None;
        }
    });
    assert!(line.is_none());
    let first = ticks.iter().position(|tick| tick.applied.halt.is_some()).unwrap();
    assert!(first <= 701, "found at {first}");
    assert_eq!(ticks[first].applied.halt, Some(Halt::Unplugged));
    assert!(ticks[first..].iter().all(|tick| tick.applied.torque.norm() == 0.0));
}

#[test]
fn what_is_no_such_device_is_refused_with_the_remedy() {
    let path = |open: &dyn Fn(&str) -> Option<String>, text: &str| {
        let error = open("/nowhere/ttyACM7").unwrap();
        assert!(error.contains("not there"), "{error}");
        let file = tempfile::NamedTempFile::new().unwrap();
        let error = open(file.path().to_str().unwrap()).unwrap();
        assert!(error.contains("no serial line"), "{error}");
        // A line behind which nobody answers.
        let line = Line::new();
        let error = open(&line.path).unwrap();
        assert!(error.contains(text), "{error}");
    };
    path(&|place| TwoDiy::open(place, Version::V2).err(), "does not answer in time");
    path(&|place| WoodenHaptics::open(place).err(), "does not answer in time");
    // The other device.
    let emulator = Emulator::new(WoodenFirmware::default(), pressing(3, &all(3, 0.0)));
    let (mut emulator, _) = emulator.while_opening(|_| ());
    emulator.fault = Fault::OtherDevice;
    let (_, error) = emulator.while_opening(|path| WoodenHaptics::open(path).err().unwrap());
    assert!(error.contains("another device"), "{error}");
}

#[test]
fn replies_that_are_none_are_never_taken_for_positions() {
    let wooden = |text: &str| WoodenHaptics.reply(text.as_bytes());
    assert!(matches!(wooden("[3,1,2,3,4,5,6,0]\n"), Reply::Position { length: 18, .. }));
    assert!(matches!(wooden("[3,1,2,3,4,5,6,0]\n[3,1"), Reply::Position { length: 18, .. }));
    assert_eq!(wooden("[3,1,2,3,4,5,6"), Reply::Partial);
    for wrong in [
        "3,1,2,3,4,5,6,0\n",
        "[3,1,2,3,4,5,6]\n",
        "[3,1,2,3,4,5,6,0,7]\n",
        "[3,1,2,x,4,5,6,0]\n",
        "[3,1,2,99999999999,4,5,6,0]\n",
        "\n",
        "[]\n",
    ] {
        assert_eq!(wooden(wrong), Reply::Wrong(Halt::Garbage), "{wrong:?}");
    }
    assert_eq!(WoodenHaptics.reply(&[0xff, 0xfe, b'\n']), Reply::Wrong(Halt::Garbage));
    assert_eq!(wooden("[3,1,2,3,4,5,6,512]\n"), Reply::Wrong(Halt::DeviceError(512)));
    assert_eq!(wooden("[1,1,2,3,4,5,6,0]\n"), Reply::Wrong(Halt::WrongDevice));
}
