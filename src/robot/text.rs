//! The scene file of an arm, as a person would have written it.

use super::{Arm, ArmJoint, ContactNodes, Mimic, Robot};
use super::{practice::Practice, shape};
use crate::scene::{Follows, JointKind, JointSpec, LinkShape, ProxyNodeSpec, ProxySpec, Scene};
use crate::toml_text::{coarse, comment, entry, heading, list, number, significant, vector};
use crate::{Error, MAX_AXES};
use crate::{
    names::counted,
    proxy::{Chain, Press},
};
use glam::DVec3;
use std::fmt::Write;

/// Longest name of a joint in a scene, in characters.
const MAX_NAME: usize = 40;

/// Default reflected inertia of a joint's actuator, written where the robot has none (kg m^2, or kg).
const ROTOR: [f64; 2] = [1e-3, 0.05];

/// Stiffness of the coupling at the contact node, from which the joints' gains follow (N/m).
const TIP_STIFFNESS: f64 = 800.0;

/// Greatest force there (N).
const TIP_FORCE: f64 = 10.0;

/// Returns the text of a scene with the arm, whose links are drawn as `shapes`, and a soft ball within its reach.
/// `command`: what made it, for the head of the file.
///
/// # Errors
/// If there is no contact node, or the text is no valid scene, a fault of this program.
pub fn write_scene(
    robot: &Robot,
    arm: &Arm,
    nodes: &ContactNodes,
    shapes: &[LinkShape],
    command: &str,
) -> Result<String, Error> {
    let specs = joints(arm, nodes);
    let proxy = ProxySpec::new(specs.clone()).map_err(|(number, why)| {
        let name = &arm.joints[number].name;
        let span = robot.joints.iter().find(|joint| joint.name == *name).map_or(0..0, |joint| joint.span.clone());
        robot.source().error(span, format!("joint {name:?} follows another (mimic): {why}"))
    })?;
    let no_nodes = || Error::at(&robot.path, "the arm has no contact node, and could touch nothing");
    let practice = Practice::new(&Chain::new(&proxy)).ok_or_else(no_nodes)?;
    let mut text = String::new();
    // Writing to a string fails only where memory does.
    let _ = write(&mut text, robot, arm, (&specs, &proxy), nodes, &practice, command);
    let _ = shape::write(&mut text, &proxy, shapes);
    Scene::parse(&text, robot.path.with_extension("toml"))
        .map_err(|error| error.within("the scene made of the robot is not valid, a fault of this program"))?;
    Ok(text)
}

/// The joints of the chain as the scene has them: numbers rounded as they are written.
fn joints(arm: &Arm, nodes: &ContactNodes) -> Vec<JointSpec> {
    let mut joints: Vec<JointSpec> = Vec::new();
    for (joint, nodes) in arm.joints.iter().zip(&nodes.of_joints) {
        let name = name(&joint.name, &joints);
        let node = |position: &DVec3| ProxyNodeSpec { position: *position, radius: 0.0, length: 0.0 };
        joints.push(JointSpec {
            name,
            kind: joint.kind,
            follows: None,
            origin: joint.origin,
            axis: joint.axis,
            limits: joint.limits.map(|limit| (limit * 1e9).round() / 1e9),
            mass: joint.inertial.mass,
            centre_of_mass: joint.inertial.centre,
            inertia: joint.inertial.inertia,
            // A joint that follows another needs no actuator.
            rotor_inertia: joint.rotor_inertia.unwrap_or(match joint.follows {
                Some(_) => 0.0,
                None => ROTOR[usize::from(joint.kind == JointKind::Prismatic)],
            }),
            nodes: nodes.iter().map(node).collect(),
        });
    }
    for (number, joint) in arm.joints.iter().enumerate() {
        let Some(Mimic { joint: leader, multiplier, offset }) = &joint.follows else { continue };
        let leader = arm.joints.iter().position(|other| other.name == *leader).unwrap_or(number);
        let [multiplier, offset] = [multiplier, offset].map(|x| (x * 1e9).round() / 1e9);
        joints[number].follows = Some(Follows { joint: joints[leader].name.clone(), multiplier, offset });
    }
    joints
}

/// Returns a joint's name in letters that a scene takes, other than those before.
fn name(name: &str, before: &[JointSpec]) -> String {
    let fits = |c: char| c.is_alphanumeric() || matches!(c, ' ' | '_' | '-');
    let plain: String = name.chars().map(|c| if fits(c) { c } else { '_' }).take(MAX_NAME).collect();
    let is_taken = |name: &str| before.iter().any(|joint| joint.name == name);
    let shorter: String = plain.chars().take(MAX_NAME - 3).collect();
    let mut numbered = (2..).map(|number| format!("{shorter}_{number}"));
    if is_taken(&plain) { numbered.find(|name| !is_taken(name)).unwrap_or(plain) } else { plain }
}

fn write(
    text: &mut String,
    robot: &Robot,
    arm: &Arm,
    (specs, proxy): (&[JointSpec], &ProxySpec),
    nodes: &ContactNodes,
    practice: &Practice,
    command: &str,
) -> std::fmt::Result {
    write_head(text, robot, arm, proxy.joints.len(), command)?;
    write_object(text, practice)?;

    heading(text, "The multi-link virtual proxy")?;
    writeln!(
        text,
        "# Link frames are parallel to the robot's root frame at q = 0. Links that do not move, and are not felt: {}.",
        comment(&arm.base.join(", "))
    )?;
    let count: usize = nodes.of_joints.iter().map(Vec::len).sum();
    writeln!(
        text,
        "# {count} contact nodes on the shapes of the moving links, {} m apart or more.",
        number(nodes.spacing, 6)
    )?;
    for (joint, spec) in arm.joints.iter().zip(specs) {
        write_joint(text, joint, spec)?;
    }

    heading(text, "Contact, equation (2)")?;
    writeln!(text, "[contact]")?;
    entry(text, "stiffness", "200.0", "N/m, of one contact spring; each node has three")?;

    let Practice { press, .. } = practice;
    if proxy.joints.len() <= MAX_AXES {
        heading(text, "C-space: where contact is baked")?;
        writeln!(
            text,
            "# Coarse, for a first look: narrow the ranges to those that you use, and raise the counts, or bake with \
             --max-error.\n"
        )?;
        press.write_grid(text, &proxy.joints)?;
    }

    heading(text, "The 1 kHz loop")?;
    write_haptics(text, arm, proxy, press)?;
    writeln!(text, "\n[graphics]")?;
    entry(text, "rate", "60.0", "Hz")?;

    heading(text, "Motions")?;
    press.write_motion(text)
}

fn write_head(text: &mut String, robot: &Robot, arm: &Arm, joints: usize, command: &str) -> std::fmt::Result {
    let file = robot.path.file_name().unwrap_or_default().to_string_lossy();
    writeln!(
        text,
        "# {}",
        comment(&format!(
            "Arm of {} of the robot {:?}, taken from {file} by",
            counted(joints, ["joint", "joints"]),
            robot.name
        ))
    )?;
    writeln!(text, "#     {}", comment(command))?;
    writeln!(
        text,
        "# against a soft ball, which is there for a start: `haptize place SCENE --mesh FILE --write` puts your own object\n# in its place, and grid and motions there.\n#"
    )?;
    writeln!(text, "# All quantities are SI: m, rad, N, kg, s. Every key is explained in datasets/README.md.")?;
    if !arm.notes.is_empty() {
        writeln!(text, "#\n# Noticed in the robot's file:")?;
        arm.notes.iter().try_for_each(|note| writeln!(text, "# - line {}: {}", note.line, comment(&note.message)))?;
    }
    let title: String = robot.name.chars().filter(|c| c.is_alphanumeric() || matches!(c, ' ' | '_' | '-')).collect();
    writeln!(text, "\nname = \"{}\"", if title.is_empty() { "robot" } else { &title })
}

fn write_object(text: &mut String, practice: &Practice) -> std::fmt::Result {
    heading(text, "The deformable virtual object")?;
    let Practice { centre, radius, .. } = practice;
    writeln!(text, "[object]")?;
    entry(text, "node_mass", "5e-4", "kg")?;
    entry(text, "node_damping", "0.05", "N s/m, against the ground")?;
    writeln!(text, "\n[object.sphere]")?;
    entry(text, "centre", &vector(*centre, 4), "m, in the frame of the robot's root link")?;
    entry(text, "radius", &number(*radius, 4), "m")?;
    entry(text, "edge", &number(0.2 * radius, 4), "m, of its triangles")?;
    writeln!(text, "\n[object.skin]")?;
    entry(text, "tension", "100.0", "N/m")?;
    entry(text, "width", &number(0.35 * radius, 5), "m, over which the dent of a point is rounded")?;
    entry(text, "foundation", "4e4", "N/m^3")
}

fn write_joint(text: &mut String, joint: &ArmJoint, spec: &JointSpec) -> std::fmt::Result {
    let (turns, inertial) = (spec.kind == JointKind::Revolute, joint.inertial);
    writeln!(text, "\n[[proxy.joint]]")?;
    entry(text, "name", &format!("\"{}\"", spec.name), &format!("moves {}", joint.links.join(", ")))?;
    entry(text, "kind", if turns { "\"revolute\"" } else { "\"prismatic\"" }, "")?;
    if let Some(Follows { joint, multiplier, offset }) = &spec.follows {
        let [multiplier, offset] = [multiplier, offset].map(|x| number(*x, 9));
        let table = format!("{{ joint = {joint:?}, multiplier = {multiplier}, offset = {offset} }}");
        entry(text, "follows", &table, &format!("{} = multiplier * that one's + offset", spec.kind.unit()))?;
    }
    entry(text, "origin", &vector(spec.origin, 9), "m")?;
    entry(text, "axis", &vector(spec.axis, 9), "")?;
    entry(text, "limits", &list(&spec.limits, |x| number(*x, 9)), spec.kind.unit())?;
    if inertial.mass > 0.0 {
        entry(text, "mass", &significant(inertial.mass), "kg")?;
        entry(text, "centre_of_mass", &vector(inertial.centre, 6), "m")?;
    }
    let [x, y, z] = inertial.inertia.to_cols_array_2d();
    let (moments, products) = ([x[0], y[1], z[2]], [x[1], x[2], y[2]]);
    // Products that the moments' rounding hides are those of symmetric links that were turned.
    let is_aligned = products.iter().all(|product| product.abs() < 1e-6 * moments.iter().sum::<f64>());
    let numbers = if is_aligned { moments.to_vec() } else { [moments, products].concat() };
    if moments != [0.0; 3] {
        let meaning = if is_aligned { "kg m^2" } else { "kg m^2: xx, yy, zz, xy, xz, yz" };
        entry(text, "inertia", &list(&numbers, |x| significant(*x)), meaning)?;
    }
    let unit = if turns { "kg m^2" } else { "kg" };
    let source = if joint.rotor_inertia.is_some() { "" } else { ", not in the robot's file" };
    if spec.rotor_inertia > 0.0 {
        entry(text, "rotor_inertia", &significant(spec.rotor_inertia), &format!("{unit}, of the actuator{source}"))?;
    }
    if spec.nodes.is_empty() {
        return Ok(());
    }
    writeln!(text, "nodes = [ # m: {} of them", spec.nodes.len())?;
    for pair in spec.nodes.chunks(3) {
        let entries: Vec<String> =
            pair.iter().map(|node| format!("{{ at = {} }},", vector(node.position, 5))).collect();
        writeln!(text, "    {}", entries.join(" "))?;
    }
    writeln!(text, "]")
}

/// Gains for a stiffness and a force at the contact node, in the proportions of a desktop device.
fn write_haptics(text: &mut String, arm: &Arm, proxy: &ProxySpec, press: &Press) -> std::fmt::Result {
    writeln!(
        text,
        "# One number per joint: {TIP_STIFFNESS:.0} N/m and at most {TIP_FORCE:.0} N where the arm meets the ball, \
         through each joint's lever.\n"
    )?;
    writeln!(text, "[haptics]")?;
    let stiffness: Vec<f64> = press.levers.iter().map(|lever| TIP_STIFFNESS * lever * lever).collect();
    let scaled = |factor: f64| list(&stiffness, |k| coarse(factor * k));
    entry(text, "boundary_slope", &scaled(0.75), "N m/rad or N/m")?;
    writeln!(text, "# proxy_damping is left out: as much as the torque needs to be passive.")?;
    entry(text, "coupling_stiffness", &scaled(1.0), "N m/rad or N/m")?;
    entry(text, "coupling_damping", &scaled(5e-4), "N m s/rad or N s/m")?;
    entry(text, "device_damping", &scaled(1.5e-3), "N m s/rad or N s/m")?;
    entry(text, "device_inertia", &scaled(5e-5), "kg m^2 or kg")?;
    let joints = || arm.joints.iter().filter(|joint| joint.follows.is_none());
    let limits: Vec<f64> = (press.levers.iter().zip(joints()))
        .map(|(lever, joint)| (TIP_FORCE * lever).min(joint.effort.unwrap_or(f64::INFINITY)))
        .collect();
    entry(text, "torque_limit", &list(&limits, |x| coarse(*x)), "N m or N")?;
    entry(text, "torque_rate_limit", &list(&limits, |x| coarse(300.0 * x)), "N m/s or N/s")?;
    for (joint, spec) in joints().zip(&proxy.joints) {
        let rated = [
            joint.effort.map(|x| format!("{} {}", coarse(x), spec.kind.effort_unit())),
            joint.velocity.map(|x| format!("{} {}/s", coarse(x), spec.kind.unit())),
        ];
        let rated: Vec<String> = rated.into_iter().flatten().collect();
        if !rated.is_empty() {
            writeln!(text, "# The robot's file allows {} {}.", spec.name, rated.join(" and "))?;
        }
    }
    writeln!(text, "\n[haptics.hand]")?;
    entry(text, "stiffness", &scaled(1.0), "N m/rad or N/m")?;
    entry(text, "damping", &scaled(0.02), "N m s/rad or N s/m")?;
    entry(text, "inertia", &scaled(1e-4), "kg m^2 or kg")
}
