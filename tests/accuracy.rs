//! What accuracy costs: errors that fall, rows that repeat, fronts and offers that follow from the rows, files that
//! appear.

#![allow(clippy::unwrap_used)] // clippy.toml allows it inside #[test] functions only; helpers need it, too.

use haptize::{
    scene::{EFFECTS, Scene},
    studies::accuracy::{self, Extent, Study},
};
use std::path::Path;

/// The sphere on a grid so many times as coarse, so that bakes take little time.
fn sphere(coarser: usize) -> Scene {
    let mut scene = Scene::load(Path::new("tests/scenes/sphere.toml")).unwrap();
    for axis in &mut scene.grid.axes {
        let cells = axis.count - 1;
        (axis.count, axis.step) = (cells / coarser + 1, axis.step * cells as f64 / (cells / coarser) as f64);
    }
    scene
}

#[test]
fn errors_fall_with_spacing_and_tolerance_and_repeat_exactly() {
    let scene = sphere(2);
    let extent = Extent { configurations: 60, points: 4000, rounds: 1 };
    let mut found = accuracy::measure(&scene, extent, &mut |_| ()).unwrap();
    assert!(found.in_contact > 20 && found.left_out == 0);
    // The reference is far better than anything that is compared with it.
    let least = found.of(Study::Spacing).map(|row| row.rms).fold(f64::INFINITY, f64::min);
    assert!(found.reference_error < 1e-4 * least, "{} of {least}", found.reference_error);
    for series in ["linear", "potential"] {
        assert!(found.order(series).unwrap() > 0.1, "{series}");
    }
    let by_tolerance: Vec<f64> = found.of(Study::Tolerance).map(|row| row.rms).collect();
    assert!(by_tolerance[0] > 10.0 * by_tolerance[by_tolerance.len() - 1], "{by_tolerance:?}");
    // Graphics: ever better with the frame step, towards its second order, and with iterations, until f32 shows.
    for series in ["position", "energy"] {
        let errors = |study: Study| -> Vec<f64> {
            found.of(study).filter(|row| row.series == series).map(|row| row.rms / row.size).collect()
        };
        let (steps, iterations) = (errors(Study::Frame), errors(Study::Iterations));
        assert!(steps.is_sorted_by(|a, b| a > b) && steps[4] < 0.4 * steps[3], "{series}: {steps:?}");
        assert!(iterations[0] > 1e-2 && iterations[6] < 1e-4, "{series}: {iterations:?}");
    }
    // Mesh, contact nodes and contact stiffness in four steps, each row against the next; stiffer contact changes ever
    // less.
    let changes = |study: Study| found.of(study).map(|row| row.rms).collect::<Vec<f64>>();
    for study in [Study::Mesh, Study::Links, Study::Stiffness] {
        assert!(changes(study).len() == 3 && changes(study).iter().all(|change| *change > 0.0), "{study:?}");
        assert_eq!(found.of(study).filter(|row| row.value == 1.0 && row.cost.least == 1.0).count(), 1, "{study:?}");
    }
    assert!(changes(Study::Stiffness).is_sorted_by(|a, b| a > b), "{:?}", changes(Study::Stiffness));
    let limits = accuracy::limits(&found);
    assert!(limits.len() == 3 && limits.is_sorted_by(|a, b| a.error >= b.error), "{limits:?}");
    // Nothing on the front is beaten, and everything beside it is.
    let front = found.front();
    assert!(front.windows(2).all(|pair| pair[0].solved <= pair[1].solved && pair[0].rms >= pair[1].rms));
    let better = |a: &accuracy::Row, b: &accuracy::Row| a.solved <= b.solved && a.rms <= b.rms;
    assert!(found.of(Study::Spacing).all(|row| front.iter().any(|best| better(best, row))));
    // An offer that was measured keeps its promise.
    let offers = accuracy::offers(&found);
    assert!(offers.iter().any(|offer| offer.measured) && offers.iter().any(|offer| !offer.measured));
    assert!(offers.iter().all(|offer| offer.error <= offer.target));
    // Loops: zero to rounding for the potential alone.
    let greatest =
        |series: &str| found.loops.iter().filter(|l| l.series == series).map(|l| l.work.abs()).fold(0.0, f64::max);
    assert!(greatest("potential") < 1e-10 * found.greatest_energy, "{}", greatest("potential"));
    assert!(greatest("linear") > 1e-4 * found.greatest_energy, "{}", greatest("linear"));

    let again = accuracy::measure(&scene, extent, &mut |_| ()).unwrap();
    let errors = |found: &accuracy::Accuracy| found.rows.iter().map(|row| (row.rms, row.worst)).collect::<Vec<_>>();
    assert_eq!(errors(&found), errors(&again));

    let folder = tempfile::tempdir().unwrap();
    let files = accuracy::write_all(folder.path(), &found).unwrap();
    assert!(files.iter().all(|file| !file.ends_with("effects.csv")), "not priced");
    found.effects = Some(effects_are_priced_side_by_side(&sphere(4)));
    let files = accuracy::write_all(folder.path(), &found).unwrap();
    let prices = std::fs::read_to_string(folder.path().join("effects.csv")).unwrap();
    assert_eq!(prices.lines().count(), 1 + 3 + EFFECTS.len());
    assert!(
        prices
            .lines()
            .all(|line| line.split('"').step_by(2).map(|part| part.matches(',').count()).sum::<usize>() == 42)
    );
    assert!(files.iter().all(|file| std::fs::metadata(file).unwrap().len() > 1000), "{files:?}");
    let page = std::fs::read_to_string(folder.path().join("accuracy.html")).unwrap();
    assert!(page.matches("<svg").count() == 6 && !page.contains("src=\"http"));
    let table = std::fs::read_to_string(folder.path().join("accuracy.csv")).unwrap();
    assert_eq!(table.lines().count(), found.rows.len() + 1);
}

/// Where there is one equilibrium a solution every tick errs as the solver does, the tangents of older ones ever more.
#[test]
fn direct_errs_by_the_age_of_its_tangents() {
    let scene = Scene::load(Path::new("tests/scenes/small.toml")).unwrap();
    let extent = Extent { configurations: 200, points: 100, rounds: 1 };
    let found = accuracy::measure(&scene, extent, &mut |_| ()).unwrap();
    let followed: Vec<f64> = found.of(Study::Lookup).filter(|row| row.series == "direct").map(|row| row.rms).collect();
    assert!(followed.len() == 4 && followed.is_sorted_by(|a, b| a < b), "{followed:?}");
    assert!(followed[0] < 1e-3 * followed[3], "{followed:?}");
}

/// Each effect alone and within the whole scene: what is counted is exact, what is timed is relative to the same run.
fn effects_are_priced_side_by_side(scene: &Scene) -> accuracy::effects::Effects {
    let priced = accuracy::effects::price(scene, 2, &mut |_| ()).unwrap();
    assert_eq!(priced.prices.len(), EFFECTS.len() + 3);
    assert!(priced.in_contact > 0.2 && priced.nodes == 102, "{priced:?}");
    let [plain, graphics] = ["plain", "graphics"].map(|name| priced.of(name).unwrap());
    assert_eq!((plain.alone.bake.least, plain.alone.tick.least, graphics.alone.frame.unwrap().least), (1.0, 1.0, 1.0));
    let touched = priced.of("friction").unwrap();
    for effect in EFFECTS {
        let price = priced.of(effect.key).unwrap();
        let like = if effect.is_at_contacts() {
            touched
        } else if effect.is_drawn() {
            graphics
        } else {
            plain
        };
        assert_eq!(price.dataset_bytes, like.dataset_bytes, "{}", effect.key);
        let costs = price.alone;
        assert_eq!((costs.frame.is_some(), costs.gpu_frame.is_some()), (effect.is_drawn(), effect.is_drawn()));
        assert!(costs.bake.least > 0.0 && costs.tick.least <= costs.tick.median && !price.setting.is_empty());
        // Within the whole scene all is drawn and all forces are stored, with it or without.
        assert_eq!(price.within.is_none(), effect.key == "quasi_static");
        if let Some(within) = price.within {
            assert!(within.frame.is_some() && within.dataset == 1.0, "{}", effect.key);
            assert_eq!(within.device.unwrap() > 1.0, effect.key == "stiffening", "{}", effect.key);
        }
    }
    let together = priced.of("whole").unwrap();
    let forces = [graphics, touched].map(|priced| priced.dataset_bytes - plain.dataset_bytes);
    assert!(forces.iter().all(|bytes| *bytes > 0));
    assert_eq!(together.dataset_bytes, plain.dataset_bytes + forces.iter().sum::<usize>());
    let all = EFFECTS.map(|effect| effect.key).into_iter().filter(|key| *key != "quasi_static");
    assert_eq!(together.setting, all.collect::<Vec<_>>().join(", "));
    // Nothing on the device without graphics; with stiffening more than without.
    let bytes = |name: &str| priced.of(name).unwrap().device.unwrap().bytes;
    assert!(bytes("friction") == 0 && bytes("graphics") > 0 && bytes("smoothing") == bytes("graphics"));
    assert!(bytes("stiffening") > bytes("gravity") && bytes("gravity") > bytes("graphics"));
    assert!(bytes("quasi_static") < bytes("graphics") && bytes("whole") == bytes("stiffening"));
    assert!(priced.notes.is_empty(), "{:?}", priced.notes);
    priced
}
