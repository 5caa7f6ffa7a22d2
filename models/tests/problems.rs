//! Every inconsistency of a description is reported by name and line.

use super::support;

use meissner_models::description::ProblemKind;
use meissner_models::{Description, Problem};
use support::{SMALL, changed, listed, only_of};

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
    assert!(Description::parse(SMALL).is_ok());
}

#[test]
fn text_that_is_not_toml_is_reported_with_its_line() {
    let found = problems(&changed("k = 4", "k = = 4"));
    assert_eq!(found[0].line, 6);
    assert!(matches!(found[0].kind, ProblemKind::Syntax(_)));
}

#[test]
fn an_unknown_key_is_reported_with_its_line_and_the_known_ones() {
    let text = changed("channels = 3\nkernel = 2\n", "channels = 3\nkernel = 2\nstride = 1\n");
    assert_eq!(
        only(&text),
        "line 15: layer \"conv1\": unknown key \"stride\": expected one of bias, channels, elu, from, kernel, kind, \
         name, norm, root, skip, weights"
    );
    assert!(
        only(&changed("unit = \"rad\"", "unit = \"rad\"\ncolour = 1"))
            .starts_with("line 44: unknown key \"colour\"")
    );
}

#[test]
fn a_missing_key_is_reported_at_its_table() {
    assert_eq!(
        only(&changed("channels = 3\n", "")),
        "line 10: layer \"conv1\": missing key \"channels\": expected a whole number from 1 to 65536"
    );
    assert!(only(&changed("k = 4\n", "")).starts_with("line 4: missing key \"k\""));
    assert!(only(&changed("name = \"fc\"\n", "")).starts_with("line 36: missing key \"name\""));
    assert!(
        only(&changed("[output]\nnames = [\"roll\"]\nunit = \"rad\"\n", ""))
            .contains("missing key \"output\"")
    );
}

#[test]
fn a_value_of_another_type_or_range_is_reported_with_what_was_expected() {
    for (old, new, expected) in [
        ("k = 4", "k = 0", "line 6: k: expected a whole number from 1 to 255, found 0"),
        ("k = 4", "k = 2.5", "line 6: k: expected a whole number from 1 to 255, found 2.5"),
        ("kind = \"knn\"", "kind = \"ball\"", "line 5: kind: expected \"knn\" or \"radius\", found \"ball\""),
        ("scale = 0.5", "scale = -1", "line 8: scale: expected a finite number above 0, found -1"),
        ("scale = 0.5", "scale = 1e-60", "line 8: scale: expected a finite number above 0, found 1e-60"),
        ("scale = 0.5", "scale = nan", "line 8: scale: expected a finite number above 0, found nan"),
        (
            "kernel = 2\n",
            "kernel = [2, 0]\n",
            "line 14: layer \"conv1\": kernel: expected a kernel size from 1 to 64, or two or three of them along x, y \
             (and t), found [2, 0]",
        ),
        (
            "cell = [\"1/8\", \"1/6\"]",
            "cell = [\"1/8\", \"0/6\"]",
            "line 19: layer \"pool1\": cell: expected two fractions of the sensor along x and y, such as [\"16/346\", \
             \"12/260\"], found [\"1/8\", \"0/6\"]",
        ),
        (
            "grid = [2, 2]",
            "grid = [0, 2]",
            "line 34: layer \"grid\": grid: expected columns and rows of the grid, such as [4, 4], at most 65536 cells, \
             found [0, 2]",
        ),
        ("root = true", "root = 1", "line 28: layer \"conv2\": root: expected true or false, found 1"),
        (
            "kind = \"dense\"",
            "kind = \"dens\"",
            "line 38: layer \"fc\": kind: expected \"block\" or \"spline\" or \"pointnet\" or \"pool\" or \"readout\" or \"dense\", found \"dens\"",
        ),
    ] {
        assert_eq!(only(&changed(old, new)), expected);
    }
}

#[test]
fn more_cells_than_the_engine_has_are_reported() {
    let text = changed("cell = [\"1/8\", \"1/6\"]", "cell = [\"1/8000\", \"1/6000\"]");
    assert_eq!(
        only(&text),
        "line 16: layer \"pool1\": cell: expected a size that gives at most 4194304 cells, found 48000000 cells"
    );
}

#[test]
fn a_lifetime_belongs_to_the_past_only() {
    let text = changed("candidates = \"all\"", "candidates = \"all\"\nlifetime = \"frozen\"");
    assert_eq!(only(&text), "line 8: lifetime: expected only with candidates = \"past\"");
    assert!(only(&changed("\"all\"", "\"past\"")).starts_with("line 4: missing key \"lifetime\""));
}

#[test]
fn a_scale_belongs_to_fixed_normalisation_only() {
    let text = changed("name = \"small\"", "name = \"small\"\nnormalisation = \"per-graph\"");
    let found = problems(&text);
    let lines: Vec<usize> = found.iter().map(|p| p.line).collect();
    assert_eq!(lines, [9, 21], "{found:#?}");
    assert!(matches!(found[0].kind, ProblemKind::Inapplicable { key: "scale", .. }));
}

#[test]
fn per_graph_normalisation_of_frozen_rows_is_refused() {
    let text = changed("name = \"small\"", "name = \"small\"\nnormalisation = \"per-graph\"")
        .replace("\nscale = 0.5", "")
        .replace("\nscale = 0.4", "")
        .replace("\"all\"", "\"past\"\nlifetime = \"frozen\"");
    assert!(only(&text).starts_with("line 9: lifetime: expected \"window\""));
}

#[test]
fn two_layers_of_one_name_are_reported_with_both_lines() {
    let text = changed("name = \"conv2\"", "name = \"conv1\"");
    assert_eq!(
        only(&text),
        "line 22: layer \"conv1\": name: expected another name than that of the layer on line 10"
    );
    let text = changed("name = \"conv1\"", "name = \"events\"");
    assert!(only(&text).starts_with("line 11: layer \"events\": name: expected another name"));
}

#[test]
fn a_reference_to_no_layer_is_reported_with_its_line() {
    assert_eq!(
        only(&changed("skip = \"pool1\"", "skip = \"pool9\"")),
        "line 27: layer \"conv2\": skip: expected \"events\" or the name of a layer in this file, found \"pool9\""
    );
    assert!(
        only(&changed("outputs = 1", "outputs = 1\nfrom = \"gird\""))
            .starts_with("line 40: layer \"fc\": from: expected")
    );
}

#[test]
fn a_skip_with_other_channels_is_reported_with_its_line() {
    let text = changed("channels = 3\nkernel = [2, 3]", "channels = 5\nkernel = [2, 3]");
    assert_eq!(only(&text), "line 27: layer \"conv2\": skip \"pool1\": expected 5 channels, found 3");
}

#[test]
fn a_skip_from_another_level_is_reported_with_both_levels() {
    assert_eq!(
        only(&changed("skip = \"pool1\"", "skip = \"conv1\"")),
        "line 27: layer \"conv2\": skip: expected a layer over the cells of \"pool1\", found \"conv1\" over the events"
    );
}

#[test]
fn a_cycle_is_reported_once_with_its_path() {
    let text = changed("name = \"conv1\"\n", "name = \"conv1\"\nfrom = \"conv2\"\n");
    assert_eq!(
        only(&text),
        "line 10: layer \"conv1\": expected an acyclic graph, found the cycle \"conv1\" -> \"pool1\" -> \"conv2\" -> \
         \"conv1\""
    );
    let text = changed("skip = \"pool1\"", "skip = \"conv2\"");
    assert!(only(&text).ends_with("found the cycle \"conv2\" -> \"conv2\""));
}

#[test]
fn a_layer_that_no_prediction_depends_on_is_reported() {
    let text = changed(
        "[[layer]]\nname = \"grid\"\n",
        "[[layer]]\nname = \"spare\"\nkind = \"spline\"\nchannels = 2\nkernel = 2\n\n[[layer]]\nname = \"grid\"\nfrom = \"conv2\"\n",
    );
    assert_eq!(
        only(&text),
        "line 31: layer \"spare\": expected every layer to reach the prediction, found none that reads this one on the \
         way to it"
    );
}

#[test]
fn a_second_pooling_of_one_level_is_a_layer_without_use() {
    let text = changed(
        "[[layer]]\nname = \"conv2\"\n",
        "[[layer]]\nname = \"side\"\nkind = \"pool\"\ncell = [\"1/2\", \"1/2\"]\nscale = 1\nfrom = \"conv1\"\n\n[[layer]]\nname = \"conv2\"\nfrom = \"pool1\"\n",
    );
    assert!(only(&text).starts_with("line 22: layer \"side\": expected every layer to reach"));
}

#[test]
fn a_missing_readout_is_reported_and_so_is_the_dense_layer_before_it() {
    let text = changed("[[layer]]\nname = \"grid\"\nkind = \"readout\"\ngrid = [2, 2]\n\n", "");
    let found: Vec<String> = problems(&text).iter().map(ToString::to_string).collect();
    assert_eq!(
        found,
        [
            "line 31: expected a readout layer, found none",
            "line 31: layer \"fc\": from: expected the readout or a dense layer, found spline layer \"conv2\" on line 22",
        ]
    );
}

#[test]
fn a_missing_dense_layer_is_reported() {
    let text = changed("[[layer]]\nname = \"fc\"\nkind = \"dense\"\noutputs = 1\n\n", "");
    assert_eq!(only(&text), "line 31: expected a dense layer, found none");
}

#[test]
fn a_layer_is_missing_whatever_else_is_wrong() {
    let text = changed("[[layer]]\nname = \"fc\"\nkind = \"dense\"\noutputs = 1\n\n", "")
        .replace("skip = \"pool1\"", "skip = \"pool9\"");
    let lines: Vec<usize> = problems(&text).iter().map(|p| p.line).collect();
    assert_eq!(lines, [27, 31]);
}

#[test]
fn rows_cannot_be_read_from_a_readout() {
    let text = changed("kind = \"dense\"\noutputs = 1", "kind = \"spline\"\nchannels = 1\nkernel = 2");
    let found: Vec<String> = problems(&text).iter().map(ToString::to_string).collect();
    assert!(
        found.contains(
            &"line 36: layer \"fc\": from: expected \"events\", a block or a pool layer, found readout layer \"grid\" \
              on line 31"
                .to_owned()
        ),
        "{found:#?}"
    );
}

#[test]
fn a_second_readout_is_reported() {
    let text = changed(
        "[[layer]]\nname = \"fc\"\n",
        "[[layer]]\nname = \"grid2\"\nkind = \"readout\"\ngrid = [1, 1]\nfrom = \"conv2\"\n\n[[layer]]\nname = \"fc\"\nfrom = \"grid\"\n",
    );
    assert_eq!(only(&text), "line 36: layer \"grid2\": expected one readout, found another on line 31");
}

#[test]
fn two_dense_layers_that_none_reads_are_reported() {
    let text = changed(
        "[output]",
        "[[layer]]\nname = \"fc2\"\nkind = \"dense\"\noutputs = 1\nfrom = \"grid\"\n\n[output]",
    );
    assert_eq!(
        only(&text),
        "line 41: layer \"fc2\": expected one dense layer that no other reads (the prediction), found this one and that \
         of line 36"
    );
}

#[test]
fn names_of_outputs_are_as_many_as_outputs() {
    assert_eq!(
        only(&changed("outputs = 1", "outputs = 3")),
        "line 42: names: expected 3 (outputs of layer \"fc\"), found 1"
    );
}

#[test]
fn two_layers_of_one_tensor_are_reported() {
    let text = changed("kernel = 2\n", "kernel = 2\nweights = \"conv2\"\n");
    assert_eq!(
        only(&text),
        "line 23: layer \"conv2\": weights: expected tensors of its own, found \"conv2.conv.weight\" also read by layer \
         \"conv1\""
    );
}

#[test]
fn cells_in_time_over_cells_without_are_refused() {
    let text = changed(
        "[[layer]]\nname = \"grid\"\n",
        "[[layer]]\nname = \"pool2\"\nkind = \"pool\"\ncell = [\"1/2\", \"1/2\"]\ntime = \"1/3\"\nscale = 1\n\n[[layer]]\nname = \"grid\"\n",
    );
    assert_eq!(
        only(&text),
        "line 35: layer \"pool2\": time: expected no cells in time over the cells of \"pool1\", which have none, found \
         \"1/3\""
    );
}

#[test]
fn a_readout_by_time_needs_cells_in_time() {
    let by_time = |text: &str| text.replace("kind = \"readout\"", "kind = \"readout\"\nby_time = true");
    assert_eq!(
        only(&by_time(SMALL)),
        "line 31: layer \"grid\": by_time: expected only with poolings over the same cells in time"
    );
    let cells = changed("cell = [\"1/8\", \"1/6\"]", "cell = [\"1/8\", \"1/6\"]\ntime = \"1/3\"");
    let description = Description::parse(&by_time(&cells)).expect("consistent");
    let outputs = |text: &str| text.lines().find(|line| line.starts_with("grid")).map(str::to_owned);
    let table = outputs(&description.to_table()).expect("the readout is listed");
    assert!(table.contains("x4 "), "a window fills 4 cells of a third of it: {table}");
}

#[test]
fn a_sum_is_over_events_only() {
    let sum = |text: &str| text.replace("kind = \"readout\"", "kind = \"readout\"\naggregation = \"sum\"");
    assert_eq!(
        only(&sum(SMALL)),
        "line 31: layer \"grid\": aggregation: expected \"max\" above a pooling, found \"sum\""
    );
}

#[test]
fn cells_in_time_shorter_than_a_microsecond_are_refused() {
    let text = changed("cell = [\"1/8\", \"1/6\"]", "cell = [\"1/8\", \"1/6\"]\ntime = \"1/3\"");
    assert!(Description::parse(&text).is_ok());
    let text = text.replace("name = \"small\"", "name = \"small\"\nspan_us = 2");
    assert_eq!(
        only(&text),
        "line 21: layer \"pool1\": time: expected cells of at least 1 us of the span's 2, found \"1/3\""
    );
}

#[test]
fn a_tensor_beyond_bounds_is_reported() {
    let text = changed("kernel = 2\n", "kernel = 64\n")
        .replace("channels = 3\nkernel = 64", "channels = 60000\nkernel = 64");
    assert!(only(&text.replace("skip = \"pool1\"\n", "")).contains("kernel: expected at most"));
}

#[test]
fn a_network_that_asks_for_a_terabyte_is_refused_at_the_layer_with_which_it_is_too_large() {
    // Each layer's weights are within bounds: 2^26 of them.
    let mut text = SMALL.split("[[layer]]").next().map(str::to_owned).unwrap_or_default();
    let layer = |i| {
        format!("[[layer]]\nname = \"c{i}\"\nkind = \"spline\"\nchannels = 2896\nkernel = 2\nnorm = false\n")
    };
    text.extend((0..1000).map(layer));
    text += "[[layer]]\nname = \"grid\"\nkind = \"readout\"\ngrid = [1, 1]\n\
             [[layer]]\nname = \"fc\"\nkind = \"dense\"\noutputs = 1\n\
             [output]\nnames = [\"roll\"]\nunit = \"rad\"\n";
    let found = only(&text);
    let expected =
        "layer \"c5\": expected at most 268435456 parameters in the network up to this layer, found";
    assert!(found.contains(expected), "{found}");
}

#[test]
fn independent_problems_are_all_reported_by_line() {
    let text = changed("k = 4", "k = 0")
        .replace("channels = 3\nkernel = 2\n", "channels = \"many\"\nkernel = 2\nstride = 1\n")
        .replace("skip = \"pool1\"", "skip = \"pool9\"")
        .replace("names = [\"roll\"]", "names = []")
        .replace("grid = [2, 2]", "grid = [2]");
    let lines: Vec<usize> = problems(&text).iter().map(|p| p.line).collect();
    assert_eq!(lines, [6, 13, 15, 28, 35, 43]);
}

#[test]
fn a_long_chain_is_checked_without_deep_recursion() {
    let mut text = SMALL.split("[[layer]]").next().map(str::to_owned).unwrap_or_default();
    let layer = |i| format!("[[layer]]\nname = \"c{i}\"\nkind = \"spline\"\nchannels = 1\nkernel = 2\n");
    text.extend((0..1025).map(layer));
    let found = problems(&text);
    assert!(found.iter().any(|p| p.to_string().contains("at most 1024 layers, found 1025")), "{found:#?}");
}

#[test]
fn classes_stand_in_place_of_names_and_unit_and_are_checked_by_line() {
    let with = |output: &str| {
        let text = SMALL.replace("outputs = 1", "outputs = 2");
        let text = text.replace("names = [\"roll\"]\nunit = \"rad\"\n", output);
        Description::parse(&text).map_err(|error| error.to_string())
    };
    let told = with("classes = [\"left\", \"right\"]\n").expect("consistent");
    assert_eq!(told.classes().expect("classes"), ["left", "right"]);
    assert_eq!(told.outputs().1, ["logit", "logit"]);
    assert_eq!(
        with("names = [\"a\", \"b\"]\nunit = [\"mm\", \"deg\"]\n").expect("consistent").outputs().1,
        ["mm", "deg"]
    );
    assert_eq!(with("names = [\"a\", \"b\"]\nunit = \"N\"\n").expect("consistent").classes(), None);
    for (output, expected) in [
        ("classes = [\"a\"]\n", "classes: expected at least two names of classes, each once"),
        ("classes = [\"a\", \"a\"]\n", "classes: expected at least two names of classes, each once"),
        ("names = [\"a\", \"b\"]\nunit = [\"N\"]\n", "unit: expected the unit of all predicted values"),
        ("classes = [\"a\", \"b\"]\nunit = \"N\"\n", "unit: expected only with names in place of classes"),
        ("classes = [\"a\", \"b\", \"c\"]\n", "names: expected 2 (outputs of layer \"fc\"), found 3"),
        ("names = [\"a\", \"b\"]\n", "missing key \"unit\""),
        ("unit = \"N\"\n", "missing key \"names\""),
    ] {
        let error = with(output).expect_err(output);
        assert!(error.starts_with("line ") && error.contains(expected), "{output}: {error}");
    }
}

#[test]
fn a_place_needs_two_cells_of_a_positive_size() {
    for wrong in ["[\"1/9\"]", "\"1/9\"", "[\"1/9\", \"0/7\"]", "[1, 2]", "[\"1/9\", \"1/7\", \"1/3\"]"] {
        let found = only(&changed("[network]\n", &format!("[network]\nplace = {wrong}\n")));
        assert!(found.contains("place: expected two fractions of the sensor along x and y"), "{found}");
    }
}
