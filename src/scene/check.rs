//! Checks on single values of a scene file; each failure names the key, the value, the range and the place.

use super::error::{Diagnostic, SceneError};
use super::file::{Number, PerJoint, Vector};
use super::value::KEY;
use super::{JointKind, JointSpec, ProxySpec};
use crate::JointVector;
use glam::DVec3;
use serde::de::DeserializeOwned;
use std::ops::Range;
use std::path::Path;
use toml::{
    Spanned,
    de::{DeTable, DeValue},
};

/// Largest size of any number: far beyond every physical quantity in SI units that a scene may hold, and its powers
/// that the engine forms are still finite.
const LARGEST: f64 = 1e12;

/// The text that is being checked.
pub(super) struct Checker<'a> {
    pub path: &'a Path,
    pub text: &'a str,
}

impl Checker<'_> {
    /// An error at `span`.
    pub fn error(&self, span: Range<usize>, message: impl Into<String>) -> SceneError {
        Diagnostic::new(self.path, self.text, span, message).into()
    }

    /// Reads the text.
    ///
    /// # Errors
    /// At the value that cannot be read.
    pub fn read<T: DeserializeOwned>(&self) -> Result<T, SceneError> {
        toml::from_str(self.text).map_err(|error| {
            let span = error.span().unwrap_or(0..0);
            let message = match error.message().strip_prefix(KEY) {
                Some(rest) => {
                    let root = DeTable::parse(self.text).ok();
                    let key = root.as_ref().and_then(|root| key_at(root.get_ref(), span.start));
                    format!("{} {rest}", key.unwrap_or("the value"))
                }
                None => error.message().to_owned(),
            };
            self.error(span, message)
        })
    }

    /// An error at what `path` names, keys and numbers of entries with dots between, or at the table around it that the
    /// text has.
    pub fn at(&self, path: &str, message: impl Into<String>) -> SceneError {
        self.error(self.place(path), message)
    }

    fn place(&self, path: &str) -> Range<usize> {
        let Ok(root) = DeTable::parse(self.text) else { return 0..0 };
        let mut place = 0..0;
        let root = DeValue::Table(root.into_inner());
        let mut value = &root;
        for part in path.split('.') {
            let inner = part.parse::<usize>().map_or_else(|_| value.get(part), |number| value.get(number));
            let Some(inner) = inner else { break };
            (place, value) = (inner.span(), inner.get_ref());
        }
        place
    }

    /// Checks that the arm has a contact node of the number that stands at `path`.
    pub fn node(&self, path: &str, node: Option<usize>, proxy: &ProxySpec) -> Result<(), SceneError> {
        let nodes: usize = proxy.joints.iter().map(|joint| joint.nodes.len()).sum();
        match node {
            Some(node) if node >= nodes => {
                Err(self
                    .at(path, format!("node is {node}: it must be less than {nodes}, the contact nodes of the arm")))
            }
            _ => Ok(()),
        }
    }

    /// Brings `list`, which stands at `path` in the text, to one number per joint: one number is that of all joints, and
    /// where the text has none, `default` tells it by the kind of joint. Where the chain mixes kinds of joint, a single
    /// number has no one unit and is refused.
    pub fn fit(
        &self,
        path: &str,
        list: &mut JointVector,
        joints: &[JointSpec],
        default: impl Fn(JointKind) -> f64,
    ) -> Result<(), SceneError> {
        let key = path.rsplit('.').next().unwrap_or(path);
        let (found, needed) = (list.len(), joints.len());
        let mut fitted = JointVector::zeros(needed);
        if found == 0 {
            fitted.iter_mut().zip(joints).for_each(|(entry, joint)| *entry = default(joint.kind));
        } else if found == needed {
            return Ok(());
        } else if found > 1 || self.text[self.place(path)].starts_with('[') {
            return Err(self.at(path, format!("{key} lists {found} numbers for {needed} joints")));
        } else if joints.iter().any(|joint| joint.kind != joints[0].kind) {
            let message = format!(
                "{key} needs a list of {needed} numbers, one per joint: its unit differs between revolute and \
                 prismatic joints"
            );
            return Err(self.at(path, message));
        } else {
            fitted.fill(list[0]);
        }
        *list = fitted;
        Ok(())
    }

    /// A number in the range that `allowed` accepts and `range` puts in words.
    fn number(&self, key: &str, value: &Number, range: &str, allowed: impl Fn(f64) -> bool) -> Result<f64, SceneError> {
        self.value(key, *value.get_ref(), value.span(), range, allowed)
    }

    fn value(
        &self,
        key: &str,
        value: f64,
        span: Range<usize>,
        range: &str,
        allowed: impl Fn(f64) -> bool,
    ) -> Result<f64, SceneError> {
        if value.abs() <= LARGEST && allowed(value) {
            return Ok(value);
        }
        let reason = if value.is_finite() && value.abs() > LARGEST {
            format!("{key} is {value:e}: no quantity in SI units is larger than {LARGEST:.0e} here; check its unit")
        } else {
            format!("{key} is {value}: it must be {range}")
        };
        Err(self.error(span, reason))
    }

    pub fn positive(&self, key: &str, value: &Number) -> Result<f64, SceneError> {
        self.number(key, value, "positive", |x| x > 0.0)
    }

    pub fn not_negative(&self, key: &str, value: &Number) -> Result<f64, SceneError> {
        self.number(key, value, "zero or positive", |x| x >= 0.0)
    }

    pub fn finite(&self, key: &str, value: &Number) -> Result<f64, SceneError> {
        self.number(key, value, "a finite number", |_| true)
    }

    /// A number strictly between `least` and `greatest`.
    pub fn between(&self, key: &str, value: &Number, least: f64, greatest: f64) -> Result<f64, SceneError> {
        self.number(key, value, &format!("between {least} and {greatest}"), |x| x > least && x < greatest)
    }

    /// A number from `least` to `greatest`, both included.
    pub fn within(&self, key: &str, value: &Number, least: f64, greatest: f64) -> Result<f64, SceneError> {
        self.number(key, value, &format!("between {least} and {greatest}"), |x| x >= least && x <= greatest)
    }

    /// Finite numbers.
    pub fn all_finite(&self, key: &str, values: &[f64], span: Range<usize>) -> Result<(), SceneError> {
        values.iter().try_for_each(|x| self.value(key, *x, span.clone(), "finite numbers", |_| true).map(|_| ()))
    }

    /// A point or direction, zero where it is not given.
    pub fn vector(&self, key: &str, value: Option<&Vector>) -> Result<DVec3, SceneError> {
        let Some(value) = value else { return Ok(DVec3::ZERO) };
        self.all_finite(key, value.get_ref(), value.span())?;
        Ok(DVec3::from_array(*value.get_ref()))
    }

    /// A whole number of at least `least`, and at most `greatest`.
    pub fn count(&self, key: &str, value: &Spanned<usize>, least: usize, greatest: usize) -> Result<usize, SceneError> {
        let count = *value.get_ref();
        if (least..=greatest).contains(&count) {
            return Ok(count);
        }
        Err(self.error(value.span(), format!("{key} is {count}: it must be at least {least} and at most {greatest}")))
    }

    /// One number per joint, zero or positive, or positive if `strictly`; from `default`, by kind of joint, where the
    /// key is not given. Where the chain mixes kinds of joint a single number has no one unit and is refused.
    pub fn per_joint(
        &self,
        key: &str,
        value: Option<&Spanned<PerJoint>>,
        joints: &[JointSpec],
        strictly: bool,
        default: impl Fn(JointKind) -> f64,
    ) -> Result<JointVector, SceneError> {
        let mut vector = JointVector::zeros(joints.len());
        let Some(value) = value else {
            for (entry, joint) in vector.iter_mut().zip(joints) {
                *entry = default(joint.kind);
            }
            return Ok(vector);
        };
        match value.get_ref() {
            PerJoint::Same(number) => {
                if joints.iter().any(|joint| joint.kind != joints[0].kind) {
                    let message = format!(
                        "{key} needs a list of {} numbers, one per joint: its unit differs between revolute and \
                         prismatic joints",
                        joints.len()
                    );
                    return Err(self.error(value.span(), message));
                }
                vector.fill(*number);
            }
            PerJoint::Each(numbers) if numbers.len() == joints.len() => vector.copy_from_slice(numbers),
            PerJoint::Each(numbers) => {
                let message = format!("{key} lists {} numbers for {} joints", numbers.len(), joints.len());
                return Err(self.error(value.span(), message));
            }
        }
        let range = if strictly { "positive" } else { "zero or positive" };
        for entry in vector.iter() {
            self.value(key, *entry, value.span(), range, |x| x > 0.0 || (x == 0.0 && !strictly))?;
        }
        Ok(vector)
    }
}

/// The key in `table` of the value at a byte of the text.
fn key_at<'a>(table: &'a DeTable<'_>, at: usize) -> Option<&'a str> {
    table.iter().find_map(|(key, value)| {
        let inside = match value.get_ref() {
            DeValue::Table(inner) => return key_at(inner, at),
            DeValue::Array(list) => list.iter().find_map(|entry| key_at(entry.get_ref().as_table()?, at)),
            _ => None,
        };
        inside.or_else(|| value.span().contains(&at).then_some(key.get_ref().as_ref()))
    })
}
