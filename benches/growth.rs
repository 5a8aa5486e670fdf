//! What a store costs as C-space grows: 1 to 6 joints, and stores that stand for uniform grids of up to 10^8 points.
//!
//!     cargo bench --bench growth -- [FOLDER [MOST]]
//!
//! The joints are the first ones of the arm of datasets/organ.toml; the others are held where its press is deepest.
//! For each a store is filled for ever smaller errors, until it has `MOST` nodes (by default 70,000). The uniform grid
//! for which it stands has the spacing of its finest level everywhere; its points are computed. Uniform grids of up to
//! `MOST` points are solved, too. `FOLDER`, by default out/store, gets the figure.

#![allow(clippy::unwrap_used)] // A benchmark may stop.

mod clock;

use clock::nanoseconds;
use haptize::{
    JointVector,
    dataset::Grid,
    draw::{
        colour,
        diagram::Diagram,
        plot::{Curve, Entry, Mark},
    },
    proxy::Chain,
    report::write_both,
    scene::{ProxyNodeSpec, Scene},
    store::{Store, record::width},
    sweep::{CpuBackend, Reference, build_object, grid_of, model_within, refine::Refine},
};
use rustix::time::{ClockId, clock_gettime};
use std::{hint::black_box, path::Path};

/// Rms errors for which a store is filled, over the rms torque (1).
const AIMS: [f64; 9] = [0.3, 0.2, 0.1, 0.05, 0.02, 0.01, 0.005, 0.002, 0.001];

/// Most levels for so many joints: the finest uniform grid has some 10^8 points, or the store no more levels.
const LEVELS: [u32; 6] = [16, 12, 8, 6, 5, 4];

/// Configurations in contact by which an error is measured: as many as `haptize bake --refine` takes.
const JUDGED: usize = 400;

/// Blocks of look-ups that are timed, and look-ups in each.
const BLOCKS: u32 = 1000;
const LOOK_UPS: u32 = 50;

/// What one store costs.
struct Cost {
    /// Points of the uniform grid of its finest spacing.
    uniform: f64,
    nodes: f64,
    bytes: f64,
    error: f64,
    /// A look-up on a slow way through the store (ns).
    look_up: f64,
    /// A solved node, its share of all else that filling takes included (us of processor time).
    node: f64,
}

/// Processor time of this process (s).
fn processor_time() -> f64 {
    let time = clock_gettime(ClockId::ProcessCPUTime);
    time.tv_sec as f64 + 1e-9 * time.tv_nsec as f64
}

/// `scene` with its first `joints` alone.
fn held(scene: &Scene, joints: usize) -> Scene {
    let chain = Chain::new(&scene.proxy);
    // The first joints at zero: their frames are parallel to the world.
    let mut q = scene.motion.press[2].q;
    q.iter_mut().take(joints).for_each(|q| *q = 0.0);
    let links = chain.links(&q);
    let mut held = scene.clone();
    held.proxy.joints.truncate(joints);
    held.grid.axes.truncate(joints);
    let last = &mut held.proxy.joints[joints - 1];
    for (number, node) in chain.nodes.iter().enumerate().filter(|(_, node)| node.link >= joints) {
        let position = chain.node_position(&links, number) - links.origins[joints - 1];
        last.nodes.push(ProxyNodeSpec { position, radius: node.radius, length: node.length });
    }
    held
}

/// `base` with `times` as many cells along each axis.
fn finer(base: &Grid, times: usize) -> Grid {
    let mut grid = base.clone();
    for axis in &mut grid.axes {
        (axis.step, axis.count) = (axis.step / times as f64, (axis.count - 1) * times + 1);
    }
    grid
}

/// What `store` costs, which `spent` seconds of processor time filled with `solved` nodes; its error, and a way that is
/// looked up.
fn cost(store: &Store, base: &Grid, (spent, solved): (f64, u64), error: f64, way: impl Fn(f64) -> JointVector) -> Cost {
    let blocks = store.blocks();
    let nodes: usize = blocks.iter().map(|(_, block)| block.nodes().present.count_ones() as usize).sum();
    let levels =
        blocks.iter().filter(|(_, block)| block.nodes().present != 0).map(|(key, _)| store.space().block(*key));
    let finest = levels.flatten().map(|(level, _)| level).max().unwrap_or(0);
    let placing = nanoseconds(BLOCKS, LOOK_UPS, |k| {
        black_box(way(k));
    });
    let look_up = nanoseconds(BLOCKS, LOOK_UPS, |k| {
        black_box(store.sample(&way(k)));
    });
    Cost {
        uniform: base.axes.iter().map(|axis| (((axis.count - 1) << finest) + 1) as f64).product(),
        nodes: nodes as f64,
        // In the file: key and mask of a block, numbers, gap and status of a node.
        bytes: (16 * blocks.len() + nodes * (4 * width(base.joints()) + 5)) as f64,
        error,
        look_up: look_up - placing,
        node: 1e6 * spent / solved as f64,
    }
}

/// Fills a store and takes its costs.
fn fill(refine: &Refine<'_>, judges: &mut [Reference; 2], backend: &mut CpuBackend<'_>) -> Cost {
    let begin = processor_time();
    let refined = refine.fill(judges, backend).unwrap();
    let spent = (processor_time() - begin, refined.solved as u64);
    let axes = &refine.base.axes;
    let way = |k: f64| {
        let mut q = JointVector::zeros(axes.len());
        for (a, (q, axis)) in q.iter_mut().zip(axes).enumerate() {
            let half = 0.5 * axis.step * (axis.count - 1) as f64;
            *q = axis.start + half * (1.0 + 0.9 * (1e-3 * k + a as f64).sin());
        }
        q
    };
    let error = judges[1].relative_error(|q| refined.store.sample(q).torque());
    cost(&refined.store, &refine.base, spent, error, way)
}

/// Costs of stores for ever smaller errors, and of uniform grids.
fn costs(scene: &Scene, joints: usize, most: usize) -> [Vec<Cost>; 2] {
    let scene = held(scene, joints);
    let object = build_object(&scene).unwrap();
    let chain = Chain::new(&scene.proxy);
    let mut model = model_within(&scene, &object, &chain).unwrap();
    model.with_tangent = true;
    let mut judges = [1, 2].map(|seed| Reference::in_contact(&scene, &model, seed, JUDGED).unwrap());
    let mut backend = CpuBackend::new(&model, 0).unwrap();
    let batch = backend.chunk();
    let refine = |base, levels, aim| Refine { model: &model, base, levels, aim, most, batch };
    let base = grid_of(&scene);
    let tell = |kind: &str, cost: &Cost| {
        let Cost { uniform, nodes, bytes, error, look_up, node } = cost;
        println!(
            "{joints:6}  {kind:7}  {uniform:14.0}  {nodes:8.0}  {bytes:10.0}  {:6.2} %  {look_up:12.0}  {node:15.0}",
            100.0 * error
        );
    };
    let mut uniform = Vec::new();
    for times in (0..).map(|power| 1 << power) {
        let grid = finer(&base, times);
        if grid.points() > most {
            break;
        }
        uniform.push(fill(&refine(grid, 1, f64::INFINITY), &mut judges, &mut backend));
        tell("uniform", &uniform[uniform.len() - 1]);
    }
    let mut stores: Vec<Cost> = Vec::new();
    for aim in AIMS {
        let cost = fill(&refine(base.clone(), LEVELS[joints - 1], aim), &mut judges, &mut backend);
        let is_full = cost.nodes >= 0.3 * most as f64;
        // An aim that the store before keeps asks for nothing.
        if stores.last().is_none_or(|before| before.nodes < cost.nodes) {
            tell("store", &cost);
            stores.push(cost);
        }
        if is_full {
            break;
        }
    }
    [stores, uniform]
}

/// Draws the costs of stores, those of uniform grids dashed beside them.
fn draw(folder: &str, name: &str, [title, note]: [&str; 2], all: &[[Vec<Cost>; 2]]) {
    let curves = |place: fn(&Cost) -> (f64, f64), dashed: bool| -> Vec<Curve> {
        let curve = |kind: usize, dashed: bool| {
            all.iter().zip(1..).map(move |(costs, joints)| {
                let name = match (dashed, joints) {
                    (true, _) => String::new(),
                    (false, 1) => "1 joint".to_owned(),
                    _ => joints.to_string(),
                };
                Curve { dashed, ..Curve::new(name, joints - 1, costs[kind].iter().map(place)) }
            })
        };
        curve(0, false).chain(curve(1, true).filter(|_| dashed)).collect()
    };
    let mut sheet = Diagram::new(title, note, 3);
    let uniform = "Points of the uniform grid of the finest spacing [1]";
    let error = "Rms error over rms torque [1]";
    sheet.panel(0, uniform, "Nodes solved [1]", &curves(|c| (c.uniform, c.nodes), false), &[]);
    sheet.panel(1, uniform, "Size of the file [bytes]", &curves(|c| (c.uniform, c.bytes), false), &[]);
    sheet.panel(2, uniform, error, &curves(|c| (c.uniform, c.error), true), &[]);
    sheet.panel(3, "Nodes solved [1]", error, &curves(|c| (c.nodes, c.error), true), &[]);
    sheet.panel(4, uniform, "Look-up [ns]", &curves(|c| (c.uniform, c.look_up), false), &[]);
    sheet.panel(5, uniform, "Processor time of a node solved [us]", &curves(|c| (c.uniform, c.node), true), &[]);
    let dashes = Entry { name: "uniform".into(), colour: colour::SOFT_INK, mark: Mark::Dashes };
    sheet.legend(&curves(|c| (c.uniform, c.nodes), false), vec![dashes]);
    for file in write_both(Path::new(folder), name, &sheet.canvas()).unwrap() {
        println!("{}", file.display());
    }
}

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).filter(|word| !word.starts_with("--")).collect();
    let folder = arguments.first().map_or("out/store", String::as_str);
    let most = arguments.get(1).map_or(70_000, |most| most.parse().unwrap());
    let scene = Scene::load(Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/datasets/organ.toml"))).unwrap();
    println!("joints  kind     uniform points     nodes       bytes     error  look-up [ns]  CPU a node [us]");
    let all: Vec<[Vec<Cost>; 2]> = (1..=LEVELS.len()).map(|joints| costs(&scene, joints, most)).collect();
    let texts = ["Stores filled for an error", "solid: ever smaller errors; dashed: uniform grids"];
    draw(folder, "store-growth", texts, &all);
}
