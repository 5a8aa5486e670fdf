//! The program as a user meets it: exit codes, messages, `--json`, and what is left on disk.

use crate::common::program::{PROGRAM, command, haptize, json, text};
use serde_json::Value;
use std::{path::Path, process::Command};

#[test]
fn doctor_says_what_the_machine_offers() {
    let folder = tempfile::tempdir().unwrap();
    let found = json(folder.path(), &["doctor", "--json"]);
    assert_eq!(found["version"], env!("CARGO_PKG_VERSION"));
    assert!(found["threads"].as_u64().unwrap() >= 1);
    let hardware = found["adapters"].as_array().unwrap().iter().any(|adapter| adapter["hardware"] == true);
    assert_eq!(found["automatic_backend"], if hardware { "gpu" } else { "cpu" });

    let output = haptize(folder.path(), &["doctor"]);
    assert_eq!(output.status.code(), Some(0));
    assert!(text(&output.stdout).contains("haptize bake takes"), "{}", text(&output.stdout));
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0, "doctor leaves nothing behind");
}

#[test]
fn new_writes_scenes_that_bake_and_replaces_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let written = json(folder.path(), &["new", "--from", "mesh", "-o", "my.toml", "--json"]);
    assert_eq!(written["files"], serde_json::json!(["my.toml", "bean.obj"]));
    let baked = json(folder.path(), &["bake", "my.toml", "--measure-error", "0", "--json"]);
    assert!(baked["contact_points"].as_u64() > Some(100), "{baked}");
    let forecast = &baked["forecast"];
    let size = std::fs::metadata(folder.path().join("my.haptize")).unwrap().len() as f64;
    assert!((0.5..2.0).contains(&(forecast["disk"].as_f64().unwrap() / size)), "{forecast}, {size} bytes");
    assert!(forecast["seconds"].as_f64() > Some(0.0), "{forecast}");

    std::fs::write(folder.path().join("my.toml"), "# mine").unwrap();
    let output = haptize(folder.path(), &["new", "-o", "my.toml"]);
    assert_eq!(output.status.code(), Some(1));
    assert!(text(&output.stderr).contains("exists already"), "{}", text(&output.stderr));
    assert_eq!(std::fs::read_to_string(folder.path().join("my.toml")).unwrap(), "# mine");
    assert_eq!(haptize(folder.path(), &["new"]).status.code(), Some(0));
    assert!(folder.path().join("sphere.toml").is_file());

    for (first, typed) in [("my.toml", "haptize new -o my.toml"), ("mesh", "haptize new --from mesh")] {
        let output = haptize(folder.path(), &["new", first]);
        assert_eq!(output.status.code(), Some(2), "{first}");
        assert!(text(&output.stderr).contains(typed), "{}", text(&output.stderr));
    }
}

#[test]
fn completions_and_manual_pages_name_every_command() {
    let folder = tempfile::tempdir().unwrap();
    for shell in ["bash", "zsh", "fish", "powershell", "elvish"] {
        let script = text(&haptize(folder.path(), &["completions", shell]).stdout);
        assert!(script.contains("gridize") && script.contains("max-error"), "{shell}: {script}");
    }
    let pages = json(folder.path(), &["man", "-o", "pages", "--json"]);
    let pages = pages["files"].as_array().unwrap().len();
    assert!(pages > 14, "{pages}");
    let page = std::fs::read_to_string(folder.path().join("pages/haptize-bake.1")).unwrap();
    assert!(page.contains("max\\-error") && page.contains("Examples"), "{page}");
}

#[test]
fn an_unknown_command_is_a_usage_error() {
    let folder = tempfile::tempdir().unwrap();
    for arguments in [&["bark"][..], &["doctor", "--loud"]] {
        let output = haptize(folder.path(), arguments);
        assert_eq!(output.status.code(), Some(2), "{arguments:?}");
        assert!(text(&output.stderr).contains("--help"), "{}", text(&output.stderr));
        assert!(output.stdout.is_empty());
    }
}

/// A finger of one joint above a ball, at eight angles.
pub const FINGER: &str = include_str!("../scenes/finger.toml");

/// A tetrahedron without its last face.
const OPEN_MESH: &str = "v 0 0 0\nv 0.1 0 0\nv 0 0.1 0\nv 0 0 0.1\nf 1 3 2\nf 1 2 4\nf 2 3 4\n";

/// The scene with `old` replaced by `new`.
pub fn changed(old: &str, new: &str) -> String {
    assert_eq!(FINGER.matches(old).count(), 1, "{old} stands once in the scene");
    FINGER.replace(old, new)
}

#[test]
fn broken_scenes_are_refused_with_place_and_remedy() {
    let sphere = "sphere = { radius = 0.05, rings = 10, segments = 10 }";
    let joint = &FINGER[FINGER.find("[[proxy").unwrap()..FINGER.find("[contact]").unwrap()];
    let axis = "{ start = 0.0, stop = 0.28, count = 8 }";
    let large = "{ start = 0.0, stop = 0.28, count = 10000 }, ".repeat(3);
    let cases = [
        // What is wrong, the scene, the line at fault (empty: the file as a whole), and what the message has to name.
        ("an unknown key", changed("rate = 60.0", "rating = 60.0"), "rating = 60.0", "rating"),
        ("negative stiffness", changed("stiffness = 300.0", "stiffness = -300.0"), "-300.0", "positive"),
        ("a NaN", changed("node_mass = 0.005", "node_mass = nan"), "node_mass = nan", "node_mass"),
        ("a name of two lines", changed("name = \"finger\"", r#"name = "finger\n1 point""#), "name =", "U+000A"),
        ("a name that turns", changed("name = \"finger\"", r#"name = "finger\u202e""#), "name =", "U+202E"),
        ("no TOML", changed("name = \"finger\"", "name = finger"), "name = finger", "expected"),
        ("a missing mesh", changed(sphere, "mesh = { file = \"none.obj\" }"), "none.obj", "cannot be opened"),
        ("an open mesh", changed(sphere, "mesh = { file = \"open.obj\" }"), "", "open.obj"),
        ("no ground", changed("stiffness = 100.0", "stiffness = 100.0\nbelow = -1.0"), "", "ground"),
        ("10^12 points", changed(joint, &joint.repeat(3)).replace(axis, &large), "count = 10000", "1.000e12 points"),
    ];
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("open.obj"), OPEN_MESH).unwrap();
    for (what, scene, line, word) in cases {
        std::fs::write(folder.path().join("broken.toml"), &scene).unwrap();
        let output = haptize(folder.path(), &["bake", "broken.toml", "-o", "broken.haptize", "--json"]);
        let message = text(&output.stderr);
        assert_eq!(output.status.code(), Some(1), "{what}: {message}");
        let told: Value = serde_json::from_slice(&output.stdout).unwrap();
        assert_eq!(told["error"], message.trim_end()["haptize: ".len()..], "{what}");
        assert!(message.starts_with("haptize: ") && message.contains(word), "{what}: {message}");
        if !line.is_empty() {
            let found = scene.lines().position(|candidate| candidate.contains(line)).unwrap();
            // The span of a missing or doubtful entry may begin at its table's header, one line above.
            let places = [found, found + 1].map(|number| format!("broken.toml:{number}:"));
            assert!(places.iter().any(|place| message.contains(place)), "{what} near line {}: {message}", found + 1);
        }
        let left = std::fs::read_dir(folder.path()).unwrap().count();
        assert_eq!(left, 2, "{what} leaves nothing behind");
    }
}

#[test]
fn a_gpu_that_is_asked_for_and_not_there_is_an_error_and_left_out_is_none() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("finger.toml"), FINGER).unwrap();
    let bake = |backend: &str| {
        let mut command = command(folder.path(), &["bake", "finger.toml", "--json", "--backend", backend]);
        command.env("VK_DRIVER_FILES", "/none").env("VK_ICD_FILENAMES", "/none").output().unwrap()
    };
    let refused = bake("gpu");
    assert_eq!(refused.status.code(), Some(1));
    let message = text(&refused.stderr);
    assert!(message.contains("Vulkan driver") && message.contains("--backend cpu"), "{message}");
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1, "no part is begun");
    let taken: Value = serde_json::from_slice(&bake("auto").stdout).unwrap();
    assert_eq!(taken["backend"], "cpu");
}

#[test]
fn a_missing_or_broken_file_is_named() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("finger.toml"), FINGER).unwrap();
    let report = json(folder.path(), &["bake", "finger.toml", "--json"]);
    assert_eq!(report["points"], 8);
    let whole = std::fs::read(folder.path().join("finger.haptize")).unwrap();
    std::fs::write(folder.path().join("cut.haptize"), &whole[..whole.len() - 1]).unwrap();
    let mut altered = whole.clone();
    altered[whole.len() / 2] ^= 1;
    std::fs::write(folder.path().join("altered.haptize"), altered).unwrap();
    std::fs::write(folder.path().join("empty.haptize"), "").unwrap();
    for file in ["none.haptize", "cut.haptize", "altered.haptize", "empty.haptize", "finger.toml", "."] {
        for command in [&["info", file][..], &["export", file, "--format", "csv"]] {
            let output = haptize(folder.path(), command);
            let message = text(&output.stderr);
            assert_eq!(output.status.code(), Some(1), "{command:?}: {message}");
            assert!(message.starts_with(&format!("haptize: {file}: ")), "{command:?}: {message}");
            let remedy = if file == "." { ": give a file in it" } else { "; " };
            assert!(message.contains(remedy), "{command:?} says what to do: {message}");
        }
    }
    assert!(!folder.path().join("cut.csv").exists(), "nothing is exported from a broken file");
}

#[test]
fn bake_info_and_export_tell_the_same() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("finger.toml"), FINGER).unwrap();
    let baked = json(folder.path(), &["bake", "finger.toml", "-o", "f.haptize", "--backend", "cpu", "--json"]);
    for key in [
        "points",
        "contact_points",
        "unconverged",
        "overflowed",
        "max_residual",
        "iterations",
        "seconds",
        "configurations_per_second",
        "backend",
        "adapter",
        "algorithm",
    ] {
        assert!(!baked[key].is_null(), "{key} in {baked}");
    }
    assert_eq!((&baked["backend"], &baked["algorithm"]), (&"cpu".into(), &"rest".into()));
    let held = json(folder.path(), &["info", "f.haptize", "--json"]);
    assert_eq!(held["points"], baked["points"]);
    assert_eq!(held["contact"], baked["contact_points"]);
    let exported = json(folder.path(), &["export", "f.haptize", "--format", "csv", "--json"]);
    let files = exported["files"].as_array().unwrap();
    let rows = std::fs::read_to_string(folder.path().join(files[0].as_str().unwrap())).unwrap();
    assert_eq!(rows.lines().filter(|line| !line.starts_with('#')).count(), 1 + 8, "{rows}");
}

/// What a file says of who made it, and of its interpolation, stays within its line.
#[test]
fn no_text_of_a_dataset_forges_a_line_of_info() {
    use haptize::dataset::{Dataset, InterpolationError, MeasuredError};
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("finger.toml"), FINGER).unwrap();
    json(folder.path(), &["bake", "finger.toml", "-o", "f.haptize", "--backend", "cpu", "--json"]);
    let mut dataset = Dataset::load(&folder.path().join("f.haptize")).unwrap();
    let honest = haptize(folder.path(), &["info", "f.haptize"]).stdout;
    let odd = || "x\nforged: sound\u{202e}\u{2028}\u{1b}[2J".to_owned();
    let made = &mut dataset.provenance;
    for text in [&mut made.version, &mut made.algorithm, &mut made.backend, &mut made.adapter, &mut made.date] {
        *text = odd();
    }
    let errors = vec![InterpolationError { interpolation: odd(), ..InterpolationError::default() }];
    made.error = Some(MeasuredError { configurations: 1, interpolation: odd(), errors, ..MeasuredError::default() });
    dataset.save(&folder.path().join("f.haptize")).unwrap();
    let told = text(&haptize(folder.path(), &["info", "f.haptize"]).stdout);
    assert!(told.contains("x\\u000aforged: sound\\u202e\\u2028\\u001b[2J"), "{told}");
    assert!(!told.lines().any(|line| line.starts_with("forged")), "{told}");
    assert!(!told.contains(['\u{202e}', '\u{2028}', '\u{1b}']), "{told}");
    // The error takes as many lines as where it is honest, less those of the other interpolation.
    assert!(told.lines().count() <= text(&honest).lines().count(), "{told}");
    json(folder.path(), &["info", "f.haptize", "--json"]);
}

#[test]
fn a_bake_that_touches_nothing_fails_and_says_how_far_the_object_is() {
    let folder = tempfile::tempdir().unwrap();
    let axis = "start = 0.0, stop = 0.28, count = 8";
    std::fs::write(folder.path().join("up.toml"), changed(axis, "start = -0.28, stop = -0.1, count = 8")).unwrap();
    let bake =
        |more: &[&str]| haptize(folder.path(), &[&["bake", "up.toml", "--backend", "cpu", "--json"], more].concat());
    let output = bake(&[]);
    let (told, message): (Value, String) = (serde_json::from_slice(&output.stdout).unwrap(), text(&output.stderr));
    assert_eq!((output.status.code(), told["contact_points"].as_u64()), (Some(1), Some(0)), "{message}");
    // The tip turns up about (-0.1, 0, 0.06) by 0.1 rad at least: from above the ball's top at z = 0.05.
    let tip = 0.06 + 0.1 * 0.1_f64.sin() - 0.05;
    let clearance = &told["clearance"];
    assert!((clearance["gap"].as_f64().unwrap() - tip).abs() < 1e-4, "{told}");
    assert_eq!((clearance["node"].as_u64(), clearance["q"][0].as_f64()), (Some(0), Some(-0.1)), "{told}");
    let way = clearance["motion"][2].as_f64().unwrap();
    assert!((way - tip).abs() < 1e-4, "{told}");
    for words in ["nothing touches", "contact node 0", "moving the object by", "haptize reach", "--allow-free"] {
        assert!(message.contains(words), "{words}: {message}");
    }
    assert!(told["defect"].as_str().unwrap().contains("zero everywhere"), "{told}");
    let allowed = bake(&["--allow-free"]);
    assert!(allowed.status.success() && !text(&allowed.stdout).contains("defect"), "{}", text(&allowed.stdout));
    let motion = "0,-0.2\n0.1,-0.15\n";
    std::fs::write(folder.path().join("way.csv"), motion).unwrap();
    let played = haptize(folder.path(), &["play", "up.haptize", "--motion", "way.csv"]);
    assert_eq!(played.status.code(), Some(0), "{}", text(&played.stderr));
    assert!(text(&played.stderr).contains("nothing touches"), "{}", text(&played.stderr));
}

#[test]
fn a_session_is_recorded_and_replayed_bit_for_bit_and_wrong_input_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    let motion = "\n[motion]\npress = [{ time = 0.0, q = [0.0] }, { time = 0.2, q = [0.25] }]\n";
    std::fs::write(path("finger.toml"), format!("{FINGER}{motion}")).unwrap();
    json(folder.path(), &["bake", "finger.toml", "--backend", "cpu", "--measure-error", "0", "--json"]);
    let play = |arguments: &[&str]| json(folder.path(), &[&["play", "finger.haptize", "--json"], arguments].concat());
    let first = play(&["--realtime", "--record", "r.csv", "-o", "first"]);
    assert!(first["contact_share"].as_f64() > Some(0.0), "{first}");
    let again = play(&["--replay", "r.csv", "-o", "again"]);
    assert_eq!((&first["replayed"], &again["replayed"]), (&false.into(), &true.into()));
    for file in ["trace.csv", "frames.csv"] {
        let [a, b] = ["first", "again"].map(|folder| std::fs::read(path(folder).join(file)).unwrap());
        assert!(a == b, "{file} differs");
    }
    // A page: replaced by its like, and by nothing else; never where another output goes.
    let paged = |file: &str| play(&["--html", file, "-o", "again"]);
    assert!(paged("page.html")["page"].get("replaced").is_none());
    assert_eq!(paged("page.html")["page"]["file"], "page.html");
    assert!(paged("page.html")["page"]["replaced"]["bytes"].as_u64() > Some(10_000));
    std::fs::write(path("mine.html"), "<p>by hand</p>").unwrap();
    for (arguments, expected) in [
        (["--html", "mine.html", "-o", "again"], "not a table or figure of haptize"),
        (["--html", "a.mcap", "--record", "a.mcap"], "another output of this command"),
        (["--html", "again/trace.csv", "-o", "again"], "another output of this command"),
        (["--html", "new", "-o", "new"], "another output of this command"),
    ] {
        let output = haptize(folder.path(), &[&["play", "finger.haptize"], &arguments[..]].concat());
        assert!(text(&output.stderr).contains(expected), "{arguments:?}: {}", text(&output.stderr));
    }
    assert_eq!(std::fs::read_to_string(path("mine.html")).unwrap(), "<p>by hand</p>");
    let inspected = json(folder.path(), &["inspect", "finger.haptize", "--q", "50%", "--html", "page.html", "--json"]);
    assert!(inspected["page"]["replaced"]["bytes"].as_u64() > Some(10_000), "{inspected}");
    // A device that leaps: torque to zero, the reason, and no success.
    std::fs::write(path("leap.csv"), "0,0\n0.1,0\n0.101,0.25\n0.2,0.25\n").unwrap();
    let output = haptize(folder.path(), &["play", "finger.haptize", "--motion", "leap.csv", "--exact", "--json"]);
    let told: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(output.status.code(), Some(1));
    assert!(
        told["fault"]["reason"].as_str().unwrap().contains("leapt") && told["faults"].as_u64() > Some(50),
        "{told}"
    );

    std::fs::write(path("wide.csv"), "0,0\n0.1,0,0\n").unwrap();
    std::fs::write(path("nan.csv"), "# by hand\ntime,q1\n0,0\n0.1,nan\n").unwrap();
    std::fs::write(path("point.csv"), "0,0\n").unwrap();
    let recorded = std::fs::read_to_string(path("r.csv")).unwrap();
    // The proxy's position; the last column is what the device held.
    let (rest, held) = recorded.trim_end().rsplit_once(',').unwrap();
    let (before, _) = rest.rsplit_once(',').unwrap();
    std::fs::write(path("altered.csv"), format!("{before},0.1,{held}\n")).unwrap();
    for (arguments, expected) in [
        (&["none.haptize"][..], "none.haptize"),
        (&["finger.haptize", "--motion", "none.csv"], "none.csv: cannot be read"),
        (&["finger.haptize", "--motion", "wide.csv"], "wide.csv:2: 3 numbers"),
        (&["finger.haptize", "--motion", "nan.csv"], "nan.csv:4: NaN is not a coordinate"),
        (&["finger.haptize", "--motion", "point.csv"], "a single position: give --seconds"),
        (&["finger.haptize", "--motion", "scrape"], "no motion \"scrape\""),
        (&["finger.haptize", "--seconds", "nan"], "--seconds"),
        (&["finger.haptize", "--replay", "none.csv"], "none.csv: cannot be read"),
        (&["finger.haptize", "--replay", "nan.csv"], "nan.csv:2: "),
        (
            &["finger.haptize", "--replay", "session.mcap"],
            "session.mcap: MCAP holds positions and torques, of which --motion",
        ),
        (&["finger.haptize", "--replay", "altered.csv"], "altered.csv: the session differs from tick 1"),
        (&["finger.haptize", "--record", "no/such/folder.csv"], "folder.csv"),
        (&["finger.haptize", "-o", "nan.csv"], "nan.csv"),
        (&["finger.haptize", "-o", "unplayed", "--beside", "none.haptize"], "none.haptize"),
        (&["finger.haptize", "-o", "unplayed", "--beside", "nan.csv"], "nan.csv"),
        (&["finger.haptize", "-o", "unplayed", "--beside", "finger.haptize"], "three joints"),
    ] {
        let output = haptize(folder.path(), &[&["play"], arguments].concat());
        let message = text(&output.stderr);
        assert_eq!(output.status.code(), Some(1), "{arguments:?}: {message}");
        assert!(message.starts_with("haptize: ") && message.contains(expected), "{arguments:?}: {message}");
        assert!(output.stdout.is_empty(), "{arguments:?}");
    }
    // Nothing was played before the refusal.
    assert!(!folder.path().join("unplayed/trace.csv").exists());
    let both = haptize(folder.path(), &["play", "finger.haptize", "--replay", "r.csv", "--realtime"]);
    assert_eq!(both.status.code(), Some(2));
}

/// The finger on a turning base, stiff enough that the usual damping of the proxy is not passive.
fn stiff_arm() -> String {
    let base = "[[proxy.joint]]\nkind = \"revolute\"\naxis = [0.0, 0.0, 1.0]\nlimits = [-0.5, 0.5]\n[[proxy.joint]]";
    changed("[[proxy.joint]]", base)
        .replace("axes = [", "axes = [{ start = -0.3, stop = 0.3, count = 7 }, ")
        .replace("stiffness = 300.0", "stiffness = 3000.0")
        .replace("stiffness = 1000.0", "stiffness = 10000.0")
}

#[test]
fn a_scene_that_names_neither_motions_nor_damping_is_pressed_and_scraped_passively() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("arm.toml"), stiff_arm()).unwrap();
    json(folder.path(), &["bake", "arm.toml", "--backend", "cpu", "--measure-error", "0", "--json"]);
    for motion in ["press", "scrape"] {
        let output = haptize(folder.path(), &["play", "arm.haptize", "--motion", motion, "--json"]);
        let told = text(&output.stderr);
        assert_eq!(output.status.code(), Some(0), "{told}");
        assert!(told.contains(&format!("the scene names no {motion}")) && !told.contains("not passive"), "{told}");
        let played: Value = serde_json::from_slice(&output.stdout).unwrap();
        let touching = played["contact_share"].as_f64().unwrap();
        assert!((0.1..0.99).contains(&touching), "{motion}: begins and ends free, {touching}");
        assert_eq!(
            (&played["held"], &played["limited"]),
            (&0.into(), &0.into()),
            "{motion} stays within grid and limits"
        );
    }

    // Gains that a scene names are taken as they are; one warning names values, and these are passive.
    let bake = |damping: &str| {
        let scene = stiff_arm().replace("[graphics]", &format!("[haptics]\nproxy_damping = {damping}\n[graphics]"));
        std::fs::write(folder.path().join("named.toml"), scene).unwrap();
        json(folder.path(), &["bake", "named.toml", "--backend", "cpu", "--measure-error", "0", "--json"]);
        text(&haptize(folder.path(), &["play", "named.haptize", "--seconds", "0.1"]).stderr)
    };
    let told = bake("0.02");
    let advice: Vec<&str> = told.lines().filter(|line| line.contains("not passive")).collect();
    assert_eq!(advice.len(), 1, "{told}");
    let named = advice[0].split("proxy_damping = ").nth(1).unwrap();
    let session = ["play", "named.haptize", "--seconds", "0.1", "--passive-gains"];
    let told = text(&haptize(folder.path(), &session).stderr);
    let made = format!("the gains are made passive: proxy_damping = {named}");
    assert!(told.contains(&made) && !told.contains("not passive"), "{told}");
    assert!(!bake(named).contains("not passive"), "{named}");
}

#[test]
fn tables_that_cannot_be_gridized_are_refused_with_place_and_remedy() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("table.csv"), "a,b\n1,2\n").unwrap();
    std::fs::write(folder.path().join("columns.toml"), "colour = 1\n").unwrap();
    for (arguments, expected) in [
        (&["none.csv", "--step", "1"][..], "none.csv: cannot be read"),
        (&["table.csv", "--step", "-1"], "table.csv: not a scan log"),
        (&["table.csv", "--step", "1"], "--columns), which `haptize gridize --guess LOG` writes"),
        (&["table.csv", "--step", "1", "--columns", "none.toml"], "none.toml: cannot be read"),
        (&["table.csv", "--step", "1", "--columns", "columns.toml"], "columns.toml:1:1: unknown field `colour`"),
    ] {
        let output = haptize(folder.path(), &[&["gridize"], arguments].concat());
        let message = text(&output.stderr);
        assert_eq!(output.status.code(), Some(1), "{arguments:?}: {message}");
        assert!(message.starts_with("haptize: ") && message.contains(expected), "{arguments:?}: {message}");
    }
}

/// What is solved at a configuration does not depend on the grid, and a scene need not have one.
#[test]
fn inspect_solves_a_scene_without_a_grid_as_one_with_it() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("with.toml"), FINGER).unwrap();
    let without = changed("[grid]\naxes = [{ start = 0.0, stop = 0.28, count = 8 }]\n", "");
    std::fs::write(folder.path().join("without.toml"), without).unwrap();
    let inspect = |scene: &str, q: &str| {
        let output = haptize(folder.path(), &["inspect", scene, q, "--json"]);
        (output.status.code(), serde_json::from_slice::<Value>(&output.stdout).unwrap())
    };
    let (with, without) = (inspect("with.toml", "--q=0.2").1, inspect("without.toml", "--q=0.2").1);
    assert!(with["torque"][0].as_f64().unwrap().abs() > 1e-3, "it touches: {with}");
    assert_eq!(with, without);
    let (code, beyond) = inspect("without.toml", "--q=0.6");
    assert!(code == Some(0) && beyond["warnings"][0].as_str().unwrap().contains("limits"), "{beyond}");
    for (scene, q, expected) in [
        ("without.toml", "--q=50%", "no [grid]"),
        ("with.toml", "--q=0.1,50%", "--q must be 1 finite numbers"),
        ("without.toml", "--q=0.1,0.2", "--q must be 1 finite numbers"),
    ] {
        let (code, told) = inspect(scene, q);
        assert!(code == Some(1) && told["error"].as_str().unwrap().contains(expected), "{q}: {told}");
    }
}

/// Every failure, that of the command line too, is one JSON object where that is asked for.
#[test]
fn what_is_no_scene_and_a_place_that_is_not_there_are_told_with_the_remedy() {
    let folder = tempfile::tempdir().unwrap();
    let write = |name: &str, text: &str| std::fs::write(folder.path().join(name), text).unwrap();
    write("block.obj", "v 0 0 0\n");
    write("arm.urdf", "<robot name=\"arm\"/>\n");
    write("arm", "v 0 0 0\n");
    for (arguments, expected) in [
        (
            ["bake", "block.obj"].as_slice(),
            "block.obj:1:3: this is no scene, which is TOML: a scene names a mesh in [object.mesh]",
        ),
        (&["bake", "arm.urdf"], "`haptize import` makes one of a robot's file"),
        (&["play", "block.obj"], "not a haptize dataset"),
        (&["bake", "arm"], "arm:1:3: key with no value"),
        (&["new", "-o", "none/ball.toml"], "none/ball.toml: cannot be written: none: No such file"),
    ] {
        let output = haptize(folder.path(), arguments);
        let message = text(&output.stderr);
        assert!(output.status.code() == Some(1) && message.contains(expected), "{arguments:?}: {message}");
    }
}

#[test]
fn an_inspection_in_free_space_names_what_is_nearest() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("finger.toml"), FINGER).unwrap();
    let inspect = |q: &str| json(folder.path(), &["inspect", "finger.toml", q, "--json"]);
    let (free, pressed) = (inspect("--q=0.0"), inspect("--q=0.2"));
    assert!(pressed["clearance"].is_null() && pressed["gap"].as_f64() < Some(0.0), "{pressed}");
    assert!(free["gap"].as_f64() > Some(0.0) && free["clearance"]["gap"] == free["gap"], "{free}");
    let told = text(&haptize(folder.path(), &["inspect", "finger.toml", "--q=0.0"]).stdout);
    assert!(
        told.contains("  nearest      the least gap is ") && told.contains(" on the object; moving the object by "),
        "{told}"
    );
}

#[test]
fn every_failure_is_one_json_object() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("finger.toml"), FINGER).unwrap();
    std::fs::write(folder.path().join("out"), "a file, not a folder").unwrap();
    let failed: [&[&str]; 12] = [
        &[],
        &["accuracy", "none.toml"],
        &["bake", "none.toml"],
        &["bake", "finger.toml", "-o", "none/f.haptize"],
        &["export", "none.haptize", "--format", "csv"],
        &["gridize", "none.csv", "--step", "1"],
        &["info", "none.haptize"],
        &["inspect", "finger.toml", "--q=1,2"],
        &["paper", "-o", "finger.toml"],
        &["play", "none.haptize"],
        &["scan", "none.toml"],
        &["view", "finger.toml", "--screenshot", "w.jpg"],
    ];
    let wrong: [&[&str]; 7] = [
        &["bark"],
        &["--loud"],
        &["bake"],
        &["bake", "finger.toml", "--max-error", "much"],
        &["inspect", "finger.toml"],
        &["view", "finger.toml", "--size", "0x0"],
        &["play", "f.haptize", "--replay", "r.csv", "--realtime"],
    ];
    for (code, arguments) in failed.map(|arguments| (1, arguments)).into_iter().chain(wrong.map(|a| (2, a))) {
        let output = haptize(folder.path(), &[arguments, &["--json"]].concat());
        let message = text(&output.stderr);
        assert_eq!(output.status.code(), Some(code), "{arguments:?}: {message}");
        let told: Value = serde_json::from_slice(&output.stdout).unwrap_or_else(|why| panic!("{arguments:?}: {why}"));
        let error = told["error"].as_str().unwrap();
        assert!(!error.is_empty() && message.contains(error), "{arguments:?}: {error} and {message}");
    }
    for asked in ["--help", "--version"] {
        assert_eq!(haptize(folder.path(), &["--json", asked]).status.code(), Some(0));
    }
}

#[test]
fn a_plan_has_lines_for_schedulers_that_a_shell_takes() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("my finger.toml"), FINGER).unwrap();
    let plan = json(folder.path(), &["plan", "my finger.toml", "--shards", "4", "--cores", "2", "--json"]);
    assert_eq!((&plan["points"], plan["shards"].as_array().unwrap().len()), (&8.into(), 4));
    let lines = |name: &str| -> Vec<String> { serde_json::from_value(plan["lines"][name].clone()).unwrap() };
    assert!(lines("slurm")[0].contains("--array=0-3 --cpus-per-task=2"), "{plan}");
    for line in ["slurm", "parallel", "hyperqueue"].into_iter().flat_map(lines) {
        let checked = Command::new("sh").args(["-n", "-c", &line]).status().unwrap();
        assert!(checked.success(), "{line}");
    }
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1, "a plan writes nothing");

    // Names like options: the lines run.
    std::fs::rename(folder.path().join("my finger.toml"), folder.path().join("-x.toml")).unwrap();
    let plan = json(folder.path(), &["plan", "./-x.toml", "--shards", "2", "--cores", "2", "--json"]);
    let lines: Vec<String> = serde_json::from_value(plan["lines"]["parallel"].clone()).unwrap();
    let (program, bake) = (Path::new(PROGRAM), lines[0].split_once("--retries 3 ").unwrap().1);
    let script = format!(
        "PATH={}:$PATH; for k in 0 1; do eval \"$(echo {bake} | sed s/{{}}/$k/)\"; done; {}",
        program.parent().unwrap().display(),
        lines[1]
    );
    let ran = Command::new("sh").args(["-e", "-c", &script]).current_dir(folder.path()).output().unwrap();
    assert!(ran.status.success(), "{script}: {}", text(&ran.stderr));
    assert!(folder.path().join("-x.haptize").exists());
}

/// The finger without its grid, and a comment that is to survive.
pub fn without_grid() -> String {
    changed("[grid]\naxes = [{ start = 0.0, stop = 0.28, count = 8 }]\n", "# no grid\n")
}

#[test]
fn a_scene_that_leaves_the_grid_out_gets_one() {
    let folder = tempfile::tempdir().unwrap();
    let scene = folder.path().join("finger.toml");
    std::fs::write(&scene, without_grid()).unwrap();
    let found = json(folder.path(), &["reach", "finger.toml", "--json", "--backend", "cpu"]);
    assert_eq!(std::fs::read_to_string(&scene).unwrap(), without_grid(), "nothing is written unless asked for");
    let [low, high] = [0, 1].map(|end| found["joints"][0]["range"][end].as_f64().unwrap());
    // The finger touches once its tip has come down by a tenth of its length.
    assert!((0.05..0.2).contains(&low) && (low + 0.1..=0.5).contains(&high), "{found}");
    assert!(
        found["costs"].as_array().unwrap().len() > 1 && found["grid"].as_str().unwrap().starts_with("[grid]"),
        "{found}"
    );
    let baked = json(folder.path(), &["bake", "finger.toml", "--backend", "cpu", "--json"]);
    let shard = haptize(folder.path(), &["bake", "finger.toml", "--shard", "0/2"]);
    assert!(text(&shard.stderr).contains("haptize reach"), "{}", text(&shard.stderr));
    json(folder.path(), &["reach", "finger.toml", "--write", "--json", "--backend", "cpu"]);
    let written = std::fs::read_to_string(&scene).unwrap();
    assert!(written.starts_with(without_grid().trim_end()) && written.contains("# no grid"), "{written}");
    let again = json(folder.path(), &["bake", "finger.toml", "--backend", "cpu", "--json"]);
    assert_eq!(again["points"], baked["points"]);
    // Written again, the grid stands in the place of the one before.
    json(folder.path(), &["reach", "finger.toml", "--write", "--json", "--backend", "cpu"]);
    assert_eq!(std::fs::read_to_string(&scene).unwrap(), written);
}
