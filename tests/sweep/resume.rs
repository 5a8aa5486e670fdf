//! Sweeps that are stopped and resumed.

use crate::fixture::{Folder, MadeUp, POINTS, SCENE, bake, scene, stopped_after, sweep, sweep_of, uninterrupted};
use haptize::{
    object::Object,
    scene::Scene,
    sweep::{Run, Sweep},
};
use std::sync::atomic::AtomicBool;

#[test]
fn a_stopped_sweep_continues_to_the_same_file() {
    let whole = uninterrupted();
    for done in [0, 1, 30, POINTS - 1] {
        let folder = stopped_after(done);
        let mut backend = MadeUp::default();
        // Another date, as on another day, and another chunk.
        let later = sweep_of(&scene(), "none", "2013-01-01T00:00:00Z");
        let report = bake(&later, &mut backend, &folder.output(), true, 5, usize::MAX).unwrap();
        assert_eq!((report.resumed_points, backend.solved), (done, POINTS - done));
        assert!(std::fs::read(folder.output()).unwrap() == whole, "stopped after {done}");
        assert_eq!(folder.names(), ["a.haptize"]);
    }
}

#[test]
fn a_sweep_stopped_while_its_file_is_put_together_continues_to_the_same_file() {
    let whole = uninterrupted();
    let folder = stopped_after(POINTS);
    let mut idle = MadeUp::default();
    let report = bake(&sweep(), &mut idle, &folder.output(), true, 5, usize::MAX).unwrap();
    assert_eq!((report.resumed_points, idle.solved), (POINTS, 0));
    assert!(std::fs::read(folder.output()).unwrap() == whole);
}

#[test]
fn a_part_cut_or_altered_anywhere_costs_work_but_never_a_wrong_number() {
    let whole = uninterrupted();
    let folder = stopped_after(6);
    let part = std::fs::read(folder.part()).unwrap();
    let resumed = |bytes: &[u8]| {
        std::fs::write(folder.part(), bytes).unwrap();
        bake(&sweep(), &mut MadeUp::default(), &folder.output(), true, POINTS, usize::MAX)
    };
    let mut resumed_points = std::collections::BTreeSet::new();
    for length in (0..part.len()).step_by(3) {
        resumed_points.insert(resumed(&part[..length]).unwrap().resumed_points);
        assert!(std::fs::read(folder.output()).unwrap() == whole, "cut to {length} bytes");
    }
    assert_eq!(resumed_points, (0..6).collect(), "cutting loses one point after the other");
    for at in (0..part.len()).step_by(3) {
        let mut altered = part.clone();
        altered[at] ^= 1 << (at % 8);
        match resumed(&altered) {
            Ok(_) => assert!(std::fs::read(folder.output()).unwrap() == whole, "byte {at} altered"),
            Err(error) => assert!(error.to_string().contains("cannot be continued"), "byte {at}: {error}"),
        }
    }
    assert_eq!(resumed(&part).unwrap().resumed_points, 6);
    // Rubbish behind the last whole frame, with a length that no memory holds.
    let hostile = [&part[..], &(u64::MAX - 3).to_le_bytes(), &[0; 40]].concat();
    assert_eq!(resumed(&hostile).unwrap().resumed_points, 6);
    assert!(std::fs::read(folder.output()).unwrap() == whole);
}

#[test]
fn a_part_of_another_sweep_is_refused_with_the_difference() {
    let folder = stopped_after(3);
    let refused = |sweep: &Sweep| {
        let error = bake(sweep, &mut MadeUp::default(), &folder.output(), true, 10, usize::MAX).unwrap_err();
        assert!(error.to_string().contains("a.haptize.part"), "{error}");
        let text = error.to_string();
        text.split_once("it was begun with ").unwrap().1.split_once(';').unwrap().0.to_owned()
    };
    let date = "2012-03-04T00:00:00Z";
    let changed = |from: &str, to: &str| Scene::parse(&SCENE.replace(from, to), "small.toml").unwrap();
    assert_eq!(refused(&sweep_of(&scene(), "other", date)), "another adapter");
    assert_eq!(
        refused(&sweep_of(&changed("stiffness = 300.0", "stiffness = 300.1"), "none", date)),
        "another text of the scene"
    );
    assert_eq!(refused(&sweep_of(&changed("count = 7", "count = 6"), "none", date)), "another grid");
    // The same scene, but what it names is not what it was: an inner node of a mesh moved, say.
    let other = Object::build(&changed("stiffness = 300.0", "stiffness = 300.1").object).unwrap();
    let elsewhere = Sweep::new(&scene(), &other, "cpu", "none", date).unwrap();
    assert_eq!(refused(&elsewhere), "another object, such as a mesh that has changed since");
    let mut following = scene();
    following.contact.law = haptize::scene::ContactLaw::Following;
    assert_eq!(refused(&sweep_of(&following, "none", date)), "another algorithm");
    // A refusal changes nothing.
    assert_eq!(
        bake(&sweep(), &mut MadeUp::default(), &folder.output(), true, 9, usize::MAX).unwrap().resumed_points,
        3
    );
}

#[test]
fn what_an_unfinished_bake_has_solved_is_not_thrown_away() {
    let folder = stopped_after(3);
    let kept = std::fs::read(folder.part()).unwrap();
    let error = bake(&sweep(), &mut MadeUp::default(), &folder.output(), false, 9, usize::MAX).unwrap_err();
    assert!(error.to_string().contains("--resume") && error.to_string().contains("delete it"), "{error}");
    assert!(std::fs::read(folder.part()).unwrap() == kept);
    // Nor is a file that is none of ours; one that holds nothing yet is.
    std::fs::write(folder.part(), "my notes").unwrap();
    let error = bake(&sweep(), &mut MadeUp::default(), &folder.output(), false, 9, usize::MAX).unwrap_err();
    assert!(error.to_string().contains("cannot be continued"), "{error}");
    assert_eq!(std::fs::read(folder.part()).unwrap(), b"my notes");
    let binding = kept.len() - frames(&kept)[1..].iter().sum::<usize>();
    for length in [0, 7, 40, binding] {
        std::fs::write(folder.part(), &kept[..length]).unwrap();
        bake(&sweep(), &mut MadeUp::default(), &folder.output(), false, 9, usize::MAX).unwrap();
        assert_eq!(folder.names(), ["a.haptize"], "{length} bytes");
    }
}

/// Lengths of the frames of a part (bytes).
fn frames(part: &[u8]) -> Vec<usize> {
    let mut left = &part[part.iter().position(|&byte| byte == b'\n').unwrap() + 1..];
    let mut lengths = Vec::new();
    while let Some((length, _)) = left.split_first_chunk() {
        lengths.push(12 + u64::from_le_bytes(*length) as usize);
        left = &left[lengths[lengths.len() - 1]..];
    }
    lengths
}

#[cfg(unix)]
#[test]
fn two_bakes_into_one_file_do_not_mix() {
    let folder = Folder::new();
    let mut tried = false;
    let stop = AtomicBool::new(false);
    let sweep = sweep();
    let mut progress = |_| {
        if !std::mem::replace(&mut tried, true) {
            let second = bake(&sweep, &mut MadeUp::default(), &folder.output(), true, 10, usize::MAX);
            assert!(second.unwrap_err().to_string().contains("another process is writing"));
        }
    };
    sweep
        .bake(&mut MadeUp::default(), &folder.output(), false, Run { chunk: 10, stop: &stop, progress: &mut progress })
        .unwrap();
    assert!(tried);
}
