//! Which surface nodes the proxy can reach, and whether a result stays within them.
//!
//! With |u| <= m everywhere, the closest triangle of the deformed surface to a proxy node that is D from it at rest
//! lies within D + 2 m of the node at rest (see `detection`). So a result is the same, whatever the compliance leaves
//! out, if it covers all facets so near to each touching node. Beforehand m is not known; a surface that gives way to a
//! proxy whose deepest node is d below it moves by about d, hardly by more than [`EXPECTED_MOTION`] d. Results that
//! need more are found and flagged.

use super::detection::Detection;
use super::geometry::RestSurface;
use super::law::rounded::Rounded;
use super::model::{Model, greatest_radius};
use super::thin_parts;
use super::{NodeTree, Proximity, Solver, Status};
use crate::object::{Compliance, Object};
use crate::proxy::Chain;
use crate::scene::{ContactLaw, ContactSpec};
use crate::{Error, JointVector, error, memory};
use rayon::prelude::*;

/// How far the surface of an object is expected to move, in depths of the deepest proxy node below it at rest (1): in
/// stiff contact it moves by that depth along the normal, and as much again leaves room for what neighbouring nodes
/// drag along.
const EXPECTED_MOTION: f64 = 2.0;

/// Least thickness of a part of a rounded object, over the length (1). The blend of a place on its surface spans two
/// lengths to each side, and so no farther than to the middle of the part: depth and direction there are those of the
/// face but for what the correction leaves, some hundredths. In the middle four fifths of the depth are left.
const THICKNESS: f64 = 4.0;

/// Memory of a point of the lattice (bytes): a row of the surface at rest and a corrected one, which hang on a facet's
/// nodes and on those of seven facets, most of them shared.
const POINT_BYTES: usize = 2048;

/// Configurations that one thread takes at a time.
const SHARE: usize = 256;

impl<'a> Model<'a> {
    /// The greatest length over which the object can be rounded (m).
    #[must_use]
    pub fn greatest_rounding(&self) -> f64 {
        greatest_rounding(&self.surface)
    }

    /// Points of a rounded surface's lattice up to which the compliance on all is formed: as much memory and time as
    /// [`Model::WHOLE`] surface nodes take.
    const WHOLE_POINTS: usize = 3 * Self::WHOLE;

    /// The same for contact at or near `configurations`: of an object with more than [`Model::WHOLE`] surface nodes,
    /// only the compliance of those within the proxy's reach is formed, and none where there is no configuration. One
    /// that reaches farther is flagged [`Status::Overflow`].
    ///
    /// # Errors
    /// When the compliance would not fit in memory.
    pub fn reaching(
        object: &'a Object,
        chain: &'a Chain,
        contact: ContactSpec,
        configurations: &[JointVector],
    ) -> Result<Self, Error> {
        if contact.round.is_some() {
            check_rounding(&RestSurface::new(object, contact.surface), chain, contact)?;
        }
        let mut model = Self::with_compliance(object, chain, contact, Compliance::on(object, Vec::new())?);
        model.reach(configurations)?;
        Ok(model)
    }

    /// The same for `q` alone: of any object only the compliance of what the proxy reaches there is formed, unless an
    /// earlier run has kept that of all nodes, or `q` is flagged [`Status::Overflow`] with less.
    ///
    /// # Errors
    /// As [`Model::reaching`].
    pub fn at(object: &'a Object, chain: &'a Chain, contact: ContactSpec, q: &JointVector) -> Result<Self, Error> {
        let configurations = std::slice::from_ref(q);
        if object.surface_nodes > Self::WHOLE || Compliance::is_kept(object) {
            return Self::reaching(object, chain, contact, configurations);
        }
        let mut model = Self::reaching(object, chain, contact, &[])?;
        model.form(configurations, false)?;
        if Solver::new(&model).solve(q).status == Status::Overflow {
            model.reach(configurations)?;
        }
        Ok(model)
    }

    /// Forms what contact at or near `configurations` needs, in the place of what there is.
    ///
    /// # Errors
    /// As [`Model::reaching`].
    pub fn reach(&mut self, configurations: &[JointVector]) -> Result<(), Error> {
        self.form(configurations, self.object.surface_nodes <= Self::WHOLE && !configurations.is_empty())
    }

    /// The same, of all nodes if `is_whole`.
    fn form(&mut self, configurations: &[JointVector], is_whole: bool) -> Result<(), Error> {
        let object = self.object;
        if is_whole {
            self.take_compliance(Compliance::on(object, (0..object.surface_nodes as u32).collect())?);
        }
        if let Some(rounded) = self.rounded.clone() {
            let mut points = rounded.near(greatest_radius(self.chain));
            if configurations.is_empty() || count(&points) > Self::WHOLE_POINTS {
                points = reached(self, configurations);
                check_points(count(&points))?;
            }
            if !is_whole {
                self.take_compliance(Compliance::on(object, rounded.nodes(&points))?);
            }
            self.want(points);
        } else if !is_whole {
            let nodes = nodes_of_leaves(self, &reached(self, configurations));
            self.take_compliance(Compliance::on(object, nodes)?);
        }
        Ok(())
    }
}

/// What of `model` the proxy reaches in `configurations`: points of a rounded surface, or leaves of the surface's tree.
fn reached(model: &Model<'_>, configurations: &[JointVector]) -> Vec<bool> {
    let count = model.rounded.as_ref().map_or(model.surface.bounds.leaves.len(), |rounded| rounded.count());
    let tree = NodeTree::new(model.chain);
    configurations
        .par_chunks(SHARE)
        .map_init(
            || Proximity::new(model),
            |proximity, share| {
                let mut marked = vec![false; count];
                let near = share.iter().filter(|q| !tree.is_apart(model, q));
                near.for_each(|q| mark(model, proximity, q, &mut marked));
                marked
            },
        )
        .reduce(
            || vec![false; count],
            |mut all, some| {
                all.iter_mut().zip(some).for_each(|(all, some)| *all |= some);
                all
            },
        )
}

/// How many are true.
fn count(marked: &[bool]) -> usize {
    marked.iter().filter(|marked| **marked).count()
}

/// Surface nodes on which the leaves `marked` hang, ascending.
fn nodes_of_leaves(model: &Model<'_>, marked: &[bool]) -> Vec<u32> {
    let mut reached = vec![false; model.surface.positions.len()];
    for (leaf, _) in model.surface.bounds.leaves.iter().zip(marked).filter(|(_, marked)| **marked) {
        let carriers = leaf.triangles.iter().flat_map(|&t| model.surface.carriers(t).0);
        carriers.for_each(|&node| reached[node as usize] = true);
    }
    (0..).zip(reached).filter(|(_, reached)| *reached).map(|(node, _)| node).collect()
}

/// Marks the points, or the leaves of the surface's tree, that matter at `q`.
fn mark(model: &Model<'_>, proximity: &mut Proximity<'_>, q: &JointVector, marked: &mut [bool]) {
    let gap = proximity.gap(q);
    if gap >= 0.0 {
        return;
    }
    let motion = -EXPECTED_MOTION * gap;
    for ((clearance, node), x) in proximity.clearances().zip(&model.chain.nodes).zip(&proximity.pose().nodes) {
        if clearance > motion {
            continue;
        }
        let radius = (clearance + node.radius).abs() + 2.0 * motion;
        let x = *x - model.surface.centre;
        if let Some(rounded) = &model.rounded {
            rounded.mark(x, 2.0 * motion, marked);
            continue;
        }
        let radius = radius + model.surface.bulge;
        let squared = radius * radius + model.surface.bounds.slack(x);
        model.surface.bounds.walk(x, squared, |leaf| {
            marked[leaf] = true;
            squared
        });
    }
}

/// The greatest length over which `surface` can be rounded, a quarter of the thickness of its thinnest part (m).
fn greatest_rounding(surface: &RestSurface<'_>) -> f64 {
    thin_parts::least_thickness(surface) / THICKNESS
}

/// Checks that `surface` can be rounded for `chain` as `contact` says.
///
/// # Errors
/// When a part of it is too thin, or the lattice would not fit in memory.
fn check_rounding(surface: &RestSurface<'_>, chain: &Chain, contact: ContactSpec) -> Result<(), Error> {
    let Some(length) = contact.round.filter(|_| contact.law == ContactLaw::Rest) else { return Ok(()) };
    let millimetres = |length: f64| 1e3 * length;
    let greatest = greatest_rounding(surface);
    if length > greatest {
        return Err(error!(
            "the object has a part {:.1} mm thick, and contact is rounded over {:.1} mm: its sides would blend into one. \
             Take round up to {:.1} mm, a quarter of the thickness, or leave it out of [contact]",
            millimetres(THICKNESS * greatest),
            millimetres(length),
            millimetres(greatest),
        ));
    }
    let points = Rounded::points(surface, length, greatest_radius(chain));
    let points = points.into_iter().fold(1, usize::saturating_mul);
    check_memory(points, points.saturating_mul(POINT_BYTES))
}

/// Checks that the compliance on `points` of the lattice would fit in memory.
fn check_points(points: usize) -> Result<(), Error> {
    // What it is made of takes as much for the time being.
    check_memory(points, points.saturating_mul(points).saturating_mul(2 * size_of::<f64>()))
}

/// Checks that `bytes` for `points` of the lattice would fit in memory.
fn check_memory(points: usize, bytes: usize) -> Result<(), Error> {
    memory::check(bytes).map_err(|shortage| {
        error!(
            "the lattice that rounds contact has {points} points, and does not fit in memory: {shortage}; round over a \
             greater length, or shorten the ranges of the joints"
        )
    })
}

/// Whether the compliance covers all that a result depends on whose forces are on the object's nodes `loaded` and on the
/// proxy's nodes `touching`, where no point of the surface has moved by more than `moved` (m).
pub(crate) fn covers(
    model: &Model<'_>,
    detection: &Detection,
    mut loaded: impl Iterator<Item = u32>,
    touching: impl Iterator<Item = usize>,
    moved: f64,
) -> bool {
    if let Some(rounded) = &model.rounded {
        let mut points = touching.filter_map(|i| rounded.blend(detection.nodes()[i]));
        return points.all(|blend| rounded.values(&blend).all(|(l, _)| model.condensed.place(l).is_some()));
    }
    if model.compliance.is_whole() {
        return true;
    }
    let covered = |node: u32| model.compliance.place(node).is_some();
    let mut within = loaded.all(covered);
    for i in touching {
        let (x, distance) = (detection.nodes()[i], detection.distance(i));
        let radius = distance.abs() + 2.0 * moved + model.surface.bulge;
        let squared = radius * radius + model.surface.bounds.slack(x);
        model.surface.bounds.walk(x, squared, |leaf| {
            if !model.covered_leaves[leaf] {
                let near = model.surface.bounds.leaves[leaf].near(x, squared);
                within &= near.flat_map(|t| model.surface.carriers(t).0).all(|&node| covered(node));
            }
            // Nothing more can change.
            if within { squared } else { -1.0 }
        });
    }
    within
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::object::{Compliance, Object};
    use crate::proxy::Chain;
    use crate::scene::Scene;

    const SCENE: &str = r#"
        [object]
        sphere = { radius = 0.05, rings = 25, segments = 26 }
        springs = { kind = "isotropic", stiffness = 300.0 }
        ground = { stiffness = 100.0 }
        [contact]
        stiffness = 300.0
        [grid]
        axes = [{ start = -0.2, stop = 0.2, count = 5 }, { start = 0.0, stop = 0.004, count = 5 }]
        [[proxy.joint]]
        kind = "revolute"
        axis = [0.0, 1.0, 0.0]
        limits = [-4.0, 4.0]
        [[proxy.joint]]
        kind = "prismatic"
        axis = [0.0, 0.0, -1.0]
        limits = [-0.1, 0.1]
        nodes = [{ from = [-0.004, 0.0, 0.05], to = [0.004, 0.0, 0.05], count = 3 }]
    "#;

    #[test]
    fn what_is_out_of_reach_changes_no_result_and_reaching_farther_is_flagged() {
        let scene = Scene::parse(SCENE, "reach.toml").unwrap();
        let object = Object::build(&scene.object).unwrap();
        let chain = Chain::new(&scene.proxy);
        let whole = Model::new(&object, &chain, scene.contact);
        let mut configurations = Vec::new();
        for turn in 0..9 {
            for depth in 0..9 {
                configurations.push(JointVector::from_slice(&[0.05 * f64::from(turn - 4), 0.0005 * f64::from(depth)]));
            }
        }
        let nodes = nodes_of_leaves(&whole, &reached(&whole, &configurations));
        assert!(nodes.len() > 10 && 2 * nodes.len() < object.surface_nodes, "{} nodes", nodes.len());
        let mut some = Model::new(&object, &chain, scene.contact);
        some.take_compliance(Compliance::on(&object, nodes).unwrap());
        let (mut solver, mut reference) = (Solver::new(&some), Solver::new(&whole));
        let mut touching = 0;
        for q in &configurations {
            let (found, expected) = (solver.solve(q), reference.solve(q));
            assert_eq!(found.status, expected.status, "{:?}", &q[..]);
            assert!((found.energy - expected.energy).abs() <= 1e-9 * expected.energy);
            for (found, expected) in found.torque.iter().zip(expected.torque.iter()) {
                assert!((found - expected).abs() < 1e-9, "{found} {expected}");
            }
            touching += usize::from(found.status == Status::Contact);
        }
        assert!(touching > 30, "{touching}");
        // On the other side of the object, and much deeper.
        for q in [[3.0, 0.002], [0.0, 0.03]] {
            assert_eq!(reference.solve(&q).status, Status::Contact);
            assert_eq!(solver.solve(&q).status, Status::Overflow, "{q:?}");
        }
    }
}
