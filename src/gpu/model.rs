//! Object, proxy and contact law as buffers on the device: what stays the same for all configurations of a sweep.
//!
//! Positions are relative to the contact model's centre, so that f32 resolves the object and not its distance from the
//! origin.

use super::{
    buffer::StorageBuffer,
    context::Context,
    error::GpuError,
    layout::Parameters,
    shaders::{DIFFERENCE_STEP, GPU_FAR_AWAY, MOST_CARRIERS},
};
use crate::{
    MAX_AXES, contact,
    proxy::{Chain, ChainLink},
    scene::{ContactLaw, JointKind},
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

/// Distance of a node to an edge or vertex, relative to the object's extent, below which f32 does not resolve the
/// direction between them (1): coordinates of one extent carry 6e-8, and 16 times that gives a direction good to 6 %,
/// where the pseudonormal is the better one.
const GPU_LEAST_DISTANCE_PER_EXTENT: f64 = 1e-6;

/// Most rounds of a program (1): ten times what the stiffest of the tests' scenes takes. What does not end is left to
/// the CPU.
const GPU_ROUNDS: u32 = 100;

/// Places that no covered node has: those of nodes that the compliance leaves out, and those behind a facet's last.
const UNCOVERED: u32 = u32::MAX - 1;
const ABSENT: u32 = u32::MAX;

/// The device's copy of a contact model.
pub(super) struct RestModel {
    /// Without the configurations, which each dispatch sets.
    pub parameters: Parameters,
    pub chain: StorageBuffer,
    pub surface: StorageBuffer,
    pub mesh: StorageBuffer,
    pub compliance: StorageBuffer,
}

impl RestModel {
    /// Uploads a model.
    ///
    /// # Errors
    /// [`GpuError::Law`] where contact is not at rest, and when a buffer exceeds the device's limits or memory.
    pub fn new(context: &Context, model: &contact::Model<'_>) -> Result<Self, GpuError> {
        if model.contact.law != ContactLaw::Rest {
            return Err(GpuError::Law(model.contact.law.name()));
        }
        if model.contact.round.is_some() {
            return Err(GpuError::Rounded);
        }
        let links = model.chain.links.len();
        if links > MAX_AXES {
            return Err(GpuError::Joints(links));
        }
        let Parts { parameters, surface, mesh } = Parts::new(model);
        let surface: Vec<[f32; 4]> = surface.into_iter().map(|row| row.map(|number| number as f32)).collect();
        // Rounded one by one: each keeps 24 bits, whatever the condition number of K.
        let compliance: Vec<f32> = model.compliance.entries.iter().map(|&entry| entry as f32).collect();
        Ok(Self {
            parameters,
            chain: StorageBuffer::from_slice(context, "chain", &chain(model))?,
            surface: StorageBuffer::from_slice(context, "contact surface", &surface)?,
            mesh: StorageBuffer::from_slice(context, "surface mesh", &mesh)?,
            compliance: StorageBuffer::from_slice(context, "compliance", &compliance)?,
        })
    }
}

/// Returns what a gap in f32 may be off by (m).
pub(super) fn gap_band(model: &contact::Model<'_>) -> f64 {
    let joints = model.chain.links.len() as f64;
    GPU_GAP_BAND_PER_EXTENT * model.surface.extent
        + GPU_GAP_BAND_PER_JOINT * joints * reach(model.chain, model.surface.centre)
}

/// The contents of the buffers of the surface, and where their parts begin.
struct Parts {
    parameters: Parameters,
    surface: Vec<[f64; 4]>,
    mesh: Vec<u32>,
}

impl Parts {
    fn new(model: &contact::Model<'_>) -> Self {
        let (object, surface) = (model.object, &model.surface);
        let triangles = object.triangles.len() as u32;
        let facets = 0..triangles;
        let carriers = facets.clone().map(|t| surface.carriers(t).0.len()).max().unwrap_or(0).div_ceil(4);
        let carriers = carriers.clamp(1, MOST_CARRIERS as usize / 4);
        let order = leaves(model);
        let mut numbers = bounding_spheres(model, order.len());
        let at_controls = numbers.len() as u32;
        numbers.extend(facets.clone().flat_map(|t| controls(model, t)).map(|point| four(point, 0.0)));
        let at_masks = numbers.len() as u32;
        let shapes = surface.smooth.iter().flat_map(|smooth| smooth.shapes());
        for mask in shapes.flat_map(|shape| (0..4 * carriers).map(|j| shape.mask_of(j))) {
            let fours = mask.chunks(4).map(|part| std::array::from_fn(|k| part.get(k).copied().unwrap_or(0.0)));
            numbers.extend(fours);
        }
        let at_cubes = numbers.len() as u32;
        let bounds = surface.distance_bounds();
        numbers.extend(bounds.cubes().map(|(gradient, constant, _)| four(gradient.as_dvec3(), constant.into())));
        let mut mesh: Vec<u32> = object.triangles.iter().chain(&object.topology.across).flatten().copied().collect();
        mesh.extend(&object.topology.around_offsets);
        mesh.extend(&object.topology.around);
        let at_order = mesh.len() as u32;
        mesh.extend(order.iter());
        let at_carriers = mesh.len() as u32;
        let place = |node: &u32| model.compliance.place(*node).map_or(UNCOVERED, |place| place as u32);
        for t in facets.clone() {
            let places = surface.carriers(t).0.iter().map(place);
            mesh.extend(places.chain(std::iter::repeat(ABSENT)).take(4 * carriers));
        }
        let at_shapes = mesh.len() as u32;
        mesh.extend(surface.smooth.iter().flat_map(|smooth| facets.clone().map(|t| smooth.shape_number(t))));
        let at_near = mesh.len() as u32;
        mesh.extend(bounds.cubes().map(|(.., triangle)| triangle));
        let (low, inverse_side, counts) = bounds.lattice();
        let parameters = Parameters {
            configurations: 0,
            joints: model.chain.links.len() as u32,
            proxy_nodes: model.chain.nodes.len() as u32,
            surface_nodes: object.surface_nodes as u32,
            triangles,
            leaves: order.len() as u32,
            covered: model.compliance.nodes.len() as u32,
            carriers: carriers as u32,
            at_controls,
            at_masks,
            at_cubes,
            at_order,
            at_carriers,
            at_shapes,
            at_near,
            cubes_x: counts[0] as u32,
            cubes_y: counts[1] as u32,
            cubes_z: counts[2] as u32,
            low_x: low.x as f32,
            low_y: low.y as f32,
            low_z: low.z as f32,
            inverse_side: inverse_side as f32,
            bulge: surface.bulge as f32,
            band: gap_band(model) as f32,
            softness: model.kc.recip() as f32,
            mobility: (model.mobility.sqrt() + model.bulge_mobility.sqrt()) as f32,
            least_distance: (GPU_LEAST_DISTANCE_PER_EXTENT * surface.extent) as f32,
            step: (f64::from(DIFFERENCE_STEP) * surface.mean_edge) as f32,
            rounds: GPU_ROUNDS.min(model.contact.max_iterations),
        };
        Self { parameters, surface: numbers, mesh }
    }
}

/// Three coordinates, and a fourth number.
fn four(v: DVec3, fourth: f64) -> [f64; 4] {
    [v.x, v.y, v.z, fourth]
}

/// A sphere around `points`, widened by `slack`: centre and radius (m).
fn sphere_around(points: &[DVec3], slack: f64) -> [f64; 4] {
    let centre = points.iter().sum::<DVec3>() / points.len() as f64;
    let radius = points.iter().map(|point| point.distance(centre)).fold(0.0, f64::max);
    four(centre, radius + slack)
}

/// Distance from the object's centre that no proxy node ever exceeds (m).
fn reach(chain: &Chain, centre: DVec3) -> f64 {
    let mut length = 0.0;
    let limits: Vec<[f64; 2]> = chain.joints.iter().map(|joint| joint.limits).collect();
    let lengths: Vec<f64> = (chain.links.iter().enumerate())
        .map(|(k, link)| {
            let origin = if k == 0 { link.spec.origin - centre } else { link.spec.origin };
            length += origin.length() + link.slide(&limits);
            length
        })
        .collect();
    chain.nodes.iter().map(|node| lengths[node.link] + node.position.length()).fold(0.0, f64::max)
}

/// Origin, axis and kind of each joint, the first origin relative to the object's centre; position, link, radius and
/// share of stiffness of each proxy node.
fn chain(model: &contact::Model<'_>) -> Vec<f32> {
    let mut numbers = Vec::new();
    for (k, ChainLink { spec: joint, .. }) in model.chain.links.iter().enumerate() {
        let origin = if k == 0 { joint.origin - model.surface.centre } else { joint.origin };
        numbers.extend(origin.to_array());
        numbers.extend(joint.axis.to_array());
        numbers.push(f64::from(u8::from(joint.kind == JointKind::Prismatic)));
    }
    for (node, share) in model.chain.nodes.iter().zip(&model.shares) {
        numbers.extend(node.position.to_array());
        numbers.extend([node.link as f64, node.radius, *share]);
    }
    numbers.into_iter().map(|number| number as f32).collect()
}

/// The control points of facet `t` at rest, of a flat one its corners (m).
fn controls(model: &contact::Model<'_>, t: u32) -> Vec<DVec3> {
    let facet = model.surface.facet_at_rest(t);
    facet.net.map_or_else(|| facet.corners.to_vec(), |net| net.to_vec())
}

/// The facets in an order in which neighbours are near each other, the last one as often as makes a power of two.
fn leaves(model: &contact::Model<'_>) -> Vec<u32> {
    let mut order: Vec<u32> = model.surface.bounds.order().collect();
    order.resize(order.len().next_power_of_two(), order.last().copied().unwrap_or(0));
    order
}

/// Spheres around the control points of the facets: centre and radius of each node of the tree of
/// `shaders/closest_facet.wgsl`, which has so many leaves.
fn bounding_spheres(model: &contact::Model<'_>, leaves: usize) -> Vec<[f64; 4]> {
    let order: Vec<u32> = model.surface.bounds.order().collect();
    let slack = GPU_BOUND_SLACK * model.surface.extent;
    let nowhere = [0.0, 0.0, 0.0, -f64::from(GPU_FAR_AWAY)];
    let sphere = |node: usize| {
        let level = node.ilog2();
        let under = leaves >> level;
        let facets = order.iter().skip((node - (1 << level)) * under).take(under);
        let points: Vec<DVec3> = facets.flat_map(|&t| controls(model, t)).collect();
        if points.is_empty() { nowhere } else { sphere_around(&points, slack) }
    };
    std::iter::once(nowhere).chain((1..2 * leaves).map(sphere)).collect()
}
