// Spheres around facets at rest: a binary tree over the facets in an order in which neighbours are near each other.
// Node 1 is the root, node i has the children 2 i and 2 i + 1, and the facet in place k of the order is node
// leaves + k. Behind the last facet leaves have spheres that are far from everything.
//
// The stage declares `parameters`, with `leaves`, and `surface`, which begins with the sphere (centre, radius) of each
// node.

// Distance of x to the sphere of a node; below zero inside.
fn distance_to_sphere(node: u32, x: vec3<real>) -> real {
    let sphere = surface[node];
    return distance(x, sphere.xyz) - sphere.w;
}

// The node that a search from left to right comes to behind a node and all under it; zero behind the last.
fn behind(node: u32) -> u32 {
    let next = (node + 1u) >> firstTrailingBit(node + 1u);
    return select(next, 0u, next == 1u);
}

// The leaf to which the nearer child leads, from the root down.
fn leaf_near(x: vec3<real>) -> u32 {
    var node = 1u;
    while node < parameters.leaves {
        node = 2u * node;
        if distance_to_sphere(node + 1u, x) < distance_to_sphere(node, x) {
            node += 1u;
        }
    }
    return node;
}
