//! What a network reads, and the shipped networks that read an input.

use meissner_models::{AnyDescription, FrameDescription, FrameSource};

/// What a network reads.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum NetworkKind {
    /// Events, one by one.
    EventGraph,
    /// Frames of events.
    EventFrames,
    /// Readings of electrodes.
    Electrodes,
    /// Pictures.
    Pictures,
}

use NetworkKind::{Electrodes, EventFrames, EventGraph, Pictures};

impl NetworkKind {
    /// What the network of `description` reads.
    pub(crate) fn of(description: &AnyDescription) -> Self {
        match description {
            AnyDescription::Events(_) => EventGraph,
            AnyDescription::Frames(description) => Self::of_frames(description),
        }
    }

    fn of_frames(description: &FrameDescription) -> Self {
        match description.source() {
            FrameSource::TactileImage(_) | FrameSource::Electrodes(_) => Electrodes,
            FrameSource::Picture(_) => Pictures,
            _ => EventFrames,
        }
    }

    /// Such a network, in messages.
    pub(crate) fn name(self) -> &'static str {
        match self {
            EventGraph => "a network over events",
            EventFrames => "a network over frames of events",
            Electrodes => "a network over electrodes",
            Pictures => "a network over pictures",
        }
    }
}

/// A hint that names the shipped networks that read an input of kind `found`; `None` if there are none.
pub(crate) fn readers(found: meissner_io::Kind) -> Option<String> {
    let (kinds, words): (&[NetworkKind], _) = match found {
        meissner_io::Kind::Events(_) => (&[EventGraph, EventFrames], "recordings of events"),
        meissner_io::Kind::Electrodes => (&[Electrodes], "readings of electrodes"),
        meissner_io::Kind::Picture(_) => (&[Pictures], "pictures"),
        meissner_io::Kind::Folder => (&[Pictures], "folders of pictures"),
        _ => return None,
    };
    let reads = |name: &&str| {
        let kind = AnyDescription::shipped(name).map(|description| NetworkKind::of(&description));
        kind.is_some_and(|kind| kinds.contains(&kind))
    };
    let names: Vec<_> = AnyDescription::shipped_names().filter(reads).collect();
    Some(format!("{words} are for `meissner run INPUT --network NAME`, with {}", names.join(", ")))
}
