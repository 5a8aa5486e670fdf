//! `haptize bake --max-error ERROR --refine LEVELS`: the scene's grid, refined where the interpolation errs.

use super::{
    Failure,
    baked::{describe_error, describe_left_to_cpu},
    output::Replaced,
    remarks,
    report::{Describe, Report, Text},
    tell,
    watch::megabytes,
};
use crate::{
    contact::Backend,
    dataset::{MeasuredError, Provenance, Surface},
    names::counted,
    proxy::Chain,
    scene::Scene,
    store::Store,
    sweep::{
        Aim, BackendChoice, ChosenBackend, CpuBackend, Reference, build_object, grid_of, model_within,
        refine::{Refine, Refined},
        remark_on_mesh,
    },
};
use serde::Serialize;
use std::{path::Path, time::Instant};

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

/// A dataset that was refined.
#[derive(Serialize)]
struct BakedStore {
    file: String,
    #[serde(flatten)]
    refined: Refined,
    blocks: usize,
    /// Memory of the store, and its maximum as it was predicted (bytes).
    memory: usize,
    most_memory: usize,
    /// Rms error that was measured, and the one that was asked for, over the rms torque (1).
    error: Option<f64>,
    aim: f64,
    /// Points of a uniform grid of the finest spacing.
    uniform: usize,
    backend: String,
    adapter: String,
    left_to_cpu: usize,
    kept: bool,
    /// Size of the file (bytes).
    bytes: usize,
    /// Wall time (s).
    seconds: f64,
    #[serde(skip)]
    measured: MeasuredError,
    #[serde(flatten)]
    replaced: Option<Replaced>,
}

impl Describe for BakedStore {
    fn describe(&self, text: &mut Text) {
        let Self { file, refined, uniform, backend, adapter, .. } = self;
        let Refined { nodes, by_level, equilibria, solved, rounds, lowered, .. } = refined;
        text.line(format_args!(
            "{file}: {}, {by_level:?} by level, {:.1} s",
            counted(*nodes, ["node", "nodes"]),
            self.seconds
        ));
        describe_error(text, Some(&self.measured), Some(self.aim));
        text.row(
            "nodes",
            format_args!(
                "{:.1} times fewer than the {uniform} of a uniform grid of the finest spacing; {solved} solved, \
                 {}, {}, on {backend} ({adapter})",
                *uniform as f64 / (*nodes).max(1) as f64,
                counted(*equilibria, ["equilibrium", "equilibria"]),
                counted(*rounds, ["round", "rounds"])
            ),
        );
        describe_left_to_cpu(text, self.left_to_cpu);
        lowered.describe(text);
        let [disk, memory] = [self.bytes, self.memory].map(megabytes);
        text.row("bytes", format_args!("{disk} on the disk, {memory} in memory"));
        if !self.kept {
            text.line("  the aim was missed: the dataset is whole, and errs by more; give more levels or more points");
        }
        self.replaced.describe(text);
    }
}

/// Refines, measures and writes. Exit code 1 where the error that is measured is larger than asked for.
pub fn run(
    scene: &Scene,
    goal: &RefinementGoal<'_>,
    backend: BackendChoice,
    replaced: Option<Replaced>,
) -> Result<Report, Failure> {
    let began = Instant::now();
    let aim = goal.aim.checked(scene)?;
    let object = build_object(scene)?;
    let chain = Chain::new(&scene.proxy);
    let mut model = model_within(scene, &object, &chain)?;
    model.with_tangent = true;
    model.with_slip = scene.haptics.uses_slip();
    let warning = remark_on_mesh(&model).and_then(|error| error.warning());
    let solving = Instant::now();
    let seen = Reference::in_contact(scene, &model, 1, JUDGED)?;
    let each = solving.elapsed().as_secs_f64() / seen.solved() as f64;
    let mut judges = [seen, Reference::in_contact(scene, &model, 2, JUDGED)?];
    let aim = aim.relative(judges[0].torque);
    let mut refine =
        Refine { model: &model, base: grid_of(scene), levels: goal.levels, aim, most: goal.most, batch: 1 };
    let most = uniform(&refine).min(refine.most);
    let mut backend = ChosenBackend::open(backend.for_work(each * most as f64), &model)?;
    refine.batch = backend.chunk();
    let each = backend.is_cpu_alone().then_some(each);
    let most_memory = announce(&refine, &judges[0], each);
    let mut refined = refine.fill(&mut judges, &mut backend)?;
    refined.notices.splice(0..0, warning);
    refined.notices.iter().for_each(|notice| remarks::once(notice));
    let measured = judges[1].measure(&refined.store, &model);
    let (kept, memory, blocks) = (measured.keeps(aim), refined.store.bytes(), refined.store.blocks().len());
    let provenance = Provenance {
        notices: refined.notices.clone(),
        backend: backend.name().to_owned(),
        adapter: backend.adapter(),
        error: Some(measured.clone()),
        aim: Some(aim),
        ..CpuBackend::provenance(scene)
    };
    refined.store.save(&refine.base, Some(&Surface::of(&object)), &scene.text, &provenance, goal.output)?;
    let baked = BakedStore {
        file: goal.output.display().to_string(),
        refined,
        blocks,
        memory,
        most_memory,
        error: measured.relative(),
        aim,
        uniform: uniform(&refine),
        backend: provenance.backend,
        adapter: provenance.adapter,
        left_to_cpu: backend.left_to_cpu(),
        kept,
        bytes: std::fs::metadata(goal.output)?.len() as usize,
        seconds: began.elapsed().as_secs_f64(),
        measured,
        replaced,
    };
    Report::of(&baked, kept)
}

/// Points of a uniform grid of the finest spacing.
fn uniform(refine: &Refine<'_>) -> usize {
    refine.base.axes.iter().map(|axis| ((axis.count - 1) << (refine.levels - 1)) + 1).product()
}

/// Prints what the filling is going to take, before it begins; `each` is the time of a node (s), where it is known.
/// Returns the memory of the store at most (bytes).
fn announce(refine: &Refine<'_>, judge: &Reference, each: Option<f64>) -> usize {
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
