//! Contact with the surface at rest is a convex quadratic program. An off-the-shelf interior-point solver is
//! given its dual, with compliance, gaps and normals from elsewhere, and must find the same minimum.

use crate::fixture::{arm, contact, random_configurations, sphere};
use crate::oracle::{depth, displacement, pose};
use clarabel::algebra::CscMatrix;
use clarabel::solver::{DefaultSettingsBuilder, DefaultSolver, IPSolver, NonnegativeConeT};
use glam::DVec3;
use haptize::contact::{Model, Solver, Status};
use haptize::object::Object;
use haptize::proxy::Chain;
use haptize::scene::{ContactLaw, SpringKind};

/// Entries of a sparse matrix.
#[derive(Default)]
struct Triplets(Vec<usize>, Vec<usize>, Vec<f64>);

impl Triplets {
    fn push(&mut self, row: usize, column: usize, value: f64) {
        self.0.push(row);
        self.1.push(column);
        self.2.push(value);
    }

    fn matrix(self, rows: usize, columns: usize) -> CscMatrix<f64> {
        CscMatrix::new_from_triplets(rows, columns, self.0, self.1, self.2)
    }
}

/// Depths at rest, and W + I / kc with W = G K^-1 G^T from K itself, of all proxy nodes at `q`.
fn problem(object: &Object, chain: &Chain, q: &[f64], kc: f64) -> (Vec<f64>, Vec<Vec<f64>>) {
    let here = pose(chain, q);
    let rows: Vec<_> = here.nodes.iter().map(|x| depth(&object.rest, &object.triangles, *x)).collect();
    let mut compliance = vec![vec![0.0; rows.len()]; rows.len()];
    for (column, row) in rows.iter().enumerate() {
        let mut forces = vec![DVec3::ZERO; object.rest.len()];
        for (node, weight) in object.triangles[row.triangle].iter().zip(row.weights) {
            forces[*node as usize] += row.normal * weight;
        }
        let moved = displacement(object, &forces);
        for (k, other) in rows.iter().enumerate() {
            let along = object.triangles[other.triangle].iter().zip(other.weights);
            compliance[column][k] = along.map(|(node, weight)| weight * other.normal.dot(moved[*node as usize])).sum();
        }
        compliance[column][column] += 1.0 / kc;
    }
    (rows.iter().map(|row| row.depth).collect(), compliance)
}

/// The value of the dual at `forces`: `depth . lambda - 1/2 lambda (W + I / kc) lambda`.
fn dual((depths, compliance): &(Vec<f64>, Vec<Vec<f64>>), forces: &[f64]) -> f64 {
    let quadratic: f64 = compliance
        .iter()
        .zip(forces)
        .map(|(row, force)| force * row.iter().zip(forces).map(|(entry, other)| entry * other).sum::<f64>())
        .sum();
    depths.iter().zip(forces).map(|(depth, force)| depth * force).sum::<f64>() - 0.5 * quadratic
}

/// Energy and torque of the forces lambda >= 0 that maximise the dual of contact with the surface at rest; lengths in
/// millimetres, which keeps all numbers near one. The torque is the derivative of the dual at these forces, by central
/// differences of depths and compliance: it holds how rows change along the surface, without knowing it.
fn program(object: &Object, chain: &Chain, q: &[f64], kc: f64) -> (f64, Vec<f64>) {
    let here = problem(object, chain, q, kc);
    let unknowns = here.0.len();
    let mut hessian = Triplets::default();
    for (column, row) in here.1.iter().enumerate() {
        row[..=column].iter().enumerate().for_each(|(k, entry)| hessian.push(k, column, 1e3 * entry));
    }
    let mut constraints = Triplets::default();
    (0..unknowns).for_each(|k| constraints.push(k, k, -1.0));
    let slopes: Vec<f64> = here.0.iter().map(|depth| -1e3 * depth).collect();
    let settings = DefaultSettingsBuilder::default()
        .verbose(false)
        .tol_gap_abs(1e-13)
        .tol_gap_rel(1e-13)
        .tol_feas(1e-13)
        .build()
        .unwrap();
    let (hessian, constraints) = (hessian.matrix(unknowns, unknowns), constraints.matrix(unknowns, unknowns));
    let cones = [NonnegativeConeT(unknowns)];
    let mut solver =
        DefaultSolver::new(&hessian, &slopes, &constraints, &vec![0.0; unknowns], &cones, settings).unwrap();
    solver.solve();
    let forces = &solver.solution.x;
    let h = 1e-6;
    let torque = (0..q.len()).map(|joint| {
        let [before, after] = [-h, h].map(|step| {
            let mut q = q.to_vec();
            q[joint] += step;
            dual(&problem(object, chain, &q, kc), forces)
        });
        (before - after) / (2.0 * h)
    });
    (-1e-3 * solver.solution.obj_val, torque.collect())
}

#[test]
fn an_interior_point_solver_confirms_contact_at_rest() {
    let object = sphere(SpringKind::Isotropic);
    let chain = Chain::new(&arm(0.0));
    for stiffness in [100.0, 1e4] {
        let model = Model::new(&object, &chain, contact(ContactLaw::Rest, stiffness));
        let mut solver = Solver::new(&model);
        let mut compared = 0;
        for q in random_configurations(21, 60) {
            let result = solver.solve(&q);
            if result.status == Status::Free {
                continue;
            }
            assert_eq!(result.status, Status::Contact);
            let (energy, torque) = program(&object, &chain, &q, model.kc);
            assert!((result.energy - energy).abs() <= 1e-8 * energy, "{q:?}: U {} against {energy}", result.energy);
            for (a, b) in result.torque.iter().zip(&torque) {
                // Positions are rounded at 1e-17 m and differenced over 2e-6 rad.
                assert!((a - b).abs() <= 1e-7 * result.torque.norm(), "{q:?}: {a} against {b}");
            }
            compared += 1;
        }
        assert!(compared > 10, "{compared}");
        let q = [0.0, 0.25, 0.1];
        let wrong = program(&object, &chain, &q, 1.001 * model.kc).0;
        assert!((solver.solve(&q).energy - wrong).abs() > 1e-6 * wrong, "a stiffness off by a thousandth is noticed");
    }
}
