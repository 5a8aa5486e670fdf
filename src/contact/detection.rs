//! Which proxy nodes touch the object, at rest and deformed.
//!
//! The closest feature is found exactly; culling only skips what cannot be closest, so results equal those of a search
//! over all triangles. Two facts carry it, with |u| <= m everywhere on the surface:
//! - a node outside at rest, farther than m from the surface, is outside still;
//! - where some triangle is at a distance d, one that was farther than d + m at rest is not the closest one.
//!
//! A smooth surface is searched by its flat triangles: where a facet is at a distance d, one whose triangle is farther
//! than d plus the bulge is not the closest one.
//!
//! Ties go to the lower triangle number.

mod deformation;

use super::geometry::facet::Facet;
use super::geometry::nearest::Closest;
use super::law::depth::{Carriers, Contact, measure};
use super::model::{Model, MotionBound};
use deformation::Deformation;
use glam::DVec3;

/// How far a proxy node moves along a way while the facet that was closest to it last is tried first, over the mean edge
/// (1). Beyond, the one that is near its cube of the lattice is as likely.
const NEAR: f64 = 0.25;

/// Where a proxy node stands at rest, and what is known of it since.
#[derive(Clone, Copy, Default)]
struct RestDistance {
    /// Unsigned distance to the surface at rest, or a lower bound of it (m).
    distance: f64,
    /// The closest feature at rest, as far as `distance` away; none while that is only a bound.
    closest: Option<Closest>,
    /// Inside at rest.
    inside: bool,
    /// Has touched since the configuration was taken up, and is reported as a near miss from then on.
    watched: bool,
    /// Triangle that was closest last: tried first, which makes the search short.
    last: u32,
}

impl RestDistance {
    /// Signed distance to the surface at rest, negative inside, or a lower bound of it (m).
    fn signed(&self) -> f64 {
        if self.inside { -self.distance } else { self.distance }
    }
}

/// Detection for one thread: node positions of the current configuration and reusable lists.
pub struct Detection {
    /// Proxy nodes relative to the model's centre (m).
    nodes: Vec<DVec3>,
    at_rest: Vec<RestDistance>,
    deformation: Deformation,
    /// Whether one configuration follows another on a way.
    follows: bool,
}

impl Detection {
    /// Room for the proxy of `model`.
    #[must_use]
    pub fn new(model: &Model) -> Self {
        let count = model.chain.nodes.len();
        Self {
            nodes: vec![DVec3::ZERO; count],
            at_rest: vec![RestDistance::default(); count],
            deformation: Deformation::new(model),
            follows: false,
        }
    }

    /// The same along a way: searches begin where the last ones ended. What is found is the same but for rounding, where
    /// two facets are as near.
    #[must_use]
    pub fn along_a_way(model: &Model) -> Self {
        Self { follows: true, ..Self::new(model) }
    }

    /// Proxy nodes relative to the model's centre (m).
    #[must_use]
    pub fn nodes(&self) -> &[DVec3] {
        &self.nodes
    }

    /// A lower bound of the signed distance of proxy node `i` to the surface at rest, in the configuration taken up (m).
    #[must_use]
    pub fn distance(&self, i: usize) -> f64 {
        self.at_rest[i].signed()
    }

    /// The same of all of them.
    pub fn distances(&self) -> impl Iterator<Item = f64> {
        self.at_rest.iter().map(RestDistance::signed)
    }

    /// Takes up a configuration with proxy nodes at `nodes` (m) in the world, and returns the smallest signed distance
    /// of a proxy node to the surface at rest, less its radius (m).
    pub fn set_configuration(&mut self, model: &Model, nodes: &[DVec3]) -> f64 {
        // The node that is most likely the nearest rules out most others.
        let first = self.place(model, nodes);
        let mut gap = f64::MAX;
        for i in std::iter::once(first).chain(0..nodes.len()) {
            let known = &mut self.at_rest[i];
            let radius = model.chain.nodes[i].radius;
            if known.closest.is_none() {
                if known.distance > 0.0 && known.distance - radius > gap {
                    continue;
                }
                find_at_rest(model, self.nodes[i], known);
            }
            gap = gap.min(known.signed() - radius);
        }
        gap
    }

    /// Places the proxy nodes at `nodes` (m) in the world, with lower bounds for distances that may be negative, and
    /// returns the one whose bound, less its radius, is least.
    pub fn place(&mut self, model: &Model, nodes: &[DVec3]) -> usize {
        let (mut first, mut least) = (0, f64::INFINITY);
        for (i, &node) in nodes.iter().enumerate() {
            let x = node - model.surface.centre;
            let known = &mut self.at_rest[i];
            known.watched = false;
            // Of a node that stands where it stood in the configuration before, as all do that hang on joints which
            // have not moved, all is known.
            if !(known.closest.is_some() && self.nodes[i] == x) {
                let moved = self.nodes[i].distance(x);
                let is_near = self.follows && known.closest.is_some() && moved < NEAR * model.surface.mean_edge;
                self.nodes[i] = x;
                known.closest = None;
                known.inside = false;
                let (bound, near) = model.surface.distance_bound(x);
                known.distance = bound - model.rounded.as_ref().map_or(0.0, |rounded| rounded.blur());
                known.last = near.filter(|_| !is_near).unwrap_or(known.last);
            }
            let clearance = known.signed() - model.chain.nodes[i].radius;
            if clearance < least {
                (first, least) = (i, clearance);
            }
        }
        first
    }

    /// Takes up the surface displaced by `forces` on `nodes`, three numbers a node (N), within `bound`.
    pub fn displace(&mut self, model: &Model, nodes: &[u32], forces: &[f64], bound: MotionBound) {
        self.deformation.take(model, nodes, forces, bound);
    }

    /// Displacement of a surface node (m).
    pub fn displacement(&mut self, model: &Model, node: u32) -> DVec3 {
        self.deformation.displacement(model, node)
    }

    /// Contacts with the surface as displaced, in ascending order of proxy nodes. Nodes that touched before in this
    /// configuration are included with a depth below zero when they do not touch now, because they are the ones that
    /// may touch again.
    pub fn deformed(&mut self, model: &Model, contacts: &mut Vec<Contact>) {
        contacts.clear();
        let MotionBound { moved, .. } = self.deformation.bound;
        for i in 0..self.nodes.len() {
            let x = self.nodes[i];
            let radius = model.chain.nodes[i].radius;
            let known = &mut self.at_rest[i];
            if !known.inside && known.distance - radius > moved {
                continue;
            }
            if known.closest.is_none() {
                find_at_rest(model, x, known);
                if !known.inside && known.distance - radius > moved {
                    continue;
                }
            }
            let Some(closest) = self.closest(model, i) else {
                continue;
            };
            let known = &mut self.at_rest[i];
            known.last = closest.triangle;
            let contact = self.contact_at(model, i, closest);
            let known = &mut self.at_rest[i];
            known.watched |= contact.depth > 0.0;
            if !known.watched {
                continue;
            }
            contacts.push(contact);
        }
    }

    /// The closest feature of the deformed surface to node `i`, if it is near enough to matter.
    fn closest(&mut self, model: &Model, i: usize) -> Option<Closest> {
        let Self { deformation, .. } = self;
        let x = self.nodes[i];
        let radius = model.chain.nodes[i].radius;
        let known = self.at_rest[i];
        let MotionBound { moved, bulge } = deformation.bound;
        // A node that was outside at rest is inside only where the surface has passed over it, and then no deeper than
        // that.
        let matters = if known.inside || known.watched { f64::MAX } else { radius.max(moved - known.distance) };
        let mut closest = Closest::none();
        let at_rest = known.closest.map(|closest| closest.triangle);
        let likely = at_rest.filter(|_| moved == 0.0).unwrap_or(known.last);
        // None was closest where the pass before was not a number.
        if (likely as usize) < model.object.triangles.len() {
            closest.consider(x, deformation.facet(model, likely), likely, f64::MAX);
        }
        // Distance within which facets are looked for, and its square for their triangles.
        let near = |closest: &Closest| closest.distance_squared.sqrt().min(matters);
        let within = |closest: &Closest| (near(closest) + bulge).powi(2);
        if moved != 0.0 {
            deformation.search(model, x, within(&closest), |triangle, facet| {
                if triangle != likely {
                    closest.consider(x, facet, triangle, near(&closest));
                }
                within(&closest)
            });
        }
        (closest.distance_squared.sqrt() <= matters).then_some(closest)
    }

    /// The contact (or near miss, with depth <= 0) of proxy node `i` with the closest feature of the deformed surface.
    fn contact_at(&mut self, model: &Model, i: usize, closest: Closest) -> Contact {
        let pseudonormal = self.deformation.pseudonormal(model, closest.triangle, &closest.point);
        let facet = self.deformation.facet(model, closest.triangle);
        contact_with(model, i, self.nodes[i], &closest, facet, pseudonormal)
    }

    /// The row of proxy node `i` before the surface at rest, with its depth there (negative outside), if that is at
    /// least `-reach` (m).
    pub fn at_rest(&mut self, model: &Model, i: usize, reach: f64) -> Option<Contact> {
        let (x, radius) = (self.nodes[i], model.chain.nodes[i].radius);
        let known = &mut self.at_rest[i];
        if !known.inside && known.distance - radius > reach {
            return None;
        }
        let closest = known.closest.unwrap_or_else(|| find_at_rest(model, x, known));
        let row = match &model.rounded {
            None => row_at_rest(model, i, x, &closest),
            // Found before the rounded surface, or beyond its lattice.
            Some(_) if closest.triangle == u32::MAX => {
                Some(Contact { share: model.shares[i], ..Contact::rounded(i as u32, radius - known.signed()) })
            }
            Some(_) => None,
        };
        row.filter(|row| row.depth >= -reach)
    }

    /// The row of the place `x` next to the node (m), before the feature that is closest to the node, which is continued
    /// beyond its ends.
    pub fn near_at_rest(&self, model: &Model, i: usize, x: DVec3) -> Option<Contact> {
        let mut closest = self.at_rest[i].closest.filter(|closest| closest.triangle != u32::MAX)?;
        closest.point = model.surface.facet_at_rest(closest.triangle).followed(x, &closest.point);
        row_at_rest(model, i, x, &closest)
    }
}

/// Closest feature at rest; notes distance and side. Those of the rounded surface, which has no features, where there is
/// one.
fn find_at_rest(model: &Model, x: DVec3, known: &mut RestDistance) -> Closest {
    let surface = &model.surface;
    if let Some(depth) = model.rounded.as_ref().and_then(|rounded| rounded.depth(x)) {
        let nothing = Closest::none();
        (known.closest, known.distance, known.inside) = (Some(nothing), depth.abs(), depth > 0.0);
        return nothing;
    }
    let closest = surface.closest(x, known.last);
    known.closest = Some(closest);
    known.distance = closest.distance_squared.sqrt();
    known.last = closest.triangle;
    known.inside = surface.is_inside(x, &closest);
    closest
}

/// The row of proxy node `i` at `x` before the surface at rest, to which `closest` is closest; none where nothing is.
fn row_at_rest(model: &Model, i: usize, x: DVec3, closest: &Closest) -> Option<Contact> {
    if closest.triangle == u32::MAX {
        return None;
    }
    let facet = model.surface.facet_at_rest(closest.triangle);
    let direction = model.surface.pseudonormal_at_rest(closest.triangle, &closest.point);
    Some(contact_with(model, i, x, closest, facet, direction))
}

/// The contact (or near miss, with depth <= 0) of proxy node `i` at `x` with the closest point of `facet`, on the side
/// that `pseudonormal` decides.
#[inline(always)]
fn contact_with(model: &Model, i: usize, x: DVec3, closest: &Closest, facet: &Facet, pseudonormal: DVec3) -> Contact {
    let radius = model.chain.nodes[i].radius;
    let measured = measure(x, radius, facet, &closest.point, pseudonormal);
    let carriers = Carriers::new(model.surface.carriers(closest.triangle), &closest.point);
    Contact { share: model.shares[i], ..Contact::new(i as u32, carriers, measured) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::object::Object;
    use crate::proxy::Chain;
    use crate::random::sequence;
    use crate::scene::{
        ContactLaw, ContactSpec, ContactSurface, GroundNodes, GroundSpec, GroundStiffness, JointKind, JointSpec,
        Material, ObjectSpec, ProxyNodeSpec, ProxySpec, Shape, SpringKind, SpringSpec,
    };

    fn ball() -> Object {
        Object::build(&ObjectSpec {
            shape: Shape::Sphere { centre: DVec3::new(1.0, -2.0, 0.5), radius: 0.05, rings: 10, segments: 10 },
            material: Material::Springs(SpringSpec { kind: SpringKind::Isotropic, stiffness: 300.0 }),
            skin: None,
            ground: Some(GroundSpec { stiffness: GroundStiffness::PerNode(100.0), nodes: GroundNodes::All }),
            node_mass: 0.01,
            node_damping: 0.1,
        })
        .unwrap()
    }

    /// As many free-floating proxy nodes as wanted; only their radii matter here.
    fn nodes(count: usize, radius: f64) -> Chain {
        Chain::new(&ProxySpec {
            joints: vec![JointSpec {
                follows: None,
                name: "joint".into(),
                kind: JointKind::Prismatic,
                origin: DVec3::ZERO,
                axis: DVec3::X,
                limits: [-1.0, 1.0],
                mass: 1.0,
                centre_of_mass: DVec3::ZERO,
                inertia: glam::DMat3::IDENTITY,
                rotor_inertia: 0.0,
                nodes: vec![ProxyNodeSpec { position: DVec3::ZERO, radius, length: 0.0 }; count],
            }],
            ..Default::default()
        })
    }

    /// Contacts by trial of every triangle for every node.
    fn brute_force(model: &Model, nodes: &[DVec3], positions: &[DVec3]) -> Vec<Contact> {
        let mut contacts = Vec::new();
        for (i, &x) in nodes.iter().enumerate() {
            let mut closest = Closest::none();
            for t in 0..model.object.triangles.len() as u32 {
                closest.consider(x, &model.surface.facet(positions, t), t, f64::MAX);
            }
            let pseudonormal = model.surface.pseudonormal(positions, closest.triangle, &closest.point);
            let facet = model.surface.facet(positions, closest.triangle);
            let contact = contact_with(model, i, x, &closest, &facet, pseudonormal);
            if contact.depth > 0.0 {
                contacts.push(contact);
            }
        }
        contacts
    }

    /// For displacements from none to a radius, growing and shrinking within one configuration.
    #[test]
    fn culling_changes_no_result() {
        let object = ball();
        let mut next = sequence(3);
        let (mut compared, mut same) = (0, 0);
        for (radius, surface) in [
            (0.0, ContactSurface::Facets),
            (0.01, ContactSurface::Facets),
            (0.0, ContactSurface::Smooth),
            (0.01, ContactSurface::Smooth),
        ] {
            let chain = nodes(30, radius);
            let contact = ContactSpec {
                stiffness: 1.0,
                stiffness_per_length: None,
                law: ContactLaw::Following,
                tolerance: 1e-8,
                max_iterations: 1,
                surface,
                round: None,
            };
            let model = Model::new(&object, &chain, contact);
            let mut detection = Detection::new(&model);
            for _ in 0..40 {
                let world: Vec<DVec3> =
                    (0..30).map(|_| model.surface.centre + DVec3::new(next(), next(), next()) * 0.06).collect();
                let gap = detection.set_configuration(&model, &world);
                let x: Vec<DVec3> = world.iter().map(|node| *node - model.surface.centre).collect();
                let deepest =
                    brute_force(&model, &x, &model.surface.positions).iter().map(|c| c.depth).fold(0.0, f64::max);
                assert!(((-gap).max(0.0) - deepest).abs() < 1e-15, "{gap} {deepest}");
                for size in [0.0, 1e-9, 1e-3, 0.02, 0.005, 0.05, 0.0] {
                    // Forces on some nodes, which displace the surface by about `size`.
                    let nodes: Vec<u32> = (0..5).map(|_| ((next() + 1.0) * 50.0) as u32).collect();
                    let mut forces: Vec<f64> = (0..15).map(|_| next()).collect();
                    let displace = |forces: &[f64]| -> Vec<DVec3> {
                        let load = |j: usize, (k, force): (&u32, &[f64; 3])| {
                            model.compliance.block(j, *k as usize) * DVec3::from_array(*force)
                        };
                        let loads = || nodes.iter().zip(forces.as_chunks().0);
                        (0..model.surface.positions.len()).map(|j| loads().map(|pair| load(j, pair)).sum()).collect()
                    };
                    let most = displace(&forces).iter().map(|u| u.length()).fold(0.0, f64::max);
                    forces.iter_mut().for_each(|force| *force *= size / most);
                    let displacement = displace(&forces);
                    let positions: Vec<DVec3> =
                        model.surface.positions.iter().zip(&displacement).map(|(n, u)| *n + *u).collect();
                    let work: f64 = nodes
                        .iter()
                        .zip(forces.as_chunks().0)
                        .map(|(&node, force)| displacement[node as usize].dot(DVec3::from_array(*force)))
                        .sum();
                    let bound = model.motion_bound(0.5 * work);
                    assert!(displacement.iter().all(|u| u.length() <= bound.moved), "{size} {bound:?}");
                    detection.displace(&model, &nodes, &forces, bound);
                    let mut found = Vec::new();
                    detection.deformed(&model, &mut found);
                    found.retain(|contact| contact.depth > 0.0);
                    let expected = brute_force(&model, &x, &positions);
                    assert_eq!(found.len(), expected.len());
                    for (found, expected) in found.iter().zip(&expected) {
                        compared += 1;
                        assert_eq!(found.proxy_node, expected.proxy_node);
                        // Displacements are sums in another order.
                        assert!((found.depth - expected.depth).abs() < 1e-15);
                        same += usize::from(found.carriers.nodes() == expected.carriers.nodes());
                    }
                }
            }
        }
        assert!(compared > 1000 && 100 * same > 99 * compared, "{same} of {compared}");
    }
}
