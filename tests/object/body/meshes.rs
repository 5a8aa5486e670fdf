//! Mesh files: every way in which programs write them is read whole, or refused with the place and the remedy.

use super::*;
use haptize::{
    Error, ErrorKind,
    object::{LengthUnit, MeshSummary},
};

#[test]
fn the_same_cube_comes_out_of_all_formats() {
    let written_by_others = ["cube.dae", "cube.glb", "cube.vtk", "cube.vtp"].map(|name| (name, sample(name)));
    let shipped = ["cube.obj", "cube.ply", "cube.stl"].map(|name| (name, dataset(name)));
    for (name, file) in shipped.into_iter().chain(written_by_others) {
        let object = Object::build(&mesh_spec(file)).unwrap();
        assert_eq!((object.rest.len(), object.triangles.len()), (8, 12), "{name}");
        assert!(object.warnings.is_empty(), "{name}: {:?}", object.warnings);
        assert!((six_volumes(&object) - 6.0).abs() < 1e-12, "{name}: a cube of side 2, scaled by 0.5");
        assert!(object.rest.iter().all(|node| ((*node - CENTRE).abs() - 0.5).length() < 1e-12), "{name}");
    }
}

/// Binary STL and PLY files of the cube.
fn binary_cubes() -> [(&'static str, Vec<u8>); 2] {
    let cube = Object::build(&mesh_spec(dataset("cube.obj"))).unwrap();
    let corner = |node: u32| (2.0 * (cube.rest[node as usize] - CENTRE)).as_vec3().to_array();
    let bytes = |point: [f32; 3]| point.map(f32::to_le_bytes).concat();
    let mut stl = vec![0; 80];
    stl.extend(12u32.to_le_bytes());
    let mut ply = b"ply\nformat binary_little_endian 1.0\nelement vertex 8\nproperty float x\nproperty float y\n\
        property float z\nelement face 12\nproperty list uchar int vertex_index\nend_header\n"
        .to_vec();
    (0..8).for_each(|node| ply.extend(bytes(corner(node))));
    for triangle in &cube.triangles {
        stl.extend([0; 12]);
        triangle.iter().for_each(|&node| stl.extend(bytes(corner(node))));
        stl.extend([0; 2]);
        ply.push(3);
        triangle.iter().for_each(|&node| ply.extend((node as i32).to_le_bytes()));
    }
    [("stl", stl), ("ply", ply)]
}

/// Builds the object of a file with this content.
fn build_from(extension: &str, content: &[u8]) -> Result<Object, Error> {
    let file = tempfile::Builder::new().suffix(&format!(".{extension}")).tempfile().unwrap();
    std::fs::write(file.path(), content).unwrap();
    Object::build(&mesh_spec(file.path()))
}

#[test]
fn binary_files_are_read() {
    for (extension, content) in binary_cubes() {
        let object = build_from(extension, &content).unwrap();
        assert_eq!((object.rest.len(), object.triangles.len()), (8, 12), "{extension}");
        assert!((six_volumes(&object) - 6.0).abs() < 1e-12, "{extension}");
    }
}

#[test]
fn groups_of_an_obj_file_are_joined_at_their_seams() {
    let text = std::fs::read_to_string(dataset("cube.obj")).unwrap();
    let (nodes, faces) = text.split_at(text.find("\nf ").unwrap() + 1);
    let mut faces: Vec<&str> = faces.lines().collect();
    faces.insert(3, "o other");
    let object =
        build_from("obj", format!("mtllib missing.mtl\n{nodes}o one\n{}\n", faces.join("\n")).as_bytes()).unwrap();
    assert_eq!((object.rest.len(), object.triangles.len()), (8, 12));
    assert!(object.warnings.is_empty(), "{:?}", object.warnings);
}

#[test]
fn statements_of_an_obj_file_may_be_capitals() {
    let text = std::fs::read_to_string(dataset("cube.obj")).unwrap();
    for capitals in [text.replace("v ", "V "), text.replace("f ", "F "), text.to_uppercase()] {
        let object = build_from("obj", capitals.as_bytes()).unwrap();
        assert_eq!((object.rest.len(), object.triangles.len()), (8, 12));
        assert!((six_volumes(&object) - 6.0).abs() < 1e-12);
    }
    // A line of texture or of a normal is another statement.
    let others = text.replace("v ", "VT 0 0\nVN 0 0 1\nv ");
    assert_eq!(build_from("obj", others.as_bytes()).unwrap().rest.len(), 8);
}

#[test]
fn a_mesh_is_summed_up_before_it_is_an_object() {
    let cube = MeshSummary::read(&dataset("cube.stl")).unwrap();
    assert_eq!((cube.nodes, cube.triangles, cube.parts, cube.defect), (8, 12, 1, None));
    assert_eq!((cube.low, cube.high), (-DVec3::ONE, DVec3::ONE));
    // Twelve edges of 2 and six diagonals, each met by two triangles.
    let mean = (24.0 * 2.0 + 12.0 * 8.0_f64.sqrt()) / 36.0;
    assert!((cube.volume - 8.0).abs() < 1e-12 && (cube.mean_edge - mean).abs() < 1e-12);
    let organ = MeshSummary::read(&dataset("organ.obj")).unwrap();
    assert_eq!((cube.unit, organ.unit), (Some(LengthUnit::M), Some(LengthUnit::Mm)));
    let (nodes, faces) = prism(&[[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]], 0);
    let folder = tempfile::tempdir().unwrap();
    let open = folder.path().join("open.obj");
    std::fs::write(&open, obj_of(&nodes, &faces[1..])).unwrap();
    let open = MeshSummary::read(&open).unwrap();
    assert!(open.parts == 0 && open.defect.unwrap().contains("hole"));
}

#[test]
fn what_a_header_does_not_announce_and_coordinates_that_are_no_lengths_are_refused() {
    let text = std::fs::read_to_string(dataset("cube.ply")).unwrap();
    assert!(build_from("ply", (text.clone() + "\n  \r\n").as_bytes()).is_ok(), "blank lines may follow");
    let binary = &binary_cubes()[1].1;
    let first = text.lines().position(|line| line == "end_header").unwrap() + 1;
    let with = |number: &str| {
        let mut lines: Vec<&str> = text.lines().collect();
        lines[first] = number;
        lines.join("\n").into_bytes()
    };
    let (nodes, faces) = prism(&[[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]], 0);
    let cut = |bytes: usize| binary[..binary.len() - bytes].to_vec();
    let obj = |number: &str| obj_of(&nodes, &faces).replacen("v 0", &format!("v {number}"), 1).into_bytes();
    for (ending, content, expected) in [
        ("ply", (text.clone() + "3 0 1 2\n").into_bytes(), "7 bytes follow the last element"),
        ("ply", [binary, &b"\0"[..]].concat(), "1 byte follows the last element"),
        ("ply", cut(1), "it ends within a face: it was cut off; export the mesh again"),
        ("ply", cut(13 * 12 + 1), "it ends within a vertex: it was cut off"),
        ("ply", with("nan 0 0"), "vertex 0, counted from 0, is not a line of finite numbers: \"nan 0 0\""),
        ("ply", with("0 0,5 0"), "vertex 0, counted from 0, is not a line of finite numbers"),
        ("ply", with("1e30 0 0"), "node 0, counted from 0, has a coordinate"),
        ("obj", obj("nan"), "node 0, counted from 0, has a coordinate"),
        ("obj", obj("-inf"), "node 0, counted from 0, has a coordinate"),
    ] {
        let error = build_from(ending, &content).unwrap_err().to_string();
        assert!(error.contains(expected), "{expected}: {error}");
    }
}

#[test]
fn missing_and_unknown_files_are_refused_by_name() {
    let missing = Object::build(&mesh_spec("/nowhere/lost.obj")).unwrap_err();
    assert_eq!(missing.kind(), ErrorKind::File);
    assert!(missing.to_string().contains("/nowhere/lost.obj"), "{missing}");
    let unknown = build_from("xyz", b"0 0 0").unwrap_err();
    assert!(unknown.to_string().contains(".obj, .stl, .ply"), "{unknown}");
    assert_eq!(Object::build(&mesh_spec("/dev/null.obj")).unwrap_err().kind(), ErrorKind::File);
}

#[test]
fn hostile_counts_are_refused_without_reserving_memory() {
    let header = |vertices: &str, list: &str, format: &str| {
        format!(
            "ply\nformat {format} 1.0\nelement vertex {vertices}\n\
             property float x\nproperty float y\nproperty float z\n\
             element face 1\nproperty list {list} int vertex_indices\n\
             end_header\n0 0 0\n1 0 0\n0 1 0\n"
        )
    };
    let binary = "binary_little_endian";
    let files = [
        header("18446744073709551615", "uchar", "ascii"),
        header("4000000000", "uchar", binary),
        header("3", "uchar", "ascii") + "9223372036854775807 0 1 2\n",
        header("3", "uchar", "ascii") + "3 0 1\n",
        header("1", "uint", binary) + "\u{7f}\u{7f}\u{7f}\u{7f}",
        header("1", "char", binary) + "\u{7f}\u{7f}\u{7f}\u{7f}",
        "ply\nformat ascii 1.0\nelement empty 9000000000000000000\nend_header\n".to_owned(),
    ];
    for content in files {
        let refused = build_from("ply", content.as_bytes());
        assert!(refused.as_ref().is_err_and(|error| error.kind() == ErrorKind::File), "{content}\n{refused:?}");
    }
    let mut stl = binary_cubes()[0].1.clone();
    stl[80..84].copy_from_slice(&u32::MAX.to_le_bytes());
    assert_eq!(build_from("stl", &stl).unwrap_err().kind(), ErrorKind::File);
}

/// The text of the STL cube, as many programs write such files.
fn stl_text() -> String {
    std::fs::read_to_string(dataset("cube.stl")).unwrap()
}

#[test]
fn an_object_in_millimetres_without_a_scale_is_warned_of() {
    let (nodes, faces) = prism(&[[0.0, 0.0], [100.0, 0.0], [100.0, 100.0], [0.0, 100.0]], 0);
    let long = build_from("obj", obj_of(&nodes, &faces).as_bytes()).unwrap();
    assert!(long.warnings.iter().any(|told| told.contains("50 m long") && told.contains("scale = 0.001")));
}

#[test]
fn an_stl_file_is_read_whole_however_its_program_writes_it() {
    let text = stl_text();
    let body: Vec<&str> = text.lines().filter(|line| !line.contains("solid")).collect();
    let facets = body.join("\n");
    let half = facets.match_indices("facet normal").nth(6).unwrap().0;
    let (one, two) = facets.split_at(half);
    let mut cp1252 = format!("solid W%rfel\n{facets}\nendsolid W%rfel\n").into_bytes();
    cp1252.iter_mut().filter(|byte| **byte == b'%').for_each(|byte| *byte = 0xfc);
    let binary = &binary_cubes()[0].1;
    let headed = |head: &[u8]| [head, &binary[head.len()..]].concat();
    let files = [
        format!("solid a\n{one}\nendsolid a\nsolid b\n{two}\nendsolid b\n").into_bytes(),
        format!("solid empty\nendsolid empty\nsolid b\n{facets}\nendsolid b\n").into_bytes(),
        format!("solid\n{facets}\nendsolid").into_bytes(),
        format!("solid cube\n{facets}\nendsolid cube\n").to_uppercase().into_bytes(),
        format!("\u{feff}solid cube\n{facets}\nendsolid cube\n").into_bytes(),
        format!("\n\nsolid cube\n{facets}\nendsolid cube\n").into_bytes(),
        format!("solid facet of a solid\n{facets}\nendsolid\n\n").replace('\n', "\r\n").into_bytes(),
        format!("solid cube\n{facets}\nendsolid cube\n").replace('\n', "\r").into_bytes(),
        format!("solid cube\n{facets}\nend solid cube\n").into_bytes(),
        format!("color 1 0 0\nsolid cube\ncolor 0.5 0.5 0.5\n{facets}\nEND SOLID\n").into_bytes(),
        format!("solid cube\n{}\nendsolid\n", facets.replace("endfacet", "color 1 1 1\nend facet")).into_bytes(),
        format!("solid cube\n{}\nendsolid\n", facets.replace("endloop", "end loop")).into_bytes(),
        cp1252,
        headed(b"solid block"),
        headed(b"solid block\nfacet normal"),
        headed(&[b's'; 80]),
    ];
    for (number, content) in files.iter().enumerate() {
        let object = build_from("stl", content).unwrap_or_else(|error| panic!("{number}: {error}"));
        assert_eq!((object.rest.len(), object.triangles.len()), (8, 12), "{number}");
        assert!((six_volumes(&object) - 6.0).abs() < 1e-12, "{number}");
    }
    let after = |tail: &[u8]| [binary, tail].concat();
    for (content, expected) in [
        (after(binary), "684 bytes follow the last of the 12 facets"),
        (after(b"\0"), "1 byte follows"),
        (binary[..binary.len() - 1].to_vec(), "was cut off"),
        (binary[..70].to_vec(), "too short"),
        (text.replace("endsolid", "# endsolid").into_bytes(), "line 86"),
        (text.split("endsolid").next().unwrap().as_bytes().to_vec(), "line 1 has no `endsolid`"),
        (text.replacen("vertex", "corner", 1).into_bytes(), "line 4: one of the words"),
        (text.replacen("vertex", "color", 1).into_bytes(), "line 8: a facet has three vertices"),
        (text.replacen("    endloop", "vertex 1 2 3", 1).into_bytes(), "line 8: a facet has three vertices"),
        (text.replacen("vertex -1", "vertex -1,5", 1).into_bytes(), "line 4: a vertex has three coordinates"),
        ([text.as_bytes(), &[0; 512]].concat(), "line 87: it holds bytes of zero"),
        ([text.as_bytes(), binary].concat(), "line 87: it holds bytes of zero"),
        (text.replacen("vertex -1", "vertex \0-1", 1).into_bytes(), "line 4: it holds bytes of zero"),
        (b"<html>".to_vec(), "line 1: a solid begins with `solid`"),
    ] {
        let error = build_from("stl", &content).unwrap_err().to_string();
        assert!(error.contains(expected), "{expected}: {error}");
    }
}

#[test]
fn remarks_of_any_encoding_do_not_keep_a_mesh_from_being_read() {
    let text = std::fs::read_to_string(dataset("cube.ply")).unwrap();
    let remark = [b"\ncomment W\xfcrfel".as_slice(), &[b'9'; 30], b"\n"].concat();
    let (ply, rest) = text.split_at(text.find('\n').unwrap());
    let [_, (_, binary)] = binary_cubes();
    for content in [
        format!("\u{feff}{text}").into_bytes(),
        [ply.as_bytes(), &remark, &rest.as_bytes()[1..]].concat(),
        [b"ply", &remark[..], &binary[4..]].concat(),
        text.replace('\n', "\r\n").into_bytes(),
    ] {
        let object = build_from("ply", &content).unwrap();
        assert_eq!((object.rest.len(), object.triangles.len()), (8, 12));
    }
    let returns = build_from("ply", text.replace('\n', "\r").as_bytes()).unwrap_err().to_string();
    assert!(returns.contains("carriage returns alone: export the mesh again"), "{returns}");
    for extension in ["ply", "stl", "obj"] {
        for mark in [b"\xff\xfe", b"\xfe\xff"] {
            let wide = build_from(extension, &[&mark[..], b"p\0l\0y\0"].concat()).unwrap_err().to_string();
            assert!(wide.contains("it is text in UTF-16, not UTF-8: convert it by"), "{extension}: {wide}");
        }
    }
}

/// A prism of height 1 on a polygon in the plane, its two ends as one face each, which begin with corner `first`.
fn prism(outline: &[[f64; 2]], first: usize) -> (Vec<DVec3>, Vec<Vec<usize>>) {
    let count = outline.len();
    let nodes = [0.0, 1.0].iter().flat_map(|z| outline.iter().map(|[x, y]| DVec3::new(*x, *y, *z))).collect();
    let mut faces: Vec<Vec<usize>> = vec![
        (0..count).map(|k| (first + k) % count).rev().collect(),
        (0..count).map(|k| count + (first + k) % count).collect(),
    ];
    faces.extend((0..count).map(|k| (k, (k + 1) % count)).map(|(a, b)| vec![a, b, count + b, count + a]));
    (nodes, faces)
}

fn obj_of(nodes: &[DVec3], faces: &[Vec<usize>]) -> String {
    let nodes = nodes.iter().map(|p| format!("v {} {} {}\n", p.x, p.y, p.z));
    let face = |face: &Vec<usize>| face.iter().map(|k| format!(" {}", k + 1)).collect::<String>();
    nodes.chain(faces.iter().map(|of| format!("f{}\n", face(of)))).collect()
}

fn ply_of(nodes: &[DVec3], faces: &[Vec<usize>]) -> String {
    let mut text = format!(
        "ply\nformat ascii 1.0\nelement vertex {}\nproperty double x\nproperty double y\nproperty double z\n\
         element face {}\nproperty list uchar int vertex_indices\nend_header\n",
        nodes.len(),
        faces.len()
    );
    nodes.iter().for_each(|p| text += &format!("{} {} {}\n", p.x, p.y, p.z));
    for face in faces {
        text += &format!("{}{}\n", face.len(), face.iter().map(|k| format!(" {k}")).collect::<String>());
    }
    text
}

#[test]
fn a_face_of_many_corners_is_cut_within_its_outline_wherever_it_begins() {
    let arrow = [[0.0, 0.0], [2.0, 0.0], [2.0, 2.0], [1.0, 0.5], [0.0, 2.0]];
    let straight = [[0.0, 0.0], [0.5, 0.0], [1.0, 0.0], [1.0, 0.3], [1.0, 1.0], [0.0, 1.0], [0.0, 0.9]];
    let dart = [[0.0, 0.0], [1.0, 0.2], [2.0, 0.0], [1.0, 2.0]];
    let comb: Vec<[f64; 2]> =
        (0..12).map(|k| [f64::from(k), f64::from(1 + k % 2 * 3)]).chain([[11.0, 0.0], [0.0, 0.0]]).rev().collect();
    let ring = (0..40).map(|k| f64::from(k) * std::f64::consts::TAU / 40.0).map(|a| [a.cos(), a.sin()]).collect();
    for outline in [arrow.to_vec(), straight.to_vec(), dart.to_vec(), comb, ring] {
        let side = |k: usize| (outline[k], outline[(k + 1) % outline.len()]);
        let area: f64 = (0..outline.len()).map(side).map(|(a, b)| 0.5 * (a[0] * b[1] - a[1] * b[0])).sum();
        let mut all = Vec::new();
        for first in 0..outline.len() {
            let (mut nodes, faces) = prism(&outline, first);
            // Turned, so that the faces are flat to within rounding only.
            let turn = glam::DQuat::from_euler(glam::EulerRot::XYZ, 0.3, -0.5, 1.1);
            nodes.iter_mut().for_each(|node| *node = turn * *node);
            for (extension, text) in [("obj", obj_of(&nodes, &faces)), ("ply", ply_of(&nodes, &faces))] {
                let object = build_from(extension, text.as_bytes()).unwrap_or_else(|error| panic!("{first}: {error}"));
                assert_eq!(object.triangles.len(), 4 * outline.len() - 4, "{first}");
                assert!((six_volumes(&object) - 6.0 * area / 8.0).abs() < 1e-12, "{first}");
                if extension == "ply" {
                    all.push(object.triangles.clone());
                }
            }
        }
        assert!(all.iter().all(|triangles| *triangles == all[0]), "the same triangles wherever the face begins");
    }
}

#[test]
fn a_face_that_cannot_be_cut_is_refused_at_its_place() {
    let flat = [[0.0, 0.0], [1.0, 0.0], [2.0, 0.0], [3.0, 0.0]];
    let bow = [[0.0, 0.0], [1.0, 1.0], [1.0, 0.0], [0.0, 1.0]];
    for outline in [&flat, &bow] {
        let (nodes, faces) = prism(outline, 0);
        for (extension, text, place) in
            [("obj", obj_of(&nodes, &faces), "line 9:"), ("ply", ply_of(&nodes, &faces), "face 0, counted from 0:")]
        {
            let error = build_from(extension, text.as_bytes()).unwrap_err().to_string();
            assert!(error.contains(place) && error.contains("triangulate on export"), "{error}");
        }
    }
    let (nodes, mut faces) = prism(&[[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]], 0);
    faces[5][2] = 8;
    let error = build_from("ply", ply_of(&nodes, &faces).as_bytes()).unwrap_err().to_string();
    assert!(
        error.contains("face 5, counted from 0: a face names node 8, counted from 0, of 8: export the mesh again"),
        "{error}"
    );
    let error = build_from("obj", obj_of(&nodes, &faces).as_bytes()).unwrap_err().to_string();
    assert!(error.contains("line 14: a face names vertex 9, of 8: export the mesh again"), "{error}");
    // A hole that a bridge joins to the outline, which is passed twice.
    let holed: Vec<[f64; 2]> = [[0, 0], [3, 0], [3, 3], [0, 3], [0, 0], [1, 1], [1, 2], [2, 2], [2, 1], [1, 1]]
        .iter()
        .map(|[x, y]| [f64::from(*x), f64::from(*y)])
        .collect();
    let (nodes, mut faces) = prism(&holed, 0);
    faces.retain(|face| face.len() > 4 || ![[0, 1], [9, 0]].iter().any(|ends| face[..2] == [ends[0] + 4, ends[1]]));
    let frame: Vec<Vec<usize>> =
        faces.into_iter().filter(|face| !(face[..2] == [4, 5] || face[..2] == [9, 0])).collect();
    let object = build_from("ply", ply_of(&nodes, &frame).as_bytes()).unwrap();
    assert!((six_volumes(&object) - 6.0).abs() < 1e-12, "a ring around a square hole");
}

#[test]
fn an_obj_file_is_read_however_its_program_writes_it() {
    let text = std::fs::read_to_string(dataset("cube.obj")).unwrap();
    let first_face = text.match_indices("\nf ").next().unwrap().0 + 1;
    let remarks: String = text
        .lines()
        .map(|line| if line.starts_with('f') { format!("{line}  # note 9\n") } else { format!("{line}\n") })
        .collect();
    let wrapped: String = text
        .lines()
        .map(|line| match line.split_once(' ') {
            Some((word @ ("v" | "f"), rest)) => format!("{word} \\\n  {}\n", rest.replacen(' ', " \\\n ", 1)),
            _ => format!("{line}\n"),
        })
        .collect();
    for (number, content) in [
        format!("\u{feff}{}", &text[text.find("v ").unwrap()..]),
        remarks,
        wrapped,
        text.replace('\n', "\r"),
        text.replace('\n', "\r\n"),
        format!("# C:\\meshes\\\n{text}"),
    ]
    .iter()
    .enumerate()
    {
        let object = build_from("obj", content.as_bytes()).unwrap_or_else(|error| panic!("{number}: {error}"));
        assert!((six_volumes(&object) - 6.0).abs() < 1e-12, "{number}");
    }
    let utf16: Vec<u8> = text.encode_utf16().flat_map(u16::to_le_bytes).collect();
    for content in [utf16, b"<html><body>".to_vec(), Vec::new()] {
        let error = build_from("obj", &content).unwrap_err().to_string();
        assert!(error.contains("not an OBJ text"), "{error}");
    }
    for (faces, expected) in [
        ("", "no triangles: export its faces"),
        ("l 1 2\n", "no triangles: export its faces"),
        ("f 0 1 2\n", "numbers of vertices, counted from 1: \"f 0 1 2\""),
        ("f 1 2 -9\n", "numbers of vertices, counted from 1"),
        ("f 1 2 9\n", "names vertex 9, of 8: export the mesh again"),
    ] {
        let error = build_from("obj", format!("{}{faces}", &text[..first_face]).as_bytes()).unwrap_err().to_string();
        assert!(error.contains(expected), "{error}");
    }
}

#[test]
fn a_ply_file_may_have_whole_coordinates_and_lists_counted_by_any_type() {
    let (nodes, faces) = prism(&[[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]], 0);
    let text = ply_of(&nodes, &faces).replace("double", "int");
    assert!((six_volumes(&build_from("ply", text.as_bytes()).unwrap()) - 6.0 / 8.0).abs() < 1e-12);
    for (kind, width) in [("char", 1), ("uchar", 1), ("short", 2), ("ushort", 2), ("int", 4), ("uint", 4)] {
        for order in ["little", "big"] {
            let header = format!(
                "ply\nformat binary_{order}_endian 1.0\nelement vertex 8\nproperty short x\nproperty char y\n\
                 property uint z\nelement face 6\nproperty list {kind} uchar vertex_indices\nend_header\n"
            );
            let number = |value: u32, width: usize| {
                let bytes = value.to_le_bytes()[..width].to_vec();
                if order == "big" { bytes.into_iter().rev().collect() } else { bytes }
            };
            let mut content = header.into_bytes();
            for node in &nodes {
                let [x, y, z] = node.to_array().map(|x| x as u32);
                content.extend([number(x, 2), number(y, 1), number(z, 4)].concat());
            }
            let vertices = content.len();
            for face in &faces {
                content.extend(number(face.len() as u32, width));
                content.extend(face.iter().map(|k| *k as u8));
            }
            let object = build_from("ply", &content).unwrap_or_else(|error| panic!("{kind} {order}: {error}"));
            assert!((six_volumes(&object) - 6.0 / 8.0).abs() < 1e-12, "{kind} {order}");
            content[vertices..vertices + width].fill(0xff);
            assert_eq!(build_from("ply", &content).unwrap_err().kind(), ErrorKind::File, "{kind} {order}");
        }
    }
}

#[test]
fn damaged_mesh_files_never_panic() {
    let mut seeds: Vec<(&str, Vec<u8>)> = binary_cubes().to_vec();
    for name in ["cube.obj", "cube.ply", "cube.stl"] {
        seeds.push((&name[5..], std::fs::read(dataset(name)).unwrap()));
    }
    let (mut built, mut refused) = (0, 0);
    for (kind, (extension, content)) in seeds.iter().enumerate() {
        for (index, random) in Random::vectors(120, kind as u64).iter().enumerate() {
            let mut damaged = content.clone();
            let place = |x: f64| ((x + 1.0) / 2.0 * content.len() as f64) as usize;
            match index % 4 {
                0 => damaged.truncate(place(random.x)),
                1 => damaged[place(random.x)] ^= 1 << (index / 4 % 8),
                2 => damaged[place(random.x)] = b'0' + (index / 4 % 10) as u8,
                _ => drop(damaged.drain(place(random.x.min(random.y))..place(random.x.max(random.y)))),
            }
            match build_from(extension, &damaged) {
                Ok(object) => {
                    built += 1;
                    assert!(Compliance::new(&object).entries.iter().all(|entry| entry.is_finite()));
                }
                Err(_) => refused += 1,
            }
        }
    }
    assert!(refused > 200, "most damage is noticed: {built} built, {refused} refused");
}
