//! Balls that rest with their centre on an edge or a vertex of their own dent.
//!
//! There E has a kink that attracts: beside it the ball is pushed back by what is nearest, and the forces f(v) that it feels when it
//! leaves to the side v differ by finite amounts, about kc r. What balances it is none of them but a mean of several: zero is in the
//! subdifferential of E if the force F that keeps the centre on the feature is in the convex hull of all f(v).
//!
//! A pin finds F: springs between the centre x and its closest point p on the feature, as rows of the list of contacts in unit
//! directions n_k (three around an edge, four around a vertex, of sum zero) with depths `d + m_k + n_k . (p - x)`, which d keeps
//! positive. They take the place of the rows of all features that the centre touches. Where the search has converged, the
//! multipliers m_k take over what the springs bear, and it goes on until the centre lies on the feature to the tolerance (augmented
//! Lagrangian; Hestenes 1969, Powell 1969). Then F is held against the f(v), probed beside the kink. If it is not among their means,
//! the ball is let go with the nearest of them; if it is, F is one row with share |F| / (kc r) and the equilibrium is proved.

use super::closest_point::{Feature, closest_point, point_at};
use super::depth::{Contact, Curvature, measure};
use super::detection::{Detection, Walls};
use super::energy::State;
use super::features::closest_on_edge;
use super::model::Model;
use super::surface;
use crate::tolerances::{KINK_END, KINK_PROBE, KINK_PROBES, KINK_REACH, PIN_PRELOAD, PIN_STIFFNESS};
use glam::DVec3;

/// A ball held on an edge or a vertex.
struct Pin {
    proxy_node: u32,
    /// Corners of the triangle that has the feature.
    nodes: [u32; 3],
    feature: Feature,
    /// A direction across the edge.
    across: DVec3,
    /// m_k [m].
    multipliers: [f64; 4],
}

/// Where a pin's ball stands.
struct Stand {
    /// Barycentric weights of p.
    weights: [f64; 3],
    /// p - x [m].
    offset: DVec3,
    /// Of the distance along any direction across the feature.
    curvature: Curvature,
    /// n_k; of three the last is zero.
    directions: [DVec3; 4],
}

impl Pin {
    fn new(near: &Contact, feature: Feature, corners: [DVec3; 3]) -> Self {
        let across = match feature {
            Feature::Edge(k) => (corners[(k + 1) % 3] - corners[k]).any_orthogonal_vector(),
            _ => DVec3::ZERO,
        };
        Self { proxy_node: near.proxy_node, nodes: near.nodes, feature, across, multipliers: [0.0; 4] }
    }

    /// A pin on what the centre of a ball `near` a feature, at `x` with `radius`, lies on if that is an edge or a vertex.
    fn find(near: &Contact, x: DVec3, radius: f64, positions: &[DVec3]) -> Option<Self> {
        let corners = surface::corners(positions, near.nodes);
        let vertices = [0, 1, 2].map(|k| (Feature::Vertex(k), KINK_END));
        let edges = [0, 1, 2].map(|k| (Feature::Edge(k), KINK_REACH));
        let found = vertices.into_iter().chain(edges).find(|&(feature, reach)| {
            Self::new(near, feature, corners).stand(x, positions).offset.length() < reach * radius
        });
        found.map(|(feature, _)| Self::new(near, feature, corners))
    }

    /// Goes over from an edge to the end that the centre, at `x`, has come to; true if so.
    fn shorten(&mut self, x: DVec3, radius: f64, positions: &[DVec3]) -> bool {
        let Feature::Edge(k) = self.feature else { return false };
        let corners = surface::corners(positions, self.nodes);
        let end = [k, (k + 1) % 3].into_iter().find(|&end| corners[end].distance(x) < KINK_END * radius);
        if let Some(end) = end {
            self.feature = Feature::Vertex(end);
            self.multipliers = [0.0; 4];
        }
        end.is_some()
    }

    fn stand(&self, x: DVec3, positions: &[DVec3]) -> Stand {
        let corners = surface::corners(positions, self.nodes);
        let weights = match self.feature {
            Feature::Edge(k) => closest_on_edge(x, corners, k).weights,
            _ => [0, 1, 2].map(|k| f64::from(u8::from(self.feature == Feature::Vertex(k)))),
        };
        let (_, _, curvature) = measure(x, 0.0, corners, weights, self.feature, DVec3::ZERO);
        let directions = if let Feature::Edge(_) = self.feature {
            let along = curvature.along;
            let one = surface::unit_or_zero(self.across - along * along.dot(self.across));
            let other = along.cross(one) * 0.75f64.sqrt();
            [one, one * -0.5 + other, one * -0.5 - other, DVec3::ZERO]
        } else {
            let corner = |x: f64, y: f64, z: f64| DVec3::new(x, y, z) / 3.0f64.sqrt();
            [corner(1.0, 1.0, 1.0), corner(1.0, -1.0, -1.0), corner(-1.0, 1.0, -1.0), corner(-1.0, -1.0, 1.0)]
        };
        // Across the feature the springs themselves are the curvature.
        let curvature = Curvature { inverse_distance: 0.0, ..curvature };
        Stand { weights, offset: point_at(corners, weights) - x, curvature, directions }
    }

    /// Puts its rows in the place of those of the features that the centre touches.
    fn hold(&self, x: DVec3, radius: f64, kc: f64, positions: &[DVec3], contacts: &mut Vec<Contact>) {
        let Stand { weights, offset, curvature, directions } = self.stand(x, positions);
        let rows = directions.into_iter().zip(self.multipliers).filter(|(normal, _)| *normal != DVec3::ZERO);
        let rows = rows.map(|(normal, multiplier)| {
            let distance = normal.dot(offset);
            let depth = PIN_PRELOAD * radius + multiplier + distance;
            let curvature = Curvature { distance, ..curvature };
            let row = Contact::new(self.proxy_node, self.nodes, weights, (normal, depth, curvature));
            Contact { share: PIN_STIFFNESS, multiplier: kc * depth, ..row }
        });
        self.replace(radius, contacts, rows);
    }

    /// Puts `rows` in the place of those of the features that the centre touches.
    fn replace(&self, radius: f64, contacts: &mut Vec<Contact>, rows: impl Iterator<Item = Contact>) {
        contacts.retain(|contact| contact.proxy_node != self.proxy_node || !touches_centre(contact, radius));
        let at = contacts.partition_point(|contact| contact.proxy_node < self.proxy_node);
        contacts.splice(at..at, rows);
    }

    /// The force of the multipliers on the ball [N].
    fn force(&self, kc: f64, stand: &Stand) -> DVec3 {
        let parts = stand.directions.into_iter().zip(self.multipliers);
        parts.map(|(direction, multiplier)| direction * (PIN_STIFFNESS * kc * multiplier)).sum()
    }
}

/// Whether a row belongs to a feature on which its ball's centre lies.
fn touches_centre(contact: &Contact, radius: f64) -> bool {
    (contact.depth - radius).abs() < KINK_REACH * radius
}

/// What is to be added to the forces on the object where a ball is let go.
pub struct Release {
    /// Three nodes.
    pub nodes: [u32; 3],
    /// Their shares of the force.
    pub weights: [f64; 3],
    /// What the pin's force exceeds those of the kink by [N].
    pub force: DVec3,
}

/// The pins of one configuration.
#[derive(Default)]
pub struct Pins {
    pins: Vec<Pin>,
    /// Of a probe beside a kink.
    contacts: Vec<Contact>,
    displacement: Vec<f64>,
    positions: Vec<DVec3>,
}

impl Pins {
    /// Takes away all.
    pub fn clear(&mut self) {
        self.pins.clear();
    }

    /// Pins every ball whose centre lies on an edge or a vertex; true if there is a pin that was not there.
    pub fn find(&mut self, model: &Model, nodes: &[DVec3], state: &State) -> bool {
        let radius = |i: u32| model.chain.nodes[i as usize].radius;
        let mut changed = false;
        for pin in &mut self.pins {
            changed |= pin.shorten(nodes[pin.proxy_node as usize], radius(pin.proxy_node), &state.positions);
        }
        for contact in &state.contacts {
            let i = contact.proxy_node;
            if touches_centre(contact, radius(i)) && self.pins.iter().all(|pin| pin.proxy_node != i) {
                let pin = Pin::find(contact, nodes[i as usize], radius(i), &state.positions);
                changed |= pin.is_some();
                self.pins.extend(pin);
            }
        }
        changed
    }

    /// Puts the pins' rows into the list of contacts with the surface at `positions`.
    pub fn hold(&self, model: &Model, kc: f64, nodes: &[DVec3], positions: &[DVec3], contacts: &mut Vec<Contact>) {
        for pin in &self.pins {
            let i = pin.proxy_node as usize;
            pin.hold(nodes[i], model.chain.nodes[i].radius, kc, positions, contacts);
        }
    }

    /// Lets the multipliers take over what the springs bear; the greatest distance of a centre from its feature, in radii [1].
    pub fn take_over(&mut self, model: &Model, nodes: &[DVec3], positions: &[DVec3]) -> f64 {
        let mut farthest = 0.0f64;
        for pin in &mut self.pins {
            let i = pin.proxy_node as usize;
            let Stand { offset, directions, .. } = pin.stand(nodes[i], positions);
            farthest = farthest.max(offset.length() / model.chain.nodes[i].radius);
            for (multiplier, direction) in pin.multipliers.iter_mut().zip(directions) {
                *multiplier += direction.dot(offset);
            }
        }
        farthest
    }

    /// Takes away the pins whose force is no mean of those beside their kink; `state` is the one that they hold.
    pub fn prove(&mut self, model: &Model, detection: &mut Detection, state: &State) -> Vec<Release> {
        let Self { pins, contacts, displacement, positions } = self;
        let mut releases = Vec::new();
        pins.retain(|pin| {
            let i = pin.proxy_node;
            let radius = model.chain.nodes[i as usize].radius;
            let stand = pin.stand(detection.nodes()[i as usize], &state.positions);
            // The whole surface goes to the other side, so that what detection knows of its way holds.
            let mut beside = |side: DVec3| {
                let shift = side * (KINK_PROBE * radius);
                displacement.clear();
                let moved = |u: &[f64; 3]| (DVec3::from_array(*u) - shift).to_array();
                displacement.extend(state.displacement.as_chunks().0.iter().flat_map(moved));
                positions.clear();
                positions.extend(state.positions.iter().map(|position| *position - shift));
                detection.deformed(model, displacement, positions, Walls::All, contacts);
                let own = contacts.iter().filter(|row| row.proxy_node == i && touches_centre(row, radius));
                own.map(|row| row.normal * (model.kc * row.share * row.depth)).sum::<DVec3>()
            };
            let tolerance = model.contact.tolerance * model.kc * radius;
            let force = excess(pin.force(model.kc, &stand), &mut beside, tolerance);
            if force != DVec3::ZERO {
                releases.push(Release { nodes: pin.nodes, weights: stand.weights, force });
            }
            force == DVec3::ZERO
        });
        releases
    }

    /// Puts each pin's force as one row in the place of the rows of the kink, and takes the pins away.
    pub fn settle(&mut self, model: &Model, nodes: &[DVec3], state: &mut State) {
        for pin in self.pins.drain(..) {
            let i = pin.proxy_node as usize;
            let radius = model.chain.nodes[i].radius;
            let stand = pin.stand(nodes[i], &state.positions);
            let force = pin.force(model.kc, &stand);
            let measured = (surface::unit_or_zero(force), radius, stand.curvature);
            let row = Contact::new(pin.proxy_node, pin.nodes, stand.weights, measured);
            let share = force.length() / (model.kc * radius);
            pin.replace(radius, &mut state.contacts, std::iter::once(Contact { share, ..row }));
        }
    }
}

/// What `force` exceeds the convex hull of the forces `beside` a kink by, of which that on leaving to the side v goes farthest towards
/// -v; zero within `tolerance` (Gilbert, Johnson & Keerthi 1988) [N].
fn excess(force: DVec3, beside: &mut impl FnMut(DVec3) -> DVec3, tolerance: f64) -> DVec3 {
    let from = |triangle: [DVec3; 3]| force - point_at(triangle, closest_point(force, triangle).weights);
    let mut triangle = [beside(-surface::unit_or_zero(force)); 3];
    let mut apart = from(triangle);
    for _ in 0..KINK_PROBES {
        if apart.length() <= tolerance {
            return DVec3::ZERO;
        }
        let [a, b, c] = triangle;
        let next = beside(-apart.normalize());
        if (next - force + apart).dot(apart) <= tolerance * apart.length() {
            break;
        }
        // Inside the tetrahedron: on the same side of each face as the opposite corner.
        let same = |p: DVec3, q: DVec3, r: DVec3, other: DVec3| {
            let normal = (q - p).cross(r - p);
            normal.dot(other - p) * normal.dot(force - p) > 0.0
        };
        if same(a, b, c, next) && same(next, b, c, a) && same(a, next, c, b) && same(a, b, next, c) {
            return DVec3::ZERO;
        }
        let nearer = |s: &[DVec3; 3], t: &[DVec3; 3]| from(*s).length().total_cmp(&from(*t).length());
        triangle = [[next, b, c], [a, next, c], [a, b, next]].into_iter().min_by(nearer).unwrap_or(triangle);
        apart = from(triangle);
    }
    apart
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::sequence;

    /// Around convex bodies whose farthest point in each direction is known: a box, a flat disc, a ball.
    #[test]
    fn a_force_exceeds_a_convex_hull_by_its_distance() {
        type Body = (fn(DVec3) -> DVec3, fn(DVec3) -> f64);
        let bodies: [Body; 3] = [
            (DVec3::signum, |p| (p.abs() - DVec3::ONE).max(DVec3::ZERO).length()),
            (|v| DVec3::new(v.x, v.y, 0.0).normalize_or_zero(), |p| p.z.hypot((p.x.hypot(p.y) - 1.0).max(0.0))),
            (DVec3::normalize_or_zero, |p| (p.length() - 1.0).max(0.0)),
        ];
        let mut next = sequence(7);
        for (farthest, distance) in bodies {
            let mut counts = [0; 2];
            for _ in 0..500 {
                let force = DVec3::new(next(), next(), next()) * 1.5;
                let found = excess(force, &mut |side| farthest(-side), 1e-9);
                let expected = distance(force);
                counts[usize::from(expected > 0.0)] += 1;
                assert!((found.length() - expected).abs() < 1e-6, "{force}: {found} {expected}");
            }
            assert!(counts[1] > 100, "{counts:?}");
        }
    }
}
