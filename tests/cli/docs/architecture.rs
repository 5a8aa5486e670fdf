//! `ARCHITECTURE.md` tells the truth: a module of `src` uses what the table says, and only what stands above it. And a
//! public type has a name of its own.

use super::root;
use std::{
    collections::{BTreeMap, BTreeSet},
    fs,
    path::{Path, PathBuf},
};

/// What the table says instead of a list of modules.
const ALL: &str = "all above";

/// Public types that share their name with another. This list may only become shorter.
const SHARED_NAMES: &[&str] = &[
    "Arguments",
    "Body",
    "Column",
    "Contact",
    "Course",
    "Files",
    "Frame",
    "Interpolation",
    "Joint",
    "Kernel",
    "Keyboard",
    "Links",
    "Motion",
    "Picture",
    "Plan",
    "Port",
    "Quantity",
    "Row",
    "Session",
    "Shape",
    "Solver",
    "State",
    "Step",
    "Summary",
    "Surface",
    "Watchdog",
];

/// Every file of Rust in `folder`, with its text.
fn files(folder: &Path) -> Vec<(PathBuf, String)> {
    let paths = fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
    paths
        .flat_map(|path| match path.extension() {
            Some(extension) if extension == "rs" => vec![(path.clone(), fs::read_to_string(&path).unwrap())],
            _ if path.is_dir() => files(&path),
            _ => Vec::new(),
        })
        .collect()
}

/// The code of `src`, file by file, without comments and without what only tests compile.
fn sources() -> Vec<(PathBuf, String)> {
    let files = files(&root().join("src"));
    let of_tests: BTreeSet<PathBuf> = files
        .iter()
        .flat_map(|(path, text)| {
            let folder =
                if path.ends_with("mod.rs") { path.parent().unwrap().to_owned() } else { path.with_extension("") };
            let modules = text.split("#[cfg(test)]\n").skip(1).filter_map(|rest| {
                rest.trim_start_matches("pub ").strip_prefix("mod ")?.split_once(';').map(|(name, _)| name)
            });
            modules.map(|name| folder.join(name).with_extension("rs")).collect::<Vec<_>>()
        })
        .collect();
    let code = |text: &str| {
        let text = text.split("#[cfg(test)]\nmod tests {").next().unwrap();
        text.lines().filter(|line| !line.trim_start().starts_with("//")).collect::<Vec<_>>().join("\n")
    };
    files.into_iter().filter(|(path, _)| !of_tests.contains(path)).map(|(path, text)| (path, code(&text))).collect()
}

/// What follows `crate::` in `code`: the first name, or the first name of each in braces.
fn crate_names(code: &str) -> BTreeSet<String> {
    let name = |text: &str| text.chars().take_while(|c| c.is_alphanumeric() || *c == '_').collect::<String>();
    let mut names = BTreeSet::new();
    for rest in code.split("crate::").skip(1) {
        let Some(list) = rest.strip_prefix('{') else {
            names.insert(name(rest));
            continue;
        };
        let (mut depth, mut item) = (0, String::new());
        for c in list.chars().chain(",".chars()) {
            match c {
                '}' if depth == 0 => break,
                ',' if depth == 0 => drop(names.insert(name(std::mem::take(&mut item).trim()))),
                _ => item.push(c),
            }
            depth += i32::from(c == '{') - i32::from(c == '}');
        }
        names.insert(name(item.trim()));
    }
    names
}

#[test]
fn modules_use_what_the_table_says_and_only_what_stands_above() {
    let page = fs::read_to_string(root().join("ARCHITECTURE.md")).unwrap();
    let cells = |line: &str| line.split('|').map(|cell| cell.trim().to_owned()).collect::<Vec<_>>();
    let rows: Vec<(String, String)> = page
        .lines()
        .skip_while(|line| !line.starts_with("| module"))
        .skip(2)
        .take_while(|line| line.starts_with('|'))
        .map(|line| (cells(line)[1].trim_matches('`').to_owned(), cells(line)[3].clone()))
        .collect();
    let place = |name: &str| rows.iter().position(|(module, _)| module == name);
    let mut used: BTreeMap<String, BTreeSet<String>> = BTreeMap::new();
    for (path, code) in sources() {
        let path = path.strip_prefix(root().join("src")).unwrap();
        let module = path.components().next().unwrap().as_os_str().to_str().unwrap().to_owned();
        // `crate::store` is `crate::dataset::store`.
        let names = crate_names(&code).into_iter().map(|name| if name == "store" { "dataset".into() } else { name });
        let names = names.filter(|name| *name != module && place(name).is_some());
        used.entry(module.clone()).or_default().extend(names);
    }
    for folder in fs::read_dir(root().join("src")).unwrap().map(|entry| entry.unwrap()) {
        let name = folder.file_name().into_string().unwrap();
        assert!(!folder.path().is_dir() || place(&name).is_some(), "the table in ARCHITECTURE.md lacks `{name}`");
    }
    for (row, (module, says)) in rows.iter().enumerate() {
        let uses = &used[module];
        let below: Vec<_> = uses.iter().filter(|name| place(name) > Some(row)).collect();
        assert!(below.is_empty(), "`{module}` uses {below:?}, which stand below it in ARCHITECTURE.md");
        let listed: BTreeSet<String> = says.split(", ").filter(|name| *name != "-").map(ToOwned::to_owned).collect();
        assert!(says == ALL || listed == *uses, "ARCHITECTURE.md says that `{module}` uses {says}; it uses {uses:?}");
    }
}

#[test]
fn public_types_have_names_of_their_own() {
    let mut definitions: BTreeMap<String, usize> = BTreeMap::new();
    for (_, code) in sources() {
        for line in code.lines().filter_map(|line| line.strip_prefix("pub ")) {
            let kind =
                ["struct ", "enum ", "trait ", "type ", "union "].iter().find_map(|kind| line.strip_prefix(kind));
            if let Some(rest) = kind {
                let name: String = rest.chars().take_while(|c| c.is_alphanumeric() || *c == '_').collect();
                *definitions.entry(name).or_default() += 1;
            }
        }
    }
    let shared: BTreeSet<&str> =
        definitions.iter().filter(|(_, count)| **count > 1).map(|(name, _)| name.as_str()).collect();
    let known: BTreeSet<&str> = SHARED_NAMES.iter().copied().collect();
    let new: Vec<_> = shared.difference(&known).collect();
    assert!(new.is_empty(), "defined twice, give one of them another name: {new:?}");
    let gone: Vec<_> = known.difference(&shared).collect();
    assert!(gone.is_empty(), "defined once by now, take them off the list: {gone:?}");
}
