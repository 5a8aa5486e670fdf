//! Who leads the hand: the pointer, keys, or one of the scene's motions, which plays, pauses and can be scrubbed.

use super::loaded::Loaded;
use crate::{JointVector, device::Motion, scene::Waypoint};
use eframe::egui;

/// The target that the simulated hand follows. The caller passes the time; this type reads no clock.
#[derive(Clone)]
pub struct Guide {
    motions: Vec<(&'static str, Motion)>,
    /// Number of the motion that leads; none: the pointer does.
    playing: Option<usize>,
    /// Whether the motion goes on.
    running: bool,
    /// Since the motion began (s).
    time: f64,
    /// Where the hand is led (rad or m).
    goal: JointVector,
    /// Least and greatest coordinate of each joint (rad or m).
    limits: Vec<[f64; 2]>,
    /// Whether a haptic device leads, and nobody here does.
    handed_over: bool,
    /// Where the hand is at first (rad or m).
    home: JointVector,
    /// The way there, or to where the motion begins, and the time in it (s), while the hand takes it.
    approach: Option<(Motion, f64)>,
    /// Keys that are held; none while the window has not the keyboard.
    keys: Option<Keys>,
    /// Since the window last said so (s).
    silence: f64,
    /// The window that shows the hand, which rests while nothing moves; none where there is no window.
    window: Option<egui::Context>,
    /// Since it was last asked to draw (s).
    unasked: f64,
}

/// Keys that are held.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Keys {
    /// How fast each of the first joints is to move, from -1 to 1, as a share of the speed of keys: there are keys for so
    /// many.
    pub speeds: [f64; 6],
    /// Whether the hand is to go back to where it was at first.
    pub home: bool,
}

/// Time in which the hand is led to where a motion begins, or home (s).
const LEAD_IN: f64 = 0.8;

/// How far a key moves a joint in a second, as a share of its range (1/s): all of it in four
/// seconds, slowly enough to press with care.
const SPEED: f64 = 0.25;

/// Longest time that a joint is moved for at once (s): who stood still meanwhile must not throw the arm.
const LONGEST: f64 = 0.1;

/// Longest time that a window says nothing and still has the keyboard (s): one that is hidden or hangs must not hold a
/// key down, while a slow rasteriser's draws a frame in a fifth of that.
const LONGEST_SILENCE: f64 = 1.0;

/// Least time between two frames that a moving hand asks for (s).
const BETWEEN_FRAMES: f64 = 1.0 / 60.0;

impl Guide {
    /// The hand rests at the beginning of the first motion.
    #[must_use]
    pub fn new(loaded: &Loaded) -> Self {
        let limits = loaded.setup.chain.joints.iter().map(|joint| joint.limits).collect();
        let mut guide = Self { motions: loaded.motions(), ..Self::at(loaded.start(), limits) };
        guide.point(loaded.start());
        guide
    }

    /// The hand rests at `home`, its joints within `limits`, and there are no motions.
    fn at(home: JointVector, limits: Vec<[f64; 2]>) -> Self {
        Self {
            motions: Vec::new(),
            playing: None,
            running: false,
            time: 0.0,
            goal: home,
            limits,
            handed_over: false,
            home,
            approach: None,
            keys: None,
            silence: 0.0,
            window: None,
            unasked: 0.0,
        }
    }

    /// Leaves the lead to a haptic device: there are no motions then, and nothing for a pointer to take.
    pub fn hand_over(&mut self) {
        (self.handed_over, self.playing) = (true, None);
        self.motions.clear();
    }

    /// Whether a haptic device leads.
    #[must_use]
    pub fn is_handed_over(&self) -> bool {
        self.handed_over
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

    /// Time in the motion that leads, and its duration (s).
    #[must_use]
    pub fn time(&self) -> Option<(f64, f64)> {
        self.playing.map(|number| (self.time, self.motions[number].1.duration()))
    }

    /// Returns where the hand is led (rad or m).
    #[must_use]
    pub fn goal(&self) -> JointVector {
        self.goal
    }

    /// Lets motion `number` lead, from its beginning. A hand that is elsewhere is taken there first, without a blow.
    pub fn play(&mut self, number: usize) {
        if let Some((_, motion)) = self.motions.get(number) {
            let begin = motion.at(0.0).0;
            (self.playing, self.running, self.time) = (Some(number), true, 0.0);
            self.take_to(begin);
        }
    }

    /// Lets motion `number` lead, from its beginning, where the hand is put.
    pub fn begin(&mut self, number: usize) {
        if let Some((_, motion)) = self.motions.get(number) {
            self.goal = motion.at(0.0).0;
        }
        self.play(number);
    }

    /// Takes the hand straight to `end`.
    fn take_to(&mut self, end: JointVector) {
        let ends = [Waypoint { time: 0.0, q: self.goal }, Waypoint { time: LEAD_IN, q: end }];
        let way = Motion::through(&ends, end.len()).ok().filter(|_| self.goal != end);
        self.approach = way.map(|way| (way, 0.0));
    }

    /// Stops the motion where it is, or lets it go on.
    pub fn toggle(&mut self) {
        self.running = !self.running;
    }

    /// Goes to `time` in the motion that leads (s).
    pub fn scrub(&mut self, time: f64) {
        (self.time, self.approach) = (time, None);
        self.advance(0.0);
    }

    /// The pointer takes the hand to `goal`, kept within the joints' limits.
    pub fn point(&mut self, mut goal: JointVector) {
        for (goal, [least, greatest]) in goal.iter_mut().zip(&self.limits) {
            *goal = goal.max(*least).min(*greatest);
        }
        (self.playing, self.running, self.goal, self.approach) = (None, false, goal, None);
    }

    /// Sets the keys that are held, until the next call; none: the window has not the keyboard.
    pub fn hear(&mut self, keys: Option<Keys>) {
        (self.keys, self.silence) = (keys, 0.0);
    }

    /// Takes note of the window that shows the hand, which is asked to draw when the hand moves.
    pub fn shown_in(&mut self, window: &egui::Context) {
        self.window.get_or_insert_with(|| window.clone());
    }

    /// The hand moves the first joints at `speeds`, from -1 to 1 each, for `elapsed` (s); nobody takes the lead where
    /// all are 0.
    fn steer(&mut self, speeds: &[f64], elapsed: f64) {
        if speeds.iter().all(|speed| *speed == 0.0) {
            return;
        }
        let mut goal = self.goal;
        for ((goal, speed), [least, greatest]) in goal.iter_mut().zip(speeds).zip(&self.limits) {
            *goal += speed * SPEED * (greatest - least) * elapsed.min(LONGEST);
        }
        self.point(goal);
    }

    /// The hand goes back to where it was at first, without a blow.
    fn go_home(&mut self) {
        self.point(self.goal);
        self.take_to(self.home);
    }

    /// Moves the hand by the keys that are held and the motion that plays, over `elapsed` (s). Returns where it is led
    /// now.
    pub fn follow(&mut self, elapsed: f64) -> JointVector {
        let before = self.goal;
        self.silence += elapsed;
        self.unasked += elapsed;
        if let Some(keys) = self.keys.filter(|_| self.silence < LONGEST_SILENCE) {
            if keys.home && (self.playing.is_some() || self.approach.is_none()) && self.goal != self.home {
                self.go_home();
            }
            self.steer(&keys.speeds, elapsed);
        }
        let goal = self.advance(elapsed);
        if goal != before && self.unasked >= BETWEEN_FRAMES {
            self.unasked = 0.0;
            self.window.iter().for_each(egui::Context::request_repaint);
        }
        goal
    }

    /// `elapsed` (s) go by; answers with where the hand is led now.
    fn advance(&mut self, elapsed: f64) -> JointVector {
        let elapsed = if self.playing.is_none() || self.running { elapsed } else { 0.0 };
        if let Some((way, time)) = &mut self.approach {
            *time += elapsed;
            self.goal = way.at(*time).0;
            if *time >= way.duration() {
                self.approach = None;
            }
        } else if let Some((_, motion)) = self.playing.and_then(|number| self.motions.get(number)) {
            let duration = motion.duration();
            self.time = (self.time + elapsed).min(duration);
            self.goal = motion.at(self.time).0;
            if self.running && self.time >= duration {
                // From the beginning again; where that is elsewhere, the hand is led there first.
                let begin = motion.at(0.0).0;
                self.time = 0.0;
                self.take_to(begin);
            }
        }
        self.goal
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A hand at rest in the middle of two joints, of whose limits the second's are closer; the window has the keyboard
    /// and says so.
    fn guide() -> Guide {
        let [start, home] = [[0.0, 0.0], [0.5, 0.1]].map(|q| JointVector::from_slice(&q));
        let (keys, silence) = (Some(Keys::default()), f64::NEG_INFINITY);
        Guide { home, keys, silence, ..Guide::at(start, vec![[-1.0, 1.0], [-0.2, 0.2]]) }
    }

    fn keys(first: [f64; 2]) -> Option<Keys> {
        Some(Keys { speeds: std::array::from_fn(|joint| first.get(joint).copied().unwrap_or_default()), home: false })
    }

    #[test]
    fn keys_move_joints_by_time_and_range_up_to_their_limits_and_no_further_once_they_are_let_go() {
        let mut guide = guide();
        guide.keys = keys([1.0, -0.5]);
        for _ in 0..500 {
            guide.follow(2e-3);
        }
        let expected = [SPEED * 2.0, -0.5 * SPEED * 0.4];
        assert!(guide.goal().iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-12), "{:?}", guide.goal());
        let held = guide.goal();
        guide.keys = keys([0.0, 0.0]);
        for _ in 0..500 {
            assert_eq!(guide.follow(2e-3), held, "it moves without a key");
        }
        guide.keys = keys([1.0, -1.0]);
        for _ in 0..5000 {
            guide.follow(2e-3);
        }
        assert_eq!(&guide.goal()[..], [1.0, -0.2]);
        // A thread that stood still does not throw the arm.
        guide.keys = keys([-1.0, 0.0]);
        guide.follow(1e6);
        assert!((guide.goal()[0] - (1.0 - SPEED * 2.0 * LONGEST)).abs() < 1e-12, "{:?}", guide.goal());
    }

    #[test]
    fn a_window_that_loses_the_keyboard_or_falls_silent_moves_nothing() {
        let mut guide = guide();
        guide.hear(None);
        let start = guide.goal();
        assert_eq!(guide.follow(2e-3), start);
        guide.hear(keys([1.0, 0.0]));
        let held = guide.follow(2e-3);
        assert!(held[0] > start[0], "{held:?}");
        guide.hear(None);
        assert_eq!(guide.follow(2e-3), held, "a key stays down");
        // It says nothing any more.
        guide.hear(keys([1.0, 0.0]));
        for _ in 0..1000 {
            guide.follow(2e-3);
        }
        let gone = guide.goal()[0] - held[0];
        assert!((gone - SPEED * 2.0 * LONGEST_SILENCE).abs() < SPEED * 2.0 * 4e-3, "{gone}");
        let stopped = guide.goal();
        assert_eq!(guide.follow(2e-3), stopped);
        // It is back.
        guide.hear(keys([1.0, 0.0]));
        assert!(guide.follow(2e-3)[0] > stopped[0]);
    }

    #[test]
    fn a_motion_begins_again_without_a_blow() {
        let ends = [(0.0, [0.0, 0.0]), (1.0, [0.5, 0.1])];
        let waypoints = ends.map(|(time, q)| Waypoint { time, q: JointVector::from_slice(&q) });
        let mut guide = Guide { motions: vec![("press", Motion::through(&waypoints, 2).unwrap())], ..guide() };
        guide.play(0);
        let (mut before, mut fastest, mut ends) = (guide.goal(), 0.0_f64, 0);
        for _ in 0..2000 {
            let now = guide.follow(2e-3);
            fastest = fastest.max((now[0] - before[0]).abs() / 2e-3);
            ends += usize::from(now[0] > 0.499 && before[0] <= 0.499);
            before = now;
        }
        assert!(ends >= 2 && guide.is_running(), "{ends} times in 4 s");
        assert!(fastest < 1.01 * 1.875 * 0.5 / LEAD_IN, "{fastest}");
    }

    #[test]
    fn the_key_home_leads_back_without_a_blow_unless_another_takes_the_lead() {
        let home = Some(Keys { home: true, ..Keys::default() });
        let mut guide = guide();
        let mut before = guide.goal();
        let mut fastest = 0.0_f64;
        guide.keys = home;
        for _ in 0..500 {
            let now = guide.follow(2e-3);
            fastest = fastest.max((now[0] - before[0]).abs() / 2e-3);
            before = now;
        }
        assert_eq!(guide.goal(), guide.home);
        // Minimum jerk: at most 15/8 of the mean speed.
        assert!(fastest < 1.01 * 1.875 * 0.5 / LEAD_IN, "{fastest}");
        guide.point(JointVector::from_slice(&[-0.5, 0.0]));
        guide.follow(0.5 * LEAD_IN);
        guide.keys = keys([1.0, 0.0]);
        let taken = guide.follow(2e-3);
        guide.keys = keys([0.0, 0.0]);
        assert!(taken[0] < 0.1 && guide.follow(1.0) == taken, "{taken:?}");
    }
}
