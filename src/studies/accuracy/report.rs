//! The files of a study: its table as CSV, and three work-precision diagrams, error up, cost across, both logarithmic.

use super::{Accuracy, Row, Study};
use crate::{
    Error,
    csv::{Table, quoted},
    draw::{
        canvas::Canvas,
        colour,
        diagram::Diagram,
        plot::{Curve, Entry, Mark},
    },
    report::{write, write_both},
    scene::ContactLaw,
};
use std::{
    io,
    path::{Path, PathBuf},
};

/// Files that [`write_all`] writes.
pub const FILES: [&str; 7] = [
    "accuracy-spacing.svg",
    "accuracy-spacing.png",
    "accuracy-time.svg",
    "accuracy-time.png",
    "accuracy-refinement.svg",
    "accuracy-refinement.png",
    "accuracy.csv",
];

/// Writes [`FILES`] into `folder`, and returns their paths.
///
/// # Errors
/// When a file cannot be written.
pub fn write_all(folder: &Path, accuracy: &Accuracy) -> Result<Vec<PathBuf>, Error> {
    let mut files = Vec::new();
    files.extend(write_both(folder, "accuracy-spacing", &spacing(accuracy))?);
    files.extend(write_both(folder, "accuracy-time", &time(accuracy))?);
    files.extend(write_both(folder, "accuracy-refinement", &refinement(accuracy))?);
    files.push(write(folder.join("accuracy.csv"), &csv(accuracy).unwrap_or_default())?);
    Ok(files)
}

fn csv(accuracy: &Accuracy) -> io::Result<Vec<u8>> {
    let mut text = Vec::new();
    let mut table = Table::new(&mut text);
    table.fields(["study", "series", "setting", "value", "points", "solved", "size [B]", "cost [1]"])?;
    let unit = accuracy.norm.name();
    table.fields([format!("rms [{unit}]"), format!("worst [{unit}]"), "relative rms [1]".to_owned()])?.end()?;
    for row in &accuracy.rows {
        let study = match row.study {
            Study::Spacing => "spacing",
            Study::Lookup => "look-up",
            Study::Tolerance => "tolerance",
            Study::Law => "law",
            Study::Mesh => "mesh",
            Study::Links => "link nodes",
            Study::Skin => "skin",
            Study::Stiffness => "contact stiffness",
        };
        table.field(study)?.field(&row.series)?.field(quoted(&row.setting))?.field(row.value)?;
        table.fields([row.points, row.solved, row.bytes])?;
        table.fields([row.cost, row.rms, row.worst, accuracy.relative(row)])?.end()?;
    }
    Ok(text)
}

/// A curve for each series of `study`, in the order of the rows.
fn curves(accuracy: &Accuracy, study: Study, place: fn(&Row) -> (f64, f64)) -> Vec<Curve> {
    let mut curves: Vec<Curve> = Vec::new();
    for row in accuracy.of(study) {
        match curves.iter_mut().find(|curve| curve.name == row.series) {
            Some(curve) => curve.points.push(place(row)),
            None => curves.push(Curve::new(&row.series, curves.len(), [place(row)])),
        }
    }
    curves
}

/// Draws both panels of a sheet, each with its title, and all curves in the legend, in colours of their own.
fn pair(sheet: &mut Diagram, up: &str, mut panels: [(String, Vec<Curve>); 2]) {
    let all = panels.iter_mut().flat_map(|(_, curves)| curves);
    all.enumerate().for_each(|(number, curve)| curve.colour = colour::series(number));
    for (number, (across, curves)) in panels.iter().enumerate() {
        sheet.panel(number, across, up, curves, &[]);
    }
    sheet.legend(&panels.map(|(_, curves)| curves).concat(), Vec::new());
}

/// Error against spacing and against grid points, with the Pareto front.
fn spacing(accuracy: &Accuracy) -> Canvas {
    let Accuracy { configurations, torque, reference_error, unit, .. } = accuracy;
    let effort = accuracy.norm.name();
    let mut sheet = Diagram::new(
        "Error of the rendered torque against grid spacing",
        &format!(
            "{configurations} random configurations; rms torque {torque:.3} {effort}, known to {reference_error:.0e} {effort}"
        ),
        1,
    );
    let with_worst = |rms, worst| {
        let worst = curves(accuracy, Study::Spacing, worst).into_iter();
        let mut all = curves(accuracy, Study::Spacing, rms);
        all.extend(worst.map(|curve| Curve { name: String::new(), dashed: true, ..curve }));
        all
    };
    let across = with_worst(|row| (row.value, row.rms), |row| (row.value, row.worst));
    sheet.panel(0, &format!("Grid spacing [{unit}]"), &format!("Error [{effort}]"), &across, &[]);
    let costs = with_worst(|row| (row.solved as f64, row.rms), |row| (row.solved as f64, row.worst));
    let front: Vec<(f64, f64)> = accuracy.front().iter().map(|row| (row.solved as f64, row.rms)).collect();
    sheet.panel(1, "Points solved [1]", &format!("Error [{effort}]"), &costs, &front);
    let dashes = Entry { name: "worst".into(), colour: colour::SOFT_INK, mark: Mark::Dashes };
    let best = Entry { name: "Pareto front".into(), colour: colour::series(5), mark: Mark::Dot };
    sheet.legend(&costs, vec![dashes, best]);
    sheet.canvas()
}

/// Error against the time of a configuration, over tolerances and both laws of contact, and against that of a tick.
fn time(accuracy: &Accuracy) -> Canvas {
    let title = "Error of the torque against the time that it takes";
    let mut sheet = Diagram::new(title, "left: a configuration solved offline; right: a tick of the loop", 1);
    let curves = |study| curves(accuracy, study, |row| (row.cost, row.rms));
    // The energy form at the scene's own tolerance is a dot of the curve of tolerances.
    let rest = curves(Study::Law).into_iter().filter(|curve| curve.name == ContactLaw::Rest.name());
    let solved = curves(Study::Tolerance).into_iter().chain(rest).collect();
    let left = ("Time of a configuration, over the scene's own [1]".to_owned(), solved);
    let right = ("Time a tick, over linear's look-up [1]".to_owned(), curves(Study::Lookup));
    pair(&mut sheet, &format!("Rms error [{}]", accuracy.norm.name()), [left, right]);
    sheet.canvas()
}

/// How refining the scene changes the torque: mesh and contact nodes, which must converge, beside skin and contact
/// compliance, which describe the body.
fn refinement(accuracy: &Accuracy) -> Canvas {
    let title = "Change of the torque by the next step of refinement";
    let mut sheet = Diagram::new(title, "left: what only resolves the scene; right: what the scene is made of", 1);
    let panel = |what: &str, studies: [Study; 2]| {
        let curves = studies.into_iter().flat_map(|study| curves(accuracy, study, |row| (row.value, row.rms)));
        (format!("{what}, relative to the scene's own [1]"), curves.collect())
    };
    let left = panel("Length of edges, spacing of nodes", [Study::Mesh, Study::Links]);
    let right = panel("Bending stiffness, compliance", [Study::Skin, Study::Stiffness]);
    pair(&mut sheet, &format!("Rms change [{}]", accuracy.norm.name()), [left, right]);
    sheet.canvas()
}
