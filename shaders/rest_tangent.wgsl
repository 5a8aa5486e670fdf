// The tangent d tau/d q of contact with the surface at rest (twin, with the formulas:
// src/contact/equilibrium/rest/tangent.rs). The second derivative of a depth is a difference of gradients on both sides
// of the node, of the closest point's own feature.

const ENTRIES: u32 = JOINTS * (JOINTS + 1u) / 2u;

// By how much each joint deepens each row; the tangent's lower triangle.
var<workgroup> deepening: array<f32, DEEPENINGS>;
var<workgroup> tangent_sums: array<f32, ENTRIES>;

// Steps of Newton's method that follow a closest point over the step of a difference: each squares what is left.
const FOLLOWING_STEPS: u32 = 3u;

// The closest point of the current facet to the origin on the feature of `point`, from which it is near.
fn followed(point: ClosestPoint) -> ClosestPoint {
    var found = point;
    for (var step = 0u; step < FOLLOWING_STEPS; step += 1u) {
        let jet = jet_at(found.weights);
        if point.feature == FEATURE_FACE {
            let change = step_on_face(jet);
            let u = found.weights.y + change.x;
            let v = found.weights.z + change.y;
            found.weights = vec3<f32>(1.0 - u - v, u, v);
        } else if point.feature >= FEATURE_EDGE {
            let k = point.feature - FEATURE_EDGE;
            found.weights = on_edge(k, step_on_edge(jet, k, dot(found.weights, one_hot((k + 1u) % 3u))));
        }
    }
    return found;
}

// Direction in which the node of stored row `row` is pushed at x. The own row is spoilt.
fn push_at(row: u32, x: vec3<f32>) -> vec3<f32> {
    let stored = row_names[row];
    form(stored.y, x);
    let point = followed(ClosestPoint(rows[at_row(row) + AT_CORNERS].xyz, stored.z));
    let outward = select(rows[at_row(row) + AT_NORMAL].xyz, normal_of(jet_at(point.weights)), stored.z == FEATURE_FACE);
    make_row(x, 0.0, stored.y, point, outward);
    return own_push();
}

// Second derivative of the depth of row `row` in the place of its node, the displacement held.
fn second_derivative(row: u32) -> mat3x3<f32> {
    if !SMOOTH && row_names[row].z == FEATURE_FACE {
        return mat3x3<f32>();
    }
    let x = rows[at_row(row) + AT_X].xyz;
    _ = push_at(row, x);
    // So that the closest point moves by the step.
    var step = parameters.step * clamp(own_convexity, LEAST_CONVEXITY, 1.0);
    if row_names[row].z != FEATURE_FACE {
        // The direction from an edge or vertex turns over its distance.
        step = min(step, TURNING_STEP * max(abs(rows[at_row(row) + AT_X].w - radius_of(row_names[row].x)),
            parameters.least_distance));
    }
    var bend = mat3x3<f32>();
    for (var axis = 0u; axis < 3u; axis += 1u) {
        let along = step * one_hot(axis);
        bend[axis] = (push_at(row, x - along) - push_at(row, x + along)) / (2.0 * step);
    }
    return 0.5 * (bend + transpose(bend));
}

// Load of row `row` on the object where joint k moves, over its force: at the closest point; and along the normal by
// the tangents there.
struct Load {
    point: vec3<f32>,
    tangents: vec2<f32>,
}

fn load_of(row: u32, k: u32) -> Load {
    let against = -jacobian_column(row_names[row].x, rows[at_row(row) + AT_X].xyz, k);
    let tangents = vec2<f32>(dot(rows[at_row(row) + AT_TURNING].xyz, against), dot(rows[at_row(row) + AT_TURNING + 1u].xyz, against));
    return Load(bending_of(row) * against, tangents);
}

// Displaces the nodes of the own row by the loads of all rows where joint k moves.
fn displace_by_joint(count: u32, k: u32) {
    own_displacements = array<vec3<f32>, 4u * CARRIERS>();
    for (var row = 0u; row < count; row += 1u) {
        let force = solution[row];
        if force == 0.0 {
            continue;
        }
        let load = load_of(row, k);
        let normal = rows[at_row(row) + AT_NORMAL].xyz;
        for (var l = 0u; l < 4u * parameters.carriers; l += 1u) {
            let slopes = vec2<f32>(rows[at_row(row) + AT_WEIGHTS + parameters.carriers + l / 4u][l % 4u],
                rows[at_row(row) + AT_WEIGHTS + 2u * parameters.carriers + l / 4u][l % 4u]);
            let weight = rows[at_row(row) + AT_WEIGHTS + l / 4u][l % 4u];
            if weight != 0.0 || any(slopes != vec2<f32>(0.0)) {
                let place = places_of(row_names[row].y, l / 4u)[l % 4u];
                displace(place, force * (weight * load.point + dot(slopes, load.tangents) * normal));
            }
        }
    }
}

// Finds the tangent of the first `count` rows, whose forces are known. For all invocations together.
fn find_tangent(count: u32, local: u32) {
    let joints = parameters.joints;
    for (var k = local; k < ENTRIES; k += WORKGROUP) {
        tangent_sums[k] = 0.0;
    }
    for (var first = 0u; first < count; first += WORKGROUP) {
        let row = first + local;
        var force = 0.0;
        if row < count {
            force = solution[row];
        }
        var pushed = vec3<f32>(0.0);
        var bend = mat3x3<f32>();
        if force > 0.0 {
            take_row(row);
            take_places();
            displace_by_forces(count);
            bend = force * second_derivative(row);
            take_row(row);
            pushed = rows[at_row(row) + AT_FORCE].xyz;
        }
        for (var k = 0u; k < joints; k += 1u) {
            var moved = array<vec3<f32>, 3>();
            var column = vec3<f32>(0.0);
            if force > 0.0 {
                displace_by_joint(count, k);
                moved = own_moved();
                column = jacobian_column(row_names[row].x, own.x, k);
            }
            if row < count {
                deepening[row * joints + k] = 0.0;
                if force > 0.0 {
                    deepening[row * joints + k] = -dot(pushed, column) / force - dot(own.normal, moved[0]);
                }
            }
            for (var l = 0u; l <= k; l += 1u) {
                var part = 0.0;
                if force > 0.0 {
                    let other = jacobian_column(row_names[row].x, own.x, l);
                    let load = load_of(row, l);
                    let along = vec2<f32>(dot(own.normal, moved[1]), dot(own.normal, moved[2]));
                    part = force * (dot(load.point, moved[0]) + dot(load.tangents, along)) - dot(other, bend * column);
                    if !slides(l) {
                        part += dot(pushed, cross(axes[l], column));
                    }
                }
                let sum = sum_of(part, local);
                if local == 0u {
                    tangent_sums[entry(k, l)] += sum;
                }
            }
        }
    }
    // What is solved for is the change of the forces.
    for (var k = 0u; k < joints; k += 1u) {
        workgroupBarrier();
        for (var i = local; i < count; i += WORKGROUP) {
            right[i] = deepening[i * joints + k];
        }
        substitute(count, local);
        for (var l = 0u; l <= k; l += 1u) {
            var part = 0.0;
            for (var i = local; i < count; i += WORKGROUP) {
                part += deepening[i * joints + l] * right[i];
            }
            let sum = sum_of(part, local);
            if local == 0u {
                tangent_sums[entry(k, l)] -= sum;
            }
        }
    }
    workgroupBarrier();
}
