//! The cost of each effect of a scene, alone and in the scene, beside the same scene without it in the same run.
//!
//! *Plain* is the scene without effects and without graphics: no contact force is stored, no frame drawn. `graphics`
//! adds the graphics loop, each of the others one effect with the scene's own value, or a usual one where the scene
//! does not name it. The *whole* scene has all effects that it names, or, where it names none, all that can act
//! together; what an effect costs within it is the whole with the effect over the whole without. All of them are
//! haptized, felt along the same motion, and drawn under the same forces, in rounds: what a busy machine does in
//! between falls on all alike, and every second round goes backwards, so that what drifts does, too. A cost is the
//! least time of the rounds over the least of the baseline; median and greatest show the spread. The baseline of bakes,
//! ticks and size is the plain scene, that of frames and of device memory is `graphics`.

mod figure;
mod measure;
mod page;

pub(super) use figure::figure;
pub use measure::price;
pub(super) use page::{csv, describe, html};

use super::Cost;
use crate::gpu::FrameCost;
use serde::Serialize;

/// Cost of a variant of the scene, relative to another.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Costs {
    /// Haptization on the CPU.
    pub bake: Cost,
    /// A tick of the haptic loop.
    pub tick: Cost,
    /// A frame on the CPU; none where either has no graphics.
    pub frame: Option<Cost>,
    /// A frame on the GPU; none without graphics or without an adapter.
    pub gpu_frame: Option<Cost>,
    /// GPU memory; none where the baseline takes nothing (1).
    pub device: Option<f64>,
    /// Size of the dataset without the scene's text (1).
    pub dataset: f64,
}

impl Costs {
    /// Column by column, as the figure, the page and the table show them.
    fn columns(&self) -> [Option<Cost>; 6] {
        let exact = |ratio: f64| Cost { median: ratio, least: ratio, greatest: ratio };
        let Self { bake, tick, frame, gpu_frame, device, dataset } = *self;
        [Some(bake), Some(tick), frame, gpu_frame, device.map(exact), Some(exact(dataset))]
    }
}

/// Cost of one variant of the scene.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Price {
    /// `plain`, `graphics`, the key of an effect, or `whole`.
    pub name: String,
    /// Its value in the scene's text; empty where there is none.
    pub setting: String,
    /// Over the baseline.
    pub alone: Costs,
    /// For an effect: the whole scene with it over the whole without it; absent if they cannot act together.
    pub within: Option<Costs>,
    /// GPU memory of the graphics (bytes): zero without graphics, absent without an adapter.
    pub device: Option<FrameCost>,
    /// Size of the dataset without the scene's text (B).
    pub dataset_bytes: usize,
}

impl Price {
    /// Both costs, column by column.
    fn columns(&self) -> [[Option<Cost>; 2]; 6] {
        let (alone, within) = (self.alone.columns(), self.within.map_or([None; 6], |within| within.columns()));
        std::array::from_fn(|column| [alone[column], within[column]])
    }
}

/// Cost of the baselines themselves, minimum of the rounds.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Baseline {
    /// Haptization of the plain scene (s).
    pub bake: f64,
    /// A tick of it (s).
    pub tick: f64,
    /// A frame on the CPU (s).
    pub frame: f64,
    /// A frame on the GPU (s); none without an adapter.
    pub gpu_frame: Option<f64>,
}

/// All that was priced.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Effects {
    /// Plain first, then graphics, each effect, and the whole.
    pub prices: Vec<Price>,
    /// Rounds that were timed.
    pub rounds: usize,
    /// The baseline of the relative costs.
    pub baseline: Baseline,
    /// Share of the ticks in contact, in the plain scene (1).
    pub in_contact: f64,
    /// Nodes of the object that is drawn.
    pub nodes: usize,
    /// The adapter, where there is one.
    pub adapter: Option<String>,
    /// Effects that could not be priced here, and why.
    pub notes: Vec<String>,
}

impl Effects {
    /// The price of that name.
    #[must_use]
    pub fn of(&self, name: &str) -> Option<&Price> {
        self.prices.iter().find(|price| price.name == name)
    }

    /// Title of each column, and what its baseline takes.
    fn heads(&self) -> [(&'static str, String); 6] {
        let Baseline { bake, tick, frame, gpu_frame } = self.baseline;
        let none = || "no adapter".to_owned();
        let device = self.of("graphics").and_then(|graphics| graphics.device);
        let plain = self.prices.first().map_or(0, |plain| plain.dataset_bytes);
        [
            ("Bake", format!("1 = {bake:.2} s")),
            ("Tick", format!("1 = {:.2} µs", 1e6 * tick)),
            ("Frame, CPU", format!("1 = {:.3} ms", 1e3 * frame)),
            ("Frame, GPU", gpu_frame.map_or_else(none, |frame| format!("1 = {:.3} ms", 1e3 * frame))),
            ("GPU memory", device.map_or_else(none, |device| format!("1 = {:.0} kB", 1e-3 * device.bytes as f64))),
            ("Dataset", format!("1 = {:.0} kB", 1e-3 * plain as f64)),
        ]
    }
}
