//! Work-precision diagrams: error up, cost across, both logarithmic; every setting a dot, curves through one series.

use super::{Accuracy, Row, Study};
use crate::report::{
    canvas::Canvas,
    colour,
    diagram::{Diagram, Series},
    plot::{Entry, Mark},
};

/// Name and points of each series of `study`, in the order of the rows.
fn series(accuracy: &Accuracy, study: Study, place: impl Fn(&Row) -> (f64, f64)) -> Vec<Series> {
    let mut found: Vec<Series> = Vec::new();
    for row in accuracy.of(study) {
        let at = found.iter().position(|curve| curve.name == row.series).unwrap_or_else(|| {
            found.push(Series { name: row.series.clone(), points: Vec::new(), dashed: false, colour: found.len() });
            found.len() - 1
        });
        found[at].points.push(place(row));
    }
    found
}

fn worst_too(mut curves: Vec<Series>, worst: Vec<Series>) -> Vec<Series> {
    curves.extend(worst.into_iter().map(|curve| Series { name: String::new(), dashed: true, ..curve }));
    curves
}

/// Error against spacing and against grid points, with the Pareto front.
#[must_use]
pub(super) fn spacing(accuracy: &Accuracy) -> Canvas {
    let mut sheet = Diagram::new(
        "Error of the rendered torque against grid spacing",
        &format!(
            "{} random configurations; rms torque {:.3} N m, known to {:.0e}",
            accuracy.configurations, accuracy.torque, accuracy.reference_error
        ),
        1,
    );
    let by = |place: fn(&Row) -> (f64, f64)| series(accuracy, Study::Spacing, place);
    let across = worst_too(by(|row| (row.value, row.rms)), by(|row| (row.value, row.worst)));
    sheet.panel(0, &format!("Grid spacing [{}]", accuracy.unit), "Error [N m]", &across, &[]);
    let costs = worst_too(by(|row| (row.solved as f64, row.rms)), by(|row| (row.solved as f64, row.worst)));
    let front: Vec<(f64, f64)> = accuracy.front().iter().map(|row| (row.solved as f64, row.rms)).collect();
    sheet.panel(1, "Points solved [1]", "Error [N m]", &costs, &front);
    let dashes = Entry { name: "worst".into(), colour: colour::SOFT_INK, mark: Mark::Dashes };
    let best = Entry { name: "Pareto front".into(), colour: colour::series(5), mark: Mark::Dot };
    sheet.legend(&costs, vec![dashes, best]);
    sheet.canvas()
}

/// Work around loops against their size, and what a look-up costs, or an equilibrium beside the loop.
#[must_use]
pub(super) fn loops(accuracy: &Accuracy) -> Canvas {
    let mut sheet = Diagram::new(
        "Work of the contact torque around closed loops, which a passive object never gives",
        &format!(
            "squares in the plane of two joints; zero is drawn at the rounding of the object's greatest energy, \
             {:.3} J",
            accuracy.greatest_energy
        ),
        1,
    );
    let mut curves: Vec<Series> = Vec::new();
    for entry in &accuracy.loops {
        let at = curves.iter().position(|curve| curve.name == entry.series).unwrap_or_else(|| {
            curves.push(Series { name: entry.series.clone(), points: Vec::new(), dashed: false, colour: curves.len() });
            curves.len() - 1
        });
        // Zero has no logarithm: the least that f64 can distinguish from it, relative to the energy, stands for it.
        let floor = f64::EPSILON * accuracy.greatest_energy;
        curves[at].points.push((entry.side, entry.work.max(floor)));
    }
    sheet.panel(0, &format!("Side of the loop [{}]", accuracy.unit), "Work around the loop [J]", &curves, &[]);
    let looked = series(accuracy, Study::Lookup, |row| (row.cost.least, row.rms));
    sheet.panel(1, "Time a tick, over linear's look-up [1]", "Rms error of the torque [N m]", &looked, &[]);
    sheet.legend(&looked, Vec::new());
    sheet.canvas()
}

/// The contact solver: error against time and against iterations, over tolerances, algorithms and arithmetic.
#[must_use]
pub(super) fn solver(accuracy: &Accuracy) -> Canvas {
    let mut sheet = Diagram::new(
        "Error of a solved configuration against its time",
        "tolerance of the energy form, the surface at rest, the paper's iteration, arithmetic",
        1,
    );
    let curves = |place: fn(&Row) -> (f64, f64)| {
        let mut curves = series(accuracy, Study::Tolerance, place);
        curves.iter_mut().for_each(|curve| curve.name = "tolerance".to_owned());
        for study in [Study::Algorithm, Study::Arithmetic] {
            for mut curve in series(accuracy, study, place) {
                curve.colour = curves.len();
                curves.push(curve);
            }
        }
        // The tolerance of the energy form is the curve of the algorithm of that name.
        curves.retain(|curve| curve.name != "energy" && curve.name != "cpu");
        curves
    };
    let timed = curves(|row| (row.cost.least, row.rms));
    sheet.panel(0, "Time of a configuration, relative to the scene's own [1]", "Rms error [N m]", &timed, &[]);
    let counted = curves(|row| (row.points as f64, row.rms));
    sheet.panel(1, "Iterations of a configuration in contact [1]", "Rms error [N m]", &counted, &[]);
    sheet.legend(&timed, Vec::new());
    sheet.canvas()
}

/// Draws how refining the scene changes the torque: mesh and contact nodes, which must converge, beside skin and
/// contact compliance, which describe the body.
#[must_use]
pub(super) fn refinement(accuracy: &Accuracy) -> Canvas {
    let mut sheet = Diagram::new(
        "Change of the torque by the next step of refinement",
        "left: what only resolves the scene; right: what the scene is made of",
        1,
    );
    let mut all: Vec<Series> = Vec::new();
    let pairs = [[Study::Mesh, Study::Links], [Study::Skin, Study::Stiffness]];
    for (side, studies) in pairs.into_iter().enumerate() {
        let change = |study| series(accuracy, study, |row| (row.value, row.rms));
        let mut curves: Vec<Series> = studies.into_iter().flat_map(change).collect();
        curves.iter_mut().zip(all.len()..).for_each(|(curve, colour)| curve.colour = colour);
        let across = ["Length of edges, spacing of nodes", "Bending stiffness, compliance"][side];
        sheet.panel(side, &format!("{across}, relative to the scene's own [1]"), "Rms change [N m]", &curves, &[]);
        all.extend(curves);
    }
    sheet.legend(&all, Vec::new());
    sheet.canvas()
}

/// Frame step and iterations of the graphics.
#[must_use]
pub(super) fn graphics(accuracy: &Accuracy) -> Canvas {
    let mut sheet = Diagram::new(
        "Error of what is drawn",
        "a push and its release, relative to the rms of positions and energy; left: frame step; right: iterations on \
         the GPU",
        1,
    );
    let by = |study: Study| {
        let worst = series(accuracy, study, |row| (row.value, row.worst / row.size));
        worst_too(series(accuracy, study, |row| (row.value, row.rms / row.size)), worst)
    };
    let steps = by(Study::Frame);
    sheet.panel(0, "Frame step [s]", "Relative error [1]", &steps, &[]);
    sheet.panel(1, "Iterations a frame [1]", "Relative error [1]", &by(Study::Iterations), &[]);
    let dashes = Entry { name: "worst".into(), colour: colour::SOFT_INK, mark: Mark::Dashes };
    sheet.legend(&steps, vec![dashes]);
    sheet.canvas()
}
