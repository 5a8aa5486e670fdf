// Spheres around facets at rest. The stage declares `surface`, which begins with the spheres (centre, radius) of the
// clusters of facets, of the groups of clusters, and of the facets in the order of the clusters.

// Distance of x to a bounding sphere; below zero inside.
fn distance_to_sphere(number: u32, x: vec3<real>) -> real {
    let at = 4u * number;
    return distance(x, vec3<real>(surface[at], surface[at + 1u], surface[at + 2u])) - surface[at + 3u];
}
