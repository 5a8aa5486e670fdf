//! Contact that is solved while it is felt: the loop's end of `sweep/ahead`.
//!
//! The loop publishes where the proxy is and goes, and feels what is there: the equilibrium solved at the proxy and its
//! tangent, if the scene asks for that (`direct`) and it comes in time; else the store, with the finest level that is
//! there. What others publish meanwhile changes nothing within a tick: the store is read up to one
//! [horizon](crate::store::Store::horizon). From tick to tick the torque passes over without a jump and without energy
//! from nowhere (`passage.rs`).
//!
//! A store keeps no contact forces. Effects at contacts have those of the equilibrium solved at the proxy.
//!
//! Nothing here allocates, locks or waits: places and solutions go through triple buffers, of which each end has a
//! value of its own.

use super::{accounts::Accounts, passage::Passage};
use crate::{
    JointVector, MAX_JOINTS,
    contact::{NodeForce, Status},
    field::{Flags, Sample, TorqueField},
    store::{Store, space::MAX_LEVELS},
    sweep::ahead::{Solution, Whereabouts},
};
use serde::Serialize;

/// Ticks after which a solution is late (1). More: the tangent is followed farther. Fewer: the store answers where the
/// thread that solves was held up.
const LATE: u64 = 8;

/// Farthest way of a node of the proxy, by a bound, on which a tangent is followed (m): the second order errs by some
/// percent of the force where the way is a tenth of the length over which a dent is rounded.
const FARTHEST: f64 = 0.003;

/// Contact that is solved while it is felt.
pub struct Live {
    /// Levels that are wanted.
    wanted: u32,
    /// Greatest lever of each joint (m/rad or 1).
    levers: JointVector,
    whereabouts: Vec<triple_buffer::Input<Whereabouts>>,
    /// Absent unless the scene asks for them.
    solutions: Option<triple_buffer::Output<Solution>>,
    followed: Followed,
    tick: u64,
    last: Option<Felt>,
    passage: Passage,
    answers: Answers,
    published: triple_buffer::Input<Answers>,
}

/// What the loop takes of the equilibrium at the proxy, as the scene asks.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Followed {
    /// Torque and tangent, which are felt in the place of the store's.
    pub torque: bool,
    /// Forces on the proxy's nodes, for effects at contacts.
    pub forces: bool,
}

impl Followed {
    /// Whether it is solved at all.
    #[must_use]
    pub fn is_solved(self) -> bool {
        self.torque || self.forces
    }
}

/// The other ends of a [`Live`].
pub struct LiveEnds {
    /// Where the proxy is, one end for each thread that solves; the last one is that of `solutions`, if there is one.
    pub whereabouts: Vec<triple_buffer::Output<Whereabouts>>,
    /// Equilibria at the proxy.
    pub solutions: Option<triple_buffer::Input<Solution>>,
    /// The sources that answered the ticks so far.
    pub answers: triple_buffer::Output<Answers>,
}

/// Count of answers by source.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Answers {
    /// Ticks.
    pub ticks: u64,
    /// Those that followed a solution at the proxy.
    pub direct: u64,
    /// Those that the store answered by so many levels, from none on.
    pub by_levels: [u64; MAX_LEVELS as usize + 1],
    /// Those that the store answered by fewer levels than wanted.
    pub coarser: u64,
    /// Ticks among them in contact.
    pub coarser_in_contact: u64,
    /// Ticks at which the function had changed where the proxy was.
    pub changes: u64,
    /// Greatest change of the torque that was passed over, by joint (N m or N).
    pub greatest_change: [f64; MAX_JOINTS],
    /// Energy given by passing over, and taken (J).
    pub given: f64,
    /// (J)
    pub taken: f64,
}

/// Last answer, before any passage.
struct Felt {
    place: JointVector,
    torque: JointVector,
    energy: f64,
    /// Tells functions apart.
    source: (bool, u64),
}

/// The function that answers a tick.
enum Source<'a> {
    Store { field: &'a TorqueField, horizon: u64 },
    Solution(&'a Solution),
}

impl Source<'_> {
    fn id(&self) -> (bool, u64) {
        match self {
            Self::Store { horizon, .. } => (false, *horizon),
            Self::Solution(solution) => (true, solution.number),
        }
    }

    /// The field at `q`, and the levels of the store that were there.
    fn at(&self, q: &JointVector) -> (Sample, u32) {
        match self {
            Self::Store { field, horizon } => field.sample_within(q, *horizon),
            Self::Solution(solution) => {
                let (torque, energy) = solution.at(q);
                let contact = energy > 0.0;
                let sample = Sample {
                    torque,
                    index: f64::from(u8::from(contact)),
                    contact,
                    contact_nodes: if contact { solution.contact_nodes } else { 0 },
                    energy,
                    share: 1.0,
                    flags: Flags::empty(),
                };
                (sample, 0)
            }
        }
    }
}

impl Live {
    /// For a proxy that starts at `start`, with so many `levels` wanted and the greatest lever of each joint; `threads`
    /// fill the store, and another one solves the equilibrium at the proxy, if anything of it is `followed`.
    #[must_use]
    pub fn new(
        start: &JointVector,
        levels: u32,
        levers: &JointVector,
        threads: usize,
        followed: Followed,
    ) -> (Self, LiveEnds) {
        let (joints, is_solved) = (start.len(), followed.is_solved());
        let ends = || triple_buffer::triple_buffer(&Whereabouts::at_rest(start));
        let (inputs, outputs) = (0..threads + usize::from(is_solved)).map(|_| ends()).unzip();
        let (written, read) = triple_buffer::triple_buffer(&Solution::none(joints));
        let (published, answers) = triple_buffer::triple_buffer(&Answers::default());
        let live = Self {
            wanted: levels,
            levers: *levers,
            whereabouts: inputs,
            solutions: is_solved.then_some(read),
            followed,
            tick: 0,
            last: None,
            passage: Passage::new(joints),
            answers: Answers::default(),
            published,
        };
        (live, LiveEnds { whereabouts: outputs, solutions: is_solved.then_some(written), answers })
    }

    /// Whether it gives contact forces.
    #[must_use]
    pub fn solves_forces(&self) -> bool {
        self.followed.forces
    }

    /// Forces on the proxy's nodes in the tick whose contact was sampled last, at `x`; none where no solution is good
    /// (N).
    pub(super) fn forces(&self, x: &JointVector) -> &[NodeForce] {
        let solution = self.solutions.as_ref().map(triple_buffer::Output::peek_output_buffer);
        match solution.filter(|solution| serves(solution, x, self.tick, &self.levers)) {
            Some(solution) => &solution.on_proxy,
            None => &[],
        }
    }

    /// The contact field at `x` in a tick of `period` (s).
    pub(super) fn sample(&mut self, field: &TorqueField, x: &JointVector, accounts: &Accounts, period: f64) -> Sample {
        let Self { wanted, levers, solutions, followed, tick, last, passage, answers, .. } = self;
        let horizon = field.store().map_or(0, Store::horizon);
        let solution = solutions.as_mut().map(|solutions| solutions.read());
        let source = match solution.filter(|solution| followed.torque && serves(solution, x, *tick, levers)) {
            Some(solution) => Source::Solution(solution),
            None => Source::Store { field, horizon },
        };
        let (mut sample, levels) = source.at(x);
        if let Some(last) = last {
            if last.source != source.id() {
                let (now, _) = source.at(&last.place);
                answers.changes += u64::from(last.torque != now.torque);
                let changes = last.torque.iter().zip(now.torque.iter()).map(|(a, b)| (a - b).abs());
                answers.greatest_change.iter_mut().zip(changes).for_each(|(most, change)| *most = most.max(change));
                passage.take((&last.torque, last.energy), (&now.torque, now.energy));
            }
            passage.go(&last.place, x);
        }
        *last = Some(Felt { place: *x, torque: sample.torque, energy: sample.energy, source: source.id() });
        let budget = accounts.first_stored.map_or(0.0, |first| {
            accounts.taken_from_field() - (accounts.field_work + sample.energy + passage.energy() - first)
        });
        let given = passage.fade(period, budget);
        answers.given += given.max(0.0);
        answers.taken += (-given).max(0.0);
        answers.ticks += 1;
        match source {
            Source::Solution(_) => answers.direct += 1,
            Source::Store { .. } => {
                answers.by_levels[levels as usize] += 1;
                answers.coarser += u64::from(levels < *wanted);
                answers.coarser_in_contact += u64::from(levels < *wanted && sample.contact);
            }
        }
        sample.torque.iter_mut().zip(passage.torque().iter()).for_each(|(torque, rest)| *torque += rest);
        sample.energy += passage.energy();
        sample
    }

    /// Tells where the proxy is at the next tick, and how fast it goes.
    pub(super) fn tell(&mut self, position: &JointVector, velocity: &JointVector) {
        self.tick += 1;
        let whereabouts = Whereabouts { position: *position, velocity: *velocity, tick: self.tick };
        self.whereabouts.iter_mut().for_each(|end| end.write(whereabouts));
        self.published.write(self.answers);
    }
}

/// Whether `solution` is still good at `x` in tick `tick`.
fn serves(solution: &Solution, x: &JointVector, tick: u64, levers: &JointVector) -> bool {
    let ways =
        x.iter().zip(solution.place.iter()).zip(levers.iter()).map(|((x, place), lever)| (x - place).abs() * lever);
    solution.number > 0
        && matches!(solution.status, Status::Free | Status::Contact)
        && tick <= solution.tick + LATE
        && ways.sum::<f64>() <= FARTHEST
}
