//! The columns of the tables that hold ticks: the trace, which is written, and the recording, which is also read.

use super::trace::Tick;
use crate::{JointVector, csv::Table, dataset::JointLabel, field::Flags};
use std::io::{self, Write};

/// A column of a table of ticks, or one column for each joint.
pub(super) struct Column {
    /// Its name, with its unit unless that is a joint's.
    name: &'static str,
    unit: Unit,
    /// Where a tick holds it.
    cell: fn(&mut Tick) -> Cell<'_>,
}

/// The unit of a column.
enum Unit {
    /// In its name.
    Named,
    /// Of the joint's coordinate.
    Position,
    /// Of the joint's effort.
    Effort,
}

/// The content of a column in one row.
enum Cell<'tick> {
    Number(&'tick mut f64),
    Count(&'tick mut u32),
    /// 0 or 1.
    Switch(&'tick mut bool),
    /// As the number of their bits.
    Remarks(&'tick mut Flags),
    /// A field for each joint, all empty where the tick has no such vector.
    Vector(&'tick mut JointVector),
    /// Written, and never read.
    Text(String),
}

use Cell::{Count, Number, Remarks, Switch, Text, Vector};
use Unit::{Effort, Named, Position};

const fn column(name: &'static str, unit: Unit, cell: fn(&mut Tick) -> Cell<'_>) -> Column {
    Column { name, unit, cell }
}

/// Columns of a trace. Those of the energy accounts follow ([`Accounts::named`](super::accounts::Accounts::named)).
pub(super) const TRACED: &[Column] = &[
    column("time [s]", Named, |tick| Number(&mut tick.time)),
    column("hand", Position, |tick| Vector(&mut tick.hand)),
    column("device", Position, |tick| Vector(&mut tick.device)),
    column("proxy", Position, |tick| Vector(&mut tick.proxy)),
    column("device torque", Effort, |tick| Vector(&mut tick.device_torque)),
    column("held torque", Effort, |tick| Vector(&mut tick.applied.torque)),
    column("contact torque", Effort, |tick| Vector(&mut tick.sample.torque)),
    column("contact index", Named, |tick| Number(&mut tick.sample.index)),
    column("contact", Named, |tick| Switch(&mut tick.sample.contact)),
    column("contact nodes", Named, |tick| Count(&mut tick.sample.contact_nodes)),
    column("flags", Named, |tick| Remarks(&mut tick.flags)),
    column("fault", Named, |tick| Text(tick.fault.map_or_else(String::new, |fault| fault.to_string()))),
    column("clamps", Named, |tick| Text(tick.applied.clamps.bits().to_string())),
    column("halt", Named, |tick| Text(tick.applied.halt.map_or_else(String::new, |halt| halt.to_string()))),
];

/// Columns of a recording: inputs, then answers; then what the device held, which old files lack.
pub(super) const RECORDED: &[Column] = &[
    column("elapsed [s]", Named, |tick| Number(&mut tick.inputs.elapsed)),
    column("interval [s]", Named, |tick| Number(&mut tick.inputs.interval)),
    column("age [s]", Named, |tick| Number(&mut tick.inputs.age)),
    column("restart", Named, |tick| Switch(&mut tick.restart)),
    column("frames", Named, |tick| Count(&mut tick.frames)),
    column("position", Position, |tick| Vector(&mut tick.inputs.position)),
    column("hand", Position, |tick| Vector(&mut tick.hand)),
    column("torque", Effort, |tick| Vector(&mut tick.device_torque)),
    column("proxy", Position, |tick| Vector(&mut tick.proxy)),
    column("held", Effort, |tick| Vector(&mut tick.applied.torque)),
];

/// Further columns of a recording whose contact was solved meanwhile, and would be solved otherwise another time.
pub(super) const FELT: &[Column] = &[
    column("contact torque", Effort, |tick| Vector(&mut tick.sample.torque)),
    column("contact index", Named, |tick| Number(&mut tick.sample.index)),
    column("contact", Named, |tick| Switch(&mut tick.sample.contact)),
    column("contact nodes", Named, |tick| Count(&mut tick.sample.contact_nodes)),
    column("energy [J]", Named, |tick| Number(&mut tick.sample.energy)),
    column("share", Named, |tick| Number(&mut tick.sample.share)),
    column("remarks", Named, |tick| Remarks(&mut tick.sample.flags)),
];

/// Number of fields of a row of `columns` for so many `joints`.
pub(super) fn width(columns: &[Column], joints: usize) -> usize {
    columns.iter().map(|column| column.width(joints)).sum()
}

impl Column {
    fn width(&self, joints: usize) -> usize {
        match self.unit {
            Named => 1,
            Position | Effort => joints,
        }
    }

    /// Appends its headings.
    pub fn head<W: Write>(&self, joints: &[JointLabel], table: &mut Table<W>) -> io::Result<()> {
        match self.unit {
            Named => table.field(self.name),
            Position => table.fields(joints.iter().map(|joint| joint.heading(self.name))),
            Effort => table.fields(joints.iter().map(|joint| joint.effort_heading(self.name))),
        }
        .map(drop)
    }

    /// Appends its fields of `tick`, which this does not change.
    pub fn write<W: Write>(&self, tick: &mut Tick, joints: usize, table: &mut Table<W>) -> io::Result<()> {
        match (self.cell)(tick) {
            Number(number) => table.field(number),
            Count(count) => table.field(count),
            Switch(switch) => table.field(u8::from(*switch)),
            Remarks(flags) => table.field(flags.bits()),
            Text(text) => table.field(text),
            Vector(vector) => return write_vector(vector, joints, table),
        }
        .map(drop)
    }
}

/// Appends a field for each of so many `joints`, empty where `vector` has no such joint.
pub(super) fn write_vector<W: Write>(vector: &JointVector, joints: usize, table: &mut Table<W>) -> io::Result<()> {
    (0..joints).try_for_each(|joint| table.optional(vector.get(joint)).map(drop))
}

/// Reads `fields`, a row of `columns` for so many `joints`, into `tick`. `Err` says what is wrong.
pub(super) fn read(columns: &[Column], mut fields: &[&str], joints: usize, tick: &mut Tick) -> Result<(), String> {
    for column in columns {
        let (own, rest) = fields.split_at_checked(column.width(joints)).ok_or("too few fields")?;
        fields = rest;
        let field = own.first().copied().unwrap_or_default();
        match (column.cell)(tick) {
            Number(value) => *value = number(field)?,
            Count(count) => *count = number(field)?,
            Switch(switch) => *switch = number::<u8>(field)? != 0,
            Remarks(flags) => *flags = Flags::from_bits_truncate(number(field)?),
            Vector(vector) => *vector = read_vector(own, joints)?,
            Text(_) => {}
        }
    }
    Ok(())
}

/// The numbers in `fields`, or no joints where all are empty.
pub(super) fn read_vector(fields: &[&str], joints: usize) -> Result<JointVector, String> {
    if fields.iter().all(|field| field.trim().is_empty()) {
        return Ok(JointVector::zeros(0));
    }
    if fields.len() != joints {
        return Err(format!("{} coordinates", fields.len()));
    }
    let mut vector = JointVector::zeros(joints);
    for (value, field) in vector.iter_mut().zip(fields) {
        *value = number(field)?;
    }
    Ok(vector)
}

pub(super) fn number<T: std::str::FromStr>(field: &str) -> Result<T, String> {
    let shown = || field.trim().chars().take(40).collect::<String>();
    field.trim().parse().map_err(|_| format!("\"{}\" is not such a number", shown()))
}
