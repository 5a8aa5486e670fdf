//! The stages on a device: their kernels, their buffers, and the submissions they make up.

use super::{
    context::{Context, GpuError},
    detection::{Detection, DoubleModel},
    forces::{ForceLane, ForceSearch},
    layout::Touch,
    model::DeviceModel,
    search::{Search, SearchLane},
    search_model::{CONTACTS, SearchModel},
    shaders,
    stages::{Detected, Found, GapPrecision, StageRoom, Stages},
};
use crate::{JointVector, contact, scene::Algorithm};
use std::sync::Arc;

/// Bounds on what a device is given.
#[derive(Clone, Copy, Debug)]
pub struct BatchCapacity {
    /// Most configurations placed and tested for contact at a time.
    pub chunk: usize,
    /// Most configurations solved by one dispatch in f32; in f64 all of a section are.
    pub batch: usize,
    /// Most proxy nodes in contact in one configuration, at most 64, or 32 in f32; more are solved on the CPU.
    pub contacts: usize,
    /// Whether f64 is used where the device has it.
    pub double: bool,
    /// How many sections of configurations are under way at a time, each with buffers of its own.
    pub in_flight: usize,
}

impl Default for BatchCapacity {
    /// Enough to keep a large GPU busy while the host turns to what it has found.
    fn default() -> Self {
        Self { chunk: 1 << 16, batch: 1 << 15, contacts: CONTACTS, double: true, in_flight: 3 }
    }
}

/// Most memory that one buffer takes, on a GPU and on a software rasteriser, whose memory is the host's [B]. There are
/// a few of such a size a section in flight. No adapter tells how much memory it has: where it runs out, there is
/// another try with half the room.
const HARDWARE_BUDGET: u64 = 128 << 20;
const SOFTWARE_BUDGET: u64 = 16 << 20;

/// The same for the workspaces of the search in f64: some thousand configurations on a GPU, which fill it.
const HARDWARE_WORKSPACES: u64 = 1 << 30;
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
        let clusters = model.object.triangles.len().div_ceil(shaders::CLUSTER);
        let workspace = 16 * (model.compliance.nodes.len() + 2 * clusters);
        let touches = size_of::<Touch>() * contacts;
        let placed = 24 * nodes.max(model.chain.joints.len());
        let chunk = self.chunk.clamp(1, fit(placed.max(touches)));
        Self { chunk, batch: self.batch.clamp(1, fit(workspace.max(touches)).min(chunk)), contacts, ..self }
    }

    /// Cut to what workspaces of so many bytes may take in all.
    fn for_workspaces(self, context: &Context, bytes: usize) -> Self {
        let budget = if context.adapter().hardware { HARDWARE_WORKSPACES } else { SOFTWARE_WORKSPACES };
        let budget = budget.min(context.binding_limit()) as usize;
        let chunk = budget.checked_div(bytes).map_or(self.chunk, |most| self.chunk.min(most).max(1));
        Self { chunk, batch: self.batch.min(chunk), ..self }
    }

    /// Half of each, contacts aside.
    fn half(self) -> Self {
        Self { chunk: (self.chunk / 2).max(1), batch: (self.batch / 2).max(1), ..self }
    }
}

/// The kernels behind detection, and what each section in flight has of its own for them.
enum Solving {
    /// From the rest state to the equilibrium, in f64.
    Search(Box<Search>, Vec<SearchLane>),
    /// Forces in f32, which the host settles.
    Forces(Box<ForceSearch>, Vec<ForceLane>),
}

/// All stages of a model on a device.
pub struct Pipeline<'a> {
    context: Arc<Context>,
    model: &'a contact::Model<'a>,
    room: BatchCapacity,
    /// One of each section in flight.
    detections: Vec<Detection>,
    solving: Solving,
}

impl<'a> Pipeline<'a> {
    /// The stages of `model` on the device of `context`, with `room` or as much of it as the device has.
    pub(super) fn new(
        context: Arc<Context>,
        model: &'a contact::Model<'a>,
        room: BatchCapacity,
    ) -> Result<Self, GpuError> {
        let mut room = room.within(&context, model);
        loop {
            match Self::with_room(Arc::clone(&context), model, room) {
                Err(GpuError::OutOfMemory(_)) if room.chunk > 1 => room = room.half(),
                made => return made,
            }
        }
    }

    fn with_room(context: Arc<Context>, model: &'a contact::Model<'a>, room: BatchCapacity) -> Result<Self, GpuError> {
        let device = DeviceModel::new(&context, model)?;
        let in_double = room.double && context.adapter().double;
        let double = in_double.then(|| DoubleModel::new(&context, model)).transpose()?;
        let gap_band = device.gap_band;
        let search = match &double {
            Some(double) if is_searched(&context, model) => {
                let model = SearchModel::new(&context, model, gap_band, room.contacts)?;
                Some((Search::new(&context, model)?, double))
            }
            _ => None,
        };
        let workspace = search.as_ref().map_or(0, |(search, _)| search.model.workspace());
        let room = room.for_workspaces(&context, workspace);
        let detections = (0..room.in_flight.max(1))
            .map(|_| Detection::new(&context, model, &device, room.chunk, double.as_ref()))
            .collect::<Result<Vec<_>, _>>()?;
        let solving = match search {
            Some((search, double)) => {
                let lane = |detection| SearchLane::new(&context, &search, double, detection, room.chunk);
                let lanes = detections.iter().map(lane).collect::<Result<_, _>>()?;
                Solving::Search(Box::new(search), lanes)
            }
            None => {
                let search = ForceSearch::new(&context, model, &device, room)?;
                let lane = |detection| ForceLane::new(&context, &search, &device, room, detection);
                let lanes = detections.iter().map(lane).collect::<Result<_, _>>()?;
                Solving::Forces(Box::new(search), lanes)
            }
        };
        Ok(Self { context, model, room, detections, solving })
    }

    /// The device.
    pub(super) fn context(&self) -> &Context {
        &self.context
    }
}

/// Whether equilibria of `model` are found in f64 on a device that has it: those of the energy form, where it takes the
/// compliance.
fn is_searched(context: &Context, model: &contact::Model<'_>) -> bool {
    let bytes = size_of_val(&model.compliance.entries[..]) as u64;
    model.contact.algorithm == Algorithm::Energy && bytes <= context.binding_limit()
}

impl Stages for Pipeline<'_> {
    type Ticket = wgpu::SubmissionIndex;

    fn room(&self) -> StageRoom {
        StageRoom { lanes: self.detections.len(), section: self.room.chunk, batch: self.room.batch }
    }

    fn precision(&self) -> GapPrecision {
        let detection = &self.detections[0];
        GapPrecision { band: detection.gap_band(), exact: detection.is_exact() }
    }

    fn detect(&mut self, lane: usize, section: &[JointVector]) -> Self::Ticket {
        self.detections[lane].submit(&self.context, section)
    }

    fn detected(&mut self, lane: usize, count: usize, ticket: &Self::Ticket) -> Result<Detected, GpuError> {
        self.detections[lane].collect(&self.context, count, ticket)
    }

    fn solve(&mut self, lane: usize, count: usize, batch: usize) -> Self::Ticket {
        match &mut self.solving {
            Solving::Search(search, lanes) => lanes[lane].solve(&self.context, search, count),
            Solving::Forces(search, lanes) => lanes[lane].solve(&self.context, search, count, batch),
        }
    }

    fn found(&mut self, lane: usize, count: usize, ticket: &Self::Ticket) -> Result<Found, GpuError> {
        match &mut self.solving {
            Solving::Search(search, lanes) => lanes[lane].found(&self.context, search, count, ticket),
            Solving::Forces(search, lanes) => lanes[lane].found(&self.context, search, count, ticket),
        }
    }

    fn reopen(&mut self) -> Result<(), GpuError> {
        let context = Arc::new(self.context.reopen()?);
        *self = Self::new(context, self.model, self.room.half())?;
        Ok(())
    }
}
