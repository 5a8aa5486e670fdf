//! The work that the contact torque does along a path through C-space: zero around a loop if and only if it is a
//! gradient.
//!
//! `W = int tau_bar . dq` along a straight line, cut at the faces of the grid. Between two faces a potential's torque
//! is a polynomial of degree 6d - 1 at most, which Lobatto's formula of ten points integrates exactly up to three
//! joints; where the formula and its two halves differ (a boundary crossed within the cell, more joints) the stretch is
//! halved.

use haptize::{JointVector, field::TorqueField};

/// Difference, relative to the integral of the power's size over the whole line, at which one stretch of a work
/// integral is good enough (1): fractions of a cell are rounded by some tens of eps, and the torque with them.
const WORK_ROUNDING: f64 = 64.0 * f64::EPSILON;

/// Halvings of a stretch in a work integral at most: a kink of the torque within it then spoils 1e-9 of it, and, since
/// the torque itself is continuous, 1e-18 of the work.
const WORK_HALVINGS: u32 = 30;

/// Most halvings of one stretch in all. A jump takes [`WORK_HALVINGS`] of them, and a cell is crossed by few
/// boundaries; where rounding keeps more stretches from agreeing, further halves would only add to it.
const WORK_STRETCHES: u32 = 32 * WORK_HALVINGS;

/// Nodes in (0, 1] and weights of Lobatto's formula of ten points on `[-1, 1]`. It looks at the ends, too: where the
/// torque begins or ends within a stretch, the whole and its halves cannot agree by not seeing it.
const LOBATTO: [(f64, f64); 5] = [
    (0.165_278_957_666_387_02, 0.327_539_761_183_897_6),
    (0.477_924_949_810_444_5, 0.292_042_683_679_683_8),
    (0.738_773_865_105_505, 0.224_889_342_063_126_4),
    (0.919_533_908_166_458_9, 0.133_305_990_851_070_1),
    (1.0, 1.0 / 45.0),
];

/// Work of the torque of a field along straight lines.
pub struct Work<'a>(pub &'a TorqueField);

impl Work<'_> {
    /// That along the line `from`..`to` (J).
    pub fn along(&self, from: &JointVector, to: &JointVector) -> f64 {
        let mut cuts = vec![0.0, 1.0];
        for ((axis, start), end) in self.0.grid().axes.iter().zip(from.iter()).zip(to.iter()) {
            let crossed = (0..axis.count).map(|k| (axis.coordinate(k) - start) / (end - start));
            cuts.extend(crossed.filter(|cut| *cut > 0.0 && *cut < 1.0));
        }
        cuts.sort_unstable_by(f64::total_cmp);
        let stretches: Vec<_> =
            cuts.windows(2).map(|cut| (cut[0], cut[1], self.lobatto(from, to, cut[0], cut[1]))).collect();
        let tolerance = WORK_ROUNDING * stretches.iter().map(|(_, _, (_, size))| size).sum::<f64>();
        stretches.into_iter().map(|stretch| self.stretch(from, to, stretch, tolerance)).sum()
    }

    /// That around the closed polygon with corners `path` (J).
    pub fn around(&self, path: &[JointVector]) -> f64 {
        let next = path.iter().cycle().skip(1);
        path.iter().zip(next).map(|(from, to)| self.along(from, to)).sum()
    }

    /// The work of one stretch, halved until two halves differ from the whole by no more than `tolerance` (J).
    fn stretch(
        &self,
        from: &JointVector,
        to: &JointVector,
        (start, end, whole): (f64, f64, (f64, f64)),
        tolerance: f64,
    ) -> f64 {
        let (mut work, mut open, mut halved) = (0.0, vec![(start, end, whole.0, 0)], 0);
        while let Some((start, end, whole, halvings)) = open.pop() {
            let middle = start.midpoint(end);
            let [first, second] = [(start, middle), (middle, end)].map(|(a, b)| self.lobatto(from, to, a, b).0);
            let enough = halvings == WORK_HALVINGS || halved == WORK_STRETCHES;
            if enough || (whole - first - second).abs() <= tolerance {
                work += first + second;
            } else {
                halved += 1;
                open.push((start, middle, first, halvings + 1));
                open.push((middle, end, second, halvings + 1));
            }
        }
        work
    }

    /// Integral of the power, and of the size of its summands, from `start` to `end` of the line. The summands' size,
    /// not the power's: where torque and path are nearly perpendicular, rounding is as large as what cancels.
    fn lobatto(&self, from: &JointVector, to: &JointVector, start: f64, end: f64) -> (f64, f64) {
        let (middle, half) = (start.midpoint(end), 0.5 * (end - start));
        let mut sums = (0.0, 0.0);
        for (node, weight) in LOBATTO {
            for x in [middle - half * node, middle + half * node] {
                let (mut q, mut power, mut size) = (*from, 0.0, 0.0);
                q.iter_mut().zip(to.iter()).for_each(|(q, to)| *q += x * (to - *q));
                for ((tau, from), to) in self.0.sample(&q).torque.iter().zip(from.iter()).zip(to.iter()) {
                    let summand = tau * (to - from);
                    power += summand;
                    size += summand.abs();
                }
                sums = (sums.0 + half * weight * power, sums.1 + half * weight * size);
            }
        }
        sums
    }
}
