// The energy form: minimum of 1/2 u^T K u + 1/2 kc sum_i depth_i(u)^2 (twin: src/contact/energy.rs). One workgroup a
// configuration; invocation k keeps contact k.
//
// Two things differ from the twin, both because of f32. Depths are known to some 1e-9 m, which stiff contact turns into
// forces far above the tolerance; so a Newton step that is small itself also ends the search, and the contact forces
// follow from it by the linear law kc (depth + N . du), in which the small numbers are not differences of large ones.
// And where the step changes no depth by more than rounding, the search ends as well: f32 can tell no more. The residual
// says how good that is.

// Geometry frozen at rest: linearised contact.
override FROZEN: bool = false;

// Contact forces -kc depth w_j N on the object's nodes: columns.
fn contact_forces(contact: Contact) -> mat3x3<f32> {
    let force = contact.normal * (-parameters.kc * max(contact.depth, 0.0));
    return mat3x3<f32>(force * contact.weights.x, force * contact.weights.y, force * contact.weights.z);
}

// A frozen row's contact at the displacement at hand.
fn frozen_contact(row: Contact) -> Contact {
    var contact = row;
    for (var k = 0u; k < 3u; k += 1u) {
        contact.depth += row.weights[k] * dot(row.normal, displacement[displacement_base + row.nodes[k]].xyz);
    }
    return contact;
}

// Brings support, contact forces and residual up to date with a contact of each invocation; returns r . C r and c . C c.
fn balance(contact: Contact, local: u32) -> vec2<f32> {
    assign_slots(acting_nodes(contact), local);
    shares[local] = contact_forces(contact);
    workgroupBarrier();
    for (var slot = local; slot < support_count; slot += WORKGROUP) {
        let force = gather(slot);
        vectors[at(IMAGE, slot)] = force;
        vectors[at(RESIDUAL, slot)] = force - vectors[at(FORCES, slot)];
    }
    workgroupBarrier();
    var squares = vec4<f32>(0.0);
    for (var slot = local; slot < support_count; slot += WORKGROUP) {
        let preconditioned = multiply(RESIDUAL, slot);
        vectors[at(PRECONDITIONED, slot)] = preconditioned;
        // C c = C f + C r.
        let whole = displacement[displacement_base + support_nodes[slot]].xyz + preconditioned;
        squares.x += dot(vectors[at(RESIDUAL, slot)], preconditioned);
        squares.y += dot(vectors[at(IMAGE, slot)], whole);
    }
    return max(add_up(squares, local).xy, vec2<f32>(0.0));
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
    displacement_base = place * parameters.surface_nodes;
    position_base = list[1u + parameters.first + place] * parameters.proxy_nodes;

    // The rest state.
    for (var node = local; node < parameters.surface_nodes; node += WORKGROUP) {
        displacement[displacement_base + node] = vec4<f32>(0.0);
    }
    for (var slot = local; slot < SUPPORT; slot += WORKGROUP) {
        vectors[at(FORCES, slot)] = vec3<f32>(0.0);
    }
    storageBarrier();
    workgroupBarrier();
    deformed(0.0, 0.0, local);
    var contact = own_contact(local);
    var elastic = 0.0;
    var energy = add_up(vec4<f32>(0.5 * parameters.kc * contact.depth * contact.depth, 0.0, 0.0, 0.0), local).x;
    let first_radius = sqrt(2.0 * energy);
    var row = contact;
    if FROZEN {
        deformed(0.0, sqrt(2.0 * energy * parameters.softest), local);
        row = own_contact(local);
        row.along = vec3<f32>(0.0);
        row.distance = 0.0;
        row.inverse_distance = 0.0;
        row.gradients = mat3x3<f32>();
        contact = row;
    }

    var outcome = Outcome();
    var radius = first_radius;
    var squares = balance(contact, local);
    var scale = max(sqrt(squares.y), RESIDUAL_FLOOR);
    outcome.residual = sqrt(squares.x) / scale;
    var converged = outcome.residual <= parameters.tolerance;
    while !converged && outcome.iterations < parameters.max_iterations && radius > GIVE_UP_RADIUS * first_radius
        && overflow == 0u
    {
        outcome.iterations += 1u;
        let inner = clamp(outcome.residual, INNER_TOLERANCE_FLOOR, INNER_TOLERANCE);
        let step = trust_region_step(contact, squares.x, radius, inner, local);
        let motion = entries(STEP, slots[local]);
        let deepening = dot(contact.normal, motion * contact.weights);
        let felt = greatest(select(0.0, abs(deepening), contact.depth > 0.0), local);
        if !step.at_boundary && (step.length <= parameters.tolerance * scale || felt <= parameters.depth_rounding) {
            var work = vec4<f32>(0.0);
            for (var slot = local; slot < support_count; slot += WORKGROUP) {
                work.x += dot(vectors[at(FORCES, slot)] + 0.5 * vectors[at(STEP_FORCE, slot)], vectors[at(STEP, slot)]);
            }
            elastic += add_up(work, local).x;
            contact.depth = select(0.0, contact.depth + deepening, contact.depth > 0.0);
            outcome.residual = step.length / scale;
            converged = true;
            break;
        }

        // Try the step: DIRECTION_FORCE holds the trial's forces.
        for (var slot = local; slot < support_count; slot += WORKGROUP) {
            vectors[at(DIRECTION_FORCE, slot)] = vectors[at(FORCES, slot)] + vectors[at(STEP_FORCE, slot)];
        }
        workgroupBarrier();
        let moved = displace(DIRECTION_FORCE, local);
        var trial = contact;
        if FROZEN {
            trial = frozen_contact(row);
        } else {
            deformed(moved, 0.0, local);
            trial = own_contact(local);
        }
        var sums = vec4<f32>(0.0);
        for (var slot = local; slot < support_count; slot += WORKGROUP) {
            sums.x += dot(vectors[at(DIRECTION_FORCE, slot)], displacement[displacement_base + support_nodes[slot]].xyz);
        }
        let trial_depth = max(trial.depth, 0.0);
        sums.y = trial_depth * trial_depth;
        let depth = max(contact.depth, 0.0);
        sums.z = depth * length(proxy_position(contact.proxy_node));
        sums = add_up(sums, local);
        let trial_elastic = 0.5 * sums.x;
        let trial_energy = trial_elastic + 0.5 * parameters.kc * sums.y;
        // Near the solution both decreases drown in rounding, which must not refuse a good step.
        let rounding = ENERGY_ROUNDING * (energy + parameters.kc * sums.z);
        let ratio = (energy - trial_energy + rounding) / (step.predicted + rounding);
        if !(ratio >= POOR_SHARE) {
            radius = SHRINK * step.length;
        } else if ratio > GOOD_SHARE && step.at_boundary {
            radius *= WIDEN;
        }
        if ratio >= ACCEPTED_SHARE {
            contact = trial;
            elastic = trial_elastic;
            energy = trial_energy;
            for (var slot = local; slot < support_count; slot += WORKGROUP) {
                vectors[at(FORCES, slot)] = vectors[at(DIRECTION_FORCE, slot)];
            }
            workgroupBarrier();
            squares = balance(contact, local);
            scale = max(sqrt(squares.y), RESIDUAL_FLOOR);
            outcome.residual = sqrt(squares.x) / scale;
            converged = outcome.residual <= parameters.tolerance;
        } else {
            // The residual that the step used up.
            squares = balance(contact, local);
        }
    }

    let used = u32(greatest(select(0.0, f32(local + 1u), contact.depth > 0.0), local));
    if local < used {
        write_touch(place, local, contact.nodes, contact.proxy_node, contact_forces(contact));
    }
    if local == 0u {
        outcome.status = select(STATUS_UNCONVERGED, STATUS_CONTACT, converged);
        outcome.elastic = elastic;
        outcome.touches = used;
        write_outcome(place, outcome);
    }
}
