//! What viewers of robots show in three dimensions: where the links are (`tf2_msgs/msg/TFMessage`), triangles and arrows
//! (`visualization_msgs/msg/MarkerArray`), and the robot's description (`std_msgs/msg/String`).

use super::{
    cdr::Encoder,
    message::{Message, header},
};
use glam::{DAffine3, DVec3};

/// The frame in which all is given.
pub const WORLD: &str = "world";

/// Where some frames are in the world.
pub struct Transforms {
    /// Time stamp (ns).
    pub stamp: u64,
    /// Each frame by its name, and its place (m).
    pub frames: Vec<(String, DAffine3)>,
}

impl Message for Transforms {
    const TYPE: &str = "tf2_msgs/msg/TFMessage";
    const FIELDS: &str = "geometry_msgs/TransformStamped[] transforms\n";

    fn stamp(&self) -> u64 {
        self.stamp
    }

    fn encode(&self) -> Vec<u8> {
        let mut encoder = Encoder::new();
        encoder.u32(self.frames.len() as u32);
        for (name, place) in &self.frames {
            let (_, rotation, translation) = place.to_scale_rotation_translation();
            header(&mut encoder, self.stamp, WORLD);
            encoder.string(name);
            translation.to_array().into_iter().chain(rotation.to_array()).for_each(|value| encoder.f64(value));
        }
        encoder.finish()
    }
}

/// Something that is drawn.
pub struct Marker {
    /// Name of what it belongs to.
    pub namespace: &'static str,
    /// Red, green, blue, from 0 to 1.
    pub colour: [f32; 3],
    /// Its form.
    pub form: Form,
}

/// The form of a marker.
pub enum Form {
    /// The corners of triangles, three each (m).
    Triangles(Vec<DVec3>),
    /// An arrow: its ends, and the diameter of its shaft (m).
    Arrow([DVec3; 2], f64),
    /// Nothing: whatever was drawn of the topic before goes.
    None,
}

/// Numbers of the forms, and of the actions that add a marker and delete all.
const TRIANGLES: u32 = 11;
const ARROW: u32 = 0;
const ADD: u32 = 0;
const DELETE_ALL: u32 = 3;

/// Diameter and length of an arrow's head over the diameter of its shaft (1).
const HEAD: [f64; 2] = [2.5, 4.0];

/// All markers of a topic at an instant; each has its place in the list for its number.
pub struct Markers {
    /// Time stamp (ns).
    pub stamp: u64,
    /// They.
    pub markers: Vec<Marker>,
}

impl Message for Markers {
    const TYPE: &str = "visualization_msgs/msg/MarkerArray";
    const FIELDS: &str = "visualization_msgs/Marker[] markers\n";

    fn stamp(&self) -> u64 {
        self.stamp
    }

    fn encode(&self) -> Vec<u8> {
        let mut encoder = Encoder::new();
        encoder.u32(self.markers.len() as u32);
        for (number, marker) in self.markers.iter().enumerate() {
            let (kind, action, scale, points) = match &marker.form {
                Form::Triangles(corners) => (TRIANGLES, ADD, DVec3::ONE, &corners[..]),
                Form::Arrow(ends, shaft) => (ARROW, ADD, shaft * DVec3::new(1.0, HEAD[0], HEAD[1]), &ends[..]),
                Form::None => (ARROW, DELETE_ALL, DVec3::ONE, &[][..]),
            };
            header(&mut encoder, self.stamp, WORLD);
            encoder.string(marker.namespace);
            [number as u32, kind, action].into_iter().for_each(|value| encoder.u32(value));
            let pose = [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0];
            pose.into_iter().chain(scale.to_array()).for_each(|value| encoder.f64(value));
            marker.colour.into_iter().chain([1.0]).for_each(|value| encoder.f32(value));
            // It lasts until it is replaced, and is not locked to a frame that moves.
            [0, 0].into_iter().for_each(|value| encoder.u32(value));
            encoder.u8(0);
            encoder.u32(points.len() as u32);
            points.iter().flat_map(|point| point.to_array()).for_each(|value| encoder.f64(value));
            // No colours, texture with its stamp, frame, format and data, places in it, text, mesh and its file.
            encoder.u32(0);
            encoder.string("");
            header(&mut encoder, 0, "");
            encoder.string("");
            [0, 0].into_iter().for_each(|value| encoder.u32(value));
            ["", "", ""].into_iter().for_each(|text| encoder.string(text));
            encoder.u32(0);
            encoder.u8(0);
        }
        encoder.finish()
    }
}

/// What a robot is.
pub struct RobotDescription {
    /// When it is published (ns).
    pub stamp: u64,
    /// Text of its URDF.
    pub urdf: String,
}

impl Message for RobotDescription {
    const TYPE: &str = "std_msgs/msg/String";
    const FIELDS: &str = "string data\n";

    fn stamp(&self) -> u64 {
        self.stamp
    }

    fn encode(&self) -> Vec<u8> {
        let mut encoder = Encoder::new();
        encoder.string(&self.urdf);
        encoder.finish()
    }
}
