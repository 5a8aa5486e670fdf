//! The window of `haptize view`, and the same picture without one: a dataset seen, pressed and understood.
//!
//! | file | subject |
//! |---|---|
//! | `app`, `panels` | the window's state and what happens in a frame; where panels lie |
//! | `session` | a dataset being felt |
//! | `window`, `offscreen` | the two places where it is drawn: a window, a picture |
//! | `theme`, `palette` | sizes and type, colours |
//! | `loaded`, `job`, `background` | what is open, how it is baked or read, and what the window must not wait for |
//! | `feel`, `guide`, `history` | the haptic loop beside the window, who leads the hand, what was felt lately |
//! | `lead` | a haptic device that leads in the place of all these |
//! | `scene`, `overlay`, `body` | the 3-D panel, what lies on top of its picture, the object on the GPU |
//! | `placing` | the object moved before the arm, the arm's pose taken for grid and motions |
//! | `readout`, `probe` | numbers over that picture, the vertex that was clicked |
//! | `steering`, `node_drag` | whence it is seen, and the pointer's grip on the proxy |
//! | `view_renderer`, `pipelines`, `shapes`, `links`, `pixels` | the renderer of that panel |
//! | `film` | the 3-D picture over time |
//! | `slices`, `column`, `cloud`, `plots`, `controls`, `gains`, `files` | the other panels |
//! | `legend`, `notice`, `steps` | samples and choices with their names, a message that fades, the first screen |
//!
//! One device computes and draws: the object's nodes go from the frame update to the screen without a read-back. The
//! haptic thread waits for nothing here; see `feel`.

mod app;
mod background;
mod body;
mod cloud;
mod column;
mod controls;
mod feel;
mod files;
mod film;
mod friction;
mod gains;
mod guide;
mod history;
mod job;
mod lead;
mod legend;
mod links;
mod loaded;
mod node_drag;
mod notice;
mod offscreen;
mod overlay;
mod palette;
mod panels;
mod pipelines;
mod pixels;
mod placing;
mod plots;
mod probe;
mod readout;
mod scene;
mod session;
mod shapes;
mod slices;
mod steering;
mod steps;
mod theme;
mod view_renderer;
mod window;

pub use app::{Start, Viewer};
pub use eframe::egui_wgpu::RenderState;
pub use feel::TickSource;
pub use lead::DeviceChoice;
pub use offscreen::{Picture, render_state, screenshot, video};
pub use theme::LEAST_WINDOW;
pub use window::open;

use crate::{
    Error, error,
    gpu::GpuError,
    memory,
    sweep::{OTHER_ADAPTER, remedied},
};
use eframe::egui::{Pos2, Rect, vec2};
use glam::DVec2;

/// Gives `ctx` the window's type, spacing and colours.
pub fn dress(ctx: &eframe::egui::Context) {
    theme::apply(ctx);
    palette::apply(ctx);
}

/// The viewer cannot go on.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ViewError {
    /// The device that draws.
    #[error("{}", remedied(&.0.to_string(), OTHER_ADAPTER))]
    Gpu(#[source] GpuError),
    /// All else.
    #[error(transparent)]
    Other(#[from] Error),
}

impl From<GpuError> for ViewError {
    fn from(error: GpuError) -> Self {
        let GpuError::NoAdapter { found, .. } = error else { return Self::Gpu(error) };
        let scarcity = memory::scarcity();
        Self::Other(error!(
            "the window needs a Vulkan, Metal or DX12 adapter to draw on, a software one will do; found: \
             {found}{scarcity}. Install your GPU's Vulkan driver or Mesa's software Vulkan (package \
             mesa-vulkan-drivers); haptize play and haptize info need neither"
        ))
    }
}

impl From<String> for ViewError {
    fn from(message: String) -> Self {
        Self::Other(message.into())
    }
}

/// Width over height of a picture in `rect`.
fn aspect(rect: Rect) -> f64 {
    f64::from(rect.width() / rect.height().max(1.0))
}

/// Where a point of the picture in `rect` is, x right and y up from -1 to 1.
fn on_screen(rect: Rect, at: DVec2) -> Pos2 {
    rect.center() + 0.5 * vec2(at.x as f32 * rect.width(), -at.y as f32 * rect.height())
}

/// Which point of the picture in `rect` is at `place`, x right and y up from -1 to 1.
fn in_picture(rect: Rect, place: Pos2) -> DVec2 {
    let from_centre = place - rect.center();
    DVec2::new((2.0 * from_centre.x / rect.width()).into(), (-2.0 * from_centre.y / rect.height()).into())
}

/// A number with three digits, as labels show it.
fn number(value: f64) -> String {
    let size = value.abs();
    if size == 0.0 {
        "0".into()
    } else if !value.is_finite() {
        "–".into()
    } else if size >= 100.0 {
        format!("{value:.0}")
    } else if size >= 10.0 {
        format!("{value:.1}")
    } else if size >= 1.0 {
        trimmed(format!("{value:.2}"))
    } else if size >= 0.01 {
        trimmed(format!("{value:.3}"))
    } else {
        format!("{value:.1e}")
    }
}

fn trimmed(text: String) -> String {
    text.trim_end_matches('0').trim_end_matches('.').to_owned()
}

#[cfg(test)]
mod tests {
    use super::number;

    #[test]
    fn labels_have_three_digits_and_no_idle_ones() {
        for (value, text) in [
            (0.0, "0"),
            (20.0, "20.0"),
            (1.5, "1.5"),
            (-0.25, "-0.25"),
            (0.0123, "0.012"),
            (123.4, "123"),
            (2e-5, "2.0e-5"),
            (f64::NAN, "–"),
        ] {
            assert_eq!(number(value), text);
        }
    }
}
