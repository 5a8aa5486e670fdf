//! `bake --max-error`: chosen by a pilot, stated, baked, verified; and refused where no grid can keep the error.

use crate::{
    common::program::haptize,
    fixture::{Folder, SCENE},
};
use haptize::{
    dataset::Dataset,
    field::TorqueField,
    object::Object,
    proxy::Chain,
    scene::Scene,
    sweep::{Aim, Backend, BackendChoice, CpuBackend, Direct, Pilot},
};
use serde_json::Value;
use std::{path::Path, sync::atomic::AtomicBool};

/// The small sphere on 25 x 29 grid points, touched by balls: torque has kinks, and hardly a jump.
fn text() -> String {
    SCENE
        .replace("step = 0.1, count = 7", "step = 0.025, count = 25")
        .replace("step = 0.004, count = 9", "step = 0.001, count = 29")
        .replace("count = 3 }]", "count = 3, radius = 0.01 }]")
}

/// A ball on one slide above the sphere.
const SLIDE: &str = r#"
[object]
sphere = { radius = 0.05, rings = 9, segments = 10 }
springs = { kind = "isotropic", stiffness = 300.0 }
ground = { stiffness = 100.0 }
[contact]
stiffness = 500.0
[grid]
axes = [{ start = -0.01, stop = 0.01, count = 21 }]
[[proxy.joint]]
kind = "prismatic"
axis = [0.0, 0.0, -1.0]
limits = [-0.02, 0.02]
nodes = [{ at = [0.0, 0.0, 0.06], radius = 0.01 }]
"#;

#[test]
fn a_grid_is_chosen_stated_baked_and_verified() {
    let folder = Folder::new();
    std::fs::write(folder.0.path().join("a.toml"), text()).unwrap();
    let arguments = ["bake", "a.toml", "--backend", "cpu", "--max-error", "0.005", "--json"];
    let output = haptize(folder.0.path(), &arguments);
    let told = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{told}");
    assert!(told.contains("predicted: about") && told.contains("on the disk"), "{told}");
    let json: Value = serde_json::from_slice(&output.stdout).unwrap();
    let dataset = Dataset::open(&folder.output()).unwrap();
    let measured = dataset.provenance.error.clone().unwrap();
    assert_eq!(json["error"], serde_json::to_value(&measured).unwrap());
    assert!(json["kept"] == true && dataset.provenance.aim == Some(0.005) && measured.keeps(0.005));
    assert!(measured.configurations >= 100 && measured.left_out == 0);

    // The scene in the dataset says what was baked.
    let scene = Scene::parse(&dataset.scene, "a.toml").unwrap();
    let counts: Vec<usize> = scene.grid.axes.iter().map(|axis| axis.count).collect();
    assert_eq!(counts, dataset.grid.counts());
    assert_eq!(scene.haptics.interpolation.name(), measured.interpolation);
    assert_eq!(scene.contact.tolerance, dataset.provenance.tolerance);
    let ends = |scene: &Scene| -> Vec<f64> {
        scene.grid.axes.iter().map(|axis| axis.start + axis.step * (axis.count - 1) as f64).collect()
    };
    let own = ends(&Scene::parse(&text(), "a.toml").unwrap());
    assert!(ends(&scene).iter().zip(own).all(|(a, b)| (a - b).abs() < 1e-12), "the region is the scene's");

    // Independent of the bake's own measurement: points of a grid in between.
    let (object, chain) = (Object::build(&scene.object).unwrap(), Chain::new(&scene.proxy));
    let model = haptize::contact::Model::new(&object, &chain, scene.contact);
    let mut between = dataset.grid.clone();
    for axis in &mut between.axes {
        (axis.start, axis.count) = (axis.start + 0.41 * axis.step, axis.count - 1);
    }
    let places: Vec<_> = (0..between.points()).map(|point| between.configuration(point)).collect();
    let Ok(exact) = CpuBackend::new(&model, 0).unwrap().solve(&places);
    let spec = &scene.haptics;
    let field = TorqueField::interpolated(&dataset, spec.interpolation, spec.threshold, &spec.boundary_slope).unwrap();
    let square = |q: &haptize::JointVector, tau: &[f64]| {
        let found = field.sample(q).torque;
        // A force counts with an arm of 0.1 m.
        (found[0] - tau[0]).powi(2) + (0.1 * (found[1] - tau[1])).powi(2)
    };
    let sum: f64 = places.iter().zip(&exact).map(|(q, e)| square(q, &e.torque)).sum();
    let torques: f64 = exact.iter().map(|e| e.torque[0].powi(2) + (0.1 * e.torque[1]).powi(2)).sum();
    let relative = (sum / torques).sqrt();
    let told = measured.relative().unwrap();
    assert!((0.5..2.0).contains(&(relative / told)), "{relative} and {told}");

    let told = haptize(folder.0.path(), &["info", "a.haptize"]);
    let told = String::from_utf8_lossy(&told.stdout).into_owned();
    assert!(told.contains("of the rms torque") && told.contains("0.50 % rms, kept"), "{told}");
}

#[test]
fn an_error_that_no_grid_keeps_is_refused_before_anything_is_written() {
    let folder = Folder::new();
    std::fs::write(folder.0.path().join("a.toml"), text()).unwrap();
    // As much of an earlier dataset as tells it apart from other files.
    let earlier = br#"........{"__metadata__":{"checksum":"00000000","format":"haptize 1"}}"#;
    std::fs::write(folder.output(), earlier).unwrap();
    for (error, points) in [("1e-7", "2000000"), ("0.02", "50")] {
        let arguments = ["bake", "a.toml", "--backend", "cpu", "--max-error", error, "--max-points", points];
        let output = haptize(folder.0.path(), &arguments);
        let told = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(1), "{told}");
        for part in ["out of reach", "to the power", "points", "shallower", "Nothing was baked"] {
            assert!(told.contains(part), "{part}: {told}");
        }
        assert_eq!(std::fs::read(folder.output()).unwrap(), earlier);
        assert_eq!(folder.names(), ["a.haptize", "a.toml"]);
    }
    for wrong in ["0", "-0.1", "1.5", "150%", "%", "N m", "N", "nan"] {
        let output = haptize(folder.0.path(), &["bake", "a.toml", &format!("--max-error={wrong}")]);
        assert_eq!(output.status.code(), Some(2), "{wrong}");
        assert!(String::from_utf8_lossy(&output.stderr).contains("0.002 N m"), "{wrong}");
    }
    for text in ["0.05", "5%", "5 %"] {
        assert_eq!(text.parse(), Ok(Aim::Relative(0.05)));
    }
    assert_eq!("0.002 N m".parse(), Ok(Aim::Absolute(0.002, "N m")));
    assert_eq!("0.02 N".parse(), Ok(Aim::Absolute(0.02, "N")));
    for refined in [&[][..], &["--refine", "1"]] {
        let output = haptize(folder.0.path(), &[&["bake", "a.toml", "--max-error=0.1 N"], refined].concat());
        let told = String::from_utf8_lossy(&output.stderr);
        assert!(output.status.code() == Some(1) && told.contains("give it in N m"), "{told}");
    }
}

/// A ball on one slide presses into a sphere: its torque is a force, and so are its errors.
#[test]
fn an_arm_of_slides_alone_errs_by_newtons() {
    let folder = Folder::new();
    std::fs::write(folder.0.path().join("a.toml"), SLIDE).unwrap();
    let output = haptize(folder.0.path(), &["bake", "a.toml", "--max-error=0.05 N", "--backend", "cpu"]);
    let told = [output.stdout, output.stderr].concat();
    let told = String::from_utf8_lossy(&told);
    assert!(output.status.success(), "{told}");
    assert!(told.contains("rms error of 5.00e-2 N (") && !told.contains("N m"), "{told}");
    let stiffer = haptize(folder.0.path(), &["bake", "a.toml", "--max-error=0.05 N m", "--backend", "cpu"]);
    assert!(String::from_utf8_lossy(&stiffer.stderr).contains("measured in N: give it in N"));
}

#[test]
fn more_configurations_than_can_be_drawn_are_refused_before_anything_is_solved() {
    let folder = Folder::new();
    std::fs::write(folder.0.path().join("a.toml"), text()).unwrap();
    for count in ["1000001", "10000000000", "18446744073709551615"] {
        for command in [&["bake", "a.toml"][..], &["merge", "a.toml", "-o", "b.haptize"]] {
            let output = haptize(folder.0.path(), &[command, &["--measure-error", count]].concat());
            let told = String::from_utf8_lossy(&output.stderr);
            assert!(output.status.code() == Some(2) && told.contains("1000000"), "{told}");
        }
    }
    let scene = Scene::parse(&text(), "a.toml").unwrap();
    let bake = haptize::sweep::Bake {
        scene: &scene,
        backend: BackendChoice::Cpu,
        measured: Some(usize::MAX),
        aim: None,
        date: "",
        stop: &AtomicBool::new(false),
        progress: &mut |_| panic!("nothing is solved"),
    };
    let refused = bake.in_memory().err().unwrap().to_string();
    assert!(refused.contains("1000000 are the most"), "{refused}");
    assert_eq!(folder.names(), ["a.toml"]);
}

#[test]
fn an_aim_that_was_missed_is_told_and_kept_in_the_file() {
    let folder = Folder::new();
    let scene = Scene::parse(&text(), "a.toml").unwrap();
    let stop = AtomicBool::new(false);
    let direct = Direct::at_rest(&scene).unwrap();
    let pilot = Pilot::run(&scene, direct.model(), Aim::Relative(0.05), BackendChoice::Cpu, &stop).unwrap();
    let choice = pilot.choose(&scene, usize::MAX).unwrap();
    assert!(pilot.prospects.iter().all(|prospect| prospect.points >= pilot.prospects[0].points));
    assert!(pilot.choose(&scene, 10).is_err());
    let bake = haptize::sweep::Bake {
        scene: &choice.scene,
        backend: BackendChoice::Cpu,
        measured: None,
        aim: Some(1e-6),
        date: "",
        stop: &stop,
        progress: &mut |_| (),
    };
    let report = bake.to_file(&folder.output(), false).unwrap();
    assert_eq!(report.points, choice.points);
    let dataset = Dataset::open(&folder.output()).unwrap();
    assert_eq!((dataset.provenance.aim, &dataset.provenance.error), (Some(1e-6), &report.error));
    assert!(!report.error.unwrap().keeps(1e-6));
    assert_eq!(dataset.status_counts().unconverged, 0);
    let told = haptize(folder.0.path(), &["info", "a.haptize"]);
    assert!(String::from_utf8_lossy(&told.stdout).contains("rms, missed"));
}

#[test]
fn an_error_that_was_not_measured_is_said_to_be_so() {
    let folder = Folder::new();
    std::fs::write(folder.0.path().join("a.toml"), text()).unwrap();
    let arguments = ["bake", "a.toml", "--backend", "cpu", "--measure-error", "0"];
    let baked = haptize(folder.0.path(), &arguments);
    let told = haptize(folder.0.path(), &["info", "a.haptize"]);
    for output in [baked, told] {
        assert!(
            output.status.success() && String::from_utf8_lossy(&output.stdout).contains("error        not measured")
        );
    }
    assert_eq!(Dataset::open(&folder.output()).unwrap().provenance.error, None);
}

/// Rms error of the refined dataset in `file` between its nodes, over the rms torque, against equilibria solved here.
fn error_between(file: &Path) -> f64 {
    let dataset = Dataset::open(file).unwrap();
    let scene = Scene::parse(&dataset.scene, "a.toml").unwrap();
    let (object, chain) = (Object::build(&scene.object).unwrap(), Chain::new(&scene.proxy));
    let model = haptize::contact::Model::new(&object, &chain, scene.contact);
    let mut between = dataset.grid.clone();
    for axis in &mut between.axes {
        (axis.start, axis.step) = (axis.start + 0.21 * axis.step, 0.5 * axis.step);
        axis.count = 2 * axis.count - 2;
    }
    let places: Vec<_> = (0..between.points()).map(|point| between.configuration(point)).collect();
    let Ok(exact) = CpuBackend::new(&model, 0).unwrap().solve(&places);
    let store = dataset.refinement.as_ref().unwrap();
    // A force counts with an arm of 0.1 m.
    let square = |tau: &[f64]| tau[0].powi(2) + (0.1 * tau[1]).powi(2);
    let (mut missed, mut whole) = (0.0, 0.0);
    for (q, exact) in places.iter().zip(&exact) {
        let found = store.sample(q).torque();
        missed += square(&[found[0] - exact.torque[0], found[1] - exact.torque[1]]);
        whole += square(&exact.torque);
    }
    (missed / whole).sqrt()
}

#[test]
fn a_refined_bake_keeps_its_error_and_refines_nothing_that_keeps_it_already() {
    let folder = Folder::new();
    std::fs::write(folder.0.path().join("a.toml"), SCENE).unwrap();
    let refined = |error: &str, levels: &str| -> (Option<i32>, Value) {
        let arguments = ["bake", "a.toml", "--max-error", error, "--refine", levels, "--json"];
        let output = haptize(folder.0.path(), &arguments);
        (output.status.code(), serde_json::from_slice(&output.stdout).unwrap())
    };
    // The scene's grid alone errs by more than that.
    let (code, json) = refined("0.08%", "4");
    let (error, nodes) = (json["error"].as_f64().unwrap(), json["nodes"].as_u64().unwrap());
    assert!(code == Some(0) && json["kept"] == true && error <= 0.0008 && nodes > 63, "{json:#}");
    assert!(json["memory"].as_u64().unwrap() <= json["most_memory"].as_u64().unwrap(), "{json:#}");
    let between = error_between(&folder.output());
    assert!((0.5..2.0).contains(&(between / error)), "{between} beside {error}");
    // The dataset states its error, as every other does.
    let measured = Dataset::load(&folder.output()).unwrap().provenance.error.unwrap();
    assert!(
        (measured.relative(), measured.errors.len()) == (Some(error), 1) && measured.configurations >= 1000,
        "{measured:?}"
    );
    let told = haptize(folder.0.path(), &["info", "a.haptize"]);
    let told = String::from_utf8_lossy(&told.stdout);
    assert!(
        ["nodes by level", &measured.lines()[0], "0.08 % rms, kept"].iter().all(|part| told.contains(part)),
        "{told}"
    );
    // What the grid keeps is not refined.
    let (code, json) = refined("1%", "4");
    assert!(code == Some(0) && json["by_level"] == serde_json::json!([63, 0, 0, 0]), "{json:#}");
    // One level cannot keep it, and says so.
    let (code, json) = refined("0.08%", "1");
    assert!(code == Some(1) && json["kept"] == false && json["nodes"] == 63, "{json:#}");
}

/// Stores have one interpolation, and their error is that of it.
#[test]
fn a_scene_is_refined_for_potential_whatever_its_interpolation() {
    let refined = |interpolation: &str| {
        let folder = Folder::new();
        let text = format!("{SCENE}\n[haptics]\ninterpolation = \"{interpolation}\"\n");
        std::fs::write(folder.0.path().join("a.toml"), text).unwrap();
        let output = haptize(folder.0.path(), &["bake", "a.toml", "--max-error", "0.2%", "--refine", "4", "--json"]);
        let json: Value = serde_json::from_slice(&output.stdout).unwrap();
        let error = json["error"].as_f64().unwrap();
        assert!(output.status.success() && json["kept"] == true && error <= 0.002, "{interpolation}: {json:#}");
        let between = error_between(&folder.output());
        assert!((0.5..2.0).contains(&(between / error)), "{interpolation}: {between} beside {error}");
        (json["nodes"].as_u64().unwrap(), error)
    };
    let [linear, potential] = ["linear", "potential"].map(refined);
    assert_eq!(linear, potential);
}
