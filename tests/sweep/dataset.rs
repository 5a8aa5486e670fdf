//! The dataset file: what is written is read back, and nothing else is.

use crate::fixture::peak;
use haptize::{
    Error, ErrorKind,
    contact::Status,
    dataset::{Axis, Contacts, Dataset, Format, Grid, Provenance, SlipColumns, Solid, Surface},
    report::page::Page,
};
use std::{
    fs::{File, OpenOptions},
    io::{Seek, SeekFrom, Write},
    path::{Path, PathBuf},
};

/// Two joints (one prismatic), 2 x 3 points, a point of every status, awkward numbers.
fn sample() -> Dataset {
    let axis =
        |name: &str, unit: &str, start, step, count| Axis { name: name.into(), unit: unit.into(), start, step, count };
    Dataset {
        grid: Grid {
            axes: vec![
                axis("base", "rad", -0.1, std::f64::consts::PI / 60.0, 2),
                axis("\"s\", lide", "m", 0.3, 1e-3, 3),
            ],
        },
        torque: (0..12)
            .map(|k| f64::from(k).sqrt() * if k % 2 == 0 { -1e-9 } else { 1.0 / 3.0 })
            .collect::<Vec<_>>()
            .into(),
        energy: Some(vec![0.0, 1e-300, 0.1, 0.2, f64::MAX, -0.0].into()),
        gap: Some(vec![0.01, -0.01, 1e-38, 0.1, -0.2, 0.3].into()),
        status: vec![0, 1, 1, 2, 3, 4].into(),
        residual: Some(vec![0.0, 1e-9, 3e-8, 0.5, 0.0, 0.0].into()),
        iterations: Some(vec![0, 3, 4, 100, 7, 0].into()),
        tangent: Some((0..18).map(|k| (k as f32 - 9.0) * 0.37).collect::<Vec<_>>().into()),
        contacts: Some(Contacts {
            offsets: vec![0, 0, 2, 3, 5, 5, 5].into(),
            nodes: vec![0, 3, 1, 1, 2].into(),
            forces: (0..15).map(|k| k as f32 * 0.1 - 0.3).collect::<Vec<_>>().into(),
        }),
        slip: Some(SlipColumns {
            normal_force: vec![0.0, 1.5, 1e-3, 20.0, 0.25, 0.0].into(),
            jacobian: (0..18).map(|k| 0.2 - k as f32 * 0.1).collect::<Vec<_>>().into(),
        }),
        surface: Some(Surface {
            nodes: (0..12).map(|k| f64::from(k) / 7.0).collect::<Vec<_>>().into(),
            triangles: vec![0, 1, 2, 0, 2, 3, 0, 3, 1, 1, 3, 2].into(),
            solid: Some(Solid {
                inner_nodes: vec![0.1, 0.2, 1.0 / 3.0].into(),
                tetrahedra: vec![0, 1, 2, 4, 0, 2, 3, 4].into(),
                mid_nodes: vec![0, 1, 2, 3, 4, 0, 1, 2, 3, 4, 0, 1].into(),
                regions: vec![3, 1].into(),
            }),
        }),
        refinement: None,
        scene: "name = \"sample\" # Kontakt \u{fc}ber \u{3c0}\n".into(),
        provenance: Provenance {
            notices: vec!["from grid point 7 on: solved otherwise".into()],
            version: "0.0.0".into(),
            algorithm: "energy".into(),
            tolerance: 0.1 + 0.2,
            backend: "cpu".into(),
            adapter: "none".into(),
            date: "2012-03-04T00:00:00Z".into(),
            error: None,
            mesh_ripple: None,
            relaxation: Some(haptize::dataset::IdentifiedRelaxation {
                terms: vec![[0.4, 0.05], [0.2, 0.5]],
                histories: 12,
                misfit: 0.01,
                held_out: Some(0.02),
            }),
            friction: Some(haptize::dataset::IdentifiedFriction {
                coefficient: 0.4,
                strokes: 6,
                deviation: 0.02,
                stiffness: Some(300.0),
                predicted: vec![[0.1, 0.4]],
            }),
            aim: None,
        },
    }
}

/// The least that a dataset can be: what a scanned object has.
fn bare() -> Dataset {
    let Dataset { grid, torque, status, scene, provenance, .. } = sample();
    Dataset { scene, provenance, ..Dataset::bare(grid, torque, status) }
}

fn bits<T: bytemuck::Pod>(column: &[T]) -> Vec<u8> {
    bytemuck::cast_slice(column).to_vec()
}

/// Everything in a dataset, bit for bit.
fn contents(dataset: &Dataset) -> Vec<(&'static str, Option<Vec<u8>>)> {
    let contacts = dataset.contacts.as_ref();
    let slip = dataset.slip.as_ref();
    let surface = dataset.surface.as_ref();
    let solid = surface.and_then(|surface| surface.solid.as_ref());
    vec![
        ("grid", Some(format!("{:?}", dataset.grid).into_bytes())),
        ("provenance", Some(format!("{:?}", dataset.provenance).into_bytes())),
        ("scene", Some(dataset.scene.clone().into_bytes())),
        ("torque", Some(bits(&dataset.torque))),
        ("status", Some(bits(&dataset.status))),
        ("energy", dataset.energy.as_ref().map(|c| bits(c))),
        ("gap", dataset.gap.as_ref().map(|c| bits(c))),
        ("residual", dataset.residual.as_ref().map(|c| bits(c))),
        ("iterations", dataset.iterations.as_ref().map(|c| bits(c))),
        ("offsets", contacts.map(|c| bits(&c.offsets))),
        ("nodes", contacts.map(|c| bits(&c.nodes))),
        ("forces", contacts.map(|c| bits(&c.forces))),
        ("normal force", slip.map(|slip| bits(&slip.normal_force))),
        ("slip Jacobian", slip.map(|slip| bits(&slip.jacobian))),
        ("surface nodes", surface.map(|s| bits(&s.nodes))),
        ("triangles", surface.map(|s| bits(&s.triangles))),
        ("inner nodes", solid.map(|s| bits(&s.inner_nodes))),
        ("tetrahedra", solid.map(|s| bits(&s.tetrahedra))),
        ("nodes in the middles of edges", solid.map(|s| bits(&s.mid_nodes))),
    ]
}

struct Folder(tempfile::TempDir);

impl Folder {
    fn new() -> Self {
        Self(tempfile::tempdir().unwrap())
    }
    fn file(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }
    fn written(&self, bytes: &[u8]) -> PathBuf {
        let path = self.file("forged.haptize");
        std::fs::write(&path, bytes).unwrap();
        path
    }
}

fn saved(dataset: &Dataset) -> Vec<u8> {
    let folder = Folder::new();
    let path = folder.file("a.haptize");
    dataset.save(&path).unwrap();
    std::fs::read(path).unwrap()
}

/// Both ways of reading must agree; the error's text names file and remedy.
fn refusal(path: &Path) -> Option<Error> {
    let opened = Dataset::open(path).err();
    let loaded = Dataset::load(path).err();
    assert_eq!(opened.as_ref().map(ToString::to_string), loaded.as_ref().map(ToString::to_string));
    if let Some(error) = &opened {
        let text = error.to_string();
        assert!(text.starts_with(&path.display().to_string()), "{text}");
        assert!(
            ["bake", "check the path", "give a file", "give that"].iter().any(|remedy| text.contains(remedy)),
            "{text}"
        );
    }
    opened
}

#[test]
fn what_is_written_is_read_back_bit_for_bit() {
    let folder = Folder::new();
    for dataset in [sample(), bare()] {
        let path = folder.file("a.haptize");
        dataset.save(&path).unwrap();
        for read in [Dataset::open(&path).unwrap(), Dataset::load(&path).unwrap()] {
            assert_eq!(contents(&read), contents(&dataset));
        }
        assert_eq!(saved(&dataset), saved(&dataset), "the same dataset is the same file");
    }
    let mut other = sample();
    other.energy = Some(vec![0.0, 1e-300, 0.1, 0.2, f64::MAX, 0.0].into());
    assert_ne!(contents(&other), contents(&sample()), "the comparison sees a sign of zero");
}

#[test]
fn other_readers_of_safetensors_read_it() {
    let bytes = saved(&sample());
    let tensors = safetensors::SafeTensors::deserialize(&bytes).unwrap();
    let torque = tensors.tensor("torque").unwrap();
    assert_eq!(torque.shape(), [2, 3, 2]);
    assert_eq!(torque.data(), bytemuck::cast_slice::<f64, u8>(&sample().torque));
    assert_eq!(tensors.tensor("contact_forces").unwrap().shape(), [5, 3]);
    let (_, metadata) = safetensors::SafeTensors::read_metadata(&bytes).unwrap();
    assert_eq!(metadata.metadata().as_ref().unwrap()["scene"], sample().scene);
}

#[test]
fn what_the_scene_does_not_call_for_takes_no_bytes() {
    let bytes = saved(&bare());
    let tensors = safetensors::SafeTensors::deserialize(&bytes).unwrap();
    let mut names = tensors.names();
    names.sort_unstable();
    assert_eq!(names, ["status", "torque"]);
    assert_eq!(bytes.len() % 4096, 12 * 8 + 6);
}

#[test]
fn a_flipped_bit_of_any_byte_is_found() {
    let folder = Folder::new();
    let path = folder.file("a.haptize");
    sample().save(&path).unwrap();
    let mut file = OpenOptions::new().read(true).write(true).open(&path).unwrap();
    let mut put = |at: usize, byte: u8| {
        file.seek(SeekFrom::Start(at as u64)).unwrap();
        file.write_all(&[byte]).unwrap();
    };
    for (at, byte) in std::fs::read(&path).unwrap().into_iter().enumerate() {
        // Every bit of what stands before the header's text, and of the other bytes, which one checksum covers, one each.
        for bit in if at < 64 { 0..8 } else { at % 8..at % 8 + 1 } {
            put(at, byte ^ (1 << bit));
            assert!(Dataset::open(&path).is_err(), "bit {bit} of byte {at} is not covered");
        }
        put(at, byte);
    }
    assert!(refusal(&path).is_none());
}

#[test]
fn a_file_cut_anywhere_or_grown_is_refused() {
    let folder = Folder::new();
    let bytes = saved(&sample());
    let path = folder.written(&bytes);
    let file = OpenOptions::new().write(true).open(&path).unwrap();
    for length in (0..bytes.len()).rev() {
        file.set_len(length as u64).unwrap();
        assert!(Dataset::open(&path).is_err(), "cut to {length} bytes");
    }
    for length in [0, 1, 8, 40, 4095, 4096, bytes.len() - 1] {
        assert!(refusal(&folder.written(&bytes[..length])).is_some());
    }
    assert!(refusal(&folder.written(&[&bytes[..], &[0]].concat())).is_some());
}

#[test]
fn files_that_are_none_are_refused_by_name() {
    let folder = Folder::new();
    assert_eq!(refusal(&folder.file("missing")).map(|error| error.kind()), Some(ErrorKind::File));
    assert_eq!(refusal(folder.0.path()).map(|error| error.kind()), Some(ErrorKind::File));
    assert_eq!(refusal(&folder.written(b"name = \"a scene\"\n")).map(|error| error.kind()), Some(ErrorKind::Foreign));
    #[cfg(unix)]
    assert_eq!(refusal(Path::new("/dev/zero")).map(|error| error.kind()), Some(ErrorKind::File));
}

/// A file with its header's JSON and its data changed, and lengths and checksum right again.
fn forged(dataset: &Dataset, change: impl FnOnce(&mut serde_json::Value, &mut Vec<u8>)) -> Vec<u8> {
    let bytes = saved(dataset);
    let length = u64::from_le_bytes(bytes[..8].try_into().unwrap()) as usize;
    let mut header: serde_json::Value = serde_json::from_slice(&bytes[8..8 + length]).unwrap();
    let mut data = bytes[8 + length..].to_vec();
    change(&mut header, &mut data);
    header["__metadata__"]["checksum"] = "00000000".into();
    let mut text = serde_json::to_vec(&header).unwrap();
    text.resize((text.len() + 8).next_multiple_of(4096) - 8, b' ');
    let mut forged = [&(text.len() as u64).to_le_bytes()[..], &text, &data].concat();
    let checksum = format!("{:08x}", crc32fast::hash(&forged));
    let at = 8 + r#"{"__metadata__":{"checksum":""#.len();
    forged[at..at + 8].copy_from_slice(checksum.as_bytes());
    forged
}

/// Changes the JSON text that stands in the metadata under `key`.
fn in_metadata(header: &mut serde_json::Value, key: &str, change: impl FnOnce(&mut serde_json::Value)) {
    let mut value = serde_json::from_str(header["__metadata__"][key].as_str().unwrap()).unwrap();
    change(&mut value);
    header["__metadata__"][key] = value.to_string().into();
}

/// Where the tensor `name` lies in the data.
fn place(header: &serde_json::Value, name: &str) -> usize {
    header[name]["data_offsets"][0].as_u64().unwrap() as usize
}

/// A change of a file's header and data.
type Change = Box<dyn FnOnce(&mut serde_json::Value, &mut Vec<u8>)>;

/// A hostile file: its name, how it differs from a sound one, and what the refusal says.
type Hostile = (&'static str, Change, &'static str);

/// Overwrites an entry of a tensor.
fn write(name: &'static str, entry: usize, bytes: Vec<u8>) -> Change {
    Box::new(move |header, data| {
        let at = place(header, name) + entry * bytes.len();
        data[at..at + bytes.len()].copy_from_slice(&bytes);
    })
}

/// Files with a wrong grid.
fn hostile_grids() -> Vec<Hostile> {
    let axis = |key: &'static str, value: serde_json::Value| -> Change {
        Box::new(move |header, _| in_metadata(header, "grid", |grid| grid["axes"][1][key] = value))
    };
    vec![
        ("a trillion points", axis("count", 1_000_000_000_000_u64.into()), "shape"),
        ("a count that overflows", axis("count", u64::MAX.into()), "too many points"),
        ("a negative count", axis("count", (-1).into()), "grid"),
        ("a name of two lines", axis("name", "a\nb".into()), "a\\u000ab"),
        ("a name that turns", axis("name", "a\u{202e}b".into()), "U+202E"),
        ("no lines", axis("count", 0.into()), "no grid lines"),
        ("a step of zero", axis("step", 0.0.into()), "ascend"),
        ("a step lost in rounding", axis("start", 1e18.into()), "ascend"),
        ("a foreign unit", axis("unit", "deg".into()), "unit"),
        (
            "seven axes",
            Box::new(|header, _| {
                in_metadata(header, "grid", |grid| {
                    let axis = grid["axes"][0].clone();
                    grid["axes"] = vec![axis; 7].into();
                })
            }),
            "7 axes",
        ),
    ]
}

/// Files with a wrong number in a tensor.
fn hostile_numbers() -> Vec<Hostile> {
    vec![
        ("an unknown status", write("status", 5, vec![5]), "status 5 of point 5"),
        ("a torque that is no number", write("torque", 7, f64::NAN.to_le_bytes().into()), "entry 7 of torque"),
        ("infinite energy", write("energy", 1, f64::INFINITY.to_le_bytes().into()), "entry 1 of energy"),
        ("a gap that is no number", write("gap", 0, f32::NAN.to_le_bytes().into()), "entry 0 of gap"),
        ("an infinite force", write("contact_forces", 14, f32::INFINITY.to_le_bytes().into()), "contact_forces"),
        ("a corner of the surface nowhere", write("surface_nodes", 0, f64::NAN.to_le_bytes().into()), "surface_nodes"),
        ("a triangle on a node that is not", write("surface_triangles", 3, 4_u32.to_le_bytes().into()), "node 4, of 4"),
        ("a tetrahedron on a node that is not", write("tetrahedra", 7, 5_u32.to_le_bytes().into()), "node 5, of 5"),
        ("an edge's node that is not", write("mid_nodes", 3, 5_u32.to_le_bytes().into()), "node 5, of 5"),
        ("an inner node nowhere", write("inner_nodes", 2, f64::INFINITY.to_le_bytes().into()), "inner_nodes"),
        ("tetrahedra without inner nodes", Box::new(|header, _| rename(header, "inner_nodes", "i")), "inner_nodes"),
        ("a contact on a node that is not", write("contact_nodes", 1, u32::MAX.to_le_bytes().into()), "contact_nodes"),
        ("a node twice in a row", write("contact_nodes", 1, 0_u32.to_le_bytes().into()), "do not ascend"),
        ("an infinite normal force", write("normal_force", 2, f32::INFINITY.to_le_bytes().into()), "normal_force"),
        ("a slip that is no number", write("slip_jacobian", 8, f32::NAN.to_le_bytes().into()), "slip_jacobian"),
        ("normal forces without slips", Box::new(|header, _| rename(header, "slip_jacobian", "s")), "slip_jacobian"),
        ("a row beyond the end", write("contact_offsets", 3, u64::MAX.to_le_bytes().into()), "descend"),
        ("a descending row", write("contact_offsets", 2, 4_u64.to_le_bytes().into()), "descend"),
        ("a last row too short", write("contact_offsets", 6, 4_u64.to_le_bytes().into()), "do not run"),
    ]
}

/// Files whose tensors do not fit, or are not those of a dataset.
fn hostile_headers() -> Vec<Hostile> {
    vec![
        (
            "tensors whose lengths overflow together",
            Box::new(|header, _| {
                let huge: u64 = (1 << 61) - 1;
                let mut end = header["status"]["data_offsets"][1].as_u64().unwrap();
                for k in 0..7 {
                    header[format!("x{k}")] =
                        serde_json::json!({"dtype": "U8", "shape": [huge], "data_offsets": [end, end + huge]});
                    end += huge;
                }
            }),
            "promises",
        ),
        (
            "a tensor too many",
            Box::new(|header, data| {
                let end = data.len();
                header["extra"] = serde_json::json!({"dtype": "U8", "shape": [1], "data_offsets": [end, end + 1]});
                data.push(0);
            }),
            "extra does not belong",
        ),
        ("a foreign name", Box::new(|header, _| rename(header, "energy", "zeal")), "zeal does not belong"),
        (
            "what friction was felt by before",
            Box::new(|header, _| rename(header, "iterations", "touch_offsets")),
            "leave contact_damping out of its scene and bake it again",
        ),
        ("no torque", Box::new(|header, _| rename(header, "torque", "tau")), "torque is missing"),
        ("contacts without forces", Box::new(|header, _| rename(header, "contact_forces", "f")), "contact_forces"),
        ("another type", Box::new(|header, _| header["energy"]["dtype"] = "I64".into()), "energy has type I64"),
        ("a shape turned", Box::new(|header, _| header["energy"]["shape"] = vec![3, 2].into()), "energy has type"),
        (
            "forces of two numbers",
            Box::new(|header, _| header["contact_forces"]["shape"] = vec![15, 1].into()),
            "forces",
        ),
        (
            "no scene",
            Box::new(|header, _| drop(header["__metadata__"].as_object_mut().unwrap().remove("scene"))),
            "scene",
        ),
        ("a grid that is no JSON", Box::new(|header, _| header["__metadata__"]["grid"] = "{".into()), "grid"),
        ("deep nesting", Box::new(|header, _| header["__metadata__"]["grid"] = "[".repeat(100_000).into()), "grid"),
        ("another version", Box::new(|header, _| header["__metadata__"]["format"] = "haptize dataset 99".into()), "99"),
    ]
}

#[test]
fn hostile_files_with_right_checksums_are_refused_in_small_memory() {
    let cases = [hostile_grids(), hostile_numbers(), hostile_headers()].into_iter().flatten();
    let folder = Folder::new();
    assert!(refusal(&folder.written(&forged(&sample(), |_, _| ()))).is_none(), "forging itself is not what is refused");
    for (name, change, reason) in cases {
        let path = folder.written(&forged(&sample(), change));
        let (refusal, held) = peak(|| refusal(&path));
        let error = refusal.unwrap_or_else(|| panic!("{name} was accepted")).to_string();
        assert!(error.contains(reason), "{name}: {error}");
        assert!(held < 4 << 20, "{name}: {held} bytes");
    }
}

fn rename(header: &mut serde_json::Value, from: &str, to: &str) {
    let tensors = header.as_object_mut().unwrap();
    let tensor = tensors.remove(from).unwrap();
    tensors.insert(to.into(), tensor);
}

#[test]
fn hostile_header_lengths_allocate_nothing() {
    let folder = Folder::new();
    let bytes = saved(&sample());
    for length in [0, 1, 4087, 4089, 16 << 20, (16 << 20) + 4088, 1 << 40, i64::MAX as u64, u64::MAX - 8, u64::MAX] {
        let mut forged = bytes.clone();
        forged[..8].copy_from_slice(&length.to_le_bytes());
        let path = folder.written(&forged);
        let (refusal, held) = peak(|| refusal(&path));
        assert_eq!(refusal.map(|error| error.kind()), Some(ErrorKind::Dataset), "{length}");
        assert!(held < 4 << 20, "{length}: {held} bytes");
    }
}

#[test]
fn a_dataset_that_contradicts_itself_is_not_written() {
    let folder = Folder::new();
    let path = folder.file("a.haptize");
    sample().save(&path).unwrap();
    let before = std::fs::read(&path).unwrap();
    let wrong = [
        Dataset { status: vec![0; 5].into(), ..sample() },
        Dataset { torque: vec![f64::NAN; 12].into(), ..sample() },
        Dataset { surface: None, ..sample() },
        Dataset { grid: Grid { axes: vec![] }, ..sample() },
    ];
    for dataset in wrong {
        assert!(dataset.save(&path).unwrap_err().to_string().contains("contradicts itself"));
        for format in [Format::Npz, Format::Csv, Format::Hdf5, Format::Vti] {
            let file = folder.file("a").with_extension(format.extension());
            assert!(dataset.export(&file, format).unwrap_err().to_string().contains("contradicts itself"));
            assert!(!file.exists());
        }
    }
    assert_eq!(std::fs::read(&path).unwrap(), before);
    assert_eq!(sample().save(&folder.file("no/such/folder/a")).unwrap_err().kind(), ErrorKind::File);
}

#[test]
fn a_mapped_dataset_survives_its_replacement() {
    let folder = Folder::new();
    let path = folder.file("a.haptize");
    sample().save(&path).unwrap();
    let mapped = Dataset::open(&path).unwrap();
    bare().save(&path).unwrap();
    assert_eq!(contents(&mapped), contents(&sample()));
    assert_eq!(contents(&Dataset::open(&path).unwrap()), contents(&bare()));
}

/// As where another program overwrites a file that is mapped.
#[test]
fn contacts_whose_offsets_lead_nowhere_are_none() {
    for offsets in [[u64::MAX; 7], [0, 5, 2, 9, 3, 0, 5], [0, 0, 2, 3, 5, 5, u64::MAX / 3 + 2]] {
        let mut dataset = sample();
        let contacts = dataset.contacts.as_mut().unwrap();
        contacts.offsets = offsets.to_vec().into();
        contacts.forces = vec![1.0; 12].into();
        assert!((0..6).all(|point| dataset.forces(point).len() <= 5));
        assert!(dataset.summary().max_contacts <= Some(5));
        assert!(Page::dataset("sample".into(), &dataset).html().is_ok());
    }
}

#[test]
fn the_summary_counts_what_is_there() {
    let summary = sample().summary();
    assert_eq!(summary.points, 6);
    let counts = summary.statuses;
    assert_eq!([counts.free, counts.contact, counts.unconverged, counts.overflow, counts.outside], [1, 2, 1, 1, 1]);
    assert_eq!(summary.contacts, Some(5));
    assert_eq!(summary.max_contacts, Some(2));
    assert_eq!(summary.max_depth, Some(f64::from(0.2_f32)));
    assert_eq!(summary.max_residual, Some(f64::from(3e-8_f32)));
    // Points 1 and 2 converged: their torques are entries 2 to 5, their forces 0 to 8.
    let torque = &sample().torque;
    assert_eq!(summary.torque, [[torque[4], 0.0], [0.0, torque[5]]]);
    let force = sample().forces(2).map(|contact| contact.force.length()).fold(0.0, f64::max);
    assert_eq!(summary.max_force, Some(force));
    assert_eq!(sample().forces(0).len(), 0);
    assert_eq!(sample().forces(3).map(|contact| contact.node).collect::<Vec<_>>(), [1, 2]);
    assert!(Dataset::status(&sample(), 3) == Status::Unconverged);
    assert_eq!(bare().summary().max_force, None);
}

#[cfg(unix)]
#[test]
fn the_file_is_as_readable_as_any_other_new_file() {
    use std::os::unix::fs::PermissionsExt;
    let folder = Folder::new();
    let (path, other) = (folder.file("a.haptize"), folder.file("other"));
    sample().save(&path).unwrap();
    File::create(&other).unwrap();
    let mode = |path: &Path| std::fs::metadata(path).unwrap().permissions().mode();
    assert_eq!(mode(&path), mode(&other));
}

/// The array `name` of an archive: shape and numbers.
fn array<T: npyz::Deserialize>(path: &Path, name: &str) -> Option<(Vec<u64>, Vec<T>)> {
    let mut archive = zip::ZipArchive::new(File::open(path).unwrap()).unwrap();
    let entry = archive.by_name(&npyz::npz::file_name_from_array_name(name)).ok()?;
    let array = npyz::NpyFile::new(entry).unwrap();
    Some((array.shape().to_vec(), array.into_vec().unwrap()))
}

#[test]
fn the_numpy_archive_holds_the_same_numbers() {
    let folder = Folder::new();
    let path = folder.file("a.npz");
    let dataset = sample();
    assert_eq!(dataset.export(&path, Format::Npz).unwrap(), std::slice::from_ref(&path));
    assert_eq!(array(&path, "torque"), Some((vec![2, 3, 2], dataset.torque.to_vec())));
    assert_eq!(array(&path, "energy"), Some((vec![2, 3], dataset.energy.as_ref().unwrap().to_vec())));
    assert_eq!(array(&path, "gap"), Some((vec![2, 3], dataset.gap.as_ref().unwrap().to_vec())));
    assert_eq!(array(&path, "status"), Some((vec![2, 3], dataset.status.to_vec())));
    assert_eq!(array(&path, "iterations"), Some((vec![2, 3], dataset.iterations.as_ref().unwrap().to_vec())));
    let contacts = dataset.contacts.as_ref().unwrap();
    assert_eq!(array(&path, "contact_offsets"), Some((vec![7], contacts.offsets.to_vec())));
    assert_eq!(array(&path, "contact_forces"), Some((vec![5, 3], contacts.forces.to_vec())));
    let q: Vec<f64> = (0..6).flat_map(|point| dataset.grid.configuration(point).to_vec()).collect();
    assert_eq!(array(&path, "q"), Some((vec![2, 3, 2], q)));
    assert_eq!(array(&path, "q2"), Some((vec![3], (0..3).map(|k| dataset.grid.axes[1].coordinate(k)).collect())));
    assert_eq!(array(&path, "joint_names"), Some((vec![2], vec!["base".to_string(), "\"s\", lide".to_string()])));
    assert_eq!(array(&path, "scene"), Some((vec![], vec![dataset.scene.clone()])));

    bare().export(&path, Format::Npz).unwrap();
    assert_eq!(array::<f64>(&path, "energy"), None);
}

/// What h5py finds in such files is tested with the Python package.
#[test]
fn the_hdf5_file_is_one_and_holds_the_bytes_of_every_column() {
    let folder = Folder::new();
    let path = folder.file("a.h5");
    let dataset = sample();
    assert_eq!(Format::named("hdf5"), Some(Format::Hdf5));
    assert_eq!(dataset.export(&path, Format::Hdf5).unwrap(), std::slice::from_ref(&path));
    let file = std::fs::read(&path).unwrap();
    assert!(file.starts_with(b"\x89HDF\r\n\x1a\n"));
    let holds = |bytes: &[u8]| file.windows(bytes.len()).any(|window| window == bytes);
    assert!(holds(bytemuck::cast_slice(&dataset.torque)));
    assert!(holds(bytemuck::cast_slice(&dataset.contacts.as_ref().unwrap().forces)));
    assert!(holds(dataset.scene.as_bytes()) && holds(b"\"s\", lide") && !holds(&[0x5a; 16]));
    let whole = file.len();
    bare().export(&path, Format::Hdf5).unwrap();
    assert!(std::fs::read(&path).unwrap().len() < whole);
}

#[test]
fn the_text_files_hold_the_same_numbers() {
    let folder = Folder::new();
    let (path, other) = (folder.file("a.csv"), folder.file("a.contacts.csv"));
    let dataset = sample();
    assert_eq!(dataset.export(&path, Format::Csv).unwrap(), [path.clone(), other.clone()]);
    let text = std::fs::read_to_string(&path).unwrap();
    let mut lines = text.lines();
    assert_eq!(
        lines.next().unwrap(),
        "base [rad],\"\"\"s\"\", lide [m]\",torque base [N m],\"force \"\"s\"\", lide [N]\",energy [J],normal_force [N],\
         gap [m],status (0 free; 1 contact; 2 unconverged; 3 overflow; 4 outside),residual [1],iterations,contacts"
    );
    let rows: Vec<Vec<f64>> = lines.map(|line| line.split(',').map(|field| field.parse().unwrap()).collect()).collect();
    assert_eq!(rows.len(), 6);
    let contacts = [0.0, 2.0, 1.0, 2.0, 0.0, 0.0];
    for (point, row) in rows.iter().enumerate() {
        assert_eq!(row[..2], dataset.grid.configuration(point)[..]);
        assert_eq!(row[2..4], *dataset.torque(point));
        assert_eq!(row[4], dataset.energy.as_ref().unwrap()[point]);
        assert_eq!(row[5] as f32, dataset.slip.as_ref().unwrap().normal_force[point]);
        assert_eq!(row[6] as f32, dataset.gap.as_ref().unwrap()[point]);
        assert_eq!(row[7], f64::from(dataset.status[point]));
        assert_eq!(row[8] as f32, dataset.residual.as_ref().unwrap()[point]);
        assert_eq!(row[9], f64::from(dataset.iterations.as_ref().unwrap()[point]));
        assert_eq!(row[10], contacts[point]);
    }
    let text = std::fs::read_to_string(&other).unwrap();
    assert_eq!(text.lines().count(), 6);
    let forces = &dataset.contacts.as_ref().unwrap().forces;
    assert_eq!(text.lines().nth(3).unwrap(), format!("2,1,{:?},{:?},{:?}", forces[6], forces[7], forces[8]));

    std::fs::remove_file(&other).unwrap();
    assert_eq!(bare().export(&path, Format::Csv).unwrap(), [path]);
    assert!(!other.exists());
}
