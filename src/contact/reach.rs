//! Which surface nodes the proxy can reach, and whether a result stays within them.
//!
//! With |u| <= m everywhere, the closest triangle of the deformed surface to a proxy node that is D from it at rest
//! lies within D + 2 m of the node at rest (see `detection`). So a result is the same, whatever the compliance leaves
//! out, if it covers all facets so near to each touching node. Beforehand m is not known; a surface that gives way to a
//! proxy whose deepest node is d below it moves by about d, hardly by more than [`EXPECTED_MOTION`] d. Results that
//! need more are found and flagged.

use super::Proximity;
use super::detection::Detection;
use super::model::Model;
use crate::Error;
use crate::JointVector;
use crate::object::{Compliance, Object};
use crate::proxy::Chain;
use crate::scene::ContactSpec;
use rayon::prelude::*;

/// How far the surface of an object is expected to move, in depths of the deepest proxy node below it at rest (1): in
/// stiff contact it moves by that depth along the normal, and as much again leaves room for what neighbouring nodes
/// drag along.
const EXPECTED_MOTION: f64 = 2.0;

/// Configurations that one thread takes at a time.
const SHARE: usize = 256;

impl<'a> Model<'a> {
    /// The same for contact at or near `configurations`: of an object with more than [`Model::WHOLE`] surface nodes,
    /// only the compliance of those within the proxy's reach is formed, and none where there is no configuration. One
    /// that reaches farther is flagged [`super::Status::Overflow`].
    ///
    /// # Errors
    /// When the compliance would not fit in memory.
    pub fn reaching(
        object: &'a Object,
        chain: &'a Chain,
        contact: ContactSpec,
        configurations: &[JointVector],
    ) -> Result<Self, Error> {
        if object.surface_nodes <= Self::WHOLE && !configurations.is_empty() {
            let whole = Compliance::on(object, (0..object.surface_nodes as u32).collect())?;
            return Ok(Self::with_compliance(object, chain, contact, whole));
        }
        let mut model = Self::with_compliance(object, chain, contact, Compliance::on(object, Vec::new())?);
        let nodes = reached(&model, configurations);
        model.take_compliance(Compliance::on(object, nodes)?);
        Ok(model)
    }
}

/// Surface nodes of `model` that the proxy reaches in `configurations`, ascending.
fn reached(model: &Model<'_>, configurations: &[JointVector]) -> Vec<u32> {
    let marked = configurations
        .par_chunks(SHARE)
        .map_init(
            || Proximity::new(model),
            |proximity, share| {
                let mut marked = vec![false; model.surface.bounds.leaves.len()];
                share.iter().for_each(|q| mark(model, proximity, q, &mut marked));
                marked
            },
        )
        .reduce(
            || vec![false; model.surface.bounds.leaves.len()],
            |mut all, some| {
                all.iter_mut().zip(some).for_each(|(all, some)| *all |= some);
                all
            },
        );
    let mut reached = vec![false; model.surface.positions.len()];
    for (leaf, _) in model.surface.bounds.leaves.iter().zip(marked).filter(|(_, marked)| *marked) {
        let carriers = leaf.triangles.iter().flat_map(|&t| model.surface.carriers(t).0);
        carriers.for_each(|&node| reached[node as usize] = true);
    }
    (0..).zip(reached).filter(|(_, reached)| *reached).map(|(node, _)| node).collect()
}

/// Marks the leaves of the surface's tree that matter at `q`.
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
        let (x, radius) = (*x - model.surface.centre, radius + model.surface.bulge);
        let squared = radius * radius + model.surface.bounds.slack(x);
        model.surface.bounds.walk(x, squared, |leaf| {
            marked[leaf] = true;
            squared
        });
    }
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
    use crate::contact::{Solver, Status};
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
        let nodes = reached(&whole, &configurations);
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
