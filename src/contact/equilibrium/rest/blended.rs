//! Rows before a rounded surface: blends of the rows of a lattice's points, on which the compliance is condensed.
//!
//! A row is 64 numbers on points. Forces on the object's nodes follow from those on points where they are asked for.

use crate::contact::MINIMUM_SQUARE;
use crate::contact::law::rounded::{Blend, Rounded};
use crate::contact::linear::condensed::Condensed;
use crate::contact::linear::rows::combine;
use crate::contact::linear::support::{ABSENT, Support, dot};
use crate::contact::model::Model;
use glam::{DMat3, DVec3};
use std::sync::Arc;

/// Points that weigh in a row.
pub const TAPS: usize = 64;

/// A row on slots of points.
struct Row {
    blend: Blend,
    slots: [u32; TAPS],
    /// B (1).
    values: [f64; TAPS],
}

/// Rows before a rounded surface, for one thread.
pub struct BlendedRows {
    rounded: Arc<Rounded>,
    condensed: Arc<Condensed>,
    rows: Vec<Row>,
    /// Slot of each point of the lattice, or [`ABSENT`], and the point of each slot.
    slots: Vec<u32>,
    points: Vec<u32>,
    /// Compliance among the points with a slot, row-major (m/N), and of how many.
    compliance: Vec<f64>,
    gathered: usize,
    /// Forces along the points' rows (N), and how much these deepen under them (m).
    pub load: Vec<f64>,
    pub given: Vec<f64>,
    /// What one row makes the points give (m/N).
    response: Vec<f64>,
}

impl BlendedRows {
    /// None yet, if contact is rounded in `model`.
    pub fn new(model: &Model) -> Option<Self> {
        let rounded = model.rounded.clone()?;
        Some(Self {
            slots: vec![ABSENT; rounded.count()],
            rounded,
            condensed: model.condensed.clone(),
            rows: Vec::new(),
            points: Vec::new(),
            compliance: Vec::new(),
            gathered: 0,
            load: Vec::new(),
            given: Vec::new(),
            response: Vec::new(),
        })
    }

    /// Makes room for so many rows on so many points: nothing is allocated for them from then on.
    pub fn reserve(&mut self, rows: usize, points: usize) {
        self.rows.reserve(rows);
        self.points.reserve(points + TAPS);
        self.compliance.reserve(points * points);
        for vector in [&mut self.load, &mut self.given, &mut self.response] {
            vector.reserve(points);
        }
    }

    /// Forgets all rows.
    pub fn clear(&mut self) {
        self.points.drain(..).for_each(|l| self.slots[l as usize] = ABSENT);
        self.rows.clear();
        self.gathered = 0;
    }

    /// Numbers of a load on the points.
    pub fn order(&self) -> usize {
        self.points.len()
    }

    /// Adds the row of the place `x`, which is within the lattice.
    pub fn add(&mut self, x: DVec3) {
        let Self { rounded, rows, slots, points, .. } = self;
        let Some(blend) = rounded.blend(x) else { return };
        let mut row = Row { blend, slots: [0; TAPS], values: [0.0; TAPS] };
        for ((l, value), (slot, own)) in rounded.values(&blend).zip(row.slots.iter_mut().zip(&mut row.values)) {
            let known = &mut slots[l as usize];
            if *known == ABSENT {
                *known = points.len() as u32;
                points.push(l);
            }
            (*slot, *own) = (*known, value);
        }
        rows.push(row);
    }

    /// Brings the compliance up to date with the points. One that it does not cover does not give way: what touches there
    /// is flagged at the end.
    pub fn gather(&mut self) {
        let Self { condensed, points, compliance, gathered, response, .. } = self;
        let count = points.len();
        if *gathered == count {
            return;
        }
        *gathered = count;
        compliance.resize(count * count, 0.0);
        response.resize(count, 0.0);
        for (row, &l) in compliance.chunks_exact_mut(count).zip(&*points) {
            let all = condensed.place(l).map(|place| condensed.row(place));
            for (entry, &m) in row.iter_mut().zip(&*points) {
                *entry = all.zip(condensed.place(m)).map_or(0.0, |(all, place)| all[place]);
            }
        }
    }

    /// Sets `deepened` to how much row `i`, and those before it, give way to a newton on row `i` (m/N).
    pub fn respond(&mut self, i: usize, deepened: &mut [f64]) {
        let Self { rows, compliance, response, .. } = self;
        let (row, count) = (&rows[i], response.len());
        let entries = |slot: &u32| &compliance[*slot as usize * count..][..count];
        combine(row.slots.iter().map(entries).zip(row.values), response);
        deepened.iter_mut().zip(&*rows).for_each(|(deepened, other)| *deepened = other.sum(response));
    }

    /// Takes the forces of the rows (N).
    pub fn take_forces(&mut self, forces: &[f64]) {
        let mut load = std::mem::take(&mut self.load);
        load.clear();
        load.resize(self.order(), 0.0);
        forces.iter().enumerate().for_each(|(i, force)| self.add_load(i, -force, &mut load));
        self.load = load;
    }

    /// Sets how much the points give under the forces.
    pub fn give(&mut self) {
        let mut given = std::mem::take(&mut self.given);
        given.resize(self.order(), 0.0);
        self.multiply(&self.load, &mut given);
        self.given = given;
    }

    /// `product` is how much the points give under `load`.
    pub fn multiply(&self, load: &[f64], product: &mut [f64]) {
        let rows = self.compliance.chunks_exact(load.len().max(1));
        product.iter_mut().zip(rows).for_each(|(product, row)| *product = dot(row, load));
    }

    /// Adds `force` times row `i` to `load`.
    pub fn add_load(&self, i: usize, force: f64, load: &mut [f64]) {
        let row = &self.rows[i];
        row.slots.iter().zip(row.values).for_each(|(slot, value)| load[*slot as usize] += force * value);
    }

    /// Adds the change of row `i` as its place moves by `way` to `load`.
    pub fn add_turn(&self, i: usize, way: DVec3, load: &mut [f64]) {
        let row = &self.rows[i];
        for ((_, slope), slot) in self.rounded.slopes(&row.blend).zip(row.slots) {
            load[slot as usize] += slope.dot(way);
        }
    }

    /// By how much points that give `vector` deepen row `i` (m).
    pub fn depth_change(&self, i: usize, vector: &[f64]) -> f64 {
        self.rows[i].sum(vector)
    }

    /// The depth at the place `x` less that at rest, where nodes are displaced by `u` (m).
    pub fn standing(&self, x: DVec3, u: impl Fn(u32) -> DVec3) -> f64 {
        let Some(blend) = self.rounded.blend(x) else { return 0.0 };
        let values = self.rounded.values(&blend);
        values
            .map(|(l, value)| value * (self.rounded.displaced(l, &u) - self.rounded.displaced(l, |_| DVec3::ZERO)))
            .sum()
    }

    /// A bound of how much any place deepens under forces that store the energy `elastic` (m): for any row g,
    /// |g . u|^2 <= g . C g |u|^2, the last in the energy norm, and a blend is no longer than its longest row.
    pub fn deepening_bound(&self, elastic: f64) -> f64 {
        (self.condensed.greatest * 2.0 * elastic.max(0.0)).sqrt()
    }

    /// By how much the place `x` deepens under the forces (m).
    pub fn deepening(&self, x: DVec3) -> f64 {
        let Some(blend) = self.rounded.blend(x) else { return 0.0 };
        let deepens = |l: u32| match self.given.get(self.slots[l as usize] as usize) {
            Some(given) => *given,
            None => self.condensed.place(l).map_or(0.0, |place| {
                let row = self.condensed.row(place);
                let loaded = self.points.iter().zip(&self.load).filter(|(_, load)| **load != 0.0);
                loaded.filter_map(|(&m, load)| Some(row[self.condensed.place(m)?] * load)).sum()
            }),
        };
        self.rounded.values(&blend).map(|(l, value)| value * deepens(l)).sum()
    }

    /// Depths of the points of row `i` where they give as the forces make them, and nodes stand displaced by `u` (m).
    fn depth(&self, l: u32, u: impl Fn(u32) -> DVec3) -> f64 {
        self.rounded.displaced(l, u) + self.given[self.slots[l as usize] as usize]
    }

    /// Minus the gradient of the depth of row `i`, where nodes stand displaced by `u` (1).
    pub fn pushed(&self, i: usize, u: impl Fn(u32) -> DVec3) -> DVec3 {
        self.rounded.slopes(&self.rows[i].blend).map(|(l, slope)| -slope * self.depth(l, &u)).sum()
    }

    /// The second derivative of that depth (1/m).
    pub fn bend(&self, i: usize, u: impl Fn(u32) -> DVec3) -> DMat3 {
        self.rounded.bend(&self.rows[i].blend, |l| self.depth(l, &u))
    }

    /// Puts the object's nodes that the points hang on on `support`.
    pub fn put_on(&self, support: &mut Support) {
        support.clear();
        for (node, _) in self.points.iter().flat_map(|&l| self.rounded.row(l)) {
            support.add(node);
        }
    }

    /// Sets `forces`, three numbers a node of `support`, to those of `load` on the points.
    pub fn spread(&self, load: &[f64], support: &Support, forces: &mut Vec<f64>) {
        forces.clear();
        forces.resize(support.order(), 0.0);
        let nodes = forces.as_chunks_mut::<3>().0;
        for (&l, load) in self.points.iter().zip(load).filter(|(_, load)| **load != 0.0) {
            for (node, weight) in self.rounded.row(l) {
                let at = &mut nodes[support.slot(node)];
                *at = (DVec3::from_array(*at) + weight * *load).to_array();
            }
        }
    }

    /// The object's nodes of `support` that carry row `i`, and the share of its force that each carries along all of it,
    /// in sum one.
    pub fn carriers(&self, i: usize, support: &Support) -> Vec<(u32, f64)> {
        let (mut load, mut forces) = (vec![0.0; self.order()], Vec::new());
        self.add_load(i, 1.0, &mut load);
        self.spread(&load, support, &mut forces);
        let nodes = || support.nodes().iter().zip(forces.as_chunks::<3>().0);
        let all: DVec3 = nodes().map(|(_, force)| DVec3::from_array(*force)).sum();
        let along = all / all.length_squared().max(MINIMUM_SQUARE);
        let mut carriers: Vec<(u32, f64)> = nodes()
            .filter(|(_, force)| **force != [0.0; 3])
            .map(|(node, force)| (*node, along.dot(DVec3::from_array(*force))))
            .collect();
        carriers.sort_unstable_by_key(|(node, _)| *node);
        carriers
    }
}

impl Row {
    /// The sum of `vector` on the points, as they weigh in the row.
    fn sum(&self, vector: &[f64]) -> f64 {
        self.slots.iter().zip(self.values).map(|(slot, value)| value * vector[*slot as usize]).sum()
    }
}
