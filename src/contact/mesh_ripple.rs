//! How much a contact point feels the mesh, from the compliance alone.
//!
//! A point pressed to a constant depth d takes the force d / (1/kc + c), c(w) = sum_ij w_i w_j N . C_ij N being the
//! compliance of the surface under a force shared by the corners of a facet with barycentric weights w. Of a smooth
//! body c hardly changes over a facet. On springs or a membrane without bending stiffness a single node gives way more
//! than the middle of a facet, however fine the mesh: the force ripples as the point slides from facet to facet, and so
//! does the torque.

use super::geometry::closest_point::{ClosestPoint, Feature};
use super::law::depth::Carriers;
use super::model::Model;
use serde::{Deserialize, Serialize};
use std::fmt;

/// Ripple of the force on a contact point over a facet above which a bake warns that the mesh shows through (1).
const RIPPLE_WARNING: f64 = 0.1;

/// By how much the force on a contact point changes while it slides over a facet at constant depth, relative to its
/// mean (1).
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct MeshRipple {
    /// Median over the facets that can be reached.
    pub median: f64,
    /// Value at the worst facet.
    pub worst: f64,
    /// Mean length of the mesh's edges (m).
    pub edge: f64,
    /// Whether the object has a skin.
    pub skin: bool,
}

/// Barycentric weights between which the compliance is compared: corners, middles of edges and of the facet.
const PLACES: [[f64; 3]; 7] = [
    [1.0, 0.0, 0.0],
    [0.0, 1.0, 0.0],
    [0.0, 0.0, 1.0],
    [0.5, 0.5, 0.0],
    [0.0, 0.5, 0.5],
    [0.5, 0.0, 0.5],
    [1.0 / 3.0, 1.0 / 3.0, 1.0 / 3.0],
];

impl MeshRipple {
    /// That of the facets that the compliance of `model` covers; none where it covers no facet.
    #[must_use]
    pub fn new(model: &Model<'_>) -> Option<Self> {
        let mut ripples: Vec<f64> =
            (0..model.object.triangles.len()).filter_map(|triangle| facet(model, triangle)).collect();
        ripples.sort_unstable_by(f64::total_cmp);
        let (median, worst) = (*ripples.get(ripples.len() / 2)?, *ripples.last()?);
        Some(Self { median, worst, edge: model.surface.mean_edge, skin: model.object.skin.is_some() })
    }

    /// Returns the remedy if the ripple exceeds `RIPPLE_WARNING`.
    #[must_use]
    pub fn remedy(&self) -> Option<&'static str> {
        (self.median > RIPPLE_WARNING).then_some(if self.skin {
            "the mesh shows through: give the skin a greater width or bending stiffness, or the mesh shorter edges"
        } else {
            "the mesh shows through, and a finer one would as well: give the object a skin ([object.skin]) with a \
             width of some edges"
        })
    }
}

impl fmt::Display for MeshRipple {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { median, worst, edge, .. } = self;
        let (median, worst) = (100.0 * median, 100.0 * worst);
        write!(f, "{median:.1} % of a contact point's force over a facet of {:.1} mm, at most {worst:.1} %", 1e3 * edge)
    }
}

/// The ripple over one facet; none where the compliance does not cover it.
fn facet(model: &Model<'_>, triangle: usize) -> Option<f64> {
    let carried = model.surface.carriers(triangle as u32);
    let places: Vec<usize> = carried.0.iter().map(|&node| model.compliance.place(node)).collect::<Option<_>>()?;
    let normal = model.surface.normals[triangle];
    let between = |i: usize, j: usize| normal.dot(model.compliance.block(places[i], places[j]) * normal);
    let compliance = |weights: [f64; 3]| -> f64 {
        let carriers = Carriers::new(carried, &ClosestPoint { weights, feature: Feature::Face });
        let w = carriers.weights();
        let row = |i: usize| (0..w.len()).map(|j| w[i] * w[j] * between(i, j)).sum::<f64>();
        (0..w.len()).map(row).sum::<f64>() + 1.0 / model.kc
    };
    let all = PLACES.map(compliance);
    let (least, greatest) = (all.into_iter().fold(f64::MAX, f64::min), all.into_iter().fold(0.0, f64::max));
    Some((greatest - least) * PLACES.len() as f64 / all.iter().sum::<f64>())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixtures::bodies::{Ball, PAPER, contact, floating_bar, skinned, sphere};
    use crate::object::Object;

    /// The ripple of `object` under contact springs as stiff as a hand's.
    fn ripple(object: &Object) -> MeshRipple {
        let chain = floating_bar(0.0);
        MeshRipple::new(&Model::new(object, &chain, contact(1e4))).unwrap()
    }

    /// The ripple of a body with a skin falls like h^2 ln(1/h) with the mesh's edges h, as the deflection of a plate
    /// within h of a force does; of one of springs it does not fall at all.
    #[test]
    fn a_skin_smooths_what_springs_do_not() {
        let [coarse, fine] = [4, 8].map(|divisions| ripple(&skinned(divisions).unwrap()));
        let order = (coarse.median / fine.median).ln() / (coarse.edge / fine.edge).ln();
        assert!((1.2..2.2).contains(&order), "{coarse:?} {fine:?}");
        assert!(coarse.remedy().unwrap().contains("greater width") && fine.remedy().is_none());
        let [coarse, fine] = [10, 20].map(|rings| ripple(&sphere(Ball { rings, ..PAPER }).unwrap()));
        assert!(fine.median > 0.8 * coarse.median && coarse.median > 0.2, "{coarse:?} {fine:?}");
        assert!(coarse.remedy().unwrap().contains("[object.skin]"));
    }
}
