//! The stages on a device: their kernels, their buffers, and the submissions they make up.

use super::{
    context::Context,
    detection::Detection,
    error::GpuError,
    model::DeviceModel,
    precision::Precision,
    search::{Search, SearchLane},
    search_model::{CONTACTS, SearchModel},
    stages::{Detected, Found, StageRoom, Stages, Trust},
};
use crate::{JointVector, contact};
use std::sync::Arc;

/// Bounds on what a device is given.
#[derive(Clone, Copy, Debug)]
pub struct BatchCapacity {
    /// Most configurations placed and tested for contact at a time.
    pub chunk: usize,
    /// Most of them in contact that are solved at a time.
    pub searches: usize,
    /// Most proxy nodes in contact in one configuration, at most 64; more are solved on the CPU.
    pub contacts: usize,
    /// Whether f64 is used where the device has it.
    pub double: bool,
    /// How many sections of configurations are under way at a time, each with buffers of its own.
    pub in_flight: usize,
}

impl Default for BatchCapacity {
    /// Enough to keep a large GPU busy while the host turns to what it has found.
    fn default() -> Self {
        Self { chunk: 1 << 16, searches: 1 << 16, contacts: CONTACTS, double: true, in_flight: 3 }
    }
}

/// Most memory that one buffer takes, on a GPU and on a software rasteriser, whose memory is the host's (B). There are
/// a few of such a size a section in flight. No adapter reports how much memory it has: where it runs out, there is
/// another try with half the room.
const HARDWARE_BUDGET: u64 = 128 << 20;
const SOFTWARE_BUDGET: u64 = 16 << 20;

/// The same for the workspaces of the search: some thousand configurations on a GPU, which fill it, and on one that has
/// the host's memory.
const HARDWARE_WORKSPACES: u64 = 3 << 30;
const INTEGRATED_WORKSPACES: u64 = 256 << 20;
const SOFTWARE_WORKSPACES: u64 = 64 << 20;

impl BatchCapacity {
    /// Cut to what buffers may take.
    fn within(self, context: &Context, model: &contact::Model<'_>) -> Self {
        let budget = if context.adapter().hardware { HARDWARE_BUDGET } else { SOFTWARE_BUDGET };
        let budget = budget.min(context.binding_limit());
        let fit = |bytes: usize| (budget as usize / bytes.max(1)).max(1);
        let nodes = model.chain.nodes.len();
        // A proxy node has one contact.
        let contacts = self.contacts.clamp(1, CONTACTS).min(nodes);
        let placed = 24 * nodes.max(model.chain.joints.len());
        Self { chunk: self.chunk.clamp(1, fit(placed)), contacts, ..self }
    }

    /// Cut to the memory that workspaces may take. Each part of one takes so many bytes, and has a binding of its own
    /// (B).
    fn for_workspaces(self, context: &Context, parts: [u64; 3]) -> Self {
        let budget = match context.adapter() {
            adapter if !adapter.hardware => SOFTWARE_WORKSPACES,
            adapter if adapter.is_integrated() => INTEGRATED_WORKSPACES,
            _ => HARDWARE_WORKSPACES,
        };
        let most = parts.map(|bytes| context.binding_limit() / bytes.max(1)).into_iter().min().unwrap_or(0);
        let most = most.min(budget / parts.iter().sum::<u64>().max(1)) as usize;
        Self { searches: self.searches.min(self.chunk).min(most).max(1), ..self }
    }

    /// Halved until there is the memory for what `make` makes of it.
    fn cut_to_memory<T>(self, make: impl Fn(Self) -> Result<T, GpuError>) -> Result<(Self, T), GpuError> {
        match make(self) {
            Err(GpuError::OutOfMemory(_)) if self.chunk > 1 => self.half().cut_to_memory(make),
            made => Ok((self, made?)),
        }
    }

    /// Half of each, contacts aside.
    fn half(self) -> Self {
        Self { chunk: (self.chunk / 2).max(1), searches: (self.searches / 2).max(1), ..self }
    }
}

/// All stages of a model on a device.
pub struct Pipeline<'a> {
    context: Arc<Context>,
    model: &'a contact::Model<'a>,
    room: BatchCapacity,
    search: Search,
    /// One pair for each section in flight.
    lanes: Vec<(Detection, SearchLane)>,
}

impl<'a> Pipeline<'a> {
    /// The stages of `model` on the device of `context`, with `room` or as much of it as the device has.
    pub(super) fn new(
        context: Arc<Context>,
        model: &'a contact::Model<'a>,
        room: BatchCapacity,
    ) -> Result<Self, GpuError> {
        let room = room.within(&context, model);
        let bytes = size_of_val(&model.compliance.entries[..]) as u64;
        let in_double = room.double && context.adapter().double && bytes <= context.binding_limit();
        let precision = if in_double { Precision::Double } else { Precision::Single };
        let device = DeviceModel::new(&context, model, precision)?;
        let search = Search::new(&context, SearchModel::new(&context, model, &device, room.contacts)?)?;
        let room = room.for_workspaces(&context, search.model.workspace());
        let (room, lanes) = room.cut_to_memory(|room| {
            let lane = |_| {
                let detection = Detection::new(&context, model, &device, room.chunk)?;
                let lane = SearchLane::new(&context, &search, &device, &detection, room.searches)?;
                Ok((detection, lane))
            };
            (0..room.in_flight.max(1)).map(lane).collect()
        })?;
        Ok(Self { context, model, room, search, lanes })
    }

    /// The device.
    pub(super) fn context(&self) -> &Context {
        &self.context
    }
}

impl Stages for Pipeline<'_> {
    type Ticket = wgpu::SubmissionIndex;

    fn room(&self) -> StageRoom {
        StageRoom { lanes: self.lanes.len(), section: self.room.chunk, searches: self.room.searches }
    }

    fn trust(&self) -> Trust {
        self.lanes[0].0.trust()
    }

    fn detect(&mut self, lane: usize, section: &[JointVector]) -> Self::Ticket {
        self.lanes[lane].0.submit(&self.context, section)
    }

    fn detected(&mut self, lane: usize, count: usize, ticket: &Self::Ticket) -> Result<Detected, GpuError> {
        self.lanes[lane].0.collect(&self.context, count, ticket)
    }

    fn solve(&mut self, lane: usize, count: usize) -> Self::Ticket {
        self.lanes[lane].1.solve(&self.context, &self.search, count)
    }

    fn found(&mut self, lane: usize, count: usize, ticket: &Self::Ticket) -> Result<Found, GpuError> {
        self.lanes[lane].1.found(&self.context, &self.search, count, ticket)
    }

    fn reopen(&mut self) -> Result<(), GpuError> {
        let context = Arc::new(self.context.reopen()?);
        *self = Self::new(context, self.model, self.room.half())?;
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::cell::Cell;

    #[test]
    fn room_is_halved_until_there_is_memory_for_it() {
        let whole = BatchCapacity { chunk: 1 << 16, searches: 7390, ..BatchCapacity::default() };
        let tries = Cell::new(0);
        let up_to = |most: usize| {
            tries.set(0);
            whole.cut_to_memory(|room| {
                tries.set(tries.get() + 1);
                if room.searches > most { Err(GpuError::OutOfMemory(String::new())) } else { Ok(room.searches) }
            })
        };
        for (most, expected, count) in [(10_000, 7390, 1), (7000, 3695, 2), (1000, 923, 4)] {
            let (room, made) = up_to(most).unwrap();
            assert_eq!((room.searches, made, tries.get()), (expected, expected, count));
            assert_eq!((room.chunk, room.contacts), ((1 << 16) >> (count - 1), CONTACTS));
        }
        assert!(matches!(up_to(0), Err(GpuError::OutOfMemory(_))));
        assert_eq!(tries.get(), 17, "down to one");
        let lost = whole.cut_to_memory::<()>(|_| Err(GpuError::Lost("unplugged".into())));
        assert!(matches!(lost, Err(GpuError::Lost(_))), "half of it would not help");
    }
}
