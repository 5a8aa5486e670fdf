//! The object in the window: its nodes advanced by the interpolated contact forces, frame after frame: on the GPU, or on
//! the CPU where that moves it no better (see [`FrameUpdate::suits`]), or it relaxes.

use super::{
    links::filled,
    loaded::Loaded,
    probe::Probe,
    view_renderer::{Quantity, Surface},
};
use crate::{
    Error, JointVector,
    contact::Status,
    error,
    gpu::{Context, FrameUpdate, GpuError},
    object::Mechanics,
    render::{
        graphics::{ContactForces, DrawnForces, ObjectMotion},
        session::Latest,
        setup::Setup,
    },
    scene::{GraphicsEffects, GraphicsSpec},
};
use glam::{DVec3, Vec3};
use std::{
    sync::Arc,
    time::{Duration, Instant},
};

/// The object as it is drawn.
pub struct Body {
    motion: Motion,
    /// Buffers from which the surface is drawn.
    pub surface: Surface,
    /// n0 (m).
    rest: Vec<Vec3>,
    /// Largest displacement at rest (m) and contact force on a node (N) of the motions that can be played; of the whole
    /// dataset where these touch nothing.
    extremes: [f64; 2],
    contact: Arc<ContactForces>,
    forces: DrawnForces,
    /// Time between two frames of the object (s).
    period: f64,
    /// Time that the object lags behind (s).
    owed: f64,
}

/// What moves the nodes.
enum Motion {
    /// The device.
    Device(Box<FrameUpdate>),
    /// The CPU, from which the device takes what is drawn.
    Host(Box<HostMotion>),
}

struct HostMotion {
    moved: MovedObject,
    context: Arc<Context>,
    /// Displacements (m) and contact forces (N) of the object's nodes, four numbers a node.
    drawn: [wgpu::Buffer; 2],
}

self_cell::self_cell!(
    struct MovedObject {
        owner: Arc<Setup>,
        #[covariant]
        dependent: ObjectMotion,
    }
);

/// Frames of the object that one frame of the window makes up for: a window at 10 frames a second still shows an object
/// at 60. A slower one shows it slowed down.
const MOST_FRAMES: usize = 6;

/// Time after which no further frame is made up for, where the CPU moves the object: the window goes on answering.
const MOST_TIME: Duration = Duration::from_millis(16);

impl Body {
    /// The object of `loaded` at rest, to be moved with `effects`; none where it has no object.
    ///
    /// # Errors
    /// When the device refuses it.
    pub fn new(context: &Arc<Context>, loaded: &Loaded, effects: &GraphicsEffects) -> Result<Option<Self>, Error> {
        Self::moved(context, loaded, effects, FrameUpdate::suits)
    }

    /// The same, moved by the device where its mechanics are `suited`.
    fn moved(
        context: &Arc<Context>,
        loaded: &Loaded,
        effects: &GraphicsEffects,
        suited: fn(&Mechanics, &GraphicsEffects) -> bool,
    ) -> Result<Option<Self>, Error> {
        let (Some(object), Some(contact), Some(graphics)) =
            (&loaded.setup.object, &loaded.forces, &loaded.setup.scene.graphics)
        else {
            return Ok(None);
        };
        let relaxation = loaded.setup.scene.haptics.relaxation.as_ref();
        let nodes = object.rest.len();
        let graphics = GraphicsSpec { effects: *effects, ..*graphics };
        let period = 1.0 / graphics.rate;
        let motion = if relaxation.is_none() && suited(object.mechanics()?, effects) {
            Motion::Device(Box::new(FrameUpdate::new(Arc::clone(context), object, period)?))
        } else {
            let moved = MovedObject::try_new(Arc::clone(&loaded.setup), |setup| match &setup.object {
                Some(object) => ObjectMotion::new(object, period, effects),
                None => Err(error!("there is no object")),
            })?;
            Motion::Host(Box::new(HostMotion::new(context, moved, nodes)?))
        };
        let drawn = match &motion {
            Motion::Device(update) => [update.state_buffer(), update.force_buffer()],
            Motion::Host(host) => host.drawn.each_ref(),
        };
        Ok(Some(Self {
            surface: Surface::new(context, object, drawn)?,
            motion,
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
        let began = Instant::now();
        for _ in 0..(due as usize).min(MOST_FRAMES) {
            let forces = self.forces.frame();
            match &mut self.motion {
                Motion::Device(update) => update.step(forces)?,
                Motion::Host(host) if began.elapsed() < MOST_TIME => {
                    host.moved.with_dependent_mut(|_, motion| {
                        motion.step(forces);
                    });
                }
                Motion::Host(_) => {}
            }
        }
        match &self.motion {
            Motion::Host(host) if due > 0.0 => host.show(self.forces.contact()),
            _ => Ok(()),
        }
    }

    /// What is shown deepest of `quantity` (m or N).
    #[must_use]
    pub fn most(&self, quantity: Quantity) -> f64 {
        self.extremes[usize::from(quantity == Quantity::Force)]
    }

    /// Place of `node` at rest (m).
    #[must_use]
    pub fn rest(&self, node: usize) -> Vec3 {
        self.rest[node]
    }

    /// How far its nodes are from their places at rest (m). Waits for the device that moves them.
    fn displacements(&self) -> Result<Vec<DVec3>, GpuError> {
        match &self.motion {
            Motion::Device(update) => update.read().map(|(displacements, _)| displacements),
            Motion::Host(host) => Ok(host.moved.borrow_dependent().displacements().collect()),
        }
    }

    /// Where its nodes are (m).
    ///
    /// # Errors
    /// When the device has failed.
    pub fn places(&self) -> Result<Vec<DVec3>, GpuError> {
        let moved = self.displacements()?;
        Ok(self.rest.iter().zip(moved).map(|(rest, moved)| rest.as_dvec3() + moved).collect())
    }

    /// What is known of `vertex`.
    ///
    /// # Errors
    /// When the device has failed.
    pub fn probe(&self, vertex: usize) -> Result<Option<Probe>, GpuError> {
        let (moved, forces) = (self.displacements()?, self.forces.contact());
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

impl HostMotion {
    fn new(context: &Arc<Context>, moved: MovedObject, nodes: usize) -> Result<Self, GpuError> {
        let zero = vec![[0.0_f32; 4]; nodes];
        let buffer = |device: &wgpu::Device, label| {
            filled(device, &context.queue, label, bytemuck::cast_slice(&zero), wgpu::BufferUsages::STORAGE)
        };
        let drawn =
            context.scoped(|device| ["drawn displacements", "drawn forces"].map(|label| buffer(device, label)))?;
        let host = Self { moved, context: Arc::clone(context), drawn };
        host.show(&[])?;
        Ok(host)
    }

    /// Gives the device the nodes as they are, and the forces of `contact` on them (N).
    fn show(&self, contact: &[DVec3]) -> Result<(), GpuError> {
        let [displacements, forces] = &self.drawn;
        let write = |buffer, vectors: &mut dyn Iterator<Item = DVec3>| {
            let padded: Vec<[f32; 4]> = vectors.map(|vector| vector.as_vec3().extend(0.0).to_array()).collect();
            self.context.queue.write_buffer(buffer, 0, bytemuck::cast_slice(&padded));
        };
        write(displacements, &mut self.moved.borrow_dependent().displacements());
        write(forces, &mut contact.iter().copied());
        self.context.check()
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        draw::camera::Camera,
        gpu::AdapterChoice,
        scene::Scene,
        viewer::{
            pixels,
            view_renderer::{Look, ViewRenderer},
        },
    };

    #[test]
    fn a_body_that_the_cpu_moves_looks_as_one_that_the_gpu_moves() {
        let text = include_str!("../../tests/scenes/sphere.toml");
        let mut scene = Scene::parse(text, "sphere.toml").unwrap();
        scene.haptics.relaxation = None;
        let loaded = Loaded::live(scene).unwrap();
        let context = Arc::new(Context::open(AdapterChoice::Any).unwrap());
        let mut renderer = ViewRenderer::new(Arc::clone(&context), 1).unwrap();
        let q = deepest(&loaded).unwrap();
        let latest = Latest { proxy: q, device: q, share: 1.0, dent: Some(0.0), ..Latest::default() };
        // Pictures at rest and pressed, by displacement and by force.
        let suited: [fn(&Mechanics, &GraphicsEffects) -> bool; 2] = [|_, _| true, |_, _| false];
        let pictures = suited.map(|suited| {
            let effects = GraphicsEffects::default();
            let mut body = Body::moved(&context, &loaded, &effects, suited).unwrap().unwrap();
            let mut seen = Vec::new();
            for elapsed in [0.0, 0.05] {
                body.advance(&latest, elapsed).unwrap();
                for quantity in [Quantity::Displacement, Quantity::Force] {
                    let look = Look {
                        background: [0.0; 3],
                        quantity,
                        colour_top: body.most(quantity) as f32,
                        edge_width: 0.0,
                        object: glam::DAffine3::IDENTITY,
                        ground: (-1.0, [0.0; 3]),
                    };
                    let camera = Camera::looking_at(DVec3::ZERO, 0.05);
                    let picture =
                        renderer.draw([160, 120], &camera, &look, Some(&body.surface), None, (&[], 0)).unwrap();
                    seen.push(pixels::read(&context, picture).unwrap());
                }
            }
            (matches!(body.motion, Motion::Device(_)), seen)
        });
        let apart = |a: &[u8], b: &[u8]| a.iter().zip(b).filter(|(a, b)| a.abs_diff(**b) > 2).count();
        let [(true, device), (false, host)] = &pictures else { panic!("one on each") };
        for (device, host) in device.iter().zip(host) {
            // A pixel on an edge may fall to either side: f32 differs by a part in 1e6.
            assert!(apart(device, host) < device.len() / 1000);
        }
        // Either picture changes where the arm presses, by much more.
        assert!((0..2).all(|k| apart(&host[k], &host[k + 2]) > host[k].len() / 100));
    }
}
