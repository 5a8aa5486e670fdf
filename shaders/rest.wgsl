// Contact with the surface at rest (twin: src/contact/equilibrium/rest.rs): one workgroup a configuration, from the
// joints to torque and touches. Where nothing touches it ends with the gap.

// Widens the distance that the surface moves at most, for the rounding of what bounds it.
const MOTION_SLACK: f32 = 1.0001;

// Upper bound of the smallest gap; zero where it is below.
fn bound_of_gap(configuration: u32, local: u32) -> f32 {
    var upper = FAR_AWAY;
    for (var node = local; node < parameters.proxy_nodes; node += WORKGROUP) {
        upper = min(upper, bounds_at(node_at(configuration, node)).upper - radius_of(node));
    }
    return max(least_of(upper, local), 0.0);
}

// Displaces the nodes of the own row by the forces of all rows.
fn displace_by_forces(count: u32) {
    own_displacements = array<vec3<f32>, 4u * CARRIERS>();
    for (var row = 0u; row < count; row += 1u) {
        let force = solution[row];
        if force == 0.0 {
            continue;
        }
        for (var l = 0u; l < 4u * parameters.carriers; l += 1u) {
            let weight = rows[at_row(row) + AT_WEIGHTS + l / 4u][l % 4u];
            if weight != 0.0 {
                displace(places_of(row_names[row].y, l / 4u)[l % 4u], (-force * weight) * rows[at_row(row) + AT_NORMAL].xyz);
            }
        }
    }
}

fn has_row(node: u32, count: u32) -> bool {
    for (var row = 0u; row < count; row += 1u) {
        if row_names[row].x == node {
            return true;
        }
    }
    return false;
}

// Adds a row for each proxy node without one that the surface has reached, behind the `count` rows that there are. No
// node matters that is farther than `reach` at rest. Returns the smallest gap at rest of these nodes.
fn add_rows(configuration: u32, count: u32, reach: f32, local: u32) -> f32 {
    var gap = FAR_AWAY;
    for (var first = 0u; first < parameters.proxy_nodes; first += WORKGROUP) {
        let node = first + local;
        var is_reached = false;
        if node < parameters.proxy_nodes {
            let x = node_at(configuration, node);
            let bounds = bounds_at(x);
            if bounds.lower - radius_of(node) <= reach && !has_row(node, count) {
                let found = closest_facet(x, bounds.near);
                if found.facet != ABSENT {
                    let outward = pseudonormal(found.facet, found.point, x);
                    make_row(x, radius_of(node), found.facet, found.point, outward);
                    take_places();
                    displace_by_forces(count);
                    gap = min(gap, -own.depth);
                    is_reached = own.depth + dot(own.normal, own_moved()[0]) > 0.0;
                }
            }
        }
        let place = place_in_list(is_reached, local);
        if is_reached && place < ROOM {
            store_row(place, node);
        }
    }
    return least_of(gap, local);
}

// Sets the entries of S for the rows from `first` on, of `count` in all.
fn couple(first: u32, count: u32, local: u32) {
    workgroupBarrier();
    for (var place = entry(first, 0u) + local; place < entry(count, 0u); place += WORKGROUP) {
        var i = u32((sqrt(8.0 * f32(place) + 1.0) - 1.0) * 0.5);
        i = select(i, i + 1u, entry(i + 1u, 0u) <= place);
        i = select(i, i - 1u, entry(i, 0u) > place);
        let j = place - entry(i, 0u);
        take_row(i);
        take_places();
        matrix[place] = coupling(j) + select(0.0, parameters.softness / rows[at_row(i) + AT_CORNERS].w, i == j);
    }
    workgroupBarrier();
}

// Whether the compliance covers all facets within `radius` of x.
fn is_covered(x: vec3<f32>, radius: f32) -> bool {
    var node = 1u;
    while node != 0u {
        let is_near = distance_to_sphere(node, x) <= radius;
        if is_near && node < parameters.leaves {
            node = 2u * node;
            continue;
        }
        if is_near {
            for (var four = 0u; four < parameters.carriers; four += 1u) {
                let places = places_of(facet_in_order(node - parameters.leaves), four);
                if any(places >= vec4<u32>(parameters.covered) & places != vec4<u32>(ABSENT)) {
                    return false;
                }
            }
        }
        node = behind(node);
    }
    return true;
}

fn write_number(at: u32, number: f32) {
    records[at] = bitcast<u32>(number);
}

fn write_head(configuration: u32, status: u32, rounds: u32, gap: f32) {
    let at = configuration * record_length();
    records[at] = status;
    records[at + 1u] = rounds;
    records[at + 2u] = 0u;
    write_number(at + 4u, gap);
}

// Writes what touches, a row an invocation.
fn write_touches(configuration: u32, count: u32) {
    let at = configuration * record_length();
    var pushing = 0u;
    for (var row = 0u; row < count; row += 1u) {
        pushing += u32(solution[row] > 0.0);
    }
    var touch = 3u * atomicAdd(&touches.count, pushing);
    records[at + 2u] = pushing;
    records[at + 3u] = touch / 3u;
    for (var row = 0u; row < count; row += 1u) {
        let force = solution[row];
        if force > 0.0 {
            let normal = bitcast<vec3<u32>>(rows[at_row(row) + AT_NORMAL].xyz);
            touches.fours[touch] = vec4<u32>(row_names[row], bitcast<u32>(force));
            touches.fours[touch + 1u] = vec4<u32>(bitcast<vec2<u32>>(rows[at_row(row) + AT_CORNERS].xy), normal.xy);
            touches.fours[touch + 2u] = vec4<u32>(bitcast<vec3<u32>>(rows[at_row(row) + AT_FORCE].xyz), normal.z);
            touch += 3u;
        }
    }
}

@compute @workgroup_size(WORKGROUP)
fn main(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) local: u32,
) {
    let configuration = unfold(group, groups);
    if configuration >= parameters.configurations {
        return;
    }
    var count = 0u;
    var rounds = 0u;
    var status = STATUS_CONTACT;
    var gap = 0.0;
    var energy = 0.0;
    var reach = bound_of_gap(configuration, local);
    loop {
        let nearest = add_rows(configuration, count, reach, local);
        gap = select(gap, nearest, count == 0u);
        if listed > ROOM {
            status = STATUS_OVERFLOW;
            break;
        }
        if gap > -parameters.band {
            status = STATUS_FREE;
            break;
        }
        if listed == count {
            break;
        }
        couple(count, listed, local);
        count = listed;
        let ended = solve_program(count, local);
        rounds += ended.rounds;
        if !ended.is_solved {
            status = STATUS_UNCONVERGED;
            break;
        }
        energy = 0.0;
        var elastic = 0.0;
        for (var row = 0u; row < count; row += 1u) {
            let force = solution[row];
            energy += 0.5 * force * rows[at_row(row) + AT_X].w;
            elastic -= 0.5 * force * force * parameters.softness / rows[at_row(row) + AT_CORNERS].w;
        }
        elastic += energy;
        reach = MOTION_SLACK * sqrt(2.0 * max(elastic, 0.0)) * parameters.mobility + parameters.band;
    }
    if status != STATUS_CONTACT {
        if local == 0u {
            write_head(configuration, status, rounds, gap);
        }
        return;
    }
    place_joints(configuration, local);
    var off = 0.0;
    var deepest = 0.0;
    var is_within = true;
    for (var first = 0u; first < count; first += WORKGROUP) {
        let row = first + local;
        var force = 0.0;
        if row < count {
            force = solution[row];
            deepest = max(deepest, rows[at_row(row) + AT_X].w);
            off = max(off, select(slack[row], abs(slack[row]), force > 0.0));
        }
        if force > 0.0 {
            take_row(row);
            take_places();
            displace_by_forces(count);
            rows[at_row(row) + AT_FORCE] = vec4<f32>(force * own_push(), 0.0);
            let node = row_names[row].x;
            let radius = abs(own.depth - radius_of(node)) + 2.0 * reach + parameters.bulge;
            is_within = is_within && (WHOLE || is_covered(own.x, radius));
        }
        if WITH_TANGENT {
            add_tangent(row, force, count, local);
        }
    }
    if WITH_TANGENT {
        take_off_response(count, local);
    }
    let residual = -least_of(-off, local) / max(-least_of(-deepest, local), LEAST_DIVISOR);
    let is_doubtful = least_of(select(0.0, 1.0, is_within), local) == 0.0;
    if is_doubtful {
        status = STATUS_OVERFLOW;
    }
    let at = configuration * record_length();
    if local == 0u {
        write_head(configuration, status, rounds, gap);
        write_number(at + 5u, energy);
        write_number(at + 6u, residual);
        write_touches(configuration, count);
    }
    for (var k = local; k < parameters.joints; k += WORKGROUP) {
        var torque = 0.0;
        for (var row = 0u; row < count; row += 1u) {
            if solution[row] > 0.0 {
                let column = jacobian_column(row_names[row].x, rows[at_row(row) + AT_X].xyz, k);
                torque += dot(column, rows[at_row(row) + AT_FORCE].xyz);
            }
        }
        write_number(at + HEAD + k, torque);
    }
    if WITH_TANGENT {
        for (var k = local; k < parameters.joints * (parameters.joints + 1u) / 2u; k += WORKGROUP) {
            write_number(at + HEAD + parameters.joints + k, tangent_sums[k]);
        }
    }
}
