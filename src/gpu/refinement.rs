//! What the kernel of the energy form left to rounding, settled in f64.
//!
//! A depth in f32 is known to some nanometres, which shallow contact feels in its energy and stiff contact in its forces;
//! worse, the kernel cannot see it. So each result is taken up in f64, from the exact configuration: with the contacts that
//! the kernel found, forces lambda_i on features with weights w_i and normals N_i,
//! 1. u = C f, f = - sum_i lambda_i w_i N_i;
//! 2. the closest points, normals and depths at u, by the CPU's own code;
//! 3. lambda by one step of the frozen problem, (W + I / kc) delta = depth - lambda / kc, W = G C G^T;
//!
//! until f stops changing. What the changes let expect of further passes is the residual that is reported: unlike the
//! kernel's it owes nothing to f32. Some numbers a contact: far less work than the search.
//!
//! A node with a radius may touch a wall that the kernel, which takes the closest, has not seen; such configurations are
//! left to the CPU ([`Refinement::find`]).

use super::layout::Touch;
use crate::{
    contact::{
        Model,
        closest_point::{Feature, closest_point, point_at, rounded},
        depth::{Contact, measure},
        detection::{Detection, Walls},
        support::{Support, dot, root},
        surface::{area_vector, unit_or_zero},
        walls::wall,
    },
    proxy::Pose,
    tolerances::{FACET_ROUNDING, GPU_REFINED_RESIDUAL, REFINED, REFINEMENT_PASSES, RESIDUAL_FLOOR},
};
use faer::{Mat, Side, prelude::Solve};
use glam::DVec3;

/// A result of the energy form in f64.
pub(super) struct Refined {
    /// Elastic energy and that of the contact springs [J].
    pub energy: f64,
    /// What the contact forces still lack, relative, in the energy norm [1].
    pub residual: f64,
}

/// One contact under refinement.
struct Row {
    proxy_node: u32,
    nodes: [u32; 3],
    slots: [usize; 3],
    weights: [f64; 3],
    normal: DVec3,
    /// lambda [N].
    force: f64,
}

/// Workspace, one per thread.
pub(super) struct Refinement {
    rows: Vec<Row>,
    support: Support,
    forces: Vec<f64>,
    change: Vec<f64>,
    displacement: Vec<f64>,
    /// For nodes with a radius only.
    detection: Option<Detection>,
    surface: Vec<f64>,
    positions: Vec<DVec3>,
    contacts: Vec<Contact>,
}

impl Refinement {
    /// Room for the object of `model`.
    pub fn new(model: &Model<'_>) -> Self {
        let balls = model.chain.nodes.iter().any(|node| node.radius > 0.0);
        Self {
            rows: Vec::new(),
            support: Support::new(model.rest.len()),
            forces: Vec::new(),
            change: Vec::new(),
            displacement: Vec::new(),
            detection: balls.then(|| Detection::new(model)),
            surface: vec![0.0; 3 * model.rest.len()],
            positions: model.rest.clone(),
            contacts: Vec::new(),
        }
    }

    /// The result that `touches` lead to at `pose`; `None` where f64 finds other contacts than the kernel did, or no balance.
    pub fn find(&mut self, model: &Model<'_>, pose: &Pose, touches: &[Touch]) -> Option<Refined> {
        self.take_up(model, touches);
        self.spread();
        let mut change = self.pass(model, pose)?;
        let mut left = 1.0;
        for _ in 1..REFINEMENT_PASSES {
            let before = change;
            change = self.pass(model, pose)?;
            // Changes shrink by a constant share from pass to pass: what is still to come is a geometric series.
            let share = change / before.max(f64::MIN_POSITIVE);
            left = if share < 1.0 { change * (share / (1.0 - share)).max(1.0) } else { 1.0 };
            if change <= REFINED {
                left = change;
            }
            if left <= REFINED {
                break;
            }
        }
        if left > GPU_REFINED_RESIDUAL || !self.agrees(model, pose) {
            return None;
        }
        self.displace();
        let elastic = 0.5 * dot(&self.forces, &self.displacement);
        let springs: f64 = self.rows.iter().map(|row| row.force * row.force).sum();
        Some(Refined { energy: elastic + springs / (2.0 * model.kc), residual: left })
    }

    /// Proxy node, object nodes, weights and force on the proxy node of each contact of the last result.
    pub fn touches(&self) -> impl Iterator<Item = crate::contact::Touch> {
        self.rows.iter().map(|row| crate::contact::Touch {
            proxy_node: row.proxy_node,
            nodes: row.nodes,
            weights: row.weights,
            force: row.normal * row.force,
        })
    }

    /// The kernel's contacts.
    fn take_up(&mut self, model: &Model<'_>, touches: &[Touch]) {
        self.rows.clear();
        self.support.clear();
        for touch in touches {
            let parts = [touch.force_0, touch.force_1, touch.force_2].map(|f| DVec3::from(f.map(f64::from)));
            let whole = -(parts[0] + parts[1] + parts[2]);
            let force = whole.length();
            if force == 0.0 {
                continue;
            }
            let normal = whole / force;
            self.rows.push(Row {
                proxy_node: touch.proxy_node,
                nodes: touch.nodes,
                // A feature of fewer nodes may turn out to be the face: all three get a slot.
                slots: touch.nodes.map(|node| self.support.add(node)),
                weights: parts.map(|part| -part.dot(normal) / force),
                normal,
                force,
            });
        }
        self.rows.sort_by_key(|row| row.proxy_node);
        self.support.gather(&model.compliance);
    }

    /// `change` takes the forces of before, `forces` those of the rows.
    fn spread(&mut self) {
        std::mem::swap(&mut self.forces, &mut self.change);
        self.forces.clear();
        self.forces.resize(self.support.order(), 0.0);
        for row in &self.rows {
            for (slot, weight) in row.slots.into_iter().zip(row.weights) {
                let part = row.normal * (-row.force * weight);
                for (k, component) in part.to_array().into_iter().enumerate() {
                    self.forces[3 * slot + k] += component;
                }
            }
        }
    }

    /// `displacement` = C `forces` on the support.
    fn displace(&mut self) {
        self.displacement.resize(self.support.order(), 0.0);
        self.support.multiply(&self.forces, &mut self.displacement);
    }

    /// One pass; the relative change of the forces. `None` where a contact is lost.
    fn pass(&mut self, model: &Model<'_>, pose: &Pose) -> Option<f64> {
        self.displace();
        let count = self.rows.len();
        let mut missing = Mat::<f64>::zeros(count, 1);
        for (k, row) in self.rows.iter_mut().enumerate() {
            let x = pose.nodes[row.proxy_node as usize] - model.centre;
            let corners = [0, 1, 2]
                .map(|j| model.rest[row.nodes[j] as usize] + DVec3::from_slice(&self.displacement[3 * row.slots[j]..]));
            let radius = model.chain.nodes[row.proxy_node as usize].radius;
            if radius > 0.0 {
                // The kernel has found the side.
                let (point, _) = rounded(x, corners, FACET_ROUNDING);
                let inside = row.normal.dot(x - point_at(corners, point.weights)) < 0.0;
                let felt =
                    wall((row.proxy_node, x, radius), (row.nodes, corners), point, inside, row.normal, FACET_ROUNDING);
                row.normal = felt.normal;
                row.weights = felt.weights;
                missing[(k, 0)] = felt.depth - row.force / model.kc;
                continue;
            }
            let point = closest_point(x, corners);
            let outward = match point.feature {
                Feature::Face => unit_or_zero(area_vector(corners)),
                // The kernel has found the side.
                Feature::Edge(_) | Feature::Vertex(_) => row.normal,
            };
            let (normal, depth, _) = measure(x, radius, corners, point.weights, point.feature, outward);
            row.normal = normal;
            row.weights = point.weights;
            missing[(k, 0)] = depth - row.force / model.kc;
        }
        let order = self.support.order();
        let mut images = vec![0.0; order * count];
        let mut unit = vec![0.0; order];
        for (row, image) in self.rows.iter().zip(images.chunks_exact_mut(order.max(1))) {
            unit.fill(0.0);
            add_direction(row, &mut unit);
            self.support.multiply(&unit, image);
        }
        let system = Mat::from_fn(count, count, |i, j| {
            let row = &self.rows[i];
            let image = &images[order * j..order * (j + 1)];
            let along = |(slot, weight): (usize, f64)| weight * row.normal.dot(DVec3::from_slice(&image[3 * slot..]));
            let sum: f64 = row.slots.into_iter().zip(row.weights).map(along).sum();
            if i == j { sum + 1.0 / model.kc } else { sum }
        });
        let steps = system.llt(Side::Lower).ok()?.solve(&missing);
        for (k, row) in self.rows.iter_mut().enumerate() {
            row.force += steps[(k, 0)];
            // Not `<=`, so that what is not a number is refused as well.
            let pushes = row.force > 0.0;
            if !pushes {
                return None;
            }
        }
        self.spread();
        for (before, now) in self.change.iter_mut().zip(&self.forces) {
            *before -= now;
        }
        self.support.multiply(&self.change, &mut self.displacement);
        let changed = root(dot(&self.change, &self.displacement));
        self.support.multiply(&self.forces, &mut self.displacement);
        let size = root(dot(&self.forces, &self.displacement));
        Some(changed / size.max(RESIDUAL_FLOOR))
    }

    /// Whether nodes with a radius touch just the walls that the rows say; without such nodes the kernel decides.
    fn agrees(&mut self, model: &Model<'_>, pose: &Pose) -> bool {
        let Some(detection) = &mut self.detection else { return true };
        self.support.displace(&model.compliance, &self.forces, &mut self.surface);
        for (node, position) in self.positions.iter_mut().enumerate() {
            *position = model.rest[node] + DVec3::from_slice(&self.surface[3 * node..]);
        }
        detection.take_up(model, &pose.nodes);
        detection.deformed(model, &self.surface, &self.positions, Walls::All, &mut self.contacts);
        let mut touching = self.contacts.iter().filter(|contact| contact.bears() > 0.0);
        let same =
            self.rows.iter().all(|row| touching.next().is_some_and(|contact| contact.proxy_node == row.proxy_node));
        same && touching.next().is_none()
    }
}

/// Adds the unit force of a row, w N, to a vector on the support.
fn add_direction(row: &Row, vector: &mut [f64]) {
    for (slot, weight) in row.slots.into_iter().zip(row.weights) {
        let part = row.normal * weight;
        vector[3 * slot] += part.x;
        vector[3 * slot + 1] += part.y;
        vector[3 * slot + 2] += part.z;
    }
}
