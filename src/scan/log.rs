//! The log of a scan: a table of text that a person can read, written row by row, so that an interrupted scan keeps
//! all it measured and can be resumed.
//!
//! Comment lines say what was touched (or simulated), how the numbers are meant, and hold the scene's text (after
//! `#>`), so that the log alone is enough to gridize and feel. Then a header line and one row a point: its number in
//! the plan, time, measured configuration, contact torque on the proxy (minus control torque, gravity already
//! subtracted), standard deviation of a single tick's torque, ticks averaged, status.

use crate::{
    Error, JointVector, MAX_AXES,
    csv::{LONGEST_LINE, Lines, Table},
    dataset::JointLabel,
    gridize::{ForceHistory, Samples},
    input,
    names::counted,
};
use clap::{ValueEnum, builder::PossibleValue};
use std::{
    fmt::Write as _,
    fs::{File, OpenOptions},
    io::{self, BufReader, BufWriter, Read, Seek, SeekFrom, Write},
    path::{Path, PathBuf},
};

/// First line of every scan log.
pub const SIGNATURE: &str = "# haptize scan log, version 1";
/// Before every line of the scene.
const SCENE: &str = "#> ";
/// After `# plan: `, where there was none but a hand's.
const GUIDED: &str = "led by hand";
/// Most rows that are read.
const MOST_ROWS: usize = 5_000_000;

/// How a point ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum RowStatus {
    /// Measured in steady contact.
    Steady,
    /// Measured, but not steady when the time was over: not gridized.
    Unsteady,
    /// A limit stopped the scan here: not gridized.
    Limit,
    /// Part of a press that is recorded, while the device moves: not gridized.
    Moving,
    /// The same while it is held, and has come to rest itself.
    Held,
}

impl RowStatus {
    /// Whether the row is part of a press that is recorded, of which the object's memory and friction are identified.
    #[must_use]
    pub fn is_recorded(self) -> bool {
        matches!(self, Self::Moving | Self::Held)
    }
}

/// One measurement.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ScanRow {
    /// Number in the plan.
    pub point: usize,
    /// Since the rig was started, at the end of the average, or in its middle where it is recorded (s).
    pub time: f64,
    /// Measured configuration, averaged (rad or m).
    pub q: JointVector,
    /// Contact torque on the proxy, averaged (N m or N).
    pub torque: JointVector,
    /// Standard deviation of the torque of a single tick (N m or N).
    pub deviation: JointVector,
    /// Ticks averaged.
    pub ticks: u32,
    /// How the point ended.
    pub status: RowStatus,
}

/// Header of a log.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct LogHeader {
    /// The rig's own words.
    pub rig: String,
    /// True where no real object was touched.
    pub simulated: bool,
    /// True where a hand led the device; rows are then numbered as they came.
    pub guided: bool,
    /// Names and units.
    pub joints: Vec<JointLabel>,
    /// The scene's text.
    pub scene: String,
}

/// A log that was read.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ScanLog {
    /// Header of the log.
    pub header: LogHeader,
    /// In the order of measurement.
    pub rows: Vec<ScanRow>,
}

/// A log that is written.
#[derive(Debug)]
pub struct LogWriter {
    path: PathBuf,
    file: BufWriter<File>,
}

/// The error of the log at `path`, which the system refuses to read or to write.
fn failed(path: &Path, source: &io::Error) -> Error {
    let remedy = "check the path, its permissions and the room left";
    Error::at(path, format_args!("cannot be read or written: {source}; {remedy}"))
}

impl LogHeader {
    fn columns(&self) -> String {
        let mut columns = vec!["point".to_owned(), "time [s]".to_owned()];
        columns.extend(self.joints.iter().map(|joint| joint.heading("q")));
        for what in ["tau", "std"] {
            columns.extend(self.joints.iter().map(|joint| joint.effort_heading(what)));
        }
        columns.join(",") + ",ticks,status"
    }

    /// The first two lines.
    fn opening(&self) -> String {
        format!("{SIGNATURE}\n# kind: {}\n", if self.simulated { "simulated" } else { "real" })
    }

    fn text(&self) -> String {
        let plan = if self.guided { GUIDED } else { "the scene's" };
        let mut text = self.opening();
        let _ = write!(
            text,
            "# plan: {plan}\n# rig: {}\n\
             # tau: contact torque on the proxy in steady contact, minus control torque, gravity subtracted\n\
             # std: standard deviation of a single tick's torque over the ticks that were averaged\n",
            self.rig
        );
        for line in self.scene.lines() {
            let _ = writeln!(text, "{SCENE}{line}");
        }
        let _ = writeln!(text, "{}", self.columns());
        text
    }
}

impl LogWriter {
    /// Begins the log at `path`.
    ///
    /// # Errors
    /// When there is a file already, or it cannot be made.
    pub fn create(path: &Path, header: &LogHeader) -> Result<Self, Error> {
        let refused = |source: io::Error| match source.kind() {
            io::ErrorKind::AlreadyExists => {
                Error::at(path, "exists already; continue it with --resume, or name another file")
            }
            _ => failed(path, &source),
        };
        let file = OpenOptions::new().write(true).create_new(true).open(path).map_err(refused)?;
        let mut writer = Self { path: path.to_owned(), file: BufWriter::new(file) };
        writer.write(|file| file.write_all(header.text().as_bytes()))?;
        Ok(writer)
    }

    /// Continues the log at `path`; its rows so far. A last line that was cut off is removed.
    ///
    /// # Errors
    /// When it cannot be read, or its header is not `header`.
    pub fn resume(path: &Path, header: &LogHeader) -> Result<(Self, Vec<ScanRow>), Error> {
        let failed = |source| failed(path, &source);
        let mut file = OpenOptions::new().read(true).write(true).open(path).map_err(failed)?;
        let whole = whole_lines(&mut file).map_err(failed)?;
        // Nothing is cut off before it is known that the file is this scan's log.
        file.rewind().map_err(failed)?;
        let log = ScanLog::parse(path, (&file).take(whole))?;
        if log.header != *header {
            let what = "the log was made with another scene or rig, or one with a plan and one led by hand; it cannot be \
                        continued with this one";
            return Err(Error::at(path, what));
        }
        file.set_len(whole).map_err(failed)?;
        file.seek(SeekFrom::End(0)).map_err(failed)?;
        Ok((Self { path: path.to_owned(), file: BufWriter::new(file) }, log.rows))
    }

    /// Appends a row, and hands it to the system at once.
    ///
    /// # Errors
    /// Those of the file.
    pub fn append(&mut self, row: &ScanRow) -> Result<(), Error> {
        self.write(|file| write_row(row, file))
    }

    fn write(&mut self, write: impl FnOnce(&mut BufWriter<File>) -> io::Result<()>) -> Result<(), Error> {
        let written = write(&mut self.file).and_then(|()| self.file.flush());
        written.map_err(|source| failed(&self.path, &source))
    }
}

fn write_row(row: &ScanRow, out: impl Write) -> io::Result<()> {
    let mut table = Table::new(out);
    table.field(row.point)?.field(row.time)?;
    table.fields(row.q.iter().chain(row.torque.iter()).chain(row.deviation.iter()))?;
    let status = row.status.to_possible_value();
    table.field(row.ticks)?.fields(status.as_ref().map(PossibleValue::get_name))?.end()
}

/// Length of the file up to its last line end (bytes).
fn whole_lines(file: &mut File) -> io::Result<u64> {
    let length = file.seek(SeekFrom::End(0))?;
    let tail = length.min(LONGEST_LINE);
    file.seek(SeekFrom::Start(length - tail))?;
    let mut bytes = Vec::new();
    Read::by_ref(file).take(tail).read_to_end(&mut bytes)?;
    let cut = bytes.iter().rev().take_while(|byte| **byte != b'\n').count();
    Ok(length - cut as u64)
}

impl ScanLog {
    /// Whether the file at `path` begins like a scan log.
    #[must_use]
    pub fn is_one(path: &Path) -> bool {
        input::begins(path, SIGNATURE.as_bytes())
    }

    /// Whether the file at `path` begins like the log of a simulated scan, or is empty as one that was ended before its
    /// first line.
    #[must_use]
    pub fn is_simulated(path: &Path) -> bool {
        let opening = LogHeader { simulated: true, ..LogHeader::default() }.opening();
        let mut start = Vec::new();
        let read = input::open(path).and_then(|file| file.take(opening.len() as u64).read_to_end(&mut start));
        read.is_ok() && (start.is_empty() || start == opening.as_bytes())
    }

    /// Reads the log at `path`.
    ///
    /// # Errors
    /// The error names the file and the line.
    pub fn read(path: &Path) -> Result<Self, Error> {
        let file = input::open(path).map_err(|source| failed(path, &source))?;
        Self::parse(path, file)
    }

    /// Reads `file`, which is at `path`, from where it stands.
    fn parse(path: &Path, file: impl Read) -> Result<Self, Error> {
        let mut lines = Lines::new(path, BufReader::new(file));
        let mut log = Self::default();
        let (mut text, mut has_columns) = (Vec::new(), false);
        if lines.next(&mut text)?.is_some_and(|line| line != SIGNATURE.as_bytes()) {
            let what = format!(
                "not a scan log (its first line is not `{SIGNATURE}`); of other tables `haptize gridize` makes a dataset, by a \
                 column mapping (--columns), which `haptize gridize --guess LOG` writes"
            );
            return Err(Error::at(path, what));
        }
        while let Some(line) = lines.next_text(&mut text)? {
            let bad = |message: String| lines.error(message);
            if let Some(scene) = line.strip_prefix(SCENE.trim_end()) {
                log.header.scene += scene.strip_prefix(' ').unwrap_or(scene);
                log.header.scene.push('\n');
            } else if let Some(kind) = line.strip_prefix("# kind: ") {
                log.header.simulated = kind == "simulated";
            } else if let Some(plan) = line.strip_prefix("# plan: ") {
                log.header.guided = plan == GUIDED;
            } else if let Some(rig) = line.strip_prefix("# rig: ") {
                rig.clone_into(&mut log.header.rig);
            } else if line.starts_with('#') || line.is_empty() {
            } else if !has_columns {
                log.header.joints = labels(line).map_err(bad)?;
                has_columns = true;
            } else if log.rows.len() == MOST_ROWS {
                return Err(bad(format!("more than {MOST_ROWS} rows")));
            } else {
                log.rows.push(row(line, log.header.joints.len()).map_err(bad)?);
            }
        }
        if !has_columns {
            return Err(lines.error("the log ends before its first row"));
        }
        Ok(log)
    }

    /// The presses that were recorded, in the order of measurement; rows of a device that is held count.
    #[must_use]
    pub fn histories(&self) -> Vec<ForceHistory> {
        let mut histories: Vec<ForceHistory> = Vec::new();
        let mut last = None;
        for row in &self.rows {
            let press = row.status.is_recorded().then_some(row.point);
            let Some(point) = press else {
                last = None;
                continue;
            };
            if last.replace(point) != press {
                histories.push(ForceHistory::default());
            }
            if let Some(history) = histories.last_mut() {
                history.push(row.time, &row.q, &row.torque, (row.status == RowStatus::Held, None));
            }
        }
        histories
    }

    /// The steady measurements, each with the standard deviation of its mean: that of a tick over the root of the
    /// ticks.
    #[must_use]
    pub fn samples(&self) -> Samples {
        let mut samples = Samples { joints: self.header.joints.clone(), ..Samples::default() };
        let mut deviations = Vec::new();
        for row in self.rows.iter().filter(|row| row.status == RowStatus::Steady) {
            samples.configurations.extend_from_slice(&row.q);
            samples.torques.extend_from_slice(&row.torque);
            let root = f64::from(row.ticks.max(1)).sqrt();
            deviations.extend(row.deviation.iter().map(|deviation| deviation / root));
        }
        samples.deviations = Some(deviations);
        samples
    }
}

/// Joint names and units from the header line.
fn labels(line: &str) -> Result<Vec<JointLabel>, String> {
    let wrong = || format!("the header line is not one of a scan log: `{line}`");
    let names = line.split(',').skip(2).take_while(|column| column.starts_with("q "));
    let joints: Option<Vec<JointLabel>> = names
        .map(|column| {
            let (name, unit) = column.strip_prefix("q ")?.strip_suffix(']')?.rsplit_once(" [")?;
            Some(JointLabel { name: name.to_owned(), unit: unit.to_owned() })
        })
        .collect();
    let joints = joints.filter(|joints| (1..=MAX_AXES).contains(&joints.len())).ok_or_else(wrong)?;
    let header = LogHeader { joints, ..LogHeader::default() };
    if header.columns() == line { Ok(header.joints) } else { Err(wrong()) }
}

fn row(line: &str, joints: usize) -> Result<ScanRow, String> {
    let fields: Vec<&str> = line.split(',').collect();
    let columns = 3 * joints + 4;
    if fields.len() != columns {
        return Err(format!("{} where {columns} are expected", counted(fields.len(), ["column", "columns"])));
    }
    let number = |column: usize| {
        let value: Option<f64> = fields[column].parse().ok();
        let wrong = || format!("column {} holds `{}`, not a finite number", column + 1, fields[column]);
        value.filter(|value| value.is_finite()).ok_or_else(wrong)
    };
    let vector = |first: usize| (first..first + joints).map(number).collect::<Result<JointVector, String>>();
    let whole = |column: usize| {
        let wrong = || format!("column {} holds `{}`, not a whole number", column + 1, fields[column]);
        fields[column].parse::<u32>().map_err(|_| wrong())
    };
    Ok(ScanRow {
        point: whole(0)? as usize,
        time: number(1)?,
        q: vector(2)?,
        torque: vector(2 + joints)?,
        deviation: vector(2 + 2 * joints)?,
        ticks: whole(columns - 2)?,
        status: RowStatus::from_str(fields[columns - 1], false)
            .map_err(|_| format!("status `{}` is unknown", fields[columns - 1]))?,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn header() -> LogHeader {
        LogHeader {
            rig: "a rig, on a table".to_owned(),
            simulated: true,
            guided: true,
            joints: [("base yaw", "rad"), ("slide", "m")]
                .map(|(name, unit)| JointLabel { name: name.to_owned(), unit: unit.to_owned() })
                .into(),
            scene: "name = \"x\"\n\n  # indented\n[scan]\n".to_owned(),
        }
    }

    fn row(point: usize) -> ScanRow {
        let vector = |x: f64| JointVector::from_slice(&[x, -x / 3.0]);
        let x = point as f64;
        ScanRow {
            point,
            time: 0.1 * x,
            q: vector(x),
            torque: vector(0.1 + x),
            deviation: vector(0.01),
            ticks: 100,
            status: if point == 1 { RowStatus::Unsteady } else { RowStatus::Steady },
        }
    }

    #[test]
    fn a_log_is_read_as_it_was_written_and_continued_after_a_cut() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("scan.csv");
        let mut writer = LogWriter::create(&path, &header()).unwrap();
        (0..3).for_each(|point| writer.append(&row(point)).unwrap());
        drop(writer);
        let log = ScanLog::read(&path).unwrap();
        assert_eq!((&log.header, &log.rows[..]), (&header(), &[row(0), row(1), row(2)][..]));
        assert_eq!(log.samples().configurations, [0.0, 0.0, 2.0, -2.0 / 3.0]);
        assert!(LogWriter::create(&path, &header()).unwrap_err().to_string().contains("exists already"));

        let text = std::fs::read(&path).unwrap();
        std::fs::write(&path, &text[..text.len() - 9]).unwrap();
        let (mut writer, rows) = LogWriter::resume(&path, &header()).unwrap();
        assert_eq!(rows, [row(0), row(1)]);
        writer.append(&row(7)).unwrap();
        drop(writer);
        assert_eq!(ScanLog::read(&path).unwrap().rows, [row(0), row(1), row(7)]);
        let other = LogHeader { scene: "name = \"y\"\n".to_owned(), ..header() };
        assert!(LogWriter::resume(&path, &other).unwrap_err().to_string().contains("another scene"));
        assert!(ScanLog::is_simulated(&path));
        std::fs::write(&path, LogHeader { simulated: false, ..header() }.text()).unwrap();
        assert!(ScanLog::is_one(&path) && !ScanLog::is_simulated(&path));
    }

    #[test]
    fn a_file_that_is_not_the_log_to_be_continued_is_left_as_it_is() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("notes.csv");
        let of_another_scene = LogHeader { scene: "name = \"y\"\n".to_owned(), ..header() }.text() + "0,0,1,2,3";
        for text in ["time,q\n1,2", "a line without an end", &of_another_scene] {
            std::fs::write(&path, text).unwrap();
            assert!(LogWriter::resume(&path, &header()).is_err());
            assert_eq!(std::fs::read_to_string(&path).unwrap(), text);
        }
    }

    #[test]
    fn broken_logs_are_refused_with_the_line() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("scan.csv");
        let refused = |text: &str| {
            std::fs::write(&path, text).unwrap();
            ScanLog::read(&path).err().unwrap().to_string()
        };
        let good = header().text() + "0,0,1,2,3,4,5,6,10,steady\n";
        let last = good.lines().count();
        assert!(refused("time,q\n1,2\n").contains("column mapping"));
        assert!(refused(&format!("{SIGNATURE}\n")).contains("before its first row"));
        for (from, to, what) in [
            ("0,0,1,2", "0,0,1", "9 columns"),
            ("0,0,1,2", "0,0,nan,2", "`nan`"),
            ("0,0,1,2", "-1,0,1,2", "`-1`"),
            ("10,steady", "10,fine", "`fine`"),
        ] {
            let error = refused(&good.replace(from, to));
            assert!(error.contains(&format!("scan.csv:{last}:")) && error.contains(what), "{error}");
        }
        assert!(refused(&good.replace("std slide", "std slid")).contains("header line"));
    }
}
