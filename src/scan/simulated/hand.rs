//! A simulated person's hand that leads the device from place to place and lets go at each.
//!
//! `tau = grip (K (q_wanted - q) - B qdot)`: a grip as stiff as a relaxed hand's, around a wanted position that goes
//! from where the device was taken, back out of the object, across, into it at the next place, and rests there. Then
//! the button comes up, and the fingers open, more slowly: what a measurement must not contain.

use crate::JointVector;

/// Time from taking hold to taking hold (s).
const INTERVAL: f64 = 2.0;
/// When the wanted position is at each way point (taken, last approach, approach, place, place), as shares of the
/// interval; at the last one the button comes up.
const SHARES: [f64; 5] = [0.0, 0.14, 0.30, 0.44, 0.50];
/// Time in which the fingers close or open (s).
const CLOSING: f64 = 0.15;
/// Stiffness and damping of the grip [N m/rad or N/m, N m s/rad or N s/m]: a hand's is a few hundred N/m (Kuchenbecker,
/// Park and Niemeyer 2003), at a tenth of a metre.
const STIFFNESS: f64 = 10.0;
const DAMPING: f64 = 0.3;

/// The hand and what it is about to do.
#[derive(Clone, Debug)]
pub struct Hand {
    visits: Vec<[JointVector; 2]>,
    /// Visit during which the device was taken at `taken`.
    visit: Option<usize>,
    taken: JointVector,
}

impl Hand {
    /// A hand that leads to each of `visits`: an approach, outside of the object, and the place itself (rad or m).
    #[must_use]
    pub fn new(visits: Vec<[JointVector; 2]>) -> Self {
        let joints = visits.first().map_or(0, |visit| visit[0].len());
        Self { visits, visit: None, taken: JointVector::zeros(joints) }
    }

    /// Time that all visits take (s).
    #[must_use]
    pub fn duration(&self) -> f64 {
        self.visits.len() as f64 * INTERVAL
    }

    /// Visits that fit into `seconds`.
    #[must_use]
    pub fn visits_within(seconds: f64) -> usize {
        (seconds / INTERVAL).ceil() as usize
    }

    /// Whether the button is down.
    pub(super) fn holds(&self, time: f64) -> bool {
        let (visit, since) = phase(time);
        visit < self.visits.len() && since < SHARES[4] * INTERVAL
    }

    /// Adds the hand's torque.
    pub(super) fn add_torque(&mut self, time: f64, q: &JointVector, speed: &JointVector, torque: &mut JointVector) {
        let (visit, since) = phase(time);
        let Some([approach, place]) = self.visits.get(visit).copied() else { return };
        if self.visit != Some(visit) {
            (self.visit, self.taken) = (Some(visit), *q);
        }
        let open = SHARES[4] * INTERVAL;
        let grip = (since / CLOSING).min((open + CLOSING - since) / CLOSING).clamp(0.0, 1.0);
        let before = visit.checked_sub(1).map_or(self.taken, |before| self.visits[before][0]);
        let way = [self.taken, before, approach, place, place];
        let leg = SHARES[1..].iter().take_while(|end| since >= **end * INTERVAL).count().min(3);
        let share = ((since / INTERVAL - SHARES[leg]) / (SHARES[leg + 1] - SHARES[leg])).clamp(0.0, 1.0);
        let eased = share * share * (3.0 - 2.0 * share);
        for (joint, torque) in torque.iter_mut().enumerate() {
            let wanted = way[leg][joint] + eased * (way[leg + 1][joint] - way[leg][joint]);
            *torque += grip * (STIFFNESS * (wanted - q[joint]) - DAMPING * speed[joint]);
        }
    }
}

/// Number of the visit, and time since it began (s).
fn phase(time: f64) -> (usize, f64) {
    let visit = (time / INTERVAL).floor();
    (visit as usize, time - visit * INTERVAL)
}
