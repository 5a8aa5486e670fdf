// From one trial to the next: a damped Newton step, a step away from a saddle, or the response to a joint's motion
// (twins: src/contact/equilibrium/newton.rs and tangent.rs). Phases stand in the order in which they mostly follow each
// other: software rasterisers pass through the code of those that are not wanted.

const OWN_PAIRS: u32 = STEPPED_PAIRS;

// --- One damped Newton step ---

fn begin_step(local: u32) {
    sync();
    for (var slot = local; slot < slots; slot += WORKGROUP) {
        clear_step(slot);
        put(LEFT_OVER, slot, vector_entry(OUT_OF_BALANCE, slot));
        put(LEFT_PRODUCT, slot, vector_entry(BALANCE_PRODUCT, slot));
    }
    for (var row = local; row < row_count; row += WORKGROUP) {
        set_word(at_active(row), select(0u, 1u, scalar(numbers(row) + DEPTH) > 0.0));
    }
    if local == 0u {
        begin_solve(FOR_STEP, 1.0 + scalar(DAMPING));
        go_to(FACTORISE);
    }
}

// P r as force and displacement, from r = LEFT_OVER and C r = LEFT_PRODUCT, and the direction in which it is best to go
// on.
fn precondition(local: u32) {
    let taken = word(TAKEN);
    let stiffening = scalar(STIFFENING);
    for (var row = local; row < row_count; row += WORKGROUP) {
        if !is_active(row) {
            set_reaction(row, Variation(vec3<real>(0.0), vec3<real>(0.0), vec3<real>(0.0)));
        }
    }
    for (var a = local; a < taken; a += WORKGROUP) {
        let row = word(at_taken(a));
        set_scalar(at_deepening(a), -dot(vector_at(numbers(row) + NORMAL), moved_point(row, LEFT_PRODUCT)));
    }
    sync();
    for (var a = local; a < taken; a += WORKGROUP) {
        var push = real(0.0);
        for (var b = 0u; b < taken; b += 1u) {
            push += scalar(at_inverse(b, a)) * scalar(at_deepening(b));
        }
        let row = word(at_taken(a));
        set_scalar(at_push(a), push);
        set_reaction(row, Variation(push * vector_at(numbers(row) + NORMAL), vec3<real>(0.0), vec3<real>(0.0)));
    }
    sync();
    var square = vec3<real>(0.0);
    for (var slot = local; slot < slots; slot += WORKGROUP) {
        let residual = vector_entry(LEFT_OVER, slot);
        var displacement = vector_entry(LEFT_PRODUCT, slot);
        for (var a = 0u; a < taken; a += 1u) {
            if ISOTROPIC {
                displacement += column_size(a, slot) * vector_at(at_reaction(word(at_taken(a))));
            } else {
                displacement += scalar(at_push(a)) * column_entry(a, slot);
            }
        }
        displacement = displacement / stiffening;
        put(PRECONDITIONED_FORCE, slot, (residual + gather(slot)) / stiffening);
        put(PRECONDITIONED, slot, displacement);
        square.x += dot(residual, displacement);
    }
    let next = add_up(square, local).x;
    let is_first = word(IS_FIRST) != 0u;
    let ratio = select(next / scalar(SQUARE), real(0.0), is_first);
    for (var slot = local; slot < slots; slot += WORKGROUP) {
        var force = vector_entry(PRECONDITIONED_FORCE, slot);
        var displacement = vector_entry(PRECONDITIONED, slot);
        if !is_first {
            force += ratio * vector_entry(DIRECTION_FORCE, slot);
            displacement += ratio * vector_entry(DIRECTION, slot);
        }
        put(DIRECTION_FORCE, slot, force);
        put(DIRECTION, slot, displacement);
    }
    sync();
    if local == 0u {
        if is_first && word(PASS) == 0u {
            set_scalar(STOP, inner_tolerance() * inner_tolerance() * next);
        }
        set_word(IS_FIRST, 0u);
        set_scalar(SQUARE, next);
        go_to(after_iteration());
    }
}

// Relative residual to which a linear solve is asked for.
fn inner_tolerance() -> real {
    let purpose = word(PURPOSE);
    if purpose == FOR_STEP {
        return clamp(scalar(RESIDUAL), INNER_TOLERANCE_FLOOR, INNER_TOLERANCE);
    }
    return select(RESPONSE_TOLERANCE, PROBE_TOLERANCE, purpose == FOR_PROBE);
}

// What follows an iteration of the linear solve; for one invocation.
fn after_iteration() -> u32 {
    if word(LEFT) > 0u && scalar(SQUARE) > scalar(STOP) {
        return ITERATE;
    }
    let purpose = word(PURPOSE);
    if purpose == FOR_PROBE {
        return converged();
    }
    return select(RESPONDED, MODEL, purpose == FOR_STEP);
}

// What follows a direction of negative curvature; for one invocation.
fn after_negative_curvature(lacking: real) -> u32 {
    let purpose = word(PURPOSE);
    if purpose == FOR_PROBE {
        return NUDGE;
    }
    if purpose == FOR_TANGENT {
        return ACCOUNT;
    }
    let attempts = word(ATTEMPTS) + 1u;
    let damping = scalar(DAMPING);
    set_word(ATTEMPTS, attempts);
    set_scalar(DAMPING, damping + max(lacking + CURVATURE_MARGIN, damping));
    // No step is as good as one of no length, which ends the search.
    set_scalar(LENGTH, select(scalar(LENGTH), real(0.0), attempts >= DAMPING_ATTEMPTS));
    return select(STEP, DECIDE, attempts >= DAMPING_ATTEMPTS);
}

// One iteration of conjugate gradients: a step along the direction.
fn iterate(local: u32) {
    let kc = scalar(STIFFNESS);
    let stiffening = scalar(STIFFENING);
    let before = scalar(SQUARE);
    for (var row = local; row < row_count; row += WORKGROUP) {
        let at = numbers(row);
        let v = variation(row, DIRECTION);
        let push = select(real(0.0), kc * scalar(at + SHARE) * dot(vector_at(at + NORMAL), v.point), is_active(row));
        set_reaction(row, stretched_and_bent(at, push, v));
    }
    sync();
    var work = vec3<real>(0.0);
    for (var slot = local; slot < slots; slot += WORKGROUP) {
        let force = vector_entry(DIRECTION_FORCE, slot);
        let product = stiffening * force + gather(slot);
        put(HESSIAN_DIRECTION, slot, product);
        work.x += dot(vector_entry(DIRECTION, slot), product);
        work.y += dot(vector_entry(DIRECTION, slot), force);
    }
    let sum = add_up(work, local);
    let is_convex = sum.x > 0.0;
    let share = select(real(0.0), before / sum.x, is_convex);
    for (var slot = local; slot < slots; slot += WORKGROUP) {
        put(STEP_FORCE, slot, vector_entry(STEP_FORCE, slot) + share * vector_entry(DIRECTION_FORCE, slot));
        put(STEP_DISPLACEMENT, slot, vector_entry(STEP_DISPLACEMENT, slot) + share * vector_entry(DIRECTION, slot));
        put(LEFT_OVER, slot, vector_entry(LEFT_OVER, slot) - share * vector_entry(HESSIAN_DIRECTION, slot));
    }
    sync();
    if local == 0u {
        set_word(LEFT, word(LEFT) - 1u);
        tally(SOLVE_ITERATIONS, 1u);
        if is_convex {
            go_to(PRODUCT);
        } else {
            set_scalar(DESCENT, root(sum.y));
            go_to(after_negative_curvature(-sum.x / sum.y));
        }
    }
}

// C times what the linear solve leaves.
fn take_product(local: u32) {
    multiply(LEFT_OVER, LEFT_PRODUCT, local);
    sync();
    if local == 0u {
        go_to(PRECONDITION);
    }
}

// By how much the model is less at the step than at the state; notes the rows' forces there, and which then touch.
fn model(local: u32) {
    let kc = scalar(STIFFNESS);
    var sum = vec3<real>(0.0);
    for (var slot = local; slot < slots; slot += WORKGROUP) {
        let displacement = vector_entry(STEP_DISPLACEMENT, slot);
        let force = vector_entry(STEP_FORCE, slot);
        sum.x += dot(displacement, vector_entry(OUT_OF_BALANCE, slot))
            - 0.5 * scalar(STIFFENING) * dot(displacement, force);
        sum.z += dot(displacement, force);
    }
    for (var row = local; row < row_count; row += WORKGROUP) {
        let at = numbers(row);
        let depth = scalar(at + DEPTH);
        let v = variation(row, STEP_DISPLACEMENT);
        let change = dot(vector_at(at + NORMAL), v.point);
        if scalar(at + MULTIPLIER) != 0.0 {
            let bent = second_variation(at, v);
            sum.x -= 0.5 * scalar(at + MULTIPLIER)
                * (dot(bent.point, v.point) + dot(bent.tangent_0, v.tangent_0) + dot(bent.tangent_1, v.tangent_1));
        }
        let force = scalar(at + SHARE) * max(depth + change, real(0.0));
        let before = force_over_kc(at);
        // The part that is of first order is in the residual.
        let same = (depth > 0.0) == (force > 0.0);
        let stretch =
            select(force * (depth + change) - before * (depth + 2.0 * change), (force - before) * change, same);
        sum.x -= 0.5 * kc * stretch;
        set_scalar(at_force(row), force);
        if (force > 0.0) != is_active(row) {
            sum.y += 1.0;
            set_word(at_active(row), select(0u, 1u, force > 0.0));
        }
    }
    sum = add_up(sum, local);
    if local == 0u {
        go_to(after_model(sum.x, sum.y > 0.0, sum.z));
    }
}

// What follows a pass of the step, by which the model decreases, other rows may touch, and the square of the step's
// length; for one invocation.
fn after_model(decrease: real, has_changed: bool, square: real) -> u32 {
    let number = word(PASS);
    if word(RESTORED) == 0u {
        if number > 0u && !(decrease > scalar(DECREASE)) {
            // Contacts came and went to no avail: the pass before was better.
            set_word(RESTORED, 1u);
            return RESTORE;
        }
        set_scalar(DECREASE, decrease);
        if has_changed && number + 1u < MODEL_PASSES {
            return GO_ON;
        }
    }
    set_scalar(PREDICTED, scalar(DECREASE) + 0.5 * scalar(DAMPING) * square);
    set_scalar(STEP_LENGTH, root(square));
    return TRY;
}

fn restore(local: u32) {
    sync();
    for (var slot = local; slot < slots; slot += WORKGROUP) {
        put(STEP_FORCE, slot, vector_entry(PREVIOUS_FORCE, slot));
        put(STEP_DISPLACEMENT, slot, vector_entry(PREVIOUS_DISPLACEMENT, slot));
    }
    if local == 0u {
        go_to(MODEL);
    }
}

// The residual force of the model at the step, for another pass.
fn go_on(local: u32) {
    let kc = scalar(STIFFNESS);
    for (var row = local; row < row_count; row += WORKGROUP) {
        let at = numbers(row);
        let push = kc * (scalar(at_force(row)) - force_over_kc(at));
        set_reaction(row, stretched_and_bent(at, push, variation(row, STEP_DISPLACEMENT)));
    }
    sync();
    for (var slot = local; slot < slots; slot += WORKGROUP) {
        let own = scalar(STIFFENING) * vector_entry(STEP_FORCE, slot);
        put(LEFT_OVER, slot, vector_entry(OUT_OF_BALANCE, slot) - own - gather(slot));
    }
    sync();
    multiply(LEFT_OVER, LEFT_PRODUCT, local);
    if local == 0u {
        set_word(PASS, word(PASS) + 1u);
        go_to(FACTORISE);
    }
}

// The forces to which the step leads, and what it predicts for the rows.
fn try_step(local: u32) {
    for (var node = local; node < parameters.proxy_nodes; node += WORKGROUP) {
        set_scalar(at_predicted(node), real(0.0));
    }
    for (var slot = local; slot < slots; slot += WORKGROUP) {
        put(1u - own, slot, vector_entry(own, slot) + vector_entry(STEP_FORCE, slot));
    }
    sync();
    for (var row = local; row < row_count; row += WORKGROUP) {
        set_scalar(at_predicted(word(row_words(row))), scalar(at_force(row)));
    }
    if local == 0u {
        set_word(TRIAL_KIND, STEPPED);
        go_to(PLACE);
    }
}

// The energy that the trial's forces store, and how far from rest that can move the surface.
fn place(local: u32) {
    let trial = 1u - own;
    multiply(trial, LEFT_PRODUCT, local);
    var work = vec3<real>(0.0);
    for (var slot = local; slot < slots; slot += WORKGROUP) {
        work.x += dot(vector_entry(trial, slot), vector_entry(LEFT_PRODUCT, slot));
    }
    let elastic = 0.5 * add_up(work, local).x;
    if local == 0u {
        let norm = sqrt(2.0 * max(elastic, real(0.0))) * (1.0 + LENGTH_ROUNDING);
        let bulging = parameters.bulge_mobility * norm;
        set_scalar(TRIAL_ELASTIC, elastic);
        set_scalar(MOVED, parameters.mobility * norm + bulging);
        set_scalar(BULGE, parameters.bulge + bulging);
        go_to(PLACED);
    }
}

// Tries a step from a saddle along a direction of negative curvature, to one side and the other, ever shorter.
fn nudge(local: u32) {
    sync();
    let number = word(NUDGES);
    var length = NUDGE_LENGTH * root(2.0 * scalar(ENERGY)) / scalar(DESCENT);
    for (var k = 0u; k < number / 2u; k += 1u) {
        length *= 0.5;
    }
    let side = select(length, -length, number % 2u == 1u);
    for (var slot = local; slot < slots; slot += WORKGROUP) {
        put(1u - own, slot, vector_entry(own, slot) + side * vector_entry(DIRECTION_FORCE, slot));
    }
    if local == 0u {
        set_word(TRIAL_KIND, NUDGED);
        go_to(PLACE);
    }
}

// Begins the solve for the response to one joint's motion.
fn respond(local: u32) {
    let joint = word(JOINT);
    for (var slot = local; slot < slots; slot += WORKGROUP) {
        clear_step(slot);
        put(LEFT_OVER, slot, vector_entry(load_of(joint), slot));
    }
    sync();
    if local == 0u {
        begin_solve(FOR_TANGENT, real(1.0));
        go_to(PRODUCT);
    }
}

// Adds what a response adds to the tangent.
fn take_response(local: u32) {
    let joint = word(JOINT);
    for (var slot = local; slot < slots; slot += WORKGROUP) {
        put(response_to(joint), slot, vector_entry(STEP_DISPLACEMENT, slot));
    }
    sync();
    for (var l = 0u; l <= joint; l += 1u) {
        var sum = vec3<real>(0.0);
        for (var slot = local; slot < slots; slot += WORKGROUP) {
            // What the residual adds makes the error a product of those of both responses.
            sum.x += dot(vector_entry(load_of(l), slot), vector_entry(STEP_DISPLACEMENT, slot))
                + dot(vector_entry(response_to(l), slot), vector_entry(LEFT_OVER, slot));
        }
        sum = add_up(sum, local);
        if local == 0u {
            set_scalar(at_tangent(joint, l), scalar(at_tangent(joint, l)) + sum.x);
        }
    }
    if local == 0u {
        set_word(JOINT, joint + 1u);
        let is_last = joint + 1u == parameters.joints;
        set_word(HAS_TANGENT, select(0u, 1u, is_last));
        go_to(select(RESPOND, ACCOUNT, is_last));
    }
}

// --- Results ---

// Torque, number of touches, and whether the compliance covers all that the result depends on (src/contact/reach.rs).
fn account(local: u32) {
    let kc = parameters.kc;
    var sum = vec3<real>(0.0);
    // How far the state has moved the surface.
    let norm = sqrt(2.0 * max(scalar(ELASTIC), real(0.0))) * (1.0 + LENGTH_ROUNDING);
    let moved = (parameters.mobility + parameters.bulge_mobility) * norm;
    for (var row = local; row < row_count; row += WORKGROUP) {
        if scalar(numbers(row) + DEPTH) > 0.0 {
            sum.x += 1.0;
            sum.y += select(real(1.0), real(0.0), is_covered(word(row_words(row)), moved));
        }
    }
    sum = add_up(sum, local);
    for (var joint = 0u; joint < parameters.joints; joint += 1u) {
        var torque = vec3<real>(0.0);
        for (var row = local; row < row_count; row += WORKGROUP) {
            let at = numbers(row);
            torque.x += kc * force_over_kc(at)
                * dot(vector_at(at + NORMAL), jacobian(word(row_words(row)), joint));
        }
        torque = add_up(torque, local);
        if local == 0u {
            set_scalar(at_torque(joint), torque.x);
        }
    }
    if local == 0u {
        set_word(TOUCHES, u32(sum.x));
        set_word(IS_DOUBTFUL, select(0u, 1u, sum.y > 0.0));
        advance(DONE, (row_count / WORKGROUP + 1u) * (parameters.triangles / 4u + 8u * parameters.joints));
    }
}

// Whether the compliance covers all facets that may lie as near to proxy node `node` as its closest one.
fn is_covered(node: u32, moved: real) -> bool {
    let x = proxy_position(node);
    let reach = farthest_at_rest(node) + 2.0 * moved;
    // A compliance that covers all nodes covers all facets.
    var tree = select(1u, 0u, parameters.covered == parameters.surface_nodes);
    while tree != 0u {
        let is_near = distance_to_sphere(tree, x) <= reach;
        if is_near && tree < parameters.leaves {
            tree = 2u * tree;
            continue;
        }
        if is_near && mesh[parameters.at_covered + mesh[parameters.at_order + tree - parameters.leaves]] == 0u {
            return false;
        }
        tree = behind(tree);
    }
    return true;
}

@compute @workgroup_size(WORKGROUP)
fn main(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) local: u32,
) {
    if !resume(unfold(group, groups), PLACED, local) {
        return;
    }
    loop {
        workgroupBarrier();
        if phase <= TANGENT || phase == DONE || spent >= LOOP_BUDGET {
            break;
        }
        if is_next(STEP) { begin_step(local); }
        if is_next(GO_ON) { go_on(local); }
        if is_next(FACTORISE) { factorise(local); }
        if is_next(RESPOND) { respond(local); }
        loop {
            if is_next(PRECONDITION) { precondition(local); }
            if is_next(ITERATE) { iterate(local); }
            if is_next(PRODUCT) { take_product(local); }
            if !is_next(PRECONDITION) {
                break;
            }
        }
        if is_next(MODEL) { model(local); }
        if is_next(RESTORE) { restore(local); }
        if is_next(RESPONDED) { take_response(local); }
        if is_next(TRY) { try_step(local); }
        if is_next(NUDGE) { nudge(local); }
        if is_next(PLACE) { place(local); }
        if is_next(ACCOUNT) { account(local); }
    }
    leave(local);
}
