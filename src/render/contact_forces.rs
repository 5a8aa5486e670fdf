//! Contact forces on the object's nodes, for what is drawn: interpolated between the grid points of a dataset that
//! holds them, or solved where the proxy is.
//!
//! *Interpolated.* The extended contact force f_ex(q) of a grid point has f_j at its contacting nodes and zero
//! elsewhere. Between grid points `f_ex_bar(q) = share sum_c w_c f_ex(q_c)`, with the corners and weights of the torque
//! and the factor that boundary layer and fade put on it, so that what is seen and what is felt stay
//! `tau_bar = -sum_i J_i^T f`.
//!
//! *Solved.* A store of nodes at several levels keeps no forces, and a scene that is solved live has stored nothing.
//! There the equilibrium is solved once a frame; its forces are those of the configuration itself.

use super::{force_rows::ForceRows, live::LiveScene};
use crate::{
    Error,
    contact::{NodeForce, Solver, Status},
    dataset::{Dataset, Surface},
    error,
    scene::Scene,
    sweep::Direct,
};
use glam::DVec3;
use std::sync::Arc;

/// Contact forces on the object's nodes at any configuration.
pub struct ContactForces(Source);

enum Source {
    Stored(Box<ForceRows>),
    /// By the scene's own law.
    Solved(Box<Direct>),
    /// By the law at rest.
    Live(Arc<LiveScene>),
}

impl ContactForces {
    /// The contact forces of `dataset` on an object of `nodes` nodes.
    ///
    /// # Errors
    /// When there are none, or they do not fit.
    pub fn new(dataset: &Dataset, nodes: usize) -> Result<Self, Error> {
        let source = match &dataset.surface {
            Some(surface) if dataset.refinement.is_some() => Source::Solved(Box::new(solved(dataset, surface, nodes)?)),
            _ => {
                let contacts = dataset
                    .contacts
                    .as_ref()
                    .ok_or("the dataset holds no contact forces: name [graphics] in its scene and bake it again")?;
                let rows = ForceRows::new(&dataset.grid, contacts, nodes).ok_or_else(|| misfit(nodes))?;
                Source::Stored(Box::new(rows))
            }
        };
        Ok(Self(source))
    }

    /// Those of a scene that is solved live.
    #[must_use]
    pub fn live(scene: Arc<LiveScene>) -> Self {
        Self(Source::Live(scene))
    }

    /// Whether `dataset` has them: stored, or because its object is known and can be solved with.
    #[must_use]
    pub fn known(dataset: &Dataset) -> bool {
        dataset.contacts.is_some() || dataset.refinement.is_some() && dataset.surface.is_some()
    }

    /// Writes the forces at `q`, times `share`, to `forces`, one entry per node of the object (N). Where an equilibrium
    /// is solved for them this takes as long; where none is found they are zero.
    pub fn at(&self, q: &[f64], share: f64, forces: &mut [DVec3]) {
        forces.fill(DVec3::ZERO);
        let direct = match &self.0 {
            Source::Stored(rows) => {
                return rows.at(q, share, |node, scale, force| forces[node] += scale * force);
            }
            Source::Solved(direct) => direct,
            Source::Live(scene) => scene.direct(),
        };
        // Out of contact nothing is solved.
        if share > 0.0 {
            let equilibrium = Solver::new(direct.model()).solve(q);
            let solved = equilibrium.forces.iter().filter(|_| equilibrium.status == Status::Contact);
            solved.for_each(|&NodeForce { node, force }| forces[node as usize] += share * force);
        }
    }
}

/// The error of rows of contact forces that fit neither the grid nor an object of `nodes` nodes.
fn misfit(nodes: usize) -> Error {
    error!("the dataset's contact forces do not fit its grid and an object of {nodes} nodes: bake it again")
}

/// The scene of `dataset`, prepared to be solved with the geometry that it holds.
fn solved(dataset: &Dataset, surface: &Surface, nodes: usize) -> Result<Direct, Error> {
    let wrong = |error: &dyn std::fmt::Display| error!("contact cannot be solved for what is drawn: {error}");
    let scene =
        Scene::of_dataset(&dataset.scene, "scene", &dataset.provenance.algorithm).map_err(|error| wrong(&error))?;
    let object = surface.object(&scene.object).map_err(|error| wrong(&error))?;
    if object.rest.len() != nodes {
        return Err(misfit(nodes));
    }
    Direct::of(&scene, object).map_err(|error| wrong(&error))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        proxy::Chain,
        store::{Space, Store},
        sweep::{CpuBackend, build_object, grid_of, model_within},
    };
    use std::sync::Arc;

    /// The demo's scene with a store of which nothing is solved: what is drawn does not depend on what was stored.
    #[test]
    fn over_a_store_the_forces_are_those_of_the_equilibrium_at_the_proxy() {
        let text = include_str!("../../datasets/sphere.toml").replace("subdivisions = 4", "subdivisions = 2");
        let scene = Scene::parse(&text, "sphere.toml").unwrap();
        let (object, chain) = (build_object(&scene).unwrap(), Chain::new(&scene.proxy));
        let (grid, nodes) = (grid_of(&scene), object.rest.len());
        let store = Arc::new(Store::new(Space::new(&grid, 2).unwrap()));
        let provenance = CpuBackend::provenance(&scene);
        let mut dataset = Dataset::refined(store, grid, Some(Surface::of(&object)), text, provenance);
        let model = model_within(&scene, &object, &chain).unwrap();
        let equilibrium = Solver::new(&model).solve(&scene.motion.press[2].q);
        assert_eq!(equilibrium.status, Status::Contact);
        let drawn = ContactForces::new(&dataset, nodes).unwrap();
        let mut forces = vec![DVec3::ONE; nodes];
        for share in [1.0, 0.25] {
            drawn.at(&scene.motion.press[2].q, share, &mut forces);
            let mut expected = vec![DVec3::ZERO; nodes];
            equilibrium.forces.iter().for_each(|f| expected[f.node as usize] = share * f.force);
            assert_eq!(forces, expected);
        }
        drawn.at(&scene.motion.press[2].q, 0.0, &mut forces);
        assert!(forces.iter().all(|force| *force == DVec3::ZERO));
        // Where nothing touches, and where numbers are none.
        for q in [[0.0, 0.943, -1.6], [f64::NAN; 3]] {
            drawn.at(&q, 1.0, &mut forces);
            assert!(forces.iter().all(|force| *force == DVec3::ZERO), "{q:?}");
        }
        let refused =
            |dataset: &Dataset, nodes| ContactForces::new(dataset, nodes).err().map(|error| error.to_string());
        assert!(refused(&dataset, nodes + 1).is_some_and(|why| why.contains("do not fit")));
        dataset.scene = "not a scene".into();
        assert!(refused(&dataset, nodes).is_some_and(|why| why.contains("cannot be solved")));
    }
}
