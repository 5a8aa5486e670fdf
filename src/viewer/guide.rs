//! Who leads the hand: the pointer, or one of the scene's motions, which plays, pauses and can be scrubbed.

use super::loaded::Loaded;
use crate::{JointVector, device::Motion};

/// The hand's leader. Time is told to it: it has no clock.
#[derive(Clone, Debug)]
pub struct Guide {
    motions: Vec<(&'static str, Motion)>,
    /// Number of the motion that leads; none: the pointer does.
    playing: Option<usize>,
    /// Whether the motion goes on.
    running: bool,
    /// Since the motion began; below zero while the hand is led to where it begins [s].
    time: f64,
    /// Where the hand is led [rad or m].
    goal: JointVector,
    /// Where the hand was when the motion was chosen [rad or m].
    from: JointVector,
    /// Least and greatest coordinate of each joint [rad or m].
    limits: Vec<[f64; 2]>,
}

/// Time in which the hand is led to the beginning of a motion [s].
pub const LEAD_IN: f64 = 0.8;

impl Guide {
    /// The hand rests at the beginning of the first motion.
    #[must_use]
    pub fn new(loaded: &Loaded) -> Self {
        let limits = loaded.setup.chain.joints.iter().map(|joint| joint.limits).collect();
        let mut guide = Self {
            motions: loaded.motions(),
            playing: None,
            running: false,
            time: 0.0,
            goal: loaded.start(),
            from: loaded.start(),
            limits,
        };
        guide.point(loaded.start());
        guide
    }

    /// Names of the motions.
    #[must_use]
    pub fn names(&self) -> Vec<&'static str> {
        self.motions.iter().map(|(name, _)| *name).collect()
    }

    /// Number of the motion that leads; none where the pointer does.
    #[must_use]
    pub fn playing(&self) -> Option<usize> {
        self.playing
    }

    /// Whether a motion leads and goes on.
    #[must_use]
    pub fn is_running(&self) -> bool {
        self.playing.is_some() && self.running
    }

    /// Time in the motion that leads, and its duration [s].
    #[must_use]
    pub fn time(&self) -> Option<(f64, f64)> {
        self.playing.map(|number| (self.time.max(0.0), self.motions[number].1.duration()))
    }

    /// Where the hand is led [rad or m].
    #[must_use]
    pub fn goal(&self) -> JointVector {
        self.goal
    }

    /// Lets motion `number` lead, from its beginning. A hand that is elsewhere is taken there first, without a blow.
    pub fn play(&mut self, number: usize) {
        if let Some((_, motion)) = self.motions.get(number) {
            let time = if motion.at(0.0).0 == self.goal { 0.0 } else { -LEAD_IN };
            (self.playing, self.running, self.time, self.from) = (Some(number), true, time, self.goal);
        }
    }

    /// Stops the motion where it is, or lets it go on; from its beginning where it has ended.
    pub fn toggle(&mut self) {
        self.running = !self.running;
        if self.running && self.time().is_some_and(|(time, duration)| time >= duration) {
            self.time = 0.0;
        }
    }

    /// Goes to `time` in the motion that leads [s].
    pub fn scrub(&mut self, time: f64) {
        self.time = time;
        self.advance(0.0);
    }

    /// The pointer takes the hand to `goal`, kept within the joints' limits.
    pub fn point(&mut self, mut goal: JointVector) {
        for (goal, [least, greatest]) in goal.iter_mut().zip(&self.limits) {
            *goal = goal.max(*least).min(*greatest);
        }
        (self.playing, self.running, self.goal) = (None, false, goal);
    }

    /// `elapsed` [s] go by; answers with where the hand is led now.
    pub fn advance(&mut self, elapsed: f64) -> JointVector {
        if let Some((_, motion)) = self.playing.and_then(|number| self.motions.get(number)) {
            if self.running {
                self.time += elapsed;
                self.running = self.time < motion.duration();
            }
            self.time = self.time.min(motion.duration());
            self.goal = motion.at(self.time).0;
            if self.time < 0.0 {
                // Minimum jerk, as between the way points of a motion.
                let s = 1.0 + self.time / LEAD_IN;
                let share = s * s * s * (10.0 - 15.0 * s + 6.0 * s * s);
                for (goal, from) in self.goal.iter_mut().zip(self.from.iter()) {
                    *goal = from + share * (*goal - from);
                }
            }
        }
        self.goal
    }
}
