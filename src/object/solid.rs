//! An elastic solid as finite elements, whatever their shape, and how its stiffness is put together.

use super::Stiffness;
use super::attachment::SurfacePoint;
use super::element::{Lame, Quadrature};
use super::inclusion::Materials;
use crate::Error;
use glam::{DMat3, DVec3};
use rayon::prelude::*;
use std::collections::HashMap;
use std::sync::Arc;

/// Elements of a solid and their nodes, those of K.
pub(super) trait Elements: Sync {
    /// Nodes at rest (m).
    fn positions(&self) -> &[DVec3];

    /// Number of elements.
    fn count(&self) -> usize;

    /// Nodes of an element.
    fn nodes(&self, element: usize) -> &[u32];

    /// Points of an element with the material at each.
    ///
    /// # Errors
    /// When a tetrahedron has no volume.
    fn quadrature(&self, element: usize, materials: &Materials<'_>) -> Result<(Quadrature, Vec<Lame>), Error>;

    /// A number that elements of the same stiffness share, where there are such.
    fn kind(&self, element: usize, materials: &Materials<'_>) -> Option<usize>;

    /// Points of that part of an element's material that lies below z = `height` (m).
    fn below(&self, element: usize, height: f64) -> Quadrature;

    /// The element that moves a point of the surface, with its shape functions there.
    fn locate(&self, point: &SurfacePoint) -> (usize, Vec<f64>);
}

/// Elements whose stiffness is formed before it is added: some 15 MB of cubes.
const TOGETHER: usize = 256;

/// An element's stiffness, and int N_a^2 of its nodes (m^3).
type Formed = Arc<(Vec<DMat3>, Vec<f64>)>;

/// Adds the stiffness of `elements` to `stiffness`, whose pattern holds the nodes of each. Returns which part of the
/// body's mass each node carries: it is in proportion to int N_a^2, which is positive for all (Hinton, Rock &
/// Zienkiewicz 1976).
///
/// # Errors
/// As for [`Elements::quadrature`]; or where an inclusion holds no part of the solid.
pub(super) fn add(
    elements: &dyn Elements,
    materials: &Materials<'_>,
    stiffness: &mut Stiffness,
) -> Result<Vec<f64>, Error> {
    let form = |element: usize| -> Result<Formed, Error> {
        let (quadrature, lame) = elements.quadrature(element, materials)?;
        let n = elements.nodes(element).len();
        let masses = quadrature.products().into_iter().step_by(n + 1).collect();
        Ok(Arc::new((quadrature.stiffness(&lame), masses)))
    };
    let mut alike: HashMap<usize, Formed> = HashMap::new();
    let mut mass = vec![0.0; elements.positions().len()];
    let all: Vec<usize> = (0..elements.count()).collect();
    for some in all.chunks(TOGETHER) {
        for &element in some {
            if let Some(kind) = elements.kind(element, materials).filter(|kind| !alike.contains_key(kind)) {
                alike.insert(kind, form(element)?);
            }
        }
        let known = |element: usize| elements.kind(element, materials).and_then(|kind| alike.get(&kind).cloned());
        let formed: Result<Vec<Formed>, _> =
            some.par_iter().map(|&element| known(element).map_or_else(|| form(element), Ok)).collect();
        for (&element, formed) in some.iter().zip(formed?) {
            let nodes = elements.nodes(element);
            for (&node, blocks) in nodes.iter().zip(formed.0.chunks_exact(nodes.len())) {
                nodes.iter().zip(blocks).for_each(|(&other, block)| {
                    stiffness.add(node as usize, other as usize, *block);
                });
            }
            nodes.iter().zip(&formed.1).for_each(|(&node, part)| mass[node as usize] += part);
        }
    }
    materials.check()?;
    let sum: f64 = mass.iter().sum();
    mass.iter_mut().for_each(|part| *part /= sum);
    Ok(mass)
}
