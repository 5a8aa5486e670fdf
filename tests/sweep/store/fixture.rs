//! Stores with random nodes at random places.

use haptize::{
    MAX_AXES,
    contact::Status,
    dataset::{Axis, Grid},
    fixtures::Random,
    store::{Nodes, Place, Space, Store, record::width},
};

/// True with probability `share`.
pub fn is(random: &mut Random, share: f64) -> bool {
    random.between(0.0, 1.0) < share
}

/// Spacing of the base along `axis` (rad): none is a power of two.
pub fn step(axis: usize) -> f64 {
    0.1 + 0.03 * axis as f64
}

/// Three cells of the base along each axis, two with five joints or more.
pub fn space(joints: usize, levels: u32) -> Space {
    let count = if joints < 5 { 4 } else { 3 };
    let axis = |a: usize| Axis { name: format!("joint {a}"), unit: "rad".into(), start: -0.2, step: step(a), count };
    Space::new(&Grid { axes: (0..joints).map(axis).collect() }, levels).unwrap()
}

/// All blocks of `level`.
pub fn blocks(space: &Space, level: u32) -> Vec<Place> {
    let joints = space.joints();
    let mut places = vec![[0; MAX_AXES]];
    for a in 0..joints {
        let along = 0..=space.block_of(&space.last(level))[a];
        places = places
            .iter()
            .flat_map(|place| along.clone().map(|k| (*place, k)))
            .map(|(mut place, k)| {
                place[a] = k;
                place
            })
            .collect();
    }
    places
}

/// How contacts slip at `q`: affine, the normal force positive.
pub fn slip(q: &[f64]) -> Vec<f64> {
    let numbers = width(q.len()) as u32;
    (0..numbers)
        .map(|k| 2.0 - 0.1 * f64::from(k) + q.iter().zip(1..).map(|(q, a)| q / f64::from(a)).sum::<f64>())
        .collect()
}

/// The nodes of a block, each there with probability `share`, with the numbers that `record` gives for its
/// configuration.
pub fn nodes(
    space: &Space,
    level: u32,
    block: &Place,
    mut is_there: impl FnMut(&Place) -> bool,
    mut record: impl FnMut(&[f64]) -> Vec<f64>,
) -> Nodes {
    let mut nodes = Nodes::default();
    for (place, node) in space.nodes(level, block) {
        if is_there(&node) {
            let numbers: Vec<f32> = record(&space.configuration(level, &node)).iter().map(|&x| x as f32).collect();
            assert_eq!(numbers.len(), width(space.joints()));
            let slip: Vec<f32> = slip(&space.configuration(level, &node)).iter().map(|&x| x as f32).collect();
            nodes.push(place, &numbers, &slip, 0.25, Status::Contact);
        }
    }
    nodes
}

/// A store in which blocks are there with probability `share`, as far as their foundations allow, and nodes in them,
/// too.
pub fn store(joints: usize, levels: u32, share: f64, seed: u64, mut record: impl FnMut(&[f64]) -> Vec<f64>) -> Store {
    let mut random = Random::new(seed);
    let space = space(joints, levels);
    let mut store = Store::new(space.clone());
    for level in 0..levels {
        for block in blocks(&space, level) {
            let rests = store.foundation(level, &block).all(|(below, place)| store.get(below, &place).is_some());
            if rests && (level == 0 || is(&mut random, share)) {
                let is_there = |_: &Place| level == 0 || is(&mut random, 0.8);
                let nodes = nodes(&space, level, &block, is_there, &mut record);
                store.publish(level, &block, nodes).unwrap();
            }
        }
    }
    store
}

/// Random numbers for a node.
pub fn noise(joints: usize, seed: u64) -> impl FnMut(&[f64]) -> Vec<f64> {
    let mut random = Random::new(seed);
    move |_| (0..width(joints)).map(|_| random.between(-1.0, 1.0)).collect()
}
