//! Bodies of the scene's own kinds, scanned by a rig that is computed configuration by configuration: encoder steps,
//! actuator noise, dry friction of the joints, friction on the surface. The truth has a mesh of its own.

use super::{Approaches, ScannedShape};
use crate::{
    JointVector,
    contact::{Model, Solver},
    object::Object,
    proxy::Chain,
    random::Random,
    scan::{LogHeader, Plan, RowStatus, ScanLog, ScanRow, labels},
    scene::{ScanScene, Scene},
};
use glam::DVec3;

/// Encoder step (rad), actuator noise of an average of 100 ticks, and dry friction of each joint (N m), as of the rig
/// of the sponge; friction on the surface (1).
const ENCODER: f64 = std::f64::consts::TAU / 40_000.0;
const NOISE: f64 = 2e-4;
const JOINT_FRICTION: f64 = 2e-3;
const FRICTION: f64 = 0.3;

/// The arm of the sponge's scene; `nodes` of its forearm.
fn arm(nodes: &str) -> String {
    format!(
        "[[proxy.joint]]
kind = \"revolute\"
origin = [0.0, 0.0, 0.12]
axis = [0.0, 0.0, 1.0]
limits = [-1.2, 1.2]
[[proxy.joint]]
kind = \"revolute\"
axis = [0.0, 1.0, 0.0]
limits = [-0.9, 0.9]
[[proxy.joint]]
kind = \"revolute\"
origin = [0.155, 0.0, 0.0]
axis = [0.0, 1.0, 0.0]
limits = [0.5, 2.6]
nodes = [{nodes}]
"
    )
}

const TIP: &str = "{ at = [0.155, 0.0, 0.0], radius = 0.006 }";

/// A body that is scanned, and how.
struct Specimen {
    /// `[object]` and what belongs to it.
    object: &'static str,
    /// Nodes of the forearm.
    nodes: &'static str,
    /// `[scan.workspace]`.
    plan: &'static str,
}

struct Scanned {
    log: ScanLog,
    scene: ScanScene,
    chain: Chain,
    truth: Scene,
}

impl Specimen {
    fn scene(&self) -> String {
        format!("{}\n{}", self.object, arm(self.nodes))
            + "[contact]\nsurface = \"smooth\"\nstiffness = 1000.0\n[grid]\naxes = [{ start = 0.0, stop = 0.1, count = 2 }, \
               { start = 0.0, stop = 0.1, count = 2 }, { start = 1.0, stop = 1.1, count = 2 }]\n"
    }

    /// The log of the whole plan.
    fn scan(&self, seed: u64) -> Scanned {
        let truth = Scene::parse(&self.scene(), "datasets/truth.toml").unwrap();
        let scan = "[scan.limits]\nworkspace = [[-1.0, -1.0, -1.0], [1.0, 1.0, 1.0]]\n[scan.simulated]\ncorner = [0.0, 0.0, \
                    0.0]\nsize = [0.1, 0.1, 0.1]\n";
        let text = format!("{}[scan.workspace]\n{}\n{scan}", arm(self.nodes), self.plan);
        let scene = ScanScene::parse(&text, "scan.toml").unwrap();
        let chain = Chain::new(&scene.proxy);
        let plan = Plan::new(&scene.scan, &chain).unwrap();
        let object = Object::build(&truth.object).unwrap();
        let model = Model::new(&object, &chain, truth.contact);
        let mut solver = Solver::new(&model);
        let (mut random, mut rows, mut before) = (Random::new(seed), Vec::new(), plan.stops[0].q);
        let mut rubbing = JointVector::zeros(3);
        for stop in &plan.stops {
            let equilibrium = solver.solve(&stop.q);
            let mut torque = equilibrium.torque;
            let moved: Vec<f64> = stop.q.iter().zip(before.iter()).map(|(a, b)| a - b).collect();
            for touch in &equilibrium.touches {
                // Against the part of the node's way that is along the surface.
                let way: DVec3 =
                    (0..3).map(|k| moved[k] * chain.jacobian_column(solver.pose(), touch.proxy_node as usize, k)).sum();
                let along = way - way.project_onto(touch.force.normalize_or(DVec3::Z));
                let sliding = (along.length() / way.length().max(1e-12)).min(0.2) / 0.2;
                let force = -FRICTION * sliding * touch.force.length() * along.normalize_or_zero();
                chain.add_torque(solver.pose(), touch.proxy_node as usize, force, &mut torque);
            }
            for k in 0..3 {
                if moved[k] != 0.0 {
                    rubbing[k] = -moved[k].signum() * JOINT_FRICTION * random.between(0.7, 1.0);
                }
                torque[k] += rubbing[k] + NOISE * random.normal();
            }
            before = stop.q;
            let Some(point) = stop.point else { continue };
            let mut q = stop.q;
            q.iter_mut().for_each(|x| *x = (*x / ENCODER).round() * ENCODER);
            let mut deviation = JointVector::zeros(3);
            deviation.fill(10.0 * NOISE);
            let time = rows.len() as f64;
            rows.push(ScanRow { point, time, q, torque, deviation, ticks: 100, status: RowStatus::Steady });
        }
        let header = LogHeader { joints: labels(&chain), simulated: true, scene: text, ..LogHeader::default() };
        Scanned { log: ScanLog { header, rows }, scene, chain, truth }
    }
}

/// A ball of 40 mm radius, its top at z = 0, scanned from above.
const SPHERE: Specimen = Specimen {
    object: "[object.sphere]
centre = [0.16, 0.0, -0.04]
radius = 0.04
edge = 0.007
[object.elasticity]
young = 1e4
poisson = 0.45
cell = 0.014
[object.skin]
width = 0.012
[object.ground]
clamp = true
below = -0.07",
    nodes: TIP,
    plan: "start = [0.124, -0.036, 0.009]
across = [
    { direction = [0.0, 1.0, 0.0], spacing = 0.006, count = 13 },
    { direction = [1.0, 0.0, 0.0], spacing = 0.006, count = 13 },
]
depth = { direction = [0.0, 0.0, -1.0], spacing = 0.003, count = 13 }
clearance = 0.004",
};

#[test]
fn a_ball_is_found_to_a_tenth_of_the_spacing() {
    let scanned = SPHERE.scan(1);
    let approaches = Approaches::new(&scanned.log, &scanned.scene, &scanned.chain).unwrap();
    let shape = ScannedShape::new(&approaches, &scanned.chain, Some(-0.08)).unwrap();
    let centre = DVec3::new(0.16, 0.0, -0.04);
    let rms = |errors: &[f64]| (errors.iter().map(|e| e * e).sum::<f64>() / errors.len() as f64).sqrt();
    let places: Vec<f64> = shape.touched.iter().map(|t| t.place.distance(centre) - 0.04).collect();
    let measured = shape.nodes.iter().zip(&shape.deviations).filter(|(_, deviation)| deviation.is_some());
    let errors: Vec<f64> = measured.map(|(x, _)| x.distance(centre) - 0.04).collect();
    let object = Object::from_surface(&scanned.truth.object, shape.nodes.clone(), shape.triangles.clone()).unwrap();
    assert!(object.warnings.is_empty(), "{:?}", object.warnings);
    // A surface that is one spacing off is not found.
    assert!(rms(&places) < 0.1 * shape.spacing, "{}", rms(&places));
    println!(
        "surface {:.3} mm rms, told {:.3} mm, held out {:.3} mm; {:?}, {} nodes, exponent {}",
        1e3 * rms(&errors),
        1e3 * shape.deviation(),
        1e3 * shape.held_out,
        shape.carving,
        shape.nodes.len(),
        approaches.exponent
    );
    assert!(rms(&errors) < 0.1 * shape.spacing);
}
