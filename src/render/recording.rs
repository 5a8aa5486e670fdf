//! A session's recording: all that the haptic loop received and what it answered, tick by tick. A file of it, read
//! back, replays the session bit for bit, whether it ran against the clock or not, and finds the first tick that
//! differs.
//!
//! CSV: comments (#), one of them with the device's first position and one with the instants of the frames that were
//! kept; a header; one row a tick. `elapsed`, `interval`, `age` and position are the tick's inputs as in [`Inputs`];
//! `restart` is 1 where a fault was cleared; `frames` is how many frames of the object showed this tick; torque and
//! proxy are the answer, `held` is what the device held of the torque (as much as was asked for where a file has no
//! such columns). Numbers are printed so that reading gives the same bits. A position of a wrong number of joints has
//! empty fields.

use super::{
    graphics::Graphics,
    haptic::{Haptics, Inputs},
    session::{Driver, Frames, Plan, SessionError},
    trace::{Tick, Trace},
};
use crate::{
    JointVector,
    csv::{Lines, Table, TableError},
    dataset::JointLabel,
    device::{Applied, Device, Reading},
};
use std::{
    io::{self, Write},
    path::Path,
};

/// All that a session needs to be had again.
#[derive(Clone, Debug, PartialEq)]
pub struct Recording {
    /// Position at which the proxy was put (rad or m).
    start: JointVector,
    /// When the frames that were kept were drawn (s).
    kept: Vec<f64>,
    rows: Vec<Row>,
}

/// One tick.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Row {
    inputs: Inputs,
    restart: bool,
    frames: u32,
    hand: JointVector,
    torque: JointVector,
    proxy: JointVector,
    held: JointVector,
}

/// What to do with a file that is no recording.
const REMEDY: &str = "take a file that `haptize play --record` wrote";

/// Largest file that is read (bytes): two hours of six joints at 1 kHz.
const GREATEST_FILE: u64 = 4 << 30;

/// Most frames of a tick: those of a second at the highest rate. A loop that rests longer has long missed its
/// deadlines.
const MAX_FRAMES: u32 = 10_000;

/// Beginning of the comment with the first position.
const START: &str = "# start";

/// Beginning of the comment with the frames' instants.
const KEPT: &str = "# frames";

/// Numbers of a row before its vectors: elapsed, interval, age, restart, frames.
const SCALARS: usize = 5;

impl Recording {
    /// Returns the recording of `trace`, which must hold every tick of the session.
    #[must_use]
    pub fn of(trace: &Trace) -> Self {
        let row = |tick: &Tick| Row {
            inputs: tick.inputs,
            restart: tick.restart,
            frames: 0,
            hand: tick.hand,
            torque: tick.device_torque,
            proxy: tick.proxy,
            held: tick.applied.torque,
        };
        let mut rows: Vec<Row> = trace.ticks.iter().map(row).collect();
        for shown in &trace.shown {
            let tick = trace.ticks.partition_point(|tick| tick.time < *shown);
            if let Some(row) = rows.get_mut(tick) {
                row.frames += 1;
            }
        }
        Self { start: trace.start, kept: trace.frames.iter().map(|frame| frame.time).collect(), rows }
    }

    /// Number of ticks.
    #[must_use]
    pub fn ticks(&self) -> usize {
        self.rows.len()
    }

    /// Writes the recording, its `joints` named in the header.
    ///
    /// # Errors
    /// Those of `out`.
    pub fn write(&self, joints: &[JointLabel], out: &mut impl Write) -> io::Result<()> {
        writeln!(out, "# a session of haptize {}; `haptize play --replay` gives it again", env!("CARGO_PKG_VERSION"))?;
        let mut table = Table::new(out);
        // Empty fields where the session has no such vector.
        let vector = |table: &mut Table<_>, vector: &JointVector| {
            (0..joints.len()).try_for_each(|joint| table.optional(vector.get(joint)).map(|_| ()))
        };
        vector(table.field(START)?, &self.start)?;
        table.end()?;
        table.field(KEPT)?.fields(&self.kept)?.end()?;
        table.fields(["elapsed [s]", "interval [s]", "age [s]", "restart", "frames"])?;
        for what in ["position", "hand"] {
            table.fields(joints.iter().map(|joint| joint.heading(what)))?;
        }
        table.fields(joints.iter().map(|joint| joint.effort_heading("torque")))?;
        table.fields(joints.iter().map(|joint| joint.heading("proxy")))?;
        table.fields(joints.iter().map(|joint| joint.effort_heading("held")))?.end()?;
        for row in &self.rows {
            let Inputs { position, age, elapsed, interval } = &row.inputs;
            table.fields([elapsed, interval, age])?.field(u8::from(row.restart))?.field(row.frames)?;
            for column in [position, &row.hand, &row.torque, &row.proxy, &row.held] {
                vector(&mut table, column)?;
            }
            table.end()?;
        }
        Ok(())
    }

    /// Reads the recording in `file`, of a proxy of `joints` joints.
    ///
    /// # Errors
    /// When the file cannot be read or is no such recording; the error names file and line.
    pub fn read(file: &Path, joints: usize) -> Result<Self, TableError> {
        let mut lines = Lines::open(file, GREATEST_FILE, REMEDY)?;
        let mut recording = Self { start: JointVector::zeros(0), kept: Vec::new(), rows: Vec::new() };
        let (mut line, mut header) = (Vec::new(), false);
        let wrong = |lines: &Lines<_>, what| lines.error(format!("{what}; {REMEDY} for a proxy of {joints} joints"));
        while let Some(text) = lines.next_text(&mut line)? {
            let bad = |what: String| wrong(&lines, what);
            let text = text.trim();
            if let Some(start) = text.strip_prefix(START) {
                let fields: Vec<&str> = start.split(',').skip(1).collect();
                recording.start = vector(&fields, joints).map_err(bad)?;
            } else if let Some(kept) = text.strip_prefix(KEPT) {
                recording.kept = kept.split(',').skip(1).map(number).collect::<Result<_, _>>().map_err(bad)?;
            } else if text.is_empty() || text.starts_with('#') {
            } else if !header && text.starts_with("elapsed") {
                header = true;
            } else {
                recording.rows.push(row(text, joints).map_err(bad)?);
            }
        }
        if recording.start.len() != joints || recording.rows.is_empty() {
            let what =
                format!("{} ticks and a first position of {} joints", recording.rows.len(), recording.start.len());
            return Err(wrong(&lines, what));
        }
        Ok(recording)
    }

    /// Has the session again, with graphics where there is any, as fast as it goes; `joints` are the names in its
    /// trace.
    ///
    /// # Errors
    /// When the recorded session could not start either, or there is no memory.
    pub fn replay(
        &self,
        haptics: &Haptics,
        graphics: Option<&mut Graphics<'_>>,
        joints: Vec<JointLabel>,
    ) -> Result<Trace, SessionError> {
        let mut device = Playback { recording: self, next: None };
        let mut driver = Driver::new(haptics, &mut device, None)?;
        let plan = Plan { joints, ticks: self.rows.len(), snapshots: self.kept.clone() };
        let mut frames = graphics.map(|graphics| Frames::new(graphics, &plan));
        let mut ticks = plan.new_ticks()?;
        for row in &self.rows {
            if row.restart {
                driver.clear_fault();
            }
            let (tick, latest) = driver.tick(row.inputs.elapsed, row.inputs.interval);
            ticks.push(tick);
            if let Some(frames) = &mut frames {
                (0..row.frames).for_each(|_| frames.draw(&latest));
            }
        }
        let (frames, shown) = frames.map(Frames::kept).unwrap_or_default();
        Ok(Trace { joints: plan.joints, start: self.start, ticks, frames, shown })
    }

    /// Number of the first tick of `trace` whose torque or proxy is not that of the recording, to the last bit; none
    /// where all are.
    #[must_use]
    pub fn first_difference(&self, trace: &Trace) -> Option<usize> {
        let same = |a: &JointVector, b: &JointVector| a.iter().map(|x| x.to_bits()).eq(b.iter().map(|x| x.to_bits()));
        let differs =
            |(row, tick): (&Row, &Tick)| !(same(&row.torque, &tick.device_torque) && same(&row.proxy, &tick.proxy));
        let length = self.rows.len().min(trace.ticks.len());
        let unequal = (self.rows.len() != trace.ticks.len()).then_some(length);
        self.rows.iter().zip(&trace.ticks).position(differs).or(unequal)
    }
}

/// The device of a replay: it reports what was recorded, whatever torque it is given.
struct Playback<'a> {
    recording: &'a Recording,
    /// None before the first reading, which is the start.
    next: Option<usize>,
}

impl Device for Playback<'_> {
    fn read(&mut self, _: f64) -> Reading {
        let Some(next) = self.next.replace(self.next.map_or(0, |next| next + 1)) else {
            let start = self.recording.start;
            return Reading { position: start, age: 0.0, hand: start };
        };
        // No more readings than rows are asked for.
        let row = &self.recording.rows[next.min(self.recording.rows.len() - 1)];
        Reading { position: row.inputs.position, age: row.inputs.age, hand: row.hand }
    }

    fn apply(&mut self, torque: &JointVector) -> Applied {
        // The row that was read last.
        let row = self.next.and_then(|next| self.recording.rows.get(next.checked_sub(1)?));
        let held = row.map(|row| row.held).filter(|held| held.len() == torque.len());
        Applied::whole(&held.unwrap_or(*torque))
    }
}

fn row(text: &str, joints: usize) -> Result<Row, String> {
    let fields: Vec<&str> = text.split(',').collect();
    let known = [5, 4].map(|vectors| SCALARS + vectors * joints);
    if !known.contains(&fields.len()) {
        return Err(format!("{} fields in the place of {}", fields.len(), known[0]));
    }
    let frames: u32 = number(fields[4])?;
    if frames > MAX_FRAMES {
        return Err(format!("{frames} frames in one tick, more than {MAX_FRAMES}"));
    }
    let vector = |k: usize| vector(&fields[SCALARS + k * joints..][..joints], joints);
    Ok(Row {
        inputs: Inputs {
            elapsed: number(fields[0])?,
            interval: number(fields[1])?,
            age: number(fields[2])?,
            position: vector(0)?,
        },
        restart: number::<u8>(fields[3])? != 0,
        frames,
        hand: vector(1)?,
        torque: vector(2)?,
        proxy: vector(3)?,
        held: vector(if fields.len() == known[0] { 4 } else { 2 })?,
    })
}

/// The numbers in `fields`, or no joints where all are empty.
fn vector(fields: &[&str], joints: usize) -> Result<JointVector, String> {
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

fn number<T: std::str::FromStr>(field: &str) -> Result<T, String> {
    let shown = || field.trim().chars().take(40).collect::<String>();
    field.trim().parse().map_err(|_| format!("\"{}\" is not such a number", shown()))
}
