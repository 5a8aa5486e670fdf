//! The viewer: its state, and what happens in a frame. It knows neither window nor clock: `window.rs` and
//! `offscreen.rs` tell [`Viewer::advance`] the time that went by, and call [`Viewer::ui`], which is in `panels.rs`.

use super::{
    ViewError,
    background::Pending,
    feel::TickSource,
    files::Files,
    film::{Film, Still},
    job::{Job, JobResult, Solver, Task},
    lead::DeviceChoice,
    notice::Notice,
    offscreen::write_picture,
    placing::ObjectPlace,
    plots::Plots,
    scene::SceneView,
    session::Session,
};
use crate::{
    Error, JointVector,
    gpu::{Context, GpuError},
    input,
    render::timing::Timing,
    scene::Scene,
};
use eframe::{egui, egui_wgpu::RenderState};
use std::{
    path::{Path, PathBuf},
    sync::{Arc, atomic::AtomicBool},
    thread,
    time::Duration,
};

/// The scene or file that is opened first.
#[derive(Clone)]
pub enum Start {
    /// The paper's sphere, baked.
    Sphere,
    /// A scene, which is solved live, or a dataset.
    File(PathBuf),
    /// The dataset of a real object, and its twin.
    Twinned(PathBuf, PathBuf),
}

impl Start {
    /// Whether the file, where there is one, can be read at all.
    ///
    /// # Errors
    /// When it cannot.
    pub fn check(&self) -> Result<(), ViewError> {
        let files = match self {
            Self::Sphere => vec![],
            Self::File(path) => vec![path],
            Self::Twinned(dataset, twin) => vec![dataset, twin],
        };
        let remedy = "give a scene (.toml) or a dataset (.haptize)";
        files.into_iter().try_for_each(|path| {
            let unreadable = |error| format!("{}: cannot be read: {error}; {remedy}", path.display());
            input::open(path).map(drop).map_err(|error| unreadable(error).into())
        })
    }
}

/// The paper's sphere, part of the program.
const SPHERE: &str = include_str!("../../datasets/sphere.toml");

/// The viewer.
pub struct Viewer {
    pub(super) context: Arc<Context>,
    pub(super) pace: TickSource,
    /// The haptic device that leads; none where pointer, keys or motions do.
    device: Option<DeviceChoice>,
    pub(super) session: Option<Session>,
    pub(super) scene: SceneView,
    pub(super) plots: Plots,
    pub(super) files: Files,
    pub(super) job: Option<Job>,
    /// Backends of this machine, and the chosen one.
    pub(super) solvers: Vec<Solver>,
    pub(super) solver: Solver,
    /// What was done last, until it has faded.
    pub(super) notice: Option<Notice>,
    /// Whether the scene was changed here and not saved, and what its file held when it was read.
    pub(super) is_unsaved: bool,
    pub(super) scene_text: String,
    /// The film that is being taken.
    pub(super) film: Option<Film>,
    /// One that is being written.
    pub(super) written: Option<Pending<Result<PathBuf, Error>>>,
    /// Title of the window.
    pub(super) title: String,
    /// The last error, until it is dismissed.
    pub(super) error: Option<String>,
    /// Frames of the window a second, over the last ones, where it goes by the clock.
    pub(super) frame_rate: Option<f64>,
    /// Whether the steps from a scene to what is felt are shown.
    pub(super) shows_steps: bool,
    /// Where proxy and device were when they last moved, and since when (s).
    shown_at: (JointVector, JointVector),
    /// See `shown_at`.
    still: f64,
}

/// Samples a pixel of the 3-D scene, for smooth edges.
const SAMPLES: u32 = 4;

/// Time after which what does not move is at rest (s): the object's vibration has died down.
const SETTLED: f64 = 2.0;

/// Motion of a joint between two frames that is none, over its grid step (1): what a pixel does not show.
const UNMOVED: f64 = 1e-3;

/// Longest time between two frames of a moving window (s); a longer one was at rest.
const LONGEST_FRAME: f64 = 1.0;

/// How often is looked whether what is waited for is there.
const LOOK: Duration = Duration::from_millis(2);

/// Share of the latest frame in the frame rate that is shown (1).
const LATEST: f64 = 0.1;

impl Viewer {
    /// A viewer that draws through `render`, whose device is that of `context`; files go to `folder`. Its windows want
    /// to be `dress`ed.
    ///
    /// # Errors
    /// When the device refuses the drawing shaders.
    pub fn new(
        context: Arc<Context>,
        render: RenderState,
        pace: TickSource,
        folder: PathBuf,
    ) -> Result<Self, ViewError> {
        // A software rasteriser that has to keep up with the clock has no time for more.
        let hasty = pace == TickSource::Clock && !context.adapter().hardware;
        let samples = if hasty { 1 } else { SAMPLES };
        Ok(Self {
            scene: SceneView::new(Arc::clone(&context), render, samples)?,
            context,
            pace,
            device: None,
            session: None,
            plots: Plots::default(),
            files: Files::new(folder),
            job: None,
            solvers: Solver::all(),
            solver: Solver::Auto,
            notice: None,
            is_unsaved: false,
            scene_text: String::new(),
            title: String::new(),
            film: None,
            written: None,
            error: None,
            frame_rate: None,
            shows_steps: pace == TickSource::Clock,
            shown_at: (JointVector::zeros(0), JointVector::zeros(0)),
            still: 0.0,
        })
    }

    /// Why the window's device is lost, if it is: nothing is drawn any more.
    pub fn is_lost(&mut self) -> Option<String> {
        match self.context.check() {
            Ok(()) => None,
            Err(GpuError::Lost(why)) => Some(why),
            Err(other) => {
                self.error = Some(ViewError::from(other).to_string());
                None
            }
        }
    }

    /// The flag that ends the session of the device that leads, where there is one.
    #[must_use]
    pub fn stop(&self) -> Option<&'static AtomicBool> {
        self.device.as_ref().map(|device| device.stop)
    }

    /// Lets a haptic device lead in everything that is opened from now on.
    pub fn drive(&mut self, device: DeviceChoice) {
        self.device = Some(device);
    }

    /// Keeps the files that were opened from one window to the next; the first screen is for who opens the first one.
    pub fn keep_files(&mut self) {
        use etcetera::BaseStrategy;
        if let Ok(places) = etcetera::base_strategy::choose_native_strategy() {
            let list = places.state_dir().unwrap_or_else(|| places.data_dir()).join("haptize").join("recent");
            self.shows_steps &= !self.files.keep_in(list);
        }
    }

    /// Begins to open `start`.
    pub fn start(&mut self, start: &Start, egui: &egui::Context) {
        match start {
            Start::Sphere => match Scene::parse(SPHERE, "datasets/sphere.toml") {
                Ok(scene) => self.begin(Task::Bake(Arc::new(scene), None), egui),
                Err(error) => self.error = Some(error.to_string()),
            },
            Start::File(path) => self.open_file(path, egui),
            Start::Twinned(dataset, twin) => self.begin(Task::OpenTwinned(dataset.clone(), twin.clone()), egui),
        }
    }

    /// Begins to open a scene or a dataset.
    pub(super) fn open_file(&mut self, path: &Path, egui: &egui::Context) {
        self.files.remember(path);
        self.is_unsaved = false;
        self.begin(Task::Open(path.to_owned()), egui);
    }

    pub(super) fn begin(&mut self, task: Task, egui: &egui::Context) {
        self.error = None;
        let egui = egui.clone();
        match Job::begin(task, self.solver.clone(), Arc::clone(&self.context), move || egui.request_repaint()) {
            Ok(job) => self.job = Some(job),
            Err(error) => self.error = Some(error),
        }
    }

    /// Waits until what is being opened is open, and felt and drawn as it is to be; for pictures and tests.
    pub fn wait(&mut self) {
        loop {
            self.follow(|| ());
            if !self.is_making() {
                return;
            }
            thread::sleep(LOOK);
        }
    }

    /// Whether something is being made in the background.
    fn is_making(&self) -> bool {
        let retunes = self.session.as_ref().is_some_and(Session::is_retuning);
        self.job.is_some() || retunes || self.scene.is_redrawing()
    }

    /// Takes what was made in the background, and lets loop and object follow the controls; `wake` is called when there
    /// is news.
    fn follow(&mut self, wake: impl FnOnce() + Clone + Send + 'static) {
        if let Some(outcome) = self.job.as_mut().and_then(Job::poll) {
            self.job = None;
            self.take(outcome);
        }
        let Some(session) = &mut self.session else { return };
        let effects = &session.controls.tuning.graphics;
        let redrawn = self.scene.follow(&session.loaded, effects, wake.clone()).map_err(not_drawn);
        self.error = redrawn.and_then(|()| session.follow(wake)).err().or(self.error.take());
    }

    fn take(&mut self, outcome: JobResult) {
        match outcome {
            JobResult::Cancelled => {}
            JobResult::Failed(reason) => {
                self.error = Some(reason);
                // What was being moved is where it was.
                self.scene.placement = self.session.as_ref().and_then(|session| ObjectPlace::new(&session.loaded));
            }
            JobResult::Loaded(loaded) => {
                let (mut loaded, body) = *loaded;
                if let (true, Some(before)) = (loaded.edited, &self.session) {
                    // The arm stays where it is.
                    loaded.at = loaded.at.or_else(|| Some(before.feel.guide().goal()));
                }
                // Two sessions cannot hold one device: the one before ends first.
                let ended = self.session.take_if(|session| session.lead.is_some()).map(|session| session.controls);
                let device = self.device.as_ref();
                match Session::new(loaded, self.pace, device) {
                    Ok(mut session) => {
                        if session.loaded.edited {
                            self.is_unsaved = true;
                            self.scene.change(&session.loaded, body);
                        } else {
                            // A bake of what was changed here leaves the file as it is.
                            if let (false, Some(scene)) = (self.is_unsaved, &session.loaded.scene) {
                                self.scene_text.clone_from(&scene.text);
                            }
                            self.scene.open(&session.loaded, body);
                        }
                        if let Some(before) = ended.as_ref().or(self.session.as_ref().map(|before| &before.controls)) {
                            session.controls.keep(before);
                        }
                        self.session = Some(session);
                        self.plots.reset();
                    }
                    Err(reason) => self.error = Some(reason),
                }
            }
        }
    }

    /// Returns the last error, if it has not been dismissed.
    #[must_use]
    pub fn error(&self) -> Option<&str> {
        self.error.as_deref()
    }

    /// Lets motion `name` of the scene lead the hand; false where it has none such.
    pub fn play(&mut self, name: &str) -> bool {
        let number = self.motion(name);
        let guide = self.session.as_ref().map(|session| session.feel.guide());
        number.zip(guide).is_some_and(|(number, mut guide)| {
            guide.play(number);
            true
        })
    }

    /// Plays motion `name` of what is open, or its press, if it has one, from its beginning, where hand and proxy are
    /// put.
    ///
    /// # Errors
    /// In words, when there is no motion `name`, or the loop cannot be started.
    pub fn begin_motion(&mut self, name: Option<&str>) -> Result<(), String> {
        let Some(session) = &mut self.session else { return Err("nothing is open".into()) };
        let names = session.feel.guide().names();
        match (names.iter().position(|known| *known == name.unwrap_or("press")), name) {
            (Some(number), _) => session.begin(number),
            (None, None) => Ok(()),
            (None, Some(name)) => {
                let known = if names.is_empty() { "none".to_owned() } else { names.join(", ") };
                Err(format!("there is no motion \"{name}\" to show; the motions of what is open: {known}"))
            }
        }
    }

    fn motion(&self, name: &str) -> Option<usize> {
        self.session.as_ref()?.feel.guide().names().iter().position(|known| *known == name)
    }

    /// Time in the motion that leads, and its duration (s).
    #[must_use]
    pub fn time_in_motion(&self) -> Option<(f64, f64)> {
        self.session.as_ref()?.feel.guide().time()
    }

    /// Returns how punctual the haptic thread has been, and how costly its ticks; none where nothing is open.
    #[must_use]
    pub fn timing(&self) -> Option<Timing> {
        Some(self.session.as_ref()?.history.timing())
    }

    /// Forgets how punctual it was so far.
    pub fn forget_timing(&mut self) {
        if let Some(session) = &mut self.session {
            session.history.reset_timing();
        }
    }

    /// Size of the contact torque now (N m); none before the first tick.
    #[must_use]
    pub fn contact_torque(&self) -> Option<f64> {
        Some(self.session.as_ref()?.history.last()?.sample.torque.norm())
    }

    /// Returns where the tip of the arm is shown, when the 3-D scene fills `rect`.
    #[must_use]
    pub fn tip_in(&self, rect: egui::Rect) -> Option<egui::Pos2> {
        self.scene.shown_at(self.scene.tip(&self.session.as_ref()?.loaded.setup.chain)?, rect)
    }

    /// Takes a still of the film where one is due, after `elapsed` (s), and says when one is written.
    fn record(&mut self, elapsed: f64) {
        if let Some(film) = &mut self.film
            && film.is_due(elapsed)
        {
            match self.scene.still() {
                Ok(still) => still.into_iter().for_each(|still| film.take(still)),
                Err(error) => self.error = Some(not_drawn(error.into())),
            }
        }
        if let Some(written) = self.written.as_ref().and_then(Pending::poll) {
            self.written = None;
            let file = written.and_then(|file| file.map_err(|error| error.to_string()));
            self.told(file.map(|file| format!("wrote {}", file.display())));
        }
    }

    /// Shows what was done, or why not.
    pub(super) fn told(&mut self, outcome: Result<String, String>) {
        match outcome {
            Ok(text) => self.notice = Some(Notice::new(text)),
            Err(error) => self.error = Some(error),
        }
    }

    /// The 3-D picture of what is open, of `size` pixels.
    ///
    /// # Errors
    /// When the device fails, or nothing is open.
    pub(super) fn picture(&mut self, size: [u32; 2], visuals: &egui::Visuals) -> Result<Still, ViewError> {
        let picture = match &self.session {
            Some(session) => self.scene.picture(size, &session.loaded, visuals)?,
            None => None,
        };
        picture.ok_or_else(|| Error::from("nothing is open").into())
    }

    /// Begins a film of the 3-D picture, or ends it.
    pub(super) fn toggle_film(&mut self, egui: &egui::Context) {
        if let Some(film) = self.film.take() {
            self.written = Some(film.end());
            return;
        }
        let Some(session) = &self.session else { return };
        let egui = egui.clone();
        match Film::begin(self.files.fresh(&session.loaded.name, "gif"), move || egui.request_repaint()) {
            Ok(film) => self.film = Some(film),
            Err(error) => self.error = Some(error),
        }
    }

    /// Writes the 3-D picture to a file, twice as fine as it is shown.
    pub(super) fn save_picture(&mut self, visuals: &egui::Visuals) {
        let (Some(session), Some(size)) = (&self.session, self.scene.size()) else { return };
        let file = self.files.fresh(&session.loaded.name, "png");
        let drawn = self.picture(size.map(|side| 2 * side), visuals);
        let written = drawn.and_then(|(size, bytes)| write_picture(&file, size, &bytes));
        self.told(written.map(|()| format!("wrote {}", file.display())).map_err(not_drawn));
    }

    /// Whether nothing moves and nothing is made, so that another frame would look the same.
    #[must_use]
    pub fn is_at_rest(&self) -> bool {
        // A device moves when it likes.
        let moves = |session: &Session| session.lead.is_some() || session.feel.guide().is_running();
        let is_filmed = self.film.is_some() || self.written.is_some();
        !(self.is_making() || is_filmed || self.session.as_ref().is_some_and(moves)) && self.still > SETTLED
    }

    /// Lets `elapsed` (s) go by: the loop where it runs by steps, the object, and what is in the background.
    pub fn advance(&mut self, elapsed: f64, egui: &egui::Context) {
        if self.pace == TickSource::Clock && elapsed > 0.0 && elapsed < LONGEST_FRAME {
            let rate = self.frame_rate.map_or(elapsed, |rate| (1.0 - LATEST) / rate + LATEST * elapsed).recip();
            self.frame_rate = Some(rate);
        }
        self.record(elapsed);
        let egui = egui.clone();
        self.follow(move || egui.request_repaint());
        let Some(session) = &mut self.session else { return };
        session.feel.step((elapsed / session.loaded.setup.haptics.period()).round() as usize);
        session.history.collect(&mut session.feel);
        session.go_on_without_a_device();
        let latest = session.feel.latest();
        let axes = session.loaded.dataset.grid.axes.iter();
        let moved = |now: &[f64], before: &[f64]| {
            axes.clone().zip(now).zip(before).any(|((axis, now), before)| (now - before).abs() > UNMOVED * axis.step)
        };
        let (proxy, device) = self.shown_at;
        if proxy.len() != latest.proxy.len() || moved(&latest.proxy, &proxy) || moved(&latest.device, &device) {
            (self.shown_at, self.still) = ((latest.proxy, latest.device), 0.0);
        } else {
            self.still += elapsed;
        }
        if let Err(error) = self.scene.advance(&session.loaded, &latest, elapsed) {
            self.error = Some(not_drawn(error));
        }
    }
}

/// Why nothing is drawn any more, and what to do.
pub fn not_drawn(error: ViewError) -> String {
    match error {
        ViewError::Gpu(GpuError::Lost(why)) => format!(
            "the GPU that draws this window was lost: {why}. The loop goes on; start haptize view again if the window \
             does not come back by itself, and update the driver if this comes back"
        ),
        other => other.to_string(),
    }
}
