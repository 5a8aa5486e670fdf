//! Sparse Cholesky factor of alpha K + diag(d), and the proof that K is positive definite.
//!
//! The sum covers what the engine solves: K itself for the compliance, and the matrix 2M/T + B + (T/2) K of the passive
//! integrator of the nodes. That the factorisation exists shows the matrix positive definite up to rounding; a few steps
//! of inverse iteration then bound its smallest eigenvalue, so that a mechanism which rounding has made barely positive is
//! found as well, and named by the node that it moves most.

use super::{ObjectError, Stiffness};
use crate::tolerances::{MECHANISM_SHIFT, MIN_RECIPROCAL_CONDITION};
use faer::dyn_stack::{MemBuffer, MemStack};
use faer::linalg::solvers::LltError;
use faer::perm::PermRef;
use faer::sparse::linalg::cholesky::{LltRef, SymbolicCholesky, SymmetricOrdering, factorize_symbolic_cholesky};
use faer::sparse::{SparseColMat, SymbolicSparseColMat};
use faer::{Conj, Mat, MatMut, Par, Side};
use glam::DVec3;
use std::sync::Arc;

/// A factorisation failed.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum FactorError {
    /// A pivot is not positive.
    #[error("the matrix of the object is not positive definite")]
    NotPositiveDefinite,
    /// There is no memory for the factor, or it has too many entries to count.
    #[error("the matrix of the object cannot be factorised: {0}")]
    Resources(String),
}

/// Cholesky factor of a symmetric positive definite matrix over the 3N node coordinates.
#[derive(Clone, Debug)]
pub struct Factor {
    symbolic: Arc<SymbolicCholesky<usize>>,
    values: Arc<[f64]>,
}

/// One thread a factorisation or solve: many solves run side by side instead, which scales better.
const PARALLELISM: Par = Par::Seq;

impl Factor {
    /// Factorises `alpha` K + diag(`diagonal`); `diagonal` has one number per node, for its three coordinates.
    ///
    /// # Errors
    /// When the matrix is not positive definite, or there is no memory for its factor.
    pub fn of(stiffness: &Stiffness, alpha: f64, diagonal: &[f64]) -> Result<Self, FactorError> {
        let resources = |reason: &dyn std::fmt::Display| FactorError::Resources(reason.to_string());
        let matrix = lower_half(stiffness, alpha, diagonal);
        let order: Vec<usize> =
            stiffness.ordering.iter().flat_map(|&n| (0..3).map(move |a| 3 * n as usize + a)).collect();
        let mut rank = vec![0; order.len()];
        order.iter().enumerate().for_each(|(k, &row)| rank[row] = k);
        let ordering = SymmetricOrdering::Custom(PermRef::new_checked(&order, &rank, order.len()));
        let symbolic = factorize_symbolic_cholesky(matrix.symbolic(), Side::Lower, ordering, Default::default())
            .map_err(|error| resources(&error))?;
        let mut values = Vec::new();
        values.try_reserve_exact(symbolic.len_val()).map_err(|error| resources(&error))?;
        values.resize(symbolic.len_val(), 0.0);
        let scratch = symbolic.factorize_numeric_llt_scratch::<f64>(PARALLELISM, Default::default());
        let mut scratch = MemBuffer::try_new(scratch).map_err(|_| resources(&"out of memory"))?;
        let outcome = symbolic.factorize_numeric_llt(
            &mut values,
            matrix.as_ref(),
            Side::Lower,
            Default::default(),
            PARALLELISM,
            MemStack::new(&mut scratch),
            Default::default(),
        );
        match outcome.map(|_| ()) {
            Ok(()) => Ok(Self { symbolic: Arc::new(symbolic), values: values.into() }),
            Err(LltError::NonPositivePivot { .. }) => Err(FactorError::NotPositiveDefinite),
        }
    }

    /// Solves for one vector per node in place: forces [N] become displacements [m] if the matrix is K.
    pub fn solve(&self, vectors: &mut [DVec3]) {
        let mut column = Mat::from_fn(3 * vectors.len(), 1, |row, _| vectors[row / 3][row % 3]);
        self.solve_columns(column.as_mut());
        for (node, vector) in vectors.iter_mut().enumerate() {
            *vector = DVec3::new(column[(3 * node, 0)], column[(3 * node + 1, 0)], column[(3 * node + 2, 0)]);
        }
    }

    /// Solves for each column of a 3N x k matrix in place.
    pub(super) fn solve_columns(&self, columns: MatMut<'_, f64>) {
        let mut scratch = MemBuffer::new(self.symbolic.solve_in_place_scratch::<f64>(columns.ncols(), PARALLELISM));
        let factor = LltRef::new(&self.symbolic, &self.values);
        factor.solve_in_place_with_conj(Conj::No, columns, PARALLELISM, MemStack::new(&mut scratch));
    }

    /// Memory of the factor [B].
    #[must_use]
    pub fn bytes(&self) -> usize {
        size_of_val(&*self.values)
    }
}

/// Compressed columns of the lower half. K is symmetric, so column c is row c from the diagonal on.
fn lower_half(stiffness: &Stiffness, alpha: f64, diagonal: &[f64]) -> SparseColMat<usize, f64> {
    let order = 3 * stiffness.nodes();
    let (mut starts, mut rows, mut values) = (vec![0], Vec::new(), Vec::new());
    for (node, added) in diagonal.iter().enumerate().take(stiffness.nodes()) {
        for b in 0..3 {
            for (other, block) in stiffness.row(node).filter(|(other, _)| *other >= node) {
                for a in 0..3 {
                    let (row, column) = (3 * other + a, 3 * node + b);
                    if row >= column {
                        rows.push(row);
                        let extra = if row == column { *added } else { 0.0 };
                        values.push(alpha * block.row(b)[a] + extra);
                    }
                }
            }
            starts.push(rows.len());
        }
    }
    SparseColMat::new(SymbolicSparseColMat::new_checked(order, order, starts, None, rows), values)
}

/// The factor of K, or the reason why K is not positive definite to working precision.
pub(super) fn prove_positive_definite(stiffness: &Stiffness) -> Result<Factor, ObjectError> {
    let nodes = stiffness.nodes();
    let norm = stiffness.norm();
    match Factor::of(stiffness, 1.0, &vec![0.0; nodes]) {
        Ok(factor) => {
            let (smallest, softest) = softest_mode(&factor, nodes);
            if smallest < MIN_RECIPROCAL_CONDITION * norm {
                return Err(mechanism(&softest, smallest / norm));
            }
            Ok(factor)
        }
        Err(FactorError::NotPositiveDefinite) => {
            let shift = MECHANISM_SHIFT * norm;
            let shifted = Factor::of(stiffness, 1.0, &vec![shift; nodes])?;
            let (smallest, softest) = softest_mode(&shifted, nodes);
            Err(mechanism(&softest, (smallest - shift).max(0.0) / norm))
        }
        Err(error) => Err(error.into()),
    }
}

/// Steps of inverse iteration. Each multiplies what is not in the softest mode by the ratio of eigenvalues; a mechanism's
/// is below 1e-8, so that three are plenty.
const INVERSE_ITERATIONS: usize = 3;

/// An upper bound on the smallest eigenvalue, close to it where one is far below the rest, and its mode.
fn softest_mode(factor: &Factor, nodes: usize) -> (f64, Vec<DVec3>) {
    // A start without symmetry, so that it is not orthogonal to a symmetric mode.
    let wave = |k: usize| (1.0 + 0.7 * k as f64 + 0.01 * (k * k % 97) as f64).sin();
    let mut mode: Vec<DVec3> = (0..nodes).map(|i| DVec3::new(wave(3 * i), wave(3 * i + 1), wave(3 * i + 2))).collect();
    let mut eigenvalue = f64::INFINITY;
    for _ in 0..INVERSE_ITERATIONS {
        let before = norm(&mode);
        factor.solve(&mut mode);
        let after = norm(&mode);
        if !(after > 0.0 && after.is_finite()) {
            return (0.0, mode);
        }
        eigenvalue = before / after;
        mode.iter_mut().for_each(|v| *v /= after);
    }
    (eigenvalue, mode)
}

fn norm(vectors: &[DVec3]) -> f64 {
    vectors.iter().map(|v| v.length_squared()).sum::<f64>().sqrt()
}

/// The error that names the node which moves most in `mode`.
fn mechanism(mode: &[DVec3], reciprocal_condition: f64) -> ObjectError {
    let largest = mode.iter().enumerate().max_by(|a, b| a.1.length_squared().total_cmp(&b.1.length_squared()));
    let (node, motion) = largest.map_or((0, DVec3::ZERO), |(node, motion)| (node, *motion));
    ObjectError::Mechanism { node: node as u32, direction: motion.normalize_or_zero(), reciprocal_condition }
}
