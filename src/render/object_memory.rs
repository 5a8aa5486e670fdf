//! What the drawn object remembers: forces on its nodes, frame by frame.
//!
//! A synchronous material obeys `K u = f + sum g_i K z_i`, `z_i' = (u - z_i) / theta_i`. With forces `y_i = K z_i` in
//! the place of the displacements z_i, and `F = K u`, that is `F = f + sum g_i y_i`, `y_i' = (F - y_i) / theta_i`: no
//! system has to be solved. The object is drawn under F. While the arm holds still, f fades and F does not, so that the
//! dent stays under the arm; once it lets go, the dent recovers.

use crate::scene::RelaxationSpec;
use glam::DVec3;

/// One term.
#[derive(Clone, Debug)]
struct Term {
    /// g (1).
    share: f64,
    /// exp(-T / theta) (1).
    factor: f64,
    /// y (N).
    past: Vec<DVec3>,
}

/// The memory of the object's nodes.
#[derive(Clone, Debug)]
pub struct ObjectMemory {
    terms: Vec<Term>,
    /// sum g_i y_i (N).
    held: Vec<DVec3>,
}

impl ObjectMemory {
    /// Nothing to remember yet, of `nodes` nodes in frames every `period` (s).
    #[must_use]
    pub fn new(spec: &RelaxationSpec, period: f64, nodes: usize) -> Self {
        let past = vec![DVec3::ZERO; nodes];
        let term = |&[share, time]: &[f64; 2]| Term { share, factor: (-period / time).exp(), past: past.clone() };
        Self { terms: spec.terms.iter().map(term).collect(), held: past }
    }

    /// The body force that the object's past makes (N).
    pub fn past(&mut self) -> &[DVec3] {
        self.held.fill(DVec3::ZERO);
        for Term { share, past, .. } in &self.terms {
            self.held.iter_mut().zip(past).for_each(|(held, past)| *held += *share * *past);
        }
        &self.held
    }

    /// Returns the body force that the object's past makes (N), and lets one frame under contact `forces` beside it go
    /// by.
    pub fn frame(&mut self, forces: &[DVec3]) -> &[DVec3] {
        self.past();
        for Term { factor, past, .. } in &mut self.terms {
            for ((past, force), held) in past.iter_mut().zip(forces).zip(&self.held) {
                let whole = *force + *held;
                *past = whole + *factor * (*past - whole);
            }
        }
        &self.held
    }

    /// Of displacements z_i, what they store with their `forces` y_i, `(sum g_i z_i . y_i - s . h) / 2` with the bodies'
    /// own past s and h (J).
    pub fn stored(&mut self, forces: &mut Self) -> f64 {
        let dot = |a: &[DVec3], b: &[DVec3]| a.iter().zip(b).map(|(a, b)| a.dot(*b)).sum::<f64>();
        let terms = self.terms.iter().zip(&forces.terms);
        let all: f64 = terms.map(|(z, y)| z.share * dot(&z.past, &y.past)).sum();
        0.5 * (all - dot(self.past(), forces.past()))
    }

    /// Forgets all.
    pub fn clear(&mut self) {
        self.terms.iter_mut().for_each(|term| term.past.fill(DVec3::ZERO));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const TERMS: [[f64; 2]; 2] = [[0.4, 0.05], [0.2, 0.5]];
    const PERIOD: f64 = 1.0 / 60.0;

    #[test]
    fn a_dent_stays_under_an_arm_that_holds_still_and_recovers_once_it_lets_go() {
        let spec = RelaxationSpec { terms: TERMS.to_vec(), dent: None };
        let mut memory = ObjectMemory::new(&spec, PERIOD, 1);
        // The loop's force fades: 1 - sum g z / w of the elastic one.
        let (mut remembered, pushed) = ([0.0; 2], DVec3::new(0.3, 0.0, -2.0));
        for _ in 0..120 {
            let share = 1.0 - TERMS.iter().zip(remembered).map(|([g, _], z)| g * z).sum::<f64>();
            let whole = share * pushed + memory.frame(&[share * pushed])[0];
            assert!((whole - pushed).length() < 1e-14, "{whole}");
            for (z, [_, time]) in remembered.iter_mut().zip(TERMS) {
                *z = 1.0 + (*z - 1.0) * (-PERIOD / time).exp();
            }
        }
        // What is left begins as the part that had faded, and is gone in 20 of the longest times.
        let mut left = memory.frame(&[DVec3::ZERO])[0];
        let faded = TERMS.iter().zip(remembered).map(|([g, _], z)| g * z).sum::<f64>();
        assert!((left - faded * pushed).length() < 1e-12, "{left}");
        for _ in 0..(20.0 * TERMS[1][1] / PERIOD) as usize {
            let next = memory.frame(&[DVec3::ZERO])[0];
            assert!(next.length() < left.length());
            left = next;
        }
        assert!(left.length() < 1e-6 * pushed.length(), "{left}");
    }
}
