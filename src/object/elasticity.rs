//! Linear elasticity of tetrahedra: the stiffness Kn of a solid.
//!
//! Displacement is linear in each tetrahedron, u(x) = sum_a N_a(x) u_a, so strain is constant there, and with Lamé's
//! lambda = E nu / ((1 + nu)(1 - 2 nu)) and mu = E / (2 (1 + nu)) the block of nodes a and b is
//!
//! ```text
//! K_ab = V ( lambda g_a g_b^T + mu g_b g_a^T + mu (g_a . g_b) I ),     g_a = grad N_a
//! ```
//!
//! (Hughes, The Finite Element Method, 1987, section 2.8). A uniform strain is met exactly, whatever the mesh. Bending
//! is not: such elements are too stiff in it by a share that falls with the square of their size, and more so near nu =
//! 1/2.

use super::{
    ObjectError, Stiffness, inclusion,
    solid::{Solid, volume},
};
use crate::scene::ElasticSpec;
use glam::{DMat3, DVec3};

/// Smallest volume of a tetrahedron over the cube of its longest edge (1): for the same reason.
const MIN_TETRAHEDRON_ASPECT: f64 = 1e-6;

impl Solid {
    /// Adds Kn to `stiffness`, whose pattern holds [`Solid::edges`].
    pub fn add(&self, elastic: &ElasticSpec, nodes: &[DVec3], stiffness: &mut Stiffness) -> Result<(), ObjectError> {
        let means = inclusion::mean(self, elastic, nodes)?;
        for (number, ((corners, filled), [lambda, mu])) in
            self.tetrahedra.iter().zip(&self.filled).zip(means).enumerate()
        {
            let places = corners.map(|corner| nodes[corner as usize]);
            let volume = volume(places);
            let longest = (0..4).flat_map(|a| (0..a).map(move |b| (a, b)));
            let longest = longest.map(|(a, b)| places[a].distance(places[b])).fold(0.0, f64::max);
            // Not `<=`, so that what is not a number is refused as well.
            let proper = volume > MIN_TETRAHEDRON_ASPECT * longest.powi(3);
            if !proper {
                return Err(ObjectError::FlatTetrahedron { number, corners: *corners });
            }
            let gradients = gradients(places, volume);
            let weight = filled * volume;
            for (a, ga) in gradients.into_iter().enumerate() {
                for (b, gb) in gradients.into_iter().enumerate() {
                    let block = lambda * outer(ga, gb)
                        + mu * outer(gb, ga)
                        + DMat3::from_diagonal(DVec3::splat(mu * ga.dot(gb)));
                    stiffness.add(corners[a] as usize, corners[b] as usize, weight * block);
                }
            }
        }
        let tie = elastic.young * self.tie_length;
        for (node, corners, weights) in &self.ties {
            let all = corners.iter().zip(weights).map(|(&corner, weight)| (corner as usize, -weight));
            let all: Vec<(usize, f64)> = all.chain([(*node as usize, 1.0)]).collect();
            for &(a, wa) in &all {
                for &(b, wb) in &all {
                    stiffness.add(a, b, DMat3::from_diagonal(DVec3::splat(tie * wa * wb)));
                }
            }
        }
        Ok(())
    }
}

/// Gradients of the four shape functions (1/m).
fn gradients([a, b, c, d]: [DVec3; 4], volume: f64) -> [DVec3; 4] {
    let six = 6.0 * volume;
    let gb = (c - a).cross(d - a) / six;
    let gc = (d - a).cross(b - a) / six;
    let gd = (b - a).cross(c - a) / six;
    [-(gb + gc + gd), gb, gc, gd]
}

/// a b^T.
fn outer(a: DVec3, b: DVec3) -> DMat3 {
    DMat3::from_cols(a * b.x, a * b.y, a * b.z)
}
