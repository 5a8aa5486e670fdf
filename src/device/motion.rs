//! A motion through C-space: where a hand wants to be at each time.
//!
//! Scenes give waypoints, joined by minimum-jerk paths (Flash and Hogan 1985), at rest at each of them:
//! `q(s) = q_0 + (q_1 - q_0)(10 s^3 - 15 s^4 + 6 s^5)`, s from 0 to 1. Files give samples, joined by straight lines:
//! one row a sample, comma-separated, time in seconds and then one coordinate per joint.

use crate::{
    JointVector,
    input::{self, GREATEST_INPUT},
    scene::Waypoint,
};
use std::{
    io::{self, BufRead, BufReader},
    path::{Path, PathBuf},
};

/// A motion; before its first and after its last waypoint it rests there.
#[derive(Clone, Debug, PartialEq)]
pub struct Motion {
    /// At least one; times ascend.
    waypoints: Vec<Waypoint>,
    smooth: bool,
}

/// A motion cannot be used.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum MotionError {
    /// No waypoint at all.
    #[error("the motion has no waypoints: give it at least one")]
    Empty,
    /// A file without a sample.
    #[error("{}: holds no sample; each line gives a time in seconds and {joints} coordinates, separated by commas",
        .file.display())]
    NoSample {
        /// The motion's file.
        file: PathBuf,
        /// Number of joints of the proxy.
        joints: usize,
    },
    /// A waypoint's time does not come after the one before.
    #[error("waypoint {waypoint} of the motion is at {time} s, not after the one before it")]
    Time {
        /// Number of the waypoint, from one.
        waypoint: usize,
        /// Its time [s].
        time: f64,
    },
    /// A waypoint has another number of joints than the proxy, or a coordinate that is none.
    #[error("waypoint {waypoint} of the motion is {q:?}; the proxy asks for {joints} finite coordinates")]
    Waypoint {
        /// Number of the waypoint, from one.
        waypoint: usize,
        /// The configuration that it gives.
        q: JointVector,
        /// Number of joints of the proxy.
        joints: usize,
    },
    /// The file cannot be read.
    #[error("{}: cannot be read: {source}", .file.display())]
    Read {
        /// The motion's file.
        file: PathBuf,
        /// Why.
        source: io::Error,
    },
    /// The file is too large to be a motion.
    #[error("{}: larger than {GREATEST_FILE} bytes: not a motion", .file.display())]
    Size {
        /// The motion's file.
        file: PathBuf,
    },
    /// A line of the file is not a sample.
    #[error("{}:{line}: {what}; each line gives a time in seconds and {joints} coordinates, separated by commas",
        .file.display())]
    Line {
        /// The motion's file.
        file: PathBuf,
        /// Line number, from one.
        line: usize,
        /// The defect.
        what: String,
        /// Number of joints of the proxy.
        joints: usize,
    },
}

/// Largest file that is read [bytes]: a day of six joints at 20 Hz, or an hour at 1 kHz.
const GREATEST_FILE: u64 = 256 << 20;

impl Motion {
    /// A smooth motion through `waypoints` of `joints` joints.
    ///
    /// # Errors
    /// When there are none, a time does not ascend, or a configuration does not fit.
    pub fn through(waypoints: &[Waypoint], joints: usize) -> Result<Self, MotionError> {
        Self { waypoints: waypoints.to_vec(), smooth: true }.checked(joints)
    }

    /// A motion along `samples` of `joints` joints, with straight lines between them.
    ///
    /// # Errors
    /// As [`Motion::through`].
    pub fn along(samples: Vec<Waypoint>, joints: usize) -> Result<Self, MotionError> {
        Self { waypoints: samples, smooth: false }.checked(joints)
    }

    fn checked(self, joints: usize) -> Result<Self, MotionError> {
        let mut before = f64::NEG_INFINITY;
        for (k, point) in self.waypoints.iter().enumerate() {
            if !(point.time.is_finite() && point.time > before) {
                return Err(MotionError::Time { waypoint: k + 1, time: point.time });
            }
            before = point.time;
            if point.q.len() != joints || !is_position(&point.q) {
                return Err(MotionError::Waypoint { waypoint: k + 1, q: point.q, joints });
            }
        }
        if self.waypoints.is_empty() { Err(MotionError::Empty) } else { Ok(self) }
    }

    /// The motion in the comma-separated `file`, of `joints` joints. Empty lines, lines that begin with # or %, and a
    /// header line before the first sample are passed over.
    ///
    /// # Errors
    /// When the file cannot be read or a line is not a sample; the error names file and line.
    pub fn from_csv(file: &Path, joints: usize) -> Result<Self, MotionError> {
        let unreadable = |source| MotionError::Read { file: file.into(), source };
        let opened = input::open(file).map_err(unreadable)?;
        if opened.metadata().map_err(unreadable)?.len() > GREATEST_FILE {
            return Err(MotionError::Size { file: file.into() });
        }
        let mut reader = BufReader::new(opened);
        let mut waypoints: Vec<Waypoint> = Vec::new();
        let (mut bytes, mut number) = (Vec::new(), 0);
        let mut header_possible = true;
        loop {
            bytes.clear();
            if reader.read_until(b'\n', &mut bytes).map_err(unreadable)? == 0 {
                break;
            }
            number += 1;
            let bad = |what: String| MotionError::Line { file: file.into(), line: number, what, joints };
            let text = std::str::from_utf8(&bytes).map_err(|_| bad("not text".into()))?.trim();
            if text.is_empty() || text.starts_with(['#', '%']) {
                continue;
            }
            match sample(text, joints) {
                Ok(point) if waypoints.last().is_some_and(|last| last.time >= point.time) => {
                    return Err(bad(format!("time {} s does not come after the line before", point.time)));
                }
                Ok(point) => waypoints.push(point),
                Err(_) if header_possible && text.split(',').all(|field| number_in(field).is_none()) => {}
                Err(what) => return Err(bad(what)),
            }
            header_possible = false;
        }
        if waypoints.is_empty() {
            return Err(MotionError::NoSample { file: file.into(), joints });
        }
        Ok(Self { waypoints, smooth: false })
    }

    /// Number of joints.
    #[must_use]
    pub fn joints(&self) -> usize {
        self.waypoints.first().map_or(0, |point| point.q.len())
    }

    /// When the motion has come to its end [s].
    #[must_use]
    pub fn duration(&self) -> f64 {
        self.waypoints.last().map_or(0.0, |point| point.time)
    }

    /// Position [rad or m] and velocity [rad/s or m/s] at `time` [s].
    #[must_use]
    pub fn at(&self, time: f64) -> (JointVector, JointVector) {
        let next = self.waypoints.partition_point(|point| point.time <= time);
        let rest = |point: &Waypoint| (point.q, JointVector::zeros(point.q.len()));
        match (next.checked_sub(1).map(|k| &self.waypoints[k]), self.waypoints.get(next)) {
            (Some(from), Some(to)) => self.between(from, to, time),
            (Some(at), None) | (None, Some(at)) => rest(at),
            (None, None) => (JointVector::zeros(0), JointVector::zeros(0)),
        }
    }

    fn between(&self, from: &Waypoint, to: &Waypoint, time: f64) -> (JointVector, JointVector) {
        let duration = to.time - from.time;
        let s = (time - from.time) / duration;
        let (share, rate) = if self.smooth {
            (s * s * s * (10.0 - 15.0 * s + 6.0 * s * s), 30.0 * s * s * (1.0 - s) * (1.0 - s))
        } else {
            (s, 1.0)
        };
        let (mut position, mut velocity) = (from.q, from.q);
        for a in 0..from.q.len() {
            let way = to.q[a] - from.q[a];
            position[a] += share * way;
            velocity[a] = rate * way / duration;
        }
        (position, velocity)
    }
}

fn is_position(q: &JointVector) -> bool {
    // False for what is not a number.
    q.iter().all(|x| x.abs() <= GREATEST_INPUT)
}

fn number_in(field: &str) -> Option<f64> {
    field.trim().parse().ok()
}

fn sample(text: &str, joints: usize) -> Result<Waypoint, String> {
    let fields = text.split(',').count();
    if fields != joints + 1 {
        return Err(format!("{fields} numbers"));
    }
    let mut numbers = text.split(',').map(|field| {
        let value = number_in(field).ok_or_else(|| format!("\"{}\" is not a number", shown(field.trim())))?;
        if value.abs() <= GREATEST_INPUT { Ok(value) } else { Err(format!("{value} is not a coordinate")) }
    });
    let time = numbers.next().unwrap_or(Ok(0.0))?;
    let mut q = JointVector::zeros(joints);
    for (x, value) in q.iter_mut().zip(numbers) {
        *x = value?;
    }
    Ok(Waypoint { time, q })
}

/// The beginning of what a file gave, short enough for a message.
fn shown(text: &str) -> String {
    text.chars().take(40).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::Write;

    fn waypoint(time: f64, q: &[f64]) -> Waypoint {
        Waypoint { time, q: JointVector::from_slice(q) }
    }

    fn read(text: &[u8], joints: usize) -> Result<Motion, MotionError> {
        let mut file = tempfile::NamedTempFile::new().unwrap();
        file.write_all(text).unwrap();
        Motion::from_csv(file.path(), joints)
    }

    #[test]
    fn a_smooth_motion_rests_at_its_waypoints_and_moves_as_its_velocity_says() {
        let motion = Motion::through(&[waypoint(0.5, &[0.0, 1.0]), waypoint(1.5, &[2.0, 0.0])], 2).unwrap();
        assert_eq!(*motion.at(0.0).0, [0.0, 1.0]);
        assert_eq!(*motion.at(0.5).1, [0.0, 0.0]);
        assert_eq!(*motion.at(9.0).0, [2.0, 0.0]);
        assert_eq!(motion.duration(), 1.5);
        assert!((motion.at(1.0).0[0] - 1.0).abs() < 1e-15);
        for k in 1..100 {
            let (time, h) = (0.5 + 0.01 * k as f64, 1e-5);
            let slope = (motion.at(time + h).0[0] - motion.at(time - h).0[0]) / (2.0 * h);
            assert!((slope - motion.at(time).1[0]).abs() < 1e-8, "at {time}");
        }
    }

    #[test]
    fn a_file_gives_its_samples_and_lines_between_them() {
        let text = b"# pressed by hand\ntime [s],shoulder [rad],elbow [rad]\n0,1,2\r\n\n0.5, 2 ,4\n1.5,2,-4e0\n";
        let motion = read(text, 2).unwrap();
        assert_eq!(*motion.at(0.0).0, [1.0, 2.0]);
        assert_eq!(*motion.at(0.25).0, [1.5, 3.0]);
        assert_eq!(*motion.at(0.25).1, [2.0, 4.0]);
        assert_eq!(*motion.at(2.0).0, [2.0, -4.0]);
    }

    #[test]
    fn hostile_files_are_refused_with_their_line() {
        let cases: [(&[u8], &str); 9] = [
            (b"0,1,2\n1,2\n", ":2: 2 numbers"),
            (b"0,1,2,3\n", ":1: 4 numbers"),
            (b"0,1,2\n0,1,2\n", ":2: time 0 s does not come after"),
            (b"0,1,2\n1,nan,2\n", ":2: NaN is not a coordinate"),
            (b"0,1,2\n1,inf,2\n", ":2: inf is not a coordinate"),
            (b"0,1,2\n1,1e12,2\n", ":2: 1000000000000 is not a coordinate"),
            (b"time,a,b\ntime,a,b\n", ":2: \"time\" is not a number"),
            (b"0,1,2\n\xff\xfe\n", ":2: not text"),
            (b"1,x,2\n", ":1: \"x\" is not a number"),
        ];
        for (text, expected) in cases {
            let message = read(text, 2).unwrap_err().to_string();
            assert!(message.contains(expected), "{message}");
        }
        assert!(matches!(read(b"", 2), Err(MotionError::NoSample { .. })));
        assert!(matches!(read(b"time,a,b\n", 2), Err(MotionError::NoSample { .. })));
        assert!(matches!(Motion::from_csv(Path::new("/nowhere.csv"), 2), Err(MotionError::Read { .. })));
    }

    #[test]
    fn impossible_waypoints_are_refused() {
        assert!(matches!(Motion::through(&[], 1), Err(MotionError::Empty)));
        let backwards = [waypoint(1.0, &[0.0]), waypoint(1.0, &[0.1])];
        assert!(matches!(Motion::through(&backwards, 1), Err(MotionError::Time { waypoint: 2, .. })));
        for q in [&[0.0, 0.0][..], &[f64::NAN], &[]] {
            assert!(matches!(Motion::through(&[waypoint(0.0, q)], 1), Err(MotionError::Waypoint { .. })), "{q:?}");
        }
    }
}
