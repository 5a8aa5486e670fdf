//! The procedure of C-space data-driven haptic rendering (the paper's Fig. 2): from virtual and real objects through
//! the dataset to the haptic and the graphics loop, with the numbers of a run.

use super::{Scans, Sphere, comparison::inside};
use crate::draw::{
    canvas::{Anchor, Area, Canvas},
    chart,
    colour::{self, Colour},
    plot, ticks,
};

const WIDTH: f64 = 1052.0;
const HEIGHT: f64 = 440.0;
/// Extent of a box.
const BOX: [f64; 2] = [182.0, 70.0];
/// Left edges of the columns: objects, their haptization, the dataset, the two columns of the loops.
const COLUMNS: [f64; 5] = [36.0, 250.0, 470.0, 632.0, 846.0];
/// Top edges of the rows.
const ROWS: [f64; 3] = [118.0, 228.0, 338.0];
const DATASET_WIDTH: f64 = 136.0;
const ARROW: Colour = colour::SOFT_INK;

/// Where the boxes are.
struct Boxes {
    virtual_object: Area,
    real_object: Area,
    solver: Area,
    scan: Area,
    gridization: Area,
    dataset: Area,
    interpolation: Area,
    proxy: Area,
    device: Area,
    coupling: Area,
    forces: Area,
    motion: Area,
}

impl Boxes {
    fn new() -> Self {
        let [objects, haptization, dataset, first, second] = COLUMNS;
        let place = |x: f64, row: usize| Area { x, y: ROWS[row], width: BOX[0], height: BOX[1] };
        Self {
            virtual_object: place(objects, 0),
            real_object: place(objects, 1),
            solver: place(haptization, 0),
            scan: place(haptization, 1),
            gridization: place(haptization, 2),
            dataset: Area { x: dataset, y: ROWS[0], width: DATASET_WIDTH, height: ROWS[2] + BOX[1] - ROWS[0] },
            interpolation: place(first, 0),
            proxy: place(second, 0),
            device: place(first, 1),
            coupling: place(second, 1),
            forces: place(first, 2),
            motion: place(second, 2),
        }
    }
}

/// Draws the procedure.
#[must_use]
pub fn procedure(sphere: Sphere<'_>, scans: Scans<'_>) -> Canvas {
    let mut canvas = Canvas::new(WIDTH, HEIGHT);
    chart::headline(&mut canvas, "Procedure of C-space data-driven haptic rendering");
    band(&mut canvas, COLUMNS[0], COLUMNS[1] + BOX[0], "Haptization, beforehand (section 2)");
    band(&mut canvas, COLUMNS[3], COLUMNS[4] + BOX[0], "Rendering, in real time (section 3)");
    let boxes = Boxes::new();
    haptization(&mut canvas, &boxes, sphere, scans);
    rendering(&mut canvas, &boxes, sphere);
    arrows(&mut canvas, &boxes);
    canvas
}

/// Draws the boxes from the objects to the dataset.
fn haptization(canvas: &mut Canvas, boxes: &Boxes, sphere: Sphere<'_>, scans: Scans<'_>) {
    let count = ticks::thousands;
    let nodes = sphere.dataset.surface.as_ref().map_or(0, |surface| surface.nodes.len() / 3);
    let points = sphere.dataset.grid.points();
    labelled(canvas, boxes.virtual_object, "Virtual object", &[&format!("{nodes} nodes, springs Kn"), "and ground Kg"]);
    let solved = format!("nodes at {} q", count(points));
    labelled(canvas, boxes.solver, "Contact solver", &["equilibrium (2) and contact", &solved]);
    labelled(canvas, boxes.real_object, "Real object", &["a spongy block,", "simulated here"]);
    let samples = [scans.bare, scans.side].map(|scanned| count(scanned.samples.len()));
    let scanned = format!("{} and {} q", samples[0], samples[1]);
    labelled(canvas, boxes.scan, "Scan under PD control", &["τ = −(control torque) at", &scanned]);
    let step = scans.bare.dataset.grid.axes.first().map_or(0.0, |axis| axis.step);
    let gridded = format!("of {} rad", ticks::number(step, 2));
    labelled(canvas, boxes.gridization, "Uniform gridization", &["scattered torques to a grid", &gridded]);
    let gridized = [scans.bare, scans.side].map(|scanned| count(inside(scanned)));
    let lines = [
        "configuration q",
        "torque τ(q)",
        "",
        "virtual objects also",
        "nodes Cvo(q)",
        "forces fj(q)",
        "",
        "grid points",
        &format!("{} of the sphere", count(points)),
        &format!("{} of the block", gridized[0]),
        &format!("{} of its side", gridized[1]),
    ];
    labelled(canvas, boxes.dataset, "Dataset D(q)", &lines);
}

/// Draws the boxes of the two loops.
fn rendering(canvas: &mut Canvas, boxes: &Boxes, sphere: Sphere<'_>) {
    let haptics = &sphere.scene.haptics;
    let graphics = sphere.scene.graphics.map_or(0.0, |graphics| graphics.rate);
    loop_title(canvas, boxes.interpolation, &format!("Haptic loop, {} Hz", haptics.rate));
    loop_title(canvas, boxes.forces, &format!("Graphics loop, {graphics} Hz"));
    let threshold = format!("where contact index > {},", haptics.threshold);
    labelled(canvas, boxes.interpolation, "Interpolated torque", &[&threshold, "smoothed with slope Ks"]);
    labelled(canvas, boxes.proxy, "Virtual proxy", &["multi-link, stepped", "passively (NPMI)"]);
    labelled(canvas, boxes.coupling, "Virtual coupling", &["spring Kvc, damper Bvc"]);
    labelled(canvas, boxes.device, "Haptic device", &["position y from the hand,", "torque τ(t) to it"]);
    labelled(canvas, boxes.forces, "Interpolated forces", &["fj on the nodes Cvo", "at the proxy's q"]);
    labelled(canvas, boxes.motion, "Deforming object", &["nodes n stepped", "passively (NPMI), drawn"]);
}

/// Draws the arrows between the boxes.
fn arrows(canvas: &mut Canvas, boxes: &Boxes) {
    across(canvas, boxes.virtual_object, boxes.solver, false);
    across(canvas, boxes.real_object, boxes.scan, false);
    across(canvas, boxes.solver, boxes.dataset, false);
    across(canvas, boxes.gridization, boxes.dataset, false);
    down(canvas, boxes.scan, boxes.gridization, false);
    across(canvas, boxes.dataset, boxes.interpolation, false);
    across(canvas, boxes.dataset, boxes.forces, false);
    across(canvas, boxes.interpolation, boxes.proxy, true);
    down(canvas, boxes.proxy, boxes.coupling, true);
    across(canvas, boxes.device, boxes.coupling, true);
    across(canvas, boxes.forces, boxes.motion, false);
}

/// Shades the boxes that belong together, from `left` to `right`, under their title.
fn band(canvas: &mut Canvas, left: f64, right: f64, title: &str) {
    let top = chart::MARGIN + 36.0;
    let area = Area { x: left - 12.0, y: top, width: right - left + 24.0, height: HEIGHT - top - 16.0 };
    canvas.rectangle(area, colour::SHADE);
    canvas.text((left, top + 22.0), title, plot::TITLE);
}

/// Writes the name of a loop above its first box.
fn loop_title(canvas: &mut Canvas, first: Area, title: &str) {
    canvas.text((first.x, first.y - 8.0), title, plot::TICK.anchored(Anchor::Start));
}

/// Draws a box with its name and a few lines about it.
fn labelled(canvas: &mut Canvas, area: Area, name: &str, lines: &[&str]) {
    canvas.rectangle(area, colour::WHITE);
    canvas.frame(area, colour::FRAME, 1.2);
    let x = area.x + 12.0;
    canvas.text((x, area.y + 23.0), name, plot::TITLE);
    for (number, line) in lines.iter().enumerate().filter(|(_, line)| !line.is_empty()) {
        canvas.text((x, area.y + 42.0 + 16.0 * number as f64), line, plot::TICK.anchored(Anchor::Start));
    }
}

/// Draws an arrow from the right edge of a box to the left edge of another, at the height of the lower box of the two.
fn across(canvas: &mut Canvas, from: Area, to: Area, both_ways: bool) {
    let lower = if from.height < to.height { from } else { to };
    let y = lower.y + lower.height / 2.0;
    arrow(canvas, (from.right(), y), (to.x, y), both_ways);
}

/// Draws an arrow from the lower edge of a box to the upper edge of the box below it.
fn down(canvas: &mut Canvas, from: Area, to: Area, both_ways: bool) {
    let x = from.x + from.width / 2.0;
    arrow(canvas, (x, from.bottom()), (x, to.y), both_ways);
}

/// Draws an arrow along an axis of the sheet.
fn arrow(canvas: &mut Canvas, from: (f64, f64), to: (f64, f64), both_ways: bool) {
    const HEAD: f64 = 8.0;
    let length = (to.0 - from.0).hypot(to.1 - from.1);
    let (x, y) = ((to.0 - from.0) / length, (to.1 - from.1) / length);
    let mut head = |tip: (f64, f64), sign: f64| {
        let base = (tip.0 - sign * HEAD * x, tip.1 - sign * HEAD * y);
        let side = |side: f64| (base.0 - side * 0.45 * HEAD * y, base.1 + side * 0.45 * HEAD * x);
        canvas.polygon(&[tip, side(1.0), side(-1.0)], ARROW);
        base
    };
    let end = head(to, 1.0);
    let start = if both_ways { head(from, -1.0) } else { from };
    canvas.polyline(&[start, end], ARROW, 1.6, None);
}
