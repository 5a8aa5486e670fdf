//! The nodes of which a store is filled: each solved once, together with others by a backend, and lowered by its
//! neighbours.
//!
//! *Neighbours* of a node are the nodes one step away along an axis, at its own level's spacing or at that of a finer
//! level, as far as they are solved. Of two neighbours each may start a search at the other; see `lowest.rs`. New nodes
//! and those beside them are looked at first, then those beside what has changed.
//!
//! Memory: the forces of all nodes, in f32, while the store is filled.

use crate::{
    Error, JointVector,
    contact::{Backend, Equilibrium, NodeForce, Solver, Solvers, Status},
    error,
    store::{Place, Space, beyond},
    sweep::{
        lowest::{Lattice, Lowered, settle},
        node::{Scale, Solved, holding, solve_all},
        tile::PointResult,
    },
};
use glam::Vec3;
use std::{
    collections::{BTreeMap, BTreeSet, HashMap},
    sync::atomic::AtomicBool,
    time::Instant,
};

/// Level and place of a node.
pub(super) type Point = (u32, Place);

/// Memory of a node that is held, with so many numbers and forces on `forces` nodes of the object (bytes).
pub(super) fn held_bytes(numbers: usize, forces: f64) -> f64 {
    let fixed = size_of::<(Point, Solved)>() + numbers * size_of::<f32>();
    // Tables grow by doubling.
    2.0 * fixed as f64 + forces * size_of::<(u32, Vec3)>() as f64
}

/// All nodes that are solved.
pub(super) struct HeldNodes {
    pub space: Space,
    scale: Scale,
    held: HashMap<Point, Solved>,
    /// Status and energy from rest of those that were lowered (J).
    from_rest: HashMap<Point, (Status, f64)>,
}

impl HeldNodes {
    pub fn get(&self, level: u32, place: &Place) -> Option<&Solved> {
        self.held.get(&(level, *place))
    }

    pub fn count(&self) -> usize {
        self.held.len()
    }

    /// Returns the number of equilibria that were solved in contact for these nodes, searches for lower ones aside.
    pub fn equilibria(&self) -> usize {
        self.held.values().map(|held| held.equilibria as usize).sum()
    }

    /// Returns the corners of the finest cell around `q` that are all solved, with its spacing along each axis [rad or
    /// m].
    pub fn around(&self, q: &JointVector) -> Option<(Vec<Point>, JointVector)> {
        (0..self.space.levels()).rev().find_map(|level| {
            let low = self.space.cell(level, q);
            let corners = (0..1 << self.space.joints()).map(|set| self.space.owner(level, beyond(&low, set)));
            let solved: Option<Vec<Point>> =
                corners.map(|point| self.held.contains_key(&point).then_some(point)).collect();
            Some((solved?, self.spacing(level)))
        })
    }

    fn spacing(&self, level: u32) -> JointVector {
        (0..self.space.joints()).map(|a| self.space.step(level, a)).collect()
    }
}

impl Lattice for HeldNodes {
    type Point = Point;
    type Row = Solved;

    fn configuration(&self, (level, place): Point) -> JointVector {
        self.space.configuration(level, &place)
    }

    fn neighbours(&self, (own, place): Point) -> impl Iterator<Item = (Point, JointVector)> {
        let beside = (own..self.space.levels()).flat_map(move |level| {
            let (here, last) = (place.map(|i| i << (level - own)), self.space.last(level));
            let along = move |a: usize| {
                let lines = [here[a].checked_sub(1), (here[a] < last[a]).then_some(here[a] + 1)];
                lines.into_iter().flatten().map(move |line| {
                    let mut there = here;
                    there[a] = line;
                    there
                })
            };
            let spacing = self.spacing(level);
            (0..self.space.joints()).flat_map(along).map(move |there| (self.space.owner(level, there), spacing))
        });
        beside.filter(|(point, _)| self.held.contains_key(point))
    }

    fn status(&self, point: Point) -> Status {
        self.held.get(&point).map_or(Status::Outside, |held| held.result.status)
    }

    fn result(&self, point: Point) -> PointResult {
        let unknown = || PointResult::of(&Equilibrium::free(0.0, self.space.joints()));
        self.held.get(&point).map_or_else(unknown, |held| held.result)
    }

    fn forces(&self, point: Point) -> Vec<NodeForce> {
        let forces = self.held.get(&point).map_or(&[][..], |held| &held.forces);
        forces.iter().map(|&(node, force)| NodeForce { node, force: force.as_dvec3() }).collect()
    }

    fn row(&self, solver: &mut Solver<'_>, q: &JointVector, found: &Equilibrium) -> Solved {
        holding(solver, q, found, &self.scale)
    }

    fn replace(&mut self, found: BTreeMap<Point, Solved>) {
        for (point, row) in found {
            if let Some(before) = self.held.insert(point, row) {
                let PointResult { status, energy, .. } = before.result;
                self.from_rest.entry(point).or_insert((status, energy));
            }
        }
    }
}

/// Solves nodes, each once.
pub(super) struct Nodebook<'a, B> {
    pub nodes: HeldNodes,
    backend: &'a mut B,
    /// A good number of configurations for one call of it.
    batch: usize,
    solvers: Solvers<'a>,
    /// What the search for lower equilibria took; `None` where the algorithm has none.
    lowered: Option<Lowered>,
    /// Notices of the backend.
    pub notices: Vec<String>,
}

impl<'a, B: Backend> Nodebook<'a, B> {
    /// Nodes of `space`, none of which is solved. Contact is solved by `backend`, `batch` configurations at a time,
    /// all else by `solvers`; with `lowest` lower equilibria are searched for.
    pub fn new(
        (space, scale): (Space, Scale),
        (backend, batch): (&'a mut B, usize),
        solvers: Solvers<'a>,
        lowest: bool,
    ) -> Self {
        let nodes = HeldNodes { space, scale, held: HashMap::new(), from_rest: HashMap::new() };
        Self { nodes, backend, batch, solvers, lowered: lowest.then(Lowered::default), notices: Vec::new() }
    }

    /// Solves those of `nodes` of `level` that are not, and lowers them and others by one another.
    ///
    /// # Errors
    /// When the backend fails.
    pub fn solve(&mut self, level: u32, nodes: impl IntoIterator<Item = Place>) -> Result<(), Error> {
        let wanted: BTreeSet<Place> = nodes.into_iter().filter(|node| self.nodes.get(level, node).is_none()).collect();
        let wanted: Vec<Place> = wanted.into_iter().collect();
        for places in wanted.chunks(self.batch.max(1)) {
            let Self { nodes, backend, solvers, .. } = self;
            let configurations: Vec<JointVector> =
                places.iter().map(|place| nodes.space.configuration(level, place)).collect();
            let solved = solve_all(*backend, solvers, &configurations, &nodes.scale)
                .map_err(|why| error!("the backend failed: {why}"))?;
            let first = nodes.count();
            let notices = backend.notices().into_iter();
            self.notices.extend(notices.map(|notice| format!("from the store's node {first} on: {notice}")));
            let points = places.iter().map(|place| (level, *place));
            nodes.held.extend(points.zip(solved));
        }
        self.lower(&wanted.into_iter().map(|place| (level, place)).collect());
        Ok(())
    }

    /// Replaces equilibria of the nodes that are `new` and of their neighbours by lower ones, and so on.
    fn lower(&mut self, new: &BTreeSet<Point>) {
        let Some(lowered) = self.lowered.as_mut().filter(|_| !new.is_empty()) else { return };
        let (start, never) = (Instant::now(), AtomicBool::new(false));
        let beside = new.iter().flat_map(|&point| self.nodes.neighbours(point)).map(|(beside, _)| beside);
        let first: BTreeSet<Point> = new.iter().copied().chain(beside).collect();
        let first = std::iter::once(first.into_iter().collect());
        settle(&mut self.nodes, &self.solvers, first, |point| new.contains(&point), &never, lowered);
        lowered.seconds += start.elapsed().as_secs_f64();
    }

    /// Returns what the search for lower equilibria did; `None` where there was none.
    pub fn lowered(&self) -> Option<Lowered> {
        let mut lowered = self.lowered?;
        self.nodes
            .from_rest
            .iter()
            .for_each(|(point, before)| lowered.count(*before, self.nodes.result(*point).energy));
        Some(lowered)
    }
}
