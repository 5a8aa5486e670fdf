//! Sections of configurations on their way through the stages of some devices, several at a time, and back in order.
//!
//! Every section has a lane of one device. Sections are waited for in the order in which they departed: once one is
//! known to touch, its contacts are submitted, and once these are solved the next section takes its lane. Before the
//! host turns to the results each device has a search ahead of it, if there is any.

use super::{
    error::GpuError,
    stages::{Detected, Found, Stages},
};
use crate::{
    JointVector,
    contact::{CHUNKS_IN_FLIGHT, Equilibrium, Work},
};
use std::{
    collections::VecDeque,
    ops::Range,
    time::{Duration, Instant},
};

/// How long a dispatch should last: long enough to keep the device busy, far below the 2 s after which an operating
/// system takes it for hung.
const DISPATCH_TARGET: Duration = Duration::from_millis(50);

/// A number of configurations that follows measured time.
#[derive(Clone, Copy, Debug)]
pub(super) struct AdaptiveSize {
    pub now: usize,
    most: usize,
}

impl AdaptiveSize {
    /// Begins with `first`, at most `most`.
    pub fn new(first: usize, most: usize) -> Self {
        Self { now: first.min(most), most }
    }

    /// Steers towards [`DISPATCH_TARGET`] for one dispatch, at most by a factor of four, after `done` configurations
    /// took `time`.
    pub fn adapt(&mut self, done: usize, time: Duration) {
        // A dispatch that was cut short by the end of the list says nothing about a full one.
        if done < self.now && time < DISPATCH_TARGET {
            return;
        }
        let wanted = DISPATCH_TARGET.as_secs_f64() / time.as_secs_f64().max(1e-6) * done as f64;
        let limits = (self.now as f64 / 4.0, self.now as f64 * 4.0);
        self.now = (wanted.clamp(limits.0, limits.1) as usize).clamp(1, self.most);
    }

    /// Shrinks to what there is room to search for, if the share that touches stays `touching` of `done`.
    fn fit(&mut self, touching: usize, done: usize, searches: usize) {
        let share = touching as f64 / done.max(1) as f64;
        self.now = self.now.min((FILLED * searches as f64 / share) as usize).max(1);
    }

    /// Half of it, of at most `most`.
    fn halve(&mut self, most: usize) {
        *self = Self { now: (self.now / 2).clamp(1, most.max(1)), most };
    }
}

/// First size of sections: nothing is known of the device yet.
const FIRST_SECTION: usize = 4096;

/// Share of the room for searches that a section is to fill (1): the next one may have a few more that touch.
const FILLED: f64 = 0.9;

/// A device, and how much it is given at a time.
pub(super) struct PacedDevice<S> {
    pub stages: S,
    section: AdaptiveSize,
    /// When it was last known to be done with something.
    done: Instant,
    /// Whether it has failed, and found nothing since.
    has_failed: bool,
}

impl<S: Stages> PacedDevice<S> {
    pub fn new(stages: S) -> Self {
        let section = AdaptiveSize::new(FIRST_SECTION, stages.room().section);
        Self { stages, section, done: Instant::now(), has_failed: false }
    }

    /// Begins again after a failure, with half the room; not twice without a result in between.
    fn recover(&mut self, failure: GpuError) -> Result<(), GpuError> {
        let may_pass = matches!(failure, GpuError::Lost(_) | GpuError::TimedOut(_) | GpuError::OutOfMemory(_));
        if !may_pass || self.has_failed {
            return Err(failure);
        }
        self.has_failed = true;
        self.stages.reopen()?;
        self.section.halve(self.stages.room().section);
        Ok(())
    }

    /// Returns how long the device worked on what was submitted at `since` and is done now, if it works on one thing at
    /// a time.
    fn worked(&mut self, since: Instant) -> Duration {
        let now = Instant::now();
        let begun = since.max(std::mem::replace(&mut self.done, now));
        now - begun
    }
}

/// Time of the host's thread that runs a search, by what it did. Waiting for a device counts as reading.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct HostTime {
    /// Configurations to the device, commands recorded and submitted.
    pub submitting: Duration,
    /// Waiting for the device, and results copied from it.
    pub reading: Duration,
    /// Results settled in f64, on all cores, and their torques and forces found.
    pub settling: Duration,
    /// Equilibria of all configurations put in order.
    pub assembling: Duration,
}

impl HostTime {
    fn of<T>(total: &mut Duration, work: impl FnOnce() -> T) -> T {
        let begin = Instant::now();
        let result = work();
        *total += begin.elapsed();
        result
    }
}

/// Part of a chunk.
#[derive(Clone, Debug)]
struct Section {
    /// Number of the chunk, counted from the first one of the work.
    chunk: usize,
    places: Range<usize>,
}

/// A chunk that was asked for and is not handed back yet.
struct Asked {
    configurations: Vec<JointVector>,
    departed: usize,
    equilibria: Vec<Equilibrium>,
}

/// The chunks of some work that are under way.
pub(super) struct Queue<'w> {
    work: &'w mut dyn Work,
    chunks: VecDeque<Asked>,
    /// Chunks that were handed back.
    handed: usize,
    is_over: bool,
}

impl<'w> Queue<'w> {
    pub fn new(work: &'w mut dyn Work) -> Self {
        Self { work, chunks: VecDeque::new(), handed: 0, is_over: false }
    }

    /// Everything that has no equilibrium yet is to depart again.
    fn rewind(&mut self) {
        self.chunks.iter_mut().for_each(|chunk| chunk.departed = chunk.equilibria.len());
    }

    /// The next section, of at most `most` configurations; `None` where there is none now.
    fn depart(&mut self, most: usize) -> Option<Section> {
        let waiting = |chunk: &Asked| chunk.departed < chunk.configurations.len();
        loop {
            self.hand_back();
            if self.chunks.iter().any(waiting) || self.is_over || self.chunks.len() >= CHUNKS_IN_FLIGHT {
                break;
            }
            match self.work.next() {
                None => self.is_over = true,
                Some(configurations) => {
                    let equilibria = Vec::with_capacity(configurations.len());
                    self.chunks.push_back(Asked { configurations, departed: 0, equilibria });
                }
            }
        }
        let place = self.chunks.iter().position(waiting)?;
        let chunk = &mut self.chunks[place];
        let first = chunk.departed;
        chunk.departed = chunk.configurations.len().min(first + most.max(1));
        Some(Section { chunk: self.handed + place, places: first..chunk.departed })
    }

    fn configurations(&self, section: &Section) -> &[JointVector] {
        &self.chunks[section.chunk - self.handed].configurations[section.places.clone()]
    }

    /// Returns where the equilibria of `section`, the earliest that has none, are to be added.
    fn equilibria(&mut self, section: &Section) -> (&[JointVector], &mut Vec<Equilibrium>) {
        let chunk = &mut self.chunks[section.chunk - self.handed];
        (&chunk.configurations[section.places.clone()], &mut chunk.equilibria)
    }

    /// Hands back the chunks that are whole.
    fn hand_back(&mut self) {
        while let Some(chunk) = self.chunks.pop_front_if(|chunk| chunk.equilibria.len() == chunk.configurations.len()) {
            self.handed += 1;
            self.work.take(chunk.equilibria);
        }
    }
}

/// A section on its way.
struct Flight<T> {
    device: usize,
    lane: usize,
    section: Section,
    /// The submission that it waits for: nothing, where nothing touches.
    ticket: Option<T>,
    since: Instant,
    /// Where its proxy is, once that is known.
    detected: Option<Detected>,
}

/// A section with its results.
pub(super) struct Landed<'q> {
    pub configurations: &'q [JointVector],
    pub detected: Detected,
    pub found: Found,
}

/// All devices, and the sections that they work on.
struct Fleet<'f, S: Stages> {
    devices: &'f mut [PacedDevice<S>],
    idle: VecDeque<(usize, usize)>,
    flights: VecDeque<Flight<S::Ticket>>,
    time: &'f mut HostTime,
}

/// A failure, and the number of the device that failed.
type Failed = (usize, GpuError);

/// Takes all of `queue` through `devices`. `conclude` adds the equilibria of a section that one of them has solved to a
/// list. A device that is lost, hangs or runs out of memory is opened again; where that does not help the others go on
/// without it.
///
/// # Errors
/// When the last device fails.
pub(super) fn fly<S: Stages>(
    devices: &mut Vec<PacedDevice<S>>,
    queue: &mut Queue<'_>,
    time: &mut HostTime,
    mut conclude: impl FnMut(&S, Landed<'_>, &mut HostTime, &mut Vec<Equilibrium>) -> Result<(), GpuError>,
) -> Result<(), GpuError> {
    while let Err((device, failure)) = fly_together(devices, queue, time, &mut conclude) {
        queue.rewind();
        let Err(error) = devices[device].recover(failure) else { continue };
        if devices.len() == 1 {
            return Err(error);
        }
        devices.remove(device);
        let (place, left) = (device + 1, devices.len());
        queue.work.note(format!("solved without graphics device {place} of {}, which failed: {error}", left + 1));
    }
    Ok(())
}

/// The same until one of them fails.
fn fly_together<S: Stages>(
    devices: &mut [PacedDevice<S>],
    queue: &mut Queue<'_>,
    time: &mut HostTime,
    conclude: &mut impl FnMut(&S, Landed<'_>, &mut HostTime, &mut Vec<Equilibrium>) -> Result<(), GpuError>,
) -> Result<(), Failed> {
    // One lane of every device, then the next.
    let lanes = devices.iter().map(|device| device.stages.room().lanes).max().unwrap_or(0);
    let all = (0..lanes).flat_map(|lane| (0..devices.len()).map(move |device| (device, lane)));
    let idle = all.filter(|&(device, lane)| lane < devices[device].stages.room().lanes).collect();
    let mut fleet = Fleet { devices, idle, flights: VecDeque::new(), time };
    loop {
        fleet.depart(queue);
        let Some(flight) = fleet.flights.pop_front() else { break };
        let Some(detected) = flight.detected else {
            fleet.search(flight, queue)?;
            continue;
        };
        let Flight { device, lane, section, ticket, .. } = flight;
        let found = fleet.found(device, lane, detected.touching.len(), ticket).map_err(|e| (device, e))?;
        fleet.idle.push_back((device, lane));
        fleet.depart(queue);
        fleet.keep_busy(queue)?;
        let (configurations, equilibria) = queue.equilibria(&section);
        let landed = Landed { configurations, detected, found };
        conclude(&fleet.devices[device].stages, landed, fleet.time, equilibria).map_err(|e| (device, e))?;
    }
    Ok(())
}

impl<S: Stages> Fleet<'_, S> {
    /// Fills idle lanes.
    fn depart(&mut self, queue: &mut Queue<'_>) {
        while let Some(&(device, lane)) = self.idle.front() {
            let paced = &mut self.devices[device];
            let Some(section) = queue.depart(paced.section.now) else { return };
            self.idle.pop_front();
            let configurations = queue.configurations(&section);
            let ticket = HostTime::of(&mut self.time.submitting, || paced.stages.detect(lane, configurations));
            let (ticket, since) = (Some(ticket), Instant::now());
            self.flights.push_back(Flight { device, lane, section, ticket, since, detected: None });
        }
    }

    /// Waits for where the proxy is in the section that departed, and has its contacts solved.
    fn search(&mut self, flight: Flight<S::Ticket>, queue: &Queue<'_>) -> Result<(), Failed> {
        let Flight { device, lane, section, ticket, since, .. } = flight;
        let paced = &mut self.devices[device];
        let count = queue.configurations(&section).len();
        let detected = match ticket {
            None => Detected::default(),
            Some(ticket) => {
                let read = || paced.stages.detected(lane, count, &ticket);
                HostTime::of(&mut self.time.reading, read).map_err(|error| (device, error))?
            }
        };
        let time = paced.worked(since);
        paced.section.adapt(count, time);
        paced.section.fit(detected.touching.len(), count, paced.stages.room().searches);
        let ticket = match detected.touching.len() {
            0 => None,
            count => Some(HostTime::of(&mut self.time.submitting, || paced.stages.solve(lane, count))),
        };
        let (detected, since) = (Some(detected), Instant::now());
        self.flights.push_back(Flight { device, lane, section, ticket, since, detected });
        Ok(())
    }

    fn found(
        &mut self,
        device: usize,
        lane: usize,
        count: usize,
        ticket: Option<S::Ticket>,
    ) -> Result<Found, GpuError> {
        let Some(ticket) = ticket else { return Ok(Found::default()) };
        let paced = &mut self.devices[device];
        let found = HostTime::of(&mut self.time.reading, || paced.stages.found(lane, count, &ticket))?;
        (paced.done, paced.has_failed) = (Instant::now(), false);
        Ok(found)
    }

    /// Lets searches begin until every device whose sections are on their way has one ahead of it.
    fn keep_busy(&mut self, queue: &Queue<'_>) -> Result<(), Failed> {
        while let Some(front) = self.flights.front() {
            let searches = |flight: &Flight<S::Ticket>| flight.device == front.device && flight.detected.is_some();
            if front.detected.is_some() || self.flights.iter().any(searches) {
                break;
            }
            if let Some(front) = self.flights.pop_front() {
                self.search(front, queue)?;
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        contact::{Backend, Model},
        gpu::{
            GpuSolver,
            precision::Precision,
            stages::{StageRoom, Trust},
        },
        object::Object,
        proxy::Chain,
        scene::Scene,
    };

    /// A device that finds the first coordinate of each configuration, in contact where it is odd. It is lost when it
    /// is asked for what it found so often: once, or for good.
    struct Odd {
        lanes: Vec<Vec<f64>>,
        room: StageRoom,
        until_lost: usize,
        is_mended: bool,
        opened: usize,
    }

    impl Odd {
        fn new(lanes: usize, section: usize, until_lost: usize, is_mended: bool) -> PacedDevice<Self> {
            let room = StageRoom { lanes, section, searches: section };
            PacedDevice::new(Self { lanes: vec![Vec::new(); lanes], room, until_lost, is_mended, opened: 1 })
        }

        fn sound(lanes: usize, section: usize) -> PacedDevice<Self> {
            Self::new(lanes, section, usize::MAX, true)
        }
    }

    impl Stages for Odd {
        type Ticket = usize;

        fn room(&self) -> StageRoom {
            self.room
        }

        fn trust(&self) -> Trust {
            Trust { band: 0.0, precision: Precision::Double }
        }

        fn detect(&mut self, lane: usize, section: &[JointVector]) -> usize {
            assert!(section.len() <= self.room.section);
            self.lanes[lane] = section.iter().map(|q| q[0]).collect();
            self.lanes[lane].len()
        }

        fn detected(&mut self, lane: usize, count: usize, ticket: &usize) -> Result<Detected, GpuError> {
            let gaps = self.lanes[lane].clone();
            assert_eq!((gaps.len(), count), (*ticket, count), "another section has the lane");
            let touching = (0..).zip(&gaps).filter(|(_, gap)| **gap % 2.0 != 0.0).map(|(place, _)| place).collect();
            Ok(Detected { gaps, touching })
        }

        fn solve(&mut self, lane: usize, _: usize) -> usize {
            self.lanes[lane].len()
        }

        fn found(&mut self, _: usize, _: usize, _: &usize) -> Result<Found, GpuError> {
            match self.until_lost.checked_sub(1) {
                None if self.opened == 1 || !self.is_mended => Err(GpuError::Lost("on purpose".into())),
                None => Ok(Found::default()),
                Some(left) => {
                    self.until_lost = left;
                    Ok(Found::default())
                }
            }
        }

        fn reopen(&mut self) -> Result<(), GpuError> {
            self.opened += 1;
            Ok(())
        }
    }

    /// Chunks of these sizes, whose configurations are numbered; sizes and numbers that came back.
    struct Numbers {
        sizes: VecDeque<usize>,
        given: usize,
        under_way: usize,
        most_under_way: usize,
        taken: Vec<Vec<f64>>,
        notices: Vec<String>,
    }

    impl Work for Numbers {
        fn next(&mut self) -> Option<Vec<JointVector>> {
            let size = self.sizes.pop_front()?;
            let chunk = (self.given..self.given + size).map(|number| JointVector::from_slice(&[number as f64]));
            self.given += size;
            self.under_way += 1;
            self.most_under_way = self.most_under_way.max(self.under_way);
            Some(chunk.collect())
        }

        fn rewind(&mut self) {}

        fn take(&mut self, equilibria: Vec<Equilibrium>) {
            self.under_way -= 1;
            self.taken.push(equilibria.iter().map(|equilibrium| equilibrium.gap).collect());
        }

        fn note(&mut self, notice: String) {
            self.notices.push(notice);
        }
    }

    const SIZES: [usize; 9] = [5, 0, 0, 0, 0, 0, 17, 1, 8];

    /// Returns what comes back of chunks of [`SIZES`], and whether the last device failed.
    fn flown(devices: &mut Vec<PacedDevice<Odd>>) -> (Numbers, Result<(), GpuError>) {
        let (sizes, taken, notices) = (SIZES.into(), Vec::new(), Vec::new());
        let mut work = Numbers { sizes, given: 0, under_way: 0, most_under_way: 0, taken, notices };
        let conclude = |_: &Odd, landed: Landed<'_>, _: &mut HostTime, equilibria: &mut Vec<Equilibrium>| {
            let gaps = landed.detected.gaps;
            assert!(gaps.iter().zip(landed.configurations).all(|(gap, q)| *gap == q[0]));
            equilibria.extend(gaps.into_iter().map(|gap| Equilibrium::free(gap, 1)));
            Ok(())
        };
        let result = fly(devices, &mut Queue::new(&mut work), &mut HostTime::default(), conclude);
        (work, result)
    }

    fn expected() -> Vec<Vec<f64>> {
        let mut numbers = (0..).map(f64::from);
        SIZES.iter().map(|&size| numbers.by_ref().take(size).collect()).collect()
    }

    #[test]
    fn chunks_come_back_whole_and_in_order_however_many_are_under_way() {
        for (lanes, section) in [(1, 1), (1, 100), (2, 3), (3, 4), (8, 2)] {
            let (one, result) = flown(&mut vec![Odd::sound(lanes, section)]);
            assert!(result.is_ok());
            assert_eq!(one.taken, expected(), "{lanes} lanes of {section}");
            assert!(one.most_under_way <= CHUNKS_IN_FLIGHT, "{}", one.most_under_way);
            let (both, _) = flown(&mut vec![Odd::sound(lanes, section), Odd::sound(1, 2)]);
            assert_eq!(both.taken, expected(), "two devices");
        }
    }

    #[test]
    fn what_was_under_way_on_a_device_that_is_lost_departs_again() {
        for lost_after in [0, 1, 4] {
            let mut devices = vec![Odd::new(3, 4, lost_after, true), Odd::sound(2, 4)];
            let (work, result) = flown(&mut devices);
            assert!(result.is_ok() && work.notices.is_empty());
            assert_eq!(work.taken, expected(), "lost after {lost_after}");
            assert_eq!(devices[0].stages.opened, 2);
        }
    }

    #[test]
    fn the_others_go_on_without_a_device_that_is_lost_for_good() {
        for lost_after in [0, 1] {
            let mut devices = vec![Odd::sound(2, 4), Odd::new(3, 4, lost_after, false)];
            let (work, result) = flown(&mut devices);
            assert!(result.is_ok() && devices.len() == 1);
            assert_eq!(work.taken, expected(), "lost after {lost_after}");
            let [notice] = &work.notices[..] else { panic!("{:?}", work.notices) };
            assert!(notice.contains("device 2 of 2") && notice.contains("on purpose"), "{notice}");
        }
        let (work, result) = flown(&mut vec![Odd::new(1, 4, 0, false)]);
        assert!(matches!(result, Err(GpuError::Lost(_))) && work.notices.is_empty());
    }

    #[test]
    fn what_was_told_before_the_last_device_failed_is_told() {
        let scene = Scene::parse(include_str!("../../tests/scenes/small.toml"), "small.toml").unwrap();
        let (object, chain) = (Object::build(&scene.object).unwrap(), Chain::new(&scene.proxy));
        let model = Model::new(&object, &chain, scene.contact);
        let devices = [0, 0].map(|lost_after| Odd::new(1, 4, lost_after, false).stages);
        let mut solver = GpuSolver::of(devices.into(), &model);
        let solved = solver.solve(&[JointVector::from_slice(&[1.0, 0.0])]);
        assert!(matches!(solved, Err(GpuError::Lost(_))));
        let [notice] = &solver.notices()[..] else { panic!("one device of two was lost before") };
        assert!(notice.contains("device 1 of 2"), "{notice}");
    }

    #[test]
    fn sizes_follow_the_time_of_a_dispatch() {
        let mut size = AdaptiveSize::new(64, 10_000);
        size.adapt(64, DISPATCH_TARGET / 100);
        assert_eq!(size.now, 256, "no more than four times");
        size.adapt(256, DISPATCH_TARGET * 100);
        assert_eq!(size.now, 64, "no less than a quarter");
        size.adapt(10, DISPATCH_TARGET / 100);
        assert_eq!(size.now, 64, "cut short");
        // As much as three dispatches should take.
        size.adapt(96, DISPATCH_TARGET * 3);
        assert_eq!(size.now, 32);
    }

    #[test]
    fn sizes_follow_the_share_that_touches() {
        let mut size = AdaptiveSize::new(1000, 10_000);
        size.fit(50, 100, 400);
        assert_eq!(size.now, 720, "half of them touch: 360 of 400 that there is room for");
        size.fit(0, 100, 400);
        assert_eq!(size.now, 720, "nothing touches");
        size.fit(100, 100, 1);
        assert_eq!(size.now, 1, "at least one");
    }
}
