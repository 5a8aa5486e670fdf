//! What viewers of robots show of a session in MCAP: each message against the session, by a reader of its own.
//! `docs/tools.py` has other programs read them.

use crate::report::{arm, counts, dataset, recording, sphere};
use glam::{DAffine3, DQuat, DVec3};
use haptize::{
    proxy::shape_frame,
    report::mcap::McapSession,
    robot::{Arm, Robot, description},
    ros::{JointStateTable, topics},
};
use std::{collections::BTreeMap, fs};

/// Reads CDR, little-endian, as the messages' definitions order it.
struct Reader<'a> {
    bytes: &'a [u8],
    at: usize,
}

impl Reader<'_> {
    fn take<const N: usize>(&mut self) -> [u8; N] {
        self.at = self.at.next_multiple_of(N);
        let taken = self.bytes[self.at..self.at + N].try_into().unwrap();
        self.at += N;
        taken
    }
    fn u32(&mut self) -> u32 {
        u32::from_le_bytes(self.take())
    }
    fn vector(&mut self) -> DVec3 {
        DVec3::from_array([0, 1, 2].map(|_| f64::from_le_bytes(self.take())))
    }
    fn string(&mut self) -> String {
        let length = self.u32() as usize;
        let text = String::from_utf8(self.bytes[self.at..self.at + length - 1].to_vec()).unwrap();
        self.at += length;
        text
    }
    fn stamp(&mut self) -> f64 {
        f64::from(self.u32()) + 1e-9 * f64::from(self.u32())
    }
    fn rotation(&mut self) -> DQuat {
        DQuat::from_array([0, 1, 2, 3].map(|_| f64::from_le_bytes(self.take())))
    }
}

/// A marker: its number, type and action, scale and points.
type Marker = ([u32; 3], DVec3, Vec<DVec3>);

fn markers(bytes: &[u8]) -> (f64, Vec<Marker>) {
    let mut reader = Reader { bytes: &bytes[4..], at: 0 };
    let (mut time, mut all) = (f64::NAN, Vec::new());
    for _ in 0..reader.u32() {
        time = reader.stamp();
        assert_eq!(reader.string(), "world");
        assert!(["object", "contact"].contains(&reader.string().as_str()));
        let numbers = [0, 1, 2].map(|_| reader.u32());
        assert_eq!((reader.vector(), reader.rotation()), (DVec3::ZERO, DQuat::IDENTITY));
        let scale = reader.vector();
        let colour = [0, 1, 2, 3].map(|_| f32::from_le_bytes(reader.take()));
        assert!(colour.iter().all(|channel| (0.0..=1.0).contains(channel)) && colour[3] == 1.0);
        assert_eq!((reader.stamp(), reader.take::<1>()), (0.0, [0]));
        let points = (0..reader.u32()).map(|_| reader.vector()).collect();
        // No colours; no texture, whose header and format are empty; no places in it; no text, mesh and file.
        assert_eq!((reader.u32(), reader.string(), reader.stamp()), (0, String::new(), 0.0));
        assert_eq!(((reader.string(), reader.string()), reader.u32(), reader.u32()), Default::default());
        assert_eq!(((reader.string(), reader.string(), reader.string()), reader.u32()), Default::default());
        assert_eq!(reader.take::<1>(), [0]);
        all.push((numbers, scale, points));
    }
    assert_eq!(reader.at, reader.bytes.len(), "a message has bytes that its definition does not name");
    (time, all)
}

#[test]
fn a_session_in_mcap_moves_the_links_the_surface_and_the_forces() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("session.mcap");
    let (chain, object) = (arm(3), sphere());
    let (dataset, trace) = (dataset(&chain, &object, counts(3)), recording(&chain, &object, 1500));
    let session = McapSession { dataset: &dataset, chain: &chain, trace: &trace, live: None };
    let moving = session.object().unwrap();
    session.write(moving.as_ref(), BTreeMap::new(), fs::File::create(&path).unwrap()).unwrap();

    // What reads joint states passes over the others.
    let names: Vec<String> = topics(&path).unwrap().into_iter().map(|topic| topic.name).collect();
    assert_eq!(names, ["/command", "/device", "/hand", "/proxy"]);
    assert_eq!(JointStateTable::open(&path, Some("/proxy")).unwrap().joints(), ["base", "shoulder", "elbow"]);

    let bytes = fs::read(&path).unwrap();
    let mut messages: BTreeMap<String, Vec<Vec<u8>>> = BTreeMap::new();
    for message in mcap::MessageStream::new(&bytes).unwrap() {
        let message = message.unwrap();
        messages.entry(message.channel.topic.clone()).or_default().push(message.data.to_vec());
    }
    assert_eq!(messages["/proxy"].len(), trace.ticks.len());

    // Links, every 20 ms.
    let mut pose = chain.new_pose();
    let transforms = &messages["/tf"];
    assert_eq!(transforms.len(), 75);
    for (number, bytes) in transforms.iter().enumerate() {
        let tick = &trace.ticks[20 * number];
        chain.pose(&tick.proxy, &mut pose);
        let mut reader = Reader { bytes: &bytes[4..], at: 0 };
        assert_eq!(reader.u32(), 3);
        for (joint, spec) in chain.joints.iter().enumerate() {
            assert!((reader.stamp() - tick.time).abs() < 1e-9);
            assert_eq!((reader.string(), reader.string()), ("world".into(), spec.name.clone()));
            let (translation, rotation) = (reader.vector(), reader.rotation());
            let place = DAffine3::from_rotation_translation(rotation, translation);
            assert!(place.abs_diff_eq(shape_frame(Some(joint), &pose), 1e-12), "{number}, {joint}");
        }
        assert_eq!(reader.at, reader.bytes.len());
    }

    // The surface of each frame, and arrows from the nodes that push, after all of the frame before are gone.
    let (surfaces, contacts) = (&messages["/object"], &messages["/contact"]);
    assert_eq!((surfaces.len(), contacts.len()), (trace.frames.len(), trace.frames.len()));
    let mut pushed = 0;
    for ((surface, contact), frame) in surfaces.iter().zip(contacts).zip(&trace.frames) {
        let (time, surface) = markers(surface);
        let [(numbers, _, corners)] = &surface[..] else { panic!("{} markers", surface.len()) };
        assert!((time - frame.time).abs() < 1e-9 && *numbers == [0, 11, 0]);
        let wanted: Vec<DVec3> = object.triangles.iter().flatten().map(|node| frame.nodes[*node as usize]).collect();
        assert_eq!(*corners, wanted);
        let (_, arrows) = markers(contact);
        assert_eq!((arrows[0].0, arrows[0].2.len()), ([0, 0, 3], 0));
        for ((numbers, scale, ends), number) in arrows[1..].iter().zip(1..) {
            assert_eq!((*numbers, ends.len()), ([number, 0, 0], 2));
            assert!(scale.min_element() > 0.0 && frame.nodes.contains(&ends[0]));
            // The arm is pushed out.
            assert!((ends[1] - ends[0]).dot(ends[0] - DVec3::new(0.2, 0.0, -0.02)) > 0.0);
        }
        pushed += usize::from(arrows.len() > 1);
    }
    assert!(pushed > 10 && pushed < trace.frames.len(), "{pushed}");
}

#[test]
fn the_described_robot_is_the_arm() {
    let chain = arm(4);
    let text = description(&chain, "arm & \"hand\"", "world", 0.002);
    let robot = Robot::parse(text.clone(), "arm.urdf").unwrap();
    let read = Arm::new(&robot, "wrist", &[]).unwrap();
    assert_eq!(read.joints.len(), 4);
    for (joint, spec) in read.joints.iter().zip(&chain.joints) {
        assert_eq!((&joint.name, joint.limits, joint.inertial.mass), (&spec.name, spec.limits, spec.mass));
        assert!((joint.origin - spec.origin).length() < 1e-12 && (joint.axis - spec.axis).length() < 1e-12);
    }
    // A rod and five balls on each of the last two links, a rod on the second; the first joint's link has no length.
    assert_eq!(text.matches("<sphere").count(), 10);
    assert_eq!(text.matches("<cylinder").count(), 3);
}
