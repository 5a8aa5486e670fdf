//! The surface through the onsets of a scan, and the body below it.
//!
//! A ball of radius r at x that just touches leaves x - r N on the surface, N being its outward normal there. Centres of
//! such balls lie on a surface of the same normals, so that N is that of the plane through the nearest centres (Hoppe et
//! al. 1992), on the side that the arm came from. The direction of force is no normal: friction turns it.
//!
//! Of an arm with several nodes the one that goes before all others is taken to touch, then the one nearest to the field.
//! The torque would tell more, but friction turns the force by more than what two nodes of a link differ in. Free rows say
//! that no node is inside: where one is, the field is moved out to it (carving).
//!
//! The body ends at the ground, and beside the approaches half way to where the next one would have been. The convex hull would be
//! too much: between measured parts nothing is known.

use super::nets;
use super::onset::Approaches;
use super::radial::{MOST_VALUES, RadialField};
use crate::proxy::{Chain, Pose, outer};
use crate::{Error, error, names::counted};
use glam::{DMat3, DVec3};
use std::fmt::Write as _;

/// First line of the file of a shape.
pub const OBJ: &str = "# Surface of a scanned object, by haptize; in metres";

/// Distance of the values off the surface, in spacings (1). Smaller: the noise of normals grows; larger: the field is
/// less the distance to a curved surface.
const OFF_SURFACE: f64 = 0.5;

/// Rounds of assigning nodes and fitting the field: with one node the first one is the last.
const ROUNDS: usize = 4;

/// Centres of the plane that is a place's normal: with itself, those of a square grid around it.
const NEIGHBOURS: usize = 9;

/// Steps of the power iteration for a plane's normal, and what is added to its scatter, over its trace (1): each step
/// lessens the share of other directions by how much thinner the scatter is along the normal.
const ITERATIONS: usize = 30;
const FLAT: f64 = 1e-9;

/// Where the body ends beside the approaches, in spacings (1): half way to where the next one would have been.
const REACH: f64 = 0.5;

/// Distance of the approaches around a place, in spacings (1): on the border of a grid there are some on one side.
const AROUND: f64 = 1.5;

/// Distance of a place of the surface from one that was touched, in spacings, up to which it is known (1).
const KNOWN: f64 = 1.05;

/// Least cosine of an approach to the surface's inward normal at which it tells where the surface is beside its place
/// (1): at less than thirty degrees to the surface the arm slides along it, and often there is no further place beyond.
const GRAZING: f64 = 0.5;

/// Depth of a free node inside the field from which it moves it, in spacings (1): the error that a surface may have.
const CARVED: f64 = 0.1;

/// Free places that move the field, at most, in onsets (1).
const MOST_CARVED: f64 = 0.5;

/// First smoothing, before it is known how well values predict each other, in spacings (1).
const SMOOTHING: f64 = 0.02;

/// The place of an onset.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Touched {
    /// Number of the approach.
    pub line: usize,
    /// The node that touched.
    pub node: usize,
    /// Place on the surface (m), and its outward normal.
    pub place: DVec3,
    /// See `place`.
    pub normal: DVec3,
    /// Direction of the approach.
    pub approach: DVec3,
    /// Standard deviation of the place along its approach (m).
    pub deviation: f64,
}

/// What free rows did.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize)]
pub struct Carving {
    /// Places of nodes in free rows.
    pub places: usize,
    /// Those that the field was moved out to.
    pub carved: usize,
}

/// A body whose surface was scanned.
pub struct ScannedShape {
    /// A place for each onset.
    pub touched: Vec<Touched>,
    /// What free rows did.
    pub carving: Carving,
    /// Median distance of a place from the nearest other (m).
    pub spacing: f64,
    /// Distance of each place to the surface through all others, rms (m).
    pub held_out: f64,
    /// Height of the ground (m).
    pub ground: f64,
    /// About the distance to the surface, positive outside.
    pub field: RadialField,
    /// Closed surface of the body (m), facing outward.
    pub nodes: Vec<DVec3>,
    /// See `nodes`.
    pub triangles: Vec<[u32; 3]>,
    /// Standard deviation of the surface at each node (m); none on walls and ground, which nobody touched.
    pub deviations: Vec<Option<f64>>,
}

impl ScannedShape {
    /// The body of the approaches by the arm `chain`, on a ground at the height `ground` (m); none: a spacing below the
    /// lowest place that the arm reached in contact.
    ///
    /// # Errors
    /// When there are too few onsets, or the ground lies above all of them.
    pub fn new(approaches: &Approaches, chain: &Chain, ground: Option<f64>) -> Result<Self, Error> {
        let onsets = &approaches.onsets;
        if onsets.len() < 4 || 5 * onsets.len() > 2 * MOST_VALUES {
            let most = 2 * MOST_VALUES / 5;
            let found = counted(onsets.len(), ["onset makes", "onsets make"]);
            return Err(error!("{found} no surface: scan between 4 and {most} approaches"));
        }
        let mut pose = chain.new_pose();
        let mut poses = Vec::with_capacity(onsets.len());
        for onset in onsets {
            chain.pose(&onset.q, &mut pose);
            poses.push(pose.clone());
        }
        let mut touched: Vec<Touched> =
            onsets.iter().zip(&poses).map(|(onset, pose)| first_guess(onset, pose, chain)).collect();
        let spacing = spacing(&touched)?;
        turn(&mut touched, &poses, chain);
        let free = free_places(approaches, chain);
        let mut carved: Vec<DVec3> = Vec::new();
        let (mut field, mut scale, mut held_out) = fit(&touched, &carved, spacing, SMOOTHING * spacing)?;
        for round in 0..ROUNDS {
            for (touched, (onset, pose)) in touched.iter_mut().zip(onsets.iter().zip(&poses)) {
                touched.assign(&field, (onset, pose), chain);
            }
            turn(&mut touched, &poses, chain);
            if round + 1 == ROUNDS / 2 || round + 1 == ROUNDS {
                carve(&field, &free, spacing, (MOST_CARVED * onsets.len() as f64) as usize, &mut carved);
            }
            (field, scale, held_out) = fit(&touched, &carved, spacing, scale)?;
        }
        let ground = ground.unwrap_or_else(|| lowest(approaches, chain) - spacing);
        let highest = touched.iter().map(|touched| touched.place.z).fold(f64::NEG_INFINITY, f64::max);
        if highest <= ground {
            return Err(error!(
                "the ground at z = {ground} m lies above the whole surface, whose top is at {highest:.4} m: give a lower \
                 --ground"
            ));
        }
        let places = free.len();
        let carving = Carving { places, carved: carved.len() };
        let (nodes, triangles, deviations) = (Vec::new(), Vec::new(), Vec::new());
        let mut shape = Self { touched, carving, spacing, held_out, ground, field, nodes, triangles, deviations };
        shape.mesh(scale);
        Ok(shape)
    }

    /// How far `x` lies beside the approaches, less how far they reach (m): the mean offset of those around it, weighted by
    /// their nearness. Beyond the last line of a grid that is the distance from it, to a hundredth of the spacing; where one
    /// is missing from the grid, it is at most 0.35 spacings.
    fn beside(&self, x: DVec3) -> f64 {
        let around = AROUND * self.spacing;
        let (mut sum, mut weights) = (DVec3::ZERO, 0.0);
        for touched in &self.touched {
            let off = touched.place - x;
            let across = off - touched.approach * off.dot(touched.approach);
            let weight = (1.0 - across.length_squared() / (around * around)).max(0.0).powi(2);
            (sum, weights) = (sum + weight * across, weights + weight);
        }
        let offset = if weights > 0.0 { (sum / weights).length() } else { around };
        offset - REACH * self.spacing
    }

    /// Standard deviation of the surface where it was touched, rms (m).
    #[must_use]
    pub fn deviation(&self) -> f64 {
        let known = || self.deviations.iter().flatten();
        (known().map(|deviation| deviation * deviation).sum::<f64>() / known().count().max(1) as f64).sqrt()
    }

    /// Returns how deep the nodes of `chain` at `q` are below the surface that was touched, or its continuation: negative
    /// where none is (m). `pose` is overwritten.
    #[must_use]
    pub fn depth(&self, q: &[f64], chain: &Chain, pose: &mut Pose) -> f64 {
        chain.pose(q, pose);
        let depths = pose.nodes.iter().zip(&chain.nodes).map(|(x, node)| node.radius - self.field.value(*x));
        depths.fold(f64::NEG_INFINITY, f64::max)
    }

    /// The surface of the body, and how well it is known. `scale`: see [`fit`].
    fn mesh(&mut self, scale: f64) {
        let low = self.touched.iter().map(|touched| touched.place).fold(DVec3::INFINITY, DVec3::min);
        let high = self.touched.iter().map(|touched| touched.place).fold(DVec3::NEG_INFINITY, DVec3::max);
        let margin = DVec3::splat((AROUND + 2.0) * self.spacing);
        let low = (low - margin).with_z(self.ground - margin.z);
        let shape = &*self;
        let value = |x: DVec3| shape.field.value(x).max(shape.ground - x.z).max(shape.beside(x));
        let (nodes, triangles) = nets::surface([low, high + margin], self.spacing, value);
        let faced: Vec<DVec3> =
            shape.touched.iter().filter(|touched| touched.is_faced()).map(|touched| touched.place).collect();
        let is_measured = |x: &DVec3| {
            let is_near = faced.iter().any(|place| place.distance(*x) < KNOWN * shape.spacing);
            is_near && shape.field.value(*x).abs() < CARVED * shape.spacing
        };
        let measured: Vec<bool> = nodes.iter().map(is_measured).collect();
        let places: Vec<DVec3> = nodes.iter().zip(&measured).filter(|(_, is)| **is).map(|(x, _)| *x).collect();
        let mut variances = self.field.variances(&places).into_iter();
        let deviations = measured.iter().map(|is| if *is { variances.next() } else { None });
        self.deviations = deviations.map(|variance| variance.map(|variance| (scale * variance).sqrt())).collect();
        (self.nodes, self.triangles) = (nodes, triangles);
    }

    /// The body as an OBJ file, in metres.
    #[must_use]
    pub fn obj(&self) -> String {
        let mut text = format!("{OBJ}\n");
        // Writing to a string fails only where memory does.
        for DVec3 { x, y, z } in &self.nodes {
            let _ = writeln!(text, "v {x:.7} {y:.7} {z:.7}");
        }
        for [a, b, c] in &self.triangles {
            let _ = writeln!(text, "f {} {} {}", a + 1, b + 1, c + 1);
        }
        text
    }
}

/// Median distance of each place from the nearest other (m).
fn spacing(touched: &[Touched]) -> Result<f64, Error> {
    let nearest = |(i, own): (usize, &Touched)| {
        let others = touched.iter().enumerate().filter(|(j, _)| *j != i);
        others.map(|(_, other)| own.place.distance(other.place)).fold(f64::INFINITY, f64::min)
    };
    let mut distances: Vec<f64> = touched.iter().enumerate().map(nearest).collect();
    let middle = distances.len() / 2;
    let spacing = *distances.select_nth_unstable_by(middle, f64::total_cmp).1;
    if spacing > 0.0 { Ok(spacing) } else { Err("the approaches touch one place only: spread them".into()) }
}

/// The node that goes before all others.
fn first_guess(onset: &super::Onset, pose: &Pose, chain: &Chain) -> Touched {
    let velocities: Vec<DVec3> = (0..chain.nodes.len()).map(|node| onset.velocity(chain, pose, node)).collect();
    let fastest = velocities.iter().copied().max_by(|a, b| a.length().total_cmp(&b.length())).unwrap_or_default();
    let forward = |node: &usize| pose.nodes[*node].dot(fastest.normalize_or_zero()) + chain.nodes[*node].radius;
    let node = (0..chain.nodes.len()).max_by(|a, b| forward(a).total_cmp(&forward(b))).unwrap_or(0);
    let approach = velocities[node].normalize_or_zero();
    let place = pose.nodes[node] + chain.nodes[node].radius * approach;
    Touched { line: onset.line, node, place, normal: -approach, approach, deviation: onset.deviation }
}

impl Touched {
    /// Whether the approach came from in front of the surface.
    #[must_use]
    pub fn is_faced(&self) -> bool {
        -self.approach.dot(self.normal) > GRAZING
    }

    /// Takes the node that is nearest to `field`.
    fn assign(&mut self, field: &RadialField, (onset, pose): (&super::Onset, &Pose), chain: &Chain) {
        let gap = |node: &usize| field.value(pose.nodes[*node]) - chain.nodes[*node].radius;
        self.node = (0..pose.nodes.len()).min_by(|a, b| gap(a).total_cmp(&gap(b))).unwrap_or(self.node);
        let velocity = onset.velocity(chain, pose, self.node);
        self.approach = velocity.normalize_or(self.approach);
        self.deviation = onset.deviation * velocity.length();
    }
}

/// Takes the normals, and with them the places, from the centres of the nodes that touched.
fn turn(touched: &mut [Touched], poses: &[Pose], chain: &Chain) {
    let centres: Vec<DVec3> = touched.iter().zip(poses).map(|(touched, pose)| pose.nodes[touched.node]).collect();
    for (touched, centre) in touched.iter_mut().zip(&centres) {
        let mut near = centres.clone();
        let count = NEIGHBOURS.min(near.len());
        near.sort_by(|a, b| a.distance_squared(*centre).total_cmp(&b.distance_squared(*centre)));
        let mean = near[..count].iter().sum::<DVec3>() / count as f64;
        let scatter = near[..count].iter().fold(DMat3::ZERO, |sum, x| sum + outer(*x - mean));
        let trace = scatter.x_axis.x + scatter.y_axis.y + scatter.z_axis.z;
        let inverse = (scatter + DMat3::from_diagonal(DVec3::splat(FLAT * trace))).inverse();
        let normal = (0..ITERATIONS).fold(-touched.approach, |normal, _| (inverse * normal).normalize_or(normal));
        touched.normal = if normal.dot(touched.approach) > 0.0 { -normal } else { normal };
        touched.place = *centre - chain.nodes[touched.node].radius * touched.normal;
    }
}

/// Height of the lowest place that a node reached in contact (m).
fn lowest(approaches: &Approaches, chain: &Chain) -> f64 {
    let mut pose = chain.new_pose();
    let mut lowest = |q: &[f64]| {
        chain.pose(q, &mut pose);
        let heights = pose.nodes.iter().zip(&chain.nodes).map(|(x, node)| x.z - node.radius);
        heights.fold(f64::INFINITY, f64::min)
    };
    approaches.contact.iter().map(|row| lowest(&row.q)).fold(f64::INFINITY, f64::min)
}

/// Places of all nodes in free rows, and their radii (m).
fn free_places(approaches: &Approaches, chain: &Chain) -> Vec<(DVec3, f64)> {
    let mut pose = chain.new_pose();
    let mut places = Vec::with_capacity(approaches.free.len() * chain.nodes.len());
    for q in &approaches.free {
        chain.pose(q, &mut pose);
        places.extend(pose.nodes.iter().zip(&chain.nodes).map(|(x, node)| (*x, node.radius)));
    }
    places
}

/// Adds to `carved` those of the `free` places, deepest first and apart from one another, that lie inside `field`.
fn carve(field: &RadialField, free: &[(DVec3, f64)], spacing: f64, most: usize, carved: &mut Vec<DVec3>) {
    let depths = free.iter().map(|(x, radius)| (radius - field.value(*x), *x, *radius));
    let mut inside: Vec<_> = depths.filter(|(depth, ..)| *depth > CARVED * spacing).collect();
    inside.sort_by(|a, b| b.0.total_cmp(&a.0));
    for (_, x, radius) in inside {
        let place = x - radius * field.gradient(x).normalize_or_zero();
        if carved.len() < most && carved.iter().all(|other| other.distance(place) > OFF_SURFACE * spacing) {
            carved.push(place);
        }
    }
}

/// The field that is zero at all places and grows by one along their normals, with the scale C of its variances (m) and
/// how well places predict each other, rms (m). `scale`: C so far.
fn fit(touched: &[Touched], carved: &[DVec3], spacing: f64, scale: f64) -> Result<(RadialField, f64, f64), Error> {
    let (n, off) = (touched.len(), OFF_SURFACE * spacing);
    let on = touched.iter().map(|touched| touched.place);
    let above = touched.iter().map(|touched| touched.place + off * touched.normal);
    let points: Vec<DVec3> = on.chain(above).chain(carved.iter().copied()).collect();
    let values: Vec<f64> = (0..points.len()).map(|i| if (n..2 * n).contains(&i) { off } else { 0.0 }).collect();
    let rho = |deviation: f64| deviation * deviation / scale;
    let along = |touched: &Touched| touched.deviation * touched.approach.dot(touched.normal).abs();
    let of_touched = touched.iter().map(|touched| rho(along(touched)));
    let of_carved = carved.iter().map(|_| rho(CARVED * spacing));
    let rho: Vec<f64> = of_touched.clone().chain(of_touched).chain(of_carved).collect();
    let field = RadialField::new(&points, &values, &rho)?;
    let groups: Vec<Vec<usize>> = (0..n).map(|i| vec![i, n + i]).collect();
    let held_out = field.held_out(&groups);
    let mean = |sum: f64| sum / n as f64;
    let scale = mean(held_out.iter().map(|[difference, variance]| difference * difference / variance).sum());
    let rms = mean(held_out.iter().map(|[difference, _]| difference * difference).sum()).sqrt();
    Ok((field, scale.max(f64::MIN_POSITIVE), rms))
}
