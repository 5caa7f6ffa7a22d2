//! Every inconsistency of a head over the readout is reported by name and line.

use super::support;

use meissner_models::{AnyDescription, Description, Problem};
use support::{SMALL_FRAMES, changed, changed_head, listed, only_of, with_head};

fn problems(text: &str) -> Vec<Problem> {
    let error = Description::parse(text).expect_err("the description must be refused");
    listed(&error)
}

/// The only problem, as printed.
#[track_caller]
fn only(text: &str) -> String {
    only_of(&problems(text))
}

#[test]
fn the_description_that_the_others_are_made_from_is_consistent() {
    assert!(Description::parse(&with_head()).is_ok());
}

#[test]
fn dense_layers_beside_a_head_are_refused() {
    let text =
        changed_head("[[head]]", "[[layer]]\nname = \"out\"\nkind = \"dense\"\noutputs = 1\n\n[[head]]");
    assert_eq!(
        only(&text),
        "line 36: layer \"out\": expected no dense layer beside the [[head]] that starts on line 41, found one"
    );
}

#[test]
fn a_dense_layer_beside_a_head_is_refused_whatever_else_is_missing() {
    let text = changed_head(
        "[[layer]]\nname = \"grid\"\nkind = \"readout\"\ngrid = [2, 2]\n\n[[head]]",
        "[[layer]]\nname = \"out\"\nkind = \"dense\"\noutputs = 1\n\n[[head]]",
    );
    let found: Vec<String> = problems(&text).iter().map(ToString::to_string).collect();
    assert!(
        found.iter().any(|problem| problem.ends_with("expected a readout layer, found none")),
        "{found:#?}"
    );
    assert!(
        found.iter().any(|problem| problem.contains("\"out\": expected no dense layer beside")),
        "{found:#?}"
    );
}

#[test]
fn a_head_needs_a_readout() {
    let text = changed_head("[[layer]]\nname = \"grid\"\nkind = \"readout\"\ngrid = [2, 2]\n\n", "");
    assert_eq!(only(&text), "line 22: expected a readout layer, found none");
}

#[test]
fn a_readout_without_head_and_dense_layers_is_refused() {
    let text = changed("[[layer]]\nname = \"fc\"\nkind = \"dense\"\noutputs = 1\n\n", "");
    assert_eq!(only(&text), "line 31: expected a dense layer, found none");
}

#[test]
fn a_layer_that_no_head_depends_on_is_reported() {
    let spare =
        "[[layer]]\nname = \"spare\"\nkind = \"spline\"\nchannels = 2\nkernel = 2\nfrom = \"conv1\"\n\n";
    let text = changed_head(
        "[[layer]]\nname = \"pool1\"\n",
        &format!("{spare}[[layer]]\nname = \"pool1\"\nfrom = \"conv1\"\n"),
    );
    assert!(
        only(&text).starts_with("line 16: layer \"spare\": expected every layer to reach the prediction")
    );
}

#[test]
fn a_layer_of_the_head_that_the_last_one_does_not_depend_on_is_reported() {
    let spare =
        "[[head]]\nname = \"spare\"\nkind = \"sum\"\n\n[[head]]\nname = \"flat\"\nfrom = \"halved\"\n";
    let text = changed_head("[[head]]\nname = \"flat\"\n", spare);
    assert!(
        only(&text).starts_with("line 48: layer \"spare\": expected every layer to reach the prediction")
    );
}

#[test]
fn a_shape_that_does_not_fit_is_reported_with_what_is_read() {
    assert_eq!(
        only(&changed_head("kind = \"flatten\"", "kind = \"dense\"\noutputs = 2")),
        "line 48: layer \"flat\": from: expected a vector (an image becomes one in a flatten layer), found max_pool layer \
         \"halved\" on line 44 (2 x 1 x 1)"
    );
    assert_eq!(
        only(&changed_head("kind = \"max_pool\"", "kind = \"concat\"\nwith = \"fc\"")),
        "line 47: layer \"halved\": with: expected a layer above this one, found \"fc\" on line 53"
    );
    let halved = only(&changed_head("grid = [2, 2]", "grid = [2, 1]"));
    assert!(halved.starts_with("line 44: layer \"halved\": expected an output of"), "{halved}");
    assert!(halved.ends_with("found 2 x 0 x 1"), "{halved}");
}

#[test]
fn a_readout_that_is_no_image_of_a_frame_network_is_reported() {
    let found = only(&changed_head("grid = [2, 2]", "grid = [5000, 2]"));
    assert!(
        found.starts_with("line 31: layer \"grid\": expected an output of at most 4096 channels"),
        "{found}"
    );
    assert!(found.ends_with("found 3 x 2 x 5000"), "{found}");
}

#[test]
fn unknown_and_missing_keys_are_reported_as_those_of_frame_networks() {
    assert_eq!(
        only(&changed_head("kernel = 3\n", "kernel = 3\nstride = 1\n")),
        "line 41: layer \"image\": unknown key \"stride\": expected one of activation, bias, channels, from, kernel, kind, \
         name, norm, weights"
    );
    assert!(
        only(&changed_head("kernel = 3\n", ""))
            .starts_with("line 36: layer \"image\": missing key \"kernel\"")
    );
    assert!(
        only(&changed_head("kind = \"flatten\"", "kind = \"readout\""))
            .starts_with("line 50: layer \"flat\": kind: expected \"conv\" or \"upconv\"")
    );
}

#[test]
fn layers_with_a_state_are_refused() {
    for (kind, line) in [
        ("kind = \"lstm\"\nhidden = 2", 52),
        ("kind = \"lstm\"\nhidden = 2\nlayer = 1", 52),
        ("kind = \"delay\"\nframes = 2", 52),
        ("kind = \"delay\"\nframes = 1", 52),
    ] {
        let layer = format!("[[head]]\nname = \"past\"\n{kind}\n\n[[head]]\nname = \"fc\"\n");
        let found = only(&changed_head("[[head]]\nname = \"fc\"\n", &layer));
        let word = kind.split('"').nth(1).unwrap_or_default();
        assert_eq!(
            found,
            format!(
                "line {line}: layer \"past\": kind: expected a layer without state: predictions cannot depend on how often \
                 they are read, found \"{word}\""
            )
        );
    }
    let found = only(&changed_head("kind = \"max_pool\"", "kind = \"conv_lstm\"\nhidden = 2"));
    assert!(found.starts_with("line 44: layer \"halved\": kind: expected a layer without state"), "{found}");
}

#[test]
fn names_are_unique_over_layers_and_head() {
    assert_eq!(
        only(&changed_head("name = \"halved\"", "name = \"conv2\"")),
        "line 44: layer \"conv2\": name: expected another name than that of the layer on line 22"
    );
    assert_eq!(
        only(&changed_head("name = \"halved\"", "name = \"image\"")),
        "line 44: layer \"image\": name: expected another name than that of the layer on line 36"
    );
    assert!(
        only(&changed_head("name = \"halved\"", "name = \"events\""))
            .starts_with("line 45: layer \"events\": name: expected another name")
    );
}

#[test]
fn layers_and_head_refer_to_their_own_tables_and_the_head_to_the_readout() {
    assert!(
        Description::parse(&changed_head("name = \"image\"\n", "name = \"image\"\nfrom = \"grid\"\n"))
            .is_ok()
    );
    assert_eq!(
        only(&changed_head("name = \"image\"\n", "name = \"image\"\nfrom = \"conv2\"\n")),
        "line 38: layer \"image\": from: expected \"grid\" or the name of a layer of a table [[head]], found \"conv2\""
    );
    assert_eq!(
        only(&changed_head("skip = \"pool1\"", "skip = \"image\"")),
        "line 27: layer \"conv2\": skip: expected \"events\" or the name of a layer of a table [[layer]], found \"image\""
    );
}

#[test]
fn names_of_outputs_are_as_many_as_the_values_that_the_last_layer_writes() {
    assert_eq!(
        only(&changed_head("outputs = 1", "outputs = 3")),
        "line 58: names: expected 3 (outputs of layer \"fc\"), found 1"
    );
    // An image of 2 x 1 x 1, then one of 2 x 2 x 2.
    let (image, tail) = (with_head(), "[[head]]\nname = \"flat\"");
    let (start, end) = (image.find(tail).expect("there"), image.find("[output]").expect("there"));
    let text = format!("{}{}", &image[..start], &image[end..]);
    assert!(only(&text).ends_with("expected 2 (outputs of layer \"halved\"), found 1"));
    let text = text.replace("[[head]]\nname = \"halved\"\nkind = \"max_pool\"\n\n", "");
    assert!(only(&text).ends_with("expected 8 (outputs of layer \"image\"), found 1"));
    assert!(Description::parse(&text.replace("[\"roll\"]", &format!("{:?}", ["v"; 8]))).is_ok());
}

#[test]
fn two_layers_of_one_tensor_are_reported() {
    assert_eq!(
        only(&changed_head("activation = \"relu\"\n", "activation = \"relu\"\nweights = \"fc\"\n")),
        "line 53: layer \"fc\": weights: expected tensors of its own, found \"fc.weight\" also read by layer \"image\""
    );
    // The running statistics of the block and of the convolution.
    assert_eq!(
        only(&changed_head("norm = \"norm1\"", "norm = \"conv2.norm\"")),
        "line 36: layer \"image\": weights: expected tensors of its own, found \"conv2.norm.weight\" also read by layer \
         \"conv2\""
    );
}

#[test]
fn independent_problems_of_layers_and_head_are_all_reported() {
    let text = changed_head("k = 4", "k = 0")
        .replace("channels = 2\nkernel = 3", "channels = 2\nkernel = 2")
        .replace("outputs = 1", "outputs = 0");
    let lines: Vec<usize> = problems(&text).iter().map(|problem| problem.line).collect();
    assert_eq!(lines, [6, 40, 55]);
}

#[test]
fn frame_networks_have_no_head() {
    let text =
        SMALL_FRAMES.replacen("[[layer]]", "[[head]]\nname = \"first\"\nkind = \"flatten\"\n\n[[layer]]", 1);
    let error = AnyDescription::parse(&text).expect_err("an unknown table").to_string();
    assert!(error.contains("unknown key \"head\""), "{error}");
}

#[test]
fn what_is_not_a_table_of_the_head_is_reported() {
    let text = changed("[network]", "head = [1]\n\n[network]");
    assert!(
        problems(&text)
            .iter()
            .any(|problem| problem.to_string() == "line 1: head: expected a table [[head]], found 1")
    );
    let text = changed("[network]", "head = 1\n\n[network]");
    assert_eq!(only(&text), "line 1: head: expected tables [[head]], found 1");
}
