//! How the surface follows the nodes that K moves.
//!
//! A node of the surface stands for its own area: of each triangle around it what is nearer to it than to the other
//! corners (Meyer et al., 2003). Where the corners of a flat face lie on a circle, it does not matter along which
//! diagonals the face is cut. The node's displacement is the mean of the solid's over that area, `u_i = sum_a N_ia u_a`,
//! and a force on it is spread over the same area. Displacements and forces use the same N, so the compliance
//! `C = N K^-1 N^T` is symmetric. Forces at points instead would make a node on a corner of the lattice four times as soft
//! as its neighbours. On springs and skins the nodes of K are those of the surface, and N is the identity.

use glam::DVec3;
use std::collections::BTreeMap;

/// Sparse matrix N: a row for each node of the object, a column for each node of K.
#[derive(Clone, Debug, PartialEq)]
pub struct Attachment {
    offsets: Vec<u32>,
    entries: Vec<(u32, f64)>,
    /// Columns: nodes of K.
    columns: usize,
}

impl Attachment {
    /// The identity over `nodes` nodes.
    #[must_use]
    pub fn identity(nodes: usize) -> Self {
        let count = nodes as u32;
        Self { offsets: (0..=count).collect(), entries: (0..count).map(|node| (node, 1.0)).collect(), columns: nodes }
    }

    /// The means over `points`, one row for each of `surface_nodes`; then `inner` unit rows. `carriers` returns the
    /// nodes of K that move a point with their weights.
    pub(super) fn averaged<'a>(
        points: &[SurfacePoint],
        [surface_nodes, inner, columns]: [usize; 3],
        carriers: impl Fn(&SurfacePoint) -> (&'a [u32], Vec<f64>),
    ) -> Self {
        let mut rows: Vec<(f64, BTreeMap<u32, f64>)> = vec![(0.0, BTreeMap::new()); surface_nodes];
        for point in points {
            let (area, row) = &mut rows[point.owner as usize];
            *area += point.area;
            let (nodes, values) = carriers(point);
            for (&node, value) in nodes.iter().zip(values).filter(|(_, value)| *value != 0.0) {
                *row.entry(node).or_insert(0.0) += point.area * value;
            }
        }
        let (mut offsets, mut entries) = (vec![0], Vec::new());
        for (area, row) in rows {
            entries.extend(row.into_iter().map(|(node, sum)| (node, sum / area)));
            offsets.push(entries.len() as u32);
        }
        for node in surface_nodes..surface_nodes + inner {
            entries.push((node as u32, 1.0));
            offsets.push(entries.len() as u32);
        }
        Self { offsets, entries, columns }
    }

    /// Nodes of K that move node `node`, ascending, with their weights.
    #[must_use]
    pub fn row(&self, node: usize) -> &[(u32, f64)] {
        &self.entries[self.offsets[node] as usize..self.offsets[node + 1] as usize]
    }

    /// Number of nodes of the object.
    #[must_use]
    pub fn rows(&self) -> usize {
        self.offsets.len() - 1
    }

    /// Number of nodes of K.
    #[must_use]
    pub fn columns(&self) -> usize {
        self.columns
    }

    /// Whether each node is moved by the node of K of the same number alone.
    #[must_use]
    pub fn is_identity(&self) -> bool {
        self.rows() == self.columns && self.entries.iter().zip(0..).all(|(entry, node)| *entry == (node, 1.0))
    }

    /// Displacement of node `node` (m), K's being displaced by `displacement`.
    #[must_use]
    pub fn follow(&self, node: usize, displacement: &[DVec3]) -> DVec3 {
        self.row(node).iter().map(|&(column, weight)| weight * displacement[column as usize]).sum()
    }

    /// Sets `loads` on the nodes of K to those of `forces`, one per node of the object (N); missing ones are zero.
    pub fn spread(&self, forces: &[DVec3], loads: &mut [DVec3]) {
        loads.fill(DVec3::ZERO);
        self.add(forces, loads);
    }

    /// Adds `forces`, one for each of the object's nodes, to `loads` on the nodes of K (N).
    pub fn add(&self, forces: &[DVec3], loads: &mut [DVec3]) {
        let forces = forces.iter().take(self.rows()).enumerate();
        for (node, force) in forces.filter(|(_, force)| **force != DVec3::ZERO) {
            self.row(node).iter().for_each(|&(column, weight)| loads[column as usize] += weight * *force);
        }
    }
}

/// A point of the surface with a part of its area.
#[derive(Clone, Copy, Debug)]
pub(super) struct SurfacePoint {
    /// Its triangle.
    pub triangle: usize,
    /// The corner whose own area it is part of.
    pub owner: u32,
    /// Barycentric coordinates in the triangle.
    pub weights: DVec3,
    /// (m)
    pub place: DVec3,
    /// (m^2)
    pub area: f64,
    /// Unit normal of the triangle, outward.
    pub normal: DVec3,
}

/// Points spread over the surface, closer than `spacing` (m). Each corner's own part of a triangle, between the middles
/// of its edges and the circumcentre, is two triangles; these are divided alike, with three points a part, exact for
/// quadratic functions.
pub(super) fn surface_points(nodes: &[DVec3], triangles: &[[u32; 3]], spacing: f64) -> Vec<SurfacePoint> {
    let mut points = Vec::new();
    for (triangle, named) in triangles.iter().enumerate() {
        let places = named.map(|node| nodes[node as usize]);
        let at = |weights: DVec3| (0..3).map(|k| weights[k] * places[k]).sum::<DVec3>();
        let double_area = (places[1] - places[0]).cross(places[2] - places[0]);
        let centre = circumcentre(places);
        for (owner, side) in (0..3).flat_map(|owner| [(owner, 1), (owner, 2)]) {
            let unit = |k: usize| DVec3::from_array([0, 1, 2].map(|j| f64::from(u8::from(j == k % 3))));
            let part = [unit(owner), unit(owner).midpoint(unit(owner + side)), centre];
            if part[1] == part[2] {
                // Beside an obtuse corner.
                continue;
            }
            let longest = (0..3).map(|k| at(part[k]).distance(at(part[(k + 1) % 3]))).fold(0.0, f64::max);
            let divisions = (longest / spacing).ceil().max(1.0);
            let [edge, other] = [1, 2].map(|k| (part[k] - part[0]) / divisions);
            let count = divisions as usize;
            // A third of a part, each of which is a half of the parallelogram of two of its sides.
            let area = (at(part[1]) - places[owner]).cross(at(part[2]) - places[owner]).length()
                / (6.0 * divisions * divisions);
            for (i, j) in (0..count).flat_map(|i| (0..count - i).map(move |j| (i, j))) {
                let low = part[0] + i as f64 * edge + j as f64 * other;
                let upward = [low, low + edge, low + other];
                let downward = [low + edge + other, low + other, low + edge];
                let parts = [Some(upward), (i + j + 1 < count).then_some(downward)];
                for (corners, k) in parts.into_iter().flatten().flat_map(|corners| [0, 1, 2].map(|k| (corners, k))) {
                    let weights = corners.iter().sum::<DVec3>() / 6.0 + 0.5 * corners[k];
                    points.push(SurfacePoint {
                        triangle,
                        owner: named[owner],
                        weights,
                        place: at(weights),
                        area,
                        normal: double_area.normalize_or_zero(),
                    });
                }
            }
        }
    }
    points
}

/// Barycentric coordinates of the circumcentre, or of the point of the triangle that is nearest to it: the middle of the
/// longest side where the angle opposite is obtuse (Meyer et al., 2003).
fn circumcentre(places: [DVec3; 3]) -> DVec3 {
    let side = DVec3::from_array([0, 1, 2].map(|k| places[(k + 1) % 3].distance_squared(places[(k + 2) % 3])));
    let cosine = DVec3::splat(side.element_sum()) - 2.0 * side;
    let weights = side * cosine;
    match (0..3).find(|k| cosine[*k] <= 0.0) {
        Some(k) => DVec3::from_array([0, 1, 2].map(|j| if j == k { 0.0 } else { 0.5 })),
        None => weights / weights.element_sum(),
    }
}
