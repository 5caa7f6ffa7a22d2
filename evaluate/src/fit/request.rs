//! What is asked for: a network whose layers of events are kept, labels, and how they are fitted.

use std::fs;
use std::path::PathBuf;

use meissner_models::{Description, ModelError, Weights};
use meissner_run::RunError;
use meissner_run::model::{describe, labelled, weights};

use crate::error::{EvaluateError, RequestPart, Result};

/// Default of [`Options::folds`].
pub const DEFAULT_FOLDS: usize = 5;
/// Default of [`Options::ages`].
pub const DEFAULT_AGES: usize = 3;

/// What is fitted, and how.
#[derive(Clone, Debug)]
pub struct Options {
    /// Name of a shipped network over events, or path of a description file.
    pub network: String,
    /// File with its weights; `None` selects those shipped with it.
    pub weights: Option<PathBuf>,
    /// The name of the fitted network.
    pub name: String,
    /// Names of the labels; `None`: all numbers, or else the first label of classes.
    pub labels: Option<Vec<String>>,
    /// Parts of the presses, each of which is held out once.
    pub folds: usize,
    /// Random instants of each press, beside its end.
    pub ages: usize,
    /// Of random instants, of the presses of a learning curve, and of intervals.
    pub seed: u64,
}

impl Options {
    /// Options for `network` with its shipped weights, and the name of the fitted one.
    pub fn new(network: impl Into<String>, name: impl Into<String>) -> Self {
        let (network, name, weights, labels) = (network.into(), name.into(), None, None);
        Self { network, weights, name, labels, folds: DEFAULT_FOLDS, ages: DEFAULT_AGES, seed: 0 }
    }
}

/// The network whose layers of events are kept.
pub(super) struct Base {
    pub(super) name: String,
    pub(super) description: Description,
    pub(super) weights: Weights,
    pub(super) label: String,
    pub(super) stride: usize,
}

impl Base {
    /// The network of `options`, and the text of its description.
    pub(super) fn load(options: &Options) -> Result<(Self, String)> {
        let name = &options.network;
        let (description, shipped) = describe(name)?;
        if !description.layers().iter().any(|layer| layer.convolution().is_some()) {
            let found = format!("{name}, whose readout reads the events themselves");
            return Err(EvaluateError::request(
                RequestPart::Networks,
                "a network with layers of events",
                found,
            ));
        }
        let (weights, label) = weights(name, shipped, options.weights.as_deref())?;
        let card = weights.card().map_err(|source| RunError::weights(label.clone(), source))?;
        let unread =
            |source| RunError::description(name.clone(), ModelError::Read { path: name.into(), source });
        let text = match Description::shipped_text(name).filter(|_| shipped) {
            Some(text) => text.to_owned(),
            None => fs::read_to_string(name).map_err(unread)?,
        };
        let label = labelled(label, &weights);
        let base =
            Self { name: description.name().to_owned(), description, stride: card.stride, weights, label };
        Ok((base, text))
    }
}
