// Where the trial's forces leave the surface, and the rows that this makes: contacts, and near misses of proxy nodes
// that have touched (twin: src/contact/detection.rs). One workgroup a configuration.
//
// A facet matters to a proxy node only where it is no farther than the surface is known to be: d + m, with d its
// distance at rest and m the most that a point of the surface has moved, and no farther than the facet that was closest
// last. At rest it was no farther than m beyond. Only the nodes of such facets are displaced, and for as many proxy
// nodes together as there are invocations.

override WORKGROUP: u32 = 32u;

// Whether there is a trial that waits for this.
var<workgroup> waits: u32;

// Words of a bit for each node that the compliance covers: which are needed, and which are displaced by this trial.
override NODE_WORDS: u32 = 1u;
var<workgroup> needed: array<atomic<u32>, NODE_WORDS>;
var<workgroup> ready: array<u32, NODE_WORDS>;

// Nodes that this invocation has displaced.
var<private> displaced: u32;

// Lists the proxy nodes whose gap at rest is no wider than `reach`, in ascending order; returns how many there are.
fn list_candidates(reach: real, local: u32) -> u32 {
    begin_list(0u, local);
    for (var first = 0u; first < parameters.proxy_nodes; first += WORKGROUP) {
        let node = first + local;
        var is_candidate = false;
        if node < parameters.proxy_nodes {
            is_candidate = rest_distance(node) - proxy_radius(node) <= reach + parameters.gap_band;
        }
        let entry = place_in_list(select(0u, 1u, is_candidate), local);
        if is_candidate {
            set_word(at_candidate(entry), node);
        }
    }
    sync();
    passes += (parameters.proxy_nodes / WORKGROUP + 1u) * (1u + WORKGROUP);
    return listed;
}

// Within what distance of proxy node `node` the closest facet is, or matters.
fn matters_within(node: u32) -> real {
    let band = parameters.gap_band;
    let moved = scalar(MOVED);
    let rest = rest_distance(node);
    let farthest = farthest_at_rest(node) + moved;
    // A node that was outside at rest is inside only where the surface has passed over it, and then no deeper than
    // that.
    let is_followed = rest <= band || word(at_watched(node)) != 0u;
    return select(min(farthest, max(proxy_radius(node), moved - rest + band)), farthest, is_followed);
}

// No node is displaced by this trial. For all invocations together.
fn begin_displacing(local: u32) {
    for (var k = local; k < NODE_WORDS; k += WORKGROUP) {
        atomicStore(&needed[k], 0u);
        ready[k] = 0u;
    }
    workgroupBarrier();
}

// Notes that a facet is going to be looked at.
fn need(facet: u32) {
    for (var j = 0u; j < parameters.carriers; j += 1u) {
        let place = carrier(facet, j);
        if place < parameters.covered {
            atomicOr(&needed[place / 32u], 1u << (place % 32u));
        }
    }
}

// Displaces the nodes of all facets that are going to be looked at. For all invocations together.
fn make_ready(local: u32) {
    begin_list(0u, local);
    for (var first = 0u; first < NODE_WORDS; first += WORKGROUP) {
        var fresh = 0u;
        if first + local < NODE_WORDS {
            let wanted = atomicLoad(&needed[first + local]);
            fresh = wanted & ~ready[first + local];
            ready[first + local] = wanted;
        }
        var entry = place_in_list(countOneBits(fresh), local);
        for (; fresh != 0u; fresh &= fresh - 1u) {
            set_word(at_near(entry), 32u * (first + local) + firstTrailingBit(fresh));
            entry += 1u;
        }
    }
    sync();
    passes += (NODE_WORDS / WORKGROUP + 1u) * (1u + WORKGROUP + min(listed, 32u))
        + (listed + 4u * WORKGROUP - 1u) / (4u * WORKGROUP) * (word(SLOTS) + word(SLOTS) / WORKGROUP + 2u);
    displace(listed, local);
}

fn displace_node(entry: u32, count: u32, place: u32, displacement: vec3<real>) {
    if entry < count {
        set_vector(at_displacement(place), displacement);
        displaced += 1u;
    }
}

// Displaces the first `count` listed nodes.
fn displace(count: u32, local: u32) {
    for (var first = 0u; first < count; first += 4u * WORKGROUP) {
        let entries = first + local + vec4<u32>(0u, 1u, 2u, 3u) * WORKGROUP;
        let known = min(entries, vec4<u32>(count - 1u));
        let places = vec4<u32>(word(at_near(known.x)), word(at_near(known.y)), word(at_near(known.z)),
            word(at_near(known.w)));
        let moved = responses(1u - word(HALF), places, local);
        displace_node(entries.x, count, places.x, moved[0]);
        displace_node(entries.y, count, places.y, moved[1]);
        displace_node(entries.z, count, places.z, moved[2]);
        displace_node(entries.w, count, places.w, moved[3]);
    }
    sync();
}

// Writes the rows of `candidates` proxy nodes: of those that touch or have touched.
fn write_rows(candidates: u32, local: u32) {
    let half = 1u - word(HALF);
    var rows = 0u;
    begin_displacing(local);
    for (var first = 0u; first < candidates; first += WORKGROUP) {
        var is_row = false;
        var node = 0u;
        var x = vec3<real>(0.0);
        var within = -FAR_AWAY;
        var likely = ABSENT;
        if first + local < candidates {
            node = word(at_candidate(first + local));
            x = proxy_position(node);
            within = matters_within(node);
            let last = word(at_last(node));
            if last != 0u {
                likely = last - 1u;
            }
        }
        take_point(x, within, local);
        let closest = closest_facet(scalar(MOVED), likely, local);
        var outward = vec3<real>(0.0);
        var jet: Jet;
        if closest.facet != ABSENT {
            set_word(at_last(node), closest.facet + 1u);
            outward = pseudonormal(closest.facet, closest.point, x);
            jet = jet_at(closest.point.weights);
            let is_inside = dot(jet.point, outward) >= 0.0;
            let depth = proxy_radius(node) + select(-closest.distance, closest.distance, is_inside);
            is_row = depth > 0.0 || word(at_watched(node)) != 0u;
            if depth > 0.0 {
                set_word(at_watched(node), 1u);
            }
        }
        begin_list(rows, local);
        let row = place_in_list(select(0u, 1u, is_row), local);
        rows = listed;
        if is_row && row < parameters.contacts {
            write_row(half, row, node, closest.facet, closest.point, jet, outward);
        }
    }
    if local == 0u {
        set_word(ROWS + half, min(rows, parameters.contacts));
        // Loops that are stopped find what is void.
        if rows > parameters.contacts || passes > 2u * LOOP_BUDGET {
            set_word(OVERFLOW, 1u);
        }
    }
}

// Sum of one number from each invocation, in every one.
fn total(number: u32, local: u32) -> u32 {
    begin_list(0u, local);
    place_in_list(number, local);
    return listed;
}

// Notes what this took.
fn account(candidates: u32, local: u32) {
    let facets = total(measured, local);
    let nodes = total(displaced, local);
    if local == 0u {
        tally(TRIALS, 1u);
        tally(CANDIDATES, candidates);
        tally(FACETS, facets);
        tally(DISPLACED, nodes);
        tally(DISPLACED_PAIRS, nodes * word(SLOTS));
    }
}

@compute @workgroup_size(WORKGROUP)
fn main(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) local: u32,
) {
    let is_there = take_up(unfold(group, groups));
    if is_there && local == 0u {
        waits = select(0u, 1u, word(PHASE) == PLACED);
    }
    workgroupBarrier();
    if waits != 0u {
        let candidates = list_candidates(scalar(MOVED), local);
        write_rows(candidates, local);
        account(candidates, local);
    }
}
