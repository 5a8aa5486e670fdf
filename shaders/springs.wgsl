// Contact: the closest facet pushes, a spring a contact (twins: src/contact/detection.rs and
// springs.rs). Invocation k keeps contact k. Vectors on the support are in the workgroup's memory.

// A size that follows; named, because naga 30 loses count of overrides in array sizes that are expressions.
override VECTOR_ENTRIES: u32 = VECTORS * SUPPORT;

// Slots of each contact's three nodes, ABSENT for nodes that it does not act on.
var<workgroup> slots: array<vec3<u32>, WORKGROUP>;
// What each contact gives to its three nodes.
var<workgroup> shares: array<mat3x3<f32>, WORKGROUP>;
// Vectors on the support, one behind the other.
var<workgroup> vectors: array<vec3<f32>, VECTOR_ENTRIES>;

// Place of a vector's entry.
fn at(vector: u32, slot: u32) -> u32 {
    return vector * SUPPORT + slot;
}

// Gives slots to the nodes of every contact; `nodes` is ABSENT where the contact does not act.
fn assign_slots(nodes: vec3<u32>, local: u32) {
    slots[local] = nodes;
    workgroupBarrier();
    if local == 0u {
        for (var k = 0u; k < parameters.lanes; k += 1u) {
            let nodes_k = slots[k];
            let slot_0 = support_add(nodes_k.x);
            let slot_1 = support_add(nodes_k.y);
            slots[k] = vec3<u32>(slot_0, slot_1, support_add(nodes_k.z));
        }
    }
    workgroupBarrier();
}

// Sum of all contacts' shares on one slot.
fn gather(slot: u32) -> vec3<f32> {
    var sum = vec3<f32>(0.0);
    for (var k = 0u; k < parameters.lanes; k += 1u) {
        let mine = vec3<f32>(slots[k] == vec3<u32>(slot));
        sum += shares[k] * mine;
    }
    return sum;
}

// A vector's entries at a contact's three nodes: columns.
fn entries(vector: u32, contact_slots: vec3<u32>) -> mat3x3<f32> {
    // ABSENT slots read slot 0: what is read there is multiplied by zero.
    let safe = select(contact_slots, vec3<u32>(0u), contact_slots == vec3<u32>(ABSENT));
    return mat3x3<f32>(vectors[at(vector, safe.x)], vectors[at(vector, safe.y)], vectors[at(vector, safe.z)]);
}

// --- Detection ---

// Closest triangle of each contact, ABSENT while the node is far outside.
var<workgroup> contact_triangles: array<u32, WORKGROUP>;
// Proxy nodes near the surface, with their closest triangles, on their way to the contacts.
var<workgroup> near: array<vec2<u32>, WORKGROUP>;

// Brings the contacts up to date with `waiting` near nodes, of which `partial` says which touch. For one invocation.
fn sift(waiting: u32) {
    for (var k = 0u; k < waiting; k += 1u) {
        let place = near[k];
        var contact = 0u;
        while contact < contact_count && contact_nodes[contact] != place.x {
            contact += 1u;
        }
        if contact == contact_count {
            if partial[k].x == 0.0 {
                continue;
            }
            if contact == CONTACTS {
                overflow = 1u;
                continue;
            }
            contact_nodes[contact] = place.x;
            contact_count += 1u;
        }
        contact_triangles[contact] = place.y;
    }
}

// This invocation's contact with the surface as displaced, at most by `moved`: of every node that touches, or comes within
// `reach`, now or did so before in this configuration (then with a depth below zero, as it may touch again). Without one,
// depth and weights are zero.
fn deformed(moved: f32, reach: f32, local: u32) -> Contact {
    contact_triangles[local] = ABSENT;
    var contact = Contact();
    var proxy_node = 0u;
    var finished = false;
    // Passes over as many near nodes as there are invocations; a last one, without any, turns to the contacts.
    while !finished {
        var waiting = 0u;
        while proxy_node < parameters.proxy_nodes && waiting < WORKGROUP {
            // A node outside at rest by more than the surface moves is outside still.
            if positions[position_base + proxy_node].w <= moved + reach + parameters.least_distance {
                let triangle = closest_triangle(proxy_node, moved, local);
                if local == 0u {
                    near[waiting] = vec2<u32>(proxy_node, triangle);
                }
                waiting += 1u;
            }
            proxy_node += 1u;
        }
        workgroupBarrier();
        finished = waiting == 0u;
        var place = near[local];
        var taking_part = local < waiting;
        if finished {
            place = vec2<u32>(contact_nodes[local], contact_triangles[local]);
            taking_part = local < contact_count && place.y != ABSENT;
        }
        contact = Contact();
        if taking_part {
            contact = contact_at(place.x, place.y);
        }
        partial[local].x = select(0.0, 1.0, contact.depth > -reach);
        workgroupBarrier();
        if local == 0u {
            sift(waiting);
        }
        workgroupBarrier();
    }
    return contact;
}

// A contact that changes in proportion to displacements.
fn freeze(contact: Contact) -> Contact {
    var row = contact;
    row.along = vec3<f32>(0.0);
    row.distance = 0.0;
    row.inverse_distance = 0.0;
    row.gradients = mat3x3<f32>();
    return row;
}

// A frozen row's contact at the displacement at hand.
fn frozen_contact(row: Contact) -> Contact {
    var contact = row;
    for (var k = 0u; k < 3u; k += 1u) {
        contact.depth += row.weights[k] * dot(row.normal, displaced(row.nodes[k]));
    }
    return contact;
}

// --- Forces ---

// Nodes that a contact acts on.
fn acting_nodes(contact: Contact) -> vec3<u32> {
    return select(vec3<u32>(ABSENT), contact.nodes, contact.weights != vec3<f32>(0.0));
}

// Gives slots to the nodes of all contacts.
fn occupy(contact: Contact, local: u32) {
    assign_slots(acting_nodes(contact), local);
}

// Contact forces -kc depth w_j N on the object's nodes: columns.
fn contact_forces(contact: Contact, kc: f32) -> mat3x3<f32> {
    let force = contact.normal * (-kc * max(contact.depth, 0.0));
    return mat3x3<f32>(force * contact.weights.x, force * contact.weights.y, force * contact.weights.z);
}

// Shares: contact forces.
fn press(contact: Contact, kc: f32, local: u32) {
    shares[local] = contact_forces(contact, kc);
}

// The second variation that `vary` found last.
var<private> bend: mat3x3<f32>;

// What the displacement `vector` deepens this invocation's contact by, and its second variation along it.
fn vary(contact: Contact, vector: u32, local: u32) -> vec2<f32> {
    let v = entries(vector, slots[local]);
    bend = second_variation(contact, v);
    let deepening = dot(contact.normal, v * contact.weights);
    return vec2<f32>(deepening, dot(v[0], bend[0]) + dot(v[1], bend[1]) + dot(v[2], bend[2]));
}

// Shares: what depths larger by `push` / kc, and the displacement of the last `vary`, add to the contact forces.
fn press_on(contact: Contact, push: f32, local: u32) {
    shares[local] = mat3x3<f32>(
        -(contact.normal * (push * contact.weights.x) + bend[0] * contact.multiplier),
        -(contact.normal * (push * contact.weights.y) + bend[1] * contact.multiplier),
        -(contact.normal * (push * contact.weights.z) + bend[2] * contact.multiplier),
    );
}

// Shares: product of the contacts' Hessian with the displacement `vector`.
fn resist(contact: Contact, kc: f32, vector: u32, local: u32) {
    shares[local] = hessian_product(contact, kc, entries(vector, slots[local]));
}

// --- Results ---

fn write_touch(place: u32, k: u32, nodes: vec3<u32>, proxy_node: u32, forces: mat3x3<f32>) {
    touches[place * CONTACTS + k] = Touch(nodes, proxy_node, forces[0], 0u, forces[1], 0u, forces[2], 0u);
}

// Writes the contacts with their forces; number of touches in use.
fn write_contacts(contact: Contact, kc: f32, vector: u32, place: u32, local: u32) -> u32 {
    let used = u32(greatest(select(0.0, f32(local + 1u), contact.depth > 0.0), local));
    if local < used {
        write_touch(place, local, contact.nodes, contact.proxy_node, contact_forces(contact, kc));
    }
    return used;
}
