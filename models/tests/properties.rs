//! Properties of any description and any bytes.

use super::support;

use std::collections::BTreeMap;

use meissner_models::{AnyDescription, Description, FrameDescription, Tensor, Weights, draw};
use proptest::prelude::*;
use support::network_text::NetworkText;
use support::torch::{View, file, state_dict};
use support::{SMALL, SMALL_FRAMES};

/// A description of levels with blocks; each block has its channels, its kernel, and whether it
/// skips.
fn description(levels: &[Vec<(usize, usize, bool, bool)>], hidden: Option<usize>) -> String {
    let graph =
        "kind = \"radius\"; r = 0.1; max = 9; candidates = \"past\"; lifetime = \"window\"; scale = 0.3";
    let mut text = NetworkText::over_events("any").graph(graph);
    for (l, blocks) in levels.iter().enumerate() {
        let mut features: Vec<(String, usize)> = Vec::new();
        if l > 0 {
            let keys = format!("cell = [\"{l}/9\", \"{l}/7\"]; scale = 0.3");
            text = text.layer(&format!("p{l}"), "pool", &keys);
        }
        for (b, &(channels, kernel, skip, root)) in blocks.iter().enumerate() {
            let mut keys = format!("channels = {channels}; kernel = {kernel}; root = {root}");
            if skip && let Some((other, _)) = features.iter().find(|(_, c)| *c == channels) {
                keys.extend(["; skip = \"", other, "\""]);
            }
            let name = format!("b{l}-{b}");
            text = text.layer(&name, "spline", &keys);
            features.push((name, channels));
        }
    }
    text = text.layer("g", "readout", "grid = [3, 2]");
    if let Some(hidden) = hidden {
        text = text.layer("h", "dense", &format!("outputs = {hidden}; activation = \"relu\""));
    }
    text.dense(&["y"], "N")
}

/// A description of a frame network whose layers follow each other.
fn chain(kinds: &[usize], channels: usize, height: usize, width: usize) -> String {
    let size = format!("kind = \"image\"; channels = 2; height = {height}; width = {width}");
    let mut text =
        NetworkText::over_frames("any", &format!("{size}; frames = \"event-counts\"; maximum = 3"));
    for (i, &kind) in kinds.iter().enumerate() {
        let (kind, keys) = match kind {
            0 => {
                let keys = "kernel = 3; activation = \"relu\"";
                ("conv", format!("channels = {channels}; norm = \"norm{i}\"; {keys}"))
            }
            1 => ("upconv", format!("channels = {channels}")),
            2 => ("max_pool", String::new()),
            3 => ("average_pool", "size = 2".to_owned()),
            4 => ("concat", "with = \"frame\"".to_owned()),
            5 => ("squeeze_excite", "reduction = 2".to_owned()),
            _ => ("conv_lstm", format!("hidden = {channels}; peepholes = true")),
        };
        text = text.layer(&format!("l{i}"), kind, &keys);
    }
    text.layer("flat", "flatten", "")
        .layer("past", "delay", "frames = 2")
        .layer("both", "concat", "with = \"flat\"")
        .layer("y", "lstm", "hidden = 1")
        .predicting(&["y"], "N")
}

/// A state dict with two tensors of one storage.
fn pth() -> Vec<u8> {
    let data: Vec<u8> = (0..12).flat_map(|i: u16| f32::from(i).to_le_bytes()).collect();
    let a =
        View { storage: "FloatStorage", key: "0", values: 12, offset: 0, shape: &[2, 3], strides: &[3, 1] };
    let b = View { offset: 6, ..a };
    file(&state_dict(&[("a", a), ("b", b)]), &[("0", &data)])
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 256, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn a_consistent_description_makes_a_network_of_any_weights_with_its_tensors(
        levels in prop::collection::vec(
            prop::collection::vec((1..20_usize, 1..4_usize, any::<bool>(), any::<bool>()), 0..4), 1..4),
        hidden in prop::option::of(1..40_usize),
        seed in any::<u64>(),
    ) {
        let text = description(&levels, hidden);
        let description = Description::parse(&text).map_err(|e| TestCaseError::fail(format!("{e}\n{text}")))?;
        let weights = draw(&description, seed);
        let network = description.network(&weights).map_err(|e| TestCaseError::fail(e.to_string()))?;
        prop_assert_eq!(network.levels(), levels.len());
        let values: usize = weights.iter().map(|(_, t)| t.values().map_or(0, <[f32]>::len)).sum();
        prop_assert_eq!(description.summary().values, values);
        prop_assert!(Weights::from_bytes(&weights.to_safetensors(&BTreeMap::new())).is_ok_and(|read| read == weights));
        prop_assert!(!description.to_svg().is_empty() && !description.to_dot().is_empty());
    }

    #[test]
    fn a_description_with_lines_lost_or_swapped_is_read_without_a_panic(
        lines in prop::collection::vec(any::<prop::sample::Index>(), 1..6), swap in any::<bool>(),
    ) {
        let mut text: Vec<&str> = SMALL.lines().collect();
        for index in lines {
            let at = index.index(text.len() - 1);
            if swap { text.swap(at, at + 1) } else { text.remove(at); }
        }
        let text = text.join("\n");
        match Description::parse(&text) {
            Ok(description) => prop_assert!(description.network(&draw(&description, 1)).is_ok()),
            Err(error) => {
                let lines: Vec<usize> = error.problems().iter().map(|p| p.line).collect();
                prop_assert!(!lines.is_empty() && lines.is_sorted());
                prop_assert!(lines.iter().all(|&line| (1..=text.lines().count().max(1) + 1).contains(&line)));
            }
        }
    }

    #[test]
    fn a_frame_networks_description_with_lines_lost_or_swapped_is_read_without_a_panic(
        lines in prop::collection::vec(any::<prop::sample::Index>(), 1..6), swap in any::<bool>(),
    ) {
        let mut text: Vec<&str> = SMALL_FRAMES.lines().collect();
        for index in lines {
            let at = index.index(text.len() - 1);
            if swap { text.swap(at, at + 1) } else { text.remove(at); }
        }
        let text = text.join("\n");
        match AnyDescription::parse(&text) {
            Ok(AnyDescription::Frames(description)) => {
                prop_assert!(description.network_parts(&draw(&description, 1)).is_ok());
            }
            Ok(AnyDescription::Events(description)) => prop_assert!(false, "{}", description.name()),
            Err(error) => {
                let lines: Vec<usize> = error.problems().iter().map(|p| p.line).collect();
                prop_assert!(!lines.is_empty() && lines.is_sorted());
                prop_assert!(lines.iter().all(|&line| (1..=text.lines().count().max(1) + 1).contains(&line)));
            }
        }
    }

    #[test]
    fn a_chain_of_layers_makes_parts_of_any_weights_with_its_tensors(
        kinds in prop::collection::vec(0..7_usize, 0..8),
        [channels, height, width] in prop::array::uniform3(1..40_usize),
        seed in any::<u64>(),
    ) {
        let text = chain(&kinds, channels, height, width);
        let Ok(description) = FrameDescription::parse(&text) else { return Ok(()) };
        let weights = draw(&description, seed);
        let parts = description.network_parts(&weights).map_err(|e| TestCaseError::fail(e.to_string()))?;
        prop_assert_eq!(parts.layers.len(), kinds.len() + 4);
        prop_assert!(description.unused_tensors(&weights).is_ok_and(|unused| unused.is_empty()));
        let values: usize = weights.iter().map(|(_, t)| t.values().map_or(0, <[f32]>::len)).sum();
        prop_assert_eq!(description.summary().values, values);
        let finite = |t: &Tensor| t.values().is_some_and(|values| values.iter().all(|v| v.is_finite()));
        prop_assert!(weights.iter().all(|(_, tensor)| finite(tensor)));
    }

    #[test]
    fn damaged_state_dicts_are_read_or_refused_without_a_panic(
        changes in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..8),
        cut in prop::option::of(any::<prop::sample::Index>()),
    ) {
        let mut bytes = pth();
        for (index, value) in changes {
            let at = index.index(bytes.len());
            bytes[at] = value;
        }
        if let Some(cut) = cut {
            bytes.truncate(cut.index(bytes.len()));
        }
        let _ = Weights::from_bytes(&bytes);
    }

    #[test]
    fn damaged_pickles_are_read_or_refused_without_a_panic(
        changes in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..8),
    ) {
        // Damaged before archiving: checksums are right, and the reader gets the damaged data.
        let view = View { storage: "FloatStorage", key: "0", values: 2, offset: 0, shape: &[2], strides: &[1] };
        let mut pickle = state_dict(&[("a", view)]);
        for (index, value) in changes {
            let at = index.index(pickle.0.len());
            pickle.0[at] = value;
        }
        let _ = Weights::from_bytes(&file(&pickle, &[("0", &[0; 8])]));
    }

    #[test]
    fn any_bytes_are_read_or_refused_without_a_panic(bytes in prop::collection::vec(any::<u8>(), 0..200)) {
        let _ = Weights::from_bytes(&bytes);
        let _ = Weights::from_bytes(&[b"PK\x03\x04", &bytes[..]].concat());
    }
}
