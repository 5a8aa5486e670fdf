//! Which columns of a log are what: a small TOML file, so that any table of joint positions and torques becomes a
//! dataset without code. `datasets/instrument.toml` is an example with every key explained.

use super::units::ColumnUnit;
use crate::{Error, dataset::JointLabel, scene};
use serde::Deserialize;
use std::path::Path;

/// A column mapping, validated.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Mapping {
    /// How the text is laid out.
    #[serde(default)]
    pub table: Table,
    /// Where time comes from.
    pub time: Time,
    /// One entry a joint, in the order of the dataset.
    #[serde(rename = "joint")]
    pub joints: Vec<Joint>,
    /// Filter of the rows.
    #[serde(default)]
    pub filter: Filter,
    /// Which torque is kept where the mechanism has friction.
    #[serde(default)]
    pub torque: Torque,
}

/// Layout of the text.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, default, expecting = "a table, as in `[table]`")]
pub struct Table {
    /// One character between columns; a blank takes any run of blanks and tabs.
    pub delimiter: char,
    /// `.` or `,`.
    pub decimal: char,
    /// Lines that begin with this are skipped; empty: none are.
    pub comment: String,
    /// The first line that is no comment names the columns.
    pub header: bool,
    /// Columns that every row must have; absent: as many as the first row.
    pub columns: Option<usize>,
    /// Treatment of a row with a wrong number of columns, or with a field that is missing or not a finite number.
    pub bad_rows: BadRows,
    /// The topic of joint states that is read of an MCAP file, whose columns are `time`, and `position`, `velocity` and
    /// `effort` with each joint's name; absent: its only one. The other keys of the layout are not used then.
    pub topic: Option<String>,
}

/// Treatment of a row that cannot be used.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum BadRows {
    /// The import stops and names the line.
    #[default]
    Refuse,
    /// The row is left out, counted, and the first such line is reported.
    Drop,
}

/// Where time comes from: a column, or a constant period between rows.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, expecting = "a table, as in `[time]`")]
pub struct Time {
    /// The column of time stamps.
    pub column: Option<ColumnName>,
    /// Unit of that column; absent: seconds.
    pub unit: Option<ColumnUnit>,
    /// What its numbers are multiplied by (1).
    #[serde(default = "one")]
    pub scale: f64,
    /// Time between rows where there is no column (s).
    pub period: Option<f64>,
    /// A longer pause begins a new segment, across which nothing is filtered (s).
    #[serde(default = "unlimited")]
    pub gap: f64,
}

/// A column by its number, from 1, or by its name in the header.
#[derive(Clone, Debug, PartialEq, Eq, Deserialize)]
#[serde(untagged, expecting = "the name of a column or its number")]
pub enum ColumnName {
    /// From 1.
    Number(usize),
    /// As in the header line.
    Name(String),
}

/// One joint.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, expecting = "a table, as in `[[joint]]`")]
pub struct Joint {
    /// Its name in the dataset.
    pub name: String,
    /// `rad` or `m`: the unit of the position in the dataset; by default that of its column, or `rad`.
    #[serde(default)]
    pub unit: String,
    /// The joint's position.
    pub position: Quantity,
    /// Contact torque on the proxy; a sensor that measures the torque on the object has a negative scale.
    pub torque: Quantity,
}

/// `scale * unit * column + offset`, in SI units.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, expecting = "a table, as in `{ column = \"NAME\" }`")]
pub struct Quantity {
    /// Where it stands.
    pub column: ColumnName,
    /// Unit of the column; absent: that of SI.
    pub unit: Option<ColumnUnit>,
    /// What its numbers are multiplied by, besides their unit (1).
    #[serde(default = "one")]
    pub scale: f64,
    /// Added after scaling, in SI units.
    #[serde(default)]
    pub offset: f64,
}

/// Row by row.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, default, expecting = "a table, as in `[filter]`")]
pub struct Filter {
    /// Speed is the difference over this many rows to either side.
    pub speed_rows: usize,
    /// A row whose torque departs from the median of the five rows to either side by more than this many robust
    /// deviations is left out and counted; absent: none is.
    pub outliers: Option<f64>,
    /// This many consecutive rows are averaged into one.
    pub decimate: usize,
}

/// Which torque is kept.
#[derive(Clone, Debug, Default, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, default, expecting = "a table, as in `[torque]`")]
pub struct Torque {
    /// What was measured.
    pub effort: Effort,
    /// Which rows count, and how they are combined.
    pub keep: Keep,
    /// Name of the joint whose direction of motion counts; absent: the first.
    pub lead: Option<String>,
    /// Speed of the lead joint below which it counts as still (rad/s or m/s).
    pub still: f64,
    /// Whether the object relaxes: rows are kept with their times then, and `gridize` identifies how its force fades. It
    /// needs `keep = "all"`, and a log in which each segment begins untouched.
    pub relaxes: bool,
    /// Whether the friction that tells one direction of motion from the other is the object's own, not that of the device:
    /// `gridize` identifies it then. It needs `keep = "average"`.
    pub friction: bool,
    /// Rows are averaged in cells of C-space with these sides, one a joint (rad or m); needed for all but `all`.
    pub cell: Vec<f64>,
}

/// What the torques of a log are.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, clap::ValueEnum)]
#[serde(rename_all = "lowercase")]
pub enum Effort {
    /// Torque of the motors, which balances that of the contact.
    Motor,
    /// Torque of the contact on the arm.
    #[default]
    Contact,
}

impl Effort {
    /// The factor that makes contact torques of it (1).
    #[must_use]
    pub fn sign(self) -> f64 {
        if self == Self::Motor { -1.0 } else { 1.0 }
    }
}

/// Which rows count, and how they are combined.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Keep {
    /// Every row is a sample.
    #[default]
    All,
    /// Rows at which every joint is still, averaged in cells.
    Static,
    /// The mean of both directions in cells visited in both: dry friction cancels.
    Average,
    /// Rows in which the lead joint moves up, averaged in cells.
    Forward,
    /// Rows in which the lead joint moves down, averaged in cells.
    Backward,
}

impl Default for Table {
    fn default() -> Self {
        Self {
            delimiter: ',',
            decimal: '.',
            comment: "#".to_owned(),
            header: false,
            columns: None,
            bad_rows: BadRows::Refuse,
            topic: None,
        }
    }
}

impl Table {
    /// The layout of [`crate::ros::JointStateTable`].
    fn of_joint_states() -> Self {
        Self { comment: String::new(), header: true, ..Self::default() }
    }
}

impl Default for Filter {
    fn default() -> Self {
        Self { speed_rows: 10, outliers: None, decimate: 1 }
    }
}

const fn one() -> f64 {
    1.0
}

const fn unlimited() -> f64 {
    f64::INFINITY
}

/// The unit of angles.
const RADIANS: &str = "rad";

impl Mapping {
    /// Reads and validates a mapping file.
    ///
    /// # Errors
    /// The error names the file, the line and the key.
    pub fn load(path: &Path) -> Result<Self, Error> {
        let unreadable = |reason| Error::at(path, format_args!("cannot be read: {reason}"));
        let text = scene::text::read(path).map_err(unreadable)?;
        Self::parse(&text, path)
    }

    /// Validates `text`, the content of the file at `path`, which errors name.
    ///
    /// # Errors
    /// The error names the file, the line and the key.
    pub fn parse(text: &str, path: &Path) -> Result<Self, Error> {
        let invalid = |place, message: &str| Error::in_text(path, text, place, message);
        let mut mapping: Self =
            toml::from_str(text).map_err(|error| invalid(error.span().unwrap_or(0..0), error.message()))?;
        for joint in mapping.joints.iter_mut().filter(|joint| joint.unit.is_empty()) {
            let own = joint.position.unit.map(|unit| unit.si).filter(|unit| ["rad", "m"].contains(unit));
            joint.unit = own.unwrap_or(RADIANS).to_owned();
        }
        mapping.check().map_err(|refusal| invalid(scene::find_key(text, &refusal.key).0, &refusal.message))?;
        Ok(mapping)
    }

    /// Returns the mapping that takes all `joints` of a topic of joint states, as angles, with their efforts, which are
    /// `effort`, as torques. Messages that leave out a joint are dropped and counted.
    #[must_use]
    pub fn of_joint_states(joints: &[String], topic: &str, effort: Effort) -> Self {
        let quantity = |what: &str, joint: &String| Quantity {
            column: ColumnName::Name(format!("{what} {joint}")),
            unit: None,
            scale: 1.0,
            offset: 0.0,
        };
        let joint = |name: &String| Joint {
            name: name.clone(),
            unit: RADIANS.to_owned(),
            position: quantity("position", name),
            torque: quantity("effort", name),
        };
        Self {
            table: Table { bad_rows: BadRows::Drop, topic: Some(topic.to_owned()), ..Table::of_joint_states() },
            time: Time {
                column: Some(ColumnName::Name("time".into())),
                unit: None,
                scale: 1.0,
                period: None,
                gap: unlimited(),
            },
            joints: joints.iter().map(joint).collect(),
            filter: Filter::default(),
            torque: Torque { effort, ..Torque::default() },
        }
    }

    /// Returns the same mapping, for the text that joint states are read as.
    #[must_use]
    pub fn for_joint_states(&self) -> Self {
        let Table { bad_rows, topic, .. } = self.table.clone();
        Self { table: Table { bad_rows, topic, ..Table::of_joint_states() }, ..self.clone() }
    }

    /// Names and units of the joints.
    #[must_use]
    pub fn labels(&self) -> Vec<JointLabel> {
        self.joints.iter().map(|joint| JointLabel { name: joint.name.clone(), unit: joint.unit.clone() }).collect()
    }

    /// Number of the lead joint.
    #[must_use]
    pub fn lead(&self) -> usize {
        let named = self.torque.lead.as_ref();
        named.and_then(|name| self.joints.iter().position(|joint| joint.name == *name)).unwrap_or(0)
    }
}
