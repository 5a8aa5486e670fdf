//! Contact springs to test with: points and balls pressed into the sphere.

use super::{Slots, Springs, add_contact_hessian};
use crate::contact::geometry::facet::Facet;
use crate::contact::geometry::normals;
use crate::contact::geometry::smooth::CARRIERS;
use crate::contact::law::depth::{Carriers, Contact, measure};
use crate::contact::linear::support::Support;
use crate::fixtures::bodies::{Ball, PAPER, sphere};
use crate::object::{Compliance, Object};
use crate::random::Random;
use crate::scene::SpringKind;
use glam::DVec3;

/// Springs on a support.
pub struct Sample {
    support: Support,
    contacts: Vec<Contact>,
    slots: Vec<Slots>,
    kc: f64,
}

/// The sphere of 102 nodes.
pub fn ball(springs: SpringKind) -> Object {
    sphere(Ball { springs, ..PAPER }).unwrap()
}

/// Five points and two balls, all pressed in, and a point that is near, of stiffness `kc`; bent by
/// `bending` times their forces.
pub fn sample(object: &Object, kc: f64, bending: f64) -> Sample {
    let mut random = Random::new(5);
    let mut contacts = Vec::new();
    let corners = |t: usize| normals::corners(&object.rest, object.triangles[t]);
    for i in 0..6 {
        let t = random.between(0.0, object.triangles.len() as f64) as usize;
        let middle = corners(t).iter().sum::<DVec3>() / 3.0;
        let x = middle * random.between(0.7, 0.9) + random.vector() * 1e-3;
        let facet = Facet::flat(corners(t));
        let point = facet.closest(x, f64::MAX).unwrap();
        let measured = measure(x, 0.0, &facet, &point, middle.normalize());
        contacts.push(Contact::new(i, Carriers::new((&object.triangles[t], None), &point), measured));
    }
    contacts[5].depth = -1e-3;
    for i in 6..8 {
        let t = random.between(0.0, object.triangles.len() as f64) as usize;
        let x = corners(t)[0] * 1.02;
        let facet = Facet::flat(corners(t));
        let point = facet.closest(x, f64::MAX).unwrap();
        let outward = x - facet.point(point.weights);
        let measured = measure(x, 0.008, &facet, &point, outward.normalize());
        contacts.push(Contact::new(i, Carriers::new((&object.triangles[t], None), &point), measured));
    }
    for contact in &mut contacts {
        // Springs of different stiffness.
        contact.share = 0.5 + 0.25 * f64::from(contact.proxy_node);
        contact.multiplier = bending * kc * contact.force_over_kc();
    }
    let mut support = Support::new(object.surface_nodes);
    let mut slots = Vec::new();
    for contact in &contacts {
        let mut own = [0; CARRIERS];
        own.iter_mut().zip(contact.carriers.nodes()).for_each(|(slot, &node)| *slot = support.add(node) as u32);
        slots.push(own);
    }
    support.gather(&Compliance::new(object));
    Sample { support, contacts, slots, kc }
}

impl Sample {
    /// The object's part.
    pub fn support(&self) -> &Support {
        &self.support
    }

    /// The springs.
    pub fn springs(&self) -> Springs<'_> {
        Springs { contacts: &self.contacts, slots: &self.slots, kc: self.kc }
    }

    /// Which of them touch.
    pub fn touching(&self) -> Vec<bool> {
        self.contacts.iter().map(|contact| contact.force_over_kc() > 0.0).collect()
    }

    /// `((1 + mu) K + B) C force`, `stiffening` being 1 + mu (N).
    pub fn resist(&self, stiffening: f64, force: &[f64]) -> Vec<f64> {
        let mut displacement = vec![0.0; force.len()];
        self.support.multiply(force, &mut displacement);
        let mut product: Vec<f64> = force.iter().map(|force| stiffening * force).collect();
        add_contact_hessian(self.springs(), &self.touching(), &displacement, &mut product);
        product
    }
}

/// The greatest difference of two entries.
pub fn off(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
}
