// What the two stages of the search have in common that take it from phase to phase (twins:
// src/contact/linear/support.rs, law/springs.rs and law/depth.rs). One workgroup a configuration.
//
// A stage goes through its phases until the search has to wait for another one, or until it has done what one dispatch
// may do; then it goes on in the next round. Scalars are written by the first invocation alone, at the end of a phase,
// and read by all in the next.

override WORKGROUP: u32 = 32u;

// What the search has to do, and passes through loops in this dispatch, about. The first invocation changes them.
var<workgroup> phase: u32;
var<workgroup> spent: u32;

var<workgroup> sums: array<vec3<real>, WORKGROUP>;

// Of the state: which half is its own, where its rows begin, how many there are, and slots in use.
var<private> own: u32;
var<private> numbers_base: u32;
var<private> row_words_base: u32;
var<private> row_count: u32;
var<private> slots: u32;
// Passes through loops that an invocation makes in most phases, at most.
var<private> usual_passes: u32;

// Looks up what the phases of a state have in common.
fn look_up() {
    own = word(HALF);
    numbers_base = at_numbers(own, 0u);
    row_words_base = at_row(own, 0u);
    row_count = word(ROWS + own);
    slots = word(SLOTS);
    let rows = row_count / WORKGROUP + 1u;
    usual_passes = (slots / WORKGROUP + 1u) * (slots / 2u + row_count + 32u)
        + (rows + WORKGROUP) * (4u * parameters.carriers + row_count)
        + parameters.proxy_nodes / WORKGROUP + parameters.support / WORKGROUP;
}

// Sum of `value` over all invocations, in every one.
fn add_up(value: vec3<real>, local: u32) -> vec3<real> {
    sums[local] = value;
    workgroupBarrier();
    var sum = vec3<real>(0.0);
    for (var k = 0u; k < WORKGROUP; k += 1u) {
        sum += sums[k];
    }
    workgroupBarrier();
    return sum;
}

// Root of a square; rounding below zero counts as zero, what is not a number stays so.
fn root(square: real) -> real {
    return select(sqrt(square), real(0.0), square < 0.0);
}

// --- Support ---

// product = C vector on the support.
fn multiply(vector: u32, product: u32, local: u32) {
    for (var first = 0u; first < slots; first += 4u * WORKGROUP) {
        let slot = first + local;
        let parts = responses(vector, places_from(slot), local);
        put_four(product, slot, parts);
    }
    if local == 0u {
        tally(OWN_PAIRS, slots * slots);
    }
}

// Places of four slots that an invocation takes together; behind the last slot any.
fn places_from(slot: u32) -> vec4<u32> {
    let last = slots - 1u;
    return vec4<u32>(word(at_place(min(slot, last))), word(at_place(min(slot + WORKGROUP, last))),
        word(at_place(min(slot + 2u * WORKGROUP, last))), word(at_place(min(slot + 3u * WORKGROUP, last))));
}

fn put_four(vector: u32, slot: u32, values: array<vec3<real>, 4>) {
    if slot < slots {
        put(vector, slot, values[0]);
    }
    if slot + WORKGROUP < slots {
        put(vector, slot + WORKGROUP, values[1]);
    }
    if slot + 2u * WORKGROUP < slots {
        put(vector, slot + 2u * WORKGROUP, values[2]);
    }
    if slot + 3u * WORKGROUP < slots {
        put(vector, slot + 3u * WORKGROUP, values[3]);
    }
}

// --- Rows of the state ---

fn numbers(row: u32) -> u32 {
    return numbers_base + row * (NODE_WEIGHTS + 3u * parameters.carriers);
}

fn row_words(row: u32) -> u32 {
    return row_words_base + row * (ROW_WORDS + 3u * parameters.carriers);
}

fn is_active(row: u32) -> bool {
    return word(at_active(row)) != 0u;
}

// max(0, depth) times the node's share, of the row with these numbers.
fn force_over_kc(at: u32) -> real {
    return scalar(at + SHARE) * max(scalar(at + DEPTH), real(0.0));
}

// How displacements of a row's nodes move its closest point, and turn the surface there; or a reaction to that.
struct Variation {
    point: vec3<real>,
    tangent_0: vec3<real>,
    tangent_1: vec3<real>,
}

fn slot_of(row: u32, j: u32) -> u32 {
    return word(row_words(row) + ROW_WORDS + parameters.carriers + j);
}

fn moved_point(row: u32, vector: u32) -> vec3<real> {
    let weights = numbers(row) + NODE_WEIGHTS;
    var sum = vec3<real>(0.0);
    for (var j = 0u; j < parameters.carriers; j += 1u) {
        sum += scalar(weights + j) * vector_entry(vector, slot_of(row, j));
    }
    return sum;
}

fn variation(row: u32, vector: u32) -> Variation {
    let at = numbers(row);
    var v = Variation(moved_point(row, vector), vec3<real>(0.0), vec3<real>(0.0));
    if scalar(at + MULTIPLIER) != 0.0 {
        let slopes = at + NODE_WEIGHTS + parameters.carriers;
        for (var j = 0u; j < parameters.carriers; j += 1u) {
            let entry = vector_entry(vector, slot_of(row, j));
            v.tangent_0 += scalar(slopes + j) * entry;
            v.tangent_1 += scalar(slopes + parameters.carriers + j) * entry;
        }
    }
    return v;
}

// Product of a symmetric matrix of two rows, its entries 00, 01, 11, and a vector.
fn apply(m: vec3<real>, v: vec2<real>) -> vec2<real> {
    return vec2<real>(dot(m.xy, v), dot(m.yz, v));
}

// The reaction whose work along another variation is the second variation of the depth of both.
fn second_variation(at: u32, v: Variation) -> Variation {
    let normal = vector_at(at + NORMAL);
    let t_0 = vector_at(at + TANGENT_0);
    let t_1 = vector_at(at + TANGENT_1);
    let along = vector_at(at + ALONG);
    let sliding = vec2<real>(dot(t_0, v.point), dot(t_1, v.point));
    let tilting = vec2<real>(dot(normal, v.tangent_0), dot(normal, v.tangent_1));
    let turned = apply(vector_at(at + TURNING), tilting);
    let carried = apply(vector_at(at + TURNING), sliding);
    let slide = apply(vector_at(at + BENDING), sliding) - turned;
    let turn = carried + scalar(at + DISTANCE) * turned;
    let across = v.point - dot(normal, v.point) * normal - dot(along, v.point) * along;
    return Variation(scalar(at + INVERSE_DISTANCE) * across + slide.x * t_0 + slide.y * t_1,
        -turn.x * normal, -turn.y * normal);
}

// The reaction of a row whose spring takes `push` more under the variation v.
fn stretched_and_bent(at: u32, push: real, v: Variation) -> Variation {
    let multiplier = scalar(at + MULTIPLIER);
    var reaction = Variation(push * vector_at(at + NORMAL), vec3<real>(0.0), vec3<real>(0.0));
    if multiplier != 0.0 {
        let bent = second_variation(at, v);
        reaction.point += multiplier * bent.point;
        reaction.tangent_0 = multiplier * bent.tangent_0;
        reaction.tangent_1 = multiplier * bent.tangent_1;
    }
    return reaction;
}

fn set_reaction(row: u32, reaction: Variation) {
    let at = at_reaction(row);
    set_vector(at, reaction.point);
    set_vector(at + 4u, reaction.tangent_0);
    set_vector(at + 8u, reaction.tangent_1);
}

// Sum of what the rows' reactions press on the node in `slot`.
fn gather(slot: u32) -> vec3<real> {
    var sum = vec3<real>(0.0);
    for (var entry = word(at_start(slot)); entry < word(at_start(slot + 1u)); entry += 1u) {
        let part = four_at(at_part(entry));
        let reaction = at_reaction(u32(part.w));
        sum += part.x * vector_at(reaction) + part.y * vector_at(reaction + 4u) + part.z * vector_at(reaction + 8u);
    }
    return sum;
}

// Sets the multipliers to the rows' forces, and notes which of them touch.
fn weigh_curvature(local: u32) {
    for (var row = local; row < row_count; row += WORKGROUP) {
        let at = numbers(row);
        set_scalar(at + MULTIPLIER, scalar(STIFFNESS) * force_over_kc(at));
        set_word(at_active(row), select(0u, 1u, scalar(at + DEPTH) > 0.0));
    }
}

// Zero is the first displacement of a linear solve, for one invocation with what it is for.
fn begin_solve(purpose: u32, stiffening: real) {
    set_scalar(STIFFENING, stiffening);
    set_word(PURPOSE, purpose);
    set_word(PASS, 0u);
    set_word(RESTORED, 0u);
    set_word(IS_FIRST, 1u);
    set_word(LEFT, 3u * INNER_ITERATIONS_PER_UNKNOWN * slots);
}

fn clear_step(slot: u32) {
    put(STEP_FORCE, slot, vec3<real>(0.0));
    put(STEP_DISPLACEMENT, slot, vec3<real>(0.0));
}

// Derivative of the position of proxy node `node` by joint `joint`.
fn jacobian(node: u32, joint: u32) -> vec3<real> {
    if joint > proxy_link(node) {
        return vec3<real>(0.0);
    }
    let at = at_joint(joint);
    let axis = vector_at(at + AXIS);
    return select(cross(axis, proxy_position(node) - vector_at(at)), axis, scalar(at + SLIDES) != 0.0);
}

// What follows an equilibrium; for one invocation.
fn converged() -> u32 {
    set_word(STATUS, STATUS_CONTACT);
    return select(ACCOUNT, TANGENT, WITH_TANGENT);
}

// Sets what the search has to do next; for one invocation.
fn go_to(next: u32) {
    advance(next, usual_passes);
}

// Sets it, after so many passes through loops; for one invocation.
fn advance(next: u32, passes: u32) {
    phase = next;
    spent += passes;
}

// Whether `now` is what the search has to do, and may do in this dispatch; for all invocations together. Nothing but a
// phase, behind its first barrier, may change what is looked at here.
fn is_next(now: u32) -> bool {
    sync();
    workgroupBarrier();
    return phase == now && spent < LOOP_BUDGET;
}

// Takes up a search in the phase in which it was left, or in `first` where another stage has placed its trial; for all
// invocations together. False where there is none.
fn resume(index: u32, first: u32, local: u32) -> bool {
    if !take_up(index) {
        return false;
    }
    look_up();
    if local == 0u {
        spent = 0u;
        phase = word(PHASE);
        if phase == PLACED {
            phase = first;
        }
    }
    return true;
}

// Leaves a search in the phase in which it is; for all invocations together.
fn leave(local: u32) {
    workgroupBarrier();
    if local == 0u {
        set_word(PHASE, phase);
    }
}
