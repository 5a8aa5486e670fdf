//! Contact nodes in a tree of spheres, link by link: how deep an arm of thousands of nodes is in the object at rest,
//! with a few of them looked at.

use super::Model;
use crate::proxy::Chain;
use glam::DVec3;

/// Nodes in a leaf at most (1).
const LEAF: usize = 4;

/// A sphere around contact nodes of one link.
struct Sphere {
    /// In the link's frame (m).
    centre: DVec3,
    /// Holds the nodes with their own radii (m).
    radius: f64,
    /// The nodes, as places in [`NodeTree::nodes`].
    nodes: std::ops::Range<usize>,
    /// The sphere that follows once this one and all in it are done with; a sphere that is no leaf is followed by its
    /// first half.
    next: usize,
}

/// The contact nodes of an arm.
pub struct NodeTree {
    /// Spheres in the order of a search in depth, and the link of each.
    spheres: Vec<(usize, Sphere)>,
    /// Numbers of the nodes, sphere by sphere.
    nodes: Vec<usize>,
}

impl NodeTree {
    /// The tree of the nodes of `chain`.
    #[must_use]
    pub fn new(chain: &Chain) -> Self {
        let mut tree = Self { spheres: Vec::new(), nodes: (0..chain.nodes.len()).collect() };
        let mut first = 0;
        for nodes in chain.nodes.chunk_by(|a, b| a.link == b.link) {
            tree.divide(chain, first..first + nodes.len());
            first += nodes.len();
        }
        tree
    }

    /// Adds the sphere around the nodes in `places`, and those around its halves.
    fn divide(&mut self, chain: &Chain, places: std::ops::Range<usize>) {
        let nodes = &mut self.nodes[places.clone()];
        let position = |node: usize| chain.nodes[node].position;
        let low = nodes.iter().fold(DVec3::INFINITY, |low, node| low.min(position(*node)));
        let high = nodes.iter().fold(DVec3::NEG_INFINITY, |high, node| high.max(position(*node)));
        let centre = low.midpoint(high);
        let farthest = |far: f64, node: &usize| far.max(position(*node).distance(centre) + chain.nodes[*node].radius);
        let radius = nodes.iter().fold(0.0, farthest);
        let link = nodes.first().map_or(0, |node| chain.nodes[*node].link);
        let this = self.spheres.len();
        if nodes.len() > LEAF {
            let axis = (high - low).max_position();
            nodes.sort_by(|a, b| position(*a)[axis].total_cmp(&position(*b)[axis]));
            let middle = places.start + nodes.len() / 2;
            self.spheres.push((link, Sphere { centre, radius, nodes: places.clone(), next: 0 }));
            self.divide(chain, places.start..middle);
            self.divide(chain, middle..places.end);
        } else {
            self.spheres.push((link, Sphere { centre, radius, nodes: places, next: 0 }));
        }
        self.spheres[this].1.next = self.spheres.len();
    }

    /// The gap of `model`, whose arm the tree is of, at the joint coordinates `q` where the arm touches the object, and
    /// zero elsewhere (m): [`Proximity::gap`](super::Proximity::gap) is the same below zero, with every node looked at.
    #[must_use]
    pub fn touching_gap(&self, model: &Model<'_>, q: &[f64]) -> f64 {
        self.gap_below(model, q, 0.0)
    }

    /// Whether the arm of `model` at the joint coordinates `q` is apart from the object, rounded or not.
    #[must_use]
    pub fn is_apart(&self, model: &Model<'_>, q: &[f64]) -> bool {
        let limit = model.rounded.as_ref().map_or(0.0, |rounded| rounded.blur());
        self.gap_below(model, q, limit) >= limit
    }

    /// The gap to the surface where it is less than `limit` (m), which it is else.
    fn gap_below(&self, model: &Model<'_>, q: &[f64], limit: f64) -> f64 {
        let Model { chain, surface, .. } = model;
        let (links, mut least, mut place) = (chain.links(q), limit, 0);
        while let Some((link, sphere)) = self.spheres.get(place) {
            let (origin, rotation) = (links.origins[*link] - surface.centre, links.rotations[*link]);
            let (bound, _) = surface.distance_bound(origin + rotation * sphere.centre);
            if bound - sphere.radius >= least {
                place = sphere.next;
                continue;
            }
            place += 1;
            if sphere.next > place {
                continue;
            }
            for &node in &self.nodes[sphere.nodes.clone()] {
                let x = origin + rotation * chain.nodes[node].position;
                let radius = chain.nodes[node].radius;
                let (bound, near) = surface.distance_bound(x);
                if bound - radius < least {
                    least = least.min(surface.signed_distance(x, near.unwrap_or(u32::MAX)) - radius);
                }
            }
        }
        least
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        contact::Proximity,
        fixtures::bodies::{PAPER, contact, sphere},
        random::Random,
        scene::{ContactLaw, ContactSpec, ContactSurface, JointKind, JointSpec, ProxyNodeSpec, ProxySpec},
    };
    use glam::DMat3;

    /// Three links with balls and points around their axes, so long that most of them is far from a sphere of 50 mm.
    fn arm() -> Chain {
        let mut random = Random::new(5);
        let joints = (0..3_usize).map(|link| JointSpec {
            follows: None,
            name: format!("joint {link}"),
            kind: if link == 1 { JointKind::Prismatic } else { JointKind::Revolute },
            origin: DVec3::new(0.0, 0.05, 0.02 * link as f64),
            axis: [DVec3::Z, DVec3::X, DVec3::Y][link],
            limits: [-3.0, 3.0],
            mass: 1.0,
            centre_of_mass: DVec3::ZERO,
            inertia: DMat3::IDENTITY,
            rotor_inertia: 1.0,
            nodes: (0..50 * link)
                .map(|i| {
                    let mut on = |size: f64| random.between(-size, size);
                    ProxyNodeSpec {
                        position: DVec3::new(on(0.005), on(0.1), on(0.005)),
                        radius: if i % 3 == 0 { 0.004 } else { 0.0 },
                        length: 0.0,
                    }
                })
                .collect(),
        });
        Chain::new(&ProxySpec { joints: joints.collect(), ..Default::default() })
    }

    #[test]
    fn the_tree_finds_the_gap_that_a_look_at_every_node_finds() {
        let (object, chain) = (sphere(PAPER).unwrap(), arm());
        let rest = ContactSpec { law: ContactLaw::Rest, ..contact(500.0) };
        for (surface, round) in
            [(ContactSurface::Facets, None), (ContactSurface::Smooth, None), (ContactSurface::Facets, Some(0.01))]
        {
            let model = Model::new(&object, &chain, ContactSpec { surface, round, ..rest });
            assert_eq!(model.rounded.is_some(), round.is_some());
            let (tree, mut proximity, mut random) = (NodeTree::new(&chain), Proximity::new(&model), Random::new(1));
            let (mut touching, mut apart, mut seen) = (0, 0, 0);
            for _ in 0..2000 {
                let q = [random.between(-3.0, 3.0), random.between(-0.2, 0.2), random.between(-3.0, 3.0)];
                let (found, gap) = (tree.touching_gap(&model, &q), proximity.gap(&q));
                *(if gap < 0.0 { &mut touching } else { &mut apart }) += 1;
                seen += usize::from(tree.is_apart(&model, &q));
                if round.is_some() {
                    assert!(gap >= 0.0 || !tree.is_apart(&model, &q), "{q:?}: {gap}");
                } else {
                    assert!((found - gap.min(0.0)).abs() < 1e-15, "{q:?}: {found} {gap}");
                    assert_eq!(tree.is_apart(&model, &q), gap >= 0.0, "{q:?}: {gap}");
                }
            }
            assert!(10 * seen > 9 * apart, "{seen} of {apart}");
            assert!(touching > 100 && apart > 100, "{touching} touch, {apart} do not");
        }
    }
}
