//! What an equilibrium must satisfy, checked by code that shares nothing with the solver: displacement from K itself,
//! closest points by trial of all features, inside and outside by the winding number of the surface.

use glam::DVec3;
use haptize::contact::Equilibrium;
use haptize::object::Object;
use haptize::proxy::{Chain, Pose};

/// Depth of a point below a surface, and the force law's direction and weights there.
pub struct Depth {
    pub depth: f64,
    pub normal: DVec3,
    pub triangle: usize,
    pub weights: [f64; 3],
}

/// Displacement of all nodes under `forces`, from K by conjugate gradients.
pub fn displacement(object: &Object, forces: &[DVec3]) -> Vec<DVec3> {
    let inner = |a: &[DVec3], b: &[DVec3]| a.iter().zip(b).map(|(a, b)| a.dot(*b)).sum::<f64>();
    let mut u = vec![DVec3::ZERO; forces.len()];
    let mut r = forces.to_vec();
    let mut p = r.clone();
    let mut image = vec![DVec3::ZERO; forces.len()];
    let mut square = inner(&r, &r);
    let stop = 1e-32 * square;
    for _ in 0..20 * forces.len() {
        if square <= stop {
            break;
        }
        object.mechanics().unwrap().stiffness.apply(&p, &mut image);
        let share = square / inner(&p, &image);
        for k in 0..u.len() {
            u[k] += p[k] * share;
            r[k] -= image[k] * share;
        }
        let next = inner(&r, &r);
        for k in 0..u.len() {
            p[k] = r[k] + p[k] * (next / square);
        }
        square = next;
    }
    u
}

/// How often the surface winds around `x`: the solid angles of all triangles, over 4 pi (Van Oosterom & Strackee 1983).
fn winding_number(positions: &[DVec3], triangles: &[[u32; 3]], x: DVec3) -> f64 {
    let mut sum = 0.0;
    for triangle in triangles {
        let [a, b, c] = triangle.map(|node| positions[node as usize] - x);
        let (la, lb, lc) = (a.length(), b.length(), c.length());
        let below = la * lb * lc + a.dot(b) * lc + b.dot(c) * la + c.dot(a) * lb;
        sum += 2.0 * a.dot(b.cross(c)).atan2(below);
    }
    sum / (4.0 * std::f64::consts::PI)
}

/// Depth of `x`, by trial of all faces, edges and vertices.
pub fn depth(positions: &[DVec3], triangles: &[[u32; 3]], x: DVec3) -> Depth {
    let mut best = (f64::MAX, DVec3::ZERO, 0, [0.0; 3]);
    for (t, triangle) in triangles.iter().enumerate() {
        let (weights, p) = closest(triangle.map(|node| positions[node as usize]), x);
        if p.distance(x) < best.0 {
            best = (p.distance(x), p, t, weights);
        }
    }
    let inside = winding_number(positions, triangles, x) > 0.5;
    let (distance, p, triangle, weights) = best;
    let depth = if inside { distance } else { -distance };
    Depth { depth, normal: (p - x) / depth, triangle, weights }
}

/// Weights of the point of a triangle that is closest to `x`, by trial of its edges and its inside, and that point.
fn closest(corners: [DVec3; 3], x: DVec3) -> ([f64; 3], DVec3) {
    let at = |w: [f64; 3]| corners[0] * w[0] + corners[1] * w[1] + corners[2] * w[2];
    let mut candidates = Vec::new();
    for k in 0..3 {
        let (a, b) = (corners[k], corners[(k + 1) % 3]);
        let share = ((x - a).dot(b - a) / (b - a).length_squared()).clamp(0.0, 1.0);
        let mut weights = [0.0; 3];
        weights[k] = 1.0 - share;
        weights[(k + 1) % 3] = share;
        candidates.push(weights);
    }
    let [a, b, c] = corners;
    let n = (b - a).cross(c - a);
    let weights = [(c - b).cross(x - b), (a - c).cross(x - c), (b - a).cross(x - a)];
    let weights = weights.map(|part| part.dot(n) / n.length_squared());
    if weights.iter().all(|&w| w >= 0.0) {
        candidates.push(weights);
    }
    let best = candidates.into_iter().min_by(|v, w| at(*v).distance(x).total_cmp(&at(*w).distance(x))).unwrap();
    (best, at(best))
}

/// Smallest signed distance of the proxy's nodes to the surface at rest, less their radius.
pub fn gap(object: &Object, chain: &Chain, pose: &Pose) -> f64 {
    let nodes = chain.nodes.iter().zip(&pose.nodes);
    nodes.map(|(node, &x)| -depth(&object.rest, &object.triangles, x).depth - node.radius).fold(f64::MAX, f64::min)
}

/// Pose of `chain` at `q`.
pub fn pose(chain: &Chain, q: &[f64]) -> Pose {
    let mut pose = chain.new_pose();
    chain.pose(q, &mut pose);
    pose
}

/// Torque of `touches` by central differences of the nodes' positions.
pub fn torque(chain: &Chain, q: &[f64], equilibrium: &Equilibrium) -> Vec<f64> {
    let h = 1e-6;
    (0..q.len())
        .map(|joint| {
            let at = |step: f64| {
                let mut q = q.to_vec();
                q[joint] += step;
                pose(chain, &q).nodes
            };
            let (before, after) = (at(-h), at(h));
            let column = |node: usize| (after[node] - before[node]) / (2.0 * h);
            equilibrium.touches.iter().map(|touch| column(touch.proxy_node as usize).dot(touch.force)).sum()
        })
        .collect()
}

/// Action and reaction, compression, torque, and forces that are sums of the touches' shares.
pub fn check_account(object: &Object, chain: &Chain, q: &[f64], equilibrium: &Equilibrium) -> Result<(), String> {
    let Equilibrium { touches, forces, .. } = equilibrium;
    let scale: f64 = touches.iter().map(|touch| touch.force.length()).sum();
    if touches.is_empty() || forces.is_empty() || scale <= 0.0 {
        return Err("a contact without force".into());
    }
    let on_proxy: DVec3 = touches.iter().map(|touch| touch.force).sum();
    let on_object: DVec3 = forces.iter().map(|force| force.force).sum();
    if (on_proxy + on_object).length() > 1e-12 * scale {
        return Err(format!("action {on_proxy} and reaction {on_object} differ"));
    }
    if !forces.windows(2).all(|pair| pair[0].node < pair[1].node) {
        return Err("nodes are not in ascending order".into());
    }
    if forces.iter().any(|force| force.node as usize >= object.surface_nodes) {
        return Err("force on a node that is not on the surface".into());
    }
    let expected = torque(chain, q, equilibrium);
    let torque_scale: f64 = 1e-12 + expected.iter().map(|t| t.abs()).sum::<f64>() + scale * 0.1;
    for (torque, expected) in equilibrium.torque.iter().zip(&expected) {
        if (torque - expected).abs() > 1e-8 * torque_scale {
            return Err(format!("torque {torque} is not J^T f = {expected}"));
        }
    }
    Ok(())
}

/// Balance and contact law: with u = K^-1 (stored forces), every proxy node's force is kc times its depth below the
/// displaced surface along the normal there, and the object's nodes carry it by the weights of the closest point.
/// `tolerance` is relative to the largest force.
pub fn check_contact_law(
    object: &Object,
    chain: &Chain,
    q: &[f64],
    kc: f64,
    equilibrium: &Equilibrium,
    tolerance: f64,
) -> Result<(), String> {
    let mut forces = vec![DVec3::ZERO; object.rest.len()];
    for force in &equilibrium.forces {
        forces[force.node as usize] += force.force;
    }
    let u = displacement(object, &forces);
    let positions: Vec<DVec3> = object.rest.iter().zip(&u).map(|(rest, u)| *rest + *u).collect();
    let scale = equilibrium.touches.iter().map(|touch| touch.force.length()).fold(0.0, f64::max);
    let mut expected = vec![DVec3::ZERO; object.rest.len()];
    for (i, x) in pose(chain, q).nodes.iter().enumerate() {
        let below = depth(&positions, &object.triangles, *x);
        let radius = chain.nodes[i].radius;
        let lambda = kc * (below.depth + radius).max(0.0);
        let touch = equilibrium.touches.iter().find(|touch| touch.proxy_node as usize == i);
        let force = touch.map_or(DVec3::ZERO, |touch| touch.force);
        if (force - below.normal * lambda).length() > tolerance * scale {
            return Err(format!("node {i}: force {force}, law {}, largest {scale}", below.normal * lambda));
        }
        if touch.is_some() && force.dot(below.normal) <= 0.0 {
            return Err(format!("node {i} is pulled"));
        }
        for (node, weight) in object.triangles[below.triangle].iter().zip(below.weights) {
            expected[*node as usize] -= below.normal * (lambda * weight);
        }
    }
    for (node, (force, expected)) in forces.iter().zip(&expected).enumerate() {
        if (*force - *expected).length() > tolerance * scale {
            return Err(format!("object node {node}: force {force}, law {expected}"));
        }
    }
    Ok(())
}
