//! A store filled level by level, where the interpolation errs.
//!
//! *Estimate.* At a node of level l the torque that the levels below give errs by e = |tau_interpolated - tau_solved|:
//! the two interpolations that meet there differ by the node's surplus. A cell of level l - 1 that is refined takes all
//! nodes of level l in it; each of its halves, 2^d cells of level l, is expected to err by the rms of e over the nodes
//! of level l at its corners, times the ratio by which e fell from the last level to this one. The cells of the base
//! are probed at their middles, which are nodes of the first level, and expected to err by a share of the torque at
//! their corners at least: contact that no node of the base and no middle meets is not seen.
//!
//! *Marking.* Cells with the greatest expected error are refined until those that are not add up to at most half of
//! what is left of the squared error: with that, each level leaves less to the next. (Doerfler 1996, A convergent
//! adaptive algorithm for Poisson's equation, with the complement of the bulk.)
//!
//! *Verification.* The error is measured at random configurations that no estimate has seen. While it is above the aim
//! the store is filled again, for a smaller error, from the nodes that are solved and some more.

use super::{
    node::{self, Scale, Solved},
    reference::{Reference, ReferenceError},
};
use crate::{
    JointVector, MAX_JOINTS,
    contact::{Model, Solvers, Status},
    dataset::Grid,
    scene::{JointKind, Scene},
    store::{Nodes, Order, Place, PublishError, Space, SpaceError, Store},
    tolerances::LEVER_ARM,
};
use std::collections::{BTreeMap, BTreeSet, HashMap};

/// Ratio of the internal aims of two rounds [1]. Larger: more rounds. Smaller: more nodes than needed.
const TIGHTER: f64 = 0.75;

/// Most rounds: the internal aim is then a twentieth of the first.
const ROUNDS: usize = 12;

/// Squared error of a cell over that at its middle [1]: of the product of parabolas in three dimensions (8/15)^3 =
/// 0.15, of a kink anywhere more. Measured on datasets/sphere.toml, potential: an aim of 5 % gives an estimate of 3.7 %
/// and an error of 4.4 %, one of 1.2 % 1.1 % and 1.1 %. Smaller: the error is thought to be smaller than it is, and
/// more rounds are needed.
const SPREAD: f64 = 1.0;

/// Ratio of the errors of two levels that is expected at least, and of the first two [1]. Larger: the next level is
/// refined more widely. Smooth fields gain a factor of four to eight, kinks one of two; the sphere scene's first two
/// levels one of three.
const LEAST_FALL: f64 = 0.35;

/// Error that is expected of a cell of the base whatever its middle says, over the rms torque at its corners [1]: the
/// middle may be free, or met by chance. Larger: the first level is refined nearly everywhere in contact. Smaller:
/// contact near few corners is missed.
const UNSEEN: f64 = 0.3;

/// Options of a store.
pub struct Refine<'a> {
    /// Object and proxy; with tangents for [`Order::Potential`].
    pub model: &'a Model<'a>,
    /// The base.
    pub base: Grid,
    /// Most levels, the base included.
    pub levels: u32,
    /// How it is to interpolate.
    pub order: Order,
    /// Rms error of the torque, over the rms of the torque [1].
    pub aim: f64,
    /// Most nodes that are solved.
    pub most: usize,
}

/// A filled store, and how it was filled.
pub struct Refined {
    /// The store.
    pub store: Store,
    /// Nodes in it.
    pub nodes: usize,
    /// Nodes of each level.
    pub by_level: Vec<usize>,
    /// Equilibria solved in contact, all rounds.
    pub equilibria: usize,
    /// Nodes solved, all rounds; some may be left out of the store.
    pub solved: usize,
    /// Rms error at the configurations by which the filling was stopped, over the rms torque [1].
    pub measured: f64,
    /// Rms error that was expected from the estimate of the last round [1].
    pub estimated: f64,
    /// Rounds.
    pub rounds: usize,
}

/// A store cannot be filled.
#[derive(Debug, thiserror::Error)]
pub enum RefineError {
    /// The base cannot be refined so often.
    #[error(transparent)]
    Space(#[from] SpaceError),
    /// A solved block was refused.
    #[error(transparent)]
    Publish(#[from] PublishError),
    /// No threads.
    #[error(transparent)]
    Threads(#[from] rayon::ThreadPoolBuildError),
}

/// Random configurations, solved directly, with which interpolations are compared.
pub struct Judge(Reference);

impl Judge {
    /// Draws configurations in the grid of `scene` until `contacts` of them are in contact, the same ones every time
    /// for the same `seed`.
    ///
    /// # Errors
    /// When nothing touches.
    pub fn new(scene: &Scene, model: &Model<'_>, seed: u64, contacts: usize) -> Result<Self, ReferenceError> {
        Reference::in_contact(scene, model, seed, contacts).map(Self)
    }

    /// Rms of the torque [N m].
    #[must_use]
    pub fn torque(&self) -> f64 {
        self.0.torque
    }

    /// Rms error of the torque that `answer` gives, over the rms of the torque [1].
    pub fn relative_error(&self, answer: impl FnMut(&JointVector) -> JointVector) -> f64 {
        self.0.errors(answer).0 / self.0.torque
    }
}

/// A cell that may be refined, and its expected error [N m].
struct Cell {
    low: Place,
    error: f64,
}

/// Solves nodes, each once.
struct Nodebook<'a> {
    space: Space,
    scale: Scale,
    levers: JointVector,
    pool: rayon::ThreadPool,
    solvers: Solvers<'a>,
    solved: HashMap<(u32, Place), Solved>,
}

impl Nodebook<'_> {
    /// Solves those of `nodes` of `level` that are not.
    fn solve(&mut self, level: u32, nodes: impl IntoIterator<Item = Place>) {
        let wanted: BTreeSet<Place> =
            nodes.into_iter().filter(|node| !self.solved.contains_key(&(level, *node))).collect();
        let wanted: Vec<Place> = wanted.into_iter().collect();
        let (space, scale) = (&self.space, &self.scale);
        let solvers = &self.solvers;
        let solve =
            || solvers.map(&wanted, |solver, place| node::solve(solver, &space.configuration(level, place), scale));
        let solved = self.pool.install(solve);
        self.solved.extend(wanted.iter().map(|place| (level, *place)).zip(solved));
    }

    /// Rms of the torque at the corners of a cell of the base [N m].
    fn torque(&self, low: &Place) -> f64 {
        let corners = 1_usize << self.space.joints();
        let solved = (0..corners).filter_map(|set| self.solved.get(&(0, corner(low, set))));
        let squares = solved.map(|solved| {
            let parts = solved.torque.iter().zip(self.levers.iter());
            parts.map(|(tau, lever)| (lever * tau).powi(2)).sum::<f64>()
        });
        (squares.sum::<f64>() / corners as f64).sqrt()
    }

    /// Distance of the torque that `store` gives at a solved node from the solved one; zero where that did not converge
    /// [N m].
    fn error(&self, store: &Store, level: u32, node: &Place) -> f64 {
        let Some(solved) = self.solved.get(&(level, *node)) else { return 0.0 };
        if !matches!(solved.status, Status::Free | Status::Contact) {
            return 0.0;
        }
        let torque = store.sample(&self.space.configuration(level, node)).torque();
        let parts = torque.iter().zip(solved.torque.iter()).zip(self.levers.iter());
        parts.map(|((a, b), lever)| (lever * (a - b)).powi(2)).sum::<f64>().sqrt()
    }
}

impl Refine<'_> {
    /// Fills a store until its error at the configurations of `judge` is at most the aim, or nothing more can be done.
    ///
    /// # Errors
    /// [`RefineError`].
    pub fn fill(&self, judge: &Judge) -> Result<Refined, RefineError> {
        let reference = &judge.0;
        let space = Space::new(&self.base, self.levels)?;
        let pool = rayon::ThreadPoolBuilder::new().build()?;
        let mut levers = JointVector::zeros(space.joints());
        levers.iter_mut().zip(&self.model.chain.joints).for_each(|(lever, joint)| {
            *lever = if joint.kind == JointKind::Prismatic { LEVER_ARM } else { 1.0 };
        });
        let mut book = Nodebook {
            scale: Scale::new(self.model, &space),
            space,
            levers,
            solvers: Solvers::new(self.model, pool.current_num_threads()),
            pool,
            solved: HashMap::new(),
        };
        let mut aim = self.aim * reference.torque;
        let mut rounds = 0;
        loop {
            rounds += 1;
            let measure = |store: &Store| reference.errors(|q| store.sample(q).torque()).0 / reference.torque;
            let (store, estimated) = self.round(&mut book, aim, &measure)?;
            let measured = measure(&store);
            let done = measured <= self.aim || rounds == ROUNDS || book.solved.len() >= self.most;
            if done {
                return Ok(self.report(store, &book, measured, estimated / reference.torque, rounds));
            }
            aim *= TIGHTER;
        }
    }

    fn report(&self, store: Store, book: &Nodebook<'_>, measured: f64, estimated: f64, rounds: usize) -> Refined {
        let mut by_level = vec![0; self.levels as usize];
        for (key, block) in store.blocks() {
            if let Some((level, _)) = book.space.block(key) {
                by_level[level as usize] += block.nodes().count();
            }
        }
        Refined {
            nodes: by_level.iter().sum(),
            by_level,
            equilibria: book.solved.values().map(|solved| solved.equilibria as usize).sum(),
            solved: book.solved.len(),
            store,
            measured,
            estimated,
            rounds,
        }
    }

    /// Fills a store for an rms error of `aim` [N m], level by level until `measure` says that it is kept; also the
    /// error that is expected of it.
    fn round(
        &self,
        book: &mut Nodebook<'_>,
        aim: f64,
        measure: &impl Fn(&Store) -> f64,
    ) -> Result<(Store, f64), RefineError> {
        let space = book.space.clone();
        let mut store = Store::new(space.clone(), self.order, 0);
        let base = lattice(&space, |last| last);
        book.solve(0, base.iter().copied());
        publish(&mut store, book, 0, &base.into_iter().collect())?;
        let cells: Vec<Place> = lattice(&space, |last| last - 1);
        let middles: Vec<Place> = cells.iter().map(|low| odd(&space, low)).collect();
        if self.levels > 1 {
            book.solve(1, middles.iter().copied());
        }
        let mut leaves: Vec<Cell> = cells
            .into_iter()
            .zip(&middles)
            .map(|(low, middle)| {
                let error = book.error(&store, 1, middle).max(UNSEEN * book.torque(&low));
                Cell { low, error }
            })
            .collect();
        let count = leaves.len() as f64;
        let (mut left, mut before) = (0.0, 0.0);
        for level in 1..self.levels {
            // Volume of a cell of the level below, over that of the grid.
            let share = 0.5_f64.powi((space.joints() as u32 * (level - 1)) as i32) / count;
            let budget = 0.5 * (aim * aim - left).max(0.0);
            // Expectations of a level that is not there yet may be far too high.
            if measure(&store) <= self.aim {
                let rest = leaves.iter().map(|cell| cell.error.powi(2)).sum::<f64>();
                return Ok((store, (left + SPREAD * share * rest).sqrt()));
            }
            let (marked, unmarked) = mark(leaves, budget / (SPREAD * share));
            left += SPREAD * share * unmarked;
            if marked.is_empty() || book.solved.len() >= self.most {
                left += SPREAD * share * marked.iter().map(|cell| cell.error.powi(2)).sum::<f64>();
                return Ok((store, left.sqrt()));
            }
            let nodes: BTreeSet<Place> = marked.iter().flat_map(|cell| inside(&space, &cell.low)).collect();
            book.solve(level, nodes.iter().copied());
            let errors: HashMap<Place, f64> =
                nodes.iter().map(|node| (*node, book.error(&store, level, node))).collect();
            publish(&mut store, book, level, &nodes)?;
            let mean = (errors.values().map(|e| e * e).sum::<f64>() / errors.len() as f64).sqrt();
            let fall = if before > 0.0 { (mean / before).clamp(LEAST_FALL, 1.0) } else { LEAST_FALL };
            before = mean;
            leaves = marked.iter().flat_map(|cell| halves(&space, &cell.low, &errors, fall)).collect();
        }
        let share = 0.5_f64.powi((space.joints() as u32 * (self.levels - 1)) as i32) / count;
        left += SPREAD * share * leaves.iter().map(|cell| cell.error.powi(2)).sum::<f64>();
        Ok((store, left.sqrt()))
    }
}

/// All places up to the one that `last` makes of the last node of the base, along each axis.
fn lattice(space: &Space, last: impl Fn(u32) -> u32) -> Vec<Place> {
    let mut places = vec![[0; MAX_JOINTS]];
    for a in 0..space.joints() {
        let grown = places.iter().flat_map(|place| {
            (0..=last(space.last(0)[a])).map(move |k| {
                let mut place = *place;
                place[a] = k;
                place
            })
        });
        places = grown.collect();
    }
    places
}

/// The corner of a cell on the far side along the axes in `set`.
fn corner(low: &Place, set: usize) -> Place {
    std::array::from_fn(|a| low[a] + (set >> a & 1) as u32)
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

/// The 2^d cells of the next level in a cell, each with the error that the nodes at its corners had before, times
/// `fall`.
fn halves(space: &Space, low: &Place, errors: &HashMap<Place, f64>, fall: f64) -> Vec<Cell> {
    let joints = space.joints();
    let first: Place = low.map(|i| 2 * i);
    (0..1 << joints)
        .map(|half| {
            let low = corner(&first, half);
            let known: Vec<f64> = (0..1 << joints).filter_map(|set| errors.get(&corner(&low, set)).copied()).collect();
            let square = known.iter().map(|e| e * e).sum::<f64>() / known.len().max(1) as f64;
            Cell { low, error: fall * square.sqrt() }
        })
        .collect()
}

/// The cells to refine, and the sum of the squared errors of the others, at most `budget`.
fn mark(mut cells: Vec<Cell>, budget: f64) -> (Vec<Cell>, f64) {
    cells.sort_by(|a, b| b.error.total_cmp(&a.error).then(a.low.cmp(&b.low)));
    let mut rest = 0.0;
    while let Some(last) = cells.last() {
        let square = last.error.powi(2);
        if rest + square > budget && square > 0.0 {
            break;
        }
        rest += square;
        cells.pop();
    }
    (cells, rest)
}

/// Publishes `nodes` of `level`, all solved, with whatever empty blocks they rest on.
fn publish(store: &mut Store, book: &Nodebook<'_>, level: u32, nodes: &BTreeSet<Place>) -> Result<(), PublishError> {
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
            if let Some(solved) = book.solved.get(&(level, node)) {
                published.push(place, &solved.record, solved.gap, solved.status);
            }
        }
    }
    store.reserve(store.blocks().len() + blocks.len());
    blocks.into_iter().try_for_each(|((level, block), nodes)| store.publish(level, &block, nodes))
}
