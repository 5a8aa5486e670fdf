// What the stages of the search for equilibria share (twin of the whole: src/contact/equilibrium/energy.rs). They work
// on a number of configurations at once, each of which has a workspace; in f64, or in f32 on devices without it. A
// round displaces the surface by the trial's forces and finds its contacts (search_detect), judges it (search_judge),
// and goes on to the next trial (search_step).
//
// Surface nodes are numbered by place: those that the compliance covers come first, neighbours near each other.

struct SearchParameters {
    // Configurations of this dispatch, and the place of their first one in the list of those in contact.
    configurations: u32,
    first: u32,
    joints: u32,
    proxy_nodes: u32,
    surface_nodes: u32,
    triangles: u32,
    // Leaves of the tree of bounding spheres.
    leaves: u32,
    // Surface nodes that the compliance covers.
    covered: u32,
    // Most rows, slots of the support, and nodes of a facet, in fours.
    contacts: u32,
    support: u32,
    carriers: u32,
    max_iterations: u32,
    // Numbers of one workspace: reals and words.
    reals: u32,
    words: u32,
    // Configurations that there is room for.
    room: u32,
    // Where parts of `surface` begin: control net at rest, masks of control points.
    at_net: u32,
    at_masks: u32,
    // Where parts of `mesh` begin: facets in the order of the leaves, places of each facet's nodes, its shape,
    // and whether the compliance covers it.
    at_order: u32,
    at_carriers: u32,
    at_shapes: u32,
    at_covered: u32,
    // And the link of each proxy node.
    at_links: u32,
    // Gaps in f32 are known to this, if they are no greater than known_to [m].
    gap_band: real,
    known_to: real,
    // Contact stiffness of the first and of the last stage [N/m].
    first_kc: real,
    kc: real,
    // Relative residual at which a configuration has converged.
    tolerance: real,
    // Roots of the greatest mobility of a node, and of what facets stand off their triangles by [sqrt(m/N)].
    mobility: real,
    bulge_mobility: real,
    // By how much facets stand off their triangles at rest [m].
    bulge: real,
    // Least contact force in the energy norm that depths resolve to the tolerance, over kc [sqrt(J) m/N].
    least_scale: real,
    // Below this distance to an edge or vertex the direction to it is rounding [m].
    least_distance: real,
}

alias Parameters = SearchParameters;

// Whether the compliance has one number for a pair of nodes.
override ISOTROPIC: bool = false;

// Whether the tangent is wanted.
override WITH_TANGENT: bool = false;

// --- Words of a workspace ---

const PHASE: u32 = 0u;
const STATUS: u32 = 1u;
const ITERATIONS: u32 = 2u;
// Which of the two lists of rows, and of the two vectors of forces, is the state's; the other one is the trial's.
const HALF: u32 = 3u;
// Slots of the support in use.
const SLOTS: u32 = 4u;
// Rows of either list.
const ROWS: u32 = 5u;
// What the trial, and the linear solve, is for.
const TRIAL_KIND: u32 = 7u;
const PURPOSE: u32 = 8u;
// Passes of the step, attempts to damp it, iterations left of the linear solve.
const PASS: u32 = 9u;
const ATTEMPTS: u32 = 10u;
const LEFT: u32 = 11u;
// Whether the step is that of the pass before.
const RESTORED: u32 = 12u;
// Rows that touch in this pass.
const TAKEN: u32 = 13u;
// Steps away from a saddle that were tried.
const NUDGES: u32 = 14u;
// Not zero once rows or support outgrew their room, or the compliance.
const OVERFLOW: u32 = 15u;
// Joint whose response is solved for, and whether there is a tangent.
const JOINT: u32 = 16u;
const HAS_TANGENT: u32 = 17u;
// Touches, and whether the result may depend on nodes that the compliance does not cover.
const TOUCHES: u32 = 18u;
const IS_DOUBTFUL: u32 = 19u;
// Whether the linear solve is at its beginning.
const IS_FIRST: u32 = 20u;
// What the search took in all its rounds, which benchmarks read: trials, proxy nodes that could touch, facets measured,
// surface nodes displaced, pairs of these with nodes that carry force, iterations of linear solves, pairs of nodes that
// carry force in products with C, of search_judge and of search_step, and steps of eliminations.
const TRIALS: u32 = 21u;
const CANDIDATES: u32 = 22u;
const FACETS: u32 = 23u;
const DISPLACED: u32 = 24u;
const DISPLACED_PAIRS: u32 = 25u;
const SOLVE_ITERATIONS: u32 = 26u;
const JUDGED_PAIRS: u32 = 27u;
const STEPPED_PAIRS: u32 = 28u;
const ELIMINATIONS: u32 = 29u;
// Number of the configuration in the section.
const MEMBER: u32 = 30u;
const HEADER: u32 = 31u;

// Phases: what a search has to do next. It waits for rows where it is PLACED; up to TANGENT search_judge has it, and
// beyond search_step.
const PLACED: u32 = 0u;
const JUDGE: u32 = 1u;
const STAGE: u32 = 2u;
const BALANCE: u32 = 3u;
const DECIDE: u32 = 4u;
const PROBE: u32 = 5u;
const TANGENT: u32 = 6u;
const STEP: u32 = 7u;
const FACTORISE: u32 = 8u;
const PRECONDITION: u32 = 9u;
const ITERATE: u32 = 10u;
const PRODUCT: u32 = 11u;
const MODEL: u32 = 12u;
const RESTORE: u32 = 13u;
const GO_ON: u32 = 14u;
const TRY: u32 = 15u;
const NUDGE: u32 = 16u;
const PLACE: u32 = 17u;
const RESPOND: u32 = 18u;
const RESPONDED: u32 = 19u;
const ACCOUNT: u32 = 20u;
const DONE: u32 = 21u;

// Kinds of trials.
const AT_REST: u32 = 0u;
const STEPPED: u32 = 1u;
const NUDGED: u32 = 2u;

// Kinds of linear solves.
const FOR_STEP: u32 = 0u;
const FOR_PROBE: u32 = 1u;
const FOR_TANGENT: u32 = 2u;

// Numbers of a row in words, its nodes' places and slots aside.
const ROW_WORDS: u32 = 4u;

// Of each proxy node: whether it has touched; facet that was closest last, plus one.
fn at_watched(node: u32) -> u32 {
    return HEADER + node;
}

fn at_last(node: u32) -> u32 {
    return HEADER + parameters.proxy_nodes + node;
}

// Proxy nodes that can touch.
fn at_candidate(entry: u32) -> u32 {
    return HEADER + 2u * parameters.proxy_nodes + entry;
}

// Places of nodes that are displaced next.
fn at_near(entry: u32) -> u32 {
    return HEADER + 3u * parameters.proxy_nodes + entry;
}

// Slot of a place, plus one; place of a slot.
fn at_slot(place: u32) -> u32 {
    return at_near(parameters.covered) + place;
}

fn at_place(slot: u32) -> u32 {
    return at_slot(parameters.covered) + slot;
}

// Where a row does not press on one of its nodes.
const NO_PART: u32 = 0xffffffffu;

// Proxy node, facet, feature and number of nodes of a row; then its nodes' places, their slots, and how many rows press
// on each before it, or NO_PART.
fn at_row(half: u32, row: u32) -> u32 {
    return at_place(parameters.support) + (half * parameters.contacts + row) * (ROW_WORDS + 3u * parameters.carriers);
}

// Whether a row touches in this pass.
fn at_active(row: u32) -> u32 {
    return at_row(2u, 0u) + row;
}

// Rows that touch.
fn at_taken(entry: u32) -> u32 {
    return at_active(parameters.contacts) + entry;
}

// The first of the parts of each slot, and behind the last slot their number.
fn at_start(slot: u32) -> u32 {
    return at_taken(parameters.contacts) + slot;
}

// --- Reals of a workspace: each vector begins at a multiple of four ---

fn to_four(count: u32) -> u32 {
    return (count + 3u) / 4u * 4u;
}

const ENERGY: u32 = 0u;
const ELASTIC: u32 = 1u;
const TRIAL_ELASTIC: u32 = 2u;
const STIFFNESS: u32 = 3u;
const DAMPING: u32 = 4u;
const GROWTH: u32 = 5u;
// Greatest length of a step, and that of the last one if it was poor [sqrt(J)].
const GREATEST: u32 = 6u;
const LENGTH: u32 = 7u;
// Relative residual by which the search goes on, and that of the forces as they are.
const RESIDUAL: u32 = 8u;
const IMBALANCE: u32 = 9u;
// What the step promises [J], and its length.
const PREDICTED: u32 = 10u;
const STEP_LENGTH: u32 = 11u;
// How far the surface is from where it rests, at the trial [m].
const MOVED: u32 = 12u;
const BULGE: u32 = 13u;
// 1 + mu.
const STIFFENING: u32 = 14u;
// The linear solve: square of its residual, and where it ends.
const SQUARE: u32 = 15u;
const STOP: u32 = 16u;
// Length of the direction of negative curvature.
const DESCENT: u32 = 17u;
// By how much the model is less at the step [J].
const DECREASE: u32 = 18u;
// In fours.
const SCALARS: u32 = 20u;

// Of each joint a point of its axis; zero where it turns, one where it slides; and the axis.
fn at_joint(joint: u32) -> u32 {
    return SCALARS + 8u * joint;
}

const SLIDES: u32 = 3u;
const AXIS: u32 = 4u;

// Force over kc that the last step predicts for each proxy node.
fn at_predicted(node: u32) -> u32 {
    return at_joint(parameters.joints) + node;
}

// Displacement of each covered node.
fn at_displacement(place: u32) -> u32 {
    return to_four(at_predicted(parameters.proxy_nodes)) + 4u * place;
}

// Parts of a row: see src/contact/law/depth.rs. Behind them the weights of its nodes, and the slopes of these by either
// parameter.
const NORMAL: u32 = 0u;
const DEPTH: u32 = 3u;
const SHARE: u32 = 4u;
const MULTIPLIER: u32 = 5u;
const DISTANCE: u32 = 6u;
const INVERSE_DISTANCE: u32 = 7u;
const ALONG: u32 = 8u;
const TANGENT_0: u32 = 12u;
const TANGENT_1: u32 = 16u;
const BENDING: u32 = 20u;
const TURNING: u32 = 24u;
const CORNERS: u32 = 28u;
const NODE_WEIGHTS: u32 = 32u;

fn at_numbers(half: u32, row: u32) -> u32 {
    return at_displacement(parameters.covered)
        + (half * parameters.contacts + row) * (NODE_WEIGHTS + 3u * parameters.carriers);
}

// Force of each row after the step, over kc; reaction of each row: at its point and by its tangents; its push.
fn at_force(row: u32) -> u32 {
    return at_numbers(2u, 0u) + row;
}

fn at_reaction(row: u32) -> u32 {
    return at_force(to_four(parameters.contacts)) + 12u * row;
}

fn at_push(row: u32) -> u32 {
    return at_reaction(parameters.contacts) + row;
}

// Of the rows that touch: by how much they are to be deepened, and the inverse of the system of their pushes.
fn at_deepening(entry: u32) -> u32 {
    return at_push(parameters.contacts) + entry;
}

fn at_inverse(row: u32, column: u32) -> u32 {
    return at_deepening(parameters.contacts) + row * parameters.contacts + column;
}

// What rows press on the nodes, slot by slot: weight and slopes of the node in the row, and the row.
fn at_part(part: u32) -> u32 {
    return to_four(at_inverse(parameters.contacts, 0u)) + 4u * part;
}

// The tangent, row by row; the torque.
fn at_tangent(row: u32, column: u32) -> u32 {
    return at_part(parameters.contacts * parameters.carriers) + row * parameters.joints + column;
}

fn at_torque(joint: u32) -> u32 {
    return at_tangent(parameters.joints, 0u) + joint;
}

// Vectors on the support, behind the forces of state and trial.
const CONTACT_FORCES: u32 = 2u;
// r = c - f, and C r.
const OUT_OF_BALANCE: u32 = 3u;
const BALANCE_PRODUCT: u32 = 4u;
// The step as a force and as a displacement, and that of the pass before.
const STEP_FORCE: u32 = 5u;
const STEP_DISPLACEMENT: u32 = 6u;
const PREVIOUS_FORCE: u32 = 7u;
const PREVIOUS_DISPLACEMENT: u32 = 8u;
// What the linear solve leaves, and C times that.
const LEFT_OVER: u32 = 9u;
const LEFT_PRODUCT: u32 = 10u;
const PRECONDITIONED_FORCE: u32 = 11u;
const PRECONDITIONED: u32 = 12u;
const DIRECTION_FORCE: u32 = 13u;
const DIRECTION: u32 = 14u;
const HESSIAN_DIRECTION: u32 = 15u;
const VECTORS: u32 = 16u;

// The load of each joint's motion, and the response to it.
fn load_of(joint: u32) -> u32 {
    return VECTORS + joint;
}

fn response_to(joint: u32) -> u32 {
    return VECTORS + parameters.joints + joint;
}
