//! Contact forces on the object's nodes, for what is drawn: interpolated between the grid points of a dataset that
//! holds them, or solved where the proxy is.
//!
//! *Interpolated.* The extended contact force f_ex(q) of a grid point has f_j at its contacting nodes and zero
//! elsewhere. Between grid points `f_ex_bar(q) = share sum_c w_c f_ex(q_c)`, with the corners and weights of the torque
//! and the factor that boundary layer and fade put on it, so that what is seen and what is felt stay
//! `tau_bar = -sum_i J_i^T f`.
//!
//! *Solved.* A store of nodes at several levels keeps no forces. There a thread of its own solves the equilibrium of
//! the scene in the dataset once a frame; its forces are those of the configuration itself.

use super::{force_rows::ForceRows, graphics_error::GraphicsError};
use crate::{
    contact::{Model, NodeForce, Solver, Status},
    dataset::{Dataset, Surface},
    proxy::Chain,
    scene::Scene,
    sweep::sample,
};
use glam::DVec3;
use std::{
    sync::{
        Mutex, PoisonError,
        mpsc::{self, Receiver, Sender},
    },
    thread,
};

/// Contact forces on the object's nodes at any configuration.
pub struct ContactForces(Source);

enum Source {
    Stored(Box<ForceRows>),
    Solved(Mutex<AtTheProxy>),
}

impl ContactForces {
    /// The contact forces of `dataset` on an object of `nodes` nodes.
    ///
    /// # Errors
    /// When there are none, or they do not fit.
    pub fn new(dataset: &Dataset, nodes: usize) -> Result<Self, GraphicsError> {
        let solved = dataset.refinement.is_some();
        let source = match &dataset.surface {
            Some(surface) if solved => Source::Solved(Mutex::new(AtTheProxy::new(dataset, surface, nodes)?)),
            _ => {
                let contacts = dataset.contacts.as_ref().ok_or(GraphicsError::NoForces)?;
                let rows = ForceRows::new(&dataset.grid, contacts, nodes).ok_or(GraphicsError::Rows { nodes })?;
                Source::Stored(Box::new(rows))
            }
        };
        Ok(Self(source))
    }

    /// Whether `dataset` has them: stored, or because its object is known and can be solved with.
    #[must_use]
    pub fn known(dataset: &Dataset) -> bool {
        dataset.contacts.is_some() || dataset.refinement.is_some() && dataset.surface.is_some()
    }

    /// Writes the forces at `q`, times `share`, to `forces`, one entry per node of the object (N). Where an equilibrium
    /// is solved for them, this waits for it; where none is found they are zero.
    pub fn at(&self, q: &[f64], share: f64, forces: &mut [DVec3]) {
        forces.fill(DVec3::ZERO);
        match &self.0 {
            Source::Stored(rows) => rows.at(q, share, |node, scale, force| forces[node] += scale * force),
            // A panic elsewhere leaves nothing half-written in it.
            Source::Solved(solved) => {
                solved.lock().unwrap_or_else(PoisonError::into_inner).add(q, share, forces);
            }
        }
    }
}

/// Equilibria solved on request by a thread that holds object, chain and solver.
struct AtTheProxy {
    wanted: Sender<Vec<f64>>,
    solved: Receiver<Vec<NodeForce>>,
}

impl AtTheProxy {
    fn new(dataset: &Dataset, surface: &Surface, nodes: usize) -> Result<Self, GraphicsError> {
        let scene = Scene::parse(&dataset.scene, "scene").map_err(|error| GraphicsError::Solved(error.to_string()))?;
        let object = surface.object(&scene.object).map_err(|error| GraphicsError::Solved(error.to_string()))?;
        if object.rest.len() != nodes {
            return Err(GraphicsError::Rows { nodes });
        }
        let (wanted, places) = mpsc::channel::<Vec<f64>>();
        let (answer, solved) = mpsc::channel();
        let (report, ready) = mpsc::channel();
        let work = move || {
            let chain = Chain::new(&scene.proxy);
            let model = match Model::reaching(&object, &chain, scene.contact, &sample(&scene)) {
                Ok(model) => model,
                Err(error) => return drop(report.send(Err(error.to_string()))),
            };
            let mut solver = Solver::new(&model);
            drop(report.send(Ok(())));
            for q in places {
                let equilibrium = solver.solve(&q);
                let forces = if equilibrium.status == Status::Contact { equilibrium.forces } else { Vec::new() };
                if answer.send(forces).is_err() {
                    break;
                }
            }
        };
        let begun = thread::Builder::new().name("drawn contact".into()).spawn(work);
        begun.map_err(|error| GraphicsError::Threads(error.to_string()))?;
        let ended = || Err("its thread ended".to_owned());
        ready.recv().unwrap_or_else(|_| ended()).map_err(GraphicsError::Solved)?;
        Ok(Self { wanted, solved })
    }

    fn add(&self, q: &[f64], share: f64, forces: &mut [DVec3]) {
        // Out of contact nothing is solved. A thread that is gone answers nothing, and nothing moves.
        if share > 0.0
            && self.wanted.send(q.to_vec()).is_ok()
            && let Ok(solved) = self.solved.recv()
        {
            for NodeForce { node, force } in solved {
                forces[node as usize] += share * force;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        store::{Space, Store},
        sweep::{CpuBackend, build_object, grid_of},
    };
    use std::sync::Arc;

    /// The demo's scene with a store of which nothing is solved: what is drawn does not depend on what was stored.
    #[test]
    fn over_a_store_the_forces_are_those_of_the_equilibrium_at_the_proxy() {
        let text = include_str!("../../datasets/sphere.toml").replace("subdivisions = 4", "subdivisions = 2");
        let scene = Scene::parse(&text, "sphere.toml").unwrap();
        let (object, chain) = (build_object(&scene).unwrap(), Chain::new(&scene.proxy));
        let (grid, nodes) = (grid_of(&scene), object.rest.len());
        let store = Arc::new(Store::new(Space::new(&grid, 2).unwrap(), 0));
        let provenance = CpuBackend::provenance(&scene);
        let mut dataset = Dataset::refined(store, grid, Some(Surface::of(&object)), text, provenance);
        let model = Model::reaching(&object, &chain, scene.contact, &sample(&scene)).unwrap();
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
        assert!(matches!(ContactForces::new(&dataset, nodes + 1), Err(GraphicsError::Rows { .. })));
        dataset.scene = "not a scene".into();
        assert!(matches!(ContactForces::new(&dataset, nodes), Err(GraphicsError::Solved(_))));
    }
}
