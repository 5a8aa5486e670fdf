//! The paper's section 4.1 with its own iteration, and the comparison with the paper's numbers.
use crate::common::scanned::scanned;
use glam::DVec3;
use haptize::{
    dataset::Dataset,
    device::Motion,
    gridize::{GridizeOptions, gridize},
    paper::{Comparison, PressedTwin, Row, Scanned, Scans, Sphere, Value, baked, procedure, specimen},
    render::{session, setup::Setup, trace::Trace},
    scene::{PlanSpec, ScanScene, Scene, Waypoint},
    sweep::SweepReport,
};

fn paper() -> Scene {
    Scene::parse(include_str!("../../datasets/paper.toml"), "paper.toml").unwrap()
}

/// `dataset` felt by a hand that follows one of its scene's motions.
fn felt(dataset: &Dataset, motion: impl Fn(&Setup) -> &[Waypoint]) -> (Setup, Trace) {
    let setup = Setup::new(dataset).unwrap();
    let motion = Motion::through(motion(&setup), 3).unwrap();
    let plan = setup.plan(dataset, motion.duration(), 0);
    let trace = session::run(&setup.haptics, &mut setup.hand(motion).unwrap(), None, &plan).unwrap();
    (setup, trace)
}

#[test]
fn the_papers_iteration_converges_for_95_percent_of_the_contacts_and_the_press_meets_no_failure() {
    let mut scene = paper();
    let share = |report: &SweepReport| 1.0 - report.unconverged as f64 / report.contact_points as f64;
    let (dataset, report) = baked(&scene).unwrap();
    assert_eq!(dataset.provenance.algorithm, "paper");
    assert!(report.contact_points > 4000 && share(&report) >= 0.95, "{report:?}");

    for (name, several) in [("press", 5), ("scrape", 3)] {
        let (setup, trace) = felt(&dataset, |setup| match name {
            "press" => &setup.scene.motion.press,
            _ => &setup.scene.motion.scrape,
        });
        let felt = trace.summary();
        assert!(setup.exceeded.is_empty(), "{:?}", setup.exceeded);
        assert_eq!((felt.unconverged, felt.outside, felt.limited, felt.faults), (0, 0, 0, 0), "{name}: {felt:?}");
        assert!(felt.contact_share > 0.3 && felt.max_contact_nodes >= several, "{name}: {felt:?}");
        assert!(felt.max_contact_torque > 0.1 && felt.max_relative_account_residual < 1e-12, "{name}: {felt:?}");
    }

    // The paper's remark that stiff contact does not converge, in a number.
    scene.contact.stiffness *= 5.0;
    let (_, report) = baked(&scene).unwrap();
    assert!(share(&report) < 0.9, "{report:?}");
}

/// A corner of the plan of `datasets/sponge.toml`, measured, gridized and pressed.
#[test]
fn the_table_says_what_is_the_same_and_what_differs() {
    let scene = paper();
    let (dataset, _) = baked(&scene).unwrap();
    let (_, press) = felt(&dataset, |setup| &setup.scene.motion.press);
    let sphere = Sphere { scene: &scene, dataset: &dataset, press: &press };

    let mut part = ScanScene::parse(include_str!("../../datasets/sponge.toml"), "sponge.toml").unwrap();
    let PlanSpec::Workspace(plan) = &mut part.scan.plan else { unreachable!() };
    (plan.start.y, plan.across[0].count, plan.across[1].count) = (-0.012, 5, 8);
    let samples = scanned(&part, 1);
    let options = GridizeOptions { epsilon: Some(0.01), within: f64::INFINITY, ..GridizeOptions::new(vec![0.03]) };
    let (mut block, report) = gridize(&samples, &options).unwrap();
    block.scene.clone_from(&part.text);
    let (setup, trace) = felt(&block, |setup| &setup.scene.motion.press);
    let scanned = Scanned { scene: &part, samples: &samples, dataset: &block, chain: &setup.chain, trace: &trace };
    let scans = Scans { bare: scanned, fabric: scanned, side: scanned };

    let comparison = Comparison::new(sphere, scans);
    let row = |quantity: &str| -> &Row { comparison.rows.iter().find(|row| row.quantity == quantity).unwrap() };
    for same in ["nodes of the sphere", "configurations of the dataset", "joints of the virtual proxy"] {
        assert!(row(same).same && !row(same).differs(), "{:?}", row(same));
    }
    let scanned = row("scanned points, from above");
    assert_eq!((&scanned.paper, &scanned.ours), (&Value::Count(3472), &Value::Count(5 * 8 * 8)));
    assert!(!scanned.same && scanned.differs(), "{scanned:?}");
    assert_eq!(row("gridized points, from the side").ours, Value::Count(report.inside));
    // Words are no number that could differ.
    assert!(!row("normal force under a fabric over bare, at the same depth").differs());
    let page = comparison.markdown();
    assert_eq!(page.lines().count(), comparison.figures.len() + comparison.rows.len() + 7);
    assert!(page.contains("| 4.1 | nodes of the sphere | 102 | 102 | the same |"), "{page}");
    assert!(page.contains("| 3,472 | 320 | 5 x 8 lines of 8 levels |"), "{page}");

    let corners = [DVec3::ZERO, 0.05 * DVec3::X, 0.05 * DVec3::Y, 0.05 * DVec3::Z];
    let triangles = vec![[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]];
    let twin = PressedTwin { nodes: corners.to_vec(), triangles, displacements: vec![0.0, 0.0, 0.0, 0.002] };
    for canvas in [procedure(sphere, scans), specimen(scans, &twin)] {
        assert!(canvas.svg().contains("320"), "the number of this run's samples");
        let picture = canvas.pixels(1.0).unwrap();
        assert!(picture.pixels.iter().filter(|&&pixel| pixel != [255; 3]).count() > picture.pixels.len() / 30);
    }
}

#[test]
fn values_have_three_digits_and_no_idle_zeros() {
    for (value, text) in [
        (Value::Count(8064), "8,064"),
        (Value::Number(std::f64::consts::PI / 60.0), "0.0524"),
        (Value::Number(1000.0), "1000"),
        (Value::Number(98.2), "98.2"),
        (Value::Number(0.5), "0.5"),
        (Value::Number(-2.7184), "-2.72"),
        (Value::Number(0.0), "0"),
        (Value::Number(f64::NAN), "NaN"),
        ("smooth".into(), "smooth"),
    ] {
        assert_eq!(value.to_string(), text);
    }
}
