//! Whole charts: curves in panels stacked over one horizontal axis, and histograms.

use super::{
    canvas::{Area, Canvas},
    colour,
    plot::{self, Curve, Entry, Mark, Panel, Scale},
    ticks,
};

/// Width of a chart's sheet, in points.
const WIDTH: f64 = 760.0;
/// Margin of every sheet.
pub(crate) const MARGIN: f64 = 24.0;
/// Room for the tick labels left of a panel.
const LEFT: f64 = 40.0;
/// Room for the title and legend above a panel.
const ABOVE: f64 = 40.0;
/// Room for the tick labels and the title below the lowest panel.
const BELOW: f64 = 52.0;

/// One panel of a stack.
#[derive(Clone, Debug)]
pub struct Lane {
    /// Name and unit of the vertical axis.
    pub title: String,
    /// Its curves.
    pub curves: Vec<Curve>,
    /// Height in points.
    pub height: f64,
    /// Whether the curves count something: whole numbers from zero.
    pub counts: bool,
}

/// Panels over one horizontal axis.
#[derive(Clone, Debug)]
pub struct Stack {
    /// Title of the figure.
    pub headline: String,
    /// Name and unit of the horizontal axis.
    pub across: String,
    /// From the top.
    pub lanes: Vec<Lane>,
    /// Intervals of the horizontal axis in contact, shaded in all panels.
    pub contact: Vec<[f64; 2]>,
}

impl Stack {
    /// The chart on a sheet. Panels without a single finite point say so.
    #[must_use]
    pub fn draw(&self) -> Canvas {
        let top = MARGIN + 16.0;
        let height: f64 = self.lanes.iter().map(|lane| lane.height + ABOVE).sum();
        let mut canvas = Canvas::new(WIDTH, top + height + BELOW + MARGIN / 2.0);
        headline(&mut canvas, &self.headline);
        if !self.contact.is_empty() {
            let shade = Entry { name: "in contact".into(), colour: colour::SHADE, mark: Mark::Box };
            plot::legend(&mut canvas, (WIDTH - MARGIN, MARGIN + 12.0), &[shade]);
        }
        let times =
            self.lanes.iter().flat_map(|lane| &lane.curves).flat_map(|curve| &curve.points).map(|point| point.0);
        let across = Scale::linear(ticks::snapped(ticks::range(times, 0.0)), &self.across);
        let mut y = top;
        for (number, lane) in self.lanes.iter().enumerate() {
            let area = Area { x: MARGIN + LEFT, y: y + ABOVE, width: WIDTH - 2.0 * MARGIN - LEFT, height: lane.height };
            lane.draw(&mut canvas, area, &across, &self.contact, number + 1 == self.lanes.len());
            y = area.bottom();
        }
        canvas
    }
}

impl Lane {
    /// A panel of `curves`, as high as most.
    #[must_use]
    pub fn new(title: impl Into<String>, curves: Vec<Curve>) -> Self {
        Self { title: title.into(), curves, height: 130.0, counts: false }
    }

    fn draw(&self, canvas: &mut Canvas, area: Area, across: &Scale, shaded: &[[f64; 2]], lowest: bool) {
        let values = || self.curves.iter().flat_map(|curve| &curve.points).map(|point| point.1);
        let [mut low, high] = ticks::range(values(), 0.06);
        // What is never negative begins at zero, not at the margin below it.
        if low < 0.0 && !values().any(|value| value < 0.0) {
            low = 0.0;
        }
        let up =
            if self.counts { Scale::whole([low, high], &self.title) } else { Scale::linear([low, high], &self.title) };
        let panel = Panel { area, across: across.clone(), up };
        for &interval in shaded {
            panel.shade(canvas, interval, colour::SHADE);
        }
        panel.grid(canvas, lowest);
        panel.zero_line(canvas);
        for curve in &self.curves {
            let width = if curve.dashed { 1.5 } else { 1.9 };
            panel.curve(canvas, &curve.points, curve.colour, width, curve.dashed);
        }
        if !values().any(f64::is_finite) {
            panel.note(canvas, "no data");
        }
        panel.legend(canvas, &plot::entries(&self.curves).collect::<Vec<_>>());
    }
}

/// Counts over bins, both axes logarithmic: what happens rarely matters as much as what happens always.
#[derive(Clone, Debug)]
pub struct Histogram {
    /// Title of the figure.
    pub headline: String,
    /// Name and unit of the horizontal axis.
    pub across: String,
    /// Name of the vertical axis.
    pub up: String,
    /// Lower end, upper end and count of each bin, ascending.
    pub bins: Vec<([f64; 2], u64)>,
    /// Values to point out, each with its text.
    pub marks: Vec<(f64, String)>,
}

impl Histogram {
    /// The histogram on a sheet; empty bins leave gaps.
    #[must_use]
    pub fn draw(&self) -> Canvas {
        let area =
            Area { x: MARGIN + LEFT, y: MARGIN + 16.0 + ABOVE, width: WIDTH - 2.0 * MARGIN - LEFT, height: 250.0 };
        let mut canvas = Canvas::new(WIDTH, area.bottom() + BELOW + MARGIN / 2.0);
        headline(&mut canvas, &self.headline);
        let filled = || self.bins.iter().filter(|([from, to], count)| *count > 0 && from < to && *from > 0.0);
        let ends = filled().flat_map(|(ends, _)| *ends).chain(self.marks.iter().map(|mark| mark.0));
        // Without a single count any two decades show that there is none.
        let ends = ends
            .filter(|&end| end > 0.0)
            .chain(filled().next().is_none().then_some([1.0, 100.0]).into_iter().flatten());
        let [low, high] = ticks::range(ends, 0.0);
        let most = filled().map(|(_, count)| *count).max().unwrap_or(1);
        let panel = Panel {
            area,
            across: Scale::logarithmic([low * 0.9, high * 1.1], &self.across),
            // Half a count below one, so that a bin of one has a bar.
            up: Scale::logarithmic([0.5, most as f64 * 2.0], &self.up),
        };
        panel.grid(&mut canvas, true);
        for ([from, to], count) in filled() {
            let ((left, top), (right, bottom)) = (panel.place((*from, *count as f64)), panel.place((*to, 0.5)));
            // A hairline between neighbours, as far as the bins are wide enough.
            let gap = (0.15 * (right - left)).min(1.0);
            let bar = Area { x: left, y: top, width: right - left - gap, height: bottom - top };
            canvas.rectangle(bar, colour::series(0).with_opacity(0.85));
        }
        if filled().next().is_none() {
            panel.note(&mut canvas, "no data");
        }
        let shown: Vec<&(f64, String)> =
            self.marks.iter().filter(|(value, _)| *value > 0.0 && value.is_finite()).collect();
        for (value, _) in &shown {
            let (x, _) = panel.place((*value, 1.0));
            canvas.polyline(&[(x, area.y), (x, area.bottom())], colour::series(1), 1.4, Some(plot::DASHES));
        }
        // The texts stand above the panel in the order of the lines: beside them they would run into each other.
        let texts: Vec<&str> = shown.iter().map(|(_, text)| text.as_str()).collect();
        if !texts.is_empty() {
            let entry = Entry { name: texts.join("  ·  "), colour: colour::series(1), mark: Mark::Dashes };
            panel.legend(&mut canvas, &[entry]);
        }
        canvas
    }
}

/// The figure's title, top left.
pub(crate) fn headline(canvas: &mut Canvas, text: &str) {
    canvas.text((MARGIN, MARGIN + 12.0), text, plot::HEADLINE);
}
