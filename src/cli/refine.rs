//! `haptize bake --max-error ERROR --refine LEVELS`: the scene's grid, refined where the interpolation errs.

use super::{
    Failure, Report, info, tell,
    watch::{counted, left_to_cpu, lowered, megabytes},
};
use crate::{
    contact::{Backend, Model},
    dataset::{MeasuredError, Provenance, Surface},
    proxy::Chain,
    scene::Scene,
    store::Store,
    sweep::{
        Aim, BackendChoice, ChosenBackend, CpuBackend, build_object, check_algorithm, grid_of,
        refine::{Judge, Refine, Refined},
        sample,
    },
};
use std::{fmt::Write, path::Path, time::Instant};

/// Configurations in contact by which the refinement is stopped, and as many others at which its error is measured (1):
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
pub fn run(scene: &Scene, wanted: &RefinementGoal<'_>, backend: BackendChoice) -> Result<Report, Failure> {
    let began = Instant::now();
    check_algorithm(scene)?;
    let aim = wanted.aim.checked(scene)?;
    let object = build_object(scene)?;
    let chain = Chain::new(&scene.proxy);
    let mut model = Model::reaching(&object, &chain, scene.contact, &sample(scene))?;
    model.with_tangent = true;
    model.with_slip = scene.haptics.uses_slip();
    let solving = Instant::now();
    let seen = Judge::new(scene, &model, 1, JUDGED)?;
    let each = solving.elapsed().as_secs_f64() / seen.solved() as f64;
    let mut judges = [seen, Judge::new(scene, &model, 2, JUDGED)?];
    let aim = aim.relative(judges[0].torque());
    let mut refine =
        Refine { model: &model, base: grid_of(scene), levels: wanted.levels, aim, most: wanted.most, batch: 1 };
    let most = uniform(&refine).min(refine.most);
    let mut backend = ChosenBackend::open(backend.for_work(each * most as f64), &model)?;
    refine.batch = backend.chunk();
    let each = matches!(backend, ChosenBackend::Cpu(_)).then_some(each);
    let most_memory = announce(&refine, &judges[0], each);
    let refined = refine.fill(&mut judges, &mut backend)?;
    refined.notices.iter().for_each(|notice| tell(format_args!("haptize: {notice}")));
    let measured = judges[1].measure(&refined.store, &model);
    let error = measured.relative();
    let (kept, file) = (measured.keeps(aim), wanted.output.display());
    let memory = refined.store.bytes();
    let mut json = serde_json::json!({
        "file": file.to_string(), "nodes": refined.nodes, "by_level": refined.by_level,
        "equilibria": refined.equilibria, "solved": refined.solved, "blocks": refined.store.blocks().len(),
        "memory": memory, "most_memory": most_memory, "error": error, "aim": aim, "uniform": uniform(&refine),
        "rounds": refined.rounds, "lowered": refined.lowered, "backend": backend.name(), "adapter": backend.adapter(),
        "left_to_cpu": backend.left_to_cpu(), "warnings": refined.notices, "kept": kept,
    });
    let mut text = String::new();
    describe(&mut text, &refine, &refined, &measured, &backend)?;
    let (backend, adapter, notices) = (backend.name().to_owned(), backend.adapter(), refined.notices);
    let (error, aim) = (Some(measured), Some(aim));
    let provenance = Provenance { notices, backend, adapter, error, aim, ..CpuBackend::provenance(scene) };
    refined.store.save(&refine.base, Some(&Surface::of(&object)), &scene.text, &provenance, wanted.output)?;
    let (seconds, bytes) = (began.elapsed().as_secs_f64(), std::fs::metadata(wanted.output)?.len() as usize);
    json["bytes"] = bytes.into();
    json["seconds"] = seconds.into();
    let (nodes, by_level) = (refined.nodes, refined.by_level);
    text.insert_str(0, &format!("{file}: {nodes} nodes, {by_level:?} by level, {seconds:.1} s\n"));
    writeln!(text, "  bytes        {} on the disk, {} in memory", megabytes(bytes), megabytes(memory))?;
    if !kept {
        writeln!(
            text,
            "  the aim was missed: the dataset is whole, and errs by more; give more levels or more points"
        )?;
    }
    Ok(Report { text, json, whole: kept })
}

/// Points of a uniform grid of the finest spacing.
fn uniform(refine: &Refine<'_>) -> usize {
    refine.base.axes.iter().map(|axis| ((axis.count - 1) << (refine.levels - 1)) + 1).product()
}

/// Prints what the filling is going to take, before it begins; `each` is the time of a node (s), where it is known.
/// Returns the memory of the store at most (bytes).
fn announce(refine: &Refine<'_>, judge: &Judge, each: Option<f64>) -> usize {
    let (percent, uniform) = (100.0 * refine.aim, uniform(refine));
    tell(format_args!(
        "haptize: for an rms error of {percent:.2} %: {} points of the scene's grid, and of up to {uniform} where it \
         errs",
        refine.base.points()
    ));
    let most = uniform.min(refine.most);
    let [memory, disk] = Store::most_bytes(refine.base.axes.len(), most, refine.model.with_slip);
    let time = each.map_or(String::new(), |each| format!("{:.0} s to solve, ", (each * most as f64).ceil()));
    tell(format_args!(
        "haptize: that is at most {most} nodes, which would take about {time}{} of memory, {} more while they are \
         solved, and {} of disk",
        megabytes(memory),
        megabytes(refine.filling_bytes(most, judge)),
        megabytes(disk)
    ));
    memory
}

/// Describes what was filled, for people.
fn describe(
    text: &mut String,
    refine: &Refine<'_>,
    refined: &Refined,
    measured: &MeasuredError,
    backend: &ChosenBackend<'_>,
) -> std::fmt::Result {
    let uniform = uniform(refine);
    let Refined { nodes, solved, equilibria, rounds, .. } = refined;
    let (name, adapter) = (backend.name(), backend.adapter());
    info::error(text, Some(measured), Some(refine.aim))?;
    writeln!(
        text,
        "  nodes        {:.1} times fewer than the {uniform} of a uniform grid of the finest spacing; {solved} \
         solved, {equilibria} equilibria, {}, on {name} ({adapter})",
        uniform as f64 / (*nodes).max(1) as f64,
        counted(*rounds, ["round", "rounds"])
    )?;
    left_to_cpu(text, backend.left_to_cpu())?;
    lowered(text, refined.lowered)
}
