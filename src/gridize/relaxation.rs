//! The relaxation of an object, identified from stretches of time in which its torque was recorded.
//!
//! With the terms' shares g_i and times theta_i the loop's torque is the elastic one times `1 - sum g_i z_i / w`,
//! `z_i' = (w - z_i) / theta_i`, w the root of the elastic energy (relaxation.rs of the loop). So it is linear in the
//! shares where the times are given:
//!
//! `tau = s tau_e - sum (s g_i) (z_i / w) tau_e`,
//!
//! s what the elastic torque is over the one that is known, which may have been measured after some of it had faded.
//! *Variable projection* (Golub and Pereyra 1973): for given times s and the products s g_i are the least squares that
//! are not negative; the times alone are searched, term by term on a logarithmic grid, then each along its logarithm. A
//! further term is taken where it lessens the misfit enough.

use super::{golden::golden_section, normal};
use crate::contact::linear::support::dot;

/// Times on the grid of the search, a decade (1): the misfit of a time that is off by a sixth of a decade leads
/// downhill to the right one.
const A_DECADE: f64 = 3.0;
/// What a further term must leave of the sum of squares, at most (1): it lowers the misfit by a tenth.
const WORTH_A_TERM: f64 = 0.81;
/// Least share of a term (1): below what a held-out force is predicted to.
const LEAST_SHARE: f64 = 0.01;
/// Rounds over all times, and halvings of the interval of each, after which a time is known to 1e-4 of a decade.
const ROUNDS: usize = 12;
const HALVINGS: usize = 14;
/// Rounds of scales and terms: each lessens what is left of a wrong scale to the part of it that relaxation explains.
const SCALINGS: usize = 8;

/// A stretch of time in which the object was felt.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Stretch {
    /// (s), ascending.
    pub times: Vec<f64>,
    /// Root w of the elastic energy at each, but for a factor (sqrt(J)).
    pub roots: Vec<f64>,
    /// Elastic torque, in size (N m or N).
    pub elastic: Vec<f64>,
    /// Measured torque along the elastic one (N m or N).
    pub measured: Vec<f64>,
    /// Whether the time counts, where measured and elastic torque may be compared.
    pub counts: Vec<bool>,
}

/// Terms that were identified.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Identified {
    /// Share and time of each, ascending in time (1, s).
    pub terms: Vec<[f64; 2]>,
    /// The elastic torque over the one that was given (1).
    pub scale: f64,
}

impl Identified {
    /// Whether it has the terms of `other`, each number to a share `off` of its size.
    pub fn is_near(&self, other: &Self, off: f64) -> bool {
        let pairs = || self.terms.as_flattened().iter().zip(other.terms.as_flattened());
        self.terms.len() == other.terms.len() && pairs().all(|(a, b)| (a - b).abs() <= off * b.abs())
    }
}

/// The remembered part z / w of the root at each time of `stretch`, for a term of `time` theta; w goes straight
/// between.
fn remembered(stretch: &Stretch, time: f64) -> Vec<f64> {
    let mut z = 0.0;
    let mut parts = Vec::with_capacity(stretch.times.len());
    for k in 0..stretch.times.len() {
        let w = stretch.roots[k];
        if k > 0 {
            let (before, interval) = (stretch.roots[k - 1], stretch.times[k] - stretch.times[k - 1]);
            let x = interval / time;
            // Of z' = (w - z) / theta under w = a + b t.
            let slope = (w - before) / x.max(f64::MIN_POSITIVE);
            let left = (-x).exp();
            z = left * z + (1.0 - left) * (before - slope) + slope * x;
        }
        parts.push(if w > 0.0 { z / w } else { 0.0 });
    }
    parts
}

impl Stretch {
    /// The share of the elastic torque that `terms` leave at each time (1).
    pub fn left(&self, terms: &[[f64; 2]]) -> Vec<f64> {
        let mut share = vec![1.0; self.times.len()];
        for [g, time] in terms {
            share.iter_mut().zip(remembered(self, *time)).for_each(|(share, part)| *share -= g * part);
        }
        share.iter_mut().for_each(|share| *share = share.max(0.0));
        share
    }

    /// The torque that `terms` make of the elastic one, in size (N m or N).
    pub fn predicted(&self, terms: &[[f64; 2]]) -> Vec<f64> {
        self.left(terms).iter().zip(&self.elastic).map(|(share, elastic)| share * elastic).collect()
    }

    fn rows(&self) -> impl Iterator<Item = usize> + '_ {
        (0..self.times.len()).filter(|&k| self.counts[k])
    }
}

/// The problem: rows of all stretches that count, each divided by its stretch's scale.
struct Problem<'a> {
    stretches: &'a [Stretch],
    scales: Vec<f64>,
}

impl Problem<'_> {
    /// The column of a term of `time`, or of the elastic torque itself.
    fn column(&self, time: Option<f64>) -> Vec<f64> {
        let of = |stretch: &Stretch| {
            let parts = time.map_or_else(|| vec![1.0; stretch.times.len()], |time| remembered(stretch, time));
            stretch.rows().map(|k| parts[k] * stretch.elastic[k]).collect::<Vec<f64>>()
        };
        self.stretches.iter().flat_map(of).collect()
    }

    fn measured(&self) -> Vec<f64> {
        let of = |(stretch, scale): (&Stretch, &f64)| {
            stretch.rows().map(|k| stretch.measured[k] / scale).collect::<Vec<f64>>()
        };
        self.stretches.iter().zip(&self.scales).flat_map(of).collect()
    }
}

/// Least squares of `y` over `columns` with the factors of all but the first not positive; the sum of squares left, and
/// the factors. Every subset of columns is tried: there are few.
fn constrained(columns: &[Vec<f64>], y: &[f64]) -> (f64, Vec<f64>) {
    let count = columns.len();
    let gram: Vec<Vec<f64>> = columns.iter().map(|a| columns.iter().map(|b| dot(a, b)).collect()).collect();
    let right: Vec<f64> = columns.iter().map(|a| dot(a, y)).collect();
    let whole = dot(y, y);
    let mut best = (f64::INFINITY, vec![0.0; count]);
    for subset in 0..1_usize << (count - 1) {
        let used: Vec<usize> = (0..count).filter(|&k| k == 0 || subset >> (k - 1) & 1 == 1).collect();
        let Some(factors) = solve(&gram, &right, &used) else { continue };
        let fades: f64 = -factors[1..].iter().sum::<f64>();
        if factors[1..].iter().any(|factor| *factor > 0.0) || fades >= factors[0] {
            continue;
        }
        let left = whole - used.iter().zip(&factors).map(|(k, factor)| factor * right[*k]).sum::<f64>();
        if left < best.0 {
            let mut all = vec![0.0; count];
            used.iter().zip(&factors).for_each(|(k, factor)| all[*k] = *factor);
            best = (left, all);
        }
    }
    best
}

/// Solves the rows and columns `used` of a positive definite system; `None` where they depend on one another.
fn solve(gram: &[Vec<f64>], right: &[f64], used: &[usize]) -> Option<Vec<f64>> {
    /// Below it a column is the others' sum to rounding (1).
    const LEAST_PIVOT: f64 = 1e-10;
    normal::solve(
        used.iter().map(|&k| used.iter().map(|&l| gram[k][l]).chain([right[k]]).collect()).collect(),
        LEAST_PIVOT,
    )
}

/// A choice of times and what it leaves.
#[derive(Clone, Debug)]
struct Fit {
    times: Vec<f64>,
    columns: Vec<Vec<f64>>,
    factors: Vec<f64>,
    left: f64,
}

impl Fit {
    fn new(problem: &Problem<'_>, y: &[f64], times: &[f64]) -> Self {
        let columns: Vec<Vec<f64>> =
            std::iter::once(None).chain(times.iter().copied().map(Some)).map(|time| problem.column(time)).collect();
        let (left, factors) = constrained(&columns, y);
        Self { times: times.to_vec(), columns, factors, left }
    }

    /// Moves time `term` to where the misfit is least between its neighbours on the grid.
    fn refine(&mut self, problem: &Problem<'_>, y: &[f64], term: usize, bounds: [f64; 2]) {
        let centre = self.times[term].ln();
        let reach = std::f64::consts::LN_10 / A_DECADE;
        let range = [(centre - reach).max(bounds[0].ln()), (centre + reach).min(bounds[1].ln())];
        golden_section(range, HALVINGS, |x| {
            let mut columns = self.columns.clone();
            columns[term + 1] = problem.column(Some(x.exp()));
            let (left, factors) = constrained(&columns, y);
            if left < self.left {
                self.times[term] = x.exp();
                (self.columns, self.factors, self.left) = (columns, factors, left);
            }
            left
        });
    }

    fn shares(&self) -> impl Iterator<Item = f64> + '_ {
        self.factors[1..].iter().map(|factor| -factor / self.factors[0])
    }
}

/// Identifies at most `most` terms. `scaled`: each stretch has a scale of its own, since the elastic torque is known
/// but for a factor there. `None` where nothing counts.
pub fn identify(stretches: &[Stretch], most: usize, scaled: bool) -> Option<Identified> {
    let mut problem = Problem { stretches, scales: vec![1.0; stretches.len()] };
    let spacing = |stretch: &Stretch| {
        let least = stretch.times.windows(2).map(|pair| pair[1] - pair[0]).fold(f64::INFINITY, f64::min);
        (least, stretch.times.last().unwrap_or(&0.0) - stretch.times.first().unwrap_or(&0.0))
    };
    let least = stretches.iter().map(|stretch| spacing(stretch).0).fold(f64::INFINITY, f64::min);
    let longest = stretches.iter().map(|stretch| spacing(stretch).1).fold(0.0, f64::max);
    let bounds = [least, 0.5 * longest];
    let decades = (bounds[1] / bounds[0]).log10();
    if !(decades.is_finite() && decades > 0.0) || stretches.iter().all(|stretch| stretch.rows().next().is_none()) {
        return None;
    }
    let grid: Vec<f64> =
        (0..=(A_DECADE * decades) as usize).map(|k| bounds[0] * 10_f64.powf(k as f64 / A_DECADE)).collect();
    let mut found = Fit::new(&problem, &problem.measured(), &[]);
    for _ in 0..if scaled { SCALINGS } else { 1 } {
        if scaled {
            problem.rescale(&found);
        }
        let y = problem.measured();
        found = Fit::new(&problem, &y, &[]);
        while found.times.len() < most {
            let with = |time: &f64| Fit::new(&problem, &y, &[&found.times[..], &[*time]].concat());
            let Some(mut more) = grid.iter().map(with).min_by(|a, b| a.left.total_cmp(&b.left)) else { break };
            if !more.left.is_finite() {
                break;
            }
            for _ in 0..ROUNDS {
                (0..more.times.len()).for_each(|term| more.refine(&problem, &y, term, bounds));
            }
            if more.left > WORTH_A_TERM * found.left || more.shares().any(|share| share < LEAST_SHARE) {
                break;
            }
            found = more;
        }
    }
    let mut terms: Vec<[f64; 2]> = found.shares().zip(&found.times).map(|(share, time)| [share, *time]).collect();
    terms.sort_by(|a, b| a[1].total_cmp(&b[1]));
    Some(Identified { terms, scale: found.factors[0] })
}

impl Problem<'_> {
    /// Gives each stretch the scale by which `fit` meets it best, one on average.
    fn rescale(&mut self, fit: &Fit) {
        let mut row = 0;
        for (stretch, scale) in self.stretches.iter().zip(&mut self.scales) {
            let (mut along, mut square) = (0.0, 0.0);
            for k in stretch.rows() {
                let model: f64 =
                    fit.columns.iter().zip(&fit.factors).map(|(column, factor)| column[row] * factor).sum();
                along += stretch.measured[k] * model;
                square += model * model;
                row += 1;
            }
            if along > 0.0 && square > 0.0 {
                *scale = along / square;
            }
        }
        let mean = self.scales.iter().sum::<f64>() / self.scales.len() as f64;
        self.scales.iter_mut().for_each(|scale| *scale /= mean);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Random;

    /// A press at some speed, held, and released, felt with `terms`, z by small steps; its torque is `scale` times
    /// that.
    fn press(terms: &[[f64; 2]], speed: f64, scale: f64, noise: &mut Random) -> Stretch {
        const STEP: f64 = 1e-4;
        let mut z = vec![0.0; terms.len()];
        let mut stretch = Stretch::default();
        for k in 0..120_000 {
            let time = STEP * f64::from(k);
            let w = (speed * time).min(0.2 + 0.01 * time).min(speed * (12.0 - time)).max(0.0);
            for (z, [_, theta]) in z.iter_mut().zip(terms) {
                *z += STEP / theta * (w - *z);
            }
            if k % 100 == 0 {
                let separation: f64 = z.iter().zip(terms).map(|(z, [share, _])| share * z).sum();
                stretch.times.push(time);
                stretch.roots.push(w);
                stretch.elastic.push(3.0 * w);
                stretch.measured.push(scale * 3.0 * (w - separation).max(0.0) + 2e-3 * noise.normal());
                stretch.counts.push(time > 0.3 && time < 11.0);
            }
        }
        stretch
    }

    #[test]
    fn terms_come_back_from_noise_and_unknown_scales_and_no_further_ones_come() {
        let terms = [[0.3, 0.15], [0.2, 2.0]];
        let mut noise = Random::new(5);
        let scales = [1.0, 0.8, 1.3, 0.9];
        let stretches: Vec<Stretch> =
            [2.0, 0.5, 2.0, 0.1].iter().zip(scales).map(|(v, scale)| press(&terms, *v, scale, &mut noise)).collect();
        let found = identify(&stretches, 4, true).unwrap();
        assert_eq!(found.terms.len(), 2, "{found:?}");
        assert!(found.is_near(&Identified { terms: terms.to_vec(), scale: 1.0 }, 0.02), "{found:?}");
        assert!((found.scale - 1.0).abs() < 0.01, "{found:?}");
        let other = press(&terms, 0.7, 1.0, &mut noise);
        let error: f64 = other.predicted(&found.terms).iter().zip(&other.measured).map(|(a, b)| (a - b).powi(2)).sum();
        let whole: f64 = other.measured.iter().map(|b| b * b).sum();
        assert!((error / whole).sqrt() < 0.02, "{error} {whole}");
    }

    #[test]
    fn what_does_not_fade_has_no_terms() {
        let mut noise = Random::new(6);
        let stretches: Vec<Stretch> = [2.0, 0.5].iter().map(|v| press(&[], *v, 1.0, &mut noise)).collect();
        assert!(identify(&stretches, 4, true).unwrap().terms.is_empty());
        assert_eq!(identify(&[], 4, true), None);
    }
}
