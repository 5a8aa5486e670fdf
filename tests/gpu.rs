//! The GPU backend against the CPU's f64 solver, on whatever adapter there is (software Vulkan counts). None is a failure.

use haptize::JointVector;
use haptize::contact::{Equilibrium, Model, Solver, Status};
use haptize::gpu::{AdapterChoice, Context, GpuSolver};
use haptize::haptize::Backend;
use haptize::object::Object;
use haptize::proxy::Chain;
use haptize::scene::{Algorithm, Scene};
use std::sync::{Arc, OnceLock};

/// One device for all tests of this process: opening one costs a second, and drivers dislike many.
fn context() -> Arc<Context> {
    static CONTEXT: OnceLock<Arc<Context>> = OnceLock::new();
    Arc::clone(CONTEXT.get_or_init(|| {
        Arc::new(Context::open(AdapterChoice::Any).unwrap_or_else(|error| panic!("GPU tests need an adapter: {error}")))
    }))
}

/// Scene, object and proxy of a file in `datasets/`.
fn load(name: &str) -> (Scene, Object, Chain) {
    let scene = Scene::load(format!("{}/datasets/{name}", env!("CARGO_MANIFEST_DIR"))).unwrap();
    let object = Object::build(&scene.object).unwrap();
    let chain = Chain::new(&scene.proxy);
    (scene, object, chain)
}

/// Every `stride`-th configuration of the scene's grid, from number `first` on.
fn configurations(scene: &Scene, first: usize, stride: usize) -> Vec<JointVector> {
    let axes = &scene.grid.axes;
    let points: usize = axes.iter().map(|axis| axis.count).product();
    let configuration = |mut point: usize| {
        let mut q = JointVector::zeros(axes.len());
        for (axis, value) in axes.iter().zip(q.iter_mut()).rev() {
            *value = axis.start + (point % axis.count) as f64 * axis.step;
            point /= axis.count;
        }
        q
    };
    (first..points).step_by(stride).map(configuration).collect()
}

fn distance(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b).powi(2)).sum::<f64>().sqrt()
}

/// Relative agreement that f32 owes f64 where both converged to the tolerance 1e-5: a hundred times the residual's
/// square in U, which is stationary, and ten times the residual in the torque.
const ENERGY_AGREEMENT: f64 = 1e-5;
const TORQUE_AGREEMENT: f64 = 1e-4;

/// What differs between two results beyond f32, or `None`.
fn difference(cpu: &Equilibrium, gpu: &Equilibrium) -> Option<String> {
    if cpu.status != gpu.status {
        return Some(format!("status {:?}, {:?}", cpu.status, gpu.status));
    }
    if cpu.status != Status::Contact {
        return None;
    }
    let energy = (cpu.energy - gpu.energy).abs() / cpu.energy;
    let torque = distance(&cpu.torque, &gpu.torque) / cpu.torque.norm();
    let agree = energy <= ENERGY_AGREEMENT && torque <= TORQUE_AGREEMENT && (cpu.gap - gpu.gap).abs() < 1e-6;
    (!agree).then(|| format!("U {energy:.1e}, tau {torque:.1e}, gap {:.1e}", cpu.gap - gpu.gap))
}

#[test]
fn the_sphere_has_the_same_equilibria_on_gpu_and_cpu() {
    let (scene, object, chain) = load("sphere.toml");
    let configurations = configurations(&scene, 11, 131);
    let mut spec = scene.contact;
    spec.algorithm = Algorithm::Energy;
    let model = Model::new(&object, &chain, spec);
    let mut cpu = Solver::new(&model);
    let mut gpu = GpuSolver::new(context(), &model).unwrap();
    let results = gpu.solve(&configurations).unwrap();
    let mut touching = 0;
    for (q, result) in configurations.iter().zip(&results) {
        let reference = cpu.solve(q);
        touching += usize::from(reference.status == Status::Contact);
        assert_eq!(difference(&reference, result), None, "{q:?}");
    }
    assert!(touching > 15, "only {touching} configurations touch");
    assert!(gpu.solved_on_cpu() * 10 <= touching, "{} of {touching} left to the CPU", gpu.solved_on_cpu());
}
