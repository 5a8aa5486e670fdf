//! The links' shapes as a scene draws them: boxes, cylinders and spheres as such, meshes as one surface a link, whose
//! triangles are merged until a scene takes them (vertex clustering: Rossignac and Borrel, 1993).

use super::{Arm, Geometry, Note, Placed, Robot, surface::Surface};
use crate::scene::{LinkForm, LinkShape, LinkSurface, MAX_SURFACE};
use glam::{DAffine3, DVec3, IVec3};
use std::collections::{BTreeSet, HashMap};
use std::path::Path;

/// Most boxes, cylinders and spheres of a link that are written one by one.
const MOST_FORMS: usize = 64;

/// Least size of a form that is drawn (m): the last digit of a length in the scene file. Nobody sees less.
const LEAST_SIZE: f64 = 1e-6;

/// Cells along a surface's diagonal at first, and by how much they widen until it is small enough.
const CELLS: f64 = 128.0;
const WIDER: f64 = 1.25;

/// Returns the shapes of `arm`, its base first, and what of the base cannot be drawn. `packages`: as for
/// [`sample`](super::sample), which has read the meshes of the moving links.
#[must_use]
pub fn drawn_shapes(robot: &Robot, arm: &Arm, packages: Option<&Path>) -> (Vec<LinkShape>, Vec<Note>) {
    let (mut shapes, mut notes) = (Vec::new(), Vec::new());
    let links = std::iter::once((None, &arm.base_shapes))
        .chain(arm.joints.iter().enumerate().map(|(joint, of)| (Some(joint), &of.shapes)));
    for (joint, placed) in links {
        let mut merged = LinkSurface::default();
        for shape in placed {
            let form = form(&shape.geometry).filter(|_| placed.len() <= MOST_FORMS);
            match form {
                Some(form) if least_size(&form) >= LEAST_SIZE => {
                    shapes.push(LinkShape { joint, place: shape.place, form });
                }
                Some(_) => {}
                None => match Surface::of(shape, &robot.source(), packages) {
                    Ok(surface) => {
                        notes.extend(surface.oversize(shape).map(|message| note(robot, shape, message)));
                        add(&mut merged, surface);
                    }
                    Err(error) => {
                        let error = error.to_string().replace('\n', " ");
                        let message = format!("a shape of a link that does not move is not drawn: {error}");
                        notes.push(note(robot, shape, message));
                    }
                },
            }
        }
        if !merged.triangles.is_empty() {
            let form = LinkForm::Surface(simplified(merged));
            shapes.push(LinkShape { joint, place: DAffine3::IDENTITY, form });
        }
    }
    (shapes, notes)
}

/// The form of a shape that is neither capsule nor mesh.
fn form(geometry: &Geometry) -> Option<LinkForm> {
    match geometry {
        Geometry::Box(size) => Some(LinkForm::Box(*size)),
        Geometry::Cylinder { radius, length } => Some(LinkForm::Cylinder { radius: *radius, length: *length }),
        Geometry::Sphere(radius) => Some(LinkForm::Sphere(*radius)),
        Geometry::Capsule { .. } | Geometry::Mesh { .. } => None,
    }
}

/// The least edge, radius or length of a form (m).
fn least_size(form: &LinkForm) -> f64 {
    match form {
        LinkForm::Box(size) => size.min_element(),
        LinkForm::Cylinder { radius, length } => radius.min(*length),
        LinkForm::Sphere(radius) => *radius,
        LinkForm::Surface(_) => f64::INFINITY,
    }
}

fn note(robot: &Robot, shape: &Placed, message: String) -> Note {
    Note { line: robot.source().line(shape.span.start), message }
}

fn add(merged: &mut LinkSurface, surface: Surface) {
    let before = merged.nodes.len() as u32;
    merged.nodes.extend(surface.nodes);
    merged.triangles.extend(surface.triangles.iter().map(|triangle| triangle.map(|node| node + before)));
}

/// Returns `surface` with nodes of a cell merged, cells as small as makes it small enough.
fn simplified(surface: LinkSurface) -> LinkSurface {
    let [least, greatest] = surface.bounds();
    let mut size = least.distance(greatest) / CELLS;
    let mut small = if is_small(&surface) { surface.clone() } else { clustered(&surface, least, size) };
    while !is_small(&small) {
        size *= WIDER;
        small = clustered(&surface, least, size);
    }
    small
}

fn is_small(surface: &LinkSurface) -> bool {
    surface.nodes.len() + surface.triangles.len() <= MAX_SURFACE
}

/// Merges the nodes of each cell of `size` (m) to their mean, and drops triangles that become lines or are there twice.
fn clustered(surface: &LinkSurface, least: DVec3, size: f64) -> LinkSurface {
    let mut numbers: HashMap<IVec3, u32> = HashMap::new();
    let mut sums: Vec<(DVec3, f64)> = Vec::new();
    let merged: Vec<u32> = (surface.nodes.iter())
        .map(|node| {
            let number = *numbers.entry(((node - least) / size).floor().as_ivec3()).or_insert(sums.len() as u32);
            if number as usize == sums.len() {
                sums.push((DVec3::ZERO, 0.0));
            }
            let (sum, count) = &mut sums[number as usize];
            (*sum, *count) = (*sum + *node, *count + 1.0);
            number
        })
        .collect();
    let mut known = BTreeSet::new();
    let triangles = surface.triangles.iter().map(|triangle| triangle.map(|node| merged[node as usize]));
    let triangles = triangles.filter(|&[a, b, c]| {
        let mut sorted = [a, b, c];
        sorted.sort_unstable();
        a != b && b != c && c != a && known.insert(sorted)
    });
    let triangles = triangles.collect();
    LinkSurface { nodes: sums.into_iter().map(|(sum, count)| sum / count).collect(), triangles }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::object;

    #[test]
    fn a_fine_surface_is_merged_until_a_scene_takes_it_and_keeps_its_size() {
        let (nodes, triangles) = object::icosphere(DVec3::X, 0.1, 60).unwrap();
        let fine = LinkSurface { nodes, triangles };
        assert!(!is_small(&fine));
        let small = simplified(fine.clone());
        assert!(is_small(&small) && small.triangles.len() > 1000, "{}", small.triangles.len());
        let radii = small.nodes.iter().map(|node| node.distance(DVec3::X));
        assert!(radii.clone().all(|radius| (radius - 0.1).abs() < 0.005), "{:?}", radii.reduce(f64::min));
        assert_eq!(LinkSurface::decode(&small.encode(), small.bounds()).unwrap().triangles, small.triangles);
        let coarse = LinkSurface { nodes: fine.nodes[..3].to_vec(), triangles: vec![[0, 1, 2]] };
        assert_eq!(simplified(coarse.clone()), coarse);
    }
}
