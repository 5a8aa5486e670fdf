//! The files of a study: figures, one table of all rows as CSV, and one page that holds them all.

use super::{
    Accuracy, Cost, Row, Study,
    choice::{TARGETS, limits, offers},
    effects::{self, Effects},
    escaped, figures,
};
use crate::{
    csv::{Table, quoted},
    report::{ReportError, canvas::Canvas, write, write_both},
    scene::Interpolation,
};
use std::{
    fmt::{self, Write as _},
    io,
    path::{Path, PathBuf},
};

/// Files that [`write_all`] may write.
pub const FILES: [&str; 15] = [
    "accuracy-spacing.svg",
    "accuracy-spacing.png",
    "accuracy-loops.svg",
    "accuracy-loops.png",
    "accuracy-solver.svg",
    "accuracy-solver.png",
    "accuracy-refinement.svg",
    "accuracy-refinement.png",
    "accuracy-graphics.svg",
    "accuracy-graphics.png",
    "accuracy.csv",
    "accuracy.html",
    "effects.svg",
    "effects.png",
    "effects.csv",
];

/// Writes `accuracy-*.{svg,png}`, `accuracy.csv` and `accuracy.html` into `folder`, and returns their paths; where
/// effects were priced, also `effects.{svg,png,csv}`.
///
/// # Errors
/// [`ReportError::Write`] when a file cannot be written.
pub fn write_all(folder: &Path, accuracy: &Accuracy) -> Result<Vec<PathBuf>, ReportError> {
    let sheets: [(&str, Canvas, &str); 5] = [
        (
            "accuracy-spacing",
            figures::spacing(accuracy),
            "Solid curves are rms errors, dashed ones the worst. Where contact begins, where another node of the \
             proxy touches and where a contact passes from one facet to the next, the torque has a kink or a jump: \
             such places fill a layer of one cell, whose share falls with the spacing, so that the curves bend \
             towards the order 0.5 (jumps) or 1.5 (kinks) however smooth the interpolation is in between. The knee is \
             where smooth cells stop to count.",
        ),
        (
            "accuracy-loops",
            figures::loops(accuracy),
            "Left: linear torque, component by component, is no gradient: it gives or takes energy around a loop. The \
             potential's work is zero to rounding. Where curves coincide, the first shows around the second. Right: \
             what a look-up of each costs at the scene's own spacing, and `direct`, with an equilibrium solved every \
             tick (right end) to every eight ticks, whose time is that of the other core; the hand moves at 0.2 m/s.",
        ),
        (
            "accuracy-solver",
            figures::solver(accuracy),
            "A tolerance below the knee buys nothing that interpolation does not throw away. `rest` \
             takes depths and directions before the surface at rest, which is another law; the paper's iteration \
             has its own fixed point, or none: the table counts what did not converge.",
        ),
        (
            "accuracy-refinement",
            figures::refinement(accuracy),
            "Each dot compares a setting with the next finer one. Left: where such a curve does not fall to the left, \
             torque does not converge. Right: another skin or contact stiffness is another body.",
        ),
        (
            "accuracy-graphics",
            figures::graphics(accuracy),
            "Errors of the nodes' positions and of the object's energy, relative to what they are themselves. Left: \
             by the frame step, against a step of 1/3840 s; where the object's vibration is followed they fall with \
             its square. Right: by the iterations of the GPU's solver, against an exact one at the same step; the \
             floor is f32. Few iterations move the object sluggishly, and never make it gain energy.",
        ),
    ];
    let mut files = Vec::new();
    for (name, canvas, _) in &sheets {
        files.extend(write_both(folder, name, canvas)?);
    }
    files.push(write(folder.join("accuracy.csv"), &csv(accuracy).unwrap_or_default())?);
    let priced = accuracy.effects.as_ref().map(|priced| (priced, effects::figure(priced)));
    if let Some((effects, figure)) = &priced {
        files.extend(write_both(folder, "effects", figure)?);
        files.push(write(folder.join("effects.csv"), &effects::csv(effects).unwrap_or_default())?);
    }
    let html = page(accuracy, &sheets, priced.as_ref()).unwrap_or_default();
    files.push(write(folder.join("accuracy.html"), html.as_bytes())?);
    Ok(files)
}

fn csv(accuracy: &Accuracy) -> io::Result<Vec<u8>> {
    let mut text = Vec::new();
    let mut table = Table::new(&mut text);
    let costs = ["cost_median", "cost_least", "cost_greatest"];
    table.fields(["study", "series", "setting", "value", "points", "solved", "bytes"])?.fields(costs)?;
    table.fields(["unit", "rms", "worst", "rms_relative"])?.end()?;
    for row in &accuracy.rows {
        let Cost { median, least, greatest } = row.cost;
        table.field(study_name(row.study))?.field(&row.series)?.field(quoted(&row.setting))?.field(row.value)?;
        table.field(row.points)?.field(row.solved)?.field(row.bytes)?.fields([median, least, greatest])?;
        table.field(row.unit)?.fields([row.rms, row.worst, row.rms / row.size])?.end()?;
    }
    Ok(text)
}

fn study_name(study: Study) -> &'static str {
    match study {
        Study::Spacing => "spacing",
        Study::Tolerance => "tolerance",
        Study::Algorithm => "algorithm",
        Study::Arithmetic => "arithmetic",
        Study::Mesh => "mesh",
        Study::Links => "link nodes",
        Study::Skin => "skin",
        Study::Stiffness => "contact stiffness",
        Study::Lookup => "look-up",
        Study::Frame => "frame",
        Study::Iterations => "iterations",
    }
}

/// Describes which grid to take for which error, and what was measured, for people.
///
/// # Errors
/// None in a `String`.
pub fn describe(text: &mut String, accuracy: &Accuracy) -> fmt::Result {
    writeln!(
        text,
        "{}: {} random configurations, {} in contact, {} left out; rms torque {:.4} N m, the reference errs by {:.1e}",
        accuracy.scene,
        accuracy.configurations,
        accuracy.in_contact,
        accuracy.left_out,
        accuracy.torque,
        accuracy.reference_error
    )?;
    for interpolation in Interpolation::ALL {
        if let Some(order) = accuracy.order(interpolation.name()) {
            writeln!(
                text,
                "  order        {:<9} error falls with spacing to the power {order:.2}",
                interpolation.name()
            )?;
        }
    }
    for offer in offers(accuracy) {
        writeln!(
            text,
            "  for {:4.0} %   take {} at {:.4} {}: {:.0} points, {:.2} of the scene's bake{}",
            100.0 * offer.target,
            offer.series,
            offer.spacing,
            accuracy.unit,
            offer.points,
            offer.cost,
            if offer.measured { "" } else { " (not measured: by the order)" }
        )?;
    }
    if let Some(least) = unreached(accuracy) {
        writeln!(
            text,
            "  below {:2.0} %   out of reach: no grid up to four times as fine as the finest here",
            100.0 * least
        )?;
    }
    for study in [Study::Mesh, Study::Links, Study::Skin, Study::Stiffness] {
        let Some(own) = accuracy.of(study).find(|row| row.value == 1.0) else { continue };
        write!(text, "  {:<12} the next step changes {:.2} %", own.series, 100.0 * own.rms / own.size)?;
        match accuracy.refinement_order(study).filter(|order| *order > 0.0) {
            Some(order) => writeln!(text, "; changes fall with the power {order:.2}")?,
            None => writeln!(text, "; changes do not fall")?,
        }
    }
    let errs = |row: &Row| match 100.0 * row.rms / row.size {
        error if error < 0.01 => format!("{} below 0.01 %", row.setting),
        error => format!("{} {error:.2} %", row.setting),
    };
    let [looked, followed] = [false, true].map(|direct| {
        let rows = accuracy.of(Study::Lookup).filter(|row| (row.series == Interpolation::Direct.name()) == direct);
        rows.map(errs).collect::<Vec<_>>().join(", ")
    });
    writeln!(text, "  look-up      `linear` {:.0} ns; errors: {looked}", 1e9 * accuracy.look_up)?;
    writeln!(
        text,
        "  direct       {:.0} us a solution in contact; errors, solved {followed}",
        1e6 * accuracy.solution
    )?;
    let limits = limits(accuracy);
    let limits: Vec<String> = limits.iter().map(|limit| format!("{} {:.2} %", limit.of, 100.0 * limit.error)).collect();
    if !limits.is_empty() {
        writeln!(text, "  limited by   {}", limits.join(", "))?;
    }
    accuracy.notes.iter().try_for_each(|note| writeln!(text, "  note         {note}"))?;
    accuracy.effects.as_ref().map_or(Ok(()), |effects| effects::describe(text, effects))
}

/// The smallest error on offer, where smaller ones were asked for in vain; the greatest that was asked for, where there
/// is no offer at all (1).
fn unreached(accuracy: &Accuracy) -> Option<f64> {
    let offers = offers(accuracy);
    let least = offers.iter().map(|offer| offer.target).fold(TARGETS[0], f64::min);
    (offers.len() < TARGETS.len()).then_some(least)
}

fn page(
    accuracy: &Accuracy,
    sheets: &[(&str, Canvas, &str)],
    priced: Option<&(&Effects, Canvas)>,
) -> Result<String, fmt::Error> {
    let mut html = String::new();
    let name = escaped(&accuracy.scene);
    write!(
        html,
        "<!doctype html>\n<html lang=\"en\"><meta charset=\"utf-8\"><title>What accuracy costs: {name}</title>\n<style>\
         body{{font:16px/1.5 system-ui,sans-serif;max-width:980px;margin:2em auto;padding:0 1em;color:#222b36}}\
         table{{border-collapse:collapse;font-size:14px}}td,th{{padding:.2em .8em;text-align:right;white-space:nowrap;\
         border-bottom:1px solid #e2e6ec}}td:first-child,th:first-child{{text-align:left}}\
         svg{{max-width:100%;height:auto}}</style>\n\
         <h1>What accuracy costs in time: {name}</h1>\n<p>Reference: {} random configurations solved directly to a \
         residual of {:.0e}, {} in contact, {} left out because contact did not converge there. The rms torque is \
         {:.4} N m; the reference itself errs by {:.1e} N m. Times are ratios, the least of {} runs; accuracy is the \
         same in every run.</p>\n",
        accuracy.configurations,
        crate::sweep::REFERENCE_TOLERANCE,
        accuracy.in_contact,
        accuracy.left_out,
        accuracy.torque,
        accuracy.reference_error,
        accuracy.rounds
    )?;
    offers_table(&mut html, accuracy)?;
    for (_, canvas, caption) in sheets {
        writeln!(html, "<figure>{}<figcaption>{caption}</figcaption></figure>", canvas.svg())?;
    }
    if let Some((effects, figure)) = priced {
        effects::html(&mut html, effects, figure)?;
    }
    all_rows(&mut html, accuracy)?;
    for note in &accuracy.notes {
        writeln!(html, "<p>Note: {}</p>", escaped(note))?;
    }
    html.push_str("</html>\n");
    Ok(html)
}
/// Writes which grid reaches which error.
fn offers_table(html: &mut String, accuracy: &Accuracy) -> fmt::Result {
    html.push_str(
        "<h2>For which error take what</h2>\n<table><tr><th>error<th>interpolation<th>spacing<th>points<th>bake time",
    );
    html.push_str("<th>how known</tr>\n");
    for offer in offers(accuracy) {
        writeln!(
            html,
            "<tr><td>{:.0} %<td>{}<td>{:.4}<td>{:.0}<td>{:.2}<td>{}</tr>",
            100.0 * offer.target,
            offer.series,
            offer.spacing,
            offer.points,
            offer.cost,
            if offer.measured { "measured" } else { "predicted by the measured order" }
        )?;
    }
    html.push_str("</table>\n");
    if let Some(least) = unreached(accuracy) {
        writeln!(
            html,
            "<p>Less than {:.0} % is out of reach of grids up to four times as fine as the finest here.</p>",
            100.0 * least
        )?;
    }
    Ok(())
}

/// Writes the table of all rows of all studies.
fn all_rows(html: &mut String, accuracy: &Accuracy) -> fmt::Result {
    html.push_str(
        "<h2>All rows</h2>\n<table><tr><th>study<th>series<th>setting<th>points or iterations<th>solved<th>bytes",
    );
    html.push_str("<th>time<th>median<th>most<th>rms<th>worst<th>unit<th>relative</tr>\n");
    for row in &accuracy.rows {
        writeln!(
            html,
            "<tr><td>{}<td>{}<td>{}<td>{}<td>{}<td>{}<td>{:.3}<td>{:.3}<td>{:.3}<td>{:.3e}<td>{:.3e}<td>{}<td>{:.2} \
             %</tr>",
            study_name(row.study),
            escaped(&row.series),
            escaped(&row.setting),
            row.points,
            row.solved,
            row.bytes,
            row.cost.least,
            row.cost.median,
            row.cost.greatest,
            row.rms,
            row.worst,
            row.unit,
            100.0 * row.rms / row.size
        )?;
    }
    html.push_str("</table>\n");
    Ok(())
}
