//! Every numerical tolerance of the engine, each with its derivation. No other file holds a bare tolerance.

/// Smallest height of a triangle over its longest edge, and of a closed surface's volume over its area times its extent
/// [1]. Coordinates in single precision, as STL files and the GPU hold them, round at 6e-8 of their size: below this
/// bound the triangle's normal would be uncertain by more than about 6 %, and its side a matter of luck.
pub const MIN_TRIANGLE_ASPECT: f64 = 1e-6;

/// Smallest volume of a tetrahedron over the cube of its longest edge [1]: for the same reason.
pub const MIN_TETRAHEDRON_ASPECT: f64 = 1e-6;

/// Smallest accepted reciprocal condition number of K [1]. K (C f) equals f to about machine precision over this
/// number, and the equilibria that are stored promise 1e-6.
pub const MIN_RECIPROCAL_CONDITION: f64 = f64::EPSILON / 1e-6;

/// Shift, relative to the norm of K, under which the free motion of a singular K is sought [1]: the square root of
/// machine precision is far above the rounding of a factorisation and far below the stiffness of any spring that
/// counts.
pub const MECHANISM_SHIFT: f64 = 1.5e-8;

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
pub const GPU_SEARCH_SLACK: f32 = 1e-4;

/// [`ENERGY_ROUNDING`] for f32, whose eps is 1.2e-7.
pub const GPU_ENERGY_ROUNDING: f32 = 16.0 * f32::EPSILON;

/// [`GIVE_UP_LENGTH`] for f32: coordinates do not change visibly under a step this much smaller than the first.
pub const GPU_GIVE_UP_RADIUS: f32 = 1e-6;

/// [`INNER_TOLERANCE_FLOOR`] for f32: eps times the about 1e3 by which rounding grows over some tens of iterations.
pub const GPU_INNER_TOLERANCE_FLOOR: f32 = 1e-4;

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
pub const GPU_PAPER_INNER_TOLERANCE: f32 = 1e-6;

// --- contact ---

/// Least squared length, area or distance that is divided by [m^2, m^4]: far below any mesh of this world (edges over
/// 1 nm) and far above the smallest normal f64, so that a quotient stays finite.
pub const MINIMUM_SQUARE: f64 = 1e-60;

/// Least distance of a proxy node to its closest edge or vertex that curvature is divided by [m]: below a nanometre the
/// direction between the two is rounding (coordinates of 0.1 m carry 1e-17 m, a direction good to 1e-6 needs 1e-11 m).
pub const MINIMUM_CURVATURE_RADIUS: f64 = 1e-11;

/// Steps of Newton's method for the closest point of a bent facet at most: from the flat triangle's closest point three
/// or four reach rounding, and where the distance is not convex more do not help.
pub const FACET_ITERATIONS: usize = 16;

/// Step of barycentric weights at which the search for that point ends [1]: the next step would be about its square,
/// far below the rounding of a weight.
pub const FACET_STEP: f64 = 1e-8;

/// Least convexity of the distance to a bent facet, over that to a flat one, at which its second derivative is used
/// [1]: beyond, the point is within a hundredth of the surface's radius of curvature from where the closest point
/// leaps, and a step by it would be a hundred times as far.
pub const LEAST_CONVEXITY: f64 = 1e-2;

/// Slack of squared lower bounds in culling, relative to the square of the scene's size [1]: a squared distance between
/// points of coordinates up to L is rounded by a few eps L^2 (eps = 2.2e-16); 64 eps covers bound and distance.
pub const CULLING_SLACK: f64 = 64.0 * f64::EPSILON;

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

/// Below this share of the predicted decrease damping grows, in f32 the trust region shrinks [1] (Conn, Gould & Toint,
/// section 17.1).
pub const POOR_SHARE: f64 = 0.25;

/// Above this share damping fades, and in f32 a step that reached the boundary widens the trust region [1] (same
/// source).
pub const GOOD_SHARE: f64 = 0.75;

/// Factors by which the trust region of f32 shrinks and widens [1] (same source).
pub const SHRINK: f64 = 0.25;

/// See [`SHRINK`].
pub const WIDEN: f64 = 2.0;

/// Least damping of a Newton step that is not zero, in the object's own stiffness [1]: less changes a step by less than
/// the tenth that its model is good for where damping is needed at all. With 0.01, 64 hard balls on 2,027 nodes
/// converge all the same, in the same time.
pub const LEAST_DAMPING: f64 = 0.1;

/// Factor by which damping grows after the first step that E refuses, doubled with each that follows [1] (Nielsen
/// 1999): five refusals in a row multiply it by a million, which is what rigid contact is stiffer than the object
/// ([`RIGID_STIFFNESS`]).
pub const DAMPING_GROWTH: f64 = 4.0;

/// Factor by which damping fades after a step that kept most of its promise [1]: with 0.1 points in soft contact on
/// 1,026 nodes take 10.1 steps instead of 9.1, and 64 hard balls on 2,027 nodes as long; with 0.5 the eight hardest of
/// these took twice as long, without [`CURVATURE_MARGIN`].
pub const DAMPING_DECAY: f64 = 0.25;

/// Damping that is added to what a direction of negative curvature lacks, in the object's own stiffness [1]. Without,
/// the model is nearly flat in that direction, and the step so long that neighbouring configurations end at different
/// equilibria: of 2,300 with points deeper than half the object's radius 34 have one within 2e-6 rad, with 5 only 7; 10
/// takes a third more iterations where contact is stiff.
pub const CURVATURE_MARGIN: f64 = 5.0;

/// Attempts to find a damping with which the model is convex [1]: it doubles at least from one to the next, so that the
/// last is 1e9, a thousand times what rigid contact is stiffer than the object ([`RIGID_STIFFNESS`]).
pub const DAMPING_ATTEMPTS: u32 = 30;

/// Length of a refused step, relative to the greatest there can be, at which a configuration is given up [1]: the
/// energy of a step scales with its length, so below 1e-12 nothing measurable can be gained any more.
pub const GIVE_UP_LENGTH: f64 = 1e-12;

/// Largest relative residual at which the inner conjugate gradients stop [1]; nearer the solution they stop at the
/// outer residual itself, which keeps Newton's convergence quadratic (Dembo, Eisenstat & Steihaug 1982).
pub const INNER_TOLERANCE: f64 = 1e-2;

/// Relative residual of the linear solves behind a tangent d tau/d q [1]: the tangent errs by its square, relative to
/// the response, below the 6e-8 to which f32 stores it.
pub const RESPONSE_TOLERANCE: f64 = 1e-4;

/// Relative residual of the linear solve that looks for negative curvature at an equilibrium [1]. Its random load has a
/// share of one over the root of the number of unknowns, a tenth or so, in a direction of negative curvature, which
/// conjugate gradients meet before the residual is as small as this.
pub const PROBE_TOLERANCE: f64 = 1e-2;

/// First length of the step away from a saddle, over the length of the displacement there, in the energy norm [1]; it
/// is halved until the energy falls by more than its rounding, at most [`NUDGE_HALVINGS`] times.
pub const NUDGE: f64 = 0.1;

/// See [`NUDGE`]: after these, the fall of the energy, of second order, would be below rounding.
pub const NUDGE_HALVINGS: u32 = 20;

/// Least relative residual the inner conjugate gradients are asked for [1]: eps times the about 1e3 by which rounding
/// grows over some tens of iterations.
pub const INNER_TOLERANCE_FLOOR: f64 = 1e-13;

/// Conjugate-gradient iterations of one step at most, per unknown [1]: exact arithmetic needs one per unknown,
/// rounding at stiff contact, and passes for other touching contacts, a few times as many.
pub const INNER_ITERATIONS_PER_UNKNOWN: usize = 4;

/// Passes of conjugate gradients in one step at most, each for another set of touching contacts [1]: sets
/// settle in two or three; more are cut off by a decrease that no longer grows.
pub const MODEL_PASSES: usize = 6;

/// Part e of a ball's compliance 1/kc that lies at each wall it touches [1]: on an edge, where it touches two facets at
/// once, its spring is 5 per cent stiffer than on one, on a vertex of six 9, and never more than 11. Of 29 of the
/// hardest balls on 2,027 nodes 28 converge with 0.1 and 0.2, 29 with 0.3; with 0.02 the walls' springs are so stiff
/// that conjugate gradients take ten times as long.
pub const FACET_COMPLIANCE: f64 = 0.1;

/// How far beyond the walls that may bear it a ball knows of others, in radii [1]: they may be the next that do.
/// Without, a rigid ball rattles between facets: of 100 configurations on 102 nodes (axial springs, Kg 1e4 N/m on a
/// patch, to half a radius deep) 96 converged, with 0.3 98, while every wall within the radius pushed by itself.
pub const KNOWN_FACETS: f64 = 0.3;

/// First contact stiffness of the energy form, in units of the stiffness of the object's softest node (one over the
/// trace of its compliance) [1]: soft contact, as stiff as the object itself, converges within a few steps from
/// anywhere.
pub const CONTINUATION_START: f64 = 4.0;

/// Stiffness of a rigid contact point, in units of the stiffness of the object's softest node (one over the trace of
/// its compliance) [1]: force and torque differ from those of perfectly rigid contact by the inverse of this.
pub const RIGID_STIFFNESS: f64 = 1e6;

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

/// Ripple of the force on a contact point over a facet above which a bake warns that the mesh shows through [1].
pub const RIPPLE_WARNING: f64 = 0.1;

/// How far the surface of an object is expected to move, in depths of the deepest proxy node below it at rest [1]: in
/// stiff contact it moves by that depth along the normal, and as much again leaves room for what neighbouring nodes
/// drag along.
pub const EXPECTED_MOTION: f64 = 2.0;

/// Rounding error of a gap and of the motion it is held against, relative to the lengths of chain and object [1]: a
/// pose is a product of at most seven rotations, a distance a difference of coordinates, each good to some ten eps of
/// those lengths.
pub const FREE_SPACE_ROUNDING: f64 = 1e-12;

/// How far beyond an end a grid line may lie and still count, in steps [1]: spacings such as pi/60 are written with a
/// handful of digits, and 1e-6 of a step changes no torque that is interpolated between lines.
pub const GRID_STEP_SLACK: f64 = 1e-6;

/// Pull of a joint stop, relative to the terms that balance it, that is taken for rounding [1]: the balance is a sum of
/// eight terms of a solution whose residual is a few times the order of the matrix, six, in machine precision.
pub const STOP_ROUNDING: f64 = 64.0 * f64::EPSILON;

/// Greatest number in SI units that a device or a dataset may give for a position [rad or m], a torque [N m] or an
/// energy [J]. Nothing that is haptized comes near it, and its square times any gain is still far from overflow, so
/// that no account or torque of the haptic loop can become infinite.
pub const GREATEST_INPUT: f64 = 1e9;

/// Size below which a decaying state of the haptic loop is set to zero, in its SI unit. It is far below anything that
/// can be felt or changes a torque; what stays has squares that are normal numbers, and arithmetic on subnormal numbers
/// takes tens of times as long.
pub const NEGLIGIBLE_STATE: f64 = 1e-150;

/// Greatest age of a device's position on which a torque may rest [s]: ten ticks at 1 kHz. A hand, which moves at below
/// 10 Hz, has gone on by no more than half a radian of its phase.
pub const GREATEST_POSITION_AGE: f64 = 0.01;

/// Least time between two ticks [s]: a device's encoder steps, of 1e-5 rad or so, divided by less would give velocities
/// of tens of rad/s to a device at rest.
pub const LEAST_INTERVAL: f64 = 1e-6;

/// Greatest time between two ticks [s]: a whole period of a hand's fastest motion, 10 Hz. After more, the position
/// before says nothing about the velocity.
pub const GREATEST_INTERVAL: f64 = 0.1;

/// Time over which the mean time between ticks is taken [s]: two of [`GREATEST_INTERVAL`], so that one such pause
/// lengthens the mean by half only, while persistent overruns are found within a second.
pub const PACE_WINDOW: f64 = 2.0 * GREATEST_INTERVAL;

/// Energy that the loop may give the device from nowhere before its torque is brought to zero [J]: what 0.1 kg at the
/// hand has at 1.4 m/s, which a hand stops within a centimetre with 10 N.
pub const GREATEST_GIVEN_ENERGY: f64 = 0.1;

/// Residual of the energy accounts over their turnover that is rounding [1]: each of up to a million ticks adds some
/// terms, rounded by eps of the sums so far: eps times the square root of their number, 1e-13, if they are random, and
/// a thousand times that if they are not.
pub const ACCOUNT_ROUNDING: f64 = 1e-10;

/// Least energy of motion that a passivity controller brakes [J]: a gram at a micrometre a second. Below, one tick's
/// damping could not take anything that counts.
pub const LEAST_MOVING_ENERGY: f64 = 1e-15;

/// Least force that counts as a contact when friction or damping acts on it [N]: far below what is felt, and large
/// enough that a normal is known to rounding.
pub const LEAST_CONTACT_FORCE: f64 = 1e-9;

/// Energy that the object may seem to gain in a frame from nowhere, over the most that it stored [1]: sums over up to
/// 1e5 coordinates, each rounded by eps, of terms that cancel.
pub const FRAME_ENERGY_ROUNDING: f64 = 1e-10;

/// The same where the state is f32 [1]: each displacement and velocity is rounded by 6e-8, and energy is their square.
pub const GPU_FRAME_ENERGY_ROUNDING: f64 = 1e-6;

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

/// [`JITTER`] for 4 to 6 joints, where circumspheres are computed in floating point: on a cell of cospherical points
/// squeezed to thickness t the centre is known to about 1e-16 / t, and must be known better than t.
pub const HYPER_JITTER: f64 = 1e-7;

/// [`HULL_PULL`] for 4 to 6 joints.
pub const HYPER_PULL: f64 = 100.0 * HYPER_JITTER;

/// A point counts as beyond a facet from this height on: below the jitter, above the rounding of a height.
pub const HYPER_FACET: f64 = 1e-12;

/// A weight down to minus this counts as inside: the rounding of a weight in a cell of thickness `HYPER_JITTER`.
pub const HYPER_WEIGHT: f64 = 1e-9;

/// Steps after which a walk in 4 to 6 joints is given up. Walks cross about d n^(1/d) cells; 10^5 samples in 4 joints
/// give 70.
pub const HYPER_STEPS: usize = 10_000;

/// Cells that one worker keeps in 4 to 6 joints before it starts again: about 500 bytes each.
pub const HYPER_CELLS: usize = 200_000;

/// Pivot below which the corners of a simplex span nothing in a direction, as a fraction of the extent: between the
/// jitter (1e-7 and less), which makes slivers of points in a plane, and the thickness of honest simplices.
pub const SLIVER_PIVOT: f64 = 1e-5;

/// Extent of the samples off the best line or plane below which they count as flat: less than an encoder resolves.
pub const FLAT_CLOUD: f64 = 1e-6;

/// Simplices that may be created per point before an arrangement is called degenerate. Random points create about 27
/// on the way to 6.8, scan lines up to 60.
pub const SIMPLICES_PER_POINT: usize = 400;

/// Simplices that any number of points may create.
pub const FREE_SIMPLICES: usize = 1_000_000;

/// A grid line this fraction of a step outside the samples' range still lies on its end.
pub const GRID_LINE: f64 = 1e-9;

/// Most grid points of one gridization: 2.4 GB of torque for three joints.
pub const GRID_POINTS: f64 = 1e8;

/// Contact threshold in standard deviations of the samples: noise alone exceeds three once in 370 samples.
pub const CONTACT_DEVIATIONS: f64 = 3.0;

/// Contact threshold as a fraction of the greatest torque where no deviation was measured.
pub const CONTACT_FRACTION: f64 = 0.01;

// --- import of logs ---

/// Samples that an import keeps when it averages none: 0.5 GB for six joints.
pub const IMPORT_SAMPLES: usize = 5_000_000;

/// Cells of C-space that an import averages in: about 1 kB each.
pub const IMPORT_CELLS: usize = 1_000_000;

// --- interpolation ---

/// Least gap, and least slope of the gap field, that is divided by [m, m/sqrt(J)]: a picometre is far below any depth
/// that a force belongs to, and gaps are stored in f32, which keeps their relative accuracy down to 1e-38.
pub const LEAST_GAP: f64 = 1e-12;

/// Least stored energy over that of free space whose square root is distinguished from zero [J]: a nanonewton over a
/// femtometre, as in [`RESIDUAL_FLOOR`].
pub const LEAST_ENERGY: f64 = RESIDUAL_FLOOR * RESIDUAL_FLOOR;

/// Difference, relative to the integral of the power's size over the whole line, at which one stretch of a work
/// integral is good enough [1]: fractions of a cell are rounded by some tens of eps, and the torque with them.
pub const WORK_ROUNDING: f64 = 64.0 * f64::EPSILON;

/// Halvings of a stretch in a work integral at most: a kink of the torque within it then spoils 1e-9 of it, and, since
/// the torque itself is continuous, 1e-18 of the work.
pub const WORK_HALVINGS: u32 = 30;

/// Most halvings of one stretch in all. A jump takes [`WORK_HALVINGS`] of them, and a cell is crossed by few
/// boundaries; where rounding keeps more stretches from agreeing, further halves would only add to it.
pub const WORK_STRETCHES: u32 = 32 * WORK_HALVINGS;

// --- figures ---

/// A number this fraction of a tick step beyond the end of an axis, or off a whole number of decimals, still counts as
/// on it: a thousandth of what a pixel shows, and a million times the rounding of the step.
pub const TICK_STEP: f64 = 1e-6;

/// A recording that ends this fraction of its duration before a round number is drawn up to it: half of one percent is
/// three points of a sheet, and a tick of a 1 kHz loop of one second is a fifth of it.
pub const AXIS_END: f64 = 0.005;

/// Depth, over the eye's distance from the origin, up to which a point counts as behind the eye: nearer ones would be
/// projected beyond a million pixels. Nothing that a camera frames comes nearer than a tenth.
pub const NEAR_PLANE: f64 = 1e-6;

/// How much nearer, as a fraction of its distance, the edges of a mesh are drawn than its surface: above the rounding
/// of the depth buffer (single precision) at grazing views, below a twentieth of what a camera frames.
pub const EDGE_LIFT: f64 = 5e-3;

// --- arms ---

/// Least principal minor of an inertia over its trace, that many factors: scenes and robot files give five digits or
/// more, and what is below zero by that much stays below the actuators' reflected inertia.
pub const INERTIA_ROUNDING: f64 = 1e-5;

// --- scanning ---

/// Acceleration of gravity [m/s^2], standard value.
pub const GRAVITY: f64 = 9.806_65;

/// Distance at which a position counts as reached by inverse kinematics [m]: a thousandth of an encoder step at 0.1 m.
pub const REACHED: f64 = 1e-7;

/// First damping of inverse kinematics [m]: a tenth of a link's length, so that a first step stays in the linear range.
pub const REACH_DAMPING: f64 = 0.01;

/// Steps of inverse kinematics: converging ones take about ten, the rest allows for joint limits on the way.
pub const REACH_STEPS: usize = 200;

/// Most points of a scan: at a second a point, eleven days.
pub const SCAN_POINTS: usize = 1_000_000;

/// Time for which a device is braked after a limit [s]: several time constants of damping against inertia.
pub const BRAKE_TIME: f64 = 0.3;

/// Pivot below which the neighbours of a sample span no plane, relative to the greatest: their thickness squared, a
/// thousandth of their reach.
pub const PLANE_PIVOT: f64 = 1e-6;

/// Determinant of a Jacobian relative to the product of its columns' lengths, below which an arm counts as singular: a
/// force would be uncertain by a hundred times the torque's error.
pub const REGULAR_JACOBIAN: f64 = 1e-2;

/// Error of a gridized torque relative to the greatest one, where exact arithmetic has none: weights of slivers are
/// known to the jitter ([`JITTER`], 1e-12) over their thickness, of a thousandth and more, and [`HYPER_WEIGHT`] bounds
/// them in 4 to 6 joints.
pub const GRIDIZED_LINEAR: f64 = 1e-9;

/// Lever arm with which a prismatic joint counts among revolute ones [m]: a tenth of a metre, the size of a tool in a
/// hand. Gains' defaults and errors over joints of both kinds are converted with it.
pub const LEVER_ARM: f64 = 0.1;

/// Relative residual to which the reference of an accuracy study is solved [1]: three decades below the scenes' own
/// 1e-8, and still above what rounding leaves of a residual (about 1e-13).
pub const REFERENCE_TOLERANCE: f64 = 1e-11;

/// Share of an error to stay below that the grid's spacing may have, as the measured order predicts it [1]; what the
/// solver adds is independent of it and adds as squares, so that 0.6 is left for the solver and for the error of the
/// order itself.
pub const SPACING_SHARE: f64 = 0.8;

/// Excess of a grid point's energy over what a neighbour predicts, over the work of the torque along one grid step,
/// above which the neighbour's equilibrium is tried there [1]. Smaller: more searches, most of them at kinks of the
/// torque, without effect. Larger: jumps of U up to this share of a step's work may stay. Of the 4,086 points in
/// contact of a sphere of 102 nodes on springs, dented to a third of its radius, 3 degrees apart, where a search takes
/// as long as a solution from rest:
///
/// | tolerance | 0.01 | 0.02 | 0.05 | 0.1 | 0.2 | 0.4 |
/// |---|---|---|---|---|---|---|
/// | searches | 4,540 | 3,766 | 2,938 | 2,140 | 968 | 422 |
/// | lowered | 84 | 68 | 56 | 42 | 30 | 14 |
pub const EDGE_TOLERANCE: f64 = 0.1;

/// Error of the energy of an equilibrium that is balanced to rounding, over the energy [1]: a thousand roundings of f64
/// sums over some hundred nodes, and far below differences that can be felt. An imbalance r adds about r^2, the energy
/// being least at the equilibrium.
pub const ENERGY_ERROR: f64 = 1e-10;

/// Share of an error to stay below that the contact solver's tolerance may have [1]. See [`SPACING_SHARE`].
pub const SOLVER_SHARE: f64 = 0.05;

/// How much finer than the finest measured grid the measured order is trusted [1]: two octaves, as many as it was
/// measured over. What takes more is not offered.
pub const FARTHEST_EXTRAPOLATION: f64 = 4.0;

/// Step of the differences that give the slope of an interpolated torque, over the grid's own step [1]: the cube root
/// of the rounding of f64, where what is rounded and what is left out are alike. Rounding costs 1e-11 of the torque for
/// each grid step, and along a polynomial piece of degree three what is left out is as little.
pub const GRADIENT_STEP: f64 = 1e-5;
