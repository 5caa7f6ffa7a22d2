//! A description of either kind of network.

use std::path::Path;

use super::frames::{FrameDescription, TABLE};
use super::{Description, DescriptionError, Needed, checked, classes, text};
use crate::ModelError;

/// What messages call the two kinds.
pub(super) const EVENTS: &str = "a network over events, with a table [graph]";
pub(super) const FRAMES: &str = "a frame network, with a table [input]";

/// A checked description of either kind of network.
#[derive(Clone, Debug, PartialEq)]
pub enum AnyDescription {
    /// A network over the graph of events.
    Events(Description),
    /// A network over frames.
    Frames(FrameDescription),
}

impl AnyDescription {
    /// Checks the text of a description file: a table `[input]` marks a frame network.
    ///
    /// # Errors
    /// As [`Description::parse`].
    pub fn parse(text: &str) -> Result<Self, DescriptionError> {
        checked(text, |document, problems| match document.line_of(TABLE) {
            Some(_) => FrameDescription::check(document, problems).map(Self::Frames),
            None => Description::check(document, problems).map(Self::Events),
        })
    }

    /// Reads and checks a description file.
    ///
    /// # Errors
    /// As [`Description::load`].
    pub fn load(path: impl AsRef<Path>) -> Result<Self, ModelError> {
        Ok(Self::parse(&text(path.as_ref())?)?)
    }

    /// Name, for reports.
    pub fn name(&self) -> &str {
        match self {
            Self::Events(description) => description.name(),
            Self::Frames(description) => description.name(),
        }
    }

    /// Names of the predicted values, and their unit.
    pub fn outputs(&self) -> (&[String], &str) {
        match self {
            Self::Events(description) => description.outputs(),
            Self::Frames(description) => description.outputs(),
        }
    }

    /// Names of the classes whose logits are predicted; `None` for other values.
    pub fn classes(&self) -> Option<&[String]> {
        classes(self.outputs())
    }

    pub(crate) fn needed(&self) -> Vec<Needed> {
        match self {
            Self::Events(description) => description.needed(),
            Self::Frames(description) => description.needed(),
        }
    }

    /// What weights that are trained for this description carry as metadata `preparation`; `None` for frames that are not
    /// made of readings of electrodes.
    pub fn preparation(&self) -> Option<String> {
        match self {
            Self::Events(description) => Some(description.preparation()),
            Self::Frames(description) => description.preparation(),
        }
    }
}
