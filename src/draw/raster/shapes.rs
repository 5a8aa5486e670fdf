//! Bodies of revolution and meshes, made of triangles.

use super::{Raster, Vertex};
use crate::draw::{colour::Colour, solid::Cone};
use glam::DVec3;

/// How much nearer, as a fraction of its distance, the edges of a mesh are drawn than its surface: above the rounding
/// of the depth buffer (single precision) at grazing views, below a twentieth of what a camera frames.
const EDGE_LIFT: f64 = 5e-3;

/// Facets around an axis: with interpolated normals the rim looks round.
const FACETS: usize = 28;

impl Raster {
    /// A closed triangle mesh with normals averaged over the triangles around each node, weighted by area; `colours`
    /// has one colour a node. Triangles that name nodes beyond either list are left out.
    pub fn mesh(&mut self, nodes: &[DVec3], triangles: &[[u32; 3]], colours: &[Colour]) {
        let known =
            |triangle: &&[u32; 3]| triangle.iter().all(|&node| (node as usize) < nodes.len().min(colours.len()));
        let mut normals = vec![DVec3::ZERO; nodes.len()];
        for triangle in triangles.iter().filter(known) {
            let [a, b, c] = triangle.map(|node| nodes[node as usize]);
            let area = (b - a).cross(c - a);
            triangle.iter().for_each(|&node| normals[node as usize] += area);
        }
        for triangle in triangles.iter().filter(known) {
            let corners = triangle.map(|node| {
                let node = node as usize;
                Vertex { position: nodes[node], normal: normals[node].normalize_or_zero(), colour: colours[node] }
            });
            self.triangle(corners);
        }
    }

    /// Flat triangles of any orientation: each is lit on the side that is seen.
    pub fn facets(&mut self, nodes: &[DVec3], triangles: &[[u32; 3]], colour: Colour) {
        let [.., towards] = self.axes;
        for triangle in triangles {
            let [Some(&a), Some(&b), Some(&c)] = triangle.map(|node| nodes.get(node as usize)) else { continue };
            let normal = (b - a).cross(c - a).normalize_or_zero();
            let normal = if normal.dot(towards) < 0.0 { -normal } else { normal };
            self.triangle([a, b, c].map(|position| Vertex { position, normal, colour }));
        }
    }

    /// The edges of a mesh, each once.
    pub fn edges(&mut self, nodes: &[DVec3], triangles: &[[u32; 3]], width: f64, colour: Colour) {
        for triangle in triangles {
            for side in 0..3 {
                let (from, to) = (triangle[side], triangle[(side + 1) % 3]);
                // The neighbour across names the same edge the other way round.
                if from < to
                    && let (Some(&a), Some(&b)) = (nodes.get(from as usize), nodes.get(to as usize))
                {
                    self.line([a, b], width, colour, EDGE_LIFT);
                }
            }
        }
    }

    /// Rounded cones. Rods are made of short pieces: one that leads past the camera is cut off there, not left out. The
    /// wide end of what tapers is flat.
    pub fn cones(&mut self, cones: &[Cone]) {
        const PIECES: usize = 24;
        for &Cone { ends: [from, to], radii, colour } in cones {
            if from == to {
                self.sphere(from, radii[0], colour);
            } else if radii[0] == radii[1] {
                let at = |piece: usize| from.lerp(to, piece as f64 / PIECES as f64);
                (0..PIECES).for_each(|piece| self.frustum([at(piece), at(piece + 1)], radii, colour));
                [from, to].into_iter().for_each(|end| self.sphere(end, radii[0], colour));
            } else {
                self.frustum([from, to], radii, colour);
                let outward = if radii[0] > radii[1] { from - to } else { to - from };
                let (wide, radius) = if radii[0] > radii[1] { (from, radii[0]) } else { (to, radii[1]) };
                self.disc(wide, outward.normalize_or_zero(), radius, colour);
            }
        }
    }

    /// The side of a cone cut off at both ends.
    fn frustum(&mut self, [from, to]: [DVec3; 2], radii: [f64; 2], colour: Colour) {
        let Some(axis) = (to - from).try_normalize() else { return };
        let length = (to - from).length();
        // The normal leans along the axis by the taper.
        let lean = (radii[0] - radii[1]) / length;
        let ring = ring(axis);
        let corner = |index: usize, end: usize| {
            let outward = ring[index % FACETS];
            Vertex {
                position: [from, to][end] + radii[end] * outward,
                normal: (outward + lean * axis).normalize(),
                colour,
            }
        };
        for index in 0..FACETS {
            let quad = [corner(index, 0), corner(index + 1, 0), corner(index + 1, 1), corner(index, 1)];
            self.triangle([quad[0], quad[1], quad[2]]);
            self.triangle([quad[0], quad[2], quad[3]]);
        }
    }

    /// A flat round face.
    fn disc(&mut self, centre: DVec3, normal: DVec3, radius: f64, colour: Colour) {
        let ring = ring(normal);
        let vertex = |position: DVec3| Vertex { position, normal, colour };
        for index in 0..FACETS {
            let rim = |index: usize| vertex(centre + radius * ring[index % FACETS]);
            self.triangle([vertex(centre), rim(index), rim(index + 1)]);
        }
    }
}

/// Unit vectors around `axis`.
fn ring(axis: DVec3) -> [DVec3; FACETS] {
    let first = axis.any_orthonormal_vector();
    let second = axis.cross(first);
    std::array::from_fn(|index| {
        let (sine, cosine) = (std::f64::consts::TAU * index as f64 / FACETS as f64).sin_cos();
        cosine * first + sine * second
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::draw::raster::Viewpoint;

    const BLUE: Colour = Colour::hex(0x20_50_c0);

    /// Share of the picture that is not white.
    fn covered(draw: impl FnOnce(&mut Raster)) -> f64 {
        let view = Viewpoint::framing(&[DVec3::splat(-1.0), DVec3::splat(1.0)], DVec3::new(1.0, -2.0, 0.8), [120, 120]);
        let mut raster = Raster::new(view);
        draw(&mut raster);
        let picture = raster.picture();
        picture.pixels.iter().filter(|&&pixel| pixel != [255; 3]).count() as f64 / picture.pixels.len() as f64
    }

    #[test]
    fn a_capsule_is_a_sphere_and_its_length_more() {
        let sphere = covered(|raster| raster.sphere(DVec3::ZERO, 0.3, BLUE));
        let capsule = covered(|raster| raster.cones(&[Cone::rod([DVec3::NEG_Z * 0.5, DVec3::Z * 0.5], 0.3, BLUE)]));
        // Side view: 2 r times the length, seen at an angle; between one and the full length.
        let band = sphere * (2.0 * 0.3) / (std::f64::consts::PI * 0.3 * 0.3);
        assert!(capsule > sphere + 0.8 * band && capsule < sphere + 1.1 * band, "{capsule} {sphere} {band}");
    }

    #[test]
    fn meshes_with_wrong_numbers_are_drawn_as_far_as_they_are_right() {
        let nodes = [DVec3::ZERO, DVec3::X, DVec3::Z];
        let one = covered(|raster| raster.mesh(&nodes, &[[0, 1, 2]], &[BLUE; 3]));
        let both = covered(|raster| raster.mesh(&nodes, &[[0, 1, 2], [0, 1, 9]], &[BLUE; 3]));
        assert!(one > 0.01);
        assert_eq!(one, both);
        assert_eq!(covered(|raster| raster.mesh(&nodes, &[[0, 1, 2]], &[])), 0.0);
        assert!(covered(|raster| raster.edges(&nodes, &[[0, 1, 2], [0, 9, 1]], 1.0, BLUE)) > 0.0);
    }

    #[test]
    fn an_arrow_is_drawn_from_tail_to_tip() {
        let arrow = |span: DVec3| covered(|raster| raster.cones(&Cone::arrow(DVec3::ZERO, span, 0.05, BLUE)));
        let [short, long] = [0.5, 1.0].map(|length| arrow(length * DVec3::Z));
        assert!(long > 0.01 && long > 1.5 * short && short > 0.0, "{short} {long}");
    }
}
