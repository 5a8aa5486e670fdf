//! Values of a scene file that are checked while they are read: each failure names the key, the value and the range,
//! and the reader of the file adds the place.

use crate::{JointVector, MAX_JOINTS, names::counted};
use glam::{DQuat, DVec3, EulerRot};
use serde::Deserialize;
use serde::de::{DeserializeSeed, Deserializer, Error, SeqAccess, Unexpected, Visitor};
use std::fmt;

/// Stands for the key of the value at the head of a message.
pub(super) const KEY: &str = "{key} ";

/// Functions that tell serde the values of keys that are not given.
macro_rules! defaults {
    ($($(#[$doc:meta])* $key:ident: $kind:ty = $value:expr;)*) => {
        $($(#[$doc])* fn $key() -> $kind { $value })*
    };
}

pub(super) use defaults;

/// The rotation by angles about x, then y, then z (rad).
pub(crate) fn rotation(turn: DVec3) -> DQuat {
    DQuat::from_euler(EulerRot::ZYX, turn.z, turn.y, turn.x)
}

/// Largest size of any number: far beyond every physical quantity in SI units that a scene may hold, and its powers
/// that the engine forms are still finite.
const LARGEST: f64 = 1e12;

/// Which numbers are taken.
#[derive(Clone, Copy)]
pub(super) enum Range {
    Finite,
    Positive,
    NotNegative,
    /// Without the ends.
    Between(f64, f64),
    /// With the ends.
    Within(f64, f64),
}

impl fmt::Display for Range {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Finite => f.write_str("a finite number"),
            Self::Positive => f.write_str("positive"),
            Self::NotNegative => f.write_str("zero or positive"),
            Self::Between(least, greatest) | Self::Within(least, greatest) => {
                write!(f, "between {least} and {greatest}")
            }
        }
    }
}

impl Range {
    /// Whether `x` is in it.
    pub fn holds(self, x: f64) -> bool {
        x.abs() <= LARGEST
            && match self {
                Self::Finite => true,
                Self::Positive => x > 0.0,
                Self::NotNegative => x >= 0.0,
                Self::Between(least, greatest) => least < x && x < greatest,
                Self::Within(least, greatest) => least <= x && x <= greatest,
            }
    }

    fn check<E: Error>(self, x: f64) -> Result<f64, E> {
        if self.holds(x) {
            return Ok(x);
        }
        if x.is_finite() && x.abs() > LARGEST {
            let why = "no quantity in SI units is larger than";
            return Err(E::custom(format!("{KEY}is {x:e}: {why} {LARGEST:.0e} here; check its unit")));
        }
        Err(E::custom(format!("{KEY}is {x}: it must be {self}")))
    }

    /// Reads a number.
    pub fn number<'de, T: From<f64>, D: Deserializer<'de>>(self, value: D) -> Result<T, D::Error> {
        self.deserialize(value).map(T::from)
    }

    /// Reads a number, or `word` for infinity.
    pub fn number_or<'de, D: Deserializer<'de>>(self, word: &'static str, value: D) -> Result<f64, D::Error> {
        value.deserialize_any(Number { range: self, or_infinite: Some(word) })
    }

    /// Reads a list of numbers.
    pub fn list<'de, D: Deserializer<'de>>(self, value: D) -> Result<Vec<f64>, D::Error> {
        value.deserialize_any(List { range: self, or_one: false })
    }

    /// Reads a list of `N` numbers.
    pub fn array<'de, const N: usize, D: Deserializer<'de>>(self, value: D) -> Result<[f64; N], D::Error> {
        let wrong = |list: Vec<f64>| {
            D::Error::custom(format!("{KEY}has {}: it needs {N}", counted(list.len(), ["number", "numbers"])))
        };
        self.list(value)?.try_into().map_err(wrong)
    }

    /// Reads a list of as many numbers as an arm or a device may have joints.
    pub fn joints<'de, T: From<JointVector>, D: Deserializer<'de>>(self, value: D) -> Result<T, D::Error> {
        joint_vector(&self.list(value)?).map(T::from)
    }

    /// Reads one number for all joints, or a list with one for each; [`super::check::Checker::fit`] gives the one to
    /// all.
    pub fn per_joint<'de, D: Deserializer<'de>>(self, value: D) -> Result<JointVector, D::Error> {
        joint_vector(&value.deserialize_any(List { range: self, or_one: true })?)
    }
}

fn joint_vector<E: Error>(list: &[f64]) -> Result<JointVector, E> {
    if list.is_empty() || list.len() > MAX_JOINTS {
        return Err(E::custom(format!("{KEY}has {} numbers: it needs 1 to {MAX_JOINTS}", list.len())));
    }
    Ok(JointVector::from_slice(list))
}

impl<'de> DeserializeSeed<'de> for Range {
    type Value = f64;

    fn deserialize<D: Deserializer<'de>>(self, value: D) -> Result<f64, D::Error> {
        value.deserialize_any(Number { range: self, or_infinite: None })
    }
}

/// A number, or a word that stands for infinity.
struct Number {
    range: Range,
    or_infinite: Option<&'static str>,
}

impl Visitor<'_> for Number {
    type Value = f64;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a number")?;
        self.or_infinite.map_or(Ok(()), |word| write!(f, " or {word:?}"))
    }

    fn visit_f64<E: Error>(self, value: f64) -> Result<f64, E> {
        self.range.check(value)
    }

    fn visit_i64<E: Error>(self, value: i64) -> Result<f64, E> {
        self.range.check(value as f64)
    }

    fn visit_str<E: Error>(self, value: &str) -> Result<f64, E> {
        if self.or_infinite == Some(value) {
            return Ok(f64::INFINITY);
        }
        Err(E::invalid_type(Unexpected::Str(value), &self))
    }
}

/// A list of numbers, or one number instead.
struct List {
    range: Range,
    or_one: bool,
}

impl<'de> Visitor<'de> for List {
    type Value = Vec<f64>;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(if self.or_one { "a number, or a list of one number per joint" } else { "a list of numbers" })
    }

    fn visit_f64<E: Error>(self, value: f64) -> Result<Vec<f64>, E> {
        if !self.or_one {
            return Err(E::invalid_type(Unexpected::Float(value), &self));
        }
        Ok(vec![self.range.check(value)?])
    }

    fn visit_i64<E: Error>(self, value: i64) -> Result<Vec<f64>, E> {
        self.visit_f64(value as f64)
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut list: A) -> Result<Vec<f64>, A::Error> {
        std::iter::from_fn(|| list.next_element_seed(self.range).transpose()).collect()
    }
}

pub(super) fn finite<'de, T: From<f64>, D: Deserializer<'de>>(value: D) -> Result<T, D::Error> {
    Range::Finite.number(value)
}

pub(super) fn positive<'de, T: From<f64>, D: Deserializer<'de>>(value: D) -> Result<T, D::Error> {
    Range::Positive.number(value)
}

pub(super) fn not_negative<'de, T: From<f64>, D: Deserializer<'de>>(value: D) -> Result<T, D::Error> {
    Range::NotNegative.number(value)
}

/// Reads a number between zero and one.
pub(super) fn share<'de, T: From<f64>, D: Deserializer<'de>>(value: D) -> Result<T, D::Error> {
    Range::Between(0.0, 1.0).number(value)
}

/// Reads one positive number for all joints, or one each.
pub(super) fn positive_gains<'de, D: Deserializer<'de>>(value: D) -> Result<JointVector, D::Error> {
    Range::Positive.per_joint(value)
}

/// Reads one number, zero or positive, for all joints, or one each.
pub(super) fn gains<'de, D: Deserializer<'de>>(value: D) -> Result<JointVector, D::Error> {
    Range::NotNegative.per_joint(value)
}

/// Reads coordinates of joints, or of a device.
pub(super) fn coordinates<'de, T: From<JointVector>, D: Deserializer<'de>>(value: D) -> Result<T, D::Error> {
    Range::Finite.joints(value)
}

/// Reads a point or a vector.
pub(super) fn vector<'de, T: From<DVec3>, D: Deserializer<'de>>(value: D) -> Result<T, D::Error> {
    Range::Finite.array(value).map(|list| DVec3::from_array(list).into())
}

/// Reads a direction of any length but zero as a unit vector.
pub(super) fn direction<'de, D: Deserializer<'de>>(value: D) -> Result<DVec3, D::Error> {
    let vector: DVec3 = vector(value)?;
    vector.try_normalize().ok_or_else(|| D::Error::custom(format!("{KEY}is zero: it must have a direction")))
}

/// Reads the lengths of three edges.
pub(super) fn edges<'de, T: From<DVec3>, D: Deserializer<'de>>(value: D) -> Result<T, D::Error> {
    Range::Positive.array(value).map(|list| DVec3::from_array(list).into())
}

/// Reads two numbers, the first less than the second.
pub(super) fn interval<'de, D: Deserializer<'de>>(value: D) -> Result<[f64; 2], D::Error> {
    let [least, greatest] = Range::Finite.array(value)?;
    if least >= greatest {
        let what = format!("{KEY}is [{least}, {greatest}]: the first must be less than the second");
        return Err(D::Error::custom(what));
    }
    Ok([least, greatest])
}

/// Reads a whole number from `LEAST` to `GREATEST`.
pub(super) fn count<'de, const LEAST: usize, const GREATEST: usize, T: From<usize>, D: Deserializer<'de>>(
    value: D,
) -> Result<T, D::Error> {
    let count = usize::deserialize(value)?;
    if !(LEAST..=GREATEST).contains(&count) {
        let what = format!("{KEY}is {count}: it must be at least {LEAST} and at most {GREATEST}");
        return Err(D::Error::custom(what));
    }
    Ok(count.into())
}
