//! An arm as a URDF text, for programs that show robots: joints, inertia, and rods from joint to joint with balls at the
//! contact nodes.

use crate::{
    names::Xml,
    proxy::{Chain, ChainLink},
    scene::{Follows, JointKind},
};
use glam::DVec3;
use std::fmt::Write;

/// Greatest effort (N m or N) and speed (rad/s or m/s) of a joint, which a URDF must name: the greatest that its reader takes.
const UNLIMITED: f64 = 1e6;

/// Describes `chain`, whose base is the frame `base`, as a robot called `name`; rods have `radius` (m). The link of each
/// joint has the joint's name. Efforts and speeds are not limited by what is written.
#[must_use]
pub fn description(chain: &Chain, name: &str, base: &str, radius: f64) -> String {
    let mut text = String::new();
    // Writing to a text does not fail.
    let _ = describe(&mut text, chain, name, base, radius);
    text
}

fn describe(out: &mut String, chain: &Chain, name: &str, base: &str, radius: f64) -> std::fmt::Result {
    writeln!(out, "<?xml version=\"1.0\"?>\n<robot name=\"{}\">\n  <link name=\"{}\"/>", Xml(name), Xml(base))?;
    let mut parent = base;
    for (number, ChainLink { spec: joint, .. }) in chain.links.iter().enumerate() {
        let kind = match joint.kind {
            JointKind::Revolute => "revolute",
            JointKind::Prismatic => "prismatic",
        };
        let ([low, high], link) = (joint.limits, Xml(&joint.name));
        writeln!(out, "  <joint name=\"{link}\" type=\"{kind}\">\n    <parent link=\"{}\"/>", Xml(parent))?;
        writeln!(out, "    <child link=\"{link}\"/>\n    <origin xyz=\"{}\"/>", Numbers(joint.origin))?;
        writeln!(out, "    <axis xyz=\"{}\"/>", Numbers(joint.axis))?;
        writeln!(out, "    <limit lower=\"{low}\" upper=\"{high}\" effort=\"{0}\" velocity=\"{0}\"/>", UNLIMITED)?;
        if let Some(Follows { joint, multiplier, offset }) = &joint.follows {
            let leader = Xml(joint);
            writeln!(out, "    <mimic joint=\"{leader}\" multiplier=\"{multiplier}\" offset=\"{offset}\"/>")?;
        }
        writeln!(out, "  </joint>\n  <link name=\"{link}\">")?;
        if joint.mass > 0.0 {
            let i = joint.inertia;
            writeln!(out, "    <inertial>\n      <origin xyz=\"{}\"/>", Numbers(joint.centre_of_mass))?;
            writeln!(out, "      <mass value=\"{}\"/>", joint.mass)?;
            writeln!(
                out,
                "      <inertia ixx=\"{}\" ixy=\"{}\" ixz=\"{}\" iyy=\"{}\" iyz=\"{}\" izz=\"{}\"/>\n    </inertial>",
                i.x_axis.x, i.y_axis.x, i.z_axis.x, i.y_axis.y, i.z_axis.y, i.z_axis.z
            )?;
        }
        let nodes = || chain.nodes.iter().filter(|node| node.link == number);
        let farthest = nodes().map(|node| node.position).max_by(|a, b| a.length().total_cmp(&b.length()));
        let end = chain.links.get(number + 1).map(|next| next.spec.origin).or(farthest).unwrap_or_default();
        if end != DVec3::ZERO {
            // From the cylinder's axis z to the rod: about y, then about z.
            let (pitch, yaw) = (end.z.atan2(end.truncate().length()), end.y.atan2(end.x));
            let pitch = std::f64::consts::FRAC_PI_2 - pitch;
            writeln!(out, "    <visual>\n      <origin xyz=\"{}\" rpy=\"0 {pitch} {yaw}\"/>", Numbers(end / 2.0))?;
            writeln!(out, "      <geometry><cylinder radius=\"{radius}\" length=\"{}\"/></geometry>", end.length())?;
            writeln!(out, "    </visual>")?;
        }
        for node in nodes() {
            writeln!(out, "    <visual>\n      <origin xyz=\"{}\"/>", Numbers(node.position))?;
            writeln!(out, "      <geometry><sphere radius=\"{}\"/></geometry>", node.radius.max(radius))?;
            writeln!(out, "    </visual>")?;
        }
        writeln!(out, "  </link>")?;
        parent = &joint.name;
    }
    writeln!(out, "</robot>")
}

/// A vector as URDF has it.
struct Numbers(DVec3);

impl std::fmt::Display for Numbers {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let DVec3 { x, y, z } = self.0;
        write!(f, "{x} {y} {z}")
    }
}
