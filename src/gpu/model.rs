//! Object, proxy and contact law as buffers on the device: what stays the same for all configurations of a sweep.
//!
//! Positions are relative to the contact model's centre, so that f32 resolves the object and not its distance from the
//! origin.

use super::{
    context::{Context, GpuError},
    kernel::StorageBuffer,
    layout::{Joint, Parameters, ProxyNode},
    shaders::{CLUSTER, GROUP},
};
use crate::{
    contact, proxy,
    scene::{Algorithm, JointKind},
    tolerances,
};
use glam::DVec3;

/// Invocations of a workgroup of the equilibrium stages, one of which keeps one contact: the least that GPUs run in
/// step.
pub(super) const LANES: u32 = 32;

/// The device's copy of a contact model.
pub struct DeviceModel {
    /// Without the configurations, which each dispatch sets.
    pub(super) parameters: Parameters,
    pub(super) joints: StorageBuffer,
    pub(super) proxy_nodes: StorageBuffer,
    pub(super) rest: StorageBuffer,
    pub(super) mesh: StorageBuffer,
    pub(super) clusters: StorageBuffer,
    /// Gaps in f32, to the flat triangles, are those to the contact surface but for this [m].
    pub(super) gap_band: f64,
}

/// Contact stiffness of the energy form in f32 [N/m]. The kernels give it to every proxy node; each node's own, which
/// differs where a link has a stiffness per length, enters when the result is settled in f64.
pub(super) fn stiffness(model: &contact::Model<'_>) -> f64 {
    model.kc.min(tolerances::GPU_STIFFNESS / model.max_nodal_compliance)
}

impl DeviceModel {
    /// Uploads a model.
    ///
    /// # Errors
    /// When a buffer exceeds the device's limits or memory.
    pub fn new(context: &Context, model: &contact::Model<'_>) -> Result<Self, GpuError> {
        let contact::Model { object, chain, compliance, contact, .. } = model;
        if contact.updates > 0 {
            return Err(GpuError::Unsupported("updates"));
        }
        if !compliance.is_whole() && contact.algorithm == Algorithm::Paper {
            return Err(GpuError::TooManyNodes { nodes: object.surface_nodes, limit: contact::Model::WHOLE });
        }
        let extent = model.surface.positions.iter().map(|n| n.length()).fold(0.0, f64::max);
        // The kernels know the flat triangles; a smooth surface stands off these.
        let gap_band = model.surface.bulge
            + tolerances::GPU_GAP_BAND_PER_EXTENT * extent
            + tolerances::GPU_GAP_BAND_PER_JOINT * chain.joints.len() as f64 * reach(chain, model.surface.centre);
        let corners = |t: &[u32; 3]| t.map(|j| model.surface.positions[j as usize]);
        let edge = |[a, b, c]: [DVec3; 3]| a.distance(b).max(b.distance(c)).max(c.distance(a));
        let longest_edge = object.triangles.iter().map(|t| edge(corners(t))).fold(0.0, f64::max);
        let clusters: Vec<u32> = model.surface.bounds.order().collect();
        Ok(Self {
            parameters: Parameters {
                joints: chain.joints.len() as u32,
                proxy_nodes: chain.nodes.len() as u32,
                surface_nodes: object.surface_nodes as u32,
                covered: compliance.nodes.len() as u32,
                triangles: object.triangles.len() as u32,
                max_iterations: contact.max_iterations.min(tolerances::GPU_MAX_ITERATIONS),
                stiffness: contact.stiffness as f32,
                kc: stiffness(model) as f32,
                tolerance: contact.tolerance.max(tolerances::GPU_LEAST_TOLERANCE) as f32,
                softest: model.max_nodal_compliance as f32,
                least_distance: (tolerances::GPU_LEAST_DISTANCE_PER_EXTENT * extent) as f32,
                depth_rounding: (tolerances::GPU_DEPTH_ROUNDING_PER_EDGE * longest_edge) as f32,
                clusters: clusters.len().div_ceil(CLUSTER) as u32,
                mobility: model.mobility as f32,
                ..bytemuck::Zeroable::zeroed()
            },
            joints: StorageBuffer::from_slice(context, "joints", &joints(chain, model.surface.centre))?,
            proxy_nodes: StorageBuffer::from_slice(context, "proxy nodes", &proxy_nodes(chain))?,
            rest: StorageBuffer::from_slice(context, "surface at rest", &rest(model, &clusters, extent))?,
            mesh: StorageBuffer::from_slice(context, "surface mesh", &mesh(model, &clusters))?,
            clusters: StorageBuffer::from_slice(context, "clusters", &clusters)?,
            gap_band,
        })
    }

    /// Entries of the workspace of one configuration, four f32 each (see `shaders/deformed.wgsl`).
    pub(super) fn workspace(&self) -> u64 {
        u64::from(self.parameters.covered) + 2 * u64::from(self.parameters.clusters)
    }

    /// Size of what places the proxy [B].
    pub(super) fn arm_bytes(&self) -> u64 {
        self.joints.size() + self.proxy_nodes.size()
    }

    /// Size of what the proxy is tested against for contact at rest [B].
    pub(super) fn surface_bytes(&self) -> u64 {
        self.rest.size() + self.mesh.size() + self.clusters.size()
    }
}

fn padded(v: DVec3) -> [f32; 4] {
    [v.x as f32, v.y as f32, v.z as f32, 0.0]
}

/// Distance from the object's centre that no proxy node ever exceeds [m].
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

/// The first joint's origin carries the shift to the centre; all others are relative to their parents anyway.
fn joints(chain: &proxy::Chain, centre: DVec3) -> Vec<Joint> {
    let convert = |(k, joint): (usize, &proxy::Joint)| Joint {
        origin: (if k == 0 { joint.origin - centre } else { joint.origin }).as_vec3().to_array(),
        kind: match joint.kind {
            JointKind::Revolute => 0,
            JointKind::Prismatic => 1,
        },
        axis: joint.axis.as_vec3().to_array(),
        padding: 0,
    };
    chain.joints.iter().enumerate().map(convert).collect()
}

fn proxy_nodes(chain: &proxy::Chain) -> Vec<ProxyNode> {
    let convert =
        |node: &proxy::Node| ProxyNode { position: node.position.as_vec3().to_array(), link: node.link as u32 };
    chain.nodes.iter().map(convert).collect()
}

/// Surface nodes, bounding spheres of the triangles, radii of the proxy nodes, bounding spheres of the clusters of
/// triangles and of the groups of clusters, one behind the other.
fn rest(model: &contact::Model<'_>, clusters: &[u32], extent: f64) -> Vec<[f32; 4]> {
    let around = |nodes: &[u32]| {
        let corners = nodes.iter().map(|&j| model.surface.positions[j as usize]);
        let centre = corners.clone().sum::<DVec3>() / nodes.len() as f64;
        let radius = corners.map(|c| c.distance(centre)).fold(0.0, f64::max);
        let [x, y, z, _] = padded(centre);
        [x, y, z, (radius + tolerances::GPU_BOUND_SLACK * extent) as f32]
    };
    let triangles = &model.object.triangles;
    let cluster = |numbers: &[u32]| {
        let nodes: Vec<u32> = numbers.iter().flat_map(|&t| triangles[t as usize]).collect();
        around(&nodes)
    };
    let nodes = model.surface.positions.iter().map(|&n| padded(n));
    let spheres = triangles.iter().map(|nodes| around(nodes));
    let radii = model.chain.nodes.iter().map(|node| [node.radius as f32, 0.0, 0.0, 0.0]);
    let together = [CLUSTER, GROUP * CLUSTER].into_iter().flat_map(|count| clusters.chunks(count).map(cluster));
    nodes.chain(spheres).chain(radii).chain(together).collect()
}

/// Corners, neighbours, lists around nodes and places, then the clusters' triangles and nodes, one behind the other:
/// see `shaders/surface.wgsl` and `shaders/deformed.wgsl`.
fn mesh(model: &contact::Model<'_>, clusters: &[u32]) -> Vec<u32> {
    let object = model.object;
    let topology = &object.topology;
    let mut mesh = Vec::new();
    mesh.extend(object.triangles.iter().flatten());
    mesh.extend(topology.across.iter().flatten());
    mesh.extend(&topology.around_offsets);
    mesh.extend(&topology.around);
    if !model.compliance.is_whole() {
        let place = |node| model.compliance.place(node).map_or(u32::MAX, |place| place as u32);
        mesh.extend((0..object.surface_nodes as u32).map(place));
    }
    mesh.extend(clusters);
    let (mut starts, mut nodes) = (vec![0], Vec::new());
    for cluster in clusters.chunks(CLUSTER) {
        let mut own: Vec<u32> = cluster.iter().flat_map(|&t| object.triangles[t as usize]).collect();
        own.sort_unstable();
        own.dedup();
        nodes.extend(own);
        starts.push(nodes.len() as u32);
    }
    mesh.extend(starts);
    mesh.extend(nodes);
    mesh
}
