//! Labels on top of the 3-D picture: axes, a scale, the meaning of colours and arrows.

use super::{
    body::Body,
    legend, number,
    palette::Palette,
    slices::gradient,
    theme::{self, AXIS_LINE, COLOUR_BAR, CROSS, CURVE, FINE_GAP, GAP, SAMPLE, TICK},
    trimmed,
    view_renderer::Quantity,
};
use crate::draw::{camera::Camera, colour::ColourMap};
use eframe::egui::{Align2, Painter, Rect, Stroke, Ui, Vec2, vec2};
use glam::DVec3;

// From the picture's lower left corner [points]: axes, how long they are and where their names are over that [1], the
// scale and how long it is at most. From its lower right: the end of the bar of colours, and how long that is. In a
// narrow picture both are shorter.
const AXES_AT: Vec2 = vec2(34.0, -34.0);
const AXES_LENGTH: f32 = 22.0;
const AXES_NAMES: f32 = 1.38;
const SCALE_AT: Vec2 = vec2(78.0, -22.0);
const LONGEST_SCALE: f32 = 90.0;
const LEAST_SCALE: f32 = 20.0;
const BAR_END: Vec2 = vec2(-20.0, -26.0);
const BAR_WIDTH: [f32; 2] = [60.0, 136.0];
/// Left of the bar: axes, a short scale.
const LEFT_OF_BAR: f32 = 132.0;

/// Draws it over the picture in `rect`, seen by `camera`.
pub fn show(ui: &Ui, rect: Rect, palette: &Palette, camera: &Camera, body: Option<&Body>, quantity: Quantity) {
    let painter = ui.painter_at(rect);
    axes(ui, &painter, rect, palette, camera);
    scale(ui, &painter, rect, palette, camera);
    if let Some(body) = body {
        colours(ui, &painter, rect, body, quantity);
    }
}

/// Names the colours that there are besides that of the surface. `arrows`, `ghost`: whether these are shown.
pub fn keys(ui: &mut Ui, palette: &Palette, body: Option<&Body>, arrows: bool, ghost: bool) {
    let forces = body.into_iter().flat_map(Body::contacts).map(|(_, force)| force.length());
    if let Some(most) = forces.reduce(f64::max) {
        let sample = legend::entry(ui, SAMPLE, "vertex in contact").center();
        ui.painter().circle_filled(sample, CROSS, palette.force);
        if arrows {
            let sample = legend::entry(ui, SAMPLE, &format!("force on the arm, longest {} N", number(most)));
            let along = vec2(sample.width(), 0.0);
            ui.painter().arrow(sample.left_center(), along, Stroke::new(CURVE, palette.force));
        }
    }
    if ghost {
        let sample = legend::entry(ui, SAMPLE, "ghost: the device");
        let ends = [sample.left_center(), sample.right_center()];
        ui.painter().line_segment(ends, Stroke::new(CURVE, palette.ghost));
    }
}

/// Axes, turned as the scene is.
fn axes(ui: &Ui, painter: &Painter, rect: Rect, palette: &Palette, camera: &Camera) {
    let [right, up, _] = camera.axes();
    let origin = rect.left_bottom() + AXES_AT;
    for (axis, name) in [(DVec3::X, "x"), (DVec3::Y, "y"), (DVec3::Z, "z")] {
        let end = vec2(axis.dot(right) as f32, -axis.dot(up) as f32) * AXES_LENGTH;
        painter.line_segment([origin, origin + end], Stroke::new(AXIS_LINE, palette.axis));
        let at = origin + end * AXES_NAMES;
        painter.text(at, Align2::CENTER_CENTER, name, theme::small(), ui.visuals().text_color());
    }
}

/// A round length at the distance of what is looked at.
fn scale(ui: &Ui, painter: &Painter, rect: Rect, palette: &Palette, camera: &Camera) {
    let points_per_metre = rect.height() / camera.height_at_target() as f32;
    let room = bar(rect).left() - rect.left() - SCALE_AT.x - GAP;
    let length = round_length(f64::from(room.clamp(LEAST_SCALE, LONGEST_SCALE) / points_per_metre));
    let width = length as f32 * points_per_metre;
    let left = rect.left_bottom() + SCALE_AT;
    let stroke = Stroke::new(AXIS_LINE, palette.axis);
    painter.line_segment([left, left + vec2(width, 0.0)], stroke);
    for end in [left, left + vec2(width, 0.0)] {
        painter.line_segment([end - vec2(0.0, TICK), end + vec2(0.0, TICK)], stroke);
    }
    let label = format!("{} mm", trimmed(format!("{:.3}", 1e3 * length)));
    let at = left + vec2(0.5 * width, -GAP);
    painter.text(at, Align2::CENTER_BOTTOM, label, theme::small(), ui.visuals().text_color());
}

/// Draws the key of the surface's colours.
fn colours(ui: &Ui, painter: &Painter, rect: Rect, body: &Body, quantity: Quantity) {
    let (title, top) = match quantity {
        Quantity::Displacement => ("displacement [mm]", 1e3 * body.most(quantity)),
        Quantity::Force => ("contact force [N]", body.most(quantity)),
    };
    let (small, text) = (theme::small(), ui.visuals().text_color());
    let bar = bar(rect);
    gradient(painter, bar, ColourMap::Pale { low: 0.0, high: 1.0 });
    painter.text(bar.center_top() - vec2(0.0, FINE_GAP), Align2::CENTER_BOTTOM, title, small.clone(), text);
    painter.text(bar.left_bottom() + vec2(0.0, FINE_GAP), Align2::CENTER_TOP, "0", small.clone(), text);
    painter.text(bar.right_bottom() + vec2(0.0, FINE_GAP), Align2::CENTER_TOP, number(top), small, text);
}

/// Returns where the bar of colours lies in the picture `rect`.
fn bar(rect: Rect) -> Rect {
    let [least, most] = BAR_WIDTH;
    let width = (rect.width() - LEFT_OF_BAR + BAR_END.x).clamp(least, most);
    Rect::from_min_size(rect.right_bottom() + BAR_END - vec2(width, 0.0), vec2(width, COLOUR_BAR))
}

/// The largest of 1, 2, 5 times a power of ten that is not longer than `limit` (m).
fn round_length(limit: f64) -> f64 {
    let decade = 10.0_f64.powf(limit.max(f64::MIN_POSITIVE).log10().floor());
    [5.0, 2.0, 1.0].into_iter().map(|digit| digit * decade).find(|length| *length <= limit).unwrap_or(decade)
}

#[cfg(test)]
mod tests {
    use super::round_length;

    #[test]
    fn scale_bars_are_round_and_fit() {
        for (limit, length) in [(0.0231, 0.02), (0.0999, 0.05), (1.0, 1.0), (0.0019, 0.001)] {
            assert!((round_length(limit) - length).abs() < 1e-12, "{limit}");
        }
    }
}
