//! A grid before a thick body with edges, on which a deep node's nearest side changes at once.

use crate::{
    common::cubes::{Shell, cubes},
    fixture::Folder,
};
use glam::DVec3;
use haptize::{
    scene::Scene,
    sweep::{BackendChoice, Bake},
};
use std::{f64::consts::TAU, fmt::Write, sync::atomic::AtomicBool};

/// A ring around z, of 25 x 30 mm in section and 37.5 mm in mean radius, in triangles of some 4 mm: nodes (m), triangles.
fn ring() -> Shell {
    const AROUND: usize = 56;
    const PARTS: [usize; 2] = [6, 7];
    let side = |i: usize, parts: usize| i as f64 / parts as f64 - 0.5;
    let mut section = Vec::new();
    section.extend((0..PARTS[0]).map(|i| [side(i, PARTS[0]), -0.5]));
    section.extend((0..PARTS[1]).map(|i| [0.5, side(i, PARTS[1])]));
    section.extend((0..PARTS[0]).map(|i| [-side(i, PARTS[0]), 0.5]));
    section.extend((0..PARTS[1]).map(|i| [-0.5, -side(i, PARTS[1])]));
    let count = section.len();
    let place = |(i, [r, z]): (usize, &[f64; 2])| {
        let ((sine, cosine), radius) = ((TAU * i as f64 / AROUND as f64).sin_cos(), 0.0375 + 0.025 * r);
        DVec3::new(radius * cosine, radius * sine, 0.03 * z)
    };
    let nodes = (0..AROUND).flat_map(|i| section.iter().map(move |at| (i, at))).map(place).collect();
    let squares = (0..AROUND).flat_map(|i| (0..count).map(move |j| (i, j)));
    let triangles = squares.flat_map(|(i, j)| {
        let node = |i: usize, j: usize| (i % AROUND * count + j % count) as u32;
        let mut corners = [node(i, j), node(i + 1, j), node(i + 1, j + 1), node(i, j + 1)];
        // Diagonals of both directions by turns.
        corners.rotate_left((i + j + 1) % 2);
        let [a, b, c, d] = corners;
        [[a, b, c], [a, c, d]]
    });
    (nodes, triangles.collect())
}

/// On half of the sphere scene's grid, the other half being its mirror image, `potential` errs little where edges are
/// rounded, and by most of the torque where they are not: before a box, an L whose step is touched, and a ring, with
/// their tops where the sphere has its own.
#[test]
fn rounding_lets_a_grid_follow_a_body_with_edges() {
    let sphere = include_str!("../../datasets/sphere.toml");
    let (before, rest) = sphere.split_once("[object.sphere]").unwrap();
    let (_, after) = rest.split_once("[object.skin]").unwrap();
    let after = after.replace("start = -0.916297857297023, count = 36", "start = 0.0, count = 18");
    let error = |(nodes, triangles): &Shell, law: &str| {
        let folder = Folder::new();
        let mut mesh = String::new();
        nodes.iter().for_each(|at| writeln!(mesh, "v {:.7} {:.7} {:.7}", at.x, at.y, at.z).unwrap());
        triangles.iter().for_each(|t| writeln!(mesh, "f {} {} {}", t[0] + 1, t[1] + 1, t[2] + 1).unwrap());
        std::fs::write(folder.0.path().join("body.obj"), mesh).unwrap();
        let high = nodes.iter().copied().fold(DVec3::NEG_INFINITY, DVec3::max);
        let low = nodes.iter().copied().fold(DVec3::INFINITY, DVec3::min);
        let middle = low.midpoint(high);
        let scene = format!(
            "{before}[object.mesh]\nfile = \"body.obj\"\ncentre = [{}, {}, {}]\n\n[object.skin]{}",
            -middle.x,
            -middle.y,
            0.05 - high.z,
            after.replace("law = \"following\"", law)
        );
        let scene = Scene::parse(&scene, folder.0.path().join("body.toml").to_str().unwrap()).unwrap();
        let (backend, stop) = (BackendChoice::Cpu, AtomicBool::new(false));
        let measured = Some(300);
        let bake = Bake { scene: &scene, backend, measured, aim: None, date: "", stop: &stop, progress: &mut |_| () };
        let (dataset, _) = bake.in_memory().unwrap();
        assert_eq!(dataset.status_counts().unconverged, 0);
        dataset.provenance.error.unwrap().relative().unwrap()
    };
    let step = |cube: [i32; 3]| cube[0] >= 12 || cube[2] < 8;
    let bodies = [
        ("box", cubes([20, 16, 12], 0.005, |_| true), 0.025),
        ("L", cubes([20, 12, 12], 0.005, step), 0.05),
        ("ring", ring(), 0.06),
    ];
    for (name, body, most) in &bodies {
        let rounded = error(body, "law = \"rest\"\nround = 0.006");
        println!("{name}: rms error over rms torque {rounded:.4}");
        assert!(rounded < *most, "{name}: {rounded}");
    }
    let sharp = error(&bodies[2].1, "law = \"rest\"");
    println!("sharp ring: {sharp:.3}");
    assert!(sharp > 0.3, "{sharp}");
}
