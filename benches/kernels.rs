//! How fast the first adapter solves contact, in contacts a second beside the CPU's, and how long a frame of an object
//! takes there. Then how fast the device is once it is busy, and whole sweeps on that adapter beside the CPU backend.
//!
//!     cargo bench --bench kernels
//!
//! Operations of a contact are counted from its touches, for the kernel and the CPU alike; bytes are those of the
//! compliance, read once.

use glam::DVec3;
use haptize::{
    JointVector,
    contact::{Equilibrium, Model},
    gpu::{AdapterChoice, Context, FrameUpdate, GpuSolver},
    object::Object,
    proxy::Chain,
    scene::{ContactLaw, Scene, Shape},
    sweep::{Backend, BackendChoice, Bake, CpuBackend, build_object, model_within, sample},
};
use std::{
    error::Error,
    path::Path,
    sync::{Arc, atomic::AtomicBool},
    time::Instant,
};

/// The shipped sphere of 2,562 nodes, smooth, and one of 102, flat.
const SCENES: [&str; 2] = ["datasets/sphere.toml", "tests/scenes/sphere.toml"];

/// Frames that a figure of the frame update is taken from.
const FRAMES: usize = 20;

/// Rings and segments of the spheres whose frames are timed: 102, 963 and 2,918 nodes.
const RINGS: [usize; 3] = [10, 31, 54];

/// How much finer than the scene's the grid is on which the kernels of a GPU are timed: 59,427 points.
const SWEPT: usize = 2;

/// How much finer than the scene's the grids are that a GPU is compared on: up to 882,816 points.
const FINER: [usize; 4] = [1, 2, 3, 5];

/// Operations in f32 (1/s) and bytes from the second-level cache (B/s) of an H200, by its data sheet and as measured.
const H200: [f64; 2] = [67e12, 5.5e12];

/// Part of its operations that a kernel of short loops and many barriers reaches (1).
const REACHED: f64 = 0.1;

/// Every so many-th configuration is solved on a software rasteriser.
const SOFTWARE_STRIDE: usize = 16;

/// Sweeps of the same configurations on one adapter: with the first ones it finds how many it takes at a time, and a
/// GPU raises its clock.
const BUSY_TURNS: usize = 16;

fn main() -> Result<(), Box<dyn Error>> {
    let scene = load(SCENES[1])?;
    let context = Arc::new(Context::open(AdapterChoice::Any)?);
    println!("{}", context.adapter());
    let hardware = context.adapter().hardware;
    if !hardware {
        println!("a software rasteriser: small cases only, and its figures say nothing of a GPU");
    }
    SCENES.iter().try_for_each(|name| sweep(&context, name))?;
    RINGS.iter().try_for_each(|&rings| frames(&context, &scene, rings))?;
    if hardware {
        SCENES.iter().try_for_each(|name| busy(&context, name))?;
    }
    SCENES.iter().try_for_each(|name| compare(name, if hardware { &FINER } else { &FINER[..1] }))
}

/// The scene of a file, with contact at rest.
fn load(name: &str) -> Result<Scene, Box<dyn Error>> {
    let mut scene = Scene::load(Path::new(env!("CARGO_MANIFEST_DIR")).join(name))?;
    scene.contact.law = ContactLaw::Rest;
    Ok(scene)
}

/// One sweep over the scene's grid, after one that is not counted, with tangents as in a bake; and the same on the CPU.
fn sweep(context: &Arc<Context>, name: &str) -> Result<(), Box<dyn Error>> {
    let hardware = context.adapter().hardware;
    let scene = refined(&load(name)?, if hardware { SWEPT } else { 1 });
    let (object, chain) = (build_object(&scene)?, Chain::new(&scene.proxy));
    let mut model = model_within(&scene, &object, &chain)?;
    let all = sample(&scene, &model);
    model.with_tangent = true;
    let stride = if hardware { 1 } else { SOFTWARE_STRIDE };
    let configurations: Vec<JointVector> = all.into_iter().step_by(stride).collect();
    let mut solver = GpuSolver::new(Arc::clone(context), &model)?;
    solver.solve(&configurations)?;
    let left = solver.left_to_cpu();
    let begin = Instant::now();
    let equilibria = solver.solve(&configurations)?;
    let seconds = begin.elapsed().as_secs_f64();
    let mut cpu = CpuBackend::new(&model, 0)?;
    let begin = Instant::now();
    cpu.solve(&configurations)?;
    let on_cpu = begin.elapsed().as_secs_f64();
    let touching = equilibria.iter().filter(|equilibrium| equilibrium.gap < 0.0).count() as f64;
    println!(
        "\n{name}: {} configurations, {touching} of them in contact, {} left to the CPU, {} nodes",
        configurations.len(),
        solver.left_to_cpu() - left,
        object.rest.len()
    );
    let [operations, bytes] = work(&model, &equilibria).map(|sum| sum / touching);
    println!(
        "  a contact takes {:.0} thousand operations and {:.0} kB of the compliance",
        1e-3 * operations,
        1e-3 * bytes
    );
    for (what, seconds) in [("adapter", seconds), ("CPU", on_cpu)] {
        let rate = touching / seconds;
        println!("  {what:<18} {rate:>12.0} contacts/s {:>10.2} GFLOP/s", 1e-9 * rate * operations);
    }
    let bounds = [REACHED * H200[0] / operations, H200[1] / bytes].map(|rate| 1e-6 * rate);
    println!(
        "  an H200 is bound to {:.1} million contacts a second by a tenth of its arithmetic, to {:.1} by its cache",
        bounds[0], bounds[1]
    );
    Ok(())
}

/// Operations (1) and bytes of the compliance (B) that the contacts take: for each pair of a row's nodes with another
/// row's one entry of S, then the displacement by all forces and by the load of each joint; and factors of S.
fn work(model: &Model<'_>, equilibria: &[Equilibrium]) -> [f64; 2] {
    let numbers: f64 = if model.compliance.rows_per_node == 1 { 1.0 } else { 9.0 };
    let mut sums = [0.0; 2];
    for equilibrium in equilibria {
        let rows = equilibrium.touches.len() as f64;
        let nodes: f64 = equilibrium.touches.iter().map(|touch| touch.carriers.len() as f64).sum();
        let (pairs, loads) = (nodes * nodes, 1.0 + equilibrium.torque.len() as f64);
        let factors = f64::from(equilibrium.iterations) * rows.powi(3) / 3.0;
        sums[0] += pairs * (0.5 * 2.0 * numbers + loads * 6.0 * numbers.sqrt()) + factors;
        sums[1] += pairs * (0.5 + loads) * 4.0 * numbers;
    }
    sums
}

/// Configurations a second of the adapter, solved again and again in memory: the last four times.
fn busy(context: &Arc<Context>, name: &str) -> Result<(), Box<dyn Error>> {
    let scene = refined(&load(name)?, SWEPT);
    let (object, chain) = (build_object(&scene)?, Chain::new(&scene.proxy));
    let model = model_within(&scene, &object, &chain)?;
    let configurations = sample(&scene, &model);
    let mut solver = GpuSolver::new(Arc::clone(context), &model)?;
    let mut rates = Vec::with_capacity(BUSY_TURNS);
    for _ in 0..BUSY_TURNS {
        let begin = Instant::now();
        solver.solve(&configurations)?;
        rates.push(format!("{:.0}", configurations.len() as f64 / begin.elapsed().as_secs_f64()));
    }
    let (count, left) = (configurations.len(), solver.left_to_cpu());
    println!("\nbusy, {name}: {count} configurations, {left} left to the CPU");
    println!("  {} a second", rates[BUSY_TURNS - 4..].join(", "));
    Ok(())
}

/// `scene` on a grid so many times as fine.
fn refined(scene: &Scene, finer: usize) -> Scene {
    let mut scene = scene.clone();
    for axis in &mut scene.grid.axes {
        (axis.step, axis.count) = (axis.step / finer as f64, (axis.count - 1) * finer + 1);
    }
    scene
}

/// Frames of the object as a sphere of `rings` rings and segments.
fn frames(context: &Arc<Context>, scene: &Scene, rings: usize) -> Result<(), Box<dyn Error>> {
    let mut spec = scene.object.clone();
    if let Shape::Sphere { rings: r, segments: s, .. } = &mut spec.shape {
        (*r, *s) = (rings, rings);
    }
    let object = Object::build(&spec)?;
    let nodes = object.rest.len();
    let forces: Vec<DVec3> = (0..nodes).map(|k| DVec3::new(1e-4, 0.0, -1e-3 * (k % 7) as f64)).collect();
    let mut update = FrameUpdate::new(Arc::clone(context), &object, 1.0 / 60.0)?;
    update.step(&forces)?;
    update.read()?;
    let begin = Instant::now();
    for _ in 0..FRAMES {
        update.step(&forces)?;
    }
    update.read()?;
    let frame = begin.elapsed().as_secs_f64() / FRAMES as f64;
    // A block of three by three times a vector, for each of a row and for each pair of nodes; the rest is some operations
    // a node.
    let products = object.mechanics()?.stiffness.blocks.len() + nodes * nodes;
    println!(
        "\nframe update, {nodes} nodes: {:.3} ms a frame, {:.2} GB/s, {:.2} GFLOP/s",
        1e3 * frame,
        1e-9 * update.bytes() as f64 / frame,
        1e-9 * 18.0 * products as f64 / frame
    );
    Ok(())
}

/// Whole sweeps as `haptize bake` does them, of grids so many times as fine as the scene's, on the adapter and on the
/// CPU.
fn compare(name: &str, finer: &[usize]) -> Result<(), Box<dyn Error>> {
    let scene = load(name)?;
    println!(
        "\nwhole sweeps, {name} [configurations/s]\n  {:>11} {:>12} {:>12} {:>9}",
        "grid points", "adapter", "CPU", "ratio"
    );
    for &finer in finer {
        let scene = refined(&scene, finer);
        let rate = |backend| -> Result<(usize, f64), Box<dyn Error>> {
            let stop = AtomicBool::new(false);
            let bake = Bake {
                scene: &scene,
                backend,
                measured: Some(0),
                aim: None,
                date: "",
                stop: &stop,
                progress: &mut |_| (),
            };
            let (_, report) = bake.in_memory()?;
            for warning in &report.warnings {
                println!("  {warning}");
            }
            Ok((report.points, report.configurations_per_second))
        };
        let ((points, adapter), (_, cpu)) = (rate(BackendChoice::Gpu)?, rate(BackendChoice::Cpu)?);
        println!("  {points:>11} {adapter:>12.0} {cpu:>12.0} {:>9.3}", adapter / cpu);
    }
    Ok(())
}
