//! The haptized data in the C-space of the proxy (paper's Fig. 3): a ball for every configuration in contact, its
//! colour and size by the size of the torque, over the first three joints.
//!
//! With more than three joints the others stay where most configurations are in contact. Free configurations are not
//! drawn: they would hide the others. Newtons and newton metres do not add up: where a chain has joints of both kinds
//! the size of the torque is that of its revolute joints. The view is from the corner of the box to which the torque
//! grows, so that the deep configurations are not hidden behind the boundary.

use super::{
    press::subscript,
    slices::{is_mixed, torque_size},
};
use crate::{
    contact::Status,
    dataset::Dataset,
    draw::{
        canvas::{Anchor, Area, Canvas},
        chart,
        colour::{self, ColourMap},
        plot::{self, Entry, Mark},
        raster::{Raster, Viewpoint},
        ticks,
    },
    report::PIXELS,
};
use glam::DVec3;
use std::collections::HashMap;

const WIDTH: f64 = 760.0;
const PICTURE: Area = Area { x: 36.0, y: 60.0, width: 600.0, height: 480.0 };

/// The cloud of configurations in contact. One or two joints lie on the box's floor.
#[must_use]
pub fn space(dataset: &Dataset) -> Canvas {
    let points = points_in_contact(dataset);
    let magnitude = |point: usize| torque_size(dataset, point);
    let trusted = |&point: &usize| dataset.status(point) == Status::Contact && magnitude(point).is_finite();
    let greatest = points.iter().copied().filter(|point| trusted(point)).map(magnitude).fold(0.0, f64::max);
    let map = ColourMap::Root { high: if greatest > 0.0 { greatest } else { 1.0 } };
    let space_box = Box3::of(dataset);

    let place = |point: usize| space_box.place(&dataset.grid.configuration(point));
    let direction =
        view(points.iter().copied().filter(|point| trusted(point)).map(|point| (place(point), magnitude(point))));
    let size = [PICTURE.width, PICTURE.height].map(|side| (side * PIXELS) as usize);
    let mut raster = Raster::new(Viewpoint::framing(&space_box.with_labels(direction), direction, size));
    space_box.draw_walls(&mut raster, direction);
    for &point in &points {
        if trusted(&point) {
            // Volume grows with the torque, from half of the greatest radius on.
            let share = (magnitude(point) / greatest).cbrt().max(0.5);
            raster.sphere(place(point), 0.46 * space_box.cell * share, map.colour(magnitude(point)));
        } else {
            raster.sphere(place(point), 0.2 * space_box.cell, UNTRUSTED);
        }
    }

    let mut canvas = Canvas::new(WIDTH, PICTURE.bottom() + 4.0);
    chart::headline(&mut canvas, "Haptized data in the C-space of the proxy");
    let untrusted = points.iter().filter(|point| !trusted(point)).count();
    canvas.text((chart::MARGIN, chart::MARGIN + 32.0), &caption(dataset, &points), plot::NOTE);
    if untrusted > 0 {
        let entry = Entry { name: format!("{untrusted} not converged"), colour: UNTRUSTED, mark: Mark::Dot };
        plot::legend(&mut canvas, (WIDTH - chart::MARGIN, chart::MARGIN + 12.0), &[entry]);
    }
    space_box.label(&mut canvas, raster.view(), direction, dataset);
    canvas.picture((PICTURE.x, PICTURE.y), raster.picture());
    let unit =
        if is_mixed(dataset) { "N m" } else { dataset.grid.axes.first().map_or("N m", |axis| axis.effort_unit()) };
    let bar = Area { x: PICTURE.right() + 30.0, y: PICTURE.y + 110.0, width: 14.0, height: 260.0 };
    plot::colour_bar(&mut canvas, bar, map, &format!("‖τ‖ [{unit}]"), Anchor::Start);
    canvas
}

/// Configurations whose torque is not to be trusted.
const UNTRUSTED: colour::Colour = colour::Colour::hex(0xd5_5e_00);

/// Grid points in contact; with more than three joints those of the three-dimensional slice with most of them.
fn points_in_contact(dataset: &Dataset) -> Vec<usize> {
    let pitch: usize = dataset.grid.axes.iter().skip(3).map(|axis| axis.count).product();
    let mut of_slice: HashMap<usize, usize> = HashMap::new();
    let touching = |point: &usize| dataset.status(*point).is_in_contact();
    for point in (0..dataset.grid.points()).filter(touching) {
        *of_slice.entry(point % pitch.max(1)).or_default() += 1;
    }
    // The lowest slice of equals: the order of a hash map is not the same twice.
    let most = of_slice.into_iter().max_by_key(|&(slice, count)| (count, usize::MAX - slice)).map_or(0, |most| most.0);
    (0..dataset.grid.points()).filter(touching).filter(|point| point % pitch.max(1) == most).collect()
}

fn caption(dataset: &Dataset, shown: &[usize]) -> String {
    let grid = &dataset.grid;
    let all = (0..grid.points()).filter(|&point| dataset.status(point).is_in_contact()).count();
    let mut text =
        format!("{} of {} configurations in contact", ticks::thousands(all), ticks::thousands(grid.points()));
    if all == 0 {
        text = format!("none of {} configurations in contact", ticks::thousands(grid.points()));
    }
    if let (Some(&first), true) = (shown.first(), grid.joints() > 3) {
        let q = grid.configuration(first);
        let fixed = (3..grid.joints()).map(|joint| {
            let axis = &grid.axes[joint];
            format!("q{} {} = {} {}", subscript(joint + 1), axis.name, ticks::number(q[joint], 3), axis.unit)
        });
        text += &format!(", {} of them at {}", ticks::thousands(shown.len()), fixed.collect::<Vec<_>>().join(", "));
    }
    if all > 0 {
        text += "; colour, on a root scale, and size by torque";
        text += if is_mixed(dataset) { " of the revolute joints" } else { "" };
    }
    text
}

/// The diagonal from above along which the torque grows most towards the viewer.
fn view(points: impl Iterator<Item = (DVec3, f64)>) -> DVec3 {
    let (mut count, mut centre, mut weight, mut heavy) = (0.0, DVec3::ZERO, 0.0, DVec3::ZERO);
    for (position, torque) in points {
        count += 1.0;
        centre += position;
        weight += torque;
        heavy += torque * position;
    }
    let growth = if count > 0.0 && weight > 0.0 { heavy / weight - centre / count } else { DVec3::ZERO };
    let side = |component: f64| if component < 0.0 { -1.0 } else { 1.0 };
    // Off the diagonal, so that edges of the box do not fall on one another.
    DVec3::new(0.62 * side(growth.x), 1.0 * side(growth.y), 0.55)
}

/// The grid's extent over its first three joints as a box in space.
struct Box3 {
    /// Ends of each axis in joint coordinates.
    ranges: [[f64; 2]; 3],
    /// Extent of each side in space, the longest one.
    sides: DVec3,
    /// Distance of neighbouring grid points in space, geometric mean over the axes.
    cell: f64,
}

impl Box3 {
    fn of(dataset: &Dataset) -> Self {
        let axes = &dataset.grid.axes;
        let range = |number: usize| match axes.get(number) {
            Some(axis) => {
                ticks::range([-0.5, axis.count as f64 - 0.5].into_iter().map(|k| axis.start + k * axis.step), 0.0)
            }
            None => [-0.5, 0.5],
        };
        let ranges = [range(0), range(1), range(2)];
        let extent = DVec3::from_array(ranges.map(|[low, high]| high - low));
        // Sides in proportion, but none so short that its labels crowd.
        let sides = (extent / extent.max_element()).clamp(DVec3::splat(0.55), DVec3::ONE);
        let shown = axes.len().clamp(1, 3);
        let cells = axes.iter().zip(sides.to_array()).map(|(axis, side)| side / axis.count.max(1) as f64);
        // A handful of grid points need no balls as large as their distance.
        Self { ranges, sides, cell: cells.product::<f64>().powf(1.0 / shown as f64).min(0.1) }
    }

    /// Returns where a configuration lies.
    fn place(&self, q: &[f64]) -> DVec3 {
        DVec3::from_array(std::array::from_fn(|axis| {
            let [low, high] = self.ranges[axis];
            let share = q.get(axis).map_or(0.5, |value| (value - low) / (high - low));
            (share - 0.5) * self.sides[axis]
        }))
    }

    /// The corner with the given signs.
    fn corner(&self, signs: DVec3) -> DVec3 {
        0.5 * signs * self.sides
    }

    fn corners(&self) -> Vec<DVec3> {
        (0..8_u8)
            .map(|k| self.corner(DVec3::from_array([0, 1, 2].map(|axis| f64::from(k >> axis & 1) * 2.0 - 1.0))))
            .collect()
    }

    /// Corners of the box and of the room for the labels around it.
    fn with_labels(&self, direction: DVec3) -> Vec<DVec3> {
        let signs = direction.signum();
        let below =
            |corner: DVec3| corner + 0.13 * DVec3::new(signs.x, signs.y, -0.2) * corner.signum().dot(signs).max(0.0);
        self.corners()
            .into_iter()
            .flat_map(|corner| [corner, if corner.z < 0.0 { below(corner) } else { corner }])
            .collect()
    }

    /// Tick positions of an axis, as the coordinate in space, with their labels.
    fn ticks(&self, axis: usize) -> Vec<(f64, String)> {
        let [low, high] = self.ranges[axis];
        let intervals = (8.0 * self.sides[axis]).round() as usize;
        let place = |value: f64| ((value - low) / (high - low) - 0.5) * self.sides[axis];
        ticks::ticks([low, high], intervals).marks.into_iter().map(|(value, label)| (place(value), label)).collect()
    }

    /// The three faces behind the data, with grid lines.
    fn draw_walls(&self, raster: &mut Raster, direction: DVec3) {
        let away = -direction.signum();
        for normal in 0..3 {
            let [first, second] = [(normal + 1) % 3, (normal + 2) % 3];
            for (along, across) in [(first, second), (second, first)] {
                let edges = [-0.5, 0.5].map(|end| end * self.sides[along]);
                for place in self.ticks(along).into_iter().map(|tick| tick.0).chain(edges) {
                    let end = |sign: f64| {
                        let mut point = self.corner(away);
                        point[along] = place;
                        point[across] = sign * 0.5 * self.sides[across];
                        point
                    };
                    let is_edge = edges.contains(&place);
                    let (ink, width) = if is_edge { (colour::FRAME, 1.6) } else { (colour::GRID, 1.4) };
                    raster.line([end(-1.0), end(1.0)], width, ink, 0.0);
                }
            }
        }
    }

    /// Tick labels and titles along the three front edges: two of the floor, one upright on the left.
    fn label(&self, canvas: &mut Canvas, view: &Viewpoint, direction: DVec3, dataset: &Dataset) {
        let signs = direction.signum();
        let [right, ..] = view.camera.axes();
        let on_sheet = |point: DVec3| {
            let at = view.project(point)?;
            Some((PICTURE.x + at.x / PIXELS, PICTURE.y + at.y / PIXELS))
        };
        let upright = [DVec3::new(signs.x, -signs.y, 0.0), DVec3::new(-signs.x, signs.y, 0.0)]
            .into_iter()
            .min_by(|a, b| right.dot(*a).total_cmp(&right.dot(*b)))
            .unwrap_or(signs);
        let edges = [DVec3::new(0.0, signs.y, -1.0), DVec3::new(signs.x, 0.0, -1.0), upright];
        for (axis, edge) in edges.into_iter().enumerate().take(dataset.grid.joints()) {
            let base = self.corner(edge);
            let outward = edge.normalize_or_zero();
            // Floor labels hang below their edge; those of the upright one stand to its left.
            for (place, label) in self.ticks(axis) {
                let mut point = base;
                point[axis] = place;
                if let Some(at) = on_sheet(point + 0.05 * outward) {
                    let anchor = if axis == 2 { Anchor::End } else { Anchor::Middle };
                    canvas.text((at.0, at.1 + 4.0), &label, plot::TICK.anchored(anchor));
                }
            }
            let axis_of = &dataset.grid.axes[axis];
            let title = format!("q{} {} [{}]", subscript(axis + 1), axis_of.name, axis_of.unit);
            // The upright title ends a little right of its edge, where the wall behind does not reach it; the others
            // stand beyond their tick labels.
            let (position, anchor) = if axis == 2 {
                let mut top = base;
                top.z = 0.5 * self.sides.z;
                (on_sheet(top).map(|at| (at.0 + 16.0, at.1 - 16.0)), Anchor::End)
            } else {
                let rightwards = right.dot(outward) > 0.0;
                let shift = if rightwards { 34.0 } else { -34.0 };
                (on_sheet(base + 0.12 * outward).map(|at| (at.0 + shift, at.1 + 20.0)), Anchor::Middle)
            };
            if let Some(position) = position {
                canvas.text(position, &title, plot::TITLE.anchored(anchor));
            }
        }
    }
}
