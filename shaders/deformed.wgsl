// Contacts of the proxy with the deformed surface: of each proxy node with the closest feature (twin:
// src/contact/detection.rs).
//
// Triangles are searched cluster by cluster. Which clusters may hold the closest triangle of a proxy node is given by
// their bounding spheres at rest, and by how far any node can have moved. The nodes of these alone are displaced; the
// clusters' bounding spheres where they are now leave a few triangles, which the invocations share out. What is left
// out cannot be closest.
//
// The stage declares MOVING, the vector of forces on A that displaces the surface.

// Number of the current trial, which stamps what is known of it.
var<private> trial_number: f32;

// The workspace of a configuration: displacement of each covered node, with the number of the trial that it is for in
// w; then the bounding sphere, where it is now, of each cluster that the search lists, and behind these, in x, the
// cluster's number.

// Forgets what is known of an earlier configuration.
fn begin_trials(local: u32) {
    for (var place = local; place < parameters.covered; place += WORKGROUP) {
        workspace[workspace_base + place] = vec4<f32>(0.0);
    }
    storageBarrier();
}

fn sphere_place(number: u32) -> u32 {
    return workspace_base + parameters.covered + number;
}

fn cluster_place(number: u32) -> u32 {
    return workspace_base + parameters.covered + parameters.clusters + number;
}

// Displacement of a surface node.
fn displaced(node: u32) -> vec3<f32> {
    let place = place_of(node);
    if PARTIAL && place == ABSENT {
        return vec3<f32>(0.0);
    }
    let known = workspace[workspace_base + place];
    if known.w == trial_number {
        return known.xyz;
    }
    return response(MOVING, place);
}

// Node j's position less x.
fn node_from(node: u32, x: vec3<f32>) -> vec3<f32> {
    return (rest[node].xyz - x) + displaced(node);
}

fn proxy_position(proxy_node: u32) -> vec3<f32> {
    return positions[position_base + proxy_node].xyz;
}

fn proxy_radius(proxy_node: u32) -> f32 {
    return rest[parameters.surface_nodes + parameters.triangles + proxy_node].x;
}

// Signed distance of a proxy node to the surface at rest, less its radius.
fn gap_at_rest(proxy_node: u32) -> f32 {
    return positions[position_base + proxy_node].w;
}

// --- Clusters of triangles ---

// Bounding sphere of a cluster at rest.
fn cluster_at_rest(cluster: u32) -> vec4<f32> {
    return rest[parameters.surface_nodes + parameters.triangles + parameters.proxy_nodes + cluster];
}

// Where the clusters' lists begin in `mesh`: triangles in the order of the clusters, the starts of their nodes, and
// these.
fn clusters_base() -> u32 {
    return 9u * parameters.triangles + parameters.surface_nodes + 1u + select(0u, parameters.surface_nodes, PARTIAL);
}

fn clustered_triangle(entry: u32) -> u32 {
    return mesh[clusters_base() + entry];
}

fn cluster_start(cluster: u32) -> u32 {
    return mesh[clusters_base() + parameters.triangles + cluster];
}

fn cluster_node(entry: u32) -> u32 {
    return mesh[clusters_base() + parameters.triangles + parameters.clusters + 1u + entry];
}

// --- Closest triangles ---

// Proxy node whose closest triangle each invocation is to know, or ABSENT.
var<workgroup> near: array<u32, WORKGROUP>;
// Its distance so far, as bits, which for numbers that are not negative are ordered like these; and the triangle.
var<workgroup> nearest: array<atomic<u32>, WORKGROUP>;
var<workgroup> closest: array<atomic<u32>, WORKGROUP>;
// Clusters that may hold a closest triangle.
var<workgroup> listed_count: atomic<u32>;
// Of these, pairs with the near node that they may matter to; then the distance of each pair's triangles.
var<workgroup> passing: array<u32, WORKGROUP>;
var<workgroup> passing_count: atomic<u32>;
override DISTANCES: u32 = WORKGROUP * CLUSTER;
var<workgroup> distances: array<f32, DISTANCES>;

// Pairs hold the near node's place above this bit.
const PAIR_SHIFT: u32 = 27u;

// The triangle closest to this invocation's near node, if it is no farther than `within`, else ABSENT; ties go to the
// lower number. `waiting` invocations have one; no node has moved by more than `moved`.
fn closest_triangle(within: f32, waiting: u32, moved: f32, local: u32) -> u32 {
    var least = within;
    atomicStore(&nearest[local], bitcast<u32>(within));
    atomicStore(&closest[local], ABSENT);
    if local == 0u {
        atomicStore(&listed_count, 0u);
    }
    workgroupBarrier();
    for (var cluster = local; cluster < parameters.clusters; cluster += WORKGROUP) {
        let sphere = cluster_at_rest(cluster);
        var wanted = false;
        for (var k = 0u; k < waiting; k += 1u) {
            if near[k] != ABSENT {
                let away = distance(proxy_position(near[k]), sphere.xyz) - sphere.w - moved;
                wanted = wanted || away <= bitcast<f32>(atomicLoad(&nearest[k]));
            }
        }
        if wanted {
            workspace[cluster_place(atomicAdd(&listed_count, 1u))].x = f32(cluster);
        }
    }
    storageBarrier();
    workgroupBarrier();
    let listed = atomicLoad(&listed_count);
    displace(listed, local);
    bound(listed, local);
    let pairs = waiting * listed;
    for (var first = 0u; first < pairs; first += WORKGROUP) {
        if local == 0u {
            atomicStore(&passing_count, 0u);
        }
        workgroupBarrier();
        let pair = first + local;
        let k = pair / listed;
        if pair < pairs && near[k] != ABSENT {
            let sphere = workspace[sphere_place(pair % listed)];
            let away = distance(proxy_position(near[k]), sphere.xyz) - sphere.w;
            if away <= bitcast<f32>(atomicLoad(&nearest[k])) {
                let cluster = u32(workspace[cluster_place(pair % listed)].x);
                passing[atomicAdd(&passing_count, 1u)] = (k << PAIR_SHIFT) | cluster;
            }
        }
        workgroupBarrier();
        let candidates = atomicLoad(&passing_count) * CLUSTER;
        for (var candidate = local; candidate < candidates; candidate += WORKGROUP) {
            distances[candidate] = FAR_AWAY;
            let entry = clustered(candidate);
            if entry < parameters.triangles {
                let place = passing[candidate / CLUSTER] >> PAIR_SHIFT;
                let away = distance_to(near[place], clustered_triangle(entry));
                distances[candidate] = away;
                atomicMin(&nearest[place], bitcast<u32>(away));
            }
        }
        workgroupBarrier();
        // What was closest before is not any more.
        let now = bitcast<f32>(atomicLoad(&nearest[local]));
        if now < least {
            least = now;
            atomicStore(&closest[local], ABSENT);
        }
        workgroupBarrier();
        for (var candidate = local; candidate < candidates; candidate += WORKGROUP) {
            let place = passing[candidate / CLUSTER] >> PAIR_SHIFT;
            if bitcast<u32>(distances[candidate]) == atomicLoad(&nearest[place]) {
                atomicMin(&closest[place], clustered_triangle(clustered(candidate)));
            }
        }
    }
    workgroupBarrier();
    return atomicLoad(&closest[local]);
}

// Place, in the order of the clusters, of a candidate of the current pairs.
fn clustered(candidate: u32) -> u32 {
    return (passing[candidate / CLUSTER] & ((1u << PAIR_SHIFT) - 1u)) * CLUSTER + candidate % CLUSTER;
}

fn distance_to(proxy_node: u32, triangle: u32) -> f32 {
    let x = proxy_position(proxy_node);
    let a = node_from(corner(triangle, 0u), x);
    let b = node_from(corner(triangle, 1u), x);
    let c = node_from(corner(triangle, 2u), x);
    let closest = closest_point(vec3<f32>(0.0), a, b, c);
    return length(closest.weights.x * a + closest.weights.y * b + closest.weights.z * c);
}

// Invocations that share the nodes of a cluster.
const TEAM: u32 = 8u;

// Displaces the nodes of the clusters listed. Where two clusters have a node in common, two invocations may write the
// same to it.
fn displace(listed: u32, local: u32) {
    for (var number = local / TEAM; number < listed; number += WORKGROUP / TEAM) {
        let cluster = u32(workspace[cluster_place(number)].x);
        let end = cluster_start(cluster + 1u);
        for (var entry = cluster_start(cluster) + local % TEAM; entry < end; entry += TEAM) {
            let place = place_of(cluster_node(entry));
            if !(PARTIAL && place == ABSENT) && workspace[workspace_base + place].w != trial_number {
                workspace[workspace_base + place] = vec4<f32>(response(MOVING, place), trial_number);
            }
        }
    }
    storageBarrier();
    workgroupBarrier();
}

// Bounds the clusters listed, where they are now.
fn bound(listed: u32, local: u32) {
    for (var number = local; number < listed; number += WORKGROUP) {
        let cluster = u32(workspace[cluster_place(number)].x);
        let sphere = cluster_at_rest(cluster);
        let start = cluster_start(cluster);
        let end = cluster_start(cluster + 1u);
        var offset = vec3<f32>(0.0);
        for (var entry = start; entry < end; entry += 1u) {
            offset += node_from(cluster_node(entry), sphere.xyz);
        }
        let centre = sphere.xyz + offset / f32(end - start);
        var radius = 0.0;
        for (var entry = start; entry < end; entry += 1u) {
            radius = max(radius, length(node_from(cluster_node(entry), centre)));
        }
        workspace[sphere_place(number)] = vec4<f32>(centre, radius + parameters.least_distance);
    }
    storageBarrier();
    workgroupBarrier();
}

// --- Contacts ---

// Proxy node of each contact. Invocation k keeps contact k from the first touch on, also as a near miss.
var<workgroup> contact_nodes: array<u32, WORKGROUP>;
// Triangle that was closest last.
var<workgroup> contact_triangles: array<u32, WORKGROUP>;
var<workgroup> contact_count: u32;

// The contact (or near miss, with depth <= 0) of a proxy node with the closest point of a triangle.
fn contact_at(proxy_node: u32, triangle: u32) -> Contact {
    let x = proxy_position(proxy_node);
    let nodes = vec3<u32>(corner(triangle, 0u), corner(triangle, 1u), corner(triangle, 2u));
    let a = node_from(nodes.x, x);
    let b = node_from(nodes.y, x);
    let c = node_from(nodes.z, x);
    let closest = closest_point(vec3<f32>(0.0), a, b, c);
    let normal = pseudonormal(triangle, closest.feature, x);
    var contact = measure(proxy_radius(proxy_node), a, b, c, closest, normal);
    contact.nodes = nodes;
    contact.proxy_node = proxy_node;
    return contact;
}

fn is_contact(proxy_node: u32, count: u32) -> bool {
    for (var k = 0u; k < count; k += 1u) {
        if contact_nodes[k] == proxy_node {
            return true;
        }
    }
    return false;
}

// Distance within which the closest triangle of a proxy node is looked for: that of a known contact wherever it is,
// that of another node if it touches, or comes within `reach`.
fn search_distance(proxy_node: u32, moved: f32, reach: f32, hint: u32) -> f32 {
    let radius = proxy_radius(proxy_node);
    let rest_distance = gap_at_rest(proxy_node) + radius;
    var within = abs(rest_distance) + moved;
    if hint != ABSENT {
        within = min(within, distance_to(proxy_node, hint));
    } else if rest_distance > 0.0 {
        // A node outside at rest is inside now only where the surface has passed over it.
        within = max(radius + reach, moved - rest_distance);
    }
    return within * (1.0 + SEARCH_SLACK) + parameters.least_distance;
}

// Takes up the near nodes among the first `waiting` that touch, as `partial` says. For one invocation.
fn take_up(waiting: u32) {
    for (var k = 0u; k < waiting; k += 1u) {
        if partial[k].x == 0.0 {
            continue;
        }
        if contact_count == CONTACTS {
            overflow = 1u;
            return;
        }
        contact_nodes[contact_count] = near[k];
        contact_triangles[contact_count] = atomicLoad(&closest[k]);
        contact_count += 1u;
    }
}

// This invocation's contact with the surface as displaced, at most by `moved`: of every node that touches, or comes
// within `reach`, now or did so before in this configuration (then with a depth below zero, as it may touch again).
// Without one, depth and weights are zero.
fn deformed(moved: f32, reach: f32, local: u32) -> Contact {
    let known = contact_count;
    // A node outside at rest by more than the surface moves is outside still.
    let beyond = moved + reach + parameters.least_distance;
    var contact = Contact();
    var proxy_node = 0u;
    var first = true;
    // As many near nodes at a time as there are invocations, the contacts first.
    while first || proxy_node < parameters.proxy_nodes {
        let is_known = first && local < known;
        var waiting = select(0u, known, first);
        var mine = ABSENT;
        var within = 0.0;
        if is_known && gap_at_rest(contact_nodes[local]) <= beyond {
            mine = contact_nodes[local];
        }
        while proxy_node < parameters.proxy_nodes && waiting < WORKGROUP {
            if gap_at_rest(proxy_node) <= beyond && !is_contact(proxy_node, known) {
                if local == waiting {
                    mine = proxy_node;
                }
                waiting += 1u;
            }
            proxy_node += 1u;
        }
        near[local] = mine;
        if mine != ABSENT {
            var hint = ABSENT;
            if is_known {
                hint = contact_triangles[local];
            }
            within = search_distance(mine, moved, reach, hint);
        }
        let triangle = closest_triangle(within, waiting, moved, local);
        var found = Contact();
        let is_found = mine != ABSENT && triangle != ABSENT;
        if is_found {
            found = contact_at(mine, triangle);
        }
        if is_known {
            contact = found;
            if is_found {
                contact_triangles[local] = triangle;
            }
        }
        partial[local].x = select(0.0, 1.0, is_found && !is_known && found.depth > -reach);
        workgroupBarrier();
        if local == 0u {
            take_up(waiting);
        }
        workgroupBarrier();
        first = false;
    }
    if local >= known && local < contact_count {
        contact = contact_at(contact_nodes[local], contact_triangles[local]);
    }
    return contact;
}
