//! The cost of accuracy in time: one table of settings of a scene, each with its error against directly solved
//! configurations and its time.
//!
//! The reference is equation (2) in the energy form, in f64, with the geometry that follows the deformation, solved to
//! [`REFERENCE_TOLERANCE`](crate::sweep::REFERENCE_TOLERANCE) at random configurations of the scene's grid that no
//! dataset holds. Its own error is how much it moves when it is asked for a hundredth of that. Errors are
//! [norms](crate::scene::EffortNorm) over the joints. `rms` is over all configurations, in contact or not, and is set
//! beside the rms of the reference torque itself. Errors are deterministic. Time is the least of some runs, because the
//! work is the same in each and a busy machine only adds to it, over that of the scene as it is, with which all
//! settings of a study take turns.

mod choice;
mod grids;
mod live;
mod report;
mod settings;

pub use choice::{Limit, Offer, limits, offers};
pub use live::LIVE;
pub use report::{FILES, write_all};

use crate::{
    Error,
    names::duration,
    proxy::Chain,
    scene::{ContactLaw, JointKind, NormUnit, Scene},
    sweep::{
        build_object, model_within,
        reference::{Reference, equilibria},
        spacing,
    },
};
use serde::Serialize;
use settings::Variant;
use std::time::Instant;

/// Seed of the reference's configurations.
const SEED: u64 = 0x9e37_79b9_7f4a_7c15;

/// The quantity that is varied.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Study {
    /// Grid spacing and interpolation; cost is the bake.
    Spacing,
    /// Interpolation; cost is a look-up, or live the share of a solve that falls to a tick, and the tangent.
    Lookup,
    /// Tolerance of the contact solver; cost is a configuration.
    Tolerance,
    /// How contact is solved; cost is a configuration.
    Law,
    /// Mean edge of the object's mesh; cost is a configuration.
    Mesh,
    /// Spacing of contact nodes along links; cost is a configuration.
    Links,
    /// Bending stiffness of the skin; cost is a configuration.
    Skin,
    /// Contact compliance; cost is a configuration.
    Stiffness,
}

/// One setting and what it gave.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Row {
    /// The quantity that is varied.
    pub study: Study,
    /// Curve that it belongs to.
    pub series: String,
    /// The setting, with its unit.
    pub setting: String,
    /// The setting as a number: a spacing (rad or m), a tolerance, or a factor on the scene's
    /// own value.
    pub value: f64,
    /// Grid points, or nodes of the object.
    pub points: usize,
    /// Grid points in contact that were solved: a free one costs a distance, however the grid is made. 0 in other
    /// studies.
    pub solved: usize,
    /// Size of the dataset; 0 where there is none (bytes).
    pub bytes: usize,
    /// Time over that of the scene's own bake, of a look-up by `linear`, or of a configuration of the scene as it is.
    pub cost: f64,
    /// Root mean square of the error (the study's `norm`). Of mesh, nodes, skin and contact compliance: distance from
    /// the next row.
    pub rms: f64,
    /// Greatest error (the study's `norm`).
    pub worst: f64,
}

/// All that was measured.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Accuracy {
    /// Name of the scene.
    pub scene: String,
    /// Runs that were timed.
    pub rounds: usize,
    /// Configurations of the reference.
    pub configurations: usize,
    /// Number of these in contact.
    pub in_contact: usize,
    /// Left out, because the reference itself did not converge there.
    pub left_out: usize,
    /// What torques and errors are measured in.
    pub norm: NormUnit,
    /// Root mean square of the reference torque (`norm`).
    pub torque: f64,
    /// Error of the reference itself, rms (`norm`).
    pub reference_error: f64,
    /// Joints.
    pub joints: usize,
    /// Interpolation that the scene names.
    pub interpolation: &'static str,
    /// Points of the scene's own grid.
    pub points: usize,
    /// Unit of spacings: `rad`, `m`, or `rad, m` where joints of both kinds mix.
    pub unit: &'static str,
    /// Time of a look-up by `linear`, to which those of the others are relative (s).
    pub look_up: f64,
    /// Time of an equilibrium in contact along a way, solved warm with its tangent (s).
    pub solution: f64,
    /// Study by study.
    pub rows: Vec<Row>,
    /// Measurements that could not be made here, and why.
    pub notes: Vec<String>,
}

/// How much is measured.
#[derive(Clone, Copy, Debug)]
pub struct Extent {
    /// Random configurations.
    pub configurations: usize,
    /// Grids with more points than this are left out.
    pub points: usize,
    /// Runs that are timed, at least 1: of five, one is hardly ever without interruption.
    pub rounds: usize,
}

/// Measures `scene`. `progress` receives the name of the next step.
///
/// # Errors
/// Any [`Error`].
pub fn measure(scene: &Scene, extent: Extent, progress: &mut dyn FnMut(&str)) -> Result<Accuracy, Error> {
    let begun = Instant::now();
    let object = build_object(scene)?;
    let chain = Chain::new(&scene.proxy);
    let model = model_within(scene, &object, &chain)?;
    let build = begun.elapsed().as_secs_f64();
    progress("reference");
    let reference = Reference::solve(scene, &model, SEED, extent.configurations)?;
    let (following, reference_error) = timed(|| reference.own_error(scene, &model))?;
    let (own, _) = timed(|| equilibria(&model, scene.contact, &reference.places))?;
    let mut study = Accuracy {
        scene: scene.name.clone(),
        rounds: extent.rounds,
        configurations: reference.exact.len(),
        in_contact: reference.in_contact,
        left_out: reference.left_out,
        norm: reference.norm.unit,
        torque: reference.torque,
        reference_error,
        joints: chain.joints.len(),
        interpolation: scene.haptics.interpolation.name(),
        points: spacing::points(scene),
        unit: unit(scene),
        look_up: 0.0,
        solution: 0.0,
        rows: Vec::new(),
        notes: Vec::new(),
    };
    let grids = grids::spacings(scene, extent.points, &mut study);
    let variants = settings::variants(scene, &mut study)?;
    let times = Times { build, own, following, configurations: reference.exact.len() };
    progress(&format!("the studies take about {}", duration(times.forecast(extent.rounds, scene, &grids, &variants))));
    progress("grid spacing and interpolation");
    let own = grids::spacing(&grids, &reference, &mut study)?;
    progress("look-up and live contact");
    grids::look_up(scene, &own, &mut study)?;
    live::live(scene, &model, &reference, &mut study);
    progress("contact solver, mesh, contact nodes, skin, contact stiffness");
    for (varied, variants) in &variants {
        settings::compare(scene, *varied, variants, &reference, &mut study)?;
    }
    Ok(study)
}

/// Times that were taken with the reference, and tell those of the studies (s).
struct Times {
    /// Building the scene's object and its model.
    build: f64,
    /// Solving all `configurations` as the scene does.
    own: f64,
    /// The same by the law that follows, to the reference's tolerance.
    following: f64,
    configurations: usize,
}

impl Times {
    /// Time of the studies, where other bodies take as long to build as the scene's own, and points of a grid as long to
    /// solve as random configurations (s).
    fn forecast(&self, rounds: usize, own: &Scene, grids: &[Scene], variants: &[(Study, Vec<Variant>)]) -> f64 {
        let rounds = rounds as f64;
        let solved = |scene: &Scene| match scene.contact.law {
            ContactLaw::Following => self.following,
            ContactLaw::Rest => self.own,
        };
        let point = self.own / self.configurations as f64;
        let bakes: f64 = grids.iter().map(|grid| rounds * (self.build + point * spacing::points(grid) as f64)).sum();
        let scenes =
            variants.iter().flat_map(|(_, variants)| variants.iter().map(|variant| &variant.scene).chain([own]));
        bakes + scenes.map(|scene| self.build + rounds * solved(scene)).sum::<f64>()
    }
}

/// Unit of the scene's joints.
fn unit(scene: &Scene) -> &'static str {
    let prismatic = scene.proxy.joints.iter().filter(|joint| joint.kind == JointKind::Prismatic).count();
    match prismatic {
        0 => "rad",
        all if all == scene.proxy.joints.len() => "m",
        _ => "rad, m",
    }
}

/// Time of `work` (s) and its result.
fn timed<T, E>(work: impl FnOnce() -> Result<T, E>) -> Result<(f64, T), E> {
    let start = Instant::now();
    work().map(|result| (start.elapsed().as_secs_f64(), result))
}

/// Least time of `rounds` runs, at least one, of each of `count` kinds of work (s), and the last result. They take
/// turns, to and fro: what else a busy machine does falls on all alike.
fn in_turns<T, E>(
    rounds: usize,
    count: usize,
    mut work: impl FnMut(usize) -> Result<T, E>,
) -> Result<Vec<(f64, T)>, E> {
    let mut run = |kind: usize| timed(|| work(kind));
    let mut least: Vec<(f64, T)> = (0..count).map(&mut run).collect::<Result<_, E>>()?;
    for round in 1..rounds {
        for step in 0..count {
            let kind = if round % 2 == 0 { step } else { count - 1 - step };
            let (seconds, result) = run(kind)?;
            least[kind] = (least[kind].0.min(seconds), result);
        }
    }
    Ok(least)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_studies_take_their_grids_and_variants_as_often_as_they_are_timed() {
        let scene = Scene::parse(include_str!("../../../tests/scenes/small.toml"), "small.toml").unwrap();
        let by = |law| {
            let mut scene = scene.clone();
            scene.contact = scene.contact.by(law);
            scene
        };
        let variant = |law| Variant { scene: by(law), series: "", setting: String::new(), value: 1.0 };
        let times = Times { build: 3.0, own: 5.0, following: 70.0, configurations: 10 };
        let variants = [(Study::Law, vec![variant(ContactLaw::Following), variant(ContactLaw::Rest)])];
        let grid = 3.0 + 0.5 * spacing::points(&scene) as f64;
        let own = by(ContactLaw::Rest);
        // Both laws and the scene's own, built once.
        let forecast = |rounds, grids: &[Scene]| times.forecast(rounds, &own, grids, &variants);
        assert!((forecast(1, &[]) - (9.0 + 80.0)).abs() < 1e-9);
        assert!((forecast(2, &[own.clone(), own.clone()]) - (9.0 + 160.0 + 4.0 * grid)).abs() < 1e-9);
    }
}
