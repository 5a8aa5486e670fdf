//! `[contact]`: equation (2) and how it is solved.

use super::ProxySpec;
use super::check::Checker;
use super::value::{KEY, Range, defaults, positive, share};
use crate::Error;
use clap::ValueEnum;
use serde::de::{Deserialize, Deserializer, Error as _, IgnoredAny};

/// Names that are those of no law any more, and what to do about it; datasets of them are still felt.
const FORMER_LAWS: [(&str, &str); 2] = [
    (
        "linearised",
        "the law \"linearised\" was removed: its torque was not the gradient of its energy. Take law = \"rest\", or leave \
         it out",
    ),
    ("paper", "a scene cannot name the paper's iteration: only `haptize paper` solves by it. Leave law out"),
];

/// Keys that name the law of contact: the last two in former scenes.
pub(super) const LAW_KEYS: [&str; 3] = ["law", "geometry", "algorithm"];

/// Equation (2) and how it is solved.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ContactSpec {
    /// Contact stiffness: of one spring Kc between a proxy node and an object node; the energy form's stiffness at a
    /// contact point is kc = 3 Kc (three nodes of a triangle). Infinity is rigid contact. Where the scene gives a
    /// stiffness per length instead, that of a node that stands for the mean length; [`ContactSpec::node_stiffness`]
    /// gives each node's own (N/m).
    pub stiffness: f64,
    /// Contact stiffness of a link per length of it, in the energy form, where the scene gives that (N/m^2).
    pub stiffness_per_length: Option<f64>,
    /// How equation (2) is solved.
    pub law: ContactLaw,
    /// Relative residual at which a configuration counts as converged (1).
    pub tolerance: f64,
    /// After as many a configuration that has not converged is flagged.
    pub max_iterations: u32,
    /// Which surface the proxy feels.
    pub surface: ContactSurface,
    /// Length over which the law at rest rounds that surface; none leaves its edges sharp (m).
    pub round: Option<f64>,
}

/// `[contact]` as it is written.
#[derive(serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct ContactTable {
    #[serde(default, deserialize_with = "number_or_rigid")]
    stiffness: f64,
    #[serde(default, deserialize_with = "positive")]
    stiffness_per_length: Option<f64>,
    /// What to do where it is one that was removed.
    #[serde(default, deserialize_with = "law")]
    law: Option<Result<ContactLaw, &'static str>>,
    /// The law in former scenes.
    #[serde(default, deserialize_with = "law")]
    geometry: Option<Result<ContactLaw, &'static str>>,
    /// The law in scenes before those.
    #[serde(default, deserialize_with = "law")]
    algorithm: Option<Result<ContactLaw, &'static str>>,
    #[serde(default = "tolerance", deserialize_with = "share")]
    tolerance: f64,
    #[serde(default = "max_iterations", deserialize_with = "at_least_one")]
    max_iterations: u32,
    #[serde(default)]
    surface: ContactSurface,
    #[serde(default, deserialize_with = "positive")]
    round: Option<f64>,
    /// Of a law that was removed.
    updates: Option<IgnoredAny>,
}

/// Which surface of a mesh the proxy feels.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum ContactSurface {
    /// The triangles.
    Facets,
    /// A smooth surface through the mesh's nodes: the limit of Loop's subdivision.
    #[default]
    Smooth,
}

impl ContactSpec {
    /// Returns Kc of a node that stands for `length` of a link (m), in (N/m): with a stiffness per length k' the third
    /// part of k' times the length, so that the contact point's kc = 3 Kc is k' times the length, and the whole link's
    /// does not depend on the number of its nodes.
    #[must_use]
    pub fn node_stiffness(&self, length: f64) -> f64 {
        match self.stiffness_per_length {
            Some(per_length) if length > 0.0 => per_length * length / 3.0,
            _ => self.stiffness,
        }
    }

    /// The same contact by `law`. Only contact at rest is rounded.
    #[must_use]
    pub fn by(self, law: ContactLaw) -> Self {
        Self { law, round: self.round.filter(|_| law == ContactLaw::Rest), ..self }
    }

    /// The same over [`ContactSpec::stiffness`] (1).
    #[must_use]
    pub fn share(&self, length: f64) -> f64 {
        if self.stiffness_per_length.is_some() { self.node_stiffness(length) / self.stiffness } else { 1.0 }
    }
}

/// How equation (2) is solved for one configuration.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default, clap::ValueEnum)]
pub enum ContactLaw {
    /// Depth and direction are measured from the undeformed surface. The energy's minimum is a convex problem: fast, and
    /// with one solution.
    #[default]
    Rest,
    /// Depth and direction are measured from the deformed surface: right for deep contact, and 4 to 8 times slower.
    #[value(alias = "energy")]
    Following,
}

impl ContactLaw {
    /// As a scene and a dataset's provenance name it.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Rest => "rest",
            Self::Following => "following",
        }
    }
}

defaults! {
    /// Default relative residual of the contact solver, in the energy norm (1). Forces are promised to balance K u to
    /// 1e-6 of the largest, node by node, which a residual of 1e-6 misses by a third; the last steps converge fast, so
    /// two digits more cost 8 % more iterations on the sphere (5.1 to 5.5).
    tolerance: f64 = 1e-8;
    /// Default cap on the contact solver's iterations (1).
    max_iterations: u32 = 400;
}

fn at_least_one<'de, D: Deserializer<'de>>(value: D) -> Result<u32, D::Error> {
    match u32::deserialize(value)? {
        0 => Err(D::Error::custom(format!("{KEY}is 0: it must be at least 1"))),
        count => Ok(count),
    }
}

/// Reads the law of contact, by its name; the remedy for one of [`FORMER_LAWS`].
fn law<'de, D: Deserializer<'de>>(value: D) -> Result<Option<Result<ContactLaw, &'static str>>, D::Error> {
    let name = String::deserialize(value)?;
    if let Ok(law) = ContactLaw::from_str(&name, false) {
        return Ok(Some(Ok(law)));
    }
    if let Some((_, remedy)) = FORMER_LAWS.into_iter().find(|(former, _)| *former == name) {
        return Ok(Some(Err(remedy)));
    }
    let names: Vec<String> = ContactLaw::value_variants().iter().map(|known| format!("`{}`", known.name())).collect();
    Err(D::Error::custom(format!("unknown law of contact {name:?}: take one of {}", names.join(", "))))
}

/// Reads a stiffness: a positive number, or `"rigid"` for infinity.
fn number_or_rigid<'de, D: Deserializer<'de>>(value: D) -> Result<f64, D::Error> {
    Range::Positive.number_or("rigid", value)
}

impl ContactTable {
    /// Checks it against the arm, and gives the surface and the stiffness that it leaves out.
    pub fn check(self, checker: &Checker<'_>, proxy: &ProxySpec) -> Result<ContactSpec, Error> {
        let nodes = || proxy.links().into_iter().flat_map(|(_, joint)| &joint.nodes);
        let error = |key: &str, message: &str| Err(checker.at(&format!("contact.{key}"), message));
        if self.updates.is_some() {
            return error("updates", "updates applied to the law \"linearised\", which no longer exists: leave it out");
        }
        let named = LAW_KEYS.into_iter().zip([self.law, self.geometry, self.algorithm]);
        let mut named = named.filter_map(|(key, law)| Some((key, law?)));
        let law = match named.next() {
            None => ContactLaw::default(),
            Some((key, law)) => law.map_err(|remedy| checker.at(&format!("contact.{key}"), remedy))?,
        };
        if let Some((former, _)) = named.next() {
            return error(former, "the law of contact is named twice: keep `law`, and leave this key out");
        }
        let Self { mut stiffness, stiffness_per_length, tolerance, max_iterations, surface, round, .. } = self;
        match (stiffness > 0.0, stiffness_per_length) {
            (true, None) => {}
            (true, Some(_)) => {
                let message = "contact has a stiffness of each node and one per length: leave out one of them";
                return error("stiffness", message);
            }
            (false, Some(_)) if nodes().any(|node| node.length == 0.0) => {
                let message = "stiffness_per_length is of nodes along links, and the proxy has nodes { at = .. } \
                               besides: give stiffness [N/m] of each node instead";
                return error("stiffness_per_length", message);
            }
            (false, Some(per_length)) => {
                let length: f64 = nodes().map(|node| node.length).sum();
                stiffness = per_length * (length / nodes().count() as f64) / 3.0;
            }
            (false, None) => {
                let message = "contact has no stiffness: add stiffness [N/m] of each node, or \"rigid\", or \
                               stiffness_per_length [N/m^2] of links";
                return error("stiffness", message);
            }
        }
        if surface == ContactSurface::Facets && nodes().any(|node| node.radius > 0.0) {
            let message = "nodes with a radius do not balance where the closest triangle changes: leave surface out, and \
                           they touch the smooth surface";
            return error("surface", message);
        }
        if round.is_some() && law != ContactLaw::Rest {
            let message = "only contact at rest is rounded: leave round out, or law";
            return error("round", message);
        }
        Ok(ContactSpec { stiffness, stiffness_per_length, law, tolerance, max_iterations, surface, round })
    }
}
