//! Memory of the object: linear viscoelasticity on the root w of its energy, one number a term.
//!
//! `w = sqrt(2 U)` is the root of the instantaneous energy. With the terms' shares g_i and times theta_i,
//! `g_0 = 1 - sum g_i`, the object stores
//!
//! `H = g_0 w^2 / 2 + sum g_i (w - z_i)^2 / 2`,  and `tau = -dH/dq = -(w - w_s) dw/dq`,  `w_s = sum g_i z_i`,
//!
//! which is the elastic torque times `1 - w_s / w`. Contact lasts while `w > w_s`; then there is no force, and H is its
//! least over w, that at w_s: the dent recovers alone. For a synchronous material (all of the stiffness relaxes alike)
//! under a contact that does not wander this is exact; with a curved force it is quasi-linear viscoelasticity.
//!
//! *Tick.* The torque is that of the potential H with z held, less stiff than U. Then, where the proxy has gone,
//! `z_i <- v + (z_i - v) exp(-T / theta_i)` with `v = max(w, w_s)`: exactly what the equation of z gives under constant
//! w. Each z_i moves towards v, by which H only falls: what it loses is booked as relaxed. The loop so gives nothing
//! that it would not give without memory, whatever the motion.
//!
//! *Sliding* meets fresh material: over a way s of slip ([`crate::contact::Slip`]) each z_i falls by `exp(-s / l)`, l
//! the way over which the arm leaves its dent: one of the same forces so far beside has 1/e of the energy in common with
//! it, under a single point where its dent is 1/e as deep. Where forgetting raises H, it is paid by a drag of size
//! `P = sum g_i (w - z_i)+ z_i / l` against the slip, a damper `P / |slip rate|` that is implicit in the step. Where the
//! drag took less than H would rise, z falls by so much less, H being convex in it.

use super::npmi::Load;
use crate::{
    JointVector,
    contact::Slip,
    scene::{MOST_TERMS, RelaxationSpec},
};

/// Slip rate below which the drag is viscous, over l / theta of the slowest term (1): so much slower than the rate
/// at which forgetting counts beside relaxation.
const CREEP: f64 = 0.05;

/// The terms of a scene.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Relaxation {
    terms: [Term; MOST_TERMS],
    /// g_0 (1).
    lasting: f64,
    /// 1 / l (1/m); zero where sliding forgets nothing.
    forgetting: f64,
    /// Slip rate below which the drag is viscous (m/s).
    creep: f64,
    /// T for which the factors are known (s).
    period: f64,
}

/// A term; of share zero where there is none.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Term {
    /// g (1).
    share: f64,
    /// theta (s).
    time: f64,
    /// exp(-T / theta) of the nominal T (1).
    factor: f64,
}

/// What the object remembers.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Memory {
    /// z of each term (sqrt(J)).
    z: [f64; MOST_TERMS],
    /// Time since z was brought up to date, and the way slid in it (s, m).
    elapsed: f64,
    slid: f64,
    /// What the drag took in it (J).
    drag: f64,
    /// w at the last contact (sqrt(J)).
    touched: f64,
}

/// The object's energy, as the proxy comes to where it is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Remembered {
    /// Factor on the elastic torque and normal force (1).
    pub share: f64,
    /// H (J).
    pub stored: f64,
    /// What was lost of H and the drag since the tick before (J).
    pub relaxed: f64,
    /// w_s over w at the last contact (1).
    pub dent: Option<f64>,
}

impl Relaxation {
    /// The relaxation of a scene whose ticks are nominally `period` apart (s).
    pub fn new(spec: &RelaxationSpec, period: f64) -> Self {
        let mut terms = [Term::default(); MOST_TERMS];
        for (term, &[share, time]) in terms.iter_mut().zip(&spec.terms) {
            *term = Term { share, time, factor: (-period / time).exp() };
        }
        let slowest = terms.iter().fold(0.0, |slowest: f64, term| slowest.max(term.time));
        let forgetting = spec.dent.map_or(0.0, f64::recip);
        let creep = if forgetting > 0.0 { CREEP / (forgetting * slowest) } else { 0.0 };
        let lasting = 1.0 - terms.iter().map(|term| term.share).sum::<f64>();
        Self { terms, lasting, forgetting, creep, period }
    }

    /// Brings `memory` up to date where the elastic energy is `energy` U (J). Never allocates.
    pub fn arrive(&self, memory: &mut Memory, energy: f64) -> Remembered {
        let w = (2.0 * energy.max(0.0)).sqrt();
        let before = self.stored(w, &memory.z) + memory.drag;
        if memory.slid > 0.0 {
            self.forget(memory, w);
        }
        if memory.elapsed > 0.0 {
            let towards = w.max(self.separation(&memory.z));
            let is_nominal = memory.elapsed == self.period;
            for (z, term) in memory.z.iter_mut().zip(&self.terms).filter(|(_, term)| term.share > 0.0) {
                let factor = if is_nominal { term.factor } else { (-memory.elapsed / term.time).exp() };
                *z = towards + (*z - towards) * factor;
                super::npmi::flush(z);
            }
        }
        (memory.elapsed, memory.slid, memory.drag) = (0.0, 0.0, 0.0);
        let stored = self.stored(w, &memory.z);
        let separation = self.separation(&memory.z);
        let share = if w > separation { 1.0 - separation / w } else { 0.0 };
        if w > separation {
            memory.touched = w;
        }
        let dent = if memory.touched > 0.0 { (separation / memory.touched).min(1.0) } else { 0.0 };
        Remembered { share, stored, relaxed: before - stored, dent: Some(dent) }
    }

    /// Adds the drag of sliding to `load`, with the elastic energy U (J) and the slip rate of the step before (m/s).
    /// Returns its damper (N s/m), for [`Relaxation::depart`].
    pub fn drag(&self, memory: &Memory, energy: f64, slip: &Slip, velocity: &JointVector, load: &mut Load) -> f64 {
        if self.forgetting <= 0.0 {
            return 0.0;
        }
        let w = (2.0 * energy.max(0.0)).sqrt();
        let fresh = self.terms.iter().zip(&memory.z).map(|(term, z)| term.share * (w - z).max(0.0) * z);
        let force = self.forgetting * fresh.sum::<f64>();
        if force <= 0.0 {
            return 0.0;
        }
        let damper = force / slip.rate(velocity).max(self.creep);
        slip.add_damper(damper, &mut load.damping, velocity.len());
        damper
    }

    /// Takes in a step over `interval` (s) with the proxy at `velocity`, its slip and the damper of the drag where they
    /// are known, and returns what the drag took (J).
    pub fn depart(
        &self,
        memory: &mut Memory,
        interval: f64,
        velocity: &JointVector,
        drag: Option<(&Slip, f64)>,
    ) -> f64 {
        memory.elapsed = interval;
        if let Some((slip, damper)) = drag.filter(|_| self.forgetting > 0.0) {
            let rate = slip.rate(velocity);
            memory.slid = interval * rate;
            memory.drag = interval * damper * rate * rate;
        }
        memory.drag
    }

    /// Lets each z fall over the way that was slid, by as much as the drag has paid for.
    fn forget(&self, memory: &mut Memory, w: f64) {
        let left = (-self.forgetting * memory.slid).exp();
        let forgotten = memory.z.map(|z| left * z);
        let rise = self.stored(w, &forgotten) - self.stored(w, &memory.z);
        let paid = if rise > memory.drag { memory.drag / rise } else { 1.0 };
        memory.z.iter_mut().zip(forgotten).for_each(|(z, forgotten)| *z += paid * (forgotten - *z));
    }

    /// w_s, below which nothing pushes (sqrt(J)).
    fn separation(&self, z: &[f64; MOST_TERMS]) -> f64 {
        self.terms.iter().zip(z).map(|(term, z)| term.share * z).sum::<f64>().max(0.0)
    }

    /// H at w, or at w_s where that is more (J).
    fn stored(&self, w: f64, z: &[f64; MOST_TERMS]) -> f64 {
        let w = w.max(self.separation(z));
        let fading: f64 = self.terms.iter().zip(z).map(|(term, z)| term.share * (w - z) * (w - z)).sum();
        0.5 * (self.lasting * w * w + fading)
    }
}
