//! A bake in shards: each on its own, in any order, killed and run twice; merged to the file of one bake.

use crate::{
    fixture::{self, MadeUp, POINTS, sweep_of},
    lowest,
};
use haptize::{
    Error, ErrorKind,
    dataset::Dataset,
    scene::Scene,
    sweep::{BackendChoice, Bake, Lowered, Merge, Plan, Progress, Run, Shard, Sweep, SweepReport},
};
use std::{
    fs,
    path::{Path, PathBuf},
    sync::atomic::{AtomicBool, Ordering},
};

/// Shards of the scene's 469 points: some have two stretches, some one.
const COUNT: usize = 5;

/// Which of three shards has the one stretch of the small scene.
const FULL: usize = 2;

/// A scene in which neighbours lead to lower equilibria, across the borders of shards.
fn scene() -> Scene {
    Scene::parse(lowest::SCENE, "deep.toml").unwrap()
}

/// Does `work` with a bake of `scene` that stops once `stop_at` points are done.
fn with<T>(scene: &Scene, day: usize, stop_at: usize, work: impl FnOnce(Bake<'_>) -> T) -> T {
    let stop = AtomicBool::new(false);
    let mut progress = |progress: Progress| stop.store(progress.done >= stop_at, Ordering::Relaxed);
    let (backend, date) = (BackendChoice::Cpu, format!("2012-03-{:02}T00:00:00Z", day + 1));
    work(Bake { scene, backend, measured: Some(40), aim: None, date: &date, stop: &stop, progress: &mut progress })
}

fn solve(scene: &Scene, folder: &Path, index: usize, stop_at: usize) -> Result<(PathBuf, Option<SweepReport>), Error> {
    with(scene, index, stop_at, |bake| bake.to_shard(folder, Shard { index, count: COUNT }))
}

/// All shards in a folder, solved last one first.
fn solved(scene: &Scene) -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    (0..COUNT).rev().for_each(|index| drop(solve(scene, folder.path(), index, usize::MAX).unwrap()));
    folder
}

fn merged(parts: &Path, output: &Path) -> Result<SweepReport, Error> {
    let merge = Merge::gather(&[parts.to_path_buf()])?;
    merge.to_file(output, Some(40), &AtomicBool::new(false), &mut |_| ())
}

/// One bake, and its report.
fn whole(scene: &Scene) -> (Vec<u8>, SweepReport) {
    let folder = fixture::Folder::new();
    let report = with(scene, 0, usize::MAX, |bake| bake.to_file(&folder.output(), false)).unwrap();
    (fs::read(folder.output()).unwrap(), report)
}

fn names(folder: &Path) -> Vec<String> {
    let mut names: Vec<_> =
        fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect();
    names.sort();
    names
}

#[test]
fn shards_merge_to_the_bits_of_one_bake() {
    let scene = scene();
    let (one, report) = whole(&scene);
    let Lowered { points, .. } = report.lowered.unwrap();
    assert!(points > 10, "neighbours lead to lower equilibria: {report:?}");
    let folder = tempfile::tempdir().unwrap();
    let parts = folder.path().join("parts");
    // Out of order; each one stopped at its beginning and continued on another day.
    for index in [3, 0, 4, 2, 1] {
        let stopped = solve(&scene, &parts, index, 0).unwrap_err();
        assert!(stopped.to_string().starts_with("stopped after 0 of"), "{stopped}");
        let (file, report) = solve(&scene, &parts, index, usize::MAX).unwrap();
        assert_eq!(report.unwrap().points, Shard { index, count: COUNT }.points(469));
        let name = file.file_name().unwrap().to_str().unwrap().to_owned();
        assert!(name.starts_with("deep-") && name.ends_with(&format!(".{index}-of-5.shard")), "{name}");
    }
    assert_eq!(names(&parts).len(), COUNT, "no part is left");
    let output = folder.path().join("a.haptize");
    let merged_report = merged(&parts, &output).unwrap();
    assert!(fs::read(&output).unwrap() == one, "merged and baked at once");
    assert_eq!(
        merged_report.lowered.map(|lowered| Lowered { seconds: 0.0, ..lowered }),
        report.lowered.map(|l| Lowered { seconds: 0.0, ..l })
    );
    assert_eq!(names(folder.path()), ["a.haptize", "parts"]);
    // The comparison sees one point's difference: another tolerance.
    let other = Scene::parse(&lowest::SCENE.replace("stiffness = 5000.0", "stiffness = 5001.0"), "deep.toml").unwrap();
    assert!(whole(&other).0 != one);
}

#[test]
fn shards_that_are_not_there_are_named() {
    let error = merged(Path::new("nowhere"), Path::new("unused.haptize")).unwrap_err().to_string();
    assert!(
        error.starts_with("nowhere: cannot be read") && error.ends_with("check the path and its permissions"),
        "{error}"
    );
}

#[test]
fn a_shard_run_twice_is_left_alone_and_an_interrupted_merge_continues() {
    let (scene, folder) = (scene(), fixture::Folder::new());
    let parts = solved(&scene);
    let (file, none) = solve(&scene, parts.path(), 2, usize::MAX).unwrap();
    assert!(none.is_none() && file.exists() && names(parts.path()).len() == COUNT);
    // The same shard by two nodes, in folders of their own.
    let copy = parts.path().join("copy.shard");
    fs::copy(&file, &copy).unwrap();
    let merge = Merge::gather(&[parts.path().to_path_buf()]).unwrap();
    assert!(merge.missing().is_empty() && merge.notes.len() == 1 && merge.notes[0].contains("shard 2 is there twice"));
    // Stopped while it looks for lower equilibria, after all points were copied.
    let stopped = merge.to_file(&folder.output(), Some(40), &AtomicBool::new(true), &mut |_| ()).unwrap_err();
    assert_eq!(stopped.to_string(), "stopped; the same command continues");
    assert_eq!(folder.names(), ["a.haptize.part"]);
    // As if it had been killed while it copied.
    let part = fs::read(folder.part()).unwrap();
    fs::write(folder.part(), &part[..part.len() / 2]).unwrap();
    merged(parts.path(), &folder.output()).unwrap();
    assert!(fs::read(folder.output()).unwrap() == whole(&scene).0);
    // What is none of this sweep's is not overwritten.
    fs::write(folder.part(), "my notes").unwrap();
    assert!(merged(parts.path(), &folder.output()).is_err());
    assert_eq!(fs::read(folder.part()).unwrap(), b"my notes");
}

#[test]
fn what_is_missing_or_damaged_is_named_and_solved_again() {
    let (scene, folder) = (scene(), fixture::Folder::new());
    let parts = solved(&scene);
    let file = |index: usize| {
        let name = names(parts.path()).into_iter().find(|name| name.contains(&format!(".{index}-of-"))).unwrap();
        parts.path().join(name)
    };
    let (lost, damaged, cut) = (file(0), file(2), file(3));
    fs::remove_file(lost).unwrap();
    let mut bytes = fs::read(&damaged).unwrap();
    let last = bytes.len() - 9;
    bytes[last] ^= 1;
    fs::write(&damaged, &bytes).unwrap();
    let bytes = fs::read(&cut).unwrap();
    fs::write(&cut, &bytes[..bytes.len() - 1]).unwrap();
    let merge = Merge::gather(&[parts.path().to_path_buf()]).unwrap();
    assert_eq!((merge.missing(), merge.count()), (vec![0, 2, 3], COUNT));
    assert!(merge.notes.iter().all(|note| note.contains("damaged")) && merge.notes.len() == 2, "{:?}", merge.notes);
    let refused = merge.to_file(&folder.output(), None, &AtomicBool::new(false), &mut |_| ()).unwrap_err().to_string();
    assert!(refused.contains("0,2-3 of 5") && refused.contains("--shard I/5"), "{refused}");
    for index in merge.missing() {
        let (_, report) = solve(&scene, parts.path(), index, usize::MAX).unwrap();
        let report = report.unwrap();
        assert!(report.resumed_points < report.points, "what is damaged is solved anew: {report:?}");
    }
    merged(parts.path(), &folder.output()).unwrap();
    assert!(fs::read(folder.output()).unwrap() == whole(&scene).0);
}

#[test]
fn what_does_not_belong_together_is_refused() {
    let scene = scene();
    let parts = solved(&scene);
    let gathered = || Merge::gather(&[parts.path().to_path_buf()]).map(|_| ()).unwrap_err();
    let other = Scene::parse(&lowest::SCENE.replace("stiffness = 5000.0", "stiffness = 5001.0"), "deep.toml").unwrap();
    let (file, _) = solve(&other, parts.path(), 1, usize::MAX).unwrap();
    let refused = gathered();
    assert!(refused.to_string().contains("begun with another text of the scene"), "{refused}");
    fs::remove_file(file).unwrap();
    let (file, _) =
        with(&scene, 0, usize::MAX, |bake| bake.to_shard(parts.path(), Shard { index: 1, count: 7 })).unwrap();
    let refused = gathered();
    assert!(refused.to_string().contains("begun with another number of shards"), "{refused}");
    fs::remove_file(file).unwrap();
    let note = parts.path().join("notes.shard");
    fs::write(&note, "my notes").unwrap();
    let refused = gathered();
    assert!(refused.to_string().starts_with(&format!("{}: is not a shard", note.display())), "{refused}");
    let refused = Merge::gather(&[note.with_extension("none")]).map(|_| ()).unwrap_err();
    assert_eq!(refused.kind(), ErrorKind::File, "{refused}");
    let empty = tempfile::tempdir().unwrap();
    let refused = Merge::gather(&[empty.path().to_path_buf()]).map(|_| ()).unwrap_err();
    assert!(refused.to_string().contains("bake --shard"), "{refused}");
}

#[test]
fn no_bytes_make_a_wrong_dataset() {
    let folder = tempfile::tempdir().unwrap();
    let (file, _) =
        bake_made_up(&mut sweep_of(&fixture::scene(), "none", "2012-03-04T00:00:00Z"), folder.path(), FULL).unwrap();
    let bytes = fs::read(&file).unwrap();
    let read = |bytes: &[u8]| {
        fs::write(&file, bytes).unwrap();
        Merge::gather(std::slice::from_ref(&file)).map(|merge| merge.missing())
    };
    assert_eq!(read(&bytes).unwrap(), [0, 1]);
    for length in (0..bytes.len()).step_by(7) {
        assert!(read(&bytes[..length]).map_or(true, |missing| missing == [0, 1, 2]), "cut to {length} bytes");
    }
    for at in (0..bytes.len()).step_by(5) {
        let mut altered = bytes.clone();
        altered[at] ^= 1 << (at % 8);
        assert!(read(&altered).map_or(true, |missing| missing == [0, 1, 2]), "byte {at} altered");
    }
    assert_eq!(read(&[&bytes[..], b"more"].concat()).unwrap(), [0, 1, 2]);
}

/// Solves one of three shards of the small scene with made-up numbers.
fn bake_made_up(sweep: &mut Sweep<'_>, folder: &Path, index: usize) -> Result<(PathBuf, Option<SweepReport>), Error> {
    let run = Run { chunk: 10, stop: &AtomicBool::new(false), progress: &mut |_| () };
    sweep.bake_shard(&mut MadeUp::default(), folder, Shard { index, count: 3 }, run)
}

#[test]
fn shards_of_other_backends_are_named_in_the_provenance() {
    let folder = fixture::Folder::new();
    let parts = tempfile::tempdir().unwrap();
    // Made-up numbers come without tangents.
    let linear = format!("{}\n[haptics]\ninterpolation = \"linear\"\n", fixture::SCENE);
    let linear = Scene::parse(&linear, "small.toml").unwrap();
    for (index, adapter) in [(0, "none"), (1, "other"), (2, "none")] {
        let mut sweep = sweep_of(&linear, adapter, "2012-03-04T00:00:00Z");
        let (_, report) = bake_made_up(&mut sweep, parts.path(), index).unwrap();
        assert_eq!(report.unwrap().points, if index == FULL { POINTS } else { 0 }, "a stretch has 64 points");
    }
    let report = merged(parts.path(), &folder.output()).unwrap();
    assert_eq!(report.points, POINTS);
    let provenance = Dataset::open(&folder.output()).unwrap().provenance;
    assert_eq!(provenance.notices, ["shards 1 of 3 were solved on cpu (other)"]);
    assert_eq!(provenance.adapter, "none");
}

#[cfg(unix)]
#[test]
fn two_workers_on_one_shard_do_not_mix() {
    let parts = tempfile::tempdir().unwrap();
    let mut tried = false;
    let mut progress = |_| {
        if !std::mem::replace(&mut tried, true) {
            let second = bake_made_up(&mut sweep_of(&fixture::scene(), "none", ""), parts.path(), 0);
            assert!(second.unwrap_err().to_string().contains("another process is writing"));
        }
    };
    let run = Run { chunk: 10, stop: &AtomicBool::new(false), progress: &mut progress };
    let mut sweep = sweep_of(&fixture::scene(), "none", "");
    sweep.bake_shard(&mut MadeUp::default(), parts.path(), Shard { index: 0, count: 3 }, run).unwrap();
    assert!(tried && names(parts.path()).len() == 1);
}

#[test]
fn a_plan_counts_what_shards_solve() {
    let text = fixture::SCENE
        .replace("step = 0.1, count = 7", "stop = 0.3, count = 61")
        .replace("step = 0.004, count = 9", "step = 0.002, count = 40");
    let scene = Scene::parse(&text, "small.toml").unwrap();
    let plan = Plan::new(&scene, BackendChoice::Cpu, 4, &AtomicBool::new(false)).unwrap();
    assert_eq!((plan.points, plan.shards.len()), (61 * 40, 4));
    assert!(plan.seconds().unwrap() >= plan.longest().unwrap() && plan.memory > 0);
    let folder = tempfile::tempdir().unwrap();
    let (mut solved, mut bytes) = (0, 0);
    for cost in &plan.shards {
        let shard = Shard { index: cost.shard, count: 4 };
        let (file, report) = with(&scene, 0, usize::MAX, |bake| bake.to_shard(folder.path(), shard)).unwrap();
        let report = report.unwrap();
        assert_eq!((cost.points, cost.solved), (report.points, report.points - report.skipped_points));
        solved += cost.solved;
        bytes += fs::metadata(file).unwrap().len();
    }
    assert_eq!(solved, plan.solved);
    assert!(plan.solved < plan.points, "some points are free: {plan:?}");
    let predicted: usize = plan.shards.iter().map(|shard| shard.bytes).sum();
    assert!((0.5..2.0).contains(&(predicted as f64 / bytes as f64)), "{predicted} predicted, {bytes} written");
}

/// The sample by which `auto` chooses a backend is of the whole grid: a shard does not pass its cost for its own.
#[test]
fn a_shard_states_no_forecast_of_the_whole_grid() {
    let text = fixture::SCENE
        .replace("step = 0.1, count = 7", "stop = 0.3, count = 36")
        .replace("step = 0.004, count = 9", "step = 0.001, count = 29");
    let scene = Scene::parse(&text, "fine.toml").unwrap();
    let folder = tempfile::tempdir().unwrap();
    for is_whole in [true, false] {
        let mut stated = Vec::new();
        let mut progress = |progress: Progress| stated.push(progress.forecast.is_some());
        let (backend, stop) = (BackendChoice::Auto, &AtomicBool::new(false));
        let progress = &mut progress;
        let bake = Bake { scene: &scene, backend, measured: Some(0), aim: None, date: "", stop, progress };
        if is_whole {
            bake.in_memory().unwrap();
        } else {
            bake.to_shard(folder.path(), Shard { index: 0, count: 2 }).unwrap();
        }
        assert!(!stated.is_empty() && stated.iter().all(|stated| *stated == is_whole), "{stated:?}");
    }
}
