//! Exact places and awkward arrangements: nodes on faces, edges and vertices to the last bit, on each other, in the middle of
//! the object, right through it, in hollows, and on two sides at once.

use super::super::{Bound, Failure, Outcome, Setting};
use super::world::{BALL, PAPER, RADIUS, contact, floating_bar, joint, pressed, probe, sphere, torus};
use crate::{
    contact::{Equilibrium, Model, Solver, Status},
    object::Object,
    proxy::Chain,
    scene::{JointKind, ProxyNodeSpec, ProxySpec},
};
use glam::DVec3;

/// Contact stiffnesses at which the arrangements are tried [N/m].
const STIFFNESSES: [f64; 3] = [1e2, 1e4, f64::INFINITY];

fn outcome(case: &str, varied: &str, measure: &str, worst: f64, bound: Bound, note: String) -> Outcome {
    Outcome { case: case.into(), varied: varied.into(), measure: measure.into(), worst, bound, note }
}

/// A point on a triangle, edge or vertex of the object, and a direction out of the surface there.
fn places(object: &Object) -> Vec<(&'static str, DVec3, DVec3)> {
    let normal = |t: usize| {
        let [a, b, c] = object.triangles[t].map(|node| object.rest[node as usize]);
        (b - a).cross(c - a).normalize()
    };
    let mut places = Vec::new();
    for t in (0..object.triangles.len()).step_by(7) {
        let [a, b, c] = object.triangles[t].map(|node| object.rest[node as usize]);
        places.push(("face", (a + b + c) / 3.0, normal(t)));
        let across = normal(t) + normal(object.topology.across[t][0] as usize);
        places.push(("edge", a.midpoint(b), across.normalize()));
        // Outward from the middle is outward at each vertex of a sphere.
        places.push(("vertex", a, a.normalize()));
    }
    places
}

/// A node on a face, an edge, a vertex, and 1 nm off it to either side: contact just where the gap is below zero, and forces that
/// vanish with the depth.
pub fn exact_places(_: &Setting) -> Result<Vec<Outcome>, Failure> {
    let object = sphere(PAPER)?;
    let mut gap_error = 0.0f64;
    let mut wrong = 0;
    let mut force = 0.0f64;
    let mut tried = 0;
    for (kind, point, outward) in places(&object) {
        let chain = probe(point, outward, 0.0);
        let mut model = Model::new(&object, &chain, contact(1.0));
        for stiffness in STIFFNESSES {
            model.set_stiffness(stiffness);
            let mut solver = Solver::new(&model);
            for offset in [0.0, 1e-9, -1e-9] {
                let result = solver.solve(&[offset]);
                tried += 1;
                // Inside an edge or a vertex the faces are nearer than 1 nm.
                let exact = kind == "face" || offset >= 0.0;
                let error =
                    if exact { (result.gap - offset).abs() } else { (result.gap - offset / 2.0).abs() - 0.5e-9 };
                gap_error = gap_error.max(error);
                wrong += usize::from((result.status == Status::Free) != (result.gap >= 0.0));
                // No contact can push harder than the object resists at all.
                force = force.max(result.torque[0].abs());
            }
        }
    }
    let varied = "node on faces, edges, vertices, +-1 nm; Kc 1e2, 1e4, rigid";
    let note = format!("{tried} solved");
    Ok(vec![
        outcome("exact places", varied, "error of the gap [m]", gap_error, Bound::AtMost(1e-15), note),
        outcome(
            "exact places",
            varied,
            "contact where the gap is not below 0, or not",
            wrong as f64,
            Bound::AtMost(0.0),
            String::new(),
        ),
        outcome("exact places", varied, "force at 1 nm [N]", force, Bound::AtMost(1e-5), String::new()),
    ])
}

/// A chain of one slide with `nodes`.
fn slide(axis: DVec3, nodes: Vec<ProxyNodeSpec>) -> Chain {
    Chain::new(&ProxySpec { joints: vec![joint(JointKind::Prismatic, DVec3::ZERO, axis, nodes)] })
}

/// Two nodes in one place are one spring of twice the stiffness.
pub fn coincident_nodes(_: &Setting) -> Result<Vec<Outcome>, Failure> {
    let object = sphere(PAPER)?;
    let mut worst = 0.0f64;
    let mut unconverged = 0;
    for radius in [0.0, BALL] {
        for (_, point, outward) in places(&object).into_iter().step_by(4) {
            let node = ProxyNodeSpec { position: point + outward * (radius - 0.004), radius };
            let [one, two] = [1, 2].map(|count| slide(outward, vec![node; count]));
            let [mut one, mut two] = [&one, &two].map(|chain| Model::new(&object, chain, contact(1.0)));
            for stiffness in [1e2, 1e4] {
                one.set_stiffness(2.0 * stiffness);
                two.set_stiffness(stiffness);
                let mut solved = Vec::new();
                for model in [&one, &two] {
                    let result = Solver::new(model).solve(&[0.0]);
                    unconverged += usize::from(result.status != Status::Contact);
                    solved.push(result.torque[0]);
                }
                worst = worst.max((solved[0] - solved[1]).abs() / solved[0].abs().max(1e-9));
            }
        }
    }
    let varied = "two nodes in one place; points and balls; Kc 1e2, 1e4";
    let note = format!("{unconverged} unconverged");
    Ok(vec![outcome(
        "coincident nodes",
        varied,
        "force against one of twice Kc, relative [1]",
        worst,
        Bound::AtMost(1e-5),
        note,
    )])
}

/// Number of results that are neither balanced to 1e-6 nor flagged, and of those flagged.
fn tally(results: impl Iterator<Item = Equilibrium>) -> (usize, usize, usize) {
    let (mut wrong, mut flagged, mut all) = (0, 0, 0);
    for result in results {
        all += 1;
        let finite = result.torque.is_finite() && result.energy.is_finite() && result.gap.is_finite();
        let honest = match result.status {
            Status::Free => result.gap >= 0.0 && result.energy == 0.0,
            Status::Contact => result.gap < 0.0 && result.residual <= 1e-6,
            Status::Unconverged => true,
            Status::Overflow | Status::Outside | Status::Filled => false,
        };
        flagged += usize::from(result.status == Status::Unconverged);
        wrong += usize::from(!(finite && honest));
    }
    (wrong, flagged, all)
}

/// A node from one side of the sphere to the other, through its very centre, through vertices, and past them.
pub fn right_through(_: &Setting) -> Result<Vec<Outcome>, Failure> {
    let object = sphere(PAPER)?;
    let (mut wrong, mut flagged, mut all) = (0, 0, 0);
    for radius in [0.0, BALL] {
        for axis in [DVec3::Z, DVec3::X, DVec3::new(0.3, -0.5, 0.8)] {
            let chain = probe(axis.normalize() * 0.08, -axis.normalize(), radius);
            let mut model = Model::new(&object, &chain, contact(1.0));
            for stiffness in STIFFNESSES {
                model.set_stiffness(stiffness);
                let mut solver = Solver::new(&model);
                // The 40th of 80 steps is the centre.
                let found = tally((0..=80).map(|k| solver.solve(&[0.002 * f64::from(k)])));
                (wrong, flagged, all) = (wrong + found.0, flagged + found.1, all + found.2);
            }
        }
    }
    let varied = "node through the centre; points and balls; Kc 1e2, 1e4, rigid";
    let note = format!("{flagged} of {all} flagged as unconverged");
    Ok(vec![outcome("right through", varied, "neither balanced nor flagged", wrong as f64, Bound::AtMost(0.0), note)])
}

/// The bar in the hole and the groove of a torus.
pub fn concave(setting: &Setting) -> Result<Vec<Outcome>, Failure> {
    let object = torus(DVec3::ZERO)?;
    let count = if setting.effort == super::super::Effort::Full { 200 } else { 30 };
    let mut outcomes = Vec::new();
    for (name, radius) in [("points", 0.0), ("balls", 0.004)] {
        let chain = floating_bar(radius);
        let mut model = Model::new(&object, &chain, contact(1.0));
        // A fifth of the tube's radius.
        let configurations = pressed(&model, 3, count, 0.0, 0.2 * 0.016);
        for stiffness in [1e2, 1e4, 1e6] {
            model.set_stiffness(stiffness);
            let mut solver = Solver::new(&model);
            let (wrong, flagged, all) = tally(configurations.iter().map(|q| solver.solve(q)));
            outcomes.push(outcome(
                "concave object",
                &format!("bar on a torus, {name}, Kc {stiffness:.0e}"),
                "share converged [1]",
                (all - flagged - wrong) as f64 / all as f64,
                Bound::AtLeast(0.99),
                format!("{flagged} of {all} flagged"),
            ));
        }
    }
    Ok(outcomes)
}

/// Two nodes on opposite poles of the sphere push it equally: the forces on the slide cancel.
pub fn two_regions(_: &Setting) -> Result<Vec<Outcome>, Failure> {
    let object = sphere(PAPER)?;
    let mut worst = 0.0f64;
    let mut unconverged = 0;
    for radius in [0.0, BALL] {
        let nodes =
            [1.0, -1.0].map(|side| ProxyNodeSpec { position: DVec3::Z * (side * (0.9 * RADIUS + radius)), radius });
        let chain = slide(DVec3::Z, nodes.to_vec());
        let mut model = Model::new(&object, &chain, contact(1.0));
        for stiffness in STIFFNESSES {
            model.set_stiffness(stiffness);
            let result = Solver::new(&model).solve(&[0.0]);
            unconverged += usize::from(result.status != Status::Contact);
            let size: f64 = result.touches.iter().map(|touch| touch.force.length()).sum();
            worst = worst.max(result.torque[0].abs() / size.max(1e-12));
        }
    }
    let varied = "nodes on both poles; points and balls; Kc 1e2, 1e4, rigid";
    let note = format!("{unconverged} unconverged");
    Ok(vec![outcome("two regions", varied, "net force over the sum of forces [1]", worst, Bound::AtMost(1e-6), note)])
}
