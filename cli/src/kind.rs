//! Kinds of input of networks, and the shipped networks for an input.

use NetworkKind::{Electrodes, EventFrames, EventGraph, Pictures};
use meissner_models::{AnyDescription, FrameDescription, FrameSource};

/// The input of a network.
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

impl NetworkKind {
    /// The input of the network of `description`.
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

    /// The input, in the list of networks.
    pub(crate) fn input(self) -> &'static str {
        match self {
            EventGraph => "events",
            EventFrames => "frames of events",
            Electrodes => "24 electrodes",
            Pictures => "pictures",
        }
    }

    /// A network with this input, in messages.
    pub(crate) fn name(self) -> &'static str {
        match self {
            EventGraph => "a network over events",
            EventFrames => "a network over frames of events",
            Electrodes => "a network over electrodes",
            Pictures => "a network over pictures",
        }
    }
}

/// A hint that names the shipped networks that read an input of kind `found`, if there are any.
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
