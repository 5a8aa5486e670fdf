//! Scattered measurements of a contact torque: what a scan or an imported log hands to the gridization.

use crate::{
    Error, MAX_AXES,
    dataset::JointLabel,
    error,
    names::{self, counted},
    random::mix,
};

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

    /// Least and greatest coordinate of a joint (rad or m).
    pub(super) fn range(&self, joint: usize) -> [f64; 2] {
        let column = || self.configurations.iter().skip(joint).step_by(self.joints.len()).copied();
        [column().fold(f64::INFINITY, f64::min), column().fold(f64::NEG_INFINITY, f64::max)]
    }

    /// Whether the torques draw the arm on where those of an object push it back.
    #[must_use]
    pub fn draw_on(&self) -> bool {
        let of = |values: &[f64], joint: usize| -> Vec<f64> {
            values.iter().skip(joint).step_by(self.joints.len()).copied().collect()
        };
        let joints =
            (0..self.joints.len()).map(|joint| [&self.configurations, &self.torques].map(|all| of(all, joint)));
        let joints: Vec<_> = joints.collect();
        pull(joints.iter().map(|[positions, torques]| (&positions[..], &torques[..]))) > 0.0
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
    /// The error names the column and the sample.
    pub fn check(&self) -> Result<(), Error> {
        let joints = self.joints.len();
        if !(1..=MAX_AXES).contains(&joints) {
            return Err(error!("the measurements have {joints} joints; between 1 and {MAX_AXES} can be gridized"));
        }
        self.joints.iter().try_for_each(|joint| names::check(&joint.name)).map_err(|why| error!("a joint: {why}"))?;
        let need = self.configurations.len() / joints * joints;
        let columns = [("the configuration", Some(&self.configurations)), ("the torque", Some(&self.torques))];
        let deviation = [("the standard deviation", self.deviations.as_ref())];
        for (what, column) in columns.into_iter().chain(deviation) {
            let Some(column) = column else { continue };
            if column.len() != need {
                let have = column.len();
                return Err(error!(
                    "{what} holds {} where the configurations hold {need}: every sample needs one a joint",
                    counted(have, ["number", "numbers"])
                ));
            }
            if let Some(entry) = column.iter().position(|value| !value.is_finite()) {
                let (sample, value, joint) = (entry / joints, column[entry], &self.joints[entry % joints].name);
                return Err(error!(
                    "sample {sample} has {what} {value} at joint `{joint}`: remove it, or let the import drop rows that are \
                     not finite"
                ));
            }
        }
        Ok(())
    }
}

/// Mean over the rows of (q - mean q) tau, summed over the joints (J): negative where a torque pushes an arm back, the
/// more the farther it goes, and positive where it draws it on. Each joint has its positions (rad or m) and torques (N m
/// or N); rows without a number are left out.
pub(crate) fn pull<'a>(joints: impl Iterator<Item = (&'a [f64], &'a [f64])>) -> f64 {
    let of = |(positions, torques): (&[f64], &[f64])| {
        let rows = || positions.iter().zip(torques).filter(|(q, torque)| q.is_finite() && torque.is_finite());
        let count = rows().count().max(1) as f64;
        let mean = rows().map(|(q, _)| q).sum::<f64>() / count;
        rows().map(|(q, torque)| (q - mean) * torque).sum::<f64>() / count
    };
    joints.map(of).sum()
}
