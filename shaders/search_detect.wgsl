// Where the trial's forces leave the surface, and the rows that this makes: contacts, and near misses of proxy nodes
// that have touched (twin: src/contact/detection.rs). One workgroup a configuration.
//
// A facet matters to a proxy node only where it is no farther than the surface is known to be: d + m, with d its
// distance at rest and m the most that a point of the surface has moved, or the distance of a corner of the facet that
// was closest last, where that is now. At rest it was no farther than m beyond. Only the nodes of such facets are
// displaced.

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
    return listed;
}

// Farthest that the surface can be from proxy node `node` where it is now.
fn farthest(node: u32) -> real {
    return abs(rest_distance(node)) + parameters.gap_band + scalar(MOVED);
}

// Place of a corner of the facet that was closest last to the proxy node in this place of the list, or ABSENT.
fn known_corner(entry: u32, candidates: u32) -> u32 {
    if entry >= candidates {
        return ABSENT;
    }
    let last = word(at_last(word(at_candidate(entry))));
    if last == 0u {
        return ABSENT;
    }
    return carrier(last - 1u, 0u);
}

// Notes how far from the proxy node in this place of the list facets at rest matter, with the corner in `place`
// displaced by `displacement`.
fn note_reach(entry: u32, candidates: u32, place: u32, displacement: vec3<real>) {
    if entry >= candidates {
        return;
    }
    let node = word(at_candidate(entry));
    var reach = farthest(node);
    if place != ABSENT {
        let moved = select(displacement, vec3<real>(0.0), place >= parameters.covered);
        reach = min(reach, distance(proxy_position(node), at_rest(place) + moved) + scalar(BULGE));
    }
    set_scalar(at_reach(node), reach + scalar(MOVED) + parameters.gap_band);
}

fn bound_reaches(candidates: u32, local: u32) {
    for (var first = local; first < candidates; first += 4u * WORKGROUP) {
        let entries = vec4<u32>(first, first + WORKGROUP, first + 2u * WORKGROUP, first + 3u * WORKGROUP);
        let places = vec4<u32>(known_corner(entries.x, candidates), known_corner(entries.y, candidates),
            known_corner(entries.z, candidates), known_corner(entries.w, candidates));
        let is_covered = places < vec4<u32>(parameters.covered);
        let moved = responses(1u - word(HALF), select(vec4<u32>(0u), places, is_covered));
        note_reach(entries.x, candidates, places.x, moved[0]);
        note_reach(entries.y, candidates, places.y, moved[1]);
        note_reach(entries.z, candidates, places.z, moved[2]);
        note_reach(entries.w, candidates, places.w, moved[3]);
    }
    sync();
}

// Lists the groups of covered nodes that matter to one of `candidates` proxy nodes; returns how many there are.
fn list_groups(candidates: u32, local: u32) -> u32 {
    let groups = (parameters.covered + NODES_TOGETHER - 1u) / NODES_TOGETHER;
    begin_list(0u, local);
    for (var first = 0u; first < groups; first += WORKGROUP) {
        let group = first + local;
        var matters = false;
        if group < groups {
            let sphere = surface[parameters.at_spheres + group];
            // The paper ties nodes wherever they are.
            matters = PAPER;
            for (var entry = 0u; entry < candidates && !matters; entry += 1u) {
                let node = word(at_candidate(entry));
                matters = distance(proxy_position(node), sphere.xyz) <= scalar(at_reach(node)) + sphere.w;
            }
        }
        let entry = place_in_list(matters, local);
        if matters {
            set_word(at_group(entry), group);
        }
    }
    sync();
    return listed;
}

// Place of node `index` of the listed groups, or ABSENT behind the last.
fn place_of(index: u32, groups: u32) -> u32 {
    if index / NODES_TOGETHER >= groups {
        return ABSENT;
    }
    let entry = word(at_group(index / NODES_TOGETHER)) * NODES_TOGETHER + index % NODES_TOGETHER;
    if entry >= parameters.covered {
        return ABSENT;
    }
    return mesh[parameters.at_places + entry];
}

fn displace_node(place: u32, displacement: vec3<real>) {
    if place != ABSENT {
        set_vector(at_displacement(place), displacement);
    }
}

// Displaces the nodes of the listed groups.
fn displace(groups: u32, local: u32) {
    for (var first = local; first < groups * NODES_TOGETHER; first += 4u * WORKGROUP) {
        let places = vec4<u32>(place_of(first, groups), place_of(first + WORKGROUP, groups),
            place_of(first + 2u * WORKGROUP, groups), place_of(first + 3u * WORKGROUP, groups));
        let moved = responses(1u - word(HALF), select(places, vec4<u32>(0u), places == vec4<u32>(ABSENT)));
        displace_node(places.x, moved[0]);
        displace_node(places.y, moved[1]);
        displace_node(places.z, moved[2]);
        displace_node(places.w, moved[3]);
    }
    sync();
}

// Within what distance of proxy node `node` the closest facet matters.
fn matters_within(node: u32) -> real {
    let band = parameters.gap_band;
    let rest = rest_distance(node);
    // A node that was outside at rest is inside only where the surface has passed over it, and then no deeper than
    // that.
    let is_followed = FROZEN || rest <= band || word(at_watched(node)) != 0u;
    let over = max(proxy_radius(node), scalar(MOVED) - rest + band);
    return select(min(farthest(node), over), farthest(node), is_followed);
}

// The facet that was closest last to proxy node `node`, at x: a start as good as any, unless it is so far from x that it
// may not have been displaced.
fn likely_for(node: u32, x: vec3<real>) -> u32 {
    let last = word(at_last(node)) - 1u;
    if last == ABSENT {
        return ABSENT;
    }
    return select(ABSENT, last, distance(x, at_rest(carrier(last, 0u))) <= scalar(at_reach(node)));
}

// Writes the rows of `candidates` proxy nodes: of those that touch or have touched or, where geometry is frozen, have a
// gap no wider than `reach`.
fn write_rows(candidates: u32, reach: real, local: u32) {
    let half = 1u - word(HALF);
    begin_list(0u, local);
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
            likely = likely_for(node, x);
        }
        let closest = closest_facets(x, within, scalar(MOVED), likely, local);
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
        let row = place_in_list(is_row, local);
        if is_row && row < parameters.contacts {
            write_row(half, row, node, x, closest.facet, closest.point, outward);
        }
    }
    if local == 0u {
        set_word(ROWS + half, min(listed, parameters.contacts));
        if listed > parameters.contacts {
            set_word(OVERFLOW, 1u);
        }
    }
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
        bound_reaches(candidates, local);
        let displaced = list_groups(candidates, local);
        displace(displaced, local);
        write_rows(candidates, reach, local);
        shares[local] = real(measured);
        workgroupBarrier();
        if local == 0u {
            account(candidates, candidates + displaced * NODES_TOGETHER);
        }
    }
}
