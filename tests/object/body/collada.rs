//! COLLADA files: nodes at their places, every form of faces, the unit, and what is refused.

use super::*;
use haptize::object::MeshSummary;

/// A file whose geometry, the corner of a unit cube, has `faces`, in a scene of `nodes`; its unit is a decimetre.
fn text(faces: &str, nodes: &str) -> String {
    format!(
        "<COLLADA xmlns=\"http://www.collada.org/2005/11/COLLADASchema\" version=\"1.4.1\">
<asset><unit name=\"decimetre\" meter=\"0.1\"/><up_axis>Z_UP</up_axis></asset>
<library_geometries><geometry id=\"corner\"><mesh>
<source id=\"places\"><float_array id=\"numbers\" count=\"16\">0 0 0 9 1 0 0 9 0 1 0 9 0 0 1 9</float_array>
<technique_common><accessor source=\"#numbers\" count=\"4\" stride=\"4\"/></technique_common></source>
<vertices id=\"corners\"><input semantic=\"POSITION\" source=\"#places\"/></vertices>
{faces}
</mesh></geometry></library_geometries>
<library_visual_scenes><visual_scene id=\"all\">{nodes}</visual_scene></library_visual_scenes>
<scene><instance_visual_scene url=\"#all\"/></scene>
</COLLADA>"
    )
}

const INPUT: &str = "<input semantic=\"NORMAL\" source=\"#places\" offset=\"0\"/>\
                     <input semantic=\"VERTEX\" source=\"#corners\" offset=\"1\"/>";

const NODE: &str = "<node><instance_geometry url=\"#corner\"/></node>";

/// Numbers of corners, each behind that of a normal.
fn indices(corners: &[usize]) -> String {
    corners.iter().map(|corner| format!("3 {corner} ")).collect()
}

fn triangles() -> String {
    format!("<triangles count=\"4\">{INPUT}<p>{}</p></triangles>", indices(&[0, 2, 1, 0, 1, 3, 1, 2, 3, 0, 3, 2]))
}

/// The summary of a file with this content, or why there is none.
fn summary(content: &str) -> Result<MeshSummary, String> {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("body.dae");
    std::fs::write(&file, content).unwrap();
    MeshSummary::read(&file).map_err(|error| error.to_string())
}

#[test]
fn every_form_of_faces_is_the_same_tetrahedron() {
    let polylist = triangles().replace("<p>", "<vcount>3 3 3 3</vcount><p>").replace("triangles", "polylist");
    let of = |faces: &[&[usize]], name: &str| {
        let lists: String = faces.iter().map(|face| format!("<p>{}</p>", indices(face))).collect();
        format!("<{name}>{INPUT}{lists}</{name}>")
    };
    for faces in [
        triangles(),
        polylist,
        of(&[&[0, 2, 1], &[0, 1, 3], &[1, 2, 3], &[0, 3, 2]], "polygons"),
        of(&[&[1, 2, 0, 3, 1, 2]], "tristrips"),
        of(&[&[0, 2, 1, 3, 2], &[1, 2, 3]], "trifans"),
    ] {
        let body = summary(&text(&faces, NODE)).unwrap();
        assert_eq!((body.nodes, body.triangles, body.defect.clone()), (4, 4, None), "{faces}");
        assert!((body.volume - 1e-3 / 6.0).abs() < 1e-15, "{faces}");
        assert_eq!((body.low, body.high), (DVec3::ZERO, DVec3::splat(0.1)), "{faces}");
    }
}

#[test]
fn parts_lie_at_the_places_of_their_nodes() {
    let nodes = "<node><translate>2 0 0</translate><rotate>0 0 1 90</rotate><scale>2 2 2</scale>\
                 <node><instance_geometry url=\"#corner\"/></node></node>\
                 <node><matrix>-1 0 0 -3  0 1 0 0  0 0 1 0  0 0 0 1</matrix><instance_geometry url=\"#corner\"/></node>";
    let body = summary(&text(&triangles(), nodes)).unwrap();
    assert_eq!((body.triangles, body.parts, body.defect.clone()), (8, 2, None));
    assert!(body.warnings.is_empty(), "a mirrored part is no inside out: {:?}", body.warnings);
    assert!((body.volume - (8.0 + 1.0) * 1e-3 / 6.0).abs() < 1e-15);
    assert!((body.low - 0.1 * DVec3::new(-4.0, 0.0, 0.0)).length() < 1e-12, "{}", body.low);
    assert!((body.high - 0.1 * DVec3::new(2.0, 2.0, 2.0)).length() < 1e-12, "{}", body.high);
}

#[test]
fn what_is_not_read_is_named_with_its_line() {
    let plain = text(&triangles(), NODE);
    for (from, to, expected) in [
        ("<COLLADA", "<!DOCTYPE x><COLLADA", "line 1: no document type is read"),
        ("0.1", "-1", "its unit is no length"),
        ("#corner\"", "#none\"", "line 9: it names an element that is not in the file"),
        ("<node>", "<node><skew>1 2 3 4 5 6 7</skew>", "line 9: such a transform is not read"),
        ("<node>", "<node><translate>1 2</translate>", "line 9: the transform has another count"),
        ("instance_geometry", "instance_controller", "line 9: a skeleton bends the mesh"),
        ("3 2 3 1", "3 2 3 8", "there is no node 8"),
        ("9 1 0 0", "9 x 0 0", "line 4: a number belongs here"),
        (">0 0 0 9", ">0 nan 0 9", "has a coordinate that is not a number"),
    ] {
        assert!(plain.contains(from), "{from}");
        let error = summary(&plain.replacen(from, to, 1)).unwrap_err();
        assert!(error.contains(expected) && error.contains("body.dae"), "{to}: {error}");
    }
    let inner = "<node id=\"a\"><instance_node url=\"#a\"/><instance_node url=\"#a\"/></node>";
    assert!(summary(&text(&triangles(), inner)).unwrap_err().contains("contain one another"));
    let often = NODE.repeat(1000);
    let error = summary(&text(&triangles().repeat(20), &often)).unwrap_err();
    assert!(error.contains("more corners than the file has bytes"), "{error}");
}
