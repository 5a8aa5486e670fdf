//! Samples and choices, each with its name.

use super::theme::{self, GAP};
use eframe::egui::{ComboBox, Rect, Response, Role, Sense, Ui, Vec2, WidgetInfo, WidgetText, pos2, vec2};

/// Room for a sample of `size`, with `name` behind it: one thing, so that no line ends between them or within the name.
/// Answers with where the sample goes.
pub fn entry(ui: &mut Ui, size: Vec2, name: &str) -> Rect {
    let text = ui.painter().layout_no_wrap(name.to_owned(), theme::small(), ui.visuals().text_color());
    let whole = vec2(size.x + GAP + text.size().x, size.y.max(text.size().y));
    let (rect, response) = ui.allocate_exact_size(whole, Sense::hover());
    response.widget_info(|| WidgetInfo::labeled(Role::Label, true, name));
    let corner = pos2(rect.left() + size.x + GAP, rect.center().y - 0.5 * text.size().y);
    ui.painter().galley(corner, text, ui.visuals().text_color());
    Rect::from_center_size(rect.left_center() + vec2(0.5 * size.x, 0.0), size)
}

/// A choice called `label`, `width` points wide or as wide as there is room: `chosen`, and what there is to choose.
pub fn choice(
    ui: &mut Ui,
    label: &Response,
    id: &str,
    width: Option<f32>,
    chosen: impl Into<WidgetText>,
    list: impl FnOnce(&mut Ui),
) {
    let choice = ComboBox::from_id_salt(id).width(width.unwrap_or(ui.available_width())).selected_text(chosen);
    let choice = if width.is_none() { choice.truncate() } else { choice };
    choice.show_ui(ui, list).response.labelled_by(label.id);
}
