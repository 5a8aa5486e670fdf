//! The sparse store beside uniform grids: time of a look-up, and points and bytes for an error.
//!
//!     cargo bench --bench store -- [SCENE [AIM]]
//!
//! `SCENE`: by default datasets/sphere.toml; `AIM`: rms error over the rms torque, by default 0.01.

#![allow(clippy::unwrap_used)] // A benchmark may stop.

#[path = "../tests/synthetic/mod.rs"]
mod synthetic;

use haptize as engine;
use haptize::{
    JointVector, MAX_JOINTS,
    contact::{Model, Status},
    dataset::{Axis, Grid},
    field::TorqueField,
    proxy::Chain,
    scene::{Interpolation, JointKind, Scene},
    store::{
        Nodes, Order, Place, Space, Store,
        record::{slope, width},
    },
    sweep::{
        BackendChoice, Bake, build_object,
        refine::{Judge, Refine},
        sample,
    },
};
use std::{hint::black_box, path::Path, sync::atomic::AtomicBool, time::Instant};

/// Blocks of look-ups that are timed.
const BLOCKS: u32 = 2000;

/// Look-ups in a block.
const LOOK_UPS: u32 = 50;

/// Median over blocks of the mean time of `work` [ns].
fn nanoseconds(mut work: impl FnMut(f64)) -> f64 {
    let mut blocks: Vec<f64> = (0..BLOCKS)
        .map(|block| {
            let start = Instant::now();
            (0..LOOK_UPS).for_each(|k| work(f64::from(LOOK_UPS * block + k)));
            start.elapsed().as_nanos() as f64 / f64::from(LOOK_UPS)
        })
        .collect();
    blocks.sort_by(f64::total_cmp);
    blocks[blocks.len() / 2]
}

/// All places of blocks of `level`.
fn places(space: &Space, level: u32) -> Vec<Place> {
    let mut places = vec![[0; MAX_JOINTS]];
    for a in 0..space.joints() {
        let last = space.block_of(&space.last(level))[a];
        places = places
            .iter()
            .flat_map(|place| {
                (0..=last).map(move |k| {
                    let mut place = *place;
                    place[a] = k;
                    place
                })
            })
            .collect();
    }
    places
}

/// A store of a half space with all blocks of all levels.
fn dense(joints: usize, count: usize, levels: u32, order: Order) -> Store {
    let grid = synthetic::grid(&vec![(-0.6, 1.2 / (count - 1) as f64, count); joints]);
    let space = Space::new(&grid, levels).unwrap();
    let blocks: Vec<Vec<Place>> = (0..levels).map(|level| places(&space, level)).collect();
    let store = Store::new(space.clone(), order, blocks.iter().map(Vec::len).sum());
    let normal = 1.0 / (joints as f64).sqrt();
    for (level, blocks) in (0..).zip(&blocks) {
        for block in blocks {
            let mut nodes = Nodes::default();
            for (place, node) in space.nodes(level, block) {
                let q = space.configuration(level, &node);
                let mut record = vec![0.0_f32; width(joints)];
                record[0] = (q.iter().sum::<f64>() * normal) as f32;
                (0..joints).for_each(|a| record[slope(a)] = normal as f32);
                nodes.push(place, &record, 0.0, Status::Contact);
            }
            store.publish(level, block, nodes).unwrap();
        }
    }
    store
}

fn look_ups() {
    println!("joints  order      nodes/axis  levels  look-up [ns]  dense grid of as many points [ns]");
    for (joints, count, levels) in
        [(3, 29, 1), (3, 8, 3), (3, 4, 4), (4, 5, 2), (5, 4, 2), (6, 7, 1), (6, 4, 2), (6, 2, 3)]
    {
        let place = |k: f64| {
            let mut q = JointVector::zeros(joints);
            q.iter_mut().enumerate().for_each(|(a, q)| *q = 0.1 + 0.4 * (1e-3 * k + a as f64).sin());
            q
        };
        let placing = nanoseconds(|k| {
            black_box(place(k));
        });
        for (order, interpolation) in
            [(Order::Linear, Interpolation::Linear), (Order::Potential, Interpolation::Potential)]
        {
            let store = dense(joints, count, levels, order);
            let stored = nanoseconds(|k| {
                black_box(store.sample(&place(k)));
            });
            let points = ((count - 1) << (levels - 1)) + 1;
            let grid = synthetic::grid(&vec![(-0.6, 1.2 / (points - 1) as f64, points); joints]);
            let slope = JointVector::from_slice(&vec![10.0; joints]);
            let field =
                TorqueField::interpolated(&synthetic::half_space(grid, 5.0), interpolation, 0.5, &slope).unwrap();
            let grid = nanoseconds(|k| {
                black_box(field.sample(&place(k)));
            });
            let (stored, grid) = (stored - placing, grid - placing);
            println!("{joints:6}  {order:9?}  {points:10}  {levels:6}  {stored:12.0}  {grid:12.0}");
        }
    }
}

/// The grid of `scene`'s range with as many cells as fit spacings of `spacing` times the scene's.
fn grid(scene: &Scene, spacing: f64) -> Grid {
    let axes = scene.proxy.joints.iter().zip(&scene.grid.axes).map(|(joint, axis)| {
        let range = axis.step * (axis.count - 1) as f64;
        let cells = (range / (spacing * axis.step)).round().max(1.0);
        let unit = if joint.kind == JointKind::Revolute { "rad" } else { "m" };
        Axis {
            name: joint.name.clone(),
            unit: unit.into(),
            start: axis.start,
            step: range / cells,
            count: cells as usize + 1,
        }
    });
    Grid { axes: axes.collect() }
}

/// Bakes `scene` over a grid of spacing `spacing` times its own, and prints what its interpolation errs by.
fn dense_grid(scene: &Scene, spacing: f64, interpolation: Interpolation, unseen: &Judge) {
    let begin = Instant::now();
    let mut scene = scene.clone();
    let base = grid(&scene, spacing);
    for (axis, base) in scene.grid.axes.iter_mut().zip(&base.axes) {
        (axis.step, axis.count) = (base.step, base.count);
    }
    scene.haptics.interpolation = interpolation;
    let bake = Bake {
        scene: &scene,
        backend: BackendChoice::Cpu,
        measured: Some(0),
        aim: None,
        date: "",
        stop: &AtomicBool::new(false),
        progress: &mut |_| (),
    };
    let (data, report) = bake.in_memory().unwrap();
    let haptics = &scene.haptics;
    let field = TorqueField::interpolated(&data, interpolation, haptics.threshold, &haptics.boundary_slope).unwrap();
    let error = unseen.relative_error(|q| field.sample(q).torque);
    // Columns that the loop needs: torque, energy, tangent, gap, status.
    let joints = base.joints();
    let tangent = if data.tangent.is_some() { 2 * joints * (joints + 1) } else { 0 };
    let bytes = report.points * (8 * joints + 8 + tangent + 4 + 1);
    println!(
        "dense {interpolation:?}  {spacing:5}  1  {}  {bytes}  {} in contact  {:.2} %  {:.1}",
        report.points,
        report.contact_points,
        100.0 * error,
        begin.elapsed().as_secs_f64()
    );
}

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).filter(|argument| !argument.starts_with("--")).collect();
    look_ups();
    let path = arguments.first().map_or("datasets/sphere.toml", String::as_str);
    let aim: f64 = arguments.get(1).map_or(0.01, |aim| aim.parse().unwrap());
    let scene = Scene::load(Path::new(path)).unwrap();
    let object = build_object(&scene).unwrap();
    let chain = Chain::new(&scene.proxy);
    let mut model = Model::reaching(&object, &chain, scene.contact, &sample(&scene)).unwrap();
    model.with_tangent = true;
    let [seen, unseen] = [11, 12].map(|seed| Judge::new(&scene, &model, seed, 1000).unwrap());
    println!("\norder      base   levels  nodes  by level  bytes  solved  equilibria  seen  unseen  rounds  seconds");
    for spacing in [4.0, 2.0, 1.4, 1.0, 0.7] {
        dense_grid(&scene, spacing, Interpolation::Potential, &unseen);
    }
    for spacing in [1.0, 0.5, 0.4] {
        dense_grid(&scene, spacing, Interpolation::Linear, &unseen);
    }
    let fill = |order, spacing: f64, levels, aim| {
        let begin = Instant::now();
        let refine = Refine { model: &model, base: grid(&scene, spacing), levels, order, aim, most: 50_000 };
        let refined = refine.fill(&seen).unwrap();
        let error = unseen.relative_error(|q| refined.store.sample(q).torque());
        // In the file: key and mask of a block, numbers, gap and status of a node.
        let bytes = 16 * refined.store.blocks().len() + refined.nodes * (4 * width(refine.base.joints()) + 5);
        println!(
            "{order:9?}  {spacing:5}  {levels}  {}  {:?}  {bytes}  {}  {}  {:.2} %  {:.2} %  {}  {:.1}",
            refined.nodes,
            refined.by_level,
            refined.solved,
            refined.equilibria,
            100.0 * refined.measured,
            100.0 * error,
            refined.rounds,
            begin.elapsed().as_secs_f64()
        );
    };
    for order in [Order::Potential, Order::Linear] {
        for spacing in [4.0, 2.0, 1.0, 0.7, 0.5] {
            // One level, no aim: the uniform grid.
            fill(order, spacing, 1, f64::INFINITY);
        }
        for (spacing, levels) in [(8.0, 4), (4.0, 3)] {
            fill(order, spacing, levels, aim);
        }
    }
}
