//! One trust-region Newton step of the energy form, by truncated conjugate gradients (Steihaug 1983, Toint 1981).
//!
//! The energy along a displacement du = C df of the object, f being the forces that hold the displacement u = C f:
//! `m(df) = u . df + 1/2 df . C df + 1/2 kc sum_i max(0, depth_i + g_i . du)^2 + 1/2 sum_i lambda_i d2s_i(du, du)`,
//! on the ball df . C df <= radius^2, with g_i the depth's gradient. Two things make it a better model than the plain second
//! derivative of the energy, and neither costs a detection:
//! - the maximum is kept, so contacts may come and go within a step: a pass of conjugate gradients for the contacts that
//!   touch is followed by another where the step has changed which do; with [`Care::Thorough`] one that leads uphill is followed
//!   back to the least energy on its way, so that the passes end at the minimum for any number of contacts;
//! - curvature is weighted by the multiplier lambda_i that the step before predicted, not by kc depth_i, which at stiff contact
//!   is far too large until the depth has settled (as in sequential quadratic programming). Both agree in the end,
//!   so convergence stays quadratic.
//!
//! Conjugate gradients on H = K + B, B the Hessian of the contact terms, preconditioned by C, keep each search direction
//! twice, as a force pi and as the displacement p = C pi, so that H p = pi + B p needs no K. One product with C_AA is
//! spent per iteration, that of the preconditioner; p = z + beta p follows from pi = r + beta pi. B has a rank of at most five per
//! contact, so few iterations are needed whatever the object's size. Negative curvature and long steps go to the
//! ball's boundary.

// Indexed loops as in the kernel of the same name.
#![allow(clippy::needless_range_loop)]

use super::blend::{RowChange, deepening, strength, together, vary};
use super::depth::{Contact, second_variation, stiffness_product};
use super::series::{bear, common_change};
use super::support::{Support, dot, root};
use crate::tolerances::{
    INNER_ITERATIONS_PER_UNKNOWN, MODEL_PASSES, STEP_BACK_HALVINGS, THOROUGH_MODEL_PASSES, WALL_COMPLIANCE,
};
use glam::DVec3;

/// Contacts, where their nodes are on the support, and their stiffness.
#[derive(Clone, Copy)]
pub struct Springs<'a> {
    /// The contacts and near misses.
    pub contacts: &'a [Contact],
    /// Slots of each contact's three nodes.
    pub slots: &'a [[usize; 3]],
    /// kc [N/m].
    pub kc: f64,
}

/// How much is done for a step.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Care {
    /// What nearly all configurations converge with.
    Quick,
    /// What the others need: a ball's side is made sure of, passes go on to the model's minimum, and a step that E refuses gets a
    /// second chance.
    Thorough,
}

/// What a step promises.
#[derive(Clone, Copy, Debug)]
pub struct Step {
    /// Decrease of the energy by the model [J].
    pub predicted: f64,
    /// Length in the energy norm, sqrt(df . C df) [sqrt(J)].
    pub length: f64,
    /// Whether the ball's boundary stopped it.
    pub at_boundary: bool,
}

/// Vectors on the support, reused from step to step.
#[derive(Default)]
pub struct TrustRegion {
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
    residual: Vec<f64>,
    preconditioned: Vec<f64>,
    direction_force: Vec<f64>,
    direction: Vec<f64>,
    image: Vec<f64>,
    /// What happens to the rows of one depth.
    own: Vec<RowChange>,
    /// Of each depth on the way back: kc times its change, where it starts, and its change.
    springs_on_the_way: Vec<[f64; 3]>,
    /// Of each wall: where its depth starts, and its change; and how many walls each ball has.
    walls_on_the_way: Vec<[f64; 2]>,
    walls: Vec<usize>,
}

impl TrustRegion {
    /// Step for the residual force r = c(u) - f, given with C r, within `radius`, solved to `tolerance` relative to it in the
    /// energy norm. The step is left in `self.force`, what contacts bear after it in `self.bears`.
    pub fn step(
        &mut self,
        support: &Support,
        springs: Springs,
        (residual, preconditioned): (&[f64], &[f64]),
        radius: f64,
        tolerance: f64,
        care: Care,
    ) -> Step {
        self.reset(support.order(), springs.contacts);
        self.residual.copy_from_slice(residual);
        self.preconditioned.copy_from_slice(preconditioned);
        let stop = tolerance * tolerance * dot(&self.residual, &self.preconditioned);
        let mut predicted = 0.0;
        let mut at_boundary = false;
        let mut left = INNER_ITERATIONS_PER_UNKNOWN * support.order();
        let passes = if care == Care::Thorough { THOROUGH_MODEL_PASSES } else { MODEL_PASSES };
        for pass in 0..passes {
            self.previous_force.copy_from_slice(&self.force);
            self.previous_displacement.copy_from_slice(&self.displacement);
            let mut stopped = self.conjugate_gradients(support, springs, radius, stop, &mut left);
            let mut decrease = self.assess(springs, residual);
            if care == Care::Thorough && decrease <= predicted {
                self.step_back(springs, residual);
                decrease = self.assess(springs, residual);
                stopped = false;
            }
            if pass > 0 && (decrease <= predicted || decrease.is_nan()) {
                // Contacts came and went to no avail: the pass before was better.
                std::mem::swap(&mut self.force, &mut self.previous_force);
                std::mem::swap(&mut self.displacement, &mut self.previous_displacement);
                self.assess(springs, residual);
                break;
            }
            predicted = decrease;
            at_boundary = stopped;
            if !self.retouch(springs.contacts) {
                break;
            }
            self.balance(springs, residual);
            support.multiply(&self.residual, &mut self.preconditioned);
        }
        let length = root(dot(&self.force, &self.displacement));
        Step { predicted, length, at_boundary }
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
            &mut self.preconditioned,
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

    /// Goes on from the current step for the contacts that touch, until the residual's squared energy norm is at most
    /// `stop` or no iterations are `left`; true when the boundary stopped it.
    fn conjugate_gradients(
        &mut self,
        support: &Support,
        springs: Springs,
        radius: f64,
        stop: f64,
        left: &mut usize,
    ) -> bool {
        self.direction_force.copy_from_slice(&self.residual);
        self.direction.copy_from_slice(&self.preconditioned);
        let mut square = dot(&self.residual, &self.preconditioned);
        while *left > 0 && square > stop {
            *left -= 1;
            self.image.copy_from_slice(&self.direction_force);
            add_contact_hessian(springs, &self.touching, &self.direction, &mut self.own, &mut self.image);
            let curvature = dot(&self.direction, &self.image);
            let to_boundary = self.share_to_boundary(radius);
            let share = square / curvature;
            let inside = curvature > 0.0 && share < to_boundary;
            let share = if inside { share } else { to_boundary };
            add_scaled(share, &self.direction_force, &mut self.force);
            add_scaled(share, &self.direction, &mut self.displacement);
            add_scaled(-share, &self.image, &mut self.residual);
            if !inside {
                return true;
            }
            support.multiply(&self.residual, &mut self.preconditioned);
            let next = dot(&self.residual, &self.preconditioned);
            let ratio = next / square;
            square = next;
            turn(ratio, &self.residual, &mut self.direction_force);
            turn(ratio, &self.preconditioned, &mut self.direction);
        }
        false
    }

    /// The share of the direction that leads from the current step to the boundary: the positive root t of
    /// |step + t direction|^2 = radius^2 in the energy norm.
    fn share_to_boundary(&self, radius: f64) -> f64 {
        let step_square = dot(&self.force, &self.displacement);
        let mixed = dot(&self.force, &self.direction);
        let direction_square = dot(&self.direction_force, &self.direction);
        if direction_square <= 0.0 {
            return 0.0;
        }
        let left = (radius * radius - step_square).max(0.0);
        // The form of the root that does not cancel when `mixed` is positive.
        let root = (mixed * mixed + direction_square * left).sqrt();
        if mixed > 0.0 { left / (mixed + root) } else { (root - mixed) / direction_square }
    }

    /// What the step deepens each contact by, g_i . du; returns m(0) - m(df), in differences that do not cancel near the
    /// solution [J].
    fn assess(&mut self, springs: Springs, residual: &[f64]) -> f64 {
        let mut decrease = dot(&self.displacement, residual) - 0.5 * dot(&self.displacement, &self.force);
        let Self { deepening: all, bears, displacement, own, .. } = self;
        springs.for_each_depth(|first, rows| {
            let v = |k: usize| nodes_of(displacement, springs.slots[first + k]);
            if rows[0].wall.is_some() {
                let changes = &mut all[first..first + rows.len()];
                let bears = &mut bears[first..first + rows.len()];
                for (k, row) in rows.iter().enumerate() {
                    changes[k] = row.deepening(v(k));
                    if row.multiplier != 0.0 {
                        decrease -= 0.5 * row.multiplier * inner(v(k), second_variation(row, v(k)));
                    }
                }
                bear(|k| rows[k].depth + changes[k], bears);
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
            let Contact { depth, multiplier, .. } = rows[0];
            let deepening = deepening(rows, v, own);
            all[first..first + rows.len()].fill(deepening);
            bears[first..first + rows.len()].fill((depth + deepening).max(0.0));
            let before = depth.max(0.0);
            let after = (depth + deepening).max(0.0);
            // The part of 1/2 kc depth^2 that is of first order is in the residual.
            let stretch = if before > 0.0 && after > 0.0 {
                deepening * deepening
            } else {
                after * after - before * (before + 2.0 * deepening)
            };
            let mut bending = 0.0;
            vary(rows, v, own, |k, bend| bending += inner(v(k), bend));
            let share = strength(rows);
            decrease -= 0.5 * (share * springs.kc * stretch + multiplier * bending);
        });
        decrease
    }

    /// Goes back along the last pass to where the model's energy, quadratic piece by piece on the way, is least.
    fn step_back(&mut self, springs: Springs, residual: &[f64]) {
        let Self { force, displacement, previous_force, previous_displacement, direction_force, .. } = self;
        let (direction, own, springs_on_the_way) = (&mut self.direction, &mut self.own, &mut self.springs_on_the_way);
        let (walls_on_the_way, walls, pushes) = (&mut self.walls_on_the_way, &mut self.walls, &mut self.bears);
        walls_on_the_way.clear();
        walls.clear();
        for k in 0..force.len() {
            direction_force[k] = force[k] - previous_force[k];
            direction[k] = displacement[k] - previous_displacement[k];
        }
        // The energy falls, at the share t of the way, by slope - bend t - sum_i weight_i max(0, depth_i + change_i t).
        let mut slope = dot(direction, residual) - dot(direction, previous_force);
        let mut bend = dot(direction, direction_force);
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
                        let turned = second_variation(row, along(k));
                        slope -= row.multiplier * inner(before(k), turned);
                        bend += row.multiplier * inner(along(k), turned);
                    }
                    walls_on_the_way.push([row.depth + row.deepening(before(k)), change]);
                }
                return;
            }
            let Contact { depth, multiplier, .. } = rows[0];
            let start = depth + deepening(rows, before, own);
            vary(rows, before, own, |k, part| slope -= multiplier * inner(along(k), part));
            let change = deepening(rows, along, own);
            vary(rows, along, own, |k, part| bend += multiplier * inner(along(k), part));
            let weight = springs.kc * strength(rows) * change;
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
                bear(|k| walls[k][0] + t * walls[k][1], &mut pushes[..count]);
                let work = walls.iter().zip(&*pushes).map(|([_, change], push)| change * push);
                sum += springs.kc * work.sum::<f64>();
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
            self.residual[k] = residual[k] - self.force[k];
        }
        let Self { displacement, own, residual, bears, .. } = self;
        springs.for_each_depth(|first, rows| {
            let v = |k: usize| nodes_of(displacement, springs.slots[first + k]);
            if rows[0].wall.is_some() {
                for (k, row) in rows.iter().enumerate() {
                    let push = springs.kc * (bears[first + k] - row.bears());
                    add_on_nodes(wall_forces(row, push, v(k)).map(|force| -force), springs.slots[first + k], residual);
                }
                return;
            }
            let Contact { depth, multiplier, .. } = rows[0];
            let push = springs.kc * ((depth + deepening(rows, v, own)).max(0.0) - depth.max(0.0));
            vary(rows, v, own, |k, bend| {
                let spread = rows[k].spread(push);
                let force = [0, 1, 2].map(|j| -(spread[j] + bend[j] * multiplier));
                add_on_nodes(force, springs.slots[first + k], residual);
            });
        });
    }
}

impl<'a> Springs<'a> {
    /// Visits the rows of each depth, with the place of the first.
    fn for_each_depth(self, mut visit: impl FnMut(usize, &'a [Contact])) {
        let mut first = 0;
        for rows in self.contacts.chunk_by(together) {
            visit(first, rows);
            first += rows.len();
        }
    }
}

/// Adds B p, the product of the Hessian of the contact terms with the displacement `p` on the support, to `product`.
fn add_contact_hessian(springs: Springs, touching: &[bool], p: &[f64], own: &mut Vec<RowChange>, product: &mut [f64]) {
    springs.for_each_depth(|first, rows| {
        let multiplier = rows[0].multiplier;
        if rows[0].wall.is_some() {
            let v = |k: usize| nodes_of(p, springs.slots[first + k]);
            let bearing = rows.iter().enumerate().filter(|&(k, _)| touching[first + k]);
            let common = common_change(bearing.map(|(k, row)| row.deepening(v(k))));
            for (k, row) in rows.iter().enumerate() {
                let touches = touching[first + k];
                if touches || row.multiplier != 0.0 {
                    let change = if touches { (row.deepening(v(k)) - common) / WALL_COMPLIANCE } else { 0.0 };
                    add_on_nodes(wall_forces(row, springs.kc * change, v(k)), springs.slots[first + k], product);
                }
            }
            return;
        }
        if !touching[first] && multiplier == 0.0 {
            return;
        }
        let kc = if touching[first] { springs.kc } else { 0.0 };
        if let [contact] = rows
            && contact.part.is_none()
        {
            let slots = springs.slots[first];
            return add_on_nodes(stiffness_product(contact, kc, nodes_of(p, slots)), slots, product);
        }
        let v = |k: usize| nodes_of(p, springs.slots[first + k]);
        let push = kc * deepening(rows, v, own);
        vary(rows, v, own, |k, bend| {
            let spread = rows[k].spread(push);
            add_on_nodes([0, 1, 2].map(|j| spread[j] + bend[j] * multiplier), springs.slots[first + k], product);
        });
    });
}

/// What a wall that bears `push` more, bent by displacements `v` of its nodes, resists with at each of them [N].
fn wall_forces(row: &Contact, push: f64, v: [DVec3; 3]) -> [DVec3; 3] {
    let straight = row.spread(push);
    if row.multiplier == 0.0 {
        return straight;
    }
    let bent = second_variation(row, v);
    [0, 1, 2].map(|j| straight[j] + bent[j] * row.multiplier)
}

/// Adds the forces of the contact springs on the object's nodes, -kc depth_i w_ij N_i, to `forces` on the support.
pub fn add_contact_forces(springs: Springs, forces: &mut [f64]) {
    for (contact, &slots) in springs.contacts.iter().zip(springs.slots) {
        add_on_nodes(contact.spread(-springs.kc * contact.bears()), slots, forces);
    }
}

/// The three nodes' parts of a vector on the support.
#[inline]
fn nodes_of(vector: &[f64], [a, b, c]: [usize; 3]) -> [DVec3; 3] {
    let (nodes, _) = vector.as_chunks();
    [DVec3::from_array(nodes[a]), DVec3::from_array(nodes[b]), DVec3::from_array(nodes[c])]
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

/// Adds one vector for each of three nodes to a vector on the support.
#[inline]
fn add_on_nodes(parts: [DVec3; 3], slots: [usize; 3], vector: &mut [f64]) {
    let (nodes, _) = vector.as_chunks_mut();
    for (part, slot) in parts.into_iter().zip(slots) {
        let node: &mut [f64; 3] = &mut nodes[slot];
        *node = (DVec3::from_array(*node) + part).to_array();
    }
}
