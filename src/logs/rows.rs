//! Rows of a log, read one at a time: line numbers kept, nothing of the text held but one line.

use super::{
    Reason,
    mapping::{BadRows, ColumnName, Mapping, Quantity},
    units::ColumnUnit,
};
use crate::{
    Error, JointVector,
    csv::{Lines, fields},
    names::{counted, escaped},
};
use std::{io::BufRead, path::Path};

/// One usable row.
#[derive(Clone, Copy, Debug)]
pub(super) struct Row {
    /// True where a new segment begins: at the start, and after a gap.
    pub first: bool,
    /// Line in its file, from 1.
    pub line: u64,
    /// (s)
    pub time: f64,
    pub q: JointVector,
    pub torque: JointVector,
}

/// Reads rows from `reader`.
pub(super) struct Rows<'a, R> {
    mapping: &'a Mapping,
    pub lines: Lines<R>,
    file: String,
    text: Vec<u8>,
    layout: Option<Layout>,
    last_time: Option<f64>,
    count: u64,
    /// Pauses longer than the mapping's gap so far.
    pub gaps: u64,
}

/// Column numbers, from 0.
struct Layout {
    columns: usize,
    time: Option<usize>,
    positions: Vec<usize>,
    torques: Vec<usize>,
}

/// A row, or why it was left out.
type ReadRow = Result<Row, Reason>;

impl<'a, R: BufRead> Rows<'a, R> {
    pub fn new(mapping: &'a Mapping, reader: R, file: &str) -> Self {
        Self {
            mapping,
            lines: Lines::new(Path::new(file), reader),
            file: file.to_owned(),
            text: Vec::new(),
            layout: None,
            last_time: None,
            count: 0,
            gaps: 0,
        }
    }

    /// The next row, or why a line was left out; `None` at the end.
    pub fn next(&mut self) -> Result<Option<ReadRow>, Error> {
        let mut line = std::mem::take(&mut self.text);
        while let Some(text) = self.lines.next(&mut line)? {
            let text = text.trim_ascii_end();
            let comment = self.mapping.table.comment.as_bytes();
            if text.is_empty() || !comment.is_empty() && text.starts_with(comment) {
                continue;
            }
            if let Some(outcome) = self.line_outcome(text)? {
                self.text = line;
                return Ok(Some(outcome));
            }
        }
        Ok(None)
    }

    fn error(&self, message: String) -> Error {
        self.lines.error(message)
    }

    /// Parses a line that is no comment; `None` for the header.
    fn line_outcome(&mut self, text: &[u8]) -> Result<Option<ReadRow>, Error> {
        let delimiter = self.mapping.table.delimiter;
        let Ok(text) = std::str::from_utf8(text) else {
            if self.layout.is_none() {
                let name = &self.file;
                return Err(self.error(format!(
                    "the line is not UTF-8, and it names the columns or counts them: convert the file, for example by \
                     `iconv -f CP1252 -t UTF-8 {name}`"
                )));
            }
            return self.refuse(Reason::NotANumber, "the line is not UTF-8".to_owned()).map(Some);
        };
        let Some(layout) = &self.layout else {
            if text.contains('\r') {
                let what = "lines end by carriage returns alone: convert the file, for example by `tr '\\r' '\\n'`";
                return Err(self.error(what.to_owned()));
            }
            let names: Vec<&str> = fields(text, delimiter).collect();
            self.layout = Some(self.layout(&names)?);
            return if self.mapping.table.header { Ok(None) } else { self.line_outcome(text.as_bytes()) };
        };
        let mut found = [0.0; 2 * crate::MAX_AXES + 1];
        let joints = layout.positions.len();
        let wanted = layout.time.iter().chain(&layout.positions).chain(&layout.torques);
        let mut slots = [usize::MAX; 2 * crate::MAX_AXES + 1];
        slots.iter_mut().zip(wanted).for_each(|(slot, column)| *slot = *column);
        let mut columns = 0;
        let mut bad: Option<(usize, &str)> = None;
        let mut is_absent = true;
        for (column, field) in fields(text, delimiter).enumerate() {
            columns += 1;
            for (value, _) in found.iter_mut().zip(slots).filter(|(_, slot)| *slot == column) {
                is_absent &= field.is_empty() || layout.time == Some(column);
                match number(field, self.mapping.table.decimal) {
                    Some(x) => *value = x,
                    None => bad = bad.or(Some((column, field))),
                }
            }
        }
        if columns != layout.columns {
            let message = format!("{} where {} are expected", counted(columns, ["column", "columns"]), layout.columns);
            return self.refuse(Reason::Columns, message).map(Some);
        }
        if is_absent {
            return self.refuse(Reason::Absent, "the line holds no position and no torque".to_owned()).map(Some);
        }
        if let Some((column, field)) = bad {
            let message = format!("column {} holds `{field}`, not a finite number{}", column + 1, self.hint(field));
            return self.refuse(Reason::NotANumber, message).map(Some);
        }
        let skip = usize::from(layout.time.is_some());
        let stamp = layout.time.map(|_| found[0] * in_si(self.mapping.time.unit) * self.mapping.time.scale);
        let (specs, sign) = (|| self.mapping.joints.iter(), self.mapping.torque.effort.sign());
        let q = specs().zip(&found[skip..]).map(|(spec, raw)| converted(&spec.position, *raw)).collect();
        let torque = specs().zip(&found[skip + joints..]).map(|(spec, raw)| sign * converted(&spec.torque, *raw));
        let torque = torque.collect();
        self.timed(stamp, q, torque).map(Some)
    }

    /// Places a row in time: repeated stamps are left out, going back is refused, a long pause begins a segment.
    fn timed(&mut self, stamp: Option<f64>, q: JointVector, torque: JointVector) -> Result<ReadRow, Error> {
        let period = self.mapping.time.period.unwrap_or(0.0);
        let time = stamp.unwrap_or(self.count as f64 * period);
        let mut first = self.last_time.is_none();
        if let Some(last) = self.last_time {
            if time == last {
                return Ok(Err(Reason::RepeatedTime));
            }
            if time < last {
                return self.refuse(Reason::TimeGoesBack, format!("time goes back from {last} s to {time} s"));
            }
            first = time - last > self.mapping.time.gap;
            self.gaps += u64::from(first);
        }
        self.last_time = Some(time);
        self.count += 1;
        Ok(Ok(Row { first, line: self.lines.number, time, q, torque }))
    }

    fn refuse(&self, reason: Reason, message: String) -> Result<ReadRow, Error> {
        match self.mapping.table.bad_rows {
            BadRows::Drop => Ok(Err(reason)),
            BadRows::Refuse => Err(self.error(format!("{message}; `bad_rows = \"drop\"` would leave the row out"))),
        }
    }

    fn hint(&self, field: &str) -> &'static str {
        if self.mapping.table.delimiter != ';' && field.contains(';') {
            return " (columns seem to be separated by semicolons: set `delimiter = \";\"`, and `decimal = \",\"` where \
                    decimals are commas)";
        }
        if self.mapping.table.delimiter != '\t' && field.contains('\t') {
            return " (columns seem to be separated by tabs: set `delimiter = \"\\t\"`)";
        }
        let comma_number = self.mapping.table.decimal == '.' && number(field, ',').is_some();
        if comma_number { " (decimals seem to be commas: set `decimal = \",\"`)" } else { "" }
    }

    fn layout(&self, names: &[&str]) -> Result<Layout, Error> {
        let columns = self.mapping.table.columns.unwrap_or(names.len());
        let find = |column: &ColumnName| match column {
            ColumnName::Number(number) if *number <= columns => Ok(number - 1),
            ColumnName::Number(number) => {
                let hint = names.first().map_or("", |field| self.hint(field));
                Err(self.error(format!("the mapping names column {number}, the line has {columns}{hint}")))
            }
            ColumnName::Name(name) if !self.mapping.table.header => {
                let what = format!("the mapping names the column `{name}`, and says of no line that it names columns");
                Err(self.error(format!("{what}: set `header = true` in [table], or give the column's number")))
            }
            ColumnName::Name(name) => {
                let mut found = names.iter().enumerate().filter(|(_, known)| *known == name).map(|(column, _)| column);
                match (found.next(), found.next()) {
                    (Some(column), None) => Ok(column),
                    (None, _) => {
                        let hint = names.first().map_or("", |field| self.hint(field));
                        let what =
                            format!("no column is called `{}`; there are {}{hint}", escaped(name), listed(names));
                        Err(self.error(what))
                    }
                    (Some(first), Some(second)) => Err(self.error(format!(
                        "columns {} and {} are both called `{name}`: give the number of the one that is meant",
                        first + 1,
                        second + 1
                    ))),
                }
            }
        };
        let all = |of: fn(&super::mapping::Joint) -> &Quantity| {
            self.mapping.joints.iter().map(|joint| find(&of(joint).column)).collect::<Result<Vec<_>, _>>()
        };
        Ok(Layout {
            columns,
            time: self.mapping.time.column.as_ref().map(find).transpose()?,
            positions: all(|joint| &joint.position)?,
            torques: all(|joint| &joint.torque)?,
        })
    }
}

fn converted(quantity: &Quantity, raw: f64) -> f64 {
    in_si(quantity.unit) * quantity.scale * raw + quantity.offset
}

/// SI units that one of `unit` is (1).
fn in_si(unit: Option<ColumnUnit>) -> f64 {
    unit.map_or(1.0, |unit| unit.factor)
}

/// The first of `names`, as many as a message has room for.
fn listed(names: &[&str]) -> String {
    const MOST_NAMES: usize = 12;
    const MOST_CHARACTERS: usize = 40;
    let shown = |name: &&str| match name.char_indices().nth(MOST_CHARACTERS) {
        Some((end, _)) => format!("{}…", &name[..end]),
        None => (*name).to_owned(),
    };
    let mut list = names.iter().take(MOST_NAMES).map(shown).collect::<Vec<_>>().join(", ");
    if names.len() > MOST_NAMES {
        list.push_str(&format!(" and {} more", names.len() - MOST_NAMES));
    }
    list
}

/// A finite number written with `decimal`.
pub(super) fn number(field: &str, decimal: char) -> Option<f64> {
    if decimal == '.' {
        return field.parse().ok().filter(|x: &f64| x.is_finite());
    }
    let mut buffer = [0_u8; 64];
    let bytes = field.as_bytes();
    let target = buffer.get_mut(..bytes.len())?;
    for (byte, source) in target.iter_mut().zip(bytes) {
        *byte = match *source {
            b'.' => return None,
            b',' => b'.',
            other => other,
        };
    }
    std::str::from_utf8(target).ok()?.parse().ok().filter(|x: &f64| x.is_finite())
}
