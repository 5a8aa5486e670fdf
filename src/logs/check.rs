//! Whether the values of a column mapping can be, and where in its file stands one that cannot.

use super::mapping::{ColumnName, Joint, Keep, Mapping};
use crate::{MAX_AXES, names, scene::effort_unit};

/// A value that cannot be.
pub(super) struct Refusal {
    /// Keys and, of arrays, numbers from 0, with points between: `joint.0.position.scale`.
    pub key: String,
    /// Problem, and the values that are allowed, in words.
    pub message: String,
}

/// Refuses the value of `key` where it is `bad`.
fn refuse(bad: bool, key: impl Into<String>, message: impl Into<String>) -> Result<(), Refusal> {
    if bad { Err(Refusal { key: key.into(), message: message.into() }) } else { Ok(()) }
}

/// Whether `x` is a number above zero.
fn is_positive(x: f64) -> bool {
    x.is_finite() && x > 0.0
}

impl Mapping {
    /// Refuses the first value that cannot be.
    pub(super) fn check(&self) -> Result<(), Refusal> {
        let Self { table, time, joints, filter, torque } = self;
        let count = joints.len();
        let within = (1..=MAX_AXES).contains(&count);
        refuse(!within, "joint", format!("{count} [[joint]] tables; 1 to {MAX_AXES} are needed"))?;
        let same =
            "table.delimiter and table.decimal are the same character; tables with comma decimals mostly use `;`";
        refuse(table.delimiter == table.decimal, "table.decimal", same)?;
        refuse(![',', '.'].contains(&table.decimal), "table.decimal", "table.decimal must be `.` or `,`")?;
        refuse(time.column.is_some() == time.period.is_some(), "time", "[time] needs either a column or a period")?;
        refuse(!is_positive(time.scale), "time.scale", "time.scale must be a positive number of seconds")?;
        let other = time.unit.is_some_and(|unit| unit.si != "s");
        refuse(other, "time.unit", "time.unit must be one of time: s, ms or us")?;
        let period = time.period.unwrap_or(1.0);
        refuse(!is_positive(period), "time.period", "time.period must be a positive number of seconds")?;
        let parted = time.gap > 0.0;
        refuse(!parted, "time.gap", "time.gap must be a positive number of seconds")?;
        for (number, joint) in joints.iter().enumerate() {
            check_joint(&joints[..number], number, joint)?;
        }
        check_columns(self)?;
        refuse(filter.decimate == 0, "filter.decimate", "filter.decimate must be 1 or more")?;
        let rows = (1..=10_000).contains(&filter.speed_rows);
        refuse(!rows, "filter.speed_rows", "filter.speed_rows must lie between 1 and 10000")?;
        let outliers = filter.outliers.unwrap_or(1.0);
        refuse(!is_positive(outliers), "filter.outliers", "filter.outliers must be a positive number")?;
        let still = torque.still.is_finite() && torque.still >= 0.0;
        refuse(!still, "torque.still", "torque.still must be zero or more")?;
        if let Some(lead) = &torque.lead {
            let known = joints.iter().any(|joint| joint.name == *lead);
            refuse(!known, "torque.lead", format!("torque.lead: no joint `{lead}`"))?;
        }
        let message = "torque.relaxes needs every row with its time: set torque.keep to \"all\"";
        refuse(torque.relaxes && torque.keep != Keep::All, "torque.keep", message)?;
        let message = "torque.friction compares both directions of motion: set torque.keep to \"average\"";
        refuse(torque.friction && torque.keep != Keep::Average, "torque.keep", message)?;
        let cells = torque.cell.len() == count && torque.cell.iter().all(|&side| is_positive(side));
        let message = format!("torque.cell must hold {count} positive numbers, one a joint, to average rows");
        refuse(torque.keep != Keep::All && !cells, "torque.cell", message)
    }
}

/// Checks joint `number` against those before it.
fn check_joint(before: &[Joint], number: usize, joint: &Joint) -> Result<(), Refusal> {
    let name = &joint.name;
    names::check(name).or_else(|why| refuse(true, format!("joint.{number}.name"), why))?;
    let twin = before.iter().any(|other| other.name == *name);
    let message = format!("joint name `{name}` is empty or used twice");
    refuse(twin || name.is_empty(), format!("joint.{number}.name"), message)?;
    let message = format!(
        "unit of joint `{name}` is that in the dataset, `rad` or `m`; that of a column stands beside it: position = {{ \
         column = .., unit = \"deg\" }}"
    );
    refuse(!["rad", "m"].contains(&joint.unit.as_str()), format!("joint.{number}.unit"), message)?;
    for (what, quantity) in [("position", &joint.position), ("torque", &joint.torque)] {
        let wanted = if what == "torque" { effort_unit(&joint.unit) } else { &joint.unit };
        let message =
            format!("{what} of joint `{name}`, which moves in {}: its column needs a unit of {wanted}", joint.unit);
        let other = quantity.unit.is_some_and(|unit| unit.si != wanted);
        refuse(other, format!("joint.{number}.{what}.unit"), message)?;
        let scaled = quantity.scale.is_finite() && quantity.scale != 0.0;
        let message = format!("{what} of joint `{name}`: scale must be a number other than zero");
        refuse(!scaled, format!("joint.{number}.{what}.scale"), message)?;
        let message = format!("{what} of joint `{name}`: offset must be a number");
        refuse(!quantity.offset.is_finite(), format!("joint.{number}.{what}.offset"), message)?;
    }
    Ok(())
}

/// Every column that is named against the table's layout.
fn check_columns(mapping: &Mapping) -> Result<(), Refusal> {
    let of_joint = |(number, joint): (usize, &Joint)| {
        [("position", joint.position.column.clone()), ("torque", joint.torque.column.clone())]
            .map(|(what, column)| (format!("joint.{number}.{what}.column"), column))
    };
    let of_time = mapping.time.column.iter().map(|column| ("time.column".to_owned(), column.clone()));
    for (key, column) in mapping.joints.iter().enumerate().flat_map(of_joint).chain(of_time) {
        if let ColumnName::Number(number) = column {
            refuse(number == 0, &*key, "columns are numbered from 1, not from 0")?;
            let beyond = mapping.table.columns.is_some_and(|columns| number > columns);
            refuse(beyond, key, format!("column {number} is beyond table.columns"))?;
        }
    }
    Ok(())
}
