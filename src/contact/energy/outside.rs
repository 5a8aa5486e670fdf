//! What the search from the rest state leaves unbalanced, where balls may stand inside the object and be pressed out of it to any side.
//!
//! The proxy is drawn out, along the normal of its deepest contact, and comes back in steps at full stiffness, each from the
//! equilibrium before, as a hand would bring it there. On this way a step that E refuses gets a second chance: another step from
//! where it led, where walls that it did not know of are seen and curved ones stand as they do there. If both together lower E by a
//! fair share of the first promise, they are taken.
//!
//! At last, or at once if a ball is larger than the facets, the proxy comes in gently, from the side on which most of it is: with contact
//! so soft that E is smooth over many facets, but no softer than keeps balls out of the object. A step that stalls on the way is left
//! for the next, whose E is another. At the end of the way contact stiffens in stages as from the rest state. All along, facets are
//! rounded more, so that they turn under a ball slowly where they are pressed to slivers; in the end they are as they should be, and a
//! last descent finds the equilibrium beside. Where a surface that is soft along itself slides under a ball, curvature asks for so
//! much damping that steps creep; so the last of its ways in is gone with a convex model instead.

use super::{EnergySearch, Geometry, Limits, Outcome, contact_energy, foresee};
use crate::contact::detection::{Detection, Walls};
use crate::contact::model::Model;
use crate::contact::newton::Care;
use crate::contact::surface;
use crate::tolerances::{
    APPROACH_STEPS, CONTINUATION_FACTOR, FACET_ROUNDING, GENTLE_DEPTH, GENTLE_ROUNDING, GENTLE_STIFFNESS, RETREATS,
    STAGE_TOLERANCE,
};
use glam::DVec3;

impl EnergySearch {
    /// Searches on each way in from outside until one ends balanced, with proxy nodes in the end at `nodes` [m]; `outcome` is that of
    /// the search from the rest state. An equilibrium that stores more than the rest state is none.
    pub(super) fn search_from_outside(
        &mut self,
        model: &Model,
        detection: &mut Detection,
        nodes: &[DVec3],
        outcome: &mut Outcome,
    ) {
        self.take_care(Care::Thorough, detection);
        self.start(model, detection, Geometry::Deformed);
        let at_rest = contact_energy(&self.state.contacts, model.kc);
        let deepest = self.state.contacts.iter().max_by(|a, b| a.depth.total_cmp(&b.depth));
        let normal = deepest.map_or(DVec3::ZERO, |contact| contact.normal);
        let outward = surface::unit_or_zero(detection.nodes().iter().sum());
        // Balls that span several facets hardly ever come in otherwise than gently.
        let ways: &[(Care, bool, DVec3)] = if model.chain.nodes.iter().any(|node| node.radius > model.mean_edge) {
            &[(Care::Thorough, true, outward), (Care::Thorough, true, normal), (Care::Convex, true, outward)]
        } else {
            &[(Care::Thorough, false, normal), (Care::Thorough, true, outward)]
        };
        for &(care, gently, direction) in ways {
            self.take_care(care, detection);
            let before = outcome.iterations;
            *outcome = self.approach(model, detection, nodes, gently, direction);
            outcome.converged &= self.state.energy <= at_rest;
            outcome.iterations += before;
            if outcome.converged {
                break;
            }
        }
        self.take_care(Care::Quick, detection);
    }

    fn take_care(&mut self, care: Care, detection: &mut Detection) {
        self.care = care;
        detection.care = care;
    }

    /// Searches along the way in from outside, out along `direction`, with proxy nodes in the end at `nodes` [m]; `gently` or at full
    /// stiffness.
    fn approach(
        &mut self,
        model: &Model,
        detection: &mut Detection,
        nodes: &[DVec3],
        gently: bool,
        direction: DVec3,
    ) -> Outcome {
        let mut outcome = Outcome { converged: false, iterations: 0, residual: f64::MAX };
        let mut gap = detection.take_up(model, nodes);
        let mut moved = nodes.to_vec();
        let mut move_out = |detection: &mut Detection, way: f64| {
            for (moved, node) in moved.iter_mut().zip(nodes) {
                *moved = *node + direction * way;
            }
            detection.take_up(model, &moved)
        };
        let mut way = 0.0;
        for _ in 0..RETREATS {
            if gap >= 0.0 {
                break;
            }
            way -= gap;
            gap = move_out(detection, way);
        }
        detection.rounding = if gently { GENTLE_ROUNDING } else { FACET_ROUNDING };
        self.start(model, detection, Geometry::Deformed);
        self.kc = if gently { model.kc.min(GENTLE_STIFFNESS / model.softest) } else { model.kc };
        self.last_kc = self.kc;
        let iterations = model.contact.max_iterations;
        let limits = |tolerance: f64| Limits { tolerance, iterations };
        let in_passing = |outcome: &Outcome| Limits {
            tolerance: STAGE_TOLERANCE,
            iterations: iterations.min(outcome.iterations + iterations / (2 * APPROACH_STEPS)),
        };
        for step in (0..APPROACH_STEPS).rev() {
            move_out(detection, way * f64::from(step) / f64::from(APPROACH_STEPS));
            std::mem::swap(&mut self.state.contacts, &mut self.trial.contacts);
            let Self { state, trial, kc, .. } = self;
            detection.deformed(model, &state.displacement, &state.positions, Walls::All, &mut state.contacts);
            foresee(&mut state.contacts, &trial.contacts, |before, _| *kc * before.bears());
            if gently {
                self.descend(model, detection, Geometry::Deformed, in_passing(&outcome), &mut outcome);
                while self.kc < model.kc && self.is_sunk(model) {
                    self.kc = model.kc.min(CONTINUATION_FACTOR * self.kc);
                    self.last_kc = self.kc;
                    self.descend(model, detection, Geometry::Deformed, in_passing(&outcome), &mut outcome);
                }
            } else {
                let tolerance = if step == 0 { model.contact.tolerance } else { STAGE_TOLERANCE };
                self.descend(model, detection, Geometry::Deformed, limits(tolerance), &mut outcome);
            }
        }
        if gently {
            self.last_kc = model.kc;
            self.descend(model, detection, Geometry::Deformed, limits(model.contact.tolerance), &mut outcome);
            detection.rounding = FACET_ROUNDING;
            self.descend_anew(model, detection, &mut outcome);
        }
        outcome
    }

    /// Whether a ball has sunk in farther than a gentle approach lets it.
    fn is_sunk(&self, model: &Model) -> bool {
        self.state.contacts.iter().any(|contact| {
            let radius = model.chain.nodes[contact.proxy_node as usize].radius;
            radius > 0.0 && contact.depth > GENTLE_DEPTH * radius
        })
    }
}
