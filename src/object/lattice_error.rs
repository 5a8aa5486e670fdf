//! The error that the cubes of a lattice make, estimated on coarser ones.
//!
//! Two lattices whose cubes differ by a factor r differ in compliance by e. Roache's grid convergence index states `3
//! e / (r^p - 1)` as the error of the finer one, p being the order of convergence (Journal of Fluids Engineering 116,
//! 1994). Its factor 3 is for two lattices, from which the order cannot be told: it is 2 here, what quadratic elements
//! have in energy under a pressure whose edge their nodes do not follow. Coarser cubes take a tenth of the work of
//! those in question; finer ones would take some thirty times as much.

use super::{Compliance, Mechanics, Object, topology};
use crate::scene::{ElasticSpec, Material, ObjectSpec};
use crate::{Error, cache::Cache};
use glam::DVec3;
use serde::Serialize;
use std::{fmt, sync::OnceLock};

/// Size of the coarser cubes, in those of the lattice (1).
const COARSER: f64 = 1.5;

/// [Roache's](self) factor over `r^p - 1` (1).
const INDEX: f64 = 3.0 / (COARSER * COARSER - 1.0);

/// Radius of the pressure that both are put under, in mean edges of the surface (1): that of the smallest contact for
/// which such a surface is fine enough (`docs/solids.md`).
const RADIUS: f64 = 3.0;

/// Places at which they are put under it (1), of which the median counts: at a single one, two lattices may agree by
/// chance, and another lattice would choose another.
const PLACES: usize = 15;

/// Error from which on a warning is due (1): Young's modulus of tissue is hardly known better.
const LARGE: f64 = 0.05;

/// By how much compliance errs because of the size of the cubes.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct LatticeError {
    /// Size of the cubes (m).
    pub cell: f64,
    /// Estimated error of the displacement under a small contact, relative to it (1).
    pub relative: f64,
    /// Size of cubes that would suit the surface, where they would take more memory or time than they may (m).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub suitable: Option<f64>,
}

impl LatticeError {
    /// Whether it is large enough to be warned of, or cubes are larger than suits the surface.
    #[must_use]
    pub fn is_coarse(&self) -> bool {
        self.relative > LARGE || self.suitable.is_some()
    }

    /// The warning of coarse cubes, where they are.
    #[must_use]
    pub fn warning(&self) -> Option<String> {
        self.is_coarse().then(|| format!("the lattice is coarse: {self}"))
    }
}

impl fmt::Display for LatticeError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "cubes of {:.2} mm make its compliance err by an estimated {:.1} % at most",
            self.cell * 1e3,
            self.relative * 1e2
        )?;
        match self.suitable {
            Some(suitable) => write!(
                f,
                "; those of {:.2} mm, which suit the surface, would take too much memory or time: give it longer edges \
                 where nothing touches it, or set object.elasticity.cell = {suitable:.4}",
                suitable * 1e3
            ),
            None if self.is_coarse() => write!(f, ": set object.elasticity.cell = {:.4}", self.cell / 2.0),
            None => Ok(()),
        }
    }
}

impl Object {
    /// Estimates by how much the lattice in this object errs under a pressure around a node of `compliance`: the median
    /// over nodes from the stiffest to the softest. On corners errors are greater, and contact is rare. None if no lattice
    /// fills it, or if the coarser one is refused, as where it misses an inclusion.
    #[must_use]
    pub fn lattice_error(&self, compliance: &Compliance) -> Option<LatticeError> {
        let Material::Elastic(elastic) = &self.spec.material else { return None };
        let cell = elastic.cell?;
        let trace = |i: usize| (0..3).map(|k| compliance.block(i, i).col(k)[k]).sum::<f64>();
        let mut places: Vec<usize> = (0..compliance.nodes.len()).collect();
        places.sort_by(|&i, &j| trace(i).total_cmp(&trace(j)));
        if places.is_empty() {
            return None;
        }
        let mut nodes: Vec<u32> =
            (0..PLACES).map(|k| compliance.nodes[places[(2 * k + 1) * places.len() / (2 * PLACES)]]).collect();
        nodes.dedup();
        let key = [&self.key[..], b"error of the lattice", bytemuck::cast_slice(&nodes)].concat();
        let error = || self.relative_error(elastic, COARSER * cell, &nodes).map(|relative| vec![relative]).ok_or(());
        let relative = *Cache::numbers(&key, error).ok()?.first()?;
        Some(LatticeError { cell, relative, suitable: self.suitable_cell })
    }

    /// The same around `nodes`, from cubes of the size `coarser` (m), relative to the compliance (1).
    fn relative_error(&self, elastic: &ElasticSpec, coarser: f64, nodes: &[u32]) -> Option<f64> {
        let material = Material::Elastic(ElasticSpec { cell: Some(coarser), ..elastic.clone() });
        let spec = ObjectSpec { material, ..self.spec.clone() };
        let coarser = Self { spec, mechanics: OnceLock::new(), ..self.clone() };
        let radius = RADIUS * topology::mean_edge(&self.rest, &self.triangles);
        let forces: Vec<_> = nodes.iter().map(|&node| self.pressure(node as usize, radius)).collect();
        let [own, coarser] = [self, &coarser].map(|object| object.works(&forces).ok());
        let error = |(own, coarser): (f64, f64)| INDEX * (coarser / own - 1.0).abs();
        let mut errors: Vec<f64> = own?.into_iter().zip(coarser?).map(error).collect();
        errors.sort_unstable_by(f64::total_cmp);
        Some(errors[errors.len() / 2])
    }

    /// Forces on the surface's nodes of the pressure `(1 - r^2/a^2)^2` around `node`, a being `radius` (m), on the side
    /// that faces as `node` does: all around a body smaller than that, pressure would only squeeze it.
    fn pressure(&self, node: usize, radius: f64) -> Vec<DVec3> {
        let middle = self.rest[node];
        let corners = |triangle: &[u32; 3]| triangle.map(|node| self.rest[node as usize]);
        let area = |[a, b, c]: [DVec3; 3]| (b - a).cross(c - a);
        let own = self.triangles.iter().filter(|triangle| triangle.contains(&(node as u32)));
        let outward: DVec3 = own.map(|triangle| area(corners(triangle))).sum();
        let mut forces = vec![DVec3::ZERO; self.surface_nodes];
        for triangle in &self.triangles {
            let area = area(corners(triangle));
            if area.dot(outward) <= 0.0 {
                continue;
            }
            for &node in triangle {
                let squared = self.rest[node as usize].distance_squared(middle) / (radius * radius);
                forces[node as usize] -= (1.0 - squared).max(0.0).powi(2) * area;
            }
        }
        forces
    }

    /// Work of each of `forces` on the surface's nodes along the displacement that it causes (J), this being a solid: its
    /// matrix has three rows a node.
    fn works(&self, forces: &[Vec<DVec3>]) -> Result<Vec<f64>, Error> {
        let Mechanics { moved, attachment, factor, .. } = self.mechanics()?;
        let column = |forces: &Vec<DVec3>| {
            let mut loads = vec![DVec3::ZERO; moved.len()];
            attachment.spread(forces, &mut loads);
            let numbers = loads.iter().flat_map(|load| load.to_array());
            numbers.enumerate().filter(|(_, load)| *load != 0.0).collect()
        };
        let columns: Vec<Vec<(usize, f64)>> = forces.iter().map(column).collect();
        Ok(factor.condensed(&columns).into_iter().step_by(columns.len() + 1).collect())
    }
}
