//! That every panel is there and answers.

use super::window::{DEVICE_NAME, Window, small_scene};
use eframe::egui::{Event, Key, Modifiers, Rect, Theme, accesskit::Role, pos2, vec2};
use egui_kittest::kittest::{NodeT, Queryable};
use haptize::viewer::{LEAST_WINDOW, Start};

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
    assert!(window.shows("cost of a tick [µs]: median") && window.shows("the window holding still: not measured yet"));
    // The plane of C-space shows what it is told to.
    for column in ["energy U [mJ]", "gap [mm]", "status", "log10 of residual", "yaw torque [N m]"] {
        window.choose("Show", column);
    }
}

#[test]
fn the_three_steps_are_shown_from_the_help_and_taken_away() {
    let mut window = Window::sphere();
    assert!(!window.shows("1  Solve"), "a picture shows no steps unless asked");
    window.click("Help");
    window.click("Three steps");
    window.pass(0.1);
    for step in ["1  Solve", "2  Store", "3  Look up"] {
        assert!(window.shows(step), "{step}");
    }
    window.click("Got it");
    window.pass(0.1);
    assert!(!window.shows("1  Solve"));
}

#[test]
fn nothing_overlaps_in_the_least_window_however_long_the_name_and_however_many_the_joints() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("long.toml");
    let joint = |name: &str| {
        format!(
            "[[proxy.joint]]\nname = \"{name}\"\nkind = \"revolute\"\naxis = [1.0, 0.0, 0.0]\nlimits = [-1.0, 1.0]\n\
             mass = 0.1\nrotor_inertia = 1e-3\n\n"
        )
    };
    let text = small_scene().replacen("name = \"sphere\"", "name = \"a sphere with quite a long name\"", 1);
    let joints = [joint("turntable"), joint("column"), joint("bracket")].concat();
    let text = text.replacen("[[proxy.joint]]", &format!("{joints}[[proxy.joint]]"), 1);
    let lines = "    { start = 0.0, step = 0.001, count = 2 },\n".repeat(3);
    let text = text.replacen("axes = [\n", &format!("axes = [\n{lines}"), 1).replace("q = [", "q = [0.0, 0.0, 0.0, ");
    std::fs::write(&file, text).unwrap();
    let mut window = Window::open(&Start::File(file), LEAST_WINDOW, Theme::Light);
    window.reach("Bake");
    window.wait();
    assert_eq!(window.harness.state().error(), None);
    window.click("Press");
    window.pass(1.0);
    let screen = Rect::from_min_size(pos2(0.0, 0.0), LEAST_WINDOW.into());
    let apart = |window: &Window, labels: &[&str], within: Rect| {
        let rects: Vec<Rect> = labels
            .iter()
            .map(|label| {
                // The title is a word of other labels, too.
                let is_title = *label == "haptize";
                let harness = &window.harness;
                if is_title { harness.get_by_label(label) } else { harness.get_by_label_contains(label) }.rect()
            })
            .collect();
        for (number, rect) in rects.iter().enumerate() {
            assert!(within.contains_rect(*rect), "{} at {rect}", labels[number]);
            for (other, label) in rects.iter().zip(labels).skip(number + 1) {
                assert!(!rect.shrink(0.5).intersects(*other), "{} overlaps {label}", labels[number]);
            }
        }
    };
    let bar =
        ["haptize", "Open…", "Save dataset", "Pointer", "Press", "Scrape", "Pause", "Time in the motion", " of 4.5 s"];
    apart(&window, &[&bar[..], &["Help", "View", "Dark"]].concat(), screen);
    window.choose("Show", "status");
    window.harness.get_by_label("outside").scroll_to_me();
    window.harness.run_ok();
    let panel = screen.with_min_x(window.harness.get_by_label("3-D scene").rect().max.x);
    apart(&window, &["Plane of C-space", "unconverged", "overflow", "outside"], panel);
    window.click("Torque");
    let plots = screen.with_min_y(window.harness.get_by_label("3-D scene").rect().max.y);
    apart(&window, &["turntable contact", "column device", "elbow device"], plots);
}

#[test]
fn the_plane_of_c_space_goes_through_the_grid_line_that_its_slider_says() {
    let mut window = Window::sphere();
    window.pass(0.1);
    let slider = |window: &Window| window.harness.query_all_by_role_and_label(Role::Slider, "yaw").next().is_some();
    let disabled =
        |window: &Window| window.harness.get_by_role_and_label(Role::Slider, "yaw").accesskit_node().is_disabled();
    assert!(disabled(&window), "the plane follows q, and can be moved");
    let before = window.picture_of("Plane of C-space");
    window.click("follow q");
    assert!(!disabled(&window));
    window.harness.get_by_role_and_label(Role::Slider, "yaw").set_value_accesskit(2.0);
    window.harness.run_ok();
    assert!(window.shows("-0.812 rad"), "the slider does not say where it is");
    assert!(before != window.picture_of("Plane of C-space"));
    // Any two joints, which then have no slider.
    window.choose("Across", "yaw");
    assert!(!slider(&window));
}

#[test]
fn plots_freeze_and_are_then_zoomed() {
    let mut window = Window::sphere();
    window.click("Press");
    window.pass(1.6);
    window.click("Freeze");
    let scene = window.harness.get_by_label("3-D scene").rect();
    let tabs = window.harness.get_by_label("Configuration").rect();
    let rect = Rect::from_min_size(pos2(scene.min.x, tabs.max.y + 30.0), vec2(scene.width(), 120.0));
    let before = window.picture_in(rect);
    window.pass(0.5);
    assert!(before == window.picture_in(rect), "a frozen plot moves");
    window.harness.hover_at(rect.center());
    window.harness.step();
    window.harness.event(Event::Zoom(2.0));
    window.harness.run_ok();
    let zoomed = window.picture_in(rect);
    assert!(before != zoomed, "a frozen plot is not zoomed");
    // Live again, it goes with the time.
    window.click("Freeze");
    window.pass(0.2);
    assert!(window.picture_in(rect) != zoomed);
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
fn the_window_says_what_pointer_and_keys_do_and_what_draws() {
    let mut window = Window::sphere();
    let adapter = DEVICE_NAME.get().unwrap();
    assert!(window.shows(&format!("drawn by {}", adapter.split(" (").next().unwrap())));
    window.click("Help");
    for help in ["Drag a node of the arm", "A D, W S, Q E", "reset the view", "Right-drag, Ctrl-wheel"] {
        assert!(window.shows(help), "{help} is missing");
    }
}

#[test]
fn numbers_over_the_picture_say_where_the_arm_is_and_a_click_probes_the_object() {
    let mut window = Window::sphere();
    window.click("Press");
    window.pass(2.0);
    // Each joint in its own unit, the tip, the force, and what the colours mean.
    for label in ["rad", "N m", "tip", "mm", "force", "vertex in contact", "force on the arm, longest"] {
        assert!(window.shows(label), "{label} is missing");
    }
    let numbers = |window: &Window| {
        let all = window.harness.query_all_by_label_contains(" N");
        all.filter_map(|node| node.accesskit_node().value().or_else(|| node.accesskit_node().label()))
            .collect::<Vec<_>>()
    };
    let pressed = numbers(&window);
    let scene = window.harness.get_by_label("3-D scene").rect();
    assert!(!window.shows("vertex 0") && window.harness.query_all_by_label_contains("vertex ").count() == 1);
    // The sphere lies below the middle of the picture.
    let click = |window: &mut Window, at: eframe::egui::Pos2| {
        window.harness.event(Event::PointerMoved(at));
        for pressed in [true, false] {
            let button = eframe::egui::PointerButton::Primary;
            window.harness.event(Event::PointerButton { pos: at, button, pressed, modifiers: Default::default() });
        }
        window.harness.run_ok();
    };
    click(&mut window, scene.center() + vec2(0.0, 0.2 * scene.height()));
    let probed = |window: &Window| window.harness.query_all_by_label_contains("vertex ").count() == 2;
    assert!(probed(&window), "the object is not probed");
    assert_ne!(numbers(&window), pressed, "the probed vertex has no force");
    click(&mut window, scene.right_bottom() - vec2(8.0, 60.0));
    assert!(!probed(&window), "nothing lies there");
}

#[test]
fn a_message_fades_by_itself() {
    let mut window = Window::sphere();
    window.pass(0.5);
    window.click("CSV");
    assert!(window.shows("viewer-trace.csv"));
    // A step is a quarter of a second.
    for _ in 0..40 {
        window.harness.step();
    }
    assert!(!window.shows("viewer-trace.csv"), "the message stays");
}

#[test]
fn keys_pause_open_and_look_from_several_sides() {
    let mut window = Window::sphere();
    window.click("Press");
    window.pass(0.3);
    assert!(window.shows("Pause"));
    window.harness.key_press(Key::Space);
    window.harness.run_ok();
    assert!(!window.shows("Pause") && window.shows("Play"));
    let mut seen = vec![window.picture_of("3-D scene")];
    for key in [Key::Num1, Key::Num2, Key::Num3, Key::Num4] {
        window.harness.key_press(key);
        let picture = window.picture_of("3-D scene");
        assert!(!seen.contains(&picture), "{key:?} shows nothing else");
        seen.push(picture);
    }
    window.harness.key_press(Key::Num5);
    assert!(window.picture_of("3-D scene") == seen[0], "the view is not as it was at first");
    window.harness.key_press_modifiers(Modifiers { ctrl: true, command: true, ..Modifiers::NONE }, Key::O);
    window.harness.run_ok();
    assert!(window.shows("Open a scene or a dataset"));
}

#[test]
fn the_scene_is_saved_as_a_picture_and_as_a_film() {
    let mut window = Window::sphere();
    window.click("Press");
    window.pass(0.3);
    let scene = window.harness.get_by_label("3-D scene").rect();
    window.click("View");
    window.click("Save picture");
    let picture = image::open(window.folder.path().join("sphere.png")).unwrap();
    assert!((picture.width() as f32 - 2.0 * scene.width()).abs() < 2.0);
    window.click("View");
    window.click("Record a GIF");
    assert!(window.shows("recording"));
    for _ in 0..10 {
        window.advance(0.08);
        window.harness.step();
    }
    window.click("View");
    window.click("Stop recording");
    let film = window.folder.path().join("sphere.gif");
    for _ in 0..600 {
        window.advance(0.02);
        if film.exists() {
            break;
        }
        std::thread::sleep(std::time::Duration::from_millis(50));
    }
    let mut decoder = gif::DecodeOptions::new().read_info(std::fs::File::open(film).unwrap()).unwrap();
    let mut stills = 0;
    while decoder.read_next_frame().unwrap().is_some() {
        stills += 1;
    }
    assert!((8..=11).contains(&stills), "{stills} stills of ten");
}
