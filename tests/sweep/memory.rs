//! Memory is stated beforehand, and does not grow with the grid where results go to a file.

use crate::fixture::{Folder, MadeUp, POINTS, SCENE, bake, peak, scene, sweep, sweep_of};
use haptize::{scene::Scene, sweep::Run};
use std::sync::atomic::AtomicBool;

/// [`scene`] with other numbers of grid lines.
fn scene_of(counts: [usize; 2]) -> Scene {
    let mut scene = scene();
    for (axis, count) in scene.grid.axes.iter_mut().zip(counts) {
        (axis.step, axis.count) = (axis.step * axis.count as f64 / count as f64, count);
    }
    scene
}

#[test]
fn a_file_takes_the_memory_stated_whatever_the_grid() {
    let chunk = 500;
    let peak_of = |counts: [usize; 2]| {
        let folder = Folder::new();
        let sweep = sweep_of(&scene_of(counts), "none", "");
        let (report, peak) =
            peak(|| bake(&sweep, &mut MadeUp::default(), &folder.output(), false, chunk, usize::MAX).unwrap());
        let bytes = std::fs::metadata(folder.output()).unwrap().len() as usize;
        assert!(peak <= report.footprint.memory.most, "{peak} bytes, {:?}", report.footprint);
        // The header is a page, the surface some hundred bytes.
        let disk = report.footprint.disk;
        assert!((disk.least..disk.most + 8192).contains(&bytes), "{bytes} bytes, {disk:?}");
        assert_eq!(disk.least, report.points * (2 * 8 + 29));
        (peak, chunk * disk.most / report.points)
    };
    // Both have chunks of full size.
    let ((small, columns), (large, _)) = (peak_of([100, 200]), peak_of([400, 250]));
    // Two chunks are being kept or not, as threads are scheduled.
    assert!(large < small + 2 * columns + 4096, "{small} bytes for 20,000 points, {large} for 100,000");

    let in_memory = |counts: [usize; 2]| {
        let sweep = sweep_of(&scene_of(counts), "none", "");
        let run = Run { chunk, stop: &AtomicBool::new(false), progress: &mut |_| () };
        peak(|| sweep.run(&mut MadeUp::default(), run).unwrap()).1
    };
    // As they were solved, and once more as columns, beside chunks of the same size.
    let columns = 2 * (400 * 250 - 40 * 50) * (2 * 8 + 29);
    assert!(in_memory([400, 250]) > in_memory([40, 50]) + columns / 2, "the count sees columns that grow");
}

#[test]
fn the_memory_stated_is_the_memory_of_the_columns() {
    let mut stated = None;
    let mut progress = |progress: haptize::sweep::Progress| stated = Some(progress.footprint);
    let run = Run { chunk: 10, stop: &AtomicBool::new(false), progress: &mut progress };
    let sweep = sweep();
    let (dataset, report) = sweep.run(&mut MadeUp::default(), run).unwrap();
    assert_eq!((stated, report.footprint), (Some(sweep.footprint(10, true)), sweep.footprint(10, true)));
    // The same on disk and in memory, chunks aside.
    let columns = sweep.footprint(10, false).disk;
    let surface = dataset.surface.as_ref().unwrap();
    let fixed = size_of_val(&*surface.nodes) + size_of_val(&*surface.triangles) + 8;
    let summary = dataset.summary();
    assert_eq!(columns.least + 16 * summary.contacts.unwrap() + fixed, summary.bytes);
    assert_eq!(columns.most - columns.least, POINTS * 16 * 9);
    // Without graphics there are no forces to keep.
    let blind = Scene::parse(&SCENE.replace("graphics = {}", "graphics = false"), "small.toml").unwrap();
    let disk = sweep_of(&blind, "none", "").footprint(10, false).disk;
    assert_eq!(disk.least, disk.most);
    // With friction each point has a normal force and three entries of a slip Jacobian.
    let friction = Scene::parse(&(blind.text + "\n[haptics.friction]\ncoefficient = 0.4\n"), "small.toml").unwrap();
    let friction = sweep_of(&friction, "none", "").footprint(10, false).disk;
    assert_eq!([friction.least - disk.least, friction.most - disk.most], [4 * 4 * POINTS; 2]);
}

#[test]
fn a_grid_that_no_memory_holds_is_refused_at_once() {
    let mut scene = scene();
    scene.grid.axes[0].count = 1 << 30;
    scene.grid.axes[0].step = 1e-9;
    scene.grid.axes[1].count = 1 << 20;
    scene.grid.axes[1].step = 1e-9;
    let run = Run { chunk: 10, stop: &AtomicBool::new(false), progress: &mut |_| () };
    let error = sweep_of(&scene, "none", "").run(&mut MadeUp::default(), run).map(drop).unwrap_err();
    assert!(error.to_string().contains("haptize into a file"), "{error}");
    assert!(error.to_string().contains("MB of memory") && error.to_string().contains("into a file"), "{error}");
}
