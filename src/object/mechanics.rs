//! What an object's nodes resist by: the matrix K with its factor, the nodes that it moves, and their masses.

use super::{
    Attachment, Factor, Object, Stiffness, attachment, check_count,
    factor::prove_positive_definite,
    ground::{self, Held},
    inclusion::Materials,
    lattice::Lattice,
    ordering,
    skin::Laplacian,
    solid::{self, Elements},
    springs,
    tetrahedra::Tetrahedra,
    topology::mean_edge,
};
use crate::{
    Error,
    scene::{GroundStiffness, Material},
};
use glam::DVec3;

/// K and what belongs to it.
///
/// K moves nodes of its own, those of the finite elements of an elastic solid, which the object's nodes follow by
/// [`Attachment`]; on springs and skins the two are the same.
#[derive(Debug)]
pub struct Mechanics {
    /// Rest positions of the nodes of K (m).
    pub moved: Vec<DVec3>,
    /// N: how the object's nodes follow those of K.
    pub attachment: Attachment,
    /// K = Kn + Kg over its nodes, the skin's included (N/m).
    pub stiffness: Stiffness,
    /// Cholesky factor of K.
    pub factor: Factor,
    /// Mass of each node of K (kg).
    pub mass: Vec<f64>,
    /// Damping of each node of K against the ground (N s/m).
    pub damping: Vec<f64>,
}

impl Mechanics {
    /// Those of `object`, as its specification says.
    ///
    /// # Errors
    /// When K is not positive definite, an element or an inclusion is empty, or there is no memory.
    pub(super) fn new(object: &Object) -> Result<Self, Error> {
        let spec = &object.spec;
        let shell = &object.rest[..object.surface_nodes];
        let edge = mean_edge(shell, &object.triangles);
        let mut points = Vec::new();
        let elastic = match &spec.material {
            Material::Elastic(elastic) => Some((elastic, Materials::new(elastic, shell))),
            _ => None,
        };
        let elements: Option<Box<dyn Elements>> = match &elastic {
            Some((elastic, materials)) if object.tetrahedra.is_empty() => {
                let cell = elastic.cell.unwrap_or_default();
                let (lattice, on_surface) = Lattice::fill(cell, (shell, &object.triangles), materials)?;
                points = on_surface;
                Some(Box::new(lattice))
            }
            Some(_) => Some(Box::new(Tetrahedra::new(object))),
            None => None,
        };
        let elements = elements.as_deref();
        if points.is_empty() {
            points = attachment::surface_points(shell, &object.triangles, f64::INFINITY);
        }
        let nodes = object.rest.len();
        let (moved, attachment) = match elements {
            Some(elements) => {
                let moved = elements.positions().to_vec();
                check_count(moved.len()).map_err(|error| error.about("object.elasticity.cell"))?;
                let rows = [object.surface_nodes, nodes - object.surface_nodes, moved.len()];
                let attachment = Attachment::averaged(&points, rows, |point| {
                    let (element, values) = elements.locate(point);
                    (elements.nodes(element), values)
                });
                (moved, attachment)
            }
            None => (object.rest.clone(), Attachment::identity(nodes)),
        };
        let edges = match &spec.material {
            Material::Springs(_) => springs::edges(object)?,
            Material::Elastic(_) | Material::Hollow => Vec::new(),
        };
        let laplacian = spec.skin.map(|skin| (skin, Laplacian::new(shell, &object.triangles)));
        let grounded = spec.ground.as_ref().map(|ground| ground::select(ground, &object.rest)).transpose()?;
        let mut cliques: Vec<Vec<u32>> = edges.iter().map(|ends| ends.to_vec()).collect();
        cliques.extend(elements.into_iter().flat_map(|e| (0..e.count()).map(|element| e.nodes(element).to_vec())));
        cliques.extend(laplacian.iter().flat_map(|(skin, laplacian)| laplacian.cliques(*skin, &attachment)));
        if spec.ground.as_ref().is_some_and(|ground| matches!(ground.stiffness, GroundStiffness::PerNode(_))) {
            let held = grounded.iter().flatten().enumerate().filter(|(_, held)| **held);
            cliques.extend(held.map(|(node, _)| attachment.row(node).iter().map(|(column, _)| *column).collect()));
        }
        let mut stiffness = Stiffness::with_pattern(moved.len(), &cliques);
        drop(cliques);
        stiffness.ordering = ordering::nested_dissection(&stiffness, &moved);
        let mut share = vec![1.0 / moved.len() as f64; moved.len()];
        if let Material::Springs(springs) = &spec.material {
            springs::add(spec, *springs, &moved, &edges, &mut stiffness)?;
        }
        if let (Some((_, materials)), Some(elements)) = (&elastic, elements) {
            share = solid::add(elements, materials, &mut stiffness)?;
        }
        let young = elastic.map_or(0.0, |(elastic, _)| elastic.young);
        let held =
            Held { points: &points, attachment: &attachment, solid: elements.map(|elements| (elements, young)), edge };
        for (ground, grounded) in spec.ground.iter().zip(&grounded) {
            held.add(ground, grounded, &mut stiffness);
        }
        laplacian.iter().for_each(|(skin, laplacian)| laplacian.add(*skin, &attachment, &mut stiffness));
        let factor = prove_positive_definite(&stiffness, &moved)?;
        Ok(Self {
            mass: share.iter().map(|share| spec.node_mass * nodes as f64 * share).collect(),
            damping: share.iter().map(|share| spec.node_damping * nodes as f64 * share).collect(),
            moved,
            attachment,
            stiffness,
            factor,
        })
    }

    /// Displacements of the object's nodes at rest under `forces`, one for each of them (N; m).
    #[must_use]
    pub fn displacement_under(&self, forces: &[DVec3]) -> Vec<DVec3> {
        let mut displacement = vec![DVec3::ZERO; self.moved.len()];
        self.attachment.spread(forces, &mut displacement);
        self.factor.solve(&mut displacement);
        (0..self.attachment.rows()).map(|node| self.attachment.follow(node, &displacement)).collect()
    }
}
