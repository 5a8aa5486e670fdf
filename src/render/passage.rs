//! How the contact torque passes from one function to another while it is felt.
//!
//! When finer values arrive the torque tau and the energy U at the proxy's place change, though it does not move. The
//! difference, old less new, is kept as a constant torque o, which has the potential `V(x) = V_0 - o . (x - x_0)`, with
//! V_0 the difference of the energies. What is felt, `tau + o` with the energy `U + V`, goes on without a jump; it is
//! minus a gradient wherever tau is.
//!
//! Then o and V fade together, by the same factor each tick. Where V is positive this takes energy out. Where it is
//! negative, -V dr is given from nowhere in a tick; so it fades only as far as the proxy's damping has taken more than
//! the field has given beyond what it stored ([`Accounts::created`](super::accounts::Accounts::created)): as an energy
//! tank lets a varying stiffness (Ferraguti, Secchi and Fantuzzi 2013). So the field with all that arrives never gives
//! more than the damping takes, whatever arrives and when.

use crate::JointVector;

/// Time in which a difference fades to 1/e (s). Longer: the torque errs longer. Shorter: it changes faster; with this,
/// by a twentieth of the difference a millisecond.
const TIME: f64 = 0.02;

/// Rest of the differences.
#[derive(Clone, Debug)]
pub(super) struct Passage {
    /// o (N m or N).
    torque: JointVector,
    /// V at the proxy (J).
    energy: f64,
}

impl Passage {
    /// None.
    pub fn new(joints: usize) -> Self {
        Self { torque: JointVector::zeros(joints), energy: 0.0 }
    }

    /// o (N m or N).
    pub fn torque(&self) -> &JointVector {
        &self.torque
    }

    /// V at the proxy (J).
    pub fn energy(&self) -> f64 {
        self.energy
    }

    /// Takes over a change at the proxy's place, from `before` to `now`: torque and energy.
    pub fn take(&mut self, before: (&JointVector, f64), now: (&JointVector, f64)) {
        let parts = self.torque.iter_mut().zip(before.0.iter().zip(now.0.iter()));
        parts.for_each(|(torque, (before, now))| *torque += before - now);
        self.energy += before.1 - now.1;
    }

    /// The proxy goes from `from` to `to`.
    pub fn go(&mut self, from: &JointVector, to: &JointVector) {
        for ((torque, from), to) in self.torque.iter().zip(from.iter()).zip(to.iter()) {
            self.energy -= torque * (to - from);
        }
    }

    /// Fades over `period` (s), giving at most `budget` (J), nothing if that is negative. Returns what it gave;
    /// negative where it took.
    pub fn fade(&mut self, period: f64, budget: f64) -> f64 {
        let mut share = 1.0 - (-period / TIME).exp();
        if self.energy < 0.0 {
            share = share.min((budget / -self.energy).max(0.0));
        }
        let given = -share * self.energy;
        self.energy += given;
        self.torque.iter_mut().for_each(|torque| *torque -= share * *torque);
        given
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn vector(numbers: &[f64]) -> JointVector {
        JointVector::from_slice(numbers)
    }

    #[test]
    fn a_change_makes_no_jump_and_fades() {
        let mut passage = Passage::new(2);
        let (before, now) = (vector(&[0.3, -0.1]), vector(&[0.1, 0.2]));
        passage.take((&before, 0.02), (&now, 0.01));
        for a in 0..2 {
            assert!((now[a] + passage.torque()[a] - before[a]).abs() < 1e-15);
        }
        assert!((0.01 + passage.energy() - 0.02).abs() < 1e-15);
        for _ in 0..400 {
            passage.fade(1e-3, 0.0);
        }
        assert!(passage.torque().norm() < 1e-8 && passage.energy() < 1e-9);
    }

    #[test]
    fn around_any_loop_it_gives_nothing_and_fading_gives_no_more_than_its_budget() {
        let mut passage = Passage::new(2);
        passage.take((&vector(&[0.0, 0.0]), 0.0), (&vector(&[0.4, -0.3]), 0.05));
        let corners = [[0.0, 0.0], [0.1, 0.0], [0.1, 0.2], [0.0, 0.0]].map(|q| vector(&q));
        let start = passage.energy();
        corners.windows(2).for_each(|pair| passage.go(&pair[0], &pair[1]));
        assert!((passage.energy() - start).abs() < 1e-15);
        // Nothing may be given: nothing fades.
        assert_eq!((passage.fade(1e-3, 0.0), passage.fade(1e-3, -1.0)), (0.0, 0.0));
        assert_eq!(passage.energy(), start);
        let mut budget = 0.01;
        for _ in 0..1000 {
            let given = passage.fade(1e-3, budget);
            assert!(given >= 0.0 && given <= budget * (1.0 + 1e-12));
            budget -= given;
        }
        assert!(budget.abs() < 1e-12 && (passage.energy() - (start + 0.01)).abs() < 1e-12);
    }
}
