//! Colours of the window, light and dark: the palette of the figures (`report/colour.rs`), few accents.

use super::theme::{HAIRLINE, ROUNDING, SHADOW_BLUR, SHADOW_DROP};
use crate::draw::colour::Colour;
use eframe::egui::{self, Color32, CornerRadius, Shadow, Stroke, Theme, Visuals, style::HandleShape};

/// Strength of lines that only help to read others, over their colour's own (1).
pub const FAINT: f32 = 0.45;

/// Colours of everything that egui does not draw itself.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Palette {
    /// Behind the 3-D scene and the plots.
    pub stage: Color32,
    /// Links of the proxy.
    pub link: Color32,
    /// Its nodes.
    pub node: Color32,
    /// Contacting nodes, forces: what is felt.
    pub force: Color32,
    /// Where the device is.
    pub ghost: Color32,
    /// Shadow on the ground of the scene.
    pub shadow: Color32,
    /// Axes of the scene and scale bar.
    pub axis: Color32,
    /// The current configuration in C-space.
    pub here: Color32,
    /// Points that are not to be trusted.
    pub flagged: Color32,
    /// Points where nothing is touched: far from the colour of a small torque, so that the edge of contact shows.
    pub free: Color32,
    /// Points without data.
    pub absent: Color32,
    /// Within its bound.
    pub good: Color32,
    /// Beyond its bound.
    pub bad: Color32,
}

/// egui's colour of a figure's.
#[must_use]
pub fn egui_colour(colour: Colour) -> Color32 {
    let [red, green, blue] = colour.rgb;
    Color32::from_rgb(red, green, blue).gamma_multiply(colour.opacity)
}

/// A figure's colour of egui's.
#[must_use]
pub fn figure_colour(colour: Color32) -> Colour {
    Colour { rgb: [colour.r(), colour.g(), colour.b()], opacity: 1.0 }
}

/// Colour of series `number` in a plot: Okabe and Ito's, on dark ground the blue in its lighter shade, on light ground
/// the light ones in a darker shade, since a line is thin. The fifth is a grey instead of their second blue.
#[must_use]
pub fn series(number: usize, dark: bool) -> Color32 {
    const LIGHT: [u32; 6] = [0x00_72_b2, 0xd5_5e_00, 0x00_9e_73, 0xb0_52_8a, 0x3f_48_54, 0x8f_7a_00];
    const DARK: [u32; 6] = [0x56_b4_e9, 0xe6_9f_00, 0x00_9e_73, 0xcc_79_a7, 0xdd_e2_e9, 0xf0_e4_42];
    let colours = if dark { DARK } else { LIGHT };
    egui_colour(Colour::hex(colours[number % colours.len()]))
}

/// A colour on light ground, or the one that takes its place on dark ground.
fn chosen(is_dark: bool, light: u32, dark: u32) -> Color32 {
    egui_colour(Colour::hex(if is_dark { dark } else { light }))
}

/// The palette that goes with `visuals`.
#[must_use]
pub fn of(visuals: &Visuals) -> Palette {
    let hex = |light, dark| chosen(visuals.dark_mode, light, dark);
    Palette {
        stage: hex(0xf6_f7_f9, 0x16_1a_20),
        link: hex(0x8d_97_a5, 0x8f_99_a8),
        node: hex(0x2b_34_40, 0xd5_dc_e6),
        force: hex(0xd5_5e_00, 0xf0_8a_3c),
        ghost: hex(0x00_72_b2, 0x56_b4_e9),
        shadow: hex(0xdf_e3_e8, 0x0d_10_14),
        axis: hex(0x6b_75_82, 0x8a_94_a3),
        here: hex(0x22_2b_36, 0xff_ff_ff),
        flagged: hex(0xd0_1c_55, 0xf6_5a_83),
        free: hex(0xc8_d0_d9, 0x24_2a_33),
        absent: hex(0x8f_99_a5, 0x10_13_17),
        good: hex(0x00_80_5c, 0x3d_b8_8f),
        bad: hex(0xc2_52_00, 0xf0_8a_3c),
    }
}

/// Colour of a plot's grid lines; dense ones are fainter.
#[must_use]
pub fn grid(visuals: &Visuals) -> Color32 {
    visuals.weak_text_color().gamma_multiply(FAINT)
}

/// The mark of the current configuration, as radius (points) and colour: a ring with a rim on both sides shows on any
/// ground. It has the colour of failures where it stands at the grid's border for a configuration `outside`.
#[must_use]
pub fn ring(palette: &Palette, outside: bool) -> [(f32, Color32); 3] {
    let colour = if outside { palette.flagged } else { palette.here };
    [(7.0, colour), (5.0, palette.stage), (2.5, colour)]
}

/// Gives `ctx` both sets of colours.
pub fn apply(ctx: &egui::Context) {
    ctx.set_visuals_of(Theme::Light, visuals(false));
    ctx.set_visuals_of(Theme::Dark, visuals(true));
}

/// egui's own colours, on light ground or on dark.
fn visuals(dark: bool) -> Visuals {
    let hex = |on_light, on_dark| chosen(dark, on_light, on_dark);
    let mut visuals = if dark { Visuals::dark() } else { Visuals::light() };
    let (ink, panel) = (hex(0x22_2b_36, 0xe3_e7_ed), hex(0xfa_fb_fc, 0x1d_21_28));
    visuals.weak_text_color = Some(hex(0x55_60_6e, 0xa7_b0_bd));
    visuals.extreme_bg_color = hex(0xff_ff_ff, 0x14_17_1c);
    visuals.panel_fill = panel;
    visuals.window_fill = panel;
    let line = Stroke::new(HAIRLINE, hex(0xd6_dc_e3, 0x36_3d_48));
    visuals.window_stroke = line;
    visuals.selection.bg_fill = hex(0xcf_e3_f2, 0x1d_4a_68);
    visuals.selection.stroke = Stroke::new(HAIRLINE, hex(0x00_4c_78, 0xc5_e4_f8));
    visuals.error_fg_color = hex(0xb0_1e_3c, 0xff_7d_94);
    visuals.warn_fg_color = hex(0xa8_48_00, 0xf5_a3_5c);
    visuals.hyperlink_color = hex(0x00_72_b2, 0x56_b4_e9);
    visuals.faint_bg_color = hex(0xf1_f3_f6, 0x22_27_2f);
    visuals.slider_trailing_fill = true;
    visuals.handle_shape = HandleShape::Circle;
    visuals.indent_has_left_vline = false;
    visuals.window_shadow = Shadow {
        offset: [0, SHADOW_DROP],
        blur: SHADOW_BLUR,
        spread: 0,
        color: Color32::from_black_alpha(if dark { 120 } else { 40 }),
    };
    visuals.popup_shadow = visuals.window_shadow;
    let widgets = &mut visuals.widgets;
    for (widget, fill, stroke) in [
        (&mut widgets.noninteractive, panel, line),
        (&mut widgets.inactive, hex(0xec_ef_f3, 0x2c_33_3d), Stroke::NONE),
        (&mut widgets.hovered, hex(0xe0_e5_eb, 0x38_41_4d), Stroke::NONE),
        (&mut widgets.active, hex(0xcf_d7_e0, 0x46_51_60), Stroke::NONE),
        (&mut widgets.open, hex(0xe6_ea_ef, 0x31_38_43), Stroke::NONE),
    ] {
        (widget.weak_bg_fill, widget.bg_fill, widget.bg_stroke) = (fill, fill, stroke);
        widget.fg_stroke.color = ink;
        widget.corner_radius = CornerRadius::same(ROUNDING);
        widget.expansion = 0.0;
    }
    visuals
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Contrast of two colours as WCAG 2.2 has it, from 1 to 21: its relative luminance is that of linear sRGB.
    fn contrast(a: Color32, b: Color32) -> f32 {
        let luminance = |colour: Color32| {
            let linear = |channel: u8| {
                let share = f32::from(channel) / 255.0;
                if share <= 0.04045 { share / 12.92 } else { ((share + 0.055) / 1.055).powf(2.4) }
            };
            0.2126 * linear(colour.r()) + 0.7152 * linear(colour.g()) + 0.0722 * linear(colour.b())
        };
        let [a, b] = [luminance(a) + 0.05, luminance(b) + 0.05];
        a.max(b) / a.min(b)
    }

    /// Least distance of two series' colours, in sRGB's 0 to 255: the second blue was 48 from the first.
    const APART: f32 = 70.0;

    #[test]
    fn six_series_are_told_apart() {
        for dark in [false, true] {
            for (a, b) in (0..6).flat_map(|a| (a + 1..6).map(move |b| (a, b))) {
                let [one, other] = [a, b].map(|number| series(number, dark).to_array().map(f32::from));
                let apart = (0..3).map(|k| (one[k] - other[k]).powi(2)).sum::<f32>().sqrt();
                assert!(apart >= APART, "{a} and {b}, dark {dark}: {apart}");
            }
        }
    }

    /// Least contrast of text (WCAG 2.2, level AA, 1.4.3), and of graphics that carry meaning (1.4.11).
    const TEXT: f32 = 4.5;
    const GRAPHICS: f32 = 3.0;

    #[test]
    fn text_and_marks_stand_out_from_their_ground() {
        assert!((contrast(Color32::BLACK, Color32::WHITE) - 21.0).abs() < 1e-4);
        assert!((contrast(Color32::from_rgb(0x76, 0x76, 0x76), Color32::WHITE) - 4.54).abs() < 0.01);
        for visuals in [visuals(false), visuals(true)] {
            let palette = of(&visuals);
            let texts = [
                visuals.text_color(),
                visuals.weak_text_color(),
                visuals.error_fg_color,
                visuals.warn_fg_color,
                visuals.hyperlink_color,
                palette.good,
                palette.flagged,
            ];
            for (number, text) in texts.into_iter().enumerate() {
                for ground in [visuals.panel_fill, visuals.extreme_bg_color, palette.stage] {
                    let found = contrast(text, ground);
                    assert!(found >= TEXT, "text {number} on {ground:?}, dark {}: {found}", visuals.dark_mode);
                }
            }
            let widgets = &visuals.widgets;
            for widget in [&widgets.inactive, &widgets.hovered, &widgets.active, &widgets.open] {
                assert!(contrast(widget.text_color(), widget.weak_bg_fill) >= TEXT, "{widget:?}");
            }
            assert!(contrast(visuals.selection.stroke.color, visuals.selection.bg_fill) >= TEXT);
            let marks = [palette.force, palette.ghost, palette.axis, palette.here, palette.bad, palette.good];
            for (number, mark) in marks.into_iter().chain((0..6).map(|k| series(k, visuals.dark_mode))).enumerate() {
                for ground in [visuals.panel_fill, palette.stage] {
                    let found = contrast(mark, ground);
                    assert!(found >= GRAPHICS, "mark {number} on {ground:?}, dark {}: {found}", visuals.dark_mode);
                }
            }
        }
    }
}
