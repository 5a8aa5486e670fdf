//! One damped Newton step of the energy form (Levenberg 1944, Marquardt 1963), by conjugate gradients.
//!
//! The energy along a displacement du = C df of the object, f being the forces that hold the displacement u = C f:
//! `m(df) = u . df + 1/2 (1 + mu) df . C df + 1/2 sum_i kc_i max(0, depth_i + g_i . du)^2 + 1/2 sum_i lambda_i
//! d2s_i(du, du)`, with g_i the depth's gradient and mu the damping, a multiple of the object's own stiffness: so stiff
//! springs are met first, however short the step. Two things make it a better model than the plain second derivative of
//! the energy, and neither costs a detection:
//! - the maximum is kept, so contacts may come and go within a step: a pass of conjugate gradients for the contacts
//!   that touch is followed by another where the step has changed which do;
//! - curvature is weighted by the multiplier lambda_i that the step before predicted, not by kc depth_i, which at stiff
//!   contact is far too large until the depth has settled (as in sequential quadratic programming). Both agree in the
//!   end, so convergence stays quadratic.
//!
//! Conjugate gradients on H = (1 + mu) K + B, B the Hessian of the contact terms, preconditioned by Woodbury's identity
//! for the springs ([`super::woodbury`]), keep each search direction twice, as a force pi and as the displacement p = C
//! pi, so that H p = (1 + mu) pi + B p needs no K. One product with C_AA is spent per iteration, that of the
//! preconditioner. What it does not know of B, how contacts bend, has a rank of at most four per contact, so few
//! iterations are needed whatever the object's size and the springs' stiffness. Negative curvature asks for more
//! damping.

// Indexed loops as in shaders/search_step.wgsl.
#![allow(clippy::needless_range_loop)]

use super::woodbury::Woodbury;
use crate::contact::law::depth::Contact;
use crate::contact::law::springs::{Springs, add_contact_hessian, stretched_and_bent};
use crate::contact::linear::support::{Support, dot, root};

/// Conjugate-gradient iterations of one step at most, per unknown (1): exact arithmetic needs one per unknown,
/// rounding at stiff contact, and passes for other touching contacts, a few times as many.
pub const INNER_ITERATIONS_PER_UNKNOWN: usize = 4;

/// Passes of conjugate gradients in one step at most, each for another set of touching contacts (1): sets
/// settle in two or three; more are cut off by a decrease that no longer grows.
pub const MODEL_PASSES: usize = 6;

/// Least damping of a Newton step that is not zero, in the object's own stiffness (1): less changes a step by less than
/// the tenth that its model is good for where damping is needed at all. With 0.01, 64 hard balls on 2,027 nodes
/// converge all the same, in the same time.
pub const LEAST_DAMPING: f64 = 0.1;

/// Factor by which damping grows after the first step that E refuses, doubled with each that follows (1) (Nielsen
/// 1999): five refusals in a row multiply it by a million, which is what rigid contact is stiffer than the object
/// (`RIGID_STIFFNESS`).
pub const DAMPING_GROWTH: f64 = 4.0;

/// Factor by which damping fades after a step that kept most of its promise (1): with 0.1 points in soft contact on
/// 1,026 nodes take 10.1 steps instead of 9.1, and 64 hard balls on 2,027 nodes as long; with 0.5 the eight hardest of
/// these took twice as long, without [`CURVATURE_MARGIN`].
pub const DAMPING_DECAY: f64 = 0.25;

/// Damping that is added to what a direction of negative curvature lacks, in the object's own stiffness (1). Without,
/// the model is nearly flat in that direction, and the step so long that neighbouring configurations end at different
/// equilibria: of 2,300 with points deeper than half the object's radius 34 have one within 2e-6 rad, with 5 only 7; 10
/// takes a third more iterations where contact is stiff.
pub const CURVATURE_MARGIN: f64 = 5.0;

/// Attempts to find a damping with which the model is convex (1): it doubles at least from one to the next, so that the
/// last is 1e9, a thousand times what rigid contact is stiffer than the object (`RIGID_STIFFNESS`).
pub const DAMPING_ATTEMPTS: u32 = 30;

/// How much the model is damped: more from step to step where E refuses them, less where it keeps what they promise
/// (Nielsen 1999).
#[derive(Clone, Copy, Debug)]
pub struct Damping {
    /// mu, zero or [`LEAST_DAMPING`] and more (1).
    pub multiple: f64,
    /// Factor by which the next refused step multiplies it.
    growth: f64,
}

impl Default for Damping {
    fn default() -> Self {
        Self { multiple: 0.0, growth: DAMPING_GROWTH }
    }
}

impl Damping {
    /// After a step that E refused, or that kept too little of its promise.
    pub fn increase(&mut self) {
        self.multiple = self.growth * self.multiple.max(LEAST_DAMPING);
        self.growth *= 2.0;
    }

    /// After a step that E took; `good` if it kept most of its promise.
    pub fn decrease(&mut self, good: bool) {
        self.growth = DAMPING_GROWTH;
        if good {
            self.multiple *= DAMPING_DECAY;
        }
        if self.multiple < LEAST_DAMPING {
            self.multiple = 0.0;
        }
    }
}

/// Predicted effect of a step.
#[derive(Clone, Copy, Debug)]
pub struct Step {
    /// Decrease of the energy by the model without damping; not a number where no damping was enough (J).
    pub predicted: f64,
    /// Length in the energy norm, sqrt(df . C df) (sqrt(J)).
    pub length: f64,
    /// The damping mu with which the model is convex (1).
    pub damping: f64,
}

/// Vectors on the support, reused from step to step.
#[derive(Default)]
pub struct Newton {
    /// The step df (N).
    pub force: Vec<f64>,
    /// The force of each row after the step, to first order, over kc (m).
    pub forces_over_kc: Vec<f64>,
    /// The step du = C df on the support (m).
    displacement: Vec<f64>,
    /// The step of the pass before.
    previous_force: Vec<f64>,
    previous_displacement: Vec<f64>,
    /// Which contacts touch, in this pass.
    active: Vec<bool>,
    /// Times K, what the object resists with: 1 + mu (1).
    stiffening: f64,
    residual: Vec<f64>,
    /// C times the residual.
    product: Vec<f64>,
    woodbury: Woodbury,
    /// The residual preconditioned, as force and as displacement.
    preconditioned_force: Vec<f64>,
    preconditioned: Vec<f64>,
    direction_force: Vec<f64>,
    direction: Vec<f64>,
    hessian_direction: Vec<f64>,
}

impl Newton {
    /// Step for the residual force r = c(u) - f, given with C r, damped by `damping` or as much more as makes the model
    /// convex, and solved to `tolerance` relative to the residual, in the norm of the preconditioner. The step is left
    /// in `self.force`, the forces of the rows after it in `self.forces_over_kc`.
    pub fn step(
        &mut self,
        support: &Support,
        springs: Springs,
        residual: (&[f64], &[f64]),
        mut damping: f64,
        tolerance: f64,
    ) -> Step {
        for _ in 0..DAMPING_ATTEMPTS {
            self.stiffening = 1.0 + damping;
            match self.minimise(support, springs, residual, tolerance) {
                Ok(decrease) => {
                    let square = dot(&self.force, &self.displacement);
                    return Step { predicted: decrease + 0.5 * damping * square, length: root(square), damping };
                }
                Err(lacking) => damping += (lacking + CURVATURE_MARGIN).max(damping),
            }
        }
        Step { predicted: f64::NAN, length: 0.0, damping }
    }

    /// Prepares [`Newton::respond`] for the contacts of `springs` that touch.
    pub fn factorise(&mut self, support: &Support, springs: Springs) {
        self.stiffening = 1.0;
        self.reset(support.order(), springs.contacts);
        self.woodbury.set_up(support, springs, &self.active, self.stiffening);
    }

    /// The displacement du on the support with which (K + B) du is the force `load` on the support to `tolerance`, B
    /// the Hessian of the contacts given to [`Newton::factorise`], and what it leaves of the load; `None` where K + B
    /// is found not to be positive definite, and then [`Newton::descent`] is a direction in which the energy curves
    /// downwards (m).
    pub fn respond(
        &mut self,
        support: &Support,
        springs: Springs,
        load: &[f64],
        tolerance: f64,
    ) -> Option<(&[f64], &[f64])> {
        self.force.fill(0.0);
        self.displacement.fill(0.0);
        self.residual.copy_from_slice(load);
        support.multiply(&self.residual, &mut self.product);
        self.precondition(springs);
        let stop = tolerance * tolerance * dot(&self.residual, &self.preconditioned);
        let mut left = INNER_ITERATIONS_PER_UNKNOWN * support.order();
        self.conjugate_gradients(support, springs, stop, &mut left).ok()?;
        Some((&self.displacement, &self.residual))
    }

    /// The search direction of the last solve, as a force, and its length in the energy norm (N, sqrt(J)).
    pub fn descent(&self) -> (&[f64], f64) {
        (&self.direction_force, root(dot(&self.direction, &self.direction_force)))
    }

    /// The least of the damped model, and by how much it is less than at the start (J); or what damping lacks where it
    /// is not convex.
    fn minimise(
        &mut self,
        support: &Support,
        springs: Springs,
        (residual, product): (&[f64], &[f64]),
        tolerance: f64,
    ) -> Result<f64, f64> {
        self.reset(support.order(), springs.contacts);
        self.residual.copy_from_slice(residual);
        self.product.copy_from_slice(product);
        let mut stop = 0.0;
        let mut predicted = 0.0;
        let mut left = INNER_ITERATIONS_PER_UNKNOWN * support.order();
        for pass in 0..MODEL_PASSES {
            self.previous_force.copy_from_slice(&self.force);
            self.previous_displacement.copy_from_slice(&self.displacement);
            self.woodbury.set_up(support, springs, &self.active, self.stiffening);
            self.precondition(springs);
            if pass == 0 {
                stop = tolerance * tolerance * dot(&self.residual, &self.preconditioned);
            }
            self.conjugate_gradients(support, springs, stop, &mut left)?;
            let decrease = self.model_decrease(springs, residual);
            if pass > 0 && (decrease <= predicted || decrease.is_nan()) {
                // Contacts came and went to no avail: the pass before was better.
                std::mem::swap(&mut self.force, &mut self.previous_force);
                std::mem::swap(&mut self.displacement, &mut self.previous_displacement);
                self.model_decrease(springs, residual);
                break;
            }
            predicted = decrease;
            if !self.update_touching() {
                break;
            }
            self.update_model_residual(springs, residual);
            support.multiply(&self.residual, &mut self.product);
        }
        Ok(predicted)
    }

    /// The zero step, and room for the rest.
    fn reset(&mut self, order: usize, contacts: &[Contact]) {
        for vector in [&mut self.force, &mut self.displacement] {
            vector.clear();
            vector.resize(order, 0.0);
        }
        for vector in [
            &mut self.previous_force,
            &mut self.previous_displacement,
            &mut self.residual,
            &mut self.product,
            &mut self.preconditioned_force,
            &mut self.preconditioned,
            &mut self.direction_force,
            &mut self.direction,
            &mut self.hessian_direction,
        ] {
            vector.resize(order, 0.0);
        }
        self.active.clear();
        self.active.extend(contacts.iter().map(Contact::is_active));
        self.forces_over_kc.clear();
        self.forces_over_kc.resize(contacts.len(), 0.0);
    }

    /// Goes on from the current step for the contacts that touch, until the preconditioned residual's square is at most
    /// `stop` or no iterations are `left`; where the model is not convex, ends with what damping lacks, by the
    /// direction that shows it.
    fn conjugate_gradients(
        &mut self,
        support: &Support,
        springs: Springs,
        stop: f64,
        left: &mut usize,
    ) -> Result<(), f64> {
        self.direction_force.copy_from_slice(&self.preconditioned_force);
        self.direction.copy_from_slice(&self.preconditioned);
        let mut square = dot(&self.residual, &self.preconditioned);
        while *left > 0 && square > stop {
            *left -= 1;
            for k in 0..self.hessian_direction.len() {
                self.hessian_direction[k] = self.stiffening * self.direction_force[k];
            }
            add_contact_hessian(springs, &self.active, &self.direction, &mut self.hessian_direction);
            let curvature = dot(&self.direction, &self.hessian_direction);
            if curvature <= 0.0 {
                return Err(-curvature / dot(&self.direction, &self.direction_force));
            }
            let share = square / curvature;
            add_scaled(share, &self.direction_force, &mut self.force);
            add_scaled(share, &self.direction, &mut self.displacement);
            add_scaled(-share, &self.hessian_direction, &mut self.residual);
            support.multiply(&self.residual, &mut self.product);
            self.precondition(springs);
            let next = dot(&self.residual, &self.preconditioned);
            let ratio = next / square;
            square = next;
            update_direction(ratio, &self.preconditioned_force, &mut self.direction_force);
            update_direction(ratio, &self.preconditioned, &mut self.direction);
        }
        Ok(())
    }

    /// Preconditions the residual.
    fn precondition(&mut self, springs: Springs) {
        let Self { woodbury, residual, product, preconditioned_force, preconditioned, .. } = self;
        woodbury.apply(springs, (residual, product), preconditioned_force, preconditioned);
    }

    /// Notes the rows' forces after the step, to first order; returns m(0) - m(df), in
    /// differences that do not cancel near the solution (J).
    fn model_decrease(&mut self, springs: Springs, residual: &[f64]) -> f64 {
        let own = 0.5 * self.stiffening * dot(&self.displacement, &self.force);
        let mut decrease = dot(&self.displacement, residual) - own;
        let Self { forces_over_kc, displacement, .. } = self;
        for (k, row) in springs.contacts.iter().enumerate() {
            let v = springs.variation(k, displacement);
            let change = row.depth_change(&v);
            if row.multiplier != 0.0 {
                decrease -= 0.5 * row.multiplier * row.second_variation(&v).dot(&v);
            }
            let force = row.share * (row.depth + change).max(0.0);
            let before = row.force_over_kc();
            // The part that is of first order is in the residual.
            let stretch = if row.is_active() == (force > 0.0) {
                (force - before) * change
            } else {
                force * (row.depth + change) - before * (row.depth + 2.0 * change)
            };
            decrease -= 0.5 * springs.kc * stretch;
            forces_over_kc[k] = force;
        }
        decrease
    }

    /// Notes which rows touch at the step; true when that has changed.
    fn update_touching(&mut self) -> bool {
        let mut changed = false;
        for (active, force) in self.active.iter_mut().zip(&self.forces_over_kc) {
            let touches = *force > 0.0;
            changed |= touches != *active;
            *active = touches;
        }
        changed
    }

    /// Residual force of the model at the step.
    fn update_model_residual(&mut self, springs: Springs, residual: &[f64]) {
        for k in 0..residual.len() {
            self.residual[k] = residual[k] - self.stiffening * self.force[k];
        }
        let Self { displacement, residual, forces_over_kc, .. } = self;
        for (k, (row, force)) in springs.contacts.iter().zip(&*forces_over_kc).enumerate() {
            let push = springs.kc * (force - row.force_over_kc());
            let reaction = stretched_and_bent(row, push, &springs.variation(k, displacement));
            springs.add_reaction(k, &-reaction, residual);
        }
    }
}

/// sum += share * direction.
fn add_scaled(share: f64, direction: &[f64], sum: &mut [f64]) {
    for (sum, direction) in sum.iter_mut().zip(direction) {
        *sum += share * direction;
    }
}

/// direction = residual + ratio * direction.
fn update_direction(ratio: f64, residual: &[f64], direction: &mut [f64]) {
    for (direction, residual) in direction.iter_mut().zip(residual) {
        *direction = residual + ratio * *direction;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::contact::law::springs::add_contact_forces;
    use crate::contact::law::springs::samples::{Sample, ball, off, sample};
    use crate::scene::SpringKind;

    /// The contact forces at rest, and the step that they lead to with `damping`.
    fn step(sample: &Sample, damping: f64) -> (Vec<f64>, Vec<f64>, Step) {
        let order = sample.support().order();
        let (mut residual, mut product) = (vec![0.0; order], vec![0.0; order]);
        add_contact_forces(sample.springs(), &mut residual);
        sample.support().multiply(&residual, &mut product);
        let mut newton = Newton::default();
        let springs = sample.springs();
        let step = newton.step(sample.support(), springs, (&residual, &product), damping, 1e-12);
        (residual, newton.force, step)
    }

    /// As long as no spring comes or goes, a step solves (1 + mu) K du + B du = r, curvature included.
    #[test]
    fn a_step_solves_the_damped_newton_equation() {
        for kind in [SpringKind::Isotropic, SpringKind::Axial] {
            let object = ball(kind);
            for damping in [0.0, 1.0, 50.0] {
                let sample = sample(&object, 30.0, 0.1);
                let (residual, force, step) = step(&sample, damping);
                assert_eq!(step.damping, damping);
                let size = residual.iter().fold(0.0_f64, |size, entry| size.max(entry.abs()));
                assert!(off(&sample.resist(1.0 + damping, &force), &residual) < 1e-9 * size, "{damping}");
                assert!(off(&sample.resist(1.01 + damping, &force), &residual) > 1e-6 * size, "{damping}");
            }
        }
    }

    /// Where curvature outweighs the object's stiffness, damping makes up for it, and the step leads downhill.
    #[test]
    fn negative_curvature_asks_for_damping() {
        let object = ball(SpringKind::Isotropic);
        let sample = sample(&object, 30.0, 1e3);
        let (residual, force, step) = step(&sample, 0.0);
        assert!(step.damping > 1.0 && step.predicted > 0.0 && step.length > 0.0, "{step:?}");
        let mut displacement = vec![0.0; force.len()];
        sample.support().multiply(&force, &mut displacement);
        assert!(dot(&residual, &displacement) > 0.0);
    }

    /// However damped, a step meets stiff springs nearly in full.
    #[test]
    fn damped_steps_meet_stiff_springs_first() {
        let object = ball(SpringKind::Isotropic);
        let sample = sample(&object, 1e7, 0.0);
        let steps = [0.0, 100.0].map(|damping| step(&sample, damping).2);
        assert!(steps[1].predicted > 0.99 * steps[0].predicted, "{steps:?}");
    }

    #[test]
    fn damping_grows_faster_from_refusal_to_refusal_and_fades() {
        let mut damping = Damping::default();
        damping.increase();
        damping.increase();
        let after_two = damping.multiple;
        assert_eq!(after_two, LEAST_DAMPING * DAMPING_GROWTH * (2.0 * DAMPING_GROWTH));
        damping.decrease(false);
        assert_eq!(damping.multiple, after_two);
        damping.increase();
        assert_eq!(damping.multiple, after_two * DAMPING_GROWTH);
        for _ in 0..20 {
            damping.decrease(true);
        }
        assert_eq!(damping.multiple, 0.0);
    }
}
