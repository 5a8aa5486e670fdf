// Contact with facets that pass into each other (twins, with the formulas: src/contact/blend.rs and detection.rs): a contact
// is one spring, whose depth is a mean over the facets near its node. Invocation k keeps contact k; the facets of all contacts
// lie one behind the other, and the invocations share them out.
//
// A facet stands for both rows of the twin: that of the depth s below its plane, and that of the distance to its closest point.
// Where this is in the face both are the same, and counted one by one. Depths of facets are kept relative to the mean m, which
// then drops out of the formulas, and R relative to the least e / w^2: f32 is finest there.

// Facets of all contacts at most.
override FACETS: u32 = 128u;
// Facets near one node at most.
const NEAR: u32 = 64u;
// Times that facets near a node are gathered: the second reaches as far as the first, which finds too few at most, has shown.
const GATHERINGS: u32 = 2u;

// A contact as its invocation keeps it.
struct Spring {
    proxy_node: u32,
    // Positive in contact.
    depth: f32,
    // Force lambda by which the curvature counts; kc depth at the solution.
    multiplier: f32,
    // First of its facets, and their number.
    first: u32,
    count: u32,
    // First facet of all contacts that were found with it, and their number.
    first_of_all: u32,
    count_of_all: u32,
}

struct Facet {
    // Weights are those of the foot on the plane.
    plane: Contact,
    feature: Contact,
    slots: vec3<u32>,
    // Number of its contact.
    contact: u32,
    // g, its value less m.
    depth: FacetDepth,
    // a and r.
    area: f32,
    weight: f32,
    // P.
    sum: f32,
    // What the contact's depth changes by with s, with the distance, and with ln A.
    plane_share: f32,
    feature_share: f32,
    stretch: f32,
    // What a displacement brings plane and feature nearer by, and the share by which it stretches the triangle; then the
    // second variation along it.
    along_plane: f32,
    along_feature: f32,
    stretching: f32,
    bending: f32,
    // The second variation's part for each of the three nodes; then what the facet gives to them.
    share: mat3x3<f32>,
}

// 2 FACETS a configuration: of the state at hand, and of the one that is tried.
@group(0) @binding(9) var<storage, read_write> facets: array<Facet>;
// Vectors on the support, one behind the other.
@group(0) @binding(10) var<storage, read_write> vectors: array<vec3<f32>>;

// First vector and first facet of this workgroup's configuration.
var<private> vector_base: u32;
var<private> facet_base: u32;

// Place of a vector's entry.
fn at(vector: u32, slot: u32) -> u32 {
    return (vector_base + vector) * SUPPORT + slot;
}

// Waits for what others have written, in the workgroup's memory and in storage.
fn sync() {
    storageBarrier();
    workgroupBarrier();
}

// Makes ready for the configuration at `place` of the batch.
fn begin(place: u32, local: u32) {
    vector_base = place * VECTORS;
    facet_base = 2u * place * FACETS;
    held_first = facet_base;
    // What an earlier batch has left need not be numbers.
    for (var entry = local; entry < VECTORS * SUPPORT; entry += WORKGROUP) {
        vectors[vector_base * SUPPORT + entry] = vec3<f32>(0.0);
    }
}

// --- Detection ---

// A facet near the node at hand.
struct Near {
    triangle: u32,
    // e / w^2, less the least of all.
    square: f32,
    // a.
    area: f32,
}

var<workgroup> found: array<Near, NEAR>;
var<workgroup> found_count: atomic<u32>;
// The same, ascending by distance.
var<workgroup> near: array<Near, NEAR>;

// What is asked of a triangle near x.
struct Nearby {
    a: vec3<f32>,
    b: vec3<f32>,
    c: vec3<f32>,
    closest: ClosestPoint,
    // From x to the closest point.
    offset: vec3<f32>,
}

fn nearby(triangle: u32, x: vec3<f32>) -> Nearby {
    let a = node_from(corner(triangle, 0u), x);
    let b = node_from(corner(triangle, 1u), x);
    let c = node_from(corner(triangle, 2u), x);
    let closest = closest_point(vec3<f32>(0.0), a, b, c);
    return Nearby(a, b, c, closest, closest.weights.x * a + closest.weights.y * b + closest.weights.z * c);
}

// Area of a triangle at rest.
fn rest_area(triangle: u32) -> f32 {
    let a = rest[corner(triangle, 0u)].xyz;
    return 0.5 * length(cross(rest[corner(triangle, 1u)].xyz - a, rest[corner(triangle, 2u)].xyz - a));
}

// Gathers in `near` the facets within `reach` of x, `least` being the least e; their number.
fn gather_near(x: vec3<f32>, reach: f32, least: f32, moved: f32, local: u32) -> u32 {
    if local == 0u {
        atomicStore(&found_count, 0u);
    }
    sync();
    let width = parameters.blending * parameters.blending;
    for (var triangle = local; triangle < parameters.triangles; triangle += WORKGROUP) {
        let sphere = rest[parameters.surface_nodes + triangle];
        if distance(x, sphere.xyz) - sphere.w - moved > reach {
            continue;
        }
        let here = nearby(triangle, x);
        let square = dot(here.offset, here.offset);
        let normal = cross(here.b - here.a, here.c - here.a);
        let area = 0.25 * dot(normal, normal);
        // A triangle without area has no plane, and no say.
        if square < reach * reach && area > LEAST_DIVISOR {
            let place = atomicAdd(&found_count, 1u);
            if place < NEAR {
                found[place] = Near(triangle, (square - least) / width, area / (area + width * rest_area(triangle)));
            }
        }
    }
    sync();
    let count = atomicLoad(&found_count);
    if count > NEAR {
        overflow = 1u;
        return 0u;
    }
    // In an order that does not depend on timing.
    for (var k = local; k < count; k += WORKGROUP) {
        let mine = found[k];
        var rank = 0u;
        for (var other = 0u; other < count; other += 1u) {
            let before = found[other].square < mine.square
                || (found[other].square == mine.square && found[other].triangle < mine.triangle);
            rank += select(0u, 1u, before);
        }
        near[rank] = mine;
    }
    sync();
    return count;
}

// R less the least e / w^2, for the facets gathered.
fn spread_of(count: u32) -> f32 {
    var sums = vec3<f32>(0.0);
    var spread = 0.0;
    for (var k = 0u; k < count; k += 1u) {
        let e = near[k].square;
        // sum a (R - e)^2 = count (R - mean)^2 + rest.
        sums += near[k].area * vec3<f32>(1.0, e, e * e);
        let mean = sums.y / sums.x;
        let left = max(sums.z - sums.y * mean, 0.0);
        spread = mean + sqrt(max(1.0 - left, 0.0) / sums.x);
        if k + 1u == count || spread <= near[k + 1u].square {
            break;
        }
    }
    return spread;
}

// The facet near the node at x, `outside` the surface or not, with the weight r; its depth is not yet relative to the mean.
fn facet_of(triangle: u32, area: f32, weight: f32, x: vec3<f32>, outside: bool, contact: u32) -> Facet {
    let here = nearby(triangle, x);
    var facet = Facet();
    facet.contact = contact;
    facet.area = area;
    facet.weight = weight;
    let nodes = vec3<u32>(corner(triangle, 0u), corner(triangle, 1u), corner(triangle, 2u));
    let normal = unit_or_zero(cross(here.b - here.a, here.c - here.a));
    let gradients = face_gradients(here.a, here.b, here.c);
    let foot = vec3<f32>(1.0) - vec3<f32>(dot(gradients[0], here.a), dot(gradients[1], here.b), dot(gradients[2], here.c));
    facet.plane = measure(0.0, here.a, here.b, here.c, ClosestPoint(foot, FEATURE_FACE), normal);
    facet.plane.nodes = nodes;
    facet.feature = facet.plane;
    if here.closest.feature != FEATURE_FACE {
        facet.feature = measure(0.0, here.a, here.b, here.c, here.closest, normal);
    }
    let depth = facet.plane.distance;
    if outside {
        let lateral = here.offset - normal * depth;
        facet.depth = outside_facet(depth, dot(here.offset, here.offset), dot(lateral, lateral));
    } else {
        facet.depth = below_plane(depth);
    }
    return facet;
}

// dD/de of a facet.
fn by_square(area: f32, weight: f32, depth: FacetDepth) -> f32 {
    return area * weight * (weight * depth.by_square - 2.0 * depth.value / (parameters.blending * parameters.blending));
}

// da/d ln A.
fn area_slope(area: f32) -> f32 {
    return 2.0 * area * (1.0 - area);
}

// Facets of the node at x, of which the surface's closest point is at `distance`, from number `first` on, at most `room`, for
// contact number `contact`; their number, and the depth at x.
fn blend(x: vec3<f32>, distance: f32, moved: f32, first: u32, room: u32, contact: u32, local: u32) -> vec2<f32> {
    let least = distance * distance;
    let width = parameters.blending * parameters.blending;
    var spread = BLEND_SPREAD;
    var count = 0u;
    for (var gathering = 0u; gathering < GATHERINGS; gathering += 1u) {
        let within = spread;
        count = gather_near(x, sqrt(least + within * width), least, moved, local);
        spread = spread_of(count);
        if spread <= within {
            break;
        }
    }
    var taken = 0u;
    while taken < count && near[taken].square < spread {
        taken += 1u;
    }
    if taken > room {
        overflow = 1u;
        return vec2<f32>(0.0);
    }
    for (var k = local; k < taken; k += WORKGROUP) {
        facets[first + k] = facet_of(near[k].triangle, near[k].area, spread - near[k].square, x, distance < 0.0, contact);
    }
    sync();
    let start = facets[first].depth.value;
    var sums = vec4<f32>(0.0);
    for (var k = 0u; k < taken; k += 1u) {
        let weight = facets[first + k].weight;
        let share = facets[first + k].area * weight;
        let value = facets[first + k].depth.value - start;
        sums += share * vec4<f32>(1.0, value, weight, weight * value);
    }
    sync();
    let mean = sums.y / max(sums.x, LEAST_DIVISOR);
    for (var k = local; k < taken; k += WORKGROUP) {
        let place = first + k;
        facets[place].sum = sums.x;
        facets[place].depth.value -= start + mean;
        let area = facets[place].area;
        let weight = facets[place].weight;
        let depth = facets[place].depth;
        facets[place].plane_share = area * weight * weight * depth.by_plane;
        facets[place].feature_share = 2.0 * facets[place].feature.distance * by_square(area, weight, depth);
        facets[place].stretch = area_slope(area) * weight * weight * depth.value;
    }
    // The weights of the mean sum to one but for rounding.
    return vec2<f32>(f32(taken), start + sums.w / max(sums.z, LEAST_DIVISOR));
}

// This invocation's contact with the surface as displaced, at most by `moved`: of every node that touches, or comes within
// `reach`, now or did so before in this configuration. Without one, its depth is zero and it has no facets.
fn detect(moved: f32, reach: f32, local: u32) -> Spring {
    var spring = Spring();
    // Where the state at hand is not.
    spring.first_of_all = select(facet_base, facet_base + FACETS, held_first == facet_base);
    for (var proxy_node = 0u; proxy_node < parameters.proxy_nodes; proxy_node += 1u) {
        let clearance = positions[position_base + proxy_node].w - parameters.bulge;
        // A node outside at rest by more than the surface moves is outside still.
        if clearance > moved + reach + parameters.least_distance {
            continue;
        }
        let closest = contact_at(proxy_node, closest_triangle(proxy_node, moved, local));
        var number = 0u;
        while number < contact_count && contact_nodes[number] != proxy_node {
            number += 1u;
        }
        if number == contact_count && closest.depth + parameters.bulge <= -reach {
            continue;
        }
        let first = spring.first_of_all + spring.count_of_all;
        let room = FACETS - spring.count_of_all;
        let blended = blend(proxy_position(proxy_node), closest.distance, moved, first, room, number, local);
        let count = u32(blended.x);
        let depth = proxy_radius(proxy_node) + blended.y;
        if count == 0u || (number == contact_count && depth <= -reach) {
            continue;
        }
        if number == CONTACTS {
            overflow = 1u;
            continue;
        }
        sync();
        if local == 0u && number == contact_count {
            contact_nodes[number] = proxy_node;
            contact_count += 1u;
        }
        sync();
        if local == number {
            spring.proxy_node = proxy_node;
            spring.depth = depth;
            spring.first = first;
            spring.count = count;
        }
        spring.count_of_all += count;
    }
    return spring;
}

// A contact that changes in proportion to displacements: `vary` says so of all.
fn freeze(contact: Spring) -> Spring {
    return contact;
}

// A frozen row's contact at the displacement at hand.
fn frozen_contact(row: Spring) -> Spring {
    var contact = row;
    for (var k = 0u; k < row.count; k += 1u) {
        let nodes = facets[row.first + k].plane.nodes;
        let v = mat3x3<f32>(displaced(nodes.x), displaced(nodes.y), displaced(nodes.z));
        contact.depth += first_order(row.first + k, changes(row.first + k, v));
    }
    return contact;
}

// --- Forces ---

// First facet of the state at hand, and the number of its facets.
var<private> held_first: u32;
var<private> held_count: u32;
// What each contact does to its facets.
var<workgroup> orders: array<vec2<f32>, WORKGROUP>;

// Gives slots to the nodes of all contacts, which are the state at hand from now on.
fn occupy(contact: Spring, local: u32) {
    held_first = contact.first_of_all;
    held_count = contact.count_of_all;
    // Most have one, and are looked up side by side.
    for (var k = local; k < held_count; k += WORKGROUP) {
        let nodes = facets[held_first + k].plane.nodes;
        var slots = vec3<u32>(ABSENT);
        for (var slot = 0u; slot < support_count; slot += 1u) {
            slots = select(slots, vec3<u32>(slot), nodes == vec3<u32>(support_nodes[slot]));
        }
        facets[held_first + k].slots = slots;
    }
    sync();
    if local == 0u {
        for (var k = 0u; k < held_count; k += 1u) {
            if any(facets[held_first + k].slots == vec3<u32>(ABSENT)) {
                let nodes = facets[held_first + k].plane.nodes;
                let slot_0 = support_add(nodes.x);
                let slot_1 = support_add(nodes.y);
                facets[held_first + k].slots = vec3<u32>(slot_0, slot_1, support_add(nodes.z));
            }
        }
    }
    sync();
}

// A vector's entries at three slots: columns.
fn entries(vector: u32, slots: vec3<u32>) -> mat3x3<f32> {
    // ABSENT slots are those of an overflow: what is read there does not count.
    let safe = select(slots, vec3<u32>(0u), slots == vec3<u32>(ABSENT));
    return mat3x3<f32>(vectors[at(vector, safe.x)], vectors[at(vector, safe.y)], vectors[at(vector, safe.z)]);
}

// Sum of all facets' shares on one slot.
fn gather(slot: u32) -> vec3<f32> {
    var sum = vec3<f32>(0.0);
    for (var k = 0u; k < held_count; k += 1u) {
        let mine = facets[held_first + k].slots == vec3<u32>(slot);
        if any(mine) {
            sum += facets[held_first + k].share * vec3<f32>(mine);
        }
    }
    return sum;
}

// What displacements v of its nodes (columns) bring a facet's plane and its feature nearer by, and the share by which they
// stretch it.
fn changes(place: u32, v: mat3x3<f32>) -> vec3<f32> {
    let gradients = facets[place].plane.gradients;
    return vec3<f32>(
        dot(facets[place].plane.normal, v * facets[place].plane.weights),
        dot(facets[place].feature.normal, v * facets[place].feature.weights),
        dot(gradients[0], v[0]) + dot(gradients[1], v[1]) + dot(gradients[2], v[2]),
    );
}

// What that adds to the contact's depth.
fn first_order(place: u32, change: vec3<f32>) -> f32 {
    return dot(change, vec3<f32>(facets[place].plane_share, facets[place].feature_share, facets[place].stretch));
}

// What a force `push` along the contact's depth gives to the facet's nodes: columns.
fn spread(place: u32, push: f32) -> mat3x3<f32> {
    let plane = facets[place].plane_share * facets[place].plane.weights;
    let feature = facets[place].feature_share * facets[place].feature.weights;
    let normal = facets[place].plane.normal;
    let direction = facets[place].feature.normal;
    let gradients = facets[place].plane.gradients;
    let stretch = facets[place].stretch;
    return mat3x3<f32>(
        (normal * plane.x + direction * feature.x + gradients[0] * stretch) * push,
        (normal * plane.y + direction * feature.y + gradients[1] * stretch) * push,
        (normal * plane.z + direction * feature.z + gradients[2] * stretch) * push,
    );
}

// Shares: contact forces -kc depth dD.
fn press(contact: Spring, kc: f32, local: u32) {
    orders[local] = vec2<f32>(-kc * max(contact.depth, 0.0), 0.0);
    sync();
    for (var k = local; k < held_count; k += WORKGROUP) {
        facets[held_first + k].share = spread(held_first + k, orders[facets[held_first + k].contact].x);
    }
}

// What the displacement `vector` deepens this invocation's contact by, and its second variation along it.
fn vary(contact: Spring, vector: u32, local: u32) -> vec2<f32> {
    let scale = 1.0 / (parameters.blending * parameters.blending);
    for (var k = local; k < held_count; k += WORKGROUP) {
        let place = held_first + k;
        let change = changes(place, entries(vector, facets[place].slots));
        facets[place].along_plane = change.x;
        facets[place].along_feature = change.y;
        facets[place].stretching = change.z;
    }
    sync();
    // Changes of R, of the sum of a r g and of P.
    var deepening = 0.0;
    var reach = 0.0;
    var moment = 0.0;
    var depths = 0.0;
    for (var k = 0u; k < contact.count; k += 1u) {
        let place = contact.first + k;
        let change = vec3<f32>(facets[place].along_plane, facets[place].along_feature, facets[place].stretching);
        deepening += first_order(place, change);
        let area = facets[place].area;
        let weight = facets[place].weight;
        let depth = facets[place].depth;
        let square = 2.0 * facets[place].feature.distance * change.y;
        let area_change = area_slope(area) * change.z;
        reach += area * weight * square * scale - 0.5 * area_change * weight * weight;
        moment += area * weight * (depth.by_square * square + depth.by_plane * change.x)
            + (area_change * weight - area * square * scale) * depth.value;
        depths += area * depth.value;
    }
    var bending = 0.0;
    if contact.count > 0u {
        let sum = facets[contact.first].sum;
        reach /= sum;
        orders[local] = vec2<f32>(reach, (moment + reach * depths) / sum);
    }
    sync();
    for (var k = local; k < held_count; k += WORKGROUP) {
        let place = held_first + k;
        var share = mat3x3<f32>();
        if !FROZEN {
            let v = entries(vector, facets[place].slots);
            let order = orders[facets[place].contact];
            share = second_variation_of(place, v, order.x, order.y, scale);
            facets[place].bending = dot(v[0], share[0]) + dot(v[1], share[1]) + dot(v[2], share[2]);
        }
        facets[place].share = share;
    }
    sync();
    if !FROZEN {
        for (var k = 0u; k < contact.count; k += 1u) {
            bending += facets[contact.first + k].bending;
        }
    }
    return vec2<f32>(deepening, bending);
}

// A facet's part of the second variation of its contact's depth along displacements v of its nodes, which change R / w^2 by
// `reach` and m by `mean`.
fn second_variation_of(place: u32, v: mat3x3<f32>, reach: f32, mean: f32, scale: f32) -> mat3x3<f32> {
    let area = facets[place].area;
    let weight = facets[place].weight;
    let depth = facets[place].depth;
    let plane = facets[place].plane;
    let feature = facets[place].feature;
    let slope = area_slope(area);
    let along_plane = facets[place].along_plane;
    let along_feature = facets[place].along_feature;
    let square = 2.0 * feature.distance * along_feature;
    let area_change = slope * facets[place].stretching;
    let weight_change = reach - square * scale;
    let apart_change = mean - depth.by_plane * along_plane - depth.by_square * square;
    let slope_change = depth.by_plane_plane * along_plane + depth.by_plane_square * square;
    let square_slope_change = depth.by_plane_square * along_plane + depth.by_square_square * square;
    let whole_weight_change = 2.0 * area * weight * weight_change + area_change * weight * weight;
    let with_plane = whole_weight_change * depth.by_plane + area * weight * weight * slope_change;
    let with_area = 2.0 * (1.0 - 2.0 * area) * area_change * weight * weight * depth.value
        + slope * weight * (2.0 * weight_change * depth.value - weight * apart_change);
    let with_square = (area_change * weight + area * weight_change) * (weight * depth.by_square - 2.0 * depth.value * scale)
        + area * weight
            * (weight_change * depth.by_square + weight * square_slope_change + 2.0 * apart_change * scale);
    let with_feature = 2.0 * (with_square * feature.distance + by_square(area, weight, depth) * along_feature);
    let plane_bend = second_variation(plane, v);
    let feature_bend = second_variation(feature, v);
    let g = plane.gradients;
    let turn = g * (plane.normal * v);
    let stretch = facets[place].stretch;
    var share = mat3x3<f32>();
    for (var j = 0u; j < 3u; j += 1u) {
        // Second variation of ln A.
        let carried = g[0] * dot(g[j], v[0]) + g[1] * dot(g[j], v[1]) + g[2] * dot(g[j], v[2]);
        let stretching = plane.normal * dot(g[j], turn) - carried;
        share[j] = plane_bend[j] * facets[place].plane_share + plane.normal * (with_plane * plane.weights[j])
            + feature_bend[j] * facets[place].feature_share + feature.normal * (with_feature * feature.weights[j])
            + stretching * stretch + g[j] * with_area;
    }
    return share;
}

// Shares: a force `push` along the contact's depth, and `multiplier` times the second variation that `vary` found last.
fn load(contact: Spring, push: f32, multiplier: f32, local: u32) {
    orders[local] = vec2<f32>(push, multiplier);
    sync();
    for (var k = local; k < held_count; k += WORKGROUP) {
        let place = held_first + k;
        let order = orders[facets[place].contact];
        let bend = facets[place].share;
        let push_share = spread(place, order.x);
        facets[place].share = push_share + bend * order.y;
    }
}

// Shares: what depths larger by `push` / kc, and the displacement of the last `vary`, add to the contact forces.
fn press_on(contact: Spring, push: f32, local: u32) {
    load(contact, -push, -contact.multiplier, local);
}

// Shares: product of the contacts' Hessian with the displacement `vector`.
fn resist(contact: Spring, kc: f32, vector: u32, local: u32) {
    let change = vary(contact, vector, local);
    load(contact, kc * change.x, contact.multiplier, local);
}

// --- Results ---

// Writes the forces on the support that the vector holds, three nodes a touch; number of touches in use.
fn write_contacts(contact: Spring, kc: f32, vector: u32, place: u32, local: u32) -> u32 {
    let used = (support_count + 2u) / 3u;
    for (var k = local; k < used; k += WORKGROUP) {
        var touch = Touch();
        touch.nodes = vec3<u32>(ABSENT);
        touch.nodes.x = support_nodes[3u * k];
        touch.force_0 = vectors[at(vector, 3u * k)];
        if 3u * k + 1u < support_count {
            touch.nodes.y = support_nodes[3u * k + 1u];
            touch.force_1 = vectors[at(vector, 3u * k + 1u)];
        }
        if 3u * k + 2u < support_count {
            touch.nodes.z = support_nodes[3u * k + 2u];
            touch.force_2 = vectors[at(vector, 3u * k + 2u)];
        }
        touches[place * CONTACTS + k] = touch;
    }
    return used;
}
