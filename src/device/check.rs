//! The procedure of `haptize device check`: read with the motors off, then hold zero torque, then push with little
//! torque while a key is held.
//!
//! In the last phase each coordinate in turn is pushed by a sine of [`SWING`] Hz. If the device yields, the push does
//! positive work where map and sign are right, which the report shows as `moves_along`.

use super::{Guard, Halt, Tally};
use crate::JointVector;
use serde::Serialize;

/// Rate of the push (Hz): slow enough to be followed by eye and hand.
const SWING: f64 = 0.5;

/// Part of the device's limit that pushes (1).
pub const PUSH_SHARE: f64 = 0.1;

/// One phase of the procedure.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Phase {
    /// Motors off.
    Reading,
    /// Motors on, zero torque.
    ZeroTorque,
    /// A tenth of the torque.
    Push,
}

/// The findings of a phase.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct CheckReport {
    /// Which.
    pub phase: Phase,
    /// Duration (s).
    pub seconds: f64,
    /// Measurements that were new when they were taken.
    pub fresh: u64,
    /// Age of the oldest measurement (s).
    pub oldest: f64,
    /// Minimum and maximum of each coordinate (rad or m).
    pub range: Vec<[f64; 2]>,
    /// Work of the push on each coordinate (J): positive if the device moves the way it is pushed.
    pub moves_along: Vec<f64>,
    /// Whether each coordinate was pushed at all: not while the dead-man key is up.
    pub pushed: Vec<bool>,
    /// Clamps and stops.
    pub tally: Tally,
}

impl CheckReport {
    /// Whether the phase found nothing wrong: the device went on, and in the last phase each coordinate was pushed and
    /// moved the way it was pushed.
    #[must_use]
    pub fn is_good(&self) -> bool {
        let moved = || self.pushed.iter().zip(&self.moves_along).all(|(pushed, work)| *pushed && *work >= 0.0);
        self.tally.stopped.is_none() && (self.phase != Phase::Push || moved())
    }
}

/// Runs `phase` for `seconds` on `guard`. `tick` waits for the next tick and returns the time since the last (s), or
/// `None` to end early. Motors are switched on where the phase needs them.
///
/// # Errors
/// Returns the reason if the device refuses to switch its motors on.
pub fn check(
    guard: &mut Guard,
    phase: Phase,
    seconds: f64,
    tick: &mut dyn FnMut() -> Option<f64>,
) -> Result<CheckReport, Halt> {
    let count = guard.coordinates().count();
    if phase == Phase::ZeroTorque {
        guard.enable()?;
    }
    if phase == Phase::Push {
        guard.limit_to(PUSH_SHARE);
    }
    let mut report = CheckReport {
        phase,
        seconds: 0.0,
        fresh: 0,
        oldest: 0.0,
        range: vec![[f64::INFINITY, f64::NEG_INFINITY]; count],
        moves_along: vec![0.0; count],
        pushed: vec![false; count],
        tally: Tally::default(),
    };
    let (mut before, mut effort) = (guard.latest().position, JointVector::zeros(count));
    while report.seconds < seconds {
        let Some(elapsed) = tick() else { break };
        report.seconds += elapsed;
        let measured = *guard.read(elapsed);
        report.fresh += u64::from(measured.age <= elapsed);
        report.oldest = report.oldest.max(measured.age);
        for a in 0..count {
            let [least, most] = &mut report.range[a];
            (*least, *most) = (least.min(measured.position[a]), most.max(measured.position[a]));
            report.moves_along[a] += effort[a] * (measured.position[a] - before[a]);
        }
        before = measured.position;
        let mut wanted = JointVector::zeros(count);
        if phase == Phase::Push {
            // Each coordinate has its turn of the same length.
            let turn = ((report.seconds / seconds * count as f64) as usize).min(count - 1);
            wanted[turn] = guard.most()[turn] * (std::f64::consts::TAU * SWING * report.seconds).sin();
        }
        if phase != Phase::Reading {
            let held = guard.write(&wanted);
            effort = held.effort;
            report.pushed.iter_mut().zip(effort.iter()).for_each(|(pushed, effort)| *pushed |= *effort != 0.0);
            report.tally.add(held.clamps, held.halt);
        } else if let Some(halt) = guard.stopped() {
            report.tally.add(super::Clamps::empty(), Some(halt));
        }
        if guard.stopped().is_some() {
            break;
        }
    }
    Ok(report)
}
