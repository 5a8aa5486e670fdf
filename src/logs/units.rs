//! Units of a log's columns, and what they are in SI.

use serde::{Deserialize, Deserializer, de::Error};

/// Unit of a column.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ColumnUnit {
    /// Its name in a mapping.
    pub name: &'static str,
    /// How many SI units one is (1).
    pub factor: f64,
    /// Which SI unit that is: `rad`, `m`, `N m`, `N` or `s`.
    pub si: &'static str,
    /// How logs write it, in small letters without blanks, dots and stars.
    spellings: &'static str,
}

const fn unit(name: &'static str, factor: f64, si: &'static str, spellings: &'static str) -> ColumnUnit {
    ColumnUnit { name, factor, si, spellings }
}

const UNITS: [ColumnUnit; 13] = [
    unit("rad", 1.0, "rad", "rad"),
    unit("deg", std::f64::consts::PI / 180.0, "rad", "deg degree degrees °"),
    unit("m", 1.0, "m", "m"),
    unit("cm", 1e-2, "m", "cm"),
    unit("mm", 1e-3, "m", "mm"),
    unit("N m", 1.0, "N m", "nm"),
    unit("N cm", 1e-2, "N m", "ncm"),
    unit("N mm", 1e-3, "N m", "nmm mnm"),
    unit("N", 1.0, "N", "n"),
    unit("mN", 1e-3, "N", "mn"),
    unit("s", 1.0, "s", "s sec seconds"),
    unit("ms", 1e-3, "s", "ms"),
    unit("us", 1e-6, "s", "us µs"),
];

impl ColumnUnit {
    /// The unit that a mapping calls `name`.
    #[must_use]
    pub fn named(name: &str) -> Option<Self> {
        let name = if name == "mN m" { "N mm" } else { name };
        UNITS.into_iter().find(|unit| unit.name == name)
    }

    /// The unit that a log writes as `text`.
    pub(super) fn spelt(text: &str) -> Option<Self> {
        let text: String = text.chars().filter(|c| !matches!(c, ' ' | '.' | '*' | '·' | '-')).collect();
        let text = text.to_lowercase();
        UNITS.into_iter().find(|unit| unit.spellings.split(' ').any(|spelling| spelling == text))
    }
}

impl<'de> Deserialize<'de> for ColumnUnit {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let name = String::deserialize(deserializer)?;
        let known = || UNITS.map(|unit| format!("`{}`", unit.name)).join(", ");
        let unknown = || Error::custom(format!("unknown variant `{name}`, expected one of {}", known()));
        Self::named(&name).ok_or_else(unknown)
    }
}
