//! The Inverse3 against a mock of its service, which keeps the service's contract: one inventory first, then one state
//! for each message, commands that count once, idle after silence. And what may come instead.

use crate::{
    common::desktop::haptics,
    felt::{PERIOD, all},
};
use haptize::{
    device::{Device, Guard, Halt, Hardware, Inverse3, LinearMap, TipDevice, Watchdog},
    proxy::Chain,
    scene::DeviceSpec,
};
use serde_json::{Value, json};
use std::{
    io::Write,
    net::{TcpListener, TcpStream},
    sync::{
        Arc, Mutex,
        atomic::{AtomicBool, Ordering},
    },
    thread::{self, JoinHandle},
    time::{Duration, Instant},
};
use tungstenite::{Message, WebSocket, accept};

/// What the service does from now on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Mood {
    Fine,
    /// States without position, with integers and empty objects: all that is allowed.
    Sparse,
    NotCalibrated,
    Garbage,
    OtherDevice,
    Closed,
    /// No answer any more.
    Mute,
    /// Pings instead of an answer, without end.
    Pings,
    /// An answer that comes byte by byte, without end.
    Slow,
}

struct Shared {
    mood: Mood,
    force: [f64; 3],
    last_command: Instant,
    messages: Vec<String>,
}

/// The service.
struct Mock {
    address: String,
    shared: Arc<Mutex<Shared>>,
    over: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl Mock {
    fn new() -> Self {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let address = listener.local_addr().unwrap().to_string();
        let shared = Shared { mood: Mood::Fine, force: [0.0; 3], last_command: Instant::now(), messages: Vec::new() };
        let shared = Arc::new(Mutex::new(shared));
        let over = Arc::new(AtomicBool::new(false));
        let (state, ends) = (Arc::clone(&shared), Arc::clone(&over));
        listener.set_nonblocking(true).unwrap();
        let thread = thread::spawn(move || {
            while !ends.load(Ordering::Relaxed) {
                match listener.accept() {
                    Ok((stream, _)) => serve(stream, &state, &ends),
                    Err(_) => thread::sleep(Duration::from_millis(1)),
                }
            }
        });
        Self { address, shared, over, thread: Some(thread) }
    }

    fn set(&self, mood: Mood) {
        self.shared.lock().unwrap().mood = mood;
    }

    /// Force on the device; the service lets go by itself when messages stop.
    fn force(&self) -> f64 {
        let shared = self.shared.lock().unwrap();
        let idle = shared.last_command.elapsed() > Duration::from_millis(50);
        if idle { 0.0 } else { shared.force.iter().map(|f| f * f).sum::<f64>().sqrt() }
    }

    fn messages(&self) -> Vec<Value> {
        let shared = self.shared.lock().unwrap();
        shared.messages.iter().map(|text| serde_json::from_str(text).unwrap()).collect()
    }
}

impl Drop for Mock {
    fn drop(&mut self) {
        self.over.store(true, Ordering::Relaxed);
        let _ = self.thread.take().unwrap().join();
    }
}

fn device(id: &str, position: [f64; 3], ready: bool, full: bool) -> Value {
    let [x, y, z] = position;
    let mut device = json!({
        "device_id": id,
        "state": {
            "cursor_position": {"z": z, "x": x, "y": y}, "angular_position": {"a0": 0}, "transform": {}, "mode": "idle",
        },
        "status": {"calibrated": ready, "ready": true, "power_supply": true, "in_use": false, "started": true},
    });
    if full {
        device["config"] = json!({"type": "inverse3", "device_info": {"device_type": 4}, "mount": {}});
    }
    device
}

fn serve(stream: TcpStream, shared: &Mutex<Shared>, over: &AtomicBool) {
    stream.set_nonblocking(false).unwrap();
    stream.set_read_timeout(Some(Duration::from_millis(20))).unwrap();
    // A port that is only looked at is closed at once.
    let Ok(mut socket) = accept(stream) else { return };
    let send = |socket: &mut WebSocket<TcpStream>, devices: Value| {
        let frame = json!({"session_id": 15, "inverse3": devices, "verse_grip": []});
        socket.send(Message::text(frame.to_string())).is_ok()
    };
    let mut position = [0.02, -0.03, 0.2];
    let ready = shared.lock().unwrap().mood != Mood::NotCalibrated;
    send(&mut socket, json!([device("04BA", position, ready, true)]));
    while !over.load(Ordering::Relaxed) {
        let text = match socket.read() {
            Ok(Message::Text(text)) => text,
            Ok(Message::Close(_)) => return,
            Ok(_) => continue,
            Err(tungstenite::Error::Io(error)) if error.kind() == std::io::ErrorKind::WouldBlock => continue,
            Err(_) => return,
        };
        let mood = {
            let mut shared = shared.lock().unwrap();
            let message: Value = serde_json::from_str(&text).unwrap();
            let commands = &message["inverse3"][0]["commands"];
            let vector = &commands["set_cursor_force"]["vector"];
            // Commands count once.
            shared.force = ["x", "y", "z"].map(|axis| vector[axis].as_f64().unwrap_or(0.0));
            shared.last_command = Instant::now();
            shared.messages.push(text.to_string());
            shared.mood
        };
        // A hand that yields a little.
        let force = shared.lock().unwrap().force;
        for (axis, x) in position.iter_mut().enumerate() {
            *x = [0.02, -0.03, 0.2][axis] + force[axis] / 400.0;
        }
        let answered = match mood {
            Mood::Fine => send(&mut socket, json!([device("04BA", position, true, false)])),
            Mood::Sparse => send(
                &mut socket,
                json!([{"device_id": "04BA", "state": {"cursor_position": {"x": 0, "y": 0, "z": 1}, "transform": {}}}]),
            ),
            Mood::NotCalibrated => send(&mut socket, json!([device("04BA", position, false, false)])),
            Mood::Garbage => socket.send(Message::text("{\"inverse3\": 7}")).is_ok(),
            Mood::OtherDevice => send(&mut socket, json!([device("0000", position, true, false)])),
            Mood::Closed => {
                let _ = socket.close(None);
                let _ = socket.flush();
                false
            }
            Mood::Mute => true,
            Mood::Pings => endless(&mut socket, over, |socket| socket.send(Message::Ping(Vec::new().into())).is_ok()),
            Mood::Slow => {
                // A text of 65535 bytes begins.
                let begun = socket.get_mut().write_all(&[0x81, 126, 0xff, 0xff]).is_ok();
                begun && endless(&mut socket, over, |socket| socket.get_mut().write_all(b" ").is_ok())
            }
        };
        if !answered {
            return;
        }
    }
}

/// Sends `piece` a hundred times a second, until nobody listens or the mock is `over`.
fn endless(
    socket: &mut WebSocket<TcpStream>,
    over: &AtomicBool,
    piece: impl Fn(&mut WebSocket<TcpStream>) -> bool,
) -> bool {
    while !over.load(Ordering::Relaxed) && piece(socket) {
        thread::sleep(Duration::from_millis(10));
    }
    false
}

/// What a service may take at most until its device is given up: an exchange, and room for a busy machine.
const GIVEN_UP: Duration = Duration::from_secs(5);

#[test]
fn a_service_that_goes_on_without_an_answer_is_given_up() {
    for mood in [Mood::Mute, Mood::Pings, Mood::Slow] {
        let mock = Mock::new();
        let mut guard = enabled(&mock);
        mock.set(mood);
        let (begin, mut halts) = (Instant::now(), Vec::new());
        while !halts.contains(&Halt::Silent) {
            assert!(begin.elapsed() < GIVEN_UP, "{mood:?}: {halts:?}");
            let (held, some) = push(&mut guard, 1.0, 1);
            assert!(some.is_empty() || held.effort.iter().all(|effort| *effort == 0.0), "{mood:?}");
            halts.extend(some);
        }
        let begin = Instant::now();
        drop(guard);
        assert!(begin.elapsed() < GIVEN_UP, "{mood:?}");
    }
    // A force is taken back while its answer is waited for, and once more when the service is given up.
    let mock = Mock::new();
    let mut guard = enabled(&mock);
    push(&mut guard, 1.0, 300);
    mock.set(Mood::Mute);
    let begin = Instant::now();
    while !push(&mut guard, 1.0, 1).1.contains(&Halt::Silent) {
        assert!(begin.elapsed() < GIVEN_UP);
    }
    drop(guard);
    let messages = mock.messages();
    let without_force = |message: &&Value| {
        let vector = &message["inverse3"][0]["commands"]["set_cursor_force"]["vector"];
        ["x", "y", "z"].iter().all(|axis| vector[axis].as_f64() == Some(0.0))
    };
    assert_eq!(messages.iter().rev().take_while(without_force).count(), 2, "{:?}", messages.last());
    // It ends while an answer is waited for, too.
    for mood in [Mood::Pings, Mood::Slow] {
        let mock = Mock::new();
        let mut guard = enabled(&mock);
        mock.set(mood);
        push(&mut guard, 1.0, 20);
        let begin = Instant::now();
        drop(guard);
        assert!(begin.elapsed() < GIVEN_UP, "{mood:?}");
    }
}

#[test]
fn a_service_that_never_ends_its_greeting_is_refused() {
    // The handshake; the inventory.
    for greets in [false, true] {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let address = listener.local_addr().unwrap().to_string();
        let service = thread::spawn(move || {
            let (mut stream, _) = listener.accept().unwrap();
            let over = AtomicBool::new(false);
            if greets {
                endless(&mut accept(stream).unwrap(), &over, |socket| {
                    socket.send(Message::Ping(Vec::new().into())).is_ok()
                });
            } else {
                let mut bytes = b"HTTP/1.1 101 Switching Protocols\r\nX: ".iter().chain(std::iter::repeat(&b'x'));
                while stream.write_all(&[*bytes.next().unwrap()]).is_ok() {
                    thread::sleep(Duration::from_millis(10));
                }
            }
        });
        let begin = Instant::now();
        let error = Inverse3::open(Some(&address)).err().unwrap();
        assert!(begin.elapsed() < GIVEN_UP && error.contains(&address), "{error}");
        service.join().unwrap();
    }
}

fn enabled(mock: &Mock) -> Guard {
    let device = Inverse3::open(Some(&mock.address)).unwrap();
    assert_eq!(device.limits().watchdog, Watchdog::Unstated);
    let mut guard = Guard::new(Box::new(device), None).unwrap();
    guard.enable().unwrap();
    guard
}

/// Calls `session` with a device of the mock whose tip leads `chain`.
pub fn beside_the_service(chain: Chain, session: impl FnOnce(&mut dyn Device)) {
    let mock = Mock::new();
    session(&mut TipDevice::new(enabled(&mock), LinearMap::identity(3), chain, &DeviceSpec::default(), &haptics(3)));
}

/// Pushes for `ticks` milliseconds of the clock; the last answer, and the reasons that there were.
fn push(guard: &mut Guard, effort: f64, ticks: usize) -> (haptize::device::Held, Vec<Halt>) {
    let (mut held, mut halts) = (None, Vec::new());
    for _ in 0..ticks {
        thread::sleep(Duration::from_millis(1));
        guard.read(PERIOD);
        let now = guard.write(&all(3, effort));
        halts.extend(now.halt);
        held = Some(now);
    }
    halts.dedup();
    (held.unwrap(), halts)
}

#[test]
fn positions_come_and_forces_go_in_the_service_s_rhythm() {
    let mock = Mock::new();
    let mut guard = enabled(&mock);
    let (held, _) = push(&mut guard, 1.0, 1500);
    // A busy machine may pause; without a pause the force is whole.
    if held.halt.is_none() && held.clamps.is_empty() {
        assert_eq!(held.effort, all(3, 1.0));
        assert!((guard.latest().position[0] - (0.02 + 1.0 / 400.0)).abs() < 1e-3, "{:?}", guard.latest());
    }
    drop(guard);
    assert_eq!(mock.force(), 0.0);
    let messages = mock.messages();
    assert_eq!(messages[0]["session"]["configure"]["profile"]["name"], "dev.haptize:loop");
    assert!(messages[1..].iter().all(|message| message.get("session").is_none()), "the profile is told once");
    assert!(messages.iter().all(|message| message["inverse3"][0]["device_id"] == "04BA"));
    let last = &messages.last().unwrap()["inverse3"][0]["commands"]["set_cursor_force"]["vector"];
    assert_eq!((last["x"].as_f64(), last["z"].as_f64()), (Some(0.0), Some(0.0)), "the last force is none");
}

#[test]
fn no_force_is_sent_before_motors_are_on_or_while_the_device_is_not_ready() {
    let mock = Mock::new();
    mock.set(Mood::NotCalibrated);
    let mut guard = enabled(&mock);
    let (held, halts) = push(&mut guard, 1.0, 300);
    assert_eq!(held.halt, Some(Halt::NotReady));
    assert!(halts.iter().all(|halt| matches!(halt, Halt::NotReady | Halt::Stale)), "{halts:?}");
    assert_eq!(mock.force(), 0.0);
    let forces = |messages: Vec<Value>| {
        let force = |message: &Value| message["inverse3"][0]["commands"].get("set_cursor_force").is_some();
        messages.iter().filter(|message| force(message)).count()
    };
    assert_eq!(forces(mock.messages()), 0, "not calibrated");
    // Ready again, torque rises from zero.
    mock.set(Mood::Fine);
    push(&mut guard, 1.0, 300);
    assert!(forces(mock.messages()) > 0);
}

#[test]
fn a_loop_that_stops_leaves_no_force_though_the_connection_lives() {
    let mock = Mock::new();
    let mut guard = enabled(&mock);
    push(&mut guard, 2.0, 800);
    thread::sleep(Duration::from_millis(60));
    let count = mock.messages().len();
    assert_eq!(mock.force(), 0.0, "a command that is not renewed is dropped");
    thread::sleep(Duration::from_millis(30));
    assert!(mock.messages().len() > count, "positions are asked for all the same");
}

#[test]
fn what_the_service_may_leave_out_is_no_fault_and_what_it_may_not_ends_the_force() {
    let mock = Mock::new();
    let mut guard = enabled(&mock);
    push(&mut guard, 1.0, 600);
    mock.set(Mood::Sparse);
    let (_, halts) = push(&mut guard, 1.0, 100);
    assert!(halts.iter().all(|halt| *halt == Halt::Stale), "{halts:?}");
    for (mood, reasons) in [
        (Mood::Garbage, &[Halt::Stale, Halt::Garbage][..]),
        (Mood::OtherDevice, &[Halt::Stale, Halt::Unplugged]),
        (Mood::Closed, &[Halt::Stale, Halt::Unplugged]),
        (Mood::Mute, &[Halt::Stale, Halt::Silent]),
    ] {
        let mock = Mock::new();
        let mut guard = enabled(&mock);
        push(&mut guard, 1.0, 600);
        mock.set(mood);
        let (held, halts) = push(&mut guard, 1.0, 700);
        assert_eq!((held.halt, held.effort), (reasons.last().copied(), all(3, 0.0)), "{mood:?}");
        assert!(halts.iter().all(|halt| reasons.contains(halt)), "{mood:?}: {halts:?}");
    }
}

#[test]
fn services_and_devices_that_are_not_there_are_refused_with_the_remedy() {
    let error = Inverse3::open(Some("127.0.0.1:1")).err().unwrap();
    assert!(error.contains("no service"), "{error}");
    let mock = Mock::new();
    let error = Inverse3::open(Some(&format!("{}/0000", mock.address))).err().unwrap();
    assert!(error.contains("it has: 04BA"), "{error}");
    // Something else listens.
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = listener.local_addr().unwrap().to_string();
    let error = Inverse3::open(Some(&address)).err().unwrap();
    assert!(error.contains("no Haply service"), "{error}");
}

/// The device is one of the loop's, too.
#[test]
fn a_cursor_leads_an_arm() {
    use haptize::{
        device::{LinearMap, TipDevice},
        scene::DeviceSpec,
    };
    let mock = Mock::new();
    let chain = crate::tip::arm();
    let mut device = TipDevice::new(
        enabled(&mock),
        LinearMap::identity(3),
        chain,
        &DeviceSpec::default(),
        &crate::common::desktop::haptics(3),
    );
    for _ in 0..200 {
        thread::sleep(Duration::from_millis(1));
        assert!(device.read(PERIOD).position.is_finite());
        device.apply(&all(3, 0.0));
    }
}
