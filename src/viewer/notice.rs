//! A short message that fades: what was saved, and where.

use super::theme::{self, GROUP_GAP};
use eframe::egui::{Align2, Area, Context, Frame, Id, Order, RichText, vec2};
use std::time::Duration;

/// A message, and when it was first shown (s).
pub struct Notice {
    text: String,
    since: Option<f64>,
}

/// How long a message is shown, and the last part of that, in which it fades (s): a line is read in less than half of
/// it.
const SHOWN: f64 = 6.0;
const FADING: f64 = 1.0;

impl Notice {
    /// A message to be shown from the next frame on.
    #[must_use]
    pub fn new(text: String) -> Self {
        Self { text, since: None }
    }

    /// Shows it above the lower edge of the window, `above` points higher, and returns whether it is still to be shown.
    pub fn show(&mut self, ctx: &Context, above: f32) -> bool {
        let now = ctx.input(|input| input.time);
        let left = SHOWN - (now - *self.since.get_or_insert(now));
        let place = Area::new(Id::unique("notice")).order(Order::Foreground).interactable(false);
        place.anchor(Align2::CENTER_BOTTOM, vec2(0.0, -above - GROUP_GAP)).show(ctx, |ui| {
            ui.set_opacity((left / FADING).clamp(0.0, 1.0) as f32);
            ui.set_max_width(theme::MESSAGE_WIDTH);
            Frame::popup(ui.style()).show(ui, |ui| ui.label(RichText::new(&self.text)));
        });
        ctx.request_repaint_after(Duration::from_secs_f64(if left > FADING { left - FADING } else { 0.0 }));
        left > 0.0
    }
}
