//! What a batch goes through, whoever does it: a device, or what stands for one and returns stored results at once.

use super::{
    context::GpuError,
    layout::{SearchTouch, SolverResult, Touch},
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
#[derive(Clone, Debug)]
pub enum Found {
    /// Forces in f32, which are to be settled.
    Forces(Forces),
    /// Equilibria in f64.
    Solved(Solved),
}

/// Forces in f32.
#[derive(Clone, Debug, Default)]
pub struct Forces {
    /// One for each configuration.
    pub results: Vec<SolverResult>,
    /// Of one after the other.
    pub touches: Vec<Touch>,
}

/// Equilibria in f64: see `shaders/search_results.wgsl`.
#[derive(Clone, Debug, Default)]
pub struct Solved {
    /// One for each configuration.
    pub records: Vec<[u32; 4]>,
    /// As many for each.
    pub amounts: Vec<f64>,
    /// Of one after the other.
    pub touches: Vec<SearchTouch>,
}

impl Found {
    /// Nothing of no configuration.
    #[must_use]
    pub fn nothing() -> Self {
        Self::Solved(Solved::default())
    }

    /// Number of touches of each configuration.
    #[must_use]
    pub fn counts(&self) -> Vec<usize> {
        match self {
            Self::Forces(forces) => forces.results.iter().map(|result| result.touches as usize).collect(),
            Self::Solved(solved) => solved.records.iter().map(|[_, _, touches, _]| *touches as usize).collect(),
        }
    }

    /// What was found of `configurations`, whose touches are in `touches`.
    fn part(&self, configurations: Range<usize>, touches: Range<usize>) -> Self {
        match self {
            Self::Forces(forces) => Self::Forces(Forces {
                results: forces.results[configurations].to_vec(),
                touches: forces.touches[touches].to_vec(),
            }),
            Self::Solved(solved) => {
                let each = solved.amounts.len() / solved.records.len().max(1);
                Self::Solved(Solved {
                    amounts: solved.amounts[each * configurations.start..each * configurations.end].to_vec(),
                    records: solved.records[configurations].to_vec(),
                    touches: solved.touches[touches].to_vec(),
                })
            }
        }
    }

    /// Adds what was found of other configurations, in the same precision.
    fn extend(&mut self, other: Self) {
        match (self, other) {
            (Self::Forces(own), Self::Forces(other)) => {
                own.results.extend(other.results);
                own.touches.extend(other.touches);
            }
            (Self::Solved(own), Self::Solved(other)) => {
                own.records.extend(other.records);
                own.amounts.extend(other.amounts);
                own.touches.extend(other.touches);
            }
            (own, other) => *own = other,
        }
    }
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
    found: Found,
    /// Configurations, those in contact and touches that were returned, of the list as it is gone through now.
    returned: [usize; 3],
}

impl Recorded {
    /// What `stages` find of `configurations`.
    pub(super) fn of<S: Stages>(stages: &mut S, configurations: &[JointVector]) -> Result<Self, GpuError> {
        let (room, precision) = (stages.room(), stages.precision());
        let (gaps, is_touching, found) = (Vec::new(), Vec::new(), Found::nothing());
        let mut recorded = Self { room, precision, gaps, is_touching, found, returned: [0; 3] };
        for section in configurations.chunks(room.section) {
            let ticket = stages.detect(0, section);
            let Detected { gaps, touching } = stages.detected(0, section.len(), &ticket)?;
            let before = recorded.gaps.len();
            recorded.gaps.extend(gaps);
            recorded.is_touching.resize(recorded.gaps.len(), false);
            touching.iter().for_each(|&member| recorded.is_touching[before + member as usize] = true);
            if !touching.is_empty() {
                let ticket = stages.solve(0, touching.len(), room.batch);
                recorded.found.extend(stages.found(0, touching.len(), &ticket)?);
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
        let counts = self.found.counts();
        let configurations = self.next(1, counts.len(), count);
        let touches = counts[configurations.clone()].iter().sum();
        let touches = self.next(2, counts.iter().sum(), touches);
        Ok(self.found.part(configurations, touches))
    }

    fn reopen(&mut self) -> Result<(), GpuError> {
        Ok(())
    }
}
