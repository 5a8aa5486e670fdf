//! The compliance condensed on points that hang on the object's nodes: how much each gives way, along its row, to a force
//! of one newton along another's.

use super::rows::{combine, respond};
use super::support::ABSENT;
use crate::object::Compliance;
use glam::DVec3;
use rayon::prelude::*;

/// Points whose rows are formed together: more share the rows of their sources, fewer take less memory.
const TOGETHER: usize = 256;

/// A row on the object's nodes: each node and by how much the row grows along its displacement (1).
pub type NodeRow = Vec<(u32, DVec3)>;

/// G C G^T of the rows G of some points, dense and symmetric.
#[derive(Default)]
pub struct Condensed {
    /// Place of each point, or [`ABSENT`].
    places: Vec<u32>,
    /// Points that are covered.
    pub count: usize,
    /// Row-major (m/N).
    entries: Vec<f64>,
    /// Greatest entry of the diagonal (m/N).
    pub greatest: f64,
}

impl Condensed {
    /// Condenses `compliance` on the points that are `wanted` and whose nodes it covers all. A point's row is the sum of
    /// `rows` of its `sources`, each times a number.
    #[must_use]
    pub fn new<S: Iterator<Item = (u32, f64)> + Clone>(
        rows: &[NodeRow],
        sources: impl Fn(u32) -> S + Sync,
        wanted: &[bool],
        compliance: &Compliance,
    ) -> Self {
        let is_covered = |row: &NodeRow| row.iter().all(|(node, _)| compliance.place(*node).is_some());
        let mut points: Vec<u32> = (0..).zip(wanted).filter(|(_, wanted)| **wanted).map(|(l, _)| l).collect();
        points.retain(|l| sources(*l).all(|(m, _)| is_covered(&rows[m as usize])));
        let mut known: Vec<u32> = points.iter().flat_map(|l| sources(*l).map(|(m, _)| m)).collect();
        known.sort_unstable();
        known.dedup();
        // Rows of the sources on places of the compliance.
        let on_places = |&m: &u32| {
            let row = rows[m as usize].iter();
            row.filter_map(|(node, weight)| Some((compliance.place(*node)?, *weight))).collect()
        };
        let known_rows: Vec<Vec<(usize, DVec3)>> = known.iter().map(on_places).collect();
        let among_sources = |row: &Vec<(usize, DVec3)>| -> Vec<f64> {
            let loads = row.iter().map(|(place, weight)| (*place, weight.to_array()));
            let mut displacement = vec![0.0; 3 * compliance.nodes.len()];
            respond(&compliance.entries, compliance.rows_per_node, loads, &mut displacement);
            let nodes = displacement.as_chunks::<3>().0;
            let along = |row: &Vec<(usize, DVec3)>| {
                row.iter().map(|(place, weight)| weight.dot(DVec3::from_array(nodes[*place]))).sum()
            };
            known_rows.iter().map(along).collect()
        };
        let place_of = places(rows.len(), &known);
        let on_known = |&l: &u32| sources(l).map(|(m, factor)| (place_of[m as usize] as usize, factor)).collect();
        let sums: Vec<Vec<(usize, f64)>> = points.iter().map(on_known).collect();
        let mut last = vec![0; known.len()];
        sums.iter().enumerate().for_each(|(i, sum)| sum.iter().for_each(|(m, _)| last[*m] = i));
        let count = points.len();
        let mut entries = vec![0.0; count * count];
        // Rows among the sources, from the first point that needs one to the last.
        let mut among: Vec<Vec<f64>> = vec![Vec::new(); known.len()];
        for (block, rows) in entries.chunks_mut((TOGETHER * count).max(1)).enumerate() {
            let first = TOGETHER * block;
            let sums = &sums[..count.min(first + TOGETHER)];
            let mut is_needed = vec![false; known.len()];
            sums[first..].iter().flatten().for_each(|(m, _)| is_needed[*m] = true);
            among.par_iter_mut().enumerate().for_each(|(m, row)| {
                if last[m] < first {
                    *row = Vec::new();
                } else if is_needed[m] && row.is_empty() {
                    *row = among_sources(&known_rows[m]);
                }
            });
            rows.par_chunks_mut(count).enumerate().for_each(|(k, entries)| {
                let mut row = vec![0.0; known.len()];
                combine(sums[first + k].iter().map(|&(m, factor)| (&among[m][..], factor)), &mut row);
                for (entry, other) in entries.iter_mut().zip(&sums[..=first + k]) {
                    *entry = other.iter().map(|(m, factor)| factor * row[*m]).sum();
                }
            });
        }
        for i in 0..count {
            (0..i).for_each(|j| entries[j * count + i] = entries[i * count + j]);
        }
        let greatest = (0..count).map(|i| entries[i * count + i]).fold(0.0, f64::max);
        Self { places: places(rows.len(), &points), count, entries, greatest }
    }

    /// Place of point `l`, if it is covered.
    #[must_use]
    pub fn place(&self, l: u32) -> Option<usize> {
        self.places.get(l as usize).filter(|&&place| place != ABSENT).map(|&place| place as usize)
    }

    /// The row of the point in place i (m/N).
    #[must_use]
    pub fn row(&self, i: usize) -> &[f64] {
        &self.entries[i * self.count..(i + 1) * self.count]
    }
}

/// Places of `points`, ascending, among `count`.
fn places(count: usize, points: &[u32]) -> Vec<u32> {
    let mut places = vec![ABSENT; count];
    points.iter().zip(0..).for_each(|(&l, place)| places[l as usize] = place);
    places
}
