//! A bake tells when the arm pushes through a thin part of the object.

use crate::{
    common::program::{haptize, text},
    fixture::Folder,
};

/// A plate 2 mm thick around z = 0.
const PLATE: &str = "v -0.02 -0.02 -0.001\nv 0.02 -0.02 -0.001\nv -0.02 0.02 -0.001\nv 0.02 0.02 -0.001\n\
    v -0.02 -0.02 0.001\nv 0.02 -0.02 0.001\nv -0.02 0.02 0.001\nv 0.02 0.02 0.001\n\
    f 1 3 4 2\nf 5 6 8 7\nf 1 2 6 5\nf 3 7 8 4\nf 1 5 7 3\nf 2 4 8 6\n";

/// A folder with the scene `plate.toml`, pins pressed upwards into the plate, from 5 mm below its middle to `last` (m)
/// beyond it, on a grid of this `step` (m); and with `motion.csv`, which leads there.
fn folder(last: f64, step: f64) -> Folder {
    let folder = Folder::new();
    std::fs::write(folder.0.path().join("plate.obj"), PLATE).unwrap();
    let scene = format!(
        "[object]\nmesh = {{ file = \"plate.obj\" }}\nsprings = {{ kind = \"isotropic\", stiffness = 300.0 }}\n\
         ground = {{ stiffness = 100.0 }}\n[contact]\nstiffness = 500.0\nsurface = \"facets\"\n\
         [[proxy.joint]]\nname = \"press\"\nkind = \"prismatic\"\naxis = [0.0, 0.0, 1.0]\nlimits = [-0.02, 0.02]\n\
         nodes = [{{ at = [0.001, 0.002, 0.0] }}, {{ at = [-0.004, 0.003, -0.003] }}]\n\
         [[grid.axes]]\nstart = -0.005\nstop = {last}\nstep = {step}\n"
    );
    std::fs::write(folder.0.path().join("plate.toml"), scene).unwrap();
    std::fs::write(folder.0.path().join("motion.csv"), format!("time,press\n0,-0.004\n0.3,{last}\n")).unwrap();
    folder
}

/// What the command `arguments` prints in `folder`.
fn printed(folder: &Folder, arguments: &[&str]) -> String {
    let output = haptize(folder.0.path(), arguments);
    let [told, errors] = [&output.stdout, &output.stderr].map(|bytes| text(bytes));
    assert!(output.status.success(), "{arguments:?}: {errors}");
    told + &errors
}

/// What the command `arguments` and the file that it writes tell of thin parts; both tell the same.
fn told(last: f64, step: f64, arguments: &[&str]) -> String {
    let folder = folder(last, step);
    let sentence = |text: &str| {
        let begin = text.find("near ").filter(|_| text.contains("the middle of a part"));
        begin.map_or(String::new(), |begin| text[begin..].split(": shorten").next().unwrap().to_owned())
    };
    let [told, kept] = [arguments, &["info", "plate.haptize"]].map(|arguments| sentence(&printed(&folder, arguments)));
    assert_eq!(told, kept, "{arguments:?}");
    told
}

#[test]
fn it_is_told_with_the_thickness_when_the_arm_passes_the_middle_of_a_thin_part_in_small_steps_or_in_great_ones() {
    let bake = ["bake", "plate.toml", "--backend", "cpu", "--json"];
    // Through the plate; past its middle; and from below it to above it within one step.
    for (last, step) in [(0.005, 0.0005), (0.0005, 0.0005), (0.0028, 0.0026)] {
        let told = told(last, step, &bake);
        assert!(told.contains(", 2.0 mm thick") && told.contains("at q = ["), "{last}, {step}: {told:?}");
    }
    // To 0.1 mm below the middle.
    assert_eq!(told(-0.0001, 0.0007, &bake), "");
}

#[test]
fn a_session_without_a_dataset_tells_it_afterwards() {
    let play = ["play", "plate.toml", "--motion", "motion.csv", "-o", "out"];
    let through = printed(&folder(0.005, 0.001), &play);
    assert!(through.contains("the arm passes the middle") && through.contains(", 2.0 mm thick"), "{through}");
    let shallow = printed(&folder(-0.001, 0.001), &play);
    assert!(!shallow.contains("the middle of a part"), "{shallow}");
}

/// An arm that begins within the plate, past its middle, is pushed out on the far side: that is said, of a scene and of a
/// dataset; and nothing of one that begins in front of it.
#[test]
fn a_session_that_begins_in_contact_says_that_the_side_is_not_known() {
    let folder = folder(0.005, 0.0005);
    std::fs::write(folder.0.path().join("inside.csv"), "time,press\n0,0.0004\n0.3,-0.004\n").unwrap();
    printed(&folder, &["bake", "plate.toml", "--backend", "cpu"]);
    for file in ["plate.toml", "plate.haptize"] {
        let [inside, before] = ["inside.csv", "motion.csv"].map(|motion| {
            printed(&folder, &["play", file, "--motion", motion, "-o", "out"]).contains("begins in contact")
        });
        assert!(inside && !before, "{file}: {inside}, {before}");
    }
}

#[test]
fn a_refined_dataset_tells_it_too() {
    let refined = ["bake", "plate.toml", "--backend", "cpu", "--max-error", "60%", "--refine", "2"];
    let told_of = told(0.005, 0.0005, &refined);
    assert!(told_of.contains(", 2.0 mm thick") && told_of.contains("at q = ["), "{told_of:?}");
    assert_eq!(told(-0.0001, 0.0007, &refined), "");
}
