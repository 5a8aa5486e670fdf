//! The recording of a rendering session: one row a tick, the object's shape at chosen instants, and their summary.
//!
//! The number of contacting object nodes (paper's Fig. 5) is that of the heaviest grid corner in contact: the contact
//! list Cvo of the grid point with the largest interpolation weight. It is thus a number that was solved for, where
//! the union over the corners would count nodes that never touch at the same time.

use super::{
    accounts::Accounts,
    columns::{self, TRACED},
    flags::{Fault, Flags},
    haptic::Inputs,
};
use crate::{JointVector, csv::Table, dataset::JointLabel, device::Applied, field::Sample};
use glam::DVec3;
use serde::Serialize;
use std::io::{self, Write};

/// One tick of the haptic loop, at its beginning.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Tick {
    /// Since the start (s).
    pub time: f64,
    /// Input of the loop, unchanged.
    pub inputs: Inputs,
    /// Whether the tick was done after its time, of a simulated hand at rest that nobody sees tick.
    pub in_arrears: bool,
    /// Whether a fault was cleared before the tick.
    pub restart: bool,
    /// Where the hand wants the device; the device's own position where no hand is simulated (rad or m).
    pub hand: JointVector,
    /// Device position y (rad or m).
    pub device: JointVector,
    /// Proxy position x (rad or m).
    pub proxy: JointVector,
    /// Torque commanded to the device (N m or N).
    pub device_torque: JointVector,
    /// Part of it that the device applied, and why not all.
    pub applied: Applied,
    /// Contact that the proxy felt.
    pub sample: Sample,
    /// Part of the dent that would stay if the arm let go, or that is left since it did: w_s over the root of the energy
    /// at the last contact, 0 to 1; absent where the object does not relax.
    pub dent: Option<f64>,
    /// Remarks on the tick.
    pub flags: Flags,
    /// Why the torque is being brought to zero, if it is.
    pub fault: Option<Fault>,
    /// Energy accounts at the beginning of the tick.
    pub accounts: Accounts,
    /// Frames of the object that showed it, kept or not; known when the session is over.
    pub frames: u32,
}

/// The object at one instant.
#[derive(Clone, Debug, PartialEq)]
pub struct Frame {
    /// (s)
    pub time: f64,
    /// Proxy position whose contact forces deform the object (rad or m).
    pub proxy: JointVector,
    /// Positions n of the object's nodes, surface nodes first (m).
    pub nodes: Vec<DVec3>,
}

/// Everything that was recorded.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Trace {
    /// One per joint.
    pub joints: Vec<JointLabel>,
    /// Position at which the proxy was put (rad or m).
    pub start: JointVector,
    /// Ascending in time.
    pub ticks: Vec<Tick>,
    /// Ascending in time; empty without graphics.
    pub frames: Vec<Frame>,
}

/// Key figures of a session. Sizes of torques are norms over the joints that turn, those of forces over the joints that
/// slide: together they would have no unit.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Summary {
    /// Ticks recorded.
    pub ticks: usize,
    /// Duration (s).
    pub seconds: f64,
    /// Share of ticks in contact, 0 to 1.
    pub contact_share: f64,
    /// Most object nodes in contact at once.
    pub max_contact_nodes: u32,
    /// Largest contact torque, over the joints that turn (N m).
    pub max_contact_torque: f64,
    /// Largest contact force, over the joints that slide (N).
    pub max_contact_force: f64,
    /// Largest change of the contact torque from tick to tick, per millisecond (N m/ms).
    pub max_contact_torque_step: f64,
    /// Largest change of the contact force from tick to tick, per millisecond (N/ms).
    pub max_contact_force_step: f64,
    /// Largest torque on the device, over the joints that turn (N m).
    pub max_device_torque: f64,
    /// Largest force on the device, over the joints that slide (N).
    pub max_device_force: f64,
    /// Largest change of the torque on the device from tick to tick, per millisecond (N m/ms).
    pub max_device_torque_step: f64,
    /// Largest change of the force on the device from tick to tick, per millisecond (N/ms).
    pub max_device_force_step: f64,
    /// Largest residual of the energy accounts (J).
    pub max_account_residual: f64,
    /// The same over the energy that the whole session exchanged (1).
    pub max_relative_account_residual: f64,
    /// Least that proxy and coupling had absorbed at any tick (J): not below zero but for rounding.
    pub min_absorbed: f64,
    /// Energy that the contact torque gave beyond what was stored, by time step and interpolation, up to the last tick
    /// (J).
    pub leak: f64,
    /// Energy made by holding the device's torque between ticks, at the last tick (J).
    pub hold_gain: f64,
    /// Energy that the device's port took in, at the last tick (J).
    pub port_work: f64,
    /// Ticks with the proxy outside the grid, in space that is known to be free.
    pub outside: usize,
    /// Ticks with the proxy held at the border of the haptized range.
    pub held: usize,
    /// Ticks with the proxy beside an absent grid point. `absent` are the columns that a dataset lacks, in the same object.
    #[serde(rename = "absent_ticks")]
    pub absent: usize,
    /// Ticks with the proxy beside an unconverged grid point, or for which contact was not solved in time.
    pub unconverged: usize,
    /// Ticks in which the twin of a real object answers, and those in which it alone does.
    pub twin_ticks: usize,
    /// See `twin_ticks`.
    pub twin_alone: usize,
    /// Ticks with the torque on the device limited in size or rate.
    pub limited: usize,
    /// Ticks with a fault.
    pub faults: usize,
    /// Ticks at which the device held less than what was asked for.
    pub clamped: usize,
    /// Ticks at which the device's safety layer kept it without torque.
    pub halted: usize,
}

impl Trace {
    /// Figures over the whole recording.
    #[must_use]
    pub fn summary(&self) -> Summary {
        let mut s = Summary { ticks: self.ticks.len(), ..Summary::default() };
        let flagged = |flags: Flags| self.ticks.iter().filter(|tick| tick.flags.intersects(flags)).count();
        s.outside = flagged(Flags::OUTSIDE);
        s.held = flagged(Flags::HELD);
        s.absent = flagged(Flags::ABSENT);
        s.unconverged = flagged(Flags::UNCONVERGED);
        s.twin_ticks = self.ticks.iter().filter(|tick| tick.sample.twin > 0.0).count();
        s.twin_alone = self.ticks.iter().filter(|tick| tick.sample.twin == 1.0).count();
        s.limited = flagged(Flags::SIZE_LIMITED | Flags::RATE_LIMITED);
        s.faults = self.ticks.iter().filter(|tick| tick.fault.is_some()).count();
        s.clamped = self.ticks.iter().filter(|tick| !tick.applied.clamps.is_empty()).count();
        s.halted = self.ticks.iter().filter(|tick| tick.applied.halt.is_some()).count();
        for tick in &self.ticks {
            s.max_contact_nodes = s.max_contact_nodes.max(tick.sample.contact_nodes);
            raise([&mut s.max_contact_torque, &mut s.max_contact_force], self.sizes(&tick.sample.torque));
            raise([&mut s.max_device_torque, &mut s.max_device_force], self.sizes(&tick.device_torque));
            let residual = tick.accounts.residual().abs();
            s.max_account_residual = s.max_account_residual.max(residual);
            s.min_absorbed = s.min_absorbed.min(tick.accounts.absorbed());
        }
        for pair in self.ticks.windows(2) {
            let milliseconds = 1e3 * (pair[1].time - pair[0].time);
            if milliseconds > 0.0 {
                let step = |of: fn(&Tick) -> &JointVector| {
                    let mut change = *of(&pair[1]);
                    change.iter_mut().zip(of(&pair[0]).iter()).for_each(|(b, a)| *b = (*b - a) / milliseconds);
                    self.sizes(&change)
                };
                let contact = [&mut s.max_contact_torque_step, &mut s.max_contact_force_step];
                raise(contact, step(|tick| &tick.sample.torque));
                let device = [&mut s.max_device_torque_step, &mut s.max_device_force_step];
                raise(device, step(|tick| &tick.device_torque));
            }
        }
        if let (Some(first), Some(last)) = (self.ticks.first(), self.ticks.last()) {
            s.seconds = last.time - first.time;
            s.contact_share =
                self.ticks.iter().filter(|tick| tick.sample.contact).count() as f64 / self.ticks.len() as f64;
            if last.accounts.exchanged > 0.0 {
                s.max_relative_account_residual = s.max_account_residual / last.accounts.exchanged;
            }
            s.leak = last.accounts.leak;
            s.hold_gain = last.accounts.hold_gain();
            s.port_work = last.accounts.port_work;
        }
        s
    }

    /// Norms of `effort` over the joints that turn (N m), and over those that slide (N).
    fn sizes(&self, effort: &JointVector) -> [f64; 2] {
        let mut squares = [0.0; 2];
        for (effort, joint) in effort.iter().zip(&self.joints) {
            squares[usize::from(joint.unit == "m")] += effort * effort;
        }
        squares.map(f64::sqrt)
    }

    /// Writes all ticks as CSV ([`TickTable`]).
    ///
    /// # Errors
    /// Those of `out`.
    pub fn write_ticks(&self, out: &mut impl Write) -> io::Result<()> {
        let mut table = TickTable::new(&self.joints, out)?;
        self.ticks.iter().try_for_each(|tick| table.add(tick))?;
        table.finish()
    }

    /// Writes all frames as CSV: time, node, position.
    ///
    /// # Errors
    /// Those of `out`.
    pub fn write_frames(&self, out: &mut impl Write) -> io::Result<()> {
        let mut table = Table::new(out);
        table.fields(["time [s]", "node", "x [m]", "y [m]", "z [m]"])?.end()?;
        for frame in &self.frames {
            for (node, n) in frame.nodes.iter().enumerate() {
                table.field(frame.time)?.field(node)?.fields([n.x, n.y, n.z])?.end()?;
            }
        }
        Ok(())
    }
}

/// Ticks as CSV: one header line with units, then one row a tick, with every energy account ([`Accounts::named`]); a
/// field is empty where nothing is known. Numbers are printed so that reading them gives the same bits.
pub struct TickTable<W> {
    table: Table<W>,
    joints: usize,
}

impl<W: Write> TickTable<W> {
    /// Writes the header.
    ///
    /// # Errors
    /// Those of `out`, here and below.
    pub fn new(joints: &[JointLabel], out: W) -> io::Result<Self> {
        let mut table = Table::new(out);
        columns::head(TRACED, joints, &mut table)?;
        table.fields(Accounts::default().named().map(|(name, _)| format!("{name} [J]")))?.end()?;
        Ok(Self { table, joints: joints.len() })
    }

    /// Writes a row.
    pub fn add(&mut self, tick: &Tick) -> io::Result<()> {
        let Self { table, joints } = self;
        columns::write(TRACED, *tick, *joints, table)?;
        for (_, account) in tick.accounts.named() {
            table.optional(account)?;
        }
        table.end()
    }

    /// Hands everything on to where `out` leads.
    pub fn finish(self) -> io::Result<()> {
        self.table.finish()
    }
}

/// Raises each of `most` to what it is at least.
fn raise(most: [&mut f64; 2], least: [f64; 2]) {
    most.into_iter().zip(least).for_each(|(most, least)| *most = most.max(least));
}

#[cfg(test)]
mod tests {
    use super::*;

    fn tick(time: f64, torque: f64) -> Tick {
        let one = JointVector::from_slice(&[torque]);
        Tick {
            time,
            inputs: Inputs { position: one, age: 0.0, elapsed: 1e-3, interval: 1e-3 },
            hand: one,
            device: one,
            proxy: one,
            device_torque: one,
            applied: Applied::whole(&one),
            sample: Sample { torque: one, index: 1.0, contact: torque != 0.0, contact_nodes: 3, ..Sample::default() },
            ..Tick::default()
        }
    }

    fn trace() -> Trace {
        let joints = vec![JointLabel { name: "base, left".into(), unit: "rad".into() }];
        let ticks = vec![tick(0.0, 0.0), tick(0.002, 0.5), tick(0.003, 0.25)];
        Trace { joints, ticks, ..Trace::default() }
    }

    #[test]
    fn the_largest_torque_step_is_per_millisecond() {
        let summary = trace().summary();
        assert_eq!(summary.max_contact_torque_step, 0.25);
        assert_eq!(summary.max_contact_torque, 0.5);
        assert!((summary.contact_share - 2.0 / 3.0).abs() < f64::EPSILON);
    }

    #[test]
    fn torques_and_forces_are_apart() {
        let mut ticks = vec![tick(0.0, 0.0), tick(0.001, 0.0)];
        ticks[1].sample.torque = JointVector::from_slice(&[3.0, 0.3, 0.4]);
        ticks[1].device_torque = JointVector::from_slice(&[-2.0, 0.0, 0.1]);
        ticks[0].sample.torque = JointVector::zeros(3);
        ticks[0].device_torque = JointVector::zeros(3);
        let joints = ["m", "rad", "rad"].map(|unit| JointLabel { name: unit.into(), unit: unit.into() });
        let s = Trace { joints: joints.into(), ticks, ..Trace::default() }.summary();
        assert_eq!((s.max_contact_torque, s.max_contact_force), (0.5, 3.0));
        assert_eq!((s.max_contact_torque_step, s.max_contact_force_step), (0.5, 3.0));
        assert_eq!((s.max_device_torque, s.max_device_force), (0.1, 2.0));
        assert_eq!((s.max_device_torque_step, s.max_device_force_step), (0.1, 2.0));
    }

    #[test]
    fn every_row_has_as_many_fields_as_the_header() {
        let mut bytes = Vec::new();
        trace().write_ticks(&mut bytes).unwrap();
        let text = String::from_utf8(bytes).unwrap();
        let fields: Vec<usize> = text.lines().map(|line| line.split(',').count()).collect();
        assert_eq!(fields.len(), 4);
        assert!(fields.iter().all(|&count| count == fields[0]), "{text}");
    }

    #[test]
    fn an_empty_recording_has_a_summary() {
        assert_eq!(Trace::default().summary(), Summary::default());
    }
}
