//! Where contact is, against what the geometry says.

use haptize::{
    Error, ErrorKind,
    scene::Scene,
    sweep::{Direct, Reach},
};
use std::sync::atomic::AtomicBool;

/// A ball of 10 mm on two slides before a sphere of 50 mm: one pushes it against the sphere's side, one lifts it past.
const SCENE: &str = r#"
[object]
sphere = { radius = 0.05, rings = 30, segments = 32 }
springs = { kind = "isotropic", stiffness = 150.0 }
ground = { stiffness = 50.0 }
[contact]
stiffness = 500.0
[[proxy.joint]]
name = "push"
kind = "prismatic"
axis = [-1, 0, 0]
limits = [-0.02, 0.05]
[[proxy.joint]]
name = "lift"
kind = "prismatic"
axis = [0, 0, 1]
limits = [-0.1, 0.1]
nodes = [{ at = [0.06, 0, 0], radius = 0.01 }]
"#;

/// How far the polyhedron is inside of the sphere, and a range's margin beyond contact (m).
const SLACK: f64 = 0.004;

fn measured(scene: &Scene, depth: Option<f64>, is_stopped: bool) -> Result<Reach, Error> {
    Reach::new(scene, Direct::at_rest(scene)?.model(), depth, &AtomicBool::new(is_stopped))
}

fn reach(depth: f64) -> Result<Reach, Error> {
    measured(&Scene::parse(SCENE, "ball.toml").unwrap(), Some(depth), false)
}

#[test]
fn ranges_and_shares_are_those_of_a_ball_before_a_sphere() {
    let found = reach(0.02).unwrap();
    let [push, lift] = &found.joints[..] else { panic!("{found:?}") };
    assert_eq!((push.name.as_str(), push.unit, push.limits), ("push", "m", [-0.02, 0.05]));
    // The ball touches once it is pushed at all, and anywhere up to 60 mm off the middle; pushed to the end, it goes 50
    // mm deep in the middle, so that 20 mm deep contact is at the sides.
    let close = |found: f64, expected: f64| assert!((found - expected).abs() < SLACK, "{found}, not {expected}");
    close(push.range[0], 0.0);
    close(push.range[1], 0.05);
    close(lift.range[0], -0.06);
    close(lift.range[1], 0.06);
    close(found.body, 0.1);
    assert!(found.joints.iter().all(|joint| joint.limits[0] <= joint.range[0] && joint.range[1] <= joint.limits[1]));
    // Contact is where the centre of the ball, at (60 mm - push, lift), is within 60 mm of the middle; integrated over
    // squares.
    let (mut touching, mut shallow, mut all) = (0, 0, 0);
    for i in 0..700 {
        for k in 0..1000 {
            let (x, z) = (0.08 - 0.07 * (f64::from(i) + 0.5) / 700.0, -0.1 + 0.2 * (f64::from(k) + 0.5) / 1000.0);
            let gap = x.hypot(z) - 0.06;
            all += 1;
            touching += i32::from(gap < 0.0);
            shallow += i32::from((-0.02..0.0).contains(&gap));
        }
    }
    let share = f64::from(touching) / f64::from(all);
    assert!((found.contact - share).abs() < 0.03, "{} in contact, not {share}", found.contact);
    let at = found.depths.iter().find(|at| (at.depth - 0.02).abs() < 1e-3).unwrap();
    let share = f64::from(shallow) / f64::from(touching);
    assert!((at.share - share).abs() < 0.05, "{} to 20 mm, not {share}", at.share);
    assert!(
        push.contact[0] < 0.01 && push.contact[9] > 0.3 && lift.contact[0] < 0.01 && lift.contact[5] > 0.5,
        "{found:?}"
    );
}

#[test]
fn depth_sets_the_range_and_no_contact_is_refused() {
    // Within 10 mm of the middle, contact of depth d ends where the ball's centre, 10 mm off, is 60 mm - d from that of
    // the sphere.
    let middle = SCENE.replace("limits = [-0.1, 0.1]", "limits = [-0.01, 0.01]");
    let middle = Scene::parse(&middle, "middle.toml").unwrap();
    for depth in [0.02, 0.002_f64] {
        let found = measured(&middle, Some(depth), false).unwrap();
        let end = 0.06 - ((0.06 - depth).powi(2) - 0.01_f64.powi(2)).sqrt();
        assert!((found.joints[0].range[1] - end).abs() < 0.002, "{depth}: {found:?}, not {end}");
        assert!((found.shallow, found.deepest) >= (depth, 0.9 * depth), "{found:?}");
    }
    let free = SCENE.replace("at = [0.06, 0, 0]", "at = [0.06, 0.2, 0]");
    let refused = measured(&Scene::parse(&free, "free.toml").unwrap(), None, false).unwrap_err();
    assert!(refused.to_string().contains("widen the limits"), "{refused}");
    let stopped = measured(&Scene::parse(SCENE, "ball.toml").unwrap(), None, true).unwrap_err();
    assert_eq!(stopped.kind(), ErrorKind::Stopped);
}

#[test]
fn the_grid_covers_the_ranges_with_steps_of_equal_motion() {
    let scene = Scene::parse(SCENE, "ball.toml").unwrap();
    assert!(scene.grid.axes.is_empty(), "the scene leaves the grid out");
    let found = reach(0.02).unwrap();
    let with = found.scene(&scene).unwrap();
    for (axis, joint) in with.grid.axes.iter().zip(&found.joints) {
        let end = axis.start + (axis.count - 1) as f64 * axis.step;
        assert!((axis.start - joint.range[0]).abs() < 1e-9 && (end - joint.range[1]).abs() < 1e-9);
    }
    let [push, lift] = [with.grid.axes[0].step, with.grid.axes[1].step];
    assert!((0.8..1.25).contains(&(push / lift)), "slides move the ball alike: {push}, {lift}");
    // The table that is written says the same.
    let table = format!("{SCENE}\n{}", found.table(&with));
    let written = Scene::parse(&table, "ball.toml").unwrap();
    for (axis, other) in with.grid.axes.iter().zip(&written.grid.axes) {
        assert!(
            axis.count == other.count
                && (axis.start - other.start).abs() < 1e-9
                && (axis.step - other.step).abs() < 1e-9
        );
    }
}
