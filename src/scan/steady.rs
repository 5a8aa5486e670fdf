//! When contact counts as steady: over a window of time, every position stays within a range of a few encoder steps,
//! and the mean torque of the window's second half differs from that of the first by less than a bound.
//!
//! The first condition says that nothing moves, the second that a viscoelastic object has relaxed; a window of means
//! sees a drift far below the noise of a single tick.

use crate::JointVector;
use std::collections::VecDeque;

/// Positions and torques of the last ticks.
#[derive(Clone, Debug)]
pub struct Steadiness {
    ticks: usize,
    still: f64,
    drift: f64,
    readings: VecDeque<(JointVector, JointVector)>,
}

impl Steadiness {
    /// A window of `ticks` (at least two), with the range `still` of a position (rad or m) and the change `drift` of a
    /// mean torque (N m).
    #[must_use]
    pub fn new(ticks: usize, still: f64, drift: f64) -> Self {
        let ticks = ticks.max(2);
        Self { ticks, still, drift, readings: VecDeque::with_capacity(ticks + 1) }
    }

    /// Forgets everything.
    pub fn restart(&mut self) {
        self.readings.clear();
    }

    /// Takes a tick's position and torque; true when the whole window is steady.
    pub fn observe(&mut self, position: &JointVector, torque: &JointVector) -> bool {
        if self.readings.len() == self.ticks {
            self.readings.pop_front();
        }
        self.readings.push_back((*position, *torque));
        self.readings.len() == self.ticks && (0..position.len()).all(|joint| self.is_steady(joint))
    }

    fn is_steady(&self, joint: usize) -> bool {
        let positions = || self.readings.iter().map(|(position, _)| position[joint]);
        let range = positions().fold(f64::NEG_INFINITY, f64::max) - positions().fold(f64::INFINITY, f64::min);
        let half = self.ticks / 2;
        let mean = |skip: usize| {
            self.readings.iter().skip(skip).take(half).map(|(_, torque)| torque[joint]).sum::<f64>() / half as f64
        };
        range <= self.still && (mean(self.ticks - half) - mean(0)).abs() <= self.drift
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn steady_after(ticks: usize, q: impl Fn(usize) -> f64, tau: impl Fn(usize) -> f64) -> bool {
        let mut window = Steadiness::new(100, 1e-3, 1e-2);
        let one = |x: f64| JointVector::from_slice(&[x]);
        (0..ticks).fold(false, |_, k| window.observe(&one(q(k)), &one(tau(k))))
    }

    #[test]
    fn still_and_relaxed_is_steady_and_nothing_else_is() {
        let noise = |k: usize| if k.is_multiple_of(2) { 0.05 } else { -0.05 };
        assert!(steady_after(100, |_| 0.3, |k| 1.0 + noise(k)), "noise averages out");
        assert!(!steady_after(99, |_| 0.3, |_| 1.0), "the window is not full");
        assert!(!steady_after(200, |k| 2e-5 * k as f64, |_| 1.0), "it moves");
        assert!(!steady_after(200, |_| 0.3, |k| 3e-4 * k as f64), "it relaxes");
        assert!(steady_after(200, |_| 0.3, |k| 1e-4 * k as f64), "it relaxes slowly enough");
    }
}
