//! The sphere of section 4.1: two poles and rings of nodes at equal steps of the polar angle.
//!
//! Node 0 is the upper pole; ring i = 1..=rings lies at the polar angle pi i / (rings + 1), its nodes at equal steps of
//! the azimuth, every other ring turned by half a step so that the triangles are nearly isosceles and favour no sense
//! of rotation; the last node is the lower pole. Ten rings of ten make the paper's 102 nodes, and 200 triangles.

use super::out_of_range;
use crate::Error;
use glam::DVec3;
use std::f64::consts::PI;

/// Nodes and outward triangles of a sphere with its poles along z.
pub(super) fn generate(
    centre: DVec3,
    radius: f64,
    rings: usize,
    segments: usize,
) -> Result<(Vec<DVec3>, Vec<[u32; 3]>), Error> {
    if !(radius > 0.0 && radius.is_finite()) {
        return Err(out_of_range("radius", radius, "positive and finite"));
    }
    if rings < 1 {
        return Err(out_of_range("number of rings", rings as f64, "at least 1"));
    }
    if segments < 3 {
        return Err(out_of_range("number of segments", segments as f64, "at least 3"));
    }
    let mut nodes = Vec::with_capacity(rings * segments + 2);
    nodes.push(centre + radius * DVec3::Z);
    for ring in 1..=rings {
        let (sin_polar, cos_polar) = (PI * ring as f64 / (rings + 1) as f64).sin_cos();
        let half = if ring % 2 == 0 { 0.5 } else { 0.0 };
        for segment in 0..segments {
            let (sin_azimuth, cos_azimuth) = (2.0 * PI * (segment as f64 + half) / segments as f64).sin_cos();
            nodes.push(centre + radius * DVec3::new(sin_polar * cos_azimuth, sin_polar * sin_azimuth, cos_polar));
        }
    }
    nodes.push(centre - radius * DVec3::Z);

    let node = |ring: usize, segment: usize| (1 + (ring - 1) * segments + segment % segments) as u32;
    let last = (rings * segments + 1) as u32;
    let mut triangles = Vec::with_capacity(2 * rings * segments);
    for segment in 0..segments {
        triangles.push([0, node(1, segment), node(1, segment + 1)]);
        for ring in 1..rings {
            let (a, b) = (node(ring, segment), node(ring, segment + 1));
            let (c, d) = (node(ring + 1, segment), node(ring + 1, segment + 1));
            if ring % 2 == 1 {
                // The lower ring is turned ahead by half a step: c lies between a and b.
                triangles.extend([[a, c, b], [b, c, d]]);
            } else {
                triangles.extend([[a, c, d], [a, d, b]]);
            }
        }
        triangles.push([last, node(rings, segment + 1), node(rings, segment)]);
    }
    Ok((nodes, triangles))
}
