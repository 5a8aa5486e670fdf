//! The object in the window: its nodes advanced on the GPU by the interpolated contact forces, frame after frame.

use super::{loaded::Loaded, probe::Probe, view_renderer::Surface};
use crate::{
    Error, JointVector,
    contact::Status,
    gpu::{Context, FrameMethod, FrameUpdate, GpuError},
    object::Mechanics,
    render::{
        graphics::{ContactForces, DrawnForces},
        session::Latest,
    },
    scene::{GraphicsEffects, GraphicsSpec},
};
use glam::{DVec3, Vec3};
use std::sync::Arc;

/// The object as it is drawn.
pub struct Body {
    /// The state of its nodes on the device.
    update: FrameUpdate,
    /// Buffers from which the surface is drawn.
    pub surface: Surface,
    /// n0 (m).
    rest: Vec<Vec3>,
    /// Largest displacement at rest (m) and contact force on a node (N) of the motions that can be played; of the whole
    /// dataset where these touch nothing.
    pub extremes: [f64; 2],
    contact: Arc<ContactForces>,
    forces: DrawnForces,
    /// Time between two frames of the object (s).
    period: f64,
    /// Time that the object lags behind (s).
    owed: f64,
}

/// Frames of the object that one frame of the window makes up for: a window at 10 frames a second still shows an object
/// at 60. A slower one shows it slowed down.
const MOST_FRAMES: usize = 6;

impl Body {
    /// The object of `loaded` at rest, to be moved with `effects`; none where it has no object.
    ///
    /// # Errors
    /// When the device refuses it.
    pub fn new(context: &Arc<Context>, loaded: &Loaded, effects: &GraphicsEffects) -> Result<Option<Self>, Error> {
        let (Some(object), Some(contact), Some(graphics)) =
            (&loaded.setup.object, &loaded.forces, &loaded.setup.scene.graphics)
        else {
            return Ok(None);
        };
        let relaxation = loaded.setup.scene.haptics.relaxation.as_ref();
        let (nodes, method) = (object.rest.len(), FrameMethod::suitable(object.mechanics()?));
        let graphics = GraphicsSpec { effects: *effects, ..*graphics };
        let period = 1.0 / graphics.rate;
        let update =
            FrameUpdate::remembering(Arc::clone(context), object, period, method, effects, relaxation.is_some())?;
        Ok(Some(Self {
            surface: Surface::new(context, object, &update)?,
            update,
            rest: object.rest.iter().map(|point| point.as_vec3()).collect(),
            extremes: extremes(loaded)?,
            contact: Arc::clone(contact),
            forces: DrawnForces::new(nodes, &graphics, relaxation),
            period,
            owed: 0.0,
        }))
    }

    /// Lets `elapsed` (s) go by under the contact forces of `latest`.
    ///
    /// # Errors
    /// When the device fails.
    pub fn advance(&mut self, latest: &Latest, elapsed: f64) -> Result<(), GpuError> {
        self.forces.touch(&self.contact, latest);
        self.owed += elapsed;
        let due = (self.owed / self.period).floor();
        self.owed -= due * self.period;
        for _ in 0..(due as usize).min(MOST_FRAMES) {
            let [contact, past] = self.forces.frame();
            self.update.step_remembering(contact, past)?;
        }
        Ok(())
    }

    /// Place of `node` at rest (m).
    #[must_use]
    pub fn rest(&self, node: usize) -> Vec3 {
        self.rest[node]
    }

    /// Where all its nodes are (m). Waits for the device.
    ///
    /// # Errors
    /// When the device has failed.
    pub fn places(&self) -> Result<Vec<DVec3>, GpuError> {
        let moved = self.update.drawn()?;
        Ok(self.rest.iter().zip(moved).map(|(rest, moved)| rest.as_dvec3() + moved).collect())
    }

    /// What is known of `vertex`. Waits for the device.
    ///
    /// # Errors
    /// When the device has failed.
    pub fn probe(&self, vertex: usize) -> Result<Option<Probe>, GpuError> {
        let (moved, forces) = (self.update.drawn()?, self.forces.contact());
        Ok(moved.get(vertex).map(|&displacement| Probe {
            vertex,
            displacement,
            force: forces.get(vertex).copied().unwrap_or_default(),
        }))
    }

    /// Nodes with a contact force, and that force (N).
    pub fn contacts(&self) -> impl Iterator<Item = (usize, DVec3)> {
        self.forces.contact().iter().copied().enumerate().filter(|(_, force)| *force != DVec3::ZERO)
    }
}

/// Instants of a motion that are looked at for [`Body::extremes`].
const INSTANTS: usize = 50;

/// Returns [`Body::extremes`]: those where most is pressed.
fn extremes(loaded: &Loaded) -> Result<[f64; 2], Error> {
    let (Some(object), Some(forces), Some(q)) = (&loaded.setup.object, &loaded.forces, deepest(loaded)) else {
        return Ok([0.0; 2]);
    };
    let Mechanics { moved, attachment, factor, .. } = object.mechanics()?;
    let mut acting = vec![DVec3::ZERO; object.rest.len()];
    forces.at(&q, 1.0, &mut acting);
    let largest = |sizes: &mut dyn Iterator<Item = DVec3>| sizes.map(|vector| vector.length()).fold(0.0, f64::max);
    let mut displacement = vec![DVec3::ZERO; moved.len()];
    attachment.spread(&acting, &mut displacement);
    factor.solve(&mut displacement);
    let followers = &mut (0..object.surface_nodes).map(|node| attachment.follow(node, &displacement));
    Ok([largest(followers), largest(&mut acting.into_iter())])
}

/// The configuration of the motions, or else of the whole dataset, at which the energy is greatest, or the torque.
/// Where contact is solved live, that with the greatest forces.
fn deepest(loaded: &Loaded) -> Option<JointVector> {
    let dataset = &loaded.dataset;
    let motions = loaded.motions();
    let instants = motions.iter().flat_map(|(_, motion)| {
        (0..INSTANTS).map(|k| motion.at(motion.duration() * k as f64 / (INSTANTS - 1) as f64).0)
    });
    if let (Some(_), Some(forces), Some(object)) = (&loaded.live, &loaded.forces, &loaded.setup.object) {
        let mut acting = vec![DVec3::ZERO; object.rest.len()];
        let mut total = |q: &JointVector| {
            forces.at(q, 1.0, &mut acting);
            acting.iter().map(|force| force.length()).sum::<f64>()
        };
        return instants.map(|q| (total(&q), q)).max_by(|a, b| a.0.total_cmp(&b.0)).map(|(_, q)| q);
    }
    let weight = |point: usize| match &dataset.energy {
        Some(energy) => energy[point],
        None => dataset.torque(point).iter().map(|tau| tau * tau).sum(),
    };
    let deepest = |points: &mut dyn Iterator<Item = usize>| {
        let converged = points.filter(|&point| dataset.status(point) == Status::Contact);
        converged.max_by(|&a, &b| weight(a).total_cmp(&weight(b)))
    };
    let shown = deepest(&mut instants.filter_map(|q| dataset.grid.nearest(&q)));
    shown.or_else(|| deepest(&mut (0..dataset.grid.points()))).map(|point| dataset.grid.configuration(point))
}
