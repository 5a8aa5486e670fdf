//! A sphere of nearly equal triangles: an icosahedron whose faces are divided.
//!
//! Every edge of the icosahedron is divided into n equal arcs, every face into n^2 triangles. A point with barycentric
//! weights w on a face with the corners v is the direction of `sum_k sin(w_k theta) v_k`, theta the angle of an edge:
//! on an edge this is the point at equal arcs. The longest edge is then 1.2 times the shortest, on every mesh. There
//! are 10 n^2 + 2 nodes and 20 n^2 triangles.

use super::out_of_range;
use crate::Error;
use glam::DVec3;
use std::collections::HashMap;

/// The icosahedron's faces, outward: three corners of each.
const FACES: [u32; 60] = [
    0, 11, 5, 0, 5, 1, 0, 1, 7, 0, 7, 10, 0, 10, 11, 1, 5, 9, 5, 11, 4, 11, 10, 2, 10, 7, 6, 7, 1, 8, 3, 9, 4, 3, 4, 2,
    3, 2, 6, 3, 6, 8, 3, 8, 9, 4, 9, 5, 2, 4, 11, 6, 2, 10, 8, 6, 7, 9, 8, 1,
];

/// Returns the nodes and outward triangles of a sphere. `divisions`: parts of each edge of the icosahedron.
pub(crate) fn generate(centre: DVec3, radius: f64, divisions: usize) -> Result<(Vec<DVec3>, Vec<[u32; 3]>), Error> {
    if !(radius > 0.0 && radius.is_finite()) {
        return Err(out_of_range("radius", radius, "positive and finite"));
    }
    if divisions < 1 {
        return Err(out_of_range("number of divisions", 0.0, "at least 1"));
    }
    let corners = corners();
    let angle = 0.2f64.sqrt().acos();
    let divisions = divisions as u32;
    let mut numbers = HashMap::new();
    let mut nodes = Vec::new();
    let mut number = |face: [u32; 3], parts: [u32; 3]| {
        // Corners without weight do not tell a node of one face from that of its neighbour.
        let mut key = [0, 1, 2].map(|k| if parts[k] > 0 { (face[k], parts[k]) } else { (u32::MAX, 0) });
        key.sort_unstable();
        *numbers.entry(key).or_insert_with(|| {
            let weighted = key.iter().filter(|(_, parts)| *parts > 0);
            let direction: DVec3 = weighted
                .map(|&(corner, parts)| {
                    (f64::from(parts) / f64::from(divisions) * angle).sin() * corners[corner as usize]
                })
                .sum();
            nodes.push(centre + radius * direction.normalize());
            nodes.len() as u32 - 1
        })
    };
    let mut triangles = Vec::with_capacity(20 * (divisions * divisions) as usize);
    for &face in FACES.as_chunks().0 {
        for i in 0..divisions {
            for j in 0..divisions - i {
                let mut at = |i: u32, j: u32| number(face, [divisions - i - j, i, j]);
                triangles.push([at(i, j), at(i + 1, j), at(i, j + 1)]);
                if i + j + 1 < divisions {
                    triangles.push([at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)]);
                }
            }
        }
    }
    Ok((nodes, triangles))
}

/// Returns the icosahedron's twelve corners on the unit sphere.
fn corners() -> [DVec3; 12] {
    let golden = 0.5 * (1.0 + 5.0f64.sqrt());
    let corner = |k: usize| {
        let (first, second) = ([-1.0, 1.0][k % 2], [golden, -golden][k / 2 % 2]);
        match k / 4 {
            0 => DVec3::new(first, second, 0.0),
            1 => DVec3::new(0.0, first, second),
            _ => DVec3::new(second, 0.0, first),
        }
    };
    std::array::from_fn(|k| corner(k).normalize())
}
