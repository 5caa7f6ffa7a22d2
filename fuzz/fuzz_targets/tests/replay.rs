//! The corpora, replayed: the promises hold for every seed and every finding.

use std::path::Path;

use meissner_fuzz::{Mutator, TARGETS, Target, Verdict, corpus};

#[test]
fn every_input_of_the_corpora_keeps_its_promise() {
    for Target { name, run } in TARGETS {
        let inputs = corpus::read(name).unwrap_or_else(|e| panic!("corpus of {name}: {e}"));
        assert!(!inputs.is_empty(), "{name} has a corpus");
        for (file, bytes) in inputs {
            // If it panics, the file's name is printed above the panic's message.
            println!("{name}/{file}");
            run(&bytes);
        }
    }
}

#[test]
fn every_corpus_has_an_input_that_is_accepted() {
    for Target { name, run } in TARGETS {
        let inputs = corpus::read(name).expect("a corpus");
        assert!(inputs.iter().any(|(_, bytes)| run(bytes) == Verdict::Accepted), "{name}");
    }
}

#[test]
fn inputs_of_corpora_are_small() {
    for Target { name, .. } in TARGETS {
        for (file, bytes) in corpus::read(name).expect("a corpus") {
            assert!(bytes.len() <= 16 << 10, "{name}/{file}: {} bytes", bytes.len());
        }
    }
}

#[test]
fn a_few_mutations_of_each_corpus_keep_their_promise() {
    for Target { name, run } in TARGETS {
        let inputs = corpus::read(name).expect("a corpus");
        let mutator = Mutator::new(&inputs, 1);
        for index in 0..200 {
            println!("{name}: input {index} of seed 1");
            run(&mutator.input(index));
        }
    }
}

#[test]
fn a_mutation_depends_on_its_seed_and_index_alone() {
    let inputs = corpus::read("csv").expect("a corpus");
    let mutator = Mutator::new(&inputs, 7);
    let forwards: Vec<_> = (0..50).map(|index| mutator.input(index)).collect();
    let mut backwards: Vec<_> = (0..50).rev().map(|index| mutator.input(index)).collect();
    backwards.reverse();
    assert_eq!(forwards, backwards);
    assert_ne!(forwards, (0..50).map(|index| Mutator::new(&inputs, 8).input(index)).collect::<Vec<_>>());
}

#[test]
fn cargo_fuzz_has_a_binary_for_every_target_and_no_other() {
    let manifest = Path::new(env!("CARGO_MANIFEST_DIR")).join("../Cargo.toml");
    let manifest = std::fs::read_to_string(manifest).expect("cargo-fuzz's manifest");
    let source = "path = \"fuzz_target.rs\"";
    assert_eq!(manifest.matches(source).count(), TARGETS.len());
    for Target { name, .. } in TARGETS {
        assert!(manifest.contains(&format!("name = \"{name}\", {source}")), "{name} in the manifest");
    }
}
