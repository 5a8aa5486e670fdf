// A pass of the paper's four-step iteration, section 2.1 (twin, with the steps: src/contact/equilibrium/paper.rs). One
// workgroup a configuration. The trial, whose rows search_detect has found, is all there is of a state.

const OWN_PAIRS: u32 = STEPPED_PAIRS;

// Vectors: forces of this pass, of the one before, and of an earlier one that later ones are compared with, where a
// repetition is a cycle; and of step 2 what is wanted, xbar - n0, and the forces that do so.
const FORCES: u32 = 1u;
const PREVIOUS_FORCES: u32 = 0u;
const MARKED_FORCES: u32 = PREVIOUS_FORCE;
const WANTED: u32 = CONTACT_FORCES;
const TIED_FORCES: u32 = STEP_FORCE;

// Words: numbers of ties of this pass, of the one before, and of the marked one.
const TIES: u32 = TAKEN;
const PREVIOUS_TIES: u32 = PASS;
const MARKED_TIES: u32 = ATTEMPTS;

// Proxy node of tie k, then the three object nodes that it is tied to, ascending.
fn at_tie(k: u32) -> u32 {
    return at_row(0u, k);
}

// The same of the pass before, and of the marked one.
fn at_previous_tie(k: u32) -> u32 {
    return at_row(0u, k) + 4u;
}

fn at_marked_tie(k: u32) -> u32 {
    return at_row(0u, k) + 8u;
}

// Slot of node j of tie k, and behind the three of them the entry behind each in the list of its slot, plus one.
fn at_tied_slot(k: u32, j: u32) -> u32 {
    return at_row(1u, k) + ROW_WORDS + j;
}

// From node j to the tie's target, x_i or the deepest point of a node with a radius [m]; after step 3 the force f_j^i.
fn at_pull(k: u32, j: u32) -> u32 {
    return at_reaction(k) + 4u * j;
}

fn copy_tie(source: u32, destination: u32) {
    for (var j = 0u; j < 4u; j += 1u) {
        set_word(destination + j, word(source + j));
    }
}

fn is_same_tie(a: u32, b: u32) -> bool {
    return word(a) == word(b) && word(a + 1u) == word(b + 1u) && word(a + 2u) == word(b + 2u)
        && word(a + 3u) == word(b + 3u);
}

// --- Step 1: proxy nodes inside, each tied to the three closest object nodes ---

// The three nodes closest to x, ascending; of equally close ones those with lower numbers.
fn three_closest(x: vec3<real>) -> vec3<u32> {
    var nodes = vec3<u32>(0u);
    var distances = vec3<real>(FAR_AWAY);
    for (var node = 0u; node < parameters.surface_nodes; node += 1u) {
        let offset = node_from(node, x);
        let away = dot(offset, offset);
        if away < distances.x {
            nodes = vec3<u32>(node, nodes.xy);
            distances = vec3<real>(away, distances.xy);
        } else if away < distances.y {
            nodes = vec3<u32>(nodes.x, node, nodes.y);
            distances = vec3<real>(distances.x, away, distances.y);
        } else if away < distances.z {
            nodes.z = node;
            distances.z = away;
        }
    }
    let least = min(min(nodes.x, nodes.y), nodes.z);
    let most = max(max(nodes.x, nodes.y), nodes.z);
    return vec3<u32>(least, nodes.x + nodes.y + nodes.z - least - most, most);
}

// Ties proxy node by proxy node; returns how many are tied.
fn tie_nodes(local: u32) -> u32 {
    let ties_before = word(TIES);
    for (var k = local; k < ties_before; k += WORKGROUP) {
        copy_tie(at_tie(k), at_previous_tie(k));
    }
    sync();
    begin_list(0u, local);
    let rows = word(ROWS + 1u);
    for (var first = 0u; first < rows; first += WORKGROUP) {
        let at = at_numbers(1u, first + local);
        let is_tied = first + local < rows && scalar(at + DEPTH) > 0.0;
        let k = place_in_list(select(0u, 1u, is_tied), local);
        if is_tied {
            let node = word(at_row(1u, first + local));
            let point = proxy_position(node) - proxy_radius(node) * vector_at(at + NORMAL);
            let nodes = three_closest(point);
            set_word(at_tie(k), node);
            for (var j = 0u; j < 3u; j += 1u) {
                set_word(at_tie(k) + 1u + j, nodes[j]);
                set_vector(at_pull(k, j), point - at_rest(nodes[j]));
            }
        }
    }
    return listed;
}

// Gives every tied node a slot, and lists the ties slot by slot; for one invocation.
fn occupy(ties: u32) {
    for (var slot = 0u; slot < slots; slot += 1u) {
        set_word(at_slot(word(at_place(slot))), 0u);
    }
    var used = 0u;
    for (var entry = 0u; entry < 3u * ties; entry += 1u) {
        let node = word(at_tie(entry / 3u) + 1u + entry % 3u);
        var slot = word(at_slot(node));
        if slot == 0u {
            set_word(at_place(used), node);
            set_word(at_start(used), 0u);
            used += 1u;
            slot = used;
            set_word(at_slot(node), slot);
        }
        let at = at_tied_slot(entry / 3u, entry % 3u);
        set_word(at, slot - 1u);
        set_word(at + 3u, word(at_start(slot - 1u)));
        set_word(at_start(slot - 1u), entry + 1u);
    }
    set_word(SLOTS, used);
    set_word(PREVIOUS_TIES, word(TIES));
    set_word(TIES, ties);
}

// Sum over the ties of a slot of their pulls, and in w their number.
fn pulls_on(slot: u32) -> vec4<real> {
    var sum = vec4<real>(0.0);
    var entry = word(at_start(slot));
    while entry != 0u {
        let k = (entry - 1u) / 3u;
        let j = (entry - 1u) % 3u;
        sum += vec4<real>(vector_at(at_pull(k, j)), 1.0);
        entry = word(at_tied_slot(k, j) + 3u);
    }
    return sum;
}

fn tie(local: u32) {
    let ties = tie_nodes(local);
    sync();
    if local == 0u {
        occupy(ties);
    }
    sync();
    workgroupBarrier();
    slots = word(SLOTS);
    var squares = vec3<real>(0.0);
    for (var slot = local; slot < slots; slot += WORKGROUP) {
        let pulls = pulls_on(slot);
        let wanted = pulls.xyz / pulls.w;
        put(WANTED, slot, wanted);
        put(TIED_FORCES, slot, vec3<real>(0.0));
        put(LEFT_OVER, slot, wanted);
        put(DIRECTION_FORCE, slot, wanted);
        squares.x += dot(wanted, wanted);
    }
    let square = add_up(squares, local).x;
    if local == 0u {
        set_scalar(STOP, max(PAPER_INNER_TOLERANCE * PAPER_INNER_TOLERANCE * square, LEAST_DIVISOR));
        set_word(LEFT, 3u * INNER_ITERATIONS_PER_UNKNOWN * slots);
        set_word(ITERATIONS, word(ITERATIONS) + 1u);
        advance(after_iteration(square), 16u + 3u * ties + (ties / WORKGROUP + 1u) * parameters.surface_nodes);
        if word(OVERFLOW) != 0u {
            set_word(STATUS, STATUS_OVERFLOW);
            phase = DONE;
        }
    }
}

// --- Step 2: n from equation (2), all ties being springs Kc ---

// What follows an iteration that leaves a residual of this square; for one invocation.
fn after_iteration(square: real) -> u32 {
    set_scalar(SQUARE, square);
    return select(PROJECT, ITERATE, word(LEFT) > 0u && square > scalar(STOP));
}

// One iteration of conjugate gradients for (C_AA + D^-1) TIED_FORCES = WANTED.
fn iterate(local: u32) {
    let before = scalar(SQUARE);
    multiply(DIRECTION_FORCE, HESSIAN_DIRECTION, local);
    var sums = vec3<real>(0.0);
    for (var slot = local; slot < slots; slot += WORKGROUP) {
        let direction = vector_entry(DIRECTION_FORCE, slot);
        let image = vector_entry(HESSIAN_DIRECTION, slot) + direction / (parameters.kc * pulls_on(slot).w);
        put(HESSIAN_DIRECTION, slot, image);
        sums.x += dot(direction, image);
    }
    let share = before / max(add_up(sums, local).x, LEAST_DIVISOR);
    sums = vec3<real>(0.0);
    for (var slot = local; slot < slots; slot += WORKGROUP) {
        put(TIED_FORCES, slot, vector_entry(TIED_FORCES, slot) + share * vector_entry(DIRECTION_FORCE, slot));
        let left = vector_entry(LEFT_OVER, slot) - share * vector_entry(HESSIAN_DIRECTION, slot);
        put(LEFT_OVER, slot, left);
        sums.x += dot(left, left);
    }
    let square = add_up(sums, local).x;
    for (var slot = local; slot < slots; slot += WORKGROUP) {
        let direction = vector_entry(LEFT_OVER, slot) + square / before * vector_entry(DIRECTION_FORCE, slot);
        put(DIRECTION_FORCE, slot, direction);
    }
    if local == 0u {
        set_word(LEFT, word(LEFT) - 1u);
        advance(after_iteration(square), (slots / WORKGROUP + 1u) * (slots / 2u + 16u) + 2u * WORKGROUP);
    }
}

// --- Steps 3 and 4: compressive tie forces, projected on the surface normal; n under these ---

// Outward unit normal of the surface at `node`: normals around it weighted by area.
fn vertex_normal(node: u32) -> vec3<real> {
    let x = at_rest(node);
    var sum = vec3<real>(0.0);
    for (var entry = around_start(node); entry < around_start(node + 1u); entry += 1u) {
        let triangle = around(entry);
        let a = node_from(corner(triangle, 0u), x);
        sum += cross(node_from(corner(triangle, 1u), x) - a, node_from(corner(triangle, 2u), x) - a);
    }
    return unit_or_zero(sum);
}

// Displaces all nodes by the tied forces.
fn displace_all(local: u32) {
    let last = parameters.covered - 1u;
    for (var first = 0u; first < parameters.covered; first += 4u * WORKGROUP) {
        let places = min(first + local + vec4<u32>(0u, 1u, 2u, 3u) * WORKGROUP, vec4<u32>(last));
        let moved = responses(TIED_FORCES, places, local);
        for (var k = 0u; k < 4u; k += 1u) {
            set_vector(at_displacement(places[k]), moved[k]);
        }
    }
}

// Step 3.
fn project_ties(local: u32) {
    displace_all(local);
    sync();
    for (var k = local; k < word(TIES); k += WORKGROUP) {
        for (var j = 0u; j < 3u; j += 1u) {
            let slot = word(at_tied_slot(k, j));
            // Kc (x - n_j) = Kc (xbar - n_j) + Kc (x - xbar), the first being the node's force over its ties.
            let pull = vector_entry(TIED_FORCES, slot) / pulls_on(slot).w
                + parameters.kc * (vector_at(at_pull(k, j)) - vector_entry(WANTED, slot));
            let normal = vertex_normal(word(at_tie(k) + 1u + j));
            let force = normal * min(dot(pull, normal), real(0.0));
            // Other invocations only count pulls meanwhile.
            set_vector(at_pull(k, j), force);
        }
    }
    sync();
}

// Whether ties or forces differ from those of the marked pass.
fn differs_from_marked(local: u32) -> bool {
    let ties = word(TIES);
    var differs = ties != word(MARKED_TIES);
    for (var k = local; k < ties; k += WORKGROUP) {
        differs = differs || !is_same_tie(at_tie(k), at_marked_tie(k));
    }
    for (var slot = local; slot < slots; slot += WORKGROUP) {
        differs = differs || any(vector_entry(FORCES, slot) != vector_entry(MARKED_FORCES, slot));
    }
    return differs;
}

fn mark(local: u32) {
    for (var k = local; k < word(TIES); k += WORKGROUP) {
        copy_tie(at_tie(k), at_marked_tie(k));
    }
    for (var slot = local; slot < slots; slot += WORKGROUP) {
        put(MARKED_FORCES, slot, vector_entry(FORCES, slot));
    }
    if local == 0u {
        set_word(MARKED_TIES, word(TIES));
    }
}

fn project(local: u32) {
    project_ties(local);
    let ties = word(TIES);
    // Step 4, and what has changed.
    for (var slot = local; slot < slots; slot += WORKGROUP) {
        let before = vector_entry(FORCES, slot);
        let force = pulls_on(slot).xyz;
        put(PREVIOUS_FORCES, slot, before);
        put(FORCES, slot, force);
        put(LEFT_OVER, slot, force - before);
    }
    sync();
    multiply(LEFT_OVER, LEFT_PRODUCT, local);
    multiply(FORCES, BALANCE_PRODUCT, local);
    // Twice the energies of change and forces; number of ties, or pairs of passes, that are not the same.
    var sums = vec3<real>(0.0);
    for (var slot = local; slot < slots; slot += WORKGROUP) {
        sums.x += dot(vector_entry(LEFT_OVER, slot), vector_entry(LEFT_PRODUCT, slot));
        sums.y += dot(vector_entry(FORCES, slot), vector_entry(BALANCE_PRODUCT, slot));
    }
    for (var k = local; k < ties; k += WORKGROUP) {
        sums.z += select(real(1.0), real(0.0), is_same_tie(at_tie(k), at_previous_tie(k)));
    }
    // Squares of the springs' forces; whether the pass differs from the marked one.
    var squares = vec3<real>(0.0);
    for (var k = local; k < ties; k += WORKGROUP) {
        for (var j = 0u; j < 3u; j += 1u) {
            squares.x += dot(vector_at(at_pull(k, j)), vector_at(at_pull(k, j)));
        }
    }
    squares.y = select(real(0.0), real(1.0), differs_from_marked(local));
    let sum = add_up(sums, local);
    let square = add_up(squares, local);
    let number = word(ITERATIONS);
    let is_first = number == 1u;
    let is_changed = sum.z > 0.0 || ties != word(PREVIOUS_TIES);
    sync();
    workgroupBarrier();
    if (number & (number - 1u)) == 0u {
        mark(local);
    }
    if local == 0u {
        set_scalar(ELASTIC, 0.5 * sum.y);
        set_scalar(ENERGY, 0.5 * sum.y + square.x / (2.0 * parameters.kc));
        // Relative change of the forces, in the energy norm; one when the selection changed, or contact was lost:
        // nothing inside, or no force left that compresses.
        let is_lost = square.x == 0.0 || !(square.x < FAR_AWAY);
        let change = root(sum.x) / max(root(sum.y), RESIDUAL_FLOOR);
        let residual = select(change, real(1.0), is_changed || is_lost);
        set_scalar(IMBALANCE, residual);
        let is_converged = residual <= parameters.tolerance;
        // A pass that repeats an earlier one to the last bit will do so for ever.
        let is_over = is_lost || number >= parameters.max_iterations || (!is_first && square.y == 0.0);
        set_scalar(MOVED, parameters.mobility * root(sum.y) * (1.0 + LENGTH_ROUNDING));
        set_word(STATUS, select(STATUS_UNCONVERGED, STATUS_CONTACT, is_converged));
        advance(select(PLACED, ACCOUNT, is_converged || is_over), 1u);
    }
}

// Torque tau = sum_i J_i^T (force on x_i).
fn account(local: u32) {
    let ties = word(TIES);
    for (var joint = 0u; joint < parameters.joints; joint += 1u) {
        var torque = vec3<real>(0.0);
        for (var k = local; k < ties; k += WORKGROUP) {
            let force = vector_at(at_pull(k, 0u)) + vector_at(at_pull(k, 1u)) + vector_at(at_pull(k, 2u));
            torque.x -= dot(force, jacobian(word(at_tie(k)), joint));
        }
        torque = add_up(torque, local);
        if local == 0u {
            set_scalar(at_torque(joint), torque.x);
        }
    }
    if local == 0u {
        set_word(TOUCHES, ties);
        phase = DONE;
    }
}

@compute @workgroup_size(WORKGROUP)
fn main(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) local: u32,
) {
    if !resume(unfold(group, groups), TIE, local) {
        return;
    }
    if is_next(TIE) { tie(local); }
    loop {
        if !is_next(ITERATE) {
            break;
        }
        iterate(local);
    }
    if is_next(PROJECT) { project(local); }
    if is_next(ACCOUNT) { account(local); }
    leave(local);
}
