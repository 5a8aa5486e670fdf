//! MJCF: classes, frames, joints beside their bodies' origins and couplings, against MuJoCo 4.0.0, and what is refused.

use super::file;
use glam::DVec3;
use haptize::{
    proxy::Chain,
    robot::{Arm, Geometry, Lock, Robot, sample, write_scene},
    scene::{JointKind, Scene},
};

/// The chain to `tip` of `text`, with one finger held; the other follows.
fn arm(text: &str, tip: &str) -> Result<(Robot, Arm), String> {
    let robot = Robot::parse(text.to_owned(), file("crane.xml")).map_err(|error| error.to_string())?;
    let held = [Lock { joint: "finger".into(), value: 0.012 }];
    let arm = Arm::new(&robot, tip, &held).map_err(|error| error.to_string())?;
    Ok((robot, arm))
}

fn crane() -> String {
    std::fs::read_to_string(file("crane.xml")).unwrap()
}

/// A configuration (rad, m), and from MuJoCo: the centres of the capsule, the box and the spheres of the left and the
/// right finger (m), and the upper triangle of the inertia without actuators (kg m^2, kg m, kg).
type InMujoco = ([f64; 3], [[f64; 3]; 4], [f64; 6]);

const CONFIGURATIONS: [InMujoco; 2] = [
    (
        [0.4, 0.01, 0.3],
        [
            [0.119406660984, -0.15386803456, 0.450942970283],
            [0.06755143391, -0.139070240881, 0.515354340975],
            [-0.006927353276, -0.173727796228, 0.554210829703],
            [-0.005848712832, -0.110524526806, 0.561221055738],
        ],
        [5.429878069e-3, -2.7223201579e-2, 3.559201564e-4, 0.94, -2.7848084494e-2, 3.9042016613e-3],
    ),
    (
        [-0.7, -0.015, 1.2],
        [
            [0.109971851044, -0.158828368094, 0.433645734295],
            [0.110255261386, -0.122416603541, 0.447144940484],
            [0.039957650206, -0.070660031318, 0.421894877245],
            [0.09441244612, -0.038431439797, 0.415495417072],
        ],
        [2.8851100616e-3, -1.7591704586e-2, 1.365357413e-4, 0.94, -1.6494504476e-2, 3.9042016613e-3],
    ),
];

/// Armature of the joints' class (kg m^2 or kg).
const ARMATURE: f64 = 0.02;

#[test]
fn bodies_are_where_mujoco_puts_them_and_as_heavy() {
    let (robot, arm) = arm(&crane(), "hand").unwrap();
    let names: Vec<&str> = arm.joints.iter().map(|joint| joint.name.as_str()).collect();
    assert_eq!(names, ["yaw", "lift", "bend"]);
    let kinds: Vec<JointKind> = arm.joints.iter().map(|joint| joint.kind).collect();
    assert_eq!(kinds, [JointKind::Revolute, JointKind::Prismatic, JointKind::Revolute]);
    assert_eq!(arm.joints[1].limits, [-0.02, 0.03]);
    let degrees = arm.joints[2].limits.map(f64::to_degrees);
    assert!((degrees[0] + 80.0).abs() < 1e-9 && (degrees[1] - 100.0).abs() < 1e-9, "{degrees:?}");
    assert_eq!((arm.joints[2].effort, arm.joints[2].rotor_inertia), (Some(7.0), Some(ARMATURE)));
    for what in ["ellipsoid is left out", "type plane is left out"] {
        let links = robot.links.iter().flat_map(|link| &link.left_out);
        assert!(links.into_iter().any(|(_, reason)| reason.contains(what)), "{what}");
    }
    let nodes = sample(&robot, &arm, Some(0.006), None).unwrap();
    let text = write_scene(&robot, &arm, &nodes, &[], "haptize import").unwrap();
    let chain = Chain::new(&Scene::parse(&text, "crane.toml").unwrap().proxy);
    for (q, centres, inertia) in CONFIGURATIONS {
        let mut pose = chain.new_pose();
        chain.pose(&q, &mut pose);
        let placed = |link: usize, is_it: fn(&Geometry) -> bool| -> Vec<DVec3> {
            let shapes = arm.joints[link].shapes.iter().filter(|shape| is_it(&shape.geometry));
            shapes.map(|shape| pose.origins[link] + pose.rotations[link] * shape.place.translation).collect()
        };
        let mut found = placed(1, |geometry| matches!(geometry, Geometry::Capsule { .. }));
        found.extend(placed(2, |geometry| matches!(geometry, Geometry::Box(_))));
        found.extend(placed(2, |geometry| matches!(geometry, Geometry::Sphere(_))));
        assert_eq!(found.len(), 4);
        for centre in centres.map(DVec3::from_array) {
            assert!(found.iter().any(|place| place.distance(centre) < 1e-8), "{centre} is not in {found:?}");
        }
        let matrix = chain.inertia(&pose);
        for ((i, j), expected) in [(0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)].into_iter().zip(inertia) {
            let own = matrix[i][j] - if i == j { ARMATURE } else { 0.0 };
            // The scene's file has six digits.
            assert!((own - expected).abs() < 1e-5 * expected.abs().max(1e-2), "{i} {j}: {own} for {expected}");
        }
    }
}

#[test]
fn what_is_not_read_is_refused_at_its_place() {
    let crane = crane();
    for (from, to, expected) in [
        ("<worldbody>", "<worldbody><include file=\"x.xml\"/>", "included files are not read"),
        ("eulerseq=\"zyx\"", "eulerseq=\"zyw\"", "eulerseq must be three"),
        ("angle=\"degree\"", "coordinate=\"global\"", "global coordinates"),
        ("mesh=\"tip\"", "mesh=\"top\"", "no mesh \"top\""),
        ("axis=\"0 0 2\"", "axis=\"0 0 0\"", "the axis zero"),
        ("name=\"bend\"", "name=\"yaw\"", "two elements are called \"yaw\""),
        ("name=\"bend\"", "type=\"ball\" name=\"bend\"", "floating"),
        ("range=\"-0.02 0.03\"", "limited=\"false\"", "no limits"),
        ("size=\"0.012\"", "size=\"0\"", "a size is missing or zero"),
        ("mass=\"0.3\"", "mass=\"-0.3\"", "must be zero or positive"),
        ("fullinertia=\"2e-3", "fullinertia=\"-2e-3", "negative eigenvalue"),
        ("joint1=\"other_finger\"", "joint1=\"thumb\"", "no joint \"thumb\""),
        ("<body name=\"arm\"", "<attach model=\"x\"/><body name=\"arm\"", "<attach> is not read"),
        ("quat=\"0.9 0.1 -0.2 0.3\"", "quat=\"0 0 0 0\"", "quat is zero"),
        ("zaxis=\"0.2 0.1 1\"", "zaxis=\"1e9 0 0\"", "no number above"),
    ] {
        assert!(crane.contains(from), "{from}");
        let error = arm(&crane.replacen(from, to, 1), "hand").unwrap_err();
        assert!(error.contains(expected) && error.contains("crane.xml:"), "{to}: {error}");
    }
    let polynomial = crane.replace("-0.8 0 0 0", "-0.8 0.1 0 0");
    let notes = arm(&polynomial, "right").unwrap().1.notes;
    assert!(notes.iter().any(|note| note.message.contains("by a polynomial")), "{notes:?}");
}
