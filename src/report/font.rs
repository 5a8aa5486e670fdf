//! The one typeface of all figures, shipped with the crate: Roboto (Apache-2.0, `fonts/LICENSE-Roboto.txt`), cut down
//! to Latin, Greek and mathematical signs, 20 kB a weight, so that a machine without any font draws the same bytes.

use skrifa::{
    FontRef, MetadataProvider,
    instance::{LocationRef, Size},
};
use std::sync::Arc;

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

/// Width of `text` at `size`, in the sheet's units; kerning is left out (it only narrows).
pub(super) fn width(text: &str, size: f64, weight: Weight) -> f64 {
    // The fonts are part of the program; were they unreadable, half an em a character keeps layouts usable.
    let Ok(font) = FontRef::new(weight.bytes()) else {
        return text.chars().count() as f64 * size / 2.0;
    };
    let characters = font.charmap();
    let metrics = font.glyph_metrics(Size::new(size as f32), LocationRef::default());
    text.chars()
        .map(|character| characters.map(character).and_then(|glyph| metrics.advance_width(glyph)))
        .map(|advance| advance.map_or(size / 2.0, f64::from))
        .sum()
}

/// The fonts for the rasteriser.
pub(super) fn database() -> Arc<resvg::usvg::fontdb::Database> {
    let mut database = resvg::usvg::fontdb::Database::new();
    database.load_font_data(REGULAR.to_vec());
    database.load_font_data(MEDIUM.to_vec());
    database.set_sans_serif_family(FAMILY);
    Arc::new(database)
}

/// `@font-face` rules with the fonts inside, so that an SVG looks the same wherever it is opened.
pub(super) fn style_sheet() -> String {
    [Weight::Regular, Weight::Medium]
        .map(|weight| {
            format!(
                "@font-face{{font-family:{FAMILY};font-weight:{};src:url(data:font/ttf;base64,{}) format('truetype')}}",
                weight.css(),
                base64(weight.bytes())
            )
        })
        .concat()
}

/// Standard alphabet, padded (RFC 4648, section 4).
fn base64(bytes: &[u8]) -> String {
    const ALPHABET: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let mut text = String::with_capacity(bytes.len().div_ceil(3) * 4);
    for chunk in bytes.chunks(3) {
        let word = chunk.iter().fold(0_u32, |word, &byte| word << 8 | u32::from(byte)) << (8 * (3 - chunk.len()));
        for position in 0..4 {
            let digit = (word >> (18 - 6 * position)) as usize & 63;
            text.push(if position <= chunk.len() { char::from(ALPHABET[digit]) } else { '=' });
        }
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn base64_agrees_with_the_standards_examples() {
        for (plain, coded) in [("", ""), ("f", "Zg=="), ("fo", "Zm8="), ("foo", "Zm9v"), ("foobar", "Zm9vYmFy")] {
            assert_eq!(base64(plain.as_bytes()), coded);
        }
    }

    #[test]
    fn both_weights_hold_every_character_that_figures_use() {
        for weight in [Weight::Regular, Weight::Medium] {
            let characters = FontRef::new(weight.bytes()).unwrap().charmap();
            let used = (' '..='~').chain("τθψ₁₂₃₄₅₆−·×–°‖µ≥⁰²³⁴⁵⁶⁷⁸⁹¹⁻Δ…".chars());
            for character in used {
                assert!(characters.map(character).is_some(), "{weight:?} lacks {character:?}");
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
