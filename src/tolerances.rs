//! Numerical tolerances that several modules share, each with its derivation. Others stand beside the code that they
//! bound; no number in the code is a bare tolerance.

// --- GPU (f32 kernels) ---

/// Stands for "no distance yet" in f32 kernels [m]: above any distance in a scene, and its square is still finite.
pub const GPU_FAR_AWAY: f32 = 1e18;

/// Least divisor in f32 kernels: a hundred times the least normal number (1.2e-38), below which a device may flush to
/// zero. Squared edge lengths stay above it down to 1e-18 m.
pub const GPU_LEAST_DIVISOR: f32 = 1e-36;

/// Least relative residual that the f32 solver is asked for [1]: rounding of f32 (6e-8) grows over sums of about a
/// hundred products to a few 1e-6, so 1e-5 is the least that can be distinguished from zero.
pub const GPU_LEAST_TOLERANCE: f64 = 1e-5;

/// Largest relative residual of a GPU's result that is passed on as converged, however rough the scene's tolerance [1]:
/// what is promised of f32. What has more is solved in f64.
pub const GPU_RESOLVED_RESIDUAL: f64 = 1e-4;

/// Distance of a node to an edge or vertex, relative to the object's extent, below which f32 does not resolve the
/// direction between them [1]: coordinates of one extent carry 6e-8, and 16 times that gives a direction good to 6 %,
/// where the pseudonormal is the better one.
pub const GPU_LEAST_DISTANCE_PER_EXTENT: f64 = 1e-6;

/// Rounding error of a depth, relative to the longest edge of the surface [1]: three coordinates of a corner relative
/// to the proxy node, each rounded by 6e-8 of at most an edge, enter with weights that sum to one.
pub const GPU_DEPTH_ROUNDING_PER_EDGE: f64 = 2e-7;

/// Part of the band of gaps at rest within which contact or not is decided in f64, relative to the object's extent [1]:
/// distances between coordinates of up to some extents are rounded by 6e-8 of each.
pub const GPU_GAP_BAND_PER_EXTENT: f64 = 1e-6;

/// The other part of the band, for each joint, relative to the chain's reach [1]: a joint turns a lever no longer than
/// the reach by a cosine and a sine that are rounded by 6e-8 each, and rounds products and sums as often again; six of
/// these roundings in all.
pub const GPU_GAP_BAND_PER_JOINT: f64 = 4e-7;

/// Widening of bounding spheres, relative to the object's extent [1]: coordinates of up to ten extents (a proxy node
/// far away) are rounded to f32 by 6e-8 each.
pub const GPU_BOUND_SLACK: f64 = 1e-6;

/// Widening of distances within which f32 kernels search, relative to these [1]: they follow from sums of up to some
/// hundred products, each rounded by 6e-8.
pub const GPU_SEARCH_SLACK: f64 = 1e-4;

/// The least step of the search for the closest point of a bent facet, for f32 [1]: some roundings of a weight.
pub const GPU_FACET_STEP: f64 = 4.0 * f32::EPSILON as f64;

/// [`ENERGY_ROUNDING`] for f32, whose eps is 1.2e-7.
pub const GPU_ENERGY_ROUNDING: f64 = 16.0 * f32::EPSILON as f64;

/// [`GIVE_UP_LENGTH`] for f32: coordinates do not change visibly under a step this much smaller than the first.
pub const GPU_GIVE_UP_LENGTH: f64 = 1e-6;

/// [`INNER_TOLERANCE_FLOOR`] for f32: eps times the about 1e3 by which rounding grows over some tens of iterations.
pub const GPU_INNER_TOLERANCE_FLOOR: f64 = 1e-4;

/// Most iterations of one configuration in f32, whatever the scene allows: hardly any that needs more ends there, a
/// group that goes on holds up its whole batch, and what is not converged is solved in f64 with all the scene's
/// iterations.
pub const GPU_MAX_ITERATIONS: u32 = 100;

/// Steps in f64 from a result of the f32 kernel at most [1]. They converge quadratically: where f32 found an
/// equilibrium, one leads from its 1e-5 to 1e-8. Four let contacts within rounding of none come and go; what needs more
/// was not near one, and may end at another.
pub const SETTLING_STEPS: u32 = 4;

/// Greatest contact stiffness of the energy form in f32, in units of the stiffness of the object's softest node [1]: a
/// depth is known to about 1e-6 of the object's displacement, a force to this many times that. What is stiffer is
/// stiffened from there in f64, where nothing moves by more than a thousandth of its displacement.
pub const GPU_STIFFNESS: f64 = 1e3;

/// Residual of the contact forces of the energy form that is allowed after these steps unless the scene asks for less,
/// relative, in the energy norm [1]: soft directions of a deep dent raise it a hundredfold in the torque, which is to
/// agree to 1e-5 with the CPU's.
pub const GPU_SETTLED_RESIDUAL: f64 = 1e-7;

/// Relative residual of the paper's step 2 in f32 [1]: ten times better than the least tolerance of the iteration.
pub const GPU_PAPER_INNER_TOLERANCE: f64 = 1e-6;

// --- contact ---

/// Least squared length, area or distance that is divided by [m^2, m^4]: far below any mesh of this world (edges over
/// 1 nm) and far above the smallest normal f64, so that a quotient stays finite.
pub const MINIMUM_SQUARE: f64 = 1e-60;

/// Rounding of a length from its coordinates, relative to it [1]: a square of a sum of squares is good to a few eps.
pub const LENGTH_ROUNDING: f64 = 8.0 * f64::EPSILON;

/// Least contact force in the energy norm, sqrt(c^T C c), that a residual is measured against [sqrt(J)]: its square
/// 1e-24 J is a nanonewton over a femtometre.
pub const RESIDUAL_FLOOR: f64 = 1e-12;

/// Rounding of a depth, relative to the size of the object [1]: differences and products of coordinates, each rounded
/// by eps / 2, add up to a few eps; 16 leave room for a flat angle between node and facet.
pub const DEPTH_ROUNDING: f64 = 16.0 * f64::EPSILON;

/// Rounding of the stored energy, in units of eps (E + sum lambda_i L): sums of about a hundred products each rounded
/// by eps / 2, and depths rounded by a few eps L, are within 16 of these units; steps whose predicted decrease lies
/// below are judged by the model alone.
pub const ENERGY_ROUNDING: f64 = 16.0 * f64::EPSILON;

/// Share of the predicted decrease that a step must achieve to be taken [1] (Conn, Gould & Toint 2000,
/// section 6.1: any value in (0, 1/4); small, because the energy itself is cheap and only decrease matters).
pub const ACCEPTED_SHARE: f64 = 1e-4;

/// Below this share of the predicted decrease damping grows [1] (Conn, Gould & Toint, section 17.1).
pub const POOR_SHARE: f64 = 0.25;

/// Above this share damping fades [1] (same source).
pub const GOOD_SHARE: f64 = 0.75;

/// Largest relative residual at which the inner conjugate gradients stop [1]; nearer the solution they stop at the
/// outer residual itself, which keeps Newton's convergence quadratic (Dembo, Eisenstat & Steihaug 1982).
pub const INNER_TOLERANCE: f64 = 1e-2;

/// Least relative residual the inner conjugate gradients are asked for [1]: eps times the about 1e3 by which rounding
/// grows over some tens of iterations.
pub const INNER_TOLERANCE_FLOOR: f64 = 1e-13;

/// Conjugate-gradient iterations of one step at most, per unknown [1]: exact arithmetic needs one per unknown,
/// rounding at stiff contact, and passes for other touching contacts, a few times as many.
pub const INNER_ITERATIONS_PER_UNKNOWN: usize = 4;

/// Passes of conjugate gradients in one step at most, each for another set of touching contacts [1]: sets
/// settle in two or three; more are cut off by a decrease that no longer grows.
pub const MODEL_PASSES: usize = 6;

/// First contact stiffness of the energy form, in units of the stiffness of the object's softest node (one over the
/// trace of its compliance) [1]: soft contact, as stiff as the object itself, converges within a few steps from
/// anywhere.
pub const CONTINUATION_START: f64 = 4.0;

/// Growth of the contact stiffness from stage to stage [1]: measured on the 102-node sphere at Kc = 1e4 to 1e6 N/m, 3
/// converges as fast as 4 and 10 where contact is shallow and more often where it is deep.
pub const CONTINUATION_FACTOR: f64 = 3.0;

/// Relative residual at which a stage but the last is left [1]. The next stage's own first residual is
/// 1 - 1 / [`CONTINUATION_FACTOR`]; but a stage left at 0.1 had not always found its facets, and of deep contact at
/// Kc = 1e6 N/m 91 % converged, after 0.01 98 % in the same time.
pub const STAGE_TOLERANCE: f64 = 0.01;

/// Length of a refused step, relative to the greatest there can be, at which a stage but the last is left [1]: where a
/// stage stalls, at a kink, the next has a different energy and mostly gets past it.
pub const STALLED_LENGTH: f64 = 1e-5;

/// How far beyond an end a grid line may lie and still count, in steps [1]: spacings such as pi/60 are written with a
/// handful of digits, and 1e-6 of a step changes no torque that is interpolated between lines.
pub const GRID_STEP_SLACK: f64 = 1e-6;

/// Greatest number in SI units that a device or a dataset may give for a position [rad or m], a torque [N m] or an
/// energy [J]. Nothing that is haptized comes near it, and its square times any gain is still far from overflow, so
/// that no account or torque of the haptic loop can become infinite.
pub const GREATEST_INPUT: f64 = 1e9;

/// Greatest age of a device's position on which a torque may rest [s]: ten ticks at 1 kHz. A hand, which moves at below
/// 10 Hz, has gone on by no more than half a radian of its phase.
pub const GREATEST_POSITION_AGE: f64 = 0.01;

/// Greatest time between two ticks [s]: a whole period of a hand's fastest motion, 10 Hz. After more, the position
/// before says nothing about the velocity.
pub const GREATEST_INTERVAL: f64 = 0.1;

/// Energy that the loop may give the device from nowhere before its torque is brought to zero [J]: what 0.1 kg at the
/// hand has at 1.4 m/s, which a hand stops within a centimetre with 10 N.
pub const GREATEST_GIVEN_ENERGY: f64 = 0.1;

/// Residual of the energy accounts over their turnover that is rounding [1]: each of up to a million ticks adds some
/// terms, rounded by eps of the sums so far: eps times the square root of their number, 1e-13, if they are random, and
/// a thousand times that if they are not.
pub const ACCOUNT_ROUNDING: f64 = 1e-10;

/// Last step of an equilibrium of stiffening springs over its displacement [1]: a pixel is a thousandth of a
/// picture.
pub const SETTLED: f64 = 1e-9;

// --- gridization of scattered samples; positions are scaled to the unit box ---

/// Samples closer than this fraction of the extent are one point: far below any encoder's resolution (a 16-bit encoder
/// over the range resolves 1.5e-5), far above rounding.
pub const MERGE_DISTANCE: f64 = 1e-9;

/// Greatest displacement of a point before it is tetrahedralised, as a fraction of the extent. Without it every cell
/// of an exact grid is cospherical and each predicate runs its exact branch. It must exceed the predicates' static
/// error, about 1e-15 of the products involved, by a margin for cells of 1/100 of the extent.
pub const JITTER: f64 = 1.0 / (1_u64 << 40) as f64;

/// Fraction by which a position just outside the hull is pulled towards its centre: 100 times the jitter, so that a
/// grid point on a hull facet is found as long as the hull is thicker than about 1/50 of its extent there.
pub const HULL_PULL: f64 = 100.0 * JITTER;

/// A grid line this fraction of a step outside the samples' range still lies on its end.
pub const GRID_LINE: f64 = 1e-9;

// --- import of logs ---

// --- interpolation ---

/// Least gap, and least slope of the gap field, that is divided by [m, m/sqrt(J)]: a picometre is far below any depth
/// that a force belongs to, and gaps are stored in f32, which keeps their relative accuracy down to 1e-38.
pub const LEAST_GAP: f64 = 1e-12;

/// Least stored energy over that of free space whose square root is distinguished from zero [J]: a nanonewton over a
/// femtometre, as in [`RESIDUAL_FLOOR`].
pub const LEAST_ENERGY: f64 = RESIDUAL_FLOOR * RESIDUAL_FLOOR;

// --- figures ---

// --- arms ---

// --- scanning ---

/// Acceleration of gravity [m/s^2], standard value.
pub const GRAVITY: f64 = 9.806_65;

/// Lever arm with which a prismatic joint counts among revolute ones [m]: a tenth of a metre, the size of a tool in a
/// hand. Gains' defaults and errors over joints of both kinds are converted with it.
pub const LEVER_ARM: f64 = 0.1;

/// Relative residual to which the reference of an accuracy study is solved [1]: three decades below the scenes' own
/// 1e-8, and still above what rounding leaves of a residual (about 1e-13).
pub const REFERENCE_TOLERANCE: f64 = 1e-11;

/// How much finer than the finest measured grid the measured order is trusted [1]: two octaves, as many as it was
/// measured over. What takes more is not offered.
pub const FARTHEST_EXTRAPOLATION: f64 = 4.0;

/// Step of the differences that give the slope of an interpolated torque, over the grid's own step [1]: the cube root
/// of the rounding of f64, where what is rounded and what is left out are alike. Rounding costs 1e-11 of the torque for
/// each grid step, and along a polynomial piece of degree three what is left out is as little.
pub const GRADIENT_STEP: f64 = 1e-5;
