//! The sweep of the sphere scene: the CPU backend beside the paper's algorithm in vectorised NumPy, in one run; and
//! what a configuration costs as objects, contacts and grids grow.
//!
//! `bash benches/peers/setup.sh` once, then `cargo bench --bench sweep`. Without NumPy the peer is skipped, and said
//! so. The curves are drawn into target/bench/cost.{svg,png}.

use haptize::{
    JointVector,
    contact::{Model, Proximity, Solver, Status},
    dataset::{Axis, Grid},
    draw::{
        chart::{Lane, Stack},
        plot::Curve,
    },
    object::Object,
    paper::PaperBackend,
    proxy::Chain,
    report::write_both,
    scene::{ContactLaw, JointKind, Scene, Shape},
    sweep::{Backend, CpuBackend, FreeSpace},
};
use serde_json::json;
use std::{
    collections::BTreeMap,
    error::Error,
    path::Path,
    process::Command,
    time::{Duration, Instant},
};

/// The peer solves every so many-th configuration: enough to know its rate to some percent.
const PEER_STRIDE: usize = 16;

/// Everything is timed so many times, the peer as well, and the fastest counts: a busy machine slows some down. Sweeps
/// are timed for as long as the peer's turns take, since machines that lend their cores change their speed within
/// seconds.
const TURNS: usize = 7;
const SWEEPS_LAST: Duration = Duration::from_secs(2);

/// Torques agree if they differ by less than this share of the greatest.
const AGREEMENT: f64 = 1e-6;

fn main() -> Result<(), Box<dyn Error>> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut scene = Scene::load(root.join("tests/scenes/sphere.toml"))?;
    let cores = std::thread::available_parallelism()?.get();
    println!("tests/scenes/sphere.toml on {cores} cores\n");
    let paper = fastest(&scene, true)?;
    scene.contact.law = ContactLaw::Following;
    let energy = fastest(&scene, false)?;
    println!("{:<34} {:>16} {:>9} {:>10}", "", "configurations/s", "contact", "converged");
    for (name, run) in [("haptize, the paper's iteration", &paper), ("haptize, energy", &energy)] {
        println!("{name:<34} {:>16.0} {:>9} {:>10}", run.rate, run.contact, run.converged);
    }
    for processes in [1, cores] {
        match peer(root, &scene, processes) {
            Ok(theirs) => {
                let rate = theirs.torque.len() as f64 / theirs.seconds;
                let name =
                    format!("NumPy {}, {processes} process{}", theirs.numpy, if processes == 1 { "" } else { "es" });
                let count = |wanted: &[u8]| theirs.status.iter().filter(|status| wanted.contains(status)).count();
                println!("{name:<34} {rate:>16.1} {:>9} {:>10}", count(&[1, 2]), count(&[1]));
                println!(
                    "  haptize over that: {:.0} with the same iteration, {:.0} with energy",
                    paper.rate / rate,
                    energy.rate / rate
                );
                compare(&paper, &theirs);
            }
            Err(reason) => println!("NumPy skipped: {reason} (bash benches/peers/setup.sh)"),
        }
    }
    curves(root, &scene)
}

/// What a whole sweep of the scene's grid gave.
struct Sweep {
    rate: f64,
    contact: usize,
    converged: usize,
    results: Vec<(Status, JointVector)>,
}

/// `by_paper`: by the paper's iteration instead of the scene's law.
fn fastest(scene: &Scene, by_paper: bool) -> Result<Sweep, Box<dyn Error>> {
    let began = Instant::now();
    let mut fastest = rate(scene, by_paper)?;
    while began.elapsed() < SWEEPS_LAST {
        let sweep = rate(scene, by_paper)?;
        if sweep.rate > fastest.rate {
            fastest = sweep;
        }
    }
    Ok(fastest)
}

fn rate(scene: &Scene, by_paper: bool) -> Result<Sweep, Box<dyn Error>> {
    let (object, chain) = (Object::build(&scene.object)?, Chain::new(&scene.proxy));
    let model = Model::new(&object, &chain, scene.contact);
    let grid = grid(scene, 1);
    let configurations: Vec<JointVector> = (0..grid.points()).map(|point| grid.configuration(point)).collect();
    let (mut cpu, mut paper) = (CpuBackend::new(&model, 0)?, PaperBackend::new(&model));
    let start = Instant::now();
    let free_space = FreeSpace::new(&model, &grid).find(0..grid.points())?;
    let left: Vec<JointVector> =
        (0..grid.points()).filter(|&p| free_space.gap(p).is_none()).map(|p| configurations[p]).collect();
    let equilibria = if by_paper { paper.solve(&left)? } else { cpu.solve(&left)? };
    let seconds = start.elapsed().as_secs_f64();
    let mut solved = equilibria.into_iter();
    let results: Vec<(Status, JointVector)> = (0..grid.points())
        .map(|p| match free_space.gap(p) {
            Some(_) => (Status::Free, JointVector::zeros(chain.joints.len())),
            None => solved.next().map_or((Status::Outside, JointVector::zeros(0)), |e| (e.status, e.torque)),
        })
        .collect();
    let count = |wanted: &[Status]| results.iter().filter(|(status, _)| wanted.contains(status)).count();
    let (converged, unconverged) = (count(&[Status::Contact]), count(&[Status::Unconverged]));
    Ok(Sweep { rate: grid.points() as f64 / seconds, contact: converged + unconverged, converged, results })
}

/// The scene's grid, `finer` times as fine.
fn grid(scene: &Scene, finer: usize) -> Grid {
    let axes = scene.proxy.joints.iter().zip(&scene.grid.axes).map(|(joint, axis)| Axis {
        name: joint.name.clone(),
        unit: if joint.kind == JointKind::Revolute { "rad".into() } else { "m".into() },
        start: axis.start,
        step: axis.step / finer as f64,
        count: (axis.count - 1) * finer + 1,
    });
    Grid { axes: axes.collect() }
}

/// What the peer says.
#[derive(serde::Deserialize)]
struct Peer {
    numpy: String,
    seconds: f64,
    status: Vec<u8>,
    torque: Vec<Vec<f64>>,
}

fn peer(root: &Path, scene: &Scene, processes: usize) -> Result<Peer, Box<dyn Error>> {
    let (object, chain) = (Object::build(&scene.object)?, Chain::new(&scene.proxy));
    let grid = grid(scene, 1);
    let (mut rows, mut columns, mut values) = (Vec::new(), Vec::new(), Vec::new());
    for node in 0..object.rest.len() {
        for (other, block) in object.mechanics()?.stiffness.row(node) {
            for a in 0..3 {
                for b in 0..3 {
                    rows.push(3 * node + a);
                    columns.push(3 * other + b);
                    values.push(block.row(a)[b]);
                }
            }
        }
    }
    let problem = json!({
        "nodes": object.rest.iter().flat_map(|node| node.to_array()).collect::<Vec<_>>(),
        "triangles": object.triangles.as_flattened(),
        "rows": rows, "columns": columns, "values": values,
        "joints": chain.joints.iter().map(|joint| json!({
            "prismatic": joint.kind == JointKind::Prismatic,
            "origin": joint.origin.to_array(), "axis": joint.axis.to_array(),
        })).collect::<Vec<_>>(),
        "proxy": chain.nodes.iter().map(|node| json!({
            "link": node.link, "position": node.position.to_array(),
        })).collect::<Vec<_>>(),
        "configurations": (0..grid.points())
            .step_by(PEER_STRIDE).map(|p| grid.configuration(p).to_vec()).collect::<Vec<_>>(),
        "stiffness": scene.contact.stiffness, "tolerance": scene.contact.tolerance,
        "max_iterations": scene.contact.max_iterations,
    });
    let folder = tempfile::tempdir()?;
    let file = folder.path().join("problem.json");
    std::fs::write(&file, serde_json::to_vec(&problem)?)?;
    let output = Command::new(root.join("target/peers/bin/python"))
        .arg(root.join("benches/peers/sweep_numpy.py"))
        .arg(&file)
        .arg(processes.to_string())
        .arg(TURNS.to_string())
        .output()?;
    if !output.status.success() {
        return Err(String::from_utf8_lossy(&output.stderr).lines().last().unwrap_or_default().into());
    }
    Ok(serde_json::from_slice(&output.stdout)?)
}

/// Says how many results of the two transcriptions of the same iteration are the same.
fn compare(ours: &Sweep, theirs: &Peer) {
    let mine = || ours.results.iter().step_by(PEER_STRIDE);
    let greatest = mine().flat_map(|(_, torque)| torque.iter()).fold(0.0_f64, |most, tau| most.max(tau.abs()));
    let (mut both, mut agree, mut same_status) = (0, 0, 0);
    for ((status, torque), (their_status, their_torque)) in mine().zip(theirs.status.iter().zip(&theirs.torque)) {
        same_status += usize::from(*status as u8 == *their_status);
        if *status == Status::Contact && *their_status == 1 {
            both += 1;
            let differ = |(a, b): (&f64, &f64)| (a - b).abs() > AGREEMENT * greatest;
            agree += usize::from(!torque.iter().zip(their_torque).any(differ));
        }
    }
    let all = theirs.status.len();
    println!(
        "  same status at {same_status} of {all} configurations; same torque at {agree} of {both} converged in both"
    );
}

/// Cost against nodes, contacts and grid points: printed and drawn.
fn curves(root: &Path, scene: &Scene) -> Result<(), Box<dyn Error>> {
    let chain = Chain::new(&scene.proxy);
    let grid_of = |finer| grid(scene, finer);
    println!("\nnodes of the sphere: time of a configuration in contact, one thread");
    let mut nodes = Vec::new();
    let mut contacts: BTreeMap<usize, (f64, usize)> = BTreeMap::new();
    for rings in [6, 10, 16, 24, 32] {
        let mut spec = scene.object.clone();
        if let Shape::Sphere { rings: r, segments: s, .. } = &mut spec.shape {
            (*r, *s) = (rings, rings);
        }
        let object = Object::build(&spec)?;
        let model = Model::new(&object, &chain, scene.contact);
        let mut solver = Solver::new(&model);
        let grid = grid_of(1);
        let (mut seconds, mut count) = (0.0, 0);
        for point in (0..grid.points()).step_by(11) {
            let q = grid.configuration(point);
            let (time, equilibrium) = quickest(|| solver.solve(&q));
            if equilibrium.gap < 0.0 {
                seconds += time;
                count += 1;
                if rings == 10 {
                    let entry = contacts.entry(equilibrium.touches.len()).or_default();
                    *entry = (entry.0 + time, entry.1 + 1);
                }
            }
        }
        let mean = 1e6 * seconds / count as f64;
        println!("  {:>6} nodes {mean:>9.1} us", object.rest.len());
        nodes.push((object.rest.len() as f64, mean));
    }
    println!("contacts on 102 nodes: time of a configuration, one thread");
    let contacts: Vec<(f64, f64)> = contacts.into_iter().map(|(k, (t, n))| (k as f64, 1e6 * t / n as f64)).collect();
    contacts.iter().for_each(|(count, time)| println!("  {count:>6} contacts {time:>6.1} us"));

    println!("grid points: time of a contact-free point, all cores, bounds of free space included");
    let object = Object::build(&scene.object)?;
    let model = Model::new(&object, &chain, scene.contact);
    let mut backend = CpuBackend::new(&model, 0)?;
    let mut free_points = Vec::new();
    for finer in [1, 2, 3, 5] {
        let grid = grid_of(finer);
        let (found, free_space) = quickest(|| FreeSpace::new(&model, &grid).find(0..grid.points()));
        let free_space = free_space?;
        let mut proximity = Proximity::new(&model);
        let left = (0..grid.points()).filter(|&p| free_space.gap(p).is_none()).map(|p| grid.configuration(p));
        let left: Vec<JointVector> = left.filter(|q| proximity.gap(q) >= 0.0).collect();
        let (solved, equilibria) = quickest(|| backend.solve(&left));
        equilibria?;
        let time = found + solved;
        let skipped = free_space.points().filter(|&point| free_space.gap(point).is_some()).count();
        let all = skipped + left.len();
        let each = 1e6 * time / all as f64;
        println!("  {:>9} points, {all:>8} free, {skipped:>8} of them skipped {each:>6.2} us each", grid.points());
        free_points.push((grid.points() as f64 / 1e6, each));
    }
    draw(root, nodes, contacts, free_points)
}

/// The least time that `work` takes (s), and what it gives.
fn quickest<T>(mut work: impl FnMut() -> T) -> (f64, T) {
    let mut time = || {
        let start = Instant::now();
        let result = work();
        (start.elapsed().as_secs_f64(), result)
    };
    let mut quickest = time();
    for _ in 1..TURNS {
        let turn = time();
        if turn.0 < quickest.0 {
            quickest = turn;
        }
    }
    quickest
}

fn draw(
    root: &Path,
    nodes: Vec<(f64, f64)>,
    contacts: Vec<(f64, f64)>,
    free: Vec<(f64, f64)>,
) -> Result<(), Box<dyn Error>> {
    let folder = root.join("target/bench");
    let charts = [
        ("cost_nodes", "Cost against the object's nodes", "Surface nodes", "Configuration in contact [us]", nodes),
        ("cost_contacts", "Cost against contacts", "Proxy nodes in contact", "Configuration in contact [us]", contacts),
        ("cost_points", "Cost against grid points", "Grid points [10^6]", "Contact-free point [us]", free),
    ];
    for (name, headline, across, title, points) in charts {
        let lane = Lane { height: 220.0, ..Lane::new(title, vec![Curve::new("", 0, points)]) };
        let (headline, across) = (headline.into(), across.into());
        let stack = Stack { headline, across, lanes: vec![lane], contact: Vec::new() };
        let [svg, png] = write_both(&folder, name, &stack.draw())?;
        println!("{} {}", svg.display(), png.display());
    }
    Ok(())
}
