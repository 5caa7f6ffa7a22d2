//! `meissner run` for frame networks: events, electrodes or pictures into frames, frames into predictions.
//!
//! What the description's `[input]` says decides what is read ([`Kind`]). Only making frames, pushing them and
//! predictions are timed: neither reading nor writing.

mod electrodes;
mod events;
mod header;
mod kind;
mod overlay;
mod pictures;
mod report;
mod state;
mod summary;

use std::sync::Arc;

use meissner_engine::frames::{FrameNetwork, FrameOptions, Skip};
use meissner_engine::representations::Sampling;
use meissner_models::{FrameDescription, FrameSource};

use super::args::{RunArgs, Way};
use crate::error::CliError;
pub(super) use kind::Kind;
pub(crate) use kind::readers;
use meissner_pipeline::frame_predictor::FramePredictor;
use meissner_pipeline::model::{frame_network, weights};
use meissner_pipeline::provenance::{Header, InputCard, ModelCard};

/// A frame network that can run, and what to say about it.
struct FrameModel {
    description: FrameDescription,
    /// What the description says makes the frames, with what the arguments say in its place.
    source: FrameSource,
    network: Arc<FrameNetwork>,
    /// What it is, with which weights.
    card: ModelCard,
}

/// Runs the network of `description`, which is `shipped` or of a file, as `args` ask for.
pub(super) fn run(args: &RunArgs, description: FrameDescription, shipped: bool) -> Result<(), CliError> {
    let kind = Kind::of(&description);
    kind.check(args)?;
    let model = FrameModel::load(args, description, shipped)?;
    let options = FrameOptions::new()
        .with_skip(match args.input.approximations.tolerance {
            Some(tolerance) => Skip::Tolerance(tolerance),
            None if args.frames.no_skip => Skip::Nothing,
            None => Skip::Exact,
        })
        .with_sparse(kind == Kind::EventFrames)
        .with_two_threads(args.frames.threads == Some(2));
    let machine = FramePredictor::new(Arc::clone(&model.network), options)?;
    match model.source {
        FrameSource::TactileImage(readings) | FrameSource::Electrodes(readings) => {
            electrodes::run(args, &model, machine, readings)
        }
        FrameSource::Picture(settings) => pictures::run(args, &model, machine, settings),
        _ => events::run(args, &model, machine),
    }
}

impl FrameModel {
    fn load(args: &RunArgs, description: FrameDescription, shipped: bool) -> Result<Self, CliError> {
        let source = with_sampling(*description.source(), args.electrodes.sampling);
        let (weights, label) = weights(&args.input.network, shipped, args.input.weights.as_deref())?;
        let convolution = args.frames.convolution.unwrap_or(Way::Direct).into();
        let ignore = args.input.ignore_preparation;
        let (network, card) = frame_network(&description, (&weights, label), convolution, ignore)?;
        Ok(Self { description, source, network, card })
    }

    /// Where results over `input` come from, warned about.
    fn header(&self, input: InputCard) -> Header {
        let header = Header::new("run", input, self.card.clone());
        header.warn();
        header
    }
}

/// `source` with `sampling` in place of its own, where it has one and another is given.
fn with_sampling(mut source: FrameSource, sampling: Option<Sampling>) -> FrameSource {
    if let FrameSource::TactileImage(readings) | FrameSource::Electrodes(readings) = &mut source {
        readings.sampling = sampling.unwrap_or(readings.sampling);
    }
    source
}
