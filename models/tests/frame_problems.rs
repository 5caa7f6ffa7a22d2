//! Every inconsistency of a frame network's description is reported by name and line.

use super::support;

use meissner_models::{AnyDescription, Description, FrameDescription, Problem};
use support::{SMALL, SMALL_FRAMES, changed_frames, listed, only_of};

fn problems(text: &str) -> Vec<Problem> {
    let error = FrameDescription::parse(text).expect_err("the description must be refused");
    assert_eq!(AnyDescription::parse(text).expect_err("this one too"), error);
    listed(&error)
}

/// The only problem, as printed.
#[track_caller]
fn only(text: &str) -> String {
    only_of(&problems(text))
}

#[test]
fn the_description_that_the_others_are_made_from_is_consistent() {
    assert!(FrameDescription::parse(SMALL_FRAMES).is_ok());
}

#[test]
fn a_description_of_the_other_kind_is_called_by_its_name() {
    let error = Description::parse(SMALL_FRAMES).expect_err("a frame network");
    assert_eq!(
        error.to_string(),
        "line 4: expected a network over events, with a table [graph], found a frame network, with a table [input]"
    );
    let error = FrameDescription::parse(SMALL).expect_err("a network over events");
    assert!(error.to_string().starts_with("line 4: expected a frame network"), "{error}");
}

#[test]
fn both_kinds_in_one_file_are_reported() {
    let text = changed_frames("[input]", "[graph]\nkind = \"knn\"\n\n[input]");
    assert_eq!(only(&text), "line 4: unknown key \"graph\": expected one of input, layer, network, output");
}

#[test]
fn unknown_and_missing_keys_are_reported_with_their_lines() {
    assert_eq!(
        only(&changed_frames("hidden = 2", "hidden = 2\nstride = 1")),
        "line 24: layer \"cell\": unknown key \"stride\": expected one of activation, from, hidden, kind, name, \
         peepholes, weights"
    );
    assert_eq!(
        only(&changed_frames("hidden = 2\n", "")),
        "line 20: layer \"cell\": missing key \"hidden\": expected a whole number from 1 to 4096"
    );
    assert_eq!(
        only(&changed_frames("steps = 5\n", "")),
        "line 4: missing key \"steps\": expected a whole number from 1 to 65536"
    );
    assert!(
        only(&changed_frames("scaling", "maximum = 3\nscaling"))
            .starts_with("line 11: unknown key \"maximum\"")
    );
    assert!(only(&changed_frames("name = \"fc\"\n", "")).starts_with("line 34: missing key \"name\""));
}

#[test]
fn a_value_of_another_type_or_range_is_reported_with_what_was_expected() {
    for (old, new, expected) in [
        (
            "height = 12",
            "height = 4097",
            "line 7: height: expected a whole number from 1 to 4096, found 4097",
        ),
        (
            "kind = \"image\"",
            "kind = \"film\"",
            "line 5: kind: expected \"image\" or \"vector\", found \"film\"",
        ),
        (
            "frames = \"tactile-image\"",
            "frames = \"touch\"",
            "line 9: frames: expected \"event-counts\" or \"signed\" or \"tactile-image\" or \"electrodes\" or \
             \"picture\", found \"touch\"",
        ),
        (
            "scaling = \"image\"",
            "scaling = [2, 1]",
            "line 11: scaling: expected \"image\", \"reading\", or a range such as [1800, 3500], found [2, 1]",
        ),
        ("kernel = 3", "kernel = 5", "line 17: layer \"conv1\": kernel: expected 1 or 3, found 5"),
        (
            "activation = \"relu\"",
            "activation = \"tanh\"",
            "line 18: layer \"conv1\": activation: expected \"identity\" or \"relu\", found \"tanh\"",
        ),
        (
            "hidden = 2",
            "hidden = 2\nactivation = \"relu\"",
            "line 24: layer \"cell\": activation: expected \"tanh\" or \"sigmoid\", found \"relu\"",
        ),
        (
            "steps = 5",
            "steps = \"five\"",
            "line 10: steps: expected a whole number from 1 to 65536, found \"five\"",
        ),
        (
            "activation = \"relu\"",
            "norm = true",
            "line 18: layer \"conv1\": norm: expected the prefix of batch norm's tensor names, found true",
        ),
    ] {
        assert_eq!(only(&changed_frames(old, new)), expected);
    }
    let kind = only(&changed_frames("kind = \"flatten\"", "kind = \"flat\""));
    assert!(kind.starts_with("line 32: layer \"flat\": kind: expected \"conv\" or \"upconv\" or"), "{kind}");
}

#[test]
fn a_frame_of_another_shape_than_its_source_makes_is_refused() {
    assert_eq!(
        only(&changed_frames("height = 12", "height = 13")),
        "line 5: kind: expected an image 1 x 12 x 11, as frames = \"tactile-image\" gives, found 1 x 13 x 11"
    );
    let text = changed_frames(
        "frames = \"tactile-image\"\nsteps = 5\nscaling = \"image\"",
        "frames = \"event-counts\"\nmaximum = 4",
    );
    assert_eq!(
        only(&text),
        "line 5: kind: expected an image with channels = 2, as frames = \"event-counts\" gives, found 1 x 12 x 11"
    );
}

#[test]
fn settings_of_every_source_are_checked() {
    let source = |channels: usize, settings: &str| {
        changed_frames("channels = 1", &format!("channels = {channels}"))
            .replace("frames = \"tactile-image\"\nsteps = 5\nscaling = \"image\"", settings)
    };
    let picture = "frames = \"picture\"\nmean = [0, 0, 0]\nstd = [1, 1, 1]\nforce_mean = 0\nforce_std = 1\npixel_mm = [1, 1]";
    let signed = "frames = \"signed\"\nspan_us = 100";
    let counts = "frames = \"event-counts\"\nmaximum = 4";
    for (channels, settings) in [(3, picture), (1, signed), (2, counts)] {
        assert!(FrameDescription::parse(&source(channels, settings)).is_ok(), "{settings}");
    }
    for (channels, settings, old, new, expected) in [
        (3, picture, "std = [1, 1, 1]", "std = [1, 0, 1]", "line 11: std: expected standard deviations"),
        (3, picture, "std = [1, 1, 1]", "std = [1, 1e-40, 1]", "line 11: std: expected "),
        (
            3,
            picture,
            "force_std = 1",
            "force_std = -1",
            "line 13: force_std: expected a finite number above 0",
        ),
        (3, picture, "[1, 1]", "[1, 1]\nmedian_window = 4", "line 15: median_window: expected an odd number"),
        (1, signed, "= 100", "= 100\nperiod_us = 10", "line 10: span_us: expected only with no period_us"),
        (1, signed, "span_us = 100", "", "line 4: missing key \"span_us\""),
        (1, signed, "= 100", "= 100\ncrop = \"left\"", "line 11: crop: expected \"centre\", or the first"),
        (2, counts, "maximum = 4", "maximum = 0.5", "line 10: maximum: expected a finite number from 1 on"),
        (2, counts, "= 4", "= 4\ncrop = [70000, 0]", "line 11: crop: expected"),
    ] {
        assert!(settings.contains(old));
        let found = only(&source(channels, &settings.replacen(old, new, 1)));
        assert!(found.starts_with(expected), "{found}");
    }
}

#[test]
fn two_layers_of_one_name_are_reported_with_both_lines() {
    assert_eq!(
        only(&changed_frames("name = \"cell\"", "name = \"conv1\"")),
        "line 20: layer \"conv1\": name: expected another name than that of the layer on line 13"
    );
    assert!(
        only(&changed_frames("name = \"cell\"", "name = \"frame\""))
            .contains("than that of the network's input")
    );
}

#[test]
fn references_name_a_layer_above() {
    assert_eq!(
        only(&changed_frames("with = \"conv1\"", "with = \"conv9\"")),
        "line 28: layer \"join\": with: expected \"frame\" or the name of a layer in this file, found \"conv9\""
    );
    assert_eq!(
        only(&changed_frames("with = \"conv1\"", "with = \"fc\"")),
        "line 28: layer \"join\": with: expected a layer above this one, found \"fc\" on line 34"
    );
    assert_eq!(
        only(&changed_frames("hidden = 2", "hidden = 2\nfrom = \"cell\"")),
        "line 24: layer \"cell\": from: expected a layer above this one, found \"cell\" on line 20"
    );
}

#[test]
fn images_and_vectors_are_kept_apart() {
    assert_eq!(
        only(&changed_frames("outputs = 2", "outputs = 2\nfrom = \"join\"")),
        "line 38: layer \"fc\": from: expected a vector (an image becomes one in a flatten layer), found concat layer \
         \"join\" on line 25 (5 x 12 x 11)"
    );
    assert_eq!(
        only(&changed_frames("kind = \"dense\"\noutputs = 2", "kind = \"max_pool\"")),
        "line 34: layer \"fc\": from: expected an image, found flatten layer \"flat\" on line 30 (660 values)"
    );
}

#[test]
fn joined_images_have_one_size() {
    let text = changed_frames("kind = \"conv_lstm\"\nhidden = 2", "kind = \"max_pool\"");
    assert_eq!(
        only(&text),
        "line 27: layer \"join\": with \"conv1\": expected an image of 6 x 5 pixels, found one of 12 x 11"
    );
}

#[test]
fn an_image_without_pixels_is_refused() {
    let text = changed_frames("kind = \"conv_lstm\"\nhidden = 2", "kind = \"average_pool\"\nsize = 12");
    let found = only(&text);
    assert!(found.starts_with("line 20: layer \"cell\": expected an output of at most"), "{found}");
    assert!(found.ends_with("found 3 x 1 x 0"), "{found}");
}

#[test]
fn excitation_of_fewer_channels_than_its_reduction_is_refused() {
    let text = changed_frames("kind = \"conv_lstm\"\nhidden = 2", "kind = \"squeeze_excite\"");
    assert_eq!(
        only(&text),
        "line 20: layer \"cell\": reduction: expected at most the 3 channels of the image, found 16"
    );
}

#[test]
fn a_layer_that_no_prediction_depends_on_is_reported() {
    let text = changed_frames("with = \"conv1\"", "with = \"conv1\"\nfrom = \"conv1\"");
    assert_eq!(
        only(&text),
        "line 20: layer \"cell\": expected every layer to reach the prediction, found none that reads this one on the \
         way to it"
    );
}

#[test]
fn what_a_misread_layer_may_have_read_is_not_reported() {
    let text = changed_frames("with = \"conv1\"\n", "from = \"conv1\"\n");
    assert!(only(&text).starts_with("line 25: layer \"join\": missing key \"with\""));
}

#[test]
fn names_are_as_many_as_values_or_channels() {
    assert_eq!(
        only(&changed_frames("outputs = 2", "outputs = 3")),
        "line 40: names: expected 3 (outputs of layer \"fc\"), found 2"
    );
    let (image, _) = SMALL_FRAMES.split_once("[[layer]]\nname = \"join\"").expect("a layer");
    let image = format!("{image}[output]\nnames = [\"left\", \"right\"]\nunit = \"N\"\n");
    assert!(FrameDescription::parse(&image).is_ok());
    assert!(only(&image.replace("hidden = 2", "hidden = 5")).contains("expected 5 (outputs"));
}

#[test]
fn two_layers_of_one_tensor_are_reported() {
    let text = changed_frames("outputs = 2", "outputs = 2\nweights = \"conv1\"");
    assert_eq!(
        only(&text),
        "line 34: layer \"fc\": weights: expected tensors of its own, found \"conv1.weight\" also read by layer \
         \"conv1\""
    );
}

#[test]
fn networks_that_no_memory_holds_are_refused() {
    let large = |channels: usize| {
        SMALL_FRAMES
            .replace("channels = 1\nheight = 12\nwidth = 11", "channels = 1\nheight = 4096\nwidth = 4096")
            .replace(
                "frames = \"tactile-image\"\nsteps = 5\nscaling = \"image\"",
                "frames = \"signed\"\nspan_us = 1",
            )
            .replace("channels = 3", &format!("channels = {channels}"))
    };
    assert_eq!(
        only(&large(4096)),
        "line 12: layer \"conv1\": expected at most 268435456 values in the layers up to this one, found 68736253952"
    );
    assert!(only(&large(12)).contains("layer \"cell\": expected at most 268435456 values"));
    let text = changed_frames("channels = 3", "channels = 4096").replace("hidden = 2", "hidden = 4096");
    assert!(
        only(&text)
            .contains("layer \"cell\": expected at most 67108864 weights in a tensor, found 1207959552")
    );
    let wide = changed_frames("channels = 3", "channels = 4096")
        .replace("kind = \"conv_lstm\"\nhidden = 2", "kind = \"conv\"\nkernel = 1\nchannels = 4096");
    assert!(only(&wide).ends_with("found 8192 x 12 x 11"), "{}", only(&wide));
}

#[test]
fn more_layers_than_anyone_writes_are_refused() {
    let layer = |i| format!("[[layer]]\nname = \"c{i}\"\nkind = \"conv\"\nchannels = 1\nkernel = 1\n\n");
    let layers: String = (0..1025).map(layer).collect();
    let found = problems(&changed_frames(
        "[[layer]]\nname = \"conv1\"",
        &format!("{layers}[[layer]]\nname = \"conv1\""),
    ));
    assert!(found.iter().any(|p| p.to_string().contains("at most 1024 layers, found 1030")), "{found:#?}");
}

#[test]
fn a_file_without_layers_is_refused() {
    let (head, _) = SMALL_FRAMES.split_once("[[layer]]").expect("layers");
    let text = format!("layer = []\n{head}[output]\nnames = [\"a\"]\nunit = \"b\"\n");
    assert_eq!(only(&text), "line 1: expected at least one layer, found none");
}

#[test]
fn independent_problems_are_all_reported_by_line() {
    let text = changed_frames("height = 12", "height = 0")
        .replace("kernel = 3", "kernel = 4")
        .replace("hidden = 2", "hidden = 2\nstride = 2")
        .replace("with = \"conv1\"", "with = \"conv9\"")
        .replace("names = [\"left\", \"right\"]", "names = []");
    let lines: Vec<usize> = problems(&text).iter().map(|p| p.line).collect();
    assert_eq!(lines, [7, 17, 24, 29, 41]);
}
