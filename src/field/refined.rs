//! The field of a refined dataset: the store answers, with the finest of its levels that are there.
//!
//! The torque is minus the gradient of one smooth energy, whichever nodes there are (`dataset/store`). There is no boundary layer: the torque begins at w = 0 without a jump. A store does not say what it does not
//! keep: how many nodes of the object touch.

use super::{
    Flags, Sample,
    bernstein::{Bernstein, place},
    stiffness::Stiffness,
};
use crate::{
    JointVector, MAX_JOINTS,
    dataset::Grid,
    store::{Place, Store, beyond, record::sets},
};
use rayon::prelude::*;

/// The field at `q`, of the first `horizon` blocks, and the levels whose cell around `q` is whole.
pub(super) fn sample(grid: &Grid, store: &Store, q: &[f64], horizon: u64) -> (Sample, u32) {
    let root = store.sample_within(q, horizon);
    let fade = grid.fade(q);
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

/// Returns the greatest bound of the stiffness relative to `slopes` over all cells.
pub(super) fn steepest(store: &Store, slopes: &JointVector) -> Stiffness {
    let (space, joints) = (store.space(), slopes.len());
    let last = space.last(0);
    let is_there = |node: &Place| store.get(0, &space.block_of(node)).is_some();
    // Each cell once: by the first of its corners that has a block.
    let cell = |node: &Place, side: usize| {
        let mut low = *node;
        for (a, low) in low.iter_mut().enumerate().take(joints) {
            *low = low.checked_sub((side >> a & 1) as u32).filter(|low| *low < last[a])?;
        }
        (0..side).all(|before| !is_there(&beyond(&low, before))).then_some(low)
    };
    let steepest_at = |(_, node): (usize, Place)| {
        let cells = (0..1_usize << joints).filter_map(|side| cell(&node, side));
        let added = cells.filter_map(|low| Some((low, store.added(0, &low)?)));
        added
            .map(|(low, added)| within(store, slopes, (0, low), &polynomial(added)))
            .fold(Stiffness::default(), Stiffness::max)
    };
    let blocks = store.blocks();
    let base = blocks.par_iter().filter_map(|(key, _)| space.block(*key)).filter(|(level, _)| *level == 0);
    base.map(|(_, block)| space.nodes(0, &block).map(steepest_at).fold(Stiffness::default(), Stiffness::max))
        .reduce(Stiffness::default, Stiffness::max)
}

/// Returns w in a cell of which `added` are the numbers, corner by corner.
fn polynomial(added: Vec<Vec<f64>>) -> Bernstein {
    let joints = added.len().ilog2() as usize;
    let mut numbers = vec![0.0; 1 << (2 * joints)];
    for (side, corner) in added.iter().enumerate() {
        for (set, number) in sets(joints).zip(corner) {
            numbers[place(joints, side, set)] = *number;
        }
    }
    Bernstein::hermite(joints, numbers)
}

/// Returns the greatest bound within the `cell`, a level and its first corner, in which the levels up to this one sum
/// up to `whole`: where a finer level adds something, with it.
fn within(store: &Store, slopes: &JointVector, cell: (u32, Place), whole: &Bernstein) -> Stiffness {
    let (space, joints) = (store.space(), slopes.len());
    let (level, low) = cell;
    let finer = level + 1;
    let child = |side: usize| std::array::from_fn::<_, MAX_JOINTS, _>(|a| 2 * low[a] + (side >> a & 1) as u32);
    let mut added = Vec::new();
    if finer < space.levels() {
        added = (0..1_usize << joints).map(|side| store.added(finer, &child(side))).collect();
    }
    // Levels below bound what no finer one changes, and with that the parts where one does.
    let coarse = added.is_empty() || added.iter().any(Option::is_none);
    let below = if coarse { of_cell(store, slopes, level, whole) } else { Stiffness::default() };
    let refined = added.into_iter().enumerate().filter_map(|(side, added)| Some((side, added?)));
    let steepest_of = |(side, added): (usize, Vec<Vec<f64>>)| {
        let mut part = whole.half(side);
        part.add(&polynomial(added));
        within(store, slopes, (finer, child(side)), &part)
    };
    refined.map(steepest_of).fold(below, Stiffness::max)
}

/// Returns a bound over one cell of `level`: `d tau_a/d q_b = -(w_b w_a + w w_ab)`.
fn of_cell(store: &Store, slopes: &JointVector, level: u32, root: &Bernstein) -> Stiffness {
    if root.greatest() <= 0.0 {
        return Stiffness::default();
    }
    let mut per_step = JointVector::zeros(slopes.len());
    per_step.iter_mut().enumerate().for_each(|(a, per_step)| *per_step = 1.0 / store.space().step(level, a));
    root.bounds(&per_step).stiffness(slopes)
}
