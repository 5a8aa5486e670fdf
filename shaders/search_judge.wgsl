// What a trial led to is judged, the state is balanced, and what to do next is decided (twins:
// src/contact/equilibrium/energy.rs and tangent.rs).

const OWN_PAIRS: u32 = JUDGED_PAIRS;

// Judges a trial whose rows are there.
fn judge(local: u32) {
    let trial = 1u - own;
    let kind = word(TRIAL_KIND);
    let kc = scalar(STIFFNESS);
    var work = vec3<real>(0.0);
    for (var row = local; row < word(ROWS + trial); row += WORKGROUP) {
        let at = at_numbers(trial, row);
        let force = force_over_kc(at);
        work.x += force * scalar(at + DEPTH);
        // As the step predicted it; zero for a proxy node that had no row.
        var multiplier = real(0.0);
        if kind == STEPPED {
            multiplier = kc * max(scalar(at_predicted(word(at_row(trial, row)))), real(0.0));
        } else if kind == NUDGED {
            multiplier = kc * force;
        }
        set_scalar(at + MULTIPLIER, multiplier);
    }
    if kind != AT_REST {
        for (var row = local; row < row_count; row += WORKGROUP) {
            work.y += kc * force_over_kc(numbers(row)) * length(proxy_position(word(row_words(row))));
        }
    }
    let sum = add_up(work, local);
    if local == 0u {
        go_to(verdict(scalar(TRIAL_ELASTIC) + 0.5 * kc * sum.x, sum.y, kind));
    }
}

// Takes the trial, or not; returns what is next.
fn verdict(energy: real, size: real, kind: u32) -> u32 {
    if word(OVERFLOW) != 0u {
        return overflow();
    }
    if kind == AT_REST {
        take_trial(energy);
        return STAGE;
    }
    // Near the solution both decreases drown in rounding, which must not refuse a good step.
    let rounding = ENERGY_ROUNDING * (scalar(ENERGY) + size);
    if kind == NUDGED {
        if energy < scalar(ENERGY) - rounding {
            take_trial(energy);
            set_word(ITERATIONS, word(ITERATIONS) + 1u);
            return BALANCE;
        }
        set_word(NUDGES, word(NUDGES) + 1u);
        return select(NUDGE, converged(), word(NUDGES) >= 2u * NUDGE_HALVINGS);
    }
    let promised = scalar(PREDICTED) + rounding;
    // Contacts that come and go may leave a step that promises nothing.
    let ratio = select(real(0.0), (scalar(ENERGY) - energy + rounding) / promised, promised > 0.0);
    if ratio >= POOR_SHARE {
        fade_damping(ratio > GOOD_SHARE);
        set_scalar(LENGTH, scalar(GREATEST));
    } else {
        set_scalar(DAMPING, scalar(GROWTH) * max(scalar(DAMPING), LEAST_DAMPING));
        set_scalar(GROWTH, 2.0 * scalar(GROWTH));
        set_scalar(LENGTH, scalar(STEP_LENGTH));
    }
    if ratio >= ACCEPTED_SHARE {
        take_trial(energy);
        return BALANCE;
    }
    return DECIDE;
}

fn fade_damping(is_good: bool) {
    set_scalar(GROWTH, DAMPING_GROWTH);
    let damping = scalar(DAMPING) * select(real(1.0), DAMPING_DECAY, is_good);
    set_scalar(DAMPING, select(damping, real(0.0), damping < LEAST_DAMPING));
}

fn take_trial(energy: real) {
    set_word(HALF, 1u - own);
    set_scalar(ENERGY, energy);
    set_scalar(ELASTIC, scalar(TRIAL_ELASTIC));
}

fn overflow() -> u32 {
    set_word(STATUS, STATUS_OVERFLOW);
    return DONE;
}

fn given_up() -> u32 {
    set_word(STATUS, STATUS_UNCONVERGED);
    return ACCOUNT;
}

// Takes up the contact stiffness at the state. No iterate is farther from rest in the energy norm than 1/2 |u|^2 = E.
fn begin_stage(local: u32) {
    var work = vec3<real>(0.0);
    for (var row = local; row < row_count; row += WORKGROUP) {
        let at = numbers(row);
        work.x += force_over_kc(at) * scalar(at + DEPTH);
    }
    let sum = add_up(work, local);
    if local == 0u {
        let energy = scalar(ELASTIC) + 0.5 * scalar(STIFFNESS) * sum.x;
        set_scalar(ENERGY, energy);
        set_scalar(DAMPING, real(0.0));
        set_scalar(GROWTH, DAMPING_GROWTH);
        set_scalar(GREATEST, sqrt(2.0 * energy));
        set_scalar(LENGTH, sqrt(2.0 * energy));
        go_to(BALANCE);
    }
}

// Gives every node that carries a row a slot, in the order of rows and nodes, and counts the rows that press on it.
fn occupy(local: u32) {
    let carriers = parameters.carriers;
    for (var slot = local; slot < parameters.support; slot += WORKGROUP) {
        set_word(at_start(slot), 0u);
    }
    begin_list(slots, local);
    sync();
    for (var row = 0u; row < row_count; row += 1u) {
        for (var first = 0u; first < carriers; first += WORKGROUP) {
            let j = first + local;
            let words_at = row_words(row) + ROW_WORDS;
            let weights = numbers(row) + NODE_WEIGHTS + j;
            var carries = false;
            if j < word(row_words(row) + 3u) {
                carries = scalar(weights) != 0.0 || scalar(weights + carriers) != 0.0
                    || scalar(weights + 2u * carriers) != 0.0;
            }
            var place = 0u;
            if carries {
                place = word(words_at + j);
                if place >= parameters.covered {
                    set_word(OVERFLOW, 1u);
                    carries = false;
                }
            }
            let known = word(at_slot(select(0u, place, carries)));
            let is_new = carries && known == 0u;
            var slot = place_in_list(select(0u, 1u, is_new), local);
            if is_new && slot < parameters.support {
                set_word(at_slot(place), slot + 1u);
                set_word(at_place(slot), place);
            } else if carries && !is_new {
                slot = known - 1u;
            }
            if j < carriers {
                let has_slot = carries && slot < parameters.support;
                set_word(words_at + carriers + j, select(0u, slot, has_slot));
                var before = NO_PART;
                if has_slot {
                    before = word(at_start(slot));
                    set_word(at_start(slot), before + 1u);
                }
                set_word(words_at + 2u * carriers + j, before);
            }
            sync();
        }
    }
}

// Lists what rows press on the nodes, slot by slot, each in the order of rows.
fn list_parts(local: u32) {
    begin_list(0u, local);
    for (var first = 0u; first < slots; first += WORKGROUP) {
        let slot = first + local;
        var own = 0u;
        if slot < slots {
            own = word(at_start(slot));
        }
        let start = place_in_list(own, local);
        if slot < slots {
            set_word(at_start(slot), start);
        }
    }
    if local == 0u {
        set_word(at_start(slots), listed);
    }
    sync();
    for (var item = local; item < row_count * parameters.carriers; item += WORKGROUP) {
        let row = item / parameters.carriers;
        let j = item % parameters.carriers;
        let before = word(row_words(row) + ROW_WORDS + 2u * parameters.carriers + j);
        if before != NO_PART {
            let weights = numbers(row) + NODE_WEIGHTS + j;
            set_four(at_part(word(at_start(slot_of(row, j))) + before), vec4<real>(scalar(weights),
                scalar(weights + parameters.carriers), scalar(weights + 2u * parameters.carriers), real(row)));
        }
    }
}

// Brings support, contact forces and residual force r = c - f up to date with the state.
fn balance(local: u32) {
    occupy(local);
    let kc = scalar(STIFFNESS);
    let before = slots;
    let wanted = listed;
    slots = min(wanted, parameters.support);
    list_parts(local);
    for (var row = local; row < row_count; row += WORKGROUP) {
        let at = numbers(row);
        let force = -kc * force_over_kc(at) * vector_at(at + NORMAL);
        set_reaction(row, Variation(force, vec3<real>(0.0), vec3<real>(0.0)));
    }
    sync();
    if local == 0u {
        set_word(SLOTS, slots);
        if wanted > parameters.support {
            set_word(OVERFLOW, 1u);
        }
    }
    sync();
    for (var slot = local; slot < slots; slot += WORKGROUP) {
        if slot >= before {
            put(own, slot, vec3<real>(0.0));
        }
        let force = gather(slot);
        put(CONTACT_FORCES, slot, force);
        put(OUT_OF_BALANCE, slot, force - vector_entry(own, slot));
    }
    sync();
    multiply(OUT_OF_BALANCE, BALANCE_PRODUCT, local);
    multiply(CONTACT_FORCES, LEFT_PRODUCT, local);
    var squares = vec3<real>(0.0);
    for (var slot = local; slot < slots; slot += WORKGROUP) {
        squares.x += dot(vector_entry(OUT_OF_BALANCE, slot), vector_entry(BALANCE_PRODUCT, slot));
        squares.y += dot(vector_entry(CONTACT_FORCES, slot), vector_entry(LEFT_PRODUCT, slot));
    }
    let sum = add_up(squares, local);
    if local == 0u {
        let scale = max(root(sum.y), RESIDUAL_FLOOR);
        set_scalar(IMBALANCE, root(sum.x) / scale);
        // Forces of depths that are known to less than the tolerance count as those of the least depth that is.
        set_scalar(RESIDUAL, root(sum.x) / max(scale, kc * parameters.least_scale));
        go_to(DECIDE);
    }
}

// What to do at the state; for one invocation.
fn decide() -> u32 {
    let residual = scalar(RESIDUAL);
    let kc = scalar(STIFFNESS);
    let length = scalar(LENGTH);
    let greatest = scalar(GREATEST);
    if word(OVERFLOW) != 0u {
        return overflow();
    }
    if !(residual < FAR_AWAY) {
        return given_up();
    }
    if kc < parameters.kc && (residual <= STAGE_TOLERANCE || length < STALLED_LENGTH * greatest) {
        set_scalar(STIFFNESS, min(parameters.kc, CONTINUATION_FACTOR * kc));
        return STAGE;
    }
    let may_go_on = word(ITERATIONS) < parameters.max_iterations;
    if kc == parameters.kc && residual <= parameters.tolerance {
        set_word(NUDGES, 0u);
        return select(converged(), PROBE, may_go_on);
    }
    if !may_go_on || !(length >= GIVE_UP_LENGTH * greatest) {
        return given_up();
    }
    set_word(ITERATIONS, word(ITERATIONS) + 1u);
    set_word(ATTEMPTS, 0u);
    return STEP;
}

// --- The search for a saddle, and the tangent d tau/d q ---

// A number in [-1, 1) that looks random, the same in every run (twin: src/random.rs).
fn scattered(number: u32) -> real {
    let state = number * 747796405u + 2891336453u;
    let word = ((state >> ((state >> 28u) + 4u)) ^ state) * 277803737u;
    return real((word >> 22u) ^ word) / 2147483648.0 - 1.0;
}

// Begins the search for negative curvature at a balanced state: the response to a random load.
fn probe(local: u32) {
    weigh_curvature(local);
    for (var slot = local; slot < slots; slot += WORKGROUP) {
        clear_step(slot);
        let load = vec3<real>(scattered(3u * slot), scattered(3u * slot + 1u), scattered(3u * slot + 2u));
        put(LEFT_OVER, slot, load);
    }
    sync();
    multiply(LEFT_OVER, LEFT_PRODUCT, local);
    if local == 0u {
        begin_solve(FOR_PROBE, real(1.0));
        go_to(FACTORISE);
    }
}

// The loads of the joints' motions, E_uq, and what does not pass through the object: see the twin.
fn load(local: u32) {
    weigh_curvature(local);
    sync();
    let kc = scalar(STIFFNESS);
    for (var k = 0u; k < parameters.joints; k += 1u) {
        for (var row = local; row < row_count; row += WORKGROUP) {
            let at = numbers(row);
            let v = Variation(-jacobian(word(row_words(row)), k), vec3<real>(0.0), vec3<real>(0.0));
            let push = kc * scalar(at + SHARE) * dot(vector_at(at + NORMAL), v.point);
            var reaction = Variation(vec3<real>(0.0), vec3<real>(0.0), vec3<real>(0.0));
            if is_active(row) {
                reaction = stretched_and_bent(at, push, v);
            }
            set_reaction(row, reaction);
        }
        sync();
        for (var slot = local; slot < slots; slot += WORKGROUP) {
            put(load_of(k), slot, gather(slot));
        }
        for (var l = 0u; l <= k; l += 1u) {
            var sum = vec3<real>(0.0);
            for (var row = local; row < row_count; row += WORKGROUP) {
                if is_active(row) {
                    let node = word(row_words(row));
                    let at = numbers(row);
                    let force = scalar(at + MULTIPLIER) * vector_at(at + NORMAL);
                    let turn = cross(vector_at(at_joint(l) + AXIS), jacobian(node, k));
                    sum.x += dot(vector_at(at_reaction(row)), jacobian(node, l))
                        + select(dot(force, turn), real(0.0), scalar(at_joint(l) + SLIDES) != 0.0);
                }
            }
            sum = add_up(sum, local);
            if local == 0u {
                set_scalar(at_tangent(k, l), sum.x);
            }
        }
        sync();
    }
    if local == 0u {
        set_word(JOINT, 0u);
        begin_solve(FOR_TANGENT, real(1.0));
        go_to(FACTORISE);
    }
}

@compute @workgroup_size(WORKGROUP)
fn main(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) local: u32,
) {
    if !resume(unfold(group, groups), JUDGE, local) {
        return;
    }
    if is_next(JUDGE) { judge(local); }
    loop {
        // Another half may be the state's now.
        sync();
        look_up();
        if is_next(STAGE) { begin_stage(local); }
        if is_next(BALANCE) { balance(local); }
        if !is_next(DECIDE) {
            break;
        }
        sync();
        if local == 0u {
            go_to(decide());
        }
    }
    if is_next(PROBE) { probe(local); }
    if is_next(TANGENT) { load(local); }
    leave(local);
}
