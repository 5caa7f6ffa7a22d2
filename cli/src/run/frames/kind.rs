//! What a network reads, and which options mean something to it.

use meissner_models::{AnyDescription, FrameDescription, FrameSource};

use crate::args::{Late, Mode};
use crate::error::CliError;
use crate::run::RunArgs;

/// What a network reads.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::run) enum Kind {
    /// Events, one by one.
    EventGraph,
    /// Frames of events.
    EventFrames,
    /// Readings of electrodes.
    Electrodes,
    /// Pictures.
    Pictures,
}

use Kind::{Electrodes, EventFrames, EventGraph, Pictures};

impl Kind {
    /// What the network of `description` reads.
    pub(super) fn of(description: &FrameDescription) -> Self {
        match description.source() {
            FrameSource::TactileImage(_) | FrameSource::Electrodes(_) => Electrodes,
            FrameSource::Picture(_) => Pictures,
            _ => EventFrames,
        }
    }

    /// What messages call such a network.
    fn name(self) -> &'static str {
        match self {
            EventGraph => "a network over events",
            EventFrames => "a network over frames of events",
            Electrodes => "a network over electrodes",
            Pictures => "a network over pictures",
        }
    }

    /// Refuses what `args` ask for and such a network does not know.
    pub(in crate::run) fn check(self, args: &RunArgs) -> Result<(), CliError> {
        let (input, frames, electrodes) = (&args.input, &args.frames, &args.electrodes);
        let all_frames: &[Self] = &[EventFrames, Electrodes, Pictures];
        let events: &[Self] = &[EventGraph, EventFrames];
        let options: [(&str, bool, &[Self]); 19] = [
            ("--sensor", input.sensor.is_some(), events),
            ("--late clamp", input.late == Late::Clamp, events),
            ("--strict", input.strict, &[EventGraph, EventFrames, Electrodes]),
            ("--every", args.every.is_some(), events),
            ("--save-state", args.state.save_state.is_some(), events),
            ("--resume", args.state.resume.is_some(), events),
            ("--span", input.span_us.is_some(), &[EventGraph]),
            ("--capacity", input.capacity.is_some(), &[EventGraph]),
            ("--mode batch", args.mode == Mode::Batch, &[EventGraph]),
            ("--no-skip", frames.no_skip, all_frames),
            ("--convolution", frames.convolution.is_some(), all_frames),
            ("--threads", frames.threads.is_some(), all_frames),
            ("--longest-silence", frames.longest_silence.is_some(), &[EventFrames]),
            ("--overlay", frames.overlay.is_some(), &[Pictures]),
            ("--full-scale", frames.full_scale.is_some(), &[Pictures]),
            ("--reference", frames.reference.is_some(), &[Pictures]),
            ("--sampling", electrodes.sampling.is_some(), &[Electrodes]),
            ("--hold", electrodes.hold.is_some(), &[Electrodes]),
            ("--least-probability", electrodes.least_probability.is_some(), &[Electrodes]),
        ];
        let of_graphs =
            input.approximations.given().map(|(option, given)| (option, given, &[EventGraph][..]));
        let of_events = input.read.given().map(|(option, given)| (option, given, events));
        let misfit = options
            .into_iter()
            .chain(of_graphs)
            .chain(of_events)
            .find(|(_, given, kinds)| *given && !kinds.contains(&self));
        misfit.map_or(Ok(()), |(option, _, kinds)| {
            let fits = kinds.iter().map(|kind| kind.name()).collect::<Vec<_>>().join(" or ");
            Err(CliError::Misfit { option, fits, network: input.network.clone(), kind: self.name() })
        })
    }
}

/// The shipped networks that read an input of kind `found`, in words; `None` where there is none.
pub(crate) fn readers(found: meissner_io::Kind) -> Option<String> {
    let (kinds, words): (&[Kind], _) = match found {
        meissner_io::Kind::Events(_) => (&[EventGraph, EventFrames], "recordings of events"),
        meissner_io::Kind::Electrodes => (&[Electrodes], "readings of electrodes"),
        meissner_io::Kind::Picture(_) => (&[Pictures], "pictures"),
        meissner_io::Kind::Folder => (&[Pictures], "folders of pictures"),
        _ => return None,
    };
    let reads = |name: &&str| {
        let kind = match AnyDescription::shipped(name) {
            Some(AnyDescription::Events(_)) => EventGraph,
            Some(AnyDescription::Frames(description)) => Kind::of(&description),
            None => return false,
        };
        kinds.contains(&kind)
    };
    let names: Vec<_> = AnyDescription::shipped_names().filter(reads).collect();
    Some(format!("{words} are for `meissner run INPUT --network NAME`, with {}", names.join(", ")))
}
