//! What a batch goes through, whoever does it: a device, or what stands for one and returns stored results at once.

use super::{
    context::GpuError,
    layout::{SolverResult, Touch},
};
use crate::JointVector;
use std::ops::Range;

/// Where the proxy is.
#[derive(Clone, Debug, Default)]
pub struct Detected {
    /// Smallest gap of each configuration at rest [m].
    pub gaps: Vec<f64>,
    /// Numbers of those in contact, ascending.
    pub touching: Vec<u32>,
}

/// What the kernels found of the configurations in contact.
#[derive(Clone, Debug, Default)]
pub struct Found {
    /// One for each.
    pub results: Vec<SolverResult>,
    /// Of one after the other.
    pub touches: Vec<Touch>,
}

/// How far gaps can be trusted.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GapPrecision {
    /// Gaps no farther than this from zero are left open [m].
    pub band: f64,
    /// Whether gaps are those of the contact surface in f64.
    pub exact: bool,
}

/// Bounds on what a device takes at a time.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct StageRoom {
    /// Sections under way at a time.
    pub lanes: usize,
    /// Most configurations of a section.
    pub section: usize,
    /// Most configurations in contact of one dispatch.
    pub batch: usize,
}

/// The stages of a device. A section of configurations has a lane: it is placed and tested for contact, and then those
/// in contact are solved. Lanes are independent of each other. What is submitted is done in order.
pub trait Stages {
    /// A submission.
    type Ticket;

    /// What it takes at a time.
    fn room(&self) -> StageRoom;

    /// How far its gaps can be trusted.
    fn precision(&self) -> GapPrecision;

    /// Submits where the proxy is at each configuration of a section, and whether it touches.
    fn detect(&mut self, lane: usize, section: &[JointVector]) -> Self::Ticket;

    /// Waits for a submission of [`Stages::detect`] of `count` configurations.
    ///
    /// # Errors
    /// When the device fails.
    fn detected(&mut self, lane: usize, count: usize, ticket: &Self::Ticket) -> Result<Detected, GpuError>;

    /// Submits the solution of the first `count` configurations in contact of what the lane has detected, `batch` to a
    /// dispatch.
    fn solve(&mut self, lane: usize, count: usize, batch: usize) -> Self::Ticket;

    /// Waits for a submission of [`Stages::solve`].
    ///
    /// # Errors
    /// When the device fails.
    fn found(&mut self, lane: usize, count: usize, ticket: &Self::Ticket) -> Result<Found, GpuError>;

    /// Begins again after a failure, with half the room.
    ///
    /// # Errors
    /// When that fails, too.
    fn reopen(&mut self) -> Result<(), GpuError>;
}

/// What a device found of a list of configurations, to be returned at once: a device that takes no time, beside which
/// what the host does can be measured.
///
/// It knows no configurations: it is to be asked for those of the list, in the same order, as often as one likes.
#[derive(Clone, Debug)]
pub struct Recorded {
    room: StageRoom,
    precision: GapPrecision,
    gaps: Vec<f64>,
    is_touching: Vec<bool>,
    results: Vec<SolverResult>,
    touches: Vec<Touch>,
    /// Configurations, results and touches that were returned, of the list as it is gone through now.
    returned: [usize; 3],
}

impl Recorded {
    /// What `stages` find of `configurations`.
    pub(super) fn of<S: Stages>(stages: &mut S, configurations: &[JointVector]) -> Result<Self, GpuError> {
        let (room, precision) = (stages.room(), stages.precision());
        let (gaps, is_touching) = (Vec::new(), Vec::new());
        let (results, touches, returned) = (Vec::new(), Vec::new(), [0; 3]);
        let mut recorded = Self { room, precision, gaps, is_touching, results, touches, returned };
        for section in configurations.chunks(room.section) {
            let ticket = stages.detect(0, section);
            let Detected { gaps, touching } = stages.detected(0, section.len(), &ticket)?;
            let before = recorded.gaps.len();
            recorded.gaps.extend(gaps);
            recorded.is_touching.resize(recorded.gaps.len(), false);
            touching.iter().for_each(|&member| recorded.is_touching[before + member as usize] = true);
            if !touching.is_empty() {
                let ticket = stages.solve(0, touching.len(), room.batch);
                let found = stages.found(0, touching.len(), &ticket)?;
                recorded.results.extend(found.results);
                recorded.touches.extend(found.touches);
            }
        }
        Ok(recorded)
    }

    /// Places of the next `count` of one of its lists, of `length`: the first ones again behind the last.
    fn next(&mut self, list: usize, length: usize, count: usize) -> Range<usize> {
        let first = self.returned[list] % length.max(1);
        self.returned[list] = first + count;
        first..first + count
    }
}

impl Stages for Recorded {
    type Ticket = ();

    fn room(&self) -> StageRoom {
        self.room
    }

    fn precision(&self) -> GapPrecision {
        self.precision
    }

    fn detect(&mut self, _: usize, _: &[JointVector]) {}

    fn detected(&mut self, _: usize, count: usize, (): &()) -> Result<Detected, GpuError> {
        let places = self.next(0, self.gaps.len(), count);
        let is_touching = self.is_touching[places.clone()].iter();
        let touching = (0..).zip(is_touching).filter_map(|(place, is_touching)| is_touching.then_some(place)).collect();
        Ok(Detected { gaps: self.gaps[places].to_vec(), touching })
    }

    fn solve(&mut self, _: usize, _: usize, _: usize) {}

    fn found(&mut self, _: usize, count: usize, (): &()) -> Result<Found, GpuError> {
        let places = self.next(1, self.results.len(), count);
        let results = self.results[places].to_vec();
        let touches = results.iter().map(|result| result.touches as usize).sum();
        let places = self.next(2, self.touches.len(), touches);
        Ok(Found { results, touches: self.touches[places].to_vec() })
    }

    fn reopen(&mut self) -> Result<(), GpuError> {
        Ok(())
    }
}
