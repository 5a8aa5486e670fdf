//! Units and places of the world that must not matter: lengths in millimetres, an object a kilometre from the origin.

use super::processor::{IN_F32, Processor, processors};
use crate::hard_cases::{Bound, CaseResult, Failure, Setting};
use glam::DVec3;
use haptize::fixtures::bodies::{PAPER, RADIUS, contact, floating_bar, joint, pressed, sphere, sphere_spec};
use haptize::{
    JointVector,
    contact::{Equilibrium, Model, Status},
    object::Object,
    proxy::Chain,
    scene::{JointKind, ProxyNodeSpec, ProxySpec},
};

/// Depths of the configurations (m).
const DEPTH: f64 = 0.2 * RADIUS;

fn outcome(case: &str, varied: &str, measure: &str, worst: f64, bound: f64, note: String) -> CaseResult {
    let (case, varied, measure) = (case.into(), varied.into(), measure.into());
    CaseResult { case, varied, measure, worst, bound: Bound::AtMost(bound), note }
}

/// Largest difference of energies and torques, relative to the largest torque, each entry of `b` being times `energy`
/// and `torque` joint by joint; infinite where the states differ.
fn difference(a: &[Equilibrium], b: &[Equilibrium], energy: f64, torque: impl Fn(usize) -> f64) -> f64 {
    let mut worst = 0.0f64;
    for (a, b) in a.iter().zip(b) {
        if a.status != b.status {
            return f64::INFINITY;
        }
        if a.status == Status::Contact {
            worst = worst.max((a.energy - b.energy / energy).abs() / a.energy);
            let size = a.torque.norm();
            for (k, (a, b)) in a.torque.iter().zip(b.torque.iter()).enumerate() {
                worst = worst.max((a - b / torque(k)).abs() / size);
            }
        }
    }
    worst
}

/// The bar, all lengths times `scale`.
fn bar(radius: f64, scale: f64) -> Chain {
    let mut chain = floating_bar(radius * scale);
    for node in &mut chain.nodes {
        node.position *= scale;
    }
    chain
}

/// A world measured in other lengths: stiffness in newtons per that length, torque and energy in newtons times it. By a
/// power of two every product rounds alike, and results agree to the last bit; by a thousand, to rounding.
pub fn units(setting: &Setting) -> Result<Vec<CaseResult>, Failure> {
    let object = sphere(PAPER)?;
    let mut outcomes = Vec::new();
    for (name, scale, bound) in [("mm for m, by 1000", 1e3, 1e-7), ("by 1024, exact in binary", 1024.0, 0.0)] {
        let scaled = Object::build(&sphere_spec(PAPER, DVec3::ZERO, scale, 1.0 / scale))?;
        for mut processor in processors(setting) {
            let mut worst = 0.0f64;
            for radius in [0.0, 0.008] {
                let (here, there) = (bar(radius, 1.0), bar(radius, scale));
                let model = Model::new(&object, &here, contact(1e3));
                let other = Model::new(&scaled, &there, contact(1e3 / scale));
                let configurations = pressed(&model, 5, 40, 0.0, DEPTH);
                let mut elsewhere = configurations.clone();
                elsewhere.iter_mut().for_each(|q| q[..3].iter_mut().for_each(|x| *x *= scale));
                let expected = processor.reference().solve(&model, &configurations)?;
                let found = processor.solve(&other, &elsewhere)?;
                // Slides give forces, which stay; turns give torques.
                worst = worst.max(difference(&expected, &found, scale, |k| if k < 3 { 1.0 } else { scale }));
            }
            let measure = "U and tau scaled back, relative [1]";
            let note = processor.note("points and balls, Kc 1e3".into());
            outcomes.push(outcome(
                "units",
                &processor.name(name),
                measure,
                worst,
                processor.choose(bound, IN_F32),
                note,
            ));
        }
    }
    Ok(outcomes)
}

/// An arm of a slide and a turn with two links' nodes, its base at `base`.
fn arm(base: DVec3, radius: f64) -> Chain {
    let nodes = (0..12)
        .map(|k| ProxyNodeSpec { position: DVec3::X * (0.01 * f64::from(k) - 0.05), radius, length: 0.0 })
        .collect();
    Chain::new(&ProxySpec {
        joints: vec![
            joint(JointKind::Prismatic, base, -DVec3::Z, vec![]),
            joint(JointKind::Revolute, DVec3::ZERO, DVec3::Y, nodes),
        ],
        ..Default::default()
    })
}

/// Object and arm a kilometre away from the origin: coordinates there are rounded at 1e-13 m in f64, and would be at
/// 6e-5 m in f32, which is why contact is computed relative to the object.
pub fn far_away(setting: &Setting) -> Result<Vec<CaseResult>, Failure> {
    let shift = DVec3::new(1000.0, -700.0, 300.0);
    let near = sphere(PAPER)?;
    let far = Object::build(&sphere_spec(PAPER, shift, 1.0, 1.0))?;
    let mut outcomes = Vec::new();
    for (name, radius) in [("points", 0.0), ("balls", 0.008)] {
        let base = DVec3::new(0.003, 0.002, RADIUS + radius);
        let (here, there) = (arm(base, radius), arm(base + shift, radius));
        let models = [Model::new(&near, &here, contact(1e3)), Model::new(&far, &there, contact(1e3))];
        let mut configurations = Vec::new();
        for k in 0..20 {
            for turn in [-0.2, 0.03, 0.3] {
                configurations.push(JointVector::from_slice(&[0.0005 + 0.0005 * f64::from(k), turn]));
            }
        }
        let (case, measure) = ("far from the origin", "U and tau against those at it, relative [1]");
        let trials = [
            ("1 km away", &models[1], Processor::cpu()),
            ("at the origin", &models[0], Processor::gpu(&setting.gpu)),
            ("1 km away", &models[1], Processor::gpu(&setting.gpu)),
        ];
        for (place, model, mut processor) in trials {
            let expected = processor.reference().solve(&models[0], &configurations)?;
            let found = processor.solve(model, &configurations)?;
            let worst = difference(&expected, &found, 1.0, |_| 1.0);
            let varied = processor.name(&format!("{place}, {name}"));
            let bound = processor.choose(1e-6, IN_F32);
            outcomes.push(outcome(case, &varied, measure, worst, bound, processor.note(String::new())));
        }
    }
    Ok(outcomes)
}
