//! The contact springs on the support: their forces, and products with the Hessian of their energy.

use super::blend::{RowChange, deepening, together, vary};
use super::depth::{Contact, second_variation, stiffness_product};
use super::series::common_change;
use crate::tolerances::WALL_COMPLIANCE;
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

impl<'a> Springs<'a> {
    /// Visits the rows of each depth, with the place of the first.
    pub fn for_each_depth(self, mut visit: impl FnMut(usize, &'a [Contact])) {
        let mut first = 0;
        for rows in self.contacts.chunk_by(together) {
            visit(first, rows);
            first += rows.len();
        }
    }
}

/// Adds B p, the product of the Hessian of the contact terms with the displacement `p` on the support, to `product`.
pub fn add_contact_hessian(
    springs: Springs,
    touching: &[bool],
    p: &[f64],
    own: &mut Vec<RowChange>,
    product: &mut [f64],
) {
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
pub fn wall_forces(row: &Contact, push: f64, v: [DVec3; 3]) -> [DVec3; 3] {
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
pub fn nodes_of(vector: &[f64], [a, b, c]: [usize; 3]) -> [DVec3; 3] {
    let (nodes, _) = vector.as_chunks();
    [DVec3::from_array(nodes[a]), DVec3::from_array(nodes[b]), DVec3::from_array(nodes[c])]
}

/// Adds one vector for each of three nodes to a vector on the support.
#[inline]
pub fn add_on_nodes(parts: [DVec3; 3], slots: [usize; 3], vector: &mut [f64]) {
    let (nodes, _) = vector.as_chunks_mut();
    for (part, slot) in parts.into_iter().zip(slots) {
        let node: &mut [f64; 3] = &mut nodes[slot];
        *node = (DVec3::from_array(*node) + part).to_array();
    }
}

/// Springs to test with.
#[cfg(test)]
pub mod samples {
    use super::*;
    use crate::contact::closest_point::rounded;
    use crate::contact::depth::{Curvature, measure};
    use crate::contact::series::share_out;
    use crate::contact::support::Support;
    use crate::contact::{closest_point::closest_point, surface, walls::wall};
    use crate::object::{Compliance, Object};
    use crate::random::Random;
    use crate::report::stability::contact::world::{PAPER, sphere};
    use crate::scene::SpringKind;
    use crate::tolerances::FACET_ROUNDING;

    /// Springs on a support.
    pub struct Sample {
        support: Support,
        contacts: Vec<Contact>,
        slots: Vec<[usize; 3]>,
    }

    /// The sphere of 102 nodes.
    pub fn ball(springs: SpringKind) -> Object {
        sphere(crate::report::stability::contact::world::Ball { springs, ..PAPER }).unwrap()
    }

    /// Five points and two balls on three facets each, all pressed in, and a point that is near; bent by their forces.
    pub fn sample(object: &Object, kc: f64, seed: u64) -> Sample {
        let mut random = Random::new(seed);
        let mut contacts = Vec::new();
        let corners = |t: usize| surface::corners(&object.rest, object.triangles[t]);
        for i in 0..6 {
            let t = random.between(0.0, object.triangles.len() as f64) as usize;
            let middle = corners(t).iter().sum::<DVec3>() / 3.0;
            let x = middle * random.between(0.7, 0.9) + random.vector() * 1e-3;
            let point = closest_point(x, corners(t));
            let measured: (DVec3, f64, Curvature) =
                measure(x, 0.0, corners(t), point.weights, point.feature, middle.normalize());
            contacts.push(Contact::new(i, object.triangles[t], point.weights, measured));
        }
        contacts[5].depth = -1e-3;
        for i in 6..8 {
            let t = random.between(0.0, object.triangles.len() as f64) as usize;
            let x = corners(t)[0] * 1.02;
            let around =
                (0..object.triangles.len()).filter(|&near| object.triangles[near].contains(&object.triangles[t][0]));
            for near in around.take(3) {
                let (point, _) = rounded(x, corners(near), FACET_ROUNDING);
                let nodes = (object.triangles[near], corners(near));
                contacts.push(wall((i, x, 0.008), nodes, point, false, DVec3::X, FACET_ROUNDING));
            }
        }
        share_out(&mut contacts, &mut Vec::new());
        for contact in &mut contacts {
            contact.multiplier = kc * contact.bears();
        }
        let mut support = Support::new(object.surface_nodes);
        let slots = contacts.iter().map(|contact| contact.nodes.map(|node| support.add(node))).collect();
        support.gather(&Compliance::new(object));
        Sample { support, contacts, slots }
    }

    impl Sample {
        /// The object's part.
        pub fn support(&self) -> &Support {
            &self.support
        }

        /// The springs, of stiffness `kc`.
        pub fn springs(&self, kc: f64) -> Springs<'_> {
            Springs { contacts: &self.contacts, slots: &self.slots, kc }
        }

        /// Makes all springs straight, or bends them by `times` their force.
        pub fn bend(&mut self, times: f64) {
            self.contacts.iter_mut().for_each(|contact| contact.multiplier *= times);
        }

        /// Which of them touch.
        pub fn touching(&self) -> Vec<bool> {
            self.contacts.iter().map(|contact| contact.bears() > 0.0).collect()
        }

        /// `((1 + mu) K + B) C force`, `stiffening` being 1 + mu [N].
        pub fn resist(&self, kc: f64, stiffening: f64, force: &[f64]) -> Vec<f64> {
            let mut displacement = vec![0.0; force.len()];
            self.support.multiply(force, &mut displacement);
            let mut product: Vec<f64> = force.iter().map(|force| stiffening * force).collect();
            add_contact_hessian(self.springs(kc), &self.touching(), &displacement, &mut Vec::new(), &mut product);
            product
        }
    }
}
