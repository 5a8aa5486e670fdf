//! `[graphics]`: the graphics loop and its effects.

use super::check::Checker;
use super::value::{KEY, Range, positive, vector};
use super::{Material, ObjectSpec};
use crate::Error;
use glam::DVec3;
use serde::de::{Deserialize, Deserializer, Error as _, MapAccess, Visitor, value::MapAccessDeserializer};

/// Lowest frame rate (Hz): motion is no longer seen long before.
const LOWEST_RATE: f64 = 1.0;
/// Highest frame rate (Hz).
const HIGHEST_RATE: f64 = 1e4;
/// Default frame rate (Hz).
const RATE: f64 = 60.0;

/// Greatest factor of stiffening: what the integrator takes beyond the springs' own energy grows with it.
const MOST_STIFFENING: f64 = 100.0;

/// The graphics loop (section 3.2).
#[derive(Clone, Copy, Debug, PartialEq, serde::Deserialize)]
#[serde(from = "GraphicsTable")]
pub struct GraphicsSpec {
    /// Frames per second (Hz).
    pub rate: f64,
    /// Effects beyond the paper's.
    pub effects: GraphicsEffects,
}

/// Effects of the graphics loop: each absent unless the scene names it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct GraphicsEffects {
    /// Acceleration of gravity on the object's nodes (m/s^2).
    pub gravity: Option<DVec3>,
    /// Springs stiffen with strain.
    pub stiffening: Option<StiffeningSpec>,
    /// Time constant of a low-pass filter on the contact forces that move the object (s).
    pub smoothing: Option<f64>,
    /// The object has no dynamics: n = n0 + C f.
    pub quasi_static: bool,
}

impl GraphicsEffects {
    /// The key of the first effect that the scene names.
    #[must_use]
    pub fn named(&self) -> Option<&'static str> {
        [
            ("gravity", self.gravity.is_some()),
            ("stiffening", self.stiffening.is_some()),
            ("smoothing", self.smoothing.is_some()),
            ("quasi_static", self.quasi_static),
        ]
        .into_iter()
        .find_map(|(key, is_named)| is_named.then_some(key))
    }
}

/// How springs stiffen with strain.
#[derive(Clone, Copy, Debug, PartialEq, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StiffeningSpec {
    /// Stiffness at large strains over that at rest, kappa; more than 1 (1).
    #[serde(deserialize_with = "stiffening_factor")]
    pub factor: f64,
    /// Strain around which it rises, eps (1).
    #[serde(deserialize_with = "positive")]
    pub strain: f64,
}

impl Default for GraphicsSpec {
    fn default() -> Self {
        Self { rate: RATE, effects: GraphicsEffects::default() }
    }
}

impl GraphicsSpec {
    /// Checks it against the virtual object, which the effects act on, where the scene has one.
    pub(super) fn check(&self, checker: &Checker<'_>, object: Option<&ObjectSpec>) -> Result<(), Error> {
        let Some(object) = object else {
            return self.effects.named().map_or(Ok(()), |key| {
                let message = format!("{key} acts on the virtual object, and the scene has none: leave it out");
                Err(checker.at(&format!("graphics.{key}"), message))
            });
        };
        if self.effects.stiffening.is_none() {
            return Ok(());
        }
        if self.effects.quasi_static {
            let message = "stiffening cannot act where quasi_static graphics solves with one constant stiffness: leave \
                           out one of them";
            return Err(checker.at("graphics.stiffening", message));
        }
        if matches!(object.material, Material::Elastic(_)) || object.skin.is_some() {
            let message =
                "stiffening acts on springs alone, and the object is an elastic solid or has a skin: leave it out";
            return Err(checker.at("graphics.stiffening", message));
        }
        Ok(())
    }
}

/// `[graphics]` as it is written.
#[derive(serde::Deserialize)]
#[serde(deny_unknown_fields)]
struct GraphicsTable {
    #[serde(default = "rate", deserialize_with = "frame_rate")]
    rate: f64,
    #[serde(default, deserialize_with = "gravity")]
    gravity: Option<DVec3>,
    stiffening: Option<StiffeningSpec>,
    #[serde(default, deserialize_with = "positive")]
    smoothing: Option<f64>,
    #[serde(default)]
    quasi_static: bool,
}

impl From<GraphicsTable> for GraphicsSpec {
    fn from(table: GraphicsTable) -> Self {
        let GraphicsTable { rate, gravity, stiffening, smoothing, quasi_static } = table;
        Self { rate, effects: GraphicsEffects { gravity, stiffening, smoothing, quasi_static } }
    }
}

fn rate() -> f64 {
    RATE
}

fn frame_rate<'de, D: Deserializer<'de>>(value: D) -> Result<f64, D::Error> {
    Range::Within(LOWEST_RATE, HIGHEST_RATE).number(value)
}

fn stiffening_factor<'de, D: Deserializer<'de>>(value: D) -> Result<f64, D::Error> {
    Range::Between(1.0, MOST_STIFFENING).number(value)
}

fn gravity<'de, D: Deserializer<'de>>(value: D) -> Result<Option<DVec3>, D::Error> {
    let gravity: DVec3 = vector(value)?;
    if gravity == DVec3::ZERO {
        let what = format!("{KEY}is zero: give a direction and a size in m/s^2, or leave it out");
        return Err(D::Error::custom(what));
    }
    Ok(Some(gravity))
}

/// The graphics loop, or `false` for none.
pub(super) enum GraphicsEntry {
    Off,
    Loop(GraphicsSpec),
}

impl<'de> Deserialize<'de> for GraphicsEntry {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct FalseOrTable;

        impl<'de> Visitor<'de> for FalseOrTable {
            type Value = GraphicsEntry;

            fn expecting(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
                f.write_str("the table [graphics], or false")
            }

            fn visit_bool<E: serde::de::Error>(self, value: bool) -> Result<GraphicsEntry, E> {
                if value {
                    return Err(E::invalid_value(serde::de::Unexpected::Bool(true), &self));
                }
                Ok(GraphicsEntry::Off)
            }

            fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<GraphicsEntry, A::Error> {
                GraphicsSpec::deserialize(MapAccessDeserializer::new(map)).map(GraphicsEntry::Loop)
            }
        }

        deserializer.deserialize_any(FalseOrTable)
    }
}
