//! The viewer in a window of the desktop.

use super::{DeviceChoice, Rescue, Start, TickSource, ViewError, Viewer, dress, theme};
use crate::gpu::{AdapterChoice, Context, GpuError};
use eframe::{
    egui::{self, ViewportBuilder},
    egui_wgpu::{WgpuConfiguration, WgpuSetup, WgpuSetupExisting},
};
use std::{
    any::Any,
    cell::Cell,
    panic::{AssertUnwindSafe, catch_unwind},
    rc::Rc,
    sync::{
        Arc,
        atomic::{AtomicBool, Ordering},
        mpsc::{self, RecvTimeoutError},
    },
    thread,
    time::{Duration, Instant},
};

/// Time between two frames where nothing but the loop moves (s): 60 a second.
const FRAME: Duration = Duration::from_micros(16_667);

/// Time between two frames of a window at rest (s): pointer, keys, a hand that moves and background work ask for one at
/// once, and what is left is a fault of the loop or a late tick.
const AT_REST: Duration = Duration::from_secs(60);

/// Least time that a window lasts which was opened again, for another one to be opened when its device is lost, too
/// [s]: one that is lost again and again is no use.
const LEAST_LIFE: Duration = Duration::from_secs(30);

/// How often a window that a device leads looks whether the program is to end.
const LOOK: Duration = Duration::from_millis(20);

/// Longest wait for the last frame of a window that is closed.
const LAST_WORK: Duration = Duration::from_secs(1);

/// Opens a window on `start`, led by `device` where there is one, and returns when it is closed. A file that cannot be
/// read is reported before there is a window; what is wrong within it, in the window, where another one can be opened.
/// A window whose device is lost cannot draw any more: it is closed, and another one opened on a new device.
///
/// # Errors
/// When the file cannot be read, there is no device or no display, or the device is lost again and again.
pub fn open(start: Start, device: Option<DeviceChoice>) -> Result<(), ViewError> {
    start.check()?;
    let mut context = Arc::new(Context::open(AdapterChoice::Any)?);
    let mut begin = Begin::Start(start, device);
    loop {
        let (opened, is_anew) = (Instant::now(), matches!(begin, Begin::Resume(..)));
        let Some((rescue, why)) = show(&context, begin)? else { return Ok(()) };
        if is_anew && opened.elapsed() < LEAST_LIFE {
            return Err(ViewError::Lost(why));
        }
        context = Arc::new(context.reopen()?);
        begin = Begin::Resume(Box::new(rescue), why);
    }
}

/// The state that a window begins with.
enum Begin {
    Start(Start, Option<DeviceChoice>),
    Resume(Box<Rescue>, String),
}

/// A window on the device of `context`, until it is closed; answers with what is left where the device was lost, and
/// why.
fn show(context: &Arc<Context>, begin: Begin) -> Result<Option<(Rescue, String)>, ViewError> {
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
    let left = Rc::new(Cell::new(None));
    let (device, leave) = (Arc::clone(context), Rc::clone(&left));
    let create: eframe::AppCreator<'_> = Box::new(move |creation| {
        let render = creation.wgpu_render_state.clone().ok_or("the window has no renderer")?;
        dress(&creation.egui_ctx);
        let folder = std::env::current_dir().unwrap_or_else(|_| ".".into());
        let mut viewer = Viewer::new(device, render, TickSource::Clock, folder)?;
        match begin {
            Begin::Start(start, device) => {
                if let Some(device) = device {
                    viewer.drive(device);
                }
                viewer.start(&start, &creation.egui_ctx);
            }
            Begin::Resume(rescue, why) => viewer.resume(*rescue, &why, &creation.egui_ctx),
        }
        let open = viewer.stop().map(|stop| close_by(stop, creation.egui_ctx.clone())).transpose()?;
        Ok(Box::new(App { viewer, last: Instant::now(), egui: creation.egui_ctx.clone(), leave, _open: open }))
    });
    // egui's renderer panics where its device is lost while it paints; winit, where the display is. After that there is
    // no other window to be had from them.
    let shown = catch_unwind(AssertUnwindSafe(|| eframe::run_native("haptize", options, create)));
    // Once it has nothing to do any more, a lost device says so.
    let _ = context.device.poll(wgpu::PollType::Wait { submission_index: None, timeout: Some(LAST_WORK) });
    match (context.check(), shown) {
        (Err(GpuError::Lost(why)), shown) => match (shown, left.take()) {
            (Ok(_), Some(rescue)) => Ok(Some((rescue, why))),
            _ => Err(ViewError::Lost(why)),
        },
        (_, Ok(Ok(()))) => Ok(None),
        (_, Ok(Err(eframe::Error::Winit(_) | eframe::Error::WinitEventLoop(_)))) => Err(ViewError::NoDisplay),
        (_, Ok(Err(other))) => Err(ViewError::Window(other.to_string())),
        (_, Err(panic)) => Err(ViewError::Ended(words(panic.as_ref()).to_owned())),
    }
}

/// Closes the window of `egui` when `stop` is raised, until what is returned is dropped.
fn close_by(stop: &'static AtomicBool, egui: egui::Context) -> std::io::Result<mpsc::Sender<()>> {
    let (open, closed) = mpsc::channel();
    thread::Builder::new().name("closer".into()).spawn(move || {
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
    egui: egui::Context,
    /// Its state, once it is closed.
    leave: Rc<Cell<Option<Rescue>>>,
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

impl Drop for App {
    fn drop(&mut self) {
        self.leave.set(Some(self.viewer.rescue(&self.egui)));
    }
}
