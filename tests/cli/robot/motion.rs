//! Kinematics and inertia of the imported chain, against the links as the file places them.

use super::{arm, file};
use glam::{DMat3, DVec3};
use haptize::{
    JointVector,
    proxy::{Chain, Pose},
    robot::{Arm, Geometry, Note, sample, write_scene},
    scene::{JointKind, Scene},
};
use std::f64::consts::FRAC_PI_2;

/// A rotation and a translation.
type Frame = (DMat3, DVec3);

fn times((r, p): Frame, (s, t): Frame) -> Frame {
    (r * s, p + r * t)
}

/// An origin as URDF defines it: rotations about the fixed axes x, y and z, one after the other.
fn origin(xyz: [f64; 3], rpy: [f64; 3]) -> Frame {
    let [x, y, z] = rpy;
    (DMat3::from_rotation_z(z) * DMat3::from_rotation_y(y) * DMat3::from_rotation_x(x), DVec3::from_array(xyz))
}

fn turn(axis: [f64; 3], angle: f64) -> Frame {
    (DMat3::from_axis_angle(DVec3::from_array(axis), angle), DVec3::ZERO)
}

/// Frames of column, carriage, arm, hand and probe of `arm.urdf`, written down from the file.
fn frames(q: &[f64]) -> [Frame; 5] {
    let base = origin([0.1, -0.2, 0.3], [0.0, 0.0, FRAC_PI_2]);
    let column = times(times(base, origin([0.0, 0.0, 0.1], [0.0; 3])), turn([0.0, 0.0, 1.0], q[0]));
    let lift = times(column, origin([0.02, 0.01, 0.1], [0.3, -0.2, 0.1]));
    let carriage = times(lift, (DMat3::IDENTITY, q[1] * DVec3::new(0.6, 0.0, 0.8)));
    let arm = times(times(carriage, origin([0.05, 0.0, 0.0], [0.0, 0.5, 0.0])), turn([0.0, 1.0, 0.0], q[2]));
    let hand = times(arm, origin([0.12, 0.0, 0.0], [0.7, 0.0, -0.2]));
    let probe = times(times(hand, origin([0.03, 0.0, 0.0], [0.0; 3])), turn([1.0, 0.0, 0.0], q[3]));
    [column, carriage, arm, hand, probe]
}

/// The link of the chain that carries each of these.
const CARRIERS: [usize; 5] = [0, 1, 2, 2, 3];

/// The scene of `arm.urdf`.
fn scene() -> Scene {
    let (robot, arm) = arm(&std::fs::read_to_string(file("arm.urdf")).unwrap(), "probe", &[]).unwrap();
    let nodes = sample(&robot, &arm, Some(0.006), None).unwrap();
    let text = write_scene(&robot, &arm, &nodes, &[], "haptize import").unwrap();
    Scene::parse(&text, "arm.toml").unwrap()
}

fn configurations() -> impl Iterator<Item = [f64; 4]> {
    (0..40).map(|k| {
        let k = f64::from(k);
        [2.9 * (1.1 * k).sin(), 0.02 + 0.07 * (1.7 * k).sin(), 0.1 + 1.2 * (2.3 * k).cos(), (0.9 * k).cos()]
    })
}

fn posed(chain: &Chain, q: &[f64]) -> Pose {
    let mut pose = chain.new_pose();
    chain.pose(q, &mut pose);
    pose
}

/// The scene's file gives nine decimals.
const ROUNDING: f64 = 2e-8;

#[test]
fn links_are_where_the_file_puts_them() {
    let chain = Chain::new(&scene().proxy);
    let kinds: Vec<JointKind> = chain.joints.iter().map(|joint| joint.kind).collect();
    use JointKind::{Prismatic, Revolute};
    assert_eq!(kinds, [Revolute, Prismatic, Revolute, Revolute]);
    let rest = frames(&[0.0; 4]);
    for q in configurations() {
        let pose = posed(&chain, &q);
        for (((rotation, position), rest), link) in frames(&q).into_iter().zip(rest).zip(CARRIERS) {
            // Link frames of a scene are parallel to the world at rest.
            let turned = rotation * rest.0.transpose();
            let difference = turned - pose.rotations[link];
            assert!(difference.to_cols_array().iter().all(|x| x.abs() < ROUNDING), "{difference}");
            // The frame's origin, carried by the scene's link.
            let carried = pose.origins[link] + pose.rotations[link] * (rest.1 - posed(&chain, &[0.0; 4]).origins[link]);
            assert!(carried.distance(position) < ROUNDING, "{carried} for {position}");
        }
    }
}

#[test]
fn kinetic_energy_is_that_of_the_files_links() {
    const STEP: f64 = 1e-5;
    // Mass, centre and moments in the frame of the link, and the column's turned by its <origin>.
    let diagonal = |x: f64, y: f64, z: f64| DMat3::from_diagonal(DVec3::new(x, y, z));
    let column = DMat3::from_cols_array(&[2e-3, 1e-4, 0.0, 1e-4, 1e-3, 0.0, 0.0, 0.0, 5e-4]);
    let turned = DMat3::from_rotation_z(0.4);
    let links: [(f64, DVec3, DMat3); 5] = [
        (0.5, DVec3::Z * 0.05, turned * column * turned.transpose()),
        (0.2, DVec3::ZERO, diagonal(1e-4, 2e-4, 2.5e-4)),
        (0.3, DVec3::X * 0.06, diagonal(1e-5, 4e-4, 4e-4)),
        (0.1, DVec3::Y * 0.01, diagonal(1e-5, 2e-5, 2e-5)),
        (0.05, DVec3::new(0.02, 0.0, 0.005), diagonal(2e-6, 1e-5, 1e-5)),
    ];
    let chain = Chain::new(&scene().proxy);
    for (number, q) in configurations().enumerate() {
        let rate = [0.8, -0.3, 1.1, 2.0].map(|x| x * (number as f64).cos());
        let at = |t: f64| frames(&std::array::from_fn::<f64, 4, _>(|j| q[j] + t * rate[j]));
        let (before, now, after) = (at(-STEP), at(0.0), at(STEP));
        let mut energy = 0.0;
        for (k, (mass, centre, inertia)) in links.iter().enumerate() {
            let centre = |(r, p): Frame| p + r * *centre;
            let velocity = (centre(after[k]) - centre(before[k])) / (2.0 * STEP);
            let cross = now[k].0.transpose() * (after[k].0 - before[k].0) * (0.5 / STEP);
            let spin = DVec3::new(cross.y_axis.z, cross.z_axis.x, cross.x_axis.y);
            energy += mass * velocity.length_squared() + (*inertia * spin).dot(spin);
        }
        energy += chain.joints.iter().zip(rate).map(|(joint, rate)| joint.rotor_inertia * rate * rate).sum::<f64>();
        let matrix = chain.inertia(&posed(&chain, &q));
        let found: f64 =
            (0..4).flat_map(|i| (0..4).map(move |j| (i, j))).map(|(i, j)| rate[i] * matrix[i][j] * rate[j]).sum();
        // Six digits of each mass and moment.
        assert!((found / energy - 1.0).abs() < 2e-5, "{found} for {energy}");
    }
}

#[test]
fn contact_nodes_lie_on_the_shapes() {
    let read = |name: &str| std::fs::read_to_string(file(name)).unwrap();
    let arms = [
        arm(&read("arm.urdf"), "probe", &[]).unwrap(),
        arm(&read("crane.xml"), "hand", &[("yaw", 0.0), ("finger", 0.01)]).unwrap(),
    ];
    for (robot, arm) in arms {
        let nodes = sample(&robot, &arm, Some(0.006), None).unwrap();
        let counts: Vec<usize> = nodes.of_joints.iter().map(Vec::len).collect();
        assert!(counts.iter().all(|count| *count > 10), "{counts:?}");
        lie_on_the_shapes(&arm, &nodes.of_joints);
    }
}

fn lie_on_the_shapes(arm: &Arm, of_joints: &[Vec<DVec3>]) {
    for (joint, nodes) in arm.joints.iter().zip(of_joints) {
        for node in nodes {
            let off = |shape: &haptize::robot::Placed| {
                let x = shape.place.inverse().transform_point3(*node);
                match &shape.geometry {
                    Geometry::Box(size) => {
                        let d = x.abs() - 0.5 * *size;
                        d.max(DVec3::ZERO).length() + d.max_element().min(0.0)
                    }
                    Geometry::Sphere(radius) => x.length() - radius,
                    Geometry::Capsule { radius, length } => {
                        let half = 0.5 * length;
                        (x - x.z.clamp(-half, half) * DVec3::Z).length() - radius
                    }
                    Geometry::Cylinder { radius, length } => {
                        let d = glam::DVec2::new(x.truncate().length() - radius, x.z.abs() - 0.5 * length);
                        d.max(glam::DVec2::ZERO).length() + d.max_element().min(0.0)
                    }
                    // The pyramid of tip.obj: its base at 0, its apex, mirrored by the scale, at -2.
                    Geometry::Mesh { scale, .. } => {
                        let y = x / *scale;
                        let side = (y.x.abs().max(y.y.abs()) - (1.0 - 0.5 * y.z)) * scale.x;
                        side.abs().min((y.z * scale.z).abs())
                    }
                }
            };
            let nearest = joint.shapes.iter().map(|shape| off(shape).abs()).fold(f64::INFINITY, f64::min);
            assert!(nearest < 1e-4, "{}: {node} is {nearest} m off", joint.name);
        }
    }
}

#[test]
fn locked_joints_are_part_of_the_links() {
    let text = std::fs::read_to_string(file("arm.urdf")).unwrap();
    let whole = Chain::new(&scene().proxy);
    let (_, arm) = arm(&text, "probe", &[("lift", 0.06), ("camera_tilt", 0.0)]).unwrap();
    assert_eq!(arm.joints.iter().map(|joint| joint.name.as_str()).collect::<Vec<_>>(), ["yaw", "bend", "roll"]);
    assert!(arm.joints[1].links.contains(&"camera".to_owned()), "a branch whose joint is locked is carried along");
    assert!(!arm.notes.iter().any(|note| note.message.contains("camera_tilt")));
    let origins: DVec3 = arm.joints.iter().take(2).map(|joint| joint.origin).sum();
    let expected = posed(&whole, &[0.0, 0.06, 0.0, 0.0]).origins[2];
    assert!(origins.distance(expected) < ROUNDING);
    assert!((arm.joints[0].inertial.mass - 0.7).abs() < 1e-12, "the carriage belongs to the column");
}

#[test]
fn what_the_file_lacks_is_noted() {
    let (_, arm) = arm(&std::fs::read_to_string(file("arm.urdf")).unwrap(), "probe", &[]).unwrap();
    for (expected, line) in [
        ("joint \"yaw\" turns without end", 13),
        ("axis of joint \"yaw\" is no unit vector", 13),
        ("joint \"camera_tilt\" moves beside the chain: link \"camera\"", 87),
        ("link \"hand\" has no <collision>", 64),
    ] {
        let found: Vec<&Note> = arm.notes.iter().filter(|note| note.message.contains(expected)).collect();
        assert_eq!(found.len(), 1, "{expected}: {:?}", arm.notes);
        assert_eq!(found[0].line, line);
    }
    assert_eq!(arm.base, ["world", "base"]);
    assert_eq!(JointVector::from_slice(&arm.joints[1].limits), JointVector::from_slice(&[-0.05, 0.1]));
}

#[test]
fn shapes_of_no_size_are_noted_and_left_out() {
    let text = std::fs::read_to_string(file("arm.urdf")).unwrap();
    let whole = arm(&text, "probe", &[]).unwrap().1;
    for empty in ["<box size=\"0 0 0\"/>", "<cylinder radius=\"0\" length=\"0.0\"/>", "<sphere radius=\"0\"/>"] {
        let link = "<link name=\"probe\">";
        let with = text.replace(link, &format!("{link}<collision><geometry>{empty}</geometry></collision>"));
        let (_, arm) = arm(&with, "probe", &[]).unwrap();
        let found: Vec<&Note> = arm.notes.iter().filter(|note| note.message.contains("no size")).collect();
        assert!(found.len() == 1 && found[0].message.contains("\"probe\""), "{:?}", arm.notes);
        let shapes = |arm: &Arm| arm.joints.iter().map(|joint| joint.shapes.len()).sum::<usize>();
        assert_eq!(shapes(&arm), shapes(&whole));
    }
}

/// One side of a parallelogram follows the other: in a chain through that side it is a joint like any other.
#[test]
fn a_joint_that_follows_one_beside_the_chain_moves_by_itself() {
    let text = std::fs::read_to_string(file("arm.urdf")).unwrap();
    let limits = "<limit lower=\"-1.2\" upper=\"1.5\" effort=\"5\" velocity=\"3\"/>";
    let follows = |leader: &str| text.replace(limits, &format!("{limits}<mimic joint=\"{leader}\"/>"));
    let (_, followed) = arm(&follows("camera_tilt"), "probe", &[]).unwrap();
    assert_eq!(followed.joints.len(), 4);
    assert!(followed.notes.iter().any(|note| note.message.contains("follows \"camera_tilt\"")), "{:?}", followed.notes);
}

/// The tool of a palletiser stays level, in URDF and in MJCF: two coordinates move three links.
#[test]
fn a_joint_that_follows_one_of_the_chain_moves_with_it() {
    for name in ["palletiser.urdf", "palletiser.xml"] {
        let (robot, arm) = arm(&std::fs::read_to_string(file(name)).unwrap(), "tool", &[]).unwrap();
        let nodes = sample(&robot, &arm, Some(0.02), None).unwrap();
        let text = write_scene(&robot, &arm, &nodes, &[], "haptize import").unwrap();
        let scene = Scene::parse(&text, "palletiser.toml").unwrap();
        let names: Vec<&str> = scene.proxy.joints.iter().map(|joint| joint.name.as_str()).collect();
        assert_eq!((names, scene.grid.axes.len()), (vec!["yaw", "lift"], 2), "{name}");
        // By its own limits the tool lets the beam go from 0.1 - 2 to 0.1 + 0.5.
        assert_eq!(scene.proxy.joints[1].limits, [-1.0, 0.6], "{name}");
        let chain = Chain::new(&scene.proxy);
        for [yaw, lift] in [[0.0, 0.0], [0.7, -0.9], [-1.4, 0.55]] {
            let pose = posed(&chain, &[yaw, lift]);
            let turned = DMat3::from_rotation_z(yaw);
            let level = turned * DMat3::from_rotation_y(0.1);
            let end = DVec3::new(0.05, 0.0, 0.2) + DMat3::from_rotation_y(lift) * DVec3::X * 0.2;
            assert!((pose.rotations[2] - level).to_cols_array().iter().all(|x| x.abs() < 1e-15), "{name}");
            assert!(pose.origins[2].distance(turned * end) < 1e-15, "{name}");
        }
    }
}

/// Of two joints that follow one beside the chain, the outer follows the inner; one that follows by no multiple is held.
#[test]
fn joints_that_follow_the_same_one_move_together() {
    let text = std::fs::read_to_string(file("arm.urdf")).unwrap();
    let (bend, roll) =
        ("<limit lower=\"-1.2\" upper=\"1.5\" effort=\"5\" velocity=\"3\"/>", "<limit lower=\"-1\" upper=\"1\"/>");
    let with = |of_bend: &str, of_roll: &str| {
        let mimic = |limits: &str, of: &str| format!("{limits}<mimic joint={of}/>");
        text.replace(bend, &mimic(bend, of_bend)).replacen(roll, &mimic(roll, of_roll), 1)
    };
    let camera = "\"camera_tilt\" multiplier=\"-2\" offset=\"0.1\"";
    let (_, together) = arm(&with(camera, "\"camera_tilt\" offset=\"0.5\""), "probe", &[]).unwrap();
    let mimic = together.joints[3].follows.as_ref().unwrap();
    // roll = camera + 0.5, and camera = (bend - 0.1) / -2.
    assert_eq!((mimic.joint.as_str(), mimic.multiplier), ("bend", -0.5));
    assert!((mimic.offset - 0.55).abs() < 1e-15 && together.joints[2].follows.is_none());
    let held = arm(&with("\"lift\" multiplier=\"0\" offset=\"0.3\"", "\"bend\""), "probe", &[]).unwrap().1;
    assert_eq!(held.joints.len(), 2);
    let circle = arm(&with("\"roll\"", "\"bend\""), "probe", &[]).unwrap_err();
    assert!(circle.to_string().contains("follows itself"), "{circle}");
}

/// A joint that follows a locked one, and one that follows that in turn, are where the file's affine functions put them.
#[test]
fn joints_that_follow_a_locked_one_are_held_with_it() {
    let text = std::fs::read_to_string(file("arm.urdf")).unwrap();
    let bend = "<limit lower=\"-1.2\" upper=\"1.5\" effort=\"5\" velocity=\"3\"/>";
    let roll = "<limit lower=\"-1\" upper=\"1\"/>";
    let chained = text
        .replace(bend, &format!("{bend}<mimic joint=\"lift\" multiplier=\"-4\" offset=\"0.3\"/>"))
        .replace(roll, &format!("{roll}<mimic joint=\"bend\"/>"));
    let bodies = |arm: &Arm| arm.joints.iter().map(|joint| (joint.name.clone(), joint.inertial)).collect::<Vec<_>>();
    let held = arm(&chained, "probe", &[("lift", 0.05)]).unwrap().1;
    let (bend, roll) = (-4.0 * 0.05 + 0.3, -4.0 * 0.05 + 0.3);
    let one_by_one = arm(&text, "probe", &[("lift", 0.05), ("bend", bend), ("roll", roll)]).unwrap().1;
    assert_eq!(held.joints.len(), 1);
    assert_eq!(format!("{:?}", bodies(&held)), format!("{:?}", bodies(&one_by_one)));
    // A lock of its own goes before.
    let own = arm(&chained, "probe", &[("lift", 0.05), ("roll", -0.4)]).unwrap().1;
    let other = arm(&text, "probe", &[("lift", 0.05), ("bend", bend), ("roll", -0.4)]).unwrap().1;
    assert_eq!(format!("{:?}", bodies(&own)), format!("{:?}", bodies(&other)));
    assert_ne!(format!("{:?}", bodies(&own)), format!("{:?}", bodies(&held)));
}
