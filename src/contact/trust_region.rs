//! One trust-region Newton step of the energy form, by truncated conjugate gradients (Steihaug 1983, Toint 1981).
//!
//! The model of the energy along a displacement du = C df, with residual force r = c(u) - f (c the contact forces, f the
//! forces that hold the displacement u = C f) and B the Hessian of the contact springs:
//! `m(df) = -r . C df + 1/2 df . C df + 1/2 (C df) . B (C df)`, on the ball df . C df <= radius^2.
//!
//! Conjugate gradients on H = K + B preconditioned by C keep each search direction twice, as a force pi and as the
//! displacement p = C pi, so that H p = pi + B p needs no K. One product with C_AA is spent per iteration, that of the
//! preconditioner, and p = z + beta p follows from pi = r + beta pi. B has a rank of at most five per contact, so few iterations
//! are needed whatever the object's size. Negative curvature and long steps go to the ball's boundary.

use super::depth::{Contact, hessian_product};
use super::support::{Support, dot};
use crate::tolerances::INNER_ITERATIONS_PER_UNKNOWN;
use glam::DVec3;

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
    /// The step: force df [N] and displacement du = C df on the support [m].
    pub force: Vec<f64>,
    displacement: Vec<f64>,
    residual: Vec<f64>,
    preconditioned: Vec<f64>,
    direction_force: Vec<f64>,
    direction: Vec<f64>,
    image: Vec<f64>,
}

impl TrustRegion {
    /// Step for the residual force `residual` with `preconditioned = C_AA residual`, within `radius`, solved to `tolerance`
    /// relative to the residual; the step is left in `self.force`.
    #[allow(clippy::too_many_arguments)]
    pub fn step(
        &mut self,
        support: &Support,
        contacts: &[Contact],
        slots: &[[usize; 3]],
        kc: f64,
        residual: &[f64],
        preconditioned: &[f64],
        radius: f64,
        tolerance: f64,
    ) -> Step {
        let order = support.order();
        self.reset(residual, preconditioned);
        let mut square = dot(&self.residual, &self.preconditioned);
        let stop = tolerance * tolerance * square;
        let mut at_boundary = false;
        for _ in 0..INNER_ITERATIONS_PER_UNKNOWN * order {
            if square <= stop {
                break;
            }
            self.image.copy_from_slice(&self.direction_force);
            add_contact_hessian(contacts, slots, kc, &self.direction, &mut self.image);
            let curvature = dot(&self.direction, &self.image);
            let to_boundary = self.share_to_boundary(radius);
            let share = square / curvature;
            at_boundary = !(curvature > 0.0 && share < to_boundary);
            let share = if at_boundary { to_boundary } else { share };
            for k in 0..order {
                self.force[k] += share * self.direction_force[k];
                self.displacement[k] += share * self.direction[k];
                self.residual[k] -= share * self.image[k];
            }
            if at_boundary {
                break;
            }
            support.multiply(&self.residual, &mut self.preconditioned);
            let next = dot(&self.residual, &self.preconditioned);
            let ratio = next / square;
            square = next;
            for k in 0..order {
                self.direction_force[k] = self.residual[k] + ratio * self.direction_force[k];
                self.direction[k] = self.preconditioned[k] + ratio * self.direction[k];
            }
        }
        // m(0) - m(df) = 1/2 du . (r + (r - H du)): the residual left over is r - H du.
        let predicted = 0.5 * (dot(&self.displacement, residual) + dot(&self.displacement, &self.residual));
        let length = dot(&self.force, &self.displacement).max(0.0).sqrt();
        Step { predicted, length, at_boundary }
    }

    /// Starts from the zero step, along the preconditioned residual.
    fn reset(&mut self, residual: &[f64], preconditioned: &[f64]) {
        for (vector, start) in [
            (&mut self.residual, residual),
            (&mut self.preconditioned, preconditioned),
            (&mut self.direction_force, residual),
            (&mut self.direction, preconditioned),
            (&mut self.image, residual),
        ] {
            vector.clear();
            vector.extend_from_slice(start);
        }
        for vector in [&mut self.force, &mut self.displacement] {
            vector.clear();
            vector.resize(residual.len(), 0.0);
        }
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
}

/// Adds B p, the product of the contact springs' Hessian with the displacement `p` on the support, to `product`.
pub fn add_contact_hessian(contacts: &[Contact], slots: &[[usize; 3]], kc: f64, p: &[f64], product: &mut [f64]) {
    for (contact, slots) in contacts.iter().zip(slots) {
        if contact.depth <= 0.0 {
            continue;
        }
        let v = slots.map(|slot| DVec3::from_slice(&p[3 * slot..]));
        for (h, slot) in hessian_product(contact, kc, v).into_iter().zip(slots) {
            product[3 * slot] += h.x;
            product[3 * slot + 1] += h.y;
            product[3 * slot + 2] += h.z;
        }
    }
}

/// Adds the forces of the contact springs on the object's nodes, -kc depth_i w_ij N_i, to `forces` on the support.
pub fn add_contact_forces(contacts: &[Contact], slots: &[[usize; 3]], kc: f64, forces: &mut [f64]) {
    for (contact, slots) in contacts.iter().zip(slots) {
        if contact.depth <= 0.0 {
            continue;
        }
        for (weight, slot) in contact.weights.into_iter().zip(slots) {
            let force = contact.normal * (-kc * contact.depth * weight);
            forces[3 * slot] += force.x;
            forces[3 * slot + 1] += force.y;
            forces[3 * slot + 2] += force.z;
        }
    }
}
