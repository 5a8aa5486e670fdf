//! What one frame of the object in motion costs at 10,000 and 100,000 nodes. On the CPU: isotropic springs, which are
//! solved coordinate by coordinate, beside axial ones, which need the whole matrix; and the time and memory of what is
//! made once. On the GPU, where there is one: conjugate gradients, as many iterations as usual and a quarter of them.
//!
//!     cargo bench --bench frame

#![allow(clippy::unwrap_used)] // A benchmark may stop.

use glam::DVec3;
use haptize::{
    gpu::{AdapterChoice, Context, FrameMethod, FrameUpdate},
    object::Object,
    render::object_motion::ObjectMotion,
    scene::{
        GraphicsEffects, GroundNodes, GroundSpec, Material, ObjectSpec, Shape, SpringKind, SpringSpec, StiffeningSpec,
    },
};
use std::{sync::Arc, time::Instant};

/// Frames a figure is taken from.
const FRAMES: usize = 40;

/// Rings and segments of the spheres: 10,002 and 99,858 nodes.
const RINGS: [usize; 2] = [100, 316];

fn sphere(kind: SpringKind, rings: usize) -> Object {
    Object::build(&ObjectSpec {
        shape: Shape::Sphere { centre: DVec3::ZERO, radius: 0.05, rings, segments: rings },
        material: Material::Springs(SpringSpec { kind, stiffness: 300.0 }),
        skin: None,
        ground: Some(GroundSpec { stiffness: 90.0, nodes: GroundNodes::All }),
        node_mass: 1e-3,
        node_damping: 0.02,
    })
    .unwrap()
}

/// Time that `work` takes [s], and what it made.
fn timed<T>(work: impl FnOnce() -> T) -> (f64, T) {
    let start = Instant::now();
    let made = work();
    (start.elapsed().as_secs_f64(), made)
}

fn main() {
    let effects = [
        ("dynamics", GraphicsEffects::default()),
        (
            "stiffening",
            GraphicsEffects { stiffening: Some(StiffeningSpec { factor: 4.0, strain: 0.05 }), ..Default::default() },
        ),
        ("quasi-static", GraphicsEffects { quasi_static: true, ..Default::default() }),
    ];
    println!(
        "  nodes  springs    effects       built [s]  set up [s]  factor [MB]  frame: least, median, 95 % [ms]  over \
         isotropic"
    );
    for rings in RINGS {
        let mut isotropic = [0.0; 3];
        for kind in [SpringKind::Isotropic, SpringKind::Axial] {
            let (built, object) = timed(|| sphere(kind, rings));
            let nodes = object.rest.len();
            let forces: Vec<DVec3> = (0..nodes).map(|k| DVec3::new(1e-4, 0.0, -1e-3 * (k % 7) as f64)).collect();
            for (number, (name, effects)) in effects.iter().enumerate() {
                let (set_up, motion) = timed(|| ObjectMotion::new(&object, 1.0 / 60.0, effects));
                let mut motion = motion.unwrap();
                let mut costs: Vec<f64> = (0..FRAMES)
                    .map(|_| {
                        let (cost, ()) = timed(|| {
                            motion.step(&forces);
                        });
                        1e3 * cost
                    })
                    .collect();
                costs.sort_by(f64::total_cmp);
                let (frame, median, late) = (costs[0], costs[FRAMES / 2], costs[FRAMES * 95 / 100]);
                if kind == SpringKind::Isotropic {
                    isotropic[number] = frame;
                }
                let (kind, megabytes) = (format!("{kind:?}"), object.factor.bytes() as f64 * 1e-6);
                let ratio = frame / isotropic[number];
                println!(
                    "{nodes:7}  {kind:9}  {name:12}  {built:9.2}  {set_up:10.2}  {megabytes:11.1}  {frame:12.2}, \
                     {median:6.1}, {late:7.1}  {ratio:14.1}"
                );
            }
        }
    }
    on_the_gpu();
}

/// Time that passes for a frame on the GPU, the last one waited for.
fn on_the_gpu() {
    let context = match Context::open(AdapterChoice::Any) {
        Ok(context) => Arc::new(context),
        Err(error) => return println!("\nframes on the GPU skipped: {error}"),
    };
    // A software adapter takes seconds a frame, and its figures say little.
    let frames = if context.adapter().hardware { FRAMES } else { 2 };
    println!("\n{}\n  nodes  springs    iterations  memory [MB]  frame [ms]", context.adapter().name);
    for rings in RINGS {
        for kind in [SpringKind::Isotropic, SpringKind::Axial] {
            let object = sphere(kind, rings);
            let nodes = object.rest.len();
            let forces: Vec<DVec3> = (0..nodes).map(|k| DVec3::new(1e-4, 0.0, -1e-3 * (k % 7) as f64)).collect();
            for iterations in [FrameMethod::USUAL_ITERATIONS / 4, FrameMethod::USUAL_ITERATIONS] {
                let method = FrameMethod::Iterations(iterations);
                let effects = GraphicsEffects::default();
                let mut update = FrameUpdate::new(context.clone(), &object, 1.0 / 60.0, method, &effects).unwrap();
                update.step(&forces).unwrap();
                update.read().unwrap();
                let began = Instant::now();
                for _ in 0..frames {
                    update.step(&forces).unwrap();
                }
                update.read().unwrap();
                let frame = 1e3 * began.elapsed().as_secs_f64() / frames as f64;
                let (kind, megabytes) = (format!("{kind:?}"), update.takes().bytes as f64 * 1e-6);
                println!("{nodes:7}  {kind:9}  {iterations:10}  {megabytes:11.1}  {frame:10.2}");
            }
        }
    }
}
