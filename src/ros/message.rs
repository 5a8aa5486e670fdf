//! What is common to all messages: a type, its definition, a stamp and bytes.

use super::cdr::Encoder;

/// Nanoseconds of a second.
pub(super) const NANOSECONDS: u64 = 1_000_000_000;

/// A message of ROS 2.
pub trait Message {
    /// Name of its type.
    const TYPE: &str;
    /// Types and names of its fields, those of ROS 2.
    const FIELDS: &str;

    /// Time stamp (ns).
    fn stamp(&self) -> u64;

    /// Returns the message in CDR, little-endian.
    fn encode(&self) -> Vec<u8>;
}

/// Fields of the types that others are made of.
const PARTS: [(&str, &str); 14] = [
    ("std_msgs/Header", "builtin_interfaces/Time stamp\nstring frame_id\n"),
    ("builtin_interfaces/Time", "int32 sec\nuint32 nanosec\n"),
    ("builtin_interfaces/Duration", "int32 sec\nuint32 nanosec\n"),
    ("geometry_msgs/Vector3", "float64 x\nfloat64 y\nfloat64 z\n"),
    ("geometry_msgs/Point", "float64 x\nfloat64 y\nfloat64 z\n"),
    ("geometry_msgs/Quaternion", "float64 x\nfloat64 y\nfloat64 z\nfloat64 w\n"),
    ("geometry_msgs/Pose", "geometry_msgs/Point position\ngeometry_msgs/Quaternion orientation\n"),
    ("geometry_msgs/Transform", "geometry_msgs/Vector3 translation\ngeometry_msgs/Quaternion rotation\n"),
    (
        "geometry_msgs/TransformStamped",
        "std_msgs/Header header\nstring child_frame_id\ngeometry_msgs/Transform transform\n",
    ),
    ("std_msgs/ColorRGBA", "float32 r\nfloat32 g\nfloat32 b\nfloat32 a\n"),
    ("sensor_msgs/CompressedImage", "std_msgs/Header header\nstring format\nuint8[] data\n"),
    (
        "visualization_msgs/Marker",
        "std_msgs/Header header\nstring ns\nint32 id\nint32 type\nint32 action\ngeometry_msgs/Pose pose\n\
         geometry_msgs/Vector3 scale\nstd_msgs/ColorRGBA color\nbuiltin_interfaces/Duration lifetime\n\
         bool frame_locked\ngeometry_msgs/Point[] points\nstd_msgs/ColorRGBA[] colors\nstring texture_resource\n\
         sensor_msgs/CompressedImage texture\nvisualization_msgs/UVCoordinate[] uv_coordinates\nstring text\n\
         string mesh_resource\nvisualization_msgs/MeshFile mesh_file\nbool mesh_use_embedded_materials\n",
    ),
    ("visualization_msgs/UVCoordinate", "float32 u\nfloat32 v\n"),
    ("visualization_msgs/MeshFile", "string filename\nuint8[] data\n"),
];

/// What stands between the definitions of two types.
const RULE: &str = "================================================================================\n";

/// Returns the definition of `M` as MCAP files carry it: its fields, then those of each type that it is made of.
pub(super) fn schema<M: Message>() -> String {
    let (mut text, mut known) = (String::new(), Vec::new());
    let mut rest = vec![("", M::FIELDS)];
    while let Some((name, fields)) = rest.pop() {
        if !name.is_empty() {
            text += &format!("{RULE}MSG: {name}\n");
        }
        text += fields;
        for kind in fields.lines().filter_map(|line| line.split(['[', ' ']).next()) {
            let part = PARTS.into_iter().find(|(name, _)| *name == kind && !known.contains(name));
            known.extend(part.map(|(name, _)| name));
            rest.extend(part);
        }
    }
    text
}

/// Writes a `std_msgs/Header`.
pub(super) fn header(encoder: &mut Encoder, stamp: u64, frame: &str) {
    encoder.u32((stamp / NANOSECONDS) as u32);
    encoder.u32((stamp % NANOSECONDS) as u32);
    encoder.string(frame);
}

#[cfg(test)]
mod tests {
    use super::{super::shown::Markers, *};

    #[test]
    fn a_definition_names_each_type_that_it_uses_once() {
        let definition = schema::<Markers>();
        let mut sections = definition.split(RULE);
        assert_eq!(sections.next(), Some(Markers::FIELDS));
        let mut names: Vec<&str> = sections.filter_map(|part| part.strip_prefix("MSG: ")?.lines().next()).collect();
        names.sort_unstable();
        let mut used: Vec<&str> = PARTS.into_iter().map(|(name, _)| name).collect();
        used.retain(|name| !name.contains("Transform"));
        used.sort_unstable();
        assert_eq!(names, used);
    }
}
