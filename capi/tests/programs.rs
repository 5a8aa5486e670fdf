//! The example programs, installed, compiled and run as a user would, under the address sanitiser where the compiler
//! has it.

#![allow(clippy::unwrap_used)] // clippy.toml allows it inside #[test] functions only; helpers need it, too.
#![cfg(target_os = "linux")]

mod common;

use common::{Files, PRESSED};
use haptize::{dataset::Dataset, render::setup, scene::Scene, sweep::Direct};
use std::{
    path::{Path, PathBuf},
    process::{Command, Output},
};

const HERE: &str = env!("CARGO_MANIFEST_DIR");

/// Programs that watch their memory and every undefined operation, and end at the first fault.
const SANITISED: [&str; 2] = ["-fsanitize=address,undefined", "-fno-sanitize-recover=all"];

/// Runs `command`, which must be there and succeed.
fn run(command: &mut Command) -> String {
    let Output { status, stdout, stderr } = command.output().unwrap();
    let [stdout, stderr] = [stdout, stderr].map(|text| String::from_utf8(text).unwrap());
    assert!(status.success(), "{command:?}: {status}\n{stdout}{stderr}");
    stdout
}

fn is_there(program: &str) -> bool {
    Command::new(program).arg("--version").output().is_ok_and(|output| output.status.success())
}

/// The script with the libraries that this test was built with.
fn install_script(prefix: &Path) -> Command {
    let built = std::env::current_exe().unwrap();
    let mut command = Command::new("sh");
    command.arg(Path::new(HERE).join("install.sh")).arg(prefix).env("HAPTIZE_BUILT", built.parent().unwrap());
    command
}

/// Installs the libraries; returns the prefix.
fn install(files: &Files) -> PathBuf {
    let prefix = files.path("prefix");
    run(&mut install_script(&prefix));
    prefix
}

/// Whether `compiler` can make programs that watch their memory.
fn has_sanitiser(files: &Files, compiler: &str) -> bool {
    let source = files.path("empty.c");
    std::fs::write(&source, "int main(void) { return 0; }\n").unwrap();
    let mut command = Command::new(compiler);
    command.args(SANITISED).arg(&source).arg("-o").arg(files.path("empty"));
    command.output().is_ok_and(|output| output.status.success())
        && Command::new(files.path("empty")).output().is_ok_and(|output| output.status.success())
}

/// Compiles `source` with every warning an error against what is installed, and runs it with `arguments`.
fn compile_and_run(files: &Files, prefix: &Path, compiler: [&str; 2], source: &str, arguments: &[String]) -> String {
    let program = files.path(&source.replace('.', "_"));
    let mut command = Command::new(compiler[0]);
    command.args([compiler[1], "-Wall", "-Wextra", "-Werror", "-pedantic", "-g"]);
    if has_sanitiser(files, compiler[0]) {
        command.args(SANITISED);
    } else {
        eprintln!("{source} runs without the address sanitiser, which {} does not have", compiler[0]);
    }
    let flags = if is_there("pkg-config") {
        let mut flags = Command::new("pkg-config");
        run(flags.args(["--cflags", "--libs", "haptize"]).env("PKG_CONFIG_PATH", prefix.join("lib/pkgconfig")))
    } else {
        format!("-I{0}/include -L{0}/lib -lhaptize", prefix.display())
    };
    command.arg(Path::new(HERE).join("examples").join(source)).args(flags.split_whitespace()).arg("-o").arg(&program);
    run(&mut command);
    run(Command::new(&program).args(arguments).env("LD_LIBRARY_PATH", prefix.join("lib")))
}

fn numbers(line: &str) -> Vec<f64> {
    line.split_whitespace().filter_map(|word| word.parse().ok()).collect()
}

#[test]
fn the_examples_compile_without_a_warning_and_tell_what_the_library_tells() {
    if !is_there("cc") || !is_there("c++") {
        eprintln!("skipped: there is no C or C++ compiler (cc, c++)");
        return;
    }
    let files = Files::new();
    let prefix = install(&files);
    let [scene, dataset] = ["small.toml", "small.haptize"].map(|name| files.path(name).display().to_string());
    let q = PRESSED.map(|q| q.to_string());
    let looked_up = setup::field(&Dataset::open(&files.path("small.haptize")).unwrap(), None).unwrap().sample(&PRESSED);
    let [first, second] = [looked_up.torque[0], looked_up.torque[1]];

    let pressed =
        compile_and_run(&files, &prefix, ["cc", "-std=c99"], "press.c", &[&[dataset.clone()][..], &q].concat());
    let lines: Vec<&str> = pressed.lines().collect();
    assert_eq!(numbers(lines[0]), [0.0, first, second], "{pressed}");
    assert_eq!(numbers(lines[1]), [0.0, 1.0, looked_up.energy], "{pressed}");
    let felt = numbers(lines[2]);
    assert!(felt[..2] == [0.0, 1.0] && felt[3] < 0.0, "{pressed}");

    let solved =
        compile_and_run(&files, &prefix, ["c++", "-std=c++14"], "solve.cc", &[&[scene, dataset][..], &q].concat());
    let lines: Vec<&str> = solved.lines().collect();
    let direct = Direct::new(&Scene::load(files.path("small.toml")).unwrap()).unwrap().inspect(&PRESSED).unwrap();
    assert_eq!(numbers(lines[0])[3..], direct.torque, "{solved}");
    assert_eq!(numbers(lines[1])[1..], [1.0, first, second], "{solved}");
}

#[test]
fn csharp_tells_what_the_library_tells_and_allocates_nothing_in_a_tick() {
    if !is_there("mcs") || !is_there("mono") {
        eprintln!("skipped: there is no C# compiler (mcs, mono)");
        return;
    }
    let files = Files::new();
    let (prefix, program) = (install(&files), files.path("Press.exe"));
    let [scene, dataset] = ["small.toml", "small.haptize"].map(|name| files.path(name));
    let mut compiler = Command::new("mcs");
    compiler.args(["-langversion:7", "-warn:4", "-warnaserror"]).arg(format!("-out:{}", program.display()));
    run(compiler.args(["examples/Press.cs", "csharp/Haptize.cs"].map(|source| Path::new(HERE).join(source))));
    let press = |dataset: &Path| {
        let mut command = Command::new("mono");
        command.arg(&program).args([&scene, dataset]).args(PRESSED.map(|q| q.to_string()));
        command.env("LD_LIBRARY_PATH", prefix.join("lib"));
        command
    };

    let looked_up = setup::field(&Dataset::open(&dataset).unwrap(), None).unwrap().sample(&PRESSED);
    let solved = Direct::new(&Scene::load(&scene).unwrap()).unwrap().inspect(&PRESSED).unwrap();
    let printed = run(&mut press(&dataset));
    let (version, rest) = printed.split_once('\n').unwrap();
    assert_eq!(version, concat!("version ", env!("CARGO_PKG_VERSION")));
    let lines: Vec<Vec<f64>> = rest.lines().map(numbers).collect();
    let torque = &looked_up.torque[..2];
    assert_eq!(lines[0], [&[0.0], torque].concat());
    assert_eq!(lines[1], [0.0, 1.0, looked_up.energy]);
    assert_eq!(lines[2], [&[1.0], torque].concat());
    assert!(lines[3][..2] == [0.0, 1.0] && lines[3][3] < 0.0, "{printed}");
    assert_eq!(lines[4], [0.0], "bytes allocated in 500 ticks");
    assert_eq!(lines[5], [&[0.0, 1.0][..], &solved.torque].concat());
    let force: [f64; 3] = std::array::from_fn(|axis| solved.object_nodes.iter().map(|node| node.force[axis]).sum());
    assert_eq!(lines[6], force);
    assert_eq!(lines[7][..2], [0.0, 1.0], "{printed}");

    let failed = press(&files.path("none.haptize")).output().unwrap();
    let message = String::from_utf8(failed.stderr).unwrap();
    assert!(!failed.status.success() && message.starts_with("File: ") && message.contains("none.haptize"), "{message}");
}

#[test]
fn cmake_finds_what_is_installed() {
    if !is_there("cmake") || !is_there("cc") || !is_there("c++") {
        eprintln!("skipped: there is no CMake, or no C or C++ compiler");
        return;
    }
    let files = Files::new();
    let prefix = install(&files);
    let (project, build) = (Path::new(HERE).join("examples"), files.path("build"));
    let root = format!("-DCMAKE_PREFIX_PATH={}", prefix.display());
    run(Command::new("cmake").args([&root, "-S"]).arg(project).arg("-B").arg(&build));
    run(Command::new("cmake").arg("--build").arg(&build));
    let (scene, dataset, q) = (files.path("small.toml"), files.path("small.haptize"), PRESSED.map(|q| q.to_string()));
    let pressed = run(Command::new(build.join("press")).arg(&dataset).args(&q));
    let solved = run(Command::new(build.join("solve")).args([&scene, &dataset]).args(&q));
    // Both look the same torque up, behind one code and two.
    assert_eq!(numbers(pressed.lines().next().unwrap())[1..], numbers(solved.lines().nth(1).unwrap())[2..]);

    // Moved, by its version, and by the static library, which needs nothing at run time.
    let moved = files.path("moved");
    std::fs::rename(&prefix, &moved).unwrap();
    for (version, library) in [("0.1", "Haptize"), (env!("CARGO_PKG_VERSION"), "haptize_static")] {
        let recipe = write_recipe(&files, version, library);
        let build = recipe.join("build");
        run(&mut cmake(&recipe, &moved));
        run(Command::new("cmake").arg("--build").arg(&build));
        assert_eq!(run(Command::new(build.join("program")).arg(&dataset).args(&q)), pressed);
    }
    for version in ["9.0", "0.0.9"] {
        let recipe = write_recipe(&files, version, "Haptize");
        let output = cmake(&recipe, &moved).output().unwrap();
        assert!(!output.status.success(), "version {version} was found");
        assert!(String::from_utf8_lossy(&output.stderr).contains("version"), "{output:?}");
    }
}

/// A project as docs/c.md has it; returns its folder.
fn write_recipe(files: &Files, version: &str, library: &str) -> PathBuf {
    let recipe = files.path(&format!("recipe-{version}-{library}"));
    std::fs::create_dir(&recipe).unwrap();
    let text = format!(
        "cmake_minimum_required(VERSION 3.15)\nproject(recipe C)\nfind_package(Haptize {version} REQUIRED)\n\
         add_executable(program {HERE}/examples/press.c)\ntarget_link_libraries(program Haptize::{library})\n"
    );
    std::fs::write(recipe.join("CMakeLists.txt"), text).unwrap();
    recipe
}

/// CMake on the project in `recipe`, to be built beside it, with what is installed under `prefix`.
fn cmake(recipe: &Path, prefix: &Path) -> Command {
    let mut command = Command::new("cmake");
    command.arg(format!("-DCMAKE_PREFIX_PATH={}", prefix.display())).arg("-S").arg(recipe);
    command.arg("-B").arg(recipe.join("build"));
    command
}

#[test]
fn it_is_installed_in_folders_of_any_name_and_found_there() {
    let files = Files::new();
    for name in ["a&b", "a|b", "a b", "-a", "&|; x*"] {
        // Relative, as a user types it.
        run(install_script(Path::new(name)).current_dir(files.path("")));
        let prefix = files.path(name);
        assert!(
            prefix.join("include/haptize.h").exists() && prefix.join("lib/cmake/Haptize/HaptizeConfig.cmake").exists()
        );
        if is_there("pkg-config") && is_there("cc") {
            // A shell sees one word for each folder.
            let build = "eval cc -fsyntax-only -x c /dev/null -include haptize.h $(pkg-config --cflags haptize)";
            run(Command::new("sh").args(["-c", build]).env("PKG_CONFIG_PATH", prefix.join("lib/pkgconfig")));
        }
    }
}
