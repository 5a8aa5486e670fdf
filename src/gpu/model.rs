//! Object, proxy and contact law as buffers on the device: what stays the same for all configurations of a sweep.
//!
//! Positions are relative to the contact model's centre, so that f32 resolves the object and not its distance from the
//! origin.

use super::{
    buffer::StorageBuffer, context::Context, error::GpuError, layout::Parameters, precision::Precision,
    shaders::GPU_FAR_AWAY,
};
use crate::{
    contact::{self, geometry::bounding_volumes::CULLING_SLACK},
    proxy,
    scene::{Algorithm, JointKind},
};
use glam::DVec3;

/// Part of the band of gaps at rest within which contact or not is decided in f64, relative to the object's extent (1):
/// distances between coordinates of up to some extents are rounded by 6e-8 of each.
const GPU_GAP_BAND_PER_EXTENT: f64 = 1e-6;

/// The other part of the band, for each joint, relative to the chain's reach (1): a joint turns a lever no longer than
/// the reach by a cosine and a sine that are rounded by 6e-8 each, and rounds products and sums as often again; six of
/// these roundings in all.
const GPU_GAP_BAND_PER_JOINT: f64 = 4e-7;

/// Widening of bounding spheres, relative to the object's extent (1): coordinates of up to ten extents (a proxy node
/// far away) are rounded to f32 by 6e-8 each.
const GPU_BOUND_SLACK: f64 = 1e-6;

/// Gaps at rest up to which they are all known, relative to the object's extent (1): what comes into contact as the
/// surface moves was hardly farther. Where it was the closest facet takes longer to find, no more.
const KNOWN_PER_EXTENT: f64 = 0.25;

/// Greatest contact stiffness of the energy form in f32, in units of the stiffness of the object's softest node (1): a
/// depth is known to about 1e-6 of the object's displacement, a force to this many times that. What is stiffer is
/// stiffened from there in f64, where nothing moves by more than a thousandth of its displacement.
const GPU_STIFFNESS: f64 = 1e3;

/// The device's copy of arm and surface at rest.
pub struct DeviceModel {
    pub(super) precision: Precision,
    /// Without the configurations, which each dispatch sets.
    pub(super) parameters: Parameters,
    pub(super) chain: StorageBuffer,
    /// The flat triangles in f32: see `shaders/detection.wgsl`.
    pub(super) rest: StorageBuffer,
    pub(super) mesh: StorageBuffer,
    /// The facets in the order of the tree of bounding spheres.
    pub(super) order: StorageBuffer,
    /// The contact surface: see `shaders/gap.wgsl`.
    pub(super) surface: StorageBuffer,
    /// Whether its facets are bent.
    pub(super) is_smooth: bool,
    /// Gaps in f32, to the flat triangles, are those to the contact surface but for this (m).
    pub(super) gap_band: f64,
    /// Gaps to the contact surface no farther than this from zero are left open (m).
    pub(super) open_band: f64,
}

/// Contact stiffness of the energy form in f32 (N/m); what is stiffer is stiffened when the result is settled in f64.
pub(super) fn stiffness(model: &contact::Model<'_>) -> f64 {
    model.kc.min(GPU_STIFFNESS / model.max_nodal_compliance)
}

impl DeviceModel {
    /// Uploads a model, for stages that compute in `precision`.
    ///
    /// # Errors
    /// When a buffer exceeds the device's limits or memory.
    pub fn new(context: &Context, model: &contact::Model<'_>, precision: Precision) -> Result<Self, GpuError> {
        let contact::Model { object, chain, contact, .. } = model;
        if contact.algorithm != Algorithm::Energy {
            return Err(GpuError::Algorithm(contact.algorithm.name()));
        }
        let extent = extent(model);
        let rounding = GPU_GAP_BAND_PER_EXTENT * extent
            + GPU_GAP_BAND_PER_JOINT * chain.joints.len() as f64 * reach(chain, model.surface.centre);
        // A smooth surface stands off the flat triangles.
        let gap_band = model.surface.bulge + rounding;
        let order = leaves(model);
        let numbers = |what, numbers: &[f64]| StorageBuffer::from_slice(context, what, &precision.encode(numbers));
        Ok(Self {
            precision,
            parameters: Parameters {
                configurations: 0,
                joints: chain.joints.len() as u32,
                proxy_nodes: chain.nodes.len() as u32,
                surface_nodes: object.surface_nodes as u32,
                triangles: object.triangles.len() as u32,
                leaves: order.len() as u32,
                gap_band: (gap_band as f32).next_up(),
                known_to: (KNOWN_PER_EXTENT * extent) as f32,
            },
            chain: numbers("chain", &joints_and_nodes(model))?,
            rest: StorageBuffer::from_slice(context, "surface at rest", &rest(model, extent))?,
            mesh: StorageBuffer::from_slice(context, "surface mesh", &mesh(model))?,
            order: StorageBuffer::from_slice(context, "order of the facets", &order)?,
            surface: numbers("contact surface", surface(model, precision).as_flattened())?,
            is_smooth: model.surface.smooth.is_some(),
            gap_band,
            open_band: if precision == Precision::Double { 0.0 } else { rounding },
        })
    }

    /// Size of what the proxy is tested against for contact at rest: of the flat triangles, and of the contact surface
    /// (B).
    pub(super) fn surface_bytes(&self) -> [u64; 2] {
        [self.rest.size() + self.mesh.size() + self.order.size(), self.surface.size()]
    }
}

/// Greatest distance of a surface node to the object's centre (m).
pub(super) fn extent(model: &contact::Model<'_>) -> f64 {
    model.surface.positions.iter().map(|n| n.length()).fold(0.0, f64::max)
}

/// Returns the margin of bounding spheres, for stages that compute in `precision` (m).
pub(super) fn culling_slack(model: &contact::Model<'_>, precision: Precision) -> f64 {
    match precision {
        Precision::Single => GPU_BOUND_SLACK * extent(model),
        Precision::Double => CULLING_SLACK * model.surface.extent,
    }
}

/// Three coordinates, and a fourth number.
pub(super) fn four(v: DVec3, fourth: f64) -> [f64; 4] {
    [v.x, v.y, v.z, fourth]
}

/// A sphere around `points`, widened by `slack`: centre and radius (m).
pub(super) fn sphere_around(points: &[DVec3], slack: f64) -> [f64; 4] {
    let centre = points.iter().sum::<DVec3>() / points.len() as f64;
    let radius = points.iter().map(|point| point.distance(centre)).fold(0.0, f64::max);
    four(centre, radius + slack)
}

/// Distance from the object's centre that no proxy node ever exceeds (m).
fn reach(chain: &proxy::Chain, centre: DVec3) -> f64 {
    let mut length = 0.0;
    let lengths: Vec<f64> = (chain.joints.iter().enumerate())
        .map(|(k, joint)| {
            let slide = match joint.kind {
                JointKind::Revolute => 0.0,
                JointKind::Prismatic => joint.limits[0].abs().max(joint.limits[1].abs()),
            };
            let origin = if k == 0 { joint.origin - centre } else { joint.origin };
            length += origin.length() + slide;
            length
        })
        .collect();
    let tip = |node: &proxy::Node| lengths[node.link] + node.position.length();
    chain.nodes.iter().map(tip).fold(0.0, f64::max)
}

/// Bounding spheres of the flat triangles, radii of the proxy nodes and surface nodes: see `shaders/detection.wgsl`.
fn rest(model: &contact::Model<'_>, extent: f64) -> Vec<[f32; 4]> {
    let corners = |t: u32| model.object.triangles[t as usize].map(|j| model.surface.positions[j as usize]).to_vec();
    let mut numbers = tree(model, corners, GPU_BOUND_SLACK * extent);
    numbers.extend(model.chain.nodes.iter().map(|node| [node.radius, 0.0, 0.0, 0.0]));
    numbers.extend(model.surface.positions.iter().map(|&node| four(node, 0.0)));
    numbers.into_iter().map(|row| row.map(|number| number as f32)).collect()
}

/// Corners, neighbours, and lists around nodes: see `shaders/mesh.wgsl`.
pub(super) fn mesh(model: &contact::Model<'_>) -> Vec<u32> {
    let (object, topology) = (model.object, &model.object.topology);
    let mut mesh: Vec<u32> = object.triangles.iter().flatten().copied().collect();
    mesh.extend(topology.across.iter().flatten());
    mesh.extend(&topology.around_offsets);
    mesh.extend(&topology.around);
    mesh
}

/// Origin, axis and kind of each joint, the first origin relative to the object's centre; position and link of each
/// proxy node.
pub(super) fn joints_and_nodes(model: &contact::Model<'_>) -> Vec<f64> {
    let mut numbers = Vec::new();
    for (k, joint) in model.chain.joints.iter().enumerate() {
        let origin = if k == 0 { joint.origin - model.surface.centre } else { joint.origin };
        numbers.extend(origin.to_array());
        numbers.extend(joint.axis.to_array());
        numbers.push(f64::from(u8::from(joint.kind == JointKind::Prismatic)));
    }
    for node in &model.chain.nodes {
        numbers.extend(node.position.to_array());
        numbers.push(node.link as f64);
    }
    numbers
}

/// The control points of facet `t` at rest, of a flat one its corners (m).
pub(super) fn controls(model: &contact::Model<'_>, t: u32) -> Vec<DVec3> {
    let facet = model.surface.facet_at_rest(t);
    facet.net.map_or_else(|| facet.corners.to_vec(), |net| net.to_vec())
}

/// The facets in an order in which neighbours are near each other, the last one as often as makes a power of two.
pub(super) fn leaves(model: &contact::Model<'_>) -> Vec<u32> {
    let mut order: Vec<u32> = model.surface.bounds.order().collect();
    order.resize(order.len().next_power_of_two(), order.last().copied().unwrap_or(0));
    order
}

/// Spheres around the `points` of the facets, none of which lies outside these, widened by `slack` (m): centre and
/// radius of each node of the tree of `shaders/bounding_spheres.wgsl`.
fn tree(model: &contact::Model<'_>, points: impl Fn(u32) -> Vec<DVec3>, slack: f64) -> Vec<[f64; 4]> {
    let order: Vec<u32> = model.surface.bounds.order().collect();
    let leaves = order.len().next_power_of_two();
    let nowhere = [0.0, 0.0, 0.0, -f64::from(GPU_FAR_AWAY)];
    let sphere = |node: usize| {
        let level = node.ilog2();
        let under = leaves >> level;
        let facets = order.iter().skip((node - (1 << level)) * under).take(under);
        let points: Vec<DVec3> = facets.flat_map(|&t| points(t)).collect();
        if points.is_empty() { nowhere } else { sphere_around(&points, slack) }
    };
    std::iter::once(nowhere).chain((1..2 * leaves).map(sphere)).collect()
}

/// The tree of the contact surface.
pub(super) fn bounding_spheres(model: &contact::Model<'_>, precision: Precision) -> Vec<[f64; 4]> {
    tree(model, |t| controls(model, t), culling_slack(model, precision))
}

/// Bounding spheres, radii of proxy nodes and control points: see `shaders/gap.wgsl`.
fn surface(model: &contact::Model<'_>, precision: Precision) -> Vec<[f64; 4]> {
    let mut numbers = bounding_spheres(model, precision);
    numbers.extend(model.chain.nodes.iter().map(|node| [node.radius, 0.0, 0.0, 0.0]));
    let facets = 0..model.object.triangles.len() as u32;
    numbers.extend(facets.flat_map(|t| controls(model, t)).map(|point| four(point, 0.0)));
    numbers
}
