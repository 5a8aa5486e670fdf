//! Work-precision diagrams: error up, cost across, both logarithmic; every setting a dot, curves through one series.

use super::{Accuracy, Row, Study};
use crate::report::{
    canvas::{Area, Canvas},
    chart::{MARGIN, headline},
    colour,
    plot::{Entry, Mark, NOTE, Panel, Scale},
};

/// Width of a sheet with two panels side by side, in points.
const WIDTH: f64 = 940.0;
/// Height of a panel.
const HEIGHT: f64 = 300.0;
/// Room left of a panel for its tick labels.
const LEFT: f64 = 56.0;
/// Room between two panels.
const BETWEEN: f64 = 40.0;

/// One curve of a diagram.
struct Series {
    name: String,
    points: Vec<(f64, f64)>,
    dashed: bool,
    colour: usize,
}

/// Ends of a logarithmic axis around positive numbers, with room for a mark at each; one decade where there are none.
fn around(values: impl Iterator<Item = f64>) -> [f64; 2] {
    let (low, high) = values
        .filter(|value| *value > 0.0 && value.is_finite())
        .map(f64::log10)
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), log| (low.min(log), high.max(log)));
    if low > high {
        return [0.1, 1.0];
    }
    let spare = (0.06 * (high - low)).max(0.1);
    [low - spare, high + spare].map(|log| 10.0_f64.powf(log))
}

/// Widths of a curve and its marks: the first are the widest, so that a curve that coincides with a later one shows
/// around it. A single mark is as large as any other.
fn nested(curve: &Series, number: usize, count: usize) -> (f64, f64) {
    let around = if curve.points.len() > 1 { count.saturating_sub(number + 1).min(2) as f64 } else { 0.5 };
    (1.9 + 1.5 * around, 3.6 + 1.3 * around)
}

fn panel(canvas: &mut Canvas, side: usize, across: &str, up: &str, curves: &[Series], front: &[(f64, f64)]) {
    let width = (WIDTH - 2.0 * MARGIN - BETWEEN) / 2.0;
    let x = MARGIN + side as f64 * (width + BETWEEN) + LEFT;
    let area = Area { x, y: 108.0, width: width - LEFT, height: HEIGHT };
    let all = || curves.iter().flat_map(|curve| &curve.points);
    let panel = Panel {
        area,
        across: Scale::logarithmic(around(all().map(|p| p.0)), across),
        up: Scale::logarithmic(around(all().map(|p| p.1)), up),
    };
    panel.grid(canvas, true);
    for &point in front {
        canvas.disc(panel.place(point), 10.0, colour::series(5).with_opacity(0.45));
    }
    let solid = curves.iter().filter(|curve| !curve.dashed && curve.points.len() > 1).count();
    for (number, curve) in curves.iter().enumerate() {
        let ink = colour::series(curve.colour);
        let (width, radius) = nested(curve, number % solid.max(1), solid);
        let shown: Vec<(f64, f64)> =
            curve.points.iter().map(|&(x, y)| if x > 0.0 && y > 0.0 { (x, y) } else { (f64::NAN, f64::NAN) }).collect();
        panel.curve(canvas, &shown, ink, if curve.dashed { 1.4 } else { width }, curve.dashed);
        if !curve.dashed {
            shown.iter().filter(|p| p.0.is_finite()).for_each(|&point| canvas.disc(panel.place(point), radius, ink));
        }
    }
    if all().next().is_none() {
        panel.note(canvas, "not measured");
    }
}

fn legend(canvas: &mut Canvas, curves: &[Series], more: Vec<Entry>) {
    let mark = |curve: &Series| if curve.dashed { Mark::Dashes } else { Mark::Line };
    let own = curves.iter().filter(|curve| !curve.name.is_empty()).map(|curve| Entry {
        name: curve.name.clone(),
        colour: colour::series(curve.colour),
        mark: mark(curve),
    });
    let entries: Vec<Entry> = own.chain(more).collect();
    let area = Area { x: MARGIN, y: 74.0, width: WIDTH - 2.0 * MARGIN, height: 0.0 };
    Panel { area, across: Scale::linear([0.0, 1.0], ""), up: Scale::linear([0.0, 1.0], "") }.legend(canvas, &entries);
}

fn sheet(title: &str, note: &str) -> Canvas {
    let mut canvas = Canvas::new(WIDTH, 108.0 + HEIGHT + 64.0);
    headline(&mut canvas, title);
    canvas.text((MARGIN, 60.0), note, NOTE);
    canvas
}

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
    let mut canvas = sheet(
        "Error of the rendered torque against grid spacing",
        &format!(
            "{} random configurations; rms torque {:.3} N m, known to {:.0e}",
            accuracy.configurations, accuracy.torque, accuracy.reference_error
        ),
    );
    let by = |place: fn(&Row) -> (f64, f64)| series(accuracy, Study::Spacing, place);
    let across = worst_too(by(|row| (row.value, row.rms)), by(|row| (row.value, row.worst)));
    panel(&mut canvas, 0, &format!("Grid spacing [{}]", accuracy.unit), "Error [N m]", &across, &[]);
    let costs = worst_too(by(|row| (row.solved as f64, row.rms)), by(|row| (row.solved as f64, row.worst)));
    let front: Vec<(f64, f64)> = accuracy.front().iter().map(|row| (row.solved as f64, row.rms)).collect();
    panel(&mut canvas, 1, "Points solved [1]", "Error [N m]", &costs, &front);
    let dashes = Entry { name: "worst".into(), colour: colour::SOFT_INK, mark: Mark::Dashes };
    let best = Entry { name: "Pareto front".into(), colour: colour::series(5), mark: Mark::Dot };
    legend(&mut canvas, &costs, vec![dashes, best]);
    canvas
}

/// Work around loops against their size, and what a look-up costs.
#[must_use]
pub(super) fn loops(accuracy: &Accuracy) -> Canvas {
    let mut canvas = sheet(
        "Work of the contact torque around closed loops, which a passive object never gives",
        &format!(
            "squares in the plane of two joints, rms over loops; the object stores {:.3} J at most, and zero is drawn \
             at the rounding of that",
            accuracy.greatest_energy
        ),
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
    panel(&mut canvas, 0, &format!("Side of the loop [{}]", accuracy.unit), "Work around the loop [J]", &curves, &[]);
    let mut looked = Vec::new();
    for (number, row) in accuracy.of(Study::Lookup).enumerate() {
        let points = vec![(row.cost.least, row.rms)];
        looked.push(Series { name: row.setting.clone(), points, dashed: false, colour: number });
    }
    panel(&mut canvas, 1, "Time of a look-up, relative to linear's [1]", "Rms error of the torque [N m]", &looked, &[]);
    legend(&mut canvas, &looked, Vec::new());
    canvas
}

/// The contact solver: error against time and against iterations, over tolerances, algorithms and arithmetic.
#[must_use]
pub(super) fn solver(accuracy: &Accuracy) -> Canvas {
    let mut canvas = sheet(
        "Error of a solved configuration against its time",
        "tolerance of the energy form, updates of linearised contact, the paper's iteration, arithmetic",
    );
    let curves = |place: fn(&Row) -> (f64, f64)| {
        let mut curves = series(accuracy, Study::Tolerance, place);
        curves.iter_mut().for_each(|curve| curve.name = "tolerance".to_owned());
        for study in [Study::Updates, Study::Algorithm, Study::Arithmetic] {
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
    panel(&mut canvas, 0, "Time of a configuration, relative to the scene's own [1]", "Rms error [N m]", &timed, &[]);
    let counted = curves(|row| (row.points as f64, row.rms));
    panel(&mut canvas, 1, "Iterations of a configuration in contact [1]", "Rms error [N m]", &counted, &[]);
    legend(&mut canvas, &timed, Vec::new());
    canvas
}

/// Draws how refining the scene changes the torque: mesh and contact nodes, which must converge, beside skin and
/// contact compliance, which describe the body.
#[must_use]
pub(super) fn refinement(accuracy: &Accuracy) -> Canvas {
    let mut canvas = sheet(
        "Change of the torque by the next step of refinement",
        "left: what only resolves the scene; right: what the scene is made of",
    );
    let mut all: Vec<Series> = Vec::new();
    let pairs = [[Study::Mesh, Study::Links], [Study::Skin, Study::Stiffness]];
    for (side, studies) in pairs.into_iter().enumerate() {
        let change = |study| series(accuracy, study, |row| (row.value, row.rms));
        let mut curves: Vec<Series> = studies.into_iter().flat_map(change).collect();
        curves.iter_mut().zip(all.len()..).for_each(|(curve, colour)| curve.colour = colour);
        let across = ["Length of edges, spacing of nodes", "Bending stiffness, compliance"][side];
        panel(
            &mut canvas,
            side,
            &format!("{across}, relative to the scene's own [1]"),
            "Rms change [N m]",
            &curves,
            &[],
        );
        all.extend(curves);
    }
    legend(&mut canvas, &all, Vec::new());
    canvas
}

/// Frame step and iterations of the graphics.
#[must_use]
pub(super) fn graphics(accuracy: &Accuracy) -> Canvas {
    let mut canvas = sheet(
        "Error of what is drawn",
        "a push and its release, relative to the rms of positions and energy; left: frame step; right: iterations on \
         the GPU",
    );
    let by = |study: Study| {
        let worst = series(accuracy, study, |row| (row.value, row.worst / row.size));
        worst_too(series(accuracy, study, |row| (row.value, row.rms / row.size)), worst)
    };
    let steps = by(Study::Frame);
    panel(&mut canvas, 0, "Frame step [s]", "Relative error [1]", &steps, &[]);
    panel(&mut canvas, 1, "Iterations a frame [1]", "Relative error [1]", &by(Study::Iterations), &[]);
    let dashes = Entry { name: "worst".into(), colour: colour::SOFT_INK, mark: Mark::Dashes };
    legend(&mut canvas, &steps, vec![dashes]);
    canvas
}
