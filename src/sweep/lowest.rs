//! The lowest equilibrium: of those reached from rest and from the equilibria of the neighbouring grid points.
//!
//! Equilibrium (2) may have several solutions, and the search from rest finds one of them. If neighbouring points hold
//! different ones, U jumps between them, and a torque that follows a jump is not passive. The minimum of U over the
//! solutions has no jumps.
//!
//! After the sweep from rest, corrections go in rounds. For each point p in contact and each of its neighbours n on the
//! grid, n predicts the energy of its own equilibrium at p by the trapezoidal rule,
//! `U_n - 1/2 (tau_n + tau_p) . (q_p - q_n)`. If U_p exceeds that by more than [`EDGE_TOLERANCE`] times the work of one
//! grid step, or if p did not converge, p is solved again from the forces of n. The lowest converged result replaces
//! that of p if it is lower by more than the solver's own error. The first round looks at all neighbours, later ones at
//! those that changed in the round before, until nothing changes.
//!
//! All reads of a round are of the state before it, and the starts of a point are taken in the order of their numbers.
//! So the result depends on the results from rest alone: not on threads, chunks, or an interruption. Starts are the
//! stored forces, in f32, in memory as in a part. The correction runs on the CPU, whatever backend solved from rest.
//!
//! Points and their neighbours are those of any [`Lattice`]: a uniform grid here, the nodes of a store in
//! `refine/nodebook.rs`.
//!
//! Memory: the new results, and one stretch of points at a time.

use super::{
    table::{Replaced, Table},
    tile::{PointResult, Shape, Tile},
};
use crate::{
    JointVector,
    contact::{Equilibrium, Model, NodeForce, Solver, Solvers, Status},
    dataset::Grid,
    scene::ContactLaw,
};
use rayon::prelude::*;
use serde::Serialize;
use std::{
    collections::{BTreeMap, BTreeSet},
    sync::atomic::{AtomicBool, Ordering},
    time::Instant,
};

/// Excess of a grid point's energy over what a neighbour predicts, over the work of the torque along one grid step,
/// above which the neighbour's equilibrium is tried there (1). Smaller: more searches, most of them at kinks of the
/// torque, without effect. Larger: jumps of U up to this share of a step's work may stay. Of the 4,086 points in
/// contact of a sphere of 102 nodes on springs, dented to a third of its radius, 3 degrees apart, where a search takes
/// as long as a solution from rest:
///
/// | tolerance | 0.01 | 0.02 | 0.05 | 0.1 | 0.2 | 0.4 |
/// |---|---|---|---|---|---|---|
/// | searches | 4,540 | 3,766 | 2,938 | 2,140 | 968 | 422 |
/// | lowered | 84 | 68 | 56 | 42 | 30 | 14 |
const EDGE_TOLERANCE: f64 = 0.1;

/// Error of the energy of an equilibrium that is balanced to rounding, over the energy (1): a thousand roundings of f64
/// sums over some hundred nodes, and far below differences that can be felt. An imbalance r adds about r^2, the energy
/// being least at the equilibrium.
const ENERGY_ERROR: f64 = 1e-10;

/// Points that are looked at together (1): enough for all threads, few enough that what is known of them takes little
/// memory.
const STRETCH: usize = 1 << 14;

/// Report of the correction.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Lowered {
    /// Points with a new equilibrium, lower than that from rest.
    pub points: usize,
    /// Points among them that had not converged from rest.
    pub converged: usize,
    /// Greatest decrease of U at a point that had converged, over U (1).
    pub greatest: f64,
    /// Rounds, the last of which changed nothing; of a store the sum over all batches of new nodes.
    pub rounds: usize,
    /// Searches from a neighbour's forces.
    pub searches: usize,
    /// Wall time (s).
    pub seconds: f64,
}

/// Points with results, and which of them lie beside one another.
pub(super) trait Lattice: Sync {
    /// Names a point. Starts are taken in ascending order.
    type Point: Copy + Ord + Send + Sync;
    /// What is kept of a new result.
    type Row: Send;

    /// Returns the configuration of a point (rad or m).
    fn configuration(&self, point: Self::Point) -> JointVector;

    /// Returns the neighbours of a point that have results, each with the lattice's spacing there (rad or m).
    fn neighbours(&self, point: Self::Point) -> impl Iterator<Item = (Self::Point, JointVector)>;

    /// Returns the status of a point.
    fn status(&self, point: Self::Point) -> Status;

    /// Returns the result of a point.
    fn result(&self, point: Self::Point) -> PointResult;

    /// Returns the forces on the object's nodes at a point, ascending by node (N).
    fn forces(&self, point: Self::Point) -> Vec<NodeForce>;

    /// Returns what is kept of a new result, found at `q` by `solver`.
    fn row(&self, solver: &mut Solver<'_>, q: &JointVector, found: &Equilibrium) -> Self::Row;

    /// Replaces results.
    fn replace(&mut self, found: BTreeMap<Self::Point, Self::Row>);
}

/// A uniform grid, whose results are in a table.
struct UniformGrid<'a, 't> {
    grid: &'a Grid,
    table: &'a mut Table<'t>,
    shape: Shape,
}

/// Whether scenes of this `law` have several equilibria of which the lowest counts: contact with the geometry at rest
/// has one.
pub(super) fn applies(law: ContactLaw) -> bool {
    law == ContactLaw::Following
}

/// Replaces equilibria in `table` by lower ones. `None` when it was stopped.
pub(super) fn correct(
    grid: &Grid,
    model: &Model<'_>,
    shape: Shape,
    table: &mut Table<'_>,
    stop: &AtomicBool,
) -> Option<Lowered> {
    let (start, points) = (Instant::now(), grid.points());
    let solvers = Solvers::new(model, rayon::current_num_threads());
    let all = (0..points).step_by(STRETCH).map(|first| (first..points.min(first + STRETCH)).collect());
    let mut lowered = Lowered::default();
    settle(&mut UniformGrid { grid, table, shape }, &solvers, all, |_| true, stop, &mut lowered)?;
    for &point in table.replaced.keys() {
        let before = table.before(point);
        lowered.count((before.status, before.energy), table.result(point).energy);
    }
    lowered.seconds = start.elapsed().as_secs_f64();
    Some(lowered)
}

impl Lowered {
    /// Counts a point whose result from rest, status and energy (J), gave way to one of lower `energy` (J).
    pub(super) fn count(&mut self, (status, before): (Status, f64), energy: f64) {
        self.points += 1;
        if status == Status::Contact {
            self.greatest = self.greatest.max((before - energy) / before);
        } else {
            self.converged += 1;
        }
    }
}

/// Replaces results of `lattice` by lower ones, round by round, until nothing changes, and counts rounds and searches.
/// The first round looks at the points of `first`, for neighbours of which or beside which one `is_new`. `None` when it
/// was stopped; no result of an unfinished round is kept.
pub(super) fn settle<L: Lattice>(
    lattice: &mut L,
    solvers: &Solvers<'_>,
    first: impl Iterator<Item = Vec<L::Point>>,
    is_new: impl Fn(L::Point) -> bool + Sync,
    stop: &AtomicBool,
    lowered: &mut Lowered,
) -> Option<()> {
    let mut found =
        round(lattice, solvers, first, |point, start| is_new(point) || is_new(start), stop, &mut lowered.searches)?;
    lowered.rounds += 1;
    while !found.is_empty() {
        let changed: BTreeSet<L::Point> = found.keys().copied().collect();
        lattice.replace(found);
        let beside: BTreeSet<L::Point> =
            changed.iter().flat_map(|&point| lattice.neighbours(point)).map(|(beside, _)| beside).collect();
        let beside: Vec<L::Point> = beside.into_iter().collect();
        let stretches = beside.chunks(STRETCH).map(<[L::Point]>::to_vec);
        let has_changed = |_, start| changed.contains(&start);
        found = round(lattice, solvers, stretches, has_changed, stop, &mut lowered.searches)?;
        lowered.rounds += 1;
    }
    Some(())
}

/// Returns the results of one round at `points`: lower ones, from neighbours that may start a search there.
fn round<L: Lattice>(
    lattice: &L,
    solvers: &Solvers<'_>,
    points: impl Iterator<Item = Vec<L::Point>>,
    may_start: impl Fn(L::Point, L::Point) -> bool + Sync,
    stop: &AtomicBool,
    count: &mut usize,
) -> Option<BTreeMap<L::Point, L::Row>> {
    let mut found = BTreeMap::new();
    for stretch in points {
        let searches: Vec<(L::Point, Vec<L::Point>)> = stretch
            .into_par_iter()
            .map(|point| (point, starts(lattice, point, |start| may_start(point, start))))
            .filter(|(_, starts)| !starts.is_empty())
            .collect();
        *count += searches.iter().map(|(_, starts)| starts.len()).sum::<usize>();
        let results = solvers.map(&searches, |solver, (point, starts)| {
            if stop.load(Ordering::Relaxed) {
                return None;
            }
            let (q, before) = (lattice.configuration(*point), lattice.result(*point));
            let lowest = lower(solver, &q, Some(&before), starts.iter().map(|&start| lattice.forces(start)))?;
            Some((*point, lattice.row(solver, &q, &lowest)))
        });
        found.extend(results.into_iter().flatten());
        if stop.load(Ordering::Relaxed) {
            return None;
        }
    }
    Some(found)
}

/// Returns the neighbours of `point` whose equilibria it may be lower in, ascending; of those that `may_start`.
fn starts<L: Lattice>(lattice: &L, point: L::Point, may_start: impl Fn(L::Point) -> bool) -> Vec<L::Point> {
    if !matches!(lattice.status(point), Status::Contact | Status::Unconverged) {
        return Vec::new();
    }
    let (q, here) = (lattice.configuration(point), lattice.result(point));
    let mut starts: Vec<L::Point> = lattice
        .neighbours(point)
        .filter(|&(n, _)| may_start(n) && lattice.status(n) == Status::Contact)
        .filter(|(n, spacing)| {
            excess((&q, &here), (&lattice.configuration(*n), &lattice.result(*n)), spacing.iter().copied()) > 0.0
        })
        .map(|(n, _)| n)
        .collect();
    starts.sort_unstable();
    starts
}

/// Returns the energy here beyond what the equilibrium there predicts and the tolerance allows (J); above zero a search
/// from there is worth while. `spacing` is that of the lattice along each axis (rad or m).
pub(super) fn excess(
    (q, here): (&JointVector, &PointResult),
    (from, there): (&JointVector, &PointResult),
    spacing: impl Iterator<Item = f64>,
) -> f64 {
    if here.status != Status::Contact {
        return f64::INFINITY;
    }
    let (mut predicted, mut work) = (there.energy, 0.0_f64);
    for (a, step) in spacing.enumerate() {
        let mean = 0.5 * (there.torque[a] + here.torque[a]);
        predicted -= mean * (q[a] - from[a]);
        work = work.max(0.5 * (there.torque[a].abs() + here.torque[a].abs()) * step);
    }
    here.energy - (predicted + EDGE_TOLERANCE * work)
}

/// Searches at `q` from each of `starts`, forces on the object's nodes, in order. Returns the lowest equilibrium that
/// is lower than `known`, the result there is, by more than the errors of both.
pub(super) fn lower(
    solver: &mut Solver<'_>,
    q: &JointVector,
    known: Option<&PointResult>,
    starts: impl Iterator<Item = Vec<NodeForce>>,
) -> Option<Equilibrium> {
    let mut least =
        known.filter(|known| known.status == Status::Contact).map(|known| (known.energy, known.residual.into()));
    let mut lowest = None;
    for forces in starts {
        let found = solver.solve_from(q, &forces);
        let is_lower = least.is_none_or(|(energy, residual): (f64, f64)| {
            found.energy < energy * (1.0 - ENERGY_ERROR - residual.powi(2) - found.residual.powi(2))
        });
        if found.status == Status::Contact && is_lower {
            least = Some((found.energy, found.residual));
            lowest = Some(found);
        }
    }
    lowest
}

impl Lattice for UniformGrid<'_, '_> {
    type Point = usize;
    type Row = Tile<'static>;

    fn configuration(&self, point: usize) -> JointVector {
        self.grid.configuration(point)
    }

    fn neighbours(&self, point: usize) -> impl Iterator<Item = (usize, JointVector)> {
        let spacing: JointVector = self.grid.axes.iter().map(|axis| axis.step).collect();
        self.grid.neighbours(point).flatten().flatten().map(move |n| (n, spacing))
    }

    fn status(&self, point: usize) -> Status {
        self.table.status(point)
    }

    fn result(&self, point: usize) -> PointResult {
        self.table.result(point)
    }

    fn forces(&self, point: usize) -> Vec<NodeForce> {
        self.table.forces(point)
    }

    fn row(&self, _: &mut Solver<'_>, _: &JointVector, found: &Equilibrium) -> Tile<'static> {
        let mut row = Tile::default();
        row.push(found, self.shape);
        row
    }

    fn replace(&mut self, found: Replaced) {
        self.table.replaced.extend(found);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        dataset::{Extras, Stored},
        fixtures::grids,
    };

    const SHAPE: Shape =
        Shape { joints: 1, surface_nodes: 9, extras: Extras { forces: true, tangent: false, slip: false } };

    /// An equilibrium in contact with as many node forces as its energy has joules.
    fn equilibrium(energy: f64, torque: f64) -> Equilibrium {
        let force = |node| NodeForce { node, force: glam::DVec3::splat(energy) };
        Equilibrium {
            status: Status::Contact,
            iterations: 3,
            residual: 1e-9,
            energy,
            torque: JointVector::from_slice(&[torque]),
            forces: (0..energy as u32).map(force).collect(),
            ..Equilibrium::free(-1.0, 1)
        }
    }

    fn tile(first: usize, energies: &[f64]) -> Tile<'static> {
        let mut tile = Tile::default();
        tile.clear(first);
        energies.iter().for_each(|&energy| tile.push(&equilibrium(energy, -1.0), SHAPE));
        tile
    }

    #[test]
    fn a_point_starts_from_neighbours_that_predict_less_energy() {
        // U grows by 1 a step of 1 with torque -1; point 2 holds 0.5 too much.
        let grid = grids::grid(&[(0.0, 1.0, 5)]);
        let mut table = Table::new(SHAPE, vec![tile(0, &[1.0, 2.0, 3.5, 4.0, 5.0])]);
        let around = UniformGrid { grid: &grid, table: &mut table, shape: SHAPE };
        let found: Vec<_> = (0..5).map(|point| starts(&around, point, |_| true)).collect();
        assert_eq!(found, [vec![], vec![], vec![1, 3], vec![], vec![]]);
        assert_eq!(starts(&around, 2, |n| n == 3), [3]);
        // Below the tolerance nothing is tried.
        let mut table = Table::new(SHAPE, vec![tile(0, &[1.0, 2.0 + 0.5 * EDGE_TOLERANCE, 3.0])]);
        let grid = grids::grid(&[(0.0, 1.0, 3)]);
        let around = UniformGrid { grid: &grid, table: &mut table, shape: SHAPE };
        assert!((0..3).all(|point| starts(&around, point, |_| true).is_empty()));
    }

    /// New results in a table, and in the count of contacts.
    #[test]
    fn replaced_results_are_read_in_their_place() {
        let mut table = Table::new(SHAPE, vec![tile(0, &[1.0, 2.0]), tile(2, &[3.0, 0.0, 5.0])]);
        table.replaced = Replaced::from([(1, tile(1, &[4.0])), (3, tile(3, &[2.0]))]);
        let expected = tile(0, &[1.0, 4.0, 3.0, 2.0, 5.0]);
        for section in [Stored::Energy, Stored::ContactNodes, Stored::ContactForces, Stored::Status] {
            let size = SHAPE.bytes(section);
            let runs = table.runs(0..5).map(|(tile, points)| tile.column(section, points, size).to_vec());
            assert_eq!(runs.collect::<Vec<_>>().concat(), expected.column(section, 0..5, size));
            assert_eq!(table.runs(1..4).map(|(_, points)| points).collect::<Vec<_>>(), [0..1, 0..1, 0..1]);
        }
        for (point, energy) in [1.0, 4.0, 3.0, 2.0, 5.0].into_iter().enumerate() {
            let found = table.result(point);
            assert_eq!((found.energy, found.torque[0], found.iterations), (energy, -1.0, 3));
            let forces = table.forces(point);
            assert_eq!(forces, equilibrium(energy, -1.0).forces, "point {point}");
        }
        assert_eq!(table.before(1).energy, 2.0);
    }
}
