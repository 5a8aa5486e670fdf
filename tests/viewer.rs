//! The window of `haptize view`, driven as a person would: by its labels, by the pointer, and by looking at it. It is drawn
//! by software Vulkan, its haptic loop runs by steps, so that every run is the same.

#![cfg(feature = "viewer")]
#![allow(clippy::unwrap_used)]

use egui_kittest::{
    Harness, SnapshotOptions,
    kittest::{NodeT, Queryable},
    wgpu::WgpuTestRenderer,
};
use haptize::{
    dataset::Dataset,
    gpu::{AdapterChoice, Context},
    haptize::{BackendChoice, Bake},
    scene::Scene,
    viewer::{self, Pace, Start, Viewer},
};
use std::{
    path::{Path, PathBuf},
    sync::{Arc, LazyLock, Mutex, MutexGuard, PoisonError, atomic::AtomicBool},
};

/// One device for all tests, used by one at a time: software Vulkan compiles its pipelines anew on each.
static DEVICE: LazyLock<Mutex<Arc<Context>>> =
    LazyLock::new(|| Mutex::new(Arc::new(Context::open(AdapterChoice::Any).unwrap())));

/// The sphere, baked once.
static SPHERE: LazyLock<(tempfile::TempDir, PathBuf)> = LazyLock::new(|| {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("sphere.haptize");
    bake(Path::new("datasets/sphere.toml")).save(&file).unwrap();
    (folder, file)
});

fn bake(scene: &Path) -> Dataset {
    let scene = Scene::load(scene).unwrap();
    let (stop, date) = (AtomicBool::new(false), "2026-01-01T00:00:00Z");
    let bake = Bake { scene: &scene, backend: BackendChoice::Cpu, date, stop: &stop, progress: &mut |_| () };
    bake.in_memory().unwrap().0
}

struct Window {
    harness: Harness<'static, Viewer>,
    folder: tempfile::TempDir,
    _device: MutexGuard<'static, Arc<Context>>,
}

impl Window {
    fn open(start: &Start, size: [f32; 2], theme: eframe::egui::Theme) -> Self {
        let device = DEVICE.lock().unwrap_or_else(PoisonError::into_inner);
        let folder = tempfile::tempdir().unwrap();
        let render = viewer::render_state(&device).unwrap();
        let viewer = Viewer::new(Arc::clone(&device), render.clone(), Pace::Steps, folder.path().to_owned()).unwrap();
        let mut harness = Harness::builder()
            .with_size(size)
            .with_theme(theme)
            .with_max_steps(12)
            .with_context_setup(viewer::dress)
            .renderer(WgpuTestRenderer::from_render_state(render))
            .build_ui_state(|ui, viewer: &mut Viewer| viewer.ui(ui), viewer);
        let ctx = harness.ctx.clone();
        harness.state_mut().start(start, &ctx);
        harness.state_mut().wait(&ctx);
        harness.run_ok();
        Self { harness, folder, _device: device }
    }

    fn sphere() -> Self {
        Self::open(&Start::File(SPHERE.1.clone()), [1200.0, 800.0], eframe::egui::Theme::Light)
    }

    /// Lets `seconds` go by, frame by frame.
    fn pass(&mut self, seconds: f64) {
        for _ in 0..(seconds / 0.02).round() as usize {
            self.advance(0.02);
        }
        self.harness.run_ok();
    }

    fn advance(&mut self, seconds: f64) {
        let ctx = self.harness.ctx.clone();
        self.harness.state_mut().advance(seconds, &ctx);
    }

    fn wait(&mut self) {
        let ctx = self.harness.ctx.clone();
        self.harness.state_mut().wait(&ctx);
    }

    fn click(&mut self, label: &str) {
        self.harness.get_by_label(label).click();
        self.harness.run_ok();
    }

    fn shows(&self, label: &str) -> bool {
        self.harness.query_all_by_label_contains(label).next().is_some()
    }

    fn torque(&self) -> f64 {
        self.harness.state().contact_torque().unwrap()
    }
}

#[test]
fn every_panel_is_there_and_answers() {
    let mut window = Window::sphere();
    for label in ["Feel", "Scene", "Haptization", "C-space", "3-D scene", "Cloud of contacts in C-space"] {
        assert!(window.shows(label), "{label} is missing");
    }
    for slider in ["Coupling stiffness Kvc", "Boundary slope Ks", "Proxy damping bv", "Contact threshold Ith"] {
        assert!(window.shows(slider), "{slider} is missing");
    }
    window.click("Press");
    window.pass(2.0);
    for (tab, axis) in
        [("Configuration", "elbow proxy"), ("Contacts", "object nodes in contact"), ("Energy", "proxy's damping")]
    {
        window.click(tab);
        assert!(window.shows(axis), "{tab} lacks {axis}");
    }
    window.click("Timing");
    assert!(window.shows("cost of a tick [µs]: median"));
    // The plane of C-space shows what it is told to.
    for column in ["energy U [mJ]", "gap [mm]", "status", "log10 of residual", "yaw torque [N m]"] {
        window.harness.get_by_role_and_label(eframe::egui::accesskit::Role::ComboBox, "Show").click();
        window.harness.run_ok();
        window.click(column);
        let shown = window.harness.get_by_role_and_label(eframe::egui::accesskit::Role::ComboBox, "Show");
        assert_eq!(shown.accesskit_node().value().as_deref(), Some(column));
    }
}

#[test]
fn a_motion_plays_pauses_and_is_scrubbed() {
    let mut window = Window::sphere();
    window.pass(0.5);
    assert!(window.shows("free") && window.torque() == 0.0);
    window.click("Press");
    window.pass(2.2);
    assert!(window.torque() > 0.1 && window.shows("nodes in contact"), "{}", window.torque());
    window.click("Pause");
    let held = window.torque();
    window.pass(0.5);
    assert!((window.torque() - held).abs() < 0.05 * held, "{} after {held}", window.torque());
    let time = window.harness.get_by_label("Time in the motion");
    time.set_value_accesskit(0.0);
    window.harness.run_ok();
    window.pass(1.0);
    assert_eq!(window.torque(), 0.0);
}

#[test]
fn a_drag_ends_in_contact_and_shows_torque() {
    use eframe::egui::{Event, PointerButton, vec2};
    let mut window = Window::sphere();
    window.pass(0.5);
    assert_eq!(window.torque(), 0.0);
    let scene = window.harness.get_by_label("3-D scene").rect();
    let from = window.harness.state().tip_in(scene).unwrap();
    let button = |pos, pressed| Event::PointerButton {
        pos,
        button: PointerButton::Primary,
        pressed,
        modifiers: Default::default(),
    };
    window.harness.event(Event::PointerMoved(from));
    window.harness.event(button(from, true));
    window.harness.step();
    // Up, with the forearm's tip: the arm's fold lies over the sphere, so that the rest of it comes down.
    for step in 1..=20 {
        window.harness.event(Event::PointerMoved(from + step as f32 * vec2(5.0, 4.0)));
        window.harness.step();
        window.advance(0.05);
    }
    let end = from + 20.0 * vec2(5.0, 4.0);
    window.pass(0.5);
    assert!(window.torque() > 0.05, "no torque: {}", window.torque());
    assert!(window.shows("nodes in contact"));
    window.harness.event(button(end, false));
    window.harness.step();
    // The hand stays where it was let go, and keeps pressing.
    window.pass(0.3);
    assert!(window.torque() > 0.05);
}

#[test]
fn gains_beyond_their_bound_are_told_and_taken_back() {
    let mut window = Window::sphere();
    assert!(window.shows("All gains within their passivity bounds"));
    window.harness.get_by_label("Boundary slope Ks").set_value_accesskit(35.0);
    window.harness.run_ok();
    assert!(window.shows("beyond"), "no warning of Ks");
    window.click("Gains of the scene");
    assert!(window.shows("All gains within their passivity bounds"));
}

#[test]
fn a_broken_file_is_an_error_in_the_window_that_says_what_to_do() {
    let mut window = Window::sphere();
    let scene = std::fs::read_to_string("datasets/sphere.toml").unwrap();
    let broken = window.folder.path().join("broken.toml");
    std::fs::write(&broken, scene.replace("stiffness = 150.0", "stiffness = -150.0")).unwrap();
    let cut = window.folder.path().join("cut.haptize");
    let whole = std::fs::read(&SPHERE.1).unwrap();
    std::fs::write(&cut, &whole[..whole.len() / 2]).unwrap();
    for (file, message) in [(&broken, "broken.toml:"), (&cut, "cut.haptize")] {
        let ctx = window.harness.ctx.clone();
        window.harness.state_mut().start(&Start::File(file.clone()), &ctx);
        window.wait();
        window.harness.run_ok();
        assert!(
            window.shows("This did not work") && window.shows(message),
            "{message}: {:?}",
            window.harness.state().error()
        );
        window.click("Dismiss");
        assert!(!window.shows("This did not work"));
        // What was open still is.
        assert!(window.shows("C-space"));
    }
}

#[test]
fn a_scanned_dataset_shows_the_proxy_and_its_c_space() {
    let mut dataset = Dataset::open(&SPHERE.1).unwrap();
    (dataset.contacts, dataset.surface, dataset.energy, dataset.gap) = (None, None, None, None);
    (dataset.residual, dataset.iterations) = (None, None);
    // A scene without an object, for an arm of as many joints.
    dataset.scene = std::fs::read_to_string("datasets/sponge.toml").unwrap();
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("scanned.haptize");
    dataset.save(&file).unwrap();
    let mut window = Window::open(&Start::File(file), [1200.0, 800.0], eframe::egui::Theme::Dark);
    assert_eq!(window.harness.state().error(), None);
    window.pass(0.5);
    for label in ["A scanned dataset", "it cannot be baked again", "3-D scene", "C-space"] {
        assert!(window.shows(label), "{label} is missing");
    }
    assert!(!window.shows("Force arrows"));
    window.harness.render().unwrap();
}

#[test]
fn what_was_felt_is_exported() {
    let mut window = Window::sphere();
    window.click("Press");
    window.pass(1.6);
    window.click("CSV");
    window.click("PNG");
    let csv = std::fs::read_to_string(window.folder.path().join("viewer-trace.csv")).unwrap();
    assert_eq!(csv.lines().count(), 1 + 1600);
    for figure in ["viewer-press.png", "viewer-energy.png"] {
        assert!(image::open(window.folder.path().join(figure)).unwrap().width() > 300, "{figure}");
    }
}

#[test]
fn a_bake_can_be_cancelled_and_leaves_what_was_open() {
    let mut window = Window::sphere();
    window.click("Bake again");
    window.click("Cancel");
    window.wait();
    window.harness.run_ok();
    assert_eq!(window.harness.state().error(), None);
    assert!(window.shows("C-space"));
}

/// Greatest colour distance of a pixel (weighted, squared, in YIQ) that counts as alike, and how many others there may be:
/// one in a thousand of the window's. Two runs on one machine give the same pixels; the rasteriser's code for another
/// processor may round the rims of curves and edges differently. A window whose press is half a second on differs in more,
/// which is tested; another equilibrium under the press differs in 4,000.
const ALIKE: f32 = 1.5;
const OTHER_PIXELS: usize = 500;

fn looks_as_it_did(theme: eframe::egui::Theme, name: &str) {
    let mut window = Window::open(&Start::File(SPHERE.1.clone()), [900.0, 560.0], theme);
    window.harness.set_render_cursor(false);
    window.click("Press");
    window.pass(2.2);
    let options = SnapshotOptions::new().threshold(ALIKE).max_failed_pixels(OTHER_PIXELS);
    window.harness.snapshot_options(name, &options);
    if std::env::var_os("UPDATE_SNAPSHOTS").is_none() {
        window.pass(0.5);
        let later = window.harness.render().unwrap();
        assert!(
            egui_kittest::try_image_snapshot_options(&later, name, &options).is_err(),
            "a later window looks alike"
        );
    }
}

#[test]
fn the_light_window_looks_as_it_did() {
    looks_as_it_did(eframe::egui::Theme::Light, "window_light");
}

#[test]
fn the_dark_window_looks_as_it_did() {
    looks_as_it_did(eframe::egui::Theme::Dark, "window_dark");
}
