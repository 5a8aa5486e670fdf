//! Whether the scene that a dataset holds describes what else it holds.
//!
//! A checksum finds damage, not a file that was put together of two. Joints, units and the size of a sphere are in both
//! parts, so that they can be compared.

use super::{Dataset, Surface};
use crate::{
    names::counted,
    scene::{Rendering, Shape},
};
use glam::DVec3;

/// Greatest share of its radius by which a node of a sphere is off it: what rounding leaves of coordinates far from the
/// origin (1).
const OFF_SPHERE: f64 = 1e-6;

impl Dataset {
    /// Checks that the scene in the dataset is one that this version reads, and that it has the joints of the grid, in
    /// their units, and the sphere whose surface is stored. A dataset without a scene has nothing to contradict.
    ///
    /// # Errors
    /// Says what contradicts what.
    pub fn check_scene(&self) -> Result<(), String> {
        if self.scene.trim().is_empty() {
            return Ok(());
        }
        let scene = Rendering::parse(&self.scene, "scene").map_err(|error| error.to_string())?;
        let (axes, joints) = (&self.grid.axes, &scene.proxy.joints);
        if axes.len() != joints.len() {
            return Err(format!(
                "the grid has {} and the proxy of the scene {}",
                counted(axes.len(), ["axis", "axes"]),
                counted(joints.len(), ["joint", "joints"])
            ));
        }
        for (axis, joint) in axes.iter().zip(joints) {
            let unit = joint.kind.unit();
            if axis.unit != unit {
                return Err(format!(
                    "axis {} is in {}, joint {} of the scene in {unit}",
                    axis.name, axis.unit, joint.name
                ));
            }
            // Measured tables have names of their own.
            if self.surface.is_some() && axis.name != joint.name {
                return Err(format!("axis {} stands where the scene has joint {}", axis.name, joint.name));
            }
        }
        match (&self.surface, scene.object.map(|object| object.shape)) {
            (Some(surface), Some(Shape::Sphere { centre, radius, .. } | Shape::Icosphere { centre, radius, .. })) => {
                check_sphere(surface, centre, radius)
            }
            _ => Ok(()),
        }
    }
}

fn check_sphere(surface: &Surface, centre: DVec3, radius: f64) -> Result<(), String> {
    let distances = surface.places().map(|place| place.distance(centre));
    let rounding = OFF_SPHERE * (radius + centre.length());
    match distances.enumerate().find(|(_, distance)| (distance - radius).abs() > rounding) {
        None => Ok(()),
        Some((node, distance)) => Err(format!(
            "node {node} of the surface is {distance} m from the middle of the scene's sphere, whose radius is \
             {radius} m"
        )),
    }
}
