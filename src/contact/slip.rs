//! How an arm slides on the object: the sum of the normal forces, and the map from joint rates to slip.
//!
//! Contact i pushes with lambda_i along its normal N_i and slides at `P_i J_i qdot`, `P_i = I - N_i N_i^T`. Coulomb
//! friction of coefficient mu takes `mu sum lambda_i |P_i J_i qdot|`, which by Cauchy and Schwarz is at most
//! `mu N |B qdot|` with
//!
//! `N = sum lambda_i`,  `B^2 = S = sum lambda_i J_i^T P_i J_i / N`.
//!
//! |B qdot| is the slip speed, root mean square over the normal force. The bound is exact for one contact, and for
//! several that slip equally fast; the limit torques of friction fill the ellipsoid of `R = (mu N)^2 S`, the limit
//! surface (Goyal, Ruina and Papadopoulos 1991, Planar sliding with dry friction) pulled back to C-space.
//!
//! *Why the symmetric root.* Any B with `B B^T = S` gives the same friction at a configuration. Between configurations
//! the symmetric root is continuous in S, where a Cholesky factor jumps as its pivots pass zero: S has rank two under a
//! single contact. It is what is stored and interpolated, since any interpolated B gives a positive semidefinite
//! `B B^T`, by rounding or otherwise.

use crate::{
    JointMatrix, JointVector,
    joint_matrix::{self, add_symmetric},
    proxy::{Chain, Links},
};
use glam::DVec3;

/// Least normal force that has a direction (N): far below what is felt, and large enough that its normal is known to
/// rounding.
const LEAST_NORMAL_FORCE: f64 = 1e-9;

/// Slip of the contacts of one configuration.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Slip {
    /// N, sum of the normal forces (N).
    pub normal_force: f64,
    /// B, symmetric (m/rad, 1 for a sliding joint; d x d).
    pub jacobian: JointMatrix,
}

impl Slip {
    /// Returns the slip of `forces` on nodes of `chain` (N), whose directions are taken for the normals, with the joints
    /// at `q`. Allocates nothing. Before the surface at rest a force leans by how its row changes along the surface.
    #[must_use]
    pub fn of(chain: &Chain, q: &[f64], forces: impl IntoIterator<Item = (u32, DVec3)>) -> Self {
        let mut slip = Self::default();
        let mut metric = JointMatrix::default();
        let mut links = None;
        for (node, force) in forces {
            let size = force.length();
            if size < LEAST_NORMAL_FORCE {
                continue;
            }
            let links: &Links = links.get_or_insert_with(|| chain.links(q));
            let columns = tangential(chain, links, node as usize, force / size);
            slip.normal_force += size;
            for k in 0..q.len() {
                for l in 0..=k {
                    add_symmetric(&mut metric, k, l, size * columns[k].dot(columns[l]));
                }
            }
        }
        if slip.normal_force > 0.0 {
            metric.as_flattened_mut().iter_mut().for_each(|entry| *entry /= slip.normal_force);
            slip.jacobian = joint_matrix::square_root(&metric, q.len());
        }
        slip
    }

    /// Returns |B qdot| of joint rates `rates`, the slip rate (m/s).
    #[must_use]
    pub fn rate(&self, rates: &[f64]) -> f64 {
        let rows = self.jacobian.iter().take(rates.len());
        rows.map(|row| row.iter().zip(rates).map(|(b, rate)| b * rate).sum::<f64>().powi(2)).sum::<f64>().sqrt()
    }

    /// Returns `deflection + B way`: where a spring that slips along is after the joints went that `way` (m).
    #[must_use]
    pub fn deflected(&self, deflection: &JointVector, way: &JointVector) -> JointVector {
        let mut end = *deflection;
        end.iter_mut().zip(&self.jacobian).for_each(|(z, row)| *z += way.dot(row));
        end
    }

    /// Returns N |B qdot| of joint rates `rates`: what friction of coefficient one takes at most (W).
    #[must_use]
    pub fn dissipation(&self, rates: &[f64]) -> f64 {
        self.normal_force * self.rate(rates)
    }

    /// Adds to `damping` that of a `damper` against slip (N s/m), `damper B B^T`, over the first `joints` joints.
    pub fn add_damper(&self, damper: f64, damping: &mut JointMatrix, joints: usize) {
        for k in 0..joints {
            for l in 0..=k {
                // B is symmetric.
                let square = self.jacobian[k][..joints].iter().zip(&self.jacobian[l]).map(|(x, y)| x * y).sum::<f64>();
                add_symmetric(damping, k, l, damper * square);
            }
        }
    }

    /// Whether all numbers are finite.
    #[must_use]
    pub fn is_finite(&self) -> bool {
        self.normal_force.is_finite() && self.jacobian.as_flattened().iter().all(|entry| entry.is_finite())
    }
}

/// Returns `sum lambda_i |P_i J_i qdot|`, what Coulomb friction of coefficient one takes at joint rates `rates` (W); the
/// other arguments as in [`Slip::of`].
#[must_use]
pub fn exact_dissipation(
    chain: &Chain,
    q: &[f64],
    forces: impl IntoIterator<Item = (u32, DVec3)>,
    rates: &[f64],
) -> f64 {
    let links = chain.links(q);
    let forces = forces.into_iter().filter(|(_, force)| force.length() >= LEAST_NORMAL_FORCE);
    let taken = forces.map(|(node, force)| {
        let columns = tangential(chain, &links, node as usize, force.normalize());
        let slip: DVec3 = columns.iter().zip(rates).map(|(column, rate)| *column * *rate).sum();
        force.length() * slip.length()
    });
    taken.sum()
}

/// P J of a node of `chain`, column by column (m/rad).
fn tangential(chain: &Chain, links: &Links, node: usize, normal: DVec3) -> [DVec3; crate::MAX_JOINTS] {
    let columns = chain.node_jacobian(links, node, chain.node_position(links, node));
    columns.map(|column| column.reject_from_normalized(normal))
}
