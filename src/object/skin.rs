//! The skin of a surface: membrane tension, bending stiffness and a foundation, all per area.
//!
//! `K = (T L + b L M^-1 L + k M) (x) I3`, with L the cotangent Laplacian of the surface at rest (the stiffness matrix
//! of linear elements for the Laplace operator; Pinkall & Polthier 1993) and M its areas, a third of each triangle at
//! each corner. L is positive semidefinite on every mesh, obtuse triangles included, M is positive, and so each term is
//! positive semidefinite. The first two cost nothing in a translation.
//!
//! T, b and k belong to the body, not to the mesh: a finer mesh is the same body. Under a point force the displacement
//! stays finite only because of b. Without it the dent is a cusp that deepens as the mesh is refined.

use super::{Stiffness, attachment::Attachment, topology::mean_edge};
use crate::scene::SkinSpec;
use glam::DVec3;
use serde::Serialize;
use std::fmt;

/// A skin beside the mesh that carries it.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Skin {
    /// Membrane tension T (N/m).
    pub tension: f64,
    /// Bending stiffness b (N m).
    pub bending: f64,
    /// Foundation k (N/m^3).
    pub foundation: f64,
    /// Length sqrt(b / T) over which the dent of a point is rounded; none without tension or without bending (m).
    pub rounding: Option<f64>,
    /// Length over which the foundation takes up a dent: (b / k)^(1/4), or sqrt(T / k) where that is longer; none
    /// without a foundation (m).
    pub spreading: Option<f64>,
    /// Mean length of the mesh's edges at rest (m).
    pub mean_edge: f64,
}

impl Skin {
    /// The skin `spec` on a surface. `nodes`: at rest (m).
    #[must_use]
    pub fn new(spec: SkinSpec, nodes: &[DVec3], triangles: &[[u32; 3]]) -> Self {
        let SkinSpec { tension, bending, foundation } = spec;
        Self {
            tension,
            bending,
            foundation,
            rounding: (bending > 0.0 && tension > 0.0).then(|| (bending / tension).sqrt()),
            spreading: (foundation > 0.0).then(|| (bending / foundation).powf(0.25).max((tension / foundation).sqrt())),
            mean_edge: mean_edge(nodes, triangles),
        }
    }
}

impl fmt::Display for Skin {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { tension, bending, foundation, rounding, spreading, mean_edge } = self;
        write!(f, "bending {bending:.3e} N m, tension {tension:.3e} N/m, foundation {foundation:.3e} N/m^3; ")?;
        if let Some(length) = rounding {
            write!(f, "dents are rounded over {:.1} mm, ", length * 1e3)?;
        }
        if let Some(length) = spreading {
            write!(f, "spread over {:.1} mm, ", length * 1e3)?;
        }
        write!(f, "mean edge {:.1} mm", mean_edge * 1e3)
    }
}

/// The cotangent Laplacian L of a surface and its lumped areas M.
pub(super) struct Laplacian {
    /// Nonzero entries of each row of L as (column, value), ascending (1).
    rows: Vec<Vec<(u32, f64)>>,
    /// Diagonal of M (m^2).
    areas: Vec<f64>,
}

impl Laplacian {
    /// Forms L and M. `nodes`: at rest (m); `triangles`: with area.
    pub fn new(nodes: &[DVec3], triangles: &[[u32; 3]]) -> Self {
        let mut rows: Vec<Vec<(u32, f64)>> = vec![Vec::new(); nodes.len()];
        let mut areas = vec![0.0; nodes.len()];
        for corners in triangles {
            for k in 0..3 {
                let [own, a, b] = [0, 1, 2].map(|m| corners[(k + m) % 3]);
                let [origin, to_a, to_b] = [own, a, b].map(|node| nodes[node as usize]);
                let (to_a, to_b) = (to_a - origin, to_b - origin);
                let double_area = to_a.cross(to_b).length();
                let half_cotangent = 0.5 * to_a.dot(to_b) / double_area;
                rows[a as usize].extend([(a, half_cotangent), (b, -half_cotangent)]);
                rows[b as usize].extend([(b, half_cotangent), (a, -half_cotangent)]);
                areas[own as usize] += double_area / 6.0;
            }
        }
        for row in &mut rows {
            row.sort_by_key(|(column, _)| *column);
            row.dedup_by(|next, kept| {
                let same = next.0 == kept.0;
                kept.1 += if same { next.1 } else { 0.0 };
                same
            });
        }
        Self { rows, areas }
    }

    /// Returns the groups of nodes of K that `skin` makes act on each other: those that move a node and one of its
    /// neighbours; where it resists bending, a node and all its neighbours.
    pub fn cliques(&self, skin: SkinSpec, attachment: &Attachment) -> Vec<Vec<u32>> {
        let clique = |nodes: &mut dyn Iterator<Item = u32>| {
            let moved = nodes.flat_map(|node| attachment.row(node as usize)).map(|&(column, _)| column);
            let mut clique: Vec<u32> = moved.collect();
            clique.sort_unstable();
            clique.dedup();
            clique
        };
        let around = |(node, row): (u32, &Vec<(u32, f64)>)| match skin.bending > 0.0 {
            true => vec![clique(&mut row.iter().map(|(other, _)| *other))],
            false => row.iter().map(|(other, _)| clique(&mut [node, *other].into_iter())).collect(),
        };
        (0..).zip(&self.rows).flat_map(around).collect()
    }

    /// Adds `N^T (T L + b L M^-1 L + k M) N` to `stiffness`, whose pattern holds [`Laplacian::cliques`].
    pub fn add(&self, skin: SkinSpec, attachment: &Attachment, stiffness: &mut Stiffness) {
        let SkinSpec { tension, bending, foundation } = skin;
        let mut sums = vec![0.0; attachment.columns()];
        for (node, (row, area)) in self.rows.iter().zip(&self.areas).enumerate() {
            // A row of L N.
            let mut curvature: Vec<(u32, f64)> = Vec::new();
            for &(other, value) in row {
                for &(column, weight) in attachment.row(other as usize) {
                    curvature.push((column, 0.0));
                    sums[column as usize] += value * weight;
                }
            }
            curvature.sort_unstable_by_key(|(column, _)| *column);
            curvature.dedup_by_key(|(column, _)| *column);
            curvature.iter_mut().for_each(|(column, sum)| *sum = std::mem::take(&mut sums[*column as usize]));
            let own = attachment.row(node);
            stiffness.add_products(own, own, foundation * area);
            stiffness.add_products(own, &curvature, tension);
            if bending > 0.0 {
                stiffness.add_products(&curvature, &curvature, bending / area);
            }
        }
    }
}
