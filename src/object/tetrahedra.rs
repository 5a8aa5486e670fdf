//! Tetrahedra of ten nodes from a mesh of such or of four nodes.
//!
//! A tetrahedron of four nodes is straight: nodes in the middles of its edges raise it to the second order. Ten nodes
//! of a file may lie on a curved surface; place and displacement then have the same shape functions (isoparametric).

use super::Object;
use super::attachment::SurfacePoint;
use super::element::{GAUSS, Lame, Quadrature, TETRAHEDRON_EDGES, TETRAHEDRON_NODES, tetrahedron as shape_functions};
use super::inclusion::Materials;
use super::solid::Elements;
use crate::{Error, error};
use glam::{DMat3, DVec3, DVec4};
use std::collections::HashMap;

/// Faces of a tetrahedron of positive volume, counter-clockwise seen from outside.
pub(super) const FACES: [[usize; 3]; 4] = [[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]];

/// Smallest determinant of a tetrahedron's shape over the cube of its longest edge (1). Coordinates in single precision
/// round at 6e-8 of their size: below it, the sign of a volume would be a matter of luck.
const MIN_TETRAHEDRON_ASPECT: f64 = 6e-6;

/// Barycentric coordinates of the four points that are exact for quadratic functions: one of these, three of the other.
const FOUR_POINTS: [f64; 2] = [0.585_410_196_624_968_5, 0.138_196_601_125_010_5];

/// The elements of a mesh of tetrahedra.
pub(super) struct Tetrahedra {
    /// Nodes of the body, then those in the middles of straight edges (m).
    nodes: Vec<DVec3>,
    elements: Vec<[u32; TETRAHEDRON_NODES]>,
    regions: Vec<u32>,
    is_curved: bool,
    /// Element of each triangle of the surface, and the barycentric coordinates in it of the triangle's corners.
    faces: Vec<(u32, [DVec4; 3])>,
}

/// Signed volume: a sixth of (b - a) . ((c - a) x (d - a)) (m^3).
pub(super) fn volume([a, b, c, d]: [DVec3; 4]) -> f64 {
    (b - a).dot((c - a).cross(d - a)) / 6.0
}

/// The triangles of the face between three nodes of a tetrahedron: with nodes in the middles of its edges four.
pub(super) fn face_triangles(face: [usize; 3], is_curved: bool) -> Vec<[usize; 3]> {
    if !is_curved {
        return vec![face];
    }
    let middle = |a: usize, b: usize| {
        let edge = TETRAHEDRON_EDGES.iter().position(|edge| edge.contains(&a) && edge.contains(&b));
        4 + edge.unwrap_or_default()
    };
    let [a, b, c] = face;
    let [ab, bc, ca] = [middle(a, b), middle(b, c), middle(c, a)];
    vec![[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]
}

impl Tetrahedra {
    /// The elements of `object`.
    pub fn new(object: &Object) -> Self {
        let is_curved = !object.mid_nodes.is_empty();
        let mut nodes = object.rest.clone();
        let mut middles: HashMap<[u32; 2], u32> = HashMap::new();
        let elements = object.tetrahedra.iter().enumerate().map(|(number, corners)| {
            let mut element = [0; TETRAHEDRON_NODES];
            element[..4].copy_from_slice(corners);
            if let Some(middles) = object.mid_nodes.get(number) {
                element[4..].copy_from_slice(middles);
                return element;
            }
            for (m, ends) in TETRAHEDRON_EDGES.into_iter().enumerate() {
                let [a, b] = ends.map(|end| corners[end]);
                element[4 + m] = *middles.entry([a.min(b), a.max(b)]).or_insert_with(|| {
                    nodes.push(nodes[a as usize].midpoint(nodes[b as usize]));
                    nodes.len() as u32 - 1
                });
            }
            element
        });
        let elements: Vec<[u32; TETRAHEDRON_NODES]> = elements.collect();
        let mut owners: HashMap<[u32; 3], u32> = HashMap::new();
        for (element, number) in elements.iter().zip(0..) {
            for triangle in FACES.into_iter().flat_map(|face| face_triangles(face, is_curved)) {
                let mut key = triangle.map(|node| element[node]);
                key.sort_unstable();
                owners.insert(key, number);
            }
        }
        let faces = object.triangles.iter().map(|triangle| {
            let mut key = *triangle;
            key.sort_unstable();
            let owner = owners.get(&key).copied().unwrap_or_default();
            let element = &elements[owner as usize];
            let local = |node: u32| element.iter().position(|other| *other == node).unwrap_or_default();
            (owner, triangle.map(|node| barycentric(local(node))))
        });
        let faces = faces.collect();
        Self { nodes, elements, regions: object.regions.clone(), is_curved, faces }
    }

    fn region(&self, element: usize) -> Option<u32> {
        self.regions.get(element).copied()
    }

    /// Adds the point at the barycentric coordinates `at`; `weight` is a part of the volume of an element with straight
    /// edges. Returns whether the element is proper there.
    fn push(&self, quadrature: &mut Quadrature, element: usize, at: DVec4, weight: f64) -> bool {
        let places = self.elements[element].map(|node| self.nodes[node as usize]);
        let (values, derivatives) = shape_functions(at.to_array());
        // The four coordinates add up to one: derivatives by the last three.
        let slopes = derivatives.map(|d| DVec3::new(d.y - d.x, d.z - d.x, d.w - d.x));
        let place = places.iter().zip(&values).map(|(place, value)| *value * *place).sum();
        let column = |k: usize| places.iter().zip(&slopes).map(|(place, slope)| slope[k] * *place).sum::<DVec3>();
        let jacobian = DMat3::from_cols(column(0), column(1), column(2));
        let determinant = jacobian.determinant();
        let inverse = jacobian.inverse().transpose();
        quadrature.push(place, weight * determinant / 6.0, &values, &slopes.map(|slope| inverse * slope), DVec4::W);
        let longest = (0..4).flat_map(|a| (0..a).map(move |b| places[a].distance(places[b]))).fold(0.0, f64::max);
        determinant > MIN_TETRAHEDRON_ASPECT * longest.powi(3)
    }
}

/// Barycentric coordinates of a node of an element.
fn barycentric(node: usize) -> DVec4 {
    match node.checked_sub(4) {
        None => DVec4::AXES[node],
        Some(edge) => {
            let [a, b] = TETRAHEDRON_EDGES[edge];
            0.5 * (DVec4::AXES[a] + DVec4::AXES[b])
        }
    }
}

/// Barycentric coordinates and weights of points in a tetrahedron: for a curved one 27, those of a cube collapsed to
/// it.
fn points(is_curved: bool) -> Vec<(DVec4, f64)> {
    if !is_curved {
        let [one, other] = FOUR_POINTS;
        return DVec4::AXES.map(|axis| (DVec4::splat(other) + (one - other) * axis, 0.25)).into();
    }
    let triples = GAUSS.into_iter().flat_map(|x| GAUSS.into_iter().flat_map(move |y| GAUSS.map(|z| [x, y, z])));
    let collapsed = |[[x, wx], [y, wy], [z, wz]]: [[f64; 2]; 3]| {
        let (beside, behind) = (1.0 - x, (1.0 - x) * (1.0 - y));
        let at = DVec4::new(x, beside * y, behind * z, behind * (1.0 - z));
        (at, 6.0 * wx * wy * wz * beside * behind)
    };
    triples.map(collapsed).collect()
}

impl Elements for Tetrahedra {
    fn positions(&self) -> &[DVec3] {
        &self.nodes
    }

    fn count(&self) -> usize {
        self.elements.len()
    }

    fn nodes(&self, element: usize) -> &[u32] {
        &self.elements[element]
    }

    fn quadrature(&self, element: usize, materials: &Materials<'_>) -> Result<(Quadrature, Vec<Lame>), Error> {
        let mut quadrature = Quadrature::default();
        let corners = [0, 1, 2, 3].map(|k| self.elements[element][k]);
        let places = corners.map(|corner| self.nodes[corner as usize]);
        let [low, high] = [DVec3::min, DVec3::max].map(|pick| places.into_iter().reduce(pick).unwrap_or_default());
        // What a sphere cuts needs more points, as what is curved does.
        let is_cut = materials.cut([low, high]).is_some();
        for (at, weight) in points(self.is_curved || is_cut) {
            let is_proper = self.push(&mut quadrature, element, at, weight);
            if !is_proper {
                return Err(error!(
                    "tetrahedron {element} (nodes {corners:?}, surface nodes counted first) has no volume: mesh the solid anew"
                ));
            }
        }
        let region = self.region(element);
        let own: Vec<Lame> = quadrature.places.iter().map(|place| materials.at(*place, region)).collect();
        let mean = is_cut.then(|| materials.stiff_mean(quadrature.points(), region)).flatten();
        let lame = mean.map_or(own, |mean| vec![mean; quadrature.places.len()]);
        Ok((quadrature, lame))
    }

    fn kind(&self, _: usize, _: &Materials<'_>) -> Option<usize> {
        None
    }

    fn below(&self, element: usize, height: f64) -> Quadrature {
        let mut quadrature = Quadrature::default();
        for (at, weight) in points(true) {
            self.push(&mut quadrature, element, at, weight);
        }
        quadrature.keep(|place| place.z < height);
        quadrature
    }

    fn locate(&self, point: &SurfacePoint) -> (usize, Vec<f64>) {
        let (element, corners) = self.faces[point.triangle];
        let at = (0..3).map(|k| point.weights[k] * corners[k]).sum::<DVec4>();
        (element as usize, shape_functions(at.to_array()).0.to_vec())
    }
}
