//! `haptize import`: scenes that bake and play as they are.

use super::file;
use crate::common::program::{haptize, json, succeed};
use glam::DVec3;
use haptize::{
    dataset::Dataset,
    object::Object,
    proxy::{Chain, Triangles, shape_triangles},
    scene::{JointKind, LinkForm, MAX_CONTACT_NODES, Rendering, Scene},
};
/// Imports, bakes on the CPU and plays; returns the accounts of the play.
fn felt(robot: &str, tip: &str, spacing: &str) -> serde_json::Value {
    let folder = tempfile::tempdir().unwrap();
    let robot = file(robot).display().to_string();
    succeed(folder.path(), &["import", &robot, "--tip", tip, "--spacing", spacing, "-o", "scene.toml"]);
    let baked = json(folder.path(), &["bake", "scene.toml", "--backend", "cpu", "--measure-error", "0", "--json"]);
    assert_eq!((&baked["unconverged"], &baked["overflowed"]), (&0.into(), &0.into()), "{baked}");
    let (points, contact) = (baked["points"].as_f64().unwrap(), baked["contact_points"].as_f64().unwrap());
    assert!(contact > 0.2 * points && contact < 0.95 * points, "{contact} of {points} configurations touch");
    json(folder.path(), &["play", "scene.haptize", "--motion", "press", "--json"])
}

#[test]
fn imported_arms_bake_and_are_felt_as_they_are() {
    for (robot, tip, spacing) in [
        ("finger.urdf", "distal", "0.005"),
        ("arm.urdf", "probe", "0.008"),
        ("palletiser.urdf", "tool", "0.008"),
        ("palletiser.xml", "tool", "0.008"),
    ] {
        let played = felt(robot, tip, spacing);
        let number = |key: &str| played[key].as_f64().unwrap();
        assert!(played["fault"].is_null() && number("faults") == 0.0, "{played:#}");
        assert!(number("contact_share") > 0.2 && number("contact_share") < 0.9, "{played:#}");
        assert!(number("max_device_torque") > 0.02, "{played:#}");
        assert!(number("max_account_residual") < 1e-10, "{played:#}");
    }
}

#[test]
fn a_joint_that_follows_another_is_told_and_written() {
    let folder = tempfile::tempdir().unwrap();
    let robot = file("palletiser.urdf").display().to_string();
    let told = succeed(folder.path(), &["import", &robot, "--tip", "tool", "-o", "level.toml"]);
    assert!(
        told.lines().any(|line| line.trim_start().starts_with("level ") && line.ends_with(", follows lift")),
        "{told}"
    );
    let text = std::fs::read_to_string(folder.path().join("level.toml")).unwrap();
    let follows =
        "\nfollows = { joint = \"lift\", multiplier = -1.0, offset = 0.1 } # rad = multiplier * that one's + offset\n";
    assert!(text.contains(follows), "{text}");
}

#[test]
fn the_scene_reads_as_if_a_person_had_written_it() {
    let folder = tempfile::tempdir().unwrap();
    let robot = file("finger.urdf").display().to_string();
    let told = haptize(folder.path(), &["import", &robot, "--tip", "distal", "--spacing", "0.006"]);
    let notes = String::from_utf8_lossy(&told.stderr).into_owned();
    assert!(told.status.success() && notes.contains("no <collision>") && notes.contains("<inertial>"), "{notes}");
    let path = folder.path().join("finger.toml");
    let text = std::fs::read_to_string(&path).unwrap();
    for expected in [
        "#     haptize import finger.urdf --tip distal --spacing 0.006\n",
        "name = \"knuckle_flex\"                   # moves proximal\n",
        "limits = [-0.5, 1.2]                    # rad\n",
        "origin = [0.1, 0.0, 0.0]                # m\n",
        "axis = [0.0, 1.0, 0.0]\n",
        "# - line 3: link \"proximal\" has no <collision>",
        "# The robot's file allows tip 1.0 N m and 5.0 rad/s.\n",
    ] {
        assert!(text.contains(expected), "{expected:?} is not in\n{text}");
    }
    assert!(text.lines().all(|line| line.chars().count() < 240 && !line.contains('\t')));
    let scene = Scene::load(&path).unwrap();
    assert_eq!(scene.proxy.joints.iter().map(|joint| joint.kind).collect::<Vec<_>>(), [JointKind::Revolute; 2]);
    // The ball is touched by the last link in the motion and is free of the arm before it.
    let object = Object::build(&scene.object).unwrap();
    let chain = Chain::new(&scene.proxy);
    let inside = |q: &[f64]| {
        let mut pose = chain.new_pose();
        chain.pose(q, &mut pose);
        let centre = object.rest.iter().sum::<glam::DVec3>() / object.rest.len() as f64;
        pose.nodes.iter().filter(|node| node.distance(centre) < 0.99 * object.rest[0].distance(centre)).count()
    };
    let press = &scene.motion.press;
    assert_eq!(inside(&press[0].q), 0);
    assert!(inside(&press[2].q) > 0);
    // What is there is not written over.
    let again = haptize(folder.path(), &["import", &robot, "--tip", "distal", "--spacing", "0.006"]);
    assert!(!again.status.success() && String::from_utf8_lossy(&again.stderr).contains("there is a file already"));
    assert_eq!(std::fs::read_to_string(&path).unwrap(), text);
}

#[test]
fn packages_are_found_above_the_file_or_where_the_user_says() {
    let folder = tempfile::tempdir().unwrap();
    let robot = folder.path().join("alone.urdf");
    std::fs::copy(file("arm.urdf"), &robot).unwrap();
    let refused = haptize(folder.path(), &["import", "alone.urdf", "--tip", "probe", "-o", "x.toml"]);
    let message = String::from_utf8_lossy(&refused.stderr).into_owned();
    assert!(
        !refused.status.success() && message.contains("--package-path") && message.contains("alone.urdf:70:"),
        "{message}"
    );
    assert!(!folder.path().join("x.toml").exists());
    let packages = file("").parent().unwrap().display().to_string();
    let arguments =
        ["import", "alone.urdf", "--tip", "probe", "--package-path", &packages, "--spacing", "0.01", "-o", "x.toml"];
    succeed(folder.path(), &arguments);
    // A folder of another name is the package that its package.xml names.
    let meshes = folder.path().join("work/meshes");
    std::fs::create_dir_all(&meshes).unwrap();
    std::fs::write(folder.path().join("work/package.xml"), "<package><name> robots </name></package>").unwrap();
    for mesh in std::fs::read_dir(file("meshes")).unwrap() {
        let mesh = mesh.unwrap();
        std::fs::copy(mesh.path(), meshes.join(mesh.file_name())).unwrap();
    }
    std::fs::rename(&robot, folder.path().join("work/alone.urdf")).unwrap();
    succeed(folder.path(), &["import", "work/alone.urdf", "--tip", "probe", "--spacing", "0.01", "-o", "y.toml"]);
}

/// An arm of seven joints that turn in turn about two axes, a rod on each link.
fn of_seven_joints() -> String {
    let mut text = "<robot name=\"seven\"><link name=\"l0\"/>".to_owned();
    for joint in 1..=7 {
        let (before, axis) = (joint - 1, if joint % 2 == 0 { "0 1 0" } else { "0 0 1" });
        text += &format!(
            "<joint name=\"j{joint}\" type=\"revolute\"><parent link=\"l{before}\"/><child link=\"l{joint}\"/>\
             <origin xyz=\"0 0 0.12\"/><axis xyz=\"{axis}\"/><limit lower=\"-2\" upper=\"2\" effort=\"20\" velocity=\"2\"/>\
             </joint><link name=\"l{joint}\"><inertial><mass value=\"1\"/><inertia ixx=\"0.01\" iyy=\"0.01\" izz=\"0.01\"/>\
             </inertial><collision><origin xyz=\"0 0 0.05\"/><geometry><cylinder radius=\"0.03\" length=\"0.1\"/></geometry>\
             </collision></link>"
        );
    }
    text + "</robot>"
}

#[test]
fn an_arm_of_seven_joints_is_felt_without_a_grid_and_its_nodes_fit_by_themselves() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("seven.urdf"), of_seven_joints()).unwrap();
    let imported = json(folder.path(), &["import", "seven.urdf", "--tip", "l7", "--json"]);
    let nodes: u64 = imported["nodes"].as_array().unwrap().iter().map(|count| count.as_u64().unwrap()).sum();
    // 5 mm apart there are some 4,900.
    assert!(nodes > MAX_CONTACT_NODES as u64 / 2 && nodes <= MAX_CONTACT_NODES as u64, "{imported}");
    let text = std::fs::read_to_string(folder.path().join("seven.toml")).unwrap();
    assert!(!text.contains("[grid]") && !text.contains("--spacing"), "{text}");
    let played = json(folder.path(), &["play", "seven.toml", "--motion", "press", "--seconds", "2.2", "--json"]);
    let number = |key: &str| played[key].as_f64().unwrap();
    assert!(played["fault"].is_null() && number("contact_share") > 0.02, "{played:#}");
    assert!(number("max_account_residual") < 1e-10, "{played:#}");
    let refused = haptize(folder.path(), &["bake", "seven.toml"]);
    let message = String::from_utf8_lossy(&refused.stderr).into_owned();
    assert!(message.contains("7 joints is too many for a grid") && message.contains("haptize play"), "{message}");
}

/// Greatest distance between a corner of a shape and a contact node that was put on it (m): corners of meshes carry
/// nodes, five decimals of which stand in the scene, and a surface has 65,535 steps within its bounds of some
/// centimetres.
const ON_CORNER: f64 = 2e-5;

#[test]
fn links_are_drawn_where_their_contact_nodes_are() {
    let folder = tempfile::tempdir().unwrap();
    let robot = file("arm.urdf").display().to_string();
    succeed(folder.path(), &["import", &robot, "--tip", "probe", "--spacing", "0.008", "-o", "scene.toml"]);
    let scene = Rendering::load(folder.path().join("scene.toml")).unwrap();
    let of = |joint: usize| scene.shapes.iter().filter(|shape| shape.joint == Some(joint)).collect::<Vec<_>>();
    assert!(scene.shapes.iter().any(|shape| shape.joint.is_none()), "the base stands still");
    let names: Vec<&str> = scene.proxy.joints.iter().map(|joint| joint.name.as_str()).collect();
    let bend = names.iter().position(|name| *name == "bend").unwrap();
    assert!(of(bend).iter().any(|shape| matches!(shape.form, LinkForm::Cylinder { .. })));
    assert!(of(bend).iter().any(|shape| matches!(shape.form, LinkForm::Surface(_))), "the mesh of the hand");
    for (number, joint) in scene.proxy.joints.iter().enumerate() {
        let surfaces: Vec<Triangles> = of(number).into_iter().map(shape_triangles).collect();
        assert_eq!(surfaces.is_empty(), joint.nodes.is_empty(), "{}", joint.name);
        // Boxes and meshes: their corners are nodes, unless another node is nearer than the spacing.
        for (shape, (nodes, _)) in of(number).into_iter().zip(&surfaces) {
            if !matches!(shape.form, LinkForm::Sphere(_) | LinkForm::Cylinder { .. }) {
                let nearest =
                    |corner: &DVec3| joint.nodes.iter().map(|node| node.position.distance(*corner)).fold(9.0, f64::min);
                assert!(nodes.iter().all(|corner| nearest(corner) < 0.008 + ON_CORNER), "{}", joint.name);
                assert!(nodes.iter().any(|corner| nearest(corner) < ON_CORNER), "{}", joint.name);
            }
        }
    }
}

#[test]
fn what_is_drawn_changes_nothing_that_is_solved() {
    let folder = tempfile::tempdir().unwrap();
    let robot = file("finger.urdf").display().to_string();
    succeed(folder.path(), &["import", &robot, "--tip", "distal", "--spacing", "0.006", "-o", "scene.toml"]);
    let text = std::fs::read_to_string(folder.path().join("scene.toml")).unwrap();
    let bare = &text[..text.find("[[proxy.shape]]").unwrap()];
    std::fs::write(folder.path().join("bare.toml"), bare).unwrap();
    for name in ["scene", "bare"] {
        succeed(folder.path(), &["bake", &format!("{name}.toml"), "--backend", "cpu", "--measure-error", "0"]);
    }
    let [drawn, plain] =
        ["scene", "bare"].map(|name| Dataset::load(&folder.path().join(format!("{name}.haptize"))).unwrap());
    assert_eq!(drawn.torque[..], plain.torque[..]);
    // The dataset stands alone.
    assert!(!Rendering::parse(&drawn.scene, "scene").unwrap().shapes.is_empty());
    assert!(Rendering::parse(&plain.scene, "scene").unwrap().shapes.is_empty());
    // The figure of the object shows the link that presses it: other pixels than a rod.
    for name in ["scene", "bare"] {
        succeed(folder.path(), &["play", &format!("{name}.haptize"), "-o", name]);
    }
    let [with, without] =
        ["scene", "bare"].map(|name| std::fs::read(folder.path().join(name).join("object.png")).unwrap());
    assert_ne!(with, without);
}

#[test]
fn shapes_that_are_none_are_refused_with_their_line_and_the_remedy() {
    let folder = tempfile::tempdir().unwrap();
    let robot = file("finger.urdf").display().to_string();
    succeed(folder.path(), &["import", &robot, "--tip", "distal", "--spacing", "0.006", "-o", "scene.toml"]);
    let text = std::fs::read_to_string(folder.path().join("scene.toml")).unwrap();
    for (shape, expected) in [
        ("joint = \"elbow\"\nsphere = 0.1", "name one of"),
        ("sphere = 0.1\nbox = [1.0, 1.0, 1.0]", "one of box"),
        ("at = [0.0, 0.0, 0.0]", "one of box"),
        ("sphere = -1.0", "sphere"),
        ("box = [1.0, 0.0, 1.0]", "must be positive"),
        ("cylinder = { radius = 0.1 }", "length"),
        ("cone = 1.0", "unknown field"),
        ("surface = { from = [0.0, 0.0, 0.0], to = [1.0, 1.0, 1.0], data = \"!\" }", "import the robot again"),
    ] {
        let error = Scene::parse(&format!("{text}\n[[proxy.shape]]\n{shape}\n"), "s.toml").unwrap_err().to_string();
        assert!(error.contains(expected) && error.contains("s.toml:"), "{shape}: {error}");
    }
}
