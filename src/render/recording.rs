//! A session's recording: all that the haptic loop received and what it answered, tick by tick. A file of it, read
//! back, replays the session bit for bit, whether it ran against the clock or not, and finds the first tick that
//! differs.
//!
//! CSV: comments (#), one of them with the device's first position and one with the instants of the frames that were
//! kept; a header; one row a tick, of the columns in `columns.rs`. `elapsed`, `interval`, `age` and position are the
//! tick's inputs as in [`Inputs`](super::haptic::Inputs); `restart` is 1 where a fault was cleared; `frames` is how many
//! frames of the object showed this tick; torque and proxy are the answer, `held` is what the device held of the torque
//! (as much as was asked for where a file has no such columns). Numbers are printed so that reading gives the same bits.
//! A position of a wrong number of joints has empty fields.

use super::{
    columns::{RECORDED, head, number, read, read_vector, width, write, write_vector},
    graphics::Graphics,
    haptic::Haptics,
    session::{Driver, Frames, HapticController, Latest, Plan, collect},
    trace::{Tick, Trace},
};
use crate::{
    Error, JointVector,
    control::Clock,
    csv::{Lines, Table},
    dataset::JointLabel,
    device::{Applied, Device, Reading},
    names::counted,
};
use std::{
    io::{self, Write},
    path::Path,
};

/// All that a session needs to be had again: of its ticks, what the columns tell.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Recording {
    /// Position at which the proxy was put (rad or m).
    start: JointVector,
    /// When the frames that were kept were drawn (s).
    kept: Vec<f64>,
    ticks: Vec<Tick>,
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

/// Beginning of the file.
pub const SIGNATURE: &str = "# a session of haptize";

/// Beginning of the comment with the frames' instants.
const KEPT: &str = "# frames";

impl Recording {
    /// Writes what is needed to have the session of `trace` again, which must hold every tick of it.
    ///
    /// # Errors
    /// Those of `out`.
    pub fn write(trace: &Trace, out: &mut impl Write) -> io::Result<()> {
        let joints = trace.joints.len();
        writeln!(out, "{SIGNATURE} {}; `haptize play --replay` gives it again", env!("CARGO_PKG_VERSION"))?;
        let mut table = Table::new(out);
        write_vector(&trace.start, joints, table.field(START)?)?;
        table.end()?;
        table.field(KEPT)?.fields(trace.frames.iter().map(|frame| frame.time))?.end()?;
        head(RECORDED, &trace.joints, &mut table)?;
        table.end()?;
        for tick in &trace.ticks {
            write(RECORDED, *tick, joints, &mut table)?;
            table.end()?;
        }
        Ok(())
    }

    /// Number of ticks.
    #[must_use]
    pub fn ticks(&self) -> usize {
        self.ticks.len()
    }

    /// Reads the recording in `file`, of a proxy of `joints` joints.
    ///
    /// # Errors
    /// When the file cannot be read or is no such recording; the error names file and line.
    pub fn read(file: &Path, joints: usize) -> Result<Self, Error> {
        let mut lines = Lines::open(file, GREATEST_FILE, REMEDY)?;
        let mut recording = Self::default();
        let (mut line, mut header) = (Vec::new(), false);
        let wrong = |lines: &Lines<_>, what| {
            lines.error(format!("{what}; {REMEDY} for a proxy of {}", counted(joints, ["joint", "joints"])))
        };
        while let Some(text) = lines.next_text(&mut line)? {
            let bad = |what: String| wrong(&lines, what);
            let text = text.trim();
            if let Some(start) = text.strip_prefix(START) {
                let fields: Vec<&str> = start.split(',').skip(1).collect();
                recording.start = read_vector(&fields, joints).map_err(bad)?;
            } else if let Some(kept) = text.strip_prefix(KEPT) {
                recording.kept = kept.split(',').skip(1).map(number).collect::<Result<_, _>>().map_err(bad)?;
            } else if text.is_empty() || text.starts_with('#') {
            } else if !header && text.starts_with("elapsed") {
                header = true;
            } else {
                recording.ticks.push(row(text, joints).map_err(bad)?);
            }
        }
        if recording.start.len() != joints || recording.ticks.is_empty() {
            let what = format!(
                "{} and a first position of {}",
                counted(recording.ticks.len(), ["tick", "ticks"]),
                counted(recording.start.len(), ["joint", "joints"])
            );
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
    ) -> Result<Trace, Error> {
        let mut device = Playback { recording: self, next: None };
        let mut driver = Driver::new(haptics, &mut device)?;
        let plan = Plan { joints, ticks: self.ticks.len(), snapshots: self.kept.clone() };
        let mut times = self.ticks.iter().map(|tick| (tick.inputs.elapsed, tick.inputs.interval));
        // What befell the loop beside the device's readings befalls it again.
        let befall = |controller: &mut HapticController<'_>, tick: &Tick| {
            if tick.restart {
                controller.clear().ask();
            }
        };
        let mut recorded = self.ticks.iter();
        let mut next = recorded.next();
        next.into_iter().for_each(|first| befall(&mut driver.controller, first));
        let each = |controller: &mut HapticController<'_>,
                    tick: &mut Tick,
                    mut frames: Option<&mut Frames<'_, '_>>,
                    latest: &Latest| {
            tick.frames = next.map_or(0, |recorded| recorded.frames);
            if let Some(frames) = &mut frames {
                (0..tick.frames).for_each(|_| frames.draw(latest, false));
            }
            next = recorded.next();
            next.into_iter().for_each(|next| befall(controller, next));
        };
        let (ticks, frames) = collect(driver, Clock::Recorded(&mut times), graphics, &plan, each)?;
        Ok(Trace { joints: plan.joints, start: self.start, ticks, frames })
    }

    /// Number of the first tick of `trace` whose torque or proxy is not that of the recording, to the last bit; none
    /// where all are.
    #[must_use]
    pub fn first_difference(&self, trace: &Trace) -> Option<usize> {
        let same = |a: &JointVector, b: &JointVector| a.iter().map(|x| x.to_bits()).eq(b.iter().map(|x| x.to_bits()));
        let differs = |(a, b): (&Tick, &Tick)| !(same(&a.device_torque, &b.device_torque) && same(&a.proxy, &b.proxy));
        let length = self.ticks.len().min(trace.ticks.len());
        let unequal = (self.ticks.len() != trace.ticks.len()).then_some(length);
        self.ticks.iter().zip(&trace.ticks).position(differs).or(unequal)
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
            return Reading::at(start);
        };
        // No more readings than ticks are asked for.
        let tick = &self.recording.ticks[next.min(self.recording.ticks.len() - 1)];
        Reading { age: tick.inputs.age, hand: tick.hand, ..Reading::at(tick.inputs.position) }
    }

    fn apply(&mut self, torque: &JointVector) -> Applied {
        // The tick that was read last.
        let tick = self.next.and_then(|next| self.recording.ticks.get(next.checked_sub(1)?));
        let held = tick.map(|tick| tick.applied.torque).filter(|held| held.len() == torque.len());
        Applied::whole(&held.unwrap_or(*torque))
    }
}

/// The tick of a row of `text`.
fn row(text: &str, joints: usize) -> Result<Tick, String> {
    let (fields, mut tick) = (text.split(',').collect::<Vec<_>>(), Tick::default());
    let whole = width(RECORDED, joints);
    let without_held = fields.len() + joints == whole;
    if fields.len() != whole && !without_held {
        return Err(format!("{} in the place of {whole}", counted(fields.len(), ["field", "fields"])));
    }
    let known = &RECORDED[..RECORDED.len() - usize::from(without_held)];
    read(known, &fields, joints, &mut tick)?;
    if without_held {
        tick.applied.torque = tick.device_torque;
    }
    if tick.frames > MAX_FRAMES {
        return Err(format!("{} frames in one tick, more than {MAX_FRAMES}", tick.frames));
    }
    Ok(tick)
}
