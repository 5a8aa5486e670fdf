//! Scattered measurements of a contact torque: what a scan or an imported log hands to the gridization.

use crate::{MAX_AXES, dataset::JointLabel, names, random::mix};

/// Scattered configurations q with the contact torque tau measured at each.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Samples {
    /// One label a joint; their number is d.
    pub joints: Vec<JointLabel>,
    /// q, joint fastest: entry `sample * d + joint` (rad or m).
    pub configurations: Vec<f64>,
    /// Contact torque on the proxy, laid out like `configurations` (N m or N).
    pub torques: Vec<f64>,
    /// Standard deviation of each torque, laid out alike, where it was measured (N m or N).
    pub deviations: Option<Vec<f64>>,
}

/// Why measurements cannot be taken as they are.
#[derive(Debug, thiserror::Error, PartialEq, Eq)]
#[non_exhaustive]
pub enum SamplesError {
    /// No joint, or more than the engine has room for.
    #[error("the measurements have {0} joints; between 1 and {MAX_AXES} can be gridized")]
    Joints(usize),
    /// Columns of different lengths.
    #[error("{what} holds {have} numbers where the configurations hold {need}: every sample needs one a joint")]
    Length {
        /// Which column.
        what: &'static str,
        /// Its length.
        have: usize,
        /// The length of the configurations.
        need: usize,
    },
    /// A name that cannot be printed.
    #[error("a joint: {0}")]
    Name(String),
    /// NaN or an infinity.
    #[error(
        "sample {sample} has {what} {value} at joint `{joint}`: remove it, or let the import drop rows that are not \
         finite"
    )]
    NotFinite {
        /// Number of the sample, from 0.
        sample: usize,
        /// Which column.
        what: &'static str,
        /// The number, as text.
        value: String,
        /// The joint's name.
        joint: String,
    },
}

impl Samples {
    /// Number of samples.
    #[must_use]
    pub fn len(&self) -> usize {
        self.configurations.len() / self.joints.len().max(1)
    }

    /// True when nothing was measured.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.configurations.is_empty()
    }

    /// The samples in two: most, and a `share` chosen by chance, the same ones in every run.
    #[must_use]
    pub fn split(&self, share: f64) -> (Self, Self) {
        let joints = self.joints.len();
        let empty = || Self {
            joints: self.joints.clone(),
            deviations: self.deviations.as_ref().map(|_| Vec::new()),
            ..Self::default()
        };
        let (mut most, mut chosen) = (empty(), empty());
        for sample in 0..self.len() {
            let chance = (mix(sample as u64) >> 11) as f64 / (1_u64 << 53) as f64;
            let part = if chance < share { &mut chosen } else { &mut most };
            let row = sample * joints..(sample + 1) * joints;
            part.configurations.extend_from_slice(&self.configurations[row.clone()]);
            part.torques.extend_from_slice(&self.torques[row.clone()]);
            if let (Some(part), Some(all)) = (&mut part.deviations, &self.deviations) {
                part.extend_from_slice(&all[row]);
            }
        }
        (most, chosen)
    }

    /// Checks lengths and that every number is finite.
    ///
    /// # Errors
    /// [`SamplesError`] names the column and the sample.
    pub fn check(&self) -> Result<(), SamplesError> {
        let joints = self.joints.len();
        if !(1..=MAX_AXES).contains(&joints) {
            return Err(SamplesError::Joints(joints));
        }
        self.joints.iter().try_for_each(|joint| names::check(&joint.name)).map_err(SamplesError::Name)?;
        let need = self.configurations.len() / joints * joints;
        let columns = [("the configuration", Some(&self.configurations)), ("the torque", Some(&self.torques))];
        let deviation = [("the standard deviation", self.deviations.as_ref())];
        for (what, column) in columns.into_iter().chain(deviation) {
            let Some(column) = column else { continue };
            if column.len() != need {
                return Err(SamplesError::Length { what, have: column.len(), need });
            }
            if let Some(entry) = column.iter().position(|value| !value.is_finite()) {
                return Err(SamplesError::NotFinite {
                    sample: entry / joints,
                    what,
                    value: column[entry].to_string(),
                    joint: self.joints[entry % joints].name.clone(),
                });
            }
        }
        Ok(())
    }
}
