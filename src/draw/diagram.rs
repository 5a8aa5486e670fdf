//! Diagrams with two logarithmic axes, panels side by side: every setting a dot, a curve through each series.

use super::{
    canvas::{Area, Canvas},
    chart::{MARGIN, headline},
    colour,
    plot::{self, Curve, Entry, NOTE, Panel, Scale},
};

/// Width of a sheet with two panels side by side, in points.
const WIDTH: f64 = 940.0;
/// Height of a panel.
const HEIGHT: f64 = 300.0;
/// Room above the first row of panels.
const ABOVE: f64 = 108.0;
/// Room below each row: tick labels and the title of the axis.
const BELOW: f64 = 64.0;
/// Room for the titles above a further row.
const TITLES: f64 = 28.0;
/// Room left of a panel for its tick labels.
const LEFT: f64 = 56.0;
/// Room between two panels.
const BETWEEN: f64 = 40.0;

/// Panels in rows of two.
pub struct Diagram {
    canvas: Canvas,
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
fn nested(curve: &Curve, number: usize, count: usize) -> (f64, f64) {
    let around = if curve.points.len() > 1 { count.saturating_sub(number + 1).min(2) as f64 } else { 0.5 };
    (1.9 + 1.5 * around, 3.6 + 1.3 * around)
}

impl Diagram {
    /// A sheet with room for so many rows of panels.
    #[must_use]
    pub fn new(title: &str, note: &str, rows: usize) -> Self {
        let mut canvas = Canvas::new(WIDTH, ABOVE - TITLES + rows as f64 * (TITLES + HEIGHT + BELOW));
        headline(&mut canvas, title);
        canvas.text((MARGIN, 60.0), note, NOTE);
        Self { canvas }
    }

    /// Draws panel `number`, counted row by row from the left, with the points of `front` marked. What is not positive
    /// interrupts a curve; dashed ones have no dots.
    pub fn panel(&mut self, number: usize, across: &str, up: &str, curves: &[Curve], front: &[(f64, f64)]) {
        let canvas = &mut self.canvas;
        let width = (WIDTH - 2.0 * MARGIN - BETWEEN) / 2.0;
        let x = MARGIN + (number % 2) as f64 * (width + BETWEEN) + LEFT;
        let y = ABOVE + (number / 2) as f64 * (TITLES + HEIGHT + BELOW);
        let all = || curves.iter().flat_map(|curve| &curve.points);
        let panel = Panel {
            area: Area { x, y, width: width - LEFT, height: HEIGHT },
            across: Scale::logarithmic(around(all().map(|p| p.0)), across),
            up: Scale::logarithmic(around(all().map(|p| p.1)), up),
        };
        panel.grid(canvas, true);
        for &point in front {
            canvas.disc(panel.place(point), 10.0, colour::series(5).with_opacity(0.45));
        }
        let solid = curves.iter().filter(|curve| !curve.dashed && curve.points.len() > 1).count();
        for (number, curve) in curves.iter().enumerate() {
            let ink = curve.colour;
            let (width, radius) = nested(curve, number % solid.max(1), solid);
            let shown: Vec<(f64, f64)> = curve
                .points
                .iter()
                .map(|&(x, y)| if x > 0.0 && y > 0.0 { (x, y) } else { (f64::NAN, f64::NAN) })
                .collect();
            panel.curve(canvas, &shown, ink, if curve.dashed { 1.4 } else { width }, curve.dashed);
            if !curve.dashed {
                shown
                    .iter()
                    .filter(|p| p.0.is_finite())
                    .for_each(|&point| canvas.disc(panel.place(point), radius, ink));
            }
        }
        if all().next().is_none() {
            panel.note(canvas, "not measured");
        }
    }

    /// Draws the legend of `curves`, and of `more` after them.
    pub fn legend(&mut self, curves: &[Curve], more: Vec<Entry>) {
        let entries: Vec<Entry> = plot::entries(curves).chain(more).collect();
        plot::legend(&mut self.canvas, (WIDTH - MARGIN, 63.0), &entries);
    }

    /// The sheet.
    #[must_use]
    pub fn canvas(self) -> Canvas {
        self.canvas
    }
}
