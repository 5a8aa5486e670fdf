//! A motion through C-space: where a hand wants to be at each time.
//!
//! Scenes give waypoints, joined by minimum-jerk paths (Flash and Hogan 1985), at rest at each of them:
//! `q(s) = q_0 + (q_1 - q_0)(10 s^3 - 15 s^4 + 6 s^5)`, s from 0 to 1. Files give samples, joined by straight lines:
//! one row a sample, comma-separated. A header names the columns, `time` and the joints in any order, each with its
//! unit in brackets or without; other columns are passed over. Without a header a row is the time in seconds and then
//! one coordinate per joint.

use crate::{
    Error, JointVector,
    csv::{Lines, fields, plain},
    dataset::JointLabel,
    error,
    input::GREATEST_INPUT,
    names::counted,
    scene::{JointKind, JointSpec, Waypoint},
};
use std::path::Path;

/// A motion; before its first and after its last waypoint it rests there.
#[derive(Clone, Debug, PartialEq)]
pub struct Motion {
    /// At least one; times ascend.
    waypoints: Vec<Waypoint>,
    smooth: bool,
}

/// Largest file that is read (bytes): a day of six joints at 20 Hz, or an hour at 1 kHz.
const GREATEST_FILE: u64 = 256 << 20;

impl Motion {
    /// A smooth motion through `waypoints` of `joints` joints.
    ///
    /// # Errors
    /// When there are none, a time does not ascend, or a configuration does not fit.
    pub fn through(waypoints: &[Waypoint], joints: usize) -> Result<Self, Error> {
        Self { waypoints: waypoints.to_vec(), smooth: true }.checked(joints)
    }

    /// A motion along `samples` of `joints` joints, with straight lines between them.
    ///
    /// # Errors
    /// As [`Motion::through`].
    pub fn along(samples: Vec<Waypoint>, joints: usize) -> Result<Self, Error> {
        Self { waypoints: samples, smooth: false }.checked(joints)
    }

    fn checked(self, joints: usize) -> Result<Self, Error> {
        let mut before = f64::NEG_INFINITY;
        for (k, point) in self.waypoints.iter().enumerate() {
            if !(point.time.is_finite() && point.time > before) {
                let (waypoint, time) = (k + 1, point.time);
                return Err(error!("waypoint {waypoint} of the motion is at {time} s, not after the one before it"));
            }
            before = point.time;
            if point.q.len() != joints || !is_position(&point.q) {
                let (waypoint, q) = (k + 1, point.q);
                return Err(error!(
                    "waypoint {waypoint} of the motion is {q:?}; the proxy asks for {joints} finite coordinates"
                ));
            }
        }
        if self.waypoints.is_empty() {
            return Err("the motion has no waypoints: give it at least one".into());
        }
        Ok(self)
    }

    /// Returns the motion in the comma-separated `file`, of `joints` in their order. Empty lines and lines that begin
    /// with
    /// # or % are passed over.
    ///
    /// # Errors
    /// When the file cannot be read, its header does not name each joint once, or a line is not a sample; the error
    /// names file and line.
    pub fn from_csv(file: &Path, labels: &[JointLabel]) -> Result<Self, Error> {
        let joints = labels.len();
        let sample = format!(
            "each line gives a time in seconds and {}, separated by commas",
            counted(joints, ["coordinate", "coordinates"])
        );
        let mut lines = Lines::open(file, GREATEST_FILE, "not a motion")?;
        let (mut waypoints, mut line): (Vec<Waypoint>, _) = (Vec::new(), Vec::new());
        let mut columns: Option<Columns> = None;
        while let Some(text) = lines.next_text(&mut line)? {
            let bad = |what| lines.error(format_args!("{what}; {sample}"));
            let text = text.trim();
            if text.is_empty() || text.starts_with(['#', '%']) {
                continue;
            }
            let Some(columns) = &columns else {
                let is_header = fields(text, ',').all(|field| number_in(field).is_none());
                let found = if is_header { Columns::named(text, labels).map_err(bad)? } else { Columns::plain(joints) };
                if !is_header {
                    waypoints.push(found.sample(text).map_err(bad)?);
                }
                columns = Some(found);
                continue;
            };
            let point = columns.sample(text).map_err(bad)?;
            if waypoints.last().is_some_and(|last| last.time >= point.time) {
                return Err(bad(format!("time {} s does not come after the line before", point.time)));
            }
            waypoints.push(point);
        }
        if waypoints.is_empty() {
            return Err(Error::at(file, format_args!("holds no sample; {sample}")));
        }
        Ok(Self { waypoints, smooth: false })
    }

    /// Checks that the motion keeps within the limits of `joints`.
    ///
    /// # Errors
    /// Names the first waypoint that does not.
    pub fn check_limits(&self, joints: &[JointSpec]) -> Result<(), Error> {
        for point in &self.waypoints {
            for (&position, joint) in point.q.iter().zip(joints) {
                let [least, greatest] = joint.limits;
                if (least..=greatest).contains(&position) {
                    continue;
                }
                let in_degrees = (least..=greatest).contains(&position.to_radians());
                let hint = match joint.kind {
                    JointKind::Revolute if in_degrees => ": if the angles are in degrees, give them in radians",
                    JointKind::Prismatic if (least..=greatest).contains(&(1e-3 * position)) => {
                        ": if the positions are in millimetres, give them in metres"
                    }
                    _ => "",
                };
                let (time, joint) = (point.time, &joint.name);
                return Err(error!(
                    "at {time} s joint {joint} is at {position}, beyond its limits [{least}, {greatest}]{hint}"
                ));
            }
        }
        Ok(())
    }

    /// Number of joints.
    #[must_use]
    pub fn joints(&self) -> usize {
        self.waypoints.first().map_or(0, |point| point.q.len())
    }

    /// When the motion begins (s); before it rests.
    #[must_use]
    pub fn begin(&self) -> f64 {
        self.waypoints.first().map_or(0.0, |point| point.time)
    }

    /// When the motion has come to its end (s).
    #[must_use]
    pub fn duration(&self) -> f64 {
        self.waypoints.last().map_or(0.0, |point| point.time)
    }

    /// Position (rad or m) and velocity (rad/s or m/s) at `time` (s).
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

/// The columns of a file that count.
struct Columns {
    count: usize,
    time: usize,
    /// One per joint.
    joints: Vec<usize>,
}

impl Columns {
    /// Those of a file without a header.
    fn plain(joints: usize) -> Self {
        Self { count: joints + 1, time: 0, joints: (1..=joints).collect() }
    }

    /// Those that `header` names.
    fn named(header: &str, joints: &[JointLabel]) -> Result<Self, String> {
        let columns: Vec<(&str, Option<&str>)> = fields(header, ',').map(heading).collect();
        if columns.len() == 1 {
            return Err("the first line is no header of names with commas between them".into());
        }
        let find = |name: &str, unit: &str| {
            // Tables of haptize hold plain names.
            let mut found = columns.iter().enumerate().filter(|(_, (known, _))| plain(known) == plain(name));
            match (found.next(), found.next()) {
                (Some((_, (_, Some(given)))), None) if *given != unit => {
                    Err(format!("column {name} is in {}, not in {unit}", shown(given)))
                }
                (Some((column, _)), None) => Ok(column),
                (None, _) => Err(format!(
                    "no column of the header is called {name}; it names {}",
                    shown(&columns.iter().map(|(known, _)| *known).collect::<Vec<_>>().join(", "))
                )),
                _ => Err(format!("several columns are called {name}")),
            }
        };
        let time = find("time", "s")?;
        let joints = joints.iter().map(|joint| find(&joint.name, &joint.unit)).collect::<Result<_, _>>()?;
        Ok(Self { count: columns.len(), time, joints })
    }

    fn sample(&self, text: &str) -> Result<Waypoint, String> {
        let fields: Vec<&str> = fields(text, ',').collect();
        if fields.len() != self.count {
            return Err(counted(fields.len(), ["number", "numbers"]));
        }
        let number = |column: usize| {
            let field = fields.get(column).copied().unwrap_or_default();
            number_in(field).ok_or_else(|| format!("\"{}\" is not a number", shown(field)))
        };
        let mut q = JointVector::zeros(self.joints.len());
        for (x, &column) in q.iter_mut().zip(&self.joints) {
            *x = number(column)?;
            if x.is_nan() || x.abs() > GREATEST_INPUT {
                return Err(format!("{x} is not a coordinate"));
            }
        }
        let time = number(self.time)?;
        if time.is_finite() { Ok(Waypoint { time, q }) } else { Err(format!("{time} is not a time")) }
    }
}

/// Name and unit of a heading such as `elbow [rad]` or `elbow (rad)`.
fn heading(field: &str) -> (&str, Option<&str>) {
    let bracketed = |open, close| field.trim().strip_suffix(close).and_then(|field| field.rsplit_once(open));
    match bracketed('[', ']').or_else(|| bracketed('(', ')')) {
        Some((name, unit)) => (name.trim(), Some(unit.trim())),
        None => (field.trim(), None),
    }
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

    fn read(text: &[u8]) -> Result<Motion, Error> {
        let mut file = tempfile::NamedTempFile::new().unwrap();
        file.write_all(text).unwrap();
        let label = |name: &str, unit: &str| JointLabel { name: name.into(), unit: unit.into() };
        Motion::from_csv(file.path(), &[label("shoulder", "m"), label("elbow", "rad")])
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
        let text = b"# pressed by hand\ntime [s],shoulder [m],elbow [rad]\n0,1,2\r\n\n0.5, 2 ,4\n1.5,2,-4e0\n";
        let motion = read(text).unwrap();
        assert_eq!(*motion.at(0.0).0, [1.0, 2.0]);
        assert_eq!(*motion.at(0.25).0, [1.5, 3.0]);
        assert_eq!(*motion.at(0.25).1, [2.0, 4.0]);
        assert_eq!(*motion.at(2.0).0, [2.0, -4.0]);
    }

    #[test]
    fn hostile_files_are_refused_with_their_line() {
        let cases: [(&[u8], &str); 17] = [
            (b"0,1,2\n1,2\n", ":2: 2 numbers"),
            (b"0,1,2,3\n", ":1: 4 numbers"),
            (b"0,1,2\n0,1,2\n", ":2: time 0 s does not come after"),
            (b"0,1,2\n1,nan,2\n", ":2: NaN is not a coordinate"),
            (b"0,1,2\n1,inf,2\n", ":2: inf is not a coordinate"),
            (b"0,1,2\ninf,1,2\n", ":2: inf is not a time"),
            (b"0,1,2\n1,1e12,2\n", ":2: 1000000000000 is not a coordinate"),
            (b"time,shoulder,elbow\ntime,a,b\n", ":2: \"a\" is not a number"),
            (b"time,a,b\n0,1,2\n", ":1: no column of the header is called shoulder; it names time, a, b"),
            (b"shoulder,elbow\n1,2\n", ":1: no column of the header is called time"),
            (b"time,elbow,elbow,shoulder\n0,1,2,3\n", ":1: several columns are called elbow"),
            (b"time [s],shoulder [deg],elbow [deg]\n0,1,2\n", ":1: column shoulder is in deg, not in m"),
            (b"time,shoulder [m],elbow [m]\n0,1,2\n", ":1: column elbow is in m, not in rad"),
            (b"time [ms],shoulder,elbow\n0,1,2\n", ":1: column time is in ms, not in s"),
            (b"time,shoulder,elbow,force\n0,1,2\n", ":2: 3 numbers"),
            (b"0,1,2\n\xff\xfe\n", ":2: not text"),
            (b"1,x,2\n", ":1: \"x\" is not a number"),
        ];
        for (text, expected) in cases {
            let message = read(text).unwrap_err().to_string();
            assert!(message.contains(expected), "{message}");
        }
        for text in [&b""[..], b"time,shoulder,elbow\n"] {
            assert!(read(text).unwrap_err().to_string().contains("holds no sample"));
        }
        let missing = Motion::from_csv(Path::new("/nowhere.csv"), &[]).unwrap_err().to_string();
        assert!(missing.starts_with("/nowhere.csv: cannot be read"), "{missing}");
    }

    #[test]
    fn columns_are_found_by_the_names_of_the_joints() {
        let expected = read(b"0,1,2\n1,3,4\n").unwrap();
        let texts: [&[u8]; 4] = [
            b"time (s),elbow (rad),shoulder(m)\n0,2,1\n1,4,3\n",
            b"time,elbow,shoulder\n0,2,1\n1,4,3\n",
            b"\xef\xbb\xbfelbow [rad], force [N], \"shoulder [m]\", time [s]\n2,9,1,0\n4,9,3,1\n",
            b"# exported\n\nshoulder,time,elbow\n1,0,2\n3,1,4\n",
        ];
        for text in texts {
            assert_eq!(read(text).unwrap(), expected);
        }
    }

    #[test]
    fn positions_beyond_the_limits_are_refused_with_what_may_be_the_cause() {
        let scene =
            crate::scene::Scene::parse(include_str!("../../datasets/mesh.toml"), Path::new("datasets/mesh.toml"));
        let mut joints = scene.unwrap().proxy.joints;
        joints.truncate(2);
        let middle: Vec<f64> = joints.iter().map(|joint| joint.limits[0].midpoint(joint.limits[1])).collect();
        let along = |q: [f64; 2]| Motion::along(vec![waypoint(0.0, &middle), waypoint(0.5, &q)], 2).unwrap();
        assert!(along([joints[0].limits[1], joints[1].limits[0]]).check_limits(&joints).is_ok());
        let message = |q| along(q).check_limits(&joints).unwrap_err().to_string();
        let degrees = message([middle[0], middle[1].to_degrees()]);
        assert!(degrees.starts_with("at 0.5 s joint yaw") && degrees.contains("give them in radians"), "{degrees}");
        let millimetres = message([1e3 * joints[0].limits[1], middle[1]]);
        assert!(millimetres.contains("joint lift") && millimetres.contains("give them in metres"), "{millimetres}");
        assert!(!message([middle[0], 1e3]).contains("give them"));
    }

    #[test]
    fn impossible_waypoints_are_refused() {
        let refusal = |waypoints: &[Waypoint]| Motion::through(waypoints, 1).unwrap_err().to_string();
        assert!(refusal(&[]).contains("no waypoints"));
        let backwards = [waypoint(1.0, &[0.0]), waypoint(1.0, &[0.1])];
        assert!(refusal(&backwards).starts_with("waypoint 2 of the motion is at 1 s"));
        for q in [&[0.0, 0.0][..], &[f64::NAN], &[]] {
            assert!(refusal(&[waypoint(0.0, q)]).contains("finite coordinates"), "{q:?}");
        }
    }
}
