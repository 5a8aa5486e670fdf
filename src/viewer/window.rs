//! The viewer in a window of the desktop.

use super::{DeviceChoice, Start, TickSource, ViewError, Viewer, dress, theme};
use crate::{
    Error,
    gpu::{ADAPTER_VARIABLE, AdapterChoice, Context, GpuError},
    threads::spawn,
};
use eframe::{
    egui::{self, ViewportBuilder},
    egui_wgpu::{WgpuConfiguration, WgpuSetup, WgpuSetupExisting},
};
use std::{
    any::Any,
    panic::{AssertUnwindSafe, catch_unwind},
    sync::{
        Arc,
        atomic::{AtomicBool, Ordering},
        mpsc::{self, RecvTimeoutError},
    },
    time::{Duration, Instant},
};

/// Time between two frames where nothing but the loop moves (s): 60 a second.
const FRAME: Duration = Duration::from_micros(16_667);

/// Time between two frames of a window at rest (s): pointer, keys, a hand that moves and background work ask for one at
/// once, and what is left is a fault of the loop or a late tick.
const AT_REST: Duration = Duration::from_secs(60);

/// How often a window that a device leads looks whether the program is to end.
const LOOK: Duration = Duration::from_millis(20);

/// Longest wait for the last frame of a window that is closed.
const LAST_WORK: Duration = Duration::from_secs(1);

/// Opens a window on `start`, led by `device` where there is one, and returns when it is closed. A file that cannot be
/// read is reported before there is a window; what is wrong within it, in the window, where another one can be opened.
/// A window whose device is lost cannot draw any more: it is closed, and with it the session.
///
/// # Errors
/// When the file cannot be read, or there is no device or no display, or the device is lost.
pub fn open(start: Start, device: Option<DeviceChoice>) -> Result<(), ViewError> {
    start.check()?;
    let context = Arc::new(Context::open(AdapterChoice::Any)?);
    let hand = device;
    let (instance, adapter, device, queue) = context.shared();
    let options = eframe::NativeOptions {
        viewport: ViewportBuilder::default()
            .with_title("haptize")
            .with_inner_size(theme::WINDOW)
            .with_min_inner_size(theme::LEAST_WINDOW)
            .with_drag_and_drop(true),
        // A software rasteriser has no time to smooth gradients.
        dithering: context.adapter().hardware,
        wgpu_options: WgpuConfiguration {
            wgpu_setup: WgpuSetup::Existing(WgpuSetupExisting { instance, adapter, device, queue }),
            ..Default::default()
        },
        ..Default::default()
    };
    let device = Arc::clone(&context);
    let create: eframe::AppCreator<'_> = Box::new(move |creation| {
        let render = creation.wgpu_render_state.clone().ok_or("the window has no renderer")?;
        dress(&creation.egui_ctx);
        let folder = std::env::current_dir().unwrap_or_else(|_| ".".into());
        let mut viewer = Viewer::new(device, render, TickSource::Clock, folder)?;
        viewer.keep_files();
        if let Some(hand) = hand {
            viewer.drive(hand);
        }
        viewer.start(&start, &creation.egui_ctx);
        let open = viewer.stop().map(|stop| close_by(stop, creation.egui_ctx.clone())).transpose()?;
        Ok(Box::new(App { viewer, last: Instant::now(), _open: open }))
    });
    // egui's renderer panics where its device is lost while it paints; winit, where the display is. After that there is
    // no other window to be had from them.
    let shown = catch_unwind(AssertUnwindSafe(|| eframe::run_native("haptize", options, create)));
    // Once it has nothing to do any more, a lost device says so.
    let _ = context.device.poll(wgpu::PollType::Wait { submission_index: None, timeout: Some(LAST_WORK) });
    Err(match (context.check(), shown) {
        (Err(GpuError::Lost(why)), _) => format!(
            "the GPU that draws the window was lost, and the window with it: {why}. Start haptize view again; if this \
             comes back, update the GPU's driver, or draw on another adapter: set {ADAPTER_VARIABLE} to a part of its \
             name; haptize doctor lists them"
        ),
        (_, Ok(Ok(()))) => return Ok(()),
        (_, Ok(Err(eframe::Error::Winit(_) | eframe::Error::WinitEventLoop(_)))) => {
            "there is no display to open a window on: start haptize in a desktop session, or draw one picture without a \
             display by haptize view --screenshot FILE.png"
                .to_owned()
        }
        (_, Ok(Err(other))) => format!(
            "no window can be opened: {other}. haptize view --screenshot FILE.png draws one picture without a window"
        ),
        (_, Err(panic)) => format!(
            "the window ended unexpectedly: {}. Start haptize view again; if the display was there all the time, please \
             report this with the output of haptize doctor",
            words(panic.as_ref())
        ),
    }
    .into())
}

/// Closes the window of `egui` when `stop` is raised, until what is returned is dropped.
fn close_by(stop: &'static AtomicBool, egui: egui::Context) -> Result<mpsc::Sender<()>, Error> {
    let (open, closed) = mpsc::channel();
    spawn("closer", move || {
        while closed.recv_timeout(LOOK) == Err(RecvTimeoutError::Timeout) {
            if stop.load(Ordering::Relaxed) {
                egui.send_viewport_cmd(egui::ViewportCommand::Close);
                return egui.request_repaint();
            }
        }
    })?;
    Ok(open)
}

/// Returns the message of a panic.
fn words(panic: &(dyn Any + Send)) -> &str {
    let whole = panic.downcast_ref::<String>().map(String::as_str);
    whole.or_else(|| panic.downcast_ref::<&str>().copied()).unwrap_or("without a word")
}

struct App {
    viewer: Viewer,
    last: Instant,
    /// While it is there, a thread may close the window.
    _open: Option<mpsc::Sender<()>>,
}

impl eframe::App for App {
    fn ui(&mut self, ui: &mut egui::Ui, _: &mut eframe::Frame) {
        if self.viewer.is_lost().is_none() {
            let now = Instant::now();
            self.viewer.advance((now - self.last).as_secs_f64(), ui.ctx());
            self.last = now;
            self.viewer.ui(ui);
        }
        if self.viewer.is_lost().is_some() {
            // Before this frame or in it: there is nothing left to paint with, and egui's renderer panics where it
            // tries.
            ui.ctx().graphics_mut(|painted| *painted = egui::layers::GraphicLayers::default());
            ui.ctx().send_viewport_cmd(egui::ViewportCommand::Close);
            return;
        }
        ui.ctx().request_repaint_after(if self.viewer.is_at_rest() { AT_REST } else { FRAME });
    }
}
