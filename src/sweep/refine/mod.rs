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

use super::{
    node::{self, Scale, Solved},
    reference::{Reference, ReferenceError},
};
use crate::{
    JointVector, MAX_JOINTS,
    contact::{Model, Solvers, Status},
    dataset::Grid,
    scene::{JointKind, LEVER_ARM, Scene},
    store::{Nodes, Order, Place, PublishError, Space, SpaceError, Store},
};
use std::collections::{BTreeMap, BTreeSet, HashMap};

/// Standard deviations by which the measured squared error is to be below the aim's [1]. Larger: more nodes. Smaller:
/// other configurations see a larger error more often.
const CONFIDENCE: f64 = 1.0;

/// Nodes that a round adds at least, over those that are there [1]. Larger: more nodes than needed. Smaller: more
/// rounds.
const GROWTH: f64 = 0.05;

/// Ratio of the squared errors of two levels [1]: kinks of the torque, which are left when smooth errors have fallen,
/// err by h in a share h of the volume.
const FALL: f64 = 0.125;

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

    /// Number of configurations that were solved, free ones among them.
    #[must_use]
    pub fn solved(&self) -> usize {
        // Each is solved twice: see [`Reference::solve`].
        2 * (self.0.places.len() + self.0.left_out)
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
        let mut filling = self.begin()?;
        let aim = (self.aim * reference.torque).powi(2);
        let mut rounds = 0;
        loop {
            rounds += 1;
            let store = filling.store(self.order)?;
            let (mean, deviation) = reference.mean_square(|q| store.sample(q).torque());
            let refinable = filling.leaves.iter().any(|leaf| leaf.level + 1 < self.levels);
            // A store that errs by nothing has no deviation either.
            let reserve = 1.0 + CONFIDENCE * deviation / mean.max(f64::MIN_POSITIVE);
            if mean * reserve <= aim || !refinable || filling.book.solved.len() >= self.most {
                return Ok(self.report(store, &filling, mean.sqrt() / reference.torque, rounds));
            }
            filling.refine(&store, aim / (mean * reserve));
        }
    }

    /// The base alone.
    fn begin(&self) -> Result<Filling<'_>, RefineError> {
        let space = Space::new(&self.base, self.levels)?;
        let pool = rayon::ThreadPoolBuilder::new().build()?;
        let mut levers = JointVector::zeros(space.joints());
        levers.iter_mut().zip(&self.model.chain.joints).for_each(|(lever, joint)| {
            *lever = if joint.kind == JointKind::Prismatic { LEVER_ARM } else { 1.0 };
        });
        let mut book = Nodebook {
            scale: Scale::new(self.model, &space),
            space: space.clone(),
            levers,
            solvers: Solvers::new(self.model, pool.current_num_threads()),
            pool,
            solved: HashMap::new(),
        };
        let base = lattice(&space, |last| last);
        book.solve(0, base.iter().copied());
        let mut nodes = vec![BTreeSet::new(); self.levels as usize];
        nodes[0] = base.into_iter().collect();
        let leaves = lattice(&space, |last| last - 1).into_iter().map(|low| Leaf { level: 0, low, square: 0.0 });
        Ok(Filling { book, nodes, leaves: leaves.collect(), squares: HashMap::new() })
    }

    fn report(&self, store: Store, filling: &Filling<'_>, measured: f64, rounds: usize) -> Refined {
        let by_level: Vec<usize> = filling.nodes.iter().map(BTreeSet::len).collect();
        let solved = &filling.book.solved;
        Refined {
            nodes: by_level.iter().sum(),
            by_level,
            equilibria: solved.values().map(|solved| solved.equilibria as usize).sum(),
            solved: solved.len(),
            store,
            measured,
            rounds,
        }
    }
}

/// A cell that is not refined.
struct Leaf {
    level: u32,
    low: Place,
    /// Expected contribution to the squared error, over the volume of a cell of the base [N^2 m^2].
    square: f64,
}

/// A store that is being filled.
struct Filling<'a> {
    book: Nodebook<'a>,
    /// The nodes of each level.
    nodes: Vec<BTreeSet<Place>>,
    leaves: Vec<Leaf>,
    /// Squared errors that the levels below had at solved nodes [N^2 m^2].
    squares: HashMap<(u32, Place), f64>,
}

impl Filling<'_> {
    /// The store of what is there.
    fn store(&self, order: Order) -> Result<Store, PublishError> {
        let mut store = Store::new(self.book.space.clone(), order, 0);
        for (level, nodes) in (0..).zip(&self.nodes) {
            publish(&mut store, &self.book, level, nodes)?;
        }
        Ok(store)
    }

    /// Solves those of `nodes` of `level` that are not, and compares `store` with them.
    fn compare(&mut self, store: &Store, level: u32, nodes: &BTreeSet<Place>) {
        self.book.solve(level, nodes.iter().copied());
        for node in nodes {
            let book = &self.book;
            self.squares.entry((level, *node)).or_insert_with(|| book.error(store, level, node).powi(2));
        }
    }

    /// Sum of the squared errors at those of `nodes` of `level` that are solved, and their number.
    fn known(&self, level: u32, nodes: impl Iterator<Item = Place>) -> (f64, f64) {
        let known = nodes.filter_map(|node| self.squares.get(&(level, node)));
        known.fold((0.0, 0.0), |(sum, count), square| (sum + square, count + 1.0))
    }

    /// Expects an error of each leaf.
    fn expect(&mut self, store: &Store) {
        let space = self.book.space.clone();
        let joints = space.joints();
        let cells = lattice(&space, |last| last - 1);
        let middles = cells.iter().map(|low| odd(&space, low)).collect();
        self.compare(store, 1, &middles);
        let torque: f64 = cells.iter().map(|low| self.book.torque(low).powi(2)).sum();
        let share = self.known(1, middles.into_iter()).0 / torque.max(f64::MIN_POSITIVE);
        let expected = |Leaf { level, low, .. }: &Leaf| {
            let before = if *level == 0 {
                share * self.book.torque(low).powi(2)
            } else {
                let (sum, count) = self.known(*level, (0..1 << joints).map(|set| corner(low, set)));
                FALL * sum / count.max(1.0)
            };
            let (sum, count) = self.known(level + 1, inside(&space, low));
            0.5_f64.powi((joints as u32 * level) as i32) * (before + sum) / (1.0 + count)
        };
        let squares: Vec<f64> = self.leaves.iter().map(expected).collect();
        self.leaves.iter_mut().zip(squares).for_each(|(leaf, square)| leaf.square = square);
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
        let halves = 2.0_f64.powi(self.book.space.joints() as i32);
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
    fn refine(&mut self, store: &Store, goal: f64) {
        let space = self.book.space.clone();
        self.expect(store);
        let marked = self.mark(goal);
        for level in 0..self.nodes.len() as u32 - 1 {
            let cells = || marked.iter().filter(|leaf| leaf.level == level);
            let nodes: BTreeSet<Place> = cells().flat_map(|leaf| inside(&space, &leaf.low)).collect();
            self.compare(store, level + 1, &nodes);
            self.nodes[level as usize + 1].extend(nodes);
            let lows = cells().flat_map(|leaf| {
                let first = leaf.low.map(|i| 2 * i);
                (0..1 << space.joints()).map(move |half| corner(&first, half))
            });
            self.leaves.extend(lows.map(|low| Leaf { level: level + 1, low, square: 0.0 }));
        }
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
