//! Torque in C-space before and after uniform gridization (paper's Fig. 4): the size of the torque at every sample and
//! at every grid point, side by side.
//!
//! Two joints span the sheet. Of further joints a slab is shown, half a grid step to either side of a grid line: that
//! in which most grid points are in contact. Points outside the measured region are left out, as in the dataset.

use super::press::subscript;
use crate::{
    contact::Status,
    dataset::Dataset,
    draw::{
        canvas::{Anchor, Area, Canvas},
        chart,
        colour::ColourMap,
        plot::{self, Panel, Scale},
        ticks,
    },
    gridize::Samples,
};
use std::collections::BTreeMap;

const WIDTH: f64 = 860.0;
const HEIGHT: f64 = 420.0;
const PANEL: f64 = 330.0;
/// Radius of a disc, in points.
const DISC: f64 = 3.2;
/// Most discs of a panel: more cannot be distinguished.
const MOST_DISCS: usize = 20_000;

/// A point to be drawn: coordinates of the shown joints, size of the torque.
type Spot = ([f64; 2], f64);

/// Samples on the left, grid points on the right.
#[must_use]
pub fn gridized(samples: &Samples, dataset: &Dataset) -> Canvas {
    let grid = &dataset.grid;
    let joints = grid.joints();
    let fixed = slab(dataset);
    let shown = [joints.saturating_sub(2), joints - 1];
    let near = |q: &[f64]| {
        let off = |axis: usize| (q[axis] - grid.axes[axis].coordinate(fixed[axis])).abs() <= 0.5 * grid.axes[axis].step;
        (0..joints).filter(|axis| !shown.contains(axis)).all(off)
    };
    let spot = |q: &[f64], torque: &[f64]| {
        let size = torque.iter().map(|tau| tau * tau).sum::<f64>().sqrt();
        // One joint: the torque itself stands upright.
        let up = if joints == 1 { torque[0] } else { q[shown[1]] };
        ([q[shown[0]], up], size)
    };
    let rows = samples.configurations.chunks_exact(joints).zip(samples.torques.chunks_exact(joints));
    let before: Vec<Spot> = rows.filter(|(q, _)| near(q)).map(|(q, torque)| spot(q, torque)).collect();
    let inside = (0..grid.points()).filter(|&point| dataset.status(point) != Status::Outside);
    let points = inside.map(|point| (grid.configuration(point), dataset.torque(point)));
    let after: Vec<Spot> = points.filter(|(q, _)| near(q)).map(|(q, torque)| spot(&q, torque)).collect();

    let greatest = before.iter().chain(&after).map(|spot| spot.1).fold(0.0, f64::max);
    let map = ColourMap::Sequential { low: 0.0, high: if greatest > 0.0 { greatest } else { 1.0 } };
    let mut canvas = Canvas::new(WIDTH, HEIGHT);
    chart::headline(&mut canvas, "Torque in C-space before and after uniform gridization");
    canvas.text((chart::MARGIN, chart::MARGIN + 32.0), &caption(samples, dataset, &fixed, shown), plot::NOTE);
    let range = |axis: usize| {
        let both = before.iter().chain(&after).map(move |spot| spot.0[axis]);
        ticks::snapped(ticks::range(both, 0.04))
    };
    let name =
        |joint: usize| format!("q{} {} [{}]", subscript(joint + 1), grid.axes[joint].name, grid.axes[joint].unit);
    let unit = grid.axes[joints - 1].effort_unit();
    let up = if joints == 1 { format!("τ [{unit}]") } else { name(shown[1]) };
    for (number, (what, spots)) in [("samples", &before), ("grid", &after)].into_iter().enumerate() {
        let left = chart::MARGIN + 40.0 + number as f64 * (PANEL + 42.0);
        let area = Area { x: left, y: 104.0, width: PANEL, height: HEIGHT - 160.0 };
        let title = format!("{up}, {what}");
        let panel = Panel { area, across: Scale::linear(range(0), name(shown[0])), up: Scale::linear(range(1), title) };
        panel.grid(&mut canvas, true);
        for (place, size) in spots.iter().step_by(spots.len().div_ceil(MOST_DISCS).max(1)) {
            canvas.disc(panel.place((place[0], place[1])), DISC, map.colour(*size));
        }
        if spots.is_empty() {
            panel.note(&mut canvas, "no data");
        }
    }
    let bar = Area { x: WIDTH - 72.0, y: 140.0, width: 12.0, height: HEIGHT - 230.0 };
    plot::colour_bar(&mut canvas, bar, map, &format!("‖τ‖ [{unit}]"), Anchor::Start);
    canvas
}

/// Grid line of every joint at which most points are in contact, the last two joints running through.
fn slab(dataset: &Dataset) -> Vec<usize> {
    let axes = &dataset.grid.axes;
    let pitch: usize = axes.iter().skip(axes.len().saturating_sub(2)).map(|axis| axis.count).product();
    let mut contacts: BTreeMap<usize, usize> = BTreeMap::new();
    for point in (0..dataset.grid.points()).filter(|&point| dataset.status(point) == Status::Contact) {
        *contacts.entry(point / pitch).or_default() += 1;
    }
    let slab = contacts.into_iter().max_by_key(|&(slab, count)| (count, usize::MAX - slab)).map_or(0, |most| most.0);
    dataset.grid.lines(slab * pitch)[..axes.len()].to_vec()
}

fn caption(samples: &Samples, dataset: &Dataset, fixed: &[usize], shown: [usize; 2]) -> String {
    let inside = (0..dataset.grid.points()).filter(|&point| dataset.status(point) != Status::Outside).count();
    let from = match dataset.provenance.backend.as_str() {
        "" => String::new(),
        backend => format!(" ({backend})"),
    };
    let [(samples, of_samples), (inside, points)] = [(samples.len(), "sample"), (inside, "grid point")]
        .map(|(count, noun)| (ticks::thousands(count), if count == 1 { noun.to_owned() } else { format!("{noun}s") }));
    let mut text = format!("{samples} {of_samples}{from}, {inside} {points} inside the measured region");
    let axes = dataset.grid.axes.iter().enumerate().filter(|(axis, _)| !shown.contains(axis));
    let planes: Vec<String> = axes
        .map(|(axis, of)| {
            format!("q{} = {} {}", subscript(axis + 1), ticks::number(of.coordinate(fixed[axis]), 3), of.unit)
        })
        .collect();
    if !planes.is_empty() {
        text += &format!("; shown: those next to {}", planes.join(", "));
    }
    text
}
