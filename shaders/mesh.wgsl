// Corners and neighbours of the surface's triangles.
//
// The stage declares `parameters` and `mesh`, which holds, one behind the other, three corners a triangle, three
// neighbours a triangle (across edge k), the starts of the lists of triangles around each node (one more than there are
// nodes), and those lists.

// No triangle, node or place.
const ABSENT: u32 = 0xffffffffu;

fn corner(triangle: u32, k: u32) -> u32 {
    return mesh[3u * triangle + k];
}

fn across(triangle: u32, k: u32) -> u32 {
    return mesh[3u * (parameters.triangles + triangle) + k];
}

fn around_start(node: u32) -> u32 {
    return mesh[6u * parameters.triangles + node];
}

fn around(entry: u32) -> u32 {
    return mesh[6u * parameters.triangles + parameters.surface_nodes + 1u + entry];
}

// Place of `node` among a triangle's corners.
fn place_of_corner(triangle: u32, node: u32) -> u32 {
    return select(select(2u, 1u, corner(triangle, 1u) == node), 0u, corner(triangle, 0u) == node);
}

// v scaled to length one; a vector too short to have a direction becomes zero.
fn unit_or_zero(v: vec3<f32>) -> vec3<f32> {
    let square = dot(v, v);
    return select(vec3<f32>(0.0), v / sqrt(max(square, LEAST_DIVISOR)), square > LEAST_DIVISOR);
}
