//! The haptized data as a cloud of points in C-space (paper's Fig. 3): every configuration in contact, coloured by the
//! size of its torque, over the first three joints. It turns with the pointer. With more than three joints the others
//! stay at the grid line nearest to the configuration.

use super::{
    aspect,
    loaded::Loaded,
    number, on_screen, palette,
    slices::gradient,
    theme::{self, COLOUR_BAR, FINE_GAP, GAP, HAIRLINE, ROUNDING},
};
use crate::{
    JointVector,
    contact::Status,
    dataset::Dataset,
    draw::{camera::Camera, colour::ColourMap},
    report::slices::{torque_size, torque_size_label},
};
use eframe::egui::{self, Align2, Color32, Pos2, Rect, Sense, Stroke, Ui, pos2, vec2};
use glam::{DVec2, DVec3};

/// From where it is seen at first (rad): a little more from the side than the 3-D scene, so that all three names show.
const AZIMUTH: f64 = -0.95;
const ELEVATION: f64 = 0.45;

/// Radius of what is seen whole about the box from -1 to 1: its corners, at sqrt 3, and the names beside them.
const SEEN: f64 = 2.1;

/// Distance of names from the box's middle, over that of its faces (1).
const NAMES: f64 = 1.18;

/// Radius of a dot at the greatest torque over the distance of neighbours: nearly touching (1); within these limits
/// (points); and of the least torque over that of the greatest (1).
const DOT: f32 = 0.4;
const DOTS: [f32; 2] = [1.0, 6.0];
const LEAST_SHARE: f64 = 0.45;

/// Most dots that are shown: more overlap one another, and cost frames.
const MOST: usize = 12_000;

/// The colour bar, from the panel's upper right corner (points).
const BAR_AT: egui::Vec2 = vec2(-104.0, 22.0);
const BAR_WIDTH: f32 = 86.0;

/// The cloud's panel.
pub struct Cloud {
    camera: Camera,
    /// Grid lines of the joints beyond the third, and the points on them.
    points: Option<(Vec<usize>, Vec<Point>)>,
    /// Stride of the grid lines that are shown, along the first three joints.
    pitch: usize,
    high: f64,
}

/// A configuration in contact.
struct Point {
    /// In the box from -1 to 1.
    place: DVec3,
    torque: f64,
    status: Status,
}

impl Cloud {
    /// The cloud of `dataset`.
    #[must_use]
    pub fn new(dataset: &Dataset) -> Self {
        let contact = || (0..dataset.grid.points()).filter(|&point| dataset.status(point).is_in_contact());
        let trusted = contact().filter(|&point| !dataset.status(point).is_failed());
        let high = trusted.map(|point| torque_size(dataset, point)).fold(0.0, f64::max);
        let axes = &dataset.grid.axes;
        let others: usize = axes.iter().skip(3).map(|axis| axis.count).product();
        Self { camera: home(), points: None, pitch: pitch(contact().count() / others, axes.len().min(3)), high }
    }

    /// Shows it in a picture `height` points high.
    pub fn show(&mut self, ui: &mut Ui, loaded: &Loaded, q: &JointVector, height: f32) {
        let dataset = &loaded.dataset;
        let grid = &dataset.grid;
        let (rect, response) = ui.allocate_exact_size(vec2(ui.available_width(), height), Sense::click_and_drag());
        response.widget_info(|| egui::WidgetInfo::labeled(egui::Role::Canvas, true, "Cloud of contacts in C-space"));
        let moved = response.drag_delta() / rect.height();
        self.camera.orbit(DVec2::new(moved.x.into(), moved.y.into()));
        if response.double_clicked() {
            self.camera = home();
        }
        let others: Vec<usize> =
            grid.axes.iter().zip(q.iter()).skip(3).map(|(axis, q)| axis.nearest_line(*q)).collect();
        if self.points.as_ref().is_none_or(|(known, _)| *known != others) {
            self.points = Some((others.clone(), points(dataset, &others, self.pitch)));
        }
        let Some((_, points)) = &self.points else { return };
        let palette = palette::of(ui.visuals());
        let painter = ui.painter_at(rect);
        painter.rect_filled(rect, f32::from(ROUNDING), palette.stage);
        let show = |place: DVec3| {
            let seen = self.camera.project(place, aspect(rect));
            seen.map_or((rect.center(), 0.0), |seen| (on_screen(rect, seen.at), seen.depth))
        };
        self.frame(
            &painter,
            &show,
            dataset,
            ui.visuals().weak_text_color(),
            palette.axis.gamma_multiply(palette::FAINT),
        );
        let map = ColourMap::Root { high: self.high };
        let mut dots: Vec<(Pos2, f64, &Point)> = points
            .iter()
            .map(|point| {
                let (at, depth) = show(point.place);
                (at, depth, point)
            })
            .collect();
        dots.sort_by(|a, b| b.1.total_cmp(&a.1));
        // Distance of neighbours in the box, the geometric mean over its sides.
        let shown = grid.axes.len().min(3) as f32;
        let cell = grid.axes.iter().take(3).map(|axis| 2.0 / axis.count as f32).product::<f32>().powf(1.0 / shown);
        let cell = cell * self.pitch as f32;
        let radius = (DOT * cell / self.camera.height_at_target() as f32 * rect.height()).clamp(DOTS[0], DOTS[1]);
        for (at, _, point) in dots {
            let share = (point.torque / self.high.max(f64::MIN_POSITIVE)).cbrt().clamp(LEAST_SHARE, 1.0) as f32;
            let colour =
                if point.status.is_failed() { palette.flagged } else { palette::egui_colour(map.colour(point.torque)) };
            painter.circle_filled(at, radius * share, colour);
        }
        let inside = grid.clamp(q);
        let (here, _) = show(place(dataset, &inside));
        for (radius, colour) in palette::ring(&palette, inside != *q) {
            painter.circle_filled(here, radius, colour);
        }
        if self.pitch > 1 {
            let note = format!("one grid line in {}", self.pitch);
            let at = rect.left_top() + vec2(GAP, GAP);
            painter.text(at, Align2::LEFT_TOP, note, theme::small(), ui.visuals().weak_text_color());
        }
        let bar = Rect::from_min_size(rect.right_top() + BAR_AT, vec2(BAR_WIDTH, COLOUR_BAR));
        gradient(&painter, bar, map);
        let (text, small) = (ui.visuals().text_color(), theme::small());
        let title = torque_size_label(dataset);
        let title = painter.layout_no_wrap(title, small.clone(), text);
        // In the middle over the bar, where that leaves it in the picture.
        let left = (bar.center().x - 0.5 * title.size().x).min(rect.right() - GAP - title.size().x);
        painter.galley(pos2(left, bar.top() - FINE_GAP - title.size().y), title, text);
        painter.text(bar.left_bottom() + vec2(0.0, FINE_GAP), Align2::CENTER_TOP, "0", small.clone(), text);
        painter.text(
            bar.right_bottom() + vec2(-FINE_GAP, FINE_GAP),
            Align2::CENTER_TOP,
            number(self.high),
            small,
            text,
        );
    }

    /// The box's edges, and the names of its axes with their ends.
    fn frame(
        &self,
        painter: &egui::Painter,
        show: &dyn Fn(DVec3) -> (Pos2, f64),
        dataset: &Dataset,
        text: Color32,
        line: Color32,
    ) {
        let small = theme::small();
        for axis in 0..3 {
            for (u, v) in [(-1.0, -1.0), (-1.0, 1.0), (1.0, -1.0), (1.0, 1.0)] {
                let mut ends = [DVec3::ZERO; 2];
                for (end, along) in ends.iter_mut().zip([-1.0, 1.0]) {
                    (end[axis], end[(axis + 1) % 3], end[(axis + 2) % 3]) = (along, u, v);
                }
                painter.line_segment(ends.map(|end| show(end).0), Stroke::new(HAIRLINE, line));
            }
        }
        // Names along the edges of the floor nearest to the eye, and along the upright one farthest left.
        let [.., toward] = self.camera.axes();
        let near = |component: f64| if component < 0.0 { -1.0 } else { 1.0 };
        let [x, y] = [near(toward.x), near(toward.y)];
        let places = [DVec3::new(0.0, NAMES * y, -NAMES), DVec3::new(NAMES * x, 0.0, -NAMES)];
        let left = [DVec3::new(x, -y, 0.0), DVec3::new(-x, y, 0.0)];
        let upright = left.into_iter().min_by(|a, b| show(*a).0.x.total_cmp(&show(*b).0.x)).unwrap_or(DVec3::ZERO);
        for (joint, (axis, place)) in dataset.grid.axes.iter().zip(places.into_iter().chain([upright])).enumerate() {
            let align = if joint == 2 { Align2::RIGHT_CENTER } else { Align2::CENTER_CENTER };
            let offset = if joint == 2 { vec2(-GAP, 0.0) } else { vec2(0.0, GAP) };
            let name = painter.layout_no_wrap(format!("{} [{}]", axis.name, axis.unit), small.clone(), text);
            // A narrow panel has no room beside the box.
            let within = painter.clip_rect().shrink(FINE_GAP);
            let at = align.anchor_size(show(place).0 + offset, name.size()).min;
            let at = at.clamp(within.min, within.max - name.size());
            painter.galley(at, name, text);
        }
    }
}

fn home() -> Camera {
    Camera { azimuth: AZIMUTH, elevation: ELEVATION, ..Camera::looking_at(DVec3::ZERO, SEEN) }
}

/// Returns where a configuration lies in the box from -1 to 1; missing joints in its middle, or on its floor.
fn place(dataset: &Dataset, q: &JointVector) -> DVec3 {
    let mut place = DVec3::new(0.0, 0.0, if dataset.grid.joints() < 3 { -1.0 } else { 0.0 });
    for (joint, axis) in dataset.grid.axes.iter().enumerate().take(3) {
        let half = 0.5 * axis.step * (axis.count - 1).max(1) as f64;
        place[joint] = (q[joint] - axis.start) / half - 1.0;
    }
    place
}

/// Distance of the grid lines of which `count` configurations on `axes` joints leave no more than [`MOST`].
fn pitch(count: usize, axes: usize) -> usize {
    let share = count as f64 / MOST as f64;
    share.powf(1.0 / axes.max(1) as f64).ceil().max(1.0) as usize
}

/// Configurations in contact, on every `pitch`th grid line of the first three joints.
fn points(dataset: &Dataset, others: &[usize], pitch: usize) -> Vec<Point> {
    let grid = &dataset.grid;
    let block: usize = grid.axes.iter().skip(3).map(|axis| axis.count).product();
    let within = grid.point([0; 3].into_iter().chain(others.iter().copied()));
    (0..grid.points())
        .step_by(block)
        .filter(|&first| grid.lines(first).iter().take(3).all(|line| line.is_multiple_of(pitch)))
        .map(|first| first + within)
        .filter(|&point| dataset.status(point).is_in_contact())
        .map(|point| Point {
            place: place(dataset, &dataset.grid.configuration(point)),
            torque: torque_size(dataset, point),
            status: dataset.status(point),
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn of_a_large_grid_few_lines_are_shown_and_of_a_small_one_all() {
        assert_eq!((pitch(0, 3), pitch(MOST, 3), pitch(MOST + 1, 3)), (1, 1, 2));
        for count in [50_000, 500_000, 5_000_000] {
            let shown = count as f64 / (pitch(count, 3) as f64).powi(3);
            assert!(shown <= MOST as f64 && shown > MOST as f64 / 8.0, "{shown} of {count}");
        }
    }
}
