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

use super::{lowest, reference::Reference, table::Table, thin_parts, tile::PointResult};
use crate::{
    Error, JointVector,
    contact::{Model, Proximity, Solvers, Status},
    dataset::{Axis, Dataset, GeometryError, Grid, InterpolationError, MeasuredError},
    field::TorqueField,
    random::{Random, mix},
    scene::{ContactLaw, EffortNorm, Interpolation},
};
use rayon::prelude::*;
use std::{
    collections::BTreeSet,
    ops::Range,
    sync::atomic::{AtomicBool, Ordering},
};

/// Configurations that are solved unless a number is given: a tenth of the points in contact, and so a tenth of the
/// time, within these limits. An rms over the fewest is good to a tenth, over the most to a thirtieth.
const CONFIGURATIONS: Range<usize> = 100..1000;

/// Length of rounding from which on it is proposed, in that of the scene (1): less changes the error by some percent.
const LONGER: f64 = 1.25;

/// Seed of the random configurations; differs from the pilot's.
const SEED: u64 = 0x94d0_49bb_1331_11eb;

/// Most random configurations that may be asked for (1): their rms is good to a thousandth. More would take memory, and
/// days.
pub const MOST_CONFIGURATIONS: usize = 1_000_000;

/// Most grid points of which an interpolation is formed as a whole (1): some 50 MB.
const WHOLE: usize = 1 << 18;

/// Most grid points around a configuration of which an interpolation is formed (1): some milliseconds of time.
const AROUND: usize = 1 << 10;

/// Grid points that all threads look through at a time (1): larger takes memory, smaller shares out too little.
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

/// Time of a solution by the law that follows the deformation over that by the law at rest, at most (1): 4 to 8 on the
/// scenes that ship.
const FOLLOWING: usize = 8;

impl ErrorCheck<'_> {
    /// Number of configurations of a dataset with so many `contacts`.
    fn count(&self, contacts: usize) -> usize {
        self.configurations.unwrap_or((contacts / 10).clamp(CONFIGURATIONS.start, CONFIGURATIONS.end))
    }

    /// Number of solutions from rest that take as long, at most: each configuration is solved once more, from a corner or
    /// by the other law.
    pub fn solutions(&self, contacts: usize) -> usize {
        self.count(contacts) * if self.lowest { 2 } else { 1 + FOLLOWING }
    }

    /// Error of the dataset of `grid` in `table`, `contacts` of whose points are in contact. `None` where it is left
    /// out, or stopped.
    pub fn measure(
        &self,
        grid: &Grid,
        table: &Table<'_>,
        contacts: usize,
        stop: &AtomicBool,
    ) -> Result<Option<Measured>, Error> {
        let count = self.count(contacts);
        if count == 0 {
            return Ok(None);
        }
        let places = places(grid, table, count);
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
        error.rounding = self.rounding(grid, &places);
        error.rounded = self.model.contact.round;
        error.friction = reference.friction_excess(self.model);
        let cells = places.par_iter().map(|place| {
            let corners = corners(grid, &place.cell).map(|corner| grid.configuration(corner));
            (place.q, corners.collect())
        });
        Ok(Some(Measured { error, notice: thin_parts::notice(self.model, 0.0, cells) }))
    }

    /// Returns the length over which contact could be rounded: half of what the deepest nodes at `places` move in a step
    /// of `grid`, which is what that resolves, or what the body's thickness allows; none where that is half as much, or
    /// [hardly more](LONGER) than contact is rounded over, or where contact is not at rest (m).
    fn rounding(&self, grid: &Grid, places: &[Place]) -> Option<f64> {
        let contact = self.model.contact;
        if contact.law != ContactLaw::Rest || places.is_empty() {
            return None;
        }
        let moved = |proximity: &mut Proximity<'_>, place: &Place| {
            let node = proximity.nearest(&place.q).node;
            let steps = grid.axes.iter().enumerate();
            let step = |(joint, axis): (usize, &Axis)| {
                self.model.chain.jacobian_column(proximity.pose(), node, joint).length() * axis.step
            };
            steps.map(step).fold(0.0, f64::max)
        };
        let mut moved: Vec<f64> = places
            .par_iter()
            .map_init(|| Proximity::new(self.model), |proximity, place| moved(proximity, place))
            .collect();
        moved.sort_unstable_by(f64::total_cmp);
        let resolved = 0.5 * moved[moved.len() / 2];
        let length = resolved.min(self.model.greatest_rounding());
        (length > 0.5 * resolved && length > LONGER * contact.round.unwrap_or(0.0)).then_some(length)
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

/// Random configurations, `count` of them, evenly spread over the cells with a corner in contact: each cell has some
/// numbers that look random and follow from it alone, and the least numbers of all cells are taken.
fn places(grid: &Grid, table: &Table<'_>, count: usize) -> Vec<Place> {
    let stretches = || (0..grid.points()).step_by(STRETCH);
    let cells = |first: usize| {
        let stretch = (first..grid.points().min(first + STRETCH)).into_par_iter();
        stretch
            .filter(|&point| table.status(point).is_in_contact())
            .flat_map_iter(|point| own_cells(grid, table, point))
    };
    let all: usize = stretches().map(|first| cells(first).count()).sum();
    let (numbers, mut least) = (count.div_ceil(all.max(1)) as u64, BTreeSet::new());
    for first in stretches() {
        let limit = least.last().filter(|_| least.len() == count).map_or(u64::MAX, |&(number, _)| number);
        let numbers = cells(first).flat_map_iter(|cell| {
            let of_cell = (0..numbers).map(move |number| mix(mix(SEED ^ cell as u64).wrapping_add(number)));
            of_cell.filter(move |number| *number <= limit).map(move |number| (number, cell))
        });
        least.extend(numbers.collect::<Vec<(u64, usize)>>());
        while least.len() > count {
            least.pop_last();
        }
    }
    let place = |(number, cell)| {
        let (mut random, mut q) = (Random::new(number), grid.configuration(cell));
        q.iter_mut().zip(&grid.axes).for_each(|(q, axis)| *q += random.between(0.0, 1.0) * axis.step);
        Place { q, cell: grid.lines(cell)[..grid.joints()].to_vec() }
    };
    least.into_iter().map(place).collect()
}

/// The lowest corners of the cells whose first corner in contact is `point`.
fn own_cells(grid: &Grid, table: &Table<'_>, point: usize) -> impl Iterator<Item = usize> {
    let lines = grid.lines(point);
    let low = move |sides: usize| {
        let along = |(a, axis): (usize, &Axis)| lines[a].checked_sub(sides >> a & 1).filter(|low| low + 1 < axis.count);
        grid.axes.iter().enumerate().map(along).collect::<Option<Vec<usize>>>()
    };
    let is_own =
        move |low: &Vec<usize>| corners(grid, low).find(|&corner| table.status(corner).is_in_contact()) == Some(point);
    (0..1_usize << grid.joints()).filter_map(low).filter(is_own).map(|low| grid.point(low))
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
        sweep::tile::{Shape, Tile},
    };

    const SHAPE: Shape =
        Shape { joints: 2, surface_nodes: 0, extras: Extras { forces: false, tangent: false, slip: false } };

    /// A spring of 2 N m/rad beyond q0 = 0.35, and beside it one of 1 N m/rad.
    fn tile(grid: &Grid) -> Tile<'static> {
        let mut tile = Tile::default();
        for point in 0..grid.points() {
            let q = grid.configuration(point);
            let depth = (q[0] - 0.35).max(0.0);
            let status = if depth > 0.0 { Status::Contact } else { Status::Free };
            tile.push(
                &Equilibrium {
                    status,
                    energy: depth * depth * (1.0 + 0.2 * q[1].sin()),
                    torque: JointVector::from_slice(&[
                        -2.0 * depth * (1.0 + 0.2 * q[1].sin()),
                        -0.2 * depth * depth * q[1].cos(),
                    ]),
                    ..Equilibrium::free(0.35 - q[0], 2)
                },
                SHAPE,
            );
        }
        tile
    }

    #[test]
    fn configurations_are_spread_evenly_over_the_cells_in_contact() {
        let grid = grids::grid(&[(0.0, 0.1, 8), (0.0, 0.1, 4)]);
        let table = Table::new(SHAPE, vec![tile(&grid)]);
        // Lines 4 to 7 of the first axis are in contact: so are cells 3 to 6, three times along the second axis.
        let places = places(&grid, &table, 1200);
        assert_eq!(places.len(), 1200);
        let mut counts = [[0; 3]; 4];
        for Place { q, cell } in &places {
            counts[cell[0] - 3][cell[1]] += 1;
            assert!(
                (0..2).all(|a| (cell[a] as f64..(cell[a] + 1) as f64).contains(&(q[a] / 0.1))),
                "{q:?} in {cell:?}"
            );
        }
        assert_eq!(counts, [[100; 3]; 4]);
        assert_eq!(corners(&grid, &[3, 1]).collect::<Vec<_>>(), [13, 14, 17, 18]);
        // More cells than configurations: 44 times 39.
        let grid = grids::grid(&[(0.0, 0.01, 80), (0.0, 0.1, 40)]);
        let table = Table::new(SHAPE, vec![tile(&grid)]);
        let places = super::places(&grid, &table, 600);
        let cells: BTreeSet<&[usize]> = places.iter().map(|place| &place.cell[..]).collect();
        assert_eq!(cells.len(), 600, "no cell twice");
        let low = [57, 20];
        // Hypergeometric, of mean 300 and 308, and standard deviation 10.
        let counts = [0, 1].map(|a| cells.iter().filter(|cell| cell[a] < low[a]).count());
        assert!(counts.iter().all(|count| (250..350).contains(count)), "{counts:?}");
    }

    /// One joint: the energy of a spring is cut nowhere, however stiff, and where it leaps it is cut in the leap's cell.
    #[test]
    fn a_leap_of_the_energy_cuts_its_cell_alone() {
        let grid = grids::grid(&[(0.0, 0.1, 8), (0.0, 0.1, 4)]);
        let norm = EffortNorm::new(["rad", "rad"]);
        let share = |leap: f64| {
            let mut tile = Tile::default();
            for point in 0..grid.points() {
                let q = grid.configuration(point);
                let mut equilibrium = Equilibrium::free(-0.01, 2);
                equilibrium.status = Status::Contact;
                equilibrium.energy = 0.5 * q[0] * q[0] + if q[0] > 0.25 { leap } else { 0.0 };
                equilibrium.torque = JointVector::from_slice(&[-q[0], 0.0]);
                tile.push(&equilibrium, SHAPE);
            }
            let table = Table::new(SHAPE, vec![tile]);
            let places = places(&grid, &table, 700);
            let mut equilibrium = Equilibrium::free(0.0, 2);
            equilibrium.torque[0] = 0.5;
            let reference = Reference::of(norm, [(places[0].q, equilibrium)]);
            cut_cells(&grid, &table, &places, &reference)
        };
        // A tenth of the work of the rms torque, 0.5 N m over 0.1 rad, is 5 mJ.
        assert_eq!([share(0.0), share(0.0049)], [0.0; 2]);
        // The cells from 0.2 to 0.3 are a seventh of all, and each has as many configurations, but for one.
        assert!((share(0.0051) - 1.0 / 7.0).abs() < 0.01, "{}", share(0.0051));
    }

    #[test]
    fn a_window_around_a_configuration_gives_what_the_whole_grid_gives() {
        let grid = grids::grid(&[(0.0, 0.01, 90), (0.0, 0.02, 80)]);
        let table = Table::new(SHAPE, vec![tile(&grid)]);
        let places = places(&grid, &table, 50);
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
