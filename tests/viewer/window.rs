//! A window under test, and what is opened in it.

use eframe::egui::{Rect, Theme, accesskit::Role};
use egui_kittest::{
    Harness,
    kittest::{NodeT, Queryable},
    wgpu::WgpuTestRenderer,
};
use haptize::{
    dataset::Dataset,
    gpu::{AdapterChoice, Context},
    scene::Scene,
    sweep,
    viewer::{self, DeviceChoice, Start, TickSource, Viewer},
};
use std::{
    path::{Path, PathBuf},
    sync::{Arc, LazyLock, Mutex, MutexGuard, OnceLock, PoisonError, atomic::AtomicBool},
};

/// One device for all tests, used by one at a time: software Vulkan compiles its pipelines anew on each.
static DEVICE: LazyLock<Mutex<Arc<Context>>> = LazyLock::new(|| {
    let context = Context::open(AdapterChoice::Any).unwrap();
    DEVICE_NAME.set(context.adapter().name.clone()).unwrap();
    Mutex::new(Arc::new(context))
});

/// The adapter's name.
pub static DEVICE_NAME: OnceLock<String> = OnceLock::new();

/// The sphere, baked once.
pub static SPHERE: LazyLock<(tempfile::TempDir, PathBuf)> = LazyLock::new(|| {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("sphere.haptize");
    bake(Path::new("tests/scenes/sphere.toml")).save(&file).unwrap();
    (folder, file)
});

fn bake(scene: &Path) -> Dataset {
    sweep::baked(&Scene::load(scene).unwrap()).unwrap().0
}

pub struct Window {
    pub harness: Harness<'static, Viewer>,
    pub folder: tempfile::TempDir,
    _device: MutexGuard<'static, Arc<Context>>,
}

impl Window {
    pub fn open(start: &Start, size: [f32; 2], theme: Theme) -> Self {
        let mut window = Self::empty(size, theme);
        let ctx = window.harness.ctx.clone();
        window.harness.state_mut().start(start, &ctx);
        window.wait();
        window
    }

    /// Nothing is open in it.
    pub fn empty(size: [f32; 2], theme: Theme) -> Self {
        let device = DEVICE.lock().unwrap_or_else(PoisonError::into_inner);
        let folder = tempfile::tempdir().unwrap();
        let render = viewer::render_state(&device).unwrap();
        let viewer =
            Viewer::new(Arc::clone(&device), render.clone(), TickSource::Steps, folder.path().to_owned()).unwrap();
        let harness = Harness::builder()
            .with_size(size)
            .with_theme(theme)
            .with_max_steps(12)
            .with_context_setup(viewer::dress)
            .renderer(WgpuTestRenderer::from_render_state(render))
            .build_ui_state(|ui, viewer: &mut Viewer| viewer.ui(ui), viewer);
        Self { harness, folder, _device: device }
    }

    /// The sphere, led by the device at `address`.
    pub fn driven(address: &str, hold_key: bool) -> Self {
        let mut window = Self::empty([1200.0, 800.0], Theme::Light);
        static STOP: AtomicBool = AtomicBool::new(false);
        let device = DeviceChoice { address: address.parse().unwrap(), hold_key, stop: &STOP };
        let ctx = window.harness.ctx.clone();
        window.harness.state_mut().drive(device);
        window.harness.state_mut().start(&Start::File(SPHERE.1.clone()), &ctx);
        window.wait();
        window
    }

    pub fn sphere() -> Self {
        Self::open(&Start::File(SPHERE.1.clone()), [1200.0, 800.0], Theme::Light)
    }

    /// Lets `seconds` go by, frame by frame.
    pub fn pass(&mut self, seconds: f64) {
        for _ in 0..(seconds / 0.02).round() as usize {
            self.advance(0.02);
        }
        self.harness.run_ok();
    }

    pub fn advance(&mut self, seconds: f64) {
        let ctx = self.harness.ctx.clone();
        self.harness.state_mut().advance(seconds, &ctx);
    }

    pub fn wait(&mut self) {
        self.harness.state_mut().wait();
        self.harness.run_ok();
    }

    pub fn click(&mut self, label: &str) {
        self.harness.get_by_label(label).click();
        self.harness.run_ok();
    }

    /// As [`Window::click`], where one may have to scroll first.
    pub fn reach(&mut self, label: &str) {
        self.harness.get_by_label(label).scroll_to_me();
        self.harness.run_ok();
        self.click(label);
    }

    pub fn shows(&self, label: &str) -> bool {
        self.harness.query_all_by_label_contains(label).next().is_some()
    }

    /// What is seen of the widget `label`.
    pub fn picture_of(&mut self, label: &str) -> image::RgbaImage {
        let rect = self.harness.get_by_label(label).rect();
        self.picture_in(rect)
    }

    /// What is seen in `rect`.
    pub fn picture_in(&mut self, rect: Rect) -> image::RgbaImage {
        // Nothing may hang over it that tells what is under the pointer.
        self.harness.remove_cursor();
        self.harness.run_ok();
        let [x, y, width, height] = [rect.min.x, rect.min.y, rect.width(), rect.height()].map(|side| side as u32);
        let window = self.harness.render().unwrap();
        image::imageops::crop_imm(&window, x, y, width, height).to_image()
    }

    /// Opens the choice `label` and takes `choice`.
    pub fn choose(&mut self, label: &str, choice: &str) {
        self.harness.get_by_role_and_label(Role::ComboBox, label).click();
        self.harness.run_ok();
        // A long list has to be scrolled.
        self.harness.get_by_role_and_label(Role::Button, choice).scroll_to_me();
        self.harness.run_ok();
        self.harness.get_by_role_and_label(Role::Button, choice).click();
        self.harness.run_ok();
        let chosen = self.harness.get_by_role_and_label(Role::ComboBox, label);
        assert_eq!(chosen.accesskit_node().value().as_deref(), Some(choice), "{label}");
        self.wait();
    }

    pub fn torque(&self) -> f64 {
        self.harness.state().contact_torque().unwrap()
    }
}

/// The sphere on a coarse grid of 168 configurations about its top, quickly baked.
pub fn small_scene() -> String {
    let mut text = std::fs::read_to_string("tests/scenes/sphere.toml").unwrap();
    for (old, new) in [
        ("spacing = 0.05235987755982988", "spacing = 0.1"),
        ("start = -0.916297857297023, count = 36", "start = -0.1, count = 3"),
        ("count = 16 },     #  54", "count = 9 },     #  54"),
        ("count = 14 }", "count = 8 }"),
    ] {
        assert!(text.contains(old), "{old}");
        text = text.replace(old, new);
    }
    text
}

/// The sphere's torques as if they had been measured on a real arm and a real object: nothing else is stored, and the
/// scene tells of no object.
pub fn scanned(folder: &Path) -> PathBuf {
    let mut dataset = Dataset::open(&SPHERE.1).unwrap();
    (dataset.contacts, dataset.surface, dataset.energy, dataset.gap) = (None, None, None, None);
    (dataset.residual, dataset.iterations) = (None, None);
    let (head, rest) = dataset.scene.split_once("[object]").unwrap();
    let (_, tail) = rest.split_once("[[proxy.joint]]").unwrap();
    dataset.scene = format!("{head}[[proxy.joint]]{tail}");
    let file = folder.join("scanned.haptize");
    dataset.save(&file).unwrap();
    file
}

/// How many colours there are in `picture`.
pub fn colours(picture: &image::RgbaImage) -> usize {
    picture.pixels().collect::<std::collections::HashSet<_>>().len()
}
