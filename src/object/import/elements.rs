//! Nodes and cells of a mesh file as they come: what becomes of them is the same in every format that has cells.
//!
//! Cells of solids become tetrahedra, of first or second order; faces are a surface where there is no solid. A cell that
//! is written once for each group that holds it counts once.

use super::{
    Mesh,
    cell::{CellType, Middle, Parts},
    check_coordinates, node_number, polygon,
};
use crate::names::counted;
use crate::object::element::TETRAHEDRON_EDGES;
use glam::DVec3;
use std::collections::{BTreeMap, HashMap, HashSet};

/// Nodes, faces and tetrahedra of a file.
pub(super) struct Elements<'a> {
    pub nodes: Vec<DVec3>,
    /// Corners of all faces, and where each ends among them.
    face_corners: Vec<u32>,
    face_ends: Vec<usize>,
    tetrahedra: Vec<[u32; 4]>,
    /// As in [`Mesh`]; as many as there are tetrahedra, or none.
    mid_nodes: Vec<[u32; 6]>,
    regions: Vec<u32>,
    /// Numbers of tetrahedra, by their corners in ascending order.
    numbers: HashMap<[u32; 4], usize>,
    /// Nodes in the middles of edges that a division has made, by the ends of these in ascending order.
    middles: HashMap<[u32; 2], u32>,
    /// Cells that are not read, by what they are called: those that bound solids, and parts of solids.
    others: [BTreeMap<String, usize>; 2],
    /// Regions that the scene names, the one that counts before others last.
    pub wanted: &'a [u32],
}

impl<'a> Elements<'a> {
    pub fn new(wanted: &'a [u32]) -> Self {
        Self {
            nodes: Vec::new(),
            face_corners: Vec::new(),
            face_ends: Vec::new(),
            tetrahedra: Vec::new(),
            mid_nodes: Vec::new(),
            regions: Vec::new(),
            numbers: HashMap::new(),
            middles: HashMap::new(),
            others: Default::default(),
            wanted,
        }
    }

    /// Adds a cell of type `of` between `nodes`, which are there already, in Gmsh's order; `region` 0 is none.
    pub fn add(&mut self, of: &CellType, nodes: &[u32], region: u32) -> Result<(), String> {
        if let Some(count) = of.nodes.filter(|count| *count != nodes.len()) {
            return Err(format!(
                "one of the {} has {} and must have {count}",
                of.name,
                counted(nodes.len(), ["node", "nodes"])
            ));
        }
        self.check(nodes)?;
        match of.parts(nodes) {
            Parts::None => self.leave_out(of.name.to_owned(), false),
            Parts::Faces(faces) => faces.iter().try_for_each(|face| self.add_face(face))?,
            Parts::Tetrahedra(all) => {
                all.into_iter().for_each(|corners| self.add_tetrahedron(of, nodes, corners, region))
            }
        }
        Ok(())
    }

    /// Adds a face between `corners`, nodes that are there already.
    pub fn add_face(&mut self, corners: &[u32]) -> Result<(), String> {
        self.check(corners)?;
        self.face_corners.extend(corners);
        self.face_ends.push(self.face_corners.len());
        Ok(())
    }

    /// Corners of all faces so far.
    pub fn corners_of_faces(&self) -> usize {
        self.face_corners.len()
    }

    /// Refuses nodes that are not there.
    fn check(&self, nodes: &[u32]) -> Result<(), String> {
        match nodes.iter().find(|node| **node as usize >= self.nodes.len()) {
            Some(node) => {
                Err(format!("there is no node {node}, counted from 0, of {}: export the mesh again", self.nodes.len()))
            }
            None => Ok(()),
        }
    }

    /// Adds the tetrahedron between `corners` of a cell.
    fn add_tetrahedron(&mut self, of: &CellType, nodes: &[u32], corners: [usize; 4], region: u32) {
        let tetrahedron = corners.map(|corner| nodes[corner]);
        let mut key = tetrahedron;
        key.sort_unstable();
        if let Some(&number) = self.numbers.get(&key) {
            let known = &mut self.regions[number];
            *known = self::region(&[*known, region], self.wanted);
            return;
        }
        self.numbers.insert(key, self.tetrahedra.len());
        self.tetrahedra.push(tetrahedron);
        self.regions.push(region);
        if of.is_second_order() {
            let middle = |edge: [usize; 2]| match of.middle(nodes, edge.map(|end| corners[end])) {
                Middle::Node(node) => node,
                Middle::Sum([a, b], sum) => *self.middles.entry([a.min(b), a.max(b)]).or_insert_with(|| {
                    let place = sum.iter().map(|&(node, weight)| weight * self.nodes[node as usize]).sum();
                    self.nodes.push(place);
                    self.nodes.len() as u32 - 1
                }),
            };
            self.mid_nodes.push(TETRAHEDRON_EDGES.map(middle));
        }
    }

    /// Counts a cell that is not read. `name`: what it is called, in the plural.
    pub fn leave_out(&mut self, name: String, is_solid: bool) {
        *self.others[usize::from(is_solid)].entry(name).or_default() += 1;
    }

    /// The mesh: the tetrahedra where there are some, else the faces, cut into triangles.
    pub fn mesh(self) -> Result<Mesh, String> {
        let [others, solids] = &self.others;
        if !solids.is_empty() {
            return Err(format!(
                "its volume has {}, of another order or form than is read: save it as tetrahedra, hexahedra, prisms or \
                 pyramids of first or second order (in Gmsh: -3 -order 2)",
                listed(solids)
            ));
        }
        if !self.mid_nodes.is_empty() && self.mid_nodes.len() != self.tetrahedra.len() {
            return Err(
                "it has elements of first order beside some of second: save all in one order (in Gmsh: -order 2)"
                    .into(),
            );
        }
        node_number(self.nodes.len())?;
        check_coordinates(&self.nodes)?;
        if !self.tetrahedra.is_empty() {
            let Self { nodes, tetrahedra, mid_nodes, mut regions, .. } = self;
            if regions.iter().all(|region| *region == 0) {
                regions.clear();
            }
            return Ok(Mesh { nodes, tetrahedra, mid_nodes, regions, ..Mesh::default() });
        }
        if self.face_ends.is_empty() {
            let only = if others.is_empty() { String::new() } else { format!(", but {}", listed(others)) };
            return Err(format!(
                "it has no triangles, tetrahedra, hexahedra, prisms or pyramids{only}: mesh the volume (in Gmsh: -3 \
                 -order 2); where there are physical groups, Gmsh saves only what is in one"
            ));
        }
        self.surface()
    }

    /// The faces in triangles, without nodes that none of them names; a face that is there twice counts once.
    fn surface(self) -> Result<Mesh, String> {
        let (mut triangles, mut known, mut start) = (Vec::new(), HashSet::new(), 0);
        for (number, end) in self.face_ends.into_iter().enumerate() {
            let face = &self.face_corners[start..end];
            start = end;
            let cut =
                polygon::cut(face, &self.nodes).map_err(|reason| format!("face {number}, counted from 0: {reason}"))?;
            triangles.extend(cut.into_iter().filter(|triangle| {
                let mut key = *triangle;
                key.sort_unstable();
                known.insert(key)
            }));
        }
        let mut is_named = vec![false; self.nodes.len()];
        triangles.as_flattened().iter().for_each(|&node| is_named[node as usize] = true);
        let mut numbers = Vec::with_capacity(self.nodes.len());
        let mut nodes = Vec::new();
        for (node, is_named) in self.nodes.into_iter().zip(is_named) {
            numbers.push(nodes.len() as u32);
            nodes.extend(is_named.then_some(node));
        }
        triangles.as_flattened_mut().iter_mut().for_each(|node| *node = numbers[*node as usize]);
        Ok(Mesh { nodes, triangles, ..Mesh::default() })
    }
}

/// The region that counts of those that hold a tetrahedron: of those in `wanted` the last, else the first that is one.
pub(super) fn region(regions: &[u32], wanted: &[u32]) -> u32 {
    let named = wanted.iter().rev().find(|wanted| regions.contains(wanted));
    named.or_else(|| regions.iter().find(|region| **region != 0)).copied().unwrap_or(0)
}

/// Counts and what is counted.
fn listed(cells: &BTreeMap<String, usize>) -> String {
    cells.iter().map(|(name, count)| format!("{name} ({count})")).collect::<Vec<_>>().join(", ")
}
