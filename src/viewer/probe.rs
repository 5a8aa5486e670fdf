//! A vertex of the object that was clicked.

use crate::draw::camera::Ray;
use glam::{DMat3, DVec3};

/// What is known of the vertex that is probed.
#[derive(Clone, Copy, Debug)]
pub struct Probe {
    /// Its number.
    pub vertex: usize,
    /// How far it is from its place at rest (m).
    pub displacement: DVec3,
    /// Force of the arm on it (N).
    pub force: DVec3,
}

/// Returns the vertex that is nearest to where `ray` first meets a triangle with corners among `places` (m); none where
/// it meets none.
#[must_use]
pub fn pick(ray: &Ray, places: &[DVec3], triangles: &[[u32; 3]]) -> Option<usize> {
    let met = triangles.iter().filter_map(|triangle| {
        let corners = triangle.map(|vertex| places.get(vertex as usize).copied());
        let [Some(a), Some(b), Some(c)] = corners else { return None };
        let (along, weights) = meet([a, b, c], ray)?;
        let nearest = (0..3).max_by(|&k, &l| weights[k].total_cmp(&weights[l]))?;
        Some((along, triangle[nearest] as usize))
    });
    met.min_by(|a, b| a.0.total_cmp(&b.0)).map(|(_, vertex)| vertex)
}

/// How far beyond an edge a triangle is still met (1): more than rounding moves a ray, so that none slips between two
/// triangles.
const EDGE: f64 = 1e-9;

/// Where `ray` meets a triangle: how far along (m), and the weights of its corners.
fn meet([a, b, c]: [DVec3; 3], ray: &Ray) -> Option<(f64, [f64; 3])> {
    // a + u (b - a) + v (c - a) = origin + t direction; a ray in the triangle's plane meets it nowhere.
    let system = DMat3::from_cols(b - a, c - a, -ray.direction);
    let solution = (system.determinant() != 0.0).then(|| system.inverse() * (ray.origin - a))?;
    let [u, v, along] = solution.to_array();
    let weights = [1.0 - u - v, u, v];
    (along > 0.0 && weights.iter().all(|weight| *weight >= -EDGE)).then_some((along, weights))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{draw::camera::Camera, object::Object, scene::Scene};

    #[test]
    fn the_vertex_that_is_seen_is_picked_and_none_behind_it() {
        let scene = Scene::parse(include_str!("../../tests/scenes/sphere.toml"), "sphere.toml").unwrap();
        let object = Object::build(&scene.object).unwrap();
        let middle = object.rest.iter().sum::<DVec3>() / object.rest.len() as f64;
        let camera = Camera::looking_at(middle, 0.1);
        let towards = camera.axes()[2];
        let mut seen = 0;
        for (vertex, place) in object.rest.iter().enumerate() {
            let ray = camera.ray(camera.project(*place, 1.3).unwrap().at, 1.3);
            let picked = pick(&ray, &object.rest, &object.triangles);
            // On the rim a ray may pass beside the facets.
            let facing = (*place - middle).normalize().dot(towards);
            if facing > 0.5 {
                assert_eq!(picked, Some(vertex));
                seen += 1;
            } else if facing < -0.1 {
                assert_ne!(picked, Some(vertex), "it is behind");
            }
        }
        assert!(seen > 20, "{seen}");
        let beside = camera.ray(glam::DVec2::new(0.98, 0.98), 1.3);
        assert_eq!(pick(&beside, &object.rest, &object.triangles), None);
    }
}
