//! What is fuzzed: every reader of files and of a device's messages, and what is done with the result.

mod devices;
mod measured;
mod meshes;
mod stores;

pub use devices::{DEVICES, FRAMES, REPLIES};
pub use measured::{LOGS, MAPPINGS, MCAP};
pub use meshes::{COLLADA, GLTF, MEDIT, MSH, OBJ, PLY, ROBOTS, STL, TETGEN, VTK, VTU};
pub use stores::STORES;

use super::mutate::{self, Random};
use crate::objects;
use haptize::{
    dataset::{Dataset, JointLabel},
    device::Motion,
    object::Object,
    proxy::Chain,
    render::{
        recording::Recording,
        session,
        setup::{Setup, labels},
    },
    scene::{ElasticSpec, Material, Rendering, ScanScene, Scene, Shape},
    sweep,
};
use std::{path::Path, sync::LazyLock};

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

fn write(file: &Path, input: &[u8]) {
    std::fs::write(file, input).unwrap();
}

pub const DATASETS: Target = Target {
    name: "datasets",
    extension: "haptize",
    seeds: || BAKED.clone(),
    mutate: container,
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
        if cubes(&dataset, file) > MOST_CUBES {
            return "many cubes".into();
        }
        match Setup::new(&dataset) {
            Ok(setup) => outcome(rehearsed(&dataset, &setup)),
            Err(error) => error.to_string(),
        }
    },
    kinds: 80,
};

/// Most cubes of a lattice that an execution makes: the small scenes have 27, and of a thousand, whose nodes move in the
/// frames, the solver takes seconds in this profile.
const MOST_CUBES: f64 = 1e2;

/// Cubes of the lattice that fills a dataset's surface, about; none where nothing does.
fn cubes(dataset: &Dataset, file: &Path) -> f64 {
    let object = Rendering::parse(&dataset.scene, file).ok().and_then(|scene| scene.object);
    let (Some(object), Some(surface)) = (object, &dataset.surface) else { return 0.0 };
    let Material::Elastic(ElasticSpec { cell: Some(cell), .. }) = object.material else { return 0.0 };
    let extent = |axis: usize| {
        let coordinates = || surface.nodes.iter().skip(axis).step_by(3).copied();
        coordinates().fold(f64::MIN, f64::max) - coordinates().fold(f64::MAX, f64::min)
    };
    (0..3).map(|axis| (extent(axis) / cell).max(1.0)).product()
}

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
    LazyLock::new(|| objects::OBJECTS.iter().map(|(_, object)| baked(object)).collect());

fn baked(object: &str) -> Vec<u8> {
    let folder = tempfile::tempdir().unwrap();
    objects::write_scene(folder.path(), object, 4);
    let scene = Scene::load(folder.path().join("scene.toml")).unwrap();
    let file = folder.path().join("x.haptize");
    sweep::baked(&scene).unwrap().0.save(&file).unwrap();
    std::fs::read(file).unwrap()
}

/// Mutates header or data of a file that both have, and its length and checksum are as they must be.
fn container(random: &mut Random, input: &[u8], other: &[u8]) -> Vec<u8> {
    let (header, data) = parts(input);
    let (other_header, other_data) = parts(other);
    match random.below(8) {
        0 => mended(&mutate::binary(random, input, other)),
        1..5 => joined(&mutate::text(random, header, other_header), data),
        _ => joined(header, &mutate::binary(random, data, other_data)),
    }
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
        let shipped = ["sphere", "mesh", "paper", "sponge", "sponge_side", "touch", "nodule"]
            .map(|name| shipped(&format!("datasets/{name}.toml")));
        let small = objects::OBJECTS.map(|(_, object)| objects::scene(object, 4).into_bytes());
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
        let limits = |end: usize| chain.joints.iter().map(|joint| joint.limits[end]).collect::<Vec<_>>();
        [0, 1].map(limits).iter().for_each(|q| chain.pose(q, &mut pose));
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
        Recording::write(&trace, &mut bytes).unwrap();
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
        match Motion::from_csv(file, &["a", "b"].map(|name| JointLabel { name: name.into(), unit: "rad".into() })) {
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
