//! A bake tells when the arm pushes through a thin part of the object.

use crate::fixture::Folder;
use std::process::Command;

/// A plate 2 mm thick around z = 0.
const PLATE: &str = "v -0.02 -0.02 -0.001\nv 0.02 -0.02 -0.001\nv -0.02 0.02 -0.001\nv 0.02 0.02 -0.001\n\
    v -0.02 -0.02 0.001\nv 0.02 -0.02 0.001\nv -0.02 0.02 0.001\nv 0.02 0.02 0.001\n\
    f 1 3 4 2\nf 5 6 8 7\nf 1 2 6 5\nf 3 7 8 4\nf 1 5 7 3\nf 2 4 8 6\n";

/// Pins pressed upwards into the plate, from 5 mm below its middle to `last` (m) beyond it, in steps of `step` (m).
fn told(last: f64, step: f64) -> String {
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
    let mut bake = Command::new(env!("CARGO_BIN_EXE_haptize"));
    bake.current_dir(folder.0.path()).args(["bake", "plate.toml", "--backend", "cpu", "--json"]);
    let output = bake.output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let report: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    // The file tells it as well as the bake does.
    let info = Command::new(env!("CARGO_BIN_EXE_haptize"))
        .current_dir(folder.0.path())
        .args(["info", "plate.haptize"])
        .output()
        .unwrap();
    let kept = String::from_utf8_lossy(&info.stdout).into_owned();
    let warned = report["warnings"].as_array().unwrap().iter().map(|told| told.as_str().unwrap());
    let warned: Vec<&str> = warned.filter(|told| told.contains("the middle of a part")).collect();
    assert_eq!(kept.contains("the middle of a part"), !warned.is_empty(), "{kept}");
    warned.concat()
}

#[test]
fn it_is_told_with_the_thickness_when_the_arm_passes_the_middle_of_a_thin_part_in_small_steps_or_in_great_ones() {
    // Through the plate; past its middle; and from below it to above it within one step.
    for (last, step) in [(0.005, 0.0005), (0.0005, 0.0005), (0.0028, 0.0026)] {
        let told = told(last, step);
        assert!(told.contains(", 2.0 mm thick") && told.contains("at q = ["), "{last}, {step}: {told:?}");
    }
    // To 0.1 mm below the middle.
    assert_eq!(told(-0.0001, 0.0007), "");
}
