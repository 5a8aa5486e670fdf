//! A grid before a thick body with edges, on which a deep node's nearest side changes at once.

use crate::fixture::Folder;
use haptize::{
    scene::Scene,
    sweep::{BackendChoice, Bake},
};
use std::{f64::consts::TAU, fmt::Write, sync::atomic::AtomicBool};

/// A ring around z, of 25 x 30 mm in section and 37.5 mm in mean radius, in triangles of some 4 mm (OBJ).
fn ring() -> String {
    const AROUND: usize = 56;
    const PARTS: [usize; 2] = [6, 7];
    let side = |i: usize, parts: usize| i as f64 / parts as f64 - 0.5;
    let mut section = Vec::new();
    section.extend((0..PARTS[0]).map(|i| [side(i, PARTS[0]), -0.5]));
    section.extend((0..PARTS[1]).map(|i| [0.5, side(i, PARTS[1])]));
    section.extend((0..PARTS[0]).map(|i| [-side(i, PARTS[0]), 0.5]));
    section.extend((0..PARTS[1]).map(|i| [-0.5, -side(i, PARTS[1])]));
    let (mut text, count) = (String::new(), section.len());
    for (i, [r, z]) in (0..AROUND).flat_map(|i| section.iter().map(move |at| (i, at))) {
        let ((sine, cosine), radius) = ((TAU * i as f64 / AROUND as f64).sin_cos(), 0.0375 + 0.025 * r);
        writeln!(text, "v {:.7} {:.7} {:.7}", radius * cosine, radius * sine, 0.03 * z).unwrap();
    }
    for (i, j) in (0..AROUND).flat_map(|i| (0..count).map(move |j| (i, j))) {
        let node = |i: usize, j: usize| i % AROUND * count + j % count + 1;
        let corners = [node(i, j), node(i + 1, j), node(i + 1, j + 1), node(i, j + 1)];
        // Diagonals of both directions by turns.
        let turn = usize::from((i + j) % 2 == 0);
        let [a, b, c, d] = [0, 1, 2, 3].map(|corner| corners[(corner + turn) % 4]);
        writeln!(text, "f {a} {b} {c}\nf {a} {c} {d}").unwrap();
    }
    text
}

/// Half of the sphere scene's grid, the other half being its mirror image: `potential` errs little where edges are
/// rounded, and by most of the torque where they are not.
#[test]
fn rounding_lets_a_grid_follow_a_body_with_edges() {
    let folder = Folder::new();
    let path = folder.0.path().join("ring.toml");
    std::fs::write(folder.0.path().join("ring.obj"), ring()).unwrap();
    let sphere = include_str!("../../datasets/sphere.toml");
    let (before, rest) = sphere.split_once("[object.sphere]").unwrap();
    let (_, after) = rest.split_once("[object.skin]").unwrap();
    let scene =
        format!("{before}[object.mesh]\nfile = \"ring.obj\"\ncentre = [0.0, 0.0, 0.035]\n\n[object.skin]{after}")
            .replace("start = -0.916297857297023, count = 36", "start = 0.0, count = 18");
    let error = |law: &str| {
        let scene = Scene::parse(&scene.replace("law = \"following\"", law), path.to_str().unwrap()).unwrap();
        let (backend, stop) = (BackendChoice::Cpu, AtomicBool::new(false));
        let measured = Some(300);
        let bake = Bake { scene: &scene, backend, measured, aim: None, date: "", stop: &stop, progress: &mut |_| () };
        let (dataset, _) = bake.in_memory().unwrap();
        assert_eq!(dataset.status_counts().unconverged, 0);
        dataset.provenance.error.unwrap().relative().unwrap()
    };
    let [sharp, rounded] = ["law = \"rest\"", "law = \"rest\"\nround = 0.006"].map(error);
    println!("rms error over rms torque: sharp {sharp:.3}, rounded {rounded:.3}");
    assert!(sharp > 0.3 && rounded < 0.06, "sharp {sharp}, rounded {rounded}");
}
