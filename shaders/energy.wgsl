// The energy form: minimum of 1/2 u^T K u + 1/2 kc sum_i depth_i(u)^2 (twin: src/contact/equilibrium/energy.rs). One
// workgroup a configuration; invocation k keeps contact k.
//
// Steps are found otherwise (trust_region.wgsl), and two things more differ from the twin, both because of f32. Depths
// are known to some 1e-9 m, which stiff contact turns into forces far above the tolerance; so a Newton step that is
// small itself also ends the search, and the contact forces follow from it by the linear law kc (depth + N . du), in
// which the small numbers are not differences of large ones. And where two steps in a row change no depth by more than
// rounding, the search ends as well: f32 can tell no more. The residual says how good that is.

// Geometry frozen at rest: linearised contact.
override FROZEN: bool = false;

// What displaces the surface.
const MOVING: u32 = DIRECTION_FORCE;

// Brings support, contact forces and residual force up to date with a contact of each invocation; returns r . C r and
// c . C c.
fn balance(contact: Contact, kc: f32, local: u32) -> vec2<f32> {
    occupy(contact, local);
    press(contact, kc, local);
    workgroupBarrier();
    for (var slot = local; slot < support_count; slot += WORKGROUP) {
        let force = gather(slot);
        put(IMAGE, slot, force);
        put(BALANCE, slot, force - entry(FORCES, slot));
    }
    workgroupBarrier();
    var squares = vec4<f32>(0.0);
    for (var slot = local; slot < support_count; slot += WORKGROUP) {
        let product = multiply(BALANCE, slot);
        squares.x += dot(entry(BALANCE, slot), product);
        squares.y += dot(entry(IMAGE, slot), multiply(IMAGE, slot));
    }
    return max(add_up(squares, busy(), local).xy, vec2<f32>(0.0));
}

@compute @workgroup_size(WORKGROUP)
fn main(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) local: u32,
) {
    let place = unfold(group, groups);
    if place >= parameters.configurations {
        return;
    }
    workspace_base = place * (parameters.covered + 2u * parameters.clusters);
    position_base = list[1u + parameters.first + place] * parameters.proxy_nodes;
    begin_trials(local);
    for (var slot = local; slot < SUPPORT; slot += WORKGROUP) {
        put(FORCES, slot, vec3<f32>(0.0));
    }
    // Of the frozen problem: nodes farther from the surface than this can never touch (see the twin).
    var reach = 0.0;
    if FROZEN {
        var square = 0.0;
        for (var node = local; node < parameters.proxy_nodes; node += WORKGROUP) {
            let depth = max(-positions[position_base + node].w, 0.0);
            square += depth * depth;
        }
        square = add_up(vec4<f32>(square, 0.0, 0.0, 0.0), parameters.proxy_nodes, local).x;
        reach = sqrt(parameters.kc * square * parameters.softest);
    }

    // Stages of growing stiffness, each from the state before.
    var kc = parameters.kc;
    if !FROZEN {
        // A spring pressed in beyond a node's radius would pull the node's centre through the surface.
        var radii = 1.0;
        for (var node = local; node < parameters.proxy_nodes; node += WORKGROUP) {
            let radius = proxy_radius(node);
            radii = max(radii, select(0.0, -positions[position_base + node].w / max(radius, LEAST_DIVISOR), radius > 0.0));
        }
        kc = min(kc, CONTINUATION_START / parameters.softest * greatest(radii, parameters.proxy_nodes, local));
    }
    var outcome = SolverResult();
    var contact = Contact();
    var row = Contact();
    var elastic = 0.0;
    var energy = 0.0;
    var square = 0.0;
    var scale = 1.0;
    var first_radius = 0.0;
    var radius = 0.0;
    var step = Step();
    var settled = false;
    var new_stage = false;
    var converged = false;
    // Where the forces of the result are.
    var result = FORCES;
    // Each pass takes up a new stage, or tries the forces in DIRECTION_FORCE, none at first; and then steps on.
    while overflow == 0u {
        let at_rest = outcome.iterations == 0u && !new_stage;
        var accepted = true;
        var trial = contact;
        trial_number += 1.0;
        var work_done = vec4<f32>(0.0);
        for (var slot = local; slot < support_count; slot += WORKGROUP) {
            work_done.x += dot(entry(DIRECTION_FORCE, slot), multiply(DIRECTION_FORCE, slot));
        }
        let twice_elastic = max(add_up(work_done, support_count, local).x, 0.0);
        if new_stage {
            kc = min(parameters.kc, CONTINUATION_FACTOR * kc);
        } else {
            if !FROZEN || at_rest {
                // |u_j|^2 <= |C_jj| |u|^2, the last in the energy norm.
                trial = deformed(sqrt(parameters.mobility * twice_elastic) * (1.0 + SEARCH_SLACK), reach, local);
            }
            if FROZEN {
                if at_rest {
                    row = freeze(trial);
                }
                trial = frozen_contact(row);
            }
            // As the step predicted it; zero for a contact that it did not know of.
            trial.multiplier = kc * max(contact.depth + step.deepening, 0.0);
        }
        var sums = vec4<f32>(0.0);
        let trial_depth = max(trial.depth, 0.0);
        sums.y = trial_depth * trial_depth;
        sums.z = max(contact.depth, 0.0) * length(proxy_position(contact.proxy_node));
        sums = add_up(sums, contact_count, local);
        let trial_energy = 0.5 * twice_elastic + 0.5 * kc * sums.y;
        if at_rest || new_stage {
            // 1/2 |u|^2 in the energy norm never exceeds E.
            first_radius = sqrt(2.0 * trial_energy);
            radius = first_radius;
        } else {
            // Near the solution both decreases drown in rounding, which must not refuse a good step.
            let rounding = ENERGY_ROUNDING * (energy + kc * sums.z);
            let promised = step.predicted + rounding;
            // Contacts that come and go may leave a step that promises nothing.
            let ratio = select(0.0, (energy - trial_energy + rounding) / promised, promised > 0.0);
            if !(ratio >= POOR_SHARE) {
                radius = SHRINK * step.length;
            } else if ratio > GOOD_SHARE && step.at_boundary {
                radius *= WIDEN;
            }
            accepted = ratio >= ACCEPTED_SHARE;
        }
        if accepted {
            contact = trial;
            elastic = 0.5 * twice_elastic;
            energy = trial_energy;
            for (var slot = local; slot < support_count; slot += WORKGROUP) {
                put(FORCES, slot, entry(DIRECTION_FORCE, slot));
            }
            workgroupBarrier();
            let squares = balance(contact, kc, local);
            square = squares.x;
            scale = max(sqrt(squares.y), RESIDUAL_FLOOR);
            outcome.residual = sqrt(square) / scale;
        }
        new_stage = kc < parameters.kc
            && (outcome.residual <= STAGE_TOLERANCE || !(radius >= STALLED_RADIUS * first_radius));
        if new_stage {
            // The state as it is, as a trial at the next stiffness.
            for (var slot = local; slot < support_count; slot += WORKGROUP) {
                put(DIRECTION_FORCE, slot, entry(FORCES, slot));
            }
            workgroupBarrier();
            continue;
        }
        converged = kc == parameters.kc && outcome.residual <= parameters.tolerance;
        if converged || outcome.iterations >= parameters.max_iterations || !(radius >= GIVE_UP_RADIUS * first_radius)
            || overflow != 0u
        {
            break;
        }

        outcome.iterations += 1u;
        let inner = clamp(outcome.residual, INNER_TOLERANCE_FLOOR, INNER_TOLERANCE);
        step = trust_region_step(contact, kc, square, radius, inner, local);
        let after = max(contact.depth + step.deepening, 0.0);
        let felt = greatest(select(0.0, abs(step.deepening), max(contact.depth, after) > 0.0), contact_count, local);
        var work = vec4<f32>(0.0);
        work.y = after;
        for (var slot = local; slot < support_count; slot += WORKGROUP) {
            let forces = entry(FORCES, slot);
            let step_force = entry(STEP_FORCE, slot);
            put(DIRECTION_FORCE, slot, forces + step_force);
            work.x += dot(forces + 0.5 * step_force, entry(STEP, slot));
        }
        work = add_up(work, busy(), local);
        let settled_before = settled;
        settled = felt <= parameters.depth_rounding;
        let small = step.length <= parameters.tolerance * scale || (settled && settled_before);
        if small && !step.at_boundary && work.y > 0.0 {
            if kc < parameters.kc {
                // f32 can tell no more at this stage.
                new_stage = true;
                for (var slot = local; slot < support_count; slot += WORKGROUP) {
                    put(DIRECTION_FORCE, slot, entry(FORCES, slot));
                }
                workgroupBarrier();
                continue;
            }
            elastic += work.x;
            contact.depth = after;
            result = DIRECTION_FORCE;
            outcome.residual = step.length / scale;
            converged = true;
            break;
        }
    }

    let used = write_contacts(contact, kc, result, place, local);
    if local == 0u {
        outcome.status = select(STATUS_UNCONVERGED, STATUS_CONTACT, converged);
        outcome.elastic = elastic;
        outcome.touches = used;
        write_outcome(place, outcome);
    }
}
