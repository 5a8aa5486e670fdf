//! Uniform gridization (section 2.3): scattered torques become a dataset over a uniform grid in C-space.
//!
//! Every number of joints has the same interpolation, linear on the simplices of a Delaunay triangulation, which is
//! what the paper's TriScatteredInterp and SciPy's LinearNDInterpolator compute: exact for torques linear in q,
//! continuous, bounded by the measured values, and *absent* outside the convex hull of the samples
//! ([`Status::Outside`]) and, inside it, far from all of them: a hull spans hollows that nobody measured. One joint: a sorted line. Two: `spade`. Three: tetrahedra of our own on exact predicates.
//! Four to six: the simplices of the grid points alone (see `hyperspace`). Natural neighbours in two joints, where
//! asked.
//!
//! The contact index of a grid point is the paper's (section 3.1): contact where the torque exceeds epsilon.

mod barycentric;
mod cells;
mod cloud;
mod energy;
mod friction;
mod golden;
mod hyperspace;
mod interpolant;
mod line;
mod memory;
mod normal;
mod order;
mod plane;
pub mod prediction;
mod relaxation;
mod samples;
mod smooth;
mod tetrahedra;

pub use cells::{Branches, CellReport, Cells, LeadDirection};
pub use energy::with_energy;
pub use friction::{Reversals, gridize_sliding};
pub use memory::{ForceHistory, Past, gridize_remembering, predict_histories};
pub use samples::Samples;
pub(crate) use samples::pull;

use crate::{
    Error, MAX_AXES,
    contact::Status,
    dataset::{Axis, Dataset, Grid, Provenance},
    error,
    names::counted,
    scene::GRID_LINE,
};
use cloud::{Cloud, JITTER, Position, distance_squared};
use hyperspace::Hyperspace;
use interpolant::{Linear, Triangulation};
use line::Line;
use plane::Plane;
use rayon::prelude::*;
use tetrahedra::Tetrahedra;

/// Fraction by which a position just outside the hull is pulled towards its centre: 100 times the jitter, so that a
/// grid point on a hull facet is found as long as the hull is thicker than about 1/50 of its extent there.
const HULL_PULL: f64 = 100.0 * JITTER;

/// [`HULL_PULL`] for 4 to 6 joints.
const HYPER_PULL: f64 = 100.0 * hyperspace::HYPER_JITTER;

/// Most grid points of one gridization: 2.4 GB of torque for three joints.
const GRID_POINTS: f64 = 1e8;

/// Contact threshold in standard deviations of the samples: noise alone exceeds three once in 370 samples.
const CONTACT_DEVIATIONS: f64 = 3.0;

/// Contact threshold as a fraction of the greatest torque where no deviation was measured.
const CONTACT_FRACTION: f64 = 0.01;

/// Distance from the samples at which a torque is taken for unknown, in their spacings (1): beyond half the diagonal of a
/// cube of samples, sqrt(6)/2 = 1.22 with six joints, so that a regular scan has no holes.
pub const WITHIN: f64 = 1.5;

/// How scattered torques are interpolated.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, clap::ValueEnum)]
pub enum Interpolation {
    /// Linear on Delaunay simplices, 1 to 6 joints.
    #[default]
    Linear,
    /// Natural neighbours (Sibson), 2 joints.
    Natural,
}

/// Options of the grid.
#[derive(Clone, Debug)]
pub struct GridizeOptions {
    /// Grid step of each joint (rad or m); one number serves all joints.
    pub steps: Vec<f64>,
    /// Contact where the norm of the torque exceeds this, epsilon of section 3.1 (N m). Absent: three times the median
    /// standard deviation of the samples, or a hundredth of the greatest torque where none was measured.
    pub epsilon: Option<f64>,
    /// How torques are interpolated.
    pub interpolation: Interpolation,
    /// Smooth torques within their measured standard deviation first.
    pub smooth: bool,
    /// Distance from the nearest of its samples up to which a grid point has a torque, in spacings of the samples (1);
    /// infinite: the convex hull alone ends the measured region. [`WITHIN`] is a good choice. It is the diagonal of a grid
    /// cell at least.
    pub within: f64,
}

impl GridizeOptions {
    /// A grid of these `steps` (rad or m): torques interpolated linearly and not smoothed, the threshold from the samples,
    /// the region that of [`WITHIN`].
    #[must_use]
    pub fn new(steps: Vec<f64>) -> Self {
        Self { steps, epsilon: None, interpolation: Interpolation::Linear, smooth: false, within: WITHIN }
    }
}

/// Report of a gridization.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct GridizeReport {
    /// Samples given.
    pub samples: usize,
    /// Samples averaged into others at the same configuration.
    pub merged: usize,
    /// Grid points in all.
    pub points: usize,
    /// Grid points that have a torque.
    pub inside: usize,
    /// Grid points inside the convex hull that are too far from any sample.
    pub far: usize,
    /// Spacing of the samples: the distance to the nearest ones that together lead along all joints, median over the
    /// samples; for each joint how far that is along it (rad or m).
    pub spacing: Vec<f64>,
    /// Distance from the samples up to which grid points have a torque, likewise; absent where the hull alone ends them.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub distance: Vec<f64>,
    /// Grid points in contact.
    pub contact_points: usize,
    /// Torque threshold used (N m).
    pub epsilon: f64,
}

/// Interpolates `samples` on a uniform grid whose lines lie at multiples of the step, within the samples' range.
///
/// The dataset holds torque and status: no energy, gap, contact forces or surface, which nobody measured. Torque is
/// zero where the status is [`Status::Outside`].
///
/// # Errors
/// When samples are not finite, too few, flat in C-space, or a grid that is empty or too large.
pub fn gridize(samples: &Samples, options: &GridizeOptions) -> Result<(Dataset, GridizeReport), Error> {
    samples.check()?;
    let epsilon = options.epsilon.unwrap_or_else(|| default_epsilon(samples));
    if !(epsilon.is_finite() && epsilon >= 0.0) {
        return Err(error!("torque threshold {epsilon} is not a number of zero or more"));
    }
    if options.within.is_nan() || options.within <= 0.0 {
        return Err(error!("a distance of {} spacings from the samples is not a positive number", options.within));
    }
    let mut cloud = Cloud::new(samples)?;
    if options.smooth {
        smooth::smooth(&mut cloud)?;
    }
    let grid = grid(samples, &options.steps)?;
    let spacing = cloud.spacing();
    // Cells of the grid in which a sample lies stay whole, however coarse they are.
    let diagonal = cloud.length(&grid.axes.iter().map(|axis| axis.step).collect::<Vec<_>>());
    let reach = diagonal.max(options.within * spacing);
    let (mut torque, distances) = match (options.interpolation, cloud.joints) {
        (Interpolation::Natural, 2) => {
            let plane = Plane::new(&cloud)?;
            fill(|| plane.natural_neighbours(), &cloud, &grid)
        }
        (Interpolation::Natural, joints) => {
            return Err(error!(
                "natural neighbour interpolation takes 2 joints, the samples have {joints}: use linear interpolation"
            ));
        }
        (Interpolation::Linear, 1) => fill_linear(Line::new(&cloud), HULL_PULL, &cloud, &grid),
        (Interpolation::Linear, 2) => fill_linear(Plane::new(&cloud)?, HULL_PULL, &cloud, &grid),
        (Interpolation::Linear, 3) => fill_linear(Tetrahedra::new(&cloud)?, HULL_PULL, &cloud, &grid),
        _ => fill_linear(Hyperspace::new(&cloud), HYPER_PULL, &cloud, &grid),
    };
    let is_inside = |distance: f64| distance.is_finite();
    let is_known = |distance: f64| is_inside(distance) && distance <= reach;
    let status: Vec<u8> = torque
        .chunks_exact_mut(cloud.joints)
        .zip(&distances)
        .map(|(torque, distance)| {
            if !is_known(*distance) {
                torque.fill(0.0);
                Status::Outside as u8
            } else if torque.iter().map(|t| t * t).sum::<f64>().sqrt() > epsilon {
                Status::Contact as u8
            } else {
                Status::Free as u8
            }
        })
        .collect();
    let report = GridizeReport {
        samples: samples.len(),
        merged: cloud.merged,
        points: status.len(),
        inside: status.iter().filter(|status| **status != Status::Outside as u8).count(),
        far: distances.iter().filter(|distance| is_inside(**distance) && !is_known(**distance)).count(),
        spacing: cloud.unscaled(spacing),
        distance: if reach.is_finite() { cloud.unscaled(reach) } else { Vec::new() },
        contact_points: status.iter().filter(|status| **status == Status::Contact as u8).count(),
        epsilon,
    };
    let algorithm = match options.interpolation {
        Interpolation::Linear => "gridized, linear on Delaunay simplices",
        Interpolation::Natural => "gridized, natural neighbours",
    };
    let dataset = Dataset {
        provenance: Provenance {
            version: env!("CARGO_PKG_VERSION").to_owned(),
            algorithm: algorithm.to_owned(),
            ..Provenance::default()
        },
        ..Dataset::bare(grid, torque, status)
    };
    Ok((dataset, report))
}

fn default_epsilon(samples: &Samples) -> f64 {
    let joints = samples.joints.len();
    let mut deviations: Vec<f64> = samples.deviations.iter().flat_map(|column| norms(column, joints)).collect();
    if deviations.is_empty() {
        return CONTACT_FRACTION * norms(&samples.torques, joints).fold(0.0, f64::max);
    }
    let middle = deviations.len() / 2;
    CONTACT_DEVIATIONS * *deviations.select_nth_unstable_by(middle, f64::total_cmp).1
}

fn norms(column: &[f64], joints: usize) -> impl Iterator<Item = f64> {
    column.chunks_exact(joints).map(|row| row.iter().map(|x| x * x).sum::<f64>().sqrt())
}

/// Grid lines at multiples of the step inside the samples' range.
fn grid(samples: &Samples, steps: &[f64]) -> Result<Grid, Error> {
    let joints = samples.joints.len();
    if steps.len() != 1 && steps.len() != joints {
        let have = steps.len();
        return Err(error!(
            "{} given for {}: give one step, or one a joint",
            counted(have, ["grid step was", "grid steps were"]),
            counted(joints, ["joint", "joints"])
        ));
    }
    let mut axes = Vec::with_capacity(joints);
    let mut points = 1.0;
    for (joint, label) in samples.joints.iter().enumerate() {
        let step = steps[joint % steps.len()];
        if !(step.is_finite() && step > 0.0) {
            let joint = &label.name;
            return Err(error!("grid step {step} of joint `{joint}` is not a positive number"));
        }
        let [low, high] = samples.range(joint);
        // Of a step beyond all reason the slack must not reach across the samples.
        let slack = GRID_LINE * ((high - low) / step).min(1.0);
        let first = (low / step - slack).ceil();
        let last = (high / step + slack).floor();
        let count = last - first + 1.0;
        if count < 1.0 {
            let joint = &label.name;
            return Err(error!(
                "no multiple of the grid step {step} lies within the range of joint `{joint}`: take a smaller step"
            ));
        }
        points *= count;
        if points > GRID_POINTS {
            return Err(error!(
                "the grid would hold {points:.3e} points, the limit is {GRID_POINTS:.0e}: take a larger step"
            ));
        }
        axes.push(Axis {
            name: label.name.clone(),
            unit: label.unit.clone(),
            start: first * step,
            step,
            count: count as usize,
        });
    }
    Ok(Grid { axes })
}

fn fill_linear<T: Triangulation>(triangulation: T, pull: f64, cloud: &Cloud, grid: &Grid) -> (Vec<f64>, Vec<f64>) {
    let linear = Linear { triangulation, cloud, pull };
    fill(|| linear.walk(), cloud, grid)
}

/// Torque of every grid point, and the distance to the nearest of the samples that make it, infinite outside the hull.
/// Blocks of fixed size, each with a walk of its own that `begin` makes ([`Linear::walk`]): the same numbers whatever the
/// number of threads.
fn fill<W: FnMut(&Position, &mut Vec<(u32, f64)>)>(
    begin: impl Fn() -> W + Sync,
    cloud: &Cloud,
    grid: &Grid,
) -> (Vec<f64>, Vec<f64>) {
    const BLOCK: usize = 8192;
    let joints = cloud.joints;
    let mut torque = vec![0.0; grid.points() * joints];
    let mut distances = vec![f64::INFINITY; grid.points()];
    let blocks = torque.par_chunks_mut(BLOCK * joints).zip(distances.par_chunks_mut(BLOCK)).enumerate();
    blocks.for_each(|(block, (torque, distances))| {
        let mut walk = begin();
        let mut weights = Vec::with_capacity(MAX_AXES + 1);
        for (offset, (torque, nearest)) in torque.chunks_exact_mut(joints).zip(distances).enumerate() {
            let at = cloud.scaled(&grid.configuration(block * BLOCK + offset));
            walk(&at, &mut weights);
            for &(point, weight) in &weights {
                *nearest = nearest.min(distance_squared(&at, &cloud.positions[point as usize]).sqrt());
                for (sum, value) in torque.iter_mut().zip(cloud.torque(point)) {
                    *sum += weight * value;
                }
            }
        }
    });
    (torque, distances)
}

#[cfg(test)]
mod tests;
