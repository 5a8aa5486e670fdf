//! Logs of a real mechanism, read as samples of its contact torque.
//!
//! Any table of joint positions and torques, described by a [`Mapping`]. Rows stream through: parsed, placed in time,
//! judged against their neighbours (speed, outliers), decimated, and kept as samples or averaged in cells of C-space.
//! Memory is bounded by the samples or cells kept, never by the length of the log.
//!
//! A mechanism with friction has no single torque at a configuration: it depends on the direction of motion. The
//! mapping says which one is kept (section 2.2 measures at rest; a log of a moving mechanism offers the mean of both
//! directions, in which dry friction cancels, or either branch), and the report says how far apart they lie.
//!
//! A log may also be an MCAP file of a robot: its joint states are read as a table ([`crate::ros`]).

mod check;
mod guess;
mod mapping;
mod rows;
mod units;
mod window;

pub use guess::{GuessedMapping, guess, suggested_steps};
pub use mapping::{BadRows, ColumnName, Effort, Filter, Joint, Keep, Mapping, Quantity, Table, Time, Torque};
pub use units::ColumnUnit;

use crate::{
    Error, JointVector, error,
    gridize::{Branches, CellReport, Cells, ForceHistory, LeadDirection, Samples},
    input,
    names::counted,
    ros::{JointStateTable, is_mcap},
};
use rows::Rows;
use std::{
    fmt,
    io::{BufRead, BufReader, Read},
    path::{Path, PathBuf},
};
use window::{Seen, Window};

/// Samples that an import keeps when it averages none: 0.5 GB for six joints.
const IMPORT_SAMPLES: usize = 5_000_000;

/// Why a row was left out.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Reason {
    /// A wrong number of columns.
    Columns,
    /// A field that is missing or not a finite number.
    NotANumber,
    /// No position and no torque at all, as where another part of a robot speaks.
    Absent,
    /// The time stamp of the row before.
    RepeatedTime,
    /// A time before that of the row before.
    TimeGoesBack,
    /// A torque far off its neighbours'.
    Outlier,
}

/// Rows left out for one reason.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct Dropped {
    /// Why.
    pub reason: Reason,
    /// How many.
    pub rows: u64,
    /// File and line of the first.
    pub first: String,
}

impl fmt::Display for Dropped {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { reason, rows, first } = self;
        let (row, has) = if *rows == 1 { ("row", "has") } else { ("rows", "have") };
        let what = match reason {
            Reason::Columns => "another number of columns",
            Reason::NotANumber => "a field that is missing or not a finite number",
            Reason::Absent => "no position and no torque",
            Reason::RepeatedTime => "the time of the row before",
            Reason::TimeGoesBack => "a time before that of an earlier row",
            Reason::Outlier => "a torque far off its neighbours'",
        };
        write!(f, "{rows} {row} {has} {what}, first at {first}")
    }
}

/// Report of an import.
#[derive(Clone, Debug, Default, PartialEq, serde::Serialize)]
pub struct ImportReport {
    /// Rows read, comments and header not counted.
    pub rows: u64,
    /// Samples made of them.
    pub samples: usize,
    /// Rows left out.
    pub dropped: Vec<Dropped>,
    /// Pauses in time longer than the mapping's gap.
    pub gaps: u64,
    /// Present where rows were averaged in cells.
    pub cells: Option<CellReport>,
}

impl ImportReport {
    /// Says which rows were left out, and why.
    #[must_use]
    pub fn left_out(&self) -> String {
        match self.dropped.as_slice() {
            [] => "none was left out".to_owned(),
            dropped => dropped.iter().map(Dropped::to_string).collect::<Vec<_>>().join("; "),
        }
    }
}

/// Data read from logs.
#[derive(Clone, Debug, PartialEq)]
pub struct Imported {
    /// The torque that the mapping keeps.
    pub samples: Samples,
    /// Both branches, moving forward and backward, where rows were averaged by direction.
    pub branches: Option<[Samples; 2]>,
    /// Every row with its time, a segment each, where the mapping says that the object relaxes or holds back.
    pub histories: Vec<ForceHistory>,
    /// Report of the import.
    pub report: ImportReport,
}

/// How far an import has come.
#[derive(Clone, Copy, Debug)]
pub struct ImportProgress {
    /// Bytes read of all files.
    pub bytes: u64,
    /// Rows read.
    pub rows: u64,
}

/// Reads the logs `files` through `mapping`, one after another. `progress` is called now and then.
///
/// # Errors
/// The error names the file and the line.
pub fn import(
    mapping: &Mapping,
    files: &[PathBuf],
    progress: &mut dyn FnMut(ImportProgress),
) -> Result<Imported, Error> {
    let of_robot = files.iter().any(|file| is_mcap(file));
    let mapping = &if of_robot { mapping.for_joint_states() } else { mapping.clone() };
    let mut import = Import::new(mapping);
    let mut bytes = 0;
    for path in files {
        let file = path.display().to_string();
        let opened: Box<dyn Read> = if of_robot {
            Box::new(JointStateTable::open(path, mapping.table.topic.as_deref())?)
        } else {
            Box::new(input::open(path).map_err(|source| Error::unreadable(path, &source))?)
        };
        bytes += import.read(BufReader::with_capacity(1 << 16, opened), &file, &mut |read, rows| {
            progress(ImportProgress { bytes: bytes + read, rows });
        })?;
    }
    import.finish(of_robot)
}

/// Share of the rows that may have the time of the row before (1): a driver may send each message several times.
const MOST_REPEATED: f64 = 0.9;

/// What to do where most rows cannot be used, most of them for `reason`; `of_robot`: they are messages.
fn remedy(reason: Reason, of_robot: bool, mapping: &Mapping) -> String {
    let joints = || mapping.joints.iter().map(|joint| joint.name.as_str()).collect::<Vec<_>>().join(", ");
    match reason {
        Reason::TimeGoesBack => "the clock was set meanwhile: cut off what comes before or behind that".into(),
        _ if of_robot => format!(
            "each message has to give position and effort of all joints, {}: choose those of one publisher by a column \
             mapping (--columns) with `bad_rows = \"drop\"`",
            joints()
        ),
        _ => "correct the log or the mapping, or cut off the part that is not a measurement".into(),
    }
}

/// Total size of `files`, for a progress bar (bytes).
#[must_use]
pub fn total_size(files: &[impl AsRef<Path>]) -> u64 {
    files.iter().filter_map(|path| std::fs::metadata(path).ok()).map(|metadata| metadata.len()).sum()
}

/// An import under way.
struct Import<'a> {
    mapping: &'a Mapping,
    window: Window,
    block: Block,
    cells: Cells,
    samples: Samples,
    histories: Vec<ForceHistory>,
    /// Kept one by one.
    rows: usize,
    report: ImportReport,
}

/// Rows under way to be averaged into one.
#[derive(Clone, Copy)]
struct Block {
    count: usize,
    time: f64,
    q: JointVector,
    torque: JointVector,
    speed: JointVector,
}

impl Block {
    fn new(joints: usize) -> Self {
        let zeros = JointVector::zeros(joints);
        Self { count: 0, time: 0.0, q: zeros, torque: zeros, speed: zeros }
    }

    fn add(&mut self, seen: &Seen) {
        self.count += 1;
        let share = 1.0 / self.count as f64;
        self.time += share * (seen.row.time - self.time);
        for (mean, value) in
            [(&mut self.q, &seen.row.q), (&mut self.torque, &seen.row.torque), (&mut self.speed, &seen.speed)]
        {
            mean.iter_mut().zip(value.iter()).for_each(|(mean, value)| *mean += share * (value - *mean));
        }
    }
}

impl<'a> Import<'a> {
    fn new(mapping: &'a Mapping) -> Self {
        let joints = mapping.joints.len();
        Self {
            mapping,
            window: Window::new(mapping.filter.speed_rows, mapping.filter.outliers),
            block: Block::new(joints),
            cells: Cells::new(&mapping.torque.cell),
            samples: Samples { joints: mapping.labels(), ..Samples::default() },
            histories: vec![ForceHistory::default()],
            rows: 0,
            report: ImportReport::default(),
        }
    }

    /// Reads one log; returns its length in bytes.
    fn read(&mut self, reader: impl BufRead, file: &str, progress: &mut dyn FnMut(u64, u64)) -> Result<u64, Error> {
        const ROWS_A_REPORT: u64 = 1 << 14;
        let mapping = self.mapping;
        let mut rows = Rows::new(mapping, reader, file);
        while let Some(row) = rows.next()? {
            self.report.rows += 1;
            match row {
                Err(reason) => {
                    self.drop_row(reason, file, rows.lines.number);
                    continue;
                }
                Ok(row) => {
                    if row.first {
                        self.end_segment(file)?;
                    }
                    self.window.push(row).map_or(Ok(()), |seen| self.keep(&seen, file))?;
                }
            }
            if self.report.rows.is_multiple_of(ROWS_A_REPORT) {
                progress(rows.lines.bytes, self.report.rows);
            }
        }
        self.report.gaps += rows.gaps;
        self.end_segment(file)?;
        progress(rows.lines.bytes, self.report.rows);
        Ok(rows.lines.bytes)
    }

    fn drop_row(&mut self, reason: Reason, file: &str, line: u64) {
        match self.report.dropped.iter_mut().find(|dropped| dropped.reason == reason) {
            Some(dropped) => dropped.rows += 1,
            None => self.report.dropped.push(Dropped { reason, rows: 1, first: format!("{file}:{line}") }),
        }
    }

    fn end_segment(&mut self, file: &str) -> Result<(), Error> {
        while let Some(seen) = self.window.flush() {
            self.keep(&seen, file)?;
        }
        self.end_block()?;
        self.cells.end_visit();
        if self.histories.last().is_some_and(|history| !history.times.is_empty()) {
            self.histories.push(ForceHistory::default());
        }
        Ok(())
    }

    fn keep(&mut self, seen: &Seen, file: &str) -> Result<(), Error> {
        if seen.outlier {
            self.drop_row(Reason::Outlier, file, seen.row.line);
            return Ok(());
        }
        self.block.add(seen);
        if self.block.count >= self.mapping.filter.decimate { self.end_block() } else { Ok(()) }
    }

    /// Hands the averaged block on: as a sample, or to its cell.
    fn end_block(&mut self) -> Result<(), Error> {
        let block = std::mem::replace(&mut self.block, Block::new(self.mapping.joints.len()));
        if block.count == 0 {
            return Ok(());
        }
        let Torque { keep, still, relaxes, friction, .. } = self.mapping.torque;
        let lead = block.speed[self.mapping.lead()];
        let at_rest = block.speed.iter().all(|speed| speed.abs() <= still);
        let direction = if lead < 0.0 { LeadDirection::Backward } else { LeadDirection::Forward };
        if keep == Keep::All || friction {
            self.rows += 1;
            if self.rows > IMPORT_SAMPLES {
                return Err(error!(
                    "more than {IMPORT_SAMPLES} samples: set filter.decimate, or average rows in cells (torque.keep and \
                     torque.cell)"
                ));
            }
        }
        if let Some(history) = self.histories.last_mut().filter(|_| relaxes || friction) {
            history.push(block.time, &block.q, &block.torque, (true, (lead.abs() > still).then_some(direction)));
        }
        match keep {
            Keep::All => {
                self.samples.configurations.extend_from_slice(&block.q);
                self.samples.torques.extend_from_slice(&block.torque);
                Ok(())
            }
            Keep::Static if at_rest => self.cells.add(&block.q, &block.torque, LeadDirection::Forward),
            Keep::Average | Keep::Forward | Keep::Backward if lead.abs() > still => {
                self.cells.add(&block.q, &block.torque, direction)
            }
            _ => {
                self.cells.end_visit();
                Ok(())
            }
        }
    }

    /// `of_robot`: rows are messages.
    fn finish(mut self, of_robot: bool) -> Result<Imported, Error> {
        let repeated = self.report.dropped.iter().find(|dropped| dropped.reason == Reason::RepeatedTime);
        if let Some(repeated) =
            repeated.filter(|repeated| repeated.rows as f64 > MOST_REPEATED * self.report.rows as f64)
        {
            let (repeated, rows) = (repeated.rows, self.report.rows);
            return Err(error!(
                "{repeated} of {rows} rows have the time of the row before: take a column of finer time in [time], or \
                 their distance by `period`"
            ));
        }
        let is_sound = |reason| matches!(reason, Reason::Absent | Reason::RepeatedTime | Reason::Outlier);
        let broken = |dropped: &&Dropped| !is_sound(dropped.reason);
        let dropped: u64 = self.report.dropped.iter().filter(broken).map(|dropped| dropped.rows).sum();
        let most = self.report.dropped.iter().filter(broken).max_by_key(|dropped| dropped.rows);
        if let Some(most) = most.filter(|_| 2 * dropped > self.report.rows) {
            let remedy = remedy(most.reason, of_robot, self.mapping);
            let (rows, listed) = (self.report.rows, self.report.left_out());
            return Err(error!("{dropped} of {rows} rows cannot be used ({listed}): {remedy}"));
        }
        let keep = self.mapping.torque.keep;
        let ways = [LeadDirection::Forward, LeadDirection::Backward].map(Branches::One);
        let combined = match keep {
            Keep::All => None,
            Keep::Static => Some(Branches::Any),
            Keep::Average => Some(Branches::Mean),
            Keep::Forward => Some(ways[0]),
            Keep::Backward => Some(ways[1]),
        };
        let mut branches = None;
        if let Some(combined) = combined {
            let joints = std::mem::take(&mut self.samples.joints);
            self.report.cells = Some(self.cells.report());
            branches = (keep != Keep::Static).then(|| ways.map(|way| self.cells.samples(way, &joints)));
            self.samples = self.cells.samples(combined, &joints);
        }
        self.report.samples = self.samples.len();
        if self.samples.is_empty() {
            return Err(error!(
                "no row was kept of {} ({}); see torque.keep, torque.still and torque.cell in the mapping",
                counted(self.report.rows, ["row", "rows"]),
                self.report.left_out()
            ));
        }
        self.histories.retain(|history| !history.times.is_empty());
        Ok(Imported { samples: self.samples, branches, histories: self.histories, report: self.report })
    }
}

#[cfg(test)]
mod tests;
