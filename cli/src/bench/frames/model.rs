//! A frame network over events: what runs, what its layers cost, and which part of the sensor it sees.

use std::path::Path;
use std::sync::Arc;

use meissner_engine::frames::{Convolution, FrameLayerCounters, FrameNetwork, FrameShape};
use meissner_engine::representations::Crop;
use meissner_engine::{LatePolicy, Sensor};
use meissner_models::description::frames::{CropPlace, SignedTiming};
use meissner_models::{FrameDescription, FrameSource};

use super::super::moments::End;
use crate::args::Every;
use crate::error::CliError;
use meissner_pipeline::PipelineError;
use meissner_pipeline::frame_feed::FrameFeed;
use meissner_pipeline::layer_cost::LayerCost;
use meissner_pipeline::model::{describe_frames, frame_network, weights};
use meissner_pipeline::provenance::ModelCard;
use meissner_pipeline::time;

/// From one frame to the next, where neither the network nor the command line says: 10 ms, as in the force networks.
const PERIOD_US: i64 = 10_000;

/// A frame network that can run over events.
pub(in super::super) struct FrameModel {
    pub(in super::super) network: Arc<FrameNetwork>,
    /// Of each layer.
    pub(in super::super) costs: Vec<LayerCost>,
    /// What it is, with which weights.
    pub(in super::super) card: ModelCard,
    description: FrameDescription,
    place: CropPlace,
    /// Length of its windows, where they follow one another.
    windows_us: Option<i64>,
    size: [u16; 2],
}

/// The part of the sensor that frames show.
#[derive(Clone, Copy, Debug)]
pub(in super::super) struct Field {
    pub(in super::super) crop: Crop,
    pub(in super::super) sensor: Sensor,
}

impl FrameModel {
    /// The frame network `name`, shipped or in a file, with the weights in the file at `path` or those shipped.
    pub(in super::super) fn load(
        name: &str,
        path: Option<&Path>,
        ignore_preparation: bool,
    ) -> Result<Self, CliError> {
        let (description, shipped) = describe_frames(name)?;
        let (place, windows_us) = match *description.source() {
            FrameSource::EventCounts { place, period_us, .. }
            | FrameSource::Signed { place, timing: SignedTiming::Consecutive { period_us }, .. } => {
                (place, Some(period_us))
            }
            FrameSource::Signed { place, timing: SignedTiming::Sliding { .. }, .. } => (place, None),
            source => return Err(frames_of_other(name, source)),
        };
        let FrameShape::Image { height, width, .. } = description.input() else {
            return Err(frames_of_other(name, *description.source()));
        };
        let (weights, label) = weights(name, shipped, path)?;
        let (network, card) =
            frame_network(&description, (&weights, label), Convolution::Direct, ignore_preparation)?;
        Ok(Self {
            network,
            costs: description.layers().iter().map(LayerCost::new).collect(),
            card,
            place,
            windows_us,
            // A description's sides fit.
            size: [width as u16, height as u16],
            description,
        })
    }

    /// What makes its frames, with the keys of a description.
    pub(in super::super) fn source(&self) -> &FrameSource {
        self.description.source()
    }

    /// Microseconds from one frame to the next, where `asked` says or does not.
    pub(in super::super) fn period_us(&self, asked: Option<Every>) -> Result<i64, CliError> {
        let period_us = match (asked, self.windows_us) {
            (None, windows_us) => windows_us.unwrap_or(PERIOD_US),
            (Some(Every::StreamUs(asked_us)), None) => asked_us,
            (Some(Every::StreamUs(asked_us)), Some(windows_us)) if asked_us == windows_us => asked_us,
            (Some(every), windows_us) => {
                let expected = windows_us.map_or_else(
                    || "the time from frame to frame, such as 10ms".to_owned(),
                    |us| {
                        format!("{}, the length of the windows of {}", time::display(us), self.network.name())
                    },
                );
                let found = every.to_string();
                return Err(CliError::Option { option: "--every", expected, found });
            }
        };
        Ok(period_us)
    }

    /// Which events belong to a frame at a moment.
    pub(in super::super) fn end(&self) -> End {
        if self.windows_us.is_some() { End::Excluded } else { End::Included }
    }

    /// What its frames show of `sensor`.
    pub(in super::super) fn field(&self, sensor: Sensor) -> Field {
        let [width, height] = self.size;
        let crop = self.place.crop(width, height, sensor);
        let side = |side: u16, first: u16, count: u16| side.max(first.saturating_add(count));
        let around =
            Sensor::new(side(sensor.width, crop.x, crop.width), side(sensor.height, crop.y, crop.height));
        Field { crop: self.place.crop(width, height, around), sensor }
    }

    /// The feed of its frames over `field`, of events that were accepted before, every `period_us`.
    pub(in super::super) fn feed(&self, field: Field, period_us: i64) -> Result<FrameFeed, CliError> {
        let every = Every::StreamUs(period_us);
        let feed = FrameFeed::new(&self.description, field.around(), LatePolicy::Drop, every)
            .map_err(|source| PipelineError::Frames { network: self.network.name().to_owned(), source })?;
        feed.ok_or_else(|| frames_of_other(self.network.name(), *self.source()))
    }

    /// Multiply-adds of what `counters` counted.
    pub(in super::super) fn multiply_adds(&self, counters: &[FrameLayerCounters]) -> u64 {
        self.costs.iter().zip(counters).map(|(cost, counters)| cost.of(counters)).sum()
    }
}

fn frames_of_other(network: &str, source: FrameSource) -> CliError {
    CliError::FramesOfOther { network: network.to_owned(), found: source.word() }
}

impl Field {
    /// A sensor that has every pixel of the crop.
    fn around(self) -> Sensor {
        let side = |side: u16, first: u16, count: u16| side.max(first.saturating_add(count));
        let Crop { x, y, width, height } = self.crop;
        Sensor::new(side(self.sensor.width, x, width), side(self.sensor.height, y, height))
    }

    /// Whether frames have pixels that the sensor has not.
    pub(in super::super) fn is_padded(self) -> bool {
        self.around() != self.sensor
    }
}

impl std::fmt::Display for Field {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Self { crop, sensor } = *self;
        if crop == Crop::whole(sensor) {
            return write!(f, "all {}x{} pixels", crop.width, crop.height);
        }
        write!(f, "{crop}")?;
        if self.is_padded() {
            write!(f, ", zeros where the sensor of {sensor} has no pixels")?;
        }
        Ok(())
    }
}
