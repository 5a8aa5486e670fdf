//! The cost of accuracy in time: work-precision diagrams of one scene against directly solved configurations.
//!
//! The reference is equation (2) in the energy form, in f64, with the geometry that follows the deformation, solved to
//! [`REFERENCE_TOLERANCE`](crate::sweep::REFERENCE_TOLERANCE) at random configurations of the scene's grid that no
//! dataset holds. Its own error is how much it moves when it is asked for a hundredth of that. Errors are Euclidean
//! norms over the joints; a prismatic joint counts with the lever arm of 0.1 m, so that all are N m. `rms` is over all
//! configurations, in contact or not, and is set beside the rms of the reference torque itself. Accuracy is
//! deterministic. Time is given as the ratio to one row of the same study: the least of some runs, because the work is
//! the same in each and a busy machine only adds to it; median and greatest show by how much.

mod choice;
mod direct;
mod dynamics;
pub mod effects;
mod figures;
mod grids;
mod page;
mod refinement;
mod solver;

pub use choice::{Limit, Offer, limits, offers};
pub use page::{FILES, describe, write_all};

use crate::{
    contact::Model,
    device::MotionError,
    field::FieldError,
    gpu::FrameError,
    object::ObjectError,
    proxy::Chain,
    render::{graphics::GraphicsError, session::SessionError, setup::SetupError},
    scene::{JointKind, Scene, SceneError},
    sweep::{BackendError, BakeError, ReferenceError, build_object, reference::Reference, sample, spacing},
};
use serde::Serialize;
use std::time::Instant;

/// Seed of the reference's configurations.
const SEED: u64 = 0x9e37_79b9_7f4a_7c15;

/// The quantity that is varied.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Study {
    /// Grid spacing and interpolation; cost is the bake.
    Spacing,
    /// Tolerance of the contact solver; cost is a configuration.
    Tolerance,
    /// How contact is solved; cost is a configuration.
    Algorithm,
    /// f64 and f32 on the GPU against the CPU; cost is a configuration.
    Arithmetic,
    /// Mean edge of the object's mesh; cost is a configuration.
    Mesh,
    /// Spacing of contact nodes along links; cost is a configuration.
    Links,
    /// Bending stiffness of the skin; cost is a configuration.
    Skin,
    /// Contact compliance; cost is a configuration.
    Stiffness,
    /// Interpolation; cost is a look-up, or with `direct` the share of a solve that falls to a tick, and the tangent.
    Lookup,
    /// Frame step of the graphics; cost is the same simulated time.
    Frame,
    /// Iterations of the graphics solver on the GPU; cost is a frame.
    Iterations,
}

/// Ratio of times, with the spread of the runs.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Cost {
    /// Median of the runs (1).
    pub median: f64,
    /// (1)
    pub least: f64,
    /// (1)
    pub greatest: f64,
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
    /// The setting as a number, where it is one.
    pub value: f64,
    /// Grid points (spacing), nodes or iterations on average; 0 where there are none.
    pub points: usize,
    /// Grid points in contact that were solved: a free one costs a distance, however the grid is made. 0 in other
    /// studies.
    pub solved: usize,
    /// Size of the dataset; 0 where there is none (bytes).
    pub bytes: usize,
    /// Time, relative to the least of the study's baseline.
    pub cost: Cost,
    /// Unit of the errors: N m, or m and J for graphics.
    pub unit: &'static str,
    /// Root mean square of the error, in that unit.
    pub rms: f64,
    /// Greatest error.
    pub worst: f64,
    /// Root mean square of the reference itself: what errors are relative to.
    pub size: f64,
}

/// Work around loops of one size.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Loops {
    /// Interpolation.
    pub series: String,
    /// Side of the square loop (rad or m).
    pub side: f64,
    /// Root mean square of the work around the loop (J).
    pub work: f64,
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
    /// Root mean square of the reference torque (N m).
    pub torque: f64,
    /// Error of the reference itself, rms (N m).
    pub reference_error: f64,
    /// Joints.
    pub joints: usize,
    /// Interpolation that the scene names.
    pub interpolation: &'static str,
    /// Points of the scene's own grid.
    pub points: usize,
    /// Unit of spacings: `rad`, `m`, or `rad, m` where joints of both kinds mix.
    pub unit: &'static str,
    /// Greatest energy of the scene's own dataset (J).
    pub greatest_energy: f64,
    /// Time of a look-up by `linear`, to which those of the others are relative (s).
    pub look_up: f64,
    /// Time of an equilibrium in contact along a way, solved warm with its tangent (s).
    pub solution: f64,
    /// Study by study.
    pub rows: Vec<Row>,
    /// Work around loops in the scene's own dataset.
    pub loops: Vec<Loops>,
    /// Measurements that could not be made here, and why.
    pub notes: Vec<String>,
    /// Costs of the effects, if they were priced ([`effects::price`]).
    pub effects: Option<effects::Effects>,
}

/// How much is measured.
#[derive(Clone, Copy, Debug)]
pub struct Extent {
    /// Random configurations.
    pub configurations: usize,
    /// Grids with more points than this are left out.
    pub points: usize,
    /// Runs that are timed, at least 1: of five, one is hardly ever without interruption, and the median shows how
    /// usual that is.
    pub rounds: usize,
}

/// The study failed.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum AccuracyError {
    /// The object cannot be built.
    #[error(transparent)]
    Object(#[from] ObjectError),
    /// No backend.
    #[error(transparent)]
    Backend(#[from] BackendError),
    /// A grid cannot be haptized.
    #[error(transparent)]
    Bake(#[from] BakeError),
    /// A dataset cannot be interpolated.
    #[error(transparent)]
    Field(#[from] FieldError),
    /// The object cannot be moved.
    #[error(transparent)]
    Graphics(#[from] GraphicsError),
    /// A variant of the scene is none.
    #[error(transparent)]
    Scene(#[from] SceneError),
    /// A dataset cannot be rendered.
    #[error(transparent)]
    Setup(#[from] SetupError),
    /// The scene's motion cannot be followed.
    #[error(transparent)]
    Motion(#[from] MotionError),
    /// The loop cannot run.
    #[error(transparent)]
    Session(#[from] SessionError),
    /// The object cannot be moved on the GPU.
    #[error(transparent)]
    Frame(#[from] FrameError),
    /// Nothing to compare with.
    #[error(transparent)]
    Reference(#[from] ReferenceError),
}

/// Measures `scene`. `progress` receives the name of the next step.
///
/// # Errors
/// Any [`AccuracyError`].
pub fn measure(scene: &Scene, extent: Extent, progress: &mut dyn FnMut(&str)) -> Result<Accuracy, AccuracyError> {
    let object = build_object(scene).map_err(BakeError::from)?;
    let chain = Chain::new(&scene.proxy);
    let model = Model::reaching(&object, &chain, scene.contact, &sample(scene))?;
    progress("reference");
    let reference = Reference::solve(scene, &model, SEED, extent.configurations)?;
    let mut study = Accuracy {
        scene: scene.name.clone(),
        rounds: extent.rounds,
        configurations: reference.exact.len(),
        in_contact: reference.in_contact,
        left_out: reference.left_out,
        torque: reference.torque,
        reference_error: reference.error,
        joints: chain.joints.len(),
        interpolation: scene.haptics.interpolation.name(),
        points: spacing::points(scene),
        unit: unit(scene),
        greatest_energy: 0.0,
        look_up: 0.0,
        solution: 0.0,
        rows: Vec::new(),
        loops: Vec::new(),
        notes: Vec::new(),
        effects: None,
    };
    progress("grid spacing and interpolation");
    let own = grids::spacing(scene, &reference, extent.points, &mut study)?;
    study.greatest_energy = own.summary().max_energy.unwrap_or(0.0);
    progress("look-up, direct and loops");
    grids::look_up(scene, &own, &mut study)?;
    direct::followed(scene, &model, &reference, &mut study)?;
    grids::loops(scene, &own, &reference, &mut study)?;
    progress("contact solver");
    solver::settings(scene, &model, &reference, &mut study)?;
    solver::arithmetic(&model, &reference, &mut study)?;
    progress("mesh, contact nodes, skin, contact stiffness");
    refinement::studies(scene, &reference, &mut study)?;
    progress("graphics");
    dynamics::graphics(scene, &object, &own, &mut study)?;
    Ok(study)
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

/// Median time of `rounds` runs of `work`, with least and greatest (s), and the last result.
fn timed<T, E>(rounds: usize, mut work: impl FnMut() -> Result<T, E>) -> Result<(Cost, T), E> {
    let mut run = || {
        let start = Instant::now();
        work().map(|result| (start.elapsed().as_secs_f64(), result))
    };
    let (first, mut result) = run()?;
    let mut seconds = vec![first];
    for _ in 1..rounds {
        let (again, same) = run()?;
        seconds.push(again);
        result = same;
    }
    Ok((Cost::of(&seconds), result))
}

impl Cost {
    /// Median and spread of `runs`.
    fn of(runs: &[f64]) -> Self {
        let mut runs = runs.to_vec();
        runs.sort_unstable_by(f64::total_cmp);
        match runs[..] {
            [least, .., greatest] => Self { median: runs[runs.len() / 2], least, greatest },
            [only] => Self { median: only, least: only, greatest: only },
            [] => Self::default(),
        }
    }

    /// Relative to `baseline` (s).
    fn over(self, baseline: f64) -> Self {
        let baseline = baseline.max(f64::MIN_POSITIVE);
        Self { median: self.median / baseline, least: self.least / baseline, greatest: self.greatest / baseline }
    }
}

/// Returns `text` as it stands between tags.
fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;")
}
