//! Rigid indenters on a clamped block, against Hertz's contact with the correction for a bonded layer (Dimitriadis et
//! al., Biophysical Journal 82, 2002) and against converged solutions (`tests/references/solids_indenters.csv`).
//!
//! Contact is frictionless, and solved here on the compliance alone, so that the elements are tested and no contact law:
//! forces f >= 0 along the normal at the nodes of the top, gaps g = g0 - d + C f >= 0, f g = 0.

use super::accuracy::compliance;
use super::*;
use haptize::object::Compliance;
use std::f64::consts::PI;

/// Edges of the surface where it is touched: a quarter of the radius of contact. The side of the punch is nine of them,
/// so that it covers the own areas of whole nodes (m).
const EDGE: f64 = 0.0175 / 9.0;

/// How many such edges lie to either side of the middle.
const FINE: f64 = 7.0;

/// Force (N) of an indenter whose surface stands `height` above its lowest point, pressed `depth` into the block (m).
pub fn pressed(object: &Object, height: impl Fn(DVec3) -> f64, depth: f64) -> f64 {
    let near = |node: &u32| {
        let x = object.rest[*node as usize];
        x.z > 0.0499 && height(x) < depth
    };
    let nodes: Vec<u32> = (0..object.surface_nodes as u32).filter(near).collect();
    let wanted: Vec<f64> = nodes.iter().map(|&node| depth - height(object.rest[node as usize])).collect();
    let compliance = Compliance::on(object, nodes.clone()).unwrap();
    let c = |i: usize, j: usize| compliance.block(i, j).z_axis.z;
    // Projected Gauss-Seidel.
    let mut forces = vec![0.0; nodes.len()];
    for _ in 0..400 {
        for i in 0..nodes.len() {
            let others: f64 = (0..nodes.len()).filter(|&j| j != i).map(|j| c(i, j) * forces[j]).sum();
            forces[i] = ((wanted[i] - others) / c(i, i)).max(0.0);
        }
    }
    forces.iter().sum()
}

/// A block whose surface has edges of [`EDGE`] up to [`FINE`] of them from the middle, and `beside` coarse ones from there
/// to `half` a side; `layers` over its height (m).
fn graded([half, height]: [f64; 2], beside: i32, layers: i32) -> Shell {
    let count = 2 * (FINE as i32 + beside);
    let (mut nodes, triangles) = block([count, count, layers], 1.0);
    let coarse = (half - FINE * EDGE) / f64::from(beside);
    let across = |x: f64| x.signum() * (x.abs().min(FINE) * EDGE + (x.abs() - FINE).max(0.0) * coarse);
    nodes.iter_mut().for_each(|x| *x = DVec3::new(across(x.x), across(x.y), x.z * height / f64::from(layers)));
    (nodes, triangles)
}

/// The block of the references, of cubes of size `cell` in the middle (m), where its surface is finest.
pub fn gel(poisson: f64, cell: Option<f64>) -> Object {
    solid(graded([0.05, 0.05], 11, 15), elastic(poisson, cell), clamped(1e-6), DMat3::IDENTITY, DVec3::ZERO)
}

/// Force of a ball of `radius` pressed `depth` into a bonded layer of `thickness` (m): Dimitriadis' equation 12.
fn hertz_on_layer(poisson: f64, radius: f64, depth: f64, thickness: f64) -> f64 {
    let a = -(1.2876 - 1.4678 * poisson + 1.3442 * poisson * poisson) / (1.0 - poisson);
    let b = (0.6387 - 1.0277 * poisson + 1.5164 * poisson * poisson) / (1.0 - poisson);
    let chi = (radius * depth).sqrt() / thickness;
    let correction = 1.0 - 2.0 * a / PI * chi + 4.0 * a * a / (PI * PI) * chi * chi
        - 8.0 / PI.powi(3) * (a.powi(3) + 4.0 * PI * PI / 15.0 * b) * chi.powi(3)
        + 16.0 * a / PI.powi(4) * (a.powi(3) + 3.0 * PI * PI / 5.0 * b) * chi.powi(4);
    4.0 / 3.0 * YOUNG / (1.0 - poisson * poisson) * radius.sqrt() * depth.powf(1.5) * correction
}

/// The converged force of `indenter` (N).
pub fn converged(indenter: &str, poisson: f64) -> f64 {
    let text = include_str!("../../references/solids_indenters.csv");
    let row = text.lines().find(|line| line.starts_with(&format!("{indenter},{poisson},"))).unwrap();
    row.rsplit(',').next().unwrap().parse().unwrap()
}

pub type Indenter = (&'static str, fn(DVec3) -> f64, f64);

/// Heights above the lowest point, and depths (m).
pub const INDENTERS: [Indenter; 3] = [
    ("ball", |x| (x.x * x.x + x.y * x.y) / 0.06, 0.002),
    ("capsule", |x| (x.x * x.x + (x.y.abs() - 0.01).max(0.0).powi(2)) / 0.06, 0.002),
    ("punch", |x| if x.x.abs().max(x.y.abs()) < 0.00875 { 0.0 } else { f64::INFINITY }, 0.001),
];

#[test]
fn a_ball_a_capsule_and_a_flat_punch_press_as_converged_solutions_and_hertz_say() {
    for poisson in [0.3, 0.45, 0.49, 0.499] {
        let gel = gel(poisson, None);
        let forces = INDENTERS.map(|(name, height, depth)| {
            let (force, expected) = (pressed(&gel, height, depth), converged(name, poisson));
            let error = force / expected - 1.0;
            println!("{name}, nu {poisson}: {force:.3} N of {expected:.3} N, {:+.1} %", 100.0 * error);
            assert!(error.abs() < 0.03, "{name}, nu {poisson}: {force} N instead of {expected} N");
            force
        });
        // The textbook's layer is infinitely wide.
        let closed = hertz_on_layer(poisson, 0.03, 0.002, 0.05);
        assert!(
            (forces[0] / closed - 1.0).abs() < 0.04,
            "nu {poisson}: {} N instead of {closed} N by Hertz",
            forces[0]
        );
    }
    for (poisson, expected) in [(0.3, 2.62), (0.45, 3.08), (0.49, 3.27)] {
        let closed = hertz_on_layer(poisson, 0.03, 0.002, 0.05);
        assert!((closed / expected - 1.0).abs() < 2e-3, "{closed} for nu {poisson}");
    }
}

#[test]
fn cubes_of_half_the_size_change_little() {
    // The first is what the surface gets by itself.
    let [own, halved] = [0.0053, 0.00265].map(|cell| gel(0.3, Some(cell)));
    for (name, height, depth) in INDENTERS {
        let change = pressed(&halved, height, depth) / pressed(&own, height, depth) - 1.0;
        println!("{name}: {:+.1} %", 100.0 * change);
        assert!(change.abs() < 0.02, "{name}: {change}");
    }
}

/// Cubes are doubled where the edges of the surface are 4/3 as long as the shortest. That is no rule for one block: in a
/// dome of 30 mm over a square of 80 mm, and in a plate of 80 x 80 x 20 mm that bends on soft ground, they are as good
/// as small ones throughout, which a surface of short edges gets.
#[test]
fn doubled_cubes_beside_a_pressure_change_little_in_a_dome_and_in_a_thick_plate() {
    let half = 0.04;
    let bulge = |x: f64| 1.0 - x * x / (half * half);
    let dome = |x: &DVec3| DVec3::new(x.x, x.y, x.z * (0.01 + 0.02 * bulge(x.x) * bulge(x.y)));
    let plate = |x: &DVec3| DVec3::new(x.x, x.y, 0.02 * x.z);
    // Whether cubes are doubled, and the nodes of their solid.
    let gives = |doubled: bool, is_dome: bool, poisson: f64| {
        let layers = if is_dome { [3, 5] } else { [6, 10] };
        let (beside, layers) = if doubled { (8, layers[0]) } else { (14, layers[1]) };
        let (nodes, triangles) = graded([half, 1.0], beside, layers);
        let soft = GroundSpec { stiffness: GroundStiffness::PerArea(1e6), nodes: GroundNodes::Below(1e-6) };
        let (ground, top) = if is_dome { (clamped(1e-6), 0.03) } else { (soft, 0.02) };
        let nodes = nodes.iter().map(|x| if is_dome { dome(x) } else { plate(x) }).collect();
        // What both surfaces get by themselves, to some hundredths.
        let body = solid((nodes, triangles), elastic(poisson, Some(0.0053)), ground, DMat3::IDENTITY, DVec3::ZERO);
        (compliance(&body, top * DVec3::Z, DVec3::Z), body.mechanics().unwrap().moved.len())
    };
    for (is_dome, poisson) in [(true, 0.3), (true, 0.49), (false, 0.3), (false, 0.49)] {
        let [doubled, fine] = [true, false].map(|doubled| gives(doubled, is_dome, poisson));
        let change = fine.0 / doubled.0 - 1.0;
        println!("dome: {is_dome}, nu {poisson}: {:+.2} %, {} and {} nodes", 100.0 * change, doubled.1, fine.1);
        assert!(3 * doubled.1 < 2 * fine.1, "{} and {} nodes", doubled.1, fine.1);
        assert!(change.abs() < 0.01, "dome: {is_dome}, nu {poisson}: {change}");
    }
}
