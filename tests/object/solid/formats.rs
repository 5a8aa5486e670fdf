//! The block of tetrahedra in every format that holds such, written by other programs (tests/references/mesh_formats.py).

use super::cells::{self, Cell};
use super::gmsh::{homogeneous, msh};
use super::*;
use haptize::scene::{InclusionPlace, InclusionSpec};
use std::fmt::Write;
use std::path::{Path, PathBuf};

/// The files of the block.
const BLOCKS: [&str; 11] = [
    "binary_2.msh",
    "binary_4.msh",
    "block.ele",
    "block.node",
    "block.mesh",
    "binary_5.vtk",
    "text_4.vtk",
    "text.vtu",
    "base64_zlib.vtu",
    "raw_lz4.vtu",
    "appended.vtu",
];

fn file(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/object/meshes").join(name)
}

fn build(file: &Path, material: Material) -> Result<Object, String> {
    let shape = Shape::Tetrahedra { file: file.into(), placement: Placement::METRES };
    Object::build(&spec(shape, material, bed(1e3))).map_err(|error| error.to_string())
}

/// The content of a file, read as if it ended in `ending`.
fn build_from(content: &[u8], ending: &str) -> Result<Object, String> {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join(format!("block.{ending}"));
    std::fs::write(&file, content).unwrap();
    build(&file, homogeneous())
}

#[test]
fn every_format_gives_the_same_solid() {
    let expected = build_from(msh("4.1").as_bytes(), "msh").unwrap();
    for name in BLOCKS {
        let object = build(&file(name), homogeneous()).unwrap_or_else(|error| panic!("{name}: {error}"));
        assert_eq!(object.triangles, expected.triangles, "{name}");
        let nodes = object.rest.iter().zip(&expected.rest);
        assert!(nodes.clone().all(|(a, b)| a.distance(*b) < 1e-7), "{name}");
        let apart = nodes.map(|(a, b)| a.distance(*b)).fold(0.0, f64::max);
        let [stiffness, reference] =
            [&object, &expected].map(|object| energy(object, |x| x.z * DVec3::new(x.y, 0.3, x.x)));
        assert!((stiffness / reference - 1.0).abs() <= 1e2 * apart + 1e-14, "{name}: {stiffness} {reference}");
    }
}

/// The upper half is five times as stiff, but for the ground beside it; a format without regions refuses it.
#[test]
fn regions_are_read_where_a_format_has_them() {
    let stiff = |region: u32| {
        let place = InclusionPlace::Region(region);
        let inclusions = vec![InclusionSpec { place, young: 5.0 * YOUNG, poisson: 0.3 }];
        Material::Elastic(ElasticSpec { young: YOUNG, poisson: 0.3, cell: None, inclusions })
    };
    let bend = |object: &Object| energy(object, |x| DVec3::new(0.0, 0.0, if x.z > 0.11 { x.z - 0.1 } else { 0.0 }));
    let soft = bend(&build(&file("binary_4.msh"), homogeneous()).unwrap());
    for name in ["binary_2.msh", "block.ele", "block.mesh"] {
        let times = bend(&build(&file(name), stiff(2)).unwrap()) / soft;
        assert!((times - 5.0).abs() < 0.01, "{name}: {times}");
        assert!(build(&file(name), stiff(3)).is_err());
    }
    assert!(build(&file("text.vtu"), stiff(2)).is_err());
}

/// A type of cell in Gmsh, the numbers of its orders in VTK, and the corners of the edges and faces that have nodes.
type InVtk = (&'static Cell, [u64; 3], &'static [[usize; 2]], &'static [[usize; 4]]);

/// VTK's order of nodes, by the corners between which they lie (VTK file formats; vtkTriQuadraticHexahedron.h): its types
/// of first order, of second order without and with nodes in faces.
const VTK: [InVtk; 4] = [
    (&cells::TETRAHEDRON, [10, 24, 24], &[[0, 1], [1, 2], [2, 0], [0, 3], [1, 3], [2, 3]], &[]),
    (
        &cells::HEXAHEDRON,
        [12, 25, 29],
        &[[0, 1], [1, 2], [2, 3], [3, 0], [4, 5], [5, 6], [6, 7], [7, 4], [0, 4], [1, 5], [2, 6], [3, 7]],
        &[[0, 4, 7, 3], [1, 2, 6, 5], [0, 1, 5, 4], [3, 7, 6, 2], [0, 3, 2, 1], [4, 5, 6, 7]],
    ),
    (
        &cells::PRISM,
        [13, 26, 32],
        &[[0, 1], [1, 2], [2, 0], [3, 4], [4, 5], [5, 3], [0, 3], [1, 4], [2, 5]],
        &[[0, 1, 4, 3], [1, 2, 5, 4], [2, 0, 3, 5]],
    ),
    (&cells::PYRAMID, [14, 27, 27], &[[0, 1], [1, 2], [2, 3], [3, 0], [0, 4], [1, 4], [2, 4], [3, 4]], &[]),
];

#[test]
fn cells_of_every_type_are_the_same_in_vtk_and_in_gmsh() {
    for (gmsh, kinds, edges, squares) in VTK {
        for order in 0..3 {
            if order == 2 && kinds[2] == kinds[1] {
                continue;
            }
            let vtk = Cell { kinds, corners: gmsh.corners, edges, squares };
            let bent = |at| cells::skewed(at, order > 0);
            let lines = |cells: &[Vec<usize>], first: usize, head: &dyn Fn(usize) -> String| -> String {
                let nodes =
                    |cell: &Vec<usize>| cell.iter().map(|node| format!(" {}", node + first)).collect::<String>();
                cells.iter().enumerate().map(|(number, cell)| head(number) + &nodes(cell) + "\n").collect()
            };
            let (places, elements) = cells::mesh(gmsh, order, [2, 2, 2], bent);
            let mut text = format!("$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n{}\n", places.len());
            places.iter().zip(1..).for_each(|(at, tag)| writeln!(text, "{tag} {} {} {}", at.x, at.y, at.z).unwrap());
            let head = |number| format!("{} {} 0", number + 1, gmsh.kinds[order]);
            write!(text, "$EndNodes\n$Elements\n{}\n{}$EndElements\n", elements.len(), lines(&elements, 1, &head))
                .unwrap();
            let expected = build_from(text.as_bytes(), "msh").unwrap();
            let (places, elements) = cells::mesh(&vtk, order, [2, 2, 2], bent);
            let mut text = format!(
                "# vtk DataFile Version 2.0\nx\nASCII\nDATASET UNSTRUCTURED_GRID\nPOINTS {} double\n",
                places.len()
            );
            places.iter().for_each(|at| writeln!(text, "{} {} {}", at.x, at.y, at.z).unwrap());
            let size = elements[0].len();
            writeln!(text, "CELLS {} {}", elements.len(), elements.len() * (size + 1)).unwrap();
            text += &lines(&elements, 0, &|_| size.to_string());
            writeln!(
                text,
                "CELL_TYPES {}\n{}",
                elements.len(),
                vec![kinds[order].to_string(); elements.len()].join("\n")
            )
            .unwrap();
            let object = build_from(text.as_bytes(), "vtk").unwrap();
            assert_eq!(object.rest.len(), expected.rest.len(), "{kinds:?}, order {order}");
            let near = |x: &DVec3| expected.rest.iter().any(|y| x.distance(*y) < 1e-12);
            assert!(object.rest.iter().all(near), "{kinds:?}, order {order}");
            let [own, other] = [&object, &expected].map(|object| energy(object, |x| x.z * DVec3::new(x.y, 0.3, x.x)));
            assert!((own / other - 1.0).abs() < 1e-12, "{kinds:?}, order {order}: {own} {other}");
        }
    }
}

#[test]
fn damaged_files_are_refused_with_the_place() {
    let read = |name: &str| std::fs::read(file(name)).unwrap();
    let text = |name: &str| String::from_utf8(read(name)).unwrap();
    let medit = text("block.mesh");
    let vtk = text("text_4.vtk");
    let vtu = text("text.vtu");
    let cases: Vec<(&str, Vec<u8>, &str)> = vec![
        ("mesh", medit.replace("MeshVersionFormatted", "Mesh").into(), "no MEDIT text"),
        ("mesh", medit.replace("Tetrahedra", "TetrahedraP2").into(), "save the mesh in first order"),
        ("mesh", medit.replace("Dimension 3", "Dimension 2").into(), "the mesh is flat"),
        (
            "vtk",
            vtk.replace("UNSTRUCTURED_GRID", "STRUCTURED_POINTS").into(),
            "line 4: only POLYDATA and UNSTRUCTURED_GRID",
        ),
        ("vtk", vtk.replace("POINTS 27", "POINTS 99").into(), "such a number as belongs here"),
        ("vtk", vtk.replace("CELL_TYPES 48", "CELL_TYPES 47").into(), "not as many types as cells"),
        ("vtk", b"solid x\n".to_vec(), "does not begin with `# vtk DataFile Version`"),
        ("vtu", vtu.replace("UnstructuredGrid", "ImageData").into(), "extract a surface or tetrahedra"),
        ("vtu", vtu.replace("</Cells>", "").into(), "not well-formed XML"),
        ("vtu", read("raw_lz4.vtu")[..1400].to_vec(), "damaged or cut off"),
        ("vtu", text("base64_zlib.vtu").replacen("eF5jYCAOz", "eF5jYCAPz", 1).into(), "damaged or cut off"),
        ("msh", read("binary_4.msh")[..900].to_vec(), "byte 899: the file ends too early"),
        ("msh", read("binary_2.msh")[..900].to_vec(), "the file ends too early"),
    ];
    for (ending, content, expected) in cases {
        let error = build_from(&content, ending).unwrap_err();
        assert!(error.contains(expected) && error.contains(&format!("block.{ending}")), "{ending} {expected}: {error}");
    }
    let folder = tempfile::tempdir().unwrap();
    let alone = folder.path().join("alone.ele");
    std::fs::copy(file("block.ele"), &alone).unwrap();
    let error = build(&alone, homogeneous()).unwrap_err();
    assert!(error.contains("alone.node") && error.contains("beside it"), "{error}");
    let surface = build(&file("cube.vtk"), homogeneous()).unwrap_err();
    assert!(surface.contains("but 12 triangles") && surface.contains("[object.mesh]"), "{surface}");
}

/// Counts that no file holds end in an error, without the memory for them.
#[test]
fn hostile_counts_are_refused_without_reserving_memory() {
    let huge = u64::MAX / 2;
    for (ending, content) in [
        ("vtk", format!("# vtk DataFile Version 3.0\nx\nBINARY\nDATASET POLYDATA\nPOINTS {huge} float\n")),
        (
            "vtk",
            format!("# vtk DataFile Version 3.0\nx\nASCII\nDATASET POLYDATA\nFIELD f 1\na {huge} {huge} int\n1 2\n"),
        ),
        ("mesh", format!("MeshVersionFormatted 1\nDimension 3\nVertices {huge}\n0 0 0 0\n")),
        ("msh", format!("$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n{huge}\n1 0 0 0\n")),
    ] {
        assert!(build_from(content.as_bytes(), ending).is_err(), "{ending}");
    }
}
