//! What all frame networks have in common: options, and a network of the test's own.

use std::path::{Path, PathBuf};

use meissner_engine::frames::{Convolution, FrameEngine, FrameNetwork};
use meissner_models::{FrameDescription, Weights, draw};
use tempfile::TempDir;

use crate::exit_status::fails;
use crate::support::{argument, file, meissner, text};

/// A description in a file with drawn weights beside it.
pub(crate) struct OwnNetwork {
    folder: TempDir,
    description: FrameDescription,
    weights: Weights,
}

impl OwnNetwork {
    pub(crate) fn new(description: &str) -> Self {
        let (folder, path) = file("own.toml", description);
        let description = FrameDescription::load(path).expect("consistent");
        let weights = draw(&description, 7);
        let bytes = weights.to_safetensors(&std::collections::BTreeMap::new());
        std::fs::write(folder.path().join("own.safetensors"), bytes).expect("it can be written");
        Self { folder, description, weights }
    }

    pub(crate) fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    /// The arguments that run it on `input`, before `more`.
    pub(crate) fn arguments(&self, input: &Path, more: &[&str]) -> Vec<String> {
        let (network, weights) = (self.path("own.toml"), self.path("own.safetensors"));
        let own = ["run", argument(input), "--network", argument(&network), "--weights", argument(&weights)];
        own.iter().chain(more).map(|&argument| argument.to_owned()).collect()
    }

    /// An engine of it.
    pub(crate) fn engine(&self) -> FrameEngine {
        engine(&self.description, &self.weights)
    }
}

/// An engine of the network of `description`, with all defaults.
pub(crate) fn engine(description: &FrameDescription, weights: &Weights) -> FrameEngine {
    let parts = description.network_parts(weights).expect("the weights fit");
    let network = FrameNetwork::new(parts, Convolution::Direct).expect("the parts fit");
    FrameEngine::new(network).expect("options in range")
}

/// An engine of a shipped network.
pub(crate) fn shipped_engine(name: &str) -> FrameEngine {
    let description = FrameDescription::shipped(name).expect("it is shipped");
    engine(&description, &Weights::shipped(name).expect("with weights"))
}

/// Bits of an engine's prediction.
pub(crate) fn predicted(engine: &mut FrameEngine) -> Vec<u32> {
    engine.predict().expect("a prediction").values.iter().map(|v| v.to_bits()).collect()
}

#[test]
fn an_option_that_does_not_fit_the_network_is_refused_by_name() {
    let event_graph = ["--no-skip", "--convolution=direct", "--overlay=o", "--hold=3"];
    let event_frames = [
        "--mode=batch",
        "--span=5us",
        "--capacity=5",
        "--overlay=o",
        "--reference=r.png",
        "--sampling=2",
        "--neighbours=3",
        "--activity-filter=5us",
        "--stale-time=5us",
    ];
    let electrodes = [
        "--mode=batch",
        "--span=5us",
        "--every=end",
        "--late=clamp",
        "--sensor=3x3",
        "--longest-silence=4",
        "--rate-limit=9",
    ];
    let pictures = [
        "--mode=batch",
        "--capacity=5",
        "--every=event",
        "--sensor=3x3",
        "--least-probability=1",
        "--refractory=5us",
        "--stride=2",
    ];
    for (network, options) in [
        ("graphres", &event_graph[..]),
        ("force-lstm", &event_frames),
        ("slip-lstm", &electrodes),
        ("canf-plain", &pictures),
    ] {
        for option in options {
            let name = option.split('=').next().expect("an option has a name");
            let output = meissner(&["run", "no/such/input", "--network", network, option]);
            fails(&output, 2, &[name, network, " is for a network over "]);
        }
    }
}

#[test]
fn options_of_frame_networks_that_make_no_sense_are_bad_usage() {
    for options in [
        &["--tolerance", "-1"][..],
        &["--tolerance", "NaN"],
        &["--tolerance", "0", "--no-skip"],
        &["--convolution", "winograd3"],
        &["--threads", "3"],
        &["--longest-silence", "-1"],
        &["--full-scale", "1"],
    ] {
        let arguments = [&["run", "x", "--network", "canf"], options].concat();
        fails(&meissner(&arguments), 2, &["error: "]);
    }
}

#[test]
fn a_network_without_its_input_says_what_it_needs() {
    fails(&meissner(&["run", "--network", "slip-lstm"]), 2, &["slip-lstm", "24 electrodes", "no INPUT"]);
    fails(&meissner(&["run", "--network", "canf"]), 2, &["canf", "a picture", "no INPUT"]);
    fails(&meissner(&["run", "-", "--network", "canf"]), 2, &["canf", "standard input"]);
}

#[test]
fn the_help_has_an_example_for_each_kind_of_network() {
    let help = text(&meissner(&["run", "--help"]));
    for network in ["event-frame-cnn", "force-lstm", "slip-regularised", "slip-lstm --hold", "canf --overlay"]
    {
        assert!(help.contains(&format!("--network {network}")), "{network}: {help}");
    }
}
