//! The file: what comes back, and what is refused.

use super::fixture::{noise, space, step, store};
use haptize::{
    ErrorKind, MAX_AXES,
    contact::Status,
    dataset::{Axis, Dataset, Grid, Provenance},
    store::Store,
};
use std::{fs, path::Path, sync::Arc};

fn file(joints: usize) -> Dataset {
    let count = space(joints, 1).last(0)[0] as usize + 1;
    let axis = |a: usize| Axis { name: format!("joint {a}"), unit: "rad".into(), start: -0.2, step: step(a), count };
    Dataset::refined(
        Arc::new(store(joints, 2, 0.6, 4, noise(joints, 2))),
        Grid { axes: (0..joints).map(axis).collect() },
        None,
        "name = \"made\"".into(),
        Provenance { version: "1".into(), ..Provenance::default() },
    )
}

fn refinement(dataset: &Dataset) -> &Store {
    dataset.refinement.as_ref().unwrap()
}

#[test]
fn a_store_comes_back_to_the_bit() {
    let folder = tempfile::tempdir().unwrap();
    for joints in [1, 3, MAX_AXES] {
        let path = folder.path().join(format!("{joints}.store"));
        let written = file(joints);
        written.save(path.as_path()).unwrap();
        let read = Dataset::load(&path).unwrap();
        assert_eq!((&read.grid, &read.scene, &read.provenance), (&written.grid, &written.scene, &written.provenance));
        let blocks = |file: &Dataset| -> Vec<_> {
            refinement(file).blocks().into_iter().map(|(key, block)| (key, block.nodes().clone())).collect()
        };
        assert_eq!(blocks(&read), blocks(&written));
        for k in 0..50 {
            let q: Vec<f64> = (0..joints).map(|a| 0.1 + 0.2 * (f64::from(k) + a as f64).sin()).collect();
            assert_eq!(refinement(&read).sample(&q), refinement(&written).sample(&q));
            assert_eq!(refinement(&read).slip(&q), refinement(&written).slip(&q));
        }
        // And to the bit on disk.
        let again = folder.path().join("again.store");
        read.save(again.as_path()).unwrap();
        assert_eq!(fs::read(&path).unwrap(), fs::read(&again).unwrap());
    }
}

#[test]
fn a_file_that_is_cut_short_altered_or_of_another_kind_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("whole.store");
    file(2).save(path.as_path()).unwrap();
    let whole = fs::read(&path).unwrap();
    let bad = folder.path().join("bad.store");
    let refused = |bytes: &[u8]| {
        fs::write(&bad, bytes).unwrap();
        Dataset::open(&bad).map(|_| ()).unwrap_err()
    };
    for length in [0, 7, 100, whole.len() / 2, whole.len() - 1] {
        refused(&whole[..length]);
    }
    for at in (0..whole.len()).step_by(whole.len() / 97) {
        let mut altered = whole.clone();
        altered[at] ^= 4;
        refused(&altered);
    }
    assert_eq!(Dataset::open(Path::new("/nowhere")).map(|_| ()).unwrap_err().kind(), ErrorKind::File);
}

#[test]
fn a_file_for_an_interpolation_that_is_no_more_says_to_bake_again() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("linear.store");
    file(2).save(path.as_path()).unwrap();
    let mut bytes = fs::read(&path).unwrap();
    let (potential, linear) = (br#"\"order\":\"potential\""#, br#"\"order\":\"linear\"   "#);
    let at = bytes.windows(potential.len()).position(|part| part == potential).unwrap();
    bytes[at..at + potential.len()].copy_from_slice(linear);
    let at = 8 + r#"{"__metadata__":{"checksum":""#.len();
    bytes[at..at + 8].fill(b'0');
    let checksum = format!("{:08x}", crc32fast::hash(&bytes));
    bytes[at..at + 8].copy_from_slice(checksum.as_bytes());
    fs::write(&path, bytes).unwrap();
    let refused = Dataset::open(&path).map(|_| ()).unwrap_err().to_string();
    assert!(refused.contains("\"linear\"") && refused.contains("bake it again"), "{refused}");
}

#[test]
fn the_points_of_the_grid_have_what_the_nodes_of_the_base_say() {
    let dataset = file(2);
    let mut there = 0;
    for point in 0..dataset.grid.points() {
        let root = refinement(&dataset).sample(&dataset.grid.configuration(point));
        if dataset.status(point) == Status::Outside {
            continue;
        }
        there += 1;
        assert!((dataset.energy.as_ref().unwrap()[point] - root.energy()).abs() < 1e-5);
        for (stored, felt) in dataset.torque(point).iter().zip(root.torque().iter()) {
            assert!((stored - felt).abs() < 1e-4, "{stored} {felt}");
        }
    }
    assert_eq!(there, dataset.grid.points());
}
