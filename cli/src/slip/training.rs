//! Weights with what they say about their training.
//!
//! Enters: a safetensors file, or the weights shipped with a network. Leaves: a [`Training`]: which network, which seed,
//! and what training did not see.

use std::path::{Path, PathBuf};

use meissner_models::Weights;
use meissner_models::systems::slip::ObjectSet;
use serde::Serialize;

use crate::error::CliError;
use crate::trainings::{Remarks, TrainingError};
use meissner_pipeline::PipelineError;
use meissner_pipeline::model::labelled;

/// How a cross-validation splits its windows.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "lowercase")]
pub(crate) enum Scheme {
    /// A recording's windows are on one side.
    Recordings,
    /// Windows are on either side, whatever their recording.
    Windows,
}

/// What training did not see of the set that it was trained on.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum HeldOut {
    /// These recordings.
    Recordings(Vec<String>),
    /// These windows of recordings.
    Windows(Vec<(String, usize)>),
}

impl HeldOut {
    pub(crate) fn scheme(&self) -> Scheme {
        match self {
            Self::Recordings(_) => Scheme::Recordings,
            Self::Windows(_) => Scheme::Windows,
        }
    }
}

/// Weights, and how they came about.
pub(crate) struct Training {
    /// The file; empty for shipped weights.
    pub(crate) path: PathBuf,
    /// Where the weights come from, and what they say about themselves.
    pub(crate) label: String,
    pub(crate) network: String,
    pub(crate) seed: Option<i64>,
    /// Whether they say that they were trained on [`ObjectSet::Basic`].
    pub(crate) trained_on_basic: bool,
    /// The part that a fold holds out; `None` for a whole training.
    pub(crate) held_out: Option<HeldOut>,
    pub(crate) weights: Weights,
}

impl Training {
    /// The weights shipped with `network`.
    pub(crate) fn shipped(network: &str, weights: Weights) -> Self {
        let remarks = Remarks(weights.metadata());
        Self {
            path: PathBuf::new(),
            label: labelled("shipped with the network".to_owned(), &weights),
            network: network.to_owned(),
            seed: remarks.integer("seed").ok().flatten(),
            trained_on_basic: remarks.0.get("trained_on").is_some_and(|set| set == ObjectSet::Basic.name()),
            held_out: None,
            weights,
        }
    }

    /// The training in the file at `path`.
    pub(crate) fn load(path: &Path) -> Result<Self, CliError> {
        let label = path.display().to_string();
        let weights = Weights::load(path).map_err(|source| PipelineError::weights(label.clone(), source))?;
        let failed = |source| CliError::Training { path: path.to_owned(), source };
        let remarks = Remarks(weights.metadata());
        let network = remarks.required("network", "with a network's name").map_err(failed)?;
        let seed = remarks.integer("seed").map_err(failed)?;
        let Some(seed) = seed else {
            return Err(failed(remarks.refused("seed", "with a whole number")));
        };
        remarks.integer("fold").map_err(failed)?;
        let trained_on_basic = trained_on_basic(&remarks).map_err(failed)?;
        let held_out = held_out(&remarks).map_err(failed)?;
        Ok(Self {
            label: labelled(label, &weights),
            path: path.to_owned(),
            network: network.to_owned(),
            seed: Some(seed),
            trained_on_basic,
            held_out,
            weights,
        })
    }

    /// The file as text, where there is one.
    pub(crate) fn files(&self) -> Vec<String> {
        let path = Some(self.path.display().to_string()).filter(|path| !path.is_empty());
        path.into_iter().collect()
    }

    /// The seed as text.
    pub(crate) fn seed_name(&self) -> String {
        self.seed.map_or_else(|| "shipped".to_owned(), |seed| seed.to_string())
    }
}

/// Whether it says that it was trained on Basic; it must.
fn trained_on_basic(remarks: &Remarks<'_>) -> Result<bool, TrainingError> {
    match remarks.0.get("trained_on") {
        Some(set) if set == ObjectSet::Basic.name() => Ok(true),
        _ => Err(remarks.refused("trained_on", "\"Basic\", so that the other sets are unseen,")),
    }
}

/// What a fold says that it held out.
fn held_out(remarks: &Remarks<'_>) -> Result<Option<HeldOut>, TrainingError> {
    const RECORDINGS: &str = "held_out";
    const WINDOWS: &str = "held_out_windows";
    let recordings = || {
        let list = remarks.list(RECORDINGS, "with a JSON list of recordings, such as [\"n/pen178\"]");
        list.map(|list| Some(HeldOut::Recordings(list)))
    };
    let windows = || {
        let list = remarks.list(WINDOWS, "with a JSON list of windows, such as [[\"n/pen178\", 0]]");
        list.map(|list| Some(HeldOut::Windows(list)))
    };
    let has = |key: &str| remarks.0.contains_key(key);
    match remarks.0.get("scheme").map(String::as_str) {
        Some("recordings") => recordings(),
        Some("windows") => windows(),
        None if has(RECORDINGS) && !has(WINDOWS) => recordings(),
        None if has(WINDOWS) && !has(RECORDINGS) => windows(),
        None if !has(WINDOWS) => Ok(None),
        _ => Err(remarks.refused("scheme", "\"recordings\" or \"windows\"")),
    }
}

#[cfg(test)]
mod tests {
    use super::HeldOut;
    use crate::trainings::Remarks;

    fn held_out(entries: &[(&str, &str)]) -> Result<Option<HeldOut>, String> {
        let entries = entries.iter().map(|&(key, value)| (key.to_owned(), value.to_owned())).collect();
        super::held_out(&Remarks(&entries)).map_err(|error| error.to_string())
    }

    #[test]
    fn a_fold_says_what_it_held_out() {
        assert_eq!(held_out(&[("seed", "1")]), Ok(None));
        let recordings = Ok(Some(HeldOut::Recordings(vec!["n/pen1".to_owned()])));
        assert_eq!(held_out(&[("held_out", "[\"n/pen1\"]")]), recordings);
        assert_eq!(held_out(&[("scheme", "recordings"), ("held_out", "[\"n/pen1\"]")]), recordings);
        let windows = Ok(Some(HeldOut::Windows(vec![("n/pen1".to_owned(), 3)])));
        assert_eq!(held_out(&[("scheme", "windows"), ("held_out_windows", "[[\"n/pen1\", 3]]")]), windows);
    }

    #[test]
    fn a_fold_that_says_it_in_another_way_is_refused_with_what_was_expected() {
        for (entries, expected) in [
            (&[("scheme", "objects")][..], "\"recordings\" or \"windows\""),
            (&[("scheme", "windows"), ("held_out", "[]")], "held_out_windows"),
            (&[("held_out", "n/pen1")], "JSON list of recordings"),
            (&[("held_out", "[]"), ("held_out_windows", "[]")], "scheme"),
        ] {
            let error = held_out(entries).unwrap_err();
            assert!(error.contains(expected), "{error}");
        }
    }
}
