//! The viewer in a window of the desktop.

use super::{Pace, Start, ViewError, Viewer, dress, theme};
use crate::gpu::{AdapterChoice, Context};
use eframe::{
    egui::{self, ViewportBuilder},
    egui_wgpu::{WgpuConfiguration, WgpuSetup, WgpuSetupExisting},
};
use std::{
    sync::Arc,
    time::{Duration, Instant},
};

/// Time between two frames where nothing but the loop moves [s]: 60 a second.
const FRAME: Duration = Duration::from_micros(16_667);

/// Longest time that one frame makes up for [s]: after a pause of the window the object goes on from where it was.
const LONGEST_FRAME: f64 = 0.2;

/// Opens a window on `start` and returns when it is closed. A file that cannot be read is told before there is a window;
/// what is wrong within it, in the window, where another one can be opened.
///
/// # Errors
/// When the file cannot be read, or there is no device or no display.
pub fn open(start: Start) -> Result<(), ViewError> {
    start.check()?;
    let context = Arc::new(Context::open(AdapterChoice::Any)?);
    let (instance, adapter, device, queue) = context.shared();
    let options = eframe::NativeOptions {
        viewport: ViewportBuilder::default()
            .with_title("haptize")
            .with_inner_size(theme::WINDOW)
            .with_min_inner_size(theme::LEAST_WINDOW)
            .with_drag_and_drop(true),
        wgpu_options: WgpuConfiguration {
            wgpu_setup: WgpuSetup::Existing(WgpuSetupExisting { instance, adapter, device, queue }),
            ..Default::default()
        },
        ..Default::default()
    };
    let shown = eframe::run_native(
        "haptize",
        options,
        Box::new(move |creation| {
            let render = creation.wgpu_render_state.clone().ok_or("the window has no renderer")?;
            dress(&creation.egui_ctx);
            let folder = std::env::current_dir().unwrap_or_else(|_| ".".into());
            let mut viewer = Viewer::new(context, render, Pace::Clock, folder)?;
            viewer.start(&start, &creation.egui_ctx);
            Ok(Box::new(App { viewer, last: Instant::now() }))
        }),
    );
    shown.map_err(|error| match error {
        eframe::Error::Winit(_) | eframe::Error::WinitEventLoop(_) => ViewError::NoDisplay,
        other => ViewError::Window(other.to_string()),
    })
}

struct App {
    viewer: Viewer,
    last: Instant,
}

impl eframe::App for App {
    fn ui(&mut self, ui: &mut egui::Ui, _: &mut eframe::Frame) {
        let now = Instant::now();
        self.viewer.advance((now - self.last).as_secs_f64().min(LONGEST_FRAME), ui.ctx());
        self.last = now;
        self.viewer.ui(ui);
        ui.ctx().request_repaint_after(FRAME);
    }
}
