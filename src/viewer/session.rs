//! A dataset being felt: its haptic loop, what was felt lately, and the panels that belong to it alone.

use super::{
    cloud::Cloud,
    controls::Controls,
    feel::{Feel, Pace},
    guide::Guide,
    history::History,
    loaded::Loaded,
    slices::Slices,
    theme::{FINE_GAP, GAP, PLANE_WIDGETS, ROOM_FOR_BOTH},
};
use crate::{JointVector, gpu::Context, render::passivity::Bound};
use eframe::egui::Ui;
use std::sync::Arc;

/// A dataset being felt.
pub struct Session {
    pub loaded: Loaded,
    pub feel: Feel,
    pub history: History,
    slices: Slices,
    cloud: Cloud,
    pub controls: Controls,
    /// Gains that are beyond their bound.
    pub exceeded: Vec<Bound>,
    /// Whether the cloud is shown where there is no height for plane and cloud.
    cloud_first: bool,
}

impl Session {
    /// Begins to feel `loaded`.
    ///
    /// # Errors
    /// In words, when it cannot be felt as the scene has it.
    pub fn new(
        loaded: Loaded,
        context: &Arc<Context>,
        pace: Pace,
        wake: impl Fn() + Send + 'static,
    ) -> Result<Self, String> {
        let controls = Controls::new(&loaded, context, wake);
        let gains = &controls.tuning.haptics;
        let (haptics, exceeded) = loaded.tuned(gains).map_err(|error| error.to_string())?;
        let history = History::new(haptics.period()).ok_or("no memory for histograms; close other programs")?;
        let feel = Feel::start(haptics, gains, Guide::new(&loaded), pace)?;
        let (slices, cloud) = (Slices::new(&loaded.dataset), Cloud::new(&loaded.dataset));
        Ok(Self { loaded, feel, history, slices, cloud, controls, exceeded, cloud_first: false })
    }

    /// Plane and cloud of C-space, one below the other, or one of them where there is no height for both.
    pub fn configuration_space(&mut self, ui: &mut Ui, q: &JointVector) {
        let both = ui.available_height() > ROOM_FOR_BOTH;
        ui.horizontal(|ui| {
            ui.heading("C-space");
            if !both {
                ui.selectable_value(&mut self.cloud_first, false, "Plane");
                ui.selectable_value(&mut self.cloud_first, true, "Cloud");
            }
        });
        if both || !self.cloud_first {
            let room = ui.available_height() - PLANE_WIDGETS;
            let height = if both { 0.5 * room } else { room };
            self.slices.show(ui, &self.loaded, q, &self.history, height);
            ui.add_space(GAP);
        }
        if both || self.cloud_first {
            let height = ui.available_height() - FINE_GAP;
            self.cloud.show(ui, &self.loaded, q, height);
        }
    }

    /// Goes on with gains and effects of the controls, the hand where it is.
    ///
    /// # Errors
    /// In words, when they do not make a loop.
    pub fn retune(&mut self, pace: Pace) -> Result<(), String> {
        let gains = &self.controls.tuning.haptics;
        let (haptics, exceeded) = self.loaded.tuned(gains).map_err(|error| error.to_string())?;
        let guide = self.feel.guide().clone();
        let history = History::new(haptics.period()).ok_or("no memory for histograms; close other programs")?;
        self.feel = Feel::start(haptics, gains, guide, pace)?;
        (self.history, self.exceeded) = (history, exceeded);
        Ok(())
    }
}
