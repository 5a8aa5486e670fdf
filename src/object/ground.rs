//! What holds the object: springs Kg, per node, per area or per volume, or a clamp.
//!
//! Springs per node depend on the mesh: a finer one has more of them. Those per area and per volume belong to the
//! body. A clamp is springs per area so stiff that they hardly give way. All act on the displacement of the surface,
//! or of the solid, as the nodes of K move it.

use super::Stiffness;
use super::attachment::{Attachment, SurfacePoint};
use super::solid::Elements;
use super::topology::at;
use crate::{
    Error, error,
    names::counted,
    scene::{GroundNodes, GroundSpec, GroundStiffness},
};
use glam::{DMat3, DVec3};
use std::collections::BTreeMap;

/// Stiffness of a clamp per area, in Young's moduli over the mean edge of the surface (1). Under the stress that
/// strains the solid by one percent the clamped surface moves by a millionth of an edge. Larger: K is worse
/// conditioned.
const CLAMP: f64 = 1e4;

/// What the ground acts on.
pub(super) struct Held<'a> {
    pub points: &'a [SurfacePoint],
    pub attachment: &'a Attachment,
    /// The elements of a solid, and its Young's modulus (Pa).
    pub solid: Option<(&'a dyn Elements, f64)>,
    /// Mean edge of the surface (m).
    pub edge: f64,
}

/// Per node: is it grounded?
pub(super) fn select(ground: &GroundSpec, nodes: &[DVec3]) -> Result<Vec<bool>, Error> {
    match &ground.nodes {
        GroundNodes::All => Ok(vec![true; nodes.len()]),
        GroundNodes::Listed(list) => {
            let mut grounded = vec![false; nodes.len()];
            for &node in list {
                let slot = grounded.get_mut(node as usize);
                let last = nodes.len().saturating_sub(1);
                *slot.ok_or_else(|| {
                    error!("ground names node {node}, but the object has nodes 0 to {last}: correct the list")
                        .about("object.ground.nodes")
                })? = true;
            }
            Ok(grounded)
        }
        GroundNodes::Below(height) => {
            let grounded: Vec<bool> = nodes.iter().map(|n| n.z < *height).collect();
            if !grounded.contains(&true) {
                let lowest = nodes.iter().map(|n| n.z).fold(f64::INFINITY, f64::min);
                return Err(error!(
                    "no node lies below z = {height} m, the lowest is at z = {lowest} m: raise the ground's height"
                )
                .about("object.ground.below"));
            }
            Ok(grounded)
        }
    }
}

impl Held<'_> {
    /// Adds Kg to `stiffness`, whose pattern holds the nodes of each element and of each grounded row of N. `grounded`:
    /// see [`select`].
    pub fn add(&self, ground: &GroundSpec, grounded: &[bool], stiffness: &mut Stiffness) {
        match ground.stiffness {
            GroundStiffness::PerNode(k) => {
                for node in (0..grounded.len()).filter(|&node| grounded[node]) {
                    let row = self.attachment.row(node);
                    stiffness.add_products(row, row, k);
                }
            }
            GroundStiffness::PerArea(k) => self.add_area(ground, grounded, k, stiffness),
            GroundStiffness::Clamp => {
                let young = self.solid.map_or(0.0, |(_, young)| young);
                self.add_area(ground, grounded, CLAMP * young / self.edge, stiffness);
            }
            GroundStiffness::PerVolume(k) => {
                let Some((elements, _)) = self.solid else { return };
                let height = match ground.nodes {
                    GroundNodes::Below(height) => height,
                    _ => f64::INFINITY,
                };
                for element in 0..elements.count() {
                    let products = elements.below(element, height).products();
                    add_element(elements.nodes(element), &products, k, stiffness);
                }
            }
        }
    }

    /// Adds springs of `k` per area (N/m^3).
    fn add_area(&self, ground: &GroundSpec, grounded: &[bool], k: f64, stiffness: &mut Stiffness) {
        let is_held = |point: &&SurfacePoint| match ground.nodes {
            GroundNodes::Below(height) => point.place.z < height,
            _ => grounded[point.owner as usize],
        };
        let held = self.points.iter().filter(is_held);
        let Some((elements, _)) = self.solid else {
            return held.for_each(|point| {
                let row = self.attachment.row(point.owner as usize);
                stiffness.add_products(row, row, k * point.area);
            });
        };
        let mut products: BTreeMap<usize, Vec<f64>> = BTreeMap::new();
        for point in held {
            let (element, values) = elements.locate(point);
            let products = products.entry(element).or_insert_with(|| vec![0.0; values.len() * values.len()]);
            for (row, a) in products.chunks_exact_mut(values.len()).zip(&values) {
                row.iter_mut().zip(&values).for_each(|(sum, b)| *sum += point.area * a * b);
            }
        }
        products.iter().for_each(|(&element, products)| add_element(elements.nodes(element), products, k, stiffness));
    }
}

/// Adds `k` times `products`, row-major, between the `nodes` of an element.
fn add_element(nodes: &[u32], products: &[f64], k: f64, stiffness: &mut Stiffness) {
    for (&node, row) in nodes.iter().zip(products.chunks_exact(nodes.len())) {
        for (&other, &product) in nodes.iter().zip(row) {
            stiffness.add(node as usize, other as usize, DMat3::from_diagonal(DVec3::splat(k * product)));
        }
    }
}

/// Refuses an object of which a connected part has no grounded node. `components`: nodes of each part; `grounded`: per
/// node, empty where there is no ground.
pub(super) fn check_components(nodes: &[DVec3], components: &[Vec<u32>], grounded: &[bool]) -> Result<(), Error> {
    for part in components {
        if !part.iter().any(|&node| grounded.get(node as usize) == Some(&true)) {
            return Err(error!(
                "the ground holds no node of the part of {} around {}, which would float away: ground at least one of \
                 its nodes, or give the skin a foundation",
                counted(part.len(), ["node", "nodes"]),
                at(nodes, part[0])
            )
            .about("object.ground"));
        }
    }
    Ok(())
}
