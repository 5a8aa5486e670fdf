//! How near the arm comes to an object that it touches at no point of a grid, and where: what to move, and how far.

use super::build_object;
use crate::{
    Error,
    contact::{Model, NearestNode, Proximity},
    dataset::Dataset,
    object::Object,
    proxy::Chain,
    scene::Scene,
};
use glam::DVec3;
use serde::Serialize;
use std::fmt;

/// The nearest approach of an arm to an object at rest.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Clearance {
    /// Configuration (rad or m).
    pub q: Vec<f64>,
    /// Name of the joint whose link carries the nearest contact node.
    pub link: String,
    /// The nearest contact node.
    #[serde(flatten)]
    pub nearest: NearestNode,
    /// How the object moves to meet the node (m).
    pub motion: DVec3,
}

impl Clearance {
    /// The least gap over the grid of `dataset`; absent where something is in contact, or where the dataset does not
    /// hold object and gaps.
    ///
    /// # Errors
    /// When the object of the dataset cannot be built.
    pub fn of(dataset: &Dataset) -> Result<Option<Self>, Error> {
        let (Some(gaps), Some(surface)) = (&dataset.gap, &dataset.surface) else { return Ok(None) };
        if (0..dataset.grid.points()).any(|point| dataset.status(point).is_in_contact()) {
            return Ok(None);
        }
        let Ok(scene) = Scene::parse(&dataset.scene, "scene") else { return Ok(None) };
        let object = surface.object(&scene.object)?;
        Self::measure(&scene, &object, |proximity| {
            let mut least = (f64::INFINITY, None);
            for (point, &bound) in gaps.iter().enumerate() {
                // What is stored of a point that was not solved is a lower bound of its gap.
                if f64::from(bound) < least.0 {
                    let q = dataset.grid.configuration(point);
                    let gap = proximity.gap(&q);
                    if gap < least.0 {
                        least = (gap, Some(q.to_vec()));
                    }
                }
            }
            least.1
        })
    }

    /// The gap of `scene` at `q`.
    ///
    /// # Errors
    /// When the object cannot be built.
    pub fn at(scene: &Scene, q: &[f64]) -> Result<Option<Self>, Error> {
        Self::measure(scene, &build_object(scene)?, |_| Some(q.to_vec()))
    }

    /// Measures where `choose` says.
    fn measure(
        scene: &Scene,
        object: &Object,
        choose: impl FnOnce(&mut Proximity<'_>) -> Option<Vec<f64>>,
    ) -> Result<Option<Self>, Error> {
        let chain = Chain::new(&scene.proxy);
        // No compliance is needed where nothing is solved.
        let model = Model::reaching(object, &chain, scene.contact, &[])?;
        let mut proximity = Proximity::new(&model);
        let Some(q) = choose(&mut proximity) else { return Ok(None) };
        Ok(Some(Self::near(&model, &q)))
    }

    /// The gap of `model` at `q`.
    #[must_use]
    pub fn near(model: &Model<'_>, q: &[f64]) -> Self {
        let nearest = Proximity::new(model).nearest(q);
        let node = &model.chain.nodes[nearest.node];
        let way = nearest.position - nearest.surface;
        // The surface of the node is nearer than its middle by the radius.
        let motion = way - node.radius * way.normalize_or_zero();
        Self { q: q.to_vec(), link: model.chain.links[node.link].spec.name.clone(), nearest, motion }
    }
}

impl fmt::Display for Clearance {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { q, link, nearest: NearestNode { node, gap, position, surface }, motion } = self;
        let list = |values: &[f64]| {
            let values: Vec<String> = values.iter().map(|value| format!("{:.4}", value + 0.0)).collect();
            format!("[{}]", values.join(", "))
        };
        let place = |point: &DVec3| list(&point.to_array());
        write!(
            f,
            "the least gap is {:.3} mm, at q = {}: contact node {node} of link `{link}` at {} m stands off {} m on the \
             object; moving the object by {} m, or the arm by the opposite, closes it",
            1e3 * gap,
            list(q),
            place(position),
            place(surface),
            place(motion)
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A finger that slides down onto a ball, whose top is at z = 0.05 m, and ends before it.
    const SCENE: &str = r#"
        [object]
        node_mass = 0.005
        sphere = { radius = 0.05, rings = 11, segments = 12 }
        springs = { kind = "isotropic", stiffness = 300.0 }
        ground = { stiffness = 100.0 }
        [[proxy.joint]]
        name = "lift"
        kind = "prismatic"
        axis = [0.0, 0.0, -1.0]
        limits = [0.0, 0.2]
        nodes = [{ at = [0.02, 0.0, 0.25] }, { at = [0.0, 0.0, 0.2], radius = 0.01 }]
        [contact]
        stiffness = 1000.0
        [grid]
        axes = [{ start = 0.0, stop = 0.1, count = 11 }]
    "#;

    fn baked(scene: &Scene) -> Dataset {
        crate::sweep::baked(scene).unwrap().0
    }

    #[test]
    fn the_least_gap_is_that_of_the_nearest_node_and_what_closes_it_makes_contact() {
        let scene = Scene::parse(SCENE, "free.toml").unwrap();
        let clearance = Clearance::of(&baked(&scene)).unwrap().unwrap();
        // The last point, z = 0.2 - 0.1 less the radius, above the top.
        assert!((clearance.nearest.gap - 0.04).abs() < 1e-12 && (clearance.q[0] - 0.1).abs() < 1e-12, "{clearance}");
        assert_eq!((clearance.nearest.node, clearance.link.as_str()), (1, "lift"));
        assert!(clearance.motion.distance(DVec3::new(0.0, 0.0, 0.04)) < 1e-12, "{clearance}");
        assert!(clearance.to_string().contains("40.000 mm"), "{clearance}");

        // The arm moved by the opposite and a little more touches.
        let base = format!("origin = [0.0, 0.0, {}]\n        axis", -1.01 * clearance.motion.z);
        let moved = Scene::parse(
            &SCENE.replace("axis = [0.0, 0.0, -1.0]", &format!("{base} = [0.0, 0.0, -1.0]")),
            "moved.toml",
        );
        assert_eq!(Clearance::of(&baked(&moved.unwrap())).unwrap(), None, "something is in contact");
    }
}
