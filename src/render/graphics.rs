//! The object as it is drawn: contact forces move its nodes, frame by frame (section 3.2).
//!
//! *Forces*: see [`ContactForces`].
//!
//! *Smoothing*, where the scene names it: f_ex_bar passes a low-pass filter of time constant tau_s,
//! `f_k = f_{k-1} + (1 - exp(-T/tau_s)) (f_ex_bar - f_{k-1})`. The object is passive towards the filtered forces.
//!
//! *Memory*, where the object relaxes: see [`ObjectMemory`].
//!
//! *Motion*: see [`ObjectMotion`].

use super::session::Latest;
pub use super::{contact_forces::ContactForces, object_memory::ObjectMemory, object_motion::ObjectMotion};
use crate::{
    Error,
    object::Object,
    scene::{GraphicsSpec, RelaxationSpec},
};
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

/// Forces under which the object is drawn.
pub struct DrawnForces {
    /// Of contact, at each node (N).
    contact: Vec<DVec3>,
    smoothing: Option<Smoothing>,
    /// Where the object relaxes, with the sum of its past and of contact (N).
    memory: Option<(ObjectMemory, Vec<DVec3>)>,
}

impl DrawnForces {
    /// None yet, of `nodes` nodes in frames at the rate and with the effects of `spec`, on an object that relaxes as
    /// `relaxation` says.
    #[must_use]
    pub fn new(nodes: usize, spec: &GraphicsSpec, relaxation: Option<&RelaxationSpec>) -> Self {
        let period = 1.0 / spec.rate;
        Self {
            contact: vec![DVec3::ZERO; nodes],
            smoothing: spec.effects.smoothing.map(|time| Smoothing::new(time, period, nodes)),
            memory: relaxation.map(|spec| (ObjectMemory::new(spec, period, nodes), vec![DVec3::ZERO; nodes])),
        }
    }

    /// Takes the forces of `contact` as they were `latest`.
    pub fn touch(&mut self, contact: &ContactForces, latest: &Latest) {
        contact.at(&latest.proxy, latest.share, &mut self.contact);
        if let (Some((memory, _)), None) = (&mut self.memory, latest.dent) {
            memory.clear();
        }
    }

    /// The forces of contact, one for each node of the object (N).
    #[must_use]
    pub fn contact(&self) -> &[DVec3] {
        &self.contact
    }

    /// Lets a frame go by; returns the forces in it: those of contact, smoothed, and the body force of the object's past
    /// (N).
    pub fn frame(&mut self) -> &[DVec3] {
        let contact = match &mut self.smoothing {
            Some(smoothing) => smoothing.toward(&self.contact),
            None => &self.contact,
        };
        let Some((memory, sum)) = &mut self.memory else { return contact };
        for ((sum, contact), past) in sum.iter_mut().zip(contact).zip(memory.frame(contact)) {
            *sum = *contact + *past;
        }
        sum
    }
}

/// The graphics loop's part of a session.
pub struct Graphics<'object> {
    contact: ContactForces,
    motion: ObjectMotion<'object>,
    forces: DrawnForces,
}

impl<'object> Graphics<'object> {
    /// `object`, which relaxes as `relaxation` says, deformed by the forces of `contact`, at the rate and with the
    /// effects of `spec`.
    ///
    /// # Errors
    /// When object and rate do not make a loop.
    pub fn new(
        contact: ContactForces,
        object: &'object Object,
        spec: &GraphicsSpec,
        relaxation: Option<&RelaxationSpec>,
    ) -> Result<Self, Error> {
        let motion = ObjectMotion::new(object, 1.0 / spec.rate, &spec.effects)?;
        Ok(Self { contact, motion, forces: DrawnForces::new(object.rest.len(), spec, relaxation) })
    }

    /// One frame with the contact that was `latest`. An object without dynamics is moved only where the frame
    /// `is_seen`: what follows does not depend on where it is.
    pub fn frame(&mut self, latest: &Latest, is_seen: bool) {
        self.forces.touch(&self.contact, latest);
        let forces = self.forces.frame();
        if is_seen || self.motion.has_dynamics() {
            self.motion.step(forces);
        }
    }

    /// The object as it is now.
    #[must_use]
    pub fn motion(&self) -> &ObjectMotion<'object> {
        &self.motion
    }
}
