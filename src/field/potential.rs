//! The potential: a torque field that is minus the gradient of one smooth energy, and so makes no energy around any
//! loop.
//!
//! An object of finite stiffness stores `U = 1/2 k depth^2` where contact begins: U and its gradient vanish at the
//! boundary, its curvature jumps there. So not U is interpolated but its signed root, `w = sqrt(2 (U - U_free))`,
//! `dw/dq = -tau / w`, continued to negative values on the free side, which is smooth through the boundary and, for a
//! linear object, linear. Then
//!
//! `U_bar = U_free + 1/2 max(0, w_bar)^2`,  `tau_bar = -dU_bar/dq = -max(0, w_bar) dw_bar/dq`.
//!
//! w_bar is the C1 sum of cubic Hermite polynomials over the nodes of one or more levels (`dataset/store/levels.rs`):
//! those of a uniform grid (`grid_root.rs`) or of a store. U_bar is C1, tau_bar continuous, equal to the solved tau at
//! the nodes, and errs with h^3 where the field is smooth. It begins at zero at the boundary w_bar = 0, without a jump
//! and so without a boundary layer, which would break the gradient.
//!
//! Where equilibria change abruptly (the object snaps from one to another), U jumps between two nodes. The field then
//! goes from one to the other within the cell, smoothly, with a torque of about the jump over h.

use super::{
    Flags, Interpolant, Sample, Tables,
    bernstein::Bernstein,
    points::Around,
    stiffness::{Steepest, Stiffness},
};
use crate::{
    JointVector,
    dataset::{Axis, Grid},
    store::{Cell, Levels, Place, Root, Store, added, beyond, root},
};
use rayon::prelude::*;
use std::sync::Arc;

/// Nodes of the root of an energy.
pub(super) trait RootNodes: Levels {
    /// What they tell of `q`, in `cell` of the base, beside `root`, which was interpolated there.
    fn around(&self, q: &[f64], cell: &Cell, root: &Root) -> Around;

    /// The numbers of all nodes, `width(d)` each in C order, where they are those of one grid.
    fn records(&self) -> Option<&[f64]>;
}

/// The potential over nodes of its root.
pub(super) struct Potential<N> {
    nodes: Arc<N>,
    /// U without contact (J).
    free_energy: f64,
    steepest: Steepest,
}

impl<N: RootNodes> Potential<N> {
    /// The potential over `nodes`, which is `free_energy` without contact (J).
    pub fn new(nodes: Arc<N>, free_energy: f64) -> Self {
        Self { nodes, free_energy, steepest: Steepest::default() }
    }

    /// Returns the greatest bound of the stiffness relative to `slopes` over all cells.
    fn steepest(&self, slopes: &JointVector) -> Stiffness {
        let nodes = &*self.nodes;
        let of_cell = |low| {
            added(nodes, 0, &low).map(|added| within(nodes, slopes, 0, &low, &Bernstein::hermite(slopes.len(), &added)))
        };
        let cells = (0..nodes.base().points()).into_par_iter().filter_map(|point| nodes.base().cell_from(point));
        cells.filter_map(of_cell).reduce(Stiffness::default, Stiffness::max)
    }
}

impl<N: RootNodes> Interpolant for Potential<N> {
    fn sample(&self, q: &[f64]) -> Sample {
        let cell = Cell::of(self.nodes.base(), q);
        let root = root(&*self.nodes, cell);
        let around = self.nodes.around(q, &cell, &root);
        around.sample(root.torque(), self.free_energy + root.energy(), root.value > 0.0)
    }

    fn torques(&self, q: &[f64], torques: &mut [f64]) {
        let base = self.nodes.base();
        for (q, torque) in q.chunks_exact(base.joints()).zip(torques.chunks_exact_mut(base.joints())) {
            let (root, fade) = (root(&*self.nodes, Cell::of(base, q)), base.fade(q));
            torque.iter_mut().zip(root.torque().iter()).for_each(|(out, tau)| *out = tau * fade);
        }
    }

    fn relative_stiffness(&self, slopes: &JointVector) -> f64 {
        self.steepest.norm(slopes, || self.steepest(slopes))
    }

    fn tables(&self) -> Option<Tables<'_>> {
        let records = self.nodes.records()?;
        Some(Tables { records, free_energy: self.free_energy, compliance: None })
    }
}

impl RootNodes for Store {
    /// A store does not say what it does not keep: how many nodes of the object touch.
    fn around(&self, q: &[f64], _: &Cell, root: &Root) -> Around {
        let mut flags = Flags::empty();
        flags.set(Flags::ABSENT, root.absent);
        flags.set(Flags::UNCONVERGED, root.failed);
        let index = f64::from(u8::from(root.value > 0.0));
        Around { fade: self.base().fade(q), share: 1.0, flags, index, contact_nodes: 0 }
    }

    fn records(&self) -> Option<&[f64]> {
        None
    }
}

/// Returns the greatest bound within the cell of `level` with first corner `low`, in which the levels up to this one
/// sum up to `whole`: where a finer level adds something, with it.
fn within<N: Levels>(nodes: &N, slopes: &JointVector, level: u32, low: &Place, whole: &Bernstein) -> Stiffness {
    let finer = level + 1;
    let child = |side: usize| beyond(&low.map(|i| 2 * i), side);
    let mut parts = Vec::new();
    if finer < nodes.count() {
        parts = (0..1_usize << slopes.len()).map(|side| added(nodes, finer, &child(side))).collect();
    }
    // Levels below bound what no finer one changes, and with that the parts where one does.
    let coarse = parts.is_empty() || parts.iter().any(Option::is_none);
    let below = if coarse { of_cell(nodes.base(), slopes, level, whole) } else { Stiffness::default() };
    let refined = parts.into_iter().enumerate().filter_map(|(side, added)| Some((side, added?)));
    let steepest_of = |(side, added): (usize, Vec<f64>)| {
        let mut part = whole.half(side);
        part.add(&Bernstein::hermite(slopes.len(), &added));
        within(nodes, slopes, finer, &child(side), &part)
    };
    refined.map(steepest_of).fold(below, Stiffness::max)
}

/// Returns a bound over one cell of `level`: `d tau_a/d q_b = -(w_b w_a + w w_ab)`.
fn of_cell(base: &Grid, slopes: &JointVector, level: u32, root: &Bernstein) -> Stiffness {
    if root.greatest() <= 0.0 {
        return Stiffness::default();
    }
    let per_step = |axis: &Axis| if axis.count > 1 { f64::from(1_u32 << level) / axis.step } else { 0.0 };
    root.bounds(&base.axes.iter().map(per_step).collect()).stiffness(slopes)
}
