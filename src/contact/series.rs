//! What the walls of one ball bear.
//!
//! A ball is one spring, however many walls it touches. Of its compliance 1/kc the part e = [`WALL_COMPLIANCE`] lies at the walls and is
//! each wall's own, the rest is common to all. With s_j the depths and t the common part,
//! `E = 1/2 kc min_t (t^2 / (1 - e) + sum_j max(0, s_j - t)^2 / e)`;
//! a wall bears `kc p_j` with `p_j = max(0, s_j - t) / e`, and `E = 1/2 kc sum_j p_j s_j`. One wall alone is the spring kc of any
//! node, 1/2 kc depth^2; n of the same depth, as where the closest point lies on an edge of two facets, are stiffer by
//! `1 / (1 - e + e / n)`, at most 1 / (1 - e). Walls less deep than 1 - e of the deepest bear nothing. E is convex in the depths, and its
//! gradient is continuous, where the depth of the nearest wall alone would have kinks, on which nothing balances.

use super::depth::Contact;
use crate::tolerances::WALL_COMPLIANCE;

/// e / (1 - e): the common spring in those of a wall.
const COMMON: f64 = WALL_COMPLIANCE / (1.0 - WALL_COMPLIANCE);

/// Sets `pushes` to the p_j of walls with the depths s_j that `depth` gives [m].
pub fn bear(depth: impl Fn(usize) -> f64, pushes: &mut [f64]) {
    // t = sum s / (n + e / (1 - e)) over the walls deeper than t. It rises from zero to the solution, as walls that are less deep are
    // left out one after the other.
    let mut t = 0.0;
    loop {
        let (mut sum, mut count) = (0.0, COMMON);
        for s in (0..pushes.len()).map(&depth).filter(|&s| s > t) {
            sum += s;
            count += 1.0;
        }
        let next = sum / count;
        // Not `<=`, so that what is not a number ends it as well.
        let rises = next > t;
        if !rises {
            break;
        }
        t = next;
    }
    for (k, push) in pushes.iter_mut().enumerate() {
        *push = (depth(k) - t).max(0.0) / WALL_COMPLIANCE;
    }
}

/// Sets what all walls of `contacts` bear at their depths; `pushes` is room for it.
pub fn share_out(contacts: &mut [Contact], pushes: &mut Vec<f64>) {
    for rows in contacts.chunk_by_mut(Contact::shares_ball) {
        if rows[0].wall.is_none() {
            continue;
        }
        pushes.clear();
        pushes.resize(rows.len(), 0.0);
        bear(|k| rows[k].depth, pushes);
        for (row, push) in rows.iter_mut().zip(&*pushes) {
            if let Some(wall) = &mut row.wall {
                wall.push = *push;
            }
        }
    }
}

/// What the common part changes by where the depths of the walls that bear change by `changes`: what they change by beyond it, over e, they
/// bear more [m].
#[must_use]
pub fn common_change(changes: impl Iterator<Item = f64>) -> f64 {
    let (sum, count) = changes.fold((0.0, COMMON), |(sum, count), change| (sum + change, count + 1.0));
    sum / count
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::sequence;

    /// 1/2 sum p s.
    fn energy(depths: &[f64]) -> (f64, Vec<f64>) {
        let mut pushes = vec![0.0; depths.len()];
        bear(|k| depths[k], &mut pushes);
        (0.5 * depths.iter().zip(&pushes).map(|(s, p)| s * p).sum::<f64>(), pushes)
    }

    #[test]
    fn one_wall_is_one_spring_and_more_are_hardly_stiffer() {
        assert!((energy(&[0.3]).0 - 0.045).abs() < 1e-16);
        assert_eq!(energy(&[-0.3, 0.0]), (0.0, vec![0.0, 0.0]));
        for n in 1..9 {
            let expected = 0.045 / (1.0 - WALL_COMPLIANCE + WALL_COMPLIANCE / f64::from(n));
            assert!((energy(&vec![0.3; n as usize]).0 - expected).abs() < 1e-15, "{n}");
        }
        // Less deep than 1 - e of the deepest.
        assert_eq!(energy(&[0.3, 0.2999 * (1.0 - WALL_COMPLIANCE)]).1[1], 0.0);
    }

    /// It is the least over the common part, and the pushes are its gradient.
    #[test]
    fn pushes_are_the_gradient_of_the_least_energy() {
        let mut next = sequence(5);
        let mut several = 0;
        for _ in 0..200 {
            let depths: Vec<f64> = (0..6).map(|_| 1.0 + 0.2 * next()).collect();
            let (least, pushes) = energy(&depths);
            several += usize::from(pushes.iter().filter(|&&p| p > 0.0).count() > 1);
            for k in 0..2000 {
                let t = 1.3 * f64::from(k) / 2000.0;
                let walls: f64 = depths.iter().map(|s| (s - t).max(0.0).powi(2)).sum();
                assert!(0.5 * (t * t / (1.0 - WALL_COMPLIANCE) + walls / WALL_COMPLIANCE) >= least - 1e-12);
            }
            for k in 0..6 {
                let moved = |step: f64| {
                    let mut depths = depths.clone();
                    depths[k] += step;
                    energy(&depths).0
                };
                let slope = (moved(1e-7) - moved(-1e-7)) / 2e-7;
                assert!((slope - pushes[k]).abs() < 1e-5, "{slope} {}", pushes[k]);
            }
        }
        assert!(several > 100, "{several}");
    }
}
