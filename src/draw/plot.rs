//! The parts of a chart: a panel with its two axes, curves, shaded intervals, cells, contours, legends, colour bars.
//!
//! Look: no boxes, light grid, title and unit of the vertical axis written horizontally above the panel on the left,
//! the legend on the same line on the right, so that nothing ever lies on the data.

use super::{
    canvas::{Anchor, Area, Canvas, TextStyle, Weight},
    colour::{self, Colour, ColourMap},
    ticks::{self, Ticks},
};

/// Sizes of text, in points of the sheet.
const TICK_SIZE: f64 = 11.0;
const TITLE_SIZE: f64 = 12.5;

/// Tick labels.
pub(crate) const TICK: TextStyle =
    TextStyle { size: TICK_SIZE, weight: Weight::Regular, colour: colour::SOFT_INK, anchor: Anchor::Middle };
/// Titles of axes and panels.
pub(crate) const TITLE: TextStyle =
    TextStyle { size: TITLE_SIZE, weight: Weight::Medium, colour: colour::INK, anchor: Anchor::Start };
/// Legends and notes.
pub(crate) const NOTE: TextStyle =
    TextStyle { size: TICK_SIZE + 0.5, weight: Weight::Regular, colour: colour::INK, anchor: Anchor::Start };
/// Title of a whole figure.
pub(crate) const HEADLINE: TextStyle =
    TextStyle { size: 16.0, weight: Weight::Medium, colour: colour::INK, anchor: Anchor::Start };

/// One axis: its ends in data units, and its name with the unit.
#[derive(Clone, Debug)]
pub struct Scale {
    /// Ends, ascending; positive on a logarithmic axis.
    pub range: [f64; 2],
    /// `Time [s]`.
    pub title: String,
    /// How its numbers follow each other.
    pub steps: Steps,
}

/// How the numbers along an axis follow each other.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Steps {
    /// Equal lengths are equal differences.
    Linear,
    /// The same, with whole numbers only at the ticks: counts.
    Whole,
    /// Equal lengths are equal ratios.
    Logarithmic,
}

impl Scale {
    /// An axis of equal steps.
    #[must_use]
    pub fn linear(range: [f64; 2], title: impl Into<String>) -> Self {
        Self { range, title: title.into(), steps: Steps::Linear }
    }

    /// An axis of counts.
    #[must_use]
    pub fn whole(range: [f64; 2], title: impl Into<String>) -> Self {
        Self { range, title: title.into(), steps: Steps::Whole }
    }

    /// An axis of equal ratios; `range` is cut to positive numbers, and is a tenth of a decade at least.
    #[must_use]
    pub fn logarithmic([low, high]: [f64; 2], title: impl Into<String>) -> Self {
        let low = if low > 0.0 { low } else { f64::MIN_POSITIVE };
        Self { range: [low, high.max(10.0_f64.powf(0.1) * low)], title: title.into(), steps: Steps::Logarithmic }
    }

    /// Returns where `value` lies between the ends, 0 to 1; beyond that outside.
    fn share(&self, value: f64) -> f64 {
        let [low, high] = self.range;
        match self.steps {
            Steps::Logarithmic => (value / low).log10() / (high / low).log10(),
            Steps::Linear | Steps::Whole => (value - low) / (high - low),
        }
    }

    fn ticks(&self, intervals: usize) -> Ticks {
        let is_whole = |ticks: &Ticks| ticks.marks.iter().all(|(value, _)| value.fract() == 0.0);
        match self.steps {
            Steps::Logarithmic => ticks::decades(self.range, intervals),
            Steps::Linear => ticks::ticks(self.range, intervals),
            Steps::Whole => (1..=intervals)
                .rev()
                .map(|intervals| ticks::ticks(self.range, intervals))
                .find(is_whole)
                .unwrap_or_else(|| ticks::ticks(self.range, 1)),
        }
    }
}

/// A rectangle of the sheet with data axes.
#[derive(Clone, Debug)]
pub struct Panel {
    /// Where the data go.
    pub area: Area,
    /// Horizontal axis.
    pub across: Scale,
    /// Vertical axis.
    pub up: Scale,
}

/// A curve of a panel.
#[derive(Clone, Debug)]
pub struct Curve {
    /// In the legend; curves without a name are not listed.
    pub name: String,
    /// Its colour.
    pub colour: Colour,
    /// Whether it is dashed.
    pub dashed: bool,
    /// Data points; those that are no numbers interrupt the curve.
    pub points: Vec<(f64, f64)>,
}

impl Curve {
    /// A solid curve through `points`, in the colour of series `number`.
    #[must_use]
    pub fn new(name: impl Into<String>, number: usize, points: impl IntoIterator<Item = (f64, f64)>) -> Self {
        let (colour, points) = (colour::series(number), points.into_iter().collect());
        Self { name: name.into(), colour, dashed: false, points }
    }
}

/// A mark in a legend.
#[derive(Clone, Debug)]
pub struct Entry {
    /// Name of what it marks.
    pub name: String,
    /// Its colour.
    pub colour: Colour,
    /// How it is drawn.
    pub mark: Mark,
}

/// How a legend entry is drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mark {
    /// A piece of a solid curve.
    Line,
    /// A piece of a dashed curve.
    Dashes,
    /// A filled box.
    Box,
    /// A filled disc.
    Dot,
}

/// Base line of the titles above a panel or a colour bar: clear of a tick label at its upper end.
const TITLE_LIFT: f64 = 11.0;

/// Lengths of dash and gap of dashed curves.
pub(crate) const DASHES: [f64; 2] = [5.0, 3.5];

impl Panel {
    /// Position of a data point on the sheet.
    #[must_use]
    pub fn place(&self, (x, y): (f64, f64)) -> (f64, f64) {
        (self.area.x + self.across.share(x) * self.area.width, self.area.bottom() - self.up.share(y) * self.area.height)
    }

    /// Number of tick intervals that fit without crowding.
    fn intervals(&self) -> (usize, usize) {
        ((self.area.width / 55.0).max(4.0) as usize, (self.area.height / 26.0).max(3.0) as usize)
    }

    /// Grid lines and tick labels; the horizontal axis is labelled only if `labelled` (the lowest of stacked panels).
    /// Drawn before the data.
    pub fn grid(&self, canvas: &mut Canvas, labelled: bool) {
        let (across, up) = self.intervals();
        let vertical = self.up.ticks(up);
        for (value, label) in &vertical.marks {
            let (_, y) = self.place((self.across.range[0], *value));
            canvas.polyline(&[(self.area.x, y), (self.area.right(), y)], colour::GRID, 1.0, None);
            canvas.text((self.area.x - 8.0, y + 0.36 * TICK_SIZE), label, TICK.anchored(Anchor::End));
        }
        let horizontal = self.across.ticks(across);
        for (value, label) in &horizontal.marks {
            let (x, _) = self.place((*value, self.up.range[0]));
            canvas.polyline(&[(x, self.area.y), (x, self.area.bottom())], colour::GRID, 1.0, None);
            if labelled {
                canvas.text((x, self.area.bottom() + TICK_SIZE + 6.0), label, TICK);
            }
        }
        if labelled {
            let middle = self.area.x + self.area.width / 2.0;
            let position = (middle, self.area.bottom() + TICK_SIZE + 6.0 + TITLE_SIZE + 7.0);
            canvas.text(position, &titled(&self.across.title, &horizontal), TITLE.anchored(Anchor::Middle));
        }
        canvas.text((self.area.x, self.area.y - TITLE_LIFT), &titled(&self.up.title, &vertical), TITLE);
    }

    /// The zero line, where zero lies in the panel.
    pub fn zero_line(&self, canvas: &mut Canvas) {
        let [low, high] = self.up.range;
        if low < 0.0 && high > 0.0 {
            let (_, y) = self.place((0.0, 0.0));
            canvas.polyline(&[(self.area.x, y), (self.area.right(), y)], colour::FRAME, 1.0, None);
        }
    }

    /// Shades the part of the panel between two values of the horizontal axis.
    pub fn shade(&self, canvas: &mut Canvas, [from, to]: [f64; 2], fill: Colour) {
        let [low, high] = self.across.range;
        let [left, right] = [from, to].map(|x| self.place((x.clamp(low, high), self.up.range[0])).0);
        if right > left {
            canvas.rectangle(Area { x: left, width: right - left, ..self.area }, fill);
        }
    }

    /// A curve; samples that are no numbers interrupt it.
    pub fn curve(&self, canvas: &mut Canvas, points: &[(f64, f64)], colour: Colour, width: f64, dashed: bool) {
        let finite = |&(x, y): &(f64, f64)| x.is_finite() && y.is_finite();
        // Half a stroke beyond the panel, so that a curve along its edge is as thick as elsewhere.
        let Area { x, y, width: across, height } = self.area;
        let area = Area { x: x - width, y: y - width, width: across + 2.0 * width, height: height + 2.0 * width };
        canvas.clipped(area, |canvas| {
            for run in points.chunk_by(|a, b| finite(a) && finite(b)).filter(|run| finite(&run[0])) {
                let placed: Vec<_> = run.iter().map(|&point| self.place(point)).collect();
                match placed[..] {
                    [single] => canvas.disc(single, 1.5 * width, colour),
                    _ => canvas.polyline(&thinned(&placed), colour, width, dashed.then_some(DASHES)),
                }
            }
        });
    }

    /// A note in the middle of a panel that has nothing else to show.
    pub fn note(&self, canvas: &mut Canvas, text: &str) {
        let Area { x, y, width, height } = self.area;
        let style = TextStyle { colour: colour::SOFT_INK, anchor: Anchor::Middle, ..NOTE };
        canvas.text((x + width / 2.0, y + height / 2.0), text, style);
    }

    /// Legend above the panel, right-aligned.
    pub fn legend(&self, canvas: &mut Canvas, entries: &[Entry]) {
        legend(canvas, (self.area.right(), self.area.y - TITLE_LIFT), entries);
    }
}

/// Entries of those of `curves` that have a name.
pub(super) fn entries(curves: &[Curve]) -> impl Iterator<Item = Entry> {
    curves.iter().filter(|curve| !curve.name.is_empty()).map(|Curve { name, colour, dashed, .. }| Entry {
        name: name.clone(),
        colour: *colour,
        mark: if *dashed { Mark::Dashes } else { Mark::Line },
    })
}

/// A legend on one line that ends at `right`, a point of its base line.
pub(crate) fn legend(canvas: &mut Canvas, right: (f64, f64), entries: &[Entry]) {
    const SYMBOL: f64 = 18.0;
    const GAP: f64 = 6.0;
    const SPACE: f64 = 18.0;
    let width = |entry: &Entry| SYMBOL + GAP + NOTE.width(&entry.name);
    let total: f64 = entries.iter().map(width).sum::<f64>() + SPACE * entries.len().saturating_sub(1) as f64;
    let (mut x, y) = (right.0 - total, right.1);
    for entry in entries {
        let middle = y - 0.34 * NOTE.size;
        let ends = [(x, middle), (x + SYMBOL, middle)];
        match entry.mark {
            Mark::Line => canvas.polyline(&ends, entry.colour, 2.2, None),
            Mark::Dashes => canvas.polyline(&ends, entry.colour, 2.0, Some(DASHES)),
            Mark::Dot => canvas.disc((x + SYMBOL - 5.0, middle), 4.0, entry.colour),
            Mark::Box => {
                let side = 10.0;
                let area = Area { x: x + SYMBOL - side - 2.0, y: middle - side / 2.0, width: side + 2.0, height: side };
                canvas.rectangle(area, entry.colour);
                canvas.frame(area, colour::FRAME, 0.8);
            }
        }
        canvas.text((x + SYMBOL + GAP, y), &entry.name, NOTE);
        x += width(entry) + SPACE;
    }
}

/// A vertical colour bar in `area`, ticks on its right, its title above: beginning with the bar, or ending with the
/// tick labels.
pub(crate) fn colour_bar(canvas: &mut Canvas, area: Area, map: ColourMap, title: &str, anchor: Anchor) {
    const STEPS: usize = 96;
    let [low, high] = map.range();
    let height = area.height / STEPS as f64;
    for step in 0..STEPS {
        // Neighbours overlap by half a point, lest the sheet shine through between them.
        let overlap = if step == 0 { 0.0 } else { 0.5 };
        let y = area.bottom() - (step + 1) as f64 * height;
        canvas.rectangle(Area { y, height: height + overlap, ..area }, map.at((step as f64 + 0.5) / STEPS as f64));
    }
    canvas.frame(area, colour::FRAME, 0.8);
    let ticks = ticks::ticks([low, high], (area.height / 30.0).max(2.0) as usize);
    for (value, label) in &ticks.marks {
        let y = area.bottom() - map.share(*value) * area.height;
        canvas.polyline(&[(area.right(), y), (area.right() + 4.0, y)], colour::FRAME, 1.0, None);
        canvas.text((area.right() + 8.0, y + 0.36 * TICK_SIZE), label, TICK.anchored(Anchor::Start));
    }
    let x = if anchor == Anchor::End { area.right() + 34.0 } else { area.x };
    canvas.text((x, area.y - TITLE_LIFT), &titled(title, &ticks), TITLE.anchored(anchor));
}

/// The axis title with the common factor of its labels: `Energy [J]` becomes `Energy [×10⁻³ J]`.
fn titled(title: &str, ticks: &Ticks) -> String {
    match (ticks.factor.as_str(), title.rsplit_once('[')) {
        ("", _) => title.to_owned(),
        (factor, Some((name, unit))) => format!("{name}[{factor} {unit}"),
        (factor, None) => format!("{title} [{factor}]"),
    }
}

/// The same curve with fewer points: of those within a point of the sheet, half the width of a stroke, the first,
/// lowest, highest and last.
fn thinned(points: &[(f64, f64)]) -> Vec<(f64, f64)> {
    let column = |point: &(f64, f64)| point.0.floor();
    let mut kept = Vec::new();
    for run in points.chunk_by(|a, b| column(a) == column(b)) {
        if run.len() <= 4 {
            kept.extend_from_slice(run);
            continue;
        }
        let by_height = |a: &&(f64, f64), b: &&(f64, f64)| a.1.total_cmp(&b.1);
        kept.extend(run.first());
        kept.extend(run.iter().min_by(by_height));
        kept.extend(run.iter().max_by(by_height));
        kept.extend(run.last());
    }
    // In a smooth curve the lowest and highest are the first and last themselves.
    kept.dedup();
    kept
}

/// Level lines of `values` on a rectangular grid (marching squares), as segments in grid coordinates.
///
/// `values` has `columns` numbers a row; cells with a corner that is no number have no line. Where all four sides are
/// crossed the mean of the corners decides which are joined.
pub(crate) fn level_lines(values: &[f64], columns: usize, level: f64) -> Vec<[(f64, f64); 2]> {
    let rows = values.len().checked_div(columns).unwrap_or(0);
    let mut segments = Vec::new();
    for row in 0..rows.saturating_sub(1) {
        for column in 0..columns.saturating_sub(1) {
            let at = |x: usize, y: usize| values[(row + y) * columns + column + x] - level;
            // Corners counter-clockwise, with their place in the cell.
            let corners =
                [(at(0, 0), (0.0, 0.0)), (at(1, 0), (1.0, 0.0)), (at(1, 1), (1.0, 1.0)), (at(0, 1), (0.0, 1.0))];
            if corners.iter().any(|(value, _)| !value.is_finite()) {
                continue;
            }
            let mut crossings = Vec::with_capacity(4);
            for side in 0..4 {
                let ((a, from), (b, to)) = (corners[side], corners[(side + 1) % 4]);
                if (a < 0.0) != (b < 0.0) {
                    let share = a / (a - b);
                    let x = column as f64 + from.0 + share * (to.0 - from.0);
                    crossings.push((x, row as f64 + from.1 + share * (to.1 - from.1)));
                }
            }
            let mean_is_low = corners.iter().map(|(value, _)| value).sum::<f64>() < 0.0;
            match crossings[..] {
                [a, b] => segments.push([a, b]),
                // Joined centre: each cut-off corner is of the other sign than the centre.
                [a, b, c, d] if (corners[0].0 < 0.0) == mean_is_low => segments.extend([[a, b], [c, d]]),
                [a, b, c, d] => segments.extend([[d, a], [b, c]]),
                _ => {}
            }
        }
    }
    segments
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn level_lines_of_a_cone_lie_on_its_circle() {
        let columns = 41;
        let radius = |x: f64, y: f64| (x - 20.0).hypot(y - 20.0);
        let values: Vec<f64> =
            (0..columns * columns).map(|k| radius((k % columns) as f64, (k / columns) as f64)).collect();
        let segments = level_lines(&values, columns, 12.5);
        assert!(segments.len() > 60);
        let length: f64 = segments.iter().map(|[a, b]| (a.0 - b.0).hypot(a.1 - b.1)).sum();
        assert!((length / (2.0 * std::f64::consts::PI * 12.5) - 1.0).abs() < 0.01, "length {length}");
        assert!(segments.iter().flatten().all(|&(x, y)| (radius(x, y) - 12.5).abs() < 0.05));
    }

    #[test]
    fn a_saddle_is_cut_according_to_its_mean() {
        // Corners (0,0) and (1,1) high: with a high centre the low corners (1,0) and (0,1) are cut off, else the high
        // ones.
        for (high, near_low_corners) in [(3.0, true), (0.5, false)] {
            let segments = level_lines(&[high, -1.0, -1.0, high], 2, 0.0);
            assert_eq!(segments.len(), 2);
            for [a, b] in segments {
                let middle = ((a.0 + b.0) / 2.0, (a.1 + b.1) / 2.0);
                assert_eq!((middle.0 - middle.1).abs() > (middle.0 + middle.1 - 1.0).abs(), near_low_corners);
            }
        }
    }

    #[test]
    fn cells_without_data_have_no_lines() {
        assert!(level_lines(&[1.0, -1.0, f64::NAN, 1.0], 2, 0.0).is_empty());
        assert!(level_lines(&[], 0, 0.0).is_empty());
        assert!(level_lines(&[1.0, -1.0, 1.0], 2, 0.0).is_empty());
    }

    #[test]
    fn thinning_keeps_ends_and_extremes() {
        let points: Vec<(f64, f64)> = (0..10_000).map(|k| (f64::from(k) * 1e-3, f64::from(k * k % 977))).collect();
        let kept = thinned(&points);
        assert!(kept.len() < 100);
        assert_eq!((kept.first(), kept.last()), (points.first(), points.last()));
        assert!(kept.iter().any(|point| point.1 == 976.0) && kept.iter().any(|point| point.1 == 0.0));
    }
}
