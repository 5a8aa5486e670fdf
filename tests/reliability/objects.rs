//! Small scenes of every kind of object.

use std::path::Path;

/// Kinds of objects: name and the keys of `[object]`.
pub const OBJECTS: [(&str, &str); 5] = [
    ("springs", "mesh = { file = \"cube.obj\", scale = 0.04 }\nsprings = { kind = \"isotropic\", stiffness = 300.0 }"),
    (
        "skin",
        "mesh = { file = \"cube.obj\", scale = 0.04, refine = 0.03 }\n\
         skin = { thickness = 0.002, young = 1e5, foundation = 1e6 }",
    ),
    ("tetrahedra", "tetrahedra = { file = \"block.msh\", scale = 0.4 }\nelasticity = { young = 2e4, poisson = 0.3 }"),
    (
        "sprung tetrahedra",
        "tetrahedra = { file = \"block.msh\", scale = 0.4 }\nsprings = { kind = \"isotropic\", stiffness = 300.0 }",
    ),
    (
        "lattice",
        "mesh = { file = \"cube.obj\", scale = 0.04 }\nelasticity = { young = 2e4, poisson = 0.3, cell = 0.03 }",
    ),
];

/// Writes `scene.toml` and its meshes into `folder`: two joints above an object from [`OBJECTS`], of `lines` times
/// `lines` points.
pub fn write_scene(folder: &Path, object: &str, lines: usize) {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    std::fs::copy(root.join("datasets/cube.obj"), folder.join("cube.obj")).unwrap();
    std::fs::write(folder.join("block.msh"), BLOCK).unwrap();
    std::fs::write(folder.join("scene.toml"), scene(object, lines)).unwrap();
}

/// The scene's text.
pub fn scene(object: &str, lines: usize) -> String {
    format!(
        r#"name = "small"
[object]
ground = {{ stiffness = 50.0 }}
{object}
[[proxy.joint]]
name = "slide"
kind = "prismatic"
axis = [1.0, 0.0, 0.0]
limits = [-0.05, 0.05]
mass = 0.1
[[proxy.joint]]
name = "press"
kind = "prismatic"
axis = [0.0, 0.0, -1.0]
origin = [0.0, 0.003, 0.07]
limits = [-0.01, 0.06]
mass = 0.1
nodes = [{{ at = [0.0, 0.0, 0.0], radius = 0.01 }}, {{ at = [0.012, 0.0, 0.0] }}]
[contact]
stiffness = 1000.0
[grid]
axes = [{{ start = -0.02, stop = 0.02, count = {lines} }}, {{ start = 0.0, stop = 0.04, count = {lines} }}]
[haptics]
interpolation = "linear"
[graphics]
rate = 60.0
[motion]
press = [{{ time = 0.0, q = [0.0, 0.0] }}, {{ time = 0.1, q = [0.004, 0.035] }}]
"#
    )
}

/// As a Gmsh 2.2 file: a cube of side 0.2 m around the origin: twelve tetrahedra, one on each half of a face, around a
/// node that is not in its middle.
pub const BLOCK: &str = "$MeshFormat
2.2 0 8
$EndMeshFormat
$Nodes
9
1 -0.1 -0.1 -0.1
2 0.1 -0.1 -0.1
3 0.1 0.1 -0.1
4 -0.1 0.1 -0.1
5 -0.1 -0.1 0.1
6 0.1 -0.1 0.1
7 0.1 0.1 0.1
8 -0.1 0.1 0.1
9 0.01 -0.02 0.03
$EndNodes
$Elements
12
1 4 0 1 2 3 9
2 4 0 1 3 4 9
3 4 0 5 7 6 9
4 4 0 5 8 7 9
5 4 0 1 6 2 9
6 4 0 1 5 6 9
7 4 0 4 3 7 9
8 4 0 4 7 8 9
9 4 0 1 4 8 9
10 4 0 1 8 5 9
11 4 0 2 7 3 9
12 4 0 2 6 7 9
$EndElements
";

/// Two tetrahedra as a Gmsh 4.1 file.
pub const BLOCK_4: &str = "$MeshFormat
4.1 0 8
$EndMeshFormat
$Comments
two tetrahedra
$EndComments
$Nodes
1 5 1 5
3 1 0 5
1
2
3
4
5
0 0 0
1 0 0
0 1 0
0 0 1
0.5 0.5 -1
$EndNodes
$Elements
2 3 1 3
2 1 2 1
1 1 2 3
3 1 4 2
2 1 2 3 4
3 1 3 2 5
$EndElements
";
