//! The viewer: its state, what happens in a frame, and where its panels lie. It knows neither window nor clock: `window.rs`
//! and `offscreen.rs` call [`Viewer::ui`] with the time that went by.

use super::{
    ViewError,
    cloud::Cloud,
    controls::Controls,
    feel::{Feel, Pace},
    files::Files,
    guide::Guide,
    history::History,
    job::{Job, Outcome, Task},
    loaded::Loaded,
    number,
    plots::Plots,
    scene::SceneView,
    slices::Slices,
    theme::{GAP, GROUP_GAP},
};
use crate::{JointVector, gpu::Context, haptize::BackendChoice, render::passivity::Bound, scene::Scene};
use eframe::{
    egui::{
        self, Align, Button, CentralPanel, Frame, Layout, Margin, Panel, ProgressBar, RichText, ScrollArea, Slider, Ui,
        vec2,
    },
    egui_wgpu::RenderState,
};
use std::{
    path::{Path, PathBuf},
    sync::Arc,
};

/// What is opened first.
#[derive(Clone, Debug)]
pub enum Start {
    /// The paper's sphere, baked.
    Sphere,
    /// A scene or a dataset.
    File(PathBuf),
}

/// The paper's sphere, part of the program.
const SPHERE: &str = include_str!("../../datasets/sphere.toml");

/// The viewer.
pub struct Viewer {
    context: Arc<Context>,
    pace: Pace,
    session: Option<Session>,
    scene: SceneView,
    plots: Plots,
    files: Files,
    job: Option<Job>,
    backend: BackendChoice,
    /// What went wrong, until it is dismissed.
    error: Option<String>,
}

/// A dataset being felt.
struct Session {
    loaded: Loaded,
    feel: Feel,
    history: History,
    slices: Slices,
    cloud: Cloud,
    controls: Controls,
    exceeded: Vec<Bound>,
    /// Whether the cloud is shown where there is no height for plane and cloud.
    cloud_first: bool,
}

/// Height from which on plane and cloud of C-space find room [points].
const ROOM_FOR_BOTH: f32 = 470.0;

/// Height of everything about a plane but its heat map [points].
const SLICE_WIDGETS: f32 = 150.0;

impl Session {
    fn new(loaded: Loaded, pace: Pace, wake: impl Fn() + Send + 'static) -> Result<Self, String> {
        let controls = Controls::new(&loaded, wake);
        let (haptics, exceeded) = loaded.tuned(&controls.gains).map_err(|error| error.to_string())?;
        let history = History::new(haptics.period()).ok_or("no memory for histograms; close other programs")?;
        let feel = Feel::start(haptics, &controls.gains, Guide::new(&loaded), pace)?;
        let (slices, cloud) = (Slices::new(&loaded.dataset), Cloud::new(&loaded.dataset));
        Ok(Self { loaded, feel, history, slices, cloud, controls, exceeded, cloud_first: false })
    }

    /// Plane and cloud of C-space, one below the other, or one of them where there is no height for both.
    fn configuration_space(&mut self, ui: &mut Ui, q: &JointVector) {
        let both = ui.available_height() > ROOM_FOR_BOTH;
        ui.horizontal(|ui| {
            ui.heading("C-space");
            if !both {
                ui.selectable_value(&mut self.cloud_first, false, "Plane");
                ui.selectable_value(&mut self.cloud_first, true, "Cloud");
            }
        });
        if both || !self.cloud_first {
            let below = if both { 0.5 * (ui.available_height() - 150.0) } else { 0.0 };
            let height = ui.available_height() - SLICE_WIDGETS - below;
            self.slices.show(ui, &self.loaded, q, &self.history, height);
            ui.add_space(GAP);
        }
        if both || self.cloud_first {
            let height = ui.available_height() - 2.0;
            self.cloud.show(ui, &self.loaded, q, height);
        }
    }

    /// Goes on with the gains of the controls, the hand where it is.
    fn retune(&mut self, pace: Pace) -> Result<(), String> {
        let (haptics, exceeded) = self.loaded.tuned(&self.controls.gains).map_err(|error| error.to_string())?;
        let guide = self.feel.guide().clone();
        let history = History::new(haptics.period()).ok_or("no memory for histograms; close other programs")?;
        self.feel = Feel::start(haptics, &self.controls.gains, guide, pace)?;
        (self.history, self.exceeded) = (history, exceeded);
        Ok(())
    }
}

impl Viewer {
    /// A viewer that draws through `render`, whose device is that of `context`; files go to `folder`. Its windows want to
    /// be [`dress`]ed.
    ///
    /// # Errors
    /// When the device refuses the drawing shaders.
    pub fn new(context: Arc<Context>, render: RenderState, pace: Pace, folder: PathBuf) -> Result<Self, ViewError> {
        Ok(Self {
            scene: SceneView::new(Arc::clone(&context), render)?,
            context,
            pace,
            session: None,
            plots: Plots::default(),
            files: Files::new(folder),
            job: None,
            backend: BackendChoice::Auto,
            error: None,
        })
    }

    /// Begins to open `start`.
    pub fn start(&mut self, start: &Start, egui: &egui::Context) {
        match start {
            Start::Sphere => match Scene::parse(SPHERE, "datasets/sphere.toml") {
                Ok(scene) => self.begin(Task::Bake(Arc::new(scene)), egui),
                Err(error) => self.error = Some(error.to_string()),
            },
            Start::File(path) => self.open_file(path, egui),
        }
    }

    /// Begins to open a scene or a dataset.
    fn open_file(&mut self, path: &Path, egui: &egui::Context) {
        self.files.remember(path);
        self.begin(Task::Open(path.to_owned()), egui);
    }

    fn begin(&mut self, task: Task, egui: &egui::Context) {
        self.error = None;
        let egui = egui.clone();
        match Job::begin(task, self.backend, Arc::clone(&self.context), move || egui.request_repaint()) {
            Ok(job) => self.job = Some(job),
            Err(error) => self.error = Some(error),
        }
    }

    /// Waits until what is being opened is open; for pictures and tests.
    pub fn wait(&mut self, egui: &egui::Context) {
        if let Some(job) = self.job.take() {
            self.take(job.wait(), egui);
        }
    }

    fn take(&mut self, outcome: Outcome, egui: &egui::Context) {
        match outcome {
            Outcome::Cancelled => {}
            Outcome::Failed(reason) => self.error = Some(reason),
            Outcome::Loaded(loaded) => {
                let opened = self.scene.open(&loaded).map_err(|error| error.to_string());
                let egui = egui.clone();
                match opened.and_then(|()| Session::new(*loaded, self.pace, move || egui.request_repaint())) {
                    Ok(mut session) => {
                        if let Some(before) = &self.session {
                            session.controls.keep(&before.controls);
                        }
                        self.session = Some(session);
                    }
                    Err(reason) => self.error = Some(reason),
                }
                self.plots.reset();
            }
        }
    }

    /// What went wrong last, if that has not been dismissed.
    #[must_use]
    pub fn error(&self) -> Option<&str> {
        self.error.as_deref()
    }

    /// Lets motion `name` of the scene lead the hand; false where it has none such.
    pub fn play(&mut self, name: &str) -> bool {
        let Some(session) = &self.session else { return false };
        let mut guide = session.feel.guide();
        let number = guide.names().iter().position(|known| *known == name);
        number.inspect(|&number| guide.play(number)).is_some()
    }

    /// Time in the motion that leads, and its duration [s].
    #[must_use]
    pub fn time_in_motion(&self) -> Option<(f64, f64)> {
        self.session.as_ref()?.feel.guide().time()
    }

    /// Size of the contact torque now [N m]; none before the first tick.
    #[must_use]
    pub fn contact_torque(&self) -> Option<f64> {
        Some(self.session.as_ref()?.history.last()?.contact_torque.norm())
    }

    /// Where the proxy's last node is shown, when the 3-D scene fills `rect`.
    #[must_use]
    pub fn tip_in(&self, rect: egui::Rect) -> Option<egui::Pos2> {
        self.scene.tip_in(rect)
    }

    /// Lets `elapsed` [s] go by: the loop where it runs by steps, the object, and what is in the background.
    pub fn advance(&mut self, elapsed: f64, egui: &egui::Context) {
        if let Some(outcome) = self.job.as_mut().and_then(Job::poll) {
            self.job = None;
            self.take(outcome, egui);
        }
        let Some(session) = &mut self.session else { return };
        session.feel.step((elapsed / session.loaded.setup.haptics.period()).round() as usize);
        session.history.collect(&mut session.feel);
        let latest = session.feel.latest();
        if let Err(error) = self.scene.advance(&session.loaded, &latest, elapsed) {
            self.error = Some(error.to_string());
        }
    }

    /// The whole window.
    pub fn ui(&mut self, ui: &mut Ui) {
        let dropped = ui.input(|input| input.raw.dropped_files.first().map(|file| file.path().to_owned()));
        if let Some(path) = dropped {
            self.open_file(&path, &ui.ctx().clone());
        }
        Panel::top("bar").frame(bar(ui)).show(ui, |ui| self.bar(ui));
        Panel::bottom("status").frame(bar(ui)).show(ui, |ui| self.status(ui));
        if self.session.is_some() {
            self.panels(ui);
        } else {
            CentralPanel::default().show(ui, |ui| self.welcome(ui));
        }
        if let Some(path) = self.files.show(ui) {
            self.open_file(&path, &ui.ctx().clone());
        }
        self.complaint(ui);
    }

    /// Title, opening, motions, theme.
    fn bar(&mut self, ui: &mut Ui) {
        ui.horizontal(|ui| {
            ui.heading("haptize");
            if let Some(session) = &self.session {
                let name = ui.label(RichText::new(&session.loaded.name).weak());
                if let Some(file) = &session.loaded.file {
                    name.on_hover_text(file.display().to_string());
                }
            }
            ui.add_space(GAP);
            if ui.button("Open…").clicked() {
                self.files.toggle();
            }
            let computed = self.session.as_ref().is_some_and(|session| session.loaded.report.is_some());
            if computed && ui.button("Save dataset").on_hover_text("Into the folder that Open… shows").clicked() {
                self.save();
            }
            ui.separator();
            if let Some(session) = &self.session {
                motions(ui, &mut session.feel.guide());
            }
            ui.with_layout(Layout::right_to_left(Align::Center), |ui| {
                let dark = ui.visuals().dark_mode;
                if ui.button(if dark { "Light" } else { "Dark" }).on_hover_text("Colours of the window").clicked() {
                    ui.ctx().set_theme(if dark { egui::Theme::Light } else { egui::Theme::Dark });
                }
                if ui.button("Reset view").on_hover_text("Or double-click the scene").clicked() {
                    self.scene.reset_view();
                }
            });
        });
    }

    /// What computes, and how the loop fares.
    fn status(&mut self, ui: &mut Ui) {
        ui.horizontal(|ui| {
            let adapter = self.context.adapter();
            ui.label(RichText::new(format!("drawn by {} ({})", short(&adapter.name), adapter.kind)).weak().small());
            let Some(session) = &self.session else { return };
            if let Some(tick) = session.history.last() {
                ui.separator();
                let contact =
                    if tick.contact { format!("{} nodes in contact", tick.contact_nodes) } else { "free".into() };
                ui.label(RichText::new(contact).small());
                ui.separator();
                ui.label(RichText::new(format!("torque {} N m", number(tick.contact_torque.norm()))).small());
                if let Some(fault) = tick.fault {
                    ui.separator();
                    ui.colored_label(ui.visuals().error_fg_color, RichText::new(fault.to_string()).small());
                    if ui.small_button("Clear fault").clicked() {
                        session.feel.clear_fault();
                    }
                }
            }
            ui.with_layout(Layout::right_to_left(Align::Center), |ui| {
                if let Some(job) = &self.job {
                    progress(ui, job, 190.0);
                    ui.label(RichText::new(&job.title).small());
                    return;
                }
                let jitter = session.history.jitter().percentiles();
                let cost = session.history.cost().percentiles();
                if cost.count > 0 && self.pace == Pace::Clock {
                    let words = format!("tick {} µs, jitter {} µs at 99 %", number(cost.p50), number(jitter.p99));
                    let refused = session.history.refused();
                    let label = ui.label(RichText::new(words).small());
                    if !refused.is_empty() {
                        label.on_hover_text(refused.join("\n"));
                    }
                }
            });
        });
    }

    fn panels(&mut self, ui: &mut Ui) {
        let Some(session) = &mut self.session else { return };
        let size = ui.available_size();
        let side = Frame::new().fill(ui.visuals().panel_fill).inner_margin(Margin::symmetric(12, 8));
        let mut asked = Default::default();
        let below = (0.27 * size.y).clamp(130.0, 320.0);
        // In a narrow window the plots get its whole width, in a wide one C-space gets its whole height.
        let narrow = size.x < NARROW;
        if narrow {
            plots_panel(ui, side, below, &mut self.plots, session, self.files.folder());
        }
        Panel::left("controls").frame(side).resizable(true).default_size(232.0).size_range(200.0..=360.0).show(
            ui,
            |ui| {
                ScrollArea::vertical().auto_shrink([false, false]).show(ui, |ui| {
                    let (controls, loaded) = (&mut session.controls, &session.loaded);
                    let object = self.scene.has_object();
                    asked = controls.show(ui, loaded, &session.exceeded, &mut self.scene.shown, object);
                });
            },
        );
        let right = (0.27 * size.x).clamp(240.0, 420.0);
        Panel::right("C-space").frame(side).resizable(true).default_size(right).show(ui, |ui| {
            let q = session.history.last().map_or_else(|| session.loaded.start(), |tick| tick.proxy);
            session.configuration_space(ui, &q);
        });
        if !narrow {
            plots_panel(ui, side, below, &mut self.plots, session, self.files.folder());
        }
        CentralPanel::no_frame().show(ui, |ui| {
            let mut guide = session.feel.guide();
            if let Err(error) = self.scene.show(ui, &session.loaded, &mut guide) {
                self.error = Some(error.to_string());
            }
        });
        self.backend = session.controls.backend;
        if asked.retune
            && let Err(error) = session.retune(self.pace)
        {
            self.error = Some(error);
        }
        if let (true, Some(scene)) = (asked.bake, session.controls.scene.clone()) {
            self.begin(Task::Bake(scene), &ui.ctx().clone());
        }
    }

    /// What is shown before there is anything to feel.
    fn welcome(&mut self, ui: &mut Ui) {
        ui.vertical_centered(|ui| {
            ui.add_space(0.32 * ui.available_height());
            match &self.job {
                Some(job) => {
                    ui.heading(&job.title);
                    ui.label(RichText::new("Contact is solved at every point of the grid over the joints, once; then it is felt at 1 kHz.").weak());
                    ui.add_space(GROUP_GAP);
                    ui.allocate_ui(vec2(420.0, 30.0), |ui| ui.horizontal(|ui| progress(ui, job, 330.0)));
                }
                None => {
                    ui.heading("Nothing is open");
                    ui.label(RichText::new("Open a scene or a dataset, or drop one on this window.").weak());
                    ui.add_space(GROUP_GAP);
                    if ui.button("Open…").clicked() {
                        self.files.toggle();
                    }
                }
            }
        });
    }

    fn complaint(&mut self, ui: &Ui) {
        let Some(error) = &self.error else { return };
        let mut dismissed = false;
        egui::Window::new("This did not work")
            .collapsible(false)
            .resizable(false)
            .anchor(egui::Align2::CENTER_CENTER, vec2(0.0, 0.0))
            .show(ui.ctx(), |ui| {
                ui.set_max_width(560.0);
                // Messages point at a line with a caret: that needs letters of one width.
                let text = RichText::new(error).color(ui.visuals().error_fg_color);
                ui.label(if error.contains('\n') { text.monospace() } else { text });
                ui.add_space(GROUP_GAP);
                dismissed = ui.add(Button::new("Dismiss").min_size(vec2(90.0, 24.0))).clicked();
            });
        if dismissed {
            self.error = None;
        }
    }

    fn save(&mut self) {
        let Some(session) = &self.session else { return };
        let file = self.files.folder().join(format!("{}.haptize", session.loaded.name.replace([' ', '/'], "-")));
        match session.loaded.dataset.save(&file) {
            Ok(()) => self.files.remember(&file),
            Err(error) => self.error = Some(error.to_string()),
        }
    }
}

/// Width of the window below which plots lie under all other panels [points].
const NARROW: f32 = 1150.0;

fn plots_panel(ui: &mut Ui, frame: Frame, height: f32, plots: &mut Plots, session: &mut Session, folder: &Path) {
    Panel::bottom("plots").frame(frame).resizable(true).default_size(height).show(ui, |ui| {
        plots.show(ui, &session.loaded, &mut session.history, folder);
    });
}

/// Motions of the scene: choose, play, pause, scrub.
fn motions(ui: &mut Ui, guide: &mut Guide) {
    let names = guide.names();
    if names.is_empty() {
        ui.label(RichText::new("drag the proxy by one of its nodes").weak());
        return;
    }
    let mut chosen = guide.playing();
    if ui.selectable_label(chosen.is_none(), "Pointer").on_hover_text("Drag the proxy by one of its nodes").clicked() {
        let goal = guide.goal();
        guide.point(goal);
    }
    for (number, name) in names.iter().enumerate() {
        let title = format!("{}{}", name[..1].to_uppercase(), &name[1..]);
        if ui.selectable_label(chosen == Some(number), title).clicked() {
            guide.play(number);
            chosen = Some(number);
        }
    }
    if let (Some((mut time, duration)), true) = (guide.time(), chosen.is_some()) {
        let text = if guide.is_running() { "Pause" } else { "Play" };
        if ui.add(Button::new(text).min_size(vec2(52.0, 0.0))).clicked() {
            guide.toggle();
        }
        ui.spacing_mut().slider_width = 120.0;
        let slider = Slider::new(&mut time, 0.0..=duration).show_value(false);
        let response = ui.add(slider);
        response.widget_info(|| egui::WidgetInfo::slider(true, time, "Time in the motion"));
        if response.changed() {
            guide.scrub(time);
        }
        ui.label(RichText::new(format!("{time:.1} of {duration:.1} s")).weak());
    }
}

fn progress(ui: &mut Ui, job: &Job, width: f32) {
    let done = job.progress();
    let share = if done.points > 0 { done.done as f32 / done.points as f32 } else { 0.0 };
    let text = if done.points == 0 {
        "preparing".to_owned()
    } else if done.rate > 0.0 {
        format!("{} of {}, {:.0} s left", done.done, done.points, (done.points - done.done) as f64 / done.rate)
    } else {
        format!("{} of {}", done.done, done.points)
    };
    let cancel = |ui: &mut Ui| {
        if ui.button("Cancel").clicked() {
            job.cancel();
        }
    };
    let bar = ProgressBar::new(share).desired_width(width).desired_height(18.0).text(RichText::new(text).small());
    ui.add(bar);
    cancel(ui);
}

fn bar(ui: &Ui) -> Frame {
    Frame::new().fill(ui.visuals().panel_fill).inner_margin(Margin::symmetric(12, 5))
}

/// The beginning of an adapter's name.
fn short(name: &str) -> &str {
    name.split(" (").next().unwrap_or(name)
}
