//! `meissner networks`, `inspect` and `draw`: the shipped networks, a network in detail, drawn
//! weights.

use std::io::{self, Write, stdout};
use std::path::PathBuf;

use meissner_engine::frames::FrameShape;
use meissner_models::systems::slip;
use meissner_models::{AnyDescription, Card, drawn_file};
use meissner_run::model::describe_any;
use serde::Serialize;

use crate::args::{JsonArgs, MEASUREMENT, OUTPUT};
use crate::error::CliError;
use crate::kind::NetworkKind;
use crate::output;
use crate::output::OutArgs;
use crate::stderr::tell;
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
pub(crate) const SYSTEMS: [&str; 6] = [ANGLE, FORCE, SLIP, AREA, DIGITS, TOUCH];

/// Name, system and purpose of each shipped network.
pub(crate) const PURPOSES: &[(&str, &str, &str)] = &[
    ("canf", AREA, "U-Net with squeeze-and-excitation, as published"),
    ("canf-live", AREA, "a U-Net at half resolution, with a twentieth of the work"),
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
    ("touch-letters", TOUCH, "letters of braille under a skin of 8 x 10 taxels"),
    ("touch-objects", TOUCH, "objects in a gripper, from spikes of 39 taxels"),
];

/// A shipped network.
#[derive(Debug, Serialize)]
pub(crate) struct Entry {
    name: &'static str,
    system: &'static str,
    purpose: &'static str,
    /// Whether its shipped weights are trained.
    pub(crate) trained: bool,
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
    pub(crate) fn of(name: &'static str) -> Option<Self> {
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
pub(crate) fn write(out: &mut impl Write, entries: &[Entry]) -> io::Result<()> {
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

/// `meissner inspect`.
#[derive(Debug, clap::Args)]
pub(crate) struct InspectArgs {
    /// Name of a shipped network, or a description file (.toml).
    ///
    /// `meissner networks` lists the shipped networks.
    #[arg(value_name = "NETWORK")]
    network: String,
    /// Print the graph of the layers in Graphviz's DOT language.
    #[arg(long, conflicts_with = "json", help_heading = OUTPUT)]
    dot: bool,
    /// Draw the network into this file, instead of the table.
    #[arg(long, value_name = "FILE", help_heading = OUTPUT)]
    svg: Option<PathBuf>,
    #[command(flatten)]
    format: JsonArgs,
}

/// Prints the network in the requested form.
pub(crate) fn inspect(args: &InspectArgs) -> Result<(), CliError> {
    let (description, _) = describe_any(&args.network)?;
    if let Some(path) = &args.svg {
        output::write(path, description.to_svg())?;
        tell(format_args!("wrote {}", path.display()));
    }
    if args.dot {
        return Ok(stdout().lock().write_all(description.to_dot().as_bytes())?);
    }
    output::print(args.format.json, &description.summary(), |out| match args.svg {
        None => writeln!(out, "{}", description.to_table().trim_end()),
        Some(_) => Ok(()),
    })
}

/// Examples, at the end of the long help.
const EXAMPLES: &str = "\
Examples:
  meissner draw own.toml --out own.safetensors
  meissner bench RECORDING --network own.toml --weights own.safetensors";

/// `meissner draw`.
#[derive(Debug, clap::Args)]
#[command(after_long_help = EXAMPLES)]
pub(crate) struct DrawArgs {
    /// Name of a shipped network, or a description file (.toml).
    #[arg(value_name = "NETWORK")]
    pub(crate) network: String,
    /// Seed; equal seeds give equal bytes on every machine.
    #[arg(long, value_name = "N", default_value_t = 1, help_heading = MEASUREMENT)]
    pub(crate) seed: u64,
    #[command(flatten)]
    file: OutArgs,
}

/// Draws the weights and writes them.
pub(crate) fn draw(args: &DrawArgs) -> Result<(), CliError> {
    let (description, _) = describe_any(&args.network)?;
    let bytes = drawn_file(&description, args.seed);
    // Training may have taken hours.
    args.file.check()?;
    args.file.write(bytes)?;
    let (name, out) = (description.name(), args.file.out.display());
    tell(format_args!("{out}: weights for {name} drawn from seed {}; nothing trained them", args.seed));
    Ok(())
}
