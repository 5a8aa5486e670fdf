//! Quadratic finite elements with projected dilatation: shape functions, points of quadrature, stiffness.
//!
//! Displacement is quadratic in each element: 27 nodes on a cube (Q2), ten on a tetrahedron (P2). Plain elements of
//! nearly incompressible material lock. So the volumetric part of the energy sees the projection `P div u` of the
//! dilatation on a few modes phi in each element: 1, x, y, z in a cube (Q2/P-1), the constant in a tetrahedron (P2/P0)
//! (Boffi, Brezzi & Fortin, Mixed Finite Element Methods and Applications, 2013, section 8.6):
//!
//! ```text
//! K = int 2 mu eps : eps + int lambda (P div u)^2 = H^T + tr(H) I + T^T (int lambda phi phi^T) T
//! H_ab = int mu g_a g_b^T,  T = (int phi phi^T)^-1 int phi g^T,  g_a = grad N_a
//! ```
//!
//! The projection lowers |div u| in the mean. So K is positive semidefinite for -1 < nu < 1/2, and free for rigid
//! motions alone. A uniform strain is met exactly.

use glam::{DMat3, DMat4, DVec3, DVec4};

/// Lamé's parameters (Pa).
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Lame {
    pub lambda: f64,
    pub mu: f64,
}

impl Lame {
    /// Those of Young's modulus (Pa) and Poisson's ratio.
    pub fn new(young: f64, poisson: f64) -> Self {
        let lambda = young * poisson / ((1.0 + poisson) * (1.0 - 2.0 * poisson));
        Self { lambda, mu: young / (2.0 * (1.0 + poisson)) }
    }

    /// Bulk modulus, positive for every admissible Poisson's ratio (Pa).
    pub fn bulk(self) -> f64 {
        self.lambda + 2.0 / 3.0 * self.mu
    }
}

/// Points and weights of Gauss and Legendre on [0, 1], exact for polynomials of degree five.
pub(super) const GAUSS: [[f64; 2]; 3] =
    [[0.5 - HALF_SPREAD, 5.0 / 18.0], [0.5, 4.0 / 9.0], [0.5 + HALF_SPREAD, 5.0 / 18.0]];

/// sqrt(3/20).
const HALF_SPREAD: f64 = 0.387_298_334_620_741_7;

/// Nodes of a cube.
pub(super) const CUBE_NODES: usize = 27;

/// Nodes of a tetrahedron: four corners, then the middles of [`TETRAHEDRON_EDGES`].
pub(super) const TETRAHEDRON_NODES: usize = 10;

/// Edges of a tetrahedron in Gmsh's order.
pub(super) const TETRAHEDRON_EDGES: [[usize; 2]; 6] = [[0, 1], [1, 2], [0, 2], [0, 3], [2, 3], [1, 3]];

/// Shape functions of the cube [0, 1]^3 at `at`, and their gradients. Node (i, j, k), at half of these, is number
/// 9 i + 3 j + k.
pub(super) fn cube(at: DVec3) -> ([f64; CUBE_NODES], [DVec3; CUBE_NODES]) {
    let value = |x: f64| [(1.0 - x) * (1.0 - 2.0 * x), 4.0 * x * (1.0 - x), x * (2.0 * x - 1.0)];
    let slope = |x: f64| [4.0 * x - 3.0, 4.0 - 8.0 * x, 4.0 * x - 1.0];
    let ([vx, vy, vz], [sx, sy, sz]) = (at.to_array().map(value), at.to_array().map(slope));
    let (mut values, mut gradients) = ([0.0; CUBE_NODES], [DVec3::ZERO; CUBE_NODES]);
    for a in 0..CUBE_NODES {
        let [i, j, k] = [a / 9, a / 3 % 3, a % 3];
        values[a] = vx[i] * vy[j] * vz[k];
        gradients[a] = DVec3::new(sx[i] * vy[j] * vz[k], vx[i] * sy[j] * vz[k], vx[i] * vy[j] * sz[k]);
    }
    (values, gradients)
}

/// Shape functions of a tetrahedron at the barycentric coordinates `at`, and their derivatives by these.
pub(super) fn tetrahedron(at: [f64; 4]) -> ([f64; TETRAHEDRON_NODES], [DVec4; TETRAHEDRON_NODES]) {
    let (mut values, mut derivatives) = ([0.0; TETRAHEDRON_NODES], [DVec4::ZERO; TETRAHEDRON_NODES]);
    for a in 0..4 {
        values[a] = at[a] * (2.0 * at[a] - 1.0);
        derivatives[a][a] = 4.0 * at[a] - 1.0;
    }
    for (m, [a, b]) in TETRAHEDRON_EDGES.into_iter().enumerate() {
        values[4 + m] = 4.0 * at[a] * at[b];
        derivatives[4 + m][a] = 4.0 * at[b];
        derivatives[4 + m][b] = 4.0 * at[a];
    }
    (values, derivatives)
}

/// Points of an element, with its shape functions there.
#[derive(Clone, Debug, Default)]
pub(super) struct Quadrature {
    /// Positions (m).
    pub places: Vec<DVec3>,
    /// Weights; their sum is the volume (m^3).
    weights: Vec<f64>,
    /// Shape functions, point by point (1).
    values: Vec<f64>,
    /// Their gradients (1/m).
    gradients: Vec<DVec3>,
    /// Modes phi of the dilatation; those that the element lacks are zero (1).
    modes: Vec<DVec4>,
}

impl Quadrature {
    /// Adds a point at `place` (m) of `weight` (m^3) with the `values` and `gradients` (1/m) of all shape functions.
    pub fn push(&mut self, place: DVec3, weight: f64, values: &[f64], gradients: &[DVec3], modes: DVec4) {
        self.places.push(place);
        self.weights.push(weight);
        self.values.extend_from_slice(values);
        self.gradients.extend_from_slice(gradients);
        self.modes.push(modes);
    }

    /// Place (m) and weight (m^3) of each point.
    pub fn points(&self) -> impl Iterator<Item = (DVec3, f64)> {
        self.places.iter().copied().zip(self.weights.iter().copied())
    }

    /// Leaves out the points at places that `is_kept` refuses (m): of no weight.
    pub fn keep(&mut self, is_kept: impl Fn(DVec3) -> bool) {
        let points = self.weights.iter_mut().zip(&self.places);
        points.filter(|(_, place)| !is_kept(**place)).for_each(|(weight, _)| *weight = 0.0);
    }

    /// Number of nodes n of the element.
    fn nodes(&self) -> usize {
        self.values.len() / self.weights.len().max(1)
    }

    /// Returns K, row-major (N/m) (n^2). `lame`: of each point.
    pub fn stiffness(&self, lame: &[Lame]) -> Vec<DMat3> {
        let n = self.nodes();
        let mut shear = vec![DMat3::ZERO; n * n];
        let mut dilatation = vec![[DVec4::ZERO; 3]; n];
        let (mut gram, mut weighted) = (DMat4::ZERO, DMat4::ZERO);
        let points = self.weights.iter().zip(lame).zip(&self.modes).zip(self.gradients.chunks_exact(n));
        for (((&weight, &Lame { lambda, mu }), &phi), gradients) in points {
            let square = weight * DMat4::from_cols(phi * phi.x, phi * phi.y, phi * phi.z, phi * phi.w);
            gram += square;
            weighted += lambda * square;
            for (a, &ga) in gradients.iter().enumerate() {
                dilatation[a].iter_mut().zip(ga.to_array()).for_each(|(sum, g)| *sum += weight * g * phi);
                let scaled = weight * mu * ga;
                for (sum, &gb) in shear[a * n + a..][..n - a].iter_mut().zip(&gradients[a..]) {
                    *sum += DMat3::from_cols(scaled * gb.x, scaled * gb.y, scaled * gb.z);
                }
            }
        }
        // Modes that are not there.
        let absent = DVec4::from_array([0, 1, 2, 3].map(|k| f64::from(u8::from(gram.col(k)[k] == 0.0))));
        gram += DMat4::from_diagonal(absent);
        let inverse = gram.inverse();
        let projected: Vec<[DVec4; 3]> = dilatation.iter().map(|g| g.map(|g| inverse * g)).collect();
        let mut blocks = vec![DMat3::ZERO; n * n];
        for a in 0..n {
            let pressure = projected[a].map(|t| weighted * t);
            for b in a..n {
                let h = shear[a * n + b];
                let trace = h.x_axis.x + h.y_axis.y + h.z_axis.z;
                let volumetric = DMat3::from_cols_array_2d(&projected[b].map(|t| pressure.map(|p| p.dot(t))));
                let block = h.transpose() + DMat3::from_diagonal(DVec3::splat(trace)) + volumetric;
                blocks[a * n + b] = block;
                blocks[b * n + a] = block.transpose();
            }
        }
        blocks
    }

    /// Returns int N_a N_b, row-major (m^3) (n^2).
    pub fn products(&self) -> Vec<f64> {
        let n = self.nodes();
        let mut products = vec![0.0; n * n];
        for (weight, values) in self.weights.iter().zip(self.values.chunks_exact(n.max(1))) {
            for (row, a) in products.chunks_exact_mut(n).zip(values) {
                row.iter_mut().zip(values).for_each(|(sum, b)| *sum += weight * a * b);
            }
        }
        products
    }
}
