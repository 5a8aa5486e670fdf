//! Hexahedra, prisms and pyramids of a Gmsh file, divided into tetrahedra.
//!
//! From the corner of the least number, tetrahedra are drawn to the faces that it is not part of; a face of four corners
//! is halved from its own corner of the least number. The faces of that first corner are then halved from it, so that
//! two elements halve the face between them alike (Dompierre, Labbé, Vallet & Camarero, How to subdivide pyramids,
//! prisms, and hexahedra into tetrahedra, 1999). Any hexahedron makes six, a prism three, a pyramid two.
//!
//! In second order the new edges have their middles where the curved element has them: in the middle of a face, which
//! its own nodes alone determine, or of a hexahedron.

use crate::object::element::TETRAHEDRON_EDGES;

/// A shape of volume elements, in Gmsh's order of nodes.
#[derive(Debug)]
struct Shape {
    corners: usize,
    /// In the middle of each lies a node in second order; these follow the corners.
    edges: &'static [[usize; 2]],
    /// Faces seen from outside, counter-clockwise. Those of four corners have nodes in this order in complete elements.
    faces: &'static [&'static [usize]],
}

const TETRAHEDRON: Shape = Shape { corners: 4, edges: &TETRAHEDRON_EDGES, faces: &[] };

const HEXAHEDRON: Shape = Shape {
    corners: 8,
    edges: &[[0, 1], [0, 3], [0, 4], [1, 2], [1, 5], [2, 3], [2, 6], [3, 7], [4, 5], [4, 7], [5, 6], [6, 7]],
    faces: &[&[0, 3, 2, 1], &[0, 1, 5, 4], &[0, 4, 7, 3], &[1, 2, 6, 5], &[2, 3, 7, 6], &[4, 5, 6, 7]],
};

const PRISM: Shape = Shape {
    corners: 6,
    edges: &[[0, 1], [0, 2], [0, 3], [1, 2], [1, 4], [2, 5], [3, 4], [3, 5], [4, 5]],
    faces: &[&[0, 1, 4, 3], &[0, 3, 5, 2], &[1, 2, 5, 4], &[0, 2, 1], &[3, 4, 5]],
};

const PYRAMID: Shape = Shape {
    corners: 5,
    edges: &[[0, 1], [0, 3], [0, 4], [1, 2], [1, 4], [2, 3], [2, 4], [3, 4]],
    faces: &[&[0, 3, 2, 1], &[0, 1, 4], &[1, 2, 4], &[2, 3, 4], &[3, 0, 4]],
};

/// A type of elements that is read.
#[derive(Clone, Copy, Debug)]
pub(super) struct Kind {
    shape: &'static Shape,
    /// Nodes of each.
    pub nodes: usize,
}

/// A node in the middle of two corners.
pub(super) enum Middle {
    /// It is there: the number of a node.
    Node(u32),
    /// It lies between these two corners, where the sum of these nodes with their weights is.
    Sum([u32; 2], Vec<(u32, f64)>),
}

impl Kind {
    /// Gmsh's type `kind`, if it is one of first or second order that is read.
    pub fn of(kind: u64) -> Option<Self> {
        let (shape, nodes) = match kind {
            4 => (&TETRAHEDRON, 4),
            11 => (&TETRAHEDRON, 10),
            5 => (&HEXAHEDRON, 8),
            12 => (&HEXAHEDRON, 27),
            17 => (&HEXAHEDRON, 20),
            6 => (&PRISM, 6),
            13 => (&PRISM, 18),
            18 => (&PRISM, 15),
            7 => (&PYRAMID, 5),
            14 => (&PYRAMID, 14),
            19 => (&PYRAMID, 13),
            _ => return None,
        };
        Some(Self { shape, nodes })
    }

    /// Whether it has nodes in the middles of its edges.
    pub fn is_second_order(self) -> bool {
        self.nodes > self.shape.corners
    }

    /// The tetrahedra of an element, of positive volume where it has, as its own corners. `nodes`: its nodes.
    pub fn tetrahedra(self, nodes: &[u32]) -> Vec<[usize; 4]> {
        if self.shape.faces.is_empty() {
            return vec![[0, 1, 2, 3]];
        }
        let least = |corners: &[usize]| (0..corners.len()).min_by_key(|&k| nodes[corners[k]]).unwrap_or_default();
        let all: Vec<usize> = (0..self.shape.corners).collect();
        let first = least(&all);
        let opposite = self.shape.faces.iter().filter(|face| !face.contains(&first));
        let halves = |face: &&'static [usize]| {
            let (face, n) = (*face, face.len());
            let start = least(face);
            (1..n - 1).map(move |k| [face[start], face[(start + k) % n], face[(start + k + 1) % n]])
        };
        opposite.flat_map(halves).map(|[a, b, c]| [first, a, b, c]).collect()
    }

    /// What lies in the middle of two corners of an element in second order. `nodes`: its nodes.
    pub fn middle(self, nodes: &[u32], ends: [usize; 2]) -> Middle {
        let Shape { corners, edges, faces, .. } = self.shape;
        let joins = |edge: &[usize; 2]| edge.contains(&ends[0]) && edge.contains(&ends[1]);
        if let Some(edge) = edges.iter().position(joins) {
            return Middle::Node(nodes[corners + edge]);
        }
        let mut squares = faces.iter().filter(|face| face.len() == 4);
        let face = squares.clone().position(|face| ends.iter().all(|end| face.contains(end)));
        let own = face.unwrap_or(squares.clone().count());
        if let Some(&node) = nodes.get(corners + edges.len() + own) {
            return Middle::Node(node);
        }
        // The serendipity element's shape functions in the middle of a face, or of the hexahedron.
        let all: Vec<usize> = (0..*corners).collect();
        let (around, weight) = match face.and_then(|face| squares.nth(face)) {
            Some(face) => (*face, 0.5),
            None => (&all[..], 0.25),
        };
        let inner = edges.iter().enumerate().filter(|(_, edge)| edge.iter().all(|end| around.contains(end)));
        let corners = around.iter().map(|&corner| (nodes[corner], -0.25));
        let sum = corners.chain(inner.map(|(edge, _)| (nodes[self.shape.corners + edge], weight))).collect();
        Middle::Sum(ends.map(|end| nodes[end]), sum)
    }
}
