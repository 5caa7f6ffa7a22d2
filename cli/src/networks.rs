//! `meissner networks`: the shipped networks.

use std::io::{self, Write};

use meissner_engine::frames::FrameShape;
use meissner_models::systems::slip;
use meissner_models::{AnyDescription, Card};
use serde::Serialize;

use crate::args::JsonArgs;
use crate::error::CliError;
use crate::kind::NetworkKind;
use crate::output;
use crate::text::Table;

/// `meissner networks`.
#[derive(Debug, clap::Args)]
pub(crate) struct NetworksArgs {
    #[command(flatten)]
    format: JsonArgs,
}

/// The systems, in the order of the list.
const ANGLE: &str = "contact angle";
const FORCE: &str = "contact force";
const SLIP: &str = "direction of slip";
const AREA: &str = "contact area and normal force";
const DIGITS: &str = "digits (N-MNIST)";
const TOUCH: &str = "objects by touch (NeuTouch)";
const SYSTEMS: [&str; 6] = [ANGLE, FORCE, SLIP, AREA, DIGITS, TOUCH];

/// Name, system and purpose of each shipped network.
const PURPOSES: &[(&str, &str, &str)] = &[
    ("canf", AREA, "U-Net with squeeze-and-excitation, as published"),
    ("canf-plain", AREA, "the same U-Net without squeeze-and-excitation"),
    ("digits-all", DIGITS, "nodes read from all nodes of the window"),
    ("digits-frozen", DIGITS, "nodes read from earlier nodes, chosen on arrival"),
    ("digits-past", DIGITS, "nodes read from earlier nodes of the window"),
    ("event-frame-cnn", ANGLE, "frame-based baseline of the event graphs"),
    ("force-cnnlstm", FORCE, "CNN-LSTM with a prediction at every frame"),
    ("force-convlstm", FORCE, "ConvLSTM with a prediction at every frame"),
    ("force-graph", FORCE, "force at any microsecond from earlier events, over half a second"),
    ("force-lstm", FORCE, "LSTM with a prediction at every frame"),
    ("force-tdnn", FORCE, "static baseline without memory"),
    ("graphres", ANGLE, "the published 7 blocks with fixed scales: incremental"),
    ("graphres-published", ANGLE, "the published network as published: batch mode only"),
    ("slip-best", SLIP, "committee of small networks, for objects that were not trained on"),
    ("slip-lstm", SLIP, "LSTM over the electrodes"),
    ("slip-regularised", SLIP, "regularised ConvLSTM over the tactile image"),
    ("slip-tuned", SLIP, "tuned ConvLSTM over the tactile image"),
    ("tactigraph", ANGLE, "TactiGraph: 10 spline blocks over all nodes of the window"),
    ("tactigraph-frozen", ANGLE, "TactiGraph over earlier nodes, chosen on arrival"),
    (
        "tactigraph-past",
        ANGLE,
        "few blocks over earlier nodes: made for latency, trained on a simulated dome",
    ),
    ("tactip", ANGLE, "depth and tilts of a real sensor (TacTip), over all nodes of the window"),
    ("tactip-frames", ANGLE, "frame-based baseline of tactip"),
    ("tactip-past", ANGLE, "depth and tilts of a real sensor (TacTip), over earlier nodes"),
    ("tactip-shear", ANGLE, "as tactip-past, after a sideways move too"),
    ("touch-containers", TOUCH, "containers and how full they are, from spikes of 39 taxels"),
    ("touch-objects", TOUCH, "objects in a gripper, from spikes of 39 taxels"),
];

/// A shipped network.
#[derive(Debug, Serialize)]
struct Entry {
    name: &'static str,
    system: &'static str,
    purpose: &'static str,
    /// Whether its shipped weights are trained.
    trained: bool,
    /// Columns and rows in pixels of the sensor of the training, or of the part that is read;
    /// `None` if any size fits.
    sensor: Option<[usize; 2]>,
    input: &'static str,
    outputs: Vec<String>,
    units: Vec<String>,
    #[serde(skip)]
    labelled: String,
}

/// Lists the networks.
pub(crate) fn networks(args: &NetworksArgs) -> Result<(), CliError> {
    let entries: Vec<Entry> = AnyDescription::shipped_names().filter_map(Entry::of).collect();
    output::print(args.format.json, &entries, |out| write(out, &entries))
}

impl Entry {
    fn of(name: &'static str) -> Option<Self> {
        let description = AnyDescription::shipped(name)?;
        let &(_, system, purpose) = PURPOSES.iter().find(|(known, ..)| *known == name)?;
        let card = Card::shipped(name)?;
        let (outputs, units) = description.outputs();
        let kind = NetworkKind::of(&description);
        let sensor = match &description {
            AnyDescription::Events(_) => {
                card.sensor.map(|sensor| [sensor.width, sensor.height].map(usize::from))
            }
            AnyDescription::Frames(frames) => match frames.input() {
                FrameShape::Image { width, height, .. } if kind != NetworkKind::Electrodes => {
                    Some([width, height])
                }
                _ => None,
            },
        };
        Some(Self {
            name,
            system,
            purpose,
            trained: card.trained == Some(true),
            sensor,
            input: kind.input(),
            outputs: outputs.to_vec(),
            units: units.to_vec(),
            labelled: labelled(&description),
        })
    }
}

/// The outputs for people: angles are shown in degrees.
fn labelled(description: &AnyDescription) -> String {
    match description.classes() {
        None => description.labelled_outputs().replace("(rad)", "(deg)"),
        Some(classes) if classes == slip::CLASSES => slip::WORDS.join(", "),
        Some([first, .., last]) => format!("classes {first} to {last}"),
        Some(classes) => classes.join(", "),
    }
}

/// Writes a table for each system, with the purpose and the outputs of each network below its row.
fn write(out: &mut impl Write, entries: &[Entry]) -> io::Result<()> {
    let mut table = Table::new(&["network", "sensor", "input"]).left_aligned();
    let ordered =
        || SYSTEMS.iter().flat_map(|system| entries.iter().filter(move |entry| entry.system == *system));
    for entry in ordered() {
        let sensor = match entry.sensor {
            Some([width, height]) => format!("{width}x{height}"),
            None if entry.input == "24 electrodes" => "-".to_owned(),
            None => "any".to_owned(),
        };
        table.row([entry.name.to_owned(), sensor, entry.input.to_owned()]);
    }
    let mut lines = table.lines().into_iter();
    lines.next().map_or(Ok(()), |headings| writeln!(out, "{headings}"))?;
    let mut system = "";
    for (line, entry) in lines.zip(ordered()) {
        if entry.system != system {
            system = entry.system;
            writeln!(out, "\n{system}")?;
        }
        writeln!(out, "{line}\n      {}", entry.purpose)?;
        writeln!(out, "      predicts {}", entry.labelled)?;
    }
    writeln!(out, "\nAll weights are trained. `meissner inspect NETWORK` shows the layers.")
}

#[cfg(test)]
mod tests {
    use super::{Entry, PURPOSES, SYSTEMS, write};
    use meissner_models::AnyDescription;

    #[test]
    fn every_shipped_network_has_a_system_and_a_purpose() {
        let mut names: Vec<&str> = AnyDescription::shipped_names().collect();
        names.sort_unstable();
        assert!(names.iter().eq(PURPOSES.iter().map(|(name, ..)| name)));
        assert!(PURPOSES.iter().all(|(_, system, _)| SYSTEMS.contains(system)));
    }

    #[test]
    fn every_network_is_listed_with_what_it_predicts_for_people() {
        let entries: Vec<Entry> = AnyDescription::shipped_names().filter_map(Entry::of).collect();
        let mut text = Vec::new();
        write(&mut text, &entries).expect("a vector takes everything");
        let text = String::from_utf8(text).expect("text");
        assert_eq!(text.matches("      predicts ").count(), entries.len());
        for expected in [
            "roll, pitch (deg)",
            "depth (mm), tilt_x",
            "anticlockwise, clockwise",
            "classes 0 to 9",
            "force (N)",
        ] {
            assert!(text.contains(expected), "{expected}: {text}");
        }
        assert!(!text.contains("(rad)"), "{text}");
    }

    #[test]
    fn every_shipped_network_is_trained() {
        for name in AnyDescription::shipped_names() {
            assert!(Entry::of(name).is_some_and(|entry| entry.trained), "{name}");
        }
    }
}
