//! Loads networks by name or from files, with their weights and with options that change them.

use std::fs;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use meissner_engine::frames::{Convolution, FrameLayerCounters, FrameNetwork, FrameShape};
use meissner_engine::representations::Sampling;
use meissner_engine::{EngineError, Network};
use meissner_io::{Format, Kind};
use meissner_models::{
    AnyDescription, Description, FrameDescription, FrameKind, FrameLayer, FrameSource, ModelError, NameMap,
    Weights,
};

use crate::approximations::Approximations;
use crate::error::{Result, RunError};
use crate::provenance::ModelCard;
use crate::text::most_similar;

/// The name of a network over events, and options that change it.
#[derive(Clone, Debug, Default)]
pub struct ModelOptions {
    /// Name of a shipped network, or path of a description file.
    pub network: String,
    /// File with weights; `None` selects the weights shipped with the network.
    pub weights: Option<PathBuf>,
    /// Mapping of the names in that file to those of the network ([`WeightsFile::map`]).
    pub map: Vec<String>,
    /// Whether weights that were trained on another preparation of the input are accepted.
    pub ignore_preparation: bool,
    /// Length of the window in microseconds, instead of the description's.
    pub span_us: Option<i64>,
    /// Largest number of events in the window, instead of the description's.
    pub capacity: Option<usize>,
    /// Approximations. The number of neighbours is applied to the network itself.
    pub approximations: Approximations,
}

/// A file of weights.
#[derive(Clone, Copy, Debug)]
pub struct WeightsFile<'a> {
    /// safetensors, or a state dict of `PyTorch`.
    pub path: &'a Path,
    /// Mapping of its names to those of the network: lines `OLD=NEW`, and files of such lines
    /// ([`NameMap`]). A text is taken as a file if a file of this name exists, or if it has no `=`.
    pub map: &'a [String],
}

impl<'a> From<&'a Path> for WeightsFile<'a> {
    fn from(path: &'a Path) -> Self {
        Self { path, map: &[] }
    }
}

impl WeightsFile<'_> {
    fn load(self) -> Result<Weights, ModelError> {
        let mut map = NameMap::default();
        for text in self.map {
            let is_line = text.contains('=') && !Path::new(text).is_file();
            map = map.and(if is_line { NameMap::entry(text)? } else { NameMap::load(text)? })?;
        }
        Weights::load(self.path)?.renamed(&map)
    }
}

impl ModelOptions {
    /// `network` with this span, capacity and number of neighbours.
    fn adapt(&self, mut network: Network) -> Result<Network, EngineError> {
        if let Some(span_us) = self.span_us {
            network = network.with_span_us(span_us)?;
        }
        if let Some(capacity) = self.capacity {
            network = network.with_capacity(capacity)?;
        }
        self.approximations.adapt(network)
    }
}

/// A network over events with its weights.
#[expect(missing_docs, reason = "the names say it")]
pub struct Model {
    pub network: Network,
    /// The card of network and weights, for reports.
    pub card: ModelCard,
    /// Maximum number of multiply-adds of a row, for each of [`Network::layers`]; 0 for a pooling.
    pub multiply_adds: Vec<u64>,
}

/// The description of a network over events, shipped or from a file, and whether it is shipped.
///
/// # Errors
/// The network is unknown, it is a frame network, or its description cannot be read.
pub fn describe(network: &str) -> Result<(Description, bool)> {
    match describe_any(network)? {
        (AnyDescription::Events(description), shipped) => Ok((description, shipped)),
        (AnyDescription::Frames(_), _) => Err(RunError::is_frame_network(network)),
    }
}

/// The description of a frame network, shipped or from a file, and whether it is shipped.
///
/// # Errors
/// The network is unknown, it is a network over events, or its description cannot be read.
pub fn describe_frames(network: &str) -> Result<(FrameDescription, bool)> {
    match describe_any(network)? {
        (AnyDescription::Frames(description), shipped) => Ok((description, shipped)),
        (AnyDescription::Events(_), _) => {
            Err(RunError::other_network(network, "a frame network", "a network over events"))
        }
    }
}

/// The network of `description` with `weights`, and the card of both. `label` names the weights.
/// Weights of another preparation are refused unless the difference is to be ignored.
///
/// # Errors
/// The weights do not fit.
pub fn frame_network(
    description: &FrameDescription,
    (weights, label): (&Weights, String),
    convolution: Convolution,
    ignore_preparation: bool,
) -> Result<(Arc<FrameNetwork>, ModelCard)> {
    let parts = if ignore_preparation {
        description.network_parts_regardless(weights)
    } else {
        description.network_parts(weights)
    };
    let parts = parts.map_err(|source| RunError::weights(label.clone(), source))?;
    let network = FrameNetwork::new(parts, convolution)?;
    let card = ModelCard::new(&AnyDescription::Frames(description.clone()), weights, label)?;
    let card = card.running(network.fingerprint(), None);
    Ok((Arc::new(network), card))
}

/// The description of a network of either kind, shipped or from a file, and whether it is shipped.
///
/// # Errors
/// The network is unknown, or its description cannot be read.
pub fn describe_any(network: &str) -> Result<(AnyDescription, bool)> {
    if let Some(description) = AnyDescription::shipped(network) {
        return Ok((description, true));
    }
    if !Path::new(network).exists() {
        return Err(RunError::UnknownNetwork { name: network.to_owned(), nearest: nearest(network) });
    }
    let network = network.to_owned();
    match AnyDescription::load(&network) {
        Ok(description) => Ok((description, false)),
        Err(source) => Err(match recording_format(&network) {
            Some(format) => RunError::IsRecording { network, format },
            None => RunError::description(network, source),
        }),
    }
}

/// The text of the description of a network over events: the shipped one, or the file `network`.
///
/// # Errors
/// The file cannot be read.
pub fn description_text(network: &str, shipped: bool) -> Result<String> {
    let unread =
        |source| RunError::description(network.to_owned(), ModelError::Read { path: network.into(), source });
    match Description::shipped_text(network).filter(|_| shipped) {
        Some(text) => Ok(text.to_owned()),
        None => fs::read_to_string(network).map_err(unread),
    }
}

/// The weights in `file`, or the shipped weights of `network`, and their source.
///
/// # Errors
/// There are no weights, or they cannot be read.
pub fn weights(network: &str, shipped: bool, file: Option<WeightsFile<'_>>) -> Result<(Weights, String)> {
    let Some(file) = file else {
        return match Weights::shipped(network).filter(|_| shipped) {
            Some(weights) => Ok((weights, "shipped with the network".to_owned())),
            None => Err(match Weights::left_out(network).filter(|_| shipped) {
                Some(error) => RunError::weights(network.to_owned(), error),
                None => RunError::NoWeights(network.to_owned()),
            }),
        };
    };
    let label = file.path.display().to_string();
    match file.load() {
        Ok(weights) => Ok((weights, label)),
        Err(source) => Err(RunError::weights(label, source)),
    }
}

/// The source of `weights`, with their own description.
pub fn labelled(label: String, weights: &Weights) -> String {
    let about = weights.metadata().get("about").map(|about| format!(" ({about})"));
    label + &about.unwrap_or_default()
}

/// The format of a recording by its content. CSV and N-MNIST have no signature.
fn recording_format(path: &str) -> Option<Format> {
    match Kind::of_file(Path::new(path)) {
        Ok(Some(Kind::Events(format))) if !matches!(format, Format::Csv | Format::Nmnist) => Some(format),
        _ => None,
    }
}

impl Model {
    /// The network that `options` select.
    ///
    /// # Errors
    /// The network is unknown, its weights do not fit, or it cannot be adapted.
    pub fn load(options: &ModelOptions) -> Result<Self> {
        let file = options.weights.as_deref().map(|path| WeightsFile { path, map: &options.map });
        let model = Self::named(&options.network, file, options.ignore_preparation)?;
        let network = options.adapt(model.network)?;
        let mut card = model.card.running(network.fingerprint(), Some(window(&network)));
        if options.approximations.stride.is_some() {
            card.network.stride = 1;
        }
        Ok(Self { network, card, ..model })
    }

    /// The network called `name`, unchanged, with the weights in `file` or its shipped
    /// weights. Weights of another preparation are refused unless the difference is to be ignored.
    ///
    /// # Errors
    /// The network is unknown, or the weights do not fit.
    pub fn named(name: &str, file: Option<WeightsFile<'_>>, ignore_preparation: bool) -> Result<Self> {
        let (description, shipped) = describe(name)?;
        let (weights, label) = weights(name, shipped, file)?;
        Self::of(&description, (&weights, label), ignore_preparation)
    }

    /// The network of `description` with `weights`. `label` names the weights.
    ///
    /// # Errors
    /// The weights do not fit.
    pub fn of(
        description: &Description,
        (weights, label): (&Weights, String),
        ignore_preparation: bool,
    ) -> Result<Self> {
        let network = if ignore_preparation {
            description.network_ignoring_preparation(weights)
        } else {
            description.network(weights)
        };
        let network = network.map_err(|source| RunError::weights(label.clone(), source))?;
        // Readout and dense layers compute no rows.
        let rows = description.layers().iter().filter(|layer| layer.level.is_some());
        let of_row = |name: &str| {
            let layer = rows.clone().find(|layer| layer.name == name);
            layer.map_or(0, |layer| layer.cost.multiply_adds as u64)
        };
        let multiply_adds = network.layers().into_iter().map(of_row).collect();
        let card = ModelCard::new(&AnyDescription::Events(description.clone()), weights, label)?;
        let card = card.running(network.fingerprint(), Some(window(&network)));
        Ok(Self { network, card, multiply_adds })
    }
}

/// A frame network with its weights.
#[expect(missing_docs, reason = "the names say it")]
pub struct FrameModel {
    /// The requested name or file.
    pub name: String,
    pub description: FrameDescription,
    /// How frames are made: as in the description, or with another sampling if one was requested.
    pub source: FrameSource,
    pub network: Arc<FrameNetwork>,
    /// The card of network and weights, for reports.
    pub card: ModelCard,
}

impl FrameModel {
    /// The frame network `name` with the weights in `file` or shipped, as [`Model::named`].
    ///
    /// # Errors
    /// The network is unknown, or the weights do not fit.
    pub fn named(
        name: &str,
        file: Option<WeightsFile<'_>>,
        convolution: Convolution,
        ignore_preparation: bool,
    ) -> Result<Self> {
        let (description, shipped) = describe_frames(name)?;
        let (weights, label) = weights(name, shipped, file)?;
        let model = Self::of(&description, (&weights, label), convolution, ignore_preparation)?;
        Ok(Self { name: name.to_owned(), ..model })
    }

    /// The network of `description` with `weights`. `label` names the weights.
    ///
    /// # Errors
    /// The weights do not fit.
    pub fn of(
        description: &FrameDescription,
        weights: (&Weights, String),
        convolution: Convolution,
        ignore_preparation: bool,
    ) -> Result<Self> {
        let (network, card) = frame_network(description, weights, convolution, ignore_preparation)?;
        let (name, source) = (description.name().to_owned(), *description.source());
        Ok(Self { name, description: description.clone(), source, network, card })
    }

    /// Replaces the sampling of readings, if the frames are made of readings.
    #[must_use]
    pub fn with_sampling(mut self, sampling: Sampling) -> Self {
        if let FrameSource::TactileImage(readings) | FrameSource::Electrodes(readings) = &mut self.source {
            readings.sampling = sampling;
        }
        self
    }
}

/// Multiply-adds of the pixels of a layer. A layer over vectors has one pixel.
#[derive(Clone, Debug)]
pub struct LayerCost {
    /// Name of the layer.
    pub name: String,
    /// Pixels of its output.
    pub pixels: u64,
    /// Multiply-adds of all its pixels.
    multiply_adds: u64,
    /// Multiply-adds of one absorbed pixel: a convolutional LSTM reads its hidden state in any
    /// case.
    absorbed: u64,
}

impl LayerCost {
    /// The cost of `layer`.
    pub fn new(layer: &FrameLayer) -> Self {
        let pixels = match layer.output {
            FrameShape::Image { height, width, .. } => (height * width) as u64,
            FrameShape::Vector(_) => 1,
        };
        let absorbed = match layer.kind {
            // Four gates of 3 x 3.
            FrameKind::ConvLstm { hidden, .. } => (36 * hidden * hidden) as u64,
            _ => 0,
        };
        let (name, multiply_adds) = (layer.name.clone(), layer.multiply_adds as u64);
        Self { name, pixels, multiply_adds, absorbed }
    }

    /// Multiply-adds of the pixels that `counters` counted.
    pub fn of(&self, counters: &FrameLayerCounters) -> u64 {
        // In u128: pixels times products can exceed a u64.
        let computed =
            u128::from(counters.computed) * u128::from(self.multiply_adds) / u128::from(self.pixels);
        u64::try_from(computed).unwrap_or(u64::MAX).saturating_add(counters.absorbed * self.absorbed)
    }
}

fn window(network: &Network) -> (i64, usize) {
    (network.parts().span_us, network.parts().capacity)
}

/// The shipped network with the name most similar to `name`, if one is similar enough.
pub(crate) fn nearest(name: &str) -> Option<&'static str> {
    most_similar(name, AnyDescription::shipped_names())
}
