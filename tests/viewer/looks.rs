//! How the window looks, light and dark.

use super::window::{SPHERE, Window};
use eframe::egui::Theme;
use egui_kittest::{SnapshotOptions, kittest::Queryable};
use haptize::viewer::Start;

/// Greatest colour distance of a pixel (weighted, squared, in YIQ) that counts as alike, egui's own, and how many
/// others there may be of the window's 504,000. Measured: none differs at all between processes on one machine, alone
/// or after all other tests; five do, light and dark, where the rasteriser compiles for a processor of another kind
/// (SSE2 instead of AVX2), on the rims of curves. Four times that is allowed. What must be told differs in far more,
/// which is tested: a single word that is missing in 350.
const ALIKE: f32 = 0.6;
const OTHER_PIXELS: usize = 20;

fn alike() -> SnapshotOptions {
    SnapshotOptions::new().threshold(ALIKE).max_failed_pixels(OTHER_PIXELS)
}

fn looks_as_it_did(theme: Theme, name: &str) {
    let mut window = Window::open(&Start::File(SPHERE.1.clone()), [900.0, 560.0], theme);
    window.harness.set_render_cursor(false);
    window.click("Press");
    window.pass(2.2);
    window.harness.snapshot_options(name, &alike());
    if std::env::var_os("UPDATE_SNAPSHOTS").is_some() {
        return;
    }
    let picture = window.harness.render().unwrap();
    let differs = |other: &image::RgbaImage| egui_kittest::try_image_snapshot_options(other, name, &alike()).is_err();
    assert!(!differs(&picture));
    // A panel is missing, or a single word.
    for label in ["Plane of C-space", "3-D scene", "Configuration", "PNG"] {
        let mut without = picture.clone();
        let gone = window.harness.get_by_label(label).rect();
        let ground = *picture.get_pixel(gone.min.x as u32, gone.min.y as u32);
        for y in gone.min.y as u32..gone.max.y as u32 {
            for x in gone.min.x as u32..gone.max.x as u32 {
                without.put_pixel(x, y, ground);
            }
        }
        assert!(differs(&without), "{label} may be missing");
    }
    // A press that is half a second on.
    window.pass(0.5);
    let later = window.harness.render().unwrap();
    assert!(differs(&later), "a later window looks alike");
}

#[test]
fn the_light_window_looks_as_it_did() {
    looks_as_it_did(Theme::Light, "window_light");
}

#[test]
fn the_dark_window_looks_as_it_did() {
    looks_as_it_did(Theme::Dark, "window_dark");
}
