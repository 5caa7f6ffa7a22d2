//! Every promise in the documentation names tests that are there.

use std::path::Path;

use proptest::prelude::ProptestConfig;

const PAGE: &str = include_str!("../../docs/what-you-can-rely-on.md");

/// What stands between backticks and ends as the path of a Rust file, with a test or without.
fn references() -> Vec<(&'static str, Option<&'static str>)> {
    let of_rust = |path: &str| Path::new(path).extension().is_some_and(|extension| extension == "rs");
    let code = PAGE.split('`').skip(1).step_by(2);
    let reference = |text: &'static str| match text.split_once("::") {
        Some((path, test)) => (path, Some(test)),
        None => (text, None),
    };
    code.map(reference).filter(|(path, _)| of_rust(path)).collect()
}

#[test]
fn every_promise_names_tests_that_are_there() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).parent().expect("a workspace");
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
    for row in PAGE.lines().filter(|line| line.starts_with("| ") && !line.starts_with("| promise")) {
        assert!(row.contains(".rs"), "{row}");
    }
}

/// proptest reads and writes them in `proptest-regressions` beside the folder with `main.rs`, and says
/// nothing where it finds none.
#[test]
fn failing_seeds_of_property_tests_are_found_where_they_are_kept() {
    let persistence = ProptestConfig::default().failure_persistence.expect("failures are kept by default");
    for file in ["tests/engine/incremental.rs", "tests/engine/snapshots_of_frames.rs"] {
        assert!(!persistence.load_persisted_failures2(Some(file)).is_empty(), "{file}");
    }
}
