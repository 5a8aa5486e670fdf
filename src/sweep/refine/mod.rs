//! A store filled round by round, where the interpolation errs.
//!
//! *Estimate.* At a solved node of level l the torque that the levels below gave errs by e = |tau_interpolated -
//! tau_solved|: the two interpolations that meet there differ by the node's surplus. A cell of level l - 1 that is not
//! refined is expected to err by the rms of e over the nodes of level l in it that are solved, those that it shares
//! with refined neighbours, and of one expectation more: e at its own corners, before they were there, times the
//! factor by which kinks fall from one level to the next. The cells of the base are probed at their middles, which are
//! nodes of the first level. The middle may be free, or met by chance: their further expectation is the torque at
//! their corners, times the rms of e over that of the torque, over all cells.
//!
//! *Scale.* Of the estimates only the ratios count. The error is measured at random configurations that no estimate
//! has seen, and the estimates are scaled so that they add up to it. It keeps the aim when it does so by one standard
//! deviation of such a measurement.
//!
//! *Marking.* Cells of any level are refined that contribute most to the squared error, as few as are expected to leave
//! no more than the aim. (Doerfler 1996, A convergent adaptive algorithm for Poisson's equation, whose bulk is a fixed
//! share; here it follows from the aim.) Cells in which no error is expected wait until no others are left. The store
//! is measured again, until it keeps the aim.
//!
//! *Backend.* The new nodes of a level are solved together by any [`Backend`]. All else runs on the CPU: searches for
//! the boundary of contact (`node.rs`), for lower equilibria (`nodebook.rs`), and what is measured.

mod judge;
mod nodebook;

use super::{
    Lowered,
    lowest::applies,
    node::{Scale, Solved},
    reference::{REFERENCE_TOLERANCE, Reference, tight},
    thin_parts,
};
use crate::{
    Error, JointVector,
    contact::{Backend, Model, Solvers, Status},
    dataset::Grid,
    scene::EffortNorm,
    store::{Nodes, Place, Space, Store, beyond, record::width},
};
use nodebook::{HeldNodes, Nodebook, held_bytes};
use serde::Serialize;
use std::collections::{BTreeMap, BTreeSet, HashMap};

/// Standard deviations by which the measured squared error is to be below the aim's (1). Larger: more nodes. Smaller:
/// other configurations see a larger error more often.
const CONFIDENCE: f64 = 1.0;

/// Nodes that a round adds at least, over those that are there (1). Larger: more nodes than needed. Smaller: more
/// rounds.
const GROWTH: f64 = 0.05;

/// Ratio of the squared errors of two levels (1): kinks of the torque, which are left when smooth errors have fallen,
/// err by h in a share h of the volume.
const FALL: f64 = 0.125;

/// Options of a store.
pub struct Refine<'a> {
    /// Object and proxy, with tangents ([`Model::with_tangent`]).
    pub model: &'a Model<'a>,
    /// The base.
    pub base: Grid,
    /// Most levels, the base included.
    pub levels: u32,
    /// Rms error of the torque, over the rms of the torque (1).
    pub aim: f64,
    /// Most nodes that are solved.
    pub most: usize,
    /// Configurations for one call of the backend (1); results do not depend on it.
    pub batch: usize,
}

/// A filled store, and how it was filled.
#[derive(Serialize)]
pub struct Refined {
    /// The store.
    #[serde(skip)]
    pub store: Store,
    /// Nodes in it.
    pub nodes: usize,
    /// Nodes of each level.
    pub by_level: Vec<usize>,
    /// Equilibria solved in contact, all rounds, searches for lower ones aside.
    pub equilibria: usize,
    /// Nodes solved, all rounds; some may be left out of the store.
    pub solved: usize,
    /// Rms error at the configurations by which the filling was stopped, over the rms torque (1).
    #[serde(skip)]
    pub measured: f64,
    /// Rounds.
    pub rounds: usize,
    /// Result of the search for lower equilibria, of all nodes solved; absent if there was none.
    pub lowered: Option<Lowered>,
    /// Notices of the backend, whose nodes are counted from zero in the order in which they were solved, and of thin
    /// parts of the object.
    #[serde(rename = "warnings")]
    pub notices: Vec<String>,
}

impl Refine<'_> {
    /// Fills a store, whose nodes `backend` solves, until its error at the configurations of the first of `judges` is
    /// at most the aim, or nothing more can be done. Equilibria of both judges are replaced by lower ones that are
    /// reached from the nodes.
    ///
    /// # Errors
    /// When the base cannot be refined so often, or the backend fails.
    pub fn fill<B: Backend>(&self, judges: &mut [Reference; 2], backend: &mut B) -> Result<Refined, Error> {
        let [seen, unseen] = judges;
        let exact = self.model.with_contact(tight(self.model.contact, REFERENCE_TOLERANCE));
        let solvers = Solvers::new(&exact, rayon::current_num_threads());
        let lowest = applies(self.model.contact.law);
        let mut filling = self.begin(backend, lowest)?;
        let mut rounds = 0;
        loop {
            rounds += 1;
            if lowest {
                seen.lower(&solvers, &filling.book.nodes);
            }
            let store = filling.store()?;
            let (mean, deviation) = seen.mean_square(|q| store.sample(q).torque());
            let aim = (self.aim * seen.torque).powi(2);
            let refinable = filling.leaves.iter().any(|leaf| leaf.level + 1 < self.levels);
            // A store that errs by nothing has no deviation either.
            let reserve = 1.0 + CONFIDENCE * deviation / mean.max(f64::MIN_POSITIVE);
            if mean * reserve <= aim || !refinable || filling.book.nodes.count() >= self.most {
                if lowest {
                    unseen.lower(&solvers, &filling.book.nodes);
                }
                let mut refined = filling.report(store, mean.sqrt() / seen.torque, rounds);
                refined.notices.extend(thin_parts::of_store(self.model, &refined.store));
                return Ok(refined);
            }
            filling.refine(&store, aim / (mean * reserve))?;
        }
    }

    /// Memory that `nodes` nodes take beside their store while it is filled, if contact has forces on so many of the
    /// object's nodes as those of `judge` have (bytes).
    #[must_use]
    pub fn filling_bytes(&self, nodes: usize, judge: &Reference) -> usize {
        let numbers = width(self.base.joints()) * (1 + usize::from(self.model.with_slip));
        (nodes as f64 * held_bytes(numbers, judge.mean_forces())).ceil() as usize
    }

    /// The base alone.
    fn begin<'a, B: Backend>(&'a self, backend: &'a mut B, lowest: bool) -> Result<Filling<'a, B>, Error> {
        let space = Space::new(&self.base, self.levels)?;
        let norm = EffortNorm::new(self.model.chain.joints.iter().map(|joint| joint.kind.unit()));
        let scale = Scale::new(self.model, &space);
        let solvers = Solvers::new(self.model, rayon::current_num_threads());
        let mut book = Nodebook::new((space.clone(), scale), (backend, self.batch), solvers, lowest);
        book.solve(0, space.base_nodes())?;
        let mut nodes = vec![BTreeSet::new(); self.levels as usize];
        nodes[0] = space.base_nodes().collect();
        let leaves = space.base_cells().map(|low| Leaf { level: 0, low, square: 0.0 });
        Ok(Filling { book, norm, nodes, leaves: leaves.collect(), squares: HashMap::new() })
    }
}

/// A cell that is not refined.
struct Leaf {
    level: u32,
    low: Place,
    /// Expected contribution to the squared error, over the volume of a cell of the base (N^2 m^2).
    square: f64,
}

/// A store that is being filled.
struct Filling<'a, B> {
    book: Nodebook<'a, B>,
    norm: EffortNorm,
    /// The nodes of each level.
    nodes: Vec<BTreeSet<Place>>,
    leaves: Vec<Leaf>,
    /// Squared errors that the levels below had at solved nodes (N^2 m^2).
    squares: HashMap<(u32, Place), f64>,
}

impl<B: Backend> Filling<'_, B> {
    /// The store of what is there.
    fn store(&self) -> Result<Store, Error> {
        let mut store = Store::new(self.book.nodes.space.clone());
        for (level, nodes) in (0..).zip(&self.nodes) {
            publish(&mut store, &self.book.nodes, level, nodes)?;
        }
        Ok(store)
    }

    fn report(&self, store: Store, measured: f64, rounds: usize) -> Refined {
        let by_level: Vec<usize> = self.nodes.iter().map(BTreeSet::len).collect();
        Refined {
            nodes: by_level.iter().sum(),
            by_level,
            equilibria: self.book.nodes.equilibria(),
            solved: self.book.nodes.count(),
            store,
            measured,
            rounds,
            lowered: self.book.lowered(),
            notices: self.book.notices.clone(),
        }
    }

    /// Rms of the torque at the corners of a cell of the base (N m).
    fn torque(&self, low: &Place) -> f64 {
        let corners = 1_usize << self.book.nodes.space.joints();
        let solved = (0..corners).filter_map(|set| self.book.nodes.get(0, &beyond(low, set)));
        let zero = JointVector::zeros(self.book.nodes.space.joints());
        let squares = solved.map(|held| self.norm.square(&held.result.torque, &zero));
        (squares.sum::<f64>() / corners as f64).sqrt()
    }

    /// Squared distance of the torque that `store` gives at a solved node from the solved one; zero where that did not
    /// converge (N^2 m^2).
    fn square(&self, store: &Store, level: u32, node: &Place) -> f64 {
        let nodes = &self.book.nodes;
        let Some(held) = nodes.get(level, node) else { return 0.0 };
        if !matches!(held.result.status, Status::Free | Status::Contact) {
            return 0.0;
        }
        let torque = store.sample(&nodes.space.configuration(level, node)).torque();
        self.norm.square(&torque, &held.result.torque)
    }

    /// Solves those of `nodes` of `level` that are not, and compares `store` with them.
    fn compare(&mut self, store: &Store, level: u32, nodes: &BTreeSet<Place>) -> Result<(), Error> {
        self.book.solve(level, nodes.iter().copied())?;
        for node in nodes {
            if !self.squares.contains_key(&(level, *node)) {
                self.squares.insert((level, *node), self.square(store, level, node));
            }
        }
        Ok(())
    }

    /// Sum of the squared errors at those of `nodes` of `level` that are solved, and their number.
    fn known(&self, level: u32, nodes: impl Iterator<Item = Place>) -> (f64, f64) {
        let known = nodes.filter_map(|node| self.squares.get(&(level, node)));
        known.fold((0.0, 0.0), |(sum, count), square| (sum + square, count + 1.0))
    }

    /// Expects an error of each leaf.
    fn expect(&mut self, store: &Store) -> Result<(), Error> {
        let space = self.book.nodes.space.clone();
        let joints = space.joints();
        let cells: Vec<Place> = space.base_cells().collect();
        let middles = cells.iter().map(|low| odd(&space, low)).collect();
        self.compare(store, 1, &middles)?;
        let torque: f64 = cells.iter().map(|low| self.torque(low).powi(2)).sum();
        let share = self.known(1, middles.into_iter()).0 / torque.max(f64::MIN_POSITIVE);
        let expected = |Leaf { level, low, .. }: &Leaf| {
            let before = if *level == 0 {
                share * self.torque(low).powi(2)
            } else {
                let (sum, count) = self.known(*level, (0..1 << joints).map(|set| beyond(low, set)));
                FALL * sum / count.max(1.0)
            };
            let (sum, count) = self.known(level + 1, inside(&space, low));
            0.5_f64.powi((joints as u32 * level) as i32) * (before + sum) / (1.0 + count)
        };
        let squares: Vec<f64> = self.leaves.iter().map(expected).collect();
        self.leaves.iter_mut().zip(squares).for_each(|(leaf, square)| leaf.square = square);
        Ok(())
    }

    /// Takes the leaves to refine for a squared error of `goal` times the present one: those that err most, and no
    /// fewer than are worth a round.
    fn mark(&mut self, goal: f64) -> Vec<Leaf> {
        let last = self.nodes.len() as u32 - 1;
        self.leaves.sort_by(|a, b| {
            let refinable = (a.level == last).cmp(&(b.level == last));
            refinable.then(b.square.total_cmp(&a.square)).then((a.level, a.low).cmp(&(b.level, b.low)))
        });
        let mut refinable = self.leaves.partition_point(|leaf| leaf.level < last);
        // Leaves in which nothing is expected wait until no others are left: most of them lie in free space.
        let erring = self.leaves[..refinable].partition_point(|leaf| leaf.square > 0.0);
        if erring > 0 {
            refinable = erring;
        }
        // In bulk a refined cell adds as many nodes as it has halves.
        let halves = 2.0_f64.powi(self.book.nodes.space.joints() as i32);
        let there: usize = self.nodes.iter().map(BTreeSet::len).sum();
        let least = (GROWTH * there as f64 / halves).ceil() as usize;
        let whole: f64 = self.leaves.iter().map(|leaf| leaf.square).sum();
        let (mut left, mut count) = (whole, 0);
        while count < refinable && (count < least || left > goal * whole) {
            left -= (1.0 - FALL) * self.leaves[count].square;
            count += 1;
        }
        self.leaves.drain(..count).collect()
    }

    /// Refines for a squared error of `goal` times that of `store`, which is the store of what is there.
    fn refine(&mut self, store: &Store, goal: f64) -> Result<(), Error> {
        let space = self.book.nodes.space.clone();
        self.expect(store)?;
        let marked = self.mark(goal);
        for level in 0..self.nodes.len() as u32 - 1 {
            let cells = || marked.iter().filter(|leaf| leaf.level == level);
            let nodes: BTreeSet<Place> = cells().flat_map(|leaf| inside(&space, &leaf.low)).collect();
            self.compare(store, level + 1, &nodes)?;
            self.nodes[level as usize + 1].extend(nodes);
            let lows = cells().flat_map(|leaf| {
                let first = leaf.low.map(|i| 2 * i);
                (0..1 << space.joints()).map(move |half| beyond(&first, half))
            });
            self.leaves.extend(lows.map(|low| Leaf { level: level + 1, low, square: 0.0 }));
        }
        Ok(())
    }
}

/// The node in the middle of a cell, of the next level.
fn odd(space: &Space, low: &Place) -> Place {
    std::array::from_fn(|a| if a < space.joints() { 2 * low[a] + 1 } else { 0 })
}

/// The nodes of the next level in a closed cell: 3^d - 2^d.
fn inside(space: &Space, low: &Place) -> impl Iterator<Item = Place> {
    let (joints, low) = (space.joints() as u32, *low);
    (0..3_u32.pow(joints)).filter_map(move |number| {
        let digit = |a: u32| number / 3_u32.pow(a) % 3;
        (0..joints)
            .any(|a| digit(a) == 1)
            .then(|| std::array::from_fn(|a| if (a as u32) < joints { 2 * low[a] + digit(a as u32) } else { 0 }))
    })
}

/// Publishes `nodes` of `level`, all solved, with whatever empty blocks they rest on.
fn publish(store: &mut Store, held: &HeldNodes, level: u32, nodes: &BTreeSet<Place>) -> Result<(), Error> {
    let space = store.space().clone();
    let mut blocks: BTreeMap<(u32, Place), Nodes> = BTreeMap::new();
    for node in nodes {
        blocks.entry((level, space.block_of(node))).or_default();
    }
    // From the finest down: what a block rests on, and what that rests on.
    for at in (1..=level).rev() {
        let above: Vec<Place> = blocks.keys().filter(|(l, _)| *l == at).map(|(_, block)| *block).collect();
        for (below, place) in above.iter().flat_map(|block| store.foundation(at, block)) {
            if store.get(below, &place).is_none() {
                blocks.entry((below, place)).or_default();
            }
        }
    }
    for ((at, block), published) in &mut blocks {
        for (place, node) in space.nodes(*at, block).filter(|(_, node)| *at == level && nodes.contains(node)) {
            if let Some(held) = held.get(level, &node) {
                let Solved { record, slip, result, .. } = held;
                published.push(place, record, slip, result.gap, result.status);
            }
        }
    }
    blocks.into_iter().try_for_each(|((level, block), nodes)| store.publish(level, &block, nodes))
}
