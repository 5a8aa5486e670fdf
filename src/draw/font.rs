//! The one typeface of all figures, shipped with the crate: Roboto (Apache-2.0, `fonts/LICENSE-Roboto.txt`), cut down
//! to Latin, Greek and mathematical signs, 20 kB a weight, so that a machine without any font draws the same bytes.

use base64::{Engine, engine::general_purpose::STANDARD};
use tiny_skia::PathBuilder;
use ttf_parser::{Face, GlyphId, OutlineBuilder};

const REGULAR: &[u8] = include_bytes!("fonts/Roboto-Regular.ttf");
const MEDIUM: &[u8] = include_bytes!("fonts/Roboto-Medium.ttf");

/// Family name that the sheet's SVG asks for.
pub(super) const FAMILY: &str = "Roboto";

/// How heavy a text is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Weight {
    /// Tick labels, legends.
    Regular,
    /// Titles.
    Medium,
}

impl Weight {
    /// The number that CSS gives it.
    pub(super) fn css(self) -> u16 {
        match self {
            Self::Regular => 400,
            Self::Medium => 500,
        }
    }

    fn bytes(self) -> &'static [u8] {
        match self {
            Self::Regular => REGULAR,
            Self::Medium => MEDIUM,
        }
    }
}

/// The font of `weight`. None where it is unreadable, which a test rules out.
fn face(weight: Weight) -> Option<Face<'static>> {
    Face::parse(weight.bytes(), 0).ok()
}

/// Units of the sheet in a unit of `face` at `size`.
fn scale(face: &Face<'_>, size: f64) -> f64 {
    size / f64::from(face.units_per_em())
}

/// Distance from a glyph to the next, in units of `face`; half an em where the font says nothing. Kerning is left out,
/// here as in the SVG.
fn advance(face: &Face<'_>, glyph: Option<GlyphId>) -> f64 {
    let advance = glyph.and_then(|glyph| face.glyph_hor_advance(glyph));
    f64::from(advance.unwrap_or(face.units_per_em() / 2))
}

/// Width of `text` at `size`, in the sheet's units.
pub(super) fn width(text: &str, size: f64, weight: Weight) -> f64 {
    let Some(face) = face(weight) else { return text.chars().count() as f64 * size / 2.0 };
    text.chars().map(|character| advance(&face, face.glyph_index(character))).sum::<f64>() * scale(&face, size)
}

/// Outline of `text` at `size`, its base line from the origin to the right; none where nothing is to be seen.
pub(super) fn outline(text: &str, size: f64, weight: Weight) -> Option<tiny_skia::Path> {
    let face = face(weight)?;
    let scale = scale(&face, size) as f32;
    let mut pen = Pen { path: PathBuilder::new(), scale, x: 0.0 };
    for character in text.chars() {
        let glyph = face.glyph_index(character);
        if let Some(glyph) = glyph {
            face.outline_glyph(glyph, &mut pen);
        }
        pen.x += advance(&face, glyph) as f32;
    }
    pen.path.finish()
}

/// Draws glyphs side by side: from units of the font, y up, to those of the sheet, y down.
struct Pen {
    path: PathBuilder,
    scale: f32,
    /// Origin of the glyph (units of the font).
    x: f32,
}

impl Pen {
    fn at(&self, x: f32, y: f32) -> (f32, f32) {
        ((self.x + x) * self.scale, -y * self.scale)
    }
}

impl OutlineBuilder for Pen {
    fn move_to(&mut self, x: f32, y: f32) {
        let (x, y) = self.at(x, y);
        self.path.move_to(x, y);
    }

    fn line_to(&mut self, x: f32, y: f32) {
        let (x, y) = self.at(x, y);
        self.path.line_to(x, y);
    }

    fn quad_to(&mut self, x1: f32, y1: f32, x: f32, y: f32) {
        let ((x1, y1), (x, y)) = (self.at(x1, y1), self.at(x, y));
        self.path.quad_to(x1, y1, x, y);
    }

    fn curve_to(&mut self, x1: f32, y1: f32, x2: f32, y2: f32, x: f32, y: f32) {
        let ((x1, y1), (x2, y2), (x, y)) = (self.at(x1, y1), self.at(x2, y2), self.at(x, y));
        self.path.cubic_to(x1, y1, x2, y2, x, y);
    }

    fn close(&mut self) {
        self.path.close();
    }
}

/// `@font-face` rules with the fonts inside, so that an SVG looks the same wherever it is opened.
pub(super) fn style_sheet() -> String {
    [Weight::Regular, Weight::Medium]
        .map(|weight| {
            format!(
                "@font-face{{font-family:{FAMILY};font-weight:{};src:url(data:font/ttf;base64,{}) format('truetype')}}",
                weight.css(),
                STANDARD.encode(weight.bytes())
            )
        })
        .concat()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn both_weights_hold_every_character_that_figures_use() {
        for weight in [Weight::Regular, Weight::Medium] {
            let face = face(weight).unwrap();
            let used = (' '..='~').chain("τθψ₁₂₃₄₅₆−·×–°‖µ≥⁰²³⁴⁵⁶⁷⁸⁹¹⁻Δ…".chars());
            for character in used {
                assert!(face.glyph_index(character).is_some(), "{weight:?} lacks {character:?}");
            }
        }
    }

    #[test]
    fn width_grows_with_size_and_weight() {
        let narrow = width("Contact torque", 10.0, Weight::Regular);
        assert!((width("Contact torque", 20.0, Weight::Regular) / narrow - 2.0).abs() < 1e-3);
        assert!(width("Contact torque", 10.0, Weight::Medium) > narrow);
        assert!((5.0..8.0).contains(&(narrow / 10.0)));
    }
}
