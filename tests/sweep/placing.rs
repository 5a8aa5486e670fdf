//! An arm before an object: what `place` finds touches, and what it says of an object out of reach would mend it.

use crate::{
    common::program::{command, message},
    fixture::Folder,
};
use glam::DVec3;
use haptize::{
    contact::{Model, Proximity},
    object::Object,
    proxy::Chain,
    scene::Scene,
    sweep::Placing,
};
use serde_json::Value;

/// A planar arm of two links on a turntable, with a ball of 5 mm at its tip, and a soft ball within its reach.
const SCENE: &str = r#"# My own arm.
[object]
sphere = { radius = 0.04, edge = 0.01, centre = [0.3, 0.1, 0.05] }
skin = { tension = 100.0, width = 0.03, foundation = 4e4 } # as I like it
[contact]
stiffness = 200.0
[[proxy.joint]]
name = "turn"
kind = "revolute"
axis = [0, 0, 1]
limits = [-3.0, 3.0]
[[proxy.joint]]
name = "shoulder"
origin = [0, 0, 0.1]
kind = "revolute"
axis = [0, 1, 0]
limits = [-1.5, 1.5]
nodes = [{ at = [0.1, 0, 0] }, { at = [0.2, 0, 0] }]
[[proxy.joint]]
name = "elbow"
origin = [0.25, 0, 0]
kind = "revolute"
axis = [0, 1, 0]
limits = [-2.5, 2.5]
nodes = [{ at = [0.1, 0, 0] }, { at = [0.2, 0, 0], radius = 0.005 }]
"#;

fn placed(text: &str, at: Option<DVec3>) -> (Scene, Placing) {
    let scene = Scene::parse(text, "own.toml").unwrap();
    let placing = Placing::new(&scene, at).unwrap().unwrap();
    (scene, placing)
}

#[test]
fn the_tip_stands_before_the_point_and_the_press_goes_into_the_object() {
    for at in [None, Some(DVec3::new(0.3, 0.1, 0.2)), Some(DVec3::new(0.2, 0.05, 0.05))] {
        let (scene, placing) = placed(SCENE, at);
        assert!(placing.reaches() && placing.is_clear(), "{placing:?}");
        assert_eq!((placing.tip, placing.link.as_str()), (3, "elbow"));
        let (object, chain) = (Object::build(&scene.object).unwrap(), Chain::new(&scene.proxy));
        let model = Model::reaching(&object, &chain, scene.contact, &[]).unwrap();
        let mut proximity = Proximity::new(&model);
        // The tip's ball keeps the standoff, and the point below it is on the surface.
        let gap = proximity.gap(&placing.q);
        let tip = proximity.pose().nodes[placing.tip];
        let expected = placing.point + (0.005 + placing.standoff) * placing.normal;
        assert!(tip.distance(expected) < 0.01 * placing.standoff, "{placing:?}");
        assert!((gap - placing.standoff).abs() < 0.05 * placing.standoff, "{gap} {placing:?}");
        assert!((placing.point.distance(placing.centre) - 0.04).abs() < 1.5e-3, "{placing:?}");
        // The motion begins apart, presses by about a tenth of the body, and stays within grid and limits.
        let [start, end] = placing.press.motion;
        let (before, pressed) = (proximity.gap(&start), proximity.gap(&end));
        assert!(before > 0.0 && (0.005..0.012).contains(&-pressed), "{before} {pressed}");
        for (joint, ([low, high], count)) in placing.press.axes.iter().enumerate() {
            let limits = scene.proxy.joints[joint].limits;
            assert!(limits[0] <= *low && *high <= limits[1] && *count > 2);
            assert!([start, end].iter().all(|q| (*low..=*high).contains(&q[joint])));
        }
    }
}

#[test]
fn an_object_out_of_reach_is_reached_where_it_is_moved_as_told() {
    let far = SCENE.replace("[0.3, 0.1, 0.05]", "[0.9, 0.1, 0.05]");
    let (_, placing) = placed(&far, None);
    assert!(!placing.reaches() && placing.short.length() > 0.3, "{placing:?}");
    // A millimetre nearer than just reached.
    let moved = placing.centre - 1.005 * placing.short;
    let text = SCENE.replace("[0.3, 0.1, 0.05]", &format!("{:?}", moved.to_array()));
    let (_, placing) = placed(&text, Some(placing.point - placing.short));
    assert!(placing.reaches(), "{placing:?}");
}

#[test]
fn a_scene_that_place_completes_keeps_its_comments_bakes_and_presses() {
    let folder = Folder::new();
    let path = folder.0.path();
    std::fs::write(path.join("a.toml"), SCENE).unwrap();
    let run = |arguments: &[&str]| command(path, arguments).arg("--json").output().unwrap();
    let placed = run(&["place", "a.toml", "--write"]);
    assert!(placed.status.success(), "{}", message(&placed));
    let text = std::fs::read_to_string(path.join("a.toml")).unwrap();
    assert!(text.starts_with(SCENE.trim_end()) && text.contains("# as I like it"), "{text}");
    let baked = run(&["bake", "a.toml", "--backend", "cpu"]);
    let report: Value = serde_json::from_slice(&baked.stdout).unwrap();
    assert!(baked.status.success() && report["contact_points"].as_u64() > Some(100), "{report}");
    for motion in ["press", "scrape"] {
        let played = run(&["play", "a.haptize", "--motion", motion]);
        let report: Value = serde_json::from_slice(&played.stdout).unwrap();
        assert!(played.status.success() && report["contact_share"].as_f64() > Some(0.2), "{motion}: {report}");
    }
    // Written again, grid and motions stand in the place of those before.
    assert!(run(&["place", "a.toml", "--write"]).status.success());
    assert_eq!(std::fs::read_to_string(path.join("a.toml")).unwrap(), text);

    for (arguments, expected) in [
        (&["place", "a.toml", "--at", "1,2"][..], "three finite numbers"),
        (&["place", "a.toml", "--at", "0,0,inf"], "three finite numbers"),
        (&["place", "a.toml", "--mesh", "gone.obj"], "gone.obj"),
        (&["place", "a.toml", "--mesh", "a.toml"], "a.toml"),
        (&["place", "a.toml", "--turn", "0,0,1"], "--mesh"),
        (&["place", "a.toml", "--mesh", "gone.obj", "--young", "-1"], "positive number of pascals"),
        (&["place", "a.haptize"], "a.haptize"),
    ] {
        let refused = run(arguments);
        assert!(!refused.status.success(), "{arguments:?}");
        assert!(String::from_utf8_lossy(&refused.stderr).contains(expected), "{arguments:?}: {refused:?}");
    }
    std::fs::write(path.join("far.toml"), SCENE.replace("[0.3, 0.1, 0.05]", "[0.9, 0.1, 0.05]")).unwrap();
    let refused = run(&["place", "far.toml", "--write"]);
    let report: Value = serde_json::from_slice(&refused.stdout).unwrap();
    assert!(refused.status.code() == Some(1) && report["refusal"].as_str().unwrap().contains("centre = "), "{report}");
    assert!(!std::fs::read_to_string(path.join("far.toml")).unwrap().contains("[grid]"), "nothing is written");
}

/// A body in millimetres, far from the origin, before an arm of which nothing is known: what an engineer brings.
#[test]
fn a_mesh_of_ones_own_is_put_before_the_arm_and_felt() {
    let folder = Folder::new();
    let path = folder.0.path();
    let mut mesh = String::new();
    for line in include_str!("../../datasets/organ.obj").lines() {
        let numbers: Vec<f64> = line.split(' ').skip(1).filter_map(|number| number.parse().ok()).collect();
        match numbers[..] {
            [x, y, z] if line.starts_with("v ") => mesh += &format!("v {} {} {}\n", x + 400.0, y - 170.0, z + 1022.0),
            _ => mesh += &format!("{line}\n"),
        }
    }
    std::fs::write(path.join("organ.obj"), mesh).unwrap();
    let (grid, motion) = (
        "[grid]\nspacing = 0.1\naxes = [{ start = 0.0, count = 2 }, { start = 0.0, count = 2 }, { start = 0.0, count = 2 }]\n",
        "# ---- Motions\n\n[motion]\n",
    );
    std::fs::write(path.join("a.toml"), format!("graphics = false # Not what is tested.\n{SCENE}\n{grid}\n{motion}"))
        .unwrap();
    let run = |arguments: &[&str]| {
        let output = command(path, arguments).arg("--json").output().unwrap();
        assert!(output.status.success(), "{arguments:?}: {}", message(&output));
        serde_json::from_slice::<Value>(&output.stdout).unwrap()
    };
    let turn = ["--turn", "0,0,1.5707963", "--young", "4000"];
    let report = run(&[&["place", "a.toml", "--mesh", "organ.obj", "--write"][..], &turn].concat());
    // As long along y now as it was along x, 120 mm.
    let [low, high] = [0, 1].map(|end| report["body"][end][1].as_f64().unwrap());
    assert!((high - low - 0.12).abs() < 1e-3, "{report}");
    assert!((report["gap"].as_f64().unwrap() / report["standoff"].as_f64().unwrap() - 1.0).abs() < 0.5, "{report}");
    let text = std::fs::read_to_string(path.join("a.toml")).unwrap();
    for kept in ["# My own arm.", "# ---- Motions", "young = 4000.0", "scale = 0.001"] {
        assert!(text.contains(kept), "{kept}: {text}");
    }
    assert!(!text.contains("as I like it"), "the object before is gone");
    for motion in ["press", "scrape"] {
        let report = run(&["play", "a.toml", "--motion", motion, "-o", motion]);
        assert!(report["contact_share"].as_f64() > Some(0.3), "{motion}: {report}");
        let bounds = report["bounds"].as_array().unwrap().iter();
        let exceeded = bounds.filter(|bound| bound["value"].as_f64() > bound["safe"].as_f64());
        assert_eq!(exceeded.count(), 0, "{report}");
    }
    // Moved away, and moved back before the tip.
    let far = text.replace("[proxy]", "").replace("young = 4000.0", "young = 4000.0 # mine");
    std::fs::write(path.join("a.toml"), far).unwrap();
    let again = run(&["place", "a.toml", "--move", "--write"]);
    for k in 0..3 {
        let [now, before] = [&again, &report].map(|report| report["point"][k].as_f64().unwrap());
        assert!((now - before).abs() < 1e-9, "{again}");
    }
    assert!(std::fs::read_to_string(path.join("a.toml")).unwrap().contains("# mine"));
}
