//! What one tick of the haptic loop costs: for one to six joints and each interpolation, look-up alone and the whole
//! tick, side by side; and for scenes that are solved live.
//!
//!     cargo bench --bench tick -- [live]
//!
//! `live` leaves out the look-ups. Live ticks are timed one by one along the scenes' own motions, in processor time of
//! the thread, which other work on the machine changes little.

#![allow(clippy::unwrap_used)] // A benchmark may stop.

mod clock;
#[path = "../tests/common/desktop.rs"]
mod desktop;

use clock::nanoseconds;
use haptize::{
    JointVector, MAX_JOINTS,
    device::Motion,
    field::{Flags, TorqueField},
    fixtures::grids,
    render::{
        haptic::{Haptics, Inputs},
        live::LiveScene,
        setup::Setup,
    },
    scene::{Interpolation, Scene},
};
use rustix::time::{ClockId, clock_gettime};
use std::{fmt::Write, hint::black_box, path::Path, sync::Arc, time::Instant};

const TICKS: u32 = 100_000;

/// Scenes that ship and are solved.
const SCENES: [&str; 7] = ["sphere", "mesh", "nodule", "organ", "touch", "woodenhaptics", "two_diy"];

/// Sessions that are the same, tick by tick, of which the least time of each tick counts: interrupts, and what others do
/// to the caches, only add to it.
const TURNS: usize = 3;

/// Contact nodes of the arm that is a mesh, all round its last link (1).
const MESH_NODES: usize = 2500;

/// Radius of that link (m), and where it begins and ends.
const RADIUS: f64 = 0.008;
const LINK: [f64; 2] = [0.00875, 0.14];

/// The paper's sphere with 10,242 vertices, and an arm that is a mesh.
fn mesh_arm(sphere: &str) -> String {
    let mut nodes = String::from("nodes = [");
    for k in 0..MESH_NODES {
        // A spiral, as dense along as around.
        let share = (k as f64 + 0.5) / MESH_NODES as f64;
        let turn = 2.399_963_229_728_653 * k as f64;
        let (x, y, z) = (LINK[0] + share * (LINK[1] - LINK[0]), RADIUS * turn.cos(), RADIUS * turn.sin());
        write!(nodes, "{{ at = [{x}, {y}, {z}] }}, ").unwrap();
    }
    let (links, rest) = sphere.split_once("# ---- Contact").unwrap();
    let line = links.lines().rfind(|line| line.starts_with("nodes")).unwrap();
    let links = links.replacen(line, "", 1).replacen(line, &(nodes + "]"), 1);
    let rest = rest.replacen("stiffness_per_length = 1.7e5", "stiffness = 125.0", 1);
    format!("{links}# ---- Contact{rest}").replacen("subdivisions = 4", "subdivisions = 5", 1)
}

/// Processor time of this thread (us).
fn processor_time() -> f64 {
    let time = clock_gettime(ClockId::ThreadCPUTime);
    1e6 * time.tv_sec as f64 + 1e-3 * time.tv_nsec as f64
}

/// Ticks along the motions of the scene in `text`.
fn live(name: &str, text: &str, path: &Path) {
    let began = Instant::now();
    let scene = Arc::new(LiveScene::new(Scene::parse(text, path).unwrap()).unwrap());
    let setup = Setup::live(Arc::clone(&scene), &scene.dataset()).unwrap();
    let prepared = began.elapsed().as_secs_f64();
    let (joints, nodes) = (setup.chain.joints.len(), setup.chain.nodes.len());
    let (mut costs, mut touched, mut unsolved, mut most) = (Vec::new(), 0, 0, 0);
    for way in [&setup.scene.motion.press, &setup.scene.motion.scrape] {
        let motion = Motion::through(way, joints).unwrap();
        let mut least = vec![f64::MAX; (1e3 * motion.duration()) as usize];
        for turn in 0..TURNS {
            let mut state = setup.haptics.start(&motion.at(0.0).0).unwrap();
            let mut contact = setup.haptics.source().begin();
            for (k, least) in least.iter_mut().enumerate() {
                let (position, _) = motion.at(1e-3 * k as f64);
                let inputs = Inputs { position, age: 0.0, elapsed: 1e-3, interval: 1e-3 };
                let before = processor_time();
                let output = setup.haptics.tick_with(&mut state, &inputs, &mut contact);
                *least = least.min(processor_time() - before);
                if turn == 0 {
                    touched += usize::from(output.sample.contact);
                    unsolved += usize::from(output.sample.flags.contains(Flags::UNCONVERGED));
                    most = most.max(output.sample.contact_nodes);
                }
            }
        }
        costs.extend(least);
    }
    costs.sort_by(f64::total_cmp);
    let [median, rare, greatest] = [0.5, 0.999, 1.0].map(|share| costs[((costs.len() - 1) as f64 * share) as usize]);
    let percent = 100 * touched / costs.len();
    println!(
        "{name:14} {joints:6} {nodes:6} {prepared:11.2} {percent:9} % {most:13} {median:8.1} {rare:8.1} {greatest:8.1} \
         {unsolved:9}"
    );
}

fn main() {
    println!("scene          joints  nodes  set-up [s]  in contact  object nodes  median  99.9 %  max [us]  unsolved");
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("datasets");
    let text = |name: &str| std::fs::read_to_string(folder.join(format!("{name}.toml"))).unwrap();
    for name in SCENES {
        live(name, &text(name), &folder.join(format!("{name}.toml")));
    }
    live("mesh arm", &mesh_arm(&text("sphere")), &folder.join("sphere.toml"));
    if std::env::args().any(|word| word == "live") {
        return;
    }
    println!(
        "joints  interpolation  grid points  look-up [ns]  tick [ns]  look-up / linear  tick / linear of 3 joints"
    );
    let cost = |joints: usize, interpolation: Interpolation| {
        let count = [0, 4000, 200, 30, 14, 9, 7][joints];
        let mut data = grids::half_space(grids::grid(&vec![(-0.6, 1.2 / (count - 1) as f64, count); joints]), 5.0);
        let depth = |point: usize| data.grid.configuration(point).iter().sum::<f64>() / (joints as f64).sqrt();
        data.gap = Some((0..data.grid.points()).map(|point| -depth(point) as f32).collect::<Vec<_>>().into());
        let spec = desktop::haptics(joints);
        let field = TorqueField::interpolated(&data, interpolation, spec.threshold, &spec.boundary_slope).unwrap();
        // In and out of contact, through many cells.
        let place = |k: f64| {
            let mut q = JointVector::zeros(joints);
            q.iter_mut().enumerate().for_each(|(a, q)| *q = 0.1 + 0.4 * (1e-3 * k + a as f64).sin());
            q
        };
        let placing = nanoseconds(TICKS / 1000, 1000, |k| {
            black_box(place(k));
        });
        let look_up = nanoseconds(TICKS / 1000, 1000, |k| {
            black_box(field.sample(&place(k)));
        });
        let haptics = Haptics::new(field, desktop::proxy(joints), &spec).unwrap();
        let mut state = haptics.start(&place(0.0)).unwrap();
        let tick = nanoseconds(TICKS / 1000, 1000, |k| {
            let inputs = Inputs { position: place(k), age: 0.0, elapsed: 1e-3, interval: 1e-3 };
            black_box(haptics.tick(&mut state, &inputs));
        });
        (data.grid.points(), look_up - placing, tick - placing)
    };
    let three = cost(3, Interpolation::Linear).2;
    for joints in 1..=MAX_JOINTS {
        let linear = cost(joints, Interpolation::Linear).1;
        for interpolation in Interpolation::ALL {
            let (points, look_up, tick) = cost(joints, interpolation);
            let (ratio, relative) = (look_up / linear, tick / three);
            let name = interpolation.name();
            println!("{joints:6}  {name:13}  {points:11}  {look_up:12.0}  {tick:9.0}  {ratio:16.1}  {relative:25.2}");
        }
    }
}
