//! Haply Inverse3, through the maker's service: position of its cursor (m) and force on it (N).
//!
//! The service (Inverse SDK 3.5) speaks WebSocket, by default on port 10001 of this machine. On connection it sends one
//! inventory of all devices; then exactly one state for each message that it gets. Commands count once: when messages
//! stop, the device returns to idle by itself, after a time that the maker does not state.
//!
//! A thread of its own keeps that rhythm: it sends the latest command, takes the state that answers it, and passes it
//! on; neither side waits for the other. A command that the loop has not renewed for [`STALE_COMMAND`] is replaced by a
//! reading without force, so that a loop that hangs does not leave the last force on. Force is sent only while the
//! device says that it is calibrated, ready and powered.
//!
//! The service adds to forces what its user has set: compensation of gravity, a force gate, damping. These settings
//! stay as they are.
//!
//! Source: the maker's public documentation, version 3.5, and recorded messages of its client library. Not tried on
//! hardware.

mod frame;

pub use frame::{DeviceState, Frame};

use super::{Command, Coordinates, Halt, Hardware, Limits, Measurement, Watchdog};
use crate::{JointVector, threads::spawn};
use std::{
    fmt::Write as _,
    io::{self, ErrorKind, Read, Write},
    net::{TcpStream, ToSocketAddrs},
    sync::{
        Arc,
        atomic::{AtomicBool, Ordering},
    },
    thread::{self, JoinHandle},
    time::{Duration, Instant},
};
use tungstenite::{Message, WebSocket};

/// Address of the service.
const ADDRESS: &str = "localhost:10001";

/// Maximum force (N): well within what the maker states for the device.
const MOST_FORCE: f64 = 4.0;

/// Time after which a command that is not renewed is dropped.
pub const STALE_COMMAND: Duration = Duration::from_millis(10);

/// Time between two messages.
const PERIOD: Duration = Duration::from_millis(1);

/// How long a connection, the handshake or an answer is waited for, in however many pieces it comes.
const PATIENCE: Duration = Duration::from_millis(500);

/// Longest message of the service (bytes): an inventory of many devices has some thousand.
const LONGEST_MESSAGE: usize = 1 << 20;

/// Message of the thread to the loop.
#[derive(Clone, Copy, Debug)]
struct Seen {
    position: [f64; 3],
    at: Instant,
    ready: bool,
    ended: Option<Halt>,
}

/// Message of the loop to the thread.
#[derive(Clone, Copy, Debug)]
struct Wanted {
    /// None before motors are enabled.
    force: Option<[f64; 3]>,
    at: Instant,
}

/// A connection to the service, with the thread that keeps it.
pub struct Inverse3 {
    id: String,
    seen: triple_buffer::Output<Seen>,
    wanted: triple_buffer::Input<Wanted>,
    enabled: bool,
    over: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl Inverse3 {
    /// Returns the address at which the service is looked for.
    #[must_use]
    pub fn address() -> &'static str {
        ADDRESS
    }

    /// Returns whether something listens at the service's address.
    #[must_use]
    pub fn is_there() -> bool {
        connect(ADDRESS).is_ok()
    }

    /// Connects to the service at `place`, `HOST:PORT` or `HOST:PORT/DEVICE`, and takes the device of that number or
    /// the first.
    ///
    /// # Errors
    /// In words, with the remedy.
    pub fn open(place: Option<&str>) -> Result<Self, String> {
        let place = place.unwrap_or(ADDRESS);
        let (address, wanted_id) = place.split_once('/').map_or((place, None), |(address, id)| (address, Some(id)));
        let stream = Timed { stream: connect(address)?, due: Instant::now() + PATIENCE };
        let config = tungstenite::protocol::WebSocketConfig::default()
            .max_message_size(Some(LONGEST_MESSAGE))
            .max_frame_size(Some(LONGEST_MESSAGE));
        let (mut socket, _) = tungstenite::client::client_with_config(format!("ws://{address}/"), stream, Some(config))
            .map_err(|error| format!("{address} is no Haply service: {error}"))?;
        socket.get_mut().renew(PATIENCE);
        let inventory = receive(&mut socket).map_err(|halt| format!("{address}: no inventory: {halt}"))?;
        let chosen = inventory.devices().find(|device| wanted_id.is_none_or(|id| device.id() == id));
        let Some(device) = chosen else {
            let known: Vec<&str> = inventory.devices().map(DeviceState::id).collect();
            return Err(match wanted_id {
                Some(id) => format!("the service has no device {id}; it has: {}", known.join(", ")),
                None => "the service has no Inverse3: plug it in, switch its power on".into(),
            });
        };
        let id = device.id().to_owned();
        if !id.chars().all(|c| c.is_ascii_alphanumeric()) {
            return Err(format!("the service names a device {id:?}, which is no number of a device"));
        }
        let now = Instant::now();
        let mut first = Seen { position: [0.0; 3], at: now, ready: false, ended: None };
        first.take(device);
        let (publish, seen) = triple_buffer::triple_buffer(&first);
        let (wanted, commands) = triple_buffer::triple_buffer(&Wanted { force: None, at: now });
        let over = Arc::new(AtomicBool::new(false));
        let link = Link { socket, id: id.clone(), seen: first, publish, commands, over: Arc::clone(&over) };
        let thread = spawn("inverse3", move || link.run()).map_err(|error| error.to_string())?;
        Ok(Self { id, seen, wanted, enabled: false, over, thread: Some(thread) })
    }
}

fn connect(address: &str) -> Result<TcpStream, String> {
    let absent = || {
        format!(
            "no service answers at {address}: install and start the Haply Inverse service, or name it as in \
             inverse3:HOST:PORT"
        )
    };
    let found = address.to_socket_addrs().map_err(|_| absent())?;
    let stream =
        found.into_iter().find_map(|address| TcpStream::connect_timeout(&address, PATIENCE).ok()).ok_or_else(absent)?;
    stream.set_nodelay(true).map_err(|error| error.to_string())?;
    Ok(stream)
}

/// A connection of which no read and no write lasts beyond a time. A timeout of the socket's own begins anew with each
/// byte, and a service that sends them one by one, or pings, could hold the thread for ever.
struct Timed {
    stream: TcpStream,
    due: Instant,
}

impl Timed {
    /// From now on `patience` is left.
    fn renew(&mut self, patience: Duration) {
        self.due = Instant::now() + patience;
    }

    /// Time that is left.
    fn left(&self) -> io::Result<Duration> {
        let left = self.due.saturating_duration_since(Instant::now());
        if left.is_zero() { Err(ErrorKind::TimedOut.into()) } else { Ok(left) }
    }
}

impl Read for Timed {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        self.stream.set_read_timeout(Some(self.left()?))?;
        self.stream.read(buffer).map_err(timed_out)
    }
}

impl Write for Timed {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.stream.set_write_timeout(Some(self.left()?))?;
        self.stream.write(bytes).map_err(timed_out)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.stream.flush()
    }
}

/// Unix says of a timeout that the call would block.
fn timed_out(error: io::Error) -> io::Error {
    if error.kind() == ErrorKind::WouldBlock { ErrorKind::TimedOut.into() } else { error }
}

/// Waits for the next frame.
fn receive(socket: &mut WebSocket<Timed>) -> Result<Frame, Halt> {
    loop {
        match socket.read() {
            Ok(Message::Text(text)) => return Frame::parse(&text),
            Ok(Message::Ping(_) | Message::Pong(_)) => {}
            Ok(Message::Binary(_) | Message::Frame(_)) => return Err(Halt::Garbage),
            Ok(Message::Close(_)) => return Err(Halt::Unplugged),
            Err(_) if socket.get_mut().left().is_err() => return Err(Halt::Silent),
            Err(_) => return Err(Halt::Unplugged),
        }
    }
}

impl Seen {
    /// Takes in what `device` says.
    fn take(&mut self, device: &DeviceState) {
        if let Some(ready) = device.is_ready() {
            self.ready = ready;
        }
        if let Some(position) = device.cursor_position() {
            (self.position, self.at) = (position, Instant::now());
        }
    }
}

/// The thread's end.
struct Link {
    socket: WebSocket<Timed>,
    id: String,
    seen: Seen,
    publish: triple_buffer::Input<Seen>,
    commands: triple_buffer::Output<Wanted>,
    over: Arc<AtomicBool>,
}

impl Link {
    fn run(mut self) {
        let mut due = Instant::now();
        // The first message names the program to the service; later ones must not.
        let mut session = r#""session":{"configure":{"profile":{"name":"dev.haptize:loop"}}},"#;
        while !self.over.load(Ordering::Acquire) {
            let Wanted { force, at } = *self.commands.read();
            let force = force.filter(|_| at.elapsed() < STALE_COMMAND && self.seen.ready);
            if let Err(halt) = self.exchange(session, force) {
                self.seen.ended = Some(halt);
                self.publish.write(self.seen);
                // Whether it is heard or not.
                let _ = self.send("", Some([0.0; 3]));
                return;
            }
            session = "";
            due += PERIOD;
            thread::sleep(due.saturating_duration_since(Instant::now()));
            // Time that was lost is not made up for.
            due = due.max(Instant::now() - PERIOD);
        }
        let _ = self.exchange("", Some([0.0; 3]));
        let _ = self.socket.close(None);
        let _ = self.socket.flush();
    }

    /// Sends one message.
    fn send(&mut self, session: &str, force: Option<[f64; 3]>) -> Result<(), Halt> {
        self.socket.get_mut().renew(PATIENCE);
        let message = message(session, &self.id, force);
        self.socket.send(Message::text(message)).map_err(|_| Halt::Unplugged)
    }

    /// Sends one message and takes in the state that answers it. A force to which none comes for [`STALE_COMMAND`] is
    /// taken back before the wait goes on.
    fn exchange(&mut self, session: &str, force: Option<[f64; 3]>) -> Result<(), Halt> {
        self.send(session, force)?;
        let pushes = force.is_some_and(|force| force != [0.0; 3]);
        if pushes {
            self.socket.get_mut().renew(STALE_COMMAND);
        }
        let mut answer = receive(&mut self.socket);
        if pushes && matches!(answer, Err(Halt::Silent)) {
            self.send("", Some([0.0; 3]))?;
            // Each message has a state of its own.
            answer = receive(&mut self.socket).and_then(|_| receive(&mut self.socket));
        }
        let frame = answer?;
        match frame.devices().find(|device| device.id() == self.id) {
            Some(device) => self.seen.take(device),
            None => return Err(Halt::Unplugged),
        }
        self.publish.write(self.seen);
        Ok(())
    }
}

/// Returns the message that commands `force`, or that asks for the position.
fn message(session: &str, id: &str, force: Option<[f64; 3]>) -> String {
    let mut text = format!(r#"{{{session}"inverse3":[{{"device_id":"{id}","commands":"#);
    let _ = match force {
        Some([x, y, z]) => write!(text, r#"{{"set_cursor_force":{{"vector":{{"x":{x:?},"y":{y:?},"z":{z:?}}}}}}}"#),
        None => write!(text, r#"{{"probe_position":{{}}}}"#),
    };
    text.push_str("}]}");
    text
}

impl Hardware for Inverse3 {
    fn description(&self) -> String {
        format!("Haply Inverse3 {}", self.id)
    }

    fn coordinates(&self) -> Coordinates {
        Coordinates::Tip
    }

    fn limits(&self) -> Limits {
        Limits { effort: JointVector::from_slice(&[MOST_FORCE; 3]), watchdog: Watchdog::Unstated }
    }

    fn enable(&mut self) -> Result<(), Halt> {
        self.enabled = true;
        // The position is a new one, however long ago the connection was opened.
        let begun = Instant::now();
        loop {
            let seen = *self.seen.read();
            match seen.ended {
                Some(halt) => return Err(halt),
                None if seen.at > begun => return Ok(()),
                None if begun.elapsed() > PATIENCE => return Err(Halt::Stale),
                None => thread::sleep(PERIOD),
            }
        }
    }

    fn read(&mut self, _: f64) -> Result<Measurement, Halt> {
        let seen = *self.seen.read();
        if let Some(halt) = seen.ended {
            return Err(halt);
        }
        let plain = Measurement::plain(JointVector::from_slice(&seen.position), seen.at.elapsed().as_secs_f64());
        Ok(Measurement { ready: seen.ready, ..plain })
    }

    fn write(&mut self, effort: &JointVector) -> Result<Command, Halt> {
        let [x, y, z, ..] = effort.padded();
        self.wanted.write(Wanted { force: self.enabled.then_some([x, y, z]), at: Instant::now() });
        Ok(Command::Whole)
    }

    fn release(&mut self) {
        self.over.store(true, Ordering::Release);
        if let Some(thread) = self.thread.take() {
            // It has no result.
            let _ = thread.join();
        }
    }
}

impl Drop for Inverse3 {
    fn drop(&mut self) {
        self.release();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn messages_are_those_of_the_documentation() {
        let session = r#""session":{"configure":{"profile":{"name":"dev.haptize:loop"}}},"#;
        assert_eq!(
            message(session, "049D", Some([0.0, 0.0, 1.5])),
            concat!(
                r#"{"session":{"configure":{"profile":{"name":"dev.haptize:loop"}}},"inverse3":[{"device_id":"049D","#,
                r#""commands":{"set_cursor_force":{"vector":{"x":0.0,"y":0.0,"z":1.5}}}}]}"#
            )
        );
        assert_eq!(
            message("", "049D", None),
            r#"{"inverse3":[{"device_id":"049D","commands":{"probe_position":{}}}]}"#
        );
    }
}
