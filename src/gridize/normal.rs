//! Small systems of normal equations.

/// Solves the symmetric system `rows`, each with its right-hand side in the last place; `None` when a pivot is at most
/// `least_pivot` of the greatest diagonal entry, where columns depend on one another.
pub(super) fn solve(mut rows: Vec<Vec<f64>>, least_pivot: f64) -> Option<Vec<f64>> {
    let count = rows.len();
    let greatest = (0..count).map(|i| rows[i][i]).fold(0.0, f64::max);
    for step in 0..count {
        let (done, rest) = rows.split_at_mut(step + 1);
        let pivot = &done[step];
        if pivot[step] <= least_pivot * greatest {
            return None;
        }
        for row in rest {
            let factor = row[step] / pivot[step];
            row.iter_mut().zip(pivot).for_each(|(entry, pivot)| *entry -= factor * pivot);
        }
    }
    let mut solution = vec![0.0; count];
    for step in (0..count).rev() {
        let known: f64 = (step + 1..count).map(|column| rows[step][column] * solution[column]).sum();
        solution[step] = (rows[step][count] - known) / rows[step][step];
    }
    Some(solution)
}
