//! A dataset stands alone: every command that reads one needs neither scene nor mesh, and says the same without them.

use super::objects::{OBJECTS, write_scene};
use crate::common::program::{command, message, succeed};
use haptize::{dataset::Dataset, object::Object, scene::Scene};
use std::{collections::BTreeMap, path::Path};

/// Commands that read a dataset, and the files that they leave.
const COMMANDS: [&[&str]; 6] = [
    &["info", "x.haptize", "--json"],
    &["inspect", "x.haptize", "--q", "0.003,0.033", "--json"],
    &["play", "x.haptize", "--seconds", "0.1", "--json"],
    &["export", "x.haptize", "--format", "npz", "--json"],
    &["export", "x.haptize", "--format", "csv", "--json"],
    &["view", "x.haptize", "--screenshot", "x.png", "--time", "0.1", "--json"],
];

/// What each command says, and the files that it makes. The window's picture must be there, but it shows times that it
/// measured.
fn answers(folder: &Path) -> BTreeMap<String, Vec<u8>> {
    let mut answers: BTreeMap<_, _> =
        COMMANDS.iter().map(|arguments| (arguments.join(" "), succeed(folder, arguments).into_bytes())).collect();
    for place in [folder, &folder.join("out/x-press")] {
        for entry in std::fs::read_dir(place).unwrap() {
            let path = entry.unwrap().path();
            let name = path.strip_prefix(folder).unwrap().display().to_string();
            if path.is_file() && !["scene.toml", "cube.obj", "block.msh", "x.png"].contains(&name.as_str()) {
                answers.insert(name, std::fs::read(&path).unwrap());
            }
        }
    }
    assert!(folder.join("x.png").exists());
    answers
}

#[test]
fn every_kind_of_object_is_felt_drawn_and_inspected_without_its_scene_and_mesh() {
    for (name, object) in OBJECTS {
        let home = tempfile::tempdir().unwrap();
        write_scene(home.path(), object, 7);
        succeed(home.path(), &["bake", "scene.toml", "-o", "x.haptize", "--backend", "cpu", "--json"]);
        let away = tempfile::tempdir().unwrap();
        std::fs::copy(home.path().join("x.haptize"), away.path().join("x.haptize")).unwrap();
        let scene = Scene::load(home.path().join("scene.toml")).unwrap();
        let dataset = Dataset::load(&home.path().join("x.haptize")).unwrap();
        let (built, stored) =
            (Object::build(&scene.object).unwrap(), dataset.surface.as_ref().unwrap().object(&scene.object).unwrap());
        assert!(built.rest == stored.rest && built.triangles == stored.triangles, "{name}");
        assert_eq!(
            built.mechanics().unwrap().stiffness,
            stored.mechanics().unwrap().stiffness,
            "{name}: what is stored is what was baked"
        );
        let at_home = answers(home.path());
        assert!(at_home.len() > 12, "{:?}", at_home.keys());
        home.close().unwrap();
        let alone = answers(away.path());
        for (what, answer) in &at_home {
            assert!(alone.get(what) == Some(answer), "{name}: {what} differs without the scene");
        }
        assert_eq!(alone.len(), at_home.len());
    }
}

#[test]
fn a_dataset_without_the_tetrahedra_of_its_scene_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let tetrahedra = OBJECTS.iter().find(|(name, _)| *name == "tetrahedra").unwrap().1;
    write_scene(folder.path(), tetrahedra, 4);
    let path = folder.path().join("x.haptize");
    succeed(folder.path(), &["bake", "scene.toml", "-o", "x.haptize", "--backend", "cpu"]);
    let mut dataset = Dataset::load(&path).unwrap();
    let spec = Scene::parse(&dataset.scene, "scene").unwrap().object;
    dataset.surface.as_mut().unwrap().solid = None;
    let refused = dataset.surface.as_ref().unwrap().object(&spec);
    assert!(refused.is_err_and(|error| error.to_string().contains("tetrahedra of the scene")));
    dataset.save(&path).unwrap();
    for arguments in [&["play", "x.haptize"][..], &["inspect", "x.haptize", "--q", "0,0"]] {
        let output = command(folder.path(), arguments).output().unwrap();
        let said = message(&output);
        assert!(output.status.code() == Some(1) && said.contains("bake the scene again"), "{arguments:?}: {said}");
    }
}
