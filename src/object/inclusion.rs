//! Parts of an elastic solid with a stiffness of their own: a nodule in tissue.
//!
//! A tetrahedron has the mean of the Lamé parameters in it, weighted by volume. Of a region of the mesh this is exact.
//! What part of a tetrahedron lies in a sphere is sampled at 56 points (fictitious domain method: Parvizian, Düster &
//! Rank 2007), so that the sphere needs no mesh of its own; a mesh that is not fine against it makes it too soft or too
//! stiff by the order of its share of cut cells.

use super::ObjectError;
use super::solid::{Solid, volume};
use crate::scene::{ElasticSpec, InclusionPlace, InclusionSpec};
use glam::DVec3;

/// Points of a tetrahedron along an edge, less one: (n + 1)(n + 2)(n + 3) / 6 points of equal weight.
const ORDER: usize = 5;

/// Lamé's parameters lambda and mu (Pa).
pub(super) type Lame = [f64; 2];

/// Returns Lamé's parameters of Young's modulus and Poisson's ratio.
pub(super) fn lame(young: f64, poisson: f64) -> Lame {
    [young * poisson / ((1.0 + poisson) * (1.0 - 2.0 * poisson)), young / (2.0 * (1.0 + poisson))]
}

/// Returns the mean parameters of each tetrahedron.
///
/// # Errors
/// [`ObjectError::EmptyInclusion`] if no tetrahedron has a part in one of the inclusions.
pub(super) fn mean(solid: &Solid, elastic: &ElasticSpec, nodes: &[DVec3]) -> Result<Vec<Lame>, ObjectError> {
    let body = lame(elastic.young, elastic.poisson);
    let mut means = vec![body; solid.tetrahedra.len()];
    let mut volumes = vec![0.0; elastic.inclusions.len()];
    let points: Vec<[f64; 4]> = points().collect();
    for (number, (mean, corners)) in means.iter_mut().zip(&solid.tetrahedra).enumerate() {
        if elastic.inclusions.is_empty() {
            break;
        }
        let corners = corners.map(|corner| nodes[corner as usize]);
        let region = solid.regions.get(number).copied();
        let mut sum = [0.0; 2];
        for weights in &points {
            let point: DVec3 = corners.iter().zip(weights).map(|(corner, weight)| *corner * *weight).sum();
            // The last one counts.
            let inside = elastic.inclusions.iter().rposition(|inclusion| holds(inclusion, point, region));
            let here = inside.map_or(body, |k| lame(elastic.inclusions[k].young, elastic.inclusions[k].poisson));
            sum = [sum[0] + here[0], sum[1] + here[1]];
            if let Some(inside) = inside {
                volumes[inside] += volume(corners) / points.len() as f64;
            }
        }
        *mean = sum.map(|sum| sum / points.len() as f64);
    }
    match volumes.iter().position(|volume| *volume <= 0.0) {
        Some(number) => Err(ObjectError::EmptyInclusion { inclusion: elastic.inclusions[number].to_string() }),
        None => Ok(means),
    }
}

fn holds(inclusion: &InclusionSpec, point: DVec3, region: Option<u32>) -> bool {
    match inclusion.place {
        InclusionPlace::Sphere { centre, radius } => point.distance_squared(centre) < radius * radius,
        InclusionPlace::Region(wanted) => region == Some(wanted),
    }
}

/// Barycentric coordinates of points spread evenly over a tetrahedron, none on its faces.
fn points() -> impl Iterator<Item = [f64; 4]> {
    let whole = |end: usize| 0..=end;
    let parts = whole(ORDER).flat_map(move |a| {
        whole(ORDER - a).flat_map(move |b| whole(ORDER - a - b).map(move |c| [a, b, c, ORDER - a - b - c]))
    });
    parts.map(|parts| parts.map(|part| (part as f64 + 0.25) / (ORDER + 1) as f64))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_are_balanced_and_inside() {
        let points: Vec<[f64; 4]> = points().collect();
        assert_eq!(points.len(), 56);
        assert!(
            points
                .iter()
                .all(|weights| weights.iter().all(|w| *w > 0.0) && (weights.iter().sum::<f64>() - 1.0).abs() < 1e-15)
        );
        for corner in 0..4 {
            let mean = points.iter().map(|weights| weights[corner]).sum::<f64>() / 56.0;
            assert!((mean - 0.25).abs() < 1e-15, "linear functions are averaged exactly");
        }
    }
}
