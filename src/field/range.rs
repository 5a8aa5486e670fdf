//! The haptized range: where the contact torque is known, and so where the proxy may go.
//!
//! Beyond the grid nothing was solved. Were the proxy to leave the grid in contact, its torque would fall to zero in
//! the middle of the object. So the range ends at the grid like a joint at its limit: the proxy is stopped there, and
//! the virtual coupling holds the device with its stiffness Kvc, to which the passivity bounds of the coupling apply.
//!
//! *Free space beyond the grid* belongs to the range where it is proven free. The clearance c(x) (m) is a lower bound
//! of the distance between proxy and object, the greater of
//! - `gap_p - sum_a r_a |x_a - q_pa|`, the greatest over all grid points p: no node moves by more than r_a for a unit
//!   of joint a (the greatest of [`Chain::jacobian_bounds`]);
//! - the distance of the proxy's nodes at x from the box around the object at rest.
//!
//! A dataset of a real object has no gaps. There a free border is taken to be free beyond, and c counts grid steps from
//! the nearest point in contact to the border beside x, with r_a one over the spacing.
//!
//! *Stops.* c changes by no more than `sum_a r_a |dx_a|`. In one step the proxy may go by `c / (2 d r_a)` along each of
//! the d joints, which leaves half of c: outside the grid it never reaches what is not known to be free. In the grid it
//! may instead go anywhere in the grid, and does so where that is farther at its speed. x lies within its stops, which
//! is what keeps the step passive (`render/npmi/stops.rs`).

use super::{
    points::{Checked, Generations, plausible},
    unfit,
};
use crate::{
    Error, JointVector, MAX_JOINTS,
    contact::Status,
    dataset::{Axis, Dataset, Grid},
    proxy::{Chain, Node},
};
use glam::DVec3;

/// Least c that counts outside the grid [m; steps for measured datasets]: a thousand times its rounding, and in a
/// second of steps towards the object a nanometre.
const CREEP: f64 = 1e-12;

/// By how much rounding may carry x over the grid's border, over the spacing (1).
const RIM: f64 = 1e-9;

/// Least and greatest coordinate of each joint (rad or m).
pub type Stops = [[f64; 2]; MAX_JOINTS];

/// The haptized range of a dataset.
pub struct HaptizedRange {
    grid: Grid,
    ends: Stops,
    /// Absent where nothing beyond the grid is known or can be reached.
    beyond: Option<Beyond>,
}

/// Knowledge of the space beyond the grid.
struct Beyond {
    /// Joints that can leave the grid.
    open: [bool; MAX_JOINTS],
    /// c at each grid point, zero in contact (m; steps for measured datasets).
    clearances: Vec<f32>,
    /// r_a (m/rad, or 1; 1/rad or 1/m for measured datasets).
    levers: JointVector,
    /// Absent for measured datasets.
    object: Option<Surroundings>,
}

/// Raises `clearances` at the points of `grid` to the greatest `clearance_p - sum_a r_a |q_a - q_pa|` over all
/// points p, r in `levers`: axis by axis, there and back.
fn spread(grid: &Grid, levers: &JointVector, clearances: &mut [f32]) {
    for (a, (axis, lever)) in grid.axes.iter().zip(levers.iter()).enumerate() {
        let loss = (axis.step * lever) as f32;
        let mut raise = |point: usize, from: Option<usize>| {
            if let Some(from) = from {
                clearances[point] = clearances[point].max(clearances[from] - loss);
            }
        };
        for point in 0..grid.points() {
            raise(point, grid.beside(point, a)[0]);
        }
        for point in (0..grid.points()).rev() {
            raise(point, grid.beside(point, a)[1]);
        }
    }
}

/// The proxy beside the object's box.
struct Surroundings {
    chain: Chain,
    /// Least and greatest corner (m).
    corners: [DVec3; 2],
}

impl HaptizedRange {
    /// The grid alone: nothing is known beyond.
    #[must_use]
    pub fn of_grid(grid: &Grid) -> Self {
        let mut ends = [[0.0; 2]; MAX_JOINTS];
        ends.iter_mut().zip(&grid.axes).for_each(|(ends, axis)| *ends = [axis.start, axis.last()]);
        Self { grid: grid.clone(), ends, beyond: None }
    }

    /// The range of `dataset`, with the free space that `chain` can reach beyond its grid.
    ///
    /// # Errors
    /// When the dataset is not consistent, or a gap is not a number.
    pub fn new(dataset: &Dataset, chain: &Chain) -> Result<Self, Error> {
        let grid = &dataset.grid;
        grid.check().map_err(unfit)?;
        let mut range = Self::of_grid(grid);
        let mut open = [false; MAX_JOINTS];
        let mut reached = range.ends;
        for ((open, reached), joint) in open.iter_mut().zip(&mut reached).zip(&chain.joints) {
            *open = joint.limits[0] < reached[0] || joint.limits[1] > reached[1];
            *reached = [reached[0].min(joint.limits[0]), reached[1].max(joint.limits[1])];
        }
        let is_known = dataset.status.iter().any(|&number| number != Status::Outside as u8);
        if open.contains(&true) && (is_known || dataset.refinement.is_none()) {
            let data = Checked::new(dataset)?;
            range.beyond = Some(match &dataset.gap {
                Some(gap) => {
                    let clearance = |(point, &gap): (usize, &f32)| {
                        plausible("gap", point, gap.into())?;
                        Ok(if dataset.status(point) == Status::Free { gap.max(0.0) } else { 0.0 })
                    };
                    let mut levers = JointVector::zeros(grid.joints());
                    for bounds in chain.jacobian_bounds(&reached) {
                        levers.iter_mut().zip(bounds.iter()).for_each(|(lever, bound)| *lever = lever.max(*bound));
                    }
                    let mut clearances = gap.iter().enumerate().map(clearance).collect::<Result<Vec<f32>, Error>>()?;
                    spread(grid, &levers, &mut clearances);
                    Beyond { open, clearances, levers, object: Surroundings::new(dataset, chain) }
                }
                None => {
                    let steps = Generations::new(grid, |point| data.points[data.nearest[point]].in_contact).steps;
                    let levers = grid.axes.iter().map(|axis| 1.0 / axis.step).collect();
                    let clearances = steps.into_iter().map(|steps| steps as f32).collect();
                    Beyond { open, clearances, levers, object: None }
                }
            });
        }
        Ok(range)
    }

    /// The stops of a step of `interval` T (s) from `x` at `velocity`, within `limits`, between which x lies. Never
    /// allocates.
    #[must_use]
    pub fn stops(&self, x: &JointVector, velocity: &JointVector, interval: f64, limits: &Stops) -> Stops {
        let mut reach = JointVector::zeros(x.len());
        if let Some(beyond) = &self.beyond {
            // Halved from step to step c is rounded to nothing in the end. Then the way to the grid, axis by axis, may
            // lead through the object: the proxy creeps until c grows again.
            let least = if self.contains(x) { 0.0 } else { CREEP };
            let share = 0.5 * beyond.clearance(self, x).max(least) / x.len() as f64;
            if share > 0.0 {
                reach.iter_mut().zip(beyond.levers.iter()).for_each(|(reach, lever)| *reach = share / lever);
            }
        }
        // Twice the way at this speed, so that the proxy can be faster at the end of the step.
        let is_enough =
            reach.iter().zip(velocity.iter()).all(|(reach, v)| *reach > 0.0 && *reach >= 2.0 * interval * v.abs());
        let is_free = is_enough || (reach.iter().all(|reach| *reach > 0.0) && !self.contains(x));
        let mut stops = *limits;
        for (a, (stop, &x)) in stops.iter_mut().zip(x.iter()).enumerate() {
            let [low, high] = if is_free { [x - reach[a], x + reach[a]] } else { self.ends[a] };
            *stop = [stop[0].max(low.min(x)), stop[1].min(high.max(x))];
        }
        stops
    }

    /// `x`, or the nearest configuration of the grid where nothing is known of `x`.
    #[must_use]
    pub fn nearest(&self, x: &JointVector) -> JointVector {
        let mut nearest = *x;
        if self.beyond.as_ref().is_none_or(|beyond| beyond.clearance(self, x) <= 0.0) {
            nearest.iter_mut().zip(self.ends).for_each(|(x, [least, greatest])| *x = x.clamp(least, greatest));
        }
        nearest
    }

    /// Whether `x` is in the grid, but for rounding.
    fn contains(&self, x: &JointVector) -> bool {
        let within = |((x, [least, greatest]), axis): ((&f64, [f64; 2]), &Axis)| {
            (least - RIM * axis.step..=greatest + RIM * axis.step).contains(x)
        };
        x.iter().zip(self.ends).zip(&self.grid.axes).all(within)
    }
}

impl Beyond {
    /// c at `x` of `range`; zero where x is so far within the grid that no step leaves it.
    fn clearance(&self, range: &HaptizedRange, x: &JointVector) -> f64 {
        let stencil = range.grid.locate(x);
        let mut travel = 0.0;
        let (mut sides, mut near) = ([[0.0; 2]; MAX_JOINTS], false);
        for (a, axis) in range.grid.axes.iter().enumerate() {
            let step = axis.step;
            let [least, greatest] = range.ends[a];
            near |= self.open[a] && !(x[a] > least + step && x[a] < greatest - step);
            let fraction = stencil.fractions[a];
            sides[a] = [fraction, 1.0 - fraction].map(|part| part * step * self.levers[a]);
            if self.object.is_some() {
                travel += (x[a] - x[a].clamp(least, greatest)).abs() * self.levers[a];
            }
        }
        if !near {
            return 0.0;
        }
        let mut clearance = 0.0;
        for corner in 0..stencil.count {
            let way: f64 = (0..x.len()).map(|a| sides[a][corner >> a & 1]).sum();
            clearance = f64::max(clearance, f64::from(self.clearances[stencil.points[corner]]) - way - travel);
        }
        self.object.as_ref().map_or(clearance, |object| clearance.max(object.distance(x)))
    }
}

impl Surroundings {
    fn new(dataset: &Dataset, chain: &Chain) -> Option<Self> {
        let nodes = dataset.surface.as_ref()?.places();
        let [least, greatest] = [DVec3::INFINITY, DVec3::NEG_INFINITY];
        let corners = nodes.fold([least, greatest], |[least, greatest], node| [least.min(node), greatest.max(node)]);
        Some(Self { chain: chain.clone(), corners })
    }

    /// Least distance of the proxy's nodes at `x` from the box (m); negative inside by no more than a node's radius.
    fn distance(&self, x: &JointVector) -> f64 {
        let links = self.chain.links(x);
        let of_node = |(i, node): (usize, &Node)| {
            let place = self.chain.node_position(&links, i);
            place.distance(place.clamp(self.corners[0], self.corners[1])) - node.radius
        };
        self.chain.nodes.iter().enumerate().map(of_node).fold(f64::INFINITY, f64::min)
    }
}
