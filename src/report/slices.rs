//! The torque field on a plane of C-space: one heat map a joint, with the contact boundary.
//!
//! The plane shown is the one with the largest torques of all planes along two joints that cross the contact boundary,
//! or of those through a configuration; the other joints stay at that plane's values. A few large torques, as at the
//! edge of an object, do not pale the others: colours then end where all but a fiftieth of the cells do. The boundary is the zero line of the gap, or, where no gap is stored,
//! the line on which the contact index, interpolated, is one half (section 3.1).

use super::press::subscript;
use crate::{
    contact::Status,
    dataset::Dataset,
    draw::{
        canvas::{Anchor, Area, Canvas},
        chart::{self, Lane, Stack},
        colour::{self, ColourMap},
        plot::{self, Curve, Entry, Mark, Panel, Scale},
        ticks,
    },
};
use std::collections::BTreeMap;

/// Most cells drawn along a side: finer than the eye sees, and a bound on the file's size.
const MOST_CELLS: usize = 160;

/// Heat maps of all joint torques over two joints, on a plane `through` the grid point nearest to a configuration where
/// there is one; curves for a single joint.
#[must_use]
pub fn slices(dataset: &Dataset, through: Option<&[f64]>) -> Canvas {
    if dataset.grid.joints() < 2 {
        return line(dataset);
    }
    let slice = Slice::worth_showing(dataset, through, MOST_CELLS);
    // Four are better two by two than three and one.
    let columns = if dataset.grid.joints() == 4 { 2 } else { dataset.grid.joints().min(3) };
    let rows = dataset.grid.joints().div_ceil(columns);
    let (cell_width, cell_height) = (WIDTH / columns as f64, 260.0);
    let mut canvas = Canvas::new(WIDTH + chart::MARGIN, TOP + rows as f64 * cell_height + 12.0);
    chart::headline(&mut canvas, "Joint contact torque on a plane of C-space");
    canvas.text((chart::MARGIN, chart::MARGIN + 32.0), &slice.caption(dataset), plot::NOTE);
    slice.legend(&mut canvas, dataset);
    for joint in 0..dataset.grid.joints() {
        let corner =
            (chart::MARGIN + (joint % columns) as f64 * cell_width, TOP + (joint / columns) as f64 * cell_height);
        let area =
            Area { x: corner.0 + 40.0, y: corner.1 + 30.0, width: cell_width - 122.0, height: cell_height - 88.0 };
        slice.draw(&mut canvas, dataset, joint, area);
    }
    canvas
}

/// Least range of a colour map over the greatest torque of any joint of the same unit (1): noise of a hundredth of what
/// is felt stays pale.
const LEAST_SHARE: f64 = 0.05;

/// Share of the cells in contact, those with the largest torques, that may be beyond the map's end (1), and how much
/// larger than the others they are then (1).
const CUT: f64 = 0.02;
const OUTLYING: f64 = 1.5;

const WIDTH: f64 = 860.0;
const TOP: f64 = 72.0;

/// A plane through the grid along two axes.
struct Slice {
    /// The axes across and up.
    axes: [usize; 2],
    /// Its grid point with index zero on both axes.
    origin: usize,
    /// Every how many grid lines a cell is drawn, on both axes.
    strides: [usize; 2],
}

/// Most cells along a side of a [`Plane`]: what 30 kB a joint hold.
const MOST_PLANE_CELLS: usize = 80;

/// The torque over two joints, to be drawn elsewhere.
pub struct Plane {
    /// The joints across and up.
    pub axes: [usize; 2],
    /// Their coordinates in the first cell (rad or m).
    pub start: [f64; 2],
    /// From one cell to the next (rad or m).
    pub step: [f64; 2],
    /// Cells along each.
    pub count: [usize; 2],
    /// Torque (N m or N), joint by joint, each row by row; NaN where nothing is known, zero where the arm is free.
    pub torque: Vec<f64>,
    /// Torque of each joint at which its colours end (N m or N).
    pub bounds: Vec<f64>,
    /// Segments of the contact boundary (rad or m).
    pub boundary: Vec<[(f64, f64); 2]>,
    /// The configuration through which it was laid (rad or m).
    pub at: Option<[f64; 2]>,
    /// Where it lies.
    pub caption: String,
}

impl Plane {
    /// The plane of [`slices`]; none of a dataset of a single joint.
    #[must_use]
    pub fn of(dataset: &Dataset, through: Option<&[f64]>) -> Option<Self> {
        if dataset.grid.joints() < 2 {
            return None;
        }
        let slice = Slice::worth_showing(dataset, through, MOST_PLANE_CELLS);
        let count = slice.cells(dataset);
        let place = |(x, y): (f64, f64)| (slice.coordinate(dataset, 0, x), slice.coordinate(dataset, 1, y));
        let value = |cell, joint| match dataset.status(slice.point(dataset, cell)) {
            Status::Free => 0.0,
            _ => slice.torque(dataset, cell, joint),
        };
        let joints = 0..dataset.grid.joints();
        let cells = |joint| (0..count[1]).flat_map(move |y| (0..count[0]).map(move |x| ([x, y], joint)));
        Some(Self {
            axes: slice.axes,
            start: [0, 1].map(|side| slice.coordinate(dataset, side, 0.0)),
            step: [0, 1].map(|side| slice.coordinate(dataset, side, 1.0) - slice.coordinate(dataset, side, 0.0)),
            count,
            torque: joints.clone().flat_map(cells).map(|(cell, joint)| value(cell, joint)).collect(),
            bounds: joints.map(|joint| slice.bound(dataset, joint)).collect(),
            boundary: slice.boundary(dataset, count).into_iter().map(|ends| ends.map(place)).collect(),
            at: through.map(|q| slice.axes.map(|axis| q[axis])),
            caption: slice.caption(dataset),
        })
    }
}

/// Number of points and size of torques on a plane.
#[derive(Default)]
struct Tally {
    points: usize,
    contacts: usize,
    /// Sum of the torques' sizes (N m).
    torque: f64,
}

/// First whether a plane shows both sides of the contact boundary, then how large its torques are.
type Worth = (bool, f64);

impl Tally {
    fn count(&mut self, dataset: &Dataset, point: usize) {
        self.points += 1;
        self.contacts += usize::from(dataset.status(point).is_in_contact());
        let size = torque_size(dataset, point);
        self.torque += if size.is_finite() { size } else { 0.0 };
    }

    fn worth(&self) -> Worth {
        // A tenth of the plane is enough to see the boundary.
        let free = self.points - self.contacts;
        (self.contacts > 0 && 10 * free >= self.points, self.torque)
    }
}

impl Slice {
    fn worth_showing(dataset: &Dataset, through: Option<&[f64]>, most_cells: usize) -> Self {
        let grid = &dataset.grid;
        let through = through.and_then(|q| grid.nearest(q));
        let joints = grid.joints();
        let mut best = (Worth::default(), [0, 1], 0);
        for across in 0..joints {
            for up in across + 1..joints {
                let mut planes: BTreeMap<usize, Tally> = BTreeMap::new();
                for point in 0..grid.points() {
                    planes.entry(Self::origin(dataset, [across, up], point)).or_default().count(dataset, point);
                }
                let through = through.map(|point| Self::origin(dataset, [across, up], point));
                for (origin, tally) in planes {
                    if tally.worth() > best.0 && through.is_none_or(|through| through == origin) {
                        best = (tally.worth(), [across, up], origin);
                    }
                }
            }
        }
        let (_, axes, origin) = best;
        Self { axes, origin, strides: axes.map(|axis| grid.axes[axis].count.div_ceil(most_cells).max(1)) }
    }

    /// `point` moved to index zero on both axes.
    fn origin(dataset: &Dataset, axes: [usize; 2], point: usize) -> usize {
        let mut lines = dataset.grid.lines(point);
        axes.iter().for_each(|&axis| lines[axis] = 0);
        dataset.grid.point(lines)
    }

    /// Cells drawn across and up.
    fn cells(&self, dataset: &Dataset) -> [usize; 2] {
        [0, 1].map(|side| dataset.grid.axes[self.axes[side]].count.div_ceil(self.strides[side]))
    }

    /// Grid point of a cell.
    fn point(&self, dataset: &Dataset, cell: [usize; 2]) -> usize {
        let mut lines = dataset.grid.lines(self.origin);
        [0, 1].into_iter().for_each(|side| lines[self.axes[side]] = cell[side] * self.strides[side]);
        dataset.grid.point(lines)
    }

    /// Torque of `joint` in a cell; not a number where nothing is known (N m or N).
    fn torque(&self, dataset: &Dataset, cell: [usize; 2], joint: usize) -> f64 {
        let point = self.point(dataset, cell);
        if dataset.status(point) == Status::Outside { f64::NAN } else { dataset.torque(point)[joint] }
    }

    /// The size of torque with the colour of the map's end (N m or N), and whether some cells are beyond it.
    fn end(&self, dataset: &Dataset, joint: usize) -> (f64, bool) {
        let [across, up] = self.cells(dataset);
        let cells = (0..across).flat_map(|x| (0..up).map(move |y| [x, y]));
        let sizes = cells.map(|cell| self.torque(dataset, cell, joint).abs());
        let mut sizes: Vec<f64> = sizes.filter(|size| *size > 0.0 && size.is_finite()).collect();
        sizes.sort_unstable_by(f64::total_cmp);
        let Some(last) = sizes.len().checked_sub(1) else { return (0.0, false) };
        let (most, greatest) = (sizes[last - (CUT * last as f64).ceil() as usize], sizes[last]);
        if greatest > OUTLYING * most { (most, true) } else { (greatest, false) }
    }

    /// The size of torque at the end of the colour map of `joint` (N m or N). A joint that hardly feels anything is drawn
    /// pale beside those of its unit, not as vividly as these.
    fn bound(&self, dataset: &Dataset, joint: usize) -> f64 {
        let greatest = |joint: usize| self.end(dataset, joint).0;
        let of_unit =
            (0..dataset.grid.joints()).filter(|other| dataset.grid.axes[*other].unit == dataset.grid.axes[joint].unit);
        let bound = greatest(joint).max(LEAST_SHARE * of_unit.map(greatest).fold(0.0, f64::max));
        if bound > 0.0 { bound } else { 1.0 }
    }

    fn draw(&self, canvas: &mut Canvas, dataset: &Dataset, joint: usize, area: Area) {
        let cells = self.cells(dataset);
        let torque = |cell, joint: usize| self.torque(dataset, cell, joint);
        let all = || (0..cells[0]).flat_map(|x| (0..cells[1]).map(move |y| [x, y]));
        let map = ColourMap::Diverging { bound: self.bound(dataset, joint) };
        let panel = Panel { area, across: self.scale(dataset, 0), up: self.scale(dataset, 1) };
        panel.grid(canvas, true);
        canvas.rectangle(area, colour::ABSENT);
        let corner = |x: f64, y: f64| panel.place((self.coordinate(dataset, 0, x), self.coordinate(dataset, 1, y)));
        canvas.clipped(area, |canvas| {
            for [x, y] in all() {
                let value = torque([x, y], joint);
                let (left, bottom) = corner(x as f64 - 0.5, y as f64 - 0.5);
                let (right, top) = corner(x as f64 + 0.5, y as f64 + 0.5);
                // Neighbours overlap by a little, lest the sheet shine through between them.
                let cell = Area { x: left, y: top, width: right - left + 0.4, height: bottom - top + 0.4 };
                let status = dataset.status(self.point(dataset, [x, y]));
                if value.is_finite() {
                    canvas.rectangle(cell, if status == Status::Free { colour::WHITE } else { map.colour(value) });
                }
                if status == Status::Unconverged {
                    let radius = (0.18 * (right - left).min(bottom - top)).min(2.2);
                    canvas.disc(((left + right) / 2.0, (top + bottom) / 2.0), radius, colour::INK);
                }
            }
            for segment in self.boundary(dataset, cells) {
                let ends = segment.map(|(x, y)| corner(x, y));
                canvas.polyline(&ends, colour::INK, 1.6, None);
            }
        });
        canvas.frame(area, colour::FRAME, 0.8);
        let bar = Area { x: area.right() + 12.0, width: 10.0, ..area };
        let title = format!(
            "τ{} {} [{}]",
            subscript(joint + 1),
            dataset.grid.axes[joint].name,
            dataset.grid.axes[joint].effort_unit()
        );
        plot::colour_bar(canvas, bar, map, &title, Anchor::End);
    }

    /// Segments of the contact boundary, in cells.
    fn boundary(&self, dataset: &Dataset, cells: [usize; 2]) -> Vec<[(f64, f64); 2]> {
        let value = |point: usize| match (&dataset.gap, dataset.status(point)) {
            (_, Status::Outside) => f64::NAN,
            (Some(gap), _) => f64::from(gap[point]),
            (None, status) => {
                if status.is_in_contact() {
                    -0.5
                } else {
                    0.5
                }
            }
        };
        let values: Vec<f64> = (0..cells[1])
            .flat_map(|y| (0..cells[0]).map(move |x| [x, y]))
            .map(|cell| value(self.point(dataset, cell)))
            .collect();
        plot::level_lines(&values, cells[0], 0.0)
    }

    /// Joint coordinate at a place along one side, in cells.
    fn coordinate(&self, dataset: &Dataset, side: usize, cell: f64) -> f64 {
        let axis = &dataset.grid.axes[self.axes[side]];
        axis.start + cell * self.strides[side] as f64 * axis.step
    }

    fn scale(&self, dataset: &Dataset, side: usize) -> Scale {
        let axis = &dataset.grid.axes[self.axes[side]];
        let cells = self.cells(dataset)[side] as f64;
        let ends = [self.coordinate(dataset, side, -0.5), self.coordinate(dataset, side, cells - 0.5)];
        let range = if ends.iter().all(|end| end.is_finite()) && ends[0] < ends[1] {
            ends
        } else {
            ticks::range(ends.into_iter(), 0.5)
        };
        Scale::linear(range, format!("q{} {} [{}]", subscript(self.axes[side] + 1), axis.name, axis.unit))
    }

    /// Returns where the plane lies, and how much of it is in contact.
    fn caption(&self, dataset: &Dataset) -> String {
        let q = dataset.grid.configuration(self.origin);
        let fixed: Vec<String> = (0..dataset.grid.joints())
            .filter(|joint| !self.axes.contains(joint))
            .map(|joint| {
                let axis = &dataset.grid.axes[joint];
                format!("q{} {} = {} {}", subscript(joint + 1), axis.name, ticks::number(q[joint], 3), axis.unit)
            })
            .collect();
        let mut text = if fixed.is_empty() { "the whole grid".to_owned() } else { format!("at {}", fixed.join(", ")) };
        if (0..dataset.grid.joints()).any(|joint| self.end(dataset, joint).1) {
            text += "; colours end where all but 2 % of the cells do";
        }
        text
    }

    fn legend(&self, canvas: &mut Canvas, dataset: &Dataset) {
        let entry = |name: &str, colour, mark| Entry { name: name.to_owned(), colour, mark };
        let statuses = || (0..dataset.grid.points()).map(|point| dataset.status(point));
        let mut entries = Vec::new();
        if statuses().any(|status| status == Status::Free) {
            entries.push(entry("free", colour::WHITE, Mark::Box));
        }
        if !self.boundary(dataset, self.cells(dataset)).is_empty() {
            entries.push(entry("contact boundary", colour::INK, Mark::Line));
        }
        if !statuses().any(Status::is_in_contact) {
            entries.push(entry("no grid point is in contact", colour::WHITE, Mark::Box));
        }
        if statuses().any(|status| status == Status::Unconverged) {
            entries.push(entry("not converged", colour::INK, Mark::Dot));
        }
        if statuses().any(|status| status == Status::Outside) {
            entries.push(entry("no data", colour::ABSENT, Mark::Box));
        }
        plot::legend(canvas, (WIDTH - 4.0, chart::MARGIN + 32.0), &entries);
    }
}

/// Whether the chain has revolute and prismatic joints.
#[must_use]
pub fn is_mixed(dataset: &Dataset) -> bool {
    let kind = |unit: &str| dataset.grid.axes.iter().any(|axis| axis.unit == unit);
    kind("rad") && kind("m")
}

/// What [`torque_size`] is, with its unit.
#[must_use]
pub fn torque_size_label(dataset: &Dataset) -> String {
    match dataset.grid.axes.first().map_or("N m", |axis| axis.effort_unit()) {
        _ if is_mixed(dataset) => "torque of turning joints [N m]".into(),
        "N" => "force [N]".into(),
        unit => format!("torque [{unit}]"),
    }
}

/// Size of the torque at a grid point: of the revolute joints where there are both kinds (N m), else of all.
#[must_use]
pub fn torque_size(dataset: &Dataset, point: usize) -> f64 {
    let mixed = is_mixed(dataset);
    let counted = dataset.torque(point).iter().zip(&dataset.grid.axes).filter(|(_, axis)| !mixed || axis.unit == "rad");
    counted.map(|(torque, _)| torque * torque).sum::<f64>().sqrt()
}

/// Torque of a single joint against its coordinate.
fn line(dataset: &Dataset) -> Canvas {
    let Some(axis) = dataset.grid.axes.first() else {
        let (headline, lanes) = ("Joint contact torque".to_owned(), vec![Lane::new("no joints", Vec::new())]);
        return Stack { headline, across: String::new(), lanes, contact: Vec::new() }.draw();
    };
    let points = (0..axis.count).map(|k| {
        let known = dataset.status(k) != Status::Outside;
        (axis.coordinate(k), if known { dataset.torque(k)[0] } else { f64::NAN })
    });
    let title = format!("τ₁ {} [{}]", axis.name, axis.effort_unit());
    let lane = Lane { height: 240.0, ..Lane::new(title, vec![Curve::new("", 0, points)]) };
    let numbers: Vec<usize> = (0..axis.count).collect();
    let contact = numbers
        .chunk_by(|&a, &b| dataset.status(a).is_in_contact() == dataset.status(b).is_in_contact())
        .filter(|run| dataset.status(run[0]).is_in_contact())
        .map(|run| [axis.coordinate(run[0]), axis.coordinate(run[run.len() - 1])])
        .collect();
    let (headline, across) =
        ("Joint contact torque over C-space".to_owned(), format!("q₁ {} [{}]", axis.name, axis.unit));
    Stack { headline, across, lanes: vec![lane], contact }.draw()
}
