//! How devices stand to a scene's arm, and what they say on a serial line.

use super::{Target, mutate};
use crate::objects;
use haptize::{
    JointVector,
    device::{
        Address, Coordinates, Guard, Kind, Limits, Motion, Simulated, SimulatedHand, Watchdog, attach,
        inverse3::Frame,
        serial::{Protocol, Reply, TwoDiy, Version, WoodenHaptics},
    },
    proxy::Chain,
    scene::{Rendering, Waypoint},
};

pub const DEVICES: Target = Target {
    name: "devices",
    extension: "toml",
    seeds: || {
        let scene = objects::scene(objects::OBJECTS[0].1, 4);
        [
            "map = [[1, 0], [-1, 1]]\noffset = [0.0, -1.5708]\neffort_limit = [0.5, 0.3]\n",
            "map = [[0, 1, 0], [1, 0, 0], [0, 0, -1]]\noffset = [0.0, 0.1, 0.0]\nnode = 0\n\
             stiffness = 300.0\ndamping = 0.5\n",
        ]
        .map(|table| format!("{scene}[device]\n{table}").into_bytes())
        .to_vec()
    },
    mutate: mutate::text,
    run: |file, input| match Rendering::parse(&String::from_utf8_lossy(input), file) {
        Ok(scene) => [Coordinates::Joints(scene.proxy.joints.len()), Coordinates::Tip]
            .map(|coordinates| driven(&scene, coordinates).map_or_else(|why| why, |()| "fine".into()))
            .join("; "),
        Err(error) => error.to_string(),
    },
    kinds: 40,
};

/// Some ticks of a device of such coordinates: what the loop reads is finite, and what it commands is bounded.
fn driven(scene: &Rendering, coordinates: Coordinates) -> Result<(), String> {
    let chain = Chain::new(&scene.proxy);
    let count = coordinates.count();
    let all = |x: f64| JointVector::from_slice(&vec![x; count]);
    let rest = [0.0, 0.05].map(|time| Waypoint { time, q: all(0.1 * time) });
    let motion = Motion::through(&rest, count).map_err(|error| error.to_string())?;
    let mut hand = scene.haptics.hand;
    (hand.stiffness, hand.damping, hand.inertia) = (all(20.0), all(0.4), all(2e-3));
    let hand = SimulatedHand::holding(&hand, &all(1e-3), &all(0.03), motion).map_err(|error| error.to_string())?;
    let limits = Limits { effort: all(1.0), watchdog: Watchdog::None };
    let guard = Guard::new(Box::new(Simulated::new(hand, coordinates, limits, Vec::new())), None);
    let guard = guard.map_err(|halt| halt.to_string())?;
    let address = Address { kind: Kind::Simulated, place: None };
    let joints = chain.degrees_of_freedom();
    let mut device = attach(guard, &address, chain, scene).map_err(|error| error.to_string())?;
    for tick in 0..5 {
        let reading = device.read(if tick == 0 { 0.0 } else { 1e-3 });
        assert_eq!(reading.position.len(), joints);
        let applied = device.apply(&JointVector::from_slice(&vec![0.1; joints]));
        assert!(applied.torque.is_finite(), "{applied:?} at {reading:?}");
    }
    Ok(())
}

pub const REPLIES: Target = Target {
    name: "replies",
    extension: "bytes",
    seeds: || {
        let angles = [-35.5_f32, 120.25].map(f32::to_le_bytes).concat();
        let of_2diy = [&[5][..], &angles, &[5], &angles].concat();
        vec![of_2diy, b"[3,120,-40,6000,0,0,0,0]\n[3,121,-41,6001,0,0,0,0]\r\n".to_vec()]
    },
    mutate: |random, input, other| match random.below(2) {
        0 => mutate::binary(random, input, other),
        _ => mutate::text(random, input, other),
    },
    run: |_, input| [heard(&TwoDiy::new(Version::V3), input), heard(&WoodenHaptics, input)].join("; "),
    kinds: 8,
};

/// Reads replies one after the other, as a line does: each is in what was received, and a position that is finite.
fn heard(protocol: &dyn Protocol, bytes: &[u8]) -> String {
    let mut rest = bytes;
    let mut kinds = Vec::new();
    while !rest.is_empty() && kinds.len() < 4 {
        match protocol.reply(rest) {
            Reply::Position { position, length } => {
                assert!(position.is_finite() && (1..=rest.len()).contains(&length), "{position:?}, {length}");
                rest = &rest[length..];
                kinds.push("a position".to_owned());
            }
            Reply::Partial => {
                kinds.push("a part".to_owned());
                break;
            }
            Reply::Wrong(halt) => {
                rest = &rest[1..];
                kinds.push(halt.to_string());
            }
        }
    }
    kinds.join(" ")
}

/// States of a device as the service sent them: one in full, one of a tick, and one of two devices, one of which says
/// nothing.
const SERVICE: [&str; 3] = [
    r#"{"session_id":15,"session":{"session_id":15,"config":{"profile":{"name":"default"}}},"inverse3":[{
"device_id":"04BA","config":{"type":"inverse3","device_info":{"major_version":7,"id":"04BA","device_type":4},
"handedness":"right","mount":{},"filters":{"force_gate":{"gain":0.3},"damping":{"scalar":-1}}},"state":{
"angular_position":{"a0":-69.31704,"a1":137.62952,"a2":19.832787},"body_orientation":{"x":-0.0498,"y":0.6954,
"z":-0.0022,"w":0.7169},"cursor_position":{"x":0.0206,"y":-0.0276,"z":0.1995},"cursor_velocity":{"x":0,"y":0,"z":0},
"mode":"idle","control_domain":"undefined","transform":{}},"status":{"calibrated":true,"in_use":false,
"power_supply":true,"ready":true}}],"verse_grip":[],"custom_verse_grip":[]}"#,
    r#"{"inverse3":[{"device_id":"04BA","state":{"cursor_position":{"x":0,"y":-1.5e-2,"z":0.25}}}]}"#,
    r#"{"inverse3":[{"device_id":"048D","status":{"calibrated":false,"ready":true}},{"device_id":"049D"}]}"#,
];

pub const FRAMES: Target = Target {
    name: "frames",
    extension: "json",
    seeds: || SERVICE.map(|frame| frame.as_bytes().to_vec()).to_vec(),
    mutate: mutate::text,
    run: |_, input| {
        // A message of another encoding ends the connection before it comes here.
        let Ok(text) = std::str::from_utf8(input) else { return "no text".into() };
        match Frame::parse(text) {
            Ok(frame) => {
                let said = frame.devices().take(3).map(|device| {
                    let position = device.cursor_position();
                    assert!(position.is_none_or(|x| x.iter().all(|x| x.is_finite())), "{position:?}");
                    let readiness = match device.is_ready() {
                        Some(true) => "ready",
                        Some(false) => "unready",
                        None => "silent",
                    };
                    format!("{readiness} {}", position.map_or("nowhere", |_| "somewhere"))
                });
                said.fold("heard".into(), |all, one| format!("{all} {one}"))
            }
            Err(halt) => halt.to_string(),
        }
    },
    kinds: 6,
};
