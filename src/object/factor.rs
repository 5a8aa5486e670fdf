//! Sparse Cholesky factor of alpha K + diag(d), and the proof that K is positive definite.
//!
//! The sum covers what the engine solves: K itself for the compliance, and the matrix 2M/T + B + (T/2) K of the passive
//! integrator of the nodes. Where springs and ground are isotropic K = A (x) I: the three coordinates are alike and
//! independent, and the N x N matrix alpha A + diag(d) is factorised in the place of the 3N x 3N one, for three
//! right-hand sides at a time: a ninth of the memory and a third of the work of a solve.
//!
//! That the factorisation exists shows the matrix positive definite up to rounding; a few steps of inverse iteration
//! then bound its smallest eigenvalue, so that a mechanism which rounding has made barely positive is found as well,
//! and named by the node that it moves most.

use super::{
    Stiffness,
    condensation::condense,
    elimination::factorize,
    outlook,
    substitution::{Partition, substitute},
    supernodes::Supernodes,
    topology::point,
};
use crate::{Error, ErrorKind, error, memory};
use faer::Side;
use faer::perm::PermRef;
use faer::sparse::SymbolicSparseColMat;
use faer::sparse::linalg::SupernodalThreshold;
use faer::sparse::linalg::cholesky::{
    CholeskySymbolicParams, SymbolicCholeskyRaw, SymmetricOrdering, factorize_symbolic_cholesky,
};
use glam::DVec3;
use std::sync::Arc;

/// Smallest accepted reciprocal condition number of K with its diagonal scaled to one (1): what is soft for its place
/// alone, such as a cube that the surface hardly enters, costs no digits (van der Sluis 1969). K (C f) equals f to
/// about machine precision over this number, and the equilibria that are stored promise 1e-6.
const MIN_RECIPROCAL_CONDITION: f64 = f64::EPSILON / 1e-6;

/// Shift, relative to the diagonal of K, under which the free motion of a singular K is sought (1): the square root of
/// machine precision is far above the rounding of a factorisation and far below the stiffness of any spring that
/// counts.
const MECHANISM_SHIFT: f64 = 1.5e-8;

/// Cholesky factor of a symmetric positive definite matrix over the 3N node coordinates.
#[derive(Clone, Debug)]
pub struct Factor {
    /// Rows of the factorised matrix per node: 3, or 1 where it stands for each of the three coordinates.
    rows_per_node: usize,
    /// Row of the matrix that each row of L stands for.
    order: Arc<[usize]>,
    supernodes: Arc<Supernodes>,
    values: Arc<Vec<f64>>,
    partition: Arc<Partition>,
}

impl Factor {
    /// Factorises `alpha` K + diag(`diagonal`); `diagonal` has one number per node, for its three coordinates.
    ///
    /// # Errors
    /// When the matrix is not positive definite, or there is no memory for its factor.
    pub fn of(stiffness: &Stiffness, alpha: f64, diagonal: &[f64]) -> Result<Self, Error> {
        let resources =
            |reason: &dyn std::fmt::Display| error!("the matrix of the object cannot be factorised: {reason}");
        let rows_per_node = if stiffness.is_isotropic() { 1 } else { 3 };
        let forward: Vec<usize> = stiffness.ordering.iter().map(|node| *node as usize).collect();
        let mut ranks = vec![0; forward.len()];
        forward.iter().enumerate().for_each(|(rank, &node)| ranks[node] = rank);
        let ordering = SymmetricOrdering::Custom(PermRef::new_checked(&forward, &ranks, forward.len()));
        let params = CholeskySymbolicParams {
            supernodal_flop_ratio_threshold: SupernodalThreshold::FORCE_SUPERNODAL,
            ..Default::default()
        };
        let symbolic = factorize_symbolic_cholesky(lower_half(stiffness).as_ref(), Side::Lower, ordering, params)
            .map_err(|error| resources(&error))?;
        let (SymbolicCholeskyRaw::Supernodal(supernodal), Some(order)) = (symbolic.raw(), symbolic.perm()) else {
            return Err(resources(&"no supernodes"));
        };
        let supernodes = Supernodes::new(supernodal, rows_per_node);
        let bytes = supernodes.entries() * size_of::<f64>();
        if bytes > memory::SMALL {
            memory::check(bytes).map_err(|shortage| resources(&shortage))?;
        }
        let mut values = Vec::new();
        values.try_reserve_exact(supernodes.entries()).map_err(|error| resources(&error))?;
        values.resize(supernodes.entries(), 0.0);
        let (forward, backward) = order.arrays();
        scatter(stiffness, alpha, diagonal, (backward, rows_per_node), &supernodes, &mut values);
        let operations = (0..supernodes.count())
            .map(|s| outlook::factorisation(supernodes.columns(s).len(), supernodes.pattern(s).len()));
        let rows = rows_per_node * forward.len();
        let what = format_args!("factorising the object's matrix of {rows} rows");
        outlook::announce(what, operations.sum(), rayon::current_num_threads());
        if !factorize(&supernodes, &mut values) {
            return Err(error!("the matrix of the object is not positive definite").of(ErrorKind::Indefinite));
        }
        let rows = |&node: &usize| rows_per_node * node..rows_per_node * (node + 1);
        Ok(Self {
            rows_per_node,
            order: forward.iter().flat_map(rows).collect(),
            partition: Arc::new(Partition::new(&supernodes)),
            supernodes: Arc::new(supernodes),
            values: Arc::new(values),
        })
    }

    /// Solves for one vector per node in place: forces (N) become displacements (m) if the matrix is K.
    pub fn solve(&self, vectors: &mut [DVec3]) {
        let (supernodes, values) = (&*self.supernodes, &**self.values);
        if self.rows_per_node == 1 {
            let mut right: Vec<DVec3> = self.order.iter().map(|&node| vectors[node]).collect();
            substitute(supernodes, values, &self.partition, &mut right);
            self.order.iter().zip(right).for_each(|(&node, solved)| vectors[node] = solved);
        } else {
            let mut right: Vec<f64> = self.order.iter().map(|&row| vectors[row / 3][row % 3]).collect();
            substitute(supernodes, values, &self.partition, &mut right);
            self.order.iter().zip(right).for_each(|(&row, solved)| vectors[row / 3][row % 3] = solved);
        }
    }

    /// Returns R^T A^-1 R, row-major, A being the factorised matrix. `columns`: the entries of each column of R, as row
    /// of A and value.
    pub(super) fn condensed(&self, columns: &[Vec<(usize, f64)>]) -> Vec<f64> {
        let mut ranks = vec![0; self.order.len()];
        self.order.iter().enumerate().for_each(|(rank, &row)| ranks[row] = rank);
        let ranked = |column: &Vec<(usize, f64)>| column.iter().map(|&(row, value)| (ranks[row], value)).collect();
        let columns: Vec<Vec<(usize, f64)>> = columns.iter().map(ranked).collect();
        condense(&self.supernodes, &self.values, &columns)
    }

    /// Rows of the factorised matrix per node: 3, or 1 where it stands for each of the three coordinates.
    pub(super) fn rows_per_node(&self) -> usize {
        self.rows_per_node
    }

    /// Whether [`Factor::solve`] shares its work out among rayon's threads.
    #[must_use]
    pub fn is_shared(&self) -> bool {
        self.partition.is_shared()
    }

    /// Memory of the factor (B).
    #[must_use]
    pub fn bytes(&self) -> usize {
        size_of_val(&**self.values)
    }
}

/// Compressed columns of the pattern's lower half, a row a node. K is symmetric, so column c is row c from the diagonal
/// on.
fn lower_half(stiffness: &Stiffness) -> SymbolicSparseColMat<usize> {
    let (mut starts, mut rows) = (vec![0], Vec::new());
    for node in 0..stiffness.nodes() {
        rows.extend(stiffness.row(node).map(|(other, _)| other).filter(|other| *other >= node));
        starts.push(rows.len());
    }
    SymbolicSparseColMat::new_checked(stiffness.nodes(), stiffness.nodes(), starts, None, rows)
}

/// Sets `values` to the lower half of `alpha` K + diag(`diagonal`), node after node in the order of `ranks`.
fn scatter(
    stiffness: &Stiffness,
    alpha: f64,
    diagonal: &[f64],
    (ranks, rows_per_node): (&[usize], usize),
    supernodes: &Supernodes,
    values: &mut [f64],
) {
    for (node, added) in diagonal.iter().enumerate() {
        let first = rows_per_node * ranks[node];
        let s = supernodes.with(first);
        let height = supernodes.columns(s).len() + supernodes.pattern(s).len();
        let own = &mut values[supernodes.range(s)][height * (first - supernodes.columns(s).start)..];
        for (other, block) in stiffness.row(node).filter(|(other, _)| ranks[*other] >= ranks[node]) {
            let place = supernodes.place(s, rows_per_node * ranks[other]);
            for (b, column) in own.chunks_exact_mut(height).take(rows_per_node).enumerate() {
                for (a, value) in column[place..][..rows_per_node].iter_mut().enumerate() {
                    let extra = if other == node && a == b { *added } else { 0.0 };
                    *value = alpha * block.row(b)[a] + extra;
                }
            }
        }
    }
}

/// The factor of K, or the reason why K is not positive definite to working precision.
pub(super) fn prove_positive_definite(stiffness: &Stiffness, nodes: &[DVec3]) -> Result<Factor, Error> {
    let mut diagonal = stiffness.diagonal();
    let largest = diagonal.iter().copied().fold(0.0, f64::max);
    // A node without any spring.
    diagonal.iter_mut().for_each(|own| *own = own.max(f64::EPSILON * largest));
    let roots: Vec<f64> = diagonal.iter().map(|own| own.sqrt()).collect();
    let norm = stiffness.scaled_norm(&roots.iter().map(|root| root.recip()).collect::<Vec<_>>());
    match Factor::of(stiffness, 1.0, &vec![0.0; diagonal.len()]) {
        Ok(factor) => {
            let (smallest, softest) = softest_mode(&factor, &roots);
            if smallest < MIN_RECIPROCAL_CONDITION * norm {
                return Err(mechanism(nodes, &softest, smallest / norm));
            }
            Ok(factor)
        }
        Err(error) if error.kind() == ErrorKind::Indefinite => {
            let shifts: Vec<f64> = diagonal.iter().map(|own| MECHANISM_SHIFT * own).collect();
            let shifted = Factor::of(stiffness, 1.0, &shifts)?;
            let (smallest, softest) = softest_mode(&shifted, &roots);
            Err(mechanism(nodes, &softest, (smallest - MECHANISM_SHIFT).max(0.0) / norm))
        }
        Err(error) => Err(error),
    }
}

/// Steps of inverse iteration. Each multiplies what is not in the softest mode by the ratio of eigenvalues; a
/// mechanism's is below 1e-8, so that three are plenty.
const INVERSE_ITERATIONS: usize = 3;

/// An upper bound on the smallest eigenvalue of D^-1/2 K D^-1/2, close to it where one is far below the rest, and the
/// displacements of its mode. `roots`: D^1/2, one number a node.
fn softest_mode(factor: &Factor, roots: &[f64]) -> (f64, Vec<DVec3>) {
    // A start without symmetry, so that it is not orthogonal to a symmetric mode.
    let wave = |k: usize| (1.0 + 0.7 * k as f64 + 0.01 * (k * k % 97) as f64).sin();
    let mut mode: Vec<DVec3> =
        (0..roots.len()).map(|i| DVec3::new(wave(3 * i), wave(3 * i + 1), wave(3 * i + 2))).collect();
    let mut eigenvalue = f64::INFINITY;
    for _ in 0..INVERSE_ITERATIONS {
        let before = norm(&mode);
        mode.iter_mut().zip(roots).for_each(|(v, root)| *v *= *root);
        factor.solve(&mut mode);
        mode.iter_mut().zip(roots).for_each(|(v, root)| *v *= *root);
        let after = norm(&mode);
        if !(after > 0.0 && after.is_finite()) {
            return (0.0, mode);
        }
        eigenvalue = before / after;
        mode.iter_mut().for_each(|v| *v /= after);
    }
    mode.iter_mut().zip(roots).for_each(|(v, root)| *v /= *root);
    (eigenvalue, mode)
}

fn norm(vectors: &[DVec3]) -> f64 {
    vectors.iter().map(|v| v.length_squared()).sum::<f64>().sqrt()
}

/// The error that names the node which moves most in `mode`.
fn mechanism(nodes: &[DVec3], mode: &[DVec3], reciprocal_condition: f64) -> Error {
    let largest = mode.iter().enumerate().max_by(|a, b| a.1.length_squared().total_cmp(&b.1.length_squared()));
    let (node, motion) = largest.map_or((0, DVec3::ZERO), |(node, motion)| (node, *motion));
    let place = point(nodes[node]);
    let [x, y, z] = motion.normalize_or_zero().to_array();
    error!(
        "the stiffness is not positive definite (reciprocal condition {reciprocal_condition:.0e}): what is at {place} can \
         move along ({x:.2}, {y:.2}, {z:.2}) almost without force; so does a part of a solid that the ground does not \
         reach, axial springs leave such mechanisms, and a skin on sliver triangles comes near them: ground more of the \
         object, stiffen the ground, use isotropic springs, or mesh evenly"
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DMat3;

    #[test]
    fn isotropic_springs_need_a_ninth_of_the_factor_and_give_the_same_displacements() {
        let alike = cube(10);
        let nodes = alike.nodes();
        // Off by so little that nothing but the way in which it is factorised changes.
        let mut unlike = alike.clone();
        unlike.add(3, 3, DMat3::from_diagonal(DVec3::X * 1e-9));
        assert!(alike.is_isotropic() && !unlike.is_isotropic());
        let diagonal: Vec<f64> = (0..nodes).map(|node| 1.0 + 0.1 * (node % 60) as f64).collect();
        let [small, large] = [&alike, &unlike].map(|matrix| Factor::of(matrix, 0.5, &diagonal).unwrap());
        // Up to the zeros that supernodes are padded with.
        assert!(7 * small.bytes() <= large.bytes(), "{} B of {} B", small.bytes(), large.bytes());

        let forces: Vec<DVec3> = (0..nodes).map(|i| DVec3::new(i as f64, -2.0, (i % 5) as f64)).collect();
        let [few, many] = [&small, &large].map(|factor| {
            let mut vectors = forces.clone();
            factor.solve(&mut vectors);
            vectors
        });
        assert!(few.iter().zip(&many).all(|(a, b)| (*a - *b).length() < 1e-11 * b.length()), "{few:?}");
    }

    /// A cube of n x n x n nodes, isotropic springs between neighbours.
    fn cube(n: u32) -> Stiffness {
        let number = |x: u32, y: u32, z: u32| (n * x + y) * n + z;
        let (mut edges, mut positions) = (Vec::new(), Vec::new());
        for (x, y, z) in (0..n.pow(3)).map(|k| (k / (n * n), k / n % n, k % n)) {
            positions.push(DVec3::new(f64::from(x), f64::from(y), f64::from(z)));
            let far = [(x + 1, y, z), (x, y + 1, z), (x, y, z + 1)];
            let inside = far.into_iter().filter(|&(x, y, z)| x.max(y).max(z) < n);
            edges.extend(inside.map(|(a, b, c)| [number(x, y, z), number(a, b, c)]));
        }
        let mut stiffness = Stiffness::with_pattern(positions.len(), &edges);
        stiffness.ordering = super::super::ordering::nested_dissection(&stiffness, &positions);
        for &[a, b] in &edges {
            let (a, b, block) = (a as usize, b as usize, DMat3::from_diagonal(DVec3::splat(f64::from(100 + a % 7))));
            for (row, column, sign) in [(a, a, 1.0), (b, b, 1.0), (a, b, -1.0), (b, a, -1.0)] {
                stiffness.add(row, column, sign * block);
            }
        }
        stiffness
    }

    #[test]
    fn solutions_are_exact_and_the_same_on_any_number_of_threads() {
        let isotropic = cube(20);
        let mut general = cube(10);
        let skewed = DVec3::new(0.6, -0.8, 0.3);
        general.add(200, 200, 50.0 * DMat3::from_cols(skewed * 0.6, skewed * -0.8, skewed * 0.3));
        for (stiffness, shared) in [(&isotropic, true), (&general, false)] {
            let nodes = stiffness.nodes();
            let factor = Factor::of(stiffness, 1.0, &vec![3.0; nodes]).unwrap();
            assert_eq!(factor.is_shared(), shared, "{} B", factor.bytes());
            let forces: Vec<DVec3> = (0..nodes).map(|i| DVec3::new((i % 9) as f64, -2.0, (i % 5) as f64)).collect();
            let mut one = forces.clone();
            factor.solve(&mut one);
            for threads in [1, 3] {
                let threads = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
                let mut again = forces.clone();
                threads.install(|| Factor::of(stiffness, 1.0, &vec![3.0; nodes]).unwrap().solve(&mut again));
                assert!(again == one, "threads leave a trace");
            }
            let mut resisted = vec![DVec3::ZERO; nodes];
            stiffness.apply(&one, &mut resisted);
            let left = resisted.iter().zip(&one).zip(&forces).map(|((r, u), f)| (*r + 3.0 * *u - *f).length());
            assert!(left.fold(0.0, f64::max) < 1e-11);
        }
    }
}
