//! `[object.relaxation]`: how the object's force fades while it is held.

use super::check::Checker;
use super::value::{Range, positive};
use crate::Error;
use serde::Deserialize;

/// Most terms of a relaxation (1): two fit ten seconds of real tissue to 2 %.
pub const MOST_TERMS: usize = 4;

/// Linear viscoelasticity: after a step the share `1 - sum g_i (1 - exp(-t / theta_i))` of the force is left.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RelaxationSpec {
    /// Share g_i of the force that fades, in sum below one, and the time theta_i in which it does (1, s).
    pub terms: Vec<[f64; 2]>,
    /// Way over which an arm that slides leaves its dent and meets fresh material: a dent of the same forces so far beside
    /// has 1/e of the energy in common with it; under a single point it is 1/e as deep there. Without, what was under
    /// the arm stays there (m).
    #[serde(deserialize_with = "positive", default)]
    pub dent: Option<f64>,
}

impl RelaxationSpec {
    /// Checks it.
    pub(super) fn check(self, checker: &Checker<'_>) -> Result<Self, Error> {
        self.check_terms(checker, "object.relaxation.terms")?;
        Ok(self)
    }

    /// Checks its terms, which stand at `key`.
    pub(super) fn check_terms(&self, checker: &Checker<'_>, key: &str) -> Result<(), Error> {
        let at = |message: String| Err(checker.at(key, message));
        if self.terms.is_empty() || self.terms.len() > MOST_TERMS {
            return at(format!("terms lists {} terms: it must list 1 to {MOST_TERMS}", self.terms.len()));
        }
        for [share, time] in &self.terms {
            if !(Range::Between(0.0, 1.0).holds(*share) && Range::Positive.holds(*time)) {
                let message = "a term is a share between 0 and 1 and a positive time in seconds";
                return at(format!("terms has [{share}, {time}]: {message}"));
            }
        }
        let sum: f64 = self.terms.iter().map(|[share, _]| share).sum();
        if sum >= 1.0 {
            return at(format!(
                "the shares of terms sum to {sum:.3}: their sum must be less than 1, or a dent would never recover"
            ));
        }
        Ok(())
    }
}
