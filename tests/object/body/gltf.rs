//! glTF files: nodes at their places, every form of triangles and of numbers, and what is refused.

use super::*;
use base64::{Engine as _, engine::general_purpose::STANDARD};
use haptize::object::MeshSummary;

/// A tetrahedron: positions in three types of numbers, one normalised, and its faces as triangles, as a strip and as a
/// fan with the rest.
fn buffer() -> Vec<u8> {
    let corners = [[0_i16, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]];
    let mut bytes: Vec<u8> = corners.iter().flatten().flat_map(|x| f32::from(*x).to_le_bytes()).collect();
    // Each of these positions fills eight bytes.
    bytes
        .extend(corners.iter().flat_map(|at| [at[0], at[1], at[2], 0].map(|x| (x * i16::MAX).to_le_bytes())).flatten());
    bytes.extend([0, 2, 1, 0, 1, 3, 1, 2, 3, 0, 3, 2]);
    bytes.extend([1_u16, 2, 0, 3, 1, 2].map(u16::to_le_bytes).as_flattened());
    bytes
}

/// A file whose scene is of `nodes`; its meshes are the tetrahedron by triangles, by a strip, and by scaled numbers.
fn text(nodes: &str) -> String {
    let buffer = buffer();
    format!(
        r#"{{"asset": {{"version": "2.0"}}, "scenes": [{{"nodes": [0]}}], "nodes": [{nodes}],
        "meshes": [{{"primitives": [{{"attributes": {{"POSITION": 0}}, "indices": 2}}]}},
            {{"primitives": [{{"attributes": {{"POSITION": 0}}, "indices": 3, "mode": 5}}]}},
            {{"primitives": [{{"attributes": {{"POSITION": 1}}, "indices": 2}}, {{"attributes": {{"POSITION": 1}}, "mode": 0}}]}}],
        "accessors": [{{"bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3"}},
            {{"bufferView": 1, "componentType": 5122, "normalized": true, "count": 4, "type": "VEC3"}},
            {{"bufferView": 2, "componentType": 5121, "count": 12, "type": "SCALAR"}},
            {{"bufferView": 2, "byteOffset": 12, "componentType": 5123, "count": 6, "type": "SCALAR"}}],
        "bufferViews": [{{"buffer": 0, "byteLength": 48}},
            {{"buffer": 0, "byteOffset": 48, "byteLength": 32, "byteStride": 8}},
            {{"buffer": 0, "byteOffset": 80, "byteLength": 24}}],
        "buffers": [{{"byteLength": {}, "uri": "data:application/octet-stream;base64,{}"}}]}}"#,
        buffer.len(),
        STANDARD.encode(&buffer)
    )
}

/// The summary of a file with this content, or why there is none.
fn summary(content: &[u8]) -> Result<MeshSummary, String> {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("body.gltf");
    std::fs::write(&file, content).unwrap();
    MeshSummary::read(&file).map_err(|error| error.to_string())
}

#[test]
fn every_form_of_triangles_and_numbers_is_the_same_tetrahedron() {
    for mesh in 0..3 {
        let body = summary(text(&format!(r#"{{"mesh": {mesh}}}"#)).as_bytes()).unwrap();
        assert_eq!((body.nodes, body.triangles, body.defect.clone()), (4, 4, None), "{mesh}");
        assert!((body.volume - 1.0 / 6.0).abs() < 1e-12, "{mesh}");
        // glTF's y is z here, and its z is -y.
        assert_eq!((body.low, body.high), (DVec3::new(0.0, -1.0, 0.0), DVec3::new(1.0, 0.0, 1.0)), "{mesh}");
    }
}

#[test]
fn parts_lie_at_the_places_of_their_nodes() {
    let nodes = r#"{"scale": [2, 2, 2], "children": [1, 2]},
        {"mesh": 0, "translation": [1, 0, 0], "rotation": [0, 0.7071067811865476, 0, 0.7071067811865476]},
        {"mesh": 0, "matrix": [-1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, -1, 0, 0, 1]}"#;
    let body = summary(text(nodes).as_bytes()).unwrap();
    assert_eq!((body.triangles, body.parts, body.defect.clone()), (8, 2, None));
    assert!(body.warnings.is_empty(), "a mirrored part is no inside out: {:?}", body.warnings);
    assert!((body.volume - 2.0 * 8.0 / 6.0).abs() < 1e-12);
    // A quarter turn about y takes x to -z, which is y here, and z to x.
    assert!((body.low - DVec3::new(-4.0, -2.0, 0.0)).length() < 1e-12, "{}", body.low);
    assert!((body.high - DVec3::new(4.0, 2.0, 2.0)).length() < 1e-12, "{}", body.high);
}

#[test]
fn what_is_not_read_is_named_with_the_remedy() {
    let plain = text(r#"{"mesh": 0}"#);
    for (from, to, expected) in [
        ("\"asset\"", "\"extensionsRequired\": [\"KHR_draco_mesh_compression\"], \"asset\"", "without compression"),
        (r#"{"mesh": 0}"#, r#"{"mesh": 0, "skin": 0}"#, "a skeleton bends the mesh of node 0"),
        (r#"{"mesh": 0}"#, r#"{"children": [0]}"#, "node 0 has two parents"),
        (r#"{"mesh": 0}"#, r#"{"children": [7]}"#, "there is no node 7"),
        (r#"{"mesh": 0}"#, r#"{"mesh": 9}"#, "there is no mesh 9"),
        (r#"{"mesh": 0}"#, "{}", "no triangles in its scene"),
        (r#""count": 12"#, r#""count": 9223372036854775807"#, "beyond its view"),
        (r#""count": 4"#, r#""count": 3"#, "names node 3, counted from 0, of 3"),
        (r#""byteLength": 24"#, r#""byteLength": 240"#, "a view is beyond its buffer"),
        ("data:application/octet-stream;base64,", "../", "into the same folder"),
        ("data:application/octet-stream;base64,", "https://x/", "into the same folder"),
        ("data:application/octet-stream;base64,", "data:;base64,!", "no base64"),
        ("\"asset\"", "asset", "it is no glTF 2.0"),
    ] {
        assert!(plain.contains(from), "{from}");
        let error = summary(plain.replacen(from, to, 1).as_bytes()).unwrap_err();
        assert!(error.contains(expected) && error.contains("body.gltf"), "{to}: {error}");
    }
    assert!(summary(b"glTF\x01\0\0\0\0\0\0\0").unwrap_err().contains("glTF 2 is read"));
    let whole = std::fs::read(sample("cube.glb")).unwrap();
    assert!(summary(&whole[..900]).unwrap_err().contains("bytes are missing"));
}

/// One part at thousands of places is more than its file can hold.
#[test]
fn repeated_parts_are_bounded_by_the_file() {
    let children: Vec<String> = (1..2000).map(|child| child.to_string()).collect();
    let nodes = format!(r#"{{"children": [{}]}}{}"#, children.join(","), r#",{"mesh":0}"#.repeat(1999));
    let part = r#"{"attributes": {"POSITION": 0}, "indices": 2}"#;
    let error = summary(text(&nodes).replace(part, &[part; 20].join(",")).as_bytes());
    assert!(error.clone().is_err_and(|error| error.contains("more corners than the file has bytes")), "{error:?}");
}
