//! How one proxy node's spring acts on the facets that the node feels.
//!
//! A point feels the closest facet alone, so that `E = 1/2 kc max(0, s)^2` with its depth s. A ball in a dent touches
//! several facets, and the closest changes with a kink, on which nothing balances. So the spring of a ball acts on all
//! facets about as near as the closest: of its compliance 1/kc the part e = [`FACET_COMPLIANCE`] is each facet's own,
//! in series with the rest, which they share. With s_j the depths and t the shared part,
//! `E = 1/2 kc min_t (t^2 / (1 - e) + sum_j max(0, s_j - t)^2 / e)`. A facet takes the force `kc p_j` with
//! `p_j = max(0, s_j - t) / e`, and `E = 1/2 kc sum_j p_j s_j`. One facet alone is the spring kc of a point; n of the
//! same depth, as on an edge of two, are stiffer by `1 / (1 - e + e / n)`, at most 1 / (1 - e). Facets less deep than 1
//! - e of the deepest take no force. E is convex in the depths, and its gradient is continuous.

use super::depth::Contact;
use crate::tolerances::FACET_COMPLIANCE;

/// e / (1 - e): the shared spring in units of a facet's own.
const SHARED: f64 = FACET_COMPLIANCE / (1.0 - FACET_COMPLIANCE);

/// Sets `parts` to the p_j of facets with the depths s_j that `depth` gives [m].
pub fn distribute(depth: impl Fn(usize) -> f64, parts: &mut [f64]) {
    if let [part] = parts {
        *part = depth(0).max(0.0);
        return;
    }
    // t = sum s / (n + e / (1 - e)) over the facets deeper than t. It rises from zero to the solution, as facets that
    // are less deep are left out one after the other.
    let mut t = 0.0;
    loop {
        let (mut sum, mut count) = (0.0, SHARED);
        for s in (0..parts.len()).map(&depth).filter(|&s| s > t) {
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
    for (k, part) in parts.iter_mut().enumerate() {
        *part = (depth(k) - t).max(0.0) / FACET_COMPLIANCE;
    }
}

/// Sets the parts of all rows at their depths; `parts` is room for it.
pub fn distribute_all(contacts: &mut [Contact], parts: &mut Vec<f64>) {
    for rows in contacts.chunk_by_mut(Contact::shares_spring) {
        parts.clear();
        parts.resize(rows.len(), 0.0);
        distribute(|k| rows[k].depth, parts);
        rows.iter_mut().zip(&*parts).for_each(|(row, part)| row.push = *part);
    }
}

/// By how much the shared part t changes where the depths of the facets that take force change by `changes` [m].
#[must_use]
pub fn shared_change(changes: impl Iterator<Item = f64>) -> f64 {
    let (sum, count) = changes.fold((0.0, SHARED), |(sum, count), change| (sum + change, count + 1.0));
    sum / count
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::sequence;

    /// 1/2 sum p s.
    fn energy(depths: &[f64]) -> (f64, Vec<f64>) {
        let mut pushes = vec![0.0; depths.len()];
        distribute(|k| depths[k], &mut pushes);
        (0.5 * depths.iter().zip(&pushes).map(|(s, p)| s * p).sum::<f64>(), pushes)
    }

    #[test]
    fn one_facet_is_one_spring_and_more_are_hardly_stiffer() {
        assert!((energy(&[0.3]).0 - 0.045).abs() < 1e-16);
        assert_eq!(energy(&[-0.3, 0.0]), (0.0, vec![0.0, 0.0]));
        for n in 1..9 {
            let expected = 0.045 / (1.0 - FACET_COMPLIANCE + FACET_COMPLIANCE / f64::from(n));
            assert!((energy(&vec![0.3; n as usize]).0 - expected).abs() < 1e-15, "{n}");
        }
        // Less deep than 1 - e of the deepest.
        assert_eq!(energy(&[0.3, 0.2999 * (1.0 - FACET_COMPLIANCE)]).1[1], 0.0);
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
                let facets: f64 = depths.iter().map(|s| (s - t).max(0.0).powi(2)).sum();
                assert!(0.5 * (t * t / (1.0 - FACET_COMPLIANCE) + facets / FACET_COMPLIANCE) >= least - 1e-12);
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
