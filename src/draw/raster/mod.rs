//! A small software rasteriser: solid bodies to pixels, on any machine.
//!
//! Perspective camera, depth buffer, normals interpolated over triangles, a key and a fill light over a sky-and-ground
//! ambient term, computed in linear light; every pixel is the mean of 3 x 3 samples. Spheres are drawn as shaded discs
//! with the depth of a sphere, which is exact up to the perspective of their rim.
//! No randomness, no threads: equal scenes give equal pixels.

mod shapes;

use super::{camera::Camera, canvas::Picture, colour::Colour};
use glam::DVec3;

/// Samples a pixel along each side.
const SAMPLES: usize = 3;

/// A corner of a triangle.
#[derive(Clone, Copy, Debug)]
pub struct Vertex {
    /// In the world.
    pub position: DVec3,
    /// Outward, unit.
    pub normal: DVec3,
    /// Its colour; interpolated between the corners.
    pub colour: Colour,
}

/// A camera, and the picture that it takes.
#[derive(Clone, Copy, Debug)]
pub struct Viewpoint {
    /// The camera.
    pub camera: Camera,
    /// Pixels across and down.
    pub size: [usize; 2],
}

/// A point on the picture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Projected {
    /// Pixels from the left edge.
    pub x: f64,
    /// Pixels from the top edge.
    pub y: f64,
    /// One over the distance along the view (1/m); larger is nearer.
    pub nearness: f64,
}

impl Viewpoint {
    /// Frames `points`, seen from the side of `direction`.
    #[must_use]
    pub fn framing(points: &[DVec3], direction: DVec3, size: [usize; 2]) -> Self {
        let [width, height] = size.map(|side| side.max(1) as f64);
        Self { camera: Camera::framing(points, direction, width / height), size }
    }

    /// Returns where `point` appears; `None` behind the eye or if it is not a number.
    #[must_use]
    pub fn project(&self, point: DVec3) -> Option<Projected> {
        let [width, height] = self.size.map(|side| side as f64);
        let seen = self.camera.project(point, width / height)?;
        let (x, y) = (0.5 * width * (1.0 + seen.at.x), 0.5 * height * (1.0 - seen.at.y));
        Some(Projected { x, y, nearness: 1.0 / seen.depth })
    }
}

/// A picture in the making.
pub struct Raster {
    view: Viewpoint,
    width: usize,
    height: usize,
    /// Right, up, towards the viewer.
    axes: [DVec3; 3],
    /// Linear light, a sample each.
    light: Vec<[f32; 3]>,
    /// Directions towards key light, fill light, and the highlight's mirror normal.
    lights: [DVec3; 3],
    /// Reciprocal distance along the view, larger is nearer; zero where nothing was drawn.
    nearness: Vec<f32>,
}

impl Raster {
    /// An empty picture, white.
    #[must_use]
    pub fn new(view: Viewpoint) -> Self {
        let [width, height] = view.size.map(|side| side * SAMPLES);
        let axes @ [right, up, towards] = view.camera.axes();
        // The key stands above the viewer's left shoulder, the fill low on the right.
        let key = (0.55 * towards + 0.65 * up - 0.5 * right).normalize();
        let fill = (0.6 * towards - 0.1 * up + 0.8 * right).normalize();
        Self {
            lights: [key, fill, (key + towards).normalize()],
            view,
            axes,
            width,
            height,
            light: vec![[1.0; 3]; width * height],
            nearness: vec![0.0; width * height],
        }
    }

    /// Returns the view.
    #[must_use]
    pub fn view(&self) -> &Viewpoint {
        &self.view
    }

    /// A triangle. One with a corner behind the camera or not a number is left out: the camera stands outside.
    pub fn triangle(&mut self, corners: [Vertex; 3]) {
        let [Some(a), Some(b), Some(c)] = corners.map(|corner| self.project(corner.position)) else { return };
        let area = (b.x - a.x) * (c.y - a.y) - (c.x - a.x) * (b.y - a.y);
        // A triangle seen edge-on covers no sample.
        if area == 0.0 || !area.is_finite() {
            return;
        }
        let colours = corners.map(|corner| linear(corner.colour));
        let (columns, rows) = self.covered([a, b, c]);
        for row in rows {
            for column in columns.clone() {
                let (x, y) = (column as f64 + 0.5, row as f64 + 0.5);
                let share = |p: Projected, q: Projected| ((q.x - p.x) * (y - p.y) - (x - p.x) * (q.y - p.y)) / area;
                let weights = [share(b, c), share(c, a), share(a, b)];
                if weights.iter().any(|&weight| weight < 0.0) {
                    continue;
                }
                // Reciprocal distance is linear on the screen; everything else is linear over it.
                let nearness = weights[0] * a.nearness + weights[1] * b.nearness + weights[2] * c.nearness;
                let Some(sample) = self.nearer(column, row, nearness) else { continue };
                let true_weights = [
                    weights[0] * a.nearness / nearness,
                    weights[1] * b.nearness / nearness,
                    weights[2] * c.nearness / nearness,
                ];
                let mut colour = [0.0; 3];
                let mut normal = DVec3::ZERO;
                for ((weight, corner), corner_colour) in true_weights.iter().zip(&corners).zip(&colours) {
                    normal += *weight * corner.normal;
                    colour.iter_mut().zip(corner_colour).for_each(|(sum, part)| *sum += *weight as f32 * part);
                }
                self.light[sample] = self.lit(colour, normal.normalize_or_zero());
            }
        }
    }

    /// A sphere.
    pub fn sphere(&mut self, centre: DVec3, radius: f64, colour: Colour) {
        let Some(middle) = self.project(centre) else { return };
        let size = radius * middle.nearness * 0.5 * self.height as f64 / (0.5 * self.view.camera.field).tan();
        let colour = linear(colour);
        let corner = |sign: f64| Projected { x: middle.x + sign * size, y: middle.y + sign * size, ..middle };
        let (columns, rows) = self.covered([corner(-1.0), middle, corner(1.0)]);
        let axes = self.axes;
        for row in rows {
            for column in columns.clone() {
                let (x, y) = ((column as f64 + 0.5 - middle.x) / size, (row as f64 + 0.5 - middle.y) / size);
                let rest = 1.0 - x * x - y * y;
                if rest <= 0.0 {
                    continue;
                }
                let towards = rest.sqrt();
                let nearness = middle.nearness / (1.0 - towards * radius * middle.nearness);
                let Some(sample) = self.nearer(column, row, nearness) else { continue };
                self.light[sample] = self.lit(colour, x * axes[0] - y * axes[1] + towards * axes[2]);
            }
        }
    }

    /// A straight line of `width` pixels, drawn where nothing nearer is; `lift` moves it towards the camera by that
    /// share of its distance, so that a line on a surface is not swallowed by it.
    pub fn line(&mut self, ends: [DVec3; 2], width: f64, colour: Colour, lift: f64) {
        let [Some(a), Some(b)] = ends.map(|end| self.project(end)) else { return };
        let half = width * SAMPLES as f64 / 2.0;
        let (along_x, along_y) = (b.x - a.x, b.y - a.y);
        let length_squared = along_x * along_x + along_y * along_y;
        let ink = linear(colour);
        let widened = |p: Projected, sign: f64| Projected { x: p.x + sign * half, y: p.y + sign * half, ..p };
        // The box around both ends, grown by half the width on all sides.
        let corners = [widened(a, -1.0), widened(a, 1.0), widened(b, -1.0), widened(b, 1.0)];
        let (columns, rows) = self.covered(corners);
        for row in rows {
            // Only the columns near the part of the line that is near this row: its box may be nearly empty.
            let at = |y: f64| if along_y == 0.0 { 0.0 } else { ((y - a.y) / along_y).clamp(0.0, 1.0) };
            let y = row as f64 + 0.5;
            let part = if along_y.abs() > half { [at(y - half), at(y + half)] } else { [0.0, 1.0] };
            let [from, to] = part.map(|share| a.x + share * along_x);
            let near = (from.min(to) - half).floor() as usize..(from.max(to) + half).ceil() as usize + 1;
            for column in columns.start.max(near.start)..columns.end.min(near.end) {
                let (x, y) = (column as f64 + 0.5 - a.x, row as f64 + 0.5 - a.y);
                let along = if length_squared > 0.0 {
                    ((x * along_x + y * along_y) / length_squared).clamp(0.0, 1.0)
                } else {
                    0.0
                };
                if (x - along * along_x).powi(2) + (y - along * along_y).powi(2) > half * half {
                    continue;
                }
                let nearness = (a.nearness + along * (b.nearness - a.nearness)) * (1.0 + lift);
                let sample = row * self.width + column;
                if nearness as f32 > self.nearness[sample] {
                    // Depth is left alone: a translucent line must not hide what is drawn after it.
                    let under = self.light[sample];
                    self.light[sample] = std::array::from_fn(|k| under[k] + colour.opacity * (ink[k] - under[k]));
                }
            }
        }
    }

    /// The finished picture.
    #[must_use]
    pub fn picture(&self) -> Picture {
        let [width, height] = self.view.size;
        let pixel = |index: usize| {
            let (column, row) = (index % width * SAMPLES, index / width * SAMPLES);
            let mut sum = [0.0_f32; 3];
            for sample in (0..SAMPLES * SAMPLES).map(|k| (row + k / SAMPLES) * self.width + column + k % SAMPLES) {
                sum.iter_mut().zip(self.light[sample]).for_each(|(sum, part)| *sum += part);
            }
            sum.map(|light| encoded(light / (SAMPLES * SAMPLES) as f32))
        };
        Picture { width, height, pixels: (0..width * height).map(pixel).collect() }
    }

    /// In samples.
    fn project(&self, point: DVec3) -> Option<Projected> {
        let projected = self.view.project(point)?;
        Some(Projected { x: projected.x * SAMPLES as f64, y: projected.y * SAMPLES as f64, ..projected })
    }

    /// Columns and rows of samples that a shape with these corners may touch.
    fn covered<const N: usize>(&self, corners: [Projected; N]) -> (std::ops::Range<usize>, std::ops::Range<usize>) {
        let span = |coordinate: fn(&Projected) -> f64, limit: usize| {
            let low = corners.iter().map(coordinate).fold(f64::INFINITY, f64::min);
            let high = corners.iter().map(coordinate).fold(f64::NEG_INFINITY, f64::max);
            // Conversion of floats saturates: beyond the picture becomes its edge.
            (low.floor() as usize).min(limit)..((high.ceil() + 1.0) as usize).min(limit)
        };
        (span(|corner| corner.x, self.width), span(|corner| corner.y, self.height))
    }

    /// Takes the sample if `nearness` is nearer than what it shows.
    fn nearer(&mut self, column: usize, row: usize, nearness: f64) -> Option<usize> {
        let sample = row * self.width + column;
        let nearness = nearness as f32;
        if nearness > self.nearness[sample] {
            self.nearness[sample] = nearness;
            return Some(sample);
        }
        None
    }

    /// Light that leaves a surface towards the camera, with a faint highlight.
    fn lit(&self, colour: [f32; 3], normal: DVec3) -> [f32; 3] {
        let towards = self.axes[2];
        // Closed bodies only: a normal that points away belongs to a surface interpolated across its rim.
        let away = normal.dot(towards).min(0.0);
        let normal = if away < 0.0 { (normal - away * towards).normalize_or_zero() } else { normal };
        let [key, fill, mirror] = self.lights;
        let sky = 0.5 + 0.5 * normal.z;
        let diffuse = 0.30 + 0.16 * sky + 0.58 * normal.dot(key).max(0.0) + 0.16 * normal.dot(fill).max(0.0);
        let highlight = 0.10 * normal.dot(mirror).max(0.0).powi(40);
        colour.map(|channel| channel * diffuse as f32 + highlight as f32)
    }
}

/// sRGB to linear light (IEC 61966-2-1).
fn linear(colour: Colour) -> [f32; 3] {
    colour.rgb.map(|channel| {
        let value = f32::from(channel) / 255.0;
        if value <= 0.04045 { value / 12.92 } else { ((value + 0.055) / 1.055).powf(2.4) }
    })
}

/// Linear light to sRGB.
fn encoded(light: f32) -> u8 {
    let light = light.clamp(0.0, 1.0);
    let value = if light <= 0.003_130_8 { 12.92 * light } else { 1.055 * light.powf(1.0 / 2.4) - 0.055 };
    (255.0 * value).round() as u8
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::draw::colour::{INK, WHITE};

    const RED: Colour = Colour::hex(0xd0_30_20);

    fn view() -> Viewpoint {
        Viewpoint::framing(&[DVec3::splat(-1.0), DVec3::splat(1.0)], DVec3::new(1.0, -2.0, 0.8), [160, 120])
    }

    fn pixel(picture: &Picture, at: Projected) -> [u8; 3] {
        picture.pixels[at.y as usize * picture.width + at.x as usize]
    }

    #[test]
    fn a_sphere_covers_its_silhouette_and_nothing_else() {
        let mut raster = Raster::new(view());
        raster.sphere(DVec3::ZERO, 0.5, RED);
        let [right, _, towards] = raster.axes;
        let picture = raster.picture();
        // Silhouette of a sphere: the circle where lines of sight touch it, r sqrt(1 - (r/d)^2) off the centre.
        let distance = raster.view().camera.eye().dot(towards);
        for (offset, covered) in [(0.93, true), (1.09, false)] {
            let rim = offset * 0.5 * (1.0 - (0.5 / distance).powi(2)).sqrt() * right + 0.5 * 0.5 / distance * towards;
            let at = raster.view().project(rim).unwrap();
            assert_eq!(pixel(&picture, at) != [255; 3], covered, "at {offset} radii");
        }
    }

    #[test]
    fn the_nearer_body_hides_the_farther_one_in_either_order() {
        let draw = |order: [usize; 2]| {
            let mut raster = Raster::new(view());
            let towards = raster.axes[2];
            for body in order {
                let (centre, colour) = [(DVec3::ZERO, RED), (0.6 * towards, INK)][body];
                raster.sphere(centre, 0.3, colour);
            }
            raster.picture()
        };
        assert_eq!(draw([0, 1]), draw([1, 0]));
        let at = view().project(DVec3::ZERO).unwrap();
        let [red, _, blue] = pixel(&draw([0, 1]), at);
        assert!(red < 120 && blue >= red, "the dark sphere is in front");
    }

    #[test]
    fn depth_is_perspective_correct_where_triangles_cross() {
        // A wall through a floor: on both sides of their common line the nearer one shows.
        let flat =
            |colour: Colour, points: [DVec3; 3]| points.map(|position| Vertex { position, normal: DVec3::Z, colour });
        let mut raster =
            Raster::new(Viewpoint::framing(&[DVec3::splat(-1.0), DVec3::splat(1.0)], -DVec3::Y, [120, 120]));
        let [v, w] = [DVec3::new(-2.0, -1.0, -1.0), DVec3::new(2.0, -1.0, -1.0)];
        raster.triangle(flat(RED, [v, w, DVec3::new(0.0, 3.0, 3.0)]));
        raster
            .triangle(flat(INK, [DVec3::new(-2.0, 0.5, -1.0), DVec3::new(2.0, 0.5, -1.0), DVec3::new(0.0, 0.5, 3.0)]));
        let picture = raster.picture();
        for (z, is_red) in [(0.45, true), (0.55, false)] {
            // The red plane is y = z; the dark one y = 0.5.
            let front = DVec3::new(0.0, f64::min(z, 0.5), z);
            let at = raster.view().project(front).unwrap();
            let [red, _, blue] = pixel(&picture, at);
            assert_eq!(red > blue, is_red, "height {z}");
        }
    }

    #[test]
    fn hostile_shapes_draw_nothing() {
        let mut raster = Raster::new(view());
        let nan = DVec3::new(f64::NAN, 0.0, 0.0);
        let far_behind = 1e9 * raster.axes[2];
        for point in [nan, far_behind, DVec3::splat(f64::INFINITY)] {
            raster.sphere(point, 0.1, RED);
            raster.line([point, DVec3::ZERO], 2.0, INK, 0.0);
            let vertex = |position| Vertex { position, normal: DVec3::Z, colour: RED };
            raster.triangle([vertex(point), vertex(DVec3::ZERO), vertex(DVec3::X)]);
        }
        raster.sphere(DVec3::ZERO, f64::NAN, RED);
        assert!(raster.picture().pixels.iter().all(|&pixel| pixel == WHITE.rgb));
    }
}
