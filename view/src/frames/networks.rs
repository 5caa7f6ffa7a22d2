//! Networks over frames by name, and the facts about one for a page.

use std::sync::Arc;

use meissner_engine::frames::{Convolution, FrameNetwork, FrameShape};
use meissner_engine::representations::{ELECTRODE_COLUMNS, ELECTRODE_ROWS};
use meissner_models::{AnyDescription, FrameDescription, FrameSource, Weights};

use super::FrameSensor;
use crate::error::ViewError;
use crate::facts::{Facts, FrameFacts, LayerFacts};
use crate::networks::{Chosen, Networks};

/// A network over frames, and the source of its frames.
#[derive(Clone, Debug)]
pub struct Framed {
    /// The network.
    pub network: Arc<FrameNetwork>,
    /// The source of its frames.
    pub source: FrameSource,
    /// The word of each layer in a file: "conv", "lstm".
    words: Vec<&'static str>,
    /// Channels of each layer.
    channels: Vec<usize>,
}

impl Framed {
    /// The kind of the values of a prediction.
    pub(super) fn predicts(&self) -> &'static str {
        if let FrameSource::Picture(_) = self.source { "force of each pixel" } else { "prediction" }
    }
}

impl Chosen<Framed> {
    /// `network` with the frames and the outputs of its `description`. For forces on pixels, the
    /// page shows the area of the contact and the sum of its forces.
    pub fn framed(network: Arc<FrameNetwork>, description: &FrameDescription, source: FrameSource) -> Self {
        let of = |name: &str| description.layers().iter().find(|layer| layer.name == name);
        let channels = |shape| match shape {
            FrameShape::Image { channels, .. } => channels,
            FrameShape::Vector(values) => values,
        };
        let words = network.layers().map(|name| of(name).map_or("", |layer| layer.kind.word())).collect();
        let channels = network.layers().map(|name| of(name).map_or(0, |layer| channels(layer.output)));
        let channels = channels.collect();
        let texts = |texts: [&str; 2]| texts.map(str::to_owned).to_vec();
        let (outputs, units) = match source {
            FrameSource::Picture(_) => (texts(["area", "force"]), texts(["mm²", "N"])),
            _ => (description.outputs().0.to_vec(), description.outputs().1.to_vec()),
        };
        let classes = description.classes().is_some();
        Self { network: Arc::new(Framed { network, source, words, channels }), outputs, units, classes }
    }
}

/// The networks over frames of the same kind that come with the program.
#[derive(Clone, Copy, Debug)]
pub struct ShippedFrames {
    /// The source of the frames.
    pub source: FrameSource,
    /// Shape of a frame: the same pictures fit only networks of one size.
    pub shape: FrameShape,
}

impl ShippedFrames {
    fn of(self, name: &str) -> Option<FrameDescription> {
        let Some(AnyDescription::Frames(found)) = AnyDescription::shipped(name) else { return None };
        let electrodes =
            |source: &_| matches!(source, FrameSource::Electrodes(_) | FrameSource::TactileImage(_));
        let fits = match (self.source, *found.source()) {
            (FrameSource::Picture(_), FrameSource::Picture(_)) => found.input() == self.shape,
            (own, other) if electrodes(&own) => electrodes(&other),
            // Frames of events are made before a session takes them.
            (own, other) => own == other && found.input() == self.shape,
        };
        fits.then_some(found)
    }
}

impl Networks<Framed> for ShippedFrames {
    fn names(&self) -> Vec<String> {
        let names = AnyDescription::shipped_names();
        let runs = |name: &&str| self.of(name).is_some() && Weights::left_out(name).is_none();
        names.filter(runs).map(str::to_owned).collect()
    }

    fn load(&self, name: &str) -> Result<Chosen<Framed>, ViewError> {
        let unknown = || ViewError::Network { name: name.to_owned(), known: self.names().join(", ") };
        let description = self.of(name).ok_or_else(unknown)?;
        let weights = Weights::shipped(name).ok_or_else(unknown)?;
        let parts = description.network_parts(&weights);
        let parts = parts.map_err(|source| ViewError::Weights { name: name.to_owned(), source })?;
        let network = Arc::new(FrameNetwork::new(parts, Convolution::Direct)?);
        Ok(Chosen::framed(network, &description, *description.source()))
    }
}

/// The facts about a network over frames for a page.
pub(super) fn facts(input: &str, sensor: &FrameSensor, name: &str, chosen: &Chosen<Framed>) -> Facts {
    let framed = &chosen.network;
    let layers = framed.network.layers().zip(&framed.words).zip(&framed.channels);
    let layer = |((name, &word), &channels): ((&str, &&'static str), &usize)| LayerFacts {
        name: name.to_owned(),
        level: 0,
        pooling: false,
        channels,
        word,
    };
    let kind = match framed.source {
        FrameSource::Picture(_) => "pictures",
        FrameSource::TactileImage(_) | FrameSource::Electrodes(_) => "electrodes",
        _ => "frames",
    };
    let places = ELECTRODE_COLUMNS.iter().zip(ELECTRODE_ROWS).map(|(&column, row)| [column, row]);
    let frames = FrameFacts {
        steps: framed.source.steps(),
        remembers: framed.network.has_state(),
        electrodes: if kind == "electrodes" { places.collect() } else { Vec::new() },
    };
    Facts {
        kind,
        frames: Some(frames),
        layers: layers.map(layer).collect(),
        ..Facts::empty(input, sensor.size, name, chosen)
    }
}
