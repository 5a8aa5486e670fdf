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

use super::tile::PointResult;
use crate::{
    JointVector,
    contact::{Backend, Equilibrium, Model, Solver, Solvers, Status},
    field::{GRADIENT_STEP, LEAST_ENERGY},
    joint_matrix,
    store::{
        Space,
        record::{mixed, slip_of, slope, width},
        root_of,
    },
};
use glam::Vec3;

/// Depth behind the boundary at which contact is solved for a free node, over its gap (1). Larger: the slope is that of
/// deeper contact, of which more nodes touch. Smaller: w is a root of less energy, which errs more.
const DEPTH_SHARE: f64 = 0.05;

/// Least depth, and least change of the gap over a cell of the base, that counts (m): a picometre is far below any
/// depth that a force belongs to.
const LEAST_GAP: f64 = 1e-12;

/// Farthest boundary that is looked for, in cells of the base along any axis (1): beyond, no cell of the node holds
/// contact.
const FARTHEST: f64 = 2.0;

/// Most Newton steps to the boundary: the gap is nearly linear, and each step squares the error.
const STEPS: usize = 6;

/// A solved node.
pub(super) struct Solved {
    /// w, gradient, mixed derivatives; see [`crate::store::record`].
    pub record: Vec<f32>,
    /// Slip of its contacts, or of those behind its boundary, as [`slip_of`] has it; zeros where none is known, and empty
    /// where none is asked for.
    pub slip: Vec<f32>,
    /// Equilibrium at the node.
    pub result: PointResult,
    /// Contact forces on the object's nodes there, ascending by node (N).
    pub forces: Vec<(u32, Vec3)>,
    /// Equilibria that were solved in contact for it: none where nothing is near, two at most.
    pub equilibria: u32,
}

/// Everything on which a node depends beside its configuration.
pub(super) struct Scale {
    /// Spacing of the base along each axis (rad or m).
    steps: Vec<f64>,
    /// No node of the proxy moves farther when each joint moves by the base's spacing (m).
    reach: f64,
    /// Contact stiffness (N/m).
    kc: f64,
    /// Whether nodes say how contacts slip.
    with_slips: bool,
}

impl Scale {
    /// For nodes in `space`, solved by `model`.
    pub fn new(model: &Model<'_>, space: &Space) -> Self {
        let joints = space.joints();
        let steps: Vec<f64> = (0..joints).map(|a| space.step(0, a)).collect();
        let first = space.configuration(0, &[0; crate::MAX_AXES]);
        let last = space.configuration(0, &space.last(0));
        let ranges: Vec<[f64; 2]> = first.iter().zip(last.iter()).map(|(first, last)| [*first, *last]).collect();
        let bounds = model.chain.jacobian_bounds(&ranges);
        let reaches = bounds.iter().map(|bound| bound.iter().zip(&steps).map(|(lever, step)| lever * step).sum());
        let reach = reaches.fold(0.0, f64::max);
        Self { steps, reach, kc: model.kc, with_slips: model.with_slip }
    }
}

/// Returns the node at `q` that holds the equilibrium `here`.
pub(super) fn holding(solver: &mut Solver<'_>, q: &JointVector, here: &Equilibrium, scale: &Scale) -> Solved {
    let begun = begin(solver, q, here, scale);
    let behind = begun.behind.map(|at| solver.solve(&at));
    begun.conclude(q, here, behind.as_ref(), scale)
}

/// Solves the nodes at `configurations` together: contact by `backend`, the searches for the
/// boundary by `solvers`.
///
/// # Errors
/// When the backend fails.
pub(super) fn solve_all<B: Backend>(
    backend: &mut B,
    solvers: &Solvers<'_>,
    configurations: &[JointVector],
    scale: &Scale,
) -> Result<Vec<Solved>, B::Error> {
    let here = backend.solve(configurations)?;
    let held: Vec<(&JointVector, &Equilibrium)> = configurations.iter().zip(&here).collect();
    let begun = solvers.map(&held, |solver, (q, here)| begin(solver, q, here, scale));
    let behind: Vec<JointVector> = begun.iter().filter_map(|begun| begun.behind).collect();
    let mut beyond = backend.solve(&behind)?.into_iter();
    let solved = begun.into_iter().zip(held).map(|(begun, (q, here))| {
        let beyond = begun.behind.and_then(|_| beyond.next());
        begun.conclude(q, here, beyond.as_ref(), scale)
    });
    Ok(solved.collect())
}

/// A node whose equilibrium is solved.
struct Begun {
    /// Its numbers, unless contact behind the boundary gives others.
    record: Vec<f64>,
    /// Configuration behind the boundary of contact at which that is solved; `None` for a node that does not continue
    /// it.
    behind: Option<JointVector>,
}

/// Begins the node at `q` with the equilibrium `here`.
fn begin(solver: &mut Solver<'_>, q: &JointVector, here: &Equilibrium, scale: &Scale) -> Begun {
    if here.status.is_in_contact() && here.energy > LEAST_ENERGY {
        let tangent: Option<Vec<f64>> =
            here.tangent.as_ref().map(|tangent| joint_matrix::lower(tangent, q.len()).collect());
        return Begun { record: root_of(here.energy, &here.torque, tangent.as_deref()), behind: None };
    }
    let gap = here.gap.max(0.0);
    let mut record = vec![0.0; width(q.len())];
    record[0] = -scale.kc.sqrt() * gap;
    if gap > FARTHEST * scale.reach {
        return Begun { record, behind: None };
    }
    let slopes = gradient(solver, q, &scale.steps);
    slopes.iter().enumerate().for_each(|(a, slope_of_gap)| record[slope(a)] = -scale.kc.sqrt() * slope_of_gap);
    Begun { record, behind: behind(solver, q, gap, slopes, &scale.steps) }
}

impl Begun {
    /// Returns the node at `q`, which holds `here`, with the equilibrium `behind` its boundary.
    fn conclude(self, q: &JointVector, here: &Equilibrium, behind: Option<&Equilibrium>, scale: &Scale) -> Solved {
        let Self { mut record, behind: at } = self;
        let mut touching = here;
        if let (Some(at), Some(behind)) = (at, behind)
            && behind.status == Status::Contact
            && behind.energy > LEAST_ENERGY
        {
            let mut root = root_of(behind.energy, &behind.torque, None);
            root[0] += (0..q.len()).map(|a| root[slope(a)] * (q[a] - at[a])).sum::<f64>();
            if root[0] <= 0.0 {
                (record, touching) = (root, behind);
            }
        }
        let slip = if scale.with_slips { slip_record(touching, q.len()) } else { Vec::new() };
        Solved {
            slip: slip.into_iter().map(|number| number as f32).collect(),
            record: limited(record, &scale.steps).into_iter().map(|number| number as f32).collect(),
            result: PointResult::of(here),
            forces: here.forces.iter().map(|on| (on.node, on.force.as_vec3())).collect(),
            equilibria: u32::from(here.status.is_in_contact()) + u32::from(behind.is_some()),
        }
    }
}

/// How the contacts of an equilibrium slip; zeros where none is known.
fn slip_record(equilibrium: &Equilibrium, joints: usize) -> Vec<f64> {
    let slip = equilibrium.slip.filter(|slip| equilibrium.energy > LEAST_ENERGY && slip.is_finite());
    slip.map_or(vec![0.0; width(joints)], |slip| slip_of(&slip, (2.0 * equilibrium.energy).sqrt(), joints))
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

/// Returns a configuration just behind the boundary of contact, which Newton steps find from `q`, `gap` away with the
/// gradient `slopes`; `None` where it is far, or not found.
fn behind(
    solver: &mut Solver<'_>,
    q: &JointVector,
    gap: f64,
    mut slopes: JointVector,
    steps: &[f64],
) -> Option<JointVector> {
    let depth = (DEPTH_SHARE * gap).max(LEAST_GAP);
    let (mut at, mut distance) = (*q, gap);
    for step in 0..STEPS {
        let square: f64 = slopes.iter().zip(steps).map(|(g, h)| (g * h).powi(2)).sum();
        if square <= LEAST_GAP * LEAST_GAP {
            return None;
        }
        for a in 0..q.len() {
            at[a] -= (distance + depth) * steps[a] * steps[a] * slopes[a] / square;
        }
        if (0..q.len()).any(|a| (at[a] - q[a]).abs() > FARTHEST * steps[a]) {
            return None;
        }
        distance = solver.gap(&at);
        if distance < -0.5 * depth && distance > -2.0 * depth {
            return Some(at);
        }
        if step + 1 < STEPS {
            slopes = gradient(solver, &at, steps);
        }
    }
    None
}

/// Gradient of the gap by central differences (m/rad).
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
