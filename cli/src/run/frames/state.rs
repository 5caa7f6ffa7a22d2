//! What a run over frames of events writes beside its engine's state: where the making of frames stands.

use meissner_engine::{LatePolicy, Sensor};
use serde::{Deserialize, Serialize};

use super::FrameModel;
use crate::args::Every;
use crate::error::CliError;
use crate::run::state::Resumed;
use meissner_pipeline::frame_feed::{FeedState, FrameFeed};

/// The note of a snapshot.
#[derive(Debug, Serialize, Deserialize)]
pub(super) struct Note {
    /// How frames are made, and of what.
    pub(super) made: String,
    /// None before the first event.
    pub(super) feed: Option<FeedState>,
    /// Empty frames since the last one with events.
    pub(super) silence: u64,
    /// Frames since the last prediction.
    pub(super) since: u64,
}

/// What tells apart how frames are made.
pub(super) fn made(model: &FrameModel, sensor: Sensor, late: LatePolicy) -> String {
    format!("{:?} on {sensor}, late events: {late:?}", model.source)
}

impl Note {
    /// The note in `resumed`, of a run that made frames of `sensor` as `made` says.
    pub(super) fn read(resumed: &Resumed<'_>, made: &str, sensor: Sensor) -> Result<Self, CliError> {
        let note =
            meissner_engine::snapshot_note(&resumed.bytes).map_err(|source| resumed.refused(source))?;
        let expected = "where the making of frames stands, as `meissner run` writes it".to_owned();
        let note: Self = serde_json::from_slice(note)
            .map_err(|error| resumed.misfit("note", expected, error.to_string()))?;
        if note.made != made {
            return Err(resumed.misfit("frames", made.to_owned(), note.made.chars().take(200).collect()));
        }
        match note.feed.as_ref().and_then(|feed| feed.fault(sensor)) {
            Some((what, expected, found)) => Err(resumed.misfit(what, expected, found)),
            None => Ok(note),
        }
    }

    /// The feed that goes on.
    pub(super) fn resume(
        &self,
        model: &FrameModel,
        sensor: Sensor,
        late: LatePolicy,
        every: Every,
    ) -> Result<Option<FrameFeed>, meissner_engine::representations::RepresentationError> {
        match &self.feed {
            Some(state) => FrameFeed::resume(&model.description, sensor, late, every, state),
            None => FrameFeed::new(&model.description, sensor, late, every),
        }
    }

    pub(super) fn to_bytes(&self) -> Vec<u8> {
        serde_json::to_vec(self).expect("numbers and text are JSON")
    }
}
