//! What is said: nothing that a file holds commands a terminal, files that contradict themselves are not called sound,
//! and every message names the file and a remedy that helps.

use super::objects::{OBJECTS, scene, write_scene};
use crate::common::program::{command, message, succeed};
use haptize::{dataset::Dataset, scene::Scene, sweep::build_object};
use std::{
    collections::{BTreeMap, BTreeSet},
    path::Path,
    process::Output,
};

/// A folder with a scene, its meshes and its dataset `x.haptize`.
fn home() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    write_scene(folder.path(), OBJECTS[0].1, 4);
    succeed(folder.path(), &["bake", "scene.toml", "-o", "x.haptize", "--backend", "cpu"]);
    folder
}

fn run(folder: &Path, arguments: &[&str]) -> Output {
    command(folder, arguments).output().unwrap()
}

/// The dataset `x.haptize` of `folder`, changed and saved as `name`: whole, with a valid checksum.
fn forge(folder: &Path, name: &str, change: impl FnOnce(&mut Dataset)) {
    let mut dataset = Dataset::load(&folder.join("x.haptize")).unwrap();
    change(&mut dataset);
    dataset.save(&folder.join(name)).unwrap();
}

#[test]
fn names_and_texts_of_files_do_not_command_the_terminal() {
    let home = home();
    let escape = "\u{1b}]0;owned\u{7}\u{1b}[2J\u{9b}31m\r";
    forge(home.path(), "escape.haptize", |dataset| {
        dataset.provenance.adapter = escape.into();
        dataset.provenance.backend = escape.into();
        dataset.provenance.notices = vec![escape.into()];
        dataset.provenance.algorithm = escape.into();
    });
    // A name is refused, as it is in a file.
    let mut named = Dataset::load(&home.path().join("x.haptize")).unwrap();
    named.grid.axes[0].name = escape.into();
    let refused = named.save(&home.path().join("named.haptize")).unwrap_err().to_string();
    assert!(refused.contains("U+001B") && !refused.contains('\u{1b}'), "{refused}");
    std::fs::write(home.path().join("escape.toml"), format!("name = \"{escape}\"\n[{escape}]")).unwrap();
    std::fs::write(home.path().join("escape.csv"), format!("{escape},1\n{escape}")).unwrap();
    for arguments in [
        &["info", "escape.haptize"][..],
        &["info", "escape.haptize", "--json"],
        &["play", "escape.haptize", "--seconds", "0.05"],
        &["inspect", "escape.haptize", "--q", "0,0"],
        &["bake", "escape.toml"],
        &["gridize", "escape.csv", "--step", "1"],
        &["play", "x.haptize", "--motion", "escape.csv"],
        &["play", "x.haptize", "--motion", escape],
        &["info", "x.haptize\nx.haptize: 9 points, sound"],
        &["bake", escape, "--json"],
        &[escape, "--json"],
    ] {
        let output = run(home.path(), arguments);
        for said in [&output.stdout, &output.stderr] {
            let said = String::from_utf8(said.clone()).unwrap();
            assert!(!said.contains(|c: char| c.is_control() && c != '\n'), "{arguments:?}: {said:?}");
            assert!(!said.contains("\nx.haptize: 9 points"), "{arguments:?}: {said:?}");
        }
    }
}

#[test]
fn a_dataset_whose_scene_describes_another_is_not_sound() {
    let home = home();
    forge(home.path(), "names.haptize", |dataset| {
        let name = dataset.grid.axes[0].name.clone();
        dataset.grid.axes[0].name = std::mem::replace(&mut dataset.grid.axes[1].name, name);
    });
    forge(home.path(), "unit.haptize", |dataset| dataset.grid.axes[1].unit = "rad".into());
    forge(home.path(), "broken.haptize", |dataset| dataset.scene = "name = 3".into());
    let sphere = "sphere = { radius = 0.04, subdivisions = 2 }\nsprings = { kind = \"isotropic\", stiffness = 300.0 }";
    std::fs::write(home.path().join("sphere.toml"), super::objects::scene(sphere, 4)).unwrap();
    succeed(home.path(), &["bake", "sphere.toml", "-o", "x.haptize", "--backend", "cpu"]);
    forge(home.path(), "radius.haptize", |dataset| {
        dataset.scene = dataset.scene.replace("radius = 0.04", "radius = 4.0")
    });
    assert_eq!(run(home.path(), &["info", "x.haptize"]).status.code(), Some(0));
    for (file, what) in [("names", "stands where"), ("unit", "in rad"), ("broken", "name"), ("radius", "radius is 4 m")]
    {
        let file = format!("{file}.haptize");
        let info = run(home.path(), &["info", &file]);
        let said = String::from_utf8(info.stdout).unwrap();
        assert!(info.status.code() == Some(1) && said.contains(what) && !said.contains("sound"), "{file}: {said}");
        for arguments in [&["play", &file, "--seconds", "0.05"][..], &["inspect", &file, "--q", "0,0"]] {
            let output = run(home.path(), arguments);
            let said = message(&output);
            assert!(output.status.code() == Some(1) && said.contains(what), "{arguments:?}: {said}");
        }
    }
}

/// Messages that once named no file, no line, or a remedy that does not help.
#[test]
fn messages_name_the_file_and_what_helps() {
    let home = home();
    let path = |name: &str| home.path().join(name);
    let scene = std::fs::read_to_string(path("scene.toml")).unwrap();
    let variant = |name: &str, old: &str, new: &str| {
        assert!(scene.contains(old), "{old}");
        std::fs::write(path(name), scene.replacen(old, new, 1)).unwrap();
    };
    variant("ground.toml", "ground = { stiffness = 50.0 }", "ground = { stiffness = 50.0, below = -9.0 }");
    variant("huge.toml", "start = -0.02", "start = -1e300");
    std::fs::write(path("empty.csv"), "time,slide,press\n").unwrap();
    std::fs::write(path("latin.toml"), b"# A remark\nname = \"W\xfcrfel\"\n").unwrap();
    std::fs::write(path("latin.urdf"), b"<robot>\n<link name=\"W\xfcrfel\"/></robot>").unwrap();
    std::fs::write(path("wide.toml"), [0xff, 0xfe, b'a', 0]).unwrap();
    for (name, text) in [
        ("bare", "[[joint]]\nname = 'a'\nposition = 3\ntorque = 4\n"),
        ("list", "filter = [3]\n"),
        ("odd", "[time]\ncolumn = 1.5\n"),
    ] {
        std::fs::write(path(&format!("{name}.toml")), text).unwrap();
    }
    std::fs::write(path("wide.csv"), [0xfe, 0xff, 0, b't']).unwrap();
    std::fs::write(path("bytes.csv"), [0xff, 0, 1, 2]).unwrap();
    forge(home.path(), "broken.haptize", |dataset| dataset.scene = "name = 3".into());
    for (arguments, expected, not) in [
        (&["play", "x.haptize", "--motion", "pres"][..], "`press`", "permissions"),
        (&["play", "x.haptize", "--motion", "empty.csv"], "empty.csv: holds no sample", "waypoint"),
        (&["bake", "none.toml"], "check the path", "room"),
        (&["bake", "x.haptize", "-o", "y.haptize"], "x.haptize: cannot read the scene: it is no text", "UTF-8"),
        (
            &["bake", "latin.toml"],
            "latin.toml: cannot read the scene: line 2 is not UTF-8: convert it with iconv",
            "binary",
        ),
        (&["import", "latin.urdf", "--tip", "a"], "latin.urdf: cannot read the robot: line 2 is not UTF-8", "binary"),
        (
            &["gridize", "empty.csv", "--columns", "wide.toml", "--step", "1"],
            "it is text in UTF-16, not UTF-8",
            "binary",
        ),
        (
            &["gridize", "empty.csv", "--columns", "bare.toml", "--step", "1"],
            "bare.toml:3:12: invalid type: integer `3`, expected a table, as in `{ column = \"NAME\" }`",
            "Quantity",
        ),
        (&["gridize", "empty.csv", "--columns", "list.toml", "--step", "1"], "list.toml:1:", "struct"),
        (
            &["gridize", "empty.csv", "--columns", "odd.toml", "--step", "1"],
            "odd.toml:2:10: the name of a column or its number",
            "ColumnName",
        ),
        (&["gridize", "wide.csv", "--step", "1"], "wide.csv: cannot be read: it is text in UTF-16, not UTF-8", "room"),
        (&["import", "x.haptize", "--tip", "a"], "x.haptize: cannot read the robot: it is no text", "UTF-8"),
        (
            &["gridize", "empty.csv", "--columns", "x.haptize", "--step", "1"],
            "x.haptize: cannot be read: it is no text",
            "UTF-8",
        ),
        (&["bake", "ground.toml"], "ground.toml:3:38: no node lies below", "--resume"),
        (&["inspect", "ground.toml", "--q", "0,0"], "ground.toml:3:38: no node lies below", "--resume"),
        (&["bake", "huge.toml"], "huge.toml:", "0000000000"),
        (&["inspect", "broken.haptize", "--q", "0,0"], "the scene in the dataset", "broken.haptize:1:"),
        (&["gridize", "bytes.csv", "--step", "1"], "bytes.csv: not a scan log", "room"),
        (&["view", "x.haptize", "--screenshot", "x.jpg"], "ends in .png", "space"),
    ] {
        let output = run(home.path(), arguments);
        let said = message(&output);
        assert_eq!(output.status.code(), Some(1), "{arguments:?}: {said}");
        assert!(said.contains(expected) && !said.contains(not), "{arguments:?}: {said}");
    }
    let blind = |arguments: &[&str]| {
        let mut command = command(home.path(), arguments);
        command.env("VK_DRIVER_FILES", "/none").env("VK_ICD_FILENAMES", "/none").output().unwrap()
    };
    let said = message(&blind(&["view", "x.haptize", "--screenshot", "x.png"]));
    assert!(said.contains("mesa-vulkan-drivers") && !said.contains("--backend"), "{said}");
}

/// What can be refused of an object only when it is built.
#[test]
fn what_is_refused_of_an_object_is_shown_at_its_key() {
    let home = tempfile::tempdir().unwrap();
    let [springs, .., lattice] = OBJECTS.map(|(_, object)| object);
    write_scene(home.path(), springs, 3);
    std::fs::write(home.path().join("open.obj"), "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n").unwrap();
    let path = home.path().join("scene.toml");
    let inclusion = "cell = 0.03, inclusion = [{ sphere = { centre = [0.0, 0.0, 1.0], radius = 0.01 }, young = 1e5 }]";
    for (object, old, new, place) in [
        (springs, "stiffness = 50.0", "stiffness = 50.0, below = -9.0", "-9.0"),
        (springs, "stiffness = 50.0", "stiffness = 50.0, nodes = [0, 700]", "[0, 700]"),
        (springs, "cube.obj\"", "open.obj\"", "\"open.obj\""),
        (springs, "scale = 0.04", "scale = 0.04, refine = 1e-6", "1e-6"),
        (lattice, "cell = 0.03", "cell = 1e-5", "1e-5"),
        (lattice, "cell = 0.03", inclusion, "{ sphere"),
        (springs, "stiffness = 50.0", "stiffness = 1e-12", "[object]"),
    ] {
        let text = scene(object, 3).replacen(old, new, 1);
        let expected = text.lines().enumerate().find_map(|(line, text)| Some((line + 1, text.find(place)? + 1)));
        let error = build_object(&Scene::parse(&text, &path).unwrap()).unwrap_err();
        assert_eq!(error.location().unwrap().line, expected, "{new}: {error}");
    }
}

/// Options that `said` names and that the command has not of which it is said: that of the last `haptize COMMAND` in
/// the sentence, or else `command`.
fn foreign_options(helps: &BTreeMap<&str, String>, command: &str, said: &str) -> Vec<String> {
    let (mut foreign, mut of, mut words) = (Vec::new(), command, said.split_whitespace().peekable());
    while let Some(word) = words.next() {
        let plain = |word: &str| word.trim_matches(|c: char| !c.is_ascii_alphanumeric() && c != '-').to_owned();
        if plain(word) == "haptize" {
            let next = words.peek().map(|next| plain(next)).unwrap_or_default();
            of = helps.keys().find(|name| **name == next).unwrap_or(&of);
        }
        let option = plain(word);
        if option.starts_with("--") && !helps[of].contains(option.split('=').next().unwrap()) {
            foreign.push(format!("{option} of {of}"));
        }
        if word.ends_with(['.', ';']) {
            of = command;
        }
    }
    foreign
}

/// Command lines, most of which are refused without an adapter or with files of the wrong kind.
const REFUSED: &[&[&str]] = &[
    &["accuracy", "none.toml", "-o", "a"],
    &["bake", "scene.toml", "-o", "y.haptize"],
    &["bake", "scene.toml", "-o", "y.haptize", "--backend", "gpu"],
    &["reach", "scene.toml", "--backend", "gpu"],
    &["bake", "scene.toml", "-o", "y.haptize", "--max-error", "1%", "--max-points", "10"],
    &["completions", "bash", "--json"],
    &["device", "check", "touch"],
    &["device", "list"],
    &["doctor"],
    &["export", "bytes", "--format", "csv"],
    &["gridize", "bytes", "--step", "1"],
    &["import", "bytes"],
    &["info", "bytes"],
    &["inspect", "x.haptize", "--q", "0"],
    &["man", "-o", "bytes"],
    &["new", "none"],
    &["new", "sphere", "-o", "full.toml"],
    &["paper", "-o", "bytes"],
    &["play", "x.haptize", "--device", "touch", "--seconds", "0.1"],
    &["play", "x.haptize", "--replay", "bytes"],
    &["scan", "sponge.toml", "-o", "full.toml"],
    &["view", "x.haptize", "--screenshot", "x.png"],
    &["view", "none.toml", "--screenshot", "x.png"],
];

#[test]
fn every_option_that_a_message_names_is_one_of_its_command() {
    let home = home();
    let told = |name: &[&str]| succeed(home.path(), &[name, &["--help"]].concat());
    // The demo is the program without a command.
    let whole = told(&[]);
    let commands = whole.lines().skip_while(|line| *line != "Commands:").skip(1).take_while(|line| !line.is_empty());
    let names: Vec<&str> =
        commands.filter_map(|line| line.split_whitespace().next()).filter(|name| *name != "help").collect();
    assert!(["bake", "place", "reach", "view"].iter().all(|name| names.contains(name)), "{names:?}");
    let mut helps: BTreeMap<&str, String> = names.iter().map(|name| (*name, told(&[*name]))).collect();
    helps.insert("", whole.clone());
    assert_eq!(
        foreign_options(&helps, "view", "use --backend cpu, or haptize bake --backend gpu; --size or --q"),
        ["--backend of view", "--q of view"]
    );
    std::fs::copy(Path::new(env!("CARGO_MANIFEST_DIR")).join("datasets/sponge.toml"), home.path().join("sponge.toml"))
        .unwrap();
    std::fs::write(home.path().join("bytes"), [0xff, 0xfe, 0, 1, 2]).unwrap();
    std::fs::write(home.path().join("full.toml"), "name = 3\n").unwrap();
    let mut refusals = BTreeSet::new();
    for (variable, value) in [("VK_DRIVER_FILES", "/none"), ("WGPU_ADAPTER_NAME", "nosuch")] {
        for arguments in REFUSED {
            let output = command(home.path(), arguments).env(variable, value).output().unwrap();
            for said in [&output.stdout, &output.stderr].map(|said| String::from_utf8_lossy(said)) {
                // A script and an echo of the usage are no messages.
                if arguments[0] != "completions" && output.status.code() != Some(2) {
                    let foreign = foreign_options(&helps, arguments[0], &said);
                    assert!(foreign.is_empty(), "{variable}, {arguments:?}: {foreign:?} in {said}");
                }
            }
            if output.status.code() == Some(1) {
                refusals.insert(arguments[0]);
            }
        }
    }
    assert!(refusals.len() > 10, "{refusals:?}");
}

#[test]
fn an_adapter_that_is_named_and_not_there_is_an_error_and_no_missing_driver() {
    let home = home();
    let named =
        |arguments: &[&str]| command(home.path(), arguments).env("WGPU_ADAPTER_NAME", "nosuch").output().unwrap();
    let bake = ["bake", "scene.toml", "-o", "y.haptize", "--law", "rest"];
    for arguments in [&bake[..], &["view", "x.haptize", "--screenshot", "x.png"]] {
        let output = named(arguments);
        let said = message(&output);
        assert_eq!(output.status.code(), Some(1), "{said}");
        assert!(said.contains("nosuch") && said.contains("WGPU_ADAPTER_NAME"), "{said}");
    }
    let output = named(&["doctor"]);
    let said = String::from_utf8(output.stdout).unwrap();
    assert!(said.contains("nosuch") && !said.contains("need a Vulkan driver"), "{said}");
    assert!(named(&["bake", "scene.toml", "-o", "y.haptize", "--backend", "cpu"]).status.success());
}

#[cfg(unix)]
#[test]
fn a_picture_for_which_there_is_no_room_leaves_the_earlier_one() {
    let home = home();
    let png = ["view", "x.haptize", "--screenshot", "x.png", "--time", "0.1"];
    succeed(home.path(), &png);
    let before = std::fs::read(home.path().join("x.png")).unwrap();
    let program = command(home.path(), &png);
    let line: Vec<&str> =
        std::iter::once(program.get_program()).chain(program.get_args()).map(|word| word.to_str().unwrap()).collect();
    let mut shell = std::process::Command::new("sh");
    shell.arg("-c").arg(format!("trap '' XFSZ; ulimit -f 20; exec {}", line.join(" "))).current_dir(home.path());
    let output = shell.output().unwrap();
    assert_eq!(output.status.code(), Some(1), "{}", message(&output));
    assert!(std::fs::read(home.path().join("x.png")).unwrap() == before);
}

/// A forgotten scale is known before hours of work are spent on it, and so is a triangle that was turned.
#[test]
fn what_is_known_of_a_body_is_said_once_and_before_it_is_solved() {
    let home = home();
    let mesh = std::fs::read_to_string(home.path().join("cube.obj")).unwrap();
    assert!(mesh.contains("f 1 3 4 2\n"), "a side of the cube, which is turned round");
    std::fs::write(home.path().join("cube.obj"), mesh.replace("f 1 3 4 2\n", "f 2 4 3 1\n")).unwrap();
    let said = |arguments: &[&str]| {
        let text = message(&run(home.path(), arguments));
        let lines: Vec<&str> = text.lines().collect();
        let found: Vec<usize> = (0..lines.len()).filter(|&line| lines[line].contains("faced the material")).collect();
        assert_eq!(found.len(), 1, "{arguments:?}: {text}");
        let results = lines.iter().position(|line| line.contains("points") || line.contains("contact along"));
        assert!(results.is_none_or(|results| found[0] < results), "{arguments:?}: {text}");
        lines[found[0]].to_owned()
    };
    let baked = said(&["bake", "scene.toml", "-o", "y.haptize", "--backend", "cpu"]);
    for arguments in [
        &["inspect", "scene.toml", "--q", "0,0"][..],
        &["bake", "scene.toml", "-o", "z.haptize", "--backend", "cpu", "--max-error", "90%"],
        &["bake", "scene.toml", "--shard", "0/2", "-o", "shards", "--backend", "cpu"],
        &["plan", "scene.toml", "--shards", "2"],
        &["reach", "scene.toml", "--backend", "cpu"],
        &["play", "scene.toml", "--seconds", "0.01"],
        &["place", "scene.toml"],
    ] {
        assert_eq!(said(arguments), baked);
    }
}
