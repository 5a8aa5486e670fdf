//! An object before an arm, in the window.

use super::window::Window;
use eframe::egui::{Event, Modifiers, PointerButton, Theme, vec2};
use egui_kittest::kittest::{NodeT, Queryable};
use glam::DVec3;
use haptize::{scene::Scene, viewer::Start};
use std::path::{Path, PathBuf};

/// A scene of one's own, opened with the panel in which its object is placed.
fn own() -> (tempfile::TempDir, PathBuf, Window) {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("mine.toml");
    std::fs::copy("datasets/touch.toml", &file).unwrap();
    let mut window = Window::open(&Start::File(file.clone()), [1200.0, 800.0], Theme::Light);
    assert_eq!(window.harness.state().error(), None);
    window.click("Place the object");
    window.pass(0.1);
    (folder, file, window)
}

fn saved(window: &mut Window, file: &Path) -> Scene {
    window.wait();
    assert_eq!(window.harness.state().error(), None);
    window.click("Save scene");
    assert!(window.shows("wrote") && !window.shows("Save scene"));
    Scene::load(file).unwrap()
}

#[test]
fn an_object_dragged_in_the_picture_is_moved_in_the_scene_and_its_comments_stay() {
    let (_folder, file, mut window) = own();
    let before = Scene::load(&file).unwrap();
    let rect = window.harness.get_by_label("3-D scene").rect();
    let [from, to] = [rect.center(), rect.center() + vec2(0.0, -40.0)];
    let modifiers = Modifiers { ctrl: true, command: true, ..Modifiers::NONE };
    let button = |pos, pressed| Event::PointerButton { pos, button: PointerButton::Primary, pressed, modifiers };
    for event in [
        Event::ModifiersChanged(modifiers),
        Event::PointerMoved(from),
        button(from, true),
        Event::PointerMoved(to),
        button(to, false),
        Event::ModifiersChanged(Modifiers::NONE),
    ] {
        window.harness.event(event);
        window.harness.step();
    }
    window.wait();
    // Nothing is written before one saves.
    assert_eq!(Scene::load(&file).unwrap().text, before.text);
    let after = saved(&mut window, &file);
    let motion = after.object.shape.centre() - before.object.shape.centre();
    assert!(motion.z > 0.005, "up in the picture is {motion} m");
    let comments = |text: &str| text.lines().filter(|line| line.contains('#')).count();
    assert_eq!(comments(&after.text), comments(&before.text));
    assert_eq!(after.motion, before.motion);
}

#[test]
fn a_typed_place_moves_the_object_and_the_distance_to_it_is_live() {
    let (_folder, file, mut window) = own();
    let before = Scene::load(&file).unwrap().object.shape.centre();
    let distance = |window: &Window| {
        let line = window.harness.get_by_label_contains("to surface");
        let text = line.accesskit_node().value().or_else(|| line.accesskit_node().label()).unwrap();
        text.trim_start_matches("to surface").trim_end_matches("mm").replace('−', "-").trim().parse::<f64>().unwrap()
    };
    let near = distance(&window);
    let up = |window: &Window| window.harness.get_by_label("z").accesskit_node().numeric_value().unwrap();
    assert!((up(&window) - 1e3 * before.z).abs() < 1e-6);
    let field = window.harness.get_by_label("z");
    field.focus();
    window.harness.run_ok();
    let field = window.harness.get_by_label("z");
    field.set_value_accesskit(1e3 * before.z - 20.0);
    window.harness.step();
    window.harness.step();
    // Already while it is typed.
    assert!((distance(&window) - near - 20.0).abs() < 3.0, "{near} mm comes to {} mm", distance(&window));
    window.harness.key_press(eframe::egui::Key::Enter);
    window.harness.run_ok();
    let after = saved(&mut window, &file);
    let motion = after.object.shape.centre() - before;
    assert!(motion.distance(DVec3::new(0.0, 0.0, -0.02)) < 1e-6, "{motion}");
}

#[test]
fn what_an_editor_wrote_into_the_scene_meanwhile_is_kept() {
    let (folder, file, mut window) = own();
    window.click("Bring it to the tip");
    window.wait();
    let edited = std::fs::read_to_string(&file).unwrap() + "# mine\n";
    std::fs::write(&file, &edited).unwrap();
    window.click("Save scene");
    let refused = window.harness.state().error().unwrap().to_owned();
    assert!(refused.contains("mine.toml") && refused.contains("another program has changed it"), "{refused}");
    assert_eq!(std::fs::read_to_string(&file).unwrap(), edited);
    std::fs::rename(&file, folder.path().join("theirs.toml")).unwrap();
    window.click("Dismiss");
    saved(&mut window, &file);
}

#[test]
fn a_pose_makes_a_grid_and_motions_that_touch() {
    let (_folder, file, mut window) = own();
    for way in ["Bring it to the tip", "Use this pose"] {
        window.click(way);
        let scene = saved(&mut window, &file);
        let q = scene.motion.press.first().unwrap().q;
        for (axis, q) in scene.grid.axes.iter().zip(q.iter()) {
            let end = axis.start + axis.step * (axis.count - 1) as f64;
            assert!((axis.start..=end).contains(q), "{way}: {q} is beyond the grid");
        }
        window.click("Press");
        for _ in 0..120 {
            window.advance(0.02);
            if window.torque() > 0.01 {
                break;
            }
        }
        assert!(window.torque() > 0.01, "{way}: the press touches nothing");
        window.pass(2.5);
        window.click("Pause");
    }
}
