//! Contact nodes on the links' surfaces: Poisson-disc sampling.
//!
//! Candidates are the corners of the triangles and then random points, uniform over the area; one is taken if no other
//! that was taken is nearer than the spacing (dart throwing: Cook, Stochastic sampling in computer graphics, 1986). So
//! edges and tips carry nodes, no two nodes are nearer than the spacing, and hardly a place of the surface is farther
//! than that from all of them. The same file gives the same nodes.

use super::{Arm, Robot, surface::Surface};
use crate::Error;
use crate::random::Random;
use crate::scene::MAX_CONTACT_NODES;
use glam::{DVec3, IVec3};
use std::collections::HashMap;
use std::path::Path;

/// Random candidates per node: with 30 times as many as nodes fit, less than 2 % of the area is left farther than the
/// spacing from all.
const CANDIDATES: f64 = 30.0;

/// Nodes on an area of the square of the spacing, about, if dart throwing leaves no gap: 0.70 discs of that diameter
/// (1).
const DENSITY: f64 = 0.7;

/// Least spacing (m): ten times the digits with which a scene shows its nodes.
const LEAST_SPACING: f64 = 1e-4;

/// Spacing where none is given and it does not make too many nodes (m).
const USUAL_SPACING: f64 = 5e-3;

/// How much wider a spacing is than the one that makes as many nodes as a scene takes (1): the density is an estimate.
const MARGIN: f64 = 1.05;

/// Seed of the random candidates.
const SEED: u64 = 1;

/// Contact nodes of a chain.
#[derive(Clone, Debug)]
pub struct ContactNodes {
    /// Distance that no two of a link fall below (m).
    pub spacing: f64,
    /// Positions in each joint's frame (m).
    pub of_joints: Vec<Vec<DVec3>>,
}

/// Puts contact nodes on the shapes of `arm` at a `spacing` (m); where none is given, 5 mm apart, or as far as there may
/// not be more of them. `packages`: folder in which ROS packages are looked for.
///
/// # Errors
/// If a mesh cannot be read, or there are no nodes or more than a scene takes.
pub fn sample(robot: &Robot, arm: &Arm, spacing: Option<f64>, packages: Option<&Path>) -> Result<ContactNodes, Error> {
    let refuse = |message: String| Error::at(&robot.path, message);
    if let Some(spacing) = spacing.filter(|spacing| !(*spacing >= LEAST_SPACING && spacing.is_finite())) {
        return Err(refuse(format!("the spacing is {spacing} m: it must be at least {LEAST_SPACING} m")));
    }
    let source = robot.source();
    let mut surfaces = Vec::new();
    for joint in &arm.joints {
        let of_joint: Result<Vec<Surface>, Error> =
            joint.shapes.iter().map(|shape| Surface::of(shape, &source, packages)).collect();
        surfaces.push(of_joint?);
    }
    let area: f64 = surfaces.iter().flatten().flat_map(Surface::areas).sum();
    let shapes = arm.joints.iter().flat_map(|joint| &joint.shapes);
    let oversize = shapes.zip(surfaces.iter().flatten()).find_map(|(shape, surface)| surface.oversize(shape));
    let mut trial = spacing.unwrap_or(USUAL_SPACING);
    loop {
        // Twice as many as a scene takes are refused before anything is sampled.
        let expected = DENSITY * area / (trial * trial);
        let of_joints: Vec<Vec<DVec3>> = if expected <= 2.0 * MAX_CONTACT_NODES as f64 {
            surfaces.iter().map(|surfaces| discs(surfaces, trial)).collect()
        } else {
            Vec::new()
        };
        let count = match of_joints.iter().map(Vec::len).sum::<usize>() {
            0 if expected == 0.0 => return Err(refuse(NO_SHAPE.into())),
            0 => expected,
            count if count <= MAX_CONTACT_NODES => return Ok(ContactNodes { spacing: trial, of_joints }),
            count => count as f64,
        };
        // In tenths of a millimetre.
        let wider = (1e4 * MARGIN * trial * (count / MAX_CONTACT_NODES as f64).sqrt()).ceil() / 1e4;
        if spacing.is_some() || oversize.is_some() || !wider.is_finite() {
            let remedy = oversize.unwrap_or_else(|| format!("give --spacing {wider} or more"));
            return Err(refuse(format!(
                "a spacing of {trial} m makes {count:.0} contact nodes, and a scene takes {MAX_CONTACT_NODES}: {remedy}"
            )));
        }
        trial = wider;
    }
}

/// An arm that cannot touch.
const NO_SHAPE: &str = "no moving link has a shape to put contact nodes on: add <collision> to the links that touch";

/// Points on the surfaces of one link.
fn discs(surfaces: &[Surface], spacing: f64) -> Vec<DVec3> {
    let mut discs = Discs { spacing, cells: HashMap::new(), taken: Vec::new() };
    surfaces.iter().flat_map(|surface| &surface.nodes).for_each(|node| discs.offer(*node));
    let mut random = Random::new(SEED);
    for surface in surfaces {
        let mut total = 0.0;
        let sums: Vec<f64> = surface
            .areas()
            .map(|area| {
                total += area;
                total
            })
            .collect();
        let candidates = (CANDIDATES * DENSITY * total / (spacing * spacing)).ceil() as usize;
        for _ in 0..candidates {
            let at = random.between(0.0, total);
            let number = sums.partition_point(|sum| *sum <= at).min(sums.len() - 1);
            let [a, b, c] = surface.corners(surface.triangles[number]);
            let (mut u, mut v) = (random.between(0.0, 1.0), random.between(0.0, 1.0));
            if u + v > 1.0 {
                (u, v) = (1.0 - u, 1.0 - v);
            }
            discs.offer(a + u * (b - a) + v * (c - a));
        }
    }
    discs.taken
}

/// Points that were taken, in cells of the spacing.
struct Discs {
    spacing: f64,
    cells: HashMap<IVec3, Vec<DVec3>>,
    taken: Vec<DVec3>,
}

impl Discs {
    /// Takes `point` if none that was taken is nearer than the spacing.
    fn offer(&mut self, point: DVec3) {
        let cell = (point / self.spacing).floor().as_ivec3();
        let near = |k: i32| IVec3::new(k % 3, k / 3 % 3, k / 9) - 1;
        let free = (0..27).filter_map(|k| self.cells.get(&cell.saturating_add(near(k)))).flatten();
        if free.into_iter().all(|other| other.distance(point) >= self.spacing) {
            self.cells.entry(cell).or_default().push(point);
            self.taken.push(point);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A plate of 0.2 x 0.1 m in two triangles.
    fn plate() -> Surface {
        let nodes = [(0.0, 0.0), (0.2, 0.0), (0.2, 0.1), (0.0, 0.1)].map(|(x, y)| DVec3::new(x, y, 0.0));
        Surface { nodes: nodes.to_vec(), triangles: vec![[0, 1, 2], [0, 2, 3]] }
    }

    #[test]
    fn nodes_keep_their_distance_and_leave_no_gap() {
        let spacing = 0.005;
        let nodes = discs(&[plate()], spacing);
        for (i, a) in nodes.iter().enumerate() {
            assert!(nodes[..i].iter().all(|b| a.distance(*b) >= spacing));
        }
        let expected = DENSITY * 0.2 * 0.1 / (spacing * spacing);
        assert!((nodes.len() as f64 / expected - 1.0).abs() < 0.15, "{} of {expected}", nodes.len());
        let places =
            (0..100).flat_map(|x| (0..50).map(move |y| DVec3::new(0.002 * f64::from(x), 0.002 * f64::from(y), 0.0)));
        let bare = places.filter(|place| nodes.iter().all(|node| node.distance(*place) > spacing)).count();
        assert!(bare < 100, "{bare} of 5000 places are farther than the spacing from all nodes");
        assert!(plate().nodes.iter().all(|corner| nodes.contains(corner)), "corners carry nodes");
    }

    #[test]
    fn the_same_surface_gives_the_same_nodes() {
        assert_eq!(discs(&[plate()], 0.01), discs(&[plate()], 0.01));
        // A shape that is there twice gets no more nodes.
        let twice = discs(&[plate(), plate()], 0.01).len() as f64;
        assert!((twice / discs(&[plate()], 0.01).len() as f64 - 1.0).abs() < 0.05);
    }
}
