//! How long each kernel takes on the first adapter, what it moves, and what bounds it: those of a sweep of the sphere
//! scene, by each algorithm, and those of the object's frame update. Then what the host does beside the device, with
//! the device itself and with a stand-in that takes no time; how fast the device is once it is busy; and whole sweeps
//! on that adapter beside the CPU backend.
//!
//!     cargo bench --bench kernels
//!
//! Kernels are timed by the device's own clock. Bytes are what a kernel reads and writes if nothing is read twice;
//! beside them stands the rate at which the same device copies memory. Operations are counted where they do not depend
//! on the data.

use glam::DVec3;
use haptize::{
    JointVector,
    contact::Model,
    gpu::{AdapterChoice, Context, FrameMethod, FrameUpdate, GpuSolver, KernelTime, SearchCounts, stages::Stages},
    object::Object,
    proxy::Chain,
    scene::{GraphicsEffects, Scene, Shape},
    sweep::{Backend, BackendChoice, Bake, build_object, sample},
};
use std::{
    collections::BTreeMap,
    error::Error,
    path::Path,
    sync::{Arc, atomic::AtomicBool},
    time::{Duration, Instant},
};

/// The shipped sphere of 2,562 nodes, smooth, and one of 102, flat.
const SCENES: [&str; 2] = ["datasets/sphere.toml", "tests/scenes/sphere.toml"];

/// Frames that a figure of the frame update is taken from.
const FRAMES: usize = 20;

/// Rings and segments of the spheres whose frames are timed: 102 and 963 nodes by the inverse, the others iteratively.
const RINGS: [usize; 4] = [10, 31, 100, 316];

/// How much finer than the scene's the grid is on which the kernels of a GPU are timed: 59,427 points.
const SWEPT: usize = 2;

/// How much finer than the scene's the grids are that a GPU is compared on: up to 882,816 points.
const FINER: [usize; 4] = [1, 2, 3, 5];

/// A kernel that moves memory at this share of the rate of copying, or more, is bound by memory.
const MEMORY_BOUND: f64 = 0.5;

/// A dispatch of fewer workgroups leaves most of a GPU idle.
const FEW_WORKGROUPS: f64 = 128.0;

/// Size of what is copied (B), and how often.
const COPIED: u64 = 64 << 20;
const COPIES: usize = 16;

/// Operations in f64 (1), and bytes from the cache (B), of what the search counts. A pair of nodes: a number of C times
/// three of a force, added up. A bent facet: 400 for its control points, if it is regular, and 1,600 for the point
/// closest to the proxy node, from a dozen nodes and their displacements. A step of an elimination: a product,
/// subtracted.
const PAIR: [f64; 2] = [6.0, 8.0];
const FACET: [f64; 2] = [2_000.0, 800.0];
const ELIMINATION: [f64; 2] = [2.0, 16.0];

/// Operations in f64 (1/s) and bytes from the second-level cache (B/s) of an H200, by its data sheet and as measured.
const H200: [f64; 2] = [34e12, 5.5e12];

/// Every so many-th configuration is solved where the host is timed beside a software rasteriser.
const HOST_STRIDE: usize = 16;

/// Sweeps that the host is timed for beside a device that takes no time: the least counts.
const HOST_TURNS: usize = 7;

/// Sweeps of the same configurations on one adapter: with the first ones it finds how many it takes at a time, and a
/// GPU raises its clock.
const BUSY_TURNS: usize = 16;

/// What is known of the adapter beforehand.
#[derive(Clone, Copy)]
struct Adapter {
    /// Bytes that it reads and writes a second when it copies (B/s).
    copying: f64,
    hardware: bool,
}

fn main() -> Result<(), Box<dyn Error>> {
    let scene = load(SCENES[1])?;
    let plain = Context::open(AdapterChoice::Any)?;
    println!("{}", plain.adapter());
    let hardware = plain.adapter().hardware;
    if !hardware {
        println!("a software rasteriser: small cases only, and its figures say nothing of a GPU");
    }
    match Context::open_timed(AdapterChoice::Any) {
        Ok(context) => kernels(&Arc::new(context), &scene)?,
        Err(error) => println!("\nkernels skipped: {error}"),
    }
    for name in SCENES {
        host(name, if hardware { 1 } else { HOST_STRIDE })?;
        if hardware {
            busy(name)?;
        }
    }
    SCENES.iter().try_for_each(|name| compare(name, if hardware { &FINER } else { &FINER[..1] }))
}

fn load(name: &str) -> Result<Scene, Box<dyn Error>> {
    Ok(Scene::load(Path::new(env!("CARGO_MANIFEST_DIR")).join(name))?)
}

fn kernels(context: &Arc<Context>, scene: &Scene) -> Result<(), Box<dyn Error>> {
    let (copying, hardware) = (copying(context)?, context.adapter().hardware);
    println!("copies {:.1} GB/s, as many bytes read as written", 1e-9 * copying);
    let adapter = Adapter { copying, hardware };
    let swept = refined(scene, if hardware { SWEPT } else { 1 });
    sweep(context, &swept, adapter)?;
    count(context, if hardware { 1 } else { HOST_STRIDE }, adapter)?;
    let rings = if hardware { &RINGS[..] } else { &RINGS[..3] };
    rings.iter().try_for_each(|&rings| frames(context, scene, rings, adapter))
}

/// Bytes that the device reads and writes a second when it copies (B/s).
fn copying(context: &Context) -> Result<f64, Box<dyn Error>> {
    let (_, _, device, queue) = context.shared();
    let size = COPIED.min(context.binding_limit());
    let buffer = || {
        let usage = wgpu::BufferUsages::COPY_SRC | wgpu::BufferUsages::COPY_DST;
        device.create_buffer(&wgpu::BufferDescriptor { label: None, size, usage, mapped_at_creation: false })
    };
    let (from, to) = (buffer(), buffer());
    let copy = |times| {
        let mut encoder = device.create_command_encoder(&Default::default());
        (0..times).for_each(|_| encoder.copy_buffer_to_buffer(&from, 0, &to, 0, size));
        context.wait(&queue.submit([encoder.finish()]))
    };
    copy(1)?;
    let begin = Instant::now();
    copy(COPIES)?;
    Ok(2.0 * size as f64 * COPIES as f64 / begin.elapsed().as_secs_f64())
}

/// One sweep over the scene's whole grid, after one that is not counted: it finds how much one dispatch should hold.
fn sweep(context: &Arc<Context>, scene: &Scene, adapter: Adapter) -> Result<(), Box<dyn Error>> {
    let (object, chain) = (Object::build(&scene.object)?, Chain::new(&scene.proxy));
    let model = Model::new(&object, &chain, scene.contact);
    let configurations = sample(scene);
    let mut solver = GpuSolver::new(Arc::clone(context), &model)?;
    solver.solve(&configurations)?;
    context.kernel_times()?;
    let begin = Instant::now();
    let equilibria = solver.solve(&configurations)?;
    let seconds = begin.elapsed().as_secs_f64();
    let touching = equilibria.iter().filter(|equilibrium| equilibrium.gap < 0.0).count();
    println!(
        "\nsweep: {} configurations, {touching} of them in contact, {} nodes",
        configurations.len(),
        object.rest.len()
    );
    let count = |kernel: &KernelTime| {
        let at_rest = ["kinematics", "detection", "gap"];
        let at_rest = at_rest.iter().any(|name| kernel.name.ends_with(name));
        if at_rest { configurations.len() } else { touching }
    };
    table(&context.kernel_times()?, "configuration", count, &BTreeMap::new(), seconds, adapter);
    Ok(())
}

/// The search in f64 for every `stride`-th configuration of the shipped sphere scene: what it takes, counted by the
/// kernels themselves, and the rates to which that bounds an H200.
fn count(context: &Arc<Context>, stride: usize, adapter: Adapter) -> Result<(), Box<dyn Error>> {
    let scene = load("datasets/sphere.toml")?;
    let scene = refined(&scene, if adapter.hardware { SWEPT } else { 1 });
    let (object, chain) = (build_object(&scene)?, Chain::new(&scene.proxy));
    let model = Model::reaching(&object, &chain, scene.contact, &sample(&scene))?;
    let configurations: Vec<JointVector> = sample(&scene).into_iter().step_by(stride).collect();
    let mut solver = GpuSolver::new(Arc::clone(context), &model)?;
    if !solver.is_exact() {
        println!("\nno f64 here: nothing is counted of the search in f64");
        return Ok(());
    }
    // The first time finds how much one dispatch should hold, and wakes the device.
    if adapter.hardware {
        solver.solve(&configurations)?;
    }
    context.kernel_times()?;
    let (_, begin) = (context.search_counts(), Instant::now());
    solver.solve(&configurations)?;
    let (seconds, times, counts) = (begin.elapsed().as_secs_f64(), context.kernel_times()?, context.search_counts());
    println!("\nsearch in f64, the shipped sphere scene, {} configurations", configurations.len());
    let work = work(&counts);
    let dispatches = |name: &str| times.iter().find(|kernel| kernel.name == name).map_or(1, |kernel| kernel.dispatches);
    let operations = work.iter().map(|&(name, [operations, _])| (name, operations / dispatches(name) as f64)).collect();
    let touching = counts.configurations as usize;
    table(&times, "configuration in contact", |_| touching, &operations, seconds, adapter);
    let (each, trials) = (|sum: u64| sum as f64 / counts.configurations as f64, counts.trials as f64);
    println!(
        "  {touching} in contact, {:.2} trials each. A trial: {:.0} nodes displaced by {:.0}, {:.1} proxy nodes near, {:.0} \
         facets measured, {:.1} iterations with {:.0} pairs, {:.0} steps of eliminations",
        each(counts.trials),
        counts.displaced as f64 / trials,
        counts.displaced_pairs as f64 / counts.displaced as f64,
        counts.candidates as f64 / trials,
        counts.facets as f64 / trials,
        counts.iterations as f64 / trials,
        counts.stepped_pairs as f64 / counts.iterations as f64,
        counts.eliminations as f64 / trials,
    );
    println!("  {:<24} {:>18} {:>10}  bound on an H200 by", "a configuration takes", "[M operations]", "[kB]");
    let mut whole = [0.0; 2];
    for (name, amounts) in work {
        let [operations, bytes] = amounts.map(|amount| amount / counts.configurations as f64);
        let bound = if operations / H200[0] > bytes / H200[1] { "arithmetic" } else { "memory" };
        println!("  {name:<24} {:>18.3} {:>10.1}  {bound}", 1e-6 * operations, 1e-3 * bytes);
        whole = [whole[0] + operations, whole[1] + bytes];
    }
    let [peak, memory] = [0, 1].map(|k| 1e-6 * H200[k] / whole[k]);
    let kernels: f64 = times.iter().map(|kernel| kernel.seconds).sum();
    println!(
        "  an H200 is bound to {memory:.1} million in contact a second by its memory, to {peak:.1} by its arithmetic; \
         here: {:.3}",
        1e-6 * counts.configurations as f64 / kernels
    );
    Ok(())
}

/// Operations and bytes of what was counted, by kernel.
fn work(counts: &SearchCounts) -> [(&'static str, [f64; 2]); 3] {
    let sum = |parts: &[(u64, [f64; 2])]| [0, 1].map(|k| parts.iter().map(|(count, of)| *count as f64 * of[k]).sum());
    [
        ("search_detect", sum(&[(counts.displaced_pairs, PAIR), (counts.facets, FACET)])),
        ("search_judge", sum(&[(counts.judged_pairs, PAIR)])),
        ("search_step", sum(&[(counts.stepped_pairs, PAIR), (counts.eliminations, ELIMINATION)])),
    ]
}

/// Where the host's time goes for every `stride`-th configuration of a scene: beside the adapter, and beside what it
/// found, returned at once.
fn host(name: &str, stride: usize) -> Result<(), Box<dyn Error>> {
    let scene = load(name)?;
    let (object, chain) = (build_object(&scene)?, Chain::new(&scene.proxy));
    let model = Model::reaching(&object, &chain, scene.contact, &sample(&scene))?;
    let configurations: Vec<JointVector> = sample(&scene).into_iter().step_by(stride).collect();
    let mut solver = GpuSolver::new(Arc::new(Context::open(AdapterChoice::Any)?), &model)?;
    let recorded = solver.record(&configurations)?;
    println!("\nhost, {name}: {} configurations [us each]", configurations.len());
    println!(
        "  {:<22} {:>10} {:>10} {:>10} {:>10} {:>14}",
        "beside", "submitting", "reading", "settling", "assembling", "but settling"
    );
    let print = |beside: &str, times: [f64; 5]| {
        let [submitting, reading, settling, assembling, others] = times;
        println!(
            "  {beside:<22} {submitting:>10.2} {reading:>10.2} {settling:>10.2} {assembling:>10.2} {others:>14.2}"
        );
    };
    print("the adapter", host_times(&mut solver, &configurations)?);
    let mut least = [f64::INFINITY; 5];
    for _ in 0..HOST_TURNS {
        let times = host_times(&mut GpuSolver::of(vec![recorded.clone()], &model), &configurations)?;
        if times[4] < least[4] {
            least = times;
        }
    }
    print("what takes no time", least);
    Ok(())
}

/// Configurations a second of the adapter, solved again and again in memory: the last four times.
fn busy(name: &str) -> Result<(), Box<dyn Error>> {
    let scene = refined(&load(name)?, SWEPT);
    let (object, chain) = (build_object(&scene)?, Chain::new(&scene.proxy));
    let configurations = sample(&scene);
    let model = Model::reaching(&object, &chain, scene.contact, &configurations)?;
    let mut solver = GpuSolver::new(Arc::new(Context::open(AdapterChoice::Any)?), &model)?;
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

/// Time of the host to solve: submitting, reading, settling, assembling, and all but settling (us a configuration).
fn host_times<S: Stages>(
    solver: &mut GpuSolver<'_, S>,
    configurations: &[JointVector],
) -> Result<[f64; 5], Box<dyn Error>> {
    let begin = Instant::now();
    solver.solve(configurations)?;
    let whole = begin.elapsed();
    let time = solver.host_time();
    let each = |time: Duration| 1e6 * time.as_secs_f64() / configurations.len() as f64;
    let others = whole.saturating_sub(time.settling);
    Ok([time.submitting, time.reading, time.settling, time.assembling, others].map(each))
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
fn frames(context: &Arc<Context>, scene: &Scene, rings: usize, adapter: Adapter) -> Result<(), Box<dyn Error>> {
    let mut spec = scene.object.clone();
    if let Shape::Sphere { rings: r, segments: s, .. } = &mut spec.shape {
        (*r, *s) = (rings, rings);
    }
    let object = Object::build(&spec)?;
    let nodes = object.rest.len();
    let method = FrameMethod::suitable(&object);
    let forces: Vec<DVec3> = (0..nodes).map(|k| DVec3::new(1e-4, 0.0, -1e-3 * (k % 7) as f64)).collect();
    let mut update = FrameUpdate::new(Arc::clone(context), &object, 1.0 / 60.0, method, &GraphicsEffects::default())?;
    update.step(&forces)?;
    update.read()?;
    context.kernel_times()?;
    let begin = Instant::now();
    for _ in 0..FRAMES {
        update.step(&forces)?;
    }
    update.read()?;
    let seconds = begin.elapsed().as_secs_f64();
    println!("\nframe update, {nodes} nodes, {method:?}: {FRAMES} frames");
    // A block of three by three times a vector, for each of a row; the rest is some operations a node.
    let (product, blocks, square) = (18.0, object.stiffness.blocks.len() as f64, (nodes * nodes) as f64);
    let operations = BTreeMap::from([
        ("frame load", product * blocks),
        ("frame advance", product * square),
        ("frame_iterative begin", product * blocks),
        ("frame_iterative product", product * blocks),
    ]);
    table(&context.kernel_times()?, "node and frame", |_| nodes * FRAMES, &operations, seconds, adapter);
    Ok(())
}

/// Prints what was timed: `count` is how many configurations, or nodes and frames, a kernel was for, `operations` how
/// many floating-point operations one dispatch does, `seconds` what all took by the clock on the wall.
fn table(
    kernels: &[KernelTime],
    what: &str,
    count: impl Fn(&KernelTime) -> usize,
    operations: &BTreeMap<&str, f64>,
    seconds: f64,
    Adapter { copying, hardware }: Adapter,
) {
    let whole: f64 = kernels.iter().map(|kernel| kernel.seconds).sum();
    println!(
        "  {:<24} {:>10} {:>11} {:>13} {:>7} {:>11} {:>9} {:>8} {:>8} {:>9}  bound by",
        "kernel",
        "dispatches",
        "time [us]",
        "[us each]",
        "share",
        "workgroups",
        "[MB]",
        "[GB/s]",
        "of copy",
        "[GFLOP/s]"
    );
    for kernel in kernels {
        let rate = kernel.bytes as f64 / kernel.seconds;
        let workgroups = kernel.workgroups as f64 / kernel.dispatches as f64;
        let flops = operations.get(kernel.name.as_str()).map_or_else(
            || "-".into(),
            |each| format!("{:.2}", 1e-9 * each * kernel.dispatches as f64 / kernel.seconds),
        );
        println!(
            "  {:<24} {:>10} {:>11.0} {:>13.3} {:>5.1} % {:>11.0} {:>9.2} {:>8.2} {:>6.1} % {:>9}  {}",
            kernel.name,
            kernel.dispatches,
            1e6 * kernel.seconds,
            1e6 * kernel.seconds / count(kernel) as f64,
            100.0 * kernel.seconds / whole,
            workgroups,
            1e-6 * kernel.bytes as f64,
            1e-9 * rate,
            100.0 * rate / copying,
            flops,
            bound(rate / copying, workgroups, hardware)
        );
    }
    println!(
        "  all: {:.1} ms of {:.1} ms; the rest is the host's, transfers included ([us each]: a {what})",
        1e3 * whole,
        1e3 * seconds
    );
}

/// What bounds a kernel that moves memory at `share` of the rate of copying, in dispatches of so many `workgroups`.
fn bound(share: f64, workgroups: f64, hardware: bool) -> &'static str {
    if share > MEMORY_BOUND {
        "memory"
    } else if hardware && workgroups < FEW_WORKGROUPS {
        "few workgroups"
    } else {
        "arithmetic or latency"
    }
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
