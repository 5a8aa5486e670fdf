//! What is felt: motions, the pointer, keys, gains, interpolation, effects.

use super::window::{SPHERE, Window, scanned, small_scene};
use eframe::egui::{Theme, accesskit::Role};
use egui_kittest::kittest::{NodeT, Queryable};
use haptize::{scene::Scene, sweep::baked, viewer::Start};

#[test]
fn a_motion_plays_pauses_and_is_scrubbed() {
    let mut window = Window::sphere();
    window.pass(0.5);
    assert!(window.shows("free") && window.torque() == 0.0);
    window.click("Press");
    window.pass(2.2);
    assert!(window.torque() > 0.1 && window.shows("vertices in contact"), "{}", window.torque());
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
    assert!(window.shows("vertices in contact"));
    window.harness.event(button(end, false));
    window.harness.step();
    // The hand stays where it was let go, and keeps pressing.
    window.pass(0.3);
    assert!(window.torque() > 0.05);
}

/// The scrape begins and ends beyond the grid of the small scene, whose joints reach farther, and comes to its border
/// in contact.
#[test]
fn the_window_tells_the_border_of_the_haptized_range_from_free_space_beyond_it() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("narrow.haptize");
    baked(&Scene::parse(&small_scene(), "narrow.toml").unwrap()).unwrap().0.save(&file).unwrap();
    let mut window = Window::open(&Start::File(file), [1200.0, 800.0], Theme::Light);
    assert_eq!(window.harness.state().error(), None);
    assert!(!window.shows("outside the haptized range"));
    window.click("Scrape");
    let (mut beyond, mut held) = (0, 0);
    for _ in 0..140 {
        window.advance(0.05);
        window.harness.run_ok();
        if window.shows("free, outside the haptized range") {
            beyond += 1;
            assert_eq!(window.torque(), 0.0);
        }
        if window.shows("held at the border of the haptized range") {
            held += 1;
            assert!(window.shows("border of the haptized range, Kvc 20 N m/rad"), "the stiffness is not told");
            assert!(!window.shows("free, outside"));
        }
    }
    assert!(beyond > 3 && held > 3, "free beyond the grid in {beyond} frames, held in {held}");
}

#[test]
fn keys_press_the_arm_onto_the_object_and_off_it() {
    use eframe::egui::Key;
    let mut window = Window::sphere();
    let scene = window.harness.get_by_label("3-D scene").rect();
    window.harness.hover_at(scene.center());
    window.harness.run_ok();
    for (key, touches) in [(Key::E, true), (Key::Q, false)] {
        window.harness.key_down(key);
        for _ in 0..30 {
            window.harness.step();
            window.advance(0.05);
            if (window.torque() > 0.05) == touches {
                break;
            }
        }
        window.harness.key_up(key);
        window.harness.step();
        assert_eq!(window.torque() > 0.05, touches, "{key:?}: {} N m", window.torque());
    }
    // A key stays down for the time between two frames, not only for the frame; not for ever where no other one is
    // drawn.
    let tip = |window: &Window| window.harness.state().tip_in(scene).unwrap();
    let goes_on = |window: &mut Window, seconds: f64| {
        let before = tip(window);
        window.advance(seconds);
        (tip(window) - before).length() > 0.5
    };
    window.harness.key_down(Key::S);
    window.harness.step();
    for _ in 0..4 {
        assert!(goes_on(&mut window, 0.2), "the arm stands between two frames");
    }
    window.advance(1.0);
    assert!(!goes_on(&mut window, 0.2), "the arm goes on in a window that draws no frames");
    // Nor where the window loses the keyboard meanwhile, and is never told that the key is let go.
    window.harness.key_up(Key::S);
    window.harness.key_down(Key::W);
    window.harness.step();
    assert!(goes_on(&mut window, 0.2));
    window.harness.input_mut().focused = false;
    window.harness.step();
    window.advance(0.5);
    assert!(!goes_on(&mut window, 0.2), "the arm goes on without the keyboard");
    window.harness.input_mut().focused = true;
    window.harness.key_up(Key::W);
    window.harness.step();
    // Elsewhere, keys are not meant for the arm.
    window.pass(0.5);
    let tip = window.harness.state().tip_in(scene);
    let plots = window.harness.get_by_label("Configuration").rect();
    window.harness.hover_at(plots.center());
    window.harness.run_ok();
    window.harness.key_down(Key::E);
    window.pass(0.5);
    assert_eq!(window.harness.state().tip_in(scene), tip);
}

#[test]
fn a_device_leads_the_arm_and_goes_on_under_other_gains_and_in_other_files() {
    let mut window = Window::driven("simulated", false);
    assert_eq!(window.harness.state().error(), None);
    assert!(window.shows("led by") && window.shows("simulated"));
    assert!(window.harness.query_by_label("Press").is_none(), "a motion may be chosen");
    // The simulated device goes along the scene's press by itself.
    window.pass(2.2);
    let pressed = window.torque();
    assert!(pressed > 0.1 && window.shows("vertices in contact"), "{pressed}");
    // The same device in another loop: it goes on from where it is.
    window.harness.get_by_label("Boundary slope Ks").set_value_accesskit(12.0);
    window.harness.run_ok();
    window.wait();
    window.pass(0.1);
    assert_eq!(window.harness.state().error(), None);
    assert!(window.torque() > 0.05 && window.shows("vertices in contact"), "{}", window.torque());
    // A file that is opened has it from its beginning.
    let ctx = window.harness.ctx.clone();
    window.harness.state_mut().start(&Start::File(SPHERE.1.clone()), &ctx);
    window.wait();
    window.pass(0.2);
    assert_eq!(window.harness.state().error(), None);
    assert!(window.shows("led by") && window.torque() == 0.0);
    assert!(!window.harness.state().is_at_rest(), "a window that draws nothing does not see the device move");
}

#[test]
fn the_window_says_why_a_device_gives_no_torque() {
    let mut window = Window::driven("simulated:unplugged@0.5", false);
    window.pass(0.4);
    assert!(!window.shows("no torque"));
    window.pass(0.3);
    assert!(window.shows("no torque: the device is unplugged"));
    drop(window);
    // One that is not there opens no session.
    let window = Window::driven("woodenhaptics:/nowhere", false);
    assert!(window.harness.state().error().is_some_and(|why| why.contains("/nowhere")));
    assert!(!window.shows("led by"));
}

#[test]
fn the_space_bar_is_the_dead_man_key() {
    use eframe::egui::Key;
    let mut window = Window::driven("simulated", true);
    window.pass(1.0);
    assert!(window.shows("hold the space bar for torque") && window.shows("no torque: the dead-man key is not held"));
    window.harness.key_down(Key::Space);
    for _ in 0..10 {
        window.harness.step();
        window.advance(0.1);
    }
    window.harness.step();
    assert!(!window.shows("no torque"));
    window.harness.key_up(Key::Space);
    window.harness.step();
    window.pass(0.5);
    assert!(window.shows("no torque: the dead-man key is not held"));
}

#[test]
fn gains_beyond_their_bound_are_told_and_taken_back() {
    let mut window = Window::sphere();
    assert!(window.shows("All gains within their passivity bounds"));
    for remedy in ["Reset gains", "Use passive gains"] {
        window.harness.get_by_label("Boundary slope Ks").set_value_accesskit(35.0);
        window.harness.step();
        window.wait();
        assert!(window.shows("the gains are not passive"), "no warning of Ks");
        window.click(remedy);
        window.wait();
        assert!(window.shows("All gains within their passivity bounds"), "{remedy}");
        assert!(!window.shows("Use passive gains"));
    }
}

/// Joints may differ in unit: one number for all would be nonsense.
#[test]
fn gains_that_differ_between_joints_are_multiplied_together() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("three.toml");
    let scene = small_scene();
    let (old, new) = ("coupling_damping = 0.01", "coupling_damping = [0.0, 0.016, 0.02]");
    assert!(scene.contains(old));
    std::fs::write(&file, scene.replace(old, new)).unwrap();
    let mut window = Window::open(&Start::File(file), [1200.0, 800.0], Theme::Light);
    assert!(window.shows("Coupling damping Bvc [times the scene's]"));
    assert!(window.shows("Boundary slope Ks [N m/rad]"));
    window.harness.get_by_role_and_label(Role::Slider, "Coupling damping Bvc").set_value_accesskit(0.5);
    window.harness.step();
    window.wait();
    for (joint, gain) in [("yaw", 0.0), ("shoulder", 0.008), ("elbow", 0.01)] {
        window.choose("Joint", joint);
        let slider = window.harness.get_by_role_and_label(Role::Slider, "Coupling damping Bvc");
        assert_eq!(slider.accesskit_node().numeric_value(), Some(gain), "{joint}");
    }
}

#[test]
fn each_interpolation_is_felt() {
    // Torques from shortly before contact on, with the last of these choices.
    let approach = |choices: &[&str]| -> Vec<f64> {
        let mut window = Window::sphere();
        choices.iter().for_each(|choice| window.choose("Interpolation", choice));
        window.click("Press");
        window.pass(1.0);
        let torques = (0..40).map(|_| {
            window.advance(0.02);
            window.torque()
        });
        torques.collect()
    };
    let linear = approach(&[]);
    let greatest = linear.iter().copied().fold(0.0, f64::max);
    let most = |other: &[f64]| linear.iter().zip(other).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max) / greatest;
    assert!(greatest > 0.1, "{greatest}");
    let difference = most(&approach(&["potential"]));
    assert!(difference > 1e-2 && difference < 0.5, "{difference}");
    assert_eq!(most(&approach(&["potential", "linear"])), 0.0);
}

#[test]
fn what_a_dataset_does_not_hold_cannot_interpolate() {
    let folder = tempfile::tempdir().unwrap();
    let file = scanned(folder.path());
    let mut window = Window::open(&Start::File(file), [1200.0, 800.0], Theme::Light);
    window.harness.get_by_role_and_label(Role::ComboBox, "Interpolation").click();
    window.harness.run_ok();
    assert!(window.harness.get_by_label("potential").accesskit_node().is_disabled());
}

#[test]
fn effects_of_tick_and_frame_are_left_out_and_taken_back() {
    let folder = tempfile::tempdir().unwrap();
    let scene = folder.path().join("effects.toml");
    let text = small_scene().replace("[graphics]", "[graphics]\ngravity = [0.0, 0.0, -30.0]\nsmoothing = 0.05");
    let text = text.replace("[haptics]", "[haptics]\nproxy_inertia = \"configuration\"");
    std::fs::write(&scene, text).unwrap();
    let mut window = Window::open(&Start::File(scene), [1200.0, 900.0], Theme::Light);
    assert_eq!(window.harness.state().error(), None);
    for effect in ["Varying inertia", "Gravity", "Smoothing"] {
        assert!(window.shows(effect), "{effect} is missing");
    }
    for absent in ["Contact friction", "Strain stiffening", "Quasi-static object"] {
        assert!(!window.shows(absent), "{absent} is not named");
    }
    window.pass(0.5);
    let sagging = window.picture_of("3-D scene");
    window.reach("Gravity");
    window.wait();
    window.pass(0.5);
    let weightless = window.picture_of("3-D scene");
    assert!(sagging != weightless, "the object has its weight without gravity");
    window.reach("Gravity");
    window.wait();
    window.pass(0.5);
    assert!(sagging == window.picture_of("3-D scene"), "gravity taken back is another");
    window.reach("Varying inertia");
    assert_eq!(window.harness.state().error(), None);
}

#[test]
fn an_object_that_relaxes_and_rubs_shows_its_dent_and_the_ellipse_of_friction() {
    let folder = tempfile::tempdir().unwrap();
    let open = |name: &str, added: &str| {
        let file = folder.path().join(name);
        let text = small_scene().replace("interpolation = \"linear\"", "interpolation = \"potential\"") + added;
        baked(&Scene::parse(&text, name).unwrap()).unwrap().0.save(&file).unwrap();
        let mut window = Window::open(&Start::File(file), [1200.0, 900.0], Theme::Light);
        assert_eq!(window.harness.state().error(), None);
        window.click("Press");
        window.pass(2.2);
        assert!(window.shows("vertices in contact"), "{name}");
        (window.shows("dent "), window.picture_of("Plane of C-space"))
    };
    let (shows_dent, plane) = open("elastic.haptize", "");
    assert!(!shows_dent);
    let (shows_dent, _) = open("relaxing.haptize", "[object.relaxation]\nterms = [[0.5, 0.1], [0.2, 2.0]]\n");
    assert!(shows_dent);
    let (_, rubbing) = open("rubbing.haptize", "[haptics.friction]\ncoefficient = 0.4\n");
    let differing = plane.pixels().zip(rubbing.pixels()).filter(|(a, b)| a != b).count();
    assert!(differing > 50, "no ellipse: {differing}");
}
