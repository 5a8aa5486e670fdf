//! Stores that are filled on the GPU, against those that the CPU fills.

use super::fixture::{context, load};
use crate::common::program::json;
use haptize::{
    contact::Model,
    dataset::Dataset,
    gpu::GpuSolver,
    scene::Scene,
    store::record::{slope, width},
    sweep::{
        Backend, CpuBackend, Reference, grid_of,
        refine::{Refine, Refined},
    },
};
use std::{path::Path, time::Instant};

/// Agreement of energies and torques at nodes, over their rms (1): f32 places the arm to some 1e-5 of the depths.
const AGREEMENT: f64 = 1e-4;

/// Rounding of the product of two numbers of a record, which are f32, on either side (1).
const RECORD_ROUNDING: f64 = 4.0 * f32::EPSILON as f64;

/// Fills both levels of a store, whole, and prints how fast.
fn fill<B: Backend>(name: &str, scene: &Scene, model: &Model<'_>, batch: usize, backend: &mut B) -> Refined {
    let mut judges = [1, 2].map(|seed| Reference::in_contact(scene, model, seed, 50).unwrap());
    let refine = Refine { model, base: grid_of(scene), levels: 2, aim: f64::MIN_POSITIVE, most: 10_000, batch };
    let start = Instant::now();
    let refined = refine.fill(&mut judges, backend).unwrap();
    println!(
        "{name}: {} nodes solved, {:.0} a second",
        refined.solved,
        refined.solved as f64 / start.elapsed().as_secs_f64()
    );
    refined
}

/// Energies and torques of a node by its record.
fn felt(record: &[f32]) -> impl Iterator<Item = f64> {
    let w = f64::from(record[0]).max(0.0);
    let joints = (1..).find(|&joints| width(joints) == record.len()).unwrap();
    let torques = (0..joints).map(move |a| w * f64::from(record[slope(a)])).collect::<Vec<_>>();
    std::iter::once(0.5 * w * w).chain(torques)
}

#[test]
fn a_store_that_the_gpu_fills_is_the_cpus() {
    let (scene, object, chain) = load("small.toml");
    let mut model = Model::new(&object, &chain, scene.contact);
    model.with_tangent = true;
    let mut gpu = GpuSolver::new(context(), &model).unwrap();
    let batch = gpu.chunk();
    let on_gpu = fill("GPU", &scene, &model, batch, &mut gpu);
    let mut cpu = CpuBackend::new(&model, 0).unwrap();
    let batch = cpu.chunk();
    let on_cpu = fill("CPU", &scene, &model, batch, &mut cpu);
    assert_eq!((&on_gpu.by_level, on_gpu.equilibria), (&on_cpu.by_level, on_cpu.equilibria));
    assert!(on_gpu.by_level[1..].iter().all(|nodes| *nodes > 0) && on_gpu.equilibria > 30, "{:?}", on_gpu.by_level);
    let pairs: Vec<_> = on_gpu.store.blocks().into_iter().zip(on_cpu.store.blocks()).collect();
    let mut rows = Vec::new();
    for ((key, block), (other_key, other)) in &pairs {
        let (gpu, cpu) = (block.nodes(), other.nodes());
        assert_eq!((key, gpu.present, &gpu.status), (other_key, cpu.present, &cpu.status));
        let width = gpu.records.len().checked_div(gpu.status.len()).unwrap_or(1);
        rows.extend(gpu.records.chunks(width).zip(cpu.records.chunks(width)));
    }
    let rms = |k: usize| {
        let squares: f64 = rows.iter().filter_map(|(_, cpu)| felt(cpu).nth(k)).map(|x| x * x).sum();
        (squares / rows.len() as f64).sqrt()
    };
    let rms: Vec<f64> = (0..=chain.joints.len()).map(rms).collect();
    assert!(rms.iter().all(|rms| *rms > 0.0), "{rms:?}");
    for (gpu, cpu) in &rows {
        for ((a, b), rms) in felt(gpu).zip(felt(cpu)).zip(&rms) {
            assert!((a - b).abs() <= AGREEMENT * rms + RECORD_ROUNDING * b.abs(), "{a:e} for {b:e}, rms {rms:e}");
        }
    }
}

#[test]
fn a_refined_bake_names_the_gpu_that_solved() {
    let folder = tempfile::tempdir().unwrap();
    let scene = include_str!("../../scenes/small.toml");
    std::fs::write(folder.path().join("small.toml"), scene).unwrap();
    let bake = |backend: &str| -> serde_json::Value {
        let bake = ["bake", "small.toml", "--max-error", "5%", "--refine", "2", "--backend", backend, "--json"];
        json(folder.path(), &bake)
    };
    let [gpu, cpu] = ["gpu", "cpu"].map(|backend| {
        let report = bake(backend);
        let dataset = Dataset::open(Path::new(&folder.path().join("small.haptize"))).unwrap();
        assert_eq!((&report["backend"], &dataset.provenance.backend[..]), (&backend.into(), backend));
        assert_eq!(report["adapter"], dataset.provenance.adapter.as_str());
        report
    });
    assert!(gpu["adapter"] != cpu["adapter"] && gpu["by_level"] == cpu["by_level"], "{gpu:#} {cpu:#}");
}
