//! Golden section search (Kiefer 1953).

/// Returns where in `range` the function `at` is least, if it has one minimum there, and that minimum; `range` shrinks
/// `shrinkings` times, by a factor of 0.618 each.
pub(super) fn golden_section(
    [mut low, mut high]: [f64; 2],
    shrinkings: usize,
    mut at: impl FnMut(f64) -> f64,
) -> [f64; 2] {
    const GOLDEN: f64 = std::f64::consts::GOLDEN_RATIO - 1.0;
    let [mut a, mut b] = [high - GOLDEN * (high - low), low + GOLDEN * (high - low)];
    let [mut of_a, mut of_b] = [at(a), at(b)];
    for _ in 0..shrinkings {
        if of_a < of_b {
            (high, b, of_b) = (b, a, of_a);
            a = high - GOLDEN * (high - low);
            of_a = at(a);
        } else {
            (low, a, of_a) = (a, b, of_b);
            b = low + GOLDEN * (high - low);
            of_b = at(b);
        }
    }
    if of_a < of_b { [a, of_a] } else { [b, of_b] }
}
