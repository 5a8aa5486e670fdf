//! The service's message about its devices: a frame of JSON, of which the part that the loop needs is read.

use crate::device::Halt;
use serde::Deserialize;

/// One state frame: what is used of it. Anything else may be there or not.
#[derive(Debug, Deserialize)]
pub struct Frame {
    #[serde(default)]
    inverse3: Vec<DeviceState>,
}

/// One device in a frame.
#[derive(Debug, Deserialize)]
pub struct DeviceState {
    device_id: String,
    state: Option<State>,
    status: Option<Status>,
}

#[derive(Debug, Deserialize)]
struct State {
    cursor_position: Option<Vector>,
}

#[derive(Clone, Copy, Debug, Deserialize)]
struct Vector {
    x: f64,
    y: f64,
    z: f64,
}

#[derive(Clone, Copy, Debug, Default, Deserialize)]
#[serde(default)]
struct Status {
    calibrated: bool,
    ready: bool,
    power_supply: bool,
}

impl Frame {
    /// Reads a frame.
    ///
    /// # Errors
    /// [`Halt::Garbage`] where it is no JSON, or a part that is used is of another type.
    pub fn parse(text: &str) -> Result<Self, Halt> {
        serde_json::from_str(text).map_err(|_| Halt::Garbage)
    }

    /// Returns the devices in the frame, in its order.
    pub fn devices(&self) -> impl Iterator<Item = &DeviceState> {
        self.inverse3.iter()
    }
}

impl DeviceState {
    /// Returns the number by which the service knows the device.
    #[must_use]
    pub fn id(&self) -> &str {
        &self.device_id
    }

    /// Returns where the cursor is (m), if the frame says so. Every coordinate is finite: JSON has no other numbers.
    #[must_use]
    pub fn cursor_position(&self) -> Option<[f64; 3]> {
        let Vector { x, y, z } = self.state.as_ref()?.cursor_position?;
        Some([x, y, z])
    }

    /// Returns whether the device is calibrated, ready and powered, if the frame says so; what it leaves out counts as
    /// not.
    #[must_use]
    pub fn is_ready(&self) -> Option<bool> {
        self.status.map(|Status { calibrated, ready, power_supply }| calibrated && ready && power_supply)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_are_read_with_whatever_they_hold_or_lack() {
        let read = |text: &str| Frame::parse(text);
        let full = r#"{"session_id":15,"inverse3":[{"device_id":"04BA","config":{"type":"inverse3"},"state":
            {"angular_position":{"a0":-69.31704},"cursor_position":{"x":0.0206,"y":-0.0276,"z":0},"mode":"idle",
            "transform":{}},
            "status":{"calibrated":true,"in_use":false,"power_supply":true,"ready":true,"started":true}}],
            "verse_grip":[]}"#;
        let frame = read(full).unwrap();
        let device = frame.devices().next().unwrap();
        assert_eq!((device.id(), device.is_ready()), ("04BA", Some(true)));
        assert_eq!(device.cursor_position(), Some([0.0206, -0.0276, 0.0]));
        assert_eq!(read("{}").unwrap().devices().count(), 0);
        let silent = read(r#"{"inverse3":[{"device_id":"1"}]}"#).unwrap();
        let silent = silent.devices().next().unwrap();
        assert_eq!((silent.cursor_position(), silent.is_ready()), (None, None));
        let half = read(r#"{"inverse3":[{"device_id":"1","status":{"ready":true}}]}"#).unwrap();
        assert_eq!(half.devices().next().unwrap().is_ready(), Some(false));
        for wrong in [
            "",
            "[]x",
            r#"{"inverse3":7}"#,
            r#"{"inverse3":[{"device_id":"1","state":{"cursor_position":{"x":"a"}}}]}"#,
            r#"{"inverse3":[{"device_id":"1","state":{"cursor_position":{"x":1e999,"y":0,"z":0}}}]}"#,
        ] {
            assert!(matches!(read(wrong), Err(Halt::Garbage)), "{wrong}");
        }
    }
}
