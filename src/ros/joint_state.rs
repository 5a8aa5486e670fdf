//! `sensor_msgs/msg/JointState`.

use super::{
    cdr::{Decoder, Encoder},
    message::{Message, NANOSECONDS, header},
};
use crate::{names, names::counted};
use std::collections::HashSet;

/// State of some joints at an instant. Each of the three lists is empty or has one number for each name.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct JointState {
    /// Time stamp (ns).
    pub stamp: u64,
    /// Frame; most publishers leave it empty.
    pub frame: String,
    /// Names of the joints.
    pub names: Vec<String>,
    /// (rad or m)
    pub position: Vec<f64>,
    /// (rad/s or m/s)
    pub velocity: Vec<f64>,
    /// (N m or N)
    pub effort: Vec<f64>,
}

impl Message for JointState {
    const TYPE: &str = "sensor_msgs/msg/JointState";
    const FIELDS: &str = "\
std_msgs/Header header
string[] name
float64[] position
float64[] velocity
float64[] effort
";

    fn stamp(&self) -> u64 {
        self.stamp
    }

    fn encode(&self) -> Vec<u8> {
        let mut encoder = Encoder::new();
        header(&mut encoder, self.stamp, &self.frame);
        encoder.u32(self.names.len() as u32);
        self.names.iter().for_each(|name| encoder.string(name));
        [&self.position, &self.velocity, &self.effort].into_iter().for_each(|values| encoder.f64s(values));
        encoder.finish()
    }
}

impl JointState {
    /// Reads a message in CDR of either byte order.
    ///
    /// # Errors
    /// In words, if the bytes are no such message, or a list has another length than the names.
    pub fn decode(message: &[u8]) -> Result<Self, String> {
        let mut decoder = Decoder::new(message)?;
        let (seconds, nanoseconds) = (decoder.u32()?, decoder.u32()?);
        let state = Self {
            stamp: u64::from(seconds) * NANOSECONDS + u64::from(nanoseconds),
            frame: decoder.string()?,
            names: decoder.strings(super::MOST_JOINTS)?,
            position: decoder.f64s()?,
            velocity: decoder.f64s()?,
            effort: decoder.f64s()?,
        };
        state.names.iter().try_for_each(|name| names::check(name))?;
        let mut known = HashSet::new();
        if let Some(twice) = state.names.iter().find(|name| !known.insert(name.as_str())) {
            let remedy = "give each joint a name of its own where they are published";
            return Err(format!("the name \"{twice}\" stands twice in it: {remedy}"));
        }
        for (what, values) in [
            (["position", "positions"], &state.position),
            (["velocity", "velocities"], &state.velocity),
            (["effort", "efforts"], &state.effort),
        ] {
            if !values.is_empty() && values.len() != state.names.len() {
                return Err(format!(
                    "{} for {}",
                    counted(values.len(), what),
                    counted(state.names.len(), ["name", "names"])
                ));
            }
        }
        Ok(state)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A message as the Python package rosbags 0.11.9 writes it.
    const GOLDEN: [u8; 116] = {
        let mut bytes = [0; 116];
        let parts: [(usize, &[u8]); 12] = [
            (0, &[0, 1, 0, 0, 1, 0, 0, 0, 0x80, 0x84, 0x1e, 0]),
            (12, &[5, 0, 0, 0, b'b', b'a', b's', b'e', 0]),
            (24, &[2, 0, 0, 0, 3, 0, 0, 0, b'j', b'1', 0]),
            (36, &[3, 0, 0, 0, b'j', b'2', 0]),
            (44, &[2, 0, 0, 0]),
            (52, &[0x9a, 0x99, 0x99, 0x99, 0x99, 0x99, 0xc9, 0x3f]),
            (60, &[0x9a, 0x99, 0x99, 0x99, 0x99, 0x99, 0xc9, 0x3f]),
            (68, &[2, 0, 0, 0]),
            (92, &[2, 0, 0, 0]),
            (100, &[0, 0, 0, 0, 0, 0, 0xf8, 0x3f]),
            (108, &[0, 0, 0, 0, 0, 0, 4, 0xc0]),
            (116, &[]),
        ];
        let mut part = 0;
        while part < parts.len() {
            let (at, content) = parts[part];
            let mut k = 0;
            while k < content.len() {
                bytes[at + k] = content[k];
                k += 1;
            }
            part += 1;
        }
        bytes
    };

    fn golden() -> JointState {
        JointState {
            stamp: 1_002_000_000,
            frame: "base".into(),
            names: vec!["j1".into(), "j2".into()],
            position: vec![0.2, 0.2],
            velocity: vec![0.0, 0.0],
            effort: vec![1.5, -2.5],
        }
    }

    #[test]
    fn bytes_are_those_of_another_program_both_ways() {
        assert_eq!(golden().encode(), GOLDEN);
        assert_eq!(JointState::decode(&GOLDEN), Ok(golden()));
    }

    #[test]
    fn both_byte_orders_are_read() {
        let mut big = vec![0, 0, 0, 0];
        for value in [1_u32, 2_000_000] {
            big.extend(value.to_be_bytes());
        }
        big.extend(1_u32.to_be_bytes());
        big.extend([0, 0, 0, 0]);
        big.extend([0, 0, 0, 1, 0, 0, 0, 2, b'a', 0, 0, 0]);
        big.extend([0, 0, 0, 1]);
        // Alignment of the number is to eight bytes of the body.
        while (big.len() - 4) % 8 != 0 {
            big.push(0);
        }
        big.extend(0.5_f64.to_be_bytes());
        big.extend([0, 0, 0, 0, 0, 0, 0, 0]);
        let state = JointState::decode(&big).unwrap();
        assert_eq!(
            (state.stamp, &state.names[..], &state.position[..]),
            (1_002_000_000, &["a".to_owned()][..], &[0.5][..])
        );
    }

    #[test]
    fn what_is_cut_off_or_altered_is_refused_without_a_panic() {
        for length in 0..GOLDEN.len() {
            assert!(JointState::decode(&GOLDEN[..length]).is_err(), "{length} bytes");
        }
        for at in 0..GOLDEN.len() {
            for value in [0, 1, 0x7f, 0x80, 0xff] {
                let mut bytes = GOLDEN;
                bytes[at] = value;
                let _ = JointState::decode(&bytes);
            }
        }
        let odd = JointState { effort: vec![1.0], ..golden() };
        assert!(JointState::decode(&odd.encode()).unwrap_err().contains("1 effort for 2 names"));
        let twice = JointState { names: vec!["a".into(), "b".into(), "a".into()], ..JointState::default() };
        assert!(JointState::decode(&twice.encode()).unwrap_err().contains("\"a\" stands twice"));
        for name in ["a\nb", "a\u{2028}", "\u{202e}a"] {
            let odd = JointState { names: vec!["j1".into(), name.into()], ..golden() };
            let why = JointState::decode(&odd.encode()).unwrap_err();
            assert!(why.contains("the name") && !why.contains(name), "{why}");
        }
    }
}
