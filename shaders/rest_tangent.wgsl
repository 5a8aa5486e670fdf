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

// Second derivative of the depth of row `row` in the place of its node, the displacement held. The own row, which is
// that row, is spoilt.
fn second_derivative(row: u32) -> mat3x3<f32> {
    let named = row_names[row];
    // A smooth surface goes on beyond the edges of a facet as the facet does.
    let feature = select(named.z, FEATURE_FACE, SMOOTH);
    if !SMOOTH && feature == FEATURE_FACE {
        return mat3x3<f32>();
    }
    let x = rows[at_row(row) + AT_X].xyz;
    let normal = rows[at_row(row) + AT_NORMAL].xyz;
    var step = 0.0;
    var bend = mat3x3<f32>();
    // At x itself, and on both sides of it along each axis.
    for (var k = 0u; k < 7u; k += 1u) {
        let axis = (k + 2u) % 3u;
        let sign = select(-1.0, 1.0, k > 3u);
        let there = x + step * sign * one_hot(axis);
        form(named.y, there);
        let point = followed(ClosestPoint(rows[at_row(row) + AT_CORNERS].xyz, feature));
        let outward = select(normal, normal_of(jet_at(point.weights)), feature == FEATURE_FACE);
        make_row(there, 0.0, named.y, point, outward);
        if k > 0u {
            bend[axis] -= own_push() * (sign / (2.0 * step));
        } else if feature == FEATURE_FACE {
            // So that the closest point moves by the step.
            step = parameters.step * clamp(own_convexity, LEAST_CONVEXITY, 1.0);
        } else {
            // The direction from an edge or vertex turns over its distance.
            step = min(parameters.step, TURNING_STEP * max(abs(own.depth), parameters.least_distance));
        }
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

// Adds what row `row`, the own one, brings to the tangent, if its `force` is not zero, and notes by how much joints
// deepen it. For all invocations together.
fn add_tangent(row: u32, force: f32, count: u32, local: u32) {
    let joints = parameters.joints;
    var pushed = vec3<f32>(0.0);
    var bend = mat3x3<f32>();
    if force > 0.0 {
        pushed = rows[at_row(row) + AT_FORCE].xyz;
        bend = force * second_derivative(row);
        take_row(row);
    }
    for (var k = 0u; k < joints; k += 1u) {
        var moved = array<vec3<f32>, 3>();
        var column = vec3<f32>(0.0);
        var deepened = 0.0;
        if force > 0.0 {
            displace_by_joint(count, k);
            moved = own_moved();
            column = jacobian_column(row_names[row].x, own.x, k);
            deepened = -dot(pushed, column) / force - dot(own.normal, moved[0]);
        }
        if row < count {
            deepening[row * joints + k] = deepened;
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

// Takes off the tangent what the forces give way where joints move. For all invocations together.
fn take_off_response(count: u32, local: u32) {
    let joints = parameters.joints;
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
