//! Figures: complete, deterministic, and robust against broken data.

#![allow(clippy::unwrap_used)]

use glam::DVec3;
use haptize::{
    JointVector,
    contact::Status,
    dataset::{Axis, Contacts, Dataset, Grid, Provenance, Surface},
    object::Object,
    proxy::{Chain, Joint, Node},
    render::{
        accounts::Accounts,
        flags::Flags,
        trace::{Frame, JointLabel, Tick, Trace},
    },
    report,
    scene::{GroundNodes, GroundSpec, JointKind, ObjectSpec, Shape, SpringKind, SpringSpec},
};
use std::path::PathBuf;

const CENTRE: DVec3 = DVec3::new(0.2, 0.0, -0.02);
const RADIUS: f64 = 0.05;

fn sphere() -> Object {
    let shape = Shape::Sphere { centre: CENTRE, radius: RADIUS, rings: 10, segments: 10 };
    Object::build(&ObjectSpec {
        shape,
        springs: SpringSpec { kind: SpringKind::Isotropic, stiffness: 300.0 },
        ground: GroundSpec { stiffness: 100.0, nodes: GroundNodes::All },
        node_mass: 1e-3,
        node_damping: 0.1,
    })
    .unwrap()
}

/// An arm whose first joint turns about the vertical and whose others bend downwards, nodes along the last two links.
fn arm(joints: usize) -> Chain {
    let length = 0.3 / (joints.max(2) - 1) as f64;
    let joint = |number: usize| Joint {
        name: ["base", "shoulder", "elbow", "wrist", "hand", "finger"][number].to_owned(),
        kind: JointKind::Revolute,
        origin: match number {
            0 => DVec3::new(-0.06, 0.0, 0.12),
            1 => DVec3::ZERO,
            _ => DVec3::X * length,
        },
        axis: if number == 0 { DVec3::Z } else { DVec3::Y },
        limits: [-3.0, 3.0],
        mass: 0.1,
        centre_of_mass: DVec3::ZERO,
        inertia: DVec3::splat(1e-4),
        rotor_inertia: 1e-4,
    };
    let node = |link: usize, k: usize| Node { link, position: DVec3::X * length * k as f64 / 5.0, radius: 0.0 };
    let nodes = (joints.saturating_sub(2)..joints).flat_map(|link| (1..=5).map(move |k| node(link, k)));
    Chain { joints: (0..joints).map(joint).collect(), nodes: nodes.collect() }
}

/// Forces of independent springs on nodes near each buried proxy node, and the torque they make.
fn touch(chain: &Chain, object: &Object, q: &[f64]) -> (JointVector, Vec<(u32, DVec3)>, f64) {
    let mut pose = chain.new_pose();
    chain.pose(q, &mut pose);
    let (mut torque, mut forces, mut gap) = (JointVector::zeros(q.len()), vec![], f64::INFINITY);
    for (number, &x) in pose.nodes.iter().enumerate() {
        let depth = RADIUS - (x - CENTRE).length();
        gap = gap.min(-depth);
        if depth <= 0.0 {
            continue;
        }
        let force = 120.0 * depth * (x - CENTRE).normalize();
        chain.add_torque(&pose, number, force, &mut torque);
        let mut near: Vec<usize> = (0..object.surface_nodes).collect();
        near.sort_by(|&a, &b| object.rest[a].distance(x).total_cmp(&object.rest[b].distance(x)));
        for &node in &near[..3] {
            match forces.iter_mut().find(|(known, _)| *known == node as u32) {
                Some((_, sum)) => *sum -= force / 3.0,
                None => forces.push((node as u32, -force / 3.0)),
            }
        }
    }
    forces.sort_by_key(|&(node, _)| node);
    (torque, forces, gap)
}

/// A dataset of an arm over a sphere, without solving anything: good enough to look at.
fn dataset(chain: &Chain, object: &Object, counts: &[usize]) -> Dataset {
    let starts = [-0.5, 0.1, -0.1, -0.2, -0.2, -0.2];
    let axis = |(number, &count): (usize, &usize)| Axis {
        name: chain.joints[number].name.clone(),
        unit: "rad".to_owned(),
        start: starts[number],
        step: std::f64::consts::PI / 60.0,
        count,
    };
    let grid = Grid { axes: counts.iter().enumerate().map(axis).collect() };
    let points = grid.points();
    let (mut torques, mut statuses, mut gaps) = (vec![], vec![], vec![]);
    let (mut offsets, mut nodes, mut forces) = (vec![0_u64], vec![], vec![]);
    for point in 0..points {
        let (torque, touched, gap) = touch(chain, object, &grid.configuration(point));
        torques.extend_from_slice(&torque);
        statuses.push(if touched.is_empty() { Status::Free } else { Status::Contact } as u8);
        gaps.push(gap as f32);
        for (node, force) in touched {
            nodes.push(node);
            forces.extend(force.as_vec3().to_array());
        }
        offsets.push(nodes.len() as u64);
    }
    Dataset {
        grid,
        torque: torques.into(),
        energy: None,
        gap: Some(gaps.into()),
        status: statuses.into(),
        residual: None,
        iterations: None,
        contacts: Some(Contacts { offsets: offsets.into(), nodes: nodes.into(), forces: forces.into() }),
        surface: Some(Surface {
            nodes: object.rest.iter().flat_map(|n| n.to_array()).collect::<Vec<f64>>().into(),
            triangles: object.triangles.as_flattened().to_vec().into(),
        }),
        scene: String::new(),
        provenance: Provenance::default(),
    }
}

/// A press into the sphere between 0.6 s and 2.4 s.
fn recording(chain: &Chain, object: &Object, ticks: usize) -> Trace {
    let joints = chain.joints.len();
    let push = |time: f64| (std::f64::consts::PI * (time - 0.5) / 2.0).sin().max(0.0);
    let tick = |index: usize| {
        let time = index as f64 * 1e-3;
        let q: Vec<f64> =
            (0..joints).map(|joint| [0.15, 0.22 + 0.32 * push(time), 0.2, 0.1, 0.1, 0.1][joint]).collect();
        let (torque, forces, _) = touch(chain, object, &q);
        let q = JointVector::from_slice(&q);
        let stored = 0.02 * torque.norm();
        Tick {
            time,
            hand: q,
            device: q,
            proxy: q,
            device_torque: torque,
            contact_torque: torque,
            index: f64::from(u8::from(!forces.is_empty())),
            contact: !forces.is_empty(),
            contact_nodes: forces.len() as u32,
            flags: Flags::default(),
            fault: None,
            accounts: Accounts {
                stored,
                kinetic: 1e-4 * (5.0 * time).sin().powi(2),
                spring: 0.3 * stored,
                coupling_work: 1.3 * stored + 1e-3 * time,
                field_work: -stored,
                proxy_dissipation: 4e-4 * time,
                coupling_dissipation: 6e-4 * time,
                leak: 2e-5 * (9.0 * time).sin(),
                ..Accounts::default()
            },
        }
    };
    let ticks: Vec<Tick> = (0..ticks).map(tick).collect();
    let frame = |tick: &Tick| {
        let (_, forces, _) = touch(chain, object, &tick.proxy);
        let displaced = |i: usize| {
            object.rest[i] + forces.iter().map(|&(j, f)| object.compliance.block(i, j as usize) * f).sum::<DVec3>()
        };
        Frame { time: tick.time, proxy: tick.proxy, nodes: (0..object.surface_nodes).map(displaced).collect() }
    };
    Trace {
        joints: chain
            .joints
            .iter()
            .map(|joint| JointLabel { name: joint.name.clone(), unit: "rad".to_owned() })
            .collect(),
        frames: ticks.iter().step_by(16).map(frame).collect(),
        ticks,
    }
}

fn folder(name: &str) -> PathBuf {
    PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(name)
}

#[test]
fn all_figures() {
    let (chain, object) = (arm(3), sphere());
    let dataset = dataset(&chain, &object, &[21, 24, 16]);
    let trace = recording(&chain, &object, 3000);
    let written = report::write_figures(&folder("figures"), &dataset, Some((&chain, &trace))).unwrap();
    assert_eq!(written.len(), 8);
}
