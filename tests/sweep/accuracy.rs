//! What accuracy costs: errors that fall, rows that repeat, fronts and offers that follow from the rows, files that
//! appear.

use haptize::{
    scene::Scene,
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
fn errors_fall_with_spacing_and_tolerance() {
    let scene = sphere(2);
    let extent = Extent { configurations: 60, points: 4000, rounds: 1 };
    let mut steps = Vec::new();
    let found = accuracy::measure(&scene, extent, &mut |step| steps.push(step.to_owned())).unwrap();
    assert!(steps[0] == "reference" && steps[1].starts_with("the studies take about "), "{steps:?}");
    assert!(found.in_contact > 20 && found.left_out == 0);
    // The reference is far better than anything that is compared with it.
    let least = found.of(Study::Spacing).map(|row| row.rms).fold(f64::INFINITY, f64::min);
    assert!(found.reference_error < 1e-4 * least, "{} of {least}", found.reference_error);
    for series in ["linear", "potential"] {
        assert!(found.order(Study::Spacing, series).unwrap() > 0.1, "{series}");
    }
    let by_tolerance: Vec<f64> = found.of(Study::Tolerance).map(|row| row.rms).collect();
    assert!(by_tolerance[0] > 10.0 * by_tolerance[by_tolerance.len() - 1], "{by_tolerance:?}");
    // Of both laws, the reference's errs as its tolerance does; that of the surface at rest is another one.
    let by_law: Vec<f64> = found.of(Study::Law).map(|row| found.relative(row)).collect();
    assert!(by_law.len() == 2 && by_law[0] < 1e-6 && (1e-3..1.0).contains(&by_law[1]), "{by_law:?}");
    // Mesh, contact nodes and contact stiffness in four steps, each row against the next; stiffer contact changes ever
    // less.
    let changes = |study: Study| found.of(study).map(|row| row.rms).collect::<Vec<f64>>();
    for study in [Study::Mesh, Study::Links, Study::Stiffness] {
        assert!(changes(study).len() == 3 && changes(study).iter().all(|change| *change > 0.0), "{study:?}");
        assert_eq!(found.of(study).filter(|row| row.value == 1.0 && row.cost > 0.0).count(), 1, "{study:?}");
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
    assert!(!offers.is_empty() && offers.iter().all(|offer| offer.error <= offer.target));
    assert!(offers.windows(2).all(|pair| pair[0].target > pair[1].target), "{offers:?}");

    let folder = tempfile::tempdir().unwrap();
    let files = accuracy::write_all(folder.path(), &found).unwrap();
    assert!(files.iter().eq(accuracy::FILES.map(|name| folder.path().join(name)).iter()), "{files:?}");
    assert!(files.iter().all(|file| std::fs::metadata(file).unwrap().len() > 1000), "{files:?}");
    let table = std::fs::read_to_string(folder.path().join("accuracy.csv")).unwrap();
    assert_eq!(table.lines().count(), found.rows.len() + 1);
}

/// By the law at rest a live solution is exact; by another it errs by the difference of the two, and the same every time.
#[test]
fn live_contact_errs_by_the_difference_of_the_laws_and_rows_repeat_exactly() {
    let text = std::fs::read_to_string("tests/scenes/small.toml").unwrap();
    let extent = Extent { configurations: 200, points: 100, rounds: 1 };
    let measured = |law: &str, extent| {
        let law = format!("[contact]\nlaw = \"{law}\"\n");
        let scene = Scene::parse(&text.replace("[contact]\n", &law), "small.toml").unwrap();
        accuracy::measure(&scene, extent, &mut |_| ()).unwrap()
    };
    let error = |law: &str| {
        let found = measured(law, extent);
        let live: Vec<f64> = found.of(Study::Lookup).filter(|row| row.series == "live").map(|row| row.rms).collect();
        assert_eq!(live.len(), 1);
        live[0]
    };
    let (exact, following) = (error("rest"), error("following"));
    assert!(exact < 1e-6 * following && following > 0.0, "{exact} {following}");
    // The same rows every time.
    let few = Extent { configurations: 60, points: 100, rounds: 1 };
    let errors = || measured("following", few).rows.iter().map(|row| (row.rms, row.worst)).collect::<Vec<_>>();
    assert_eq!(errors(), errors());
}
