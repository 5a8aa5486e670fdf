// One trust-region Newton step of the energy form, by truncated conjugate gradients (twin, with the derivation:
// src/contact/trust_region.rs).

const FORCES: u32 = 0u;
// r, then the residual left over as the step grows.
const RESIDUAL: u32 = 1u;
// C times that.
const PRECONDITIONED: u32 = 2u;
const DIRECTION_FORCE: u32 = 3u;
// C times that.
const DIRECTION: u32 = 4u;
const STEP_FORCE: u32 = 5u;
// C times that.
const STEP: u32 = 6u;
const IMAGE: u32 = 7u;
const VECTORS: u32 = 8u;

struct Step {
    // Decrease of the energy by the model [J].
    predicted: f32,
    // Length in the energy norm [sqrt(J)].
    length: f32,
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

// Step for the residual force r = RESIDUAL with PRECONDITIONED = C r and r . C r = `square`, within `radius`, solved to
// `tolerance` relative to it; the step is left in STEP_FORCE and STEP.
fn trust_region_step(contact: Contact, first_square: f32, radius: f32, tolerance: f32, local: u32) -> Step {
    for (var slot = local; slot < support_count; slot += WORKGROUP) {
        vectors[at(DIRECTION_FORCE, slot)] = vectors[at(RESIDUAL, slot)];
        vectors[at(DIRECTION, slot)] = vectors[at(PRECONDITIONED, slot)];
        vectors[at(STEP_FORCE, slot)] = vec3<f32>(0.0);
        vectors[at(STEP, slot)] = vec3<f32>(0.0);
    }
    workgroupBarrier();
    var square = first_square;
    let stop = tolerance * tolerance * first_square;
    var result = Step(0.0, 0.0, false);
    let most = INNER_ITERATIONS_PER_UNKNOWN * 3u * support_count;
    for (var iteration = 0u; iteration < most; iteration += 1u) {
        if square <= stop {
            break;
        }
        shares[local] = mat3x3<f32>();
        if contact.depth > 0.0 {
            shares[local] = hessian_product(contact, parameters.kc, entries(DIRECTION, slots[local]));
        }
        workgroupBarrier();
        var products = vec4<f32>(0.0);
        for (var slot = local; slot < support_count; slot += WORKGROUP) {
            let direction_force = vectors[at(DIRECTION_FORCE, slot)];
            let direction = vectors[at(DIRECTION, slot)];
            let step_force = vectors[at(STEP_FORCE, slot)];
            let image = direction_force + gather(slot);
            vectors[at(IMAGE, slot)] = image;
            products += vec4<f32>(dot(direction, image), dot(step_force, direction), dot(direction_force, direction),
                dot(step_force, vectors[at(STEP, slot)]));
        }
        products = add_up(products, local);
        let curvature = products.x;
        let to_boundary = share_to_boundary(radius, products.w, products.y, products.z);
        let newton = square / max(curvature, LEAST_DIVISOR);
        result.at_boundary = !(curvature > 0.0 && newton < to_boundary);
        let share = select(newton, to_boundary, result.at_boundary);
        // Along a conjugate direction the residual's part is `square`: no need for the residual at the start.
        result.predicted += share * (square - 0.5 * share * curvature);
        result.length = sqrt(max(products.w + share * (2.0 * products.y + share * products.z), 0.0));
        for (var slot = local; slot < support_count; slot += WORKGROUP) {
            vectors[at(STEP_FORCE, slot)] += share * vectors[at(DIRECTION_FORCE, slot)];
            vectors[at(STEP, slot)] += share * vectors[at(DIRECTION, slot)];
            vectors[at(RESIDUAL, slot)] -= share * vectors[at(IMAGE, slot)];
        }
        workgroupBarrier();
        if result.at_boundary {
            break;
        }
        var next = 0.0;
        for (var slot = local; slot < support_count; slot += WORKGROUP) {
            let preconditioned = multiply(RESIDUAL, slot);
            vectors[at(PRECONDITIONED, slot)] = preconditioned;
            next += dot(vectors[at(RESIDUAL, slot)], preconditioned);
        }
        next = add_up(vec4<f32>(next, 0.0, 0.0, 0.0), local).x;
        let ratio = next / max(square, LEAST_DIVISOR);
        square = next;
        for (var slot = local; slot < support_count; slot += WORKGROUP) {
            vectors[at(DIRECTION_FORCE, slot)] =
                vectors[at(RESIDUAL, slot)] + ratio * vectors[at(DIRECTION_FORCE, slot)];
            vectors[at(DIRECTION, slot)] = vectors[at(PRECONDITIONED, slot)] + ratio * vectors[at(DIRECTION, slot)];
        }
        workgroupBarrier();
    }
    return result;
}
