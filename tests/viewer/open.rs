//! How something is opened or baked, and what is said when it is not.

use super::window::{DEVICE_NAME, SPHERE, Window, colours, scanned, small_scene};
use crate::common::program::{command, message};
use eframe::egui::{Pos2, RawInput, Rect, Theme, accesskit::Role, vec2};
use egui_kittest::kittest::{NodeT, Queryable};
use haptize::{
    gpu::{AdapterChoice, Context},
    viewer::{self, Start, TickSource, Viewer},
};
use std::{
    collections::BTreeSet,
    path::{Path, PathBuf},
    sync::Arc,
};

#[test]
fn frames_are_drawn_while_the_sphere_is_baked_and_show_how_far_it_is() {
    let mut window = Window::empty([900.0, 560.0], Theme::Light);
    let ctx = window.harness.ctx.clone();
    window.harness.state_mut().start(&Start::Sphere, &ctx);
    let mut seen = BTreeSet::new();
    let mut frames = 0;
    while !window.shows("C-space") {
        window.advance(0.02);
        window.harness.step();
        frames += 1;
        assert_eq!(window.harness.state().error(), None);
        let bars = window.harness.query_all_by_role(Role::ProgressIndicator);
        seen.extend(bars.filter_map(|bar| bar.accesskit_node().numeric_value().map(f64::to_bits)));
    }
    assert!(frames > 3 && seen.len() > 1, "{frames} frames, progress {seen:?}");
    // It can be felt at once.
    window.click("Press");
    window.pass(2.2);
    assert!(window.torque() > 0.1);
}

#[test]
fn the_chooser_lists_a_folder_and_opens_what_is_clicked_or_typed() {
    let mut window = Window::empty([1200.0, 800.0], Theme::Light);
    let inner = window.folder.path().join("inner");
    std::fs::create_dir(&inner).unwrap();
    std::fs::copy(&SPHERE.1, inner.join("one.haptize")).unwrap();
    std::fs::write(inner.join("notes.txt"), "").unwrap();
    window.harness.run_ok();
    assert!(window.shows("Nothing is open"));
    window.harness.get_all_by_label("Open…").next().unwrap().click();
    window.harness.run_ok();
    assert!(window.shows("Open a scene or a dataset"));
    window.click("inner/");
    assert!(!window.shows("notes.txt"));
    window.click("one.haptize");
    window.wait();
    assert!(window.shows("C-space") && !window.shows("Folder"), "{:?}", window.harness.state().error());
    // What was opened is remembered; another file can be typed.
    window.click("Open…");
    assert!(window.shows("Recent"));
    let other = inner.join("two.toml");
    std::fs::write(&other, "name = 3").unwrap();
    let path = window.harness.get_by_role_and_label(Role::TextInput, "Path");
    path.focus();
    path.type_text(other.to_str().unwrap());
    window.harness.run_ok();
    window.click("Open");
    window.wait();
    assert!(window.shows("This did not work") && window.shows("two.toml"), "{:?}", window.harness.state().error());
}

/// Another program that cuts the file short must not reach a running loop.
#[cfg(target_os = "linux")]
#[test]
fn the_window_does_not_keep_a_file_mapped() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("cut-me.haptize");
    std::fs::copy(&SPHERE.1, &file).unwrap();
    let mut window = Window::open(&Start::File(file.clone()), [1200.0, 800.0], Theme::Light);
    assert!(!std::fs::read_to_string("/proc/self/maps").unwrap().contains("cut-me.haptize"));
    std::fs::OpenOptions::new().write(true).open(&file).unwrap().set_len(64).unwrap();
    window.click("Press");
    window.pass(2.2);
    assert!(window.torque() > 0.1);
}

/// A file that somebody drops on the window.
#[derive(Debug)]
struct Dropped(PathBuf);

impl eframe::egui::DroppedFile for Dropped {
    fn path(&self) -> &Path {
        &self.0
    }

    fn bytes(&self) -> Result<Vec<u8>, String> {
        std::fs::read(&self.0).map_err(|error| error.to_string())
    }
}

#[test]
fn a_file_dropped_on_the_window_is_opened() {
    let mut window = Window::sphere();
    let file = scanned(window.folder.path());
    for (path, shown) in [(file, "A scanned dataset"), (window.folder.path().join("gone.toml"), "This did not work")] {
        assert!(!window.shows(shown));
        window.harness.input_mut().dropped_files.push(Arc::new(Dropped(path)));
        window.harness.step();
        window.wait();
        assert!(window.shows(shown), "{shown} is missing");
    }
    assert!(
        window.shows("gone.toml") && window.shows("A scanned dataset"),
        "what was open is not, or the error is mute"
    );
}

#[test]
fn a_broken_file_is_an_error_in_the_window_that_says_what_to_do() {
    let mut window = Window::sphere();
    let scene = std::fs::read_to_string("tests/scenes/sphere.toml").unwrap();
    let broken = window.folder.path().join("broken.toml");
    std::fs::write(&broken, scene.replace("stiffness = 150.0", "stiffness = -150.0")).unwrap();
    let cut = window.folder.path().join("cut.haptize");
    let whole = std::fs::read(&SPHERE.1).unwrap();
    std::fs::write(&cut, &whole[..whole.len() / 2]).unwrap();
    for (file, message) in [(&broken, "broken.toml:"), (&cut, "cut.haptize")] {
        let ctx = window.harness.ctx.clone();
        window.harness.state_mut().start(&Start::File(file.clone()), &ctx);
        window.wait();
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
fn a_scanned_dataset_shows_the_proxy_and_its_c_space_and_says_what_is_not_stored() {
    let folder = tempfile::tempdir().unwrap();
    let file = scanned(folder.path());
    let mut window = Window::open(&Start::File(file), [1200.0, 800.0], Theme::Dark);
    assert_eq!(window.harness.state().error(), None);
    for label in ["A scanned dataset", "it cannot be baked again", "3-D scene", "Cloud of contacts in C-space"] {
        assert!(window.shows(label), "{label} is missing");
    }
    assert!(!window.shows("Force arrows"));
    let before = window.picture_of("3-D scene");
    window.click("Press");
    window.pass(2.2);
    assert!(window.torque() > 0.1, "the proxy feels nothing: {}", window.torque());
    assert!(window.shows("in contact, vertices not known") && !window.shows("0 vertices"));
    window.click("Contacts");
    assert!(window.shows("Nodes in contact are not stored") && !window.shows("object nodes in contact"));
    window.click("Energy");
    assert!(window.shows("energy is not stored") && !window.shows("stored in the object"));
    // The proxy is drawn, and moves; C-space has colours, not one.
    assert!(colours(&before) > 20 && before != window.picture_of("3-D scene"));
    assert!(colours(&window.picture_of("Cloud of contacts in C-space")) > 20);
}

#[test]
fn a_scene_is_baked_on_the_adapter_that_is_chosen() {
    let folder = tempfile::tempdir().unwrap();
    let scene = folder.path().join("small.toml");
    std::fs::write(&scene, small_scene().replace("law = \"following\"", "law = \"rest\"")).unwrap();
    let mut window = Window::open(&Start::File(scene), [1200.0, 900.0], Theme::Light);
    let adapter = DEVICE_NAME.get().unwrap();
    assert!(!window.shows(&format!("on {adapter}")), "baked on {adapter} before it was chosen");
    window.choose("on", &format!("{}, Vulkan", adapter.split(" (").next().unwrap()));
    window.reach("Bake");
    window.wait();
    assert_eq!(window.harness.state().error(), None);
    assert!(window.shows(&format!("on {adapter}")), "not baked on {adapter}");
}

#[test]
fn a_change_is_baked_at_once_where_that_is_asked_for() {
    let folder = tempfile::tempdir().unwrap();
    let scene = folder.path().join("small.toml");
    std::fs::write(&scene, small_scene()).unwrap();
    let mut window = Window::open(&Start::File(scene), [1200.0, 900.0], Theme::Light);
    let pressed = |window: &mut Window| {
        window.click("Press");
        window.pass(2.2);
        window.torque()
    };
    let soft = pressed(&mut window);
    let kc = |window: &mut Window, stiffness: f64| {
        let number = window.harness.get_by_label("Contact Kc [N/m]");
        number.set_value_accesskit(stiffness);
        window.harness.step();
        window.harness.step();
    };
    kc(&mut window, 600.0);
    assert!(!window.shows("Haptizing"), "a change is baked without being asked");
    window.reach("on change");
    kc(&mut window, 2000.0);
    assert!(window.shows("Haptizing"), "a change is not baked");
    window.wait();
    assert_eq!(window.harness.state().error(), None);
    let hard = pressed(&mut window);
    assert!((hard - soft).abs() > 1e-3 * soft, "{soft} N m at 500 N/m, {hard} at 2000");
}

#[test]
fn a_bake_can_be_cancelled_and_leaves_what_was_open() {
    let mut window = Window::sphere();
    window.reach("Bake again");
    window.click("Cancel");
    window.wait();
    assert_eq!(window.harness.state().error(), None);
    assert!(window.shows("C-space"));
}

/// A viewer that works in `folder`, with a device of its own.
fn to_be_lost(folder: &Path) -> (Arc<Context>, eframe::egui::Context, Viewer) {
    let device = Arc::new(Context::open(AdapterChoice::Any).unwrap());
    let render = viewer::render_state(&device).unwrap();
    let viewer = Viewer::new(Arc::clone(&device), render, TickSource::Steps, folder.to_owned()).unwrap();
    (device, eframe::egui::Context::default(), viewer)
}

#[test]
fn a_window_whose_device_is_lost_says_so_and_paints_nothing_more() {
    let folder = tempfile::tempdir().unwrap();
    let (lost, ctx, mut viewer) = to_be_lost(folder.path());
    viewer.start(&Start::File(SPHERE.1.clone()), &ctx);
    viewer.wait();
    viewer.play("press");
    assert!(viewer.is_lost().is_none() && viewer.error().is_none());
    let screen = Rect::from_min_size(Pos2::ZERO, vec2(1200.0, 800.0));
    let show = |viewer: &mut Viewer| {
        let input = RawInput { screen_rect: Some(screen), ..Default::default() };
        let mut output = ctx.run_ui(input, |ui| viewer.ui(ui));
        // Nobody paints it.
        output.textures_delta.clear();
    };
    show(&mut viewer);
    lost.shared().2.destroy();
    // In the midst of a frame: what there is to draw is refused, not panicked about.
    show(&mut viewer);
    assert!(viewer.is_lost().is_some(), "{:?}", viewer.error());
    for _ in 0..60 {
        viewer.advance(0.05, &ctx);
    }
    // The loop goes on.
    assert!(viewer.contact_torque().unwrap() > 0.1);
    let error = viewer.error().unwrap();
    assert!(error.contains("was lost") && error.contains("start haptize view again"), "{error}");
    let why = viewer.is_lost().unwrap();
    assert!(!why.is_empty());
}

#[test]
fn an_adapter_that_the_environment_names_and_is_not_there_is_told_with_what_is() {
    let mut command = command(Path::new("."), &["view", "--screenshot", "never.png"]);
    let output = command.env("WGPU_ADAPTER_NAME", "Unplugged").output().unwrap();
    let message = message(&output);
    assert_eq!(output.status.code(), Some(1), "{message}");
    for part in ["\"Unplugged\"", "WGPU_ADAPTER_NAME", "software"] {
        assert!(message.contains(part), "{message}");
    }
}

#[test]
#[cfg(target_os = "linux")]
fn without_a_display_the_file_is_looked_at_first_and_the_remedy_is_told_in_a_sentence() {
    let view = |file: &str| {
        let mut command = command(Path::new("."), &["view", file]);
        for display in ["DISPLAY", "WAYLAND_DISPLAY", "WAYLAND_SOCKET"] {
            command.env_remove(display);
        }
        let output = command.output().unwrap();
        assert_eq!(output.status.code(), Some(1));
        message(&output)
    };
    let message = view("none.haptize");
    assert!(message.starts_with("haptize: none.haptize: cannot be read") && !message.contains("display"), "{message}");
    let message = view("datasets");
    assert!(message.starts_with("haptize: datasets: cannot be read"), "{message}");
    let message = view("datasets/sphere.toml");
    assert!(message.starts_with("haptize: there is no display") && message.contains("--screenshot"), "{message}");
    assert!(message.lines().count() == 1 && !message.contains(".rs:"), "{message}");
}

/// Nothing is baked: contact is solved in every tick.
#[test]
fn a_scene_is_felt_and_seen_before_anything_of_it_is_baked() {
    let mut window = Window::open(&Start::File("datasets/organ.toml".into()), [1200.0, 800.0], Theme::Light);
    assert_eq!(window.harness.state().error(), None);
    window.click("Press");
    for _ in 0..150 {
        window.advance(0.02);
        if window.torque() > 0.02 {
            break;
        }
    }
    window.harness.run_ok();
    assert!(window.torque() > 0.02, "{} N m", window.torque());
    assert!(window.shows("solved live") && window.shows("displacement"));
    assert!(window.shows("Bake the scene to see it over its grid") && !window.shows("Plane of C-space"));
}
