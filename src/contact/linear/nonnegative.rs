//! The quadratic program `max over x >= 0 of b.x - 1/2 x.S x` with a symmetric positive definite S.
//!
//! Its one solution is that of the linear complementarity problem x >= 0, b - S x <= 0, x.(b - S x) = 0. A set of free
//! unknowns is guessed, the others are zero, and S x = b is solved for the free ones. Unknowns that break a sign change
//! sides, all at once, while their number falls and [`TRUST`] times more (Judice & Pires, A block principal pivoting
//! algorithm for large-scale strictly monotone linear complementarity problems, 1994). Then the value is raised step by
//! step from a point with x >= 0, which ends, since it comes to no set twice (Lawson & Hanson, Solving least squares
//! problems, 1974, chapter 23).

use super::cholesky;
use super::support::dot;

/// Rounds in which all unknowns that break a sign change sides though there are no fewer of them than before (1):
/// Judice & Pires.
const TRUST: u32 = 3;

/// A solver, whose vectors are reused.
#[derive(Default)]
pub struct NonnegativeProgram {
    /// x; zero where an unknown is bound.
    pub solution: Vec<f64>,
    /// b - S x, of all unknowns.
    pub slack: Vec<f64>,
    /// What rounding leaves of an entry of `slack`.
    rounding: f64,
    free: Vec<usize>,
    is_free: Vec<bool>,
    /// Lower factor of S among the free unknowns; see [`cholesky`].
    factor: Vec<f64>,
    reduced: Vec<f64>,
    /// Unknowns that break a sign.
    broken: Vec<usize>,
    /// The point with x >= 0 from which the value is raised.
    reached: Vec<f64>,
}

impl NonnegativeProgram {
    /// Makes room for programs of `order` unknowns, for which nothing is allocated from then on.
    pub fn reserve(&mut self, order: usize) {
        for vector in [&mut self.solution, &mut self.slack, &mut self.reduced, &mut self.reached] {
            vector.reserve(order);
        }
        self.free.reserve(order);
        self.broken.reserve(order);
        self.is_free.reserve(order);
        self.factor.reserve(order * order);
    }

    /// Solves the program of `matrix`, row after row, and `right`, from the guess which unknowns `are_free`, and returns
    /// whether it came to the end within `limit` rounds, and how many it took.
    pub fn solve(
        &mut self,
        matrix: &[f64],
        right: &[f64],
        are_free: impl Iterator<Item = bool>,
        limit: u32,
    ) -> (bool, u32) {
        self.is_free.clear();
        self.is_free.extend(are_free);
        let (mut fewest, mut trust) = (usize::MAX, TRUST);
        for round in 1..=limit {
            self.solve_free(matrix, right);
            self.find_broken(matrix);
            let broken = self.broken.len();
            if broken == 0 {
                // What is not a number stays so.
                self.solution.iter_mut().filter(|entry| **entry < 0.0).for_each(|entry| *entry = 0.0);
                return (true, round);
            }
            if broken < fewest {
                (fewest, trust) = (broken, TRUST);
            } else if trust > 0 {
                trust -= 1;
            } else {
                let (ended, rounds) = self.ascend(matrix, right, limit - round);
                return (ended, round + rounds);
            }
            self.broken.iter().for_each(|&i| self.is_free[i] = !self.is_free[i]);
        }
        (false, limit)
    }

    /// Raises the value from the nearest point to the solution with x >= 0, and returns as [`Self::solve`] does.
    fn ascend(&mut self, matrix: &[f64], right: &[f64], limit: u32) -> (bool, u32) {
        self.reached.clear();
        self.reached.extend(self.solution.iter().map(|entry| entry.max(0.0)));
        for (is_free, entry) in self.is_free.iter_mut().zip(&self.reached) {
            *is_free = *entry > 0.0;
        }
        for round in 1..=limit {
            self.solve_free(matrix, right);
            let Self { solution, slack, rounding, is_free, reached, .. } = self;
            // Towards the best point of this set, as far as all unknowns stay positive.
            let within = |x: f64, best: f64| if best < 0.0 { x / (x - best) } else { 1.0 };
            let way = reached.iter().zip(&*solution).map(|(x, best)| within(*x, *best)).fold(1.0, f64::min);
            if way < 1.0 {
                for ((x, best), is_free) in reached.iter_mut().zip(&*solution).zip(is_free.iter_mut()) {
                    let ends_here = within(*x, *best) <= way;
                    *x = if ends_here { 0.0 } else { *x + way * (best - *x) };
                    *is_free &= !ends_here;
                }
                continue;
            }
            reached.copy_from_slice(solution);
            let bound = (0..right.len()).filter(|&i| !is_free[i] && slack[i] > *rounding);
            match bound.max_by(|&i, &j| slack[i].total_cmp(&slack[j])) {
                Some(most) => is_free[most] = true,
                None => return (true, round),
            }
        }
        (false, limit)
    }

    /// Finds the unknowns that are negative while free, or would grow while bound, by more than rounding.
    fn find_broken(&mut self, matrix: &[f64]) {
        let Self { solution, slack, rounding, is_free, broken, .. } = self;
        let breaks = |&i: &usize| {
            if is_free[i] { solution[i] * matrix[i * (slack.len() + 1)] < -*rounding } else { slack[i] > *rounding }
        };
        broken.clear();
        broken.extend((0..slack.len()).filter(breaks));
    }

    /// Solves for the free unknowns, with one step of iterative refinement, and brings the slack up to date.
    fn solve_free(&mut self, matrix: &[f64], right: &[f64]) {
        let Self { solution, slack, rounding, free, is_free, factor, reduced, .. } = self;
        let order = right.len();
        free.clear();
        free.extend((0..order).filter(|&i| is_free[i]));
        let count = free.len();
        factor.resize(count * count, 0.0);
        for (a, &i) in free.iter().enumerate() {
            for (b, &j) in free[..=a].iter().enumerate() {
                factor[a * count + b] = matrix[i * order + j];
            }
        }
        cholesky::factorize(factor, count);
        solution.clear();
        solution.resize(order, 0.0);
        slack.clear();
        slack.extend_from_slice(right);
        for _ in 0..2 {
            reduced.clear();
            reduced.extend(free.iter().map(|&i| slack[i]));
            cholesky::solve(factor, reduced.as_chunks_mut::<1>().0);
            free.iter().zip(&*reduced).for_each(|(&i, part)| solution[i] += part);
            for ((slack, right), row) in slack.iter_mut().zip(right).zip(matrix.chunks_exact(order.max(1))) {
                *slack = right - dot(row, solution);
            }
        }
        let largest = (0..order).map(|i| matrix[i * order + i]).fold(0.0, f64::max);
        // No entry of S is above the greatest of its diagonal.
        *rounding = f64::EPSILON * order as f64 * largest * solution.iter().map(|entry| entry.abs()).sum::<f64>();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::sequence;

    /// A random positive definite matrix of `order`, with about as many small eigenvalues as large ones, and a right.
    fn program(next: &mut impl FnMut() -> f64, order: usize, rank: usize) -> (Vec<f64>, Vec<f64>) {
        let factors: Vec<f64> = (0..order * rank).map(|_| next()).collect();
        let row = |i: usize| &factors[i * rank..(i + 1) * rank];
        let ridge = |i, j| if i == j { 1e-6 } else { 0.0 };
        let matrix = (0..order).flat_map(|i| (0..order).map(move |j| (i, j)));
        (matrix.map(|(i, j)| dot(row(i), row(j)) + ridge(i, j)).collect(), (0..order).map(|_| next()).collect())
    }

    /// The guess that an unknown is free if it would grow alone.
    fn positive(right: &[f64]) -> impl Iterator<Item = bool> {
        right.iter().map(|entry| *entry > 0.0)
    }

    /// The value of the program at the solution of S x = b on each set of unknowns where that is nonnegative: the
    /// greatest of all.
    fn best_of_all_sets(matrix: &[f64], right: &[f64]) -> f64 {
        let order = right.len();
        (0..1_usize << order).fold(0.0, |best, set| {
            let taken: Vec<usize> = (0..order).filter(|i| set >> i & 1 == 1).collect();
            let mut factor: Vec<f64> =
                taken.iter().flat_map(|i| taken.iter().map(move |j| matrix[i * order + j])).collect();
            let mut x: Vec<[f64; 1]> = taken.iter().map(|&i| [right[i]]).collect();
            cholesky::factorize(&mut factor, taken.len());
            cholesky::solve(&factor, &mut x);
            let value: f64 = taken.iter().zip(&x).map(|(&i, [x])| 0.5 * right[i] * x).sum();
            if x.iter().all(|[x]| *x >= 0.0) { value.max(best) } else { best }
        })
    }

    #[test]
    fn the_program_ends_at_the_best_of_all_sets_of_unknowns() {
        let mut next = sequence(11);
        for turn in 0..200 {
            let order = turn % 10;
            let (matrix, right) = program(&mut next, order, 1 + turn % 7);
            let mut solver = NonnegativeProgram::default();
            assert!(solver.solve(&matrix, &right, positive(&right), 200).0, "order {order}");
            let value = 0.5 * dot(&right, &solver.solution);
            let best = best_of_all_sets(&matrix, &right);
            assert!((value - best).abs() <= 1e-9 * best, "order {order}: {value} {best}");
        }
    }

    #[test]
    fn large_programs_end_with_the_conditions_of_karush_kuhn_and_tucker() {
        let mut next = sequence(12);
        let (mut most, mut bound) = (0, 0);
        for turn in 0..60 {
            let order = 20 + turn;
            let (matrix, right) = program(&mut next, order, 5 + turn);
            let mut solver = NonnegativeProgram::default();
            let (ended, rounds) = solver.solve(&matrix, &right, positive(&right), 200);
            assert!(ended, "order {order}");
            most = most.max(rounds);
            for i in 0..order {
                let slack = right[i] - dot(&matrix[i * order..(i + 1) * order], &solver.solution);
                assert!(solver.solution[i] >= 0.0 && slack <= 1e-8, "{slack}");
                assert!(solver.solution[i] == 0.0 || slack.abs() <= 1e-8, "{slack}");
                bound += usize::from(solver.solution[i] == 0.0);
            }
        }
        assert!(most > 2 && bound > 100, "the programs are no mere linear systems: {most} {bound}");
    }

    /// Among them are some on which exchanging all unknowns at once goes round in circles.
    #[test]
    fn programs_of_low_rank_end() {
        let mut next = sequence(13);
        let mut longest = 0;
        for _ in 0..2000 {
            let (matrix, right) = program(&mut next, 8, 3);
            let mut solver = NonnegativeProgram::default();
            let (ended, rounds) = solver.solve(&matrix, &right, positive(&right), 200);
            assert!(ended);
            longest = longest.max(rounds);
        }
        assert!(longest > TRUST + 3, "the value had to be raised step by step: {longest}");
    }

    /// The solution does not depend on the guess, and the right one takes one round.
    #[test]
    fn any_guess_leads_to_the_same_solution() {
        let mut next = sequence(14);
        for turn in 0..200 {
            let order = 1 + turn % 30;
            let (matrix, right) = program(&mut next, order, 1 + turn % 9);
            let mut solver = NonnegativeProgram::default();
            assert!(solver.solve(&matrix, &right, positive(&right), 400).0);
            let expected = solver.solution.clone();
            let size = expected.iter().fold(0.0_f64, |most, entry| most.max(*entry));
            let guess: Vec<bool> = (0..order).map(|_| next() > 0.0).collect();
            assert!(solver.solve(&matrix, &right, guess.into_iter(), 400).0);
            for (found, expected) in solver.solution.iter().zip(&expected) {
                assert!((found - expected).abs() <= 1e-7 * size, "order {order}: {found} {expected}");
            }
            let known = solver.solution.clone();
            let again = solver.solve(&matrix, &right, known.iter().map(|entry| *entry > 0.0), 400);
            assert_eq!((again, &solver.solution), ((true, 1), &known));
        }
    }

    #[test]
    fn rounds_are_limited() {
        let mut next = sequence(12);
        let (matrix, right) = program(&mut next, 40, 10);
        assert_eq!(NonnegativeProgram::default().solve(&matrix, &right, positive(&right), 1), (false, 1));
    }
}
