//! The pages of the documentation: every command in them runs, and prints what the page says; every link leads
//! somewhere.
//!
//! Fenced blocks of `sh` are run as scripts, those of `console` command by command; what stands below a command must be
//! what it prints, but for numbers, and `...` stands for any lines. A page's blocks run one after the other in one
//! folder that has the repository's `datasets` and robots. A block that begins with `# Not run by the tests:` is listed
//! instead, with its reason.

#![cfg(unix)]

mod architecture;

use rayon::prelude::*;
use std::{
    fmt::Write,
    fs,
    path::{Path, PathBuf},
    process::Command,
};

const NOT_RUN: &str = "# Not run by the tests:";

/// A command and the lines that the page shows below it; those of a script are none, which says nothing.
struct Shown {
    command: String,
    output: Option<Vec<String>>,
}

/// The pages, relative to the repository.
fn pages() -> Vec<PathBuf> {
    let named = ["README.md", "CONTRIBUTING.md", "ARCHITECTURE.md", "datasets/README.md", "benches/README.md"];
    let docs =
        fs::read_dir(root().join("docs")).unwrap().map(|entry| Path::new("docs").join(entry.unwrap().file_name()));
    let mut pages: Vec<PathBuf> = named.map(PathBuf::from).into_iter().chain(docs).collect();
    pages.retain(|page| page.extension().is_some_and(|extension| extension == "md"));
    pages.sort();
    pages
}

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// The fenced blocks of `text` in one of `languages`: the language and the lines.
fn blocks<'a>(text: &'a str, languages: &[&str]) -> Vec<(&'a str, Vec<&'a str>)> {
    let mut blocks = Vec::new();
    let mut lines = text.lines();
    while let Some(line) = lines.next() {
        if let Some(language) = line.strip_prefix("```") {
            let block = lines.by_ref().take_while(|line| *line != "```").collect();
            if languages.contains(&language) {
                blocks.push((language, block));
            }
        }
    }
    blocks
}

/// What a page runs, and why it does not run the rest.
fn commands(text: &str) -> (Vec<Shown>, Vec<String>) {
    let (mut commands, mut left_out) = (Vec::new(), Vec::new());
    for (language, lines) in blocks(text, &["sh", "console"]) {
        if let Some(reason) = lines.first().and_then(|line| line.strip_prefix(NOT_RUN)) {
            left_out.push(format!("{}: {}", reason.trim(), lines[1..].join("; ")));
        } else if language == "sh" {
            commands.push(Shown { command: lines.join("\n"), output: None });
        } else {
            for line in lines {
                if let Some(command) = line.strip_prefix("$ ") {
                    commands.push(Shown { command: command.into(), output: Some(Vec::new()) });
                } else if let Some(Shown { output: Some(output), .. }) = commands.last_mut() {
                    output.push(line.to_owned());
                }
            }
        }
    }
    (commands, left_out)
}

/// `line` without what changes from run to run and from machine to machine: numbers, what solved, and how far apart
/// words are.
fn masked(line: &str) -> String {
    let solver = [" on cpu (", " on gpu ("].iter().find_map(|solver| line.find(solver));
    let line = &line[..solver.unwrap_or(line.len())];
    let machine = [std::env::consts::ARCH, "x86_64", std::env::consts::OS, "linux"];
    let line = machine.iter().fold(line.to_owned(), |line, name| line.replace(name, "#"));
    let of_number = |character: &char| character.is_ascii_digit() || "+-.eE".contains(*character);
    let characters: Vec<char> = line.chars().collect();
    let runs = characters.chunk_by(|a, b| of_number(a) == of_number(b));
    let masked: String = runs
        .map(|run| if run.iter().any(char::is_ascii_digit) { "#".to_owned() } else { run.iter().collect() })
        .collect();
    masked.split_whitespace().collect::<Vec<_>>().join(" ")
}

/// Whether `printed` is `shown`, in which a line `...` stands for any number of lines.
fn agrees(shown: &[String], printed: &[&str]) -> bool {
    match shown {
        [] => printed.is_empty(),
        [dots, rest @ ..] if dots == "..." => (0..=printed.len()).any(|skipped| agrees(rest, &printed[skipped..])),
        [line, rest @ ..] => {
            printed.first().is_some_and(|first| masked(line) == masked(first)) && agrees(rest, &printed[1..])
        }
    }
}

fn copy(from: &Path, to: &Path) {
    fs::create_dir_all(to).unwrap();
    for entry in fs::read_dir(from).unwrap().map(Result::unwrap) {
        let target = to.join(entry.file_name());
        if entry.file_type().unwrap().is_dir() {
            copy(&entry.path(), &target);
        } else {
            fs::copy(entry.path(), target).unwrap();
        }
    }
}

/// The folder in which the commands of a page run: the repository's datasets, and robots. The sponge is scanned on a
/// third of its lines.
fn folder() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    for part in ["datasets", "tests/robots"] {
        copy(&root().join(part), &folder.path().join(part));
    }
    for scene in ["datasets/sponge.toml", "datasets/sponge_fabric.toml"] {
        let text = fs::read_to_string(root().join(scene)).unwrap();
        assert!(text.contains("count = 31"));
        fs::write(folder.path().join(scene), text.replace("count = 31", "count = 9")).unwrap();
    }
    folder
}

/// Runs the commands of `page`; returns what went wrong.
fn run(page: &Path) -> String {
    let (commands, left_out) = commands(&fs::read_to_string(root().join(page)).unwrap());
    for block in left_out {
        println!("{}: not run, {block}", page.display());
    }
    let mut failures = String::new();
    if commands.is_empty() {
        return failures;
    }
    let folder = folder();
    let programs = Path::new(env!("CARGO_BIN_EXE_haptize")).parent().unwrap();
    let path = format!("{}:{}", programs.display(), std::env::var("PATH").unwrap());
    for Shown { command, output } in commands {
        let mut shell = Command::new("bash");
        shell
            .args(["-euo", "pipefail", "-c", &command])
            .current_dir(folder.path())
            .env("PATH", &path)
            .env("XDG_CACHE_HOME", env!("CARGO_TARGET_TMPDIR"))
            .env_remove("DISPLAY");
        let ran = shell.output().unwrap();
        let [printed, errors] = [&ran.stdout, &ran.stderr].map(|text| String::from_utf8_lossy(text).into_owned());
        if !ran.status.success() {
            let _ = writeln!(failures, "{}: {command}\n{printed}{errors}", page.display());
        } else if output.is_some_and(|output| !agrees(&output, &printed.lines().collect::<Vec<_>>())) {
            let _ = writeln!(
                failures,
                "{}: {command}\nprints something else than the page shows:\n{printed}",
                page.display()
            );
        }
    }
    failures
}

#[test]
fn the_contents_list_every_page_of_the_guide() {
    let contents = fs::read_to_string(root().join("docs/SUMMARY.md")).unwrap();
    let listed = |page: &Path| contents.contains(&format!("({})", page.file_name().unwrap().to_str().unwrap()));
    let missing: Vec<_> = pages()
        .into_iter()
        .filter(|page| page.starts_with("docs") && !page.ends_with("SUMMARY.md") && !listed(page))
        .collect();
    assert!(missing.is_empty(), "{missing:?}");
}

#[test]
fn every_command_of_the_documentation_runs_and_prints_what_is_shown() {
    // docs/site/build.sh runs those of the gallery.
    let pages: Vec<PathBuf> = pages().into_iter().filter(|page| !page.ends_with("gallery.md")).collect();
    let failures: String = pages.par_iter().map(|page| run(page)).collect();
    assert!(failures.is_empty(), "{failures}");
}

#[test]
fn every_link_of_the_documentation_leads_somewhere() {
    let (mut links, mut broken) = (0, String::new());
    for page in pages() {
        let text = fs::read_to_string(root().join(&page)).unwrap();
        for link in text.split("](").skip(1).filter_map(|rest| rest.split(')').next()) {
            let file = link.split('#').next().unwrap();
            if file.is_empty() || link.contains("://") || link.contains(' ') {
                continue;
            }
            links += 1;
            if !root().join(page.parent().unwrap()).join(file).exists() {
                let _ = writeln!(broken, "{}: {link}", page.display());
            }
        }
    }
    assert!(links > 100 && broken.is_empty(), "{links} links, broken:\n{broken}");
}

#[test]
fn what_is_shown_is_compared() {
    let text = "```console\n$ one\na 1.5e-3 s\n...\nb\n$ two\n```\n```sh\nthree\n```\n\
     ```sh\n# Not run by the tests: slow\nfour\n```\n";
    let (found, left_out) = commands(text);
    assert_eq!(found.iter().map(|shown| shown.command.as_str()).collect::<Vec<_>>(), ["one", "two", "three"]);
    assert_eq!(left_out, ["slow: four"]);
    let shown = found[0].output.as_ref().unwrap();
    assert!(agrees(shown, &["a   27 s", "anything", "b"]) && agrees(shown, &["a -2.0 s", "b"]));
    assert!(!agrees(shown, &["a 1.5e-3 m", "b"]) && !agrees(shown, &["a 1 s", "b", "c"]) && !agrees(shown, &["b"]));
    assert!(found[1].output.as_ref().unwrap().is_empty() && !agrees(&[], &["something"]));
}
