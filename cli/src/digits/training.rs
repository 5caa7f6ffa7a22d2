//! Weights with what they say about their training.
//!
//! Enters: a file of weights, or the weights shipped with a network. Leaves: a [`Training`]: which network, which seed,
//! which recordings it has not seen, and on how many of the events it was trained.

use std::path::{Path, PathBuf};

use meissner_models::Weights;

use crate::error::CliError;
use crate::trainings::{Remarks, TrainingError};
use meissner_pipeline::PipelineError;
use meissner_pipeline::model::labelled;

/// Weights, and how they came about.
#[derive(Clone)]
pub(crate) struct Training {
    /// The file; empty for shipped weights.
    pub(crate) path: PathBuf,
    /// Where the weights come from, and what they say about themselves.
    pub(crate) label: String,
    /// What they were trained as.
    pub(crate) network: String,
    pub(crate) seed: Option<i64>,
    /// The recordings that a fold holds out; `None` for a whole training.
    pub(crate) held_out: Option<Vec<String>>,
    /// They were trained on every `stride`-th event.
    pub(crate) stride: usize,
    pub(crate) weights: Weights,
}

impl Training {
    /// The weights shipped with `network`.
    pub(crate) fn shipped(network: &str, weights: Weights) -> Result<Self, CliError> {
        let label = labelled("shipped with the network".to_owned(), &weights);
        Self::whole(PathBuf::new(), label, network, weights)
    }

    /// The weights for `network` in the file at `path`, a whole training whatever else it says about itself.
    pub(crate) fn given(path: &Path, network: &str) -> Result<Self, CliError> {
        let weights = read(path)?;
        if weights.metadata().contains_key("held_out") {
            let (expected, found) =
                ("a whole training".to_owned(), "a fold: judge it with --trainings".to_owned());
            return Err(CliError::Option { option: "--weights", expected, found });
        }
        let label = labelled(path.display().to_string(), &weights);
        Self::whole(path.to_owned(), label, network, weights)
    }

    fn whole(path: PathBuf, label: String, network: &str, weights: Weights) -> Result<Self, CliError> {
        let remarks = Remarks(weights.metadata());
        let stride = stride(&weights, &label)?;
        let seed = remarks.integer("seed").ok().flatten();
        Ok(Self { path, label, network: network.to_owned(), seed, held_out: None, stride, weights })
    }

    /// The training in the file at `path`.
    pub(crate) fn load(path: &Path) -> Result<Self, CliError> {
        let weights = read(path)?;
        let failed = |source| CliError::Training { path: path.to_owned(), source };
        let remarks = Remarks(weights.metadata());
        let network = remarks.required("network", "with a network's name").map_err(failed)?;
        let seed = remarks.integer("seed").map_err(failed)?;
        if seed.is_none() {
            return Err(failed(remarks.refused("seed", "with a whole number")));
        }
        remarks.integer("fold").map_err(failed)?;
        let held_out = held_out(&remarks).map_err(failed)?;
        Ok(Self {
            label: labelled(path.display().to_string(), &weights),
            path: path.to_owned(),
            network: network.to_owned(),
            seed,
            held_out,
            stride: stride(&weights, &path.display().to_string())?,
            weights,
        })
    }

    /// The file as text, where there is one.
    pub(crate) fn files(&self) -> Vec<String> {
        let path = Some(self.path.display().to_string()).filter(|path| !path.is_empty());
        path.into_iter().collect()
    }
}

/// A seed as text.
pub(crate) fn seed_name(seed: Option<i64>) -> String {
    seed.map_or_else(|| "shipped".to_owned(), |seed| seed.to_string())
}

fn read(path: &Path) -> Result<Weights, CliError> {
    let failed = |source| PipelineError::weights(path.display().to_string(), source);
    Ok(Weights::load(path).map_err(failed)?)
}

/// What a fold held out; a whole training must have left out the split test.
fn held_out(remarks: &Remarks<'_>) -> Result<Option<Vec<String>>, TrainingError> {
    if remarks.0.contains_key("held_out") {
        let list = remarks.list("held_out", "with a JSON list of recordings, such as [\"train/3/00123\"]");
        return list.map(Some);
    }
    match remarks.0.get("trained_on").map(String::as_str) {
        Some("train") => Ok(None),
        _ => Err(remarks.refused("trained_on", "\"train\", or \"held_out\" with a JSON list of recordings,")),
    }
}

fn stride(weights: &Weights, label: &str) -> Result<usize, CliError> {
    let failed = |source| PipelineError::Weights { weights: label.into(), source: Box::new(source) };
    Ok(weights.card().map_err(failed)?.stride)
}
