//! How far apart the nodes of a surface lie, place by place, and which cubes suit it.

use glam::DVec3;

/// Size of cubes in edges of the surface (1): where the surface is as fine as contact needs, three edges along the
/// radius a of contact, these are 0.8 a, at which the compliance under it errs by 2 % (`docs/solids.md`).
const EDGES_PER_CUBE: f64 = 2.4;

/// Edges from which on cubes are doubled, in the shortest ones (1): they are at most 3.6 edges then, or 1.2 a, at which
/// compliance errs by 5 %.
const DOUBLED_FROM: f64 = 4.0 / 3.0;

/// Rings of triangles over which lengths are averaged: some radius of contact.
const RINGS: usize = 4;

/// Lengths of a surface's edges.
pub(super) struct Spacing {
    /// Around each node (m).
    edges: Vec<f64>,
    /// The least of them (m).
    finest: f64,
}

impl Spacing {
    /// That of the surface of `triangles`, each node of which is in some.
    pub fn new(nodes: &[DVec3], triangles: &[[u32; 3]]) -> Self {
        let mut of_triangles: Vec<f64> = triangles
            .iter()
            .map(|triangle| {
                let [a, b, c] = triangle.map(|node| nodes[node as usize]);
                (a.distance(b) + b.distance(c) + c.distance(a)) / 3.0
            })
            .collect();
        let mut edges = vec![0.0; nodes.len()];
        for _ in 0..RINGS {
            let mut sums = vec![[0.0; 2]; nodes.len()];
            for (triangle, edge) in triangles.iter().zip(&of_triangles) {
                triangle.iter().for_each(|&node| {
                    let [sum, count] = &mut sums[node as usize];
                    (*sum, *count) = (*sum + edge, *count + 1.0);
                });
            }
            edges = sums.iter().map(|[sum, count]| sum / count).collect();
            let mean = |triangle: &[u32; 3]| triangle.iter().map(|&node| edges[node as usize]).sum::<f64>() / 3.0;
            of_triangles = triangles.iter().map(mean).collect();
        }
        let finest = edges.iter().copied().fold(f64::INFINITY, f64::min);
        Self { edges, finest }
    }

    /// Size of cubes that suit the finest part of the surface (m).
    pub fn suitable_size(&self) -> f64 {
        EDGES_PER_CUBE * self.finest
    }

    /// How often cubes that suit the finest part may be doubled at the point of `weights` in `triangle`.
    pub fn level(&self, triangle: [u32; 3], weights: DVec3) -> usize {
        let edge: f64 = (0..3).map(|k| weights[k] * self.edges[triangle[k] as usize]).sum();
        (2.0 / DOUBLED_FROM * edge / self.finest).log2() as usize
    }
}
