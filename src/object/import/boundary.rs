//! The surface of tetrahedra: their faces that no other tetrahedron shares.

use crate::object::{Body, solid::volume};
use glam::DVec3;
use std::collections::HashMap;

/// Faces of a tetrahedron of positive volume, counter-clockwise seen from outside.
const FACES: [[usize; 3]; 4] = [[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]];

/// Orders nodes and tetrahedra; nodes of no tetrahedron are dropped. Also the number of tetrahedra that had to be
/// turned.
pub(super) fn order(nodes: &[DVec3], mut tetrahedra: Vec<[u32; 4]>) -> (Body, usize) {
    let mut turned = 0;
    for corners in &mut tetrahedra {
        if volume(corners.map(|corner| nodes[corner as usize])) < 0.0 {
            corners.swap(2, 3);
            turned += 1;
        }
    }
    // Faces that are seen once stay; the other side of one takes it out.
    let mut open: HashMap<[u32; 3], ([u32; 3], usize)> = HashMap::new();
    for (number, corners) in tetrahedra.iter().enumerate() {
        for face in FACES {
            let face = face.map(|k| corners[k]);
            let mut key = face;
            key.sort_unstable();
            if open.remove(&key).is_none() {
                open.insert(key, (face, number));
            }
        }
    }
    let mut faces: Vec<([u32; 3], usize)> = open.into_values().collect();
    faces.sort_unstable_by_key(|(face, number)| (*number, *face));
    const DROPPED: u8 = 2;
    let mut kind = vec![DROPPED; nodes.len()];
    tetrahedra.as_flattened().iter().for_each(|&node| kind[node as usize] = 1);
    faces.iter().flat_map(|(face, _)| face).for_each(|&node| kind[node as usize] = 0);
    let mut kept: Vec<u32> = (0..nodes.len() as u32).filter(|&node| kind[node as usize] != DROPPED).collect();
    kept.sort_by_key(|&node| kind[node as usize]);
    let mut numbers = vec![u32::MAX; nodes.len()];
    kept.iter().zip(0..).for_each(|(&node, number)| numbers[node as usize] = number);
    let ordered = Body {
        nodes: kept.iter().map(|&node| nodes[node as usize]).collect(),
        surface_nodes: kept.iter().filter(|&&node| kind[node as usize] == 0).count(),
        triangles: faces.into_iter().map(|(face, _)| face.map(|node| numbers[node as usize])).collect(),
        tetrahedra: tetrahedra.into_iter().map(|corners| corners.map(|node| numbers[node as usize])).collect(),
        regions: Vec::new(),
    };
    (ordered, turned)
}
