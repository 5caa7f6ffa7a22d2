//! Which network runs: a description by name or from a file, its weights, and what the command line changes about it.

use std::fs::File;
use std::io::Read;
use std::path::Path;
use std::sync::Arc;

use meissner_engine::Network;
use meissner_engine::frames::{Convolution, FrameNetwork};
use meissner_io::Format;
use meissner_models::{AnyDescription, Description, FrameDescription, ModelError, Weights};

use crate::args::Input;
use crate::error::CliError;
use crate::provenance::ModelCard;

/// The network that runs where none is named: small enough for a laptop, with the shape of the published one.
pub(crate) const DEFAULT_NETWORK: &str = "graphres";

/// A network that can run, and what to say about it.
pub(crate) struct Model {
    /// The network.
    pub(crate) network: Network,
    /// What it is, with which weights.
    pub(crate) card: ModelCard,
    /// Most multiply-adds of a row, for each of [`Network::layers`]; 0 for a pooling, which only compares.
    pub(crate) multiply_adds: Vec<u64>,
}

/// The description of a network over events, shipped or in a file; whether it is shipped.
pub(crate) fn describe(network: &str) -> Result<(Description, bool), CliError> {
    match describe_any(network)? {
        (AnyDescription::Events(description), shipped) => Ok((description, shipped)),
        (AnyDescription::Frames(_), _) => Err(CliError::IsFrameNetwork(network.to_owned())),
    }
}

/// The description of a frame network, shipped or in a file; whether it is shipped.
pub(crate) fn describe_frames(network: &str) -> Result<(FrameDescription, bool), CliError> {
    match describe_any(network)? {
        (AnyDescription::Frames(description), shipped) => Ok((description, shipped)),
        (AnyDescription::Events(_), _) => Err(CliError::IsEventNetwork(network.to_owned())),
    }
}

/// The network of `description` with `weights`, which `label` names, and what they are. Weights of another preparation are
/// refused, unless that is to be ignored.
pub(crate) fn frame_network(
    description: &FrameDescription,
    (weights, label): (&Weights, String),
    convolution: Convolution,
    ignore_preparation: bool,
) -> Result<(Arc<FrameNetwork>, ModelCard), CliError> {
    let parts = if ignore_preparation {
        description.network_parts_regardless(weights)
    } else {
        description.network_parts(weights)
    };
    let parts = parts.map_err(|source| refused(&label, source))?;
    let network = FrameNetwork::new(parts, convolution)?;
    let card = card(&AnyDescription::Frames(description.clone()), weights, label)?;
    let card = card.running(network.fingerprint(), None);
    Ok((Arc::new(network), card))
}

/// What a network of `description` is with `weights` from `label`.
pub(crate) fn card(
    description: &AnyDescription,
    weights: &Weights,
    label: String,
) -> Result<ModelCard, CliError> {
    let card = weights.card().map_err(|source| refused(&label, source))?;
    Ok(ModelCard::new(description, weights, &card, label))
}

/// Weights that do not fit.
fn refused(weights: &str, source: ModelError) -> CliError {
    CliError::Weights { weights: weights.to_owned(), source }
}

/// The description of a network of either kind, shipped or in a file; whether it is shipped.
pub(crate) fn describe_any(network: &str) -> Result<(AnyDescription, bool), CliError> {
    if let Some(description) = AnyDescription::shipped(network) {
        return Ok((description, true));
    }
    if !Path::new(network).exists() {
        return Err(CliError::UnknownNetwork(network.to_owned()));
    }
    let network = network.to_owned();
    match AnyDescription::load(&network) {
        Ok(description) => Ok((description, false)),
        Err(source) => Err(match recording_format(&network) {
            Some(format) => CliError::IsRecording { network, format },
            None => CliError::description(network, source),
        }),
    }
}

/// The weights in the file at `path`, or those shipped for `network`; where they come from.
pub(crate) fn weights(
    network: &str,
    shipped: bool,
    path: Option<&Path>,
) -> Result<(Weights, String), CliError> {
    let Some(path) = path else {
        return match Weights::shipped(network).filter(|_| shipped) {
            Some(weights) => Ok((weights, "shipped with the network".to_owned())),
            None => Err(CliError::NoWeights(network.to_owned())),
        };
    };
    let label = path.display().to_string();
    match Weights::load(path) {
        Ok(weights) => Ok((weights, label)),
        Err(source) => Err(CliError::weights(label, source)),
    }
}

/// Where `weights` come from, with what they say about themselves.
pub(crate) fn labelled(label: String, weights: &Weights) -> String {
    let about = weights.metadata().get("about").map(|about| format!(" ({about})"));
    label + &about.unwrap_or_default()
}

/// The format of the file at `path` where it is plainly a recording: CSV and N-MNIST have no marks of their own.
fn recording_format(path: &str) -> Option<Format> {
    // The marks stand at the start; what is no description may have no end either.
    let mut start = Vec::new();
    File::open(path).ok()?.take(1 << 16).read_to_end(&mut start).ok()?;
    let format = meissner_io::detect(&start)?;
    (!matches!(format, Format::Csv | Format::Nmnist)).then_some(format)
}

impl Model {
    /// The network that `args` ask for.
    pub(crate) fn load(args: &Input) -> Result<Self, CliError> {
        let model = Self::named(&args.network, args.weights.as_deref(), args.ignore_preparation)?;
        let network = adapted(model.network, args)?;
        let card = model.card.running(network.fingerprint(), Some(window(&network)));
        let card = if args.approximations.stride.is_some() { card.taking_every(1) } else { card };
        Ok(Self { network, card, ..model })
    }

    /// The network called `name` as it is described, with the weights in the file at `path` or those shipped for it.
    /// Weights of another preparation are refused, unless that is to be ignored.
    pub(crate) fn named(name: &str, path: Option<&Path>, ignore_preparation: bool) -> Result<Self, CliError> {
        let (description, shipped) = describe(name)?;
        let (weights, label) = weights(name, shipped, path)?;
        Self::of(&description, (&weights, label), ignore_preparation)
    }

    /// The network of `description` with `weights`, which `label` names.
    pub(crate) fn of(
        description: &Description,
        (weights, label): (&Weights, String),
        ignore_preparation: bool,
    ) -> Result<Self, CliError> {
        let network = if ignore_preparation {
            description.network_regardless(weights)
        } else {
            description.network(weights)
        };
        let network = network.map_err(|source| refused(&label, source))?;
        // The layers of levels compute rows; readout and dense layers are evaluated once a prediction.
        let rows = description.layers().iter().filter(|layer| layer.level.is_some());
        let of_row = |name: &str| {
            let layer = rows.clone().find(|layer| layer.name == name);
            layer.map_or(0, |layer| layer.cost.multiply_adds as u64)
        };
        let multiply_adds = network.layers().into_iter().map(of_row).collect();
        let card = card(&AnyDescription::Events(description.clone()), weights, label)?;
        let card = card.running(network.fingerprint(), Some(window(&network)));
        Ok(Self { network, card, multiply_adds })
    }
}

/// Length and capacity of the window.
fn window(network: &Network) -> (i64, usize) {
    (network.parts().span_us, network.parts().capacity)
}

/// `network` with the span, the capacity and the approximations that `args` ask for.
fn adapted(mut network: Network, args: &Input) -> Result<Network, CliError> {
    if let Some(span_us) = args.span_us {
        network = network.with_span_us(span_us)?;
    }
    if let Some(capacity) = args.capacity {
        network = network.with_capacity(capacity as usize)?;
    }
    args.approximations.adapt(network)
}
