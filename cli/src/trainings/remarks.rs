//! What files of trainings say about themselves, and where they lie.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use serde::de::DeserializeOwned;

use super::TrainingError;
use crate::error::CliError;
use meissner_pipeline::PipelineError;

/// The metadata of a file.
pub(crate) struct Remarks<'a>(pub(crate) &'a BTreeMap<String, String>);

impl Remarks<'_> {
    /// `key` says something other than `expected`.
    pub(crate) fn refused(&self, key: &'static str, expected: &'static str) -> TrainingError {
        let found = self.0.get(key).map_or_else(|| "none".to_owned(), |text| format!("{text:?}"));
        TrainingError::Metadata { key, expected, found }
    }

    /// What `key` says.
    pub(crate) fn required(&self, key: &'static str, expected: &'static str) -> Result<&str, TrainingError> {
        let text = self.0.get(key).filter(|text| !text.is_empty());
        text.map(String::as_str).ok_or_else(|| self.refused(key, expected))
    }

    /// The number that `key` says, where it is there.
    pub(crate) fn integer(&self, key: &'static str) -> Result<Option<i64>, TrainingError> {
        let number = self.0.get(key).map(|text| text.parse());
        number.transpose().map_err(|_| self.refused(key, "with a whole number"))
    }

    /// The list that `key` says.
    pub(crate) fn list<T: DeserializeOwned>(
        &self,
        key: &'static str,
        expected: &'static str,
    ) -> Result<Vec<T>, TrainingError> {
        let list = self.0.get(key).and_then(|text| serde_json::from_str(text).ok());
        list.ok_or_else(|| self.refused(key, expected))
    }
}

/// The safetensors files in `folder`, by name.
pub(crate) fn files(folder: &Path) -> Result<Vec<PathBuf>, CliError> {
    let list = || -> std::io::Result<Vec<PathBuf>> {
        std::fs::read_dir(folder)?.map(|entry| entry.map(|entry| entry.path())).collect()
    };
    let mut files = list().map_err(|source| PipelineError::Open { path: folder.to_owned(), source })?;
    files.retain(|path| path.extension().is_some_and(|extension| extension == "safetensors"));
    files.sort();
    Ok(files)
}
