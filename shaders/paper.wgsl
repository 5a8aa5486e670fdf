// The paper's four-step iteration, section 2.1 (twin, with the steps: src/contact/equilibrium/paper.rs). One workgroup
// a configuration; invocation k keeps tie k. In f32 a tie's pull is taken from the solution of step 2, not as Kc times
// a difference of positions.

const FORCES: u32 = 0u;
const PREVIOUS_FORCES: u32 = 1u;
// xbar - n0.
const WANTED: u32 = 2u;
const TIED_FORCES: u32 = 3u;
const RESIDUAL: u32 = 4u;
const DIRECTION: u32 = 5u;
const IMAGE: u32 = 6u;
// Forces of the pass that later ones are compared with: a repetition is a cycle.
const MARKED_FORCES: u32 = 7u;
const VECTORS: u32 = 8u;
// What displaces the surface, where `displace_all` has not.
const MOVING: u32 = FORCES;

// Number of ties on each slot.
var<workgroup> multiplicity: array<f32, SUPPORT>;

// A proxy node tied to its three closest object nodes.
struct Tie {
    // Position x_i, or the deepest point of a node with a radius.
    target_point: vec3<f32>,
    proxy_node: u32,
    // Ascending; ABSENT where this invocation has no tie.
    nodes: vec3<u32>,
    // f_j^i after step 3: columns.
    forces: mat3x3<f32>,
}

// The three nodes closest to x, ascending; of equally close ones those with lower numbers.
fn three_closest(x: vec3<f32>) -> vec3<u32> {
    var nodes = vec3<u32>(0u);
    var distances = vec3<f32>(FAR_AWAY);
    for (var node = 0u; node < parameters.surface_nodes; node += 1u) {
        let away = length(node_from(node, x));
        if away < distances.x {
            nodes = vec3<u32>(node, nodes.xy);
            distances = vec3<f32>(away, distances.xy);
        } else if away < distances.y {
            nodes = vec3<u32>(nodes.x, node, nodes.y);
            distances = vec3<f32>(distances.x, away, distances.y);
        } else if away < distances.z {
            nodes.z = node;
            distances.z = away;
        }
    }
    let least = min(min(nodes.x, nodes.y), nodes.z);
    let most = max(max(nodes.x, nodes.y), nodes.z);
    return vec3<u32>(least, nodes.x + nodes.y + nodes.z - least - most, most);
}

// Outward unit normal of the surface at `node`: normals around it weighted by area.
fn vertex_normal(node: u32, x: vec3<f32>) -> vec3<f32> {
    var sum = vec3<f32>(0.0);
    for (var entry = around_start(node); entry < around_start(node + 1u); entry += 1u) {
        let triangle = around(entry);
        let a = node_from(corner(triangle, 0u), x);
        sum += cross(node_from(corner(triangle, 1u), x) - a, node_from(corner(triangle, 2u), x) - a);
    }
    return unit_or_zero(sum);
}

// Displaces all covered nodes by C v, v a vector on the support; returns the greatest length.
fn displace_all(vector: u32, local: u32) -> f32 {
    trial_number += 1.0;
    var most = 0.0;
    for (var place = local; place < parameters.covered; place += WORKGROUP) {
        let u = response(vector, place);
        workspace[workspace_base + place] = vec4<f32>(u, trial_number);
        most = max(most, length(u));
    }
    storageBarrier();
    return greatest(most, parameters.covered, local);
}

// Step 1: proxy nodes inside, each tied to the three closest object nodes.
fn tie_nodes(moved: f32, local: u32) -> Tie {
    // Ties are found again in every pass.
    if local == 0u {
        contact_count = 0u;
        support_count = 0u;
    }
    workgroupBarrier();
    let contact = deformed(moved, 0.0, local);
    var tie = Tie();
    tie.nodes = vec3<u32>(ABSENT);
    if local < contact_count {
        tie.proxy_node = contact.proxy_node;
        tie.target_point = proxy_position(contact.proxy_node) - contact.normal * proxy_radius(contact.proxy_node);
        tie.nodes = three_closest(tie.target_point);
    }
    workgroupBarrier();
    assign_slots(tie.nodes, local);
    return tie;
}

// x less n0 of each of a tie's nodes: columns.
fn reaches(tie: Tie) -> mat3x3<f32> {
    return mat3x3<f32>(tie.target_point - rest[tie.nodes.x].xyz, tie.target_point - rest[tie.nodes.y].xyz,
        tie.target_point - rest[tie.nodes.z].xyz);
}

// Step 2: n from equation (2), all ties being springs Kc; TIED_FORCES and the displacement.
fn solve_tied(tie: Tie, local: u32) {
    shares[local] = mat3x3<f32>();
    if local < contact_count {
        shares[local] = reaches(tie);
    }
    workgroupBarrier();
    for (var slot = local; slot < support_count; slot += WORKGROUP) {
        var count = 0.0;
        for (var k = 0u; k < contact_count; k += 1u) {
            count += dot(vec3<f32>(slots[k] == vec3<u32>(slot)), vec3<f32>(1.0));
        }
        multiplicity[slot] = max(count, 1.0);
        put(WANTED, slot, gather(slot) / multiplicity[slot]);
    }
    workgroupBarrier();
    conjugate_gradients(local);
    displace_all(TIED_FORCES, local);
}

// TIED_FORCES with (C_AA + D^-1) TIED_FORCES = WANTED.
fn conjugate_gradients(local: u32) {
    var squares = vec4<f32>(0.0);
    for (var slot = local; slot < support_count; slot += WORKGROUP) {
        let wanted = entry(WANTED, slot);
        put(TIED_FORCES, slot, vec3<f32>(0.0));
        put(RESIDUAL, slot, wanted);
        put(DIRECTION, slot, wanted);
        squares.x += dot(wanted, wanted);
    }
    var square = add_up(squares, support_count, local).x;
    let stop = max(PAPER_INNER_TOLERANCE * PAPER_INNER_TOLERANCE * square, LEAST_DIVISOR);
    let most = INNER_ITERATIONS_PER_UNKNOWN * 3u * support_count;
    for (var iteration = 0u; iteration < most; iteration += 1u) {
        if square <= stop {
            break;
        }
        var curvature = 0.0;
        for (var slot = local; slot < support_count; slot += WORKGROUP) {
            let direction = entry(DIRECTION, slot);
            let softness = 1.0 / (parameters.stiffness * multiplicity[slot]);
            let image = multiply(DIRECTION, slot) + softness * direction;
            put(IMAGE, slot, image);
            curvature += dot(direction, image);
        }
        curvature = add_up(vec4<f32>(curvature, 0.0, 0.0, 0.0), support_count, local).x;
        let share = square / max(curvature, LEAST_DIVISOR);
        var next = 0.0;
        for (var slot = local; slot < support_count; slot += WORKGROUP) {
            put(TIED_FORCES, slot, entry(TIED_FORCES, slot) + share * entry(DIRECTION, slot));
            let residual = entry(RESIDUAL, slot) - share * entry(IMAGE, slot);
            put(RESIDUAL, slot, residual);
            next += dot(residual, residual);
        }
        next = add_up(vec4<f32>(next, 0.0, 0.0, 0.0), support_count, local).x;
        let ratio = next / square;
        square = next;
        for (var slot = local; slot < support_count; slot += WORKGROUP) {
            put(DIRECTION, slot, entry(RESIDUAL, slot) + ratio * entry(DIRECTION, slot));
        }
        workgroupBarrier();
    }
}

// Step 3: compressive tie forces, projected on the surface normal.
fn project(tie: Tie, local: u32) -> mat3x3<f32> {
    var forces = mat3x3<f32>();
    if local >= contact_count {
        return forces;
    }
    let reach = reaches(tie);
    for (var k = 0u; k < 3u; k += 1u) {
        let slot = slots[local][k];
        // Kc (x - n_j) = Kc (xbar - n_j) + Kc (x - xbar), the first being the node's force over its ties.
        let pull = entry(TIED_FORCES, slot) / multiplicity[slot]
            + parameters.stiffness * (reach[k] - entry(WANTED, slot));
        let normal = vertex_normal(tie.nodes[k], tie.target_point);
        forces[k] = normal * min(dot(pull, normal), 0.0);
    }
    return forces;
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
    workgroupBarrier();

    var outcome = SolverResult();
    outcome.residual = 1.0;
    var converged = false;
    var given_up = false;
    var moved = 0.0;
    var tie = Tie();
    tie.nodes = vec3<u32>(ABSENT);
    var marked = tie;
    while !converged && !given_up && outcome.iterations < parameters.max_iterations && overflow == 0u {
        outcome.iterations += 1u;
        for (var slot = local; slot < SUPPORT; slot += WORKGROUP) {
            put(PREVIOUS_FORCES, slot, entry(FORCES, slot));
        }
        let previous = tie;
        tie = tie_nodes(moved, local);
        if overflow != 0u {
            break;
        }
        solve_tied(tie, local);
        tie.forces = project(tie, local);
        // Step 4: n under the projected forces.
        workgroupBarrier();
        shares[local] = tie.forces;
        workgroupBarrier();
        for (var slot = local; slot < SUPPORT; slot += WORKGROUP) {
            put(FORCES, slot, gather(slot));
        }
        workgroupBarrier();
        moved = displace_all(FORCES, local);
        // Relative change of the forces, in the energy norm; one when S changed.
        let changed = any(tie.nodes != previous.nodes) || tie.proxy_node != previous.proxy_node;
        for (var slot = local; slot < support_count; slot += WORKGROUP) {
            put(RESIDUAL, slot, entry(FORCES, slot) - entry(PREVIOUS_FORCES, slot));
        }
        workgroupBarrier();
        var sums = vec4<f32>(0.0);
        sums.z = select(0.0, 1.0, changed);
        for (var slot = local; slot < support_count; slot += WORKGROUP) {
            let force = entry(FORCES, slot);
            sums.x += dot(entry(RESIDUAL, slot), multiply(RESIDUAL, slot));
            sums.y += dot(force, displaced(support_nodes[slot]));
            sums.w += dot(abs(force), vec3<f32>(1.0));
        }
        // No tie is kept beyond as many invocations as there are proxy nodes.
        sums = add_up(sums, max(parameters.proxy_nodes, support_count), local);
        outcome.elastic = 0.5 * sums.y;
        outcome.residual = select(sqrt(max(sums.x, 0.0)) / max(sqrt(max(sums.y, 0.0)), RESIDUAL_FLOOR), 1.0, sums.z > 0.0);
        // Contact was lost: nothing inside, or no force left that compresses.
        given_up = sums.w == 0.0;
        outcome.residual = select(outcome.residual, 1.0, given_up);
        converged = !given_up && outcome.residual <= parameters.tolerance;

        // A pass that repeats an earlier one to the last bit will do so for ever.
        var differs = any(tie.nodes != marked.nodes) || tie.proxy_node != marked.proxy_node;
        for (var slot = local; slot < support_count; slot += WORKGROUP) {
            differs = differs || any(entry(FORCES, slot) != entry(MARKED_FORCES, slot));
        }
        let repeats = greatest(select(0.0, 1.0, differs), max(parameters.proxy_nodes, support_count), local) == 0.0;
        given_up = given_up || (outcome.iterations > 1u && repeats);
        if (outcome.iterations & (outcome.iterations - 1u)) == 0u {
            marked = tie;
            for (var slot = local; slot < support_count; slot += WORKGROUP) {
                put(MARKED_FORCES, slot, entry(FORCES, slot));
            }
        }
    }

    let used = u32(greatest(select(0.0, f32(local + 1u), tie.nodes.x != ABSENT), contact_count, local));
    if local < used {
        write_touch(place, local, tie.nodes, tie.proxy_node, tie.forces);
    }
    if local == 0u {
        outcome.status = select(STATUS_UNCONVERGED, STATUS_CONTACT, converged);
        outcome.touches = used;
        write_outcome(place, outcome);
    }
}
