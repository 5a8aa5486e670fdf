//! Exact places and awkward arrangements: nodes on faces, edges and vertices to the last bit, on each other, in the
//! middle of the object, right through it, in hollows, and on two sides at once.

use super::processor::{IN_F32, Processor, processors};
use crate::hard_cases::{Bound, CaseResult, Effort, Failure, Setting};
use glam::DVec3;
use haptize::fixtures::bodies::{
    BALL, PAPER, RADIUS, contact_of, floating_bar, gantry, pressed, skinned, sphere, torus,
};
use haptize::{
    JointVector,
    contact::{Model, Status},
    object::Object,
    scene::ProxyNodeSpec,
};

/// Contact stiffnesses at which the arrangements are tried (N/m).
const STIFFNESSES: [f64; 3] = [1e2, 1e4, f64::INFINITY];

fn outcome(case: &str, varied: &str, measure: &str, worst: f64, bound: Bound, note: String) -> CaseResult {
    CaseResult { case: case.into(), varied: varied.into(), measure: measure.into(), worst, bound, note }
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

/// The joint coordinates of a gantry at `place`.
fn at(place: DVec3) -> JointVector {
    JointVector::from_slice(&place.to_array())
}

/// A node on a face, an edge, a vertex, and 1 nm off it to either side: contact just where the gap is below zero, and
/// forces that vanish with the depth.
pub fn exact_places(setting: &Setting) -> Result<Vec<CaseResult>, Failure> {
    let object = sphere(PAPER)?;
    let chain = gantry(vec![ProxyNodeSpec { position: DVec3::ZERO, radius: 0.0, length: 0.0 }]);
    let mut model = Model::new(&object, &chain, contact_of(&chain, 1.0));
    let mut tried = Vec::new();
    for (kind, point, outward) in places(&object) {
        tried.extend([0.0, 1e-9, -1e-9].map(|offset| (kind, offset, at(point + outward * offset))));
    }
    let configurations: Vec<JointVector> = tried.iter().map(|(_, _, q)| *q).collect();
    let mut outcomes = Vec::new();
    for mut processor in processors(setting) {
        let (mut gap_error, mut wrong, mut force) = (0.0f64, 0, 0.0f64);
        for stiffness in STIFFNESSES {
            model.set_stiffness(stiffness);
            let results = processor.solve(&model, &configurations)?;
            for (result, &(kind, offset, _)) in results.iter().zip(&tried) {
                // Inside an edge or a vertex the faces are nearer than 1 nm.
                let exact = kind == "face" || offset >= 0.0;
                let error =
                    if exact { (result.gap - offset).abs() } else { (result.gap - offset / 2.0).abs() - 0.5e-9 };
                gap_error = gap_error.max(error);
                wrong += usize::from((result.status == Status::Free) != (result.gap >= 0.0));
                // No contact can push harder than the object resists at all.
                force = force.max(result.torque.norm());
            }
        }
        let note = processor.note(format!("{} solved", configurations.len() * STIFFNESSES.len()));
        let varied = processor.name("node on faces, edges, vertices, +-1 nm; Kc 1e2, 1e4, rigid");
        let figure = |measure: &str, worst: f64, bound: f64, note: String| {
            outcome("exact places", &varied, measure, worst, Bound::AtMost(bound), note)
        };
        outcomes.push(figure("error of the gap [m]", gap_error, processor.choose(1e-15, 1e-7), note));
        outcomes.push(figure("contact where the gap is not below 0, or not", wrong as f64, 0.0, String::new()));
        outcomes.push(figure("force at 1 nm [N]", force, 1e-5, String::new()));
    }
    Ok(outcomes)
}

/// Two nodes in one place are one spring of twice the stiffness.
pub fn coincident_nodes(setting: &Setting) -> Result<Vec<CaseResult>, Failure> {
    let (springs, skin) = (sphere(PAPER)?, skinned(4)?);
    let mut outcomes = Vec::new();
    for mut processor in processors(setting) {
        let (mut worst, mut unconverged) = (0.0f64, 0);
        // A ball in a dent without a skin has more than one closest point.
        for (object, radius) in [(&springs, 0.0), (&skin, BALL)] {
            let pressed_in = |(_, point, outward): (&str, DVec3, DVec3)| at(point + outward * (radius - 0.004));
            let configurations: Vec<JointVector> = places(object).into_iter().step_by(4).map(pressed_in).collect();
            let node = ProxyNodeSpec { position: DVec3::ZERO, radius, length: 0.0 };
            let [one, two] = [1, 2].map(|count| gantry(vec![node; count]));
            let [mut one, mut two] = [&one, &two].map(|chain| Model::new(object, chain, contact_of(chain, 1.0)));
            for stiffness in [1e2, 1e4] {
                one.set_stiffness(2.0 * stiffness);
                two.set_stiffness(stiffness);
                let (one, two) = (processor.solve(&one, &configurations)?, processor.solve(&two, &configurations)?);
                unconverged += one.iter().chain(&two).filter(|result| result.status != Status::Contact).count();
                for (one, two) in one.iter().zip(&two) {
                    let square: f64 = one.torque.iter().zip(two.torque.iter()).map(|(a, b)| (a - b).powi(2)).sum();
                    let touching = one.status == Status::Contact && two.status == Status::Contact;
                    worst = worst.max(if touching { square.sqrt() / one.torque.norm() } else { f64::INFINITY });
                }
            }
        }
        let varied = processor.name("two nodes in one place; points and balls; Kc 1e2, 1e4");
        let note = processor.note(format!("{unconverged} unconverged"));
        let measure = "force against one of twice Kc, relative [1]";
        outcomes.push(outcome(
            "coincident nodes",
            &varied,
            measure,
            worst,
            Bound::AtMost(processor.choose(1e-5, IN_F32)),
            note,
        ));
    }
    Ok(outcomes)
}

/// The outcome for some configurations.
#[derive(Default)]
struct Tally {
    /// Neither balanced nor flagged.
    wrong: usize,
    flagged: usize,
    all: usize,
}

impl Tally {
    /// Adds `configurations` of `model`.
    fn add(
        &mut self,
        processor: &mut Processor<'_>,
        model: &Model<'_>,
        configurations: &[JointVector],
    ) -> Result<(), Failure> {
        for result in processor.solve(model, configurations)? {
            let finite = result.torque.is_finite() && result.energy.is_finite() && result.gap.is_finite();
            let honest = match result.status {
                Status::Free => result.gap >= 0.0 && result.energy == 0.0,
                Status::Contact => result.gap < 0.0 && result.residual <= processor.residual(),
                Status::Unconverged => true,
                Status::Overflow | Status::Outside => false,
            };
            self.all += 1;
            self.flagged += usize::from(result.status == Status::Unconverged);
            self.wrong += usize::from(!(finite && honest));
        }
        Ok(())
    }
}

/// A node from one side of the sphere to the other, through its very centre, through vertices, and past them.
pub fn right_through(setting: &Setting) -> Result<Vec<CaseResult>, Failure> {
    let object = sphere(PAPER)?;
    let mut outcomes = Vec::new();
    for mut processor in processors(setting) {
        let mut tally = Tally::default();
        for radius in [0.0, BALL] {
            let chain = gantry(vec![ProxyNodeSpec { position: DVec3::ZERO, radius, length: 0.0 }]);
            let mut model = Model::new(&object, &chain, contact_of(&chain, 1.0));
            let mut configurations = Vec::new();
            for axis in [DVec3::Z, DVec3::X, DVec3::new(0.3, -0.5, 0.8).normalize()] {
                configurations.extend((-40..=40).map(|k| at(axis * (0.002 * f64::from(k)))));
            }
            for stiffness in STIFFNESSES {
                model.set_stiffness(stiffness);
                tally.add(&mut processor, &model, &configurations)?;
            }
        }
        let Tally { wrong, flagged, all } = tally;
        let varied = processor.name("node through the centre; points and balls; Kc 1e2, 1e4, rigid");
        let note = processor.note(format!("{flagged} of {all} flagged as unconverged"));
        let measure = "neither balanced nor flagged";
        outcomes.push(outcome("right through", &varied, measure, wrong as f64, Bound::AtMost(0.0), note));
    }
    Ok(outcomes)
}

/// The bar in the hole and the groove of a torus.
pub fn concave(setting: &Setting) -> Result<Vec<CaseResult>, Failure> {
    let object = torus(DVec3::ZERO)?;
    let count = if setting.effort == Effort::Full { 200 } else { 30 };
    let mut outcomes = Vec::new();
    for (name, radius) in [("points", 0.0), ("balls", 0.004)] {
        let chain = floating_bar(radius);
        let mut model = Model::new(&object, &chain, contact_of(&chain, 1.0));
        // A fifth of the tube's radius.
        let configurations = pressed(&model, 3, count, 0.0, 0.2 * 0.016);
        for stiffness in [1e2, 1e4, 1e6] {
            model.set_stiffness(stiffness);
            for mut processor in processors(setting) {
                let mut tally = Tally::default();
                tally.add(&mut processor, &model, &configurations)?;
                let Tally { wrong, flagged, all } = tally;
                let varied = processor.name(&format!("bar on a torus, {name}, Kc {stiffness:.0e}"));
                let share = (all - flagged - wrong) as f64 / all as f64;
                let note = processor.note(format!("{flagged} of {all} flagged"));
                let bound = Bound::AtLeast(0.99);
                outcomes.push(outcome("concave object", &varied, "share converged [1]", share, bound, note));
            }
        }
    }
    Ok(outcomes)
}

/// Two nodes on opposite poles of the sphere push it equally: the forces on the gantry's slide between them cancel.
/// Sideways a point in a vertex leans on one of its facets.
pub fn two_regions(setting: &Setting) -> Result<Vec<CaseResult>, Failure> {
    let object = sphere(PAPER)?;
    let mut outcomes = Vec::new();
    for mut processor in processors(setting) {
        let (mut worst, mut unconverged) = (0.0f64, 0);
        for radius in [0.0, BALL] {
            let nodes = [1.0, -1.0].map(|side| ProxyNodeSpec {
                position: DVec3::Z * (side * (0.9 * RADIUS + radius)),
                radius,
                length: 0.0,
            });
            let chain = gantry(nodes.to_vec());
            let mut model = Model::new(&object, &chain, contact_of(&chain, 1.0));
            for stiffness in STIFFNESSES {
                model.set_stiffness(stiffness);
                for result in processor.solve(&model, &[at(DVec3::ZERO)])? {
                    unconverged += usize::from(result.status != Status::Contact);
                    let size: f64 = result.touches.iter().map(|touch| touch.force.length()).sum();
                    let touching = result.status == Status::Contact;
                    worst = worst.max(if touching { result.torque[2].abs() / size } else { f64::INFINITY });
                }
            }
        }
        let varied = processor.name("nodes on both poles; points and balls; Kc 1e2, 1e4, rigid");
        let note = processor.note(format!("{unconverged} unconverged"));
        let measure = "net force over the sum of forces [1]";
        outcomes.push(outcome("two regions", &varied, measure, worst, Bound::AtMost(1e-6), note));
    }
    Ok(outcomes)
}
