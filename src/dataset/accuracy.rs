//! The error of a dataset, as its bake measured it.

use crate::{names::escaped, scene::NormUnit};
use serde::{Deserialize, Serialize};

/// Errors of the torque at random configurations, against the lowest equilibrium that is found there directly: in the
/// cells of a uniform grid that have a corner in contact, or anywhere in the range of a store. Torques are
/// [norms](crate::scene::EffortNorm) over the joints.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct MeasuredError {
    /// Random configurations, solved directly.
    pub configurations: usize,
    /// Configurations left out, because the direct solution did not converge.
    pub left_out: usize,
    /// Rms of the torque at the configurations (`unit`).
    pub torque: f64,
    /// What this torque and the errors are measured in.
    #[serde(flatten)]
    pub unit: NormUnit,
    /// Interpolation by which the dataset answers as its scene has it felt, one of those in `errors`.
    pub interpolation: String,
    /// Errors of each interpolation.
    pub errors: Vec<InterpolationError>,
    /// Share of the cells around the configurations that have a cut edge: along one the energy changes by a tenth more or
    /// less than the torques at its ends work, a tenth of the work of the rms torque (1). Absent where there are no
    /// cells.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub cut: Option<f64>,
    /// What the geometry at rest leaves out; absent where that was not solved, or not looked at.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub geometry: Option<GeometryError>,
    /// Length over which contact could be rounded, for this body and grid; absent where it nearly is, where the law does
    /// not, and where a part is too thin (m).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rounding: Option<f64>,
    /// Length over which contact is rounded; absent where it is not (m).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rounded: Option<f64>,
    /// How far friction lies above that of the contacts; absent where the scene names none, or no two touch at once.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub friction: Option<FrictionExcess>,
}

/// How a measured object relaxes, identified from recorded histories.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct IdentifiedRelaxation {
    /// Share of the force that fades, and the time in which it does (1, s).
    pub terms: Vec<[f64; 2]>,
    /// Histories that it was identified from.
    pub histories: usize,
    /// Predicted less measured torque over measured torque, rms over these (1).
    pub misfit: f64,
    /// The same over a quarter of them, predicted from the rest; absent where the samples are the histories.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub held_out: Option<f64>,
}

/// Friction of a measured object, identified from recorded strokes.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct IdentifiedFriction {
    /// Tangential over normal force while slipping; one where the strokes were those of joints, whose friction the
    /// dataset holds as normal force and slip (1).
    pub coefficient: f64,
    /// Strokes that it is the mean of.
    pub strokes: usize,
    /// Standard deviation from stroke to stroke (1).
    pub deviation: f64,
    /// Stiffness with which it builds up where the motion turns; absent where that was not identified (N/m, or N m/rad
    /// of joints).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub stiffness: Option<f64>,
    /// Torque on every fourth stroke, predicted from the others less the measured one, rms, a joint each: with friction,
    /// and without (N m or N). A joint that is predicted no better with friction has none. Empty where none was held out.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub predicted: Vec<[f64; 2]>,
}

/// Difference of contact with the surface at rest from contact with the deformed surface.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct GeometryError {
    /// Root mean square of the torques' difference (unit of the torque).
    pub rms: f64,
    /// Greatest depth of a node below the surface at rest (m).
    pub depth: f64,
}

/// What friction takes by the slip of all contacts together ([`crate::contact::Slip`]), over what it would take by each
/// contact's own, less one: at the configurations with several contacts, moving in random directions.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct FrictionExcess {
    /// Configurations with several contacts.
    pub configurations: usize,
    /// Mean (1).
    pub mean: f64,
    /// Greatest (1).
    pub greatest: f64,
}

/// Error over the rms torque above which [`MeasuredError::lines`] names the remedy (1): what grids are chosen for where
/// nothing else is said.
const TELLING_ERROR: f64 = 0.05;

/// Share of cut cells above which a large error is laid to them (1). The box of docs/interpolation.md has 0.28 on a grid of
/// 3 degrees, and 0.03 on one a hundred times finer along a joint, whose error is as large. Where contact begins within a
/// step cells are cut, too, 0.12 of the touch scene's, which errs by 0.5 %.
const TELLING_CUT: f64 = 0.01;

/// Error of one interpolation.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct InterpolationError {
    /// Name of the interpolation, as in the scene.
    pub interpolation: String,
    /// Median (unit of the torque).
    pub median: f64,
    /// 95th percentile (unit of the torque); absent in datasets of versions that did not state it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub p95: Option<f64>,
    /// Root mean square (unit of the torque).
    pub rms: f64,
    /// Greatest (unit of the torque).
    pub worst: f64,
}

impl InterpolationError {
    /// The error of `interpolation`, of which `errors` are samples (N m); zero where there are none.
    #[must_use]
    pub fn of(interpolation: &str, mut errors: Vec<f64>) -> Self {
        errors.sort_unstable_by(f64::total_cmp);
        // The sum of nothing is -0 otherwise.
        let squares = errors.iter().fold(0.0, |sum, error| sum + error * error);
        Self {
            interpolation: interpolation.to_owned(),
            median: errors.get(errors.len() / 2).copied().unwrap_or(0.0),
            p95: Some(errors.get(errors.len() * 95 / 100).copied().unwrap_or(0.0)),
            rms: (squares / errors.len().max(1) as f64).sqrt(),
            worst: errors.last().copied().unwrap_or(0.0),
        }
    }
}

impl MeasuredError {
    /// Rms error of the scene's own interpolation over the rms of the torque (1), zero where nothing touches; `None`
    /// where that interpolation was not measured.
    #[must_use]
    pub fn relative(&self) -> Option<f64> {
        let own = self.errors.iter().find(|error| error.interpolation == self.interpolation);
        own.map(|error| error.rms / self.torque.max(f64::MIN_POSITIVE))
    }

    /// Whether [`MeasuredError::relative`] is at most `aim` (1).
    #[must_use]
    pub fn keeps(&self, aim: f64) -> bool {
        self.relative().is_some_and(|error| error <= aim)
    }

    /// Errors of each interpolation in percent of the rms torque, a line each, the scene's own interpolation first, then
    /// the share of cut cells, the error of the geometry and the excess of friction.
    #[must_use]
    pub fn lines(&self) -> Vec<String> {
        if self.configurations == 0 {
            return vec!["nothing touches".to_owned()];
        }
        let mut errors: Vec<&InterpolationError> = self.errors.iter().collect();
        errors.sort_by_key(|error| error.interpolation != self.interpolation);
        let percent = |error: f64| {
            let percent = 100.0 * error / self.torque.max(f64::MIN_POSITIVE);
            if percent < 1.0 { format!("{percent:.2} %") } else { format!("{percent:.1} %") }
        };
        let line = |error: &InterpolationError| {
            let InterpolationError { interpolation, median, p95, rms, worst } = error;
            let [median, rms, worst] = [*median, *rms, *worst].map(percent);
            let p95 = p95.map_or(String::new(), |p95| format!(", 95th percentile {}", percent(p95)));
            format!("`{}` {rms} rms, median {median}{p95}, worst {worst}", escaped(interpolation))
        };
        let mut lines: Vec<String> = errors.into_iter().map(line).collect();
        if let Some(cut) = self.cut {
            let remedy = match cut > TELLING_CUT && self.relative().is_some_and(|error| error > TELLING_ERROR) {
                true => self.remedy_for_cuts(),
                false => String::new(),
            };
            let percent = 100.0 * cut;
            lines.push(format!(
                "`cut` {percent:.1} % of the cells, in which the torque leaps, or turns in a step{remedy}"
            ));
        }
        if let Some(GeometryError { rms, depth }) = self.geometry {
            let remedy = if rms > TELLING_ERROR * self.torque {
                ": law = \"following\" errs by none of that, and takes 4 to 8 times as long on a CPU"
            } else {
                ""
            };
            let depth = 1e3 * depth;
            lines.push(format!("`geometry` at rest {} rms, at depths up to {depth:.1} mm{remedy}", percent(rms)));
        }
        if let Some(FrictionExcess { configurations, mean, greatest }) = self.friction {
            let [mean, greatest] = [mean, greatest].map(|excess| 100.0 * excess);
            lines.push(format!(
                "`friction` up to {greatest:.1} % above that of the contacts, {mean:.1} % on average, where several slip \
                 ({configurations} configurations)"
            ));
        }
        lines
    }

    /// What keeps the torque from leaping within a cell, after a colon.
    fn remedy_for_cuts(&self) -> String {
        let otherwise = |what: &str| format!(": if a finer grid does not help, {what}");
        match (self.rounding, self.rounded, self.geometry) {
            (Some(length), None, _) => otherwise(&format!(
                "round = {length:.4} in [contact] rounds the body's edges, and takes some 3 times as long"
            )),
            (Some(length), Some(_), _) => {
                format!(": round = {length:.4} in [contact] is what this grid follows, or a finer grid")
            }
            (None, Some(length), _) => format!(
                ": the body's edges are rounded over {:.1} mm: give a grid whose steps move the arm by less than that",
                1e3 * length
            ),
            (None, None, Some(_)) => {
                otherwise("law = \"following\" leaps less at edges, and takes 4 to 8 times as long on a CPU")
            }
            (None, None, None) => otherwise("the body has several equilibria there, or sharp edges"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn errors_are_summed_up_and_relative_to_the_torque() {
        let error = InterpolationError::of("linear", vec![4.0, 0.0, 3.0]);
        assert_eq!((error.median, error.p95, error.worst), (3.0, Some(4.0), 4.0));
        let spread = InterpolationError::of("linear", (0..100).rev().map(f64::from).collect());
        assert_eq!(spread.p95, Some(95.0));
        assert!((error.rms - (25.0_f64 / 3.0).sqrt()).abs() < 1e-15);
        assert_eq!(InterpolationError::of("linear", Vec::new()).rms, 0.0);
        let other = InterpolationError::of("potential", vec![0.1; 3]);
        let measured = MeasuredError {
            configurations: 3,
            torque: 10.0,
            interpolation: "potential".into(),
            errors: vec![error, other],
            ..MeasuredError::default()
        };
        assert!((measured.relative().unwrap() - 0.01).abs() < 1e-15);
        assert!(measured.keeps(0.011) && !measured.keeps(0.009));
        let lines = measured.lines();
        assert_eq!(
            lines,
            [
                "`potential` 1.0 % rms, median 1.0 %, 95th percentile 1.0 %, worst 1.0 %",
                "`linear` 28.9 % rms, median 30.0 %, 95th percentile 40.0 %, worst 40.0 %"
            ]
        );
        let told =
            |rms| MeasuredError { geometry: Some(GeometryError { rms, depth: 0.0123 }), ..measured.clone() }.lines();
        assert_eq!(told(0.3)[2], "`geometry` at rest 3.0 % rms, at depths up to 12.3 mm");
        assert!(told(0.6)[2].contains("6.0 % rms") && told(0.6)[2].contains("law = \"following\""));
        let geometry = Some(GeometryError { rms: 0.1, depth: 0.01 });
        let cut = |cut, geometry, interpolation: &str| {
            let interpolation = interpolation.to_owned();
            let lines = MeasuredError { cut: Some(cut), geometry, interpolation, ..measured.clone() }.lines();
            lines.into_iter().find(|line| line.contains("`cut`")).unwrap()
        };
        let plain = "`cut` 0.4 % of the cells, in which the torque leaps, or turns in a step";
        assert_eq!(cut(0.004, geometry, "linear"), plain);
        // The remedy is for what errs: `potential` by 1 %, `linear` by 29 %.
        assert!(!cut(0.28, geometry, "potential").contains(':'));
        let told = cut(0.28, geometry, "linear");
        assert!(told.contains("28.0 %") && told.contains("law = \"following\""), "{told}");
        assert!(cut(0.28, None, "linear").contains("equilibria"));
        let thick = MeasuredError { cut: Some(0.28), geometry, rounding: Some(0.00452), ..measured.clone() };
        let told = MeasuredError { interpolation: "linear".into(), ..thick }.lines();
        assert!(
            told.iter().any(|line| line.contains("`cut`") && line.contains("round = 0.0045 in [contact]")),
            "{told:?}"
        );
        // A scene that is rounded is not sent to a law that rounds nothing.
        let round = |rounding| {
            let rounded = Some(0.002);
            let round = MeasuredError { cut: Some(0.28), geometry, rounding, rounded, ..measured.clone() };
            MeasuredError { interpolation: "linear".into(), ..round }.lines().swap_remove(2)
        };
        let [longer, finer] = [Some(0.00452), None].map(round);
        assert!(longer.contains("round = 0.0045 in [contact]") && !longer.contains("following"), "{longer}");
        assert!(finer.contains("rounded over 2.0 mm: give a grid") && !finer.contains("following"), "{finer}");
        let excess = FrictionExcess { configurations: 2, mean: 0.0123, greatest: 0.3 };
        let told = MeasuredError { friction: Some(excess), ..measured.clone() }.lines();
        assert!(told[2].contains("up to 30.0 %") && told[2].contains("1.2 % on average"), "{told:?}");
        assert_eq!(MeasuredError::default().lines(), ["nothing touches"]);
        // What was not measured is not taken for perfect.
        let unknown = MeasuredError { interpolation: "direct".into(), ..measured };
        assert!(unknown.relative().is_none() && !unknown.keeps(1.0));
    }
}
