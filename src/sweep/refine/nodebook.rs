//! The nodes of which a store is filled: each solved once, together with others by a backend.

use super::RefineError;
use crate::{
    JointVector,
    contact::{Backend, CHUNKS_IN_FLIGHT, Solvers},
    store::{Place, Space},
    sweep::node::{Scale, Solved, solve_all},
};
use std::collections::{BTreeSet, HashMap};

/// All nodes that are solved.
pub(super) struct HeldNodes {
    pub space: Space,
    scale: Scale,
    held: HashMap<(u32, Place), Solved>,
}

impl HeldNodes {
    pub fn get(&self, level: u32, place: &Place) -> Option<&Solved> {
        self.held.get(&(level, *place))
    }

    pub fn count(&self) -> usize {
        self.held.len()
    }

    /// Returns the number of equilibria that were solved in contact for these nodes.
    pub fn equilibria(&self) -> usize {
        self.held.values().map(|held| held.equilibria as usize).sum()
    }
}

/// Solves nodes, each once.
pub(super) struct Nodebook<'a, B> {
    pub nodes: HeldNodes,
    backend: &'a mut B,
    /// A good number of configurations for one call of it.
    batch: usize,
    solvers: Solvers<'a>,
    /// Notices of the backend.
    pub notices: Vec<String>,
}

impl<'a, B: Backend> Nodebook<'a, B> {
    /// Nodes of `space`, none of which is solved. Contact is solved by `backend`, `batch` configurations at a time,
    /// all else by `solvers`.
    pub fn new((space, scale): (Space, Scale), (backend, batch): (&'a mut B, usize), solvers: Solvers<'a>) -> Self {
        let nodes = HeldNodes { space, scale, held: HashMap::new() };
        Self { nodes, backend, batch, solvers, notices: Vec::new() }
    }

    /// Solves those of `nodes` of `level` that are not.
    pub fn solve(&mut self, level: u32, nodes: impl IntoIterator<Item = Place>) -> Result<(), RefineError> {
        let wanted: BTreeSet<Place> = nodes.into_iter().filter(|node| self.nodes.get(level, node).is_none()).collect();
        let wanted: Vec<Place> = wanted.into_iter().collect();
        for places in wanted.chunks(CHUNKS_IN_FLIGHT * self.batch.max(1)) {
            let Self { nodes, backend, batch, solvers, notices, .. } = self;
            let configurations: Vec<JointVector> =
                places.iter().map(|place| nodes.space.configuration(level, place)).collect();
            let first = nodes.count();
            let mut note = |node, notice| notices.push(format!("from the store's node {} on: {notice}", first + node));
            let solved = solve_all(*backend, *batch, solvers, &configurations, &nodes.scale, &mut note)
                .map_err(|error| RefineError::Backend(Box::new(error)))?;
            let points = places.iter().map(|place| (level, *place));
            nodes.held.extend(points.zip(solved.into_iter().map(|(node, _)| node)));
        }
        Ok(())
    }
}
