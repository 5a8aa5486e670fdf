//! Files of meshes and of robots.

use super::{Target, mutate, outcome, shipped, write};
use crate::objects;
use haptize::{
    Error,
    object::Object,
    robot::{self, Arm, Robot},
    scene::{
        ElasticSpec, GroundNodes, GroundSpec, GroundStiffness, Material, ObjectSpec, Placement, Shape, SpringKind,
        SpringSpec,
    },
};
use std::path::Path;

/// What the object of a mesh file is made of, in turn.
fn mesh(file: &Path, input: &[u8], refine: Option<f64>, material: Material) -> String {
    write(file, input);
    let file = file.to_path_buf();
    let solids = ["msh", "ele", "mesh", "vtk", "vtu"];
    let tetrahedra = file.extension().is_some_and(|extension| solids.iter().any(|solid| extension == *solid));
    let placement = Placement { scale: 0.1, ..Placement::METRES };
    let shape =
        if tetrahedra { Shape::Tetrahedra { file, placement } } else { Shape::Mesh { file, placement, refine } };
    let ground = Some(GroundSpec { stiffness: GroundStiffness::PerNode(10.0), nodes: GroundNodes::All });
    outcome(Object::build(&ObjectSpec { shape, material, skin: None, ground, node_mass: 0.01, node_damping: 0.1 }))
}

const SPRINGS: Material = Material::Springs(SpringSpec { kind: SpringKind::Axial, stiffness: 100.0 });

pub const OBJ: Target = Target {
    name: "obj",
    extension: "obj",
    seeds: || {
        vec![
            shipped("datasets/cube.obj"),
            b"v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1/1/1 3//2 2\nf -4 -3 -1\nf 2 3 4\ng a\nf 1 4 3\n".to_vec(),
        ]
    },
    mutate: mutate::text,
    run: |file, input| mesh(file, input, None, SPRINGS),
    kinds: 12,
};

pub const PLY: Target = Target {
    name: "ply",
    extension: "ply",
    seeds: || vec![shipped("datasets/cube.ply"), binary_ply("little"), binary_ply("big")],
    mutate: |random, input, other| match random.below(3) {
        0 => mutate::binary(random, input, other),
        _ => mutate::text(random, input, other),
    },
    run: |file, input| mesh(file, input, Some(0.1), SPRINGS),
    kinds: 40,
};

/// A tetrahedron.
fn binary_ply(order: &str) -> Vec<u8> {
    let little = order == "little";
    let mut bytes = format!(
        "ply\nformat binary_{order}_endian 1.0\nelement vertex 4\n\
         property float x\nproperty float y\nproperty double z\n\
         element face 4\nproperty list uchar int vertex_indices\nend_header\n"
    )
    .into_bytes();
    for [x, y, z] in [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0_f32]] {
        for value in [x, y] {
            bytes.extend(if little { value.to_le_bytes() } else { value.to_be_bytes() });
        }
        let z = f64::from(z);
        bytes.extend(if little { z.to_le_bytes() } else { z.to_be_bytes() });
    }
    for corners in [[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2_i32]] {
        bytes.push(3);
        bytes.extend(
            corners.map(|corner| if little { corner.to_le_bytes() } else { corner.to_be_bytes() }).as_flattened(),
        );
    }
    bytes
}

pub const STL: Target = Target {
    name: "stl",
    extension: "stl",
    seeds: || vec![shipped("datasets/cube.stl"), binary_stl()],
    mutate: PLY.mutate,
    run: |file, input| {
        mesh(
            file,
            input,
            None,
            Material::Elastic(ElasticSpec { young: 1e4, poisson: 0.3, cell: Some(0.1), inclusions: Vec::new() }),
        )
    },
    kinds: 14,
};

/// A tetrahedron.
fn binary_stl() -> Vec<u8> {
    let corners = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0_f32]];
    let mut bytes = vec![b' '; 80];
    bytes.extend(4_u32.to_le_bytes());
    for face in [[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]] {
        bytes.extend([0; 12]);
        face.iter().flat_map(|&node: &usize| corners[node]).for_each(|value| bytes.extend(value.to_le_bytes()));
        bytes.extend([0; 2]);
    }
    bytes
}

pub const MSH: Target = Target {
    name: "msh",
    extension: "msh",
    seeds: || vec![objects::BLOCK.into(), objects::BLOCK_4.into(), sample("binary_2.msh"), sample("binary_4.msh")],
    mutate: PLY.mutate,
    run: |file, input| mesh(file, input, None, SOLID),
    kinds: 30,
};

const SOLID: Material = Material::Elastic(ElasticSpec { young: 1e4, poisson: 0.3, cell: None, inclusions: Vec::new() });

/// A file of tests/references/mesh_formats.py.
fn sample(name: &str) -> Vec<u8> {
    shipped(&format!("tests/object/meshes/{name}"))
}

pub const GLTF: Target = Target {
    name: "gltf",
    extension: "glb",
    // The text of a part alone is a file of its own, whose bytes are missing.
    seeds: || vec![sample("cube.glb"), sample("cube.glb")[20..].to_vec()],
    run: |file, input| mesh(file, input, None, SPRINGS),
    kinds: 12,
    ..MSH
};

pub const COLLADA: Target = Target {
    name: "collada",
    extension: "dae",
    seeds: || vec![sample("cube.dae")],
    mutate: mutate::text,
    run: GLTF.run,
    kinds: 12,
};

pub const VTK: Target = Target {
    name: "vtk",
    extension: "vtk",
    seeds: || vec![sample("binary_5.vtk"), sample("text_4.vtk"), sample("cube.vtk")],
    kinds: 12,
    ..MSH
};

pub const VTU: Target = Target {
    name: "vtu",
    extension: "vtu",
    seeds: || ["text.vtu", "base64_zlib.vtu", "raw_lz4.vtu", "appended.vtu", "cube.vtp"].map(sample).to_vec(),
    kinds: 12,
    ..MSH
};

pub const MEDIT: Target = Target {
    name: "medit",
    extension: "mesh",
    seeds: || vec![sample("block.mesh")],
    mutate: mutate::text,
    kinds: 12,
    ..MSH
};

/// Between the nodes and the tetrahedra of one input.
const NEXT: &[u8] = b"\n%%\n";

pub const TETGEN: Target = Target {
    name: "tetgen",
    extension: "ele",
    seeds: || vec![[&sample("block.node"), NEXT, &sample("block.ele")].concat()],
    mutate: mutate::text,
    run: |file, input| {
        let place = input.windows(NEXT.len()).position(|window| window == NEXT).unwrap_or(0);
        write(&file.with_extension("node"), &input[..place]);
        mesh(file, input.get(place + NEXT.len()..).unwrap_or_default(), None, SOLID)
    },
    kinds: 12,
};

pub const ROBOTS: Target = Target {
    name: "urdf",
    extension: "urdf",
    seeds: || {
        let file = |name: &str| shipped(&format!("tests/robots/{name}"));
        let arm = String::from_utf8(file("arm.urdf")).unwrap();
        vec![
            arm.replace("package://robots/meshes/tip.obj", "tip.obj").into_bytes(),
            file("finger.urdf"),
            file("crane.xml"),
        ]
    },
    mutate: mutate::text,
    run: |file, input| {
        write(file, input);
        // Beside the input, so that its text holds no path of the machine: everywhere the same is mutated.
        write(&file.with_file_name("tip.obj"), &shipped("tests/robots/meshes/tip.obj"));
        match imported(file) {
            // What is accepted makes a valid scene.
            Err(error) if error.to_string().contains("a fault of this program") => panic!("{error}"),
            made => outcome(made),
        }
    },
    kinds: 40,
};

/// The scene of the chain to the last link, sampled coarsely.
fn imported(file: &Path) -> Result<String, Error> {
    let robot = Robot::load(file)?;
    let tip = robot.links.iter().rev().find(|link| link.name != "camera").map_or("none", |link| &link.name);
    let arm = Arm::new(&robot, tip, &[])?;
    let nodes = robot::sample(&robot, &arm, Some(0.02), None)?;
    let (shapes, _) = robot::drawn_shapes(&robot, &arm, None);
    robot::write_scene(&robot, &arm, &nodes, &shapes, "haptize import")
}
