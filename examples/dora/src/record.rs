//! The recorder: messages of the other nodes, as lines of JSON in a file.
//!
//! Each line is a [`Line`], and is complete in the file before the recorder waits for the next
//! message. A restarted recorder continues at the end of the file.

use std::fs::{File, OpenOptions};
use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};
use std::time::Duration;

use clap::Args;
use meissner_packets::{Gap, PacketError, failed};
use serde::{Deserialize, Serialize};

use crate::message::{
    self, CommandHeader, Counter, LossHeader, PredictionHeader, Stamp, read_texts, read_turn, read_values,
};
use crate::node::{Inputs, Message, Outputs, start};

/// Longest wait for a message.
const NAP: Duration = Duration::from_millis(100);

/// Options of the recorder.
#[derive(Clone, Debug, Args)]
pub(crate) struct RecordOptions {
    /// The file; what it has is kept
    file: PathBuf,
}

/// A line of a record.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "snake_case")]
pub(crate) enum Line {
    /// A prediction.
    Prediction {
        #[serde(flatten)]
        header: PredictionHeader,
        /// Its arrival here.
        recorded_ns: i64,
        values: Vec<f32>,
    },
    /// Events that no prediction covers.
    Loss {
        #[serde(flatten)]
        header: LossHeader,
        /// Life of the inference node.
        boot: i64,
        #[serde(flatten)]
        gap: Gap,
    },
    /// Counts of a node.
    Counters {
        /// Life of the node.
        boot: i64,
        counters: Vec<Counter>,
    },
    /// A command of the controller.
    Command {
        #[serde(flatten)]
        header: CommandHeader,
        sent_ns: i64,
        /// Roll and pitch in radians.
        turn: Vec<f64>,
    },
    /// Messages that did not arrive here.
    Missed { input: String, messages: u64, reason: String },
}

impl Line {
    /// The lines for `message`.
    fn of(message: &Message) -> Result<Vec<Self>, PacketError> {
        let Message { input, metadata, data, received_ns } = message;
        let Stamp { boot, sent_ns, .. } = message::read(metadata)?;
        Ok(match output(input) {
            "predictions" => {
                let header = message::read(metadata)?;
                vec![Self::Prediction { header, recorded_ns: *received_ns, values: read_values(data)? }]
            }
            "losses" => {
                let header: LossHeader = message::read(metadata)?;
                let gaps = read_texts(data)?.into_iter();
                gaps.map(|gap| Self::Loss { header: header.clone(), boot, gap }).collect()
            }
            "commands" => {
                vec![Self::Command { header: message::read(metadata)?, sent_ns, turn: read_turn(data)? }]
            }
            _ => vec![Self::Counters { boot, counters: read_texts(data)? }],
        })
    }
}

/// The kind of an input: its name up to the first dash, so that there can be several of a kind.
pub(crate) fn output(input: &str) -> &str {
    input.split_once('-').map_or(input, |(output, _)| output)
}

/// The lines of the record in the file at `path`.
///
/// # Errors
/// The file cannot be read.
pub(crate) fn read(path: &Path) -> Result<Vec<Line>, PacketError> {
    let text = std::fs::read_to_string(path).map_err(failed(path.display().to_string()))?;
    let line = |(number, line): (usize, &str)| {
        serde_json::from_str(line).map_err(failed(format!("line {} of the record", number + 1)))
    };
    text.lines().enumerate().map(line).collect()
}

/// Runs the node until the dataflow ends.
///
/// # Errors
/// The file cannot be written, or the daemon cannot be reached.
pub(crate) fn run(options: &RecordOptions) -> Result<(), PacketError> {
    let file = |source: std::io::Error| failed(options.file.display().to_string())(source);
    if let Some(folder) = options.file.parent() {
        std::fs::create_dir_all(folder).map_err(file)?;
    }
    let opened = OpenOptions::new().create(true).append(true).open(&options.file).map_err(file)?;
    let mut to = BufWriter::new(opened);
    let (outputs, mut inputs) = start()?;
    while !inputs.have_ended() {
        for message in inputs.take(NAP) {
            write(&message, &mut inputs, &outputs, &mut to).map_err(file)?;
        }
        to.flush().map_err(file)?;
    }
    Ok(())
}

fn write(
    message: &Message,
    inputs: &mut Inputs,
    outputs: &Outputs,
    to: &mut BufWriter<File>,
) -> std::io::Result<()> {
    let mut put = |line: &Line| {
        serde_json::to_writer(&mut *to, line)?;
        to.write_all(b"\n")
    };
    let missing = inputs.missing(message).and_then(|missing| Ok((missing, Line::of(message)?)));
    match missing {
        Ok((missing, lines)) => {
            if let Some((messages, reason)) = missing {
                let (input, reason) = (message.input.clone(), reason.name().to_owned());
                put(&Line::Missed { input, messages, reason })?;
            }
            lines.iter().try_for_each(put)
        }
        Err(error) => {
            outputs.warn_of(message, &error);
            Ok(())
        }
    }
}
