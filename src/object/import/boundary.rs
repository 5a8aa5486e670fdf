//! The surface of tetrahedra: their faces that no other tetrahedron shares.

use crate::object::{
    Body,
    tetrahedra::{FACES, face_triangles, volume},
};
use glam::DVec3;
use std::collections::HashMap;

/// Orders nodes and tetrahedra; nodes of no tetrahedron are dropped. `mid_nodes`: as in [`Body`]. Also the number of
/// tetrahedra that had to be turned.
pub(super) fn order(nodes: &[DVec3], mut tetrahedra: Vec<[u32; 4]>, mut mid_nodes: Vec<[u32; 6]>) -> (Body, usize) {
    let mut turned = 0;
    for (number, corners) in tetrahedra.iter_mut().enumerate() {
        if volume(corners.map(|corner| nodes[corner as usize])) < 0.0 {
            corners.swap(2, 3);
            // Edges 12 and 13, 02 and 03.
            mid_nodes.get_mut(number).into_iter().for_each(|middles| *middles = [0, 5, 3, 2, 4, 1].map(|m| middles[m]));
            turned += 1;
        }
    }
    let is_curved = !mid_nodes.is_empty();
    let of_element = |number: usize, local: usize| match local.checked_sub(4) {
        None => tetrahedra[number][local],
        Some(middle) => mid_nodes[number][middle],
    };
    // Faces that are seen once stay; the other side of one takes it out.
    let mut open: HashMap<[u32; 3], ([u32; 3], usize)> = HashMap::new();
    for number in 0..tetrahedra.len() {
        for face in FACES.into_iter().flat_map(|face| face_triangles(face, is_curved)) {
            let face = face.map(|k| of_element(number, k));
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
    let all = tetrahedra.as_flattened().iter().chain(mid_nodes.as_flattened());
    all.for_each(|&node| kind[node as usize] = 1);
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
        mid_nodes: mid_nodes.into_iter().map(|middles| middles.map(|node| numbers[node as usize])).collect(),
        regions: Vec::new(),
    };
    (ordered, turned)
}
