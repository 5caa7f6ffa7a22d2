//! The recorder: what the other nodes say, as lines of JSON in a file.
//!
//! Each line is a [`Line`], and is complete in the file before the recorder waits for the next
//! message. A restarted recorder goes on at the end of the file.

use std::fs::{File, OpenOptions};
use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};
use std::time::Duration;

use clap::Args;
use meissner_packets::Gap;
use serde::{Deserialize, Serialize};

use crate::message::{
    self, CommandHeader, Counter, LossHeader, MessageError, PredictionHeader, Stamp, read_texts, read_turn,
    read_values,
};
use crate::node::{Failure, Inputs, Message, Outputs, start};

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
        /// What it covers, and when it was made.
        #[serde(flatten)]
        header: PredictionHeader,
        /// When it arrived here.
        recorded_ns: i64,
        /// The outputs of the network.
        values: Vec<f32>,
    },
    /// Events that no prediction covers.
    Loss {
        /// Where they belong.
        #[serde(flatten)]
        header: LossHeader,
        /// Life of the inference node.
        boot: i64,
        /// Which events, and why.
        #[serde(flatten)]
        gap: Gap,
    },
    /// Counts of a node.
    Counters {
        /// Life of the node.
        boot: i64,
        /// The counts.
        counters: Vec<Counter>,
    },
    /// A command of the controller.
    Command {
        /// What it was made from.
        #[serde(flatten)]
        header: CommandHeader,
        /// When it was sent.
        sent_ns: i64,
        /// Roll and pitch in radians.
        turn: Vec<f64>,
    },
    /// Messages that did not arrive here.
    Missed {
        /// The input.
        input: String,
        /// Their number.
        messages: u64,
        /// Why.
        reason: String,
    },
}

impl Line {
    /// The lines that say what `message` says.
    fn of(message: &Message) -> Result<Vec<Self>, MessageError> {
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

/// What an input has: its name up to the first dash, so that there can be several of a kind.
fn output(input: &str) -> &str {
    input.split_once('-').map_or(input, |(output, _)| output)
}

/// The lines of the record in the file at `path`.
///
/// # Errors
/// It cannot be read.
pub(crate) fn read(path: &Path) -> Result<Vec<Line>, Failure> {
    let file = |source| Failure::File { path: path.display().to_string(), source };
    let text = std::fs::read_to_string(path).map_err(file)?;
    let lines = text.lines().enumerate();
    let line = |(number, line): (usize, &str)| {
        serde_json::from_str(line).map_err(|source| Failure::Record { line: number + 1, source })
    };
    lines.map(line).collect()
}

/// Runs the node until the dataflow ends.
///
/// # Errors
/// The file cannot be written, or the daemon cannot be reached.
pub(crate) fn run(options: &RecordOptions) -> Result<(), Failure> {
    let file = |source| Failure::File { path: options.file.display().to_string(), source };
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
            outputs.warn(&format!("{}: {error}", message.input));
            Ok(())
        }
    }
}

#[cfg(test)]
mod tests {
    use super::{Line, output};
    use crate::message::PredictionHeader;

    #[test]
    fn a_line_is_read_back_with_the_bits_of_its_values() {
        let header = PredictionHeader {
            sensor: "finger".to_owned(),
            stream: 1,
            boot: 2,
            number: 3,
            order: 4,
            next: 5,
            accepted: 5,
            t_us: Some(6),
            nodes: 7,
            fresh: false,
            events_sent_ns: 8,
            events_received_ns: 9,
            sent_ns: 10,
        };
        // A value of each exponent, with an odd mantissa.
        let values = (0..255_u32).map(|exponent| f32::from_bits(exponent << 23 | 0x2a_aaab)).collect();
        let line = Line::Prediction { header, recorded_ns: 11, values };
        let text = serde_json::to_string(&line).unwrap();
        assert_eq!(serde_json::from_str::<Line>(&text).unwrap(), line);
        assert!(text.starts_with(r#"{"kind":"prediction","sensor":"finger""#), "{text}");
    }

    #[test]
    fn several_inputs_of_a_kind_have_names_with_a_dash() {
        assert_eq!(["counters", "counters-source", "losses"].map(output), ["counters", "counters", "losses"]);
    }
}
