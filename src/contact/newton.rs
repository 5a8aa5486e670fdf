//! One damped Newton step of the energy form (Levenberg 1944, Marquardt 1963), by conjugate gradients.
//!
//! The energy along a displacement du = C df of the object, f being the forces that hold the displacement u = C f:
//! `m(df) = u . df + 1/2 (1 + mu) df . C df + 1/2 sum_i kc_i max(0, depth_i + g_i . du)^2 + 1/2 sum_i lambda_i d2s_i(du, du)`,
//! with g_i the depth's gradient and mu the damping, a multiple of the object's own stiffness: so stiff springs are met first, however
//! short the step. Two things make it a better model than the plain second derivative of the energy, and neither costs a detection:
//! - the maximum is kept, so contacts may come and go within a step: a pass of conjugate gradients for the contacts that
//!   touch is followed by another where the step has changed which do; with [`Care::Thorough`] one that leads uphill is followed
//!   back to the least energy on its way, so that the passes end at the minimum for any number of contacts;
//! - curvature is weighted by the multiplier lambda_i that the step before predicted, not by kc depth_i, which at stiff contact
//!   is far too large until the depth has settled (as in sequential quadratic programming). Both agree in the end,
//!   so convergence stays quadratic.
//!
//! Conjugate gradients on H = (1 + mu) K + B, B the Hessian of the contact terms, preconditioned by what the springs leave of C
//! ([`super::relief`]), keep each search direction twice, as a force pi and as the displacement p = C pi, so that
//! H p = (1 + mu) pi + B p needs no K. One product with C_AA is spent per iteration, that of the preconditioner. What it does not know
//! of B, how contacts bend, has a rank of at most four per contact, so few iterations are needed whatever the object's size and the
//! springs' stiffness. Negative curvature asks for more damping, or with [`Care::Convex`] for a model without it: a wall's second
//! variation is the difference of two squares, of which the positive one is kept.

// Indexed loops as in shaders/trust_region.wgsl.
#![allow(clippy::needless_range_loop)]

use super::depth::{Contact, second_variation};
use super::relief::Relief;
use super::series::bear;
use super::springs::{Bending, Springs, add_contact_hessian, add_on_nodes, nodes_of};
use super::support::{Support, dot, root};
use crate::tolerances::{
    CONVEX_TOLERANCE, CURVATURE_MARGIN, DAMPING_ATTEMPTS, DAMPING_DECAY, DAMPING_GROWTH, INNER_ITERATIONS_PER_UNKNOWN,
    LEAST_DAMPING, MODEL_PASSES, RESPONSE_TOLERANCE, STEP_BACK_HALVINGS, THOROUGH_MODEL_PASSES,
};
use glam::DVec3;

/// How much is done for a step.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Care {
    /// What nearly all configurations converge with.
    Quick,
    /// What the others need: a ball's side is made sure of, passes go on to the model's minimum, and a step that E refuses gets a
    /// second chance.
    Thorough,
    /// As thorough, and where the model is not convex, the negative part of the walls' curvature is left out instead of damped.
    Convex,
}

impl Care {
    /// Whether more is done than is quick.
    pub fn is_thorough(self) -> bool {
        self != Self::Quick
    }
}

/// How much the model is damped: more from step to step where E refuses them, less where it keeps what they promise (Nielsen 1999).
#[derive(Clone, Copy, Debug)]
pub struct Damping {
    /// mu, zero or [`LEAST_DAMPING`] and more [1].
    pub multiple: f64,
    /// What the next refusal multiplies it by.
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

/// What a step promises.
#[derive(Clone, Copy, Debug)]
pub struct Step {
    /// Decrease of the energy by the model without damping; not a number where no damping was enough [J].
    pub predicted: f64,
    /// Length in the energy norm, sqrt(df . C df) [sqrt(J)].
    pub length: f64,
    /// The damping mu with which the model is convex [1].
    pub damping: f64,
}

/// Vectors on the support, reused from step to step.
#[derive(Default)]
pub struct Newton {
    /// The step df [N].
    pub force: Vec<f64>,
    /// What each contact bears after the step, to first order, over kc [m].
    pub bears: Vec<f64>,
    /// What the step deepens each contact by, to first order [m].
    deepening: Vec<f64>,
    /// The step du = C df on the support [m].
    displacement: Vec<f64>,
    /// The step of the pass before.
    previous_force: Vec<f64>,
    previous_displacement: Vec<f64>,
    /// Which contacts touch, in this pass.
    touching: Vec<bool>,
    /// Times K, what the object resists with: 1 + mu [1].
    stiffening: f64,
    residual: Vec<f64>,
    /// C times the residual.
    product: Vec<f64>,
    relief: Relief,
    /// The residual preconditioned, as force and as displacement.
    relieved_force: Vec<f64>,
    relieved: Vec<f64>,
    direction_force: Vec<f64>,
    direction: Vec<f64>,
    image: Vec<f64>,
    /// Of each depth on the way back: its spring's stiffness times its change, where it starts, and its change.
    springs_on_the_way: Vec<[f64; 3]>,
    /// The same of each wall; and how many walls each ball has.
    walls_on_the_way: Vec<[f64; 3]>,
    walls: Vec<usize>,
}

impl Newton {
    /// Step for the residual force r = c(u) - f, given with C r, damped by `damping` or as much more as makes the model convex, and
    /// solved to `tolerance` relative to the residual, in the norm of the preconditioner. The step is left in `self.force`, what
    /// contacts bear after it in `self.bears`.
    pub fn step(
        &mut self,
        support: &Support,
        springs: Springs,
        residual: (&[f64], &[f64]),
        mut damping: f64,
        mut tolerance: f64,
        care: Care,
    ) -> Step {
        let mut model = springs;
        for _ in 0..DAMPING_ATTEMPTS {
            self.stiffening = 1.0 + damping;
            match self.minimise(support, model, residual, tolerance, care) {
                Ok(decrease) => {
                    let decrease =
                        if model.bending == Bending::Exact { decrease } else { self.assess(springs, residual.0) };
                    let square = dot(&self.force, &self.displacement);
                    return Step { predicted: decrease + 0.5 * damping * square, length: root(square), damping };
                }
                Err(_) if care == Care::Convex && model.bending == Bending::Exact => {
                    model.bending = Bending::Convex;
                    tolerance = tolerance.max(CONVEX_TOLERANCE);
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
        self.relief.set_up(support, springs, &self.touching, self.stiffening);
    }

    /// The displacement du on the support with which (K + B) du is the force `load` on the support, B the Hessian of the contacts given to
    /// [`Newton::factorise`]; `None` where K + B is not positive definite [m].
    pub fn respond(&mut self, support: &Support, springs: Springs, load: &[f64]) -> Option<&[f64]> {
        self.force.fill(0.0);
        self.displacement.fill(0.0);
        self.residual.copy_from_slice(load);
        support.multiply(&self.residual, &mut self.product);
        self.relieve(springs);
        let stop = RESPONSE_TOLERANCE * RESPONSE_TOLERANCE * dot(&self.residual, &self.relieved);
        let mut left = INNER_ITERATIONS_PER_UNKNOWN * support.order();
        self.conjugate_gradients(support, springs, stop, &mut left).ok()?;
        Some(&self.displacement)
    }

    /// The least of the damped model, and by how much it is less than at the start [J]; or what damping lacks where it is not convex.
    fn minimise(
        &mut self,
        support: &Support,
        springs: Springs,
        (residual, product): (&[f64], &[f64]),
        tolerance: f64,
        care: Care,
    ) -> Result<f64, f64> {
        self.reset(support.order(), springs.contacts);
        self.residual.copy_from_slice(residual);
        self.product.copy_from_slice(product);
        let mut stop = 0.0;
        let mut predicted = 0.0;
        let mut left = INNER_ITERATIONS_PER_UNKNOWN * support.order();
        let passes = if care.is_thorough() { THOROUGH_MODEL_PASSES } else { MODEL_PASSES };
        for pass in 0..passes {
            self.previous_force.copy_from_slice(&self.force);
            self.previous_displacement.copy_from_slice(&self.displacement);
            self.relief.set_up(support, springs, &self.touching, self.stiffening);
            self.relieve(springs);
            if pass == 0 {
                stop = tolerance * tolerance * dot(&self.residual, &self.relieved);
            }
            self.conjugate_gradients(support, springs, stop, &mut left)?;
            let mut decrease = self.assess(springs, residual);
            if care.is_thorough() && decrease <= predicted {
                self.step_back(springs, residual);
                decrease = self.assess(springs, residual);
            }
            if pass > 0 && (decrease <= predicted || decrease.is_nan()) {
                // Contacts came and went to no avail: the pass before was better.
                std::mem::swap(&mut self.force, &mut self.previous_force);
                std::mem::swap(&mut self.displacement, &mut self.previous_displacement);
                self.assess(springs, residual);
                break;
            }
            predicted = decrease;
            if !self.retouch(springs.contacts) {
                break;
            }
            self.balance(springs, residual);
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
            &mut self.relieved_force,
            &mut self.relieved,
            &mut self.direction_force,
            &mut self.direction,
            &mut self.image,
        ] {
            vector.resize(order, 0.0);
        }
        self.deepening.clear();
        self.deepening.resize(contacts.len(), 0.0);
        self.touching.clear();
        self.touching.extend(contacts.iter().map(|contact| contact.bears() > 0.0));
        self.bears.clear();
        self.bears.resize(contacts.len(), 0.0);
    }

    /// Goes on from the current step for the contacts that touch, until the preconditioned residual's square is at most `stop` or no
    /// iterations are `left`; where the model is not convex, ends with what damping lacks, by the direction that shows it.
    fn conjugate_gradients(
        &mut self,
        support: &Support,
        springs: Springs,
        stop: f64,
        left: &mut usize,
    ) -> Result<(), f64> {
        self.direction_force.copy_from_slice(&self.relieved_force);
        self.direction.copy_from_slice(&self.relieved);
        let mut square = dot(&self.residual, &self.relieved);
        while *left > 0 && square > stop {
            *left -= 1;
            for k in 0..self.image.len() {
                self.image[k] = self.stiffening * self.direction_force[k];
            }
            add_contact_hessian(springs, &self.touching, &self.direction, &mut self.image);
            let curvature = dot(&self.direction, &self.image);
            if curvature <= 0.0 {
                return Err(-curvature / dot(&self.direction, &self.direction_force));
            }
            let share = square / curvature;
            add_scaled(share, &self.direction_force, &mut self.force);
            add_scaled(share, &self.direction, &mut self.displacement);
            add_scaled(-share, &self.image, &mut self.residual);
            support.multiply(&self.residual, &mut self.product);
            self.relieve(springs);
            let next = dot(&self.residual, &self.relieved);
            let ratio = next / square;
            square = next;
            turn(ratio, &self.relieved_force, &mut self.direction_force);
            turn(ratio, &self.relieved, &mut self.direction);
        }
        Ok(())
    }

    /// Preconditions the residual.
    fn relieve(&mut self, springs: Springs) {
        let Self { relief, residual, product, relieved_force, relieved, .. } = self;
        relief.apply(springs, (residual, product), relieved_force, relieved);
    }

    /// What the step deepens each contact by, g_i . du; returns m(0) - m(df), in differences that do not cancel near the
    /// solution [J].
    fn assess(&mut self, springs: Springs, residual: &[f64]) -> f64 {
        let own = 0.5 * self.stiffening * dot(&self.displacement, &self.force);
        let mut decrease = dot(&self.displacement, residual) - own;
        let Self { deepening: all, bears, displacement, .. } = self;
        springs.for_each_depth(|first, rows| {
            let v = |k: usize| nodes_of(displacement, springs.slots[first + k]);
            if rows[0].wall.is_some() {
                let changes = &mut all[first..first + rows.len()];
                let bears = &mut bears[first..first + rows.len()];
                for (k, row) in rows.iter().enumerate() {
                    changes[k] = row.deepening(v(k));
                    if row.multiplier != 0.0 {
                        decrease -= 0.5 * inner(v(k), springs.bent(row, v(k)));
                    }
                }
                bear(|k| rows[k].depth + changes[k], bears);
                bears.iter_mut().zip(rows).for_each(|(bears, row)| *bears *= row.share);
                let same = rows.iter().zip(&*bears).all(|(row, bears)| (row.bears() > 0.0) == (*bears > 0.0));
                let stretch = |((row, bears), change): ((&Contact, &f64), &f64)| {
                    if same {
                        (bears - row.bears()) * change
                    } else {
                        bears * (row.depth + change) - row.bears() * (row.depth + 2.0 * change)
                    }
                };
                decrease -= 0.5 * springs.kc * rows.iter().zip(&*bears).zip(&*changes).map(stretch).sum::<f64>();
                return;
            }
            let Contact { depth, share, multiplier, .. } = rows[0];
            let deepening = rows[0].deepening(v(0));
            all[first] = deepening;
            bears[first] = share * (depth + deepening).max(0.0);
            let before = depth.max(0.0);
            let after = (depth + deepening).max(0.0);
            // The part of 1/2 kc depth^2 that is of first order is in the residual.
            let stretch = if before > 0.0 && after > 0.0 {
                deepening * deepening
            } else {
                after * after - before * (before + 2.0 * deepening)
            };
            let bending = inner(v(0), second_variation(&rows[0], v(0)));
            decrease -= 0.5 * (springs.kc * share * stretch + multiplier * bending);
        });
        decrease
    }

    /// Goes back along the last pass to where the model's energy, quadratic piece by piece on the way, is least.
    fn step_back(&mut self, springs: Springs, residual: &[f64]) {
        let Self { force, displacement, previous_force, previous_displacement, direction_force, stiffening, .. } = self;
        let (direction, springs_on_the_way) = (&mut self.direction, &mut self.springs_on_the_way);
        let (walls_on_the_way, walls, pushes) = (&mut self.walls_on_the_way, &mut self.walls, &mut self.bears);
        walls_on_the_way.clear();
        walls.clear();
        for k in 0..force.len() {
            direction_force[k] = force[k] - previous_force[k];
            direction[k] = displacement[k] - previous_displacement[k];
        }
        // The energy falls, at the share t of the way, by slope - bend t - sum_i weight_i max(0, depth_i + change_i t).
        let mut slope = dot(direction, residual) - *stiffening * dot(direction, previous_force);
        let mut bend = *stiffening * dot(direction, direction_force);
        springs_on_the_way.clear();
        springs.for_each_depth(|first, rows| {
            let before = |k: usize| nodes_of(previous_displacement, springs.slots[first + k]);
            let along = |k: usize| nodes_of(direction, springs.slots[first + k]);
            if rows[0].wall.is_some() {
                walls.push(rows.len());
                for (k, row) in rows.iter().enumerate() {
                    let change = row.deepening(along(k));
                    slope += springs.kc * row.bears() * change;
                    if row.multiplier != 0.0 {
                        let turned = springs.bent(row, along(k));
                        slope -= inner(before(k), turned);
                        bend += inner(along(k), turned);
                    }
                    let start = row.depth + row.deepening(before(k));
                    walls_on_the_way.push([springs.kc * row.share * change, start, change]);
                }
                return;
            }
            let Contact { depth, multiplier, .. } = rows[0];
            let turned = second_variation(&rows[0], along(0));
            slope -= multiplier * inner(before(0), turned);
            bend += multiplier * inner(along(0), turned);
            let (start, change) = (depth + rows[0].deepening(before(0)), rows[0].deepening(along(0)));
            let weight = springs.kc * rows[0].share * change;
            slope += weight * depth.max(0.0);
            springs_on_the_way.push([weight, start, change]);
        });
        let mut falls = |t: f64| {
            let own = springs_on_the_way.iter().map(|[weight, start, change]| weight * (start + t * change).max(0.0));
            let mut sum: f64 = own.sum();
            let mut rest = &walls_on_the_way[..];
            for &count in walls.iter() {
                let (walls, others) = rest.split_at(count);
                rest = others;
                bear(|k| walls[k][1] + t * walls[k][2], &mut pushes[..count]);
                sum += walls.iter().zip(&*pushes).map(|([weight, ..], push)| weight * push).sum::<f64>();
            }
            slope - bend * t > sum
        };
        let (mut low, mut high) = (0.0, 1.0);
        for _ in 0..STEP_BACK_HALVINGS {
            let middle = 0.5 * (low + high);
            if falls(middle) {
                low = middle;
            } else {
                high = middle;
            }
        }
        for k in 0..force.len() {
            force[k] = previous_force[k] + low * direction_force[k];
            displacement[k] = previous_displacement[k] + low * direction[k];
        }
    }

    /// Notes which contacts touch at the step; true when that has changed.
    fn retouch(&mut self, contacts: &[Contact]) -> bool {
        let mut changed = false;
        for k in 0..contacts.len() {
            let touches = self.bears[k] > 0.0;
            changed |= touches != self.touching[k];
            self.touching[k] = touches;
        }
        changed
    }

    /// Residual force of the model at the step.
    fn balance(&mut self, springs: Springs, residual: &[f64]) {
        for k in 0..residual.len() {
            self.residual[k] = residual[k] - self.stiffening * self.force[k];
        }
        let Self { displacement, residual, bears, .. } = self;
        springs.for_each_depth(|first, rows| {
            let v = |k: usize| nodes_of(displacement, springs.slots[first + k]);
            if rows[0].wall.is_some() {
                for (k, row) in rows.iter().enumerate() {
                    let push = springs.kc * (bears[first + k] - row.bears());
                    add_on_nodes(
                        springs.wall_forces(row, push, v(k)).map(|force| -force),
                        springs.slots[first + k],
                        residual,
                    );
                }
                return;
            }
            let Contact { depth, share, multiplier, .. } = rows[0];
            let push = springs.kc * share * ((depth + rows[0].deepening(v(0))).max(0.0) - depth.max(0.0));
            let (spread, bend) = (rows[0].spread(push), second_variation(&rows[0], v(0)));
            add_on_nodes([0, 1, 2].map(|j| -(spread[j] + bend[j] * multiplier)), springs.slots[first], residual);
        });
    }
}

/// sum += share * direction.
fn add_scaled(share: f64, direction: &[f64], sum: &mut [f64]) {
    for (sum, direction) in sum.iter_mut().zip(direction) {
        *sum += share * direction;
    }
}

/// direction = residual + ratio * direction.
fn turn(ratio: f64, residual: &[f64], direction: &mut [f64]) {
    for (direction, residual) in direction.iter_mut().zip(residual) {
        *direction = residual + ratio * *direction;
    }
}

fn inner(a: [DVec3; 3], b: [DVec3; 3]) -> f64 {
    a[0].dot(b[0]) + a[1].dot(b[1]) + a[2].dot(b[2])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::contact::springs::add_contact_forces;
    use crate::contact::springs::samples::{Sample, ball, off, sample};
    use crate::scene::SpringKind;

    /// The contact forces at rest, and the quick step that they lead to with `damping`.
    fn step(sample: &Sample, damping: f64) -> (Vec<f64>, Vec<f64>, Step) {
        step_with(sample, damping, Care::Quick)
    }

    fn step_with(sample: &Sample, damping: f64, care: Care) -> (Vec<f64>, Vec<f64>, Step) {
        let order = sample.support().order();
        let (mut residual, mut product) = (vec![0.0; order], vec![0.0; order]);
        add_contact_forces(sample.springs(), &mut residual);
        sample.support().multiply(&residual, &mut product);
        let mut newton = Newton::default();
        let springs = sample.springs();
        let step = newton.step(sample.support(), springs, (&residual, &product), damping, 1e-12, care);
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

    /// Where walls curve so that the model is not convex, a step that leaves that out needs no damping, and leads downhill all the same.
    #[test]
    fn a_convex_step_needs_no_damping_of_balls() {
        let object = ball(SpringKind::Isotropic);
        let sample = sample(&object, 30.0, 1e3).of_balls();
        let quick = step(&sample, 0.0).2;
        let (residual, force, convex) = step_with(&sample, 0.0, Care::Convex);
        assert!(quick.damping > 1.0 && convex.damping == 0.0, "{quick:?} {convex:?}");
        let mut displacement = vec![0.0; force.len()];
        sample.support().multiply(&force, &mut displacement);
        assert!(dot(&residual, &displacement) > 0.0 && convex.predicted > 0.0, "{convex:?}");
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
