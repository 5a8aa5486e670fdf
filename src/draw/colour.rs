//! Colours that survive colour blindness and grey printing.
//!
//! Series take Okabe and Ito's palette (2008), darkest first; magnitudes viridis; signed quantities a blue-white-red
//! map. Sequential and diverging maps are perceptually ordered, so that a figure says the same in grey (viridis) or
//! keeps its sign apart in hue (the diverging one).

use std::fmt;

/// An opaque or translucent colour, sRGB.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Colour {
    /// Red, green, blue, 0 to 255.
    pub rgb: [u8; 3],
    /// 0 clear, 1 opaque.
    pub opacity: f32,
}

impl Colour {
    /// Opaque, from its hexadecimal number `0xRRGGBB`.
    #[must_use]
    pub const fn hex(number: u32) -> Self {
        let [_, red, green, blue] = number.to_be_bytes();
        Self { rgb: [red, green, blue], opacity: 1.0 }
    }

    /// The same colour, translucent.
    #[must_use]
    pub const fn with_opacity(self, opacity: f32) -> Self {
        Self { opacity, ..self }
    }

    /// Red, green, blue as shaders take them: gamma-encoded, from 0 to 1.
    #[must_use]
    pub fn channels(self) -> [f32; 3] {
        self.rgb.map(|channel| f32::from(channel) / 255.0)
    }
}

impl fmt::Display for Colour {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [red, green, blue] = self.rgb;
        write!(f, "#{red:02x}{green:02x}{blue:02x}")
    }
}

/// Titles and axes.
pub const INK: Colour = Colour::hex(0x22_2b_36);
/// Tick labels.
pub const SOFT_INK: Colour = Colour::hex(0x55_60_6e);
/// Grid lines.
pub const GRID: Colour = Colour::hex(0xe2_e6_ec);
/// Frames of heat maps, tick marks.
pub const FRAME: Colour = Colour::hex(0xa9_b2_bd);
/// Shaded intervals.
pub const SHADE: Colour = Colour::hex(0xec_f1_f8);
/// Cells without data.
pub const ABSENT: Colour = Colour::hex(0xf4_f5_f7);
/// The sheet.
pub const WHITE: Colour = Colour::hex(0xff_ff_ff);

/// One colour a series; a seventh series starts again.
#[must_use]
pub fn series(number: usize) -> Colour {
    const PALETTE: [u32; 6] = [0x00_72_b2, 0xd5_5e_00, 0x00_9e_73, 0xcc_79_a7, 0x3f_48_54, 0xe6_9f_00];
    Colour::hex(PALETTE[number % PALETTE.len()])
}

/// A map from numbers to colours.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ColourMap {
    /// Viridis from `low` to `high`: magnitudes.
    Sequential {
        /// Darkest end.
        low: f64,
        /// Brightest end.
        high: f64,
    },
    /// Viridis from zero to `high` by the square root: magnitudes of which most are small.
    Root {
        /// Brightest end.
        high: f64,
    },
    /// Warm grey over teal to deep blue: magnitudes on lit bodies, which a dark low end would turn into silhouettes.
    Pale {
        /// Palest end.
        low: f64,
        /// Deepest end.
        high: f64,
    },
    /// Blue below zero, white at zero, red above, symmetric to `bound`: signed quantities.
    Diverging {
        /// Magnitude of both ends.
        bound: f64,
    },
}

impl ColourMap {
    /// Ends of the map, ascending. A map without extent (all data equal) is widened so that it can be drawn.
    #[must_use]
    pub fn range(&self) -> [f64; 2] {
        let [low, high] = match *self {
            Self::Sequential { low, high } | Self::Pale { low, high } => [low, high],
            Self::Root { high } => [0.0, high],
            Self::Diverging { bound } => [-bound.abs(), bound.abs()],
        };
        if !(low.is_finite() && high.is_finite()) {
            [0.0, 1.0]
        } else if high > low {
            [low, high]
        } else {
            [low, low + 1.0]
        }
    }

    /// Colour of `value`; values beyond the ends take the end's colour, those that are no numbers [`ABSENT`].
    #[must_use]
    pub fn colour(&self, value: f64) -> Colour {
        if value.is_nan() {
            return ABSENT;
        }
        self.at(self.share(value).clamp(0.0, 1.0))
    }

    /// Returns where `value` lies between the ends of the colour bar, 0 to 1; beyond that outside.
    #[must_use]
    pub fn share(&self, value: f64) -> f64 {
        let [low, high] = self.range();
        let share = (value - low) / (high - low);
        if matches!(self, Self::Root { .. }) { share.max(0.0).sqrt() } else { share }
    }

    /// Colour at a place of the colour bar, 0 to 1.
    pub(crate) fn at(&self, share: f64) -> Colour {
        let colour = match self {
            Self::Sequential { .. } | Self::Root { .. } => colorous::VIRIDIS.eval_continuous(share),
            Self::Pale { .. } => return pale(share),
            Self::Diverging { .. } => colorous::RED_BLUE.eval_continuous(1.0 - share),
        };
        Colour { rgb: [colour.r, colour.g, colour.b], opacity: 1.0 }
    }
}

/// Straight lines in sRGB through five colours of evenly falling lightness.
fn pale(share: f64) -> Colour {
    const STOPS: [u32; 5] = [0xee_ea_e4, 0xb8_dd_d2, 0x5d_b5_b9, 0x2a_79_a2, 0x23_3d_7b];
    let place = share * (STOPS.len() - 1) as f64;
    let stop = (place as usize).min(STOPS.len() - 2);
    let [from, to] = [stop, stop + 1].map(|stop| Colour::hex(STOPS[stop]).rgb.map(f64::from));
    let mix = |channel: usize| (from[channel] + (place - stop as f64) * (to[channel] - from[channel])).round() as u8;
    Colour { rgb: [mix(0), mix(1), mix(2)], opacity: 1.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn luminance(colour: Colour) -> f64 {
        let [r, g, b] = colour.rgb.map(|c| (f64::from(c) / 255.0).powf(2.2));
        0.2126 * r + 0.7152 * g + 0.0722 * b
    }

    #[test]
    fn lightness_of_magnitudes_is_monotonic() {
        let map = ColourMap::Sequential { low: -1.0, high: 3.0 };
        let shades: Vec<f64> = (0..=40).map(|k| luminance(map.colour(-1.0 + 0.1 * f64::from(k)))).collect();
        assert!(shades.windows(2).all(|pair| pair[1] > pair[0]), "{shades:?}");
        let map = ColourMap::Pale { low: -1.0, high: 3.0 };
        let shades: Vec<f64> = (0..=40).map(|k| luminance(map.colour(-1.0 + 0.1 * f64::from(k)))).collect();
        assert!(shades.windows(2).all(|pair| pair[1] < pair[0]), "{shades:?}");
    }

    #[test]
    fn signs_differ_in_hue_and_zero_is_nearly_white() {
        let map = ColourMap::Diverging { bound: 2.0 };
        let [minus, zero, plus] = [-1.5, 0.0, 1.5].map(|value| map.colour(value).rgb);
        assert!(minus[2] > minus[0] && plus[0] > plus[2]);
        assert!(zero.iter().all(|&channel| channel > 230));
    }

    #[test]
    fn hostile_ranges_and_values_have_a_colour() {
        for map in [
            ColourMap::Sequential { low: f64::NAN, high: 1.0 },
            ColourMap::Sequential { low: 1.0, high: 1.0 },
            ColourMap::Diverging { bound: 0.0 },
            ColourMap::Diverging { bound: f64::INFINITY },
        ] {
            let [low, high] = map.range();
            assert!(high > low && low.is_finite() && high.is_finite());
            assert_eq!(map.colour(f64::NAN), ABSENT);
            assert_eq!(map.colour(f64::INFINITY), map.colour(high));
        }
    }
}
