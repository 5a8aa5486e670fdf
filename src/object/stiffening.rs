//! Strain stiffening: springs that grow stiffer as they are strained, up to a bound, as tissue does.
//!
//! A spring of stiffness k and rest length L that is strained by r stores, beside its linear energy,
//! `k L^2 (kappa - 1) G(r)` with `G' = g(r) = sqrt(r^2 + eps^2) - eps`: its stiffness rises from k at rest towards
//! kappa k, and is k + 0.71 (kappa - 1) k at r = eps. Its force is the linear one times
//! `sigma(r) = 1 + (kappa - 1) g(r)/r`, `g(r)/r = r / (sqrt(r^2 + eps^2) + eps)`. No root or quotient can fail, on the
//! GPU either.
//!
//! *Passive for any time step.* Both curvatures of the spring's energy, along (1 + (kappa - 1) g') k and across sigma
//! k, lie between k and kappa k. So the whole energy W obeys `W(u + d) <= W(u) + grad W(u) . d + 1/2 d^T K1 d`, K1
//! being K with springs kappa times as stiff: a step with K1 on the left and grad W(u) on the right takes at least what
//! W gains. The matrix stays constant and positive definite; what it takes beyond that is numerical damping.

use super::{Mechanics, Stiffness};
use glam::{DMat3, DVec3};

/// The springs of an object that stiffen.
#[derive(Clone, Debug)]
pub struct Stiffening {
    /// K1 (N/m).
    bound: Stiffness,
    /// Force of a spring in K1 at strain one, kappa k L, for each block; zero on the diagonal (N).
    unit_strain_force: Vec<f64>,
    /// kappa (1).
    factor: f64,
    /// eps (1).
    strain: f64,
}

impl Stiffening {
    /// Stiffening of the springs in `mechanics` to `factor` kappa > 1 times their stiffness, at strains beyond `strain`
    /// eps > 0.
    #[must_use]
    pub fn new(mechanics: &Mechanics, factor: f64, strain: f64) -> Self {
        let mut bound = mechanics.stiffness.clone();
        let mut unit_strain_force = vec![0.0; bound.blocks.len()];
        for node in 0..bound.nodes() {
            let row = bound.offsets[node]..bound.offsets[node + 1];
            let mut springs = DMat3::ZERO;
            let mut diagonal = row.start;
            for entry in row {
                let other = bound.columns[entry] as usize;
                if other == node {
                    diagonal = entry;
                    continue;
                }
                springs -= bound.blocks[entry];
                bound.blocks[entry] *= factor;
                unit_strain_force[entry] =
                    stiffness(&bound.blocks[entry]) * mechanics.moved[node].distance(mechanics.moved[other]);
            }
            bound.blocks[diagonal] += (factor - 1.0) * springs;
        }
        Self { bound, unit_strain_force, factor, strain }
    }

    /// K1, the stiffness that no strain exceeds (N/m).
    #[must_use]
    pub fn bound(&self) -> &Stiffness {
        &self.bound
    }

    /// See the field: what the GPU's twin needs of each block (N).
    #[must_use]
    pub fn unit_strain_force(&self) -> &[f64] {
        &self.unit_strain_force
    }

    /// Adds to `force` by how much K1 u exceeds the springs' force grad W(u) (N).
    pub fn relieve(&self, displacement: &[DVec3], force: &mut [DVec3]) {
        for (node, force) in force.iter_mut().enumerate() {
            *force += self.relief_on(node, displacement);
        }
    }

    /// The same for one node (N).
    #[must_use]
    pub fn relief_on(&self, node: usize, displacement: &[DVec3]) -> DVec3 {
        let mut relief = DVec3::ZERO;
        for entry in self.bound.offsets[node]..self.bound.offsets[node + 1] {
            if self.unit_strain_force[entry] > 0.0 {
                let other = displacement[self.bound.columns[entry] as usize];
                let pull = self.bound.blocks[entry] * (other - displacement[node]);
                let strain = pull.length() / self.unit_strain_force[entry];
                let sigma = 1.0 + (self.factor - 1.0) * strain / (strain.hypot(self.strain) + self.strain);
                relief += (1.0 - sigma / self.factor) * pull;
            }
        }
        relief
    }

    /// Elastic energy W of the object that `mechanics` belong to (J).
    #[must_use]
    pub fn energy(&self, mechanics: &Mechanics, displacement: &[DVec3]) -> f64 {
        let mut energy = mechanics.stiffness.energy(displacement);
        for node in 0..displacement.len() {
            for entry in self.bound.offsets[node]..self.bound.offsets[node + 1] {
                let other = self.bound.columns[entry] as usize;
                if other < node && self.unit_strain_force[entry] > 0.0 {
                    let length = mechanics.moved[node].distance(mechanics.moved[other]);
                    let pull = self.bound.blocks[entry] * (displacement[other] - displacement[node]);
                    let (r, eps) = (pull.length() / self.unit_strain_force[entry], self.strain);
                    let integral = 0.5 * (r * r.hypot(eps) + eps * eps * (r / eps).asinh()) - eps * r;
                    energy += self.unit_strain_force[entry] / self.factor * length * (self.factor - 1.0) * integral;
                }
            }
        }
        energy
    }
}

/// Stiffness of the one spring whose block is B = k I or B = k e e^T, either sign: both have B^2 = k B.
fn stiffness(block: &DMat3) -> f64 {
    let trace = |m: &DMat3| m.x_axis.x + m.y_axis.y + m.z_axis.z;
    (trace(&(*block * *block)) / trace(block)).abs()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::object::Object;
    use crate::scene::{GroundNodes, GroundSpec, GroundStiffness, Material, ObjectSpec, Shape, SpringKind, SpringSpec};

    fn sphere(kind: SpringKind) -> Object {
        Object::build(&ObjectSpec {
            shape: Shape::Sphere { centre: DVec3::ZERO, radius: 0.05, rings: 4, segments: 6 },
            material: Material::Springs(SpringSpec { kind, stiffness: 300.0 }),
            skin: None,
            ground: Some(GroundSpec { stiffness: GroundStiffness::PerNode(40.0), nodes: GroundNodes::All }),
            node_mass: 1e-3,
            node_damping: 0.01,
        })
        .unwrap()
    }

    /// Displacements of about `size` (m), the same each time.
    fn field(nodes: usize, size: f64) -> Vec<DVec3> {
        let wave = |k: usize| size * (1.0 + 2.3 * k as f64).sin();
        (0..nodes).map(|i| DVec3::new(wave(3 * i), wave(3 * i + 1), wave(3 * i + 2))).collect()
    }

    fn gradient(stiffening: &Stiffening, u: &[DVec3]) -> Vec<DVec3> {
        let (mut force, mut relief) = (vec![DVec3::ZERO; u.len()], vec![DVec3::ZERO; u.len()]);
        stiffening.bound().apply(u, &mut force);
        stiffening.relieve(u, &mut relief);
        force.iter().zip(&relief).map(|(f, r)| *f - *r).collect()
    }

    #[test]
    fn the_force_is_the_gradient_of_the_energy_and_grows_faster_than_linear() {
        for kind in [SpringKind::Isotropic, SpringKind::Axial] {
            let object = sphere(kind);
            let mechanics = object.mechanics().unwrap();
            let stiffening = Stiffening::new(mechanics, 8.0, 0.1);
            let (u, direction) = (field(object.rest.len(), 5e-3), field(object.rest.len(), 1.0));
            let moved = |h: f64| u.iter().zip(&direction).map(|(u, d)| *u + h * *d).collect::<Vec<_>>();
            let h = 1e-7;
            let slope =
                (stiffening.energy(mechanics, &moved(h)) - stiffening.energy(mechanics, &moved(-h))) / (2.0 * h);
            let along: f64 = gradient(&stiffening, &u).iter().zip(&direction).map(|(f, d)| f.dot(*d)).sum();
            assert!((slope - along).abs() < 1e-6 * along.abs(), "{slope} {along}");
            // Between the linear energy and that of K1.
            let (linear, bound) = (mechanics.stiffness.energy(&u), stiffening.bound().energy(&u));
            let energy = stiffening.energy(mechanics, &u);
            assert!(1.5 * linear < energy && energy < bound, "{linear} {energy} {bound}");
            // Small strains are linear.
            let small = field(object.rest.len(), 1e-9);
            assert!((stiffening.energy(mechanics, &small) / mechanics.stiffness.energy(&small) - 1.0).abs() < 1e-4);
        }
    }

    #[test]
    fn no_step_gains_more_than_the_bound_says() {
        for kind in [SpringKind::Isotropic, SpringKind::Axial] {
            let object = sphere(kind);
            let mechanics = object.mechanics().unwrap();
            let stiffening = Stiffening::new(mechanics, 8.0, 0.02);
            for (from, way) in [(0.0, 1e-2), (1e-3, 1e-4), (1e-2, -2e-2), (3e-2, 0.5)] {
                let u = field(object.rest.len(), from);
                let d: Vec<DVec3> = field(object.rest.len(), way).into_iter().rev().collect();
                let after: Vec<DVec3> = u.iter().zip(&d).map(|(u, d)| *u + *d).collect();
                let first: f64 = gradient(&stiffening, &u).iter().zip(&d).map(|(g, d)| g.dot(*d)).sum();
                let model = stiffening.energy(mechanics, &u) + first + stiffening.bound().energy(&d);
                assert!(stiffening.energy(mechanics, &after) <= model * (1.0 + 1e-12), "{kind:?} {from} {way}");
            }
        }
    }
}
