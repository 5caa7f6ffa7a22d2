//! Tables and data of a description of either kind.

use serde::Serialize;

use super::frames::FrameSummary;
use super::summary::Summary;
use crate::AnyDescription;

/// A description of either kind as data; "input" marks a frame network.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(untagged)]
pub enum AnySummary {
    /// Of a network over events.
    Events(Summary),
    /// Of a frame network.
    Frames(FrameSummary),
}

impl AnyDescription {
    /// The description as data.
    pub fn summary(&self) -> AnySummary {
        match self {
            Self::Events(description) => AnySummary::Events(description.summary()),
            Self::Frames(description) => AnySummary::Frames(description.summary()),
        }
    }

    /// What `meissner inspect` prints.
    pub fn to_table(&self) -> String {
        match self {
            Self::Events(description) => description.to_table(),
            Self::Frames(description) => description.to_table(),
        }
    }
}
