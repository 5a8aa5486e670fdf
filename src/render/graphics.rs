//! The object as it is drawn: contact forces move its nodes, frame by frame (section 3.2).
//!
//! *Forces*: see [`ContactForces`].
//!
//! *Smoothing*, where the scene names it: f_ex_bar passes a low-pass filter of time constant tau_s,
//! `f_k = f_{k-1} + (1 - exp(-T/tau_s)) (f_ex_bar - f_{k-1})`. The object is passive towards the filtered forces.
//!
//! *Motion*: see [`ObjectMotion`].

pub use super::{contact_forces::ContactForces, object_motion::ObjectMotion};
use crate::{Error, object::Object, scene::GraphicsSpec};
use glam::DVec3;

/// A low-pass filter on the contact forces.
#[derive(Clone, Debug)]
pub struct Smoothing {
    /// 1 - exp(-T/tau_s).
    share: f64,
    /// (N)
    filtered: Vec<DVec3>,
}

impl Smoothing {
    /// A filter of `time_constant` tau_s (s), for frames every `period` T (s) of `nodes` nodes; zero at first.
    #[must_use]
    pub fn new(time_constant: f64, period: f64, nodes: usize) -> Self {
        Self { share: -(-period / time_constant).exp_m1(), filtered: vec![DVec3::ZERO; nodes] }
    }

    /// The filtered forces one frame later, `forces` having acted (N).
    pub fn toward(&mut self, forces: &[DVec3]) -> &[DVec3] {
        for (filtered, force) in self.filtered.iter_mut().zip(forces) {
            *filtered += self.share * (*force - *filtered);
        }
        &self.filtered
    }
}

/// The graphics loop's part of a session.
pub struct Graphics<'object> {
    contact: ContactForces,
    motion: ObjectMotion<'object>,
    forces: Vec<DVec3>,
    smoothing: Option<Smoothing>,
}

impl<'object> Graphics<'object> {
    /// `object`, deformed by the forces of `contact`, at the rate and with the effects of `spec`.
    ///
    /// # Errors
    /// When object and rate do not make a loop.
    pub fn new(contact: ContactForces, object: &'object Object, spec: &GraphicsSpec) -> Result<Self, Error> {
        let nodes = object.rest.len();
        let motion = ObjectMotion::new(object, 1.0 / spec.rate, &spec.effects)?;
        let smoothing = spec.effects.smoothing.map(|time| Smoothing::new(time, motion.period(), nodes));
        Ok(Self { contact, motion, forces: vec![DVec3::ZERO; nodes], smoothing })
    }

    /// One frame with the proxy at `q`, where the field puts `share` on the dataset's torque; zero out of contact.
    pub fn frame(&mut self, q: &[f64], share: f64) {
        self.contact.at(q, share, &mut self.forces);
        let forces = match &mut self.smoothing {
            Some(smoothing) => smoothing.toward(&self.forces),
            None => &self.forces,
        };
        self.motion.step(forces);
    }

    /// The object as it is now.
    #[must_use]
    pub fn motion(&self) -> &ObjectMotion<'object> {
        &self.motion
    }
}
