//! Where a Cholesky factor has its entries.
//!
//! L is stored by supernodes: columns that share their rows, as one dense trapezoid each (Ng & Peyton, Block sparse
//! Cholesky algorithms, 1993). What is above the diagonal of one is stored and not used, so wide ones are divided.

use faer::sparse::linalg::cholesky::supernodal::SymbolicSupernodalCholesky;
use std::ops::Range;

/// Columns of a supernode at most. More: more numbers above diagonals. Fewer: narrower blocks for dense products.
const MOST_COLUMNS: usize = 96;

/// For each supernode its columns, the rows below these, and where its values are.
#[derive(Clone, Debug)]
pub(super) struct Supernodes {
    /// First column of each, then the number of columns.
    begins: Vec<usize>,
    /// Start of each supernode's rows in `rows`, and their end.
    patterns: Vec<usize>,
    rows: Vec<usize>,
    /// Start of each supernode's values, and their end.
    values: Vec<usize>,
}

/// A dense trapezoid of L, column after column.
pub(super) struct Supernode<'f> {
    pub columns: Range<usize>,
    /// Rows below, ascending.
    pub pattern: &'f [usize],
    pub values: &'f [f64],
}

impl Supernodes {
    /// Those of the matrix that has `rows_per_node` rows for each of `symbolic`.
    pub fn new(symbolic: &SymbolicSupernodalCholesky<usize>, rows_per_node: usize) -> Self {
        let mut all = Self { begins: vec![0], patterns: vec![0], rows: Vec::new(), values: vec![0] };
        let rows = |&node: &usize| rows_per_node * node..rows_per_node * (node + 1);
        for (s, (&begin, &end)) in symbolic.supernode_begin().iter().zip(symbolic.supernode_end()).enumerate() {
            for first in (begin..end).step_by(MOST_COLUMNS / rows_per_node) {
                let next = end.min(first + MOST_COLUMNS / rows_per_node);
                all.rows.extend(rows_per_node * next..rows_per_node * end);
                all.rows.extend(symbolic.supernode(s).pattern().iter().flat_map(rows));
                let below = all.rows.len() - all.patterns[all.patterns.len() - 1];
                let width = rows_per_node * (next - first);
                all.begins.push(rows_per_node * next);
                all.patterns.push(all.rows.len());
                all.values.push(all.entries() + width * (width + below));
            }
        }
        all
    }

    /// Number of values.
    pub fn entries(&self) -> usize {
        self.values[self.values.len() - 1]
    }

    /// Where the values of supernode `s` are.
    pub fn range(&self, s: usize) -> Range<usize> {
        self.values[s]..self.values[s + 1]
    }

    /// Place of `row` among the rows of supernode `s`, which has it.
    pub fn place(&self, s: usize, row: usize) -> usize {
        let columns = self.columns(s);
        if row < columns.end {
            row - columns.start
        } else {
            columns.len() + self.pattern(s).partition_point(|other| *other < row)
        }
    }

    /// Number of supernodes.
    pub fn count(&self) -> usize {
        self.patterns.len() - 1
    }

    pub fn columns(&self, s: usize) -> Range<usize> {
        self.begins[s]..self.begins[s + 1]
    }

    /// Rows below the supernode's own, ascending.
    pub fn pattern(&self, s: usize) -> &[usize] {
        &self.rows[self.patterns[s]..self.patterns[s + 1]]
    }

    /// The supernode with column `column`.
    pub fn with(&self, column: usize) -> usize {
        self.begins.partition_point(|begin| *begin <= column) - 1
    }

    /// Its parent in the elimination tree, the first that its rows touch; none for a root.
    pub fn parent(&self, s: usize) -> Option<usize> {
        self.pattern(s).first().map(|&row| self.with(row))
    }

    /// The supernode with its part of all `values`.
    pub fn get<'f>(&'f self, values: &'f [f64], s: usize) -> Supernode<'f> {
        Supernode { columns: self.columns(s), pattern: self.pattern(s), values: &values[self.range(s)] }
    }
}
