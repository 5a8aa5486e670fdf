//! The choice of what to bake for a given error: spacing, interpolation and tolerance of the solver, from a pilot.
//!
//! The pilot bakes some coarse grids over the scene's region, holds them against directly solved random configurations,
//! and measures how the error falls with the spacing: `error ~ h^p`. The spacing that is needed follows, for each
//! interpolation; the one with the fewest grid points is taken.
//!
//! *The error* is the rms of the torque's over the region, in contact or not, as in `haptize accuracy`; relative ones
//! are relative to the rms of the torque itself. Where torque jumps, the worst error is as large as the jump on any
//! grid: it is reported, and not promised.

use super::{
    BackendChoice, Bake,
    bake::{add_extras, prove},
    grid_sweep::check_given,
    reference::Reference,
    sample, spacing,
};
use crate::{
    Error,
    contact::Model,
    error,
    field::TorqueField,
    names::counted,
    scene::{ContactSpec, EffortNorm, HapticsSpec, Interpolation, NormUnit, Scene},
};
use serde::Serialize;
use std::{fmt, str::FromStr, sync::atomic::AtomicBool, time::Instant};

/// How much finer than the finest measured grid the measured order is trusted (1): two octaves, as many as it was
/// measured over. What takes more is not offered.
const FARTHEST_EXTRAPOLATION: f64 = 4.0;

/// Share of an error to stay below that the grid's spacing may have, as the measured order predicts it (1); what the
/// solver adds is independent of it and adds as squares, so that 0.6 is left for the solver and for the error of the
/// order itself.
const SPACING_SHARE: f64 = 0.8;

/// Share of an error to stay below that the contact solver's tolerance may have (1). See [`SPACING_SHARE`].
const SOLVER_SHARE: f64 = 0.05;

/// Grid points of the pilot's finest grid, at most: some seconds of solving.
const PILOT_POINTS: f64 = 10_000.0;

/// The pilot's grids, finest first, over its finest spacing: half an octave apart, as in `haptize accuracy`.
const COARSER: [f64; 4] = [1.0, std::f64::consts::SQRT_2, 2.0, 2.0 * std::f64::consts::SQRT_2];

/// Configurations in contact that the pilot asks for: an rms over so many is good to a tenth.
const CONTACTS: usize = 200;

/// Seed of the random configurations; differs from that of the configurations at which a bake measures its error.
const SEED: u64 = 0xbf58_476d_1ce4_e5b9;

/// Tolerances of the solver that are tried, roughest first (1).
const TOLERANCES: [f64; 6] = [1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8];

/// An error to stay below.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Aim {
    /// Relative to the rms of the torque over the grid's region (1).
    Relative(f64),
    /// In the unit of the norm of the arm's torque: a torque (N m), or, where all its joints slide, a force (N).
    Absolute(f64, &'static str),
}

impl Aim {
    /// The same, if it has the unit of the norm of the torque of the arm of `scene`.
    ///
    /// # Errors
    /// Where it has another.
    pub fn checked(self, scene: &Scene) -> Result<Self, Error> {
        let unit = EffortNorm::of(scene).unit;
        match self {
            Self::Absolute(_, given) if given != unit.name() => Err(error!(
                "an error in {given} was asked for, but that of this arm is measured in {unit}: give it in {}",
                unit.name()
            )),
            _ => Ok(self),
        }
    }

    /// The error to stay below over the rms `torque` (1).
    #[must_use]
    pub fn relative(self, torque: f64) -> f64 {
        match self {
            Self::Relative(share) => share,
            Self::Absolute(aim, _) => aim / torque,
        }
    }
}

impl FromStr for Aim {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let number = |digits: &str| digits.trim().parse::<f64>().ok().filter(|aim| aim.is_finite() && *aim > 0.0);
        let units = [("N m", "N m"), ("Nm", "N m"), ("N*m", "N m"), ("N", "N")];
        let absolute = units.iter().find_map(|(end, unit)| Some((text.trim().strip_suffix(end)?, *unit)));
        let percent = text.trim().strip_suffix('%');
        let aim = match (absolute, percent) {
            (Some((digits, unit)), _) => number(digits).map(|aim| Self::Absolute(aim, unit)),
            (None, Some(digits)) => {
                number(digits).map(|percent| percent / 100.0).filter(|aim| *aim < 1.0).map(Self::Relative)
            }
            (None, None) => number(text).filter(|aim| *aim < 1.0).map(Self::Relative),
        };
        aim.ok_or_else(|| {
            "give a fraction of the rms torque below 1, such as 0.01 or 1%, or a torque, such as \"0.002 N m\", or, for \
             an arm whose joints all slide, a force, such as \"0.02 N\""
                .into()
        })
    }
}

/// A grid that the pilot tried.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Trial {
    /// How it was interpolated.
    pub interpolation: &'static str,
    /// Geometric mean of its spacings (rad or m).
    pub spacing: f64,
    /// Grid points.
    pub points: usize,
    /// Rms error (the pilot's unit).
    pub rms: f64,
    /// Worst error (the pilot's unit).
    pub worst: f64,
}

/// Forecast of the pilot for one interpolation.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Prospect {
    /// As the scene names it.
    pub interpolation: &'static str,
    /// Measured order p of the error in the spacing; 0 where it does not fall, and a grid that was tried will do (1).
    pub order: f64,
    /// How many times as fine as the pilot's finest grid it must be; less than one where a coarser one does (1).
    pub finer: f64,
    /// Grid points that it then has.
    pub points: f64,
}

/// Result of a pilot.
#[derive(Clone, Debug, Serialize)]
pub struct Pilot {
    /// Rms error to stay below (`unit`).
    pub aim: f64,
    /// The same over the rms torque (1).
    pub relative: f64,
    /// Rms of the torque (`unit`).
    pub torque: f64,
    /// What torques and errors are measured in.
    #[serde(flatten)]
    pub unit: NormUnit,
    /// Random configurations, and those in contact.
    pub configurations: usize,
    /// See `configurations`.
    pub in_contact: usize,
    /// Trials.
    pub trials: Vec<Trial>,
    /// Forecasts, fewest points first; without interpolations whose error does not fall.
    pub prospects: Vec<Prospect>,
    /// Tolerance of the solver that is good enough (1).
    pub tolerance: f64,
    /// Time of the finest trial's points (s).
    pub seconds_per_point: f64,
    /// The finest trial's dataset, over its points (bytes).
    pub bytes_per_point: f64,
}

/// Cost of an error.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Cost {
    /// Rms error over the rms torque (1).
    pub relative: f64,
    /// Grid points.
    pub points: f64,
    /// See [`Prospect::finer`].
    pub finer: f64,
    /// Solving them on this machine, at the pilot's rate (s).
    pub seconds: f64,
    /// The dataset (bytes).
    pub bytes: f64,
    /// Whether the grid is no finer than errors are extrapolated to.
    pub is_known: bool,
}

/// Choice of the grid to bake.
#[derive(Clone, Debug, Serialize)]
pub struct Choice {
    /// The scene, whose text says the same.
    #[serde(skip)]
    pub scene: Scene,
    /// How it is interpolated.
    pub interpolation: &'static str,
    /// Geometric mean of the spacings (rad or m).
    pub spacing: f64,
    /// Grid points.
    pub points: usize,
    /// Tolerance of the solver (1).
    pub tolerance: f64,
    /// Time that the bake takes, at the pilot's rate (s).
    pub seconds: f64,
    /// The dataset, as large as the pilot's for each point (bytes).
    pub bytes: f64,
}

impl Pilot {
    /// Tries `scene` for `aim`, `model` being its object and its arm, without a compliance.
    ///
    /// # Errors
    /// When the scene has no grid, or a coarse one cannot be baked, or there is nothing to compare with.
    pub fn run(
        scene: &Scene,
        model: &Model<'_>,
        aim: Aim,
        backend: BackendChoice,
        stop: &AtomicBool,
    ) -> Result<Self, Error> {
        check_given(scene)?;
        let aim = aim.checked(scene)?;
        prove(scene, model.object)?;
        let mut model = model.clone();
        model.reach(&sample(scene, &model))?;
        let reference = Reference::in_contact(scene, &model, SEED, CONTACTS)?;
        let torque = reference.torque;
        let relative = aim.relative(torque);
        let aim = relative * torque;
        let tolerance = tolerance(scene, &model, &reference, SOLVER_SHARE * aim)?;
        add_extras(&mut model, scene);
        let joints = scene.grid.axes.len();
        let finest = (spacing::points(scene) as f64 / PILOT_POINTS).powf(1.0 / joints as f64).max(1.0);
        let (mut trials, mut seconds_per_point, mut bytes_per_point) = (Vec::new(), 0.0, 0.0);
        for coarser in COARSER {
            let spaced = spacing::spaced(scene, |steps| (steps / (finest * coarser)).round());
            let points = spacing::points(&spaced);
            if trials.last().is_some_and(|trial: &Trial| trial.points == points) {
                continue;
            }
            log::info!("trying a grid of {}", counted(points, ["point", "points"]));
            let start = Instant::now();
            let bake =
                Bake { scene: &spaced, backend, measured: Some(0), aim: None, date: "", stop, progress: &mut |_| () };
            let (dataset, report) = bake.tried(&model)?;
            if trials.is_empty() {
                seconds_per_point = start.elapsed().as_secs_f64() / points as f64;
                let bytes = report.forecast.map_or(report.footprint.memory.least, |forecast| forecast.disk);
                bytes_per_point = bytes as f64 / points as f64;
            }
            for interpolation in Interpolation::ALL {
                let HapticsSpec { threshold, boundary_slope, .. } = &scene.haptics;
                let field = TorqueField::interpolated(&dataset, interpolation, *threshold, boundary_slope)?;
                let (rms, worst) = reference.errors(|q| field.sample(q).torque);
                let (interpolation, spacing) = (interpolation.name(), spacing::spacing_of(&spaced));
                trials.push(Trial { interpolation, spacing, points, rms, worst });
            }
        }
        Ok(Self {
            aim,
            relative,
            torque,
            unit: reference.norm.unit,
            configurations: reference.exact.len(),
            in_contact: reference.in_contact,
            prospects: prospects(&trials, SPACING_SHARE * aim, joints),
            tolerance,
            trials,
            seconds_per_point,
            bytes_per_point,
        })
    }

    /// Returns the cost of an rms error of `relative` of the rms torque with the interpolation of `scene`, which was
    /// tried; `None` if its error does not fall.
    #[must_use]
    pub fn cost(&self, scene: &Scene, relative: f64) -> Option<Cost> {
        let all = prospects(&self.trials, SPACING_SHARE * relative * self.torque, scene.grid.axes.len());
        let Prospect { points, finer, .. } = *own(&all, scene)?;
        let (seconds, bytes) = (points * self.seconds_per_point, points * self.bytes_per_point);
        Some(Cost { relative, points, finer, seconds, bytes, is_known: finer <= FARTHEST_EXTRAPOLATION })
    }

    /// `scene`, which was tried, with a grid `finer` times as fine as the pilot's finest.
    #[must_use]
    pub fn spaced(&self, scene: &Scene, finer: f64) -> Scene {
        let finest = self.trials.first().map_or(1.0, |trial| trial.spacing);
        let coarser = finest / finer / spacing::spacing_of(scene);
        spacing::spaced(scene, |steps| (steps / coarser).ceil())
    }

    /// Chooses the fewest points, at most `limit`, with which the measured order keeps the aim.
    ///
    /// # Errors
    /// When there are none; the error says what the pilot measured, and what would help.
    pub fn choose(&self, scene: &Scene, limit: usize) -> Result<Choice, Error> {
        let within = |best: &&Prospect| best.points <= limit as f64 && best.finer <= FARTHEST_EXTRAPOLATION;
        let best = self.prospects.first();
        let Some(best) = best.filter(within) else {
            return Err(self.refused(best, limit).into());
        };
        let mut chosen = self.spaced(scene, best.finer);
        chosen.contact.tolerance = self.tolerance;
        let interpolation = Interpolation::ALL.into_iter().find(|i| i.name() == best.interpolation);
        chosen.haptics.interpolation = interpolation.unwrap_or(scene.haptics.interpolation);
        let chosen = chosen.with_own_text()?;
        let points = spacing::points(&chosen);
        Ok(Choice {
            interpolation: best.interpolation,
            spacing: spacing::spacing_of(&chosen),
            points,
            tolerance: self.tolerance,
            seconds: self.seconds_per_point * points as f64,
            bytes: self.bytes_per_point * points as f64,
            scene: chosen,
        })
    }

    /// Why no grid of at most `limit` points was chosen for the interpolation of `scene`, and what to do.
    #[must_use]
    pub fn refusal(&self, scene: &Scene, limit: usize) -> String {
        self.refused(own(&self.prospects, scene), limit)
    }

    /// Why no grid of at most `limit` points was chosen, of which `best` needs the fewest, and what to do.
    fn refused(&self, best: Option<&Prospect>, limit: usize) -> String {
        let (share, unit) = (percent(self.relative), self.unit);
        let aim = format!("an rms error of {:.2e} {unit}, {share} % of the rms torque", self.aim);
        let Some(finest) = self.trials.first() else { return format!("{aim}, is out of reach: no grid was tried") };
        let tried = self.trials.iter().filter(|trial| trial.points == finest.points);
        let tried = tried.min_by(|a, b| a.rms.total_cmp(&b.rms)).unwrap_or(finest);
        let reached = format!(
            "at {} points `{}` errs by {} %",
            tried.points,
            tried.interpolation,
            percent(tried.rms / self.torque)
        );
        let falls = match best {
            None => "and finer grids do not help".to_owned(),
            Some(best) => format!(
                "and errors fall only with the spacing to the power {:.2} (`{}`): it would take {:.1e} points, {:.1} \
                 times as fine a grid, where at most {limit} points (--max-points) and {FARTHEST_EXTRAPOLATION} times \
                 are tried",
                best.order, best.interpolation, best.points, best.finer
            ),
        };
        format!(
            "{aim}, is out of reach: {reached}, {falls}. What would help: a larger error or a grid over a smaller or \
             shallower range (deep contact has several equilibria, between which torque jumps on any grid). Nothing \
             was baked"
        )
    }
}

/// The prospect of the interpolation of `scene`.
fn own<'a>(prospects: &'a [Prospect], scene: &Scene) -> Option<&'a Prospect> {
    let own = scene.haptics.interpolation.name();
    prospects.iter().find(|prospect| prospect.interpolation == own)
}

/// `share` in percent, to two digits.
fn percent(share: f64) -> impl fmt::Display {
    let percent = 100.0 * share;
    if percent < 1.0 { format!("{percent:.2}") } else { format!("{percent:.1}") }
}

/// Returns the cost of the error `aim` for each interpolation, fewest points first; no coarser grid than the coarsest
/// that was tried.
fn prospects(trials: &[Trial], aim: f64, joints: usize) -> Vec<Prospect> {
    let of = |interpolation: Interpolation| {
        let rows = || trials.iter().filter(move |trial| trial.interpolation == interpolation.name());
        let finest = rows().next()?;
        let coarsest = rows().next_back()?;
        let order = spacing::order(rows().map(|trial| (trial.spacing, trial.rms))).filter(|order| *order > 0.0);
        let Some(order) = order else {
            // Where errors are those of rounding they do not fall; a grid that was tried and keeps the aim will do.
            let kept = rows().rev().find(|trial| trial.rms <= aim)?;
            let (finer, points) = (finest.spacing / kept.spacing, kept.points as f64);
            return Some((Prospect { interpolation: interpolation.name(), order: 0.0, finer, points }, finest.rms));
        };
        let finer = (finest.rms / aim).powf(1.0 / order).max(finest.spacing / coarsest.spacing);
        let points = finest.points as f64 * finer.powi(joints as i32);
        Some((Prospect { interpolation: interpolation.name(), order, finer, points }, finest.rms))
    };
    let mut prospects: Vec<(Prospect, f64)> = Interpolation::ALL.into_iter().filter_map(of).collect();
    prospects.sort_by(|(a, a_rms), (b, b_rms)| a.points.total_cmp(&b.points).then(a_rms.total_cmp(b_rms)));
    prospects.into_iter().map(|(prospect, _)| prospect).collect()
}

/// The roughest tolerance of the solver that adds no more than `error` to the error; the scene's own where none does.
fn tolerance(scene: &Scene, model: &Model<'_>, reference: &Reference, error: f64) -> Result<f64, Error> {
    for tolerance in TOLERANCES {
        let contact = ContactSpec { tolerance, ..scene.contact };
        if reference.error_of(model, contact)? <= error {
            return Ok(tolerance);
        }
    }
    Ok(scene.contact.tolerance)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A torque that every grid reproduces to rounding: its errors do not fall, and the coarsest grid will do.
    #[test]
    fn errors_of_rounding_are_no_reason_to_refuse_an_aim() {
        let trial = |spacing: f64, points, rms| Trial { interpolation: "potential", spacing, points, rms, worst: rms };
        let trials = [trial(0.1, 65, 3e-17), trial(0.2, 33, 1e-17), trial(0.4, 17, 2e-17)];
        let found = prospects(&trials, 0.05, 1);
        assert_eq!(
            found.iter().map(|found| (found.interpolation, found.points)).collect::<Vec<_>>(),
            [("potential", 17.0)]
        );
        assert!((found[0].finer - 0.25).abs() < 1e-12, "{found:?}");
        // Errors beyond the aim that do not fall give none.
        let trials = trials.map(|trial| Trial { rms: trial.rms + 0.1, ..trial });
        assert_eq!(prospects(&trials, 0.05, 1), []);
    }
}
