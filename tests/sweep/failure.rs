//! Devices that fail, folders that cannot be written, disks that are full.

use crate::fixture::{Folder, MadeUp, POINTS, answer, bake, scene, sweep, uninterrupted};
use haptize::{
    contact::{Model, Solver},
    dataset::Dataset,
    object::Object,
    proxy::Chain,
    sweep::{Run, WithFallback},
};
use std::sync::atomic::AtomicBool;

#[test]
fn a_failing_backend_leaves_a_part_and_the_earlier_file() {
    let whole = uninterrupted();
    let folder = Folder::new();
    // As much of an earlier dataset as tells it apart from other files.
    let earlier = br#"........{"__metadata__":{"checksum":"00000000","format":"haptize 1"}}"#;
    std::fs::write(folder.output(), earlier).unwrap();
    let mut broken = MadeUp { breaks_after: 25, ..MadeUp::default() };
    let error = bake(&sweep(), &mut broken, &folder.output(), false, 10, usize::MAX).unwrap_err();
    assert_eq!(error.to_string(), "the backend failed at grid points 20 to 29: device lost");
    assert_eq!(std::fs::read(folder.output()).unwrap(), earlier);
    let report = bake(&sweep(), &mut MadeUp::default(), &folder.output(), true, 10, usize::MAX).unwrap();
    assert_eq!(report.resumed_points, 20);
    assert!(std::fs::read(folder.output()).unwrap() == whole);
}

#[test]
fn a_file_of_another_kind_is_not_replaced() {
    let folder = Folder::new();
    std::fs::write(folder.output(), "a thesis").unwrap();
    let error = bake(&sweep(), &mut MadeUp::default(), &folder.output(), false, 10, usize::MAX).unwrap_err();
    assert!(error.to_string().contains("not a dataset"), "{error}");
    assert_eq!(
        (std::fs::read(folder.output()).unwrap(), folder.names()),
        (b"a thesis".to_vec(), vec!["a.haptize".into()])
    );
}

#[test]
fn what_another_process_writes_or_a_link_leads_to_is_left_alone() {
    let folder = Folder::new();
    let begin = || bake(&sweep(), &mut MadeUp::default(), &folder.output(), false, 10, usize::MAX);
    let part = std::fs::File::create(folder.part()).unwrap();
    part.lock().unwrap();
    let error = begin().unwrap_err();
    assert!(error.to_string().contains("another process is writing"), "{error}");
    drop(part);
    std::fs::remove_file(folder.part()).unwrap();
    #[cfg(unix)]
    {
        let target = folder.0.path().join("notes.txt");
        std::fs::write(&target, "").unwrap();
        std::os::unix::fs::symlink(&target, folder.part()).unwrap();
        let error = begin().unwrap_err();
        assert!(error.to_string().contains("cannot be continued: it is a link"), "{error}");
        assert_eq!(std::fs::read(&target).unwrap(), b"");
        std::fs::remove_file(folder.part()).unwrap();
    }
    begin().unwrap();
}

/// The device breaks down for good in the third batch of ten, after a part of it in the same batch; the sweep goes on,
/// and says both in report and file, also when it is killed later on and resumed.
#[test]
fn a_sweep_whose_device_is_lost_goes_on_with_the_cpu() {
    let scene = scene();
    let (object, chain) = (Object::build(&scene.object).unwrap(), Chain::new(&scene.proxy));
    let model = Model::new(&object, &chain, scene.contact);
    let lossy = || WithFallback::new(MadeUp { breaks_after: 25, ..MadeUp::default() }, "a made-up device", &model);
    let folder = Folder::new();
    let report = bake(&sweep(), &mut lossy(), &folder.output(), false, 10, usize::MAX).unwrap();
    assert_eq!(report.left_to_cpu, 10, "half of the first two batches");
    let dataset = Dataset::open(&folder.output()).unwrap();
    let [part, notice] = &dataset.provenance.notices[..] else { panic!("{:?}", dataset.provenance) };
    assert_eq!(part, "from grid point 20 on: went on without a part of it");
    assert!(notice.starts_with("from grid point 20 on: solved by "), "{notice}");
    assert!(notice.ends_with("since a made-up device failed: device lost"), "{notice}");
    assert_eq!(&report.warnings, &dataset.provenance.notices);
    let mut solver = Solver::new(&model);
    for point in 0..POINTS {
        let q = dataset.grid.configuration(point);
        let expected = if point < 20 { answer(&q) } else { solver.solve(&q) };
        assert_eq!(dataset.torque(point), &expected.torque[..], "point {point}");
        assert_eq!(dataset.status(point), expected.status, "point {point}");
    }

    // Two chunks are with the CPU while the one before them is kept.
    let stopped = bake(&sweep(), &mut lossy(), &folder.output(), false, 10, 40).unwrap_err();
    assert!(stopped.to_string().starts_with("stopped after 60 of"), "{stopped}");
    bake(&sweep(), &mut MadeUp::default(), &folder.output(), true, 10, usize::MAX).unwrap();
    let resumed = Dataset::open(&folder.output()).unwrap().provenance.notices;
    assert_eq!(&resumed[..], [part.as_str(), notice.as_str(), "from grid point 60 on: resumed on cpu (none)"]);
}

#[test]
fn a_folder_that_cannot_be_written_is_named_at_once() {
    let folder = Folder::new();
    let mut backend = MadeUp::default();
    let missing = folder.0.path().join("none").join("a.haptize");
    let error = bake(&sweep(), &mut backend, &missing, false, 10, usize::MAX).unwrap_err();
    assert!(error.to_string().contains("make the folder"), "{error}");
    let error = bake(&sweep(), &mut backend, folder.0.path(), false, 10, usize::MAX).unwrap_err();
    assert!(error.to_string().contains("is a folder"), "{error}");
    assert_eq!((backend.solved, folder.names()), (0, Vec::new()));
}

/// What a device leaves to the CPU is told of each sweep by itself.
#[test]
fn what_is_left_to_the_cpu_is_told() {
    let folder = Folder::new();
    let mut backend = MadeUp::default();
    for sweeps in 1..=2 {
        let report = bake(&sweep(), &mut backend, &folder.output(), false, 10, usize::MAX).unwrap();
        assert_eq!((report.left_to_cpu, sweeps * report.left_to_cpu), (POINTS / 2, backend.left_to_cpu));
    }
}

/// A folder takes the output's name while the last points are solved: the finished file cannot take it.
#[test]
fn a_dataset_that_cannot_be_put_in_place_stays_in_its_part() {
    let whole = uninterrupted();
    let folder = Folder::new();
    let mut progress = |progress: haptize::sweep::Progress| {
        if progress.done == POINTS {
            std::fs::create_dir(folder.output()).unwrap();
        }
    };
    let run = Run { chunk: 10, stop: &AtomicBool::new(false), progress: &mut progress };
    let error = sweep().bake(&mut MadeUp::default(), &folder.output(), false, run).unwrap_err();
    assert!(error.to_string().contains("all points are kept") && error.to_string().contains("--resume"), "{error}");
    assert_eq!(folder.names(), ["a.haptize", "a.haptize.part"], "no other file is left");
    std::fs::remove_dir(folder.output()).unwrap();
    let mut idle = MadeUp::default();
    let report = bake(&sweep(), &mut idle, &folder.output(), true, 10, usize::MAX).unwrap();
    assert_eq!((report.resumed_points, idle.solved), (POINTS, 0));
    assert!(std::fs::read(folder.output()).unwrap() == whole);
}
