//! Units of a log's columns, and what they are in SI.

use serde::Deserialize;

/// Unit of a column.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
pub enum ColumnUnit {
    /// Radian.
    #[serde(rename = "rad")]
    Radian,
    /// Degree.
    #[serde(rename = "deg")]
    Degree,
    /// Metre.
    #[serde(rename = "m")]
    Metre,
    /// Centimetre.
    #[serde(rename = "cm")]
    Centimetre,
    /// Millimetre.
    #[serde(rename = "mm")]
    Millimetre,
    /// Newton metre.
    #[serde(rename = "N m")]
    NewtonMetre,
    /// Newton centimetre.
    #[serde(rename = "N cm")]
    NewtonCentimetre,
    /// Newton millimetre, a thousandth of a newton metre.
    #[serde(rename = "N mm", alias = "mN m")]
    NewtonMillimetre,
    /// Newton.
    #[serde(rename = "N")]
    Newton,
    /// Millinewton.
    #[serde(rename = "mN")]
    Millinewton,
    /// Second.
    #[serde(rename = "s")]
    Second,
    /// Millisecond.
    #[serde(rename = "ms")]
    Millisecond,
    /// Microsecond.
    #[serde(rename = "us")]
    Microsecond,
}

impl ColumnUnit {
    /// Its name in a mapping.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Radian => "rad",
            Self::Degree => "deg",
            Self::Metre => "m",
            Self::Centimetre => "cm",
            Self::Millimetre => "mm",
            Self::NewtonMetre => "N m",
            Self::NewtonCentimetre => "N cm",
            Self::NewtonMillimetre => "N mm",
            Self::Newton => "N",
            Self::Millinewton => "mN",
            Self::Second => "s",
            Self::Millisecond => "ms",
            Self::Microsecond => "us",
        }
    }

    /// How many SI units one is, and which.
    #[must_use]
    pub fn in_si(self) -> (f64, &'static str) {
        match self {
            Self::Radian => (1.0, "rad"),
            Self::Degree => (std::f64::consts::PI / 180.0, "rad"),
            Self::Metre => (1.0, "m"),
            Self::Centimetre => (1e-2, "m"),
            Self::Millimetre => (1e-3, "m"),
            Self::NewtonMetre => (1.0, "N m"),
            Self::NewtonCentimetre => (1e-2, "N m"),
            Self::NewtonMillimetre => (1e-3, "N m"),
            Self::Newton => (1.0, "N"),
            Self::Millinewton => (1e-3, "N"),
            Self::Second => (1.0, "s"),
            Self::Millisecond => (1e-3, "s"),
            Self::Microsecond => (1e-6, "s"),
        }
    }
}
