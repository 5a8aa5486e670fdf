//! Broken surfaces: repaired with a warning that says what was done, and then of the same torque as the sound one; or
//! refused with the reason. Slivers are sound, and their torque is that of the stored energy.

use super::processor::Processor;
use crate::hard_cases::{Bound, CaseResult, Failure, Setting};
use glam::DVec3;
use haptize::fixtures::bodies::{PAPER, RADIUS, contact, joint, probe, sphere, sphere_spec};
use haptize::{
    JointVector,
    contact::{Model, Solver, Status},
    object::Object,
    proxy::Chain,
    scene::{JointKind, ObjectSpec, Placement, ProxyNodeSpec, ProxySpec, Shape},
};
use std::{fmt::Write, path::Path};

/// A surface in the making.
type Surface = (Vec<DVec3>, Vec<[u32; 3]>);

/// The outcome for a surface.
enum Fate {
    /// Repaired, with these words in a warning.
    Repaired(&'static str),
    /// Refused for a defect with one of these words.
    Refused(&'static [&'static str]),
}

/// A defect: its name, how it is made, what becomes of it.
type Broken = (&'static str, fn(&mut Surface), Fate);

const BROKEN: &[Broken] = &[
    ("duplicate vertices", separate_corners, Fate::Repaired("merged")),
    ("a zero-area face on two nodes", collapse, Fate::Repaired("left out")),
    ("inverted faces", invert_some, Fate::Repaired("turned")),
    ("inside out", invert_all, Fate::Repaired("turned")),
    ("a zero-area face on three nodes", flatten, Fate::Refused(&["has no area"])),
    ("open", open, Fate::Refused(&["is open"])),
    ("not manifold", fin, Fate::Refused(&["triangles, not 2"])),
    ("a face twice", twice, Fate::Refused(&["have the same three nodes", "triangles, not 2"])),
    ("parts that meet in a vertex", pinch, Fate::Refused(&["separate sheets meet"])),
];

fn separate_corners((nodes, triangles): &mut Surface) {
    let corners: Vec<DVec3> = triangles.as_flattened().iter().map(|&node| nodes[node as usize]).collect();
    *nodes = corners;
    *triangles = (0..triangles.len() as u32).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect();
}

/// An edge becomes two that share their ends, with nothing between.
fn collapse((nodes, triangles): &mut Surface) {
    let [a, b, _] = triangles[5];
    nodes.push(nodes[a as usize]);
    triangles.extend([[a, b, nodes.len() as u32 - 1], [b, a, nodes.len() as u32 - 1]]);
}

fn invert_some((_, triangles): &mut Surface) {
    triangles.iter_mut().step_by(3).for_each(|triangle| triangle.swap(0, 1));
}

fn invert_all((_, triangles): &mut Surface) {
    triangles.iter_mut().for_each(|triangle| triangle.swap(0, 1));
}

fn flatten((nodes, triangles): &mut Surface) {
    let [a, b, c] = triangles[5];
    nodes.push(nodes[a as usize].midpoint(nodes[b as usize]));
    let middle = nodes.len() as u32 - 1;
    triangles[5] = [a, middle, c];
    triangles.extend([[middle, b, c], [a, b, middle]]);
}

fn open((_, triangles): &mut Surface) {
    triangles.remove(7);
}

fn fin((nodes, triangles): &mut Surface) {
    let [a, b, _] = triangles[5];
    nodes.push(nodes[a as usize] * 2.0);
    triangles.push([a, b, nodes.len() as u32 - 1]);
}

fn twice((_, triangles): &mut Surface) {
    triangles.push(triangles[5]);
}

fn pinch((nodes, triangles): &mut Surface) {
    let count = nodes.len() as u32;
    nodes.extend([DVec3::new(0.2, 0.0, 0.0), DVec3::new(0.2, 0.05, 0.0), DVec3::new(0.2, 0.0, 0.05)]);
    let tip = triangles[5][0];
    let [a, b, c] = [count, count + 1, count + 2];
    triangles.extend([[a, b, c], [a, tip, b], [b, tip, c], [c, tip, a]]);
}

/// The surface through an OBJ file, as a scene's mesh comes.
fn build(folder: &Path, (nodes, triangles): &Surface) -> Result<Object, Failure> {
    let mut text = String::new();
    for node in nodes {
        writeln!(text, "v {} {} {}", node.x, node.y, node.z)?;
    }
    for [a, b, c] in triangles {
        writeln!(text, "f {} {} {}", a + 1, b + 1, c + 1)?;
    }
    let file = folder.join("surface.obj");
    std::fs::write(&file, text)?;
    let shape = Shape::Mesh { file, placement: Placement::METRES, refine: None };
    Ok(Object::build(&ObjectSpec { shape, ..sphere_spec(PAPER, DVec3::ZERO, 1.0, 1.0) })?)
}

/// Torques of a node pressed in at some places.
fn torques(object: &Object) -> Vec<f64> {
    let mut torques = Vec::new();
    for direction in [DVec3::new(0.3, 0.5, 0.8), DVec3::new(-0.6, 0.1, -0.4), DVec3::new(0.1, -0.9, 0.2)] {
        let direction = direction.normalize();
        let chain = probe(direction * RADIUS, -direction, 0.0);
        let model = Model::new(object, &chain, contact(1e3));
        torques.push(Solver::new(&model).solve(&[0.008]).torque[0]);
    }
    torques
}

/// All of them.
pub fn run(_: &Setting) -> Result<Vec<CaseResult>, Failure> {
    let folder = tempfile::tempdir()?;
    let sound = sphere(PAPER)?;
    let surface = (sound.rest.clone(), sound.triangles.clone());
    let expected = torques(&build(folder.path(), &surface)?);
    let mut outcomes = Vec::new();
    for (name, damage, fate) in BROKEN {
        let mut broken = surface.clone();
        damage(&mut broken);
        let built = build(folder.path(), &broken);
        let (worst, note) = match (fate, built) {
            (Fate::Repaired(words), Ok(object)) => {
                let said = object.warnings.join("; ");
                let found = torques(&object);
                let off = expected.iter().zip(&found).map(|(a, b)| (a - b).abs() / a.abs()).fold(0.0, f64::max);
                (if said.contains(words) { off } else { f64::INFINITY }, said)
            }
            (Fate::Refused(words), Err(error)) => {
                let said = error.to_string();
                (if words.iter().any(|words| said.contains(words)) { 0.0 } else { f64::INFINITY }, said)
            }
            (Fate::Repaired(_), Err(error)) => (f64::INFINITY, error.to_string()),
            (Fate::Refused(_), Ok(_)) => (f64::INFINITY, "accepted".into()),
        };
        let said = note.replace(&folder.path().display().to_string(), "");
        outcomes.push(CaseResult {
            case: "broken meshes".into(),
            varied: (*name).into(),
            measure: "torque against the sound surface's, relative; refused: 0 [1]".into(),
            worst,
            bound: Bound::AtMost(1e-6),
            note: said,
        });
    }
    // Differences of energies in f32 are rounding.
    outcomes.push(slivers(Processor::cpu())?);
    Ok(outcomes)
}

/// A box with strips of aspect 1e4 along its edges.
fn slivers(mut processor: Processor<'_>) -> Result<CaseResult, Failure> {
    let (size, strip) = (0.1, 1e-5);
    let lines = [0.0, strip, 0.5 * size, size - strip, size];
    let count = lines.len();
    let mut nodes = Vec::new();
    let mut triangles = Vec::new();
    let mut numbers = std::collections::HashMap::new();
    for axis in 0..3 {
        for side in [0, count - 1] {
            let mut corner = |i: usize, j: usize| {
                let mut place = [0; 3];
                (place[axis], place[(axis + 1) % 3], place[(axis + 2) % 3]) = (side, i, j);
                *numbers.entry(place).or_insert_with(|| {
                    nodes.push(DVec3::from_array(place.map(|k| lines[k] - 0.5 * size)));
                    nodes.len() as u32 - 1
                })
            };
            for i in 0..count - 1 {
                for j in 0..count - 1 {
                    let [a, b, c, d] = [corner(i, j), corner(i + 1, j), corner(i + 1, j + 1), corner(i, j + 1)];
                    let facing = if side == 0 { [[a, c, b], [a, d, c]] } else { [[a, b, c], [a, c, d]] };
                    triangles.extend(facing);
                }
            }
        }
    }
    let object = haptize::fixtures::bodies::object(nodes, triangles)?;
    let mut worst = 0.0f64;
    let mut unconverged = 0;
    let mut tried = 0;
    for radius in [0.0, 0.004] {
        let nodes = vec![ProxyNodeSpec { position: DVec3::new(0.0, 0.013, 0.0), radius, length: 0.0 }];
        let chain = Chain::new(&ProxySpec {
            joints: vec![
                joint(JointKind::Prismatic, DVec3::Z * (0.5 * size + radius), -DVec3::Z, vec![]),
                joint(JointKind::Prismatic, DVec3::ZERO, DVec3::X, nodes),
            ],
            ..Default::default()
        });
        let model = Model::new(&object, &chain, contact(1e3));
        let h = 1e-7;
        // Across the face and over the strip at its edge.
        let places = [0.0, 0.02, 0.04, 0.0495, 0.05 - 0.7 * strip];
        let stencil = |place| [0.0, -h, h].map(|step| JointVector::from_slice(&[0.003 + step, place]));
        for results in processor.solve(&model, places.map(stencil).as_flattened())?.chunks_exact(3) {
            tried += 1;
            if results.iter().any(|result| result.status != Status::Contact) {
                unconverged += 1;
                continue;
            }
            let slope = (results[2].energy - results[1].energy) / (2.0 * h);
            worst = worst.max((slope + results[0].torque[0]).abs() / results[0].torque[0].abs());
        }
    }
    if unconverged == tried {
        worst = f64::INFINITY;
    }
    Ok(CaseResult {
        case: "broken meshes".into(),
        varied: processor.name("slivers of aspect 1e4; points and balls"),
        measure: "tau against -dU/dq, relative [1]".into(),
        worst,
        bound: Bound::AtMost(1e-4),
        note: processor.note(format!("{unconverged} of {tried} flagged as unconverged")),
    })
}
