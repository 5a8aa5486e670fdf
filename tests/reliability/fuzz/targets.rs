//! What is fuzzed: every reader of files, and what is done with the result.

use super::mutate::{self, Random};
use crate::program;
use glam::DVec3;
use haptize::{
    dataset::Dataset,
    device::Motion,
    haptize::{
        BackendChoice, Bake,
        gridize::{GridizeOptions, Interpolation, Samples, gridize},
        import::{Mapping, import},
        scan::ScanLog,
    },
    object::Object,
    proxy::Chain,
    render::{
        recording::Recording,
        session,
        setup::{Setup, labels},
    },
    scene::{
        ElasticSpec, GroundNodes, GroundSpec, Material, ObjectSpec, Rendering, ScanScene, Scene, Shape, SpringKind,
        SpringSpec,
    },
    urdf::{self, Arm, Robot, UrdfError},
};
use std::{
    path::Path,
    sync::{LazyLock, atomic::AtomicBool},
};

/// A reader.
pub struct Target {
    /// Name of its corpus.
    pub name: &'static str,
    /// Of its files.
    pub extension: &'static str,
    /// Inputs beside the corpus.
    pub seeds: fn() -> Vec<Vec<u8>>,
    pub mutate: fn(&mut Random, &[u8], &[u8]) -> Vec<u8>,
    /// Reads an input, which it may write to the file; its outcome.
    pub run: fn(&Path, &[u8]) -> String,
    /// Kinds of outcomes that even a short run reaches.
    pub kinds: usize,
}

fn outcome<T, E: ToString>(result: Result<T, E>) -> String {
    result.map_or_else(|error| error.to_string(), |_| "fine".into())
}

/// A file of this repository.
fn shipped(path: &str) -> Vec<u8> {
    std::fs::read(Path::new(env!("CARGO_MANIFEST_DIR")).join(path)).unwrap()
}

/// Path of a file of this repository.
fn shipped_path(path: &str) -> String {
    Path::new(env!("CARGO_MANIFEST_DIR")).join(path).display().to_string()
}

fn write(file: &Path, input: &[u8]) {
    std::fs::write(file, input).unwrap();
}

pub const DATASETS: Target = Target {
    name: "datasets",
    extension: "haptize",
    seeds: || BAKED.clone(),
    mutate: |random, input, other| {
        let (header, data) = parts(input);
        let (other_header, other_data) = parts(other);
        match random.below(8) {
            0 => mended(&mutate::binary(random, input, other)),
            1..5 => joined(&mutate::text(random, header, other_header), data),
            _ => joined(header, &mutate::binary(random, data, other_data)),
        }
    },
    run: |file, input| {
        write(file, input);
        let dataset = match Dataset::load(file) {
            Ok(dataset) => dataset,
            Err(error) => return error.to_string(),
        };
        let summary = dataset.summary();
        assert_eq!(
            dataset.absent().is_empty(),
            summary.max_residual.is_some() && summary.contacts.is_some() && dataset.gap.is_some()
        );
        match Setup::new(&dataset) {
            Ok(setup) => outcome(rehearsed(&dataset, &setup)),
            Err(error) => error.to_string(),
        }
    },
    kinds: 80,
};

/// Some ticks at the middle of the grid, and frames where there are any.
fn rehearsed(dataset: &Dataset, setup: &Setup) -> Result<(), String> {
    let axes = &dataset.grid.axes;
    let middle: Vec<String> = axes.iter().map(|axis| axis.coordinate(axis.count / 2).to_string()).collect();
    let mut rows = String::from("elapsed\n# start,") + &middle.join(",") + "\n";
    for _ in 0..3 {
        rows += &format!("0.001,0.001,0,0,1,{}{}\n", middle.join(","), ",".repeat(3 * axes.len()));
    }
    let file = tempfile::NamedTempFile::new().unwrap();
    write(file.path(), rows.as_bytes());
    replayed(dataset, setup, file.path())
}

fn replayed(dataset: &Dataset, setup: &Setup, file: &Path) -> Result<(), String> {
    let recording = Recording::read(file, setup.chain.joints.len()).map_err(|error| error.to_string())?;
    let mut graphics = setup.graphics(dataset).map_err(|error| error.to_string())?;
    let trace = recording
        .replay(&setup.haptics, graphics.as_mut(), labels(&dataset.grid))
        .map_err(|error| error.to_string())?;
    let _ = recording.first_difference(&trace);
    let _ = trace.summary();
    Ok(())
}

/// A small dataset of every kind of object.
static BAKED: LazyLock<Vec<Vec<u8>>> =
    LazyLock::new(|| program::OBJECTS.iter().map(|(_, object)| baked(object)).collect());

fn baked(object: &str) -> Vec<u8> {
    let folder = tempfile::tempdir().unwrap();
    program::write_scene(folder.path(), object, 4);
    let scene = Scene::load(folder.path().join("scene.toml")).unwrap();
    let bake = Bake {
        scene: &scene,
        backend: BackendChoice::Cpu,
        measured: Some(0),
        aim: None,
        date: "2026-01-01T00:00:00Z",
        stop: &AtomicBool::new(false),
        progress: &mut |_| (),
    };
    let file = folder.path().join("x.haptize");
    bake.in_memory().unwrap().0.save(&file).unwrap();
    std::fs::read(file).unwrap()
}

/// Header without its padding, and data.
fn parts(file: &[u8]) -> (&[u8], &[u8]) {
    let length = file.first_chunk().map_or(0, |length| u64::from_le_bytes(*length));
    let rest = file.get(8..).unwrap_or_default();
    let (header, data) = rest.split_at(usize::try_from(length).unwrap_or(usize::MAX).min(rest.len()));
    (header.trim_ascii_end(), data)
}

/// The file of a header and data, with length, padding and checksum as they must be.
fn joined(header: &[u8], data: &[u8]) -> Vec<u8> {
    let mut file = vec![0; 8];
    file.extend_from_slice(header);
    file.resize(file.len().next_multiple_of(4096), b' ');
    let length = file.len() as u64 - 8;
    file[..8].copy_from_slice(&length.to_le_bytes());
    file.extend_from_slice(data);
    mended(&file)
}

/// The file with its checksum as it must be.
fn mended(file: &[u8]) -> Vec<u8> {
    let mut file = file.to_vec();
    let at = 8 + r#"{"__metadata__":{"checksum":""#.len();
    if let Some(digits) = file.get_mut(at..at + 8) {
        digits.copy_from_slice(b"00000000");
        let checksum = format!("{:08x}", crc32fast::hash(&file));
        file[at..at + 8].copy_from_slice(checksum.as_bytes());
    }
    file
}

pub const SCENES: Target = Target {
    name: "scenes",
    extension: "toml",
    seeds: || {
        let shipped =
            ["sphere", "mesh", "paper", "sponge", "sponge_side"].map(|name| shipped(&format!("datasets/{name}.toml")));
        let small = program::OBJECTS.map(|(_, object)| program::scene(object, 4).into_bytes());
        shipped.into_iter().chain(small).collect()
    },
    mutate: mutate::text,
    run: |file, input| {
        let text = String::from_utf8_lossy(input);
        let _ = Rendering::parse(&text, file);
        let _ = ScanScene::parse(&text, file);
        let scene = match Scene::parse(&text, file) {
            Ok(scene) => scene,
            Err(error) => return error.to_string(),
        };
        let chain = Chain::new(&scene.proxy);
        let mut pose = chain.new_pose();
        haptize::haptize::sample(&scene).iter().take(4).for_each(|q| chain.pose(q, &mut pose));
        for waypoints in [&scene.motion.press, &scene.motion.scrape] {
            let _ = Motion::through(waypoints, chain.joints.len());
        }
        match &scene.object.shape {
            Shape::Sphere { rings, segments, .. } if rings * segments < 200 => outcome(Object::build(&scene.object)),
            Shape::Icosphere { divisions, .. } if *divisions < 5 => outcome(Object::build(&scene.object)),
            _ => "fine".into(),
        }
    },
    kinds: 80,
};

/// What the object of a mesh file is made of, in turn.
fn mesh(file: &Path, input: &[u8], refine: Option<f64>, material: Material) -> String {
    write(file, input);
    let file = file.to_path_buf();
    let tetrahedra = file.extension().is_some_and(|extension| extension == "msh");
    let (scale, centre) = (0.1, DVec3::ZERO);
    let shape = if tetrahedra {
        Shape::Tetrahedra { file, scale, centre }
    } else {
        Shape::Mesh { file, scale, centre, refine }
    };
    let ground = Some(GroundSpec { stiffness: 10.0, nodes: GroundNodes::All });
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
        "ply\nformat binary_{order}_endian 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty double z\n\
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
    seeds: || vec![program::BLOCK.into(), program::BLOCK_4.into()],
    mutate: mutate::text,
    run: |file, input| {
        mesh(
            file,
            input,
            None,
            Material::Elastic(ElasticSpec { young: 1e4, poisson: 0.3, cell: None, inclusions: Vec::new() }),
        )
    },
    kinds: 30,
};

pub const ROBOTS: Target = Target {
    name: "urdf",
    extension: "urdf",
    seeds: || {
        let file = |name: &str| shipped(&format!("tests/urdf/robots/{name}"));
        // The meshes are found from the folder of the input only where their path is whole.
        let mesh = shipped_path("tests/urdf/robots/meshes/tip.obj");
        let arm = String::from_utf8(file("arm.urdf")).unwrap();
        vec![arm.replace("package://robots/meshes/tip.obj", &mesh).into_bytes(), file("finger.urdf")]
    },
    mutate: mutate::text,
    run: |file, input| {
        write(file, input);
        match imported(file) {
            // What is accepted makes a valid scene.
            Err(UrdfError::Scene(error)) => panic!("{error}"),
            made => outcome(made),
        }
    },
    kinds: 40,
};

/// The scene of the chain to the last link, sampled coarsely.
fn imported(file: &Path) -> Result<String, UrdfError> {
    let robot = Robot::load(file)?;
    let tip = robot.links.iter().rev().find(|link| link.name != "camera").map_or("none", |link| &link.name);
    let arm = Arm::new(&robot, tip, &[])?;
    let nodes = urdf::sample(&robot, &arm, 0.02, None)?;
    urdf::write_scene(&robot, &arm, &nodes, "haptize import")
}

pub const LOGS: Target = Target {
    name: "logs",
    extension: "csv",
    seeds: || (1..=3).map(log).collect(),
    mutate: mutate::text,
    run: |file, input| {
        write(file, input);
        match ScanLog::read(file) {
            Ok(log) => gridized(&log.samples()),
            Err(error) => error.to_string(),
        }
    },
    kinds: 15,
};

/// The log of a scan of `joints` joints.
fn log(joints: usize) -> Vec<u8> {
    let columns =
        |what: &str, unit: &str| (0..joints).map(|joint| format!(",{what} q{joint} [{unit}]")).collect::<String>();
    let mut text = format!(
        "# haptize scan log, version 1\n# kind: simulated\n# plan: the scene's\n# rig: a block\n#> name = \"small\"\n\
         point,time [s]{}{}{},ticks,status\n",
        columns("q", "rad"),
        columns("tau", "N m"),
        columns("std", "N m"),
    );
    let mut random = Random::new(joints as u64);
    for point in 0..24 {
        let mut numbers =
            || (0..joints).map(|_| format!(",{}", random.below(1000) as f64 / 1000.0)).collect::<String>();
        text += &format!(
            "{point},{}{}{}{},100,{}\n",
            f64::from(point) * 0.2,
            numbers(),
            numbers(),
            numbers(),
            if point % 7 == 3 { "unsteady" } else { "steady" }
        );
    }
    text.into_bytes()
}

/// The samples on a grid of about ten lines along each axis.
fn gridized(samples: &Samples) -> String {
    let joints = samples.joints.len();
    let extent = |joint: usize| {
        let values = || samples.configurations.iter().skip(joint).step_by(joints);
        values().copied().fold(f64::NEG_INFINITY, f64::max) - values().copied().fold(f64::INFINITY, f64::min)
    };
    let options = GridizeOptions {
        steps: (0..joints).map(|joint| extent(joint) / 10.0).collect(),
        epsilon: None,
        interpolation: if joints == 2 { Interpolation::Natural } else { Interpolation::Linear },
        smooth: true,
    };
    outcome(gridize(samples, &options))
}

/// Between mapping and table.
const SEPARATOR: &str = "\n%%%%\n";

pub const MAPPINGS: Target = Target {
    name: "mappings",
    extension: "csv",
    seeds: || {
        let table = |delimiter: &str, header: &str| {
            let rows = (0..30).map(|row| {
                let x = f64::from(row) * 0.01;
                [x, x * 2.0, 1.0 - x, (40.0 * x).sin(), x * x].map(|value| format!("{value}")).join(delimiter) + "\n"
            });
            header.to_owned() + &rows.collect::<String>()
        };
        let joint = |name: &str, position: &str, torque: &str| {
            format!(
                "[[joint]]\nname = \"{name}\"\nposition = {{ column = {position} }}\ntorque = {{ column = {torque}, scale = -2.0, offset = 0.1 }}\n"
            )
        };
        [
            ("[time]\ncolumn = 1\ngap = 0.5\n".to_owned() + &joint("a", "2", "4"), table(",", "# a table\n")),
            (
                "[table]\ndelimiter = \" \"\nheader = true\nbad_rows = \"drop\"\n[time]\nperiod = 0.01\n[filter]\nspeed_rows = 2\noutliers = 5.0\ndecimate = 2\n\
                 [torque]\nkeep = \"average\"\nlead = \"b\"\nstill = 0.01\ncell = [0.05, 0.05]\n".to_owned()
                    + &joint("a", "\"x\"", "\"t\"")
                    + &joint("b", "\"y\"", "\"u\""),
                table(" ", "time x y t u\n"),
            ),
            (String::from_utf8(shipped("datasets/instrument.toml")).unwrap(), table(",", "")),
        ]
        .map(|(mapping, table)| (mapping + SEPARATOR + &table).into_bytes())
        .to_vec()
    },
    mutate: mutate::text,
    run: |file, input| {
        let text = String::from_utf8_lossy(input);
        let (mapping, _) = text.split_once(SEPARATOR).unwrap_or((&text, ""));
        let mapping = match Mapping::parse(mapping, file) {
            Ok(mapping) => mapping,
            Err(error) => return error.to_string(),
        };
        let separator = input.windows(SEPARATOR.len()).position(|window| window == SEPARATOR.as_bytes());
        write(file, separator.map_or(&[], |at| &input[at + SEPARATOR.len()..]));
        match import(&mapping, &[file.to_path_buf()], &mut |_| ()) {
            Ok(imported) => gridized(&imported.samples),
            Err(error) => error.to_string(),
        }
    },
    kinds: 50,
};

/// A dataset, ready to be felt.
static FELT: LazyLock<(Dataset, Setup)> = LazyLock::new(|| {
    let file = tempfile::NamedTempFile::new().unwrap();
    write(file.path(), &BAKED[0]);
    let dataset = Dataset::load(file.path()).unwrap();
    let setup = Setup::new(&dataset).unwrap();
    (dataset, setup)
});

pub const RECORDINGS: Target = Target {
    name: "recordings",
    extension: "csv",
    seeds: || {
        let (dataset, setup) = &*FELT;
        let motion = Motion::through(&setup.scene.motion.press, 2).unwrap();
        let mut hand = setup.hand(motion).unwrap();
        let mut graphics = setup.graphics(dataset).unwrap();
        let plan = setup.plan(dataset, 0.03, 2);
        let trace = session::run(&setup.haptics, &mut hand, graphics.as_mut(), &plan).unwrap();
        let mut bytes = Vec::new();
        Recording::of(&trace).write(&labels(&dataset.grid), &mut bytes).unwrap();
        vec![bytes]
    },
    mutate: mutate::text,
    run: |file, input| {
        write(file, input);
        let (dataset, setup) = &*FELT;
        outcome(replayed(dataset, setup, file))
    },
    kinds: 15,
};

pub const MOTIONS: Target = Target {
    name: "motions",
    extension: "csv",
    seeds: || vec![b"time [s],a [rad],b [rad]\n# rest\n0,0,0\n0.5,0.1,-0.2\n\n1e0,+0.3,1e-3\n".to_vec()],
    mutate: mutate::text,
    run: |file, input| {
        write(file, input);
        match Motion::from_csv(file, 2) {
            Ok(motion) => {
                let finite = [-1.0, 0.0, 0.4, 1e9].iter().all(|time| motion.at(*time).0.iter().all(|q| q.is_finite()));
                assert!(finite, "a motion leaves the finite numbers");
                "fine".into()
            }
            Err(error) => error.to_string(),
        }
    },
    kinds: 30,
};
