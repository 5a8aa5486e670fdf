// One trust-region Newton step of the energy form, by truncated conjugate gradients (Steihaug 1983, Toint 1981), for
// the model that src/contact/equilibrium/newton.rs derives. There damping keeps steps short and a dense factor of the
// springs that touch preconditions them; here, where a workgroup's memory has no room for the factor, C preconditions
// them and the ball df . C df <= radius^2 keeps them short. Negative curvature and long steps go to its boundary. Both
// end at the same equilibria.

const FORCES: u32 = 0u;
// Residual force r = c(u) - f of the current state.
const BALANCE: u32 = 1u;
// What is left of it as the step grows, and C times that.
const RESIDUAL: u32 = 2u;
const PRECONDITIONED: u32 = 3u;
// Search direction, and C times that.
const DIRECTION_FORCE: u32 = 4u;
const DIRECTION: u32 = 5u;
// The step, and C times that.
const STEP_FORCE: u32 = 6u;
const STEP: u32 = 7u;
// The step of the pass before, and C times that.
const PREVIOUS_FORCE: u32 = 8u;
const PREVIOUS_STEP: u32 = 9u;
const IMAGE: u32 = 10u;
const VECTORS: u32 = 11u;

struct Step {
    // Decrease of the energy by the model [J].
    predicted: f32,
    // Length in the energy norm [sqrt(J)].
    length: f32,
    // What the step deepens this invocation's contact by, to first order [m].
    deepening: f32,
    // Whether the ball's boundary stopped it.
    at_boundary: bool,
}

// The share of the direction that leads from the current step to the boundary.
fn share_to_boundary(radius: f32, step_square: f32, mixed: f32, direction_square: f32) -> f32 {
    if direction_square <= 0.0 {
        return 0.0;
    }
    let left = max(radius * radius - step_square, 0.0);
    // The form of the root that does not cancel when `mixed` is positive.
    let root = sqrt(mixed * mixed + direction_square * left);
    return select((root - mixed) / direction_square, left / max(mixed + root, LEAST_DIVISOR), mixed > 0.0);
}

// Step for the residual force BALANCE with energy norm `square`^(1/2), within `radius`, solved to `tolerance` relative
// to it; the step is left in STEP_FORCE and STEP.
fn trust_region_step(contact: Contact, kc: f32, square: f32, radius: f32, tolerance: f32, local: u32) -> Step {
    for (var slot = local; slot < support_count; slot += WORKGROUP) {
        put(RESIDUAL, slot, entry(BALANCE, slot));
        put(STEP_FORCE, slot, vec3<f32>(0.0));
        put(STEP, slot, vec3<f32>(0.0));
    }
    workgroupBarrier();
    let stop = tolerance * tolerance * square;
    var touching = contact.depth > 0.0;
    var result = Step();
    for (var pass_number = 0u; pass_number < MODEL_PASSES; pass_number += 1u) {
        for (var slot = local; slot < support_count; slot += WORKGROUP) {
            put(PREVIOUS_FORCE, slot, entry(STEP_FORCE, slot));
            put(PREVIOUS_STEP, slot, entry(STEP, slot));
        }
        let stopped = conjugate_gradients(contact, select(0.0, kc, touching), radius, stop, local);

        // m(0) - m(df), in differences that do not cancel near the solution.
        let change = vary(contact, STEP, local);
        let deepening = change.x;
        let before = max(contact.depth, 0.0);
        let after = max(contact.depth + deepening, 0.0);
        // The part of 1/2 kc depth^2 that is of first order is in the residual.
        let stretch = select(after * after - before * (before + 2.0 * deepening), deepening * deepening,
            before > 0.0 && after > 0.0);
        let touches = contact.depth + deepening > 0.0;
        var sums = vec4<f32>(-0.5 * (kc * stretch + contact.multiplier * change.y), 0.0, 0.0, 0.0);
        sums.y = select(0.0, 1.0, touches != touching);
        for (var slot = local; slot < support_count; slot += WORKGROUP) {
            let step = entry(STEP, slot);
            let step_square = dot(step, entry(STEP_FORCE, slot));
            sums.x += dot(step, entry(BALANCE, slot)) - 0.5 * step_square;
            sums.z += step_square;
        }
        sums = add_up(sums, busy(), local);
        if pass_number > 0u && !(sums.x > result.predicted) {
            // Contacts came and went to no avail: the pass before was better.
            for (var slot = local; slot < support_count; slot += WORKGROUP) {
                put(STEP_FORCE, slot, entry(PREVIOUS_FORCE, slot));
                put(STEP, slot, entry(PREVIOUS_STEP, slot));
            }
            workgroupBarrier();
            break;
        }
        result = Step(sums.x, sqrt(max(sums.z, 0.0)), deepening, stopped);
        touching = touches;
        if sums.y == 0.0 {
            break;
        }

        // Residual force of the model at the step.
        press_on(contact, kc * (after - before), local);
        workgroupBarrier();
        for (var slot = local; slot < support_count; slot += WORKGROUP) {
            put(RESIDUAL, slot, entry(BALANCE, slot) - entry(STEP_FORCE, slot) + gather(slot));
        }
        workgroupBarrier();
    }
    return result;
}

// Goes on from the current step, contacts having stiffness `kc` or, where they do not touch, none, until the residual's
// squared energy norm is at most `stop`; true when the boundary stopped it.
fn conjugate_gradients(contact: Contact, kc: f32, radius: f32, stop: f32, local: u32) -> bool {
    var square = 0.0;
    let most = INNER_ITERATIONS_PER_UNKNOWN * 3u * support_count;
    // Iteration 0 only begins: one place for the product with C keeps the program small.
    for (var iteration = 0u; iteration <= most; iteration += 1u) {
        if iteration > 0u {
            resist(contact, kc, DIRECTION, local);
            workgroupBarrier();
            var products = vec4<f32>(0.0);
            for (var slot = local; slot < support_count; slot += WORKGROUP) {
                let direction_force = entry(DIRECTION_FORCE, slot);
                let direction = entry(DIRECTION, slot);
                let step_force = entry(STEP_FORCE, slot);
                let image = direction_force + gather(slot);
                put(IMAGE, slot, image);
                products += vec4<f32>(dot(direction, image), dot(step_force, direction),
                    dot(direction_force, direction), dot(step_force, entry(STEP, slot)));
            }
            products = add_up(products, support_count, local);
            let curvature = products.x;
            let to_boundary = share_to_boundary(radius, products.w, products.y, products.z);
            let newton = square / max(curvature, LEAST_DIVISOR);
            let inside = curvature > 0.0 && newton < to_boundary;
            let share = select(to_boundary, newton, inside);
            for (var slot = local; slot < support_count; slot += WORKGROUP) {
                put(STEP_FORCE, slot, entry(STEP_FORCE, slot) + share * entry(DIRECTION_FORCE, slot));
                put(STEP, slot, entry(STEP, slot) + share * entry(DIRECTION, slot));
                put(RESIDUAL, slot, entry(RESIDUAL, slot) - share * entry(IMAGE, slot));
            }
            workgroupBarrier();
            if !inside {
                return true;
            }
        }
        var next = 0.0;
        for (var slot = local; slot < support_count; slot += WORKGROUP) {
            let preconditioned = multiply(RESIDUAL, slot);
            put(PRECONDITIONED, slot, preconditioned);
            next += dot(entry(RESIDUAL, slot), preconditioned);
        }
        next = add_up(vec4<f32>(next, 0.0, 0.0, 0.0), support_count, local).x;
        let ratio = select(0.0, next / max(square, LEAST_DIVISOR), iteration > 0u);
        square = next;
        for (var slot = local; slot < support_count; slot += WORKGROUP) {
            put(DIRECTION_FORCE, slot, entry(RESIDUAL, slot) + ratio * entry(DIRECTION_FORCE, slot));
            put(DIRECTION, slot, entry(PRECONDITIONED, slot) + ratio * entry(DIRECTION, slot));
        }
        workgroupBarrier();
        if square <= stop {
            break;
        }
    }
    return false;
}
