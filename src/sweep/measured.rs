//! The error of a bake's own dataset: random configurations solved directly, beside what each interpolation gives
//! there.
//!
//! The configurations are spread evenly over the cells of the grid that have a corner in contact, the same ones every
//! time. Each is solved as a grid point is, from rest, and from those corners of its cell that predict a lower energy
//! (`lowest.rs`). Errors are Euclidean norms over the joints; the force of a sliding joint counts with its lever arm.
//!
//! The same configurations tell whether the arm pushes through a part of the object within a cell, and where contact is
//! with the surface at rest how far that is from contact with the deformed surface.
//!
//! An interpolation is formed of the whole grid where that has at most [`WHOLE`] points, else of the grid lines around
//! each configuration, so that memory does not grow with the grid. The boundary layer then knows the surroundings only.

use super::{
    lowest,
    reference::Reference,
    table::{PointResult, Table},
    thin_parts,
};
use crate::{
    Error, JointVector,
    contact::{Model, Solvers, Status},
    dataset::{Dataset, GeometryError, Grid, InterpolationError, MeasuredError},
    field::TorqueField,
    random::Random,
    scene::{ContactLaw, EffortNorm, Interpolation},
};
use rayon::prelude::*;
use std::{
    ops::Range,
    sync::atomic::{AtomicBool, Ordering},
};

/// Configurations that are solved unless a number is given: a tenth of the points in contact, and so a tenth of the
/// time, within these limits. An rms over the fewest is good to a tenth, over the most to a thirtieth.
const CONFIGURATIONS: Range<usize> = 100..1000;

/// Seed of the random configurations; differs from the pilot's.
const SEED: u64 = 0x94d0_49bb_1331_11eb;

/// Most random configurations that may be asked for (1): their rms is good to a thousandth. More would take memory, and
/// days.
pub const MOST_CONFIGURATIONS: usize = 1_000_000;

/// Configurations that are drawn at a time (1): more takes memory, less goes through the grid oftener. Room for
/// [`CONFIGURATIONS`] with six joints.
const DRAWS: usize = 1 << 17;

/// Most grid points of which an interpolation is formed as a whole (1): some 50 MB.
const WHOLE: usize = 1 << 18;

/// Most grid points around a configuration of which an interpolation is formed (1): some milliseconds of time.
const AROUND: usize = 1 << 10;

/// Grid points that a thread looks through at a time (1): larger leaves threads without, smaller takes memory.
const STRETCH: usize = 1 << 12;

/// How far the energy changes along an edge of a cell from what the torques at its ends work, over the work of the rms
/// torque along it, where the edge is cut (1): a smooth torque whose slope turns by the rms torque within a step changes
/// by a twelfth of that.
const CUT: f64 = 0.1;

/// How the error of a dataset is measured.
#[derive(Clone, Copy)]
pub(super) struct ErrorCheck<'a> {
    pub model: &'a Model<'a>,
    pub threshold: f64,
    pub slope: JointVector,
    /// Interpolation by which the dataset answers.
    pub interpolation: Interpolation,
    /// Number of configurations; by default [`CONFIGURATIONS`].
    pub configurations: Option<usize>,
    /// Whether equilibria are the lowest that are found, here as at the grid points.
    pub lowest: bool,
}

/// What random configurations tell of a dataset.
pub(super) struct Measured {
    pub error: MeasuredError,
    /// A sentence without its full stop, where the arm pushes through a part of the object.
    pub notice: Option<String>,
}

/// A random configuration, and the lowest corner of its cell.
struct Place {
    q: JointVector,
    cell: Vec<usize>,
}

impl ErrorCheck<'_> {
    /// Error of the dataset of `grid` in `table`, `contacts` of whose points are in contact. `None` where it is left
    /// out, or stopped.
    pub fn measure(
        &self,
        grid: &Grid,
        table: &Table<'_>,
        contacts: usize,
        stop: &AtomicBool,
    ) -> Result<Option<Measured>, Error> {
        let count = self.configurations.unwrap_or((contacts / 10).clamp(CONFIGURATIONS.start, CONFIGURATIONS.end));
        if count == 0 {
            return Ok(None);
        }
        let places = places(grid, table, contacts, count, DRAWS);
        let solvers = Solvers::new(self.model, rayon::current_num_threads());
        let solved = solvers.map(&places, |solver, place| {
            if stop.load(Ordering::Relaxed) {
                return None;
            }
            let from_rest = solver.solve(&place.q);
            let known = PointResult::of(&from_rest);
            let promising = corners(grid, &place.cell)
                .filter(|&corner| {
                    let may_start = self.lowest && known.status.is_in_contact();
                    may_start && table.status(corner) == Status::Contact && {
                        let from = grid.configuration(corner);
                        let spacing = grid.axes.iter().map(|axis| axis.step);
                        lowest::excess((&place.q, &known), (&from, &table.result(corner)), spacing) > 0.0
                    }
                })
                .map(|corner| table.forces(corner));
            let lowest = lowest::lower(solver, &place.q, Some(&known), promising).unwrap_or(from_rest);
            Some(lowest)
        });
        let Some(solved) = solved.into_iter().collect::<Option<Vec<_>>>() else { return Ok(None) };
        let kept: Vec<&Place> =
            places.iter().zip(&solved).filter(|(_, found)| !found.status.is_failed()).map(|(place, _)| place).collect();
        let norm = EffortNorm::new(grid.axes.iter().map(|axis| axis.unit.as_str()));
        let reference = Reference::of(norm, places.iter().map(|place| place.q).zip(solved));
        let errors = Interpolation::ALL.into_par_iter().map(|interpolation| {
            let of = (interpolation, self.threshold, &self.slope);
            let mut found = interpolated(grid, table, &kept, of, WHOLE)?.into_iter();
            let errors = reference.distances(|q| found.next().unwrap_or(*q));
            Ok(InterpolationError::of(interpolation.name(), errors))
        });
        let mut error = reference.measured(self.interpolation, errors.collect::<Result<_, Error>>()?);
        error.cut = (!places.is_empty()).then(|| cut_cells(grid, table, &places, &reference));
        error.geometry = self.geometry_error(&reference);
        error.friction = reference.friction_excess(self.model);
        let cells = places.par_iter().map(|place| {
            let corners = corners(grid, &place.cell).map(|corner| grid.configuration(corner));
            (place.q, corners.collect())
        });
        Ok(Some(Measured { error, notice: thin_parts::notice(self.model, 0.0, cells) }))
    }

    /// Returns what contact at rest, of which `reference` has the torques, leaves out; none by another law.
    fn geometry_error(&self, reference: &Reference) -> Option<GeometryError> {
        let contact = self.model.contact;
        if contact.law != ContactLaw::Rest {
            return None;
        }
        let mut following = self.model.with_contact(contact.by(ContactLaw::Following));
        (following.with_tangent, following.with_slip) = (false, false);
        let solvers = Solvers::new(&following, rayon::current_num_threads());
        let solved = solvers.map(&reference.places, |solver, q| solver.solve(q));
        let mut torques = solved.iter().map(|found| found.torque);
        let distances = reference.distances(|q| torques.next().unwrap_or(*q));
        let known = distances.iter().zip(&solved).filter(|(_, found)| !found.status.is_failed());
        let (squares, count, depth) = known.fold((0.0, 0, 0.0_f64), |(squares, count, depth), (distance, found)| {
            (squares + distance.powi(2), count + 1, depth.max(-found.gap))
        });
        Some(GeometryError { rms: (squares / f64::from(count.max(1))).sqrt(), depth })
    }
}

/// Returns the share of the cells of `places` with a cut edge: one along which the energy changes by more than [`CUT`]
/// says from the work of the torques at its ends, with the rms torque of `reference` (1).
fn cut_cells(grid: &Grid, table: &Table<'_>, places: &[Place], reference: &Reference) -> f64 {
    let joints = grid.joints();
    let is_cut = |place: &&Place| {
        let corners: Vec<PointResult> = corners(grid, &place.cell).map(|corner| table.result(corner)).collect();
        (0..corners.len()).any(|low| {
            (0..joints).filter(|axis| low >> axis & 1 == 0).any(|axis| {
                let (from, to, joint) = (&corners[low], &corners[low | 1 << axis], joints - 1 - axis);
                let mean = 0.5 * (from.torque[joint] + to.torque[joint]);
                let mut off = JointVector::zeros(joints);
                off[joint] = (to.energy - from.energy) / grid.axes[joint].step + mean;
                let is_known = !from.status.is_failed() && !to.status.is_failed();
                is_known && reference.norm.square(&off, &JointVector::zeros(joints)) > (CUT * reference.torque).powi(2)
            })
        })
    };
    places.par_iter().filter(is_cut).count() as f64 / places.len() as f64
}

/// Evaluates an interpolation of the grid, with its threshold and slope, at each place; grids of at most `whole` points
/// are formed as a whole.
fn interpolated(
    grid: &Grid,
    table: &Table<'_>,
    places: &[&Place],
    (interpolation, threshold, slope): (Interpolation, f64, &JointVector),
    whole: usize,
) -> Result<Vec<JointVector>, Error> {
    let field = |lines: &[Range<usize>]| {
        TorqueField::interpolated(&window(grid, table, lines), interpolation, threshold, slope)
    };
    if grid.points() <= whole {
        let all: Vec<_> = grid.counts().into_iter().map(|count| 0..count).collect();
        let field = field(&all)?;
        return Ok(places.par_iter().map(|place| field.sample(&place.q).torque).collect());
    }
    // As many lines on either side as there is room for, at least the next: differences reach so far.
    let side = (AROUND as f64).powf(1.0 / grid.joints() as f64) as usize;
    let reach = (side.max(4) - 2) / 2;
    let around = |place: &&Place| {
        let lines = place.cell.iter().zip(&grid.axes);
        let lines: Vec<_> =
            lines.map(|(line, axis)| line.saturating_sub(reach)..(line + 2 + reach).min(axis.count)).collect();
        Ok(field(&lines)?.sample(&place.q).torque)
    };
    places.par_iter().map(around).collect()
}

/// Random configurations, evenly spread over the cells with a corner in contact, at most `count` of them, of which
/// `together` are drawn at a time.
fn places(grid: &Grid, table: &Table<'_>, contacts: usize, count: usize, together: usize) -> Vec<Place> {
    let mut random = Random::new(SEED);
    let (mut places, mut left) = (Vec::new(), (2 * count) << grid.joints());
    while left > 0 && places.len() < count {
        let draws = left.min(together);
        left -= draws;
        places.extend(drawn(grid, table, contacts, draws, &mut random));
    }
    places.truncate(count);
    places
}

/// The configurations of so many `draws`.
///
/// A corner in contact is drawn, then one of the cells around it, which is taken with a probability of one over its
/// corners in contact: so each such cell is as likely as any other.
fn drawn(grid: &Grid, table: &Table<'_>, contacts: usize, draws: usize, random: &mut Random) -> Vec<Place> {
    struct Draw {
        rank: usize,
        side: usize,
        chance: f64,
        fractions: JointVector,
    }
    let joints = grid.joints();
    let draws: Vec<Draw> = (0..draws)
        .map(|_| {
            let mut whole =
                |below: usize| ((random.between(0.0, 1.0) * below as f64) as usize).min(below.saturating_sub(1));
            let (rank, side) = (whole(contacts), whole(1 << joints));
            let mut fractions = JointVector::zeros(joints);
            fractions.iter_mut().for_each(|fraction| *fraction = random.between(0.0, 1.0));
            Draw { rank, side, chance: random.between(0.0, 1.0), fractions }
        })
        .collect();
    let mut by_rank: Vec<usize> = (0..draws.len()).collect();
    by_rank.sort_by_key(|&draw| draws[draw].rank);
    let ranks: Vec<usize> = by_rank.iter().map(|&draw| draws[draw].rank).collect();
    let mut points = vec![None; draws.len()];
    by_rank.into_iter().zip(of_ranks(grid, table, &ranks)).for_each(|(draw, point)| points[draw] = Some(point));
    let place = |(draw, point): (&Draw, Option<usize>)| {
        let mut cell = vec![0; joints];
        for (a, (axis, line)) in grid.axes.iter().zip(grid.lines(point?)).enumerate() {
            cell[a] = line.checked_sub(draw.side >> a & 1).filter(|low| low + 1 < axis.count)?;
        }
        let in_contact = corners(grid, &cell).filter(|&corner| table.status(corner).is_in_contact()).count();
        if draw.chance * in_contact as f64 >= 1.0 {
            return None;
        }
        let mut q = JointVector::zeros(joints);
        for (a, axis) in grid.axes.iter().enumerate() {
            q[a] = axis.coordinate(cell[a]) + draw.fractions[a] * axis.step;
        }
        Some(Place { q, cell })
    };
    draws.iter().zip(points).filter_map(place).collect()
}

/// The grid points of `ranks`, which ascend, among those in contact, as far as there are so many; on all cores.
fn of_ranks(grid: &Grid, table: &Table<'_>, ranks: &[usize]) -> Vec<usize> {
    let stretches: Vec<usize> = (0..grid.points()).step_by(STRETCH).collect();
    let touching = |first: usize| {
        let stretch = first..grid.points().min(first + STRETCH);
        stretch.filter(|&point| table.status(point).is_in_contact())
    };
    let counts: Vec<usize> = stretches.par_iter().map(|&first| touching(first).count()).collect();
    let ends = counts.iter().scan(0, |end, count| {
        *end += count;
        Some(*end)
    });
    let found =
        stretches.par_iter().zip(ends.collect::<Vec<_>>()).zip(&counts).flat_map_iter(|((&first, end), count)| {
            let begin = end - count;
            let [from, to] = [begin, end].map(|rank| ranks.partition_point(|&other| other < rank));
            let mut wanted = ranks[from..to].iter().peekable();
            let mut found = Vec::with_capacity(to - from);
            for (rank, point) in (begin..).zip(touching(first)).take_while(|_| from < to) {
                while wanted.next_if(|&&wanted| wanted == rank).is_some() {
                    found.push(point);
                }
            }
            found
        });
    found.collect()
}

/// Corners of the cell whose lowest corner is on the lines `cell`, ascending.
fn corners(grid: &Grid, cell: &[usize]) -> impl Iterator<Item = usize> {
    let last = cell.len() - 1;
    (0..1_usize << cell.len())
        .map(move |sides| grid.point(cell.iter().enumerate().map(|(a, low)| low + (sides >> (last - a) & 1))))
}

/// The dataset of the grid lines `lines` along each axis, contacts aside.
fn window(grid: &Grid, table: &Table<'_>, lines: &[Range<usize>]) -> Dataset {
    let mut part = grid.clone();
    for (axis, lines) in part.axes.iter_mut().zip(lines) {
        (axis.start, axis.count) = (axis.coordinate(lines.start), lines.len());
    }
    let (mut torque, mut energy, mut gap, mut status) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
    for number in 0..part.points() {
        let result = table.result(grid.point(lines.iter().zip(part.lines(number)).map(|(lines, k)| lines.start + k)));
        torque.extend_from_slice(&result.torque);
        energy.push(result.energy);
        gap.push(result.gap);
        status.push(result.status as u8);
    }
    Dataset { energy: Some(energy.into()), gap: Some(gap.into()), ..Dataset::bare(part, torque, status) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        contact::Equilibrium,
        dataset::Extras,
        fixtures::grids,
        sweep::{
            columns::{Columns, Shape},
            table::Block,
        },
    };

    const SHAPE: Shape =
        Shape { joints: 2, surface_nodes: 0, extras: Extras { forces: false, tangent: false, slip: false } };

    /// A spring of 2 N m/rad beyond q0 = 0.35, and beside it one of 1 N m/rad.
    fn columns(grid: &Grid) -> Columns {
        let mut columns = Columns::default();
        for point in 0..grid.points() {
            let q = grid.configuration(point);
            let depth = (q[0] - 0.35).max(0.0);
            let status = if depth > 0.0 { Status::Contact } else { Status::Free };
            columns.push(
                &Equilibrium {
                    status,
                    iterations: 1,
                    residual: 0.0,
                    energy: depth * depth * (1.0 + 0.2 * q[1].sin()),
                    gap: 0.35 - q[0],
                    tangent: None,
                    torque: JointVector::from_slice(&[
                        -2.0 * depth * (1.0 + 0.2 * q[1].sin()),
                        -0.2 * depth * depth * q[1].cos(),
                    ]),
                    forces: Vec::new(),
                    slip: None,
                    touches: Vec::new(),
                },
                SHAPE,
            );
        }
        columns
    }

    #[test]
    fn configurations_are_spread_evenly_over_the_cells_in_contact() {
        let grid = grids::grid(&[(0.0, 0.1, 8), (0.0, 0.1, 4)]);
        let columns = columns(&grid);
        let table = Table::new(SHAPE, vec![Block::of(&columns, 0)]);
        // Lines 4 to 7 of the first axis are in contact: so are cells 3 to 6, three times along the second axis.
        let places = places(&grid, &table, 16, 1200, DRAWS);
        assert_eq!(places.len(), 1200);
        let mut counts = [[0; 3]; 4];
        for Place { q, cell } in &places {
            counts[cell[0] - 3][cell[1]] += 1;
            assert!(
                (0..2).all(|a| (cell[a] as f64..(cell[a] + 1) as f64).contains(&(q[a] / 0.1))),
                "{q:?} in {cell:?}"
            );
        }
        // Binomial, of mean 100 and standard deviation 9.6.
        assert!(counts.as_flattened().iter().all(|count| (60..140).contains(count)), "{counts:?}");
        // The same, however many are drawn at a time.
        for together in [1, 100, 5000] {
            let again = super::places(&grid, &table, 16, 1200, together);
            let alike = |(a, b): (&Place, &Place)| a.q == b.q && a.cell == b.cell;
            assert!(again.len() == 1200 && again.iter().zip(&places).all(alike), "{together}");
        }
        assert_eq!(corners(&grid, &[3, 1]).collect::<Vec<_>>(), [13, 14, 17, 18]);
    }

    /// One joint: the energy of a spring is cut nowhere, however stiff, and where it leaps it is cut in the leap's cell.
    #[test]
    fn a_leap_of_the_energy_cuts_its_cell_alone() {
        let grid = grids::grid(&[(0.0, 0.1, 8), (0.0, 0.1, 4)]);
        let norm = EffortNorm::new(["rad", "rad"]);
        let share = |leap: f64| {
            let mut columns = Columns::default();
            for point in 0..grid.points() {
                let q = grid.configuration(point);
                let mut equilibrium = Equilibrium::free(-0.01, 2);
                equilibrium.status = Status::Contact;
                equilibrium.energy = 0.5 * q[0] * q[0] + if q[0] > 0.25 { leap } else { 0.0 };
                equilibrium.torque = JointVector::from_slice(&[-q[0], 0.0]);
                columns.push(&equilibrium, SHAPE);
            }
            let table = Table::new(SHAPE, vec![Block::of(&columns, 0)]);
            let places = places(&grid, &table, 32, 700, DRAWS);
            let mut equilibrium = Equilibrium::free(0.0, 2);
            equilibrium.torque[0] = 0.5;
            let reference = Reference::of(norm, [(places[0].q, equilibrium)]);
            cut_cells(&grid, &table, &places, &reference)
        };
        // A tenth of the work of the rms torque, 0.5 N m over 0.1 rad, is 5 mJ.
        assert_eq!([share(0.0), share(0.0049)], [0.0; 2]);
        // The cells from 0.2 to 0.3 are a seventh of all; binomial, of standard deviation 0.013.
        assert!((share(0.0051) - 1.0 / 7.0).abs() < 0.06, "{}", share(0.0051));
    }

    #[test]
    fn a_window_around_a_configuration_gives_what_the_whole_grid_gives() {
        let grid = grids::grid(&[(0.0, 0.01, 90), (0.0, 0.02, 80)]);
        let columns = columns(&grid);
        let table = Table::new(SHAPE, vec![Block::of(&columns, 0)]);
        let places = places(&grid, &table, 54 * 80, 50, DRAWS);
        let places: Vec<&Place> = places.iter().collect();
        let slope = JointVector::from_slice(&[1e3, 1e3]);
        for interpolation in Interpolation::ALL {
            let of = |whole: usize| interpolated(&grid, &table, &places, (interpolation, 0.5, &slope), whole).unwrap();
            for (a, b) in of(usize::MAX).iter().zip(&of(0)) {
                let apart = a.iter().zip(b.iter()).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
                assert!(apart < 1e-12, "{interpolation:?}: {a:?} and {b:?}");
            }
        }
    }
}
