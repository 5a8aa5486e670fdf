//! Grids of other spacings over a scene's region, and how errors fall with the spacing.

use crate::scene::Scene;

/// `scene` with another grid over the same region: one of n steps along an axis gets `steps(n)`, a whole number.
pub(crate) fn spaced(scene: &Scene, steps: impl Fn(f64) -> f64) -> Scene {
    let mut scene = scene.clone();
    for axis in &mut scene.grid.axes {
        let cells = (axis.count - 1) as f64;
        let new = steps(cells).max(1.0);
        (axis.count, axis.step) = (new as usize + 1, axis.step * cells / new);
    }
    scene
}

/// Grid points of `scene`.
pub(crate) fn points(scene: &Scene) -> usize {
    scene.grid.axes.iter().map(|axis| axis.count).fold(1, usize::saturating_mul)
}

/// Geometric mean of the spacings of `scene` (rad or m).
pub(crate) fn spacing_of(scene: &Scene) -> f64 {
    let axes = &scene.grid.axes;
    (axes.iter().map(|axis| axis.step.ln()).sum::<f64>() / axes.len().max(1) as f64).exp()
}

/// Order p of `errors` that belong to spacings, error ~ h^p: the slope of a line through the logarithms. `None` for
/// less than two spacings with an error.
pub(crate) fn order(errors: impl Iterator<Item = (f64, f64)>) -> Option<f64> {
    let points: Vec<(f64, f64)> =
        errors.filter(|(_, error)| *error > 0.0).map(|(spacing, error)| (spacing.ln(), error.ln())).collect();
    let count = points.len() as f64;
    let mean = points.iter().fold((0.0, 0.0), |sum, p| (sum.0 + p.0 / count, sum.1 + p.1 / count));
    let (across, along) = points
        .iter()
        .fold((0.0, 0.0), |sum, p| (sum.0 + (p.0 - mean.0) * (p.1 - mean.1), sum.1 + (p.0 - mean.0).powi(2)));
    (points.len() > 1 && along > 0.0).then(|| across / along)
}
