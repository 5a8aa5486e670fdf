//! What each effect of a scene costs, alone and all together, beside the plain scene of the same run.
//!
//! *Plain* is the scene without effects and without graphics: no contact force is stored, no frame drawn. `graphics` adds the
//! graphics loop, each of the others one effect with the scene's own value, or a usual one where the scene does not name
//! it. All of them are haptized, felt along the same motion, and drawn under the same forces, in rounds: what a busy machine
//! does in between falls on all alike, and every second round goes backwards, so that what drifts does, too. A cost is the
//! least time of the [`REPEATS`](super::REPEATS) rounds over the least of the baseline; median and greatest show the spread. The
//! baseline of bakes, ticks and size is the plain scene, that of frames and of device memory is `graphics`.

mod figure;
mod measure;
mod page;

pub(super) use figure::figure;
pub use measure::price;
pub(super) use page::{csv, describe, html};

use super::Cost;
use crate::gpu::FrameCost;
use serde::Serialize;

/// What one variant of the scene costs.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Price {
    /// `plain`, `graphics`, the key of an effect, or `all together`.
    pub name: String,
    /// Its value in the scene's text; empty where there is none.
    pub setting: String,
    /// Haptization on the CPU.
    pub bake: Cost,
    /// A tick of the haptic loop.
    pub tick: Cost,
    /// A frame on the CPU; none without graphics.
    pub frame: Option<Cost>,
    /// A frame on the GPU; none without graphics or without an adapter.
    pub gpu_frame: Option<Cost>,
    /// What the graphics takes of the GPU: nothing without graphics; unknown without an adapter.
    pub device: Option<FrameCost>,
    /// Size of the dataset without the scene's text [B].
    pub dataset_bytes: usize,
}

/// What the baselines themselves take, least of the rounds.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Baseline {
    /// Haptization of the plain scene [s].
    pub bake: f64,
    /// A tick of it [s].
    pub tick: f64,
    /// A frame on the CPU [s].
    pub frame: f64,
    /// A frame on the GPU [s]; none without an adapter.
    pub gpu_frame: Option<f64>,
}

/// All that was priced.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Effects {
    /// Plain first, then graphics, each effect alone, and all together.
    pub prices: Vec<Price>,
    /// What costs are relative to.
    pub baseline: Baseline,
    /// Share of the ticks in contact, in the plain scene [1].
    pub in_contact: f64,
    /// Nodes of the object that is drawn.
    pub nodes: usize,
    /// The adapter, where there is one.
    pub adapter: Option<String>,
    /// What could not be priced here, and why.
    pub notes: Vec<String>,
}

impl Effects {
    /// The price of that name.
    #[must_use]
    pub fn of(&self, name: &str) -> Option<&Price> {
        self.prices.iter().find(|price| price.name == name)
    }

    /// Ratios of one price, column by column, as the figure, the page and the table show them.
    fn columns(&self, price: &Price) -> [Option<Cost>; 6] {
        let ratio = |part: f64, whole: f64| {
            let ratio = part / whole;
            (whole > 0.0).then_some(Cost { median: ratio, least: ratio, greatest: ratio })
        };
        let drawn = self.of("graphics").and_then(|graphics| graphics.device).map_or(0.0, |device| device.bytes as f64);
        let plain = self.prices.first().map_or(0.0, |plain| plain.dataset_bytes as f64);
        let device = price.device.and_then(|device| ratio(device.bytes as f64, drawn));
        let size = ratio(price.dataset_bytes as f64, plain);
        [Some(price.bake), Some(price.tick), price.frame, price.gpu_frame, device, size]
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
