//! A perspective camera that frames what it is given.

use glam::DVec3;

/// Depth, over the eye's distance from the origin, up to which a point counts as behind the eye: nearer ones would be
/// projected beyond a million pixels. Nothing that a camera frames comes nearer than a tenth.
const NEAR_PLANE: f64 = 1e-6;

/// Tangent of half the vertical field of view: 12 degrees, a portrait lens, so that boxes keep their shape.
const HALF_FIELD: f64 = 0.2126;

/// A camera with vertical axis up, outside of what it looks at.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Camera {
    /// Pixels across.
    pub width: usize,
    /// Pixels down.
    pub height: usize,
    eye: DVec3,
    /// Right, up, towards the viewer.
    axes: [DVec3; 3],
    /// Pixels a unit of tangent.
    magnification: f64,
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

impl Camera {
    /// Looks from the side of `direction` (world z up), as near as all `points` stay in the picture with a margin.
    ///
    /// Points that are no numbers are ignored; without any the camera frames a unit box at the origin.
    #[must_use]
    pub fn framing(points: &[DVec3], direction: DVec3, [width, height]: [usize; 2]) -> Self {
        let towards = direction.try_normalize().unwrap_or(DVec3::NEG_Y);
        // Looking along z there is no up: take y.
        let right = DVec3::Z.cross(towards).try_normalize().unwrap_or(DVec3::X);
        let up = towards.cross(right);
        let magnification = height as f64 / 2.0 / HALF_FIELD;
        let mut camera = Self { width, height, eye: DVec3::ZERO, axes: [right, up, towards], magnification };
        let unit_box = [DVec3::splat(-0.5), DVec3::splat(0.5)];
        let finite: Vec<DVec3> = points.iter().copied().filter(|point| point.is_finite()).collect();
        camera.frame(if finite.is_empty() { &unit_box } else { &finite });
        camera
    }

    /// Moves the eye: first to a distance at which nothing is behind it, then, twice, to the middle and distance that
    /// the projections ask for (the second time for the perspective's sake).
    fn frame(&mut self, points: &[DVec3]) {
        const MARGIN: f64 = 1.04;
        let (low, high) =
            points.iter().fold((points[0], points[0]), |(low, high), &point| (low.min(point), high.max(point)));
        let mut target = (low + high) / 2.0;
        // Without extent any distance frames the single point.
        let radius = if high == low { 0.5 } else { (high - low).length() / 2.0 };
        let [right, up, towards] = self.axes;
        let half_width = HALF_FIELD * self.width as f64 / self.height.max(1) as f64;
        let mut distance = radius * (1.0 + 1.0 / HALF_FIELD.min(half_width));
        for _ in 0..2 {
            self.eye = target + distance * towards;
            let tangents = |axis: DVec3| {
                points
                    .iter()
                    .map(|&point| (point - self.eye).dot(axis) / (self.eye - point).dot(towards))
                    .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), tangent| {
                        (low.min(tangent), high.max(tangent))
                    })
            };
            let ((left, far_right), (bottom, top)) = (tangents(right), tangents(up));
            target += distance * ((left + far_right) / 2.0 * right + (bottom + top) / 2.0 * up);
            let [across, tall] = [(far_right - left) / 2.0, (top - bottom) / 2.0];
            let fill = (across / half_width).max(tall / HALF_FIELD) * MARGIN;
            if fill > 0.0 {
                // Distance of the nearest point stays positive: the eye stops one radius before the middle.
                distance = (distance * fill).max(1.5 * radius);
            }
        }
        self.eye = target + distance * towards;
    }

    /// Returns where `point` appears; `None` behind the eye or if it is not a number. It may lie beyond the picture's
    /// edges.
    #[must_use]
    pub fn project(&self, point: DVec3) -> Option<Projected> {
        let [right, up, towards] = self.axes;
        let offset = point - self.eye;
        let depth = -offset.dot(towards);
        if !(depth.is_finite() && depth > NEAR_PLANE * self.eye.length()) {
            return None;
        }
        Some(Projected {
            x: self.width as f64 / 2.0 + self.magnification * offset.dot(right) / depth,
            y: self.height as f64 / 2.0 - self.magnification * offset.dot(up) / depth,
            nearness: 1.0 / depth,
        })
    }

    /// Right, up and towards the viewer, unit vectors in the world.
    #[must_use]
    pub fn axes(&self) -> [DVec3; 3] {
        self.axes
    }

    /// Distance of `point` from the eye along the view.
    #[must_use]
    pub fn distance(&self, point: DVec3) -> f64 {
        (self.eye - point).dot(self.axes[2])
    }

    /// Pixels that a length of one at distance one takes.
    pub(super) fn magnification(&self) -> f64 {
        self.magnification
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn corners() -> Vec<DVec3> {
        (0..8)
            .map(|k| DVec3::new(f64::from(k & 1) * 0.3, f64::from(k >> 1 & 1) * 0.1 - 4.0, f64::from(k >> 2) * 0.2))
            .collect()
    }

    #[test]
    fn everything_framed_is_inside_and_fills_the_picture() {
        for direction in [DVec3::new(1.0, -1.0, 0.5), DVec3::NEG_Y, DVec3::Z, DVec3::new(-0.2, 3.0, -1.0)] {
            for size in [[300, 200], [100, 400]] {
                let camera = Camera::framing(&corners(), direction, size);
                let seen: Vec<Projected> = corners().iter().map(|&corner| camera.project(corner).unwrap()).collect();
                let span = |coordinate: fn(&Projected) -> f64| {
                    let values = || seen.iter().map(coordinate);
                    (values().fold(f64::INFINITY, f64::min), values().fold(f64::NEG_INFINITY, f64::max))
                };
                let ((left, right), (top, bottom)) = (span(|p| p.x), span(|p| p.y));
                assert!(left >= 0.0 && top >= 0.0 && right <= size[0] as f64 && bottom <= size[1] as f64);
                let fill = ((right - left) / size[0] as f64).max((bottom - top) / size[1] as f64);
                assert!(fill > 0.85, "{direction}: {fill}");
            }
        }
    }

    #[test]
    fn up_is_up_and_nearer_is_nearer() {
        let camera = Camera::framing(&corners(), DVec3::new(0.0, -1.0, 0.3), [200, 200]);
        let at = |x, y, z| camera.project(DVec3::new(x, y, z)).unwrap();
        assert!(at(0.1, -4.0, 0.2).y < at(0.1, -4.0, 0.0).y);
        assert!(at(0.2, -4.0, 0.1).x > at(0.1, -4.0, 0.1).x);
        assert!(at(0.1, -4.0, 0.1).nearness > at(0.1, -3.9, 0.1).nearness);
    }

    #[test]
    fn a_camera_without_anything_to_frame_still_works() {
        for points in [vec![], vec![DVec3::NAN], vec![DVec3::ONE]] {
            let camera = Camera::framing(&points, DVec3::ZERO, [50, 50]);
            let target = if points == [DVec3::ONE] { DVec3::ONE } else { DVec3::ZERO };
            let at = camera.project(target).unwrap();
            assert!((10.0..40.0).contains(&at.x) && (10.0..40.0).contains(&at.y), "{points:?}: {at:?}");
        }
    }
}
