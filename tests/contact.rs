//! Equilibrium of one configuration, checked from outside.

use glam::DVec3;
use haptize::contact::{Equilibrium, Model, Solver, Status};
use haptize::object::Object;
use haptize::proxy::Chain;
use haptize::scene::{
    Algorithm, ContactSpec, GroundNodes, GroundSpec, JointKind, JointSpec, ObjectSpec, ProxyNodeSpec, ProxySpec, Shape,
    SpringKind, SpringSpec,
};

/// The paper's sphere: 102 nodes.
fn sphere(kind: SpringKind) -> ObjectSpec {
    ObjectSpec {
        shape: Shape::Sphere { centre: DVec3::new(0.16, 0.0, 0.0), radius: 0.05, rings: 10, segments: 10 },
        springs: SpringSpec { kind, stiffness: 300.0 },
        ground: GroundSpec { stiffness: 100.0, nodes: GroundNodes::All },
        node_mass: 0.01,
        node_damping: 0.1,
    }
}

fn joint(kind: JointKind, origin: DVec3, axis: DVec3, nodes: Vec<ProxyNodeSpec>) -> JointSpec {
    JointSpec {
        name: "joint".into(),
        kind,
        origin,
        axis,
        limits: [-3.0, 3.0],
        mass: 0.1,
        centre_of_mass: DVec3::ZERO,
        inertia: DVec3::splat(1e-4),
        rotor_inertia: 0.0,
        nodes,
    }
}

/// Nodes along x from `from` to `to` [m].
fn row(from: f64, to: f64, count: usize, radius: f64) -> Vec<ProxyNodeSpec> {
    (0..count)
        .map(|k| ProxyNodeSpec { position: DVec3::X * (from + (to - from) * k as f64 / (count - 1) as f64), radius })
        .collect()
}

/// An arm like a Phantom's: turning base, shoulder, elbow; 25 nodes along both moving links.
fn arm(radius: f64) -> ProxySpec {
    ProxySpec {
        joints: vec![
            joint(JointKind::Revolute, DVec3::new(0.0, 0.0, 0.07), DVec3::Z, vec![]),
            joint(JointKind::Revolute, DVec3::ZERO, DVec3::Y, row(0.03, 0.15, 12, radius)),
            joint(JointKind::Revolute, DVec3::X * 0.16, DVec3::Y, row(0.01, 0.13, 13, radius)),
        ],
    }
}

fn contact(algorithm: Algorithm, stiffness: f64) -> ContactSpec {
    ContactSpec { stiffness, algorithm, tolerance: 1e-8, max_iterations: 100 }
}

/// 24 x 16 x 21 = 8,064 configurations at pi/60 rad.
fn grid() -> Vec<[f64; 3]> {
    let step = std::f64::consts::PI / 60.0;
    let mut grid = Vec::new();
    for i in 0..24 {
        for j in 0..16 {
            for k in 0..21 {
                grid.push([
                    -11.5 * step + f64::from(i) * step,
                    -5.0 * step + f64::from(j) * step,
                    -2.0 * step + f64::from(k) * step,
                ]);
            }
        }
    }
    grid
}

#[test]
fn converged_contacts_compress_and_balance_the_object() {
    let object = Object::build(&sphere(SpringKind::Isotropic)).unwrap();
    let chain = Chain::new(&arm(0.0));
    for algorithm in [Algorithm::Energy, Algorithm::Linearised, Algorithm::Paper] {
        let model = Model::new(&object, &chain, contact(algorithm, 300.0));
        let mut solver = Solver::new(&model);
        let mut touching = 0;
        for q in grid().iter().step_by(97) {
            let equilibrium: Equilibrium = solver.solve(q);
            if equilibrium.status != Status::Contact {
                continue;
            }
            touching += 1;
            let on_object: DVec3 = equilibrium.forces.iter().map(|force| force.force).sum();
            let on_proxy: DVec3 = equilibrium.touches.iter().map(|touch| touch.force).sum();
            assert!((on_object + on_proxy).length() < 1e-12 * (1.0 + on_proxy.length()));
            assert!(equilibrium.gap < 0.0 && equilibrium.residual <= 1e-8 && equilibrium.energy > 0.0);
        }
        assert!(touching > 10, "{algorithm:?}: {touching}");
    }
}
