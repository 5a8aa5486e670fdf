//! Object, proxy and contact law on the device, as the search for equilibria wants them, and the size of its
//! workspaces.

use super::{
    buffer::StorageBuffer,
    context::Context,
    error::GpuError,
    layout::SearchParameters,
    model::{DeviceModel, bounding_spheres, extent, four, leaves, mesh, stiffness},
    precision::Precision,
};
use crate::{
    contact::{self, law::depth::MINIMUM_CURVATURE_RADIUS},
    contact::{equilibrium::energy::CONTINUATION_START, geometry::DEPTH_ROUNDING},
};
use glam::DVec3;
use rayon::prelude::*;

/// Least relative residual that the f32 solver is asked for (1): rounding of f32 (6e-8) grows over sums of about a
/// hundred products to a few 1e-6, so 1e-5 is the least that can be distinguished from zero.
const GPU_LEAST_TOLERANCE: f64 = 1e-5;

/// Distance of a node to an edge or vertex, relative to the object's extent, below which f32 does not resolve the
/// direction between them (1): coordinates of one extent carry 6e-8, and 16 times that gives a direction good to 6 %,
/// where the pseudonormal is the better one.
const GPU_LEAST_DISTANCE_PER_EXTENT: f64 = 1e-6;

/// Rounding error of a depth, relative to the longest edge of the surface (1): three coordinates of a corner relative
/// to the proxy node, each rounded by 6e-8 of at most an edge, enter with weights that sum to one.
const GPU_DEPTH_ROUNDING_PER_EDGE: f64 = 2e-7;

/// Most iterations of one configuration in f32, whatever the scene allows: hardly any that needs more ends there, a
/// group that goes on holds up its whole batch, and what is not converged is solved in f64 with all the scene's
/// iterations.
const GPU_MAX_ITERATIONS: u32 = 100;

/// Most rows of a configuration: contacts, and proxy nodes that have touched. What exceeds them is left to the CPU.
pub(super) const CONTACTS: usize = 64;

/// Most object nodes that carry contact force in a configuration: three for each row, which neighbouring contacts
/// share.
const SUPPORT: usize = 3 * CONTACTS;

/// No place, behind the last node of a facet.
const ABSENT: u32 = u32::MAX;

/// The device's copy of a contact model for the search.
pub(super) struct SearchModel {
    pub precision: Precision,
    /// Without the configurations, and the room for them.
    pub parameters: SearchParameters,
    pub surface: StorageBuffer,
    pub mesh: StorageBuffer,
    pub compliance: StorageBuffer,
    /// Whether the compliance has one number for a pair of nodes, whether facets are bent, and whether the tangent is
    /// wanted.
    pub is_isotropic: bool,
    pub is_smooth: bool,
    pub with_tangent: bool,
}

impl SearchModel {
    /// Uploads a model of which `device` has the arm and the surface at rest, for at most `contacts` rows a
    /// configuration.
    pub fn new(
        context: &Context,
        model: &contact::Model<'_>,
        device: &DeviceModel,
        contacts: usize,
    ) -> Result<Self, GpuError> {
        let nodes = model.chain.nodes.len();
        let precision = device.precision;
        let is_isotropic = model.compliance.rows_per_node == 1;
        let parts = Parts::new(model, precision);
        let contacts = CONTACTS.min(contacts).min(nodes);
        let support = SUPPORT.min(model.compliance.nodes.len());
        let limits = Limits::new(model, precision);
        let mut parameters = SearchParameters {
            joints: model.chain.joints.len() as u32,
            proxy_nodes: nodes as u32,
            contacts: contacts as u32,
            support: support as u32,
            max_iterations: limits.iterations,
            gap_band: device.gap_band,
            known_to: f64::from(device.parameters.known_to),
            first_kc: limits.first_kc,
            kc: limits.kc,
            tolerance: limits.tolerance,
            mobility: model.mobility.sqrt(),
            bulge_mobility: model.bulge_mobility.sqrt(),
            bulge: model.surface.bulge,
            least_scale: limits.depth_rounding / limits.tolerance * model.max_nodal_compliance.sqrt(),
            least_distance: limits.least_distance,
            ..parts.parameters
        };
        parameters.words = words(&parameters);
        parameters.reals = reals(&parameters);
        let numbers = |what, numbers: &[f64]| StorageBuffer::from_slice(context, what, &precision.encode(numbers));
        Ok(Self {
            precision,
            parameters,
            surface: numbers("surface for the search", parts.surface.as_flattened())?,
            mesh: StorageBuffer::from_slice(context, "mesh for the search", &parts.mesh)?,
            // Rounded one by one: each keeps 24 bits in f32, whatever the condition number of K.
            compliance: numbers("compliance", &parts.numbering.compliance(model))?,
            is_isotropic,
            is_smooth: device.is_smooth,
            with_tangent: limits.with_tangent,
        })
    }

    /// Bytes of one workspace: of its words and its entries in two lists, of its reals, and of the vectors on its
    /// support (B).
    pub fn workspace(&self) -> [u64; 3] {
        let SearchParameters { words, reals, .. } = self.parameters;
        let size = self.precision.size() as u64;
        let vectors = vectors(&self.parameters, self.is_isotropic, self.with_tangent);
        [4 * u64::from(words + 2), size * u64::from(reals), size * u64::from(vectors)]
    }
}

/// Stiffness, tolerances and limits of a search.
struct Limits {
    first_kc: f64,
    kc: f64,
    tolerance: f64,
    iterations: u32,
    with_tangent: bool,
    depth_rounding: f64,
    least_distance: f64,
}

impl Limits {
    fn new(model: &contact::Model<'_>, precision: Precision) -> Self {
        let contact = &model.contact;
        let kc = match precision {
            Precision::Double => model.kc,
            Precision::Single => stiffness(model),
        };
        let first_kc = kc.min(CONTINUATION_START / model.max_nodal_compliance);
        match precision {
            Precision::Double => Self {
                first_kc,
                kc,
                tolerance: contact.tolerance,
                iterations: contact.max_iterations,
                with_tangent: model.with_tangent,
                depth_rounding: DEPTH_ROUNDING * model.surface.extent,
                least_distance: MINIMUM_CURVATURE_RADIUS,
            },
            Precision::Single => Self {
                first_kc,
                kc,
                tolerance: contact.tolerance.max(GPU_LEAST_TOLERANCE),
                iterations: contact.max_iterations.min(GPU_MAX_ITERATIONS),
                with_tangent: false,
                depth_rounding: GPU_DEPTH_ROUNDING_PER_EDGE * longest_edge(model),
                least_distance: GPU_LEAST_DISTANCE_PER_EXTENT * extent(model),
            },
        }
    }
}

fn longest_edge(model: &contact::Model<'_>) -> f64 {
    let corners = |t: &[u32; 3]| t.map(|j| model.surface.positions[j as usize]);
    let edge = |[a, b, c]: [DVec3; 3]| a.distance(b).max(b.distance(c)).max(c.distance(a));
    model.object.triangles.iter().map(|t| edge(corners(t))).fold(0.0, f64::max)
}

/// Words of a workspace: see `shaders/search_types.wgsl`.
pub(super) fn words(p: &SearchParameters) -> u32 {
    const HEADER: u32 = 31;
    const ROW_WORDS: u32 = 4;
    HEADER
        + 3 * p.proxy_nodes
        + 2 * p.covered
        + p.support
        + 2 * p.contacts * (ROW_WORDS + 3 * p.carriers)
        + 2 * p.contacts
        + p.support
        + 1
}

/// Reals of a workspace, without the vectors on its support: see there.
pub(super) fn reals(p: &SearchParameters) -> u32 {
    const SCALARS: u32 = 20;
    const ROW_REALS: u32 = 32;
    let to_four = |count: u32| count.next_multiple_of(4);
    let before_parts = SCALARS
        + 8 * p.joints
        + to_four(p.proxy_nodes)
        + 4 * p.covered
        + 2 * p.contacts * (ROW_REALS + 3 * p.carriers)
        + to_four(p.contacts)
        + (12 + 1 + 1) * p.contacts
        + p.contacts * p.contacts;
    to_four(to_four(before_parts) + 4 * p.contacts * p.carriers + p.joints * p.joints + p.joints)
}

/// Reals of the vectors on the support of a workspace, and of its columns: see `shaders/search_state.wgsl`.
pub(super) fn vectors(p: &SearchParameters, is_isotropic: bool, with_tangent: bool) -> u32 {
    const VECTORS: u32 = 16;
    let column = if is_isotropic { p.support.div_ceil(4) } else { p.support };
    let responses = if with_tangent { 2 * p.joints } else { 0 };
    4 * (p.contacts * column + (VECTORS + responses) * p.support)
}

/// The contents of the buffers, and where their parts begin.
struct Parts {
    parameters: SearchParameters,
    surface: Vec<[f64; 4]>,
    mesh: Vec<u32>,
    numbering: Numbering,
}

impl Parts {
    fn new(model: &contact::Model<'_>, precision: Precision) -> Self {
        let (object, surface) = (model.object, &model.surface);
        let triangles = object.triangles.len() as u32;
        let facets = 0..triangles;
        let most = facets.clone().map(|t| surface.carriers(t).0.len()).max().unwrap_or(0);
        let order: Vec<u32> = surface.bounds.order().collect();
        let numbering = Numbering::new(model, &order);
        let carriers = most.next_multiple_of(4);
        let mut parameters = SearchParameters {
            surface_nodes: object.surface_nodes as u32,
            triangles,
            leaves: leaves(model).len() as u32,
            covered: model.compliance.nodes.len() as u32,
            carriers: carriers as u32,
            ..bytemuck::Zeroable::zeroed()
        };
        let at = |node: u32| surface.positions[node as usize];
        let mut numbers = bounding_spheres(model, precision);
        numbers
            .extend(model.chain.nodes.iter().zip(&model.shares).map(|(node, share)| [node.radius, *share, 0.0, 0.0]));
        numbers.extend(numbering.nodes.iter().map(|&node| four(at(node), 0.0)));
        parameters.at_net = numbers.len() as u32;
        if let Some(smooth) = &surface.smooth {
            numbers.extend(numbering.nodes.iter().map(|&node| four(at(node) + smooth.offset(node), 0.0)));
            parameters.at_masks = numbers.len() as u32;
            for shape in smooth.shapes() {
                for mask in (0..carriers).map(|j| shape.mask_of(j)) {
                    numbers.extend(
                        mask.chunks(4).map(|part| std::array::from_fn(|k| part.get(k).copied().unwrap_or(0.0))),
                    );
                }
            }
        }
        let mut mesh = mesh(model);
        parameters.at_order = mesh.len() as u32;
        mesh.extend(leaves(model));
        parameters.at_carriers = mesh.len() as u32;
        for t in facets.clone() {
            let places = surface.carriers(t).0.iter().map(|&node| numbering.places[node as usize]);
            mesh.extend(places.chain(std::iter::repeat(ABSENT)).take(carriers));
        }
        parameters.at_shapes = mesh.len() as u32;
        if let Some(smooth) = &surface.smooth {
            mesh.extend(facets.clone().map(|t| smooth.shape_number(t)));
        }
        parameters.at_covered = mesh.len() as u32;
        let is_covered = |&node: &u32| model.compliance.place(node).is_some();
        mesh.extend(facets.map(|t| u32::from(surface.carriers(t).0.iter().all(is_covered))));
        parameters.at_links = mesh.len() as u32;
        mesh.extend(model.chain.nodes.iter().map(|node| node.link as u32));
        Self { parameters, surface: numbers, mesh, numbering }
    }
}

/// Places of the surface nodes: those that the compliance covers come first.
struct Numbering {
    /// Place of each node, and node in each place.
    places: Vec<u32>,
    nodes: Vec<u32>,
}

impl Numbering {
    /// With covered nodes near each other that are so in the `order` of facets.
    fn new(model: &contact::Model<'_>, order: &[u32]) -> Self {
        let all = 0..model.object.surface_nodes as u32;
        let is_covered = |node: &u32| model.compliance.place(*node).is_some();
        let mut nodes = Vec::new();
        let mut is_listed = vec![false; all.len()];
        for node in order.iter().flat_map(|&t| model.object.triangles[t as usize]) {
            if is_covered(&node) && !std::mem::replace(&mut is_listed[node as usize], true) {
                nodes.push(node);
            }
        }
        nodes.extend(all.filter(|node| !is_covered(node)));
        let mut places = vec![0; nodes.len()];
        (0..).zip(&nodes).for_each(|(place, &node)| places[node as usize] = place);
        Self { places, nodes }
    }

    /// The compliance with its rows and columns by place (m/N).
    fn compliance(&self, model: &contact::Model<'_>) -> Vec<f64> {
        let (compliance, each) = (&model.compliance, model.compliance.rows_per_node);
        let from: Vec<usize> = self.nodes.iter().filter_map(|&node| compliance.place(node)).collect();
        let columns: Vec<usize> = from.iter().flat_map(|&place| (each * place..).take(each)).collect();
        let row = |row: &[f64]| columns.iter().map(|&column| row[column]).collect::<Vec<f64>>();
        let rows =
            |&place: &usize| compliance.rows(place).chunks(compliance.order()).flat_map(row).collect::<Vec<f64>>();
        from.par_iter().flat_map_iter(rows).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        contact::Model,
        object::{Compliance, Object},
        proxy::Chain,
        scene::{ContactSpec, ContactSurface, Material, Scene, SpringKind, SpringSpec},
    };

    /// The sphere of the tests on a smooth surface, with its compliance on the nodes of the upper half.
    fn with_model(kind: SpringKind, check: impl FnOnce(&Model<'_>, &Numbering)) {
        let mut scene = Scene::load(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/scenes/sphere.toml")).unwrap();
        scene.object.material = Material::Springs(SpringSpec { kind, stiffness: 150.0 });
        let contact = ContactSpec { surface: ContactSurface::Smooth, ..scene.contact };
        let (object, chain) = (Object::build(&scene.object).unwrap(), Chain::new(&scene.proxy));
        let mut model = Model::new(&object, &chain, contact);
        let nodes = (0..object.surface_nodes as u32).filter(|&node| model.surface.positions[node as usize].z > 0.0);
        model.take_compliance(Compliance::on(&object, nodes.collect()).unwrap());
        let numbering = Numbering::new(&model, &model.surface.bounds.order().collect::<Vec<u32>>());
        check(&model, &numbering);
    }

    #[test]
    fn compliance_is_numbered_as_its_nodes_are() {
        for kind in [SpringKind::Isotropic, SpringKind::Axial] {
            with_model(kind, |model, numbering| {
                let (compliance, covered) = (&model.compliance, model.compliance.nodes.len());
                let (each, renumbered) = (compliance.rows_per_node, numbering.compliance(model));
                assert_ne!(renumbered, compliance.entries, "neighbours were not near each other");
                let before = |row: usize| each * compliance.place(numbering.nodes[row / each]).unwrap() + row % each;
                for (row, entries) in renumbered.chunks(compliance.order()).enumerate() {
                    for (column, entry) in entries.iter().enumerate() {
                        assert_eq!(*entry, compliance.entries[before(row) * compliance.order() + before(column)]);
                    }
                }
                for (node, &place) in (0..).zip(&numbering.places) {
                    assert_eq!(numbering.nodes[place as usize], node);
                    assert_eq!((place as usize) < covered, compliance.place(node).is_some());
                }
            });
        }
    }
}
