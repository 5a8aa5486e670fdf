//! Elastic solids: lattices in closed surfaces and tetrahedra from Gmsh files, against closed forms, converged solutions
//! of other programs, and contracts.

mod accuracy;
mod bodies;
mod cells;
mod convergence;
mod fitted;
mod formats;
mod gmsh;
mod indentation;
mod lattice;

use crate::common::cubes::{Shell, cubes};
use glam::{DMat3, DVec3};
use haptize::object::Object;
use haptize::scene::{ElasticSpec, GroundNodes, GroundSpec, GroundStiffness, Material, ObjectSpec, Placement, Shape};

const YOUNG: f64 = 1e5;

fn spec(shape: Shape, material: Material, ground: GroundSpec) -> ObjectSpec {
    ObjectSpec { shape, material, skin: None, ground: Some(ground), node_mass: 0.01, node_damping: 0.1 }
}

fn elastic(poisson: f64, cell: Option<f64>) -> Material {
    Material::Elastic(ElasticSpec { young: YOUNG, poisson, cell, inclusions: Vec::new() })
}

/// A ground of `k` per area (N/m^3) on all of the surface.
fn bed(k: f64) -> GroundSpec {
    GroundSpec { stiffness: GroundStiffness::PerArea(k), nodes: GroundNodes::All }
}

/// The surface is clamped below z = `height` (m).
fn clamped(height: f64) -> GroundSpec {
    GroundSpec { stiffness: GroundStiffness::Clamp, nodes: GroundNodes::Below(height) }
}

/// A box of `counts` squares of `edge` (m) on its sides, the middle of its underside at the origin.
fn block(counts: [i32; 3], edge: f64) -> Shell {
    let (nodes, triangles) = cubes(counts, edge, |_| true);
    let middle = 0.5 * edge * DVec3::new(f64::from(counts[0]), f64::from(counts[1]), 0.0);
    (nodes.into_iter().map(|node| node - middle).collect(), triangles)
}

/// The object of `material` and `ground` in the surface, turned by `turn` and then shifted by `shift`.
fn solid((nodes, triangles): Shell, material: Material, ground: GroundSpec, turn: DMat3, shift: DVec3) -> Object {
    let shape = Shape::Mesh { file: "body".into(), placement: Placement::METRES, refine: None };
    let nodes = nodes.into_iter().map(|node| turn * node + shift).collect();
    Object::from_surface(&spec(shape, material, ground), nodes, triangles).unwrap()
}

/// Own area of each surface node (m^2), and the outward normal there.
fn own_areas(object: &Object) -> Vec<DVec3> {
    let mut areas = vec![DVec3::ZERO; object.surface_nodes];
    for triangle in &object.triangles {
        let [a, b, c] = triangle.map(|node| object.rest[node as usize]);
        triangle.iter().for_each(|&node| areas[node as usize] += (b - a).cross(c - a) / 6.0);
    }
    areas
}

/// Displacements of the object's nodes (m) under `forces` on them (N).
fn displaced(object: &Object, forces: &[DVec3]) -> Vec<DVec3> {
    let mut loads = vec![DVec3::ZERO; object.mechanics().unwrap().moved.len()];
    object.mechanics().unwrap().attachment.spread(forces, &mut loads);
    object.mechanics().unwrap().factor.solve(&mut loads);
    (0..object.rest.len()).map(|node| object.mechanics().unwrap().attachment.follow(node, &loads)).collect()
}

/// Elastic energy under a displacement of the nodes of K (J).
fn energy(object: &Object, u: impl Fn(DVec3) -> DVec3) -> f64 {
    let displacement: Vec<DVec3> = object.mechanics().unwrap().moved.iter().map(|x| u(*x)).collect();
    object.mechanics().unwrap().stiffness.energy(&displacement)
}

/// Turn by 30 degrees around (1, 1, 1).
fn turned() -> DMat3 {
    DMat3::from_axis_angle(DVec3::ONE.normalize(), 30_f64.to_radians())
}
