//! Files of a sparse store.

use super::{Target, container, write};
use haptize::{
    MAX_AXES,
    contact::Status,
    dataset::{Axis, Dataset, Grid, Provenance},
    store::{Nodes, Space, Store, record::width},
};
use std::sync::Arc;

pub const STORES: Target = Target {
    name: "stores",
    extension: "store",
    seeds: || [1, 2, 3].map(made).to_vec(),
    mutate: container,
    run: |file, input| {
        write(file, input);
        let read = match Dataset::open(file) {
            Ok(read) => read,
            Err(error) => return error.to_string(),
        };
        let Some(store) = &read.refinement else { return "a dataset".into() };
        let joints = read.grid.axes.len();
        for q in [-1e9, -0.2, -0.13, 0.05, 1e9] {
            let root = store.sample(&[q; MAX_AXES][..joints]);
            let torque = root.torque();
            assert_eq!(torque.len(), joints);
        }
        // What was taken in is a store: it is written, and read again, as it is. Whoever made it may have begun its header
        // otherwise than we do, and such a file is not replaced.
        std::fs::remove_file(file).unwrap();
        read.save(file).unwrap();
        let again = Dataset::open(file).unwrap();
        let keys = |store: &Store| store.blocks().into_iter().map(|(key, _)| key).collect::<Vec<_>>();
        assert_eq!(keys(again.refinement.as_ref().unwrap()), keys(store));
        "fine".into()
    },
    kinds: 40,
};

/// A store of two levels over `joints` joints: the base, and above it what rests on it, a node in three left out.
fn made(joints: usize) -> Vec<u8> {
    let axis = |a| Axis { name: format!("joint {a}"), unit: "rad".into(), start: -0.2, step: 0.1, count: 3 };
    let grid = Grid { axes: (0..joints).map(axis).collect() };
    let mut store = Store::new(Space::new(&grid, 2).unwrap());
    let mut serial = 0;
    for level in 0..2 {
        let last = store.space().last(level);
        let along = last[0] / 2 + 1;
        for number in 0..along.pow(joints as u32) {
            let mut block = [0; MAX_AXES];
            (0..joints).for_each(|a| block[a] = number / along.pow(a as u32) % along);
            let mut nodes = Nodes::default();
            for (place, _) in store.space().nodes(level, &block) {
                serial += 1;
                if level == 0 || serial % 3 > 0 {
                    let numbers: Vec<f32> = (0..width(joints)).map(|k| ((serial + k) as f32).sin()).collect();
                    nodes.push(place, &numbers, &[], 0.25, Status::Contact);
                }
            }
            store.publish(level, &block, nodes).unwrap();
        }
    }
    let file = tempfile::NamedTempFile::new().unwrap();
    let provenance = Provenance { version: "1".into(), ..Provenance::default() };
    let dataset = Dataset::refined(Arc::new(store), grid, None, "name = \"made\"".into(), provenance);
    dataset.save(file.path()).unwrap();
    std::fs::read(file.path()).unwrap()
}
