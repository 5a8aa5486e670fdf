//! Rigid indenters on a clamped block, against Hertz's contact with the correction for a bonded layer (Dimitriadis et
//! al., Biophysical Journal 82, 2002) and against the flat punch of Sneddon (1965).
//!
//! Contact is frictionless, and solved here on the compliance alone, so that the elements are tested and no contact law:
//! forces f >= 0 along the normal at the nodes of the top, gaps g = g0 - d + C f >= 0, f g = 0.

use super::*;
use haptize::object::Compliance;
use std::f64::consts::PI;

/// Edge of the surface where it is touched (m).
const EDGE: f64 = 0.0025;

/// Force (N) of an indenter whose surface stands `height` above its lowest point, pressed `depth` into the block (m).
fn pressed(object: &Object, height: impl Fn(DVec3) -> f64, depth: f64) -> f64 {
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

fn gel(poisson: f64) -> Object {
    solid(block([40, 40, 20], EDGE), elastic(poisson, None), clamped(1e-6), DMat3::IDENTITY, DVec3::ZERO)
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

#[test]
fn a_ball_presses_as_hertz_says_on_a_bonded_layer() {
    for (poisson, expected) in [(0.3, 2.62), (0.45, 3.08), (0.49, 3.27)] {
        let closed = hertz_on_layer(poisson, 0.03, 0.002, 0.05);
        assert!((closed / expected - 1.0).abs() < 2e-3, "{closed} for nu {poisson}");
        let force = pressed(&gel(poisson), |x| (x.x * x.x + x.y * x.y) / (2.0 * 0.03), 0.002);
        println!("ball, nu {poisson}: {force:.3} N of {closed:.3} N");
        assert!((force / closed - 1.0).abs() < 0.03, "nu {poisson}: {force} N instead of {closed} N");
    }
}
