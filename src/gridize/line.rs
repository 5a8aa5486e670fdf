//! One joint: samples sorted along it, an interval holds a position.

use super::{
    cloud::{Cloud, Position},
    interpolant::{Simplex, Triangulation},
};
use crate::MAX_AXES;

/// Points in ascending order.
pub(super) struct Line<'a> {
    cloud: &'a Cloud,
    order: Vec<u32>,
}

impl<'a> Line<'a> {
    pub fn new(cloud: &'a Cloud) -> Self {
        let mut order: Vec<u32> = (0..cloud.positions.len() as u32).collect();
        order.sort_by(|&a, &b| cloud.positions[a as usize][0].total_cmp(&cloud.positions[b as usize][0]));
        Self { cloud, order }
    }
}

impl Triangulation for Line<'_> {
    type Walk = ();

    fn simplex(&self, (): &mut (), at: &Position) -> Option<Simplex> {
        let below = self.order.partition_point(|&point| self.cloud.positions[point as usize][0] <= at[0]);
        let last = self.order.len() - 1;
        let on_the_last = below > last && at[0] <= self.cloud.positions[self.order[last] as usize][0];
        if below == 0 || below > last && !on_the_last {
            return None;
        }
        let left = below.min(last) - 1;
        let mut simplex = [0; MAX_AXES + 1];
        simplex[..2].copy_from_slice(&self.order[left..left + 2]);
        Some(simplex)
    }

    fn position(&self, vertex: u32) -> &Position {
        &self.cloud.positions[vertex as usize]
    }
}
