//! The sparse store beside uniform grids: time of a look-up and of a tick, and points and bytes for an error.
//!
//!     cargo bench --bench store -- [SCENE [AIM [FOLDER]]]
//!
//! `SCENE`: by default datasets/sphere.toml; `AIM`: rms error over the rms torque, by default 0.01; `FOLDER`, by
//! default out/store, gets the figure of errors against nodes and bytes.

#![allow(clippy::unwrap_used)] // A benchmark may stop.

mod clock;
#[path = "../tests/common/desktop.rs"]
mod desktop;

use clock::nanoseconds;
use haptize::{
    JointVector, MAX_AXES,
    contact::Status,
    dataset::{Axis, Dataset, Grid, Provenance},
    draw::{diagram::Diagram, plot::Curve},
    field::TorqueField,
    fixtures::grids,
    proxy::Chain,
    render::haptic::{Haptics, Inputs},
    report::write_both,
    scene::{Interpolation, JointKind, Scene},
    store::{
        Nodes, Place, Space, Store,
        record::{slope, width},
    },
    sweep::{BackendChoice, Bake, CpuBackend, Reference, build_object, model_within, refine::Refine},
};
use std::{
    hint::black_box,
    path::Path,
    sync::{Arc, atomic::AtomicBool},
    time::Instant,
};

/// Blocks of look-ups that are timed.
const BLOCKS: u32 = 2000;

/// Look-ups in a block.
const LOOK_UPS: u32 = 50;

/// All places of blocks of `level`.
fn places(space: &Space, level: u32) -> Vec<Place> {
    let mut places = vec![[0; MAX_AXES]];
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
fn dense(grid: &Grid, levels: u32) -> Store {
    let joints = grid.joints();
    let space = Space::new(grid, levels).unwrap();
    let blocks: Vec<Vec<Place>> = (0..levels).map(|level| places(&space, level)).collect();
    let mut store = Store::new(space.clone());
    let normal = 1.0 / (joints as f64).sqrt();
    for (level, blocks) in (0..).zip(&blocks) {
        for block in blocks {
            let mut nodes = Nodes::default();
            for (place, node) in space.nodes(level, block) {
                let q = space.configuration(level, &node);
                let mut record = vec![0.0_f32; width(joints)];
                record[0] = (q.iter().sum::<f64>() * normal) as f32;
                (0..joints).for_each(|a| record[slope(a)] = normal as f32);
                nodes.push(place, &record, &[], 0.0, Status::Contact);
            }
            store.publish(level, block, nodes).unwrap();
        }
    }
    store
}

fn look_ups() {
    println!("joints  nodes/axis  levels  look-up [ns]  whole tick [ns]  dense grid of as many points [ns]");
    for (joints, count, levels) in
        [(3, 29, 1), (3, 8, 3), (3, 4, 4), (4, 5, 2), (5, 4, 2), (6, 7, 1), (6, 4, 2), (6, 2, 3)]
    {
        let place = |k: f64| {
            let mut q = JointVector::zeros(joints);
            q.iter_mut().enumerate().for_each(|(a, q)| *q = 0.1 + 0.4 * (1e-3 * k + a as f64).sin());
            q
        };
        let placing = nanoseconds(BLOCKS, LOOK_UPS, |k| {
            black_box(place(k));
        });
        let base = grids::grid(&vec![(-0.6, 1.2 / (count - 1) as f64, count); joints]);
        let store = Arc::new(dense(&base, levels));
        let stored = nanoseconds(BLOCKS, LOOK_UPS, |k| {
            black_box(store.sample(&place(k)));
        });
        let slope = JointVector::from_slice(&vec![10.0; joints]);
        let refined = Dataset::refined(Arc::clone(&store), base, None, String::new(), Provenance::default());
        let field = TorqueField::interpolated(&refined, Interpolation::Potential, 0.5, &slope).unwrap();
        let haptics = Haptics::new(field, desktop::proxy(joints), &desktop::haptics(joints)).unwrap();
        let mut state = haptics.start(&place(0.0)).unwrap();
        let tick = nanoseconds(BLOCKS, LOOK_UPS, |k| {
            let inputs = Inputs { position: place(k), age: 0.0, elapsed: 1e-3, interval: 1e-3 };
            black_box(haptics.tick(&mut state, &inputs));
        });
        let points = ((count - 1) << (levels - 1)) + 1;
        let grid = grids::grid(&vec![(-0.6, 1.2 / (points - 1) as f64, points); joints]);
        let field =
            TorqueField::interpolated(&grids::half_space(grid, 5.0), Interpolation::Potential, 0.5, &slope).unwrap();
        let grid = nanoseconds(BLOCKS, LOOK_UPS, |k| {
            black_box(field.sample(&place(k)));
        });
        let [stored, tick, grid] = [stored, tick, grid].map(|time| time - placing);
        println!("{joints:6}  {points:10}  {levels:6}  {stored:12.0}  {tick:15.0}  {grid:12.0}");
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

/// Nodes solved, bytes and error.
type Spent = (f64, f64, f64);

/// Bakes `scene` over a grid of spacing `spacing` times its own, and prints what its interpolation errs by.
fn dense_grid(scene: &Scene, spacing: f64, interpolation: Interpolation, unseen: &Reference) -> Spent {
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
    (report.points as f64, bytes as f64, error)
}

/// Draws error against nodes and bytes.
fn draw(folder: &str, rows: &[(&str, Vec<Spent>)]) {
    let curves = |across: fn(&Spent) -> f64| -> Vec<Curve> {
        let curve = |(number, (name, spent)): (usize, &(&str, Vec<Spent>))| {
            Curve::new(*name, number, spent.iter().map(|spent| (across(spent), spent.2)))
        };
        rows.iter().enumerate().map(curve).collect()
    };
    let mut sheet = Diagram::new("Error against what is solved and stored", "three joints", 1);
    let nodes = curves(|spent| spent.0);
    sheet.panel(0, "Nodes solved [1]", "Rms error over rms torque [1]", &nodes, &[]);
    sheet.panel(
        1,
        "Size of what the loop reads [bytes]",
        "Rms error over rms torque [1]",
        &curves(|spent| spent.1),
        &[],
    );
    sheet.legend(&nodes, Vec::new());
    for file in write_both(Path::new(folder), "store-error", &sheet.canvas()).unwrap() {
        println!("{}", file.display());
    }
}

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).filter(|argument| !argument.starts_with("--")).collect();
    look_ups();
    let path = arguments.first().map_or("datasets/sphere.toml", String::as_str);
    let aim: f64 = arguments.get(1).map_or(0.01, |aim| aim.parse().unwrap());
    let scene = Scene::load(Path::new(path)).unwrap();
    let object = build_object(&scene).unwrap();
    let chain = Chain::new(&scene.proxy);
    let mut model = model_within(&scene, &object, &chain).unwrap();
    model.with_tangent = true;
    let mut judges = [11, 12].map(|seed| Reference::in_contact(&scene, &model, seed, 1000).unwrap());
    let mut backend = CpuBackend::new(&model, 0).unwrap();
    let batch = backend.chunk();
    println!("\nbase   levels  nodes  by level  bytes  solved  equilibria  seen  unseen  rounds  seconds");
    let dense = |interpolation, spacings: &[f64]| -> Vec<Spent> {
        spacings.iter().map(|spacing| dense_grid(&scene, *spacing, interpolation, &judges[1])).collect()
    };
    let mut rows = vec![
        ("dense linear", dense(Interpolation::Linear, &[4.0, 2.0, 1.0, 0.5, 0.4])),
        ("dense potential", dense(Interpolation::Potential, &[4.0, 2.0, 1.4, 1.0, 0.7])),
    ];
    let mut fill = |spacing: f64, levels, aim| {
        let begin = Instant::now();
        let refine = Refine { model: &model, base: grid(&scene, spacing), levels, aim, most: 50_000, batch };
        let refined = refine.fill(&mut judges, &mut backend).unwrap();
        let error = judges[1].relative_error(|q| refined.store.sample(q).torque());
        // In the file: key and mask of a block, numbers, gap and status of a node.
        let bytes = 16 * refined.store.blocks().len() + refined.nodes * (4 * width(refine.base.joints()) + 5);
        println!(
            "{spacing:5}  {levels}  {}  {:?}  {bytes}  {}  {}  {:.2} %  {:.2} %  {}  {:.1}",
            refined.nodes,
            refined.by_level,
            refined.solved,
            refined.equilibria,
            100.0 * refined.measured,
            100.0 * error,
            refined.rounds,
            begin.elapsed().as_secs_f64()
        );
        (refined.nodes as f64, bytes as f64, error)
    };
    // One level, no aim: the uniform grid.
    let even = [4.0, 2.0, 1.0, 0.7, 0.5].map(|spacing| fill(spacing, 1, f64::INFINITY)).to_vec();
    let refined = [8.0, 4.0, 2.0, 1.0, 0.5].map(|times| fill(4.0, 5, times * aim)).to_vec();
    rows.extend([("potential, one level", even), ("potential, refined", refined)]);
    draw(arguments.get(2).map_or("out/store", String::as_str), &rows);
}
