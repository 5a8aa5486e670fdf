//! A session as an MCAP file, for programs that plot, show and replay logs of robots.
//!
//! Four topics of joint states, one message a tick: `/device` (position y, velocity, torque that the device held),
//! `/proxy` (position x, contact torque), `/hand` (where the hand wants the device), `/command` (position y, torque
//! that the loop asked for). Stamps count from the session's start. `/hand` is a motion that `play` takes again; what
//! is needed to replay a session bit for bit is in its CSV recording only.
//!
//! For the eye, `/tf` and `/robot_description` move the arm, `/object` is its surface and `/contact` the forces on the
//! arm, of each frame.

use super::object::{FORCE, Instant, Magnitudes, instants_at};
use crate::{
    Error, JointVector,
    dataset::Dataset,
    draw::colour::{Colour, ColourMap},
    proxy::{Chain, shape_frame},
    render::{
        live::LiveScene,
        trace::{Tick, Trace},
    },
    robot::description,
    ros::{Form, HAND_TOPIC, JointState, Marker, Markers, MessageWriter, RobotDescription, Transforms, WORLD},
};
use std::{
    collections::BTreeMap,
    io::{self, Write},
    sync::Arc,
};

/// What a session in MCAP says was written by.
pub const LIBRARY: &str = "haptize";

/// Time between two messages of where the links are (ns): 50 a second, between which viewers interpolate.
const POSE_PERIOD: u64 = 20_000_000;

/// Triangles that all messages of the object's surface have together (1), each 72 bytes: 7 MB. A large object moves at
/// fewer instants than its forces.
const MOST_TRIANGLES: usize = 100_000;

/// Diameter of arrows over the object's radius (1).
const SHAFT: f64 = 0.04;

/// What a session was.
pub struct McapSession<'a> {
    /// Its dataset.
    pub dataset: &'a Dataset,
    /// The arm.
    pub chain: &'a Chain,
    /// What was recorded.
    pub trace: &'a Trace,
    /// The scene, where contact was solved in every tick.
    pub live: Option<&'a Arc<LiveScene>>,
}

/// The object of a session at the instants of its frames.
pub struct MovingObject {
    triangles: Vec<[u32; 3]>,
    instants: Vec<Instant>,
    magnitudes: Magnitudes,
}

impl McapSession<'_> {
    /// Returns the object as it moves; none without frames of one.
    ///
    /// # Errors
    /// When frames, dataset and chain do not belong together.
    pub fn object(&self) -> Result<Option<MovingObject>, Error> {
        let Self { dataset, chain, trace, live } = *self;
        let Some(surface) = dataset.surface.as_ref().filter(|_| !trace.frames.is_empty()) else { return Ok(None) };
        let instants = instants_at(dataset, chain, trace, trace.frames.iter(), live.cloned())?;
        let magnitudes = Magnitudes::of(&surface.places().collect::<Vec<_>>(), &instants);
        Ok(Some(MovingObject { triangles: surface.facets().to_vec(), magnitudes, instants }))
    }

    /// Writes the session, whose `object` this is, to `out`; `facts` about it go into the file's metadata.
    ///
    /// # Errors
    /// Those of `out`.
    pub fn write(
        &self,
        object: Option<&MovingObject>,
        facts: BTreeMap<String, String>,
        out: impl Write,
    ) -> io::Result<()> {
        let Self { chain, trace, .. } = *self;
        let names: Vec<String> = trace.joints.iter().map(|joint| joint.name.clone()).collect();
        let mut writer = MessageWriter::new(out, LIBRARY)?;
        let mut topic = |name| writer.topic::<JointState>(name);
        let topics = [topic("/device")?, topic("/proxy")?, topic(HAND_TOPIC)?, topic("/command")?];
        let mut shown = Shown::begin(&mut writer, chain, object)?;
        let mut before: Option<&Tick> = None;
        for tick in &trace.ticks {
            let mut velocity = JointVector::zeros(names.len());
            if let Some(before) = before.filter(|before| before.time < tick.time) {
                for (a, velocity) in velocity.iter_mut().enumerate() {
                    *velocity = (tick.device[a] - before.device[a]) / (tick.time - before.time);
                }
            }
            before = Some(tick);
            let none = JointVector::zeros(0);
            let states = [
                (&tick.device, &velocity, &tick.applied.torque),
                (&tick.proxy, &none, &tick.sample.torque),
                (&tick.hand, &none, &none),
                (&tick.device, &none, &tick.device_torque),
            ];
            for (topic, (position, velocity, effort)) in topics.into_iter().zip(states) {
                let state = JointState {
                    stamp: nanoseconds(tick.time),
                    frame: String::new(),
                    names: names.clone(),
                    position: position.to_vec(),
                    velocity: velocity.to_vec(),
                    effort: effort.to_vec(),
                };
                writer.write(topic, &state)?;
            }
            shown.write(&mut writer, tick)?;
        }
        writer.finish(facts)
    }
}

/// The topics for the eye, and how far they are.
struct Shown<'a> {
    chain: &'a Chain,
    object: Option<&'a MovingObject>,
    transforms: u16,
    /// Topics of surface and forces.
    markers: Option<[u16; 2]>,
    /// When the places of the links are due (ns).
    next: u64,
    /// Instants that are written.
    written: usize,
}

impl<'a> Shown<'a> {
    fn begin<W: Write>(
        writer: &mut MessageWriter<W>,
        chain: &'a Chain,
        object: Option<&'a MovingObject>,
    ) -> io::Result<Self> {
        let transforms = writer.topic::<Transforms>("/tf")?;
        let topic = writer.topic::<RobotDescription>("/robot_description")?;
        let reach: f64 = chain.links.iter().map(|link| link.spec.origin.length()).sum();
        let urdf = description(chain, "arm", WORLD, RADIUS * reach.max(f64::MIN_POSITIVE));
        writer.write(topic, &RobotDescription { stamp: 0, urdf })?;
        let mut topic = |name| writer.topic::<Markers>(name);
        let markers = object.map(|_| Ok::<_, io::Error>([topic("/object")?, topic("/contact")?])).transpose()?;
        Ok(Self { chain, object, transforms, markers, next: 0, written: 0 })
    }

    fn write<W: Write>(&mut self, writer: &mut MessageWriter<W>, tick: &Tick) -> io::Result<()> {
        let stamp = nanoseconds(tick.time);
        if stamp >= self.next {
            self.next = stamp + POSE_PERIOD;
            let mut pose = self.chain.new_pose();
            self.chain.pose(&tick.proxy, &mut pose);
            let links = self.chain.links.iter().enumerate();
            let frames =
                links.map(|(number, link)| (link.spec.name.clone(), shape_frame(Some(number), &pose))).collect();
            writer.write(self.transforms, &Transforms { stamp, frames })?;
        }
        let Some((object, [surface, contact])) = self.object.zip(self.markers) else { return Ok(()) };
        let every = (object.instants.len() * object.triangles.len()).div_ceil(MOST_TRIANGLES).max(1);
        while let Some(instant) = object.instants.get(self.written).filter(|instant| instant.time <= tick.time) {
            let stamp = nanoseconds(instant.time);
            if self.written.is_multiple_of(every) {
                writer.write(surface, &Markers { stamp, markers: vec![object.surface(instant)] })?;
            }
            writer.write(contact, &Markers { stamp, markers: object.forces(instant) })?;
            self.written += 1;
        }
        Ok(())
    }
}

/// Radius of the rods of the described arm over its length (1).
const RADIUS: f64 = 0.01;

impl MovingObject {
    fn surface(&self, instant: &Instant) -> Marker {
        let corners = self.triangles.iter().flatten().map(|node| instant.nodes[*node as usize]).collect();
        let colour = ColourMap::Pale { low: 0.0, high: 1.0 }.colour(0.4);
        Marker { namespace: "object", colour: colour.channels(), form: Form::Triangles(corners) }
    }

    /// Forces on the arm, from the nodes that push; those of the instant before go.
    fn forces(&self, instant: &Instant) -> Vec<Marker> {
        let marker = |form| Marker { namespace: "contact", colour: Colour::channels(FORCE), form };
        let arrows = instant.forces.iter().filter_map(|at| {
            let tail = *instant.nodes.get(at.node as usize)?;
            Some(marker(Form::Arrow([tail, tail + self.magnitudes.arrow(at.force)], SHAFT * self.magnitudes.radius)))
        });
        [marker(Form::None)].into_iter().chain(arrows).collect()
    }
}

/// Returns `seconds` in whole nanoseconds.
fn nanoseconds(seconds: f64) -> u64 {
    (seconds * 1e9).round() as u64
}
