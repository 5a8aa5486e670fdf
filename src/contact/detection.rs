//! Which proxy nodes touch the object, at rest and deformed.
//!
//! The closest feature is found exactly; culling only skips what cannot be closest, so results equal those of a search
//! over all triangles. Two facts carry it, with |u| <= m everywhere on the surface:
//! - a node outside at rest, farther than m from the surface, is outside still;
//! - where some triangle is at a distance d, one that was farther than d + m at rest is not the closest one.
//!
//! Ties go to the lower triangle number.

use super::closest_point::{ClosestPoint, Feature, closest_point, point_at};
use super::deformation::Deformation;
use super::depth::{Contact, measure};
use super::model::Model;
use super::newton::Care;
use super::series::share_out;
use super::surface;
use super::walls::{WallSearch, wall};
use crate::tolerances::{FACET_ROUNDING, KNOWN_WALLS, WALL_COMPLIANCE};
use glam::DVec3;

/// Where a proxy node stands at rest, and what is known of it since.
#[derive(Clone, Copy, Default)]
struct Standing {
    /// Unsigned distance to the surface at rest, or a lower bound of it [m].
    distance: f64,
    /// False while `distance` is only a bound.
    exact: bool,
    /// Inside at rest.
    inside: bool,
    /// Has touched since the configuration was taken up, and is reported as a near miss from then on.
    watched: bool,
    /// Triangle that is closest at rest, where `distance` is exact.
    at_rest: u32,
    /// Triangle that was closest last: tried first, which makes the search short.
    last: u32,
}

impl Standing {
    /// Signed distance to the surface at rest, negative inside, or a lower bound of it [m].
    fn signed(&self) -> f64 {
        if self.inside { -self.distance } else { self.distance }
    }
}

/// The closest feature of the surface.
#[derive(Clone, Copy)]
pub struct Closest {
    /// Squared distance [m^2].
    pub distance_squared: f64,
    /// Triangle.
    pub triangle: u32,
    /// Point and feature on it.
    pub point: ClosestPoint,
}

impl Closest {
    /// None yet.
    #[must_use]
    pub fn none() -> Self {
        let point = ClosestPoint { weights: [0.0; 3], feature: Feature::Face };
        Self { distance_squared: f64::MAX, triangle: u32::MAX, point }
    }

    /// Takes triangle `t` instead if it is nearer to `x`, or as near with a lower number; its closest point, and the squared
    /// distance of that [m^2].
    pub fn consider(&mut self, x: DVec3, positions: &[DVec3], triangles: &[[u32; 3]], t: u32) -> (ClosestPoint, f64) {
        let corners = surface::corners(positions, triangles[t as usize]);
        let point = closest_point(x, corners);
        let distance_squared = x.distance_squared(point_at(corners, point.weights));
        if distance_squared < self.distance_squared || (distance_squared == self.distance_squared && t < self.triangle)
        {
            *self = Self { distance_squared, triangle: t, point };
        }
        (point, distance_squared)
    }
}

/// Which walls a node with a radius feels.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Walls {
    /// The closest one.
    Closest,
    /// All that it feels: about as near as the nearest (see [`super::walls`]).
    All,
}

/// What a ball feels whose centre is inside the object.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Inner {
    /// The nearest wall alone: E jumps where the centre passes the surface near an edge, but nothing holds the ball inside.
    Alone,
    /// The nearest among the others, which it feels as from outside: E is continuous, and has minima more than there need be.
    Among,
}

/// Distance within which walls of a ball matter whose nearest is at `least`: those that may bear (see [`super::series`]), and those that
/// may be the next that do [m].
fn reach(radius: f64, least: f64) -> f64 {
    least + WALL_COMPLIANCE * (radius - least).max(0.0) + KNOWN_WALLS * radius
}

/// Detection for one thread: node positions of the current configuration and reusable lists.
pub struct Detection {
    /// Proxy nodes relative to the model's centre [m].
    nodes: Vec<DVec3>,
    standings: Vec<Standing>,
    deformation: Deformation,
    /// Whether a ball's side is made sure of.
    pub care: Care,
    /// What balls feel whose centres are inside.
    pub inner: Inner,
    /// How much facets are rounded for balls [1].
    pub rounding: f64,
    /// Whether [`Inner::Alone`] has left out a wall, since this was last set to false.
    pub left_out: bool,
    /// Of the node at hand.
    walls: WallSearch,
    pushes: Vec<f64>,
}

impl Detection {
    /// Room for the proxy of `model`.
    #[must_use]
    pub fn new(model: &Model) -> Self {
        let count = model.chain.nodes.len();
        Self {
            nodes: vec![DVec3::ZERO; count],
            standings: vec![Standing::default(); count],
            deformation: Deformation::new(model),
            care: Care::Quick,
            inner: Inner::Among,
            rounding: FACET_ROUNDING,
            left_out: false,
            walls: WallSearch::default(),
            pushes: Vec::new(),
        }
    }

    /// Proxy nodes relative to the model's centre [m].
    #[must_use]
    pub fn nodes(&self) -> &[DVec3] {
        &self.nodes
    }

    /// A lower bound of the signed distance of each proxy node to the surface at rest, in the configuration taken up [m].
    pub fn distances(&self) -> impl Iterator<Item = f64> {
        self.standings.iter().map(Standing::signed)
    }

    /// Depth at rest of the node with a radius that lies deepest, in radii; zero where there is none inside [1].
    #[must_use]
    pub fn depth_in_radii(&self, model: &Model) -> f64 {
        let mut deepest = 0.0f64;
        for (standing, node) in self.standings.iter().zip(&model.chain.nodes) {
            if standing.inside && node.radius > 0.0 {
                deepest = deepest.max((standing.distance + node.radius) / node.radius);
            }
        }
        deepest
    }

    /// Takes up a configuration with proxy nodes at `nodes` [m] in the world, and returns the smallest signed distance of a
    /// proxy node to the surface at rest, less its radius [m].
    pub fn take_up(&mut self, model: &Model, nodes: &[DVec3]) -> f64 {
        // The node that is most likely the nearest rules out most others.
        let first = self.place(model, nodes);
        let mut gap = f64::MAX;
        for i in std::iter::once(first).chain(0..nodes.len()) {
            let standing = &mut self.standings[i];
            let radius = model.chain.nodes[i].radius;
            if !standing.exact {
                if standing.distance > 0.0 && standing.distance - radius > gap {
                    continue;
                }
                find_standing(model, self.nodes[i], standing);
            }
            gap = gap.min(standing.signed() - radius);
        }
        gap
    }

    /// Places the proxy nodes at `nodes` [m] in the world, with lower bounds for distances that may be negative, and returns the
    /// one whose bound, less its radius, is least.
    pub fn place(&mut self, model: &Model, nodes: &[DVec3]) -> usize {
        let (mut first, mut least) = (0, f64::INFINITY);
        for (i, &node) in nodes.iter().enumerate() {
            let x = node - model.centre;
            let standing = &mut self.standings[i];
            standing.watched = false;
            // Of a node that stands where it stood in the configuration before, as all do that hang on joints which have not moved, all
            // is known.
            if !(standing.exact && self.nodes[i] == x) {
                self.nodes[i] = x;
                standing.exact = false;
                standing.inside = false;
                // Beyond the lattice of bounds the surface's box bounds the distance.
                standing.distance = match model.distance_bounds.at(x) {
                    Some((bound, triangle)) => {
                        standing.last = triangle;
                        bound
                    }
                    None => model.bounds.distance_squared(x).sqrt(),
                };
            }
            let clearance = standing.signed() - model.chain.nodes[i].radius;
            if clearance < least {
                (first, least) = (i, clearance);
            }
        }
        first
    }

    /// Contacts with the surface displaced by `displacement`, i.e. at `positions` relative to the model's centre [m], in
    /// ascending order of proxy nodes. Nodes that touched before in this configuration are included with a depth below zero
    /// when they do not touch now, because they are the ones that may touch again.
    pub fn deformed(
        &mut self,
        model: &Model,
        displacement: &[f64],
        positions: &[DVec3],
        walls: Walls,
        contacts: &mut Vec<Contact>,
    ) {
        contacts.clear();
        self.deformation.take(displacement);
        let moved = self.deformation.moved;
        for i in 0..self.nodes.len() {
            let x = self.nodes[i];
            let radius = model.chain.nodes[i].radius;
            let standing = &mut self.standings[i];
            if !standing.inside && standing.distance - radius > moved {
                continue;
            }
            if !standing.exact {
                find_standing(model, x, standing);
                if !standing.inside && standing.distance - radius > moved {
                    continue;
                }
            }
            let triangles = &model.object.triangles;
            let mut closest = Closest::none();
            let likely = if moved == 0.0 { standing.at_rest } else { standing.last };
            // None was closest where the pass before was not a number.
            if (likely as usize) < triangles.len() {
                closest.consider(x, positions, triangles, likely);
            }
            let rounding = self.rounding;
            let feels = walls != Walls::Closest && radius > 0.0;
            // Squared distance within which triangles are looked for.
            let within = |closest: &Closest| {
                if feels {
                    let least = (closest.distance_squared * (1.0 + rounding)).sqrt();
                    reach(radius, least).powi(2)
                } else {
                    closest.distance_squared
                }
            };
            self.walls.clear();
            if feels || moved != 0.0 {
                self.deformation.search(model, positions, x, within(&closest), |triangle| {
                    if feels || triangle != likely {
                        let (_, distance_squared) = closest.consider(x, positions, triangles, triangle);
                        let within = within(&closest);
                        if feels && distance_squared <= within {
                            self.walls.push(triangle);
                        }
                        return within;
                    }
                    within(&closest)
                });
            }
            standing.last = closest.triangle;
            let Some(contact) = contact_at(model, i, x, radius, positions, closest.triangle, closest.point) else {
                continue;
            };
            standing.watched |= contact.depth > 0.0;
            if !standing.watched {
                continue;
            }
            if !feels {
                contacts.push(contact);
                continue;
            }
            let (facets, nearest) = self.walls.find(x, rounding, |least| reach(radius, least), positions, triangles);
            // Where deformation has folded the surface over itself, the closest feature need not know the side.
            let inside = contact.depth > radius
                && (self.care == Care::Quick || surface::winding_number(positions, triangles, x) > 0.5);
            let first = contacts.len();
            let alone = inside && self.inner == Inner::Alone;
            self.left_out |= alone && facets.len() > 1;
            for (k, facet) in facets.iter().enumerate().filter(|&(k, _)| !alone || k == nearest) {
                let nodes = triangles[facet.triangle as usize];
                let place = (nodes, surface::corners(positions, nodes));
                let inside = inside && k == nearest;
                let wall = wall((i as u32, x, radius), place, facet.point, inside, contact.normal, rounding);
                contacts.push(Contact { share: model.shares[i], ..wall });
            }
            share_out(&mut contacts[first..], &mut self.pushes);
        }
    }

    /// Rows of the problem with geometry frozen at rest: every proxy node within `reach` of the surface, with its depth at
    /// rest (negative outside) and no curvature.
    pub fn frozen(&mut self, model: &Model, reach: f64, rows: &mut Vec<Contact>) {
        rows.clear();
        for i in 0..self.nodes.len() {
            let x = self.nodes[i];
            let radius = model.chain.nodes[i].radius;
            let standing = &mut self.standings[i];
            if !standing.inside && standing.distance - radius > reach {
                continue;
            }
            let closest = find_standing(model, x, standing);
            let Closest { triangle, point, .. } = closest;
            let row = contact_at(model, i, x, radius, &model.rest, triangle, point);
            if let Some(mut row) = row.filter(|row| row.depth >= -reach) {
                row.freeze();
                rows.push(row);
            }
        }
    }
}

/// Signed distance of `x` to the surface at rest [m], and the closest triangle; `near` is a triangle near by, if any is known.
pub(super) fn signed_distance(model: &Model, x: DVec3, near: Option<u32>) -> (f64, u32) {
    let mut standing = Standing { last: near.unwrap_or(u32::MAX), ..Standing::default() };
    let triangle = find_standing(model, x, &mut standing).triangle;
    (if standing.inside { -standing.distance } else { standing.distance }, triangle)
}

/// Closest feature at rest; notes distance and side.
fn find_standing(model: &Model, x: DVec3, standing: &mut Standing) -> Closest {
    let triangles = &model.object.triangles;
    let mut closest = Closest::none();
    let last = standing.last;
    if (last as usize) < triangles.len() {
        closest.consider(x, &model.rest, triangles, last);
    }
    model.bounds.search(x, closest.distance_squared, |t| {
        if t != last {
            closest.consider(x, &model.rest, triangles, t);
        }
        closest.distance_squared
    });
    standing.exact = true;
    standing.distance = closest.distance_squared.sqrt();
    standing.at_rest = closest.triangle;
    standing.last = closest.triangle;
    standing.inside = false;
    if closest.triangle != u32::MAX {
        let t = closest.triangle as usize;
        let offset = point_at(surface::corners(&model.rest, triangles[t]), closest.point.weights) - x;
        standing.inside = offset.dot(model.rest_pseudonormal(t, closest.point.feature)) > 0.0;
    }
    closest
}

/// The contact (or near miss, with depth <= 0) of proxy node `i` with a feature of `triangle`.
#[inline(always)]
fn contact_at(
    model: &Model,
    i: usize,
    x: DVec3,
    radius: f64,
    positions: &[DVec3],
    triangle: u32,
    point: ClosestPoint,
) -> Option<Contact> {
    let t = triangle as usize;
    let nodes = *model.object.triangles.get(t)?;
    let ClosestPoint { weights, feature } = point;
    let pseudonormal = surface::pseudonormal(positions, &model.object.triangles, &model.object.topology, t, feature);
    let measured = measure(x, radius, surface::corners(positions, nodes), weights, feature, pseudonormal);
    Some(Contact { share: model.shares[i], ..Contact::new(i as u32, nodes, weights, measured) })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::object::Object;
    use crate::proxy::Chain;
    use crate::random::sequence;
    use crate::scene::{
        Algorithm, ContactSpec, GroundNodes, GroundSpec, JointKind, JointSpec, Material, ObjectSpec, ProxyNodeSpec,
        ProxySpec, Shape, SpringKind, SpringSpec,
    };

    fn ball() -> Object {
        Object::build(&ObjectSpec {
            shape: Shape::Sphere { centre: DVec3::new(1.0, -2.0, 0.5), radius: 0.05, rings: 10, segments: 10 },
            material: Material::Springs(SpringSpec { kind: SpringKind::Isotropic, stiffness: 300.0 }),
            skin: None,
            ground: Some(GroundSpec { stiffness: 100.0, nodes: GroundNodes::All }),
            node_mass: 0.01,
            node_damping: 0.1,
        })
        .unwrap()
    }

    /// As many free-floating proxy nodes as wanted; only their radii matter here.
    fn nodes(count: usize, radius: f64) -> Chain {
        Chain::new(&ProxySpec {
            joints: vec![JointSpec {
                name: "joint".into(),
                kind: JointKind::Prismatic,
                origin: DVec3::ZERO,
                axis: DVec3::X,
                limits: [-1.0, 1.0],
                mass: 1.0,
                centre_of_mass: DVec3::ZERO,
                inertia: DVec3::ONE,
                rotor_inertia: 0.0,
                nodes: vec![ProxyNodeSpec { position: DVec3::ZERO, radius, length: 0.0 }; count],
            }],
        })
    }

    /// Contacts by trial of every triangle for every node.
    fn brute_force(model: &Model, nodes: &[DVec3], positions: &[DVec3]) -> Vec<Contact> {
        let mut contacts = Vec::new();
        for (i, &x) in nodes.iter().enumerate() {
            let mut closest = Closest::none();
            for t in 0..model.object.triangles.len() {
                closest.consider(x, positions, &model.object.triangles, t as u32);
            }
            let radius = model.chain.nodes[i].radius;
            let contact = contact_at(model, i, x, radius, positions, closest.triangle, closest.point).unwrap();
            if contact.depth > 0.0 {
                contacts.push(contact);
            }
        }
        contacts
    }

    /// To the last bit, for displacements from none to a radius, local and global, growing and shrinking within one
    /// configuration.
    #[test]
    fn culling_changes_no_result() {
        let object = ball();
        let mut next = sequence(3);
        let mut compared = 0;
        for radius in [0.0, 0.01] {
            let chain = nodes(30, radius);
            let contact = ContactSpec {
                stiffness: 1.0,
                stiffness_per_length: None,
                algorithm: Algorithm::Energy,
                tolerance: 1e-8,
                max_iterations: 1,
                updates: 0,
            };
            let model = Model::new(&object, &chain, contact);
            let mut detection = Detection::new(&model);
            for _ in 0..40 {
                let world: Vec<DVec3> =
                    (0..30).map(|_| model.centre + DVec3::new(next(), next(), next()) * 0.06).collect();
                let gap = detection.take_up(&model, &world);
                let x: Vec<DVec3> = world.iter().map(|node| *node - model.centre).collect();
                let deepest = brute_force(&model, &x, &model.rest).iter().map(|c| c.depth).fold(0.0, f64::max);
                assert!(((-gap).max(0.0) - deepest).abs() < 1e-15, "{gap} {deepest}");
                for size in [0.0, 1e-9, 1e-3, 0.02, 0.005, 0.05, 0.0] {
                    let centre = DVec3::new(next(), next(), next()) * 0.05;
                    let displacement: Vec<f64> = (0..3 * model.rest.len())
                        .map(|k| size * next() * (-(model.rest[k / 3] - centre).length() / 0.02).exp())
                        .collect();
                    let positions: Vec<DVec3> = (0..model.rest.len())
                        .map(|j| model.rest[j] + DVec3::from_slice(&displacement[3 * j..]))
                        .collect();
                    let mut found = Vec::new();
                    detection.deformed(&model, &displacement, &positions, Walls::Closest, &mut found);
                    found.retain(|contact| contact.depth > 0.0);
                    let expected = brute_force(&model, &x, &positions);
                    assert_eq!(found.len(), expected.len());
                    for (found, expected) in found.iter().zip(&expected) {
                        compared += 1;
                        assert_eq!(found.proxy_node, expected.proxy_node);
                        assert_eq!((found.nodes, found.weights), (expected.nodes, expected.weights));
                        assert_eq!((found.depth, found.normal), (expected.depth, expected.normal));
                    }
                }
            }
        }
        assert!(compared > 1000, "{compared}");
    }
}
