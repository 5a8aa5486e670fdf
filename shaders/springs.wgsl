// Contact: the closest facet pushes, a spring a contact (twin: src/contact/law/springs.rs). Invocation k keeps contact
// k. Vectors on the support are in the workgroup's memory.

// A size that follows; named, because naga 30 loses count of overrides in array sizes that are expressions.
override VECTOR_NUMBERS: u32 = 3u * VECTORS * SUPPORT;

// Slots of each contact's three nodes, ABSENT for nodes that it does not act on.
var<workgroup> slots: array<vec3<u32>, WORKGROUP>;
// What each contact gives to its three nodes.
var<workgroup> shares: array<mat3x3<f32>, WORKGROUP>;
// Vectors on the support, one behind the other, three numbers a slot.
var<workgroup> vectors: array<f32, VECTOR_NUMBERS>;

// A vector's entry.
fn entry(vector: u32, slot: u32) -> vec3<f32> {
    let at = 3u * (vector * SUPPORT + slot);
    return vec3<f32>(vectors[at], vectors[at + 1u], vectors[at + 2u]);
}

fn put(vector: u32, slot: u32, value: vec3<f32>) {
    let at = 3u * (vector * SUPPORT + slot);
    vectors[at] = value.x;
    vectors[at + 1u] = value.y;
    vectors[at + 2u] = value.z;
}

// Nodes of each contact that have no slot yet.
var<workgroup> newcomers: array<vec3<u32>, WORKGROUP>;

// Gives slots to the nodes of every contact; `nodes` is ABSENT where the contact does not act.
fn assign_slots(nodes: vec3<u32>, local: u32) {
    let mine = vec3<u32>(slot_of(nodes.x), slot_of(nodes.y), slot_of(nodes.z));
    slots[local] = mine;
    newcomers[local] = select(vec3<u32>(ABSENT), nodes, mine == vec3<u32>(ABSENT));
    workgroupBarrier();
    if local == 0u {
        for (var k = 0u; k < contact_count; k += 1u) {
            for (var j = 0u; j < 3u; j += 1u) {
                if newcomers[k][j] != ABSENT {
                    slots[k][j] = support_add(newcomers[k][j]);
                }
            }
        }
    }
    workgroupBarrier();
}

// Sum of all contacts' shares on one slot.
fn gather(slot: u32) -> vec3<f32> {
    var sum = vec3<f32>(0.0);
    for (var k = 0u; k < contact_count; k += 1u) {
        let mine = vec3<f32>(slots[k] == vec3<u32>(slot));
        sum += shares[k] * mine;
    }
    return sum;
}

// A vector's entries at a contact's three nodes: columns.
fn entries(vector: u32, contact_slots: vec3<u32>) -> mat3x3<f32> {
    // ABSENT slots read slot 0: what is read there is multiplied by zero.
    let safe = select(contact_slots, vec3<u32>(0u), contact_slots == vec3<u32>(ABSENT));
    return mat3x3<f32>(entry(vector, safe.x), entry(vector, safe.y), entry(vector, safe.z));
}

// --- Frozen geometry ---

// A contact that changes in proportion to displacements.
fn freeze(contact: Contact) -> Contact {
    var row = contact;
    row.along = vec3<f32>(0.0);
    row.distance = 0.0;
    row.inverse_distance = 0.0;
    row.gradients = mat3x3<f32>();
    return row;
}

// A frozen row's contact at the current displacement.
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
    let used = u32(greatest(select(0.0, f32(local + 1u), contact.depth > 0.0), contact_count, local));
    if local < used {
        write_touch(place, local, contact.nodes, contact.proxy_node, contact_forces(contact, kc));
    }
    return used;
}
