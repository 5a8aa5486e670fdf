//! Coulomb friction of the proxy: an elastic-plastic bristle at each proxy node in contact (Dupont et al. 2002; of the
//! family of Dahl and LuGre), inside the cone `|friction| <= mu |normal force|` of the dataset's forces: mu is static
//! for a node that stuck in the last step, which makes a soft hand drag the finger along in jerks, kinetic for one that
//! slipped.
//!
//! *Stick.* The bristle of deflection z (tangential) is a spring k and a damper s along the tangential way
//! `dx = P J T v_hat`, implicit in the step: friction `-(k (z + dx/2) + s dx/T)`, afterwards `z + dx`. Its work is
//! minus the change of `1/2 k |z|^2` less what s takes, exactly. *Slip.* Where that leaves the cone, friction is
//! `-mu N d` along d, the direction of the sticking force, and the step is solved again. It does the work
//! `-mu N d . dx`; the bristle keeps of it what the cone lets it keep, the rest is heat. A node that comes out moving
//! against d has not slipped: it is held by its bristle, as in stick. *Loss of pressure.* At the beginning of a tick
//! each bristle is turned into the new tangent plane and shortened to the new cone: both only take energy.
//!
//! Every branch takes energy or keeps it, whatever T: friction is dissipative in every step, not on average. Each solve
//! turns at least one node from stick to slip or from slip to held; in practice there are one or two. After
//! [`MOST_SOLVES`] all nodes are held by their bristles for this step, so that the time of a tick is bounded: a held
//! bristle takes energy whatever its force, and is shortened to the cone at the next tick.

use super::{Bristle, EffectState, Patch, Pending, add};
use crate::{
    JointMatrix, MAX_JOINTS,
    render::{
        accounts::Extra,
        npmi::{Load, Motion, Step},
    },
    scene::FrictionSpec,
};
use glam::DVec3;

/// Solves of a step in which nodes may still change between stick and slip; one of some microseconds more follows.
const MOST_SOLVES: usize = 8;

/// The constants of friction.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Friction {
    /// Kinetic and static mu (1).
    kinetic: f64,
    stiction: f64,
    /// k (N/m).
    stiffness: f64,
    /// s (N s/m).
    damping: f64,
}

/// Motion of a bristle during a step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Mode {
    /// It holds, as far as is known.
    Stick,
    /// It slides against friction along this direction.
    Slip(DVec3),
    /// It holds, whatever the cone.
    Held,
}

impl Friction {
    /// The friction of a scene.
    #[must_use]
    pub fn new(spec: &FrictionSpec) -> Self {
        Self {
            kinetic: spec.coefficient,
            stiction: spec.static_coefficient.unwrap_or(spec.coefficient),
            stiffness: spec.stiffness,
            damping: spec.damping,
        }
    }

    /// The `pending` step of the proxy with friction at the patches of `state`.
    pub(super) fn step(
        &self,
        pending: &Pending<'_>,
        state: &mut EffectState,
        motion: &mut Motion,
        extra: &mut Extra,
    ) -> Step {
        let Pending { npmi, stage, interval, load, .. } = pending;
        let interval = *interval;
        for patch in &mut state.patches {
            patch.bristle = patch.bristle.clamp_length_max(self.sticking_cone(patch) / self.stiffness);
        }
        let mut solves = 0;
        let (end, step) = loop {
            solves += 1;
            let mut trial = *motion;
            let step = npmi.advance(stage, &mut trial, interval, &self.loaded(load, &state.patches, interval));
            let mut settled = true;
            for patch in &mut state.patches {
                let slide = patch.slide(&step.velocity, interval);
                let mode = self.next_mode(patch, slide, interval);
                settled &= mode == patch.mode;
                patch.mode = mode;
            }
            if settled || solves > MOST_SOLVES {
                break (trial, step);
            }
            if solves == MOST_SOLVES {
                state.patches.iter_mut().for_each(|patch| patch.mode = Mode::Held);
            }
        };
        *motion = end;
        state.bristles.fill(Bristle::default());
        for patch in &state.patches {
            let slide = patch.slide(&step.velocity, interval);
            let (bristle, work) = self.settle(patch, slide, interval);
            extra.friction_work += work;
            extra.bristles += 0.5 * self.stiffness * bristle.length_squared();
            let slipped = matches!(patch.mode, Mode::Slip(_));
            state.bristles[patch.node] = Bristle { deflection: bristle, slipped };
        }
        step
    }

    /// Tangential force while slipping (N).
    fn cone(&self, patch: &Patch) -> f64 {
        self.kinetic * patch.pressure
    }

    /// Tangential force at which sticking ends (N).
    fn sticking_cone(&self, patch: &Patch) -> f64 {
        if patch.slipped { self.cone(patch) } else { self.stiction * patch.pressure }
    }

    /// Force of the bristle that holds, opposed by friction (N).
    fn holding(&self, patch: &Patch, slide: DVec3, interval: f64) -> DVec3 {
        self.stiffness * (patch.bristle + 0.5 * slide) + self.damping / interval * slide
    }

    fn next_mode(&self, patch: &Patch, slide: DVec3, interval: f64) -> Mode {
        match patch.mode {
            Mode::Stick => {
                let force = self.holding(patch, slide, interval);
                let size = force.length();
                if size > self.sticking_cone(patch) { Mode::Slip(force / size) } else { Mode::Stick }
            }
            Mode::Slip(direction) if direction.dot(slide) < 0.0 => Mode::Held,
            settled => settled,
        }
    }

    /// `load` and friction.
    fn loaded(&self, load: &Load, patches: &[Patch], interval: f64) -> Load {
        let mut loaded = *load;
        let mut tangential = [[0.0; MAX_JOINTS]; MAX_JOINTS];
        for patch in patches {
            let force = match patch.mode {
                Mode::Slip(direction) => self.cone(patch) * direction,
                Mode::Stick | Mode::Held => {
                    add_tangential(&mut tangential, patch);
                    self.stiffness * patch.bristle
                }
            };
            for (torque, column) in loaded.torque.iter_mut().zip(patch.columns) {
                *torque -= column.dot(force);
            }
        }
        add(&mut loaded.damping, 0.5 * interval * self.stiffness + self.damping, &tangential);
        loaded
    }

    /// The bristle after the step, and the work of friction on the proxy (J).
    fn settle(&self, patch: &Patch, slide: DVec3, interval: f64) -> (DVec3, f64) {
        let moved = patch.bristle + slide;
        match patch.mode {
            Mode::Stick | Mode::Held => (moved, -self.holding(patch, slide, interval).dot(slide)),
            Mode::Slip(direction) => {
                let taken = self.cone(patch) * direction.dot(slide);
                let kept = (patch.bristle.length_squared() + 2.0 * taken / self.stiffness).sqrt();
                let reach = kept.min(self.cone(patch) / self.stiffness);
                (reach * moved.try_normalize().unwrap_or(direction), -taken)
            }
        }
    }
}

/// `tangential += J^T P J`.
fn add_tangential(tangential: &mut JointMatrix, patch: &Patch) {
    let columns = patch.columns.map(|column| column.reject_from_normalized(patch.normal));
    for (row, a) in tangential.iter_mut().zip(columns) {
        for (entry, b) in row.iter_mut().zip(columns) {
            *entry += a.dot(b);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{JointVector, render::npmi::Npmi};

    const INTERVAL: f64 = 1e-3;

    /// So many bristles that hold one joint. Each one's cone is just wide enough to hold until the one before has
    /// slipped.
    fn ladder(friction: &Friction, pending: &Pending<'_>, motion: &Motion, count: usize) -> Vec<Patch> {
        let mut columns = [DVec3::ZERO; MAX_JOINTS];
        columns[0] = DVec3::X;
        let patch = |node| Patch {
            node,
            normal: DVec3::Z,
            pressure: f64::MAX,
            share: 1.0,
            columns,
            bristle: DVec3::ZERO,
            slipped: false,
            mode: Mode::Stick,
        };
        let mut patches = Vec::new();
        for node in 0..count {
            patches.push(patch(node));
        }
        let mut before = 0.0;
        for next in 0..count {
            let load = friction.loaded(&pending.load, &patches, INTERVAL);
            let step = pending.npmi.advance(pending.stage, &mut motion.clone(), INTERVAL, &load);
            let force = friction.holding(&patches[next], patches[next].slide(&step.velocity, INTERVAL), INTERVAL);
            let size = force.length();
            assert!(size > before);
            patches[next].pressure = (before + 0.1 * (size - before)) / friction.kinetic;
            patches[next].mode = Mode::Slip(force / size);
            before = size;
        }
        patches.iter_mut().for_each(|patch| patch.mode = Mode::Stick);
        patches
    }

    #[test]
    fn nodes_that_would_slip_one_after_another_are_held_once_the_time_of_a_tick_is_used_up() {
        let friction = Friction { kinetic: 0.5, stiction: 0.5, stiffness: 500.0, damping: 0.0 };
        let mut inertia = [[0.0; MAX_JOINTS]; MAX_JOINTS];
        inertia[0][0] = 1e-3;
        let npmi = Npmi::new(&inertia, &[[-1.0, 1.0]]).unwrap();
        let motion = Motion::at_rest(&JointVector::zeros(1));
        let stage = npmi.stage(&motion, INTERVAL);
        let zeros = JointVector::zeros(1);
        let load = Load {
            stiffness: zeros,
            target: zeros,
            damping: [[0.0; MAX_JOINTS]; MAX_JOINTS],
            torque: JointVector::from_slice(&[1.0]),
            stops: *npmi.limits(),
        };
        let pending = Pending { npmi: &npmi, stage: &stage, interval: INTERVAL, load, share: 1.0, solved: &[] };
        // Fewer than may change within a tick all find their mode; of more, all are held.
        for (count, held) in [(MOST_SOLVES - 2, 0), (MOST_SOLVES + 3, MOST_SOLVES + 3)] {
            let patches = ladder(&friction, &pending, &motion, count);
            let bristles = vec![Bristle::default(); count];
            let mut state = EffectState { touches: Vec::new(), patches, bristles };
            let mut extra = Extra {
                channels: zeros,
                friction_work: 0.0,
                bristles: 0.0,
                contact_dissipation: 0.0,
                control_dissipation: 0.0,
            };
            let mut motion = motion;
            friction.step(&pending, &mut state, &mut motion, &mut extra);
            let found = state.patches.iter().filter(|patch| patch.mode == Mode::Held).count();
            assert_eq!(found, held, "of {count}");
            assert!(extra.friction_work < 0.0 && motion.kinetic_energy().is_finite());
        }
    }
}
