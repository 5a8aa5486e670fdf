//! The columns of the tables that hold ticks: the trace, which is written, and the recording, which is also read.

use super::trace::Tick;
use crate::{JointVector, csv::Table, dataset::JointLabel, field::Flags, names::counted};
use std::io::{self, Write};

/// A column of a table of ticks, or one column for each joint: its name, with its unit unless that is a joint's, and
/// where a tick holds it.
pub(super) type TickColumn = (&'static str, fn(&mut Tick) -> Cell<'_>);

/// The content of a column in one row.
pub(super) enum Cell<'tick> {
    Number(&'tick mut f64),
    Count(&'tick mut u32),
    /// 0 or 1.
    Switch(&'tick mut bool),
    /// As the number of their bits.
    Remarks(&'tick mut Flags),
    /// A coordinate of each joint, all empty where the tick has no such vector.
    Positions(&'tick mut JointVector),
    /// The same of efforts.
    Efforts(&'tick mut JointVector),
    /// Written, and never read.
    Text(String),
}

use Cell::{Count, Efforts, Number, Positions, Remarks, Switch, Text};

/// Columns of a trace. Those of the energy accounts follow ([`Accounts::named`](super::accounts::Accounts::named)).
pub(super) const TRACED: &[TickColumn] = &[
    ("time [s]", |tick| Number(&mut tick.time)),
    ("hand", |tick| Positions(&mut tick.hand)),
    ("device", |tick| Positions(&mut tick.device)),
    ("proxy", |tick| Positions(&mut tick.proxy)),
    ("device torque", |tick| Efforts(&mut tick.device_torque)),
    ("held torque", |tick| Efforts(&mut tick.applied.torque)),
    ("contact torque", |tick| Efforts(&mut tick.sample.torque)),
    ("contact index", |tick| Number(&mut tick.sample.index)),
    ("contact", |tick| Switch(&mut tick.sample.contact)),
    ("contact nodes", |tick| Count(&mut tick.sample.contact_nodes)),
    ("twin share", |tick| Number(&mut tick.sample.twin)),
    ("flags", |tick| Remarks(&mut tick.flags)),
    ("fault", |tick| Text(tick.fault.map_or_else(String::new, |fault| fault.to_string()))),
    ("clamps", |tick| Text(tick.applied.clamps.bits().to_string())),
    ("halt", |tick| Text(tick.applied.halt.map_or_else(String::new, |halt| halt.to_string()))),
];

/// Columns of a recording: inputs, then answers; then what the device held, which old files lack.
pub(super) const RECORDED: &[TickColumn] = &[
    ("elapsed [s]", |tick| Number(&mut tick.inputs.elapsed)),
    ("interval [s]", |tick| Number(&mut tick.inputs.interval)),
    ("age [s]", |tick| Number(&mut tick.inputs.age)),
    ("restart", |tick| Switch(&mut tick.restart)),
    ("frames", |tick| Count(&mut tick.frames)),
    ("position", |tick| Positions(&mut tick.inputs.position)),
    ("hand", |tick| Positions(&mut tick.hand)),
    ("torque", |tick| Efforts(&mut tick.device_torque)),
    ("proxy", |tick| Positions(&mut tick.proxy)),
    ("held", |tick| Efforts(&mut tick.applied.torque)),
];

/// Number of fields of a row of `columns` for so many `joints`.
pub(super) fn width(columns: &[TickColumn], joints: usize) -> usize {
    let mut any = Tick::default();
    columns.iter().map(|(_, cell)| cell(&mut any).width(joints)).sum()
}

/// Appends the headings of `columns`.
pub(super) fn head<W: Write>(columns: &[TickColumn], joints: &[JointLabel], table: &mut Table<W>) -> io::Result<()> {
    let mut any = Tick::default();
    columns.iter().try_for_each(|(name, cell)| {
        match cell(&mut any) {
            Positions(_) => table.fields(joints.iter().map(|joint| joint.heading(name))),
            Efforts(_) => table.fields(joints.iter().map(|joint| joint.effort_heading(name))),
            _ => table.field(name),
        }
        .map(drop)
    })
}

/// Appends the fields of `tick` for so many `joints`.
pub(super) fn write<W: Write>(
    columns: &[TickColumn],
    mut tick: Tick,
    joints: usize,
    table: &mut Table<W>,
) -> io::Result<()> {
    columns.iter().try_for_each(|(_, cell)| {
        match cell(&mut tick) {
            Number(number) => table.field(number),
            Count(count) => table.field(count),
            Switch(switch) => table.field(u8::from(*switch)),
            Remarks(flags) => table.field(flags.bits()),
            Text(text) => table.field(text),
            Positions(vector) | Efforts(vector) => return write_vector(vector, joints, table),
        }
        .map(drop)
    })
}

impl Cell<'_> {
    fn width(&self, joints: usize) -> usize {
        if matches!(self, Positions(_) | Efforts(_)) { joints } else { 1 }
    }
}

/// Appends a field for each of so many `joints`, empty where `vector` has no such joint.
pub(super) fn write_vector<W: Write>(vector: &JointVector, joints: usize, table: &mut Table<W>) -> io::Result<()> {
    (0..joints).try_for_each(|joint| table.optional(vector.get(joint)).map(drop))
}

/// Reads `fields`, a row of `columns` for so many `joints`, into `tick`. `Err` says what is wrong.
pub(super) fn read(columns: &[TickColumn], mut fields: &[&str], joints: usize, tick: &mut Tick) -> Result<(), String> {
    for (_, cell) in columns {
        let cell = cell(tick);
        let (own, rest) = fields.split_at_checked(cell.width(joints)).ok_or("too few fields")?;
        let field = own.first().copied().unwrap_or_default();
        match cell {
            Number(value) => *value = number(field)?,
            Count(count) => *count = number(field)?,
            Switch(switch) => *switch = number::<u8>(field)? != 0,
            Remarks(flags) => *flags = Flags::from_bits_truncate(number(field)?),
            Positions(vector) | Efforts(vector) => *vector = read_vector(own, joints)?,
            Text(_) => {}
        }
        fields = rest;
    }
    Ok(())
}

/// The numbers in `fields`, or no joints where all are empty.
pub(super) fn read_vector(fields: &[&str], joints: usize) -> Result<JointVector, String> {
    if fields.iter().all(|field| field.trim().is_empty()) {
        return Ok(JointVector::zeros(0));
    }
    if fields.len() != joints {
        return Err(counted(fields.len(), ["coordinate", "coordinates"]));
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
