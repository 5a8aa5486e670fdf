//! A perspective camera: it looks at a target from a distance, z is up. For a figure it frames what is shown; in the
//! window it orbits.

use glam::{
    DVec2, DVec3, Mat4, Vec3,
    camera::rh::{proj::directx::perspective, view::look_at_mat4},
};
use std::f64::consts::{FRAC_PI_2, TAU};

/// Where the eye is, and what it sees.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Camera {
    /// Point in the middle of the picture (m).
    pub target: DVec3,
    /// From the target to the eye (m).
    pub distance: f64,
    /// Direction from the target to the eye: angle about z from the x axis (rad).
    pub azimuth: f64,
    /// Height of that direction above the horizontal plane (rad).
    pub elevation: f64,
    /// Vertical angle of view (rad).
    pub field: f64,
}

/// A point as it is seen.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Seen {
    /// Place in the picture: x right and y up, from -1 to 1.
    pub at: DVec2,
    /// Distance from the eye along the view (m).
    pub depth: f64,
}

/// A half-line into the scene.
#[derive(Clone, Copy, Debug)]
pub struct Ray {
    /// The eye (m).
    pub origin: DVec3,
    /// Unit vector.
    pub direction: DVec3,
}

/// Vertical angle of view in the window, and in figures (rad): 24 degrees, a portrait lens, so that boxes keep their
/// shape.
const WINDOW_FIELD: f64 = 0.60;
const FIGURE_FIELD: f64 = 0.4189;
/// From where one looks at first: from the front, a little from the left and from above (rad).
const AZIMUTH: f64 = -0.9;
const ELEVATION: f64 = 0.42;
/// Turn for a pointer's way of the picture's height (rad): about half round.
const TURN: f64 = 3.0;
/// Nearest and farthest that is drawn, over the distance to the target (1): there, depth in f32 (6e-8) over the nearest
/// resolves 6e-6 of the distance.
const NEAR: f32 = 0.01;
const FAR: f32 = 100.0;
/// Depth over the distance to the target up to which a point counts as behind the eye (1): nearer ones would be
/// projected beyond a million pixels. Nothing that a camera frames comes nearer than a tenth.
const BEHIND: f64 = 1e-6;
/// Nearest and farthest that one can zoom (m).
const DISTANCES: [f64; 2] = [1e-4, 1e4];
/// Least width over height of a picture (1): one of no width has no projection.
const LEAST_ASPECT: f64 = 1e-3;
/// Least cosine of a ray to a plane's normal at which they meet (1): a pointer's place is rounded by 1e-7.
const LEAST_SLOPE: f64 = 1e-6;
/// Least extent of what is looked at (m).
const LEAST_RADIUS: f64 = 1e-6;
/// The eye orbits this far from straight above or below, where "up" has no meaning (rad).
const POLE_MARGIN: f64 = 0.02;
/// Room around what is framed (1).
const MARGIN: f64 = 1.04;

impl Camera {
    /// Sees a ball of `radius` about `target` whole.
    #[must_use]
    pub fn looking_at(target: DVec3, radius: f64) -> Self {
        let distance = radius.max(LEAST_RADIUS) / (0.5 * WINDOW_FIELD).sin();
        Self { target, distance, azimuth: AZIMUTH, elevation: ELEVATION, field: WINDOW_FIELD }
    }

    /// Looks from the side of `direction`, as near as all `points` stay in a picture of the given width over height,
    /// with a margin. Points that are no numbers are ignored; without any the camera frames a unit box at the origin.
    #[must_use]
    pub fn framing(points: &[DVec3], direction: DVec3, aspect: f64) -> Self {
        let direction = direction.try_normalize().unwrap_or(DVec3::NEG_Y);
        // Straight above there is no azimuth: y is up.
        let is_vertical = direction.truncate() == DVec2::ZERO;
        let azimuth = if is_vertical { -FRAC_PI_2 } else { direction.y.atan2(direction.x) };
        let elevation = direction.z.clamp(-1.0, 1.0).asin();
        let mut camera = Self { target: DVec3::ZERO, distance: 1.0, azimuth, elevation, field: FIGURE_FIELD };
        let unit_box = vec![DVec3::splat(-0.5), DVec3::splat(0.5)];
        let finite: Vec<DVec3> = points.iter().copied().filter(|point| point.is_finite()).collect();
        camera.frame(if finite.is_empty() { &unit_box } else { &finite }, aspect);
        camera
    }

    /// Moves the eye: first to a distance at which nothing is behind it, then, twice, to the middle and distance that
    /// the projections ask for (the second time for the perspective's sake).
    fn frame(&mut self, points: &[DVec3], aspect: f64) {
        let (low, high) =
            points.iter().fold((points[0], points[0]), |(low, high), &point| (low.min(point), high.max(point)));
        // Without extent any distance frames the single point.
        let radius = if high == low { 0.5 } else { (high - low).length() / 2.0 };
        let [right, up, _] = self.axes();
        let half = (0.5 * self.field).tan();
        self.target = (low + high) / 2.0;
        self.distance = radius * (1.0 + 1.0 / (half * aspect.min(1.0)));
        for _ in 0..2 {
            let seen = points.iter().filter_map(|point| self.project(*point, aspect)).map(|seen| seen.at);
            let (least, greatest) =
                seen.fold((DVec2::INFINITY, DVec2::NEG_INFINITY), |(least, most), at| (least.min(at), most.max(at)));
            let middle = self.distance * half * 0.5 * (least + greatest);
            self.target += aspect * middle.x * right + middle.y * up;
            let fill = MARGIN * (0.5 * (greatest - least)).max_element();
            if fill > 0.0 {
                // Distance of the nearest point stays positive: the eye stops one radius before the middle.
                self.distance = (self.distance * fill).max(1.5 * radius);
            }
        }
    }

    /// Right, up and towards the viewer, unit vectors.
    #[must_use]
    pub fn axes(&self) -> [DVec3; 3] {
        let (sin_azimuth, cos_azimuth) = self.azimuth.sin_cos();
        let (sin_elevation, cos_elevation) = self.elevation.sin_cos();
        let towards = DVec3::new(cos_elevation * cos_azimuth, cos_elevation * sin_azimuth, sin_elevation);
        let right = DVec3::new(-sin_azimuth, cos_azimuth, 0.0);
        [right, towards.cross(right), towards]
    }

    /// The eye (m).
    #[must_use]
    pub fn eye(&self) -> DVec3 {
        self.target + self.distance * self.axes()[2]
    }

    /// Returns where `point` appears in a picture of the given width over height; `None` behind the eye or if it is not
    /// a number. It may lie beyond the picture's edges.
    #[must_use]
    pub fn project(&self, point: DVec3, aspect: f64) -> Option<Seen> {
        let [right, up, towards] = self.axes();
        let offset = point - self.eye();
        let depth = -offset.dot(towards);
        if !(depth.is_finite() && depth > BEHIND * self.distance) {
            return None;
        }
        let half = depth * (0.5 * self.field).tan();
        Some(Seen { at: DVec2::new(offset.dot(right) / (aspect * half), offset.dot(up) / half), depth })
    }

    /// World to clip space (depth 0 to 1) for a picture of the given width over height.
    #[must_use]
    pub fn clip(&self, aspect: f64) -> Mat4 {
        let [near, far] = [NEAR, FAR].map(|share| share * self.distance as f32);
        let projection = perspective(self.field as f32, aspect.max(LEAST_ASPECT) as f32, near, far);
        projection * look_at_mat4(self.eye().as_vec3(), self.target.as_vec3(), Vec3::Z)
    }

    /// Height of the picture at the target's distance (m).
    #[must_use]
    pub fn height_at_target(&self) -> f64 {
        2.0 * self.distance * (0.5 * self.field).tan()
    }

    /// Turns by a pointer movement, in fractions of the picture's height.
    pub fn orbit(&mut self, movement: DVec2) {
        let limit = FRAC_PI_2 - POLE_MARGIN;
        self.azimuth = (self.azimuth - TURN * movement.x).rem_euclid(TAU);
        self.elevation = (self.elevation + TURN * movement.y).clamp(-limit, limit);
    }

    /// Shifts the target by a pointer movement, in fractions of the picture's height: what is under the pointer
    /// follows.
    pub fn pan(&mut self, movement: DVec2) {
        let [right, up, _] = self.axes();
        self.target += self.height_at_target() * (movement.y * up - movement.x * right);
    }

    /// Brings the eye nearer for `factor` below one.
    pub fn zoom(&mut self, factor: f64) {
        self.distance = (self.distance * factor).clamp(DISTANCES[0], DISTANCES[1]);
    }

    /// The ray through a point of the picture: x right and y up, both from -1 to 1.
    #[must_use]
    pub fn ray(&self, point: DVec2, aspect: f64) -> Ray {
        let [right, up, towards] = self.axes();
        let half = (0.5 * self.field).tan();
        let direction = (point.x * aspect * half * right + point.y * half * up - towards).normalize();
        Ray { origin: self.eye(), direction }
    }
}

impl Ray {
    /// Returns where the ray meets the plane through `point` with `normal`; `None` when it runs along it or away from
    /// it.
    #[must_use]
    pub fn meet_plane(&self, point: DVec3, normal: DVec3) -> Option<DVec3> {
        let slope = self.direction.dot(normal);
        let along = (point - self.origin).dot(normal) / slope;
        (slope.abs() > LEAST_SLOPE && along > 0.0).then(|| self.origin + along * self.direction)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_ray_through_a_picture_point_meets_the_world_point_drawn_there() {
        let mut camera = Camera::looking_at(DVec3::new(0.1, -0.2, 0.05), 0.3);
        camera.orbit(DVec2::new(0.3, 0.1));
        camera.pan(DVec2::new(-0.05, 0.2));
        camera.zoom(0.7);
        for world in [DVec3::ZERO, DVec3::new(0.2, -0.1, 0.0), DVec3::new(0.05, -0.3, 0.1)] {
            let clip = camera.clip(1.6).project_point3(world.as_vec3()).as_dvec3();
            let seen = camera.project(world, 1.6).unwrap();
            assert!(seen.at.distance(clip.truncate()) < 1e-5 && (0.0..1.0).contains(&clip.z), "{seen:?} is not {clip}");
            let met = camera.ray(seen.at, 1.6).meet_plane(world, camera.axes()[2]).unwrap();
            assert!(met.distance(world) < 1e-12, "{met} is not {world}");
        }
    }

    #[test]
    fn panning_moves_the_target_point_with_the_pointer() {
        let camera = Camera::looking_at(DVec3::ZERO, 0.3);
        let mut moved = camera;
        moved.pan(DVec2::new(0.25, -0.1));
        let shown = moved.project(camera.target, 1.0).unwrap().at;
        // A quarter of the height is half a unit of the picture.
        assert!((shown.x - 0.5).abs() < 1e-9 && (shown.y.abs() - 0.2).abs() < 1e-9, "{shown}");
    }

    #[test]
    fn the_eye_never_passes_over_the_pole() {
        let mut camera = Camera::looking_at(DVec3::ZERO, 1.0);
        camera.orbit(DVec2::new(0.0, 50.0));
        assert!(camera.axes().iter().all(|v| v.is_finite() && (v.length() - 1.0).abs() < 1e-12));
        assert!(camera.clip(1.0).is_finite());
    }

    fn corners() -> Vec<DVec3> {
        (0..8)
            .map(|k| DVec3::new(f64::from(k & 1) * 0.3, f64::from(k >> 1 & 1) * 0.1 - 4.0, f64::from(k >> 2) * 0.2))
            .collect()
    }

    #[test]
    fn everything_framed_is_inside_and_fills_the_picture() {
        for direction in [DVec3::new(1.0, -1.0, 0.5), DVec3::NEG_Y, DVec3::Z, DVec3::new(-0.2, 3.0, -1.0)] {
            for aspect in [1.5, 0.25] {
                let camera = Camera::framing(&corners(), direction, aspect);
                let seen: Vec<DVec2> =
                    corners().iter().map(|&corner| camera.project(corner, aspect).unwrap().at).collect();
                let [least, greatest] = [DVec2::min, DVec2::max].map(|of| seen.iter().copied().reduce(of).unwrap());
                assert!(least.min_element() >= -1.0 && greatest.max_element() <= 1.0, "{least} to {greatest}");
                assert!((greatest - least).max_element() > 2.0 * 0.85, "{direction}: {least} to {greatest}");
            }
        }
    }

    #[test]
    fn up_is_up_and_nearer_is_nearer() {
        let camera = Camera::framing(&corners(), DVec3::new(0.0, -1.0, 0.3), 1.0);
        let at = |x, y, z| camera.project(DVec3::new(x, y, z), 1.0).unwrap();
        assert!(at(0.1, -4.0, 0.2).at.y > at(0.1, -4.0, 0.0).at.y);
        assert!(at(0.2, -4.0, 0.1).at.x > at(0.1, -4.0, 0.1).at.x);
        assert!(at(0.1, -4.0, 0.1).depth < at(0.1, -3.9, 0.1).depth);
    }

    #[test]
    fn a_camera_without_anything_to_frame_still_works() {
        for points in [vec![], vec![DVec3::NAN], vec![DVec3::ONE]] {
            let camera = Camera::framing(&points, DVec3::ZERO, 1.0);
            let target = if points == [DVec3::ONE] { DVec3::ONE } else { DVec3::ZERO };
            let at = camera.project(target, 1.0).unwrap().at;
            assert!(at.abs().max_element() < 0.6, "{points:?}: {at:?}");
        }
    }
}
