//! A node of the store: one configuration solved, and its root w.
//!
//! In contact `w = sqrt(2 U)` with its gradient and mixed derivatives, from energy, torque and tangent
//! (`store::root_of`). U and its gradient vanish at the boundary of contact, where U grows like the square of the
//! depth: w passes zero there with a slope, and is continued to free configurations, so that interpolation sees a
//! smooth function.
//!
//! *Limit.* Where an equilibrium is about to give way to another the tangent grows without bound, and at the onset of
//! contact its error is divided by a small w. So in steps h of the base no mixed derivative is larger than the largest
//! slope: `|w_ab| h_a h_b <= max_c |w_c| h_c`.
//!
//! *Free configurations.* The gap g and its gradient lead to the boundary: Newton steps `dq_a = -(g + e) h_a^2 g_a /
//! sum_b h_b^2 g_b^2`, h the base's spacing, end where g = -e, with e a share of the gap at the start. The contact
//! solved there gives w by Taylor's formula, `w(q) = w* + grad w* . (q - q*)`, at most zero. So a free node depends on
//! its own configuration and the base's spacing, and is the same whenever it is solved. Where the boundary is farther
//! than some cells of the base, or not found, w is `-sqrt(kc) g`, that of one contact spring; where it is farther by a
//! bound of the proxy's motion, without slopes.

use crate::{
    JointVector,
    contact::{Model, Solver, Status},
    field::{GRADIENT_STEP, LEAST_ENERGY, boundary::LEAST_GAP},
    scene::{Algorithm, Interpolation, Scene},
    store::{
        Order, Space,
        record::{mixed, slope, width},
        root_of,
    },
};

/// Depth behind the boundary at which contact is solved for a free node, over its gap [1]. Larger: the slope is that of
/// deeper contact, of which more nodes touch. Smaller: w is a root of less energy, which errs more.
const DEPTH_SHARE: f64 = 0.05;

/// Farthest boundary that is looked for, in cells of the base along any axis [1]: beyond, no cell of the node holds
/// contact.
const FARTHEST: f64 = 2.0;

/// Most Newton steps to the boundary: the gap is nearly linear, and each step squares the error.
const STEPS: usize = 6;

/// The scene's algorithm gives no energy with a tangent.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "the scene's algorithm is not \"energy\", and nodes that refine a grid need the energy of contact with its \
     tangent: set algorithm = \"energy\" in [contact], or bake the grid alone"
)]
pub struct NoEnergy;

/// Checks that nodes can be solved of `scene`.
///
/// # Errors
/// [`NoEnergy`] unless its algorithm is [`Algorithm::Energy`].
pub fn check_algorithm(scene: &Scene) -> Result<(), NoEnergy> {
    if scene.contact.algorithm == Algorithm::Energy { Ok(()) } else { Err(NoEnergy) }
}

/// Returns how a store is to interpolate that is filled for `scene`: as the scene asks for, where a store can.
#[must_use]
pub fn order_of(scene: &Scene) -> Order {
    if scene.haptics.interpolation == Interpolation::Linear { Order::Linear } else { Order::Potential }
}

/// A solved node.
#[derive(Clone, Debug)]
pub struct Solved {
    /// w, gradient, mixed derivatives; see [`crate::store::record`].
    pub record: Vec<f32>,
    /// Contact torque [N m or N].
    pub torque: JointVector,
    /// See [`crate::contact::Equilibrium::gap`] [m].
    pub gap: f32,
    /// Status.
    pub status: Status,
    /// Equilibria that were solved for it: none where nothing is near, two at most.
    pub equilibria: u32,
}

/// Everything on which a node depends beside its configuration.
pub(super) struct Scale {
    /// Spacing of the base along each axis [rad or m].
    steps: Vec<f64>,
    /// No node of the proxy moves farther when each joint moves by the base's spacing [m].
    reach: f64,
    /// Contact stiffness [N/m].
    kc: f64,
}

impl Scale {
    /// For nodes in `space`, solved by `model`.
    pub fn new(model: &Model<'_>, space: &Space) -> Self {
        let joints = space.joints();
        let steps: Vec<f64> = (0..joints).map(|a| space.step(0, a)).collect();
        let first = space.configuration(0, &[0; crate::MAX_JOINTS]);
        let last = space.configuration(0, &space.last(0));
        let ranges: Vec<[f64; 2]> = first.iter().zip(last.iter()).map(|(first, last)| [*first, *last]).collect();
        let bounds = model.chain.jacobian_bounds(&ranges);
        let reaches = bounds.iter().map(|bound| bound.iter().zip(&steps).map(|(lever, step)| lever * step).sum());
        let reach = reaches.fold(0.0, f64::max);
        Self { steps, reach, kc: model.kc }
    }

    /// No node of the proxy moves farther when each joint moves by the spacing of `level` [m].
    pub fn reach(&self, level: u32) -> f64 {
        self.reach * 0.5_f64.powi(level as i32)
    }
}

/// Solves the node at `q`.
pub(super) fn solve(solver: &mut Solver<'_>, q: &JointVector, scale: &Scale) -> Solved {
    let joints = q.len();
    let here = solver.solve(q);
    let touches = here.status.is_in_contact();
    let mut solved = Solved {
        record: vec![0.0; width(joints)],
        torque: here.torque,
        gap: here.gap as f32,
        status: here.status,
        equilibria: u32::from(touches),
    };
    let steps = &scale.steps;
    let record = if touches && here.energy > LEAST_ENERGY {
        let tangent: Option<Vec<f64>> = here.tangent.map(|tangent| tangent.lower().collect());
        root_of(here.energy, &here.torque, tangent.as_deref())
    } else if here.gap > FARTHEST * scale.reach {
        let mut record = vec![0.0; width(joints)];
        record[0] = -scale.kc.sqrt() * here.gap;
        record
    } else {
        continued(solver, q, here.gap.max(0.0), scale, &mut solved.equilibria)
    };
    let record = limited(record, steps);
    solved.record.iter_mut().zip(record).for_each(|(to, number)| *to = number as f32);
    solved
}

/// The numbers of a node with mixed derivatives that change no slope by more than the largest, over a cell of the base.
fn limited(mut record: Vec<f64>, steps: &[f64]) -> Vec<f64> {
    let largest = steps.iter().enumerate().map(|(a, h)| (record[slope(a)] * h).abs()).fold(0.0, f64::max);
    for a in 0..steps.len() {
        for b in 0..a {
            let limit = largest / (steps[a] * steps[b]);
            record[mixed(a, b)] = record[mixed(a, b)].min(limit).max(-limit);
        }
    }
    record
}

/// The numbers of a free node with gap `gap`.
fn continued(solver: &mut Solver<'_>, q: &JointVector, gap: f64, scale: &Scale, equilibria: &mut u32) -> Vec<f64> {
    let Scale { steps, kc, .. } = scale;
    let joints = q.len();
    let mut record = vec![0.0; width(joints)];
    let slopes = gradient(solver, q, steps);
    record[0] = -kc.sqrt() * gap;
    (0..joints).for_each(|a| record[slope(a)] = -kc.sqrt() * slopes[a]);
    let depth = (DEPTH_SHARE * gap).max(LEAST_GAP);
    let (mut at, mut distance, mut slopes) = (*q, gap, slopes);
    for step in 0..STEPS {
        let square: f64 = slopes.iter().zip(steps).map(|(g, h)| (g * h).powi(2)).sum();
        if square <= LEAST_GAP * LEAST_GAP {
            return record;
        }
        for a in 0..joints {
            at[a] -= (distance + depth) * steps[a] * steps[a] * slopes[a] / square;
        }
        let far = (0..joints).any(|a| (at[a] - q[a]).abs() > FARTHEST * steps[a]);
        if far {
            return record;
        }
        distance = solver.gap(&at);
        if distance < -0.5 * depth && distance > -2.0 * depth {
            break;
        }
        if step + 1 == STEPS {
            return record;
        }
        slopes = gradient(solver, &at, steps);
    }
    *equilibria += 1;
    let beyond = solver.solve(&at);
    if beyond.status == Status::Contact && beyond.energy > LEAST_ENERGY {
        let root = root_of(beyond.energy, &beyond.torque, None);
        let rise: f64 = (0..joints).map(|a| root[slope(a)] * (q[a] - at[a])).sum();
        if root[0] + rise <= 0.0 {
            record = root;
            record[0] += rise;
        }
    }
    record
}

/// Gradient of the gap by central differences [m/rad].
fn gradient(solver: &mut Solver<'_>, q: &JointVector, steps: &[f64]) -> JointVector {
    let mut slopes = *q;
    for (a, h) in steps.iter().enumerate() {
        let mut gap = |side: f64| {
            let mut at = *q;
            at[a] += side * GRADIENT_STEP * h;
            solver.gap(&at)
        };
        slopes[a] = (gap(1.0) - gap(-1.0)) / (2.0 * GRADIENT_STEP * h);
    }
    slopes
}
