//! The stages of a batch, whoever does them: a device, or what stands for one and returns stored results at once.

use super::{error::GpuError, precision::Precision};
use crate::JointVector;
use std::ops::Range;

/// Where the proxy is.
#[derive(Clone, Debug, Default)]
pub struct Detected {
    /// Smallest gap of each configuration at rest (m).
    pub gaps: Vec<f64>,
    /// Numbers of those in contact, in the order in which they are solved.
    pub touching: Vec<u32>,
}

impl Detected {
    /// Those with these `gaps`: of those in contact the deepest first, equally deep ones in order.
    pub(super) fn deepest_first(gaps: Vec<f64>) -> Self {
        let mut touching: Vec<u32> = (0..).zip(&gaps).filter_map(|(k, gap)| (*gap < 0.0).then_some(k)).collect();
        touching.sort_by(|&a, &b| gaps[a as usize].total_cmp(&gaps[b as usize]));
        Self { gaps, touching }
    }
}

/// Results of the kernels for the configurations in contact: see `shaders/search_results.wgsl`.
#[derive(Clone, Debug, Default)]
pub struct Found {
    /// One for each configuration.
    pub records: Vec<[u32; 4]>,
    /// As many for each.
    pub amounts: Vec<f64>,
    /// Words of the touches, one configuration after the other.
    pub touches: Vec<[u32; 4]>,
    /// As many for each touch.
    pub presses: Vec<f64>,
}

impl Found {
    /// Number of touches of each configuration.
    #[must_use]
    pub fn counts(&self) -> Vec<usize> {
        self.records.iter().map(|[_, _, touches, _]| *touches as usize).collect()
    }

    /// Returns what was found of `configurations`, whose touches are in `touches`.
    fn part(&self, configurations: Range<usize>, touches: Range<usize>) -> Self {
        let amounts = self.amounts.len() / self.records.len().max(1);
        let presses = self.presses.len() / self.touches.len().max(1);
        Self {
            amounts: self.amounts[amounts * configurations.start..amounts * configurations.end].to_vec(),
            presses: self.presses[presses * touches.start..presses * touches.end].to_vec(),
            records: self.records[configurations].to_vec(),
            touches: self.touches[touches].to_vec(),
        }
    }

    /// The same in ascending order of the configurations' `numbers`.
    fn sorted_by(&self, numbers: &[u32]) -> Self {
        let mut end = 0;
        let mut places: Vec<(u32, Range<usize>, Range<usize>)> = Vec::with_capacity(numbers.len());
        for (place, (&number, count)) in numbers.iter().zip(self.counts()).enumerate() {
            places.push((number, place..place + 1, end..end + count));
            end += count;
        }
        places.sort_by_key(|(number, ..)| *number);
        let mut sorted = Self::default();
        for (_, configuration, touches) in places {
            sorted.extend(self.part(configuration, touches));
        }
        sorted
    }

    /// Adds what was found of other configurations.
    pub(super) fn extend(&mut self, other: Self) {
        self.records.extend(other.records);
        self.amounts.extend(other.amounts);
        self.touches.extend(other.touches);
        self.presses.extend(other.presses);
    }
}

/// How far results can be trusted.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Trust {
    /// Gaps no farther than this from zero are left open (m).
    pub band: f64,
    /// Precision of the stages; equilibria in f32 are settled in f64 on the host.
    pub precision: Precision,
}

/// Bounds on what a device takes at a time.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct StageRoom {
    /// Sections under way at a time.
    pub lanes: usize,
    /// Most configurations of a section.
    pub section: usize,
    /// How many of these in contact are solved together: a section with more of them takes several times as long.
    pub searches: usize,
}

/// The stages of a device. A section of configurations has a lane: it is placed and tested for contact, and then those
/// in contact are solved. Lanes are independent of each other. What is submitted is done in order.
pub trait Stages {
    /// A submission.
    type Ticket;

    /// Returns the bounds on what it takes at a time.
    fn room(&self) -> StageRoom;

    /// Returns how far its results can be trusted.
    fn trust(&self) -> Trust;

    /// Submits where the proxy is at each configuration of a section, and whether it touches.
    fn detect(&mut self, lane: usize, section: &[JointVector]) -> Self::Ticket;

    /// Waits for a submission of [`Stages::detect`] of `count` configurations.
    ///
    /// # Errors
    /// When the device fails.
    fn detected(&mut self, lane: usize, count: usize, ticket: &Self::Ticket) -> Result<Detected, GpuError>;

    /// Submits the solution of the first `count` configurations in contact of what the lane has detected.
    fn solve(&mut self, lane: usize, count: usize) -> Self::Ticket;

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

/// Results of a device for a list of configurations, returned at once: a device that takes no time, beside which
/// what the host does can be measured.
///
/// It knows no configurations: it is to be asked for those of the list, in the same order, as often as one likes. What
/// touches is in that order, too.
#[derive(Clone, Debug)]
pub struct Recorded {
    room: StageRoom,
    trust: Trust,
    gaps: Vec<f64>,
    is_touching: Vec<bool>,
    found: Found,
    /// Configurations, those in contact and touches that were returned, of the list as it is gone through now.
    returned: [usize; 3],
}

impl Recorded {
    /// Records what `stages` find of `configurations`.
    pub(super) fn of<S: Stages>(stages: &mut S, configurations: &[JointVector]) -> Result<Self, GpuError> {
        let (room, trust) = (stages.room(), stages.trust());
        let (gaps, is_touching, found) = (Vec::new(), Vec::new(), Found::default());
        let mut recorded = Self { room, trust, gaps, is_touching, found, returned: [0; 3] };
        for section in configurations.chunks(room.section) {
            let ticket = stages.detect(0, section);
            let Detected { gaps, touching } = stages.detected(0, section.len(), &ticket)?;
            let before = recorded.gaps.len();
            recorded.gaps.extend(gaps);
            recorded.is_touching.resize(recorded.gaps.len(), false);
            touching.iter().for_each(|&member| recorded.is_touching[before + member as usize] = true);
            if !touching.is_empty() {
                let ticket = stages.solve(0, touching.len());
                let found = stages.found(0, touching.len(), &ticket)?;
                recorded.found.extend(found.sorted_by(&touching));
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

    fn trust(&self) -> Trust {
        self.trust
    }

    fn detect(&mut self, _: usize, _: &[JointVector]) {}

    fn detected(&mut self, _: usize, count: usize, (): &()) -> Result<Detected, GpuError> {
        let places = self.next(0, self.gaps.len(), count);
        let is_touching = self.is_touching[places.clone()].iter();
        let touching = (0..).zip(is_touching).filter_map(|(place, is_touching)| is_touching.then_some(place)).collect();
        Ok(Detected { gaps: self.gaps[places].to_vec(), touching })
    }

    fn solve(&mut self, _: usize, _: usize) {}

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
