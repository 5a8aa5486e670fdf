//! Bodies of cubes, with all their edges.

use glam::DVec3;
use std::collections::HashMap;

/// Nodes (m) and triangles of a surface.
pub type Shell = (Vec<DVec3>, Vec<[u32; 3]>);

/// The surface of the cubes of size `edge` (m) at the places that `is_filled` names, within `counts` of them; the first one
/// has its corner at the origin.
pub fn cubes(counts: [i32; 3], edge: f64, is_filled: impl Fn([i32; 3]) -> bool) -> Shell {
    let holds = |at: [i32; 3]| (0..3).all(|k| (0..counts[k]).contains(&at[k])) && is_filled(at);
    let (mut nodes, mut triangles, mut numbers) = (Vec::new(), Vec::new(), HashMap::new());
    let all = (0..counts[0]).flat_map(|x| (0..counts[1]).flat_map(move |y| (0..counts[2]).map(move |z| [x, y, z])));
    for at in all.filter(|at| holds(*at)) {
        for (axis, side) in (0..3).flat_map(|axis| [(axis, 0), (axis, 1)]) {
            let mut beside = at;
            beside[axis] += 2 * side - 1;
            if holds(beside) {
                continue;
            }
            let corners = [[0, 0], [1, 0], [1, 1], [0, 1]].map(|[u, v]| {
                let mut corner = at;
                corner[axis] += side;
                corner[(axis + 1) % 3] += u;
                corner[(axis + 2) % 3] += v;
                *numbers.entry(corner).or_insert_with(|| {
                    nodes.push(edge * DVec3::from_array(corner.map(f64::from)));
                    nodes.len() as u32 - 1
                })
            });
            let [a, b, c, d] = corners;
            triangles.extend(if side == 1 { [[a, b, c], [a, c, d]] } else { [[a, c, b], [a, d, c]] });
        }
    }
    (nodes, triangles)
}
