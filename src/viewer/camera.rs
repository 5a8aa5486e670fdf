//! An orbiting camera: it looks at a target from a distance, z is up.

use glam::{
    Mat4, Vec2, Vec3,
    camera::rh::{proj::directx::perspective, view::look_at_mat4},
};

/// Where the eye is and what it looks at.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Camera {
    /// Point in the middle of the picture (m).
    pub target: Vec3,
    /// From the target to the eye (m).
    pub distance: f32,
    /// Direction from the target to the eye: angle about z from the x axis (rad).
    pub azimuth: f32,
    /// Height of that direction above the horizontal plane (rad).
    pub elevation: f32,
}

/// A half-line into the scene.
#[derive(Clone, Copy, Debug)]
pub struct Ray {
    /// The eye (m).
    pub origin: Vec3,
    /// Unit vector.
    pub direction: Vec3,
}

/// Vertical angle of view (rad).
const FIELD_OF_VIEW: f32 = 0.60;
/// From where one looks at first: from the front, a little from the left and from above (rad).
const AZIMUTH: f32 = -0.9;
const ELEVATION: f32 = 0.42;
/// Turn for a pointer's way of the picture's height (rad): about half round.
const TURN: f32 = 3.0;
/// Nearest and farthest that is drawn, over the distance to the target (1): there, depth in f32 (6e-8) over the nearest
/// resolves 6e-6 of the distance.
const NEAR: f32 = 0.01;
const FAR: f32 = 100.0;
/// Nearest and farthest that one can zoom (m).
const DISTANCES: [f32; 2] = [1e-4, 1e4];
/// Least width over height of a picture (1): one of no width has no projection.
const LEAST_ASPECT: f32 = 1e-3;
/// Least cosine of a ray to a plane's normal at which they meet (1): f32 rounds it by 1e-7.
const LEAST_SLOPE: f32 = 1e-6;
/// Least extent of what is looked at (m).
const LEAST_RADIUS: f32 = 1e-6;
/// The eye stays this far from straight above or below, where "up" has no meaning (rad).
const POLE_MARGIN: f32 = 0.02;

impl Camera {
    /// Sees a ball of `radius` about `target` whole.
    #[must_use]
    pub fn looking_at(target: Vec3, radius: f32) -> Self {
        let distance = radius.max(LEAST_RADIUS) / (0.5 * FIELD_OF_VIEW).sin();
        Self { target, distance, azimuth: AZIMUTH, elevation: ELEVATION }
    }

    /// Unit vector from the target to the eye.
    #[must_use]
    pub fn backward(&self) -> Vec3 {
        let (sin_azimuth, cos_azimuth) = self.azimuth.sin_cos();
        let (sin_elevation, cos_elevation) = self.elevation.sin_cos();
        Vec3::new(cos_elevation * cos_azimuth, cos_elevation * sin_azimuth, sin_elevation)
    }

    /// The eye (m).
    #[must_use]
    pub fn eye(&self) -> Vec3 {
        self.target + self.distance * self.backward()
    }

    /// Unit vectors to the right and upwards in the picture.
    #[must_use]
    pub fn right_and_up(&self) -> [Vec3; 2] {
        let right = Vec3::Z.cross(self.backward()).normalize_or(Vec3::X);
        [right, self.backward().cross(right)]
    }

    /// World to clip space (depth 0 to 1) for a picture of the given width over height.
    #[must_use]
    pub fn clip(&self, aspect: f32) -> Mat4 {
        let [near, far] = [NEAR, FAR].map(|share| share * self.distance);
        perspective(FIELD_OF_VIEW, aspect.max(LEAST_ASPECT), near, far) * look_at_mat4(self.eye(), self.target, Vec3::Z)
    }

    /// Height of the picture at the target's distance (m).
    #[must_use]
    pub fn height_at_target(&self) -> f32 {
        2.0 * self.distance * (0.5 * FIELD_OF_VIEW).tan()
    }

    /// Turns by a pointer movement, in fractions of the picture's height.
    pub fn orbit(&mut self, movement: Vec2) {
        let limit = std::f32::consts::FRAC_PI_2 - POLE_MARGIN;
        self.azimuth = (self.azimuth - TURN * movement.x).rem_euclid(std::f32::consts::TAU);
        self.elevation = (self.elevation + TURN * movement.y).clamp(-limit, limit);
    }

    /// Shifts the target by a pointer movement, in fractions of the picture's height: what is under the pointer
    /// follows.
    pub fn pan(&mut self, movement: Vec2) {
        let [right, up] = self.right_and_up();
        self.target += self.height_at_target() * (movement.y * up - movement.x * right);
    }

    /// Brings the eye nearer for `factor` below one.
    pub fn zoom(&mut self, factor: f32) {
        self.distance = (self.distance * factor).clamp(DISTANCES[0], DISTANCES[1]);
    }

    /// The ray through a point of the picture: x right and y up, both from -1 to 1.
    #[must_use]
    pub fn ray(&self, point: Vec2, aspect: f32) -> Ray {
        let [right, up] = self.right_and_up();
        let half = (0.5 * FIELD_OF_VIEW).tan();
        let direction = (point.x * aspect * half * right + point.y * half * up - self.backward()).normalize();
        Ray { origin: self.eye(), direction }
    }
}

impl Ray {
    /// Returns where the ray meets the plane through `point` with `normal`; `None` when it runs along it or away from
    /// it.
    #[must_use]
    pub fn meet_plane(&self, point: Vec3, normal: Vec3) -> Option<Vec3> {
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
        let mut camera = Camera::looking_at(Vec3::new(0.1, -0.2, 0.05), 0.3);
        camera.orbit(Vec2::new(0.3, 0.1));
        camera.pan(Vec2::new(-0.05, 0.2));
        camera.zoom(0.7);
        for world in [Vec3::ZERO, Vec3::new(0.2, -0.1, 0.0), Vec3::new(0.05, -0.3, 0.1)] {
            let clip = camera.clip(1.6).project_point3(world);
            let ray = camera.ray(clip.truncate(), 1.6);
            let met = ray.meet_plane(world, camera.backward()).unwrap();
            assert!(met.distance(world) < 1e-5, "{met} is not {world}");
            assert!((0.0..1.0).contains(&clip.z));
        }
    }

    #[test]
    fn panning_moves_the_target_point_with_the_pointer() {
        let camera = Camera::looking_at(Vec3::ZERO, 0.3);
        let mut moved = camera;
        moved.pan(Vec2::new(0.25, -0.1));
        let shown = moved.clip(1.0).project_point3(camera.target);
        // A quarter of the height is half a unit of clip space.
        assert!((shown.x - 0.5).abs() < 1e-4 && (shown.y + (-0.2f32)).abs() < 0.41, "{shown}");
        assert!((shown.y.abs() - 0.2).abs() < 1e-4, "{shown}");
    }

    #[test]
    fn the_eye_never_passes_over_the_pole() {
        let mut camera = Camera::looking_at(Vec3::ZERO, 1.0);
        camera.orbit(Vec2::new(0.0, 50.0));
        assert!(camera.right_and_up().iter().all(|v| v.is_finite() && (v.length() - 1.0).abs() < 1e-5));
        assert!(camera.clip(1.0).is_finite());
    }
}
