//! The rules of the project: the crates that a crate may use, no cycle of imports, short files,
//! errors that do not repeat their source, and promises that name their tests.
//!
//! ARCHITECTURE.md states the rules as invariants.

use std::collections::{BTreeMap, BTreeSet};
use std::error::Error;
use std::path::{Path, PathBuf};
use std::{fs, io};

use meissner_engine::representations::RepresentationError;
use meissner_engine::{EngineError, Sensor};
use meissner_io::{IoError, Place};
use meissner_kernels::KernelError;
use meissner_live::LiveError;
use meissner_models::ModelError;
use meissner_models::systems::slip::SlipError;
use meissner_reference::ReferenceError;
use proptest::prelude::ProptestConfig;

/// Each crate with the crates of the project that it may use, without its tests.
const MAY_USE: [(&str, &[&str]); 17] = [
    ("kernels", &[]),
    ("engine", &["kernels"]),
    ("live", &["engine"]),
    (
        "models",
        &[
            "kernels",
            "engine",
            "plot",
            "weights-angle",
            "weights-area",
            "weights-digits",
            "weights-force",
            "weights-slip",
            "weights-touch",
        ],
    ),
    ("io", &["engine"]),
    ("verify/reference", &["kernels", "engine"]),
    ("simulator", &["kernels", "engine"]),
    ("run", &["kernels", "engine", "live", "models", "io"]),
    ("evaluate", &["kernels", "engine", "models", "io", "run", "simulator"]),
    ("verify", &["kernels", "engine", "models", "run", "reference"]),
    ("view", &["kernels", "engine", "models", "io", "run"]),
    ("cli/plot", &[]),
    ("cli/report", &["io", "plot"]),
    (
        "cli",
        &[
            "kernels",
            "engine",
            "live",
            "models",
            "io",
            "run",
            "evaluate",
            "simulator",
            "verify",
            "reference",
            "plot",
            "report",
            "view",
        ],
    ),
    ("meissner", &["kernels", "engine", "live", "models", "io"]),
    ("bindings/c", &["meissner", "run"]),
    ("examples/packets", &["engine", "io", "live", "models", "run"]),
];

/// A longer file contains more than one idea.
const MAX_LINES: usize = 500;

/// The folder of the workspace.
pub(crate) fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
}

/// The files below `folder` with this extension, in order, without built or installed files.
pub(crate) fn files(folder: &Path, extension: &str) -> Vec<PathBuf> {
    let (mut found, mut folders) = (Vec::new(), vec![folder.to_owned()]);
    while let Some(folder) = folders.pop() {
        for entry in fs::read_dir(folder).expect("the workspace can be read") {
            let path = entry.expect("a folder can be read").path();
            let name = path.file_name().and_then(|name| name.to_str()).unwrap_or_default();
            if path.is_dir() && !["target", "node_modules"].contains(&name) && !name.starts_with('.') {
                folders.push(path);
            } else if path.extension().is_some_and(|own| own == extension) {
                found.push(path);
            }
        }
    }
    found.sort();
    found
}

#[test]
fn a_crate_uses_only_those_below_it() {
    for (name, may) in MAY_USE {
        let manifest = root().join(name).join("Cargo.toml");
        let text = fs::read_to_string(&manifest).expect("a crate has a manifest");
        let mut section = "";
        for line in text.lines() {
            if line.starts_with('[') {
                section = line;
            }
            let Some(used) = line.strip_prefix("meissner").filter(|_| section == "[dependencies]") else {
                continue;
            };
            let used = used.split(['.', ' ', '=']).next().unwrap_or_default().trim_start_matches('-');
            let used = if used.is_empty() { "meissner" } else { used };
            assert!(may.contains(&used), "{name} uses {used}; it may use {may:?}");
        }
    }
}

#[test]
fn no_file_is_longer_than_one_reads_at_a_sitting() {
    let all = files(&root(), "rs");
    let lines = |path: &PathBuf| fs::read_to_string(path).expect("sources are text").lines().count();
    let long: Vec<_> =
        all.iter().map(|path| (lines(path), path)).filter(|(lines, _)| *lines > MAX_LINES).collect();
    assert!(all.len() > 500 && long.is_empty(), "{long:?}");
}

#[test]
fn comments_have_at_most_100_columns() {
    let all = files(&root(), "rs");
    let mut long = Vec::new();
    for path in &all {
        let text = fs::read_to_string(path).expect("sources are text");
        let is_long = |line: &&str| line.trim_start().starts_with("//") && line.chars().count() > 100;
        long.extend(text.lines().filter(is_long).map(|line| format!("{}: {line}", path.display())));
    }
    assert!(long.is_empty(), "{}", long.join("\n"));
}

#[test]
fn limits_are_called_max_and_min() {
    let all = files(&root(), "rs");
    let is_limit = |word: &str| {
        let is_name =
            word.len() > 4 && word.chars().all(|c| c.is_ascii_uppercase() || c.is_ascii_digit() || c == '_');
        is_name
            && word.split('_').any(|part| ["MOST", "LEAST", "LONGEST", "LARGEST", "SMALLEST"].contains(&part))
    };
    let mut found = Vec::new();
    for path in all.iter().filter(|path| !path.ends_with("house.rs")) {
        let text = fs::read_to_string(path).expect("sources are text");
        let words = text.split(|c: char| !c.is_ascii_alphanumeric() && c != '_');
        found.extend(words.filter(|word| is_limit(word)).map(|word| format!("{}: {word}", path.display())));
    }
    assert!(found.is_empty(), "{}", found.join("\n"));
}

#[test]
fn the_map_of_the_house_is_short_and_names_every_folder() {
    let text = fs::read_to_string(root().join("ARCHITECTURE.md")).expect("there is a map");
    assert!(text.lines().count() <= 250);
    let folders =
        fs::read_dir(root()).expect("the workspace can be read").map(|entry| entry.expect("an entry").path());
    let hidden = |name: &str| name.starts_with('.') || name == "target" || name.starts_with("failure-");
    let named =
        folders.filter(|path| path.is_dir()).filter_map(|path| Some(path.file_name()?.to_str()?.to_owned()));
    for name in named.filter(|name| !hidden(name)) {
        assert!(text.contains(&format!("| `{name}` |")), "ARCHITECTURE.md does not name {name}");
    }
    for path in text.split('`').skip(1).step_by(2).filter(|word| word.contains('/') && !word.contains('\n')) {
        assert!(root().join(path).exists(), "ARCHITECTURE.md names {path}, which is not there");
    }
}

/// Module paths, as segments.
type Module = Vec<String>;

/// The files of the crate at `folder` by module, without tests.
fn modules(folder: &Path, at: &Module, all: &mut BTreeMap<Module, String>) {
    for entry in fs::read_dir(folder).expect("the crate has a folder of sources") {
        let path = entry.expect("a folder can be read").path();
        let name = path.file_stem().and_then(|name| name.to_str()).expect("names are text").to_owned();
        let mut module = at.clone();
        if path.is_dir() {
            module.push(name);
            modules(&path, &module, all);
        } else if path.extension().is_some_and(|extension| extension == "rs") && name != "tests" {
            if !["lib", "main", "mod"].contains(&name.as_str()) {
                module.push(name);
            }
            let text = fs::read_to_string(&path).expect("sources are text");
            let code: Vec<&str> =
                text.lines().map(|line| line.split("//").next().unwrap_or_default()).collect();
            let tests = code.windows(2).position(|l| l[0].starts_with("#[cfg(test)]") && l[1].ends_with('{'));
            all.insert(module, code[..tests.unwrap_or(code.len())].join("\n"));
        }
    }
}

/// The paths in the tree of a `use`, without braces.
fn paths(tree: &str, prefix: &str, all: &mut Vec<String>) {
    let (mut depth, mut start) = (0, 0);
    for (i, c) in tree.char_indices().chain([(tree.len(), ',')]) {
        match c {
            '{' => depth += 1,
            '}' => depth -= 1,
            ',' if depth == 0 => {
                let part = tree[start..i].trim();
                start = i + 1;
                match part.split_once('{') {
                    Some((inner, rest)) => {
                        paths(&rest[..rest.rfind('}').unwrap_or(0)], &format!("{prefix}{inner}"), all);
                    }
                    None if !part.is_empty() => {
                        all.push(format!("{prefix}{}", part.split(" as ").next().unwrap_or(part)));
                    }
                    None => {}
                }
            }
            _ => {}
        }
    }
}

/// The file that `path` names in `module`, and the item; `None` for another crate.
fn named(module: &Module, path: &str, all: &BTreeMap<Module, String>) -> Option<(Module, String)> {
    let mut parts: Vec<&str> = path.split("::").map(str::trim).collect();
    let mut base = module.clone();
    match parts[0] {
        "crate" => base.clear(),
        "self" => {}
        "super" => {
            while parts.get(1) == Some(&"super") {
                parts.remove(0);
                base.pop();
            }
            base.pop();
        }
        child if all.contains_key(&[&base[..], &[child.to_owned()]].concat()) => parts.insert(0, "self"),
        _ => return None,
    }
    for &part in &parts[1..] {
        base.push(part.to_owned());
        if !all.contains_key(&base) {
            base.pop();
            break;
        }
    }
    Some((base, (*parts.last()?).to_owned()))
}

/// The imports of `module`: the file that each path names, and whether it is re-exported.
fn imports(module: &Module, text: &str, all: &BTreeMap<Module, String>) -> Vec<(Module, String, bool)> {
    let mut found = Vec::new();
    for statement in text.split(';') {
        let Some((before, tree)) = statement.rsplit_once("use ") else { continue };
        let visibility = before.lines().last().unwrap_or_default().trim();
        if !(visibility.is_empty() || visibility.starts_with("pub")) {
            continue;
        }
        let mut all_paths = Vec::new();
        paths(&tree.replace('\n', " "), "", &mut all_paths);
        let public = visibility.starts_with("pub");
        found.extend(
            all_paths.iter().filter_map(|path| named(module, path, all)).map(|(to, name)| (to, name, public)),
        );
    }
    // Paths in the code itself, such as `super::write(..)`.
    let words = text.split(|c: char| !(c.is_ascii_alphanumeric() || c == '_' || c == ':'));
    let inline = words.filter(|word| word.starts_with("super::") || word.starts_with("crate::"));
    let inline = inline.map(|word| word.trim_end_matches(':')).filter(|word| word.contains("::"));
    found.extend(inline.filter_map(|path| named(module, path, all)).map(|(to, name)| (to, name, false)));
    found
}

/// The files that each file imports from; a re-exported item is imported from its original file.
fn graph(all: &BTreeMap<Module, String>) -> BTreeMap<&Module, BTreeSet<Module>> {
    let imports: BTreeMap<&Module, _> = all.iter().map(|(m, text)| (m, imports(m, text, all))).collect();
    let exported: BTreeMap<(&Module, &str), &Module> = imports
        .iter()
        .flat_map(|(m, list)| list.iter().filter(|i| i.2).map(move |i| ((*m, i.1.as_str()), &i.0)))
        .filter(|((m, _), to)| *m != *to)
        .collect();
    let source = |to: &Module, name: &str| {
        let mut to = to;
        while let Some(next) = exported.get(&(to, name)) {
            to = next;
        }
        to.clone()
    };
    let of = |m: &Module, list: &Vec<(Module, String, bool)>| {
        let used = list.iter().filter(|(to, _, public)| !(*public && to.starts_with(m)));
        used.map(|(to, name, _)| source(to, name)).filter(|to| to != m && !to.is_empty()).collect()
    };
    imports.iter().map(|(m, list)| (*m, of(m, list))).collect()
}

#[test]
fn no_file_imports_from_one_that_imports_from_it() {
    let mut circles = Vec::new();
    for (name, _) in MAY_USE {
        let mut all = BTreeMap::new();
        modules(&root().join(name).join("src"), &Vec::new(), &mut all);
        let mut graph = graph(&all);
        // Files that import from no other, or that no other imports, are removed: cycles are left.
        loop {
            let imported: BTreeSet<&Module> = graph.values().flatten().collect();
            let outside = |(m, to): &(&&Module, &BTreeSet<Module>)| to.is_empty() || !imported.contains(**m);
            let Some(outside) = graph.iter().find(outside).map(|(m, _)| (*m).clone()) else { break };
            graph.remove(&outside);
            for to in graph.values_mut() {
                to.remove(&outside);
            }
        }
        circles.extend(graph.into_iter().map(|(m, to)| format!("{name}: {} imports {to:?}", m.join("::"))));
    }
    assert!(circles.is_empty(), "{}", circles.join("\n"));
}

fn denied() -> io::Error {
    io::Error::new(io::ErrorKind::PermissionDenied, "denied")
}

/// Errors of every library with a source, or that replace one, and the number of sources.
fn errors() -> Vec<(Box<dyn Error>, usize)> {
    let path = || PathBuf::from("some.file");
    let layer = || {
        let source = KernelError::Length { tensor: "weight", expected: 3, found: 2 };
        EngineError::Layer { layer: "conv1".to_owned(), source }
    };
    let bytes = || IoError::Unsupported { expected: "some", actual: "other".to_owned() };
    let reading = RepresentationError::Reading { electrode: 3, value: f32::NAN };
    vec![
        (Box::new(layer()), 1),
        (Box::new(LiveError::Engine(layer())), 1),
        (Box::new(LiveError::Thread(denied())), 1),
        (Box::new(ModelError::Read { path: path(), source: denied() }), 1),
        (Box::new(ModelError::Engine(layer())), 1),
        (Box::new(ReferenceError::Engine(layer())), 1),
        (Box::new(ReferenceError::Engine(EngineError::Sensor(Sensor::new(0, 1)))), 0),
        (Box::new(SlipError::Reading(reading)), 0),
        (Box::new(IoError::File { action: "open", path: path(), source: denied() }), 1),
        (
            Box::new(IoError::Stream {
                format: "CSV",
                action: "read",
                place: Place::Line(2),
                source: denied(),
            }),
            1,
        ),
        (Box::new(IoError::Content { path: path(), source: Box::new(bytes()) }), 1),
    ]
}

#[test]
fn an_error_of_a_library_does_not_repeat_its_source() {
    for (error, sources) in errors() {
        let mut outer: &dyn Error = &*error;
        let mut count = 0;
        while let Some(source) = outer.source() {
            assert!(!outer.to_string().contains(&source.to_string()), "{outer}: {source}");
            outer = source;
            count += 1;
        }
        assert_eq!(count, sources, "{error}");
    }
}

const PAGES: [&str; 2] =
    [include_str!("../../docs/what-you-can-rely-on.md"), include_str!("../../docs/bad-input.md")];

/// Text between backticks that ends like the path of a Rust file, with or without a test.
fn references() -> Vec<(&'static str, Option<&'static str>)> {
    let of_rust = |path: &str| Path::new(path).extension().is_some_and(|extension| extension == "rs");
    let code = PAGES.iter().flat_map(|page| page.split('`').skip(1).step_by(2));
    let reference = |text: &'static str| match text.split_once("::") {
        Some((path, test)) => (path, Some(test)),
        None => (text, None),
    };
    code.map(reference).filter(|(path, _)| of_rust(path)).collect()
}

#[test]
fn every_promise_names_tests_that_are_there() {
    let root = root();
    let references = references();
    assert!(references.len() > 30, "{references:?}");
    for (path, test) in references {
        let text = std::fs::read_to_string(root.join(path)).unwrap_or_else(|error| panic!("{path}: {error}"));
        let Some(test) = test else { continue };
        let at = text.find(&format!("fn {test}(")).unwrap_or_else(|| panic!("{path} has no {test}"));
        let above =
            text[..at].trim_end().trim_end_matches("#[cfg_attr(no_shared, ignore = \"no ../shared\")]");
        assert!(above.trim_end().ends_with("#[test]"), "{path}: {test} is no test");
    }
}

#[test]
fn every_row_of_promises_names_what_holds_it() {
    let lines = PAGES.iter().flat_map(|page| page.lines());
    for row in lines.filter(|line| line.starts_with("| ") && !line.starts_with("| promise")) {
        assert!(row.contains(".rs"), "{row}");
    }
}

/// proptest gives no message if it finds none.
#[test]
fn failing_seeds_of_property_tests_are_found_where_they_are_kept() {
    let persistence = ProptestConfig::default().failure_persistence.expect("failures are kept by default");
    for file in ["tests/engine/incremental.rs", "tests/engine/snapshots_damaged.rs"] {
        assert!(!persistence.load_persisted_failures2(Some(file)).is_empty(), "{file}");
    }
}
