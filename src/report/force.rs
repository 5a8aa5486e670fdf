//! Force at the proxy's end and its configuration against time (paper's Fig. 8): what a hand feels as it moves over an
//! object.
//!
//! A chain of three joints turns torque into force without ambiguity: tau = J^T F, so F = J^-T tau with J the Jacobian
//! of the last contact node.

use super::press;
use crate::{
    JointVector,
    draw::{canvas::Canvas, chart::Lane, plot::Curve},
    proxy::Chain,
    render::trace::{Tick, Trace},
};
use glam::{DMat3, DVec3};

/// Determinant of a Jacobian relative to the product of its columns' lengths, below which an arm counts as singular: a
/// force would be uncertain by a hundred times the torque's error.
const REGULAR_JACOBIAN: f64 = 1e-2;

/// Force at the chain's last contact node that has the joint torques `torque` at `q` (N); `None` where the chain has
/// not three joints, or is singular there.
#[must_use]
pub fn end_force(chain: &Chain, q: &JointVector, torque: &JointVector) -> Option<DVec3> {
    let node = chain.nodes.len().checked_sub(1)?;
    let [a, b, c] = torque[..] else { return None };
    let mut pose = chain.new_pose();
    chain.pose(q, &mut pose);
    let column = |joint| chain.jacobian_column(&pose, node, joint);
    let jacobian = DMat3::from_cols(column(0), column(1), column(2));
    let scale: f64 = (0..3).map(|joint| column(joint).length()).product();
    let regular = jacobian.determinant().abs() > REGULAR_JACOBIAN * scale;
    regular.then(|| jacobian.transpose().inverse() * DVec3::new(a, b, c))
}

/// Force that a hand felt at the end of the proxy, tick by tick.
#[derive(Clone, Debug, PartialEq)]
pub struct EndForce {
    /// Name of the dataset, for the legend.
    pub name: String,
    /// Time (s) and force (N); no numbers where the arm is singular.
    pub forces: Vec<(f64, DVec3)>,
    /// First and last moment of the longest contact (s).
    pub contact: Option<[f64; 2]>,
}

/// The force while a contact went on: over its middle half, along the axis of the world along which it is greatest.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct SteadyForce {
    /// `x`, `y` or `z`.
    pub axis: char,
    /// Mean (N).
    pub mean: f64,
    /// Greatest departure from the mean, as a fraction of it (1).
    pub variation: f64,
}

impl EndForce {
    /// Whether the torque of `chain` gives the force at its end: it has three joints, and contact nodes on its last
    /// link alone.
    #[must_use]
    pub fn is_known(chain: &Chain) -> bool {
        let at_the_end = chain.nodes.iter().all(|node| node.link + 1 == chain.links.len());
        chain.joints.len() == 3 && !chain.nodes.is_empty() && at_the_end
    }

    /// The force of `trace`; `None` where it is not known.
    #[must_use]
    pub fn new(name: &str, chain: &Chain, trace: &Trace) -> Option<Self> {
        if !Self::is_known(chain) {
            return None;
        }
        let force = |tick: &Tick| end_force(chain, &tick.proxy, &tick.sample.torque).unwrap_or(DVec3::NAN);
        let contacts = press::contact_intervals(&trace.ticks);
        let longest = contacts.into_iter().max_by(|a, b| (a[1] - a[0]).total_cmp(&(b[1] - b[0])));
        let forces = trace.ticks.iter().map(|tick| (tick.time, force(tick))).collect();
        Some(Self { name: name.to_owned(), forces, contact: longest })
    }

    /// Returns the held force; `None` without contact or if the force is not known throughout.
    #[must_use]
    pub fn held(&self) -> Option<SteadyForce> {
        let [from, to] = self.contact?;
        let quarter = 0.25 * (to - from);
        let middle = || self.forces.iter().filter(|(time, _)| (from + quarter..=to - quarter).contains(time));
        let count = middle().count();
        let mean = middle().map(|(_, force)| *force).sum::<DVec3>() / count.max(1) as f64;
        let axis = (0..3).max_by(|&a, &b| mean[a].abs().total_cmp(&mean[b].abs()))?;
        let most = middle().map(|(_, force)| (force[axis] - mean[axis]).abs()).fold(0.0, f64::max);
        let variation = most / mean[axis].abs().max(f64::MIN_POSITIVE);
        (count > 0 && mean.is_finite()).then_some(SteadyForce {
            axis: ['x', 'y', 'z'][axis],
            mean: mean[axis],
            variation,
        })
    }
}

/// Force at the end of the proxy and the configuration of `trace`, that of the first (Fig. 8): of one dataset along x,
/// y and z; of several side by side.
#[must_use]
pub fn force(felt: &[EndForce], trace: &Trace) -> Canvas {
    const AXES: [&str; 3] = ["x", "y", "z"];
    let curve = |number: usize, name: String, force: &EndForce, axis: usize| {
        Curve::new(name, number, force.forces.iter().map(|(time, force)| (*time, force[axis])))
    };
    let lane = |title: String, curves: Vec<Curve>, height: f64| Lane { height, ..Lane::new(title, curves) };
    let mut lanes: Vec<Lane> = match felt {
        [single] => {
            let curves = (0..3).map(|axis| curve(axis, format!("along {}", AXES[axis]), single, axis));
            vec![lane("Contact force at the end of the proxy [N]".to_owned(), curves.collect(), 150.0)]
        }
        _ => (0..3)
            .rev()
            .map(|axis| {
                let curves = felt.iter().enumerate().map(|(k, force)| curve(k, force.name.clone(), force, axis));
                let title = format!("Contact force at the end of the proxy along {} [N]", AXES[axis]);
                lane(title, curves.collect(), if axis == 2 { 150.0 } else { 90.0 })
            })
            .collect(),
    };
    lanes
        .extend(press::per_joint(trace, ["Proxy configuration"; 2], "q", |tick, joint| tick.proxy.get(joint).copied()));
    press::stack("Force felt at the end of the proxy", trace, lanes)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::dataset::JointLabel;
    use crate::scene::{JointKind, JointSpec, ProxyNodeSpec, ProxySpec};

    #[test]
    fn the_force_has_the_torques_it_was_made_of() {
        let joint = |axis: DVec3, origin: DVec3, nodes: Vec<ProxyNodeSpec>| JointSpec {
            follows: None,
            name: String::new(),
            kind: JointKind::Revolute,
            origin,
            axis,
            limits: [-3.0, 3.0],
            mass: 0.0,
            centre_of_mass: DVec3::ZERO,
            inertia: DMat3::ZERO,
            rotor_inertia: 1e-3,
            nodes,
        };
        let end = vec![ProxyNodeSpec { position: DVec3::X * 0.15, radius: 0.0, length: 0.0 }];
        let joints = vec![
            joint(DVec3::Z, DVec3::ZERO, vec![]),
            joint(DVec3::Y, DVec3::ZERO, vec![]),
            joint(DVec3::Y, DVec3::X * 0.15, end),
        ];
        let chain = Chain::new(&ProxySpec { joints, ..Default::default() });
        let q = JointVector::from_slice(&[0.3, -0.2, 1.4]);
        let force = DVec3::new(1.0, -2.0, 3.0);
        let mut pose = chain.new_pose();
        chain.pose(&q, &mut pose);
        let mut torque = JointVector::zeros(3);
        chain.add_torque(&pose, 0, force, &mut torque);
        assert!(end_force(&chain, &q, &torque).unwrap().distance(force) < 1e-12);
        let straight = JointVector::from_slice(&[0.3, -0.2, 0.0]);
        assert!(end_force(&chain, &straight, &torque).is_none(), "a straight arm carries any force along itself");
    }

    #[test]
    fn the_middle_half_of_the_longest_contact_is_what_is_held() {
        let at = |time: f64| DVec3::new(0.1, 0.0, if (2.0..=6.0).contains(&time) { -2.0 - 0.02 * time } else { 0.0 });
        let forces = (0..800).map(|k| 0.01 * f64::from(k)).map(|time| (time, at(time))).collect();
        let force = EndForce { name: String::new(), forces, contact: Some([2.0, 6.0]) };
        let held = force.held().unwrap();
        assert_eq!(held.axis, 'z');
        assert!((held.mean + 2.08).abs() < 1e-3 && (held.variation - 0.02 / 2.08).abs() < 1e-3, "{held:?}");
        assert!(EndForce { contact: None, ..force }.held().is_none());
    }

    #[test]
    fn a_panel_has_one_unit() {
        let one = |unit: &str| JointLabel { name: unit.into(), unit: unit.into() };
        let felt = EndForce { name: "felt".into(), forces: vec![(0.0, DVec3::X), (1.0, DVec3::Y)], contact: None };
        for (units, panels) in [(&["rad", "rad"][..], &["[rad]"][..]), (&["m", "rad"], &["[rad]", "[m]"])] {
            let joints = units.iter().map(|unit| one(unit)).collect();
            let svg = force(std::slice::from_ref(&felt), &Trace { joints, ..Trace::default() }).svg();
            for unit in ["[rad]", "[m]"] {
                let title = format!("Proxy configuration {unit}");
                assert_eq!(svg.contains(&title), panels.contains(&unit), "{units:?}: {unit}");
            }
        }
    }
}
