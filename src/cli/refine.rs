//! `haptize bake --max-error ERROR --refine LEVELS`: the scene's grid, refined where the interpolation errs.

use super::{Failure, Report, tell, watch::megabytes};
use crate::{
    contact::Model,
    dataset::{Dataset, Provenance, Surface},
    proxy::Chain,
    scene::Scene,
    store::{Order, Store},
    sweep::{
        Aim, CpuBackend, build_object, check_algorithm, grid_of, order_of,
        refine::{Judge, Refine},
        sample,
    },
};
use std::{fmt::Write, path::Path, sync::Arc, time::Instant};

/// Configurations in contact by which the refinement is stopped, and as many others at which its error is measured [1]:
/// with fewer the rms varies by more than a tenth.
const JUDGED: usize = 400;

/// Request of a refined bake.
pub struct RefinementGoal<'a> {
    /// The error to stay below.
    pub aim: Aim,
    /// Most levels, the scene's grid included.
    pub levels: u32,
    /// Most nodes that are solved.
    pub most: usize,
    /// The dataset to write.
    pub output: &'a Path,
}

/// Refines, measures and writes. Exit code 1 where the error that is measured is larger than asked for.
pub fn run(scene: &Scene, wanted: &RefinementGoal<'_>) -> Result<Report, Failure> {
    let began = Instant::now();
    check_algorithm(scene)?;
    let object = build_object(scene)?;
    let chain = Chain::new(&scene.proxy);
    let mut model = Model::reaching(&object, &chain, scene.contact, &sample(scene))?;
    let order = order_of(scene);
    model.with_tangent = order == Order::Potential;
    let solving = Instant::now();
    let seen = Judge::new(scene, &model, 1, JUDGED)?;
    let each = solving.elapsed().as_secs_f64() / seen.solved() as f64;
    let unseen = Judge::new(scene, &model, 2, JUDGED)?;
    let aim = match wanted.aim {
        Aim::Relative(share) => share,
        Aim::Absolute(torque) => torque / seen.torque(),
    };
    let base = grid_of(scene);
    let uniform: usize = base.axes.iter().map(|axis| ((axis.count - 1) << (wanted.levels - 1)) + 1).product();
    let percent = 100.0 * aim;
    tell(format_args!(
        "haptize: for an rms error of {percent:.2} %: {} points of the scene's grid, and of up to {uniform} where it \
         errs",
        base.points()
    ));
    let most = uniform.min(wanted.most);
    let [memory, disk] = Store::most_bytes(base.axes.len(), most);
    tell(format_args!(
        "haptize: that is at most {most} nodes, which would take about {:.0} s to solve, {} of memory and {} of disk",
        (each * most as f64).ceil(),
        megabytes(memory),
        megabytes(disk)
    ));
    let refine = Refine { model: &model, base: base.clone(), levels: wanted.levels, order, aim, most: wanted.most };
    let refined = refine.fill(&seen)?;
    let measured = unseen.relative_error(|q| refined.store.sample(q).torque());
    let (bytes, blocks) = (refined.store.bytes(), refined.store.blocks().len());
    let notice = format!(
        "refined for an rms error of {percent:.2} %: {:.2} % at {JUDGED} configurations in contact that were not used",
        100.0 * measured
    );
    let provenance = Provenance { notices: vec![notice], ..CpuBackend::provenance(scene) };
    let (nodes, solved, by_level, rounds) = (refined.nodes, refined.solved, refined.by_level.clone(), refined.rounds);
    let equilibria = refined.equilibria;
    let surface = Some(Surface::of(&object));
    let dataset = Dataset::refined(Arc::new(refined.store), base, surface, scene.text.clone(), provenance);
    dataset.save(wanted.output)?;
    let (seconds, file) = (began.elapsed().as_secs_f64(), std::fs::metadata(wanted.output)?.len() as usize);
    let kept = measured <= aim;
    let mut text = String::new();
    writeln!(text, "{}: {nodes} nodes, {by_level:?} by level, {seconds:.1} s", wanted.output.display())?;
    writeln!(
        text,
        "  error        {:.2} % rms at configurations not used, {percent:.2} % asked for",
        100.0 * measured
    )?;
    writeln!(
        text,
        "  nodes        {:.1} times fewer than the {uniform} of a uniform grid of the finest spacing; {solved} \
         solved, {equilibria} equilibria, {rounds} rounds",
        uniform as f64 / nodes.max(1) as f64
    )?;
    writeln!(text, "  bytes        {} on the disk, {} in memory", megabytes(file), megabytes(bytes))?;
    if !kept {
        writeln!(
            text,
            "  the aim was missed: the dataset is whole, and errs by more; give more levels or more points"
        )?;
    }
    let json = serde_json::json!({
        "file": wanted.output.display().to_string(), "nodes": nodes, "by_level": by_level,
        "equilibria": equilibria, "solved": solved, "blocks": blocks, "bytes": file, "memory": bytes,
        "most_memory": memory, "error": measured, "aim": aim, "uniform": uniform, "rounds": rounds,
        "seconds": seconds,
        "kept": kept,
    });
    Ok(Report { text, json, whole: kept })
}
