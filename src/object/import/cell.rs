//! Types of cells, as files number them, and the division of volume cells into tetrahedra.
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

impl Shape {
    /// The tetrahedra of a cell, of positive volume where it has, as its own corners. `nodes`: its nodes.
    fn tetrahedra(&self, nodes: &[u32]) -> Vec<[usize; 4]> {
        if self.faces.is_empty() {
            return vec![[0, 1, 2, 3]];
        }
        let least = |corners: &[usize]| (0..corners.len()).min_by_key(|&k| nodes[corners[k]]).unwrap_or_default();
        let all: Vec<usize> = (0..self.corners).collect();
        let first = least(&all);
        let opposite = self.faces.iter().filter(|face| !face.contains(&first));
        let halves = |face: &&'static [usize]| {
            let (face, n) = (*face, face.len());
            let start = least(face);
            (1..n - 1).map(move |k| [face[start], face[(start + k) % n], face[(start + k + 1) % n]])
        };
        opposite.flat_map(halves).map(|[a, b, c]| [first, a, b, c]).collect()
    }
}

/// What cells of a type are to a mesh.
#[derive(Debug)]
enum Form {
    /// Points, lines, and faces with nodes beside their corners: read past, for a solid has its own boundary.
    Other,
    /// A face, by its corners.
    Face,
    /// Triangles, each of which shares two corners with the one before.
    Strip,
    /// A part of a solid.
    Volume(&'static Shape),
}

/// A type of cells.
#[derive(Debug)]
pub(super) struct CellType {
    /// In the plural.
    pub name: &'static str,
    /// Its number in Gmsh files and in VTK files.
    gmsh: Option<u64>,
    vtk: Option<u64>,
    /// Nodes of each; `None` where these differ.
    pub nodes: Option<usize>,
    form: Form,
    /// Which of its nodes in VTK's order is each in Gmsh's; empty where both are the same.
    vtk_order: &'static [usize],
}

const fn cell(
    name: &'static str,
    [gmsh, vtk]: [u64; 2],
    nodes: usize,
    form: Form,
    vtk_order: &'static [usize],
) -> CellType {
    const fn number(number: u64) -> Option<u64> {
        if number == 0 { None } else { Some(number) }
    }
    let nodes = if nodes == 0 { None } else { Some(nodes) };
    CellType { name, gmsh: number(gmsh), vtk: number(vtk), nodes, form, vtk_order }
}

/// Every type that is known: numbers of Gmsh (reference manual, MSH file format) and of VTK (vtkCellType.h), nodes of
/// each, and the order of nodes (VTK file formats, Figures 2 and 3; vtkTriQuadraticHexahedron.h). Zero is none.
#[rustfmt::skip]
static CELLS: [CellType; 25] = [
    cell("points", [15, 1], 1, Form::Other, &[]),
    cell("points", [0, 2], 0, Form::Other, &[]),
    cell("lines", [1, 3], 2, Form::Other, &[]),
    cell("lines", [0, 4], 0, Form::Other, &[]),
    cell("curved lines", [8, 21], 3, Form::Other, &[]),
    cell("triangles", [2, 5], 3, Form::Face, &[]),
    cell("strips", [0, 6], 0, Form::Strip, &[]),
    cell("polygons", [0, 7], 0, Form::Face, &[]),
    cell("pixels", [0, 8], 4, Form::Face, &[0, 1, 3, 2]),
    cell("quadrangles", [3, 9], 4, Form::Face, &[]),
    cell("curved triangles", [9, 22], 6, Form::Other, &[]),
    cell("curved quadrangles", [16, 23], 8, Form::Other, &[]),
    cell("curved quadrangles", [10, 28], 9, Form::Other, &[]),
    cell("tetrahedra", [4, 10], 4, Form::Volume(&TETRAHEDRON), &[]),
    cell("tetrahedra", [11, 24], 10, Form::Volume(&TETRAHEDRON), &[0, 1, 2, 3, 4, 5, 6, 7, 9, 8]),
    cell("voxels", [0, 11], 8, Form::Volume(&HEXAHEDRON), &[0, 1, 3, 2, 4, 5, 7, 6]),
    cell("hexahedra", [5, 12], 8, Form::Volume(&HEXAHEDRON), &[]),
    cell("hexahedra", [17, 25], 20, Form::Volume(&HEXAHEDRON),
        &[0, 1, 2, 3, 4, 5, 6, 7, 8, 11, 16, 9, 17, 10, 18, 19, 12, 15, 13, 14]),
    cell("hexahedra", [12, 29], 27, Form::Volume(&HEXAHEDRON),
        &[0, 1, 2, 3, 4, 5, 6, 7, 8, 11, 16, 9, 17, 10, 18, 19, 12, 15, 13, 14, 24, 22, 20, 21, 23, 25, 26]),
    cell("prisms", [6, 13], 6, Form::Volume(&PRISM), &[]),
    cell("prisms", [18, 26], 15, Form::Volume(&PRISM), &[0, 1, 2, 3, 4, 5, 6, 8, 12, 7, 13, 14, 9, 11, 10]),
    cell("prisms", [13, 32], 18, Form::Volume(&PRISM),
        &[0, 1, 2, 3, 4, 5, 6, 8, 12, 7, 13, 14, 9, 11, 10, 15, 17, 16]),
    cell("pyramids", [7, 14], 5, Form::Volume(&PYRAMID), &[]),
    cell("pyramids", [19, 27], 13, Form::Volume(&PYRAMID), &[0, 1, 2, 3, 4, 5, 8, 9, 6, 10, 7, 11, 12]),
    cell("pyramids", [14, 0], 14, Form::Volume(&PYRAMID), &[]),
];

/// What a cell is made of.
pub(super) enum Parts {
    /// Nothing that is read.
    None,
    /// Faces, by their corners.
    Faces(Vec<Vec<u32>>),
    /// Tetrahedra of positive volume where the cell has, by the numbers of its own corners.
    Tetrahedra(Vec<[usize; 4]>),
}

/// A node in the middle of two corners.
pub(super) enum Middle {
    /// It is there: the number of a node.
    Node(u32),
    /// It lies between these two corners, where the sum of these nodes with their weights is.
    Sum([u32; 2], Vec<(u32, f64)>),
}

impl CellType {
    /// The type of this number in Gmsh files.
    pub fn of_gmsh(number: u64) -> Option<&'static Self> {
        CELLS.iter().find(|cell| cell.gmsh == Some(number))
    }

    /// The type of this number in VTK files.
    pub fn of_vtk(number: u64) -> Option<&'static Self> {
        CELLS.iter().find(|cell| cell.vtk == Some(number))
    }

    /// The nodes of a cell of a VTK file in Gmsh's order; as they are where there are not as many as it has.
    pub fn ordered(&self, nodes: &[u32]) -> Vec<u32> {
        if self.vtk_order.len() == nodes.len() {
            self.vtk_order.iter().map(|&node| nodes[node]).collect()
        } else {
            nodes.to_vec()
        }
    }

    /// What a cell is made of, if that is known. `nodes`: its nodes, as many as the type has.
    pub fn parts(&self, nodes: &[u32]) -> Parts {
        match self.form {
            Form::Other => Parts::None,
            Form::Face => Parts::Faces(vec![nodes.to_vec()]),
            Form::Strip => Parts::Faces(strip(nodes)),
            Form::Volume(shape) => Parts::Tetrahedra(shape.tetrahedra(nodes)),
        }
    }

    /// Whether it has nodes in the middles of its edges.
    pub fn is_second_order(&self) -> bool {
        matches!(self.form, Form::Volume(shape) if self.nodes.is_some_and(|nodes| nodes > shape.corners))
    }

    /// What lies in the middle of two corners of an element in second order. `nodes`: its nodes.
    pub fn middle(&self, nodes: &[u32], ends: [usize; 2]) -> Middle {
        let Form::Volume(Shape { corners, edges, faces }) = self.form else {
            return Middle::Sum(ends.map(|end| nodes[end]), Vec::new());
        };
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
        let first = *corners;
        // The serendipity element's shape functions in the middle of a face, or of the hexahedron.
        let all: Vec<usize> = (0..*corners).collect();
        let (around, weight) = match face.and_then(|face| squares.nth(face)) {
            Some(face) => (*face, 0.5),
            None => (&all[..], 0.25),
        };
        let inner = edges.iter().enumerate().filter(|(_, edge)| edge.iter().all(|end| around.contains(end)));
        let corners = around.iter().map(|&corner| (nodes[corner], -0.25));
        let sum = corners.chain(inner.map(|(edge, _)| (nodes[first + edge], weight))).collect();
        Middle::Sum(ends.map(|end| nodes[end]), sum)
    }
}

/// The triangles of a strip, each of which shares two corners with the one before: every second one is turned round.
pub(super) fn strip(corners: &[u32]) -> Vec<Vec<u32>> {
    let triangle = |(k, c): (usize, &[u32])| if k % 2 == 0 { c.to_vec() } else { vec![c[1], c[0], c[2]] };
    corners.windows(3).enumerate().map(triangle).collect()
}

/// The triangles of a fan, which share their first corner.
pub(super) fn fan(corners: &[u32]) -> Vec<Vec<u32>> {
    corners.windows(2).skip(1).map(|pair| vec![corners[0], pair[0], pair[1]]).collect()
}
