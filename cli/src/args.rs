//! What can be asked for on the command line. Whatever is wrong with a single argument is found here, by clap, which
//! exits with status 2.
#![expect(clippy::doc_markdown, reason = "these comments are the help text, which would show the backticks")]

use std::path::PathBuf;
use std::str::FromStr;

use clap::builder::RangedI64ValueParser;
use clap::{Parser, Subcommand, ValueEnum};
use meissner_engine::{LatePolicy, Network, Sensor};
use meissner_io::{ColumnOrder, Format, ReadOptions, TextOptions, TimeUnit};

pub(crate) use crate::approximations::ApproximationArgs;
pub(crate) use crate::bench::BenchArgs;
pub(crate) use crate::draw::DrawArgs;
pub(crate) use crate::eval::EvalArgs;
pub(crate) use crate::pareto::ParetoArgs;
pub(crate) use crate::play::PlayArgs;
pub(crate) use crate::prepare::PrepareArgs;
pub(crate) use crate::run::RunArgs;
pub(crate) use crate::soak::SoakArgs;
pub(crate) use crate::stress::StressArgs;

pub(crate) const STATUS: &str = "Exit status: 0 on success, 1 on bad input (a recording, network or weights that cannot be read \
                      or do not fit), 2 on bad usage, 130 where SIGINT (Ctrl-C) or SIGTERM ended it. A \
                      reader that closes the pipe ends the program with status 0. At the first signal, run, play and soak \
                      end their stream: state, summary; the others, and any at the second signal, end at once, and pareto \
                      --state keeps the measurements that are finished.";

/// Incremental inference for event cameras and event-based touch.
#[derive(Debug, Parser)]
#[command(name = "meissner", version, after_help = STATUS)]
pub(crate) struct Args {
    /// What to do.
    #[command(subcommand)]
    pub(crate) command: Command,
}

/// The subcommands.
#[derive(Debug, Subcommand)]
pub(crate) enum Command {
    /// Run a network over a recording or a live stream: predictions, latencies, and what was skipped.
    Run(RunArgs),
    /// Play a recording at real speed against a bounded queue: reports by a deadline, what was dropped, what was late.
    Play(PlayArgs),
    /// Measure: latencies by phase, work per layer, shares of the stages, memory, missed deadlines.
    Bench(BenchArgs),
    /// Show a network: layers, shapes, parameters, multiply-adds, receptive fields.
    Inspect(InspectArgs),
    /// Draw weights for a network from a seed.
    Draw(DrawArgs),
    /// Show a recording: format, geometry, counts, span, rates, other streams.
    Info(InfoArgs),
    /// Write a recording in another format.
    Convert(ConvertArgs),
    /// Judge networks on a labelled data set: accuracies, precision, recall, F1, confusion matrices.
    Eval(EvalArgs),
    /// Run time against error: a network exactly, and with each approximation.
    Pareto(ParetoArgs),
    /// Write what a network reads, with labels, for training.
    Prepare(PrepareArgs),
    /// Streams, weights and states that are built to hurt: whether every promise holds, and errors against f64.
    Stress(StressArgs),
    /// Recordings round and round for very long: bits, memory and latencies at the end as at the start.
    Soak(SoakArgs),
}

/// How a recording is read.
#[derive(Clone, Copy, Debug, clap::Args)]
pub(crate) struct ReadArgs {
    /// Order of the columns of a text of events: t, x, y, p, and _ for each other column, such as xytp.
    ///
    /// Without it, a header says the order, or the values do where they leave no doubt; where several orders fit, the text is
    /// refused. On standard input the first line decides: with commas it is t,x,y,p where it can be.
    #[arg(long, value_name = "ORDER")]
    pub(crate) columns: Option<ColumnOrder>,
    /// Unit of the times of a text of events.
    ///
    /// Without it, the header says the unit (such as t_ms); else whole numbers are microseconds, numbers with a point and four or more
    /// decimals are seconds, and fewer decimals are refused. Finer times are rounded to the nearest microsecond.
    #[arg(long, value_name = "s|ms|us|ns")]
    pub(crate) time_unit: Option<TimeUnit>,
    /// Read a recording that was cut short as far as it is whole, and say what is left out.
    #[arg(long)]
    pub(crate) salvage: bool,
}

impl ReadArgs {
    /// What they say, for the reader.
    pub(crate) fn options(self) -> ReadOptions {
        let text = TextOptions { columns: self.columns, time_unit: self.time_unit };
        ReadOptions { format: None, text, salvage: self.salvage }
    }

    /// The options, and whether each is given.
    pub(crate) fn given(self) -> [(&'static str, bool); 3] {
        [
            ("--columns", self.columns.is_some()),
            ("--time-unit", self.time_unit.is_some()),
            ("--salvage", self.salvage),
        ]
    }
}

/// What `run`, `play` and `bench` work on.
#[derive(Debug, clap::Args)]
pub(crate) struct Input {
    /// Recording (AEDAT4, EVT2, EVT3, DAT, N-MNIST, CSV or other text, npy), or - for such text (t,x,y,p in microseconds) on standard
    /// input as it arrives. Without it: a small synthetic press and release that the program holds.
    ///
    /// For a network over electrodes: CSV with a column for each of the 24, or - for the same on standard input. For a
    /// network over pictures: a PNG, JPEG, PPM or PGM file, a folder of them, or a list of paths, one a line.
    #[arg(value_name = "INPUT")]
    pub(crate) recording: Option<PathBuf>,
    /// Name of a shipped network, or a description file (.toml, which needs --weights).
    #[arg(long, value_name = "NAME|FILE.toml", default_value = crate::model::DEFAULT_NETWORK)]
    pub(crate) network: String,
    /// Weights: safetensors, or a PyTorch state dict. Without it those shipped for the network.
    #[arg(long, value_name = "FILE")]
    pub(crate) weights: Option<PathBuf>,
    /// Run weights that were trained on another preparation (graph, scales, span, cells, frames) than the network computes.
    ///
    /// Without it such weights are refused. With it the predictions are not those that the weights were trained for, and
    /// every output says so.
    #[arg(long)]
    pub(crate) ignore_preparation: bool,
    /// Columns x rows of the sensor in pixels, in place of what the recording says; events outside it are dropped.
    ///
    /// Needed where the recording does not say. CSV says it in a line `# sensor WxH` before the first event; without
    /// this option, standard input is therefore waited for up to its first event.
    #[arg(long, value_name = "WxH", value_parser = sensor)]
    pub(crate) sensor: Option<Sensor>,
    /// Length of the window in microseconds, in place of the description's.
    #[arg(long, value_name = "N", value_parser = span_us())]
    pub(crate) span_us: Option<i64>,
    /// Most events that the window holds, in place of the description's.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=Network::LARGEST_CAPACITY as i64))]
    pub(crate) capacity: Option<u32>,
    /// Most events that are taken from the recording.
    #[arg(long, value_name = "N")]
    pub(crate) limit: Option<u64>,
    /// End with an error at the first line of a text that is no event, or no reading, instead of passing it over.
    ///
    /// Without it, such a line is counted ("lines_refused"), the first five are named on standard error, and the stream goes
    /// on; more than half of the first 100 lines, or of a shorter text, are an error. With it, standard input is summed up
    /// to the line, and of a file of events nothing is run.
    #[arg(long)]
    pub(crate) strict: bool,
    /// What becomes of an event that is earlier than one before it: drop it, or let it in at the newest time.
    #[arg(long, value_enum, default_value_t = Late::Drop)]
    pub(crate) late: Late,
    /// How the recording is read.
    #[command(flatten)]
    pub(crate) read: ReadArgs,
    /// What makes results cheaper and less exact.
    #[command(flatten)]
    pub(crate) approximations: ApproximationArgs,
}

/// `meissner inspect`.
#[derive(Debug, clap::Args)]
#[command(after_help = STATUS)]
pub(crate) struct InspectArgs {
    /// Name of a shipped network, or a description file.
    pub(crate) network: String,
    /// The graph of the layers in Graphviz's DOT language.
    #[arg(long, conflicts_with = "json")]
    pub(crate) dot: bool,
    /// Write a drawing of the network to this file.
    #[arg(long, value_name = "FILE")]
    pub(crate) svg: Option<PathBuf>,
    /// One JSON object.
    #[arg(long)]
    pub(crate) json: bool,
}

/// `meissner info`.
#[derive(Debug, clap::Args)]
#[command(after_help = STATUS)]
pub(crate) struct InfoArgs {
    /// Recording, or - for text on standard input.
    pub(crate) recording: PathBuf,
    /// How it is read.
    #[command(flatten)]
    pub(crate) read: ReadArgs,
    /// One JSON object.
    #[arg(long)]
    pub(crate) json: bool,
}

/// `meissner convert`.
#[derive(Debug, clap::Args)]
#[command(after_help = STATUS)]
pub(crate) struct ConvertArgs {
    /// Recording to read, or - for text on standard input.
    #[arg(value_name = "IN")]
    pub(crate) input: PathBuf,
    /// File to write, which must not exist (see --force), or - for standard output, which needs --to.
    #[arg(value_name = "OUT")]
    pub(crate) output: PathBuf,
    /// Replace OUT where it exists.
    #[arg(long, short)]
    pub(crate) force: bool,
    /// How IN is read.
    #[command(flatten)]
    pub(crate) read: ReadArgs,
    /// Format to write; without it OUT's extension says (.csv, .npy, .dat, .evt3, .raw).
    #[arg(long, value_name = "FORMAT", value_enum)]
    pub(crate) to: Option<To>,
    /// Columns x rows of the sensor in pixels, for the header, in place of what IN says.
    #[arg(long, value_name = "WxH", value_parser = sensor)]
    pub(crate) sensor: Option<Sensor>,
}

/// How predictions are computed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum Mode {
    /// What an event changes.
    Incremental,
    /// Every row, at every prediction.
    Batch,
}

/// What becomes of late events.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum Late {
    /// Dropped and counted.
    Drop,
    /// Accepted at the newest time, and counted.
    Clamp,
}

impl From<Late> for LatePolicy {
    fn from(late: Late) -> Self {
        match late {
            Late::Drop => Self::Drop,
            Late::Clamp => Self::Clamp,
        }
    }
}

/// The formats that can be written.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum To {
    /// Text, one event a line.
    Csv,
    /// NumPy structured array.
    Npy,
    /// Prophesee DAT, version 2.
    Dat,
    /// Prophesee EVT 3.0.
    Evt3,
}

impl From<To> for Format {
    fn from(to: To) -> Self {
        match to {
            To::Csv => Self::Csv,
            To::Npy => Self::Npy,
            To::Dat => Self::Dat,
            To::Evt3 => Self::Evt3,
        }
    }
}

/// When a prediction is read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Every {
    /// Once, at the end.
    End,
    /// After so many accepted events.
    Events(u64),
    /// After so many microseconds of stream time.
    StreamUs(i64),
}

impl FromStr for Every {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let every = match text {
            "event" => Some(Self::Events(1)),
            "end" => Some(Self::End),
            _ => match text.strip_suffix("us") {
                Some(period) => period.parse().ok().filter(|&us| us > 0).map(Self::StreamUs),
                None => text.parse().ok().filter(|&events| events > 0).map(Self::Events),
            },
        };
        every.ok_or_else(|| {
            "expected `event`, `end`, a number of events above 0 such as 100, or of microseconds such as 1000us"
                .to_owned()
        })
    }
}

/// Reads a length of stream time: 1 microsecond to the longest span.
pub(crate) fn span_us() -> RangedI64ValueParser<i64> {
    clap::value_parser!(i64).range(1..=Network::LONGEST_SPAN_US)
}

/// Reads columns x rows.
pub(crate) fn sensor(text: &str) -> Result<Sensor, String> {
    let side = |text: &str| text.parse().ok().filter(|&side: &u16| side > 0);
    let parse = || {
        let (width, height) = text.split_once('x')?;
        Some(Sensor::new(side(width)?, side(height)?))
    };
    parse().ok_or_else(|| "expected columns x rows, each 1 to 65535, such as 346x260".to_owned())
}

#[cfg(test)]
mod tests {
    use super::{Args, Every, sensor};
    use clap::CommandFactory;

    #[test]
    fn the_arguments_are_consistent() {
        Args::command().debug_assert();
    }

    #[test]
    fn every_reads_events_and_microseconds_and_refuses_nothing_and_less() {
        assert_eq!("event".parse(), Ok(Every::Events(1)));
        assert_eq!("end".parse(), Ok(Every::End));
        assert_eq!("100".parse(), Ok(Every::Events(100)));
        assert_eq!("1000us".parse(), Ok(Every::StreamUs(1000)));
        for wrong in ["", "0", "0us", "-1", "-5us", "1ms", "us", "events", "1.5", "99999999999999999999"] {
            assert!(wrong.parse::<Every>().is_err(), "{wrong}");
        }
    }

    #[test]
    fn a_sensor_has_at_least_one_pixel_on_each_axis() {
        assert!(sensor("346x260").is_ok_and(|s| (s.width, s.height) == (346, 260)));
        for wrong in ["", "346", "346x", "0x260", "346x0", "70000x1", "3x4x5", "346X260 "] {
            assert!(sensor(wrong).is_err(), "{wrong}");
        }
    }
}
