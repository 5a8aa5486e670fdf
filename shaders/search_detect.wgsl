// Where the trial's forces leave the surface, and the rows that this makes: contacts, and near misses of proxy nodes
// that have touched (twin: src/contact/detection.rs). One workgroup a configuration.
//
// A facet matters to a proxy node only where it is no farther than the surface is known to be: d + m, with d its
// distance at rest and m the most that a point of the surface has moved, or the distance of a corner of the facet that
// was closest last, where that is now. At rest it was no farther than m beyond. Only the nodes of such facets are
// displaced, and for as many proxy nodes together as there are invocations.

override WORKGROUP: u32 = 32u;

// Whether there is a trial that waits for this.
var<workgroup> waits: u32;

var<workgroup> shares: array<real, WORKGROUP>;

// Farther from the surface at rest than this no proxy node can touch where geometry is frozen: 1/2 |u|^2 <= E <= E(0)
// in the energy norm, and |u_j|^2 <= trace(C_jj) |u|^2, all along the search.
fn frozen_reach(local: u32) -> real {
    var own = real(0.0);
    for (var node = local; node < parameters.proxy_nodes; node += WORKGROUP) {
        let depth = max(proxy_radius(node) - rest_distance(node) + parameters.gap_band, real(0.0));
        own += proxy_share(node) * depth * depth;
    }
    shares[local] = own;
    workgroupBarrier();
    var sum = real(0.0);
    for (var k = 0u; k < WORKGROUP; k += 1u) {
        sum += shares[k];
    }
    workgroupBarrier();
    return sqrt(parameters.kc * parameters.softest * sum);
}

// Lists the proxy nodes whose gap at rest is no wider than `reach`, in ascending order; returns how many there are.
fn list_candidates(reach: real, local: u32) -> u32 {
    begin_list(0u, local);
    for (var first = 0u; first < parameters.proxy_nodes; first += WORKGROUP) {
        let node = first + local;
        var is_candidate = false;
        if node < parameters.proxy_nodes {
            is_candidate = rest_distance(node) - proxy_radius(node) <= reach + parameters.gap_band;
        }
        let entry = place_in_list(is_candidate, local);
        if is_candidate {
            set_word(at_candidate(entry), node);
        }
    }
    sync();
    passes += (parameters.proxy_nodes / WORKGROUP + 1u) * (1u + WORKGROUP);
    return listed;
}

// Place of a corner of the facet that was closest last to proxy node `node`, or ABSENT.
fn known_corner(node: u32) -> u32 {
    let last = word(at_last(node));
    if last == 0u {
        return ABSENT;
    }
    return carrier(last - 1u, 0u);
}

// Displacement of the node in `place` by the trial's forces.
fn displacement_now(place: u32) -> vec3<real> {
    var sum = vec3<real>(0.0);
    if place < parameters.covered {
        let slots = word(SLOTS);
        for (var slot = 0u; slot < slots; slot += 1u) {
            let force = vector_at(at_entry_of(1u - word(HALF), slot));
            sum += moved_by(word(at_place(slot)), force, place);
        }
    }
    return sum;
}

// Within what distance of proxy node `node`, at x, the closest facet is, or matters.
fn matters_within(node: u32, x: vec3<real>) -> real {
    let band = parameters.gap_band;
    let moved = scalar(MOVED);
    let rest = rest_distance(node);
    var farthest = abs(rest) + band + moved;
    let corner = known_corner(node);
    if corner != ABSENT {
        let now = at_rest(corner) + displacement_now(corner);
        farthest = min(farthest, distance(x, now) + scalar(BULGE) + band);
    }
    // A node that was outside at rest is inside only where the surface has passed over it, and then no deeper than
    // that.
    let is_followed = FROZEN || rest <= band || word(at_watched(node)) != 0u;
    return select(min(farthest, max(proxy_radius(node), moved - rest + band)), farthest, is_followed);
}

// The facet that was closest last to proxy node `node`, at x: a start as good as any, unless it is so far from x that
// it may not have been displaced.
fn likely_for(node: u32, x: vec3<real>, within: real) -> u32 {
    let corner = known_corner(node);
    if corner == ABSENT || distance(x, at_rest(corner)) > within + scalar(MOVED) {
        return ABSENT;
    }
    return word(at_last(node)) - 1u;
}

// Whether what lay in a sphere at rest may matter to one of the points.
fn matters(sphere: vec4<real>) -> bool {
    return PAPER || points_near(sphere, atomicLoad(&with_point), scalar(MOVED)) != 0u;
}

// Lists the covered nodes that matter to the points; returns how many there are. The paper ties nodes wherever they
// are.
fn list_nodes(local: u32) -> u32 {
    let all = parameters.groups;
    begin_list(0u, local);
    for (var first = 0u; first < all; first += WORKGROUP) {
        let group = first + local;
        let is_listed = group < all && matters(surface[parameters.at_spheres + min(group, all - 1u)]);
        let entry = place_in_list(is_listed, local);
        if is_listed {
            set_word(at_group(entry), group);
        }
    }
    sync();
    let groups = listed;
    passes += ((all + groups * NODES_TOGETHER) / WORKGROUP + 2u) * (1u + 2u * WORKGROUP);
    begin_list(0u, local);
    for (var first = 0u; first < groups * NODES_TOGETHER; first += WORKGROUP) {
        let index = min(first + local, groups * NODES_TOGETHER - 1u);
        let place = word(at_group(index / NODES_TOGETHER)) * NODES_TOGETHER + index % NODES_TOGETHER;
        let is_there = first + local == index && place < parameters.covered;
        let is_listed = is_there && matters(sphere_of(min(place, parameters.covered - 1u)));
        let entry = place_in_list(is_listed, local);
        if is_listed {
            set_word(at_near(entry), place);
        }
    }
    sync();
    return listed;
}

fn displace_node(entry: u32, count: u32, place: u32, displacement: vec3<real>) {
    if entry < count {
        set_vector(at_displacement(place), displacement);
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

// Writes the rows of `candidates` proxy nodes: of those that touch or have touched or, where geometry is frozen, have a
// gap no wider than `reach`. Returns how many nodes were displaced for that.
fn write_rows(candidates: u32, reach: real, local: u32) -> u32 {
    let half = 1u - word(HALF);
    var rows = 0u;
    var displaced = 0u;
    for (var first = 0u; first < candidates; first += WORKGROUP) {
        var is_row = false;
        var node = 0u;
        var x = vec3<real>(0.0);
        var within = -FAR_AWAY;
        var likely = ABSENT;
        if first + local < candidates {
            node = word(at_candidate(first + local));
            x = proxy_position(node);
            within = matters_within(node, x);
            likely = likely_for(node, x, within);
        }
        take_point(x, within, local);
        let near = list_nodes(local);
        displace(near, local);
        displaced += near;
        passes += (2u + near / (4u * WORKGROUP)) * (word(SLOTS) + 2u) + 6u * parameters.carriers + WORKGROUP;
        let closest = closest_facet(scalar(MOVED), likely, local);
        var outward = vec3<real>(0.0);
        if closest.facet != ABSENT {
            set_word(at_last(node), closest.facet + 1u);
            outward = pseudonormal(closest.facet, closest.point, x);
            let is_inside = dot(jet_at(closest.point.weights).point, outward) >= 0.0;
            let depth = proxy_radius(node) + select(-closest.distance, closest.distance, is_inside);
            is_row = depth > 0.0 || word(at_watched(node)) != 0u || (FROZEN && depth >= -reach);
            if depth > 0.0 {
                set_word(at_watched(node), 1u);
            }
        }
        begin_list(rows, local);
        let row = place_in_list(is_row, local);
        rows = listed;
        if is_row && row < parameters.contacts {
            write_row(half, row, node, x, closest.facet, closest.point, outward);
        }
    }
    if local == 0u {
        set_word(ROWS + half, min(rows, parameters.contacts));
        // Loops that are stopped find what is void.
        if rows > parameters.contacts || passes > 2u * LOOP_BUDGET {
            set_word(OVERFLOW, 1u);
        }
    }
    return displaced;
}

// Notes what this took; for one invocation.
fn account(candidates: u32, displaced: u32) {
    var facets = real(0.0);
    for (var k = 0u; k < WORKGROUP; k += 1u) {
        facets += shares[k];
    }
    tally(TRIALS, 1u);
    tally(CANDIDATES, candidates);
    tally(FACETS, u32(facets));
    tally(DISPLACED, displaced);
    tally(DISPLACED_PAIRS, displaced * word(SLOTS));
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
        var reach = scalar(MOVED);
        if FROZEN {
            reach = frozen_reach(local);
        }
        let candidates = list_candidates(reach, local);
        let displaced = write_rows(candidates, reach, local);
        shares[local] = real(measured);
        workgroupBarrier();
        if local == 0u {
            account(candidates, candidates + displaced);
        }
    }
}
