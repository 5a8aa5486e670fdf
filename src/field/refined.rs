//! The field of a refined dataset: the store answers, with the finest of its levels that are there.
//!
//! Its order says how (`dataset/store`): `potential` is minus the gradient of one smooth energy, whichever nodes there
//! are. There is no boundary layer: the torque begins at w = 0 without a jump. A store does not say what it does not
//! keep: how many nodes of the object touch.

use super::{Flags, Sample, stencil::Lattice};
use crate::{JointVector, store::Store, tolerances::GRADIENT_STEP};

/// Most nodes at which the stiffness is taken [1]. More: nearer to the greatest there is. Fewer: quicker.
const MOST_NODES: usize = 4096;

/// The field at `q`, of the first `horizon` blocks, and the levels whose cell around `q` is whole.
pub(super) fn sample(lattice: &Lattice, store: &Store, q: &[f64], horizon: u64) -> (Sample, u32) {
    let root = store.sample_within(q, horizon);
    let fade = lattice.fade(q);
    let mut flags = Flags::empty();
    flags.set(Flags::OUTSIDE, fade < 1.0);
    flags.set(Flags::ABSENT, root.whole == 0);
    flags.set(Flags::UNCONVERGED, root.failed);
    let touches = root.value > 0.0;
    let mut torque = root.torque();
    torque.iter_mut().for_each(|tau| *tau *= fade);
    let sample = Sample {
        torque,
        index: f64::from(u8::from(touches)),
        contact: touches && fade > 0.0,
        contact_nodes: 0,
        energy: root.energy(),
        share: fade,
        flags,
    };
    (sample, root.whole)
}

/// Greatest Frobenius norm of `S^-1/2 (d tau/d q) S^-1/2`, S = diag(slopes), over nodes in contact, evenly chosen where
/// there are many. By differences of the torque over small steps: between nodes it may be greater.
pub(super) fn relative_stiffness(store: &Store, slopes: &JointVector) -> f64 {
    let space = store.space();
    let finest = space.levels() - 1;
    let blocks = store.blocks();
    let nodes = blocks.iter().filter_map(|(key, block)| Some((space.block(*key)?, block.nodes())));
    let places = nodes.flat_map(|((level, place), nodes)| {
        let present = nodes.present;
        let there = space.nodes(level, &place).filter(move |(at, _)| present >> at & 1 == 1);
        there.map(move |(_, node)| space.configuration(level, &node))
    });
    let touching: Vec<JointVector> = places.filter(|q| store.sample(q).value > 0.0).collect();
    let every = touching.len().div_ceil(MOST_NODES).max(1);
    let norm = |q: &JointVector| {
        let mut sum = 0.0;
        for b in 0..q.len() {
            let step = GRADIENT_STEP * space.step(finest, b);
            let torque = |side: f64| {
                let mut at = *q;
                at[b] += side * step;
                store.sample(&at).torque()
            };
            let (before, after) = (torque(-1.0), torque(1.0));
            for a in 0..q.len() {
                sum += ((after[a] - before[a]) / (2.0 * step)).powi(2) / (slopes[a] * slopes[b]);
            }
        }
        sum
    };
    touching.iter().step_by(every).map(norm).fold(0.0, f64::max).sqrt()
}
