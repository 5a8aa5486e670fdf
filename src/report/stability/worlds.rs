//! Haptized worlds that are known in closed form, for hard cases and tests of the loop: no bake, no file.

use crate::{
    JointVector,
    dataset::{Axis, Contacts, Dataset, Grid, Surface},
};
use std::fmt::Write;

/// Normal stiffness of the block [N/m].
pub const BLOCK_STIFFNESS: f64 = 500.0;

/// Stiffness of the half space [N m/rad].
pub const HALF_SPACE_STIFFNESS: f64 = 5.0;

/// The scene of a flat block under a fingertip that slides (x) and presses (z, positive down); `haptics` is the text of
/// the table `[haptics]`, empty for its defaults.
#[must_use]
pub fn block_scene(haptics: &str) -> String {
    format!(
        "graphics = false
[object]
mesh = {{ file = \"block.obj\" }}
springs = {{ kind = \"isotropic\", stiffness = 300.0 }}
ground = {{ stiffness = 100.0 }}

[[proxy.joint]]
name = \"slide\"
kind = \"prismatic\"
axis = [1.0, 0.0, 0.0]
limits = [-0.2, 0.2]

[[proxy.joint]]
name = \"press\"
kind = \"prismatic\"
axis = [0.0, 0.0, -1.0]
limits = [-0.2, 0.2]
nodes = [{{ at = [0.0, 0.0, 0.0] }}]

{haptics}
"
    )
}

/// The block, haptized: `U = 1/2 k z^2` below its surface z = 0, the force on its only node in contact.
#[must_use]
pub fn block(haptics: &str) -> Dataset {
    let grid = grid(&[("slide", "m", 5, 0.1), ("press", "m", 41, 1e-3)]);
    let (mut offsets, mut depths) = (vec![0_u64], Vec::new());
    for point in 0..grid.points() {
        let depth = grid.configuration(point)[1].max(0.0);
        if depth > 0.0 {
            depths.push(depth);
        }
        offsets.push(depths.len() as u64);
    }
    let contacts = |stiffness: f64| Contacts {
        offsets: offsets.clone().into(),
        nodes: vec![0; depths.len()].into(),
        forces: depths.iter().flat_map(|depth| [0.0, 0.0, (stiffness * depth) as f32]).collect::<Vec<_>>().into(),
    };
    let surface = Surface {
        nodes: vec![0.0, 0.0, 0.0, 0.1, 0.0, 0.0, 0.0, 0.1, 0.0].into(),
        triangles: vec![0_u32, 1, 2].into(),
        solid: None,
    };
    let direction = JointVector::from_slice(&[0.0, 1.0]);
    Dataset {
        // The finger is pushed up, the block down.
        contacts: Some(contacts(-BLOCK_STIFFNESS)),
        touches: Some(contacts(BLOCK_STIFFNESS)),
        surface: Some(surface),
        scene: block_scene(haptics),
        ..Dataset::of_half_space(grid, &direction, BLOCK_STIFFNESS)
    }
}

/// A half space in C-space for an arm of `joints` revolute joints: pressed by all joints alike.
#[must_use]
pub fn half_space(joints: usize, haptics: &str) -> Dataset {
    let mut scene = String::new();
    for joint in 0..joints {
        // Writing to a string cannot fail.
        let _ = write!(
            scene,
            "[[proxy.joint]]
kind = \"revolute\"
origin = [{}, 0.0, 0.0]
axis = {}
limits = [-3.0, 3.0]
mass = 0.05
centre_of_mass = [0.05, 0.0, 0.0]
inertia = [1e-6, 4e-5, 4e-5]
nodes = [{{ at = [0.1, 0.0, 0.0] }}]

",
            if joint == 0 { 0.0 } else { 0.1 },
            if joint % 2 == 0 { "[0.0, 1.0, 0.0]" } else { "[0.0, 0.0, 1.0]" },
        );
    }
    let count = if joints > 3 { 5 } else { 13 };
    let step = 1.2 / (count - 1) as f64;
    let axes: Vec<_> = (0..joints).map(|_| ("q", "rad", count, step)).collect();
    let mut direction = JointVector::zeros(joints);
    direction.fill(1.0 / (joints as f64).sqrt());
    Dataset { scene: scene + haptics, ..Dataset::of_half_space(grid(&axes), &direction, HALF_SPACE_STIFFNESS) }
}

/// Axes of (name, unit, count, step), centred on zero.
fn grid(axes: &[(&str, &str, usize, f64)]) -> Grid {
    let axis = |&(name, unit, count, step): &(&str, &str, usize, f64)| Axis {
        name: name.into(),
        unit: unit.into(),
        start: -0.5 * step * (count - 1) as f64,
        step,
        count,
    };
    Grid { axes: axes.iter().map(axis).collect() }
}
