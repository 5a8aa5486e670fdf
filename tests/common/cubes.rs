//! Bodies of cubes, with all their edges.

use glam::{DVec3, IVec3};
use std::collections::BTreeMap;

/// The surface of the cubes of side `size` (m) that are `solid`, of `counts` of them along the axes, around the origin:
/// its nodes and its triangles, two a square, outside to the left.
pub fn surface(counts: [i32; 3], size: f64, solid: impl Fn(IVec3) -> bool) -> (Vec<DVec3>, Vec<[u32; 3]>) {
    let counts = IVec3::from(counts);
    let inside = |cube: IVec3| cube.cmpge(IVec3::ZERO).all() && cube.cmplt(counts).all() && solid(cube);
    let mut numbers: BTreeMap<[i32; 3], u32> = BTreeMap::new();
    let (mut nodes, mut triangles) = (Vec::new(), Vec::new());
    let cubes = (0..counts.x).flat_map(|x| (0..counts.y).flat_map(move |y| (0..counts.z).map(move |z| [x, y, z])));
    for cube in cubes.map(IVec3::from).filter(|&cube| inside(cube)) {
        for (axis, side) in [0, 1, 2].into_iter().flat_map(|axis| [(axis, 0), (axis, 1)]) {
            let [out, u, v] = [0, 1, 2].map(|k| IVec3::AXES[(axis + k) % 3]);
            if inside(cube + (2 * side - 1) * out) {
                continue;
            }
            let mut corners = [IVec3::ZERO, u, u + v, v].map(|corner| {
                let at = cube + side * out + corner;
                *numbers.entry(at.to_array()).or_insert_with(|| {
                    nodes.push(size * (at.as_dvec3() - 0.5 * counts.as_dvec3()));
                    nodes.len() as u32 - 1
                })
            });
            if side == 0 {
                corners.reverse();
            }
            let [a, b, c, d] = corners;
            triangles.extend([[a, b, c], [a, c, d]]);
        }
    }
    (nodes, triangles)
}
