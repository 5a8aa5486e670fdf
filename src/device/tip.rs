//! A Cartesian device, coupled to a contact node of the scene's arm by a passive spring in space.
//!
//! The device measures where its tip is and takes a force; the loop needs joint positions and gives joint torques.
//! Between them stands an arm that is simulated: the scene's chain, with the inertia M and damping D of the scene's
//! device at each joint. Its node at x(q) and the tip at p hold each other by `F = K (p - x) + B (pdot - J qdot)`: F
//! pulls the node, -F the hand.
//!
//! `M qddot = -D qdot + tau + J^T F`, tau from the loop. Stepped by the midpoint rule, K and B implicit with J of the
//! step's beginning: `(M + h/2 (D + B J^T J) + h^2/4 K J^T J) v = M v_0 + h/2 (tau + J^T (K (p - x_0) + B pdot))`. No
//! inverse kinematics takes part, so that redundant and singular arms are as good as any.

use super::{Applied, Device, Guard, LinearMap, Reading, Scheduler};
use crate::{
    JointVector, MAX_JOINTS,
    joint_matrix::solve_positive,
    proxy::{Chain, Pose, inverse_kinematics::approach},
    scene::{DeviceSpec, HapticsSpec},
};
use glam::DVec3;
use std::sync::Arc;

/// A Cartesian device behind its safety layer, and the arm that its tip leads.
pub struct TipDevice {
    guard: Guard,
    /// From the device's axes to the scene's.
    map: LinearMap,
    chain: Chain,
    pose: Pose,
    node: usize,
    /// K (N/m), B (N s/m).
    stiffness: f64,
    damping: f64,
    /// M (kg m^2 or kg), D (N m s/rad or N s/m).
    inertia: JointVector,
    joint_damping: JointVector,
    position: JointVector,
    velocity: JointVector,
    /// From the loop (N m or N).
    torque: JointVector,
    tip: DVec3,
    tip_velocity: DVec3,
}

impl TipDevice {
    /// Returns the device of `guard`, whose tip leads the node of `chain` that `spec` names. The arm begins at rest,
    /// with the node as near to the tip as the joints let it. `map` must have three coordinates.
    #[must_use]
    pub fn new(guard: Guard, map: LinearMap, chain: Chain, spec: &DeviceSpec, haptics: &HapticsSpec) -> Self {
        let tip = point(&map.position(&guard.latest().position));
        let mut middle = JointVector::zeros(chain.degrees_of_freedom());
        for (q, joint) in middle.iter_mut().zip(&chain.joints) {
            *q = joint.limits[0].midpoint(joint.limits[1]);
        }
        let node = spec.node.unwrap_or(chain.nodes.len().saturating_sub(1));
        let (position, _) = approach(&chain, node, tip, &middle);
        let zero = JointVector::zeros(position.len());
        let mut pose = chain.new_pose();
        chain.pose(&position, &mut pose);
        Self {
            guard,
            map,
            pose,
            node,
            stiffness: spec.stiffness,
            damping: spec.damping,
            inertia: haptics.device_inertia,
            joint_damping: haptics.device_damping,
            position,
            velocity: zero,
            torque: zero,
            tip,
            tip_velocity: DVec3::ZERO,
            chain,
        }
    }

    /// Returns F, the spring's and damper's force on the node (N).
    #[must_use]
    pub fn force(&self) -> DVec3 {
        let mut node_velocity = DVec3::ZERO;
        for (joint, rate) in self.velocity.iter().enumerate() {
            node_velocity += self.chain.jacobian_column(&self.pose, self.node, joint) * *rate;
        }
        self.stiffness * (self.tip - self.pose.nodes[self.node]) + self.damping * (self.tip_velocity - node_velocity)
    }

    /// Returns the energy that arm and spring hold (J).
    #[must_use]
    pub fn energy(&self) -> f64 {
        let kinetic = self.velocity.iter().zip(self.inertia.iter()).map(|(v, m)| 0.5 * m * v * v).sum::<f64>();
        kinetic + 0.5 * self.stiffness * (self.tip - self.pose.nodes[self.node]).length_squared()
    }

    /// Moves the arm on by `time` (s).
    fn step(&mut self, time: f64) {
        let joints = self.position.len();
        let half = 0.5 * time;
        let mut columns = [DVec3::ZERO; MAX_JOINTS];
        for (joint, column) in columns.iter_mut().enumerate().take(joints) {
            *column = self.chain.jacobian_column(&self.pose, self.node, joint);
        }
        let pull = self.stiffness * (self.tip - self.pose.nodes[self.node]) + self.damping * self.tip_velocity;
        let mut matrix = [[0.0; MAX_JOINTS]; MAX_JOINTS];
        let mut midpoint = JointVector::zeros(joints);
        for i in 0..joints {
            for j in 0..joints {
                let coupled = half * self.damping + half * half * self.stiffness;
                matrix[i][j] = coupled * columns[i].dot(columns[j]);
            }
            matrix[i][i] += self.inertia[i] + half * self.joint_damping[i];
            midpoint[i] = self.inertia[i] * self.velocity[i] + half * (self.torque[i] + columns[i].dot(pull));
        }
        solve_positive(&matrix, &mut midpoint);
        for joint in 0..joints {
            self.position[joint] += time * midpoint[joint];
            self.velocity[joint] = 2.0 * midpoint[joint] - self.velocity[joint];
        }
        self.chain.pose(&self.position, &mut self.pose);
    }
}

impl Device for TipDevice {
    fn read(&mut self, elapsed: f64) -> Reading {
        let measured = *self.guard.read(elapsed);
        let tip = point(&self.map.position(&measured.position));
        // Also false for what is not a number.
        if elapsed > 0.0 {
            self.tip_velocity = (tip - self.tip) / elapsed;
            // The spring's end in the middle of the step.
            self.tip = 0.5 * (tip + self.tip);
            self.step(elapsed);
        }
        self.tip = tip;
        Reading { age: measured.age, ..Reading::at(self.position) }
    }

    fn apply(&mut self, torque: &JointVector) -> Applied {
        self.torque = *torque;
        let force = -self.force();
        let held = self.guard.write(&self.map.effort(&JointVector::from_slice(&force.to_array())));
        // The arm is under the whole torque, whatever the hand feels of it.
        Applied { torque: *torque, clamps: held.clamps, halt: held.halt }
    }

    fn scheduler(&self) -> Option<Arc<dyn Scheduler>> {
        self.guard.scheduler()
    }
}

fn point(position: &JointVector) -> DVec3 {
    let [x, y, z, ..] = position.padded();
    DVec3::new(x, y, z)
}
