//! What accuracy costs: errors that fall, rows that repeat, fronts and offers that follow from the rows, files that appear.

use haptize::{
    report::accuracy::{self, Extent, Study},
    scene::Scene,
};
use std::path::Path;

#[test]
fn errors_fall_with_spacing_and_tolerance_and_repeat_exactly() {
    let mut scene = Scene::load(Path::new("datasets/sphere.toml")).unwrap();
    // Twice as coarse, so that the grids around it take little time.
    for axis in &mut scene.grid.axes {
        let cells = axis.count - 1;
        (axis.count, axis.step) = (cells / 2 + 1, axis.step * cells as f64 / (cells / 2) as f64);
    }
    let extent = Extent { configurations: 60, points: 4000 };
    let found = accuracy::measure(&scene, extent, &mut |_| ()).unwrap();
    assert!(found.in_contact > 20 && found.left_out == 0);
    // The reference is far better than anything that is compared with it.
    let least = found.of(Study::Spacing).map(|row| row.rms).fold(f64::INFINITY, f64::min);
    assert!(found.reference_error < 1e-4 * least, "{} of {least}", found.reference_error);
    for series in ["linear", "gap-field", "potential"] {
        assert!(found.order(series).unwrap() > 0.1, "{series}");
    }
    let by_tolerance: Vec<f64> = found.of(Study::Tolerance).map(|row| row.rms).collect();
    assert!(by_tolerance[0] > 10.0 * by_tolerance[by_tolerance.len() - 1], "{by_tolerance:?}");
    // Nothing on the front is beaten, and everything beside it is.
    let front = found.front();
    assert!(front.windows(2).all(|pair| pair[0].points <= pair[1].points && pair[0].rms >= pair[1].rms));
    let better = |a: &accuracy::Row, b: &accuracy::Row| a.points <= b.points && a.rms <= b.rms;
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
    assert!(files.iter().all(|file| std::fs::metadata(file).unwrap().len() > 1000), "{files:?}");
    let page = std::fs::read_to_string(folder.path().join("accuracy.html")).unwrap();
    assert!(page.matches("<svg").count() == 4 && !page.contains("src=\"http"));
    let table = std::fs::read_to_string(folder.path().join("accuracy.csv")).unwrap();
    assert_eq!(table.lines().count(), found.rows.len() + 1);
}
