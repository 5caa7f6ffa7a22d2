//! Completions and pages of the manual.

use crate::support::{argument, meissner, text};

#[test]
fn completions_know_the_commands_and_their_options() {
    for shell in ["bash", "zsh", "fish", "elvish", "powershell"] {
        let script = text(&meissner(&["completions", shell]));
        for word in ["meissner", "pareto", "completions", "report-every"] {
            assert!(script.contains(word), "{shell}: {word}");
        }
    }
    assert_eq!(meissner(&["completions", "tcsh"]).status.code(), Some(2));
}

#[test]
fn every_command_has_a_page_of_its_whole_name() {
    let folder = tempfile::tempdir().expect("a folder");
    let man1 = folder.path().join("man1");
    for _ in 0..2 {
        assert!(text(&meissner(&["man", argument(&man1)])).is_empty());
    }
    let page = |name: &str| std::fs::read_to_string(man1.join(format!("{name}.1"))).expect("a page");
    assert!(page("meissner").contains("meissner\\-run(1)"), "{}", page("meissner"));
    assert!(page("meissner-run").contains("\\-\\-every"));
    assert!(page("meissner-eval-digits").starts_with(".ie") || page("meissner-eval-digits").contains(".TH"));
    assert!(std::fs::read_dir(&man1).expect("a folder").count() > 20);
}
