//! Arms in singular postures, at their limits, with axes that coincide: contact sees where the nodes are and nothing
//! else.

use super::processor::{IN_F32, processors};
use crate::hard_cases::{Bound, CaseResult, Failure, Setting};
use glam::DVec3;
use haptize::fixtures::bodies::{PAPER, contact, joint, sphere};
use haptize::{
    JointVector,
    contact::Model,
    proxy::Chain,
    scene::{JointKind, JointSpec, ProxyNodeSpec, ProxySpec},
};

/// Where the base stands (m): its links reach the sphere stretched out, a little off the plane in which its edges lie.
const BASE: DVec3 = DVec3::new(-0.2, 0.003, 0.04);

/// A singular pose: its name, the joints, and their coordinates when the links are turned by an angle.
type Arm = (&'static str, Vec<JointSpec>, fn(f64) -> Vec<f64>);

fn revolute(origin: DVec3, nodes: Vec<ProxyNodeSpec>) -> JointSpec {
    joint(JointKind::Revolute, origin, DVec3::Y, nodes)
}

fn nodes(from: f64) -> Vec<ProxyNodeSpec> {
    (0..10)
        .map(|k| ProxyNodeSpec { position: DVec3::X * (from + 0.012 * f64::from(k)), radius: 0.0, length: 0.0 })
        .collect()
}

/// Equilibria of one posture by arms of one, two and three joints that put the same nodes in the same place.
pub fn run(setting: &Setting) -> Result<Vec<CaseResult>, Failure> {
    let object = sphere(PAPER)?;
    let plain = vec![revolute(BASE, nodes(0.1))];
    // Two joints about one axis.
    let coincident = vec![revolute(BASE, vec![]), revolute(DVec3::ZERO, nodes(0.1))];
    // Stretched out: elbow and wrist at zero, J J^T singular.
    let stretched =
        vec![revolute(BASE, vec![]), revolute(DVec3::X * 0.05, vec![]), revolute(DVec3::X * 0.05, nodes(0.0))];
    // Limits that forbid the posture.
    let mut limited = plain.clone();
    limited[0].limits = [-0.01, 0.01];
    let angles = [0.0, 0.05, 0.1, 0.15, 0.2];
    let arms: [Arm; 3] = [
        ("two coincident axes", coincident, |q| vec![0.75 * q, 0.25 * q]),
        ("stretched out, singular", stretched, |q| vec![q, 0.0, 0.0]),
        ("beyond its limits", limited, |q| vec![q]),
    ];
    let reference = Chain::new(&ProxySpec { joints: plain, ..Default::default() });
    let mut outcomes = Vec::new();
    for (name, joints, posture) in arms {
        let arm = Chain::new(&ProxySpec { joints, ..Default::default() });
        let postures = angles.map(|q| JointVector::from_slice(&posture(q)));
        for mut processor in processors(setting) {
            let mut worst = 0.0f64;
            let mut touching = 0;
            for stiffness in [1e2, 1e4] {
                let [plain, singular] = [&reference, &arm].map(|chain| Model::new(&object, chain, contact(stiffness)));
                let expected = processor.reference().solve(&plain, &angles.map(|q| JointVector::from_slice(&[q])))?;
                for (expected, found) in expected.iter().zip(processor.solve(&singular, &postures)?) {
                    touching += usize::from(!expected.touches.is_empty());
                    if expected.status != found.status || expected.forces.len() != found.forces.len() {
                        worst = f64::INFINITY;
                        continue;
                    }
                    let size = expected.forces.iter().map(|force| force.force.length()).fold(1e-9, f64::max);
                    for (a, b) in expected.forces.iter().zip(&found.forces) {
                        worst = worst.max(a.force.distance(b.force) / size);
                    }
                    // The first joint turns everything, whatever comes after it.
                    worst = worst.max((expected.torque[0] - found.torque[0]).abs() / (size * 0.2));
                }
            }
            outcomes.push(CaseResult {
                case: "singular arms".into(),
                varied: processor.name(name),
                measure: "forces and torque against a plain arm's, relative [1]".into(),
                worst,
                bound: Bound::AtMost(processor.choose(1e-6, IN_F32)),
                note: processor.note(format!("{touching} in contact")),
            });
        }
    }
    Ok(outcomes)
}
