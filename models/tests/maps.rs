//! Maps of names: the meaning of lines, and refusals.

use super::{names, support};

use std::fmt::Write;

use meissner_models::{Description, ModelError, NameMap, Tensor, Weights, draw};
use names::renamed;
use proptest::prelude::*;
use support::SMALL;

fn small() -> Description {
    Description::parse(SMALL).expect("consistent")
}

fn map(text: &str) -> NameMap {
    NameMap::parse(text).unwrap_or_else(|error| panic!("{text}: {error}"))
}

/// Weights of these names, whose values are their indices.
fn weights(names: &[&str]) -> Weights {
    Weights::new(names.iter().enumerate().map(|(place, name)| {
        ((*name).to_owned(), Tensor::new(vec![1], vec![place as f32]).expect("one value"))
    }))
}

/// Names with the indices of their tensors.
fn places(weights: &Weights) -> Vec<(&str, f32)> {
    weights.iter().map(|(name, tensor)| (name, tensor.values().expect("floats")[0])).collect()
}

#[track_caller]
fn refused<T: std::fmt::Debug>(result: Result<T, ModelError>, parts: &[&str]) {
    let error = result.expect_err("refused");
    assert!(matches!(error, ModelError::Map { .. }), "{error}");
    let text = error.to_string();
    assert!(parts.iter().all(|part| text.contains(part)) && text.contains("expected"), "{text}");
}

#[test]
fn lines_apply_at_once_whole_names_first_and_long_starts_before_short_ones() {
    let file = weights(&["net.a", "net.b.c", "net.b.d", "x", "y", "z"]);
    let text = "# a comment\r\n\r\n  net. =\n net.b. = deep.  \nnet.b.d=own\nx = y\ny = x\n";
    let read = file.renamed(&map(text)).expect("a fitting map");
    assert_eq!(
        places(&read),
        [("a", 0.0), ("deep.c", 1.0), ("own", 2.0), ("x", 4.0), ("y", 3.0), ("z", 5.0)]
    );
}

#[test]
fn circles_and_chains_only_exchange_tensors() {
    let read = weights(&["a", "b", "c"]).renamed(&map("a = b\nb = c\nc = a")).expect("a circle");
    assert_eq!(places(&read), [("a", 2.0), ("b", 0.0), ("c", 1.0)]);
    let read = weights(&["a", "b"]).renamed(&map("b = c\na = b")).expect("a chain");
    assert_eq!(places(&read), [("b", 0.0), ("c", 1.0)]);
    let read = weights(&["a.x", "b.x"]).renamed(&map("a. = b.\nb. = a.")).expect("a circle of starts");
    assert_eq!(places(&read), [("a.x", 1.0), ("b.x", 0.0)]);
    let read = weights(&["a"]).renamed(&map("a = a")).expect("no change");
    assert_eq!(places(&read), [("a", 0.0)]);
}

#[test]
fn a_line_that_is_no_pair_of_names_is_refused_by_its_number() {
    for (text, found) in [
        ("a = b\nc", "line 2: expected a line \"name in the file = name in the network\", found \"c\""),
        ("= b", "line 1"),
        ("a =", "line 1"),
        ("a = b.", "line 1"),
        (
            "\na. = b",
            "line 2: expected a start of names, with a dot at its end, or nothing, found \"a. = b\"",
        ),
        ("a = b\na = c", "line 2: expected one line for \"a\", found another, line 1"),
        ("a. = b.\n\na. =", "line 3: expected one line for \"a.\", found another, line 1"),
        (&"x".repeat(1 << 16), "xxx\".."),
    ] {
        refused(NameMap::parse(text), &[found]);
    }
    assert!(NameMap::parse("").is_ok_and(|empty| empty == NameMap::default()));
}

#[test]
fn a_line_without_a_tensor_or_two_tensors_of_one_name_are_refused() {
    let file = || weights(&["a", "b", "n.c"]);
    refused(
        file().renamed(&map("b = x\nd = y")),
        &["line 2: expected a tensor of the file, found \"d\": none"],
    );
    refused(file().renamed(&map("m. = ")), &["line 1", "\"m.\": none"]);
    refused(file().renamed(&map("n.c = c\nn. = ")), &["line 2", "no line of their own", "\"n.\": none"]);
    for text in ["a = b", "a = x\nb = x", "n. = \na = c", "n.c = a"] {
        refused(file().renamed(&map(text)), &["line", "expected one tensor called", " of the file"]);
    }
    refused(weights(&["a.x", "b.x"]).renamed(&map("a. =\nb. =")), &["\"a.x\" and \"b.x\" of the file"]);
}

#[test]
fn maps_are_joined_and_entries_are_shown_where_they_do_not_fit() {
    let both = map("a = x").and(NameMap::entry("b=y").expect("a pair")).expect("two names");
    assert_eq!(places(&weights(&["a", "b"]).renamed(&both).expect("both")), [("x", 0.0), ("y", 1.0)]);
    refused(both.clone().and(map("b = z")), &["line 1: expected one line for \"b\", found another, \"b=y\""]);
    refused(NameMap::entry("b"), &["\"b\": expected a line"]);
    // Names that no line could have.
    let odd = NameMap::default().with("# a = b\n", "x").expect("names");
    assert_eq!(places(&weights(&["# a = b\n"]).renamed(&odd).expect("there")), [("x", 0.0)]);
    refused(NameMap::default().with("a", ""), &["\"a = \": expected a line"]);
    refused(odd.with("# a = b\n", "y"), &["expected one line for \"# a = b\\n\""]);
    refused(
        weights(&["a"]).renamed(&NameMap::entry("q = a").expect("a pair")),
        &["map of names, \"q = a\": "],
    );
}

#[test]
fn a_file_of_lines_is_read_up_to_a_bound_and_refused_with_its_name() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("names.txt");
    let load = |bytes: &[u8]| {
        std::fs::write(&path, bytes).expect("written");
        NameMap::load(&path)
    };
    assert!(load(b"\xef\xbb\xbfa = b\r\n").is_ok_and(|read| {
        weights(&["a"]).renamed(&read).is_ok_and(|weights| weights.get("b").is_some())
    }));
    refused(load(b"a = b\nc = \xff\n"), &["names.txt, line 2: expected text in UTF-8"]);
    refused(load(b"a = b\nb"), &["names.txt, line 2: "]);
    assert!(matches!(load("#".repeat((1 << 20) + 1).as_bytes()), Err(ModelError::Large { .. })));
    assert!(matches!(NameMap::load(folder.path().join("none")), Err(ModelError::Read { .. })));
}

#[test]
fn what_the_lines_leave_is_found_by_habits() {
    let description = small();
    let drawn = draw(&description, 5);
    let expected = description.network(&drawn).expect("its own names").fingerprint();
    let file = renamed(&drawn, |name| match name.strip_prefix("fc.") {
        Some(part) => format!("mlp.out.{part}"),
        None => format!("encoder.module.{}", name.replace(".norm.", ".bn.")),
    });
    assert!(description.network(&file).is_err(), "two prefixes");
    for text in ["mlp.out. = fc.\nencoder. =", "mlp.out.weight = fc.weight\nmlp.out.bias = fc.bias"] {
        let read = file.clone().renamed(&map(text)).expect("a fitting map");
        assert_eq!(description.network(&read).expect("by habits").fingerprint(), expected, "{text}");
    }
}

#[test]
fn a_whole_name_that_the_network_does_not_read_is_refused() {
    let description = small();
    let file = renamed(&draw(&description, 5), |name| name.replace("fc.weight", "out"));
    let read = file.renamed(&map("out = fc.wieght")).expect("the file has it");
    refused(description.network(&read), &["\"fc.wieght\": expected a tensor that network \"small\" reads"]);
    refused(description.unused_tensors(&read), &["\"fc.wieght\""]);
}

#[test]
fn a_map_says_which_of_two_tensors_is_meant() {
    let description = small();
    let drawn = draw(&description, 5);
    let both = ["student.", "teacher."].map(|prefix| renamed(&drawn, |name| format!("{prefix}{name}")));
    let both = both.iter().flat_map(Weights::iter);
    let both = Weights::new(both.map(|(name, tensor)| (name.to_owned(), tensor.clone())));
    assert!(matches!(description.network(&both), Err(ModelError::Ambiguous { .. })));
    assert!(description.network(&both.renamed(&map("teacher. =")).expect("a fitting map")).is_ok());
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 128, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn any_exchange_of_names_and_its_map_back_give_the_same_bits(order in Just((0..14_usize).collect::<Vec<_>>()).prop_shuffle()) {
        let description = small();
        let drawn = draw(&description, 3);
        let names: Vec<&str> = drawn.names().collect();
        prop_assert_eq!(names.len(), order.len());
        let shuffled = Weights::new(drawn.iter().zip(&order).map(|((_, tensor), &to)| (names[to].to_owned(), tensor.clone())));
        let mut back = String::new();
        for (name, &to) in names.iter().zip(&order) {
            writeln!(back, "{} = {name}", names[to]).expect("a string");
        }
        let read = shuffled.renamed(&map(&back)).map_err(|error| TestCaseError::fail(error.to_string()))?;
        let network = description.network(&read).map_err(|error| TestCaseError::fail(error.to_string()))?;
        prop_assert_eq!(network.fingerprint(), description.network(&drawn).expect("its own names").fingerprint());
    }

    #[test]
    fn any_text_is_a_map_or_a_typed_error_and_loses_no_tensor(text in "([abc.= #\n]|a\\.|b = ){0,40}") {
        let file = weights(&["a", "a.b", "a.b.c", "b", "c", "c.a"]);
        match NameMap::parse(&text).and_then(|map| file.clone().renamed(&map)) {
            Ok(read) => prop_assert_eq!(read.names().count(), 6),
            Err(error) => {
                prop_assert!(matches!(error, ModelError::Map { .. }), "{error}");
                prop_assert!(error.to_string().contains("expected"), "{error}");
            }
        }
    }
}
